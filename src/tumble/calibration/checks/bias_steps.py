"""Do biases jump during the recording? A knock, a supply or a defect can do it, and a unit that is switched on anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.calibration.checks.bias_drift import TIME_CONSTANTS
from tumble.estimation.wander import covariance_about_the_mean

# Chance of calling a step on any axis where holds scatter independently: it is said, and counted.
FALSE_ALARM = 0.01
# Chance that what the biases wander by looks like a jump anywhere, which makes the result unfit.
CONTRADICTION = 0.002
# Holds needed on either side of a step to tell it from one odd hold.
SMALLEST_SIDE = 4
# Jumps of accelerometers are looked for from so many holds beyond the unknowns.
LEAST_FREEDOM = 8
# Of hundreds of holds so many places are looked at: a jump between two of them shows at either.
MOST_PLACES = 100
# Directions of less than this share of the largest are none.
RANK = 0.05
# Of the squares of a course: what is left of it counts as this much less.
WEAK = 1e-3
# Of a jump, as a share of its squares: what less is left of is hidden.
HIDDEN = 0.02
# Variance of what wanders over that of the holds' own noise.
_SHARES = np.append(0.0, np.geomspace(0.03, 300.0, 9))
# Kinds of it: 1/f noise, a random walk, and each hold's own.
WANDERS = 3
# A jump may be of one axis, or of all three.
_AXES = ((0,), (1,), (2,), (0, 1, 2))


@dataclass(frozen=True, slots=True)
class BiasStep:
    """A jump of one axis' output at rest between hold `before` and hold `before + 1`, rad/s.

    `scatter` is what the means of single holds scatter by on either side.
    """

    axis: int
    before: int
    size: float
    sigma: float
    scatter: float


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


def find_bias_steps(residual: Vectors, variance: Vectors, known: AnyArray | None = None) -> list[BiasStep]:
    """Return the steps in the hold means' residuals at the place of the most significant one, which is the first.

    Parameters
    ----------
    residual : (holds, 3) observed minus predicted mean rate at rest, rad/s.
    variance : (holds, 3) of each, (rad/s)²; only their ratios matter, the level is estimated.
    known : (holds, regressors) what was adjusted to the same means beside the bias, such as the specific force of a
        g-sensitivity: it has taken a part of a step. None for nothing.

    Notes
    -----
    For every split the weighted means of both sides are compared, less what the known regressors have of them; the
    noise level is the median of the residuals about them, so that some odd holds do not hide a step. The most
    significant of all splits of three axes is held against Student's limit for that many trials (Bonferroni).
    """
    from scipy.special import stdtrit

    holds = residual.shape[0]
    splits = range(SMALLEST_SIDE, holds - SMALLEST_SIDE + 1)
    trials = 3 * len(splits)
    if trials < 3:
        return []
    constant = np.ones((holds, 1))
    taken = constant if known is None else np.hstack([constant, known])
    freedom: float = max(0.37 * (holds - taken.shape[1] - 1), 3.0)
    level: float = 1.0 - FALSE_ALARM / (2.0 * trials)
    limit = float(stdtrit(freedom, level))
    steps = [
        _step(residual[:, axis], 1.0 / variance[:, axis], taken, axis, split)
        for axis in range(3)
        for split in splits
    ]
    found = [step for step in steps if abs(step.size) > limit * step.sigma]
    found.sort(key=lambda step: -abs(step.size) / step.sigma)
    return [step for step in found if step.before == found[0].before]


def _step(values: Series, weight: Series, taken: AnyArray, axis: int, split: int) -> BiasStep:
    """The step at a split, the noise level robustly from what is left."""
    root = np.sqrt(weight)
    base, _ = np.linalg.qr(root[:, None] * taken)
    own, seen = root * (np.arange(len(values)) >= split), root * values
    own, seen = own - base @ (base.T @ own), seen - base @ (base.T @ seen)
    strength = max(float(own @ own), 1e-300)
    size = float(own @ seen) / strength
    freed = len(values) / max(len(values) - taken.shape[1] - 1, 1)
    level = max(1.4826 * float(np.median(np.abs(seen - size * own))) * freed**0.5, 1e-12)
    return BiasStep(axis, split - 1, size, level / strength**0.5, level / float(np.median(root)))


@dataclass(frozen=True, slots=True)
class Rests:
    """When holds are, and what their means are uncertain by: (holds,) s, s, and variances up to a common factor."""

    start: Series
    stop: Series
    variance: Series


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
    later = np.tril(np.ones((holds, holds)), -1)[:, : holds - 1]
    left = later - design @ (design.T @ later)
    size = later - later.mean(axis=0)
    shown = np.sum(left**2, axis=0) / np.maximum(np.sum(size**2, axis=0), 1e-300)
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
    chance : that biases which only wander show it anywhere.
    """

    after: int | None
    constant: float
    since: float
    until: float
    size: Series
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
    return _likeliest_course(norms, up, rests, known, chance)


def find_rate_course(
    residual: Series, rests: Rests, known: AnyArray | None = None, *, chance: float = FALSE_ALARM
) -> BiasCourse | None:
    """Return how one gyro's bias jumps or drifts; None if it only wanders.

    Parameters
    ----------
    residual : (holds,) observed minus predicted mean rate at rest.
    rests : the holds.
    known, chance : as for `find_bias_steps`, and as for `find_force_course`.
    """
    constant = np.ones((len(residual), 1))
    taken = constant if known is None else np.hstack([constant, known])
    return _likeliest_course(residual, constant, rests, taken, chance)


