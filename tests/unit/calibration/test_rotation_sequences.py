"""What errors do over a sequence: Savage's (12), (20) to (22) by hand, and any sequence against exact rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.calibration.closed_forms.rotation_sequences import (
    COMPONENTS,
    SequenceModel,
    across_down,
    sequence_model,
)
from tumble.calibration.closed_forms.sequence_measurements import measure_sequence
from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble.sensor.conventions.savage import NAMES, SavageErrors

GRAVITY = 9.81
PI = np.pi
ROWS = {row.name: row for row in SEQUENCES}
X, Y, Z, START, END = range(5)

# (12) over g, each line written out: row, component, what it shows. One line has a bias in it: over 1, not g.
BY_HAND: list[tuple[str, int, dict[str, float]]] = [
    ("1", X, {"kappa yy": -2 * PI, "kappa yyy": -2 * PI}),
    ("1a", X, {"kappa yy": 2 * PI, "kappa yyy": -2 * PI}),
    ("2", Y, {"kappa xx": 2 * PI, "kappa xxx": 2 * PI}),
    ("2a", Y, {"kappa xx": -2 * PI, "kappa xxx": 2 * PI}),
    ("3", Y, {"kappa zz": -2 * PI, "kappa zzz": -2 * PI}),
    ("3a", Y, {"kappa zz": 2 * PI, "kappa zzz": -2 * PI}),
    ("4", Y, {"upsilon yz": 4.0}),
    ("5", X, {"upsilon zx": 4.0}),
    ("6", Y, {"upsilon xy": 4.0}),
    ("7", X, {"mu xy": 2.0, "upsilon xy": 1.0}),
    ("8", X, {"mu xz": 2.0, "upsilon zx": 1.0}),
    ("9", Z, {"mu zx": 2.0, "upsilon zx": 1.0}),
    ("10", Z, {"mu zy": 2.0, "upsilon yz": 1.0}),
    ("11", Y, {"mu yz": 2.0, "upsilon yz": 1.0}),
    ("12", Y, {"mu yx": 2.0, "upsilon xy": 1.0}),
    ("7", Z, {"lambda z": -2.0, "kappa xx": -PI, "kappa xxx": -PI}),
    ("13", Y, {"lambda y": -2.0, "upsilon yz": -2.0}),
    ("14", X, {"lambda x": -2.0, "upsilon zx": -2.0}),
    ("7", START, {"lambda yy": -1.0, "lambda yyy": 1.0, "lambda y": 1.0}),
    ("7", END, {"lambda yy": -1.0, "lambda yyy": -1.0, "lambda y": -1.0}),
    ("8", START, {"lambda zz": -1.0, "lambda zzz": 1.0, "lambda z": 1.0}),
    ("8", END, {"lambda zz": -1.0, "lambda zzz": -1.0, "lambda z": -1.0}),
    ("9", START, {"lambda xx": -1.0, "lambda xxx": 1.0, "lambda x": 1.0}),
    ("9", END, {"lambda xx": -1.0, "lambda xxx": -1.0, "lambda x": -1.0}),
]
BIASES = ("lambda x", "lambda y", "lambda z")


def model_of(name: str, **options: float) -> SequenceModel:
    return sequence_model(ROWS[name].rotations, start_down(ROWS[name]), GRAVITY, **options)


@pytest.mark.parametrize(("name", "component", "told"), BY_HAND)
def test_each_line_of_12_has_these_coefficients_and_no_other(
    name: str, component: int, told: dict[str, float]
) -> None:
    expected = np.zeros(24)
    for word, factor in told.items():
        expected[NAMES.index(word)] = factor if word in BIASES else GRAVITY * factor
    # rounding of sines of whole and half turns times g
    np.testing.assert_allclose(model_of(name).coefficients[component], expected, rtol=0, atol=1e-13)


def test_every_row_of_table_1_has_a_line() -> None:
    assert {name for name, _, _ in BY_HAND} == set(ROWS)
    assert {word for _, _, told in BY_HAND for word in told} == set(NAMES)


def test_down_at_the_start_is_the_axis_that_table_1_names_and_a_half_turn_turns_it_up() -> None:
    for row in SEQUENCES:
        down = np.eye(3)["xyz".index(row.down)]
        np.testing.assert_allclose(start_down(row), down, rtol=0, atol=1e-15)
    np.testing.assert_allclose(model_of("7").down_end, [0.0, -1.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(model_of("10").down_end, [0.0, -1.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(model_of("3").down_end, [1.0, 0.0, 0.0], rtol=0, atol=1e-15)


RATE, SECONDS = 0.8, 12.0
WALK = 1.0 / RATE
# (22): what a gyro bias (κx, κy, κz) makes of what a line of (12) tells. The signs of 1 to 3 against 1a to 3a, of 4
# against 5 and 6, of 14 against 13 and of the accelerometers' biases are those that exact rotations show; printed
# are -, "similarly", "similarly" and the opposite.
BIAS_BY_HAND: list[tuple[str, int, float, tuple[float, float, float]]] = [
    ("1", X, -2 * PI * GRAVITY, (0.0, WALK + SECONDS / (2 * PI), 0.0)),
    ("2", Y, 2 * PI * GRAVITY, (WALK + SECONDS / (2 * PI), 0.0, 0.0)),
    ("3", Y, -2 * PI * GRAVITY, (0.0, 0.0, WALK + SECONDS / (2 * PI))),
    ("1a", X, 2 * PI * GRAVITY, (0.0, -WALK - SECONDS / (2 * PI), 0.0)),
    ("2a", Y, -2 * PI * GRAVITY, (-WALK - SECONDS / (2 * PI), 0.0, 0.0)),
    ("3a", Y, 2 * PI * GRAVITY, (0.0, 0.0, -WALK - SECONDS / (2 * PI))),
    ("4", Y, 4 * GRAVITY, (SECONDS / 4, WALK, WALK)),
    ("5", X, 4 * GRAVITY, (WALK, -SECONDS / 4, WALK)),
    ("6", Y, 4 * GRAVITY, (WALK, WALK, -SECONDS / 4)),
    ("7", X, 2 * GRAVITY, (0.0, WALK, 0.0)),
    ("7", Z, -2.0, (0.5 * PI * GRAVITY * (WALK + SECONDS / PI), 0.0, 0.0)),
    ("13", Y, -2.0, (-GRAVITY * SECONDS / 2, GRAVITY * WALK, GRAVITY * WALK)),
    ("14", X, -2.0, (GRAVITY * WALK, GRAVITY * SECONDS / 2, GRAVITY * WALK)),
]


@pytest.mark.parametrize(("name", "component", "factor", "told"), BIAS_BY_HAND)
def test_a_gyro_bias_makes_of_each_error_what_22_says_with_its_signs_put_right(
    name: str, component: int, factor: float, told: tuple[float, float, float]
) -> None:
    model = model_of(name, rate=RATE, seconds=SECONDS)
    np.testing.assert_allclose(
        model.bias_coefficients[component] / factor, told, rtol=0, atol=1e-12 * max(np.abs(told))
    )


def test_a_misalignment_feels_the_bias_along_the_measurement_as_the_average_lags() -> None:
    """(22), its fourth line: T (1 - 2F) κz / 2, which plain averages make zero."""
    early = model_of("7", rate=RATE, seconds=SECONDS, share=0.3)
    expected = [0.0, WALK, SECONDS * (1 - 0.6) / 2]
    np.testing.assert_allclose(early.bias_coefficients[X] / (2 * GRAVITY), expected, rtol=1e-12, atol=1e-12)


def test_the_worked_example_of_22_is_minus_2_91_millionths_of_g() -> None:
    rate = 4.85e-7
    model = model_of("13", rate=1.0, seconds=10.0)
    error = model.bias_coefficients[Y] @ [rate, -0.25 * rate, -0.75 * rate] / (-2.0 * GRAVITY)
    assert error == pytest.approx(-2.91e-6, rel=1e-3)  # three digits are printed


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


def test_two_sequences_one_after_the_other_add_up_as_the_attitude_between_them_has_it() -> None:
    down = np.array([0.0, 0.0, 1.0])
    whole = sequence_model(OWN, down, GRAVITY)
    first = sequence_model(OWN[:2], down, GRAVITY)
    second = sequence_model(OWN[2:], first.down_end, GRAVITY)
    np.testing.assert_allclose(whole.C_start_end, first.C_start_end @ second.C_start_end, rtol=0, atol=1e-15)
    np.testing.assert_allclose(whole.down_end, second.down_end, rtol=0, atol=1e-15)
    together = first.coefficients[:3] + first.C_start_end @ second.coefficients[:3]
    np.testing.assert_allclose(whole.coefficients[:3], together, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(whole.coefficients[START], first.coefficients[START])
    np.testing.assert_allclose(whole.coefficients[END], second.coefficients[END], rtol=0, atol=1e-14)
    assert whole.angle == pytest.approx(sum(abs(angle) for _, angle in OWN))


def test_no_rotation_shows_no_gyro_and_only_what_gravity_shows() -> None:
    model = sequence_model((), np.array([0.0, 1.0, 0.0]), GRAVITY)
    np.testing.assert_array_equal(model.coefficients[:3], 0.0)
    np.testing.assert_array_equal(model.coefficients[:, :9], 0.0)
    still = sequence_model(((0, 0.0),), np.array([0.0, 1.0, 0.0]), GRAVITY)
    np.testing.assert_array_equal(still.coefficients, model.coefficients)


def test_horizontal_components_have_no_part_along_down_and_are_named() -> None:
    model = sequence_model(OWN, OBLIQUE, GRAVITY)
    np.testing.assert_allclose(OBLIQUE @ model.coefficients[:3], 0.0, rtol=0, atol=1e-14)
    assert len(COMPONENTS) == len(model.coefficients) == 5


@pytest.mark.parametrize("down", [np.eye(3)[0], -np.eye(3)[2], OBLIQUE])
def test_two_unit_vectors_across_down_make_a_right_handed_set_with_it(down: np.ndarray) -> None:
    first, second = across_down(down)
    np.testing.assert_allclose(np.cross(down, first), second, rtol=0, atol=1e-15)
    np.testing.assert_allclose([first @ first, second @ second], 1.0, rtol=1e-15)
    np.testing.assert_allclose([first @ down, second @ down], 0.0, rtol=0, atol=1e-15)
    if np.max(np.abs(down)) == 1.0:
        assert sorted(np.abs(first)) == [0.0, 0.0, 1.0]
