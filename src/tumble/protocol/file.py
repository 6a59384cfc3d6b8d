"""Protocol files: YAML for people, read with the line of every mistake, written so that it reads back.

Angles are degrees and times are seconds, as people write them, and each key ends in its unit. What is
read is what was written to the last bit (see `tumble.protocol.keys`). The JSON schema is made of the reader's own
keys.

The steps of a protocol file: each becomes a hold, a turn, a spin, a soak or a ramp, or an error with its line.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from tumble.arrays import Vector
from tumble.earth import Site
from tumble.errors import ProtocolError, SiteError, UsageError
from tumble.files import put_text, read_text, reading, written_beside
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.protocol.keys import FORMAT, REVOLUTION, STEPS, VERSION, known_keys, schema_of
from tumble.protocol.library import PROTOCOLS, named_protocol
from tumble.protocol.steps import HoldStep, Pose, Protocol, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.protocol.yaml_nodes import Entry, compose, nearest, protocol_to_text
from tumble.sample_rates import sample_rate

# A vector this near to unit length was written as one, and stays as it is to the last digit.
_UNIT = 1e-12
_VECTOR = {"minItems": 3, "items": {"minimum": -1e6, "maximum": 1e6}}


class _Place(TypedDict):
    name: str
    file: str | None
    interval: tuple[float, float] | None


def steps_of(entry: Entry) -> tuple[Step, ...]:
    """Return the steps of the list under ``steps``.

    Raises
    ------
    ProtocolError
        If one of them cannot be, or there is none; the message names the line and the step.
    """
    if entry.is_empty or (entry.node.id == "sequence" and not entry.node.value):
        raise entry.error("there are no steps: write at least one, such as `- hold: z up`.")
    steps: list[Step] = []
    stopped: dict[str | None, float] = {}
    files: list[str] = []
    for number, item in enumerate(entry.sequence(), 1):
        item = replace(item, step=f"step {number}", key="")
        step = _step(item, number)
        item = replace(item, step=_called(number, step.name))
        if isinstance(step, SpinStep):
            _check_hold_before(item, steps)
        if step.file is not None:
            _check_file(item, step.file, files)
        if step.interval is not None:
            _check_order(item, step.interval, stopped.get(step.file))
            stopped[step.file] = step.interval[1]
        steps.append(step)
    if not any(isinstance(step, HoldStep) for step in steps):
        raise entry.error("there is no hold among the steps: write at least one, such as `- hold: z up`.")
    return tuple(steps)


def _called(number: int, name: str) -> str:
    return f"step {number} ({name})" if name else f"step {number}"


def _check_hold_before(item: Entry, steps: list[Step]) -> None:
    """Refuse a spin of which nobody knows how the unit lies on the table."""
    before = next((s for s in reversed(steps) if not isinstance(s, SpinStep | SoakStep | RampStep)), None)
    if not isinstance(before, HoldStep):
        where = "after the turn " if before is not None else ""
        raise item.error(f"a spin without a hold before it: write the hold on the table {where}first.")


def _check_file(item: Entry, file: str, files: list[str]) -> None:
    """Refuse a file that comes back after another: what it holds was recorded in one stretch."""
    if file not in files:
        files.append(file)
    elif file != files[-1]:
        raise item.error(
            f"its file {file} is named twice, with {files[-1]} in between: give each its own, "
            "or put the steps of one file one after another."
        )


def _check_order(item: Entry, interval: tuple[float, float], stopped: float | None) -> None:
    if stopped is not None and interval[0] < stopped:
        raise item.error(
            f"its interval starts at {interval[0]:g} s, before the former one ends at {stopped:g} s: "
            "steps stand in the order of time and do not overlap."
        )


def _step(item: Entry, number: int) -> Step:
    if item.node.id != "mapping":
        word = f", and is `{item.node.value}`" if item.is_scalar else ""
        raise item.error(
            f"a step is to be `hold:`, `turn:`, `spin:`, `soak:` or `ramp:` with its keys below it{word}."
        )
    written = [str(key.value) for key, _ in item.node.value if key.id == "scalar"]
    kinds = [kind for kind in STEPS if kind in written]
    if len(kinds) > 1:
        raise item.error(
            f"it is {' and '.join(f'`{kind}`' for kind in kinds)} at once: make two steps of it."
        )
    if not kinds:
        raise item.error(_unknown_kind(written))
    kind = kinds[0]
    name = next(value for key, value in item.node.value if key.value == kind)
    if name.id != "scalar":
        raise replace(item, node=name).error(
            f"after `{kind}:` stands its name alone: its keys stand below it."
        )
    called = _called(number, Entry(item.file, name).text())
    keys = replace(item, step=called).mapping(known_keys(kind), f"a {kind}")
    place = _Place(name=keys[kind].text(), file=_file(keys), interval=_interval(keys))
    return _READERS[kind](keys, keys[kind], place)


def _said(keys: dict[str, Entry]) -> dict[str, float]:
    """Return what one key alone says each, by the step's attributes."""
    return {entry.spec.attribute: entry.number() for entry in keys.values() if entry.spec.attribute}


