"""The error-state filter and free navigation from many of its states, compiled.

The covariance goes by blocks of samples, updates are sequential and in Joseph's form.

Error states, estimate less truth: position (m: north, east, down), velocity (m/s), attitude phi (rad, in n, of
``C_nb_estimate = exp(-skew(phi)) C_nb``), then the sensor states in the order of their terms. Sensor states have
no dynamics but a decay of their own, so that the transition is dense in its first nine rows only. It is the
product of ``1 + F dt`` over the samples of a block; the noise enters half before and half after.

What sensor states change is 37 numbers: the force's matrix and the rate's (by rows, as their inverses), g-sensitivity,
the biases of force and rate, the lever arm, and the offset of the clocks. A state's place (three numbers) is which of
these it adds to; the column of the force's matrix (0 to 2) or the rate's (9 to 11) that carries it on, or -1; and what
it is multiplied with: one (0), a rate (1 to 3) or a force (4 to 6).
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import cos, exp, floor, sin, sqrt
from cython.cimports.tumble.navigation.kernels import advance, ends_of_interval, step_between

from tumble.earth import EARTH_RATE, ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS

_A = cython.declare(cython.double, SEMI_MAJOR_AXIS)
_E2 = cython.declare(cython.double, ECCENTRICITY_SQUARED)
_W = cython.declare(cython.double, EARTH_RATE)
_HALF_TURN = cython.declare(cython.double, 3.141592653589793)
_LEVER_ARM = cython.declare(cython.int, 33)
_TIME_OFFSET = cython.declare(cython.int, 36)
# A place that no latitude is near, and an interval before which there is none.
_NOWHERE = cython.declare(cython.double, 1e9)
_ENDLESS = cython.declare(cython.double, float("inf"))

# A filter at work. Of the block so far: the transition's dense rows T (9, n), the sensors' own decays `shrink`, the
# noise Q (9, 9) and `drift`. Of a fix: its residuals z and their rows H (3, n). `now` are rate and force at the end.
_Filter = cython.struct(
    n=cython.Py_ssize_t,
    m=cython.Py_ssize_t,
    decays=cython.bint,
    place=cython.pointer[cython.const[cython.longlong]],
    nominal=cython.pointer[cython.const[cython.double]],
    P=cython.p_double,
    T=cython.p_double,
    shrink=cython.p_double,
    drift=cython.p_double,
    sensor=cython.p_double,
    total=cython.p_double,
    H=cython.p_double,
    error=cython.p_double,
    work=cython.p_double,
    Q=cython.double[81],
    nav=cython.double[10],
    C=cython.double[9],
    parameters=cython.double[37],
    now=cython.double[6],
    acceleration=cython.double[3],
    z=cython.double[3],
)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _fill(values: cython.p_double, count: cython.Py_ssize_t, value: cython.double) -> cython.void:
    for i in range(count):
        values[i] = value


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _copy(
    values: cython.pointer[cython.const[cython.double]], count: cython.Py_ssize_t, to: cython.p_double
) -> cython.void:
    for i in range(count):
        to[i] = values[i]


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _dot(a: cython.p_double, b: cython.p_double, count: cython.Py_ssize_t) -> cython.double:
    total: cython.double = 0.0
    for i in range(count):
        total += a[i] * b[i]
    return total


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _times(
    A: cython.p_double,
    B: cython.p_double,
    C: cython.p_double,
    rows: cython.Py_ssize_t,
    inner: cython.Py_ssize_t,
    columns: cython.Py_ssize_t,
) -> cython.void:
    """C <- A B, leaving out what is zero in A."""
    for i in range(rows):
        _fill(C + i * columns, columns, 0.0)
        for k in range(inner):
            a = A[i * inner + k]
            if a != 0.0:
                for j in range(columns):
                    C[i * columns + j] += a * B[k * columns + j]


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _turned(C: cython.p_double, vector: cython.p_double, result: cython.p_double) -> cython.void:
    """Fill C @ vector."""
    for i in range(3):
        result[i] = C[3 * i] * vector[0] + C[3 * i + 1] * vector[1] + C[3 * i + 2] * vector[2]


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _add_skew(
    to: cython.p_double, width: cython.Py_ssize_t, v: cython.p_double, sign: cython.double
) -> cython.void:
    """Add sign times skew(v) to three columns of three rows so wide."""
    x, y, z = sign * v[0], sign * v[1], sign * v[2]
    to[1] -= z
    to[2] += y
    to[width] += z
    to[width + 2] -= x
    to[2 * width] -= y
    to[2 * width + 1] += x


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _invert(matrix: cython.p_double) -> cython.void:
    """Put a matrix's inverse in its place."""
    a, b, c = matrix[0], matrix[1], matrix[2]
    d, e, f = matrix[3], matrix[4], matrix[5]
    g, h, i = matrix[6], matrix[7], matrix[8]
    over = 1.0 / (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
    matrix[0], matrix[1], matrix[2] = e * i - f * h, c * h - b * i, b * f - c * e
    matrix[3], matrix[4], matrix[5] = f * g - d * i, a * i - c * g, c * d - a * f
    matrix[6], matrix[7], matrix[8] = d * h - e * g, b * g - a * h, a * e - b * d
    for k in range(9):
        matrix[k] *= over


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(left=cython.double)
def _factor(
    covariance: cython.pointer[cython.const[cython.double]], scale: cython.double, L: cython.p_double
) -> cython.void:
    """Fill the Cholesky factor of scale times a covariance (3, 3)."""
    for i in range(3):
        for k in range(i + 1):
            left = covariance[3 * i + k] * scale
            for m in range(k):
                left -= L[3 * i + m] * L[3 * k + m]
            L[3 * i + k] = sqrt(left) if i == k else left / L[3 * k + k]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _divide(L: cython.p_double, rows: cython.p_double, width: cython.Py_ssize_t) -> cython.void:
    """Divide three rows by a lower triangle from the left."""
    for i in range(3):
        for k in range(i):
            for j in range(width):
                rows[i * width + j] -= L[3 * i + k] * rows[k * width + j]
        for j in range(width):
            rows[i * width + j] /= L[3 * i + i]


def gather_sensors(
    sensor: cython.double[::1],
    place: cython.const[cython.longlong][:, ::1],
    nominal: cython.const[cython.double][::1],
    parameters: cython.double[::1],
) -> None:
    """Fill the parameters (37,) that nominal ones and sensor states make: matrices are inverted."""
    _gather(
        sensor.shape[0],
        cython.address(sensor[0]),
        cython.address(place[0, 0]),
        cython.address(nominal[0]),
        cython.address(parameters[0]),
    )


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _gather(
    count: cython.Py_ssize_t,
    sensor: cython.p_double,
    place: cython.pointer[cython.const[cython.longlong]],
    nominal: cython.pointer[cython.const[cython.double]],
    parameters: cython.p_double,
) -> cython.void:
    """Do what `gather_sensors` does."""
    _copy(nominal, 37, parameters)
    for k in range(count):
        parameters[place[3 * k]] += sensor[k]
    _invert(parameters)
    _invert(parameters + 9)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _correct(
    raw: cython.p_double, parameters: cython.pointer[cython.const[cython.double]], true: cython.p_double
) -> cython.void:
    """Fill rate and force (6,) as they are by the sensor states."""
    left = cython.declare(cython.double[3])
    pull = cython.declare(cython.double[3])
    p = cython.cast(cython.p_double, parameters)
    for i in range(3):
        left[i] = raw[3 + i] - p[27 + i]
    _turned(p, left, true + 3)
    _turned(p + 18, true + 3, pull)
    for i in range(3):
        left[i] = raw[i] - p[30 + i] - pull[i]
    _turned(p + 9, left, true)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _attitude(nav: cython.p_double, C: cython.p_double) -> cython.void:
    x, y, z, w = nav[6], nav[7], nav[8], nav[9]
    C[0], C[1], C[2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    C[3], C[4], C[5] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    C[6], C[7], C[8] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _on_earth(nav: cython.p_double, found: cython.p_double) -> cython.void:
    """Fill the radius along the meridian and that across it, with the height, and sine and cosine of the latitude."""
    s, c = sin(nav[0]), cos(nav[0])
    reduced = 1.0 - _E2 * s * s
    across = _A / sqrt(reduced)
    found[0], found[1] = across * (1.0 - _E2) / reduced + nav[2], across + nav[2]
    found[2], found[3] = s, c


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _dynamics(nav: cython.p_double, force_n: cython.p_double, F: cython.p_double) -> cython.void:
    """Fill F (9, 9), the errors' rates by errors of position, velocity and attitude."""
    place = cython.declare(cython.double[4])
    turn = cython.declare(cython.double[3])
    earth = cython.declare(cython.double[3])
    transport = cython.declare(cython.double[12])
    columns = cython.declare(cython.int[4])
    _on_earth(nav, place)
    s, c = place[2], place[3]
    t, im, ia = s / c, 1.0 / place[0], 1.0 / place[1]
    vn, ve, vd = nav[3], nav[4], nav[5]
    _fill(F, 81, 0.0)
    F[0], F[2], F[3] = -vd * im, vn * im, 1.0
    F[9], F[10], F[11], F[13] = ve * t * im, -vd * ia - vn * t * im, ve * ia, 1.0
    F[23] = 1.0
    # the transport rate's derivatives by r north and down, v north and east; the Earth rate's by r north alone
    columns[0], columns[1], columns[2], columns[3] = 0, 2, 3, 4
    _fill(transport, 12, 0.0)
    transport[2] = -ve * ia * im / (c * c)
    transport[3], transport[4], transport[5] = ve * ia * ia, -vn * im * im, -ve * t * ia * ia
    transport[7] = -im
    transport[9], transport[11] = ia, -t * ia
    earth[0], earth[1], earth[2] = -_W * s * im, 0.0, -_W * c * im
    for k in range(4):
        at, share = columns[k], 1.0 if k == 0 else 0.0
        for i in range(3):
            turn[i] = transport[3 * k + i] + share * earth[i]
            F[54 + 9 * i + at] = turn[i]
            turn[i] += share * earth[i]
        # v x (2 dEarth + dTransport)
        F[27 + at] = ve * turn[2] - vd * turn[1]
        F[36 + at] = vd * turn[0] - vn * turn[2]
        F[45 + at] = vn * turn[1] - ve * turn[0]
    F[47] += 2.0 * 9.81 / sqrt(place[0] * place[1])
    turn[0], turn[1], turn[2] = _W * c + ve * ia, -vn * im, -_W * s - ve * t * ia
    _add_skew(F + 60, 9, turn, -1.0)
    turn[0] += _W * c
    turn[2] -= _W * s
    _add_skew(F + 30, 9, turn, -1.0)
    _add_skew(F + 33, 9, force_n, 1.0)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _carry(T: cython.p_double, n: cython.Py_ssize_t, F: cython.p_double, dt: cython.double) -> cython.void:
    """T <- (1 + F dt) T, by the pattern of F, which becomes F dt."""
    for i in range(81):
        F[i] *= dt
    for j in range(n):
        r0, r1, r2 = T[j], T[n + j], T[2 * n + j]
        v0, v1, v2 = T[3 * n + j], T[4 * n + j], T[5 * n + j]
        p0, p1, p2 = T[6 * n + j], T[7 * n + j], T[8 * n + j]
        T[j] = r0 + F[0] * r0 + F[2] * r2 + dt * v0
        T[n + j] = r1 + F[9] * r0 + F[10] * r1 + F[11] * r2 + dt * v1
        T[2 * n + j] = r2 + dt * v2
        v3 = F[27] * r0 + F[29] * r2 + F[30] * v0 + F[31] * v1 + F[32] * v2 + F[34] * p1 + F[35] * p2
        v4 = F[36] * r0 + F[38] * r2 + F[39] * v0 + F[40] * v1 + F[41] * v2 + F[42] * p0 + F[44] * p2
        v5 = F[45] * r0 + F[47] * r2 + F[48] * v0 + F[49] * v1 + F[50] * v2 + F[51] * p0 + F[52] * p1
        T[3 * n + j], T[4 * n + j], T[5 * n + j] = v0 + v3, v1 + v4, v2 + v5
        T[6 * n + j] = p0 + F[54] * r0 + F[56] * r2 + F[58] * v1 + F[61] * p1 + F[62] * p2
        T[7 * n + j] = p1 + F[65] * r2 + F[66] * v0 + F[69] * p0 + F[71] * p2
        T[8 * n + j] = p2 + F[72] * r0 + F[74] * r2 + F[76] * v1 + F[78] * p0 + F[79] * p1


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _drive_by_sensors(
    f: cython.pointer[_Filter], C: cython.p_double, mean: cython.p_double, dt: cython.double
) -> cython.void:
    """Add to T what the sensor states do to velocity and attitude over dt; `mean` are one, rate and force."""
    turned = cython.declare(cython.double[18])
    _times(C, f.parameters, turned, 3, 3, 3)
    _times(C, f.parameters + 9, turned + 9, 3, 3, 3)
    for k in range(f.m):
        row, by = f.place[3 * k + 1], f.place[3 * k + 2]
        if row < 0:
            continue
        to, sign = (3, -1.0) if row < 9 else (6, 1.0)
        gain = sign * dt * f.shrink[k] * mean[by]
        for i in range(3):
            f.T[(to + i) * f.n + 9 + k] += turned[3 * i + row] * gain


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.locals(kept=cython.double, span=cython.double)
def _step(
    f: cython.pointer[_Filter],
    begin: cython.p_double,
    end: cython.p_double,
    dt: cython.double,
    motion: cython.const[cython.double][:, ::1],
    white: cython.pointer[cython.const[cython.double]],
) -> cython.void:
    """Carry the states and the block over dt, between rates and forces at its ends."""
    before = cython.declare(cython.double[6])
    mean = cython.declare(cython.double[7])
    C = cython.declare(cython.double[9])
    force_n = cython.declare(cython.double[3])
    F = cython.declare(cython.double[81])
    _correct(begin, f.parameters, before)
    _correct(end, f.parameters, f.now)
    _copy(f.C, 9, C)
    _copy(f.nav + 3, 3, f.acceleration)
    advance(f.nav, before, f.now, dt)
    _attitude(f.nav, f.C)
    mean[0] = 1.0
    for i in range(6):
        mean[1 + i] = 0.5 * (before[i] + f.now[i])
    for i in range(9):
        C[i] = 0.5 * (C[i] + f.C[i])
    for i in range(3):
        f.acceleration[i] = (f.nav[3 + i] - f.acceleration[i]) / dt
    _turned(C, mean + 4, force_n)
    _dynamics(f.nav, force_n, F)
    _carry(f.T, f.n, F, dt)
    _drive_by_sensors(f, C, mean, dt)
    for k in range(f.m):
        kept, span = 1.0, dt
        if motion[k, 0] > 0.0:
            kept = exp(-motion[k, 0] * dt)
            span = (1.0 - kept * kept) / (2.0 * motion[k, 0])
        f.shrink[k] *= kept
        f.sensor[k] *= kept
        f.drift[k] = kept * kept * f.drift[k] + motion[k, 1] * span
    for block in range(2):
        for i in range(3):
            for j in range(3):
                for a in range(3):
                    f.Q[60 - 30 * block + 9 * i + j] += (
                        C[3 * i + a] * C[3 * j + a] * white[3 * block + a] * dt
                    )


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _add_noise(f: cython.pointer[_Filter]) -> cython.void:
    """Add half of a block's noise to P."""
    for i in range(9):
        for j in range(9):
            f.P[i * f.n + j] += 0.5 * f.Q[9 * i + j]
    for k in range(f.m):
        f.P[(9 + k) * (f.n + 1)] += 0.5 * f.drift[k]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _begin_block(f: cython.pointer[_Filter]) -> cython.void:
    """Set what a block adds up to nothing."""
    _fill(f.T, 9 * f.n, 0.0)
    for i in range(9):
        f.T[i * (f.n + 1)] = 1.0
    _fill(f.shrink, f.m, 1.0)
    _fill(f.drift, f.m, 0.0)
    _fill(f.Q, 81, 0.0)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _end_block(f: cython.pointer[_Filter], keep_all: cython.bint) -> cython.void:
    """P <- Phi (P + Q/2) Phi' + Q/2 with Phi = [T; diag(shrink)], and the product of transitions where it is kept."""
    n, P, work = f.n, f.P, f.work
    _add_noise(f)
    _times(f.T, P, work, 9, n, n)
    for i in range(9):
        for j in range(i, 9):
            P[i * n + j] = P[j * n + i] = _dot(work + i * n, f.T + j * n, n)
        for j in range(9, n):
            P[i * n + j] = P[j * n + i] = work[i * n + j] * f.shrink[j - 9]
    if f.decays:
        for i in range(9, n):
            for j in range(9, n):
                P[i * n + j] *= f.shrink[i - 9] * f.shrink[j - 9]
    _add_noise(f)
    if keep_all:
        _times(f.T, f.total, work, 9, n, n)
        _copy(work, 9 * n, f.total)
        for i in range(9, n):
            for j in range(n):
                f.total[i * n + j] *= f.shrink[i - 9]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _residual(
    f: cython.pointer[_Filter], what: cython.int, fix: cython.pointer[cython.const[cython.double]]
) -> cython.void:
    """Fill the residuals of the antenna's position (m, 0) or velocity (m/s, 1) less a fix, and their rows."""
    turning = cython.declare(cython.double[9])
    by_arm = cython.declare(cython.double[9])
    arm = cython.declare(cython.double[3])
    place = cython.declare(cython.double[4])
    nav, n = cython.cast(cython.p_double, f.nav), f.n
    moving = nav + 3
    if what == 0:
        _copy(f.C, 9, by_arm)
        _on_earth(nav, place)
        east = nav[1] - fix[1]
        east -= 2.0 * _HALF_TURN * floor((east + _HALF_TURN) / (2.0 * _HALF_TURN))
        f.z[0], f.z[1], f.z[2] = (nav[0] - fix[0]) * place[0], east * place[1] * place[3], fix[2] - nav[2]
    else:
        # C (rate x arm)
        _fill(turning, 9, 0.0)
        _add_skew(turning, 3, f.now, 1.0)
        _times(f.C, turning, by_arm, 3, 3, 3)
        moving = f.acceleration
        for i in range(3):
            f.z[i] = nav[3 + i] - fix[i]
    _turned(by_arm, f.parameters + _LEVER_ARM, arm)
    _fill(f.H, 3 * n, 0.0)
    _add_skew(f.H + 6, n, arm, 1.0)
    for i in range(3):
        f.z[i] += arm[i] + moving[i] * f.parameters[_TIME_OFFSET]
        f.H[i * n + 3 * what + i] = 1.0
        for k in range(f.m):
            at = f.place[3 * k]
            if at == _TIME_OFFSET:
                f.H[i * n + 9 + k] = moving[i]
            elif at >= _LEVER_ARM:
                f.H[i * n + 9 + k] = by_arm[3 * i + at - _LEVER_ARM]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _innovation(
    f: cython.pointer[_Filter],
    own: cython.pointer[cython.const[cython.double]],
    innovation: cython.p_double,
    sigma: cython.p_double,
) -> cython.double:
    """Fill the innovation of a fix with a covariance of its own, and its sigmas; return its squared normalised one."""
    S = cython.declare(cython.double[9])
    L = cython.declare(cython.double[9])
    left = cython.declare(cython.double[3])
    n = f.n
    _times(f.H, f.P, f.work, 3, n, n)
    for i in range(3):
        # residuals are of the state before the event; what is known of its errors is in `error`
        left[i] = innovation[i] = f.z[i] - _dot(f.H + i * n, f.error, n)
        for j in range(3):
            S[3 * i + j] = own[3 * i + j] + _dot(f.work + i * n, f.H + j * n, n)
        sigma[i] = sqrt(S[4 * i])
    _factor(S, 1.0, L)
    _divide(L, left, 1)
    return _dot(left, left, 3)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _less_product(
    P: cython.p_double, a: cython.p_double, b: cython.p_double, n: cython.Py_ssize_t
) -> cython.void:
    """P <- P - a b'."""
    for i in range(n):
        for j in range(n):
            P[i * n + j] -= a[i] * b[j]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _take(
    f: cython.pointer[_Filter], own: cython.pointer[cython.const[cython.double]], scale: cython.double
) -> cython.void:
    """Take three residuals one by one, their covariance scaled: P in Joseph's form, `error` the errors so far."""
    L = cython.declare(cython.double[9])
    n, P, error, PH, gain = f.n, f.P, f.error, f.work, f.work + f.n
    _factor(own, scale, L)
    _divide(L, f.z, 1)
    _divide(L, f.H, n)
    for m in range(3):
        h = f.H + m * n
        for i in range(n):
            PH[i] = _dot(P + i * n, h, n)
        over = 1.0 / (1.0 + _dot(h, PH, n))
        left = f.z[m] - _dot(h, error, n)
        for i in range(n):
            gain[i] = PH[i] * over
            error[i] += gain[i] * left
        # (1 - K h) P, then times (1 - K h)' and plus K K'
        _less_product(P, gain, PH, n)
        for i in range(n):
            PH[i] = _dot(P + i * n, h, n) - gain[i]
        _less_product(P, PH, gain, n)
        for i in range(n):
            for j in range(i):
                P[i * n + j] = P[j * n + i] = 0.5 * (P[i * n + j] + P[j * n + i])


def apply_errors(
    nav: cython.double[::1], sensor: cython.double[::1], error: cython.const[cython.double][::1]
) -> None:
    """Take errors (n,) out of the local-level state and the sensor states."""
    _apply(cython.address(nav[0]), cython.address(sensor[0]), sensor.shape[0], cython.address(error[0]))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _apply(
    nav: cython.p_double,
    sensor: cython.p_double,
    count: cython.Py_ssize_t,
    error: cython.pointer[cython.const[cython.double]],
) -> cython.void:
    """Do what `apply_errors` does."""
    place = cython.declare(cython.double[4])
    _on_earth(nav, place)
    nav[1] -= error[1] / (place[1] * place[3])
    nav[0] -= error[0] / place[0]
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
    for k in range(count):
        sensor[k] -= error[9 + k]


@cython.locals(at_event=cython.bint, scale=cython.double)
def run(
    time: cython.const[cython.double][::1],
    signals: cython.const[cython.double][:, ::1],
    means: cython.bint,
    stride: cython.Py_ssize_t,
    longest: cython.double,
    unseen: cython.const[cython.double][::1],
    nav: cython.const[cython.double][::1],
    sensor: cython.double[::1],
    P: cython.double[:, ::1],
    place: cython.const[cython.longlong][:, ::1],
    motion: cython.const[cython.double][:, ::1],
    white: cython.const[cython.double][::1],
    nominal: cython.const[cython.double][::1],
    event_time: cython.const[cython.double][::1],
    event_fix: cython.const[cython.longlong][::1],
    fixes: cython.const[cython.double][:, :, ::1],
    fix_covariances: cython.const[cython.double][:, :, :, ::1],
    use: cython.const[cython.uchar][:, ::1],
    gate: cython.double,
    patience: cython.Py_ssize_t,
    navs: cython.double[:, ::1],
    sensors: cython.double[:, ::1],
    sigmas: cython.double[:, ::1],
    errors: cython.double[:, ::1],
    kept: cython.double[:, :, :, ::1],
    innovations: cython.double[:, :, ::1],
    distances: cython.double[:, ::1],
    taken: cython.uchar[:, ::1],
) -> None:
    """Run the filter from the first sample through all events, in time order.

    `signals` (samples, 6) are rate and force, as for `tumble.navigation.kernels.integrate`. `stride` samples are one
    block of the covariance. Over an interval above `longest` s the motion is unknown to `unseen` (6,): rate and
    force, one sigma. `motion` (states, 2): decay and drive. An event is a fix (its index in `event_fix`) or, at -1,
    an instant to keep. Of a fix position and velocity have a row each of `fixes`, `fix_covariances` and `use`.
    Outputs have one row an event: the state after it, sensor states, sigmas, the errors taken out; if `kept`
    (3, events, n, n) is not empty, covariance after, before, and the transition from the event before. `innovations`
    (2, fixes, 6) and their sigmas, `distances` (fixes, 2) the squared normalised innovations, `taken` (fixes, 2)
    whether they passed the gate.
    """
    n, events = P.shape[0], event_time.shape[0]
    m, square = n - 9, n * n
    keep_all: cython.bint = kept.shape[1] > 0
    scratch: cython.double[::1] = np.zeros(n * (n + 24))
    filter_ = cython.declare(_Filter)
    f = cython.declare(cython.pointer[_Filter], cython.address(filter_))
    raw_before = cython.declare(cython.double[6])
    raw_after = cython.declare(cython.double[6])
    begin = cython.declare(cython.double[6])
    end = cython.declare(cython.double[6])
    mean = cython.declare(cython.double[6])
    refused = cython.declare(cython.int[2])
    own = cython.declare(cython.pointer[cython.const[cython.double]])
    with cython.nogil:
        f.n, f.m = n, m
        f.place, f.nominal = cython.address(place[0, 0]), cython.address(nominal[0])
        f.P, f.sensor = cython.address(P[0, 0]), cython.address(sensor[0])
        f.total = cython.address(scratch[0])
        f.T, f.work, f.H = f.total + square, f.total + square + 9 * n, f.total + square + 18 * n
        f.error, f.shrink, f.drift = f.H + 3 * n, f.H + 4 * n, f.H + 5 * n
        for i in range(n):
            f.total[i * (n + 1)] = 1.0
        _begin_block(f)
        _copy(cython.address(nav[0]), 10, f.nav)
        _fill(f.acceleration, 3, 0.0)
        _fill(mean, 6, 0.0)
        _gather(m, f.sensor, f.place, f.nominal, f.parameters)
        f.decays = False
        for k in range(m):
            f.decays = f.decays or motion[k, 0] > 0.0
        refused[0] = refused[1] = 0
        _copy(cython.address(signals[0, 0]), 6, raw_after)
        _fill(f.now, 6, 0.0)
        _attitude(f.nav, f.C)
        now, in_block, previous = time[0], 0, 1.0
        event = 0
        for sample in range(1, time.shape[0] + 1):
            if event >= events:
                break
            if sample < time.shape[0]:
                stop = time[sample]
                interval = stop - time[sample - 1]
                if means:
                    _copy(mean, 6, raw_before)
                    _copy(cython.address(signals[sample, 0]), 6, mean)
                    ends_of_interval(raw_before, mean, raw_after, sample == 1, interval, previous)
                    previous = interval
                else:
                    _copy(raw_after, 6, raw_before)
                    _copy(cython.address(signals[sample, 0]), 6, raw_after)
            else:
                stop, interval = now, 1.0
            while True:
                at_event = event < events and event_time[event] <= stop
                goal = event_time[event] if at_event else stop
                dt = goal - now
                if dt > 0.0:
                    share, first = (goal - stop) / interval + 1.0, (now - stop) / interval + 1.0
                    for j in range(6):
                        begin[j] = raw_before[j] + first * (raw_after[j] - raw_before[j])
                        end[j] = raw_before[j] + share * (raw_after[j] - raw_before[j])
                    _step(f, begin, end, dt, motion, cython.address(white[0]))
                    if interval > longest:
                        for i in range(3):
                            f.Q[10 * i] += (0.5 * unseen[3 + i] * dt * dt) ** 2
                            f.Q[30 + 10 * i] += (unseen[3 + i] * dt) ** 2
                            f.Q[60 + 10 * i] += (unseen[i] * dt) ** 2
                    now = goal
                    in_block += 1
                if in_block > 0 and (at_event or in_block >= stride):
                    _end_block(f, keep_all)
                    if f.decays:
                        _gather(m, f.sensor, f.place, f.nominal, f.parameters)
                    _begin_block(f)
                    in_block = 0
                if not at_event:
                    break
                if keep_all:
                    _copy(f.P, square, cython.address(kept[1, event, 0, 0]))
                    _copy(f.total, square, cython.address(kept[2, event, 0, 0]))
                    _fill(f.total, square, 0.0)
                    for i in range(n):
                        f.total[i * (n + 1)] = 1.0
                _fill(f.error, n, 0.0)
                fix = event_fix[event]
                if fix >= 0:
                    for what in range(2):
                        if not use[fix, what]:
                            continue
                        _residual(f, what, cython.address(fixes[fix, what, 0]))
                        own = cython.address(fix_covariances[fix, what, 0, 0])
                        distance = _innovation(
                            f,
                            own,
                            cython.address(innovations[0, fix, 3 * what]),
                            cython.address(innovations[1, fix, 3 * what]),
                        )
                        distances[fix, what], taken[fix, what] = distance, distance <= gate
                        scale = 1.0
                        refused[what] = refused[what] + 1 if distance > gate else 0
                        if refused[what]:
                            if refused[what] <= patience:
                                continue
                            # so many in a row are no outliers: the fix is taken for as good as it fits
                            scale = distance / gate
                        _take(f, own, scale)
                    _apply(f.nav, f.sensor, m, f.error)
                    _gather(m, f.sensor, f.place, f.nominal, f.parameters)
                    _attitude(f.nav, f.C)
                _copy(f.nav, 10, cython.address(navs[event, 0]))
                _copy(f.sensor, m, cython.address(sensors[event, 0]))
                _copy(f.error, n, cython.address(errors[event, 0]))
                for i in range(n):
                    sigmas[event, i] = sqrt(P[i, i])
                if keep_all:
                    _copy(f.P, square, cython.address(kept[0, event, 0, 0]))
                event += 1


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _at(
    time: cython.const[cython.double][::1],
    signals: cython.const[cython.double][:, ::1],
    means: cython.bint,
    instant: cython.double,
    row: cython.Py_ssize_t,
    parameters: cython.pointer[cython.const[cython.double]],
    true: cython.p_double,
) -> cython.void:
    """Fill the corrected sample at an instant before a row: straight between rows, or the mean that ends at the row."""
    raw = cython.declare(cython.double[6])
    share = 1.0 if means else (instant - time[row - 1]) / (time[row] - time[row - 1])
    before = row if share == 1.0 else row - 1
    for j in range(6):
        raw[j] = (1.0 - share) * signals[before, j] + share * signals[row, j]
    _correct(raw, parameters, true)


def run_from_each(
    time: cython.const[cython.double][::1],
    signals: cython.const[cython.double][:, ::1],
    means: cython.bint,
    starts: cython.const[cython.double][:, ::1],
    begins: cython.const[cython.double][::1],
    rows: cython.const[cython.longlong][::1],
    goals: cython.const[cython.double][:, ::1],
    parameters: cython.const[cython.double][:, ::1],
    found: cython.double[:, :, ::1],
) -> None:
    """Fill `found` (starts, goals, 10), as `tumble.navigation.mechanisation.navigate_from_each` returns it.

    `rows` are those of the first samples after the starts.
    """
    # a state, and the place of its latitude
    state = cython.declare(cython.double[13])
    shown = cython.declare(cython.double[13])
    old = cython.declare(cython.double[6])
    new = cython.declare(cython.double[6])
    with cython.nogil:
        weight = 0.0 if means else 0.5
        for one in range(starts.shape[0]):
            own = cython.address(parameters[one, 0])
            _copy(cython.address(starts[one, 0]), 10, state)
            state[10], state[11], state[12] = _NOWHERE, 0.0, 0.0
            now, previous, row = begins[one], _ENDLESS, rows[one]
            _at(time, signals, means, now, row, own, old)
            for goal in range(goals.shape[1]):
                until = goals[one, goal]
                _copy(state, 13, shown)
                while now < until:
                    # a goal between samples is looked at, and the run goes on from the sample before it
                    end = min(time[row], until)
                    interval = end - now
                    _at(time, signals, means, end, row, own, new)
                    share = interval / (interval + previous) if means else 0.5
                    _copy(state, 13, shown)
                    step_between(shown, shown + 10, old, new, weight, share, interval)
                    if end < time[row]:
                        break
                    _copy(shown, 13, state)
                    _copy(new, 6, old)
                    now, previous, row = end, interval, row + 1
                if until == until:
                    _copy(shown, 10, cython.address(found[one, goal, 0]))


__all__ = ["apply_errors", "gather_sensors", "run", "run_from_each"]
