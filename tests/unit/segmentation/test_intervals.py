"""Holds that the user gives: the file's layout and what is refused, with the line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tumble.errors import SegmentationError
from tumble.recording.recording import Recording
from tumble.segmentation import find_timeline, read_intervals


@pytest.fixture
def recording() -> Recording:
    rng = np.random.default_rng(8)
    return Recording(
        time=10.0 + np.arange(1000) / 50.0,
        specific_force=np.array([0.0, 0.0, 9.8]) + 0.01 * rng.standard_normal((1000, 3)),
        angular_rate=0.001 * rng.standard_normal((1000, 3)),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=50.0,
    )


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "holds.txt"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "text",
    [
        "11 13\n15 18.5\n",
        "start,stop\n11,13\n15,18.5",
        "# holds\n\n11;13;\n 15\t18.5 \n",
        "11, 13\n15, 18.5\n",
    ],
)
def test_two_columns_of_any_usual_layout_are_read(tmp_path: Path, text: str) -> None:
    assert read_intervals(written(tmp_path, text)) == [(11.0, 13.0), (15.0, 18.5)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("11 13\n12 14\n", "line 2: the interval starts at 12 s"),
        ("11 13\n14 x\n", "line 2: '14 x' is not two numbers"),
        ("11 13\nstart stop\n", "line 2: 'start stop' is not two numbers"),
        ("11 13 15\n", "line 1: '11 13 15' is not two numbers"),
        ("13 11\n", "line 1: the interval ends at 11 s, not after 13 s"),
        ("11 nan\n", "line 1: '11 nan' is not two numbers"),
        ("# nothing\n", "holds no intervals"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(SegmentationError, match=message):
        read_intervals(written(tmp_path, text))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SegmentationError, match="There is no list of intervals"):
        read_intervals(tmp_path / "none.txt")


def test_intervals_replace_the_search(recording: Recording) -> None:
    timeline = find_timeline(recording, intervals=[(11.0, 13.0), (15.0, 18.5)])
    # stamps are 10.00, 10.02, ...: the first at or after 11 s is number 50
    assert [(h.start, h.stop) for h in timeline.holds] == [(50, 150), (250, 425)]
    assert [(t.start, t.stop) for t in timeline.turns] == [(150, 250)]


@pytest.mark.parametrize(
    ("intervals", "message"),
    [
        ([(11.0, 13.0), (12.5, 14.0)], "Interval 2 .* overlaps"),
        ([(5.0, 13.0)], "beyond the recording, which goes from 10 to 29.98 s"),
        ([(11.0, 40.0)], "beyond the recording"),
        ([(13.0, 12.0)], "stops before it starts"),
        ([(11.0, 11.01)], "1 samples"),
        ([], "No intervals were given"),
    ],
)
def test_wrong_intervals_are_refused(
    recording: Recording, intervals: list[tuple[float, float]], message: str
) -> None:
    with pytest.raises(SegmentationError, match=message):
        find_timeline(recording, intervals=intervals)
