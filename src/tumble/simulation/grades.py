"""Grades of IMUs as data sheets state them, each number with its source.

A sheet's tolerance or maximum is taken as three standard deviations. What a sheet does not state is
marked *assumed*.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tumble.arrays import Matrix
from tumble.attitude.rotations import matrix_from_rotation_vector
from tumble.errors import UsageError
from tumble.sensor.imu import ImuModel
from tumble.sensor.triad import Triad
from tumble.simulation.noise import TriadNoise
from tumble.units import STANDARD_GRAVITY

_DEGREE = np.pi / 180.0
_PER_HOUR = _DEGREE / 3600.0  # (rad/s) per (deg/h)
_PER_ROOT_HOUR = _DEGREE / 60.0  # (rad/√s) per (deg/√h)
_MILLI = STANDARD_GRAVITY * 1e-3
_MICRO = STANDARD_GRAVITY * 1e-6


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
    """

    noise: TriadNoise
    bias: float
    scale_factor: float
    misalignment: float
    alignment: float = 0.0


@dataclass(frozen=True, slots=True)
class Grade:
    """A grade of IMU.

    Attributes
    ----------
    name : as asked for.
    accelerometer, gyroscope : m/s² and rad/s.
    g_sensitivity : (rad/s)/(m/s²), one sigma of each element.
    source : of every number.
    rate : Hz at which such a unit is usually recorded.
    counts_per_si : raw counts per m/s² and per rad/s, for recordings in counts.
    axes : how the unit's own axes lie in its case, in words; the body frame b of a simulated recording is
        that of the unit's own axes, which are the recording's columns.
    C_instrument_case : (3, 3), the unit's own axes in a case frame of forward, right, down; or None.
    """

    name: str
    accelerometer: TriadGrade
    gyroscope: TriadGrade
    g_sensitivity: float
    source: str
    rate: float = 100.0
    counts_per_si: tuple[float, float] = (1e4, 1e6)
    axes: str = ""
    C_instrument_case: Matrix | None = None

    def in_counts(self) -> Grade:
        """Return the grade with noise and converter in counts; its converter rounds to whole counts."""
        force, rate = self.counts_per_si
        return replace(
            self,
            accelerometer=replace(self.accelerometer, noise=_scaled(self.accelerometer.noise, force)),
            gyroscope=replace(self.gyroscope, noise=_scaled(self.gyroscope.noise, rate)),
        )

    def simulate_model(self, rng: np.random.Generator) -> ImuModel:
        """Draw one unit of this grade: its matrices, biases and g-sensitivity.

        Parameters
        ----------
        rng : source of all numbers.
        """
        g_sensitivity = rng.normal(0.0, self.g_sensitivity, (3, 3)) if self.g_sensitivity else None
        return ImuModel(_draw(self.accelerometer, rng), _draw(self.gyroscope, rng), g_sensitivity)


def _scaled(noise: TriadNoise, factor: float) -> TriadNoise:
    return TriadNoise(
        random_walk=factor * noise.random_walk,
        bias_instability=factor * noise.bias_instability,
        rate_random_walk=factor * noise.rate_random_walk,
        resolution=1.0,
        full_scale=factor * noise.full_scale,
    )


def _draw(grade: TriadGrade, rng: np.random.Generator) -> Triad:
    matrix: Matrix = np.eye(3) + rng.normal(0.0, grade.misalignment, (3, 3))
    matrix[np.diag_indices(3)] = 1.0 + rng.normal(0.0, grade.scale_factor, 3)
    if grade.alignment > 0.0:
        matrix = np.asarray(matrix @ matrix_from_rotation_vector(rng.normal(0.0, grade.alignment, 3)))
    return Triad(matrix, rng.normal(0.0, grade.bias, 3))


