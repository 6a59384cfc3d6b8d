"""From the measurements of the sequences to the sensors' errors (Savage 2018, (13), (14)), and for any set of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tumble.arrays import Series, Square, Table, inverted
from tumble.errors import ObservabilityError
from tumble.records import dataclass
from tumble_papers.savage.rotation_sequences import SequenceModel, across_down

X, Y, Z, START, END = range(5)
WITHOUT_ASYMMETRY = ("1a", "2a", "3a")
# A combination of errors that the sequences tell this much worse than the best is not told.
SINGULAR = 1e-6
# m/s²: a bias moves a measurement by itself, a scale factor by gravity.
GRAVITY = 9.8


def invert_measurements(
    measurements: Mapping[str, Series], gravity: float, *, asymmetry: bool = True
) -> Series:
    """Return Savage's 24 errors from the measurements of table 1: each from the sequences made for it.

    Parameters
    ----------
    measurements : by sequence "1" to "14" and "1a" to "3a", (5,) each, m/s².
    gravity : m/s².
    asymmetry : use 1a to 3a (13); without them the gyros' asymmetry is taken as none (14).

    Raises
    ------
    ObservabilityError
        If a sequence is missing.

    Notes
    -----
    Savage 2018, (13), but for three signs: λiii = -(end - start + 2 λi) / 2g. With the printed sign the
    asymmetry is off by twice the bias over g in the first pass.
    """
    wanted = [str(k) for k in range(1, 15)] + (list(WITHOUT_ASYMMETRY) if asymmetry else [])
    missing = [name for name in wanted if name not in measurements]
    if missing:
        raise ObservabilityError(
            f"The formulas (13) need all sequences, and {', '.join(missing)} are missing."
        )
    m, g = measurements, gravity
    full = 4.0 * np.pi * g
    pairs = [
        (s * m[k][c], s * m[f"{k}a"][c] if asymmetry else -s * m[k][c])
        for k, c, s in (("2", Y, 1.0), ("1", X, -1.0), ("3", Y, -1.0))
    ]
    kappa = np.array([(one - other) / full for one, other in pairs])
    kappa_asymmetry = np.array([(one + other) / full for one, other in pairs])
    yz, zx, xy = m["4"][Y] / (4 * g), m["5"][X] / (4 * g), m["6"][Y] / (4 * g)
    bias = np.array(
        [
            -0.5 * m["14"][X] - g * zx,
            -0.5 * m["13"][Y] - g * yz,
            -0.5 * (m["7"][Z] + np.pi * g * (kappa[0] + kappa_asymmetry[0])),
        ]
    )
    mu = [
        (m["7"][X] - g * xy) / (2 * g),
        (m["8"][X] - g * zx) / (2 * g),
        (m["12"][Y] - g * xy) / (2 * g),
        (m["11"][Y] - g * yz) / (2 * g),
        (m["9"][Z] - g * zx) / (2 * g),
        (m["10"][Z] - g * yz) / (2 * g),
    ]
    downs = [m["9"], m["7"], m["8"]]
    scale = [-(d[END] + d[START]) / (2 * g) for d in downs]
    scale_asymmetry = [-(d[END] - d[START] + 2 * b) / (2 * g) for d, b in zip(downs, bias, strict=True)]
    return np.concatenate([kappa, kappa_asymmetry, [yz, zx, xy], bias, scale, scale_asymmetry, mu])


@dataclass(frozen=True, slots=True)
class SequenceSolution:
    """Errors by least squares over all components of all sequences.

    Attributes
    ----------
    errors : (24,) as `savage.NAMES`; zero where not determined.
    covariance : (24, 24); zero rows where not determined.
    determined : (24,) of bool.
    residuals : (sequences, 4) m/s²: two horizontal components, down at start and end.
    sigmas : (sequences, 4) their standard deviations as given.
    square_sum, degrees : of the residuals.
    """

    errors: Series
    covariance: Square
    determined: np.ndarray
    residuals: Table
    sigmas: Table
    square_sum: float
    degrees: int


def solve_measurements(
    models: Sequence[SequenceModel],
    measurements: Sequence[Series],
    covariances: Sequence[Square],
    *,
    asymmetry: bool = True,
    believed: tuple[Series, float] | None = None,
) -> SequenceSolution:
    """Solve for the errors that any set of sequences determines, each component weighed by its noise.

    Parameters
    ----------
    models, measurements, covariances : of each sequence: its model, (5,) and (5, 5).
    asymmetry : estimate the gyros' asymmetry; without, it is none.
    believed : (3,) the gyros' asymmetries as they are believed beforehand, and how well: what no sequence determines
        of them then stands in the uncertainty of the scale factors. None for nothing.

    Raises
    ------
    ObservabilityError
        If there is no sequence.

    Notes
    -----
    The paper takes from each sequence the one component that it was made for; here the others count too. An
    error that the sequences do not tell apart from others is left at zero and said to be undetermined.
    """
    if not models:
        raise ObservabilityError("There is no rotation sequence to solve from.")
    rows, told, roots, sigmas = _weighed(models, measurements, covariances)
    free = np.ones(24, dtype=bool)
    if not asymmetry:
        free[3:6] = False
    design, right = np.concatenate(rows), np.concatenate(told)
    measured_rows = len(right)
    if believed is not None:
        extra = np.zeros((3, 24))
        extra[:, 3:6] = np.eye(3) / believed[1]
        design, right = np.concatenate([design, extra]), np.concatenate([right, believed[0] / believed[1]])
    size = np.linalg.norm(design, axis=0)
    # Half a turn's sine leaves round-off where nothing is told.
    seen = size > SINGULAR * np.max(size) / GRAVITY
    design, size = np.where(seen, design, 0.0), np.where(seen, size, 1.0)
    scaled = (design / size)[:, free]
    _, values, directions = np.linalg.svd(scaled, full_matrices=False)
    untold = directions[values < SINGULAR * values[0]] if len(values) else directions
    share = np.zeros(24)
    share[free] = np.sum(untold**2, axis=0)
    known = free & seen & (share < SINGULAR)
    # Combinations with what is not determined are free too, so that they do not bend what is.
    solution = np.asarray(np.linalg.pinv(scaled, rcond=SINGULAR), dtype=np.float64)
    estimate = np.zeros(24)
    estimate[free] = (solution @ right) / size[free]
    cofactor = np.zeros((24, 24))
    cofactor[np.ix_(free, free)] = (solution @ solution.T) / np.outer(size[free], size[free])
    left = right - design @ estimate
    rank = int(np.count_nonzero(values >= SINGULAR * values[0]))
    residuals = np.zeros((len(roots), 4))
    for row, (root, piece) in enumerate(zip(roots, left[:measured_rows].reshape(-1, 4), strict=True)):
        residuals[row] = np.linalg.solve(root, piece)
    estimate[~known] = 0.0
    cofactor[~known] = cofactor[:, ~known] = 0.0
    return SequenceSolution(
        estimate,
        cofactor,
        known,
        residuals,
        np.array(sigmas),
        float(left @ left),
        right.size - rank,
    )


def _weighed(
    models: Sequence[SequenceModel], measurements: Sequence[Series], covariances: Sequence[Square]
) -> tuple[list[Table], list[Series], list[Table], list[Series]]:
    """Coefficients and measurements of each sequence over their noise, the noise's roots, and its sigmas."""
    rows: list[Table] = []
    told: list[Series] = []
    roots: list[Table] = []
    sigmas: list[Series] = []
    for model, measured, covariance in zip(models, measurements, covariances, strict=True):
        take = np.zeros((4, 5))
        take[:2, :3] = across_down(model.down_start)
        take[2, START] = take[3, END] = 1.0
        noise = take @ covariance @ take.T
        root = inverted(np.asarray(np.linalg.cholesky(noise), dtype=np.float64))
        rows.append(root @ take @ model.coefficients)
        told.append(root @ take @ measured)
        roots.append(root)
        sigmas.append(np.sqrt(np.diag(noise)))
    return rows, told, roots, sigmas
