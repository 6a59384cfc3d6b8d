"""Strapdown navigation, step by step, compiled.

A step takes angular rate and specific force (six numbers, in b) as linear in time. The local-level state is
latitude, longitude, height, velocity (north, east, down) and the quaternion of C_nb, scalar last. Euler-type errors are
those of the second order of the step.

States and increments are small arrays, which stay in registers. What costs is the chain from one state to the next, so
that a step has one root and one division: sine and cosine of the latitude are turned from a place nearby.
"""

from __future__ import annotations

from tumble.errors import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import cos, fabs, sin, sqrt

from tumble.earth import (
    EARTH_RATE,
    ECCENTRICITY_SQUARED,
    FLATTENING,
    GRAVITY_AT_EQUATOR,
    GRAVITY_RATIO,
    PLUMB_LINE_CURVATURE,
    SEMI_MAJOR_AXIS,
    SOMIGLIANA_CONSTANT,
)

_A = cython.declare(cython.double, SEMI_MAJOR_AXIS)
_E2 = cython.declare(cython.double, ECCENTRICITY_SQUARED)
_W = cython.declare(cython.double, EARTH_RATE)
_OPEN = cython.declare(cython.double, 2.0 / SEMI_MAJOR_AXIS * (1.0 + FLATTENING + GRAVITY_RATIO))
_SLOPE = cython.declare(cython.double, 4.0 / SEMI_MAJOR_AXIS * FLATTENING)
_BEND = cython.declare(cython.double, 3.0 / SEMI_MAJOR_AXIS**2)
_G_EQUATOR = cython.declare(cython.double, GRAVITY_AT_EQUATOR)
_SOMIGLIANA = cython.declare(cython.double, SOMIGLIANA_CONSTANT)
_CURVATURE = cython.declare(cython.double, PLUMB_LINE_CURVATURE)
# Up to here from a latitude, rad, the series of its sine to the third order is exact: 2e-4**4 / 24 is 7e-17.
_NEAR = cython.declare(cython.double, 2e-4)
# A place that no latitude is near.
_NOWHERE = cython.declare(cython.double, 1e9)
_ENDLESS = cython.declare(cython.double, float("inf"))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def ends_of_interval(
    before: cython.p_double,
    mean: cython.p_double,
    after: cython.p_double,
    first: cython.bint,
    interval: cython.double,
    previous_interval: cython.double,
) -> cython.void:
    """Fill rate and force at both ends of an interval from its mean and the one before it, which `before` holds.

    Linear signals: the ends give the mean back, and the two-sample terms of coning and sculling.
    """
    share = 0.0 if first else interval / (interval + previous_interval)
    for j in range(6):
        half = (mean[j] - before[j]) * share if share > 0.0 else 0.0
        before[j] = mean[j] - half
        after[j] = mean[j] + half


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def sample(
    rate: cython.const[cython.double][:, ::1],
    force: cython.const[cython.double][:, ::1],
    row: cython.Py_ssize_t,
    kept: cython.p_double,
) -> cython.void:
    """Fill rate and force (6,) of a row."""
    kept[0] = rate[row, 0]
    kept[1] = rate[row, 1]
    kept[2] = rate[row, 2]
    kept[3] = force[row, 0]
    kept[4] = force[row, 1]
    kept[5] = force[row, 2]


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def body_increments(
    old: cython.p_double,
    new: cython.p_double,
    weight: cython.double,
    share: cython.double,
    interval: cython.double,
    increments: cython.p_double,
) -> cython.void:
    """Fill rotation vector (3) and velocity increment (3), in b at the step's start, with coning and sculling.

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
    increments[0] = ax + k * (w1 * u2 - w2 * u1)
    increments[1] = ay + k * (w2 * u0 - w0 * u2)
    increments[2] = az + k * (w0 * u1 - w1 * u0)
    increments[3] = vx + k * (w1 * g2 - w2 * g1 + f1 * u2 - f2 * u1) + one * cx + two * (ay * cz - az * cy)
    increments[4] = vy + k * (w2 * g0 - w0 * g2 + f2 * u0 - f0 * u2) + one * cy + two * (az * cx - ax * cz)
    increments[5] = vz + k * (w0 * g1 - w1 * g0 + f0 * u1 - f1 * u0) + one * cz + two * (ax * cy - ay * cx)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def turned_velocity(
    state: cython.p_double,
    increments: cython.p_double,
    turned: cython.p_double,
) -> cython.void:
    """Fill the velocity increment in the frame of the state's quaternion."""
    x, y, z, w = state[6], state[7], state[8], state[9]
    vx, vy, vz = increments[3], increments[4], increments[5]
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    turned[0] = vx + w * tx + y * tz - z * ty
    turned[1] = vy + w * ty + z * tx - x * tz
    turned[2] = vz + w * tz + x * ty - y * tx


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def turned_attitude(
    state: cython.p_double,
    increments: cython.p_double,
    tx: cython.double,
    ty: cython.double,
    tz: cython.double,
    quaternion: cython.p_double,
) -> cython.void:
    """Fill the state's quaternion turned by the body's rotation vector from the right, the frame's from the left.

    (tx, ty, tz) is what the frame has turned, rad, small: its quaternion is exact to the fourth order.
    """
    hx, hy, hz = 0.5 * increments[0], 0.5 * increments[1], 0.5 * increments[2]
    s = hx * hx + hy * hy + hz * hz
    if s < 1e-3:
        sinc = 1.0 + s * (-1.0 / 6 + s * (1.0 / 120 - s * (1.0 / 5040)))
        c = 1.0 + s * (-0.5 + s * (1.0 / 24 - s * (1.0 / 720 - s * (1.0 / 40320))))
    else:
        angle = sqrt(s)
        sinc, c = sin(angle) / angle, cos(angle)
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
    quaternion[0] = p * a + px * e + py * d - pz * b
    quaternion[1] = p * b - px * d + py * e + pz * a
    quaternion[2] = p * d + px * b - py * a + pz * e
    quaternion[3] = p * e - px * a - py * b - pz * d


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def sine_and_cosine(
    latitude: cython.double,
    place: cython.p_double,
    found: cython.p_double,
) -> cython.void:
    """Fill sine and cosine of a latitude, and the place (latitude, its sine and cosine) for the next one.

    Near the place they are turned from there, exact to rounding; further off it is moved here.
    """
    turn = latitude - place[0]
    if fabs(turn) > _NEAR:
        place[0], place[1], place[2] = latitude, sin(latitude), cos(latitude)
        turn = 0.0
    square = turn * turn
    odd, even = turn - turn * square * (1.0 / 6.0), 1.0 - 0.5 * square
    found[0] = place[1] * even + place[2] * odd
    found[1] = place[2] * even - place[1] * odd


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def reciprocals(
    s: cython.double,
    c: cython.double,
    height: cython.double,
    over: cython.p_double,
) -> cython.void:
    """Fill `over` with 1 over the radius across the meridian, that along it, cos latitude and root, by one division.

    The root is of 1 - e² sin²; with it the radii are (a + h root) / root and (a (1 - e²) + h root³) / root³.
    """
    reduced = 1.0 - _E2 * s * s
    root = sqrt(reduced)
    cube = reduced * root
    across, meridian = _A + height * root, _A * (1.0 - _E2) + height * cube
    one, two = across * c, meridian * root
    divided = 1.0 / (one * two)
    over[0] = root * (divided * (c * two))
    over[1] = cube * (divided * (root * one))
    over[2] = divided * (across * two)
    over[3] = divided * (one * meridian)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def gravity_down_and_north(
    s: cython.double,
    c: cython.double,
    over_root: cython.double,
    height: cython.double,
    down_and_north: cython.p_double,
) -> cython.void:
    """Fill normal gravity (Somigliana, with height to the second order) and its lean to the north, m/s²."""
    gravity = _G_EQUATOR * (1.0 + _SOMIGLIANA * s * s) * over_root
    gravity *= 1.0 - (_OPEN - _SLOPE * s * s) * height + _BEND * height * height
    down_and_north[0] = gravity
    down_and_north[1] = -_CURVATURE * height * 2.0 * s * c


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def step_in_local_level(
    nav: cython.p_double,
    increments: cython.p_double,
    place: cython.p_double,
    interval: cython.double,
) -> cython.void:
    """Carry the local-level state `nav` over a step, and the place for the next.

    Earth and transport rate, Coriolis and gravity are taken at the step's middle; position by the trapezoid.
    """
    turned = cython.declare(cython.double[3])
    latitude = cython.declare(cython.double[2])
    over = cython.declare(cython.double[4])
    pull = cython.declare(cython.double[2])
    quaternion = cython.declare(cython.double[4])
    turned_velocity(nav, increments, turned)
    dn, de, dd = turned[0], turned[1], turned[2]
    north, east, down = nav[3], nav[4], nav[5]
    half = 0.5 * interval
    height = nav[2] - half * down
    sine_and_cosine(nav[0] + half * north / (_A + height), place, latitude)
    s, c = latitude[0], latitude[1]
    reciprocals(s, c, height, over)
    over_across, over_meridian, over_c = over[0], over[1], over[2]
    gravity_down_and_north(s, c, over[3], height, pull)
    gravity, lean = pull[0], pull[1]
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
    turned_attitude(nav, increments, hn, he, hd, quaternion)
    nav[0] += half * (north + new_north) * over_meridian
    nav[1] += half * (east + new_east) * (over_across * over_c)
    nav[2] -= half * (down + new_down)
    nav[3], nav[4], nav[5] = new_north, new_east, new_down
    nav[6], nav[7], nav[8], nav[9] = quaternion[0], quaternion[1], quaternion[2], quaternion[3]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def step_between(
    nav: cython.p_double,
    place: cython.p_double,
    old: cython.p_double,
    new: cython.p_double,
    weight: cython.double,
    share: cython.double,
    interval: cython.double,
) -> cython.void:
    """Carry a local-level state (10,) over one step, with the samples' weights of `body_increments`."""
    increments = cython.declare(cython.double[6])
    body_increments(old, new, weight, share, interval, increments)
    step_in_local_level(nav, increments, place, interval)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def advance(
    nav: cython.p_double,
    before: cython.p_double,
    after: cython.p_double,
    interval: cython.double,
) -> cython.void:
    """Carry a local-level state (10,) over one step between two instants."""
    increments = cython.declare(cython.double[6])
    place = cython.declare(cython.double[3])
    place[0] = _NOWHERE
    body_increments(before, after, 0.5, 0.5, interval, increments)
    step_in_local_level(nav, increments, place, interval)


