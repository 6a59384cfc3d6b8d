"""What disturbs a unit on its path: hand tremor, vibration, knocks, detours.

A disturbance turns the body by a small rotation vector (in b, applied after the path's attitude) and
shakes it by an acceleration in b. It is an exact function of time, so that a simulated recording of
any rate samples the same motion.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors
from tumble.records import dataclass


@runtime_checkable
class Disturbance(Protocol):
    """A small extra motion, defined at all times."""

    def rotation(self, time: Series) -> Vectors:
        """Return the extra rotation vector in b, rad."""
        ...

    def rotation_rate(self, time: Series) -> Vectors:
        """Return its time derivative, rad/s."""
        ...

    def acceleration(self, time: Series) -> Vectors:
        """Return the extra acceleration in b, m/s²."""
        ...


@dataclass(frozen=True, slots=True)
class Oscillation:
    """A sum of sine waves in every axis: tremor (8 to 12 Hz), sway (below 1 Hz), a motor (20 Hz and up).

    Attributes
    ----------
    frequency : (waves,) Hz.
    rate_amplitude : (waves, 3) rad/s of the angular rate.
    acceleration_amplitude : (waves, 3) m/s².
    rate_phase, acceleration_phase : (waves, 3) rad.
    """

    frequency: AnyArray
    rate_amplitude: AnyArray
    acceleration_amplitude: AnyArray
    rate_phase: AnyArray
    acceleration_phase: AnyArray

    def rotation(self, time: Series) -> Vectors:
        """Return the extra rotation vector in b, rad."""
        turn = 2.0 * np.pi * self.frequency[:, None]
        return self._waves(time, self.rate_amplitude / turn, self.rate_phase)

    def rotation_rate(self, time: Series) -> Vectors:
        """Return its time derivative, rad/s."""
        return self._waves(time, self.rate_amplitude, self.rate_phase + 0.5 * np.pi)

    def acceleration(self, time: Series) -> Vectors:
        """Return the extra acceleration in b, m/s²."""
        return self._waves(time, self.acceleration_amplitude, self.acceleration_phase)

    def _waves(self, time: Series, amplitude: AnyArray, phase: AnyArray) -> Vectors:
        total = np.zeros((time.shape[0], 3))
        for k, frequency in enumerate(self.frequency):
            for axis in range(3):
                angle = 2.0 * np.pi * frequency * time + phase[k, axis]
                total[:, axis] += amplitude[k, axis] * np.sin(angle)
        return total


@dataclass(frozen=True, slots=True)
class Knock:
    """A short blow: the attitude swings out and comes back, the acceleration is one pulse.

    Attributes
    ----------
    time : s, its beginning.
    duration : s, until the attitude is back exactly where it was.
    swing : (3,) rad, the largest excursion in b.
    blow : (3,) m/s², the acceleration's peak in b.
    """

    time: float
    duration: float
    swing: Vector
    blow: Vector

    def rotation(self, time: Series) -> Vectors:
        """Return the extra rotation vector in b, rad."""
        angle = self._angle(time)
        return np.sin(angle)[:, None] ** 2 * self.swing

    def rotation_rate(self, time: Series) -> Vectors:
        """Return its time derivative, rad/s."""
        angle = self._angle(time)
        return np.sin(2.0 * angle)[:, None] * (np.pi / self.duration) * self.swing

    def acceleration(self, time: Series) -> Vectors:
        """Return the extra acceleration in b, m/s²."""
        angle = self._angle(time)
        # one full sine wave: the blow and the recoil, no net velocity
        return np.sin(2.0 * angle)[:, None] * self.blow

    def _angle(self, time: Series) -> Series:
        return np.pi * np.clip((time - self.time) / self.duration, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Detours:
    """A hand does not turn about one fixed axis: during each of some turns the attitude leaves the path.

    It goes off as the square of a sine and is back at the turn's end. The unit's acceleration on the way
    is left out, as if it turned about itself.

    Attributes
    ----------
    time : (turns,) s, increasing, where each begins.
    duration : (turns,) s; each ends before the next begins.
    swing : (turns, 3) rad, the largest excursion in b.
    """

    time: Series
    duration: Series
    swing: Vectors

    def rotation(self, time: Series) -> Vectors:
        """Return the extra rotation vector in b, rad."""
        turn, angle = self._angle(time)
        vectors, away = np.zeros((len(time), 3)), np.flatnonzero(angle)
        vectors[away] = np.sin(angle[away])[:, None] ** 2 * self.swing[turn[away]]
        return vectors

    def rotation_rate(self, time: Series) -> Vectors:
        """Return its time derivative, rad/s."""
        turn, angle = self._angle(time)
        return (np.sin(2.0 * angle) * np.pi / self.duration[turn])[:, None] * self.swing[turn]

    def acceleration(self, time: Series) -> Vectors:
        """Return the extra acceleration in b, m/s²: none."""
        return np.zeros((len(time), 3))

    def _angle(self, time: Series) -> tuple[np.ndarray, Series]:
        turn = np.maximum(np.searchsorted(self.time, time, side="right") - 1, 0)
        share = np.clip((time - self.time[turn]) / self.duration[turn], 0.0, 1.0)
        # sin(pi) is not zero to the last digit, and a hold shall be one
        return turn, np.where(share < 1.0, np.pi * share, 0.0)


def simulate_tremor(
    rng: np.random.Generator,
    *,
    rate_rms: float = 0.03,
    acceleration_rms: float = 0.05,
    band: tuple[float, float] = (8.0, 12.0),
    waves: int = 7,
) -> Oscillation:
    """Draw an oscillation of random waves in a band, such as a hand's tremor.

    Parameters
    ----------
    rng : source of the frequencies, phases and relative amplitudes.
    rate_rms : rad/s, root of the mean square over time of each axis' angular rate.
    acceleration_rms : m/s², the same of each axis' acceleration.
    band : Hz, lowest and highest frequency; physiological tremor of an arm has 8 to 12 Hz.
    waves : number of sine waves; several of them beat, as tremor does.
    """
    frequency = rng.uniform(*band, waves)

    def amplitudes(rms: float) -> AnyArray:
        weight = rng.rayleigh(1.0, (waves, 3))
        # a sine wave of amplitude a has the mean square a²/2
        return weight * (rms * np.sqrt(2.0) / np.sqrt(np.sum(weight**2, axis=0)))

    return Oscillation(
        frequency=frequency,
        rate_amplitude=amplitudes(rate_rms),
        acceleration_amplitude=amplitudes(acceleration_rms),
        rate_phase=rng.uniform(0.0, 2.0 * np.pi, (waves, 3)),
        acceleration_phase=rng.uniform(0.0, 2.0 * np.pi, (waves, 3)),
    )
