"""A calibration's parameters as rows for people: groups, practical units, digits by uncertainty.

A bias is given in the raw unit of the recording, because that is what is subtracted, and besides in
mg or deg/s. For counts the triad's own scale factor makes that conversion; a zero of the converter
far from zero (an offset of 32768 counts) is no bias in mg, and then only its uncertainty is given so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from tumble.parameters import ACCELEROMETER, FAMILIES, MAGNETOMETER, TEMPERATURE, Parameter, parameter_of
from tumble.records import dataclass
from tumble.report.rounding import interval, with_uncertainty
from tumble.units import (
    DEGREE,
    STANDARD_GRAVITY,
    angular_rate_factor,
    magnetic_field_factor,
    specific_force_factor,
)

if TYPE_CHECKING:
    from tumble.document.result import Calibration, ParameterBlock, TriadBlock

# Ends the unit of a magnetometer's scale factor and soft iron, raw per corrected.
PER_TESLA = "/(T)"


@dataclass(frozen=True, slots=True)
class Measure:
    """A value with its standard uncertainty in a unit; a value of nan gives the uncertainty alone."""

    value: float
    sigma: float
    unit: str

    @property
    def text(self) -> str:
        """Value, standard uncertainty and unit, rounded by the uncertainty."""
        return f"{with_uncertainty(self.value, self.sigma)} {self.unit}".rstrip()

    def interval(self, factor: float) -> str:
        """Return the interval of `factor` standard uncertainties, without the unit."""
        return interval(self.value, self.sigma, factor)

    def times(self, factor: float, unit: str) -> Measure:
        """Return the same in another unit."""
        return Measure(factor * self.value, abs(factor) * self.sigma, unit)


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One parameter for a reader.

    Attributes
    ----------
    parameter : what it is.
    shown, other : in the table's main unit, and in the unit that people compare data sheets in.
    drawn : what a figure draws, comparable over the family.
    own_factor : coverage factor of this parameter for 95 %, None for the calibration's.
    """

    parameter: Parameter
    shown: Measure
    other: Measure | None
    drawn: Measure
    own_factor: float | None = None

    @property
    def name(self) -> str:
        """As in the calibration."""
        return self.parameter.name

    @property
    def kind(self) -> str:
        """What it is one of, such as "bias"."""
        return self.parameter.family.kind

    @property
    def group(self) -> str:
        """The heading that it stands under."""
        return self.parameter.family.group

    @property
    def label(self) -> str:
        """Its name under that heading."""
        return self.parameter.label

    def factor(self, common: float) -> float:
        """Return the coverage factor: its own, or else the one `common` to all."""
        return common if self.own_factor is None else self.own_factor


def parameter_rows(calibration: Calibration) -> list[ParameterRow]:
    """Return the rows in the calibration's own order, which correlations share."""
    rows: list[ParameterRow] = []
    for _, members in groupby(calibration.parameters, key=lambda p: parameter_of(p.name).family):
        rows += _family_rows(calibration, list(members))
    return rows


def plain_unit(unit: str) -> str:
    """Return a unit as people write it: m/s² for m/s^2, nothing for 1."""
    return "" if unit == "1" else unit.replace("^2", "²")


def _family_rows(calibration: Calibration, members: list[ParameterBlock]) -> list[ParameterRow]:
    family, unit = parameter_of(members[0].name).family, members[0].unit
    kind, group = family.kind, family.group
    measures = [Measure(p.value, p.standard_uncertainty, plain_unit(p.unit)) for p in members]
    if kind == "bias" and group != MAGNETOMETER:
        shown, other, drawn = _biases(calibration, group, members, measures)
    elif kind in ("scale factor error", "asymmetry"):
        shown = _in_practical_unit(measures, _SCALES)
        other, drawn = _nothing(shown), shown
    elif kind == "soft iron" and (scale := _mean_field_scale(calibration)):
        shown = drawn = [m.times(100.0 / scale, "%") for m in measures]
        other = _nothing(shown)
    elif group == MAGNETOMETER and unit.endswith(PER_TESLA):
        raw = unit.removesuffix(PER_TESLA)
        factor = magnetic_field_factor(raw)
        shown = drawn = [
            m.times(1e-6, f"{raw}/µT") if factor is None else m.times(factor, "") for m in measures
        ]
        other = _nothing(shown)
    elif kind == "scale factor" and group != MAGNETOMETER:
        shown = measures
        other = _in_practical_unit([Measure(math.nan, m.sigma / abs(m.value), "") for m in shown], _SCALES)
        mean = float(np.mean([m.value for m in shown]))
        drawn = [Measure(100 * (m.value / mean - 1), 100 * m.sigma / mean, "% off their mean") for m in shown]
    elif unit == "rad":
        shown = _in_practical_unit(measures, _ANGLES)
        other, drawn = _in_practical_unit(measures, _DEGREES), shown
        if group == MAGNETOMETER:
            # A heading is in degrees.
            shown, other = _in_practical_unit(measures, _DEGREES), [*shown]
    elif kind == "g-sensitivity":
        shown = measures
        practical = _g_sensitivities(calibration, members)
        other = _nothing(shown) if practical is None else practical
        drawn = practical or shown
    elif family.name == "accelerometer quadratic":
        shown = measures
        other = drawn = _quadratics(calibration, members)
    elif unit in ("s", "m") and group != TEMPERATURE:
        shown = drawn = [m.times(1e3, f"m{unit}") for m in measures]
        other = _nothing(shown)
    else:
        shown = drawn = measures
        other = _nothing(shown)
    return [
        ParameterRow(parameter_of(p.name), s, o, d, p.coverage_factor)
        for p, s, o, d in zip(members, shown, other, drawn, strict=True)
    ]


