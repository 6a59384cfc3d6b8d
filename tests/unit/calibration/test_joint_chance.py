"""A trial that is refused leaves an adjustment where it was."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tumble.calibration.equations.imu_unknowns import imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import observe
from tumble.calibration.start import start_adjustment
from tumble.estimation.balance import _without_chance
from tumble.estimation.solve import solve


def test_variance_that_chance_does_not_explain_stays_and_so_do_the_attitudes(
    play: Any, site: Any, model: Any
) -> None:
    base = play(noise=(1e-3, 1e-4), holds=12).data()
    wander = np.random.default_rng(3).normal(scale=3e-3, size=base.rate_mean.shape)
    base = replace(base, rate_mean=base.rate_mean + wander @ np.diag([1.0, 2.0, 0.5]))
    u = imu_unknowns(unknowns_of(model))
    task = start_adjustment(observe(base, u), u, site)
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
