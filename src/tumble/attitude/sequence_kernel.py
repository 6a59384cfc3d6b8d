"""The compiled loop over a rotation sequence: attitude from the start, and the specific force in its frame."""

from __future__ import annotations

import numpy as np
from numba import njit, types

_ROWS = types.float64[:, ::1]
_ROW = types.float64[::1]


@njit(
    [types.void(_ROWS, _ROWS, types.float64, _ROW, _ROW, types.int64, _ROW, types.int64, _ROWS, _ROWS)],
    cache=True,
    nogil=True,
    fastmath={"contract", "arcp", "nsz"},
)
def transform_sequence(
    rate: np.ndarray,
    force: np.ndarray,
    step: float,
    earth: np.ndarray,
    first_weights: np.ndarray,
    first: int,
    last_weights: np.ndarray,
    last: int,
    averages: np.ndarray,
    C_start_end: np.ndarray,
) -> None:
    """Carry `rate` from sample to sample and average `force` in the frame of the start over two windows.

    `rate` (samples, 3) rad/s is the mean over each interval of `step` s; `earth` (3,) rad/s turns the frame of the
    start. `averages` (2, 3) receives the weighted sums over the windows that begin at samples `first` and `last`;
    `C_start_end` (3, 3) the attitude at the end.
    """
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    averages[:, :] = 0.0
    first_stop, last_stop = first + first_weights.shape[0], last + last_weights.shape[0]
    ex, ey, ez = earth[0], earth[1], earth[2]
    half = 0.5 * step
    for k in range(rate.shape[0]):
        hx, hy, hz = half * rate[k, 0], half * rate[k, 1], half * rate[k, 2]
        s = hx * hx + hy * hy + hz * hz
        if s < 0.04:
            # sin(h)/h and cos(h) to 1e-17 below 0.2 rad of half an angle
            sinc = 1.0 + s * (
                -1.0 / 6 + s * (1.0 / 120 + s * (-1.0 / 5040 + s * (1.0 / 362880 - s / 39916800)))
            )
            cosine = 1.0 + s * (-0.5 + s * (1.0 / 24 + s * (-1.0 / 720 + s * (1.0 / 40320 - s / 3628800))))
        else:
            h = np.sqrt(s)
            sinc, cosine = np.sin(h) / h, np.cos(h)
        hx *= sinc
        hy *= sinc
        hz *= sinc
        a = w * cosine - x * hx - y * hy - z * hz
        b = w * hx + x * cosine + y * hz - z * hy
        c = w * hy - x * hz + y * cosine + z * hx
        d = w * hz + x * hy - y * hx + z * cosine
        w, x, y, z = a, b, c, d
        which = -1
        weight = 0.0
        if first <= k < first_stop:
            which, weight = 0, first_weights[k - first]
        elif last <= k < last_stop:
            which, weight = 1, last_weights[k - last]
        if which >= 0:
            fx, fy, fz = force[k, 0], force[k, 1], force[k, 2]
            # q f q*, of a unit quaternion
            tx, ty, tz = 2.0 * (y * fz - z * fy), 2.0 * (z * fx - x * fz), 2.0 * (x * fy - y * fx)
            vx = fx + w * tx + y * tz - z * ty
            vy = fy + w * ty + z * tx - x * tz
            vz = fz + w * tz + x * ty - y * tx
            # back by what the Earth has turned since the start: exp(-[earth t])
            t = (k + 0.5) * step
            rx, ry, rz = ex * t, ey * t, ez * t
            angle = rx * rx + ry * ry + rz * rz
            one, two = 1.0 - angle / 6.0, 0.5 - angle / 24.0
            cx, cy, cz = ry * vz - rz * vy, rz * vx - rx * vz, rx * vy - ry * vx
            averages[which, 0] += weight * (vx - one * cx + two * (ry * cz - rz * cy))
            averages[which, 1] += weight * (vy - one * cy + two * (rz * cx - rx * cz))
            averages[which, 2] += weight * (vz - one * cz + two * (rx * cy - ry * cx))
    norm = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w * norm, x * norm, y * norm, z * norm
    C_start_end[0, 0], C_start_end[0, 1], C_start_end[0, 2] = (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
    )
    C_start_end[1, 0], C_start_end[1, 1], C_start_end[1, 2] = (
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
    )
    C_start_end[2, 0], C_start_end[2, 1], C_start_end[2, 2] = (
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
