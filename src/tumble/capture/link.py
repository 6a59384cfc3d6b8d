"""The lines of a port or a socket: opened again when lost, and rows of text made of what comes, as it comes."""

from __future__ import annotations

import math
import time
from binascii import crc_hqx
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Protocol, TypeAlias

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.capture.apart import SensorLines, is_of_sensors
from tumble.capture.source import Channels, Notice, Piece, Source, SourceOptions
from tumble.capture.stamps import ArrivalClock
from tumble.errors import RecordingError, UsageError
from tumble.recording import (
    COMMENTS,
    LONGEST_LINE,
    Asked,
    BlockState,
    ColumnPlan,
    DeclaredUnits,
    Interpretation,
    RawTable,
    Remark,
    Row,
    Samples,
    choose_columns,
    interpret,
    names_of_sentence,
    plan_from_names,
    read_units_option,
    row_of,
    without_clock,
    words_of,
)
from tumble.units import COUNTS, time_factor


class TextLines:
    """Lines in, samples out.

    Parameters
    ----------
    options, name : what the lines do not say themselves, and what they are called.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self.rows = Rows(options, name)
        self.good = self.damaged = 0
        self._rest = b""
        self._header: tuple[str, ...] | None = None
        self._uni = False

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return the samples of the lines that are complete."""
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            self._rest = b""
            self.damaged += 1
        for line in lines:
            self._take(line)
        return self.rows.flush(arrived)

    def end(self) -> list[Piece]:
        """Return what is left; a last line without its end is a line."""
        self._take(self._rest)
        return self.rows.end()

    def _take(self, raw: bytes) -> None:
        line = raw.strip()
        if not line:
            return
        text, _ = without_clock(line.decode("utf-8", "replace")) if len(line) <= LONGEST_LINE else ("", None)
        words = words_of(text)
        if words is not None and words == self._header:
            # Said again, for those who began to listen later.
            return
        # A greeting of the board has words, too: the names of columns go before it.
        if (
            words is not None
            and not self.rows.decided
            and (self._header is None or plan_from_names(words) is not None)
        ):
            self._header = words
            return
        row = _of_sentence(text) if text.startswith("$") else row_of(text)
        if row is None:
            self.damaged += not text.startswith((*COMMENTS, "Cal"))
            return
        if row.kind == "motioncal":
            # `Raw:` and `Uni:` repeat each other, and `Uni:` has the finer steps.
            self._uni = self._uni or text.startswith("Uni")
            if self._uni and not text.startswith("Uni"):
                return
        names = row.names
        if names is None and self._header is not None and len(self._header) == len(row.values):
            names = self._header
        if self.rows.add(names, row.values):
            self.good += 1
        else:
            self.damaged += 1


def _of_sentence(text: str) -> Row | None:
    """What a navigation unit's sentence says, if its checksum is right: XOR, or the CRC of CCITT, or XX for none."""
    body, _, check = text[1:].partition("*")
    said = body.encode()
    right = (f"{reduce(int.__xor__, said, 0):02X}", f"{crc_hqx(said, 0):04X}", "XX")
    names = names_of_sentence(f"${body}".split(","))
    if names is None or check.strip().upper() not in right:
        return None
    try:
        values = tuple(map(float, body.split(",")[1:]))
    except ValueError:
        return None
    return Row(names[1:], values, "sentence") if all(map(math.isfinite, values)) else None


# s, and rows, after which it is decided what the columns are; of a file that is there at once the rows alone.
LINES_LAST, FEWEST_ROWS, ENOUGH_ROWS = 1.0, 20, 400

Shape = tuple[str, ...] | int


