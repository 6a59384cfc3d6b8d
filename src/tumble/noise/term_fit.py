"""White noise, bias instability and random walks from an Allan curve, by weighted least squares.

The Allan variance is a sum of the terms' variances with coefficients that cannot be negative, so the fit is
linear with bounds. Points an octave apart are taken as independent, each with the relative standard
deviation √(2/edf) of a variance.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi

import numpy as np

from tumble.arrays import Series, Table
from tumble.noise.deviation import Deviation

_LETTERS = "QNBKR"
_SEEN = 2.0  # standard uncertainties that a coefficient's square must have
_ROUNDS = 12


@dataclass(frozen=True, slots=True)
class FittedTerm:
    """A coefficient in SI (or counts): letter of IEEE Std 952, value, and limits at one standard deviation."""

    letter: str
    value: float
    low: float
    high: float


def term_curve(letter: str, tau: Series) -> Series:
    """Return the Allan variance of a coefficient of one, IEEE Std 952-2020 annex C."""
    if letter == "B":
        return np.full(tau.size, 2.0 * log(2.0) / pi)
    factor, power = {"Q": (3.0, -2), "N": (1.0, -1), "K": (1.0 / 3.0, 1), "R": (0.5, 2)}[letter]
    return factor * tau ** float(power)


def fit_terms(curve: Deviation, shortest: float = 0.0) -> tuple[tuple[FittedTerm, ...], dict[str, float]]:
    """Return the terms that a curve of one channel shows, and upper limits of those of N, B, K that it does not.

    Parameters
    ----------
    curve : overlapping Allan deviation at octaves, one channel.
    shortest : s; averaging times below are not used.
    """
    used = (curve.tau >= shortest) & (curve.edf[:, 0] > 0.0) & (curve.deviation[:, 0] > 0.0)
    tau, variance, edf = curve.tau[used], curve.deviation[used, 0] ** 2, curve.edf[used, 0]
    letters = list(_LETTERS)
    coefficients, covariance = np.zeros(0), np.zeros((0, 0))
    while letters and tau.size:
        design = np.column_stack([term_curve(letter, tau) for letter in letters])
        coefficients, covariance = _solve(design, variance, edf)
        # Weakest first: what is not seen may make another seen.
        strength = coefficients / np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
        weakest = int(np.argmin(strength))
        if strength[weakest] >= _SEEN:
            break
        letters.pop(weakest)
    spread = np.sqrt(np.diag(covariance))
    terms = tuple(
        FittedTerm(letter, float(np.sqrt(c)), float(np.sqrt(max(c - s, 0.0))), float(np.sqrt(c + s)))
        for letter, c, s in zip(letters, coefficients, spread, strict=True)
        if c > 0.0
    )
    return terms, _unseen({term.letter for term in terms}, curve)


def _solve(design: Table, variance: Series, edf: Series) -> tuple[Series, Table]:
    """Coefficients not below zero, weighed by the fitted curve; their covariance as if there were no bound."""
    from scipy.optimize import nnls

    model = variance.copy()
    coefficients = np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        # Weights from the model: weights from the data would believe points that came out low.
        weight = np.sqrt(0.5 * edf) / model
        scale = np.sqrt(np.sum((weight[:, None] * design) ** 2, axis=0))
        solved, _ = nnls(weight[:, None] * design / scale, weight * variance)
        coefficients = solved / scale
        fitted = design @ coefficients
        model = np.where(fitted > 0.0, fitted, variance)
    rows = (np.sqrt(0.5 * edf) / model)[:, None] * design
    scale = np.sqrt(np.sum(rows**2, axis=0))
    normal = np.asarray((rows / scale).T @ (rows / scale), dtype=np.float64)
    inverse = np.asarray(np.linalg.pinv(normal), dtype=np.float64)
    return coefficients, inverse / np.outer(scale, scale)


def _unseen(found: set[str], curve: Deviation) -> dict[str, float]:
    """Upper limits of those of N, B and K that are not found, each as if it were alone in the curve."""
    high, tau = curve.high[:, 0], curve.tau
    return {
        letter: float(np.min(high / np.sqrt(term_curve(letter, tau))))
        for letter in "NBK"
        if letter not in found
    }


__all__ = ["FittedTerm", "fit_terms", "term_curve"]
