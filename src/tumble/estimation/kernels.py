"""The loops of bordered chains, compiled by numba; called by `chain`."""

# pyright: reportUnknownMemberType=false, reportUntypedFunctionDecorator=false, reportMissingTypeStubs=false

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@numba.njit(cache=True, nogil=True)
def eliminate(
    diagonal: Floats,
    lower: Floats,
    border: Floats,
    gradient: Floats,
    corner: Floats,
    corner_gradient: Floats,
) -> int:
    """Factor a bordered chain in place, nodes from first to last; return -1, or the node that is not positive.

    `diagonal` (nodes, d, d) becomes the Cholesky factors L_k; `lower` (nodes - 1, d, d), blocks in row k + 1 and
    column k, becomes L_k^-1 lower_k'; `border` (nodes, d, b) and `gradient` (nodes, d) become L_k^-1 times
    what is left of them; `corner` (b, b) and `corner_gradient` (b,) lose what the nodes take.
    """
    nodes, d, b = border.shape
    for k in range(nodes):
        if k > 0:
            for i in range(d):
                for j in range(d):
                    total = 0.0
                    for m in range(d):
                        total += lower[k - 1, m, i] * lower[k - 1, m, j]
                    diagonal[k, i, j] -= total
                for j in range(b):
                    total = 0.0
                    for m in range(d):
                        total += lower[k - 1, m, i] * border[k - 1, m, j]
                    border[k, i, j] -= total
                for m in range(d):
                    gradient[k, i] -= lower[k - 1, m, i] * gradient[k - 1, m]
        for i in range(d):
            for j in range(i + 1):
                total = diagonal[k, i, j]
                for m in range(j):
                    total -= diagonal[k, i, m] * diagonal[k, j, m]
                if i == j:
                    if not total > 0.0:
                        return k
                    diagonal[k, i, i] = np.sqrt(total)
                else:
                    diagonal[k, i, j] = total / diagonal[k, j, j]
            for j in range(i + 1, d):
                diagonal[k, i, j] = 0.0
        for i in range(d):
            pivot = 1.0 / diagonal[k, i, i]
            for m in range(i):
                factor = diagonal[k, i, m]
                for j in range(b):
                    border[k, i, j] -= factor * border[k, m, j]
                gradient[k, i] -= factor * gradient[k, m]
            for j in range(b):
                border[k, i, j] *= pivot
            gradient[k, i] *= pivot
        if k + 1 < nodes:
            # L^-1 of the transpose: of `lower` itself, column by column
            for j in range(d):
                for i in range(j):
                    lower[k, i, j], lower[k, j, i] = lower[k, j, i], lower[k, i, j]
            for i in range(d):
                for m in range(i):
                    for j in range(d):
                        lower[k, i, j] -= diagonal[k, i, m] * lower[k, m, j]
                for j in range(d):
                    lower[k, i, j] /= diagonal[k, i, i]
        for i in range(d):
            for j in range(b):
                factor = border[k, i, j]
                if factor != 0.0:
                    for m in range(b):
                        corner[j, m] -= factor * border[k, i, m]
                    corner_gradient[j] -= factor * gradient[k, i]
    return -1


@numba.njit(cache=True, nogil=True)
def substitute(
    diagonal: Floats, lower: Floats, border: Floats, gradient: Floats, corner_step: Floats, steps: Floats
) -> None:
    """Fill `steps` (nodes, d) from the factors of `eliminate` and the border's step (b,)."""
    nodes, d, b = border.shape
    for k in range(nodes - 1, -1, -1):
        for i in range(d):
            total = -gradient[k, i]
            for j in range(b):
                total -= border[k, i, j] * corner_step[j]
            if k + 1 < nodes:
                for j in range(d):
                    total -= lower[k, i, j] * steps[k + 1, j]
            steps[k, i] = total
        for i in range(d - 1, -1, -1):
            for m in range(i + 1, d):
                steps[k, i] -= diagonal[k, m, i] * steps[k, m]
            steps[k, i] /= diagonal[k, i, i]


@numba.njit(cache=True, nogil=True)
def invert_selected(
    diagonal: Floats,
    lower: Floats,
    border: Floats,
    corner_covariance: Floats,
    own: Floats,
    following: Floats,
    with_border: Floats,
) -> None:
    """Fill the covariances of nodes from the factors of `eliminate` and the border's covariance.

    `own` (nodes, d, d); `following` (nodes - 1, d, d), of node k with node k + 1; `with_border` (nodes, d, b).
    """
    nodes, d, b = border.shape
    gain_next = np.zeros((d, d))
    gain = np.zeros((d, b))
    root = np.zeros((d, d))
    for k in range(nodes - 1, -1, -1):
        # x_k = -L^-T (B z + K x_next) + L^-T e, with e of unit variance
        root[:, :] = 0.0
        for j in range(d):
            root[j, j] = 1.0
            for i in range(d - 1, -1, -1):
                for m in range(i + 1, d):
                    root[i, j] -= diagonal[k, m, i] * root[m, j]
                root[i, j] /= diagonal[k, i, i]
        for i in range(d):
            for j in range(b):
                total = 0.0
                for m in range(d):
                    total -= root[i, m] * border[k, m, j]
                gain[i, j] = total
            for j in range(d):
                total = 0.0
                if k + 1 < nodes:
                    for m in range(d):
                        total -= root[i, m] * lower[k, m, j]
                gain_next[i, j] = total
        for i in range(d):
            for j in range(b):
                total = 0.0
                for m in range(b):
                    total += gain[i, m] * corner_covariance[m, j]
                if k + 1 < nodes:
                    for m in range(d):
                        total += gain_next[i, m] * with_border[k + 1, m, j]
                with_border[k, i, j] = total
            if k + 1 < nodes:
                for j in range(d):
                    total = 0.0
                    for m in range(b):
                        total += gain[i, m] * with_border[k + 1, j, m]
                    for m in range(d):
                        total += gain_next[i, m] * own[k + 1, m, j]
                    following[k, i, j] = total
        for i in range(d):
            for j in range(d):
                total = 0.0
                for m in range(d):
                    total += root[i, m] * root[j, m]
                for m in range(b):
                    total += gain[j, m] * with_border[k, i, m]
                if k + 1 < nodes:
                    for m in range(d):
                        total += gain_next[j, m] * following[k, i, m]
                own[k, i, j] = total
