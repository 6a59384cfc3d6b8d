"""Tables of positions with a header: CSV and the like."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError
from tumble.files import lines_of, read_text
from tumble.navigation.gnss.time_scales import UNIX_TO_GPS, WEEK, gps_from_unix, gps_from_utc, seconds_of_date
from tumble.navigation.gnss.track import GnssTrack, make_track
from tumble.recording.recording import Remark

# Names of columns, small letters without signs or units, and what they are.
_NAMES = {
    "time": ("time", "t", "timestamp", "gpstime", "utc", "utctime", "unixtime", "datetime", "seconds", "sec"),
    "week": ("week", "gpsweek", "gpsweeknumber"),
    "tow": ("tow", "itow", "gpstow", "sow", "secondsofweek", "timeofweek"),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon", "lng", "long"),
    "height": ("height", "h", "alt", "altitude", "ellipsoidalheight", "hae", "elevation"),
    "north": ("vn", "velocitynorth", "velnorth", "veln", "northvelocity", "vnorth"),
    "east": ("ve", "velocityeast", "veleast", "vele", "eastvelocity", "veast"),
    "down": ("vd", "velocitydown", "veldown", "veld", "downvelocity", "vdown"),
    "up": ("vu", "velocityup", "velup", "velu", "upvelocity", "vup"),
    "sigma north": ("sdn", "sigman", "stdn", "sigmanorth", "stdnorth", "sn"),
    "sigma east": ("sde", "sigmae", "stde", "sigmaeast", "stdeast", "se"),
    "sigma height": (
        "sdu",
        "sigmau",
        "stdu",
        "sigmaup",
        "sigmaheight",
        "stdup",
        "sdd",
        "sigmad",
        "stdd",
        "su",
    ),
    "accuracy": ("hacc", "accuracy", "horizontalaccuracy"),
    "vertical accuracy": ("vacc", "verticalaccuracy"),
    "speed accuracy": ("sacc", "speedaccuracy"),
    "quality": ("q", "quality", "fix", "fixtype"),
}
# POSIX times from 2001 on are above it, and GPS times of this century below.
_LARGEST_GPS = 2.2e9
# Without any accuracy in the file: a single-frequency receiver's, m and m/s.
_USUAL, _USUAL_SPEED = (2.0, 2.0, 4.0), 0.1


def read_text_track(path: Path) -> GnssTrack:
    """Return the track of a table whose header names its columns, on GPS time where its times can tell.

    Latitude and longitude are in degrees, unless the header says rad; heights in metres above the ellipsoid;
    velocities in m/s. Times are dates in UTC, POSIX seconds (UTC), GPS week and seconds of week, or plain
    seconds of a clock of their own; a header with the word gps makes dates and seconds GPS time.

    Parameters
    ----------
    path : of the file; columns apart by comma, semicolon, tabulator or spaces.

    Raises
    ------
    RecordingError
        If the header does not name time, latitude, longitude and height, or a value is no number.
    """
    lines = [line for line in lines_of(read_text(path, errors="replace")) if line.strip()]
    if not lines:
        raise RecordingError(f"{path.name} is empty.")
    separator = next((s for s in (",", ";", "\t") if s in lines[0]), None)
    header = [word.strip().strip('"') for word in lines[0].lstrip("#%").split(separator)]
    columns = _columns(header, path.name)
    rows = [[word.strip().strip('"') for word in line.split(separator)] for line in lines[1:]]
    for number, row in enumerate(rows, start=2):
        if len(row) < len(header):
            raise RecordingError(
                f"Line {number} of {path.name} has {len(row)} columns, and its header has {len(header)}."
            )
    if not rows:
        raise RecordingError(f"{path.name} has a header and no row.")
    value = {
        name: _numbers(rows, at, header[at], path.name) for name, at in columns.items() if name != "time"
    }
    whole = _whole_rows(rows, columns, header, value, path.name)
    without = len(rows) - int(whole.sum())
    rows = [row for row, good in zip(rows, whole.tolist(), strict=True) if good]
    value = {name: column[whole] for name, column in value.items()}
    _refuse_radians(value, header, columns, path.name)
    time, remark = _time(rows, columns, header, value, path.name)
    factor = {name: _angle_factor(header[columns[name]]) for name in ("latitude", "longitude")}
    latitude, longitude = (value[name] * factor[name] for name in ("latitude", "longitude"))
    sigmas, velocity, speeds, assumed = _accuracies(value, len(rows))
    remarks = [Remark("found", remark)]
    if without:
        text = f"{without} of {len(whole)} rows of {path.name} have no time or no position and were left out."
        remarks.append(Remark("mended", text))
    if assumed:
        remarks.append(Remark("assumed", assumed))
    quality = np.nan_to_num(value["quality"]).astype(int) if "quality" in value else None
    return make_track(
        time,
        (latitude, longitude, value["height"]),
        sigmas,
        velocity_n=velocity,
        velocity_sigmas=speeds,
        quality=quality,
        remarks=tuple(remarks),
        name=path.name,
    )


def _columns(header: Sequence[str], name: str) -> dict[str, int]:
    found: dict[str, int] = {}
    for at, word in enumerate(header):
        bare = re.sub(r"_(s|m|mps|m_s|m/s)$", "", re.sub(r"[\[(].*", "", word.lower()).strip())
        plain = re.sub(r"[^a-z]", "", bare)
        plain = re.sub(r"(deg|rad)$", "", plain)
        for what, names in _NAMES.items():
            if plain in names and what not in found:
                found[what] = at
    missing = [what for what in ("latitude", "longitude", "height") if what not in found]
    if "time" not in found and not {"week", "tow"} <= set(found):
        missing.insert(0, "time (or week and tow)")
    if missing:
        raise RecordingError(
            f"{name} is no table of positions that can be read: its header ({', '.join(header)[:100]}) does not name "
            f"{', '.join(missing)}. Name the columns so, or give a .pos, NMEA or UBX file."
        )
    return found


def _numbers(rows: Sequence[Sequence[str]], at: int, word: str, name: str) -> Series:
    try:
        return np.array([float(row[at]) if row[at] else np.nan for row in rows])
    except ValueError as error:
        raise RecordingError(
            f"The column {word} of {name} has a value that is no number: {error}."
        ) from error


def _whole_rows(
    rows: Sequence[Sequence[str]],
    columns: dict[str, int],
    header: Sequence[str],
    value: dict[str, Series],
    name: str,
) -> np.ndarray:
    """Which rows have a time, a position and what is stated of it; others are a receiver without a fix."""
    needed = (
        "week",
        "tow",
        "latitude",
        "longitude",
        "height",
        "sigma north",
        "sigma east",
        "sigma height",
        "accuracy",
    )
    good = np.ones(len(rows), dtype=bool)
    for what in needed:
        if what in value:
            good &= np.isfinite(value[what])
    if "time" in columns:
        at = columns["time"]
        dates = any(re.match(r"\s*\d{4}[-/]", row[at]) for row in rows)
        stamped = (
            [bool(row[at]) for row in rows] if dates else np.isfinite(_numbers(rows, at, header[at], name))
        )
        good &= np.asarray(stamped)
    if not good.any():
        raise RecordingError(
            f"None of the {len(rows)} rows of {name} has a time and a position that are numbers: the receiver had no "
            "fix, or the columns are others than their names say."
        )
    return good


def _refuse_radians(
    value: dict[str, Series], header: Sequence[str], columns: dict[str, int], name: str
) -> None:
    """Refuse radians under a name that says no unit: as degrees they all lie in the sea off Africa, where 0, 0 is."""
    if any(re.search(r"rad|deg|°", header[columns[what]].lower()) for what in ("latitude", "longitude")):
        return
    latitude, longitude = value["latitude"], value["longitude"]
    if (
        np.all(np.abs(latitude) <= 0.5 * np.pi)
        and np.all(np.abs(longitude) <= np.pi)
        and np.any(latitude != 0.0)
    ):
        raise RecordingError(
            f"The positions of {name} lie at {latitude[0]:.4f}, {longitude[0]:.4f}: as degrees that is in the Gulf of "
            "Guinea, so they look like radians. Name the columns latitude_rad and longitude_rad, or latitude_deg and "
            "longitude_deg."
        )


def _time(
    rows: Sequence[Sequence[str]],
    columns: dict[str, int],
    header: Sequence[str],
    value: dict[str, Series],
    name: str,
) -> tuple[Series, str]:
    """GPS time, and what the file's was."""
    if "week" in value and "tow" in value:
        unit = 1e-3 if "itow" in header[columns["tow"]].lower() else 1.0
        return value["week"] * WEEK + value["tow"] * unit, f"{name} has GPS weeks and seconds of week."
    at = columns["time"]
    gps = "gps" in header[at].lower()
    if re.match(r"\s*\d{4}[-/]", rows[0][at]):
        dates = np.array([seconds_of_date(row[at]) for row in rows])
        if gps:
            return dates, f"{name} has dates in GPS time."
        return np.array(
            [gps_from_utc(t) for t in dates]
        ), f"{name} has dates, taken as UTC and brought to GPS time."
    seconds = _numbers(rows, at, header[at], name)
    unit = 1e-3 if re.search(r"[\[(_ ]ms\b", header[at].lower()) or np.nanmedian(seconds) > 1e11 else 1.0
    seconds = seconds * unit
    typical = float(np.nanmedian(seconds))
    if gps or typical < UNIX_TO_GPS or typical > _LARGEST_GPS:
        return seconds, f"{name} has seconds of {'GPS time' if gps else 'a clock of its own'}."
    return (
        np.array([gps_from_unix(t) for t in seconds]),
        f"{name} has POSIX seconds (UTC), brought to GPS time by the leap seconds of their date.",
    )


