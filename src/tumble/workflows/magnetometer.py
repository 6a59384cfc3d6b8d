"""The magnetometer of a recording: what a user says of the field, and the estimate that goes on from the joint one."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.session import Session
from tumble.errors import ConvergenceError, ObservabilityError, UsageError
from tumble.units import find_unit, magnetic_field_factor

if TYPE_CHECKING:
    from tumble.calibration import Estimate
    from tumble.calibration.magnetometer.estimate import GivenField
    from tumble.calibration.outcome.estimate import JointOutcome

# Of a norm that is given without its own uncertainty: a model of the Earth's field knows it to 0.3 %, and buildings
# and cars change it by more.
NORM_SIGMA = 0.01
# Of the Earth's field at its surface (IGRF-13: 22 to 67 µT), with what is built on it.
WEAKEST, STRONGEST = 10e-6, 150e-6
_NUMBER = r"\s*([-+]?[.\d]+(?:[eE][-+]?\d+)?)\s*"
_FIELD = re.compile(
    rf"{_NUMBER}(?:(?:±|\+-|\+/-){_NUMBER})?([A-Za-zµμ]+)\s*(?:,\s*(?:dip)?{_NUMBER}(?:°|deg)?\s*)?"
)
EXAMPLE = "--field 49.2uT or --field 49.2±0.3uT,66"


def given_field(text: str | None) -> GivenField | None:
    """Return the field for ``--field NORM[±SIGMA]UNIT[,DIP]``: norm, and dip in degrees, down positive.

    Parameters
    ----------
    text : such as "49.2uT", "0.492gauss,66" or "49.2±0.3uT,66"; without ± the norm is known to 1 %.

    Raises
    ------
    UsageError
        If it is no such text, or no field of the Earth.
    """
    if text is None:
        return None
    from tumble.calibration.magnetometer.estimate import GivenField

    found = _FIELD.fullmatch(text)
    try:
        if found is None:
            raise ValueError
        value, sigma, unit, angle = found.groups()
        norm, spread = float(value), NORM_SIGMA * float(value) if sigma is None else float(sigma)
        dip = None if angle is None else math.radians(float(angle))
    except ValueError:
        raise UsageError(f"--field {text}: give norm, unit and dip in degrees, as in {EXAMPLE}.") from None
    known = find_unit("magnetic field", unit)
    factor = None if known is None else magnetic_field_factor(known)
    if factor is None:
        raise UsageError(f"--field {text}: {unit} is no unit of a magnetic field; see {EXAMPLE}.")
    if not WEAKEST < factor * norm < STRONGEST or not 0.0 <= spread < norm:
        raise UsageError(
            f"--field {text}: the Earth's field has a norm of 22 to 67 µT; give the one of your place, as in {EXAMPLE}."
        )
    if dip is not None and not abs(dip) <= math.pi / 2.0:
        raise UsageError(
            f"--field {text}: a dip is from -90 to 90 degrees, positive where the field points down."
        )
    return GivenField(factor * norm, factor * spread, dip, "given with --field")


def add_magnetometer(session: Session, estimate: Estimate, given: GivenField | None) -> None:
    """Add what a recording tells of its magnetometer to an estimate; nothing where it has none.

    Parameters
    ----------
    session, estimate : what was recorded, and what was found of the other triads.
    given : the field at the site, where it is known.

    Raises
    ------
    UsageError
        If a field is given and there is no magnetometer.
    """
    magnetic = session.recording.magnetic_field
    if magnetic is None:
        if given is not None:
            raise UsageError("--field was given, and the recording has no magnetometer: leave it out.")
        return
    from tumble.calibration.magnetometer.estimate import magnetometer_of

    session.say("magnetometer")
    try:
        estimate.show(magnetometer_of(_carrier(session, estimate), magnetic, given))
    except ObservabilityError as error:
        estimate.say("not determined", f"The magnetometer: {error}")


def _carrier(session: Session, estimate: Estimate) -> JointOutcome | None:
    """The joint adjustment that tells poses in the frame of the estimate; None where there is none."""
    if estimate.procedure == "joint" and session.joint is not None:
        return session.joint
    if session.recording.specific_force is None:
        return None
    from tumble.calibration.procedures.joint import run_joint

    try:
        run_joint(session, estimate, frame=estimate.frame)
    except (ObservabilityError, ConvergenceError, np.linalg.LinAlgError):
        return None
    return session.joint
