"""The block ``thermal`` of ``calibration.json``: what changes with temperature, as numbers and as text."""

from __future__ import annotations

import re
from typing import Any, Literal

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.document.part import DocumentPart, Row, Rows, part_of, plain, read_part, row_of
from tumble.document.soundness import stated_covariance_fault
from tumble.sensor import KINDS, SPAN_MARGIN, ImuModel, TemperatureBasis, TemperaturePath, ThermalModel

FORMULA = (
    "p(T) = p(reference) + sum over k of coefficients[k] * f_k(T) for every quantity p that has coefficients; "
    "biases further + rate_coefficients * dT/dt + hysteresis * s. The accelerometer and gyroscope of this document "
    "are the values at reference_celsius; with p(T) in their place, formula and inverse_formula hold sample by "
    "sample. T in degrees Celsius, dT/dt in K/s, s without unit are of the sensor itself: path_formula"
)
BASIS_FORMULAS = {
    "polynomial": "f_k(T) = (T - reference_celsius)^k, k = 1 .. order",
    "linear": (
        "f_k(T) = h_k(T) - h_k(reference_celsius), h_k the piecewise straight function that is 1 at node k and 0 at "
        "all others, its end pieces going on straight; k runs over all nodes but the one next to "
        "reference_celsius (the first of two at the same distance)"
    ),
    "spline": (
        "f_k(T) = h_k(T) - h_k(reference_celsius), h_k the natural cubic spline that is 1 at node k and 0 at all "
        "others, straight beyond the ends; k runs over all nodes but the one next to reference_celsius "
        "(the first of two at the same distance)"
    ),
}
PATH_FORMULA = (
    "from the recorded temperature R: x' = v + 2 (R - x) / smoothing, v' = (R - x) / smoothing^2, begun with the "
    "straight line through the first `smoothing` seconds; T' = (x - T) / lag, begun with T = x (lag 0: T = x, "
    "dT/dt = v); dT/dt = T'; p follows T as soon as it is dead_band away: where |T - p| > dead_band, m = |T - p| - "
    "dead_band, p moves by m towards T and s = q + (s - q) exp(-m / hysteresis_width), q = sign(T - p); begun with "
    "p = T, s = start_hysteresis. Between samples R (and x for the lag) is a straight line. smoothing 0: x = R"
)


# What the model has by the same names.
_GROUPS = ("coefficients", "rate_coefficients", "hysteresis")
_NUMBERS = ("hysteresis_width", "lag", "smoothing", "dead_band", "start_hysteresis")


class BasisBlock(DocumentPart):
    """The functions of temperature; `nodes_celsius` are empty of a polynomial, `order` is 0 of the others."""

    kind: Literal["polynomial", "linear", "spline"]
    reference_celsius: float
    nodes_celsius: list[float]
    order: int
    formula: str


class ThermalCoefficients(DocumentPart):
    """One row or matrix (raw units) for each function of temperature; null for what does not change."""

    accelerometer_bias: list[Row] | None = None
    accelerometer_matrix: list[Rows] | None = None
    gyroscope_bias: list[Row] | None = None
    gyroscope_matrix: list[Rows] | None = None
    g_sensitivity: list[Rows] | None = None


class BiasPair(DocumentPart):
    """A row for each bias, or null."""

    accelerometer_bias: Row | None = None
    gyroscope_bias: Row | None = None


class ThermalTestVector(DocumentPart):
    """Raw in, corrected out, at a temperature, rate and hysteresis state of the sensor itself."""

    temperature_celsius: float
    rate: float
    hysteresis_state: float
    raw_specific_force: Row | None = None
    raw_angular_rate: Row | None = None
    specific_force: Row | None = None
    angular_rate: Row | None = None


class PathTest(DocumentPart):
    """A recorded temperature, up and down again, and what the sensor's own follows from it."""

    time: list[float]
    recorded_celsius: list[float]
    sensor_celsius: list[float]
    rate: list[float]
    hysteresis_state: list[float]


class ThermalBlock(DocumentPart):
    """How the parameters of the document change with temperature.

    Attributes
    ----------
    span_celsius, margin : °C where it was calibrated, and K beyond it that it is used at without asking.
    largest_rate : K/s, the fastest change seen; null for not known.
    hysteresis_width, dead_band : K.
    lag, smoothing : s.
    covariance_parameters, covariance : over the thermal parameters, in their units; names as
        ``accelerometer.bias.temperature[k,i]`` with k the function and i the axis.
    """

    formula: str = FORMULA
    basis: BasisBlock
    coefficients: ThermalCoefficients
    rate_coefficients: BiasPair
    hysteresis: BiasPair
    hysteresis_width: float
    lag: float
    smoothing: float
    dead_band: float
    start_hysteresis: float
    path_formula: str = PATH_FORMULA
    span_celsius: tuple[float, float]
    margin: float = SPAN_MARGIN
    largest_rate: float | None
    covariance_parameters: list[str]
    covariance: list[list[float]]
    test_vectors: list[ThermalTestVector]
    path_test: PathTest

    def model(self, reference: ImuModel) -> ThermalModel:
        """Return the sensor model with these changes about a reference; of a triad that it lacks, none.

        Raises
        ------
        ValueError
            If the numbers do not fit each other or the reference.
        """
        return ThermalModel(
            reference=reference,
            basis=self._basis(),
            span_celsius=self.span_celsius,
            largest_rate=np.inf if self.largest_rate is None else self.largest_rate,
            **{name: _of_known(getattr(self, name), reference) for name in _GROUPS},
            **{name: getattr(self, name) for name in _NUMBERS},
        )

    def basis_values(self, temperature_celsius: Series) -> Table:
        """Return (temperatures, functions) of the functions of temperature, °C."""
        return self._basis().values(temperature_celsius)

    def _basis(self) -> TemperatureBasis:
        return TemperatureBasis(
            self.basis.kind,
            self.basis.reference_celsius,
            np.array(self.basis.nodes_celsius, dtype=float),
            self.basis.order,
        )


