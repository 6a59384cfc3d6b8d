"""Reading a track from any file that is known, among them tables and RTKLIB's solutions: its content tells which."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from functools import reduce
from pathlib import Path

import numpy as np

from tumble.arrays import Matrices, Series, Vectors
from tumble.earth import geodetic_position, rotations_to_earth_frame
from tumble.errors import RecordingError
from tumble.files import lines_of, number_of, opened, read_text, reading
from tumble.navigation.gnss.time_scales import UNIX_TO_GPS, WEEK, gps_from_unix, gps_from_utc, seconds_of_date
from tumble.navigation.gnss.track import GnssTrack, in_order, make_track
from tumble.recording import Remark
from tumble.records import dataclass

_KNOT = 1852.0 / 3600.0
_DAY = 86_400.0
# Range error (one sigma, m) by GGA's quality, which the dilution multiplies where there is no GST: usual
# receivers' of today.
_RANGE = {1: 2.0, 2: 0.8, 3: 2.0, 4: 0.01, 5: 0.2}
# GGA's quality by the numbers of `QUALITIES`.
_QUALITY = {1: 5, 2: 4, 3: 6, 4: 1, 5: 2, 6: 0, 7: 0, 8: 0}
_SPEED_SIGMA = 0.1


@dataclass
class _Epoch:
    """What the sentences of one instant said; NaN for what none did."""

    latitude: float = np.nan
    longitude: float = np.nan
    height: float = np.nan
    quality: int = 0
    dilution: float = 1.0
    sigmas: list[float] = field(default_factory=lambda: [np.nan] * 3)
    speed: float = np.nan
    course: float = np.nan


def read_nmea(path: Path) -> GnssTrack:
    """Return the track of a file of NMEA sentences, on GPS time.

    Heights are the sum of GGA's altitude and its separation of the geoid, above the ellipsoid. UTC is brought to
    GPS time by the leap seconds of the date, which RMC or ZDA has. Without GST the accuracies are GGA's
    dilution times a usual range error. RMC's velocity is horizontal: down is set to zero with 1 m/s.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    RecordingError
        If there is no position, or no date.
    """
    text = read_text(path, errors="replace")
    epochs, broken, latest = _epochs(text)
    rows = [
        (utc, epoch) for utc, epoch in epochs.items() if np.isfinite(epoch.latitude) and epoch.quality > 0
    ]
    if latest is None:
        raise RecordingError(
            f"{path.name} has no date: its sentences are {_kinds(text)}, and RMC or ZDA gives the "
            "date. Log one of them too."
        )
    if not rows:
        raise RecordingError(
            f"{path.name} has no fix: its sentences are {_kinds(text)}, and GGA gives positions."
        )
    remarks = [
        Remark("found", f"{path.name} is NMEA in UTC, brought to GPS time by the leap seconds of its date.")
    ]
    if broken:
        remarks.append(
            Remark("mended", f"{broken} sentences with a false checksum or without it were left out.")
        )
    if not any(np.isfinite(epoch.sigmas[0]) for _, epoch in rows):
        text = "There is no GST: accuracies are the dilution times a usual range error of the quality."
        remarks.append(Remark("assumed", text))
    return _track(rows, path.name, tuple(remarks))


def _epochs(text: str) -> tuple[dict[float, _Epoch], int, float | None]:
    """Epochs by their UTC (s since 1980, without leap seconds), and how many sentences were broken."""
    epochs: dict[float, _Epoch] = {}
    waiting: list[tuple[str, list[str]]] = []
    broken, date, last = 0, None, -1.0
    for line in lines_of(text):
        start = line.find("$")
        if start < 0:
            continue
        words = _sentence(line[start:])
        if words is None:
            broken += 1
            continue
        kind = words[0][2:]
        try:
            date, last = _dated(kind, words) or (date, last)
        except (ValueError, RecordingError):
            broken += 1
            continue
        if kind in ("GGA", "RMC", "GST") and len(words) > 8 and words[1]:
            waiting.append((kind, words))
        if date is None:
            continue
        for what, held in waiting:
            # after midnight GGA may come before the sentence with the new date, and the other way round
            try:
                second = _seconds(held[1])
                day = _DAY if second - last < -0.5 * _DAY else (-_DAY if second - last > 0.5 * _DAY else 0.0)
                at = round(date + day + second, 4)
                epochs[at] = _with(what, held, epochs.get(at, _Epoch()))
            except ValueError:
                broken += 1
        waiting.clear()
    return epochs, broken, date


def _dated(kind: str, words: list[str]) -> tuple[float, float] | None:
    """Return the day that a sentence has (s since 1980) and its second of the day, or None."""
    if kind == "ZDA" and len(words) > 4 and words[2] and words[4]:
        return seconds_of_date(f"{words[4]}/{words[3]}/{words[2]} 00:00:00"), _seconds(words[1])
    if kind == "RMC" and len(words) > 9 and words[9]:
        year = int(words[9][4:6])
        year += 1900 if year >= 80 else 2000
        return seconds_of_date(f"{year}/{words[9][2:4]}/{words[9][:2]} 00:00:00"), _seconds(words[1])
    return None


def _sentence(line: str) -> list[str] | None:
    """The words of a sentence, or None where its checksum is false or missing."""
    body, star, tail = line[1:].partition("*")
    try:
        good = bool(star) and int(tail[:2], 16) == reduce(lambda a, b: a ^ b, body.encode("ascii"), 0)
    except (ValueError, UnicodeEncodeError):
        good = False
    words = body.split(",")
    return words if good and len(words[0]) == 5 else None


def _with(kind: str, words: list[str], epoch: _Epoch) -> _Epoch:
    """Return an epoch with what a sentence says; ValueError where that is no number."""
    epoch = replace(epoch)
    if kind == "GGA" and len(words) > 11 and words[2] and words[4]:
        epoch.latitude = _angle(words[2]) * (-1.0 if words[3] == "S" else 1.0)
        epoch.longitude = _angle(words[4]) * (-1.0 if words[5] == "W" else 1.0)
        epoch.quality = int(number_of(words[6] or "0"))
        epoch.dilution = number_of(words[8] or "1")
        epoch.height = (number_of(words[9]) if words[9] else np.nan) + number_of(words[11] or "0")
    elif kind == "RMC" and words[2] == "A":
        epoch.speed = (number_of(words[7]) if words[7] else np.nan) * _KNOT
        # a receiver at rest leaves the course out
        epoch.course = float(np.radians(number_of(words[8] or "0")))
    elif kind == "GST" and all(words[6:9]):
        epoch.sigmas = [number_of(word) for word in words[6:9]]
    return epoch


def _angle(word: str) -> float:
    """Degrees and minutes as ddmm.mmm, in rad."""
    dot = word.find(".") if "." in word else len(word)
    return float(np.radians(number_of(word[: dot - 2] or "0") + number_of(word[dot - 2 :]) / 60.0))


def _seconds(word: str) -> float:
    return int(word[:2]) * 3600.0 + int(word[2:4]) * 60.0 + number_of(word[4:])


def _track(rows: list[tuple[float, _Epoch]], name: str, remarks: tuple[Remark, ...]) -> GnssTrack:
    time = np.array([gps_from_utc(utc) for utc, _ in rows])
    latitude, longitude, height, speed, course = (
        np.array([getattr(epoch, word) for _, epoch in rows], dtype=float)
        for word in ("latitude", "longitude", "height", "speed", "course")
    )
    sigmas = np.array([epoch.sigmas for _, epoch in rows], dtype=float)
    usual = np.array([_RANGE.get(epoch.quality, 5.0) * epoch.dilution for _, epoch in rows])
    sigmas = np.where(
        np.isfinite(sigmas) & (sigmas > 0.0), sigmas, usual[:, None] * np.array([0.7, 0.7, 1.5])
    )
    velocity = np.column_stack([speed * np.cos(course), speed * np.sin(course), 0.0 * speed])
    return make_track(
        time,
        (latitude, longitude, height),
        sigmas,
        velocity_n=velocity,
        velocity_sigmas=np.tile([_SPEED_SIGMA, _SPEED_SIGMA, 1.0], (len(rows), 1)),
        quality=np.array([_QUALITY.get(epoch.quality, 0) for _, epoch in rows]),
        remarks=remarks,
        name=name,
    )


def _kinds(text: str) -> str:
    found = {line[line.find("$") + 3 :][:3] for line in lines_of(text) if "$" in line}
    return ", ".join(sorted(found)) or "none"


# Names of columns, small letters without signs or units, and what they are.
_NAMES = {
    "time": "time t timestamp gpstime utc utctime unixtime datetime seconds sec",
    "week": "week gpsweek gpsweeknumber",
    "tow": "tow itow gpstow sow secondsofweek timeofweek",
    "latitude": "latitude lat",
    "longitude": "longitude lon lng long",
    "height": "height h alt altitude ellipsoidalheight hae elevation",
    "vn": "vn velocitynorth velnorth veln northvelocity vnorth",
    "ve": "ve velocityeast veleast vele eastvelocity veast",
    "vd": "vd velocitydown veldown veld downvelocity vdown",
    "vu": "vu velocityup velup velu upvelocity vup",
    "sdn": "sdn sigman stdn sigmanorth stdnorth sn",
    "sde": "sde sigmae stde sigmaeast stdeast se",
    "sdu": "sdu sigmau stdu sigmaup sigmaheight stdup sdd sigmad stdd su",
    "accuracy": "hacc accuracy horizontalaccuracy",
    "vertical accuracy": "vacc verticalaccuracy",
    "speed accuracy": "sacc speedaccuracy",
    "quality": "q quality fix fixtype",
}
# RTKLIB's own: the Earth frame, and signed roots of covariances.
_RTKLIB = (
    *("xecef", "yecef", "zecef", "vx", "vy", "vz", "sdne", "sdeu", "sdun", "sdx", "sdy", "sdz"),
    *("sdxy", "sdyz", "sdzx", "sdvn", "sdve", "sdvu", "sdvne", "sdveu", "sdvun"),
    *("sdvx", "sdvy", "sdvz", "sdvxy", "sdvyz", "sdvzx"),
)
_KNOWN = {word: what for what, words in _NAMES.items() for word in words.split()} | {w: w for w in _RTKLIB}
# Of these a row without a number is one of a receiver without a fix.
_NEEDED = ("latitude", "longitude", "height", "xecef", "yecef", "zecef", "sdn", "sde", "sdu", "accuracy")
# POSIX times from 2001 on are above it, and GPS times of this century below.
_LARGEST_GPS = 2.2e9
# Without any accuracy in the file: a single-frequency receiver's, m and m/s.
_USUAL, _USUAL_SPEED = (2.0, 2.0, 4.0), 0.1

_Values = dict[str, Series]


def read_table(path: Path) -> GnssTrack:
    """Return the track of a table whose header names its columns, on GPS time where its times can tell.

    Latitude and longitude are in degrees, unless the header says rad; heights in metres above the ellipsoid;
    velocities in m/s. Times are dates in UTC, POSIX seconds (UTC), GPS week and seconds of week, or plain
    seconds of a clock of their own; a header with the word gps makes dates and seconds GPS time. RTKLIB's solutions
    are geodetic or in the Earth frame, in GPST or UTC; their signed roots of covariances enter the covariance.

    Parameters
    ----------
    path : of the file; columns apart by comma, semicolon, tabulator or spaces.

    Raises
    ------
    RecordingError
        If the header does not name time and position, or a value is no number.
    """
    name = path.name
    lines = [line for line in lines_of(read_text(path, errors="replace")) if line.strip()]
    if not lines:
        raise RecordingError(f"{name} is empty.")
    solution = lines[0].startswith("%")
    header, rows = _solution(lines, name) if solution else _plain(lines)
    rows, remarks = _of_one_width(rows, len(header), name)
    columns = _columns(header, name, solution)
    cells = np.array(rows)
    value = {what: _numbers(cells[:, at], header[at], name) for what, at in columns.items() if what != "time"}
    stamps: list[str] = cells[:, columns["time"]].tolist() if "time" in columns else []
    time, said = (
        _solution_time(stamps, header[0], name) if solution else _time(stamps, header, columns, value)
    )
    remarks = [Remark("found", f"{name} {said}"), *remarks]
    good = np.isfinite(time)
    for what in _NEEDED:
        good &= np.isfinite(value.get(what, time))
    if not good.any():
        raise RecordingError(
            f"None of the {len(rows)} rows of {name} has a time and a position that are numbers: the receiver had no "
            "fix, or the columns are others than their names say."
        )
    if not good.all():
        text = f"{np.count_nonzero(~good)} of {len(rows)} rows of {name} have no time or no position and were left out."
        remarks.append(Remark("mended", text))
    value = {what: column[good] for what, column in value.items()}
    if "xecef" in value:
        return in_order(_in_earth_frame(time[good], value, tuple(remarks), name))
    words = [header[columns[what]] for what in ("latitude", "longitude")]
    _refuse_radians(value, words, name)
    place = _radians(value["latitude"], words[0]), _radians(value["longitude"], words[1]), value["height"]
    covariance, assumed = _position_covariance(value)
    if assumed:
        remarks.append(Remark("assumed", assumed))
    measured = time[good], *place, covariance, *_velocity(value, solution)
    return in_order(GnssTrack(*measured, _quality(value), tuple(remarks), name))


def _plain(lines: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table."""
    separator = next((s for s in (",", ";", "\t") if s in lines[0]), None)
    rows = [[word.strip().strip('"') for word in line.split(separator)] for line in lines[1:]]
    header = [word.strip().strip('"') for word in lines[0].lstrip("#").split(separator)]
    return header, [row[: len(header)] for row in rows]


