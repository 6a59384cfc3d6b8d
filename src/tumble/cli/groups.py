"""Groups of options: a command takes one frozen record a group, and typer sees all their options side by side."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, cast, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from tumble.errors import UsageError

FIRST = "What people need first"
PLACE = "Where it was recorded"
FILE = "What the file does not say itself"
RECORD = "For the record"
ADVANCED = "Advanced"
PRINTED = "What is printed"


def option(
    panel: str,
    metavar: str,
    help: str,
    *names: str,
    show_default: bool = False,
    complete: Callable[[str], list[str]] | None = None,
) -> Any:
    """Declare an option.

    Parameters
    ----------
    panel : of the help that it stands in.
    metavar : what stands for its value; empty for a flag.
    help : what it says.
    names : its spellings, such as ``--output`` and ``-o``; none takes the name of the field.
    show_default : whether the help shows the default.
    complete : gives the values that begin with what was typed, for the shell.
    """
    return typer.Option(
        *names,
        help=help,
        rich_help_panel=panel,
        metavar=metavar,
        show_default=show_default,
        autocompletion=complete,
    )


def numbers(text: str, option: str, count: int | None = None) -> tuple[float, ...]:
    """Return numbers with commas between them.

    Parameters
    ----------
    text, option : as typed, and where.
    count : how many there must be; None for any.

    Raises
    ------
    UsageError
        If there are others.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    wrong = not values or not all(math.isfinite(value) for value in values)
    if wrong or (count is not None and len(values) != count):
        many = "numbers" if count is None else f"{count} numbers"
        raise UsageError(f"{option} takes {many} apart by commas, and {text!r} is not.")
    return values


def refuse_given(context: typer.Context, groups: Sequence[type], sentence: str) -> None:
    """Refuse options of groups that mean nothing here, rather than ignore them.

    Parameters
    ----------
    context : typer's, which knows what was typed.
    groups : whose options are refused.
    sentence : what is said of one, ``{}`` for its name.

    Raises
    ------
    UsageError
        If one was given.
    """
    names = {field.name for group in groups for field in fields(group)}
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not None and source.name == "COMMANDLINE":
            raise UsageError(sentence.format(parameter.opts[0]))


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer takes it: each group among its parameters taken apart into its options.

    Parameters
    ----------
    command : whose parameters are options, arguments, or records of them.
    """
    groups: dict[str, type] = {}
    flat: list[inspect.Parameter] = []
    hints = get_type_hints(command, include_extras=True)
    for parameter in inspect.signature(command).parameters.values():
        hint = hints[parameter.name]
        if isinstance(hint, type) and is_dataclass(hint):
            groups[parameter.name] = hint
            flat += _options_of(hint)
        else:
            flat.append(parameter.replace(annotation=hint, kind=inspect.Parameter.KEYWORD_ONLY))

    def run(**given: Any) -> None:
        from tumble.files import check_target, inputs_kept

        with inputs_kept(_inputs(given)):
            if isinstance(output := given.get("output"), Path) and not output.is_dir():
                check_target(output)
            made = {
                name: group(**{field.name: given.pop(field.name) for field in fields(group)})
                for name, group in groups.items()
            }
            command(**given, **made)

    run.__doc__ = flowing(command.__doc__ or "")
    run.__signature__ = inspect.Signature(flat)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in flat}
    return run


def _inputs(given: dict[str, Any]) -> list[Path]:
    """The files that a command is given to read: what names one, but for where it writes."""
    found: list[Path] = []
    for name, value in given.items():
        for one in cast("list[object]", value) if isinstance(value, list) else [value]:
            if isinstance(one, str | Path) and name not in ("output", "save"):
                # A pair of files with one triad each has a comma between.
                found += [Path(one), *map(Path, str(one).split(","))]
    return found


def _options_of(group: Any) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    return [
        inspect.Parameter(field.name, keyword, default=field.default, annotation=hints[field.name])
        for field in fields(group)
    ]


def flowing(text: str) -> str:
    """Return a help text whose paragraphs run on, so that the terminal breaks their lines, not the source.

    Parameters
    ----------
    text : a docstring; lines of a paragraph that begins with ``tumble`` are examples and stay as they are.
    """
    paragraphs = inspect.cleandoc(text).split("\n\n")
    return "\n\n".join(
        part if part.lstrip().startswith("tumble ") else " ".join(part.split()) for part in paragraphs
    )


def _words_of(ctx: Any, *more: str) -> str:
    """The command's words without the program's name."""
    words: list[str] = []
    while ctx.parent is not None:
        words.insert(0, ctx.info_name)
        ctx = ctx.parent
    return " ".join([*words, *more])


def what_left() -> dict[str, Any]:
    """Return what is said of commands, and of options by command, that tumble once had."""
    import yaml

    return yaml.safe_load((Path(__file__).parent / "gone.yaml").read_text(encoding="utf-8"))


class _Helped:
    """What commands and groups of them have in common: the form of their help."""

    def get_help_option(self, ctx: Any) -> Any:
        """Return ``--help``, which stands among what is printed.

        Parameters
        ----------
        ctx : typer's.
        """
        above: Any = super()
        found = above.get_help_option(ctx)
        if found is not None:
            found.rich_help_panel = PRINTED
            found.metavar = ""
        return found

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help.

        Parameters
        ----------
        ctx, formatter : typer's.
        """
        from tumble.cli.help import print_help

        print_help(self, ctx)


class Group(_Helped, TyperGroup):
    """Commands under one name."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that the arguments name.

        Parameters
        ----------
        ctx, args : typer's.

        Raises
        ------
        UsageError
            If it is one that left.
        """
        if (
            args
            and args[0] not in self.commands
            and (left := what_left()["commands"].get(_words_of(ctx, args[0])))
        ):
            raise UsageError(left)
        return super().resolve_command(ctx, args)

    def panels(self) -> dict[str, dict[str, str]]:
        """Return each command's name and the first sentence of its help, by what they are for."""
        return {
            "Commands": {name: (one.help or "").partition("\n")[0] for name, one in self.commands.items()}
        }


class Command(_Helped, TyperCommand):
    """A command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments.

        Parameters
        ----------
        ctx, args : typer's.

        Raises
        ------
        UsageError
            If one is an option that left.
        """
        stop = args.index("--") if "--" in args else len(args)
        taken = {name for one in self.get_params(ctx) for name in (*one.opts, *one.secondary_opts)}
        for word, following in pairwise([*args[:stop], ""]):
            name, _, value = word.partition("=")
            if name == "--set":
                name = f"--{(value or following).partition('=')[0]}"
            known = name in taken or not name.startswith("-")
            if not known and (left := _what_left_of(_words_of(ctx), name)):
                raise UsageError(left)
        return super().parse_args(ctx, args)


def _what_left_of(command: str, name: str) -> str | None:
    options = what_left()["options"]
    return options.get(command, {}).get(name) or options.get("every command", {}).get(name)
