"""Correcting a recording of any length with a calibration, block by block.

Of a bag the IMU's messages are corrected, and everything else is as it was.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace
from itertools import chain
from pathlib import Path

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.document import Calibration, Corrector, TriadBlock, read_calibration
from tumble.errors import OutputError, UsageError
from tumble.files import filled_folder, written_beside
from tumble.recording import (
    PLACE,
    Bag,
    Choice,
    Decoded,
    Exchange,
    Recording,
    TemperatureColumn,
    Topic,
    batches,
    choose_topics,
    decode,
    euroc_file,
    find_steps_of_two,
    opened_bag,
    read_blocks,
    substituted,
    write_anew,
    write_blocks,
    write_euroc,
)
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor
from tumble.workflows.corrected import (
    NEEDS_BOTH,
    PREFIX,
    CorrectedField,
    Correction,
    Destination,
    ForceShift,
    about_temperature,
    check_column,
    check_outside,
    check_temperature,
    corrections_of,
    corrects_field,
    destination,
    lag_of,
    refuse_twice,
    shifted,
)
from tumble.workflows.request import ApplyRequest, asked, silent


@dataclass(frozen=True)
class Applied:
    """What `apply` wrote: the file, how many samples, and sentences for the user."""

    file: Path
    samples: int
    remarks: list[str]


@asked(ApplyRequest)
def apply(request: ApplyRequest) -> Applied:
    """Correct a recording and write it in m/s² and rad/s, frame b.

    Memory does not grow with the recording for bags, text, Parquet and NPY. The file says which calibrations it went
    through, so that none is applied twice.

    Raises
    ------
    CalibrationFileError, RecordingError, UsageError
        If an input is wrong, the recording is in other units than the calibration's, or is corrected already.
    ThermalSpanError
        If the temperature leaves the calibrated span and `outside` is ``refuse``.
    OutputError
        If the file cannot be written; an earlier one is intact.
    """
    calibration, paths, temperature = request.calibration, request.paths, request.temperature
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    beyond = check_outside(request.outside)
    files = [Path(paths)] if isinstance(paths, str | os.PathLike) else [Path(path) for path in paths]
    topics = [request.topics] if isinstance(request.topics, str) else request.topics
    goal = destination(request.output, files)
    _refuse_inputs(goal.path, files, calibration)
    lag = lag_of(document) if request.shift_lag else None
    done_before = corrections_of(files, topics)
    refuse_twice(document, done_before)
    blocks = iter(read_blocks(paths, **request.how()))
    first = next(blocks)
    check_temperature(document, first, files, temperature, beyond)
    factors = raw_factors(document, first)
    remarks = [f"{r.kind}: {r.text}" for r in first.remarks if r.kind in ("assumed", "doubtful", "mended")]
    remarks += _about_missing_triads(document, goal)
    magnetometer = CorrectedField.of(document, first, goal.form)
    remarks += magnetometer.remarks
    scaled = in_calibration_units(first, factors)
    remarks += find_steps_of_two(corrected_block(document.corrector(beyond), scaled, temperature))
    marks = [*done_before, document.identity]
    task = Correction(document, beyond, temperature, factors, lag, request.progress or silent)
    if goal.form == "bag":
        if request.columns is not None:
            raise UsageError("--columns is for columns, and a bag has messages: leave it out, or write .csv.")
        first, blocks = None, None
        done, told = write_corrected_bag(task, files[0], goal.path, topics or (), marks)
        return Applied(goal.path, done, list(dict.fromkeys([*remarks, *told])))
    work = _Blocks(task, magnetometer, document.corrector(beyond), TemperatureColumn())
    shift = None if lag is None else ForceShift(lag)
    corrected = work.corrected(chain([first], blocks))
    _write(goal, corrected if shift is None else shifted(corrected, shift), marks, files)
    remarks += [] if shift is None else shift.remarks()
    return Applied(goal.path, work.done, [*remarks, *work.remarks()])


@dataclass
class _Blocks:
    """The blocks of a recording on their way, and what is learnt of them meanwhile."""

    task: Correction
    magnetometer: CorrectedField
    corrector: Corrector
    column: TemperatureColumn
    done: int = 0
    told: list[str] = field(default_factory=list[str])

    def corrected(self, blocks: Iterable[Recording]) -> Iterator[Recording]:
        """Yield them corrected; what cannot be is refused before the file takes its place."""
        task = self.task
        for block in blocks:
            scaled = in_calibration_units(block, task.factors)
            made = corrected_block(self.corrector, scaled, task.temperature)
            yield replace(made, magnetic_field=self.magnetometer.of_block(block))
            if self.done:  # what is said of the first one is said already
                self.told += [f"{r.kind}: {r.text}" for r in block.remarks if r.kind == "mended"]
            self.done += len(block)
            if block.temperature is not None and task.temperature is None:
                self.column.add(block.time, block.temperature)
            task.progress(self.done)
        if task.calibration.thermal is not None:
            self.told += check_column(self.column)

    def remarks(self) -> list[str]:
        """Say what of the temperature is to be known."""
        celsius, column = self.task.temperature, self.column
        span = (column.lowest, column.highest) if celsius is None else (celsius, celsius)
        return [*self.told, *about_temperature(self.task.calibration, self.corrector, span)]


def _write(
    goal: Destination,
    blocks: Iterable[Recording],
    marks: Sequence[str],
    files: Sequence[Path],
) -> None:
    """Write corrected blocks in the form that is wanted."""
    if goal.form == "table":
        named = [PREFIX + mark for mark in marks]
        write_blocks(blocks, goal.path, named, stamped=True)
    else:
        like = files[0] if len(files) == 1 and files[0].is_dir() else None
        write_euroc(blocks, goal.path, marks, like=like)


def _about_missing_triads(document: Calibration, goal: Destination) -> list[str]:
    """Say what is not corrected because the calibration does not know it."""
    told: list[str] = []
    for block, matrix, quantity, message in (
        (document.gyroscope, "gyro", "angular rate", "angular_velocity"),
        (document.accelerometer, "accelerometer", "specific force", "linear_acceleration"),
    ):
        if not _knows(block):
            lost = (
                f"{message} stays as it was"
                if goal.form == "bag"
                else f"the corrected file has no {quantity}"
            )
            told.append(f"The calibration has no {matrix} matrix: {lost}.")
    return told


def raw_factors(document: Calibration, recording: Recording) -> tuple[float, float]:
    """Return what to multiply the recording's raw numbers with to get the calibration's raw units.

    Raises
    ------
    UsageError
        If one is in counts and the other is not, or the recording lacks what the calibration corrects.
    """
    force = 1.0
    if _knows(document.accelerometer):
        if recording.specific_force is None:
            raise UsageError("The recording has no accelerometer columns: there is nothing to correct.")
        force = _ratio(
            specific_force_factor(recording.specific_force_unit),
            specific_force_factor(document.raw_units.specific_force),
            "specific force",
            recording.specific_force_unit,
            document.raw_units.specific_force,
        )
    elif recording.angular_rate is None and not corrects_field(document, recording):
        raise UsageError(
            "The calibration is of the gyro alone, and the recording has no angular rate to correct."
        )
    if recording.angular_rate is None or not _knows(document.gyroscope):
        return force, 1.0
    return force, _ratio(
        angular_rate_factor(recording.angular_rate_unit),
        angular_rate_factor(document.raw_units.angular_rate),
        "angular rate",
        recording.angular_rate_unit,
        document.raw_units.angular_rate,
    )


def _knows(block: TriadBlock | None) -> bool:
    """Return whether a triad of the calibration can be corrected."""
    return block is not None and block.matrix is not None


def _ratio(ours: float | None, theirs: float | None, what: str, unit: str, wanted: str) -> float:
    if (ours is None) != (theirs is None):
        raise UsageError(
            f"The recording's {what} is in {unit}, but the calibration was made for {wanted}: "
            "declare the recording's units with --units, or use the calibration of this unit and format."
        )
    return 1.0 if ours is None or theirs is None else ours / theirs


def in_calibration_units(recording: Recording, factors: tuple[float, float]) -> Recording:
    """Return the recording with raw numbers in the calibration's units (the same object if they are)."""
    if factors == (1.0, 1.0):
        return recording
    force, rate = recording.specific_force, recording.angular_rate
    return replace(
        recording,
        specific_force=None if force is None else force * factors[0],
        angular_rate=None if rate is None else rate * factors[1],
    )


