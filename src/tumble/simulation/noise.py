"""Noise of one triad: white, bias instability, rate random walk, and what the converter does.

Coefficients are those of IEEE Std 952 (two-sided spectral densities). A data sheet's noise density is
one-sided: N is that density over √2.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    Flicker is a sum of first-order Gauss-Markov processes whose corners lie a factor r = 4 apart, from
    a quarter of the lowest frequency that the recording has to the Nyquist frequency. Each of variance
    σ² adds a two-sided density σ² / (π f_c (1 + (f/f_c)²)); the sum over corners is σ² / (2 ln r f),
    which is B² / (2π f) with σ² = B² ln r / π. The random walk begins at zero.
    """
    white = noise.random_walk * np.sqrt(rate) * rng.standard_normal((samples, 3))
    return white + simulate_wander(noise, samples, rate, rng)


def simulate_wander(noise: TriadNoise, samples: int, rate: float, rng: np.random.Generator) -> AnyArray:
    """Draw how the bias wanders during the run, (samples, 3): flicker and random walk.

    Parameters
    ----------
    noise, samples, rate, rng : as for `simulate_noise`, whose coloured part this is.
    """
    total = np.zeros((samples, 3))
    if noise.bias_instability > 0.0:
        total += _flicker(noise.bias_instability, samples, rate, rng)
    if noise.rate_random_walk > 0.0:
        steps = rng.standard_normal((samples, 3))
        total += noise.rate_random_walk / np.sqrt(rate) * np.cumsum(steps, axis=0)
    return total


def _flicker(instability: float, samples: int, rate: float, rng: np.random.Generator) -> AnyArray:
    from tumble.simulation.kernels import add_markov

    total = np.zeros((samples, 3))
    sigma = instability * np.sqrt(np.log(OCTAVES) / np.pi)
    corner = 0.25 * rate / samples
    while corner < 0.5 * rate:
        memory = np.exp(-2.0 * np.pi * corner / rate)
        drive = sigma * np.sqrt(1.0 - memory**2) * rng.standard_normal((samples, 3))
        # the process is stationary from its first sample on
        drive[0] = sigma * rng.standard_normal(3)
        add_markov(drive, memory, total)
        corner *= OCTAVES
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
