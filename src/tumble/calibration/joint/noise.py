"""What the joint estimator's residuals say of the noise, and what is no noise.

For each kind of observation (holds' specific force, their rate, their rest, turns) a variance is added until
the residuals are as large as they should be; observations beyond it are left out, a few at a time.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from tumble.calibration.joint.spins import LEAST_WOBBLE
from tumble.calibration.joint.system import JointProblem, JointSolution, JointState, Masks, solve_joint
from tumble.calibration.joint.terms import Extra
from tumble.calibration.joint.tests import KindTests, angle_redundancies, joint_tests
from tumble.calibration.joint.unknowns import force_matrix
from tumble.calibration.snooping import (
    CHANCE,
    LARGEST_SHARE_LEFT_OUT,
    MEDIAN_CHI_SQUARE,
    SETTLED,
    SHARE_AT_A_TIME,
    Outlier,
    limit_of_largest,
)
from tumble.errors import ConvergenceError

# An angle that is read ten times better than gyros turn is checked by them all the same.
CHECKED_ANGLE = 1e-4
LEAST_SWAY = 1e-16  # rad²: 10 nrad, far below what any unit sees
# A hundredth of what a hold's mean tells of its tilt is nothing, too; a smaller sway would weigh so much more than
# anything else that round-off takes the Earth rate's place.
SWAY_SHARE = 1e-4
# Where the search for the sway begins, and down to where round-off lets it go; below, the holds' parts decide.
START_SWAY, SMALLEST_SWAY = 1e-8, 1e-12  # rad²
# Of each component: its name in `Extra`, the kind of residual that shows it, and its least value.
_COMPONENTS = (
    ("sway", "rest", SMALLEST_SWAY),
    ("force", "force", 0.0),
    ("rate", "rate", 0.0),
    ("turn", "turn", 0.0),
    ("placement", "tilt", 0.0),
    ("placement", "pose", 0.0),
)
SWAY_SHOWN = ("parts", "swing")
PASSES, ROUNDS = 10, 8
# A hold sways more than the others where chance would make any one do so this rarely; its own sway is told by six
# numbers at most, so that a tenth of it is near enough.
RESTLESS_FALSE_ALARM, RESTLESS_SETTLED = 1e-3, 0.1
# How near to settled what all sway by must be for one to be told apart.
NEAR = 0.3
# Less than this of a kind's redundancy is nothing to judge by.
LEAST_REDUNDANCY = 0.1
# A table that shakes: its windows' noise is raised where chance does so more rarely than this.
SHAKING_FALSE_ALARM = 1e-3
# Mean square of an axis's residuals beyond which it wobbles more than was believed.
WOBBLES = 2.0


@dataclass(slots=True)
class BalancedJoint:
    """A settled joint estimate, what was left out of it, and the tests of its residuals."""

    solution: JointSolution
    outliers: list[Outlier]
    spin_noise: dict[int, float]
    tests: dict[str, KindTests]


def balance_joint(problem: JointProblem, state: JointState, *, false_alarm: float = 0.01) -> BalancedJoint:
    """Adjust, add variance where residuals ask for it, and leave out what is no noise.

    Parameters
    ----------
    problem : its `extra`, `masks` and `spin_noise` are changed in place.
    state : start values, moved.
    false_alarm : chance that any good observation of a kind is left out.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    problem.extra.sway = max(problem.extra.sway, START_SWAY)
    solution = solve_joint(problem, state)
    outliers: list[Outlier] = []
    for _ in range(PASSES):
        solution = _settle(problem, state, solution, robust=True)
        found = _gross_errors(joint_tests(problem, solution), outliers, false_alarm)
        found += _misread_angles(problem, solution, false_alarm)
        if not found:
            break
        for outlier in found:
            _leave_out(problem, outlier)
        outliers += found
        solution = solve_joint(problem, state)
    solution = _settle(problem, state, solution, robust=False)
    for name, kind, nothing in _COMPONENTS:
        # A component that chance explains is no component.
        kept = float(getattr(problem.extra, name))
        # Whether a hold is still, its parts and the gyros say: a sway that is all but nothing leaves no residual of its
        # own.
        witnesses, nothing = (
            (SWAY_SHOWN, still_sway(problem, state)) if kind == "rest" else ((kind,), nothing)
        )
        if kept > nothing and witnesses[0] in joint_tests(problem, solution):
            restless = problem.extra.restless
            _set_component(problem.extra, name, nothing)
            before = deepcopy(state)
            try:
                solution = solve_joint(problem, state)
                told = joint_tests(problem, solution)
                chance = all(_explained_by_chance(told.get(witness)) for witness in witnesses)
            except ConvergenceError:
                chance = False
            if not chance:
                setattr(problem.extra, name, kept)
                problem.extra.restless = restless
                state.unknowns, state.sections, state.spins = before.unknowns, before.sections, before.spins
                solution = solve_joint(problem, state)
    return BalancedJoint(solution, outliers, dict(problem.spin_noise), joint_tests(problem, solution))


