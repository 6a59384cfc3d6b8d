"""What a set of poses cannot tell, in words, and which poses would mend it.

The norm in a pose tells one number, a polynomial of second degree in the direction up:
``u . Q u + l . u`` with the scale factors on the diagonal of Q, the non-orthogonalities beside it and the
biases in l. A combination of the nine unknowns is untold exactly if its polynomial vanishes in all poses:
if they lie where the unit sphere meets one quadric. Two planes are the quadric to beware of: six
directions in one plane and three in any other leave a combination untold, for three directions always
lie in a plane.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.calibration.poses import describe_direction, distinct_poses, most_telling_poses, norm_rows
from tumble.estimation import find_weak_directions

# A combination of unknowns whose sigma is this many times that of a single hold's norm is not told.
# The 26 attitudes give at most 1.2, nine well-chosen ones 2.6.
LARGEST_AMPLIFICATION = 30.0
# Dwells in one pose again and again are one pose in what is said of planes; rad.
ALIKE = 1e-3
# Up is in a plane if its part along the plane's normal is that of the others to 4°: hands are no better.
IN_PLANE = 0.07
# Planes are sought by all triples of poses, of so many at most: 10,000 triples, some milliseconds.
MANY = 40
# More poses than this are never needed: the 26 without the corners tell all.
MOST_NAMED = 18
# A part of a combination below this share of its largest is round-off and placement.
PART = 0.25
NAMES = (
    "the bias of x",
    "the bias of y",
    "the bias of z",
    "the scale factor of x",
    "the scale factor of y",
    "the scale factor of z",
    "the non-orthogonality of x to y",
    "the non-orthogonality of y to z",
    "the non-orthogonality of x to z",
)
"""The unknowns of `norm_rows` for a user."""
GROUPS = ("the biases", "the scale factors", "the non-orthogonalities")


@dataclass(frozen=True, slots=True)
class UntoldCombination:
    """A combination of unknowns that no pose of a set determines.

    Attributes
    ----------
    weights : (unknowns,) over those of `norm_rows`; its polynomial vanishes in every pose.
    words : its unknowns, listed.
    """

    weights: Series
    words: str

    @property
    def is_one(self) -> bool:
        """Whether it is a single unknown."""
        return int(np.count_nonzero(_leading(self.weights))) == 1


def find_untold(directions: Vectors, unknowns: int = 9) -> list[UntoldCombination]:
    """Return the combinations that the norms in these poses do not tell, each with as few unknowns as can be.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    unknowns : the first so many of `norm_rows`.
    """
    from scipy.linalg import qr

    rows = norm_rows(directions)[:, :unknowns]
    weak = find_weak_directions(rows.T @ rows, np.ones(unknowns), LARGEST_AMPLIFICATION)
    if not weak:
        return []
    basis = np.array([one.direction for one in weak])
    # One unknown for each combination that the others of them do without.
    pivots = np.sort(qr(basis, mode="r", pivoting=True)[1][: len(weak)])
    plain = np.linalg.solve(basis[:, pivots], basis)
    plain /= np.max(np.abs(plain), axis=1, keepdims=True)
    return [UntoldCombination(weights, _words(weights)) for weights in plain]


def find_two_planes(directions: Vectors) -> tuple[list[int], list[int]] | None:
    """Return the poses in one plane and the rest in another, larger plane first, or None if two do not do.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up, of poses that differ.
    """
    count = directions.shape[0]
    if not 3 < count <= MANY:
        return None
    first, second, third = directions[np.array(list(itertools.combinations(range(count), 3))).T]
    normals = np.cross(second - first, third - first)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    there = np.abs(np.einsum("pti,ti->tp", directions[:, None] - first, normals)) < IN_PLANE
    best = there[int(np.argmax(there.sum(axis=1)))]
    # A plane that holds all the rest; three and fewer always have one.
    holds_rest = np.all(there | best, axis=1)
    if np.count_nonzero(~best) > 3 and not np.any(holds_rest):
        return None
    return np.flatnonzero(best).tolist(), np.flatnonzero(~best).tolist()


def describe_untold(directions: Vectors, unknowns: int = 9) -> str:
    """Return the clause that says what poses do not tell and why, or nothing if they tell all.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    unknowns : the first so many of `norm_rows`.

    Examples
    --------
    >>> import numpy as np
    >>> faces = np.vstack([np.eye(3), -np.eye(3)])
    >>> describe_untold(np.vstack([faces, [[0.6, 0.8, 0.0], [0.0, 0.6, 0.8], [0.0, 0.6, -0.8]]]))
    'do not determine the non-orthogonality of x to z'
    """
    untold = find_untold(directions, unknowns)
    if not untold:
        return ""
    alone = [one.weights for one in untold if one.is_one]
    together = [f"separate {one.words}" for one in untold if not one.is_one]
    lone = [f"determine {_words(np.sum(np.abs(alone), axis=0))}"] if alone else []
    said = "do not " + "; nor ".join([*lone, *together])
    # Of a single unknown, or of a single plane, the names of the unknowns say enough.
    different = directions[distinct_poses(directions, ALIKE)]
    planes = find_two_planes(different) if unknowns == 9 and len(untold) == 1 and not alone else None
    if planes is None or not planes[1]:
        return said
    first, second = (len(plane) for plane in planes)
    reason = f"in {first} of them up lies in one plane, in the other {second} in another"
    return f"{said} ({reason}, and two planes never determine all)"


def _mending_poses(directions: Vectors, unknowns: int = 9) -> list[Vector]:
    """Return the directions up that, added to a set, make it tell all: as few of the 26 as can be."""
    rows = norm_rows(directions)
    information = rows.T @ rows
    if unknowns < 9:
        information[unknowns:] = information[:, unknowns:] = 0.0
        information[unknowns:, unknowns:] = np.eye(9 - unknowns) * max(float(np.trace(information)), 1.0)
    missing = len(find_untold(directions, unknowns))
    named: list[Vector] = []
    for count in range(missing, MOST_NAMED) if missing else ():
        named = most_telling_poses(information, count, directions)
        if not find_untold(np.vstack([directions, *named]), unknowns):
            break
    return named


def describe_mending(directions: Vectors, unknowns: int = 9) -> str:
    """Return the poses of `_mending_poses` in words.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    unknowns : the first so many of `norm_rows`.
    """
    return "; ".join(describe_direction(up) for up in _mending_poses(directions, unknowns))


def _leading(weights: Series) -> Series:
    return np.where(np.abs(weights) > PART * np.max(np.abs(weights)), weights, 0.0)


def _words(weights: Series) -> str:
    """The unknowns of a combination; a group that is in it whole by its own name."""
    there = np.flatnonzero(_leading(weights)).tolist()
    words: list[str] = []
    # What a sensor is first judged by comes first.
    for group in (1, 0, 2):
        members = [i for i in there if i // 3 == group]
        words += [GROUPS[group]] if len(members) == 3 else [NAMES[i] for i in members]
    return _listed(words)


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
