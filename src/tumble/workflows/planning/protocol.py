"""Planning any protocol as it is: what it is worth to both triads, step by step, its sheet and its document."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.files import results_folder
from tumble.records import dataclass
from tumble.workflows.planning.plan import (
    check_seed,
    find_protocol,
    finite,
    planned_grade,
    planned_place,
    read_targets,
    write_plan,
)
from tumble.workflows.planning.words import UNITS_OF_GROUPS, describe_plan
from tumble.workflows.progress import silent

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.design.joint_information import JointInformation
    from tumble.design.joint_plan import JointPlan, PlanTask
    from tumble.design.next_step import NextStep, StepCandidate
    from tumble.design.planned_motion import PlannedNoise
    from tumble.design.step_worth import StepWorth
    from tumble.protocol import Protocol
    from tumble.simulation import Grade, TriadNoise

_TARGETS = {
    "bias": "accelerometer bias",
    "scale": "accelerometer scale",
    "misalignment": "accelerometer misalignment",
    "gyro-bias": "gyro bias",
    "gyro-scale": "gyro scale",
    "gyro-misalignment": "gyro misalignment",
    "rotation": "rotation between the triads",
    "g-sensitivity": "g-sensitivity",
}
"""What a target may be of, and the group of parameters that it means."""


@dataclass(slots=True)
class ProtocolPlanned:
    """What `plan_any_protocol` found.

    Attributes
    ----------
    plan : the prediction.
    imu : name of the grade.
    worths : of every step.
    following : steps that may be added.
    helping : what would tell each of the plan's weaknesses, or None.
    given, stop : sentences about what was recorded already, and whether to stop.
    words : sentences for people.
    remarks : what was assumed.
    files : what was written.
    """

    plan: JointPlan
    imu: str
    worths: list[StepWorth] = field(default_factory=list[Any])
    following: list[NextStep] = field(default_factory=list[Any])
    helping: list[tuple[StepCandidate, float] | None] = field(default_factory=list[Any])
    given: list[str] = field(default_factory=list[str])
    stop: bool = False
    words: list[str] = field(default_factory=list[str])
    remarks: list[str] = field(default_factory=list[str])
    files: list[Path] = field(default_factory=list[Path])


def plan_any_protocol(
    asked: str,
    *,
    imu: str = "consumer-mems",
    data_sheet: str | None = None,
    noise: str | os.PathLike[str] | None = None,
    given: str | os.PathLike[str] | None = None,
    recorded: str | os.PathLike[str] | None = None,
    targets: str | None = None,
    site: Site | None = None,
    rate: str | None = None,
    seed: int = 0,
    steps: bool = True,
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] = silent,
) -> ProtocolPlanned:
    """Foretell what any protocol determines of both triads, and say what would be better.

    Parameters
    ----------
    asked : name of one of `tumble.protocol.PROTOCOLS`, or a protocol file.
    imu : grade of the unit.
    data_sheet : a grade whose spreads are believed beforehand.
    noise : noise.json of the unit, in place of the grade's noise.
    given : a recording of this unit, or its calibration, that is there already.
    recorded : the protocol that `given` was recorded with, for a table's angles.
    targets : wished-for standard uncertainties, see `_read_protocol_targets`.
    site : of the test; the protocol's own, or latitude 45°, without.
    rate : of the samples with its standard uncertainty, as 100±0.01; a nominal one without, as without stamps.
    seed : of placement and hands.
    steps : judge every step, too.
    output : folder for protocol, document and sheet; None writes nothing.
    progress : called with a sentence on what is being done.

    Raises
    ------
    UsageError, ProtocolError, RecordingError, SegmentationError, CalibrationFileError
        If an option is wrong, or a file cannot be read.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    check_seed(seed)
    if recorded is not None and given is None:
        raise UsageError(
            "--protocol says how --given was recorded: give --given RECORDING too, or leave it out."
        )
    folder = results_folder(output)
    protocol = find_protocol(asked)
    limits = _read_protocol_targets(targets)
    task, grade, remarks = _task(protocol, imu, data_sheet, noise, site, seed)
    task = replace(task, clock=_planned_clock(protocol, rate))
    from tumble.design.joint_plan import plan_protocol

    known, said = None, list[str]()
    if given is not None:
        from tumble.workflows.planning.given import read_given_information

        progress("calibrating what is there already")
        known, said = read_given_information(given, recorded, task)
        task = replace(task, known=known)
    plan = plan_protocol(task, progress)
    done = ProtocolPlanned(plan, grade.name, given=said, remarks=remarks)
    _advise(done, known, limits, progress, steps=steps)
    done.words = describe_plan(done)
    done.remarks += _remarks(done, site)
    if folder is not None:
        progress("writing")
        played = replace(protocol, site=task.site)
        title = protocol.description or protocol.name
        done.files = write_plan(folder, played, document_of_protocol(done), title)
    return done


