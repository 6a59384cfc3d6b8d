"""Trials of optional terms leave the problem that they began with as it was, and forget nothing that was left out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from tumble.calibration.joint.data import joint_data, window_spin
from tumble.calibration.joint.system import JointProblem, Masks
from tumble.calibration.joint.terms import Extra
from tumble.calibration.joint.trials import fresh_problem

from tumble.calibration.equations.imu_unknowns import PLAIN, unknowns_of
from tumble.calibration.joint import calibrate_joint
from tumble.segmentation import observe_holds


def test_what_a_trial_changes_is_its_own(tumbled: Any, site: Any, model: Any) -> None:
    """Whatever `balance_joint` writes to: noise and wobble of rotations, variances, masks, angles that were read."""
    base, values = tumbled.data(), unknowns_of(model)
    start, stop = int(base.turn_start[3]), int(base.turn_stop[3])
    spin = window_spin(base, 3, start, stop, np.array([0.3, 0.1, -0.2]), angle=1.0, angle_sigma=1e-4)
    data = joint_data(base, values, [spin])
    problem = JointProblem(data, site, PLAIN, Extra(), Masks.everything(data.holds))
    trial = fresh_problem(problem, PLAIN)
    trial.wobble[3], trial.spin_noise[3] = 1e-3, 7.0
    trial.extra.restless[4], trial.extra.sway = 9.0, 1e-6
    trial.masks.force[2] = trial.masks.turn[5] = False
    trial.data.spins[3].angle = None
    assert not problem.wobble
    assert not problem.spin_noise
    assert problem.extra == Extra()
    assert problem.masks.force.all()
    assert problem.masks.turn.all()
    assert problem.data.spins[3].angle == 1.0


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
