"""What `tumble --help` and `tumble COMMAND --help` print: what it is for, an example, then the options."""

from __future__ import annotations

from itertools import groupby
from typing import Any

from tumble.cli.groups import ADVANCED, FILE, FIRST, PLACE, PRINTED, RECORD
from tumble.cli.terminal import console

# How far the texts stand from the left; a longer spelling has a line of its own and is never cut.
_INDENT = 26
_NEEDED = (FIRST, PLACE, FILE)
_LAST = (RECORD, ADVANCED, PRINTED)


def print_help(command: Any, context: Any) -> None:
    """Print a command's help.

    Parameters
    ----------
    command, context : typer's.
    """
    from rich.padding import Padding
    from rich.text import Text

    screen = console()
    panels: dict[str, dict[str, str]] = command.panels() if hasattr(command, "panels") else {}
    after = ["COMMAND ..."] if panels else _arguments(command, context)
    words = [context.command_path, "[OPTIONS]", *after]
    screen.print(Text.assemble(("Usage: ", "yellow"), " ".join(words)))
    for paragraph in (command.help or "").split("\n\n"):
        example = paragraph.startswith("tumble ")
        screen.print()
        screen.print(Padding(Text(paragraph, "bold cyan" if example else ""), (0, 0, 0, 2 if example else 0)))
    for title, sentences in panels.items():
        screen.print(Text(f"\n{title}", "bold"))
        for name, sentence in sentences.items():
            _print_row(screen, f"  {name}", sentence)
    for title, parameters in groupby(
        _ordered(command.get_params(context)), key=lambda one: "Options" if panels else _panel(one)
    ):
        screen.print(Text(f"\n{title}", "bold"))
        for parameter in parameters:
            _print_row(screen, f"  {_spelled(parameter)}", _words(parameter))


def _ordered(parameters: list[Any]) -> list[Any]:
    """Arguments, what people need first, what is the command's own, and what all commands have."""
    seen = [_panel(parameter) for parameter in parameters]
    own = [title for title in dict.fromkeys(seen) if title not in ("Arguments", *_NEEDED, *_LAST)]
    order = ["Arguments", *_NEEDED, *own, *_LAST]
    return sorted(parameters, key=lambda parameter: order.index(_panel(parameter)))


def _panel(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return "Arguments"
    return getattr(parameter, "rich_help_panel", None) or ADVANCED


def _arguments(command: Any, context: Any) -> list[str]:
    return [_spelled(one) for one in command.get_params(context) if one.param_type_name == "argument"]


def _spelled(parameter: Any) -> str:
    """An option's spellings and what stands for its value; a flag's two spellings with a stroke."""
    if parameter.param_type_name == "argument":
        name = parameter.metavar or parameter.name.upper()
        return name if parameter.required or name.startswith("[") else f"[{name}]"
    names = "/".join([", ".join(parameter.opts), *parameter.secondary_opts])
    return f"{names} {parameter.metavar}" if parameter.metavar else names


def _words(parameter: Any) -> str:
    words = parameter.help or ""
    if (
        parameter.show_default
        and parameter.default not in (None, False)
        and parameter.param_type_name == "option"
    ):
        words += f" Default: {parameter.default}."
    if getattr(parameter, "required", False) and parameter.param_type_name == "option":
        words += " Required."
    return words


def _print_row(screen: Any, left: str, words: str) -> None:
    from rich.table import Table
    from rich.text import Text

    if len(left) > _INDENT - 2:
        screen.print(Text(left, "cyan"))
        left = ""
    row = Table.grid(padding=0)
    row.add_column(width=_INDENT)
    row.add_column(ratio=1)
    row.add_row(Text(left, "cyan"), Text(words))
    screen.print(row)
