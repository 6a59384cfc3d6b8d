"""A calibration's parameters as rows for people: under headings, in the units that they are said in.

A bias is given in the raw unit of the recording, because that is what is subtracted, and besides in mg or °/s. For
counts the triad's own scale factor makes that conversion. A zero of the converter far from zero (an offset of 32768
counts) is no bias in mg, and then only its uncertainty is given so.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

import numpy as np

from tumble.document import Calibration, FieldParameter, ParameterBlock, TriadBlock
from tumble.parameters import (
    ANGLES,
    FAMILIES,
    Family,
    Measure,
    Parameter,
    parameter_of,
    plain_unit,
    said,
    said_unit,
    under_headings,
)
from tumble.records import dataclass
from tumble.report.page import Table
from tumble.units import DEGREE, STANDARD_GRAVITY, unit_factor

# Of a triad's zero in counts: more is the converter's own, and no bias.
_LARGEST_BIAS = {"accelerometer": 0.5 * STANDARD_GRAVITY, "gyro": 1.0}


@dataclass(frozen=True)
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

    @property
    def said(self) -> Measure:
        """In the unit of data sheets where it has one: a bias in mg or °/s, not in counts."""
        converted = self.kind in ("bias", "g-sensitivity", "quadratic")
        return (
            self.shown if self.other is None or math.isnan(self.other.value) or not converted else self.other
        )

    def factor(self, common: float) -> float:
        """Return the coverage factor: its own, or else the one `common` to all."""
        return common if self.own_factor is None else self.own_factor


def parameter_rows(calibration: Calibration) -> list[ParameterRow]:
    """Return the rows in the calibration's own order, which correlations share."""
    return rows_of(calibration.parameters, calibration)


def rows_of(
    parameters: Sequence[ParameterBlock | FieldParameter], calibration: Calibration | None = None
) -> list[ParameterRow]:
    """Return parameters as rows, in their own order.

    Parameters
    ----------
    parameters : of a calibration.
    calibration : whose raw units they are in; None for a magnetometer's alone.
    """
    rows: list[ParameterRow] = []
    scales = [
        p.value for p in parameters if parameter_of(p.name).family is FAMILIES["magnetometer scale factor"]
    ]
    for family, members in groupby(parameters, key=lambda p: parameter_of(p.name).family):
        own = list(members)
        shown, other, drawn = _measures(family, own, calibration, float(np.mean(scales)) if scales else 0.0)
        rows += [
            ParameterRow(parameter_of(p.name), s, o, d, getattr(p, "coverage_factor", None))
            for p, s, o, d in zip(own, shown, other, drawn, strict=True)
        ]
    return rows


def headed_table(
    heads: Sequence[str], lines: Iterable[tuple[str, Sequence[str]]], *, spare: int = 0
) -> Table:
    """Return a table of parameters under their headings.

    Parameters
    ----------
    heads : of the columns, the parameter's first.
    lines : name and further cells of each parameter.
    spare : as a table's.
    """
    cells: list[list[str]] = []
    looks: dict[int, str] = {}
    for group, members in under_headings(lines, key=lambda line: line[0]):
        looks[len(cells)] = "group"
        cells += [[group], *([parameter_of(name).label, *texts] for name, texts in members)]
    return Table(heads, cells, looks, right=() if spare else range(1, len(heads) - 1), spare=spare)


def _measures(
    family: Family,
    members: Sequence[ParameterBlock | FieldParameter],
    calibration: Calibration | None,
    scale: float,
) -> tuple[Sequence[Measure], Sequence[Measure | None], Sequence[Measure]]:
    """What a table shows of a family, what beside it, and what a figure draws."""
    raw = [Measure(p.value, p.standard_uncertainty, p.unit) for p in members]
    plain, nothing = [m.times(1.0, plain_unit(m.unit)) for m in raw], [None for _ in raw]
    shown = said(raw)
    if family.kind == "soft iron" and scale:
        share = [m.times(100.0 / scale, "%") for m in raw]
        return share, nothing, share
    if family.kind in ANGLES:
        degrees = _in_degrees(raw)
        # A heading is in degrees.
        return (degrees, shown, degrees) if family.triad == "magnetometer" else (shown, degrees, shown)
    if family.triad == "magnetometer" or calibration is None:
        return shown, nothing, shown
    if family.kind == "scale factor":
        shares = said([Measure(math.nan, m.sigma / abs(m.value), "1") for m in raw])
        mean = float(np.mean([m.value for m in raw]))
        drawn = [Measure(100 * (m.value / mean - 1), 100 * m.sigma / mean, "% off their mean") for m in raw]
        return plain, shares, drawn
    if family.kind == "bias":
        return plain, *_biases(family, plain, _in_si(family, members, raw, calibration))
    if family.kind == "g-sensitivity" or family.name == "accelerometer quadratic":
        converted = _in_si(family, members, raw, calibration)
        return (plain, nothing, plain) if converted is None else (plain, said(converted), said(converted))
    return shown, nothing, shown


