"""The joint estimator's outcome as an estimate: parameters, covariance, residuals, what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix, Series, Square
from tumble.calibration.checks.scores import angle_off, hold_norm_errors, hold_norm_variances, score_turns
from tumble.calibration.checks.suspicions import find_courses
from tumble.calibration.equations.causes import FORCE_WANDER, RATE_WANDER
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.equations.observed import Observed
from tumble.calibration.equations.rotation_equations import (
    CHECKED_ANGLE,
    LEAST_ANGLE_SIGMA,
    LEAST_WOBBLE,
    Angle,
    Links,
    RotationEquations,
)
from tumble.calibration.equations.state import rest_noise
from tumble.calibration.equations.turn_equations import (
    bias_variance,
    edge_seconds,
    integrate_links,
    link_covariance,
)
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    LeftOut,
    NamedValue,
    coverage_factor,
)
from tumble.calibration.evidence import Holds, RestlessHold, Spins, Turns
from tumble.calibration.objections import say_contradictions
from tumble.calibration.optional_terms import OF_FORCE, implausible_words, untried_words
from tumble.calibration.outcome.budget import state_uncertainty
from tumble.calibration.outcome.description import describe, rotation_of_frame
from tumble.calibration.outcome.settled import JointOutcome, recording_influences, with_courses
from tumble.calibration.terms import TERMS, lever_arms_of
from tumble.earth import EARTH_RATE
from tumble.errors import ObservabilityError
from tumble.estimation import Balanced, Equations, Influences, Noise, Settled, Unknowns, solve, wider
from tumble.sensor import ImuModel

SITS = (
    "How the unit sits in its fixture is not separated from its misalignments, which are against the "
    "fixture's axes."
)
# Of a correlation matrix: below this, a combination is known exactly, or less than that.
LEAST_EIGENVALUE = 1e-10
# Turns of which a smaller share than this is left to check one another check nothing; nor do holds with fewer checks.
LEAST_CHECKED, LEAST_CHECKS = 0.1, 0.5
# A clock is off if it is so by more than so many of its standard uncertainties.
CLOCK_FALSE_ALARM = 4.0


def joint_estimate(outcome: JointOutcome) -> Estimate:
    """Return the outcome as an estimate.

    Parameters
    ----------
    outcome : see there.
    """
    solution = outcome.balanced.solution
    influences = recording_influences(outcome.task)
    described = _describe_joint(outcome, influences)
    norms, sigmas = _norms(outcome, described.model)
    drifts = _find_courses(outcome)
    if outcome.courses:
        influences = with_courses(influences, outcome.courses)
        described = _describe_joint(outcome, influences)
    angles, sizes = _turn_scores(outcome, described.model)
    restless = find_restless(outcome.data, outcome.task.noise, float(outcome.recording.time[0]))
    figures = Figures(
        _alone(outcome).sigma0,
        solution.sigma0,
        solution.redundancy,
        coverage_factor(solution.redundancy),
        _largest(outcome.balanced),
        _components(outcome),
    )
    estimate = Estimate(
        "joint",
        *(described if outcome.has_force else _of_gyros(described)),
        *figures,
        left_out=_left_out(outcome.balanced, norms, angles),
        terms=[*outcome.terms],
        evidence=[
            *([Holds(norms, sigmas, tuple(restless))] if outcome.has_force else []),
            Turns(angles, np.where(np.isfinite(angles), _turn_sigmas(outcome, sizes), np.nan), sizes),
            _spins(outcome),
        ],
        frame=outcome.frame,
        lever_arms=_lever_arms(outcome),
    )
    estimate.say("remark", *_remarks(outcome, described.parameters, restless))
    estimate.say("caution", *_of_unchecked(outcome), *_of_clock(outcome), *drifts)
    say_contradictions(estimate, outcome, outcome.jumps)
    estimate.say("not determined", *_not_determined(outcome))
    if outcome.untold is None and outcome.has_gyro and outcome.has_force:
        state_uncertainty(estimate, outcome, influences)
    return estimate


def _of_gyros(described: Described) -> Described:
    """What is left of a description where believed poses stand in for accelerometers."""
    names = [k for k, name in enumerate(described.names) if name.startswith("gyroscope")]
    rows = [k for k, one in enumerate(described.parameters) if one.name.startswith("g")]
    return Described(
        replace(described.model, accelerometer=None),
        [described.names[k] for k in names],
        described.covariance[np.ix_(names, names)],
        [described.parameters[k] for k in rows],
        described.correlations[np.ix_(rows, rows)],
    )


def _describe_joint(outcome: JointOutcome, influences: Influences) -> Described:
    """Return the model and its parameters, with the covariance that the residuals ask for."""
    solution, task = outcome.balanced.solution, outcome.task
    values, terms = outcome.values, outcome.kept
    own = solution.cofactor + influences.shared
    if terms & set(OF_FORCE) and not task.rotations:
        own = wider(own, -influences.neighbours.get(FORCE_WANDER, np.zeros(own.shape)))
    require_positive(own, task.unknowns)
    covariance = solution.unit_weight * task.unknowns.expanded(own)
    return describe(
        *(values, covariance, outcome.site, outcome.recording),
        terms=terms,
        gyro="full" if outcome.has_gyro else "none",
        frame=outcome.frame,
        all_told=outcome.untold is None,
    )


def require_positive(covariance: Square, u: Unknowns) -> None:
    """Refuse a covariance that is none: no interval of such an estimate would mean anything.

    Parameters
    ----------
    covariance, u : (free, free), and whose.

    Raises
    ------
    ObservabilityError
        If it is not positive definite.
    """
    variances = np.diag(covariance)
    if np.all(variances > 0.0):
        sigma = np.sqrt(variances)
        values, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
        if values[0] > LEAST_EIGENVALUE:
            return
        worst = int(np.argmax(np.abs(vectors[:, 0])))
    else:
        worst = int(np.argmin(variances))
    raise ObservabilityError(
        "What the observations leave uncertain cannot be stated: the covariance of the adjustment is not positive "
        f"definite, most of all for the {u.layout.label(int(u.free[worst]))}. Record more holds in different poses."
    )


def _find_courses(outcome: JointOutcome) -> list[str]:
    """Find how the biases jump or drift, keep it with the outcome, and return what is said of drifts."""
    drifts = list[str]()
    sources = [*([FORCE_WANDER] if outcome.has_force else []), *([RATE_WANDER] if outcome.has_gyro else [])]
    for triad, found in find_courses(outcome.task, sources):
        outcome.courses.setdefault(triad.source, []).append(triad.course(found))
        (outcome.jumps if found.alternative is triad.jumps else drifts).append(found.said)
    return drifts


def _lever_arms(outcome: JointOutcome) -> Matrix | None:
    x = outcome.values
    return lever_arms_of(x[LAYOUT["lever_arms"]], outcome.kept, np.real(rotation_of_frame(x, outcome.frame)))


def _components(outcome: JointOutcome) -> dict[str, float]:
    noise = outcome.task.noise
    found = {
        "accelerometer bias from hold to hold, m/s²": float(np.sqrt(noise["force"])),
        "gyro bias from hold to hold, rad/s": float(np.sqrt(noise["rate"])),
        "direction after a turn, rad": float(np.sqrt(noise["turn"])),
        "sway of the pose within a hold, rad": float(np.sqrt(noise["sway"])),
    }
    if outcome.data.poses is not None:
        found["placement beyond what the protocol says, rad"] = float(np.sqrt(noise["placement"]))
    if noise["table rate"] > 0.0:
        found["turn of the table beyond what its rate says, rad"] = float(np.sqrt(noise["table rate"]))
    return found


def _not_determined(outcome: JointOutcome) -> list[str]:
    said = [SITS] if outcome.frame == "fixture" else []
    if not outcome.has_gyro:
        said.append("The gyros: the recording has none.")
    if not outcome.has_force:
        said.append("The accelerometers: the recording has none.")
    if outcome.untold is not None:
        said += outcome.untold.sentences()
    said += untried_words(outcome.untried, outcome.task)
    return list(dict.fromkeys(said))


def _turn_scores(outcome: JointOutcome, model: ImuModel) -> tuple[Series, Series]:
    if not (outcome.has_gyro and outcome.has_force):
        return np.full(outcome.data.holds, np.nan), np.full(outcome.data.holds, np.nan)
    scores = score_turns(model, outcome.data.base)
    return scores.angle, scores.size


def _alone(outcome: JointOutcome) -> Settled:
    """Solve once more with the noise seen at rest alone, and everything that was recorded."""
    task = outcome.task.copy()
    task.noise = rest_noise()
    for kind in ("force", "rate", "turn", "pose"):
        task.taking_part[kind][:] = kind != "rate" or outcome.has_gyro
    return solve(task, once=True)


def _norms(outcome: JointOutcome, model: ImuModel) -> tuple[Series, Series]:
    base, noise = outcome.data.base, outcome.task.noise
    norms = hold_norm_errors(model, base.force_mean, outcome.site.gravity)
    assert model.accelerometer is not None
    variance = (
        hold_norm_variances(model.accelerometer, base.force_mean, base.force_covariance) + noise["force"]
    )
    return norms, np.sqrt(variance)


def _turn_sigmas(outcome: JointOutcome, sizes: Series) -> Series:
    """Return (holds,) rad, what carried and seen directions are expected to differ by; NaN without a turn."""
    data, noise, u = outcome.data, outcome.task.noise, outcome.task.unknowns
    sigmas = np.full(data.holds, np.nan)
    k = data.turns
    if not k.size:
        return sigmas
    link = integrate_links(data, u, data.base.turn_start[k], data.base.turn_stop[k])
    C = np.broadcast_to(np.eye(3), (k.size, 3, 3))
    timing = None if data.base.turn_sampling is None else data.base.turn_sampling[k]
    edges = np.add(*edge_seconds(data, k))
    spread = link_covariance(data, C, link, u, edges, timing)
    across = 2.0 / 3.0 * np.trace(spread, axis1=1, axis2=2)
    gravity = outcome.site.gravity
    scale = np.sum(u["force.scale"] ** 2) / 3.0
    ends = np.zeros(k.size)
    for hold, part in ((k, slice(6, 9)), (k + 1, slice(0, 3))):
        seen = np.trace(data.parts_covariance[hold][:, part, part], axis1=1, axis2=2) / 3.0
        ends = ends + 2.0 * (seen / scale + noise["force"]) / gravity**2
    more = 2.0 * (noise["turn"] + bias_variance(outcome.task) * link.duration**2 + noise["sway"])
    # The directions are carried by the stamps and without the Earth's rotation, from the middle of one edge to that
    # of the other: what that is off by across gravity.
    latitude, seconds = outcome.site.latitude, link.duration + 1.5 * edges
    level = EARTH_RATE * (np.sqrt(2.0 / 3.0) if latitude is None else np.cos(latitude)) * seconds
    by_stamps = np.sqrt(2.0 / 3.0) * float(u["clock"][0]) * sizes[k]
    sigmas[k] = np.sqrt(across + ends + more + level**2 + by_stamps**2)
    return sigmas


def _spins(outcome: JointOutcome) -> Spins:
    """All rotations, with their residuals along each axis.

    An angle that hardly anything checks leaves hardly any residual: its sigma is the residual's, not the angle's.
    """
    checked = outcome.balanced.tests.get("angle")
    found = [chain.chain for chain in outcome.balanced.solution.chains()]
    found = [c for c in found if any(isinstance(t.equations, RotationEquations) for t in c.terms)]
    rates = np.zeros(len(found))
    residuals, sigmas = np.full((len(found), 3), np.nan), np.full((len(found), 3), np.nan)
    names: list[str] = []
    for at, chain in enumerate(found):
        last = {term.equations.kind: term for term in chain.terms}
        links = last["links"].equations
        assert isinstance(links, Links)
        spin, k, axis_w = links.spin, links.stretch.k, links.moving.axis_w
        axis_b = links.edges()[0].T @ axis_w
        names.append(spin.name)
        if "angle" in last and spin.angle is not None:
            rates[at] = spin.angle / links.duration
            residuals[at] = axis_b * float(last["angle"].raw[0, 0]) / links.duration
            redundancy = 0.0 if checked is None else float(checked.redundancy[checked.place == k][0])
            left = np.sqrt(max(redundancy, CHECKED_ANGLE))
            sigmas[at] = left * max(spin.angle_sigma, LEAST_ANGLE_SIGMA) / links.duration
        elif "table rate" in last and spin.turn_rate is not None:
            rates[at] = spin.turn_rate
            # The condition's own residual says how well the adjustment keeps the rate, and nothing of the gyros.
            residuals[at] = axis_b * (links.mean_rate(outcome.task.unknowns) - abs(spin.turn_rate))
            sigmas[at] = np.abs(axis_b) * np.hypot(links.mean_rate_sigma(outcome.task), spin.rate_sigma)
    return Spins(rates, residuals, sigmas, tuple(names))


def _largest(balanced: Balanced) -> float:
    largest = 0.0
    for kind, tests in balanced.tests.items():
        checked = tests.degrees > 0
        if kind not in ("rest", "swing", "parts", "angle", "earth") and np.any(checked):
            ratio = np.sqrt(tests.statistic[checked] / tests.degrees[checked])
            largest = max(largest, float(ratio.max()))
    return largest


def _left_out(balanced: Balanced, norms: Series, angles: Series) -> list[LeftOut]:
    """What takes no part, each said by its own equations."""
    of_kind: dict[str, Equations] = {}
    for chain in balanced.solution.chains():
        for equations in [t.equations for t in chain.chain.terms]:
            of_kind.setdefault(equations.kind, equations)
    made: list[LeftOut] = []
    for outlier in balanced.outliers:
        k, times = outlier.group, f"{outlier.normalised:.1f} times what the others show"
        of = Angle if outlier.kind == "angle" else type(of_kind[outlier.kind])
        found = {"norm": f"{1e3 * norms[k]:+.1f} mm/s²", "angle": angle_off(angles[k])}
        made.append(LeftOut(of.words[0], k, of.words[1].format(number=k + 1, times=times, **found)))
    return made


def _remarks(
    outcome: JointOutcome, parameters: list[NamedValue], restless: Sequence[RestlessHold]
) -> list[str]:
    named = {p.name: (p.value, p.standard_uncertainty) for p in parameters}
    kept = [term.parameters for term in TERMS.values() if term.name in outcome.kept and term.parameters]
    told = [remark for one in kept if (remark := one.remark(named))]
    told += implausible_words(outcome.terms)
    data, task = outcome.data, outcome.task
    if data.rotations:
        windows = sum(len(s.windows) for s in data.rotations.values())
        told.append(
            f"{len(data.rotations)} rotations of the table show gravity in {windows} windows while it turns, and "
            f"{sum(task.reads_angle(k) for k in data.rotations)} angles that were read."
        )
        rated = sum(s.turn_rate is not None for s in data.rotations.values())
        if rated:
            told.append(
                f"Of {rated} rotations the rate is believed, over as many whole revolutions as there are."
            )
    shaken = [factor for factor in task.noise.factors.get("windows", {}).values() if factor > 1.1]
    if shaken:
        worst = max(shaken)
        told.append(
            f"In {len(shaken)} of {len(data.rotations)} rotations the accelerometers scatter more than at rest, up to "
            f"{np.sqrt(worst):.1f} times: the table shakes, and its windows count for less."
        )
    wobbles = [LEAST_WOBBLE * np.sqrt(factor) for factor in task.noise.factors.get("axis", {}).values()]
    wobbling = [wobble for wobble in wobbles if wobble > 1e-5]
    if wobbling:
        told.append(
            f"In {len(wobbling)} of {len(data.rotations)} rotations the axis wobbles, by up to "
            f"{np.degrees(max(wobbling)) * 3600.0:.0f}″ (one sigma)."
        )
    if data.poses is not None:
        told.append(_of_poses(outcome))
    sway = float(np.sqrt(task.noise["sway"]))
    if sway > 1e-6:
        told.append(
            f"Within a hold the pose sways by {1e3 * sway:.2g} mrad (one sigma, from its start to its end)."
        )
    told += restless_remarks(restless)
    if len(task.sections) > 1:
        told.append(
            f"The recording falls into {len(task.sections)} parts between which the gyros could not be followed; "
            "each has a heading of its own."
        )
    return told


def _of_unchecked(outcome: JointOutcome) -> list[str]:
    """What is said where holds alone give the accelerometers, or turns the gyros, and hardly anything checks them."""
    tests, n = outcome.balanced.tests, outcome.data.holds
    checks = sum(float(tests[kind].redundancy.sum()) for kind in ("force", "tilt", "pose") if kind in tests)
    if outcome.has_force and not outcome.data.rotations and checks < LEAST_CHECKS:
        return [f"Nothing checks the accelerometers: {n} holds fit whatever they say. Record more poses."]
    turns = tests.get("turn")
    if turns is None or outcome.data.rotations or not outcome.has_gyro or outcome.untold is not None:
        return []
    count = len(turns.place)
    if float(turns.redundancy.sum()) > LEAST_CHECKED * 3.0 * count:
        return []
    said = (
        f"The gyros' scale factors and axes rest on {count} turns, and nothing checks them: with samples missing in "
        "one of them they would be wrong and fit. Turn the unit to more poses, or use the gyros' biases alone."
    )
    return [said]


def _of_clock(outcome: JointOutcome) -> list[str]:
    """What a table or the Earth's rotation tell of the recording's clock, where they tell more than was believed."""
    task, solution = outcome.task, outcome.balanced.solution
    if not task.unknowns.is_free("clock") or task.prior is None:
        return []
    (at,), (place,) = task.unknowns.places(["clock"]), task.unknowns.layout.indices("clock")
    believed, sigma = task.prior.precision[place, place] ** -0.5, float(np.sqrt(solution.cofactor[at, at]))
    off = -float(task.unknowns["clock"][0])
    if sigma > 0.3 * believed or abs(off) < CLOCK_FALSE_ALARM * sigma:
        return []
    way = "fast" if off > 0.0 else "slow"
    said = (
        f"The clock of the samples runs {100.0 * abs(off):.2g} % {way} (± {100.0 * sigma:.1g} %) against what the "
        "table and the Earth turn by: the estimate takes it into account, and stamps stay as they are. What integrates "
        "by them has that error. If the clock is right, the table's rates are wrong by as much, and all gyro scale "
        "factors with them. State how well the rate is known (--rate)."
    )
    return [said]


def _of_poses(outcome: JointOutcome) -> str:
    poses = outcome.data.poses
    assert poses is not None
    solution = outcome.balanced.solution
    sigmas = np.sqrt(np.diag(solution.cofactor)[solution.unknowns.places(["fixture"])])
    told = ", ".join(
        f"{np.degrees(v):+.4f}° ± {np.degrees(s):.4f}° about {axis}"
        for v, s, axis in zip(outcome.task.unknowns["fixture"], sigmas, "xyz", strict=True)
    )
    headings = int(np.count_nonzero(poses.has_heading))
    return (
        f"{poses.hold.size} poses are believed, {headings} with their heading, to "
        f"{np.degrees(float(np.median(poses.sigma))):.2g}°; the sensors' axes lie in the fixture turned by {told}."
    )


# Up to so many times what the others sway by is not worth a word.
WORTH_A_WORD = 1.5
# Beyond so many times, or where they sway by less than a microradian, the others rest.
OTHERS_REST, NO_SWAY = 100.0, 1e-6  # -, rad
# More are counted, and the worst of them named.
MOST_NAMED = 5


def find_restless(data: Observed, noise: Noise, start: float) -> list[RestlessHold]:
    """Return the holds to which the adjustment gives a sway of their own, in their order.

    Parameters
    ----------
    data, noise : observations and variances of the settled estimate.
    start : s, the recording's first stamp, from which times are counted.
    """
    base, others = data.base, float(np.sqrt(noise["sway"]))
    return [
        RestlessHold(
            k,
            float(base.time[base.head[k, 0]]) - start,
            float(base.time[base.tail[k, 1] - 1]) - start,
            others * float(np.sqrt(times)),
            others,
        )
        for k, times in sorted(noise.factors.get("sway", {}).items())
        if times > WORTH_A_WORD**2
    ]


def restless_remarks(holds: Sequence[RestlessHold]) -> list[str]:
    """Return sentences about holds that sway, the worst named; none without them.

    Parameters
    ----------
    holds : of `find_restless`.
    """
    if not holds:
        return []
    worst = sorted(holds, key=lambda one: -one.sway)[:MOST_NAMED]
    named = "; ".join(_restless_words(one) for one in sorted(worst, key=lambda one: one.hold))
    more = f" (the worst of {len(holds)})" if len(holds) > len(worst) else ""
    subject, again = ("It counts", "it") if len(holds) == 1 else ("They count", "each of them")
    said = (
        f"Not all holds rest alike{more}: {named}. {subject} for less, the others no less for that: support the unit "
        f"firmly, let go of it, and record {again} again."
    )
    return [said]


def _restless_words(one: RestlessHold) -> str:
    """Return which hold it is, when, and by how much it sways."""
    times = one.sway / max(one.others, 1e-300)
    rest = times > OTHERS_REST or one.others < NO_SWAY
    beside = "where the others rest" if rest else f"{times:.2g} times as much as the others"
    return (
        f"hold {one.hold + 1} ({one.start:.1f} to {one.stop:.1f} s) sways by {1e3 * one.sway:.2g} mrad (one sigma), "
        f"{beside}"
    )
