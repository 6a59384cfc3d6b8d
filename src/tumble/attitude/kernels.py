"""The hot loops of attitude integration, compiled by numba; called by `integration` and for rotation sequences."""

# pyright: reportUnknownMemberType=false, reportUntypedFunctionDecorator=false, reportMissingTypeStubs=false

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@numba.njit(cache=True, nogil=True, fastmath=False)
def integrate_segments(
    time: Floats,
    raw_rate: Floats,
    raw_force: Floats,
    gyro_inverse: Floats,
    gyro_bias: Floats,
    g_sensitivity: Floats,
    force_inverse: Floats,
    force_bias: Floats,
    starts: Integers,
    stops: Integers,
    C_start_end: Floats,
    gyro_sums: Floats,
) -> None:
    """Integrate each segment from sample `starts[k]` to sample `stops[k] - 1`.

    `C_start_end[k]` becomes the rotation from the last sample's body frame to the first one's;
    `gyro_sums[k, :, :, j]` the integral of C_start_t times regressor j, where the regressors are
    the corrected rate (0 to 2), one (3) and the corrected specific force (4 to 6).
    Between samples the rate is linear in time: the rotation vector is the mean rate times the step
    plus step^2/12 of the cross product of both rates (the coning term of a linear rate).
    """
    for k in range(starts.shape[0]):
        c00, c01, c02 = 1.0, 0.0, 0.0
        c10, c11, c12 = 0.0, 1.0, 0.0
        c20, c21, c22 = 0.0, 0.0, 1.0
        sums = np.zeros((3, 3, 7))
        now = np.zeros(7)
        before = np.zeros(7)
        middle = np.zeros(7)
        for i in range(starts[k], stops[k]):
            for axis in range(3):
                total = 0.0
                for j in range(3):
                    total += force_inverse[axis, j] * (raw_force[i, j] - force_bias[j])
                now[4 + axis] = total
            v0 = raw_rate[i, 0] - gyro_bias[0]
            v1 = raw_rate[i, 1] - gyro_bias[1]
            v2 = raw_rate[i, 2] - gyro_bias[2]
            for j in range(3):
                v0 -= g_sensitivity[0, j] * now[4 + j]
                v1 -= g_sensitivity[1, j] * now[4 + j]
                v2 -= g_sensitivity[2, j] * now[4 + j]
            for axis in range(3):
                now[axis] = (
                    gyro_inverse[axis, 0] * v0 + gyro_inverse[axis, 1] * v1 + gyro_inverse[axis, 2] * v2
                )
            now[3] = 1.0
            if i == starts[k]:
                before[:] = now
                continue
            step = time[i] - time[i - 1]
            half = 0.5 * step
            coning = step * step / 12.0
            for j in range(7):
                middle[j] = half * (before[j] + now[j])
            p = middle[0] + coning * (before[1] * now[2] - before[2] * now[1])
            q = middle[1] + coning * (before[2] * now[0] - before[0] * now[2])
            r = middle[2] + coning * (before[0] * now[1] - before[1] * now[0])
            square = p * p + q * q + r * r
            if square < 1e-4:
                sinc = 1.0 - square / 6.0 * (1.0 - square / 20.0)
                cosc = 0.5 - square / 24.0 * (1.0 - square / 30.0)
                half_sinc = 1.0 - square / 24.0 * (1.0 - square / 80.0)
                half_cosc = 0.5 - square / 96.0 * (1.0 - square / 120.0)
            else:
                angle = np.sqrt(square)
                sinc = np.sin(angle) / angle
                cosc = (1.0 - np.cos(angle)) / square
                half_angle = 0.5 * angle
                half_sinc = np.sin(half_angle) / half_angle
                half_cosc = (1.0 - np.cos(half_angle)) / (half_angle * half_angle)
            # Middle of the step, for the sums: half of the rotation vector.
            hp, hq, hr, hs = 0.5 * p, 0.5 * q, 0.5 * r, 0.25 * square
            m00, m01, m02, m10, m11, m12, m20, m21, m22 = _multiply(
                c00, c01, c02, c10, c11, c12, c20, c21, c22, hp, hq, hr, hs, half_sinc, half_cosc
            )
            for j in range(7):
                x = middle[j]
                sums[0, 0, j] += m00 * x
                sums[0, 1, j] += m01 * x
                sums[0, 2, j] += m02 * x
                sums[1, 0, j] += m10 * x
                sums[1, 1, j] += m11 * x
                sums[1, 2, j] += m12 * x
                sums[2, 0, j] += m20 * x
                sums[2, 1, j] += m21 * x
                sums[2, 2, j] += m22 * x
            c00, c01, c02, c10, c11, c12, c20, c21, c22 = _multiply(
                c00, c01, c02, c10, c11, c12, c20, c21, c22, p, q, r, square, sinc, cosc
            )
            before[:] = now
        C_start_end[k, 0, 0], C_start_end[k, 0, 1], C_start_end[k, 0, 2] = c00, c01, c02
        C_start_end[k, 1, 0], C_start_end[k, 1, 1], C_start_end[k, 1, 2] = c10, c11, c12
        C_start_end[k, 2, 0], C_start_end[k, 2, 1], C_start_end[k, 2, 2] = c20, c21, c22
        gyro_sums[k] = sums


