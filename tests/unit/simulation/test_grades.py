"""Grades: the numbers are those of their sources, and a unit drawn from one has their spread."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.simulation import GRADES, find_grade
from tumble.units import STANDARD_GRAVITY

HOUR, DEGREE = 3600.0, np.pi / 180.0
HG = ("hg1700", "hg1900")


def units_of(name: str, count: int, seed: int, **options: bool) -> list:
    rng = np.random.default_rng(seed)
    return [find_grade(name).simulate_model(rng, **options) for _ in range(count)]


def test_the_names_that_stand_in_scripts_still_do() -> None:
    assert list(GRADES) == ["consumer-mems", "industrial-mems", "hg1900", "hg1700", "tactical", "ring-laser"]


@pytest.mark.parametrize(("name", "force", "rate"), [
    ("hg1700", 3.6667e-3, 3.6361e-5),
    ("hg1900", 3.6667e-3, 2.6180e-5),
])  # fmt: skip
def test_the_random_walks_are_the_thesis_standard_deviations(name: str, force: float, rate: float) -> None:
    """Hayal 2010: table 3.1 (for samples of 1 s) follows from table 2.1's maxima of ARW and VRW."""
    grade = find_grade(name)
    # the table's digits
    assert grade.accelerometer.noise.random_walk == pytest.approx(force, rel=2e-5)
    assert grade.gyroscope.noise.random_walk == pytest.approx(rate, rel=2e-5)
    # 0.22 (m/s)/√h is the spread of a velocity after an hour, 0.125 or 0.09 deg/√h that of an angle
    assert grade.accelerometer.noise.random_walk * np.sqrt(HOUR) == pytest.approx(0.22, rel=1e-12)
    after_an_hour = grade.gyroscope.noise.random_walk * np.sqrt(HOUR) / DEGREE
    assert after_an_hour == pytest.approx({"hg1700": 0.125, "hg1900": 0.09}[name], rel=1e-12)


def test_the_sheet_s_other_numbers_of_the_hg_units() -> None:
    """Table 2.1 row by row: deg/h, ppm, mg, µrad, deg/s, g."""
    for name, repeatability, in_run, alignment, pair, reach in (
        ("hg1700", 1.0, 1.0, 500.0, 100.0, 1074.0),
        ("hg1900", 17.0, 7.0, 80.0, 50.0, 1000.0),
    ):
        gyro, force = find_grade(name).gyroscope, find_grade(name).accelerometer
        per_hour = HOUR / DEGREE
        assert gyro.bias * per_hour == pytest.approx(repeatability)
        assert gyro.bias_stability * per_hour == pytest.approx(in_run)
        assert 1e6 * gyro.scale_factor == pytest.approx(150.0)
        assert 1e6 * gyro.linearity == pytest.approx(150.0)
        assert 1e6 * gyro.alignment == pytest.approx(alignment)
        # the sheet's non-orthogonality is of a pair of axes, each of which turns towards the other
        assert 1e6 * gyro.misalignment * np.sqrt(2.0) == pytest.approx(pair)
        assert gyro.noise.full_scale / DEGREE == pytest.approx(reach)
        assert 1e3 * force.bias / STANDARD_GRAVITY == pytest.approx(1.0)
        assert 1e3 * force.bias_stability / STANDARD_GRAVITY == pytest.approx(1.0)
        assert 1e6 * force.scale_factor == pytest.approx(300.0)
        assert 1e6 * force.linearity == pytest.approx(500.0)
        assert 1e6 * force.misalignment * np.sqrt(2.0) == pytest.approx(100.0)
        assert force.noise.full_scale / STANDARD_GRAVITY == pytest.approx(70.0)
    g_sensitivity = find_grade("hg1900").g_sensitivity * STANDARD_GRAVITY * HOUR / DEGREE
    assert g_sensitivity == pytest.approx(3.0)
    assert find_grade("hg1700").g_sensitivity == 0.0


def test_units_of_a_grade_spread_as_the_sheet_says() -> None:
    """Biases, the angle between two axes, and the turn of a whole triad: the mean of m_ij - m_ji over two."""
    gyros = [model.gyroscope for model in units_of("hg1700", 700, 42)]
    matrices = np.array([gyro.matrix for gyro in gyros])
    rows = matrices / np.linalg.norm(matrices, axis=2, keepdims=True)
    pairs = ((0, 1), (1, 2), (2, 0))
    angles = [np.arccos(np.sum(rows[:, i] * rows[:, j], axis=1)) for i, j in pairs]
    turns = [(matrices[:, i, j] - matrices[:, j, i]) / 2.0 for i, j in pairs]
    # 2100 numbers: 1.5 %, four and a half of them
    assert np.std([gyro.bias for gyro in gyros]) == pytest.approx(np.radians(1.0 / HOUR), rel=0.07)
    assert np.std(angles) == pytest.approx(100e-6, rel=0.07)
    assert np.std(turns) == pytest.approx(np.hypot(500e-6, 50e-6), rel=0.07)


