"""Random changes of files: of bytes, of the words and lines of a text, of the entries of a JSON document."""

import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np

NUMBERS = (
    "0", "-0",
    "1", "-1", "1e-300", "1e300", "-1e300", "1.7976931348623157e308", "5e-324", "1e999", "nan", "inf", "-inf",
    "NaN", "1e1", "1e-5", "255", "256", "65536", "4294967295", "4294967296", "9223372036854775808", "1e30", "0x10",
    "1_0", "1,5", "--1", "+", ".", "e", "\u0661", "\u00bd", "1" * 60, "9" * 400, "9" * 5000, "",
)  # fmt: skip
WORDS = (
    "x", "t", "null", "true", "~", "t,t,t,t,t,t,t", "\ud800".encode("utf-8", "surrogatepass").decode("latin-1"), "\0",
    "\x0b", "\x0c", "\x1b[2J", "\x85", "\u2028", "\u202e", "\ufeff", "\u00e9", "\r", "\n\n", "\t", " ", ",", ";", "\"",
    "'", "#", "//", "%", "!", "{{{", "[" * 200, "{" * 200, "*a", "&a", "&a [*a]", "- ", ": ", "../../x", "/dev/zero",
    "A" * 5000, "{", "}", "[", "]", "\\", "\\u0000", "\\ud800", "!!python/name:os.system", "<script>", "%s", "{0}",
)  # fmt: skip
OCTETS = (
    b"\x00", b"\xff", b"\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"\xff\xff\xff\x7f", b"\x00" * 8, b"\xff" * 8,
    b"\x00" * 7 + b"\x80",
    b"\xff" * 7 + b"\x7f", b"\x00\x00\x00\x00\x00\x00\xf0\x7f", b"\x01\x00\x00\x00", b"\n", b"\r",
    b"PK\x03\x04", b"\x1f\x8b", b"\x28\xb5\x2f\xfd", b"\x93NUMPY", b"PAR1", b"\x89HDF\r\n\x1a\n", b"{", b"\xed\xa0\x80",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1e300, -1e300, 1e-300, 10**30, 10**400, "", "x", "nan", "a\nb", "\u2028", "\x1b[2J", [],
    {}, [[]], [None], {"a": 1}, "9" * 5000, [1e308] * 3, [[0, 0, 0]] * 3, float("nan"), float("inf"),
)  # fmt: skip
Change = Callable[[bytes, np.random.Generator], bytes]


def pick(choices: Any, rng: np.random.Generator) -> Any:
    return choices[int(rng.integers(len(choices)))]


def _span(content: bytes, rng: np.random.Generator) -> tuple[int, int]:
    start = int(rng.integers(len(content) + 1))
    return start, min(len(content), start + int(2 ** rng.uniform(0, 10)))


def _word(rng: np.random.Generator) -> bytes:
    return bytes(pick((*WORDS, *NUMBERS), rng).encode("utf-8", "replace"))


def flip(content: bytes, rng: np.random.Generator) -> bytes:
    """Turn some bits over."""
    octets = bytearray(content)
    for at in rng.integers(0, len(octets), size=int(rng.integers(1, 9))) if octets else ():
        octets[at] ^= 1 << int(rng.integers(8))
    return bytes(octets)


def overwrite(content: bytes, rng: np.random.Generator) -> bytes:
    """Write extreme bytes over others, half the time over the header."""
    start = _span(content if rng.random() < 0.5 else content[:128], rng)[0]
    new = pick(OCTETS, rng)
    return content[:start] + new + content[start + len(new) :]


def cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def drop(content: bytes, rng: np.random.Generator) -> bytes:
    start, stop = _span(content, rng)
    return content[:start] + content[stop:]


def repeat(content: bytes, rng: np.random.Generator) -> bytes:
    """Write a span twice or many times."""
    start, stop = _span(content, rng)
    return content[:stop] + content[start:stop] * int(2 ** rng.uniform(0, 5)) + content[stop:]


def insert(content: bytes, rng: np.random.Generator) -> bytes:
    """Write a word or bytes between others."""
    start = _span(content, rng)[0]
    new = pick(OCTETS, rng) if rng.random() < 0.3 else pick(WORDS, rng).encode("utf-8", "replace")
    return content[:start] + new + content[start:]


def _replaced(content: bytes, pattern: bytes, new: bytes, rng: np.random.Generator) -> bytes:
    """Replace one match in a text."""
    found = list(re.finditer(pattern, content[:200_000]))
    if not found:
        return insert(content, rng)
    match = pick(found, rng)
    return content[: match.start()] + new + content[match.end() :]


