"""No file makes the readers hang, take the memory, lose rows in silence or end in a traceback."""

from __future__ import annotations

import gzip
import os
import struct
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.errors import OutputError, RecordingError, UsageError
from tumble.recording import read_recording
from tumble.recording.formats import find_format, header_names, packed, read_table
from tumble.recording.reading import read_blocks

HEADER = "t,ax,ay,az,gx,gy,gz\n"


def rows_of(count: int = 2000) -> np.ndarray:
    rng = np.random.default_rng(3)
    force = rng.normal(0.0, 0.02, (count, 3)) + np.array([0.1, -0.2, 9.8])
    return np.column_stack([np.arange(count) / 100.0, force, rng.normal(0.0, 0.002, (count, 3))])


def csv(rows: np.ndarray) -> str:
    return "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in rows.tolist())


GOOD = HEADER + csv(rows_of())


def refused(file: Path, words: str) -> None:
    """Both ways of reading refuse the file in words that match."""
    for read in (read_recording, lambda path: list(read_blocks(path))):
        with pytest.raises(RecordingError, match=words):
            read(file)


# -- text ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("character", ["\x0c", "\x0b", "\x85", "\u2028", "\u2029"])
@pytest.mark.parametrize("where", ["comment", "header"])
def test_what_only_unicode_takes_for_a_line_end_loses_no_row(
    tmp_path: Path, character: str, where: str
) -> None:
    file = tmp_path / "hand.csv"
    text = (
        f"# made{character}by hand\n{GOOD}" if where == "comment" else GOOD.replace("\n", f"{character}\n", 1)
    )
    file.write_bytes(text.encode())
    assert len(read_recording(file).time) == 2000
    assert sum(len(block.time) for block in read_blocks(file)) == 2000


@pytest.mark.parametrize("factor", [1e-300, 1e300, 1.7e308, 1e-320])
@pytest.mark.parametrize("what", [slice(0, 1), slice(1, 7)])
def test_numbers_that_no_sensor_gives_are_refused(tmp_path: Path, factor: float, what: slice) -> None:
    rows = rows_of(300)
    with np.errstate(over="ignore"):
        rows[:, what] *= factor
    file = tmp_path / "hand.csv"
    file.write_text(HEADER + csv(rows))
    refused(file, "no finite number|all zeros|never changes")


def test_one_number_that_no_sensor_gives_is_left_out_and_said(tmp_path: Path) -> None:
    rows = rows_of()
    rows[77, 2] = 1e200
    file = tmp_path / "hand.csv"
    file.write_text(HEADER + csv(rows))
    recording = read_recording(file)
    assert len(recording.time) == 1999
    assert any("1 row(s) without a finite number" in remark.text for remark in recording.remarks)


@pytest.mark.parametrize("rate", [1e300, 1e-300, float("nan"), 0.0, -1.0])
def test_a_rate_that_is_none_is_refused(tmp_path: Path, rate: float) -> None:
    file = tmp_path / "hand.csv"
    file.write_text("ax,ay,az,gx,gy,gz\n" + csv(rows_of()[:, 1:]))
    with pytest.raises(UsageError, match="--rate"):
        read_recording(file, rate=rate)


# -- what is packed --------------------------------------------------------------------------------


def test_a_full_disk_is_not_taken_for_a_file_cut_short(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = pytest.importorskip("zstandard")
    file = tmp_path / "hand.csv.zst"
    file.write_bytes(library.ZstdCompressor().compress(GOOD.encode()))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    original = Path.open

    def opened(path: Path, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        # The device that is always full.
        return original(Path("/dev/full") if mode == "wb" else path, mode, *arguments, **options)

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(OutputError, match=r"could not be unpacked to .*No space left.*TMPDIR"):
        list(packed.read_tables(file))


def test_a_size_that_lies_takes_no_memory(tmp_path: Path) -> None:
    file = tmp_path / "drive.mcap"
    file.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, 1 << 62) + b"abc")
    refused(file, "cut short or damaged|no message")


# -- headers that lie ------------------------------------------------------------------------------


def npy(header: bytes) -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


@pytest.mark.parametrize(
    "header",
    [
        b"{{{",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (%d, 7)}" % 2**70,
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (200000000000, 7)}",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 7)}",
        b"{'descr': 'O', 'fortran_order': False, 'shape': (10, 7)}",
        b"(" * 3000,
        b"",
    ],
)
def test_numpys_headers_that_cannot_be_are_refused(tmp_path: Path, header: bytes) -> None:
    file, archive = tmp_path / "hand.npy", tmp_path / "hand.npz"
    file.write_bytes(npy(header))
    with zipfile.ZipFile(archive, "w") as members:
        members.writestr("imu.npy", npy(header))
    refused(file, "damaged|holds an array")
    refused(archive, "damaged|holds no table")


def test_one_wrong_bit_in_a_gzip_is_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "hand.csv.gz"
    packed = bytearray(gzip.compress(GOOD.encode()))
    for at in range(10, len(packed) - 8, len(packed) // 10):
        damaged = packed.copy()
        damaged[at] ^= 0x10
        file.write_bytes(damaged)
        header_names(file)
        try:
            read_table(file)
        except RecordingError:
            continue


def test_a_name_that_is_no_utf_8_stands_in_the_source_as_numbers(tmp_path: Path) -> None:
    file = Path(os.fsdecode(os.fsencode(tmp_path) + b"/hand\xff.csv"))
    file.write_text(GOOD)
    (source,) = read_recording(file).sources
    assert source.name.encode() == b"hand<U+DCFF>.csv"
    assert find_format(file).name == "text"


def test_matlab_variables_of_every_kind_are_let_pass(tmp_path: Path) -> None:
    import scipy.io
    import scipy.sparse

    cells = np.empty((2, 1), dtype=object)
    cells[0, 0], cells[1, 0] = "text", rows_of(5)
    variables = {
        "imu": rows_of(50),
        "info": {"name": "MPU", "rate": 100.0, "inside": {"x": [1, 2, 3]}, "none": np.zeros((0, 0))},
        "cells": cells,
        "few": scipy.sparse.csc_matrix(np.eye(4)),
        "complex": np.array([1.0 + 2.0j]),
        "whole": np.arange(9, dtype=np.int16),
        "true": np.array([True, False]),
        "words": np.array(["ab", "cd"]),
    }
    file = tmp_path / "hand.mat"
    scipy.io.savemat(file, variables, do_compression=True)
    assert len(read_recording(file).time) == 50


def test_noise_takes_nothing_from_a_pipe_to_guess_the_memory() -> None:
    from tumble.workflows.noise import _numbers_in

    reading, writing = os.pipe()
    try:
        os.write(writing, b"0123456789")
        assert _numbers_in(Path(f"/dev/fd/{reading}")) == 0
        assert os.read(reading, 100) == b"0123456789"
    finally:
        os.close(reading)
        os.close(writing)
