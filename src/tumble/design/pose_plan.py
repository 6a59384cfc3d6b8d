"""A test of poses at rest, searched: which, for how long, and in which order.

What is made small is the mean variance of the nine parameters that norms at rest tell. Poses are visited near one
another, and so that a bias that wanders does least harm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, Vectors, inverted
from tumble.attitude import twenty_six_directions
from tumble.calibration import SAME_POSE, describe_mending, describe_untold, norm_rows
from tumble.counting import counted
from tumble.design.hold_noise import (
    hold_covariance,
    hold_times,
    predict_covariance,
    wander_sigma,
    white_density,
)
from tumble.design.joint_information import JointInformation
from tumble.design.joint_plan import PlanTask
from tumble.errors import ObservabilityError, UsageError
from tumble.protocol import NINE
from tumble.records import dataclass
from tumble.simulation import TriadNoise
from tumble.units import STANDARD_GRAVITY

# Beside the information, so that a singular start is bad instead of an error; of the mean of its diagonal.
RIDGE = 1e-10
# Of the starts, the shares of visits that are drawn, in turn; the rest of a start is what determines most.
DRAWN = (1.0, 1.0, 0.5)


def find_visits(
    rows: Table,
    count: int,
    rng: np.random.Generator,
    *,
    known: Square | None = None,
    starts: int = 30,
    also: Sequence[Sequence[int]] = (),
) -> list[int]:
    """Return which poses to visit, ascending; one may be visited more than once.

    Parameters
    ----------
    rows : (poses, p) what a visit observes, over its standard uncertainty.
    count : visits.
    rng : draws the starts.
    known : (p, p) information that is there already.
    starts : the best end of so many is returned.
    also : sets of `count` poses to start from, too, so that the visits are no worse than they are.
    """
    base = np.zeros((rows.shape[1], rows.shape[1])) if known is None else known
    begun = [_start(rows, base, count, rng, DRAWN[k % len(DRAWN)]) for k in range(starts)]
    begun += [np.array(one) for one in also]
    ends = [_exchanged(rows, base, start) for start in begun]
    return sorted(min(ends, key=lambda end: end[0])[1].tolist())


def _start(rows: Table, base: Square, count: int, rng: np.random.Generator, drawn: float) -> np.ndarray:
    """Draw a share of the visits, and add those that tell most of what is least known."""
    first = rng.choice(len(rows), size=min(max(int(drawn * count), 1), len(rows)), replace=False)
    chosen = first.tolist()
    total = base + rows[first].T @ rows[first]
    ridge = 1e-4 * float(np.mean(rows**2)) * np.eye(rows.shape[1])
    while len(chosen) < count:
        covariance = inverted(total + ridge)
        new = int(np.argmax(np.sum((rows @ covariance) ** 2, axis=1)))
        chosen.append(new)
        total = total + np.outer(rows[new], rows[new])
    return np.array(chosen)


def _exchanged(rows: Table, base: Square, start: np.ndarray) -> tuple[float, np.ndarray]:
    """Exchange one visit for another as long as that helps; return the mean variance and the visits."""
    chosen = start.copy()
    value, improved = _mean_variance(_covariance(rows, base, chosen)), True
    while improved:
        improved = False
        for place in range(chosen.size):
            tried = _tried(rows, _covariance(rows, base, chosen), int(chosen[place]))
            tried = np.where(np.isfinite(tried) & (tried > 0.0), tried, np.inf)
            best = int(np.argmin(tried))
            if tried[best] < value * (1.0 - 1e-7):
                before = chosen[place]
                chosen[place] = best
                now = _mean_variance(_covariance(rows, base, chosen))
                if now < value * (1.0 - 1e-9):
                    value, improved = now, True
                else:  # an update of a nearly singular set, whose digits were lost
                    chosen[place] = before
    return value, chosen


def _mean_variance(covariance: Square) -> float:
    return float(np.mean(np.diag(covariance)))


def _covariance(rows: Table, base: Square, chosen: np.ndarray) -> Square:
    total = rows[chosen].T @ rows[chosen] + base
    return inverted(total + RIDGE * float(np.mean(np.diag(total))) * np.eye(total.shape[0]))


def _tried(rows: Table, covariance: Square, out: int) -> AnyArray:
    """Mean variances (poses,) with each pose in, then one visit out: never singular on the way."""
    added = _updated(np.broadcast_to(covariance, (len(rows), *covariance.shape)), rows, 1.0)
    changed = _updated(added, np.broadcast_to(rows[out], rows.shape), -1.0)
    return np.asarray(np.diagonal(changed, axis1=1, axis2=2).mean(axis=1), dtype=np.float64)


def _updated(covariance: AnyArray, rows: Table, sign: float) -> AnyArray:
    """Covariances (n, p, p) after the observations `rows` (n, p) came or went (Sherman and Morrison)."""
    across = np.einsum("nij,nj->ni", covariance, rows)
    inner = 1.0 + sign * np.einsum("ni,ni->n", rows, across)
    inner = np.where(np.abs(inner) < 1e-12, 1e-12, inner)
    return covariance - sign * across[:, :, None] * across[:, None, :] / inner[:, None, None]


# Unknowns of `norm_rows` in the order scale, misalignment yz, zy, zx, bias; its angles have the other sign.
_ORDER = (3, 4, 5, 6, 8, 7, 0, 1, 2)
PARAMETERS = (
    *(f"scale factor {axis}" for axis in "xyz"),
    *(f"misalignment {angle}" for angle in ("yz", "zy", "zx")),
    *(f"bias {axis}" for axis in "xyz"),
)
"""What norms of poses tell: relative scale factors, angles in rad, biases over gravity."""
# Where they stand among the thirty parameters; angles have the other sign.
NORMS = np.array([3, 4, 5, 6, 8, 7, 0, 1, 2])
NORM_GROUPS = {"scale": (0, 1, 2), "misalignment": (3, 4, 5), "bias": (6, 7, 8)}
# A hold of less is not found as rest, s.
LEAST_DWELL = 4.0
# Of plans of the same time the one with the fewest poses that is so close to the best is taken.
FEWER_POSES = 0.05
# Numbers of poses that are tried where the time is fixed.
LADDER = (6, 7, 8, 9, 10, 12, 14, 16, 18, 22, 26, 32, 40, 52)
STARTS = 20
# Sweeps of swaps.
MOST_SWEEPS = 3
NAME = "A-optimal of the 26 directions"
"""Of a plan that was searched: the mean of its variances is least."""


def pose_rows(directions: Vectors) -> Table:
    """Return (poses, 9): what a pose's norm, in gravity, says of each of `PARAMETERS`.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    """
    rows = norm_rows(directions)[:, _ORDER]
    rows[:, 3:6] *= -1.0
    return rows


