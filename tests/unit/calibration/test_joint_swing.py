"""What the gyros tell of a pose that sways within a hold, whatever their bias."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tumble.calibration.equations.adjustment import balance_recording
from tumble.calibration.equations.hold_equations import Swing
from tumble.calibration.equations.imu_unknowns import imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import hold_swings, observe
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.calibration.start import start_adjustment


@pytest.fixture(scope="module")
def base(play: Any) -> HoldsAndTurns:
    """Holds without noise."""
    return play(noise=(1e-9, 1e-11), holds=6).data()


def nodding(base: HoldsAndTurns, hold: int, angle: float, axis: int) -> HoldsAndTurns:
    """A hold that turns away about an axis of the gyros and comes back, farthest in its middle."""
    first, last = int(base.head[hold, 0]), int(base.tail[hold, 1])
    seconds = base.time[last - 1] - base.time[first]
    rate = base.raw_rate.copy()
    rate[first:last, axis] += angle * np.pi / seconds * np.cos(np.linspace(0.0, np.pi, last - first))
    return replace(base, raw_rate=rate)


def test_a_steady_rate_is_no_swing(base: HoldsAndTurns) -> None:
    swings = hold_swings(base, np.zeros(3))
    biased = hold_swings(replace(base, raw_rate=base.raw_rate + np.array([0.3, -0.2, 0.1])), np.zeros(3))
    np.testing.assert_allclose(biased.value, swings.value, atol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_nod_is_seen_with_its_sign(base: HoldsAndTurns, axis: int) -> None:
    """Of ``a sin(pi t / T)`` the middle's mean is between its peak and the mean of the whole, 2/pi of it.

    A sum over some 200 samples, both ends whole, is a hundredth more than the integral.
    """
    before, after = (hold_swings(data, np.zeros(3)).value for data in (base, nodding(base, 2, 1e-3, axis)))
    seen = after - before
    assert 2e-3 / np.pi < seen[2, axis] < 1.01e-3
    seen[2, axis] = 0.0
    np.testing.assert_allclose(seen, 0.0, atol=1e-12)


def test_its_variance_is_that_of_drawn_noise(base: HoldsAndTurns) -> None:
    """White rates of 2, 3 and 5 raw/s a sample; 400 draws of 6 holds tell a sigma to 1.5 %, of which 5."""
    rng, sigma = np.random.default_rng(8), np.array([2.0, 3.0, 5.0])
    step = float(np.median(np.diff(base.time)))
    noisy = replace(base, rate_random_walk=sigma**2 * step)
    drawn = np.array(
        [
            hold_swings(
                replace(noisy, raw_rate=sigma * rng.standard_normal(base.raw_rate.shape)), np.zeros(3)
            ).value
            for _ in range(400)
        ]
    )
    stated = np.diagonal(hold_swings(noisy, np.zeros(3)).covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(np.sqrt(np.mean(drawn**2 / stated, axis=(0, 1))), 1.0, atol=0.075)


def test_one_hold_that_sways_does_not_loosen_the_others(play: Any, site: Any, model: Any) -> None:
    """A pose that leans by 5 mrad in its middle keeps its sway to itself; the rest stays as quiet as it was."""
    tumbled = play(noise=(1e-3, 1e-4), holds=12)
    base = tumbled.data()
    first, last = int(base.head[4, 0]), int(base.tail[4, 1])
    share = np.linspace(0.0, np.pi, last - first)
    seconds = float(base.time[last - 1] - base.time[first])
    lean: np.ndarray = 5e-3 * np.sin(share)
    rate, force = base.raw_rate.copy(), base.raw_force.copy()
    rate[first:last] += np.outer(5e-3 * np.pi / seconds * np.cos(share), model.gyroscope.matrix[:, 0])
    true: np.ndarray = model.accelerometer.correct(force[first:last])
    leaning = np.column_stack([0.0 * lean, lean * true[:, 2], -lean * true[:, 1]])
    force[first:last] += leaning @ model.accelerometer.matrix.T
    means = base.force_mean.copy(), base.rate_mean.copy()
    means[0][4], means[1][4] = force[first:last].mean(axis=0), rate[first:last].mean(axis=0)
    base = replace(base, raw_rate=rate, raw_force=force, force_mean=means[0], rate_mean=means[1])
    u = imu_unknowns(unknowns_of(model))
    task = start_adjustment(observe(base, u), u, site)
    balanced = balance_recording(task)
    noise = task.noise
    assert not balanced.outliers
    assert list(noise.factors["sway"]) == [4]
    assert np.sqrt(noise["sway"]) < 2e-4
    # to the middle and back: of six numbers two are between 2/pi of 5 mrad and the whole of it
    assert (
        5e-3 * 2.0 / np.pi / np.sqrt(3.0)
        < np.sqrt(noise.of_each("sway", np.array([4]))[0])
        < 5.1e-3 / np.sqrt(3.0)
    )


def test_without_a_rate_there_is_no_swing(base: HoldsAndTurns, site: Any, model: Any) -> None:
    """Of a recording without gyros the rates are zeros, which would say that nothing ever sways."""
    u = imu_unknowns(unknowns_of(model))
    task = start_adjustment(observe(base, u), u, site)
    task.taking_part["rate"][[1, 4]] = False
    (linear,) = Swing(task.sections[0]).linearise(task)
    assert linear.active is not None
    assert linear.active.tolist() == [True, False, True, True, False, True]


def test_gyros_that_see_holds_swing_are_believed_where_accelerometers_scatter_too_much_to_tell(
    play: Any, site: Any, model: Any
) -> None:
    """Twelve nods of 0.1 mrad; parts of noisy accelerometers know their tilt to 0.3 mrad, gyros to 5 µrad."""
    base = play(noise=(3e-2, 1e-5), holds=12).data()
    for hold in range(12):
        base = nodding(base, hold, 1e-4 * (-1.0) ** hold, hold % 3)
    u = imu_unknowns(unknowns_of(model))
    task = start_adjustment(observe(base, u), u, site)
    balanced = balance_recording(task)
    # a nod is a half wave of one axis of three there and back: its two steps are some 60 µrad about that axis
    assert 1e-5 < np.sqrt(task.noise["sway"]) < 1e-4
    swing = balanced.tests["swing"]
    assert swing.square.sum() < 2.0 * swing.redundancy.sum()
