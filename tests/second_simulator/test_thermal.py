"""Soak tests of another hand: what is too little for a model is not fit, and biases are never stated as still."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES
from tumble.document import Calibration

STILL = "gyro bias, flicker floor of the Allan deviation, rad/s"


def calibrated(folder: Path, grade: str, seed: int, minutes: float, fault: str | None = None) -> Calibration:
    made = partial(PROCEDURES["thermal-soak"], minutes=minutes)(
        GRADES[grade], np.random.default_rng(seed), fault
    )
    file = folder / "protocol.yaml"
    file.write_text(made.protocol, encoding="utf-8")
    return tumble.calibrate(pl.DataFrame(made.columns()), protocol=file, rate="10±0.0005").calibration


@pytest.mark.parametrize("seed", [31007, 31002])
def test_soaks_too_short_to_be_left_out_one_by_one_are_not_fit(tmp_path: Path, seed: int) -> None:
    """Most rests have not settled. A straight line was taken, and biases were off by up to 38 of their sigmas."""
    calibration = calibrated(tmp_path, "tactical", seed, minutes=6.0)
    assert not calibration.verdict.fit
    assert any(
        "Without one soak the other rests do not determine" in said for said in calibration.verdict.reasons
    )


def test_biases_that_look_still_by_chance_are_not_stated_as_still(tmp_path: Path) -> None:
    """The likelihood of the wander is largest at none; gyro biases were off by 5.8 of the sigmas that follow."""
    calibration = calibrated(tmp_path, "automotive", 31002, minutes=15.0)
    assert calibration.verdict.fit
    truth = GRADES["automotive"].gyroscope.flicker * np.sqrt(2 * np.log(2) / np.pi)
    assert 0.2 * truth < calibration.quality.variance_components[STILL] < 2.0 * truth


def test_a_rest_that_is_knocked_askew_is_two_poses(tmp_path: Path) -> None:
    """Both parts had one direction and were left out: nothing determined it, and the recording was refused."""
    calibration = calibrated(tmp_path, "robot", 850008, minutes=15.0, fault="bumped")
    assert calibration.verdict.fit
    assert not calibration.quality.left_out
