"""The error-state filter, compiled: propagation by blocks of samples, sequential updates in Joseph's form.

Error states, estimate less truth: position (m: north, east, down), velocity (m/s), attitude phi (rad, in n, of
``C_nb_estimate = exp(-skew(phi)) C_nb``), then the sensor states in the order of their terms. Sensor states have
no dynamics but a decay of their own, so that the transition is dense in its first nine rows only. It is the
product of ``1 + F dt`` over the samples of a block; the noise enters half before and half after.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit, types

from tumble.earth.gravity import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS
from tumble.earth.site import EARTH_RATE
from tumble.navigation.kernels import advance, ends_of_interval

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Flags: TypeAlias = npt.NDArray[np.bool_]

_A, _E2, _W = SEMI_MAJOR_AXIS, ECCENTRICITY_SQUARED, EARTH_RATE
_G = 9.81
_FAST = {"contract", "nsz", "arcp", "reassoc"}
# what a sensor state is of
ACCELEROMETER, GYROSCOPE, G_SENSITIVITY, LEVER_ARM, TIME_OFFSET = 0, 1, 2, 3, 4

_ROW = types.float64[::1]
_ROWS = types.float64[:, ::1]
_STACK = types.float64[:, :, ::1]
_INDEX = types.int64[::1]
_FLAGS = types.boolean[:, ::1]
_READ_ROW = types.Array(types.float64, 1, "C", readonly=True)
_READ_ROWS = types.Array(types.float64, 2, "C", readonly=True)


@njit(cache=True, nogil=True)
def _inverse(matrix, inverse):
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    g, h, i = matrix[2, 0], matrix[2, 1], matrix[2, 2]
    over = 1.0 / (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = (
        (e * i - f * h) * over,
        (c * h - b * i) * over,
        (b * f - c * e) * over,
    )
    inverse[1, 0], inverse[1, 1], inverse[1, 2] = (
        (f * g - d * i) * over,
        (a * i - c * g) * over,
        (c * d - a * f) * over,
    )
    inverse[2, 0], inverse[2, 1], inverse[2, 2] = (
        (d * h - e * g) * over,
        (b * g - a * h) * over,
        (a * e - b * d) * over,
    )


@njit(cache=True, nogil=True)
def gather_sensors(
    sensor: Floats,
    kind: Integers,
    row: Integers,
    column: Integers,
    correction: Floats,
    lever: Floats,
    nominal: Floats,
) -> float:
    """Fill correction (4, 3, 3): inverse of the force's matrix, of the rate's, g-sensitivity, and both biases."""
    force, rate = np.eye(3), np.eye(3)
    correction[2:] = 0.0
    lever[:] = nominal
    offset = 0.0
    for k in range(kind.shape[0]):
        r, c = row[k], column[k]
        if kind[k] == ACCELEROMETER:
            if c < 0:
                correction[3, 0, r] += sensor[k]
            else:
                force[r, c] += sensor[k]
        elif kind[k] == GYROSCOPE:
            if c < 0:
                correction[3, 1, r] += sensor[k]
            else:
                rate[r, c] += sensor[k]
        elif kind[k] == G_SENSITIVITY:
            correction[2, r, c] += sensor[k]
        elif kind[k] == LEVER_ARM:
            lever[r] += sensor[k]
        else:
            offset += sensor[k]
    _inverse(force, correction[0])
    _inverse(rate, correction[1])
    return offset


@njit(cache=True, nogil=True)
def correct(raw, correction, true):
    """Fill rate and force (6,) as they are by the sensor states."""
    f0, f1, f2 = raw[3] - correction[3, 0, 0], raw[4] - correction[3, 0, 1], raw[5] - correction[3, 0, 2]
    for i in range(3):
        true[3 + i] = correction[0, i, 0] * f0 + correction[0, i, 1] * f1 + correction[0, i, 2] * f2
    w0, w1, w2 = raw[0] - correction[3, 1, 0], raw[1] - correction[3, 1, 1], raw[2] - correction[3, 1, 2]
    f0, f1, f2 = true[3], true[4], true[5]
    w0 -= correction[2, 0, 0] * f0 + correction[2, 0, 1] * f1 + correction[2, 0, 2] * f2
    w1 -= correction[2, 1, 0] * f0 + correction[2, 1, 1] * f1 + correction[2, 1, 2] * f2
    w2 -= correction[2, 2, 0] * f0 + correction[2, 2, 1] * f1 + correction[2, 2, 2] * f2
    for i in range(3):
        true[i] = correction[1, i, 0] * w0 + correction[1, i, 1] * w1 + correction[1, i, 2] * w2


@njit(cache=True, nogil=True)
def _attitude(nav, C):
    x, y, z, w = nav[6], nav[7], nav[8], nav[9]
    C[0, 0], C[0, 1], C[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    C[1, 0], C[1, 1], C[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    C[2, 0], C[2, 1], C[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@njit(cache=True, nogil=True)
def _dynamics(nav, fn, fe, fd, F):
    """Fill F (9, 9), the errors' rates by errors of position, velocity and attitude; (fn, fe, fd) force in n."""
    s, c = np.sin(nav[0]), np.cos(nav[0])
    t = s / c
    reduced = 1.0 - _E2 * s * s
    across = _A / np.sqrt(reduced)
    meridian = across * (1.0 - _E2) / reduced + nav[2]
    across += nav[2]
    vn, ve, vd = nav[3], nav[4], nav[5]
    im, ia = 1.0 / meridian, 1.0 / across
    F[0, 0], F[0, 2], F[0, 3] = -vd * im, vn * im, 1.0
    F[1, 0], F[1, 1], F[1, 2], F[1, 4] = ve * t * im, -vd * ia - vn * t * im, ve * ia, 1.0
    F[2, 5] = 1.0
    # errors of the Earth rate and of the transport rate by r0, r2, v0, v1
    en0, ed0 = -_W * s * im, -_W * c * im
    tn2, tn4 = ve * ia * ia, ia
    te2, te3 = -vn * im * im, -im
    td0, td2, td4 = -ve * ia * im / (c * c), -ve * t * ia * ia, -t * ia
    # v x (2 dEarth + dTransport)
    dn0, dd0 = 2.0 * en0, 2.0 * ed0 + td0
    un, ue, ud = 2.0 * _W * c + ve * ia, -vn * im, -2.0 * _W * s - ve * t * ia
    F[3, 0], F[3, 2] = ve * dd0, ve * td2 - vd * te2
    F[3, 3], F[3, 4], F[3, 5] = -vd * te3, ud + ve * td4, -ue
    F[4, 0], F[4, 2] = vd * dn0 - vn * dd0, vd * tn2 - vn * td2
    F[4, 3], F[4, 4], F[4, 5] = -ud, vd * tn4 - vn * td4, un
    F[5, 0], F[5, 2] = -ve * dn0, vn * te2 - ve * tn2 + 2.0 * _G / np.sqrt(meridian * across)
    F[5, 3], F[5, 4], F[5, 5] = ue + vn * te3, -un - ve * tn4, 0.0
    # f x phi
    F[3, 7], F[3, 8] = -fd, fe
    F[4, 6], F[4, 8] = fd, -fn
    F[5, 6], F[5, 7] = -fe, fn
    wn, we, wd = _W * c + ve * ia, -vn * im, -_W * s - ve * t * ia
    F[6, 0], F[6, 2], F[6, 4] = en0, tn2, tn4
    F[7, 2], F[7, 3] = te2, te3
    F[8, 0], F[8, 2], F[8, 4] = ed0 + td0, td2, td4
    F[6, 7], F[6, 8] = wd, -we
    F[7, 6], F[7, 8] = -wd, wn
    F[8, 6], F[8, 7] = we, -wn


