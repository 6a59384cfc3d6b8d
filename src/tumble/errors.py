"""What can go wrong, one class per thing that a user can do something about.

Every message is one or two plain sentences: what was found, where, and what to do. The command line
prints the message alone and exits with the class's `exit_status` (see ``docs/contract.md``).
"""

from __future__ import annotations

import re

__version__ = "0.1.0"
_LONG = re.compile(r"\S{300,}")


class TumbleError(Exception):
    """Base of every error that tumble raises on purpose; `exit_status` is the command line's.

    A word of a message that is longer than any path or name, an echo of what a damaged file holds, is shortened.
    """

    exit_status: int = 2

    def __init__(self, message: object = "") -> None:
        super().__init__(_LONG.sub(lambda word: f"{word[0][:120]}…{word[0][-60:]}", str(message)))


class NotBuiltError(TumbleError, ImportError):
    """The compiled loops are missing: this is a checkout in which they were not built."""


def require_compiled(path: str) -> None:
    """Refuse to run a source of compiled loops as Python, thousands of times as slow: `path` is the module's own.

    Raises
    ------
    NotBuiltError
        If the file is a Python source.
    """
    if path.endswith(".py"):
        raise NotBuiltError(
            f"The compiled loops of tumble are not built ({path}): run `make kernels` in the clone, or install anew."
        )


def install(extra: str) -> str:
    """Return what to type for an extra, with its packages by name: so it does in a clone, and from any index.

    Parameters
    ----------
    extra : as in ``tumble[extra]``.
    """
    from importlib.metadata import PackageNotFoundError, requires

    try:
        lines = requires("tumble") or []
    except PackageNotFoundError:
        lines = []
    named = [line for line in lines if re.search(rf"extra == ['\"]{extra}['\"]", line)]
    packages = [re.split(r"[ ;<>=!~]", line, maxsplit=1)[0] for line in named]
    quoted = [f"'{one}'" if "[" in one else one for one in packages or [f"tumble[{extra}]"]]
    return f"pip install {' '.join(quoted)}"


class UsageError(TumbleError):
    """The call itself is off: an unknown name, two options that exclude each other."""


class RecordingError(TumbleError):
    """A recording cannot be read, or contradicts what was said of it (units, columns, stamps)."""


class CalibrationFileError(TumbleError):
    """A file given as a calibration is not one, or is of an unknown version."""


class ProtocolError(TumbleError):
    """A file given as a protocol is not one, or a step in it cannot be; the message names the line."""


class SiteError(TumbleError):
    """A latitude, height or gravity is outside what the Earth offers."""


class SegmentationError(TumbleError):
    """No usable holds or turns were found in a recording, or the interval file is wrong."""


class ObservabilityError(TumbleError):
    """The poses or turns do not determine what was asked for; the message names what is missing."""


class ConvergenceError(TumbleError):
    """The adjustment diverged or ended in a mirror root."""


class ThermalSpanError(TumbleError):
    """A temperature is outside the span that a thermal calibration covers."""


class OutputError(TumbleError):
    """A result could not be written (full disk, no permission); earlier results are intact."""

    exit_status = 3
