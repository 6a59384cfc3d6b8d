"""Whatever makes an estimate unfit for use beside the limits of `verdict`: what speaks against what it was told.

What a settled joint estimate finds in its own residuals, what contradicts a data sheet, what a procedure was made for
and the recording does not determine, and a latitude that is not the one of the gyros at rest. There the specific force
is g along the vertical, so that a vertical rate w of the Earth which nobody knows of looks like a g-sensitivity: of
gyros with the matrix M it is ``M w / g``. That is one number where a sensor's own g-sensitivity has nine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series, inverted
from tumble.calibration.checks.suspicions import find_wrong_rates
from tumble.calibration.equations.imu_unknowns import FORCE_ALONE, LAYOUT, PLAIN
from tumble.calibration.equations.rotation_equations import Windows
from tumble.calibration.equations.triad_unknowns import COUNT
from tumble.calibration.estimate import Estimate
from tumble.calibration.poses import missing_poses
from tumble.calibration.prior import StableKnowledge, TriadFleet, TriadSheet, about_sheet, find_contradiction
from tumble.calibration.session import SMALLEST_TURNS, Procedure, Session
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import solve
from tumble.recording import find_axis_contradiction, find_dead_channels, find_saturated_channels
from tumble.units import specific_force_factor

if TYPE_CHECKING:
    from tumble.calibration.evidence import ThermalCurves
    from tumble.calibration.outcome.settled import JointOutcome
    from tumble.calibration.thermal.model import ThermalOutcome
    from tumble.segmentation import Turn

MISSING = (
    "Samples are missing that left no trace in the stamps, the gyros saturate, or the mount gives. Record the stamps "
    "of a clock, or count the samples against one."
)
# Poses that scatter by less beyond their sigma are nobody's fault, nor by what chance makes of right ones more often.
LEAST_OBJECTED = 1e-4  # rad
SCATTER_FALSE_ALARM = 2e-3
# Poses are hardly believed with so many times what they scatter by; numbers that then lose a sixth of their information
# stand on them.
HARDLY_BELIEVED, MUCH_LESS_CERTAIN = 10.0, 1.1
# An Earth rate that the gyros contradict by more standard uncertainties than this, and by more than this.
CONTRADICTION, SMALLEST_VERTICAL = 5.0, 5e-7  # rad/s
# A fixture's turns that miss its poses by less than this are nobody's fault.
LEAST_MISSED = 5e-4  # rad
# Gravity that goes round with a table, against the gyros: no table shakes by so much for seconds.
LARGEST_TABLE_MISFIT = 1e-3  # rad
# Twice the log-likelihood that it has to gain: of five turns chance does it in one of thirty thousand recordings.
EVIDENT = 20.0
# Numbers that move by less than so many standard uncertainties are the same result.
ANOTHER_RESULT = 1.0


def say_contradictions(estimate: Estimate, outcome: JointOutcome, jumps: Sequence[str]) -> None:
    """Object to what was recorded that contradicts the protocol or the site, and to biases that jumped.

    Parameters
    ----------
    estimate, outcome : of the settled solution.
    jumps : what is said of each.
    """
    each = (
        *(_of_poses(outcome), *_of_left_out(outcome), _of_fixture_turns(outcome), _of_earth(outcome)),
        *find_wrong_rates(outcome.task, outcome.table_sigma),
        *(_of_gravity_on_tables(outcome), *jumps),
    )
    estimate.say("objection", *filter(None, each))


def _of_poses(outcome: JointOutcome) -> str:
    poses, added = outcome.data.poses, float(np.sqrt(outcome.task.noise["placement"]))
    if poses is None:
        return ""
    stated = float(np.median(poses.sigma))
    if (
        added <= max(stated, LEAST_OBJECTED)
        or _chance_of_scatter(outcome, added / stated) > SCATTER_FALSE_ALARM
        or not _stands_on_poses(outcome)
    ):
        return ""
    return (
        f"The poses scatter by {np.degrees(added):.2g}° beyond the {np.degrees(stated):.2g}° that the protocol "
        "promises: give the sigma that the fixture keeps, or place the unit better."
    )


def _chance_of_scatter(outcome: JointOutcome, times: float) -> float:
    """How often poses that are as stated seem to scatter by so many times the stated sigma beyond it.

    Six faces check one another in nine directions: chance doubles their variance in one recording of thirty.
    """
    from scipy.special import chdtrc

    tests = outcome.balanced.tests
    checks = sum(float(tests[kind].redundancy.sum()) for kind in ("tilt", "pose") if kind in tests)
    return float(chdtrc(checks, checks * (1.0 + times**2)))


def _stands_on_poses(outcome: JointOutcome) -> bool:
    """Whether poses that are hardly believed would leave any number of the result much less certain.

    A strapdown rotation's numbers come from gravity before and after each sequence, wherever it points.
    """
    assert outcome.data.poses is not None
    solution, loose = outcome.balanced.solution, outcome.task.copy()
    kept = max(float(np.median(outcome.data.poses.sigma)) ** 2, loose.noise["placement"])
    loose.noise.set("placement", HARDLY_BELIEVED**2 * kept)
    try:
        variance = np.diag(solve(loose, once=True).cofactor)
    except (ConvergenceError, ObservabilityError):
        return True
    free = solution.unknowns.free
    asked = (
        np.ones(free.size, bool) if outcome.frame == "fixture" else ~np.isin(free, LAYOUT.indices("fixture"))
    )
    return bool(np.any(variance[asked] > MUCH_LESS_CERTAIN**2 * np.diag(solution.cofactor)[asked]))


def _of_left_out(outcome: JointOutcome) -> list[str]:
    """A pose or an angle that was left out where another one's error explains what was recorded about as well."""
    poses, rotations, said = outcome.data.poses, outcome.data.rotations, list[str]()
    read = np.array([k for k, spin in rotations.items() if spin.angle is not None], int)
    for kind, rows, again in (
        ("pose", read[:0] if poses is None else poses.hold, "Place the unit in both again, or in more poses"),
        ("angle", read, "Look at both in the protocol (`angle_deg`), or turn again"),
    ):
        exchanged = _exchanged(outcome, kind, rows)
        if exchanged is not None and (kind == "angle" or _stands_on_poses(outcome)):
            one, other = (f"hold {k + 1}" if kind == "pose" else rotations[k].name for k in exchanged)
            said.append(
                f"The {kind} of {one} contradicts the rest and was left out. Were that of {other} wrong instead, it "
                f"would explain what was recorded about as well, and the result would be another. {again}."
            )
    return said