@njit(cache=True, nogil=True, fastmath=_FAST)
def _carry(T, F, dt):
    """T <- (1 + F dt) T for the nine navigation rows, by the pattern of F."""
    a00, a02, b = 1.0 + dt * F[0, 0], dt * F[0, 2], dt
    a10, a11, a12 = dt * F[1, 0], 1.0 + dt * F[1, 1], dt * F[1, 2]
    v00, v02, v03, v04, v05 = dt * F[3, 0], dt * F[3, 2], 1.0 + dt * F[3, 3], dt * F[3, 4], dt * F[3, 5]
    v10, v12, v13, v14, v15 = dt * F[4, 0], dt * F[4, 2], dt * F[4, 3], 1.0 + dt * F[4, 4], dt * F[4, 5]
    v20, v22, v23, v24, v25 = dt * F[5, 0], dt * F[5, 2], dt * F[5, 3], dt * F[5, 4], 1.0 + dt * F[5, 5]
    v07, v08, v16, v18, v26, v27 = (
        dt * F[3, 7],
        dt * F[3, 8],
        dt * F[4, 6],
        dt * F[4, 8],
        dt * F[5, 6],
        dt * F[5, 7],
    )
    p00, p02, p04 = dt * F[6, 0], dt * F[6, 2], dt * F[6, 4]
    p12, p13 = dt * F[7, 2], dt * F[7, 3]
    p20, p22, p24 = dt * F[8, 0], dt * F[8, 2], dt * F[8, 4]
    p07, p08, p16, p18, p26, p27 = (
        dt * F[6, 7],
        dt * F[6, 8],
        dt * F[7, 6],
        dt * F[7, 8],
        dt * F[8, 6],
        dt * F[8, 7],
    )
    for j in range(T.shape[1]):
        r0, r1, r2 = T[0, j], T[1, j], T[2, j]
        v0, v1, v2 = T[3, j], T[4, j], T[5, j]
        p0, p1, p2 = T[6, j], T[7, j], T[8, j]
        T[0, j] = a00 * r0 + a02 * r2 + b * v0
        T[1, j] = a10 * r0 + a11 * r1 + a12 * r2 + b * v1
        T[2, j] = r2 + b * v2
        T[3, j] = v00 * r0 + v02 * r2 + v03 * v0 + v04 * v1 + v05 * v2 + v07 * p1 + v08 * p2
        T[4, j] = v10 * r0 + v12 * r2 + v13 * v0 + v14 * v1 + v15 * v2 + v16 * p0 + v18 * p2
        T[5, j] = v20 * r0 + v22 * r2 + v23 * v0 + v24 * v1 + v25 * v2 + v26 * p0 + v27 * p1
        T[6, j] = p0 + p00 * r0 + p02 * r2 + p04 * v1 + p07 * p1 + p08 * p2
        T[7, j] = p1 + p12 * r2 + p13 * v0 + p16 * p0 + p18 * p2
        T[8, j] = p2 + p20 * r0 + p22 * r2 + p24 * v1 + p26 * p0 + p27 * p1