def _refuse_both(keys: dict[str, Entry], one: str, other: str) -> None:
    if one in keys and other in keys:
        raise keys[other].error(f"`{one}` and `{other}` say the same: remove one.")


def _refuse_without_angle(keys: dict[str, Entry], key: str, *angles: str) -> None:
    if key in keys and not keys.keys() & set(angles):
        raise keys[key].error(f"`{key}` says nothing without `angle_deg`: add it.")


def _refuse_missing(keys: dict[str, Entry], step: Entry, key: str, what: str) -> None:
    if key not in keys:
        raise step.error(f"`{key}` is missing: write {what}.")


def _hold(keys: dict[str, Entry], step: Entry, place: _Place) -> HoldStep:
    return HoldStep(_seconds(keys, step), _pose(keys), **place)


def _soak(keys: dict[str, Entry], step: Entry, place: _Place) -> SoakStep:
    _refuse_missing(keys, step, "temperature_celsius", "the temperature in °C")
    return SoakStep(**(_said(keys) | {"duration": _seconds(keys, step)}), **place)


def _ramp(keys: dict[str, Entry], step: Entry, place: _Place) -> RampStep:
    for key in ("from_celsius", "to_celsius"):
        _refuse_missing(keys, step, key, "the temperature in °C")
    said = _said(keys)
    start, stop = said["start_celsius"], said["stop_celsius"]
    if start == stop:
        raise keys["to_celsius"].error(
            f"the ramp goes from {start:g} °C to {stop:g} °C, which is none: write a `soak:` instead."
        )
    _refuse_both(keys, "seconds", "rate_k_per_min")
    if "rate_k_per_min" in keys:
        said["duration"] = abs(stop - start) / keys["rate_k_per_min"].number() * 60.0
    else:
        said["duration"] = _seconds(keys, step)
    if not 0.0 < said["duration"] < np.inf:
        raise step.error(f"a ramp at this rate lasts {said['duration']:g} s, which is no time.")
    return RampStep(**said, **place)


def _unknown_kind(written: list[str]) -> str:
    """Return why keys without a kind are no step."""
    kinds = tuple(STEPS)
    for word in written:
        said = nearest(word, kinds)
        if said.startswith("did"):
            return f"`{word}` is no kind of step; {said}"
    return f"there is no step `{written[0] if written else ''}`: a step is {', '.join(f'`{k}:`' for k in kinds)}."


def _seconds(keys: dict[str, Entry], item: Entry) -> float:
    """Return the step's duration: as written, or that of its interval."""
    if "seconds" in keys:
        return keys["seconds"].number()
    interval = _interval(keys)
    if interval is None:
        raise item.error("`seconds` is missing: write how long the step takes.")
    return interval[1] - interval[0]


def _file(keys: dict[str, Entry]) -> str | None:
    if "file" not in keys or keys["file"].is_empty:
        return None
    return keys["file"].text()


def _interval(keys: dict[str, Entry]) -> tuple[float, float] | None:
    if "interval_s" not in keys:
        return None
    start, stop = keys["interval_s"].numbers()
    if stop <= start:
        raise keys["interval_s"].error(
            f"the interval ends at {stop:g} s, not after its start at {start:g} s: write [start, stop]."
        )
    if not np.isfinite(stop - start):
        raise keys["interval_s"].error(
            f"the interval from {start:g} to {stop:g} s is longer than any number."
        )
    return start, stop