def still_sway(problem: JointProblem, state: JointState) -> float:
    """Return the sway (rad²) that is none for these accelerometers.

    Parameters
    ----------
    problem, state : observations, and where the accelerometers' scale factors are.
    """
    base = problem.data.base
    scale = np.sum(force_matrix(state.unknowns) ** 2, axis=1)
    mean = np.min(base.force_sample_variance / scale) / max(float(np.max(base.hold_samples)), 1.0)
    return float(np.clip(SWAY_SHARE * mean / problem.site.gravity**2, LEAST_SWAY, SMALLEST_SWAY))


def _settle(
    problem: JointProblem, state: JointState, solution: JointSolution, *, robust: bool
) -> JointSolution:
    """Move the variances until each kind's residuals are as large as they say."""
    for _ in range(ROUNDS):
        moved = _raise_shaking(problem, solution)
        extra = replace(problem.extra, restless=dict(problem.extra.restless))
        told = joint_tests(problem, solution)
        for name, kind, least in _COMPONENTS:
            if kind not in told:
                continue
            tests = told[kind] if kind != "rest" else _of_quiet_holds(told[kind], extra)
            checked = tests.degrees > 0
            if not np.any(checked):
                continue
            total = float(checked.sum() / np.sum(1.0 / tests.variance[checked]))
            before = float(getattr(extra, name))
            wanted = max(least, before + (_ratio(tests, robust=robust) - 1.0) * total)
            if abs(wanted - before) > SETTLED * total:
                _set_component(extra, name, wanted)
                moved = True
            if kind == "rest" and abs(wanted - before) < NEAR * total:
                moved = _raise_restless(extra, told[kind]) or moved
        if not moved:
            break
        problem.extra = extra
        solution = solve_joint(problem, state, once=True)
    return solve_joint(problem, state)


def _set_component(extra: Extra, name: str, variance: float) -> None:
    """Set a component; holds that sway by themselves go on doing so by as much."""
    if name == "sway":
        extra.restless = {k: max(times * extra.sway / variance, 1.0) for k, times in extra.restless.items()}
    setattr(extra, name, variance)


def _of_quiet_holds(tests: KindTests, extra: Extra) -> KindTests:
    """Of the sway's tests, those of holds that sway as the others do."""
    quiet = np.array([k not in extra.restless for k in tests.place.tolist()])
    return tests.where(quiet)


def _raise_restless(extra: Extra, tests: KindTests) -> bool:
    """Give holds that sway more than the others do a sway of their own; tell whether any moved."""
    from scipy.special import chdtrc

    moved, limit = False, RESTLESS_FALSE_ALARM / max(tests.place.size, 1)
    for at, k in enumerate(tests.place.tolist()):
        square, redundancy = float(tests.square[at]), max(float(tests.redundancy[at]), 1e-12)
        own = extra.restless.get(k)
        if own is None and float(chdtrc(redundancy, square)) >= limit:
            continue
        # What would be seen of it, and is seen, is its own variance and that of what sees it.
        more = (square / redundancy - 1.0) * float(tests.variance[at])
        wanted = max((own or 1.0) + more / extra.sway, 1.0)
        moved = moved or abs(wanted - (own or 1.0)) > RESTLESS_SETTLED * wanted
        extra.restless[k] = wanted
    return moved


def _ratio(tests: KindTests, *, robust: bool) -> float:
    checked = tests.degrees > 0
    statistic, degrees = tests.statistic[checked], tests.degrees[checked]
    if robust:
        medians = np.array(MEDIAN_CHI_SQUARE)[np.minimum(degrees, len(MEDIAN_CHI_SQUARE)) - 1]
        return float(np.median(statistic / medians))
    return float(statistic.sum() / degrees.sum())


