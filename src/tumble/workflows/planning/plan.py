"""Planning a test before it is done: from what a user says to a plan, its protocol, its pages.

Of any protocol as it is. Of a test of poses these are searched first; what they are worth is then said as of any
protocol: there is one prediction, that of what `tumble calibrate` will state.
"""

from __future__ import annotations

import difflib
import json
import math
import os
from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.files import results_folder
from tumble.records import dataclass
from tumble.workflows.planning.searching import DEFAULTS, PoseSearch, check_search, search_poses
from tumble.workflows.request import PlanRequest

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.design.joint_information import JointInformation
    from tumble.design.joint_plan import JointPlan, PlanTask, StepWorth
    from tumble.design.next_step import NextStep, StepCandidate
    from tumble.design.planned_motion import PlannedNoise
    from tumble.protocol import Protocol
    from tumble.simulation import Grade, TriadNoise

# What a target may be of, the group of parameters that it means, its unit, and how many SI units that is.
_SECOND = math.pi / 648000.0
_TARGETS: dict[str, tuple[str, str, float]] = {
    "bias": ("accelerometer bias", "µg", 9.80665e-6),
    "scale": ("accelerometer scale", "ppm", 1e-6),
    "misalignment": ("accelerometer misalignment", "″", _SECOND),
    "gyro-bias": ("gyro bias", "°/h", _SECOND),
    "gyro-scale": ("gyro scale", "ppm", 1e-6),
    "gyro-misalignment": ("gyro misalignment", "″", _SECOND),
    "rotation": ("rotation between the triads", "″", _SECOND),
    "g-sensitivity": ("g-sensitivity", "(°/h)/g", _SECOND / 9.80665),
}


@dataclass(slots=True)
class Planned:
    """What `plan` found.

    Attributes
    ----------
    plan : the prediction.
    imu : name of the grade.
    search : the poses that were searched, beside the papers'; None for a protocol as it is.
    worths : of every step.
    following : steps that may be added.
    helping : what would tell each of the plan's weaknesses, or None.
    given, stop : sentences about what is there already and about targets, and whether to stop.
    remarks : what was assumed.
    files : what was written.
    """

    plan: JointPlan
    imu: str
    search: PoseSearch | None = None
    worths: list[StepWorth] = field(default_factory=list[Any])
    following: list[NextStep] = field(default_factory=list[Any])
    helping: list[tuple[StepCandidate, float] | None] = field(default_factory=list[Any])
    given: list[str] = field(default_factory=list[str])
    stop: bool = False
    remarks: list[str] = field(default_factory=list[str])
    files: list[Path] = field(default_factory=list[Path])


def plan(request: PlanRequest) -> Planned:
    """Foretell what a test determines of both triads, and say what would be better.

    Parameters
    ----------
    request : what is planned.

    Raises
    ------
    UsageError, ObservabilityError, ProtocolError, RecordingError, SegmentationError, CalibrationFileError
        If an option is wrong, a file cannot be read, or the poses that can be searched do not tell what is wanted.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.design.joint_plan import plan_protocol

    _check(request)
    progress = request.progress
    folder, limits = results_folder(request.output), _limits(request.targets)
    protocol = _asked_protocol(request)
    task, grade, remarks = _task(protocol, request)
    said, search = list[str](), None
    if request.given is not None:
        from tumble.workflows.planning.searching import read_given

        progress("reading what is there already")
        known, said = read_given(request.given, request.recorded, task)
        task = replace(task, known=known)
    if request.asked in DEFAULTS:
        search = search_poses(request, task, grade, progress)
        task = replace(task, protocol=search.protocol)
    task = replace(task, protocol=as_assumed(task, request.rate))
    done = Planned(plan_protocol(task, progress), grade.name, search, given=said, remarks=remarks)
    _advise(done, limits, progress, steps=request.steps)
    from tumble.workflows.planning.words import describe_plan, document_of

    done.remarks = [*describe_plan(done), *remarks, *_remarks(done)]
    if folder is not None:
        progress("writing")
        done.files = _write(folder, task.protocol, document_of(done))
    return done


def _check(request: PlanRequest) -> None:
    if request.seed < 0:
        raise UsageError(f"--seed {request.seed}: a seed is a whole number from 0 on.")
    if request.recorded is not None and request.given is None:
        raise UsageError(
            "--protocol says how --given was recorded: give --given RECORDING too, or leave it out."
        )
    if request.asked in DEFAULTS:
        check_search(request)


def _asked_protocol(request: PlanRequest) -> Protocol:
    """A named protocol or a file's; of one whose poses are yet to be searched the procedure alone."""
    from tumble.protocol import PROTOCOLS, HoldStep, TurnStep
    from tumble.protocol import Protocol as Steps
    from tumble.workflows.given.protocols import read_given_protocol

    asked = request.asked
    if request.asked in DEFAULTS:
        hold, turn, _ = DEFAULTS[asked]
        return Steps(f"{asked}-plan", asked, (HoldStep(request.hold or hold), TurnStep(request.turn or turn)))
    if asked in PROTOCOLS or Path(asked).exists():
        return read_given_protocol(asked).protocol
    names = [*DEFAULTS, *(name for name in PROTOCOLS if name not in DEFAULTS)]
    near = difflib.get_close_matches(asked.lower(), names, 1)
    meant = f" Did you mean {near[0]}?" if near else ""
    raise UsageError(
        f"There is no plan of {asked!r}: give a protocol file, or one of {', '.join(dict.fromkeys(names))}.{meant}"
    )