_CONSUMER = Grade(
    name="consumer-mems",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=400.0 * _MICRO / np.sqrt(2.0),  # 400 µg/√Hz
            bias_instability=0.05 * _MILLI,  # assumed
            resolution=STANDARD_GRAVITY / 8192.0,  # ±4 g range
            full_scale=4.0 * STANDARD_GRAVITY,
        ),
        bias=60.0 * _MILLI / 3.0,  # zero-g: ±50 mg x, y, ±80 mg z
        scale_factor=0.03 / 3.0,  # ±3 %
        misalignment=0.02 / 3.0,  # cross-axis ±2 %
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.005 * _DEGREE / np.sqrt(2.0),  # 0.005 (deg/s)/√Hz
            bias_instability=20.0 * _PER_HOUR,  # assumed
            resolution=_DEGREE / 65.5,  # ±500 deg/s range
            full_scale=500.0 * _DEGREE,
        ),
        bias=20.0 * _DEGREE / 3.0,  # zero-rate output ±20 deg/s
        scale_factor=0.03 / 3.0,  # ±3 %
        misalignment=0.02 / 3.0,  # cross-axis ±2 %
    ),
    g_sensitivity=0.1 * _DEGREE / STANDARD_GRAVITY,  # 0.1 (deg/s)/g
    source="InvenSense MPU-6000/MPU-6050 Product Specification PS-MPU-6000A-00 rev. 3.4 (2013), 6.1 and 6.2",
    counts_per_si=(8192.0 / STANDARD_GRAVITY, 65.5 / _DEGREE),
)

_INDUSTRIAL = Grade(
    name="industrial-mems",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=120.0 * _MICRO / np.sqrt(2.0),  # 120 µg/√Hz
            bias_instability=0.03 * _MILLI,
            resolution=16.0 * STANDARD_GRAVITY / 32768.0,  # assumed: 16 bit
            full_scale=16.0 * STANDARD_GRAVITY,
        ),
        bias=5.0 * _MILLI,  # assumed
        scale_factor=0.003,  # assumed
        misalignment=0.001,  # assumed
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.007 * _DEGREE / np.sqrt(2.0),  # 0.007 (deg/s)/√Hz
            bias_instability=10.0 * _PER_HOUR,
            resolution=2000.0 * _DEGREE / 32768.0,  # assumed: 16 bit
            full_scale=2000.0 * _DEGREE,
        ),
        bias=0.2 * _DEGREE,  # assumed
        scale_factor=0.003,  # assumed
        misalignment=0.001,  # assumed
    ),
    g_sensitivity=0.01 * _DEGREE / STANDARD_GRAVITY,  # assumed
    source="Xsens MTi 1-series data sheet, as tabulated in Transactions on Aerospace Research (2023), "
    "doi 10.2478/tar-2023-0022",
    counts_per_si=(32768.0 / (16.0 * STANDARD_GRAVITY), 32768.0 / (2000.0 * _DEGREE)),
)

_TACTICAL = Grade(
    name="tactical",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=0.065 * 0.3048 / 60.0,  # 0.065 (ft/s)/√h
            bias_instability=0.05 * _MILLI,  # assumed
            full_scale=50.0 * STANDARD_GRAVITY,  # assumed
        ),
        bias=1.0 * _MILLI,
        scale_factor=300e-6,  # assumed
        misalignment=500e-6,  # assumed
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.125 * _PER_ROOT_HOUR,
            bias_instability=0.3 * _PER_HOUR,  # assumed
            full_scale=1000.0 * _DEGREE,  # assumed
        ),
        bias=1.0 * _PER_HOUR,
        scale_factor=150e-6,  # assumed
        misalignment=500e-6,  # assumed
    ),
    g_sensitivity=0.0,
    source="Honeywell HG1700 brochure N61-1619-000-001 (higher-end versions)",
)

_RING_LASER = Grade(
    name="ring-laser",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=0.0143 / 60.0,  # assumed: the sheet states none
            bias_instability=5.0 * _MICRO,  # assumed
            full_scale=38.0 * STANDARD_GRAVITY,  # assumed
        ),
        bias=25.0 * _MICRO,
        scale_factor=100e-6,
        misalignment=50e-6,  # assumed
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.002 * _PER_ROOT_HOUR,
            bias_instability=0.001 * _PER_HOUR,  # assumed
            full_scale=1074.0 * _DEGREE,  # assumed
        ),
        bias=0.003 * _PER_HOUR,
        scale_factor=5e-6,
        misalignment=50e-6,  # assumed
    ),
    g_sensitivity=0.0,
    source="Honeywell HG9900 brochure N61-1638-000-000",
)

