"""Numbers in documents and texts: the one place that says what is one."""

from __future__ import annotations

import math

_LONGEST = 400  # characters: 64-bit numbers written out in full have 310 digits before the point


def number_of(value: object) -> float:
    """Return a value of a document, or a word of a text, as a finite number.

    Parameters
    ----------
    value : int, float or text such as ``-1.5e-3``; no truth value, no digits apart by ``_``, no other alphabet's.

    Raises
    ------
    ValueError
        If it is none, or not finite.

    Examples
    --------
    >>> number_of(" 2.5e1 ")
    25.0
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{value!r:.40} is no number")
    if isinstance(value, str) and (len(value) > _LONGEST or "_" in value or not value.isascii()):
        raise ValueError(f"{value[:40]!r} is no number")
    try:
        number = float(value)
    except (ValueError, OverflowError):
        raise ValueError(
            f"{str(value)[:40]!r} is no number" if isinstance(value, str) else "it is too large"
        ) from None
    if not math.isfinite(number):
        raise ValueError(f"{str(value)[:40]} is not finite")
    return number
