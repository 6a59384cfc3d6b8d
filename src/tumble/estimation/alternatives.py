"""Is something else likelier than what is believed? Declared suspicions, tested all at once where all has settled.

A suspicion is columns: what it would add to which observations. All that are declared are put beside the border of the
chain, and one elimination takes out of them what was adjusted. What is left is a score s and its covariance V: were the
amplitudes of the columns a, it would be ``s = V a + e`` with e of covariance V. So whatever is made of the same columns
is tested in a table as small as they are many, and what is no fault stands in it, too: amplitudes that wander.

The test is a ratio of likelihoods (Frisch and Waugh 1933 for what was adjusted; Rao's score, 1948, where nothing
wanders). Without an alternative the noise is what is stated or more, and a wander of any size, of one of the kinds that
are declared. With one, all of that is fitted anew. Of m numbers a share of exp(-ratio/m) of the squares is left: a beta
variable for each shape, set of axes and kind of wander, of which the smallest is judged (Bonferroni). The most
significant alternative is believed and taken out of the scores, and the rest is tested again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from operator import attrgetter

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.estimation.equations import Equations, Linear
from tumble.estimation.gauss_helmert import invert_normal_matrix
from tumble.estimation.solve import Adjustable, linearise
from tumble.estimation.sums import Whitened
from tumble.records import dataclass

# Suspicions are looked at where so many numbers check them.
LEAST_NUMBERS = 11
# Of a shape, as a share of its squares: of what less is left of, nothing is seen.
SEEN = 1e-9
# Variance of what wanders over that of the stated noise.
_SHARES = np.append(0.0, np.geomspace(0.03, 300.0, 9))


@dataclass(frozen=True)
class Suspect:
    """What may be otherwise than was believed, an amplitude for each place and axis.

    Attributes
    ----------
    columns : equations and their linearisation to (terms, m, places * axes) raw derivatives by the amplitudes, axes
        next to each other; None of equations that have nothing to do with it.
    places, axes : how many there are.
    wanders : (places, places) each, how the amplitudes of one axis may wander without a fault; of any size.
    apart : whether each axis wanders by itself, and the observations of one hardly depend on the others.
    telling : directions in which the observations tell less than this share of what they tell in the best one say
        nothing of amplitudes.
    """

    columns: Callable[[Equations, Linear], AnyArray | None]
    places: int
    axes: int
    wanders: Sequence[Square]
    apart: bool = False
    telling: float = 0.03


@dataclass(frozen=True)
class Alternative:
    """A suspicion.

    Attributes
    ----------
    name : of the family.
    suspect : what it is about.
    shapes : (shapes, places) what the amplitudes may be in units of a size, which each axis has of its own.
    false_alarm : how often one of the family is believed in a recording without a fault.
    sentence : says it of one that was found.
    all_axes : whether a size is looked for on every axis once some of them show it.
    """

    name: str
    suspect: Suspect
    shapes: AnyArray
    false_alarm: float
    sentence: Callable[[Found], str]
    all_axes: bool = False


@dataclass(frozen=True)
class Found:
    """An alternative that is believed.

    Attributes
    ----------
    alternative : the family.
    shape : which of its shapes.
    axes : which axes showed it.
    size, sigma : (axes,) raw, and its standard uncertainty by noise and wander; zero on axes that have none.
    probability : that chance shows any of the family, on any axis.
    """

    alternative: Alternative
    shape: int
    axes: tuple[int, ...]
    size: Series
    sigma: Series
    probability: float

    @property
    def rarity(self) -> float:
        """How much rarer it is by chance than what is allowed; it is believed below 1."""
        return self.probability / self.alternative.false_alarm

    @property
    def said(self) -> str:
        """The family's sentence."""
        return self.alternative.sentence(self)


def find(trials: Sequence[Adjustable], alternatives: Sequence[Alternative]) -> list[Found]:
    """Return the alternatives that are likelier than chance, the most significant first.

    Parameters
    ----------
    trials : the task where it has settled, without noise of what the suspect wanders by; beside it, if it left anything
        out, with all that was recorded: what was left out may be all there is of a fault, or what hides it.
    alternatives : all that are declared of one suspect.

    Raises
    ------
    ObservabilityError
        If what was observed does not determine the unknowns.
    """
    suspect, found = alternatives[0].suspect, list[Found]()
    scores: list[_Scores] = [_scores(task, suspect) for task in trials]
    left = np.arange(suspect.axes)
    while left.size:
        tested = [_likeliest(score, one, left, len(trials)) for one in alternatives for score in scores]
        best = min((one for one in tested if one is not None), key=_rarity, default=None)
        if best is None or best.rarity >= 1.0:
            break
        found.append(best)
        shape = best.alternative.shapes[best.shape]
        scores = [score.without(shape, best.size != 0.0) for score in scores]
        left = left[best.size[left] == 0.0]
    return sorted(found, key=_rarity)