@numba.njit(cache=True, nogil=True, inline="always")
def _multiply(
    c00,
    c01,
    c02,
    c10,
    c11,
    c12,
    c20,
    c21,
    c22,
    p,
    q,
    r,
    square,
    sinc,
    cosc,  # type: ignore[no-untyped-def]
):
    """Return C times the Rodrigues matrix of (p, q, r), element by element."""
    d = 1.0 - cosc * square
    r00, r11, r22 = d + cosc * p * p, d + cosc * q * q, d + cosc * r * r
    r01, r10 = cosc * p * q - sinc * r, cosc * p * q + sinc * r
    r02, r20 = cosc * p * r + sinc * q, cosc * p * r - sinc * q
    r12, r21 = cosc * q * r - sinc * p, cosc * q * r + sinc * p
    return (
        c00 * r00 + c01 * r10 + c02 * r20,
        c00 * r01 + c01 * r11 + c02 * r21,
        c00 * r02 + c01 * r12 + c02 * r22,
        c10 * r00 + c11 * r10 + c12 * r20,
        c10 * r01 + c11 * r11 + c12 * r21,
        c10 * r02 + c11 * r12 + c12 * r22,
        c20 * r00 + c21 * r10 + c22 * r20,
        c20 * r01 + c21 * r11 + c22 * r21,
        c20 * r02 + c21 * r12 + c22 * r22,
    )


@numba.njit(cache=True, nogil=True)
def average_windows(
    time: Floats,
    raw_rate: Floats,
    raw_force: Floats,
    gyro_inverse: Floats,
    gyro_bias: Floats,
    force_inverse: Floats,
    force_bias: Floats,
    starts: Integers,
    stops: Integers,
    backward: bool,
    means: Floats,
) -> None:
    """Average the corrected specific force of each window, every sample turned to the window's edge.

    The edge is the last sample, or the first if `backward`. Inside a window the unit is all but at
    rest, so that a rotation vector of first order in each step, kept by composition, suffices.
    """
    for k in range(starts.shape[0]):
        c00, c01, c02 = 1.0, 0.0, 0.0
        c10, c11, c12 = 0.0, 1.0, 0.0
        c20, c21, c22 = 0.0, 0.0, 1.0
        s0, s1, s2 = 0.0, 0.0, 0.0
        w = np.zeros(3)
        last = np.zeros(3)
        f = np.zeros(3)
        count = stops[k] - starts[k]
        for n in range(count):
            i = starts[k] + n if backward else stops[k] - 1 - n
            for axis in range(3):
                rate = 0.0
                force = 0.0
                for j in range(3):
                    rate += gyro_inverse[axis, j] * (raw_rate[i, j] - gyro_bias[k, j])
                    force += force_inverse[axis, j] * (raw_force[i, j] - force_bias[j])
                w[axis] = rate
                f[axis] = force
            if n > 0:
                # Positive going forward from the edge, negative going back to it.
                step = time[i] - time[i - 1] if backward else time[i] - time[i + 1]
                p = 0.5 * step * (w[0] + last[0])
                q = 0.5 * step * (w[1] + last[1])
                r = 0.5 * step * (w[2] + last[2])
                square = p * p + q * q + r * r
                sinc = 1.0 - square / 6.0
                cosc = 0.5 - square / 24.0
                c00, c01, c02, c10, c11, c12, c20, c21, c22 = _multiply(
                    c00, c01, c02, c10, c11, c12, c20, c21, c22, p, q, r, square, sinc, cosc
                )
            s0 += c00 * f[0] + c01 * f[1] + c02 * f[2]
            s1 += c10 * f[0] + c11 * f[1] + c12 * f[2]
            s2 += c20 * f[0] + c21 * f[1] + c22 * f[2]
            last[:] = w
        means[k, 0] = s0 / count
        means[k, 1] = s1 / count
        means[k, 2] = s2 / count


