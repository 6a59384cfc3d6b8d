"""What an estimate rests on, for those who look at it: one record a kind, and the report has one renderer a kind.

`Beside`, an estimate in itself, stands next to `Estimate`. The statement of uncertainty is what a metrologist asks
beside a standard uncertainty: tests, degrees of freedom, reliability, what is not in it. Several turn-ons of one unit
tell which of its parameters are stable, and how far biases move in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from tumble.arrays import Series, Square, Table, Vectors
from tumble.records import dataclass


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class DrawnDistributions:
    """What propagation of distributions gave (JCGM 101), beside the intervals of the GUM.

    Attributes
    ----------
    runs : draws of all errors.
    intervals : (parameters, 2) ends of the shortest 95 % intervals.
    off : (parameters,) by how much an end of the GUM's interval is off them at most.
    spread : (parameters,) standard deviation of the ends by chance, from blocks of the draws.
    tolerance : (parameters,) half a unit of the one significant digit of the standard uncertainty.
    readjusted : how many times observations were drawn anew and adjusted in full.
    readjusted_ratio : (parameters,) their root mean square error over the first order's sigma; empty without.
    why_not_readjusted : why there are none, or no more; empty if nothing stood against it.
    """

    runs: int
    intervals: Table
    off: Series
    spread: Series
    tolerance: Series
    readjusted: int
    readjusted_ratio: Series
    why_not_readjusted: str

    @property
    def validated(self) -> np.ndarray:
        """(parameters,) of bool: the GUM's interval is within the tolerance at both ends (JCGM 101, clause 8)."""
        return self.off <= self.tolerance

    @property
    def contradicted(self) -> np.ndarray:
        """(parameters,) of bool: it is off by more than that, and by more than chance in the draws explains."""
        return self.off > self.tolerance + 2.0 * self.spread

    def words(self) -> str:
        """Return what it says in a sentence or two."""
        valid, count = int(np.count_nonzero(self.validated)), self.off.size
        said = (
            f"Propagation of distributions, {self.runs} draws: the 95 % intervals of the GUM are validated to one "
            f"significant digit of the standard uncertainty for {valid} of {count} parameters (JCGM 101, clause 8)"
        )
        against = int(np.count_nonzero(self.contradicted))
        if against:
            said += f", and contradicted for {against}: of those take the drawn intervals"
        if valid + against < count:
            said += f", and open for {count - valid - against}, which more draws would decide"
        said += "."
        if self.readjusted:
            spread = 1.0 / np.sqrt(2.0 * self.readjusted)
            said += (
                f" {self.readjusted} full adjustments of observations drawn anew scatter by "
                f"{float(np.sqrt(np.mean(self.readjusted_ratio**2))):.2f} of what the first order says (1 ± "
                f"{spread:.2f} for each parameter)."
            )
        if self.why_not_readjusted:
            said += f" Full adjustments: {self.why_not_readjusted}."
        return said


@dataclass
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
    drawn : propagation of distributions, where it was asked for.
    outcome : the procedure's own solution (`JointOutcome`), from which distributions can be drawn.
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
    drawn: DrawnDistributions | None = None
    outcome: object = None


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
        spread += sigma**4 / degrees.get(name, np.inf)
    return np.divide(total**2, spread, out=np.full(size, np.inf), where=spread > 0.0)


def coverage_factors(degrees: Series) -> Series:
    """Return Student's factors for 95 %, of degrees of freedom rounded down (GUM G.4.1), at least one.

    Parameters
    ----------
    degrees : (parameters,), may be infinite.
    """
    from scipy.special import stdtrit

    whole = np.minimum(np.floor(np.maximum(degrees, 1.0) * (1.0 + 1e-9)), 1e9)
    return np.asarray(stdtrit(whole, 0.975), dtype=np.float64)


