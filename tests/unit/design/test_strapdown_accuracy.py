"""The error budget of the strapdown rotation test, against samples and against drawn tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tumble.attitude import matrix_from_rotation_vector, skew
from tumble.calibration.closed_forms.sequence_measurements import measure_sequence
from tumble.design.strapdown_accuracy import analyse_strapdown_rotation, simulate_test_errors
from tumble.design.strapdown_advice import advise, judge_fixture
from tumble.design.strapdown_effects import constant_effects, earth_by_attitude, earth_by_gyro, noise_effects
from tumble.design.strapdown_sequences import TimedSequence, timed_sequences
from tumble.design.strapdown_setup import FixtureQuality, SensorQuality, StrapdownSetup, Timing
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.protocol.strapdown_rotation import RotationSequence
from tumble.sensor.conventions.savage import PAIRS
from tumble.simulation import find_grade

DEGREE, MICRO = np.pi / 180.0, 1e-6
SITE = replace(Site.from_latitude(37.0 * DEGREE), gravity_sigma=0.0)
NAVIGATION = SensorQuality(
    gyro_walk=0.002 * DEGREE / 60.0,
    gyro_pulse=0.5 * DEGREE / 3600.0,
    gyro_bias=0.01 * DEGREE / 3600.0,
    force_walk=3e-5,
    gyro_scale=1e-3,
    gyro_asymmetry=1e-3,
    gyro_misalignment=1e-3,
    force_bias=9.8e-3,
    force_scale=1e-3,
    force_asymmetry=1e-3,
    force_misalignment=1e-3,
)
STEP = 0.02


def setup(**changes: object) -> StrapdownSetup:
    base = StrapdownSetup(
        NAVIGATION, site=SITE, azimuth=0.4, timing=Timing(6.0, rate=1.3, pause=0.6), iterations=1
    )
    return replace(base, **changes)  # type: ignore[arg-type]


def sequence(name: str, plan: StrapdownSetup) -> TimedSequence:
    return next(s for s in timed_sequences(plan) if s.row.name == name)


def samples(one: TimedSequence, plan: StrapdownSetup) -> tuple[np.ndarray, np.ndarray]:
    return cut(one.row, plan.timing)


@cache
def cut(row: RotationSequence, timing: Timing) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes in the frame of the start at the middles of the steps, and rates against the Earth."""

    def still(seconds: float) -> list[np.ndarray]:
        return [np.zeros(3)] * round(seconds / STEP)

    rates = still(timing.seconds + timing.pause)
    for axis, angle in row.rotations:
        count = round(abs(angle) / timing.rate / STEP)
        rates += [np.eye(3)[axis] * angle / (count * STEP)] * count + still(timing.pause)
    rates += still(timing.seconds)
    rate = np.array(rates)
    middle = np.empty((len(rate), 3, 3))
    C = np.eye(3)
    for k, turning in enumerate(rate):
        half = matrix_from_rotation_vector(0.5 * STEP * turning)
        middle[k] = C @ half
        C = middle[k] @ half
    return middle, rate


def measured(
    one: TimedSequence,
    plan: StrapdownSetup,
    error: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
) -> np.ndarray:
    """Measure with gyros that show `error(attitudes, rates against the Earth, true rates)` too much."""
    attitude, rate = samples(one, plan)
    back = np.swapaxes(attitude, 1, 2)
    true = rate + back @ one.earth_rate
    force = -plan.site.gravity * back @ one.model.down_start
    window, count = round(plan.timing.seconds / STEP), len(rate)

    def measure(shown: np.ndarray) -> np.ndarray:
        return measure_sequence(
            shown, force, STEP, one.earth_rate, (0, window), (count - window, count), plan.site.gravity,
            one.model.down_start, start_bias=plan.start_bias, averaging=plan.timing.averaging,
        ).vector  # fmt: skip

    return measure(true + error(attitude, rate, true)) - measure(true)


