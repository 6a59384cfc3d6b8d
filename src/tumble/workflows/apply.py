"""Correcting a recording of any length with a calibration, block by block."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from tumble.arrays import Series
from tumble.document import Calibration, read_calibration
from tumble.document.corrector import Corrector
from tumble.document.result import TriadBlock
from tumble.errors import UsageError
from tumble.recording import Recording, read_blocks
from tumble.recording.corrections import PREFIX, corrections_of
from tumble.recording.formats.output import write_blocks
from tumble.recording.range_check import find_steps_of_two
from tumble.recording.temperature import TemperatureColumn
from tumble.units import angular_rate_factor, specific_force_factor
from tumble.workflows.temperature import (
    about_temperature,
    check_column,
    check_outside,
    check_temperature,
    needs_temperature,
    refuse_twice,
)


@dataclass(frozen=True, slots=True)
class Applied:
    """What `apply` wrote: the file, how many samples, and sentences for the user."""

    file: Path
    samples: int
    remarks: list[str]


def apply(
    calibration: str | os.PathLike[str] | Calibration,
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    output: str | os.PathLike[str] | None = None,
    columns: str | None = None,
    units: str | None = None,
    rate: float | str | None = None,
    topics: Sequence[str] | None = None,
    temperature: float | None = None,
    outside: str = "refuse",
    progress: Callable[[int], None] | None = None,
) -> Applied:
    """Correct a recording and write it as CSV or Parquet in m/s² and rad/s, frame b.

    Memory does not grow with the recording for text, Parquet and NPY. The file gets a column for each
    calibration that it went through, so that none is applied twice.

    Parameters
    ----------
    calibration : a ``calibration.json``, its folder, or a `Calibration`.
    paths, columns, units, rate, topics : the recording, as for `tumble.read_recording`.
    output : ``.csv`` or ``.parquet``; by default the recording's name with ``-corrected.csv``.
    temperature : °C of the whole recording, for a calibration with a thermal model and a recording without a
        column of temperature.
    outside : where the sensor's temperature leaves the span that was calibrated: ``refuse``, ``hold`` the
        parameters of the span's end, or ``extrapolate``.
    progress : is told the number of samples done.

    Raises
    ------
    CalibrationFileError, RecordingError, UsageError
        If an input is wrong, the recording is in other units than the calibration's, or is corrected already.
    ThermalSpanError
        If the temperature leaves the calibrated span and `outside` is ``refuse``.
    OutputError
        If the file cannot be written; an earlier one is intact.
    """
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    beyond = check_outside(outside)
    files = [Path(paths)] if isinstance(paths, str | os.PathLike) else [Path(path) for path in paths]
    done_before = corrections_of(files)
    refuse_twice(document, done_before)
    blocks = iter(read_blocks(paths, columns=columns, units=units, rate=rate, topics=topics))
    first = next(blocks)
    if needs_temperature(document):
        check_temperature(document, first, files, temperature, beyond)
    factors = raw_factors(document, first)
    remarks = [f"{r.kind}: {r.text}" for r in first.remarks if r.kind in ("assumed", "doubtful", "mended")]
    if not _knows(document.gyroscope):
        remarks.append("The calibration has no gyro matrix: the corrected file has no angular rate.")
    if not _knows(document.accelerometer):
        remarks.append(
            "The calibration has no accelerometer matrix: the corrected file has no specific force."
        )
    celsius = first.temperature if temperature is None else temperature
    remarks += find_steps_of_two(_corrected(Corrector(document, beyond), first, factors, celsius))
    target = _target(output, calibration, paths)

    done, column = 0, TemperatureColumn()
    told: list[str] = []
    corrector = Corrector(document, beyond)

    def corrected():
        nonlocal done
        for block in chain([first], blocks):
            celsius = block.temperature if temperature is None else temperature
            yield _corrected(corrector, block, factors, celsius)
            done += len(block)
            if block.temperature is not None and temperature is None:
                column.add(block.time, block.temperature)
            if progress is not None:
                progress(done)
        # Before the file takes its place: what cannot be is refused.
        if needs_temperature(document):
            told.extend(check_column(column))

    marks = [PREFIX + identity for identity in (*done_before, *(s.identity for s in document.stages))]
    write_blocks(corrected(), target, marks)
    span = (column.lowest, column.highest) if temperature is None else (temperature, temperature)
    remarks += [*told, *about_temperature(document, corrector, span)]
    return Applied(target, done, remarks)


def raw_factors(document: Calibration, recording: Recording) -> tuple[float, float]:
    """Return what to multiply the recording's raw numbers with to get the calibration's raw units.

    Raises
    ------
    UsageError
        If one is in counts and the other is not, or the recording lacks what the calibration corrects.
    """
    taken = document.stages[0]
    force = 1.0
    if _knows(taken.accelerometer):
        if recording.specific_force is None:
            raise UsageError("The recording has no accelerometer columns: there is nothing to correct.")
        force = _ratio(
            specific_force_factor(recording.specific_force_unit),
            specific_force_factor(taken.raw_units.specific_force),
            "specific force",
            recording.specific_force_unit,
            taken.raw_units.specific_force,
        )
    elif recording.angular_rate is None:
        raise UsageError(
            "The calibration is of the gyro alone, and the recording has no angular rate to correct."
        )
    if recording.angular_rate is None or not _knows(taken.gyroscope):
        return force, 1.0
    return force, _ratio(
        angular_rate_factor(recording.angular_rate_unit),
        angular_rate_factor(taken.raw_units.angular_rate),
        "angular rate",
        recording.angular_rate_unit,
        taken.raw_units.angular_rate,
    )


def _knows(block: TriadBlock | None) -> bool:
    """Tell whether a triad of the calibration can be corrected."""
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


def _corrected(
    corrector: Corrector, block: Recording, factors: tuple[float, float], temperature: Series | float | None
) -> Recording:
    scaled = in_calibration_units(block, factors)
    force, rate = corrector.correct(scaled.specific_force, scaled.angular_rate, scaled.time, temperature)
    return replace(
        block,
        specific_force=None if force is None else np.ascontiguousarray(force),
        angular_rate=None if rate is None else np.ascontiguousarray(rate),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
    )


def _target(
    output: str | os.PathLike[str] | None,
    calibration: str | os.PathLike[str] | Calibration,
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
) -> Path:
    named = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    target = Path(output) if output is not None else Path(f"{Path(named[0]).stem}-corrected.csv")
    if any(_same_file(target, Path(path)) for path in named):
        raise UsageError(f"{target} is the recording itself: give another file with -o.")
    if not isinstance(calibration, Calibration) and _same_file(target, Path(calibration)):
        raise UsageError(f"{target} is the calibration itself: give another file with -o.")
    return target


def _same_file(one: Path, other: Path) -> bool:
    """Tell whether both are one file, also by way of a link."""
    return one.exists() and other.exists() and one.samefile(other)
