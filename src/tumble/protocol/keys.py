"""The keys of a protocol file: what each means, its unit, what holds without it.

The reader takes from here which keys there are, the schema and the documentation what they are.
"""

from __future__ import annotations

from dataclasses import field, replace
from math import pi
from typing import Any

from tumble.protocol.steps import ASSUMED_RATE
from tumble.records import dataclass
from tumble.units import DEGREE

FORMAT, VERSION = "tumble protocol", 1
FRAME = "b: the unit's axes x, y, z, as the recording's columns name them; n: north, east, down"
ANGLES = "right-handed: positive is counter-clockwise for someone whom the axis points at"

ARC_SECOND = DEGREE / 3600.0
REVOLUTION = 2.0 * pi
PPM = 1e-6
MINUTE = 60.0

RAMP = 2.0
"""Seconds that a table takes to come to its rate, where the file does not say."""

_NUMBER: dict[str, Any] = {"type": "number"}
_POSITIVE: dict[str, Any] = {"type": "number", "exclusiveMinimum": 0}
_LEAST_0: dict[str, Any] = {"type": "number", "minimum": 0}
_TURN: dict[str, Any] = {"type": "number", "minimum": -360, "maximum": 360}
_TEXT: dict[str, Any] = {"type": "string"}
_STATED = r"^[0-9.eE]+ ?(±|\+/?-) ?[0-9.eE+-]+ ?(ppm|%)?$"
_SIGMA: dict[str, Any] = {"type": "number", "minimum": 0, "maximum": 180}


def _list(items: dict[str, Any], count: int) -> dict[str, Any]:
    return {"type": "array", "items": items, "minItems": count, "maxItems": count}


