"""The one way to the terminal: words, tables and JSON, escaped, and what is shown while work is going on.

Names and contents of files may hold what a terminal obeys (ESC sequences, overstriking, reversed reading order).
Whatever a command prints goes through here, where such characters become visible and do nothing.
"""

from __future__ import annotations

import codecs
import json
import os
import re
import signal
import sys
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from tumble.counting import Stage, listening
from tumble.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


state: dict[str, Any] = {"results stand": False, "stopped": ""}
"""Whether files of this call are already in their places, and what a stop leaves, if it is not nothing."""

# Control characters but tab and line feed, line ends of Unicode, signs that reverse reading, broken UTF-8.
_OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
# Signs of ours that an encoding may lack, and how they are written without it.
_PLAIN_SIGNS = {
    "°": " deg",
    "µ": "u",
    "μ": "u",
    "σ": "sigma",
    "±": "+/-",
    "…": "...",
    "−": "-",
    "×": "x",
    "━": "=",
    "╌": "-",
    "•": "*",
    "–": "-",
    "—": "-",
    "″": '"',
    "′": "'",
    "√": "sqrt ",
    "²": "^2",
    "³": "^3",
    "≥": ">=",
    "≤": "<=",
    "χ": "chi",
    "·": " ",
    "π": "pi",
    "τ": "tau",
    "’": "'",
    "“": '"',
    "”": '"',
    "⋅": " ",
    "Δ": "Delta",
}
_WORD, _WORD_KEPT = 300, (120, 60)
_MESSAGE, _MESSAGE_KEPT = 2000, (1200, 400)


class StreamError(OSError):
    """What tumble prints cannot be written: a full output, a device that is gone."""


