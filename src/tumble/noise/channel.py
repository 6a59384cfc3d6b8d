"""One sensor of a recording at rest: its deviations, its model, and the coefficients that it shows."""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.noise.deviation import Deviation
from tumble.noise.fitting.fit import MISFIT, NoiseFit, Term, fit_curve
from tumble.noise.fitting.weighted_fit import Method
from tumble.noise.lines import FoundLine
from tumble.noise.white_part import WhitePart, white_beyond
from tumble.records import dataclass

FLOOR = sqrt(2.0 * log(2.0) / pi)
"""Allan deviation of flicker of B = 1: 0.664, whatever the averaging time (IEEE Std 952, annex C)."""

# Ten degrees of freedom for each averaging time in the record: 1 over the square root of twice that is 22 %.
_WELL_KNOWN = 10.0


@dataclass(frozen=True)
class Channel:
    """One sensor of the recording.

    Attributes
    ----------
    name : ax to gz.
    unit : "m/s²" or "rad/s"; "counts" where the recording is in counts.
    curve : overlapping Allan deviation, ten averaging times a decade, in that unit.
    allan : the same, averaging times an octave apart, which the model is fitted to.
    fit : the model of its noise, or None where there is none.
    floor, floor_tau : lowest point of the Allan deviation where it is known to a fifth, and its averaging time in s.
    without_fit : why there is no model, a sentence; empty where there is one.
    white : N over times longer than those of short Gauss-Markov processes; None where there are none.
    """

    name: str
    unit: str
    curve: Deviation
    allan: Deviation
    fit: NoiseFit | None
    floor: float
    floor_tau: float
    without_fit: str = ""
    white: WhitePart | None = None

    @property
    def is_gyro(self) -> bool:
        """Whether it senses angular rate."""
        return self.name.startswith("g")

    @property
    def terms(self) -> tuple[Term, ...]:
        """What the curve shows."""
        return () if self.fit is None else self.fit.terms

    @property
    def unseen(self) -> dict[str, float]:
        """Upper limits of the coefficients that the curve does not show, by letter."""
        return {} if self.fit is None else self.fit.limits

    @property
    def lines(self) -> tuple[FoundLine, ...]:
        """Vibration lines in its spectrum, strongest first."""
        return () if self.fit is None else self.fit.lines

    def term(self, letter: str) -> Term | None:
        """Return a term by its letter, or None if the curve does not show it."""
        return next((term for term in self.terms if term.letter == letter), None)

    @property
    def random_walk(self) -> Term | None:
        """N as a filter wants it: with what short Gauss-Markov processes are over longer times, or as fitted."""
        part = self.white
        return self.term("N") if part is None else Term("N", part.value, part.sigma, part.low, part.high)

    def fitted(self, tau: Series) -> Series:
        """Return the deviation of the fitted model at averaging times in s; nan without one."""
        if self.fit is None:
            return np.full(tau.shape, np.nan)
        return np.sqrt(self.fit.model.allan_variance(tau, self.fit.rate))


def characterise_channel(
    name: str,
    unit: str,
    curve: Deviation,
    octaves: Deviation,
    lines: tuple[FoundLine, ...],
    shortest: float,
    method: Method = "curve",
) -> Channel:
    """Fit a channel's model, and read its lowest point off.

    Parameters
    ----------
    name, unit, curve : as in `Channel`.
    octaves : overlapping Allan deviation that the model is fitted to.
    lines : of its spectrum.
    shortest : s, averaging times below which nothing is fitted.
    method : "curve", of the logarithm of the whole curve, or "moments", of the wavelet variances.
    """
    fit, why = _fit(octaves.from_tau(shortest), lines, method)
    finer = curve if len(curve) > len(octaves) else octaves
    known = (finer.edf[:, 0] >= _WELL_KNOWN) & (finer.tau >= shortest)
    known = known if np.any(known) else np.ones(len(finer), dtype=bool)
    lowest = int(np.argmin(np.where(known, finer.deviation[:, 0], np.inf)))
    return Channel(
        name,
        unit,
        curve,
        octaves,
        fit,
        float(finer.deviation[lowest, 0]),
        float(finer.tau[lowest]),
        why,
        None if fit is None else white_beyond(fit, octaves),
    )


def _fit(octaves: Deviation, lines: tuple[FoundLine, ...], method: Method) -> tuple[NoiseFit | None, str]:
    """The model, with more than one Gauss-Markov process only where one does not fit; or why there is none."""
    try:
        fit = fit_curve(octaves, method=method, lines=lines)
    except UsageError as error:
        return None, str(error)
    except np.linalg.LinAlgError as error:
        return None, f"{_NO_WEIGHTS} ({error})."
    if fit.probability >= MISFIT:
        return fit, ""
    try:
        richer = fit_curve(octaves, method=method, lines=lines, gauss_markov=3)
    except np.linalg.LinAlgError:
        return fit, ""
    return (richer if richer.probability > fit.probability else fit), ""


_NO_WEIGHTS = (
    "There are averaging times enough, but the curve could not be weighed. The covariance between "
    "them has no inverse in double precision, although no other model is nearer to this curve"
)
