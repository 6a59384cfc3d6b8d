"""What a procedure hands over: the model, its covariance, what is said of it, and the evidence behind it."""

from __future__ import annotations

from dataclasses import field
from typing import Literal, NamedTuple, TypeAlias, TypeVar

import numpy as np

from tumble.arrays import Matrix, Series, Square, Table
from tumble.calibration.evidence import Evidence, Holds, Spins, Turns
from tumble.records import dataclass
from tumble.sensor import ImuModel, ThermalModel

Kind: TypeAlias = Literal["remark", "caution", "objection", "not determined"]
_E = TypeVar("_E", bound=Evidence)


@dataclass(frozen=True)
class Said:
    """A sentence on an estimate.

    Attributes
    ----------
    kind : a "remark" on how it was made; a "caution", which stands first in the verdict of what is fit: what its use
        depends on; an "objection", which makes it unfit for use, whatever its numbers say; what is "not determined".
    text : the sentence.
    """

    kind: Kind
    text: str


@dataclass(frozen=True)
class NamedValue:
    """One parameter in the procedure's own convention, SI or raw units as `unit` says."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str


class Described(NamedTuple):
    """What was estimated as everybody else knows it, with covariance: the first fields of an `Estimate`."""

    model: ImuModel
    names: list[str]
    covariance: Table
    parameters: list[NamedValue]
    correlations: Table


@dataclass(frozen=True)
class LeftOut:
    """A hold, a turn or a spin that took no part, with the reason as a sentence."""

    kind: str
    index: int
    reason: str


@dataclass(frozen=True)
class TermTest:
    """The test of an optional term: kept if `probability` (of chance) is below `limit`, or if it was sought."""

    name: str
    kept: bool
    statistic: float
    degrees: int
    probability: float
    limit: float
    largest: str


def wald_test(name: str, estimates: Series, covariance: Square, freedom: int, limit: float) -> TermTest:
    """Test estimates of a term jointly against zero.

    Parameters
    ----------
    name : of the term.
    estimates, covariance : of its unknowns, from the fit that contains them.
    freedom : degrees of freedom of the noise level.
    limit : the term is kept if chance gives as large a statistic more rarely than this.

    Notes
    -----
    ``estimates' covariance^-1 estimates / n`` is F with n and `freedom` degrees of freedom if the term
    is not there. The covariance is scaled to correlations first: unknowns in counts and in radians
    differ by many powers of ten.
    """
    from scipy.special import fdtrc

    scale = np.sqrt(np.diag(covariance))
    normalised = estimates / scale
    correlation = covariance / np.outer(scale, scale)
    statistic = float(normalised @ np.linalg.solve(correlation, normalised)) / estimates.size
    probability = float(fdtrc(estimates.size, max(freedom, 1), statistic))
    largest = float(normalised[np.argmax(np.abs(normalised))])
    return TermTest(
        name=name,
        kept=probability < limit,
        statistic=statistic,
        degrees=estimates.size,
        probability=probability,
        limit=limit,
        largest=f"{largest:+.1f} sigma",
    )


class Figures(NamedTuple):
    """How well an adjustment fits: the next fields of an `Estimate`."""

    sigma0: float
    sigma0_final: float
    degrees_of_freedom: int
    coverage_factor: float
    largest_normalised: float
    variance_components: dict[str, float]


@dataclass(frozen=True)
class OverTemperature:
    """How the triads change with temperature, about the model at the reference temperature.

    Attributes
    ----------
    model : what is added to it.
    covariance : (n, n) of its parameters (`ThermalModel.names`).
    """

    model: ThermalModel
    covariance: Table


@dataclass(frozen=True)
class Unseen:
    """What all scale factors of a triad follow, and no residual shows.

    Attributes
    ----------
    source : as a budget of uncertainty names it.
    sigma : standard uncertainty of it, as a share.
    because : where that is from, as a clause.
    mend : what to do to know it better, as a clause.
    nominal_rate : Hz, where the sample rate is taken as that because nothing better is known.
    """

    source: str
    sigma: float
    because: str
    mend: str
    nominal_rate: float | None = None


@dataclass
class Estimate:
    """The outcome of a procedure, before it becomes a document.

    Attributes
    ----------
    procedure : its name.
    model : the triads, in the frame `frame`; without an accelerometer if the gyros were calibrated alone.
    names, covariance : canonical parameters (entries of matrix and bias, raw units) and (n, n).
    parameters, correlations : the same knowledge in the procedure's own convention.
    sigma0 : square root of the variance of unit weight against the noise seen at rest alone.
    sigma0_final : the same with the variance components; about 1.
    degrees_of_freedom : conditions minus unknowns.
    coverage_factor : for 95 %.
    largest_normalised : the largest residual, in its own standard deviations.
    variance_components : name -> standard deviation, SI.
    terms : tests of optional terms.
    left_out : holds, turns and spins without part in the estimate.
    said : sentences: how it was made, what speaks against it, what it does not determine.
    evidence : what it rests on, a record a kind.
    frame : which body frame the model is in: ``accelerometer-x``, ``mean-gyro``, or ``fixture`` for a procedure that
        knows the poses, and has the axes of the fixture in them.
    thermal : how the triads change with temperature; None if that was not asked for.
    lever_arms : (3, 3) m in `frame`, where each accelerometer sits; None where they are taken to be at one place.
    unseen : what all scale factors of a triad follow and no residual shows; it is in the covariance.
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
    variance_components: dict[str, float] = field(default_factory=dict[str, float])
    terms: list[TermTest] = field(default_factory=list[TermTest])
    left_out: list[LeftOut] = field(default_factory=list[LeftOut])
    said: list[Said] = field(default_factory=list[Said])
    evidence: list[Evidence] = field(default_factory=list[Evidence])
    frame: str = "accelerometer-x"
    thermal: OverTemperature | None = None
    lever_arms: Matrix | None = None
    unseen: list[Unseen] = field(default_factory=list[Unseen])

    def __repr__(self) -> str:
        return f"<Estimate: {self.procedure}, {len(self.parameters)} parameters, sigma0 {self.sigma0:.3g}>"

    def say(self, kind: Kind, *texts: str) -> None:
        """Add sentences of a kind."""
        self.said += [Said(kind, text) for text in texts]

    def sentences(self, kind: Kind) -> list[str]:
        """Return all sentences of a kind, in their order."""
        return [said.text for said in self.said if said.kind == kind]

    def show(self, *evidence: Evidence) -> None:
        """Add evidence; a record of the same kind gives way."""
        kinds = {type(one) for one in evidence}
        self.evidence = [*(one for one in self.evidence if type(one) not in kinds), *evidence]

    def shown(self, kind: type[_E]) -> _E | None:
        """Return the evidence of a kind; None where there is none."""
        return next((one for one in self.evidence if isinstance(one, kind)), None)

    @property
    def holds(self) -> Holds:
        """Evidence of holds; empty where there is none."""
        return self.shown(Holds) or Holds()

    @property
    def turns(self) -> Turns:
        """Evidence of turns; empty where there is none."""
        return self.shown(Turns) or Turns()

    @property
    def spins(self) -> Spins:
        """Evidence of spins; empty where there is none."""
        return self.shown(Spins) or Spins()

    @property
    def remarks(self) -> tuple[str, ...]:
        """How it was made."""
        return tuple(self.sentences("remark"))

    @property
    def cautions(self) -> tuple[str, ...]:
        """What its use depends on."""
        return tuple(self.sentences("caution"))

    @property
    def objections(self) -> tuple[str, ...]:
        """What makes it unfit for use."""
        return tuple(self.sentences("objection"))

    @property
    def not_determined(self) -> tuple[str, ...]:
        """What it does not determine."""
        return tuple(self.sentences("not determined"))


@dataclass(frozen=True)
class Beside(Evidence):
    """What a paper's own estimator made of the same recording, for comparison.

    Attributes
    ----------
    estimate : the paper's.
    source : the paper and its equations.
    """

    estimate: Estimate
    source: str


def coverage_factor(degrees_of_freedom: int) -> float:
    """Return Student's factor for 95 % coverage (GUM G.3), 1.96 for many degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(max(degrees_of_freedom, 1), 0.975))


def correlation_matrix(covariance: Square) -> Table:
    """Return the correlations of a covariance; rows of parameters without variance are zero."""
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0)
    return covariance * np.outer(inverse, inverse)
