"""Sets of poses, what they tell of an accelerometer triad, and which sets tell too little.

A pose at rest tells one number, the norm of the specific force. Of nine unknowns (scale factors,
misalignments, biases) to first order it tells

    norm - g = g (u . scale u + yz u_x u_y - zy u_x u_z + zx u_y u_z) + u . bias     (relative scale errors)

with u the unit vector up, whatever the azimuth; the angles are those that Zhang et al. print. What a set
is worth is in the inverse of the sum of the squares of these rows, before anything is recorded.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square, Vectors, inverted
from tumble.calibration.poses import describe_mending, describe_untold
from tumble.design.candidates import pose_rows
from tumble.errors import ObservabilityError
from tumble.records import dataclass
from tumble.units import STANDARD_GRAVITY

EDGE_PLANES = ((0, 1), (0, 2), (1, 2))
NINE_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 9, 11)
"""Chatfield's numbers of the nine poses of Zhang et al. (2010)."""
OTHER_EDGE_NUMBERS = (8, 10, 12, 13, 14, 15, 16, 17, 18)
"""The edges that the nine leave: the set of table 5 that is singular."""


@dataclass(frozen=True, slots=True)
class PredictedSigma:
    """Standard deviations of the nine unknowns.

    Attributes
    ----------
    scale : (3,) relative, of x, y, z.
    misalignment : (3,) yz, zy, zx, rad.
    bias : (3,) of x, y, z, m/s².
    """

    scale: Series
    misalignment: Series
    bias: Series


def chatfield_orientations(edge_signs: tuple[int, int, int] = (1, 1, 1)) -> Vectors:
    """Return (18, 3): what points up in orientations 1 to 18, six faces and twelve edges.

    Parameters
    ----------
    edge_signs : of the edges 2, 4 and 6, in the planes of x and y, x and z, y and z: the product of the
        signs of the two sensors. +1 is an edge between two positive axes, -1 one between +first and
        -second.

    Raises
    ------
    ValueError
        If a sign is none.

    Notes
    -----
    Zhang et al. (2010) take the numbers from Chatfield (1997); their table 1, which would show them, is
    lost from the scan. Their text fixes this much: 2, 4, 6, 8, 10, 12 to 18 are those in which the
    sensitivity to misalignment is greatest, so edges; the odd numbers to 11 are the faces; and 1 to 7, 9
    and 11 are six faces with one edge in each plane, so 2, 4 and 6 are those. Which face is 1 and what
    the signs are, it does not. Here 1, 3, ... 11 are x up, x down, y up, and so on to z down; 8, 10 and
    12 the edges with the other sign, first axis up; 13 to 18 those with the first axis down.
    """
    if any(sign not in (1, -1) for sign in edge_signs):
        raise ValueError(f"signs are 1 or -1, not {edge_signs}")
    orientations = np.zeros((18, 3))
    for axis in range(3):
        orientations[4 * axis, axis], orientations[4 * axis + 2, axis] = 1.0, -1.0
    for plane, (axes, sign) in enumerate(zip(EDGE_PLANES, edge_signs, strict=True)):
        numbers = (2 + 2 * plane, 8 + 2 * plane, 13 + 2 * plane, 14 + 2 * plane)
        for number, parts in zip(numbers, ((1, sign), (1, -sign), (-1, 1), (-1, -1)), strict=True):
            orientations[number - 1, axes] = np.sqrt(0.5) * np.array(parts)
    return orientations


def paper_nine(edge_signs: tuple[int, int, int] = (1, 1, 1)) -> Vectors:
    """Return (9, 3): the nine poses of Zhang et al. (2010), faces and an edge in each plane.

    Parameters
    ----------
    edge_signs : as of `chatfield_orientations`.
    """
    return chatfield_orientations(edge_signs)[[number - 1 for number in NINE_NUMBERS]]


def information(
    directions: Vectors, sigma: float | Series = 1.0, gravity: float = STANDARD_GRAVITY
) -> Square:
    """Return the information (9, 9) about scale, misalignment (yz, zy, zx) and bias.

    Parameters
    ----------
    directions : (n, 3) unit vectors up in the frame accelerometer-x.
    sigma : of the norm of a dwell's mean, m/s²; one, or one a pose. White noise of density d over T
        seconds has d / sqrt(T).
    gravity : m/s².
    """
    rows = pose_rows(directions)
    rows[:, :6] *= gravity
    weighted = rows / np.broadcast_to(np.asarray(sigma, dtype=float), directions.shape[:1])[:, None]
    return weighted.T @ weighted


def predict_sigma(
    directions: Vectors, sigma: float | Series, gravity: float = STANDARD_GRAVITY
) -> PredictedSigma:
    """Return the standard deviations that a set of poses promises: the Cramér-Rao bound of norms at rest.

    Parameters
    ----------
    directions, sigma, gravity : as of `information`.

    Raises
    ------
    ObservabilityError
        If the poses do not tell all nine, with what they do not tell and which pose to add.

    Notes
    -----
    Of the paper's nine, with σ the dwell's relative to gravity: scale and bias σ/√2, misalignment √7 σ.
    """
    refusal = explain_pose_set(directions)
    if refusal:
        raise ObservabilityError(refusal)
    sigmas = np.sqrt(np.diag(inverted(information(directions, sigma, gravity))))
    return PredictedSigma(sigmas[:3], sigmas[3:6], sigmas[6:])


def explain_pose_set(directions: Vectors) -> str:
    """Return, in sentences, what a set does not tell and which poses would mend it; nothing if it determines all.

    Parameters
    ----------
    directions : (n, 3) unit vectors up.
    """
    untold = describe_untold(directions)
    if not untold:
        return ""
    poses = "pose does" if len(directions) == 1 else "poses do"
    untold = untold.removeprefix("do")
    return f"The {len(directions)} {poses}{untold}. Add {describe_mending(directions)}."
