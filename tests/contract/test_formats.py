"""What every file format has to do: recognise its own, read the numbers exactly, refuse the damaged."""

import contextlib
import gzip
import hashlib
import json
import os
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contract.test_flight_logs import FMT, described, write_ulog
from tumble.errors import OutputError, RecordingError
from tumble.recording import FORMATS, find_format, header_names, read_blocks, read_recording, read_table

NAMES = ("t", "ax", "ay", "az", "gx", "gy", "gz")


@cache
def example() -> np.ndarray:
    """Rest in one pose with noise: 1,200 rows of numbers that are no round decimals.

    They are numbers of float32, which is what logs hold, at stamps of whole microseconds.
    """
    rng = np.random.default_rng(17)
    force = np.array([1.0, -2.0, 9.55]) + 0.02 * rng.normal(size=(1200, 3))
    rate = np.array([0.01, -0.02, 0.03]) + 0.001 * rng.normal(size=(1200, 3))
    numbers = np.hstack([force, rate]).astype(np.float32).astype(np.float64)
    return np.column_stack([np.arange(1, 1201) / 64, numbers])


def write_csv(path: Path, rows: np.ndarray) -> None:
    path.write_text(",".join(NAMES) + "\n" + "\n".join(",".join(map(repr, r)) for r in rows.tolist()) + "\n")


def write_spaces(path: Path, rows: np.ndarray) -> None:
    np.savetxt(path, rows, fmt="%25.16e", delimiter="  ")


def write_labels(path: Path, rows: np.ndarray) -> None:
    cells = [" ".join(f"{n}:{v!r}" for n, v in zip(NAMES, row, strict=True)) for row in rows.tolist()]
    path.write_text("\n".join(cells) + "\n")


def write_json_lines(path: Path, rows: np.ndarray) -> None:
    lines = [json.dumps({"t": r[0], "accel": r[1:4], "gyro": r[4:]}) for r in rows.tolist()]
    path.write_text("\n".join(lines) + "\n")


def write_parquet(path: Path, rows: np.ndarray) -> None:
    import polars as pl

    pl.DataFrame({n: rows[:, i] for i, n in enumerate(NAMES)}).write_parquet(path)


def write_npy(path: Path, rows: np.ndarray) -> None:
    with path.open("wb") as file:
        np.save(file, rows)


def write_structured_npy(path: Path, rows: np.ndarray) -> None:
    with path.open("wb") as file:
        np.save(file, np.array([tuple(r) for r in rows], dtype=[(n, "f8") for n in NAMES]))


def write_npz(path: Path, rows: np.ndarray) -> None:
    with path.open("wb") as file:
        np.savez(file, t=rows[:, 0], acc=rows[:, 1:4], gyr=rows[:, 4:])


def write_matlab(path: Path, rows: np.ndarray) -> None:
    from scipy.io import savemat

    with path.open("wb") as file:
        columns = {"time": rows[:, :1], "accel": rows[:, 1:4].T.copy(), "gyro": rows[:, 4:]}
        savemat(file, columns, do_compression=True)


def write_matlab_struct(path: Path, rows: np.ndarray) -> None:
    from scipy.io import savemat

    with path.open("wb") as file:
        savemat(file, {"imu": {"t": rows[:, 0], "acc": rows[:, 1:4], "gyr": rows[:, 4:]}})


def ros_messages(store: str, rows: np.ndarray) -> Iterator[tuple[str, int, Any, str]]:
    """The messages of bags; without `rosbags` they are passed over."""
    from tests.contract import ros

    for t, *row in rows.tolist():
        made = ros.message(getattr(ros, store), t, np.array(row[:3]), np.array(row[3:]))
        yield "/imu", round(t * 1e9), made, ros.IMU


def write_rosbag1(path: Path, rows: np.ndarray) -> None:
    from tests.contract.ros import write_ros1

    write_ros1(path, ros_messages("STORE1", rows))


def write_rosbag2(path: Path, rows: np.ndarray, storage: str = "SQLITE3") -> None:
    from tests.contract.ros import write_ros2

    folder = write_ros2(path.with_name("bag"), ros_messages("STORE", rows), storage)
    (database,) = [*folder.glob("*.db3"), *folder.glob("*.mcap")]
    database.rename(path)