_rarity = attrgetter("rarity")


@dataclass(frozen=True)
class _Scores:
    """Of a suspect's amplitudes: (places, axes), and their covariance."""

    score: AnyArray
    covariance: AnyArray

    def without(self, shape: Series, axes: np.ndarray) -> _Scores:
        """The same with a shape on some axes adjusted, too."""
        places, count = self.score.shape
        columns = np.kron(shape[:, None], np.eye(count)[:, axes])
        V, s = self.covariance.reshape(places * count, -1), self.score.ravel()
        turned = V @ columns
        gain = np.asarray(np.linalg.pinv(columns.T @ turned, hermitian=True), dtype=np.float64)
        left = V - turned @ gain @ turned.T
        return _Scores(
            (s - turned @ (gain @ (columns.T @ s))).reshape(places, count), left.reshape(V.shape[0], -1)
        )

    def numbers(self, axes: np.ndarray, share: float) -> tuple[Series, AnyArray]:
        """Those of some axes as independent numbers of unit variance, and (numbers, places, axes) what each shows."""
        places, count = self.score.shape
        at = np.concatenate([count * place + axes for place in range(places)])
        values, vectors = np.linalg.eigh(self.covariance[np.ix_(at, at)])
        telling = values > share * max(float(values[-1]), 1e-300)
        root, turned = np.sqrt(values[telling]), vectors[:, telling].T
        shown = (root[:, None] * turned).reshape(-1, places, len(axes))
        return turned @ self.score.ravel()[at] / root, shown


def _scores(task: Adjustable, suspect: Suspect) -> _Scores:
    """Scores of a suspect's amplitudes at the task's state, with everything that is adjusted taken out."""
    chain, normal, gradient = linearise(task)
    size, n = suspect.places * suspect.axes, len(normal)

    def columns(term: Whitened) -> AnyArray | None:
        return suspect.columns(term.equations, term.linear)

    wide = chain.chain.widened(columns, size).eliminated()
    across = wide.matrix[:n, n:]
    gain = invert_normal_matrix(normal) @ np.column_stack([across, gradient])
    whole = wide.matrix[n:, n:] - across.T @ gain[:, :-1]
    score = across.T @ gain[:, -1] - wide.right[n:]
    return _Scores(score.reshape(suspect.places, suspect.axes), 0.5 * (whole + whole.T))


def _likeliest(scores: _Scores, alternative: Alternative, axes: np.ndarray, tried: int) -> Found | None:
    """The likeliest shape of a family on some of the open axes, of `tried` trials; None where nothing checks it."""
    from scipy.special import betainc

    suspect, shapes = alternative.suspect, alternative.shapes
    sets = [some for count in range(1, axes.size + 1) for some in combinations(range(axes.size), count)]
    # One axis may wander more than the others.
    alone = [axes[k : k + 1] for k in range(axes.size)] if suspect.apart else [axes]
    each = [scores.numbers(some, suspect.telling) for some in alone]
    count = min((len(seen) for seen, _ in each), default=0)
    if count < LEAST_NUMBERS or not len(shapes):
        return None
    fits = [_Fits.of(*one, shapes, suspect.wanders) for one in each]
    if suspect.apart:
        of_each = np.concatenate([one.ratio([(0,)]) for one in fits], axis=1)
        ratio = np.stack([of_each[:, some].sum(axis=1) for some in sets], axis=1)
    else:
        ratio = fits[0].ratio(sets)
    numbers = np.array([len(some) for some in sets])
    left = np.asarray(
        betainc(0.5 * (count - numbers), 0.5 * numbers, np.exp(-ratio / count)), dtype=np.float64
    )
    # What chance hardly ever does may be as good as zero of several.
    likeliest = int(np.argmax(np.where(left == np.min(left), ratio, -1.0)))
    at, chosen = (int(k) for k in np.unravel_index(likeliest, left.shape))
    taken = axes[list(sets[-1] if alternative.all_axes else sets[chosen])]
    size, sigma = np.zeros(suspect.axes), np.zeros(suspect.axes)
    for one, own in zip(fits, alone, strict=True):
        there = np.isin(own, taken)
        size[own[there]], sigma[own[there]] = one.size(at, np.flatnonzero(there))
    chance = tried * left.size * max(len(suspect.wanders), 1) * float(left[at, chosen])
    named = tuple(axes[list(sets[chosen])].tolist())
    return Found(alternative, at, named, size, sigma, min(1.0, chance))


