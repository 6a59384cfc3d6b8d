"""Grades of IMUs as data sheets state them, each number with its source.

A sheet's tolerance of a bias, a scale factor or an axis is taken as three standard deviations; what it
states as one sigma is taken as it stands. A sheet's largest random walk is taken as the random walk, as
Hayal (2010, table 3.1) does. What a sheet does not state is marked *assumed* here and named in
`Grade.assumed`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix
from tumble.attitude.rotations import matrix_from_rotation_vector
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.sensor.imu import ImuModel
from tumble.sensor.triad import Triad
from tumble.simulation.noise import TriadNoise
from tumble.units import DEGREE, DEGREE_PER_HOUR, DEGREE_PER_ROOT_HOUR, MICRO_G, MILLI_G, STANDARD_GRAVITY

# The angle between two axes varies √2 times as much as each axis about one direction.
_PAIR = float(np.sqrt(2.0))
# One count of such a unit is an increment of 2⁻²⁷ ft/s or 2⁻³³ rad over a sample of 10 ms.
_HG_COUNTS_PER_SI = (2.0**27 / (0.3048 * 100.0), 2.0**33 / 100.0)


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


_CONSUMER = Grade(
    name="consumer-mems",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=400.0 * MICRO_G / np.sqrt(2.0),  # 400 µg/√Hz
            bias_instability=0.05 * MILLI_G,  # assumed
            resolution=STANDARD_GRAVITY / 8192.0,  # ±4 g range
            full_scale=4.0 * STANDARD_GRAVITY,
        ),
        bias=60.0 * MILLI_G / 3.0,  # zero-g: ±50 mg x, y, ±80 mg z
        scale_factor=0.03 / 3.0,  # ±3 %
        misalignment=0.02 / 3.0,  # cross-axis ±2 %
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.005 * DEGREE / np.sqrt(2.0),  # 0.005 (deg/s)/√Hz
            bias_instability=20.0 * DEGREE_PER_HOUR,  # assumed
            resolution=DEGREE / 65.5,  # ±500 deg/s range
            full_scale=500.0 * DEGREE,
        ),
        bias=20.0 * DEGREE / 3.0,  # zero-rate output ±20 deg/s
        scale_factor=0.03 / 3.0,  # ±3 %
        misalignment=0.02 / 3.0,  # cross-axis ±2 %
    ),
    g_sensitivity=0.1 * DEGREE / STANDARD_GRAVITY,  # 0.1 (deg/s)/g
    source="InvenSense MPU-6000/MPU-6050 Product Specification PS-MPU-6000A-00 rev. 3.4 (2013), 6.1 and 6.2",
    assumed=("bias instability of both triads",),
    counts_per_si=(8192.0 / STANDARD_GRAVITY, 65.5 / DEGREE),
)

_INDUSTRIAL = Grade(
    name="industrial-mems",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=120.0 * MICRO_G / np.sqrt(2.0),  # 120 µg/√Hz
            bias_instability=0.03 * MILLI_G,
            resolution=16.0 * STANDARD_GRAVITY / 32768.0,  # assumed: 16 bit
            full_scale=16.0 * STANDARD_GRAVITY,
        ),
        bias=5.0 * MILLI_G,  # assumed
        scale_factor=0.003,  # assumed
        misalignment=0.001,  # assumed
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.007 * DEGREE / np.sqrt(2.0),  # 0.007 (deg/s)/√Hz
            bias_instability=10.0 * DEGREE_PER_HOUR,
            resolution=2000.0 * DEGREE / 32768.0,  # assumed: 16 bit
            full_scale=2000.0 * DEGREE,
        ),
        bias=0.2 * DEGREE,  # assumed
        scale_factor=0.003,  # assumed
        misalignment=0.001,  # assumed
    ),
    g_sensitivity=0.01 * DEGREE / STANDARD_GRAVITY,  # assumed
    source="Xsens MTi 1-series data sheet, as tabulated in Transactions on Aerospace Research (2023), "
    "doi 10.2478/tar-2023-0022",
    assumed=(
        "resolution of 16 bits",
        "turn-on bias, scale factor and misalignment of both triads",
        "g-sensitivity",
    ),
    counts_per_si=(32768.0 / (16.0 * STANDARD_GRAVITY), 32768.0 / (2000.0 * DEGREE)),
)

_TACTICAL = Grade(
    name="tactical",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=0.065 * 0.3048 / 60.0,  # 0.065 (ft/s)/√h
            bias_instability=0.05 * MILLI_G,  # assumed
            full_scale=50.0 * STANDARD_GRAVITY,  # assumed
        ),
        bias=1.0 * MILLI_G,
        scale_factor=300e-6,  # assumed
        misalignment=500e-6,  # assumed
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.125 * DEGREE_PER_ROOT_HOUR,
            bias_instability=0.3 * DEGREE_PER_HOUR,  # assumed
            full_scale=1000.0 * DEGREE,  # assumed
        ),
        bias=1.0 * DEGREE_PER_HOUR,
        scale_factor=150e-6,  # assumed
        misalignment=500e-6,  # assumed
    ),
    g_sensitivity=0.0,
    source="Honeywell HG1700 brochure N61-1619-000-001 (higher-end versions)",
    assumed=(
        "bias instability of both triads",
        "scale factor and misalignment of both triads",
        "full scale of both triads",
        "no g-sensitivity",
        "counts as of hg1700",
    ),
    counts_per_si=_HG_COUNTS_PER_SI,
)

_RING_LASER = Grade(
    name="ring-laser",
    accelerometer=TriadGrade(
        TriadNoise(
            random_walk=0.0143 / 60.0,  # assumed: the sheet states none
            bias_instability=5.0 * MICRO_G,  # assumed
            full_scale=38.0 * STANDARD_GRAVITY,  # assumed
        ),
        bias=25.0 * MICRO_G,
        scale_factor=100e-6,
        misalignment=50e-6,  # assumed
    ),
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.002 * DEGREE_PER_ROOT_HOUR,
            bias_instability=0.001 * DEGREE_PER_HOUR,  # assumed
            full_scale=1074.0 * DEGREE,  # assumed
        ),
        bias=0.003 * DEGREE_PER_HOUR,
        scale_factor=5e-6,
        misalignment=50e-6,  # assumed
    ),
    g_sensitivity=0.0,
    source="Honeywell HG9900 brochure N61-1638-000-000",
    assumed=(
        "velocity random walk",
        "bias instability of both triads",
        "misalignment of both triads",
        "full scale of both triads",
        "no g-sensitivity",
        "counts as of hg1700",
    ),
    counts_per_si=_HG_COUNTS_PER_SI,
)

_HG_AXES = (
    "x through the top of the case and up, y towards the connector of the cable, z completes the right-handed "
    "triad (Hayal 2010, 2.1.5)"
)
# With the connector taken as the case's front (assumed): x is up, y forward, z left.
_HG_C_INSTRUMENT_CASE = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_HG_SOURCE = (
    "Honeywell Tactical Inertial Measurement Units (2007), as tabulated in Hayal, Static Calibration "
    "of the Tactical Grade Inertial Measurement Units, Ohio State University (2010), table 2.1. "
    "Counts: NovAtel OEM7 manual, log RAWIMUSX (HG1700-AG58, HG1900)"
)
_HG_ASSUMED = (
    "no flicker (the sheet states in-run stability instead)",
    "the time in which in-run stability is reached, one hour",
    "linearity as a quadratic term",
    "connector at the front of the case",
)

_HG_ACCELEROMETER = TriadGrade(
    TriadNoise(
        random_walk=0.22 / 60.0,  # 0.22 (m/s)/√h, the sheet's maximum: 3.6667e-3 m/s² for samples of 1 s
        full_scale=70.0 * STANDARD_GRAVITY,  # operating range 70 g
    ),
    bias=1.0 * MILLI_G,  # bias repeatability 1 mg (1σ)
    scale_factor=300e-6,  # scale factor error 300 ppm (1σ)
    misalignment=100e-6 / _PAIR,  # axis alignment stability (non-orthogonality) 100 µrad (1σ)
    linearity=500e-6,  # scale factor linearity 500 ppm (1σ)
    bias_stability=1.0 * MILLI_G,  # bias stability 1 mg (1σ)
)

_HG1700 = Grade(
    name="hg1700",
    accelerometer=_HG_ACCELEROMETER,
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.125 * DEGREE_PER_ROOT_HOUR,  # 0.125 deg/√h, the maximum: 3.6361e-5 rad/s for 1 s
            full_scale=1074.0 * DEGREE,  # operating range ± 1074 deg/s
        ),
        bias=1.0 * DEGREE_PER_HOUR,  # bias repeatability 1 deg/h (1σ)
        scale_factor=150e-6,  # scale factor repeatability 150 ppm (1σ)
        misalignment=100e-6 / _PAIR,  # axis alignment stability (non-orthogonality) 100 µrad (1σ)
        alignment=500e-6,  # axis alignment stability 500 µrad (1σ)
        linearity=150e-6,  # scale factor linearity 150 ppm (1σ)
        bias_stability=1.0 * DEGREE_PER_HOUR,  # bias, in-run stability 1 deg/h (1σ)
    ),
    g_sensitivity=0.0,  # the sheet's field is empty
    source=_HG_SOURCE,
    assumed=("no g-sensitivity", *_HG_ASSUMED),
    counts_per_si=_HG_COUNTS_PER_SI,
    axes=_HG_AXES,
    C_instrument_case=_HG_C_INSTRUMENT_CASE,
)

_HG1900 = Grade(
    name="hg1900",
    accelerometer=_HG_ACCELEROMETER,
    gyroscope=TriadGrade(
        TriadNoise(
            random_walk=0.09 * DEGREE_PER_ROOT_HOUR,  # 0.09 deg/√h, the maximum: 2.6180e-5 rad/s for 1 s
            full_scale=1000.0 * DEGREE,  # operating range ± 1000 deg/s
        ),
        bias=17.0 * DEGREE_PER_HOUR,  # bias repeatability < 17 deg/h (1σ)
        scale_factor=150e-6,  # scale factor repeatability 150 ppm (1σ)
        misalignment=50e-6 / _PAIR,  # axis alignment stability (non-orthogonality) 50 µrad (1σ)
        alignment=80e-6,  # axis alignment stability 80 µrad (1σ)
        linearity=150e-6,  # scale factor linearity 150 ppm (1σ)
        bias_stability=7.0 * DEGREE_PER_HOUR,  # bias, in-run stability < 7 deg/h (1σ)
    ),
    g_sensitivity=3.0 * DEGREE_PER_HOUR / STANDARD_GRAVITY,  # bias static g sensitivity 3 (deg/h)/g (1σ)
    source=_HG_SOURCE,
    assumed=_HG_ASSUMED,
    counts_per_si=_HG_COUNTS_PER_SI,
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
        If there is none; the message lists those that there are, the nearest first.
    """
    if name not in GRADES:
        import difflib

        near = difflib.get_close_matches(name.lower(), GRADES, 1)
        meant = f" Did you mean {near[0]}?" if near else ""
        raise UsageError(f"There is no IMU grade {name!r}; choose one of {', '.join(GRADES)}.{meant}")
    return GRADES[name]
