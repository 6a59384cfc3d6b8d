"""From what a gyro shows at no rate in each placement to its bias: Earth rate and g-sensitivity taken out.

On a table in placement c, averaged over whole revolutions, the gyro shows besides the table's rate

    bias_c = bias + matrix @ axis_c upward_c omega sin(latitude) + g_sensitivity @ axis_c upward_c gravity

with `upward` the cosine between the axis and up. The last two look alike except that the Earth's is
known. A g-sensitivity is told from the bias if the placements are four or more that no plane holds.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Table, Vector, Vectors, inverted
from tumble.calibration.checks.snooping import wald_test
from tumble.calibration.equations.placement import find_added_sigma, is_excessive
from tumble.calibration.estimate import TermTest
from tumble.calibration.verdict import two_digits
from tumble.earth import EARTH_RATE, Site
from tumble.estimation import Adjustment, Linearisation, adjust
from tumble.records import dataclass

G_SENSITIVITY_FALSE_ALARM = 0.01


@dataclass(frozen=True, slots=True)
class PlacementBiases:
    """The bias and what was found beside it; raw.

    Attributes
    ----------
    bias, covariance : (3,), (3, 3).
    weights : (3, 3 placements): the bias is this times the placements' biases, less what is known.
    beside : (placements, 3) what each placement shows beside the bias: Earth rate, g-sensitivity.
    g_sensitivity, g_sensitivity_covariance : (3, 3), (9, 9) raw per m/s², or None.
    test : of the g-sensitivity, or None where it cannot be told.
    remarks, not_determined : sentences.
    """

    bias: Vector
    covariance: Square
    weights: Table
    beside: Vectors
    g_sensitivity: Matrix | None = None
    g_sensitivity_covariance: Table | None = None
    test: TermTest | None = None
    remarks: list[str] = field(default_factory=list[str])
    not_determined: list[str] = field(default_factory=list[str])


class _LinearConditions:
    """``design @ unknowns = observed`` with a full covariance, as one group."""

    def __init__(self, design: AnyArray, observed: Series, covariance: Square) -> None:
        self.design, self.observed, self.covariance = design, observed, covariance

    def linearise(self, parameters: Series) -> Linearisation:
        misclosure = (self.design @ parameters - self.observed)[None, :]
        active = np.ones(misclosure.shape, dtype=bool)
        return Linearisation(misclosure, self.design[None], self.covariance[None], None, active)

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Do nothing: the conditions are linear."""


def fit_placement_biases(
    observed: Vectors,
    covariance: Square,
    *,
    axes: Vectors,
    upward: Series,
    matrix: Matrix,
    sigma: Series,
    site: Site,
) -> PlacementBiases:
    """Return the bias from the placements' own.

    Parameters
    ----------
    observed, covariance : (placements, 3) raw, and over all of their elements.
    axes : (placements, 3) unit vectors that the table turned the unit about.
    upward : (placements,) cosine between axis and up, nan where it is not known.
    matrix : of the gyros, raw per rad/s.
    sigma : (placements,) rad, of each placement: a tilt shows a g-sensitivity other parts of gravity.
    site : latitude and gravity.

    Raises
    ------
    ConvergenceError
        If the covariance is not positive definite.
    """
    count = observed.shape[0]
    up = axes * np.nan_to_num(upward)[:, None]
    shown = axes @ matrix.T
    earth, covariance = _earth(shown, upward, covariance, site)
    flat = (observed - earth).ravel()
    same = np.tile(np.eye(3), (count, 1))
    spans = (
        np.all(np.isfinite(upward)) and np.linalg.matrix_rank(np.column_stack([np.ones(count), up]), 0.1) == 4
    )
    if not spans:
        return _without_sensitivity(flat, covariance, earth)
    # Row 3 c + i: bias i, then G[i, j] times the force along j.
    force = np.einsum("cj,ik->cikj", up * site.gravity, np.eye(3)).reshape(3 * count, 9)
    design = np.hstack([same, force])
    start = np.concatenate([flat.reshape(-1, 3).mean(axis=0), np.zeros(9)])
    fit = adjust(_LinearConditions(design, flat, covariance), start)
    covariance = covariance + _tilted(fit.parameters[3:].reshape(3, 3) * site.gravity, up, sigma)
    fit = adjust(_LinearConditions(design, flat, covariance), fit.parameters)
    freedom = max(fit.redundancy, 1)
    scale = max(1.0, fit.sigma0**2) if fit.redundancy > 0 else 1.0
    spread = fit.cofactor[3:, 3:] * scale
    test = wald_test("g_sensitivity", fit.parameters[3:], spread, freedom, G_SENSITIVITY_FALSE_ALARM)
    if not test.kept:
        return replace(_without_sensitivity(flat, covariance, earth, told=True), test=test)
    largest = two_digits(
        float(np.degrees(np.max(np.abs(inverted(matrix) @ fit.parameters[3:].reshape(3, 3)))) * 9.80665)
    )
    remark = (
        f"The gyros have a g-sensitivity of up to {largest}°/s per g, determined by placements up and "
        "down. The bias is that without gravity. The correction of rates alone cannot take it out: "
        "that needs the accelerometers' calibration too (hand-held, modified-multi-position)."
    )
    return PlacementBiases(
        bias=fit.parameters[:3],
        covariance=fit.cofactor[:3, :3] * scale,
        weights=_weights(fit, design)[:3],
        beside=earth + (force @ fit.parameters[3:]).reshape(-1, 3),
        g_sensitivity=fit.parameters[3:].reshape(3, 3),
        g_sensitivity_covariance=spread,
        test=test,
        remarks=[remark],
    )


