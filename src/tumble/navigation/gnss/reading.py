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
    nmea = any(b"$" + talker in head for talker in (b"GP", b"GN", b"GL", b"GA", b"GB"))
    if not nmea and b"\xb5\x62" in head:
        raise RecordingError(
            f"{path.name} is UBX by u-blox, which is not read: make a .pos of it by RTKLIB (convbin, then rnx2rtkp), "
            "or record NMEA (GGA, RMC and GST)."
        )
    # What overflows is refused with its fix.
    with reading(path, "a GNSS track", RecordingError), np.errstate(all="ignore"):
        return read_nmea(path) if nmea else read_table(path)
