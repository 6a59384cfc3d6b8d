"""The joint estimator on Zhang's simulated table: nine dwells and twelve rotations, settings of tables 3 and 4.

Five samples a second stand for a hundred: white noise of the same density, and a rate that is constant in between,
so that nothing is lost but time. Each dwell is a recording of its own, and each axis with its two rotations:
nobody carries the attitude from one to the next. Before, between and after the rotations the table rests for less
than a second, which tells little by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vector, Vectors
from tumble.attitude.rotations import matrices_from_rotation_vectors, rotation_between
from tumble.calibration.equations.imu_unknowns import PLAIN, imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import Observed, TableRotation, observe, table_rotation
from tumble.calibration.equations.rotation_equations import LEAST_WOBBLE
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.calibration.start import start_adjustment
from tumble.earth import EARTH_RATE, Site
from tumble.estimation.solve import solve
from tumble.sensor import ImuModel, Triad
from tumble.sensor.conventions.shin import matrix_from_shin
from tumble.sensor.gauge import inverse, lower_factor
from tumble_papers.zhang.turntable import GRAVITY, Setting

STEP = 0.2  # s: at 2 degrees a step the Earth rate goes round finely enough for an axis that is exact
REST = 2  # samples before and after a rotation
# Windows of three seconds: 30 degrees, of which the mean has lost 1 % and the model says so.
WINDOW = 0.55  # rad
EXACT_AXIS = 1e-7  # rad
NORTH, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, slots=True)
class Piece:
    """One dwell, or an axis turned about both ways.

    Attributes
    ----------
    C_start : (3, 3) attitude C_wb at its first sample.
    axis_b : (3,) unit vector; zero of a dwell.
    speed : (samples,) rad/s that the table is told.
    """

    C_start: Matrix
    axis_b: Vector
    speed: Series

    def motion(self, speed: Series, earth_w: Vector, lever: Vector) -> tuple[Vectors, Vectors]:
        """Return specific force and rate of every sample of a table that really turns at `speed`."""
        angle = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (speed[1:] + speed[:-1]))])
        turned = matrices_from_rotation_vectors(angle[:, None] * self.axis_b)
        backward = np.swapaxes(self.C_start @ turned, 1, 2)
        centripetal = self.axis_b * float(self.axis_b @ lever) - lever
        force = backward @ (GRAVITY * UP) + (speed**2)[:, None] * centripetal
        return force, backward @ earth_w + speed[:, None] * self.axis_b


@dataclass(frozen=True, slots=True)
class TruePlan:
    """What does not change from run to run.

    Attributes
    ----------
    setting : what is simulated.
    pieces : dwells first, then the rotations, both ways about each axis in turn.
    site : gravity and latitude.
    truth : all of the unit's unknowns.
    """

    setting: Setting
    pieces: tuple[Piece, ...]
    site: Site
    truth: Series


def true_plan(setting: Setting) -> TruePlan:
    """Return the true motion of a study.

    Parameters
    ----------
    setting : see `table_setting`.
    """
    still = np.zeros(round(setting.dwell / STEP))
    pieces = [Piece(rotation_between(up, UP), np.zeros(3), still) for up in setting.up]
    rest, turn = np.zeros(REST), np.full(round(setting.duration / STEP), setting.rate)
    speed = np.concatenate([rest, turn, rest, -turn, rest])
    pieces += [Piece(rotation_between(axis, NORTH), axis, speed) for axis in setting.axes]
    unit = setting.unit
    model = ImuModel(
        Triad(unit.force_matrix, unit.force_bias), Triad(unit.rate_matrix @ unit.rotation, unit.rate_bias)
    )
    site = Site(GRAVITY, 0.0, setting.latitude)
    return TruePlan(setting, tuple(pieces), site, unknowns_of(model))


def _simulated_data(plan: TruePlan, rng: np.random.Generator) -> Observed:
    """Return one run's observations."""
    setting, unit = plan.setting, plan.setting.unit
    raw_force: list[AnyArray] = []
    raw_rate: list[AnyArray] = []
    holds: list[tuple[int, int]] = []
    turns: list[tuple[int, int, float]] = []
    at, ratio = 0, np.sqrt(STEP * setting.sampling)
    earth = EARTH_RATE * np.array([np.cos(setting.latitude), 0.0, -np.sin(setting.latitude)])
    for piece in plan.pieces:
        turning = piece.speed != 0.0
        # The table turns by what it is told and its error.
        errors = rng.normal(0.0, setting.angle_error, 2) / abs(setting.angle)
        share = np.asarray(np.where(piece.speed > 0.0, errors[0], errors[1]), dtype=np.float64)
        force, rate = piece.motion(piece.speed * (1.0 + share), earth, np.array(setting.lever_arm))
        sigma = np.where(turning[:, None], setting.sigma_turning[:3], setting.sigma[:3]) / ratio
        samples = len(rate)
        noise = rng.standard_normal((samples, 6))
        raw_force.append(force @ unit.force_matrix.T + unit.force_bias + sigma * noise[:, :3])
        turned = rate @ (unit.rate_matrix @ unit.rotation).T
        raw_rate.append(turned + unit.rate_bias + setting.sigma[3:] / ratio * noise[:, 3:])
        if np.any(turning):
            whole = (samples - 3 * REST) // 2
            first = [at, at + REST + whole, at + 2 * (REST + whole)]
            turns += [(len(holds), first[0], setting.rate), (len(holds) + 1, first[1], -setting.rate)]
            holds += [(start, start + REST) for start in first]
        else:
            holds.append((at, at + samples))
        at += samples
    base = _base(plan, np.concatenate(raw_force), np.concatenate(raw_rate), holds, turns)
    spins = [_spin(plan, base, hold, start, speed) for hold, start, speed in turns]
    return observe(base, imu_unknowns(plan.truth), spins)


