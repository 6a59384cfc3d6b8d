"""What a unit and a receiver of a simulated drive have measured."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.navigation import GnssTrack, InertialSamples
from tumble.navigation.gnss import make_track
from tumble.simulation import SplineTrajectory

BIASES = ([0.05, -0.03, 0.02], [3e-3, -1e-3, 2e-3])  # m/s², rad/s
POOR = ([0.15, -0.1, 0.1], [0.1, -0.05, 0.1])  # as of a unit that is not calibrated


def measured(
    course: SplineTrajectory,
    time: np.ndarray,
    rng: np.random.Generator,
    *,
    biases: tuple[list[float], list[float]] = BIASES,
    rate_noise: float = 2e-3,
    mount: Rotation | None = None,
) -> InertialSamples:
    """Samples with noise of 0.02 m/s² and `rate_noise`, of a unit that is mounted askew."""
    states = course.states(time)
    C_mb = (mount or Rotation.identity()).inv()
    shape = (len(time), 3)
    force = C_mb.apply(states.specific_force_b) + rng.normal(0.0, 0.02, shape) + biases[0]
    rate = C_mb.apply(states.angular_rate_ib_b) + rng.normal(0.0, rate_noise, shape) + biases[1]
    return InertialSamples(time, force, rate)


def seen(
    course: SplineTrajectory, at: np.ndarray, rng: np.random.Generator, velocity_sigma: float = 0.03
) -> GnssTrack:
    """Fixes of 2 cm on the same clock."""
    fixes, shape = course.states(at), (len(at), 3)
    noise = rng.normal(0.0, 0.02, shape)
    latitude = fixes.latitude + noise[:, 0] / 6.4e6
    longitude = fixes.longitude + noise[:, 1] / (6.4e6 * np.cos(fixes.latitude))
    return make_track(
        at,
        (latitude, longitude, fixes.height - noise[:, 2]),
        np.full(shape, 0.02),
        velocity_n=fixes.velocity_n + rng.normal(0.0, velocity_sigma, shape),
        velocity_sigmas=np.full(shape, velocity_sigma),
        quality=np.ones(len(at), dtype=int),
    )
