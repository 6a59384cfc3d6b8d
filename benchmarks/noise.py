"""Simulated noise beside drawing the random numbers alone, in one run.

    python benchmarks/noise.py

Each line is the time for a triad's noise over the time that a compiled loop takes to draw as many normal
numbers as the noise has values (three a sample) from the same generator, and do nothing with them but
store them. numpy's own drawing and the plain numpy way stand beside it.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


import numba
import numpy as np
from timing import best

from tumble.simulation import TriadNoise, convert_to_digital, simulate_noise

SAMPLES, RATE = 1_000_000, 100.0
WHITE = TriadNoise(random_walk=0.01)
CASES = {
    "white": WHITE,
    "random walk": TriadNoise(rate_random_walk=0.001),
    "flicker": TriadNoise(bias_instability=0.005),
    "white, flicker and random walk": TriadNoise(0.01, 0.005, 0.001),
}


@numba.njit(cache=False)
def draw(rng, out):
    """The limit: each number drawn once and stored."""
    for i in range(out.shape[0]):
        out[i] = rng.standard_normal()


def main() -> None:
    rng = np.random.Generator(np.random.SFC64(1))
    numbers = np.empty(3 * SAMPLES)
    alone = best(lambda: draw(rng, numbers))
    print(f"drawing alone, compiled: {3e-6 * SAMPLES / alone:.0f} million numbers a second (ratio 1)")
    print(f"  {'drawing alone, numpy':<46} {best(lambda: rng.standard_normal(out=numbers)) / alone:6.2f}")
    plain = best(lambda: 0.1 * rng.standard_normal((SAMPLES, 3)))
    print(f"  {'white, as one writes it in numpy':<46} {plain / alone:6.2f}")
    for name, noise in CASES.items():
        print(f"  {name:<46} {best(lambda n=noise: simulate_noise(n, SAMPLES, RATE, rng)) / alone:6.2f}")
    signal = np.zeros((SAMPLES, 3))
    chain = TriadNoise(random_walk=0.01, resolution=0.003, full_scale=5.0)
    in_steps = best(lambda: convert_to_digital(signal + simulate_noise(chain, SAMPLES, RATE, rng), chain))
    print(f"  {'signal, white noise, converter: step by step':<46} {in_steps / alone:6.2f}")


if __name__ == "__main__":
    main()
