"""Predicted errors: in every column the worst pose is no better than the mean over the poses."""

from __future__ import annotations

from pathlib import Path

from tumble.document import read_calibration
from tumble.document.predictions import answers
from tumble.simulation import find_grade

CALIBRATION = Path(__file__).resolve().parents[2] / "reference" / "drive_rtk" / "calibration.json"


def test_the_worst_pose_is_the_worst_of_each_column() -> None:
    every = answers(read_calibration(CALIBRATION), grade=find_grade("consumer-mems"))
    at_rest = [a for a in every if a.kind == "position"]
    assert at_rest
    for mean, worst in zip(at_rest[::2], at_rest[1::2], strict=True):
        assert "rms" in mean.question
        assert "worst" in worst.question
        assert worst.after >= mean.after
        assert mean.before is not None
        assert worst.before is not None
        assert worst.before >= mean.before
        assert mean.sheet is not None
        assert worst.sheet is not None
        assert worst.sheet >= mean.sheet
