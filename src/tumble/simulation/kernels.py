"""Loops over samples, compiled: recursions, of which those with noise draw their own numbers, and a motion's attitudes.

The numbers are drawn a few thousand at a time, in their order: a seed gives the same ones however many are asked for.
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import atan2, cos, floor, sin, sqrt

_DRAWN = cython.declare(cython.Py_ssize_t, 4096)


def add_white(rng: np.random.Generator, scale: cython.double, total: cython.double[::1]) -> None:
    """Add white noise to all numbers in their order."""
    buffer = np.empty(min(_DRAWN, total.shape[0]))
    drawn: cython.double[::1] = buffer
    for begin in range(0, total.shape[0], _DRAWN):
        count = min(_DRAWN, total.shape[0] - begin)
        rng.standard_normal(out=buffer[:count])
        with cython.nogil:
            for i in range(count):
                total[begin + i] += scale * drawn[i]


@cython.locals(value=cython.double, x=cython.double)
def add_markov(
    rng: np.random.Generator,
    memory: cython.const[cython.double][::1],
    gain: cython.const[cython.double][::1],
    state: cython.double[:, ::1],
    total: cython.double[:, ::1],
) -> None:
    """Add to each column the sum of the processes x_j[i] = memory_j x_j[i - 1] + gain_j z[i], the same z for all.

    `state` is (columns, processes), before the first sample, and is left as it is after the last.
    """
    processes = memory.shape[0]
    buffer = np.empty((min(_DRAWN, total.shape[0]), total.shape[1]))
    drawn: cython.double[:, ::1] = buffer
    for begin in range(0, total.shape[0], _DRAWN):
        count = min(_DRAWN, total.shape[0] - begin)
        rng.standard_normal(out=buffer[:count])
        with cython.nogil:
            for i in range(count):
                for axis in range(total.shape[1]):
                    value = 0.0
                    for j in range(processes):
                        x = memory[j] * state[axis, j] + gain[j] * drawn[i, axis]
                        state[axis, j] = x
                        value += x
                    total[begin + i, axis] += value


def add_walk(rng: np.random.Generator, step: cython.double, total: cython.double[:, ::1]) -> None:
    """Add to each of three columns a random walk x[i] = x[i - 1] + step z[i] from x = 0."""
    x: cython.double = 0.0
    y: cython.double = 0.0
    z: cython.double = 0.0
    buffer = np.empty((min(_DRAWN, total.shape[0]), 3))
    drawn: cython.double[:, ::1] = buffer
    for begin in range(0, total.shape[0], _DRAWN):
        count = min(_DRAWN, total.shape[0] - begin)
        rng.standard_normal(out=buffer[:count])
        with cython.nogil:
            for i in range(count):
                x += step * drawn[i, 0]
                y += step * drawn[i, 1]
                z += step * drawn[i, 2]
                total[begin + i, 0] += x
                total[begin + i, 1] += y
                total[begin + i, 2] += z


@cython.locals(remainder=cython.double, wanted=cython.double)
def carry_remainders(signal: cython.double[:, ::1], step: cython.double) -> None:
    """Round each column to whole steps in place, what is left over going to the next sample."""
    with cython.nogil:
        for axis in range(signal.shape[1]):
            remainder = 0.0
            for i in range(signal.shape[0]):
                wanted = signal[i, axis] / step + remainder
                whole = floor(wanted + 0.5)
                remainder = wanted - whole
                signal[i, axis] = whole * step


def fill_progress(
    time: cython.const[cython.double][::1],
    edges: cython.const[cython.double][::1],
    ramp_up: cython.const[cython.double][::1],
    ramp_down: cython.const[cython.double][::1],
    step: cython.longlong[::1],
    progress: cython.double[:, ::1],
) -> None:
    """Fill the step of each time, and (3, samples) the share of it done with its first and second time derivative.

    Holds (even steps) go on evenly, turns as ``10 x³ − 15 x⁴ + 6 x⁵``, spins (whose ramps are numbers) as
    `_fill_spin` says.
    """
    now: cython.Py_ssize_t = 0
    last: cython.Py_ssize_t = edges.shape[0] - 2
    with cython.nogil:
        for k in range(time.shape[0]):
            while now < last and time[k] >= edges[now + 1]:
                now += 1
            while now > 0 and time[k] < edges[now]:
                now -= 1
            step[k] = now
            length = edges[now + 1] - edges[now]
            elapsed = min(max(time[k] - edges[now], 0.0), length)
            x = elapsed / length
            y = 1.0 - x
            if now % 2 == 0:
                progress[0, k], progress[2, k] = x, 0.0
                progress[1, k] = 1.0 / length if x > 0.0 and x < 1.0 else 0.0
            elif ramp_up[now] == ramp_up[now]:
                _fill_spin(elapsed, length, ramp_up[now], ramp_down[now], progress, k)
            else:
                progress[0, k] = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
                progress[1, k] = 30.0 * x * x * y * y / length
                progress[2, k] = 60.0 * x * y * (1.0 - 2.0 * x) / (length * length)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _fill_spin(
    elapsed: cython.double,
    length: cython.double,
    ramp_up: cython.double,
    ramp_down: cython.double,
    progress: cython.double[:, ::1],
    k: cython.Py_ssize_t,
) -> cython.void:
    """Fill the share of a spin's angle without waves, and its first and second time derivative.

    The speed rises as ``10 x³ − 15 x⁴ + 6 x⁵`` over the ramp, whose integral is ``5/2 x⁴ − 3 x⁵ + x⁶`` and a half at
    its end, stays, and falls the same way: the whole angle is the rate times length less half of each ramp. Without a
    ramp the speed jumps.
    """
    late: cython.bint = elapsed > 0.5 * (length + (ramp_up - ramp_down))
    near = length - elapsed if late else elapsed
    ramp = ramp_down if late else ramp_up
    whole = length - 0.5 * (ramp_up + ramp_down)
    way, speed, gain = near - 0.5 * ramp, 1.0, 0.0
    if near < ramp:
        x = near / ramp
        way = ramp * x * x * x * x * (2.5 - 3.0 * x + x * x)
        speed = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        gain = 30.0 * x * x * (1.0 - x) * (1.0 - x) / ramp
    progress[0, k] = 1.0 - way / whole if late else way / whole
    progress[1, k] = speed / whole
    progress[2, k] = (-gain if late else gain) / whole


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _turn(q: cython.p_double, x: cython.double, y: cython.double, z: cython.double) -> cython.void:
    """Turn the quaternion q, scalar last, on by the rotation vector (x, y, z) rad."""
    square = x * x + y * y + z * z
    if square < 1e-4:
        scale = 0.5 - square * (1.0 / 48.0 - square * (1.0 / 3840.0 - square * (1.0 / 645120.0)))
        w = 1.0 - square * (1.0 / 8.0 - square * (1.0 / 384.0 - square * (1.0 / 46080.0)))
    else:
        angle = sqrt(square)
        scale, w = sin(0.5 * angle) / angle, cos(0.5 * angle)
    _multiply(q, scale * x, scale * y, scale * z, w)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _multiply(
    q: cython.p_double, i: cython.double, j: cython.double, k: cython.double, s: cython.double
) -> cython.void:
    """Multiply the quaternion q by another one from the right, in place."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    q[0] = w * i + x * s + y * k - z * j
    q[1] = w * j - x * k + y * s + z * i
    q[2] = w * k + x * j - y * i + z * s
    q[3] = w * s - x * i - y * j - z * k


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _path(
    first: cython.const[cython.double][:, ::1],
    vector: cython.const[cython.double][:, ::1],
    step: cython.longlong,
    share: cython.double,
    q: cython.p_double,
) -> cython.void:
    """Fill the attitude after a share of a step."""
    for m in range(4):
        q[m] = first[step, m]
    _turn(q, vector[step, 0] * share, vector[step, 1] * share, vector[step, 2] * share)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _turn_on(
    vectors: cython.const[cython.double][:, ::1], k: cython.Py_ssize_t, q: cython.p_double
) -> cython.void:
    """Turn a quaternion on by a row of rotation vectors, if there are any."""
    if vectors.shape[0] > 0:
        _turn(q, vectors[k, 0], vectors[k, 1], vectors[k, 2])


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _see(
    q: cython.p_double, vector_n: cython.const[cython.double][::1], seen: cython.p_double
) -> cython.void:
    """Fill a vector's components in the frame of the attitude q."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    a, b, c = vector_n[0], vector_n[1], vector_n[2]
    # v - 2 w (r x v) + 2 r x (r x v)
    i, j, k = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    seen[0] = a - w * i + (y * k - z * j)
    seen[1] = b - w * j + (z * i - x * k)
    seen[2] = c - w * k + (x * j - y * i)


def chain_turns(
    vector: cython.const[cython.double][:, ::1],
    wobble: cython.const[cython.double][:, ::1],
    first: cython.double[:, ::1],
) -> None:
    """Fill (steps, 4) the attitude before each step, from that before the first one on."""
    with cython.nogil:
        for k in range(first.shape[0] - 1):
            q = cython.address(first[k + 1, 0])
            _path(first, vector, k, 1.0, q)
            _turn_on(wobble, k, q)


def fill_attitudes(
    first: cython.const[cython.double][:, ::1],
    vector: cython.const[cython.double][:, ::1],
    step: cython.const[cython.longlong][::1],
    share: cython.const[cython.double][::1],
    wobble: cython.const[cython.double][:, ::1],
    shake: cython.const[cython.double][:, ::1],
    quaternions: cython.double[:, ::1],
) -> None:
    """Fill (samples, 4) the attitude after a share of each sample's step, with what wobbles and shakes, if anything.

    `first` and `vector` are (steps, 4) and (steps, 3): attitude before a step, and its rotation vector, rad.
    """
    with cython.nogil:
        for k in range(step.shape[0]):
            q = cython.address(quaternions[k, 0])
            _path(first, vector, step[k], share[k], q)
            _turn_on(wobble, k, q)
            _turn_on(shake, k, q)


def fill_seen(
    quaternions: cython.double[:, ::1],
    vector_n: cython.const[cython.double][::1],
    seen: cython.double[:, ::1],
) -> None:
    """Fill (samples, 3) the components of one vector in the frame of each attitude."""
    with cython.nogil:
        for k in range(quaternions.shape[0]):
            _see(cython.address(quaternions[k, 0]), vector_n, cython.address(seen[k, 0]))


def fill_mean_rates(
    first: cython.const[cython.double][:, ::1],
    vector: cython.const[cython.double][:, ::1],
    step: cython.const[cython.longlong][::1],
    share: cython.const[cython.double][::1],
    wobble: cython.const[cython.double][:, ::1],
    shake: cython.const[cython.double][:, ::1],
    edges: cython.const[cython.double][::1],
    earth_n: cython.const[cython.double][::1],
    rates: cython.double[:, ::1],
) -> None:
    """Fill (samples, 3) the rotation vector from each edge to the next over the time between, the Earth's included.

    Arguments as of `fill_attitudes`, one row for each edge.
    """
    before = cython.declare(cython.double[4])
    after = cython.declare(cython.double[4])
    added = cython.declare(cython.double[4])
    moved = cython.declare(cython.double[4])
    q = cython.declare(cython.double[4])
    e = cython.declare(cython.double[3])
    with cython.nogil:
        _path(first, vector, step[0], share[0], after)
        for k in range(rates.shape[0]):
            interval, s = edges[k + 1] - edges[k], step[k]
            for m in range(4):
                before[m] = added[m] = after[m]
            _path(first, vector, step[k + 1], share[k + 1], after)
            _turn_on(wobble, k, added)
            _turn_on(shake, k, added)
            _see(added, earth_n, e)
            q[0] = q[1] = q[2] = 0.0
            q[3] = 1.0
            _turn(q, interval * e[0], interval * e[1], interval * e[2])
            if shake.shape[0] > 0:
                _turn(q, -shake[k, 0], -shake[k, 1], -shake[k, 2])
            if wobble.shape[0] > 0:
                _turn(q, -wobble[k, 0], -wobble[k, 1], -wobble[k, 2])
            moved[0] = moved[1] = moved[2] = 0.0
            moved[3] = 1.0
            if step[k + 1] == s:
                # From the angle, which keeps all digits; a difference of attitudes loses some.
                share_now = share[k + 1] - share[k]
                _turn(moved, vector[s, 0] * share_now, vector[s, 1] * share_now, vector[s, 2] * share_now)
            else:
                _multiply(moved, -before[0], -before[1], -before[2], before[3])
                _multiply(moved, after[0], after[1], after[2], after[3])
            _multiply(q, moved[0], moved[1], moved[2], moved[3])
            _turn_on(wobble, k + 1, q)
            _turn_on(shake, k + 1, q)
            sine = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
            scale = 2.0 if sine < 1e-12 else 2.0 * atan2(sine, abs(q[3])) / sine
            if q[3] < 0.0:
                scale = -scale
            for m in range(3):
                rates[k, m] = scale * q[m] / interval


__all__ = [
    "add_markov",
    "add_walk",
    "add_white",
    "carry_remainders",
    "chain_turns",
    "fill_attitudes",
    "fill_mean_rates",
    "fill_progress",
    "fill_seen",
]
