"""Variances beyond what any unit does, and residuals beyond what is expected, are objected to; usual ones are not."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.estimate import Estimate, LeftOut
from tumble.calibration.evidence import Holds, Turns
from tumble.calibration.verdict import beyond_ceilings, misfit
from tumble.sensor import ImuModel


def estimate(components: dict[str, float], norms: np.ndarray) -> Estimate:
    none, model = np.zeros((0, 0)), ImuModel(None, None)
    found = Estimate("hand-held", model, [], none, [], none, 1.0, 1.0, 9, 2.0, 1.0, components)
    found.show(Holds(norms, np.ones_like(norms)))
    return found


def test_a_variance_beyond_all_units_names_the_worst_hold() -> None:
    norms = np.array([1e-3, -4e-2, 2e-3])
    (said,) = beyond_ceilings(estimate({"accelerometer bias from hold to hold, m/s²": 0.025}, norms))
    assert "25 mm/s²" in said
    assert "hold 2" in said


def test_what_a_phone_does_is_none() -> None:
    components = {
        "accelerometer bias from hold to hold, m/s²": 0.005,
        "gyro bias from hold to hold, rad/s": np.radians(0.05),
        "direction after a turn, rad": 0.01,
    }
    assert beyond_ceilings(estimate(components, np.array([1e-3]))) == []


def of_turns(angles: np.ndarray, *left_out: int) -> list[str]:
    found = estimate({}, np.zeros(0))
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
    found = estimate({}, np.zeros(0))
    found.sigma0 = sigma0
    assert (misfit(found) == []) is fit
