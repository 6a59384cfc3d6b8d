"""Whether there are enough poses, and different enough; if not, which one is missing."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.equations.triad_unknowns import BIAS, SCALE
from tumble.calibration.faces import FACE_ANGLE
from tumble.calibration.poses import distinct_poses
from tumble.calibration.singular_poses import describe_mending, describe_untold
from tumble.errors import ObservabilityError

# Of a rough solution in SI units: a sphere fitted to one pose, laid down again and again, is beyond these.
LARGEST_SCALE_ERROR = 0.3
LARGEST_BIAS = 3.0  # m/s²
WANTED = {
    9: "nine unknowns (bias, scale factor, non-orthogonality)",
    6: "biases and scale factors",
    3: "biases",
}


def require_poses(
    means: Vectors,
    force_unknowns: Series,
    *,
    has_prior: bool,
    unknowns: int = 9,
    factor: float | None = None,
) -> None:
    """Refuse poses that do not determine the accelerometers, and say what to record instead.

    Parameters
    ----------
    means : (holds, 3) mean raw specific force.
    force_unknowns : (12,) rough unknowns of the accelerometer triad.
    has_prior : the non-orthogonalities are known from an earlier calibration.
    unknowns : how many are to be estimated from the norms.
    factor : m/s² per raw unit, or None for counts, of which neither zero nor size is known.

    Raises
    ------
    ObservabilityError
        With the number of poses found and needed, or the combination that no pose determines.
    """
    needed = min(6, unknowns) if has_prior else unknowns
    up = _directions(means, force_unknowns, factor)
    held = up[distinct_poses(up)]
    if held.shape[0] < needed:
        raise ObservabilityError(_too_few(held, needed, has_prior))
    untold = describe_untold(held, needed)
    if untold:
        raise ObservabilityError(
            f"The {held.shape[0]} different poses {untold}. "
            f"Record again and hold the unit also with {describe_mending(held, needed)}{_serves(held, needed)}."
        )


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


def _too_few(held: Vectors, needed: int, has_prior: bool) -> str:
    found = held.shape[0]
    poses = f"{found} different pose{'s' if found != 1 else ''}"
    verb = "was" if found == 1 else "were"
    text = (
        f"{poses} {verb} found and {needed} are needed for "
        f"{WANTED[needed]}: "
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
            "--procedure multi-position --unknowns 6 takes the non-orthogonalities as nominal and gives biases and "
            "scale factors"
        )
    if np.all(np.max(held @ twenty_six_directions()[:6].T, axis=0) > np.cos(FACE_ANGLE)):
        options.append("--procedure six-position gives these and believes that the faces were levelled")
    return f"; or {', and '.join(options)}" if options else ""