def _pose(keys: dict[str, Entry]) -> Pose | None:
    sigma = keys["uncertainty_deg"].number() if "uncertainty_deg" in keys else 0.0
    if "attitude_deg" in keys:
        from scipy.spatial.transform import Rotation

        if "up" in keys or "heading_deg" in keys:
            raise keys["attitude_deg"].error(
                "`attitude_deg` says the whole attitude: remove it, or `up` and `heading_deg`."
            )
        roll, pitch, heading = keys["attitude_deg"].numbers(factor=1.0)
        attitude = Rotation.from_euler("ZYX", [heading, pitch, roll], degrees=True)
        return Pose.from_matrix(attitude.as_matrix(), sigma)
    if "up" not in keys:
        for key in ("heading_deg", "uncertainty_deg"):
            if key in keys:
                raise keys[key].error(f"`{key}` says nothing without `up`: write `up: x` or the like.")
        return None
    heading = keys["heading_deg"].number() if "heading_deg" in keys else None
    return Pose(_direction(keys["up"]), heading, sigma)


def _direction(entry: Entry) -> Vector:
    if entry.is_scalar:
        word = entry.text()
        sign, axis = (word[0], word[1:]) if word[:1] in ("+", "-") else ("", word)
        if axis not in ("x", "y", "z"):
            raise entry.error(
                f"`{entry.key}` is `{word}`, which is no direction: write x, -y, or a list such as [1, 1, 0]."
            )
        vector = np.zeros(3)
        vector["xyz".index(axis)] = -1.0 if sign == "-" else 1.0
        return vector
    vector = np.array(entry.numbers(_VECTOR, "A direction is written in numbers such as [1, 1, 0]."))
    length = float(np.linalg.norm(vector))
    if length < 1e-6:
        raise entry.error(
            f"`{entry.key}` is {vector.tolist()}, which is no direction: one must differ from 0."
        )
    return vector if abs(length - 1.0) < _UNIT else vector / length


def _turn(keys: dict[str, Entry], step: Entry, place: _Place) -> TurnStep:
    _refuse_both(keys, "angle_deg", "revolutions")
    _refuse_without_angle(keys, "uncertainty_deg", "angle_deg", "revolutions")
    axis = _direction(keys["axis"]) if "axis" in keys else None
    angle = next((keys[key].number() for key in ("angle_deg", "revolutions") if key in keys), None)
    said = _said(keys) | {"duration": _seconds(keys, step)}
    return TurnStep(**said, axis_b=axis, angle=angle, **place)


def _spin(keys: dict[str, Entry], step: Entry, place: _Place) -> SpinStep:
    _refuse_missing(keys, step, "rate_deg_per_s", "the table's rate, negative for clockwise")
    _refuse_both(keys, "seconds", "revolutions")
    _refuse_without_angle(keys, "angle_uncertainty_arcsec", "angle_deg")
    said = _said(keys)
    rate, angle = said["rate"], said.get("angle")
    if rate == 0.0:
        raise keys["rate_deg_per_s"].error("`rate_deg_per_s` is 0, which is no spin: write a hold.")
    if "revolutions" in keys:
        said["duration"] = keys["revolutions"].number(1.0) * (REVOLUTION / abs(rate))
    elif "seconds" in keys or "interval_s" in keys:
        said["duration"] = _seconds(keys, step)
    else:
        raise step.error("`seconds` or `revolutions` is missing: write how long the rate is constant.")
    if not 0.0 < said["duration"] < np.inf:
        raise step.error(f"so many revolutions at this rate last {said['duration']:g} s, which is no time.")
    if angle == 0.0:
        raise keys["angle_deg"].error("`angle_deg` is 0, which is no spin: leave the key or the step out.")
    if angle is not None and angle * rate < 0.0:
        raise keys["angle_deg"].error(
            f"`angle_deg` is {keys['angle_deg'].text()} and `rate_deg_per_s` is "
            f"{keys['rate_deg_per_s'].text()}: the table cannot turn one way and show the other. "
            "Change the sign of the wrong one; negative is clockwise."
        )
    vertical = "axis" not in keys or (keys["axis"].is_scalar and keys["axis"].text() == "up")
    return SpinStep(**said, axis_b=None if vertical else _direction(keys["axis"]), **place)


_READERS: dict[str, Callable[[dict[str, Entry], Entry, _Place], Step]] = {
    "hold": _hold,
    "turn": _turn,
    "spin": _spin,
    "soak": _soak,
    "ramp": _ramp,
}


# Ten thousand steps are a megabyte; a recording that is given for a protocol is more.
LARGEST = 2 * 1024 * 1024


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
    with reading(file, "a protocol", ProtocolError):
        text = read_text(file, LARGEST)
    return _read(text, str(file), file.stem)


