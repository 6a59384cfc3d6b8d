"""The hot loops of attitude integration, compiled; called by `integration` and for rotation sequences."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import atan2, cos, sin, sqrt


def integrate_segments(
    time: cython.const[cython.double][::1],
    raw_rate: cython.const[cython.double][:, ::1],
    raw_force: cython.const[cython.double][:, ::1],
    gyro_inverse: cython.const[cython.double][:, ::1],
    gyro_bias: cython.const[cython.double][::1],
    g_sensitivity: cython.const[cython.double][:, ::1],
    force_inverse: cython.const[cython.double][:, ::1],
    force_bias: cython.const[cython.double][::1],
    starts: cython.const[cython.longlong][:],
    stops: cython.const[cython.longlong][:],
    C_start_end: cython.double[:, :, ::1],
    gyro_sums: cython.double[:, :, :, ::1],
) -> None:
    """Integrate each segment from sample `starts[k]` to sample `stops[k] - 1`.

    `C_start_end[k]` becomes the rotation from the last sample's body frame to the first one's;
    `gyro_sums[k, :, :, j]` the integral of C_start_t times regressor j, where the regressors are
    the corrected rate (0 to 2), one (3) and the corrected specific force (4 to 6).
    Between samples the rate is linear in time: the rotation vector is the mean rate times the step
    plus step^2/12 of the cross product of both rates (the coning term of a linear rate).
    """
    c = cython.declare(cython.double[9])
    rotation = cython.declare(cython.double[9])
    v = cython.declare(cython.double[3])
    # by regressor: of 32 samples and the next one
    x = cython.declare(cython.double[231])
    # of 32 steps: the regressors' integrals (and a zero), half of the rotations by entry, attitudes half-way
    middle = cython.declare(cython.double[256])
    turns = cython.declare(cython.double[288])
    half_way = cython.declare(cython.double[288])
    sums = cython.declare(cython.double[72])
    with cython.nogil:
        for k in range(starts.shape[0]):
            _unit(c)
            for m in range(72):
                sums[m] = 0.0
            first = starts[k]
            while first < stops[k] - 1:
                steps = min(32, stops[k] - 1 - first)
                for i in range(steps + 1):
                    s = first + i
                    for axis in range(3):
                        x[33 * (4 + axis) + i] = (
                            force_inverse[axis, 0] * (raw_force[s, 0] - force_bias[0])
                            + force_inverse[axis, 1] * (raw_force[s, 1] - force_bias[1])
                            + force_inverse[axis, 2] * (raw_force[s, 2] - force_bias[2])
                        )
                    for axis in range(3):
                        v[axis] = (
                            raw_rate[s, axis]
                            - gyro_bias[axis]
                            - g_sensitivity[axis, 0] * x[132 + i]
                            - g_sensitivity[axis, 1] * x[165 + i]
                            - g_sensitivity[axis, 2] * x[198 + i]
                        )
                    for axis in range(3):
                        x[33 * axis + i] = (
                            gyro_inverse[axis, 0] * v[0]
                            + gyro_inverse[axis, 1] * v[1]
                            + gyro_inverse[axis, 2] * v[2]
                        )
                _half_turns(time, first, x, steps, middle, turns)
                for i in range(steps):
                    for m in range(9):
                        rotation[m] = turns[32 * m + i]
                    _product(c, 0, rotation, half_way, 9 * i)
                    _product(half_way, 9 * i, rotation, c, 0)
                for m in range(9):
                    for i in range(steps):
                        for j in range(8):
                            sums[8 * m + j] += half_way[9 * i + m] * middle[8 * i + j]
                first += steps
            for m in range(3):
                for j in range(3):
                    C_start_end[k, m, j] = c[3 * m + j]
                    for axis in range(7):
                        gyro_sums[k, m, j, axis] = sums[8 * (3 * m + j) + axis]


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _half_turns(
    time: cython.const[cython.double][::1],
    first: cython.Py_ssize_t,
    x: cython.p_double,
    steps: cython.Py_ssize_t,
    middle: cython.p_double,
    turns: cython.p_double,
) -> cython.void:
    """Fill the regressors' integrals over each step, and its rotation half-way: half of the rotation vector."""
    vector = cython.declare(cython.double[96])
    for i in range(steps):
        step = time[first + i + 1] - time[first + i]
        half, coning = 0.5 * step, step * step * (1.0 / 12.0)
        a0, a1, a2, b0, b1, b2 = x[i], x[33 + i], x[66 + i], x[i + 1], x[34 + i], x[67 + i]
        m0, m1, m2 = half * (a0 + b0), half * (a1 + b1), half * (a2 + b2)
        vector[i] = 0.5 * (m0 + coning * (a1 * b2 - a2 * b1))
        vector[32 + i] = 0.5 * (m1 + coning * (a2 * b0 - a0 * b2))
        vector[64 + i] = 0.5 * (m2 + coning * (a0 * b1 - a1 * b0))
        middle[8 * i], middle[8 * i + 1], middle[8 * i + 2], middle[8 * i + 3] = m0, m1, m2, step
        for j in range(4, 7):
            middle[8 * i + j] = half * (x[33 * j + i] + x[33 * j + i + 1])
        middle[8 * i + 7] = 0.0
    for i in range(steps):
        p, q, r = vector[i], vector[32 + i], vector[64 + i]
        square = p * p + q * q + r * r
        _fill_rotation(p, q, r, _sinc(square), _cosc(square), turns, i, 32)
    for i in range(steps):
        p, q, r = vector[i], vector[32 + i], vector[64 + i]
        square = p * p + q * q + r * r
        if square >= 0.04:
            angle = sqrt(square)
            _fill_rotation(p, q, r, sin(angle) / angle, (1.0 - cos(angle)) / square, turns, i, 32)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _unit(c: cython.p_double) -> cython.void:
    """Fill the unit matrix."""
    for m in range(9):
        c[m] = 0.0
    c[0] = c[4] = c[8] = 1.0


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _sinc(square: cython.double) -> cython.double:
    """Return sin(a) / a of the square of an angle, to 1e-17 below 0.2 rad."""
    return 1.0 - square * (
        1.0 / 6.0
        - square
        * (1.0 / 120.0 - square * (1.0 / 5040.0 - square * (1.0 / 362880.0 - square * (1.0 / 39916800.0))))
    )


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _cosc(square: cython.double) -> cython.double:
    """Return (1 - cos(a)) / a² of the square of an angle, to 1e-17 below 0.2 rad."""
    return 0.5 - square * (
        1.0 / 24.0
        - square
        * (1.0 / 720.0 - square * (1.0 / 40320.0 - square * (1.0 / 3628800.0 - square * (1.0 / 479001600.0))))
    )


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _fill_rotation(
    p: cython.double,
    q: cython.double,
    r: cython.double,
    sinc: cython.double,
    cosc: cython.double,
    made: cython.p_double,
    at: cython.Py_ssize_t,
    apart: cython.Py_ssize_t,
) -> cython.void:
    """Fill the rotation by the vector (p, q, r) rad (Rodrigues): from a place on, its entries so far apart."""
    d = 1.0 - cosc * (p * p + q * q + r * r)
    made[at] = d + cosc * p * p
    made[at + apart] = cosc * p * q - sinc * r
    made[at + 2 * apart] = cosc * p * r + sinc * q
    made[at + 3 * apart] = cosc * p * q + sinc * r
    made[at + 4 * apart] = d + cosc * q * q
    made[at + 5 * apart] = cosc * q * r - sinc * p
    made[at + 6 * apart] = cosc * p * r - sinc * q
    made[at + 7 * apart] = cosc * q * r + sinc * p
    made[at + 8 * apart] = d + cosc * r * r


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _product(
    c: cython.p_double,
    at: cython.Py_ssize_t,
    by: cython.p_double,
    made: cython.p_double,
    to: cython.Py_ssize_t,
) -> cython.void:
    """Fill the product of two matrices, the first from a place of `c` on; `made` is another array."""
    for m in range(0, 9, 3):
        x, y, z = c[at + m], c[at + m + 1], c[at + m + 2]
        made[to + m] = x * by[0] + y * by[3] + z * by[6]
        made[to + m + 1] = x * by[1] + y * by[4] + z * by[7]
        made[to + m + 2] = x * by[2] + y * by[5] + z * by[8]


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _turn(
    c: cython.p_double, p: cython.double, q: cython.double, r: cython.double, turned: cython.p_double
) -> cython.void:
    """Fill C times the rotation by the vector (p, q, r) rad; `turned` is another matrix."""
    rotation = cython.declare(cython.double[9])
    square = p * p + q * q + r * r
    if square < 0.04:
        _fill_rotation(p, q, r, _sinc(square), _cosc(square), rotation, 0, 1)
    else:
        angle = sqrt(square)
        _fill_rotation(p, q, r, sin(angle) / angle, (1.0 - cos(angle)) / square, rotation, 0, 1)
    _product(c, 0, rotation, turned, 0)


