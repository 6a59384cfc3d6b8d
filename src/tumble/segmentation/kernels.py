"""Passes over the samples, compiled.

Every pass takes the raw arrays as they are (any layout, read-only included) and fills small arrays
of blocks that the caller made: no temporary grows with the samples.
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import sqrt


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
    sums = cython.declare(cython.double[3])
    squares = cython.declare(cython.double[3])
    before = cython.declare(cython.double[3])
    with cython.nogil:
        for block in range(mean.shape[0]):
            first = block * size
            for axis in range(3):
                sums[axis] = squares[axis] = 0.0
                # the first block has no sample before it: its first difference is zero
                before[axis] = signal[first - 1 if first > 0 else 0, axis]
            for i in range(first, first + size):
                for axis in range(3):
                    x = signal[i, axis]
                    sums[axis] += x
                    squares[axis] += (x - before[axis]) * (x - before[axis])
                    before[axis] = x
            for axis in range(3):
                mean[block, axis] = sums[axis] / size
                roughness[block, axis] = 0.5 * squares[axis] / size


def triangle_smooth(
    mean: cython.const[cython.double][:, ::1],
    half_width: cython.Py_ssize_t,
    smooth: cython.double[:, ::1],
) -> None:
    """Fill the triangle-weighted mean over `half_width` blocks to either side (cut off at the ends)."""
    sums = cython.declare(cython.double[3])
    with cython.nogil:
        blocks = mean.shape[0]
        for k in range(blocks):
            total = 0.0
            sums[0] = sums[1] = sums[2] = 0.0
            for j in range(max(k - half_width + 1, 0), min(k + half_width, blocks)):
                weight = cython.cast(cython.double, half_width - (j - k if j > k else k - j))
                total += weight
                for axis in range(3):
                    sums[axis] += weight * mean[j, axis]
            for axis in range(3):
                smooth[k, axis] = sums[axis] / total


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
