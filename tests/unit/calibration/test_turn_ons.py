"""How biases scatter and whether parameters agree: by hand, and by many draws of what they claim."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.evidence import RecordingOfUnit, TurnOns, agreement_of, bias_scatter
from tumble.calibration.turn_ons.adjustment import disagreement
from tumble.calibration.turn_ons.estimate import turn_on_cautions, turn_on_sentences
from tumble.parameters.measures import amount


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


def test_a_recording_without_the_sensor_has_no_bias() -> None:
    told = bias_scatter("gyro bias x", "rad/s", np.array([1.0, 2.0]), np.eye(2), recordings=3, at=[0, 2])
    np.testing.assert_array_equal(np.isnan(told.values), [False, True, False])
    assert told.degrees == 1


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
