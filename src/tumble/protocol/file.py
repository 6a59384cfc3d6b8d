"""Protocol files: YAML for people, read with the line of every mistake, written so that it reads back.

Angles are degrees and times are seconds, as people write them; keys that hold degrees end in ``_deg``.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import Vector
from tumble.earth.site import Site
from tumble.errors import ProtocolError, SiteError
from tumble.protocol.library import PROTOCOLS, named_protocol
from tumble.protocol.steps import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep
from tumble.protocol.yaml_nodes import Source, compose, mapping, number, numbers, sequence, text

FORMAT, VERSION = "tumble protocol", 1
FRAME = "b: the unit's axes x, y, z, as the recording's columns name them; n: north, east, down"
ANGLES = "right-handed: positive is counter-clockwise for someone whom the axis points at"
_DEGREE = math.pi / 180.0

KEYS = {
    "format": f"`{FORMAT}`, always",
    "version": f"{VERSION}",
    "name": "what the protocol is called",
    "procedure": "the procedure that evaluates it",
    "description": "for people",
    "site": "where: a mapping of latitude_deg, height_m, gravity, gravity_uncertainty",
    "frame": "the sentence that says which frames are meant; no other is known",
    "angles": "the sentence that says which way is positive; no other is known",
    "recordings": "list of the files that were recorded, relative to this file",
    "units": "of those files, as --units takes them",
    "columns": "of those files, as --columns takes them",
    "rate_hz": "sampling rate in Hz of files without stamps",
    "like": "a named protocol whose steps and procedure are meant, instead of steps",
    "steps": "list of holds, turns and spins in order",
}
SITE_KEYS = {
    "latitude_deg": "geodetic latitude, degrees",
    "height_m": "height above the ellipsoid, metres; 0 by default",
    "gravity": "m/s², where a survey knows it; without it that of the latitude is taken",
    "gravity_uncertainty": "m/s², standard uncertainty of the gravity given; 0 by default",
}
_COMMON = {
    "seconds": "how long the step takes",
    "file": "the recording of this step alone, relative to this file",
    "interval_s": "[start, stop] of the step on the recording's clock, seconds",
}
HOLD_KEYS = {
    "hold": "the step's name, may be empty",
    "up": "what points up: x, -y, or a direction [1, 1, 0] in b; nothing is known of the pose without it",
    "heading_deg": "degrees clockwise about the vertical, if it is known; see the conventions",
    "attitude_deg": "[roll, pitch, heading] of b against north, east, down (z-y-x), instead of up",
    "uncertainty_deg": "standard uncertainty of the pose about each axis; 0 (exact) by default",
    **_COMMON,
}
TURN_KEYS = {
    "turn": "the step's name, may be empty",
    "axis": "x, -y, or a direction in b, if it is known",
    "angle_deg": "degrees about the axis, -360 to 360",
    "revolutions": "instead of angle_deg, of any size",
    "uncertainty_deg": "standard uncertainty of the angle; 0 (exact) by default",
    **_COMMON,
}
SPIN_KEYS = {
    "spin": "the step's name, may be empty",
    "axis": "up (the vertical, by default), x, -y, or a direction in b",
    "rate_deg_per_s": "constant rate against the Earth about the axis; negative is clockwise",
    "revolutions": "how many at the constant rate, instead of seconds",
    "ramp_s": "seconds to come to the rate, and to stop; 2 by default",
    "uncertainty_ppm": "standard uncertainty of the rate; 0 (exact) by default",
    **_COMMON,
}
KINDS = {"hold": HOLD_KEYS, "turn": TURN_KEYS, "spin": SPIN_KEYS}


def read_protocol(path: str | os.PathLike[str]) -> Protocol:
    """Read a protocol file.

    Parameters
    ----------
    path : of the YAML file.

    Raises
    ------
    ProtocolError
        If it is no protocol file, or something in it is wrong; the message names the line and the step.
    """
    file = Path(path)
    try:
        content = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = "it is not text" if isinstance(error, UnicodeDecodeError) else (error.strerror or str(error))
        raise ProtocolError(f"{file} cannot be read as a protocol: {why}.") from None
    source = Source(file)
    root = compose(file, content)
    if root.id != "mapping" or not any(str(key.value) == "format" for key, _ in root.value):
        raise ProtocolError(f"{file} is not a protocol: it does not begin with `format: {FORMAT}`.")
    keys = mapping(source, root, "The protocol", tuple(KEYS))
    _check_head(source, keys)
    return _protocol(source, root, keys)


def _check_head(source: Source, keys: dict[str, Any]) -> None:
    found = text(source, keys["format"], "format")
    if found != FORMAT:
        raise source.error(keys["format"], f"the format is {found!r}, and this reads {FORMAT!r}.")
    if "version" in keys:
        version = number(source, keys["version"], "version", least=1)
        if version > VERSION:
            raise source.error(
                keys["version"],
                f"the version is {version:g} and this tumble reads up to {VERSION}: update tumble.",
            )
    for key, sentence in (("frame", FRAME), ("angles", ANGLES)):
        if key in keys and text(source, keys[key], key) != sentence:
            raise source.error(
                keys[key], f"{key} is no convention that is known; leave it out, or write: {sentence}"
            )


def _protocol(source: Source, root: Any, keys: dict[str, Any]) -> Protocol:
    like = None
    if "like" in keys:
        name = text(source, keys["like"], "like")
        if name not in PROTOCOLS:
            raise source.error(
                keys["like"], f"there is no named protocol {name!r}; there are {', '.join(PROTOCOLS)}."
            )
        if "steps" in keys:
            raise source.error(keys["steps"], "give `steps` or `like`, not both.")
        like = named_protocol(name)
    elif "steps" not in keys:
        raise source.error(root, "there are no steps: write `steps:`, or `like:` with a named protocol.")

    def said(key: str) -> str | None:
        return text(source, keys[key], key) or None if key in keys else None

    procedure = said("procedure") or (like.procedure if like else None)
    if procedure is None:
        raise source.error(root, "the procedure is missing: write `procedure: multi-position` or another.")
    recordings = [
        text(source, node, "A recording")
        for node in (sequence(source, keys["recordings"], "recordings") if "recordings" in keys else [])
    ]
    return Protocol(
        name=said("name") or (like.name if like else source.path.stem),
        procedure=procedure,
        steps=like.steps if like else _steps(source, keys["steps"]),
        site=_site(source, root, keys),
        description=said("description") or (like.description if like else ""),
        recordings=tuple(recordings),
        units=said("units"),
        columns=said("columns"),
        rate=number(source, keys["rate_hz"], "rate_hz", above=0.0) if "rate_hz" in keys else None,
    )


def _site(source: Source, root: Any, keys: dict[str, Any]) -> Site:
    if "site" not in keys:
        raise source.error(
            root,
            "the site is missing: write `site:` with `latitude_deg:` and `height_m:` below it, or `gravity:` in m/s².",
        )
    node = keys["site"]
    found = mapping(source, node, "The site", tuple(SITE_KEYS))
    height = number(source, found["height_m"], "height_m") if "height_m" in found else 0.0
    try:
        if "latitude_deg" not in found:
            if "gravity" not in found:
                raise source.error(node, "the site has neither `latitude_deg:` nor `gravity:`.")
            place = Site.from_gravity(number(source, found["gravity"], "gravity"))
        else:
            latitude = number(source, found["latitude_deg"], "latitude_deg", least=-90.0, most=90.0)
            place = Site.from_latitude(latitude * _DEGREE, height)
            if "gravity" in found:
                local = Site.from_gravity(number(source, found["gravity"], "gravity"))
                place = Site(local.gravity, 0.0, place.latitude, height, local.source)
    except SiteError as error:
        raise source.error(node, str(error)) from None
    if "gravity_uncertainty" in found:
        sigma = number(source, found["gravity_uncertainty"], "gravity_uncertainty", least=0.0)
        place = Site(place.gravity, sigma, place.latitude, place.height, place.source)
    return place


def _steps(source: Source, node: Any) -> tuple[Step, ...]:
    nodes = sequence(source, node, "steps")
    if not nodes:
        raise source.error(node, "there are no steps: a protocol has at least one hold.")
    steps: list[Step] = []
    stopped: dict[str | None, float] = {}
    for count, item in enumerate(nodes, 1):
        step = _step(source, item, count)
        if isinstance(step, SpinStep) and not any(isinstance(s, HoldStep) for s in steps):
            raise source.error(
                item, f"step {count} is a spin without a hold before it: the unit rests before it is spun."
            )
        if step.interval is not None:
            if step.interval[0] < stopped.get(step.file, -math.inf):
                raise source.error(
                    item,
                    f"step {count} begins at {step.interval[0]:g} s, before the one above it stops: put them in order.",
                )
            stopped[step.file] = step.interval[1]
        steps.append(step)
    if not any(isinstance(step, HoldStep) for step in steps):
        raise source.error(node, "there is no hold among the steps: at least one pose is held.")
    return tuple(steps)


def _step(source: Source, node: Any, count: int) -> Step:
    where = f"Step {count}"
    if node.id != "mapping":
        raise source.error(node, f"{where} is to begin with `hold:`, `turn:` or `spin:`.")
    kinds = [str(key.value) for key, _ in node.value if str(key.value) in KINDS]
    if len(kinds) != 1:
        first = str(node.value[0][0].value) if node.value else "nothing"
        what = f"is {' and '.join(kinds)} at once" if kinds else f"begins with {first!r}"
        raise source.error(node, f"{where} {what}: a step is a `hold:`, a `turn:` or a `spin:`.")
    kind = kinds[0]
    keys = mapping(source, node, f"{where} ({kind})", tuple(KINDS[kind]))
    name = text(source, keys[kind], f"{where}: {kind}")
    common: dict[str, Any] = {
        "name": name,
        "file": _file(source, keys, where),
        "interval": _interval(source, keys, where),
    }
    where = f"{where} ({name or kind}): "
    if kind == "hold":
        return HoldStep(_seconds(source, keys, node, where), _pose(source, keys, where), **common)
    return (
        _turn(source, keys, node, where, common)
        if kind == "turn"
        else _spin(source, keys, node, where, common)
    )


def _seconds(source: Source, keys: dict[str, Any], node: Any, where: str) -> float:
    if "seconds" not in keys:
        raise source.error(node, f"{where}`seconds:` is missing: how long it takes.")
    return number(source, keys["seconds"], f"{where}seconds", above=0.0)


def _file(source: Source, keys: dict[str, Any], where: str) -> str | None:
    return text(source, keys["file"], f"{where}: file") or None if "file" in keys else None


def _interval(source: Source, keys: dict[str, Any], where: str) -> tuple[float, float] | None:
    if "interval_s" not in keys:
        return None
    start, stop = numbers(source, keys["interval_s"], f"{where}: interval_s", 2)
    if stop <= start:
        raise source.error(
            keys["interval_s"], f"{where}: the interval ends at {stop:g} s, not after {start:g} s."
        )
    return start, stop


def _pose(source: Source, keys: dict[str, Any], where: str) -> Pose | None:
    sigma = 0.0
    if "uncertainty_deg" in keys:
        sigma = (
            number(source, keys["uncertainty_deg"], f"{where}uncertainty_deg", least=0.0, most=180.0)
            * _DEGREE
        )
    if "attitude_deg" in keys:
        if "up" in keys or "heading_deg" in keys:
            raise source.error(keys["attitude_deg"], f"{where}give `attitude_deg` or `up`, not both.")
        roll, pitch, heading = numbers(source, keys["attitude_deg"], f"{where}attitude_deg", 3)
        for value in (roll, pitch, heading):
            _within_a_turn(source, keys["attitude_deg"], f"{where}attitude_deg", value)
        return Pose.from_rotation(Rotation.from_euler("ZYX", [heading, pitch, roll], degrees=True), sigma)
    if "up" not in keys:
        for key in ("heading_deg", "uncertainty_deg"):
            if key in keys:
                raise source.error(keys[key], f"{where}{key} says nothing without `up:`.")
        return None
    heading = None
    if "heading_deg" in keys:
        value = number(source, keys["heading_deg"], f"{where}heading_deg")
        _within_a_turn(source, keys["heading_deg"], f"{where}heading_deg", value)
        heading = value * _DEGREE
    return Pose(_direction(source, keys["up"], f"{where}up"), heading, sigma)


def _within_a_turn(source: Source, node: Any, where: str, degrees: float) -> None:
    if abs(degrees) > 360.0:
        raise source.error(node, f"{where} is {degrees:g}°, beyond a whole turn of 360°.")


def _direction(source: Source, node: Any, where: str) -> Vector:
    if node.id == "scalar":
        word = text(source, node, where)
        axis = word.lstrip("+-")
        if axis not in ("x", "y", "z") or len(word) - len(axis) > 1:
            raise source.error(
                node, f"{where} is {word!r}, and is to be x, -y or the like, or a direction [1, 1, 0]."
            )
        vector = np.zeros(3)
        vector["xyz".index(axis)] = -1.0 if word.startswith("-") else 1.0
        return vector
    vector = np.array(numbers(source, node, where, 3))
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise source.error(node, f"{where} is [0, 0, 0], which is no direction.")
    # What was written as a unit vector stays as it is to the last digit.
    return vector if abs(length - 1.0) < 1e-12 else vector / length


def _turn(source: Source, keys: dict[str, Any], node: Any, where: str, common: dict[str, Any]) -> TurnStep:
    axis = _direction(source, keys["axis"], f"{where}axis") if "axis" in keys else None
    angle = None
    if "angle_deg" in keys and "revolutions" in keys:
        raise source.error(keys["revolutions"], f"{where}give `angle_deg` or `revolutions`, not both.")
    if "angle_deg" in keys:
        value = number(source, keys["angle_deg"], f"{where}angle_deg")
        if abs(value) > 360.0:
            raise source.error(
                keys["angle_deg"],
                f"{where}angle_deg is {value:g}°, beyond a whole turn of 360°: write more than one as `revolutions:`.",
            )
        angle = value * _DEGREE
    elif "revolutions" in keys:
        angle = number(source, keys["revolutions"], f"{where}revolutions") * 2.0 * math.pi
    if (axis is None) != (angle is None):
        missing = "axis" if axis is None else "angle_deg"
        raise source.error(node, f"{where}`{missing}:` is missing: an axis and an angle go together.")
    sigma = 0.0
    if "uncertainty_deg" in keys:
        sigma = (
            number(source, keys["uncertainty_deg"], f"{where}uncertainty_deg", least=0.0, most=360.0)
            * _DEGREE
        )
    return TurnStep(_seconds(source, keys, node, where), axis, angle, sigma, **common)


def _spin(source: Source, keys: dict[str, Any], node: Any, where: str, common: dict[str, Any]) -> SpinStep:
    if "rate_deg_per_s" not in keys:
        raise source.error(node, f"{where}`rate_deg_per_s:` is missing.")
    rate = number(source, keys["rate_deg_per_s"], f"{where}rate_deg_per_s") * _DEGREE
    if rate == 0.0:
        raise source.error(keys["rate_deg_per_s"], f"{where}a rate of 0 is no spin: write a hold.")
    if ("seconds" in keys) == ("revolutions" in keys):
        raise source.error(
            node, f"{where}give `seconds:` or `revolutions:` at the constant rate, one of them."
        )
    if "revolutions" in keys:
        turns = number(source, keys["revolutions"], f"{where}revolutions", above=0.0)
        duration = turns * 2.0 * math.pi / abs(rate)
    else:
        duration = _seconds(source, keys, node, where)
    axis = None
    if "axis" in keys and not (keys["axis"].id == "scalar" and keys["axis"].value == "up"):
        axis = _direction(source, keys["axis"], f"{where}axis")
    sigma = 0.0
    if "uncertainty_ppm" in keys:
        sigma = number(source, keys["uncertainty_ppm"], f"{where}uncertainty_ppm", least=0.0) * 1e-6
    ramp = number(source, keys["ramp_s"], f"{where}ramp_s", above=0.0) if "ramp_s" in keys else 2.0
    return SpinStep(duration, rate, axis, sigma, ramp, **common)


def write_protocol(protocol: Protocol, path: str | os.PathLike[str]) -> None:
    """Write a protocol file beside `path`, then rename it there.

    Parameters
    ----------
    protocol : with a site, without which a file cannot be read again.
    path : of the YAML file.

    Raises
    ------
    ProtocolError
        If the protocol has no site.
    OutputError
        If it cannot be written; an earlier file is intact.
    """
    from tumble.errors import OutputError

    file, content = Path(path), protocol_to_yaml(protocol)
    beside = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        with beside.open("w", encoding="utf-8") as target:
            target.write(content)
            target.flush()
            os.fsync(target.fileno())
        beside.replace(file)
    except OSError as error:
        raise OutputError(f"{file} could not be written: {error.strerror or error}.") from error
    finally:
        beside.unlink(missing_ok=True)


def protocol_to_yaml(protocol: Protocol) -> str:
    """Return a protocol as the text of a file that reads back to the same protocol.

    Parameters
    ----------
    protocol : with a site.

    Raises
    ------
    ProtocolError
        If the protocol has no site.
    """
    if protocol.site is None:
        raise ProtocolError(
            f"The protocol {protocol.name} has no site: a file has to say where it is performed."
        )
    lines = [
        "# A protocol: what is done to the unit, step by step, and how well it is known.",
        "# tumble calibrate --protocol THIS-FILE evaluates what was recorded; tumble simulate THIS-FILE plays it.",
        f"format: {FORMAT}",
        f"version: {VERSION}",
        f"name: {_quoted(protocol.name)}",
        f"procedure: {_quoted(protocol.procedure)}",
    ]
    if protocol.description:
        lines.append(f"description: {_quoted(protocol.description)}")
    lines += _site_lines(protocol.site)
    lines += [f"frame: {_quoted(FRAME)}", f"angles: {_quoted(ANGLES)}"]
    if protocol.recordings:
        lines += ["recordings:", *(f"  - {_quoted(name)}" for name in protocol.recordings)]
    for key, value in (("units", protocol.units), ("columns", protocol.columns)):
        if value is not None:
            lines.append(f"{key}: {_quoted(value)}")
    if protocol.rate is not None:
        lines.append(f"rate_hz: {protocol.rate!r}")
    lines.append("steps:")
    for step in protocol.steps:
        entries = _entries(step)
        lines.append(f"  - {entries[0]}")
        lines += [f"    {entry}" for entry in entries[1:]]
    return "\n".join(lines) + "\n"


def _site_lines(site: Site) -> list[str]:
    lines = ["site:"]
    if site.latitude is not None:
        lines.append(f"  latitude_deg: {_in_units(site.latitude, _DEGREE)!r}")
        lines.append(f"  height_m: {float(site.height)!r}")
        if site == Site.from_latitude(site.latitude, site.height):
            return lines
    lines.append(f"  gravity: {float(site.gravity)!r}")
    if site.gravity_sigma:
        lines.append(f"  gravity_uncertainty: {float(site.gravity_sigma)!r}")
    return lines


def _in_units(value: float, factor: float) -> float:
    """Return the number that times the factor is `value` to the last digit, where there is one."""
    near = float(value) / factor
    for candidate in (near, math.nextafter(near, math.inf), math.nextafter(near, -math.inf)):
        if candidate * factor == value:
            # 45 rather than 45.00000000000001, where both mean the same.
            short = float(f"{candidate:.12g}")
            return short if short * factor == value else candidate
    return near


def _quoted(word: str) -> str:
    """Return a text as YAML's double-quoted scalar, which is JSON's; plain where nothing can be mistaken."""
    import json

    plain = word.replace("-", "").replace(" ", "").replace(".", "")
    return (
        word
        if plain.isascii() and plain.isalpha() and word == word.strip("- .")
        else json.dumps(word, ensure_ascii=False)
    )


def _entries(step: Step) -> list[str]:
    if isinstance(step, HoldStep):
        entries = [f"hold: {_quoted(step.name)}" if step.name else "hold:"]
        if step.pose is not None:
            entries.append(f"up: {_direction_text(step.pose.up_b)}")
            if step.pose.heading is not None:
                entries.append(f"heading_deg: {_in_units(step.pose.heading, _DEGREE)!r}")
            if step.pose.sigma:
                entries.append(f"uncertainty_deg: {_in_units(step.pose.sigma, _DEGREE)!r}")
        entries.append(f"seconds: {float(step.duration)!r}")
    elif isinstance(step, TurnStep):
        entries = [f"turn: {_quoted(step.name)}" if step.name else "turn:", *_turn_entries(step)]
    else:
        entries = [f"spin: {_quoted(step.name)}" if step.name else "spin:"]
        entries.append(f"axis: {'up' if step.axis_b is None else _direction_text(step.axis_b)}")
        entries.append(f"rate_deg_per_s: {_in_units(step.rate, _DEGREE)!r}")
        entries.append(f"seconds: {float(step.duration)!r}")
        entries.append(f"ramp_s: {float(step.ramp)!r}")
        if step.sigma:
            entries.append(f"uncertainty_ppm: {_in_units(step.sigma, 1e-6)!r}")
    if step.file is not None:
        entries.append(f"file: {_quoted(step.file)}")
    if step.interval is not None:
        entries.append(f"interval_s: [{float(step.interval[0])!r}, {float(step.interval[1])!r}]")
    return entries


def _turn_entries(step: TurnStep) -> list[str]:
    entries: list[str] = []
    if step.axis_b is not None and step.angle is not None:
        entries.append(f"axis: {_direction_text(step.axis_b)}")
        degrees = _in_units(step.angle, _DEGREE)
        if abs(degrees) <= 360.0:
            entries.append(f"angle_deg: {degrees!r}")
        else:
            entries.append(f"revolutions: {_in_units(step.angle, 2.0 * math.pi)!r}")
        if step.sigma:
            entries.append(f"uncertainty_deg: {_in_units(step.sigma, _DEGREE)!r}")
    return [*entries, f"seconds: {float(step.duration)!r}"]


def _direction_text(vector: Vector) -> str:
    """Return x, -y, [1, 1, 0] where that is the vector to the last digit, or its three numbers."""
    signs = np.sign(np.where(np.abs(vector) < 1e-12, 0.0, vector))
    if np.array_equal(signs / np.linalg.norm(signs), vector):
        if np.count_nonzero(signs) == 1:
            axis = int(np.flatnonzero(signs)[0])
            return f"{'-' if signs[axis] < 0 else ''}{'xyz'[axis]}"
        return "[" + ", ".join(str(int(v)) for v in signs) + "]"
    return "[" + ", ".join(repr(float(v)) for v in vector) + "]"


def protocol_schema() -> dict[str, Any]:
    """Return the JSON schema of a protocol file, for editors that check while one types."""
    number_type, text_type = {"type": "number"}, {"type": ["string", "null"]}
    direction = {
        "oneOf": [{"type": "string"}, {"type": "array", "items": number_type, "minItems": 3, "maxItems": 3}]
    }
    pair = {"type": "array", "items": number_type, "minItems": 2, "maxItems": 2}
    triple = {"type": "array", "items": number_type, "minItems": 3, "maxItems": 3}
    special: dict[str, dict[str, Any]] = {
        "up": direction,
        "axis": direction,
        "attitude_deg": triple,
        "interval_s": pair,
        "file": {"type": "string"},
        **dict.fromkeys(KINDS, text_type),
    }

    def step(kind: str) -> dict[str, Any]:
        properties = {
            key: {**special.get(key, number_type), "description": words} for key, words in KINDS[kind].items()
        }
        return {"type": "object", "properties": properties, "required": [kind], "additionalProperties": False}

    site = {key: {**number_type, "description": words} for key, words in SITE_KEYS.items()}
    strings: dict[str, dict[str, Any]] = {
        key: {"type": "string", "description": words} for key, words in KEYS.items()
    }
    strings["format"]["const"] = FORMAT
    strings["version"] = {"const": VERSION}
    strings["rate_hz"] = {"type": "number", "exclusiveMinimum": 0, "description": KEYS["rate_hz"]}
    strings["recordings"] = {"type": "array", "items": {"type": "string"}, "description": KEYS["recordings"]}
    strings["like"]["enum"] = list(PROTOCOLS)
    strings["site"] = {
        "type": "object",
        "properties": site,
        "additionalProperties": False,
        "description": KEYS["site"],
    }
    strings["steps"] = {
        "type": "array",
        "items": {"oneOf": [step(kind) for kind in KINDS]},
        "minItems": 1,
        "description": KEYS["steps"],
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "tumble protocol",
        "type": "object",
        "properties": strings,
        "required": ["format", "site"],
        "oneOf": [{"required": ["steps"]}, {"required": ["like"]}],
        "additionalProperties": False,
    }