def _direction(*more: str) -> dict[str, Any]:
    words = [sign + axis for sign in ("", "+", "-") for axis in "xyz"]
    return {"oneOf": [{"enum": [*more, *words]}, _list(_NUMBER, 3)]}


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a protocol file.

    Attributes
    ----------
    words : what it says, for people.
    unit : of its number; empty where it has none.
    default : what holds without it, in words; empty where it has to be there.
    schema : JSON schema of its value.
    """

    words: str
    unit: str = ""
    default: str = ""
    schema: dict[str, Any] = field(default_factory=lambda: dict(_TEXT))


SITE = {
    "latitude_deg": Key(
        "geodetic latitude; gravity and the Earth's rotation follow from it",
        "°",
        "not known: then `gravity` is needed",
        {"type": "number", "minimum": -90, "maximum": 90},
    ),
    "height_m": Key(
        "height above the ellipsoid", "m", "500 ± 700", {"type": "number", "minimum": -500, "maximum": 10000}
    ),
    "gravity": Key(
        "gravity there, where it is known better than from the latitude",
        "m/s²",
        "normal gravity of the latitude and height",
        {"type": "number", "minimum": 9.75, "maximum": 9.85},
    ),
    "gravity_uncertainty": Key(
        "its standard uncertainty",
        "m/s²",
        "of a gravity given, half of its last digit over √3; of normal gravity by the height, 0.0003 and more",
        {"type": "number", "minimum": 0},
    ),
    "source": Key("where the gravity is from, in words", default="a sentence that says which of the above"),
}
_COMMON = {
    "file": Key(
        "the recording that this step is in, relative to the protocol's own folder; steps one after another "
        "may share one",
        default="in those of `recordings`, or of the command",
    ),
    "interval_s": Key(
        "[start, stop] of the step on the recording's clock, in the order of the steps",
        "s",
        "found in the recording",
        _list(_NUMBER, 2),
    ),
}
_NAME: dict[str, Any] = {"type": ["string", "null"]}
_SECONDS = Key(
    "how long the step takes", "s", "the length of `interval_s`; one of the two is needed", _POSITIVE
)
HOLD = {
    "hold": Key("the step's name", default="empty", schema=_NAME),
    "up": Key(
        "what points up, against gravity: `x`, `-y`, or a direction in b such as `[1, 1, 0]`, of any length",
        default="nothing is known of the pose",
        schema=_direction(),
    ),
    "heading_deg": Key(
        "turn about the vertical, clockwise seen from above, from where the shortest turn brings `up` up",
        "°",
        "not known",
        _TURN,
    ),
    "attitude_deg": Key(
        "[roll, pitch, heading] of b against north, east, down (z-y-x), instead of `up` and `heading_deg`",
        "°",
        "see `up`",
        _list(_TURN, 3),
    ),
    "uncertainty_deg": Key("standard uncertainty of the pose about each axis", "°", "0 (exact)", _SIGMA),
    "seconds": _SECONDS,
    **_COMMON,
}
TURN = {
    "turn": Key("the step's name", default="empty", schema=_NAME),
    "axis": Key("what it is turned about: `x`, `-y`, or a direction in b", "", "not known", _direction()),
    "angle_deg": Key("angle about the axis, up to a whole turn", "°", "not known", _TURN),
    "revolutions": Key("instead of `angle_deg`, of any size", "turns", "see `angle_deg`", _NUMBER),
    "uncertainty_deg": Key("standard uncertainty of the angle", "°", "0 (exact)", _SIGMA),
    "seconds": _SECONDS,
    **_COMMON,
}
SPIN = {
    "spin": Key("the step's name", default="empty", schema=_NAME),
    "axis": Key(
        "the table's axis: `up` for the vertical, or `x`, `-y`, a direction in b",
        "",
        "up",
        _direction("up"),
    ),
    "rate_deg_per_s": Key("constant rate against the Earth; negative is clockwise", "°/s", "", _NUMBER),
    "seconds": Key(
        "how long the rate is constant", "s", "from `revolutions`; else the length of `interval_s`", _POSITIVE
    ),
    "revolutions": Key(
        "how many revolutions at the constant rate, instead of `seconds`", "turns", "see `seconds`", _POSITIVE
    ),
    "ramp_s": Key("how long it takes to come to the rate, and to stop", "s", f"{RAMP:g}", _LEAST_0),
    "uncertainty_ppm": Key(
        "standard uncertainty of the rate, common to all spins of the table",
        "ppm of it",
        f"{ASSUMED_RATE / PPM:g} is assumed, and said",
        {"type": "number", "minimum": 0},
    ),
    "angle_deg": Key(
        "what the table's display says it turned, from rest to rest with both ramps, of any size, "
        "with the sign of the rate",
        "°",
        "not read",
        _NUMBER,
    ),
    "angle_uncertainty_arcsec": Key("standard uncertainty of that angle", "″", "0 (exact)", _LEAST_0),
    **_COMMON,
}
_CELSIUS: dict[str, Any] = {"type": "number", "minimum": -200, "maximum": 300}
SOAK = {
    "soak": Key("the step's name", default="empty", schema=_NAME),
    "temperature_celsius": Key("what the surroundings are brought to", "°C", "", _CELSIUS),
    "tolerance_k": Key("how near the unit has to come to it for the soak to be done", "K", "1", _POSITIVE),
    "seconds": replace(_SECONDS, words="from when the former temperature is left until the next step"),
    **_COMMON,
}
RAMP_STEP = {
    "ramp": Key("the step's name", default="empty", schema=_NAME),
    "from_celsius": Key("temperature of the surroundings at its beginning", "°C", "", _CELSIUS),
    "to_celsius": Key("at its end", "°C", "", _CELSIUS),
    "rate_k_per_min": Key(
        "how fast it goes, without a sign, instead of `seconds`", "K/min", "see `seconds`", _POSITIVE
    ),
    "seconds": Key(
        "how long it takes", "s", "from `rate_k_per_min`; else the length of `interval_s`", _POSITIVE
    ),
    "tumble_every_s": Key(
        "so often the unit is turned to another pose meanwhile",
        "s",
        "it rests in the pose of the hold before",
        _POSITIVE,
    ),
    **_COMMON,
}
KINDS = {"hold": HOLD, "turn": TURN, "spin": SPIN, "soak": SOAK, "ramp": RAMP_STEP}
PROTOCOL = {
    "format": Key(f"`{FORMAT}`"),
    "version": Key("of the format", default=f"{VERSION}"),
    "name": Key("what the protocol is called", default="that of `like`, or the file's"),
    "procedure": Key(
        "the [procedure](procedures/index.md) that evaluates it", default="that of `like`; else needed"
    ),
    "description": Key("for people", default="that of `like`, or empty"),
    "site": Key("where it is performed: see below"),
    "gravity": Key(
        "instead of `site`, where nothing else is known of it", "m/s²", "see `site`", SITE["gravity"].schema
    ),
    "frame": Key("the sentence that says which frames are meant; no other is known", default="that sentence"),
    "angles": Key("the sentence that says which way is positive; no other is known", default="that sentence"),
    "recordings": Key(
        "list of the files that were recorded, in order, relative to the protocol's own folder",
        default="none, or those of the steps",
    ),
    "units": Key("of those files, as `--units` takes them", default="as the files say"),
    "columns": Key("of those files, as `--columns` takes them", default="as the files say"),
    "rate_hz": Key(
        "sampling rate of files without stamps, or of any with its standard uncertainty, as `100±0.1` or `100±50ppm`",
        "Hz",
        "as the stamps say",
        {"oneOf": [_POSITIVE, {"type": "string", "pattern": _STATED}]},
    ),
    "like": Key("a named protocol whose steps are meant, instead of `steps`", default="see `steps`"),
    "steps": Key("list of holds, turns, spins, soaks and ramps, in order", default="those of `like`"),
}
