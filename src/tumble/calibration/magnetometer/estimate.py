"""The calibration of a magnetometer: its triad with covariance, the field of the place, a verdict and the evidence.

With holds it is part of the one joint adjustment: poses that accelerometers and gyros tell, with all that is uncertain
of them. Without, it is the ellipsoid of its own numbers, and how its axes lie against the other triads stays open.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Square
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.estimate import LeftOut, NamedValue, coverage_factor
from tumble.calibration.evidence import Evidence
from tumble.calibration.magnetometer.ellipsoid import Ellipsoid, fit_ellipsoid
from tumble.calibration.magnetometer.field_equations import (
    BIAS,
    DIP,
    FIELD,
    FIELD_NOISE,
    MATRIX,
    FieldAdjustment,
    FieldSeen,
    field_of_holds,
    magnetometer_matrix,
)
from tumble.calibration.magnetometer.field_means import field_means
from tumble.calibration.magnetometer.field_start import start_field
from tumble.calibration.magnetometer.moving import Moving, find_moving, with_change
from tumble.calibration.magnetometer.parameters import named_parameters
from tumble.calibration.outcome.description import rotation_of_frame
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation.balance import Balanced, balance
from tumble.recording.magnetic_field import MagneticField
from tumble.recording.saturation import limits_reached
from tumble.records import dataclass
from tumble.sensor import Triad, propagate
from tumble.units import magnetic_field_factor

if TYPE_CHECKING:
    from tumble.calibration.outcome.estimate import JointOutcome

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
_SYMMETRIC = (0, 4, 8, 1, 2, 5, 9, 10, 11)
NAMES_ALONE = tuple(NAMES[i] for i in _SYMMETRIC)
"""Of what it is where the matrix is taken as symmetric, for nothing tells the axes."""


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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
    task = FieldAdjustment.of(outcome.task, seen, 1.0)
    start_field(task)
    whole = task.copy()
    balanced = balance(task)
    moving = find_moving(task, balanced.solution)
    if moving is not None:
        # With the change among the unknowns, and everything else as it was before.
        task = with_change(whole, moving)
        balanced = balance(task)
    return _described(outcome, task, balanced, magnetic, given, moving)


def _described(
    outcome: JointOutcome,
    task: FieldAdjustment,
    balanced: Balanced,
    magnetic: MagneticField,
    given: GivenField | None,
    moving: Moving | None,
) -> Magnetometer:
    solution, u = balanced.solution, task.unknowns
    tests = solution.tests()[FIELD]
    redundancy = float(tests.redundancy.sum())
    weight = max(1.0, float(tests.square.sum()) / max(redundancy, 1e-9)) if redundancy > 0 else 1.0
    told = slice(0, LAYOUT.size + 12)
    spread = weight * u.expanded(solution.cofactor)[told, told]
    at = u.places([DIP])
    dip, dip_sigma = float(u[DIP][0]), float(np.sqrt(weight * solution.cofactor[at, at][0]))
    scale = _Scale.of(magnetic, given, 0.0 if given is None else given.off(dip, dip_sigma))
    numbers, covariance = propagate(_result(outcome.frame, scale), u.values[told], spread)
    covariance = covariance + scale.common(numbers)
    triad = Triad(numbers[:9].reshape(3, 3), numbers[9:12])
    norm = scale.norm_of(magnetometer_matrix(u))
    weak = _weak(numbers, covariance - scale.common(numbers), norm, task)
    norms, dips = field_of_holds(task)
    active = task.taking_part[FIELD]
    method: Method = "holds and turns" if outcome.has_gyro else "holds"
    made = Magnetometer(
        method=method,
        triad=None if weak else triad,
        frame=outcome.frame,
        names=NAMES,
        covariance=covariance,
        parameters=tuple(named_parameters(numbers, covariance, magnetic.unit, scale.unit)),
        coverage_factor=coverage_factor(max(round(redundancy), 1)),
        raw_unit=magnetic.unit,
        field_unit=scale.unit,
        norm=norm,
        norm_sigma=norm * scale.trusted,
        norm_known=given is not None,
        dip=dip,
        dip_sigma=dip_sigma,
        scatter=float(np.sqrt(task.noise[FIELD_NOISE])) / task.norm,
        uncertainty=_uncertainty(numbers, covariance - scale.common(numbers), norm),
        holds=tuple(
            FieldHold(k, float(seen), float(size * norm), float(dip), not bool(active[k]))
            for k, (seen, size, dip) in enumerate(zip(task.seen.time, norms, dips, strict=True))
            if task.seen.seen[k]
        ),
        left_out=tuple(
            LeftOut(*_said(o.group, f"{o.normalised:.1f} times what the others show"))
            for o in balanced.outliers
        ),
        moving=moving,
        degrees_of_freedom=max(int(redundancy), 0),
        given=given,
        not_determined=tuple(weak),
    )
    return with_samples(made, magnetic)


def _said(hold: int, times: str) -> tuple[str, int, str]:
    kind, why = FieldSeen.say(hold, times)
    return kind, hold, why


@dataclass(frozen=True, slots=True)
class _Scale:
    """How the norm of the field is fixed: given, by the mean scale of the recording's unit, or as one.

    `off` is the angle by which the field here is bent against the given one: what bends it changes its norm as much.
    """

    unit: str
    given: GivenField | None
    factor: float | None
    off: float

    @staticmethod
    def of(magnetic: MagneticField, given: GivenField | None, off: float = 0.0) -> _Scale:
        factor = magnetic_field_factor(magnetic.unit)
        return _Scale(LOCAL if given is None and factor is None else TESLA, given, factor, off)

    def norm_of(self, matrix: Complex) -> Any:
        """The field's norm for a matrix in raw units per norm, analytic."""
        if self.given is not None:
            return self.given.norm
        if self.factor is None:
            return 1.0
        return np.linalg.det(matrix) ** (1.0 / 3.0) * self.factor

    @property
    def trusted(self) -> float:
        """Standard uncertainty of the norm as a share: as given, or of the mean scale that data sheets promise."""
        if self.given is not None:
            return float(np.hypot(self.given.norm_sigma / self.given.norm, self.off))
        return 0.0 if self.factor is None else NAME_PLATE

    def common(self, numbers: Series) -> Square:
        """Covariance by which all scale factors are off alike with a norm that was given."""
        along = np.concatenate([numbers[:9], np.zeros(3)])
        return self.trusted**2 * np.outer(along, along)


