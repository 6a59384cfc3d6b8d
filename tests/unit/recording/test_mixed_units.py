"""A unit that changes on the way is refused, a triad that nothing was made of is named."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from tumble.errors import RecordingError
from tumble.recording import read_recording
from tumble.units import STANDARD_GRAVITY

COUNT, RATE = 6000, 100.0


def tumbled(rng: np.random.Generator) -> np.ndarray:
    """Specific force in m/s² of a unit in twelve poses, its biases those of a consumer unit."""
    poses = rng.normal(size=(12, 3))
    poses *= STANDARD_GRAVITY / np.linalg.norm(poses, axis=1, keepdims=True)
    force = np.repeat(poses, COUNT // 12, axis=0) + np.array([0.3, -0.4, 0.2])
    return force + 0.02 * rng.normal(size=force.shape)


def frame(force: np.ndarray, **more: np.ndarray) -> pl.DataFrame:
    columns = {f"a{axis}": force[:, i] for i, axis in enumerate("xyz")}
    return pl.DataFrame({"t": np.arange(COUNT) / RATE, **columns, **more})


@pytest.mark.parametrize("share", [0.15, 0.5, 0.9])
@pytest.mark.parametrize("factor", [1.0 / STANDARD_GRAVITY, 1000.0 / STANDARD_GRAVITY])
def test_a_change_of_unit_on_the_way_is_refused_with_both_levels(share: float, factor: float) -> None:
    force = tumbled(np.random.default_rng(3))
    force[int(share * COUNT) :] *= factor
    with pytest.raises(RecordingError, match="the unit changes within the file"):
        read_recording(frame(force))


@pytest.mark.parametrize("seed", range(20))
def test_a_recording_in_one_unit_is_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    force = tumbled(rng)
    # shaken by hand for a third of the time
    force[2000:4000] *= 1.0 + 0.5 * rng.normal(size=(2000, 1))
    assert read_recording(frame(force)).specific_force_unit == "m/s^2"


def test_columns_of_which_nothing_was_made_are_named_where_a_triad_is_missing() -> None:
    force = tumbled(np.random.default_rng(3))
    got = read_recording(frame(force, gx_rps=force[:, 0], gy_rps=force[:, 1], gz_rps=force[:, 2]))
    assert any("no gyro was recognised" in r.text and "'gx_rps'" in r.text for r in got.remarks)
