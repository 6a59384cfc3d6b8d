"""What a planned test would offer to the joint estimator: the protocol played without noise, its noise as stated.

The protocol is played with exact sensors, placed by hand as it would be, at a low sampling rate: a sample then
stands for many, with the same density of noise. Holds, turns and rotations are where the player put them, so that
nothing has to be found; the covariances are those that the unit's noise gives to means over them.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, range_means
from tumble.calibration.equations.gathering import EDGE_WINDOW
from tumble.calibration.equations.imu_unknowns import imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import Observed, TableRotation, observe, table_rotation
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.design.hold_noise import wander_sigma, white_density
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.protocol.steps import HoldStep, Protocol, RampStep, SoakStep, SpinStep
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.simulation import TriadNoise, Truth, simulate_protocol

# Of each edge of a hold, what the search for holds does not take for rest, s.
EDGE = 0.15
# Hand turns are followed this often, and a table's windows (0.3 rad) have at least so many samples.
HAND_RATE, SAMPLES_A_WINDOW, WINDOW = 20.0, 6.0, 0.3  # Hz, -, rad
FASTEST = 200.0  # Hz
LONGEST = 6 * 3600.0  # s
# A display whose angle is exact to the last digit is still one of a table.
EXACT_ANGLE = 1e-6  # rad


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class PlayedPlan:
    """A protocol as it was played.

    Attributes
    ----------
    recording, truth : exact samples, and where everything is in them.
    holds : (holds, 2) half-open ranges of samples.
    """

    recording: Recording
    truth: Truth
    holds: np.ndarray


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


def play_plan(protocol: Protocol, site: Site, rng: np.random.Generator) -> PlayedPlan:
    """Play a protocol with an exact unit, placed and turned as hands and a table do.

    Parameters
    ----------
    protocol : holds, turns and spins.
    site : gravity and Earth rate.
    rng : of placement, unknown headings and turns by hand.

    Raises
    ------
    ProtocolError
        If a step cannot be played.
    """
    fastest = max((abs(s.rate) for s in protocol.steps if isinstance(s, SpinStep)), default=0.0)
    rate = min(max(HAND_RATE, SAMPLES_A_WINDOW * fastest / WINDOW), FASTEST)
    recording, truth = simulate_protocol(protocol, rate, rng, site=site, model=ImuModel.ideal(), noise=False)
    edges = np.asarray(truth.hold_edges, dtype=np.float64)
    trim = np.minimum(EDGE, 0.1 * (edges[:, 1] - edges[:, 0]))
    first = np.searchsorted(recording.time, edges[:, 0] + trim)
    last = np.searchsorted(recording.time, edges[:, 1] - trim)
    holds = np.column_stack([first, np.maximum(last, first + 2)])
    return PlayedPlan(recording, truth, holds)


def planned_data(
    played: PlayedPlan,
    noise: PlannedNoise,
    *,
    span: float | None = None,
    stretch: Series | None = None,
    like: Observed | None = None,
) -> Observed:
    """Return what the joint estimator would see, with the noise that a unit has.

    Parameters
    ----------
    played : the motion.
    noise : of the unit.
    span : s over which biases wander; the played motion's own by default.
    stretch : (holds,) how many times as long each hold lasts as far as its noise goes; once by default.
    like : the same motion observed already, with other holds' noise: what it shows is taken from there.
    """
    base = _base(played, noise, span, stretch, None if like is None else like.base)
    u = imu_unknowns(unknowns_of(ImuModel.ideal()))
    rotations = _spins(played, base) if like is None else [*like.rotations.values()]
    return observe(base, u, rotations, None if like is None else like.parts)


def _base(
    played: PlayedPlan,
    noise: PlannedNoise,
    span: float | None,
    stretch: Series | None,
    like: HoldsAndTurns | None,
) -> HoldsAndTurns:
    recording, holds = played.recording, played.holds
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    count = (holds[:, 1] - holds[:, 0]).astype(float) * (1.0 if stretch is None else stretch)
    duration = count / recording.rate
    span = float(recording.time[-1] - recording.time[0]) if span is None else span
    dwell = float(np.median(duration))
    white = [white_density(triad, noise.rate) ** 2 for triad in (noise.accelerometer, noise.gyroscope)]
    floor = [
        wander_sigma(triad, dwell, max(span, dwell)) ** 2 for triad in (noise.accelerometer, noise.gyroscope)
    ]
    edge = np.maximum(
        1,
        np.minimum(EDGE_WINDOW * recording.rate, 0.5 * (holds[:, 1] - holds[:, 0])).round().astype(int),
    )
    start, stop = np.full(len(holds), -1), np.full(len(holds), -1)
    start[:-1], stop[:-1] = holds[:-1, 1] - 1, holds[1:, 0] + 1
    return HoldsAndTurns(
        time=recording.time,
        raw_force=recording.specific_force,
        raw_rate=recording.angular_rate,
        force_mean=range_means(recording.specific_force, holds) if like is None else like.force_mean,
        force_covariance=(white[0] / duration + floor[0])[:, None, None] * np.eye(3),
        rate_mean=range_means(recording.angular_rate, holds) if like is None else like.rate_mean,
        rate_covariance=(white[1] / duration + floor[1])[:, None, None] * np.eye(3),
        hold_samples=count,
        head=np.column_stack([holds[:, 0], holds[:, 0] + edge]),
        tail=np.column_stack([holds[:, 1] - edge, holds[:, 1]]),
        turn_start=start,
        turn_stop=stop,
        force_sample_variance=np.full(3, white[0] * recording.rate),
        rate_random_walk=np.full(3, white[1]),
        force_floor=np.full(3, floor[0]),
        rate_floor=np.full(3, floor[1]),
    )


def _spins(played: PlayedPlan, base: HoldsAndTurns) -> list[TableRotation]:
    """The rotations whose angle is read, as the estimator takes them; others are turns like any other."""
    made: list[TableRotation] = []
    time, edges = played.recording.time, played.truth.hold_edges
    for row, spin in enumerate(played.truth.spins):
        step = played.truth.steps[spin.step]
        assert isinstance(step, SpinStep)
        before = int(np.searchsorted(edges[:, 1], spin.start + 1e-6)) - 1
        if step.angle is None or before < 0 or before + 1 >= len(edges):
            continue
        made.append(
            table_rotation(
                base,
                before,
                int(np.searchsorted(time, spin.start + EDGE)),
                int(np.searchsorted(time, spin.stop - EDGE)),
                spin.rate * np.asarray(spin.axis_b),
                angle=spin.angle,
                angle_sigma=max(step.angle_sigma, EXACT_ANGLE),
                row=row,
                name=step.name or f"rotation {row + 1}",
            )
        )
    return made
