"""What verify takes for a contradiction: residuals beyond chance and beyond the expanded uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tumble.document import Calibration, read_calibration
from tumble.earth import Site
from tumble.workflows.calibrate import calibrate
from tumble.workflows.simulate import simulate
from tumble.workflows.verify import Verification, norm_covariance, verify

UNITS = "m/s^2,rad/s,s"


Unit = tuple[Calibration, Path]


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Unit:
    """A unit calibrated by hand, and another recording of it."""
    folder = tmp_path_factory.mktemp("verify")
    for seed in (1, 2):
        simulate("hand-held", output=folder / f"{seed}", unit=3, seed=seed, rate=50.0)
    calibrate(folder / "1" / "recording.csv", units=UNITS, output=folder / "calibrated")
    return read_calibration(folder / "calibrated"), folder / "2" / "recording.csv"


def shifted(unit: Unit, bias: float, folder: Path) -> Verification:
    calibration, other = unit
    rows = np.loadtxt(other, delimiter=",", skiprows=1)
    rows[:, 1:4] += bias
    path = folder / "shifted.csv"
    np.savetxt(path, rows, delimiter=",", header=other.read_text().splitlines()[0], comments="")
    (result,) = verify(calibration, path, units=UNITS)
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


def test_the_expected_norm_counts_quadratic_terms(unit: Unit) -> None:
    """q u² more of an axis's raw output puts the norm off by as much along it."""
    names, force, place = ["accelerometer.quadratic[0]"], np.array([[9.8, 0.0, 0.0]]), Site.from_gravity(9.79)
    known = structs.replace(unit[0], covariance_parameters=names, covariance=[[1e-8]])
    without = structs.replace(known, covariance=[[0.0]])
    found = [float(norm_covariance(one, force, np.zeros(1), place, None)[0, 0]) for one in (known, without)]
    assert np.sqrt(found[0] - found[1]) == pytest.approx(1e-4 * 9.8**2, rel=0.05)