def _solution(lines: Sequence[str], name: str) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a solution of RTKLIB, each with both words of its time in one."""
    for line in lines:
        header = line[1:].replace(",", " ").split()
        if not line.startswith("%") or not ("latitude" in line or "x-ecef" in line):
            continue
        if any(word.startswith("latitude(d'") for word in header):
            raise RecordingError(
                f"{name} has degrees, minutes and seconds: write it anew with degrees as decimal numbers "
                "(out-solformat llh, out-degform deg)."
            )
        if header[0] not in ("GPST", "UTC"):
            raise RecordingError(f"{name} has its times in {header[0]}: write it anew with GPST or UTC.")
        words = (row.replace(",", " ").split() for row in lines if not row.startswith("%"))
        return header, [[" ".join(row[:2]), *row[2:]] for row in words]
    raise RecordingError(
        f"{name} has no header of RTKLIB that names latitude(deg), longitude(deg) and height(m), or x-ecef(m) and "
        "so on: write it anew with out-outhead on and out-solformat llh."
    )


def _of_one_width(rows: Sequence[list[str]], columns: int, name: str) -> tuple[list[list[str]], list[Remark]]:
    """Rows with all columns; a file that was cut while it was written ends in one without."""
    if not rows:
        raise RecordingError(f"{name} has a header and no row.")
    whole = [row for row in rows if len(row) == columns]
    dropped = len(rows) - len(whole)
    if not whole or (dropped > 1 and dropped > 0.01 * len(whole)):
        raise RecordingError(
            f"{dropped} of {len(rows)} rows of {name} do not have the {columns} columns that its header names: the "
            "header is not this file's."
        )
    if not dropped:
        return whole, []
    text = f"{dropped} row{'s' if dropped > 1 else ''} of {name} without its columns were left out."
    return whole, [Remark("mended", text)]


def _columns(header: Sequence[str], name: str, solution: bool) -> dict[str, int]:
    found: dict[str, int] = {"time": 0} if solution else {}
    for at, word in enumerate(header):
        bare = re.sub(r"_(s|m|mps|m_s|m/s)$", "", re.sub(r"[\[(].*", "", word.lower()).strip())
        plain = re.sub(r"(deg|rad)$", "", re.sub(r"[^a-z]", "", bare))
        if plain in _KNOWN:
            found.setdefault(_KNOWN[plain], at)
    needed = ("xecef", "yecef", "zecef") if "xecef" in found else ("latitude", "longitude", "height")
    missing = [what for what in needed if what not in found]
    if "time" not in found and not {"week", "tow"} <= set(found):
        missing.insert(0, "time (or week and tow)")
    if missing:
        raise RecordingError(
            f"{name} is no table of positions that can be read: its header ({', '.join(header)[:100]}) does not name "
            f"{', '.join(missing)}. Name the columns so, or give a .pos or NMEA file."
        )
    return found


def _numbers(words: np.ndarray, word: str, name: str) -> Series:
    try:
        return np.where(words == "", "nan", words).astype(np.float64)
    except ValueError as error:
        raise RecordingError(
            f"The column {word} of {name} has a value that is no number: {error}."
        ) from error


def _refuse_radians(value: _Values, words: Sequence[str], name: str) -> None:
    """Refuse radians under a name that says no unit: as degrees they all lie in the sea off Africa, where 0, 0 is."""
    if any(re.search(r"rad|deg|°", word.lower()) for word in words):
        return
    latitude, longitude = value["latitude"], value["longitude"]
    small = (np.abs(latitude) <= 0.5 * np.pi) & (np.abs(longitude) <= np.pi)
    if np.all(small) and np.any(latitude != 0.0):
        raise RecordingError(
            f"The positions of {name} lie at {latitude[0]:.4f}, {longitude[0]:.4f}: as degrees that is in the Gulf of "
            "Guinea, so they look like radians. Name the columns latitude_rad and longitude_rad, or latitude_deg and "
            "longitude_deg."
        )


def _solution_time(words: Sequence[str], scale: str, name: str) -> tuple[Series, str]:
    """GPS time of RTKLIB's calendar, or of week and seconds, and what the file has."""
    if words[0][4:5] == "/":
        time = np.array([seconds_of_date(word) for word in words])
    else:
        parts = np.array([word.split() for word in words])
        time = _numbers(parts[:, 0], scale, name) * WEEK + _numbers(parts[:, 1], scale, name)
    said = f"is a solution of RTKLIB with times in {scale}."
    if scale == "UTC":
        time = np.array([gps_from_utc(t) for t in time.tolist()])
        said += " They have been brought to GPS time by the leap seconds of their date."
    return time, said


