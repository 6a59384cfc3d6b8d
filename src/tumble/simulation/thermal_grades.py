"""How much a grade of IMU changes with temperature: what sheets state, and what had to be assumed."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.sensor.gauge import change_frame, frame_rotation
from tumble.sensor.imu import ImuModel
from tumble.sensor.thermal import TemperatureBasis, ThermalModel
from tumble.units import DEGREE, DEGREE_PER_HOUR, MICRO_G, MILLI_G

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

_CONSUMER = ThermalGrade(
    TriadDrift(
        bias=60.0 * MILLI_G / 3.0 / 45.0,  # zero-g level change: z ±60 mg from 0 to 70 °C, 45 K from 25 °C
        scale_factor=0.02e-2 / 3.0,  # sensitivity change ±0.02 %/°C
        misalignment=20e-6,  # assumed
    ),
    TriadDrift(
        bias=20.0 * DEGREE / 3.0 / 65.0,  # ZRO variation ±20 °/s from -40 to 85 °C, 65 K from 25 °C
        scale_factor=0.02 / 3.0 / 65.0,  # scale factor variation ±2 % over the same
        misalignment=20e-6,  # assumed
    ),
    thermometer_noise=0.05,
    thermometer_resolution=1.0 / 340.0,  # 340 LSB/°C
    lag=_LAG,
    hysteresis_width=_WIDTH,
    source="InvenSense MPU-6000/MPU-6050 Product Specification PS-MPU-6000A-00 rev. 3.4 (2013), 6.1 to 6.3, each "
    "limit as three standard deviations",
    assumed=("change of misalignment, 20 µrad/K", *_SHAPE),
)


def _assumed(
    force: tuple[float, float, float], rate: tuple[float, float, float], noise: float, step: float
) -> ThermalGrade:
    return ThermalGrade(
        TriadDrift(*force), TriadDrift(*rate), noise, step, _LAG, _WIDTH, "none", ("everything", *_SHAPE)
    )


THERMAL_GRADES: dict[str, ThermalGrade] = {
    "consumer-mems": _CONSUMER,
    "industrial-mems": _assumed((0.1 * MILLI_G, 3e-5, 3e-6), (5e-3 * DEGREE, 3e-5, 3e-6), 0.05, 1.0 / 256.0),
    "hg1900": _assumed((0.01 * MILLI_G, 3e-6, 1e-6), (0.3 * DEGREE_PER_HOUR, 3e-6, 1e-6), 0.02, 0.01),
    "hg1700": _assumed((0.01 * MILLI_G, 3e-6, 1e-6), (0.03 * DEGREE_PER_HOUR, 2e-6, 1e-6), 0.02, 0.01),
    "tactical": _assumed((0.01 * MILLI_G, 3e-6, 1e-6), (0.03 * DEGREE_PER_HOUR, 2e-6, 1e-6), 0.02, 0.01),
    "ring-laser": _assumed((1.0 * MICRO_G, 1e-6, 2e-7), (1e-4 * DEGREE_PER_HOUR, 1e-7, 2e-7), 0.01, 0.01),
}
"""By the name of the grade."""


def find_thermal_grade(name: str) -> ThermalGrade:
    """Return what temperature does to units of a grade.

    Raises
    ------
    UsageError
        If nobody has said it of that grade.
    """
    if name not in THERMAL_GRADES:
        raise UsageError(
            f"Nothing is known of the grade {name!r} and temperature: choose one of {', '.join(THERMAL_GRADES)}."
        )
    return THERMAL_GRADES[name]
