"""The names of the procedures that a protocol may ask for; what they do is no concern of a protocol."""

KNOWN_PROCEDURES = (
    "hand-held",
    "multi-position",
    "six-position",
    "improved-six-position",
    "rate-table",
    "modified-multi-position",
    "turntable",
    "laboratory",
    "strapdown-rotation",
    "thermal",
    "joint",
)
"""Those of this version and those to come: a file that names another one is mistaken."""
