"""What a thermal calibration was made of, for those who look at it: points, branches, candidates, what was left out."""

from __future__ import annotations

from dataclasses import field

from tumble.arrays import Series, Table, Vectors
from tumble.calibration.evidence import Evidence
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
class BiasCurve:
    """A triad's bias against the sensor's temperature.

    Attributes
    ----------
    celsius : (temperatures,) °C.
    bias, sigma : (temperatures, 3) raw, settled and half way through the loop, and its standard uncertainty.
    heating, cooling : (temperatures, 3) raw, at the two ends of the loop.
    """

    celsius: Series
    bias: Vectors
    sigma: Vectors
    heating: Vectors
    cooling: Vectors


@dataclass(frozen=True, slots=True)
class SeparateBias:
    """The accelerometers' bias from the multi-position test at one temperature alone.

    Attributes
    ----------
    celsius : °C.
    bias, sigma : (3,) raw.
    joint_sigma : (3,) raw, of the one adjustment at that temperature.
    """

    celsius: float
    bias: Series
    sigma: Series
    joint_sigma: Series


@dataclass(frozen=True, slots=True)
class Candidate:
    """A basis that was tried.

    Attributes
    ----------
    name, unknowns : what it is, and how many unknowns that makes.
    score, spread : mean square of what it predicts wrongly, in sigmas, over the folds; its standard error.
    folds : of each fold.
    chosen : whether it is the one.
    """

    name: str
    unknowns: int
    score: float
    spread: float
    folds: tuple[float, ...] = ()
    chosen: bool = False


@dataclass(slots=True)
class ThermalCurves(Evidence):
    """Behind a thermal model.

    Attributes
    ----------
    kind : "soak" or "ramp".
    basis : in words.
    start, stop : (points,) s of the rests used.
    celsius, celsius_rate, hysteresis : (points,) °C, K/s, -1 to 1, of the sensors.
    force, rate : (points, 3) raw bias that each rest shows, where it shows one (NaN elsewhere).
    rate_sigma : (points, 3) raw.
    residuals : (points, 6) in sigmas, specific force and angular rate; NaN where there is no equation.
    curves : "accelerometer" and "gyroscope": bias against temperature with its standard uncertainty.
    separate : of each soak alone.
    candidates : bases that were tried.
    rejected : (start, stop) s and why, of rests that took no part.
    path_time, path_celsius : a thinned course of temperature.
    lag, width : s and K.
    poses : how many different poses there were.
    """

    kind: str
    basis: str
    start: Series
    stop: Series
    celsius: Series
    celsius_rate: Series
    hysteresis: Series
    force: Vectors
    rate: Vectors
    rate_sigma: Vectors
    residuals: Table
    curves: dict[str, BiasCurve]
    path_time: Series
    path_celsius: Series
    separate: list[SeparateBias] = field(default_factory=list[SeparateBias])
    candidates: list[Candidate] = field(default_factory=list[Candidate])
    rejected: list[tuple[float, float, str]] = field(default_factory=list[tuple[float, float, str]])
    lag: float = 0.0
    width: float = 5.0
    poses: int = 0
