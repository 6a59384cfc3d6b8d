"""Noise of one triad: white, bias instability, rate random walk, and what the converter does.

Coefficients are those of IEEE Std 952 (two-sided spectral densities). A data sheet's noise density is
one-sided: N is that density over √2.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from tumble.arrays import AnyArray, Vectors
from tumble.noise import flicker_recursions
from tumble.records import dataclass


@dataclass(frozen=True)
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
        return TriadNoise(*(factor * getattr(self, one.name) for one in fields(self)))

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
        memories, gains, spread = flicker_recursions(samples, rate)
        # the processes are stationary from the first sample on
        start = noise.bias_instability * rng.standard_normal((3, len(memories))) @ spread.T
        add_markov(rng, memories, noise.bias_instability * gains, start, total)
    if noise.rate_random_walk > 0.0:
        add_walk(rng, noise.rate_random_walk / np.sqrt(rate), total)
    return total


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
