"""Rates of a table that are believed, through the joint estimator: gyro scales and the angle to the accelerometers."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from recovery.played import jointly
from tumble.attitude.rotations import twenty_six_directions
from tumble.calibration import Session, find_procedure
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.equations.rotation_equations import Windows
from tumble.calibration.equations.stretches import RotationStretch
from tumble.calibration.estimate import Estimate
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.earth import Site
from tumble.estimation.equations import Linear
from tumble.protocol.steps import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep
from tumble.segmentation import observe_holds
from tumble.sensor import ImuModel
from tumble.sensor.gauge import change_frame
from tumble.simulation import find_grade, simulate_protocol

SITE = Site.from_latitude(0.8)
RATE = np.radians(60.0)
BELIEVED = replace(find_procedure("rate-table"), frame="accelerometer-x")


def _protocol() -> Protocol:
    """Each face up on a table, half of them spun one way and half the other."""
    steps: list[Step] = []
    for k, up_b in enumerate(twenty_six_directions()[:6]):
        pose = Pose(up_b, None, np.radians(0.5))
        steps += [TurnStep(2.0)] if steps else []
        spin = SpinStep(12.0, RATE * (-1.0) ** (k // 2), ramp=1.0, sigma=0.0)
        steps += [HoldStep(6.0, pose), spin, HoldStep(6.0, pose)]
    return Protocol("mine", "rate-table", tuple(steps))


@cache
def _run(*, noise: bool, seed: int = 5) -> tuple[Estimate, ImuModel, JointOutcome]:
    protocol = _protocol()
    (recording, truth), (noisy, _) = (
        simulate_protocol(
            *(protocol, 100.0, np.random.default_rng(seed)),
            site=SITE,
            grade=find_grade("tactical"),
            noise=with_noise,
            placement=noise,
        )
        for with_noise in (noise, True)
    )
    # Without noise a table that turns about the vertical looks like one at rest: the motion is the same in both.
    session, told = (Session(one, protocol, SITE) for one in (recording, noisy))
    session.timeline, session.matching = told.timeline, told.matching
    exact = observe_holds(recording, told.timeline)
    session.means = replace(told.means, specific_force=exact.specific_force, angular_rate=exact.angular_rate)
    estimate = jointly(session, BELIEVED, optional_terms=False)
    assert truth.model is not None
    assert session.joint is not None
    return estimate, change_frame(truth.model, "accelerometer-x"), session.joint


def test_without_noise_the_gyros_whole_matrix_comes_out_of_spins_about_the_vertical() -> None:
    estimate, model, _ = _run(noise=False)
    assert estimate.model.gyroscope is not None
    assert model.gyroscope is not None
    assert len(estimate.spins.names) == 6
    # The rates are exact to a microradian over 12 s at 60°/s, 1e-7 of the angle; the rest is the digits of a sample.
    np.testing.assert_allclose(
        np.diag(estimate.model.gyroscope.matrix), np.diag(model.gyroscope.matrix), atol=2e-7
    )
    np.testing.assert_allclose(estimate.model.gyroscope.matrix, model.gyroscope.matrix, atol=2e-6)
    np.testing.assert_allclose(estimate.spins.rates, [RATE, RATE, -RATE, -RATE, RATE, RATE], rtol=1e-6)


def test_with_noise_scale_factors_are_within_their_sigma_and_better_than_the_turns_alone_make_them() -> None:
    estimate, model, _ = _run(noise=True)
    assert estimate.model.gyroscope is not None
    assert model.gyroscope is not None
    names = [f"gyroscope.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    at = [estimate.names.index(name) for name in names]
    error = (estimate.model.gyroscope.matrix - model.gyroscope.matrix).ravel()
    covariance = estimate.covariance[np.ix_(at, at)]
    # One in a thousand on either side.
    assert chi2.ppf(1e-3, 9) < error @ np.linalg.solve(covariance, error) < chi2.ppf(1.0 - 1e-3, 9)
    # A random walk of 4e-5 rad/√s over the spin, of 12.6 rad.
    assert np.sqrt(covariance[0, 0]) < 3e-5


@pytest.mark.parametrize("index", LAYOUT.indices("gyro.matrix", "gyro.bias").tolist())
def test_what_the_accelerometers_show_on_a_table_depends_on_the_axis_that_the_gyros_show(index: int) -> None:
    """Windows of three radians: without these derivatives gravity along the axis seemed to show where the axis is."""
    task = _run(noise=False)[2].task.copy()
    (section,) = task.sections
    before, spin = next(iter(task.data.rotations.items()))
    assert RATE * spin.seconds / len(spin.windows) > 1.5
    windows = Windows(RotationStretch(task, section, before))
    windows.moving.own[windows.layout.lever] = 0.3, -0.2, 0.5

    def shown(step: float) -> Linear:
        values = task.unknowns.values.copy()
        values[index] += step
        moved = replace(task.copy(), unknowns=task.unknowns.at(values))
        return windows.linearise(moved)[0]

    difference = (shown(1e-6).residual - shown(-1e-6).residual) / 2e-6
    made, column = shown(0.0), windows.layout.earth.stop + task.unknowns.free.tolist().index(index)
    # Of what is along the axis, a share of gravity's part across it is left out, which half a degree off is 0.09.
    place = made.columns.tolist().index(column)
    np.testing.assert_allclose(made.by_border[:, :, place], difference, atol=0.03)


def test_a_spin_with_a_gap_breaks_the_section_and_gives_no_rate() -> None:
    protocol = _protocol()
    recording, _ = simulate_protocol(
        *(protocol, 100.0, np.random.default_rng(5)), site=SITE, grade=find_grade("tactical")
    )
    told = Session(recording, protocol, SITE)
    after = told.rotations[1].start + 300
    late = recording.time.copy()
    late[after:] += 1.0
    gapped = replace(recording, time=late)
    session = Session(gapped, protocol, SITE)
    session.means, session.matching, session.rotations = told.means, told.matching, told.rotations
    estimate = jointly(session, BELIEVED, timeline=told.timeline, optional_terms=False)
    assert len(estimate.spins.names) == 5
    assert any("rotation 2" in remark and "missing" in remark for remark in estimate.remarks)
