"""Is a magnetometer's calibration fit for use? A verdict of its own, in plain words.

Holds are left out at a false-alarm rate of 1 % a recording, and a field that stays is said to move in 0.1 % of
recordings. All other reasons are sizes and no tests.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from tumble.calibration.magnetometer.estimate import LOCAL, NAME_PLATE, Magnetometer
from tumble.calibration.magnetometer.moving import FALSE_ALARM
from tumble.calibration.magnetometer.parameters import nearest_axes
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


@dataclass(frozen=True, slots=True)
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


def judge_magnetometer(made: Magnetometer, latitude: float | None = None) -> FieldVerdict:
    """Judge the calibration of a magnetometer.

    Parameters
    ----------
    made : what was found.
    latitude : rad, where it was recorded; None where nobody says.
    """
    against = _against(made, latitude)
    reserved = _reservations(made) + _hemisphere(made, latitude)
    if made.saturated:
        (against or reserved).insert(0, _saturated(made))
    use: Use = "not fit" if against else "fit with reservations" if reserved else "fit"
    if against and made.triad is not None:
        against.append("So the magnetometer is not corrected: the file has no matrix of it.")
    return FieldVerdict(use, (*against, *reserved, *_in_favour(made)), tuple(_remarks(made)))


def _against(made: Magnetometer, latitude: float | None) -> list[str]:
    said: list[str] = []
    if made.triad is None:
        return [
            *made.not_determined[:3],
            "So few directions do not determine the magnetometer: it is not corrected.",
        ]
    total = float(np.hypot(made.scatter, made.uncertainty))
    if total > USABLE:
        said.append(
            f"The corrected field is uncertain by {percent(total)} of its norm: {_why_uncertain(made)}."
        )
    if made.moving is not None and made.moving.share > USABLE:
        said.append(_moving_words(made))
    if _share_left_out(made) > MANY_LEFT_OUT:
        said.append(
            f"{percent(_share_left_out(made))} of what was recorded contradicts the rest: the field is not one field. "
            "Record away from iron and currents."
        )
    if made.method != "ellipsoid" and made.degrees_of_freedom < LEAST_CHECKS:
        said.append(
            f"Only {made.degrees_of_freedom} observations of the field check the others: record twelve holds or more."
        )
    return said + _impossible(made, latitude)


def _impossible(made: Magnetometer, latitude: float | None) -> list[str]:
    said: list[str] = []
    if made.field_unit != LOCAL and not made.norm_known and not WEAKEST < made.norm < STRONGEST:
        said.append(
            f"The norm of the field is {1e6 * made.norm:.0f} µT in the recording's unit, and the Earth's is 22 to 67 "
            "µT. The unit is another one (--units), or a magnet is near."
        )
    scale = _scale(made)
    if not SMALLEST_SCALE <= scale <= LARGEST_SCALE:
        said.append(
            f"The mean scale factor is {scale:.3g} of what the unit {made.raw_unit} says: the unit is another one "
            "(--units), or the norm is not that of this place (--field)."
        )
    if abs(made.dip) > UPRIGHT:
        said.append(
            f"The field dips by {degrees(made.dip)}, along gravity: these are the numbers of an accelerometer, or a "
            "magnetic pole is near. They show no heading."
        )
    given = made.given
    if given is not None and given.dip is not None and np.isfinite(made.dip):
        off = made.dip - given.dip
        if abs(made.dip + given.dip) < OFF_DIP < abs(off):
            said.append(_mirrored(f"the given dip is {degrees(given.dip)}", made))
        elif abs(off) > OFF_DIP:
            said.append(
                f"The dip of the field is {degrees(made.dip)} and {degrees(given.dip)} was given: this is not the "
                "field of that place. Record away from iron, or correct --field."
            )
    elif latitude is not None and abs(latitude) > SURE_DIP and latitude * made.dip < 0.0:
        said.append(_mirrored(f"at latitude {degrees(latitude)} it has the other sign", made))
    return said


def _mirrored(known: str, made: Magnetometer) -> str:
    return (
        f"The field dips by {degrees(made.dip)}, and {known}: an axis of the magnetometer counts the wrong way, so "
        "that its axes are mirrored against the accelerometers'. Reverse all three: in --columns write -mx,-my,-mz for "
        "mx,my,mz."
    )


def _saturated(made: Magnetometer) -> str:
    return (
        f"The magnetometer sticks at its limits: {'; '.join(made.saturated)}. Choose a larger range, or keep "
        "magnets away."
    )


def _reservations(made: Magnetometer) -> list[str]:
    said: list[str] = []
    if made.triad is None:
        return said
    total = float(np.hypot(made.scatter, made.uncertainty))
    if GOOD < total <= USABLE:
        said.append(
            f"The corrected field is uncertain by {percent(total)} of its norm: {_why_uncertain(made)}."
        )
    if made.moving is not None and made.moving.share <= USABLE:
        said.append(_moving_words(made))
    if FEW_LEFT_OUT < _share_left_out(made) <= MANY_LEFT_OUT:
        said.append(
            f"{percent(_share_left_out(made))} of what was recorded contradicts the rest and was left out: iron or "
            "a current is near."
        )
    if made.method == "ellipsoid":
        said.append(made.not_determined[0])
    scale = _scale(made)
    if abs(scale - 1.0) > OFF_NORM and SMALLEST_SCALE <= scale <= LARGEST_SCALE:
        said.append(
            f"The mean scale factor is {scale:.2f} of what the unit {made.raw_unit} says: the norm that was given "
            "is not that of this place, or the unit is another one (--units)."
        )
    return said


def _scale(made: Magnetometer) -> float:
    """The mean scale factor against the unit's own, mirrored or not; 1 where no norm or no unit makes it known."""
    factor = magnetic_field_factor(made.raw_unit)
    if made.triad is None or made.given is None or factor is None:
        return 1.0
    return float(np.cbrt(abs(np.linalg.det(made.triad.matrix)))) * factor