@dataclass(frozen=True)
class PoseTask:
    """What a plan is made for.

    Attributes
    ----------
    noise, rate : of the accelerometers, and Hz.
    turn : s from one pose to the next.
    gravity : m/s².
    known : (9, 9) information about `PARAMETERS` that is there already, or None.
    wanted : indices of the parameters whose mean variance is made small; the others are nuisances.
    placement : over gravity, one sigma of what placing the unit adds to each hold by itself.
    shortening : relative, by which tilts make all scale factors too small on the average, where poses are believed.
    """

    noise: TriadNoise
    rate: float = 100.0
    turn: float = 3.0
    gravity: float = STANDARD_GRAVITY
    known: Square | None = None
    wanted: np.ndarray = field(default_factory=lambda: np.arange(len(PARAMETERS)))
    placement: float = 0.0
    shortening: float = 0.0

    def value(self, covariance: Square) -> float:
        """Return the mean of the wanted variances, of relative, rad, over gravity as they are.

        Parameters
        ----------
        covariance : (9, 9).
        """
        return float(np.mean(np.diag(covariance)[self.wanted]))

    def dwell_sigma(self, dwell: float, span: float) -> float:
        """Return the standard uncertainty of a hold's norm over gravity, wander within the test included.

        Parameters
        ----------
        dwell, span : s, of the hold and of the whole test.
        """
        white = white_density(self.noise, self.rate) ** 2 / dwell
        wander = wander_sigma(self.noise, dwell, span) ** 2
        return float(np.sqrt((white + wander) / self.gravity**2 + self.placement**2))

    def span(self, dwells: Series) -> float:
        """Return the seconds of a test with these dwells, turns included."""
        return float(np.sum(dwells)) + self.turn * (len(dwells) - 1)

    def covariance(self, directions: Vectors, dwells: Series) -> Square:
        """Return the covariance (9, 9) that a calibration of these holds will have, one after the other.

        Parameters
        ----------
        directions : (n, 3) unit vectors up, in the order of the test.
        dwells : (n,) s.

        Raises
        ------
        ObservabilityError
            If they do not tell what is wanted.
        """
        require_seen(directions, self.wanted, self.known)
        noise = hold_covariance(hold_times(dwells, self.turn), self.noise, self.rate) / self.gravity**2
        noise = noise + self.placement**2 * np.eye(len(dwells))
        # What is not wanted and not told stands in the way of no inverse.
        rows = pose_rows(directions)
        ridge = 1e-10 / float(np.median(np.diag(noise))) * np.eye(len(PARAMETERS))
        known = ridge if self.known is None else self.known + ridge
        covariance = predict_covariance(rows, directions, noise, known=known)
        covariance[:3, :3] += self.shortening**2
        return covariance


