"""What errors do over a sequence, against exact rotations; Savage's (12) and (22) are held by the papers' items.

What a rotation sequence measures: of an ideal unit nothing, and of a tilted one as much as geometry says.

From measurements to errors: (13) and (14) with the signs put right, and least squares for any set.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.errors import ObservabilityError
from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble.sensor.conventions.savage import NAMES, SavageErrors
from tumble_papers.savage.sequences import (
    AVERAGING,
    SequenceMeasurement,
    SequenceModel,
    across_down,
    invert_measurements,
    measure_sequence,
    sequence_model,
    solve_measurements,
    window_weights,
)

GRAVITY = 9.81
ROWS = {row.name: row for row in SEQUENCES}


def model_of(name: str, **options: float) -> SequenceModel:
    return sequence_model(ROWS[name].rotations, start_down(ROWS[name]), GRAVITY, **options)


def test_a_half_turn_turns_down_up() -> None:
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


STEP, REST, TURN = 0.02, 200, 80
EARTH = 7.2921e-5
DOWN_Z = np.array([0.0, 0.0, 1.0])


def recorded(
    rotations: tuple[tuple[int, float], ...], earth_b: np.ndarray, down: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Exact rates (rotation vector of each sample over its time) and forces of a unit on the turning Earth."""
    vectors = [np.zeros((REST, 3))]
    for axis, angle in rotations:
        vectors += [np.tile(np.eye(3)[axis] * angle / TURN, (TURN, 1))]
    vectors.append(np.zeros((REST, 3)))
    # Attitude against the Earth at the edges of the samples, in the frame of the start.
    edges = [Rotation.identity()]
    for vector in np.concatenate(vectors):
        edges.append(edges[-1] * Rotation.from_rotvec(vector))
    against_inertial = [Rotation.from_rotvec(earth_b * k * STEP) * edge for k, edge in enumerate(edges)]
    rate = np.array([(one.inv() * other).as_rotvec() / STEP for one, other in pairwise(against_inertial)])
    force = np.array([edge.inv().apply(-GRAVITY * down) for edge in edges[1:]])
    return rate, force


def measured(
    rate: np.ndarray, force: np.ndarray, earth: np.ndarray, down: np.ndarray = DOWN_Z, **options
) -> SequenceMeasurement:
    end = (len(rate) - REST, len(rate))
    return measure_sequence(rate, force, STEP, earth, (0, REST), end, GRAVITY, down, **options)


@pytest.mark.parametrize("averaging", AVERAGING)
@pytest.mark.parametrize("start_bias", [True, False])
@pytest.mark.parametrize("name", ["1", "6", "7", "10", "14"])
def test_an_ideal_unit_measures_nothing_on_the_turning_earth(
    name: str, start_bias: bool, averaging: str
) -> None:
    row = ROWS[name]
    down = start_down(row)
    earth = EARTH * np.array([0.52, -0.41, 0.75])
    rate, force = recorded(row.rotations, earth, down)
    found = measured(rate, force, earth, down, start_bias=start_bias, averaging=averaging)
    # Half a sample of the Earth's turn is 0.7 µrad in both windows, and does not stand in their difference to first
    # order; its square of 5e-13 does, and rounding of 10 m/s².
    np.testing.assert_allclose(found.vector, 0.0, rtol=0, atol=3e-11)
    np.testing.assert_allclose(found.gyro_bias, 0.0, rtol=0, atol=1e-9)


def test_the_earth_left_out_is_what_it_turns_between_the_two_windows() -> None:
    """Of a rotation of 360°, without a bias from the start: the turn of the mean of one rest to that of the other."""
    earth = EARTH * np.array([0.6, 0.0, 0.8])
    rate, force = recorded(ROWS["1"].rotations, earth, DOWN_Z)
    found = measured(rate, force, np.zeros(3), start_bias=False)
    seconds = STEP * (REST + TURN)
    # 7e-5 rad/s for 6 s is 0.4 mrad, and second order a thousandth of the first
    expected = GRAVITY * np.cross(DOWN_Z, seconds * earth)
    np.testing.assert_allclose(found.horizontal, expected, rtol=0, atol=2e-3 * np.linalg.norm(expected))


