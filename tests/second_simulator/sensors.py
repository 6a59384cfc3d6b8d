"""Units with known errors: what is true in, raw numbers out.

The raw number of a sensor is, by the conventions' page and nothing else::

    u   = matrix @ true
    raw = u + asymmetry * |u| + quadratic * u**2 + g_sensitivity @ specific_force + bias + noise

computed here in SI and then turned into the output's own unit, rounded to its steps and cut at its limits.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

STANDARD_GRAVITY = 9.80665
DEGREE = np.pi / 180.0
MICRO_G = 1e-6 * STANDARD_GRAVITY
DEGREE_PER_HOUR = DEGREE / 3600.0


@dataclass(frozen=True)
class TriadSheet:
    """What a data sheet says of one triad, in SI; every spread is one standard deviation.

    `noise` is the density of white noise per root hertz, `flicker` the bias instability B of IEEE Std 952,
    `walk` the random walk K of the bias, `step` the quantum of the output, `limit` its full scale, `warm_up`
    what the bias moves by after switching on, `per_kelvin` how it moves with temperature.
    """

    noise: float
    flicker: float
    walk: float
    bias: float
    scale: float
    axes: float
    asymmetry: float
    step: float
    limit: float
    warm_up: float
    per_kelvin: float
    scale_per_kelvin: float


@dataclass(frozen=True)
class Grade:
    """A kind of unit; `between` is the rotation between the triads (rad), `g_sensitivity` in rad/s per m/s².

    `unit` is the one that is always drawn; None draws another each time.
    """

    name: str
    accelerometer: TriadSheet
    gyroscope: TriadSheet
    between: float
    g_sensitivity: float
    units: str
    surveyed: bool
    unit: Unit | None = None


GRADES = {
    # A phone's or a drone's unit; numbers in g and degrees per second, 16 bits of 8 g and 1000 °/s.
    "consumer": Grade(
        "consumer",
        TriadSheet(150 * MICRO_G, 35 * MICRO_G, 0.1 * MICRO_G, 30e-3 * 9.8, 8e-3, 5e-3, 1.5e-3,
                   8 * STANDARD_GRAVITY / 32768, 8 * STANDARD_GRAVITY, 8e-3 * 9.8, 0.15e-3 * 9.8, 50e-6),
        TriadSheet(0.008 * DEGREE, 9 * DEGREE_PER_HOUR, 2e-7, 0.6 * DEGREE, 1e-2, 7e-3, 1.5e-3,
                   1000 / 32768 * DEGREE, 1000 * DEGREE, 0.15 * DEGREE, 0.01 * DEGREE, 80e-6),
        8e-3, 0.05 * DEGREE / 9.8, "g,deg/s", False,
    ),
    # A surveyor's MEMS unit; numbers in SI.
    "industrial": Grade(
        "industrial",
        TriadSheet(60 * MICRO_G, 14 * MICRO_G, 0.02 * MICRO_G, 3e-3 * 9.8, 1.5e-3, 1e-3, 4e-4,
                   5e-5 * 9.8, 10 * STANDARD_GRAVITY, 1e-3 * 9.8, 0.03e-3 * 9.8, 15e-6),
        TriadSheet(0.004 * DEGREE, 5 * DEGREE_PER_HOUR, 5e-8, 0.1 * DEGREE, 2e-3, 1.2e-3, 4e-4,
                   0.002 * DEGREE, 450 * DEGREE, 0.03 * DEGREE, 0.002 * DEGREE, 20e-6),
        2e-3, 0.004 * DEGREE / 9.8, "m/s^2,rad/s", True,
    ),
    # A car's unit: quiet accelerometers that wander much, noisy gyros that wander little. Nothing was tuned on it.
    "automotive": Grade(
        "automotive",
        TriadSheet(45 * MICRO_G, 30 * MICRO_G, 0.05 * MICRO_G, 12e-3 * 9.8, 4e-3, 3e-3, 8e-4,
                   1e-4 * 9.8, 6 * STANDARD_GRAVITY, 3e-3 * 9.8, 0.08e-3 * 9.8, 30e-6),
        TriadSheet(0.01 * DEGREE, 3 * DEGREE_PER_HOUR, 2e-8, 0.25 * DEGREE, 5e-3, 3e-3, 8e-4,
                   0.005 * DEGREE, 300 * DEGREE, 0.06 * DEGREE, 0.004 * DEGREE, 40e-6),
        4e-3, 0.015 * DEGREE / 9.8, "m/s^2,rad/s", False,
    ),
    # A hobbyist's board: sensors soldered on by eye, whose axes lean by degrees. Nothing was tuned on it.
    "hobby": Grade(
        "hobby",
        TriadSheet(100 * MICRO_G, 60 * MICRO_G, 0.1 * MICRO_G, 40e-3 * 9.8, 2e-2, 3e-2, 2e-3,
                   16 * STANDARD_GRAVITY / 65536, 16 * STANDARD_GRAVITY, 5e-3 * 9.8, 0.1e-3 * 9.8, 60e-6),
        TriadSheet(0.006 * DEGREE, 14 * DEGREE_PER_HOUR, 1e-7, 0.8 * DEGREE, 2e-2, 3e-2, 2e-3,
                   1000 / 65536 * DEGREE, 500 * DEGREE, 0.1 * DEGREE, 0.008 * DEGREE, 60e-6),
        4e-2, 0.02 * DEGREE / 9.8, "g,deg/s", False,
    ),
    # A robot's unit: coarse accelerometers beside gyros that are better than they. Nothing was tuned on it.
    "robot": Grade(
        "robot",
        TriadSheet(110 * MICRO_G, 22 * MICRO_G, 0.06 * MICRO_G, 18e-3 * 9.8, 6e-3, 4e-3, 1e-3,
                   12 * STANDARD_GRAVITY / 32768, 12 * STANDARD_GRAVITY, 4e-3 * 9.8, 0.12e-3 * 9.8, 40e-6),
        TriadSheet(0.003 * DEGREE, 2.2 * DEGREE_PER_HOUR, 6e-8, 0.35 * DEGREE, 7e-3, 4e-3, 6e-4,
                   500 / 32768 * DEGREE, 500 * DEGREE, 0.08 * DEGREE, 0.005 * DEGREE, 50e-6),
        5e-3, 0.008 * DEGREE / 9.8, "g,deg/s", False,
    ),
    # Fibre-optic gyros and quartz accelerometers; numbers in SI with fine steps.
    "tactical": Grade(
        "tactical",
        TriadSheet(25 * MICRO_G, 8 * MICRO_G, 0.004 * MICRO_G, 0.8e-3 * 9.8, 2.5e-4, 2e-4, 1e-4,
                   2e-6 * 9.8, 30 * STANDARD_GRAVITY, 0.2e-3 * 9.8, 0.01e-3 * 9.8, 5e-6),
        TriadSheet(0.001 * DEGREE, 0.4 * DEGREE_PER_HOUR, 3e-10, 3 * DEGREE_PER_HOUR, 2e-4, 3e-4, 1e-4,
                   2e-7, 600 * DEGREE, 1 * DEGREE_PER_HOUR, 0.1 * DEGREE_PER_HOUR, 5e-6),
        6e-4, 0.0, "m/s^2,rad/s", True,
    ),
}  # fmt: skip
"""Grades with figures of this simulator's own choice, near to those of units that are sold."""