@dataclass(frozen=True)
class _Fits:
    """How numbers are explained by each shape beside each kind of wander.

    Attributes
    ----------
    weights, seen, shown : of each kind of wander: (shares, numbers) weights in its own directions, and there (numbers,)
        and (shapes, numbers, axes).
    """

    weights: Sequence[AnyArray]
    seen: Sequence[Series]
    shown: Sequence[AnyArray]

    @staticmethod
    def of(numbers: Series, shows: AnyArray, shapes: AnyArray, wanders: Sequence[Square]) -> _Fits:
        """In the directions of each kind of wander."""
        columns = np.einsum("cp,npa->cna", shapes, shows, optimize=True)
        weights, seen, shown = list[AnyArray](), list[Series](), list[AnyArray]()
        for wander in wanders or [np.zeros((shows.shape[1],) * 2)]:
            spread = np.einsum("npa,pq,mqa->nm", shows, wander, shows, optimize=True)
            values, vectors = np.linalg.eigh(spread / max(float(np.trace(spread)) / len(spread), 1e-300))
            weights.append(1.0 / (1.0 + _SHARES[:, None] * np.maximum(values, 0.0)))
            seen.append(vectors.T @ numbers)
            shown.append(vectors.T @ columns)
        return _Fits(weights, seen, shown)

    def ratio(self, sets: Sequence[tuple[int, ...]]) -> AnyArray:
        """(shapes, sets) twice the logarithm by which each shape on a set of axes is likelier than wander alone."""
        without, best = -np.inf, np.array(-np.inf)
        for weight, seen, shown in zip(self.weights, self.seen, self.shown, strict=True):
            squares = np.maximum(weight @ seen**2, 1e-300)
            penalty = -0.5 * np.sum(np.log(weight), axis=1)
            without = max(without, float(np.max(_logarithm(squares, len(seen)) - penalty)))
            squares, penalty = squares[:, None, None], penalty[:, None, None]
            left = np.maximum(squares - _explained(weight, seen, shown, sets), 1e-12 * squares)
            best = np.maximum(best, np.max(_logarithm(left, len(seen)) - penalty, axis=0))
        return np.maximum(2.0 * (best - without), 0.0)

    def size(self, shape: int, axes: np.ndarray) -> tuple[Series, Series]:
        """Size and standard uncertainty on some axes, by the likeliest wander."""
        made: list[tuple[float, Series, Series]] = []
        for weights, seen, shown in zip(self.weights, self.seen, self.shown, strict=True):
            columns = shown[shape][:, axes]
            for weight in weights:
                normal = (columns * weight[:, None]).T @ columns
                inverse = np.asarray(np.linalg.pinv(normal, hermitian=True), dtype=np.float64)
                values: Series = inverse @ (columns.T @ (weight * seen))
                squares = float(weight @ (seen - columns @ values) ** 2)
                likely = float(_logarithm(np.array(squares), len(seen)) + 0.5 * np.sum(np.log(weight)))
                level = max(squares / len(seen), 1.0)
                made.append((likely, values, np.sqrt(level * np.diag(inverse))))
        return max(made, key=lambda one: one[0])[1:]


def _logarithm(squares: AnyArray, count: int) -> AnyArray:
    """The likelihood's, of the likeliest level of noise that is not below what is stated."""
    level = np.maximum(squares / count, 1.0)
    return np.asarray(-0.5 * (count * np.log(level) + squares / level), dtype=np.float64)


def _explained(weight: AnyArray, seen: Series, shown: AnyArray, sets: Sequence[tuple[int, ...]]) -> AnyArray:
    """(shares, shapes, sets) weighted squares that go with each shape on a set of axes."""
    shapes, numbers, axes = shown.shape
    shown = np.ascontiguousarray(shown.swapaxes(0, 1))
    products = (shown[:, :, :, None] * shown[:, :, None, :]).reshape(numbers, -1)
    normal = (weight @ products).reshape(-1, shapes, axes, axes)
    pull = (weight * seen @ shown.reshape(numbers, -1)).reshape(-1, shapes, axes)
    least = SEEN * np.trace(normal, axis1=2, axis2=3)[:, :, None, None] + 1e-150
    normal = normal + least * np.eye(axes)
    made = list[AnyArray]()
    for of in map(list, sets):
        by = np.asarray(pull[..., of, None], dtype=np.float64)
        solved = np.asarray(np.linalg.solve(normal[..., of, :][..., of], by), dtype=np.float64)
        made.append(np.einsum("kcai,kcai->kc", by, solved))
    return np.stack(made, axis=2)
