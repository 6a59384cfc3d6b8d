from .integration import (
    IntegratedTurns as IntegratedTurns,
    Inverse as Inverse,
    average_at_edge as average_at_edge,
    integrate_turns as integrate_turns,
)
from .kernels import transform_sequence as transform_sequence
from .rotations import (
    analytic_rotation_vector as analytic_rotation_vector,
    angle_between as angle_between,
    angles_from_matrices as angles_from_matrices,
    find_nearest_rotation as find_nearest_rotation,
    left_jacobian as left_jacobian,
    matrices_from_quaternions as matrices_from_quaternions,
    matrices_from_rotation_vectors as matrices_from_rotation_vectors,
    matrix_from_angles as matrix_from_angles,
    matrix_from_rotation_vector as matrix_from_rotation_vector,
    matrix_from_turn as matrix_from_turn,
    quaternion_from_matrix as quaternion_from_matrix,
    rotation_angle as rotation_angle,
    rotation_between as rotation_between,
    rotation_vector_from_matrix as rotation_vector_from_matrix,
    rotation_vectors_from_matrices as rotation_vectors_from_matrices,
    skew as skew,
    skews as skews,
    tangent_basis as tangent_basis,
    twenty_six_directions as twenty_six_directions,
)