BOTH = pytest.mark.parametrize("start_bias", [False, True])


@BOTH
@pytest.mark.parametrize("name", ["2", "6", "7", "13"])
def test_an_attitude_error_at_the_start_acts_by_the_earth_rate_as_in_samples(
    name: str, start_bias: bool
) -> None:
    """One mrad about each axis: the second order is a thousandth; the steps round times to 0.01 s of 20."""
    plan = setup(start_bias=start_bias)
    one = sequence(name, plan)
    for alpha in 1e-3 * np.eye(3):
        moved = -skew(alpha) @ one.earth_rate
        got = measured(one, plan, lambda C, *_, moved=moved: np.swapaxes(C, 1, 2) @ moved)
        np.testing.assert_allclose(got, earth_by_attitude(one, plan) @ alpha, atol=3e-8)


@BOTH
@pytest.mark.parametrize("name", ["1", "5", "14"])
def test_gyro_errors_act_by_the_earth_rate_as_in_samples(name: str, start_bias: bool) -> None:
    """The whole effect less that without Earth rate, of errors of 1e-4; steps round times by a thousandth or two."""
    plan = setup(start_bias=start_bias)
    one = sequence(name, plan)
    at_rest = replace(one, earth_rate=np.zeros(3))
    for k in range(9):
        if 3 <= k < 6:
            continue  # an asymmetry depends on the sign of the whole rate, see below
        matrix = np.zeros((3, 3))
        if k < 3:
            matrix[k, k] = 1e-4
        else:
            i, j = PAIRS[k - 6]
            matrix[i, j] = matrix[j, i] = 0.5e-4

        def error(_: np.ndarray, __: np.ndarray, true: np.ndarray, matrix: np.ndarray = matrix) -> np.ndarray:
            return true @ matrix.T

        got = measured(one, plan, error) - measured(at_rest, plan, error)
        np.testing.assert_allclose(got, 1e-4 * earth_by_gyro(one, plan)[:, k], atol=5e-9)


@pytest.mark.parametrize("name", ["2a", "4"])
def test_g_sensitivity_acts_as_in_samples(name: str) -> None:
    plan = setup(sensors=replace(NAVIGATION, g_sensitivity=1e-6), method="formulas", iterations=0)
    one = sequence(name, plan)
    effect = next(e for e in constant_effects(plan, [one]) if e.source.name == "g-sensitivity")
    assert effect.columns is not None
    force_start = -plan.site.gravity * one.model.down_start
    for k in range(9):
        matrix = 1e-6 * np.eye(9)[k].reshape(3, 3)

        def error(C: np.ndarray, *_: np.ndarray, matrix: np.ndarray = matrix) -> np.ndarray:
            return (np.swapaxes(C, 1, 2) @ force_start) @ matrix.T

        # steps of 0.02 s round the times of the rotations by up to 0.01 s of 2.4
        np.testing.assert_allclose(measured(one, plan, error), effect.columns[0][:, k], atol=1.5e-6)


@BOTH
@pytest.mark.parametrize("averaging", ["plain", "average-of-averages"])
def test_the_covariance_of_gyro_noise_is_that_of_drawn_samples(start_bias: bool, averaging: str) -> None:
    """400 draws: the trace over two components is known to 5 %; three of them are allowed."""
    plan = setup(start_bias=start_bias, timing=Timing(6.0, rate=1.3, pause=0.6, averaging=averaging))
    one = sequence("13", plan)
    rng = np.random.default_rng(5)
    walk = 1e-5
    _, rate = samples(one, plan)
    size = walk / np.sqrt(STEP)

    def noise(*_: np.ndarray) -> np.ndarray:
        return size * rng.standard_normal((len(rate), 3))

    drawn = np.array([measured(one, plan, noise) for _ in range(400)])
    effects = noise_effects(replace(plan, sensors=SensorQuality(gyro_walk=walk)), [one])
    stated = effects[0].covariances
    assert stated is not None
    ratio = np.trace(np.cov(drawn.T)[:3, :3]) / np.trace(stated[0][:3, :3])
    # the window of an average of averages gives its last second less weight than a plain mean's
    assert ratio == pytest.approx(1.0, abs=0.16)


