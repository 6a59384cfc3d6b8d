"""The program `tumble`: its commands, and what an error looks like."""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from tumble.cli.groups import PRINTED, Command, Group, grouped
from tumble.cli.terminal import StreamError, plain, shortened, state, streams
from tumble.errors import TumbleError, __version__

# An adjustment's matrices are small: threads of the linear algebra cost more than they give, and each
# reserves memory. Set before numpy is imported; a user's own setting stands.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

INTERRUPTED = 130
TERMINATED = 143
UNWRITTEN = 3
INTERNAL = 70
STOPPED = "Stopped; no file was changed."
LATE = "Stopped; the files that were written until then are complete."

PANELS = {
    "Record and calibrate": ("demo", "inspect", "calibrate", "capture", "noise"),
    "Use a calibration": ("verify", "apply", "convert", "diff", "mount", "certificate"),
    "Many units": ("batch", "registry"),
    "Before a test, and for papers": ("plan", "simulate", "reproduce"),
    "Advanced": ("predict",),
}
"""The commands by what they are for, in the order of the help."""
COMMANDS = {name: name for names in PANELS.values() for name in names} | {
    "apply": "verify",
    "demo": "calibrate",
}
"""The module of `cli` that each command is in."""


def first_sentence(name: str) -> str:
    """Return the first sentence of a command's help as it is written: the list of commands imports none.

    Parameters
    ----------
    name : of the command.
    """
    written = Path(__file__).with_name(f"{COMMANDS[name]}.py").read_text(encoding="utf-8")
    module, _, command = written.partition(f"def {name}_command(")
    return " ".join((command or module).split('"""')[1].partition("\n\n")[0].split())


class _Commands(Mapping[str, Any]):
    """The commands by name, each imported and made when it is asked for."""

    def __getitem__(self, name: str) -> Any:
        module = import_module(f"tumble.cli.{COMMANDS[name]}")
        if hasattr(module, "app"):  # commands of its own under one name
            return typer.main.get_command(module.app)
        one = typer.Typer(add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False)
        one.command(name, cls=Command)(grouped(getattr(module, f"{name}_command")))
        return typer.main.get_command(one)

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class _Program(Group):
    """The program, of which a call imports one command."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands = _Commands()  # type: ignore[assignment]  # only looked at: no command is added

    def panels(self) -> dict[str, dict[str, str]]:
        return {title: {name: first_sentence(name) for name in names} for title, names in PANELS.items()}


app = typer.Typer(
    name="tumble",
    cls=_Program,
    help="Calibrate inertial measurement units from a recording of the unit being tumbled.\n\n"
    "Start with `tumble inspect RECORDING`, then `tumble calibrate RECORDING`. "
    "Without a recording, `tumble demo` calibrates one that ships with the package. "
    "`tumble COMMAND --help` explains each.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)


def _print_version(value: bool) -> None:
    if value:
        sys.stdout.write(f"tumble {__version__}\n")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_print_version,
            is_eager=True,
            metavar="",
            help="Print the version.",
            show_default=False,
            rich_help_panel=PRINTED,
        ),
    ] = False,
) -> None:
    """Take the options that stand before a command."""


class Terminated(BaseException):
    """A request to end (SIGTERM), which stops work as Ctrl-C does."""


_STOPS = (KeyboardInterrupt, Terminated)


def main() -> None:
    """Run the command line; every error is one sentence and an exit status."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    state["results stand"], state["stopped"] = False, ""
    try:
        with streams():
            # Not before: a stop while a stream is made ready would leave nothing to say it on.
            _hear_stops()
            _run()
    finally:
        # A command that has written its files ignores stops; a caller of this function must not inherit that.
        for number, handler in before.items():
            signal.signal(number, handler)


def _run() -> None:
    if "_TUMBLE_COMPLETE" in os.environ:  # the shell asks, and prints what it gets by itself
        app()
    sys.unraisablehook = _send_again
    try:
        status = app(standalone_mode=False)
        sys.stdout.flush()
    except TumbleError as error:
        _end(str(error), error.exit_status)
    except (*_STOPS, typer.Abort) as error:
        _end(_stopped(), _status_of(_stop_behind(error)))
    except (BrokenPipeError, SystemExit):
        # Nobody reads on, as after `| head`: typer knows no other reason to leave by itself.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        _end(_of_the_system(error), 2 if error.errno == errno.ENAMETOOLONG else UNWRITTEN)
    except MemoryError:
        _end("The recording does not fit into memory: cut it, or use a machine with more.", 2)
    except Exception as error:  # noqa: BLE001 (the last line of defence: a sentence, not a traceback)
        if stop := _stop_behind(error):
            _end(_stopped(), _status_of(stop))
        _usage_or_internal(error)
    else:
        # typer turns Ctrl-C into this status without a word.
        if status == INTERRUPTED:
            _end(_stopped(), INTERRUPTED)
        sys.exit(status if isinstance(status, int) else 0)