@pytest.mark.parametrize("averaging", AVERAGING)
@pytest.mark.parametrize("count", [1, 2, 3, 10, 11, 500])
def test_weights_of_a_window_add_up_to_one_and_lie_even(averaging: str, count: int) -> None:
    weights = window_weights(count, averaging)
    assert weights.shape == (count,)
    assert np.sum(weights) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(weights, weights[::-1], rtol=0, atol=1e-15)
    assert np.all(weights > 0.0)


def test_an_average_of_averages_is_the_mean_of_running_means() -> None:
    signal = np.random.default_rng(4).normal(size=9)
    running = [np.mean(signal[k : k + 5]) for k in range(5)]
    assert window_weights(9, "average-of-averages") @ signal == pytest.approx(np.mean(running), rel=1e-14)
    assert window_weights(9, "plain") @ signal == pytest.approx(np.mean(signal), rel=1e-14)


@pytest.mark.parametrize("angle", [1e-3, 5e-3])
def test_a_fixture_that_leans_by_an_angle_shortens_the_projection_by_half_its_square_and_not_the_norm(
    angle: float,
) -> None:
    leaning = Rotation.from_rotvec([angle, 0.0, 0.0]).apply(DOWN_Z)
    rate, force = recorded(((1, np.pi),), np.zeros(3), leaning)
    by_norm = measured(rate, force, np.zeros(3))
    by_projection = measured(rate, force, np.zeros(3), norm=False)
    np.testing.assert_allclose(by_norm.vector[3:], 0.0, rtol=0, atol=1e-12)
    expected = GRAVITY * (1.0 - np.cos(angle))
    assert expected == pytest.approx(GRAVITY * angle**2 / 2.0, rel=angle)
    np.testing.assert_allclose(by_projection.vector[3:], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_norm.horizontal, by_projection.horizontal, rtol=0, atol=1e-14)


def test_the_bias_that_the_start_shows_is_taken_out_and_told() -> None:
    earth, bias = EARTH * np.array([0.3, 0.5, -0.8]), np.array([2e-3, -1e-3, 5e-4])
    rate, force = recorded(ROWS["13"].rotations, earth, DOWN_Z)
    plain, biased = measured(rate, force, earth), measured(rate + bias, force, earth)
    np.testing.assert_allclose(biased.vector, plain.vector, rtol=0, atol=1e-13)
    np.testing.assert_allclose(biased.gyro_bias - plain.gyro_bias, bias, rtol=0, atol=1e-16)
    kept = measured(rate + bias, force, earth, start_bias=False)
    assert np.linalg.norm(kept.horizontal) > 0.05  # 1 mrad/s for some seconds of 10 m/s²


def test_signs_of_a_tilt_at_the_end_and_of_a_short_gravity() -> None:
    """Force after the turn leans to +x by 2 mrad and is 0.01 short; before it is 0.02 too long."""
    rate = np.zeros((2 * REST, 3))
    force = np.concatenate(
        [
            np.tile([0.0, 0.0, -GRAVITY - 0.02], (REST, 1)),
            np.tile([0.0196, 0.0, -GRAVITY + 0.01], (REST, 1)),
        ]
    )
    found = measured(rate, force, np.zeros(3), norm=False)
    np.testing.assert_allclose(found.vector, [0.0196, 0.0, 0.0, -0.02, 0.01], rtol=0, atol=1e-12)


@pytest.mark.parametrize("start", [(5, 5), (-1, 4), (0, 1001), (20, 10)])
def test_ranges_that_are_none_are_refused(start: tuple[int, int]) -> None:
    nothing = np.zeros((1000, 3))
    with pytest.raises(ValueError, match=f"samples {start[0]} to {start[1]} are no range of 1000 samples"):
        measure_sequence(nothing, nothing, STEP, np.zeros(3), start, (900, 1000), GRAVITY, DOWN_Z)
    with pytest.raises(ValueError, match="are no range of 1000 samples"):
        measure_sequence(nothing, nothing, STEP, np.zeros(3), (0, 10), start, GRAVITY, DOWN_Z)


def test_an_unknown_average_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(ValueError, match="'median' is none of plain, average-of-averages"):
        window_weights(10, "median")


