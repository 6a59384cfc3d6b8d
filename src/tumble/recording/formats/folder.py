"""Folders: EuRoC data sets, phones' logs with a file a sensor, and folders with one recording in them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tumble.errors import RecordingError
from tumble.recording.formats import text
from tumble.recording.formats.logs import phone
from tumble.recording.formats.logs.logged_streams import table_of_streams
from tumble.recording.formats.table import RawTable, hash_file, hash_files
from tumble.recording.recording import Source

NAME = "folder"
ENDINGS = ()
ASKED = 3  # any folder is one
HAS_TOPICS = True

_EUROC = ("mav0/imu0/data.csv", "imu0/data.csv", "data.csv")
_NOT_RECORDINGS = {
    ".yaml",
    ".yml",
    ".json",
    ".md",
    ".pdf",
    ".png",
    ".jpg",
    ".jpeg",
    ".html",
    ".m",
    ".py",
    ".ini",
    ".xml",
}
_MOST_DEEP = 3


def recognises(head: bytes) -> bool:
    """Say that no file is a folder."""
    return False


def recognises_folder(folder: Path) -> bool:
    """Say whether a folder exists: what is in it, the reading shows."""
    return folder.is_dir()


def source(path: Path) -> Source:
    """Return name and SHA-256 of what is read of a folder.

    Raises
    ------
    RecordingError
        If there is no recording in it, or several.
    OSError
        If a file cannot be read.
    """
    path = _descended(path)
    files = _files(path)
    if (euroc := _euroc(path)) is not None:
        return hash_file(euroc)
    if phone.is_phone_log(files):
        return hash_files(path, sorted(phone.find_sensors(files).values()))
    return hash_file(_only(path, files))


def read_table(path: Path, topics: Sequence[str] = ()) -> RawTable:
    """Read the recording that a folder holds.

    Parameters
    ----------
    path : the folder.
    topics : names of a phone's files without ending, one for each triad; or topics of the one recording in it.

    Raises
    ------
    RecordingError
        If there is no recording in it, or several.
    UsageError
        If a topic is not there.
    OSError
        If a file cannot be read.
    """
    from tumble.recording.formats import read_table as read_file

    path = _descended(path)
    files = _files(path)
    if (euroc := _euroc(path)) is not None:
        return text.read_table(euroc)
    if phone.is_phone_log(files):
        sensors = phone.find_sensors(files)
        streams, chosen = phone.streams_of_tables(
            {n: (f.stem, text.read_table(f)) for n, f in sensors.items()}
        )
        return table_of_streams(path, streams, topics, chosen, source(path))
    return read_file(_only(path, files), topics)


def _descended(path: Path) -> Path:
    """Go down while a folder holds nothing but one folder."""
    for _ in range(_MOST_DEEP):
        inside = [p for p in path.iterdir() if not p.name.startswith((".", "__"))]
        if len(inside) != 1 or not inside[0].is_dir():
            break
        path = inside[0]
    return path


def _files(path: Path) -> list[Path]:
    return sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))


def euroc_file(folder: Path) -> Path | None:
    """Return the file with an IMU's samples in an EuRoC folder, None in any other.

    Parameters
    ----------
    folder : of the data set, of `mav0`, or of the sensor.
    """
    path = _descended(folder)
    inside = Path(*path.parts[:-2]) if path.parts[-2:] == ("mav0", "imu0") else path
    return _euroc(path) or _euroc(inside)


def _euroc(path: Path) -> Path | None:
    for name in _EUROC:
        file = path / name
        if file.is_file() and (name != "data.csv" or (path / "sensor.yaml").is_file()):
            return file
    return None


def _only(path: Path, files: list[Path]) -> Path:
    """Return the one file of a folder that may be a recording."""
    found = [f for f in files if f.suffix.lower() not in _NOT_RECORDINGS]
    if len(found) == 1:
        return found[0]
    if not found:
        raise RecordingError(f"{path} is a folder without a recording in it; name the recording's file.")
    listed = ", ".join(f.name for f in found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")
    raise RecordingError(
        f"{path} is a folder with several files ({listed}); name the recording's file in it."
    )
