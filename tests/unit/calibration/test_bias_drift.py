"""Drifts of the gyro's bias: found where they are, seldom where they are not, and counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tumble.calibration.checks.bias_drift import find_bias_drift
from tumble.document import Calibration, read_calibration
from tumble.workflows.calibrate import calibrate
from tumble.workflows.simulate import simulate

HOLDS = 24
TIME = np.linspace(5.0, 240.0, HOLDS)


def residuals(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    sigma = rng.uniform(1e-4, 2e-4, (HOLDS, 1)) * np.ones(3)
    return sigma * rng.standard_normal((HOLDS, 3)), sigma**2


@pytest.mark.parametrize("constant", [40.0, 90.0, 1e4])
def test_a_drift_is_found_with_its_size_also_where_the_specific_force_has_taken_a_part(
    constant: float,
) -> None:
    residual, variance = residuals(3)
    drift = np.exp(-TIME / constant)
    drift *= 2e-3 / (drift[0] - drift[-1])
    # the first poses are faces, the last ones edges: a g-sensitivity explains some of the drift
    force = np.asarray(9.8 * np.column_stack([TIME < 60.0, np.cos(TIME), np.sin(TIME)]), dtype=np.float64)
    residual[:, 1] += drift
    design = np.column_stack([np.ones(HOLDS), force])
    weight = 1.0 / np.sqrt(variance)
    for axis in range(3):
        w = weight[:, axis : axis + 1]
        residual[:, axis] -= design @ np.linalg.lstsq(w * design, w[:, 0] * residual[:, axis], rcond=None)[0]
    (found,) = find_bias_drift(TIME, residual, variance, force)
    assert found.axis == 1
    # what of it the force has taken is told within half of it
    true = drift[-1] - np.average(drift, weights=1.0 / variance[:, 1])
    assert -3e-3 < found.change < -1e-3
    assert 0.4 < found.left / true < 2.0


def test_without_a_drift_hardly_any_is_found_and_a_jump_is_none() -> None:
    found = sum(bool(find_bias_drift(TIME, *residuals(seed))) for seed in range(500))
    assert found <= 4  # 0.5 expected at a chance of 0.001
    residual, variance = residuals(5)
    residual[14:, 2] += 2e-3
    assert find_bias_drift(TIME, residual, variance) == []


@pytest.mark.parametrize("procedure", ["hand-held", "joint"])
def test_a_unit_that_warms_up_has_a_bias_that_is_as_uncertain_as_it_is_off(
    procedure: str, tmp_path: Path
) -> None:
    """0.15, -0.1 and 0.05 °/s at the start, with 90 s: the bias that it comes to was 18 sigmas off."""
    made = simulate("hand-held", output=tmp_path / "made", unit=1, seed=1)
    assert made is not None
    path = tmp_path / "made" / "recording.csv"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    header = path.read_text().splitlines()[0]
    warm = np.radians([0.15, -0.1, 0.05]) * np.exp(-(rows[:, :1] - rows[0, 0]) / 90.0)

    def calibrated(name: str, extra: np.ndarray | float) -> Calibration:
        file = tmp_path / f"{name}.csv"
        moved = rows.copy()
        moved[:, 4:7] += extra
        np.savetxt(file, moved, delimiter=",", header=header, comments="")
        calibrate(file, units="m/s^2,rad/s,s", procedure=procedure, output=tmp_path / name)
        return read_calibration(tmp_path / name)

    cold, warmed = calibrated("cold", 0.0), calibrated("warm", warm)
    assert not any("drifts" in reason for reason in cold.verdict.reasons)
    truth = {p.name: p.value for p in cold.parameters}
    for parameter in warmed.parameters:
        if parameter.name.startswith("gyro bias"):
            off = abs(parameter.value - truth[parameter.name]) / parameter.standard_uncertainty
            assert off < 3.0, parameter.name
            told = [r for r in warmed.verdict.reasons if parameter.name[-1] in r and "drifts by" in r]
            assert told, parameter.name
