"""Soak tests of another hand: what is too little for a model is not fit, and biases are never stated as still."""

from __future__ import annotations

import numpy as np
import pytest

from second_simulator import GRADES
from second_simulator.calibrating import calibrated, played
from tumble.document import Calibration

STILL = "gyro bias, flicker floor of the Allan deviation, rad/s"


def soaked(grade: str, seed: int, minutes: float, fault: str | None = None) -> Calibration:
    return calibrated(played("thermal-soak", grade, seed, fault, minutes=minutes), rate="10±0.0005")


@pytest.mark.parametrize("seed", [31007, 31002])
def test_soaks_too_short_to_be_left_out_one_by_one_are_not_fit(seed: int) -> None:
    """Most rests have not settled. A straight line was taken, and biases were off by up to 38 of their sigmas."""
    calibration = soaked("tactical", seed, minutes=6.0)
    assert not calibration.verdict.fit
    assert any(
        "Without one soak the other rests do not determine" in said for said in calibration.verdict.reasons
    )


def test_biases_that_look_still_by_chance_are_not_stated_as_still() -> None:
    """The likelihood of the wander is largest at none; gyro biases were off by 5.8 of the sigmas that follow."""
    calibration = soaked("automotive", 31002, minutes=15.0)
    assert calibration.verdict.fit
    truth = GRADES["automotive"].gyroscope.flicker * np.sqrt(2 * np.log(2) / np.pi)
    assert 0.2 * truth < calibration.quality.variance_components[STILL] < 2.0 * truth


def test_a_rest_that_is_knocked_askew_is_two_poses() -> None:
    """Both parts had one direction and were left out: nothing determined it, and the recording was refused."""
    calibration = soaked("robot", 850008, minutes=15.0, fault="bumped")
    assert calibration.verdict.fit
    assert not calibration.quality.left_out