def _base(
    plan: TruePlan,
    raw_force: Vectors,
    raw_rate: Vectors,
    holds: list[tuple[int, int]],
    turns: list[tuple[int, int, float]],
) -> HoldsAndTurns:
    setting = plan.setting
    ratio = STEP * setting.sampling
    count = np.array([b - a for a, b in holds], dtype=float)
    force_variance, rate_variance = setting.sigma[:3] ** 2 / ratio, setting.sigma[3:] ** 2 / ratio
    edge = [max(1, (b - a) // 2) if b - a <= 2 * REST else REST for a, b in holds]
    start, stop = np.full(len(holds), -1), np.full(len(holds), -1)
    for hold, _, _ in turns:
        start[hold], stop[hold] = holds[hold][1] - 1, holds[hold + 1][0] + 1
    means = [np.array([signal[a:b].mean(axis=0) for a, b in holds]) for signal in (raw_force, raw_rate)]
    return HoldsAndTurns(
        time=STEP * np.arange(len(raw_force), dtype=np.float64),
        raw_force=raw_force,
        raw_rate=raw_rate,
        force_mean=means[0],
        force_covariance=(force_variance / count[:, None])[:, :, None] * np.eye(3),
        rate_mean=means[1],
        rate_covariance=(rate_variance / count[:, None])[:, :, None] * np.eye(3),
        hold_samples=count,
        head=np.array([(a, a + n) for (a, _), n in zip(holds, edge, strict=True)]),
        tail=np.array([(b - n, b) for (_, b), n in zip(holds, edge, strict=True)]),
        turn_start=start,
        turn_stop=stop,
        force_sample_variance=force_variance,
        rate_random_walk=rate_variance * STEP,
        force_floor=np.zeros(3),
        rate_floor=np.zeros(3),
    )


def _spin(plan: TruePlan, base: HoldsAndTurns, hold: int, start: int, speed: float) -> TableRotation:
    setting = plan.setting
    samples = round(setting.duration / STEP)
    spin = table_rotation(
        base,
        hold,
        start + REST,
        start + REST + samples,
        np.array([speed, 0.0, 0.0]),
        angle=float(np.sign(speed)) * setting.angle,
        angle_sigma=setting.angle_error,
        largest_angle=WINDOW,
        longest=100.0,
    )
    turning = setting.sigma_turning[:3] ** 2 / (STEP * setting.sampling)
    count = spin.windows[:, 1] - spin.windows[:, 0]
    return replace(spin, force_covariance=np.diag(turning)[None] / count[:, None, None])


def estimate_run(plan: TruePlan, rng: np.random.Generator) -> Series:
    """Simulate one run and return its 21 parameters in the paper's order.

    Parameters
    ----------
    plan, rng : the true motion, and the noise.
    """
    data = _simulated_data(plan, rng)
    # A start as the paper's estimator gives it: off by ten times its own errors.
    start = plan.truth.copy()
    start[PLAIN] *= 1.0 + 1e-4 * rng.standard_normal(PLAIN.size)
    task = start_adjustment(data, imu_unknowns(start), plan.site)
    # The simulated table rests without swaying, and its axis does not wobble.
    task.noise.factors["axis"] = dict.fromkeys(data.rotations, (EXACT_AXIS / LEAST_WOBBLE) ** 2)
    solve(task)
    return np.real(_in_paper(task.unknowns.values[PLAIN]))


def _in_paper(plain: AnyArray) -> AnyArray:
    """The 21 parameters of the paper from the 21 shared unknowns, analytically."""
    scale, angles = plain[3:6], plain[6:9]
    force = matrix_from_shin(scale, angles)
    gyro = plain[9:18].reshape(3, 3)
    own = lower_factor(gyro)
    rotation = inverse(own) @ gyro
    return np.concatenate([_triad(force, plain[0:3]), _triad(own, plain[18:21]), _vector(rotation)])


def _triad(matrix: AnyArray, bias: AnyArray) -> AnyArray:
    scale = np.sqrt(np.sum(matrix * matrix, axis=1))
    axes = matrix / scale[:, None]
    angles = np.arcsin(np.array([axes[1, 0], -axes[2, 0], axes[2, 1]]))
    return np.concatenate([scale, angles, bias / scale])


def _vector(C: AnyArray) -> AnyArray:
    axial = 0.5 * np.array([C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]])
    square = axial @ axial
    return axial * (1.0 + square / 6.0 + 3.0 * square * square / 40.0)
