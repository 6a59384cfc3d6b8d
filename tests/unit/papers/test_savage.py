"""Savage's rotation test: what errors do over a sequence, the way back, on recordings and in his simulated test.

The coefficients of (12) and (22) are held by the papers' items, and (13) against motions by the recordings below.
"""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.docs.test_tables import page

from second_simulator.calibrating import played
from tumble.calibration import Session
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.protocol import SEQUENCES, HoldStep, Protocol, Step, named_protocol, sequence_steps, start_down
from tumble.sensor import GROUPS, NAMES, ImuModel, SavageErrors, savage_from_model
from tumble.simulation import FixtureErrors, simulate_protocol
from tumble_papers.savage.methods import ESTIMATORS, inversion_covariance
from tumble_papers.savage.section_9 import unit
from tumble_papers.savage.sequences import (
    AVERAGING,
    SequenceModel,
    invert_measurements,
    measure_sequence,
    sequence_model,
    solve_measurements,
    window_weights,
)
from tumble_papers.savage.strapdown_simulation import (
    AS_PRINTED,
    GRADES,
    START_NORM,
    Setting,
    composed,
    matched_weights,
    measure_run,
    run_study,
    simulate_run,
)
from unit.given import given, signals
from unit.papers.recovered import assert_within_statement, session_of, square_sum, white

GRAVITY = 9.81
ROWS = {row.name: row for row in SEQUENCES}


# Against exact rotations -----------------------------------------------------------------------------

STEP, REST, TURN = 0.02, 200, 80
EARTH = 7.2921e-5
DOWN_Z = np.array([0.0, 0.0, 1.0])


def turned(rotations, earth_b, down):
    """Exact rates (rotation vector of each sample over its time) and forces of a unit on the turning Earth."""
    still = np.zeros((REST, 3))
    vectors = [np.tile(np.eye(3)[axis] * angle / TURN, (TURN, 1)) for axis, angle in rotations]
    # Attitude against the Earth at the edges of the samples, in the frame of the start.
    edges = [Rotation.identity()]
    for vector in np.concatenate([still, *vectors, still]):
        edges.append(edges[-1] * Rotation.from_rotvec(vector))
    against_inertial = [Rotation.from_rotvec(earth_b * k * STEP) * edge for k, edge in enumerate(edges)]
    rate = np.array([(one.inv() * other).as_rotvec() / STEP for one, other in pairwise(against_inertial)])
    return rate, np.array([edge.inv().apply(-GRAVITY * down) for edge in edges[1:]])


def measured(rate, force, earth, down=DOWN_Z, **options):
    end = (len(rate) - REST, len(rate))
    return measure_sequence(rate, force, STEP, earth, (0, REST), end, GRAVITY, down, **options)