def _result(frame: str, scale: _Scale) -> Any:
    """From all unknowns to matrix and bias in the frame and unit of the result, analytic."""

    def evaluate(x: Complex) -> Complex:
        own = x[LAYOUT.size : LAYOUT.size + 9].reshape(3, 3)
        matrix = own @ rotation_of_frame(x[: LAYOUT.size], frame) / scale.norm_of(own)
        return np.concatenate([matrix.ravel(), x[LAYOUT.size + 9 : LAYOUT.size + 12]])

    return evaluate


def _weak(numbers: Series, covariance: Square, norm: float, task: FieldAdjustment) -> list[str]:
    """What is not determined, in words."""
    size = float(np.linalg.norm(numbers[:9])) / np.sqrt(3.0)
    share = np.sqrt(np.diag(covariance)) / np.concatenate([np.full(9, size), np.full(3, size * norm)])
    layout = task.unknowns.layout
    at = layout.indices(MATRIX, BIAS)[share > DETERMINED]
    return [
        f"The {layout.label(int(i))} is not determined: {layout.remedy(int(i))} would determine it."
        for i in at
    ]


def _uncertainty(numbers: Series, covariance: Square, norm: float) -> float:
    """Root mean square over all directions of a corrected field's error, one component, as a share of the norm."""
    inverse = np.linalg.inv(numbers[:9].reshape(3, 3))
    total = 0.0
    axes: AnyArray = np.concatenate([np.eye(3), -np.eye(3)])
    for axis in axes:
        by = np.zeros((3, 12))
        for i in range(3):
            by[i, 3 * i : 3 * i + 3], by[i, 9 + i] = norm * axis, 1.0
        made = inverse @ by
        total += float(np.trace(made @ covariance @ made.T)) / 3.0
    return float(np.sqrt(max(total, 0.0) / len(axes))) / norm


