"""The loops of bordered chains, compiled; called by `chain`."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import sqrt


def whiten(
    covariance: cython.const[cython.double][:, :, :],
    given: list[object],
    root: cython.double[:, :, ::1],
    white: list[object],
) -> int:
    """Fill Cholesky factors of covariances (terms, m, m), and their inverses times each of `given` (terms, m, any).

    Return -1, or the term whose covariance is not positive.
    """
    with cython.nogil:
        bad = _factor(covariance, root)
    if bad < 0:
        for values, made in zip(given, white):  # noqa: B905 (of one length)
            _substitute(root, values, made)
    return int(bad)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(total=cython.double)
def _factor(
    covariance: cython.const[cython.double][:, :, :], root: cython.double[:, :, ::1]
) -> cython.Py_ssize_t:
    """Fill Cholesky factors; return -1, or the first that there is none of."""
    terms, m = root.shape[0], root.shape[1]
    for t in range(terms):
        for i in range(m):
            for j in range(i + 1):
                total = covariance[t, i, j]
                for k in range(j):
                    total -= root[t, i, k] * root[t, j, k]
                if i > j:
                    root[t, i, j] = total / root[t, j, j]
                elif not total > 0.0:
                    return t
                else:
                    root[t, i, i] = sqrt(total)
            for j in range(i + 1, m):
                root[t, i, j] = 0.0
    return -1


@cython.cfunc
def _substitute(
    root: cython.double[:, :, ::1],
    given: cython.const[cython.double][:, :, :],
    white: cython.double[:, :, ::1],
) -> None:
    """Fill what triangular factors make of `given`."""
    terms, m, size = white.shape[0], white.shape[1], white.shape[2]
    with cython.nogil:
        for t in range(terms):
            for i in range(m):
                for j in range(size):
                    white[t, i, j] = given[t, i, j]
                for k in range(i):
                    factor = root[t, i, k]
                    if factor != 0.0:
                        for j in range(size):
                            white[t, i, j] -= factor * white[t, k, j]
                pivot = 1.0 / root[t, i, i]
                for j in range(size):
                    white[t, i, j] *= pivot


def add_to_nodes(
    node: cython.const[cython.longlong][:],
    residual: cython.const[cython.double][:, :],
    columns: cython.const[cython.longlong][::1],
    by_border: cython.const[cython.double][:, :, ::1],
    by: cython.const[cython.double][:, :, ::1],
    by_before: cython.const[cython.double][:, :, ::1],
    gradient: cython.double[:, ::1],
    border: cython.double[:, :, ::1],
    diagonal: cython.double[:, :, ::1],
    lower: cython.double[:, :, ::1],
) -> None:
    """Add what whitened residuals say of the nodes that they depend on: products of `by` with all that they depend on.

    `by_border` is by some `columns` of the border. `lower` gets those with `by_before`, in the row before the node's.
    """
    terms, m, size = by.shape[0], by.shape[1], by.shape[2]
    b, before = by_border.shape[2], by_before.shape[2]
    with cython.nogil:
        for t in range(terms):
            k = node[t]
            for i in range(size):
                for r in range(m):
                    factor = by[t, r, i]
                    if factor == 0.0:
                        continue
                    gradient[k, i] += factor * residual[t, r]
                    for j in range(b):
                        border[k, i, columns[j]] += factor * by_border[t, r, j]
                    for j in range(size):
                        diagonal[k, i, j] += factor * by[t, r, j]
                    for j in range(before):
                        lower[k - 1, i, j] += factor * by_before[t, r, j]


def add_to_border(
    chain: cython.const[cython.longlong][:],
    residual: cython.const[cython.double][:, :],
    columns: cython.const[cython.longlong][::1],
    by_border: cython.const[cython.double][:, :, ::1],
    corner: cython.double[:, :, ::1],
    gradient: cython.double[:, ::1],
) -> None:
    """Add what whitened residuals say of the borders of chains, `corner` (chains, b, b) and `gradient` (chains, b).

    Zeros cost nothing.
    """
    terms, m, b = by_border.shape[0], by_border.shape[1], by_border.shape[2]
    with cython.nogil:
        for t in range(terms):
            k = chain[t]
            for r in range(m):
                for i in range(b):
                    factor = by_border[t, r, i]
                    if factor == 0.0:
                        continue
                    gradient[k, columns[i]] += factor * residual[t, r]
                    for j in range(b):
                        corner[k, columns[i], columns[j]] += factor * by_border[t, r, j]


def add_squares(
    chain: cython.const[cython.longlong][:],
    columns: cython.const[cython.longlong][::1],
    square: cython.const[cython.double][:, :, ::1],
    right: cython.const[cython.double][:, :],
    corner: cython.double[:, :, ::1],
    gradient: cython.double[:, ::1],
) -> None:
    """Add squares (members, b, b) and right sides (members, b) to some `columns` of the borders of some chains."""
    members, b = square.shape[0], square.shape[1]
    with cython.nogil:
        for c in range(members):
            k = chain[c]
            for i in range(b):
                gradient[k, columns[i]] += right[c, i]
                for j in range(b):
                    corner[k, columns[i], columns[j]] += square[c, i, j]


def eliminate(
    diagonal: cython.double[:, :, ::1],
    lower: cython.double[:, :, ::1],
    border: cython.double[:, :, ::1],
    gradient: cython.double[:, ::1],
) -> int:
    """Factor a bordered chain in place, nodes from first to last; return -1, or the node that is not positive.

    `diagonal` (nodes, d, d) becomes the Cholesky factors L_k; `lower` (nodes - 1, d, d), blocks in row k + 1 and
    column k, becomes L_k^-1 lower_k'; `border` (nodes, d, b) and `gradient` (nodes, d) become L_k^-1 times
    what is left of them. Their squares are what the border's own equations lose to the nodes.
    """
    with cython.nogil:
        found = _eliminate(diagonal, lower, border, gradient)
    return int(found)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(total=cython.double)
def _eliminate(
    diagonal: cython.double[:, :, ::1],
    lower: cython.double[:, :, ::1],
    border: cython.double[:, :, ::1],
    gradient: cython.double[:, ::1],
) -> cython.Py_ssize_t:
    """Do what `eliminate` does."""
    nodes, d, b = border.shape[0], border.shape[1], border.shape[2]
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
                    diagonal[k, i, i] = sqrt(total)
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
    return -1


@cython.locals(total=cython.double)
def substitute(
    diagonal: cython.const[cython.double][:, :, ::1],
    lower: cython.const[cython.double][:, :, ::1],
    border: cython.const[cython.double][:, :, ::1],
    gradient: cython.const[cython.double][:, ::1],
    corner_step: cython.const[cython.double][::1],
    steps: cython.double[:, ::1],
) -> None:
    """Fill `steps` (nodes, d) from the factors of `eliminate` and the border's step (b,)."""
    with cython.nogil:
        nodes, d, b = border.shape[0], border.shape[1], border.shape[2]
        for back in range(nodes):
            k = nodes - 1 - back
            for i in range(d):
                total = -gradient[k, i]
                for j in range(b):
                    total -= border[k, i, j] * corner_step[j]
                if k + 1 < nodes:
                    for j in range(d):
                        total -= lower[k, i, j] * steps[k + 1, j]
                steps[k, i] = total
            for up in range(d):
                i = d - 1 - up
                for m in range(i + 1, d):
                    steps[k, i] -= diagonal[k, m, i] * steps[k, m]
                steps[k, i] /= diagonal[k, i, i]


