"""What of a file of messages could not be read: it is left out, counted, and said."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import BinaryIO

from tumble.recording.recording import Remark


class CutShort(Exception):
    """The file ends inside a record."""


def exactly(file: BinaryIO, size: int) -> bytes:
    """Read so many bytes of an open file.

    Raises
    ------
    CutShort
        If the file ends before.
    """
    data = file.read(size)
    if len(data) < size:
        raise CutShort
    return data


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