class _Stream:
    """Standard output or error, whose faults are told from those of files."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        return self._try(lambda: self._stream.write(text))

    def flush(self) -> None:
        self._try(self._stream.flush)

    def _try(self, act: Callable[[], Any]) -> Any:
        try:
            return act()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise StreamError(error.errno, error.strerror) from error

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _in_plain_signs(error: UnicodeError) -> tuple[str, int]:
    """Write what an encoding lacks in signs that it has."""
    assert isinstance(error, UnicodeEncodeError)
    lacking = error.object[error.start : error.end]
    return "".join(_PLAIN_SIGNS.get(sign, _visible(sign)) for sign in lacking), error.end


codecs.register_error("tumble.plain_signs", _in_plain_signs)


@contextmanager
def streams() -> Generator[None, None, None]:
    """Make standard output and error ready for any text, whatever they are connected to, and give them back."""
    before = sys.stdout, sys.stderr
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name) or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (as long as we run)
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="tumble.plain_signs")
        setattr(sys, name, _Stream(stream))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def plain(text: str) -> str:
    r"""Return a text in which what a terminal would obey is written out, ESC as ``\x1b``.

    Parameters
    ----------
    text : anything.
    """
    return _OBEYED.sub(lambda found: _visible(found[0]), text)


def _visible(sign: str) -> str:
    code = ord(sign)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file's name that is no UTF-8
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def shortened(message: str) -> str:
    """Return a message whose long words, and itself, are cut in the middle.

    Parameters
    ----------
    message : that may repeat what was typed or read.
    """
    words = re.sub(rf"\S{{{_WORD},}}", lambda found: _cut(found[0], *_WORD_KEPT), message)
    return words if len(words) <= _MESSAGE else _cut(words, *_MESSAGE_KEPT)


def _cut(text: str, first: int, last: int) -> str:
    return f"{text[:first]}…{text[-last:]}"


def say(*lines: str) -> None:
    """Print lines.

    Parameters
    ----------
    lines : of text.
    """
    for line in lines:
        sys.stdout.write(f"{plain(line)}\n")


def say_aside(line: str) -> None:
    """Print a line on standard error.

    Parameters
    ----------
    line : of text.
    """
    sys.stderr.write(f"tumble: {plain(line)}\n")


def say_written(files: Iterable[Path]) -> None:
    """Print where files are, a folder a line.

    Parameters
    ----------
    files : that were written.
    """
    for folder, own in groupby((file.resolve() for file in files), key=lambda file: file.parent):
        say(f"written: {folder / ', '.join(file.name for file in own)}")


def say_json(document: Any, indent: int = 0) -> None:
    """Print a document as JSON; what is no number is null.

    Parameters
    ----------
    document : of dictionaries, lists, texts, numbers and records of them.
    indent : spaces a level; 0 for one line.
    """
    import msgspec

    try:
        text = msgspec.json.encode(document, enc_hook=lambda number: number.tolist())
    except UnicodeEncodeError:
        raise UsageError("A file's name is no text: rename the file, or leave --json out.") from None
    say_json_text(msgspec.json.format(text, indent=indent).decode() + "\n")


def say_json_text(text: str) -> None:
    """Print a text that is JSON already.

    Parameters
    ----------
    text : with its last line end.
    """
    utf = (getattr(sys.stdout, "encoding", None) or "utf-8").lower().startswith("utf")
    escaped = _OBEYED if utf else re.compile(r"[^\x00-\x7f]")
    sys.stdout.write(escaped.sub(lambda found: json.dumps(found[0])[1:-1], text))


def console(*, soft_wrap: bool = False) -> Console:
    """Return rich's console, which prints text as it is: no markup, and nothing that a terminal obeys.

    Parameters
    ----------
    soft_wrap : leave long lines to the terminal.
    """
    from rich.console import Console
    from rich.text import Text

    class Escaping(Console):
        def render_str(self, text: str, **options: Any) -> Text:
            return super().render_str(plain(text), **options)

        def print(self, *objects: Any, **options: Any) -> None:
            # What is printed is no markup; cells of a table are read as its maker says.
            if all(isinstance(one, str) for one in objects):
                options.setdefault("markup", False)
            super().print(*objects, **options)

    return Escaping(highlight=False, soft_wrap=soft_wrap)


def table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str]] = (),
    *,
    right: Sequence[int] = (),
    title: str | None = None,
    box: str | None = "SIMPLE",
    fold: bool = False,
    tight: bool = False,
) -> Table:
    """Return a table of texts, none of which is read as markup.

    Parameters
    ----------
    heads, rows : of it.
    right : columns that stand at the right, of numbers.
    title : above it.
    box : rich's name of its lines; None for none.
    fold : break long cells within a word.
    tight : with less room between the columns.
    """
    from rich import box as boxes
    from rich.table import Table
    from rich.text import Text

    found = Table(
        title=None if title is None else Text(plain(title), "table.title"),
        title_justify="left",
        box=None if box is None else getattr(boxes, box),
        pad_edge=False,
        padding=(0, 1, 0, 0) if tight else (0, 1),
        highlight=False,
    )
    for place, head in enumerate(heads):
        justify = "right" if place in right else "left"
        found.add_column(Text(plain(head)), justify=justify, overflow="fold" if fold else "ellipsis")
    for row in rows:
        found.add_row(*(Text(plain(cell)) for cell in row))
    return found


@contextmanager
def progress(quiet: bool) -> Generator[Callable[[str], None], None, None]:
    """Give a function that shows a stage in words, with the time left where it is known; silent where nobody looks."""
    if quiet or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.text import Text

    class Words:
        """What is said at each moment: times left grow shorter by themselves."""

        def __rich__(self) -> Text:
            return Text(plain(stage.words(shown.width - 3)))  # a sign that turns stands before it

    stage, shown = Stage(), Console(stderr=True)
    stage.begin("starting")
    with shown.status(Words()), listening(stage.at):
        yield stage.begin


def results_stand() -> None:
    """Ignore stops from here on: the files are in their places, and only words about them are left."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    state["results stand"] = True
