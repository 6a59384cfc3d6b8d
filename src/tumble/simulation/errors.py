"""What is wrong with a simulated session: a record of it, and the YAML file that `simulate --errors` reads."""

from __future__ import annotations

import math
import os
from collections import defaultdict
from difflib import get_close_matches
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.arrays import AnyArray
from tumble.errors import UsageError
from tumble.files import number_of, read_yaml, reading
from tumble.records import dataclass
from tumble.simulation.sampling import Imperfections
from tumble.simulation.table import TableErrors
from tumble.simulation.two_axis import FixtureErrors
from tumble.units import DEGREE, MICRO_G

AXES = ("unit", "case")
# Norm (T), dip and declination (rad) where nobody says: those of central Europe, rounded.
EARTHS_FIELD = (49e-6, 65.0 * DEGREE, 4.0 * DEGREE)


@dataclass(frozen=True)
class SessionErrors:
    """What is wrong with a session beyond what is drawn from the grade of its unit.

    Attributes
    ----------
    placement : make the placement errors that the protocol's uncertainties allow.
    noise : add noise and converter.
    nonlinear : draw quadratic terms of the sheet's linearity, where it states one.
    wander : let biases wander within the run as the sheet's in-run stability says, where it states one.
    axes : "unit", b is the unit's own axes, or "case", forward, right, down of its case; the protocol
        then says how the columns, which stay the unit's own, are read.
    asymmetry : one sigma of every sensor's scale-factor asymmetry.
    imperfections : what the recording chain does.
    table : what is wrong with the table; the protocol that is written then has its display's angles.
    lever_arm_b : m, from the table's centre to the unit, (3,), or (3, 3) with a row for each accelerometer.
    fixture : quality of a two-axis fixture that makes the protocol's sequences: one sigma of each error, from
        which the session's seed draws those of one; None for no fixture.
    fixture_azimuth : rad, where its outer axis points, clockwise from north; the protocol that is written
        says so. None leaves it as the protocol has it.
    magnetic_field : norm (T), dip and declination (rad) of the field there; None takes those of central Europe.
    field_change : T and s: a current that is switched on, by how much it changes the field, and when.
    """

    placement: bool = True
    noise: bool = True
    nonlinear: bool = False
    wander: bool = False
    axes: str = "unit"
    asymmetry: float = 0.0
    imperfections: Imperfections = Imperfections()
    table: TableErrors | None = None
    lever_arm_b: AnyArray | None = None
    fixture: FixtureErrors | None = None
    fixture_azimuth: float | None = None
    magnetic_field: tuple[float, float, float] | None = None
    field_change: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check the numbers by the limits of the file's keys.

        Raises
        ------
        UsageError
            If one is none that a session has.
        """
        for key, (place, least, most) in _NUMBERS.items():
            group, _, name = place.rpartition(".")
            number = getattr(getattr(self, group, None) if group else self, name, None)
            # To SI and back a limit itself is rounded.
            if isinstance(number, int | float) and not least <= round(number / _si(key), 9) <= most:
                raise UsageError(f"{place}, {number:g} in SI: `{key}` is to be from {least:g} to {most:g}.")


# SI units in one of what a key ends with; the longer endings first.
_UNITS = {
    "deg_per_s": DEGREE,
    "mm_per_s": 1e-3,
    "arcsec": DEGREE / 3600.0,
    "percent": 1e-2,
    "mrad": 1e-3,
    "ppm": 1e-6,
    "deg": DEGREE,
    "ms": 1e-3,
    "ug": MICRO_G,
    "ut": 1e-6,
}
_SWITCHES = ("placement", "noise", "nonlinear", "wander")
# Where a number goes, and its limits in the key's unit.
_NUMBERS: dict[str, tuple[str, float, float]] = {
    "asymmetry_ppm": ("asymmetry", 0.0, 1e5),
    "jitter_ms": ("imperfections.jitter", 0.0, 1000.0),
    "sampling_jitter_ms": ("imperfections.sampling_jitter", 0.0, 1000.0),
    "dropped_percent": ("imperfections.dropped", 0.0, 50.0),
    "burst_samples": ("imperfections.burst", 1.0, 1e6),
    "angle_pulse_arcsec": ("imperfections.angle_increment", 0.0, 36_000.0),
    "velocity_pulse_mm_per_s": ("imperfections.velocity_increment", 0.0, 1000.0),
    "magnetic_field_ut": ("magnetic.norm", 0.0, 1e6),
    "magnetic_dip_deg": ("magnetic.dip", -90.0, 90.0),
    "magnetic_declination_deg": ("magnetic.declination", -180.0, 180.0),
    "field_change_ut": ("change.size", 0.0, 1e6),
    "field_change_at_s": ("change.since", 0.0, 1e9),
    "table_angle_arcsec": ("table.angle_sigma", 0.0, 36_000.0),
    "table_once_arcsec": ("table.once", 0.0, 36_000.0),
    "table_twice_arcsec": ("table.twice", 0.0, 36_000.0),
    "table_tilt_deg": ("table.axis_tilt", 0.0, 45.0),
    "table_wobble_arcsec": ("table.wobble", 0.0, 36_000.0),
    "table_ripple_ppm": ("table.ripple", 0.0, 500_000.0),
    "table_ripple_cycles": ("table.ripple_cycles", 1.0, 1e6),
    "table_ramps_percent": ("table.ramp_spread", 0.0, 50.0),
    "table_shake_ug": ("table.shake", 0.0, 100_000.0),
    "fixture_azimuth_deg": ("fixture_azimuth", -360.0, 360.0),
    "fixture_installation_mrad": ("fixture.installation", 0.0, 100.0),
    "fixture_orthogonality_mrad": ("fixture.orthogonality", 0.0, 100.0),
    "fixture_zero_mrad": ("fixture.zero", 0.0, 100.0),
    "fixture_mounting_mrad": ("fixture.mounting", 0.0, 100.0),
    "fixture_execution_mrad": ("fixture.execution", 0.0, 100.0),
    "fixture_rate_deg_per_s": ("fixture.rate", 0.1, 5000.0),
    "fixture_ramp_s": ("fixture.ramp", 0.0, 600.0),
    "fixture_pause_s": ("fixture.pause", 0.0, 600.0),
}
_OTHERS = {"table_stops_percent": "table.stops_early", "table_lever_arm_cm": "lever_arm_b"}
KEYS = (*_SWITCHES, "axes", *_NUMBERS, *_OTHERS)
"""Of the file: each ends with its unit."""


def read_errors(path: str | os.PathLike[str]) -> SessionErrors:
    """Read what is wrong with a session.

    Parameters
    ----------
    path : of a YAML file, a key of `KEYS` a line.

    Raises
    ------
    UsageError
        If it cannot be read, or says what no session has; the sentence names the key.
    """
    with reading(Path(path), "a file of errors", hint="docs/simulation.md shows one"):
        said = read_yaml(Path(path))
        if not isinstance(said, dict):
            raise ValueError("it has no line such as `table_wobble_arcsec: 5`")
        return _errors(cast("dict[object, object]", said))


def _errors(said: dict[object, object]) -> SessionErrors:
    """Sort what was said by what it is of: "" is the session."""
    of: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    for key, value in said.items():
        group, _, field = _place(str(key)).rpartition(".")
        of[group][field] = _checked(str(key), value)
    own, fixture, field, change = of[""], of["fixture"], of["magnetic"], of["change"]
    if field:
        usual = dict(zip(("norm", "dip", "declination"), EARTHS_FIELD, strict=True))
        own["magnetic_field"] = tuple((usual | field).values())
    if change:
        own["field_change"] = change.get("size", 0.0), change.get("since", 0.0)
    return SessionErrors(
        **own,
        imperfections=Imperfections(**of["imperfections"]),
        table=TableErrors(**of["table"]) if of["table"] else None,
        fixture=_fixture(**fixture) if fixture or "fixture_azimuth" in own else None,
    )


def _si(key: str) -> float:
    return next((si for unit, si in _UNITS.items() if key.endswith(f"_{unit}")), 1.0)


def _place(key: str) -> str:
    """Where a key's value goes: a field of the session, or group and field."""
    if key not in KEYS:
        near = get_close_matches(key.lower(), KEYS, 3)
        raise ValueError(
            f"it has no key `{key:.60}`; {'near it are' if near else 'there are'} {', '.join(near or KEYS)}"
        )
    return _NUMBERS[key][0] if key in _NUMBERS else _OTHERS.get(key, key)


