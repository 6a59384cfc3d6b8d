"""A factor of two between a recording and what is believed of its scale is named, and no other is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from second_simulator import GRADES, PROCEDURES
from tumble.recording.gravity_check import find_steps_of_two, gyro_step_words, step_of_two
from tumble.recording.recording import Recording


@pytest.mark.parametrize(
    ("ratio", "step"),
    [(2.1, 2.0), (0.48, 0.5), (3.8, 4.0), (0.25, 0.25), (1.02, None), (1.4, None), (0.0, None)],
)
def test_a_ratio_is_near_a_step_of_two_or_near_none(ratio: float, step: float | None) -> None:
    assert step_of_two(ratio) == step


@pytest.fixture(scope="module")
def recording() -> Recording:
    made = PROCEDURES["by-hand"](GRADES["tactical"], np.random.default_rng(3), None, poses=14, rate=50.0)
    return Recording(made.time, made.force, made.rate, "m/s^2", "rad/s", 50.0)


def test_a_recording_of_the_same_range_has_nothing_to_be_said_of_it(recording: Recording) -> None:
    assert find_steps_of_two(recording) == []


def test_gyros_of_half_the_range_and_a_rate_of_half_are_named(recording: Recording) -> None:
    assert recording.angular_rate is not None
    assert recording.specific_force is not None
    (said,) = find_steps_of_two(replace(recording, angular_rate=0.5 * recording.angular_rate))
    assert "Gravity turns twice as fast" in said
    assert "25 Hz instead of 50 Hz" in said
    slow = replace(recording, time=2.0 * recording.time, rate=25.0)
    (said,) = find_steps_of_two(slow)
    assert "Gravity turns half as fast" in said
    assert "50 Hz instead of 25 Hz" in said
    (said,) = find_steps_of_two(replace(recording, specific_force=2.0 * recording.specific_force))
    assert "at rest is twice gravity" in said
    assert gyro_step_words(1.1, 100.0) is None