def judge_protocol(
    protocol: Protocol,
    grade: Grade,
    place: Site,
    seed: int,
    say: Callable[[str], None],
    rate: str | None = None,
) -> ProtocolPlanned:
    """Foretell a protocol with a unit of a grade, without advice.

    Parameters
    ----------
    protocol, grade, place, seed, say, rate : as for `plan_any_protocol`, found already.
    """
    from tumble.design.joint_plan import PlanTask, plan_protocol

    task = PlanTask.of_grade(protocol, grade, place, seed=seed)
    return ProtocolPlanned(
        plan_protocol(replace(task, clock=_planned_clock(protocol, rate)), say), grade.name
    )


def _planned_clock(protocol: Protocol, rate: str | None) -> float:
    """Return what `calibrate` will take a recording's sample rate to be uncertain by, as a share."""
    from tumble.recording.stamps import clock_without_stamps
    from tumble.sample_rates import sample_rate, stated_clock

    if (share := stated_clock(rate)) is not None:
        return share
    stated = protocol.rate if rate is None else sample_rate(rate)
    return clock_without_stamps(1.0 if stated is None else stated).sigma


def _read_protocol_targets(text: str | None) -> Series | None:
    """Return (30,) wished-for sigmas, SI, infinite where nothing is wished; None for no text."""
    from tumble.design.joint_information import GROUPS, PARAMETERS

    if text is None:
        return None
    units = ", ".join(f"{key} in {UNITS_OF_GROUPS[group][0]}" for key, group in _TARGETS.items())
    sizes = {key: UNITS_OF_GROUPS[group][1] for key, group in _TARGETS.items()}
    refusal = f"write NAME=NUMBER with commas between, each positive: {units}."
    limits = np.full(PARAMETERS, np.inf)
    for name, value in read_targets(text, sizes, refusal).items():
        limits[GROUPS[_TARGETS[name]]] = value
    return limits


def _task(
    protocol: Protocol,
    imu: str,
    data_sheet: str | None,
    noise: str | os.PathLike[str] | None,
    site: Site | None,
    seed: int,
) -> tuple[PlanTask, Grade, list[str]]:
    from tumble.design.joint_information import parameter_sizes
    from tumble.design.joint_plan import PlanTask
    from tumble.simulation.grades import find_grade

    grade, remarks = planned_grade(imu)
    place, assumed = planned_place(site or protocol.site, "is assumed (--site).")
    remarks += assumed
    task = PlanTask.of_grade(protocol, grade, place, seed=seed)
    if data_sheet is not None:
        sheet = find_grade(data_sheet)
        task = replace(task, sizes=parameter_sizes(sheet), sheet=True)
        remarks.append(
            f"The spreads of {sheet.name} are believed beforehand, for every parameter that the test "
            "determines less well. `tumble calibrate` believes them for accelerometers alone "
            "(--procedure multi-position)."
        )
    if noise is not None:
        planned, words = _noise_of(noise)
        task = replace(task, noise=planned)
        remarks = [*words, *(r for r in remarks if not r.startswith("Of "))]
    return task, grade, remarks


def _noise_of(path: str | os.PathLike[str]) -> tuple[PlannedNoise, list[str]]:
    """The noise of a unit's own noise.json, the root mean square over its axes."""
    from tumble.design.planned_motion import PlannedNoise
    from tumble.workflows.given.noise_models import read_noise_models, triad_models

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


def _advise(
    done: ProtocolPlanned,
    known: JointInformation | None,
    limits: Series | None,
    say: Callable[[str], None],
    *,
    steps: bool,
) -> None:
    """Find what each step is worth, what comes next, and what would tell what stays open."""
    from tumble.design.next_step import find_next_steps, judge_stop, step_candidates, what_would_tell
    from tumble.design.step_worth import find_step_worths

    plan, task = done.plan, done.plan.task
    if steps and not plan.weak:
        done.worths = find_step_worths(plan, say)
    say("trying what may be added")
    candidates = step_candidates(task, table=task.has_table, span=plan.duration)
    start = plan.information if known is None else known
    base = replace(task, known=None)
    if known is not None:
        # A calibration states its own clock, and the next steps have the planned one.
        base = replace(base, clock=0.0)
        candidates = [
            replace(one, information=one.information.beside_clock(task.clock)) for one in candidates
        ]
    done.following = find_next_steps(base, start, candidates)
    foretold = plan.noise_sigmas if known is None else None
    done.stop, words = judge_stop(base, start, done.following, limits, foretold)
    if known is not None or limits is not None:
        done.given = [*done.given, *words]
    everything = start if known is None else plan.information.plus(known)
    if plan.weak and not task.has_table:
        candidates = [*candidates, *step_candidates(task, table=True, span=plan.duration)[len(candidates) :]]
    done.helping = [what_would_tell(base, everything, weak, candidates) for weak in plan.weak]
    if known is None:
        # What a plan of nothing recorded should do next is its own business, unless it misses its targets.
        done.stop = False


