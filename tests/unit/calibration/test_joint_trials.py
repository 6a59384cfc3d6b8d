"""Trials of optional terms leave the problem that they began with as it was, and forget nothing that was left out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tumble.calibration.equations.imu_unknowns import PLAIN, imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import observe, table_rotation
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.start import start_adjustment
from tumble.estimation.balance import Outlier
from tumble.segmentation import observe_holds


def test_what_a_trial_changes_is_its_own(tumbled: Any, site: Any, model: Any) -> None:
    """Whatever balancing writes to: noise and wobble of rotations, variances, masks, angles that were read."""
    base, u = tumbled.data(), imu_unknowns(unknowns_of(model))
    start, stop = int(base.turn_start[3]), int(base.turn_stop[3])
    spin = table_rotation(base, 3, start, stop, np.array([0.3, 0.1, -0.2]), angle=1.0, angle_sigma=1e-4)
    task = start_adjustment(observe(base, u, [spin]), u, site)
    trial = task.copy(PLAIN)
    trial.noise.raise_factor("axis", 3, 9.0)
    trial.noise.set("sway", 1e-6)
    for kind, place in (("force", 2), ("turn", 5), ("angle", 3)):
        trial.leave_out(Outlier(kind, place, 7.0))
    trial.unknowns["force.bias"][:] = 1.0
    trial.sections[0].C_wb[:] = 0.0
    assert not task.noise.factors
    assert task.noise["sway"] < 1e-12
    assert all(active.all() for active in task.taking_part.values())
    assert task.reads_angle(3)
    assert not trial.reads_angle(3)
    np.testing.assert_array_equal(task.unknowns["force.bias"], model.accelerometer.bias)
    assert np.any(task.sections[0].C_wb)


def test_what_was_left_out_before_the_terms_were_tried_is_told(play: Any, site: Any) -> None:
    """A hold is pushed by 0.2 m/s², a turn's gyro is off by 3 °/s; a g-sensitivity that is there is kept besides."""
    tumbled = play(noise=(1e-3, 1e-4), holds=26)
    force, rate = tumbled.recording.specific_force.copy(), tumbled.recording.angular_rate.copy()
    force[2000:2300, 0] += 0.2
    rate[3300:3500, 0] += 0.05
    recording = replace(tumbled.recording, specific_force=force, angular_rate=rate)
    estimate = calibrate_joint(recording, tumbled.timeline, observe_holds(recording, tumbled.timeline), site)
    assert [test.name for test in estimate.terms if test.kept] == ["g_sensitivity"]
    assert {(left.kind, left.index) for left in estimate.left_out} == {("hold", 4), ("turn", 6)}