def _angle_factor(word: str) -> float:
    return 1.0 if re.search(r"rad", word.lower()) else float(np.pi / 180.0)


def _accuracies(value: dict[str, Series], count: int) -> tuple[Vectors, Vectors | None, Vectors | None, str]:
    """Sigmas of position, velocity with its sigmas, and what was assumed."""
    assumed = ""
    if {"sigma north", "sigma east", "sigma height"} <= set(value):
        sigmas = np.column_stack([value[f"sigma {word}"] for word in ("north", "east", "height")])
    elif "accuracy" in value:
        across = value["accuracy"] * np.sqrt(0.5)
        upright = value["vertical accuracy"] if "vertical accuracy" in value else 2.0 * across
        sigmas = np.column_stack([across, across, upright])
    else:
        sigmas = np.tile(_USUAL, (count, 1))
        assumed = "The table states no accuracies: 2 m in plane and 4 m in height (one sigma) are taken."
    if not {"north", "east"} <= set(value):
        return sigmas, None, None, assumed
    down = value["down"] if "down" in value else -value["up"] if "up" in value else np.zeros(count)
    speed = value["speed accuracy"] if "speed accuracy" in value else np.full(count, _USUAL_SPEED)
    vertical = speed if "down" in value or "up" in value else np.ones(count)
    velocity = np.column_stack([value["north"], value["east"], down])
    return sigmas, velocity, np.column_stack([speed, speed, vertical]), assumed