def _mean_field_scale(calibration: Calibration) -> float:
    """The mean scale factor of the magnetometer, of which soft iron is a share; zero without one."""
    block = calibration.magnetometer
    of_scale = {} if block is None else {p.name: p.value for p in block.parameters}
    named = [of_scale[name] for name, _ in FAMILIES["magnetometer scale factor"].labels() if name in of_scale]
    return float(np.mean(named)) if named else 0.0


def _nothing(rows: list[Measure]) -> list[Measure | None]:
    return [None for _ in rows]


# From the largest number of a family: (at least, factor, unit); the last one takes what is left.
_Choices = tuple[tuple[float, float, str], ...]
_SCALES: _Choices = ((2e-3, 1e2, "%"), (0.0, 1e6, "ppm"))
_ANGLES: _Choices = ((1e-4, 1e3, "mrad"), (0.0, 1e6, "µrad"))
_DEGREES: _Choices = ((1e-4, 1.0 / DEGREE, "deg"), (0.0, 3600.0 / DEGREE, "arcsec"))
_FORCES: _Choices = (
    (1e-3 * STANDARD_GRAVITY, 1e3 / STANDARD_GRAVITY, "mg"),
    (0.0, 1e6 / STANDARD_GRAVITY, "µg"),
)
_RATES: _Choices = ((0.1 * DEGREE, 1.0 / DEGREE, "deg/s"), (0.0, 3600.0 / DEGREE, "deg/h"))
_G_SENSITIVITIES: _Choices = (
    (1e-3 * DEGREE, 1.0 / DEGREE, "(deg/s)/g"),
    (0.0, 3600.0 / DEGREE, "(deg/h)/g"),
)


def _in_practical_unit(measures: list[Measure], choices: _Choices) -> list[Measure]:
    # Ten sigma stand for the value where there is none to show.
    largest = max(10.0 * m.sigma if math.isnan(m.value) else max(abs(m.value), m.sigma) for m in measures)
    factor, unit = next((f, u) for least, f, u in choices if largest >= least)
    return [m.times(factor, unit) for m in measures]


_G = STANDARD_GRAVITY
_OF_UNITS = {
    "m/s²": _FORCES,
    "rad/s": _RATES,
    "rad": _ANGLES,
    "": _SCALES,
    "rad/s/(m/s²)": tuple((least / _G, factor * _G, unit) for least, factor, unit in _G_SENSITIVITIES),
}


def people_s_unit(unit: str, largest: float) -> tuple[float, str]:
    """Return the unit that people read numbers of up to `largest` in, and the factor to it; else 1 and the same.

    Parameters
    ----------
    unit : "m/s^2", "rad/s", "rad", "rad/s/(m/s^2)", or "1" of a scale factor error.
    largest : of the numbers, without sign.

    Examples
    --------
    >>> people_s_unit("1", 0.0003)
    (1000000.0, 'ppm')
    """
    same = plain_unit(unit)
    return next(((f, u) for least, f, u in _OF_UNITS.get(same, ()) if largest >= least), (1.0, same))


_CHOICES: dict[str, tuple[_Choices, float]] = {
    "accelerometer bias": (_FORCES, 100.0),
    "gyro bias": (_RATES, 100.0),
    "scale": (_SCALES, 10.0),
    "angle": (_ANGLES, 100.0),
    "g-sensitivity": (_G_SENSITIVITIES, 100.0),
}
"""Units of a family that is not measured yet, and how many uncertainties stand for its values."""


def practical_uncertainties(family: str, sigmas: Sequence[float]) -> list[Measure]:
    """Return uncertainties that a plan predicts in the units in which a calibration will state them.

    Parameters
    ----------
    family : "accelerometer bias", "gyro bias", "scale", "angle" or "g-sensitivity".
    sigmas : SI (of a g-sensitivity rad/s a g).

    Examples
    --------
    >>> [one.text for one in practical_uncertainties("scale", [3.1e-5, 2.9e-5])]
    ['± 31 ppm', '± 29 ppm']
    """
    choices, times = _CHOICES[family]
    largest = times * max((sigma for sigma in sigmas if math.isfinite(sigma)), default=0.0)
    factor, unit = next((f, u) for least, f, u in choices if largest >= least)
    return [Measure(math.nan, factor * sigma, unit) for sigma in sigmas]


