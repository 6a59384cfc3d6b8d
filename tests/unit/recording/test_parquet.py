"""Parquet as tumble saves it and as others do: the same numbers, and units as they were judged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from tumble.errors import RecordingError
from tumble.recording import Recording, read_blocks, read_recording
from tumble.recording.formats import header_names
from tumble.recording.formats.frames import UNITS_KEY

COUNT = 12_000
RNG = np.random.default_rng(3)
DATA = {"t": np.arange(COUNT) / 200.0}
DATA |= {
    f"a{a}": level + 0.02 * RNG.normal(size=COUNT) for a, level in zip("xyz", (0.1, -0.3, 9.8), strict=True)
}
DATA |= {f"g{a}": 0.01 * RNG.normal(size=COUNT) for a in "xyz"}
UNITS = {"t": "s"} | {f"a{a}": "m/s^2" for a in "xyz"} | {f"g{a}": "rad/s" for a in "xyz"}


@pytest.fixture(scope="module")
def recording() -> Recording:
    return read_recording(pl.DataFrame(DATA), units="m/s^2,rad/s")


def saved(path: Path, **changed: Any) -> Path:
    """A file with tumble's note of units, written by polars with other options or columns."""
    options = {"compression": "uncompressed", "row_group_size": 3000} | changed
    frame = pl.DataFrame(DATA | options.pop("data", {}))
    frame.write_parquet(path, metadata={UNITS_KEY: json.dumps(UNITS)}, **options)
    return path


@pytest.mark.parametrize(
    "changed",
    [
        {"data_page_size": 10_000},
        {"compression": "lz4"},
        {"compression": "zstd"},
        {"data": {"ax": DATA["ax"].astype(np.float32)}},
        {"data": {"corrected_by_0123456789ab": np.ones(COUNT, np.int8)}},
        {"statistics": False},
    ],
    ids=lambda changed: (
        next(iter(changed.values())) if "data" not in changed else next(iter(changed["data"]))
    ),
)
def test_any_pages_and_types_hold_the_same_numbers(
    recording: Recording, tmp_path: Path, changed: Any
) -> None:
    path = saved(tmp_path / "a.parquet", **changed)
    assert np.array_equal(read_recording(path).angular_rate, recording.angular_rate)
    assert header_names(path)[: len(DATA)] == list(DATA)


def test_a_row_with_a_missing_value_is_left_out(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.parquet", data={"ax": pl.Series("ax", DATA["ax"]).scatter(5, None)})
    assert len(read_recording(path)) == COUNT - 1


@pytest.mark.parametrize("note", ["[1]", "{", "[" * 100_000])
def test_a_note_that_is_none_is_passed_over(tmp_path: Path, note: str) -> None:
    pl.DataFrame(DATA).write_parquet(tmp_path / "a.parquet", metadata={UNITS_KEY: note})
    assert len(read_recording(tmp_path / "a.parquet")) == COUNT


def test_a_file_that_is_cut_anywhere_is_refused(tmp_path: Path) -> None:
    raw = saved(tmp_path / "a.parquet").read_bytes()
    path = tmp_path / "b.parquet"
    for stop in (5, 100, len(raw) // 2, len(raw) - 1):
        path.write_bytes(raw[:stop])
        with pytest.raises(RecordingError, match="is a damaged Parquet file"):
            read_recording(path)
        with pytest.raises(RecordingError, match="is a damaged Parquet file"):
            list(read_blocks(path))
        assert header_names(path) == []
