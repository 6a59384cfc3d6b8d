"""Arrays of one file with a stamp column each: the stamps are no axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from tumble.recording import Recording, read_recording


def written(tumbled, folder: Path, *, late: float = 0.0, cut: int = 0, last: bool = False, tall: bool = True):
    count = len(tumbled.time) - cut
    force = np.column_stack([tumbled.time, tumbled.specific_force])[:count]
    rate = np.column_stack([tumbled.time + late, tumbled.angular_rate])
    arrays = {"acc": force, "gyro": rate}
    arrays = {name: np.roll(a, -1, axis=1) if last else a for name, a in arrays.items()}
    path = folder / "pair.mat"
    scipy.io.savemat(path, {"data": {name: a if tall else a.T for name, a in arrays.items()}})
    return path


def same(recording: Recording, tumbled) -> bool:
    count = len(recording)
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    return np.allclose(recording.specific_force, tumbled.specific_force[:count]) and np.allclose(
        recording.angular_rate, tumbled.angular_rate[:count]
    )


@pytest.mark.parametrize("layout", [{}, {"last": True}, {"tall": False}, {"cut": 100}])
def test_two_arrays_with_stamps_of_their_own_are_one_recording(tumbled, tmp_path, layout) -> None:
    recording = read_recording(written(tumbled, tmp_path, **layout))
    assert len(recording) == len(tumbled.time) - layout.get("cut", 0)
    assert recording.rate == pytest.approx(100.0)
    assert same(recording, tumbled)


def test_other_stamps_are_brought_together(tumbled, tmp_path) -> None:
    recording = read_recording(written(tumbled, tmp_path, late=0.005))
    assert recording.specific_force is not None
    between = 0.5 * (tumbled.specific_force[1:] + tumbled.specific_force[:-1])
    assert np.allclose(recording.specific_force, between)
    assert np.allclose(recording.angular_rate, tumbled.angular_rate[:-1])
    assert any("interpolated at the gyro's stamps" in remark.text for remark in recording.remarks)
