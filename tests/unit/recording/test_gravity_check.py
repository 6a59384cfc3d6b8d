"""Gravity turning in body axes tells the gyro's axes: order and signs, not their common sign of force."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tumble.errors import RecordingError
from tumble.recording import Recording, axis_agreement, find_axis_contradiction
from tumble.recording.columns import plan_from_option
from tumble.recording.gravity_check import nearest_signed_permutation

PERMUTATIONS = [
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
]


SAME = np.eye(3)


def recording_of(tumbled, force=SAME, rate=SAME) -> Recording:
    return Recording(
        tumbled.time,
        tumbled.specific_force @ np.asarray(force).T,
        tumbled.angular_rate @ np.asarray(rate).T,
        "m/s^2",
        "rad/s",
        100.0,
    )


def test_a_true_gyro_gives_the_identity(tumbled) -> None:
    agreement = axis_agreement(recording_of(tumbled))
    assert agreement is not None
    assert agreement.determined
    # 0.02 m/s² of noise on 9.8 over some two hundred windows leaves well under two per cent.
    assert np.abs(agreement.matrix - np.eye(3)).max() < 0.02
    assert find_axis_contradiction(recording_of(tumbled)) is None


def test_a_full_asymmetric_matrix_is_recovered(tumbled) -> None:
    """true = matrix @ raw: with raw = inverse(matrix) @ true the matrix itself comes back."""
    matrix = np.array([[2.0, 0.3, -0.1], [0.0, 1.5, 0.4], [0.2, -0.3, 1.8]])
    agreement = axis_agreement(recording_of(tumbled, rate=np.linalg.inv(matrix)))
    assert agreement is not None
    assert np.abs(agreement.matrix - matrix).max() < 0.04  # as above, twice the size


@pytest.mark.parametrize(
    "raw",
    PERMUTATIONS,
    ids=lambda p: "".join("+-"[int(v < 0)] + "xyz"[int(np.argmax(abs(r)))] for r in p for v in [r.sum()]),
)
def test_every_signed_permutation_of_the_gyro_is_told(tumbled, raw) -> None:
    sentence = find_axis_contradiction(recording_of(tumbled, rate=raw))
    if np.array_equal(raw, np.eye(3)):
        assert sentence is None
        return
    assert sentence is not None
    # The advice, followed with the option --columns, makes the gyro true again.
    listed = sentence.split("columns ", 1)[1].split(" with")[0].replace(" ", "")
    plan = plan_from_option("ax,ay,az," + listed, 6, "test")
    mended = np.array([sign * raw[index - 3] for index, sign in plan.triads["g"]])
    assert np.array_equal(mended, np.eye(3))


def test_a_left_handed_accelerometer_contradicts_the_gyro(tumbled) -> None:
    swapped = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert find_axis_contradiction(recording_of(tumbled, force=swapped)) is not None


def test_the_sign_of_all_accelerometers_together_cannot_be_seen(tumbled) -> None:
    assert find_axis_contradiction(recording_of(tumbled, force=-np.eye(3))) is None


def test_the_nearest_signed_permutation_keeps_rows_and_columns_apart() -> None:
    noisy = np.array([[0.1, -0.9, 0.0], [0.0, 0.2, 1.1], [0.95, 0.1, -0.1]])
    expected = [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    assert nearest_signed_permutation(noisy).tolist() == expected


def test_a_recording_without_gyro_cannot_be_compared(tumbled) -> None:
    lone = Recording(tumbled.time, tumbled.specific_force, None, "m/s^2", "counts", 100.0)
    with pytest.raises(RecordingError, match="both triads"):
        axis_agreement(lone)


def test_nothing_is_claimed_of_a_unit_that_turns_about_the_vertical_only() -> None:
    rng = np.random.default_rng(8)
    rate = np.zeros((4000, 3))
    rate[:, 2] = np.sin(np.arange(4000) / 100)
    force = np.array([0.0, 0.0, 9.8]) + 0.02 * rng.normal(size=(4000, 3))
    recording = Recording(
        np.arange(4000) / 100, force, rate + 0.001 * rng.normal(size=rate.shape), "m/s^2", "rad/s", 100.0
    )
    assert find_axis_contradiction(recording) is None
    agreement = axis_agreement(recording)
    assert agreement is None or not agreement.determined


def test_turns_about_a_single_level_axis_still_tell_a_gyro_that_counts_the_other_way_round() -> None:
    time = np.arange(0.0, 60.0, 0.01)
    # Two seconds of turning, two of rest: about x alone, so that y and z of the gyro are never seen.
    speed = np.where(time % 4.0 < 2.0, 0.8, 0.0)
    angle = np.cumsum(speed) * 0.01
    noise = np.random.default_rng(4).normal(0.0, 0.01, (time.size, 6))
    force = 9.8 * np.column_stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)]) + noise[:, :3]
    # df/dt = -omega x f: gravity turns by +angle about -x in b.
    rate = np.column_stack([speed, np.zeros_like(speed), np.zeros_like(speed)]) + 0.1 * noise[:, 3:]
    assert find_axis_contradiction(Recording(time, force, rate, "m/s^2", "rad/s", 100.0)) is None
    sentence = find_axis_contradiction(Recording(time, force, -rate, "m/s^2", "rad/s", 100.0))
    assert sentence is not None
    assert "-gx, -gy, -gz" in sentence
