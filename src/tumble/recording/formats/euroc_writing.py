"""Writing recordings as the folder of an IMU in EuRoC's form: `mav0/imu0/data.csv` and `sensor.yaml`.

References
----------
Burri et al. (2016), *The EuRoC micro aerial vehicle datasets*, IJRR 35(10): stamps in ns, angular rate in rad/s,
then specific force in m/s².
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series
from tumble.errors import OutputError, UsageError
from tumble.files import check_target, filled_folder, put_text
from tumble.recording.formats.folder import euroc_file
from tumble.recording.recording import Recording

PLACE = Path("mav0", "imu0")
_HEADER = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)
_MARK = "corrected_by"
_SAID = re.compile(rf"^{_MARK}:\s*\[([0-9a-f, ]*)\]", re.MULTILINE)
_NEAR = 1e-6  # s, by which a stamp of a float may be off the one in ns
_SENSOR = """sensor_type: imu
comment: corrected by tumble
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.0,
         0.0, 1.0, 0.0, 0.0,
         0.0, 0.0, 1.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
"""


def write_euroc(
    blocks: Iterable[Recording],
    target: Path,
    marks: Sequence[str] = (),
    *,
    like: Path | None = None,
) -> None:
    """Write consecutive blocks as the IMU of an EuRoC folder; other sensors that are there stay.

    Parameters
    ----------
    blocks, target : pieces of one recording in time order with both triads, SI, and the folder.
    marks : identities of the calibrations that the recording went through.
    like : an EuRoC folder, whose stamps and `sensor.yaml` are kept.

    Raises
    ------
    UsageError
        If a triad is missing, or a place is none for a result.
    OutputError
        If it cannot be written; what was there is intact.
    """
    source = None if like is None else euroc_file(like)
    exact = None if source is None else _exact_stamps(source)
    consecutive = iter(blocks)
    first = next(consecutive)
    if first.specific_force is None or first.angular_rate is None:
        raise UsageError(
            "EuRoC's form has both triads in each row, and one is missing here: write .csv or .parquet."
        )
    place = target / PLACE
    for name in ("data.csv", "sensor.yaml"):
        check_target(place / name)
    try:
        with filled_folder(place) as folder:
            with (folder / "data.csv").open("w", encoding="utf-8", newline="\n") as file:
                file.write(_HEADER)
                for block in chain([first], consecutive):
                    _write_rows(file, block, exact)
                file.flush()
                os.fsync(file.fileno())
            put_text(folder / "sensor.yaml", _sensor(source, first.rate, marks))
    except OSError as error:
        raise OutputError(f"{place} could not be written: {error.strerror or error}.") from error


def _write_rows(file: object, block: Recording, exact: npt.NDArray[np.int64] | None) -> None:
    import polars as pl

    assert block.specific_force is not None
    assert block.angular_rate is not None
    columns: dict[str, np.ndarray] = {"t": _nanoseconds(block.time, exact)}
    columns |= {f"w{i}": block.angular_rate[:, i] for i in range(3)}
    columns |= {f"a{i}": block.specific_force[:, i] for i in range(3)}
    pl.DataFrame(columns).write_csv(file, include_header=False)  # pyright: ignore[reportArgumentType, reportCallIssue]


def _exact_stamps(data: Path) -> npt.NDArray[np.int64] | None:
    """Return the stamps of a file in ns, which seconds as a float do not hold; None where they are no whole numbers."""
    import polars as pl

    try:
        texts = pl.scan_csv(data, infer_schema=False, truncate_ragged_lines=True).select(pl.first())
        stamps = texts.cast(pl.Int64, strict=False).collect().to_series().drop_nulls().to_numpy()
    except (pl.exceptions.PolarsError, OSError):
        return None
    return np.sort(stamps.astype(np.int64)) if stamps.size else None


def _nanoseconds(time: Series, exact: npt.NDArray[np.int64] | None) -> npt.NDArray[np.int64]:
    """Return stamps in ns: those of the source where they are the same instants."""
    made = np.round(time * 1e9).astype(np.int64)
    if exact is None:
        return made
    after = (
        np.clip(np.searchsorted(exact, made), 1, exact.size - 1) if exact.size > 1 else np.zeros_like(made)
    )
    nearest = np.where(
        np.abs(exact[after] - made) < np.abs(exact[after - 1] - made), exact[after], exact[after - 1]
    )
    return np.where(np.abs(nearest - made) < 1e9 * _NEAR, nearest, made)


def _sensor(source: Path | None, rate: float, marks: Sequence[str]) -> str:
    """Return `sensor.yaml`: that of the source with what changes, or a new one."""
    given = None if source is None else source.with_name("sensor.yaml")
    if given is not None and given.is_file():
        lines = given.read_text("utf-8", errors="replace").splitlines()
    else:
        lines = [*_SENSOR.splitlines(), f"rate_hz: {rate:.6g}"]
    replaced = {_MARK: f"[{', '.join(marks)}]"} if marks else {}
    kept = [line for line in lines if line.partition(":")[0].strip() not in replaced]
    return "\n".join([*kept, *(f"{key}: {value}" for key, value in replaced.items())]) + "\n"


def corrections(path: Path) -> tuple[str, ...]:
    """Return the identities of the calibrations that an EuRoC folder was corrected by.

    Parameters
    ----------
    path : of the folder, or of its data.csv.
    """
    data = euroc_file(path) if path.is_dir() else path
    if data is None or data.name != "data.csv":
        return ()
    try:
        said = _SAID.search(data.with_name("sensor.yaml").read_text("utf-8", errors="replace"))
    except OSError:
        return ()
    return tuple(said.group(1).replace(",", " ").split()) if said else ()
