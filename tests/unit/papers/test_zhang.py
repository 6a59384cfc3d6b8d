"""Zhang's closed forms: what they give by hand, on recordings of a turntable, and on his simulated one."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from recovery.played import MODEL, short
from second_simulator.calibrating import played
from tumble.calibration import Session
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, SpinStep, Step
from tumble.sensor import change_frame, lower_factor
from tumble.simulation import TableErrors, find_grade, simulate_protocol
from tumble_papers.zhang.closed_forms import (
    bias_from_static_pairs,
    ellipsoid_from_norms,
    matrix_from_rotations,
    rotation_from_two_axes,
    triad_rotation,
    wahba_rotation,
)
from tumble_papers.zhang.methods import ESTIMATORS
from tumble_papers.zhang.turntable import (
    CHOICES,
    GRAVITY,
    Setting,
    evaluate,
    in_paper_units,
    simulate,
    table_setting,
)
from unit.given import given
from unit.papers.recovered import assert_within_statement, session_of, square_sum, white

G = 9.81
FACES = np.concatenate([np.eye(3), -np.eye(3)])
EDGES = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2.0)
# Lower triangular with three angles that differ in size and sign: a transpose or a mixed-up pair fails.
MATRIX = np.array([[1.02, 0.0, 0.0], [0.031, 0.97, 0.0], [-0.012, 0.045, 1.05]])
BIAS = np.array([0.3, -0.2, 0.11])
FULL = np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]])
ANGLES = np.array([62.8, 60.0, 25.1, 62.8, 31.4, 12.6])
# Degrees about three axes, all different: the transpose differs by 0.1 and more in every element off the diagonal.
R = Rotation.from_rotvec([0.2, -0.3, 0.4]).as_matrix()
_LONG = np.array([[0.1, 0.2, 1.0], [0.0, 1.0, -0.3], [1.0, -0.2, 0.3], [0.5, 0.5, -0.7]])
AXES_P = _LONG / np.linalg.norm(_LONG, axis=1, keepdims=True)
AXES_O = AXES_P @ R.T


def units(count: int, seed: int = 1) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def forces(directions: np.ndarray) -> np.ndarray:
    return G * directions @ MATRIX.T + BIAS


def rotations(axes: np.ndarray, angle: np.ndarray = ANGLES) -> np.ndarray:
    return angle[:, None] * axes @ MATRIX.T


# Closed forms: what the estimators below, which show them on recordings in counts, do not -----------


def test_an_ellipsoid_is_lower_triangular_whatever_frame_made_the_readings_and_wherever_zero_is() -> None:
    """A converter's zero at 2^15; the frame of the true vectors is free, what comes back has x along its x sensor."""
    full = MATRIX @ np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    matrix, bias = ellipsoid_from_norms(415.0 * (G * units(30) @ full.T + BIAS) + 32768.0, G)
    np.testing.assert_allclose(matrix, 415.0 * MATRIX, rtol=0, atol=1e-12 * 415.0)
    # a bias is good to the same share of the largest reading
    np.testing.assert_allclose(bias, 415.0 * BIAS + 32768.0, rtol=0, atol=1e-12 * (12.0 * 415.0 + 32768.0))
    np.testing.assert_array_equal(np.triu(matrix, 1), 0.0)


def test_a_weight_of_ten_is_ten_readings_and_one_of_nothing_none() -> None:
    raw = forces(units(12)) + 1e-2 * np.random.default_rng(2).standard_normal((12, 3))
    weights = np.ones(12)
    weights[3] = 10.0
    often = np.concatenate([raw, np.repeat(raw[3:4], 9, axis=0)])
    both = ellipsoid_from_norms(raw, G, weights), ellipsoid_from_norms(often, G)
    for weighted, repeated in zip(*both, strict=True):
        np.testing.assert_allclose(weighted, repeated, rtol=0, atol=1e-12)
    # whatever is wrong with a reading, without weight it moves nothing
    wrong, weights[3] = forces(units(12)), 0.0
    wrong[3] *= 1.1
    matrix, bias = ellipsoid_from_norms(wrong, G, weights)
    np.testing.assert_allclose(matrix, MATRIX, rtol=0, atol=1e-12)
    np.testing.assert_allclose(bias, BIAS, rtol=0, atol=1e-11)
    wrong = rotations(units(12), np.full(12, 60.0))
    wrong[3] *= 1.1
    turned = matrix_from_rotations(wrong, np.full(12, 60.0), weights)
    np.testing.assert_allclose(turned, MATRIX, rtol=0, atol=1e-12)


