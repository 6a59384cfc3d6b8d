"""Bags of ROS 1 and ROS 2: topics are listed, chosen and merged; what is damaged or foreign is refused."""

import sqlite3
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.contract import ros
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_blocks, read_recording
from tumble.recording.formats.bags import bag

TIME, FORCE, RATE = ros.samples(600)


def test_a_folder_of_files_compressed_as_a_whole_is_unpacked(tmp_path: Path) -> None:
    """`compression_mode: file`; a database that is cut short is refused."""
    library = pytest.importorskip("zstandard", reason="the extra ros is not installed")
    folder = ros.ros2(tmp_path / "bag", {"/imu": "both"}, mode="FILE")
    assert not list(folder.glob("*.db3"))
    whole = read_recording(folder)
    assert len(whole) == 600
    assert whole.sources[0].name == "bag"
    assert np.array_equal(np.concatenate([b.time for b in read_blocks(folder)]), whole.time)
    (packed,) = folder.glob("*.zstd")
    raw = library.ZstdDecompressor().decompressobj().decompress(packed.read_bytes())
    packed.write_bytes(library.compress(raw[: len(raw) // 2]) + library.compress(raw[len(raw) // 2 :])[:2000])
    with pytest.raises(RecordingError, match=r"bag\.db3 is cut short.*sqlite3 bag\.db3 \.recover"):
        read_recording(folder)


def test_what_is_damaged_or_cut_short_is_refused_with_what_mends_it(tmp_path: Path) -> None:
    data = ros.ros1(tmp_path / "a.bag", {"/imu": "both"}, 3000, compression="BZ2", chunk=100_000).read_bytes()
    (table,) = ros.ros2(tmp_path / "bag", {"/imu": "both"}).glob("*.db3")
    rows = table.read_bytes()
    middle, page = len(data) // 2, len(rows) // 2 // 4096 * 4096
    damaged = [data[:middle] + b"\x5a" * 16 + data[middle + 16 :], data[:-6000], data[:middle]]
    damaged += [data[:60] + bytes(8) + data[68:]]
    torn = [rows[:page] + b"\xff" * 4096 + rows[page + 4096 :], rows[:page], rows[: page + 100], rows[:-1]]
    for name, wrong, words in (
        ("b.bag", damaged, r"b\.bag is a damaged.*rosbag reindex b\.bag"),
        ("b.db3", torn, r"b\.db3 is .*sqlite3 b\.db3 \.recover"),
    ):
        for content in wrong:
            (tmp_path / name).write_bytes(content)
            for read in (read_recording, lambda path: list(read_blocks(path))):
                with pytest.raises(RecordingError, match=words):
                    read(tmp_path / name)


def test_split_topics_are_merged_whole_or_piece_by_piece(tmp_path: Path, monkeypatch) -> None:
    path = ros.ros1(tmp_path / "a.bag", {"/accel/sample": "force", "/gyro/sample": "rate"})
    recording = read_recording(path)
    assert np.array_equal(recording.specific_force, FORCE)
    assert np.array_equal(recording.angular_rate, RATE)
    assert "/accel/sample as the accelerometer and /gyro/sample as the gyro" in said(recording)
    assert recording.sources[0].topic is None
    for name in ("BLOCK_ROWS", "_BATCH"):
        monkeypatch.setattr(bag, name, 37)
    blocks = list(read_blocks(path))
    assert len(blocks) > 10
    for part in ("time", "specific_force", "angular_rate"):
        assert np.array_equal(np.concatenate([getattr(b, part) for b in blocks]), getattr(recording, part))
    swapped = said(
        read_recording(ros.ros1(tmp_path / "b.bag", {"/accel/sample": "rate", "/gyro/sample": "force"}))
    )
    assert "/gyro/sample is named after a gyro, but its messages hold an acceleration" in swapped
    assert "/accel/sample is named after an accelerometer, but its messages hold an angular rate" in swapped


def test_topics_are_listed_and_two_sensors_are_not_mixed_unless_one_is_named(tmp_path: Path) -> None:
    one, two = (
        ros.ros1(tmp_path / name, dict.fromkeys(t, "both"))
        for name, t in (("a", ["/imu"]), ("b", ["/left", "/right"]))
    )
    assert "/imu (sensor_msgs/Imu, 600 messages, 128 Hz)" in said(read_recording(one))
    several = r"several sensors: /left .*, /right .*; name one of them with --topic"
    for path, topics, error, words in (
        (two, (), RecordingError, several),
        (two, ("/left", "/right"), RecordingError, "name one of them"),
        (one, ("/imu0",), UsageError, r"--topic /imu0: a has no such topic; it holds /imu "),
        (one, ("/imu",) * 3, UsageError, "3 topics"),
        (one, ("/words",), RecordingError, r"/words is std_msgs/String; read are sensor_msgs/Imu"),
    ):
        with pytest.raises(error, match=words):
            read_recording(path, topics=topics)
    right = read_recording(two, topics=["right"])
    assert (len(right), right.sources[0].topic) == (600, "/right")


def test_bags_of_other_things_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ros.write_ros1(tmp_path / "a.bag", [("/said", 1, ros.STORE1.types[ros.TEXT]("word"), ros.TEXT)])
    short = ros.write_ros1(tmp_path / "b.bag", [("/imu", k, bytes(40), ros.IMU) for k in range(20)])
    connection = sqlite3.connect(tmp_path / "a.db3")
    connection.execute("CREATE TABLE songs (name TEXT)")
    connection.commit()
    connection.close()
    for path, why in (
        (words, r"holds no topic of sensor_msgs/Imu; it holds /said \(std_msgs/String"),
        (short, "has 40 bytes, too few for sensor_msgs/Imu"),
        (tmp_path / "a.db3", "foreign database"),
    ):
        with pytest.raises(RecordingError, match=why):
            read_recording(path)
    (tmp_path / "a.csv").write_text("t,ax,ay,az\n0,0,0,9.8\n0.01,0,0,9.8\n")
    with pytest.raises(UsageError, match=r"a\.csv is text, which has no topics"):
        read_recording(tmp_path / "a.csv", topics=["/imu"])
    ros.ros2(tmp_path / "bag", {"/imu": "both"}, 50, storage="MCAP")
    for module, name in (("rosbags.rosbag1", "a.bag"), ("mcap.records", "bag/bag.mcap")):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(UsageError, match=r"; reading it needs pip install "):
            read_recording(tmp_path / name)


def test_messages_without_stamps_take_the_time_of_recording(tmp_path: Path) -> None:
    recording = read_recording(
        ros.write_ros2(tmp_path / "bag", ros.stream(ros.STORE, {"/imu": "both"}, stamp=0.0))
    )
    assert recording.time[0] == pytest.approx(1000.000012345, abs=1e-9)
    assert "have no stamps" in said(recording)


# -- magnetometers -----------------------------------------------------------------------------------

STAMPS = 1000.003 + np.arange(60) / 25
FIELD = np.array([18e-6, -4e-6, -44e-6]) + 3e-7 * np.random.default_rng(9).normal(size=(60, 3))  # T


def magnetic(store: Any, topic: str, scale: float) -> Iterator[Any]:
    for seconds, field in zip(STAMPS.tolist(), scale * FIELD, strict=True):
        header = ros.message(store, seconds, ros.ZEROS[:3], ros.ZEROS[:3]).header
        made = store.types[ros.MAGNETIC](header, store.types["geometry_msgs/msg/Vector3"](*field), ros.ZEROS)
        yield topic, round(seconds * 1e9), made, ros.MAGNETIC


def test_a_magnetometer_s_topic_stands_beside_the_imu_s(tmp_path: Path, monkeypatch) -> None:
    parts = [ros.stream(ros.STORE, {"/imu/data": "both"}, 300)]
    parts += [magnetic(ros.STORE, "/imu/mag", 1.0), magnetic(ros.STORE, "/gps/mag", -1.0)]
    path = ros.write_ros2(tmp_path / "folder", (one for part in parts for one in part))
    recording = read_recording(path)
    assert len(recording) == 300
    assert recording.magnetic_field.unit == "T"
    assert np.array_equal(recording.magnetic_field.values, FIELD)
    np.testing.assert_allclose(recording.magnetic_field.time, STAMPS, atol=1e-6)
    assert "/imu/mag is read as the magnetometer" in said(recording)
    assert "/gps/mag" in said(recording)
    for name in ("BLOCK_ROWS", "_BATCH"):
        monkeypatch.setattr(bag, name, 100)
    blocks = list(read_blocks(path))
    assert sum(len(block.magnetic_field or ()) for block in blocks) == 60
    assert "/imu/mag is read as the magnetometer" in said(blocks[0])
    other = read_recording(path, topics=["/imu/data", "/gps/mag"])
    assert np.array_equal(other.magnetic_field.values, -FIELD)
    assert len(other) == 300


def test_a_bag_with_a_magnetometer_alone_is_read(tmp_path: Path) -> None:
    path = ros.write_ros1(tmp_path / "a.bag", magnetic(ros.STORE1, "/mag", 1e6))
    recording = read_recording(path)
    assert recording.specific_force is None
    assert len(recording.magnetic_field) == 60
    assert "in uT it would be the Earth's" in said(recording)  # many drivers write µT where the type says T
    assert read_recording(path, units="uT").magnetic_field.unit == "uT"
