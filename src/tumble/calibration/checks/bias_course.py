"""Do biases jump or drift during the recording, by a knock, the supply or warming up? Then numbers are less certain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.calibration.estimate import Kind
from tumble.estimation.wander import covariance_about_the_mean, first_of_neighbours
from tumble.records import dataclass

# Chance of calling a course of a triad's biases, on any axis, where they only wander: it is said, and counted.
FALSE_ALARM = 0.01
# Chance that what the biases wander by looks like a jump anywhere, which makes the result unfit.
CONTRADICTION = 0.002
# Holds needed on either side of a step to tell it from one odd hold.
SMALLEST_SIDE = 4
# Courses are looked for from so many holds beyond the unknowns.
LEAST_FREEDOM = 8
# Time constants of drifts that are tried, in lengths of the recording: the longest is all but a straight line.
TIME_CONSTANTS = (0.05, 0.1, 0.2, 0.4, 1.0, 5.0)
# Of hundreds of holds so many places are looked at: a jump between two of them shows at either.
MOST_PLACES = 100
# Beyond so many numbers neighbouring holds are taken together: the cost grows with the cube of the numbers.
MOST_NUMBERS = 400
# Directions of less than this share of the largest are none.
RANK = 0.05
# Of the squares of a course: what is left of it counts as this much less.
WEAK = 1e-3
# Of a jump, as a share of its squares: what less is left of is hidden.
HIDDEN = 0.02
# Of a course's largest size: axes that do less are counted, and not said.
SAID = 0.1
# Variance of what wanders over that of the holds' own noise.
_SHARES = np.append(0.0, np.geomspace(0.03, 300.0, 9))
# Kinds of it: 1/f noise, a random walk, and each hold's own.
WANDERS = 3
# A course may be of any of the axes.
_SETS = ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2))


def switched_on_anew(triad: str, where: str) -> str:
    """Return the objection to biases of a triad that jump together.

    Parameters
    ----------
    triad : its plural.
    where : between which holds, in words.
    """
    return (
        f"The biases of the {triad} jump {where}: the unit was switched on anew or knocked there, or it is another "
        "unit's recording from there on. Calibrate each part by itself, or with --turn-ons if both are this unit's."
    )


@dataclass(frozen=True, slots=True)
class Rests:
    """When holds are, and what their means are uncertain by, at least: (holds,) s, s, and variances by axis or all."""

    start: Series
    stop: Series
    variance: AnyArray

    def between(self, before: int) -> str:
        """Return where a jump is, in words.

        Parameters
        ----------
        before : the hold that it comes after.
        """
        when = 0.5 * float(self.stop[before] + self.start[before + 1])
        return f"between hold {before + 1} and hold {before + 2}, at about {when:.0f} s"


def hidden_jumps(up: Vectors) -> list[int]:
    """Return the holds after which biases could jump and nothing in the holds would show it.

    A jump is hidden where it is the same as other scale factors, angles and biases: where "after it" is, over all
    holds, a number and a linear function of the direction up. So it is where all faces up come before all faces down.

    Parameters
    ----------
    up : (holds, 3) unit vectors of the corrected specific force, in the order of time.
    """
    holds = len(up)
    design, _ = np.linalg.qr(np.hstack([np.ones((holds, 1)), up]))
    # Squares of ones up to each hold, zeros after it: less the design's part, and less the mean.
    earlier = np.arange(1.0, holds)
    left = earlier - np.sum(np.cumsum(design, axis=0)[:-1] ** 2, axis=1)
    shown = left / (earlier * (1.0 - earlier / holds))
    return np.flatnonzero(shown < HIDDEN).tolist() if holds > design.shape[1] + 1 else []


@dataclass(frozen=True, slots=True)
class BiasCourse:
    """A jump or a drift of biases.

    Attributes
    ----------
    after : hold after which they jump; None of a drift.
    constant : s, time constant of an exponential; infinite of a jump.
    since : s, when they jump, or when the drift begins.
    until : s, the middle of the last hold.
    size : (axes,) of the jump, or by how much they are off at the beginning of the drift.
    sigma : (axes,) of `size`, by what holds scatter by about the course.
    chance : that biases which only wander show it anywhere.
    """

    after: int | None
    constant: float
    since: float
    until: float
    size: Series
    sigma: Series
    chance: float

    def departure(self, time: Series) -> AnyArray:
        """Return (times, axes) by what the biases differ from those of the last hold.

        Parameters
        ----------
        time : s.
        """
        if self.after is not None:
            return -self.size * (time < self.since)[:, None]
        decayed = np.exp(-(np.append(time, self.until) - self.since) / self.constant)
        return self.size * (decayed[:-1] - decayed[-1])[:, None]

    @property
    def is_contradiction(self) -> bool:
        """Whether it is a jump that no wander explains."""
        return self.after is not None and self.chance < CONTRADICTION


def find_force_course(
    norms: Series, up: Vectors, rests: Rests, *, further: bool = False, chance: float = FALSE_ALARM
) -> BiasCourse | None:
    """Return how the accelerometers' biases jump or drift, m/s², by the norms of all holds; None if they only wander.

    Parameters
    ----------
    norms : (holds,) corrected norm minus gravity, m/s², in the order of time.
    up : (holds, 3) unit vectors of the corrected specific force.
    rests : the holds.
    further : asymmetries or quadratic terms were adjusted, too.
    chance : of finding one where biases only wander.

    Notes
    -----
    To first order nine unknowns of accelerometers change a norm by quadratic polynomials of its direction, and a bias
    by its part along it. What the nine took is taken off before the test (Frisch and Waugh 1933).
    """
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    products = np.column_stack([up[:, i] * up[:, j] for i, j in pairs])
    known = np.hstack([up, products, *([np.abs(up) * up, up**3] if further else [])])
    return _likeliest_course([_Series(norms, up, rests.variance, known)], rests.start, rests.stop, chance)


def find_rate_courses(
    residual: Vectors,
    rests: Rests,
    known: AnyArray | None = None,
    left_out: Sequence[int] = (),
    *,
    chance: float = FALSE_ALARM,
) -> list[BiasCourse]:
    """Return how the gyros' biases jump or drift, raw; each course is of other axes, which do it together.

    Parameters
    ----------
    residual : (holds, 3) raw, observed minus predicted mean rate at rest, in the order of time.
    rests : the holds, with variances (holds, 3).
    known : (holds, regressors) what was adjusted to the same means beside the bias, such as the specific force of a
        g-sensitivity: it has taken a part of a course. None for nothing.
    left_out : holds that were; see `likelier_course`.
    chance : of finding one on any axis where biases only wander.
    """
    found: list[BiasCourse] = []
    axes = np.arange(3)
    while axes.size:

        def of_axes(used: np.ndarray, axes: np.ndarray = axes) -> BiasCourse | None:
            constant = np.ones((used.size, 1))
            taken = constant if known is None else np.hstack([constant, known[used]])
            start, stop = rests.start[used], rests.stop[used]
            each = [
                _Series(residual[used, a], constant * np.eye(3)[a], rests.variance[used, a], taken)
                for a in axes
            ]
            return _likeliest_course(each, start, stop, chance)

        course = likelier_course(of_axes, np.arange(len(residual)), left_out, chance)
        if course is None:
            break
        found.append(course)
        axes = np.setdiff1d(axes, np.flatnonzero(course.size))
    return found


@dataclass(frozen=True, slots=True)
class _Series:
    """What holds show: (holds,) values, (holds, axes) by what biases show in each, variances, and what was adjusted."""

    seen: Series
    shown: AnyArray
    variance: Series
    known: AnyArray

    def whitened(self) -> _Whitened:
        """Over their sigmas, and of many neighbours what shows their common bias: as many numbers as it has parts."""
        sigma = np.sqrt(np.maximum(self.variance, 1e-3 * float(np.median(self.variance)))) + 1e-300
        table = np.column_stack([self.seen, self.shown, self.known]) / sigma[:, None]
        biases = slice(1, 1 + self.shown.shape[1])
        first = group = np.arange(len(table))
        if len(table) > MOST_NUMBERS:
            parts = int(np.linalg.matrix_rank(table[:, biases]))
            first = first_of_neighbours(len(table), MOST_NUMBERS // parts)
            together = np.split(table, first[1:])
            turned = [
                np.linalg.svd(some[:, biases], full_matrices=False)[0][:, :parts].T @ some
                for some in together
            ]
            table, group = np.vstack(turned), np.repeat(np.arange(len(first)), [len(some) for some in turned])
        base = _orthonormal(table[:, biases.stop :])
        rest = np.linalg.qr(base, mode="complete")[0][:, base.shape[1] :]
        return _Whitened(table[:, 0], table[:, biases], base, rest, first, group)


@dataclass(frozen=True, slots=True)
class _Whitened:
    """Values and (numbers, axes) over their sigmas, orthonormal bases of what was adjusted and of the rest.

    `first` has the first hold of each group of neighbours, `group` the group of each number.
    """

    seen: Series
    shown: AnyArray
    base: AnyArray
    rest: AnyArray
    first: np.ndarray
    group: np.ndarray


def likelier_course(
    find: Callable[[np.ndarray], BiasCourse | None],
    holds: np.ndarray,
    left_out: Sequence[int],
    chance: float,
) -> BiasCourse | None:
    """Return the likelier course of all holds and of those that were not left out; None if chance explains it.

    Holds that were left out may be all of those before a jump, or odd ones that hide it.

    Parameters
    ----------
    find : indices of holds to their course.
    holds, left_out : indices of all that are looked at, and of those that an adjustment left out.
    chance : from which on it is none.
    """
    tried = (holds, np.setdiff1d(holds, left_out))[: 2 if len(left_out) else 1]
    found: list[BiasCourse] = []
    for used in tried:
        course = find(used)
        if course is not None:
            after = None if course.after is None else int(used[course.after])
            found.append(replace(course, after=after, chance=len(tried) * course.chance))
    best = min(found, key=lambda course: course.chance, default=None)
    return best if best is not None and best.chance < chance else None


def _likeliest_course(each: list[_Series], start: Series, stop: Series, chance: float) -> BiasCourse | None:
    """The likeliest course of biases, by a ratio of likelihoods against wander, in all series together.

    Without a course the noise is that of the holds or more, and a wander of any size, as 1/f noise, a random walk, or
    each hold's own. With one the size is fitted anew. Of m observations beyond the known, a share of exp(-ratio/m) of
    the squares is left: a beta variable for each course, set of axes and kind of wander, of which the smallest is
    judged (Bonferroni). Noise is never less than stated: coarse steps make all holds show one number, and those beyond
    an edge the next.
    """
    from scipy.special import betainc

    whitened = [one.whitened() for one in each]
    first, group, freedom = whitened[0].first, whitened[0].group, min(one.rest.shape[1] for one in whitened)
    limits = start[first], stop[np.append(first[1:], len(start)) - 1]
    splits = range(SMALLEST_SIDE, len(first) - SMALLEST_SIDE + 1, max(1, len(first) // MOST_PLACES))
    if freedom < LEAST_FREEDOM + 3 or not splits:
        return None
    middle = 0.5 * (limits[0] + limits[1])[group]
    length = max(float(middle[-1] - middle[0]), 1e-9)
    until = 0.5 * float(start[-1] + stop[-1])
    courses = [np.where(group >= split, 1.0, 0.0) for split in splits]
    courses += [np.exp(-(middle - middle[0]) / (constant * length)) for constant in TIME_CONSTANTS]
    ratio: AnyArray = np.zeros((len(courses), len(_SETS)))
    for one in whitened:
        # Each has a wander of its own: one axis may wander more than the others.
        ratio += _ratios(one, np.stack(courses), limits)
    numbers = np.array([len(axes) for axes in _SETS])
    left = np.asarray(
        betainc(0.5 * (freedom - numbers), 0.5 * numbers, np.exp(-ratio / freedom)), dtype=np.float64
    )
    at, axes = np.unravel_index(int(np.argmin(left)), left.shape)
    jump = bool(at < len(splits))
    trials = (len(splits) if jump else len(TIME_CONSTANTS)) * len(_SETS) * WANDERS
    found = min(1.0, trials * float(left[at, axes]))
    if found >= chance:
        return None
    # What warms up one axis warms up the others, though they may not show it beyond chance.
    of_axes, size, variance = np.array(_SETS[axes if jump else -1]), np.zeros(3), np.zeros(3)
    for one in whitened:
        design = np.hstack([one.base, courses[at][:, None] * one.shown[:, of_axes]])
        inverse = np.linalg.pinv(design, rcond=1e-9)
        values, known = inverse @ one.seen, one.base.shape[1]
        # Noise is never less than stated.
        left = float(np.sum((one.seen - design @ values) ** 2)) / max(design.shape[0] - design.shape[1], 1)
        size[of_axes] += values[known:]
        variance[of_axes] += max(left, 1.0) * np.sum(inverse[known:] ** 2, axis=1)
    sigma = np.sqrt(variance)
    if jump:
        after = int(first[splits[at]]) - 1
        since = 0.5 * float(stop[after] + start[after + 1])
        return BiasCourse(after, np.inf, since, until, size, sigma, found)
    constant = TIME_CONSTANTS[at - len(splits)] * length
    return BiasCourse(None, constant, float(middle[0]), until, size, sigma, found)


def _ratios(one: _Whitened, courses: AnyArray, limits: tuple[Series, Series]) -> AnyArray:
    """(courses, sets) twice the logarithm by which each course of a set of axes is likelier than wander alone."""
    columns, seen = courses[:, :, None] * one.shown, one.rest.T @ one.seen
    own, columns = np.swapaxes(columns, 1, 2) @ columns, one.rest.T @ columns
    span = float(limits[0].min()), float(limits[1].max())
    middle = 0.5 * (limits[0] + limits[1]) - span[0]
    flicker = covariance_about_the_mean(*limits, span)
    without, best = -np.inf, np.full((len(courses), len(_SETS)), -np.inf)
    for wander in (flicker, np.minimum(middle[:, None], middle), np.eye(len(middle))):
        wander = wander[one.group[:, None], one.group]
        spread = one.rest.T @ (wander * (one.shown @ one.shown.T)) @ one.rest
        values, vectors = np.linalg.eigh(spread / max(float(np.trace(spread)) / len(spread), 1e-300))
        turned, across = vectors.T @ seen, vectors.T @ columns
        weight = 1.0 / (1.0 + _SHARES[:, None] * np.maximum(values, 0.0))
        squares = np.maximum(weight @ turned**2, 1e-300)
        penalty = -0.5 * np.sum(np.log(weight), axis=1)
        without = max(without, float(np.max(_logarithm(squares, len(seen)) - penalty)))
        squares, penalty = squares[:, None, None], penalty[:, None, None]
        left = np.maximum(squares - _explained(weight, turned, across, own), 1e-12 * squares)
        best = np.maximum(best, np.max(_logarithm(left, len(seen)) - penalty, axis=0))
    return np.maximum(2.0 * (best - without), 0.0)


def _logarithm(squares: AnyArray, count: int) -> AnyArray:
    """The likelihood's, of the likeliest level of noise that is not below what is stated."""
    level = np.maximum(squares / count, 1.0)
    return np.asarray(-0.5 * (count * np.log(level) + squares / level), dtype=np.float64)


