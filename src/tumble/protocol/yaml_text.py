"""A protocol as the text of its file."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, cast

import numpy as np

from tumble.arrays import Vector
from tumble.earth.site import Site
from tumble.errors import ProtocolError, SiteError
from tumble.protocol.keys import ANGLES, ARC_SECOND, FORMAT, FRAME, PPM, REVOLUTION, VERSION
from tumble.protocol.numerals import numeral_of, value_of
from tumble.protocol.steps import HoldStep, Protocol, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.sample_rates import SampleRate
from tumble.units import DEGREE

_HEAD = """\
# A protocol: what is done to the unit, step by step, and how well it is known.
#   tumble calibrate --protocol THIS-FILE -o FOLDER   evaluates what was recorded
#   tumble simulate THIS-FILE -o FOLDER               plays it on a simulated unit
# A hold rests, a turn brings the unit from one pose to the next, a spin is a table at a constant rate.
# A soak waits until the unit has a temperature, a ramp goes slowly from one to another.
# `up` is what points up in b, against gravity: x, -y, or a direction such as [1, 1, 0]. `uncertainty_...` is
# one standard deviation of how well the step was done; without it the step counts as exact.
# Every key is explained in docs/protocols.md of tumble."""


def protocol_to_text(protocol: Protocol) -> str:
    """Return the text of a protocol's file, with the comments that explain it.

    Raises
    ------
    ProtocolError
        If the protocol has no site, or a direction that is not of length 1.
    """
    if protocol.site is None:
        raise ProtocolError(
            f"The protocol {protocol.name!r} cannot be a file: it has no site, and a file says where it is "
            "performed. Add one, such as site=Site.from_latitude(latitude, height)."
        )
    lines = [_HEAD, f"format: {FORMAT}", f"version: {VERSION}"]
    lines += [f"name: {_quoted(protocol.name)}", f"procedure: {_quoted(protocol.procedure)}"]
    if protocol.description:
        lines.append(f"description: {_quoted(protocol.description)}")
    lines += ["site:", *(f"  {line}" for line in _site_lines(protocol.site))]
    lines += [f"frame: {_quoted(FRAME)}", f"angles: {_quoted(ANGLES)}"]
    if protocol.recordings:
        lines += ["recordings:", *(f"  - {_quoted(name)}" for name in protocol.recordings)]
    for key, value in (("units", protocol.units), ("columns", protocol.columns)):
        if value is not None:
            lines.append(f"{key}: {_quoted(value)}")
    if protocol.rate is not None:
        lines.append(f"rate_hz: {_rate_text(protocol.rate)}")
    lines.append("steps:")
    for step in protocol.steps:
        first, *others = _step_lines(step)
        lines += [f"  - {first}", *(f"    {line}" for line in others)]
    return "\n".join(lines) + "\n"


def _rate_text(rate: float) -> str:
    """Return a sampling rate, with its uncertainty where it has one."""
    sigma = rate.uncertainty if isinstance(rate, SampleRate) else None
    return numeral_of(rate) if sigma is None else f"{numeral_of(rate)}±{numeral_of(sigma)}"


def _site_lines(site: Site) -> list[str]:
    """Return what the reader needs to make the same site, and no more."""
    lines: list[str] = []
    if site.latitude is not None:
        lines.append(f"latitude_deg: {numeral_of(site.latitude, DEGREE)}")
    if site.height is not None:
        lines.append(f"height_m: {numeral_of(site.height)}")
    with suppress(SiteError):
        if site.latitude is not None and site == Site.from_latitude(site.latitude, site.height):
            return lines
    lines.append(f"gravity: {numeral_of(site.gravity)}")
    lines.append(f"gravity_uncertainty: {numeral_of(site.gravity_sigma)}")
    if site.source != "given":
        lines.append(f"source: {_quoted(site.source)}")
    return lines


def _quoted(word: str) -> str:
    """Return a text as YAML that reads back as it is: plain where nothing can be mistaken."""
    import yaml

    dump = cast("Any", yaml).safe_dump
    # A line break or an odd character is written as an escape, in double quotes.
    style = None if word.isprintable() and word else '"'
    if style is None and "'" in word and not {'"', "\\"} & set(word):
        return f'"{word}"'
    text = str(dump(word, default_style=style, allow_unicode=True, width=float("inf")))
    return text.removesuffix("\n").removesuffix("\n...")


def _named(kind: str, name: str) -> str:
    return f"{kind}: {_quoted(name)}" if name else f"{kind}:"


