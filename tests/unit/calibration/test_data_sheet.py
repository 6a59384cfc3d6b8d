"""A data sheet as prior: few poses suffice, what the sheet alone says is said, a contradiction is objected to."""

import numpy as np
import pytest
from tests.unit.adjusted import adjusted

from tumble.attitude import twenty_six_directions
from tumble.calibration import Estimate
from tumble.calibration.prior import (
    FleetSheet,
    StableKnowledge,
    TriadFleet,
    about_sheet,
    find_contradiction,
    triad_sheets,
)
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline
from tumble.sensor import matrix_from_shin
from tumble.simulation import find_grade

SITE = Site.from_gravity(9.8, 1e-5)
HG1700 = find_grade("hg1700")
# A unit of the sheet: bias 10 mm/s², scale factors of 300 ppm, misalignments of 100 µrad, one sigma.
BIAS = np.array([0.011, -0.006, 0.009])
SCALE_ERROR = 1e-6 * np.array([250.0, -410.0, 130.0])
ANGLES = 1e-6 * np.array([120.0, -90.0, 60.0])
NOISE, REST = 1e-4, 60  # m/s² of a hold's mean; samples


def tumbled_in(up: np.ndarray, *, scale_error: np.ndarray = SCALE_ERROR, unit: str = "m/s^2") -> Recording:
    """Rests of 60 samples, one a second."""
    rng = np.random.default_rng(8)
    matrix = np.real(matrix_from_shin(1.0 + scale_error, ANGLES))
    force = np.repeat(9.8 * up @ matrix.T + BIAS, REST, axis=0)
    force += NOISE * np.sqrt(REST) * rng.standard_normal(force.shape)
    return Recording(np.arange(len(force), dtype=float), force, None, unit, "rad/s", 1.0)


def calibrate(recording: Recording, *, sheet: bool = True, prior: StableKnowledge | None = None) -> Estimate:
    holds = tuple(Hold(k, k + REST) for k in range(0, len(recording.time), REST))
    floor = NoiseFloor(np.full(3, NOISE * np.sqrt(REST)), np.ones(3), 1.0, "as simulated")
    timeline = Timeline(holds, (), (), floor)
    sheets = {"data_sheet": HG1700} if sheet else {}
    return adjusted(recording, timeline, SITE, procedure="multi-position", prior=prior, **sheets)


def errors_of(estimate: Estimate) -> np.ndarray:
    """Errors of the six entries of the matrix, row by row, and of the bias."""
    model = estimate.model.accelerometer
    matrix = np.real(matrix_from_shin(1.0 + SCALE_ERROR, ANGLES))
    return np.concatenate([(model.matrix - matrix)[np.tril_indices(3)], model.bias - BIAS])


FACES = twenty_six_directions()[:6]


def test_six_faces_alone_are_too_few_and_suffice_with_a_sheet() -> None:
    assert calibrate(tumbled_in(FACES), sheet=False).objections
    estimate = calibrate(tumbled_in(FACES))
    # bias and scale: NOISE over the root of two, five sigma of it; angles: the sheet's 141 µrad, five sigma
    errors = errors_of(estimate)
    assert np.all(np.abs(errors[6:]) < 5.0 * NOISE / np.sqrt(2.0))
    assert np.all(np.abs(errors[[0, 2, 5]]) < 5.0 * NOISE / 9.8 / np.sqrt(2.0) + 1e-7)
    assert np.all(np.abs(errors[[1, 3, 4]]) < 5.0 * np.sqrt(2.0) * 100e-6)
    # Faces show biases and scale factors; the angles keep the sheet's zero and the sheet's sigma.
    (told,) = [r for r in estimate.remarks if "next to nothing" in r]
    assert "non-orthogonality yz, non-orthogonality zx, non-orthogonality zy" in told
    assert "bias" not in told
    assert estimate.objections == ()
    with pytest.raises(UsageError, match="--units"):
        calibrate(tumbled_in(FACES, unit="counts"))


def test_with_26_poses_the_sheet_says_nothing_and_nothing_is_said() -> None:
    up = twenty_six_directions()
    with_sheet, alone = calibrate(tumbled_in(up)), calibrate(tumbled_in(up), sheet=False)
    assert not [r for r in with_sheet.remarks if "data sheet" in r]
    assert with_sheet.objections == ()
    # a prior of 300 ppm and 141 µrad beside sigmas of 5 to 10 ppm: it moves nothing by more than 1 %
    moved = errors_of(with_sheet) - errors_of(alone)
    assert np.all(np.abs(moved[:6]) < 0.01 * 300e-6)
    assert np.all(np.abs(moved[6:]) < 0.01 * 0.01)


def test_a_unit_that_is_none_of_the_sheet_s_is_objected_to() -> None:
    """A scale factor of 0.5 % is 17 of the sheet's 300 ppm."""
    scale_error = np.array([SCALE_ERROR[0], 5e-3, SCALE_ERROR[2]])
    estimate = calibrate(tumbled_in(twenty_six_directions(), scale_error=scale_error))
    (said,) = estimate.objections
    assert "the kind hg1700: the accelerometer's scale factor y is 17 of its standard deviations" in said