def test_a_negative_angle_and_an_axis_named_by_its_other_end_are_the_same_norm() -> None:
    signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0])
    found = matrix_from_rotations(signs[:, None] * rotations(np.concatenate([np.eye(3), EDGES])), -ANGLES)
    np.testing.assert_allclose(found, MATRIX, rtol=0, atol=1e-12)


def test_all_pairs_of_25_are_least_squares_on_differences_from_the_mean() -> None:
    rng = np.random.default_rng(4)
    rate = EARTH_RATE * units(9) @ FULL.T + [0.01, -0.02, 0.03] + 1e-7 * rng.standard_normal((9, 3))
    turned = np.linalg.solve(FULL, rate.T).T
    # the paper's way: a row each pair of attitudes j1, j2
    rows = np.array([2.0 * (turned[i] - turned[j]) for i, j in combinations(range(9), 2)])
    told = np.array([turned[i] @ turned[i] - turned[j] @ turned[j] for i, j in combinations(range(9), 2)])
    by_pairs = FULL @ np.linalg.lstsq(rows, told, rcond=None)[0]
    # the paper's normal matrix is of condition 1; the differences of squares of 0.03 lose 1e-18 of 1e-7
    np.testing.assert_allclose(bias_from_static_pairs(FULL, rate), by_pairs, rtol=0, atol=1e-11)


HYPERBOLOID = np.array(
    [[s * np.sqrt(1 + a * a + b * b), a, b] for s in (1, -1) for a in (-1, 0.3, 1) for b in (-1, 0.2, 1)]
)
IN_A_PLANE = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], *EDGES[:2], [-1, 1, 0] / np.sqrt(2.0)])
NEAR = np.array([[1.0, 0.0, 0.0], [1.0, 0.02, 0.0]]) / np.sqrt([[1.0], [1.0004]])


EIGHT, DOUBLED = np.vstack([FACES, EDGES[:2]]), np.vstack([FACES, EDGES[:1], -EDGES[:1], FACES[:2]])
LEVEL, ONE_AXIS = units(9) * [1.0, 1.0, 0.0], "have one axis only.*turn the unit about another"


@pytest.mark.parametrize(
    ("form", "told", "words"),
    [
        (ellipsoid_from_norms, (forces(EIGHT), G), "^8 attitudes do not determine 9 unknowns: 9 different"),
        (ellipsoid_from_norms, (forces(DOUBLED), G), "do not determine all 9 unknowns"),
        (ellipsoid_from_norms, (HYPERBOLOID, G), "No ellipsoid goes through the means"),
        (matrix_from_rotations, (rotations(FACES[:5], ANGLES[:5]), ANGLES[:5]), "5 .* do not determine 6"),
        (matrix_from_rotations, (rotations(IN_A_PLANE), ANGLES), "axes do not determine all 6 unknowns"),
        (bias_from_static_pairs, (np.eye(3), EARTH_RATE * LEVEL), "do not determine all 3 unknowns"),
        (bias_from_static_pairs, (np.eye(3), EARTH_RATE * units(2)), "2 attitudes do not determine 3"),
        (bias_from_static_pairs, (np.eye(3), np.tile(BIAS, (9, 1))), "they do not see the Earth rate"),
        (rotation_from_two_axes, (NEAR @ R.T, NEAR), ONE_AXIS),
        (triad_rotation, (NEAR @ R.T, NEAR), ONE_AXIS),
        (wahba_rotation, (NEAR @ R.T, NEAR), ONE_AXIS),
    ],
)
def test_what_does_not_determine_the_unknowns_is_refused(form, told, words):
    with pytest.raises(ObservabilityError, match=words):
        form(*told)


def test_wahba_gives_a_rotation_even_of_reflected_axes_and_triad_takes_its_first_exactly() -> None:
    turned = wahba_rotation(AXES_O * [1.0, 1.0, -1.0], AXES_P)
    assert np.linalg.det(turned) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
    off = AXES_O[:2] + np.array([[0.0, 0.0, 0.0], [0.01, -0.02, 0.0]])
    turned = triad_rotation(off, AXES_P[:2])
    np.testing.assert_allclose(turned @ AXES_P[0], off[0], atol=1e-14)
    assert 1e-3 < np.linalg.norm(turned @ AXES_P[1] - off[1]) < 0.03
    # the second lies in the plane of both
    assert np.cross(off[0], off[1]) @ (turned @ AXES_P[1]) == pytest.approx(0.0, abs=1e-14)


# On recordings of a turntable: the truth, the stated uncertainty, and what is refused ----------------

SITE = replace(Site.from_latitude(np.radians(48.0), 300.0), gravity_sigma=0.0)
NINE = short("turntable-9", SITE)
RUNS = 24