class Rows:
    """Rows in, channels and samples out.

    Parameters
    ----------
    options, name : what the rows do not say themselves, and what the stream is called.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self._options, self._name = options, name
        self._waiting: list[tuple[Shape, tuple[float, ...]]] = []
        self._arrivals: list[float] = []
        self._latest = 0.0
        self._begun: float | None = None
        self._shape: Shape | None = None
        self._plan: ColumnPlan | None = None
        self._decided: Interpretation | None = None
        self._clock = ArrivalClock(options.rate)

    @property
    def decided(self) -> bool:
        """Whether the columns are known."""
        return self._decided is not None

    def add(self, names: tuple[str, ...] | None, values: tuple[float, ...]) -> bool:
        """Take a row, and return whether it is one like the others.

        Parameters
        ----------
        names : of its numbers, if it says them.
        values : the numbers.
        """
        shape: Shape = len(values) if names is None else names
        if self._shape is not None and shape != self._shape:
            # Names that were said later, or not said again, are those of as many numbers.
            named, width = isinstance(shape, tuple), _width(self._shape)
            if named == isinstance(self._shape, tuple) or len(values) != width:
                return False
            shape = self._shape
        self._waiting.append((shape, values))
        return True

    def flush(self, arrived: float) -> list[Piece]:
        """Return what the rows so far come to.

        Parameters
        ----------
        arrived : s on the host's clock, of the rows since the last call.

        Raises
        ------
        RecordingError
            If they can be no recording; the message says why.
        """
        self._latest = arrived
        self._arrivals += [arrived] * (len(self._waiting) - len(self._arrivals))
        if not self._waiting:
            return []
        if self._begun is None:
            self._begun = arrived
        if self._decided is None:
            count = len(self._waiting)
            if count < FEWEST_ROWS or (arrived - self._begun < LINES_LAST and count < ENOUGH_ROWS):
                return []
            return self._decide()
        return self._samples()

    def end(self) -> list[Piece]:
        """Return what is left when nothing follows.

        Raises
        ------
        RecordingError
            If the rows can be no recording.
        """
        # A last line without its end comes in here, behind the last time that anything arrived.
        self._arrivals += [self._latest] * (len(self._waiting) - len(self._arrivals))
        if not self._waiting:
            return []
        return self._samples() if self._decided is not None else self._decide()

    def _decide(self) -> list[Piece]:
        """Find out what the columns are, as for a file."""
        named = {len(shape): shape for shape, _ in self._waiting if isinstance(shape, tuple)}
        # The names of the columns may come after the first rows.
        self._waiting = [
            (named.get(shape, shape) if isinstance(shape, int) else shape, values)
            for shape, values in self._waiting
        ]
        self._shape = Counter(shape for shape, _ in self._waiting).most_common(1)[0][0]
        table = self._table()
        options = self._options
        asked = Asked(options.columns, read_units_option(options.units), options.rate)
        plan, remarks = choose_columns(table, asked)
        if not {"a", "g"} & {*plan.triads}:
            raise RecordingError(
                f"{table.path.name} has a magnetometer alone, and neither accelerometer nor gyro: there is nothing to "
                "guide. If its columns are the accelerometer's, say so with --columns."
            )
        if plan.time is None:
            table.columns.append(self._arrival_stamps())
            table.names = None if table.names is None else (*table.names, "t [s]")
            plan = replace(plan, time=len(table.columns) - 1, units=plan.units | {"t": "s"})
            # Stamps of arrival are as late as the line is: the rate is checked later, over two seconds.
            asked = replace(asked, rate=None)
        decided, _ = interpret(table, plan, asked, remarks, BlockState())
        self._plan = plan
        decided = _without_guesses(decided, asked.units)
        channels = Channels(
            None if "a" not in plan.triads else decided.units.get("a", COUNTS),
            None if "g" not in plan.triads else decided.units.get("g", COUNTS),
            options.rate or decided.rate,
            plan.temperature is not None,
            tuple(remark.text for remark in decided.remarks),
            # Nothing but the whole recording shows a unit that nobody says.
            None if "m" not in plan.triads else asked.units.magnetic_field or plan.units.get("m", ""),
        )
        self._decided = decided
        made = self._made(table.columns)
        self._waiting.clear()
        self._arrivals.clear()
        return [channels, made]

    def _table(self) -> RawTable:
        rows = [
            (values, at)
            for (shape, values), at in zip(self._waiting, self._arrivals, strict=True)
            if shape == self._shape
        ]
        self._waiting = [(self._shape or 0, values) for values, _ in rows]
        self._arrivals = [at for _, at in rows]
        columns = list(np.array([values for values, _ in rows], dtype=float).T)
        names = self._shape if isinstance(self._shape, tuple) else None
        return RawTable(Path(self._name), names, columns)

    def _arrival_stamps(self) -> Series:
        """Stamps of rows that bring none, batch by batch as they arrived."""
        stamps: list[np.ndarray] = []
        start = 0
        for stop in range(1, len(self._arrivals) + 1):
            if stop == len(self._arrivals) or self._arrivals[stop] != self._arrivals[start]:
                stamps.append(self._clock.stamp(stop - start, self._arrivals[start]))
                start = stop
        return np.concatenate(stamps)

    def _samples(self) -> list[Piece]:
        table = self._table()
        if not len(table):
            return []
        assert self._plan is not None
        if self._plan.time == len(table.columns):
            table.columns.append(self._arrival_stamps())
        self._waiting.clear()
        self._arrivals.clear()
        return [self._made(table.columns)]

    def _made(self, columns: list[Series]) -> Samples:
        plan, decided = self._plan, self._decided
        assert plan is not None
        assert decided is not None
        assert plan.time is not None

        def triad(kind: str, factor: float) -> Vectors | None:
            axes = [sign * factor * columns[index] for index, sign in plan.triads.get(kind, ())]
            return np.column_stack(axes) if axes else None

        return Samples(
            columns[plan.time] * time_factor(decided.units.get("t", "s")),
            triad("a", decided.factors.get("a", 1.0)),
            triad("g", decided.factors.get("g", 1.0)),
            None if plan.temperature is None else columns[plan.temperature],
            triad("m", 1.0),
        )


def _width(shape: Shape) -> int:
    return shape if isinstance(shape, int) else len(shape)


def _without_guesses(decided: Interpretation, units: DeclaredUnits) -> Interpretation:
    """Take a gyro's unit that nobody stated as counts: at rest nothing shows it, and a wrong one in a file is worse."""
    stated = units.angular_rate or units.angle_increment or decided.plan.units.get("g")
    unchecked = any(r.kind == "unchecked" and r.text.startswith("The gyro's unit") for r in decided.remarks)
    if stated or not unchecked or decided.units.get("g") == COUNTS:
        return decided
    text = "Nobody says the gyro's unit, and at rest nothing shows it: it is taken as counts (say it with --units)."
    kept = [r for r in decided.remarks if not r.text.startswith(("Angular rate is taken", "The gyro's unit"))]
    return replace(decided.told("g", COUNTS), remarks=(*kept, Remark("assumed", text)))