def _exchanged(outcome: JointOutcome, kind: str, rows: np.ndarray) -> tuple[int, int] | None:
    """The one that was left out and the other one that could be as well, by the square sum, with another result."""
    taking_part, solution = outcome.task.taking_part[kind], outcome.balanced.solution
    free, sigma = solution.unknowns.free, np.sqrt(np.diag(solution.cofactor))
    found: list[tuple[float, int, int]] = []
    for left_out in rows[~taking_part[rows]].tolist():
        for other in rows[taking_part[rows]].tolist():
            task = outcome.task.copy()
            task.taking_part[kind][[left_out, other]] = True, False
            try:
                unlikely = solve(task).square_sum
            except (ConvergenceError, ObservabilityError):
                continue
            moved = np.abs(task.unknowns.values - solution.unknowns.values)[free] / sigma
            if np.max(moved) > ANOTHER_RESULT:
                found.append((unlikely, left_out, other))
    if not found or min(found)[0] > solution.square_sum + EVIDENT:
        return None
    return min(found)[1:]


def _of_fixture_turns(outcome: JointOutcome) -> str:
    """What turns miss beyond the gyros' noise, where a fixture makes them: no hand, no bandwidth explains it there."""
    poses, missed = outcome.data.poses, float(np.sqrt(outcome.task.noise["turn"]))
    if poses is None or not outcome.data.turns.size:
        return ""
    known = poses.hold[poses.has_heading]
    made = np.isin(outcome.data.turns, known) & np.isin(outcome.data.turns + 1, known)
    kept = float(np.median(poses.sigma))
    if 2 * np.count_nonzero(made) < made.size or missed <= max(kept, LEAST_MISSED):
        return ""
    return (
        f"The fixture's turns miss its poses by {np.degrees(missed):.2g}° beyond the gyros' noise, and the protocol "
        f"promises {np.degrees(kept):.2g}°. {MISSING}"
    )


