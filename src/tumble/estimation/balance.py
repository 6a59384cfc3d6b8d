"""Variance components and gross errors: what the residuals say of the noise, and what is no noise.

For each kind of observation a variance is added until its residuals are as large as they should be; single
observations that scatter more than the others of their kind get a variance of their own, and so do whole chains (a
table that shakes). Before gross errors are gone the robust median of the residuals sets it, so that an outlier cannot
hide by inflating the noise; afterwards their mean square does. What chance explains is taken away again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from tumble.arrays import Series
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation.equations import Tests
from tumble.estimation.solve import TOLERANCE, Adjustable, Settled, solve
from tumble.records import dataclass

# Median of chi-square over its degrees of freedom, for 1 to 6 degrees.
MEDIAN_CHI_SQUARE = (0.4549, 1.3863, 2.3660, 3.3567, 4.3515, 5.3481)
# At most this share of a kind may be left out; beyond it, the rest is no majority to judge by.
LARGEST_SHARE_LEFT_OUT = 0.25
# At most this share of a kind is left out at a time, so that a large error does not take its neighbours along.
SHARE_AT_A_TIME = 0.05
# Chance that any good observation of a kind is left out.
FALSE_ALARM = 0.01
# Residuals this likely by chance ask for no added variance.
CHANCE = 0.025
# 3 % of a variance is far below what any number of observations can tell.
SETTLED = 0.03
# Every pass leaves out or widens something; what has not come to rest after so many goes back and forth.
PASSES, ROUNDS = 10, 8
# Sigmas that a step may have while variances are yet to be balanced: these move everything by more, and what the next
# step would be is a hundredth of it.
ROUGHLY = 0.5
# An observation scatters more than the others where chance would make any one do so this rarely; its own variance is
# told by a few numbers, so that a tenth of it is near enough.
RESTLESS_FALSE_ALARM, RESTLESS_SETTLED = 1e-3, 0.1
# How near to settled what all scatter by must be for one to be told apart.
NEAR = 0.3
# Where one step has made the residuals' square sum so many times as large, it has led into nowhere, from where no
# variance leads back.
ASTRAY = 1e5
# Less than this of a kind's redundancy is nothing to judge by.
LEAST_REDUNDANCY = 0.1


@dataclass(frozen=True)
class Outlier:
    """A group of conditions found to be no noise: `normalised` is in standard deviations."""

    kind: str
    group: int
    normalised: float


@dataclass
class Noise:
    """Variances beyond what is seen at rest.

    Attributes
    ----------
    added : component -> variance, SI².
    factors : component or kind -> place -> factor on its variance, of observations or chains that have their own.
    """

    added: dict[str, float]
    factors: dict[str, dict[int, float]] = field(default_factory=dict[str, dict[int, float]])

    def __getitem__(self, name: str) -> float:
        """Return a component's variance."""
        return self.added.get(name, 0.0)

    def set(self, name: str, variance: float) -> None:
        """Set a component; what has a variance of its own keeps it."""
        if self.factors.get(name):
            before = self[name]
            self.factors[name] = {k: max(f * before / variance, 1.0) for k, f in self.factors[name].items()}
        self.added[name] = variance

    def factor(self, name: str, place: int) -> float:
        """Return the factor of an observation or a chain; 1 if it has none of its own."""
        return self.factors.get(name, {}).get(place, 1.0)

    def of_each(self, name: str, places: np.ndarray) -> Series:
        """Return (places,) a component's variance of each observation."""
        return self[name] * np.array([self.factor(name, k) for k in places.tolist()])

    def raise_factor(self, name: str, place: int, by: float) -> None:
        """Multiply a factor."""
        self.factors.setdefault(name, {})[place] = self.factor(name, place) * by

    def copy(self) -> Noise:
        """Return noise of its own."""
        return Noise(dict(self.added), {name: dict(of) for name, of in self.factors.items()})


@dataclass(frozen=True)
class Component:
    """A variance that is added to one kind of observation.

    Attributes
    ----------
    name : in `Noise`.
    kind : the test that shows it.
    least : its smallest value while it is sought.
    nothing : returns the value that is none, by what is adjusted.
    witnesses : tests that decide whether chance explains it away; the first must be there.
    single : let observations that scatter more than the others have a variance of their own.
    """

    name: str
    kind: str
    least: float = 0.0
    nothing: Callable[[Any], float] = lambda _: 0.0
    witnesses: tuple[str, ...] = ()
    single: bool = False


@dataclass(frozen=True)
class ChainFactor:
    """A factor on the variance of one kind in one chain, raised where that chain scatters more.

    Attributes
    ----------
    kind : of the equations.
    taken : how many of the residuals its unknowns take.
    false_alarm : raised where chance does so more rarely; 0 for beyond `limit`.
    limit : mean square beyond which it is raised.
    """

    kind: str
    taken: int = 0
    false_alarm: float = 0.0
    limit: float = np.inf

    def excess(self, residual: np.ndarray) -> float:
        """Return the mean square of whitened residuals if it is too large, else 1."""
        from scipy.special import chdtrc

        mean = float(np.sum(residual**2)) / max(residual.size - self.taken, 1)
        if self.false_alarm > 0.0 and float(chdtrc(residual.size, residual.size * mean)) < self.false_alarm:
            return mean
        return mean if mean > self.limit else 1.0


