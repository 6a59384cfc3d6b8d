"""Numbers as somebody states them, with their uncertainty where that is known: a sample rate, a clock, gravity."""

from __future__ import annotations

import math
import re
from decimal import Decimal

from tumble.errors import UsageError

# "100", "100±0.1", "100+-0.1", "100 +/- 50 ppm".
_STATED = re.compile(r"([^±]+?)\s*(?:±\s*([^±%]+?)\s*(ppm|%)?)?")
_PARTS = {"ppm": 1e6, "%": 1e2}
CRYSTAL = 5e-5
"""One sigma of a crystal's rate: ± 20 to 100 ppm of cut, temperature and age."""
_HOW = (
    "give a positive number of samples a second, as 100, or as 100±0.1 with its standard uncertainty (or ±50ppm); "
    "where a crystal times the stamps, give crystal"
)


def stated_number(given: str) -> tuple[float, float | None]:
    """Return a number and its standard uncertainty as a text states them; None where it states none.

    Parameters
    ----------
    given : such as ``9.81``, ``9.80788±0.00002``, ``100+-0.1``, ``100±50ppm`` or ``100±0.1%``.

    Raises
    ------
    ValueError
        If it is neither, or one of the two is no finite number.

    Examples
    --------
    >>> stated_number("9.80788 +/- 0.00002")
    (9.80788, 2e-05)
    """
    parts = _STATED.fullmatch(_with_one_sign(given))
    if parts is None:
        raise ValueError(given)
    number = float(parts[1])
    sigma = None if parts[2] is None else float(parts[2])
    if sigma is not None and parts[3]:
        sigma *= abs(number) / _PARTS[parts[3]]
    if not math.isfinite(number) or not (sigma is None or 0.0 <= sigma < math.inf):
        raise ValueError(given)
    return number, sigma


def stated_clock(given: object) -> float | None:
    """Return what share a text says that the clock of stamps is good to, one sigma; None of any other text.

    Parameters
    ----------
    given : ``crystal``, or a share such as ``±50ppm`` or ``+-0.5%``.

    Examples
    --------
    >>> stated_clock("crystal"), stated_clock("±0.5%"), stated_clock("100±0.1")
    (5e-05, 0.005, None)
    """
    text = _with_one_sign(given).lower() if isinstance(given, str) else ""
    try:
        if text.startswith("±") and text.endswith(tuple(_PARTS)):
            return stated_number(f"1{text}")[1]
    except ValueError:
        return None
    return CRYSTAL if text == "crystal" else None


def _with_one_sign(given: str) -> str:
    return given.replace("+/-", "±").replace("+-", "±").strip()


def rounding(given: float | str) -> float:
    """Return the standard uncertainty of a number that was rounded to the digits that it is written with.

    Half of the last digit to either side, any value as likely as any other (GUM 4.3.7): a last digit over root twelve.

    Parameters
    ----------
    given : a text such as ``9.810``, or a number, which is written with as few digits as tell it.
    """
    exponent = Decimal(given if isinstance(given, str) else repr(float(given))).as_tuple().exponent
    return 10.0 ** int(exponent) / math.sqrt(12.0)


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
    given : Hz; or a text such as ``100``, ``100±0.1`` or ``100±50ppm``, ± a standard uncertainty.

    Raises
    ------
    UsageError
        If it is no positive rate, or its uncertainty is none.

    Examples
    --------
    >>> sample_rate("200±0.5").relative
    0.0025
    """
    if not isinstance(given, str):
        return given if isinstance(given, SampleRate) else SampleRate(given)
    try:
        rate, sigma = stated_number(given)
    except ValueError:
        rate, sigma = math.nan, None
    if not rate > 0.0 or not (sigma is None or sigma < rate):
        raise UsageError(f"--rate {given}: {_HOW}.")
    return SampleRate(rate, sigma)
