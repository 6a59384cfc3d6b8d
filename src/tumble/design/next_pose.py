"""What to record next, given what has been recorded, and when to stop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Matrices, Series, Square, Table, Vector, Vectors, inverted
from tumble.design.candidates import GROUPS, PARAMETERS, pose_rows
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.simulation.noise import TriadNoise

# Of what is not told yet: so uncertain before anything is recorded (relative, rad, over gravity).
IGNORANCE = 0.3
# Known to no better than this share of it, a parameter is not told.
OPEN = 0.1
# One more pose that takes less than this off every wanted sigma is not worth its time.
WORTH = 0.02
# The Allan deviation of flicker is this times B at its floor.
ALLAN_FLOOR = 0.664
# Parts of the covariance below this are round-off, of a diagonal scaled to one.
_FLAT = 1e-10


@dataclass(frozen=True, slots=True)
class NextPose:
    """A pose to record, with what is known after it.

    Attributes
    ----------
    up_b : (3,) unit vector up.
    sigmas : (9,) of `PARAMETERS` after it.
    value : the mean of the wanted variances after it.
    gain : by how much of it that goes down.
    """

    up_b: Vector
    sigmas: Series
    value: float
    gain: float


def known_from_calibration(calibration: Calibration) -> Square:
    """Return the information (9, 9) about `PARAMETERS` that an earlier calibration states.

    Gravity's uncertainty, which makes all scale factors uncertain alike, is taken out: no pose mends it.

    Parameters
    ----------
    calibration : with an accelerometer matrix and its covariance.

    Raises
    ------
    UsageError
        If it states no accelerometer.
    """
    triad = calibration.accelerometer
    if triad is None or triad.matrix is None:
        raise UsageError(
            "The calibration states no accelerometer matrix, and poses determine nothing of gyros alone."
        )
    matrix = np.array(triad.matrix, dtype=float)
    names = {name: index for index, name in enumerate(calibration.covariance_parameters)}
    move = np.zeros((len(PARAMETERS), len(names)))

    def put(parameter: int, name: str, factor: float) -> None:
        if name in names:
            move[parameter, names[name]] += factor

    for axis in range(3):
        put(axis, f"accelerometer.matrix[{axis},{axis}]", 1.0 / matrix[axis, axis])
        put(6 + axis, f"accelerometer.bias[{axis}]", 1.0 / matrix[axis, axis] / calibration.site.gravity)
    # The norm moves by yz u_x u_y, -zy u_x u_z, zx u_y u_z, whichever of the two sensors is off.
    for parameter, (first, second), sign in ((3, (0, 1), 1.0), (4, (0, 2), -1.0), (5, (1, 2), 1.0)):
        put(parameter, f"accelerometer.matrix[{first},{second}]", sign / matrix[first, first])
        put(parameter, f"accelerometer.matrix[{second},{first}]", sign / matrix[second, second])
    covariance = move @ calibration.covariance_matrix @ move.T
    if not np.all(np.diag(covariance) > 0.0):
        raise UsageError(
            "The calibration states no uncertainty of the accelerometers: it cannot say what is missing."
        )
    gravity = calibration.site.gravity_standard_uncertainty / calibration.site.gravity
    return _information(_without_gravity(covariance, gravity))


def known_from_holds(directions: Vectors, covariances: Matrices, scale: float) -> Square:
    """Return the information (9, 9) about `PARAMETERS` of holds that were recorded.

    Parameters
    ----------
    directions : (n, 3) unit vectors up, roughly.
    covariances : (n, 3, 3) of their mean specific forces, raw units squared.
    scale : raw units of one gravity.
    """
    variances = np.einsum("ka,kab,kb->k", directions, covariances, directions) / scale**2
    rows = pose_rows(directions) / np.sqrt(variances)[:, None]
    return np.asarray(rows.T @ rows, dtype=np.float64)


def find_next_poses(
    known: Square, directions: Vectors, sigma: float, wanted: np.ndarray, count: int = 3
) -> list[NextPose]:
    """Return the poses that leave the fewest parameters open and make the mean variance smallest, one after the other.

    Parameters
    ----------
    known : (9, 9) information about `PARAMETERS` so far; may be singular.
    directions : (n, 3) unit vectors up, of the poses to choose from.
    sigma : of a new hold's norm, over gravity.
    wanted : indices of the parameters that matter.
    count : how many.
    """
    total = known + np.eye(len(PARAMETERS)) / IGNORANCE**2
    rows = pose_rows(directions) / sigma
    found: list[NextPose] = []
    for _ in range(count):
        before = float(np.mean(np.diag(inverted(total))[wanted]))
        tried = total + rows[:, :, None] * rows[:, None, :]
        covariances = np.asarray(np.linalg.inv(tried), dtype=np.float64)
        variances: Table = np.diagonal(covariances, axis1=1, axis2=2)[:, wanted]
        values: Series = np.asarray(variances.mean(axis=1), dtype=np.float64)
        # Each pose takes one direction of ignorance away, whichever it is: how many parameters it closes decides.
        still_open = np.sum(variances > (OPEN * IGNORANCE) ** 2, axis=1)
        best = int(np.lexsort((np.round(values / before, 9), still_open))[0])
        total = tried[best]
        after, covariance = float(values[best]), inverted(total)
        found.append(NextPose(directions[best], np.sqrt(np.diag(covariance)), after, 1.0 - after / before))
    return found


def sigmas_so_far(known: Square) -> Series:
    """Return (9,) standard uncertainties of `PARAMETERS`; what is not told is infinite.

    Parameters
    ----------
    known : (9, 9) information; may be singular.
    """
    sigmas = np.sqrt(np.diag(inverted(known + np.eye(len(PARAMETERS)) / IGNORANCE**2)))
    return np.where(sigmas > OPEN * IGNORANCE, np.inf, sigmas)


def judge_stop(
    sigmas: Series,
    following: Sequence[NextPose],
    targets: dict[str, float],
    noise: TriadNoise,
    gravity: float,
    wanted: np.ndarray,
) -> tuple[bool, list[str]]:
    """Return whether to stop, and why, in sentences.

    Parameters
    ----------
    sigmas : (9,) of `PARAMETERS` now, infinite where nothing is told.
    following : what more poses would bring, see `find_next_poses`.
    targets : wished-for sigmas by group ("scale" relative, "misalignment" rad, "bias" m/s²).
    noise : of the accelerometers.
    gravity : m/s².
    wanted : indices of the parameters that matter.
    """
    untold = [PARAMETERS[index] for index in map(int, wanted) if not np.isfinite(sigmas[index])]
    if untold:
        return False, [f"Not determined yet: {', '.join(untold)}."]
    limits = {group: target / gravity if group == "bias" else target for group, target in targets.items()}
    off = [
        PARAMETERS[index]
        for group, limit in limits.items()
        for index in GROUPS[group]
        if index in wanted and sigmas[index] > limit
    ]
    if targets and not off:
        return True, ["All targets are reached: stop here."]
    words = [f"The target is not reached by {', '.join(off)}."] if off else []
    biases = [index for index in GROUPS["bias"] if index in wanted]
    floor = ALLAN_FLOOR * noise.bias_instability / gravity
    if biases and floor > 0.0 and float(np.max(sigmas[biases])) < 0.5 * floor:
        words.append(
            "The biases' means are known to less than half of what the biases themselves wander "
            f"({1e6 * floor:.2g} µg, the Allan floor): more poses serve scale factors and misalignments alone."
        )
        wanted = np.setdiff1d(wanted, biases)
        if wanted.size == 0:
            return True, words
    if following:
        gains = 1.0 - following[0].sigmas[wanted] / sigmas[wanted]
        if float(np.max(gains)) < WORTH:
            words.append(
                f"One more pose would take at most {100.0 * float(np.max(gains)):.1f} % off any standard uncertainty: "
                "it is hardly worth its time."
            )
            return not targets, words
    return False, words


def _without_gravity(covariance: Square, relative: float) -> Square:
    alike = np.zeros(covariance.shape[0])
    alike[list(GROUPS["scale"])] = relative
    without = covariance - np.outer(alike, alike)
    size = np.sqrt(np.diag(covariance))
    values = np.linalg.eigvalsh(without / np.outer(size, size))
    return without if values[0] > 0.0 else covariance


def _information(covariance: Square) -> Square:
    """Invert, with round-off of what a prior fixed kept from being infinitely sure."""
    size = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(size, size) + _FLAT * np.eye(covariance.shape[0])
    return np.asarray(inverted(correlation) / np.outer(size, size), dtype=np.float64)
