"""Free inertial navigation on a turntable: the two tests of Zhang et al. (2010), section 5.2.

The unit stays where it is and is turned; whatever position moves is error. Printed are how long the tests took
(8,700 and 8,400 s), that rotations were frequent in the first, and that there were three, about one axis, in the
second. The rest is assumed: ten minutes of rest to align, quarter turns of twelve seconds, in the first test every
hundred seconds twice about x, twice about y, twice about z, and so on, in the second every 2,100 s about the
vertical; the centre of rotation in the unit; the height known, as nothing keeps it in free navigation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import Matrix, Series, Vector, Vectors
from tumble.earth import Site
from tumble.navigation import (
    InertialSamples,
    NavigationState,
    align_coarse,
    navigate,
    position_differences,
)
from tumble.sensor import ImuModel, Triad
from tumble.sensor.conventions.zhang import inter_triad_rotation, matrix_from_zhang
from tumble.simulation.motion import Motion
from tumble_papers.zhang.turntable_simulation import LATITUDE, Setting, Unit

ALIGNED, TURN, QUARTER = 600.0, 12.0, 0.5 * np.pi  # s, s, rad
EVERY = {"I": 100.0, "II": 2100.0}  # s from one turn to the next
DURATION = {"I": 8700.0, "II": 8400.0}  # s
RATE = 10.0  # Hz: a degree and a half a sample at the fastest
# s after which the height is put back to what is known.
HEIGHT_HELD = 30.0
SITE = Site.from_latitude(float(LATITUDE), 0.0)
PLACE = (float(LATITUDE), 0.0, 0.0)
# First attitude: level, x to the north-east, so that no axis points along the Earth's rate.
FIRST = Rotation.from_euler("ZYX", [0.25 * np.pi, 0.0, 0.0])


@dataclass(frozen=True, slots=True)
class TrueTest:
    """What a perfect unit measures in a test.

    Attributes
    ----------
    motion : of the table.
    edges : (samples + 1,) s.
    force, rate : (samples, 3) means over each interval in the accelerometers' frame p.
    """

    motion: Motion
    edges: Series
    force: Vectors
    rate: Vectors


def _table_motion(name: str) -> Motion:
    """Return how the table turns."""
    end = DURATION[name]
    starts = np.arange(max(ALIGNED, EVERY[name]), end - TURN - 1.0, EVERY[name])
    axes = (
        np.eye(3)[np.arange(len(starts)) // 2 % 3]
        if name == "I"
        else np.tile([0.0, 0.0, 1.0], (len(starts), 1))
    )
    rotations = [FIRST]
    for axis in axes:
        rotations.append(rotations[-1] * Rotation.from_rotvec(QUARTER * axis))
    edges = np.concatenate([[0.0 - TURN], starts, [end]])
    holds = np.diff(edges) - TURN
    return Motion.between_poses(Rotation.concatenate(rotations), holds, np.full(len(starts), TURN))


@cache
def true_test(name: str) -> TrueTest:
    """Return what a perfect unit measures, by Gauss-Legendre integrals over each sample.

    Parameters
    ----------
    name : "I" or "II".
    """
    motion = _table_motion(name)
    edges = np.arange(round(DURATION[name] * RATE) + 1) / RATE
    at, weight = np.polynomial.legendre.leggauss(3)
    middle = 0.5 * (edges[1:] + edges[:-1])
    time = (middle[:, None] + 0.5 / RATE * at).ravel()
    force, rate = (
        np.einsum("k,ikj->ij", 0.5 * weight, signal.reshape(-1, len(at), 3))
        for signal in (motion.specific_force_b(time, SITE), motion.angular_rate_ib_b(time, SITE))
    )
    return TrueTest(motion, edges, force, rate)


def measured(
    true: TrueTest, unit: Unit, setting: Setting, rng: np.random.Generator | None
) -> InertialSamples:
    """Return raw samples of a unit, in counts.

    Parameters
    ----------
    true : the test.
    unit : that is on the table.
    setting : its noise.
    rng : source of the noise; None for none.
    """
    force = true.force @ unit.force_matrix.T + unit.force_bias
    rate = true.rate @ (unit.rate_matrix @ unit.rotation).T + unit.rate_bias
    if rng is not None:
        scale = np.sqrt(RATE)
        by_force = setting.force_noise * scale * np.linalg.norm(unit.force_matrix, axis=1)
        by_rate = setting.rate_noise * scale * np.linalg.norm(unit.rate_matrix, axis=1)
        force = force + by_force * rng.standard_normal(force.shape)
        rate = rate + by_rate * rng.standard_normal(rate.shape)
    zero = np.zeros((1, 3))
    return InertialSamples(true.edges, np.vstack([zero, force]), np.vstack([zero, rate]), means=True)


def model_of(parameters: Series) -> ImuModel:
    """Return the model that 21 parameters in the paper's order stand for, in the frame p.

    Parameters
    ----------
    parameters : (21,) scales in counts, the rest SI, as `turntable_evaluation.paper_parameters` has them.
    """
    force: Matrix = np.real(matrix_from_zhang(parameters[0:3], parameters[3:6]))
    rate: Matrix = np.real(matrix_from_zhang(parameters[9:12], parameters[12:15]))
    turned = rate @ inter_triad_rotation(parameters[18:21])
    return ImuModel(
        Triad(force, parameters[0:3] * parameters[6:9]), Triad(turned, parameters[9:12] * parameters[15:18])
    )


def navigate_test(raw: InertialSamples, model: ImuModel) -> tuple[Series, Vectors]:
    """Align with the model at rest and navigate; return times since then (s) and (instants, 3) errors, m.

    Parameters
    ----------
    raw : samples.
    model : with which they are corrected, for the alignment too.
    """
    force, rate = model.correct(raw.specific_force_b, raw.angular_rate_ib_b)
    samples = replace(raw, specific_force_b=force, angular_rate_ib_b=rate)
    rest = samples.between(float(raw.time[0]), ALIGNED)
    found = align_coarse(rest, PLACE[0], accelerometer_sigma=1e-4, gyroscope_sigma=1e-8)
    state = NavigationState(ALIGNED, *PLACE, np.zeros(3), found.C_nb)
    first, step = round(ALIGNED * RATE), round(HEIGHT_HELD * RATE)
    times: list[float] = []
    places: list[tuple[float, float]] = []
    for begin in range(first, len(samples) - 1, step):
        rows = slice(begin, min(begin + step, len(samples) - 1) + 1)
        part = InertialSamples(samples.time[rows], force[rows], rate[rows], means=True)
        end = navigate(part, state, every=step).state(-1)
        velocity: Vector = end.velocity_n * np.array([1.0, 1.0, 0.0])
        state = replace(end, height=PLACE[2], velocity_n=velocity)
        times.append(end.time - ALIGNED)
        places.append((end.latitude, end.longitude))
    latitude, longitude = np.array(places).T.copy()
    here = tuple(np.full(len(times), value) for value in PLACE)
    errors = position_differences((latitude, longitude, here[2]), (here[0], here[1], here[2]))
    return np.array(times), errors