def as_assumed(task: PlanTask, rate: float | str | None) -> Protocol:
    """Return the protocol with what the plan takes for granted written into it: table, place, a rate that was stated.

    A rate that nobody stated is not written: a recording with another one would contradict it.

    Parameters
    ----------
    task : what is planned.
    rate : as it was given.
    """
    from tumble.protocol import SpinStep
    from tumble.sample_rates import sample_rate, stated_clock

    protocol, told = task.protocol, rate if stated_clock(rate) is None else None
    steps = tuple(
        replace(step, sigma=step.rate_sigma) if isinstance(step, SpinStep) else step
        for step in protocol.steps
    )
    return replace(
        protocol, steps=steps, site=task.site, rate=protocol.rate if told is None else sample_rate(told)
    )


def _limits(text: str | None) -> Series | None:
    """Return (30,) wished-for sigmas, SI, infinite where nothing is wished; None for no text."""
    from tumble.design.joint_information import GROUPS, PARAMETERS

    if text is None:
        return None
    limits = np.full(PARAMETERS, np.inf)
    for part in filter(str.strip, text.split(",")):
        name, _, number = (piece.strip() for piece in part.partition("="))
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if name not in _TARGETS or not (math.isfinite(value) and value > 0.0):
            units = ", ".join(f"{key} in {unit}" for key, (_, unit, _) in _TARGETS.items())
            raise UsageError(
                f"--targets {text}: write NAME=NUMBER with commas between, each positive: {units}."
            )
        group, _, size = _TARGETS[name]
        limits[GROUPS[group]] = value * size
    return limits


def _task(protocol: Protocol, request: PlanRequest) -> tuple[PlanTask, Grade, list[str]]:
    from tumble.design.joint_information import sizes_of_sheet
    from tumble.design.joint_plan import PlanTask
    from tumble.recording.stamps import clock_without_stamps
    from tumble.sample_rates import sample_rate, stated_clock
    from tumble.simulation.grades import find_grade
    from tumble.workflows.given.prior import find_sheet

    grade, place = find_grade(request.grade), request.site or protocol.site
    remarks = [f"Of {grade.name} no source states: {'; '.join(grade.assumed)}."] if grade.assumed else []
    if place is None:
        place = Site.from_latitude(math.radians(45.0), 0.0)
        remarks.append(
            "No site was given: latitude 45° at height 0 is assumed, and written into the "
            "protocol: give --site, or correct it there before anything is calibrated."
        )
    task = PlanTask.of_grade(protocol, grade, place, seed=request.seed)
    if request.data_sheet is not None:
        sheet = find_sheet(request.data_sheet)
        task = replace(task, sizes=sizes_of_sheet(sheet, grade), sheet=sheet)
        words = "are believed beforehand, as `tumble calibrate --prior` does."
        remarks.append(f"The spreads of {request.data_sheet} {words}")
    if request.noise is not None:
        noise, words = _noise_of(request.noise)
        task, remarks = replace(task, noise=noise), [*words, *(r for r in remarks if not r.startswith("Of "))]
    clock = stated_clock(request.rate)
    if clock is None:
        stated = protocol.rate if request.rate is None else sample_rate(request.rate)
        clock = clock_without_stamps(1.0 if stated is None else stated).sigma
    return replace(task, clock=clock), grade, remarks


def _noise_of(path: str | os.PathLike[str]) -> tuple[PlannedNoise, list[str]]:
    """The noise of a unit's own noise.json, the root mean square over its axes."""
    from tumble.design.planned_motion import PlannedNoise
    from tumble.workflows.noise import read_noise_models, triad_models

    models = read_noise_models(path)
    words = [f"The noise is that of {models.source}, the root mean square over each triad's axes."]
    triads: list[TriadNoise] = []
    for letter, unit in (("a", "m/s²"), ("g", "rad/s")):
        found = triad_models(models, letter, unit, 1.0, unit)
        triads.append(_triad(found))
        if any(model.gauss_markov or model.lines for model in found):
            words.append(
                "Its Gauss-Markov processes count as flicker of the same spread; lines are left out."
            )
    return PlannedNoise(triads[0], triads[1], models.rate), list(dict.fromkeys(words))