def _in_degrees(measures: Sequence[Measure]) -> list[Measure]:
    small = max(max(abs(m.value), m.sigma) for m in measures) < 1e-4
    factor, unit = (3600.0 / DEGREE, "″") if small else (1.0 / DEGREE, "°")
    return [m.times(factor, unit) for m in measures]


def _biases(
    family: Family, plain: list[Measure], in_si: list[Measure] | None
) -> tuple[Sequence[Measure | None], Sequence[Measure]]:
    """Return biases in mg or °/s, and for the figure."""
    middle = float(np.mean([m.value for m in plain]))
    off_mean = [Measure(m.value - middle, m.sigma, f"{m.unit} off their mean") for m in plain]
    if in_si is None:
        return [None for _ in plain], off_mean
    counts = unit_factor(plain[0].unit) is None
    if counts and max(abs(m.value) for m in in_si) > _LARGEST_BIAS[family.triad]:
        return said([Measure(math.nan, m.sigma, m.unit) for m in in_si]), off_mean
    return said(in_si), said(in_si)


def _in_si(
    family: Family,
    members: Sequence[ParameterBlock | FieldParameter],
    raw: list[Measure],
    calibration: Calibration,
) -> list[Measure] | None:
    """What is in a triad's raw unit in SI; None if counts mean nothing yet."""
    force = family.triad == "accelerometer"
    per_raw = _si_per_raw(calibration, force=force)
    if per_raw is None:
        return None
    unit = family.unit.format(raw="m/s^2" if force else "rad/s")
    power = -1.0 if family.kind == "quadratic" else 1.0
    axes = [parameter_of(p.name).axis for p in members]
    return [m.times(float(per_raw[axis]) ** power, unit) for m, axis in zip(raw, axes, strict=True)]


def _si_per_raw(calibration: Calibration, *, force: bool) -> np.ndarray | None:
    """Return (3,) SI per raw unit, by the unit's name or by the triad's own scale factors."""
    factor = calibration.raw_units.factors[not force]
    if factor is not None:
        return np.full(3, factor)
    block: TriadBlock | None = calibration.accelerometer if force else calibration.gyroscope
    if block is None or block.matrix is None:
        return None
    return 1.0 / np.linalg.norm(np.array(block.matrix, dtype=float), axis=1)


# Of what is not measured yet: its unit, SI, and how many uncertainties stand for its values.
_PREDICTED = {
    "accelerometer bias": ("m/s^2", 100.0),
    "gyro bias": ("rad/s", 100.0),
    "scale": ("1", 10.0),
    "angle": ("rad", 100.0),
    "g-sensitivity": ("rad/s/(m/s²)", 100.0),
}


def practical_uncertainties(family: str, sigmas: Sequence[float]) -> list[Measure]:
    """Return uncertainties that a plan predicts in the units in which a calibration will state them.

    Parameters
    ----------
    family : "accelerometer bias", "gyro bias", "scale", "angle" or "g-sensitivity".
    sigmas : SI; nan of what is not known.

    Examples
    --------
    >>> [one.text for one in practical_uncertainties("scale", [3.1e-5, 2.9e-5])]
    ['± 31 ppm', '± 29 ppm']
    """
    unit, times = _PREDICTED[family]
    factor, word = said_unit(unit, (times * sigma for sigma in sigmas))
    return [Measure(math.nan, factor * sigma, word) for sigma in sigmas]


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
            per_raw = _si_per_raw(calibration, force=row.parameter.family.triad == "accelerometer")
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