@dataclass(frozen=True)
class Screen:
    """How gross errors of one test are looked for.

    Attributes
    ----------
    name : of the test.
    given : the noise is given and not found from the same residuals; the worst alone is left out, and factors that
        were raised to bear it go with it.
    """

    name: str
    given: bool = False


@runtime_checkable
class Balanceable(Adjustable, Protocol):
    """What can be balanced.

    Attributes
    ----------
    noise : what is added to the noise at rest.
    """

    noise: Noise

    @property
    def components(self) -> Sequence[Component]:
        """Variances that may be added."""
        ...

    @property
    def chain_factors(self) -> Sequence[ChainFactor]:
        """Factors that single chains may have, the first that is raised alone in a round."""
        ...

    @property
    def screens(self) -> Sequence[Screen]:
        """Tests by which gross errors are found."""
        ...

    def leave_out(self, outlier: Outlier) -> None:
        """Let an observation take no part."""
        ...


@dataclass
class Balanced:
    """A settled estimate, what was left out of it, and the tests of its residuals."""

    solution: Settled
    outliers: list[Outlier]
    tests: dict[str, Tests]


def balance(task: Balanceable) -> Balanced:
    """Adjust, add variance where residuals ask for it, and leave out what is no noise.

    Parameters
    ----------
    task : its noise and what takes part are changed.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    solution = solve(task, tolerance=ROUGHLY)
    outliers: list[Outlier] = []
    for _ in range(PASSES):
        solution = _settle(task, solution, robust=True)
        found = gross_errors(task.screens, solution.tests(), outliers)
        if not found:
            break
        for outlier in found:
            task.leave_out(outlier)
        outliers += found
        solution = solve(task, tolerance=ROUGHLY)
    solution = _settle(task, solution, robust=False)
    there = solution.tests().keys()
    for component in task.components:
        if (component.witnesses or (component.kind,))[0] in there:
            solution = _without_chance(task, component, solution)
    if solution.last_step > TOLERANCE:
        solution = solve(task)
    return Balanced(solution, outliers, solution.tests())


def _without_chance(task: Balanceable, component: Component, solution: Settled) -> Settled:
    """Take a component away that chance explains."""
    witnesses = component.witnesses or (component.kind,)
    nothing = component.nothing(task)
    if task.noise[component.name] <= nothing:
        return solution
    back = task.snapshot()
    task.noise.set(component.name, nothing)
    try:
        # One step is enough almost always: what it refuses need not settle.
        for once in (True, False):
            trial = solve(task, once=once, tolerance=ROUGHLY)
            tests = trial.tests(witnesses)
            if not all(_explained_by_chance(tests.get(witness)) for witness in witnesses):
                break
            if trial.last_step <= ROUGHLY:
                return trial
    except (ConvergenceError, ObservabilityError):
        pass
    back()
    return solution


def _settle(task: Balanceable, solution: Settled, *, robust: bool) -> Settled:
    """Move the variances until each kind's residuals are as large as they say; not `robust`, from a settled one."""
    back = task.snapshot()
    for number in range(ROUNDS):
        moved = _raise_chains(task, solution)
        noise = task.noise.copy()
        tests = solution.tests({component.kind for component in task.components})
        for component in task.components:
            if component.kind in tests:
                moved = _raise_component(noise, component, tests[component.kind], robust=robust) or moved
        if not moved:
            if number == 0 and not robust:
                return solution
            break
        task.noise = noise
        here, before = task.snapshot(), solution
        try:
            solution = solve(task, once=True)
            astray = solution.start_sum > ASTRAY * max(before.square_sum, before.redundancy)
        except (ConvergenceError, ObservabilityError):
            astray = True
        if astray:
            # With the weights that it had the last step was too far.
            back()
            task.noise = noise
            solution, here = solve(task), task.snapshot()
        back = here
    return solution if solution.last_step <= ROUGHLY else solve(task, tolerance=ROUGHLY)


def _raise_component(noise: Noise, component: Component, tests: Tests, *, robust: bool) -> bool:
    every, name = tests, component.name
    if component.single:
        own = noise.factors.get(name, {})
        tests = tests.where(np.array([k not in own for k in tests.place.tolist()]))
    checked = tests.degrees > 0
    if not np.any(checked):
        return False
    total = float(checked.sum() / np.sum(1.0 / tests.variance[checked]))
    before, moved = noise[name], False
    wanted = max(component.least, before + (noise_ratio(tests, robust=robust) - 1.0) * total)
    if abs(wanted - before) > SETTLED * total:
        noise.set(name, wanted)
        moved = True
    if component.single and abs(wanted - before) < NEAR * total:
        moved = _raise_single(noise, name, every) or moved
    return moved


