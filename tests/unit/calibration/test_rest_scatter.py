"""A hand that trembles and sways is no noise of the sensors."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.imu_unknowns import imu_unknowns
from tumble.segmentation import NoiseFloor, observe_holds


@pytest.mark.parametrize("samples", [1, 5])
def test_a_hand_is_no_noise_of_the_sensors(play: Callable[..., Any], truth: np.ndarray, samples: int) -> None:
    """A tremor of ten times a gyro's noise, which a filter may cut at 9 Hz, a sway of five times what a mean shows."""
    still = play()
    force, rate, time = still.recording.specific_force, still.recording.angular_rate, still.recording.time
    for rest in [slice(hold.start, hold.stop) for hold in still.timeline.holds]:
        rate[rest] = uniform_filter1d(rate[rest], samples, axis=0)
    trembling = rate + 0.02 * np.sin(2.0 * np.pi * 9.0 * time[:, None] + [0.0, 1.0, 2.0])
    swaying = force + np.sin(2.0 * np.pi * 0.4 * time)[:, None] * np.cross(force, [[3e-4, 0.0, 4e-4]])
    recording = replace(still.recording, specific_force=swaying, angular_rate=trembling)
    timeline = replace(still.timeline, noise_floor=NoiseFloor(np.full(3, 0.02), np.full(3, 0.008), 1.0, ""))
    made = gather(recording, timeline, observe_holds(recording, timeline), imu_unknowns(truth))
    assert np.all(np.abs(np.log(made.rate_random_walk / (2e-3**2 / 100.0))) < 0.4)
    assert np.all(np.abs(np.log(made.force_covariance[:, range(3), range(3)] / (0.02**2 / 300.0))) < 0.5)
