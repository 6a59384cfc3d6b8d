"""Whether the data want the optional terms of both triads.

All are tried at once, and the least significant is dropped until every one left is wanted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Square, inverted
from tumble.calibration.checks.triad_agreement import LAG_LIMIT, TERM_FALSE_ALARM
from tumble.calibration.equations.adjustment import JointAdjustment, balance_recording
from tumble.calibration.equations.imu_unknowns import LAYOUT, name_plate, term_unknowns, terms_prior
from tumble.calibration.estimate import TermTest, wald_test
from tumble.calibration.outcome.settled import recording_influences
from tumble.calibration.prior import TOLD, together
from tumble.calibration.terms import TERMS
from tumble.counting import about
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Balanced, Unknowns, linearise, solve
from tumble.parameters import two_digits
from tumble.records import dataclass
from tumble.sensor import CURVES

# Of an adjustment that is balanced, and of its terms: recordings by hand took 8 to 45, half of them 13 to 17.
USUAL_STEPS = 16
# A term that chance explains so often, tested by one step from the adjustment without it, is needless: the noise was
# found without it, and is larger by what it would explain.
NEEDLESS = 0.1
OF_FORCE = tuple(term.name for term in TERMS.values() if term.shown_by == "force")
EVERYWHERE = tuple(term.name for term in TERMS.values() if term.shown_by != "table")
ON_TABLES = tuple(term.name for term in TERMS.values() if term.shown_by == "table")
# What the test of the time lag takes of it, each of the others gets an equal share of the rest; by hand these.
TERM_LIMIT = (TERM_FALSE_ALARM - LAG_LIMIT) / len(EVERYWHERE)
# Checks an unknown, from which on one step shows a term to be needless: noise that was found without a term that is
# wanted is larger, and fewer would make it so much larger that chance would explain the term.
CHECKS_EACH = 3
# No unit has so many times what a name plate allows of a term: 5 % of asymmetry, 3 °/s a g.
LARGEST_OF_A_UNIT = 5.0
# What a term that was not tried does to biases is said for so large a share of 1 g.
ILLUSTRATED = 1e-3
# Of the largest eigenvalue of an information matrix: below this it is the round-off of the others.
ROUND_OFF = 1e-13
# Share of the name plate's variance that is left of a direction that the motion determines.
LEFT = TOLD**2 / (1.0 + TOLD**2)


def unknowns_with(plain: np.ndarray, names: list[str]) -> np.ndarray:
    """Return the indices of plain unknowns and of some terms' together.

    Parameters
    ----------
    plain, names : indices, and names of terms.
    """
    return np.sort(np.concatenate([plain, *(term_unknowns(name) for name in names)]))


def offered_terms(*, has_gyro: bool, has_force: bool = True) -> list[str]:
    """Return the terms that any recording of these triads is tried with."""
    has = {"force": has_force, "gyro": has_gyro}
    return [name for name in EVERYWHERE if has.get(TERMS[name].shown_by, True)]


def term_limits(names: list[str]) -> dict[str, float]:
    """Return how rarely chance may keep each term.

    Parameters
    ----------
    names : of all that are tried.
    """
    others = [name for name in names if name != "time_lag"]
    share = (TERM_FALSE_ALARM - LAG_LIMIT) / max(len(others), len(EVERYWHERE))
    return {**dict.fromkeys(others, share), "time_lag": LAG_LIMIT}


@dataclass
class TermSearch:
    """The search for the terms that the data want, from where an adjustment has settled without them.

    Attributes
    ----------
    task : that adjustment.
    fresh : the same with its variances and what takes part as they were before anything was balanced: what looks like a
        bad turn without a term may be the term.
    plain : indices of the unknowns without any term.
    sought : terms that the recording was made for.
    tests : the last one of each term.
    untried : the terms that were not tried.
    """

    task: JointAdjustment
    fresh: JointAdjustment
    plain: np.ndarray
    sought: frozenset[str]
    tests: dict[str, TermTest] = field(default_factory=dict[str, TermTest])
    untried: list[str] = field(default_factory=list[str])

    def settled(
        self, base: Balanced, of_table: list[str], say: Callable[[str], None]
    ) -> tuple[JointAdjustment, Balanced]:
        """Try all terms at once, drop the least significant until every one left is wanted.

        Parameters
        ----------
        base : the adjustment as it has settled.
        of_table : terms of a table's that are offered beside those of all recordings.
        say : says what is done.
        """
        say("optional terms")
        u = self.task.unknowns
        offered = offered_terms(has_force=u.is_free("force.bias"), has_gyro=u.is_free("gyro.bias")) + of_table
        names: list[str] = self._determined(offered)
        limits = term_limits(offered)
        self.untried = [name for name in offered if name not in names]
        with about(USUAL_STEPS):
            without = self._without(base)
            names = self._not_needless(*without, names, limits)
        while names:
            say(f"optional terms: {len(names)} of {len(offered)} in question")
            trial = self._trial(unknowns_with(self.plain, names))
            try:
                with about(USUAL_STEPS):
                    balanced = balance_recording(trial)
            except (ObservabilityError, ConvergenceError):
                # Where the equations are bent, what is determined to first order may not be.
                self.untried.append(max(names, key=gives_way))
                names = [name for name in names if name != self.untried[-1]]
                # An earlier trial, with more terms, may have wanted it.
                self.tests.pop(self.untried[-1], None)
                continue
            wanted = wanted_terms(trial, balanced, names, self.tests, limits, self.sought)
            if wanted == names:
                weakest = self._unneeded(without[1], balanced, names)
                if weakest is None:
                    return trial, balanced
                self.tests[weakest] = replace(self.tests[weakest], kept=False)
                wanted = [name for name in names if name != weakest]
            names = wanted
        return without

    def _from_before(self, free: np.ndarray) -> JointAdjustment:
        """A copy from where the adjustment is, with noise and observations as they were before it was balanced."""
        fresh = self.fresh.copy()
        return replace(self.task.copy(free), noise=fresh.noise, taking_part=fresh.taking_part)

    def _trial(self, free: np.ndarray) -> JointAdjustment:
        """The same, with what is believed of the terms."""
        trial = self._from_before(free)
        trial.prior = together(trial.prior, terms_prior(trial.unknowns))
        return trial

    def _determined(self, of: list[str]) -> list[str]:
        """The terms that the recording determines, by the information where the adjustment without them has settled.

        All that was recorded counts: a turn may have been left out for the very term that nothing else shows. The noise
        is what was found without terms: with that of rest an asymmetry would be determined that is of a plate that
        leans.
        """
        trial = self._from_before(unknowns_with(self.plain, of))
        trial.noise.added.update(self.task.noise.added)
        return determined_terms(linearise(trial)[1], trial.unknowns, self.plain, of)

    def _without(self, base: Balanced) -> tuple[JointAdjustment, Balanced]:
        """The adjustment without any term: what it is compared with, and what is left if none is wanted."""
        if base.solution.unknowns.free.size == self.plain.size:
            return self.task, base
        alone = self._trial(self.plain)
        try:
            return alone, balance_recording(alone)
        except (ObservabilityError, ConvergenceError):
            # Terms that the start had may be what it settles with.
            again = self._trial(base.solution.unknowns.free)
            return again, balance_recording(again)

    def _not_needless(
        self, task: JointAdjustment, balanced: Balanced, names: list[str], limits: dict[str, float]
    ) -> list[str]:
        """The terms that may be wanted, by one step from the adjustment without any.

        Where something was left out or weighed less for want of a term, one step does not show it: all may be.
        """
        if not names or balanced.outliers or any(task.noise.factors.values()):
            return names
        trial = task.copy(unknowns_with(self.plain, names))
        trial.prior = together(trial.prior, terms_prior(trial.unknowns))
        try:
            solution = solve(trial, once=True)
        except (ObservabilityError, ConvergenceError):
            return names
        found = dict[str, TermTest]()
        left = possible_terms(trial, Balanced(solution, [], solution.tests()), names, found, self.sought)
        self.tests |= {name: replace(found[name], limit=limits[name]) for name in names if name not in left}
        return left

    def _unneeded(self, without: Balanced, balanced: Balanced, names: list[str]) -> str | None:
        """The first term without which everything that was recorded is predicted better; None if there is none.

        Holds are not predicted better by what turns tell of accelerometers, and turns are. `without` has no term.
        """
        worse = [n for n in worse_predicted(without, balanced, names) if n not in self.sought]
        for name in sorted(worse, key=lambda n: -self.tests[n].probability):
            free = np.setdiff1d(balanced.solution.unknowns.free, term_unknowns(name))
            free, other = np.union1d(free, self.plain), without
            if not np.array_equal(free, without.solution.unknowns.free):
                if free.size == self.plain.size:
                    # Without any term nothing settled: `without` would be that.
                    continue
                try:
                    other = balance_recording(self._trial(free))
                except (ObservabilityError, ConvergenceError):
                    continue
            if surprise_added(other, balanced, ("force", "rate", "turn")) > 0.0:
                return name
        return None


def wanted_terms(
    task: JointAdjustment,
    balanced: Balanced,
    names: list[str],
    tests: dict[str, TermTest],
    limits: dict[str, float],
    sought: frozenset[str] = frozenset(),
) -> list[str]:
    """Drop the least significant term until every one left is wanted; of each, its last test goes into `tests`.

    They are wanted only if they are whether or not neighbouring holds and rotations share what they scatter by: what a
    term of the second order would explain, a slow wander explains as well.

    Parameters
    ----------
    task, balanced : with all terms free, and settled.
    names : of the terms.
    tests : are added to.
    limits : how rarely chance may keep each.
    sought : terms that the recording was made for, which stay whatever their test says.
    """
    solution, u = balanced.solution, task.unknowns
    plate = name_plate(u)
    spread = recording_influences(task, solution).covariance

    def test(name: str, values: Series, blocks: list[Square]) -> tuple[float, bool]:
        degrees, excess = _checks_of(name, task, balanced)
        own = plate[term_unknowns(name)]
        each = [term_test(name, values, excess * block, degrees, limits[name]) for block in blocks]
        tests[name] = max(each, key=lambda one: one.probability)
        if name in EVERYWHERE and np.any(np.abs(values) > LARGEST_OF_A_UNIT * own):
            # Something else is wrong with the recording, and the term takes it up.
            tests[name] = replace(tests[name], kept=False)
            return 2.0, False
        if name in sought:
            # Left out where chance could explain it, all that it stands for would be in the biases, unsaid.
            tests[name] = replace(tests[name], kept=True)
            return -1.0, True
        return tests[name].probability, tests[name].kept

    places = {name: u.places(term_unknowns(name)) for name in names}
    return keep_wanted(u.values[u.free], [solution.cofactor, spread], places, test)


def possible_terms(
    task: JointAdjustment,
    balanced: Balanced,
    names: list[str],
    tests: dict[str, TermTest],
    sought: frozenset[str] = frozenset(),
) -> list[str]:
    """Return the terms that one step from an adjustment without any does not show to be needless.

    Parameters
    ----------
    task, balanced : with all terms free, after one step.
    names, tests, sought : as for `wanted_terms`.
    """
    if any(_checks_of(name, task, balanced)[0] < CHECKS_EACH * term_unknowns(name).size for name in names):
        return names
    left = wanted_terms(task, balanced, names, tests, dict.fromkeys(names, NEEDLESS), sought)
    # Larger than any unit's by one step: let it settle.
    implausible = any(tests[name].probability < NEEDLESS for name in names if name not in left)
    return names if implausible else left


def worse_predicted(base: Balanced, trial: Balanced, names: list[str]) -> list[str]:
    """Return the terms of a kind whose holds or turns are predicted worse with them than without.

    Each hold and each turn is predicted from all the others, by the estimate without it, with the uncertainty of that
    prediction: a few holds that alone tell a term are predicted badly without them, and it is known how badly. Those
    that one of both leaves out are not compared.

    Parameters
    ----------
    base, trial : without and with the terms.
    names : of the terms.
    """
    worse: list[str] = []
    for shown_by, kind in (("force", "force"), ("gyro", "turn")):
        of_kind = [name for name in names if TERMS[name].shown_by == shown_by]
        if of_kind and surprise_added(base, trial, (kind,)) > 0.0:
            worse += of_kind
    return worse


def surprise_added(base: Balanced, trial: Balanced, kinds: Sequence[str]) -> float:
    """Return by how much observations of some kinds surprise a trial more that was made without each of them.

    Parameters
    ----------
    base, trial : two estimates of the same recording; what either leaves out, or checks in fewer directions than the
        other, does not count.
    kinds : of observations.
    """
    more = 0.0
    for kind in kinds:
        before, after = base.tests.get(kind), trial.tests.get(kind)
        if before is None or after is None:
            continue
        _, here, there = np.intersect1d(before.place, after.place, return_indices=True)
        alike = before.degrees[here] == after.degrees[there]
        more += float(np.sum(after.surprise[there[alike]]) - np.sum(before.surprise[here[alike]]))
    return more


def implausible_words(tests: list[TermTest]) -> list[str]:
    """Return a sentence about terms that would be significant but larger than any unit has them; none without.

    Parameters
    ----------
    tests : of all terms.
    """
    found = {t.name for t in tests if not t.kept and t.probability < t.limit}
    words = [TERMS[name].words for name in EVERYWHERE if name in found]
    if not words:
        return []
    said = (
        f"The data would be explained by {' and '.join(words)} that are larger than any unit's, or that predict holds "
        "and turns worse than without them: they were not kept. Look for another cause: a mount that gives, a wrong "
        "unit or rate, a clipped sensor."
    )
    return [said]


def _checks_of(name: str, task: JointAdjustment, balanced: Balanced) -> tuple[int, float]:
    """Return what determines the noise that a term is tested against: its degrees of freedom, and its excess over that.

    By hand that is what holds or turns show of their own kind: some sixty checks of forty holds tell by how much
    accelerometers wander from one to the next, and the hundreds of others know nothing of it.
    """
    told = balanced.tests
    kinds = ("rate", "turn") if TERMS[name].shown_by == "gyro" else ("force",)
    taken = [told[kind] for kind in kinds if kind in told]
    mean = sum(float(tests.redundancy.sum()) for tests in taken)
    if task.rotations or mean < 1.0:
        # The windows of a table are thousands, and their noise is known.
        return balanced.solution.redundancy, 1.0
    degrees = mean**2 / sum(float(tests.redundancy_square.sum()) for tests in taken)
    excess = sum(float(tests.square.sum()) for tests in taken) / mean
    return max(int(degrees), 1), max(excess, 1.0)


def gives_way(name: str) -> int:
    """Return the larger a number the sooner a term is not tried, of terms that look alike in what was recorded."""
    return TERMS[name].gives_way


def term_test(name: str, estimates: Series, covariance: Square, freedom: int, limit: float) -> TermTest:
    """Test a term against zero, one that is told in part in what the motion determines of it; see `wald_test`.

    Parameters
    ----------
    name, estimates, covariance, freedom, limit : as there; of a term that is told in part with its prior taken in.
    """
    if not TERMS[name].in_part:
        return wald_test(name, estimates, covariance, freedom, limit)
    plate = float(np.max(TERMS[name].plate(np.ones(3))))  # in SI
    values, vectors = np.linalg.eigh(covariance)
    told = vectors[:, values < max(LEFT * plate**2, 1.001 * float(values[0]))]
    return wald_test(name, told.T @ estimates, told.T @ covariance @ told, freedom, limit)


def determined_terms(normal: Square, u: Unknowns, plain: np.ndarray, names: list[str]) -> list[str]:
    """Return the terms that what was recorded determines, all of them together.

    Parameters
    ----------
    normal, u : information of the free unknowns, all terms among them.
    plain : indices of the unknowns that are free without any term.
    names : of the terms.

    Notes
    -----
    Faces up and down show ``a |u|`` and ``q u²`` as one number: both together would be determined by remainders of
    second order, and be as wrong as these are. A term is determined if its standard uncertainty is below half of what
    a unit may have of it, as of the plain unknowns.
    """
    sizes, left = name_plate(u), list(names)
    while left:
        at = u.places(unknowns_with(plain, left))
        free, own = u.free[at], sizes[u.free[at]]
        share = _left_open(normal[np.ix_(at, at)] * np.outer(own, own))
        untold = [name for name in left if not _is_determined(name, share, free)]
        if not untold:
            break
        left.remove(max(untold, key=gives_way))
    return left


def _left_open(information: Square) -> Square:
    """What is left of the name plate's covariance, in its sizes; information that is round-off counts for none."""
    values, vectors = np.linalg.eigh(information)
    values = np.where(values > ROUND_OFF * values[-1], values, 0.0)
    return np.asarray((vectors / (values + 1.0)) @ vectors.T, dtype=np.float64)


