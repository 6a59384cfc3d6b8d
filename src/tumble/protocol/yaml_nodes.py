"""YAML that a user writes and tumble writes: entries with the line of each, so that a mistake is named by its place."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

import numpy as np

from tumble.arrays import Vector
from tumble.earth import Site
from tumble.errors import ProtocolError, SiteError
from tumble.files import composed, yaml_loader
from tumble.protocol.keys import REVOLUTION, STEPS, Key, known_keys, numeral_of, value_of
from tumble.protocol.steps import HoldStep, Protocol, RampStep, SpinStep, Step, TurnStep
from tumble.records import dataclass
from tumble.sample_rates import SampleRate
from tumble.units import DEGREE

_TEXT = Key("")
_SAID = 1 << 18  # characters that the slow loader, of some 100 kB/s, is asked of


@dataclass(frozen=True)
class Entry:
    """One value of a file, and what it is called in a message.

    Attributes
    ----------
    file : what the messages call the file.
    node : the value with its marks, as PyYAML composes it.
    step : such as ``step 3 (x up)``; empty outside the steps.
    key : under which the value stands; empty for a whole step or file.
    lines : whether anybody can look at the file's lines.
    spec : what the key means; that of texts where nothing is known of it.
    """

    file: str
    node: Any
    step: str = ""
    key: str = ""
    lines: bool = True
    spec: Key = _TEXT

    def error(self, message: str) -> ProtocolError:
        """Return the error that names file, line and step."""
        line = f", line {self.node.start_mark.line + 1}" if self.lines else ""
        step = f", {self.step}" if self.step else ""
        return ProtocolError(f"{self.file}{line}{step}: {message}")

    @property
    def is_scalar(self) -> bool:
        """Whether the value is one word or number."""
        return self.node.id == "scalar"

    @property
    def is_empty(self) -> bool:
        """Whether nothing stands after the key."""
        return self.is_scalar and not self.node.style and str(self.node.value) in ("", "~", "null")

    def mapping(
        self, known: dict[str, Key], what: str, elsewhere: dict[str, str] | None = None
    ) -> dict[str, Entry]:
        """Return the entries of a mapping by key.

        Parameters
        ----------
        known : its keys.
        what : it is called in messages.
        elsewhere : of keys that belong to another mapping, what to say of them.

        Raises
        ------
        ProtocolError
            If it is no mapping, or a key is unknown or stands twice.
        """
        if self.node.id != "mapping":
            raise self.error(f"{what} is to be `key: value`, one a line, with the keys {_listed(known)}.")
        found: dict[str, Entry] = {}
        for key_node, value in self.node.value:
            here = replace(self, node=key_node)
            key = str(key_node.value) if key_node.id == "scalar" else "[...]"
            if key not in known and elsewhere is not None and key in elsewhere:
                raise here.error(f"{what} has no key `{key}`: {elsewhere[key]}")
            if key not in known:
                raise here.error(f"{what} has no key `{key}`: {nearest(key, known)}")
            if key in found:
                line = found[key].node.start_mark.line + 1
                raise here.error(f"`{key}` stands twice, first in line {line}: remove one.")
            found[key] = replace(self, node=value, key=key, spec=known[key])
        return found

    def sequence(self) -> list[Entry]:
        """Return the entries of a list.

        Raises
        ------
        ProtocolError
            If it is no list.
        """
        if self.node.id != "sequence":
            raise self.error(f"`{self.key}` is to be a list: each item on a line of its own, after `- `.")
        return [replace(self, node=item) for item in self.node.value]

    def text(self) -> str:
        """Return a text; nothing is the empty text.

        Raises
        ------
        ProtocolError
            If it is a list or a mapping.
        """
        if not self.is_scalar:
            raise self.error(f"`{self.key}` is to be a text, and is a {self.node.id}.")
        return "" if self.is_empty else str(self.node.value)

    def number(
        self, factor: float | None = None, limits: dict[str, Any] | None = None, instead: str = ""
    ) -> float:
        """Return a finite number within the limits of its key, times the factor of its unit.

        Parameters
        ----------
        factor, limits, instead : what is not as the key has it: SI value of the file's unit, JSON schema of
            a number, and what to write instead of a number beyond its limits.

        Raises
        ------
        ProtocolError
            If it is no number, or beyond the limits.
        """
        if self.is_empty:
            raise self.error(f"`{self.key}` is empty: write a number after it, or remove it.")
        word = str(self.node.value)
        try:
            value = value_of(word, self.spec.factor if factor is None else factor)
        except (ValueError, TypeError):
            raise self.error(self._no_number()) from None
        if self.node.style:
            raise self.error(self._no_number())
        if not math.isfinite(value):
            raise self.error(f"`{self.key}` is {word}: a finite number is needed.")
        given, limits = float(word), limits or self.spec.schema
        least, most = limits.get("minimum", -math.inf), limits.get("maximum", math.inf)
        span = f"from {least:g} to {most:g}" if most < math.inf else f"{least:g} or more"
        if "exclusiveMinimum" in limits and value <= 0.0:
            span = "more than 0"
        elif least <= given <= most:
            return value
        said = instead or self.spec.instead
        raise self.error(f"`{self.key}` is {word}: it has to be {span}.{said and f' {said}'}")

    def _no_number(self) -> str:
        """Return why this is no number, and what to write."""
        if not self.is_scalar:
            return f"`{self.key}` is to be one number, and is a {self.node.id}."
        word = str(self.node.value)
        if self.node.style:
            return f'`{self.key}` is the text "{word[:30]}": write a number, without quotes.'
        if re.fullmatch(r"[-+]?\d+,\d+", word):
            return f"`{self.key}` is {word}: write the number with a point, {word.replace(',', '.')}."
        if word.lower().lstrip("+-.") in ("nan", "inf", "infinity"):
            return f"`{self.key}` is {word}: a finite number is needed."
        with_unit = re.match(r"([-+]?\d*\.?\d+)\s*[^\d\s.,:]", word)
        if with_unit:
            return f"`{self.key}` is `{word[:30]}`: write {with_unit[1]} alone, the key says the unit."
        return f"`{self.key}` is `{word[:30]}`, and is to be a number."

    def numbers(
        self, limits: dict[str, Any] | None = None, instead: str = "", factor: float | None = None
    ) -> list[float]:
        """Return a list of as many finite numbers as its key, or another schema, has, each within their limits.

        Raises
        ------
        ProtocolError
            If it is none.
        """
        limits = limits or self.spec.schema
        count = limits["minItems"]
        if self.node.id != "sequence" or len(self.node.value) != count:
            raise self.error(
                f"`{self.key}` is to be a list of {count} numbers, [{', '.join(['…'] * count)}]."
            )
        return [item.number(factor, limits["items"], instead) for item in self.sequence()]


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the sentence that names the right word nearest to a wrong one, or all of them."""
    known = tuple(known)
    near = difflib.get_close_matches(word.lower(), known, 1, 0.6)
    return f"did you mean `{near[0]}`?" if near else f"it can be {_listed(known)}."


