"""The calibration of a magnetometer: its triad with covariance, the field of the place, a verdict and the evidence.

With holds it is part of the one joint adjustment: poses that accelerometers and gyros tell, with all that is uncertain
of them. Without, it is the ellipsoid of its own numbers, and how its axes lie against the other triads stays open.
"""

from __future__ import annotations

from dataclasses import field, replace
from itertools import permutations, product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Series, Square, Table, Vector, Vectors, inverted
from tumble.attitude import analytic_rotation_vector
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.estimate import LeftOut, NamedValue, coverage_factor
from tumble.calibration.evidence import Evidence
from tumble.calibration.magnetometer.field_equations import (
    BIAS,
    DIP,
    FIELD,
    FIELD_NOISE,
    MATRIX,
    FieldAdjustment,
    FieldSeen,
    Moving,
    field_means,
    field_of_holds,
    find_moving,
    magnetometer_matrix,
    start_field,
    with_change,
)
from tumble.calibration.outcome.description import rotation_of_frame
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import balance
from tumble.parameters import FAMILIES
from tumble.recording import MagneticField, limits_reached
from tumble.records import dataclass
from tumble.segmentation import converter_step
from tumble.sensor import Triad, polar_rotation, propagate
from tumble.units import magnetic_field_factor

if TYPE_CHECKING:
    from tumble.calibration.outcome.settled import JointOutcome


# Samples beyond so many robust sigmas count for nothing; so many rounds.
CUT, ROUNDS, ITERATIONS = 5.0, 6, 50
# More samples than these add nothing but time: the field at neighbouring ones is the same.
LARGEST_SAMPLES = 20_000
FEWEST_SAMPLES = 30
# Lags of the residuals' correlation that are looked at, as a share of the samples.
LARGEST_LAG = 0.2
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Ellipsoid:
    """The ellipsoid of a magnetometer that was turned about.

    Attributes
    ----------
    shape : (3, 3) symmetric S, 1 / raw unit: ``S (raw - centre)`` has the norm 1.
    centre : (3,) raw.
    covariance : (9, 9) of S's entries 00, 11, 22, 01, 02, 12 and the centre, widened by what neighbours share.
    scatter : of the norm, a share, one sigma: of all samples, robustly.
    noise : of the norm that neighbouring samples differ by.
    correlated : how many samples are worth one.
    left_out : share of the samples that contradict the others.
    samples : how many were used.
    gap : rad, half-angle of the largest cap of directions without a sample.
    """

    shape: Matrix
    centre: Vector
    covariance: Square
    scatter: float
    noise: float
    correlated: float
    left_out: float
    samples: int
    gap: float


