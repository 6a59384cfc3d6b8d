"""What of a file of messages could not be read: it is left out, counted, and said."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import field
from pathlib import Path

from tumble.errors import RecordingError, TumbleError
from tumble.recording.recording import Remark
from tumble.records import dataclass


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


@dataclass(slots=True)
class Damage:
    """Pieces of a file that could not be read, or not to their end.

    Attributes
    ----------
    name : of the file, for messages.
    piece : what a piece is called.
    places : where they begin, each with what is wrong there.
    total : number of pieces of the file, or None.
    """

    name: str
    piece: str = "chunk"
    places: dict[int, str] = field(default_factory=dict[int, str])
    total: int | None = None

    def note(self, place: int, error: Exception) -> None:
        """Note a piece that begins at a place."""
        self.places.setdefault(place, str(error) or type(error).__name__)

    def remarks(self) -> list[Remark]:
        """Say how much is left out and why; nothing where all is whole."""
        if not self.places:
            return []
        of = "" if self.total is None else f" of {self.total}"
        first = self.places[min(self.places)].removeprefix(f"{self.name}: ").rstrip(".")
        verb = "are" if len(self.places) > 1 else "is"
        text = f"{len(self.places)}{of} {self.piece}(s) {verb} damaged ({first}); what could be read is used."
        return [Remark("mended", f"{self.name}: {text}")]