def number(content: bytes, rng: np.random.Generator) -> bytes:
    return _replaced(content, rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", pick(NUMBERS, rng).encode(), rng)


def word(content: bytes, rng: np.random.Generator) -> bytes:
    return _replaced(content, rb"[A-Za-z_]+", _word(rng), rng)


def line(content: bytes, rng: np.random.Generator) -> bytes:
    """Drop, double, move or replace one line."""
    lines = content.split(b"\n")
    at, how = int(rng.integers(len(lines))), int(rng.integers(4))
    held = lines.pop(at)
    elsewhere = int(rng.integers(len(lines) + 1))
    place, new = ((at, []), (at, [held, held]), (elsewhere, [held]), (at, [_word(rng)]))[how]
    lines[place:place] = new
    return b"\n".join(lines)


def entry(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace, drop or double one entry of a JSON document."""
    try:
        document: Any = json.loads(content)
    except (ValueError, RecursionError):
        return number(content, rng)
    places: list[tuple[Any, Any]] = []
    level = [document]
    while level:
        value = level.pop()
        keys: Any = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
        places += [(value, key) for key in keys]
        level += [value[key] for key in keys]
    if not places:
        return content
    parent, key = pick(places, rng)
    how = int(rng.integers(6))
    if how == 0:
        del parent[key]
    elif how == 1 and isinstance(parent, list):
        parent.insert(key, parent[key])
    elif how == 2 and type(parent[key]) in (int, float) and abs(parent[key]) < 1e290:
        parent[key] = parent[key] * float(10.0 ** rng.uniform(-12, 12))
    else:
        parent[key] = pick(VALUES, rng)
    return json.dumps(document, default=str).encode()


def argument(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace, drop or double one word of a call; where results go stays as it is."""
    words: list[str] = json.loads(content)
    free = [n for n in range(1, len(words)) if words[n - 1] not in ("-o", "--save") and words[n] != "-o"]
    if not free:
        return content
    at, how = pick(free, rng), int(rng.integers(8))
    if how == 0:
        del words[at]
    elif how == 1:
        words.insert(at, words[at])
    elif how == 2:
        words[at] = ",".join([words[at], pick(NUMBERS, rng)][:: 1 if rng.random() < 0.5 else -1])
    elif how == 3 and (numbers := re.findall(r"[-+]?\d+\.?\d*", words[at])):
        scaled = float(pick(numbers, rng)) * float(10.0 ** rng.uniform(-9, 9))
        words[at] = re.sub(r"[-+]?\d+\.?\d*", f"{scaled:.6g}", words[at], count=1)
    else:
        words[at] = pick(NUMBERS if rng.random() < 0.7 else WORDS, rng)
    # The system gives a program words of bytes without a zero.
    return json.dumps([word.replace("\0", "") for word in words]).encode()


def column(content: bytes, rng: np.random.Generator) -> bytes:
    """Change the numbers of one column, or some rows, of a table of commas as no sensor but a fault would."""
    header, _, body = content.decode().partition("\n")
    table = np.array([[float(cell or "nan") for cell in line.split(",")] for line in body.splitlines()])
    at, how = int(rng.integers(table.shape[1])), int(rng.integers(12))
    start, stop = np.sort(rng.integers(0, len(table) + 1, 2))
    with np.errstate(all="ignore"):
        if how == 0:
            table[:, at] *= 10.0 ** rng.uniform(-40, 40)
        elif how == 1:
            table[:, 1:] *= 10.0 ** rng.uniform(-30, 30)
        elif how == 2:
            table[start:stop, at] = pick((0.0, 1.0, np.nan, 1e29, -1e29, 1e-300), rng)
        elif how == 3:
            table[:, at] += 10.0 ** rng.uniform(-3, 15)
        elif how in (4, 5):
            table = table[start:stop] if how == 4 else np.delete(table, np.s_[start:stop], axis=0)
        elif how == 6:
            table[start:stop] = table[min(start, len(table) - 1)]
        elif how == 7:
            table[:, at] = np.round(table[:, at], int(rng.integers(-1, 2)))
        elif how == 8:
            table[:, 0] = 0.0 if rng.random() < 0.5 else np.cumsum(rng.uniform(0, 0.1, len(table)))
        elif how == 9:
            table[:, [at, int(rng.integers(7))]] = 0.0
        elif how == 10:
            table[rng.integers(0, len(table), 5), at] = 10.0 ** rng.uniform(-5, 29)
        else:
            table[:, 1:] = rng.normal(0.0, 10.0 ** rng.uniform(-9, 3), table[:, 1:].shape)
    cells = ([("" if np.isnan(v) else f"{v:.6g}") for v in row] for row in table)
    return "\n".join([header, *(",".join(row) for row in cells)]).encode() + b"\n"


BINARY: tuple[Change, ...] = (flip, overwrite, cut, drop, repeat, insert)
TEXT: tuple[Change, ...] = (*BINARY, number, number, word, line, line)
CALL: tuple[Change, ...] = (argument,)
COLUMNS: tuple[Change, ...] = (column,)
JSON: tuple[Change, ...] = (*TEXT, entry, entry, entry, entry, entry)


def changed(content: bytes, changes: tuple[Change, ...], rng: np.random.Generator) -> bytes:
    """Return content after one to four changes."""
    for _ in range(int(rng.integers(1, 5))):
        content = pick(changes, rng)(content, rng)
    return content
