"""GPS time and UTC: seconds since 6 January 1980, and the leap seconds between the two."""

from __future__ import annotations

import calendar
import re
from bisect import bisect_right
from datetime import UTC, datetime
from functools import lru_cache

from tumble.errors import RecordingError

GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
# Seconds from 1 January 1970 to the GPS epoch.
UNIX_TO_GPS = float(calendar.timegm(GPS_EPOCH.timetuple()))
WEEK = 604_800.0

# UTC dates from which GPS time is one second further ahead of UTC: IERS Bulletin C, up to number 70 (no
# leap second has been announced since that of 31 December 2016).
_LEAPS = (
    (1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7), (1993, 7),
    (1994, 7), (1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7), (2015, 7), (2017, 1),
)  # fmt: skip
_LEAP_STARTS = [(datetime(year, month, 1, tzinfo=UTC) - GPS_EPOCH).total_seconds() for year, month in _LEAPS]
_DATE = re.compile(
    r"\s*(\d{4})[-/](\d{1,2})[-/](\d{1,2})[ T](\d{1,2}):(\d{2}):(\d{2}(?:\.\d*)?)\s*(Z|UTC|\+00:?00)?\s*$"
)


def leap_seconds(utc: float) -> int:
    """Return by how many seconds GPS time is ahead of UTC: 18 since 2017.

    Parameters
    ----------
    utc : s of UTC since 6 January 1980, leap seconds not counted (as POSIX time does).
    """
    return bisect_right(_LEAP_STARTS, utc)


def gps_from_utc(utc: float) -> float:
    """Return GPS time in s since 6 January 1980 for UTC in s since then, leap seconds not counted."""
    return utc + leap_seconds(utc)


def gps_from_unix(unix: float) -> float:
    """Return GPS time in s since 6 January 1980 for POSIX time, s since 1 January 1970 in UTC."""
    return gps_from_utc(unix - UNIX_TO_GPS)


def seconds_of_date(text: str) -> float:
    """Return s since 6 January 1980 of a date and time such as 2025/07/08 19:34:18.499, in its own scale.

    Raises
    ------
    RecordingError
        If it is no date and time.
    """
    found = _DATE.match(text)
    if not found:
        raise RecordingError(f"{text.strip()!r} is no date and time such as 2025/07/08 19:34:18.499.")
    try:
        minute = _seconds_of_minute(*found.group(1, 2, 3, 4, 5))
    except ValueError as error:
        raise RecordingError(f"{text.strip()!r} is no date and time: {error}.") from error
    return minute + float(found[6])


@lru_cache(maxsize=16)
def _seconds_of_minute(year: str, month: str, day: str, hour: str, minute: str) -> float:
    """Seconds at the beginning of a minute; thousands of fixes have the same one after another."""
    whole = datetime(int(year), int(month), int(day), int(hour), int(minute), tzinfo=UTC)
    return (whole - GPS_EPOCH).total_seconds()
