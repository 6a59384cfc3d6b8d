"""Many units: each calibrated by itself, then all of them as one table, and what only many of them tell.

A unit's result is written when it is there, whole, under ``units/NAME``, with a key of everything that it depends on:
whatever ends a run, the next one does only what is new. The tables are made of these results.

The table of a batch, a row a unit: for spreadsheets (CSV) and for data frames (Parquet).
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.counting import counted
from tumble.files import make_folder, read_json, read_text, results_folder, write_text, write_texts
from tumble.fleet import (
    ACCELEROMETER,
    FALSE_ALARM,
    GYRO,
    Batch,
    UnitOutcome,
    UnitVector,
    find_outlying,
    find_shared,
    loud_or_dead,
    stack,
)
from tumble.recording import write_table
from tumble.workflows.batches.executors import hands
from tumble.workflows.batches.unit import Job, UnitTask, calibrate_unit, check_request, failed, read_source
from tumble.workflows.request import CalibrateRequest, silent

if TYPE_CHECKING:
    from tumble.fleet import Batch


Cell = str | float | None
# What a spreadsheet would take for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def _columns_of(batch: Batch) -> dict[str, list[Cell]]:
    """The table by its heads: of each parameter with its unit in brackets, followed by its standard uncertainty."""
    units = batch.units
    columns: dict[str, list[Cell]] = {
        "unit": [one.unit for one in units],
        "files": [";".join(one.files) for one in units],
        "verdict": [one.verdict for one in units],
        "limits": [one.limits for one in units],
        "reasons": [" ".join(batch.reasons(one)) for one in units],
    }
    for name in dict.fromkeys(name for one in units for name in one.more):
        columns[name] = [one.more.get(name, "") for one in units]
    columns["temperature [degC]"] = [one.temperature for one in units]
    known = [{(name, unit): (value, sigma) for name, value, sigma, unit in one.parameters} for one in units]
    for name, unit in dict.fromkeys(key for one in known for key in one):
        pairs = [one.get((name, unit), (None, None)) for one in known]
        columns[f"{name} [{unit}]"] = [value for value, _ in pairs]
        columns[f"sigma of {name} [{unit}]"] = [sigma for _, sigma in pairs]
    return columns


def _csv_text(columns: dict[str, list[Cell]]) -> str:
    """The table as CSV; a text that a spreadsheet would run as a formula has an apostrophe in front."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in (columns, *zip(*columns.values(), strict=True)):
        writer.writerow([_written(cell) for cell in row])
    return text.getvalue()


def _written(cell: Cell) -> str:
    if isinstance(cell, str):
        return f"'{cell}" if cell.startswith(_FORMULA) else cell
    return "" if cell is None else repr(cell)


FORMAT, VERSION = "tumble batch unit", 1
UNITS = "units"