def _is_determined(name: str, share: Square, free: np.ndarray) -> bool:
    """Whether little is left of the name plate's variance in every direction of a term; of one told in part in any."""
    at = np.flatnonzero(np.isin(free, term_unknowns(name)))
    shares = np.linalg.eigvalsh(share[np.ix_(at, at)])
    return bool(shares[0 if TERMS[name].in_part else -1] < LEFT)


def untried_words(names: list[str], task: JointAdjustment) -> list[str]:
    """Return a sentence about terms that were not tried because nothing determines them; none without.

    Parameters
    ----------
    names : of the terms; those that only tables show are not missed.
    task : the settled adjustment without them.
    """
    names = [name for name in EVERYWHERE if name in names]
    words = [TERMS[name].words for name in names]
    if not words:
        return []
    last = f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0]
    said = (
        f"{last[0].upper()}{last[1:]}: what was recorded does not determine them, or not apart from other terms: they "
        "were not tried. More poses would, among them some with no axis upright or level."
    )
    moved = max((_moved_bias(task, name) for name in names if name in OF_FORCE), default=0.0)
    if moved > 0.0:
        said += (
            f" No uncertainty has them: {1e2 * ILLUSTRATED:g} % at 1 g would put an accelerometer's bias off by up to "
            f"{two_digits(1e3 * moved)} mm/s²."
        )
    return [said]