def _of_earth(outcome: JointOutcome) -> str:
    """The vertical Earth rate that the gyros show at rest by themselves, against the latitude's."""
    tests = outcome.balanced.tests.get("earth")
    if tests is None or not outcome.has_gyro or not np.any(tests.degrees > 0):
        return ""
    worst = int(np.argmax(tests.statistic))
    certain = float(np.sqrt(tests.statistic[worst]))
    # By how much the gyros alone say otherwise; down is the third axis.
    upward = -float(np.sign(tests.residual[worst, 0]) * np.sqrt(tests.predicted[worst]))
    if certain < CONTRADICTION or abs(upward) < SMALLEST_VERTICAL:
        return ""
    return (
        f"The gyros show at rest {upward:+.2g} ± {abs(upward) / certain:.1g} rad/s more of the Earth "
        "rate upwards than the latitude gives. Either the site is another one (--site), and with it "
        "gravity, or biases follow the poses."
    )


def _of_gravity_on_tables(outcome: JointOutcome) -> str:
    """Where the accelerometers see gravity while a table turns, against where the gyros have it.

    What shakes a table is over in less than a window.
    """
    scale = float(np.mean(np.abs(outcome.task.unknowns["force.scale"]))) * outcome.site.gravity
    missed: list[float] = []
    for found in outcome.balanced.solution.chains():
        for term in found.chain.terms:
            if isinstance(term.equations, Windows):
                noise: Series = np.trace(term.equations.spin.force_covariance, axis1=1, axis2=2)
                square: Series = np.sum(np.square(term.raw), axis=1)
                beyond = float(np.mean(square - noise))
                missed.append(max(beyond, 0.0) ** 0.5 / scale)
    usual = float(np.quantile(missed, 0.75)) if missed else 0.0
    if usual <= LARGEST_TABLE_MISFIT:
        return ""
    return (
        f"While the table turns, the accelerometers see gravity {np.degrees(usual):.2g}° from where the gyros have it, "
        f"in a quarter of the {len(missed)} rotations or more. {MISSING}"
    )


# By so many of its standard uncertainties the one number is not zero, and so likely chance makes the axes differ.
# What is across is smaller: with the vertical part of the Earth's rotation the horizontal one is wrong, too.
CERTAIN, CHANCE = 5.0, 0.001
# A latitude has a sine; beyond this the rate is not the Earth's.
LARGEST_SINE = 1.02
_NAMES = [f"gyroscope.g_sensitivity[{i},{j}]" for i in range(3) for j in range(3)]


def find_other_latitude(estimate: Estimate, site: Site) -> str:
    """Return an objection to a g-sensitivity that is another latitude's Earth rate; empty where it is none.

    Parameters
    ----------
    estimate, site : with a g-sensitivity, and a latitude, or there is nothing to ask.
    """
    found, gyroscope = estimate.model.g_sensitivity, estimate.model.gyroscope
    if site.latitude is None or found is None or gyroscope is None or not set(_NAMES) <= set(estimate.names):
        return ""
    at = [estimate.names.index(name) for name in _NAMES]
    covariance, gravity = estimate.covariance[np.ix_(at, at)], site.gravity
    from scipy.special import chdtrc

    inverse = inverted(gyroscope.matrix)
    turned = np.kron(inverse, np.eye(3))
    seen = gravity * (inverse @ found).ravel()
    weight = inverted((gravity**2 * turned @ covariance @ turned.T)[::4, ::4])
    along, across = seen[::4], np.delete(seen, [0, 4, 8])
    precision = float(np.sum(weight))
    upward = float(np.sum(weight @ along)) / precision
    left = float(along @ weight @ along) - upward**2 * precision
    sine = np.sin(site.latitude) + upward / EARTH_RATE
    is_one = abs(upward) * precision**0.5 > CERTAIN and float(chdtrc(2, max(left, 0.0))) > CHANCE
    is_one = is_one and float(np.sqrt(np.mean(across**2))) < abs(upward)
    if not is_one or abs(sine) > LARGEST_SINE:
        return ""
    shown = np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0)))
    return (
        f"The gyros at rest show {upward:+.2g} ± {precision**-0.5:.1g} rad/s more of the Earth's rotation upwards than "
        f"the latitude {np.degrees(site.latitude):.1f}° gives, as at {shown:.1f}°. It stands in the g-sensitivity, "
        "which is the same on all axes. Check the latitude (--site), and with it gravity."
    )


