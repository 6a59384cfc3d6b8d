"""What several turn-ons of one unit say of its parameters: which are stable, and how far biases move in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.evidence import Evidence
from tumble.records import dataclass

# That any of the stable parameters of a unit is said to change though none does.
FALSE_ALARM = 0.01
# A bias is said to change where chance does so more rarely than this.
BIAS_CHANCE = 0.05


@dataclass(frozen=True, slots=True)
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
        if self.agrees or self.degrees < 1:
            return 1.0
        return max(1.0, float(np.sqrt(self.chi_square / self.degrees)))

    @property
    def largest(self) -> float:
        """The largest difference of two recordings, in the parameter's unit."""
        told = self.values[np.isfinite(self.values)]
        return float(told.max() - told.min()) if told.size else 0.0


@dataclass(frozen=True, slots=True)
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
        recordings = self.degrees + 1
        return max(self.scatter, self.measurement) * float(np.sqrt(1.0 + 1.0 / recordings))


@dataclass(frozen=True, slots=True)
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


@dataclass(slots=True)
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

    n = values.size
    about = values - values.mean()
    centred = np.eye(n) - 1.0 / n
    spread = centred @ covariance @ centred
    squares = float(about @ np.linalg.pinv(spread, rcond=1e-9, hermitian=True) @ about)
    every, sigmas = np.full(recordings, np.nan), np.full(recordings, np.nan)
    every[list(at)], sigmas[list(at)] = values, np.sqrt(np.diag(covariance))
    return BiasScatter(
        parameter,
        unit,
        every,
        sigmas,
        float(values.mean()),
        float(np.sqrt(covariance.sum())) / n,
        float(np.sqrt(about @ about / (n - 1))),
        float(np.sqrt(np.trace(spread) / (n - 1))),
        n - 1,
        squares,
        float(chdtrc(n - 1, squares)),
        float(stdtrit(n - 1, 0.975)),
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
    squares = 0.0
    if degrees:
        mean = float(weight @ values[told] / weight.sum())
        squares = float(weight @ (values[told] - mean) ** 2)
    probability = float(chdtrc(degrees, squares)) if degrees else 1.0
    return Agreement(parameter, unit, values, sigmas, *together, squares, degrees, probability, limit)
