"""Bags of ROS 1 and ROS 2: topics are listed, chosen and merged; what is damaged or foreign is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_blocks, read_recording
from tumble.recording.formats.bags import bag

rosbag1 = pytest.importorskip("rosbags.rosbag1", reason="rosbags writes the samples")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
STORE1 = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
IMU = "sensor_msgs/msg/Imu"
ZEROS = np.zeros(9)


def message(
    store: Any,
    seconds: float,
    force: np.ndarray,
    rate: np.ndarray,
    frame: str = "imu",
    turned: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0),
    covariances: Sequence[np.ndarray] = (ZEROS, ZEROS, ZEROS),
) -> Any:
    kinds = store.types
    more = {"seq": 0} if store is STORE1 else {}
    stamp = kinds["builtin_interfaces/msg/Time"](*divmod(round(seconds * 1e9), 10**9))
    header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **more)
    vector = kinds["geometry_msgs/msg/Vector3"]
    quaternion = kinds["geometry_msgs/msg/Quaternion"](*turned)
    first, second, third = covariances
    return kinds[IMU](header, quaternion, first, vector(*rate), second, vector(*force), third)


FORCE = np.array([0.5, -1.0, 9.7])
RATE = np.array([0.01, 0.02, -0.03])


def samples(count: int = 300) -> list[tuple[float, np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(4)
    return [
        (1000.0 + k / 128, FORCE + 0.01 * rng.normal(size=3), RATE + 0.001 * rng.normal(size=3))
        for k in range(count)
    ]


def write_ros1(path: Path, topics: dict[str, str], count: int = 300, compression: str | None = None) -> None:
    """Topics hold "both" triads, "force" or "rate" alone, or "none" of them."""
    writer = rosbag1.Writer(path)
    if compression:
        writer.set_compression(getattr(writer.CompressionFormat, compression))
    with writer:
        connections = {t: writer.add_connection(t, IMU, typestore=STORE1) for t in topics}
        for seconds, force, rate in samples(count):
            for topic, what in topics.items():
                parts = force * (what in ("both", "force")), rate * (what in ("both", "rate"))
                made = message(STORE1, seconds, *parts)
                writer.write(connections[topic], round(seconds * 1e9), STORE1.serialize_ros1(made, IMU))


def write_ros2(
    folder: Path, *, storage: str = "SQLITE3", mode: str | None = None, stamp: float | None = None
) -> None:
    writer = rosbag2.Writer(folder, version=8, storage_plugin=getattr(rosbag2.StoragePlugin, storage))
    if mode:
        writer.set_compression(getattr(rosbag2.CompressionMode, mode), rosbag2.CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/imu", IMU, typestore=STORE)
        for seconds, force, rate in samples():
            made = message(STORE, seconds if stamp is None else stamp, force, rate)
            writer.write(connection, round(seconds * 1e9), STORE.serialize_cdr(made, IMU))


def texts(recording: Any) -> str:
    return " ".join(r.text for r in recording.remarks)


def test_a_folder_of_files_compressed_as_a_whole_is_unpacked(tmp_path: Path) -> None:
    """`compression_mode: file`; a database that is cut short is refused."""
    library = pytest.importorskip("zstandard", reason="the extra ros is not installed")
    write_ros2(tmp_path / "bag", mode="FILE")
    assert not list((tmp_path / "bag").glob("*.db3"))
    whole = read_recording(tmp_path / "bag")
    assert len(whole) == 300
    assert whole.sources[0].name == "bag"
    assert np.array_equal(np.concatenate([b.time for b in read_blocks(tmp_path / "bag")]), whole.time)
    (packed,) = (tmp_path / "bag").glob("*.zstd")
    raw = library.ZstdDecompressor().decompressobj().decompress(packed.read_bytes())
    packed.write_bytes(library.compress(raw[: len(raw) // 2]) + library.compress(raw[len(raw) // 2 :])[:2000])
    with pytest.raises(RecordingError, match=r"bag\.db3 is cut short.*sqlite3 bag\.db3 \.recover"):
        read_recording(tmp_path / "bag")


def write_chunks(path: Path, count: int = 3000) -> Path:
    """A ROS 1 bag of several compressed chunks."""
    writer = rosbag1.Writer(path)
    writer.set_compression(writer.CompressionFormat.BZ2)
    writer.chunk_threshold = 100_000
    with writer:
        connection = writer.add_connection("/imu", IMU, typestore=STORE1)
        for seconds, force, rate in samples(count):
            made = STORE1.serialize_ros1(message(STORE1, seconds, force, rate), IMU)
            writer.write(connection, round(seconds * 1e9), made)
    return path


def test_a_ros_1_bag_that_is_damaged_or_cut_short_is_refused_with_what_mends_it(tmp_path: Path) -> None:
    data = write_chunks(tmp_path / "a.bag").read_bytes()
    middle = len(data) // 2
    (tmp_path / "damaged.bag").write_bytes(data[:middle] + b"\x5a" * 16 + data[middle + 16 :])
    (tmp_path / "open.bag").write_bytes(data[:-6000])
    (tmp_path / "cut.bag").write_bytes(data[: len(data) // 2])
    (tmp_path / "never.bag").write_bytes(data[:60] + bytes(8) + data[68:])
    for name in ("damaged.bag", "open.bag", "cut.bag", "never.bag"):
        for read in (read_recording, lambda path: list(read_blocks(path))):
            with pytest.raises(RecordingError, match=rf"{name} is a damaged.*rosbag reindex {name}"):
                read(tmp_path / name)


def test_a_database_that_is_damaged_or_cut_short_is_refused_with_what_mends_it(tmp_path: Path) -> None:
    write_ros2(tmp_path / "bag")
    (path,) = (tmp_path / "bag").glob("*.db3")
    data = path.read_bytes()
    at = len(data) // 2 // 4096 * 4096
    for wrong in (data[:at] + b"\xff" * 4096 + data[at + 4096 :], data[:at], data[: at + 100], data[:-1]):
        path.write_bytes(wrong)
        with pytest.raises(RecordingError, match=rf"{path.name} is .*sqlite3 {path.name} \.recover"):
            read_recording(path)


def test_a_topic_that_is_named_after_the_other_sensor_is_said(tmp_path: Path) -> None:
    write_ros1(tmp_path / "a.bag", {"/accel/sample": "rate", "/gyro/sample": "force"})
    said = texts(read_recording(tmp_path / "a.bag"))
    assert "/gyro/sample is named after a gyro, but its messages hold an acceleration" in said
    assert "/accel/sample is named after an accelerometer, but its messages hold an angular rate" in said


def test_split_topics_are_merged(tmp_path: Path) -> None:
    write_ros1(tmp_path / "a.bag", {"/accel/sample": "force", "/gyro/sample": "rate"})
    recording = read_recording(tmp_path / "a.bag")
    assert np.array_equal(recording.specific_force, [f for _, f, _ in samples()])
    assert np.array_equal(recording.angular_rate, [w for _, _, w in samples()])
    assert "/accel/sample as the accelerometer and /gyro/sample as the gyro" in texts(recording)
    assert recording.sources[0].topic is None


def test_topics_are_listed_with_type_number_and_rate(tmp_path: Path) -> None:
    write_ros1(tmp_path / "a.bag", {"/imu": "both"})
    assert "/imu (sensor_msgs/Imu, 300 messages, 128 Hz)" in texts(read_recording(tmp_path / "a.bag"))


def test_two_sensors_are_not_mixed_unless_one_is_named(tmp_path: Path) -> None:
    write_ros1(tmp_path / "a.bag", {"/left": "both", "/right": "both"})
    with pytest.raises(
        RecordingError, match=r"several sensors: /left .*, /right .*; name one of them with --topic"
    ):
        read_recording(tmp_path / "a.bag")
    right = read_recording(tmp_path / "a.bag", topics=["right"])
    assert len(right) == 300
    assert right.sources[0].topic == "/right"
    with pytest.raises(RecordingError, match="name one of them"):
        read_recording(tmp_path / "a.bag", topics=["/left", "/right"])


def test_an_unknown_topic_is_refused_with_those_that_there_are(tmp_path: Path) -> None:
    write_ros1(tmp_path / "a.bag", {"/imu": "both"})
    with pytest.raises(UsageError, match=r"--topic /imu0: a.bag has no such topic; it holds /imu "):
        read_recording(tmp_path / "a.bag", topics=["/imu0"])
    with pytest.raises(UsageError, match="3 topics"):
        read_recording(tmp_path / "a.bag", topics=["/imu"] * 3)


def test_topics_of_another_type_are_refused_and_listed(tmp_path: Path) -> None:
    with rosbag1.Writer(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/said", "std_msgs/msg/String", typestore=STORE1)
        data = STORE1.serialize_ros1(STORE1.types["std_msgs/msg/String"]("word"), connection.msgtype)
        writer.write(connection, 1, data)
    with pytest.raises(
        RecordingError, match=r"holds no topic of sensor_msgs/Imu; it holds /said \(std_msgs/String"
    ):
        read_recording(tmp_path / "a.bag")
    with pytest.raises(RecordingError, match=r"/said is std_msgs/String; read are sensor_msgs/Imu"):
        read_recording(tmp_path / "a.bag", topics=["/said"])


def test_messages_without_stamps_take_the_time_of_recording(tmp_path: Path) -> None:
    write_ros2(tmp_path / "bag", stamp=0.0)
    recording = read_recording(tmp_path / "bag")
    assert recording.time[0] == 1000.0
    assert "have no stamps" in texts(recording)


def test_a_message_that_is_too_short_is_refused(tmp_path: Path) -> None:
    with rosbag1.Writer(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/imu", IMU, typestore=STORE1)
        for k in range(20):
            writer.write(connection, k, bytes(40))
    with pytest.raises(RecordingError, match="has 40 bytes, too few for sensor_msgs/Imu"):
        read_recording(tmp_path / "a.bag")


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    write_ros1(tmp_path / "a.bag", {"/imu": "both"})
    write_ros2(tmp_path / "bag", storage="MCAP")
    for module, path in (("rosbags.rosbag1", "a.bag"), ("mcap.records", "bag/bag.mcap")):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(UsageError, match=r"; reading it needs pip install "):
            read_recording(tmp_path / path)


def test_a_database_of_something_else_is_refused(tmp_path: Path) -> None:
    import sqlite3

    connection = sqlite3.connect(tmp_path / "a.db3")
    connection.execute("CREATE TABLE songs (name TEXT)")
    connection.commit()
    connection.close()
    with pytest.raises(RecordingError, match="foreign database"):
        read_recording(tmp_path / "a.db3")


def test_topics_of_a_format_without_topics_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,ax,ay,az\n0,0,0,9.8\n0.01,0,0,9.8\n")
    with pytest.raises(UsageError, match=r"a\.csv is text, which has no topics"):
        read_recording(tmp_path / "a.csv", topics=["/imu"])


# -- magnetometers -----------------------------------------------------------------------------------

MAGNETIC = "sensor_msgs/msg/MagneticField"
FIELD = np.array([18e-6, -4e-6, -44e-6])  # T


def magnetic(store: Any, seconds: float, field: np.ndarray) -> Any:
    made = message(store, seconds, FORCE, RATE)
    vector = store.types["geometry_msgs/msg/Vector3"](*field)
    return store.types[MAGNETIC](made.header, vector, ZEROS)


def fields(count: int = 60) -> list[tuple[float, np.ndarray]]:
    rng = np.random.default_rng(9)
    return [(1000.003 + k / 25, FIELD + 3e-7 * rng.normal(size=3)) for k in range(count)]


def test_a_magnetometer_s_topic_stands_beside_the_imu_s(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "folder"
    with rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin.SQLITE3) as writer:
        imu = writer.add_connection("/imu/data", IMU, typestore=STORE)
        for name, sign in (("/imu/mag", 1.0), ("/gps/mag", -1.0)):
            connection = writer.add_connection(name, MAGNETIC, typestore=STORE)
            for seconds, field in fields():
                made = STORE.serialize_cdr(magnetic(STORE, seconds, sign * field), MAGNETIC)
                writer.write(connection, round(seconds * 1e9), made)
        for seconds, force, rate in samples():
            made = STORE.serialize_cdr(message(STORE, seconds, force, rate), IMU)
            writer.write(imu, round(seconds * 1e9), made)
    recording = read_recording(path)
    assert len(recording) == 300
    assert recording.magnetic_field is not None
    assert recording.magnetic_field.unit == "T"
    assert np.array_equal(recording.magnetic_field.values, [field for _, field in fields()])
    np.testing.assert_allclose(recording.magnetic_field.time, [t for t, _ in fields()], atol=1e-6)
    assert "/imu/mag is read as the magnetometer" in texts(recording)
    assert "/gps/mag" in texts(recording)
    for name in ("BLOCK_ROWS", "_BATCH"):
        monkeypatch.setattr(bag, name, 100)
    blocks = list(read_blocks(path))
    assert sum(len(block.magnetic_field or ()) for block in blocks) == len(fields())
    assert "/imu/mag is read as the magnetometer" in texts(blocks[0])
    other = read_recording(path, topics=["/imu/data", "/gps/mag"])
    assert other.magnetic_field is not None
    assert np.array_equal(other.magnetic_field.values, [-field for _, field in fields()])
    assert len(other) == 300


def test_a_bag_with_a_magnetometer_alone_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with rosbag1.Writer(path) as writer:
        connection = writer.add_connection("/mag", MAGNETIC, typestore=STORE1)
        for seconds, field in fields():
            made = STORE1.serialize_ros1(magnetic(STORE1, seconds, 1e6 * field), MAGNETIC)
            writer.write(connection, round(seconds * 1e9), made)
    recording = read_recording(path)
    assert recording.specific_force is None
    assert recording.magnetic_field is not None
    assert len(recording.magnetic_field) == 60
    assert "in uT it would be the Earth's" in texts(recording)  # many drivers write µT where the type says T
    assert read_recording(path, units="uT").magnetic_field.unit == "uT"