def _explained(weight: AnyArray, seen: Series, columns: AnyArray, own: AnyArray) -> AnyArray:
    """(shares, courses, sets) weighted squares that go; what the known took of a course nearly whole is held back."""
    courses, numbers, axes = columns.shape
    columns = np.ascontiguousarray(columns.swapaxes(0, 1))
    products = (columns[:, :, :, None] * columns[:, :, None, :]).reshape(numbers, -1)
    normal = (weight @ products).reshape(-1, courses, axes, axes)
    normal += WEAK * own * np.min(weight, axis=1)[:, None, None, None]
    pull = (weight * seen @ columns.reshape(numbers, -1)).reshape(-1, courses, axes)
    # What the known took of a course whole leaves zeros.
    least = 1e-12 * np.trace(normal, axis1=2, axis2=3)[:, :, None, None] + 1e-150
    return np.stack([_squares(normal + least * np.eye(axes), pull, of) for of in _SETS], axis=2)


def _squares(normal: AnyArray, pull: AnyArray, axes: tuple[int, ...]) -> AnyArray:
    """Squares that some axes explain: the first one, and what the others do beyond it."""
    first, size = axes[0], normal[..., axes[0], axes[0]]
    squares = np.asarray(pull[..., first] ** 2 / size, dtype=np.float64)
    if len(axes) == 1:
        return squares
    share = normal[..., first] / size[..., None]
    rest = normal - share[..., :, None] * normal[..., first, None, :]
    return squares + _squares(rest, pull - share * pull[..., first, None], axes[1:])


