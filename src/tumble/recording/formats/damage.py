"""What libraries make of a damaged file, as one sentence."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from tumble.errors import RecordingError, TumbleError


@contextmanager
def foreign(path: Path, format_: str, mend: str = "") -> Generator[None]:
    """Run a library's reader: whatever it makes of a damaged file is one sentence.

    Parameters
    ----------
    path : of the file.
    format_ : what it should be.
    mend : what mends a damaged one, as a sentence without its point.

    Raises
    ------
    RecordingError
        If the library fails, in whichever way.
    """
    try:
        yield
    except TumbleError:
        raise
    except MemoryError as error:
        raise RecordingError(
            f"{path.name} is a damaged or too large {format_}: what it says that it holds does not fit into memory."
        ) from error
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # the disk's; bz2 has one without a number for damaged bytes
        words = " ".join(str(error).split())[:80].rstrip(".") or type(error).__name__
        more = f" {mend}." if mend else ""
        raise RecordingError(f"{path.name} is a damaged or unsupported {format_} ({words}).{more}") from error
