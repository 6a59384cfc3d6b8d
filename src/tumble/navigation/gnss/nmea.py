"""NMEA 0183: positions of GGA, with the date and velocity of RMC, the accuracies of GST and the date of ZDA."""

from __future__ import annotations

from dataclasses import field, replace
from functools import reduce
from pathlib import Path

import numpy as np

from tumble.errors import RecordingError
from tumble.files import lines_of, number_of, read_text
from tumble.navigation.gnss.time_scales import gps_from_utc, seconds_of_date
from tumble.navigation.gnss.track import GnssTrack, make_track
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
