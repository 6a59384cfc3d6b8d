"""u-blox UBX: NAV-PVT, through the library pyubx2."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Matrices
from tumble.errors import RecordingError, install
from tumble.files import opened
from tumble.navigation.gnss.time_scales import WEEK, gps_from_utc, seconds_of_date
from tumble.navigation.gnss.track import GnssTrack, in_order, make_track
from tumble.recording.formats.damage import foreign
from tumble.recording.recording import Remark

# Seconds that a time of week may be away from the date's: half a week.
_HALF_WEEK = 0.5 * WEEK


def read_ubx(path: Path) -> GnssTrack:
    """Return the track of a file of UBX messages, on GPS time.

    NAV-PVT has time of week (GPS), position, velocity and their accuracies (horizontal and vertical, one
    sigma); NAV-COV, where it is, their covariances. Other messages are passed over.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    RecordingError
        If the library is not installed, or there is no NAV-PVT with a fix.
    """
    messages = _messages(path)
    fixes = [
        m
        for m in messages
        if m.identity == "NAV-PVT" and m.gnssFixOk and m.fixType in (2, 3, 4) and m.validDate
    ]
    if not fixes:
        kinds = ", ".join(sorted({str(m.identity) for m in messages})) or "none"
        raise RecordingError(
            f"{path.name} has no NAV-PVT with a fix; its messages are {kinds}. Raw measurements (RXM-RAWX) must be "
            "solved first, for example by RTKLIB, whose .pos is read too."
        )
    covariances = {int(m.iTOW): m for m in messages if m.identity == "NAV-COV"}
    return _track(fixes, covariances, path.name)


def _messages(path: Path) -> list[Any]:
    """All messages of a file."""
    try:
        library: Any = import_module("pyubx2")
    except ImportError as error:
        raise RecordingError(
            f"{path.name} is UBX, which is read by the library pyubx2: install it with {install('gnss')}."
        ) from error
    with foreign(path, "UBX file"), opened(path) as file:
        reader: Any = library.UBXReader(file, protfilter=library.UBX_PROTOCOL, quitonerror=0)
        return [message for _, message in reader if message is not None]


def _track(fixes: list[Any], covariances: dict[int, Any], name: str) -> GnssTrack:
    time = np.array([_gps_time(m) for m in fixes])
    horizontal, vertical, speed = (
        np.array([getattr(m, word) * 1e-3 for m in fixes]) for word in ("hAcc", "vAcc", "sAcc")
    )
    root = np.sqrt(0.5)
    velocity = np.array([[m.velN, m.velE, m.velD] for m in fixes], dtype=float) * 1e-3
    track = make_track(
        time,
        (
            np.radians([float(m.lat) for m in fixes]),
            np.radians([float(m.lon) for m in fixes]),
            np.array([m.height * 1e-3 for m in fixes], dtype=float),
        ),
        np.maximum(np.column_stack([horizontal * root, horizontal * root, vertical]), 1e-3),
        velocity_n=velocity,
        velocity_sigmas=np.maximum(np.column_stack([speed * root] * 3), 1e-3),
        quality=np.array([_quality(m) for m in fixes]),
        remarks=(
            Remark("found", f"{name} is UBX with {len(fixes)} fixes (NAV-PVT), times of week in GPS time."),
        ),
        name=name,
    )
    if not covariances:
        return track
    order = {round(t, 3): m for t, m in zip(time.tolist(), fixes, strict=True)}
    for row, at in enumerate(track.time.tolist()):
        message = covariances.get(int(order[round(at, 3)].iTOW))
        if message is not None:
            for what, target in (("pos", track.position_covariance_n), ("vel", track.velocity_covariance_n)):
                matrix = next(_matrix(message, what))
                if np.all(np.linalg.eigvalsh(matrix[0]) > 0.0):
                    target[row] = matrix[0]
    return in_order(track)


def _matrix(message: Any, what: str) -> Iterator[Matrices]:
    names = [["NN", "NE", "ND"], ["NE", "EE", "ED"], ["ND", "ED", "DD"]]
    yield np.array([[[float(getattr(message, f"{what}Cov{name}")) for name in row] for row in names]])


def _gps_time(message: Any) -> float:
    """GPS time of a message: the week by its date (UTC), the second by its time of week."""
    date = seconds_of_date(f"{message.year}/{message.month}/{message.day} 00:00:00")
    near = gps_from_utc(date + message.hour * 3600.0 + message.min * 60.0 + min(message.second, 59))
    second = message.iTOW * 1e-3
    return float(second + WEEK * np.floor((near - second + _HALF_WEEK) / WEEK))


def _quality(message: Any) -> int:
    """By the numbers of `QUALITIES`."""
    carrier = int(message.carrSoln)
    if carrier:
        return 1 if carrier == 2 else 2
    return 4 if message.diffSoln else 5
