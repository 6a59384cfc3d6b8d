"""What a planned test would offer to a calibration: the protocol played without noise, its noise as stated.

The protocol is played with exact sensors, placed by hand as it would be, at a low sampling rate: a sample then
stands for many, with the same density of noise. Holds, turns and rotations are where the player put them, so that
nothing has to be found; the covariances are those that the unit's noise gives to means over them. From there on a plan
is a calibration: the same equations, the same weights, the same beliefs.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Matrices, Vectors, range_means
from tumble.calibration import Options, Session
from tumble.design.hold_noise import wander_sigma, white_density
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.protocol import HoldStep, Protocol, RampStep, SoakStep, SpinStep
from tumble.recording import Clock, Recording
from tumble.records import dataclass
from tumble.segmentation import (
    Hold,
    MatchedHold,
    MatchedSpin,
    Matching,
    NoiseFloor,
    SpinMeans,
    Timeline,
    Turn,
    whole_revolutions,
)
from tumble.sensor import ImuModel
from tumble.simulation import TriadNoise, Truth, simulate_protocol

# Of each edge of a hold, what the search for holds does not take for rest, s.
EDGE = 0.15
# Hand turns are followed this often, and a table's windows (0.3 rad) have at least so many samples.
HAND_RATE, SAMPLES_A_WINDOW, WINDOW = 20.0, 6.0, 0.3  # Hz, -, rad
FASTEST = 200.0  # Hz
LONGEST = 6 * 3600.0  # s


@dataclass(frozen=True)
class PlannedNoise:
    """The noise of a unit as a plan counts with it.

    Attributes
    ----------
    accelerometer, gyroscope : coefficients, SI.
    rate : Hz, at which the unit will be sampled: the converter's part depends on it.
    """

    accelerometer: TriadNoise
    gyroscope: TriadNoise
    rate: float


def require_plannable(protocol: Protocol) -> None:
    """Refuse a protocol whose worth cannot be foretold.

    Parameters
    ----------
    protocol : what a user wants planned.

    Raises
    ------
    UsageError
        If it has soaks or ramps, fewer than two holds, or lasts too long.
    """
    if any(isinstance(step, SoakStep | RampStep) for step in protocol.steps):
        raise UsageError(
            f"{protocol.name} changes the temperature, and what a thermal test will be worth cannot "
            "be predicted yet: plan its poses at one temperature, for example tumble plan "
            "multi-position-9."
        )
    if sum(isinstance(step, HoldStep) for step in protocol.steps) < 2:
        raise UsageError(f"{protocol.name} has fewer than two holds: there is nothing to calibrate from.")
    if protocol.duration > LONGEST:
        raise UsageError(
            f"{protocol.name} lasts {protocol.duration / 3600.0:.1f} h; a plan takes "
            f"{LONGEST / 3600.0:g} h at most: give a shorter one."
        )


def planned_session(
    protocol: Protocol,
    site: Site,
    noise: PlannedNoise,
    rng: np.random.Generator,
    *,
    clock: float = 0.0,
    options: Options | None = None,
    span: float | None = None,
    apart: Collection[int] = (),
) -> Session:
    """Play a protocol with an exact unit, placed and turned as hands and a table do; return what it offers.

    Parameters
    ----------
    protocol, site : holds, turns and spins, and where.
    noise : of the unit.
    rng : of placement, unknown headings and turns by hand.
    clock : standard uncertainty of the sample rate as a share.
    options : of the estimate.
    span : s over which biases wander; the played motion's own by default.
    apart : steps before which nothing is carried over from the hold before.

    Raises
    ------
    ProtocolError
        If a step cannot be played.
    """
    fastest = max((abs(s.rate) for s in protocol.steps if isinstance(s, SpinStep)), default=0.0)
    rate = min(max(HAND_RATE, SAMPLES_A_WINDOW * fastest / WINDOW), FASTEST)
    recording, truth = simulate_protocol(protocol, rate, rng, site=site, model=ImuModel.ideal(), noise=False)
    recording = replace(recording, said_clock=Clock("stated", rate, clock))
    edges = np.asarray(truth.hold_edges, dtype=np.float64)
    trim = np.minimum(EDGE, 0.1 * (edges[:, 1] - edges[:, 0]))
    first, last = (np.searchsorted(recording.time, at) for at in (edges[:, 0] + trim, edges[:, 1] - trim))
    holds = [Hold(int(a), int(max(b, a + 2))) for a, b in zip(first, last, strict=True)]
    links = [k for k, step in enumerate(truth.hold_steps[1:]) if step not in apart]
    turns = [Turn(k, k + 1, holds[k].stop, holds[k + 1].start) for k in links]
    white = [white_density(triad, noise.rate) for triad in (noise.accelerometer, noise.gyroscope)]
    force, angular = (np.full(3, one * np.sqrt(rate)) for one in white)
    session = Session(recording, replace(protocol, steps=truth.steps), site, options=options or Options())
    session.timeline = Timeline(tuple(holds), tuple(turns), (), NoiseFloor(force, angular, 0.0, ""))
    session.matching, span = _matching(session, truth), recording.duration if span is None else span
    session.means = _means(recording, holds, noise, span)
    if session.matching.spins:
        session.spins = _means(recording, session.matching.spins, noise, span)
    return session


def _means(
    recording: Recording, stretches: Sequence[Hold | MatchedSpin], noise: PlannedNoise, span: float
) -> SpinMeans:
    """Means of holds or spins as a noise model knows them: white noise of each, and biases that wander."""
    at: np.ndarray = np.array([(one.start, one.stop) for one in stretches])
    count = (at[:, 1] - at[:, 0]).astype(float)
    duration = count / recording.rate
    dwell = float(np.median(duration))

    def of(signal: Vectors | None, triad: TriadNoise) -> tuple[Vectors, Matrices]:
        assert signal is not None
        white = white_density(triad, noise.rate) ** 2 / duration
        variance = white + wander_sigma(triad, dwell, max(span, dwell)) ** 2
        return range_means(signal, at), variance[:, None, None] * np.eye(3)

    return SpinMeans(
        *of(recording.specific_force, noise.accelerometer),
        *of(recording.angular_rate, noise.gyroscope),
        *(duration, np.mean(recording.time[at - np.array([0, 1])], axis=1), count, None),
        modelled=True,
    )


def _matching(session: Session, truth: Truth) -> Matching:
    """Which hold and which spin is which step, as the player knows it."""
    recording, spins = session.recording, list[MatchedSpin]()
    for spin in truth.spins:
        first, last = (
            int(np.searchsorted(recording.time, at)) for at in (spin.start + EDGE, spin.stop - EDGE)
        )
        whole = whole_revolutions(recording, first, last, 2.0 * np.pi / abs(spin.rate))
        spins.append(MatchedSpin(spin.step, *whole))
    holds = (MatchedHold(step, k) for k, step in enumerate(truth.hold_steps) if step is not None)
    return Matching(tuple(holds), tuple(spins), (), ())
