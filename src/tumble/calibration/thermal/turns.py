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
from tumble.attitude.integration import IntegratedTurns, average_at_edge
from tumble.attitude.rotations import skews
from tumble.calibration.checks.snooping import wald_test
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.turn import HoldsAndTurns, tangent_bases
from tumble.calibration.thermal.fit import REFUSED, ThermalFit, balanced
from tumble.earth import EARTH_RATE
from tumble.errors import ObservabilityError, SegmentationError
from tumble.estimation import Adjustment, Conditions, Linearisation
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import Timeline, observe_holds
from tumble.sensor.thermal import ThermalModel

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
    """The gyros' matrix, and what is known of it with the unknowns that the rests share.

    Attributes
    ----------
    matrices : (1 + functions, 3, 3) D0 and D_k.
    values, covariance : of the rests' shared unknowns and of the matrices behind them, row by row.
    turns : how many were used.
    """

    matrices: AnyArray
    values: Series
    covariance: Square
    turns: int


@dataclass(frozen=True, slots=True)
class _Turns:
    """Turns of a recording that the rests' model has corrected.

    Attributes
    ----------
    time, force, rate : of the samples, s and SI.
    start, stop : (turns,) sample ranges.
    tail, head : (turns, 3) specific force at the beginning and at the end, each in its own body frame.
    functions : (turns, functions + 3) one, functions of temperature, its rate, hysteresis.
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


class _TurnEquations(Conditions):
    """`Conditions` of turns for D0 and D_k, as many matrices as `count`."""

    def __init__(self, turns: _Turns, count: int, gravity: float) -> None:
        self.turns, self.count, self.gravity = turns, count, gravity
        self.extra = {"turn": 0.0}
        self.active = np.ones((turns.start.size, 2), dtype=bool)
        # How the last linearisation's rows move with the specific force at both ends, and with the rates.
        self.by_tail = self.by_head = self.by_bias = np.zeros((turns.start.size, 2, 3))

    @property
    def variance(self) -> Series:
        """(turns,) rad² of each component."""
        return self.turns.noise + self.extra["turn"]

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters`."""
        turns, size = self.turns, self.turns.start.size
        weights = turns.functions[:, : self.count]
        changes = np.einsum("tk,kij->tij", weights, parameters.reshape(self.count, 3, 3), optimize=True)
        inverse: Matrices = np.asarray(np.linalg.inv(np.eye(3) + changes), dtype=np.float64)
        # Each turn has an inverse of its own.
        rate = turns.rate.copy()
        for k, part in enumerate(map(slice, turns.start.tolist(), turns.stop.tolist())):
            rate[part] = rate[part] @ inverse[k].T
        made = _integrated(turns.time, rate, turns.force, turns.start, turns.stop)
        C_se, sums = made.C_start_end, made.sums
        f_e = np.einsum("tab,tb->ta", C_se, turns.head)
        E = np.swapaxes(tangent_bases(turns.tail), 1, 2) / self.gravity
        misclosure = np.einsum("tga,ta->tg", E, f_e - turns.tail)
        by_rotation = -E @ skews(f_e)
        moves = -np.einsum("tga,tabj,tbi->tgij", by_rotation, sums[..., :3], inverse, optimize=True)
        design = np.einsum("tk,tgij->tgkij", weights, moves).reshape(size, 2, -1)
        self.by_tail, self.by_head = -E, E @ C_se
        self.by_bias = -np.einsum("tga,tab,tbi->tgi", by_rotation, sums[..., 3], inverse, optimize=True)
        covariance = self.variance[:, None, None] * np.eye(2)
        return Linearisation.masked(misclosure, design, covariance, self.active)

    def by_rests(self, fit: ThermalFit) -> AnyArray:
        """Return (turns, 2, shared): how the equations move with the unknowns of the rests."""
        turns, layout = self.turns, fit.layout
        moved = self.by_bias @ layout.columns("g", turns.functions)
        inverse: Matrices = np.linalg.inv(layout.matrices(fit.values, turns.functions))
        for force, by in ((turns.tail, self.by_tail), (turns.head, self.by_head)):
            moved -= by @ inverse @ layout.columns("", turns.functions, force)
        return moved[:, :, : layout.shared]


def estimate_turned_matrix(
    recording: Recording, timeline: Timeline, model: ThermalModel, fit: ThermalFit, factor: float
) -> TurnedMatrix | None:
    """Return the gyros' matrix over temperature; None where there are too few turns for it.

    Parameters
    ----------
    recording, timeline : raw samples, rests and turns.
    model, fit : of the rests, raw units, the gyros' matrix nominal; and their adjustment near SI.
    factor : near SI per raw unit of the gyros.
    """
    try:
        turns = _corrected_turns(recording, timeline, model, fit, factor)
    except (ObservabilityError, SegmentationError):
        return None
    fitted = None if turns is None else _fitted(turns, fit)
    if fitted is None:
        return None
    equations, adjustment = fitted
    # What is not known of the rests' model moves all turns together.
    moved, active = equations.by_rests(fit), equations.active.reshape(-1)
    weight = 1.0 / np.repeat(equations.variance, 2)[active]
    design = adjustment.linearisation.design.reshape(-1, adjustment.parameters.size)[active]
    pulled = -adjustment.cofactor @ (design * weight[:, None]).T @ moved.reshape(-1, moved.shape[2])[active]
    shared = fit.layout.shared
    spread = fit.covariance[:shared, :shared]
    own = adjustment.cofactor + pulled @ spread @ pulled.T
    return TurnedMatrix(
        adjustment.parameters.reshape(-1, 3, 3),
        np.concatenate([fit.values[:shared], adjustment.parameters]),
        np.block([[spread, (pulled @ spread).T], [pulled @ spread, own]]),
        int(np.count_nonzero(equations.active[:, 0])),
    )