def say_of_sheets(
    estimate: Estimate,
    outcome: JointOutcome,
    sheets: Sequence[TriadSheet],
    alike: Mapping[str, float],
    alone: bool,
) -> bool:
    """Say what the recording left to data sheets and what contradicts them; return whether anything does.

    Parameters
    ----------
    estimate, outcome : of the recording.
    sheets : what was believed, or was not.
    alike : what clock and table may be wrong by, which no sheet is contradicted by.
    alone : the estimate was made without them.
    """
    before = len(estimate.objections)
    u, solution = outcome.task.unknowns, outcome.balanced.solution
    covariance = solution.unit_weight * u.expanded(solution.cofactor)
    for one in (sheet for sheet in sheets if np.all(np.isin(sheet.place, u.free))):
        values, spread = u.values[one.place], covariance[np.ix_(one.place, one.place)]
        if one.name == "gyro":
            own = TriadFleet.of("", values[:9].reshape(3, 3), values[9:], spread)
            values, spread = own.mean, own.covariance
        share = (
            max(alike.values()) if one.name == "gyro" else outcome.site.gravity_sigma / outcome.site.gravity
        )
        remarks, objections = about_sheet(one, values, np.sqrt(np.diag(spread)), share, alone=alone)
        estimate.say("remark", *remarks)
        estimate.say("objection", *objections)
    return len(estimate.objections) > before


def say_missing(estimate: Estimate, outcome: JointOutcome, procedure: Procedure) -> None:
    """Object where what was recorded does not determine what the procedure is made for.

    Parameters
    ----------
    estimate, outcome : of the recording.
    procedure : with its promises.
    """
    for triad in procedure.promises:
        if not (outcome.has_gyro if triad == "gyros" else outcome.has_force):
            estimate.say("objection", f"The recording has no {triad}, which {procedure.name} is made for.")
            continue
        estimate.say("objection", *filter(None, [find_missing(outcome, triad)]))


def find_missing(outcome: JointOutcome, triad: str) -> str:
    """Return the sentence on what would determine all of a triad; empty where what was recorded does.

    Parameters
    ----------
    outcome, triad : of the recording, "accelerometers" or "gyros".
    """
    own = FORCE_ALONE if triad == "accelerometers" else np.setdiff1d(PLAIN, FORCE_ALONE)
    if outcome.untold is None or not np.any(np.isin(own, outcome.untold.unknowns)):
        return ""
    missing = outcome.untold.sentences(own)
    if triad == "accelerometers":
        factor = specific_force_factor(outcome.recording.specific_force_unit)
        poses = outcome.data.base.force_mean, outcome.values[:COUNT]
        said = missing_poses(*poses, has_prior=outcome.knowledge is not None, factor=factor)
        missing = [said] if said else missing
    return f"What was recorded does not determine all of the {triad}. {' '.join(missing[:2])}"


# Noise alone brings single samples of a right hold to the largest number of a recording.
STUCK = 0.05


def say_of_recording(estimate: Estimate, session: Session, without_holds: Sequence[str]) -> None:
    """Object to what is wrong with sensors, columns, rests and the place.

    Parameters
    ----------
    estimate, session : of the recording.
    without_holds : what is said of files that give no hold.
    """
    recording = session.recording
    saturated = find_saturated_channels(recording)
    # Holds do not tell which way the gyro counts; where there are turns between them, these do.
    has_both = recording.specific_force is not None and recording.angular_rate is not None
    against = (
        *(*without_holds, *find_dead_channels(recording)),
        *(remark.text for remark in recording.remarks if remark.kind == "doubtful"),
        *(_of_limits(session) if saturated else ()),
        find_axis_contradiction(recording) if has_both else "",
        of_other_rests(session),
        find_other_latitude(estimate, session.site),
    )
    estimate.say("remark", *saturated)
    estimate.say("objection", *filter(None, against))


def _of_limits(session: Session) -> list[str]:
    """What is said of holds in which an accelerometer is at its limit: they show less than gravity."""
    from tumble.recording import limits_reached
    from tumble.segmentation import carries_remainder

    force, holds, said = session.recording.specific_force, session.timeline.holds, list[str]()
    if force is None:
        return said
    carried = carries_remainder(force, [hold.stretches() for hold in holds])
    for limit in limits_reached(force):
        axis = "xyz".index(limit.channel)
        stuck = force[:, axis] == limit.value
        at = [str(k + 1) for k, hold in enumerate(holds) if np.mean(stuck[hold.start : hold.stop]) > STUCK]
        # Steps coarser than the noise repeat their numbers at rest, too, and so do pulses.
        if at and not carried[axis] and float(np.median(np.abs(np.diff(force[:, axis])))) > 0.0:
            more = f" and {len(at) - 4} more" if len(at) > 4 else ""
            said.append(
                f"Accelerometer {limit.channel} is at its limit ({limit.value:g} "
                f"{session.recording.specific_force_unit}) in hold {', '.join(at[:4])}{more}: there it shows less than "
                "gravity. Choose a larger range."
            )
    return said


