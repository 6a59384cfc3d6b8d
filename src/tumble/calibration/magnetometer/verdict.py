"""Is a magnetometer's calibration fit for use? A verdict of its own, in plain words.

Holds are left out at a false-alarm rate of 1 % a recording, and a field that stays is said to move in 0.1 % of
recordings. All other reasons are sizes and no tests.
"""

from __future__ import annotations

from typing import Literal, SupportsFloat

import numpy as np

from tumble.calibration.magnetometer.estimate import LOCAL, NAME_PLATE, Magnetometer, nearest_axes
from tumble.calibration.magnetometer.field_equations import FALSE_ALARM, Moving
from tumble.records import dataclass
from tumble.units import magnetic_field_factor

Use = Literal["fit", "fit with reservations", "not fit"]

# Shares of the norm: what the corrected field is uncertain by, with what it differs by from hold to hold.
GOOD, USABLE = 0.02, 0.05
# Of the norm, from hold to hold: beyond it is said. Noise and what converters round leave a tenth of it.
UNEVEN = 0.002
# Of the holds (or samples) may be left out.
FEW_LEFT_OUT, MANY_LEFT_OUT = 0.1, 0.25
# The Earth's field has 22 to 67 µT at its surface (IGRF-13), and buildings take or add a third.
WEAKEST, STRONGEST = 15e-6, 90e-6
# A given norm and dip that a place indoors may differ from, and beyond which it is another field.
OFF_NORM, OFF_DIP = 0.2, np.radians(10.0)
# Of a mean scale factor that data sheets promise to 5 %, one sigma.
USUAL_SCALE = 2.0 * NAME_PLATE
# Of a mean scale factor against the unit's own: wrong units are farther off, by ten or more.
SMALLEST_SCALE, LARGEST_SCALE = 0.5, 2.0
# Redundant observations of the field below which nothing is checked.
LEAST_CHECKS = 6
# From here on towards the poles the field points into the ground in the north, and out of it in the south.
SURE_DIP = np.radians(25.0)
# Within some 200 km of a magnetic pole alone the field is steeper (WMM2025).
UPRIGHT = np.radians(88.0)


@dataclass(frozen=True)
class FieldVerdict:
    """How a magnetometer's calibration may be used.

    Attributes
    ----------
    use : in words.
    reasons : sentences, what speaks against it first.
    remarks : what else there is to know.
    """

    use: Use
    reasons: tuple[str, ...]
    remarks: tuple[str, ...] = ()

    @property
    def fit(self) -> bool:
        """Whether it may be used at all."""
        return self.use != "not fit"


# What it speaks for, a quantity, beyond which limit and up to which, and the sentence.
_Limit = tuple[Literal["not fit", "reserved", "remark"], SupportsFloat, float, float, str]
_ANY = np.inf


def judge_magnetometer(made: Magnetometer, latitude: float | None = None) -> FieldVerdict:
    """Judge the calibration of a magnetometer.

    Parameters
    ----------
    made : what was found.
    latitude : rad, where it was recorded; None where nobody says.
    """
    limits = [*_of_sizes(made), *_of_scale(made), *_of_dip(made, latitude), *_of_course(made)]
    against, reserved, remarks = (
        [text for of, size, beyond, up_to, text in limits if of == use and beyond < float(size) <= up_to]
        for use in ("not fit", "reserved", "remark")
    )
    if made.triad is None:
        few = "So few directions do not determine the magnetometer: it is not corrected."
        against, reserved = [*made.not_determined[:3], few], list[str]()
    if made.saturated:
        stuck = "; ".join(made.saturated)
        text = f"The magnetometer sticks at its limits: {stuck}. Choose a larger range, or keep magnets away."
        (against or reserved).insert(0, text)
    if against and made.triad is not None:
        against.append("So the magnetometer is not corrected: the file has no matrix of it.")
    use: Use = "not fit" if against else "fit with reservations" if reserved else "fit"
    return FieldVerdict(use, (*against, *reserved, *_in_favour(made)), tuple(remarks))


