"""Reading a track from any file that is known: which kind it is, its content tells."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from tumble.errors import RecordingError
from tumble.files import opened, reading
from tumble.navigation.gnss.nmea import read_nmea
from tumble.navigation.gnss.rtklib import read_rtklib
from tumble.navigation.gnss.text import read_text_track
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.gnss.ubx import read_ubx

FORMATS = {
    "rtklib": "RTKLIB's solution (.pos), geodetic or Earth-frame",
    "nmea": "NMEA 0183: GGA with RMC, GST and ZDA",
    "ubx": "u-blox UBX: NAV-PVT, with NAV-COV where it is (needs the extra `gnss`)",
    "csv": "a table with a header that names time, latitude, longitude, height and their units",
}


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
    reader = {"ubx": read_ubx, "nmea": read_nmea, "rtklib": read_rtklib, "csv": read_text_track}[_kind(head)]
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
    return "rtklib" if head.lstrip().startswith(b"%") else "csv"
