"""Sentences of navigation units whose order the maker fixes: what stands in each cell, and the checksum at the end.

References
----------
VectorNav, *VN-100 User Manual*, asynchronous ASCII messages (VNIMU, VNYMR, VNQMR, VNMAR): gauss, m/s², rad/s.
"""

from __future__ import annotations

import re

CHECKSUM = re.compile(r"\*[0-9A-Fa-f]{2,4}\s*$")
"""What a sentence ends with."""

_FIELD = tuple(f"m{axis} [gauss]" for axis in "xyz")
_FORCE = tuple(f"a{axis} [m/s^2]" for axis in "xyz")
_RATE = tuple(f"g{axis} [rad/s]" for axis in "xyz")
_TRIADS = (*_FIELD, *_FORCE, *_RATE)
_CELLS = {
    "$VNIMU": (*_TRIADS, "temperature [degC]", "pressure"),
    "$VNYMR": ("yaw", "pitch", "roll", *_TRIADS),
    "$VNQMR": ("q0", "q1", "q2", "q3", *_TRIADS),
    "$VNMAR": _TRIADS,
}


def names_of_sentence(cells: list[str]) -> tuple[str, ...] | None:
    """Return the names of the columns of a row that is, or has in it, a sentence; None of any other row.

    Parameters
    ----------
    cells : of one row, without the checksum.

    Examples
    --------
    >>> names_of_sentence(["12.5", "$VNMAR", *"123456789"])[:4]
    ('t', 'sentence', 'mx [gauss]', 'my [gauss]')
    """
    where = next((i for i, cell in enumerate(cells) if cell in _CELLS), None)
    if where is None or where > 1:
        return None
    names = _CELLS[cells[where]]
    return ("t",) * where + ("sentence", *names) if len(cells) == where + 1 + len(names) else None
