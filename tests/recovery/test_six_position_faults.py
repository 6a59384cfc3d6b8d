"""Six faces on recordings of another simulator: poses that contradict one another, a bump, and none of that."""

from __future__ import annotations

import numpy as np
import pytest

from second_simulator import GRADES
from second_simulator.calibrating import calibrated, played, sigmas_off


@pytest.mark.parametrize(
    ("seed", "grade", "fault"),
    [
        (1000, "tactical", "pose-off"),
        (1003, "industrial", "four-poses-off"),
        (1003, "industrial", "plate-leans"),
        (2300000, "tactical", "plate-leans"),
    ],
)
def test_poses_that_contradict_one_another_are_unfit_and_counted(seed: int, grade: str, fault: str) -> None:
    made = played("six-faces", grade, seed, fault)
    found = calibrated(made, procedure="six-position")
    assert not found.verdict.fit
    assert "beyond the 0.05° that the protocol promises" in found.verdict.reasons[0]
    assert np.max(np.abs(sigmas_off(found, made, "accelerometer.bias"))) < 4.0


def test_poses_that_few_checks_contradict_are_not_fit() -> None:
    found = calibrated(
        played("six-faces", "consumer", 1000, "plate-leans"), procedure="improved-six-position"
    )
    assert not found.verdict.fit


@pytest.mark.parametrize(
    ("seed", "grade", "fault"),
    [(1009, "tactical", "bumped"), *((6100, grade, None) for grade in GRADES), (6101, "hobby", None)],
)
def test_right_recordings_are_fit_and_so_is_one_that_was_bumped(
    seed: int, grade: str, fault: str | None
) -> None:
    """In the bump the gyro's mean over the hold is off by 43 °/h."""
    made = played("six-faces", grade, seed, fault)
    found = calibrated(made, procedure="six-position")
    assert found.verdict.fit
    assert found.frame.name == "fixture"
    for term in ("accelerometer.bias", "gyroscope.bias"):
        assert np.max(np.abs(sigmas_off(found, made, term))) < 4.0
