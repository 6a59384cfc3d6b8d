"""Where a body is, how fast and how it lies: at one instant, and over time."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from tumble.arrays import Matrices, Matrix, Quaternions, Series, Table, Vector, Vectors
from tumble.attitude import (
    angles_from_matrices,
    matrices_from_quaternions,
    matrix_from_angles,
    quaternion_from_matrix,
)
from tumble.earth import curvature_radii
from tumble.errors import UsageError
from tumble.records import dataclass

# Beyond it the local level's longitude turns too fast for any step.
HIGHEST_LATITUDE = float(np.radians(89.9))


@dataclass(frozen=True)
class NavigationState:
    """Position, velocity and attitude at one instant.

    Attributes
    ----------
    time : s.
    latitude, longitude : geodetic, rad.
    height : m above the ellipsoid.
    velocity_n : (3,) m/s against the Earth, north, east, down.
    C_nb : (3, 3) attitude, from b to n.
    """

    time: float
    latitude: float
    longitude: float
    height: float
    velocity_n: Vector
    C_nb: Matrix

    @staticmethod
    def from_angles(
        time: float,
        position: tuple[float, float, float],
        velocity_n: Vector,
        roll_pitch_yaw: Vector,
    ) -> NavigationState:
        """Return the state with its attitude by roll, pitch and yaw in rad (yaw from north to east).

        Parameters
        ----------
        time : s.
        position : latitude and longitude in rad, height in m.
        velocity_n : (3,) m/s.
        roll_pitch_yaw : (3,) rad; the body is turned by yaw about down, then pitch, then roll.
        """
        return NavigationState(time, *position, velocity_n, matrix_from_angles(roll_pitch_yaw))

    def beside(self, apart_b: Vector) -> NavigationState:
        """Return the state at another point of the body, that lies (3,) m in b beside this one, as fast as this one."""
        here = np.array([self.latitude]), np.array([self.longitude]), np.array([self.height])
        latitude, longitude, height = place_beside(here, (self.C_nb @ apart_b)[None])
        there = float(latitude[0]), float(longitude[0]), float(height[0])
        return NavigationState(self.time, *there, self.velocity_n, self.C_nb)

    @property
    def packed(self) -> Series:
        """(10,): latitude, longitude, height, velocity, quaternion of C_nb; as the compiled loops have it."""
        quaternion = quaternion_from_matrix(self.C_nb)
        return np.concatenate(
            [[self.latitude, self.longitude, self.height], self.velocity_n, quaternion], dtype=np.float64
        )

    @property
    def roll_pitch_yaw(self) -> Vector:
        """(3,) rad."""
        return angles_from_matrices(self.C_nb[None])[0]


@dataclass(frozen=True)
class Trajectory:
    """Position, velocity and attitude over time.

    Attributes
    ----------
    time : (instants,) s.
    latitude, longitude, height : (instants,) rad, rad, m.
    velocity_n : (instants, 3) m/s.
    quaternion_nb : (instants, 4) of C_nb, scalar last.
    """

    time: Series
    latitude: Series
    longitude: Series
    height: Series
    velocity_n: Vectors
    quaternion_nb: Quaternions

    def __len__(self) -> int:
        return int(self.time.shape[0])

    @property
    def position(self) -> tuple[Series, Series, Series]:
        """Latitude and longitude, rad, and height, m."""
        return self.latitude, self.longitude, self.height

    @property
    def C_nb(self) -> Matrices:
        """(instants, 3, 3) attitude."""
        return matrices_from_quaternions(self.quaternion_nb)

    @property
    def roll_pitch_yaw(self) -> Vectors:
        """(instants, 3) rad."""
        return angles_from_matrices(self.C_nb)

    @property
    def packed(self) -> Table:
        """(instants, 10), as `NavigationState.packed`."""
        return np.ascontiguousarray(
            np.hstack([np.column_stack(self.position), self.velocity_n, self.quaternion_nb])
        )

    def state(self, index: int) -> NavigationState:
        """Return the state at an index, negative ones from the end."""
        time, latitude, longitude, height = (float(x[index]) for x in (self.time, *self.position))
        C_nb = matrices_from_quaternions(self.quaternion_nb[index][None])[0]
        return NavigationState(time, latitude, longitude, height, self.velocity_n[index].copy(), C_nb)

    def rows(self, index: np.ndarray) -> Trajectory:
        """Return the instants of an index array."""
        return Trajectory(*(getattr(self, field.name)[index] for field in fields(self)))

    def points(self, lever_arm_b: Vector | Vectors) -> tuple[Series, Series, Series]:
        """Return latitude, longitude and height of a point fixed in the body.

        Parameters
        ----------
        lever_arm_b : (3,) or (instants, 3) m, from the IMU to the point.
        """
        return place_beside(self.position, (self.C_nb @ lever_arm_b[..., None])[..., 0])

    def errors_against(self, truth: Trajectory) -> tuple[Vectors, Vectors, Vectors]:
        """Return errors of position (m), velocity (m/s) and attitude (rad), (instants, 3) each, in n.

        This trajectory less the truth; of the attitude the rotation vector phi of ``C_nb = exp(-skew(phi))
        C_nb_true``, as in the filter's error states.

        Parameters
        ----------
        truth : at the same instants.

        Raises
        ------
        UsageError
            If its times are others.
        """
        if len(truth) != len(self) or not np.allclose(truth.time, self.time, rtol=0.0, atol=1e-6):
            raise UsageError(
                "Two trajectories are compared at the same instants: cut or interpolate them first."
            )
        from scipy.spatial.transform import Rotation

        position = position_differences(self.position, truth.position)
        turn = Rotation.from_quat(truth.quaternion_nb) * Rotation.from_quat(self.quaternion_nb).inv()
        return position, self.velocity_n - truth.velocity_n, turn.as_rotvec()


def place_beside(position: tuple[Series, Series, Series], apart_n: Vectors) -> tuple[Series, Series, Series]:
    """Return positions that lie beside others by (instants, 3) m in north, east, down.

    Parameters
    ----------
    position : latitude and longitude (rad), height (m).
    apart_n : some metres.
    """
    latitude, longitude, height = position
    meridian, across = curvature_radii(latitude)
    return (
        latitude + apart_n[:, 0] / (meridian + height),
        longitude + apart_n[:, 1] / ((across + height) * np.cos(latitude)),
        height - apart_n[:, 2],
    )


def position_differences(
    position: tuple[Series, Series, Series], reference: tuple[Series, Series, Series]
) -> Vectors:
    """Return (instants, 3) m in north, east, down: a position less another near it (below 10 km apart).

    Parameters
    ----------
    position, reference : latitude and longitude (rad), height (m).
    """
    meridian, across = curvature_radii(0.5 * (position[0] + reference[0]))
    height = 0.5 * (position[2] + reference[2])
    east = np.remainder(position[1] - reference[1] + np.pi, 2.0 * np.pi) - np.pi
    return np.column_stack(
        [
            (position[0] - reference[0]) * (meridian + height),
            east * (across + height) * np.cos(0.5 * (position[0] + reference[0])),
            reference[2] - position[2],
        ]
    )
