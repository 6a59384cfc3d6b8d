"""The compiled loops of the strapdown rotation test: raw increments of a unit, and their compensation."""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
import numpy as np
from cython.cimports.libc.math import cos, fabs, floor, sin


def play_sequences(
    rng: np.random.Generator,
    C_bn: cython.const[cython.double][:, :, ::1],
    axes: cython.const[cython.double][:, :, ::1],
    angles: cython.const[cython.double][:, ::1],
    samples: cython.const[cython.longlong][:, ::1],
    window: cython.Py_ssize_t,
    earth: cython.const[cython.double][::1],
    gravity: cython.double,
    step: cython.double,
    triads: cython.const[cython.double][:, :, ::1],
    sigma: cython.const[cython.double][::1],
    pulse: cython.const[cython.double][::1],
    rate: cython.double[:, ::1],
    force: cython.double[:, ::1],
) -> None:
    """Write the raw gyro and accelerometer outputs of all sequences, one after the other, as means over each step.

    `C_bn` (sequences, 3, 3) the attitude at each start; `axes` (sequences, rotations, 3), `angles` and `samples`
    (sequences, rotations) its rotations, those of no samples left out; `window` samples at rest before and after;
    `earth` (3,) rad/s in n; `triads` (2, 5, 3) of gyros and accelerometers: three rows of the matrix, bias,
    asymmetry; `sigma` (2,) noise of one increment; `pulse` (2,) of the integrated output, zero for none. The force
    is written at rest alone: nothing else is needed of it.
    """
    at: cython.Py_ssize_t = 0
    upward: cython.double[::1] = np.array([0.0, 0.0, -gravity])
    C: cython.double[:, ::1] = np.empty((3, 3))
    held: cython.double[:, ::1] = np.empty((2, 3))
    sent: cython.double[:, ::1] = np.empty((2, 3))
    for s in range(C_bn.shape[0]):
        C[:, :] = C_bn[s, :, :]
        for t in range(2):
            for i in range(3):
                # Where between two pulses it begins is chance.
                held[t, i] = pulse[t] * rng.random()
                sent[t, i] = 0.0
        _play_rest(rng, C, earth, upward, window, step, triads, sigma, pulse, held, sent, rate, force, at)
        at += window
        for r in range(axes.shape[1]):
            count = samples[s, r]
            if count == 0:
                continue
            _play_rotation(
                rng,
                C,
                earth,
                axes[s, r],
                angles[s, r],
                count,
                step,
                triads,
                sigma,
                pulse,
                held,
                sent,
                rate,
                force,
                at,
            )
            at += count
            _turn(C, axes[s, r], angles[s, r])
        _play_rest(rng, C, earth, upward, window, step, triads, sigma, pulse, held, sent, rate, force, at)
        at += window


def _play_rest(
    rng: np.random.Generator,
    C: cython.double[:, ::1],
    earth: cython.const[cython.double][::1],
    upward: cython.const[cython.double][::1],
    count: cython.Py_ssize_t,
    step: cython.double,
    triads: cython.const[cython.double][:, :, ::1],
    sigma: cython.const[cython.double][::1],
    pulse: cython.const[cython.double][::1],
    held: cython.double[:, ::1],
    sent: cython.double[:, ::1],
    rate: cython.double[:, ::1],
    force: cython.double[:, ::1],
    at: cython.Py_ssize_t,
) -> None:
    """Rest in an attitude: both triads."""
    per_step = 1.0 / step
    true = cython.declare(cython.double[3])
    for t in range(2):
        _rotated(C, earth if t == 0 else upward, true)
        out = rate if t == 0 else force
        for i in range(3):
            own = triads[t, i, 0] * true[0] + triads[t, i, 1] * true[1] + triads[t, i, 2] * true[2]
            steady = step * (own + triads[t, 4, i] * fabs(own) + triads[t, 3, i])
            noise, size = sigma[t], pulse[t]
            drawn: cython.double[::1] = rng.standard_normal(count if size > 0.0 or noise > 0.0 else 0)
            if size > 0.0:
                per_pulse, inside, last = 1.0 / size, held[t, i], sent[t, i]
                for k in range(count):
                    inside += steady + noise * drawn[k]
                    whole = floor(inside * per_pulse)
                    out[at + k, i] = (whole - last) * size * per_step
                    last = whole
                held[t, i], sent[t, i] = inside, last
            elif noise > 0.0:
                for k in range(count):
                    out[at + k, i] = (steady + noise * drawn[k]) * per_step
            else:
                for k in range(at, at + count):
                    out[k, i] = steady * per_step


