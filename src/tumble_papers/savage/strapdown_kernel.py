"""The compiled loops of the strapdown rotation test: raw increments of a unit, and their compensation."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def play_sequences(
    rng: np.random.Generator,
    C_bn: np.ndarray,
    axes: np.ndarray,
    angles: np.ndarray,
    samples: np.ndarray,
    window: int,
    earth: np.ndarray,
    gravity: float,
    step: float,
    triads: np.ndarray,
    sigma: np.ndarray,
    pulse: np.ndarray,
    rate: np.ndarray,
    force: np.ndarray,
) -> None:
    """Write the raw gyro and accelerometer outputs of all sequences, one after the other, as means over each step.

    `C_bn` (sequences, 3, 3) the attitude at each start; `axes` (sequences, rotations, 3), `angles` and `samples`
    (sequences, rotations) its rotations, those of no samples left out; `window` samples at rest before and after;
    `earth` (3,) rad/s in n; `triads` (2, 5, 3) of gyros and accelerometers: three rows of the matrix, bias,
    asymmetry; `sigma` (2,) noise of one increment; `pulse` (2,) of the integrated output, zero for none. The force
    is written at rest alone: nothing else is needed of it.
    """
    at = 0
    upward = np.array([0.0, 0.0, -gravity])
    C = np.empty((3, 3))
    held, sent = np.empty((2, 3)), np.empty((2, 3))
    for s in range(C_bn.shape[0]):
        C[:, :] = C_bn[s]
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


@njit(cache=True, nogil=True)
def _play_rest(
    rng: np.random.Generator,
    C: np.ndarray,
    earth: np.ndarray,
    upward: np.ndarray,
    count: int,
    step: float,
    triads: np.ndarray,
    sigma: np.ndarray,
    pulse: np.ndarray,
    held: np.ndarray,
    sent: np.ndarray,
    rate: np.ndarray,
    force: np.ndarray,
    at: int,
) -> None:
    """Rest in an attitude: both triads."""
    per_step = 1.0 / step
    for t in range(2):
        true = C @ (earth if t == 0 else upward)
        out = rate if t == 0 else force
        for i in range(3):
            own = triads[t, i, 0] * true[0] + triads[t, i, 1] * true[1] + triads[t, i, 2] * true[2]
            steady = step * (own + triads[t, 4, i] * abs(own) + triads[t, 3, i])
            noise, size = sigma[t], pulse[t]
            if size > 0.0:
                per_pulse, inside, last = 1.0 / size, held[t, i], sent[t, i]
                for k in range(at, at + count):
                    inside += steady + noise * rng.standard_normal()
                    whole = np.floor(inside * per_pulse)
                    out[k, i] = (whole - last) * size * per_step
                    last = whole
                held[t, i], sent[t, i] = inside, last
            elif noise > 0.0:
                for k in range(at, at + count):
                    out[k, i] = (steady + noise * rng.standard_normal()) * per_step
            else:
                for k in range(at, at + count):
                    out[k, i] = steady * per_step


@njit(cache=True, nogil=True)
def _play_rotation(
    rng: np.random.Generator,
    C: np.ndarray,
    earth: np.ndarray,
    axis: np.ndarray,
    angle: float,
    count: int,
    step: float,
    triads: np.ndarray,
    sigma: np.ndarray,
    pulse: np.ndarray,
    held: np.ndarray,
    sent: np.ndarray,
    rate: np.ndarray,
    force: np.ndarray,
    at: int,
) -> None:
    """Turn evenly about an axis of the unit, the Earth going round in its frame: gyros alone, increments exact."""
    e = C @ earth
    per_step = 1.0 / step
    along = axis[0] * e[0] + axis[1] * e[1] + axis[2] * e[2]
    delta = angle / count
    # the mean of cosine and sine over a step is that at its middle times this
    mean = np.sin(0.5 * delta) / (0.5 * delta)
    across = np.empty(3)
    across[0] = axis[1] * e[2] - axis[2] * e[1]
    across[1] = axis[2] * e[0] - axis[0] * e[2]
    across[2] = axis[0] * e[1] - axis[1] * e[0]
    constant, by_cosine, by_sine = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        for j in range(3):
            constant[i] += triads[0, i, j] * (angle / (count * step) + along) * axis[j]
            by_cosine[i] += triads[0, i, j] * (e[j] - along * axis[j]) * mean
            by_sine[i] -= triads[0, i, j] * across[j] * mean
    cosine, sine = np.cos(0.5 * delta), np.sin(0.5 * delta)
    turn_cosine, turn_sine = np.cos(delta), np.sin(delta)
    for k in range(at, at + count):
        for i in range(3):
            own = constant[i] + by_cosine[i] * cosine + by_sine[i] * sine
            increment = step * (own + triads[0, 4, i] * abs(own) + triads[0, 3, i])
            if sigma[0] > 0.0:
                increment += sigma[0] * rng.standard_normal()
            if pulse[0] > 0.0:
                held[0, i] += increment
                whole = np.floor(held[0, i] / pulse[0])
                increment = (whole - sent[0, i]) * pulse[0]
                sent[0, i] = whole
            rate[k, i] = increment * per_step
            force[k, i] = 0.0
        cosine, sine = cosine * turn_cosine - sine * turn_sine, sine * turn_cosine + cosine * turn_sine


@njit(cache=True, nogil=True)
def _turn(C: np.ndarray, axis: np.ndarray, angle: float) -> None:
    """Replace C_bn by that after a rotation about an axis of b: fixed vectors turn the other way."""
    cosine, sine = np.cos(angle), np.sin(angle)
    for j in range(3):
        x, y, z = C[0, j], C[1, j], C[2, j]
        along = (1.0 - cosine) * (axis[0] * x + axis[1] * y + axis[2] * z)
        C[0, j] = cosine * x + along * axis[0] - sine * (axis[1] * z - axis[2] * y)
        C[1, j] = cosine * y + along * axis[1] - sine * (axis[2] * x - axis[0] * z)
        C[2, j] = cosine * z + along * axis[2] - sine * (axis[0] * y - axis[1] * x)


@njit(cache=True, nogil=True)
def compensate(
    raw: np.ndarray, bias: np.ndarray, asymmetry: np.ndarray, inverse: np.ndarray, true: np.ndarray
) -> None:
    """Write the inputs for raw outputs (samples, 3): each sensor's own input first, then the cross-coupling.

    The asymmetry takes the sign of the sensor's own input, which is that of its output without the bias.
    """
    up, down = 1.0 / (1.0 + asymmetry), 1.0 / (1.0 - asymmetry)
    for k in range(raw.shape[0]):
        x, y, z = raw[k, 0] - bias[0], raw[k, 1] - bias[1], raw[k, 2] - bias[2]
        x *= up[0] if x > 0.0 else down[0]
        y *= up[1] if y > 0.0 else down[1]
        z *= up[2] if z > 0.0 else down[2]
        true[k, 0] = inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z
        true[k, 1] = inverse[1, 0] * x + inverse[1, 1] * y + inverse[1, 2] * z
        true[k, 2] = inverse[2, 0] * x + inverse[2, 1] * y + inverse[2, 2] * z


__all__ = ["compensate", "play_sequences"]