def write_protocol(protocol: Protocol, path: str | os.PathLike[str]) -> None:
    """Write a protocol file beside `path`, then rename it there.

    Parameters
    ----------
    protocol : with a site, without which a file cannot be read again.
    path : of the YAML file.

    Raises
    ------
    ProtocolError
        If no file can hold the protocol: it has no site, or a step that cannot be.
    UsageError
        If `path` is no place for a result.
    OutputError
        If it cannot be written; an earlier file is intact.
    """
    content = protocol_to_yaml(protocol)
    with written_beside(Path(path)) as beside:
        put_text(beside, content)


def protocol_to_yaml(protocol: Protocol) -> str:
    """Return a protocol as the text of a file, which reads back to the same protocol.

    Parameters
    ----------
    protocol : with a site, and directions of length 1.

    Raises
    ------
    ProtocolError
        If no file can hold it: it has no site, or a step that cannot be.
    """
    content = protocol_to_text(protocol)
    # The reader knows what cannot be: what it refuses is not written.
    _read(content, f"The protocol {protocol.name!r} cannot be a file", protocol.name, lines=False)
    return content


def _read(content: str, file: str, stem: str, *, lines: bool = True) -> Protocol:
    no_protocol = ProtocolError(
        f"{file} is not a protocol: write `format: {FORMAT}` as its first line, or give the file as what it is."
    )
    # A long recording given by mistake is told at once, not after minutes of looking for YAML in it.
    if content.strip() and "format" not in content:
        raise no_protocol
    root = Entry(file, compose(file, content), lines=lines)
    written = [str(key.value) for key, _ in root.node.value] if root.node.id == "mapping" else []
    if "format" not in written:
        raise no_protocol
    # Another kind of file is named as what it is, before its keys are found unknown.
    _check_format(
        next(replace(root, node=v, key="format") for k, v in root.node.value if k.value == "format")
    )
    # A key that stands too far left or right is another mapping's.
    outdented = {
        key: f"it belongs to a step, indent it below its `{kind}:`."
        for kind in STEPS
        for key in known_keys(kind)
    }
    outdented |= {kind: f"it is a step, write `- {kind}:` below `steps:`." for kind in STEPS}
    outdented |= dict.fromkeys(known_keys("site"), "it belongs to the site, indent it below `site:`.")
    keys = root.mapping(known_keys("protocol"), "a protocol", outdented)
    _check_version(keys)
    _check_conventions(keys)
    return _protocol(root, keys, stem)


def _check_format(entry: Entry) -> None:
    if entry.text() != FORMAT:
        raise entry.error(f"this is a file of the format `{entry.text()}`, and a protocol says `{FORMAT}`.")


def _check_version(keys: dict[str, Entry]) -> None:
    if "version" not in keys:
        return
    version = keys["version"].number(limits={"minimum": 1})
    if version != VERSION:
        raise keys["version"].error(
            f"the version is {version:g}, and this tumble reads version {VERSION}: install a newer tumble."
        )


def _check_conventions(keys: dict[str, Entry]) -> None:
    for key in ("frame", "angles"):
        sentence = known_keys("protocol")[key].schema["const"]
        if key in keys and keys[key].text() != sentence:
            raise keys[key].error(
                f"`{key}` states another convention than tumble's. Convert the steps to tumble's and remove "
                f'the line, or write: {key}: "{sentence}"'
            )


def _protocol(root: Entry, keys: dict[str, Entry], stem: str) -> Protocol:
    like = _named(keys["like"]) if "like" in keys else None
    text = {key: keys[key].text() for key in keys if keys[key].is_scalar and not keys[key].is_empty}
    # Lists where a text is meant are refused here.
    for key in ("name", "procedure", "description", "units", "columns"):
        if key in keys:
            keys[key].text()
    procedure = text.get("procedure", like.procedure if like else "")
    if not procedure:
        raise root.error("`procedure` is missing: write `procedure: multi-position` or another.")
    if procedure not in KNOWN_PROCEDURES:
        said = nearest(procedure, KNOWN_PROCEDURES)
        known = f" There are {', '.join(KNOWN_PROCEDURES)}." if said.endswith("?") else ""
        raise keys.get("procedure", root).error(f"there is no procedure `{procedure}`: {said}{known}")
    site = _site(root, keys)
    return Protocol(
        name=text.get("name", like.name if like else stem),
        procedure=procedure,
        steps=_steps(root, keys, like),
        site=site,
        description=text.get("description", like.description if like else ""),
        recordings=_recordings(keys),
        units=text.get("units"),
        columns=text.get("columns"),
        rate=_rate(keys["rate_hz"]) if "rate_hz" in keys else None,
    )


