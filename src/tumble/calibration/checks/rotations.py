"""What the turns of a table say against one another: an angle misread, a way round that differs, a unit that slipped.

Both ways about an axis show a gyro the same angle, but for its bias, which the rests beside them show. And a table that
turns about the vertical leaves gravity where it was in the unit: what it moved by, the unit slipped.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Matrices, Matrix, Vector, Vectors, inverted
from tumble.calibration.checks.hold_wander import HoldWander
from tumble.calibration.closed_forms.rotation_pairs import RotationPair
from tumble.calibration.verdict import two_digits
from tumble.estimation.wander import covariance_about_the_mean
from tumble.records import dataclass
from tumble.segmentation import HoldMeans

# Chance that one axis of a right recording is told to contradict itself, and one rest to have slipped.
CONTRADICTION_FALSE_ALARM, SLIP_FALSE_ALARM = 0.01, 1e-4
# No gyro's scale factor differs by more between the two ways round: a twentieth of the worst scale factor errors.
LARGEST_ASYMMETRY = 0.003


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Two ways about one axis that do not show the same angle.

    Attributes
    ----------
    pair : which.
    off : rad, by how much more the one way shows than the other, beyond what the table's angles say.
    sigma : rad, of that, by noise and wander.
    """

    pair: int
    off: float
    sigma: float

    @property
    def is_certain(self) -> bool:
        """Whether chance is no explanation."""
        from scipy.special import ndtri

        return abs(self.off) > float(ndtri(1.0 - 0.5 * CONTRADICTION_FALSE_ALARM)) * self.sigma


def compare_ways(
    pairs: Sequence[RotationPair],
    axes_b: Sequence[Vector],
    inverse: Matrix,
    parts: dict[int, Vector],
    wander: HoldWander,
    means: HoldMeans,
) -> list[Contradiction]:
    """Return for each axis by how much its two ways differ.

    Parameters
    ----------
    pairs, axes_b : the rotations, and the axes that they were about.
    inverse : (3, 3) of the gyros' matrix, (rad/s) per raw.
    parts : of bias and Earth rate in each rotation, raw·s, by `Rotation.row`; along the axis the rests beside it tell.
    wander : of the gyros.
    means : of the holds.
    """
    found: list[Contradiction] = []
    for k, (pair, axis) in enumerate(zip(pairs, axes_b, strict=True)):
        weight = axis @ inverse
        off, variance = 0.0, 0.0
        share: list[float] = []
        limits: list[tuple[float, float]] = []
        white = np.zeros(3)
        total = 0.0
        for side, sign in ((pair.forward, 1.0), (pair.backward, -1.0)):
            for r in side:
                part = 1.0 / len(side)
                off += part * (float(weight @ (r.integral - parts[r.row])) - sign * abs(r.angle))
                variance += (part * r.angle_sigma) ** 2
                white += part**2 * np.diag(r.covariance)
                share.append(part * r.seconds)
                limits.append((r.middle - 0.5 * r.seconds, r.middle + 0.5 * r.seconds))
                total += part * r.seconds
        rests = sorted({h for r in pair.rotations for h in (r.before, r.after) if h is not None})
        if not rests:
            continue
        for h in rests:
            share.append(-total / len(rests))
            limits.append((float(wander.start[h]), float(wander.stop[h])))
            assert means.angular_rate_covariance is not None
            white += (total / len(rests)) ** 2 * np.diag(means.angular_rate_covariance[h])
        start, stop = np.array(limits).T
        shared = np.array(share)
        together = float(shared @ covariance_about_the_mean(start, stop, wander.span) @ shared)
        variance += float(weight**2 @ (white + wander.density * max(together, 0.0)))
        found.append(Contradiction(k, off, float(np.sqrt(variance))))
    return found


def about_ways(pairs: Sequence[RotationPair], found: Sequence[Contradiction]) -> tuple[list[str], list[str]]:
    """Return what is said of axes whose ways differ: cautions, and objections where no gyro differs by so much.

    Parameters
    ----------
    pairs, found : as given to `compare_ways`, and from there.
    """
    cautions: list[str] = []
    objections: list[str] = []
    for one in found:
        if not one.is_certain:
            continue
        pair = pairs[one.pair]
        steps = " and ".join(str(r.step + 1) for r in pair.rotations)
        off = abs(one.off)
        said = (
            f"The turns both ways about {pair.name} (steps {steps}) differ by {two_digits(float(np.degrees(off)))}°, "
            f"{two_digits(off / one.sigma)} times what noise and a wandering bias explain"
        )
        if off > LARGEST_ASYMMETRY * 0.5 * pair.angle:
            objections.append(
                f"{said}: an angle was misread, samples are missing, or the unit slipped. Look at the angles of these "
                "steps (`angle_deg`), and turn again."
            )
        else:
            cautions.append(
                f"{said}: an angle was misread, or the gyro's scale factor differs between the ways round. The scale "
                "factors' uncertainty includes it; look at the angles of these steps (`angle_deg`)."
            )
    return cautions, objections


def slipped(
    pairs: Sequence[RotationPair],
    force: Vectors,
    covariance: Matrices,
    inverse: Matrix,
    sigma: float,
) -> list[str]:
    """Name the turns about the vertical after which gravity lies elsewhere in the unit than before.

    Parameters
    ----------
    pairs : the rotations.
    force, covariance : (holds, 3), (holds, 3, 3) raw means of the accelerometers, wander included.
    inverse : (3, 3) of their matrix, (m/s²) per raw.
    sigma : rad, by how much the table's axis may depart from itself.
    """
    from scipy.special import chdtri

    turns = [
        (pair, r, r.before, r.after)
        for pair in pairs
        for r in pair.rotations
        if r.before is not None and r.after is not None
    ]
    sentences: list[str] = []
    for pair, r, before, after in turns:
        moved = inverse @ (force[after] - force[before])
        up = inverse @ (force[after] + force[before])
        size = 0.5 * float(np.linalg.norm(up))
        across = np.linalg.svd(up[None])[2][1:]
        spread = across @ inverse @ (covariance[after] + covariance[before]) @ inverse.T @ across.T
        spread = spread / size**2 + 2.0 * sigma**2 * np.eye(2)
        tilt = across @ moved / size
        if float(tilt @ inverted(spread) @ tilt) > float(chdtri(2, SLIP_FALSE_ALARM)):
            away = two_digits(float(np.degrees(np.linalg.norm(tilt))))
            sentences.append(
                f"Step {r.step + 1}, about {pair.name}: gravity lies {away}° elsewhere in the unit after the turn "
                "than before it. The unit slipped, or the table's axis is not plumb: fasten it, level the table, and "
                "turn again."
            )
    return sentences
