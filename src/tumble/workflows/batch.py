"""Many units: each calibrated by itself, then all of them as one table, and what only many of them tell.

A unit's result is written when it is there, whole, under ``units/NAME``, with a key of everything that it depends on:
whatever ends a run, the next one does only what is new. The tables are made of these results.

The table of a batch, a row a unit: for spreadsheets (CSV) and for data frames (Parquet).
"""

from __future__ import annotations

import csv
import glob
import hashlib
import io
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import asdict, field, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import structs

from tumble.counting import counted
from tumble.errors import (
    ConvergenceError,
    ObservabilityError,
    RecordingError,
    SegmentationError,
    TumbleError,
    UsageError,
    __version__,
)
from tumble.files import (
    HIDDEN,
    make_folder,
    number_of,
    read_json,
    read_text,
    reading,
    results_folder,
    shown,
    without_password,
    write_text,
    write_texts,
)
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
from tumble.records import dataclass
from tumble.sample_rates import stated_clock
from tumble.workflows.executors import hands
from tumble.workflows.given import choose_site, given_site
from tumble.workflows.request import OF_NO_BATCH, USUAL, CalibrateRequest, notes_of, option_of, refuse, silent

if TYPE_CHECKING:
    from tumble.workflows.results import CalibrationRun


MANIFEST = "manifest.csv"
"""In a folder it says what the units are."""
BY_UNIT = tuple(one.name for one in fields(CalibrateRequest) if (own := option_of(one)) and own.by_unit)
"""Fields of the request that a manifest may say unit by unit."""
# What a manifest may say of a unit; any other column is kept for the table.
TOLD = (*BY_UNIT, "topic", "site", "gravity", "temperature", "model")
KNOWN = ("unit", "files", *TOLD)
OUTCOME = ("verdict", "limits", "reasons")
_NO_RECORDING = {
    *(".yaml", ".yml", ".json", ".html", ".htm", ".md", ".pdf", ".png", ".svg", ".py", ".xml", ".log.txt"),
    *(".part", ".js", ".css"),
}
_PACKED = {".gz", ".bz2", ".xz", ".zst", ".zip"}
_NAME = re.compile(r"[\\/:*?\"<>|]")
_LONGEST = 120


@dataclass(frozen=True)
class UnitTask:
    """What is known of one unit before its calibration.

    Attributes
    ----------
    unit : its name, which is that of its folder.
    files : its recordings; of a pair of files both.
    told : of `TOLD`, what the manifest says.
    more : its other columns.
    missing : files that are not there.
    """

    unit: str
    files: tuple[str, ...]
    told: dict[str, str] = field(default_factory=dict[str, str])
    more: dict[str, str] = field(default_factory=dict[str, str])
    missing: tuple[str, ...] = ()


def read_source(sources: Sequence[str]) -> list[UnitTask]:
    """Return the units of a batch in their order.

    Parameters
    ----------
    sources : one folder, pattern or manifest, or the files that a shell made of a pattern.

    Raises
    ------
    UsageError
        If there is nothing, a manifest is wrong, or two units have one name; the sentence says which.
    """
    if not sources:
        raise UsageError("Name a folder, a pattern or a manifest: see `tumble batch --help`.")
    if len(sources) == 1:
        tasks = _of_one(sources[0])
    else:
        manifests = [one for one in sources if _is_manifest(Path(one))]
        if manifests:
            raise UsageError(
                f"{manifests[0]} is a manifest and was named with others: give one manifest, or recordings."
            )
        tasks = [_of_file(one) for one in sources]
    if not tasks:
        raise UsageError(f"{sources[0]} holds no recordings.")
    _refuse_twice(tasks)
    return tasks


def _of_one(source: str) -> list[UnitTask]:
    path = Path(source)
    if path.is_dir():
        inside = path / MANIFEST
        return _manifest(inside) if inside.is_file() else _folder(path)
    if path.exists():
        if _is_manifest(path):
            return _manifest(path)
        raise UsageError(
            f"{source} is no manifest: its first line names no columns `unit` and `files`. A batch is a folder, a "
            "pattern such as 'units/*.csv', or a manifest; one recording is calibrated by `tumble calibrate`."
        )
    if any(sign in source for sign in "*?["):
        found = sorted(glob.glob(source, recursive=True))
        if not found:
            raise UsageError(f"No file matches the pattern {source}.")
        return [_of_folder(Path(one)) if os.path.isdir(one) else _of_file(one) for one in found]
    if "://" in source:
        raise UsageError(
            f"{without_password(source)}: a batch is of files of this machine: copy them here, or mount their store."
        )
    raise UsageError(f"There is no folder, manifest or pattern {source}.")


