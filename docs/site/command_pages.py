"""One page for every command, from its own help: what it does, its arguments and its options."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from tumble.cli import app


def commands() -> Iterator[tuple[str, Any]]:
    """Yield every command with its full name, as it is typed after `tumble`."""
    yield from _below("", typer.main.get_command(app))


def _below(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    below = getattr(command, "commands", {})
    if name:
        yield name, command
    for key in below:
        yield from _below(f"{name} {key}".strip(), below[key])


def write_command_pages(folder: Path) -> list[Path]:
    """Write the pages and their list into `folder`; return their paths."""
    written = []
    for name, command in commands():
        path = folder / f"{name.replace(' ', '-')}.md"
        write_page(path, command_page(name, command))
        written.append(path)
    lines = ["# Commands, option by option", "", "```{toctree}", *(path.stem for path in written), "```", ""]
    write_page(folder / "index.md", "\n".join(lines))
    return written


def command_page(name: str, command: Any) -> str:
    """Return a command's page in Markdown."""
    context = typer.Context(command, info_name=f"tumble {name}")
    usage = " ".join([f"tumble {name}", *command.collect_usage_pieces(context)])
    lines = [f"# tumble {name}", "", "```", usage, "```", "", _prose(command.help or ""), ""]
    for title, kind in (("Arguments", "argument"), ("Options", "option")):
        rows = [_row(p, context) for p in command.params if p.param_type_name == kind]
        if rows:
            lines += [f"## {title}", "", f"| {kind} | what it is |", "|---|---|", *rows, ""]
    return "\n".join(lines)


def _row(parameter: Any, context: typer.Context) -> str:
    names = ", ".join(f"`{name}`" for name in [*parameter.opts, *parameter.secondary_opts])
    if parameter.param_type_name == "argument":
        names = f"`{(parameter.metavar or parameter.name).upper()}`"
    elif not getattr(parameter, "is_flag", False):
        names += f" `{parameter.metavar or parameter.display_type(ctx=context)}`"
    told = _prose(getattr(parameter, "help", None) or "").replace("\n", " ").replace("|", "\\|")
    default = parameter.default
    if default not in (None, False, True, ()) and not callable(default) and str(default) not in told:
        told += f" Default: `{default}`."
    return f"| {names} | {told} |"


def _prose(text: str) -> str:
    """Typer's help as Markdown: without its marks for paragraphs and colours; angle brackets are no tags."""
    text = re.sub(
        r"\[/?(?:bold|dim|italic|cyan|green|yellow|red)\]", "", text.replace("\b\n", "").replace("\f", "")
    )
    return text.replace("<", "&lt;").strip()


def write_page(path: Path, text: str) -> None:
    """Write a page, but leave one that is the same as before: its stamp decides what is built anew."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
