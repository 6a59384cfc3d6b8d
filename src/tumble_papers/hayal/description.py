"""What a method finds of each triad, and the estimate that it is as a whole."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Square, Vector
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    NamedValue,
    Said,
    correlation_matrix,
    coverage_factor,
)
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad, propagate
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.units import angular_rate_factor, specific_force_factor

Complex = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class FoundTriad:
    """What a method finds of one triad.

    Attributes
    ----------
    matrix, bias : (3, 3) raw per SI unit, (3,) raw.
    covariance : (12, 12) of the matrix, by rows, and the bias; zero of what is not estimated.
    estimated : (3, 3) of bool, the elements of the matrix that are.
    sigma0, redundancy : of an adjustment (3.37); a closed form has none.
    """

    matrix: Matrix
    bias: Vector
    covariance: Square
    estimated: np.ndarray
    sigma0: float = float("nan")
    redundancy: int = 0


@dataclass(frozen=True, slots=True)
class _Told:
    """A triad's canonical names with their covariance, and named values with theirs."""

    names: list[str]
    covariance: Square
    values: list[NamedValue]
    spread: Square


def estimate_of_triads(
    method: str,
    units: tuple[str, str],
    frame: str,
    accelerometer: FoundTriad | None,
    gyro: FoundTriad | None,
    not_determined: list[str],
) -> Estimate:
    """Return the estimate of a method.

    Parameters
    ----------
    method : its name.
    units : raw units of specific force and angular rate.
    frame : ``fixture``, or ``accelerometer-x`` where each triad has a lower-triangular matrix of its own.
    accelerometer, gyro : what was found; at least one of them.
    not_determined : sentences.
    """
    from scipy.linalg import block_diag

    factors = specific_force_factor(units[0]), angular_rate_factor(units[1])
    kinds = ("accelerometer", accelerometer), ("gyroscope", gyro)
    told = [
        _tell(kind, found, unit, factor, frame)
        for (kind, found), unit, factor in zip(kinds, units, factors, strict=True)
        if found is not None
    ]
    described = Described(
        ImuModel(_triad(accelerometer), _triad(gyro)),
        [name for one in told for name in one.names],
        block_diag(*(one.covariance for one in told)),
        [value for one in told for value in one.values],
        correlation_matrix(block_diag(*(one.spread for one in told))),
    )
    first = accelerometer or gyro
    assert first is not None
    factor = coverage_factor(first.redundancy) if first.redundancy else 1.96
    figures = Figures(first.sigma0, first.sigma0, first.redundancy, factor, 0.0, {})
    said = [Said("not determined", text) for text in not_determined]
    return Estimate(method, *described, *figures, said=said, frame=frame)


def _triad(found: FoundTriad | None) -> Triad | None:
    return None if found is None else Triad(found.matrix, found.bias)


def _tell(kind: str, found: FoundTriad, unit: str, factor: float | None, frame: str) -> _Told:
    """Name what was estimated: biases, scale factors, and how the axes lean against the frame or one another."""
    short, si = ("gyro", "rad/s") if kind == "gyroscope" else (kind, "m/s²")
    known, off = found.estimated, ~np.eye(3, dtype=bool)
    names = [f"{kind}.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    names += [f"{kind}.bias[{i}]" for i in range(3)]
    canonical = np.flatnonzero([*known.ravel(), True, True, True])
    scale, per = ("scale factor error", "1") if factor else ("scale factor", f"{unit}/({si})")
    labels = [(f"{short} bias {axis}", unit) for axis in "xyz"]
    labels += [(f"{short} {scale} {axis}", per) for axis in "xyz"]
    if frame == "fixture":
        labels += [(f"{short} misalignment {a}{b}", "rad") for a in "xyz" for b in "xyz" if a != b]
        leaning = known[off]
    else:
        labels += [(f"{short} non-orthogonality {angle}", "rad") for angle in ("yz", "zx", "zy")]
        leaning = known[[1, 2, 2], [0, 1, 0]]

    def evaluate(x: Complex) -> Complex:
        matrix = x[:9].reshape(3, 3)
        if frame == "fixture":
            size = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
            angles = np.arcsin((matrix / size[:, None])[off])
        else:
            size, angles = shin_from_matrix(matrix)
        return np.concatenate([x[9:], size * factor - 1.0 if factor else size, angles])

    numbers, spread = propagate(
        evaluate, np.concatenate([found.matrix.ravel(), found.bias]), found.covariance
    )
    rows = np.flatnonzero([True, True, True, *np.diag(known), *leaning])
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    values = [NamedValue(labels[i][0], float(numbers[i]), float(sigmas[i]), labels[i][1]) for i in rows]
    return _Told(
        [names[i] for i in canonical],
        found.covariance[np.ix_(canonical, canonical)],
        values,
        spread[np.ix_(rows, rows)],
    )