def _stopped() -> str:
    """What a stop leaves: nothing, unless the command says otherwise or its files are in place."""
    from tumble.files import files_in_place

    return str(state["stopped"]) or (LATE if files_in_place() else STOPPED)


def _send_again(lost: Any) -> None:
    """Send a stop again that came while a compiled library called back, where it cannot be raised."""
    if not issubclass(lost.exc_type, _STOPS):
        sys.__unraisablehook__(lost)
        return
    import _thread
    import threading

    number = signal.SIGINT if issubclass(lost.exc_type, KeyboardInterrupt) else signal.SIGTERM
    again = threading.Timer(0.02, _thread.interrupt_main, (number,))
    again.daemon = True
    again.start()


def program() -> None:
    """Run `main` as the program itself: leave at once when it is done.

    Taking all modules down piece by piece costs time and changes nothing:
    every file is closed and renamed by then.
    """
    status = 0
    try:
        main()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0
    except _STOPS as stop:  # before or after the part that has its own words for it
        status = _status_of(stop)
        _try_to_say(_stopped())
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:  # pyright: ignore[reportUnnecessaryComparison] (closed before we began)
                stream.flush()
        except OSError:
            status = status or UNWRITTEN
    os._exit(status)


def _hear_stops() -> None:
    """Take Ctrl-C and requests to end as exceptions from here on, where they were not to be ignored."""
    from tumble.cli.stop import stop_at_once

    def terminate(number: int, frame: object) -> None:
        raise Terminated

    if signal.getsignal(signal.SIGTERM) in (signal.SIG_DFL, stop_at_once):
        signal.signal(signal.SIGTERM, terminate)
    if signal.getsignal(signal.SIGINT) is stop_at_once:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _stop_behind(error: BaseException | None) -> BaseException | None:
    """The stop that an error is, or was made of: where a library is being imported, it comes as another error."""
    while error is not None:
        if isinstance(error, _STOPS):
            return error
        error = error.__cause__ or error.__context__
    return None


def _status_of(stop: BaseException | None) -> int:
    return TERMINATED if isinstance(stop, Terminated) else INTERRUPTED


def _usage_or_internal(error: Exception) -> None:
    """End with typer's own sentence for wrong usage; anything else is a fault of tumble."""
    said = getattr(error, "format_message", None)
    if callable(said):
        status = getattr(error, "exit_code", 2)
        message = _no_number(error) or str(said()).strip().rstrip(".")
        if not message:  # called without any argument: the help has been printed
            sys.exit(status)
        context = getattr(error, "ctx", None)
        _end(f"{message}: see `{getattr(context, 'command_path', 'tumble')} --help`.", status)
    if os.environ.get("TUMBLE_DEBUG"):
        raise error
    _end(
        f"This is a fault of tumble, not of your input: {type(error).__name__}: {error}. Report it to "
        "the maintainers: TUMBLE_DEBUG=1 shows where it happened.",
        INTERNAL,
    )


def _no_number(error: Exception) -> str:
    """What is said of a value that is no number, in place of a library's words; nothing of other errors."""
    found, asked = getattr(error.__cause__, "errors", None), getattr(error, "param", None)
    if not callable(found) or asked is None:
        return ""
    first = cast("list[Any]", found())[0]
    kind = "whole number" if first["type"].startswith("int") else "number"
    return f"{asked.opts[0]} {first['input']} is no {kind}"


def _of_the_system(error: OSError) -> str:
    if state["results stand"]:
        return f"The files are written, but words about them could not be printed: {error.strerror or error}."
    if isinstance(error, StreamError):
        return f"What tumble prints could not be written: {error.strerror or error}; no file was changed."
    where = f" ({error.filename})" if error.filename else ""
    if error.errno == errno.ENOSPC:
        return f"The disk is full{where}: nothing was changed; give another folder with -o."
    return f"{error.strerror or error}{where}."


def _end(message: str, status: int) -> None:
    _try_to_say(message)
    sys.exit(status)


def _try_to_say(message: str) -> None:
    """Print a sentence on standard error, where anybody listens."""
    with suppress(OSError, AttributeError):
        # One line: a line break can only come from a name.
        sys.stderr.write(f"tumble: {plain(shortened(message)).replace(chr(10), chr(92) + 'n')}\n")
