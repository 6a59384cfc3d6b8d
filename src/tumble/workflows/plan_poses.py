"""Planning a test of poses: from what a user says to a plan, its protocol, its pages."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.workflows.pose_reach import choose_reach, read_known

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.design.next_pose import NextPose
    from tumble.design.pose_plan import PosePlan, PoseTask, Reach
    from tumble.protocol import Protocol
    from tumble.simulation import Grade
    from tumble.workflows.joint_plan import JointPlanned

PROCEDURES = ("multi-position", "hand-held", "six-position")
"""Procedures whose poses can be planned."""

FILES = ("protocol.yaml", "plan.json", "plan.html", "sheet.html")
_DEFAULT_LATITUDE_DEG = 45.0
_SECOND = math.pi / 648000.0
_MICRO_G = 9.80665e-6
_DEGREE = math.pi / 180.0
BY_HAND, LEVELLED = 5.0 * _DEGREE, 0.5 * _DEGREE
# Seconds of a pose and of a turn, and the fewest poses that are planned without being asked.
DEFAULTS = {"multi-position": (30.0, 3.0, 9), "hand-held": (4.0, 2.0, 26), "six-position": (30.0, 3.0, 6)}
MOST_POSES = 200
# Practical unit and its size in the unit of `PARAMETERS` (relative, rad, over gravity), by group.
UNITS = {"scale": ("ppm", 1e-6), "misalignment": ("″", _SECOND), "bias": ("µg", 1e-6)}


@dataclass(frozen=True, slots=True)
class Predicted:
    """A parameter with its predicted standard uncertainty, SI: of the noise alone, and with gravity's."""

    name: str
    group: str
    noise: float
    total: float
    unit: str


@dataclass(slots=True)
class PosesPlanned:
    """What `plan_pose_test` found.

    Attributes
    ----------
    procedure, grade, place : what was planned, with what, where.
    task, plan : the design room's.
    predicted : parameter by parameter.
    schemes : the papers', in the same time, or in words why not.
    protocol : the plan to do.
    given : sentences about what was recorded already; `following` the poses to record next, `stop` whether to.
    remarks : what was assumed.
    files : what was written.
    joint : of a hand-held test, what holds and turns together tell of both triads.
    """

    procedure: str
    grade: Grade
    place: Site
    task: PoseTask
    reach: Reach
    plan: PosePlan
    predicted: list[Predicted]
    schemes: dict[str, PosePlan | str]
    protocol: Protocol
    given: list[str] = field(default_factory=list[str])
    following: list[NextPose] = field(default_factory=list[Any])
    sigmas_given: Series | None = None
    stop: bool = False
    remarks: list[str] = field(default_factory=list[str])
    files: list[Path] = field(default_factory=list[Path])
    joint: JointPlanned | None = None