def recorded(steps: tuple[Step, ...] = NINE.steps, **options) -> Session:
    """The nine and six without noise and without errors of the table, if nothing else is said."""
    protocol = replace(NINE, steps=steps)
    told = {
        "model": MODEL,
        "placement": False,
        "table": TableErrors(angle_sigma=0.0),
        **options,
    }
    recording, _ = simulate_protocol(protocol, 50.0, np.random.default_rng(3), site=SITE, **told)
    return Session(recording, protocol)


@pytest.mark.parametrize("name", ["zhang-inter-triad", "zhang-optimal"])
@pytest.mark.parametrize("ramp_spread", [0.0, 0.3])
def test_without_noise_the_truth_comes_back_however_the_unit_is_placed(name: str, ramp_spread: float) -> None:
    """Matrices of condition one; uneven ramps leave of the biases what a mean over the rests is good to."""
    table = TableErrors(angle_sigma=0.0, ramp_spread=ramp_spread)
    found = ESTIMATORS[name].estimate(recorded(placement=True, table=table, units="counts")).model
    true = change_frame(MODEL, "accelerometer-x")
    for triad, size in (("accelerometer", 1e4), ("gyroscope", 1e6)):
        one, other = getattr(found, triad), getattr(true, triad)
        np.testing.assert_allclose(one.matrix / size, other.matrix, rtol=0, atol=1e-9 + 3e-6 * ramp_spread)
        np.testing.assert_allclose(one.bias / size, other.bias, rtol=0, atol=1e-9)