@njit(cache=True, nogil=True, fastmath=_FAST)
def _drive_by_sensors(T, C, correction, true, kind, row, column, shrink, dt):
    """Add to T what the sensor states do to velocity and attitude over dt; `true` is rate and force."""
    CA = np.empty((2, 3, 3))
    for a in range(2):
        for i in range(3):
            for j in range(3):
                CA[a, i, j] = dt * (
                    C[i, 0] * correction[a, 0, j]
                    + C[i, 1] * correction[a, 1, j]
                    + C[i, 2] * correction[a, 2, j]
                )
    for k in range(kind.shape[0]):
        r, c = row[k], column[k]
        if kind[k] == ACCELEROMETER:
            gain = -shrink[k] if c < 0 else -shrink[k] * true[3 + c]
            for i in range(3):
                T[3 + i, 9 + k] += CA[0, i, r] * gain
        elif kind[k] == GYROSCOPE:
            gain = shrink[k] if c < 0 else shrink[k] * true[c]
            for i in range(3):
                T[6 + i, 9 + k] += CA[1, i, r] * gain
        elif kind[k] == G_SENSITIVITY:
            gain = shrink[k] * true[3 + c]
            for i in range(3):
                T[6 + i, 9 + k] += CA[1, i, r] * gain


@njit(cache=True, nogil=True, fastmath=_FAST)
def _propagate(P, T, shrink, Q, drift, work):
    """P <- Phi (P + Q/2) Phi' + Q/2 with Phi = [T; diag(shrink)]; Q on nine states, `drift` on the others."""
    n = P.shape[0]
    for i in range(9):
        for j in range(9):
            P[i, j] += 0.5 * Q[i, j]
    for k in range(9, n):
        P[k, k] += 0.5 * drift[k - 9]
    for i in range(9):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(n):
            a = T[i, k]
            if a != 0.0:
                for j in range(n):
                    work[i, j] += a * P[k, j]
    for i in range(9):
        for j in range(i, 9):
            total = 0.0
            for k in range(n):
                total += work[i, k] * T[j, k]
            total += 0.5 * Q[i, j]
            P[i, j] = total
            P[j, i] = total
        for j in range(9, n):
            value = work[i, j] * shrink[j - 9]
            P[i, j] = value
            P[j, i] = value
    for i in range(9, n):
        for j in range(9, n):
            P[i, j] *= shrink[i - 9] * shrink[j - 9]
        P[i, i] += 0.5 * drift[i - 9]