def thermal_block(model: ThermalModel, names: list[str], covariance: Square) -> ThermalBlock:
    """Return the block of a thermal model, with test vectors over its span.

    Parameters
    ----------
    names, covariance : of the thermal parameters, (n, n).

    Raises
    ------
    ValueError
        If the span is not of finite temperatures.
    """
    low, high = model.span_celsius
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise ValueError("the span of a thermal model that is written has two finite ends")
    basis = model.basis
    return part_of(
        ThermalBlock,
        model,
        basis=part_of(
            BasisBlock, basis, nodes_celsius=basis.nodes.tolist(), formula=BASIS_FORMULAS[basis.kind]
        ),
        coefficients=read_part(ThermalCoefficients, _lists(model.coefficients)),
        rate_coefficients=read_part(BiasPair, _lists(model.rate_coefficients)),
        hysteresis=read_part(BiasPair, _lists(model.hysteresis)),
        span_celsius=(float(low), float(high)),
        covariance_parameters=list(names),
        covariance=(0.5 * (covariance + covariance.T)).tolist(),
        test_vectors=_test_vectors(model),
        path_test=_path_test(model),
    )


def contradiction(block: ThermalBlock, reference: ImuModel) -> str | None:
    """Return what is wrong with a block that was read, or None."""
    if fault := stated_covariance_fault(block.covariance, block.covariance_parameters):
        return f"thermal.covariance: {fault}"
    if not block.span_celsius[0] <= block.span_celsius[1]:
        return "thermal.span_celsius: its first temperature is above its second"
    if block.basis.kind not in KINDS:
        return f"thermal.basis: {block.basis.kind} is unknown"
    try:
        model = block.model(reference)
        for celsius in np.linspace(*block.span_celsius, 9).tolist():
            there = model.at(celsius)
            for name in ("accelerometer", "gyroscope"):
                triad, known = getattr(there, name), getattr(reference, name)
                if triad is not None and not np.linalg.det(triad.matrix) * np.linalg.det(known.matrix) > 0.0:
                    return f"thermal.coefficients: the {name}'s matrix cannot be inverted at {celsius:.1f} °C"
    except ValueError as error:
        return f"thermal: {error}"
    return None


def _of_known(group: DocumentPart, reference: ImuModel) -> dict[str, Any]:
    """Return the model's dictionary, its keys with dots, of what is not null and of triads that the reference has."""
    known = {
        "accelerometer": reference.accelerometer is not None,
        "gyroscope": reference.gyroscope is not None,
        "g_sensitivity": reference.gyroscope is not None and reference.g_sensitivity is not None,
    }
    told = {re.sub("_(bias|matrix)$", r".\1", key): values for key, values in plain(group).items()}
    return {
        name: np.array(values, dtype=float)
        for name, values in told.items()
        if values is not None and known[name.partition(".")[0]]
    }


def _lists(group: dict[str, Any]) -> dict[str, Any]:
    return {key.replace(".", "_"): values.tolist() for key, values in group.items()}


def _test_vectors(model: ThermalModel) -> list[ThermalTestVector]:
    """Return raw and corrected samples at five temperatures of the span, on both branches."""
    low, high = model.span_celsius
    rate = model.largest_rate if np.isfinite(model.largest_rate) else 0.01
    vectors: list[ThermalTestVector] = []
    true_force, true_rate = np.array([[3.0, -4.0, 5.0]]), np.array([[0.3, -0.4, 0.5]])
    for number, celsius in enumerate(np.linspace(low, high, 5).tolist()):
        for branch in (1.0, -1.0):
            state = branch * (1.0 - 0.125 * number)
            there = model.at(celsius, branch * rate, state)
            raw_force, raw_rate = None, None
            if there.accelerometer is not None:
                raw_force = np.round(there.accelerometer.distort(true_force), 3)
            if there.gyroscope is not None:
                raw_rate = np.round(there.gyroscope.distort(true_rate), 4)
            at = np.array([celsius]), np.array([branch * rate]), np.array([state])
            path = TemperaturePath(*at, end=model.path(np.zeros(1), at[0]).end)
            force, turned = model.correct_along(path, np.zeros(1), raw_force, raw_rate)
            corrected = {"raw_specific_force": raw_force, "raw_angular_rate": raw_rate}
            corrected |= {"specific_force": force, "angular_rate": turned}
            vectors.append(
                ThermalTestVector(
                    temperature_celsius=celsius,
                    rate=branch * rate,
                    hysteresis_state=state,
                    **{name: row_of(values[0]) for name, values in corrected.items() if values is not None},
                )
            )
    return vectors


def _path_test(model: ThermalModel) -> PathTest:
    """Return the sensor's temperature for a rise over the span and half the way back."""
    low, high = model.span_celsius
    step = max(model.smoothing, model.lag, 1.0) / 2.0
    time = step * np.arange(13.0)
    recorded = np.interp(
        np.arange(13.0), [0.0, 1.0, 7.0, 8.0, 12.0], [low, low, high, high, 0.5 * (low + high)]
    )
    path = model.path(time, recorded)
    parts = (time, recorded, path.temperature, path.rate, path.hysteresis)
    keys = ("time", "recorded_celsius", "sensor_celsius", "rate", "hysteresis_state")
    return PathTest(**{key: part.tolist() for key, part in zip(keys, parts, strict=True)})
