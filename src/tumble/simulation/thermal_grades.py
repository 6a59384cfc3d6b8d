"""How much a grade of IMU changes with temperature: what sheets state, and what had to be assumed."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.sensor.gauge import change_frame, frame_rotation
from tumble.sensor.imu import ImuModel
from tumble.sensor.thermal import TemperatureBasis, ThermalModel
from tumble.simulation.grades import amounts, find_grade, sheets

# Of the change over half the span (60 K), one sigma of what bends it: quadratic and cubic in temperature.
BEND, TWIST, HALF_SPAN = 0.3, 0.1, 60.0
# A change of 1 K/min shifts a bias as much as this many kelvins, and the loop is this share of 100 K.
RATE_KELVINS, LOOP_SHARE = 0.5, 0.01
REFERENCE_CELSIUS = 25.0


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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


def find_thermal_grade(name: str) -> ThermalGrade:
    """Return what temperature does to units of a grade.

    Raises
    ------
    UsageError
        If nobody has said it of that grade.
    """
    find_grade(name)
    sheet = sheets()[name]["thermal"]
    return ThermalGrade(
        TriadDrift(**amounts(sheet["accelerometer"])),
        TriadDrift(**amounts(sheet["gyroscope"])),
        **amounts({key: sheet[key] for key in ("thermometer_noise", "thermometer_resolution")}),
        lag=_LAG,
        hysteresis_width=_WIDTH,
        source=sheet["source"],
        assumed=(*sheet["assumed"], *_SHAPE),
    )