def _step_lines(step: Step) -> list[str]:
    if isinstance(step, HoldStep):
        lines = [_named("hold", step.name), *_pose_lines(step), f"seconds: {numeral_of(step.duration)}"]
    elif isinstance(step, TurnStep):
        lines = [_named("turn", step.name), *_turn_lines(step), f"seconds: {numeral_of(step.duration)}"]
    elif isinstance(step, SoakStep):
        lines = [_named("soak", step.name), *_soak_lines(step), f"seconds: {numeral_of(step.duration)}"]
    elif isinstance(step, RampStep):
        lines = [_named("ramp", step.name), *_ramp_lines(step), f"seconds: {numeral_of(step.duration)}"]
    else:
        lines = [_named("spin", step.name), *_spin_lines(step)]
    if step.file is not None:
        lines.append(f"file: {_quoted(step.file)}")
    if step.interval is not None:
        start, stop = (numeral_of(edge) for edge in step.interval)
        lines.append(f"interval_s: [{start}, {stop}]")
    return lines


def _pose_lines(step: HoldStep) -> list[str]:
    if step.pose is None:
        return []
    lines = [f"up: {_direction_text(step.pose.up_b)}"]
    if step.pose.heading is not None:
        lines.append(f"heading_deg: {numeral_of(step.pose.heading, DEGREE)}")
    return [*lines, f"uncertainty_deg: {numeral_of(step.pose.sigma, DEGREE)}"]


def _turn_lines(step: TurnStep) -> list[str]:
    lines: list[str] = []
    if step.axis_b is not None:
        lines.append(f"axis: {_direction_text(step.axis_b)}")
    if step.angle is not None:
        degrees = numeral_of(step.angle, DEGREE)
        within = abs(float(degrees)) <= 360.0
        lines.append(
            f"angle_deg: {degrees}" if within else f"revolutions: {numeral_of(step.angle, REVOLUTION)}"
        )
    if step.angle is not None or step.sigma:
        lines.append(f"uncertainty_deg: {numeral_of(step.sigma, DEGREE)}")
    return lines


def _spin_lines(step: SpinStep) -> list[str]:
    lines = [
        f"axis: {'up' if step.axis_b is None else _direction_text(step.axis_b)}",
        f"rate_deg_per_s: {numeral_of(step.rate, DEGREE)}",
        _spin_length(step),
        f"ramp_s: {numeral_of(step.ramp)}",
    ]
    if step.sigma is not None:
        lines.append(f"uncertainty_ppm: {numeral_of(step.sigma, PPM)}")
    if step.angle is not None:
        lines.append(f"angle_deg: {numeral_of(step.angle, DEGREE)}")
    if step.angle is not None or step.angle_sigma:
        lines.append(f"angle_uncertainty_arcsec: {numeral_of(step.angle_sigma, ARC_SECOND)}")
    return lines


def _soak_lines(step: SoakStep) -> list[str]:
    return [
        f"temperature_celsius: {numeral_of(step.temperature_celsius)}",
        f"tolerance_k: {numeral_of(step.tolerance)}",
    ]


def _ramp_lines(step: RampStep) -> list[str]:
    lines = [
        f"from_celsius: {numeral_of(step.start_celsius)}",
        f"to_celsius: {numeral_of(step.stop_celsius)}",
    ]
    return [*lines, f"tumble_every_s: {numeral_of(step.tumbled)}"] if step.tumbled else lines


def _spin_length(step: SpinStep) -> str:
    """Return whole revolutions where the spin has them, to the last digit; else its seconds."""
    if step.rate:
        period = REVOLUTION / abs(value_of(numeral_of(step.rate, DEGREE), DEGREE))
        count = step.duration / period
        if 0.5 < count < 1e6 and round(count) * period == step.duration:
            return f"revolutions: {round(count)}"
    return f"seconds: {numeral_of(step.duration)}"


def _direction_text(vector: Vector) -> str:
    """Return x, -y, [1, 1, 0] where that is the vector to the last digit, or its three numbers.

    Raises ProtocolError if its length is not 1, because the reader would bring it there.
    """
    length = float(np.linalg.norm(vector))
    if not abs(length - 1.0) < 1e-12:
        raise ProtocolError(
            f"The direction {vector.tolist()} has the length {length:.6g}: divide it by that."
        )
    signs = np.sign(np.where(np.abs(vector) < 1e-12, 0.0, vector))
    if np.array_equal(signs / np.linalg.norm(signs), vector):
        if np.count_nonzero(signs) == 1:
            axis = int(np.flatnonzero(signs)[0])
            return f"{'-' if signs[axis] < 0 else ''}{'xyz'[axis]}"
        return "[" + ", ".join(str(int(v)) for v in signs) + "]"
    return "[" + ", ".join(numeral_of(v) for v in vector) + "]"