def fill_rotation_vectors(C: cython.const[cython.double][:, :, ::1], vectors: cython.double[:, ::1]) -> None:
    """Fill (rows, 3) the rotation vectors of matrices, their angles in [0, pi] rad.

    The axis comes from the quaternion's largest component (Shepperd 1978): half turns are as accurate as small ones.
    """
    q = cython.declare(cython.double[4])
    with cython.nogil:
        for n in range(C.shape[0]):
            trace = C[n, 0, 0] + C[n, 1, 1] + C[n, 2, 2]
            largest, most = 3, trace
            for axis in range(3):
                if C[n, axis, axis] > most:
                    largest, most = axis, C[n, axis, axis]
            if largest == 3:
                q[0], q[1] = C[n, 2, 1] - C[n, 1, 2], C[n, 0, 2] - C[n, 2, 0]
                q[2], q[3] = C[n, 1, 0] - C[n, 0, 1], 1.0 + trace
            else:
                i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
                q[i], q[j] = 1.0 - trace + 2.0 * most, C[n, i, j] + C[n, j, i]
                q[k], q[3] = C[n, i, k] + C[n, k, i], C[n, k, j] - C[n, j, k]
            length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
            if q[3] < 0.0:
                length = -length
            for axis in range(4):
                q[axis] /= length
            sine = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
            scale = 2.0 if sine < 1e-12 else 2.0 * atan2(sine, q[3]) / sine
            for axis in range(3):
                vectors[n, axis] = scale * q[axis]


