"""Reading what a user names: ordinary files only; text, JSON and YAML of unknown origin whole, or refused.

Texts have a bounded size, documents also a depth, digits and repetition. Here is also what a line, a hidden character
and a number are.
"""

from __future__ import annotations

import errno
import json
import math
import os
import re
import stat
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from tumble.errors import TumbleError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jinja2 import Environment


HIDDEN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, separators of lines, marks that turn the direction of writing, halves of characters."""
# A user with a password, as a URL has them: also where its scheme was left out.
_SECRET = re.compile(r"(?<=://)[^\s/'\"@]+@|[^\s/'\"@:]+:[^\s/'\"@]+@")


def shown(text: str) -> str:
    """Return a text on one line, each hidden character as its number.

    Examples
    --------
    >>> shown("MPU-9250")
    'MPU-9250'
    >>> shown("a" + chr(10) + "b")
    'a<U+000A>b'
    """
    return HIDDEN.sub(lambda match: f"<U+{ord(match[0]):04X}>", text)


def without_password(text: str) -> str:
    """Return a text whose URLs have no user and password.

    Examples
    --------
    >>> without_password("tcp://me:secret@host:8786 does not answer")
    'tcp://***@host:8786 does not answer'
    """
    return _SECRET.sub("***@", text)


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, which end with LF, CR LF or CR.

    `str.splitlines` also ends lines at form feeds, vertical tabs, U+0085 and U+2028, as no table and no editor does.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines[:-1] if lines and not lines[-1] else lines


_LONGEST = 400  # characters: 64-bit numbers written out in full have 310 digits before the point


def number_of(value: object) -> float:
    """Return a value of a document, or a word of a text, as a finite number.

    Parameters
    ----------
    value : int, float or text such as ``-1.5e-3``; no truth value, no digits apart by ``_``, no other alphabet's.

    Raises
    ------
    ValueError
        If it is none, or not finite.

    Examples
    --------
    >>> number_of(" 2.5e1 ")
    25.0
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{value!r:.40} is no number")
    if isinstance(value, str) and (len(value) > _LONGEST or "_" in value or not value.isascii()):
        raise ValueError(f"{value[:40]!r} is no number")
    try:
        number = float(value)
    except (ValueError, OverflowError):
        words = f"{value[:40]!r} is no number" if isinstance(value, str) else "it is too large"
        raise ValueError(words) from None
    if not math.isfinite(number):
        raise ValueError(f"{str(value)[:40]} is not finite")
    return number


LARGEST_TEXT = 64 << 20
"""Bytes of a text that is read whole and is no recording, such as a list of intervals or a GNSS track."""

_KINDS = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device or a terminal"),
    (stat.S_ISBLK, "a disk"),
    (stat.S_ISDIR, "a folder"),
)


def kind_of(found: os.stat_result) -> str:
    """Return what something is that is no ordinary file, nothing for one."""
    return next((words for is_kind, words in _KINDS if is_kind(found.st_mode)), "")


def size_of(path: Path) -> int:
    """Return the size in bytes of an ordinary file.

    Raises
    ------
    OSError
        If it is not there, or is a pipe, a socket, a device or a folder; `strerror` says which and what to do.
    """
    found = path.stat()
    if kind := kind_of(found):
        raise OSError(errno.EINVAL, f"it is {kind}: give an ordinary file", os.fspath(path))
    return found.st_size


def opened(path: Path) -> BufferedReader:
    """Open an ordinary file for its bytes.

    Raises
    ------
    OSError
        If it cannot be opened, or is no ordinary file.
    """
    size_of(path)
    return path.open("rb")


