"""Noise of one triad: white, bias instability, rate random walk, and what the converter does.

Coefficients are those of IEEE Std 952 (two-sided spectral densities). A data sheet's noise density is
one-sided: N is that density over √2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Vectors

# Corner frequencies of neighbouring Gauss-Markov processes differ by this factor; the sum of their
# spectra then follows 1/f within 2 %.
OCTAVES = 4.0


@dataclass(frozen=True, slots=True)
class TriadNoise:
    """Noise coefficients of a triad, in its SI unit u (m/s² or rad/s); the axes are independent.

    Attributes
    ----------
    random_walk : N, u/√Hz: angle or velocity random walk; white noise of variance N² times the rate.
    bias_instability : B, u: flicker of two-sided density B² / (2π f); its Allan floor is 0.664 B.
    rate_random_walk : K, u·√Hz: the integral of white noise of density K².
    resolution : u, the converter's step; zero for none.
    full_scale : u, the converter's limit; infinite for none.
    """

    random_walk: float = 0.0
    bias_instability: float = 0.0
    rate_random_walk: float = 0.0
    resolution: float = 0.0
    full_scale: float = float("inf")

    def scaled(self, factor: float) -> TriadNoise:
        """Return the same noise of raw numbers `factor` times as large, such as counts instead of SI."""
        return TriadNoise(
            random_walk=factor * self.random_walk,
            bias_instability=factor * self.bias_instability,
            rate_random_walk=factor * self.rate_random_walk,
            resolution=factor * self.resolution,
            full_scale=factor * self.full_scale,
        )

    @property
    def wanders(self) -> bool:
        """Whether the bias moves during a run."""
        return max(self.bias_instability, self.rate_random_walk) > 0.0


def simulate_noise(noise: TriadNoise, samples: int, rate: float, rng: np.random.Generator) -> AnyArray:
    """Draw the random part of a triad's output, (samples, 3), without what the converter does.

    Parameters
    ----------
    noise : coefficients.
    samples : how many.
    rate : Hz.
    rng : source of all numbers; the same state gives the same numbers bit for bit.

    Notes
    -----
    Flicker has the spectrum of a sum of first-order Gauss-Markov processes whose corners lie a factor
    r = 4 apart, from a quarter of the lowest frequency that the recording has to the Nyquist frequency.
    Each of variance σ² adds a two-sided density σ² / (π f_c (1 + (f/f_c)²)); the sum over corners is
    σ² / (2 ln r f), which is B² / (2π f) with σ² = B² ln r / π.

    The sum of k processes with a drive each is drawn with a single drive: a sum of rational spectra is
    rational, and its minimum-phase factor splits into k first-order recursions of the same memories with
    other gains. Covariances, and with normal numbers the distribution, are the same, for one random
    number a sample instead of k.

    The random walk begins at zero.
    """
    from tumble.simulation.kernels import add_white

    total = simulate_wander(noise, samples, rate, rng)
    if noise.random_walk > 0.0:
        add_white(rng, noise.random_walk * np.sqrt(rate), total.reshape(-1))
    return total


def simulate_wander(noise: TriadNoise, samples: int, rate: float, rng: np.random.Generator) -> AnyArray:
    """Draw how the bias wanders during the run, (samples, 3): flicker and random walk.

    Parameters
    ----------
    noise, samples, rate, rng : as for `simulate_noise`, whose coloured part this is.
    """
    from tumble.simulation.kernels import add_markov, add_walk

    total = np.zeros((samples, 3))
    if noise.bias_instability > 0.0 and samples > 0:
        memories, gains, spread = _flicker(samples, rate)
        # the processes are stationary from the first sample on
        start = noise.bias_instability * rng.standard_normal((3, len(memories))) @ spread.T
        add_markov(rng, memories, noise.bias_instability * gains, start, total)
    if noise.rate_random_walk > 0.0:
        add_walk(rng, noise.rate_random_walk / np.sqrt(rate), total)
    return total


@lru_cache(maxsize=32)
def _flicker(samples: int, rate: float) -> tuple[AnyArray, AnyArray, AnyArray]:
    """For B = 1: memories and gains of the recursions with one drive, and a root of their states' covariance."""
    variance = np.log(OCTAVES) / np.pi
    lowest = 0.25 * rate / samples
    count = max(int(np.ceil(np.log(0.5 * rate / lowest) / np.log(OCTAVES))), 1)
    # 1 - memory, because a memory close to one keeps no digits of it
    loss = -np.expm1(-2.0 * np.pi * lowest * OCTAVES ** np.arange(count) / rate)
    gain = _single_drive(loss, variance * loss * (2.0 - loss))
    # E[x_i x_j] = g_i g_j / (1 - a_i a_j)
    covariance = np.outer(gain, gain) / (loss[:, None] + loss - np.outer(loss, loss))
    values, vectors = np.linalg.eigh(covariance)
    return 1.0 - loss, gain, vectors * np.sqrt(np.maximum(values, 0.0))