@dataclass(frozen=True)
class PosePlan:
    """Poses in order, with what they will be worth.

    Attributes
    ----------
    name : of the scheme.
    directions : (n, 3) unit vectors up.
    dwells : (n,) s.
    turn : s between two.
    covariance : (9, 9) over `PARAMETERS`: relative, rad, over gravity.
    value : the mean of the wanted variances.
    """

    name: str
    directions: Vectors
    dwells: Series
    turn: float
    covariance: Square
    value: float

    @property
    def duration(self) -> float:
        """Seconds, turns included."""
        return float(np.sum(self.dwells)) + self.turn * (len(self.dwells) - 1)

    @property
    def sigmas(self) -> Series:
        """(9,) standard uncertainties of `PARAMETERS`."""
        return np.sqrt(np.diag(self.covariance))


def known_norms(task: PlanTask, gravity: float) -> Square:
    """Return the information (9, 9) about `PARAMETERS` of what is there already, and of a sheet that is believed.

    Parameters
    ----------
    task : what is planned.
    gravity : m/s².
    """
    nothing = JointInformation(np.zeros((NORMS.size, NORMS.size)))
    scale = np.repeat([1.0, -1.0, 1.0 / gravity], 3)
    covariance = task.covariance(nothing)[np.ix_(NORMS, NORMS)] * np.outer(scale, scale)
    return inverted(np.ascontiguousarray(covariance))


def require_seen(directions: Vectors, wanted: np.ndarray, known: Square | None = None) -> None:
    """Refuse poses that do not tell what is wanted, in words.

    Parameters
    ----------
    directions : (n, 3) unit vectors up.
    wanted : indices of the parameters that are to be determined.
    known : (9, 9) information that is there already.

    Raises
    ------
    ObservabilityError
        With the combination that no pose determines, and the poses that would.
    """
    rows = pose_rows(directions)
    total = rows.T @ rows
    size = 1.0 if known is None else max(float(np.max(np.diag(known))), 1e-300)
    if known is not None:
        total = total + known / size
    # A wanted parameter is told if no direction that the poses leave open moves it.
    values, vectors = np.linalg.eigh(total)
    open_ones = vectors[:, values < 1.0 / 30.0**2 * (1.0 if known is None else 1e-6)]
    if open_ones.size == 0 or not np.any(np.abs(open_ones[wanted]) > 0.02):
        return
    head = f"The {len(directions)} poses"
    said = describe_untold(directions) or "do not determine what is asked for"
    if len(directions) == 1:
        head, said = head.replace("poses", "pose"), said.replace("do not", "does not", 1)
    add = describe_mending(directions)
    raise ObservabilityError(f"{head} {said}. " + (f"Add {add}." if add else "Allow more poses."))


def plan_of(name: str, task: PoseTask, directions: Vectors, dwells: Series) -> PosePlan:
    """Return what poses in this order will be worth.

    Parameters
    ----------
    name, task, directions, dwells : as of `PosePlan` and `PoseTask`.

    Raises
    ------
    ObservabilityError
        If they do not tell what is wanted.
    """
    covariance = task.covariance(directions, dwells)
    value = task.value(covariance)
    return PosePlan(name, directions, dwells, task.turn, covariance, value)