def _time(
    words: Sequence[str], header: Sequence[str], columns: dict[str, int], value: _Values
) -> tuple[Series, str]:
    """GPS time, NaN where there is none, and what the file has."""
    if "week" in value and "tow" in value:
        unit = 1e-3 if "itow" in header[columns["tow"]].lower() else 1.0
        return value["week"] * WEEK + value["tow"] * unit, "has GPS weeks and seconds of week."
    word = header[columns["time"]]
    gps = "gps" in word.lower()
    if any(re.match(r"\s*\d{4}[-/]", one) for one in words):
        dates = np.array([seconds_of_date(one) if one else np.nan for one in words])
        if gps:
            return dates, "has dates in GPS time."
        return _each(gps_from_utc, dates), "has dates, taken as UTC and brought to GPS time."
    seconds = _numbers(np.array(words), word, "the table")
    unit = 1e-3 if re.search(r"[\[(_ ]ms\b", word.lower()) or np.nanmedian(seconds) > 1e11 else 1.0
    seconds = seconds * unit
    typical = float(np.nanmedian(seconds))
    if gps or typical < UNIX_TO_GPS or typical > _LARGEST_GPS:
        return seconds, f"has seconds of {'GPS time' if gps else 'a clock of its own'}."
    said = "has POSIX seconds (UTC), brought to GPS time by the leap seconds of their date."
    return _each(gps_from_unix, seconds), said


