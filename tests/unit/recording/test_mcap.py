"""MCAP files as other recorders write them, and as they are when something went wrong; mcap writes the samples."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError
from tumble.recording import read_recording
from tumble.recording.formats.bags.files import McapFile

mcap = pytest.importorskip("mcap.writer", reason="mcap writes the samples")

MAGIC = b"\x89MCAP0\r\n"
COUNT = 300
# x, y and z of force and rate, sample by sample: all different
VALUES = np.arange(6.0 * COUNT).reshape(COUNT, 6) * 1e-3 + np.array([0.5, -1.0, 9.5, 0.01, 0.02, -0.03])


def imu(k: int) -> bytes:
    """Message k of sensor_msgs/Imu in CDR, laid out by hand: header, quaternion, rate, force, covariances."""
    second, nano = divmod(round(k * 1e7), 10**9)
    content = struct.pack("<iI", 1000 + second, nano) + struct.pack("<I", 4) + b"imu\0"
    content += struct.pack("<4d", 0.0, 0.0, 0.0, 1.0) + bytes(72)
    content += VALUES[k, 3:].astype("<f8").tobytes() + bytes(72)
    content += VALUES[k, :3].astype("<f8").tobytes() + bytes(72)
    return b"\0\1\0\0" + content


def write(path: Path, *, encoding: str = "cdr", kind: str = "sensor_msgs/msg/Imu", **options: Any) -> Path:
    """A file of COUNT messages of /imu among others of /words, in chunks of some 30 messages."""
    with path.open("wb") as file:
        writer = mcap.Writer(file, chunk_size=10_000, **options)
        writer.start()
        schema = writer.register_schema(kind, "ros2msg", b"")
        channel = writer.register_channel("/imu", encoding, schema)
        words = writer.register_channel(
            "/words", "cdr", writer.register_schema("std_msgs/msg/String", "ros2msg", b"")
        )
        for k in range(COUNT):
            writer.add_message(channel, 10**12 + k * 10**7, imu(k), 10**12 + k * 10**7)
            if k % 50 == 0:
                writer.add_message(words, 10**12 + k * 10**7, b"\0\1\0\0\2\0\0\0a\0", 10**12 + k * 10**7)
        if options.get("use_chunking", True):
            writer.add_metadata("rig", {"serial": "7"})
        writer.finish()
    return path


def records(data: bytes) -> list[tuple[int, int, int]]:
    """Code, place and whole length of the records of a file that is finished."""
    found: list[tuple[int, int, int]] = []
    place = len(MAGIC)
    while place < len(data) - len(MAGIC):
        code, length = struct.unpack_from("<BQ", data, place)
        found.append((code, place, 9 + length))
        place += 9 + length
    return found


def changed(path: Path, code: int, number: int, at: int, new: bytes) -> Path:
    """The file with bytes of one record's content replaced: the record `number` of those of a code."""
    data = bytearray(path.read_bytes())
    _, place, _ = [record for record in records(bytes(data)) if record[0] == code][number]
    data[place + 9 + at : place + 9 + at + len(new)] = new
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": mcap.CompressionType.NONE},
        {"compression": mcap.CompressionType.LZ4},
        {"use_chunking": False},
        {"use_statistics": False},
        {"index_types": mcap.IndexType.NONE},
        {"index_types": mcap.IndexType.CHUNK},
        {"repeat_channels": False, "repeat_schemas": False},
        {"enable_crcs": False},
    ],
    ids=str,
)
def test_whatever_a_recorder_leaves_out_the_messages_are_the_same(tmp_path, options) -> None:
    path = write(tmp_path / "a.mcap", **options)
    recording = read_recording(path)
    assert np.array_equal(np.hstack([recording.specific_force, recording.angular_rate]), VALUES)
    assert "not finished" not in said(recording)
    topics = {topic.name: topic for topic in McapFile(path).topics}
    assert (topics["/imu"].count, topics["/words"].count) == (COUNT, 6)
    assert topics["/imu"].words().endswith(", 100 Hz)")
    assert topics["/words"].kind == "std_msgs/String"


def killed(path: Path) -> Iterator[bytes]:
    """Cut within a record, within its head, with the zeros that a file system puts at the end, and a false length."""
    whole = write(path, use_chunking=False).read_bytes()
    place = [place for code, place, _ in records(whole) if code == 5][200]
    yield from (whole[: place + 30], whole[: place + 4], whole[:place] + bytes(5000))
    yield whole[:place] + struct.pack("<BQ", 0x0C, 1 << 50) + whole[place:]


