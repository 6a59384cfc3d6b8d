"""The joint estimator's outcome as an estimate: parameters, covariance, residuals, what was left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tumble.arrays import Matrix, Series, Vectors, inverted
from tumble.calibration.canonical import describe_unknowns
from tumble.calibration.equations.turn import TOTAL
from tumble.calibration.estimate import (
    Beside,
    Described,
    Estimate,
    LeftOut,
    NamedValue,
    TermTest,
    coverage_factor,
    said_of,
)
from tumble.calibration.evidence import Holds, Rotations, Spins, Turns
from tumble.calibration.joint.budget import state_uncertainty
from tumble.calibration.joint.data import JointData
from tumble.calibration.joint.description import describe_wide, rotation_of_frame
from tumble.calibration.joint.influence import FORCE_WANDER, Influences, joint_influences
from tumble.calibration.joint.noise import CHECKED_ANGLE, BalancedJoint
from tumble.calibration.joint.observability import Untold
from tumble.calibration.joint.restless import find_restless, restless_remarks
from tumble.calibration.joint.scatter import wider
from tumble.calibration.joint.system import JointProblem, JointSolution, JointState, Masks, solve_joint
from tumble.calibration.joint.table_parameters import lever_arms_of, table_remarks
from tumble.calibration.joint.terms import Extra, Link, carry, hold_terms, link_covariance
from tumble.calibration.joint.tests import angle_redundancies
from tumble.calibration.joint.unknowns import gyro_matrix
from tumble.calibration.joint.wanted import OF_FORCE
from tumble.calibration.joint.wide import FIXTURE, is_wide, widened
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.scores import hold_norm_errors, score_turns
from tumble.calibration.snooping import Outlier
from tumble.calibration.turntable.words import NOT_ESTIMATED
from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.sensor import ImuModel

# Poses that scatter by less beyond their sigma are nobody's fault.
LEAST_OBJECTED = 1e-4  # rad


@dataclass(slots=True)
class JointOutcome:
    """A settled joint estimate with everything behind it.

    Attributes
    ----------
    recording, data, site : what was recorded, what was observed of it, and where.
    problem, state, balanced : noise, unknowns, solution and tests.
    terms : tests of optional terms.
    start : the other procedure's estimate that it started from; None if there was none.
    untold : what the motion does not tell; None if it tells everything.
    frame : in which the result is asked for.
    has_gyro : whether the recording has one.
    knowledge : of the accelerometers' angles, from an earlier calibration; None for none.
    """

    recording: Recording
    data: JointData
    site: Site
    problem: JointProblem
    state: JointState
    balanced: BalancedJoint
    terms: list[TermTest]
    start: Estimate | None
    untold: Untold | None = None
    frame: str = "accelerometer-x"
    has_gyro: bool = True
    knowledge: StableKnowledge | None = None

    @property
    def kept(self) -> frozenset[str]:
        """Names of the optional terms that were kept."""
        return frozenset(test.name for test in self.terms if test.kept)


def joint_estimate(outcome: JointOutcome) -> Estimate:
    """Return the outcome as an estimate.

    Parameters
    ----------
    outcome : see there.
    """
    solution = outcome.balanced.solution
    influences = joint_influences(outcome.problem, outcome.state)
    described = describe_joint(outcome, influences)
    alone = _alone(outcome)
    norms, sigmas = _norms(outcome, described.model)
    angles, sizes = _turn_scores(outcome, described.model)
    restless = find_restless(outcome.data, outcome.problem.extra, float(outcome.recording.time[0]))
    start = outcome.start
    estimate = Estimate(
        procedure="joint",
        model=described.model,
        names=described.names,
        covariance=described.covariance,
        parameters=described.parameters,
        correlations=described.correlations,
        sigma0=_sigma0(alone),
        sigma0_final=_sigma0(solution),
        degrees_of_freedom=solution.redundancy,
        coverage_factor=coverage_factor(solution.redundancy),
        largest_normalised=_largest(outcome.balanced),
        variance_components=_components(outcome),
        left_out=[_left_out(outlier, norms, angles) for outlier in outcome.balanced.outliers],
        terms=outcome.terms,
        said=said_of(
            remarks=_remarks(outcome, described.parameters),
            cautions=start.cautions if start is not None and _tells_all(start) else (),
            objections=[
                *_objections(outcome),
                *(start.objections if start is not None and _tells_all(start) else ()),
            ],
            not_determined=_not_determined(outcome),
        ),
        evidence=[
            Holds(norms, sigmas, tuple(restless)),
            Turns(angles, np.where(np.isfinite(angles), _turn_sigmas(outcome), np.nan), sizes),
            _spins(outcome),
        ],
        frame=outcome.frame,
        lever_arms=_lever_arms(outcome),
    )
    if start is not None:
        estimate.show(*(one for one in start.evidence if isinstance(one, Rotations)), Beside(start))
    if outcome.untold is None and outcome.has_gyro:
        state_uncertainty(estimate, outcome, influences)
    return estimate


def describe_joint(outcome: JointOutcome, influences: Influences) -> Described:
    """Return the model and its parameters, with the covariance that the residuals ask for.

    Parameters
    ----------
    outcome : see there.
    influences : of its solution.
    """
    solution = outcome.balanced.solution
    size = max(TOTAL, outcome.state.unknowns.size)
    values, covariance = np.zeros(size), np.zeros((size, size))
    values[: outcome.state.unknowns.size] = outcome.state.unknowns
    scale = max(1.0, _sigma0(solution)) ** 2 if solution.redundancy > 0 else 1.0
    covariance[np.ix_(solution.free, solution.free)] = solution.cofactor
    neighbours = influences.neighbours
    wide = outcome.state.unknowns.size
    covariance[:wide, :wide] += sum(neighbours.values(), np.zeros(()))
    terms = outcome.kept
    if terms & set(OF_FORCE) and not solution.state.spins:
        at = np.ix_(solution.free, solution.free)
        shared = neighbours.get(FORCE_WANDER, np.zeros((wide, wide)))
        covariance[at] = wider(covariance[at], -shared[at])
    covariance *= scale
    if is_wide(outcome.state.unknowns) or outcome.untold is not None or not outcome.has_gyro:
        gyro = "full" if outcome.has_gyro else "none"
        return describe_wide(
            *(values, covariance, outcome.site, outcome.recording),
            terms=terms,
            gyro=gyro,
            frame=outcome.frame,
            all_told=outcome.untold is None,
        )
    return describe_unknowns(values, covariance, outcome.site, outcome.recording, terms=terms, gyro="full")


def rest_residuals(outcome: JointOutcome) -> tuple[Vectors, Vectors]:
    """Return what the gyros show at rest beyond what they should, (holds, 3) rad/s, and its variance, (rad/s)².

    Parameters
    ----------
    outcome : the settled solution; observations that were left out have theirs, too.
    """
    state, gravity = outcome.state, outcome.site.gravity
    inverse = inverted(gyro_matrix(state.unknowns))
    residual, variance = np.zeros((outcome.data.holds, 3)), np.ones((outcome.data.holds, 3))
    for section in state.sections:
        for terms in hold_terms(outcome.data, section, state.unknowns, gravity, outcome.problem.extra):
            if terms.kind == "rate":
                residual[terms.place] = -terms.residual @ inverse.T
                spread = inverse @ terms.covariance @ inverse.T
                variance[terms.place] = np.diagonal(spread, axis1=1, axis2=2)
    return residual, variance


def _lever_arms(outcome: JointOutcome) -> Matrix | None:
    x = widened(outcome.state.unknowns)
    return lever_arms_of(x, outcome.kept, np.real(rotation_of_frame(x, outcome.frame)))


def _components(outcome: JointOutcome) -> dict[str, float]:
    extra = outcome.problem.extra
    found = {
        "accelerometer bias from hold to hold, m/s²": float(np.sqrt(extra.force)),
        "gyro bias from hold to hold, rad/s": float(np.sqrt(extra.rate)),
        "direction after a turn, rad": float(np.sqrt(extra.turn)),
        "sway of the pose within a hold, rad": float(np.sqrt(extra.sway)),
    }
    if outcome.data.poses is not None:
        found["placement beyond what the protocol says, rad"] = float(np.sqrt(extra.placement))
    return found


def _tells_all(start: Estimate) -> bool:
    """Whether another procedure meant both triads, so that what it says of them holds here too."""
    return all(
        any(name.startswith(f"{kind}.matrix") for name in start.names)
        for kind in ("accelerometer", "gyroscope")
    )


def _not_determined(outcome: JointOutcome) -> list[str]:
    start = outcome.start
    said = list(start.not_determined) if start is not None and _tells_all(start) else []
    said = [sentence for sentence in said if sentence != NOT_ESTIMATED]
    if not outcome.has_gyro:
        said.append("The gyros: the recording has none.")
    if outcome.untold is not None:
        said += outcome.untold.sentences
    return list(dict.fromkeys(said))


def _objections(outcome: JointOutcome) -> list[str]:
    poses, added = outcome.data.poses, float(np.sqrt(outcome.problem.extra.placement))
    if poses is None or added <= max(float(np.median(poses.sigma)), LEAST_OBJECTED):
        return []
    stated = float(np.median(poses.sigma))
    said = (
        f"The poses scatter by {np.degrees(added):.2g}° beyond the {np.degrees(stated):.2g}° that the protocol "
        "promises: give the sigma that the fixture keeps, or place the unit better."
    )
    return [said]


def _turn_scores(outcome: JointOutcome, model: ImuModel) -> tuple[Series, Series]:
    if not outcome.has_gyro:
        return np.full(outcome.data.holds, np.nan), np.full(outcome.data.holds, np.nan)
    scores = score_turns(model, outcome.data.base)
    return scores.angle, scores.size


def _sigma0(solution: JointSolution) -> float:
    if solution.redundancy <= 0:
        return float("nan")
    return float(np.sqrt(max(solution.square_sum, 0.0) / solution.redundancy))


def _alone(outcome: JointOutcome) -> JointSolution:
    """Solve once more with the noise seen at rest alone, and everything that was recorded."""
    problem = replace(
        outcome.problem, extra=Extra(), masks=Masks.everything(outcome.data.holds), spin_noise={}, wobble={}
    )
    state = JointState(
        outcome.state.unknowns.copy(),
        [replace(s, C_wb=s.C_wb.copy(), earth_w=s.earth_w.copy()) for s in outcome.state.sections],
        {k: replace(s, C_wb=s.C_wb.copy(), own=s.own.copy()) for k, s in outcome.state.spins.items()},
    )
    return solve_joint(problem, state, once=True)


def _norms(outcome: JointOutcome, model: ImuModel) -> tuple[Series, Series]:
    base = outcome.data.base
    norms = hold_norm_errors(model, base.force_mean, outcome.site.gravity)
    assert model.accelerometer is not None
    corrected = model.accelerometer.correct(base.force_mean)
    along = (corrected / np.linalg.norm(corrected, axis=1, keepdims=True)) @ np.asarray(
        np.linalg.inv(model.accelerometer.matrix), dtype=np.float64
    )
    variance = np.einsum("ka,kab,kb->k", along, base.force_covariance, along) + outcome.problem.extra.force
    return norms, np.sqrt(variance)


def _turn_sigmas(outcome: JointOutcome) -> Series:
    """Return (holds,) rad, what carried and seen directions are expected to differ by; NaN without a turn."""
    data, extra = outcome.data, outcome.problem.extra
    sigmas = np.full(data.holds, np.nan)
    k = data.turns
    if not k.size:
        return sigmas
    carried = carry(data, outcome.state.unknowns)
    link = Link(carried.C_se[k], carried.sums[k], carried.duration[k])
    C = np.broadcast_to(np.eye(3), (k.size, 3, 3))
    spread = link_covariance(data, C, link, outcome.state.unknowns, np.zeros(k.size), own_bias=True)
    across = 2.0 / 3.0 * np.trace(spread, axis1=1, axis2=2)
    gravity = outcome.site.gravity
    scale = np.sum(outcome.state.unknowns[3:6] ** 2) / 3.0
    ends = np.zeros(k.size)
    for hold, part in ((k, slice(6, 9)), (k + 1, slice(0, 3))):
        seen = np.trace(data.parts_covariance[hold][:, part, part], axis1=1, axis2=2) / 3.0
        ends = ends + 2.0 * (seen / scale + extra.force) / gravity**2
    more = 2.0 * (extra.turn + extra.rate * carried.duration[k] ** 2 + extra.sway)
    sigmas[k] = np.sqrt(across + ends + more)
    return sigmas


def _spins(outcome: JointOutcome) -> Spins:
    """All rotations, with their residuals along each axis.

    An angle that hardly anything checks leaves hardly any residual: its sigma is the residual's, not the angle's.
    """
    solution = outcome.balanced.solution
    checked = angle_redundancies(outcome.problem, solution)
    found = [(e, k, s) for e in solution.equations for k, s in e.spins.items()]
    rates = np.zeros(len(found))
    residuals, sigmas = np.full((len(found), 3), np.nan), np.full((len(found), 3), np.nan)
    names: list[str] = []
    for at, (equations, k, spin) in enumerate(found):
        told = outcome.data.spins[k]
        tail = equations.section.C_wb[k - equations.section.first, 2]
        axis_b = tail.T @ spin.axis
        names.append(told.name)
        if told.angle is not None:
            rates[at] = told.angle / spin.duration
            residuals[at] = axis_b * spin.angle_residual / spin.duration
            left = np.sqrt(max(checked.get(k, 0.0), CHECKED_ANGLE))
            sigmas[at] = left * max(told.angle_sigma, 1e-9) / spin.duration
        elif told.turn_rate is not None:
            rates[at] = told.turn_rate
            residuals[at] = axis_b * spin.rate_residual
            sigmas[at] = max(told.rate_sigma, 1e-9)
    return Spins(rates, residuals, sigmas, tuple(names))


def _largest(balanced: BalancedJoint) -> float:
    largest = 0.0
    for kind, tests in balanced.tests.items():
        checked = tests.degrees > 0
        if kind not in ("rest", "swing", "parts") and np.any(checked):
            ratio = np.sqrt(tests.statistic[checked] / tests.degrees[checked])
            largest = max(largest, float(ratio.max()))
    return largest


def _left_out(outlier: Outlier, norms: Series, angles: Series) -> LeftOut:
    k, times = outlier.group, f"{outlier.normalised:.1f} times what the others show"
    if outlier.kind == "force":
        return LeftOut(
            "hold",
            k,
            f"its specific force ({1e3 * norms[k]:+.1f} mm/s² off gravity) contradicts the others, {times}",
        )
    if outlier.kind == "rate":
        return LeftOut("hold", k, f"the gyro's output at rest is off by {times}: did it really rest?")
    if outlier.kind in ("tilt", "pose"):
        return LeftOut(
            "hold", k, f"its pose is not what the protocol says, {times}: was it placed otherwise?"
        )
    if outlier.kind == "angle":
        return LeftOut(
            "spin", k, f"the table's angle after hold {k + 1} contradicts everything else, {times}: misread?"
        )
    return LeftOut("turn", k, f"gravity carried by the gyro ends {np.degrees(angles[k]):.2f}° off, {times}")


def _remarks(outcome: JointOutcome, parameters: list[NamedValue]) -> list[str]:
    told = table_remarks(outcome.kept, {p.name: (p.value, p.standard_uncertainty) for p in parameters})
    data, state = outcome.data, outcome.state
    if data.spins:
        windows = sum(len(s.windows) for s in data.spins.values())
        told.append(
            f"{len(data.spins)} rotations of the table show gravity in {windows} windows while it turns, and "
            f"{sum(s.angle is not None for s in data.spins.values())} angles that were read."
        )
        rated = sum(s.turn_rate is not None for s in data.spins.values())
        if rated:
            told.append(
                f"Of {rated} rotations the rate is believed, over as many whole revolutions as there are."
            )
    shaken = [k for k, factor in outcome.problem.spin_noise.items() if factor > 1.1]
    if shaken:
        worst = max(outcome.problem.spin_noise[k] for k in shaken)
        told.append(
            f"In {len(shaken)} of {len(data.spins)} rotations the accelerometers scatter more than at rest, up to "
            f"{np.sqrt(worst):.1f} times: the table shakes, and its windows count for less."
        )
    wobbling = [wobble for wobble in outcome.problem.wobble.values() if wobble > 1e-5]
    if wobbling:
        told.append(
            f"In {len(wobbling)} of {len(data.spins)} rotations the axis wobbles, by up to "
            f"{np.degrees(max(wobbling)) * 3600.0:.0f}″ (one sigma)."
        )
    if data.poses is not None:
        told.append(_of_poses(outcome))
    sway = float(np.sqrt(outcome.problem.extra.sway))
    if sway > 1e-6:
        told.append(
            f"Within a hold the pose sways by {1e3 * sway:.2g} mrad (one sigma, from its start to its end)."
        )
    told += restless_remarks(find_restless(data, outcome.problem.extra, float(outcome.recording.time[0])))
    if len(state.sections) > 1:
        told.append(
            f"The recording falls into {len(state.sections)} parts between which the gyros could not be followed; "
            "each has a heading of its own."
        )
    return told


def _of_poses(outcome: JointOutcome) -> str:
    poses = outcome.data.poses
    assert poses is not None
    solution = outcome.balanced.solution
    at = np.searchsorted(solution.free, np.arange(FIXTURE.start, FIXTURE.stop))
    sigmas = np.sqrt(np.diag(solution.cofactor)[at])
    told = ", ".join(
        f"{np.degrees(v):+.4f}° ± {np.degrees(s):.4f}° about {axis}"
        for v, s, axis in zip(outcome.state.unknowns[FIXTURE], sigmas, "xyz", strict=True)
    )
    headings = int(np.count_nonzero(poses.has_heading))
    return (
        f"{poses.hold.size} poses are believed, {headings} with their heading, to "
        f"{np.degrees(float(np.median(poses.sigma))):.2g}°; the sensors' axes lie in the fixture turned by {told}."
    )