def _raise_single(noise: Noise, name: str, tests: Tests) -> bool:
    """Give observations that scatter more than the others a variance of their own; tell whether any moved."""
    from scipy.special import chdtrc

    moved, limit = False, RESTLESS_FALSE_ALARM / max(tests.place.size, 1)
    factors = noise.factors.setdefault(name, {})
    for at, k in enumerate(tests.place.tolist()):
        square, redundancy = float(tests.square[at]), max(float(tests.redundancy[at]), 1e-12)
        own = factors.get(k)
        if own is None and float(chdtrc(redundancy, square)) >= limit:
            continue
        # What would be seen of it, and is seen, is its own variance and that of what sees it.
        more = (square / redundancy - 1.0) * float(tests.variance[at])
        wanted = max((own or 1.0) + more / noise[name], 1.0)
        moved = moved or abs(wanted - (own or 1.0)) > RESTLESS_SETTLED * wanted
        factors[k] = wanted
    return moved


def _raise_chains(task: Balanceable, solution: Settled) -> bool:
    """Raise the noise of chains that scatter more than at rest."""
    moved = False
    factors = task.chain_factors
    kinds = {factor.kind for factor in factors}
    for chain in solution.chains():
        of_kinds = chain.chain.terms_of(lambda equations: equations.kind in kinds)
        for factor in factors:
            terms = [t for t in of_kinds if t.equations.kind == factor.kind]
            if not terms:
                continue
            # By the residuals of this kind alone: what others leave over is no noise of it, and raising it for that
            # would never end.
            excess = factor.excess(np.concatenate([t.residual.ravel() for t in terms]))
            if excess == 1.0:
                continue
            task.noise.raise_factor(factor.kind, int(terms[0].equations.place[0]), excess)
            moved = moved or excess > 1.0 + SETTLED
            break
    return moved


def noise_ratio(tests: Tests, *, robust: bool) -> float:
    """Return how many times as large as their noise the squares of what is checked are, on average or by their median.

    Parameters
    ----------
    tests, robust : of a kind, and whether by the median.
    """
    checked = tests.degrees > 0
    statistic, degrees = tests.statistic[checked], tests.degrees[checked]
    if robust:
        medians = np.array(MEDIAN_CHI_SQUARE)[np.minimum(degrees, len(MEDIAN_CHI_SQUARE)) - 1]
        return float(np.median(statistic / medians))
    return float(statistic.sum() / degrees.sum())


def _explained_by_chance(tests: Tests | None) -> bool:
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


def gross_errors(screens: Sequence[Screen], tests: dict[str, Tests], before: list[Outlier]) -> list[Outlier]:
    """Return what exceeds its kind's limit, the worst and what is half as bad.

    Parameters
    ----------
    screens, tests, before : how it is looked for, by name, and what was found before.
    """
    found: list[Outlier] = []
    for screen in screens:
        told = tests.get(screen.name)
        at = np.zeros(0, dtype=int) if told is None else np.flatnonzero(told.degrees > 0)
        if told is None or not at.size:
            continue
        gone = sum(outlier.kind == screen.name for outlier in before)
        allowed = int(LARGEST_SHARE_LEFT_OUT * (at.size + gone)) - gone
        allowed = 1 if screen.given else min(allowed, max(1, int(SHARE_AT_A_TIME * at.size)))
        beyond = told.statistic[at] / _limits(screen, told, at)
        normalised = np.sqrt(told.statistic[at] / told.degrees[at])
        worst = [i for i in np.argsort(-beyond).tolist() if beyond[i] > 1.0]
        found += [
            Outlier(screen.name, int(told.place[at[i]]), float(normalised[i]))
            for i in worst[: max(allowed, 0)]
            if 2.0 * normalised[i] >= normalised[worst[0]]
        ]
    return found


def _limits(screen: Screen, tests: Tests, at: np.ndarray) -> Series:
    if screen.given:
        from scipy.special import chdtri

        single = FALSE_ALARM / max(tests.place.size, 1)
        return np.array([float(chdtri(int(d), single)) for d in tests.degrees[at].tolist()])
    whole = int(tests.degrees[at].sum())
    return np.array(
        [limit_of_largest(int(d), at.size, whole, FALSE_ALARM) for d in tests.degrees[at].tolist()]
    )


def limit_of_largest(degrees: int, groups: int, all_degrees: int, false_alarm: float) -> float:
    """Return the limit of the largest of `groups` statistics when their scale is estimated too.

    Parameters
    ----------
    degrees : of one statistic.
    groups : how many there are.
    all_degrees : of all of them together.
    false_alarm : chance that the largest is beyond the limit although nothing is wrong.
    """
    from scipy.special import fdtri

    single: float = (1.0 - false_alarm) ** (1.0 / groups)
    # The robust scale has 37 % of the efficiency of the mean square.
    scale_degrees = max(0.37 * (all_degrees - degrees), 1.0)
    return degrees * float(fdtri(degrees, scale_degrees, single))