@numba.njit(cache=True, nogil=True, fastmath={"contract", "arcp", "nsz"})
def transform_sequence(
    rate: Floats,
    force: Floats,
    step: float,
    earth: Floats,
    first_weights: Floats,
    first: int,
    last_weights: Floats,
    last: int,
    averages: Floats,
    C_start_end: Floats,
) -> None:
    """Carry `rate` from sample to sample and average `force` in the frame of the start over two windows.

    `rate` (samples, 3) rad/s is the mean over each interval of `step` s; `earth` (3,) rad/s turns the frame of the
    start. `averages` (2, 3) receives the weighted sums over the windows that begin at samples `first` and, not
    before that one's end, `last`; `C_start_end` (3, 3) the attitude at the end.
    """
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    averages[:, :] = 0.0
    ex, ey, ez = earth[0], earth[1], earth[2]
    half = 0.5 * step
    begin = 0
    for piece in range(5):
        # before the first window, in it, between the two, in the last, after it
        window, at, weights, stop = -1, 0, first_weights, rate.shape[0]
        if piece == 0:
            stop = first
        elif piece == 1:
            window, at, stop = 0, first, first + first_weights.shape[0]
        elif piece == 2:
            stop = last
        elif piece == 3:
            window, at, weights, stop = 1, last, last_weights, last + last_weights.shape[0]
        middle = at + 0.5 * (weights.shape[0] - 1)
        # sums of the force with the powers of the time from the window's middle
        s00, s01, s02, s10, s11, s12 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        s20, s21, s22, s30, s31, s32 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(begin, min(stop, rate.shape[0])):
            hx, hy, hz = half * rate[k, 0], half * rate[k, 1], half * rate[k, 2]
            s = hx * hx + hy * hy + hz * hz
            if s < 1e-3:
                # sin(h)/h and cos(h) to 1e-17 below 0.03 rad of half an angle
                sinc = 1.0 + s * (-1.0 / 6 + s * (1.0 / 120 - s * (1.0 / 5040)))
                cosine = 1.0 + s * (-0.5 + s * (1.0 / 24 - s * (1.0 / 720 - s * (1.0 / 40320))))
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
            if window >= 0:
                weight = weights[k - at]
                fx, fy, fz = weight * force[k, 0], weight * force[k, 1], weight * force[k, 2]
                # q f q*, of a unit quaternion
                tx, ty, tz = 2.0 * (y * fz - z * fy), 2.0 * (z * fx - x * fz), 2.0 * (x * fy - y * fx)
                vx = fx + w * tx + y * tz - z * ty
                vy = fy + w * ty + z * tx - x * tz
                vz = fz + w * tz + x * ty - y * tx
                t = (k - middle) * step
                s00, s01, s02 = s00 + vx, s01 + vy, s02 + vz
                vx, vy, vz = vx * t, vy * t, vz * t
                s10, s11, s12 = s10 + vx, s11 + vy, s12 + vz
                vx, vy, vz = vx * t, vy * t, vz * t
                s20, s21, s22 = s20 + vx, s21 + vy, s22 + vz
                s30, s31, s32 = s30 + vx * t, s31 + vy * t, s32 + vz * t
        begin = max(begin, stop)
        if window < 0:
            continue
        # Back by what the Earth has turned since the start: by a series from the middle of the window, whose fourth
        # power is nothing (1e-8 of gravity in ten minutes), and from there to the start by exp(-[earth t]).
        ux, uy, uz = (
            s20 - (ey * s32 - ez * s31) / 3.0,
            s21 - (ez * s30 - ex * s32) / 3.0,
            s22 - (ex * s31 - ey * s30) / 3.0,
        )
        ux, uy, uz = (
            s10 - 0.5 * (ey * uz - ez * uy),
            s11 - 0.5 * (ez * ux - ex * uz),
            s12 - 0.5 * (ex * uy - ey * ux),
        )
        vx, vy, vz = s00 - (ey * uz - ez * uy), s01 - (ez * ux - ex * uz), s02 - (ex * uy - ey * ux)
        t = (middle + 0.5) * step
        rx, ry, rz = ex * t, ey * t, ez * t
        angle = rx * rx + ry * ry + rz * rz
        one, two = 1.0 - angle / 6.0 + angle * angle / 120.0, 0.5 - angle / 24.0 + angle * angle / 720.0
        cx, cy, cz = ry * vz - rz * vy, rz * vx - rx * vz, rx * vy - ry * vx
        averages[window, 0] = vx - one * cx + two * (ry * cz - rz * cy)
        averages[window, 1] = vy - one * cy + two * (rz * cx - rx * cz)
        averages[window, 2] = vz - one * cz + two * (rx * cy - ry * cx)
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
