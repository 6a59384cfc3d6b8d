"""Whether there are enough poses, and different enough; if not, which one is missing."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.calibration.poses import describe_direction, distinct_poses, most_telling_poses, norm_rows
from tumble.calibration.triad_unknowns import BIAS, SCALE
from tumble.errors import ObservabilityError

# A combination of unknowns whose sigma is this many times that of a single hold's norm is not told.
# The 26 attitudes give at most 1.2, nine well-chosen ones 2.6.
LARGEST_AMPLIFICATION = 30.0
NAMES = (
    "bias x",
    "bias y",
    "bias z",
    "scale factor x",
    "scale factor y",
    "scale factor z",
    "non-orthogonality yz",
    "non-orthogonality zx",
    "non-orthogonality zy",
)


def require_poses(means: Vectors, force_unknowns: Series, *, has_prior: bool, unknowns: int = 9) -> None:
    """Refuse poses that do not determine the accelerometers, and say what to record instead.

    Parameters
    ----------
    means : (holds, 3) mean raw specific force.
    force_unknowns : (12,) rough unknowns of the accelerometer triad.
    has_prior : the non-orthogonalities are known from an earlier calibration.
    unknowns : how many are to be estimated from the norms.

    Raises
    ------
    ObservabilityError
        With the number of poses found and needed, or the combination that no pose tells.
    """
    needed = 6 if has_prior else unknowns
    up = (means - force_unknowns[BIAS]) / force_unknowns[SCALE]
    up = up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)
    kept = distinct_poses(up)
    rows = norm_rows(up[kept])[:, :unknowns]
    if len(kept) < needed:
        raise ObservabilityError(_too_few(len(kept), needed, rows, has_prior))
    if has_prior:
        rows = rows[:, :6]
    normal = rows.T @ rows
    eigenvalues, vectors = np.linalg.eigh(normal)
    if eigenvalues[0] < 1.0 / LARGEST_AMPLIFICATION**2:
        weak = vectors[:, 0]
        order: list[int] = np.argsort(-np.abs(weak)).tolist()
        names = [NAMES[i] for i in order if abs(weak[i]) > 0.4 * np.max(np.abs(weak))]
        raise ObservabilityError(
            f"The {len(kept)} different poses do not tell {_listed(names)} apart. "
            f"Record again and hold the unit also with {_suggestion(rows)}."
        )


def _too_few(found: int, needed: int, rows: np.ndarray, has_prior: bool) -> str:
    poses = f"{found} different pose{'s' if found != 1 else ''}"
    verb = "was" if found == 1 else "were"
    text = (
        f"{poses} {verb} found and {needed} are needed for "
        f"{'biases and scale factors' if has_prior else 'nine unknowns (bias, scale factor, non-orthogonality)'}: "
        f"hold the unit also with {_suggestion(rows)}"
    )
    if not has_prior and found >= 6:
        text += ", or give an earlier calibration of this unit with --prior, and six poses suffice"
    return text + "."


def _suggestion(rows: np.ndarray) -> str:
    information = np.zeros((9, 9))
    size = rows.shape[1]
    information[:size, :size] = rows.T @ rows
    return " and with ".join(describe_direction(up) for up in most_telling_poses(information))


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
