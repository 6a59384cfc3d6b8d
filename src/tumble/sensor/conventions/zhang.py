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

from typing import Any

import numpy as np
import numpy.typing as npt

Complex = npt.NDArray[Any]

READINGS = ("exact", "small-angle")
"""How T is read: axes of unit length, or as printed."""

FORMS = ("rotation-vector", "small-angle", "euler")
"""How R is read: exponential of [θ×], I + [θ×] as (6) prints it, or turns about x, then y, then z."""


def matrix_from_zhang(scale: Complex, angles: Complex, reading: str = "exact") -> Complex:
    """Return K T, lower triangular.

    Parameters
    ----------
    scale : (3,) raw per SI unit.
    angles : (3,) yz, zy, zx, rad.
    reading : one of `READINGS`.

    Raises
    ------
    ValueError
        If there is no such reading.
    """
    _check(reading, READINGS)
    yz, zy, zx = angles if reading == "small-angle" else np.sin(angles)
    one, zero = yz * 0.0 + 1.0, yz * 0.0
    diagonal = (one, one)
    if reading == "exact":
        diagonal = (np.sqrt(one - yz * yz), np.sqrt(one - zy * zy - zx * zx))
    axes = np.array([[one, zero, zero], [yz, diagonal[0], zero], [-zy, zx, diagonal[1]]])
    return scale[:, None] * axes


def zhang_from_matrix(matrix: Complex, reading: str = "exact") -> tuple[Complex, Complex]:
    """Return (scale factors, angles yz, zy, zx) of a lower-triangular matrix: the inverse.

    Parameters
    ----------
    matrix : (3, 3) K T.
    reading : one of `READINGS`.

    Raises
    ------
    ValueError
        If there is no such reading, or the matrix is not lower triangular.
    """
    _check(reading, READINGS)
    upper = np.abs(np.real(matrix[np.triu_indices(3, 1)]))
    # 1e-9 of the diagonal: a frame change leaves round-off there, a forgotten one 1e-4 and more.
    if np.any(upper > 1e-9 * np.max(np.abs(np.real(matrix)))):
        raise ValueError("the matrix is not lower triangular: change the frame to accelerometer-x first")
    if reading == "small-angle":
        scale = np.diag(matrix)
        axes = matrix / scale[:, None]
        return scale, np.array([axes[1, 0], -axes[2, 0], axes[2, 1]])
    scale = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
    axes = matrix / scale[:, None]
    return scale, np.arcsin(np.array([axes[1, 0], -axes[2, 0], axes[2, 1]]))


def inter_triad_rotation(angles: npt.NDArray[np.float64], form: str = "rotation-vector") -> Complex:
    """Return R_p^o for the inter-triad angles: ``vector_o = R @ vector_p``.

    Parameters
    ----------
    angles : (3,) θx, θy, θz, rad.
    form : one of `FORMS`; "small-angle" gives (6), which is no rotation to the second order.

    Raises
    ------
    ValueError
        If there is no such form.
    """
    from scipy.spatial.transform import Rotation

    _check(form, FORMS)
    x, y, z = angles
    if form == "small-angle":
        return np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])  # (6)
    if form == "euler":
        return Rotation.from_euler("xyz", angles).as_matrix()
    return Rotation.from_rotvec(angles).as_matrix()


def inter_triad_angles(
    rotation: npt.NDArray[np.float64], form: str = "rotation-vector"
) -> npt.NDArray[np.float64]:
    """Return the inter-triad angles θx, θy, θz (rad) of R_p^o: the inverse.

    Parameters
    ----------
    rotation : (3, 3).
    form : one of `FORMS`. Of a rotation "small-angle" takes half the differences across the diagonal.

    Raises
    ------
    ValueError
        If there is no such form.

    Notes
    -----
    At the paper's angles (-600″, 120″, -420″) the forms differ by up to 0.6″.
    """
    from scipy.spatial.transform import Rotation

    _check(form, FORMS)
    if form == "small-angle":
        r = rotation
        return 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    turned = Rotation.from_matrix(rotation)
    return turned.as_euler("xyz") if form == "euler" else turned.as_rotvec()


def _check(name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise ValueError(f"{name!r} is none of {', '.join(names)}")
