"""Writing beside, then renaming: an earlier file is never lost or half overwritten."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from tumble.errors import OutputError


@contextmanager
def written_beside(path: Path) -> Generator[Path, None, None]:
    """Give a path beside `path` to write to; afterwards it takes the place of `path`.

    Raises
    ------
    OutputError
        If the file cannot be written; what stood at `path` is then intact.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield beside
        beside.replace(path)
    except OSError as error:
        raise OutputError(f"{path} could not be written: {error.strerror or error}.") from error
    finally:
        beside.unlink(missing_ok=True)