MODELS: dict[str, SequenceModel] = {
    row.name: sequence_model(row.rotations, start_down(row), GRAVITY) for row in SEQUENCES
}
# ppm, µrad and some µm/s²: no two alike
ERRORS = np.arange(1.0, 25.0) * np.where(np.arange(24) % 3 == 1, -1.0, 1.0) * 1e-4
WITHOUT_ASYMMETRY = np.where(np.isin(np.arange(24), [3, 4, 5]), 0.0, ERRORS)
# rounding of a division of numbers of 1e-2 by 40
ROUNDING = 1e-15


def measurements_of(errors: np.ndarray, names: list[str] | None = None) -> dict[str, np.ndarray]:
    return {name: MODELS[name].coefficients @ errors for name in (names or list(MODELS))}


def solved(names: list[str], errors: np.ndarray = ERRORS, *, asymmetry: bool = True):
    return solve_measurements(
        [MODELS[name] for name in names],
        list(measurements_of(errors, names).values()),
        [spread(name) for name in names],
        asymmetry=asymmetry,
    )


def spread(name: str) -> np.ndarray:
    """Some covariance with correlations, another one for each sequence."""
    rng = np.random.default_rng(sum(name.encode()))
    root = 1e-5 * (np.eye(5) + 0.2 * rng.normal(size=(5, 5)))
    return root @ root.T


def test_13_gives_back_every_error_of_the_linear_model_in_one_pass() -> None:
    np.testing.assert_allclose(
        invert_measurements(measurements_of(ERRORS), GRAVITY), ERRORS, rtol=0, atol=10 * ROUNDING
    )


def test_14_needs_no_sequence_turned_back_where_the_gyros_have_no_asymmetry() -> None:
    told = measurements_of(WITHOUT_ASYMMETRY, [name for name in MODELS if not name.endswith("a")])
    found = invert_measurements(told, GRAVITY, asymmetry=False)
    np.testing.assert_allclose(found, WITHOUT_ASYMMETRY, rtol=0, atol=10 * ROUNDING)


@pytest.mark.parametrize(("gone", "asymmetry"), [("9", True), ("2a", True), ("14", False)])
def test_the_formulas_refuse_a_sequence_that_is_missing_by_its_name(gone: str, asymmetry: bool) -> None:
    told = measurements_of(ERRORS)
    del told[gone]
    with pytest.raises(ObservabilityError, match=f"need all sequences, and {gone} are missing"):
        invert_measurements(told, GRAVITY, asymmetry=asymmetry)


def test_least_squares_gives_what_the_formulas_give() -> None:
    # 24 unknowns of a condition of some hundreds
    np.testing.assert_allclose(solved(list(MODELS)), ERRORS, rtol=0, atol=1e-12)


def test_least_squares_without_asymmetry_is_14() -> None:
    names = [name for name in MODELS if not name.endswith("a")]
    found = solved(names, WITHOUT_ASYMMETRY, asymmetry=False)
    np.testing.assert_allclose(found, WITHOUT_ASYMMETRY, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found[3:6], 0.0)


def test_least_squares_weighs_each_component_by_its_noise() -> None:
    rng = np.random.default_rng(8)
    names = list(MODELS)
    told = [v + 1e-5 * rng.normal(size=5) for v in measurements_of(ERRORS, names).values()]
    spreads = [1e-10 * np.diag([1.0, 1.0, 1.0, 2.0, 3.0]) for _ in names]
    found = solve_measurements([MODELS[n] for n in names], told, spreads)
    design, right = [], []
    for name, value in zip(names, told, strict=True):
        down = int(np.argmax(np.abs(MODELS[name].down_start)))
        keep = [(down + 1) % 3, (down + 2) % 3, 3, 4]
        weight = 1.0 / np.sqrt(np.diag(spreads[0])[keep])
        design.append(weight[:, None] * MODELS[name].coefficients[keep])
        right.append(weight * value[keep])
    A, b = np.concatenate(design), np.concatenate(right)
    np.testing.assert_allclose(found, np.linalg.lstsq(A, b, rcond=None)[0], rtol=0, atol=1e-14)
