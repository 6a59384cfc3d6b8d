"""A protocol as the text of its file."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, cast

import numpy as np

from tumble.arrays import Vector
from tumble.earth import Site
from tumble.errors import ProtocolError, SiteError
from tumble.protocol.keys import REVOLUTION, STEPS, known_keys, numeral_of, value_of
from tumble.protocol.steps import HoldStep, Protocol, RampStep, SpinStep, Step, TurnStep
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
    keys = known_keys("protocol")
    lines = [_HEAD, *(f"{key}: {keys[key].schema['const']}" for key in ("format", "version"))]
    lines += [f"name: {_quoted(protocol.name)}", f"procedure: {_quoted(protocol.procedure)}"]
    if protocol.description:
        lines.append(f"description: {_quoted(protocol.description)}")
    lines += ["site:", *(f"  {line}" for line in _site_lines(protocol.site))]
    lines += [f"{key}: {_quoted(keys[key].schema['const'])}" for key in ("frame", "angles")]
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


def _step_lines(step: Step) -> list[str]:
    kind = next(kind for kind, made in STEPS.items() if isinstance(step, made))
    texts = {
        key: numeral_of(value, spec.factor)
        for key, spec in known_keys(kind).items()
        if spec.attribute and (value := getattr(step, spec.attribute)) is not None
    }
    texts[kind] = _quoted(step.name) if step.name else ""
    if isinstance(step, HoldStep) and step.pose is not None:
        texts["up"] = _direction_text(step.pose.up_b)
        if step.pose.heading is not None:
            texts["heading_deg"] = numeral_of(step.pose.heading, DEGREE)
        texts["uncertainty_deg"] = numeral_of(step.pose.sigma, DEGREE)
    elif isinstance(step, TurnStep):
        _put_turn(step, texts)
    elif isinstance(step, SpinStep):
        texts["axis"] = "up" if step.axis_b is None else _direction_text(step.axis_b)
        _put_revolutions(step, texts)
        if step.angle is None and not step.angle_sigma:
            del texts["angle_uncertainty_arcsec"]
    elif isinstance(step, RampStep) and not step.tumbled:
        del texts["tumble_every_s"]
    if step.file is not None:
        texts["file"] = _quoted(step.file)
    if step.interval is not None:
        start, stop = (numeral_of(edge) for edge in step.interval)
        texts["interval_s"] = f"[{start}, {stop}]"
    return [f"{key}: {texts[key]}".rstrip() for key in known_keys(kind) if key in texts]


def _put_turn(step: TurnStep, texts: dict[str, str]) -> None:
    if step.axis_b is not None:
        texts["axis"] = _direction_text(step.axis_b)
    if step.angle is not None:
        degrees = numeral_of(step.angle, DEGREE)
        if abs(float(degrees)) <= 360.0:
            texts["angle_deg"] = degrees
        else:
            texts["revolutions"] = numeral_of(step.angle, REVOLUTION)
    elif not step.sigma:
        del texts["uncertainty_deg"]


def _put_revolutions(step: SpinStep, texts: dict[str, str]) -> None:
    """Put whole revolutions where the spin has them, to the last digit, in the place of its seconds."""
    if step.rate:
        period = REVOLUTION / abs(value_of(numeral_of(step.rate, DEGREE), DEGREE))
        count = step.duration / period
        if 0.5 < count < 1e6 and round(count) * period == step.duration:
            del texts["seconds"]
            texts["revolutions"] = str(round(count))


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
