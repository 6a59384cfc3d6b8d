"""Zip archives of a folder that is a recording, as phones' loggers share it; NPZ, also a zip archive, apart."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path

from tumble.errors import RecordingError
from tumble.files import opened, temporary_folder
from tumble.recording.formats import folder, npz
from tumble.recording.formats.damage import foreign
from tumble.recording.formats.table import RawTable, hash_file, row_words

NAME = "zip"
ENDINGS = (".zip",)
HAS_TOPICS = True


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is a zip archive and no NPZ."""
    return head.startswith(b"PK\x03\x04") and not npz.recognises(head)


def read_table(path: Path, topics: Sequence[str] = ()) -> RawTable:
    """Read the recording in an archive.

    Parameters
    ----------
    path : the archive.
    topics : as for a folder with the same files.

    Raises
    ------
    RecordingError
        If the archive is damaged, or holds no recording or several.
    UsageError
        If a topic is not there.
    OSError
        If the file cannot be read.
    """
    with temporary_folder() as unpacked:
        inside = unpacked / path.name
        with foreign(path, "zip archive"), opened(path) as file, zipfile.ZipFile(file) as archive:
            archive.extractall(inside)
        try:
            table = folder.read_table(inside, topics)
        except RecordingError as error:
            raise RecordingError(
                str(error).replace(str(inside), path.name).replace("is a folder", "is an archive")
            ) from error
    # The file inside is gone when somebody asks for the place of a row.
    table.path, table.source, table.place = path, hash_file(path), row_words
    return table