@dataclass(frozen=True)
class Unit:
    """A unit whose errors are known, in SI; every matrix maps true to raw in the axes of its case.

    `arms` are where each accelerometer sits from the unit's point, m; they are read `late` samples late.
    """

    accelerometer_matrix: np.ndarray
    accelerometer_bias: np.ndarray
    gyro_matrix: np.ndarray
    gyro_bias: np.ndarray
    g_sensitivity: np.ndarray
    accelerometer_asymmetry: np.ndarray = field(default_factory=lambda: np.zeros(3))
    accelerometer_quadratic: np.ndarray = field(default_factory=lambda: np.zeros(3))
    gyro_asymmetry: np.ndarray = field(default_factory=lambda: np.zeros(3))
    gyro_quadratic: np.ndarray = field(default_factory=lambda: np.zeros(3))
    arms: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    late: int = 0

    def force_output(self, force: np.ndarray) -> np.ndarray:
        """Return the noise-free outputs, m/s²."""
        u = force @ self.accelerometer_matrix.T
        return (
            u
            + self.accelerometer_asymmetry * np.abs(u)
            + self.accelerometer_quadratic * u**2
            + self.accelerometer_bias
        )

    def rate_output(self, rate: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the noise-free outputs, rad/s."""
        u = rate @ self.gyro_matrix.T
        return (
            u
            + self.gyro_asymmetry * np.abs(u)
            + self.gyro_quadratic * u**2
            + force @ self.g_sensitivity.T
            + self.gyro_bias
        )


def small_rotation(vector: np.ndarray) -> np.ndarray:
    """Return the matrix of a rotation vector by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * k @ k


def draw_unit(grade, rng, *, asymmetric=False, quadratic=False) -> Unit:
    """Draw one unit of a grade.

    What bends, by half as much at 1 g and at 100 °/s as the sheet's asymmetry is.
    """
    a, g = grade.accelerometer, grade.gyroscope

    def matrix(sheet: TriadSheet, turn: float) -> np.ndarray:
        skew = sheet.axes * rng.standard_normal((3, 3)) * (1 - np.eye(3))
        rows = np.eye(3) + skew
        rows /= np.linalg.norm(rows, axis=1, keepdims=True)
        rows = rows @ small_rotation(turn * rng.standard_normal(3)).T
        return (1 + sheet.scale * rng.standard_normal(3))[:, None] * rows

    unit = Unit(
        matrix(a, grade.between),
        a.bias * rng.standard_normal(3),
        matrix(g, grade.between),
        g.bias * rng.standard_normal(3),
        grade.g_sensitivity * rng.standard_normal((3, 3)),
    )
    if asymmetric:
        unit = replace(
            unit,
            accelerometer_asymmetry=a.asymmetry * rng.standard_normal(3),
            gyro_asymmetry=g.asymmetry * rng.standard_normal(3),
        )
    if quadratic:
        unit = replace(
            unit,
            accelerometer_quadratic=0.5 * a.asymmetry / 9.8 * rng.standard_normal(3),
            gyro_quadratic=0.5 * g.asymmetry / (100 * DEGREE) * rng.standard_normal(3),
        )
    return unit


def flicker(samples: int, rate: float, instability: float, rng: np.random.Generator) -> np.ndarray:
    """Return 1/f noise of three sensors, of density B²/(2π f) two-sided (IEEE Std 952), by filtering in frequency."""
    # Twice as long as wanted and cut: else the end would meet the beginning, as a Fourier series has it. From
    # half a hertz on the density is small beside white noise, so the filter need not know the sampling rate.
    length = 1 << int(np.ceil(np.log2(2 * samples)))
    frequency = np.fft.rfftfreq(length, 1 / rate)
    shape = np.zeros_like(frequency)
    shape[1:] = instability / np.sqrt(2 * np.pi * frequency[1:])
    # White noise of density one has the variance `rate`.
    spectrum = np.fft.rfft(rng.standard_normal((length, 3)) * np.sqrt(rate), axis=0)
    return np.fft.irfft(spectrum * shape[:, None], length, axis=0)[:samples]


def wander(sheet: TriadSheet, samples: int, rate: float, rng: np.random.Generator) -> np.ndarray:
    """Return how the three biases move while recording: 1/f noise and a random walk."""
    steps = sheet.walk / np.sqrt(rate) * rng.standard_normal((samples, 3))
    return flicker(samples, rate, sheet.flicker, rng) + np.cumsum(steps, axis=0)


def round_and_cut(signal: np.ndarray, step: float, limit: float) -> np.ndarray:
    """Return what a converter of finite steps and range makes of a signal."""
    cut = np.clip(signal, -limit, limit)
    return np.round(cut / step) * step if step else cut