def _checked(key: str, value: Any) -> Any:
    """What was said, in SI."""
    if key in _NUMBERS:
        _, least, most = _NUMBERS[key]
        number, whole = _number(value), key.endswith("_cycles")
        if not least <= number <= most or (whole and number % 1.0):
            kind = "whole number" if whole else "number"
            raise ValueError(f"`{key}: {value!s:.40}` is to be a {kind} from {least:g} to {most:g}")
        return int(number) if whole else number * _si(key)
    if key in _SWITCHES and not isinstance(value, bool):
        raise ValueError(f"`{key}: {value!s:.40}` is to be true or false")
    if key == "axes" and value not in AXES:
        raise ValueError(f"`axes: {value!s:.40}` is to be {' or '.join(AXES)}")
    special = {"table_stops_percent": _stops, "table_lever_arm_cm": _lever_arm}
    return special[key](value) if key in special else value


def _number(value: Any) -> float:
    try:
        return number_of(value)
    except ValueError:
        return math.nan


def _stops(said: Any) -> tuple[tuple[int, float], ...]:
    """Spins, counted from 1 in the file, and the share of the angle after which each stops."""
    spins = cast("dict[Any, Any]", said) if isinstance(said, dict) else {}
    found = [(spin, _number(percent)) for spin, percent in spins.items()]
    if not found or not all(type(spin) is int and spin > 0 and 0.0 < share < 100.0 for spin, share in found):
        raise ValueError(
            "`table_stops_percent` is to say of spins, counted from 1, after how many per cent of its angle each "
            "stops, such as {2: 60}"
        )
    return tuple((spin - 1, share / 100.0) for spin, share in found)


def _lever_arm(said: Any) -> AnyArray:
    arm = 1e-2 * np.array([_number(one) for one in cast("list[Any]", said)] if isinstance(said, list) else [])
    if arm.size not in (3, 9) or not np.all(np.abs(arm) <= 10.0):
        raise ValueError(
            "`table_lever_arm_cm` is to be three numbers in cm, such as [3, -2, 1], or nine, three for each "
            "accelerometer; each at most 1000"
        )
    return arm if arm.size == 3 else arm.reshape(3, 3)


def _fixture(
    installation: float = 0.0, zero: float = 0.0, mounting: float = 0.0, **others: float
) -> FixtureErrors:
    return FixtureErrors(
        heading=installation,
        tilt=(installation, installation),
        inner_zero=zero,
        outer_zero=zero,
        mounting=(mounting, mounting, mounting),
        **others,
    )