def _folder(folder: Path) -> list[UnitTask]:
    tasks: list[UnitTask] = []
    for one in sorted(folder.iterdir()):
        if one.name.startswith((".", "_")):
            continue
        if one.is_dir():
            tasks += [_of_folder(one)] if any(one.iterdir()) else []
        elif _may_be_recording(one):
            tasks.append(_of_file(str(one)))
    return tasks


def _of_folder(folder: Path) -> UnitTask:
    """A folder of one unit: with its protocol, or a bag, or the recordings in it."""
    protocol = folder / "protocol.yaml"
    if protocol.is_file():
        return UnitTask(folder.name, (), {"protocol": str(protocol)})
    if (folder / "metadata.yaml").is_file():
        return UnitTask(folder.name, (str(folder),))
    inside = [one for one in sorted(folder.iterdir()) if one.is_file() and not one.name.startswith(".")]
    files = tuple(str(one) for one in inside if _may_be_recording(one))
    return UnitTask(folder.name, files or (str(folder),))


def _of_file(name: str) -> UnitTask:
    missing = () if Path(name).exists() else (name,)
    return UnitTask(unit_name(name), (name,), missing=missing)


def unit_name(file: str) -> str:
    """Return the name of a unit from its file's: without endings.

    Parameters
    ----------
    file : path of it.

    Examples
    --------
    >>> unit_name("line-3/unit.17.csv.gz")
    'unit.17'
    """
    name = Path(file)
    while name.suffix.lower() in _PACKED:
        name = name.with_suffix("")
    return name.stem


def _may_be_recording(path: Path) -> bool:
    return (
        not path.name.startswith(".") and path.suffix.lower() not in _NO_RECORDING and path.name != MANIFEST
    )


def _is_manifest(path: Path) -> bool:
    if path.suffix.lower() not in (".csv", ".tsv", ".txt") or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(4096)
    return _names_units(head.decode("utf-8-sig", errors="replace"))


def _names_units(text: str) -> bool:
    heads = [cell.strip().lower() for cell in re.split(r"[,;\t]", text.partition("\n")[0])]
    return "unit" in heads and ("files" in heads or "file" in heads or "protocol" in heads)


def _manifest(path: Path) -> list[UnitTask]:
    with reading(path, "a manifest"):
        text = read_text(path)
    if not _names_units(text):
        raise UsageError(f"The manifest {path} has no columns `unit` and `files` in its first line.")
    return _rows(text, str(path), path.parent)


def _rows(text: str, name: str, base: Path) -> list[UnitTask]:
    first = text.partition("\n")[0]
    separator = max(",;\t", key=first.count)
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=separator) if any(map(str.strip, row))]
    heads = [cell.strip().lower() for cell in rows[0]]
    heads = ["files" if head == "file" else "topic" if head == "topics" else head for head in heads]
    twice = [head for head, count in Counter(heads).items() if count > 1]
    if twice:
        raise UsageError(f"The manifest {name} has the column {twice[0]!r} twice.")
    for head in heads:
        _check_head(head, name)
    tasks = [
        _row(heads, row, f"{name}, line {number}", base, separator) for number, row in enumerate(rows[1:], 2)
    ]
    if not tasks:
        raise UsageError(f"The manifest {name} names no units.")
    return tasks


def _row(heads: list[str], row: list[str], where: str, base: Path, separator: str) -> UnitTask:
    if len(row) > len(heads):
        raise UsageError(
            f"{where}: it has {len(row)} cells and the first line {len(heads)}: put several files of a unit into one "
            "cell, apart by ;, and the cell into quotes."
        )
    cells = {head: cell.strip() for head, cell in zip(heads, row, strict=False)}
    unit = cells.pop("unit", "")
    if not unit:
        raise UsageError(f"{where}: the unit has no name.")
    _check_name(unit, where)
    apart = "|" if separator == ";" else ";"
    files = [one.strip() for one in cells.pop("files", "").split(apart) if one.strip()]
    told = {key: cells.pop(key) for key in TOLD if cells.get(key)}
    for key in ("rate", "gravity", "temperature"):
        _check_number(told, key, where)
    for key in ("protocol", "prior", "noise", "intervals"):
        if key in told and (any(sign in told[key] for sign in "./") or (base / told[key]).exists()):
            told[key] = _placed(told[key], base)
    if not files and "protocol" not in told:
        raise UsageError(f"{where}: unit {unit} has no files.")
    placed = tuple(_placed(one, base) for one in files)
    missing = tuple(one for one in placed if not Path(one).exists())
    return UnitTask(unit, placed, told, {k: v for k, v in cells.items() if k and k not in TOLD}, missing)


def _placed(name: str, base: Path) -> str:
    return str(Path(base) / name)


