"""Grades of IMUs as data sheets state them: ``grades.yaml`` has each number with its source."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series
from tumble.attitude import matrix_from_rotation_vector
from tumble.errors import UsageError
from tumble.files import read_yaml
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad
from tumble.simulation.noise import TriadNoise
from tumble.units import DEGREE, DEGREE_PER_HOUR, DEGREE_PER_ROOT_HOUR, MICRO_G, MILLI_G, STANDARD_GRAVITY

if TYPE_CHECKING:
    from tumble.sensor import ThermalModel

# A sheet's linearity is read as the rms deviation from the best straight line over ± full scale, as a
# share of full scale F. For a quadratic term q it is q F² √(4/45).
_RMS_OF_QUADRATIC = float(np.sqrt(4.0 / 45.0))


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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
        grades = self.accelerometer, self.gyroscope
        g_sensitivity = rng.normal(0.0, self.g_sensitivity, (3, 3)) if self.g_sensitivity else None
        triads = [_draw(grade, rng) for grade in grades]
        if nonlinear:
            triads = [_bent(triad, grade, rng) for triad, grade in zip(triads, grades, strict=True)]
        if asymmetry > 0.0:
            triads = [replace(triad, asymmetry=rng.normal(0.0, asymmetry, 3)) for triad in triads]
        model = ImuModel(triads[0], triads[1], g_sensitivity)
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


def _bent(triad: Triad, grade: TriadGrade, rng: np.random.Generator) -> Triad:
    if grade.quadratic == 0.0:
        return triad
    return replace(triad, quadratic=rng.normal(0.0, grade.quadratic, 3))


# Of the change over half the span (60 K), one sigma of what bends it: quadratic and cubic in temperature.
BEND, TWIST, HALF_SPAN = 0.3, 0.1, 60.0
# A change of 1 K/min shifts a bias as much as this many kelvins, and the loop is this share of 100 K.
RATE_KELVINS, LOOP_SHARE = 0.5, 0.01
REFERENCE_CELSIUS = 25.0


@dataclass(frozen=True)
class TriadDrift:
    """One sigma of a triad's changes with temperature.

    Attributes
    ----------
    bias : u/K.
    scale_factor : 1/K.
    misalignment : rad/K.
    """

    bias: float
    scale_factor: float
    misalignment: float


@dataclass(frozen=True)
class ThermalGrade:
    """What temperature does to units of a grade.

    Attributes
    ----------
    accelerometer, gyroscope : m/s² and rad/s.
    thermometer_noise, thermometer_resolution : K, one sigma and step of the sensor's own thermometer.
    lag : s, of the sensors behind the thermometer.
    hysteresis_width : K.
    source, assumed : of the numbers.
    """

    accelerometer: TriadDrift
    gyroscope: TriadDrift
    thermometer_noise: float
    thermometer_resolution: float
    lag: float
    hysteresis_width: float
    source: str
    assumed: tuple[str, ...]

    def simulate_model(self, reference: ImuModel, rng: np.random.Generator) -> ThermalModel:
        """Draw how one unit changes with temperature: polynomials, rate, hysteresis and lag.

        In the frame of the accelerometers these do not turn with temperature, because a frame of theirs
        cannot; the gyros change against it.

        Parameters
        ----------
        reference : the unit at 25 °C, raw units SI.
        rng : source of all numbers.

        Raises
        ------
        UsageError
            If the unit has one triad only.
        """
        from tumble.sensor import TemperatureBasis, ThermalModel, change_frame, frame_rotation

        if reference.accelerometer is None or reference.gyroscope is None:
            raise UsageError("The model has one triad only, and a simulated unit has two: give it both.")
        C_new_b = np.real(frame_rotation(reference.accelerometer.matrix, "accelerometer-x"))
        model = change_frame(reference, "accelerometer-x")
        coefficients: dict[str, AnyArray] = {}
        rates: dict[str, Series] = {}
        loops: dict[str, Series] = {}
        lower = np.tril(np.ones((3, 3)))
        for name, drift, shape in (
            ("accelerometer", self.accelerometer, lower),
            ("gyroscope", self.gyroscope, np.ones((3, 3))),
        ):
            change = rng.normal(0.0, drift.bias, (3, 3)) * _sizes()[:, None]
            coefficients[f"{name}.bias"] = change
            matrix = rng.normal(0.0, drift.misalignment, (3, 3, 3))
            matrix[:, range(3), range(3)] = rng.normal(0.0, drift.scale_factor, (3, 3))
            # Scale factors and angles bend less than biases do: straight lines and a little.
            matrix *= np.array([1.0, 0.3 * BEND / HALF_SPAN, 0.0])[:, None, None]
            coefficients[f"{name}.matrix"] = matrix * shape
            rates[f"{name}.bias"] = rng.normal(0.0, RATE_KELVINS * drift.bias * 60.0, 3)
            loops[f"{name}.bias"] = rng.normal(0.0, LOOP_SHARE * drift.bias * 100.0, 3)
        thermal = ThermalModel(
            model,
            TemperatureBasis("polynomial", REFERENCE_CELSIUS, order=3),
            coefficients,
            rates,
            loops,
            hysteresis_width=self.hysteresis_width,
            lag=self.lag,
        )
        return thermal.turned(C_new_b.T)


def _sizes() -> Series:
    """Return the size of the coefficients of ΔT, ΔT², ΔT³ against the first."""
    return np.array([1.0, BEND / HALF_SPAN, TWIST / HALF_SPAN**2])


_SHAPE = (
    "quadratic and cubic parts of the biases (0.3 and 0.1 of the straight line at 60 K)",
    "dependence on the rate (as 0.5 K of change at 1 K/min) and hysteresis (1 % of the change over 100 K)",
    "its width of 5 K, and a lag of 30 s between sensor and thermometer",
    "noise of the thermometer",
)
_LAG, _WIDTH = 30.0, 5.0


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


def _amounts(sheet: dict[str, Any]) -> dict[str, float]:
    """Amounts of the file in SI."""
    return {key: _amount(said) for key, said in sheet.items()}


def _triad(sheet: dict[str, Any]) -> TriadGrade:
    si = _amounts(sheet)
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
def _sheets() -> dict[str, Any]:
    """What the file says, by grade."""
    return read_yaml(Path(__file__).with_name("grades.yaml"))


@cache
def _grades() -> dict[str, Grade]:
    return {name: _grade(name, sheet) for name, sheet in _sheets().items()}


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


def find_thermal_grade(name: str) -> ThermalGrade:
    """Return what temperature does to units of a grade.

    Raises
    ------
    UsageError
        If nobody has said it of that grade.
    """
    find_grade(name)
    sheet = _sheets()[name]["thermal"]
    return ThermalGrade(
        TriadDrift(**_amounts(sheet["accelerometer"])),
        TriadDrift(**_amounts(sheet["gyroscope"])),
        **_amounts({key: sheet[key] for key in ("thermometer_noise", "thermometer_resolution")}),
        lag=_LAG,
        hysteresis_width=_WIDTH,
        source=sheet["source"],
        assumed=(*sheet["assumed"], *_SHAPE),
    )
