"""Reading a track from any file that is known: which kind it is, its content tells."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from tumble.errors import RecordingError
from tumble.files import opened, reading
from tumble.navigation.gnss.nmea import read_nmea
from tumble.navigation.gnss.tables import read_table
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.gnss.ubx import read_ubx


def read_track(path: str | os.PathLike[str]) -> GnssTrack:
    """Return the track of a file of any of the known kinds, on GPS time.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    RecordingError
        If it cannot be read, is of no known kind, or says something that cannot be.
    """
    path = Path(path)
    with reading(path, "a GNSS track", RecordingError), opened(path) as file:
        head = file.read(4096)
    if not head.strip():
        raise RecordingError(f"{path.name} is empty.")
    reader = {"ubx": read_ubx, "nmea": read_nmea, "table": read_table}[_kind(head)]
    # What overflows is refused with its fix.
    with reading(path, "a GNSS track", RecordingError), np.errstate(all="ignore"):
        return reader(path)


def _kind(head: bytes) -> str:
    """The kind of a file by its first bytes."""
    nmea = any(head.find(b"$" + talker) >= 0 for talker in (b"GP", b"GN", b"GL", b"GA", b"GB"))
    ubx = head.find(b"\xb5\x62") >= 0
    if ubx and (not nmea or head.find(b"\xb5\x62") < head.find(b"$G")):
        return "ubx"
    if nmea:
        return "nmea"
    return "table"