@pytest.mark.parametrize("averaging", AVERAGING)
@pytest.mark.parametrize("start_bias", [True, False])
@pytest.mark.parametrize("name", ["1", "6", "7", "10", "14"])
def test_an_ideal_unit_measures_nothing_on_the_turning_earth(name, start_bias, averaging):
    row = ROWS[name]
    down = start_down(row)
    earth = EARTH * np.array([0.52, -0.41, 0.75])
    rate, force = turned(row.rotations, earth, down)
    found = measured(rate, force, earth, down, start_bias=start_bias, averaging=averaging)
    # Half a sample of the Earth's turn is 0.7 µrad in both windows, and does not stand in their difference to first
    # order; its square of 5e-13 does, and rounding of 10 m/s².
    np.testing.assert_allclose(found.vector, 0.0, rtol=0, atol=3e-11)
    np.testing.assert_allclose(found.gyro_bias, 0.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("averaging", AVERAGING)
@pytest.mark.parametrize("count", [1, 2, 3, 9, 10, 500])
def test_weights_of_a_window_add_up_to_one_and_lie_even(averaging: str, count: int) -> None:
    weights = window_weights(count, averaging)
    assert weights.shape == (count,)
    assert np.sum(weights) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(weights, weights[::-1], rtol=0, atol=1e-15)
    assert np.all(weights > 0.0)
    if count == 9:
        running = [np.arange(k, k + 5) for k in range(5)] if averaging != "plain" else [np.arange(9)]
        mean = np.mean([np.isin(np.arange(9), part) / len(part) for part in running], axis=0)
        np.testing.assert_allclose(weights, mean, rtol=1e-14)


@pytest.mark.parametrize("angle", [1e-3, 5e-3])
def test_a_fixture_that_leans_by_an_angle_shortens_the_projection_by_half_its_square_and_not_the_norm(angle):
    leaning = Rotation.from_rotvec([angle, 0.0, 0.0]).apply(DOWN_Z)
    rate, force = turned(((1, np.pi),), np.zeros(3), leaning)
    by_norm = measured(rate, force, np.zeros(3))
    by_projection = measured(rate, force, np.zeros(3), norm=False)
    np.testing.assert_allclose(by_norm.vector[3:], 0.0, rtol=0, atol=1e-12)
    expected = GRAVITY * (1.0 - np.cos(angle))
    assert expected == pytest.approx(GRAVITY * angle**2 / 2.0, rel=angle)
    np.testing.assert_allclose(by_projection.vector[3:], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_norm.horizontal, by_projection.horizontal, rtol=0, atol=1e-14)


def test_the_bias_that_the_start_shows_is_taken_out_and_told() -> None:
    earth, bias = EARTH * np.array([0.3, 0.5, -0.8]), np.array([2e-3, -1e-3, 5e-4])
    rate, force = turned(ROWS["13"].rotations, earth, DOWN_Z)
    plain, biased = measured(rate, force, earth), measured(rate + bias, force, earth)
    np.testing.assert_allclose(biased.vector, plain.vector, rtol=0, atol=1e-13)
    np.testing.assert_allclose(biased.gyro_bias - plain.gyro_bias, bias, rtol=0, atol=1e-16)
    kept = measured(rate + bias, force, earth, start_bias=False)
    assert np.linalg.norm(kept.horizontal) > 0.05  # 1 mrad/s for some seconds of 10 m/s²


@pytest.mark.parametrize("start", [(5, 5), (-1, 4), (0, 1001), (20, 10)])
def test_ranges_and_averages_that_are_none_are_refused(start: tuple[int, int]) -> None:
    nothing = np.zeros((1000, 3))
    for ranges in ((start, (900, 1000)), ((0, 10), start)):
        with pytest.raises(
            ValueError, match=f"samples {start[0]} to {start[1]} are no range of 1000 samples"
        ):
            measure_sequence(nothing, nothing, STEP, np.zeros(3), *ranges, GRAVITY, DOWN_Z)
    with pytest.raises(ValueError, match="'median' is none of plain, average-of-averages"):
        window_weights(10, "median")


MODELS: dict[str, SequenceModel] = {
    row.name: sequence_model(row.rotations, start_down(row), GRAVITY) for row in SEQUENCES
}
# ppm, µrad and some µm/s²: no two alike
ERRORS = np.arange(1.0, 25.0) * np.where(np.arange(24) % 3 == 1, -1.0, 1.0) * 1e-4


def spread(name: str) -> np.ndarray:
    """Some covariance with correlations, another one for each sequence."""
    rng = np.random.default_rng(sum(name.encode()))
    root = 1e-5 * (np.eye(5) + 0.2 * rng.normal(size=(5, 5)))
    return root @ root.T


@pytest.mark.parametrize("asymmetry", [True, False])
def test_13_and_14_and_least_squares_give_back_every_error_of_the_linear_model(asymmetry: bool) -> None:
    """Without asymmetry of the gyros, (14), no sequence is turned back."""
    models = {name: model for name, model in MODELS.items() if asymmetry or not name.endswith("a")}
    errors = ERRORS if asymmetry else np.where(np.isin(np.arange(24), [3, 4, 5]), 0.0, ERRORS)
    told = {name: model.coefficients @ errors for name, model in models.items()}
    found = invert_measurements(told, GRAVITY, asymmetry=asymmetry)
    # rounding of a division of numbers of 1e-2 by 40
    np.testing.assert_allclose(found, errors, rtol=0, atol=1e-14)
    spreads = [spread(name) for name in models]
    found = solve_measurements(list(models.values()), list(told.values()), spreads, asymmetry=asymmetry)
    # 24 unknowns of a condition of some hundreds
    np.testing.assert_allclose(found, errors, rtol=0, atol=1e-12)


def test_what_a_missing_sequence_leaves_untold_is_what_the_page_says() -> None:
    """The table of missing sequences, row by row, by least squares on the linear model."""
    text = page("procedures/strapdown-rotation")
    rows = re.findall(r"^\| (any of [^|]*|1a, 2a or 3a|6|7, 9, 10, 12) \| ([^|]*) \|$", text, re.M)
    assert len(rows) == 4
    said = {name: words for names, words in rows for name in re.findall(r"\d+a?", names)}
    assert set(said) == set(MODELS)
    for gone, words in said.items():
        left = [model for name, model in MODELS.items() if name != gone]
        each = [[np.round(m.coefficients[:, k], 9) for m in left] for k in range(24)]  # of one error alone
        found = [solve_measurements(left, shown, [np.eye(5) for _ in left]) for shown in each]
        untold = [name for k, name in enumerate(NAMES) if found[k][k] < 1.0 - 1e-6]
        if gone.endswith("a"):
            assert [name.split()[0] for name in untold] == ["kappa", "kappa"]
        elif words.startswith("nothing"):
            assert untold == []
        else:
            greek = [name.replace("upsilon ", "υ").replace("mu ", "μ") for name in untold]
            assert greek
            assert all(name in words for name in greek)


def test_least_squares_weighs_each_component_by_its_noise() -> None:
    rng = np.random.default_rng(8)
    told = [m.coefficients @ ERRORS + 1e-5 * rng.normal(size=5) for m in MODELS.values()]
    variances = np.array([1.0, 1.0, 1.0, 2.0, 3.0])
    found = solve_measurements(list(MODELS.values()), told, [1e-10 * np.diag(variances) for _ in MODELS])
    design, right = [], []
    for model, value in zip(MODELS.values(), told, strict=True):
        down = int(np.argmax(np.abs(model.down_start)))
        keep = [(down + 1) % 3, (down + 2) % 3, 3, 4]
        weight = 1.0 / np.sqrt(variances[keep])
        design.append(weight[:, None] * model.coefficients[keep])
        right.append(weight * value[keep])
    expected = np.linalg.lstsq(np.concatenate(design), np.concatenate(right), rcond=None)[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


# Savage's inversion on recordings of rotation sequences: the truth, the stated uncertainty, and what is refused.

SITE = replace(Site.from_latitude(np.radians(40.0), 300.0), gravity_sigma=0.0)
PROTOCOL = replace(named_protocol("strapdown-rotation"), site=SITE)
# 1 mrad in everything that a fixture may be off by.
FIXTURE = FixtureErrors(
    tilt=(1e-3, -7e-4), orthogonality=8e-4, inner_zero=-1e-3, outer_zero=6e-4, mounting=(5e-4, -9e-4, 1e-3),
    execution=3e-4,
)  # fmt: skip
# No two alike: one that shows as another is seen.
TRUTH = 1e-3 * np.array(
    [1.1, -0.7, 0.4, 0.2, -0.3, 0.15, 1.3, -0.9, 0.6, 20.0, -30.0, 50.0,
     0.8, -1.2, 1.7, -0.1, 0.25, 0.35, 2.1, -1.6, 0.3, 1.9, -2.4, 0.75]
)  # fmt: skip
GYRO_BIAS = np.array([2e-5, -3e-5, 1e-5])
# Biases count against gravity.
SCALE = np.where(np.isin(np.arange(24), np.arange(24)[GROUPS["lambda_bias"]]), SITE.gravity, 1.0)
ESTIMATE = ESTIMATORS["savage-inversion"].estimate
RUNS = 24


def recorded(fixture, protocol=PROTOCOL, units="SI", errors=TRUTH):
    model = SavageErrors.from_vector(errors, GYRO_BIAS).model()
    recording, _ = simulate_protocol(
        protocol, 50.0, np.random.default_rng(5), site=SITE, model=model, fixture=fixture, units=units
    )
    return Session(recording, protocol)


def off(model: ImuModel, units: str = "SI") -> np.ndarray:
    """Of the 24 errors, each by itself, in the frame mean-gyro."""
    force, rate = (1e4, 1e6) if units == "counts" else (1.0, 1.0)
    in_si = ImuModel(
        given(model.accelerometer).in_raw_unit(1.0 / force), given(model.gyroscope).in_raw_unit(1.0 / rate)
    )
    found, U = savage_from_model(in_si)
    np.testing.assert_allclose(U, np.eye(3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.gyro_bias, GYRO_BIAS, rtol=0, atol=1e-7)
    return (found.vector - TRUTH) / SCALE


def without(*gone: str) -> Protocol:
    sequences = [s for s in sequence_steps(PROTOCOL) if s.name not in gone]
    kept = {k for s in sequences for k in range(s.start, s.end + 1)}
    ends = {s.end for s in sequences}
    steps = tuple(s for k, s in enumerate(PROTOCOL.steps) if k in kept or k - 1 in ends)
    return replace(PROTOCOL, steps=steps)


@pytest.mark.parametrize("units", ["SI", "counts"])
def test_without_noise_all_errors_come_back(units: str) -> None:
    """To 5e-8: the Earth's turn of 2 mrad over a sequence meets errors of 1e-3 and angles of samples."""
    estimate = ESTIMATE(recorded(FixtureErrors(), units=units))
    np.testing.assert_allclose(off(estimate.model, units), 0.0, rtol=0, atol=5e-8)
    assert estimate.frame == "mean-gyro"


def test_a_fixture_off_by_a_milliradian_everywhere_moves_no_error_by_a_millionth() -> None:
    """What is left is the Earth rate taken out 1 mrad beside: 7e-5 rad/s for 27 s times 1 mrad is 2 µrad at most."""
    left = np.abs(off(ESTIMATE(recorded(FIXTURE)).model))
    assert 1e-8 < np.max(left) < 1e-6


def test_without_the_sequences_turned_back_the_gyros_have_no_asymmetry() -> None:
    """(14): of a gyro that has one, the scale factor is off by it."""
    estimate = ESTIMATE(recorded(FixtureErrors(), without("1a", "2a", "3a")))
    left = off(estimate.model)
    kappa, asymmetry = GROUPS["kappa_lin"], GROUPS["kappa_asym"]
    np.testing.assert_allclose(left[asymmetry], -TRUTH[asymmetry], rtol=0, atol=1e-12)
    np.testing.assert_allclose(left[kappa], TRUTH[asymmetry], rtol=0, atol=1e-6)
    assert not any(name.startswith("gyroscope.asymmetry") for name in estimate.names)


def test_the_covariance_is_that_of_13_by_hand() -> None:
    """Sequences of independent components of sizes of their own; of each group one error."""
    g, names = 9.81, [s.name for s in sequence_steps(PROTOCOL)]
    sigma = {name: 1e-5 * np.arange(1.0, 6.0) * (k + 1) for k, name in enumerate(names)}
    found = inversion_covariance({n: np.diag(s**2) for n, s in sigma.items()}, g, asymmetry=True)
    variance = dict(zip(NAMES, np.diag(found), strict=True))
    full = 4.0 * np.pi * g
    expected = {
        "kappa xx": (sigma["2"][1] ** 2 + sigma["2a"][1] ** 2) / full**2,
        "upsilon yz": (sigma["4"][1] / (4.0 * g)) ** 2,
        "lambda x": (0.5 * sigma["14"][0]) ** 2 + (0.25 * sigma["5"][0]) ** 2,
        "lambda xx": (sigma["9"][3] ** 2 + sigma["9"][4] ** 2) / (2.0 * g) ** 2,
        "mu xy": (sigma["7"][0] / (2.0 * g)) ** 2 + (sigma["6"][1] / (8.0 * g)) ** 2,
    }
    for name, value in expected.items():
        assert variance[name] == pytest.approx(value, rel=1e-9)


def test_the_truth_is_within_the_stated_uncertainty_over_many_units() -> None:
    """On a fixture off by 0.1 mrad, which makes 0.2 µrad of the Earth rate, a hundredth of the noise."""
    found: list[tuple[float, int]] = []
    for seed in range(RUNS):
        made = played("strapdown-rotation", white(asymmetry=True), seed, error=1e-4, azimuth=1e-5, rate=50.0)
        found.append(square_sum(ESTIMATE(session_of(made)), made))
    assert {degrees for _, degrees in found} == {27}
    assert_within_statement(found)


# What is refused -----------------------------------------------------------------------------------


def test_a_sequence_that_is_missing_is_named() -> None:
    with pytest.raises(ObservabilityError, match="need all sequences, and 9 are missing"):
        ESTIMATE(recorded(FixtureErrors(), without("9")))


@pytest.mark.parametrize("unknown", ["latitude", "heading"])
def test_an_earth_rate_that_nobody_knows_is_asked_for(unknown: str) -> None:
    def headless(step: Step) -> Step:
        known = isinstance(step, HoldStep) and step.pose is not None
        return replace(step, pose=replace(step.pose, heading=None)) if known else step

    session = recorded(FixtureErrors())
    headings = tuple(headless(step) for step in PROTOCOL.steps)
    session.protocol = (
        replace(PROTOCOL, site=None) if unknown == "latitude" else replace(PROTOCOL, steps=headings)
    )
    with pytest.raises(ObservabilityError, match=r"a latitude \(--site\) and for .*`heading_deg`"):
        ESTIMATE(session)


def test_samples_that_are_missing_in_a_sequence_are_refused() -> None:
    session = recorded(FixtureErrors())
    whole, stop = session.recording, session.timeline.holds[0].stop
    kept = np.delete(np.arange(len(whole.time)), slice(stop + 10, stop + 13))
    force, rate = (part[kept] for part in signals(whole))
    told = replace(whole, time=whole.time[kept], specific_force=force, angular_rate=rate)
    with pytest.raises(ObservabilityError, match="Samples are missing in sequence 1"):
        ESTIMATE(Session(told, PROTOCOL))


# The simulated test: exact where it has to be, and as noisy as it is said to be.

ZERO = SavageErrors.from_vector(np.zeros(24))
BRIEF = 1.0  # s; without noise as good as ten


def test_the_earth_rate_is_in_the_increments_as_the_test_takes_it_out() -> None:
    setting = Setting(unit(), fixture=0.0, seconds=BRIEF)
    recordings = simulate_run(setting, np.random.default_rng(2), truth=ZERO)
    measured = measure_run(recordings, ImuModel.ideal(), AS_PRINTED)
    # steps of 10 ms about a turning Earth axis: ω e dt²/12 a sample, some 1e-9 rad at the end
    for vector in measured.values():
        np.testing.assert_allclose(vector, 0.0, atol=3e-8)
    still = measure_run(replace(recordings, earth=0.0 * recordings.earth), ImuModel.ideal(), AS_PRINTED)
    assert max(np.max(np.abs(vector)) for vector in still.values()) > 1e-3


def test_matched_weights_are_one_together_and_largest_next_to_the_rotations() -> None:
    weights = matched_weights(Setting(GRADES["MEMS"]))
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(np.diff(weights) > 0.0)
    # cosh(t/τ) with τ = 100 µg/√Hz over g times 0.3 °/√h: 1.146 s, a tenth of the window
    assert weights[-1] / weights[-116] == pytest.approx(np.e, rel=0.02)
    even = matched_weights(Setting(unit(velocity_random_walk=1.0)))
    assert np.ptp(even) < 1e-5 * even.mean()


def test_the_same_seed_gives_the_same_errors_with_any_number_of_threads() -> None:
    setting = Setting(GRADES["nav"], seconds=BRIEF)
    one, two = (
        run_study(setting, (START_NORM,), 4, np.random.Generator(np.random.SFC64(8)), iterations=2, threads=t)
        for t in (1, 2)
    )
    np.testing.assert_array_equal(one, two)


def test_a_composed_model_undoes_a_unit_whose_rest_is_known() -> None:
    """raw = A(B(x)) for compensation A and rest B without asymmetry: the composed model is exact."""
    rng = np.random.default_rng(9)
    known, rest = (
        SavageErrors.from_vector(np.where(np.isin(np.arange(24), [3, 4, 5, 15, 16, 17]), 0.0, v), gyro_bias=b)
        for v, b in zip(1e-2 * rng.standard_normal((2, 24)), 1e-3 * rng.standard_normal((2, 3)), strict=True)
    )
    whole = composed(known.model(), rest)
    force, rate = rng.standard_normal((2, 5, 3))
    inner = rest.model().distort(force, rate)
    expected = known.model().distort(*inner)
    for a, b in zip(whole.distort(force, rate), expected, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-14)
    assert savage_from_model(whole)[0].kappa[0] != known.kappa[0]
