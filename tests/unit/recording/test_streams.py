"""Two files or two arrays with one triad each become one recording on the gyro's stamps, or a sentence."""

import numpy as np
import pytest
import scipy.io
from tests.unit.recording.by_hand import ROUNDED, said

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_blocks, read_recording, read_recordings


@pytest.fixture
def halves(tumbled, csv):
    def write(first: str, second: str, other=None):
        rows = tumbled.rows()
        layout = {"header": None, "delimiter": "   "}
        second_rows = (rows if other is None else other)[:, [0, 4, 5, 6]]
        return [csv(rows[:, :4], name=first, **layout), csv(second_rows, name=second, **layout)]

    return write


@pytest.mark.parametrize(
    ("first", "second"), [("xsens_acc.mat", "xsens_gyro.mat"), ("one.txt", "two.txt"), ("a.txt", "omega.txt")]
)
def test_names_or_content_tell_the_triads_in_either_order(tumbled, halves, first, second) -> None:
    files = halves(first, second)
    for order in (files, files[::-1]):
        recording = read_recording(order)
        assert tumbled.seen_in(recording)
        assert len(recording.sources) == 2
        assert sum(len(b) for b in read_blocks(order)) == len(recording)
    assert len(read_recordings(files)) == 1


def test_what_is_no_pair_is_refused(tumbled, halves, csv) -> None:
    whole, late = csv(tumbled.rows()), tumbled.rows()
    late[300:, 0] += 0.004
    assert len(read_recordings([whole, whole])) == 2
    for files, words in (
        ([whole, whole], "no pair of triads"),
        (halves("gyro.txt", "acc.txt"), r"seem exchanged.* the other way round with --columns\.$"),
        (halves("1_acc.txt", "gyr.txt", late[:-10]), r"1_acc\.txt has 4050 rows and gyr\.txt has 4040"),
        (halves("a.txt", "omega.txt", late), r"different stamps from line 301 on \(3 and 3\.004\)"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_recording(files)


def test_the_option_gives_two_lists(tumbled, halves) -> None:
    alone = [read_recording(file) for file in halves("acc.txt", "gyro.txt")]
    assert (alone[0].angular_rate, alone[1].specific_force) == (None, None)
    files = halves("b.txt", "a.txt")
    recording = read_recording(files, columns="t,ax,-ay,az;t,gx,gy,-gz")
    assert np.abs(recording.specific_force[:, 1] + tumbled.specific_force[:, 1]).max() < ROUNDED
    assert np.abs(recording.angular_rate[:, 2] + tumbled.angular_rate[:, 2]).max() < ROUNDED
    with pytest.raises(UsageError, match="two lists"):
        read_recording(files, columns="t,ax,ay,az")


@pytest.fixture
def arrays(tumbled, tmp_path):
    """A file of two arrays with a stamp column each, of which some rows are kept."""

    def write(*, late=0.0, force=slice(None), rate=slice(None), last=False, tall=True):
        made = {
            "acc": np.column_stack([tumbled.time, tumbled.specific_force])[force],
            "gyro": np.column_stack([tumbled.time + late, tumbled.angular_rate])[rate],
        }
        made = {name: np.roll(a, -1, axis=1) if last else a for name, a in made.items()}
        path = tmp_path / "pair.mat"
        scipy.io.savemat(path, {"data": {name: a if tall else a.T for name, a in made.items()}})
        return path

    return write


@pytest.mark.parametrize("layout", [{}, {"last": True}, {"tall": False}, {"force": slice(-100)}])
def test_two_arrays_with_stamps_of_their_own_are_one_recording(tumbled, arrays, layout) -> None:
    recording = read_recording(arrays(**layout))
    count = len(tumbled.time) - 100 * ("force" in layout)
    assert recording.rate == pytest.approx(100.0)
    assert np.array_equal(recording.specific_force, tumbled.specific_force[:count])
    assert np.array_equal(recording.angular_rate, tumbled.angular_rate[:count])


def test_other_stamps_are_brought_together_and_not_over_a_gap(tumbled, arrays) -> None:
    """Nothing is extrapolated either: no rate before the first force or after the last."""
    keep = (tumbled.time < 1.0) | (tumbled.time > 2.0)
    between = 0.5 * (tumbled.specific_force[1:] + tumbled.specific_force[:-1])
    for late, rows in ((0.005, slice(-1)), (-0.005, slice(1, None))):
        whole, cut = (read_recording(arrays(late=late, force=part)) for part in (slice(None), keep))
        assert np.allclose(whole.specific_force, between, rtol=0, atol=1e-12)
        assert np.array_equal(whole.angular_rate, tumbled.angular_rate[rows])
        assert "interpolated at the gyro's stamps" in said(whole, "mended")
        assert not np.any((cut.time > 1.0) & (cut.time < 2.0))
        assert len(cut) == len(whole) - 102
        assert "gap" in said(cut)


def test_streams_that_step_back_or_share_no_time_are_refused(arrays) -> None:
    back = np.r_[0:100, 98, 101:4050]
    for made, words in (({"force": back}, "step back from"), ({"late": 1000.0}, "no time in common")):
        with pytest.raises(RecordingError, match=words):
            read_recording(arrays(**made))
