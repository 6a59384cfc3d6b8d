"""RTKLIB's solution files (.pos): geodetic or Earth-frame positions, with velocities where there are any."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tumble.arrays import Matrices, Table, Vectors
from tumble.earth import geodetic_position, rotations_to_earth_frame
from tumble.errors import RecordingError
from tumble.files import lines_of, number_of, read_text
from tumble.navigation.gnss.time_scales import WEEK, gps_from_utc, seconds_of_date
from tumble.navigation.gnss.track import GnssTrack, in_order
from tumble.recording.recording import Remark


def read_rtklib(path: Path) -> GnssTrack:
    """Return the track of an RTKLIB solution file, on GPS time.

    The header line names the columns; their order and presence is free. Times of calendar or of week and
    seconds are read, in GPST or UTC. Signed square roots of covariances (sdne, ...) enter the covariance.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    RecordingError
        If there is no header with the names of the columns, a row does not have as many, or a value is none.
    """
    lines = lines_of(read_text(path, errors="replace"))
    names, scale = _columns(lines, path.name)
    time, table, dropped = _numbers(lines, len(names), path.name)
    if not len(table):
        raise RecordingError(f"{path.name} has a header of RTKLIB and no row of a solution.")
    remarks = [Remark("found", f"{path.name} is a solution of RTKLIB with times in {scale}.")]
    if scale == "UTC":
        time = np.array([gps_from_utc(t) for t in time])
        remarks.append(
            Remark("found", "Its times have been brought to GPS time by the leap seconds of their date.")
        )
    elif scale != "GPST":
        raise RecordingError(f"{path.name} has its times in {scale}: write it anew with GPST or UTC.")
    if dropped:
        text = f"{dropped} row{'s' if dropped > 1 else ''} of {path.name} without its columns were left out."
        remarks.append(Remark("mended", text))
    column = _Columns({name: table[:, i] for i, name in enumerate(names)})
    return in_order(_track(column, time, path.name, tuple(remarks)))


class _Columns(dict[str, np.ndarray]):
    """Columns by name; one that the others need and that is not there is a sentence."""

    def __missing__(self, name: str) -> np.ndarray:
        raise RecordingError(
            f"The solution of RTKLIB has no column {name}, which belongs to {', '.join(list(self)[:3])} and so on: "
            "write it anew."
        )


def _columns(lines: Sequence[str], name: str) -> tuple[list[str], str]:
    """Names of the columns after the time, and the time's scale."""
    for line in lines:
        if line.startswith("%") and ("latitude" in line or "x-ecef" in line):
            words = line[1:].replace(",", " ").split()
            if any(word.startswith("latitude(d'") for word in words):
                raise RecordingError(
                    f"{name} has degrees, minutes and seconds: write it anew with degrees as decimal numbers "
                    "(out-solformat llh, out-degform deg)."
                )
            if any(word.startswith("e-baseline") for word in words):
                break
            return words[1:], words[0]
    raise RecordingError(
        f"{name} has no header of RTKLIB that names latitude(deg), longitude(deg) and height(m), or x-ecef(m) and "
        "so on: write it anew with out-outhead on and out-solformat llh."
    )


def _numbers(lines: Sequence[str], columns: int, name: str) -> tuple[np.ndarray, Table, int]:
    times: list[float] = []
    rows: list[list[float]] = []
    dropped = 0
    for number, line in enumerate(lines, start=1):
        if line.startswith("%") or not line.strip():
            continue
        words = line.replace(",", " ").split()
        if len(words) != columns + 2:
            # a file that was cut while it was written ends in such a row
            dropped += 1
            continue
        try:
            if words[0][4:5] == "/":
                times.append(seconds_of_date(f"{words[0]} {words[1]}"))
            else:
                times.append(number_of(words[0]) * WEEK + number_of(words[1]))
            rows.append(list(map(float, words[2:])))
        except ValueError as error:
            raise RecordingError(
                f"Line {number} of {name} has a value that is no number: {line.strip()[:60]!r}."
            ) from error
    if dropped > 1 and dropped > 0.01 * len(rows):
        raise RecordingError(
            f"{dropped} of {dropped + len(rows)} rows of {name} do not have the {columns + 2} columns that its "
            "header names: the header is not this file's."
        )
    return np.array(times), np.array(rows, dtype=float).reshape(len(rows), columns), dropped


def _track(
    column: dict[str, np.ndarray], time: np.ndarray, name: str, remarks: tuple[Remark, ...]
) -> GnssTrack:
    fixes = len(time)
    nothing = np.full((fixes, 3), np.nan)
    if "latitude(deg)" in column:
        latitude, longitude = np.radians(column["latitude(deg)"]), np.radians(column["longitude(deg)"])
        height = column["height(m)"]
        covariance = _covariance(column, ("sdn(m)", "sde(m)", "sdu(m)"), ("sdne(m)", "sdeu(m)", "sdun(m)"))
        velocity = nothing
        if "vn(m/s)" in column:
            velocity = np.column_stack([column["vn(m/s)"], column["ve(m/s)"], -column["vu(m/s)"]])
        speeds = _covariance(column, ("sdvn", "sdve", "sdvu"), ("sdvne", "sdveu", "sdvun"))
        covariance, speeds = _down(covariance), _down(speeds)
    else:
        position = np.column_stack([column[f"{axis}-ecef(m)"] for axis in "xyz"])
        latitude, longitude, height = geodetic_position(position)
        C_en = rotations_to_earth_frame(latitude, longitude)
        covariance = _covariance(column, ("sdx(m)", "sdy(m)", "sdz(m)"), ("sdxy(m)", "sdyz(m)", "sdzx(m)"))
        covariance = np.einsum("kji,kjl,klm->kim", C_en, covariance, C_en)
        velocity = nothing
        if "vx(m/s)" in column:
            velocity_e = np.column_stack([column[f"v{axis}(m/s)"] for axis in "xyz"])
            velocity = np.einsum("kji,kj->ki", C_en, velocity_e)
        speeds = _covariance(column, ("sdvx", "sdvy", "sdvz"), ("sdvxy", "sdvyz", "sdvzx"))
        speeds = np.einsum("kji,kjl,klm->kim", C_en, speeds, C_en)
    quality = column["Q"].astype(int) if "Q" in column else np.full(fixes, 5)
    return GnssTrack(time, latitude, longitude, height, covariance, velocity, speeds, quality, remarks, name)


def _covariance(column: dict[str, np.ndarray], own: Sequence[str], between: Sequence[str]) -> Matrices:
    """Covariances from RTKLIB's standard deviations and signed roots of the covariances between them."""
    fixes = len(next(iter(column.values())))
    result = np.full((fixes, 3, 3), np.nan)
    if not all(name in column for name in own):
        return result
    result[:] = 0.0
    for i, name in enumerate(own):
        result[:, i, i] = column[name] ** 2
    for (i, j), name in zip(((0, 1), (1, 2), (2, 0)), between, strict=True):
        if name in column:
            # what was rounded to a correlation of one or more has no Cholesky factor
            limit = 0.99 * np.sqrt(result[:, i, i] * result[:, j, j])
            value = np.clip(np.sign(column[name]) * column[name] ** 2, -limit, limit)
            result[:, i, j] = result[:, j, i] = value
    return result


def _down(covariance_up: Matrices) -> Matrices:
    """Of north, east, up to north, east, down."""
    sign: Vectors = np.array([[1.0, 1.0, -1.0]])
    return covariance_up * sign[:, :, None] * sign[:, None, :]
