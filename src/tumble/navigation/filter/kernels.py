"""The error-state filter, compiled: propagation by blocks of samples, sequential updates in Joseph's form.

Error states, estimate less truth: position (m: north, east, down), velocity (m/s), attitude phi (rad, in n, of
``C_nb_estimate = exp(-skew(phi)) C_nb``), then the sensor states in the order of their terms. Sensor states have
no dynamics but a decay of their own, so that the transition is dense in its first nine rows only. It is the
product of ``1 + F dt`` over the samples of a block; the noise enters half before and half after.
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import cos, exp, floor, sin, sqrt
from cython.cimports.tumble.navigation.kernels import advance, ends_of_interval

from tumble.earth.gravity import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS
from tumble.earth.site import EARTH_RATE

_A = cython.declare(cython.double, SEMI_MAJOR_AXIS)
_E2 = cython.declare(cython.double, ECCENTRICITY_SQUARED)
_W = cython.declare(cython.double, EARTH_RATE)
_HALF_TURN = cython.declare(cython.double, 3.141592653589793)
# what a sensor state is of
ACCELEROMETER, GYROSCOPE, G_SENSITIVITY, LEVER_ARM, TIME_OFFSET = 0, 1, 2, 3, 4
_ACCELEROMETER = cython.declare(cython.int, 0)
_GYROSCOPE = cython.declare(cython.int, 1)
_G_SENSITIVITY = cython.declare(cython.int, 2)
_LEVER_ARM = cython.declare(cython.int, 3)
_TIME_OFFSET = cython.declare(cython.int, 4)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _inverse(
    matrix: cython.p_double,
    inverse: cython.p_double,
) -> cython.void:
    a, b, c = matrix[0], matrix[1], matrix[2]
    d, e, f = matrix[3], matrix[4], matrix[5]
    g, h, i = matrix[6], matrix[7], matrix[8]
    over = 1.0 / (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
    inverse[0], inverse[1], inverse[2] = (
        (e * i - f * h) * over,
        (c * h - b * i) * over,
        (b * f - c * e) * over,
    )
    inverse[3], inverse[4], inverse[5] = (
        (f * g - d * i) * over,
        (a * i - c * g) * over,
        (c * d - a * f) * over,
    )
    inverse[6], inverse[7], inverse[8] = (
        (d * h - e * g) * over,
        (b * g - a * h) * over,
        (a * e - b * d) * over,
    )


def gather_sensors(
    sensor: cython.double[::1],
    kind: cython.const[cython.longlong][::1],
    row: cython.const[cython.longlong][::1],
    column: cython.const[cython.longlong][::1],
    correction: cython.double[:, :, ::1],
    lever: cython.double[::1],
    nominal: cython.const[cython.double][::1],
) -> float:
    """Fill correction (4, 3, 3): inverse of the force's matrix, of the rate's, g-sensitivity, and both biases."""
    return _gather(
        sensor, kind, row, column, cython.address(correction[0, 0, 0]), cython.address(lever[0]), nominal
    )


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _gather(
    sensor: cython.double[::1],
    kind: cython.const[cython.longlong][::1],
    row: cython.const[cython.longlong][::1],
    column: cython.const[cython.longlong][::1],
    correction: cython.p_double,
    lever: cython.p_double,
    nominal: cython.const[cython.double][::1],
) -> cython.double:
    """Do what `gather_sensors` does."""
    force = cython.declare(cython.double[9])
    rate = cython.declare(cython.double[9])
    for i in range(9):
        force[i] = rate[i] = 1.0 if i % 4 == 0 else 0.0
    for i in range(18, 36):
        correction[i] = 0.0
    for i in range(3):
        lever[i] = nominal[i]
    offset = 0.0
    for k in range(kind.shape[0]):
        r, c = row[k], column[k]
        if kind[k] == _ACCELEROMETER:
            if c < 0:
                correction[27 + r] += sensor[k]
            else:
                force[3 * r + c] += sensor[k]
        elif kind[k] == _GYROSCOPE:
            if c < 0:
                correction[30 + r] += sensor[k]
            else:
                rate[3 * r + c] += sensor[k]
        elif kind[k] == _G_SENSITIVITY:
            correction[18 + 3 * r + c] += sensor[k]
        elif kind[k] == _LEVER_ARM:
            lever[r] += sensor[k]
        else:
            offset += sensor[k]
    _inverse(force, correction)
    _inverse(rate, cython.address(correction[9]))
    return offset


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def correct(
    raw: cython.p_double,
    correction: cython.pointer[cython.const[cython.double]],
    true: cython.p_double,
) -> cython.void:
    """Fill rate and force (6,) as they are by the sensor states."""
    f0, f1, f2 = raw[3] - correction[27], raw[4] - correction[28], raw[5] - correction[29]
    for i in range(3):
        true[3 + i] = correction[3 * i] * f0 + correction[1 + 3 * i] * f1 + correction[2 + 3 * i] * f2
    w0, w1, w2 = raw[0] - correction[30], raw[1] - correction[31], raw[2] - correction[32]
    f0, f1, f2 = true[3], true[4], true[5]
    w0 -= correction[18] * f0 + correction[19] * f1 + correction[20] * f2
    w1 -= correction[21] * f0 + correction[22] * f1 + correction[23] * f2
    w2 -= correction[24] * f0 + correction[25] * f1 + correction[26] * f2
    for i in range(3):
        true[i] = correction[9 + 3 * i] * w0 + correction[10 + 3 * i] * w1 + correction[11 + 3 * i] * w2


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _attitude(
    nav: cython.p_double,
    C: cython.p_double,
) -> cython.void:
    x, y, z, w = nav[6], nav[7], nav[8], nav[9]
    C[0], C[1], C[2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    C[3], C[4], C[5] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    C[6], C[7], C[8] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _dynamics(
    nav: cython.p_double,
    fn: cython.double,
    fe: cython.double,
    fd: cython.double,
    F: cython.p_double,
) -> cython.void:
    """Fill F (9, 9), the errors' rates by errors of position, velocity and attitude; (fn, fe, fd) force in n."""
    s, c = sin(nav[0]), cos(nav[0])
    t = s / c
    reduced = 1.0 - _E2 * s * s
    across = _A / sqrt(reduced)
    meridian = across * (1.0 - _E2) / reduced + nav[2]
    across += nav[2]
    vn, ve, vd = nav[3], nav[4], nav[5]
    im, ia = 1.0 / meridian, 1.0 / across
    F[0], F[2], F[3] = -vd * im, vn * im, 1.0
    F[9], F[10], F[11], F[13] = ve * t * im, -vd * ia - vn * t * im, ve * ia, 1.0
    F[23] = 1.0
    # errors of the Earth rate and of the transport rate by r0, r2, v0, v1
    en0, ed0 = -_W * s * im, -_W * c * im
    tn2, tn4 = ve * ia * ia, ia
    te2, te3 = -vn * im * im, -im
    td0, td2, td4 = -ve * ia * im / (c * c), -ve * t * ia * ia, -t * ia
    # v x (2 dEarth + dTransport)
    dn0, dd0 = 2.0 * en0, 2.0 * ed0 + td0
    un, ue, ud = 2.0 * _W * c + ve * ia, -vn * im, -2.0 * _W * s - ve * t * ia
    F[27], F[29] = ve * dd0, ve * td2 - vd * te2
    F[30], F[31], F[32] = -vd * te3, ud + ve * td4, -ue
    F[36], F[38] = vd * dn0 - vn * dd0, vd * tn2 - vn * td2
    F[39], F[40], F[41] = -ud, vd * tn4 - vn * td4, un
    F[45], F[47] = -ve * dn0, vn * te2 - ve * tn2 + 2.0 * 9.81 / sqrt(meridian * across)
    F[48], F[49], F[50] = ue + vn * te3, -un - ve * tn4, 0.0
    # f x phi
    F[34], F[35] = -fd, fe
    F[42], F[44] = fd, -fn
    F[51], F[52] = -fe, fn
    wn, we, wd = _W * c + ve * ia, -vn * im, -_W * s - ve * t * ia
    F[54], F[56], F[58] = en0, tn2, tn4
    F[65], F[66] = te2, te3
    F[72], F[74], F[76] = ed0 + td0, td2, td4
    F[61], F[62] = wd, -we
    F[69], F[71] = -wd, wn
    F[78], F[79] = we, -wn


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _carry(
    T: cython.double[:, ::1],
    F: cython.p_double,
    dt: cython.double,
) -> cython.void:
    """T <- (1 + F dt) T for the nine navigation rows, by the pattern of F."""
    a00, a02, b = 1.0 + dt * F[0], dt * F[2], dt
    a10, a11, a12 = dt * F[9], 1.0 + dt * F[10], dt * F[11]
    v00, v02, v03, v04, v05 = dt * F[27], dt * F[29], 1.0 + dt * F[30], dt * F[31], dt * F[32]
    v10, v12, v13, v14, v15 = dt * F[36], dt * F[38], dt * F[39], 1.0 + dt * F[40], dt * F[41]
    v20, v22, v23, v24, v25 = dt * F[45], dt * F[47], dt * F[48], dt * F[49], 1.0 + dt * F[50]
    v07, v08, v16, v18, v26, v27 = (
        dt * F[34],
        dt * F[35],
        dt * F[42],
        dt * F[44],
        dt * F[51],
        dt * F[52],
    )
    p00, p02, p04 = dt * F[54], dt * F[56], dt * F[58]
    p12, p13 = dt * F[65], dt * F[66]
    p20, p22, p24 = dt * F[72], dt * F[74], dt * F[76]
    p07, p08, p16, p18, p26, p27 = (
        dt * F[61],
        dt * F[62],
        dt * F[69],
        dt * F[71],
        dt * F[78],
        dt * F[79],
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


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _drive_by_sensors(
    T: cython.double[:, ::1],
    C: cython.p_double,
    correction: cython.p_double,
    true: cython.p_double,
    kind: cython.const[cython.longlong][::1],
    row: cython.const[cython.longlong][::1],
    column: cython.const[cython.longlong][::1],
    shrink: cython.double[::1],
    dt: cython.double,
) -> cython.void:
    """Add to T what the sensor states do to velocity and attitude over dt; `true` is rate and force."""
    turned = cython.declare(cython.double[18])
    for a in range(2):
        for i in range(3):
            for j in range(3):
                turned[9 * a + 3 * i + j] = dt * (
                    C[3 * i + 0] * correction[9 * a + j]
                    + C[3 * i + 1] * correction[9 * a + 3 + j]
                    + C[3 * i + 2] * correction[9 * a + 6 + j]
                )
    for k in range(kind.shape[0]):
        r, c = row[k], column[k]
        if kind[k] == _ACCELEROMETER:
            gain = -shrink[k] if c < 0 else -shrink[k] * true[3 + c]
            for i in range(3):
                T[3 + i, 9 + k] += turned[3 * i + r] * gain
        elif kind[k] == _GYROSCOPE:
            gain = shrink[k] if c < 0 else shrink[k] * true[c]
            for i in range(3):
                T[6 + i, 9 + k] += turned[9 + 3 * i + r] * gain
        elif kind[k] == _G_SENSITIVITY:
            gain = shrink[k] * true[3 + c]
            for i in range(3):
                T[6 + i, 9 + k] += turned[9 + 3 * i + r] * gain


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(total=cython.double)
def _propagate(
    P: cython.double[:, ::1],
    T: cython.double[:, ::1],
    shrink: cython.double[::1],
    Q: cython.p_double,
    drift: cython.double[::1],
    work: cython.double[:, ::1],
) -> cython.void:
    """P <- Phi (P + Q/2) Phi' + Q/2 with Phi = [T; diag(shrink)]; Q on nine states, `drift` on the others."""
    n = P.shape[0]
    for i in range(9):
        for j in range(9):
            P[i, j] += 0.5 * Q[9 * i + j]
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
            total += 0.5 * Q[9 * i + j]
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


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _compose(
    total: cython.double[:, ::1],
    T: cython.double[:, ::1],
    shrink: cython.double[::1],
    work: cython.double[:, ::1],
) -> cython.void:
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


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _whiten(
    covariance: cython.pointer[cython.const[cython.double]],
    scale: cython.double,
    z: cython.p_double,
    H: cython.double[:, ::1],
) -> cython.void:
    """Divide three residuals and their rows by the Cholesky factor of scale times their covariance."""
    L = cython.declare(cython.double[9])
    for i in range(3):
        for k in range(i + 1):
            left = covariance[3 * i + k] * scale
            for m in range(k):
                left -= L[3 * i + m] * L[3 * k + m]
            L[3 * i + k] = sqrt(left) if i == k else left / L[3 * k + k]
    for i in range(3):
        for k in range(i):
            z[i] -= L[3 * i + k] * z[k]
            for j in range(H.shape[1]):
                H[i, j] -= L[3 * i + k] * H[k, j]
        z[i] /= L[3 * i + i]
        for j in range(H.shape[1]):
            H[i, j] /= L[3 * i + i]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(total=cython.double, part=cython.double)
def _seen_covariance(
    P: cython.double[:, ::1],
    H: cython.double[:, ::1],
    own: cython.pointer[cython.const[cython.double]],
    S: cython.p_double,
) -> cython.void:
    """Fill S (3, 3) with H P H' and a covariance of one's own."""
    n = P.shape[0]
    for i in range(3):
        for j in range(i + 1):
            total = own[3 * i + j]
            for k in range(n):
                if H[i, k] != 0.0:
                    part = 0.0
                    for m in range(n):
                        part += P[k, m] * H[j, m]
                    total += H[i, k] * part
            S[3 * i + j], S[3 * j + i] = total, total


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _turned(
    C: cython.p_double,
    vector: cython.p_double,
    result: cython.p_double,
) -> cython.void:
    """Fill C @ vector."""
    for i in range(3):
        result[i] = C[3 * i + 0] * vector[0] + C[3 * i + 1] * vector[1] + C[3 * i + 2] * vector[2]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _distance(
    P: cython.double[:, ::1],
    z: cython.p_double,
    H: cython.double[:, ::1],
) -> cython.double:
    """Return z' (H P H' + 1)^-1 z of three whitened residuals."""
    S = cython.declare(cython.double[9])
    inverse = cython.declare(cython.double[9])
    unit = cython.declare(cython.double[9])
    for i in range(9):
        unit[i] = 1.0 if i % 4 == 0 else 0.0
    _seen_covariance(P, H, unit, S)
    _inverse(S, inverse)
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += z[i] * inverse[3 * i + j] * z[j]
    return total


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(s=cython.double, left=cython.double, total=cython.double)
def _take(
    P: cython.double[:, ::1],
    z: cython.p_double,
    H: cython.double[:, ::1],
    error: cython.double[::1],
    PH: cython.double[::1],
    gain: cython.double[::1],
) -> cython.void:
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


def apply_errors(
    nav: cython.double[::1],
    sensor: cython.double[::1],
    error: cython.const[cython.double][::1],
) -> None:
    """Take errors (n,) out of the local-level state and the sensor states."""
    with cython.nogil:
        _apply(cython.address(nav[0]), sensor, error)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _apply(
    nav: cython.p_double, sensor: cython.double[::1], error: cython.const[cython.double][::1]
) -> cython.void:
    """Do what `apply_errors` does."""
    s, c = sin(nav[0]), cos(nav[0])
    reduced = 1.0 - _E2 * s * s
    across = _A / sqrt(reduced)
    meridian = across * (1.0 - _E2) / reduced + nav[2]
    nav[1] -= error[1] / ((across + nav[2]) * c)
    nav[0] -= error[0] / meridian
    nav[2] += error[2]
    for i in range(3):
        nav[3 + i] -= error[3 + i]
    # exp(skew(phi)) from the left
    hx, hy, hz = 0.5 * error[6], 0.5 * error[7], 0.5 * error[8]
    angle = sqrt(hx * hx + hy * hy + hz * hz)
    sinc = sin(angle) / angle if angle > 1e-8 else 1.0
    px, py, pz, p = hx * sinc, hy * sinc, hz * sinc, cos(angle)
    x, y, z, w = nav[6], nav[7], nav[8], nav[9]
    a = p * x + px * w + py * z - pz * y
    b = p * y - px * z + py * w + pz * x
    d = p * z + px * y - py * x + pz * w
    e = p * w - px * x - py * y - pz * z
    over = 1.0 / sqrt(a * a + b * b + d * d + e * e)
    nav[6], nav[7], nav[8], nav[9] = a * over, b * over, d * over, e * over
    for k in range(sensor.shape[0]):
        sensor[k] -= error[9 + k]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _clear(H: cython.double[:, ::1]) -> cython.void:
    """Fill with zeros."""
    for i in range(H.shape[0]):
        for j in range(H.shape[1]):
            H[i, j] = 0.0


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _wrapped(angle: cython.double) -> cython.double:
    """Return an angle between plus and minus half a turn."""
    return angle - 2.0 * _HALF_TURN * floor((angle + _HALF_TURN) / (2.0 * _HALF_TURN))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _cross_rows(
    H: cython.double[:, ::1],
    base: cython.Py_ssize_t,
    x: cython.double,
    y: cython.double,
    z: cython.double,
) -> cython.void:
    """Write skew((x, y, z)) at the columns of attitude."""
    H[base, 7], H[base, 8] = -z, y
    H[base + 1, 6], H[base + 1, 8] = z, -x
    H[base + 2, 6], H[base + 2, 7] = -y, x


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _position_residual(
    nav: cython.p_double,
    C: cython.p_double,
    lever: cython.p_double,
    offset: cython.double,
    fix: cython.pointer[cython.const[cython.double]],
    kind: cython.const[cython.longlong][::1],
    row: cython.const[cython.longlong][::1],
    z: cython.p_double,
    H: cython.double[:, ::1],
) -> cython.void:
    """Fill residual z (3,) m of the antenna's position less a fix, and its rows H."""
    s, c = sin(nav[0]), cos(nav[0])
    reduced = 1.0 - _E2 * s * s
    across = _A / sqrt(reduced)
    meridian = across * (1.0 - _E2) / reduced + nav[2]
    across += nav[2]
    _clear(H)
    arm = cython.declare(cython.double[3])
    _turned(C, lever, arm)
    east = _wrapped(nav[1] - fix[1])
    z[0] = (nav[0] - fix[0]) * meridian + arm[0] + nav[3] * offset
    z[1] = east * across * c + arm[1] + nav[4] * offset
    z[2] = fix[2] - nav[2] + arm[2] + nav[5] * offset
    for i in range(3):
        H[i, i] = 1.0
    _cross_rows(H, 0, arm[0], arm[1], arm[2])
    for k in range(kind.shape[0]):
        if kind[k] == _LEVER_ARM:
            for i in range(3):
                H[i, 9 + k] = C[3 * i + row[k]]
        elif kind[k] == _TIME_OFFSET:
            for i in range(3):
                H[i, 9 + k] = nav[3 + i]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _velocity_residual(
    nav: cython.p_double,
    C: cython.p_double,
    lever: cython.p_double,
    offset: cython.double,
    rate: cython.p_double,
    acceleration: cython.p_double,
    fix: cython.pointer[cython.const[cython.double]],
    kind: cython.const[cython.longlong][::1],
    row: cython.const[cython.longlong][::1],
    z: cython.p_double,
    H: cython.double[:, ::1],
) -> cython.void:
    """Fill residual z (3,) m/s of the antenna's velocity less a fix, and its rows H."""
    _clear(H)
    turning = cython.declare(cython.double[3])
    swing = cython.declare(cython.double[3])
    turning[0] = rate[1] * lever[2] - rate[2] * lever[1]
    turning[1] = rate[2] * lever[0] - rate[0] * lever[2]
    turning[2] = rate[0] * lever[1] - rate[1] * lever[0]
    _turned(C, turning, swing)
    for i in range(3):
        z[i] = nav[3 + i] + swing[i] + acceleration[i] * offset - fix[i]
        H[i, 3 + i] = 1.0
    _cross_rows(H, 0, swing[0], swing[1], swing[2])
    for k in range(kind.shape[0]):
        if kind[k] == _LEVER_ARM:
            # C (rate x unit vector)
            r = row[k]
            one, two = (r + 1) % 3, (r + 2) % 3
            for i in range(3):
                H[i, 9 + k] = C[3 * i + one] * rate[two] - C[3 * i + two] * rate[one]
        elif kind[k] == _TIME_OFFSET:
            for i in range(3):
                H[i, 9 + k] = acceleration[i]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _begin_block(
    T: cython.double[:, ::1], shrink: cython.double[::1], Q: cython.p_double, drift: cython.double[::1]
) -> cython.void:
    """Set what a block adds up to nothing."""
    _clear(T)
    for i in range(9):
        T[i, i] = 1.0
    for k in range(shrink.shape[0]):
        shrink[k] = 1.0
        drift[k] = 0.0
    for i in range(81):
        Q[i] = 0.0


@cython.locals(decays=cython.bint, at_event=cython.bint)
def run(
    time: cython.const[cython.double][::1],
    rate: cython.const[cython.double][:, ::1],
    force: cython.const[cython.double][:, ::1],
    means: cython.bint,
    stride: cython.Py_ssize_t,
    longest: cython.double,
    unseen: cython.const[cython.double][::1],
    nav: cython.double[::1],
    sensor: cython.double[::1],
    P: cython.double[:, ::1],
    kind: cython.const[cython.longlong][::1],
    row: cython.const[cython.longlong][::1],
    column: cython.const[cython.longlong][::1],
    decay: cython.const[cython.double][::1],
    drive: cython.const[cython.double][::1],
    white: cython.const[cython.double][::1],
    nominal_lever: cython.const[cython.double][::1],
    event_time: cython.const[cython.double][::1],
    event_fix: cython.const[cython.longlong][::1],
    fix_position: cython.const[cython.double][:, ::1],
    fix_position_covariance: cython.const[cython.double][:, :, ::1],
    fix_velocity: cython.const[cython.double][:, ::1],
    fix_velocity_covariance: cython.const[cython.double][:, :, ::1],
    use: cython.const[cython.uchar][:, ::1],
    gate: cython.double,
    patience: cython.Py_ssize_t,
    navs: cython.double[:, ::1],
    sensors: cython.double[:, ::1],
    sigmas: cython.double[:, ::1],
    errors: cython.double[:, ::1],
    covariances: cython.double[:, :, ::1],
    predicted: cython.double[:, :, ::1],
    transitions: cython.double[:, :, ::1],
    innovations: cython.double[:, ::1],
    innovation_sigmas: cython.double[:, ::1],
    distances: cython.double[:, ::1],
    taken: cython.uchar[:, ::1],
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
    keep_all: cython.bint = covariances.shape[0] > 0
    T: cython.double[:, ::1] = np.eye(9, n)
    shrink: cython.double[::1] = np.ones(m)
    drift: cython.double[::1] = np.zeros(m)
    total: cython.double[:, ::1] = np.eye(n)
    work: cython.double[:, ::1] = np.empty((9, n))
    H: cython.double[:, ::1] = np.zeros((3, n))
    PH: cython.double[::1] = np.empty(n)
    gain: cython.double[::1] = np.empty(n)
    error: cython.double[::1] = np.empty(n)
    correction = cython.declare(cython.double[36])
    lever = cython.declare(cython.double[3])
    Q = cython.declare(cython.double[81])
    F = cython.declare(cython.double[81])
    C = cython.declare(cython.double[9])
    C_before = cython.declare(cython.double[9])
    raw_before = cython.declare(cython.double[6])
    raw_after = cython.declare(cython.double[6])
    raw_mean = cython.declare(cython.double[6])
    raw_now = cython.declare(cython.double[6])
    raw_next = cython.declare(cython.double[6])
    before = cython.declare(cython.double[6])
    after = cython.declare(cython.double[6])
    mean = cython.declare(cython.double[6])
    acceleration = cython.declare(cython.double[3])
    velocity_before = cython.declare(cython.double[3])
    z = cython.declare(cython.double[3])
    S = cython.declare(cython.double[9])
    state = cython.declare(cython.double[10])
    refused = cython.declare(cython.int[2])
    own = cython.declare(cython.pointer[cython.const[cython.double]])
    with cython.nogil:
        for i in range(81):
            Q[i] = F[i] = 0.0
        for i in range(36):
            correction[i] = 0.0
        for i in range(10):
            state[i] = nav[i]
        for j in range(3):
            acceleration[j] = 0.0
            raw_mean[j] = raw_mean[3 + j] = 0.0
        offset = _gather(sensor, kind, row, column, correction, lever, nominal_lever)
        decays = False
        for k in range(m):
            decays = decays or decay[k] > 0.0
        refused[0] = refused[1] = 0
        for j in range(3):
            raw_after[j], raw_after[3 + j] = rate[0, j], force[0, j]
        _attitude(state, C)
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
                        velocity_before[i] = state[3 + i]
                        for j in range(3):
                            C_before[3 * i + j] = C[3 * i + j]
                    advance(state, before, after, dt)
                    _attitude(state, C)
                    for i in range(3):
                        acceleration[i] = (state[3 + i] - velocity_before[i]) / dt
                        mean[i], mean[3 + i] = (
                            0.5 * (before[i] + after[i]),
                            0.5 * (before[3 + i] + after[3 + i]),
                        )
                        for j in range(3):
                            C_before[3 * i + j] = 0.5 * (C_before[3 * i + j] + C[3 * i + j])
                    fn = C_before[0] * mean[3] + C_before[1] * mean[4] + C_before[2] * mean[5]
                    fe = C_before[3] * mean[3] + C_before[4] * mean[4] + C_before[5] * mean[5]
                    fd = C_before[6] * mean[3] + C_before[7] * mean[4] + C_before[8] * mean[5]
                    _dynamics(state, fn, fe, fd, F)
                    _carry(T, F, dt)
                    _drive_by_sensors(T, C_before, correction, mean, kind, row, column, shrink, dt)
                    for k in range(m):
                        if decay[k] > 0.0:
                            kept = exp(-decay[k] * dt)
                            shrink[k] *= kept
                            drift[k] = kept * kept * drift[k] + drive[k] * (1.0 - kept * kept) / (
                                2.0 * decay[k]
                            )
                            sensor[k] *= kept
                        else:
                            drift[k] += drive[k] * dt
                    for i in range(3):
                        for j in range(3):
                            for a in range(3):
                                Q[60 + 9 * i + j] += C_before[3 * i + a] * C_before[3 * j + a] * white[a] * dt
                                Q[30 + 9 * i + j] += (
                                    C_before[3 * i + a] * C_before[3 * j + a] * white[3 + a] * dt
                                )
                    if interval > longest:
                        for i in range(3):
                            Q[10 * i] += (0.5 * unseen[3 + i] * dt * dt) ** 2
                            Q[30 + 10 * i] += (unseen[3 + i] * dt) ** 2
                            Q[60 + 10 * i] += (unseen[i] * dt) ** 2
                    now = goal
                    in_block += 1
                if in_block > 0 and (at_event or in_block >= stride):
                    _propagate(P, T, shrink, Q, drift, work)
                    if keep_all:
                        _compose(total, T, shrink, work)
                    if decays:
                        offset = _gather(sensor, kind, row, column, correction, lever, nominal_lever)
                    _begin_block(T, shrink, Q, drift)
                    in_block = 0
                if not at_event:
                    break
                if keep_all:
                    for i in range(n):
                        for j in range(n):
                            predicted[event, i, j] = P[i, j]
                            transitions[event, i, j] = total[i, j]
                            total[i, j] = 1.0 if i == j else 0.0
                for i in range(n):
                    error[i] = 0.0
                fix = event_fix[event]
                if fix >= 0:
                    for what in range(2):
                        if not use[fix, what]:
                            continue
                        if what == 0:
                            _position_residual(
                                state, C, lever, offset, cython.address(fix_position[fix, 0]), kind, row, z, H
                            )
                            own = cython.address(fix_position_covariance[fix, 0, 0])
                        else:
                            _velocity_residual(
                                state,
                                C,
                                lever,
                                offset,
                                after,
                                acceleration,
                                cython.address(fix_velocity[fix, 0]),
                                kind,
                                row,
                                z,
                                H,
                            )
                            own = cython.address(fix_velocity_covariance[fix, 0, 0])
                        for i in range(3):
                            for j in range(n):
                                z[i] -= H[i, j] * error[j]
                        _seen_covariance(P, H, own, S)
                        for i in range(3):
                            innovations[fix, 3 * what + i] = z[i]
                            innovation_sigmas[fix, 3 * what + i] = sqrt(S[4 * i])
                        _whiten(own, 1.0, z, H)
                        distance = _distance(P, z, H)
                        distances[fix, what] = distance
                        taken[fix, what] = distance <= gate
                        if distance > gate:
                            refused[what] += 1
                            if refused[what] <= patience:
                                continue
                            # so many in a row are no outliers: the fix is taken for as good as it fits
                            weaker = sqrt(gate / distance)
                            for i in range(3):
                                z[i] *= weaker
                                for j in range(n):
                                    H[i, j] *= weaker
                        else:
                            refused[what] = 0
                        # residuals are of the state before the event; what is known of its errors is in `error`
                        for i in range(3):
                            for j in range(n):
                                z[i] += H[i, j] * error[j]
                        _take(P, z, H, error, PH, gain)
                    _apply(state, sensor, error)
                    offset = _gather(sensor, kind, row, column, correction, lever, nominal_lever)
                    _attitude(state, C)
                for i in range(10):
                    navs[event, i] = state[i]
                for k in range(m):
                    sensors[event, k] = sensor[k]
                for i in range(n):
                    errors[event, i] = error[i]
                    sigmas[event, i] = sqrt(P[i, i])
                if keep_all:
                    for i in range(n):
                        for j in range(n):
                            covariances[event, i, j] = P[i, j]
                event += 1

        for i in range(10):
            nav[i] = state[i]


__all__ = [
    "ACCELEROMETER",
    "GYROSCOPE",
    "G_SENSITIVITY",
    "LEVER_ARM",
    "TIME_OFFSET",
    "apply_errors",
    "gather_sensors",
    "run",
]