def plan_poses(task: PoseTask, count: int, dwell: float, rng: np.random.Generator) -> PosePlan:
    """Return the best plan of so many of the 26 directions, alike in time.

    Parameters
    ----------
    task : what for.
    count : poses; one may be visited again where that is better than another.
    dwell : s of each.
    rng : draws the starts of the search.

    Raises
    ------
    ObservabilityError
        If so many poses do not tell what is wanted.
    """
    least = len(PARAMETERS)
    if task.known is None and count < least:
        raise ObservabilityError(
            f"{count} poses determine {count} numbers, and {least} parameters are asked for: allow {least} poses or "
            "more."
        )
    cube = twenty_six_directions()
    sigma = task.dwell_sigma(dwell, task.span(np.full(count, dwell)))
    chosen = find_visits(
        pose_rows(cube) / sigma, count, rng, known=task.known, starts=STARTS, also=_known_sets(count)
    )
    directions = cube[chosen]
    order = best_order(task, directions, dwell)
    return plan_of(NAME, task, directions[order], np.full(count, dwell))


def plan_time(
    task: PoseTask, seconds: float, rng: np.random.Generator, say: Callable[[str], None] | None = None
) -> PosePlan:
    """Return the best plan that lasts so long, turns included, with as many poses as is best and free dwells.

    Parameters
    ----------
    task, rng : as of `plan_poses`.
    seconds : of the whole test.
    say : called with a sentence on what is tried.

    Raises
    ------
    UsageError
        If the time is not enough for as many poses as are needed.
    ObservabilityError
        As `plan_poses`.
    """
    least = len(PARAMETERS) if task.known is None else LADDER[0]
    fitting = [n for n in LADDER if n >= least and (seconds + task.turn) / n - task.turn >= LEAST_DWELL]
    if not fitting:
        needed = least * (LEAST_DWELL + task.turn) - task.turn
        raise UsageError(
            f"{seconds:.0f} s are too short for the {least} poses that are needed, {LEAST_DWELL:g} s each and "
            f"{task.turn:g} s between them: give {needed:.0f} s ({needed / 60.0:.2g} min) or more."
        )
    plans: list[PosePlan] = []
    if say is not None:
        say("trying how many poses are best")
    for count in counted(fitting, sum(fitting), float):
        try:
            plans.append(plan_poses(task, count, (seconds + task.turn) / count - task.turn, rng))
        except ObservabilityError:
            if count == fitting[-1] and not plans:
                raise
    limit = min(plan.value for plan in plans) * (1.0 + FEWER_POSES)
    fewest = next(plan for plan in plans if plan.value <= limit)
    freed = _free_dwells(task, fewest)
    return freed if freed.value < fewest.value else fewest


