"""Strapdown navigation, step by step, compiled.

A step takes angular rate and specific force at its two ends, `before` and `after` (six numbers each: rate,
force, in b), as linear in time between. The local-level state `nav` is latitude, longitude, height, velocity
(north, east, down) and the quaternion of C_nb, scalar last; the Earth frame's is position, velocity and the
quaternion of C_eb in e. Euler-type errors are those of the second order of the step everywhere.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit, types

from tumble.earth.gravity import (
    ECCENTRICITY_SQUARED,
    FLATTENING,
    GRAVITY_AT_EQUATOR,
    GRAVITY_RATIO,
    PLUMB_LINE_CURVATURE,
    SEMI_MAJOR_AXIS,
    SOMIGLIANA_CONSTANT,
)
from tumble.earth.site import EARTH_RATE

_A = SEMI_MAJOR_AXIS
_E2 = ECCENTRICITY_SQUARED
_B = _A * (1.0 - FLATTENING)
_SECOND_E2 = _E2 / (1.0 - _E2)
_W = EARTH_RATE
_OPEN = 2.0 / _A * (1.0 + FLATTENING + GRAVITY_RATIO)
_SLOPE = 4.0 / _A * FLATTENING
_BEND = 3.0 / _A**2

Floats: TypeAlias = npt.NDArray[np.float64]

_ROW = types.float64[::1]
_ROWS = types.float64[:, ::1]
_READ_ROW = types.Array(types.float64, 1, "C", readonly=True)
_READ_ROWS = types.Array(types.float64, 2, "C", readonly=True)
# Products fused into sums and no signed zeros; orders are kept, and what is not a number stays so.
_FAST = {"contract", "nsz", "arcp"}


@njit(cache=True, nogil=True, fastmath=_FAST)
def ends_of_interval(before, mean, after, first, interval, previous_interval):
    """Fill rate and force at both ends of an interval from its mean and the one before it, which `before` holds.

    Linear signals: the ends give the mean back, and the two-sample terms of coning and sculling.
    """
    share = 0.0 if first else interval / (interval + previous_interval)
    for j in range(6):
        half = (mean[j] - before[j]) * share if share > 0.0 else 0.0
        before[j] = mean[j] - half
        after[j] = mean[j] + half


@njit(cache=True, nogil=True, fastmath=_FAST)
def body_increments(before, after, interval, increments):
    """Fill rotation vector (3) and velocity increment (3), in b at the step's start, with coning and sculling.

    Coning and sculling for linear signals (Savage 1998, J. Guid. Control Dyn. 21, 19 and 208), the velocity's
    rotation to the third order of the step's angle.
    """
    h = 0.5 * interval
    ax, ay, az = h * (before[0] + after[0]), h * (before[1] + after[1]), h * (before[2] + after[2])
    vx, vy, vz = h * (before[3] + after[3]), h * (before[4] + after[4]), h * (before[5] + after[5])
    k = interval * interval / 12.0
    w0, w1, w2, f0, f1, f2 = before[0], before[1], before[2], before[3], before[4], before[5]
    u0, u1, u2, g0, g1, g2 = after[0], after[1], after[2], after[3], after[4], after[5]
    cx, cy, cz = ay * vz - az * vy, az * vx - ax * vz, ax * vy - ay * vx
    square = ax * ax + ay * ay + az * az
    one, two = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    increments[0] = ax + k * (w1 * u2 - w2 * u1)
    increments[1] = ay + k * (w2 * u0 - w0 * u2)
    increments[2] = az + k * (w0 * u1 - w1 * u0)
    increments[3] = vx + k * (w1 * g2 - w2 * g1 + f1 * u2 - f2 * u1) + one * cx + two * (ay * cz - az * cy)
    increments[4] = vy + k * (w2 * g0 - w0 * g2 + f2 * u0 - f0 * u2) + one * cy + two * (az * cx - ax * cz)
    increments[5] = vz + k * (w0 * g1 - w1 * g0 + f0 * u1 - f1 * u0) + one * cz + two * (ax * cy - ay * cx)


@njit(cache=True, nogil=True, fastmath=_FAST)
def turn_attitude(state, increments, tx, ty, tz):
    """Turn the quaternion state[6:10] by the body's rotation vector from the right and the frame's from the left.

    (tx, ty, tz) is what the frame has turned, rad, small: its quaternion is exact to the fourth order.
    """
    hx, hy, hz = 0.5 * increments[0], 0.5 * increments[1], 0.5 * increments[2]
    s = hx * hx + hy * hy + hz * hz
    if s < 1e-3:
        sinc = 1.0 + s * (-1.0 / 6 + s * (1.0 / 120 - s * (1.0 / 5040)))
        c = 1.0 + s * (-0.5 + s * (1.0 / 24 - s * (1.0 / 720 - s * (1.0 / 40320))))
    else:
        angle = np.sqrt(s)
        sinc, c = np.sin(angle) / angle, np.cos(angle)
    hx, hy, hz = hx * sinc, hy * sinc, hz * sinc
    x, y, z, w = state[6], state[7], state[8], state[9]
    a = w * hx + x * c + y * hz - z * hy
    b = w * hy - x * hz + y * c + z * hx
    d = w * hz + x * hy - y * hx + z * c
    e = w * c - x * hx - y * hy - z * hz
    px, py, pz = -0.5 * tx, -0.5 * ty, -0.5 * tz
    p = 1.0 - 0.5 * (px * px + py * py + pz * pz)
    x = p * a + px * e + py * d - pz * b
    y = p * b - px * d + py * e + pz * a
    z = p * d + px * b - py * a + pz * e
    w = p * e - px * a - py * b - pz * d
    # one Newton step to unit length
    length = 1.5 - 0.5 * (x * x + y * y + z * z + w * w)
    state[6], state[7], state[8], state[9] = x * length, y * length, z * length, w * length


@njit(cache=True, nogil=True, fastmath=_FAST)
def advance(nav, before, after, interval, increments):
    """Carry a local-level state over one step; `increments` (6,) is left with the body's.

    Earth and transport rate, Coriolis and gravity are taken at the step's middle; position by the trapezoid.
    """
    body_increments(before, after, interval, increments)
    x, y, z, w = nav[6], nav[7], nav[8], nav[9]
    vx, vy, vz = increments[3], increments[4], increments[5]
    # C_nb v
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    dn = vx + w * tx + y * tz - z * ty
    de = vy + w * ty + z * tx - x * tz
    dd = vz + w * tz + x * ty - y * tx
    north, east, down = nav[3], nav[4], nav[5]
    height = nav[2] - 0.5 * interval * down
    latitude = nav[0] + 0.5 * interval * north / (_A + height)
    s, c = np.sin(latitude), np.cos(latitude)
    reduced = 1.0 - _E2 * s * s
    root = np.sqrt(reduced)
    across = _A / root
    meridian = across * (1.0 - _E2) / reduced + height
    across += height
    gravity = GRAVITY_AT_EQUATOR * (1.0 + SOMIGLIANA_CONSTANT * s * s) / root
    gravity *= 1.0 - (_OPEN - _SLOPE * s * s) * height + _BEND * height * height
    lean = -PLUMB_LINE_CURVATURE * height * 2.0 * s * c
    middle_north = north + 0.5 * dn
    middle_east = east + 0.5 * de
    middle_down = down + 0.5 * (dd + gravity * interval)
    tangent = s / c
    # transport rate and Earth rate, n against e and e against i
    rn, re = middle_east / across, -middle_north / meridian
    rd = -middle_east / across * tangent
    en, ed = _W * c, -_W * s
    un, ue, ud = 2.0 * en + rn, re, 2.0 * ed + rd
    hn, he, hd = interval * (en + rn), interval * re, interval * (ed + rd)
    new_north = (
        north + dn - 0.5 * (he * dd - hd * de) + interval * (lean - (ue * middle_down - ud * middle_east))
    )
    new_east = east + de - 0.5 * (hd * dn - hn * dd) - interval * (ud * middle_north - un * middle_down)
    new_down = (
        down + dd - 0.5 * (hn * de - he * dn) + interval * (gravity - (un * middle_east - ue * middle_north))
    )
    nav[0] += 0.5 * interval * (north + new_north) / meridian
    nav[1] += 0.5 * interval * (east + new_east) / (across * c)
    nav[2] -= 0.5 * interval * (down + new_down)
    nav[3], nav[4], nav[5] = new_north, new_east, new_down
    turn_attitude(nav, increments, hn, he, hd)


@njit(cache=True, nogil=True, fastmath=_FAST)
def advance_in_earth_frame(state, before, after, interval, increments):
    """Carry a state of the Earth frame over one step, with the same gravity as `advance`."""
    body_increments(before, after, interval, increments)
    x, y, z, w = state[6], state[7], state[8], state[9]
    vx, vy, vz = increments[3], increments[4], increments[5]
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    dx = vx + w * tx + y * tz - z * ty
    dy = vy + w * ty + z * tx - x * tz
    dz = vz + w * tz + x * ty - y * tx
    half = 0.5 * interval
    px, py, pz = state[0] + half * state[3], state[1] + half * state[4], state[2] + half * state[5]
    # latitude by Bowring's formula, without angles
    radius = np.sqrt(px * px + py * py)
    over = 1.0 / np.sqrt((pz * _A) * (pz * _A) + (radius * _B) * (radius * _B))
    sb, cb = pz * _A * over, radius * _B * over
    up, out = pz + _SECOND_E2 * _B * sb * sb * sb, radius - _E2 * _A * cb * cb * cb
    over = 1.0 / np.sqrt(up * up + out * out)
    s, c = up * over, out * over
    root = np.sqrt(1.0 - _E2 * s * s)
    height = radius * c + pz * s - _A * root
    gravity = GRAVITY_AT_EQUATOR * (1.0 + SOMIGLIANA_CONSTANT * s * s) / root
    gravity *= 1.0 - (_OPEN - _SLOPE * s * s) * height + _BEND * height * height
    lean = -PLUMB_LINE_CURVATURE * height * 2.0 * s * c
    outward = -lean * s - gravity * c
    gx, gy = 0.0, 0.0
    if radius > 0.0:
        gx, gy = outward * px / radius, outward * py / radius
    gz = lean * c - gravity * s
    mx = state[3] + 0.5 * (dx + gx * interval)
    my = state[4] + 0.5 * (dy + gy * interval)
    turn = _W * interval
    nx = state[3] + dx + 0.5 * turn * dy + interval * gx + 2.0 * turn * my
    ny = state[4] + dy - 0.5 * turn * dx + interval * gy - 2.0 * turn * mx
    nz = state[5] + dz + interval * gz
    state[0] += half * (state[3] + nx)
    state[1] += half * (state[4] + ny)
    state[2] += half * (state[5] + nz)
    state[3], state[4], state[5] = nx, ny, nz
    turn_attitude(state, increments, 0.0, 0.0, turn)


@njit(cache=True, nogil=True, fastmath=_FAST)
def to_local_level(state, nav):
    """Fill the local-level state of a state of the Earth frame."""
    px, py, pz = state[0], state[1], state[2]
    radius = np.sqrt(px * px + py * py)
    over = 1.0 / np.sqrt((pz * _A) * (pz * _A) + (radius * _B) * (radius * _B))
    sb, cb = pz * _A * over, radius * _B * over
    up, out = 0.0, 0.0
    for _ in range(2):
        up, out = pz + _SECOND_E2 * _B * sb * sb * sb, radius - _E2 * _A * cb * cb * cb
        over = 1.0 / np.sqrt(_B * up * _B * up + _A * out * _A * out)
        sb, cb = _B * up * over, _A * out * over
    over = 1.0 / np.sqrt(up * up + out * out)
    s, c = up * over, out * over
    nav[0] = np.arctan2(up, out)
    nav[1] = np.arctan2(py, px)
    nav[2] = radius * c + pz * s - _A * np.sqrt(1.0 - _E2 * s * s)
    sl, cl = 0.0, 1.0
    if radius > 0.0:
        sl, cl = py / radius, px / radius
    vx, vy, vz = state[3], state[4], state[5]
    outward = cl * vx + sl * vy
    nav[3] = -s * outward + c * vz
    nav[4] = -sl * vx + cl * vy
    nav[5] = -c * outward - s * vz
    # conj(q_en) q_eb with q_en a turn by the longitude about z, then by -(90 deg + latitude) about y
    a, b = 0.5 * nav[1], -0.5 * (0.5 * np.pi + nav[0])
    sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    ex, ey, ez, ew = sa * sb, -ca * sb, -sa * cb, ca * cb
    x, y, z, w = state[6], state[7], state[8], state[9]
    nav[6] = ew * x + ex * w + ey * z - ez * y
    nav[7] = ew * y - ex * z + ey * w + ez * x
    nav[8] = ew * z + ex * y - ey * x + ez * w
    nav[9] = ew * w - ex * x - ey * y - ez * z


@njit(cache=True, nogil=True, fastmath=_FAST)
def keep(state, earth_frame, nav, position, velocity, quaternion, row):
    """Write a state to its row of the outputs."""
    if earth_frame:
        to_local_level(state, nav)
    shown = nav if earth_frame else state
    for j in range(3):
        position[row, j] = shown[j]
        velocity[row, j] = shown[3 + j]
    for j in range(4):
        quaternion[row, j] = shown[6 + j]


@njit(
    [
        types.void(
            _READ_ROW,
            _READ_ROWS,
            _READ_ROWS,
            types.boolean,
            types.boolean,
            types.int64,
            _ROW,
            _ROWS,
            _ROWS,
            _ROWS,
        )
    ],
    cache=True,
    nogil=True,
    fastmath=_FAST,
)
def integrate(
    time: Floats,
    rate: Floats,
    force: Floats,
    means: bool,
    earth_frame: bool,
    every: int,
    state: Floats,
    position: Floats,
    velocity: Floats,
    quaternion: Floats,
) -> None:
    """Carry `state` (10,) through all samples and keep every `every`-th, and the last, beginning with the start.

    `rate` and `force` (samples, 3) in b: at the instants `time`, or, with `means`, the mean over the interval
    that ends there (the first row is then not read). `position` (kept, 3) is latitude, longitude, height,
    `velocity` (kept, 3) and `quaternion` (kept, 4) those of the local level, whatever the frame.
    """
    before, after, mean, increments = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    nav = np.empty(10)
    count = time.shape[0]
    keep(state, earth_frame, nav, position, velocity, quaternion, 0)
    for j in range(3):
        after[j] = rate[0, j]
        after[3 + j] = force[0, j]
    row, kept = 1, 0
    previous = 1.0
    for i in range(1, count):
        interval = time[i] - time[i - 1]
        if means:
            for j in range(3):
                before[j], before[3 + j] = mean[j], mean[3 + j]
                mean[j], mean[3 + j] = rate[i, j], force[i, j]
            ends_of_interval(before, mean, after, i == 1, interval, previous)
            previous = interval
        else:
            for j in range(3):
                before[j], before[3 + j] = after[j], after[3 + j]
                after[j], after[3 + j] = rate[i, j], force[i, j]
        if earth_frame:
            advance_in_earth_frame(state, before, after, interval, increments)
        else:
            advance(state, before, after, interval, increments)
        kept += 1
        if kept == every or i == count - 1:
            keep(state, earth_frame, nav, position, velocity, quaternion, row)
            row += 1
            kept = 0


__all__ = ["advance", "advance_in_earth_frame", "body_increments", "ends_of_interval", "integrate"]
