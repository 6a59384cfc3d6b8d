"""The names of the procedures that a protocol may ask for; what they do is no concern of a protocol."""

from __future__ import annotations

KNOWN_PROCEDURES = (
    *("hand-held", "improved-six-position", "joint", "laboratory", "modified-multi-position"),
    *("multi-position", "rate-table", "six-position", "strapdown-rotation", "thermal", "turntable"),
)
"""Those that have a record in `tumble.calibration.session`: a protocol that names another one is mistaken."""
