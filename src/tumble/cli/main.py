"""The program `tumble`: its commands, and what an error looks like."""

from __future__ import annotations

import errno
import os
import signal
import sys
from contextlib import suppress
from typing import Annotated, Any

import typer

import tumble
from tumble.cli.algebra import compose_command, diff_command, invert_command
from tumble.cli.apply import apply_command
from tumble.cli.batch import batch_command
from tumble.cli.calibrate import calibrate_command
from tumble.cli.capture import capture_command
from tumble.cli.certificate import certificate_command
from tumble.cli.convert import convert_command
from tumble.cli.demo import demo_command
from tumble.cli.denoise import denoise_command
from tumble.cli.groups import command_class, grouped
from tumble.cli.inspect import inspect_command
from tumble.cli.mount import mount_command
from tumble.cli.noise import noise_command
from tumble.cli.plan import plan_command
from tumble.cli.predict import predict_command
from tumble.cli.registry import app as registry_app
from tumble.cli.reproduce import reproduce_command
from tumble.cli.simulate import simulate_command
from tumble.cli.terminal import StreamError, plain, shortened, state, streams
from tumble.cli.units import units_command
from tumble.cli.verify import verify_command
from tumble.errors import TumbleError

# An adjustment's matrices are small: threads of the linear algebra cost more than they give, and each
# reserves memory. Set before numpy is imported; a user's own setting stands.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

INTERRUPTED = 130
TERMINATED = 143
UNWRITTEN = 3
INTERNAL = 70
STOPPED = "Stopped; no file was changed."

app = typer.Typer(
    name="tumble",
    help="Calibrate inertial measurement units from a recording of the unit being tumbled.\n\n"
    "Start with [bold]tumble inspect RECORDING[/], then [bold]tumble calibrate RECORDING[/]. "
    "Without a recording, [bold]tumble demo[/] calibrates one that ships with the package.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)
COMMANDS = {
    "inspect": inspect_command,
    "calibrate": calibrate_command,
    "batch": batch_command,
    "capture": capture_command,
    "apply": apply_command,
    "verify": verify_command,
    "predict": predict_command,
    "convert": convert_command,
    "compose": compose_command,
    "diff": diff_command,
    "invert": invert_command,
    "mount": mount_command,
    "noise": noise_command,
    "denoise": denoise_command,
    "simulate": simulate_command,
    "plan": plan_command,
    "reproduce": reproduce_command,
    "units": units_command,
    "certificate": certificate_command,
    "demo": demo_command,
}
FORMER = {
    "verify": {"--turn-on": "--turn-on-bias"},
    "predict": {"--turn-on": "--turn-on-bias"},
    "convert": {"--rate": "--consumer-rate", "--temperature": "--at-temperature", "--topic": "--ros-topic"},
    "simulate": {
        "--unit": "--unit-seed",
        "--units": "--output-units",
        "--rate": "--sample-rate",
        "--turn-on": "--turn-on-bias",
        "--noise": "--sensor-noise",
        "--lever-arm-cm": "--table-lever-arm-cm",
    },
    "plan": {"--turn": "--turn-seconds"},
    "units": {"--rate": "--sample-rate"},
}
"""Spellings of options before each had one meaning in all commands: still taken, no longer shown."""

for _name, _command in COMMANDS.items():
    # A number below zero is to reach `units`, which says what is wrong with it.
    _settings = {"ignore_unknown_options": True} if _name == "units" else {}
    app.command(_name, cls=command_class(FORMER.get(_name, {})), context_settings=_settings)(
        grouped(_command)
    )

# Commands of its own under one name.
app.add_typer(registry_app)


def _print_version(value: bool) -> None:
    if value:
        sys.stdout.write(f"tumble {tumble.__version__}\n")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, metavar="", help="Print the version."
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
            _run()
    finally:
        # A command that has written its files ignores stops; a caller of this function must not inherit that.
        for number, handler in before.items():
            signal.signal(number, handler)


def _run() -> None:
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
    """What a stop leaves: nothing, unless the command says otherwise."""
    return str(state["stopped"]) or STOPPED


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
        _hear_stops()
        main()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0
    except _STOPS as stop:  # before or after the part that has its own words for it
        status = _status_of(stop)
        _try_to_say(STOPPED)
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:  # pyright: ignore[reportUnnecessaryComparison] (closed before we began)
                stream.flush()
        except OSError:
            status = status or UNWRITTEN
    os._exit(status)


def _hear_stops() -> None:
    """Take Ctrl-C and requests to end as exceptions from here on, where they were not to be ignored."""
    from tumble.cli import stop_at_once

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
        status, message = getattr(error, "exit_code", 2), str(said()).strip().rstrip(".")
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
