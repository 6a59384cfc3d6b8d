"""Rotations and the integration of angular rate to attitude.

``C_ab`` turns the components of a vector from frame b to frame a: ``v_a = C_ab @ v_b``. Quaternions
have the scalar last, as in scipy. A rotation vector ``phi`` stands for ``exp(skew(phi))``.
"""

from tumble.attitude.integration import IntegratedTurns, Inverse, integrate_turns
from tumble.attitude.rotations import (
    angle_between,
    find_nearest_rotation,
    matrix_from_rotation_vector,
    rotation_between,
    rotation_vector_from_matrix,
    skew,
    tangent_basis,
)

__all__ = [
    "IntegratedTurns",
    "Inverse",
    "angle_between",
    "find_nearest_rotation",
    "integrate_turns",
    "matrix_from_rotation_vector",
    "rotation_between",
    "rotation_vector_from_matrix",
    "skew",
    "tangent_basis",
]
