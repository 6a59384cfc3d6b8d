"""Satellite positions: tracks, the files that they are read from, and their time scales."""

from tumble.navigation.gnss.reading import read_track
from tumble.navigation.gnss.time_scales import gps_from_unix, gps_from_utc, leap_seconds
from tumble.navigation.gnss.track import QUALITIES, GnssTrack, make_track

__all__ = [
    "QUALITIES",
    "GnssTrack",
    "gps_from_unix",
    "gps_from_utc",
    "leap_seconds",
    "make_track",
    "read_track",
]
