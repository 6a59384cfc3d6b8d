"""A simulated recording: a motion seen by a sensor with errors and noise, and the truth beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.counting import counted, part
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.protocol import Step
from tumble.recording import Recording, exact_clock
from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.simulation.fixtures import PlayedProtocol, TrueRotation, TrueSpin
from tumble.simulation.grades import Grade
from tumble.simulation.motion import Motion
from tumble.simulation.noise import TriadNoise, convert_to_digital, simulate_noise, simulate_wander
from tumble.simulation.sampling import (
    Imperfections,
    count_increments,
    drop_samples,
    scatter_instants,
    scatter_stamps,
)
from tumble.simulation.two_axis import FixtureErrors

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Distort = Callable[[Vectors, Vectors], tuple[Vectors, Vectors]]
"""True (specific force, angular rate) in b, m/s² and rad/s, to raw: `ImuModel.distort` is one."""

# Samples whose motion is worked out at a time: some 60 MB of intermediate results.
BLOCK = 100_000


@dataclass(frozen=True)
class Truth:
    """What was simulated.

    Attributes
    ----------
    hold_edges : (holds, 2) s on the recording's clock, from where each hold begins to where it ends.
    quaternions_nb : (holds, 4) attitude at each hold's beginning, scalar last.
    specific_force_b, angular_rate_ib_b : (holds, 3) true means over the samples that lie wholly in each
        hold, m/s², rad/s; NaN for a hold of which no sample was recorded.
    force_wander, rate_wander : (holds, 3) raw, how far each bias had wandered in each hold (its mean).
    mean_wander : (2, 3) raw, the same of the accelerometers and of the gyros over the whole recording.
    model : the sensor's errors, raw units as in the recording, where they were drawn or a protocol was played.
    site : gravity and Earth rate.
    step_edges : (steps, 2) s, when each step of the protocol began and ended, where one was played; a
        spin without its ramps.
    hold_steps : for each hold the index of the protocol's step; None for a rest that no step asked for.
    spins : the true rate, axis and angle of each spin of the protocol.
    steps : the protocol's steps with what the table's display showed (see `PlayedProtocol`).
    counts_per_si : raw counts per m/s² and per rad/s, or None where raw units are SI.
    rotations : of a two-axis fixture, where one was used.
    fixture : what was wrong with it.
    """

    hold_edges: AnyArray
    quaternions_nb: AnyArray
    specific_force_b: AnyArray
    angular_rate_ib_b: AnyArray
    force_wander: AnyArray
    rate_wander: AnyArray
    mean_wander: AnyArray
    model: ImuModel | None
    site: Site
    step_edges: AnyArray = field(default_factory=lambda: np.zeros((0, 2)))
    hold_steps: tuple[int | None, ...] = ()
    spins: tuple[TrueSpin, ...] = ()
    steps: tuple[Step, ...] = ()
    counts_per_si: tuple[float, float] | None = None
    rotations: tuple[TrueRotation, ...] = ()
    fixture: FixtureErrors | None = None

    def of_played(self, played: PlayedProtocol, model: ImuModel | None) -> Truth:
        """Return the truth of a recording in which a protocol was played by a unit of this model."""
        return replace(
            self,
            model=model,
            step_edges=played.step_edges,
            hold_steps=played.hold_steps,
            spins=played.spins,
            steps=played.steps,
            rotations=played.rotations,
        )

    @property
    def rotations_nb(self) -> Rotation:
        """Attitude at each hold's beginning."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self.quaternions_nb)