def scheme_directions() -> dict[str, Vectors]:
    """Return the papers' sets of poses by name."""
    directions = twenty_six_directions()
    corner = np.array([[1.0, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / np.sqrt(3.0)
    return {
        "six faces": directions[:6],
        "nine of Zhang et al. (2010)": directions[list(NINE)],
        "ten: faces, a corner and its neighbours": np.vstack([directions[:6], corner]),
        "twelve edges": directions[6:18],
        "fourteen: faces and corners": np.vstack([directions[:6], directions[18:]]),
        "eighteen: faces and edges": directions[:18],
        "all 26 (Shin and El-Sheimy)": directions,
    }


def plan_schemes(task: PoseTask, seconds: float) -> dict[str, PosePlan | str]:
    """Return the papers' schemes in the same time, each in its best order; in words what keeps one from it.

    Parameters
    ----------
    task : what for.
    seconds : of the whole test, turns included.
    """
    plans: dict[str, PosePlan | str] = {}
    for name, directions in scheme_directions().items():
        dwell = (seconds + task.turn) / len(directions) - task.turn
        if dwell < LEAST_DWELL:
            plans[name] = f"the time leaves less than {LEAST_DWELL:g} s for a pose"
            continue
        ordered = directions[best_order(task, directions, dwell)]
        try:
            plans[name] = plan_of(name, task, ordered, np.full(len(ordered), dwell))
        except ObservabilityError:
            said = describe_untold(directions) or "do not determine what is asked for"
            plans[name] = said.partition(" (")[0].replace("do not", "does not", 1)
    return plans


def _known_sets(count: int) -> list[list[int]]:
    """The papers' sets of so many poses, as indices of the 26 directions."""
    cube = twenty_six_directions()
    sets = [scheme for scheme in scheme_directions().values() if len(scheme) == count]
    return [np.argmax(scheme @ cube.T, axis=1).tolist() for scheme in sets]


def _free_dwells(task: PoseTask, plan: PosePlan) -> PosePlan:
    """Share the time anew among the poses; the plan as it is where one of them is hardly wanted."""
    from scipy.optimize import minimize

    count, rows = len(plan.directions), pose_rows(plan.directions)
    rest = plan.duration - task.turn * (count - 1)
    white = white_density(task.noise, task.rate) ** 2 / task.gravity**2
    wander = wander_sigma(task.noise, rest / count, plan.duration) ** 2 / task.gravity**2
    base = task.known if task.known is not None else 1e-10 / (white / rest) * np.eye(len(PARAMETERS))

    def lost(roots: Series) -> float:
        dwells = rest * roots**2 / float(roots @ roots)
        weights = 1.0 / (white / np.maximum(dwells, 1e-6) + wander)
        return float(np.log(task.value(inverted(rows.T @ (weights[:, None] * rows) + base))))

    end = minimize(lost, np.ones(count), method="L-BFGS-B", options={"maxiter": 200})
    roots = np.asarray(end.x, dtype=np.float64)
    dwells = np.round(rest * roots**2 / float(roots @ roots), 1)
    if float(dwells.min()) < LEAST_DWELL:
        return plan
    return plan_of(plan.name, task, plan.directions, dwells)


def shortest_order(directions: Vectors) -> list[int]:
    """Return an order in which each pose is near the one before, but never the same again at once.

    Parameters
    ----------
    directions : (n, 3) unit vectors up.
    """
    left = list(range(len(directions)))
    order = [max(left, key=lambda index: (round(float(directions[index, 2]), 6), -index))]
    left.remove(order[0])
    while left:
        cosines = directions[left] @ directions[order[-1]]
        alike = cosines > np.cos(SAME_POSE)
        # A pose that is to be visited often comes first, so that others are left to stand between.
        visits = np.array(
            [np.sum(directions[left] @ directions[index] > np.cos(SAME_POSE)) for index in left]
        )
        often = visits >= max(2.0, 0.5 * len(left))
        score = cosines + 10.0 * often - 100.0 * alike
        place = int(np.argmax(np.asarray(np.round(score, 9), dtype=np.float64)))
        order.append(left.pop(place))
    return order


def best_order(task: PoseTask, directions: Vectors, dwell: float) -> list[int]:
    """Return the order in which a wandering bias does least harm; the shortest where none wanders.

    Neighbours in time share a wander, and poses that look alike pass it on to the parameters: opposite poses one
    after the other do not. Found by swapping two poses for as long as that helps.

    Parameters
    ----------
    task, directions : as of `plan_poses`.
    dwell : s of each pose.
    """
    order = shortest_order(directions)
    if not task.noise.wanders or len(order) < 3:
        return order
    noise = hold_covariance(hold_times(np.full(len(order), dwell), task.turn), task.noise, task.rate)
    rows, alike = pose_rows(directions), directions @ directions.T
    base = (
        1e-10 * np.eye(len(PARAMETERS)) if task.known is None else task.known * float(np.mean(np.diag(noise)))
    )
    if task.known is not None:
        base = base / task.gravity**2
    gain = inverted(rows.T @ rows + base) @ rows.T
    mean = float(np.mean(np.diag(noise)))
    still = float(np.cos(SAME_POSE))

    def value(tried: list[int]) -> float:
        at = np.array(tried)
        if np.any(alike[at[1:], at[:-1]] > still):
            return float("inf")
        place = gain[:, at]
        covariance = place @ (alike[np.ix_(at, at)] * noise) @ place.T / mean
        return float(task.value(covariance))

    now = value(order)
    for _ in range(MOST_SWEEPS):
        before = now
        for first in range(len(order) - 1):
            for second in range(first + 1, len(order)):
                order[first], order[second] = order[second], order[first]
                tried = value(order)
                if tried < now * (1.0 - 1e-6):
                    now = tried
                else:
                    order[first], order[second] = order[second], order[first]
        if now > 0.995 * before:
            break
    return order