def average_windows(
    time: cython.const[cython.double][::1],
    raw_rate: cython.const[cython.double][:, ::1],
    raw_force: cython.const[cython.double][:, ::1],
    gyro_inverse: cython.const[cython.double][:, ::1],
    gyro_bias: cython.const[cython.double][:, ::1],
    force_inverse: cython.const[cython.double][:, ::1],
    force_bias: cython.const[cython.double][::1],
    starts: cython.const[cython.longlong][:],
    stops: cython.const[cython.longlong][:],
    backward: cython.bint,
    means: cython.double[:, ::1],
) -> None:
    """Average the corrected specific force of each window, every sample turned to the window's edge.

    The edge is the last sample, or the first if `backward`. Inside a window the unit is all but at
    rest, so that a rotation vector of first order in each step suffices.
    """
    c = cython.declare(cython.double[9])
    turned = cython.declare(cython.double[9])
    w = cython.declare(cython.double[3])
    last = cython.declare(cython.double[3])
    f = cython.declare(cython.double[3])
    sums = cython.declare(cython.double[3])
    with cython.nogil:
        for k in range(starts.shape[0]):
            _unit(c)
            sums[0] = sums[1] = sums[2] = 0.0
            count = stops[k] - starts[k]
            for n in range(count):
                i = starts[k] + n if backward else stops[k] - 1 - n
                for axis in range(3):
                    w[axis] = f[axis] = 0.0
                    for j in range(3):
                        w[axis] += gyro_inverse[axis, j] * (raw_rate[i, j] - gyro_bias[k, j])
                        f[axis] += force_inverse[axis, j] * (raw_force[i, j] - force_bias[j])
                if n > 0:
                    # Positive going forward from the edge, negative going back to it.
                    half = 0.5 * (time[i] - time[i - 1] if backward else time[i] - time[i + 1])
                    _turn(
                        c, half * (w[0] + last[0]), half * (w[1] + last[1]), half * (w[2] + last[2]), turned
                    )
                    for j in range(9):
                        c[j] = turned[j]
                for axis in range(3):
                    sums[axis] += c[3 * axis] * f[0] + c[3 * axis + 1] * f[1] + c[3 * axis + 2] * f[2]
                    last[axis] = w[axis]
            for axis in range(3):
                means[k, axis] = sums[axis] / count


