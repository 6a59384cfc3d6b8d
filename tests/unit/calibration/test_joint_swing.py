"""A pose that sways within a hold: what the gyros tell of it, and that the hold is named, with what to do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.unit.adjusted import adjusted

from tumble.calibration import Estimate
from tumble.calibration.equations.adjustment import balance_recording
from tumble.calibration.equations.hold_equations import Swing
from tumble.calibration.equations.observed import hold_swings
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.calibration.evidence import RestlessHold
from tumble.calibration.outcome.estimate import restless_remarks
from tumble.report.evidence.residuals import restless
from tumble.report.page import Table


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


def test_without_a_rate_there_is_no_swing(base: HoldsAndTurns, started: Any) -> None:
    """Of a recording without gyros the rates are zeros, which would say that nothing ever sways."""
    task = started(base)
    task.taking_part["rate"][[1, 4]] = False
    (linear,) = Swing(task.sections[0]).linearise(task)
    assert linear.active.tolist() == [True, False, True, True, False, True]


def test_gyros_that_see_holds_swing_are_believed_where_accelerometers_scatter_too_much_to_tell(
    play: Any, started: Any
) -> None:
    """Twelve nods of 0.1 mrad; parts of noisy accelerometers know their tilt to 0.3 mrad, gyros to 5 µrad."""
    base = play(noise=(3e-2, 1e-5), holds=12).data()
    for hold in range(12):
        base = nodding(base, hold, 1e-4 * (-1.0) ** hold, hold % 3)
    task = started(base)
    balanced = balance_recording(task)
    # a nod is a half wave of one axis of three there and back: its two steps are some 60 µrad about that axis
    assert 1e-5 < np.sqrt(task.noise["sway"]) < 1e-4
    swing = balanced.tests["swing"]
    assert swing.square.sum() < 2.0 * swing.redundancy.sum()


LEAN = 5e-3


@pytest.fixture(scope="module")
def leaning(play: Any, site: Any, model: Any) -> Estimate:
    """The fifth of twelve holds leans about x by 5 mrad in its middle, and comes back."""
    tumbled = play(noise=(1e-3, 1e-4), holds=12)
    recording, hold = tumbled.recording, slice(2000, 2300)
    share = np.linspace(0.0, np.pi, 300)
    rate, force = recording.angular_rate.copy(), recording.specific_force.copy()
    rate[hold] += np.outer(LEAN * np.pi / 3.0 * np.cos(share), model.gyroscope.matrix[:, 0])
    true, lean = model.accelerometer.correct(force[hold]), LEAN * np.sin(share)
    force[hold] += (
        np.column_stack([0.0 * lean, lean * true[:, 2], -lean * true[:, 1]]) @ model.accelerometer.matrix.T
    )
    # a clock that does not start at zero: times are told from the first sample on
    recording = replace(recording, specific_force=force, angular_rate=rate, time=recording.time + 1000.0)
    return adjusted(recording, tumbled.timeline, site, optional_terms=False)


def test_the_hold_is_named_with_its_time_and_its_sway(leaning: Estimate) -> None:
    (one,) = leaning.holds.restless
    assert one.hold == 4
    # samples at the middle of their intervals, 100 Hz, the first at 5 ms
    assert (one.start, one.stop) == pytest.approx((20.0, 22.99), abs=0.011)
    # to the middle and back: of six numbers two are between 2/pi of 5 mrad and the whole of it; a variance of
    # one's own is sought to a tenth of it or two
    assert LEAN * 2.0 / np.pi / np.sqrt(3.0) < one.sway < 1.15 * LEAN / np.sqrt(3.0)
    assert one.others < 2e-4
    assert not leaning.left_out
    (said,) = [remark for remark in leaning.remarks if "rest alike" in remark]
    assert "hold 5 (20.0 to 23.0 s)" in said
    assert "record it again" in said


def test_the_report_lists_it(leaning: Estimate) -> None:
    (table,) = (block for block in restless(leaning.holds) if isinstance(block, Table))
    assert table.rows[0][:2] == ["5", "20.0 to 23.0"]
    assert restless(replace(leaning.holds, restless=())) == []


def test_of_many_the_worst_are_named_in_their_order() -> None:
    holds = [RestlessHold(k, 10.0 * k, 10.0 * k + 5.0, 1e-3 * (k + 1), 2e-4) for k in range(8)]
    (said,) = restless_remarks(holds)
    assert "the worst of 8" in said
    named = [word for word in range(1, 9) if f"hold {word} (" in said]
    assert named == [4, 5, 6, 7, 8]
    assert "40 times as much as the others" in said
    assert not restless_remarks([])