def _explained_by_chance(tests: KindTests | None) -> bool:
    """Whether a kind's sum of squares is as large as its noise makes it.

    A redundancy matrix R gives the sum of squares the mean ``tr R`` and the variance ``2 tr R²``: so many degrees of
    freedom. Turns that are checked a tenth each are as many checks, not a tenth of them.
    """
    from scipy.special import chdtrc

    if tests is None:
        return True
    mean = float(tests.redundancy.sum())
    degrees = mean**2 / max(float(tests.redundancy_square.sum()), 1e-300)
    if mean < LEAST_REDUNDANCY or degrees < 1.0:
        return True
    return float(chdtrc(degrees, degrees * float(tests.square.sum()) / mean)) > CHANCE


def _raise_shaking(problem: JointProblem, solution: JointSolution) -> bool:
    """Raise the noise of rotations whose windows scatter more than at rest."""
    from scipy.special import chdtrc

    moved = False
    for equations in solution.equations:
        for k, spin in equations.spins.items():
            wobble = problem.wobble.get(k, LEAST_WOBBLE)
            if spin.wobbled > WOBBLES:
                problem.wobble[k] = wobble * float(np.sqrt(spin.wobbled))
                moved = True
                continue
            # By the windows' own residuals alone: what the gyros leave over is no noise of the accelerometers, and
            # raising theirs for it would never end.
            count = spin.force_residual.size
            if float(chdtrc(count, count * spin.shaken)) < SHAKING_FALSE_ALARM:
                problem.spin_noise[k] = problem.spin_noise.get(k, 1.0) * spin.shaken
                moved = moved or spin.shaken > 1.0 + SETTLED
    return moved


def _gross_errors(tests: dict[str, KindTests], before: list[Outlier], false_alarm: float) -> list[Outlier]:
    """Return what exceeds its kind's limit, the worst and what is half as bad."""
    found: list[Outlier] = []
    for kind in ("force", "rate", "turn", "tilt", "pose"):
        if kind not in tests:
            continue
        told = tests[kind]
        at = np.flatnonzero(told.degrees > 0)
        if not at.size:
            continue
        gone = sum(outlier.kind == kind for outlier in before)
        allowed = int(LARGEST_SHARE_LEFT_OUT * (at.size + gone)) - gone
        allowed = min(allowed, max(1, int(SHARE_AT_A_TIME * at.size)))
        whole = int(told.degrees[at].sum())
        limits = np.array(
            [limit_of_largest(int(d), at.size, whole, false_alarm) for d in told.degrees[at].tolist()]
        )
        beyond = told.statistic[at] / limits
        normalised = np.sqrt(told.statistic[at] / told.degrees[at])
        worst = [i for i in np.argsort(-beyond).tolist() if beyond[i] > 1.0]
        found += [
            Outlier(kind, int(told.place[at[i]]), float(normalised[i]))
            for i in worst[: max(allowed, 0)]
            if 2.0 * normalised[i] >= normalised[worst[0]]
        ]
    return found


def _misread_angles(problem: JointProblem, solution: JointSolution, false_alarm: float) -> list[Outlier]:
    """Return the table's angle that the others contradict most, if one does."""
    from scipy.special import ndtri

    worst: Outlier | None = None
    count = sum(spin.angle is not None for spin in problem.data.spins.values())
    limit = -float(ndtri(0.5 * false_alarm / max(count, 1)))
    redundancies = angle_redundancies(problem, solution)
    for equations in solution.equations:
        for k, spin in equations.spins.items():
            left = max(redundancies.get(k, 0.0), 1e-9)
            sigma = max(problem.data.spins[k].angle_sigma, 1e-9)
            normalised = abs(spin.angle_residual) / (sigma * np.sqrt(left))
            if (
                left > CHECKED_ANGLE
                and normalised > limit
                and (worst is None or normalised > worst.normalised)
            ):
                worst = Outlier("angle", k, float(normalised))
    return [] if worst is None else [worst]


def _leave_out(problem: JointProblem, outlier: Outlier) -> None:
    if outlier.kind == "angle":
        problem.data.spins[outlier.group].angle = None
        # What was raised to bear it goes with it.
        problem.spin_noise.clear()
        problem.wobble.clear()
        return
    name = "pose" if outlier.kind == "tilt" else outlier.kind
    getattr(problem.masks, name)[outlier.group] = False


__all__ = ["CHECKED_ANGLE", "BalancedJoint", "Masks", "balance_joint", "still_sway"]
