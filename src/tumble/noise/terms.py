"""One model of a sensor's noise: its terms, and everything that follows from them.

The terms are those of IEEE Std 952 (Q, N, B, K, R), first-order Gauss-Markov processes and sinusoidal
lines. Of a signal in u (rad/s or m/s²), with two-sided densities S(f) and Allan variances σ²(τ):

====== ============================== ====== ================ ==============
letter term                           unit   S(f)             σ²(τ)
====== ============================== ====== ================ ==============
Q      quantisation                   u·s    (2πf)² Q²/rate   3Q²/τ²
N      angle or velocity random walk  u/√Hz  N²               N²/τ
B      bias instability (flicker)     u      B²/(2πf)         (2 ln 2/π) B²
K      rate random walk               u/√s   K²/(2πf)²        K²τ/3
R      ramp                           u/s    R²/(2πf)³        R²τ²/2
====== ============================== ====== ================ ==============
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.noise.flicker import flicker_recursions
from tumble.noise.variances import (
    LETTERS,
    allan_variance_of,
    line_allan_variance,
    markov_allan_variance,
    markov_phase_covariance,
    mean_variance_of,
    phase_covariance_of,
)
from tumble.records import dataclass

# A simulated flicker wanders over this many times the length of its sequence.
_BEYOND = 16


@dataclass(frozen=True)
class GaussMarkov:
    """A first-order Gauss-Markov process (exponentially correlated noise).

    Attributes
    ----------
    sigma : u, its standard deviation. IEEE Std 952 writes it by q_c = σ √(2/T_c), u/√s.
    correlation_time : T_c, s, over which the autocovariance falls to 1/e.
    """

    sigma: float
    correlation_time: float


@dataclass(frozen=True)
class Line:
    """A sine of any phase, such as a vibration.

    Attributes
    ----------
    amplitude : u, of the peak (IEEE Std 952: Ω₀).
    frequency : Hz.
    """

    amplitude: float
    frequency: float


@dataclass(frozen=True)
class NoiseModel:
    """Noise of one sensor, a sum of independent terms, in its SI unit u (rad/s or m/s²).

    Attributes
    ----------
    quantisation : Q, u·s (rad or m/s). A step of the angle or velocity has Q = step/√12.
    random_walk : N, u/√Hz = u·√s, root of the two-sided density; equal to the square root of the one-sided over √2.
    bias_instability : B, u, by the density B²/(2πf); the Allan deviation's floor is 0.664 B.
    rate_random_walk : K, u/√s: the bias is the integral of white noise of density K².
    ramp : R, u/s: a constant slope, of random size and sign from one recording to the next.
    gauss_markov, lines : as many as there are.
    """

    quantisation: float = 0.0
    random_walk: float = 0.0
    bias_instability: float = 0.0
    rate_random_walk: float = 0.0
    ramp: float = 0.0
    gauss_markov: tuple[GaussMarkov, ...] = ()
    lines: tuple[Line, ...] = ()

    @property
    def coefficients(self) -> dict[str, float]:
        """The five coefficients by their letters in IEEE Std 952."""
        values = (getattr(self, field.name) for field in fields(self)[:5])
        return dict(zip(LETTERS, values, strict=True))

    @classmethod
    def from_coefficients(
        cls,
        coefficients: dict[str, float],
        gauss_markov: tuple[GaussMarkov, ...] = (),
        lines: tuple[Line, ...] = (),
    ) -> NoiseModel:
        """Return the model with coefficients by their letters; those that are not named are zero."""
        Q, N, B, K, R = (coefficients.get(letter, 0.0) for letter in LETTERS)
        return cls(Q, N, B, K, R, gauss_markov, lines)

    def scaled(self, factor: float) -> NoiseModel:
        """Return the same noise in another unit, of which a number is `factor` times as large."""
        return NoiseModel.from_coefficients(
            {letter: factor * value for letter, value in self.coefficients.items()},
            tuple(GaussMarkov(factor * g.sigma, g.correlation_time) for g in self.gauss_markov),
            tuple(Line(factor * line.amplitude, line.frequency) for line in self.lines),
        )

    def allan_variance(self, tau: Series, rate: float | None = None) -> Series:
        """Return the Allan variance (u²) expected over averaging times.

        Parameters
        ----------
        tau : s.
        rate : Hz, where the samples are the process at instants; None for a sensor that averages over
            its interval, as the closed forms of IEEE Std 952 have it.
        """
        return np.sum([part for _, part in self.allan_terms(tau, rate)] or [0.0 * np.asarray(tau)], axis=0)

    def allan_terms(self, tau: Series, rate: float | None = None) -> Iterator[tuple[str, Series]]:
        """Give the name and the Allan variance (u²) of each term that is there, as in `allan_variance`."""
        tau = np.asarray(tau, dtype=float)
        for letter, value in self._present():
            yield letter, value**2 * allan_variance_of(letter, tau, rate)
        for g in self.gauss_markov:
            yield "Gauss-Markov", g.sigma**2 * markov_allan_variance(tau, g.correlation_time, rate)
        for line in self.lines:
            yield "line", line.amplitude**2 * line_allan_variance(tau, line.frequency, rate)

    def phase_covariance(self, lag: AnyArray) -> AnyArray:
        """Return the generalised covariance of the signal's integral, u² s², without the ramp's.

        Contrasts of means follow from it, see `tumble.noise.variances`.

        Parameters
        ----------
        lag : s, of any shape.
        """
        total = np.zeros(np.shape(lag))
        for letter, value in self._present():
            if letter != "R":
                total += value**2 * phase_covariance_of(letter, lag)
        for g in self.gauss_markov:
            total += g.sigma**2 * markov_phase_covariance(lag, g.correlation_time)
        for line in self.lines:
            turn = 2.0 * np.pi * line.frequency
            total += 0.5 * (line.amplitude / turn) ** 2 * np.cos(turn * lag)
        return total

    def mean_covariance(self, seconds: Series, span: float, starts: Series | None = None) -> Square:
        """Return the covariance (u²) of the means of holds, against a bias that is constant over the span.

        White noise and quantisation count in full. What wanders counts by how far a hold's mean is from
        the mean of the whole span: the rest is the bias. Without `starts` the holds are taken as anywhere
        in the span, and the matrix has a diagonal only; for N and B it is N²/t + B²/π ln(span/t), for K
        K² (span − t)/6. With them, all of the matrix, neighbouring holds being off together.

        Parameters
        ----------
        seconds : (holds,) how long each hold lasts.
        span : s, from the first hold's start to the last one's end.
        starts : (holds,) s after the begin of the span.
        """
        seconds = np.asarray(seconds, dtype=float)
        if starts is not None:
            return self._covariance_of_holds(np.asarray(starts, dtype=float), seconds, span)
        variance = np.zeros(len(seconds))
        whole = np.array([span])
        for letter, value in self._present():
            part = mean_variance_of(letter, seconds)
            if letter not in "QN":
                part = np.maximum(part - mean_variance_of(letter, whole), 0.0)
            variance += value**2 * part
        for g in self.gauss_markov:
            near, far = (
                -2.0 * markov_phase_covariance(t, g.correlation_time) / t**2 for t in (seconds, whole)
            )
            variance += g.sigma**2 * np.maximum(near - far, 0.0)
        for line in self.lines:
            variance += 0.5 * line.amplitude**2 * np.sinc(line.frequency * seconds) ** 2
        return np.diag(variance)

    def _covariance_of_holds(self, starts: Series, seconds: Series, span: float) -> Square:
        """Of means at known places, each less the mean of the span where the term wanders."""
        # contrasts of the phase at the ends of holds and span
        ends = np.concatenate([starts, starts + seconds, [0.0, span]])
        count = len(seconds)
        means = np.zeros((count, len(ends)))
        means[np.arange(count), np.arange(count)] = -1.0 / seconds
        means[np.arange(count), count + np.arange(count)] = 1.0 / seconds
        wandering = means.copy()
        wandering[:, -2:] = np.array([1.0, -1.0]) / span
        lag = ends[:, None] - ends
        still = NoiseModel(quantisation=self.quantisation, random_walk=self.random_walk, lines=self.lines)
        moving = NoiseModel(0.0, 0.0, self.bias_instability, self.rate_random_walk, 0.0, self.gauss_markov)
        middle = starts + 0.5 * seconds - 0.5 * span
        return (
            means @ still.phase_covariance(lag) @ means.T
            + wandering @ moving.phase_covariance(lag) @ wandering.T
            + self.ramp**2 * np.outer(middle, middle)
        )

    def simulate(self, samples: int, rate: float, rng: np.random.Generator) -> Series:
        """Draw a sequence, (samples,), of the noise at instants 1/rate apart.

        The random walk and the ramp begin at zero; flicker and Gauss-Markov processes are as after
        a long time. Flicker is that of Gauss-Markov processes with one drive (`flicker_recursions`).

        Parameters
        ----------
        samples : how many.
        rate : Hz.
        rng : source of all numbers; the same state gives the same numbers bit for bit.
        """
        total = np.zeros(samples)
        if self.random_walk > 0.0:
            total += self.random_walk * np.sqrt(rate) * rng.standard_normal(samples)
        if self.quantisation > 0.0:
            total += self.quantisation * rate * np.diff(rng.standard_normal(samples + 1))
        if self.bias_instability > 0.0:
            total += self.bias_instability * _draw_flicker(samples, rate, rng)
        if self.rate_random_walk > 0.0:
            total += self.rate_random_walk / np.sqrt(rate) * np.cumsum(rng.standard_normal(samples))
        if self.ramp > 0.0:
            total += self.ramp * rng.standard_normal() * np.arange(samples) / rate
        for g in self.gauss_markov:
            loss = -np.expm1(-1.0 / (g.correlation_time * rate))
            drive = np.sqrt(loss * (2.0 - loss)) * rng.standard_normal(samples)
            total += g.sigma * _recursion(1.0 - loss, drive, rng.standard_normal())
        for line in self.lines:
            phase = rng.uniform(0.0, 2.0 * np.pi)
            total += line.amplitude * np.sin(2.0 * np.pi * line.frequency / rate * np.arange(samples) + phase)
        return total

    def _present(self) -> Iterator[tuple[str, float]]:
        return ((letter, value) for letter, value in self.coefficients.items() if value != 0.0)


def _draw_flicker(samples: int, rate: float, rng: np.random.Generator) -> Series:
    memories, gains, spread = flicker_recursions(_BEYOND * samples, rate)
    states = spread @ rng.standard_normal(len(memories))
    drive = rng.standard_normal(samples)
    total = np.zeros(samples)
    for memory, gain, state in zip(memories, gains, states, strict=True):
        total += _recursion(float(memory), gain * drive, float(state))
    return total


def _recursion(memory: float, drive: Series, state: float) -> Series:
    """The series x[i] = memory x[i - 1] + drive[i] that follows a state."""
    from scipy.signal import lfilter

    values, _ = lfilter([1.0], [1.0, -memory], drive, zi=np.array([memory * state]))
    return np.asarray(values)
