"""What several tests of recovery play: one unit on a table and by hand, what is found of it, and how far off it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation as Attitudes

from tumble.calibration import Estimate, Options, Session, calibrate, find_procedure
from tumble.calibration.outcome.description import canonical_names
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.session import Procedure
from tumble.earth import Site
from tumble.protocol import HoldStep, Protocol, SpinStep, Step, named_protocol
from tumble.recording.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, Turn
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.simulation import Motion, simulate_recording
from tumble.simulation.recordings import Truth

Array = npt.NDArray[np.float64]
RATE, TURN = np.radians(60.0), 2.0 * np.pi
HOLD, REST = 10.0, 6.0
# Every element differs from its mirror image; no rotation joins the triads' axes but their own.
MODEL = ImuModel(
    Triad(
        np.array([[1.02, 0.003, -0.004], [0.0031, 0.97, 0.002], [-0.0012, 0.0045, 1.05]]),
        np.array([0.02, -0.03, 0.05]),
    ),
    Triad(
        np.array([[0.99, 0.0021, -0.0033], [-0.0014, 1.03, 0.0026], [0.0037, -0.0018, 0.97]]),
        np.array([1e-3, -2e-3, 3e-3]),
    ),
)
NAMES = canonical_names(frozenset(), "full")
# m/s² and rad/s of a sample of what `by_hand` plays.
NOISE = (0.005, 5e-4)


def short(name: str, site: Site) -> Protocol:
    """A table's named protocol in less time: shorter holds, and one revolution of 60°/s each."""

    def changed(step: Step) -> Step:
        if isinstance(step, SpinStep):
            sign = float(np.sign(step.rate))
            return replace(step, duration=TURN / RATE - step.ramp, rate=sign * RATE, angle=sign * TURN)
        if isinstance(step, HoldStep):
            return replace(step, duration=REST if step.name.startswith("about") else HOLD)
        return step

    protocol = named_protocol(name)
    return replace(protocol, steps=tuple(changed(step) for step in protocol.steps), site=site)


def by_hand(poses: Attitudes, model: ImuModel, site: Site) -> tuple[Recording, Timeline]:
    """Holds of 3 s, turns of 2 s, 50 Hz, white noise; the timeline is where they were."""
    holds = len(poses)
    motion = Motion.between_poses(poses, np.full(holds, 3.0), np.full(holds - 1, 2.0))
    rng = np.random.default_rng(8)
    recording, _ = simulate_recording(motion, 50.0, rng, site=site, distort=model.distort)
    for signal, sigma in zip((recording.specific_force, recording.angular_rate), NOISE, strict=True):
        assert signal is not None
        signal[:] += sigma * rng.standard_normal(signal.shape)
    turns = tuple(Turn(k, k + 1, 250 * k + 150, 250 * (k + 1)) for k in range(holds - 1))
    floor = NoiseFloor(np.full(3, NOISE[0]), np.full(3, NOISE[1]), 1.0, "as simulated")
    return recording, Timeline(tuple(Hold(250 * k, 250 * k + 150) for k in range(holds)), turns, (), floor)


def jointly(
    session: Session,
    procedure: str | Procedure = "joint",
    *,
    timeline: Timeline | None = None,
    optional_terms: bool = True,
    prior: StableKnowledge | None = None,
) -> Estimate:
    """The joint estimate with a clock that is right; holds and turns are where `timeline` has them."""
    if timeline is not None:
        session.timeline = timeline
    session.options, session.prior = Options(optional_terms=optional_terms), prior
    record = find_procedure(procedure) if isinstance(procedure, str) else procedure
    return calibrate(session, record, clocked=False)


def in_frame(model: ImuModel | None, frame: str) -> ImuModel:
    """A simulated unit in an estimate's frame; the fixture's is its own."""
    assert model is not None
    return model if frame == "fixture" else change_frame(model, frame)


def vector(model: ImuModel) -> Array:
    """Both matrices and biases, as `NAMES` has them."""
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    triads = (model.accelerometer, model.gyroscope)
    return np.concatenate([part.ravel() for triad in triads for part in (triad.matrix, triad.bias)])


def normalised(estimate: Estimate, truth: Truth) -> Array:
    """Errors over stated sigmas of what the frame leaves free; the bias of a session is what it was on average."""
    error = vector(estimate.model) - vector(in_frame(truth.model, estimate.frame))
    error[9:12] -= truth.mean_wander[0]
    error[21:24] -= truth.mean_wander[1]
    sigma = np.sqrt(np.diag(estimate.covariance))[[estimate.names.index(name) for name in NAMES]]
    fixed = sigma == 0.0
    assert np.count_nonzero(fixed) == (0 if estimate.frame == "fixture" else 3)
    np.testing.assert_allclose(error[fixed], 0.0, atol=1e-12)
    return error[~fixed] / sigma[~fixed]
