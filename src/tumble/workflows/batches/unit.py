"""One unit of a batch, from its files to its calibration: what a worker does, on whatever machine it runs.

The work is pure and can be done again: a task and the options in, texts out. Whoever asked for it writes the files.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import structs

from tumble.errors import (
    ConvergenceError,
    ObservabilityError,
    RecordingError,
    SegmentationError,
    TumbleError,
    UsageError,
    __version__,
)
from tumble.files import shown, without_password
from tumble.fleet.outcome import ACCELEROMETER, GYRO, UnitOutcome
from tumble.records import dataclass
from tumble.workflows.batches.source import BY_UNIT, UnitTask
from tumble.workflows.given.site import choose_site, given_site
from tumble.workflows.request import OF_NO_BATCH, USUAL, CalibrateRequest, notes_of, refuse

if TYPE_CHECKING:
    from tumble.workflows.results import CalibrationRun

VERSION = 2
OF_FILES = ("protocol", "prior", "noise", "limits", "intervals")
REPORTS = ("none", "failed", "all")
# What a recording is found to be. Any other error says nothing of it.
_OF_RECORDING = (RecordingError, SegmentationError, ObservabilityError, ConvergenceError)
LIBRARY = "../../plotly.min.js"
"""Where a unit's report finds the plotting library, which its folder shares."""


@dataclass(frozen=True, slots=True)
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
    from tumble.calibration.procedure import find_procedure
    from tumble.limits import read_limits
    from tumble.recording.units import read_units_option
    from tumble.workflows.given.prior import find_sheet
    from tumble.workflows.given.protocols import read_given_protocol

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
        "version": [VERSION, __version__],
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
