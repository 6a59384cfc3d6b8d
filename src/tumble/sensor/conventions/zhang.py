"""Zhang et al.'s scale factors, misalignments and inter-triad angles (2010, (1) to (6)), in two readings.

``raw = K T true + bias`` in the frame ``accelerometer-x`` (their p), and for the gyros
``raw = K T R true + bias`` with T in the gyros' own frame o and R = R_p^o the rotation between the
triads. The angles of T, of which y leans by yz towards x, and z by zy and zx,

    T = [[  1,      0,     0],
         [  yz,     1,     0],        (3), (5) as printed: small angles
         [ -zy,     zx,    1]]

are *exactly* the arcs of the direction cosines of sensing axes that have unit length:

    T = [[  1,           0,                 0                                     ],
         [  sin yz,      cos yz,            0                                     ],
         [ -sin zy,      sin zx,            sqrt(1 - sin²zy - sin²zx)             ]]

The exact reading is tumble's own; a scale factor is then the length of a sensor's row. The printed
reading takes the diagonal of K T for it, which understates the scale by half the square of the angles
(1.3 ppm at 330″). The sign of yz is the opposite of Shin and El-Sheimy's.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Complex = npt.NDArray[Any]


def matrix_from_zhang(
    scale: Complex, angles: Complex, reading: Literal["exact", "small-angle"] = "exact"
) -> Complex:
    """Return K T, lower triangular.

    Parameters
    ----------
    scale : (3,) raw per SI unit.
    angles : (3,) yz, zy, zx, rad.
    reading : of T, with axes of unit length or as printed.
    """
    yz, zy, zx = angles if reading == "small-angle" else np.sin(angles)
    one, zero = yz * 0.0 + 1.0, yz * 0.0
    diagonal = (one, one)
    if reading == "exact":
        diagonal = (np.sqrt(one - yz * yz), np.sqrt(one - zy * zy - zx * zx))
    axes = np.array([[one, zero, zero], [yz, diagonal[0], zero], [-zy, zx, diagonal[1]]])
    return scale[:, None] * axes


def inter_triad_rotation(angles: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return R_p^o for the inter-triad angles, a rotation vector: ``vector_o = R @ vector_p``.

    At the paper's angles (-600″, 120″, -420″) its (6), I + [θ×], and Euler angles differ from it by up to 0.6″.

    Parameters
    ----------
    angles : (3,) θx, θy, θz, rad.
    """
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angles).as_matrix()


def inter_triad_angles(rotation: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the inter-triad angles θx, θy, θz (rad) of R_p^o: the inverse.

    Parameters
    ----------
    rotation : (3, 3).
    """
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_rotvec()
