"""JSON and YAML of unknown origin: read whole or refused, with limits of size, depth, digits and repetition."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

from tumble.files.opening import read_text
from tumble.files.text import shown

LARGEST_JSON = 64 << 20
LARGEST_YAML = 1 << 20
DEEPEST = 64
"""Levels of a document: those of tumble have eight at most."""
MOST_DIGITS = 310
"""Digits of a whole number; a larger one is no 64-bit float."""
MOST_ENTRIES = 200_000
"""Entries of a YAML document, those that stand under an alias counted again."""

_HALF = re.compile(r"\\u[dD][89a-fA-F]")


class DocumentError(ValueError):
    """A text is no document that may be read; its words end a sentence that begins with the file's name."""


def read_json(path: Path, largest: int = LARGEST_JSON) -> Any:
    """Return what a JSON file holds.

    Parameters
    ----------
    path : of the file, in UTF-8.
    largest : bytes that it may have.

    Raises
    ------
    OSError
        If it cannot be opened, is no ordinary file, or is longer.
    DocumentError
        If it is no JSON, nested too deeply, has a key twice, or holds a number or a text that cannot be.
    """
    text = _text(path, largest)
    try:
        document: Any = json.loads(text, parse_int=_whole, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise DocumentError(f"it is no JSON ({error.msg}, line {error.lineno})") from None
    except RecursionError:
        raise DocumentError("it is nested too deeply") from None
    if _HALF.search(text) and re.search("[\ud800-\udfff]", json.dumps(document, ensure_ascii=False)):
        raise DocumentError("it holds a text with half a character (\\ud800 to \\udfff)")
    _refuse_deep([document], DEEPEST + 1)
    return document


def _text(path: Path, largest: int) -> str:
    try:
        return read_text(path, largest)
    except UnicodeDecodeError as error:
        raise DocumentError(f"it is no text in UTF-8 (byte {error.start + 1})") from None


def _whole(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise DocumentError(f"it holds a number of {len(digits)} digits")
    return int(digits)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object; of a key that stands twice nobody knows which value is meant."""
    found = dict(pairs)
    if len(found) < len(pairs):
        _refuse_twice(key for key, _ in pairs)
    return found


def _refuse_twice(keys: Iterable[Any]) -> None:
    """Refuse keys of one object of which two are the same; the sentence names the first such."""
    seen: set[Any] = set()
    for key in keys:
        if key in seen:
            raise DocumentError(f'it has the key "{shown(str(key))[:60]}" twice in one place: take one away')
        seen.add(key)


def _refuse_deep(value: Any, left: int) -> None:
    inside: list[Any] = list(cast("dict[str, Any]", value).values()) if isinstance(value, dict) else value
    if not left:
        raise DocumentError("it is nested too deeply")
    for one in inside:
        if isinstance(one, dict | list):
            _refuse_deep(one, left - 1)


def read_yaml(path: Path) -> Any:
    """Return what a YAML file holds; OpenCV's first line ``%YAML:1.0`` is let pass.

    Parameters
    ----------
    path : of the file, in UTF-8.

    Raises
    ------
    OSError
        If it cannot be opened, is no ordinary file, or is longer.
    DocumentError
        If it is no YAML, nested too deeply, has a key twice, or grows beyond measure by its aliases.
    """
    import yaml

    text = _text(path, LARGEST_YAML)
    if text.startswith("%YAML"):
        text = text.partition("\n")[2]
    loader = yaml_loader()
    try:
        node = composed(text, loader)
        _refuse_keys(node)
        return None if node is None else loader("").construct_document(node)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" (a mistake in line {mark.line + 1})" if mark is not None else ""
        raise DocumentError(f"it is no YAML{where}") from None
    except (ValueError, OverflowError, TypeError) as error:
        if isinstance(error, DocumentError):
            raise
        raise DocumentError(f"it holds a value that cannot be ({str(error)[:60]})") from None


def _refuse_keys(root: Any) -> None:
    """Refuse a mapping that has a key twice, anywhere in a document."""
    level, seen = [root], set[int]()
    while level:
        node = level.pop()
        if node is None or node.id == "scalar" or id(node) in seen:
            continue
        seen.add(id(node))
        if node.id == "mapping":
            _refuse_twice(key.value for key, _ in node.value if key.id == "scalar")
            level += [part for pair in node.value for part in pair]
        else:
            level += node.value


def yaml_loader() -> Any:
    """Return PyYAML's safe loader, the one in C where it was built with it."""
    import yaml

    library = cast("Any", yaml)
    return getattr(library, "CSafeLoader", library.SafeLoader)


def composed(text: str, loader: Any) -> Any:
    """Return the root node of a YAML text, None of an empty one.

    Parameters
    ----------
    text : of the document.
    loader : class of PyYAML.

    Raises
    ------
    yaml.YAMLError
        If it is no YAML; the error has the place.
    DocumentError
        If it is nested too deeply, refers to itself, or is too large with what its aliases repeat.
    """
    import yaml

    library = cast("Any", yaml)
    sizes: dict[str, int] = {}
    begun: list[tuple[str | None, int]] = [(None, 0)]
    # Composing recurses, in C without a limit: so deep a text ends the program. Events do not.
    for event in library.parse(text, Loader=loader):
        if isinstance(event, library.CollectionStartEvent):
            begun.append((event.anchor, 1))
            if len(begun) > DEEPEST:
                raise DocumentError("it is nested too deeply")
            continue
        if isinstance(event, library.CollectionEndEvent):
            anchor, size = begun.pop()
        elif isinstance(event, library.AliasEvent):
            anchor, size = event.anchor, sizes.get(event.anchor, 1)
            if any(anchor == above for above, _ in begun):
                raise DocumentError("it refers to itself")
        elif isinstance(event, library.ScalarEvent):
            anchor, size = event.anchor, 1
        else:
            continue
        if anchor:
            sizes[anchor] = size
        begun[-1] = (begun[-1][0], begun[-1][1] + size)
        if begun[-1][1] > MOST_ENTRIES:
            raise DocumentError(f"it holds more than {MOST_ENTRIES} entries, with those that aliases repeat")
    return library.compose(text, Loader=loader)
