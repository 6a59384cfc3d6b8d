"""A hold that sways more than the others is named: in the remarks, in the report, with what to do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tumble.calibration import Estimate
from tumble.calibration.evidence import RestlessHold
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.outcome.restless import restless_remarks
from tumble.report.evidence.holds import restless
from tumble.report.page import Table
from tumble.segmentation import observe_holds

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
    means = observe_holds(recording, tumbled.timeline)
    return calibrate_joint(recording, tumbled.timeline, means, site, optional_terms=False)


def test_the_hold_is_named_with_its_time_and_its_sway(leaning: Estimate) -> None:
    (one,) = leaning.holds.restless
    assert one.hold == 4
    # samples at the middle of their intervals, 100 Hz, the first at 5 ms
    assert (one.start, one.stop) == pytest.approx((20.0, 22.99), abs=0.011)
    # to the middle and back: of six numbers two are between 2/pi of 5 mrad and the whole of it; a variance of
    # one's own is sought to a tenth of it or two
    assert LEAN * 2.0 / np.pi / np.sqrt(3.0) < one.sway < 1.15 * LEAN / np.sqrt(3.0)
    assert one.others < 2e-4
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