def solve_chain(
    diagonal: cython.const[cython.double][:, :, ::1],
    lower: cython.const[cython.double][:, :, ::1],
    solution: cython.double[:, :, ::1],
) -> None:
    """Turn a right side (nodes, d, columns) into the solution, by the factors of a chain without a border."""
    nodes, d, columns = solution.shape[0], solution.shape[1], solution.shape[2]
    with cython.nogil:
        for k in range(nodes):
            for i in range(d):
                if k > 0:
                    for m in range(d):
                        for j in range(columns):
                            solution[k, i, j] -= lower[k - 1, m, i] * solution[k - 1, m, j]
            for i in range(d):
                for m in range(i):
                    for j in range(columns):
                        solution[k, i, j] -= diagonal[k, i, m] * solution[k, m, j]
                for j in range(columns):
                    solution[k, i, j] /= diagonal[k, i, i]
        for back in range(nodes):
            k = nodes - 1 - back
            for up in range(d):
                i = d - 1 - up
                if k + 1 < nodes:
                    for m in range(d):
                        for j in range(columns):
                            solution[k, i, j] -= lower[k, i, m] * solution[k + 1, m, j]
                for m in range(i + 1, d):
                    for j in range(columns):
                        solution[k, i, j] -= diagonal[k, m, i] * solution[k, m, j]
                for j in range(columns):
                    solution[k, i, j] /= diagonal[k, i, i]


@cython.locals(total=cython.double)
def invert_selected(
    diagonal: cython.const[cython.double][:, :, ::1],
    lower: cython.const[cython.double][:, :, ::1],
    border: cython.const[cython.double][:, :, ::1],
    corner_covariance: cython.const[cython.double][:, ::1],
    own: cython.double[:, :, ::1],
    following: cython.double[:, :, ::1],
    with_border: cython.double[:, :, ::1],
) -> None:
    """Fill the covariances of nodes from the factors of `eliminate` and the border's covariance.

    `own` (nodes, d, d); `following` (nodes - 1, d, d), of node k with node k + 1; `with_border` (nodes, d, b).
    """
    nodes, d, b = border.shape[0], border.shape[1], border.shape[2]
    gain_next: cython.double[:, ::1] = np.zeros((d, d))
    gain: cython.double[:, ::1] = np.zeros((d, b))
    root: cython.double[:, ::1] = np.zeros((d, d))
    with cython.nogil:
        for back in range(nodes):
            k = nodes - 1 - back
            # x_k = -L^-T (B z + K x_next) + L^-T e, with e of unit variance
            for j in range(d):
                for i in range(d):
                    root[i, j] = 0.0
                root[j, j] = 1.0
                for up in range(d):
                    i = d - 1 - up
                    for m in range(i + 1, d):
                        root[i, j] -= diagonal[k, m, i] * root[m, j]
                    root[i, j] /= diagonal[k, i, i]
            # Row by row, so that entries of a row are worked on side by side.
            for i in range(d):
                for j in range(b):
                    gain[i, j] = with_border[k, i, j] = 0.0
                for j in range(d):
                    gain_next[i, j] = 0.0
                for m in range(i, d):
                    for j in range(b):
                        gain[i, j] -= root[i, m] * border[k, m, j]
                    if k + 1 < nodes:
                        for j in range(d):
                            gain_next[i, j] -= root[i, m] * lower[k, m, j]
                for m in range(b):
                    for j in range(b):
                        with_border[k, i, j] += gain[i, m] * corner_covariance[m, j]
                if k + 1 < nodes:
                    for m in range(d):
                        for j in range(b):
                            with_border[k, i, j] += gain_next[i, m] * with_border[k + 1, m, j]
            for i in range(d):
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
