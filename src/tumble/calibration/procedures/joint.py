"""What the protocol's own procedure believes, and the result in the frame of the accelerometers."""

from __future__ import annotations

from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "joint",
    "accelerometer-x",
    "any of these",
    "what the procedure needs that the recording was made for",
    "the same from one adjustment of everything that was recorded, with a budget of uncertainty",
    "../joint.md",
)
