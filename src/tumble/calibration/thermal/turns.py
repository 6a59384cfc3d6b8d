"""The gyros' matrix as a function of temperature, from turns between the rests of a thermal test.

The rests tell the accelerometers, the gyros' biases and their g-sensitivity at every temperature. With these taken
off, the angular rate of a turn is still off by the gyros' matrix, nominal so far:

    shown = (I + D(T)) true,   D(T) = D0 + sum_k D_k f_k(T)

The specific force at the end of a rest, carried over the turn by the gyros, is the specific force at the beginning
of the next rest (two equations a turn, as in `turn_conditions`). D has all nine elements: in the frame of the
accelerometers they are the gyros' scale factors, their non-orthogonalities, and the rotation between the triads.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Square, Table, Vectors, range_means
from tumble.attitude import integrate_turns
from tumble.attitude.integration import average_at_edge
from tumble.calibration.checks.snooping import Kind, Outlier, balance, wald_test
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.turn import HoldsAndTurns, tangent_bases
from tumble.calibration.thermal.layout import ENTRIES, Layout
from tumble.earth import EARTH_RATE
from tumble.errors import ConvergenceError, ObservabilityError, SegmentationError
from tumble.estimation import Adjustment, Linearisation, adjust
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import Timeline, observe_holds
from tumble.sensor.thermal import TemperatureBasis, ThermalModel

# Turns of fewer samples are not integrated well; smaller ones tell no scale factor.
LEAST_SAMPLES, LEAST_ANGLE = 20, np.radians(20.0)
# Turns a function of temperature: two equations each, for nine elements.
TURNS_PER_FUNCTION = 9
# Turns are within so many °C of the rests that are used.
BEYOND = 2.0
# A bend of the matrix is taken where it is likelier than not: left out, it would be in no uncertainty.
EASY_ALARM = 0.5
MOST_FUNCTIONS = 2


@dataclass(frozen=True, slots=True)
class TurnedMatrix:
    """The gyros' matrix, with what it shares with the other unknowns.

    Attributes
    ----------
    nominal : (3, 3) D0.
    changes : (functions, 3, 3) D_k.
    covariance : of both, row by row.
    shared : (9 + 9 functions, shared unknowns) covariance with those of the rests.
    turns, outliers : how many were used, and left out.
    sigma0 : of unit weight with the noise of the edges and of the integration alone.
    """

    nominal: AnyArray
    changes: AnyArray
    covariance: Square
    shared: Table
    turns: int
    outliers: list[Outlier]
    sigma0: float


@dataclass(frozen=True, slots=True)
class _Turns:
    """Turns of a recording that the rests' model has corrected.

    Attributes
    ----------
    time, force, rate : of the samples, s and SI.
    start, stop : (turns,) sample ranges.
    tail, head : (turns, 3) specific force at the beginning and at the end, each in its own body frame.
    functions : (turns, functions + 2) of temperature, rate of temperature, hysteresis.
    noise : (turns,) rad² of each of the two components: edges, angle random walk, wandering bias.
    """

    time: Series
    force: Vectors
    rate: Vectors
    start: np.ndarray
    stop: np.ndarray
    tail: Vectors
    head: Vectors
    functions: Table
    noise: Series


class _TurnEquations:
    """`Conditions` of turns for D0 and D_k."""

    def __init__(self, turns: _Turns, count: int, gravity: float) -> None:
        self.turns, self.count, self.gravity = turns, count, gravity
        self.extra = 0.0
        self.active = np.ones((turns.start.size, 2), dtype=bool)
        # How the last linearisation's rows move with the specific force at both ends, and with the rates.
        self.by_tail = self.by_head = np.zeros((turns.start.size, 2, 3))
        self.by_bias = np.zeros((turns.start.size, 2, 3))
        self.angle = np.zeros(turns.start.size)

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters`."""
        turns, size = self.turns, self.turns.start.size
        weights = np.column_stack([np.ones(size), turns.functions[:, : self.count]])
        changes = np.eye(3) + np.einsum(
            "tk,kij->tij", weights, parameters.reshape(self.count + 1, 3, 3), optimize=True
        )
        inverse: Matrices = np.asarray(np.linalg.inv(changes), dtype=np.float64)
        C_se, sums = _integrated(turns, inverse)
        f_e = np.einsum("tab,tb->ta", C_se, turns.head)
        E = np.swapaxes(tangent_bases(turns.tail), 1, 2) / self.gravity
        misclosure = np.einsum("tga,ta->tg", E, f_e - turns.tail)
        by_rotation = -E @ _skews(f_e)
        moves = -np.einsum("tga,tabj,tbi->tgij", by_rotation, sums[..., :3], inverse, optimize=True)
        design = np.einsum("tk,tgij->tgkij", weights, moves).reshape(size, 2, -1)
        self.by_tail, self.by_head = -E, E @ C_se
        self.by_bias = -np.einsum("tga,tab,tbi->tgi", by_rotation, sums[..., 3], inverse, optimize=True)
        self.angle = np.arccos(np.clip(0.5 * (np.trace(C_se, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
        covariance = (turns.noise + self.extra)[:, None, None] * np.eye(2)
        return Linearisation.masked(misclosure, design, covariance, self.active)

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Edges are known so well that a second order in their noise is nothing."""


def estimate_turned_matrix(
    recording: Recording,
    timeline: Timeline,
    model: ThermalModel,
    values: Series,
    covariance: Square,
    layout: Layout,
    *,
    factors: tuple[float, float],
    gravity: float,
    wander: float,
) -> TurnedMatrix | None:
    """Return the gyros' matrix over temperature; None where there are too few turns for it.

    Parameters
    ----------
    recording, timeline : raw samples, rests and turns.
    model : of the rests, raw units, the gyros' matrix nominal.
    values, covariance, layout : of the rests' adjustment, near SI.
    factors : near SI per raw unit.
    gravity : m/s².
    wander : (rad/s)², variance of the gyros' biases beside what temperature does.
    """
    try:
        turns = _corrected_turns(recording, timeline, model, wander, factors[1])
    except (ObservabilityError, SegmentationError):
        return None
    if turns is None:
        return None
    first = _TurnEquations(turns, 0, gravity)
    first.linearise(np.zeros(9))
    turns = _only(turns, first.angle > LEAST_ANGLE)
    fitted = _fitted(turns, model.basis, gravity)
    if fitted is None:
        return None
    equations, adjustment, outliers, alone = fitted
    # What is not known of the rests' model moves all turns together.
    moved = _by_shared(equations, values, layout, turns.functions)
    active = equations.active.reshape(-1)
    weight = 1.0 / np.repeat(turns.noise + equations.extra, 2)[active]
    design = adjustment.linearisation.design.reshape(-1, adjustment.parameters.size)[active]
    pulled = -adjustment.cofactor @ (design * weight[:, None]).T @ moved.reshape(-1, moved.shape[2])[active]
    spread = covariance[: layout.shared, : layout.shared]
    count = equations.count
    found = adjustment.parameters.reshape(count + 1, 3, 3)
    return TurnedMatrix(
        found[0],
        found[1:],
        adjustment.cofactor + pulled @ spread @ pulled.T,
        pulled @ spread,
        int(np.count_nonzero(equations.active[:, 0])),
        outliers,
        alone,
    )


def _fitted(
    turns: _Turns, basis: TemperatureBasis, gravity: float
) -> tuple[_TurnEquations, Adjustment, list[Outlier], float] | None:
    """Adjust with as many functions as the turns tell and want; None if they do not tell a matrix at all."""
    polynomial = basis.kind == "polynomial"
    counts = list(range(min(MOST_FUNCTIONS, basis.size) + 1)) if polynomial else [0, basis.size]
    best = None
    for count in counts:
        if turns.start.size < TURNS_PER_FUNCTION * (count + 1):
            break
        try:
            fitted = _adjusted(turns, count, gravity)
        except (ObservabilityError, ConvergenceError):
            break
        if count > 1 and polynomial and best is not None:
            adjustment, last = fitted[1], slice(9 * count, 9 * count + 9)
            test = wald_test(
                "order",
                adjustment.parameters[last],
                adjustment.cofactor[last, last],
                max(adjustment.redundancy, 1),
                EASY_ALARM,
            )
            if not test.kept:
                break
        best = fitted
    return best


def _adjusted(
    turns: _Turns, count: int, gravity: float
) -> tuple[_TurnEquations, Adjustment, list[Outlier], float]:
    equations = _TurnEquations(turns, count, gravity)
    values = [np.zeros(9 * (count + 1))]

    def solve(extra: dict[str, float], active: np.ndarray, *, once: bool) -> Adjustment:
        equations.extra, equations.active = extra["turn"], active
        adjustment = adjust(equations, values[-1], once=once)
        values.append(adjustment.parameters)
        return adjustment

    active = equations.active.copy()
    alone = solve({"turn": 0.0}, active, once=False).sigma0
    balanced = balance(solve, [Kind("turn", slice(0, 2))], active, extra={"turn": 0.0})
    return equations, balanced.adjustment, balanced.outliers, alone


def _corrected_turns(
    recording: Recording, timeline: Timeline, model: ThermalModel, wander: float, factor: float
) -> _Turns | None:
    """Return the turns between rests, everything but the gyros' matrix taken off."""
    if recording.temperature is None:
        return None
    data = gather(recording, timeline, observe_holds(recording, timeline))
    path = model.path(recording.time, recording.temperature)
    force, rate = model.correct_along(path, data.time, data.raw_force, data.raw_rate, outside="hold")
    if force is None or rate is None:
        return None
    before = np.flatnonzero(data.turn_start >= 0)
    start, stop = data.turn_start[before], data.turn_stop[before]
    middle = (start + stop) // 2
    low, high = model.span_celsius
    celsius = path.temperature[middle]
    used = (stop - start >= LEAST_SAMPLES) & (celsius > low - BEYOND) & (celsius < high + BEYOND)
    before, start, stop, middle = before[used], start[used], stop[used], middle[used]
    if before.size < TURNS_PER_FUNCTION:
        return None
    functions = np.column_stack(
        [model.basis.values(path.temperature[middle]), path.rate[middle], path.hysteresis[middle]]
    )
    duration = data.time[stop - 1] - data.time[start]
    return _Turns(
        data.time,
        force,
        rate,
        start,
        stop,
        _edge(data.time, force, rate, data.tail[before], "last"),
        _edge(data.time, force, rate, data.head[before + 1], "first"),
        functions,
        _noise(data, model, before, duration, wander, factor),
    )


def _noise(
    data: HoldsAndTurns,
    model: ThermalModel,
    before: np.ndarray,
    duration: Series,
    wander: float,
    factor: float,
) -> Series:
    """Return (turns,) rad² of each component, a mean over the axes."""
    triad = model.reference.accelerometer
    assert triad is not None
    scale = float(np.mean(np.abs(np.diag(triad.matrix))))
    gravity = 9.80665
    tail = (data.tail[before, 1] - data.tail[before, 0]).astype(float)
    head = (data.head[before + 1, 1] - data.head[before + 1, 0]).astype(float)
    sample = float(np.mean(data.force_sample_variance)) / (scale * gravity) ** 2
    walk = float(np.mean(data.rate_random_walk)) * factor**2
    steady = (wander + (EARTH_RATE / np.sqrt(3.0)) ** 2) * duration**2
    return np.asarray(sample * (1.0 / tail + 1.0 / head) + walk * duration + steady, dtype=np.float64)


def _edge(time: Series, force: Vectors, rate: Vectors, windows: np.ndarray, edge: str) -> Vectors:
    """Return (turns, 3) the specific force at the edge of a rest, samples turned there by the gyros."""
    means = range_means(rate, windows)
    return average_at_edge(
        time,
        rate,
        force,
        windows[:, 0],
        windows[:, 1],
        edge=edge,
        gyro_inverse=np.eye(3),
        gyro_bias=means,
        force_inverse=np.eye(3),
        force_bias=np.zeros(3),
    )


def _integrated(turns: _Turns, inverse: Matrices) -> tuple[Matrices, AnyArray]:
    """Return the rotations of the turns and their sums, each with its own inverse."""
    C, sums = np.empty((turns.start.size, 3, 3)), np.empty((turns.start.size, 3, 3, 7))
    for k, (first, last) in enumerate(zip(turns.start.tolist(), turns.stop.tolist(), strict=True)):
        part = slice(first, last)
        one = integrate_turns(
            turns.time[part],
            turns.rate[part],
            turns.force[part],
            np.array([0]),
            np.array([last - first]),
            gyro_inverse=inverse[k],
            gyro_bias=np.zeros(3),
            force_inverse=np.eye(3),
            force_bias=np.zeros(3),
        )
        C[k], sums[k] = one.C_start_end[0], one.sums[0]
    return C, sums


def _by_shared(equations: _TurnEquations, values: Series, layout: Layout, functions: Table) -> AnyArray:
    """Return (turns, 2, shared): how the equations move with the unknowns of the rests."""
    turns, terms = equations.turns, layout.terms
    size, count = terms.basis.size, layout.entries
    used = terms.matrix_functions
    own = np.zeros((functions.shape[0], count))
    own += values[layout.places["M0"]]
    if used:
        own += functions[:, :used] @ values[layout.places["M"]].reshape(used, count)
    matrices = np.repeat(np.eye(3)[None], functions.shape[0], axis=0)
    for k, (i, j) in enumerate(ENTRIES[:count]):
        matrices[:, i, j] = own[:, k]
    inverse = np.asarray(np.linalg.inv(matrices), dtype=np.float64)
    moved = np.zeros((functions.shape[0], 2, layout.shared))
    for force, by in ((turns.tail, equations.by_tail), (turns.head, equations.by_head)):
        towards = -by @ inverse
        for axis in range(3):
            for name, weight in _columns("", size, functions, terms.rate, terms.hysteresis):
                for k in range(weight.shape[1]):
                    moved[:, :, layout.places[name].start + 3 * k + axis] += (
                        towards[:, :, axis] * weight[:, k, None]
                    )
        for k, (i, j) in enumerate(ENTRIES[:count]):
            change = towards[:, :, i] * force[:, j, None]
            moved[:, :, layout.places["M0"].start + k] += change
            for f in range(used):
                moved[:, :, layout.places["M"].start + f * count + k] += change * functions[:, f, None]
    for axis in range(3):
        for name, weight in _columns("g", size, functions, terms.rate, terms.hysteresis):
            for k in range(weight.shape[1]):
                moved[:, :, layout.places[name].start + 3 * k + axis] += (
                    equations.by_bias[:, :, axis] * weight[:, k, None]
                )
    return moved


def _columns(
    mark: str, size: int, functions: Table, with_rate: bool, with_loop: bool
) -> list[tuple[str, Table]]:
    """Return the kinds of a triad's biases with what multiplies each."""
    found = [
        (f"{mark}b0", np.ones((functions.shape[0], 1))),
        (f"{mark}b", np.ascontiguousarray(functions[:, :size])),
    ]
    if with_rate:
        found.append((f"{mark}r", np.ascontiguousarray(functions[:, size : size + 1])))
    if with_loop:
        found.append((f"{mark}h", np.ascontiguousarray(functions[:, size + 1 :])))
    return found


def _only(turns: _Turns, keep: np.ndarray) -> _Turns:
    return _Turns(
        turns.time,
        turns.force,
        turns.rate,
        turns.start[keep],
        turns.stop[keep],
        turns.tail[keep],
        turns.head[keep],
        turns.functions[keep],
        turns.noise[keep],
    )


def _skews(vectors: Vectors) -> Matrices:
    """Return (items, 3, 3) cross-product matrices."""
    S = np.zeros((vectors.shape[0], 3, 3))
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    return S - np.swapaxes(S, 1, 2)