@contextmanager
def reading(path: Path, what: str, error: type[TumbleError] = UsageError, hint: str = "") -> Generator[None]:
    """Open and read a file that a user named: whatever is wrong with it is one sentence.

    Parameters
    ----------
    path : of the file.
    what : it should be, with its article.
    error : that the sentence is raised as.
    hint : where such a file comes from, if it is not there.

    Raises
    ------
    TumbleError
        Where an OSError, or a ValueError whose words end a sentence, comes from within.
    """
    try:
        yield
    except FileNotFoundError:
        there = f"There is no {what.removeprefix('a ').removeprefix('an ')} {path}"
        raise error(f"{there}: {hint}." if hint else f"{there}.") from None
    except UnicodeDecodeError as problem:
        raise error(
            f"{path} cannot be read as {what}: it is no text in UTF-8 (byte {problem.start + 1})."
        ) from None
    except OSError as problem:
        raise error(f"{path} cannot be read as {what}: {problem.strerror or problem}.") from problem
    except ValueError as problem:
        raise error(f"{path} cannot be read as {what}: {problem}.") from problem


def read_text(path: Path, largest: int = LARGEST_TEXT, *, errors: str = "strict") -> str:
    """Return the text of a file in UTF-8, with or without its mark.

    Parameters
    ----------
    path : of the file.
    largest : bytes that such a file may have.
    errors : what to do with bytes that are no UTF-8: ``strict`` or ``replace``.

    Raises
    ------
    OSError
        If it cannot be opened, is no ordinary file, or is longer.
    UnicodeDecodeError
        If it is no UTF-8, and `errors` is ``strict``.
    """
    with opened(path) as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        raise OSError(
            errno.EFBIG, f"it is longer than {_in_words(largest)}, which no such file is", os.fspath(path)
        )
    return content.decode("utf-8-sig", errors)


def _in_words(octets: int) -> str:
    return f"{octets >> 20} MB" if octets >= 1 << 20 else f"{octets >> 10} kB"


LARGEST_JSON = 64 << 20
LARGEST_YAML = 1 << 20
DEEPEST = 64
"""Levels of a document: those of tumble have eight at most."""
MOST_ENTRIES = 200_000
"""Entries of a YAML document, those that stand under an alias counted again."""


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
    ValueError
        If it is no UTF-8, no JSON, nested too deeply, has a key twice, or holds a number or a text that cannot be.
    """
    text = read_text(path, largest)
    try:
        reading: Any = {"parse_int": _number, "parse_float": _number, "parse_constant": _number}
        document: Any = json.loads(text, object_pairs_hook=_once, **reading)
    except json.JSONDecodeError as error:
        raise DocumentError(f"it is no JSON ({error.msg}, line {error.lineno})") from None
    except RecursionError:
        raise DocumentError("it is nested too deeply") from None
    if re.search("[\ud800-\udfff]", json.dumps(document, ensure_ascii=False)):
        raise DocumentError("it holds a text with half a character (\\ud800 to \\udfff)")
    _refuse_deep([document], DEEPEST + 1)
    return document


def _number(digits: str) -> float:
    """A number of the text; none that is beyond a 64-bit float, or not a number."""
    value = float(digits)
    if not abs(value) < float("inf"):
        raise DocumentError(f"it holds the number {digits[:20]}{'…' * (len(digits) > 20)}, which cannot be")
    return int(digits) if digits.lstrip("-").isdecimal() else value


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
    ValueError
        If it is no UTF-8, no YAML, nested too deeply, has a key twice, or grows beyond measure by its aliases.
    """
    import yaml

    text = read_text(path, LARGEST_YAML)
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


@cache
def templates(room: str = "report") -> Environment:
    """Return the templates of a room; those of `report` are its pages and what a notebook shows."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(str(files("tumble") / room / "templates")),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def notebook_html(
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    title: str = "",
    words: str = "",
    notes: Sequence[str] = (),
    foot: str = "",
) -> str:
    """Return a table as a notebook shows it.

    Parameters
    ----------
    heads, rows : of the table; no heads for a table whose first column names the rows.
    title, words, notes : above it, the notes as a list.
    foot : below it.
    """
    given = {"heads": heads, "rows": rows, "title": title, "words": words, "notes": notes, "foot": foot}
    return templates().get_template("notebook.html").render(given)
