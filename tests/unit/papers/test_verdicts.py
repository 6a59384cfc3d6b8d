"""The rules by which a field table's printed numbers are judged."""

from __future__ import annotations

import numpy as np
import pytest

from tumble_papers.hayal.scenarios import FAR, ONE_RUN, criterion, judge_estimate, judge_sigma, one_run_factor

OURS = np.array([1.0, 2.0, 3.0, 8.0])


@pytest.mark.parametrize("printed", [1.0, 2.5, 8.0])
def test_a_sigma_between_the_lowest_and_the_highest_is_one_of_ours(printed: float) -> None:
    assert judge_sigma(printed, OURS, 2.0, 17) == (True, "")


@pytest.mark.parametrize(
    ("printed", "words"),
    [
        # 10 / median 2.5; sigma0 10 / 2
        (10.0, ["4 times the median", "about 5:", "wandered more"]),
        # sigma0 0.5 / 2: less than white noise of the sheet's size leaves
        (0.5, ["0.2 times the median", "about 0.25:", "quieter than the sheet"]),
    ],
)
def test_a_sigma_beyond_them_is_not_and_it_is_said_why(printed: float, words: list[str]) -> None:
    fits, reason = judge_sigma(printed, OURS, 2.0, 17)
    assert not fits
    for word in words:
        assert word in reason


def test_a_smaller_sigma_of_a_sigma0_above_one_is_not_the_noise_s() -> None:
    _, reason = judge_sigma(0.5, OURS, 0.25, 17)
    assert "wandered less" in reason


def test_one_unit_is_compared_by_the_f_distribution() -> None:
    """F of (1, 1) at 99.5 % is 16211, of (17, 17) 3.71, of tables."""
    assert one_run_factor(1) == pytest.approx(ONE_RUN * np.sqrt(16211.0), rel=1e-4)
    assert one_run_factor(17) == pytest.approx(ONE_RUN * np.sqrt(3.707), rel=1e-3)
    one = np.array([1.0])
    assert judge_sigma(9.0, one, 1.0, 17)[0]
    assert judge_sigma(1 / 9.0, one, 1.0, 17)[0]
    assert not judge_sigma(11.0, one, 1.0, 17)[0]
    assert not judge_sigma(1 / 11.0, one, 1.0, 17)[0]
    assert judge_sigma(600.0, one, 1.0, 1)[0]


def test_an_estimate_near_zero_needs_no_word() -> None:
    assert judge_estimate(FAR, 0.0, 500) == (True, "")


def test_an_estimate_far_from_zero_is_plausible_if_ours_are_as_far_off() -> None:
    assert judge_estimate(15.0, 0.03, 500) == (
        True,
        "its estimate is 15 times sheet and sigma together from zero; so far off are 3 % of ours",
    )
    fits, words = judge_estimate(3.5, 0.002, 500)
    assert not fits
    assert "0.2 % of ours" in words


def test_few_units_cannot_tell_that_something_is_rare() -> None:
    assert judge_estimate(15.0, 0.0, 200)[0]
    assert not judge_estimate(15.0, 0.0, 400)[0]
    assert judge_estimate(15.0, 0.0, 1) == (
        True,
        "its estimate is 15 times sheet and sigma together from zero",
    )


def test_the_criterion_says_what_is_compared() -> None:
    assert "500 simulated units" in criterion(500, 17)
    assert "factor of 9.6" in criterion(1, 17)
    assert "1 degree of freedom" in criterion(1, 1)
