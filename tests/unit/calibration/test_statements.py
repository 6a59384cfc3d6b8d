"""What is stated: degrees of freedom, detectable errors, scatter of turn-ons, and what is beyond any unit."""

import numpy as np
import pytest

from tumble.calibration.estimate import Estimate, LeftOut
from tumble.calibration.evidence import (
    Holds,
    RecordingOfUnit,
    TurnOns,
    Turns,
    agreement_of,
    bias_scatter,
    chi_square_probability,
    coverage_factors,
    effective_degrees,
)
from tumble.calibration.outcome.budget import numerical_tolerance, shortest_intervals
from tumble.calibration.turn_ons.adjustment import disagreement
from tumble.calibration.turn_ons.estimate import turn_on_cautions, turn_on_sentences
from tumble.calibration.verdict import beyond_ceilings, misfit
from tumble.parameters import amount
from tumble.sensor import ImuModel


def test_the_end_gauge_of_the_gum_has_16_effective_degrees_of_freedom() -> None:
    """GUM H.1.6: 25, 9.7, 2.9 and 16.6 nm with 18, 25.6, 50 and 2 degrees give 16, and k99 = 2.92 there."""
    sigmas = {
        name: np.array([value]) for name, value in (("ls", 25.0), ("d", 9.7), ("aT", 2.9), ("dT", 16.6))
    }
    degrees = effective_degrees(sigmas, {"ls": 18.0, "d": 25.6, "aT": 50.0, "dT": 2.0})
    assert int(degrees[0]) == 16
    # GUM table G.2: t95 of 16 degrees; what is known exactly leaves the normal factor
    assert coverage_factors(degrees)[0] == pytest.approx(2.12, abs=0.005)
    exactly = effective_degrees({"gravity": np.array([1.0, 2.0])}, {})
    assert np.all(np.isinf(exactly))
    assert coverage_factors(exactly) == pytest.approx([1.96, 1.96], abs=1e-3)


def test_the_shortest_interval_of_an_exponential_begins_at_zero() -> None:
    drawn = np.random.default_rng(2).exponential(1.0, (100_000, 1))
    low, high = shortest_intervals(drawn, 0.95)
    # its end scatters by sqrt(0.05 0.95 / 100000) / 0.05 = 0.014
    assert low[0] == pytest.approx(0.0, abs=0.01)
    assert high[0] == pytest.approx(-np.log(0.05), abs=0.05)


def test_the_tolerance_is_half_a_unit_of_the_one_digit() -> None:
    told = numerical_tolerance(np.array([0.00035, 4.2, 9.7, 0.0]))
    assert told == pytest.approx([0.00005, 0.5, 5.0, 0.0])


def test_the_global_test_is_of_both_sides() -> None:
    assert chi_square_probability(3.94, 10.0) == pytest.approx(0.10, abs=2e-3)
    assert chi_square_probability(18.31, 10.0) == pytest.approx(0.10, abs=2e-3)
    assert chi_square_probability(9.5, 10.0) > 0.9


def test_scatter_and_the_next_turn_on_by_hand() -> None:
    """1, 2 and 6 about their mean 3: squares 4 + 1 + 9 over 2 degrees of freedom."""
    seen = np.array([1.0, 2.0, 6.0])
    told = bias_scatter("gyro bias x", "rad/s", seen, 0.01 * np.eye(3), recordings=3, at=[0, 1, 2])
    assert told.mean == pytest.approx(3.0)
    assert told.scatter == pytest.approx(np.sqrt(7.0))
    assert told.measurement == pytest.approx(0.1)
    assert told.mean_sigma == pytest.approx(0.1 / np.sqrt(3.0))
    assert told.turn_on == pytest.approx(np.sqrt(7.0 - 0.01))
    assert told.next_sigma == pytest.approx(np.sqrt(7.0 * 4.0 / 3.0))
    assert told.chi_square == pytest.approx(14.0 / 0.01)
    assert told.changes


def test_an_error_that_all_recordings_share_is_in_the_mean_and_not_in_the_scatter() -> None:
    seen, covariance = np.array([0.1, -0.1, 0.1, -0.1]), 0.04 + 0.01 * np.eye(4)
    told = bias_scatter("gyro bias x", "rad/s", seen, covariance, recordings=4, at=range(4))
    assert told.measurement == pytest.approx(0.1)
    assert told.mean_sigma == pytest.approx(np.sqrt(0.04 + 0.01 / 4.0))
    assert told.chi_square == pytest.approx(4.0)


@pytest.mark.parametrize("moves", [0.0, 1.0, 10.0])
@pytest.mark.parametrize("recordings", [2, 3, 6])
def test_the_next_turn_on_is_inside_its_interval(moves: float, recordings: int) -> None:
    """At least 95 % of 2000 draws, less three standard deviations of that share: 93.5 %."""
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(2000):
        truth = rng.normal(0.0, moves, recordings + 1)
        seen = truth[:-1] + rng.normal(0.0, 1.0, recordings)
        told = bias_scatter("b", "1", seen, np.eye(recordings), recordings=recordings, at=range(recordings))
        inside += abs(told.mean - truth[-1]) <= told.coverage_factor * told.next_sigma
    assert inside / 2000 > 0.935


def test_agreement_by_hand() -> None:
    """0 ± 1 and 3 ± 2: weighted mean 0.6, chi-square 0.36 + 1.44."""
    told = agreement_of(
        "scale", "1", np.array([0.0, np.nan, 3.0]), np.array([1.0, np.nan, 2.0]), (0.6, 0.9), 0.01
    )
    assert told.chi_square == pytest.approx(1.8)
    assert told.degrees == 1
    assert told.agrees
    assert told.enlarged == 1.0
    assert told.largest == pytest.approx(3.0)