def test_a_recorder_that_was_killed_leaves_all_but_the_last_piece(tmp_path: Path) -> None:
    for tail in killed(tmp_path / "a.mcap"):
        (tmp_path / "b.mcap").write_bytes(tail)
        recording = read_recording(tmp_path / "b.mcap")
        # 200 messages before the cut, of which /words has four
        assert np.array_equal(recording.specific_force, VALUES[:196, :3])
        assert "is not finished or cut short; what is there is read" in said(recording)


def test_a_file_of_zstd_that_is_cut_short_is_said(tmp_path: Path) -> None:
    library = pytest.importorskip("zstandard", reason="the extra ros is not installed")
    raw = write(tmp_path / "a.mcap", compression=mcap.CompressionType.NONE).read_bytes()
    packed = library.compress(raw[: len(raw) // 2]) + library.compress(raw[len(raw) // 2 :])[:2000]
    (tmp_path / "a.mcap.zst").write_bytes(packed)
    recording = read_recording(tmp_path / "a.mcap.zst")
    assert 0 < len(recording) < COUNT
    assert "the compressed file is cut short or damaged" in said(recording)


LZ4 = {"compression": mcap.CompressionType.LZ4}
PLAIN = {"compression": mcap.CompressionType.NONE, "enable_crcs": False}


@pytest.mark.parametrize(
    ("options", "at", "new", "words"),
    [
        ({}, 16, struct.pack("<Q", 7), "1 of {} chunk(s) is damaged"),  # the chunk's size
        (
            {},
            16,
            struct.pack("<Q", 1 << 40),
            "1 of {} chunk(s) is damaged",
        ),  # and one that nothing unpacks to
        ({}, 24, b"\1\2\3\4", "1 of {} chunk(s) is damaged"),  # its checksum
        ({}, 32, b"zip7", "1 of {} chunk(s) is damaged"),
        (LZ4, 60, b"\xa5" * 40, "chunk(s) is damaged ("),
        # The chunk's own records begin after its head, times, size, checksum, no name, length: one that is too long.
        (PLAIN, 41, struct.pack("<Q", 1 << 40), "chunk(s) is damaged (a chunk is damaged)"),
        ({}, 28, struct.pack("<I", 1 << 30), "not finished or cut short"),  # its head: the reading ends there
    ],
)
def test_a_chunk_that_cannot_be_unpacked_is_left_out_and_counted(tmp_path, options, at, new, words) -> None:
    path = write(tmp_path / "a.mcap", **options)
    chunks = len([record for record in records(path.read_bytes()) if record[0] == 0x06])
    recording = read_recording(changed(path, 0x06, 3, at, new))
    missing = COUNT - len(recording)
    ends = "cut short" in words
    assert (COUNT / 2 if ends else 0) < missing < (COUNT if ends else COUNT / 3)
    assert {tuple(row) for row in recording.specific_force} < {tuple(row) for row in VALUES[:, :3]}
    assert words.format(chunks) in said(recording)
    assert f"{missing} of {COUNT} messages of /imu could not be read" in said(recording)


@pytest.mark.parametrize(
    ("code", "at", "new"),
    [
        (0x0B, -8, struct.pack("<Q", 20)),  # statistics that end within their numbers
        (0x02, 0, struct.pack("<Q", 1 << 60)),  # a footer that leads beyond the end
        (0x02, 0, struct.pack("<Q", 3)),  # or into the middle of something
        (0x08, -9, b"\x7f"),  # an index that lost a chunk: its checksum does not agree
        (0x08, 16, struct.pack("<Q", 1 << 60)),
    ],
)
def test_a_damaged_summary_loses_nothing(tmp_path: Path, code: int, at: int, new: bytes) -> None:
    """The summary only repeats what stands before it: the messages are found without it."""
    recording = read_recording(changed(write(tmp_path / "a.mcap"), code, 0, at, new))
    assert np.array_equal(np.hstack([recording.specific_force, recording.angular_rate]), VALUES)


def test_messages_of_another_encoding_or_without_a_schema_are_named_with_it(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", encoding="json")
    with pytest.raises(RecordingError, match=r"/imu \(sensor_msgs/Imu as json, 300 messages"):
        read_recording(path)
    with path.open("wb") as file:
        writer = mcap.Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("/raw", "protobuf", 0), 5, b"abc", 5)
        writer.finish()
    with pytest.raises(RecordingError, match=r"holds no topic of sensor_msgs/Imu; it holds /raw \(protobuf"):
        read_recording(path)