def write_px4(path: Path, rows: np.ndarray) -> None:
    fields = "float[3] gyro_rad;uint32_t gyro_integral_dt;"
    fields += "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    made = [(round(t * 1e6), *row[3:], 15625, 0, *row[:3]) for t, *row in rows.tolist()]
    write_ulog(path, ("sensor_combined", 0, fields, "3fIi3f", made))


def write_ardupilot(path: Path, rows: np.ndarray) -> None:
    parts = [FMT, described(9, 36, b"IMU", b"QBffffff", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")]
    for t, *row in rows.tolist():
        parts.append(b"\xa3\x95\x09" + struct.pack("<QB6f", round(t * 1e6), 0, *row[3:], *row[:3]))
    path.write_bytes(b"".join(parts))


def write_xsens(path: Path, rows: np.ndarray) -> None:
    names = "PacketCounter\tSampleTimeFine\tYear\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\n"
    lines = [
        f"{k}\t{k * 15625 + 15625}\t\t" + "\t".join(map(repr, r[1:])) for k, r in enumerate(rows.tolist())
    ]
    path.write_text("// Coordinate system: ENU\n" + names + "\n".join(lines) + "\n")


def write_zip(path: Path, rows: np.ndarray) -> None:
    write_csv(path.with_name("a.csv"), rows)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.write(path.with_name("a.csv"), "a.csv")


def write_compressed(path: Path, rows: np.ndarray) -> None:
    write_npy(path, rows)
    path.write_bytes(gzip.compress(path.read_bytes()))


MEMBERS = {
    "CSV": ("text", write_csv),
    "spaces": ("text", write_spaces),
    "labels": ("labelled lines", write_labels),
    "JSON lines": ("labelled lines", write_json_lines),
    "Parquet": ("Parquet", write_parquet),
    "NPY": ("NPY", write_npy),
    "NPY with names": ("NPY", write_structured_npy),
    "NPZ": ("NPZ", write_npz),
    "MATLAB 5 to 7": ("MATLAB", write_matlab),
    "MATLAB struct": ("MATLAB", write_matlab_struct),
    "ROS 1 bag": ("ROS 1 bag", write_rosbag1),
    "ROS 2 bag": ("ROS 2 bag", write_rosbag2),
    "MCAP": ("MCAP", partial(write_rosbag2, storage="MCAP")),
    "ULog": ("ULog", write_px4),
    "DataFlash": ("DataFlash", write_ardupilot),
    "Xsens": ("Xsens text", write_xsens),
    "zip": ("zip", write_zip),
    "NPY compressed": ("compressed", write_compressed),
}


@pytest.fixture(params=MEMBERS.values(), ids=MEMBERS.keys())
def member(request: pytest.FixtureRequest, tmp_path: Path):
    """The format's name and a file of it whose name says nothing of the format."""
    name, write = request.param
    path = tmp_path / "recording.data"
    path.write_bytes(written(write))
    return name, path


@cache
def written(write: Callable[[Path, np.ndarray], None]) -> bytes:
    """What a writer makes of the example: made once, for libraries of other formats take their time."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.data"
        write(path, example())
        return path.read_bytes()


def test_the_content_tells_the_format_and_the_numbers_are_read_bit_by_bit_whole_or_in_blocks(member) -> None:
    name, path = member
    assert find_format(path).name == name
    recording = read_recording(path, units="m/s^2,rad/s")
    assert np.array_equal(
        np.column_stack([recording.specific_force, recording.angular_rate]), example()[:, 1:]
    )
    # Microseconds times 1e-6 are not the nearest number to the quotient.
    np.testing.assert_allclose(recording.time, example()[:, 0], rtol=3e-16)
    (source,) = recording.sources
    assert (source.name, source.sha256) == (path.name, hashlib.sha256(path.read_bytes()).hexdigest())
    blocks = list(read_blocks(path, units="m/s^2,rad/s"))
    assert np.array_equal(np.vstack([b.specific_force for b in blocks]), example()[:, 1:4])
    np.testing.assert_allclose(np.concatenate([b.time for b in blocks]), example()[:, 0], rtol=3e-16)
    # Rows are named from one; text counts lines, with comment and header.
    assert read_table(path).place(4) in ("row 5", "line 5", "line 6", "line 7")


@pytest.mark.parametrize("share", [0.3, 0.7, 0.97])
def test_a_file_that_is_cut_short_is_refused_or_said(member, share) -> None:
    """No traceback; what is read of it was there. A database has later rows on earlier pages too."""
    _, path = member
    raw = path.read_bytes()
    path.write_bytes(raw[: int(share * len(raw)) - 7])  # never at a line's end
    try:
        recording = read_recording(path, units="m/s^2,rad/s")
    except RecordingError:
        with pytest.raises(RecordingError, match=r"\A[^\n]+\Z"):
            read_recording(path, units="m/s^2,rad/s")
        return
    count = len(recording)
    assert count <= 1200  # all of them where only an index is cut off
    assert any(r.kind == "mended" for r in recording.remarks)
    whole = example()
    there = np.searchsorted(whole[:, 0], recording.time - 1e-6)
    assert np.array_equal(there, np.arange(count)) or raw.startswith(b"SQLite")
    assert np.array_equal(recording.angular_rate, whole[there, 4:])


def test_damaged_bytes_are_refused_in_one_sentence(member) -> None:
    _, path = member
    raw = bytearray(path.read_bytes())
    raw[64:] = np.random.default_rng(9).bytes(len(raw) - 64)
    path.write_bytes(bytes(raw))
    with pytest.raises(RecordingError, match=r"\A[^\n]+\Z"):
        read_recording(path, units="m/s^2,rad/s")


def test_every_format_is_in_the_list_and_documented() -> None:
    names = {f.name for f in FORMATS}
    assert {name for name, _ in MEMBERS.values()} == names - {"folder"}  # which is no file
    page = (Path(__file__).resolve().parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    assert not [name for name in names if name not in page]


# -- arrays ------------------------------------------------------------------------------------------


def test_arrays_are_known_by_their_names_and_a_rate_beside_them_is_used(tmp_path: Path) -> None:
    """Rates at rest could be anything by their numbers."""
    rows, path = example(), tmp_path / "a.npz"
    np.savez(path, acc=rows[:, 1:4], gyr=rows[:, 4:], fs=128.0)
    recording = read_recording(path, units="m/s^2,rad/s")
    assert (recording.rate, recording.time[128]) == (128.0, 1.0)
    np.savez(path, gyr=rows[:, 4:])
    recording = read_recording(path, units="rad/s", rate=64.0)
    assert recording.specific_force is None
    assert np.array_equal(recording.angular_rate, rows[:, 4:])


@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_arrays_of_another_length_are_the_magnetometer_s_if_named_so(tmp_path: Path, unit: float) -> None:
    rows, slow = example(), example()[::4, 0] + 0.001
    field = np.array([18.0, -4.0, -43.0]) + 0.3 * np.random.default_rng(6).normal(size=(slow.size, 3))
    stamps = {"t": unit * rows[:, 0], "t_mag": unit * slow}
    np.savez(tmp_path / "a.npz", acc=rows[:, 1:4], gyr=rows[:, 4:], mag=field, **stamps)
    read = read_recording(tmp_path / "a.npz", units="m/s^2,rad/s").magnetic_field
    assert read.unit == "uT"
    assert np.array_equal(read.values, field)
    np.testing.assert_allclose(read.time, slow, rtol=1e-9)


def test_matlab_variables_of_every_kind_are_let_pass(tmp_path: Path) -> None:
    from scipy.io import savemat
    from scipy.sparse import csc_matrix

    cells = np.empty((2, 1), dtype=object)
    cells[0, 0], cells[1, 0] = "text", example()[:5]
    variables = {
        "imu": example(),
        "info": {"name": "MPU", "rate": 100.0, "inside": {"x": [1, 2, 3]}, "none": np.zeros((0, 0))},
        "cells": cells,
        "few": csc_matrix(np.eye(4)),
        "complex": np.array([1.0 + 2.0j]),
        "whole": np.arange(9, dtype=np.int16),
        "true": np.array([True, False]),
        "words": np.array(["ab", "cd"]),
    }
    savemat(tmp_path / "hand.mat", variables, do_compression=True)
    assert len(read_recording(tmp_path / "hand.mat").time) == 1200


def npy(header: bytes) -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


def test_numpys_headers_that_cannot_be_and_arrays_that_are_no_table_are_refused(tmp_path: Path) -> None:
    shaped = b"{'descr': '%s', 'fortran_order': False, 'shape': %s}"
    contents = [b"{{{", b"(" * 3000, b"", shaped % (b"O", b"(10, 7)")]
    contents += [shaped % (b"<f8", s) for s in (b"(%d, 7)" % 2**70, b"(200000000000, 7)", b"(-1, 7)")]
    file, archive = tmp_path / "hand.npy", tmp_path / "hand.npz"
    for header in contents:
        file.write_bytes(npy(header))
        with zipfile.ZipFile(archive, "w") as members:
            members.writestr("imu.npy", npy(header))
        refused(file, "damaged|holds an array")
        refused(archive, "damaged|holds no table")
    for shape in ((5,), (3, 4, 5), ()):
        np.save(file, np.ones(shape))
        refused(file, "array of shape")


# -- files that lie, archives, pieces -----------------------------------------------------------------


def refused(file: Path, words: str) -> None:
    """Both ways of reading refuse the file in words that match."""
    for read in (read_recording, lambda path: list(read_blocks(path))):
        with pytest.raises(RecordingError, match=words):
            read(file)


@pytest.mark.parametrize("head", [b"MATLAB 7.3 MAT-file".ljust(512), b"", bytes(2048)])
def test_hdf5_is_refused_with_what_to_do_instead(tmp_path: Path, head: bytes) -> None:
    """A MATLAB 7.3 file begins with MATLAB's own header and has HDF5 from byte 512 on."""
    (tmp_path / "a.mat").write_bytes(head + b"\x89HDF\r\n\x1a\n" + bytes(5000))
    matlab = r"a MATLAB 7\.3 file, which is not read\..*save -v7`.*"
    what = matlab if b"MATLAB" in head else r"HDF5, which is not read\."
    refused(tmp_path / "a.mat", rf"\Aa\.mat is {what}.*numpy\.savez.* t,ax,ay,az,gx,gy,gz\.\Z")


def test_a_size_that_lies_takes_no_memory(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, 1 << 62) + b"abc")
    refused(tmp_path / "a.mcap", "cut short or damaged|no message")


def test_a_zip_archive_of_something_else_or_of_no_rows_is_refused(tmp_path: Path) -> None:
    write_parquet(tmp_path / "a.parquet", example()[:0])
    (tmp_path / "letter.txt").write_text("Dear all")
    for name, words in (("letter.txt", "letter"), ("a.parquet", "no rows")):
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.write(tmp_path / name, name)
        refused(tmp_path / "a.zip", words)


def test_one_wrong_bit_in_a_gzip_is_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "hand.csv.gz"
    write_csv(file, example())
    packed = gzip.compress(file.read_bytes())
    for at in range(10, len(packed) - 8, len(packed) // 10):
        file.write_bytes(packed[:at] + bytes([packed[at] ^ 0x10]) + packed[at + 1 :])
        header_names(file)
        with contextlib.suppress(RecordingError):
            read_recording(file)


def test_a_full_disk_is_not_taken_for_a_file_cut_short(tmp_path, monkeypatch) -> None:
    library = pytest.importorskip("zstandard")
    file, original = tmp_path / "hand.csv.zst", Path.open
    write_csv(file, example())
    file.write_bytes(library.ZstdCompressor().compress(file.read_bytes()))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def opened(path: Path, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        # The device that is always full.
        return original(Path("/dev/full") if mode == "wb" else path, mode, *arguments, **options)

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(OutputError, match=r"could not be unpacked to .*No space left.*TMPDIR"):
        list(read_blocks(file))


def test_a_name_that_is_no_utf_8_stands_in_the_source_as_numbers(tmp_path: Path) -> None:
    file = Path(os.fsdecode(os.fsencode(tmp_path) + b"/hand\xff.csv"))
    write_csv(file, example())
    (source,) = read_recording(file).sources
    assert source.name.encode() == b"hand<U+DCFF>.csv"
