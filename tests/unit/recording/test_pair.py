"""Two files with one triad each become one recording, or a sentence."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_blocks, read_recording, read_recordings


@pytest.fixture
def halves(tumbled, csv):
    def write(first: str, second: str, rows=None, other=None, **layout):
        rows = tumbled.rows() if rows is None else rows
        other = rows if other is None else other
        layout = {"header": None, "delimiter": "   ", **layout}
        return [csv(rows[:, :4], name=first, **layout), csv(other[:, [0, 4, 5, 6]], name=second, **layout)]

    return write


@pytest.mark.parametrize(
    ("first", "second"), [("xsens_acc.mat", "xsens_gyro.mat"), ("one.txt", "two.txt"), ("a.txt", "omega.txt")]
)
def test_names_or_content_tell_the_triads_in_either_order(tumbled, halves, first, second) -> None:
    files = halves(first, second)
    for order in (files, files[::-1]):
        recording = read_recording(order)
        assert np.abs(recording.specific_force - tumbled.specific_force).max() < 5.1e-7  # six decimals
        assert np.abs(recording.angular_rate - tumbled.angular_rate).max() < 5.1e-7
        assert len(recording.sources) == 2
        assert sum(len(b) for b in read_blocks(order)) == len(recording)


def test_names_that_the_content_contradicts_are_refused(halves) -> None:
    with pytest.raises(RecordingError, match=r"seem exchanged.* the other way round with --columns\.$"):
        read_recording(halves("gyro.txt", "acc.txt"))


def test_a_pair_is_one_recording_and_other_files_are_one_each(tumbled, halves, csv) -> None:
    assert len(read_recordings(halves("acc.txt", "gyro.txt"))) == 1
    whole = csv(tumbled.rows())
    assert len(read_recordings([whole, whole])) == 2
    with pytest.raises(RecordingError, match="no pair of triads"):
        read_recording([whole, whole])


def test_one_file_of_a_pair_is_one_triad(halves) -> None:
    force, rate = halves("acc.txt", "gyro.txt")
    assert read_recording(force).angular_rate is None
    assert read_recording(rate).specific_force is None


def test_different_lengths_are_refused(tumbled, halves) -> None:
    rows = tumbled.rows()
    with pytest.raises(RecordingError, match=r"acc\.txt has 4050 rows and gyro\.txt has 4040"):
        read_recording(halves("acc.txt", "gyro.txt", rows, rows[:-10]))


def test_different_stamps_are_refused_with_their_place(tumbled, halves) -> None:
    other = tumbled.rows().copy()
    other[300:, 0] += 0.004
    with pytest.raises(RecordingError, match=r"different stamps from line 301 on \(3 and 3\.004\)"):
        read_recording(halves("acc.txt", "gyro.txt", None, other))


def test_the_option_gives_two_lists(tumbled, halves) -> None:
    files = halves("b.txt", "a.txt")
    recording = read_recording(files, columns="t,ax,-ay,az;t,gx,gy,-gz")
    assert np.abs(recording.specific_force[:, 1] + tumbled.specific_force[:, 1]).max() < 5.1e-7
    assert np.abs(recording.angular_rate[:, 2] + tumbled.angular_rate[:, 2]).max() < 5.1e-7
    with pytest.raises(UsageError, match="two lists"):
        read_recording(files, columns="t,ax,ay,az")
