"""What a strapdown rotation test is planned with: the unit's quality, the fixture's, the timing, the place."""

from __future__ import annotations

import math
from dataclasses import asdict, field
from typing import Any

import numpy as np

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.simulation.grades import Grade

AVERAGING = ("plain", "average-of-averages")
METHODS = ("least-squares", "formulas")
# Beyond it a fixture is no approximation of anything, rad.
LARGEST_ANGLE = 0.1


@dataclass(frozen=True, slots=True)
class SensorQuality:
    """One sigma of what a unit brings to the test, before it.

    Attributes
    ----------
    gyro_walk : rad/√s, angle random walk.
    gyro_pulse : rad, of one pulse of the gyros; zero for none.
    gyro_bias : rad/s.
    gyro_instability : rad/s, how far the bias moves between rest and rotations.
    g_sensitivity : (rad/s)/(m/s²), of each element.
    force_walk : (m/s)/√s, velocity random walk.
    force_pulse : m/s, of one pulse of the accelerometers; zero for none.
    force_instability : m/s², how far the bias moves between two averages.
    gyro_scale, gyro_asymmetry, gyro_misalignment : ratios and rad: errors that the compensation still has.
    force_bias : m/s².
    force_scale, force_asymmetry, force_misalignment : the accelerometers'.
    name : whose numbers these are.
    """

    gyro_walk: float = 0.0
    gyro_pulse: float = 0.0
    gyro_bias: float = 0.0
    gyro_instability: float = 0.0
    g_sensitivity: float = 0.0
    force_walk: float = 0.0
    force_pulse: float = 0.0
    force_instability: float = 0.0
    gyro_scale: float = 0.0
    gyro_asymmetry: float = 0.0
    gyro_misalignment: float = 0.0
    force_bias: float = 0.0
    force_scale: float = 0.0
    force_asymmetry: float = 0.0
    force_misalignment: float = 0.0
    name: str = "own numbers"

    @staticmethod
    def from_grade(grade: Grade, *, gyro_pulse: float = 0.0, force_pulse: float = 0.0) -> SensorQuality:
        """Return the quality of a grade of units.

        No sheet states an asymmetry: it is taken as large as the scale factor's error. A converter that rounds
        each sample adds noise as white as the sensor's own, a twelfth of its step squared.

        Parameters
        ----------
        grade : of `simulation.find_grade`.
        gyro_pulse, force_pulse : rad and m/s, of units that send pulses; sheets seldom state them.
        """
        gyro, force = grade.gyroscope, grade.accelerometer
        # The floor of the Allan deviation of flicker, 0.664 B.
        floor = math.sqrt(2.0 * math.log(2.0) / math.pi)
        return SensorQuality(
            gyro_walk=math.hypot(
                gyro.noise.random_walk, gyro.noise.resolution / math.sqrt(12.0 * grade.rate)
            ),
            gyro_pulse=gyro_pulse,
            gyro_bias=gyro.bias,
            gyro_instability=floor * gyro.noise.bias_instability,
            g_sensitivity=grade.g_sensitivity,
            force_walk=math.hypot(
                force.noise.random_walk, force.noise.resolution / math.sqrt(12.0 * grade.rate)
            ),
            force_pulse=force_pulse,
            force_instability=floor * force.noise.bias_instability,
            gyro_scale=gyro.scale_factor,
            gyro_asymmetry=gyro.scale_factor,
            # υ is of two axes, each of which leans towards the other
            gyro_misalignment=math.sqrt(2.0) * gyro.misalignment,
            force_bias=force.bias,
            force_scale=force.scale_factor,
            force_asymmetry=force.scale_factor,
            # against the gyros' frame
            force_misalignment=math.hypot(force.misalignment, gyro.misalignment),
            name=grade.name,
        )

    def spreads(self) -> np.ndarray:
        """Return (24,) one sigma of the errors before the test, as `savage.NAMES`."""
        threes = (
            self.gyro_scale,
            self.gyro_asymmetry,
            self.gyro_misalignment,
            self.force_bias,
            self.force_scale,
            self.force_asymmetry,
        )
        return np.concatenate([np.repeat(threes, 3), np.full(6, self.force_misalignment)])


@dataclass(frozen=True, slots=True)
class FixtureQuality:
    """One sigma of what a two-axis fixture is off by, rad.

    Attributes
    ----------
    mounting : the unit on the inner axis, about each of its axes; one for the whole test.
    installation : the fixture's lean, about each of two level axes; one for the whole test.
    heading : where its outer axis points, against north; one for the whole test.
    execution : where an axis stops, each stop for itself.

    Raises
    ------
    UsageError
        If one is negative, or so large that it is no small angle.
    """

    mounting: float = 1e-3
    installation: float = 1e-3
    heading: float = 1e-3
    execution: float = 1e-3

    def __post_init__(self) -> None:
        """Refuse what is no fixture."""
        for name, value in asdict(self).items():
            if not 0.0 <= value <= LARGEST_ANGLE:
                raise UsageError(
                    f"The fixture's {name} is {1e3 * value:g} mrad: the analysis holds from 0 to "
                    f"{1e3 * LARGEST_ANGLE:g} mrad ({math.degrees(LARGEST_ANGLE):.1f}°)."
                )

    def scaled(self, factor: float) -> FixtureQuality:
        """Return a fixture that is off by so many times as much."""
        return FixtureQuality(*(min(factor * v, LARGEST_ANGLE) for v in asdict(self).values()))