def fit_ellipsoid(values: Vectors) -> Ellipsoid:
    """Return the ellipsoid that raw numbers lie on, by maximum likelihood.

    Parameters
    ----------
    values : (samples, 3) raw, in order of time; rows that are not finite are left out.

    Raises
    ------
    ObservabilityError
        If the samples are too few, do not change, or show no ellipsoid.

    Notes
    -----
    Each residual is the distance from the ellipsoid to first order, ``(|y| - 1) / |S y| |y|`` with ``y = S (r - h)``,
    which weighs noise that is alike in all directions as it should. Residuals of neighbours share what the field does
    from place to place: the covariance is widened by the time that their correlation lasts.
    """
    values = np.asarray(values[np.all(np.isfinite(values), axis=1)], dtype=np.float64)
    every = max(1, len(values) // LARGEST_SAMPLES)
    values = values[::every]
    if len(values) < FEWEST_SAMPLES:
        raise ObservabilityError(
            f"The magnetometer has {len(values)} samples: turn the unit slowly about all axes for a minute."
        )
    if constant := [axis for axis, channel in zip("xyz", values.T, strict=True) if np.ptp(channel) == 0.0]:
        raise ObservabilityError(f"Its {', '.join(constant)} never changes: a dead sensor or a wrong column.")
    centre: Vector = np.mean(values, axis=0)
    away: Vectors = values - centre
    size = float(np.linalg.norm(away)) / float(np.sqrt(away.size))
    scaled: Vectors = away / size
    taken = np.ones(len(scaled), dtype=bool)
    x = _algebraic(scaled)
    for _ in range(ROUNDS):
        x = _settle(scaled[taken], x)
        off = _residuals(scaled, x)[0]
        sigma = 1.4826 * float(np.median(np.abs(off[taken]))) + 1e-12
        now = np.abs(off) < CUT * sigma
        if np.array_equal(now, taken):
            break
        taken = now
    off, by, y = _residuals(scaled[taken], x)
    norms: Series = np.sqrt(np.sum(y**2, axis=1))
    scatter = float(np.sqrt(np.sum((norms - float(np.mean(norms))) ** 2) / norms.size))
    radius = float(np.median(1.0 / np.linalg.norm(y @ symmetric(x), axis=1)))
    step = float(np.max(converter_step(values))) / size
    variance = max(float(off @ off) / max(len(off) - 9, 1), step**2 / 12.0)
    correlated = _correlated(off)
    normal = by.T @ by
    if np.linalg.cond(normal) > 1e14:
        raise ObservabilityError(
            "The directions of the field do not show an ellipsoid: turn about other axes, too."
        )
    covariance = variance * correlated * inverted(normal)
    scale = np.concatenate([np.full(6, 1.0 / size), np.full(3, size)])
    neighbours = np.diff(off)
    return Ellipsoid(
        symmetric(x) / size,
        centre + size * x[6:],
        covariance * np.outer(scale, scale),
        scatter,
        float(np.sqrt(0.5 * np.mean(neighbours**2))) / max(radius, 1e-300),
        correlated,
        1.0 - float(np.mean(taken)),
        int(taken.sum()),
        _largest_gap(y / norms[:, None]),
    )


def symmetric(x: Complex) -> Complex:
    """Return the symmetric matrix of entries 00, 11, 22, 01, 02, 12, analytic."""
    return np.array([[x[0], x[3], x[4]], [x[3], x[1], x[5]], [x[4], x[5], x[2]]])


def entries_of(shape: Matrix) -> Series:
    """Return the entries 00, 11, 22, 01, 02, 12 of a symmetric matrix."""
    return np.array([shape[i, j] for i, j in _PAIRS])


def _algebraic(values: Vectors) -> Series:
    """Start from the quadric of least algebraic distance."""
    v = values
    design = np.column_stack(
        [v**2, 2 * v[:, 0] * v[:, 1], 2 * v[:, 0] * v[:, 2], 2 * v[:, 1] * v[:, 2], 2 * v]
    )
    q, *_ = np.linalg.lstsq(design, np.ones(len(v)), rcond=None)
    Q = symmetric(q)
    none = ObservabilityError(
        "The magnetometer's numbers do not lie on an ellipsoid: turn the unit about all axes, away from iron, and "
        "look whether the columns are those of a magnetometer."
    )
    try:
        centre: Vector = np.asarray(-np.linalg.solve(Q, q[6:]), dtype=np.float64)
        values_, vectors = np.linalg.eigh(Q / (1.0 + centre @ Q @ centre))
    except np.linalg.LinAlgError:
        raise none from None
    if not np.all(values_ > 0.0):
        raise none
    S = (vectors * np.sqrt(values_)) @ vectors.T
    return np.concatenate([entries_of(S), centre])


def _residuals(values: Vectors, x: Series) -> tuple[Series, np.ndarray, Vectors]:
    """Distances (samples,), their derivatives (samples, 9), and the corrected field (samples, 3)."""
    S, h = symmetric(x), x[6:]
    away = values - h
    y = away @ S
    norm = np.linalg.norm(y, axis=1)
    unit = y / norm[:, None]
    slope = unit @ S
    steep = np.linalg.norm(slope, axis=1)
    by = np.empty((len(values), 9))
    for at, (i, j) in enumerate(_PAIRS):
        by[:, at] = unit[:, i] * away[:, j] + (unit[:, j] * away[:, i] if i != j else 0.0)
    by[:, 6:] = -slope
    return (norm - 1.0) / steep, by / steep[:, None], y


def _settle(values: Vectors, x: Series) -> Series:
    off, by, _ = _residuals(values, x)
    damping = 0.0
    for _ in range(ITERATIONS):
        normal = by.T @ by
        step = -np.linalg.lstsq(normal + damping * np.diag(np.diag(normal)), by.T @ off, rcond=None)[0]
        moved = x + step
        made = _residuals(values, moved)
        if np.all(np.linalg.eigvalsh(symmetric(moved)) > 0.0) and made[0] @ made[0] <= off @ off * (
            1 + 1e-12
        ):
            small = bool(np.max(np.abs(step)) < 1e-10)
            x, (off, by, _), damping = moved, made, 0.1 * damping
            if small:
                return x
        elif damping > 1e6:
            return x
        else:
            damping = max(10.0 * damping, 1e-4)
    return x


def _correlated(off: Series) -> float:
    """How many residuals one after the other are worth one: twice the sum of their correlations, and one."""
    count = len(off)
    length = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(off - off.mean(), length)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, length)[: max(2, int(LARGEST_LAG * count))]
    if not correlation[0] > 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    # Of pairs of lags the sum stays positive where it is no noise (Geyer's initial positive sequence).
    pairs = correlation[: correlation.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    last = np.flatnonzero(pairs <= 0.0)
    used = pairs[: last[0]] if last.size else pairs
    return max(1.0, 2.0 * float(used.sum()) - 1.0)


def _largest_gap(directions: Vectors) -> float:
    """Return the half-angle, rad, of the largest cap of directions that nothing lies in."""
    count = 500
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    cells = np.column_stack([across * np.cos(turn), across * np.sin(turn), z])
    thinned = directions[:: max(1, len(directions) // 4000)]
    nearest = np.max(cells @ thinned.T, axis=1)
    return float(np.arccos(np.clip(nearest.min(), -1.0, 1.0)))


Complex = npt.NDArray[Any]
Method = Literal["holds and turns", "holds", "ellipsoid"]
LOCAL = "local field"
"""Unit of a corrected field whose norm nobody knows: the field of the place where it was calibrated."""
TESLA = "T"
# An entry of the matrix (of its mean scale) or a bias (of the field) that is less certain is not determined.
DETERMINED = 0.05
# Data sheets promise the mean scale of three magnetometers to so much, one sigma, where nobody gives the norm.
NAME_PLATE = 0.05
# Of a field that is given without its own uncertainty, share of its norm and so rad of its dip: a model of the Earth's
# field knows it to 0.3 %, and buildings and cars change it by more.
GIVEN_SIGMA = 0.01
# Sigmas from which on the dip that is found contradicts the one that is given.
CONTRADICTS = 3.0
NAMES = (
    *(f"magnetometer.matrix[{i},{j}]" for i in range(3) for j in range(3)),
    *(f"magnetometer.bias[{i}]" for i in range(3)),
)
"""Of what the covariance of a magnetometer is whose axes are known against the other triads."""
# Of one that is not: its matrix is symmetric, and so many entries of it are unknowns.
NAMES_ALONE = tuple(NAMES[i] for i in (0, 4, 8, 1, 2, 5, 9, 10, 11))
"""Of what it is where the matrix is taken as symmetric, for nothing tells the axes."""


@dataclass(frozen=True)
class GivenField:
    """The Earth's field at the site as it is given.

    Attributes
    ----------
    norm, norm_sigma : T, and its standard uncertainty.
    dip : rad, down positive; None if it is not given.
    source : where that is from, in words.
    dip_sigma : rad, standard uncertainty of the dip.
    """

    norm: float
    norm_sigma: float
    dip: float | None = None
    source: str = "as given"
    dip_sigma: float = GIVEN_SIGMA

    def off(self, dip: float, sigma: float) -> float:
        """Return by how much a dip that was found differs from this one, rad; zero within three sigmas or unknown.

        Parameters
        ----------
        dip, sigma : rad, as found; NaN where nothing tells it.
        """
        if self.dip is None or not abs(dip - self.dip) > CONTRADICTS * np.hypot(sigma, self.dip_sigma):
            return 0.0
        return float(dip - self.dip)


@dataclass(frozen=True)
class FieldHold:
    """The corrected field of a hold.

    Attributes
    ----------
    hold : its index.
    time : s, its middle on the recording's axis.
    norm : in the unit of the result.
    dip : rad.
    left_out : whether it takes no part.
    """

    hold: int
    time: float
    norm: float
    dip: float
    left_out: bool


@dataclass(frozen=True)
class Magnetometer(Evidence):
    """What a recording tells of its magnetometer.

    Attributes
    ----------
    method : "holds and turns", "holds" (without a gyro) or "ellipsoid" (the magnetometer alone).
    triad : raw units per unit of the field, in the frame of the result; None where it is not determined.
    frame : of the result; "magnetometer" where how the axes lie against the other triads is not determined.
    names, covariance : `NAMES` or `NAMES_ALONE`, and the covariance of these.
    parameters : with standard uncertainties, raw units and rad.
    coverage_factor : for 95 %.
    raw_unit, field_unit : of what goes in and comes out; `LOCAL` where nobody knows the norm.
    norm, norm_sigma : of the field, in its unit.
    norm_known : whether the norm is from outside: if not, all scale factors have one factor in common that is none of
        this recording.
    dip, dip_sigma : rad; NaN where nothing tells it.
    scatter : by which the field differs from hold to hold (or between directions), a share of its norm, one sigma.
    uncertainty : share of the norm that a corrected field is off by, root mean square over directions, one sigma.
    before, after : scatter of the norm over all samples before and after correction, shares.
    holds : of each.
    left_out : with reasons.
    moving : a change of the field; None for none.
    ellipsoid : of all samples by themselves; None where they show none.
    degrees_of_freedom : redundant observations of the field.
    not_determined : sentences.
    saturated : channels that stick at a limit, in words.
    """

    method: Method
    triad: Triad | None
    frame: str
    names: tuple[str, ...]
    covariance: Square
    parameters: tuple[NamedValue, ...]
    coverage_factor: float
    raw_unit: str
    field_unit: str
    norm: float
    norm_sigma: float
    norm_known: bool
    dip: float = np.nan
    dip_sigma: float = np.nan
    scatter: float = 0.0
    uncertainty: float = np.nan
    before: float = np.nan
    after: float = np.nan
    holds: tuple[FieldHold, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    moving: Moving | None = None
    ellipsoid: Ellipsoid | None = None
    degrees_of_freedom: int = 0
    given: GivenField | None = None
    not_determined: tuple[str, ...] = field(default=())
    saturated: tuple[str, ...] = ()


def magnetometer_from_holds(
    outcome: JointOutcome, magnetic: MagneticField, given: GivenField | None = None
) -> Magnetometer:
    """Return what holds and turns tell of a magnetometer, in one adjustment with both other triads.

    Parameters
    ----------
    outcome : the settled joint estimate of the other triads, whose noise and outliers are kept.
    magnetic : the magnetometer's samples.
    given : the field at the site, where it is known.

    Raises
    ------
    ObservabilityError, ConvergenceError
        If the holds do not determine it; the message says what is missing.
    """
    seen = field_means(magnetic.time, magnetic.values, outcome.data.base)
    task = FieldAdjustment.of(outcome.task, seen)
    start_field(task)
    whole, balanced = task.copy(), balance(task)
    moving = find_moving(task)
    if moving is not None:
        # With the change among the unknowns, and everything else as it was before.
        task = with_change(whole, moving)
        balanced = balance(task)
    solution, u = balanced.solution, task.unknowns
    tests = solution.tests()[FIELD]
    redundancy = float(tests.redundancy.sum())
    weight = max(1.0, float(tests.square.sum()) / max(redundancy, 1e-9)) if redundancy > 0 else 1.0
    told, at = LAYOUT.size + len(NAMES), u.places([DIP])
    dip, dip_sigma = float(u[DIP][0]), float(np.sqrt(weight * solution.cofactor[at, at][0]))
    off = 0.0 if given is None else given.off(dip, dip_sigma)
    scale = _Scale(magnetic_field_factor(magnetic.unit), given, off)
    spread = weight * u.expanded(solution.cofactor)[:told, :told]
    norm = float(scale.norm_of(magnetometer_matrix(u)))
    numbers, covariance = propagate(_in_frame(outcome.frame, scale), u.values[:told], spread)
    weak = u.layout.indices(MATRIX, BIAS)[_shares(numbers, covariance, norm) > DETERMINED].tolist()
    kind, why = FieldSeen.words
    said = [why.format(times=f"{o.normalised:.1f} times what the others show") for o in balanced.outliers]
    return _described(
        (numbers, covariance),
        norm,
        redundancy,
        scale,
        magnetic,
        determined=not weak,
        method="holds and turns" if outcome.has_gyro else "holds",
        frame=outcome.frame,
        names=NAMES,
        dip=dip,
        dip_sigma=dip_sigma,
        scatter=float(np.sqrt(task.noise[FIELD_NOISE])),
        holds=_holds(task, norm),
        left_out=tuple(LeftOut(kind, o.group, of) for o, of in zip(balanced.outliers, said, strict=True)),
        moving=moving,
        not_determined=tuple(
            f"The {u.layout.label(i)} is not determined: {u.layout.remedy(i)} would determine it."
            for i in weak
        ),
    )


def _holds(task: FieldAdjustment, norm: float) -> tuple[FieldHold, ...]:
    seen, active = task.seen, task.taking_part[FIELD]
    return tuple(
        FieldHold(k, float(time), float(size * norm), float(dip), not bool(active[k]))
        for k, (time, size, dip) in enumerate(zip(seen.time, *field_of_holds(task), strict=True))
        if seen.seen[k]
    )


def _in_frame(frame: str, scale: _Scale) -> Any:
    """From all unknowns to matrix and bias in the frame and unit of the result, analytic."""

    def evaluate(x: Complex) -> Complex:
        imu, matrix = x[: LAYOUT.size], x[LAYOUT.size : LAYOUT.size + 9].reshape(3, 3)
        turned = matrix @ rotation_of_frame(imu, frame) / scale.norm_of(matrix)
        return np.concatenate([turned.ravel(), x[LAYOUT.size + 9 :]])

    return evaluate


@dataclass(frozen=True)
class _Scale:
    """How the norm of the field is fixed: given, by the mean scale of the recording's unit, or as one.

    `off` is the angle by which the field here is bent against the given one: what bends it changes its norm as much.
    """

    factor: float | None
    given: GivenField | None
    off: float = 0.0

    def norm_of(self, matrix: Complex) -> Any:
        """The field's norm for a matrix in raw units per norm, analytic."""
        if self.given is not None:
            return self.given.norm
        return 1.0 if self.factor is None else np.linalg.det(matrix) ** (1.0 / 3.0) * self.factor

    @property
    def trusted(self) -> float:
        """Standard uncertainty of the norm as a share: as given, or of the mean scale that data sheets promise."""
        if self.given is not None:
            return float(np.hypot(self.given.norm_sigma / self.given.norm, self.off))
        return 0.0 if self.factor is None else NAME_PLATE


def _shares(numbers: Series, covariance: Square, norm: float) -> Series:
    """Return sigmas as shares of the mean scale, and of the field."""
    size = float(np.linalg.norm(numbers[:9])) / np.sqrt(3.0)
    return np.sqrt(np.diag(covariance)) / np.concatenate([np.full(9, size), np.full(3, size * norm)])


def _described(
    estimated: tuple[Series, Square],
    norm: float,
    redundancy: float,
    scale: _Scale,
    magnetic: MagneticField,
    *,
    determined: bool,
    names: tuple[str, ...],
    ellipsoid: Ellipsoid | None = None,
    **found: Any,
) -> Magnetometer:
    """Return a magnetometer of its twelve numbers with a covariance of themselves, and what all samples show."""
    numbers, own = estimated
    # A norm that is wrong makes all scale factors wrong alike.
    along = np.concatenate([numbers[:9], np.zeros(3)])
    covariance = own + scale.trusted**2 * np.outer(along, along)
    triad = Triad(numbers[:9].reshape(3, 3), numbers[9:12]) if determined else None
    unit = LOCAL if scale.given is None and scale.factor is None else TESLA
    at = [NAMES.index(name) for name in names]
    after = np.nan if triad is None else _scatter(triad.correct(magnetic.values))
    try:
        ellipsoid = ellipsoid or fit_ellipsoid(magnetic.values)
    except ObservabilityError:
        ellipsoid = None
    return Magnetometer(
        triad=triad,
        names=names,
        covariance=covariance[np.ix_(at, at)],
        parameters=tuple(named_parameters(numbers, covariance, magnetic.unit, unit, turned=names == NAMES)),
        coverage_factor=coverage_factor(max(round(redundancy), 1)),
        raw_unit=magnetic.unit,
        field_unit=unit,
        norm=norm,
        norm_sigma=norm * scale.trusted,
        norm_known=scale.given is not None,
        uncertainty=_uncertainty(numbers, own, norm),
        before=_scatter(magnetic.values),
        after=after,
        ellipsoid=ellipsoid,
        degrees_of_freedom=max(int(redundancy), 0),
        given=scale.given,
        saturated=tuple(
            f"{one.channel} at {one.value:g} {magnetic.unit} in {one.samples} samples"
            for one in limits_reached(magnetic.values)
        ),
        **found,
    )


def _uncertainty(numbers: Series, covariance: Square, norm: float) -> float:
    """Root mean square over all directions of a corrected field's error, one component, as a share of the norm."""
    inverse, total = np.linalg.inv(numbers[:9].reshape(3, 3)), 0.0
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        by_matrix: Table = np.asarray(np.kron(np.eye(3), norm * axis), dtype=np.float64)
        made = inverse @ np.concatenate([by_matrix, np.eye(3)], axis=1)
        total += float(np.trace(made @ covariance @ made.T)) / 3.0
    return float(np.sqrt(max(total, 0.0) / 6.0)) / norm


def _scatter(fields: Vectors) -> float:
    """Standard deviation of norms as a share of their mean."""
    norms: Series = np.sqrt(np.sum(fields**2, axis=1))
    mean = float(np.mean(norms))
    return float(np.std(norms)) / mean if mean > 0.0 else float("nan")


def magnetometer_alone(magnetic: MagneticField, given: GivenField | None = None) -> Magnetometer:
    """Return what a magnetometer that is turned about tells of itself.

    Parameters
    ----------
    magnetic : the samples.
    given : the field at the site, where it is known.

    Raises
    ------
    ObservabilityError
        If the samples show no ellipsoid.
    """
    fitted, scale = fit_ellipsoid(magnetic.values), _Scale(magnetic_field_factor(magnetic.unit), given)

    def evaluate(x: Complex) -> Complex:
        matrix = np.linalg.inv(symmetric(x))
        return np.concatenate([(matrix / scale.norm_of(matrix)).ravel(), x[6:]])

    x = np.concatenate([entries_of(fitted.shape), fitted.centre])
    numbers, covariance = propagate(evaluate, x, fitted.covariance)
    norm = float(scale.norm_of(np.linalg.inv(fitted.shape)))
    weak = bool(np.any(_shares(numbers, covariance, norm) > DETERMINED)) or fitted.gap > LARGEST_GAP
    said = (
        f"The magnetometer is not determined: no sample has the field within {np.degrees(fitted.gap):.0f}° of some "
        "direction. Turn the unit until each of its sides has pointed along the field and against it."
    )
    return _described(
        (numbers, covariance),
        norm,
        max(int((fitted.samples - 9) / fitted.correlated), 1),
        scale,
        magnetic,
        determined=not weak,
        method="ellipsoid",
        frame="magnetometer",
        names=NAMES_ALONE,
        scatter=float(np.sqrt(max(fitted.scatter**2 - fitted.noise**2, 0.0))),
        ellipsoid=fitted,
        not_determined=(said, TURNED) if weak else (TURNED,),
    )


TURNED = (
    "How the magnetometer's axes lie against the accelerometers' and gyros' is not determined by its norm alone. Hold "
    "the unit still in twelve or more attitudes: gravity and the turns between them show it."
)
LARGEST_GAP = np.radians(75.0)
"""Half-angle of a cap of directions without a sample beyond which an ellipsoid is not determined, however small its
stated uncertainty: what its shape is there, nothing checks."""


def magnetometer_of(
    outcome: JointOutcome | None, magnetic: MagneticField, given: GivenField | None = None
) -> Magnetometer:
    """Return what a recording tells of its magnetometer, by the holds if they serve, else by itself.

    Parameters
    ----------
    outcome : the settled joint estimate; None where there is none.
    magnetic, given : the samples, and the field at the site.

    Raises
    ------
    ObservabilityError
        If neither way tells anything.
    """
    why: tuple[str, ...] = ()
    if outcome is not None:
        try:
            return magnetometer_from_holds(outcome, magnetic, given)
        except (ObservabilityError, ConvergenceError) as error:
            why = (str(error),)
    alone = magnetometer_alone(magnetic, given)
    return replace(alone, not_determined=(*alone.not_determined, *why))


def named_parameters(
    numbers: Series, covariance: Square, raw_unit: str, field_unit: str, *, turned: bool = True
) -> list[NamedValue]:
    """Return bias, soft iron as a symmetric matrix, and the rotation from b to the magnetometer's own axes.

    The matrix is split as ``M = P R``: P symmetric (scale factors and soft iron), R the rotation from b to the sensor's
    own axes, of which the nearest turn by right angles is taken off.

    Parameters
    ----------
    numbers, covariance : (12,) matrix by rows and bias, and (12, 12).
    raw_unit, field_unit : of what goes in and of what comes out.
    turned : with the rotation, which a magnetometer alone does not tell.
    """
    nearest = nearest_axes(np.real(numbers[:9]).reshape(3, 3))

    def evaluate(x: Complex) -> Complex:
        matrix = x[:9].reshape(3, 3)
        turn = polar_rotation(matrix)
        soft = matrix @ turn.T
        parts = [x[9:12], np.diag(soft), np.array([soft[1, 2], soft[0, 2], soft[0, 1]])]
        if turned:
            parts.append(analytic_rotation_vector(turn @ nearest.T))
        return np.concatenate(parts)

    values, spread = propagate(evaluate, numbers, covariance)
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    per = f"{raw_unit}/({field_unit})"
    labels = FAMILIES["magnetometer bias"].labels(raw_unit)
    labels += FAMILIES["magnetometer scale factor"].labels(per)
    labels += FAMILIES["magnetometer soft iron"].labels(per)
    if turned:
        labels += FAMILIES["rotation of the magnetometer"].labels()
    return [
        NamedValue(name, float(v), float(s), unit)
        for (name, unit), v, s in zip(labels, values, sigmas, strict=True)
    ]


def nearest_axes(matrix: Matrix) -> Matrix:
    """Return the signed permutation that is nearest to a triad's own axes: rows are the axes of b along which they lie.

    Parameters
    ----------
    matrix : (3, 3) of a triad.
    """
    turn = np.real(polar_rotation(matrix))
    best, largest = np.eye(3), -np.inf
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        made = np.zeros((3, 3))
        made[range(3), order] = signs
        near = float(np.sum(made * turn))
        if near > largest and np.linalg.det(made) > 0.0:
            best, largest = made, near
    return best
