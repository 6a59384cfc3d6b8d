"""From the unknowns of a thermal adjustment to a thermal model in raw units, with its covariance.

The gyros' matrix as a function of temperature is from turns between the rests. The rests tell the accelerometers, the
gyros' biases and their g-sensitivity at every temperature. With these taken off, the angular rate of a turn is still
off by the gyros' matrix, nominal so far:

    shown = (I + D(T)) true,   D(T) = D0 + sum_k D_k f_k(T)

The specific force at the end of a rest, carried over the turn by the gyros, is the specific force at the beginning
of the next rest (two equations a turn). D has all nine elements: in the frame of the
accelerometers they are the gyros' scale factors, their non-orthogonalities, and the rotation between the triads.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Square, Table, Vectors, range_means
from tumble.attitude import IntegratedTurns, Inverse, integrate_turns, skews
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns, tangent_bases, window_directions
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.estimate import TermTest, wald_test
from tumble.calibration.evidence import BiasCurve, Candidate
from tumble.calibration.outcome.description import model_of
from tumble.calibration.thermal.conditions import Complex, ThermalLayout
from tumble.calibration.thermal.coverage import Coverage
from tumble.calibration.thermal.fit import REFUSED, ThermalFit, balanced
from tumble.calibration.thermal.points import ThermalPoints
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError, SegmentationError
from tumble.estimation import Adjustment, Conditions, Linearisation
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import Timeline, observe_holds
from tumble.sensor import SHAPES, ThermalModel, propagate, shin_from_matrix

# Turns of fewer samples are not integrated well; smaller ones tell no scale factor.
LEAST_SAMPLES, LEAST_ANGLE = 20, np.radians(20.0)
# Turns a function of temperature: two equations each, for nine elements.
TURNS_PER_FUNCTION = 9
# Turns are within so many °C of the rests that are used.
BEYOND = 2.0
# A bend of the matrix is taken where it is likelier than not: left out, it would be in no uncertainty.
EASY_ALARM = 0.5
MOST_FUNCTIONS = 2


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class _Turns:
    """Turns of a recording that the rests' model has corrected.

    Attributes
    ----------
    data : samples, in SI, and where turns begin and end.
    before : (turns,) the hold before each.
    tail, head : (turns, 3) specific force at the beginning and at the end, each in its own body frame.
    functions : (turns, functions + 3) one, functions of temperature, its rate, hysteresis.
    noise : (turns,) rad² of each of the two components: edges, angle random walk, wandering bias.
    """

    data: HoldsAndTurns
    before: np.ndarray
    tail: Vectors
    head: Vectors
    functions: Table
    noise: Series


class _TurnEquations(Conditions):
    """`Conditions` of turns for D0 and D_k, as many matrices as `count`."""

    def __init__(self, turns: _Turns, count: int, gravity: float) -> None:
        self.turns, self.count, self.gravity = turns, count, gravity
        self.extra = {"turn": 0.0}
        self.active = np.ones((turns.before.size, 2), dtype=bool)
        # How the last linearisation's rows move with the specific force at both ends, and with the rates.
        self.by_tail = self.by_head = self.by_bias = np.zeros((turns.before.size, 2, 3))

    @property
    def variance(self) -> Series:
        """(turns,) rad² of each component."""
        return self.turns.noise + self.extra["turn"]

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters`."""
        turns, data, size = self.turns, self.turns.data, self.turns.before.size
        weights = turns.functions[:, : self.count]
        changes = np.einsum("tk,kij->tij", weights, parameters.reshape(self.count, 3, 3), optimize=True)
        inverse: Matrices = np.asarray(np.linalg.inv(np.eye(3) + changes), dtype=np.float64)
        # Each turn has an inverse of its own.
        start, stop = data.turn_start[turns.before], data.turn_stop[turns.before]
        rate = data.raw_rate.copy()
        for k, part in enumerate(map(slice, start.tolist(), stop.tolist())):
            rate[part] = rate[part] @ inverse[k].T
        made = _integrated(replace(data, raw_rate=rate), turns.before)
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
        if turns.before.size < TURNS_PER_FUNCTION * count:
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


