"""From the unknowns of a thermal adjustment to a thermal model in raw units, with its covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square, Table, Vectors
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.estimate import TermTest
from tumble.calibration.outcome.description import model_of
from tumble.calibration.thermal.conditions import Complex, ThermalLayout
from tumble.calibration.thermal.coverage import Coverage
from tumble.calibration.thermal.evidence import BiasCurve, Candidate
from tumble.calibration.thermal.fit import Doubts, ThermalFit
from tumble.calibration.thermal.points import ThermalPoints
from tumble.calibration.thermal.turns import TurnedMatrix
from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.sensor.propagation import propagate
from tumble.sensor.thermal import SHAPES, ThermalModel


@dataclass(frozen=True, slots=True)
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


@dataclass(slots=True)
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
    doubts : what is in the uncertainties because the recording cannot show it.
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
    doubts: Doubts
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
