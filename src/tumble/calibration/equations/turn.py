"""The conditions of a recording tumbled by hand: holds, and the turns between them.

Nothing is known of the motion but that the unit rests in the holds. Each hold k gives a group of six:

- norm: the hold's mean specific force, corrected, has the norm of gravity;
- rate (3): the hold's mean raw rate is the gyro's bias, its g-sensitivity times the specific force,
  and what it sees of the Earth's rotation;
- turn (2): the specific force at the end of hold k, carried by the integrated gyro over the turn to
  hold k + 1, is the specific force seen there; two components, perpendicular to it.

Frames: s is the body frame at the last sample of hold k, e that at the first sample of hold k + 1.
The Earth turns by ``earth_rate_s * T`` meanwhile, so that with C_se from the gyro

    C_se @ f_e = (1 + skew(earth_rate_s) T) @ f_s.

The Earth's rotation is three unknowns in the body frame of the first hold, carried along by the gyro;
their prior is what the site tells. Where the gyro cannot be integrated (a gap) the chain starts anew
with a prior-sized variance instead.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors, inverted
from tumble.attitude import integrate_turns
from tumble.attitude.integration import average_at_edge
from tumble.calibration.equations.triad_unknowns import COUNT, correct_with_derivatives, triad_from_unknowns
from tumble.earth import EARTH_RATE
from tumble.estimation import Linearisation
from tumble.records import dataclass
from tumble.segmentation.rest_wander import RestParts

# Where each unknown stands in the full list.
FORCE = slice(0, COUNT)
GYRO_MATRIX = slice(12, 21)
GYRO_BIAS = slice(21, 24)
G_SENSITIVITY = slice(24, 33)
EARTH = slice(33, 36)
TOTAL = 36

NORM, RATE, TURN = slice(0, 1), slice(1, 4), slice(4, 6)
GROUP = 6
# Of the flicker floor of a hold's mean, what lies between it and the mean of a part.
FLICKER_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class HoldsAndTurns:
    """What a hand-held recording offers to the adjustment, in raw units.

    Attributes
    ----------
    time, raw_force, raw_rate : the samples.
    force_mean, force_covariance : (holds, 3), (holds, 3, 3) hold means.
    rate_mean, rate_covariance : the same of the gyro.
    head, tail : (holds, 2) sample ranges at a hold's start and end, where turns join it.
    turn_start, turn_stop : (holds,) sample range of the turn after hold k, from the last sample of
        its tail to the first of the next head; -1 where there is none that can be used.
    force_sample_variance : (3,) per sample at rest, raw².
    rate_random_walk : (3,) N² of each gyro, raw² s, from the holds.
    force_floor, rate_floor : (3,) raw², what no averaging takes away: a bias that wanders.
    parts : means of the parts of the holds, which show how biases wander; None where nobody asks.
    turn_sampling : (holds, 3) raw² s², variance of each gyro's integral over the turn after hold k by stamps that
        jitter and by values that are rounded; None where both are exact.
    rate_rounding : (holds, 3) raw², what of the gyro's covariance rounding leaves; None where nothing is known.
    """

    time: Series
    raw_force: Vectors
    raw_rate: Vectors
    force_mean: Vectors
    force_covariance: Matrices
    rate_mean: Vectors
    rate_covariance: Matrices
    hold_samples: np.ndarray
    head: np.ndarray
    tail: np.ndarray
    turn_start: np.ndarray
    turn_stop: np.ndarray
    force_sample_variance: Vector
    rate_random_walk: Vector
    force_floor: Vector
    rate_floor: Vector
    parts: RestParts | None = None
    turn_sampling: Vectors | None = None
    rate_rounding: Vectors | None = None

    @property
    def holds(self) -> int:
        """Number of holds."""
        return int(self.force_mean.shape[0])

    @property
    def step(self) -> float:
        """Usual time between samples, s: the median of some hundred thousand of them."""
        return float(np.median(np.diff(self.time)[:: max(1, self.time.size // 200_000)]))


@dataclass(slots=True)
class ExtraVariances:
    """Variance components beyond the white noise seen at rest, SI².

    Attributes
    ----------
    norm : of a hold's norm, (m/s²)²: what the accelerometer's bias wanders from hold to hold.
    rate : of a hold's mean rate, (rad/s)²: what the gyro's bias wanders.
    turn : of each component of a turn, rad²: everything else that a turn shows.
    """

    norm: float = 0.0
    rate: float = 0.0
    turn: float = 0.0


class TurnConditions:
    """`Conditions` of holds and turns for an adjustment of both triads.

    Parameters
    ----------
    data : holds and turns.
    gravity : m/s².
    values : (36,) all unknowns; those not in `free` keep these values.
    free : indices of the unknowns to adjust.
    active : (holds, 6) of bool.
    extra : variance components.
    """

    def __init__(
        self,
        data: HoldsAndTurns,
        gravity: float,
        values: Series,
        free: np.ndarray,
        active: np.ndarray,
        extra: ExtraVariances,
    ) -> None:
        self.data, self.gravity, self.values, self.free = data, gravity, values.astype(float), free
        self.active = active.copy()
        self.active[data.turn_start < 0, TURN] = False
        self.extra = extra
        self._mean = data.force_mean.copy()
        self._head = np.zeros_like(self._mean)
        self._tail = np.zeros_like(self._mean)
        self._mean_blocks = np.zeros((data.holds, GROUP, 3))
        self._next_mean_blocks = np.zeros((data.holds, GROUP, 3))
        self.turned = np.zeros(data.holds)

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters` (the free unknowns) and the adjusted hold means."""
        full = self.full(parameters)
        state = _State.at(self.data, full, self._mean)
        misclosure = np.zeros((self.data.holds, GROUP))
        design = np.zeros((self.data.holds, GROUP, TOTAL))
        covariance = np.zeros((self.data.holds, GROUP, GROUP))
        self._norms(state, misclosure, design, covariance)
        self._rates(full, state, misclosure, design, covariance)
        lower = self._turns(full, state, misclosure, design, covariance)
        return Linearisation.masked(misclosure, design[:, :, self.free], covariance, self.active, lower)

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Move the hold means by e = -Q B' C^-1 (w + A xi); window deviations stay as observed."""
        pull = np.einsum("kgb,kg->kb", self._mean_blocks, multipliers)
        pull[1:] += np.einsum("kgb,kg->kb", self._next_mean_blocks, multipliers)[:-1]
        self._mean = self.data.force_mean - np.einsum("kab,kb->ka", self.data.force_covariance, pull)

    def full(self, parameters: Series) -> Series:
        """Return all 36 unknowns with the free ones replaced."""
        values = self.values.copy()
        values[self.free] = parameters
        return values

    def _norms(self, state: _State, w: AnyArray, A: AnyArray, C: AnyArray) -> None:
        towards = state.mean / self.gravity
        blocks = np.einsum("ka,kab->kb", towards, state.mean_by_raw)
        moved = self.data.force_mean - self._mean
        w[:, 0] = 0.5 * (np.einsum("ka,ka->k", state.mean, towards) - self.gravity)
        w[:, 0] += np.einsum("kb,kb->k", blocks, moved)
        A[:, 0, FORCE] = np.einsum("ka,kap->kp", towards, state.mean_by_unknowns)
        self._mean_blocks = np.zeros((self.data.holds, GROUP, 3))
        self._next_mean_blocks = np.zeros((self.data.holds, GROUP, 3))
        self._mean_blocks[:, 0] = blocks
        C[:, 0, 0] = np.einsum("ka,kab,kb->k", blocks, self.data.force_covariance, blocks) + self.extra.norm

    def _rates(self, full: Series, state: _State, w: AnyArray, A: AnyArray, C: AnyArray) -> None:
        # In rad/s: the gyro's inverse stands before the raw condition, so that all axes weigh alike.
        matrix = full[GYRO_MATRIX].reshape(3, 3)
        inverse = inverted(matrix)
        sensitivity = full[G_SENSITIVITY].reshape(3, 3)
        earth = state.C_hold_first @ full[EARTH]
        predicted = full[GYRO_BIAS] + earth @ matrix.T + state.mean @ sensitivity.T
        w[:, RATE] = (predicted - self.data.rate_mean) @ inverse.T
        A[:, RATE, GYRO_BIAS] = inverse
        A[:, RATE, EARTH] = state.C_hold_first
        for i in range(3):
            for j in range(3):
                A[:, RATE, 12 + 3 * i + j] = earth[:, j, None] * inverse[:, i]
                A[:, RATE, 24 + 3 * i + j] = state.mean[:, j, None] * inverse[:, i]
        C[:, RATE, RATE] = inverse @ self.data.rate_covariance @ inverse.T
        # Where the chain of turns is broken the Earth rate's direction is not known at all.
        unknown = ~np.any(state.C_hold_first, axis=(1, 2))
        C[:, RATE, RATE] += (self.extra.rate + unknown * EARTH_RATE**2 / 3.0)[:, None, None] * np.eye(3)

    def _turns(self, full: Series, state: _State, w: AnyArray, A: AnyArray, C: AnyArray) -> AnyArray:
        """Fill the turn conditions; return the blocks of C below the diagonal."""
        data, k = self.data, state.turn_holds
        lower = np.zeros((max(data.holds - 1, 0), GROUP, GROUP))
        if k.size == 0:
            return lower
        f_s = state.tail[k]
        f_e = np.einsum("tab,tb->ta", state.C_se, state.head[k + 1])
        earth_s = np.einsum("tab,b->ta", state.C_hold_first[k], full[EARTH])
        E = np.swapaxes(tangent_bases(f_s), 1, 2) / self.gravity
        self.turned[k] = _angles_turned(state.C_se)
        drift = state.duration[:, None] * _cross(earth_s, f_s)
        w[k, TURN] = np.einsum("tga,ta->tg", E, f_e - f_s - drift)

        by_rotation = -E @ _skews(f_e)
        A[k, TURN] = self._turn_design(full, state, E, by_rotation, f_s)
        before = -E @ state.mean_by_raw[k]
        after = E @ state.C_se @ state.mean_by_raw[k + 1]
        self._mean_blocks[k, TURN] = before
        self._next_mean_blocks[k, TURN] = after
        moved = data.force_mean - self._mean
        w[k, TURN] += np.einsum("tga,ta->tg", before, moved[k]) + np.einsum("tga,ta->tg", after, moved[k + 1])

        noise = data.force_covariance
        C[k, TURN, TURN] = _sandwich(before, noise[k] + state.tail_covariance[k])
        C[k, TURN, TURN] += _sandwich(after, noise[k + 1] + state.head_covariance[k + 1])
        C[k, TURN, TURN] += self._rotation_noise(full, state, by_rotation)
        # What a turn shares with the norms of both its holds, and with the turn after it.
        blocks = self._mean_blocks
        own = np.einsum("tga,tab,tnb->tgn", before, noise[k], blocks[k, NORM])
        C[k, TURN, NORM], C[k, NORM, TURN] = own, np.swapaxes(own, 1, 2)
        shared = noise[k + 1] @ np.swapaxes(after, 1, 2)
        lower[k, NORM, TURN] = blocks[k + 1, NORM] @ shared
        # Both windows of a hold deviate from its mean, and from different samples: white noise in the
        # mean is undone by the deviations' own covariance, -sigma²/n, and a share of the flicker too.
        white = np.diag(data.force_sample_variance) / data.hold_samples[k + 1, None, None]
        white = white + FLICKER_SHARE * np.diag(data.force_floor)
        lower[k, TURN, TURN] = blocks[k + 1, TURN] @ (noise[k + 1] - white) @ np.swapaxes(after, 1, 2)
        return lower

    def _turn_design(
        self, full: Series, state: _State, E: AnyArray, by_rotation: AnyArray, f_s: Vectors
    ) -> AnyArray:
        """Return (turns, 2, unknowns): a rate error E_r x(t) turns C_se by the integral of C_st E_r x."""
        k = state.turn_holds
        inverse = inverted(full[GYRO_MATRIX].reshape(3, 3))
        design = np.zeros((k.size, 2, TOTAL))
        carried = state.C_se @ state.mean_by_unknowns[k + 1]
        design[:, :, FORCE] = E @ (carried - state.mean_by_unknowns[k])
        moves = np.einsum("tga,tabj,bi->tgij", by_rotation, state.sums, inverse)
        design[:, :, GYRO_MATRIX] = -moves[..., 0:3].reshape(k.size, 2, 9)
        design[:, :, GYRO_BIAS] = -moves[..., 3]
        design[:, :, G_SENSITIVITY] = -moves[..., 4:7].reshape(k.size, 2, 9)
        design[:, :, EARTH] = state.duration[:, None, None] * (E @ _skews(f_s) @ state.C_hold_first[k])
        return design

    def _rotation_noise(self, full: Series, state: _State, by_rotation: AnyArray) -> AnyArray:
        """Return (turns, 2, 2): angle random walk, wandering bias and what else turns show."""
        inverse = inverted(full[GYRO_MATRIX].reshape(3, 3))
        white = np.diag(inverse @ np.diag(self.data.rate_random_walk) @ inverse.T)
        k = state.turn_holds
        # The gyro's noise also turns the windows' samples to their edges.
        walking = state.duration + _edge_time(self.data, self.data.tail)[k]
        walking = walking + _edge_time(self.data, self.data.head)[k + 1]
        walk = np.einsum("tga,a,tha->tgh", by_rotation, white, by_rotation) * walking[:, None, None]
        if self.data.turn_sampling is not None:
            timing = self.data.turn_sampling[k] @ (inverse**2).T
            walk = walk + np.einsum("tga,ta,tha->tgh", by_rotation, timing, by_rotation)
        floor = np.diag(inverse @ np.diag(self.data.rate_floor) @ inverse.T)
        drift = np.einsum("tga,a,tha->tgh", by_rotation, floor, by_rotation)
        wander = self.extra.turn + self.extra.rate * state.duration**2
        return walk + drift * (state.duration**2)[:, None, None] + wander[:, None, None] * np.eye(2)


