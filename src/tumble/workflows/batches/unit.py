"""One unit of a batch, from its files to its calibration: what a worker does, on whatever machine it runs.

The work is pure and can be done again: a task and the options in, texts out. Whoever asked for it writes the files.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tumble
from tumble.errors import (
    ConvergenceError,
    ObservabilityError,
    RecordingError,
    SegmentationError,
    TumbleError,
    UsageError,
)
from tumble.files import shown, without_password
from tumble.fleet.outcome import ACCELEROMETER, GYRO, UnitOutcome
from tumble.records import dataclass
from tumble.workflows.batches.source import UnitTask
from tumble.workflows.given.notes import USUAL, notes_of
from tumble.workflows.magnetometer import field_reasons

if TYPE_CHECKING:
    from tumble.workflows.calibrate import CalibrationRun

VERSION = 1
REPORTS = ("none", "failed", "all")
# What a recording is found to be. Any other error says nothing of it.
_OF_RECORDING = (RecordingError, SegmentationError, ObservabilityError, ConvergenceError)
_BLOCK = 1 << 20
LIBRARY = "../../plotly.min.js"
"""Where a unit's report finds the plotting library, which its folder shares."""


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """What holds for all units of a batch; the manifest goes before it.

    `reports` : "none", "failed" or "all".
    """

    protocol: str | None = None
    procedure: str | None = None
    site: str | None = None
    gravity: str | None = None
    columns: str | None = None
    units: str | None = None
    rate: float | str | None = None
    topics: tuple[str, ...] = ()
    prior: str | None = None
    limits: str | None = None
    notes: tuple[str, ...] = ()
    confirm_scale: bool = False
    reports: str = "failed"


@dataclass(frozen=True, slots=True)
class Job:
    """A unit, the options, and the key of the result that an earlier run left, None for none."""

    task: UnitTask
    options: BatchOptions
    known: str | None = None


def check_options(options: BatchOptions) -> None:
    """Refuse options of a whole batch that are wrong whatever its units are.

    Parameters
    ----------
    options : as given for all units.

    Raises
    ------
    UsageError, ProtocolError, CalibrationFileError
        If one of them is wrong; the sentence says which.
    """
    from tumble.calibration.procedure import find_procedure
    from tumble.limits import read_limits
    from tumble.recording.units import read_units_option
    from tumble.workflows.given.prior import find_sheet
    from tumble.workflows.given.protocols import read_given_protocol
    from tumble.workflows.given.site import choose_site

    if options.reports not in REPORTS:
        raise UsageError(f"--reports {options.reports}: give none, failed or all.")
    choose_site(options.site, options.gravity)
    checks: tuple[tuple[str | None, Callable[[str], object]], ...] = (
        (options.procedure, find_procedure),
        (options.protocol, read_given_protocol),
        (options.limits, lambda name: read_limits(Path(name))),
        (options.prior, find_sheet),
        (options.units, read_units_option),
    )
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
        key = _key(task, job.options)
        if job.known == key:
            return UnitOutcome(task.unit, list(task.files), key, "", unchanged=True)
        return _outcome(task, job.options, key)
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


def _key(task: UnitTask, options: BatchOptions) -> str:
    """Return what the result depends on as one hash: contents, options, and the version of tumble."""
    told: dict[str, Any] = {
        "version": [VERSION, tumble.__version__],
        "unit": task.unit,
        "more": task.more,
        "files": [[Path(name).name, _content_hash(Path(name))] for name in task.files],
    }
    named = {
        name: task.told.get(name) or getattr(options, name, None) for name in ("protocol", "prior", "noise")
    }
    named |= {"limits": options.limits, "intervals": task.told.get("intervals")}
    # Of a file the content counts, and neither where it lies nor which reports were asked for.
    hashed = {
        name: _content_hash(Path(value)) for name, value in named.items() if value and Path(value).exists()
    }
    told["named"] = hashed
    told["told"] = {key: value for key, value in task.told.items() if key not in hashed}
    told["options"] = {
        name: getattr(options, name) for name in options.__slots__ if name != "reports" and name not in hashed
    }
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def _content_hash(path: Path) -> str:
    """Return the SHA-256 of a file, or of all files in a folder with their names."""
    digest = hashlib.sha256()
    files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
    for one in files:
        if path.is_dir():
            digest.update(str(one.relative_to(path)).encode())
        with one.open("rb") as file:
            while block := file.read(_BLOCK):
                digest.update(block)
    return digest.hexdigest()


def _outcome(task: UnitTask, options: BatchOptions, key: str) -> UnitOutcome:
    from tumble.fleet import unit_vector
    from tumble.workflows.calibrate import report_of

    run = _calibrated(task, options)
    document = run.calibration
    given = task.told.get("temperature")
    if given and document.temperature_celsius is None:
        document = document.model_copy(update={"temperature_celsius": float(given)})
        run.calibration = document
    vector = unit_vector(document)
    made = UnitOutcome(
        task.unit,
        list(task.files) or [one.name for one in document.recordings],
        key,
        "fit" if document.verdict.fit else "not fit",
        limits="" if document.limits is None else document.limits.decision,
        reasons=[
            *([] if document.verdict.fit else document.verdict.reasons),
            *field_reasons(document),
            *([] if document.limits is None else document.limits.reasons),
        ],
        more=notes_of(options.notes) | task.more,
        temperature=document.temperature_celsius,
        parameters=[(p.name, p.value, p.standard_uncertainty, p.unit) for p in document.every_parameter],
        vector=None
        if vector is None
        else {
            "names": list(vector.names),
            "units": list(vector.units),
            "values": vector.values.tolist(),
            "covariance": vector.covariance.tolist(),
        },
        noise=_noise(run),
        hashes=[one.sha256 for one in document.recordings],
        calibration=document.to_json(),
    )
    if options.reports == "all" or (options.reports == "failed" and not made.accepted):
        made.report = report_of(run, LIBRARY)
    return made


def _noise(run: CalibrationRun) -> dict[str, list[float]]:
    floor = run.timeline.noise_floor
    found = {ACCELEROMETER: floor.specific_force.tolist()}
    if run.recording.angular_rate is not None:
        found[GYRO] = floor.angular_rate.tolist()
    return found


def _notes(task: UnitTask, options: BatchOptions) -> dict[str, str]:
    """What is noted of all units, and what the manifest says of this one."""
    own = {name: task.more[name] for name in USUAL if task.more.get(name, "").strip()}
    return notes_of(options.notes) | own


def _calibrated(task: UnitTask, options: BatchOptions) -> CalibrationRun:
    from tumble.workflows.calibrate import calibrate
    from tumble.workflows.given.site import choose_site

    told = task.told
    own_place = "site" in told or "gravity" in told
    place = choose_site(
        told.get("site") if own_place else options.site,
        told.get("gravity") if own_place else options.gravity,
    )
    topics = tuple(told["topic"].split(";")) if "topic" in told else options.topics
    return calibrate(
        list(task.files),
        protocol=told.get("protocol", options.protocol),
        procedure=told.get("procedure", options.procedure),
        site=place,
        columns=told.get("columns", options.columns),
        units=told.get("units", options.units),
        rate=told.get("rate", options.rate),
        topics=topics or None,
        prior=told.get("prior", options.prior),
        noise=told.get("noise"),
        intervals=told.get("intervals"),
        confirm_scale=options.confirm_scale,
        imu=(told.get("model"), task.unit),
        notes=_notes(task, options),
        limits=options.limits,
    )