def _integrated(data: HoldsAndTurns, before: np.ndarray) -> IntegratedTurns:
    """Integrate samples that are true ones already over the turns after some holds."""
    return integrate_turns(*data.samples, data.turn_start[before], data.turn_stop[before], Inverse())


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
    data = replace(data, raw_force=force, raw_rate=rate)
    made = _integrated(data, before)
    angle = np.arccos(np.clip(0.5 * (np.trace(made.C_start_end, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
    celsius = path.temperature[(start + stop) // 2]
    low, high = model.span_celsius
    used = (stop - start >= LEAST_SAMPLES) & (celsius > low - BEYOND) & (celsius < high + BEYOND)
    used &= angle > LEAST_ANGLE
    if np.count_nonzero(used) < TURNS_PER_FUNCTION:
        return None
    before, middle = before[used], ((start + stop) // 2)[used]
    # A rate that is doubted alone does nothing in turns.
    speed = path.rate[middle] if fit.terms.rate else 0.0
    # Of each edge what its own window shows at rest is no motion: over a long hold the bias moves.
    heads, tails = (
        window_directions(replace(data, rate_mean=range_means(rate, of)), np.eye(3), np.zeros(3), np.eye(3))[
            k
        ]
        for k, of in enumerate((data.head, data.tail))
    )
    functions = fit.layout.at_temperature(path.temperature[middle], speed, path.hysteresis[middle])
    noise = _noise(data, model, before, fit, factor)
    return _Turns(data, before, tails[before], heads[before + 1], functions, noise)


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


@dataclass(frozen=True)
class ThermalSolution:
    """A thermal model and how well everything in it is known.

    Attributes
    ----------
    model : raw units.
    covariance : of `model.names`, raw units.
    unknowns, unknowns_covariance : of the reference, all of `LAYOUT`.
    """

    model: ThermalModel
    covariance: Table
    unknowns: Series
    unknowns_covariance: Table


@dataclass
class ThermalOutcome:
    """All that became of a thermal test.

    Attributes
    ----------
    recording, site : what was recorded, and where.
    everything : all points; those that took part are the fit's.
    factors : near SI per raw unit, of the accelerometers and of the gyros.
    coverage : what of temperature was covered.
    poses : how many different ones there were.
    candidates : functions of temperature that were tried.
    fit, tests : the adjustment, and what it tested.
    loops : (m/s², rad/s), one sigma of half a loop that the recording cannot show; None where both branches were seen.
    pull : rad/s, one sigma of what a g-sensitivity does in 1 g; zero where poses tell it.
    solution : in raw units.
    turned : the gyros' matrix from turns; None without one.
    """

    recording: Recording
    site: Site
    everything: ThermalPoints
    factors: tuple[float, float]
    coverage: Coverage
    poses: int
    candidates: list[Candidate]
    fit: ThermalFit
    tests: list[TermTest]
    loops: tuple[float, float] | None
    pull: float
    solution: ThermalSolution
    turned: TurnedMatrix | None = None

    @property
    def points(self) -> ThermalPoints:
        """Those that took part."""
        return self.fit.conditions.points

    def sigma_of(self, name: str) -> float:
        """One sigma of the "lag" (s) or the "width" (K); NaN for what was not estimated."""
        place = self.fit.layout[name]
        variances = np.diag(self.fit.covariance)[place]
        return float(np.sqrt(max(variances[0], 0.0))) if variances.size else float("nan")


def _numbers(
    x: Complex, layout: ThermalLayout, factors: tuple[float, float]
) -> tuple[Complex, tuple[dict[str, Complex], ...]]:
    """Return all of `LAYOUT` at the reference, and terms by temperature, rate and hysteresis; raw, analytic."""
    terms, functions = layout.terms, layout.terms.basis.size
    reference = np.zeros(LAYOUT.size, dtype=x.dtype)
    by_temperature, by_rate, loops = (dict[str, Complex]() for _ in range(3))
    for name, mark, factor in (("accelerometer", "", factors[0]), ("gyroscope", "g", factors[1])):
        if layout.has(f"{mark}b"):
            by_temperature[f"{name}.bias"] = x[layout[f"{mark}b"]].reshape(-1, 3) / factor
            by_rate |= {f"{name}.bias": x[layout[f"{mark}r"]] / factor} if terms.rate else {}
            loops |= {f"{name}.bias": x[layout[f"{mark}h"]] / factor} if terms.hysteresis else {}
    if layout.has_force:
        matrix = layout.matrices(x, np.eye(1, functions + 1))[0]
        scale, angles = shin_from_matrix(matrix / factors[0])
        reference[LAYOUT["force.scale"]], reference[LAYOUT["force.angle"]] = scale, angles
        if layout.has("b0"):
            reference[LAYOUT["force.bias"]] = x[layout["b0"]] / factors[0]
        if layout.has("M"):
            by_temperature["accelerometer.matrix"] = _padded(layout.matrix_changes(x), functions) / factors[0]
    if layout.has_rate:
        own = x[layout["N0"]].reshape(-1, 9).sum(axis=0)
        reference[LAYOUT["gyro.matrix"]] = (np.eye(3).ravel() + own) / factors[1]
        reference[LAYOUT["gyro.bias"]] = x[layout["gb0"]] / factors[1]
        if layout.has("G"):
            reference[LAYOUT["gyro.g_sensitivity"]] = x[layout["G"]] / factors[1]
        if layout.has("N"):
            given = x[layout["N"]].reshape(-1, 3, 3)
            by_temperature["gyroscope.matrix"] = _padded(given, functions) / factors[1]
    return reference, (by_temperature, by_rate, loops)


def _padded(matrices: Complex, functions: int) -> Complex:
    return np.concatenate([matrices, np.zeros((functions - len(matrices), 3, 3))])


def thermal_solution(
    fit: ThermalFit,
    covariance: Square,
    factors: tuple[float, float],
    coverage: Coverage,
    turned: TurnedMatrix | None = None,
) -> ThermalSolution:
    """Return the model of an adjustment's unknowns.

    Parameters
    ----------
    fit, covariance : the adjustment in near SI, and which covariance of its unknowns.
    factors : near SI per raw unit, of the accelerometers and of the gyros.
    coverage : of the calibration.
    turned : the gyros' matrix from turns; None for the nominal one.
    """
    own, matrices = fit.layout, 0 if turned is None else len(turned.matrices)
    layout = ThermalLayout.of(fit.terms, own.has_force, own.has_rate, turned=matrices)
    values, known = fit.values[: own.shared], covariance[: own.shared, : own.shared]
    if turned is not None:
        values, known = turned.values, turned.covariance
    lag, width = fit.conditions.lag_and_width(fit.values)

    def evaluate(x: Complex) -> Complex:
        reference, groups = _numbers(x, layout, factors)
        return np.concatenate([reference, *(g[name].ravel() for g in groups for name in SHAPES if name in g)])

    spread = propagate(evaluate, values, known)[1]
    x, (by_temperature, by_rate, loops) = _numbers(values, layout, factors)
    size, terms = x.size, frozenset({"g_sensitivity"} if layout.has("G") else ())
    reference = model_of(x, terms, "full" if layout.has_rate else "none", "accelerometer-x")
    model = ThermalModel(
        reference if layout.has_force else replace(reference, accelerometer=None),
        layout.terms.basis,
        by_temperature,
        by_rate,
        loops,
        hysteresis_width=width,
        lag=lag,
        span_celsius=coverage.span,
        largest_rate=coverage.largest_rate,
    )
    return ThermalSolution(model, spread[size:, size:], x, spread[:size, :size])


def bias_curve(fit: ThermalFit, covariance: Square, mark: str, factor: float, celsius: Series) -> BiasCurve:
    """Return a triad's bias over temperature with its standard uncertainty.

    Parameters
    ----------
    fit, covariance : the adjustment, and which covariance of its unknowns.
    mark : "" of the accelerometers, "g" of the gyros.
    factor : near SI per raw unit.
    celsius : where.
    """
    layout = fit.layout
    columns = layout.columns(mark, layout.at_temperature(celsius))
    bias: Vectors = columns @ fit.values / factor
    variance = np.einsum("nip,pq,niq->ni", columns, covariance, columns, optimize=True)
    loop = fit.values[layout[f"{mark}h"]] / factor if fit.terms.hysteresis else np.zeros(3)
    return BiasCurve(celsius, bias, np.sqrt(np.maximum(variance, 0.0)) / factor, bias + loop, bias - loop)