@pytest.mark.parametrize(
    ("method", "iterations", "start_bias", "norm"),
    [
        ("formulas", 0, False, False),
        ("formulas", 1, False, False),
        ("formulas", 1, True, True),
        ("least-squares", 0, True, True),
        ("least-squares", 1, True, True),
    ],
)
def test_analysis_and_drawn_tests_agree(method: str, iterations: int, start_bias: bool, norm: bool) -> None:
    """1500 draws know a group's rms to 3 %; products of errors are analysed to a tenth."""
    plan = setup(method=method, iterations=iterations, start_bias=start_bias, norm=norm)
    budget = analyse_strapdown_rotation(plan)
    drawn = budget.with_drawn(simulate_test_errors(plan, 1500, np.random.default_rng(8)), "").group_drawn()
    assert drawn is not None
    np.testing.assert_allclose(budget.group_rms(), drawn, rtol=0.2)


def test_playing_back_removes_products_and_leaves_noise() -> None:
    by_pass = [analyse_strapdown_rotation(setup(iterations=k)) for k in (0, 1, 2)]
    named = [dict(zip((s.name for s in b.sources), b.group_contributions().T, strict=True)) for b in by_pass]
    # 1e-3 of errors become 1e-5 of them
    assert np.all(named[1]["fixture × sensor errors"] < 0.05 * named[0]["fixture × sensor errors"])
    assert np.all(named[1]["gyro errors × Earth rate"] < 0.05 * named[0]["gyro errors × Earth rate"])
    np.testing.assert_allclose(named[1]["gyro noise"], named[0]["gyro noise"])
    np.testing.assert_allclose(by_pass[2].totals, by_pass[1].totals, rtol=1e-3)


def test_projecting_on_the_nominal_vertical_leaves_what_no_play_back_removes() -> None:
    """About 4 ppm rms of accelerometer scale at 1 mrad, about 12 at 0.1°: it goes with the square."""

    def scale(angle: float) -> float:
        plan = setup(norm=False, method="formulas", fixture=FixtureQuality(angle, angle, angle, angle))
        budget = analyse_strapdown_rotation(plan)
        squared = [s.name for s in budget.sources].index("fixture, squared")
        return float(budget.group_contributions()[4, squared])

    assert 2.0 < scale(1e-3) / MICRO < 6.0
    assert scale(0.1 * DEGREE) / scale(1e-3) == pytest.approx((0.1 * DEGREE / 1e-3) ** 2, rel=0.01)


def test_least_squares_are_never_worse_than_the_formulas() -> None:
    """Of noise, which both know of: the formulas take one component of each sequence."""
    quiet = setup(fixture=FixtureQuality(0.0, 0.0, 0.0, 0.0), sensors=replace(NAVIGATION, gyro_pulse=0.0))
    squares = analyse_strapdown_rotation(quiet).totals
    formulas = analyse_strapdown_rotation(replace(quiet, method="formulas")).totals
    assert np.all(squares <= formulas * (1.0 + 1e-6))
    assert np.min(squares / formulas) < 0.9


def test_the_start_window_makes_the_bias_harmless_and_costs_noise() -> None:
    with_bias = setup(sensors=replace(NAVIGATION, gyro_bias=1000.0 * DEGREE / 3600.0), method="formulas")
    assert "gyro bias" not in [s.name for s in analyse_strapdown_rotation(with_bias).sources]
    left_in = analyse_strapdown_rotation(replace(with_bias, start_bias=False))
    assert left_in.group_rms()[1] > 1e-3
    noise = [analyse_strapdown_rotation(setup(method="formulas", start_bias=b)) for b in (True, False)]
    assert noise[0].group_contributions()[0, 0] > 1.2 * noise[1].group_contributions()[0, 0]