def _fitted(turns: _Turns, fit: ThermalFit) -> tuple[_TurnEquations, Adjustment] | None:
    """Adjust with as many functions as the turns tell and want; None if they do not tell a matrix at all."""
    basis, best = fit.terms.basis, None
    polynomial = basis.kind == "polynomial"
    for count in range(1, min(MOST_FUNCTIONS, basis.size) + 2) if polynomial else (1, basis.size + 1):
        if turns.start.size < TURNS_PER_FUNCTION * count:
            break
        equations = _TurnEquations(turns, count, fit.conditions.gravity)
        try:
            adjustment = balanced(equations, np.zeros(9 * count), {"turn": slice(0, 2)})[0]
        except REFUSED:
            break
        if count > 2 and polynomial:
            estimates, spread = adjustment.parameters[-9:], adjustment.cofactor[-9:, -9:]
            if not wald_test("order", estimates, spread, max(adjustment.redundancy, 1), EASY_ALARM).kept:
                break
        best = equations, adjustment
    return best


def _integrated(
    time: Series, rate: Vectors, force: Vectors, start: np.ndarray, stop: np.ndarray
) -> IntegratedTurns:
    """Integrate samples that are true ones already."""
    none, one = np.zeros(3), np.eye(3)
    return integrate_turns(
        time, rate, force, start, stop, gyro_inverse=one, gyro_bias=none, force_inverse=one, force_bias=none
    )


def _corrected_turns(
    recording: Recording, timeline: Timeline, model: ThermalModel, fit: ThermalFit, factor: float
) -> _Turns | None:
    """Return the turns between rests, everything but the gyros' matrix taken off."""
    if recording.temperature is None:
        return None
    data = gather(recording, timeline, observe_holds(recording, timeline))
    path = model.path(recording.time, recording.temperature)
    force, rate = model.correct_along(path, data.time, data.raw_force, data.raw_rate, outside="hold")
    before = np.flatnonzero(data.turn_start >= 0)
    if force is None or rate is None or not before.size:
        return None
    start, stop = data.turn_start[before], data.turn_stop[before]
    made = _integrated(data.time, rate, force, start, stop)
    angle = np.arccos(np.clip(0.5 * (np.trace(made.C_start_end, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
    celsius = path.temperature[(start + stop) // 2]
    low, high = model.span_celsius
    used = (stop - start >= LEAST_SAMPLES) & (celsius > low - BEYOND) & (celsius < high + BEYOND)
    used &= angle > LEAST_ANGLE
    if np.count_nonzero(used) < TURNS_PER_FUNCTION:
        return None
    before, start, stop = before[used], start[used], stop[used]
    middle = (start + stop) // 2
    # A rate that is doubted alone does nothing in turns.
    speed = path.rate[middle] if fit.terms.rate else 0.0
    return _Turns(
        data.time,
        force,
        rate,
        start,
        stop,
        _edge(data.time, force, rate, data.tail[before], "last"),
        _edge(data.time, force, rate, data.head[before + 1], "first"),
        fit.layout.at_temperature(path.temperature[middle], speed, path.hysteresis[middle]),
        _noise(data, model, before, fit, factor),
    )


def _noise(
    data: HoldsAndTurns, model: ThermalModel, before: np.ndarray, fit: ThermalFit, factor: float
) -> Series:
    """Return (turns,) rad² of each component, a mean over the axes."""
    triad = model.reference.accelerometer
    assert triad is not None
    scale = float(np.mean(np.abs(np.diag(triad.matrix))))
    duration = data.time[data.turn_stop[before] - 1] - data.time[data.turn_start[before]]
    tail, head = (np.diff(ends, axis=1)[:, 0] for ends in (data.tail[before], data.head[before + 1]))
    sample = float(np.mean(data.force_sample_variance)) / (scale * 9.80665) ** 2
    walk = float(np.mean(data.rate_random_walk)) * factor**2
    wander = fit.levels.single["rate"] + fit.levels.flicker["rate"]
    steady = (wander + (EARTH_RATE / np.sqrt(3.0)) ** 2) * duration**2
    return np.asarray(sample * (1.0 / tail + 1.0 / head) + walk * duration + steady, dtype=np.float64)


def _edge(time: Series, force: Vectors, rate: Vectors, windows: np.ndarray, edge: str) -> Vectors:
    """Return (turns, 3) the specific force at the edge of a rest, samples turned there by the gyros."""
    return average_at_edge(
        time,
        rate,
        force,
        windows[:, 0],
        windows[:, 1],
        edge=edge,
        gyro_inverse=np.eye(3),
        gyro_bias=range_means(rate, windows),
        force_inverse=np.eye(3),
        force_bias=np.zeros(3),
    )
