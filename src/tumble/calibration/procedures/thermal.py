"""Calibration over temperature: rests at several temperatures, in soaks or in a slow sweep (see the room `thermal`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tumble.calibration.procedure import Procedure

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.session import Session


def _run(session: Session) -> Estimate:
    from tumble.calibration.thermal.procedure import calibrate_thermal

    return calibrate_thermal(
        session.recording, session.timeline, session.site, protocol=session.protocol, progress=session.say
    )


PROCEDURE = Procedure(
    "thermal",
    "accelerometer-x",
    "a chamber, or a fridge",
    "rests at several temperatures, soaked or in a slow sweep, and the sensor's thermometer",
    "accelerometers in full and gyro biases as functions of temperature, its rate and its history",
    "thermal.md",
    remedy="hold nine poses or more at more temperatures",
    promises=("accelerometers",),
    run=_run,
)
