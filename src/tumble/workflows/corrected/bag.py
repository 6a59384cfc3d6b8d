"""A bag with its IMU's messages corrected and everything else as it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from pathlib import Path

import numpy as np

from tumble.arrays import Vectors
from tumble.document import Calibration
from tumble.document.corrector import Corrector
from tumble.errors import OutputError, UsageError
from tumble.files import filled_folder, written_beside
from tumble.recording.formats.bags.bag import Bag, Choice, Topic, choose_topics
from tumble.recording.formats.bags.ros_messages import Decoded, Substitute, decode, substituted
from tumble.recording.rewriting import Exchange, opened_bag, write_anew
from tumble.records import dataclass
from tumble.workflows.corrected.lag_shift import NEEDS_BOTH, ForceShift

_BATCH = 4096  # messages that are corrected together
_Message = tuple[str, int, bytes]
_Pair = tuple[str, bytes, bytes]


@dataclass(slots=True)
class BagCorrection:
    """What is done to the messages of a bag.

    Attributes
    ----------
    calibration, outside, temperature : as `apply` takes them.
    factors : from the messages' numbers to the calibration's raw units.
    lag : s, of the accelerometer behind the gyro, which is taken out, or None.
    marks : identities that the corrected topics get.
    progress : is given the number of messages done.
    told : sentences for the user.
    """

    calibration: Calibration
    outside: str
    temperature: float | None
    factors: tuple[float, float]
    lag: float | None
    marks: Sequence[str]
    progress: Callable[[int], None] | None = None
    told: list[str] = field(default_factory=list[str])

    def write(self, path: Path, target: Path, topics: Sequence[str]) -> int:
        """Write the corrected bag and return how many messages were corrected.

        Parameters
        ----------
        path, target : of the bag, and of its copy.
        topics : that are asked for, or none.

        Raises
        ------
        RecordingError
            If the bag cannot be read or copied.
        UsageError
            If what is asked for cannot be, or the place is none for a result.
        OutputError
            If it cannot be written; what was there is intact.
        """
        with opened_bag(path) as bag:
            choice = choose_topics(bag, topics)
            self._refuse_apart(choice)
            work = _Work(self, bag, choice)
            exchange = Exchange(path.name, dict.fromkeys(choice.names(), self.marks), work.pairs())
            if path.is_dir():
                _write_folder(bag, target, exchange)
            else:
                with written_beside(target) as beside:
                    write_anew(bag, beside, exchange)
            self.told += [f"{r.kind}: {r.text}" for r in bag.remarks]
            self.told += work.remarks(path.name)
            return exchange.count

    def _refuse_apart(self, choice: Choice) -> None:
        """Refuse what acts from one triad on the other where each has a topic of its own."""
        if choice.force == choice.rates:
            return
        both = choice.force is not None and choice.rates is not None
        gyroscope = self.calibration.gyroscope
        if self.lag is not None and not both:
            raise UsageError(NEEDS_BOTH)
        what = None
        if gyroscope is not None and gyroscope.g_sensitivity is not None:
            what = "a g-sensitivity of the gyro, which takes the specific force at the gyro's instants"
        elif self.calibration.lever_arms is not None:
            what = "lever arms of the accelerometers, which take the angular rate at their instants"
        if what is not None:
            raise UsageError(
                f"The calibration has {what}, and the bag has a topic for each triad: write .csv or .parquet, where "
                "both are put on one time base."
            )


def _write_folder(bag: Bag, target: Path, exchange: Exchange) -> None:
    """Write a bag of several files; all of them take their places, or none."""
    if target.exists() and not target.is_dir():
        raise UsageError(
            f"{target} is a file, and the copy of this bag is a folder: give another name with -o."
        )
    try:
        with filled_folder(target) as folder:
            write_anew(bag, folder, exchange)
            there = {p.name for p in target.iterdir() if p != folder}
            strange = sorted(there - {p.name for p in folder.iterdir()})
            if strange:
                raise UsageError(
                    f"{target} holds {strange[0]}, which is no file of this bag: give a new folder with -o."
                )
    except OSError as error:
        raise OutputError(f"{target} could not be written: {error.strerror or error}.") from error


@dataclass(slots=True)
class _Line:
    """One topic on its way: what of it is corrected, and how far it is."""

    topic: Topic
    force: bool
    rates: bool
    corrector: Corrector
    last: float = -np.inf
    out_of_order: int = 0


class _Work:
    """Messages in the order of the files, corrected some thousands at a time."""

    def __init__(self, task: BagCorrection, bag: Bag, choice: Choice) -> None:
        self._task = task
        self._messages = bag.messages
        self._names = choice.names()
        known = {t.name: t for t in bag.topics}
        outside = task.outside
        assert outside in ("refuse", "hold", "extrapolate")
        self._lines = {
            name: _Line(
                known[name], name == choice.force, name == choice.rates, Corrector(task.calibration, outside)
            )
            for name in self._names
        }
        together = choice.force == choice.rates
        self._shift = ForceShift(task.lag) if together and task.lag is not None else None
        self._done = 0

    def pairs(self) -> Iterator[_Pair]:
        """Yield topic, message as it was and as it becomes."""
        finished = self._shifted() if self._shift is not None else self._plain()
        for batch in finished:
            self._done += len(batch)
            if self._task.progress is not None:
                self._task.progress(self._done)
            yield from batch

    def remarks(self, name: str) -> list[str]:
        """Say what the user has to know of the topics."""
        told = [] if self._shift is None else self._shift.remarks()
        for line in self._lines.values():
            if line.out_of_order:
                told.append(
                    f"{name}: {line.out_of_order} message(s) of {line.topic.name} have a stamp that is not after the "
                    "one before; they are corrected and stay where they are."
                )
        return told

    def _plain(self) -> Iterator[list[_Pair]]:
        for batch in _batches(self._messages(self._names)):
            made: dict[str, Iterator[bytes]] = {}
            for name in dict.fromkeys(n for n, _, _ in batch):
                line = self._lines[name]
                messages, decoded = _decoded(line.topic, [m for m in batch if m[0] == name])
                made[name] = iter(self._put(line, messages, *self._corrected(line, decoded)))
            yield [(n, data, next(made[n])) for n, _, data in batch]

    def _shifted(self) -> Iterator[list[_Pair]]:
        """Yield batches whose specific force is of other instants; what cannot be answered yet waits."""
        assert self._shift is not None
        (line,) = self._lines.values()
        name = line.topic.name
        waiting: list[bytes] = []
        rates: Vectors = np.empty((0, 3))
        for batch in _batches(self._messages(self._names)):
            messages, decoded = _decoded(line.topic, batch)
            force, rate = self._corrected(line, decoded)
            if force is None or rate is None:
                raise UsageError(NEEDS_BOTH)
            waiting += messages
            rates = np.concatenate([rates, rate])
            ready = self._shift.add(decoded.time, force)
            if len(ready):
                made = self._put(line, waiting[: len(ready)], ready, rates[: len(ready)])
                yield [(name, a, b) for a, b in zip(waiting, made, strict=False)]
                waiting, rates = waiting[len(ready) :], rates[len(ready) :]
        if waiting:
            made = self._put(line, waiting, self._shift.rest(), rates)
            yield [(name, a, b) for a, b in zip(waiting, made, strict=True)]

    def _corrected(self, line: _Line, decoded: Decoded) -> tuple[Vectors | None, Vectors | None]:
        steps = np.diff(decoded.time, prepend=line.last)
        line.out_of_order += int(np.count_nonzero(steps <= 0.0))
        line.last = float(decoded.time[-1])
        factors = self._task.factors
        force = decoded.force * factors[0] if line.force else None
        rate = decoded.rate * factors[1] if line.rates else None
        # Numbers that are none stay so.
        with np.errstate(invalid="ignore"):
            return line.corrector.correct(force, rate, decoded.time, self._task.temperature)

    def _put(
        self, line: _Line, messages: list[bytes], force: Vectors | None, rate: Vectors | None
    ) -> list[bytes]:
        put = Substitute(force, rate, shift=self._stamps_shift(line))
        return substituted(line.topic.kind, messages, put, cdr=line.topic.cdr)

    def _stamps_shift(self, line: _Line) -> int:
        """Return by how many ns stamps move: those of an accelerometer with a topic of its own."""
        if self._task.lag is None or self._shift is not None or not line.force:
            return 0
        return -round(1e9 * self._task.lag)


def _batches(messages: Iterator[_Message]) -> Iterator[list[_Message]]:
    batch: list[_Message] = []
    for message in messages:
        batch.append(message)
        if len(batch) >= _BATCH:
            yield batch
            batch = []
    if batch:
        yield batch


def _decoded(topic: Topic, batch: list[_Message]) -> tuple[list[bytes], Decoded]:
    messages = [data for _, _, data in batch]
    return messages, decode(topic.kind, messages, [t for _, t, _ in batch], topic.name, cdr=topic.cdr)