@cython.cfunc
@cython.inline
@cython.nogil
@cython.exceptval(check=False)
def _keep(
    nav: cython.p_double,
    position: cython.double[:, ::1],
    velocity: cython.double[:, ::1],
    quaternion: cython.double[:, ::1],
    row: cython.Py_ssize_t,
) -> cython.void:
    """Write a state to its row of the outputs."""
    position[row, 0], position[row, 1], position[row, 2] = nav[0], nav[1], nav[2]
    velocity[row, 0], velocity[row, 1], velocity[row, 2] = nav[3], nav[4], nav[5]
    quaternion[row, 0], quaternion[row, 1] = nav[6], nav[7]
    quaternion[row, 2], quaternion[row, 3] = nav[8], nav[9]


def integrate(
    time: cython.const[cython.double][::1],
    rate: cython.const[cython.double][:, ::1],
    force: cython.const[cython.double][:, ::1],
    means: cython.bint,
    every: cython.Py_ssize_t,
    start: cython.const[cython.double][::1],
    position: cython.double[:, ::1],
    velocity: cython.double[:, ::1],
    quaternion: cython.double[:, ::1],
) -> None:
    """Carry a start (10,) through all samples and keep every `every`-th, and the last, beginning with the start.

    `rate` and `force` (samples, 3) in b: at the instants `time`, or, with `means`, the mean over the interval
    that ends there (the first row is then not read). `position` (kept, 3) is latitude, longitude, height,
    `velocity` (kept, 3) and `quaternion` (kept, 4) those of the local level.
    """
    state = cython.declare(cython.double[10])
    place = cython.declare(cython.double[3])
    old = cython.declare(cython.double[6])
    new = cython.declare(cython.double[6])
    increments = cython.declare(cython.double[6])
    with cython.nogil:
        place[0] = _NOWHERE
        for j in range(10):
            state[j] = start[j]
        _keep(state, position, velocity, quaternion, 0)
        # the change over half an interval of means comes from the interval before, of which the first has none
        sample(rate, force, 1 if means else 0, old)
        weight = share = 0.0 if means else 0.5
        row, kept, previous, count = 1, 0, _ENDLESS, time.shape[0]
        for i in range(1, count):
            interval = time[i] - time[i - 1]
            if means:
                share = interval / (interval + previous)
                previous = interval
            sample(rate, force, i, new)
            body_increments(old, new, weight, share, interval, increments)
            old[0], old[1], old[2] = new[0], new[1], new[2]
            old[3], old[4], old[5] = new[3], new[4], new[5]
            step_in_local_level(state, increments, place, interval)
            kept += 1
            if kept == every or i == count - 1:
                _keep(state, position, velocity, quaternion, row)
                row += 1
                kept = 0


__all__ = ["integrate"]
