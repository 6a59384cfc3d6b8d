"""The command line: argument parsing and printing, nothing else.

`program` is what the installed command runs. Before it imports anything it sees to Ctrl-C: while Python imports, no
file has been touched, and a stop is one line and an exit status as at any other time.
"""

import gc
import sys

from tumble.cli.stop import stop_at_once

TYPE_CHECKING = False
if TYPE_CHECKING:
    import signal as _signal
else:
    # The C module under `signal`, which is there already: `signal` itself takes milliseconds in which a stop is lost.
    import _signal


def program() -> None:
    """Run the program; it does not return."""
    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, stop_at_once)
    if _signal.getsignal(_signal.SIGTERM) == _signal.SIG_DFL:
        _signal.signal(_signal.SIGTERM, stop_at_once)
    # What is imported is no garbage: looking through it again and again takes a tenth of a short command's time.
    gc.disable()
    from tumble.cli.application import program as run
    from tumble.cli.scipy_functions import FunctionsAlone

    sys.meta_path.insert(0, FunctionsAlone())
    gc.enable()
    gc.set_threshold(400_000)
    run()


def __getattr__(name: str) -> object:
    """Fetch `COMMANDS`, `app` or `main` at first use (PEP 562): `program` has to run before anything is imported.

    Raises
    ------
    AttributeError
        If the room has no such name.
    """
    if name not in ("COMMANDS", "app", "main"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from tumble.cli import application

    return getattr(application, name)
