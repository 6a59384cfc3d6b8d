"""Real recordings with magnetometers: what a calibration on one part is worth on parts that it has not seen.

``python benchmarks/magnetometer_recordings.py FOLDER``, where FOLDER has clones of dlaidig/broad (CC BY 4.0),
sunsided/sensor-fusion (EUPL 1.2), agnieszkaszczesna/RepoIMU and mgiurato/IMU-Calibration (both without a licence: read
here, and not shipped). What is not there is left out.

Norm: standard deviation of the field's norm over its mean. Heading: of the field's direction in the level plane, which
cameras carry (BROAD, RepoIMU), or accelerometers and gyros alone (IMU-Calibration); degrees, about the mean of each
recording. Dip: of the angle to gravity while the unit is not pushed. What is judged was not calibrated on.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tumble.attitude.quaternions import matrices_from_quaternions
from tumble.calibration.magnetometer.estimate import magnetometer_alone, magnetometer_from_holds
from tumble.calibration.magnetometer.field_equations import FieldAdjustment, hold_shares
from tumble.calibration.magnetometer.field_means import field_means
from tumble.calibration.magnetometer.verdict import judge_magnetometer
from tumble.calibration.procedures.joint import run_joint
from tumble.calibration.session import Session
from tumble.errors import TumbleError
from tumble.recording import Recording
from tumble.recording.magnetic_field import MagneticField
from tumble.sensor import Triad

AS_IT_IS = Triad(np.eye(3), np.zeros(3))


def spread(values: np.ndarray) -> float:
    """Standard deviation over the mean, percent."""
    return float(100.0 * np.std(values) / np.mean(values))


def turning(angles: np.ndarray) -> float:
    """Standard deviation of angles about their mean direction, degrees."""
    middle = np.angle(np.mean(np.exp(1j * angles)))
    return float(np.degrees(np.sqrt(np.mean(np.angle(np.exp(1j * (angles - middle))) ** 2))))


def ellipsoid_of(field: MagneticField, name: str) -> Triad | None:
    """Calibrate a magnetometer by itself, and say how it is judged."""
    made = magnetometer_alone(field)
    print(
        f"{name}: {judge_magnetometer(made).use}, {100 * made.before:.2f} % → {100 * made.after:.2f} % of the norm"
    )
    return made.triad


def with_reference(name: str, values: np.ndarray, quaternions: np.ndarray, triad: Triad) -> None:
    """Print norm and heading of one recording before and after."""
    ok = np.all(np.isfinite(values), axis=1) & np.all(np.isfinite(quaternions), axis=1)
    # Both write w first.
    C = matrices_from_quaternions(quaternions[ok][:, [1, 2, 3, 0]])
    said: list[str] = []
    for one in (AS_IT_IS, triad):
        field = one.correct(values[ok])
        level = np.einsum("kij,kj->ki", C, field)
        heading = turning(np.arctan2(level[:, 1], level[:, 0]))
        said.append(f"norm {spread(np.linalg.norm(field, axis=1)):.2f} %, heading {heading:.2f}°")
    print(f"  {name}: " + " → ".join(said))


def broad(folder: Path) -> None:
    """Print what calibrating one trial of BROAD is worth on others."""
    import h5py

    def read(path: Path) -> tuple[Any, Any, float]:
        with h5py.File(path) as file:
            return file["imu_mag"][:], file["opt_quat"][:], float(file.attrs["sampling_rate"])

    trials = [path for path in sorted(folder.glob("data_hdf5/*_undisturbed_*.hdf5")) if path.stat().st_size]
    values, _, rate = read(trials[0])
    ok = np.all(np.isfinite(values), axis=1)
    triad = ellipsoid_of(
        MagneticField(np.flatnonzero(ok) / rate, values[ok], "uT"), f"BROAD {trials[0].stem}"
    )
    for path in trials[1:] if triad is not None else []:
        with_reference(path.stem, *read(path)[:2], triad)


def repo_imu(folder: Path) -> None:
    """Print what calibrating one recording of RepoIMU's stick is worth on others."""

    def read(path: Path) -> np.ndarray:
        made = np.genfromtxt(path, delimiter=";", skip_header=2)[:, :14]
        return made[np.all(np.isfinite(made), axis=1)]

    first = read(folder / "TStick/TStick_Test11_Trial1.csv")
    triad = ellipsoid_of(
        MagneticField(first[:, 0], first[:, 11:14], "counts"), "RepoIMU TStick_Test11_Trial1"
    )
    for path in sorted(folder.glob("TStick/TStick_Test*_Trial1.csv")) if triad is not None else []:
        if "Test11" not in path.name:
            made = read(path)
            with_reference(path.stem, made[:, 11:14], made[:, 1:5], triad)


