"""Lines of text: CSV, and whatever else `tumble.recording.formats.lines` reads."""

from __future__ import annotations

import math
from binascii import crc_hqx
from functools import reduce

from tumble.capture.rows import Rows
from tumble.capture.source import Piece, SourceOptions
from tumble.recording.columns import plan_from_names
from tumble.recording.formats.lines import COMMENTS, LONGEST_LINE, Row, row_of, without_clock, words_of
from tumble.recording.formats.sentences import names_of_sentence


class TextLines:
    """Lines in, samples out.

    Parameters
    ----------
    options, name : what the lines do not say themselves, and what they are called.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self.rows = Rows(options, name)
        self.good = self.damaged = 0
        self._rest = b""
        self._header: tuple[str, ...] | None = None
        self._uni = False

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return the samples of the lines that are complete."""
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            self._rest = b""
            self.damaged += 1
        for line in lines:
            self._take(line)
        return self.rows.flush(arrived)

    def end(self) -> list[Piece]:
        """Return what is left; a last line without its end is a line."""
        self._take(self._rest)
        return self.rows.end()

    def _take(self, raw: bytes) -> None:
        line = raw.strip()
        if not line:
            return
        text, _ = without_clock(line.decode("utf-8", "replace")) if len(line) <= LONGEST_LINE else ("", None)
        words = words_of(text)
        if words is not None and words == self._header:
            # Said again, for those who began to listen later.
            return
        # A greeting of the board has words, too: the names of columns go before it.
        if (
            words is not None
            and not self.rows.decided
            and (self._header is None or plan_from_names(words) is not None)
        ):
            self._header = words
            return
        row = _of_sentence(text) if text.startswith("$") else row_of(text)
        if row is None:
            self.damaged += not text.startswith((*COMMENTS, "Cal"))
            return
        if row.kind == "motioncal":
            # `Raw:` and `Uni:` repeat each other, and `Uni:` has the finer steps.
            self._uni = self._uni or text.startswith("Uni")
            if self._uni and not text.startswith("Uni"):
                return
        names = row.names
        if names is None and self._header is not None and len(self._header) == len(row.values):
            names = self._header
        if self.rows.add(names, row.values):
            self.good += 1
        else:
            self.damaged += 1


def _of_sentence(text: str) -> Row | None:
    """What a navigation unit's sentence says, if its checksum is right: XOR, or the CRC of CCITT, or XX for none."""
    body, _, check = text[1:].partition("*")
    said = body.encode()
    right = (f"{reduce(int.__xor__, said, 0):02X}", f"{crc_hqx(said, 0):04X}", "XX")
    names = names_of_sentence(f"${body}".split(","))
    if names is None or check.strip().upper() not in right:
        return None
    try:
        values = tuple(map(float, body.split(",")[1:]))
    except ValueError:
        return None
    return Row(names[1:], values, "sentence") if all(map(math.isfinite, values)) else None
