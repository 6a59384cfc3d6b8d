"""Text from files: its lines, the characters in it that nobody sees, and the one place that says what is a number."""

from __future__ import annotations

import math
import re

HIDDEN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, separators of lines, marks that turn the direction of writing, halves of characters."""
# A user with a password, as a URL has them: also where its scheme was left out.
_SECRET = re.compile(r"(?<=://)[^\s/'\"@]+@|[^\s/'\"@:]+:[^\s/'\"@]+@")


def shown(text: str) -> str:
    """Return a text on one line, each hidden character as its number.

    Examples
    --------
    >>> shown("MPU-9250")
    'MPU-9250'
    >>> shown("a" + chr(10) + "b")
    'a<U+000A>b'
    """
    return HIDDEN.sub(lambda match: f"<U+{ord(match[0]):04X}>", text)


def without_password(text: str) -> str:
    """Return a text whose URLs have no user and password.

    Examples
    --------
    >>> without_password("tcp://me:secret@host:8786 does not answer")
    'tcp://***@host:8786 does not answer'
    """
    return _SECRET.sub("***@", text)


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, which end with LF, CR LF or CR.

    `str.splitlines` also ends lines at form feeds, vertical tabs, U+0085 and U+2028, as no table and no editor does.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines[:-1] if lines and not lines[-1] else lines


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