@dataclass(slots=True)
class _State:
    """Everything that depends on the unknowns, worked out once an iteration."""

    mean: Vectors
    mean_by_unknowns: AnyArray
    mean_by_raw: AnyArray
    head: Vectors
    tail: Vectors
    head_covariance: Matrices
    tail_covariance: Matrices
    turn_holds: np.ndarray
    C_se: Matrices
    sums: AnyArray
    duration: Series
    C_hold_first: Matrices = field(default_factory=lambda: np.zeros((0, 3, 3)))

    @staticmethod
    def at(data: HoldsAndTurns, full: Series, mean: Vectors) -> _State:
        """Correct the means and windows and integrate the turns with the unknowns `full`."""
        triad = triad_from_unknowns(full[FORCE])
        corrected = correct_with_derivatives(full[FORCE], mean)
        inverse = inverted(full[GYRO_MATRIX].reshape(3, 3))
        force_inverse = inverted(triad.matrix)
        # By matrix and bias alone, as the windows are: a quadratic term would else count as deviation.
        observed = (data.force_mean - triad.bias) @ force_inverse.T
        head, tail = window_directions(data, triad.matrix, triad.bias, inverse)
        turns = np.flatnonzero(data.turn_start >= 0)
        integrated = integrate_turns(
            data.time,
            data.raw_rate,
            data.raw_force,
            data.turn_start[turns],
            data.turn_stop[turns],
            gyro_inverse=inverse,
            gyro_bias=full[GYRO_BIAS],
            force_inverse=force_inverse,
            force_bias=triad.bias,
            g_sensitivity=full[G_SENSITIVITY].reshape(3, 3),
        )
        state = _State(
            mean=corrected.value,
            mean_by_unknowns=corrected.by_unknowns,
            mean_by_raw=corrected.by_raw,
            # The windows' deviations from the hold's mean, added to the adjusted mean.
            head=corrected.value + (head - observed),
            tail=corrected.value + (tail - observed),
            head_covariance=_window_covariance(data, data.head),
            tail_covariance=_window_covariance(data, data.tail),
            turn_holds=turns,
            C_se=integrated.C_start_end,
            sums=integrated.sums,
            duration=integrated.duration,
        )
        state.C_hold_first = _chain(data, turns, integrated.C_start_end)
        return state


