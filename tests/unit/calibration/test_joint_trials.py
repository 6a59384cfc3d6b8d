"""Trials leave the adjustment that they began with as it was, and forget nothing that was left out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from tests.unit.adjusted import adjusted

from tumble.calibration.equations.imu_unknowns import PLAIN
from tumble.calibration.equations.observed import table_rotation
from tumble.estimation.balance import Outlier, _without_chance
from tumble.estimation.solve import solve


def test_what_a_trial_changes_is_its_own(tumbled: Any, model: Any, started: Any) -> None:
    """Whatever balancing writes to: noise and wobble of rotations, variances, masks, angles that were read."""
    base = tumbled.data()
    start, stop = int(base.turn_start[3]), int(base.turn_stop[3])
    spin = table_rotation(base, 3, start, stop, np.array([0.3, 0.1, -0.2]), angle=1.0, angle_sigma=1e-4)
    task = started(base, rotations=[spin])
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
    estimate = adjusted(recording, tumbled.timeline, site)
    assert [test.name for test in estimate.terms if test.kept] == ["g_sensitivity"]
    assert {(left.kind, left.index) for left in estimate.left_out} == {("hold", 4), ("turn", 6)}


def test_variance_that_chance_does_not_explain_stays_and_so_do_the_attitudes(play: Any, started: Any) -> None:
    base = play(noise=(1e-3, 1e-4), holds=12).data()
    wander = np.random.default_rng(3).normal(scale=3e-3, size=base.rate_mean.shape)
    base = replace(base, rate_mean=base.rate_mean + wander @ np.diag([1.0, 2.0, 0.5]))
    task = started(base)
    task.noise.set("sway", 1e-10)
    task.noise.set("rate", 1e-5)
    solution = solve(task)
    attitudes = [section.C_wb.copy() for section in task.sections]
    values, noise = task.unknowns.values.copy(), task.noise.copy()
    (component,) = [one for one in task.components if one.name == "rate"]
    assert _without_chance(task, component, solution) is solution
    assert task.noise.added == noise.added
    np.testing.assert_array_equal(task.unknowns.values, values)
    for section, before in zip(task.sections, attitudes, strict=True):
        np.testing.assert_array_equal(section.C_wb, before)