def _check_head(head: str, manifest: str) -> None:
    """Any column is kept for the table but those that the table has itself, and those that were meant to be known."""
    where = f"The manifest {manifest} has the column {shown(head)[:40]!r}"
    if head in OUTCOME:
        hint = "give limits for all units by --limits" if head == "limits" else "rename it"
        raise UsageError(f"{where}, which a batch's table has itself: {hint}.")
    meant = [] if head in KNOWN else get_close_matches(head, KNOWN, 1, 0.85)
    if meant:
        raise UsageError(f"{where}: is {meant[0]!r} meant? Else rename it.")


def _check_number(told: dict[str, str], key: str, where: str) -> None:
    if key in told and not (key == "rate" and stated_clock(told[key])):
        try:
            number_of(told[key] if key == "temperature" else told[key].replace("+-", "±").partition("±")[0])
        except ValueError as error:
            units = {"rate": "Hz", "gravity": "m/s²", "temperature": "°C"}[key]
            raise UsageError(f"{where}: {key}: {error}; give {units} without the unit.") from None


def _check_name(unit: str, where: str) -> None:
    if len(unit.encode()) > _LONGEST:
        raise UsageError(
            f"{where}: the unit's name {unit[:40]}… is longer than {_LONGEST} bytes, the most for a folder."
        )
    if _NAME.search(unit) or HIDDEN.search(unit) or unit[0] == ".":
        raise UsageError(
            f'{where}: {shown(unit)[:60]!r} is no name for a folder: leave out / \\ : * ? " < > | and a dot in front.'
        )


def _refuse_twice(tasks: Iterable[UnitTask]) -> None:
    # Where letters' case does not count, two such folders would be one.
    counted = Counter(task.unit.casefold() for task in tasks)
    twice = [name for name, count in counted.items() if count > 1]
    if twice:
        files = [
            task.files[0] if task.files else task.unit for task in tasks if task.unit.casefold() == twice[0]
        ]
        raise UsageError(
            f"{len(twice)} unit{'s have' if len(twice) > 1 else ' has'} a name that another has: {twice[0]} "
            f"({', '.join(files[:2])}); each unit needs its own, several recordings of one unit stand in one row."
        )


KEY_VERSION = 2
OF_FILES = ("protocol", "prior", "noise", "limits", "intervals")
REPORTS = ("none", "failed", "all")
# What a recording is found to be. Any other error says nothing of it.
_OF_RECORDING = (RecordingError, SegmentationError, ObservabilityError, ConvergenceError)
LIBRARY = "../../plotly.min.js"
"""Where a unit's report finds the plotting library, which its folder shares."""


@dataclass(frozen=True)
class Job:
    """A unit, what is asked of all units, and the key of the result that an earlier run left, None for none.

    The manifest goes before what is asked of all; `reports` : "none", "failed" or "all".
    """

    task: UnitTask
    asked: CalibrateRequest
    reports: str
    known: str | None = None


def check_request(asked: CalibrateRequest, reports: str) -> None:
    """Refuse what is wrong for a whole batch, whatever its units are.

    Parameters
    ----------
    asked, reports : for all units.

    Raises
    ------
    UsageError, ProtocolError, CalibrationFileError
        If one of them is wrong; the sentence says which.
    """
    from tumble.calibration import find_procedure
    from tumble.limits import read_limits
    from tumble.recording import read_units_option
    from tumble.workflows.given import find_sheet, read_given_protocol

    if reports not in REPORTS:
        raise UsageError(f"--reports {reports}: give none, failed or all.")
    refuse(asked, OF_NO_BATCH, "{} does not go with batches: leave it out.")
    notes_of(asked.notes)
    given_site(asked.site)
    checks: list[tuple[Any, Callable[[Any], object]]] = [
        (asked.procedure, find_procedure),
        (asked.protocol, read_given_protocol),
        (asked.limits, lambda name: read_limits(Path(name))),
        (asked.prior, find_sheet),
        (asked.units, read_units_option),
    ]
    for given, read in checks:
        if given is not None:
            read(given)


def failed(task: UnitTask, reason: str, key: str = "") -> UnitOutcome:
    """Return the outcome of a unit that gave no calibration.

    Parameters
    ----------
    task, reason : the unit, and a sentence.
    key : of its inputs where the recording is the reason; empty where a file or an option is.
    """
    files, reason = [without_password(one) for one in task.files], without_password(reason)
    return UnitOutcome(task.unit, files, key, "error", reasons=[reason], more=dict(task.more))


