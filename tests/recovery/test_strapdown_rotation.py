"""The strapdown rotation test against the truth on a fixture that is off, and against what users do wrong."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tumble.calibration import Estimate, Session
from tumble.calibration.verdict import judge
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.protocol import HoldStep, Protocol, named_protocol
from tumble.recording.recording import Recording
from tumble.sensor import ImuModel, change_frame
from tumble.simulation import find_grade, simulate_protocol
from tumble.simulation.recordings import Truth
from tumble.simulation.two_axis import FixtureErrors
from tumble.workflows.procedures import add_remarks, run_procedure

SITE = replace(Site.from_latitude(np.radians(40.0), 300.0), gravity_sigma=0.0)
PROTOCOL = named_protocol("strapdown-rotation")
# 1 mrad in everything that a fixture may be off by.
FIXTURE = FixtureErrors(
    tilt=(1e-3, -7e-4),
    orthogonality=8e-4,
    inner_zero=-1e-3,
    outer_zero=6e-4,
    mounting=(5e-4, -9e-4, 1e-3),
    execution=3e-4,
)


@cache
def recorded(grade: str) -> tuple[Recording, Truth]:
    rng = np.random.default_rng(5)
    return simulate_protocol(PROTOCOL, 50.0, rng, site=SITE, grade=find_grade(grade), fixture=FIXTURE)


def calibrated(recording: Recording, protocol: Protocol = PROTOCOL, site: Site = SITE) -> Estimate:
    session = Session(recording, protocol, site)
    estimate, reason = run_procedure(session, None)
    add_remarks(session, estimate, None, reason)
    return estimate


def entry(model: ImuModel, name: str) -> float:
    """The entry of a model that an estimate's canonical name stands for."""
    triad, _, rest = name.partition(".")
    key, _, index = rest.rstrip("]").partition("[")
    value = model.g_sensitivity if key == "g_sensitivity" else getattr(getattr(model, triad), key)
    return 0.0 if value is None else float(value[tuple(int(i) for i in index.split(","))])


def normalised(estimate: Estimate, truth: Truth) -> np.ndarray:
    """Error over standard uncertainty of each parameter; a bias against its mean over the recording."""
    assert truth.model is not None
    assert estimate.frame == "mean-gyro"
    true = change_frame(truth.model, "mean-gyro")
    wandered = {"accelerometer": truth.mean_wander[0], "gyroscope": truth.mean_wander[1]}
    error = [entry(estimate.model, name) - entry(true, name) for name in estimate.names]
    for k, name in enumerate(estimate.names):
        triad, _, rest = name.partition(".")
        error[k] -= float(wandered[triad][int(rest[-2])]) if rest.startswith("bias") else 0.0
    return np.array(error) / np.sqrt(np.diag(estimate.covariance))


@pytest.mark.parametrize("grade", ["ring-laser", "industrial-mems"])
def test_with_noise_the_truth_is_within_the_uncertainty(grade: str) -> None:
    """4.5 standard uncertainties are passed by chance once in 150,000 parameters."""
    recording, truth = recorded(grade)
    estimate = calibrated(recording)
    off = normalised(estimate, truth)
    assert np.max(np.abs(off)) < 4.5
    # and the uncertainties are not so large that nothing could be beyond them
    assert np.sqrt(np.mean(np.square(off))) > 0.3
    assert judge(estimate, recording).fit


def test_a_heading_off_by_a_quarter_turn_moves_nothing() -> None:
    """All poses are turned alike, and what the gyros see of the Earth is no pose's."""
    steps = tuple(
        replace(step, pose=replace(step.pose, heading=step.pose.heading - 0.5 * np.pi))
        if isinstance(step, HoldStep) and step.pose is not None and step.pose.heading is not None
        else step
        for step in PROTOCOL.steps
    )
    recording, truth = recorded("ring-laser")
    assert np.max(np.abs(normalised(calibrated(recording, replace(PROTOCOL, steps=steps)), truth))) < 4.5


@pytest.mark.parametrize("latitude", [-40.0, 50.0])
def test_a_latitude_that_the_gyros_contradict_is_told(latitude: float) -> None:
    """Gravity as it is, so that the Earth rate alone is wrong."""
    recording, _ = recorded("ring-laser")
    (said,) = calibrated(recording, site=replace(SITE, latitude=np.radians(latitude))).objections
    assert "Check the latitude (--site)" in said


def test_without_a_latitude_the_truth_is_within_the_uncertainty_all_the_same() -> None:
    recording, truth = recorded("ring-laser")
    assert np.max(np.abs(normalised(calibrated(recording, site=replace(SITE, latitude=None)), truth))) < 4.5


@pytest.mark.parametrize(
    ("triad", "columns", "signs", "words"),
    [
        ("specific_force", [1, 0, 2], [1, 1, 1], r"axes are swapped: x is y, y is x\. .*t,ay,ax,az,gx,gy,gz"),
        ("angular_rate", [0, 1, 2], [-1, -1, -1], "all its signs seem to be reversed"),
        ("angular_rate", [0, 1, 2], [1, 0, 1], "gy never changes"),
    ],
)
def test_swapped_and_reversed_columns_and_a_dead_one_are_named(
    triad: str, columns: list[int], signs: list[float], words: str
) -> None:
    recording, _ = recorded("ring-laser")
    changed = replace(recording, **{triad: getattr(recording, triad)[:, columns] * signs})
    with pytest.raises(TumbleError, match=words):
        calibrated(changed)


def test_without_gyros_it_is_not_fit() -> None:
    recording = replace(recorded("ring-laser")[0], angular_rate=None)
    estimate = calibrated(recording)
    assert not judge(estimate, recording).fit
    assert "The gyros: the recording has none." in estimate.not_determined
