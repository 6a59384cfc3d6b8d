"""Which unit each triad is in: declared by the user or the header and checked, or found from the numbers."""

from __future__ import annotations

from dataclasses import replace

from tumble.errors import RecordingError
from tumble.recording import content
from tumble.recording.columns import ColumnPlan, says_free_of_gravity
from tumble.recording.declared import DeclaredUnits
from tumble.recording.formats.table import RawTable
from tumble.recording.recording import Recording, Remark
from tumble.recording.unit_change import refuse_changed_force_unit, refuse_changed_rate_unit
from tumble.records import dataclass
from tumble.units import (
    COUNTS,
    angle_increment_factor,
    find_unit,
    known_units,
    velocity_increment_factor,
)

_PLAIN_NAMES = ("ax", "ay", "az", "gx", "gy", "gz")


@dataclass(frozen=True, slots=True)
class Interpretation:
    """What the columns of a table mean.

    Attributes
    ----------
    plan : which column is what.
    time_unit : unit of the stamps, or None without stamps.
    specific_force_unit, angular_rate_unit : units of the recording.
    rate : nominal sampling rate in Hz.
    force_factor, rate_factor : what the columns are multiplied with: 1, or for increments the factor
        that turns them into SI rates.
    remarks : how all this was found.
    magnetic_field_unit : unit of the magnetometer.
    field_hold : over how many rows the logger repeats each of its samples.
    """

    plan: ColumnPlan
    time_unit: str | None
    specific_force_unit: str
    angular_rate_unit: str
    rate: float
    force_factor: float = 1.0
    rate_factor: float = 1.0
    remarks: tuple[Remark, ...] = ()
    magnetic_field_unit: str = COUNTS
    field_hold: int = 1


def about_units(table: RawTable, plan: ColumnPlan, units: DeclaredUnits) -> list[Remark]:
    """Name the units of the header that are not known, where nobody declares the quantity.

    Parameters
    ----------
    table, plan, units : as read, which column is what, and what the user declares.
    """
    said: list[Remark] = []
    for quantity in dict.fromkeys(q for q, _, _ in plan.unknown_units):
        if getattr(units, quantity.replace(" ", "_")) is not None:
            continue
        name, unit = next((n, u) for q, n, u in plan.unknown_units if q == quantity)
        known = ", ".join(known_units(quantity))
        said.append(
            Remark(
                "assumed",
                f"{table.path.name}: the unit {unit!r} of {name!r} is no known unit of {quantity} ({known}), so it is "
                "passed over; say the right one with --units.",
            )
        )
    return said


def decide_force(
    recording: Recording,
    level: content.Level | None,
    decided: Interpretation,
    units: DeclaredUnits,
    table: RawTable,
) -> tuple[Interpretation, list[Remark]]:
    """Decide the accelerometer's unit: declared and checked, or guessed from its norm at rest.

    Parameters
    ----------
    recording, decided : raw, and what is decided so far.
    level : of the accelerometer at rest, where there is one.
    units, table : as declared; as read.

    Raises
    ------
    RecordingError
        If gravity contradicts the declared unit, the unit changes on the way, or the numbers look like increments.
    """
    if recording.specific_force is None or level is None:
        return decided, []
    name, rate = table.path.name, recording.rate
    refuse_changed_force_unit(level.two, name)
    unit = units.specific_force or decided.plan.specific_force_unit
    increment = units.velocity_increment or (unit and find_unit("velocity increment", unit))
    if increment is not None:
        factor = velocity_increment_factor(increment) * rate
        if level.at_rest and not content.is_increment(level.norm, rate, factor / rate, tolerance=0.3):
            raise RecordingError(
                f"{name}: {level.norm:.4g} {increment} at rest over {1 / rate:.4g} s would be "
                f"{level.norm * factor:.4g} m/s²: these are no velocity increments; leave {increment} out of "
                "--units, or check the rate."
            )
        text = f"Velocity increments in {increment} are divided by the sampling interval of {1 / rate:.6g} s."
        return replace(decided, specific_force_unit="m/s^2", force_factor=factor), [Remark("mended", text)]
    if unit is not None:
        content.check_specific_force_unit(level, unit, rate, name)
        return replace(decided, specific_force_unit=unit), []
    content.refuse_without_gravity(level, _free_name(table, decided.plan), name)
    unit, reason = content.guess_specific_force_unit(
        level, content.whole_numbers(recording.specific_force), rate
    )
    if unit == "increments":
        raise RecordingError(
            f"{name}: the accelerometer's columns look like velocity increments ({reason}); give --units "
            "m/s,rad "
            "(or m/s,deg) to convert them to rates, or --units counts if they are raw."
        )
    if unit == COUNTS and not level.norm > 0.0:
        reason = "its norm at rest is zero"
    return replace(decided, specific_force_unit=unit), [
        Remark("assumed", f"Specific force is taken as {unit}: {reason}.")
    ]


def _free_name(table: RawTable, plan: ColumnPlan) -> str | None:
    """Return the name of the accelerometer's first column if it says that gravity was taken out, else None."""
    if table.names is None or plan.specific_force is None or plan.said_by != "header":
        return None
    name = table.names[plan.specific_force[0][0]]
    return name if says_free_of_gravity(name) else None


def decide_rate(
    recording: Recording, decided: Interpretation, units: DeclaredUnits, table: RawTable
) -> tuple[Interpretation, list[Remark]]:
    """Decide the gyro's unit: declared and checked against gravity, or guessed.

    Parameters
    ----------
    recording, decided : the gyro raw, and what is decided so far.
    units, table : as declared; as read.

    Raises
    ------
    RecordingError
        If the turning of gravity contradicts the declared unit, or the unit changes on the way.
    """
    if recording.angular_rate is None:
        return decided, []
    name, rate = table.path.name, recording.rate
    refuse_changed_rate_unit(recording, name)
    unit = units.angular_rate or decided.plan.angular_rate_unit
    increment = units.angle_increment or (unit and find_unit("angle increment", unit))
    if increment is not None:
        factor = angle_increment_factor(increment) * rate
        text = f"Angle increments in {increment} are divided by the sampling interval of {1 / rate:.6g} s."
        converted = replace(recording, angular_rate=recording.angular_rate * factor)
        more = content.check_angular_rate_unit(converted, "rad/s", name)
        return replace(decided, angular_rate_unit="rad/s", rate_factor=factor), [
            Remark("mended", text),
            *more,
        ]
    if unit is None and units.specific_force == COUNTS:
        unit = COUNTS
    if unit is not None:
        return replace(decided, angular_rate_unit=unit), content.check_angular_rate_unit(
            recording, unit, name
        )
    plain = table.names is not None and {n.lower() for n in table.names} >= set(_PLAIN_NAMES)
    unit, remarks = content.guess_angular_rate_unit(recording, plain)
    return replace(decided, angular_rate_unit=unit), remarks
