"""Passes over the samples, compiled.

Every pass takes the raw arrays as they are (any layout, read-only included) and fills small arrays
of blocks that the caller made: no temporary grows with the samples.
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import sqrt


@cython.locals(
    s0=cython.double, s1=cython.double, s2=cython.double, q0=cython.double, q1=cython.double, q2=cython.double
)
def block_moments(
    signal: cython.const[cython.double][:, :],
    size: cython.Py_ssize_t,
    mean: cython.double[:, ::1],
    roughness: cython.float[:, ::1],
) -> None:
    """Fill each block's mean and roughness (half the mean square of successive differences).

    The difference from the last sample of the block before counts too, so that a block of one
    sample has a roughness. White noise of variance v has the expected roughness v.
    """
    with cython.nogil:
        for block in range(mean.shape[0]):
            first = block * size
            s0 = s1 = s2 = 0.0
            q0 = q1 = q2 = 0.0
            # the first block has no sample before it: its first difference is zero
            before = first - 1 if first > 0 else 0
            b0, b1, b2 = signal[before, 0], signal[before, 1], signal[before, 2]
            for i in range(first, first + size):
                x0, x1, x2 = signal[i, 0], signal[i, 1], signal[i, 2]
                s0 += x0
                s1 += x1
                s2 += x2
                q0 += (x0 - b0) * (x0 - b0)
                q1 += (x1 - b1) * (x1 - b1)
                q2 += (x2 - b2) * (x2 - b2)
                b0, b1, b2 = x0, x1, x2
            mean[block, 0] = s0 / size
            mean[block, 1] = s1 / size
            mean[block, 2] = s2 / size
            roughness[block, 0] = 0.5 * q0 / size
            roughness[block, 1] = 0.5 * q1 / size
            roughness[block, 2] = 0.5 * q2 / size


@cython.locals(
    total=cython.double, s0=cython.double, s1=cython.double, s2=cython.double, weight=cython.double
)
def triangle_smooth(
    mean: cython.const[cython.double][:, ::1],
    half_width: cython.Py_ssize_t,
    smooth: cython.double[:, ::1],
) -> None:
    """Fill the triangle-weighted mean over `half_width` blocks to either side (cut off at the ends)."""
    with cython.nogil:
        blocks = mean.shape[0]
        for k in range(blocks):
            total = 0.0
            s0 = s1 = s2 = 0.0
            for j in range(max(k - half_width + 1, 0), min(k + half_width, blocks)):
                weight = half_width - (j - k if j > k else k - j)
                total += weight
                s0 += weight * mean[j, 0]
                s1 += weight * mean[j, 1]
                s2 += weight * mean[j, 2]
            smooth[k, 0] = s0 / total
            smooth[k, 1] = s1 / total
            smooth[k, 2] = s2 / total


def change_sizes(
    smooth: cython.const[cython.double][:, ::1],
    lag: cython.Py_ssize_t,
    sizes: cython.double[::1],
) -> None:
    """Fill the length of the change from `lag` blocks before to `lag` blocks after (less at the ends)."""
    with cython.nogil:
        blocks = smooth.shape[0]
        for k in range(blocks):
            a, b = max(k - lag, 0), min(k + lag, blocks - 1)
            x = smooth[b, 0] - smooth[a, 0]
            y = smooth[b, 1] - smooth[a, 1]
            z = smooth[b, 2] - smooth[a, 2]
            sizes[k] = sqrt(x * x + y * y + z * z)


__all__ = ["block_moments", "change_sizes", "triangle_smooth"]
