"""What errors do over a sequence, against exact rotations; Savage's (12) and (22) are held by the papers' items."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble.sensor.conventions.savage import NAMES, SavageErrors
from tumble_papers.savage.sequences import (
    SequenceModel,
    across_down,
    measure_sequence,
    sequence_model,
)

GRAVITY = 9.81
ROWS = {row.name: row for row in SEQUENCES}


def model_of(name: str, **options: float) -> SequenceModel:
    return sequence_model(ROWS[name].rotations, start_down(ROWS[name]), GRAVITY, **options)


def test_down_at_the_start_is_the_axis_that_table_1_names_and_a_half_turn_turns_it_up() -> None:
    for row in SEQUENCES:
        down = np.eye(3)["xyz".index(row.down)]
        np.testing.assert_allclose(start_down(row), down, rtol=0, atol=1e-15)
    np.testing.assert_allclose(model_of("7").down_end, [0.0, -1.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(model_of("10").down_end, [0.0, -1.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(model_of("3").down_end, [1.0, 0.0, 0.0], rtol=0, atol=1e-15)


def test_a_misalignment_feels_the_bias_along_the_measurement_as_the_average_lags() -> None:
    """(22), its fourth line: T (1 - 2F) κz / 2, which plain averages make zero."""
    early = model_of("7", rate=0.8, seconds=12.0, share=0.3)
    expected = [0.0, 1.0 / 0.8, 12.0 * (1 - 0.6) / 2]
    np.testing.assert_allclose(early.bias_coefficients[0] / (2 * GRAVITY), expected, rtol=1e-12, atol=1e-12)


# Against exact rotations -----------------------------------------------------------------------------

OWN = ((2, 0.7), (0, -1.3), (1, 2.4), (0, 0.5))
OBLIQUE = np.array([0.48, -0.6, 0.64])
STEP, REST = 0.05, 40


def exact(
    rotations: tuple[tuple[int, float], ...], down: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[int, int], float]:
    """True rates and forces of a sequence, the range of its last rest, and the mean rate of its rotations."""
    rates, attitude = [np.zeros((REST, 3))], Rotation.identity()
    turning = 0
    for axis, angle in rotations:
        count = max(int(np.ceil(abs(angle) / STEP)), 1)
        rates.append(np.tile(np.eye(3)[axis] * angle / (count * STEP), (count, 1)))
        attitude *= Rotation.from_rotvec(np.eye(3)[axis] * angle)
        turning += count
    rates.append(np.zeros((REST, 3)))
    rate = np.concatenate(rates)
    force = np.full(rate.shape, np.nan)
    force[:REST] = -GRAVITY * down
    force[-REST:] = -GRAVITY * attitude.inv().apply(down)
    total = sum(abs(angle) for _, angle in rotations)
    return rate, np.nan_to_num(force), (len(rate) - REST, len(rate)), total / (turning * STEP)


def shown(
    errors: SavageErrors, rate: np.ndarray, force: np.ndarray, end: tuple[int, int], down
) -> np.ndarray:
    distorted = errors.model().distort(force, rate)
    measured = measure_sequence(
        distorted[1], distorted[0], STEP, np.zeros(3), (0, REST), end, GRAVITY, down, start_bias=False
    )
    return measured.vector


@pytest.mark.parametrize(
    ("rotations", "down"),
    [
        pytest.param(ROWS["6"].rotations, start_down(ROWS["6"]), id="6"),
        pytest.param(ROWS["13"].rotations, start_down(ROWS["13"]), id="13"),
        pytest.param(ROWS["2a"].rotations, start_down(ROWS["2a"]), id="2a"),
        pytest.param(OWN, np.array([0.0, 0.0, 1.0]), id="own"),
        pytest.param(OWN, OBLIQUE, id="oblique"),
    ],
)
def test_all_120_coefficients_of_any_sequence_are_those_of_exact_rotations(rotations, down) -> None:
    rate, force, end, _ = exact(rotations, down)
    model = sequence_model(rotations, down, GRAVITY)
    size = 1e-5
    for column, name in enumerate(NAMES):
        change = np.zeros(24)
        change[column] = size
        plus, minus = (shown(SavageErrors.from_vector(s * change), rate, force, end, down) for s in (1, -1))
        # Central differences: third order, and a down that is 10 m/s² less its own size to 1e-15.
        np.testing.assert_allclose(
            (plus - minus) / (2 * size),
            model.coefficients[:, column],
            rtol=0,
            atol=2e-8 * GRAVITY,
            err_msg=name,
        )


@pytest.mark.parametrize("rotations", [ROWS["4"].rotations, ROWS["14"].rotations, OWN])
def test_the_bias_coefficients_of_any_sequence_are_those_of_exact_rotations(rotations) -> None:
    down = np.array([0.0, 0.0, 1.0])
    rate, force, end, mean = exact(rotations, down)
    model = sequence_model(rotations, down, GRAVITY, rate=mean, seconds=REST * STEP)
    # The attitude is that of the end of each sample: half a sample more of the mean of both rests.
    late = GRAVITY * np.cross(down, 0.5 * STEP * (model.C_start_end - np.eye(3)), axisb=0, axisc=0)
    for axis in range(3):
        bias = 1e-7 * np.eye(3)[axis]
        found = shown(SavageErrors.from_vector(np.zeros(24), bias), rate, force, end, down) / 1e-7
        expected = model.bias_coefficients[:, axis] + np.append(late[:, axis], [0.0, 0.0])
        # 1e-7 rad/s over ten seconds is 1e-6 rad, and its square a millionth of that in 100
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)


def test_no_rotation_shows_no_gyro_and_only_what_gravity_shows() -> None:
    model = sequence_model((), np.array([0.0, 1.0, 0.0]), GRAVITY)
    np.testing.assert_array_equal(model.coefficients[:3], 0.0)
    np.testing.assert_array_equal(model.coefficients[:, :9], 0.0)
    still = sequence_model(((0, 0.0),), np.array([0.0, 1.0, 0.0]), GRAVITY)
    np.testing.assert_array_equal(still.coefficients, model.coefficients)


@pytest.mark.parametrize("down", [np.eye(3)[0], -np.eye(3)[2], OBLIQUE])
def test_two_unit_vectors_across_down_make_a_right_handed_set_with_it(down: np.ndarray) -> None:
    first, second = across_down(down)
    np.testing.assert_allclose(np.cross(down, first), second, rtol=0, atol=1e-15)
    np.testing.assert_allclose([first @ first, second @ second], 1.0, rtol=1e-15)
    np.testing.assert_allclose([first @ down, second @ down], 0.0, rtol=0, atol=1e-15)
    if np.max(np.abs(down)) == 1.0:
        assert sorted(np.abs(first)) == [0.0, 0.0, 1.0]