def achieved_beside(
    calibration: Calibration, predicted: Mapping[str, float]
) -> list[tuple[ParameterRow, Measure, Measure]]:
    """Return the parameters that a plan predicted: each with its predicted and its achieved uncertainty.

    Parameters
    ----------
    calibration : the result.
    predicted : by name, SI.
    """
    found: list[tuple[ParameterRow, Measure, Measure]] = []
    for row, parameter in zip(parameter_rows(calibration), calibration.parameters, strict=True):
        name = parameter.name
        if row.kind == "scale factor":
            # A plan knows no counts.
            name = FAMILIES[f"{row.parameter.family.name} error"].named(row.parameter.axes)
        if name not in predicted or not parameter.standard_uncertainty > 0.0:
            continue
        in_raw = predicted[name]
        if row.kind == "bias":
            per_raw = _si_per_raw(calibration, force=row.group == ACCELEROMETER)
            if per_raw is None:
                continue
            in_raw /= float(per_raw[row.parameter.axis])
        elif row.kind == "scale factor":
            in_raw *= abs(parameter.value)
        achieved = row.other if row.kind in ("bias", "scale factor") and row.other is not None else row.shown
        ratio = in_raw / parameter.standard_uncertainty
        found.append(
            (
                row,
                Measure(math.nan, ratio * achieved.sigma, achieved.unit),
                Measure(math.nan, achieved.sigma, achieved.unit),
            )
        )
    return found


def _biases(
    calibration: Calibration, group: str, members: list[ParameterBlock], measures: list[Measure]
) -> tuple[list[Measure], list[Measure | None], list[Measure]]:
    """Return biases in the raw unit, in mg or deg/s, and for the figure."""
    force = group == ACCELEROMETER
    per_raw = _si_per_raw(calibration, force=force)
    middle = float(np.mean([m.value for m in measures]))
    off_mean = [Measure(m.value - middle, m.sigma, f"{m.unit} off their mean") for m in measures]
    if per_raw is None:
        return measures, _nothing(measures), off_mean
    in_si = [
        m.times(float(per_raw[parameter_of(p.name).axis]), "") for p, m in zip(members, measures, strict=True)
    ]
    # More than the sensor's plausible range: the converter's own zero, no bias.
    offset = _calibration_in_counts(calibration, force=force) and max(abs(m.value) for m in in_si) > (
        0.5 * STANDARD_GRAVITY if force else 1.0
    )
    if not offset:
        practical = _in_practical_unit(in_si, _FORCES if force else _RATES)
        return measures, list(practical), practical
    only = [Measure(math.nan, m.sigma, "") for m in in_si]
    return measures, list(_in_practical_unit(only, _FORCES if force else _RATES)), off_mean


def _calibration_in_counts(calibration: Calibration, *, force: bool) -> bool:
    """Return whether a triad's raw unit is counts."""
    units = calibration.raw_units
    return (
        specific_force_factor(units.specific_force) if force else angular_rate_factor(units.angular_rate)
    ) is None


def _si_per_raw(calibration: Calibration, *, force: bool) -> np.ndarray | None:
    """Return (3,) SI per raw unit, by the unit's name or by the triad's own scale factors."""
    units = calibration.raw_units
    factor = specific_force_factor(units.specific_force) if force else angular_rate_factor(units.angular_rate)
    if factor is not None:
        return np.full(3, factor)
    block: TriadBlock | None = calibration.accelerometer if force else calibration.gyroscope
    if block is None or block.matrix is None:
        return None
    return 1.0 / np.linalg.norm(np.array(block.matrix, dtype=float), axis=1)


def _g_sensitivities(calibration: Calibration, members: list[ParameterBlock]) -> list[Measure] | None:
    """Return them in (deg/s)/g, or (deg/h)/g where they are small; None if counts mean nothing yet."""
    per_raw = _si_per_raw(calibration, force=False)
    if per_raw is None:
        return None
    in_si: list[Measure] = []
    for p in members:
        factor = float(per_raw[parameter_of(p.name).axis]) * STANDARD_GRAVITY
        in_si.append(Measure(factor * p.value, factor * p.standard_uncertainty, ""))
    return _in_practical_unit(in_si, _G_SENSITIVITIES)


def _quadratics(calibration: Calibration, members: list[ParameterBlock]) -> list[Measure]:
    """Return the error at 1 g over g²: k u² raw units with u = g over SI per raw, in mg/g² or µg/g²."""
    per_raw = _si_per_raw(calibration, force=True)
    assert per_raw is not None
    in_si: list[Measure] = []
    for p in members:
        factor = STANDARD_GRAVITY**2 / float(per_raw[parameter_of(p.name).axis])
        in_si.append(Measure(factor * p.value, factor * p.standard_uncertainty, ""))
    return [Measure(m.value, m.sigma, f"{m.unit}/g²") for m in _in_practical_unit(in_si, _FORCES)]
