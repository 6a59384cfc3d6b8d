"""What verify takes for a contradiction: residuals beyond chance and beyond the expanded uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tumble.document import Calibration, read_calibration
from tumble.workflows.calibrate import calibrate
from tumble.workflows.simulate import simulate
from tumble.workflows.verify import Verification, verify

UNITS = "m/s^2,rad/s,s"


@dataclass(frozen=True)
class Unit:
    calibration: Calibration
    other: Path


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Unit:
    """A unit calibrated by hand, and another recording of it."""
    folder = tmp_path_factory.mktemp("verify")
    for seed in (1, 2):
        simulate("hand-held", output=folder / f"{seed}", unit=3, seed=seed, rate=50.0)
    calibrate(folder / "1" / "recording.csv", units=UNITS, output=folder / "calibrated")
    return Unit(read_calibration(folder / "calibrated"), folder / "2" / "recording.csv")


def shifted(unit: Unit, bias: float, folder: Path) -> Verification:
    rows = np.loadtxt(unit.other, delimiter=",", skiprows=1)
    rows[:, 1:4] += bias
    header = unit.other.read_text().splitlines()[0]
    path = folder / "shifted.csv"
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    (result,) = verify(unit.calibration, path, units=UNITS)
    return result


def test_residuals_three_times_what_is_explained_do_not_serve(unit: Unit, tmp_path: Path) -> None:
    straight = shifted(unit, 0.0, tmp_path)
    assert straight.fit
    assert 1.0 <= straight.norm_freedom <= straight.hold_norm_error.size
    rms = float(np.sqrt(np.mean(straight.hold_norm_standard_uncertainty**2)))
    # a bias of b on each axis moves norms by up to b √3, and by b rms over the directions
    result = shifted(unit, 3.0 * rms, tmp_path)
    excess = float(np.sqrt(np.mean((result.hold_norm_error / result.hold_norm_standard_uncertainty) ** 2)))
    assert 2.0 < excess < 4.0
    assert not result.fit
    assert f"{excess:.1f} times what the calibration's own uncertainty" in result.reasons[0]