def corrected_block(corrector: Corrector, scaled: Recording, temperature: Series | float | None) -> Recording:
    """Return a block in m/s² and rad/s, in frame b.

    Parameters
    ----------
    corrector : that has corrected the blocks before.
    scaled : in the calibration's raw units.
    temperature : °C, of each sample or of all; None takes the block's own.
    """
    celsius = scaled.temperature if temperature is None else temperature
    force, rate = corrector.correct(scaled.specific_force, scaled.angular_rate, scaled.time, celsius)
    return replace(
        scaled,
        specific_force=None if force is None else np.ascontiguousarray(force),
        angular_rate=None if rate is None else np.ascontiguousarray(rate),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
    )


def _refuse_inputs(
    target: Path, files: Sequence[Path], calibration: str | os.PathLike[str] | Calibration
) -> None:
    """Refuse a place that is, or is inside of, what is read."""
    for path in files:
        within = (target, *target.parents) if path.is_dir() else (target,)
        if any(_same_file(place, path) for place in within):
            raise UsageError(f"{target} is the recording itself: give another file with -o.")
        own = euroc_file(path) if path.is_dir() else path
        if target.is_dir() and own is not None and _same_file(target / PLACE / "data.csv", own):
            raise UsageError(f"{target} holds the recording itself: give another folder with -o.")
    if not isinstance(calibration, Calibration) and _same_file(target, Path(calibration)):
        raise UsageError(f"{target} is the calibration itself: give another file with -o.")


def _same_file(one: Path, other: Path) -> bool:
    """Return whether both are one file, also by way of a link."""
    return one.exists() and other.exists() and one.samefile(other)


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


@dataclass
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
                task.calibration.corrector(task.outside),
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
        for batch in batches(self._messages(self._names)):
            made: dict[str, Iterator[bytes]] = {}
            for name in dict.fromkeys(n for n, _, _ in batch):
                line, own = self._lines[name], [m for m in batch if m[0] == name]
                corrected = self._corrected(line, decode(line.topic, own))
                made[name] = iter(self._put(line, [data for _, _, data in own], *corrected))
            yield [(n, data, next(made[n])) for n, _, data in batch]

    def _shifted(self, shift: ForceShift) -> Iterator[list[_Pair]]:
        """Yield batches whose specific force is of other instants; what cannot be answered yet waits."""
        (line,) = self._lines.values()
        waiting: list[bytes] = []

        def blocks() -> Iterator[Recording]:
            for batch in batches(self._messages(self._names)):
                decoded = decode(line.topic, batch)
                waiting.extend(data for _, _, data in batch)
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
        # A lag moves the stamps of an accelerometer with a topic of its own.
        moves = self._task.lag is not None and self._shift is None and line.force
        shift = -round(1e9 * (self._task.lag or 0.0)) if moves else 0
        return substituted(line.topic, messages, force, rate, shift)
