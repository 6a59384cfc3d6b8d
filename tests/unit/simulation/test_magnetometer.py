"""A simulated magnetometer: the formula by hand, the same files from the same seed, and the truth recovered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tumble
from tumble.calibration.magnetometer.estimate import Magnetometer
from tumble.errors import UsageError
from tumble.protocol import named_protocol
from tumble.sensor import Triad
from tumble.simulation import play_protocol
from tumble.simulation.errors import SessionErrors
from tumble.simulation.magnetometer import SimulatedMagnetometer, find_magnetometer
from tumble.workflows.calibrate import calibrate
from tumble.workflows.simulate import simulate

M = 1e6 * np.array([[1.07, 0.031, -0.052], [-0.083, 0.94, 0.047], [0.021, -0.066, 1.12]])
H = np.array([12.5, -31.0, 47.25])
SITE = tumble.Site.from_latitude(np.radians(48.0))


def test_raw_numbers_are_those_of_the_formula() -> None:
    motion = play_protocol(named_protocol("multi-position-9"), np.random.default_rng(3)).motion
    dip, east = np.radians(65.0), np.radians(4.0)
    current = np.array([1e-6, -2e-6, 0.5e-6])
    compass = SimulatedMagnetometer(
        find_magnetometer("lis3mdl"), Triad(M, H), 49e-6, dip, east, False, current, 30.0
    )
    seen = compass.record(motion, np.random.default_rng(1))
    assert seen.unit == "uT"
    for at in (10, seen.time.size // 2, seen.time.size - 1):
        C_nb = motion.rotation_nb(seen.time[[at]]).as_matrix()[0]
        field_n = 49e-6 * np.array([np.cos(dip) * np.cos(east), np.cos(dip) * np.sin(east), np.sin(dip)]) + (
            current if seen.time[at] >= 30.0 else 0.0
        )
        np.testing.assert_allclose(seen.values[at], M @ C_nb.T @ field_n + H, rtol=1e-12)


def test_the_magnetometer_changes_nothing_of_the_other_triads(tmp_path: Path) -> None:
    for name, grade in (("a", None), ("b", "rm3100"), ("c", "rm3100")):
        simulate("multi-position-9", output=tmp_path / name, seed=4, magnetometer=grade, site=SITE)
    six, nine = (tumble.read_recording(tmp_path / name / "recording.csv") for name in "ab")
    assert six.specific_force is not None
    assert nine.specific_force is not None
    np.testing.assert_array_equal(six.specific_force, nine.specific_force)
    assert six.magnetic_field is None
    assert nine.magnetic_field is not None
    assert nine.magnetic_field.rate == pytest.approx(75.0)
    one, same = ((tmp_path / name / "recording.csv").read_bytes() for name in "bc")
    assert one == same


def test_a_calibration_recovers_the_truth_and_finds_the_change(tmp_path: Path) -> None:
    done = simulate(
        "hand-held",
        output=tmp_path / "s",
        seed=2,
        magnetometer="lis3mdl",
        errors=SessionErrors(field_change=(1.5e-6, 80.0)),
        site=SITE,
    )
    run = calibrate(tmp_path / "s" / "recording.csv", field="49±0.01uT,65", site=SITE)
    found, told = run.estimate.shown(Magnetometer), done.truth["magnetometer"]
    assert found is not None
    assert found.triad is not None
    true = told["in_frame_accelerometer_x"]
    error = np.concatenate(
        [(found.triad.matrix - true["matrix"]).ravel(), found.triad.bias - np.array(true["bias"])]
    )
    assert float(error @ np.linalg.solve(found.covariance, error)) < 40.0
    assert found.moving is not None
    assert found.moving.share == pytest.approx(1.5 / 49.0, rel=0.1)
    block = run.calibration.magnetometer
    assert block is not None
    assert block.verdict is not None
    assert block.verdict.use == "fit with reservations"


def test_what_is_no_magnetometer_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="lis3mdl, rm3100"):
        simulate("multi-position-9", output=tmp_path / "x", magnetometer="compass")
