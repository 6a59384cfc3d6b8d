"""The steps of a protocol file: each becomes a hold, a turn, a spin, a soak or a ramp, or an error with its line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypedDict

import numpy as np

from tumble.arrays import Vector
from tumble.protocol.keys import REVOLUTION, STEPS, known_keys
from tumble.protocol.steps import HoldStep, Pose, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.protocol.yaml_nodes import Entry, nearest

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
