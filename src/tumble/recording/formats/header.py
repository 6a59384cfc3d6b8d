"""The names in a file's header, without reading its numbers."""

from __future__ import annotations

import gzip
import re
import zlib
from pathlib import Path

from tumble.files import lines_of, opened
from tumble.recording.formats.parquet import read_names

HEAD = 65536
_MOST_LINES = 50


def header_names(path: Path) -> list[str]:
    """Return the names that stand at the head of a text file, or of the columns of a Parquet file.

    Of any other format, and of a file that cannot be read, none: reading it says what is wrong.
    """
    try:
        with opened(path) as file:
            head = file.read(HEAD)
        if head.startswith(b"PAR1"):
            return read_names(path)
        if head.startswith(b"\x1f\x8b"):
            with gzip.open(path) as file:
                head = file.read(HEAD)
    except (OSError, EOFError, zlib.error):
        return []
    if b"\0" in head:
        return []
    lines = lines_of(head.decode("utf-8", errors="replace"))[:_MOST_LINES]
    cells = [cell.strip().strip('"').strip() for line in lines for cell in re.split(r"[,;\t]", line)]
    return [cell for cell in cells if re.match(r"[A-Za-z]", cell)]