def chi_square_probability(statistic: float, degrees: float) -> float:
    """Return how likely chance makes a chi-square at least as far off on its side, doubled for both sides.

    Parameters
    ----------
    statistic, degrees : not negative; positive.
    """
    from scipy.special import chdtr, chdtrc

    return float(min(1.0, 2.0 * min(chdtrc(degrees, statistic), chdtr(degrees, statistic))))


class Evidence:
    """A kind of evidence: at most one record of each kind stands in an estimate."""


def _nothing() -> Series:
    return np.zeros(0)


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Holds(Evidence):
    """How well the corrected specific force of each hold has the norm of gravity.

    Attributes
    ----------
    norms : (holds,) corrected norm minus gravity, m/s².
    sigmas : (holds,) what it is expected to be (root mean square), m/s².
    restless : holds that sway more than the others, and count for less.
    """

    norms: Series = field(default_factory=_nothing)
    sigmas: Series = field(default_factory=_nothing)
    restless: tuple[RestlessHold, ...] = ()


@dataclass(frozen=True)
class Turns(Evidence):
    """How well the corrected gyros carry gravity over the turn after each hold.

    Attributes
    ----------
    angles : (holds,) rad, from where gravity is carried to where it is seen; NaN where no turn follows.
    sigmas : (holds,) rad, what the angle is expected to be.
    sizes : (holds,) rad, how far the turn went.
    """

    angles: Series = field(default_factory=_nothing)
    sigmas: Series = field(default_factory=_nothing)
    sizes: Series = field(default_factory=_nothing)

    @property
    def found(self) -> Series:
        """The angles of the turns that there are, rad."""
        return self.angles[np.isfinite(self.angles)]


@dataclass(frozen=True)
class Spins(Evidence):
    """How well the corrected gyros show the rates of a table.

    Attributes
    ----------
    rates : (spins,) rad/s, the reference rate of each spin with its sign.
    residuals, sigmas : (spins, 3) rad/s, what each gyro shows beyond the model, and its sigma.
    names : what each spin is, in words.
    """

    rates: Series = field(default_factory=_nothing)
    residuals: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    sigmas: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    names: tuple[str, ...] = ()


@dataclass
class Budget(Evidence):
    """Where the standard uncertainties come from.

    Attributes
    ----------
    shares : what each source adds to the standard uncertainties of an estimate's parameters, in their order and units.
    statement : tests, degrees of freedom, reliability and what is not included, where the procedure has them.
    """

    shares: dict[str, Series]
    statement: UncertaintyStatement | None = None


@dataclass(frozen=True)
class BiasCurve:
    """A triad's bias against the sensor's temperature.

    Attributes
    ----------
    celsius : (temperatures,) °C.
    bias, sigma : (temperatures, 3) raw, settled and half way through the loop, and its standard uncertainty.
    heating, cooling : (temperatures, 3) raw, at the two ends of the loop.
    """

    celsius: Series
    bias: Vectors
    sigma: Vectors
    heating: Vectors
    cooling: Vectors


@dataclass(frozen=True)
class Candidate:
    """A basis that was tried.

    Attributes
    ----------
    name, unknowns : what it is, and how many unknowns that makes.
    score, spread : mean square of what it predicts wrongly, in sigmas, over the folds; its standard error.
    folds : of each fold.
    chosen : whether it is the one.
    """

    name: str
    unknowns: int
    score: float
    spread: float
    folds: tuple[float, ...] = ()
    chosen: bool = False


