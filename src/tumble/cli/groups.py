"""Groups of options: a command takes one frozen record a group, and typer sees all their options side by side.

What `tumble --help` and `tumble COMMAND --help` print.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from importlib import import_module
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any, cast, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from tumble.errors import UsageError

PRINTED = "What is printed"
OF_MANY = object()
# How far the texts of a help stand from the left; a longer spelling has a line of its own and is never cut.
_INDENT = 26
# What the shell completes after an option or argument: where the names are, read when they are asked for.
NAMES = {
    "procedure": "tumble.procedure_names:KNOWN_PROCEDURES",
    "protocol": "tumble.protocol.library:PROTOCOLS",
    "grade": "tumble.simulation.grades:GRADES",
    "target": "tumble.export.target:targets",
    "study": "tumble.reproduction.items:all_items",
}


def completed(kind: str) -> Callable[[str], list[str]]:
    """Return what gives the names that begin with what was typed.

    Parameters
    ----------
    kind : of `NAMES`.
    """

    def beginning(incomplete: str) -> list[str]:
        module, _, name = NAMES[kind].partition(":")
        found: Any = getattr(import_module(module), name)
        return [
            one
            for one in cast("Iterable[str]", found() if callable(found) else found)
            if one.startswith(incomplete)
        ]

    return beginning


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer takes it: each group among its parameters taken apart into its options.

    Parameters
    ----------
    command : whose parameters are options, arguments, or records of them.
    """
    from tumble.workflows import listed_words

    groups: dict[str, tuple[type, list[inspect.Parameter]]] = {}
    flat: list[inspect.Parameter] = []
    read: dict[str, Callable[[Any], Any]] = {}
    help_text, words = listed_words(command.__doc__ or "")
    hints = get_type_hints(command, include_extras=True)
    for parameter in inspect.signature(command).parameters.values():
        hint = hints[parameter.name]
        kind, *how = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        if isinstance(kind, type) and is_dataclass(kind):
            own = list(_options_of(kind, read, of_many=OF_MANY in how))
            groups[parameter.name] = kind, own
            flat += own
        else:
            flat.append(_parameter(parameter.name, parameter.default, hint, words))

    def run(**given: Any) -> None:
        from tumble.files import check_target, inputs_kept

        with inputs_kept(_inputs(given)):
            if isinstance(output := given.get("output"), Path) and not output.is_dir():
                check_target(output)
            # What was not typed has the record's own default.
            given = {name: value for name, value in given.items() if value is not None or name not in read}
            given |= {name: make(given[name]) for name, make in read.items() if name in given}
            made = {
                name: group(**{one.name: given.pop(one.name) for one in options if one.name in given})
                for name, (group, options) in groups.items()
            }
            command(**given, **made)

    run.__doc__ = flowing(help_text)
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


def _options_of(
    group: Any, read: dict[str, Callable[[Any], Any]], *, of_many: bool
) -> Iterator[inspect.Parameter]:
    """The options of a group, or those of a request that may hold for all units of a batch, and how they are read."""
    from tumble.workflows import option_of, words_of

    hints, words = dict[str, Any](), words_of(group)
    with suppress(NameError):  # a request names what only programs give, and has its kinds
        hints = get_type_hints(group, include_extras=True)
    for field in fields(group):
        found = option_of(field)
        if found is None and get_origin(hints.get(field.name)) is not Annotated:
            continue
        if found is not None:
            if of_many and (found.alone or found.of_many is None):
                continue
            if of_many:
                words[field.name] = found.of_many or words[field.name]
            if found.read is not None:
                read[field.name] = found.read
        yield _parameter(field.name, field.default if found is None else field, hints.get(field.name), words)


def _parameter(name: str, default: Any, hint: Any, words: dict[str, str]) -> inspect.Parameter:
    """An option or argument as typer takes it; what an option's help says stands in a docstring, or with it."""
    kind, *declared = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    from tumble.workflows import ARGUMENT, option_of

    given: Any = default
    found = next(filter(None, map(option_of, (given, *declared))), None)
    if found is not None:
        given = given.default if option_of(given) else given
        if found.read is not None and given is not MISSING:
            given = found.typed
        how: dict[str, Any] = {
            "help": found.help or words[name],
            "metavar": found.metavar,
            "show_default": found.show_default,
            "autocompletion": completed(found.complete) if found.complete else None,
            "rich_help_panel": found.panel,
        }
        declare: Any = typer.Argument if found.panel == ARGUMENT else typer.Option
        kind = found.kind or kind or (bool if given is False else str | None)
        hint = Annotated[kind, declare(*found.names, **how)]
    given = inspect.Parameter.empty if given is MISSING else given
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=given, annotation=hint)


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
        _print_help(self, ctx)


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


def _print_help(command: Any, context: Any) -> None:
    """Print what a command is for, an example, then the options."""
    from rich.padding import Padding
    from rich.text import Text

    from tumble.cli.terminal import console

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
    options = (
        sorted(command.get_params(context), key=lambda one: one.rich_help_panel == PRINTED) if panels else []
    )
    ordered = [("Options", one) for one in options] or _ordered(command, context)
    for title, parameters in groupby(ordered, key=itemgetter(0)):
        screen.print(Text(f"\n{title}", "bold"))
        for _, parameter in parameters:
            _print_row(screen, f"  {_spelled(parameter)}", _words(parameter))


def _ordered(command: Any, context: Any) -> list[tuple[str, Any]]:
    """Each parameter with its panel: arguments, what people need first, the command's own, what all commands have."""
    from tumble.workflows import ADVANCED, FILE, FIRST, PLACE, RECORD

    seen = [
        ("Arguments" if one.param_type_name == "argument" else one.rich_help_panel or ADVANCED, one)
        for one in command.get_params(context)
    ]
    first, last = ("Arguments", FIRST, PLACE, FILE), (RECORD, ADVANCED, PRINTED)
    own = [title for title, _ in seen if title not in (*first, *last)]
    order = [*first, *dict.fromkeys(own), *last]
    return sorted(seen, key=lambda one: order.index(one[0]))


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
