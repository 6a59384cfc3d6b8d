"""The hot loops beside what else could do them, in one run.

    python benchmarks/kernels.py

Attitude integration over turns (with the 63 sums that the adjustment needs) against a bare quaternion
loop compiled by numba, and against scipy's Rotation; the nine-parameter Gauss-Helmert adjustment of 26
holds against scipy.optimize.least_squares on the norms with a numerical Jacobian.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


import numba
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from timing import best

from tumble.attitude import integrate_turns, twenty_six_directions
from tumble.calibration import rough_triad
from tumble.sensor import matrix_from_shin
from tumble_papers.hayal import adjust_norm

RATE = 100.0
SAMPLES = 200_000


@numba.njit(cache=False)
def bare(rate, step, out):
    """Compose quaternions of constant rate over each step: the least that any integrator does."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for i in range(rate.shape[0]):
        p, q, r = 0.5 * step * rate[i, 0], 0.5 * step * rate[i, 1], 0.5 * step * rate[i, 2]
        s = p * p + q * q + r * r
        c, k = 1.0 - s / 2.0 * (1.0 - s / 12.0), 1.0 - s / 6.0 * (1.0 - s / 20.0)
        p, q, r = k * p, k * q, k * r
        w, x, y, z = (
            w * c - x * p - y * q - z * r,
            w * p + x * c + y * r - z * q,
            w * q - x * r + y * c + z * p,
            w * r + x * q - y * p + z * c,
        )
    out[0], out[1], out[2], out[3] = w, x, y, z


def integration(rng: np.random.Generator) -> None:
    time_, rate = np.arange(SAMPLES) / RATE, rng.normal(0.0, 1.0, (SAMPLES, 3))
    force, eye, zero, out = rng.normal(0.0, 9.8, (SAMPLES, 3)), np.eye(3), np.zeros(3), np.zeros(4)
    starts = np.arange(0, SAMPLES - 200, 200)

    def ours() -> object:
        return integrate_turns(
            time_,
            rate,
            force,
            starts,
            starts + 201,
            gyro_inverse=eye,
            gyro_bias=zero,
            force_inverse=eye,
            force_bias=zero,
        )

    def by_scipy() -> object:
        steps = Rotation.from_rotvec(rate[:20_000] / RATE)
        total = steps[0]
        for k in range(1, 2_000):
            total = total * steps[k]
        return total

    mine, plain = best(ours) / SAMPLES, best(lambda: bare(rate, 1.0 / RATE, out)) / SAMPLES
    theirs = best(by_scipy, 3) / 2_000
    print("attitude integration, ns a sample")
    print(f"  with the sums for an adjustment {1e9 * mine:10.1f}")
    print(f"  bare quaternion kernel          {1e9 * plain:10.1f}   ratio {mine / plain:.1f}")
    print(f"  scipy Rotation, one by one      {1e9 * theirs:10.1f}   ratio {mine / theirs:.4f}")


def adjustment(rng: np.random.Generator) -> None:
    true = 9.81 * twenty_six_directions()
    matrix = np.real(matrix_from_shin(np.array([1.01, 0.99, 1.005]), np.array([0.002, -0.004, 0.003])))
    observed = true @ matrix.T + np.array([0.1, -0.2, 0.15]) + rng.normal(0.0, 1e-3, true.shape)
    covariance = np.broadcast_to(1e-6 * np.eye(3), (26, 3, 3)).copy()
    start = rough_triad(observed, 9.81)

    def ours():
        return adjust_norm(observed, covariance, 9.81, start, 9)

    def residual(x: np.ndarray) -> np.ndarray:
        inverse = np.linalg.inv(np.real(matrix_from_shin(x[3:6], x[6:9])))
        return np.linalg.norm((observed - x[:3]) @ inverse.T, axis=1) - 9.81

    def theirs() -> object:
        return least_squares(residual, start[:9], method="lm")

    mine, other = best(ours), best(theirs)
    unknowns, adjustment = ours()
    gap = np.max(np.abs(unknowns[:9] - theirs().x) / np.sqrt(np.diag(adjustment.cofactor)[:9]))
    print("nine parameters from 26 holds, ms")
    print(f"  Gauss-Helmert, with its tests   {1e3 * mine:10.2f}")
    print(f"  scipy least_squares (lm)        {1e3 * other:10.2f}   ratio {mine / other:.2f}")
    print(f"  largest difference of a parameter: {gap:.3f} of its standard uncertainty")


if __name__ == "__main__":
    generator = np.random.default_rng(1)
    integration(generator)
    adjustment(generator)