@dataclass
class ThermalCurves(Evidence):
    """Behind a thermal model.

    Attributes
    ----------
    kind : "soak" or "ramp".
    basis : in words.
    start, stop : (points,) s of the rests used.
    celsius, celsius_rate, hysteresis : (points,) °C, K/s, -1 to 1, of the sensors.
    force, rate : (points, 3) raw bias that each rest shows, where it shows one (NaN elsewhere).
    rate_sigma : (points, 3) raw.
    residuals : (points, 6) in sigmas, specific force and angular rate; NaN where there is no equation.
    curves : "accelerometer" and "gyroscope": bias against temperature with its standard uncertainty.
    candidates : bases that were tried.
    rejected : (start, stop) s and why, of rests that took no part.
    path_time, path_celsius : a thinned course of temperature.
    lag, width : s and K.
    poses : how many different poses there were.
    """

    kind: str
    basis: str
    start: Series
    stop: Series
    celsius: Series
    celsius_rate: Series
    hysteresis: Series
    force: Vectors
    rate: Vectors
    rate_sigma: Vectors
    residuals: Table
    curves: dict[str, BiasCurve]
    path_time: Series
    path_celsius: Series
    candidates: list[Candidate] = field(default_factory=list[Candidate])
    rejected: list[tuple[float, float, str]] = field(default_factory=list[tuple[float, float, str]])
    lag: float = 0.0
    width: float = 5.0
    poses: int = 0


# That any of the stable parameters of a unit is said to change though none does.
FALSE_ALARM = 0.01
# A bias is said to change where chance does so more rarely than this.
BIAS_CHANCE = 0.05


@dataclass(frozen=True)
class Agreement:
    """Whether a parameter that should be stable agrees between the recordings.

    Attributes
    ----------
    parameter, unit : as in the list of parameters.
    values, sigmas : (recordings,) what each determines by itself; NaN where it does not tell it.
    value, sigma : of all together, before it is enlarged.
    chi_square, degrees, probability : of the differences, and how rarely chance makes them so large.
    limit : below it they are no chance.
    """

    parameter: str
    unit: str
    values: Series
    sigmas: Series
    value: float
    sigma: float
    chi_square: float
    degrees: int
    probability: float
    limit: float

    @property
    def agrees(self) -> bool:
        """Whether chance explains the differences."""
        return self.probability >= self.limit

    @property
    def is_optional(self) -> bool:
        """Whether it belongs to an optional term."""
        return any(word in self.parameter for word in ("g-sensitivity", "quadratic", "asymmetry"))

    @property
    def enlarged(self) -> float:
        """By which factor the standard uncertainty is enlarged (Birge): 1 where chance explains the differences."""
        by_chance = self.agrees or self.degrees < 1
        return 1.0 if by_chance else max(1.0, float(np.sqrt(self.chi_square / self.degrees)))

    @property
    def largest(self) -> float:
        """The largest difference of two recordings, in the parameter's unit."""
        told = self.values[np.isfinite(self.values)]
        return float(told.max() - told.min()) if told.size else 0.0


@dataclass(frozen=True)
class BiasScatter:
    """A bias from turn-on to turn-on.

    Attributes
    ----------
    parameter, unit : as in the list of parameters.
    values, sigmas : (recordings,) each recording's own; NaN where it has none.
    mean, mean_sigma : of the recordings, and what their noise makes of it.
    scatter : standard deviation of the recordings' biases about their mean.
    measurement : what their own uncertainties would make of it, were the bias the same every time.
    degrees : of freedom of the scatter, one less than recordings.
    chi_square, probability : of the differences, and how rarely noise alone makes them so large.
    coverage_factor : Student's, for 95 %.
    """

    parameter: str
    unit: str
    values: Series
    sigmas: Series
    mean: float
    mean_sigma: float
    scatter: float
    measurement: float
    degrees: int
    chi_square: float
    probability: float
    coverage_factor: float

    @property
    def scatter_sigma(self) -> float:
        """Standard uncertainty of the scatter: few recordings tell it poorly."""
        return self.scatter / float(np.sqrt(2.0 * self.degrees))

    @property
    def turn_on(self) -> float:
        """The scatter without what is noise of the recordings; 0 where noise explains all of it."""
        return float(np.sqrt(max(self.scatter**2 - self.measurement**2, 0.0)))

    @property
    def changes(self) -> bool:
        """Whether the bias changes by more than noise explains."""
        return self.probability < BIAS_CHANCE

    @property
    def next_sigma(self) -> float:
        """Standard uncertainty of the mean as the bias of the next turn-on.

        The scatter of one more recording about the mean of these; never below what a single recording is uncertain by,
        because a scatter that came out small by chance is no promise.
        """
        return max(self.scatter, self.measurement) * float(np.sqrt(1.0 + 1.0 / (self.degrees + 1)))