@pytest.mark.parametrize("name", HG)
def test_linearity_becomes_a_quadratic_term_of_that_deviation_from_the_best_line(name: str) -> None:
    grade = find_grade(name).accelerometer
    u = np.linspace(-grade.noise.full_scale, grade.noise.full_scale, 20_001)
    bent = grade.quadratic * u**2
    deviation = bent - np.polyval(np.polyfit(u, bent, 1), u)
    # truncation of the mean over 20,001 points
    assert np.sqrt(np.mean(deviation**2)) / grade.noise.full_scale == pytest.approx(500e-6, rel=1e-3)


def test_terms_beyond_the_thesis_are_drawn_on_request_alone_and_change_nothing_else() -> None:
    plain, bent = units_of("hg1900", 1, 44)[0], units_of("hg1900", 1, 44, nonlinear=True)[0]
    assert plain.accelerometer.quadratic is None
    assert np.all(bent.accelerometer.quadratic != 0.0)
    assert np.all(bent.gyroscope.quadratic != 0.0)
    np.testing.assert_array_equal(bent.accelerometer.matrix, plain.accelerometer.matrix)
    np.testing.assert_array_equal(bent.gyroscope.bias, plain.gyroscope.bias)
    # a sheet without linearity has none to draw
    assert units_of("ring-laser", 1, 44, nonlinear=True)[0].gyroscope.quadratic is None


@pytest.mark.parametrize("name", HG)
def test_the_instrument_s_axes_are_those_of_the_thesis(name: str) -> None:
    """2.1.5: x up through the top, y to the connector (the case's front), z makes it right-handed: to the left."""
    C = find_grade(name).C_instrument_case
    assert C is not None
    up, forward, left = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
    np.testing.assert_array_equal(C @ up, [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(C @ forward, [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(C @ left, [0.0, 0.0, 1.0])
    assert np.linalg.det(C) == pytest.approx(1.0)


def test_with_the_case_s_axes_a_unit_on_its_base_feels_one_g_on_its_x_axis() -> None:
    own, case = (units_of("hg1700", 1, 45, case_axes=axes)[0] for axes in (False, True))
    at_rest_on_its_base = np.array([[0.0, 0.0, -9.8]])  # forward, right, down: the specific force points up
    turning_right = np.array([[0.0, 0.0, 0.3]])
    raw_force, raw_rate = case.distort(at_rest_on_its_base, turning_right)
    same_force, same_rate = own.distort(np.array([[9.8, 0.0, 0.0]]), np.array([[-0.3, 0.0, 0.0]]))
    np.testing.assert_allclose(raw_force, same_force, rtol=1e-14)
    np.testing.assert_allclose(raw_rate, same_rate, rtol=1e-14)
    # 1 mg, 300 ppm
    assert raw_force[0, 0] == pytest.approx(9.8, abs=0.06)


def test_in_counts_noise_limit_and_step_are_in_counts() -> None:
    """A count of an HG unit is 2⁻³³ rad in 10 ms, or 2⁻²⁷ ft/s: 0.3048 m."""
    grade = find_grade("hg1700")
    counted = grade.in_counts()
    per_rate = 2.0**33 / 100.0
    per_force = 2.0**27 / 0.3048 / 100.0
    assert counted.gyroscope.noise.random_walk == pytest.approx(per_rate * 3.6361e-5, rel=2e-5)
    assert counted.accelerometer.noise.full_scale == pytest.approx(per_force * 70.0 * STANDARD_GRAVITY)
    assert counted.gyroscope.noise.resolution == 1.0
    mems = find_grade("consumer-mems")
    assert mems.accelerometer.noise.resolution * mems.counts_per_si[0] == pytest.approx(1.0)
    assert mems.gyroscope.noise.resolution * mems.counts_per_si[1] == pytest.approx(1.0)


def test_wandering_biases_are_asked_for() -> None:
    grade = find_grade("hg1900")
    assert not grade.gyroscope.noise.wanders
    wandering = grade.with_wandering_biases(duration=400.0)
    noise = wandering.gyroscope.noise
    # 7 deg/h after 400 s
    assert noise.rate_random_walk * np.sqrt(400.0) == pytest.approx(7.0 * DEGREE / HOUR)
    # a sheet without in-run stability leaves the grade as it was
    assert find_grade("ring-laser").with_wandering_biases() == find_grade("ring-laser")


@pytest.mark.parametrize(
    ("asked", "nearest"), [("hg1701", "hg1700"), ("HG1900", "hg1900"), ("tacticl", "tactical")]
)
def test_a_slip_in_a_grade_s_name_is_answered_with_the_nearest(asked: str, nearest: str) -> None:
    with pytest.raises(UsageError, match=f"; choose one of {', '.join(GRADES)}. Did you mean {nearest}"):
        find_grade(asked)


def test_every_grade_says_its_source_and_what_is_assumed() -> None:
    for grade in GRADES.values():
        assert len(grade.source) > 20
        assert grade.assumed
        # 100 Hz and whole counts: what a simulated recording needs
        assert grade.rate == 100.0
        assert min(grade.counts_per_si) > 1.0
