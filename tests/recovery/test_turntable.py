"""A table used wrongly: shorter holds, and one revolution of 60°/s each, five minutes at 50 Hz."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recovery.played import TURN, normalised, short
from tumble.calibration import Estimate, Session
from tumble.calibration.verdict import judge
from tumble.earth import Site
from tumble.errors import ObservabilityError, SegmentationError
from tumble.protocol import HoldStep, Protocol, SpinStep, Step
from tumble.recording.recording import Recording
from tumble.simulation import TableErrors, find_grade, simulate_protocol
from tumble.simulation.recordings import Truth
from tumble.workflows.procedures import add_remarks, run_procedure

SITE = Site.from_latitude(np.radians(48.0), 300.0)
TABLE = short("turntable-9", SITE)


def calibrated(recording: Recording, protocol: Protocol = TABLE) -> Estimate:
    session = Session(recording, protocol, SITE)
    estimate, reason = run_procedure(session, None)
    add_remarks(session, estimate, None, reason)
    return estimate


def played(protocol: Protocol, table: TableErrors | None = None) -> tuple[Recording, Truth]:
    rng = np.random.default_rng(7)
    return simulate_protocol(protocol, 50.0, rng, site=SITE, grade=find_grade("tactical"), table=table)


@cache
def right() -> tuple[Recording, Truth]:
    return played(TABLE)


def changed(change: Callable[[SpinStep], SpinStep], *spins: int) -> Protocol:
    at = [k for k, step in enumerate(TABLE.steps) if isinstance(step, SpinStep)]
    chosen = {at[k] for k in spins} if spins else set(at)
    steps = (change(s) if k in chosen and isinstance(s, SpinStep) else s for k, s in enumerate(TABLE.steps))
    return replace(TABLE, steps=tuple(steps))


def reversed_spin(step: SpinStep) -> SpinStep:
    assert step.angle is not None
    return replace(step, rate=-step.rate, angle=-step.angle)


def off(estimate: Estimate, truth: Truth) -> float:
    return float(np.max(np.abs(normalised(estimate, truth))))


@pytest.mark.parametrize(
    ("spins", "words"),
    [
        ((), r"Wrong way round.*or the protocol counts angles clockwise"),
        ((0, 1), r"Wrong way round, steps 20, 22: .*Mend the signs"),
    ],
    ids=["all", "of one axis"],
)
def test_angles_with_the_wrong_sign_are_told(spins: tuple[int, ...], words: str) -> None:
    with pytest.raises(SegmentationError, match=words):
        calibrated(right()[0], changed(reversed_spin, *spins))


def test_a_table_that_stopped_early_is_named_by_its_step_and_serves_once_its_angle_is_in_the_protocol() -> (
    None
):
    recording, truth = played(TABLE, TableErrors(stops_early=((2, 0.8),)))
    assert off(calibrated(recording, replace(TABLE, steps=truth.steps)), truth) < 4.5
    with pytest.raises(
        ObservabilityError, match=r"Step 26, about y: the protocol says that the table turned 360°.*288°"
    ):
        calibrated(recording)


def test_an_angle_a_turn_too_large_moves_nothing() -> None:
    """What is read of a table is an angle, and whole turns are the gyros'."""
    recording, truth = right()
    estimate = calibrated(recording, changed(lambda s: replace(s, angle=2.0 * TURN * np.sign(s.rate)), 4))
    assert off(estimate, truth) < 4.5


def test_without_angles_the_protocol_s_rate_is_believed_and_it_is_said() -> None:
    recording, truth = right()
    estimate = calibrated(recording, changed(lambda s: replace(s, angle=None)))
    assert any("Of 12 rotations the rate is believed" in remark for remark in estimate.remarks)
    assert off(estimate, truth) < 4.5


def test_a_turn_that_is_missing_is_named_and_the_others_serve() -> None:
    fourth = [k for k, step in enumerate(TABLE.steps) if isinstance(step, SpinStep)][3]
    recording, truth = played(replace(TABLE, steps=TABLE.steps[:fourth] + TABLE.steps[fourth + 1 :]))
    estimate = calibrated(recording)
    assert any("Step 28 (about y, clockwise)" in remark for remark in estimate.remarks)
    assert off(estimate, truth) < 4.5


def test_a_recording_of_one_triad_is_not_fit_or_refused() -> None:
    recording, _ = right()
    with pytest.raises(ObservabilityError, match="The recording has no accelerometer"):
        calibrated(replace(recording, specific_force=None))
    bare = replace(recording, angular_rate=None)
    assert not judge(calibrated(bare), bare).fit


def test_a_laboratory_whose_poses_are_believed_and_wrong_is_not_fit() -> None:
    """Half a degree stated exact."""

    def loose(step: Step) -> Step:
        if isinstance(step, HoldStep) and step.pose is not None:
            return replace(step, pose=replace(step.pose, sigma=np.radians(0.5)))
        return step

    exact = short("laboratory", SITE)
    recording, _ = played(replace(exact, steps=tuple(loose(step) for step in exact.steps)))
    assert not judge(calibrated(recording, exact), recording).fit
