"""Entries of a YAML file with the line that each stands on, so that a mistake can be named by its place."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, cast

from tumble.errors import ProtocolError
from tumble.files import composed, yaml_loader
from tumble.protocol.keys import Key, value_of
from tumble.records import dataclass

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