@cython.locals(w=cython.double, x=cython.double, y=cython.double, z=cython.double)
def transform_sequence(
    rate: cython.const[cython.double][:, ::1],
    force: cython.const[cython.double][:, ::1],
    step: cython.double,
    earth: cython.const[cython.double][::1],
    first_weights: cython.const[cython.double][::1],
    first: cython.Py_ssize_t,
    last_weights: cython.const[cython.double][::1],
    last: cython.Py_ssize_t,
    averages: cython.double[:, ::1],
    C_start_end: cython.double[:, ::1],
) -> None:
    """Carry `rate` from sample to sample and average `force` in the frame of the start over two windows.

    `rate` (samples, 3) rad/s is the mean over each interval of `step` s; `earth` (3,) rad/s turns the frame of the
    start. `averages` (2, 3) receives the weighted sums over the windows that begin at samples `first` and, not
    before that one's end, `last`; `C_start_end` (3, 3) the attitude at the end.
    """
    sums = cython.declare(cython.double[12])
    # the force and its powers of time, the Earth's turn, a cross product
    v = cython.declare(cython.double[3])
    e = cython.declare(cython.double[3])
    across = cython.declare(cython.double[3])
    rotation = cython.declare(cython.double[9])
    with cython.nogil:
        w, x, y, z = 1.0, 0.0, 0.0, 0.0
        for j in range(3):
            averages[0, j] = averages[1, j] = 0.0
            e[j] = earth[j]
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
            for m in range(12):
                sums[m] = 0.0
            for k in range(begin, min(stop, rate.shape[0])):
                p, q, r = half * rate[k, 0], half * rate[k, 1], half * rate[k, 2]
                s = p * p + q * q + r * r
                if s < 1e-3:
                    # sin(h)/h and cos(h) to 1e-17 below 0.03 rad of half an angle
                    sinc = 1.0 + s * (-1.0 / 6 + s * (1.0 / 120 - s * (1.0 / 5040)))
                    cosine = 1.0 + s * (-0.5 + s * (1.0 / 24 - s * (1.0 / 720 - s * (1.0 / 40320))))
                else:
                    h = sqrt(s)
                    sinc, cosine = sin(h) / h, cos(h)
                hx, hy, hz = p * sinc, q * sinc, r * sinc
                w, x, y, z = (
                    w * cosine - x * hx - y * hy - z * hz,
                    w * hx + x * cosine + y * hz - z * hy,
                    w * hy - x * hz + y * cosine + z * hx,
                    w * hz + x * hy - y * hx + z * cosine,
                )
                if window >= 0:
                    weight = weights[k - at]
                    fx, fy, fz = weight * force[k, 0], weight * force[k, 1], weight * force[k, 2]
                    # q f q*, of a unit quaternion
                    tx, ty, tz = 2.0 * (y * fz - z * fy), 2.0 * (z * fx - x * fz), 2.0 * (x * fy - y * fx)
                    v[0] = fx + w * tx + y * tz - z * ty
                    v[1] = fy + w * ty + z * tx - x * tz
                    v[2] = fz + w * tz + x * ty - y * tx
                    t = (k - middle) * step
                    for power in range(4):
                        for j in range(3):
                            sums[3 * power + j] += v[j]
                            v[j] *= t
            begin = max(begin, stop)
            if window < 0:
                continue
            # Back by what the Earth has turned since the start: by a series from the middle of the window, whose fourth
            # power is nothing (1e-8 of gravity in ten minutes), and from there to the start by exp(-[earth t]).
            for j in range(3):
                v[j] = sums[9 + j]
            for power in range(2, -1, -1):
                _cross(e, v, across)
                for j in range(3):
                    v[j] = sums[3 * power + j] - across[j] / (power + 1)
            t = -(middle + 0.5) * step
            square = t * t * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
            _fill_rotation(t * e[0], t * e[1], t * e[2], _sinc(square), _cosc(square), rotation, 0, 1)
            for j in range(3):
                averages[window, j] = (
                    rotation[3 * j] * v[0] + rotation[3 * j + 1] * v[1] + rotation[3 * j + 2] * v[2]
                )
        # I + 2 w [q] + 2 [q]², of the quaternion's vector q
        norm = 1.0 / sqrt(w * w + x * x + y * y + z * z)
        _fill_rotation(x * norm, y * norm, z * norm, 2.0 * w * norm, 2.0, rotation, 0, 1)
        for j in range(9):
            C_start_end[j // 3, j % 3] = rotation[j]


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _cross(a: cython.p_double, b: cython.p_double, made: cython.p_double) -> cython.void:
    """Fill the cross product; `made` is another vector."""
    made[0] = a[1] * b[2] - a[2] * b[1]
    made[1] = a[2] * b[0] - a[0] * b[2]
    made[2] = a[0] * b[1] - a[1] * b[0]