def _orthonormal(columns: AnyArray) -> AnyArray:
    """Columns of unit length that span the same as far as it is clear."""
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular > RANK * singular[0]], dtype=np.float64)


def rate_course_words(courses: Sequence[BiasCourse], rests: Rests, scale: Series) -> dict[Kind, list[str]]:
    """Return what is said of gyros that jump or drift, by kind.

    Parameters
    ----------
    courses, rests : as found, and of what holds.
    scale : (3,) raw per rad/s, of the gyros.
    """
    said: dict[Kind, list[str]] = {"remark": [], "caution": [], "objection": []}
    counted = "Its uncertainty counts how far the last one is off it."
    for course in courses:
        where = None if course.after is None else rests.between(course.after)
        change = course.size if where else -course.departure(np.array([course.since]))[0]
        for axis in np.flatnonzero(np.abs(change / scale) > SAID * np.max(np.abs(change / scale))).tolist():
            size = float(np.degrees(change[axis] / scale[axis]))
            sigma = abs(size / course.size[axis]) * float(course.sigma[axis])
            if where:
                said["remark"].append(
                    f"The bias of gyro {'xyz'[axis]} jumps by {size:+.3f} °/s (± {sigma:.2g}) {where}. The stated bias "
                    f"is a mean of both. {counted} A knock or the supply can do it; record again."
                )
                continue
            said["caution"].append(
                f"The bias of gyro {'xyz'[axis]} drifts by {size:+.2g} °/s (± {sigma:.1g}) from the first hold to the "
                f"last (time constant about {course.constant:.2g} s), as of a unit that warms up. The stated bias is a "
                f"mean. {counted} Let the unit warm up before recording."
            )
        if where and course.is_contradiction:
            said["objection"] = said["objection"] or [switched_on_anew("gyros", where)]
    return said