def window_directions(
    data: HoldsAndTurns, force_matrix: Matrix, force_bias: Vector, gyro_inverse: Matrix
) -> tuple[Vectors, Vectors]:
    """Return the corrected specific force at the first and at the last sample of each hold.

    Each is the mean of a window at the hold's edge, every sample turned to the edge by the gyro's
    deviation from the hold's own mean rate: tremor and sway are followed, bias and Earth rate not.
    """
    inverse = inverted(force_matrix)

    def at(window: np.ndarray, edge: str) -> Vectors:
        return average_at_edge(
            data.time,
            data.raw_rate,
            data.raw_force,
            window[:, 0],
            window[:, 1],
            edge=edge,
            gyro_inverse=gyro_inverse,
            gyro_bias=data.rate_mean,
            force_inverse=inverse,
            force_bias=force_bias,
        )

    return at(data.head, "first"), at(data.tail, "last")


def _window_covariance(data: HoldsAndTurns, windows: np.ndarray) -> Matrices:
    """Return the covariance of a window's mean minus its hold's mean.

    White noise gives sigma² (1/n_window - 1/n); of flicker, half of its floor remains between the
    mean of half a hold and that of the whole (the Allan variance of the halves is twice the floor).
    """
    count = (windows[:, 1] - windows[:, 0]).astype(float)
    share = np.maximum(1.0 / count - 1.0 / data.hold_samples, 0.0)
    white = share[:, None, None] * np.diag(data.force_sample_variance)[None]
    return white + FLICKER_SHARE * (share > 0)[:, None, None] * np.diag(data.force_floor)[None]


