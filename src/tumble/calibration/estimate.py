"""What a procedure hands over: the model, its covariance, and everything that a report needs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tumble.arrays import Matrix, Series, Square, Table, Vector, Vectors
from tumble.calibration.thermal.evidence import ThermalEvidence
from tumble.calibration.uncertainty_statement import UncertaintyStatement
from tumble.sensor import ImuModel
from tumble.sensor.thermal import ThermalModel


@dataclass(frozen=True, slots=True)
class NamedValue:
    """One parameter in the procedure's own convention, SI or raw units as `unit` says."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A hold, a turn or a spin that took no part, with the reason as a sentence."""

    kind: str
    index: int
    reason: str


@dataclass(frozen=True, slots=True)
class RestlessHold:
    """A hold that sways more than the others.

    Attributes
    ----------
    hold : its index.
    start, stop : s from the recording's first sample.
    sway, others : rad about each axis, one sigma, from its start to its middle and from there to its end: its own,
        and what the others sway by.
    """

    hold: int
    start: float
    stop: float
    sway: float
    others: float


@dataclass(frozen=True, slots=True)
class TermTest:
    """The test of an optional term: kept if `probability` (of chance) is below `limit`."""

    name: str
    kept: bool
    statistic: float
    degrees: int
    probability: float
    limit: float
    largest: str


@dataclass(frozen=True, slots=True)
class TurnedAngle:
    """One rotation of a table: its display's angle, and what the calibrated gyros made of it.

    Attributes
    ----------
    spin : index into the estimate's spins.
    angle : rad, the table's, with its sign.
    residual, sigma : rad, gyros minus table about the common axis, and its standard deviation.
    seconds : s that it took.
    from_rest : whether it is from rest to rest; if not, at the constant rate.
    """

    spin: int
    angle: float
    residual: float
    sigma: float
    seconds: float
    from_rest: bool


@dataclass(frozen=True, slots=True)
class RotationFit:
    """Rotations both ways about one axis, as both triads saw it.

    Attributes
    ----------
    name : the axis in words.
    axis_b : (3,) unit vector in b, as the calibrated gyros show it.
    inclination : rad, of the axis against the vertical, 0 to pi / 2.
    missed, missed_sigma : rad, angle between the axes of both triads after calibration, and the standard
        deviation of each of its two components; NaN where the accelerometers do not tell it.
    plane_residual : m/s², rms distance of the specific forces from their plane.
    angles : of each rotation.
    why : why it takes no part in the inter-triad angles; empty if it does.
    """

    name: str
    axis_b: Vector
    inclination: float
    missed: float
    missed_sigma: float
    plane_residual: float
    angles: tuple[TurnedAngle, ...]
    why: str = ""


@dataclass(frozen=True, slots=True)
class SequenceFit:
    """A rotation sequence and what the solution leaves of its measurements.

    Attributes
    ----------
    name : as table 1 has it, or the protocol.
    rotations : (axis, angle in rad) one after another.
    residuals, sigmas : (4,) m/s²: two horizontal components, down at the start and at the end.
    seconds : s that it took, measurements included.
    """

    name: str
    rotations: tuple[tuple[int, float], ...]
    residuals: tuple[float, ...]
    sigmas: tuple[float, ...]
    seconds: float