def _likeliest_course(
    seen: Series, shown: AnyArray, rests: Rests, known: AnyArray, chance: float
) -> BiasCourse | None:
    """The likeliest course of biases, by a ratio of likelihoods against wander.

    `shown` is (holds, axes), by what a bias shows in each observation. Without a course the noise is that of the holds
    and a wander of any size, as 1/f noise, a random walk, or each hold's own. With one the size is fitted anew. Of
    m observations beyond the known, a share of exp(-ratio/m) of the squares is left: a beta variable for each course,
    set of axes and kind of wander, of which the smallest is judged (Bonferroni).
    """
    from scipy.special import betainc

    sigma = np.sqrt(np.maximum(rests.variance, 1e-3 * float(np.median(rests.variance)))) + 1e-300
    base = _orthonormal(known / sigma[:, None])
    rest = np.linalg.qr(base, mode="complete")[0][:, base.shape[1] :]
    holds, freedom = len(seen), rest.shape[1]
    splits = range(SMALLEST_SIDE, holds - SMALLEST_SIDE + 1, max(1, holds // MOST_PLACES))
    if freedom < LEAST_FREEDOM + 3 or not splits:
        return None
    middle = 0.5 * (rests.start + rests.stop)
    length = max(float(middle[-1] - middle[0]), 1e-9)
    courses = [np.where(np.arange(holds) >= split, 1.0, 0.0) for split in splits]
    courses += [np.exp(-(middle - middle[0]) / (constant * length)) for constant in TIME_CONSTANTS]
    columns = np.stack(courses)[:, :, None] * (shown / sigma[:, None])
    ratio = _likelihood_ratios(rest.T @ (seen / sigma), columns, rest, shown, rests, sigma)
    sets = _sets(shown)
    numbers = np.array([len(axes) for axes in sets])
    left = np.asarray(
        betainc(0.5 * (freedom - numbers), 0.5 * numbers, np.exp(-ratio / freedom)), dtype=np.float64
    )
    best, axes = np.unravel_index(int(np.argmin(left)), left.shape)
    jump = bool(best < len(splits))
    trials = (len(splits) if jump else len(TIME_CONSTANTS)) * len(sets) * WANDERS
    found = min(1.0, trials * float(left[best, axes]))
    if found >= chance:
        return None
    of_axes = np.array(sets[axes])
    design = np.hstack([base, columns[best][:, of_axes]])
    size = np.zeros(shown.shape[1])
    size[of_axes] = np.linalg.lstsq(design, seen / sigma, rcond=1e-9)[0][base.shape[1] :]
    if jump:
        after = splits[best] - 1
        since = 0.5 * float(rests.stop[after] + rests.start[after + 1])
        return BiasCourse(after, np.inf, since, float(middle[-1]), size, found)
    constant = TIME_CONSTANTS[best - len(splits)] * length
    return BiasCourse(None, constant, float(middle[0]), float(middle[-1]), size, found)


def _sets(shown: AnyArray) -> tuple[tuple[int, ...], ...]:
    return _AXES if shown.shape[1] == 3 else ((0,),)


def _likelihood_ratios(
    seen: Series, columns: AnyArray, rest: AnyArray, shown: AnyArray, rests: Rests, sigma: Series
) -> AnyArray:
    """(courses, sets) twice the logarithm by which each course of a bias is likelier than wander alone."""
    own, columns = np.einsum("cha,chb->cab", columns, columns), rest.T @ columns
    span = float(rests.start.min()), float(rests.stop.max())
    middle = 0.5 * (rests.start + rests.stop) - span[0]
    together = (shown @ shown.T) / np.outer(sigma, sigma)
    flicker = covariance_about_the_mean(rests.start, rests.stop, span)
    without, best = -np.inf, np.full((len(columns), len(_sets(shown))), -np.inf)
    for wander in (flicker, np.minimum(middle[:, None], middle), np.eye(len(sigma))):
        spread = rest.T @ (wander * together) @ rest
        values, vectors = np.linalg.eigh(spread / max(float(np.trace(spread)) / len(spread), 1e-300))
        turned, across = vectors.T @ seen, vectors.T @ columns
        for share in _SHARES:
            weight = 1.0 / (1.0 + share * np.maximum(values, 0.0))
            squares = max(float(np.sum(weight * turned**2)), 1e-300)
            penalty = -0.5 * float(np.sum(np.log(weight)))
            without = max(without, -penalty - 0.5 * len(seen) * float(np.log(squares)))
            left = squares - _explained(weight, turned, across, own, _sets(shown))
            left = np.maximum(left, 1e-12 * squares)
            best = np.maximum(best, -penalty - 0.5 * len(seen) * np.log(left))
    return np.maximum(2.0 * (best - without), 0.0)


def _explained(
    weight: Series, seen: Series, columns: AnyArray, own: AnyArray, sets: tuple[tuple[int, ...], ...]
) -> AnyArray:
    """(courses, sets) weighted squares that go; what the known took of a course nearly whole is held back."""
    pull = np.einsum("cma,m->ca", columns, weight * seen)
    normal = np.einsum("cma,m,cmb->cab", columns, weight, columns) + WEAK * own * float(weight.min())
    # What the known took of a course whole leaves zeros.
    least = 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-150
    gone: list[AnyArray] = []
    for axes in sets:
        part = np.array(axes)
        solved = np.asarray(
            np.linalg.solve(normal[:, part[:, None], part] + least * np.eye(len(part)), pull[:, part, None]),
            dtype=np.float64,
        )
        gone.append(np.einsum("ca,ca->c", pull[:, part], solved[:, :, 0]))
    return np.stack(gone, axis=1)


def _orthonormal(columns: AnyArray) -> AnyArray:
    """Columns of unit length that span the same as far as it is clear."""
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular > RANK * singular[0]], dtype=np.float64)