def _of_sizes(made: Magnetometer) -> list[_Limit]:
    """Limits of what the corrected field is off by, of what was left out, and of what checks it."""
    by_holds, total = made.method != "ellipsoid", float(np.hypot(made.scatter, made.uncertainty))
    why = "too few directions were shown, or the magnetometer is too noisy. Record more holds"
    if made.scatter > made.uncertainty:
        where = "from hold to hold" if by_holds else "from direction to direction"
        why = (
            f"it differs {where} by {percent(made.scatter)} (one sigma), so it is not uniform here. Record at one "
            "place, away from iron, and turn the unit about its own middle"
        )
    off = f"The corrected field is uncertain by {percent(total)} of its norm: {why}."
    left = 0.0 if made.ellipsoid is None else made.ellipsoid.left_out
    left = len(made.left_out) / max(len(made.holds), 1) if by_holds else left
    rest = f"{percent(left)} of what was recorded contradicts the rest"
    many = f"{rest}: the field is not one field. Record away from iron and currents."
    some = f"{rest} and was left out: iron or a current is near."
    checks, few = (
        made.degrees_of_freedom,
        "observations of the field check the others: record twelve holds or more.",
    )
    moving = "" if made.moving is None else _moving_words(made, made.moving)
    moved = 0.0 if made.moving is None else made.moving.share
    return [
        ("not fit", total, USABLE, _ANY, off),
        ("reserved", total, GOOD, USABLE, off),
        ("not fit", moved, USABLE, _ANY, moving),
        ("reserved", moved, 0.0, USABLE, moving),
        ("not fit", left, MANY_LEFT_OUT, _ANY, many),
        ("reserved", left, FEW_LEFT_OUT, MANY_LEFT_OUT, some),
        ("not fit", by_holds * (LEAST_CHECKS - checks), 0.0, _ANY, f"Only {checks} {few}"),
        ("reserved", not by_holds, 0.0, _ANY, next(iter(made.not_determined), "")),
    ]


def _of_scale(made: Magnetometer) -> list[_Limit]:
    """Limits of the field's norm and of the mean scale factor against the unit's own, mirrored or not."""
    judged, given, factor = not made.norm_known, made.given, magnetic_field_factor(made.raw_unit)
    scale, bent, given_norm, given_dip = 1.0, 0.0, 0.0, 0.0
    if given is not None:
        given_norm, given_dip = given.norm, given.dip or 0.0
        bent = abs(given.off(made.dip, made.dip_sigma)) if made.triad is not None else 0.0
    if made.triad is not None and given is not None and factor is not None:
        scale = float(np.cbrt(abs(np.linalg.det(made.triad.matrix)))) * factor
    local = made.field_unit == LOCAL
    beyond = max(WEAKEST / made.norm, made.norm / STRONGEST) if judged and not local else 0.0
    of_unit = max(SMALLEST_SCALE / max(scale, 1e-300), scale / LARGEST_SCALE)
    off = abs(scale - 1.0) if of_unit <= 1.0 else 0.0
    norm = (
        f"The norm of the field is {1e6 * made.norm:.0f} µT in the recording's unit, and the Earth's is 22 to 67 µT. "
        "The unit is another one (--units), or a magnet is near."
    )
    unit = (
        f"The mean scale factor is {scale:.3g} of what the unit {made.raw_unit} says: the unit is another one "
        "(--units), or the norm is not that of this place (--field)."
    )
    place = (
        f"The mean scale factor is {scale:.2f} of what the unit {made.raw_unit} says: the norm that was given is not "
        "that of this place, or the unit is another one (--units)."
    )
    free = (
        "The magnetometer's unit and the field's norm are not known: the corrected field is in units of the local "
        "field, whose norm is one. Give --field NORM to have it in µT."
    )
    plate = (
        "The field's norm was not given: it is taken from the mean scale of the magnetometer's own unit, known to 5 %. "
        "Scale factors are much better known against one another; --field NORM makes them absolute."
    )
    curved = (
        f"The dip of the field is {degrees(made.dip)} and {degrees(given_dip)} was given: the field is bent here, as "
        f"in buildings. Its norm may be off as much: its uncertainty counts as {percent(made.norm_sigma / made.norm)}."
    )
    own = (
        f"By the magnetometer's own unit the norm of the field is {1e6 * scale * given_norm:.1f} µT, and "
        f"{1e6 * given_norm:.1f} µT was given: the field here or the scale is another one."
    )
    return [
        ("not fit", beyond, 1.0, _ANY, norm),
        ("not fit", of_unit, 1.0, _ANY, unit),
        ("reserved", off, OFF_NORM, _ANY, place),
        ("remark", local, 0.0, _ANY, free),
        ("remark", judged and not local, 0.0, _ANY, plate),
        ("remark", bent, 0.0, OFF_DIP, curved),
        ("remark", off, USUAL_SCALE, OFF_NORM, own),
    ]


