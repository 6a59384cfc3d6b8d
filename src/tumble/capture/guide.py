"""What the holds and turns so far are worth, what would tell most next, and when it is enough.

The information is that of the joint estimator on the holds and turns that were recorded, with block means of 0.05 s
in place of samples: a turn by hand does not need more. What a next hold or turn would add is played beforehand, as
for `tumble plan --given`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.attitude import twenty_six_directions
from tumble.calibration import SCALE, Session, missing_poses
from tumble.capture.coach import Advice, Progress
from tumble.capture.live_holds import MOST_BLOCKS, LiveBlocks, LiveHold, in_si
from tumble.design import (
    NAMES,
    PARAMETER_GROUPS,
    PARAMETERS,
    SESSION,
    TOLD,
    WORTH,
    Aim,
    JointInformation,
    NextStep,
    PlannedNoise,
    PlanTask,
    StepCandidate,
    find_next_steps,
    judge_stop,
    led_holds,
    observed_problem,
    parameter_sizes,
    turn_candidates,
    usual_pose,
)
from tumble.earth import Site
from tumble.errors import ObservabilityError, UsageError
from tumble.parameters import si_of
from tumble.protocol import HoldStep, Protocol, TurnStep
from tumble.recording import Recording, clock_of_stamps
from tumble.records import dataclass
from tumble.sample_rates import CRYSTAL
from tumble.segmentation import (
    Activity,
    Hold,
    HoldMeans,
    NoiseFloor,
    Timeline,
    find_turns,
    noise_per_sample,
    observe_holds,
)
from tumble.simulation import Grade

# Name of a target, the group of parameters of `tumble.design.joint_information` that it means, and its family.
_TARGETS = {
    "accelerometer.bias": ("accelerometer bias", "accelerometer bias"),
    "accelerometer.scale": ("accelerometer scale", "scale"),
    "accelerometer.misalignment": ("accelerometer misalignment", "angle"),
    "gyro.bias": ("gyro bias", "gyro bias"),
    "gyro.scale": ("gyro scale", "scale"),
    "gyro.misalignment": ("gyro misalignment", "angle"),
    "gyro.rotation": ("rotation between the triads", "angle"),
    "gyro.g-sensitivity": ("g-sensitivity", "g-sensitivity"),
}
# What a family's unit is of, and what people give a target in.
_GIVEN = {
    "accelerometer bias": ("specific force", "mg, ug, m/s^2"),
    "gyro bias": ("angular rate", "deg/h, deg/s, mdeg/s, rad/s"),
    "scale": ("ratio", "ppm, %, no unit"),
    "angle": ("angle increment", "mrad, deg, arcsec, rad"),
    "g-sensitivity": ("rate per force", "deg/h/g, deg/s/g, mdeg/s/g"),
}
_FAMILIES = dict(_TARGETS.values())


def read_targets(texts: Sequence[str]) -> dict[str, float]:
    """Return wished-for standard uncertainties, SI, by group of parameters.

    Parameters
    ----------
    texts : such as "accelerometer.bias=2mg"; several in one text with commas between.

    Raises
    ------
    UsageError
        If one is none.
    """
    found: dict[str, float] = {}
    for part in (piece.strip() for text in texts for piece in text.split(",")):
        if not part:
            continue
        name, _, wish = part.partition("=")
        name = name.strip().lower().replace("gyroscope", "gyro").replace("accel.", "accelerometer.")
        if name not in _TARGETS:
            raise UsageError(f"--target {part}: {name!r} is no parameter; known are {', '.join(_TARGETS)}.")
        group, family = _TARGETS[name]
        kind, units = _GIVEN[family]
        number = re.fullmatch(r"\s*((?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(.*?)\s*", wish.lower())
        value, unit = number.groups() if number else ("nan", "")
        of, size = si_of(unit)
        if of != kind or not 0.0 < float(value) < math.inf:
            raise UsageError(f"--target {part}: give a positive number with its unit, one of {units}.")
        found[group] = float(value) * size
    return found


def limits_of(targets: dict[str, float]) -> Series | None:
    """Return (30,) wished-for sigmas of `joint_information.NAMES`, infinite where nothing is wished; None for none.

    Parameters
    ----------
    targets : SI, by group.
    """
    from tumble.design import PARAMETER_GROUPS, PARAMETERS

    if not targets:
        return None
    limits = np.full(PARAMETERS, np.inf)
    for group, value in targets.items():
        limits[PARAMETER_GROUPS[group]] = value
    return limits


@dataclass(frozen=True)
class GroupProgress:
    """The worst standard uncertainty of a group of parameters beside its target, in the unit that people say.

    Attributes
    ----------
    group : its name.
    sigma : how many are determined, while not all are.
    target : empty where none is wished for.
    reached : whether the worst is below it.
    """

    group: str
    sigma: str
    target: str
    reached: bool


def groups_of(sigmas: Mapping[str, float | None], targets: Mapping[str, float]) -> list[GroupProgress]:
    """Return the groups of which anything is known.

    Parameters
    ----------
    sigmas : standard uncertainty by parameter, SI; None while not determined.
    targets : wished-for ones, SI, by group.
    """
    from tumble.design import NAMES, PARAMETER_GROUPS
    from tumble.report import practical_uncertainties

    rows: list[GroupProgress] = []
    for group, part in PARAMETER_GROUPS.items():
        names = [name for name in NAMES[part] if name in sigmas]
        if not names:
            continue
        told = [sigma for name in names if (sigma := sigmas[name]) is not None]
        known = len(told) == len(names)
        worst, target = max(told) if known else math.nan, targets.get(group, math.nan)
        sigma, wish = (one.text for one in practical_uncertainties(_FAMILIES[group], [worst, target]))
        rows.append(
            GroupProgress(
                group,
                sigma if known else f"{len(told)} of {len(names)} determined",
                wish if group in targets else "",
                worst <= target,
            )
        )
    return rows


# s that a person needs to bring the unit from one pose to the next.
TURN = 3.0
# Poses beyond which it is not said how far the targets are.
FAR = 100.0
# Stamps that show what clock they are from.
ENOUGH_STAMPS = 2000


class Guide:
    """The information so far and the way on.

    Parameters
    ----------
    grade : what kind of unit it is: by how much such units differ, and what their biases wander.
    site : gravity, and the Earth rate if the latitude is known.
    hold : s that a person is asked to hold each pose.
    targets : wished-for standard uncertainties, SI, by group.
    rate : Hz, as stated; it counts where its uncertainty is stated too.
    patient : wait for what is reckoned beside; for recordings that are replayed.
    """

    def __init__(
        self,
        grade: Grade,
        site: Site,
        hold: float,
        targets: dict[str, float],
        *,
        rate: float | None = None,
        patient: bool = False,
    ) -> None:
        self.site, self.hold, self.targets = site, hold, targets
        self.blocks, self._waiting = MOST_BLOCKS, False
        self._grade, self._patient = grade, patient
        self._limits = limits_of(targets)
        self._candidates: dict[int, Future[list[StepCandidate]]] = {}
        self._turns: list[StepCandidate] | None = None
        self._task: PlanTask | None = None
        self._usual: JointInformation | None = None
        self._beyond: JointInformation | None = None
        self._latest: tuple[int, JointInformation] | None = None
        self._first = 0
        self._rate, self._stamps = rate, np.zeros(0)
        self.clock_sigma = 0.0
        """Of the gyro scale factors, as a share: what no hold and no turn sees of the samples' clock."""

    def look_at_clock(self, time: Series) -> None:
        """Find out by the first stamps what clock they are from.

        Parameters
        ----------
        time : (samples,) s, the next stamps as they came.
        """
        if len(self._stamps) >= ENOUGH_STAMPS:
            return
        self._stamps = np.concatenate([self._stamps, time[: ENOUGH_STAMPS - len(self._stamps)]])
        clock = clock_of_stamps(self._stamps, self._rate)
        # What few stamps jitter by is nothing over a session; live ones are held against this computer's clock.
        live = not self._patient and clock.kind != "stated"
        self.clock_sigma = CRYSTAL if live or clock.kind == "host" else clock.sigma

    def due(self, time: float) -> bool:
        """Say whether the way on, which was not computed yet, is to be asked for again.

        Parameters
        ----------
        time : s; it does not matter.
        """
        return self._waiting

    def judge(self, live: LiveBlocks, holds: Sequence[LiveHold], activity: Activity) -> Progress:
        """Return what is known from the holds so far.

        Parameters
        ----------
        live : the blocks.
        holds : in order.
        activity : that tells bias and scale where the unit sends counts.
        """
        holds = [h for h in holds if h.hold.start >= live.first * live.cut.size]
        if not holds or live.channels.specific_force_unit is None:
            return Progress(
                words=("No hold yet.",)
                if not holds
                else ("Without an accelerometer poses determine nothing.",)
            )
        recording = in_si(live, activity)
        timeline = _timeline(live, recording, holds, activity)
        if timeline is None:
            return Progress(words=("No hold yet.",))
        means = observe_holds(recording, timeline)
        assert means.specific_force is not None
        up_b = means.specific_force / np.linalg.norm(means.specific_force, axis=1, keepdims=True)
        task = replace(self._task_of(timeline, recording), clock=self.clock_sigma)
        try:
            known = self._information(live, recording, timeline, means, task)
        except ObservabilityError as missing:
            # Such as of numbers that never change: what is recorded is worth more than what can be said of it.
            return Progress(up_b=up_b, words=(str(missing),))
        progress = self._both(task, known, up_b)
        missing = _missing_poses(means.specific_force) if progress.enough else ""
        # A calibration asks for as many different poses as unknowns, however well turns tell them.
        return replace(progress, enough=False, words=(missing,)) if missing else progress

    def _task_of(self, timeline: Timeline, recording: Recording) -> PlanTask:
        """The unit, with its own white noise as the first hold shows it."""
        if self._task is not None:
            return self._task
        floor, grade = timeline.noise_floor, self._grade
        own = [_own_noise(sigma, recording.rate) for sigma in (floor.specific_force, floor.angular_rate)]
        noise = PlannedNoise(
            replace(grade.accelerometer.noise, random_walk=own[0] or grade.accelerometer.noise.random_walk),
            replace(grade.gyroscope.noise, random_walk=own[1] or grade.gyroscope.noise.random_walk),
            grade.rate,
        )
        steps = (HoldStep(self.hold), TurnStep(TURN))
        sizes = parameter_sizes(grade)
        procedure = "joint" if recording.angular_rate is not None else "multi-position"
        self._task = PlanTask(
            Protocol("capture", procedure, steps), self.site, noise, sizes, grade.g_sensitivity > 0.0
        )
        return self._task

    def _information(
        self, live: LiveBlocks, recording: Recording, timeline: Timeline, means: HoldMeans, task: PlanTask
    ) -> JointInformation:
        if live.first != self._first and self._latest is not None:
            # The oldest blocks were let go: what was known from them stays known.
            self._first, self._beyond = live.first, self._latest[1]
        session = Session(recording, given_site=self.site)
        session.timeline, session.means = timeline, means
        information = observed_problem(session, task.noise, g_sensitivity=task.g_sensitivity).information()
        total = information if self._beyond is None else information.plus(self._beyond)
        self._latest = (len(timeline.holds), total)
        return total

    def _both(self, task: PlanTask, known: JointInformation, up_b: Vectors) -> Progress:
        floors = np.zeros(PARAMETERS)
        floors[PARAMETER_GROUPS["accelerometer scale"]] = self.site.gravity_sigma / self.site.gravity
        sigmas, perfect = (
            np.hypot(np.sqrt(np.diag(one.covariance(known))), floors)
            for one in (task, task.with_perfect_clock)
        )
        told = perfect < TOLD * task.sizes
        named: dict[str, float | None] = {
            NAMES[i]: float(sigmas[i]) if told[i] else None for i in map(int, task.parameters())
        }
        candidates = self._of_candidates(task, up_b[-1])
        self._waiting = candidates is None
        if candidates is None:
            return Progress(named, up_b, words=("Computing which step would determine most.",))
        aim = self._aim(task.with_perfect_clock, floors)
        following = find_next_steps(task, known, candidates, 1, aim)[0]
        enough, words = judge_stop(task, known, [following], self._limits, (sigmas, perfect))
        left = 0.0 if aim is None else aim.poses_left(task.with_perfect_clock, known)
        if self._limits is not None and not enough and told[task.parameters()].all():
            # A target in reach is gone for, however little each step adds.
            enough = left == 0.0 or (following.most_gain < WORTH and left > len(up_b))
        if self._limits is not None and self.clock_sigma > np.min(
            self._limits[PARAMETER_GROUPS["gyro scale"]]
        ):
            share = f"{100.0 * self.clock_sigma:.2g} %"
            words = [
                *words,
                (
                    f"No pose determines the gyro scale factors better than {share}: the sample rate is "
                    "not known better."
                ),
            ]
        if not told[task.parameters()].all():
            words = [_untold_words([name for name, sigma in named.items() if sigma is None])]
            # Of usual poses each determines a little of everything; of the first ones that is not so.
            left = 0.0
        return Progress(named, up_b, _advice(following, left), enough, tuple(words))

    def _aim(self, task: PlanTask, floors: Series) -> Aim | None:
        """What poses are to reach: the targets without what no pose mends; None where nothing is left of them."""
        if self._limits is None:
            return None
        if self._usual is None:
            self._usual = usual_pose(task, SESSION)
        floors = floors.copy()
        floors[PARAMETER_GROUPS["gyro scale"]] = self.clock_sigma
        within = np.sqrt(np.maximum(self._limits**2 - floors**2, 0.0))
        limits = np.where(self._limits > floors, within, np.inf)
        return Aim(limits, self._usual) if np.isfinite(limits).any() else None

    def _of_candidates(self, task: PlanTask, start_b: Vector) -> list[StepCandidate] | None:
        """What may come next from a pose, computed once beside the samples that come in; None while that goes on."""
        directions = twenty_six_directions()
        near = int(np.argmax(directions @ start_b))
        if near not in self._candidates:
            pool = ThreadPoolExecutor(1, thread_name_prefix="candidates")
            self._candidates[near] = pool.submit(self._compute, task, directions[near])
            pool.shutdown(wait=False)
        found = self._candidates[near]
        return found.result() if self._patient or found.done() else None

    def _compute(self, task: PlanTask, start_b: Vector) -> list[StepCandidate]:
        if self._turns is None:
            self._turns = turn_candidates(task, table=False, span=SESSION)
        return led_holds(task, SESSION, start_b) + self._turns