def with_samples(made: Magnetometer, magnetic: MagneticField) -> Magnetometer:
    """Return it with what all samples show: how the norm scatters before and after, and their ellipsoid.

    Parameters
    ----------
    made, magnetic : what was found, and the samples.
    """
    raw = np.linalg.norm(magnetic.values, axis=1)
    before = _scatter(raw)
    after = np.nan
    if made.triad is not None:
        after = _scatter(np.linalg.norm(made.triad.correct(magnetic.values), axis=1))
    ellipsoid = made.ellipsoid
    if ellipsoid is None:
        try:
            ellipsoid = fit_ellipsoid(magnetic.values)
        except ObservabilityError:
            ellipsoid = None
    limits = tuple(
        f"{one.channel} at {one.value:g} {magnetic.unit} in {one.samples} samples"
        for one in limits_reached(magnetic.values)
    )
    return replace(made, before=before, after=after, ellipsoid=ellipsoid, saturated=limits)


def _scatter(norms: Series) -> float:
    """Standard deviation of norms as a share of their mean."""
    mean = float(np.mean(norms))
    return (
        float(np.linalg.norm(norms - mean)) / (mean * float(np.sqrt(norms.size)))
        if mean > 0.0
        else float("nan")
    )


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
    constant = [
        axis for axis, channel in zip("xyz", magnetic.values.T, strict=True) if np.ptp(channel) == 0.0
    ]
    if constant:
        raise ObservabilityError(f"Its {', '.join(constant)} never changes: a dead sensor or a wrong column.")
    fitted = fit_ellipsoid(magnetic.values)
    own = fitted.matrix
    scale = _Scale.of(magnetic, given)

    def evaluate(x: Complex) -> Complex:
        shape = np.array([[x[0], x[3], x[4]], [x[3], x[1], x[5]], [x[4], x[5], x[2]]])
        matrix = np.linalg.inv(shape)
        return np.concatenate([(matrix / scale.norm_of(matrix)).ravel(), x[6:9]])

    S = fitted.shape
    x = np.concatenate([[S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[0, 2], S[1, 2]], fitted.centre])
    numbers, covariance = propagate(evaluate, x, fitted.covariance)
    norm = float(scale.norm_of(own))
    size = float(np.linalg.norm(numbers[:9])) / np.sqrt(3.0)
    share = np.sqrt(np.diag(covariance)) / np.concatenate([np.full(9, size), np.full(3, size * norm)])
    weak = bool(np.any(share > DETERMINED)) or fitted.gap > LARGEST_GAP
    covariance = covariance + scale.common(numbers)
    said = [TURNED]
    if weak:
        said.insert(
            0,
            f"The magnetometer is not determined: no sample has the field within {np.degrees(fitted.gap):.0f}° of some "
            "direction. Turn the unit until each of its sides has pointed along the field and against it.",
        )
    freedom = max(int((fitted.samples - 9) / fitted.correlated), 1)
    made = Magnetometer(
        method="ellipsoid",
        triad=None if weak else Triad(numbers[:9].reshape(3, 3), numbers[9:12]),
        frame="magnetometer",
        names=NAMES_ALONE,
        covariance=covariance[np.ix_(_SYMMETRIC, _SYMMETRIC)],
        parameters=tuple(named_parameters(numbers, covariance, magnetic.unit, scale.unit, turned=False)),
        coverage_factor=coverage_factor(freedom),
        raw_unit=magnetic.unit,
        field_unit=scale.unit,
        norm=norm,
        norm_sigma=norm * scale.trusted,
        norm_known=given is not None,
        scatter=float(np.sqrt(max(fitted.scatter**2 - fitted.noise**2, 0.0))),
        uncertainty=_uncertainty(numbers, covariance - scale.common(numbers), norm),
        ellipsoid=fitted,
        degrees_of_freedom=freedom,
        given=given,
        not_determined=tuple(said),
    )
    return with_samples(made, magnetic)


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
    why = ""
    if outcome is not None:
        try:
            return magnetometer_from_holds(outcome, magnetic, given)
        except (ObservabilityError, ConvergenceError) as error:
            why = f"{error} "
    alone = magnetometer_alone(magnetic, given)
    return replace(alone, not_determined=(*alone.not_determined, *([why.strip()] if why else [])))