def _listed(words: Iterable[str]) -> str:
    return ", ".join(f"`{word}`" for word in words)


_UNENDED = re.compile("expected ':'|expected ',' or|end of stream")
_INDENTED = (
    "The indentation of this line or of the one before is off: the keys of a step, or of the site, stand exactly below "
    "one another."
)
# What people write wrong, by PyYAML's words for it.
_HINTS = (
    ("\\t", "Indent with spaces, not with tabs."),
    ("could not find expected ':'", "Between a key and its value stand a colon and a space."),
    ("expected ',' or", "A list or a quote that begins in this line does not end: is a bracket missing?"),
    ("end of stream", "A quote that begins in this line does not end."),
    ("cannot start any token", 'Put a text that begins with such a character in quotes, "…".'),
    ("expected <block end>", _INDENTED),
    ("mapping values are not allowed", _INDENTED),
)


def _hint(why: str, line: str) -> str:
    """Say what to mend in a line that is no YAML; nothing where nobody knows."""
    key = re.match(r"\s*(?:- )?(\w+): +(?=[^\s\"'])(.*:(?: .*|$))", line)
    if "mapping values" in why and key is not None:
        return f'A text with a colon in it stands in quotes: {key[1]}: "{key[2].rstrip()}"'
    return next((hint for words, hint in _HINTS if words in why), "")


def _root(content: str, library: Any) -> Any:
    """Compose by the fast loader; what it refuses is said in the words of the slow one, which the hints are for."""
    try:
        return composed(content, yaml_loader())
    except library.YAMLError:
        if len(content) > _SAID:
            raise
        return composed(content, library.SafeLoader)


def compose(file: str, content: str) -> Any:
    """Return the root node of a YAML text.

    Parameters
    ----------
    file : what the messages call it.
    content : the text.

    Raises
    ------
    ProtocolError
        If it is no YAML, or empty.
    """
    import yaml

    library = cast("Any", yaml)
    try:
        root = _root(content, library)
    except library.MarkedYAMLError as error:
        why = str(error.problem or error.context)
        # What was begun and not ended is mended where it begins.
        begun = _UNENDED.search(why) is not None
        marks = (error.problem_mark, error.context_mark)
        mark = next((m for m in (marks[::-1] if begun else marks) if m is not None), None)
        line = 0 if mark is None else min(mark.line, content.count("\n"))
        hint = _hint(why, content.split("\n")[line])
        raise ProtocolError(f"{file}, line {line + 1}: this is not YAML: {why}. {hint}".rstrip()) from None
    except library.reader.ReaderError as error:
        line = content.count("\n", 0, error.position) + 1
        raise ProtocolError(
            f"{file}, line {line}: the character {error.character!r} has no place in a text file."
        ) from None
    except ValueError as error:
        raise ProtocolError(f"{file} is not a protocol: {error}.") from None
    if root is None:
        raise ProtocolError(f"{file} is empty: a protocol begins with `format: tumble protocol`.")
    return root


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