@dataclass(slots=True)
class Estimate:
    """The outcome of a procedure, before it becomes a document.

    Of a gyro calibrated without the accelerometers (`model.accelerometer` is None) the arrays of holds
    and turns are empty.

    Attributes
    ----------
    procedure : its name.
    model : the triads, in the frame `frame`.
    names, covariance : canonical parameters (entries of matrix and bias, raw units) and (n, n).
    parameters : the same knowledge in the procedure's own convention.
    sigma0 : square root of the variance of unit weight against the noise seen at rest alone.
    sigma0_final : the same with the variance components; about 1.
    degrees_of_freedom : conditions minus unknowns.
    coverage_factor : for 95 %.
    variance_components : name -> standard deviation, SI.
    hold_norms : (holds,) corrected norm minus gravity, m/s².
    hold_sigmas : (holds,) what it is expected to be (root mean square), m/s².
    turn_angles, turn_sigmas : (holds,) rad, of the turn after each hold; nan where there is none.
    turn_sizes : (holds,) how far the turn went, rad.
    left_out : holds and turns without part in the estimate.
    restless : holds that sway more than the others, and count for less.
    terms : tests of optional terms.
    not_determined : sentences.
    remarks : sentences on how the estimate was made.
    objections : sentences that make it unfit for use, whatever its numbers say.
    cautions : sentences that stand first in the verdict of what is fit: what its use depends on.
    spin_rates : (spins,) rad/s, the reference rate of each spin with its sign; empty without spins.
    spin_residuals, spin_sigmas : (spins, 3) rad/s, what each gyro shows beyond the model, and its sigma.
    spin_names : what each spin is, in words.
    rotations : what a table's rotations showed, an axis each.
    sequences : what rotation sequences showed.
    passes : what each play-back of a recording changed, rms by group of errors, SI.
    budget : what each source adds to the standard uncertainties of `parameters`, in their order and units.
    statement : tests, degrees of freedom, reliability and what is not included, where the procedure tells them.
    beside : what another procedure made of the same recording, for comparison.
    frame : which body frame the model is in: ``accelerometer-x``, or ``fixture`` for a procedure that
        knows the poses, and has the axes of the fixture in them.
    thermal : how the triads change with temperature, about `model`; None if that was not asked for.
    thermal_names, thermal_covariance : of its parameters (`ThermalModel.names`) and (n, n).
    thermal_evidence : what it was made of, for the report.
    lever_arms : (3, 3) m in `frame`, where each accelerometer sits; None where they are taken to be at one place.
    """

    procedure: str
    model: ImuModel
    names: list[str]
    covariance: Square
    parameters: list[NamedValue]
    correlations: Table
    sigma0: float
    sigma0_final: float
    degrees_of_freedom: int
    coverage_factor: float
    largest_normalised: float
    hold_norms: Series
    hold_sigmas: Series
    turn_angles: Series
    turn_sigmas: Series
    turn_sizes: Series
    variance_components: dict[str, float] = field(default_factory=dict[str, float])
    left_out: list[LeftOut] = field(default_factory=list[LeftOut])
    restless: list[RestlessHold] = field(default_factory=list[RestlessHold])
    terms: list[TermTest] = field(default_factory=list[TermTest])
    not_determined: list[str] = field(default_factory=list[str])
    remarks: list[str] = field(default_factory=list[str])
    objections: list[str] = field(default_factory=list[str])
    cautions: list[str] = field(default_factory=list[str])
    spin_rates: Series = field(default_factory=lambda: np.zeros(0))
    spin_residuals: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    spin_sigmas: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    spin_names: list[str] = field(default_factory=list[str])
    rotations: list[RotationFit] = field(default_factory=list[RotationFit])
    budget: dict[str, Series] = field(default_factory=dict[str, Series])
    sequences: list[SequenceFit] = field(default_factory=list[SequenceFit])
    passes: list[dict[str, float]] = field(default_factory=list[dict[str, float]])
    statement: UncertaintyStatement | None = None
    beside: Estimate | None = None
    frame: str = "accelerometer-x"
    thermal: ThermalModel | None = None
    thermal_names: list[str] = field(default_factory=list[str])
    thermal_covariance: Table = field(default_factory=lambda: np.zeros((0, 0)))
    thermal_evidence: ThermalEvidence | None = None
    lever_arms: Matrix | None = None


def coverage_factor(degrees_of_freedom: int) -> float:
    """Return Student's factor for 95 % coverage (GUM G.3), 1.96 for many degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(max(degrees_of_freedom, 1), 0.975))


def correlation_matrix(covariance: Square) -> Table:
    """Return the correlations of a covariance; rows of parameters without variance are zero."""
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0)
    return covariance * np.outer(inverse, inverse)