def _moved_bias(task: JointAdjustment, name: str) -> float:
    """By how much a term of the accelerometers that is `ILLUSTRATED` at 1 g moves a bias at most, m/s²."""
    trial, plain = task.copy(), task.unknowns.free
    trial.unknowns = task.unknowns.with_free(unknowns_with(plain, [name]))
    normal, u = linearise(trial)[1], trial.unknowns
    scale = np.abs(u["force.scale"])
    size = ILLUSTRATED / (scale * task.site.gravity) ** CURVES[TERMS[name].curve].power
    own, others = u.places(term_unknowns(name)), u.places(plain)
    shift = np.linalg.lstsq(normal[np.ix_(others, others)], normal[np.ix_(others, own)] * size)[0]
    return float(np.max(np.abs(shift[np.searchsorted(plain, LAYOUT.indices("force.bias"))]) / scale[:, None]))


def seen_table_terms(normal: Square, u: Unknowns) -> list[str]:
    """Return the terms that a table's rotations determine, or any part of those that are told in part.

    Parameters
    ----------
    normal, u : information of the free unknowns, all terms among them.
    """
    sizes = name_plate(u)[u.free]
    left = _left_open(normal * np.outer(sizes, sizes))
    return [name for name in ON_TABLES if _is_determined(name, left, u.free)]