def run_batch(
    sources: str | Sequence[str],
    output: str | Path,
    asked: CalibrateRequest | None = None,
    *,
    reports: str = "failed",
    workers: int | None = None,
    scheduler: str | None = None,
    executor: Executor | None = None,
    progress: Callable[[str], None] | None = None,
) -> Batch:
    """Calibrate many units, and write a table of them.

    Parameters
    ----------
    sources : a folder, a pattern, a manifest, or recordings.
    output : folder for ``table.csv``, ``table.parquet``, ``table.html`` and ``units/NAME/calibration.json``.
    asked : of all units, where the manifest says nothing else.
    reports : of which units a report is written: "none", "failed" or "all".
    workers : processes; None for one a processor.
    scheduler : address of a Dask cluster that does the work instead.
    executor : any `concurrent.futures.Executor` instead; it is left open.
    progress : called with a sentence on what is being done.

    Raises
    ------
    UsageError
        If the source, a limit or an option is wrong; nothing is done then.
    OutputError
        If results cannot be written; what was there is intact.
    """
    say = progress or silent
    asked, folder = asked or CalibrateRequest(), Path(output)
    check_request(asked, reports)
    tasks = read_source([sources] if isinstance(sources, str) else list(sources))
    results_folder(folder)
    make_folder(folder / UNITS)
    if reports != "none":
        _write_library(folder)
    known = {task.unit: _lean(earlier) for task in tasks if (earlier := _earlier(folder, task)) is not None}
    done: dict[str, UnitOutcome] = {}
    kept = 0
    with _registry(asked.registry) as store, hands(workers, scheduler, executor) as crew:
        jobs = _jobs(tasks, known, folder, asked, reports)
        say(f"calibrating {len(tasks)} units")
        made = crew.run(calibrate_unit, jobs, lambda job, why: failed(job.task, f"It is lost: {why}."))
        for outcome in counted(made, len(tasks)):
            if outcome.unchanged:
                kept += 1
                document = read_text(folder / UNITS / outcome.unit / "calibration.json")
                store(replace(outcome, calibration=document))
                done[outcome.unit] = known[outcome.unit]
            elif outcome.verdict == "error" and not outcome.key and outcome.unit in known:
                outcome.reasons.append("The calibration of an earlier run is left as it is.")
                done[outcome.unit] = outcome
            else:
                _write_unit(folder, outcome)
                store(outcome)
                done[outcome.unit] = _lean(outcome)
            say(f"{len(done)} of {len(tasks)} units")
    say("the table")
    batch = _summarised([done[task.unit] for task in tasks])
    batch.worked, batch.kept = len(tasks) - kept, kept
    _write_tables(folder, batch)
    return batch


@contextmanager
def _registry(name: str | None) -> Generator[Callable[[UnitOutcome], None], None, None]:
    """Give what adds a unit's calibration to a registry, where there is one."""
    if name is None:
        yield lambda _: None
        return
    from tumble.document import calibration_of
    from tumble.registry import add
    from tumble.workflows.registry import registry_at

    with registry_at(name, make=True) as registry:

        def store(outcome: UnitOutcome) -> None:
            if outcome.calibration is not None:
                add(registry, calibration_of(outcome.calibration), unit=outcome.unit)

        yield store


def _jobs(
    tasks: Sequence[UnitTask],
    known: dict[str, UnitOutcome],
    folder: Path,
    asked: CalibrateRequest,
    reports: str,
) -> Iterator[Job]:
    asked = replace(asked, registry=None)  # whoever asks for the work adds what comes of it
    for task in tasks:
        earlier = known.get(task.unit)
        if earlier is not None:
            wanted = reports == "all" or (reports == "failed" and not earlier.accepted)
            if wanted and not (folder / UNITS / task.unit / "report.html").is_file():
                earlier = None
        yield Job(task, asked, reports, None if earlier is None else earlier.key)


def _earlier(folder: Path, task: UnitTask) -> UnitOutcome | None:
    """What an earlier run found of a unit, where it is whole."""
    place = folder / UNITS / task.unit
    try:
        document: Any = read_json(place / "unit.json")
        if document.pop("format") != FORMAT or document.pop("version") != VERSION:
            return None
        written = document.pop("calibration_sha256")
        if (told := document["vector"]) is not None:
            numbers = (np.array(told[name]) for name in ("values", "covariance"))
            document["vector"] = UnitVector(tuple(told["names"]), tuple(told["units"]), *numbers)
        outcome = UnitOutcome(**document)
        whole = outcome.verdict != "error" and written == _hash(read_text(place / "calibration.json"))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    return outcome if whole and outcome.key else None


def _lean(outcome: UnitOutcome) -> UnitOutcome:
    """What stays in memory of each of thousands of units."""
    return replace(outcome, calibration=None, report=None)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", errors="replace")).hexdigest()


