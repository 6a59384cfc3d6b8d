"""The magnetometer of a recording: what a user says of the field, and the estimate that goes on from the joint one."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration import Session
from tumble.errors import ConvergenceError, ObservabilityError, UsageError
from tumble.units import find_unit, magnetic_field_factor

if TYPE_CHECKING:
    from tumble.calibration import Estimate, GivenField, JointOutcome
    from tumble.document import Calibration
    from tumble.earth import Site
    from tumble.recording import Recording
    from tumble.segmentation import HoldMeans, Timeline

# µT, of the Earth's field at its surface (IGRF-13).
WEAKEST, STRONGEST = 22.0, 67.0
_NUMBER = r"\s*([-+]?[.\d]+(?:[eE][-+]?\d+)?)\s*"
_FIELD = re.compile(
    rf"{_NUMBER}(?:(?:±|\+-|\+/-){_NUMBER})?([A-Za-zµμ]+)\s*(?:,\s*(?:dip)?{_NUMBER}(?:°|deg)?\s*)?"
)
MODEL = "wmm"
EXAMPLE = "--field 49.2uT or --field 49.2±0.3uT,66"
MODEL_EXAMPLE = f"--field {MODEL},11.58,2026-05-03 with --site 48.14,520"


def given_field(text: str | None, site: Site | None = None) -> GivenField | None:
    """Return the field for ``--field NORM[±SIGMA]UNIT[,DIP]`` or, by a model, ``--field wmm,LONGITUDE,DATE``.

    Parameters
    ----------
    text : such as "49.2uT", "0.492gauss,66" or "49.2±0.3uT,66" (dip in degrees, down positive; without ± the norm is
        known to 1 %), or "wmm,11.58,2026-05-03": the World Magnetic Model at `site`, longitude in degrees east.
    site : the place as far as it was given.

    Raises
    ------
    UsageError
        If it is no such text, or no field of the Earth.
    SiteError
        If the model says nothing of that place or day.
    """
    if text is None:
        return None
    if text.partition(",")[0].strip().lower() == MODEL:
        return _field_by_model(text, site)
    from tumble.calibration import GIVEN_SIGMA, GivenField

    found = _FIELD.fullmatch(text)
    try:
        if found is None:
            raise ValueError
        value, sigma, unit, angle = found.groups()
        norm, spread = float(value), GIVEN_SIGMA * float(value) if sigma is None else float(sigma)
        dip = None if angle is None else math.radians(float(angle))
    except ValueError:
        raise UsageError(
            f"--field {text}: give norm, unit and dip in degrees, as in {EXAMPLE}, or {MODEL_EXAMPLE}."
        ) from None
    known = find_unit("magnetic field", unit)
    factor = None if known is None else magnetic_field_factor(known)
    if factor is None:
        raise UsageError(f"--field {text}: {unit} is no unit of a magnetic field; see {EXAMPLE}.")
    # Rounded, so that the limits themselves are taken in every unit.
    if not WEAKEST <= round(1e6 * factor * norm, 6) <= STRONGEST or not 0.0 <= spread < norm:
        raise UsageError(
            f"--field {text}: the Earth's field has a norm of {WEAKEST:g} to {STRONGEST:g} µT; give the one "
            f"of your place, as in {EXAMPLE}."
        )
    if dip is not None and not abs(dip) <= math.pi / 2.0:
        raise UsageError(
            f"--field {text}: a dip is from -90 to 90 degrees, positive where the field points down."
        )
    return GivenField(factor * norm, factor * spread, dip, "given with --field")


def _field_by_model(text: str, site: Site | None) -> GivenField:
    """The field by the World Magnetic Model at the site."""
    from tumble.calibration import GivenField
    from tumble.earth import earth_field

    if site is None or site.latitude is None:
        raise UsageError(f"--field {text} needs the place: give {MODEL_EXAMPLE}.")
    try:
        _, degrees, day = (part.strip() for part in text.split(","))
        longitude, when = float(degrees), date.fromisoformat(day)
    except ValueError:
        raise UsageError(
            f"--field {text}: give the longitude in degrees east and the day, as in {MODEL_EXAMPLE}."
        ) from None
    if not abs(longitude) <= 360.0:
        raise UsageError(f"--field {text}: a longitude is from -180 to 360 degrees.")
    found = earth_field(site.latitude, math.radians(longitude), site.height or 0.0, when)
    return GivenField(
        found.norm, found.norm_sigma, found.dip, f"the World Magnetic Model {found.model}", found.dip_sigma
    )


def refuse_field_of_none(recording: Recording, given: GivenField | None) -> None:
    """Refuse a field for a recording without a magnetometer.

    Parameters
    ----------
    recording, given : what was read, and the field; None for none.

    Raises
    ------
    UsageError
        If there is no magnetometer.
    """
    if given is None or recording.magnetic_field is not None:
        return
    from tumble.recording import NOTHING_MADE

    for remark in recording.remarks:
        if remark.text.endswith(NOTHING_MADE):
            raise UsageError(
                f"--field was given, and the magnetometer lacks a column. {remark.text} If it has another name, say "
                "what every column is with --columns."
            )
    raise UsageError("--field was given, and the recording has no magnetometer: leave it out.")


def add_magnetometer(session: Session, estimate: Estimate, given: GivenField | None) -> None:
    """Add what a recording tells of its magnetometer to an estimate; nothing where it has none.

    Parameters
    ----------
    session, estimate : what was recorded, and what was found of the other triads.
    given : the field at the site, where it is known.
    """
    magnetic = session.recording.magnetic_field
    if magnetic is None:
        return
    from tumble.calibration import magnetometer_of

    session.say("magnetometer")
    try:
        estimate.show(magnetometer_of(_carrier(session, estimate), magnetic, given))
    except ObservabilityError as error:
        estimate.say("not determined", f"The magnetometer: {error}")


def field_alone(
    session: Session,
    given: GivenField | None,
    why: str,
    imu: tuple[str | None, str | None],
) -> tuple[Calibration, Estimate]:
    """Return the calibration of a magnetometer by itself, where the recording determines nothing else.

    Parameters
    ----------
    session, given : what was recorded, and the field at the site.
    why : why the other triads are not calibrated, as a sentence.
    imu : (model, serial number) of the unit.

    Raises
    ------
    ObservabilityError
        If the samples determine no magnetometer either, and the recording was to calibrate other triads.
    """
    from tumble.calibration import Described, Estimate, Figures, magnetometer_alone
    from tumble.document import FIELD_ALONE, calibration_from_estimate
    from tumble.sensor import ImuModel

    recording = session.recording
    assert recording.magnetic_field is not None
    session.say("magnetometer")
    found = magnetometer_alone(recording.magnetic_field, given)
    if found.triad is None and (recording.specific_force is not None or recording.angular_rate is not None):
        raise ObservabilityError(found.not_determined[0])
    nothing = Described(ImuModel(None, None, None, found.triad), [], np.zeros((0, 0)), [], np.zeros((0, 0)))
    figures = Figures(np.nan, np.nan, 0, found.coverage_factor, 0.0, {})
    estimate = Estimate(FIELD_ALONE, *nothing, *figures, evidence=[found], frame=FIELD_ALONE)
    remarks = tuple(remark.text for remark in recording.remarks)
    document = calibration_from_estimate(
        estimate, recording, session.site, remarks=remarks, imu=imu, why_alone=why
    )
    return document, estimate


def left_out_of(recordings: Iterable[Recording]) -> list[str]:
    """Return the sentence that magnetometers take no part, none where no recording has one.

    Parameters
    ----------
    recordings : several turn-ons, calibrated together.
    """
    if all(recording.magnetic_field is None for recording in recordings):
        return []
    return ["The magnetometer is left out of several turn-ons: calibrate a recording by itself to have it."]


def no_holds() -> tuple[Timeline, HoldMeans]:
    """Return the timeline of a recording without holds, and the means of none."""
    from tumble.segmentation import HoldMeans, NoiseFloor, Timeline

    floor = NoiseFloor(np.zeros(3), np.zeros(3), 0.0, "none")
    empty = np.zeros(0)
    return Timeline((), (), (), floor), HoldMeans(None, None, None, None, empty, empty, empty, None)


def _carrier(session: Session, estimate: Estimate) -> JointOutcome | None:
    """The joint adjustment that tells poses in the frame of the estimate; None where there is none."""
    if estimate.procedure == "joint" and session.joint is not None:
        return session.joint
    if session.recording.specific_force is None:
        return None
    from tumble.calibration import calibrate, find_procedure

    try:
        calibrate(session, find_procedure("joint"))
    except (ObservabilityError, ConvergenceError, np.linalg.LinAlgError):
        return None
    return session.joint
