"""What a metrologist asks beside a standard uncertainty: tests, degrees of freedom, reliability, what is not in it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tumble.arrays import Series


@dataclass(frozen=True, slots=True)
class GlobalTest:
    """The square sum of all residuals against chi-square.

    Attributes
    ----------
    statistic, degrees : the square sum, and what is left to check it.
    probability : that chance alone gives one so far off on its side, twice: 1 in the middle.
    alone : the same of the noise seen at rest alone, without variance components.
    components : how many variance components were estimated from the same residuals.
    """

    statistic: float
    degrees: int
    probability: float
    alone: float
    components: int


@dataclass(frozen=True, slots=True)
class Detectable:
    """One observation, and the largest error in it that may go unnoticed.

    Attributes
    ----------
    kind : "force", "rate", "turn" or "angle".
    index : the hold, or the hold before the turn or rotation.
    count : how many numbers it is.
    redundancy : how much of them the others check, 0 to `count`.
    size : minimal detectable bias in the direction that does most harm, SI (m/s², rad/s, rad); infinite if
        nothing checks it.
    parameter : which of the estimate's parameters it moves most, by its index.
    effect : by how many of that parameter's standard uncertainties.
    """

    kind: str
    index: int
    count: int
    redundancy: float
    size: float
    parameter: int
    effect: float


@dataclass(frozen=True, slots=True)
class ModelChoice:
    """An optional term whose test is near its limit, and what taking the other model would change.

    Attributes
    ----------
    name : of the term.
    kept : whether the estimate has it.
    probability, limit : of its test.
    change : (parameters,) other model minus this one, in the parameters' units; NaN for those that it lacks.
    """

    name: str
    kept: bool
    probability: float
    limit: float
    change: Series


@dataclass(slots=True)
class UncertaintyStatement:
    """Everything beside the standard uncertainties, in the order of an estimate's parameters.

    Attributes
    ----------
    effective_degrees : (parameters,) of freedom after Welch and Satterthwaite; may be infinite.
    coverage_factors : (parameters,) for 95 %.
    source_degrees : source -> degrees of freedom with which its size is known.
    test : of all residuals together; None where nothing is left to check.
    detectable : of every observation that was used.
    alpha, power : of the tests that the detectable errors are for.
    model_choice : terms near their limit.
    not_included : sentences on what the uncertainties do not contain.
    """

    effective_degrees: Series = field(default_factory=lambda: np.zeros(0))
    coverage_factors: Series = field(default_factory=lambda: np.zeros(0))
    source_degrees: dict[str, float] = field(default_factory=dict[str, float])
    test: GlobalTest | None = None
    detectable: list[Detectable] = field(default_factory=list[Detectable])
    alpha: float = 0.001
    power: float = 0.8
    model_choice: list[ModelChoice] = field(default_factory=list[ModelChoice])
    not_included: list[str] = field(default_factory=list[str])


def effective_degrees(contributions: dict[str, Series], degrees: dict[str, float]) -> Series:
    """Return the degrees of freedom of a combined standard uncertainty (Welch and Satterthwaite, GUM G.4.1).

    Parameters
    ----------
    contributions : source -> (parameters,) standard uncertainties, whose squares add up.
    degrees : source -> degrees of freedom; a source that is not named is known exactly.
    """
    size = len(next(iter(contributions.values())))
    total, spread = np.zeros(size), np.zeros(size)
    for name, sigma in contributions.items():
        total += sigma**2
        known = degrees.get(name, np.inf)
        spread += sigma**4 / known
    return np.divide(total**2, spread, out=np.full(size, np.inf), where=spread > 0.0)


def coverage_factors(degrees: Series) -> Series:
    """Return Student's factors for 95 %, of degrees of freedom rounded down (GUM G.4.1), at least one.

    Parameters
    ----------
    degrees : (parameters,), may be infinite.
    """
    from scipy.special import stdtrit

    whole = np.floor(np.maximum(degrees, 1.0) * (1.0 + 1e-9))
    finite = np.minimum(whole, 1e9)
    return np.asarray(stdtrit(finite, 0.975), dtype=np.float64)


def chi_square_probability(statistic: float, degrees: float) -> float:
    """Return how likely chance makes a chi-square at least as far off on its side, doubled for both sides.

    Parameters
    ----------
    statistic, degrees : not negative; positive.
    """
    from scipy.special import chdtr, chdtrc

    return float(min(1.0, 2.0 * min(chdtrc(degrees, statistic), chdtr(degrees, statistic))))