def test_a_parameter_that_nothing_is_told_of_cannot_contradict() -> None:
    sheet = triad_sheets(HG1700, tumbled_in(FACES))[1]
    before = np.sqrt(np.diag(np.linalg.inv(sheet.nine.precision)))
    values = sheet.nine.mean + np.where(np.arange(9) == 7, 6.0, 0.0) * before
    (remark,), objections = about_sheet(sheet, values, np.where(np.arange(9) == 7, 0.95, 0.1) * before)
    assert objections == []
    assert "non-orthogonality zx" in remark
    remarks, (said,) = about_sheet(sheet, values, 0.1 * before)
    assert remarks == []
    assert "gyro's non-orthogonality zx" in said
    # what was made without the sheet is off by both variances
    assert about_sheet(sheet, values, before, alone=True) == ([], [])


def test_the_prior_is_in_raw_units() -> None:
    """In g the scale factor is a share of 1 / 9.80665, and so is everything that is an output."""
    sheet, raw = HG1700.accelerometer, 1.0 / 9.80665
    prior = triad_sheets(HG1700, tumbled_in(FACES, unit="g"))[0].nine
    np.testing.assert_allclose(prior.mean, [0, 0, 0, raw, raw, raw, 0, 0, 0])
    sigma = 1.0 / np.sqrt(np.diag(prior.precision))
    expected = np.repeat([raw * sheet.bias, raw * sheet.scale_factor, np.sqrt(2.0) * sheet.misalignment], 3)
    np.testing.assert_allclose(sigma, expected, rtol=1e-14)


FLEET_MATRIX = np.array([[1.002, 0.0, 0.0], [3e-4, 0.997, 0.0], [-5e-4, 2e-4, 1.001]])
FLEET_BIAS = np.array([0.02, -0.05, 0.01])


def fleet_of(unit: str, factor: float, gyroscope: bool = False) -> FleetSheet:
    """A fleet with raw numbers of `factor` SI each, whose twelve numbers are correlated."""
    root = np.tril(np.random.default_rng(4).normal(0.0, 1e-4, (12, 12))) + 1e-3 * np.eye(12)
    root[[1, 2, 5]] = 0.0
    fleet = TriadFleet.of(unit, FLEET_MATRIX / factor, FLEET_BIAS / factor, root @ root.T / factor**2)
    return FleetSheet(fleet, fleet if gyroscope else None)


def test_a_fleet_s_prior_is_its_mean_and_its_spread() -> None:
    """Against differences by hand; in another unit of the same kind it is the same knowledge."""
    prior = fleet_of("m/s^2", 1.0).prior("accelerometer", "m/s^2")
    # scale factors are the rows' lengths, angles those between the axes, to first order their off-diagonals
    np.testing.assert_allclose(prior.mean[:3], FLEET_BIAS)
    np.testing.assert_allclose(prior.mean[3:6], np.linalg.norm(FLEET_MATRIX, axis=1), rtol=1e-9)
    np.testing.assert_allclose(prior.mean[6:], [-3e-4, -2e-4, -5e-4], rtol=0.01)
    spread = np.linalg.inv(prior.precision)
    assert np.max(np.abs(spread - np.diag(np.diag(spread)))) > 1e-7
    in_g = fleet_of("m/s^2", 1.0).prior("accelerometer", "g")
    raw = np.repeat([1.0 / 9.80665, 1.0], [6, 3])
    np.testing.assert_allclose(in_g.mean, raw * prior.mean)
    np.testing.assert_allclose(
        np.linalg.inv(in_g.precision), spread * np.outer(raw, raw), rtol=1e-6, atol=1e-18
    )


def test_a_fleet_in_counts_serves_counts_and_no_other_unit() -> None:
    fleet = fleet_of("counts", 0.5)
    prior = fleet.prior("accelerometer", "counts")
    np.testing.assert_allclose(prior.mean[3:6], 2.0 * np.linalg.norm(FLEET_MATRIX, axis=1))
    with pytest.raises(UsageError, match="in its own raw units"):
        fleet.prior("accelerometer", "g")
    assert fleet.prior("gyroscope", "counts") is None


@pytest.mark.parametrize("sheet", [True, False])
def test_six_faces_suffice_with_angles_of_an_earlier_calibration_beside_a_sheet_or_alone(sheet: bool) -> None:
    """Hayal, chapter 6: angles stay where biases and scale factors do not."""
    covariance = 1e-12 * np.array([[25.0, 3.0, -2.0], [3.0, 16.0, 1.0], [-2.0, 1.0, 9.0]])
    estimate = calibrate(tumbled_in(FACES), sheet=sheet, prior=StableKnowledge(ANGLES, covariance))
    errors = errors_of(estimate)
    assert np.all(np.abs(errors[6:]) < 5.0 * NOISE / np.sqrt(2.0))
    # angles known to 3 to 5 µrad: five sigma, on scale factors of one
    assert np.all(np.abs(errors[[1, 3, 4]]) < 25e-6)
    assert estimate.objections == ()


def test_a_prior_three_sigma_off_passes_and_one_ten_sigma_off_is_contradicted() -> None:
    # Chi-square of 3 degrees exceeds 16.3 in one case of a thousand: 9 is below, 100 above.
    sigma = 1e-4
    own = StableKnowledge(np.array([1e-3, -2e-3, 3e-3]), 0.5 * sigma**2 * np.eye(3))
    near = StableKnowledge(own.angles + np.array([3.0 * sigma, 0.0, 0.0]), own.angle_covariance)
    far = StableKnowledge(own.angles + np.array([0.0, 0.0, 10.0 * sigma]), own.angle_covariance)
    assert find_contradiction(near, [own]) is None
    assert "10 standard uncertainties" in (find_contradiction(far, [own]) or "")