_HG_AXES = (
    "x through the top of the case and up, y towards the connector of the cable, z completes the right-handed "
    "triad (Hayal 2010, 2.1.5)"
)
# With the connector taken as the case's front (assumed): x is up, y forward, z left.
_HG_C_INSTRUMENT_CASE = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_HG_SOURCE = (
    "Honeywell Tactical Inertial Measurement Units (2007), as tabulated in Hayal 2010, table 2.1. Not modelled: "
    "scale-factor linearity (150 ppm; accelerometers 500 ppm), g²-sensitivity, acoustic and vibration rectification"
)

_HG1700 = Grade(
    name="hg1700",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=0.22 / 60.0,  # 0.22 (m/s)/√h, the sheet's maximum: 3.667e-3 m/s² for samples of 1 s
            bias_instability=1.0 * _MILLI,  # bias stability 1 mg, taken as flicker
            full_scale=70.0 * STANDARD_GRAVITY,
        ),
        bias=1.0 * _MILLI,  # bias repeatability
        scale_factor=300e-6,
        misalignment=100e-6,  # axis alignment stability, non-orthogonality
        alignment=500e-6,  # axis alignment stability; the sheet states it for the gyros
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.125 * _PER_ROOT_HOUR,  # the sheet's maximum: 3.636e-5 rad/s for samples of 1 s
            bias_instability=1.0 * _PER_HOUR,  # in-run stability 1 deg/h, taken as flicker
            full_scale=1074.0 * _DEGREE,
        ),
        bias=1.0 * _PER_HOUR,  # bias repeatability
        scale_factor=150e-6,
        misalignment=100e-6,
        alignment=500e-6,
    ),
    g_sensitivity=0.0,  # a ring laser has none worth a line on the sheet
    source=_HG_SOURCE,
    counts_per_si=(1e5, 1e7),
    axes=_HG_AXES,
    C_instrument_case=_HG_C_INSTRUMENT_CASE,
)

_HG1900 = Grade(
    name="hg1900",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=0.22 / 60.0,
            bias_instability=1.0 * _MILLI,
            full_scale=70.0 * STANDARD_GRAVITY,
        ),
        bias=1.0 * _MILLI,
        scale_factor=300e-6,
        misalignment=100e-6,
        alignment=80e-6,
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.09 * _PER_ROOT_HOUR,  # 2.618e-5 rad/s for samples of 1 s
            bias_instability=7.0 * _PER_HOUR,  # in-run stability below 7 deg/h, taken as flicker of that size
            full_scale=1000.0 * _DEGREE,
        ),
        bias=17.0 * _PER_HOUR,  # bias repeatability below 17 deg/h
        scale_factor=150e-6,
        misalignment=50e-6,
        alignment=80e-6,
    ),
    g_sensitivity=3.0 * _PER_HOUR / STANDARD_GRAVITY,  # 3 (deg/h)/g
    source=_HG_SOURCE,
    counts_per_si=(1e5, 1e7),
    axes=_HG_AXES,
    C_instrument_case=_HG_C_INSTRUMENT_CASE,
)

GRADES: dict[str, Grade] = {
    grade.name: grade for grade in (_CONSUMER, _INDUSTRIAL, _HG1900, _HG1700, _TACTICAL, _RING_LASER)
}
"""Grades by name, from the coarsest to the finest."""


def find_grade(name: str) -> Grade:
    """Return the grade of that name.

    Parameters
    ----------
    name : one of `GRADES`.

    Raises
    ------
    UsageError
        If there is none; the message lists those that there are.
    """
    if name not in GRADES:
        raise UsageError(f"There is no IMU grade {name!r}; choose one of {', '.join(GRADES)}.")
    return GRADES[name]