@njit(cache=True, nogil=True, fastmath=_FAST)
def _compose(total, T, shrink, work):
    """Total <- Phi total, of square matrices, with Phi = [T; diag(shrink)]."""
    n = total.shape[0]
    for i in range(9):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(n):
            a = T[i, k]
            if a != 0.0:
                for j in range(n):
                    work[i, j] += a * total[k, j]
    for i in range(9):
        for j in range(n):
            total[i, j] = work[i, j]
    for i in range(9, n):
        for j in range(n):
            total[i, j] *= shrink[i - 9]


@njit(cache=True, nogil=True)
def _whiten(covariance, scale, z, H):
    """Divide three residuals and their rows by the Cholesky factor of scale times their covariance."""
    # of three rows: a loop is done before a library is called
    L = np.zeros((3, 3))
    for i in range(3):
        for k in range(i + 1):
            left = covariance[i, k] * scale
            for m in range(k):
                left -= L[i, m] * L[k, m]
            L[i, k] = np.sqrt(left) if i == k else left / L[k, k]
    for i in range(3):
        for k in range(i):
            z[i] -= L[i, k] * z[k]
            for j in range(H.shape[1]):
                H[i, j] -= L[i, k] * H[k, j]
        z[i] /= L[i, i]
        for j in range(H.shape[1]):
            H[i, j] /= L[i, i]


@njit(cache=True, nogil=True, fastmath=_FAST)
def _seen_covariance(P, H, own, S):
    """Fill S (3, 3) with H P H' and a covariance of one's own."""
    n = P.shape[0]
    for i in range(3):
        for j in range(i + 1):
            total = own[i, j]
            for k in range(n):
                if H[i, k] != 0.0:
                    part = 0.0
                    for m in range(n):
                        part += P[k, m] * H[j, m]
                    total += H[i, k] * part
            S[i, j], S[j, i] = total, total


@njit(cache=True, nogil=True)
def _turned(C, vector):
    """Return C @ vector."""
    result = np.empty(3)
    for i in range(3):
        result[i] = C[i, 0] * vector[0] + C[i, 1] * vector[1] + C[i, 2] * vector[2]
    return result