def _single_drive(loss: AnyArray, power: AnyArray) -> AnyArray:
    """Gains of recursions with one common drive whose sum has the spectrum of independent ones.

    With y = z + 1/z - 2 the spectrum of process j is ``power_j / (loss_j² - memory_j y)``. The sum has
    one zero between each two poles in y; taken inside the unit circle they give the minimum-phase factor,
    and its partial fractions the gains.
    """
    memory = 1.0 - loss
    below, above = np.log(loss[:-1] ** 2 / memory[:-1]), np.log(loss[1:] ** 2 / memory[1:])
    # bisection in log y: from minus infinity behind one pole to plus infinity before the next
    for _ in range(60):
        middle = 0.5 * (below + above)
        spectrum = np.sum(power / (loss**2 - memory * np.exp(middle)[:, None]), axis=1)
        below, above = np.where(spectrum < 0.0, middle, below), np.where(spectrum < 0.0, above, middle)
    y = np.exp(0.5 * (below + above))
    # w² / (1 - w) = y for w = 1 - zero
    zero_loss = 0.5 * (np.sqrt(y**2 + 4.0 * y) - y)
    # the residue at a_j is Π (a_j - b_k) / Π (a_j - a_k), both differences of losses
    distance = loss - loss[:, None]
    np.fill_diagonal(distance, 1.0)
    gain = np.prod(zero_loss - loss[:, None], axis=1) / np.prod(distance, axis=1)
    # H(1) is Σ gain / loss, and the spectrum there is Σ power / loss²
    return gain * np.sqrt(np.sum(power / loss**2)) / np.abs(np.sum(gain / loss))


def convert_to_digital(signal: Vectors, noise: TriadNoise) -> Vectors:
    """Return the signal as the converter gives it: rounded to its step, stopped at its full scale.

    Parameters
    ----------
    signal : (samples, 3), any unit in which `noise` states the step and the limit.
    noise : resolution and full scale.
    """
    if noise.resolution > 0.0:
        signal = noise.resolution * np.round(signal / noise.resolution)
    return np.clip(signal, -noise.full_scale, noise.full_scale)


def simulate_output(
    signal: Vectors, noise: TriadNoise, rate: float, rng: np.random.Generator
) -> tuple[AnyArray, AnyArray]:
    """Return what a triad gives for its raw signal, and how the bias wandered, both (samples, 3).

    It is the signal with the noise of `simulate_noise`, number for number, as `convert_to_digital` gives
    it, without copies in between.

    Parameters
    ----------
    signal : (samples, 3) raw signal without noise, in the unit of the coefficients.
    noise, rate, rng : as for `simulate_noise`.
    """
    from tumble.simulation.kernels import add_white_and_digitise

    wander = simulate_wander(noise, len(signal), rate, rng)
    output = np.ascontiguousarray(signal + wander if noise.wanders else signal.copy())
    scale = noise.random_walk * np.sqrt(rate)
    add_white_and_digitise(rng, scale, noise.resolution, noise.full_scale, output.reshape(-1))
    return output, wander