@dataclass(frozen=True, slots=True)
class Timing:
    """How long a sequence's parts take.

    Attributes
    ----------
    seconds : s of each of the two averages (T_Meas).
    rate : rad/s of the rotations.
    pause : s at rest between two rotations of a sequence, and between an average and a rotation.
    averaging : "plain" or "average-of-averages".

    Raises
    ------
    UsageError
        If a time or rate is not positive, or there is no such average.
    """

    seconds: float = 10.0
    rate: float = 1.0
    pause: float = 0.0
    averaging: str = "plain"

    def __post_init__(self) -> None:
        """Refuse what takes no time or for ever."""
        if not 0.1 <= self.seconds <= 3600.0:
            raise UsageError(f"An average of {self.seconds:g} s: give 0.1 to 3600 seconds (--hold).")
        if not 0.01 <= self.rate <= 20.0:
            raise UsageError(
                f"A rotation at {self.rate:g} rad/s: give 0.01 to 20 rad/s, 0.6 to 1100 °/s (--turn-rate)."
            )
        if not 0.0 <= self.pause <= 600.0:
            raise UsageError(f"A pause of {self.pause:g} s: give 0 to 600 seconds (--pause).")
        if self.averaging not in AVERAGING:
            raise UsageError(f"There is no average {self.averaging!r}: choose one of {', '.join(AVERAGING)}.")

    @property
    def square_share(self) -> float:
        """∫h² over a window of unit length, h the share of an average that lies beyond: 1/3 for plain means."""
        return 1.0 / 3.0 if self.averaging == "plain" else 0.025 + 0.5 - 1.0 / 6.0 + 0.025

    @property
    def noise_share(self) -> float:
        """Variance of an average of white noise against that of a plain mean."""
        return 1.0 if self.averaging == "plain" else 4.0 / 3.0


@dataclass(frozen=True, slots=True)
class StrapdownSetup:
    """A strapdown rotation test as planned.

    Attributes
    ----------
    sensors, fixture, timing : qualities, one sigma, and times.
    site : latitude and gravity, with its uncertainty.
    azimuth : rad, where the outer axis points, clockwise from north; east by default.
    method : "least-squares" over all components, as `tumble calibrate` does, or the paper's "formulas" (13).
    iterations : play-backs after the first pass; the procedure plays back until nothing changes.
    start_bias : the gyros' bias is what they show before each sequence (9.4).
    norm : down is gravity less the length of the acceleration, not its projection.
    asymmetry : sequences 1a to 3a are done, too.

    Raises
    ------
    UsageError
        If there is no such method, or the site's latitude is not known.
    """

    sensors: SensorQuality
    fixture: FixtureQuality = field(default_factory=FixtureQuality)
    timing: Timing = field(default_factory=Timing)
    site: Site = field(default_factory=lambda: Site.from_latitude(math.radians(45.0)))
    azimuth: float = math.pi / 2.0
    method: str = "least-squares"
    iterations: int = 2
    start_bias: bool = True
    norm: bool = True
    asymmetry: bool = True

    def __post_init__(self) -> None:
        """Refuse what cannot be reckoned."""
        if self.method not in METHODS:
            raise UsageError(f"There is no method {self.method!r}: choose one of {', '.join(METHODS)}.")
        if self.site.latitude is None:
            raise UsageError(
                "The strapdown rotation test takes the Earth rate out of the gyros, whose direction needs a latitude: "
                "give --site LATITUDE[,HEIGHT]."
            )
        if not 0 <= self.iterations <= 20:
            raise UsageError(f"{self.iterations} play-backs: give 0 to 20.")

    def settings(self) -> dict[str, Any]:
        """Return it as plain data, SI and one sigma."""
        latitude = self.site.latitude
        return {
            "sensors": asdict(self.sensors),
            "fixture": asdict(self.fixture),
            "timing": asdict(self.timing),
            "site": {
                "latitude_deg": None if latitude is None else math.degrees(latitude),
                "gravity": self.site.gravity,
                "gravity_standard_uncertainty": self.site.gravity_sigma,
            },
            "outer_axis_azimuth_deg": math.degrees(self.azimuth),
            "method": self.method,
            "play_backs": self.iterations,
            "start_bias": self.start_bias,
            "norm": self.norm,
            "asymmetry": self.asymmetry,
        }
