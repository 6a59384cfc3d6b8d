"""The steps of a protocol file: each becomes a hold, a turn, a spin, a soak or a ramp, or an error with its line."""

from __future__ import annotations

from dataclasses import replace
from typing import TypedDict

import numpy as np

from tumble.arrays import Vector
from tumble.protocol.keys import ARC_SECOND, KINDS, MINUTE, PPM, RAMP, REVOLUTION
from tumble.protocol.steps import HoldStep, Pose, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.protocol.yaml_nodes import Entry, nearest
from tumble.units import DEGREE

# A vector this near to unit length was written as one, and stays as it is to the last digit.
_UNIT = 1e-12


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
    kinds = [kind for kind in KINDS if kind in written]
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
    keys = replace(item, step=called).mapping(KINDS[kind], f"a {kind}")
    place = _Place(name=keys[kind].text(), file=_file(keys), interval=_interval(keys))
    if kind == "hold":
        return HoldStep(_seconds(keys, keys[kind]), _pose(keys), **place)
    if kind == "turn":
        return _turn(keys, place)
    if kind == "soak":
        return _soak(keys, place)
    if kind == "ramp":
        return _ramp(keys, place)
    return _spin(keys, place)


def _soak(keys: dict[str, Entry], place: _Place) -> SoakStep:
    celsius = _celsius(keys, "temperature_celsius", keys["soak"])
    tolerance = keys["tolerance_k"].number(positive=True) if "tolerance_k" in keys else 1.0
    return SoakStep(_seconds(keys, keys["soak"]), celsius, tolerance, **place)


def _ramp(keys: dict[str, Entry], place: _Place) -> RampStep:
    start, stop = (_celsius(keys, key, keys["ramp"]) for key in ("from_celsius", "to_celsius"))
    if start == stop:
        raise keys["to_celsius"].error(
            f"the ramp goes from {start:g} °C to {stop:g} °C, which is none: write a `soak:` instead."
        )
    if "rate_k_per_min" in keys:
        if "seconds" in keys:
            raise keys["rate_k_per_min"].error("`seconds` and `rate_k_per_min` say the same: remove one.")
        duration = abs(stop - start) / keys["rate_k_per_min"].number(positive=True) * MINUTE
    else:
        duration = _seconds(keys, keys["ramp"])
    if not 0.0 < duration < np.inf:
        raise keys["ramp"].error(f"a ramp at this rate lasts {duration:g} s, which is no time.")
    tumbled = keys["tumble_every_s"].number(positive=True) if "tumble_every_s" in keys else 0.0
    return RampStep(duration, start, stop, tumbled, **place)


def _celsius(keys: dict[str, Entry], key: str, step: Entry) -> float:
    if key not in keys:
        raise step.error(f"`{key}` is missing: write the temperature in °C.")
    return keys[key].number(least=-200.0, most=300.0, instead="It is in °C, not in K.")


def _unknown_kind(written: list[str]) -> str:
    """Return why keys without a kind are no step."""
    kinds = tuple(KINDS)
    for word in written:
        said = nearest(word, kinds)
        if said.startswith("did"):
            return f"`{word}` is no kind of step; {said}"
    return f"there is no step `{written[0] if written else ''}`: a step is {', '.join(f'`{k}:`' for k in kinds)}."


def _seconds(keys: dict[str, Entry], item: Entry) -> float:
    """Return the step's duration: as written, or that of its interval."""
    if "seconds" in keys:
        return keys["seconds"].number(positive=True)
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
    start, stop = keys["interval_s"].numbers(2)
    if stop <= start:
        raise keys["interval_s"].error(
            f"the interval ends at {stop:g} s, not after its start at {start:g} s: write [start, stop]."
        )
    if not np.isfinite(stop - start):
        raise keys["interval_s"].error(
            f"the interval from {start:g} to {stop:g} s is longer than any number."
        )
    return start, stop


def _sigma(keys: dict[str, Entry]) -> float:
    if "uncertainty_deg" not in keys:
        return 0.0
    return keys["uncertainty_deg"].number(DEGREE, least=0.0, most=180.0)