def plan_pose_test(
    procedure: str,
    *,
    imu: str = "consumer-mems",
    data_sheet: str | None = None,
    accelerometer_noise_ug: float | None = None,
    poses: int | None = None,
    minutes: float | None = None,
    hold: float | None = None,
    turn: float | None = None,
    criterion: str = "A",
    wanted: str | None = None,
    reach: str = "26",
    outer: str | None = None,
    inner: str | None = None,
    given: str | os.PathLike[str] | None = None,
    targets: str | None = None,
    placement: float | None = None,
    site: Site | None = None,
    seed: int = 0,
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> PosesPlanned:
    """Find the best poses for a test, and say what they will be worth.

    Parameters
    ----------
    procedure : one of `PROCEDURES`.
    imu : grade of the unit; `accelerometer_noise_ug` stands for its density in µg/√Hz.
    data_sheet : a grade whose spreads are believed beforehand, as `calibrate --data-sheet` does.
    poses, minutes : how many poses of `hold` seconds each, or how long the whole test may last with as many poses and
        dwells as is best; by default nine poses.
    hold, turn : s of a pose, and of the turn to the next.
    criterion : one of `tumble.design.criteria.CRITERIA`.
    wanted : parameters that matter, by group or name, with commas; None for all.
    reach : "26", "sphere", "two-axis" or a file of poses.
    outer, inner : of "two-axis", MIN,MAX,STEP in degrees.
    given : a calibration, or a recording of this unit, that is there already.
    targets : wished-for standard uncertainties, as "bias=50,scale=100,misalignment=20" in µg, ppm and arc-seconds.
    placement : rad, of the faces on their plate, for six-position.
    site : gravity; latitude 45° by default.
    seed : of the search's starts.
    output : folder for protocol, plan and sheets; None writes nothing.
    progress : is told what is being done.

    Raises
    ------
    UsageError, ObservabilityError, ProtocolError, CalibrationFileError, RecordingError
        If an option is wrong, or the poses that can be reached do not tell what is wanted.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    say = progress or _silent
    folder = None if output is None else _folder(output)
    _check(poses, minutes, hold, turn, seed)
    from tumble.design.pose_plan import PoseTask, plan_schemes

    grade, remarks = _grade(imu, accelerometer_noise_ug)
    place = site or Site.from_latitude(math.radians(_DEFAULT_LATITUDE_DEG))
    if site is None:
        remarks.append(
            f"No site was given: latitude {_DEFAULT_LATITUDE_DEG:g}° at height 0 is assumed, and written into the "
            "protocol: give --site, or correct it there before anything is calibrated."
        )
    names, wished = _criterion(procedure, criterion, wanted), read_targets(targets)
    task = PoseTask(
        grade.accelerometer.noise,
        names,
        grade.rate,
        DEFAULTS[procedure][1] if turn is None else turn,
        place.gravity,
        _sheet(data_sheet, place.gravity),
        *_placed(procedure, placement, grade),
    )
    hold = DEFAULTS[procedure][0] if hold is None and minutes is None else hold
    chosen = _faces() if procedure == "six-position" else choose_reach(reach, outer, inner)
    said: list[str] = []
    following: list[Any] = []
    stop, so_far = False, None
    if given is not None:
        say("reading what is there already")
        task, said, following, stop, so_far = _with_given(
            task, chosen, given, hold or DEFAULTS[procedure][0], wished
        )
    say("searching")
    rng = np.random.default_rng(seed)
    plan = _search(procedure, task, chosen, poses, minutes, hold, rng, say)
    say("comparing")
    schemes = plan_schemes(replace(task, placement=0.0, shortening=0.0), plan.duration)
    if procedure == "six-position":
        del schemes["six faces"]
    done = PosesPlanned(
        procedure,
        grade,
        place,
        task,
        chosen,
        plan,
        predict(plan, place),
        schemes,
        _protocol(procedure, plan, place, placement),
        said,
        following,
        so_far,
        stop,
        [
            *remarks,
            *_about_turns(procedure),
            *_about_wander(task, plan),
            *_about_gravity(place),
            *_unmet(plan, place, wished),
        ],
    )
    if procedure == "hand-held" and given is None:
        from tumble.workflows.joint_plan import judge_protocol

        say("holds and turns together")
        done.joint = judge_protocol(done.protocol, grade, place, seed, say)
    if folder is not None:
        say("writing")
        done.files = _write(done, folder)
    return done


def predict(plan: PosePlan, place: Site) -> list[Predicted]:
    """Return every parameter's predicted standard uncertainty, without those that the plan does not tell.

    Parameters
    ----------
    plan, place : with gravity's uncertainty, which every scale factor shares.
    """
    from tumble.design.candidates import GROUPS, PARAMETERS

    relative = place.gravity_sigma / place.gravity
    found: list[Predicted] = []
    for group, members in GROUPS.items():
        for index in members:
            noise = float(plan.sigmas[index])
            if noise > 0.3:
                continue
            total = math.hypot(noise, relative) if group == "scale" else noise
            size = place.gravity if group == "bias" else 1.0
            unit = {"scale": "1", "misalignment": "rad", "bias": "m/s²"}[group]
            found.append(Predicted(PARAMETERS[index], group, noise * size, total * size, unit))
    return found


def group_means(plan: PosePlan) -> dict[str, float]:
    """Return the root mean square sigma by group, noise alone, in the practical units of `UNITS`; nan if not told.

    Parameters
    ----------
    plan : of a scheme.
    """
    from tumble.design.candidates import GROUPS

    means: dict[str, float] = {}
    for group, members in GROUPS.items():
        sigma = float(np.sqrt(np.mean(plan.sigmas[list(members)] ** 2)))
        means[group] = sigma / UNITS[group][1] if sigma < 0.3 else math.nan
    return means


def read_targets(text: str | None) -> dict[str, float]:
    """Return wished-for sigmas by group, SI, of "bias=50,scale=100,misalignment=20" in µg, ppm, arc-seconds.

    Parameters
    ----------
    text : as the user wrote it, or None.

    Raises
    ------
    UsageError
        If it cannot be read.
    """
    found: dict[str, float] = {}
    sizes = {"bias": _MICRO_G, "scale": 1e-6, "misalignment": _SECOND}
    for part in (text or "").split(","):
        if not part.strip():
            continue
        name, _, number = (piece.strip() for piece in part.partition("="))
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if name not in sizes or not (math.isfinite(value) and value > 0.0):
            raise UsageError(
                f"--targets {text}: write bias=50,scale=100,misalignment=20 or some of them, in µg, ppm and "
                "arc-seconds, each positive."
            )
        found[name] = value * sizes[name]
    return found


def document_of(done: PosesPlanned) -> dict[str, Any]:
    """Return everything as plain data for a file, SI and one sigma.

    Parameters
    ----------
    done : what was planned.
    """
    from tumble.workflows.joint_plan import joint_parameters

    plan = done.plan

    def scheme(one: PosePlan | str) -> dict[str, Any]:
        if isinstance(one, str):
            return {"not_possible": one}
        return {"poses": len(one.dwells), "dwell_s": float(one.dwells[0]), "rms": _finite(group_means(one))}

    return {
        "format": "tumble plan",
        "version": 1,
        "procedure": done.procedure,
        "imu": done.grade.name,
        "criterion": done.task.criterion.name,
        "reach": done.reach.words,
        "duration_s": plan.duration,
        "efficiency": plan.efficiency,
        "gravity": {"value": done.place.gravity, "standard_uncertainty": done.place.gravity_sigma},
        "poses": [
            {"up": [float(v) for v in up], "seconds": float(dwell), "name": name}
            for up, dwell, name in zip(plan.directions, plan.dwells, pose_names(plan), strict=True)
        ],
        "parameters": [
            {
                "name": one.name,
                "unit": one.unit,
                "standard_uncertainty": one.total,
                "of_noise_alone": one.noise,
            }
            for one in done.predicted
        ],
        "units_of_rms": {group: unit for group, (unit, _) in UNITS.items()},
        "plan_rms": _finite(group_means(plan)),
        "schemes": {name: scheme(one) for name, one in done.schemes.items()},
        "given": done.given,
        "both_triads": None if done.joint is None else joint_parameters(done.joint),
        "stop": done.stop,
        "next": [
            {"up": [float(v) for v in one.up_b], "name": one.name, "criterion_gain": one.gain}
            for one in done.following
        ],
        "remarks": done.remarks,
    }


def pose_names(plan: PosePlan) -> list[str]:
    """Return a name for each pose: the fixture's, or the nearest face, edge or corner.

    Parameters
    ----------
    plan : with names, or without.
    """
    from tumble.attitude.directions import twenty_six_directions
    from tumble.calibration.poses import describe_direction

    if plan.names:
        return list(plan.names)
    near = np.max(plan.directions @ twenty_six_directions().T, axis=1)
    words = [describe_direction(up) for up in plan.directions]
    return [
        word if cosine > 1.0 - 1e-9 else f"{math.degrees(math.acos(min(cosine, 1.0))):.0f}° from {word}"
        for word, cosine in zip(words, near.tolist(), strict=True)
    ]


def _search(
    procedure: str,
    task: PoseTask,
    reach: Reach,
    poses: int | None,
    minutes: float | None,
    hold: float | None,
    rng: np.random.Generator,
    say: Callable[[str], None],
) -> PosePlan:
    from tumble.design.pose_plan import best_order, plan_of, plan_poses, plan_time

    if procedure == "six-position":
        if poses not in (None, 6):
            raise UsageError(f"--poses {poses}: a six-position test has its six faces.")
        dwell = (
            (60.0 * minutes + task.turn) / 6 - task.turn
            if minutes is not None
            else hold or DEFAULTS[procedure][0]
        )
        if dwell < 1.0:
            raise UsageError(
                f"--time {minutes:g}: that leaves no time for six poses and the turns between them."
            )
        ordered = reach.directions[best_order(task, reach.directions, dwell)]
        return plan_of("six faces", task, ordered, np.full(6, dwell))
    if minutes is not None:
        return plan_time(task, reach, 60.0 * minutes, rng, say)
    count = poses if poses is not None else DEFAULTS[procedure][2]
    return plan_poses(task, reach, count, hold or DEFAULTS[procedure][0], rng)


def _with_given(
    task: PoseTask,
    reach: Reach,
    given: str | os.PathLike[str],
    dwell: float,
    targets: dict[str, float],
) -> tuple[PoseTask, list[str], list[NextPose], bool, Series]:
    """What is there already, which poses come next, and whether to stop."""
    from tumble.design.next_pose import find_next_poses, judge_stop, sigmas_so_far

    known, words = read_known(given)
    if task.known is not None:
        known = known + task.known
    sigma = task.dwell_sigma(dwell, 10.0 * dwell)
    following = find_next_poses(known, reach, sigma, task.criterion)
    so_far = sigmas_so_far(known)
    stop, said = judge_stop(so_far, following, targets, task.noise, task.gravity, task.criterion.wanted)
    return replace(task, known=known), [*words, *said], following, stop, so_far


def _criterion(procedure: str, name: str, wanted: str | None) -> Any:
    from tumble.design.candidates import GROUPS, PARAMETERS
    from tumble.design.criteria import CRITERIA
    from tumble.design.pose_plan import criterion_of

    known = {one.lower(): one for one in CRITERIA}
    if name.lower() not in known:
        raise UsageError(f"--criterion {name}: choose one of {', '.join(CRITERIA)}.")
    chosen: list[int] = []
    for part in (wanted or "").split(","):
        word = " ".join(part.split())
        if not word:
            continue
        if word in GROUPS:
            chosen += GROUPS[word]
        elif word in PARAMETERS:
            chosen.append(PARAMETERS.index(word))
        else:
            raise UsageError(
                f"--for {word}: choose of scale, misalignment, bias, or one of them such as {PARAMETERS[0]!r}, "
                f"{PARAMETERS[3]!r}, {PARAMETERS[6]!r}, with commas between them."
            )
    if procedure == "six-position":
        levelled = [*GROUPS["scale"], *GROUPS["bias"]]
        if set(chosen) - set(levelled):
            raise UsageError("--for misalignment: a six-position test tells scale factors and biases alone.")
        chosen = chosen or levelled
    return criterion_of(known[name.lower()], np.array(sorted(set(chosen))) if chosen else None)


def _faces() -> Reach:
    from tumble.attitude.directions import twenty_six_directions
    from tumble.design.pose_plan import Reach

    return Reach("the six faces", twenty_six_directions()[[0, 5, 1, 4, 2, 3]])


def _grade(imu: str, noise_ug: float | None) -> tuple[Grade, list[str]]:
    from tumble.simulation.grades import find_grade

    grade = find_grade(imu)
    remarks = [f"Of {grade.name} no source states: {'; '.join(grade.assumed)}."] if grade.assumed else []
    if noise_ug is None:
        return grade, remarks
    if not 0.0 < noise_ug < 1e6:
        raise UsageError(f"--accelerometer-noise-ug {noise_ug:g}: give a positive number.")
    triad = grade.accelerometer
    noise = replace(triad.noise, random_walk=_MICRO_G / math.sqrt(2.0) * noise_ug)
    return replace(grade, accelerometer=replace(triad, noise=noise)), remarks


def _sheet(name: str | None, gravity: float) -> Any:
    """The information of a data sheet's spreads."""
    if name is None:
        return None
    from tumble.simulation.grades import find_grade

    spread = find_grade(name).accelerometer
    sigmas = (
        [spread.scale_factor] * 3 + [math.sqrt(2.0) * spread.misalignment] * 3 + [spread.bias / gravity] * 3
    )
    return np.diag(1.0 / np.array(sigmas) ** 2)


def _placed(procedure: str, placement: float | None, grade: Grade) -> tuple[float, float]:
    """What levelling adds to a face's own reading (its square, and its product with misalignment), and its mean."""
    if procedure != "six-position":
        return 0.0, 0.0
    tilt = LEVELLED if placement is None else placement
    if not 0.0 <= tilt <= 0.2:
        raise UsageError(f"--fixture-mrad {1e3 * tilt:g}: give 0 to 200 mrad.")
    return math.hypot(tilt**2, math.sqrt(2.0) * tilt * grade.accelerometer.misalignment), tilt**2


def _protocol(procedure: str, plan: PosePlan, place: Site, placement: float | None) -> Protocol:
    from tumble.protocol import HoldStep, Pose, Protocol, TurnStep

    hand = BY_HAND if procedure != "six-position" else (LEVELLED if placement is None else placement)
    steps: list[Any] = []
    for up, dwell, name in zip(plan.directions, plan.dwells, pose_names(plan), strict=True):
        if steps:
            steps.append(TurnStep(plan.turn))
        steps.append(HoldStep(float(dwell), Pose(np.asarray(up, dtype=float), None, hand), name))
    words = f"{len(plan.dwells)} poses, {plan.name}, as tumble plan found them."
    return Protocol(f"{procedure}-plan", procedure, tuple(steps), site=place, description=words)


def _about_wander(task: PoseTask, plan: PosePlan) -> list[str]:
    from tumble.design.hold_noise import wander_sigma, white_density

    if not task.noise.wanders:
        return []
    dwell = float(np.median(plan.dwells))
    wander = wander_sigma(task.noise, dwell, plan.duration)
    white = white_density(task.noise, task.rate) / math.sqrt(dwell)
    share = 100.0 * wander**2 / (wander**2 + white**2)
    more = " Longer holds would not help: more poses do." if share > 50.0 else ""
    return [
        (
            f"The biases wander by {wander / _MICRO_G:.2g} µg from hold to hold, the white noise of a hold is "
            f"{white / _MICRO_G:.2g} µg: {share:.0f} % of the variance are wander, which the order of the poses "
            f"lessens: keep it.{more}"
        )
    ]


def _about_turns(procedure: str) -> list[str]:
    if procedure != "hand-held":
        return []
    return [
        (
            "The first table is what the holds tell of the accelerometers, the last one what holds and turns tell of "
            "both triads. Turn about all axes of the unit, and about no two the same way one after the other."
        )
    ]


def _about_gravity(place: Site) -> list[str]:
    if place.gravity_sigma == 0.0:
        return []
    ppm = 1e6 * place.gravity_sigma / place.gravity
    return [
        (
            f"Gravity is good to {ppm:.2g} ppm, which all scale factors share and no pose mends: --gravity says it "
            "better. The comparison with other schemes is without it."
        )
    ]


def _unmet(plan: PosePlan, place: Site, targets: dict[str, float]) -> list[str]:
    """Say which targets the plan misses, and how much longer it would have to last for white noise."""
    off: list[str] = []
    worst = 0.0
    for one in predict(plan, place):
        target = targets.get(one.group)
        if target is not None and one.total > target:
            off.append(one.name)
            worst = max(worst, one.total / target)
    if not off:
        return ["The plan reaches all targets."] if targets else []
    return [
        (
            f"The plan misses the target of {', '.join(off)} by up to {worst:.2g} times: white noise alone asks for "
            f"{worst**2:.2g} times the time, and gravity and wander do not fall with it."
        )
    ]


def _check(
    poses: int | None, minutes: float | None, hold: float | None, turn: float | None, seed: int
) -> None:
    if poses is not None and minutes is not None:
        raise UsageError(
            "--poses and --time: give the number of poses or the time of the whole test, not both."
        )
    if minutes is not None and hold is not None:
        raise UsageError(
            "--hold and --time: with the time of the whole test the dwells follow; leave --hold out."
        )
    if poses is not None and not 1 <= poses <= MOST_POSES:
        raise UsageError(f"--poses {poses}: give 1 to {MOST_POSES}.")
    if minutes is not None and not 0.0 < minutes <= 10_000.0:
        raise UsageError(f"--time {minutes:g}: give minutes of the whole test, up to 10000.")
    if hold is not None and not 1.0 <= hold <= 100_000.0:
        raise UsageError(f"--hold {hold:g}: give 1 to 100000 seconds of rest in each pose.")
    if turn is not None and not 0.5 <= turn <= 3600.0:
        raise UsageError(f"--turn-seconds {turn:g}: give 0.5 to 3600 seconds from one pose to the next.")
    if seed < 0:
        raise UsageError(f"--seed {seed}: a seed is a whole number from 0 on.")


def _folder(output: str | os.PathLike[str]) -> Path:
    folder = Path(output)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder for {', '.join(FILES)}.")
    return folder


def _write(done: PosesPlanned, folder: Path) -> list[Path]:
    """Write all files beside their places, then rename them all."""
    from tumble.files import write_texts
    from tumble.protocol import protocol_to_yaml
    from tumble.report.operator_sheet import render_sheet

    texts = (
        protocol_to_yaml(done.protocol),
        json.dumps(document_of(done), indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        _page(done),
        render_sheet(done.protocol, done.plan.name),
    )
    return write_texts({folder / name: text for name, text in zip(FILES, texts, strict=True)})


def scheme_rows(done: PosesPlanned) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the comparison, the plan first; numbers are root mean squares of the noise alone.

    Parameters
    ----------
    done : what was planned.
    """
    heads = [
        "in the same time",
        "poses",
        "rest",
        *(f"{group}, {unit}" for group, (unit, _) in UNITS.items()),
        "criterion",
    ]
    plan = done.plan
    rows = [_scheme_row(f"this plan: {plan.name}", plan, plan.value)]
    for name, one in done.schemes.items():
        rows.append(
            [f"{name}: {one}", "", "", "", "", "", ""]
            if isinstance(one, str)
            else _scheme_row(name, one, plan.value)
        )
    return heads, rows


def _scheme_row(name: str, plan: PosePlan, best: float) -> list[str]:
    dwells = np.asarray(plan.dwells)
    low, high = float(dwells.min()), float(dwells.max())
    rest = f"{low:.0f} s" if high - low < 1.0 else f"{low:.0f} to {high:.0f} s"
    means = [f"{value:.3g}" if math.isfinite(value) else "–" for value in group_means(plan).values()]
    return [name, str(len(dwells)), rest, *means, f"{plan.value / best:.2f}"]


def parameter_rows(done: PosesPlanned) -> list[list[str]]:
    """Return name, predicted standard uncertainty, unit and what is of noise alone, for a table.

    Parameters
    ----------
    done : what was planned.
    """
    rows: list[list[str]] = []
    for one in done.predicted:
        unit, size = UNITS[one.group]
        factor = 1.0 / (size * (done.place.gravity if one.group == "bias" else 1.0))
        rows.append([one.name, f"{one.total * factor:.3g}", unit, f"{one.noise * factor:.3g}"])
    return rows


def _page(done: PosesPlanned) -> str:
    from tumble.report.plan import render_plan

    plan = done.plan
    drawn = [one for one in done.schemes.values() if not isinstance(one, str)]
    facts = [
        ("Procedure", done.procedure),
        ("Unit", done.grade.name),
        ("Poses", f"{len(plan.dwells)}, of {done.reach.words}, {done.task.criterion.name}-optimal"),
        ("Time", f"{plan.duration / 60.0:.1f} min, {plan.turn:g} s of them for each turn"),
        ("Gravity", f"{done.place.gravity:.5f} ± {done.place.gravity_sigma:.5f} m/s²"),
    ]
    return render_plan(
        title=f"Plan of a {done.procedure} test",
        facts=facts,
        parameters=parameter_rows(done),
        plan=plan,
        names=pose_names(plan),
        others=drawn[:1] + drawn[-1:] if len(drawn) > 1 else drawn,
        schemes=scheme_rows(done),
        sentences=[*done.given, *efficiency_words(plan), *done.remarks],
    )


def efficiency_words(plan: PosePlan) -> list[str]:
    """Return what is proved of the plan.

    Parameters
    ----------
    plan : with its efficiency, or zero.
    """
    if plan.efficiency <= 0.0:
        return []
    return [
        (
            f"Proved: no plan of these poses in this time is better by more than {1.0 / plan.efficiency:.2f} times "
            "in the criterion (were the noise white)."
        )
    ]


def _finite(values: dict[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


def _silent(_: str) -> None:
    """Tell nobody."""