@dataclass(frozen=True)
class RecordingOfUnit:
    """One of the recordings that were adjusted together.

    Attributes
    ----------
    name : of the recording.
    holds, turns, spins : how many it has.
    sigma0 : of its residuals at the common solution.
    variance_components : name -> standard deviation, SI.
    seconds, rate : how long it is, and Hz.
    """

    name: str
    holds: int
    turns: int
    spins: int
    sigma0: float
    variance_components: dict[str, float]
    seconds: float
    rate: float


@dataclass
class TurnOns(Evidence):
    """What several recordings of one unit tell about it.

    Attributes
    ----------
    recordings : in the order given.
    biases : each bias from turn-on to turn-on.
    agreements : each stable parameter between the recordings.
    chi_square, degrees, probability : of all stable parameters together.
    """

    recordings: list[RecordingOfUnit]
    biases: list[BiasScatter] = field(default_factory=list[BiasScatter])
    agreements: list[Agreement] = field(default_factory=list[Agreement])
    chi_square: float = 0.0
    degrees: int = 0
    probability: float = 1.0

    @property
    def changing(self) -> list[Agreement]:
        """The parameters that should be stable and are not, worst first."""
        return sorted((a for a in self.agreements if not a.agrees), key=lambda a: a.probability)


def bias_scatter(
    parameter: str, unit: str, values: Series, covariance: Square, recordings: int, at: Sequence[int]
) -> BiasScatter:
    """Return what the biases of several recordings say of the next one.

    Parameters
    ----------
    parameter, unit : in words.
    values, covariance : (n,), (n, n) of the recordings that have it, errors in common included.
    recordings : how many there are in all.
    at : which of them have it.
    """
    from scipy.special import chdtrc, stdtrit

    n, about = values.size, values - values.mean()
    centred = np.eye(n) - 1.0 / n
    spread = centred @ covariance @ centred
    squares = float(about @ np.linalg.pinv(spread, rcond=1e-9, hermitian=True) @ about)
    every, sigmas = np.full(recordings, np.nan), np.full(recordings, np.nan)
    every[list(at)], sigmas[list(at)] = values, np.sqrt(np.diag(covariance))
    return BiasScatter(
        *(parameter, unit, every, sigmas, float(values.mean())),
        float(np.sqrt(covariance.sum())) / n,
        float(np.sqrt(about @ about / (n - 1))),
        float(np.sqrt(np.trace(spread) / (n - 1))),
        *(n - 1, squares, float(chdtrc(n - 1, squares)), float(stdtrit(n - 1, 0.975))),
    )


def agreement_of(
    parameter: str, unit: str, values: Series, sigmas: Series, together: tuple[float, float], limit: float
) -> Agreement:
    """Return whether a parameter agrees between recordings that tell it independently.

    Parameters
    ----------
    parameter, unit : in words.
    values, sigmas : (recordings,) NaN where one does not tell it.
    together : value and standard uncertainty of all.
    limit : of the probability.
    """
    from scipy.special import chdtrc

    told = np.isfinite(values)
    weight = 1.0 / sigmas[told] ** 2
    degrees = max(int(np.count_nonzero(told)) - 1, 0)
    mean = weight @ values[told] / max(weight.sum(), 1e-300)
    squares = float(weight @ (values[told] - mean) ** 2)
    probability = float(chdtrc(degrees, squares)) if degrees else 1.0
    return Agreement(parameter, unit, values, sigmas, *together, squares, degrees, probability, limit)