def _advice(following: NextStep, left: float) -> Advice:
    name, gain = following.candidate.name, following.gain
    words = f"Next: {name}. It takes {100 * gain:.2g} % off the uncertainties."
    if 0.0 < left < FAR:
        poses = int(np.ceil(left))
        words += f" The targets are about {poses} pose{'s' if poses > 1 else ''} away."
    facts = {"gain": gain, "parameter": following.most, "parameter_gain": following.most_gain}
    return Advice(name, words, following.candidate.steps, facts)


def _missing_poses(means: Vectors) -> str:
    """What `tumble calibrate` will say against the poses so far; nothing if they suffice."""
    unknowns = np.zeros(12)
    unknowns[SCALE] = 1.0
    return missing_poses(means, unknowns, has_prior=False, factor=1.0)


def _untold_words(names: list[str]) -> str:
    """Which parameters are not told yet: each if they are few, else their kinds."""
    if len(names) <= 3:
        return f"Not determined yet: {', '.join(names)}."
    kinds = [group for group, part in PARAMETER_GROUPS.items() if any(name in names for name in NAMES[part])]
    return f"Not determined yet: some of {', '.join(kinds)}."


def _own_noise(sigma: Series, rate: float) -> float:
    """N of white noise, u/√Hz, from the noise of one sample at a rate; zero where it is not known."""
    usual = float(np.sqrt(np.mean(sigma**2))) / rate**0.5
    return usual if np.isfinite(usual) else 0.0


def _timeline(
    live: LiveBlocks, recording: Recording, holds: Sequence[LiveHold], activity: Activity
) -> Timeline | None:
    """The holds on the clock of the block means."""
    size, first, count = live.cut.size, live.first, len(recording)
    found: list[Hold] = []
    for one in holds:
        start = -(-one.hold.start // size) - first
        stop = min(one.hold.stop // size - first, count)
        holes = tuple((a // size - first, -(-b // size) - first) for a, b in one.hold.excluded)
        hold = Hold(start, stop, holes)
        if sum(b - a for a, b in hold.stretches()) >= 4:
            found.append(hold)
    if not found:
        return None
    turns = find_turns(recording, found, activity)
    unknown = np.full(3, np.nan)
    noise = [
        unknown if signal is None else noise_per_sample(signal, found)
        for signal in (recording.specific_force, recording.angular_rate)
    ]
    floor = NoiseFloor(noise[0], noise[1], activity.threshold, "")
    return Timeline(tuple(found), tuple(turns), (), floor)