def keep_wanted(
    values: Series,
    covariances: Sequence[Square],
    places: Mapping[str, np.ndarray],
    test: Callable[[str, Series, list[Square]], tuple[float, bool]],
) -> list[str]:
    """Return the terms that are wanted.

    What the others would be without a term follows from the covariance: nothing is adjusted anew for it.

    Parameters
    ----------
    values : (free,) of all free unknowns, the terms' among them.
    covariances : (free, free) of them; the first is the adjustment's, the others what it might be besides.
    places : term -> where its unknowns stand.
    test : of a term's name, its values and its own part of each covariance, the probability of chance, and whether
        the term is kept.
    """
    left, values, covariances = list(places), values.copy(), [c.copy() for c in covariances]
    while left:
        found = {
            name: test(
                name, values[places[name]], [c[np.ix_(places[name], places[name])] for c in covariances]
            )
            for name in left
        }
        weakest = max(left, key=lambda name: found[name][0])
        if found[weakest][1]:
            break
        left.remove(weakest)
        gone = places[weakest]
        share = covariances[0][:, gone] @ inverted(covariances[0][np.ix_(gone, gone)])
        values = values - share @ values[gone]
        without = np.eye(values.size)
        without[:, gone] -= share
        covariances = [without @ c @ without.T for c in covariances]
    return left