def test_a_disagreement_enlarges_by_birges_ratio() -> None:
    told = agreement_of("scale", "1", np.array([0.0, 10.0]), np.ones(2), (5.0, 0.7), 0.01)
    assert not told.agrees
    assert told.enlarged == pytest.approx(np.sqrt(50.0))


def test_what_only_one_recording_tells_cannot_disagree() -> None:
    told = agreement_of("scale", "1", np.array([np.nan, 10.0]), np.array([np.nan, 1.0]), (10.0, 1.0), 0.01)
    assert told.degrees == 0
    assert told.agrees


def test_directions_that_a_recording_does_not_tell_are_no_degrees_of_freedom() -> None:
    """Two recordings of three unknowns, the second tells one of them: four directions for three unknowns."""
    precisions = [np.diag([1.0, 4.0, 9.0]), np.diag([1.0, 0.0, 0.0])]
    first = np.array([1.0, 0.0, 0.0]), np.diag([1.0, 0.25, 1.0 / 9.0])
    second = np.array([-1.0, 0.0, 0.0]), np.diag([1.0, 1e4, 1e4])
    squares, degrees, probability = disagreement([first, second], precisions, np.zeros(3), 1.0)
    assert squares == pytest.approx(2.0)
    assert degrees == 1
    assert probability == pytest.approx(0.1573, abs=1e-4)  # chi-square of 2 with one degree of freedom


def test_what_changes_is_said_first_and_a_g_sensitivity_with_its_other_explanation() -> None:
    told = TurnOns([RecordingOfUnit(name, 26, 25, 0, 1.0, {}, 150.0, 50.0) for name in ("a.csv", "b.csv")])
    scale = agreement_of(
        "gyro scale factor error y", "1", np.array([0.0, 1e-3]), np.full(2, 1e-5), (0.0, 1e-5), 0.01
    )
    term = agreement_of(
        "g-sensitivity of gyro x to force y", "x", np.array([0.0, 1.0]), np.full(2, 0.1), (0.0, 0.1), 0.01
    )
    told.agreements = [scale, term]
    (caution,) = turn_on_cautions(told)
    assert caution == (
        "Gyro scale factor error y is not stable: a.csv and b.csv differ by 1000 ppm (probability below 1e-12). Was "
        "one of them at another temperature, was the unit dropped or mounted anew, or is it another unit?"
    )
    said = " ".join(turn_on_sentences(told))
    assert "2 of the 2 parameters that should be stable do not agree" in said
    assert "Among them is g-sensitivity of gyro x to force y: a gyro bias that drifted" in said


def claimed(components: dict[str, float], norms: np.ndarray) -> Estimate:
    none, model = np.zeros((0, 0)), ImuModel(None, None)
    found = Estimate("hand-held", model, [], none, [], none, 1.0, 1.0, 9, 2.0, 1.0, components)
    found.show(Holds(norms, np.ones_like(norms)))
    return found


def test_a_variance_beyond_all_units_names_the_worst_hold() -> None:
    norms = np.array([1e-3, -4e-2, 2e-3])
    (said,) = beyond_ceilings(claimed({"accelerometer bias from hold to hold, m/s²": 0.025}, norms))
    assert "25 mm/s²" in said
    assert "hold 2" in said


def test_what_a_phone_does_is_none() -> None:
    components = {
        "accelerometer bias from hold to hold, m/s²": 0.005,
        "gyro bias from hold to hold, rad/s": np.radians(0.05),
        "direction after a turn, rad": 0.01,
    }
    assert beyond_ceilings(claimed(components, np.array([1e-3]))) == []


def of_turns(angles: np.ndarray, *left_out: int) -> list[str]:
    found = claimed({}, np.zeros(0))
    found.show(Turns(angles, np.full(angles.size, 1e-3), np.ones(angles.size)))
    found.left_out = [LeftOut("turn", k, "") for k in left_out]
    return misfit(found)


def test_turns_that_miss_by_far_more_than_expected_do_not_fit_however_small_the_angle() -> None:
    (said,) = of_turns(np.radians([0.2, 0.1, 0.3, 0.2, np.nan]))
    assert "misses by 0.21° rms, 3.7 times what is expected" in said


def test_what_was_left_out_is_no_misfit_of_the_rest() -> None:
    assert not of_turns(np.array([1e-3, 8e-3, 1.5e-3, 1e-3]), 1)


def test_right_turns_are_called_no_more_often_than_stated() -> None:
    """At 1.6 times what is expected chance does it in one of a thousand: of 2000 more than 8 hardly ever."""
    rng = np.random.default_rng(1)
    drawn = 1.6e-3 * np.hypot(*rng.standard_normal((2, 2000, 20))) / np.sqrt(2.0)
    assert sum(bool(of_turns(angles)) for angles in drawn) <= 8


@pytest.mark.parametrize(("sigma0", "fit"), [(15.0, True), (100.0, False)])
def test_residuals_of_a_hundred_times_the_noise_do_not_fit(sigma0: float, fit: bool) -> None:
    found = claimed({}, np.zeros(0))
    found.sigma0 = sigma0
    assert (misfit(found) == []) is fit


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (0.0123, "m/s^2", "1.3 mg"),
        (0.0123, "g", "12 mg"),
        (2e-4, "1", "200 ppm"),
        (2e-3, "1", "0.2 %"),
        (3e-3, "rad", "3 mrad"),
        (1e-3, "rad/s", "210 °/h"),
        (3.0, "counts", "3 counts"),
        (1e-5, "rad/s/(m/s²)", "0.0056 (°/s)/g"),
    ],
)
def test_amounts_in_units_that_people_compare(value: float, unit: str, words: str) -> None:
    assert amount(value, unit) == words
