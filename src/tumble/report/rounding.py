"""Numbers rounded by their uncertainty: two significant digits of sigma (GUM 7.2.6).

References
----------
JCGM 100:2008 (GUM), 7.2.6: a standard uncertainty is usually quoted to at most two significant digits
and the estimate to the same decimal.
"""

from __future__ import annotations

import math

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Beyond this many decimals, or with fewer than none, a power of ten reads better than zeros.
_MOST_DECIMALS = 6
_LARGEST_ROUNDED = 1e6


_DIGITS = 2


def decimals_of(sigma: float) -> int:
    """Return how many decimals `sigma` has when it is rounded to `digits` significant digits.

    Negative for tens, hundreds and so on.

    Raises
    ------
    ValueError
        If sigma is not a positive finite number.

    Examples
    --------
    >>> decimals_of(0.0312), decimals_of(0.0996), decimals_of(678.0)
    (3, 2, -1)
    """
    if not (math.isfinite(sigma) and sigma > 0):
        raise ValueError(f"a standard uncertainty of {sigma} has no digits")
    decimals = _DIGITS - 1 - math.floor(math.log10(sigma))
    # 0.0996 becomes 0.100, which has a digit more than it should: 0.10.
    return _DIGITS - 1 - math.floor(math.log10(round(sigma, decimals)))


def fixed(value: float, decimals: int) -> str:
    """Return `value` with `decimals` decimals (negative: rounded to tens, hundreds), never "-0".

    Examples
    --------
    >>> fixed(-0.0004, 2), fixed(12345.0, -1)
    ('0.00', '12340')
    """
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    return text[1:] if text.startswith("-") and not any(c in "123456789" for c in text) else text


def with_uncertainty(value: float, sigma: float) -> str:
    """Return "value ± sigma" with two significant digits of sigma.

    Small and large numbers get a common power of ten. Without an uncertainty the value is given to
    six digits and said to be without; without a value (nan) only the uncertainty is given.

    Examples
    --------
    >>> with_uncertainty(0.10252, 0.00097)
    '0.10252 ± 0.00097'
    >>> with_uncertainty(-1.2345e-7, 3.2e-9)
    '(-12.35 ± 0.32) × 10⁻⁸'
    """
    if not (math.isfinite(sigma) and sigma > 0):
        return f"{value:.6g} (no uncertainty)" if math.isfinite(value) else "not known"
    exponent = _common_exponent(value, sigma)
    scaled = sigma / 10.0**exponent
    decimals = decimals_of(scaled)
    spread = fixed(scaled, decimals)
    text = f"± {spread}" if math.isnan(value) else f"{fixed(value / 10.0**exponent, decimals)} ± {spread}"
    return text if exponent == 0 else f"({text}) × 10{str(exponent).translate(_SUPERSCRIPTS)}"


def interval(value: float, sigma: float, factor: float) -> str:
    """Return the interval of `factor` standard uncertainties, to the decimals of sigma.

    Examples
    --------
    >>> interval(1.0, 0.1, 2.0)
    '[0.80, 1.20]'
    """
    if not (math.isfinite(value) and math.isfinite(sigma) and sigma > 0):
        return ""
    exponent = _common_exponent(value, sigma)
    decimals = decimals_of(sigma / 10.0**exponent)
    low, high = (fixed((value + k * sigma) / 10.0**exponent, decimals) for k in (-factor, factor))
    text = f"[{low}, {high}]"
    return text if exponent == 0 else f"{text} × 10{str(exponent).translate(_SUPERSCRIPTS)}"


def _common_exponent(value: float, sigma: float) -> int:
    """Return the power of ten to factor out: 0 unless zeros would fill the number."""
    if decimals_of(sigma) <= _MOST_DECIMALS and sigma < _LARGEST_ROUNDED:
        return 0
    # The uncertainty's own: it then reads 0.10 to 0.99.
    return math.floor(math.log10(sigma)) + 1