def _pose(keys: dict[str, Entry]) -> Pose | None:
    if "attitude_deg" in keys:
        from scipy.spatial.transform import Rotation

        if "up" in keys or "heading_deg" in keys:
            raise keys["attitude_deg"].error(
                "`attitude_deg` says the whole attitude: remove it, or `up` and `heading_deg`."
            )
        roll, pitch, heading = keys["attitude_deg"].numbers(3, most=360.0)
        attitude = Rotation.from_euler("ZYX", [heading, pitch, roll], degrees=True)
        return Pose.from_rotation(attitude, _sigma(keys))
    if "up" not in keys:
        for key in ("heading_deg", "uncertainty_deg"):
            if key in keys:
                raise keys[key].error(f"`{key}` says nothing without `up`: write `up: x` or the like.")
        return None
    heading = None
    if "heading_deg" in keys:
        heading = keys["heading_deg"].number(DEGREE, least=-360.0, most=360.0)
    return Pose(_direction(keys["up"]), heading, _sigma(keys))


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
    instead = "A direction is written in numbers such as [1, 1, 0]."
    vector = np.array(entry.numbers(3, most=1e6, instead=instead))
    length = float(np.linalg.norm(vector))
    if length < 1e-6:
        raise entry.error(
            f"`{entry.key}` is {vector.tolist()}, which is no direction: one must differ from 0."
        )
    return vector if abs(length - 1.0) < _UNIT else vector / length


def _turn(keys: dict[str, Entry], place: _Place) -> TurnStep:
    axis = _direction(keys["axis"]) if "axis" in keys else None
    angle = None
    if "angle_deg" in keys and "revolutions" in keys:
        raise keys["revolutions"].error("`angle_deg` and `revolutions` say the same: remove one.")
    if "angle_deg" in keys:
        instead = "Write a turn of more as `revolutions`."
        angle = keys["angle_deg"].number(DEGREE, least=-360.0, most=360.0, instead=instead)
    elif "revolutions" in keys:
        angle = keys["revolutions"].number(REVOLUTION)
    if "uncertainty_deg" in keys and angle is None:
        raise keys["uncertainty_deg"].error("`uncertainty_deg` says nothing without `angle_deg`: add it.")
    return TurnStep(_seconds(keys, keys["turn"]), axis, angle, _sigma(keys), **place)


def _spin(keys: dict[str, Entry], place: _Place) -> SpinStep:
    if "rate_deg_per_s" not in keys:
        raise keys["spin"].error(
            "`rate_deg_per_s` is missing: write the table's rate, negative for clockwise."
        )
    rate = keys["rate_deg_per_s"].number(DEGREE)
    if rate == 0.0:
        raise keys["rate_deg_per_s"].error("`rate_deg_per_s` is 0, which is no spin: write a hold.")
    if "seconds" in keys and "revolutions" in keys:
        raise keys["revolutions"].error("`seconds` and `revolutions` say the same: remove one.")
    if "revolutions" in keys:
        instead = "The sign of the rate says the way."
        duration = keys["revolutions"].number(positive=True, instead=instead) * (REVOLUTION / abs(rate))
    elif "seconds" in keys or "interval_s" in keys:
        duration = _seconds(keys, keys["spin"])
    else:
        raise keys["spin"].error(
            "`seconds` or `revolutions` is missing: write how long the rate is constant."
        )
    if not 0.0 < duration < np.inf:
        raise keys["spin"].error(f"so many revolutions at this rate last {duration:g} s, which is no time.")
    vertical = "axis" not in keys or (keys["axis"].is_scalar and keys["axis"].text() == "up")
    axis = None if vertical else _direction(keys["axis"])
    ramp = keys["ramp_s"].number(least=0.0) if "ramp_s" in keys else RAMP
    sigma = keys["uncertainty_ppm"].number(PPM, least=0.0) if "uncertainty_ppm" in keys else None
    angle, angle_sigma = _display(keys, rate)
    return SpinStep(duration, rate, axis, sigma, ramp, **place, angle=angle, angle_sigma=angle_sigma)


def _display(keys: dict[str, Entry], rate: float) -> tuple[float | None, float]:
    """Return the angle of the table's display with its uncertainty."""
    sigma = "angle_uncertainty_arcsec"
    if "angle_deg" not in keys:
        if sigma in keys:
            raise keys[sigma].error(f"`{sigma}` says nothing without `angle_deg`: add it.")
        return None, 0.0
    angle = keys["angle_deg"].number(DEGREE)
    if angle == 0.0:
        raise keys["angle_deg"].error("`angle_deg` is 0, which is no spin: leave the key or the step out.")
    if angle * rate < 0.0:
        raise keys["angle_deg"].error(
            f"`angle_deg` is {keys['angle_deg'].text()} and `rate_deg_per_s` is "
            f"{keys['rate_deg_per_s'].text()}: the table cannot turn one way and show the other. "
            "Change the sign of the wrong one; negative is clockwise."
        )
    return angle, keys[sigma].number(ARC_SECOND, least=0.0) if sigma in keys else 0.0
