"""The rate that samples are taken at as somebody states it: a number, with its uncertainty where that is known."""

from __future__ import annotations

import math
import re

from tumble.errors import UsageError

# "100", "100±0.1", "100+-0.1", "100 +/- 0.1".
_STATED = re.compile(r"\s*([^±]+?)\s*(?:(?:±|\+/?-)\s*(\S+)\s*)?")
_HOW = "give a positive number of samples a second, as 100, or as 100±0.1 with its standard uncertainty"


class SampleRate(float):
    """Samples a second, Hz, that know how uncertain they are.

    Attributes
    ----------
    uncertainty : Hz, one sigma; None where nobody says.
    """

    uncertainty: float | None

    def __new__(cls, rate: float, uncertainty: float | None = None) -> SampleRate:
        """Return a rate with its standard uncertainty, Hz.

        Parameters
        ----------
        rate : samples a second.
        uncertainty : one sigma of it; None for not known.
        """
        made = super().__new__(cls, rate)
        made.uncertainty = uncertainty
        return made

    @property
    def relative(self) -> float | None:
        """Standard uncertainty as a share of the rate; None where nobody says."""
        return None if self.uncertainty is None else self.uncertainty / float(self)

    def __str__(self) -> str:
        """Return it as options and protocol files take it."""
        plain = repr(float(self))
        return plain if self.uncertainty is None else f"{plain}±{self.uncertainty!r}"


def sample_rate(given: float | str) -> SampleRate:
    """Return a rate as it was given.

    Parameters
    ----------
    given : Hz; or a text such as ``100``, ``100±0.1`` or ``100+-0.1``, ± a standard uncertainty.

    Raises
    ------
    UsageError
        If it is no positive rate, or its uncertainty is none.

    Examples
    --------
    >>> sample_rate("200±0.5").relative
    0.0025
    """
    if isinstance(given, SampleRate):
        return given
    if not isinstance(given, str):
        return SampleRate(given)
    parts = _STATED.fullmatch(given.replace("+/-", "±").replace("+-", "±"))
    try:
        rate = float(parts[1]) if parts else math.nan
        sigma = float(parts[2]) if parts and parts[2] else None
    except ValueError:
        rate, sigma = math.nan, None
    if not (0.0 < rate < math.inf) or not (sigma is None or 0.0 <= sigma < rate):
        raise UsageError(f"--rate {given}: {_HOW}.")
    return SampleRate(rate, sigma)