def _of_dip(made: Magnetometer, latitude: float | None) -> list[_Limit]:
    """Limits of the dip, which shows mirrored axes where the place or its dip is known: in the north it is down."""
    dip, given_dip = made.dip, None if made.given is None else made.given.dip
    sure, by_holds = latitude is not None and abs(latitude) > SURE_DIP, made.method != "ellipsoid"
    off = 0.0
    mirrored, known = sure and latitude is not None and latitude * dip < 0.0, ""
    if latitude is not None:
        known = f"at latitude {degrees(latitude)} it has the other sign"
    if made.given is not None and given_dip is not None and np.isfinite(dip):
        off, known = abs(dip - given_dip), f"the given dip is {degrees(given_dip)}"
        mirrored = abs(dip + given_dip) < OFF_DIP < off
    unknown, south = by_holds and not sure and given_dip is None, latitude is None and dip < 0.0
    upright = (
        f"The field dips by {degrees(dip)}, along gravity: these are the numbers of an accelerometer, or a magnetic "
        "pole is near. They show no heading."
    )
    reverse = (
        f"The field dips by {degrees(dip)}, and {known}: an axis of the magnetometer counts the wrong way, so that its "
        "axes are mirrored against the accelerometers'. Reverse all three: in --columns write -mx,-my,-mz for mx,my,mz."
    )
    elsewhere = (
        f"The dip of the field is {degrees(dip)} and {degrees(given_dip or 0.0)} was given: this is not the field of "
        "that place. Record away from iron, or correct --field."
    )
    unchecked = (
        "Whether the magnetometer's axes are mirrored against the accelerometers' is not checked: give --site, or the "
        "dip with --field."
    )
    southern = (
        f"A dip of {degrees(dip)} is that of the southern hemisphere. In the northern one an axis of the magnetometer "
        "counts the wrong way, and all headings are reversed: give --site or --field NORM,DIP."
    )
    return [
        ("not fit", abs(dip), UPRIGHT, _ANY, upright),
        ("not fit", mirrored, 0.0, _ANY, reverse),
        ("not fit", 0.0 if mirrored else off, OFF_DIP, _ANY, elsewhere),
        ("reserved", unknown and not south, 0.0, _ANY, unchecked),
        ("reserved", unknown and south, 0.0, _ANY, southern),
    ]


def _of_course(made: Magnetometer) -> list[_Limit]:
    """What else there is to know of axes, and of a field that is the same everywhere and always."""
    by_holds = made.method != "ellipsoid"
    axes = np.eye(3) if made.triad is None or not by_holds else nearest_axes(made.triad.matrix)
    along = [(int(np.argmax(np.abs(row))), float(row.sum())) for row in axes]
    named = ", ".join(
        f"{a} along {'−' * (sign < 0.0)}{'xyz'[k]}" for a, (k, sign) in zip("xyz", along, strict=True)
    )
    turned = f"The magnetometer's axes are other ones than the accelerometers': its {named}. The matrix turns them."
    uneven = (
        f"The field differs from hold to hold by {percent(made.scatter)} of its norm (one sigma): it is not quite "
        "uniform here, and the uncertainties count that."
    )
    stays = "No change of the magnetic field while recording was found."
    return [
        ("remark", not np.array_equal(axes, np.eye(3)), 0.0, _ANY, turned),
        ("remark", by_holds * made.scatter, UNEVEN, GOOD, uneven),
        ("remark", by_holds and made.moving is None, 0.0, _ANY, stays),
    ]


def _moving_words(made: Magnetometer, moving: Moving) -> str:
    """Return what is said of a field that moves."""
    size, where, cause = percent(moving.share), "in the room", "a current or iron nearby"
    if moving.where == "unit":
        where, cause = "on the unit itself (its hard iron)", "a current of the unit, or magnetised parts"
    how = f"drifts by {size} of its norm from start to end"
    if moving.before >= 0:
        time = next((h.time for h in made.holds if h.hold == moving.before), np.nan)
        how = f"changes by {size} of its norm after hold {moving.before + 1} (at {time:.0f} s)"
    return (
        f"The magnetic field {where} {how}, as with {cause}. The estimate takes the change into account. (A field that "
        f"stays is said to move in {percent(FALSE_ALARM)} of recordings.)"
    )


def _in_favour(made: Magnetometer) -> list[str]:
    if made.triad is None:
        return []
    after, before = percent(made.after), percent(made.before)
    said = [f"Corrected, its norm scatters by {after} ({before} before)."]
    if np.isfinite(made.dip):
        heading = np.degrees(made.uncertainty / max(abs(float(np.cos(made.dip))), 1e-3))
        said.append(
            f"A heading by the corrected field, level, is uncertain by {heading:.2g}° by the calibration, at a dip of "
            f"{degrees(made.dip)}."
        )
    return said


def percent(share: float) -> str:
    """Return a share in percent with two digits.

    Examples
    --------
    >>> percent(0.0123), percent(0.5)
    ('1.2 %', '50 %')
    """
    return f"{100.0 * share:.2g} %"


def degrees(angle: float) -> str:
    """Return an angle in degrees.

    Examples
    --------
    >>> degrees(0.5)
    '28.6°'
    """
    return f"{np.degrees(angle):.1f}°"