def _rate(entry: Entry) -> float:
    """Return a sampling rate, with its uncertainty if the file says it."""
    if not any(sign in entry.text() for sign in ("±", "+-", "+/-")):
        return entry.number(limits={"exclusiveMinimum": 0})
    try:
        return sample_rate(entry.text())
    except UsageError:
        raise entry.error(
            f"`rate_hz` is {entry.text()}: write it as 100, or as 100±0.1 with its standard uncertainty."
        ) from None


def _named(entry: Entry) -> Protocol:
    if entry.text() not in PROTOCOLS:
        raise entry.error(f"there is no named protocol `{entry.text()}`: {nearest(entry.text(), PROTOCOLS)}")
    return named_protocol(entry.text())


def _steps(root: Entry, keys: dict[str, Entry], like: Protocol | None) -> tuple[Step, ...]:
    if like is not None and "steps" in keys:
        raise keys["steps"].error("the steps are those of `like` already: remove one of the two.")
    if like is not None:
        return like.steps
    if "steps" not in keys:
        raise root.error("there are no steps: write `steps:` with at least one, or `like:` a named protocol.")
    return steps_of(keys["steps"])


def _recordings(keys: dict[str, Entry]) -> tuple[str, ...]:
    if "recordings" not in keys or keys["recordings"].is_empty:
        return ()
    names = tuple(entry.text() for entry in keys["recordings"].sequence())
    if not all(names):
        raise keys["recordings"].error("one of the recordings has no name: write it or remove its `- `.")
    for number, name in enumerate(names):
        if name in names[:number]:
            raise keys["recordings"].sequence()[number].error(f"{name} is named twice: remove one.")
    return names


def _site(root: Entry, keys: dict[str, Entry]) -> Site:
    """Return the site of the file, or of its one number for gravity."""
    if "site" in keys and "gravity" in keys:
        raise keys["gravity"].error("write `gravity` below `site`, beside its latitude.")
    if "gravity" in keys:
        return _site_of({"gravity": keys["gravity"]})
    if "site" not in keys:
        raise root.error(
            "the site is missing: write `site:` and below it `latitude_deg: 48.1` and `height_m: 520`, "
            "or write `gravity: 9.81` in m/s² where only that is known."
        )
    outside = {
        key: f"it belongs to the protocol, write `{key}:` without a space before it."
        for key in known_keys("protocol").keys() - known_keys("site").keys()
    }
    found = keys["site"].mapping(known_keys("site"), "a site", outside)
    if "latitude_deg" not in found and "gravity" not in found:
        raise keys["site"].error("write `latitude_deg` below `site`, or `gravity` in m/s².")
    return _site_of(found)


def _site_of(found: dict[str, Entry]) -> Site:
    """Return the site that a file's entries say: gravity as given, else normal gravity."""
    height, latitude, gravity, sigma = (
        found[key].number() if key in found else None
        for key in ("height_m", "latitude_deg", "gravity", "gravity_uncertainty")
    )
    site = None if latitude is None else Site.from_latitude(latitude, height)
    if gravity is not None:
        try:
            site = replace(
                (site or Site.unknown()).with_gravity(Site.from_gravity(gravity, sigma)), height=height
            )
        except SiteError as error:
            raise found["gravity"].error(str(error)) from None
    assert site is not None
    if sigma is not None:
        site = replace(site, gravity_sigma=sigma)
    if "source" in found:
        site = replace(site, source=found["source"].text())
    return site


def protocol_schema() -> dict[str, Any]:
    """Return the JSON schema of a protocol file, for editors that check while one types.

    What depends on more than one step (a spin without a hold before it, intervals that overlap) only the
    reader sees.
    """
    schema: dict[str, Any] = {
        "title": FORMAT,
        **schema_of("protocol"),
        "$defs": {kind: schema_of(kind) for kind in STEPS},
    }
    schema["properties"]["like"]["enum"] = list(PROTOCOLS)
    schema["properties"]["procedure"]["enum"] = list(KNOWN_PROCEDURES)
    schema["properties"]["site"] |= schema_of("site")
    return schema