def of_other_rests(session: Session) -> str:
    """Return what is said of rests at another level of the gyros; holds that a user names are all that there are.

    Parameters
    ----------
    session : of the recording.
    """
    from tumble.segmentation import find_other_rests

    recording, timeline = session.recording, session.timeline
    other = None if session.intervals is not None else find_other_rests(recording, timeline)
    if other is None:
        return ""
    first, last = (float(recording.time[i]) for i in (other.spans[0][0], other.spans[-1][1] - 1))
    return (
        f"In {len(other.spans)} stretches in several poses between {first:.0f} s and {last:.0f} s gravity stands "
        f"still, and the gyros show about {np.degrees(other.rate):.2g} °/s more than in the {len(timeline.holds)} "
        "holds. So they are rests that were not used. The unit was switched on anew, its biases jumped, or two units "
        "are in one recording. Calibrate each part by itself, or with --turn-ons if all of them are this unit's."
    )


def say_of_turns(estimate: Estimate, turns: Sequence[Turn], reason: str) -> None:
    """Object to an estimate without the gyros where turns were made for them.

    Parameters
    ----------
    estimate, turns : of the recording.
    reason : why it was made by its procedure.
    """
    if len(turns) < SMALLEST_TURNS or any(name.startswith("gyroscope.matrix") for name in estimate.names):
        return
    lost = [turn.reason for turn in turns if not turn.usable]
    because = f" {len(lost)} of them cannot be used ({lost[0]})." if lost else ""
    estimate.say(
        "objection",
        f"The recording has {len(turns)} turns, but they do not calibrate the gyro.{because} {reason} "
        "With --procedure multi-position the accelerometers' part is judged alone.",
    )


def say_of_prior(estimate: Estimate, knowledge: StableKnowledge, seen: Sequence[StableKnowledge]) -> None:
    """Object to a prior that the poses contradict, where they can tell the angles without it.

    Parameters
    ----------
    estimate : gets an objection, or a caution where nothing can be checked.
    knowledge, seen : the prior, and what each recording tells without it.
    """
    if not seen:
        estimate.say(
            "caution",
            "The prior is taken on trust: the poses are too few to check it against them, and with another "
            "unit's the result would look the same and be wrong. Be sure that it is this unit's, or record nine poses "
            "or more.",
        )
    elif said := find_contradiction(knowledge, seen):
        estimate.say("objection", said)


# A model that more rests than this contradict does not describe them; as many of one branch are more than chance.
LARGEST_SHARE_CONTRADICTING, FEWEST_OF_BRANCH = 0.1, 4


def say_of_temperatures(estimate: Estimate, found: ThermalOutcome, evidence: ThermalCurves) -> None:
    """Object to functions of temperature that nothing tests, or that many rests or most of one branch contradict.

    Parameters
    ----------
    estimate, found, evidence : of one thermal adjustment.
    """
    against, kept = list[str](), found.points
    left = "soak" if evidence.kind == "soak" else "band of temperature"
    if not evidence.candidates:
        against.append(
            f"Without one {left} the other rests do not determine the functions of temperature. So nothing shows "
            f"whether a {evidence.basis} is enough. Record more temperatures, or more poses at each, and let each "
            "temperature settle."
        )
    gone = np.isin(np.arange(len(kept)), [outlier.group for outlier in found.fit.outliers])
    count = int(np.count_nonzero(gone))
    if count > LARGEST_SHARE_CONTRADICTING * len(kept):
        against.append(
            f"{count} of {len(kept)} rests contradict the model and were left out: the functions of temperature do not "
            "describe what this unit does. Sweep slower, or so that each temperature settles."
        )
    for branch, name in ((kept.hysteresis > 0.0, "heating"), (kept.hysteresis < 0.0, "cooling")):
        of_branch, lost = int(np.count_nonzero(branch)), int(np.count_nonzero(branch & gone))
        if lost >= FEWEST_OF_BRANCH and 2 * lost > of_branch:
            against.append(
                f"{lost} of {of_branch} rests while {name} were left out: what is left describes one branch alone."
            )
    estimate.say("objection", *against)