def sensor_fusion(folder: Path) -> None:
    """Print what calibrating the full sphere of sunsided/sensor-fusion is worth on its other recordings."""
    import h5py

    def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
        made: list[np.ndarray] = []
        for name in ("hmc5883l_compass", "mpu6050_accelerometer"):
            with h5py.File(path / f"{name}.mat") as file:
                made.append(np.array(next(v for k, v in file.items() if k.endswith("Buffer"))))
        return made[0], made[1]

    compass, _ = read(folder / "data/set-2/full-sphere")
    keep = np.r_[True, np.diff(compass[0]) > 0.0]
    triad = ellipsoid_of(
        MagneticField(compass[0][keep], compass[1:].T[keep], "counts"), "sensor-fusion full-sphere"
    )
    for path in sorted(folder.glob("data/set-2/[r]*")) if triad is not None else []:
        compass, force = read(path)
        carried = np.column_stack([np.interp(compass[0], force[0], row) for row in force[1:]])
        still = np.abs(np.linalg.norm(carried, axis=1) - 1.0) < 0.03
        said: list[str] = []
        for one in (AS_IT_IS, triad):
            field = one.correct(compass[1:].T)
            size = np.linalg.norm(field, axis=1)
            sine = np.sum(field * carried, axis=1) / size / np.linalg.norm(carried, axis=1)
            said.append(f"norm {spread(size):.2f} %, dip {turning(np.arcsin(sine[still])):.2f}°")
        print(f"  {path.name}: " + " → ".join(said))


def by_holds(folder: Path) -> None:
    """Print the joint estimate and the ellipsoid of one part of a recording by hand on the holds of the other."""
    raw = np.loadtxt(folder / "log_raw_newnew2.txt")
    time = np.arange(len(raw)) / 50.0
    whole = Recording(
        time=time,
        specific_force=raw[:, :3],
        angular_rate=raw[:, 3:6],
        specific_force_unit="counts",
        angular_rate_unit="counts",
        rate=50.0,
        magnetic_field=MagneticField(time, raw[:, 6:], "counts"),
    )
    session = Session(whole)
    run_joint(session)
    assert session.joint is not None
    seen = field_means(time, raw[:, 6:], session.joint.data.base)
    task = FieldAdjustment.of(session.joint.task, seen, 1.0)
    print("IMU-Calibration log_raw_newnew2.txt")
    for share, late in ((0.7, False), (0.6, False), (0.5, False), (0.5, True), (0.6, True), (0.7, True)):
        cut = int(share * len(raw)) if not late else int((1.0 - share) * len(raw))
        own = whole.between(cut, len(raw)) if late else whole.between(0, cut)
        assert own.magnetic_field is not None
        part = Session(own)
        name = f"{100 * share:.0f} % at the {'end' if late else 'start'}"
        try:
            run_joint(part)
            assert part.joint is not None
            joint = magnetometer_from_holds(part.joint, own.magnetic_field).triad
        except TumbleError as error:
            print(f"  {name}: {error}")
            continue
        alone = magnetometer_alone(own.magnetic_field).triad
        held = np.flatnonzero((seen.time < time[cut]) == late)
        words = [
            f"{which} {judged(task, one, held)}"
            for which, one in (("joint", joint), ("ellipsoid", alone))
            if one
        ]
        print(f"  {name}, {len(held)} holds held out: " + "; ".join(words))


def judged(task: FieldAdjustment, triad: Triad, held: np.ndarray) -> str:
    """Norm, dip and heading of held-out holds, with poses that know nothing of the magnetometer."""
    field = triad.correct(task.seen.mean)
    dips: list[np.ndarray] = []
    headings: list[np.ndarray] = []
    for section in task.sections:
        k = section.holds[np.isin(section.holds, held)]
        if k.size < 3:
            continue
        C = np.einsum("kp,kpij->kij", hold_shares(task, k), section.C_wb[k - section.first])
        made = np.einsum("kij,kj->ki", C, field[k])
        dips.append(np.arctan2(made[:, 2], np.hypot(made[:, 0], made[:, 1])))
        around = np.arctan2(made[:, 1], made[:, 0])
        headings.append(around - np.angle(np.mean(np.exp(1j * around))))
    return (
        f"norm {spread(np.linalg.norm(field[held], axis=1)):.2f} %, dip {turning(np.concatenate(dips)):.2f}°, "
        f"heading {turning(np.concatenate(headings)):.2f}°"
    )


SOURCES: dict[str, Callable[[Path], None]] = {
    "broad": broad,
    "RepoIMU": repo_imu,
    "sensor-fusion": sensor_fusion,
    "IMU-Calibration": by_holds,
}


def main() -> None:
    """Print what is there."""
    folder = Path(sys.argv[1])
    for name, show in SOURCES.items():
        if (folder / name).exists():
            try:
                show(folder / name)
            except TumbleError as error:
                print(f"{name}: {error}")


if __name__ == "__main__":
    main()
