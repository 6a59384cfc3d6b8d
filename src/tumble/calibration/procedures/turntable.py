"""Calibration on a turntable that needs no alignment (Zhang et al. 2010): the angles that it shows are believed."""

from __future__ import annotations

from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "turntable",
    "accelerometer-x",
    "a table whose angle is read, tilted",
    "nine or more poses at rest, six axes turned about both ways; nothing aligned",
    "both triads in full, the rotation between them; gyros as exactly as the angles",
    "turntable.md",
    promises=("accelerometers", "gyros"),
    example="turntable-9",
    free_turns=False,
)