def _each(change: Callable[[float], float], time: Series) -> Series:
    return np.array([change(t) if np.isfinite(t) else t for t in time.tolist()])


def _radians(values: Series, word: str) -> Series:
    return values if "rad" in word.lower() else np.radians(values)


def _quality(value: _Values) -> np.ndarray:
    found = value.get("quality", np.full(len(next(iter(value.values()))), 5.0))
    return np.nan_to_num(found).astype(int)


def _position_covariance(value: _Values) -> tuple[Matrices, str]:
    """Covariances in north, east, down, and what was assumed."""
    height = value["height"]
    if {"sdn", "sde", "sdu"} <= set(value):
        return _down(_covariance(value, ("sdn", "sde", "sdu"), ("sdne", "sdeu", "sdun"))), ""
    if "accuracy" in value:
        across = value["accuracy"] * np.sqrt(0.5)
        upright = value["vertical accuracy"] if "vertical accuracy" in value else 2.0 * across
        return _diagonal(across, across, upright), ""
    assumed = "The table states no accuracies: 2 m in plane and 4 m in height (one sigma) are taken."
    return _diagonal(*np.tile(_USUAL, (len(height), 1)).T), assumed


def _velocity(value: _Values, solution: bool) -> tuple[Vectors, Matrices]:
    """Velocities in north, east, down with their covariances, of NaN where there are none."""
    nothing = np.full(len(value["height"]), np.nan)
    if not {"vn", "ve"} <= set(value):
        return np.column_stack([nothing] * 3), _diagonal(nothing, nothing, nothing)
    down = value.get("vd", -value.get("vu", np.zeros(len(nothing))))
    velocity = np.column_stack([value["vn"], value["ve"], down])
    if solution:
        return velocity, _down(_covariance(value, ("sdvn", "sdve", "sdvu"), ("sdvne", "sdveu", "sdvun")))
    speed = value.get("speed accuracy", np.full(len(nothing), _USUAL_SPEED))
    return velocity, _diagonal(speed, speed, speed if {"vd", "vu"} & set(value) else np.ones(len(nothing)))