def of_clock(plan: JointPlan) -> str:
    """Return what the gyro scale factors owe to the sample rate, in sentences.

    Parameters
    ----------
    plan : a protocol's.
    """
    from tumble.calibration.verdict import two_digits
    from tumble.design.joint_information import GROUPS
    from tumble.recording.stamps import NOMINAL

    part, size = GROUPS["gyro scale"], f"{100.0 * plan.task.clock:.2g} %"
    alone = ""
    if np.all(plan.told[part]):
        ppm = 1e6 * float(np.sqrt(np.mean(plan.noise_sigmas[part] ** 2)))
        alone = f" Without that they would be known to {two_digits(ppm)} ppm."
    if plan.task.is_beyond_clock:
        return f"The sample rate is uncertain by {size}, and what is there already knows the gyro scale factors better."
    if plan.task.clock != NOMINAL:
        return f"The sample rate is known to {size}, as stated, and all gyro scale factors share that.{alone}"
    return (
        f"The gyro scale factors share a nominal sample rate, uncertain by {size}.{alone} A simulation's clock is "
        "perfect: --rate 100±0 predicts what it will find. State your own as --rate 100±0.01, or record the times of a "
        "clock."
    )


def _remarks(done: ProtocolPlanned, site: Site | None) -> list[str]:
    from tumble.calibration.procedure import find_procedure
    from tumble.protocol import SpinStep

    plan, task = done.plan, done.plan.task
    words: list[str] = []
    if site is not None and task.protocol.site is not None:
        words.append("--site goes before the protocol's own.")
    unread = sum(isinstance(s, SpinStep) and s.angle is None for s in task.protocol.steps)
    if unread:
        words.append(
            f"Of {unread} spins no angle is read off the table: counted is what the gyros carry across them, not the "
            "rate that the protocol states. Read the display at rest before and after each (angle_deg in the protocol)."
        )
    if find_procedure(task.protocol.procedure).believes_poses:
        words.append(
            "This predicts the joint estimator, which believes no pose and no rate. The procedure "
            f"{task.protocol.procedure} believes them, which determines more where they deserve it."
        )
    if not task.g_sensitivity:
        g = 648000.0 / math.pi * 9.80665 * float(np.sqrt(np.mean(plan.g_sigmas**2)))
        words.append(
            f"Units of {done.imu} are taken to have no g-sensitivity; were it estimated, it would be "
            f"known to {g:.2g} (°/h)/g."
        )
    words.append(of_clock(plan))
    if task.site.gravity_sigma > 0.0:
        ppm = 1e6 * task.site.gravity_sigma / task.site.gravity
        words.append(
            f"Gravity is good to {ppm:.2g} ppm, which all accelerometer scale factors share: --gravity says it better."
        )
    return words


def document_of_protocol(done: ProtocolPlanned) -> dict[str, Any]:
    """Return everything as plain data for a file, SI and one sigma.

    Parameters
    ----------
    done : what was planned.
    """
    plan, task = done.plan, done.plan.task
    return {
        "format": "tumble plan of a protocol",
        "version": 1,
        "protocol": task.protocol.name,
        "procedure": task.protocol.procedure,
        "imu": done.imu,
        "duration_s": plan.duration,
        "site": {"gravity": task.site.gravity, "gravity_standard_uncertainty": task.site.gravity_sigma},
        "parameters": joint_parameters(done),
        "not_told": [
            {
                "parameters": list(weak.parameters),
                "data_sheet_spreads": finite(weak.sigma),
                "told_by": None if helping is None else helping[0].name,
            }
            for weak, helping in zip(plan.weak, done.helping, strict=True)
        ],
        "steps": [
            {
                "step": worth.step + 1,
                "kind": worth.kind,
                "name": worth.name,
                "seconds": worth.seconds,
                "share_of_time": worth.share_of_time,
                "share_of_information": worth.share_of_information,
                "growth_without_it": worth.loss,
                "suffers_most": worth.most,
                "its_growth": worth.most_growth,
                "gain_if_a_quarter_longer": worth.longer,
            }
            for worth in done.worths
        ],
        "next": [
            {
                "do": one.candidate.name,
                "seconds": one.candidate.seconds,
                "gain": one.gain,
                "gains_most": one.most,
                "its_gain": one.most_gain,
                "not_told_after": one.open_left,
            }
            for one in done.following
        ],
        "given": done.given,
        "stop": done.stop,
        "words": done.words,
        "remarks": done.remarks,
    }


def joint_parameters(done: ProtocolPlanned) -> list[dict[str, Any]]:
    """Return every parameter with its predicted standard uncertainty as plain data, SI.

    Parameters
    ----------
    done : what was planned.
    """
    from tumble.design.joint_information import NAMES, UNITS

    plan = done.plan
    return [
        {
            "name": NAMES[i],
            "unit": UNITS[i],
            "told": bool(plan.told[i]),
            "standard_uncertainty": finite(float(plan.sigmas[i])) if plan.told[i] else None,
            "of_noise_alone": finite(float(plan.noise_sigmas[i])) if plan.told[i] else None,
            "largest_over_smallest_performance": finite(float(plan.spread[i])),
        }
        for i in map(int, plan.task.parameters())
    ]
