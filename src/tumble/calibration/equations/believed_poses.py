"""Which poses a protocol asks to be believed: of which holds, how, and how well."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Matrices, Series, Vectors
from tumble.protocol import HoldStep, Protocol, SpinStep, TurnStep
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.segmentation import Matching

# An exact pose is one to a microradian: a fifth of an arcsecond, below any table's.
LEAST_SIGMA = 1e-6  # rad
# A box propped up by hand determines nothing that gravity does not tell a hundred times better.
LOOSEST = 0.05  # rad


@dataclass(frozen=True)
class BelievedPoses:
    """Poses of holds, in the axes of the fixture that the unit was placed with.

    Attributes
    ----------
    hold : (poses,) index of the hold, ascending.
    up_f : (poses, 3) unit vector in the fixture's axes that points up.
    C_nf : (poses, 3, 3) nominal attitude; of unknown heading where `has_heading` is False.
    has_heading : (poses,) of bool.
    sigma : (poses,) rad about each axis.
    placed : hold -> the hold whose pose it is in still, for all that a believed pose is known of.
    """

    hold: np.ndarray
    up_f: Vectors
    C_nf: Matrices
    has_heading: np.ndarray
    sigma: Series
    placed: dict[int, int] = field(default_factory=dict[int, int])

    def of(self, first: int, last: int) -> np.ndarray:
        """Return the indices of the poses of holds `first` to `last` (half-open)."""
        return np.flatnonzero((self.hold >= first) & (self.hold < last))


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