def test_g_sensitivity_counts_with_what_the_rests_leave_of_it() -> None:
    """34 rests, each axis vertical in a third of them; the formulas know nothing of the rests."""
    sensitive = setup(sensors=replace(NAVIGATION, g_sensitivity=1e-5))
    magnitudes = [
        next(s.magnitude for s in analyse_strapdown_rotation(p).sources if s.name == "g-sensitivity")
        for p in (sensitive, replace(sensitive, method="formulas"))
    ]
    rest = NAVIGATION.gyro_walk / np.sqrt(6.0) / SITE.gravity
    assert magnitudes[0] == pytest.approx(rest / np.sqrt(34 / 3))
    assert magnitudes[1] == 1e-5


def test_gravity_is_wrong_in_the_accelerometer_scale_factors_alone() -> None:
    plan = setup(site=replace(SITE, gravity_sigma=3e-4), method="formulas")
    budget = analyse_strapdown_rotation(plan)
    column = [s.name for s in budget.sources].index("gravity")
    found = budget.group_contributions()[:, column]
    assert found[4] == pytest.approx(3e-4 / SITE.gravity)
    np.testing.assert_allclose(np.delete(found, 4), 0.0, atol=1e-15)


def test_without_asymmetry_sequences_it_is_left_out() -> None:
    budget = analyse_strapdown_rotation(setup(asymmetry=False))
    np.testing.assert_allclose(budget.totals[3:6], 0.0)
    assert np.all(budget.totals[:3] > 0.0)


def test_a_fixture_suffices_that_is_not_felt_and_a_coarse_one_with_heading_lost_does_not() -> None:
    fine = setup(fixture=FixtureQuality(1e-4, 1e-4, 1e-4, 1e-4))
    verdict = judge_fixture(fine, analyse_strapdown_rotation(fine))
    assert verdict.suffices
    assert "suffices" in verdict.words[0]
    assert verdict.largest_factor > 1.0
    lost = setup(fixture=FixtureQuality(1e-3, 1e-3, 0.05, 1e-3))
    verdict = judge_fixture(lost, analyse_strapdown_rotation(lost))
    assert not verdict.suffices
    assert verdict.largest_factor < 1.0
    assert "heading" in " ".join(verdict.words)


def test_advice_names_what_dominates_and_what_helps() -> None:
    plan = setup(site=Site.from_latitude(0.6), fixture=FixtureQuality(1e-3, 1e-3, 0.05, 1e-3))
    advice = " ".join(advise(plan, analyse_strapdown_rotation(plan)))
    assert "most comes from gravity" in advice
    assert "north known to" in advice


def test_a_grade_is_a_quality() -> None:
    quality = SensorQuality.from_grade(find_grade("ring-laser"), gyro_pulse=2.4e-6)
    assert quality.gyro_walk == pytest.approx(0.002 * DEGREE / 60.0)
    assert quality.gyro_pulse == 2.4e-6
    # a converter of 1/65.5 °/s at 100 Hz beside 0.005 °/s/√Hz over √2
    mems = SensorQuality.from_grade(find_grade("consumer-mems"))
    assert mems.gyro_walk == pytest.approx(DEGREE * np.hypot(0.005 / np.sqrt(2), 1 / 65.5 / np.sqrt(1200)))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: FixtureQuality(mounting=-1e-3),
        lambda: FixtureQuality(heading=0.2),
        lambda: Timing(seconds=0.0),
        lambda: Timing(rate=-1.0),
        lambda: Timing(averaging="other"),
        lambda: StrapdownSetup(SensorQuality(), site=Site.from_gravity(9.8)),
        lambda: StrapdownSetup(SensorQuality(), method="guess"),
        lambda: StrapdownSetup(SensorQuality(), iterations=-1),
    ],
)
def test_what_is_no_test_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(UsageError):
        wrong()
