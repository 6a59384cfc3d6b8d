"""imu_tk's convention (``*.calib`` files): ``corrected = T @ K @ (raw - B)``.

Read from its source (calibration.h). K is diagonal, SI per raw unit; B is subtracted (the ICRA 2014
paper adds it: the code and its files are right); T has a unit diagonal,

    T = [[1, -mis_yz, mis_zy], [mis_xz, 1, -mis_zx], [-mis_xy, mis_yx, 1]]

with mis_xz = mis_xy = mis_yx = 0 for the accelerometer. Its forward matrix inv(T K) is therefore
upper triangular: imu_tk's body frame is our ``accelerometer-z``, and the gyro's T holds the rotation
between the triads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.sensor.gauge import inverse

Complex = npt.NDArray[Any]

MISALIGNMENTS = ("misYZ", "misZY", "misZX", "misXZ", "misXY", "misYX")


def matrix_from_imu_tk(misalignments: Complex, scale: Complex) -> Complex:
    """Return our forward matrix (raw per SI) of imu_tk's six misalignments and three scales.

    `misalignments` are in the order misYZ, misZY, misZX, misXZ, misXY, misYX.
    """
    yz, zy, zx, xz, xy, yx = misalignments
    one = yz * 0.0 + 1.0
    T = np.array([[one, -yz, zy], [xz, one, -zx], [-xy, yx, one]])
    return inverse(T * scale[None, :])
