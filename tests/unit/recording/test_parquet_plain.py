"""Parquet as tumble saves it is read by numpy alone; whatever is not so is left to the library, and read alike."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from tumble.errors import RecordingError
from tumble.recording import Recording, read_blocks, read_recording, write_recording
from tumble.recording.formats.header import header_names
from tumble.recording.formats.parquet_plain import UNITS_KEY, Damaged, read_plain

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


def test_what_was_saved_is_read_without_the_library(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_recording(recording, tmp_path / "a.parquet")
    monkeypatch.setitem(sys.modules, "polars", None)  # any import of it fails
    back = read_recording(path)
    assert np.array_equal(back.time, recording.time)
    assert np.array_equal(back.specific_force, recording.specific_force)
    assert np.array_equal(back.angular_rate, recording.angular_rate)
    assert back.sources[0].sha256
    assert header_names(path) == list(DATA)


def test_several_row_groups_and_pages_are_read(recording: Recording, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.parquet", data_page_size=10_000)
    plain = read_plain(path)
    assert plain is not None
    assert len(plain[0].groups) > 3
    assert np.array_equal(plain[1][3], DATA["az"])
    assert np.array_equal(read_recording(path).angular_rate, recording.angular_rate)


@pytest.mark.parametrize(
    "changed",
    [
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
def test_what_is_not_plain_is_left_to_the_library(recording: Recording, tmp_path: Path, changed: Any) -> None:
    path = saved(tmp_path / "a.parquet", **changed)
    assert read_plain(path) is None
    assert np.array_equal(read_recording(path).angular_rate, recording.angular_rate)


def test_missing_values_are_left_to_the_library(tmp_path: Path) -> None:
    hole = pl.Series("ax", DATA["ax"]).scatter(5, None)
    path = saved(tmp_path / "a.parquet", data={"ax": hole})
    assert read_plain(path) is None
    assert len(read_recording(path)) == COUNT - 1


def test_files_of_others_are_left_to_the_library(tmp_path: Path) -> None:
    pl.DataFrame(DATA).write_parquet(tmp_path / "a.parquet", compression="uncompressed")
    assert read_plain(tmp_path / "a.parquet") is None


def test_damage_is_found_or_left_to_the_library(recording: Recording, tmp_path: Path) -> None:
    """Bytes turned over in the footer and in the heads of pages: no other error than that of damage."""
    raw = saved(tmp_path / "a.parquet", row_group_size=COUNT).read_bytes()
    path = tmp_path / "b.parquet"
    rng = np.random.default_rng(7)
    found = 0
    for at in (*rng.integers(len(raw) - 2500, len(raw), 60), *range(4, 40, 3)):
        path.write_bytes(raw[:at] + bytes([raw[at] ^ 0x55]) + raw[at + 1 :])
        try:
            read_plain(path)
        except Damaged:
            found += 1
    assert found > 5


def test_a_file_that_is_cut_anywhere_is_refused(tmp_path: Path) -> None:
    raw = saved(tmp_path / "a.parquet").read_bytes()
    path = tmp_path / "b.parquet"
    for stop in (5, 100, len(raw) // 2, len(raw) - 1):
        path.write_bytes(raw[:stop])
        with pytest.raises(RecordingError, match="is a damaged Parquet file"):
            read_recording(path)
        with pytest.raises(RecordingError, match="is a damaged Parquet file"):
            list(read_blocks(path))
