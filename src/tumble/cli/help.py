"""What `tumble COMMAND --help` prints: what it is for, an example, then its options, what people need first first."""

from __future__ import annotations

from itertools import groupby
from typing import Any

from tumble.cli.groups import ADVANCED, FILE, FIRST, PLACE, PRINTED
from tumble.cli.terminal import console

# How far the texts stand from the left; a longer spelling has a line of its own and is never cut.
_INDENT = 26
_LAST = (PLACE, FILE, ADVANCED, PRINTED)


def print_help(command: Any, context: Any) -> None:
    """Print a command's help.

    Parameters
    ----------
    command, context : typer's.
    """
    from rich.padding import Padding
    from rich.text import Text

    screen = console()
    words = [context.command_path, "[OPTIONS]", *_arguments(command, context)]
    screen.print(Text.assemble(("Usage: ", "yellow"), " ".join(words)))
    for paragraph in (command.help or "").split("\n\n"):
        example = paragraph.startswith("tumble ")
        screen.print()
        screen.print(Padding(Text(paragraph, "bold cyan" if example else ""), (0, 0, 0, 2 if example else 0)))
    for title, parameters in groupby(_ordered(command.get_params(context)), key=_panel):
        screen.print(Text(f"\n{title}", "bold"))
        for parameter in parameters:
            _print_parameter(screen, parameter, context)


def _ordered(parameters: list[Any]) -> list[Any]:
    """Arguments, what people need first, what is the command's own, and what all commands have."""
    seen = [_panel(parameter) for parameter in parameters]
    own = [title for title in dict.fromkeys(seen) if title not in ("Arguments", FIRST, *_LAST)]
    order = ["Arguments", FIRST, *own, *_LAST]
    shown = [parameter for parameter in parameters if not getattr(parameter, "hidden", False)]
    return sorted(shown, key=lambda parameter: order.index(_panel(parameter)))


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


def _print_parameter(screen: Any, parameter: Any, context: Any) -> None:
    from rich.table import Table
    from rich.text import Text

    left, words = f"  {_spelled(parameter)}", parameter.help or ""
    if parameter.show_default and parameter.default is not None and parameter.param_type_name == "option":
        words += f" Default: {parameter.default}."
    if getattr(parameter, "required", False) and parameter.param_type_name == "option":
        words += " Required."
    if len(left) > _INDENT - 2:
        screen.print(Text(left, "cyan"))
        left = ""
    row = Table.grid(padding=0)
    row.add_column(width=_INDENT)
    row.add_column(ratio=1)
    row.add_row(Text(left, "cyan"), Text(words))
    screen.print(row)


__all__ = ["print_help"]