def _in_earth_frame(time: Series, value: _Values, remarks: tuple[Remark, ...], name: str) -> GnssTrack:
    """The track of positions, velocities and covariances in the Earth frame."""
    place = geodetic_position(np.column_stack([value[f"{axis}ecef"] for axis in "xyz"]))
    C_en = rotations_to_earth_frame(place[0], place[1])
    covariances = [
        np.einsum("kji,kjl,klm->kim", C_en, _covariance(value, own, between), C_en)
        for own, between in (
            (("sdx", "sdy", "sdz"), ("sdxy", "sdyz", "sdzx")),
            (("sdvx", "sdvy", "sdvz"), ("sdvxy", "sdvyz", "sdvzx")),
        )
    ]
    velocity = np.full((len(time), 3), np.nan)
    if "vx" in value:
        velocity = np.einsum("kji,kj->ki", C_en, np.column_stack([value[f"v{axis}"] for axis in "xyz"]))
    return GnssTrack(time, *place, covariances[0], velocity, covariances[1], _quality(value), remarks, name)


def _covariance(value: _Values, own: Sequence[str], between: Sequence[str]) -> Matrices:
    """Covariances from standard deviations and RTKLIB's signed roots of those between them."""
    if not set(own) <= set(value):
        return np.full((len(next(iter(value.values()))), 3, 3), np.nan)
    result = _diagonal(*(value[name] for name in own))
    for (i, j), name in zip(((0, 1), (1, 2), (2, 0)), between, strict=True):
        if name in value:
            # what was rounded to a correlation of one or more has no Cholesky factor
            limit = 0.99 * np.sqrt(result[:, i, i] * result[:, j, j])
            root = np.clip(np.sign(value[name]) * value[name] ** 2, -limit, limit)
            result[:, i, j] = result[:, j, i] = root
    return result


def _diagonal(*sigmas: Series) -> Matrices:
    return np.einsum("ij,jk->ijk", np.column_stack(sigmas) ** 2, np.eye(3))


def _down(covariance_up: Matrices) -> Matrices:
    """Of north, east, up to north, east, down."""
    sign: Vectors = np.array([[1.0, 1.0, -1.0]])
    return covariance_up * sign[:, :, None] * sign[:, None, :]


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
