"""Grades of IMUs as data sheets state them: ``grades.yaml`` has each number with its source."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Matrix
from tumble.attitude.rotations import matrix_from_rotation_vector
from tumble.errors import UsageError
from tumble.files import read_yaml
from tumble.records import dataclass
from tumble.sensor.imu import ImuModel
from tumble.sensor.triad import Triad
from tumble.simulation.noise import TriadNoise
from tumble.units import DEGREE, DEGREE_PER_HOUR, DEGREE_PER_ROOT_HOUR, MICRO_G, MILLI_G, STANDARD_GRAVITY

# A sheet's linearity is read as the rms deviation from the best straight line over ± full scale, as a
# share of full scale F. For a quadratic term q it is q F² √(4/45).
_RMS_OF_QUADRATIC = float(np.sqrt(4.0 / 45.0))


@dataclass(frozen=True, slots=True)
class TriadGrade:
    """What units of a grade have in common: noise, and the spread of their constant errors (one sigma).

    Attributes
    ----------
    noise : see `TriadNoise`.
    bias : u, turn-on to turn-on and unit to unit together.
    scale_factor : dimensionless.
    misalignment : rad, of each sensing axis about each of the other two.
    alignment : rad, of the whole triad against the unit's case, about each axis.
    linearity : share of full scale, rms deviation of the output from the best straight line over the
        operating range; zero where the sheet states none. It becomes a quadratic term on request.
    bias_stability : u, how far a bias wanders within a run where the sheet states it; played on request.
    """

    noise: TriadNoise
    bias: float
    scale_factor: float
    misalignment: float
    alignment: float = 0.0
    linearity: float = 0.0
    bias_stability: float = 0.0

    @property
    def quadratic(self) -> float:
        """One sigma of the quadratic term that the linearity stands for, 1/u; zero for none."""
        if self.linearity == 0.0:
            return 0.0
        return self.linearity / (_RMS_OF_QUADRATIC * self.noise.full_scale)


@dataclass(frozen=True, slots=True)
class Grade:
    """A grade of IMU.

    Attributes
    ----------
    name : as asked for.
    accelerometer, gyroscope : m/s² and rad/s.
    g_sensitivity : (rad/s)/(m/s²), one sigma of each element.
    source : of every number that is not assumed.
    assumed : the numbers that no source states, in words.
    rate : Hz at which such a unit is usually recorded.
    counts_per_si : raw counts per m/s² and per rad/s, for recordings in counts.
    axes : how the unit's own axes lie in its case, in words; the body frame b of a simulated recording is
        that of the unit's own axes, which are the recording's columns, unless the case's is asked for.
    C_instrument_case : (3, 3), from a case frame of forward, right, down to the unit's own axes:
        ``v_instrument = C_instrument_case @ v_case``; None where both are the same.
    """

    name: str
    accelerometer: TriadGrade
    gyroscope: TriadGrade
    g_sensitivity: float
    source: str
    assumed: tuple[str, ...] = ()
    rate: float = 100.0
    counts_per_si: tuple[float, float] = (1e4, 1e6)
    axes: str = ""
    C_instrument_case: Matrix | None = None

    def in_counts(self) -> Grade:
        """Return the grade with noise and converter in counts; its converter rounds to whole counts.

        The spread of the errors stays in SI: draw the unit before, and convert it with
        `Triad.in_raw_unit`.
        """
        force, rate = self.counts_per_si
        return replace(
            self,
            accelerometer=replace(self.accelerometer, noise=_in_counts(self.accelerometer.noise, force)),
            gyroscope=replace(self.gyroscope, noise=_in_counts(self.gyroscope.noise, rate)),
        )

    def with_wandering_biases(self, duration: float = 3600.0) -> Grade:
        """Return the grade whose biases also wander within the run, as the sheet's in-run stability says.

        It becomes a random walk from zero that has spread to the in-run stability after `duration`.

        Parameters
        ----------
        duration : s; no sheet states it, an hour is assumed.
        """

        def wandering(grade: TriadGrade) -> TriadGrade:
            if grade.bias_stability == 0.0:
                return grade
            walk = grade.bias_stability / np.sqrt(duration)
            return replace(grade, noise=replace(grade.noise, rate_random_walk=walk))

        return replace(self, accelerometer=wandering(self.accelerometer), gyroscope=wandering(self.gyroscope))

    def simulate_model(
        self,
        rng: np.random.Generator,
        *,
        nonlinear: bool = False,
        case_axes: bool = False,
        asymmetry: float = 0.0,
    ) -> ImuModel:
        """Draw one unit of this grade: its matrices, biases and g-sensitivity.

        Parameters
        ----------
        rng : source of all numbers.
        nonlinear : draw quadratic terms that have the sheet's linearity, too.
        case_axes : b is the case (forward, right, down), not the unit's own axes; raw columns stay
            those of the unit's own axes.
        asymmetry : one sigma of each sensor's scale-factor asymmetry, which no sheet states; drawn last.
        """
        g_sensitivity = rng.normal(0.0, self.g_sensitivity, (3, 3)) if self.g_sensitivity else None
        model = ImuModel(_draw(self.accelerometer, rng), _draw(self.gyroscope, rng), g_sensitivity)
        if nonlinear:
            model = replace(
                model,
                accelerometer=_bent(model.accelerometer, self.accelerometer, rng),
                gyroscope=_bent(model.gyroscope, self.gyroscope, rng),
            )
        if asymmetry > 0.0:
            model = replace(
                model,
                accelerometer=_asymmetric(model.accelerometer, asymmetry, rng),
                gyroscope=_asymmetric(model.gyroscope, asymmetry, rng),
            )
        if case_axes and self.C_instrument_case is not None:
            return model.turned(self.C_instrument_case.T)
        return model


def _in_counts(noise: TriadNoise, factor: float) -> TriadNoise:
    return replace(noise.scaled(factor), resolution=1.0)


def _draw(grade: TriadGrade, rng: np.random.Generator) -> Triad:
    matrix: Matrix = np.eye(3) + rng.normal(0.0, grade.misalignment, (3, 3))
    matrix[np.diag_indices(3)] = 1.0 + rng.normal(0.0, grade.scale_factor, 3)
    if grade.alignment > 0.0:
        matrix = np.asarray(matrix @ matrix_from_rotation_vector(rng.normal(0.0, grade.alignment, 3)))
    return Triad(matrix, rng.normal(0.0, grade.bias, 3))


def _bent(triad: Triad | None, grade: TriadGrade, rng: np.random.Generator) -> Triad | None:
    if triad is None or grade.quadratic == 0.0:
        return triad
    return replace(triad, quadratic=rng.normal(0.0, grade.quadratic, 3))


def _asymmetric(triad: Triad | None, sigma: float, rng: np.random.Generator) -> Triad | None:
    return None if triad is None else replace(triad, asymmetry=rng.normal(0.0, sigma, 3))


# What an amount in the file is in, or divided by.
_UNITS = {
    "g": STANDARD_GRAVITY,
    "mg": MILLI_G,
    "ug": MICRO_G,
    "deg/s": DEGREE,
    "deg/h": DEGREE_PER_HOUR,
    "m/s": 1.0,
    "ft/s": 0.3048,
    "ug/√Hz": MICRO_G,
    "deg/s/√Hz": DEGREE,
    "deg/√h": DEGREE_PER_ROOT_HOUR,
    "√2": float(np.sqrt(2.0)),
}


def _part(said: str) -> float:
    number, _, unit = said.partition(" ")
    return _UNITS[said] if said in _UNITS else float(number) * (_UNITS[unit] if unit else 1.0)


def _amount(said: str | float) -> float:
    """An amount of the file in SI, such as ``60 mg / 3``."""
    value, *divisors = map(_part, str(said).split(" / "))
    for divisor in divisors:
        value /= divisor
    return value


def amounts(sheet: dict[str, Any]) -> dict[str, float]:
    """Return amounts of the file in SI.

    Parameters
    ----------
    sheet : a triad of it.
    """
    return {key: _amount(said) for key, said in sheet.items()}


def _triad(sheet: dict[str, Any]) -> TriadGrade:
    si = amounts(sheet)
    noise = {field.name: si.pop(field.name) for field in fields(TriadNoise) if field.name in si}
    return TriadGrade(TriadNoise(**noise), **si)


def _grade(name: str, sheet: dict[str, Any]) -> Grade:
    force, rate = sheet["counts_per_si"]
    return Grade(
        name,
        _triad(sheet["accelerometer"]),
        _triad(sheet["gyroscope"]),
        _amount(sheet.get("g_sensitivity", 0.0)),
        sheet["source"],
        tuple(sheet["assumed"]),
        counts_per_si=(_amount(force), _amount(rate)),
        axes=sheet.get("axes", ""),
        C_instrument_case=np.array(sheet["C_instrument_case"], float) if "axes" in sheet else None,
    )


@cache
def sheets() -> dict[str, Any]:
    """Return what the file says, by grade."""
    return read_yaml(Path(__file__).with_name("grades.yaml"))


@cache
def _grades() -> dict[str, Grade]:
    return {name: _grade(name, sheet) for name, sheet in sheets().items()}


GRADES: dict[str, Grade]
"""Grades by name, from the coarsest to the finest."""


def __getattr__(name: str) -> object:
    """Read the grades at first use.

    Raises
    ------
    AttributeError
        If it is another name.
    """
    if name != "GRADES":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _grades()


def find_grade(name: str) -> Grade:
    """Return the grade of that name.

    Parameters
    ----------
    name : one of `GRADES`.

    Raises
    ------
    UsageError
        If there is none; the message lists those that there are, the nearest first.
    """
    grades = _grades()
    if name not in grades:
        import difflib

        near = difflib.get_close_matches(name.lower(), grades, 1)
        meant = f" Did you mean {near[0]}?" if near else ""
        raise UsageError(f"There is no IMU grade {name!r}; choose one of {', '.join(grades)}.{meant}")
    return grades[name]