def calibrate_unit(job: Job) -> UnitOutcome:
    """Calibrate one unit; whatever goes wrong with it is its outcome, and no error.

    Parameters
    ----------
    job : unit and options.
    """
    task = job.task
    if task.missing:
        others = len(task.missing) - 1
        more = f", nor are {others} others of the unit" if others else ""
        return failed(task, f"There is no file {task.missing[0]}{more}.")
    key = ""
    try:
        key = _key(task, job.asked)
        if job.known == key:
            return UnitOutcome(task.unit, list(task.files), key, "", unchanged=True)
        return _outcome(job, key)
    except TumbleError as error:
        return failed(task, str(error), key if isinstance(error, _OF_RECORDING) else "")
    except MemoryError:
        return failed(task, "The recording does not fit into memory.")
    except OSError as error:
        return failed(task, f"{error.strerror or error} ({error.filename or task.unit}).")
    except Exception as error:  # noqa: BLE001 (one bad unit never stops the batch)
        words = shown(str(error))[:200]
        return failed(
            task, f"This is a fault of tumble, not of the recording: {type(error).__name__}: {words}."
        )


def _key(task: UnitTask, asked: CalibrateRequest) -> str:
    """Return what the result depends on as one hash: contents, options, and the version of tumble."""
    told: dict[str, Any] = {
        "version": [KEY_VERSION, __version__],
        "unit": task.unit,
        "more": task.more,
        "files": [[Path(name).name, _content_hash(Path(name))] for name in task.files],
    }
    named = {name: task.told.get(name) or getattr(asked, name) for name in OF_FILES}
    # Of a file the content counts, and not where it lies.
    hashed = {
        name: _content_hash(Path(value)) for name, value in named.items() if value and Path(value).exists()
    }
    told["named"] = hashed
    told["told"] = {key: value for key, value in task.told.items() if key not in hashed}
    told["options"] = {
        name: value
        for name, value in vars(asked).items()
        if name not in hashed and name not in ("paths", "registry")
    }
    return hashlib.sha256(json.dumps(told, sort_keys=True, default=repr).encode()).hexdigest()


def _content_hash(path: Path) -> str:
    """Return the SHA-256 of a file, or of all files in a folder with their names."""
    digest = hashlib.sha256()
    files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
    for one in files:
        if path.is_dir():
            digest.update(str(one.relative_to(path)).encode())
        with one.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def _outcome(job: Job, key: str) -> UnitOutcome:
    from tumble.fleet import unit_vector
    from tumble.workflows.calibrate import calibrate
    from tumble.workflows.results import report_of

    task = job.task
    run = calibrate(**vars(request_of(task, job.asked)))
    document = run.calibration
    given = task.told.get("temperature")
    if given and document.temperature_celsius is None:
        document = structs.replace(document, temperature_celsius=float(given))
        run.calibration = document
    made = UnitOutcome(
        task.unit,
        list(task.files) or [one.name for one in document.recordings],
        key,
        "fit" if document.verdict.fit else "not fit",
        limits="" if document.limits is None else document.limits.decision,
        reasons=[
            *([] if document.verdict.fit else document.verdict.reasons),
            *([] if document.magnetometer is None else document.magnetometer.reasons_against),
            *([] if document.limits is None else document.limits.reasons),
        ],
        more=notes_of(job.asked.notes) | task.more,
        temperature=document.temperature_celsius,
        parameters=[(p.name, p.value, p.standard_uncertainty, p.unit) for p in document.every_parameter],
        vector=unit_vector(document),
        noise=_noise(run),
        hashes=[one.sha256 for one in document.recordings],
        calibration=document.to_json(),
    )
    if job.reports == "all" or (job.reports == "failed" and not made.accepted):
        made.report = report_of(run, LIBRARY)
    return made


def _noise(run: CalibrationRun) -> dict[str, list[float]]:
    floor = run.timeline.noise_floor
    found = {ACCELEROMETER: floor.specific_force.tolist()}
    if run.recording.angular_rate is not None:
        found[GYRO] = floor.angular_rate.tolist()
    return found


def request_of(task: UnitTask, asked: CalibrateRequest) -> CalibrateRequest:
    """Return what is asked of one unit: of all, but for what the manifest says of it.

    Parameters
    ----------
    task, asked : the unit, and what is asked of all.
    """
    told: dict[str, Any] = {name: value for name, value in task.told.items() if name in BY_UNIT}
    if "topic" in task.told:
        told["topics"] = task.told["topic"].split(";")
    if "site" in task.told or "gravity" in task.told:
        told["site"] = choose_site(task.told.get("site"), task.told.get("gravity"))
    own = {name: task.more[name] for name in USUAL if task.more.get(name, "").strip()}
    told |= {"imu": (task.told.get("model"), task.unit), "notes": notes_of(asked.notes) | own}
    return replace(asked, paths=list(task.files), **told)


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