def _edge_time(data: HoldsAndTurns, windows: np.ndarray) -> Series:
    """Return how long the angle random walk acts on a window's mean, s: W/3 - W²/(4 D).

    A sample at distance t from the edge is turned by the integral of the rate's deviation from the
    mean over the hold (length D). The mean over a window of length W weighs the rate at s with
    (1 - s/W) inside it, minus W / (2 D) everywhere; the integral of the square is the time returned.
    """
    step = (data.time[-1] - data.time[0]) / max(data.time.shape[0] - 1, 1)
    window = (windows[:, 1] - windows[:, 0]) * step
    return window / 3.0 - window**2 / (4.0 * np.maximum(data.hold_samples * step, window))


def _chain(data: HoldsAndTurns, turns: np.ndarray, C_se: Matrices) -> Matrices:
    """Return C_hold_first: from the first hold's body frame to each hold's, along usable turns."""
    C = np.zeros((data.holds, 3, 3))
    if data.holds:
        C[0] = np.eye(3)
    for k, rotation in zip(turns, C_se, strict=True):
        C[k + 1] = rotation.T @ C[k]
    return C


def tangent_bases(directions: Vectors) -> AnyArray:
    """Return (items, 3, 2): for each vector two unit vectors perpendicular to it and to each other."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    first = _cross(unit, np.eye(3)[np.argmin(np.abs(unit), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, _cross(unit, first)], axis=2)


def _cross(a: Vectors, b: Vectors) -> Vectors:
    """Return the cross products of rows; numpy's own costs five times as much for few rows."""
    return np.column_stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ]
    )


def _skews(vectors: Vectors) -> Matrices:
    """Return (items, 3, 3) cross-product matrices."""
    S = np.zeros((vectors.shape[0], 3, 3))
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    return S - np.swapaxes(S, 1, 2)


def _sandwich(left: AnyArray, covariance: AnyArray) -> AnyArray:
    return left @ covariance @ np.swapaxes(left, 1, 2)


def _angles_turned(C: Matrices) -> Series:
    """Return the angles of rotation matrices, rad."""
    return np.arccos(np.clip(0.5 * (np.trace(C, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