# s between attempts to open a lost line again, and of a read.
AGAIN, READ = 0.5, 0.1
# Bytes, and s, after which it is decided what a line sends.
ENOUGH_TO_TELL, LONG_ENOUGH = 2048, 1.0
# Of the lines, as many may be damaged before it is said.
DAMAGED = 0.05


class Link(Protocol):
    """An open line."""

    def read(self, seconds: float) -> bytes | None:
        """Return what came, nothing after some seconds, or None at the end for good; an OSError where it is lost."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Decoder(Protocol):
    """Makes samples of bytes. Garbage and half lines are counted and passed over, never raised.

    Attributes
    ----------
    good, damaged : how many lines there were.
    """

    good: int
    damaged: int

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Take bytes that arrived at a time (s on the host's clock), and return what is complete."""
        ...

    def end(self) -> list[Piece]:
        """Return what is left when nothing follows."""
        ...


Line: TypeAlias = tuple[Callable[[], Link], str]
"""How a line is opened, and what it is called in messages."""


def source_of_lines(name: str, title: str, example: str, find: Callable[[str], Line]) -> Source:
    """Return a source that sends lines of text or of JSON.

    Parameters
    ----------
    name, title, example : as of every source.
    find : from what stands behind the colon to the line; it may refuse an address.
    """
    return Source(name, title, example, lambda address, options: _pieces(*find(address), options))


def _pieces(connect: Callable[[], Link], name: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what a line sends; a line that is lost is told, and opened again when it is back."""
    link: Link | None = connect()
    stream = _Stream(options, name)
    try:
        while True:
            if link is None:
                yield None
                time.sleep(AGAIN)
                with suppress(OSError, UsageError):
                    link = connect()
                    yield Notice("remark", f"{name} is open again.")
                continue
            try:
                data = link.read(READ)
            except OSError:
                with suppress(OSError):
                    link.close()
                link = None
                yield Notice("silence", f"{name} is gone: see to the cable. It goes on when it is back.")
                continue
            if data is None:
                yield from stream.end()
                return
            yield from stream.take(data) if data else [None]
    finally:
        if link is not None:
            link.close()


class _Stream:
    """Bytes until it is known what they are, then a decoder."""

    def __init__(self, options: SourceOptions, name: str) -> None:
        self._options, self._name = options, name
        self._head = b""
        self._begun = time.monotonic()
        self._decoder: Decoder | None = None
        self._said = False

    def take(self, data: bytes) -> list[Piece]:
        """Return what is complete."""
        now = time.monotonic()
        if self._decoder is None:
            self._head += data
            late = len(self._head) > ENOUGH_TO_TELL or now - self._begun > LONG_ENOUGH
            if not late and not is_of_sensors(self._head):
                return [None]
            self._decoder = self._found()
            data, self._head = self._head, b""
        pieces = self._decoder.feed(data, now)
        damaged, total = self._decoder.damaged, self._decoder.damaged + self._decoder.good
        if not self._said and total >= 50 and damaged > DAMAGED * total:
            self._said = True
            words = f"{damaged} of {total} lines cannot be read: see to baud rate and cable."
            pieces.append(Notice("caution", words))
        return pieces or [None]

    def end(self) -> list[Piece]:
        """Return what is left."""
        if self._decoder is None and self._head:
            self._decoder = self._found()
            return self._decoder.feed(self._head, time.monotonic()) + self._decoder.end()
        return [] if self._decoder is None else self._decoder.end()

    def _found(self) -> Decoder:
        kind = SensorLines if is_of_sensors(self._head) else TextLines
        return kind(self._options, self._name)
