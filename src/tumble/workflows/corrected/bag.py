"""A bag with its IMU's messages corrected and everything else as it was."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tumble.arrays import Vectors
from tumble.document.corrector import Corrector
from tumble.errors import OutputError, UsageError
from tumble.files import filled_folder, written_beside
from tumble.recording import Recording
from tumble.recording.formats.bags.bag import Bag, Choice, Topic, choose_topics
from tumble.recording.formats.bags.ros_messages import Decoded, Substitute, decode, substituted
from tumble.recording.rewriting import Exchange, opened_bag, write_anew
from tumble.records import dataclass
from tumble.workflows.corrected.corrections import Correction
from tumble.workflows.corrected.form import NEEDS_BOTH, ForceShift, shifted

_BATCH = 4096  # messages that are corrected together
_Message = tuple[str, int, bytes]
_Pair = tuple[str, bytes, bytes]


def write_corrected_bag(
    task: Correction, path: Path, target: Path, topics: Sequence[str], marks: Sequence[str]
) -> tuple[int, list[str]]:
    """Write the corrected bag; return how many messages were corrected, and sentences for the user.

    Parameters
    ----------
    task : how they are corrected.
    path, target : of the bag, and of its copy.
    topics : that are asked for, or none.
    marks : identities that the corrected topics get.

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
        _refuse_apart(task, choice)
        work = _Work(task, bag, choice)
        exchange = Exchange(path.name, dict.fromkeys(choice.names(), marks), work.pairs())
        if path.is_dir():
            _write_folder(bag, target, exchange)
        else:
            with written_beside(target) as beside:
                write_anew(bag, beside, exchange)
        return exchange.count, [*(f"{r.kind}: {r.text}" for r in bag.remarks), *work.remarks(path.name)]


def _refuse_apart(task: Correction, choice: Choice) -> None:
    """Refuse what acts from one triad on the other where each has a topic of its own."""
    if choice.force == choice.rates:
        return
    both = choice.force is not None and choice.rates is not None
    gyroscope = task.calibration.gyroscope
    if task.lag is not None and not both:
        raise UsageError(NEEDS_BOTH)
    what = None
    if gyroscope is not None and gyroscope.g_sensitivity is not None:
        what = "a g-sensitivity of the gyro, which takes the specific force at the gyro's instants"
    elif task.calibration.lever_arms is not None:
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

    def __init__(self, task: Correction, bag: Bag, choice: Choice) -> None:
        self._task = task
        self._messages = bag.messages
        self._names = choice.names()
        known = {t.name: t for t in bag.topics}
        self._lines = {
            name: _Line(
                known[name],
                name == choice.force,
                name == choice.rates,
                Corrector(task.calibration, task.outside),
            )
            for name in self._names
        }
        together = choice.force == choice.rates
        self._shift = ForceShift(task.lag) if together and task.lag is not None else None

    def pairs(self) -> Iterator[_Pair]:
        """Yield topic, message as it was and as it becomes."""
        done = 0
        for batch in self._plain() if self._shift is None else self._shifted(self._shift):
            done += len(batch)
            self._task.progress(done)
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

    def _shifted(self, shift: ForceShift) -> Iterator[list[_Pair]]:
        """Yield batches whose specific force is of other instants; what cannot be answered yet waits."""
        (line,) = self._lines.values()
        waiting: list[bytes] = []

        def blocks() -> Iterator[Recording]:
            for batch in _batches(self._messages(self._names)):
                messages, decoded = _decoded(line.topic, batch)
                waiting.extend(messages)
                yield Recording(decoded.time, *self._corrected(line, decoded), "m/s^2", "rad/s", rate=np.nan)

        for block in shifted(blocks(), shift):
            messages, waiting[:] = waiting[: len(block)], waiting[len(block) :]
            made = self._put(line, messages, block.specific_force, block.angular_rate)
            yield [(line.topic.name, *pair) for pair in zip(messages, made, strict=True)]

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
