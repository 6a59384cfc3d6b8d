"""What biases wander by over holds and turns, in common with their neighbours, and what it does to the unknowns."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tumble.calibration.equations.causes import FORCE_WANDER, RATE_WANDER, SOURCES
from tumble.calibration.equations.imu_unknowns import imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import observe
from tumble.calibration.recording_influences import recording_influences
from tumble.calibration.start import start_adjustment
from tumble.estimation.equations import Drift
from tumble.estimation.influence import Influences
from tumble.estimation.solve import solve
from tumble.estimation.wander import shared_wander


@pytest.fixture(scope="module")
def influences(play: Any, site: Any, model: Any) -> Influences:
    """Of holds whose biases wander by a tenth of a mg and a few millidegrees a second."""
    base = play(noise=(1e-3, 1e-4), holds=12).data()
    floors = np.array([1e-3, 2e-3, 3e-3]) ** 2, np.array([1e-4, 2e-4, 3e-4]) ** 2
    base = replace(
        base,
        force_floor=floors[0],
        rate_floor=floors[1],
        force_covariance=base.force_covariance + np.diag(floors[0]),
        rate_covariance=base.rate_covariance + np.diag(floors[1]),
    )
    u = imu_unknowns(unknowns_of(model))
    task = start_adjustment(observe(base, u), u, site)
    task.noise.set("sway", 1e-10)
    solve(task)
    return recording_influences(task)


def test_a_bias_that_is_the_same_throughout_moves_the_bias_alone_and_by_all_of_it(
    influences: Influences,
) -> None:
    for source, place in ((RATE_WANDER, "gyro.bias"), (FORCE_WANDER, "force.bias")):
        told = [i for i in influences.each if source in i.drifts]
        total = np.concatenate([i.gain @ i.drifts[source].by_bias for i in told]).sum(axis=0)
        expected = np.zeros_like(total)
        expected[imu_unknowns().places([place])] = np.eye(3)
        np.testing.assert_allclose(total, expected, atol=1e-6)


def test_gyro_biases_are_better_known_than_by_holds_that_wander_each_for_itself(
    influences: Influences,
) -> None:
    """Twelve holds with most of the time between them cover much of what the mean over the recording is."""
    truly = np.diag(influences.covariance)[imu_unknowns().places(["gyro.bias"])]
    independent = truly - sum(
        np.diag(share)[imu_unknowns().places(["gyro.bias"])] for share in influences.neighbours.values()
    )
    assert np.all(truly < 0.5 * independent)
    assert np.all(np.linalg.eigvalsh(influences.covariance) > -1e-18)


def test_the_budget_still_adds_up(influences: Influences) -> None:
    total = sum(influences.shares(SOURCES).values())
    np.testing.assert_allclose(
        np.diag(np.asarray(total)), np.diag(influences.covariance), rtol=1e-6, atol=1e-20
    )


def test_many_stretches_are_taken_together_and_tell_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mean over 256 stretches side by side; two at a time they are 128 that cover the same time."""
    count, span = 256, 64.0
    edges = np.linspace(8.0, 40.0, count + 1)
    by_bias = np.broadcast_to(np.eye(3) / count, (count, 3, 3))
    drift = Drift(edges[:-1], edges[1:], by_bias, np.zeros((count, 3, 3)))
    gain = np.broadcast_to(np.diag([1.0, 2.0, 3.0]), (count, 3, 3))
    density = np.array([1.0, 2.0, 5.0])
    whole = shared_wander([(drift, gain)], density, (0.0, span))
    monkeypatch.setattr("tumble.estimation.wander.MOST_STRETCHES", 20)
    fewer = shared_wander([(drift, gain)], density, (0.0, span))
    np.testing.assert_allclose(fewer, whole, rtol=1e-9, atol=1e-15)
    assert np.diag(whole)[2] == pytest.approx(9.0 * 5.0 * np.diag(whole)[0], rel=1e-9)
