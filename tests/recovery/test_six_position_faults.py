"""The six-position test on recordings of another simulator: poses that contradict one another, and a bump."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES


def calibrated(
    seed: int, grade: str, fault: str | None, folder: Path, name: str = "six-position"
) -> dict[str, Any]:
    made = PROCEDURES["six-faces"](GRADES[grade], np.random.default_rng(seed), fault)
    protocol = folder / "protocol.yaml"
    protocol.write_text(made.protocol, encoding="utf-8")
    found = tumble.calibrate(pl.DataFrame(made.columns()), protocol=protocol, procedure=name)
    return found.calibration.model_dump()


def test_one_pose_off_is_named_with_the_one_that_nothing_tells_from_it(tmp_path: Path) -> None:
    made = PROCEDURES["six-faces"](GRADES["tactical"], np.random.default_rng(1000), "pose-off")
    document = calibrated(1000, "tactical", "pose-off", tmp_path)
    said = next(reason for reason in document["verdict"]["reasons"] if "is off by about" in reason)
    axis = said.removeprefix("The pose of ")[0]
    assert f"{axis} up or that of {axis} down" in said
    assert document["verdict"]["fit"]
    truth = made.truth.terms("fixture")
    names = document["covariance_parameters"]
    for k in range(3):
        at = names.index(f"accelerometer.bias[{k}]")
        off = document["accelerometer"]["bias"][k] - truth["accelerometer.bias"][k]
        assert abs(off) < 4.0 * np.sqrt(document["covariance"][at][at])


@pytest.mark.parametrize("fault", ["four-poses-off", "plate-leans"])
def test_a_placement_twenty_times_what_was_stated_is_not_fit(fault: str, tmp_path: Path) -> None:
    document = calibrated(1003, "industrial", fault, tmp_path)
    assert not document["verdict"]["fit"]
    assert "contradict one another" in document["verdict"]["reasons"][0]


def test_a_unit_that_is_bumped_in_a_hold_is_not_fit(tmp_path: Path) -> None:
    """The gyro's mean over that hold is off by 43 °/h: its bias was 8 sigmas off."""
    document = calibrated(1009, "tactical", "bumped", tmp_path)
    assert not document["verdict"]["fit"]
    assert "moved while it was held" in document["verdict"]["reasons"][0]


def test_the_improved_test_does_not_go_by_a_pose_that_few_checks_contradict(tmp_path: Path) -> None:
    assert not calibrated(1000, "consumer", "plate-leans", tmp_path, "improved-six-position")["verdict"][
        "fit"
    ]


@pytest.mark.parametrize("grade", [name for name in GRADES if name != "hobby"])
def test_right_recordings_are_fit(grade: str, tmp_path: Path) -> None:
    for seed in range(6100, 6104):
        assert calibrated(seed, grade, None, tmp_path)["verdict"]["fit"]


def test_axes_that_lean_by_degrees_are_too_much_for_a_test_without_them(tmp_path: Path) -> None:
    """The test leaves misalignments in: gravity is missed by 35 mm/s², which is what the verdict is for."""
    document = calibrated(6101, "hobby", None, tmp_path)
    assert not document["verdict"]["fit"]
    assert "does not describe these holds" in document["verdict"]["reasons"][0]
