"""Poses in words: how many differ, their names, whether they suffice, what they cannot tell, which one is missing.

What a set of poses cannot tell, in words, and which poses would mend it.

The norm in a pose tells one number, a polynomial of second degree in the direction up:
``u . Q u + l . u`` with the scale factors on the diagonal of Q, the non-orthogonalities beside it and the
biases in l. A combination of the nine unknowns is untold exactly if its polynomial vanishes in all poses:
if they lie where the unit sphere meets one quadric. Two planes are the quadric to beware of: six
directions in one plane and three in any other leave a combination untold, for three directions always
lie in a plane.

The six positions recognised in a recording without a protocol: which face is up in each hold. Which poses a protocol
asks to be believed: of which holds, how, and how well.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Matrices, Series, Square, Table, Vector, Vectors, inverted
from tumble.attitude import twenty_six_directions
from tumble.calibration.equations.observed import BelievedPoses
from tumble.calibration.equations.triad_unknowns import BIAS, SCALE
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.estimation import find_weak_directions
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep, named_protocol

if TYPE_CHECKING:
    from tumble.segmentation import HoldMeans, Matching


# Farther than this from every face, a hold is none of the six positions.
FACE_ANGLE = np.radians(20.0)
# An exact pose is one to a microradian: a fifth of an arcsecond, below any table's.
LEAST_SIGMA = 1e-6  # rad
# A box propped up by hand determines nothing that gravity does not tell a hundred times better.
LOOSEST = 0.05  # rad


def believed_poses(protocol: Protocol, matching: Matching) -> BelievedPoses | None:
    """Return the poses that can be believed, None where there is none.

    Parameters
    ----------
    protocol, matching : what was to be done, and which hold is which step of it.

    Notes
    -----
    A unit that stays on its table from hold to spin to hold is placed once: its pose is an observation of the
    first of these holds only, for its error is the same in all.
    """
    made: list[tuple[int, Vectors, Matrices, bool, float]] = []
    last_step: int | None = None
    placed: dict[int, int] = {}
    last: int | None = None
    for match in matching.holds:
        step = protocol.steps[match.step]
        stays = last_step is not None and _stays(protocol, last_step, match.step)
        last_step, last = match.step, last if stays else None
        if last is not None:
            placed[match.hold] = last
        if not isinstance(step, HoldStep) or step.pose is None or stays or step.pose.sigma > LOOSEST:
            continue
        pose = step.pose
        up = np.asarray(pose.up_b, dtype=np.float64) / float(np.linalg.norm(pose.up_b))
        C_nf = pose.C_nb()
        placed[match.hold] = last = match.hold
        made.append((match.hold, up, C_nf, pose.heading is not None, max(pose.sigma, LEAST_SIGMA)))
    if not made:
        return None
    made.sort(key=lambda m: m[0])
    return BelievedPoses(
        np.array([m[0] for m in made]),
        np.array([m[1] for m in made]),
        np.array([m[2] for m in made]),
        np.array([m[3] for m in made]),
        np.array([m[4] for m in made]),
        placed,
    )


def _stays(protocol: Protocol, before: int, here: int) -> bool:
    """Whether the unit was not placed anew between two holds: a spin lies between them, and no turn."""
    if before == here:
        return True
    between = protocol.steps[before + 1 : here]
    return any(isinstance(s, SpinStep) for s in between) and not any(isinstance(s, TurnStep) for s in between)


def match_faces(means: HoldMeans, site: Site) -> tuple[Protocol, Matching]:
    """Return a six-position protocol in the order of the recording, and each hold's step in it.

    Parameters
    ----------
    means : of the holds that were found.
    site : gravity, for the rough scale.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer to tell the faces.
    """
    from tumble.calibration.equations.triad_unknowns import rough_triad, triad_from_unknowns
    from tumble.segmentation import MatchedHold, Matching

    if means.specific_force is None:
        raise ObservabilityError("The recording has no accelerometer: nothing shows which face is up.")
    named = named_protocol("six-position")
    sigma = next(step.pose.sigma for step in named.steps if isinstance(step, HoldStep) and step.pose)
    rough = triad_from_unknowns(rough_triad(means.specific_force, site.gravity))
    up_b = rough.correct(means.specific_force)
    faces = twenty_six_directions()[:6]
    shares = up_b @ faces.T / np.linalg.norm(up_b, axis=1, keepdims=True)
    nearest, is_face = np.argmax(shares, axis=1), np.max(shares, axis=1) > np.cos(FACE_ANGLE)
    steps = tuple(
        HoldStep(float(means.duration[k]), Pose(faces[nearest[k]], None, sigma), _name(faces[nearest[k]]))
        for k in np.flatnonzero(is_face)
    )
    holds = tuple(MatchedHold(step, int(hold)) for step, hold in enumerate(np.flatnonzero(is_face)))
    extra = tuple(int(hold) for hold in np.flatnonzero(~is_face))
    assumed = (
        f"No protocol was given: {len(steps)} holds were taken for the face that is nearest to up. "
        f"They are believed level within {np.degrees(sigma):.2g}° (one standard deviation). A "
        "protocol file can state how level they were."
    )
    remarks = [assumed]
    if extra:
        listed = ", ".join(str(hold + 1) for hold in extra[:10])
        remarks.append(
            f"Holds more than {np.degrees(FACE_ANGLE):.0f}° from every face were left out: {listed}."
        )
    protocol = Protocol("six-position", "six-position", steps, site, description=named.description)
    return protocol, Matching(holds=holds, spins=(), missing=(), extra=extra, remarks=remarks)


def _name(up_b: np.ndarray) -> str:
    axis = int(np.argmax(np.abs(up_b)))
    return f"{'xyz'[axis]} {'up' if up_b[axis] > 0 else 'down'}"


# Of a rough solution in SI units: a sphere fitted to one pose, laid down again and again, is beyond these.
LARGEST_SCALE_ERROR = 0.3
LARGEST_BIAS = 3.0  # m/s²
WANTED = {9: "nine unknowns (bias, scale factor, non-orthogonality)", 6: "biases and scale factors"}


def missing_poses(
    means: Vectors, force_unknowns: Series, *, has_prior: bool, factor: float | None = None
) -> str:
    """Return what is to be said of poses that do not determine the accelerometers, and which would; else nothing.

    Parameters
    ----------
    means : (holds, 3) mean raw specific force.
    force_unknowns : (12,) rough unknowns of the accelerometer triad.
    has_prior : the non-orthogonalities are known from an earlier calibration.
    factor : m/s² per raw unit, or None for counts, of which neither zero nor size is known.
    """
    needed = 6 if has_prior else 9
    up = _directions(means, force_unknowns, factor)
    held = up[distinct_poses(up)]
    if held.shape[0] < needed:
        return _too_few(held, needed)
    untold = describe_untold(held, needed)
    mending = f"hold the unit also with {describe_mending(held, needed)}{_serves(held, needed)}"
    return untold and f"The {held.shape[0]} different poses {untold}. Record again and {mending}."


def _directions(means: Vectors, force_unknowns: Series, factor: float | None) -> Vectors:
    """Return unit vectors up; a rough solution that no sensor has is none, and the raw numbers serve."""
    bias, scale = force_unknowns[BIAS], force_unknowns[SCALE]
    if factor is not None:
        off = max(
            np.max(np.abs(scale * factor - 1.0)) / LARGEST_SCALE_ERROR,
            np.max(np.abs(bias * factor)) / LARGEST_BIAS,
        )
        if not off < 1.0:
            bias, scale = np.zeros(3), np.full(3, 1.0 / factor)
    up = (means - bias) / scale
    return up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)


def _too_few(held: Vectors, needed: int) -> str:
    found = held.shape[0]
    poses = "1 different pose was" if found == 1 else f"{found} different poses were"
    text = (
        f"{poses} found and {needed} are needed for {WANTED[needed]}: "
        f"hold the unit also with {describe_mending(held, needed)}"
    )
    if needed == 9 and found >= 6:
        text += "; or give an earlier calibration of this unit with --prior, and six poses suffice"
    return f"{text}{_serves(held, needed)}."


def _serves(held: Vectors, needed: int) -> str:
    """Which option gets something out of these poses as they are; empty where none does."""
    if needed < 9 or held.shape[0] < 6:
        return ""
    options: list[str] = []
    if not describe_untold(held, 6):
        options.append(
            "--estimator multi-position-6 takes the non-orthogonalities as nominal and gives biases and scale factors"
        )
    if np.all(np.max(held @ twenty_six_directions()[:6].T, axis=0) > np.cos(FACE_ANGLE)):
        options.append("--procedure six-position gives these and believes that the faces were levelled")
    return f"; or {', and '.join(options)}" if options else ""


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
    *(f"the {what} of {axis}" for what in ("bias", "scale factor") for axis in "xyz"),
    *(f"the non-orthogonality of {axes}" for axes in ("x to y", "y to z", "x to z")),
)
"""The unknowns of `norm_rows` for a user."""
GROUPS = ("the biases", "the scale factors", "the non-orthogonalities")


def undetermined_combinations(directions: Vectors, unknowns: int = 9) -> list[Series]:
    """Return the combinations that the norms in these poses do not tell, each with as few unknowns as can be.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    unknowns : the first so many of `norm_rows`.

    Returns
    -------
    weights : (unknowns,) of each; its polynomial vanishes in every pose.
    """
    rows = norm_rows(directions)[:, :unknowns]
    weak = find_weak_directions(rows.T @ rows, np.ones(unknowns), LARGEST_AMPLIFICATION)
    if not weak:
        return []
    from scipy.linalg import qr

    basis = np.array([one.direction for one in weak])
    # One unknown for each combination that the others of them do without.
    pivots = np.sort(qr(basis, mode="r", pivoting=True)[1][: len(weak)])
    plain = np.linalg.solve(basis[:, pivots], basis)
    plain /= np.max(np.abs(plain), axis=1, keepdims=True)
    return list(plain)


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
    untold = undetermined_combinations(directions, unknowns)
    if not untold:
        return ""
    alone = [weights for weights in untold if np.count_nonzero(_leading(weights)) == 1]
    together = [
        f"separate {_words(weights)}" for weights in untold if np.count_nonzero(_leading(weights)) > 1
    ]
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


def describe_mending(directions: Vectors, unknowns: int = 9) -> str:
    """Return in words which directions up, as few of the 26 as can be, make a set of poses tell all.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    unknowns : the first so many of `norm_rows`.
    """
    rows = norm_rows(directions)
    information = rows.T @ rows
    if unknowns < 9:
        information[unknowns:] = information[:, unknowns:] = 0.0
        information[unknowns:, unknowns:] = np.eye(9 - unknowns) * max(float(np.trace(information)), 1.0)
    missing = len(undetermined_combinations(directions, unknowns))
    named: list[Vector] = []
    for count in range(missing, MOST_NAMED) if missing else ():
        named = most_telling_poses(information, count, directions)
        if not undetermined_combinations(np.vstack([directions, *named]), unknowns):
            break
    return "; ".join(describe_direction(up) for up in named)


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
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


# Poses closer than this are one pose: placement by hand repeats to a few degrees.
SAME_POSE = np.radians(10.0)


def distinct_poses(directions: Vectors, angle: float = SAME_POSE) -> list[int]:
    """Return the indices of poses that differ from all earlier ones by more than `angle` (rad)."""
    units = directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-300)
    kept: list[int] = []
    for index, unit in enumerate(units):
        if all(float(unit @ units[other]) < np.cos(angle) for other in kept):
            kept.append(index)
    return kept


def describe_direction(up: Vector) -> str:
    """Return what points up in words, after the nearest of the 26 directions.

    Examples
    --------
    >>> import numpy as np
    >>> describe_direction(np.array([0.0, 0.0, -1.0]))
    '-z up'
    >>> describe_direction(np.array([1.0, 1.0, 0.0]))
    'edge between +x and +y up'
    """
    directions = twenty_six_directions()
    nearest = directions[int(np.argmax(directions @ (up / np.linalg.norm(up))))]
    axes = [f"{'+' if value > 0 else '-'}{name}" for name, value in zip("xyz", nearest, strict=True) if value]
    if len(axes) == 1:
        return f"{axes[0]} up"
    if len(axes) == 2:
        return f"edge between {axes[0]} and {axes[1]} up"
    return f"corner of {axes[0]}, {axes[1]} and {axes[2]} up"


def norm_rows(directions: Vectors) -> Table:
    """Return (poses, 9): what a pose's norm says of each unknown, all in units of gravity.

    Unknowns: bias over g (3), relative scale (3), angles yz, zx, zy. At small errors the norm moves
    by u . (bias + diag(u) scale + ...) with u the unit vector up (Hayal 3.88, 3.82, 3.69 linearised).
    """
    x, y, z = directions.T
    return np.column_stack([x, y, z, x * x, y * y, z * z, -x * y, -y * z, x * z])


def most_telling_poses(information: Square, count: int = 2, held: Vectors | None = None) -> list[Vector]:
    """Return the directions up, of the 26, that add most to what is known least.

    Parameters
    ----------
    information : (9, 9) normal matrix over the unknowns of `norm_rows`; may be singular.
    count : how many, chosen one after the other.
    held : (poses, 3) unit vectors of poses that were held already and are not named again.
    """
    directions = twenty_six_directions()
    if held is not None and held.size:
        fresh = np.max(directions @ held.T, axis=1) < np.cos(SAME_POSE)
        directions = directions[fresh] if np.any(fresh) else directions
    rows = norm_rows(directions)
    total = information / max(float(np.trace(information)), 1e-300) * 9.0
    chosen: list[Vector] = []
    for _ in range(count):
        cofactor = inverted(total + 1e-6 * np.eye(9))
        gain: Series = np.einsum("ij,jk,ik->i", rows, cofactor, rows)
        best = int(np.argmax(gain))
        chosen.append(directions[best])
        total = total + np.outer(rows[best], rows[best])
    return chosen