@njit(cache=True, nogil=True)
def _distance(P, z, H):
    """Return z' (H P H' + 1)^-1 z of three whitened residuals."""
    S, inverse = np.empty((3, 3)), np.empty((3, 3))
    _seen_covariance(P, H, np.eye(3), S)
    _inverse(S, inverse)
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += z[i] * inverse[i, j] * z[j]
    return total


@njit(cache=True, nogil=True, fastmath=_FAST)
def _take(P, z, H, error, PH, gain):
    """Take three whitened residuals one by one: P in Joseph's form, `error` the expected errors so far."""
    n = P.shape[0]
    for m in range(3):
        s = 1.0
        left = z[m]
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += P[i, j] * H[m, j]
            PH[i] = total
            left -= H[m, i] * error[i]
        for i in range(n):
            s += H[m, i] * PH[i]
        for i in range(n):
            gain[i] = PH[i] / s
            error[i] += gain[i] * left
        # (1 - K h) P, then times (1 - K h)' and plus K K'
        for i in range(n):
            for j in range(n):
                P[i, j] -= gain[i] * PH[j]
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += P[i, j] * H[m, j]
            PH[i] = total - gain[i]
        for i in range(n):
            for j in range(n):
                P[i, j] -= PH[i] * gain[j]
        for i in range(n):
            for j in range(i):
                value = 0.5 * (P[i, j] + P[j, i])
                P[i, j], P[j, i] = value, value


@njit(cache=True, nogil=True)
def apply_errors(nav: Floats, sensor: Floats, error: Floats) -> None:
    """Take errors (n,) out of the local-level state and the sensor states."""
    s, c = np.sin(nav[0]), np.cos(nav[0])
    reduced = 1.0 - _E2 * s * s
    across = _A / np.sqrt(reduced)
    meridian = across * (1.0 - _E2) / reduced + nav[2]
    nav[1] -= error[1] / ((across + nav[2]) * c)
    nav[0] -= error[0] / meridian
    nav[2] += error[2]
    for i in range(3):
        nav[3 + i] -= error[3 + i]
    # exp(skew(phi)) from the left
    hx, hy, hz = 0.5 * error[6], 0.5 * error[7], 0.5 * error[8]
    angle = np.sqrt(hx * hx + hy * hy + hz * hz)
    sinc = np.sin(angle) / angle if angle > 1e-8 else 1.0
    px, py, pz, p = hx * sinc, hy * sinc, hz * sinc, np.cos(angle)
    x, y, z, w = nav[6], nav[7], nav[8], nav[9]
    a = p * x + px * w + py * z - pz * y
    b = p * y - px * z + py * w + pz * x
    d = p * z + px * y - py * x + pz * w
    e = p * w - px * x - py * y - pz * z
    over = 1.0 / np.sqrt(a * a + b * b + d * d + e * e)
    nav[6], nav[7], nav[8], nav[9] = a * over, b * over, d * over, e * over
    for k in range(sensor.shape[0]):
        sensor[k] -= error[9 + k]


@njit(cache=True, nogil=True)
def _cross_rows(H, base, x, y, z):
    """Write skew((x, y, z)) at the columns of attitude."""
    H[base, 7], H[base, 8] = -z, y
    H[base + 1, 6], H[base + 1, 8] = z, -x
    H[base + 2, 6], H[base + 2, 7] = -y, x


@njit(cache=True, nogil=True)
def _position_residual(nav, C, lever, offset, fix, kind, row, z, H):
    """Fill residual z (3,) m of the antenna's position less a fix, and its rows H."""
    s, c = np.sin(nav[0]), np.cos(nav[0])
    reduced = 1.0 - _E2 * s * s
    across = _A / np.sqrt(reduced)
    meridian = across * (1.0 - _E2) / reduced + nav[2]
    across += nav[2]
    H[:] = 0.0
    arm = _turned(C, lever)
    east = np.mod(nav[1] - fix[1] + np.pi, 2.0 * np.pi) - np.pi
    z[0] = (nav[0] - fix[0]) * meridian + arm[0] + nav[3] * offset
    z[1] = east * across * c + arm[1] + nav[4] * offset
    z[2] = fix[2] - nav[2] + arm[2] + nav[5] * offset
    for i in range(3):
        H[i, i] = 1.0
    _cross_rows(H, 0, arm[0], arm[1], arm[2])
    for k in range(kind.shape[0]):
        if kind[k] == LEVER_ARM:
            for i in range(3):
                H[i, 9 + k] = C[i, row[k]]
        elif kind[k] == TIME_OFFSET:
            for i in range(3):
                H[i, 9 + k] = nav[3 + i]