def test_the_rotation_between_the_triads_is_all_that_the_inter_triad_equations_add() -> None:
    session = recorded(model=None, grade=find_grade("tactical"))
    plain, full = (ESTIMATORS[name].estimate(session) for name in ("zhang-closed-form", "zhang-inter-triad"))
    own, joined = given(plain.model.gyroscope), given(full.model.gyroscope)
    np.testing.assert_allclose(own.matrix, lower_factor(joined.matrix), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(own.bias, joined.bias)
    force = [given(one.model.accelerometer).matrix for one in (plain, full)]
    np.testing.assert_array_equal(*force)
    named = {value.name: value for value in plain.parameters}
    for axis in "xyz":
        turned = named[f"rotation between the triads {axis}"]
        assert abs(turned.value) < 1e-15
        assert turned.standard_uncertainty == pytest.approx(0.01, rel=1e-3)
    assert "rotation between the triads is not determined" in plain.not_determined[0]
    assert not full.not_determined


def test_nine_poses_state_what_the_paper_s_theory_of_them_says() -> None:
    """With σ of a dwell's mean: scale σ/√2, misalignment √7 σ, bias σ/√2; right to 2 %, and to the axes' noise."""
    session = recorded(grade=find_grade("tactical"))
    stated = ESTIMATORS["zhang-optimal"].estimate(session).parameters
    long = session.means.duration > 8.0
    assert np.count_nonzero(long) == 9
    variances = np.trace(given(session.means.specific_force_covariance)[long], axis1=1, axis2=2) / 3.0
    sigma = float(np.sqrt(np.mean(variances)))
    for name, expected in (
        ("scale factor error", sigma / SITE.gravity / np.sqrt(2.0)),
        ("non-orthogonality", sigma / SITE.gravity * np.sqrt(7.0)),
        ("bias", sigma / np.sqrt(2.0)),
    ):
        found = [p.standard_uncertainty for p in stated if p.name.startswith(f"accelerometer {name}")]
        assert np.mean(found) == pytest.approx(expected, rel=0.15)


def test_the_truth_is_within_the_stated_uncertainty_over_many_units() -> None:
    made = [
        played("turntable", white(asymmetry=False), seed, seconds=20.0, rate=25.0, speed=30.0)
        for seed in range(RUNS)
    ]
    sessions = [session_of(one) for one in made]
    for name in ("zhang-inter-triad", "zhang-optimal"):
        estimate = ESTIMATORS[name].estimate
        found = [square_sum(estimate(s), one) for s, one in zip(sessions, made, strict=True)]
        assert {degrees for _, degrees in found} == {21}
        assert_within_statement(found)


def test_five_axes_are_one_too_few() -> None:
    dropped = next(s.name.split(",")[0] for s in NINE.steps if isinstance(s, SpinStep))
    steps = tuple(s for s in NINE.steps if not s.name.startswith(f"{dropped},"))
    with pytest.raises(ObservabilityError, match=r"both ways about 5 axes.*need six"):
        ESTIMATORS["zhang-closed-form"].estimate(recorded(steps))


def test_the_optimal_set_names_the_pose_that_is_missing() -> None:
    edge = [s.name for s in NINE.steps if isinstance(s, HoldStep) and not s.name.startswith("about")][-1]
    steps = tuple(s for s in NINE.steps if s.name != edge)
    pose = next(s for s in NINE.steps if s.name == edge)
    corner = replace(pose, pose=replace(pose.pose, up_b=np.array([0.6, 0.48, 0.64])))
    session = recorded((corner, *steps))
    with pytest.raises(ObservabilityError, match=r"optimal set .* has a pose near one of"):
        ESTIMATORS["zhang-optimal"].estimate(session)
    ESTIMATORS["zhang-inter-triad"].estimate(session)


def test_axes_that_stand_upright_leave_the_rotation_between_the_triads_open() -> None:
    axes = {s.name.split(",")[0]: s.axis_b for s in NINE.steps if isinstance(s, SpinStep)}

    def upright(step: Step) -> Step:
        axis = axes.get(step.name.split(",")[0])
        if axis is None or not isinstance(step, HoldStep):
            return step
        return replace(step, pose=replace(step.pose, up_b=axis))

    steps = tuple(upright(step) for step in NINE.steps)
    session = recorded(steps)
    with pytest.raises(ObservabilityError, match="two rotation axes that are not vertical"):
        ESTIMATORS["zhang-inter-triad"].estimate(session)
    ESTIMATORS["zhang-closed-form"].estimate(session)


def test_gyros_that_do_not_see_the_earth_and_none_are_refused() -> None:
    with pytest.raises(ObservabilityError, match="too noisy to see it at rest"):
        ESTIMATORS["zhang-closed-form"].estimate(recorded(grade=find_grade("consumer-mems")))
    session = recorded()
    session.recording = replace(session.recording, angular_rate=None)
    with pytest.raises(ObservabilityError, match="needs accelerometers and gyros"):
        ESTIMATORS["zhang-closed-form"].estimate(session)


# The simulated unit on a table: sample by sample against a slow one, and by its statistics against both.

# x, y, z; and a rate that is no divisor of the sampling rate.
FAST = {"dwell": 2.0, "duration": 36.0, "lever_arm": (0.05, -0.02, 0.03)}


def generator(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(seed))


def exact(setting: Setting) -> Setting:
    quiet = replace(setting, force_noise=0.0, rate_noise=0.0, perturbation=0.0)
    return replace(quiet, angle_error=0.0, placement=0.0)


def played_slowly(setting: Setting, axis: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the gyros' integral and the accelerometers' scatter of a rotation, a rotation matrix a sample.

    p turns about its axis, which points north and is level; the earth below it is north, west, up.
    """
    unit, count = setting.unit, round(setting.duration * setting.sampling)
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    up = across / np.linalg.norm(across)
    C_pn = np.column_stack([axis, np.cross(up, axis), up])  # at the beginning
    earth = EARTH_RATE * np.array([np.cos(setting.latitude), 0.0, np.sin(setting.latitude)])
    rate = sign * setting.rate * axis
    pulled = np.cross(rate, np.cross(rate, np.array(setting.lever_arm)))
    forces, rates = [], []
    for k in range(count):
        # A vector that is fixed in n is seen from p turned back.
        C_pn_now = Rotation.from_rotvec((k + 0.5) / setting.sampling * rate).as_matrix().T @ C_pn
        forces.append(unit.force_matrix @ (GRAVITY * C_pn_now[:, 2] + pulled) + unit.force_bias)
        rates.append(unit.rate_matrix @ unit.rotation @ (rate + C_pn_now @ earth) + unit.rate_bias)
    return np.sum(rates, axis=0) / setting.sampling, np.cov(np.array(forces).T, bias=True)


@pytest.mark.parametrize(("sampled", "duration"), [(True, 36.0), (False, 36.0), (True, 11.0)])
def test_a_rotation_is_that_of_rotation_matrices(sampled: bool, duration: float) -> None:
    """Over whole turns, and over 110°, in which the Earth rate and the way round do not average out."""
    setting = replace(exact(table_setting("2")), **{**FAST, "duration": duration}, sampling=20.0)
    found = simulate(setting, 1, generator(0), sampled=sampled)
    for r, axis in enumerate(setting.axes):
        plus, minus = (played_slowly(setting, axis, sign) for sign in (1.0, -1.0))
        # 1e9 counts·s summed over 720 samples: twelve digits
        np.testing.assert_allclose(found.rotation[0, r], plus[0] - minus[0], rtol=0.0, atol=1e-3)
        # 1e6 counts²
        np.testing.assert_allclose(found.scatter[0, r], 0.5 * (plus[1] + minus[1]), rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.angle, 2.0 * setting.rate * setting.duration)


def test_statistics_of_part_of_a_turn_are_refused() -> None:
    setting = replace(table_setting("2"), duration=11.0)
    with pytest.raises(ValueError, match="whole turns"):
        simulate(setting, 1, generator(0), sampled=False)


def test_readings_at_rest_have_gravity_the_earth_rate_and_the_latitude() -> None:
    setting = exact(table_setting("2"))
    still = simulate(setting, 1, generator(0), sampled=False)
    unit = setting.unit
    force = np.linalg.solve(unit.force_matrix, (still.force[0] - unit.force_bias).T).T
    rate = np.linalg.solve(unit.rate_matrix @ unit.rotation, (still.rate[0] - unit.rate_bias).T).T
    np.testing.assert_allclose(force, GRAVITY * setting.up, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rate, axis=1), EARTH_RATE, rtol=1e-9)
    np.testing.assert_allclose(
        np.sum(rate * setting.up, axis=1), EARTH_RATE * np.sin(setting.latitude), rtol=1e-9
    )


@pytest.mark.parametrize("sampled", [True, False])
@pytest.mark.parametrize("choice", CHOICES)
def test_without_noise_all_parameters_come_back(sampled: bool, choice: str) -> None:
    """All 21 are different and of both signs: a transpose or a swapped sign would be hundreds of arcseconds."""
    setting = replace(exact(table_setting("2")), **FAST)
    estimates = evaluate(simulate(setting, 1, generator(0), sampled=sampled))
    off = in_paper_units(estimates.parameters(choice), setting.unit.parameters())
    # The paper prints 1e-4 °/h, 0.01 ppm, µg and ″.
    assert np.max(np.abs(off)) < 1e-6


def test_runs_do_not_depend_on_their_number_nor_on_the_threads() -> None:
    setting = replace(table_setting("3"), **FAST)
    few, many = simulate(setting, 2, generator(5), threads=1), simulate(setting, 5, generator(5), threads=3)
    for name in ("force", "rate", "rotation", "scatter"):
        np.testing.assert_array_equal(getattr(few, name), getattr(many, name)[:2])
    other = simulate(setting, 2, generator(6))
    assert not np.array_equal(few.force, other.force)


def test_the_noise_of_samples_is_what_it_is_said_to_be() -> None:
    setting = replace(table_setting("3"), **FAST, placement=0.0, angle_error=0.0, perturbation=0.05)
    found, true = simulate(setting, 400, generator(7)), simulate(exact(setting), 1, generator(7))
    for means, sigma in (("force", setting.sigma[:3]), ("rate", setting.sigma[3:])):
        noise = getattr(found, means) - getattr(true, means)
        expected = sigma / np.sqrt(setting.dwell * setting.sampling)
        # 3,600 numbers an axis know it to 1.2 %
        np.testing.assert_allclose(noise.std(axis=(0, 1)), expected, rtol=0.06)
    turned = (found.rotation - true.rotation).std(axis=(0, 1))
    expected = setting.sigma[3:] * np.sqrt(2.0 * setting.duration / setting.sampling)
    np.testing.assert_allclose(turned, expected, rtol=0.08)


def test_samples_and_statistics_scatter_alike() -> None:
    """Standard deviations of 400 runs each, in 21 parameters and by every choice of axes."""
    setting = replace(table_setting("3"), dwell=20.0, duration=36.0)
    truth = setting.unit.parameters()
    one, other = (
        evaluate(simulate(setting, 400, generator(seed), sampled=sampled))
        for seed, sampled in ((1, True), (2, False))
    )
    # F of 399 and 399 degrees of freedom: 99.9 % of ratios are within 0.85 to 1.18; some 30 ratios here
    for choice in CHOICES:
        sigma = [in_paper_units(e.parameters(choice), truth).std(axis=0, ddof=1) for e in (one, other)]
        assert np.all(np.abs(np.log(sigma[0] / sigma[1])) < 0.18)
    # and the scatter matrices have the same mean, within five of its standard deviations
    scatter = [simulate(setting, 400, generator(s), sampled=f).scatter for s, f in ((3, True), (4, False))]
    spread = np.sqrt(sum(s.var(axis=0) for s in scatter) / 400)
    assert np.all(np.abs(scatter[0].mean(axis=0) - scatter[1].mean(axis=0)) < 5.0 * spread)
    # with the same spread from run to run: of 36 variances the largest ratio is beyond 1.6 in no study
    ratio = scatter[0].var(axis=0) / scatter[1].var(axis=0)
    assert np.all((ratio > 0.6) & (ratio < 1.0 / 0.6))
