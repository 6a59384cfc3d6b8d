"""The simulated rotation test: exact where it has to be, and as noisy as it is said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.sensor.conventions.savage import SavageErrors, savage_from_model
from tumble.sensor.imu import ImuModel
from tumble.units import ARCSECOND
from tumble_papers.savage.section_9 import changes_by_kind, expected_by_kind, unit
from tumble_papers.savage.strapdown_simulation import (
    AS_PRINTED,
    EXACT,
    GRADES,
    START_NORM,
    VARIANTS,
    Setting,
    composed,
    draw_truth,
    matched_weights,
    measure_run,
    run_study,
    simulate_run,
)

ZERO = SavageErrors.from_vector(np.zeros(24))
BRIEF = 1.0  # s; without noise as good as ten


def test_an_EXACT_on_a_fixture_that_is_off_measures_nothing_level() -> None:
    """Whatever the fixture does, exact gyros know it: no first-order effect of α, and none of any order."""
    setting = Setting(unit(), fixture=5e-3, earth=False, seconds=BRIEF)
    recordings = simulate_run(setting, np.random.default_rng(1), truth=ZERO)
    measured = measure_run(recordings, ImuModel.ideal(), replace(AS_PRINTED, norm=True))
    for name, vector in measured.items():
        # the change has a part along the nominal down only, which is left out; round-off of 1e4 samples
        np.testing.assert_allclose(vector, 0.0, atol=1e-9, err_msg=name)


def test_the_earth_rate_is_in_the_increments_as_the_test_takes_it_out() -> None:
    setting = Setting(unit(), fixture=0.0, seconds=BRIEF)
    recordings = simulate_run(setting, np.random.default_rng(2), truth=ZERO)
    measured = measure_run(recordings, ImuModel.ideal(), AS_PRINTED)
    # steps of 10 ms about a turning Earth axis: ω e dt²/12 a sample, some 1e-9 rad at the end
    for vector in measured.values():
        np.testing.assert_allclose(vector, 0.0, atol=3e-8)
    still = measure_run(replace(recordings, earth=0.0 * recordings.earth), ImuModel.ideal(), AS_PRINTED)
    assert max(np.max(np.abs(vector)) for vector in still.values()) > 1e-3


def test_increments_are_those_of_scipy_s_rotations() -> None:
    """Sequence 6, gyros of an asymmetric matrix with asymmetry and bias, on the turning Earth, step by step."""
    truth = draw_truth(Setting(GRADES["MEMS"]), np.random.default_rng(3))
    setting = Setting(EXACT, fixture=2e-2, seconds=0.1)
    recordings = simulate_run(setting, np.random.default_rng(4), truth=truth)
    gyro = truth.model().gyroscope
    assert gyro is not None
    assert gyro.asymmetry is not None
    number = 8
    first, last = recordings.starts[number : number + 2]
    own = recordings.rate[first:last] - truth.gyro_bias
    own = own / (1.0 + np.sign(own) * gyro.asymmetry)
    rate = np.linalg.solve(gyro.matrix, own.T).T
    total = Rotation.identity()
    for step in rate / setting.sampling:
        total = total * Rotation.from_rotvec(step)
    # eight rotations by whole turns come back, but for the fixture and 20 s of the Earth
    assert total.magnitude() < 20 * setting.fixture
    rest = np.linalg.norm(rate[:5], axis=1)
    np.testing.assert_allclose(rest, 7.292115e-5, rtol=1e-9)
    turning = np.linalg.norm(rate[20:200], axis=1)
    assert np.all(np.abs(turning - 1.0) < 2e-2)


def test_the_integral_of_whole_pulses_is_never_off_by_more_than_one() -> None:
    exact, whole = unit(), unit(angle_pulse=0.5 * ARCSECOND, velocity_pulse=1e-4)
    one, other = (
        simulate_run(Setting(g, seconds=BRIEF), np.random.default_rng(7), truth=ZERO) for g in (exact, whole)
    )
    first, last = one.starts[8:10]
    for a, b, pulse in (
        (one.rate, other.rate, whole.angle_pulse),
        (one.force, other.force, whole.velocity_pulse),
    ):
        off = np.cumsum(b[first:last] - a[first:last], axis=0) / 100.0
        assert 0.3 * pulse < np.max(np.abs(off)) <= pulse * (1.0 + 1e-6)
        counts = b[first:last] / 100.0 / pulse
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-5)


@pytest.mark.parametrize("variant", [AS_PRINTED, START_NORM, VARIANTS[4], VARIANTS[-1]], ids=lambda v: v.name)
def test_measurements_are_as_noisy_as_their_models_say(variant: object) -> None:
    """Random walks of both triads; the models' variances against those of 60 runs."""
    grade = unit(angle_random_walk=1e-5, velocity_random_walk=1e-4)
    setting = Setting(grade, fixture=0.0, earth=False, sampling=50.0)
    # a mean over all windows adds 17 times less than one each, which its model leaves out
    found = changes_by_kind(setting, variant, 60, np.random.Generator(np.random.SFC64(3)))
    expected = expected_by_kind(setting, variant)
    for kind, values in found.items():
        # 180 numbers or more: 5 %; four times that
        assert np.sqrt(np.mean(values**2)) == pytest.approx(expected[kind], rel=0.2), kind


def test_matched_weights_are_one_together_and_largest_next_to_the_rotations() -> None:
    weights = matched_weights(Setting(GRADES["MEMS"]))
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(np.diff(weights) > 0.0)
    # cosh(t/τ) with τ = 100 µg/√Hz over g times 0.3 °/√h: 1.146 s, a tenth of the window
    assert weights[-1] / weights[-116] == pytest.approx(np.e, rel=0.02)
    even = matched_weights(Setting(unit(velocity_random_walk=1.0)))
    assert np.ptp(even) < 1e-5 * even.mean()


def test_the_same_seed_gives_the_same_errors_with_any_number_of_threads() -> None:
    setting = Setting(GRADES["nav"], seconds=BRIEF)
    one, two = (
        run_study(setting, (START_NORM,), 4, np.random.Generator(np.random.SFC64(8)), iterations=2, threads=t)
        for t in (1, 2)
    )
    np.testing.assert_array_equal(one, two)


def test_a_composed_model_undoes_a_unit_whose_rest_is_known() -> None:
    """raw = A(B(x)) for compensation A and rest B without asymmetry: the composed model is exact."""
    rng = np.random.default_rng(9)
    known, rest = (
        SavageErrors.from_vector(np.where(np.isin(np.arange(24), [3, 4, 5, 15, 16, 17]), 0.0, v), gyro_bias=b)
        for v, b in zip(1e-2 * rng.standard_normal((2, 24)), 1e-3 * rng.standard_normal((2, 3)), strict=True)
    )
    whole = composed(known.model(), rest)
    force, rate = rng.standard_normal((2, 5, 3))
    inner = rest.model().distort(force, rate)
    expected = known.model().distort(*inner)
    for a, b in zip(whole.distort(force, rate), expected, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-14)
    assert savage_from_model(whole)[0].kappa[0] != known.kappa[0]


def test_without_asymmetry_a_unit_has_none_and_fourteen_sequences_tell_it() -> None:
    setting = Setting(GRADES["nav"], seconds=BRIEF)
    variant = next(v for v in VARIANTS if not v.asymmetry)
    errors = run_study(setting, (variant,), 5, np.random.Generator(np.random.SFC64(2)), iterations=2)
    assert np.all(errors[..., 3:6] == 0.0)
    assert 0.0 < np.max(np.abs(errors[0, :, 1, :3])) < 1e-4