def _play_rotation(
    rng: np.random.Generator,
    C: cython.double[:, ::1],
    earth: cython.const[cython.double][::1],
    axis: cython.const[cython.double][::1],
    angle: cython.double,
    count: cython.Py_ssize_t,
    step: cython.double,
    triads: cython.const[cython.double][:, :, ::1],
    sigma: cython.const[cython.double][::1],
    pulse: cython.const[cython.double][::1],
    held: cython.double[:, ::1],
    sent: cython.double[:, ::1],
    rate: cython.double[:, ::1],
    force: cython.double[:, ::1],
    at: cython.Py_ssize_t,
) -> None:
    """Turn evenly about an axis of the unit, the Earth going round in its frame: gyros alone, increments exact."""
    e = cython.declare(cython.double[3])
    across = cython.declare(cython.double[3])
    constant = cython.declare(cython.double[3])
    by_cosine = cython.declare(cython.double[3])
    by_sine = cython.declare(cython.double[3])
    _rotated(C, earth, e)
    per_step = 1.0 / step
    along = axis[0] * e[0] + axis[1] * e[1] + axis[2] * e[2]
    delta = angle / count
    # the mean of cosine and sine over a step is that at its middle times this
    mean = sin(0.5 * delta) / (0.5 * delta)
    across[0] = axis[1] * e[2] - axis[2] * e[1]
    across[1] = axis[2] * e[0] - axis[0] * e[2]
    across[2] = axis[0] * e[1] - axis[1] * e[0]
    for i in range(3):
        constant[i] = by_cosine[i] = by_sine[i] = 0.0
        for j in range(3):
            constant[i] += triads[0, i, j] * (angle / (count * step) + along) * axis[j]
            by_cosine[i] += triads[0, i, j] * (e[j] - along * axis[j]) * mean
            by_sine[i] -= triads[0, i, j] * across[j] * mean
    cosine, sine = cos(0.5 * delta), sin(0.5 * delta)
    turn_cosine, turn_sine = cos(delta), sin(delta)
    drawn: cython.double[:, ::1] = rng.standard_normal((count if sigma[0] > 0.0 else 0, 3))
    for k in range(at, at + count):
        for i in range(3):
            own = constant[i] + by_cosine[i] * cosine + by_sine[i] * sine
            increment = step * (own + triads[0, 4, i] * fabs(own) + triads[0, 3, i])
            if sigma[0] > 0.0:
                increment += sigma[0] * drawn[k - at, i]
            if pulse[0] > 0.0:
                held[0, i] += increment
                whole = floor(held[0, i] / pulse[0])
                increment = (whole - sent[0, i]) * pulse[0]
                sent[0, i] = whole
            rate[k, i] = increment * per_step
            force[k, i] = 0.0
        before = cosine
        cosine = before * turn_cosine - sine * turn_sine
        sine = sine * turn_cosine + before * turn_sine


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _rotated(
    C: cython.double[:, ::1], vector: cython.const[cython.double][::1], result: cython.p_double
) -> cython.void:
    """Fill C @ vector."""
    for i in range(3):
        result[i] = C[i, 0] * vector[0] + C[i, 1] * vector[1] + C[i, 2] * vector[2]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _turn(
    C: cython.double[:, ::1],
    axis: cython.const[cython.double][::1],
    angle: cython.double,
) -> cython.void:
    """Replace C_bn by that after a rotation about an axis of b: fixed vectors turn the other way."""
    cosine, sine = cos(angle), sin(angle)
    for j in range(3):
        x, y, z = C[0, j], C[1, j], C[2, j]
        along = (1.0 - cosine) * (axis[0] * x + axis[1] * y + axis[2] * z)
        C[0, j] = cosine * x + along * axis[0] - sine * (axis[1] * z - axis[2] * y)
        C[1, j] = cosine * y + along * axis[1] - sine * (axis[2] * x - axis[0] * z)
        C[2, j] = cosine * z + along * axis[2] - sine * (axis[0] * y - axis[1] * x)


@cython.locals(x=cython.double, y=cython.double, z=cython.double)
def compensate(
    raw: cython.const[cython.double][:, :],
    bias: cython.const[cython.double][:],
    asymmetry: cython.const[cython.double][:],
    inverse: cython.const[cython.double][:, :],
    true: cython.double[:, ::1],
) -> None:
    """Write the inputs for raw outputs (samples, 3): each sensor's own input first, then the cross-coupling.

    The asymmetry takes the sign of the sensor's own input, which is that of its output without the bias.
    """
    with cython.nogil:
        for k in range(raw.shape[0]):
            x, y, z = raw[k, 0] - bias[0], raw[k, 1] - bias[1], raw[k, 2] - bias[2]
            x /= 1.0 + asymmetry[0] if x > 0.0 else 1.0 - asymmetry[0]
            y /= 1.0 + asymmetry[1] if y > 0.0 else 1.0 - asymmetry[1]
            z /= 1.0 + asymmetry[2] if z > 0.0 else 1.0 - asymmetry[2]
            true[k, 0] = inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z
            true[k, 1] = inverse[1, 0] * x + inverse[1, 1] * y + inverse[1, 2] * z
            true[k, 2] = inverse[2, 0] * x + inverse[2, 1] * y + inverse[2, 2] * z


__all__ = ["compensate", "play_sequences"]
