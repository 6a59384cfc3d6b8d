"""The steps of a protocol aligned with what was found, in order, with gaps on both sides and with repetitions.

What a recording and a protocol have in common: holds and spins in time order, and how alike two are.

Which way is up in each hold is taken from raw specific forces whose scale and centre nobody knows, roughly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Matrix, Series, Table, Vector, Vectors
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, Step
from tumble.recording import Recording, fit_sphere
from tumble.records import dataclass
from tumble.segmentation.observations import HoldMeans
from tumble.segmentation.timeline import Hold, Timeline
from tumble.segmentation.turns import FoundSpin, SpinSearch, find_spins, judge_spin
from tumble.units import angular_rate_factor, specific_force_factor

# What rough scales, misalignments and mounting add to a pose's own uncertainty, per axis.
POSE_FLOOR = np.radians(3.0)
SPIN_AXIS_SIGMA = np.radians(8.0)
# Of the logarithm of a spin's rate: far beyond a scale error, far below two neighbouring rates of a test.
RATE_SIGMA = 0.08
GATE_SIGMAS = 4.0
# Costs in units of half a chi-square: a gap on both sides (12) is a misfit of 4.9 sigma.
GAP, REPETITION, NO_POSE, WRONG_WAY = 6.0, 3.0, 0.5, 8.0
SAME_DIRECTION = np.radians(5.0)


@dataclass(frozen=True)
class Event:
    """A hold or a spin that was found: samples `start` up to `stop`.

    `hold` is its index in the timeline, None for a spin; `spin` is the other way round. `beside` is the
    hold next to a spin, whose specific force says what is up in it; None without any. `rate` is the mean
    raw rate of a spin without the bias of the holds beside it.
    """

    start: int
    stop: int
    hold: int | None = None
    spin: FoundSpin | None = None
    beside: int | None = None
    rate: Vector | None = None


def find_events(
    protocol: Protocol, recording: Recording, timeline: Timeline, means: HoldMeans
) -> list[Event]:
    """Return the holds and spins of a recording in time order.

    Parameters
    ----------
    protocol : spins are looked for where it says that there are any, and in the intervals that it names.
    recording, timeline, means : the samples, and the holds found in them.
    """
    events = [Event(hold.start, hold.stop, number) for number, hold in enumerate(timeline.holds)]
    if any(isinstance(step, SpinStep) for step in protocol.steps):
        spins = find_spins(recording, timeline)
        for spin in _named_spins(protocol, recording, timeline):
            if not any(s.start < spin.stop and spin.start < s.stop for s in spins):
                # the steadiest spin of a recording that never rests was taken for a hold
                events = [e for e in events if not (e.start < spin.stop and spin.start < e.stop)]
                spins.append(spin)
        events += [_spin_event(recording, timeline, means, spin) for spin in spins]
    return sorted(events, key=lambda event: event.start)


def _named_spins(protocol: Protocol, recording: Recording, timeline: Timeline) -> list[FoundSpin]:
    """The longest plateau in each interval that the protocol gives to a single spin."""
    shared = [step.interval for step in protocol.steps]
    named = [
        step.interval
        for step in protocol.steps
        if isinstance(step, SpinStep) and step.interval is not None and shared.count(step.interval) == 1
    ]
    if not named or recording.angular_rate is None:
        return []
    search = SpinSearch.of(recording, timeline)
    spins: list[FoundSpin] = []
    for first, last in named:
        start, stop = (int(i) for i in np.searchsorted(recording.time, [first, last]))
        plateaus = search.plateaus(start, stop)
        if plateaus:
            longest = max(plateaus, key=lambda plateau: plateau[1] - plateau[0])
            spins.append(judge_spin(recording, timeline, FoundSpin(*longest, None)))
    return spins


def _spin_event(recording: Recording, timeline: Timeline, means: HoldMeans, spin: FoundSpin) -> Event:
    assert recording.angular_rate is not None
    rate = recording.angular_rate[spin.start : spin.stop].mean(axis=0)
    gaps = np.array([max(hold.start - spin.stop, spin.start - hold.stop) for hold in timeline.holds])
    beside = int(np.argmin(gaps)) if len(gaps) else None
    if beside is not None and means.angular_rate is not None:
        rate = rate - means.angular_rate[beside]
    return Event(spin.start, spin.stop, None, spin, beside, np.asarray(rate, dtype=np.float64))


@dataclass(frozen=True)
class RoughScale:
    """One centre and one scale for a triad: ``raw = centre + scale * direction``, raw units.

    Scale factors that differ by 10 % among the axes turn a direction by 3 degrees at most.
    """

    centre: Vector
    scale: float

    def directions(self, raw: Vectors) -> Vectors:
        """Return the directions of raw specific forces as unit vectors.

        Parameters
        ----------
        raw : (holds, 3) raw units.
        """
        away = raw - self.centre
        return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)


def scale_of_units(raw: Vectors) -> RoughScale:
    """Return the scale of specific forces in physical units, whose centre is zero within half a g."""
    return RoughScale(np.zeros(3), float(np.median(np.linalg.norm(raw, axis=1))))


def scale_of_sphere(raw: Vectors) -> RoughScale | None:
    """Return the sphere through the specific forces of poses that are not all in one plane.

    None where they do not determine one.
    """
    sphere = fit_sphere(raw, 4, 0.15)
    return None if sphere is None else RoughScale(*sphere)


def scale_of_poses(raw: Vectors, up_b: Vectors) -> RoughScale | None:
    """Return the centre and scale that bring raw specific forces nearest to known directions.

    None where the directions are too alike to tell a centre from a scale, or a scale comes out negative.

    Parameters
    ----------
    raw, up_b : (holds, 3) raw units, and unit vectors.
    """
    if len(raw) < 2:
        return None
    mean_raw, mean_up = raw.mean(axis=0), up_b.mean(axis=0)
    spread = float(np.sum((up_b - mean_up) ** 2))
    if spread < 0.5:
        return None
    scale = float(np.sum((raw - mean_raw) * (up_b - mean_up))) / spread
    return RoughScale(mean_raw - scale * mean_up, scale) if scale > 0.0 else None


def pose_of(step: Step) -> Pose | None:
    """Return what is known of the attitude in a step; None for a step that is no hold, or anyhow."""
    return step.pose if isinstance(step, HoldStep) else None


@dataclass(frozen=True)
class Reading:
    """How raw numbers are taken: turned axes, a rough scale of the accelerometer, and one of the gyro.

    Attributes
    ----------
    specific_force : (holds, 3) raw means in the axes as they are taken; None without an accelerometer.
    scale : of the specific force; None without one.
    gyro : signed permutation that is applied to the rates.
    rate_scale : raw units per rad/s; None where the rates are not compared.
    """

    specific_force: Vectors | None
    scale: RoughScale | None
    gyro: Matrix
    rate_scale: float | None

    def up_b(self) -> Vectors | None:
        """Return the measured up direction of each hold; None without an accelerometer."""
        if self.specific_force is None or self.scale is None:
            return None
        return self.scale.directions(self.specific_force)


def costs_of(
    protocol: Protocol, steps: list[int], events: list[Event], reading: Reading, recording: Recording
) -> tuple[Table, Table]:
    """Return what it costs that an event is a step, and that it repeats it: both (steps, events).

    Parameters
    ----------
    protocol, steps : the indices of its holds and spins in the order in which they are expected.
    events : holds and spins that were found.
    reading : how raw numbers are taken.
    recording : for the intervals that steps name.
    """
    up_b = reading.up_b()
    cost = np.full((len(steps), len(events)), np.inf)
    again = np.full((len(steps), len(events)), REPETITION)
    for i, number in enumerate(steps):
        step = protocol.steps[number]
        fitting = _within(step.interval, events, recording)
        if isinstance(step, HoldStep):
            cost[i] = np.where(fitting, _hold_costs(step, events, up_b), np.inf)
            if step.pose is None or up_b is None:
                again[i] = np.where(_like_the_one_before(events, up_b), REPETITION, np.inf)
        elif isinstance(step, SpinStep):
            cost[i] = np.where(fitting, _spin_costs(protocol, number, step, events, reading, up_b), np.inf)
    return cost, again


def _within(
    interval: tuple[float, float] | None, events: list[Event], recording: Recording
) -> npt.NDArray[np.bool_]:
    """Which events have their middle in the interval that a step names."""
    if interval is None:
        return np.ones(len(events), dtype=bool)
    middle = np.array([0.5 * (recording.time[e.start] + recording.time[e.stop - 1]) for e in events])
    return (middle >= interval[0]) & (middle <= interval[1])


def _gated(sigmas: AnyArray | float) -> AnyArray:
    sigmas = np.asarray(sigmas, dtype=float)
    return np.where(sigmas <= GATE_SIGMAS, 0.5 * sigmas**2, np.inf)


def angles_from(directions: Vectors, axis: Vector) -> Series:
    """Return the angle of each unit vector from a unit vector, rad.

    Parameters
    ----------
    directions, axis : (rows, 3) and (3,) unit vectors.
    """
    return np.arctan2(np.linalg.norm(np.cross(directions, axis), axis=1), directions @ axis)


def _hold_costs(step: HoldStep, events: list[Event], up_b: Vectors | None) -> Series:
    is_hold = np.array([event.hold is not None for event in events])
    if step.pose is None or up_b is None:
        return np.where(is_hold, NO_POSE, np.inf)
    rows = [event.hold if event.hold is not None else 0 for event in events]
    sigma = float(np.hypot(step.pose.sigma, POSE_FLOOR))
    return np.where(is_hold, _gated(angles_from(up_b[rows], step.pose.up_b) / sigma), np.inf)


def _like_the_one_before(events: list[Event], up_b: Vectors | None) -> npt.NDArray[np.bool_]:
    """Which holds have the specific force of the hold before them; a step without a pose may repeat so."""
    like = np.zeros(len(events), dtype=bool)
    before: int | None = None
    for k, event in enumerate(events):
        if event.hold is None:
            continue
        if before is not None and up_b is not None:
            like[k] = angles_from(up_b[[event.hold]], up_b[before])[0] < SAME_DIRECTION
        before = event.hold
    return like


def _spin_costs(
    protocol: Protocol,
    number: int,
    step: SpinStep,
    events: list[Event],
    reading: Reading,
    up_b: Vectors | None,
) -> Series:
    found = [k for k, event in enumerate(events) if event.rate is not None]
    cost = np.full(len(events), np.inf)
    if not found:
        return cost
    rates = np.array([events[k].rate for k in found]) @ reading.gyro.T
    lengths = np.maximum(np.linalg.norm(rates, axis=1), 1e-300)
    total = np.zeros(len(found))
    if reading.rate_scale is not None:
        sigma = float(np.hypot(RATE_SIGMA, step.rate_sigma))
        excess: Series = np.log(lengths / reading.rate_scale / abs(step.rate))
        # a saturated rate is at least what is seen
        whole = np.array([(spin := events[k].spin) is None or spin.usable for k in found])
        off: Series = np.where(whole, np.abs(excess), np.maximum(excess, 0.0))
        total += _gated(off / sigma)
    axes = [spin_axis(protocol, number, events[k], up_b) for k in found]
    if all(axis is not None for axis in axes):
        along = np.sum(rates * np.array(axes), axis=1) / lengths * np.sign(step.rate)
        angle = np.arccos(np.clip(np.abs(along), 0.0, 1.0))
        total += _gated(angle / SPIN_AXIS_SIGMA) + np.where(along < 0.0, WRONG_WAY, 0.0)
    cost[found] = total
    return cost


def spin_axis(protocol: Protocol, number: int, event: Event, up_b: Vectors | None) -> Vector | None:
    """Return the axis in b about which a spin's rate counts, as far as it is known.

    Parameters
    ----------
    protocol, number : the step, a spin. Without an axis of its own it turns about the vertical: that is
        what the accelerometer saw in the hold beside it, or without one the pose of the hold before.
    event : the spin that was found.
    up_b : (holds, 3) measured up directions.
    """
    step = protocol.steps[number]
    assert isinstance(step, SpinStep)
    if step.axis_b is not None:
        return step.axis_b / np.linalg.norm(step.axis_b)
    if up_b is not None and event.beside is not None:
        return up_b[event.beside]
    for earlier in protocol.steps[number::-1]:
        if isinstance(earlier, HoldStep):
            return None if earlier.pose is None else earlier.pose.up_b
    return None


def common_rate_scale(protocol: Protocol, events: list[Event], declared: float | None) -> float | None:
    """Return the raw units per rad/s that bring most spins to a rate of the protocol; None without spins.

    Parameters
    ----------
    protocol, events : what was to be done, and what was found.
    declared : the same as the recording's unit has it: of scales that fit alike, the nearest to it is
        taken; None for counts.
    """
    lengths = np.array([np.linalg.norm(event.rate) for event in events if event.rate is not None])
    rates = np.unique([abs(step.rate) for step in protocol.steps if isinstance(step, SpinStep)])
    lengths = lengths[lengths > 0.0]
    if not lengths.size or not rates.size:
        return None
    candidates = np.unique(np.log(lengths)[:, None] - np.log(rates)[None, :])
    away = np.log(lengths)[None, :, None] - candidates[:, None, None] - np.log(rates)[None, None, :]
    near = np.min(np.abs(away), axis=2)
    score = np.sum(np.exp(-0.5 * (near / RATE_SIGMA) ** 2), axis=1)
    # of scales that fit alike, the one for which the rates that were found are spread as the protocol's
    best = candidates[score > score.max() - 0.05 * len(lengths) - 1e-9]
    usual = float(np.median(np.log(lengths)) - np.median(np.log(rates)))
    middle = usual if declared is None else float(np.log(declared))
    return float(np.exp(best[np.argmin(np.abs(best - middle))]))


def gaps_of(events: list[Event], holds: tuple[Hold, ...]) -> Series:
    """Return what it costs to leave out each event: less for a hold that is far shorter than the others.

    Parameters
    ----------
    events, holds : what was found.
    """
    usual = float(np.median([hold.stop - hold.start for hold in holds]))
    return np.array(
        [GAP if e.hold is None else GAP * min(1.0, 0.5 + (e.stop - e.start) / usual) for e in events]
    )


# Start of the search for a centre from the poses alone: how many holds too many or too few come first.
FIRST_SHIFTS = (0, 1, -1, 2, -2)


def align(
    cost: Table, left_out: Series, skipped: Series, again: Table
) -> tuple[list[tuple[int, int]], float]:
    """Return the cheapest pairs of (step, event) that keep the order of both, and the sum of all costs.

    A step that was done again has several pairs.

    Dynamic programming (Needleman and Wunsch, J. Mol. Biol. 48 (1970) 443) with one addition: an event
    may repeat the step of an earlier event, if only left-out events lie between.

    Parameters
    ----------
    cost : (steps, events) of the event being the step; infinite where it cannot be.
    left_out : (events,) cost of an event that is no step.
    skipped : (steps,) cost of a step that has no event.
    again : (steps, events) cost, on top, of the event repeating the step; infinite to forbid it.
    """
    steps, events = cost.shape
    inf = float("inf")
    costs, more = cost.tolist(), again.tolist()
    omit = [*left_out.tolist()]
    # best[i][j]: first i steps with first j events; held[i][j]: the same with step i - 1 begun
    best = [[0.0] * (events + 1) for _ in range(steps + 1)]
    held = [[inf] * (events + 1) for _ in range(steps + 1)]
    # how each was come by: best by 's'kip, 'o'mit, or 'h'eld; held by 'm'atch, 'a'gain, or 'o'mit
    how_best = [["h"] * (events + 1) for _ in range(steps + 1)]
    how_held = [["m"] * (events + 1) for _ in range(steps + 1)]
    for j in range(1, events + 1):
        best[0][j], how_best[0][j] = best[0][j - 1] + omit[j - 1], "o"
    for i in range(1, steps + 1):
        row, row_more, skip = costs[i - 1], more[i - 1], float(skipped[i - 1])
        best[i][0], how_best[i][0] = best[i - 1][0] + skip, "s"
        for j in range(1, events + 1):
            match = row[j - 1]
            cheapest, how = best[i - 1][j - 1] + match, "m"
            repeated = held[i][j - 1] + match + row_more[j - 1]
            if repeated < cheapest:
                cheapest, how = repeated, "a"
            omitted = held[i][j - 1] + omit[j - 1]
            if omitted < cheapest:
                cheapest, how = omitted, "o"
            held[i][j], how_held[i][j] = cheapest, how
            how = "h"
            if best[i - 1][j] + skip < cheapest:
                cheapest, how = best[i - 1][j] + skip, "s"
            if best[i][j - 1] + omit[j - 1] < cheapest:
                cheapest, how = best[i][j - 1] + omit[j - 1], "o"
            best[i][j], how_best[i][j] = cheapest, how
    return _traced(how_best, how_held, steps, events), best[steps][events]


def _traced(how_best: list[list[str]], how_held: list[list[str]], i: int, j: int) -> list[tuple[int, int]]:
    """The pairs on the cheapest way, in order."""
    pairs: list[tuple[int, int]] = []
    inside = False
    while i > 0 or j > 0:
        if not inside:
            way = how_best[i][j]
            if way == "s":
                i -= 1
            elif way == "o":
                j -= 1
            else:
                inside = True
            continue
        way = how_held[i][j]
        j -= 1
        if way != "o":
            pairs.append((i - 1, j))
        if way == "m":
            i, inside = i - 1, False
    return pairs[::-1]


def signed_permutations() -> list[np.ndarray]:
    """Return the 48 matrices that swap and reverse axes, the identity first, the likelier ones before others.

    A single reversed axis is likelier than a swap, and a swap than both.
    """
    from itertools import permutations, product

    matrices = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return sorted(matrices, key=lambda m: (float(np.trace(np.abs(m))) != 3.0, int(np.sum(m < 0))))


@dataclass(frozen=True)
class Fit:
    """Which event is which step, in order.

    `pairs` are (step, event); a step that was done again has several. `cost` is the sum of all costs, `reading` how raw
    numbers were taken.
    """

    pairs: list[tuple[int, int]]
    cost: float
    reading: Reading

    def steps(self) -> set[int]:
        """Return the steps that have an event."""
        return {step for step, _ in self.pairs}


@dataclass(frozen=True)
class Case:
    """A protocol beside what was found: what every question about their likeness needs.

    `steps` are the indices of the protocol's holds and spins in the order expected.
    """

    protocol: Protocol
    recording: Recording
    timeline: Timeline
    means: HoldMeans
    steps: list[int]
    events: list[Event]

    def fit(self) -> Fit:
        """Return the best alignment, whatever centre and scale the accelerometer has."""
        reading = Reading(self.means.specific_force, None, np.eye(3), self.rate_scale())
        fits = [self._settled(replace(reading, scale=scale)) for scale in self.scales(reading.specific_force)]
        return min(fits, key=lambda fit: fit.cost)

    def only(self, kind: type[HoldStep] | type[SpinStep]) -> Case:
        """Return the same with the holds alone, or the spins alone.

        Parameters
        ----------
        kind : of step.
        """
        steps = [number for number in self.steps if isinstance(self.protocol.steps[number], kind)]
        return replace(
            self, steps=steps, events=[e for e in self.events if (e.hold is not None) == (kind is HoldStep)]
        )

    def rate_scale(self) -> float | None:
        """Return the raw units per rad/s of the gyro that the spins show; None without spins."""
        factor = angular_rate_factor(self.recording.angular_rate_unit)
        return common_rate_scale(self.protocol, self.events, None if factor is None else 1.0 / factor)

    def name(self, i: int) -> str:
        """Return step `i` of `steps` as the user knows it, such as ``4 (x down)``.

        Parameters
        ----------
        i : index into `steps`.
        """
        number = self.steps[i]
        words = self.protocol.steps[number].name
        return f"{number + 1} ({words})" if words else f"{number + 1}"

    def scales(self, force: Vectors | None) -> list[RoughScale | None]:
        """Return centres and scales of the accelerometer to begin with.

        Parameters
        ----------
        force : (holds, 3) raw means; None without an accelerometer.
        """
        if force is None:
            return [None]
        if specific_force_factor(self.recording.specific_force_unit) is not None:
            return [scale_of_units(force)]
        sphere = scale_of_sphere(force)
        if sphere is not None:
            return [sphere]
        posed = [pose.up_b for i in self.steps if (pose := pose_of(self.protocol.steps[i])) is not None]
        scales: list[RoughScale | None] = []
        for shift in FIRST_SHIFTS:
            first_hold, first_pose = max(shift, 0), max(-shift, 0)
            count = min(len(force) - first_hold, len(posed) - first_pose)
            if count >= 2:
                raw, up_b = force[first_hold:][:count], np.array(posed[first_pose:][:count])
                scales.append(scale_of_poses(raw, up_b))
        return [scale for scale in scales if scale is not None] or [scale_of_units(force)]

    def _settled(self, reading: Reading) -> Fit:
        """Align, find the scale from what was aligned, and align again until nothing changes."""
        fit = self.aligned(reading)
        for _ in range(4):
            scale = self._scale_from(fit)
            if scale is None:
                break
            better = self.aligned(replace(reading, scale=scale))
            if better.cost >= fit.cost:
                break
            fit = better
        return fit

    def aligned(self, reading: Reading) -> Fit:
        """Return the best alignment under a reading of the raw numbers.

        Parameters
        ----------
        reading : scales and axes.
        """
        cost, again = costs_of(self.protocol, self.steps, self.events, reading, self.recording)
        gaps = gaps_of(self.events, self.timeline.holds)
        return Fit(*align(cost, gaps, np.full(len(self.steps), GAP), again), reading)

    def _scale_from(self, fit: Fit) -> RoughScale | None:
        rows: list[int] = []
        up_b: list[np.ndarray] = []
        for i, k in fit.pairs:
            step, hold = self.protocol.steps[self.steps[i]], self.events[k].hold
            if isinstance(step, HoldStep) and step.pose is not None and hold is not None:
                rows.append(hold)
                up_b.append(step.pose.up_b)
        if fit.reading.specific_force is None or not rows:
            return None
        return scale_of_poses(fit.reading.specific_force[rows], np.array(up_b))