def _earth(shown: Vectors, upward: Series, covariance: Square, site: Site) -> tuple[Vectors, Square]:
    """Return the Earth rate along the axes, raw, and the covariance with what is not known of it."""
    cosine = np.nan_to_num(upward)
    level = np.sqrt(np.clip(1.0 - cosine**2, 0.0, 1.0))
    if site.latitude is None:
        common = (shown * cosine[:, None]).ravel() * EARTH_RATE / np.sqrt(3.0)
        covariance = covariance + np.outer(common, common)
        earth, unknown = np.zeros_like(shown), EARTH_RATE * level / np.sqrt(3.0)
    else:
        earth = shown * (cosine * EARTH_RATE * np.sin(site.latitude))[:, None]
        # An axis that is not plumb sees the horizontal part by its heading.
        unknown = EARTH_RATE * level * np.cos(site.latitude) / np.sqrt(2.0)
    unknown[~np.isfinite(upward)] = EARTH_RATE / np.sqrt(3.0)
    covariance = covariance.copy()
    for c in range(shown.shape[0]):
        at = slice(3 * c, 3 * c + 3)
        covariance[at, at] += np.outer(shown[c], shown[c]) * unknown[c] ** 2
    return earth, covariance


def _tilted(per_up: Matrix, up: Vectors, sigma: Series) -> Square:
    """Return the covariance of what tilts of the placements change in the effect of gravity."""
    covariance = np.zeros((3 * sigma.size, 3 * sigma.size))
    for c in range(sigma.size):
        across = np.eye(3) * (up[c] @ up[c]) - np.outer(up[c], up[c])
        covariance[3 * c : 3 * c + 3, 3 * c : 3 * c + 3] = sigma[c] ** 2 * (per_up @ across @ per_up.T)
    return covariance


def _without_sensitivity(
    flat: Series, covariance: Square, earth: Vectors, *, told: bool = False
) -> PlacementBiases:
    """Return the mean over the placements; a scatter that chance does not explain counts in full."""
    design = np.tile(np.eye(3), (earth.shape[0], 1))
    start = flat.reshape(-1, 3).mean(axis=0)

    def solve(scatter: float) -> Adjustment:
        return adjust(_LinearConditions(design, flat, covariance + scatter**2 * np.eye(flat.size)), start)

    plain, scatter = solve(0.0), 0.0
    if is_excessive(plain.square_sum, plain.redundancy):
        size = float(np.max(np.ptp(flat.reshape(-1, 3), axis=0)))
        scatter = find_added_sigma(
            lambda added: solve(added).square_sum, plain.redundancy, 1e-6 * size, 10.0 * size
        )
        plain = solve(scatter)
    missing = (
        "The gyros' g-sensitivity is in the bias: gravity lay along the table's axis in all spins, "
        "and the placements do not separate the two. Place each axis up and down."
    )
    remark = (
        f"From placement to placement the bias scatters by {scatter:.2g} (raw units) beyond the noise "
        "(g-sensitivity, or a bias that wanders); its uncertainty includes it."
    )
    return PlacementBiases(
        bias=plain.parameters,
        covariance=plain.cofactor,
        weights=_weights(plain, design),
        beside=earth,
        remarks=[remark] if scatter > 0.0 else [],
        not_determined=[] if told else [missing],
    )


def _weights(fit: Adjustment, design: Table) -> Table:
    """Return what the observations are multiplied with: N^-1 A' C^-1."""
    return fit.cofactor @ design.T @ inverted(fit.linearisation.covariance[0])