def _hemisphere(made: Magnetometer, latitude: float | None) -> list[str]:
    """That the sign of the field is a guess, where nobody says the place: in the north it points into the ground."""
    known = (made.given is not None and made.given.dip is not None) or (
        latitude is not None and abs(latitude) > SURE_DIP
    )
    if made.triad is None or made.method == "ellipsoid" or known:
        return []
    said = (
        "Whether the magnetometer's axes are mirrored against the accelerometers' is not checked: give --site, or the "
        "dip with --field."
    )
    if latitude is not None or not made.dip < 0.0:
        return [said]
    said = (
        f"A dip of {degrees(made.dip)} is that of the southern hemisphere. In the northern one an axis of the "
        "magnetometer counts the wrong way, and all headings are reversed: give --site or --field NORM,DIP."
    )
    return [said]


def _why_uncertain(made: Magnetometer) -> str:
    if made.scatter > made.uncertainty:
        where = "from hold to hold" if made.method != "ellipsoid" else "from direction to direction"
        return (
            f"it differs {where} by {percent(made.scatter)} (one sigma), so it is not uniform here. Record at one "
            "place, away from iron, and turn the unit about its own middle"
        )
    return "too few directions were shown, or the magnetometer is too noisy. Record more holds"


def _share_left_out(made: Magnetometer) -> float:
    if made.method == "ellipsoid":
        return 0.0 if made.ellipsoid is None else made.ellipsoid.left_out
    return len(made.left_out) / max(len(made.holds), 1)


def _moving_words(made: Magnetometer) -> str:
    """Return what is said of a field that moves."""
    moving = made.moving
    assert moving is not None
    where = "in the room" if moving.where == "room" else "on the unit itself (its hard iron)"
    cause = (
        "a current or iron nearby" if moving.where == "room" else "a current of the unit, or magnetised parts"
    )
    if moving.before < 0:
        how = f"drifts by {percent(moving.share)} of its norm from start to end"
    else:
        time = next((h.time for h in made.holds if h.hold == moving.before), np.nan)
        how = (
            f"changes by {percent(moving.share)} of its norm after hold {moving.before + 1} (at {time:.0f} s)"
        )
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
        across = max(abs(float(np.cos(made.dip))), 1e-3)
        heading = np.degrees(made.uncertainty / across)
        said.append(
            f"A heading by the corrected field, level, is uncertain by {heading:.2g}° by the calibration, at a dip of "
            f"{degrees(made.dip)}."
        )
    return said


def _remarks(made: Magnetometer) -> list[str]:
    said: list[str] = []
    if made.field_unit == LOCAL:
        said.append(
            "The magnetometer's unit and the field's norm are not known: the corrected field is in units of the local "
            "field, whose norm is one. Give --field NORM to have it in µT."
        )
    elif not made.norm_known:
        said.append(
            "The field's norm was not given: it is taken from the mean scale of the magnetometer's own unit, known to "
            "5 %. Scale factors are much better known against one another; --field NORM makes them absolute."
        )
    said += _against_given(made)
    if made.triad is not None and made.method != "ellipsoid":
        axes = nearest_axes(made.triad.matrix)
        if not np.array_equal(axes, np.eye(3)):
            named = ", ".join(
                f"{'xyz'[i]} along {'−' if row[np.argmax(np.abs(row))] < 0 else ''}{'xyz'[int(np.argmax(np.abs(row)))]}"
                for i, row in enumerate(axes)
            )
            said.append(
                f"The magnetometer's axes are other ones than the accelerometers': its {named}. The matrix turns them."
            )
    if made.method != "ellipsoid" and UNEVEN < made.scatter <= GOOD:
        said.append(
            f"The field differs from hold to hold by {percent(made.scatter)} of its norm (one sigma): it is not quite "
            "uniform here, and the uncertainties count that."
        )
    if made.moving is None and made.method != "ellipsoid":
        said.append("No change of the magnetic field while recording was found.")
    return said


def _against_given(made: Magnetometer) -> list[str]:
    """What a field that was given and the one that is found differ by, below what speaks against the calibration."""
    said: list[str] = []
    given = made.given
    off = 0.0 if given is None or made.triad is None else given.off(made.dip, made.dip_sigma)
    if given is not None and given.dip is not None and 0.0 < abs(off) <= OFF_DIP:
        said.append(
            f"The dip of the field is {degrees(made.dip)} and {degrees(given.dip)} was given: the field is bent here, "
            f"as in buildings. Its norm may be off as much: its uncertainty counts as "
            f"{percent(made.norm_sigma / made.norm)}."
        )
    scale = _scale(made)
    if USUAL_SCALE < abs(scale - 1.0) <= OFF_NORM and given is not None:
        said.append(
            f"By the magnetometer's own unit the norm of the field is {1e6 * scale * given.norm:.1f} µT, and "
            f"{1e6 * given.norm:.1f} µT was given: the field here or the scale is another one."
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