@njit(cache=True, nogil=True)
def _velocity_residual(nav, C, lever, offset, rate, acceleration, fix, kind, row, z, H):
    """Fill residual z (3,) m/s of the antenna's velocity less a fix, and its rows H."""
    H[:] = 0.0
    turning = np.array(
        [
            rate[1] * lever[2] - rate[2] * lever[1],
            rate[2] * lever[0] - rate[0] * lever[2],
            rate[0] * lever[1] - rate[1] * lever[0],
        ]
    )
    swing = _turned(C, turning)
    for i in range(3):
        z[i] = nav[3 + i] + swing[i] + acceleration[i] * offset - fix[i]
        H[i, 3 + i] = 1.0
    _cross_rows(H, 0, swing[0], swing[1], swing[2])
    for k in range(kind.shape[0]):
        if kind[k] == LEVER_ARM:
            # C (rate x unit vector)
            r = row[k]
            one, two = (r + 1) % 3, (r + 2) % 3
            for i in range(3):
                H[i, 9 + k] = C[i, one] * rate[two] - C[i, two] * rate[one]
        elif kind[k] == TIME_OFFSET:
            for i in range(3):
                H[i, 9 + k] = acceleration[i]


@njit(
    types.void(
        _READ_ROW, _READ_ROWS, _READ_ROWS, types.boolean, types.int64, types.float64, _ROW,
        _ROW, _ROW, _ROWS,
        _INDEX, _INDEX, _INDEX, _ROW, _ROW, _ROW, _ROW,
        _ROW, _INDEX,
        _ROWS, _STACK, _ROWS, _STACK, _FLAGS, types.float64, types.int64,
        _ROWS, _ROWS, _ROWS, _ROWS, _STACK, _STACK, _STACK,
        _ROWS, _ROWS, _ROWS, _FLAGS,
    ),
    cache=True,
    nogil=True,
)  # fmt: skip
def run(
    time: Floats,
    rate: Floats,
    force: Floats,
    means: bool,
    stride: int,
    longest: float,
    unseen: Floats,
    nav: Floats,
    sensor: Floats,
    P: Floats,
    kind: Integers,
    row: Integers,
    column: Integers,
    decay: Floats,
    drive: Floats,
    white: Floats,
    nominal_lever: Floats,
    event_time: Floats,
    event_fix: Integers,
    fix_position: Floats,
    fix_position_covariance: Floats,
    fix_velocity: Floats,
    fix_velocity_covariance: Floats,
    use: Flags,
    gate: float,
    patience: int,
    navs: Floats,
    sensors: Floats,
    sigmas: Floats,
    errors: Floats,
    covariances: Floats,
    predicted: Floats,
    transitions: Floats,
    innovations: Floats,
    innovation_sigmas: Floats,
    distances: Floats,
    taken: Flags,
) -> None:
    """Run the filter from the first sample through all events, in time order.

    Samples as for `tumble.navigation.kernels.integrate`. `stride` samples are one block of the covariance. Over an
    interval above `longest` s the motion is unknown to `unseen` (6,): rate and force, one sigma. An event is a
    fix (its index in `event_fix`) or, at -1, an instant to keep. `use` (fixes, 2): position, velocity. Outputs
    have one row an event: the state after it, sensor states, sigmas, the errors taken out; if `covariances` is
    not empty also covariance after, before, and the transition from the event before. `innovations` (fixes, 6),
    their sigmas, `distances` (fixes, 2) the squared normalised innovations, `taken` (fixes, 2) whether they
    passed the gate.
    """
    n, events = P.shape[0], event_time.shape[0]
    m = n - 9
    keep_all = covariances.shape[0] > 0
    correction, lever = np.zeros((4, 3, 3)), np.zeros(3)
    offset = gather_sensors(sensor, kind, row, column, correction, lever, nominal_lever)
    T, shrink, Q, drift = np.zeros((9, n)), np.ones(m), np.zeros((9, 9)), np.zeros(m)
    total, work, F = np.eye(n), np.empty((9, n)), np.zeros((9, 9))
    C, C_before = np.empty((3, 3)), np.empty((3, 3))
    raw_before, raw_after, raw_mean = np.empty(6), np.empty(6), np.empty(6)
    raw_now, raw_next, before, after, mean = np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.zeros(6)
    acceleration, velocity_before = np.zeros(3), np.empty(3)
    z, H, PH, gain, error = np.empty(3), np.zeros((3, n)), np.empty(n), np.empty(n), np.empty(n)
    S = np.empty((3, 3))
    refused = np.zeros(2, dtype=np.int64)
    for i in range(9):
        T[i, i] = 1.0
    for j in range(3):
        raw_after[j], raw_after[3 + j] = rate[0, j], force[0, j]
    _attitude(nav, C)
    now, in_block, previous = time[0], 0, 1.0
    event = 0
    for sample in range(1, time.shape[0] + 1):
        if event >= events:
            break
        if sample < time.shape[0]:
            end = time[sample]
            interval = end - time[sample - 1]
            if means:
                for j in range(3):
                    raw_before[j], raw_before[3 + j] = raw_mean[j], raw_mean[3 + j]
                    raw_mean[j], raw_mean[3 + j] = rate[sample, j], force[sample, j]
                ends_of_interval(raw_before, raw_mean, raw_after, sample == 1, interval, previous)
                previous = interval
            else:
                for j in range(3):
                    raw_before[j], raw_before[3 + j] = raw_after[j], raw_after[3 + j]
                    raw_after[j], raw_after[3 + j] = rate[sample, j], force[sample, j]
        else:
            end, interval = now, 1.0
        while True:
            at_event = event < events and event_time[event] <= end
            goal = event_time[event] if at_event else end
            dt = goal - now
            if dt > 0.0:
                share, begin = (goal - end) / interval + 1.0, (now - end) / interval + 1.0
                for j in range(6):
                    raw_now[j] = raw_before[j] + begin * (raw_after[j] - raw_before[j])
                    raw_next[j] = raw_before[j] + share * (raw_after[j] - raw_before[j])
                correct(raw_now, correction, before)
                correct(raw_next, correction, after)
                for i in range(3):
                    velocity_before[i] = nav[3 + i]
                    for j in range(3):
                        C_before[i, j] = C[i, j]
                advance(nav, before, after, dt)
                _attitude(nav, C)
                for i in range(3):
                    acceleration[i] = (nav[3 + i] - velocity_before[i]) / dt
                    mean[i], mean[3 + i] = 0.5 * (before[i] + after[i]), 0.5 * (before[3 + i] + after[3 + i])
                    for j in range(3):
                        C_before[i, j] = 0.5 * (C_before[i, j] + C[i, j])
                fn = C_before[0, 0] * mean[3] + C_before[0, 1] * mean[4] + C_before[0, 2] * mean[5]
                fe = C_before[1, 0] * mean[3] + C_before[1, 1] * mean[4] + C_before[1, 2] * mean[5]
                fd = C_before[2, 0] * mean[3] + C_before[2, 1] * mean[4] + C_before[2, 2] * mean[5]
                _dynamics(nav, fn, fe, fd, F)
                _carry(T, F, dt)
                _drive_by_sensors(T, C_before, correction, mean, kind, row, column, shrink, dt)
                for k in range(m):
                    if decay[k] > 0.0:
                        kept = np.exp(-decay[k] * dt)
                        shrink[k] *= kept
                        drift[k] = kept * kept * drift[k] + drive[k] * (1.0 - kept * kept) / (2.0 * decay[k])
                        sensor[k] *= kept
                    else:
                        drift[k] += drive[k] * dt
                for i in range(3):
                    for j in range(3):
                        for a in range(3):
                            Q[6 + i, 6 + j] += C_before[i, a] * C_before[j, a] * white[a] * dt
                            Q[3 + i, 3 + j] += C_before[i, a] * C_before[j, a] * white[3 + a] * dt
                if interval > longest:
                    for i in range(3):
                        Q[i, i] += (0.5 * unseen[3 + i] * dt * dt) ** 2
                        Q[3 + i, 3 + i] += (unseen[3 + i] * dt) ** 2
                        Q[6 + i, 6 + i] += (unseen[i] * dt) ** 2
                now = goal
                in_block += 1
            if in_block > 0 and (at_event or in_block >= stride):
                _propagate(P, T, shrink, Q, drift, work)
                if keep_all:
                    _compose(total, T, shrink, work)
                if np.any(decay > 0.0):
                    offset = gather_sensors(sensor, kind, row, column, correction, lever, nominal_lever)
                T[:] = 0.0
                for i in range(9):
                    T[i, i] = 1.0
                shrink[:] = 1.0
                Q[:] = 0.0
                drift[:] = 0.0
                in_block = 0
            if not at_event:
                break
            if keep_all:
                predicted[event] = P
                transitions[event] = total
                total[:] = np.eye(n)
            error[:] = 0.0
            fix = event_fix[event]
            if fix >= 0:
                for what in range(2):
                    if not use[fix, what]:
                        continue
                    if what == 0:
                        _position_residual(nav, C, lever, offset, fix_position[fix], kind, row, z, H)
                        covariance = fix_position_covariance[fix]
                    else:
                        _velocity_residual(
                            nav, C, lever, offset, after, acceleration, fix_velocity[fix], kind, row, z, H
                        )
                        covariance = fix_velocity_covariance[fix]
                    for i in range(3):
                        for j in range(n):
                            z[i] -= H[i, j] * error[j]
                    _seen_covariance(P, H, covariance, S)
                    for i in range(3):
                        innovations[fix, 3 * what + i] = z[i]
                        innovation_sigmas[fix, 3 * what + i] = np.sqrt(S[i, i])
                    _whiten(covariance, 1.0, z, H)
                    distance = _distance(P, z, H)
                    distances[fix, what] = distance
                    taken[fix, what] = distance <= gate
                    if distance > gate:
                        refused[what] += 1
                        if refused[what] <= patience:
                            continue
                        # so many in a row are no outliers: the fix is taken for as good as it fits
                        weaker = np.sqrt(gate / distance)
                        z *= weaker
                        H *= weaker
                    else:
                        refused[what] = 0
                    # residuals are of the state before the event; what is known of its errors is in `error`
                    for i in range(3):
                        for j in range(n):
                            z[i] += H[i, j] * error[j]
                    _take(P, z, H, error, PH, gain)
                apply_errors(nav, sensor, error)
                offset = gather_sensors(sensor, kind, row, column, correction, lever, nominal_lever)
                _attitude(nav, C)
            navs[event] = nav
            sensors[event] = sensor
            errors[event] = error
            for i in range(n):
                sigmas[event, i] = np.sqrt(P[i, i])
            if keep_all:
                covariances[event] = P
            event += 1


__all__ = [
    "ACCELEROMETER",
    "GYROSCOPE",
    "G_SENSITIVITY",
    "LEVER_ARM",
    "TIME_OFFSET",
    "apply_errors",
    "correct",
    "gather_sensors",
    "run",
]