def _write_unit(folder: Path, outcome: UnitOutcome) -> None:
    place = folder / UNITS / outcome.unit
    told = asdict(replace(outcome, calibration=None, report=None))
    for name in ("calibration", "report", "unchanged"):
        told.pop(name)
    told["calibration_sha256"] = _hash(outcome.calibration or "")
    # It says that the others are of this key; the first to be written is the last to take its place.
    text = json.dumps(
        {"format": FORMAT, "version": VERSION, **told}, ensure_ascii=False, default=np.ndarray.tolist
    )
    texts = {place / "unit.json": f"{text}\n"}
    if outcome.calibration is not None:
        texts[place / "calibration.json"] = outcome.calibration
    if outcome.report is not None:
        texts[place / "report.html"] = outcome.report
    for begun in place.glob(".*.part"):
        begun.unlink(missing_ok=True)  # of a run that was killed
    write_texts(texts)
    for name in ("calibration.json", "report.html"):
        if place / name not in texts:
            (place / name).unlink(missing_ok=True)  # of an earlier run, which this one contradicts


def _write_library(folder: Path) -> None:
    from tumble.report import LIBRARY, plotting_library

    text = plotting_library()
    place = folder / LIBRARY
    if not place.is_file() or place.stat().st_size != len(text.encode()):
        write_text(place, text)


def _summarised(units: list[UnitOutcome]) -> Batch:
    """Return units with what only many of them tell."""
    vectors = [unit.vector for unit in units]
    comparable = stack(vectors)
    said: dict[str, list[str]] = {}
    remarks: list[str] = []
    if comparable is not None:
        share = FALSE_ALARM / 2
        for one in find_outlying(comparable, share):
            said.setdefault(units[one.unit].unit, []).append(
                f"It stands out from the other units by {one.what}: {one.worst} is {one.sigmas:+.1f} of their standard "
                f"deviations off (a good unit is as far off with a probability of {one.chance:.1g})."
            )
        others = sum(vector is not None for vector in vectors) - len(comparable.which)
        if others:
            remarks.append(
                f"{others} of {len(units)} units were left out of the comparison: their parameters or raw units are "
                f"not those of the other {len(comparable.which)} (mixed units?)."
            )
    _say_noise(units, said)
    _say_same_files(units, said)
    bad = [not unit.accepted or unit.unit in said for unit in units]
    columns = sorted({name for unit in units for name in unit.more})
    shared = find_shared(bad, {name: [unit.more.get(name, "") for unit in units] for name in columns})
    return Batch(units, said, shared, remarks)


def _say_same_files(units: list[UnitOutcome], said: dict[str, list[str]]) -> None:
    seen: dict[tuple[str, ...], UnitOutcome] = {}
    for unit in units:
        key = tuple(unit.hashes)
        if key and key in seen:
            for one, other in ((seen[key], unit), (unit, seen[key])):
                words = (
                    f"It is probably the same unit as {other.unit}: their recordings have the same content."
                )
                said.setdefault(one.unit, []).append(words)
        elif key:
            seen[key] = unit


def _say_noise(units: list[UnitOutcome], said: dict[str, list[str]]) -> None:
    for triad in (ACCELEROMETER, GYRO):
        noise = [np.array(unit.noise[triad]) if triad in unit.noise else None for unit in units]
        for unit, channel, factor in loud_or_dead(noise, FALSE_ALARM / 4):
            name = f"{triad} {'xyz'[channel] if channel < 3 else channel}"
            words = (
                "has no noise at all: the channel is dead"
                if factor == 0.0
                else (f"has {factor:.2g} times the noise at rest of the other units")
            )
            said.setdefault(units[unit].unit, []).append(f"Its {name} {words}.")


def _write_tables(folder: Path, batch: Batch) -> None:
    from tumble.report import LIBRARY, batch_page, render_page

    columns = _columns_of(batch)
    _write_library(folder)
    page = render_page(batch_page(batch), None, LIBRARY)
    batch.files = write_texts({folder / "table.csv": _csv_text(columns), folder / "table.html": page})
    numbers = {head for head, column in columns.items() if not any(isinstance(cell, str) for cell in column)}
    write_table(folder / "table.parquet", columns, numbers)
    batch.files.insert(1, folder / "table.parquet")
