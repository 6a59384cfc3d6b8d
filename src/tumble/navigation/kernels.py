"""Strapdown navigation, step by step, compiled.

A step takes angular rate and specific force (six numbers, in b) as linear in time. The local-level state is
latitude, longitude, height, velocity (north, east, down) and the quaternion of C_nb, scalar last; the Earth
frame's is position, velocity and the quaternion of C_eb in e. Euler-type errors are those of the second order of
the step everywhere.

States and increments are tuples, which stay in registers. What costs is the chain from one state to the next, so
that a step has one root and one division: sine and cosine of the latitude are turned from a place nearby.
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
Place: TypeAlias = tuple[float, float, float]

_ROW = types.float64[::1]
_ROWS = types.float64[:, ::1]
_READ_ROW = types.Array(types.float64, 1, "C", readonly=True)
_READ_ROWS = types.Array(types.float64, 2, "C", readonly=True)
# Products fused into sums and no signed zeros; orders are kept, and what is not a number stays so.
_FAST = {"contract", "nsz", "arcp"}
_INLINE = {"cache": True, "nogil": True, "fastmath": _FAST, "forceinline": True}
# Up to here from a latitude, rad, the series of its sine to the third order is exact: 2e-4**4 / 24 is 7e-17.
_NEAR = 2e-4
# A place that no latitude is near.
NOWHERE = (1e9, 0.0, 0.0)


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


@njit(**_INLINE)
def sample(rate, force, row):
    """Return rate and force of a row."""
    return rate[row, 0], rate[row, 1], rate[row, 2], force[row, 0], force[row, 1], force[row, 2]


@njit(**_INLINE)
def body_increments(old, new, weight, share, interval):
    """Return rotation vector (3) and velocity increment (3), in b at the step's start, with coning and sculling.

    The signals' mean over the step is `new + weight (old - new)` and their change over half of it `share (new -
    old)`: 1/2 and 1/2 of instants. Coning and sculling for linear signals (Savage 1998, J. Guid. Control Dyn. 21,
    19 and 208), the velocity's rotation to the third order of the step's angle.
    """
    w0, w1, w2 = (
        new[0] + weight * (old[0] - new[0]),
        new[1] + weight * (old[1] - new[1]),
        new[2] + weight * (old[2] - new[2]),
    )
    f0, f1, f2 = (
        new[3] + weight * (old[3] - new[3]),
        new[4] + weight * (old[4] - new[4]),
        new[5] + weight * (old[5] - new[5]),
    )
    u0, u1, u2 = share * (new[0] - old[0]), share * (new[1] - old[1]), share * (new[2] - old[2])
    g0, g1, g2 = share * (new[3] - old[3]), share * (new[4] - old[4]), share * (new[5] - old[5])
    ax, ay, az = interval * w0, interval * w1, interval * w2
    vx, vy, vz = interval * f0, interval * f1, interval * f2
    cx, cy, cz = ay * vz - az * vy, az * vx - ax * vz, ax * vy - ay * vx
    square = ax * ax + ay * ay + az * az
    one, two = 0.5 - square * (1.0 / 24.0), 1.0 / 6.0 - square * (1.0 / 120.0)
    k = interval * interval * (1.0 / 6.0)
    return (
        ax + k * (w1 * u2 - w2 * u1),
        ay + k * (w2 * u0 - w0 * u2),
        az + k * (w0 * u1 - w1 * u0),
        vx + k * (w1 * g2 - w2 * g1 + f1 * u2 - f2 * u1) + one * cx + two * (ay * cz - az * cy),
        vy + k * (w2 * g0 - w0 * g2 + f2 * u0 - f0 * u2) + one * cy + two * (az * cx - ax * cz),
        vz + k * (w0 * g1 - w1 * g0 + f0 * u1 - f1 * u0) + one * cz + two * (ax * cy - ay * cx),
    )


@njit(**_INLINE)
def turned_velocity(state, increments):
    """Return the velocity increment in the frame of the state's quaternion."""
    x, y, z, w = state[6], state[7], state[8], state[9]
    vx, vy, vz = increments[3], increments[4], increments[5]
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


@njit(**_INLINE)
def turned_attitude(state, increments, tx, ty, tz):
    """Return the state's quaternion turned by the body's rotation vector from the right, the frame's from the left.

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
    x, y, z, w = state[6], state[7], state[8], state[9]
    # one Newton step to unit length
    length = 1.5 - 0.5 * (x * x + y * y + z * z + w * w)
    hx, hy, hz, c = hx * sinc * length, hy * sinc * length, hz * sinc * length, c * length
    a = w * hx + x * c + y * hz - z * hy
    b = w * hy - x * hz + y * c + z * hx
    d = w * hz + x * hy - y * hx + z * c
    e = w * c - x * hx - y * hy - z * hz
    px, py, pz = -0.5 * tx, -0.5 * ty, -0.5 * tz
    p = 1.0 - 0.5 * (px * px + py * py + pz * pz)
    return (
        p * a + px * e + py * d - pz * b,
        p * b - px * d + py * e + pz * a,
        p * d + px * b - py * a + pz * e,
        p * e - px * a - py * b - pz * d,
    )


@njit(**_INLINE)
def sine_and_cosine(latitude: float, place: Place) -> tuple[float, float, Place]:
    """Return sine and cosine of a latitude, and the place (latitude, its sine and cosine) for the next one.

    Near the place they are turned from there, exact to rounding; further off it is moved here.
    """
    turn = latitude - place[0]
    if abs(turn) > _NEAR:
        s, c = np.sin(latitude), np.cos(latitude)
        return s, c, (latitude, s, c)
    square = turn * turn
    odd, even = turn - turn * square * (1.0 / 6.0), 1.0 - 0.5 * square
    return place[1] * even + place[2] * odd, place[2] * even - place[1] * odd, place


@njit(**_INLINE)
def reciprocals(s, c, height):
    """Return 1 over the radius across the meridian, that along it, cos latitude and root, by one division.

    The root is of 1 - e² sin²; with it the radii are (a + h root) / root and (a (1 - e²) + h root³) / root³.
    """
    reduced = 1.0 - _E2 * s * s
    root = np.sqrt(reduced)
    cube = reduced * root
    across, meridian = _A + height * root, _A * (1.0 - _E2) + height * cube
    one, two = across * c, meridian * root
    over = 1.0 / (one * two)
    return (
        root * (over * (c * two)),
        cube * (over * (root * one)),
        over * (across * two),
        over * (one * meridian),
    )


@njit(**_INLINE)
def gravity_down_and_north(s, c, over_root, height):
    """Return normal gravity (Somigliana, with height to the second order) and its lean to the north, m/s²."""
    gravity = GRAVITY_AT_EQUATOR * (1.0 + SOMIGLIANA_CONSTANT * s * s) * over_root
    gravity *= 1.0 - (_OPEN - _SLOPE * s * s) * height + _BEND * height * height
    return gravity, -PLUMB_LINE_CURVATURE * height * 2.0 * s * c


@njit(**_INLINE)
def step_in_local_level(nav, increments, place, interval):
    """Return the local-level state after a step, and the place for the next.

    Earth and transport rate, Coriolis and gravity are taken at the step's middle; position by the trapezoid.
    """
    dn, de, dd = turned_velocity(nav, increments)
    north, east, down = nav[3], nav[4], nav[5]
    half = 0.5 * interval
    height = nav[2] - half * down
    s, c, place = sine_and_cosine(nav[0] + half * north / (_A + height), place)
    over_across, over_meridian, over_c, over_root = reciprocals(s, c, height)
    gravity, lean = gravity_down_and_north(s, c, over_root, height)
    middle_north = north + 0.5 * dn
    middle_east = east + 0.5 * de
    middle_down = down + 0.5 * (dd + gravity * interval)
    # transport rate and Earth rate, n against e and e against i
    rn, re = middle_east * over_across, -middle_north * over_meridian
    rd = -rn * (s * over_c)
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
    after = (
        nav[0] + half * (north + new_north) * over_meridian,
        nav[1] + half * (east + new_east) * (over_across * over_c),
        nav[2] - half * (down + new_down),
        new_north,
        new_east,
        new_down,
        *turned_attitude(nav, increments, hn, he, hd),
    )
    return after, place


@njit(**_INLINE)
def step_in_earth_frame(state, increments, interval):
    """Return the state of the Earth frame after a step, with the same gravity as in the local level."""
    dx, dy, dz = turned_velocity(state, increments)
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
    gravity, lean = gravity_down_and_north(s, c, 1.0 / root, height)
    outward = (-lean * s - gravity * c) / radius if radius > 0.0 else 0.0
    gx, gy, gz = outward * px, outward * py, lean * c - gravity * s
    mx, my = state[3] + 0.5 * (dx + gx * interval), state[4] + 0.5 * (dy + gy * interval)
    turn = _W * interval
    nx = state[3] + dx + 0.5 * turn * dy + interval * gx + 2.0 * turn * my
    ny = state[4] + dy - 0.5 * turn * dx + interval * gy - 2.0 * turn * mx
    nz = state[5] + dz + interval * gz
    return (
        state[0] + half * (state[3] + nx),
        state[1] + half * (state[4] + ny),
        state[2] + half * (state[5] + nz),
        nx,
        ny,
        nz,
        *turned_attitude(state, increments, 0.0, 0.0, turn),
    )


@njit(**_INLINE)
def to_local_level(state):
    """Return the local-level state of a state of the Earth frame."""
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
    latitude, longitude = np.arctan2(up, out), np.arctan2(py, px)
    sl, cl = 0.0, 1.0
    if radius > 0.0:
        sl, cl = py / radius, px / radius
    vx, vy, vz = state[3], state[4], state[5]
    outward = cl * vx + sl * vy
    # conj(q_en) q_eb with q_en a turn by the longitude about z, then by -(90 deg + latitude) about y
    a, b = 0.5 * longitude, -0.5 * (0.5 * np.pi + latitude)
    sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    ex, ey, ez, ew = sa * sb, -ca * sb, -sa * cb, ca * cb
    x, y, z, w = state[6], state[7], state[8], state[9]
    return (
        latitude,
        longitude,
        radius * c + pz * s - _A * np.sqrt(1.0 - _E2 * s * s),
        -s * outward + c * vz,
        -sl * vx + cl * vy,
        -c * outward - s * vz,
        ew * x + ex * w + ey * z - ez * y,
        ew * y - ex * z + ey * w + ez * x,
        ew * z + ex * y - ey * x + ez * w,
        ew * w - ex * x - ey * y - ez * z,
    )


@njit(**_INLINE)
def unpacked(state):
    """Return a state's array (10,) as a tuple."""
    return (
        *(state[0], state[1], state[2], state[3], state[4]),
        *(state[5], state[6], state[7], state[8], state[9]),
    )


@njit(cache=True, nogil=True, fastmath=_FAST)
def advance(nav: Floats, before: Floats, after: Floats, interval: float) -> None:
    """Carry a local-level state (10,) over one step between two instants."""
    increments = body_increments(before, after, 0.5, 0.5, interval)
    moved, _ = step_in_local_level(unpacked(nav), increments, NOWHERE, interval)
    for j, value in enumerate(moved):
        nav[j] = value


@njit(**_INLINE)
def keep(nav, position, velocity, quaternion, row):
    """Write a local-level state to its row of the outputs."""
    position[row, 0], position[row, 1], position[row, 2] = nav[0], nav[1], nav[2]
    velocity[row, 0], velocity[row, 1], velocity[row, 2] = nav[3], nav[4], nav[5]
    quaternion[row, 0], quaternion[row, 1] = nav[6], nav[7]
    quaternion[row, 2], quaternion[row, 3] = nav[8], nav[9]


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
    start: Floats,
    position: Floats,
    velocity: Floats,
    quaternion: Floats,
) -> None:
    """Carry a start (10,) through all samples and keep every `every`-th, and the last, beginning with the start.

    `rate` and `force` (samples, 3) in b: at the instants `time`, or, with `means`, the mean over the interval
    that ends there (the first row is then not read). `position` (kept, 3) is latitude, longitude, height,
    `velocity` (kept, 3) and `quaternion` (kept, 4) those of the local level, whatever the frame.
    """
    state, place = unpacked(start), NOWHERE
    keep(to_local_level(state) if earth_frame else state, position, velocity, quaternion, 0)
    # the change over half an interval of means comes from the interval before, of which the first has none
    old = sample(rate, force, 1 if means else 0)
    weight, share = (0.0, 0.0) if means else (0.5, 0.5)
    row, kept, previous, count = 1, 0, np.inf, time.shape[0]
    for i in range(1, count):
        interval = time[i] - time[i - 1]
        if means:
            share = interval / (interval + previous)
            previous = interval
        new = sample(rate, force, i)
        increments = body_increments(old, new, weight, share, interval)
        old = new
        if earth_frame:
            state = step_in_earth_frame(state, increments, interval)
        else:
            state, place = step_in_local_level(state, increments, place, interval)
        kept += 1
        if kept == every or i == count - 1:
            keep(to_local_level(state) if earth_frame else state, position, velocity, quaternion, row)
            row += 1
            kept = 0


__all__ = [
    "NOWHERE",
    "advance",
    "body_increments",
    "ends_of_interval",
    "integrate",
    "sine_and_cosine",
    "step_in_local_level",
    "unpacked",
]