def _triad(models: list[Any]) -> TriadNoise:
    from tumble.noise.flicker import flicker_variance
    from tumble.simulation import TriadNoise

    def rms(values: list[float]) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    markov = [math.sqrt(sum(one.sigma**2 for one in model.gauss_markov)) for model in models]
    # One process of the ladder that flicker is simulated with has this variance over B².
    flicker = [
        math.hypot(m.bias_instability, g / math.sqrt(flicker_variance()))
        for m, g in zip(models, markov, strict=True)
    ]
    return TriadNoise(
        random_walk=rms([model.random_walk for model in models]),
        bias_instability=rms(flicker),
        rate_random_walk=rms([model.rate_random_walk for model in models]),
    )


def _advise(done: Planned, limits: Series | None, say: Callable[[str], None], *, steps: bool) -> None:
    """Find what each step is worth, what comes next, and what would tell what stays open."""
    from tumble.design.joint_plan import find_step_worths
    from tumble.design.next_step import find_next_steps, judge_stop, step_candidates, what_would_tell

    plan, task = done.plan, done.plan.task
    known, base = task.known, replace(task, known=None)
    if steps and not plan.weak and done.search is None and known is None:
        done.worths = find_step_worths(plan, say)
    if done.search is not None and known is None and limits is None and not plan.weak:
        return
    say("trying what may be added")
    candidates = step_candidates(task, table=task.has_table, span=plan.duration)
    start: JointInformation = plan.information if known is None else known
    done.following = find_next_steps(base, start, candidates)
    own = plan if known is None else None
    done.stop, words = judge_stop(base, start, done.following, limits, plan=own)
    if known is not None or limits is not None:
        done.given = [*done.given, *words]
    # What a plan of nothing recorded should do next is its own business, unless it misses its targets.
    done.stop = done.stop and known is not None
    everything = start if known is None else plan.information.plus(known)
    if plan.weak and not task.has_table:
        candidates = [*candidates, *step_candidates(task, table=True, span=plan.duration)[26:]]
    done.helping = [what_would_tell(base, everything, weak, candidates) for weak in plan.weak]


def of_clock(plan: JointPlan) -> str:
    """Return what the gyro scale factors owe to the sample rate, in sentences.

    Parameters
    ----------
    plan : a protocol's.
    """
    from tumble.recording.stamps import NOMINAL

    size, alone = f"{100.0 * plan.task.clock:.2g} %", ""
    scales = [one for one in plan.foretold if one.name.startswith("gyro scale")]
    if all(one.told for one in scales):
        ppm = 1e6 * float(np.sqrt(np.mean([one.without_clock**2 for one in scales])))
        alone = f" Without that they would be known to {two_digits(ppm)} ppm."
    if plan.task.clock != NOMINAL:
        return f"The sample rate is known to {size}, as stated, and all gyro scale factors share that.{alone}"
    return (
        f"The gyro scale factors share a nominal sample rate, uncertain by {size}.{alone} A simulation's clock is "
        "perfect: --rate 100±0 predicts what it will find. State your own as --rate 100±0.01, or record the times of a "
        "clock."
    )


def _remarks(done: Planned) -> list[str]:
    """What is taken for granted of clock, table and gravity."""
    task, words = done.plan.task, [of_clock(done.plan)]
    if task.has_table and (table := task.common[1]):
        good = f"The table's rates are taken to be right to {two_digits(1e6 * table)} ppm"
        words.append(f"{good} (`uncertainty_ppm` in the protocol).")
    if task.site.gravity_sigma > 0.0:
        good = f"Gravity is good to {two_digits(1e6 * task.site.gravity_sigma / task.site.gravity)} ppm"
        words.append(f"{good}, which all accelerometer scale factors share: --gravity says it better.")
    return words


def _write(folder: Path, protocol: Protocol, document: dict[str, Any]) -> list[Path]:
    """Write a plan's protocol, document and sheet beside their places, then rename them all; return the places."""
    from tumble.files import write_texts
    from tumble.protocol import protocol_to_yaml
    from tumble.report.operator_sheet import render_sheet

    texts = {
        "protocol.yaml": protocol_to_yaml(protocol),
        "plan.json": json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        "sheet.html": render_sheet(protocol, protocol.description or protocol.name),
    }
    return write_texts({folder / name: text for name, text in texts.items()})
