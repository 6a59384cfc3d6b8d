"""From recordings of units that moved together to a calibration of each, and how they sit against one another."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.calibration.checks.unseen import state_unseen_clock
from tumble.calibration.procedures.joint import run_joint
from tumble.calibration.session import Options, Session
from tumble.counting import counted
from tumble.earth import Site
from tumble.errors import TumbleError, UsageError
from tumble.limits import read_limits, with_limits
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.workflows.calibrate import (
    CalibrationRun,
    about_gravity,
    corrected_by_before,
    read_as_told,
    read_prior,
    writable_folder,
    write_run,
)
from tumble.workflows.given.notes import Notes, notes_of
from tumble.workflows.given.site import given_site
from tumble.workflows.magnetometer import left_out_of
from tumble.workflows.procedures import add_objections, check_prior
from tumble.workflows.progress import silent
from tumble.workflows.several.joining import require_different_samples
from tumble.workflows.several.turn_ons import labels_of

if TYPE_CHECKING:
    from tumble.calibration import Estimate
    from tumble.calibration.arrays.estimate import ArrayEstimate
    from tumble.calibration.outcome.estimate import JointOutcome
    from tumble.calibration.prior import StableKnowledge
    from tumble.segmentation import Timeline

FORMAT, VERSION = "tumble array", 1
# Of a hold of the first unit, what the other units must rest of it at least; and of all holds.
SHARED_HOLD, SHARED_HOLDS = 0.5, 0.5
SHORTEST = 0.5  # s
COMPRESSED = (".gz", ".bz2", ".xz", ".zst", ".lz4")


@dataclass(slots=True)
class ArrayRun:
    """What `calibrate_array` made: a run of each unit, the array as a whole, and where the files are."""

    runs: list[CalibrationRun]
    array: ArrayEstimate
    document: dict[str, Any]
    files: list[Path] = field(default_factory=list[Path])


def calibrate_array(
    recordings: Sequence[str | os.PathLike[str]],
    *,
    output: str | os.PathLike[str] | None = None,
    site: Site | None = None,
    columns: str | None = None,
    units: str | None = None,
    rate: float | str | None = None,
    topics: Sequence[str] | None = None,
    optional_terms: bool = True,
    confirm_scale: bool = False,
    prior: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    notes: Notes = None,
    limits: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> ArrayRun:
    """Calibrate units that were tumbled together, fixed to one another, by the joint estimator.

    Parameters
    ----------
    recordings : two or more, one a unit, made at the same time and on one clock; a pair of files as
        ``acc.csv,gyro.csv``.
    output : folder for ``array.json`` and a folder with ``calibration.json`` and ``report.html`` of each unit; None
        writes nothing.
    site, columns, units, rate, topics, optional_terms, confirm_scale, notes, progress : as for `calibrate`, for all
        recordings.
    limits : file of acceptance limits, which each calibration is held against.
    prior : earlier calibrations of the units in their order, whose non-orthogonalities are kept, or one for all.

    Raises
    ------
    RecordingError, SegmentationError, ObservabilityError, ConvergenceError
        If a recording cannot serve; the message names it.
    UsageError, CalibrationFileError
        If they were not made together, or an option is wrong.
    OutputError
        If the results cannot be written.
    """
    say, noted = progress or silent, notes_of(notes)
    folder = writable_folder(output)
    if len(recordings) < 2:
        raise UsageError("--array takes the recordings of two units or more that were tumbled together.")
    acceptance = None if limits is None else read_limits(Path(limits))
    names = labels_of([str(r) for r in recordings])
    priors = _priors(prior, len(recordings))
    say("reading")
    read = [read_as_told(_files(text), None, columns, units, rate, topics)[0] for text in recordings]
    _check(names, read)
    place = given_site(site) or Site.unknown()
    sessions = _observed(names, read, place, say)
    for session, knowledge in zip(sessions, priors, strict=True):
        session.options = Options(optional_terms=optional_terms, confirm_scale=confirm_scale)
        session.prior = knowledge
    both = counted(zip(names, sessions, strict=True), len(names))
    settled = [_settle(name, session, say) for name, session in both]
    say("all units together")
    array = _together(names, settled, place)
    for session, estimate in zip(sessions, array.estimates, strict=True):
        state_unseen_clock(session.clock, estimate)
    if site is None:
        for estimate in array.estimates:
            estimate.say("remark", about_gravity(place))
    runs = [
        _run(session, estimate, text, len(names))
        for session, estimate, text in zip(sessions, array.estimates, recordings, strict=True)
    ]
    for run in runs:
        run.calibration = run.calibration.model_copy(update={"notes": noted})
    if acceptance is not None:
        for run in runs:
            run.calibration = with_limits(run.calibration, acceptance)
    done = ArrayRun(runs, array, _document(runs, array))
    if folder is not None:
        say("writing the reports")
        _write(done, folder)
    return done


def _priors(
    prior: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None, units: int
) -> list[StableKnowledge | None]:
    """What is known of each unit beforehand."""
    if prior is None:
        return [None] * units
    given = [prior] if isinstance(prior, str | os.PathLike) else list(prior)
    if len(given) not in (1, units):
        raise UsageError(
            f"--prior was given {len(given)} times for {units} units: give one for each, in the order of the "
            "recordings, or one for all."
        )
    known: list[StableKnowledge | None] = [read_prior(one) for one in given]
    return known if len(known) == units else known * units


def _files(text: str | os.PathLike[str]) -> list[str]:
    pair = str(text).split(",")
    return [str(text)] if Path(text).exists() or len(pair) != 2 else [part.strip() for part in pair]


def _check(names: Sequence[str], recordings: list[Recording]) -> None:
    for name, recording in zip(names, recordings, strict=True):
        if recording.specific_force is None or recording.angular_rate is None:
            raise UsageError(f"{name} lacks a triad: units of an array need accelerometers and gyros.")
    require_different_samples(recordings)


def _observed(
    names: Sequence[str], recordings: list[Recording], site: Site, say: Callable[[str], None]
) -> list[Session]:
    """Recordings with the holds that all units share, and turns that all can be followed over."""
    from tumble.segmentation import find_timeline

    say("finding holds and turns")
    found: list[Timeline] = []
    for name, recording in zip(names, recordings, strict=True):
        try:
            found.append(find_timeline(recording))
        except TumbleError as error:
            raise type(error)(f"{name}: {error}") from error
    common = _common_holds(names, recordings, found)
    timelines = [find_timeline(recording, intervals=common) for recording in recordings]
    lost = {turn.before for timeline in timelines for turn in timeline.turns if not turn.usable}
    reason = "another unit of the array cannot be followed over it"
    timelines = [
        replace(
            timeline,
            turns=tuple(
                replace(t, usable=False, reason=reason) if t.usable and t.before in lost else t
                for t in timeline.turns
            ),
        )
        for timeline in timelines
    ]
    made = [Session(recording, None, site) for recording in recordings]
    for session, timeline in zip(made, timelines, strict=True):
        session.timeline = timeline
    return made


def _common_holds(
    names: Sequence[str], recordings: Sequence[Recording], timelines: Sequence[Timeline]
) -> list[tuple[float, float]]:
    """Where all units rest, s on their common clock."""
    spans = [
        np.array([[r.time[h.start], r.time[h.stop - 1]] for h in timeline.holds])
        for r, timeline in zip(recordings, timelines, strict=True)
    ]
    common: list[tuple[float, float]] = []
    missed = dict.fromkeys(names[1:], 0)
    for start, stop in spans[0]:
        first, last, complete = start, stop, True
        for name, other in zip(names[1:], spans[1:], strict=True):
            overlap = np.minimum(other[:, 1], stop) - np.maximum(other[:, 0], start)
            best = int(np.argmax(overlap))
            if overlap[best] < max(SHORTEST, SHARED_HOLD * (stop - start)):
                missed[name] += 1
                complete = False
                continue
            first, last = max(first, other[best, 0]), min(last, other[best, 1])
        if complete and last - first >= SHORTEST:
            common.append((float(first), float(last)))
    if len(common) < max(SHARED_HOLDS * len(spans[0]), 1):
        worst = max(missed, key=lambda name: missed[name])
        raise UsageError(
            f"{worst} rests in {len(spans[0]) - missed[worst]} of the {len(spans[0])} holds of {names[0]}: units of an "
            "array are tumbled together and recorded on one clock."
        )
    return common


def _settle(name: str, session: Session, say: Callable[[str], None]) -> tuple[Estimate, JointOutcome]:
    """Adjust a unit by itself."""
    session.say = lambda words: say(f"{name}: {words}")
    kept: list[JointOutcome] = []
    try:
        estimate = run_joint(session, keep=kept.append, clocked=False)
    except TumbleError as error:
        raise type(error)(f"{name} cannot take part: {error}") from error
    if kept[0].untold is not None:
        raise UsageError(
            f"{name} cannot take part: its holds and turns do not determine the unit. "
            f"{kept[0].untold.sentences[0]}"
        )
    add_objections(session, estimate, "joint", "")
    if session.prior is not None:
        check_prior([session], session.prior, estimate)
    return estimate, kept[0]


def _together(
    names: Sequence[str], settled: Sequence[tuple[Estimate, JointOutcome]], site: Site
) -> ArrayEstimate:
    from tumble.calibration.arrays.adjustment import solve_array
    from tumble.calibration.arrays.estimate import array_estimate

    solution = solve_array(names, [kept for _, kept in settled])
    return array_estimate(solution, [estimate for estimate, _ in settled], site)


def _run(session: Session, estimate: Estimate, text: str | os.PathLike[str], count: int) -> CalibrationRun:
    from tumble.document import calibration_from_estimate

    reason = f"Procedure joint: {count} units of one array, whose poses are common, in one adjustment."
    remarks = (reason, *(remark.text for remark in session.recording.remarks))
    estimate.say("remark", *left_out_of([session.recording], "an array"))
    calibration = calibration_from_estimate(
        estimate,
        session.recording,
        session.site,
        remarks=remarks,
        confirm_scale=session.options.confirm_scale,
    )
    before = corrected_by_before(_files(text), None)
    if before:
        calibration = calibration.model_copy(update={"input_corrected_by": before})
    return CalibrationRun(calibration, estimate, session.recording, session.timeline, session.means, reason)


def _document(runs: Sequence[CalibrationRun], array: ArrayEstimate) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "units": [
            {
                "name": unit.name,
                "folder": folder,
                "identity": run.calibration.identity,
                "fit": run.calibration.verdict.fit,
                **({} if run.calibration.limits is None else {"limits": run.calibration.limits.decision}),
                "mounting": {
                    "matrix_to_first": unit.C_1b.tolist(),
                    "rotation_vector": unit.rotation.tolist(),
                    "standard_uncertainty": unit.sigma.tolist(),
                },
                "uncertainty_over_that_alone": unit.gain,
            }
            for unit, run, folder in zip(array.units, runs, _folders(array), strict=True)
        ],
        "rigid": array.is_rigid,
        "chi_square": array.chi_square,
        "degrees_of_freedom": array.degrees,
        "probability": array.probability,
    }


def _folders(array: ArrayEstimate) -> list[str]:
    """A folder's name for each unit: its recording's without the suffix, numbered where these are alike."""
    stems = [_stem(unit.name.split(",")[0]) for unit in array.units]
    parents = [Path(unit.name.split(",")[0]).parent.name for unit in array.units]
    if len(set(stems)) < len(stems) and all(parents) and len(set(parents)) == len(parents):
        return parents
    return stems if len(set(stems)) == len(stems) else [f"{stem}-{k}" for k, stem in enumerate(stems, 1)]


def _stem(name: str) -> str:
    """A file's name without its suffix, and without that of its compression."""
    path = Path(name)
    return Path(path.stem).stem if path.suffix.lower() in COMPRESSED else path.stem


def _write(done: ArrayRun, folder: Path) -> None:
    """Write each unit's folder, then the table of the array."""
    from tumble.files import write_text

    for run, name in zip(done.runs, _folders(done.array), strict=True):
        write_run(run, folder / name)
        done.files += run.files
    table = folder / "array.json"
    write_text(table, json.dumps(done.document, indent=1, ensure_ascii=False) + "\n")
    done.files.append(table)