def simulate_recording(
    motion: Motion,
    rate: float,
    rng: np.random.Generator,
    *,
    site: Site,
    grade: Grade | None = None,
    distort: Distort | None = None,
    imperfections: Imperfections | None = None,
) -> tuple[Recording, Truth]:
    """Record a motion with a simulated unit.

    A gyro sample is the mean rate over its sampling interval, exactly as the attitude demands; an
    accelerometer sample is the specific force at the interval's middle. The stamp is the middle.

    Parameters
    ----------
    motion : what is done to the unit.
    rate : Hz.
    rng : source of all numbers; the same state gives the same recording bit for bit.
    site : gravity; Earth rate where it has a latitude.
    grade : noise, converter and the spread of errors; None for a unit without noise.
    distort : true to raw; None draws a model of the grade (or is exact, without a grade). With it,
        noise and converter act on the raw numbers in the grade's units: raw units are then SI.
    imperfections : what the recording chain does beside: increments, scattered instants and stamps, lost
        samples.

    Raises
    ------
    UsageError
        If the rate is not positive, so low that there is no sample, or so low that the unit turns by half
        a turn within one.
    """
    chain = imperfections or Imperfections()
    length = motion.duration
    if not 0.0 < rate < np.inf or length * rate < 1.0:
        raise UsageError(
            f"A recording of {length:g} s at {rate:g} Hz has no sample: give a higher sampling rate."
        )
    regular = np.arange(int(np.floor(length * rate)) + 1) / rate
    middle = 0.5 * (regular[:-1] + regular[1:])
    edges = scatter_instants(regular, rate, chain.sampling_jitter, rng)
    with part(0.0, 0.3):
        force, angular_rate = _sample(motion, edges, site)
    model = grade.simulate_model(rng) if grade is not None and distort is None else None
    distort = model.distort if model is not None else distort
    with part(0.3, 0.5):
        raw_force, raw_rate = (force, angular_rate) if distort is None else distort(force, angular_rate)
    force_wander, rate_wander = np.zeros_like(raw_force), np.zeros_like(raw_rate)
    if grade is not None:
        with part(0.5, 0.7):
            raw_force, force_wander = _sensed(raw_force, grade.accelerometer.noise, rate, rng)
        with part(0.7, 1.0):
            raw_rate, rate_wander = _sensed(raw_rate, grade.gyroscope.noise, rate, rng)
    raw_force = count_increments(raw_force, rate, chain.velocity_increment)
    raw_rate = count_increments(raw_rate, rate, chain.angle_increment)
    stamps = scatter_stamps(middle, rate, chain.jitter, rng)
    keep = drop_samples(len(middle), chain.dropped, chain.burst, rng)
    recording = Recording(
        time=stamps[keep],
        specific_force=raw_force[keep],
        angular_rate=raw_rate[keep],
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=rate,
        gaps=_gaps(keep),
        said_clock=exact_clock(rate),
    )
    return recording, _truth(motion, edges, (force, angular_rate, force_wander, rate_wander), model, site)


def _sample(motion: Motion, edges: Series, site: Site) -> tuple[Vectors, Vectors]:
    """Return specific force at each interval's middle and mean rate over it, a block of samples at a time."""
    samples = len(edges) - 1
    force, angular_rate = np.empty((samples, 3)), np.empty((samples, 3))
    blocks = range(0, samples, BLOCK)
    for first in counted(blocks, len(blocks)):
        ends = edges[first : first + BLOCK + 1]
        part = slice(first, first + len(ends) - 1)
        force[part] = motion.specific_force_b(0.5 * (ends[:-1] + ends[1:]), site)
        angular_rate[part] = motion.mean_angular_rate_ib_b(ends, site)
    return force, angular_rate


def _sensed(
    raw: Vectors, noise: TriadNoise, rate: float, rng: np.random.Generator
) -> tuple[Vectors, AnyArray]:
    """Return the raw signal with noise, through the converter, and how the bias wandered."""
    white = simulate_noise(replace(noise, bias_instability=0.0, rate_random_walk=0.0), len(raw), rate, rng)
    wander = simulate_wander(noise, len(raw), rate, rng)
    return convert_to_digital(raw + white + wander, noise), wander


def _gaps(keep: np.ndarray) -> tuple[int, ...]:
    index = np.flatnonzero(keep)
    return tuple(int(i) for i in np.flatnonzero(np.diff(index) > 1) + 1)


def _truth(
    motion: Motion,
    ends: Series,
    signals: tuple[AnyArray, AnyArray, AnyArray, AnyArray],
    model: ImuModel | None,
    site: Site,
) -> Truth:
    edges = motion.hold_edges
    # A sample that ends with the hold belongs to it, whatever round-off says.
    slack = 1e-9 * (motion.duration + 1.0)
    firsts: list[int] = np.searchsorted(ends, edges[:, 0] - slack).tolist()
    lasts: list[int] = (np.searchsorted(ends, edges[:, 1] + slack, side="right") - 1).tolist()

    def means(signal: AnyArray) -> AnyArray:
        rows = np.full((len(edges), 3), np.nan)
        for row, first, last in zip(rows, firsts, lasts, strict=True):
            if last > first:
                row[:] = signal[first:last].mean(axis=0)
        return rows

    force, angular_rate, force_wander, rate_wander = (means(signal) for signal in signals)
    return Truth(
        *(edges, motion.hold_quaternions_nb, force, angular_rate, force_wander, rate_wander),
        np.stack([wander.mean(axis=0) for wander in signals[2:]]),
        model,
        site,
    )
