"""Bags of ROS 1 and ROS 2 as other recorders write them: by rosbags, of the messages that a test gives."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rosbag1 = pytest.importorskip("rosbags.rosbag1", reason="rosbags writes the samples")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
STORE1 = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
IMU, MAGNETIC, TEXT = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField", "std_msgs/msg/String"
ZEROS = np.zeros(9)

Messages = Iterable[tuple[str, int, Any, str]]
"""Topic, time of recording in ns, message and type."""


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
    vector, quaternion = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Quaternion"](*turned)
    first, second, third = covariances
    return kinds[IMU](header, quaternion, first, vector(*rate), second, vector(*force), third)


def samples(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps, specific force and angular rate of a unit that swings, with noise."""
    rng = np.random.default_rng(8)
    time = 1000.0 + np.arange(count) / 128
    swing = np.column_stack([np.sin(time), np.cos(0.7 * time), np.sin(1.3 * time)])
    force = np.array([0.5, -1.0, 9.7]) + 0.3 * swing + 0.01 * rng.normal(size=(count, 3))
    return time, force, 0.2 * swing + 0.001 * rng.normal(size=(count, 3))


def stream(store: Any, topics: dict[str, str], count: int = 600, stamp: float | None = None) -> Iterator[Any]:
    """IMU messages of topics with "both" triads, "force" or "rate" alone and, in between, texts of another topic."""
    time, force, rate = samples(count)
    for k in range(count):
        at = round(time[k] * 1e9) + 12345
        for topic, what in topics.items():
            parts = force[k] * (what in ("both", "force")), rate[k] * (what in ("both", "rate"))
            # Frames' names of several lengths: the numbers stand at other places then.
            more = "imu" if k % 3 else "imu_link", (0.5, -0.5, 0.5, 0.5), np.arange(27.0).reshape(3, 9)
            yield topic, at, message(store, time[k] if stamp is None else stamp, *parts, *more), IMU
        if k % 5 == 0:
            yield "/words", at + 7, store.types[TEXT](f"word {k} " + "x" * (k % 40)), TEXT


def write_ros1(path: Path, messages: Messages, compression: str | None = None, chunk: int = 30_000) -> Path:
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = chunk
    if compression:
        writer.set_compression(getattr(writer.CompressionFormat, compression))
    made: dict[str, Any] = {}
    with writer:
        for topic, at, each, kind in messages:
            if topic not in made:
                latching = 1 if kind == TEXT else None
                made[topic] = writer.add_connection(topic, kind, typestore=STORE1, latching=latching)
            raw = each if isinstance(each, bytes) else STORE1.serialize_ros1(each, kind)
            writer.write(made[topic], at, raw)
    return path


def write_ros2(path: Path, messages: Messages, storage: str = "SQLITE3", mode: str | None = None) -> Path:
    """A folder, as the recorder of ROS 2 leaves it."""
    writer = rosbag2.Writer(path, version=8, storage_plugin=getattr(rosbag2.StoragePlugin, storage))
    if mode:
        writer.set_compression(getattr(rosbag2.CompressionMode, mode), rosbag2.CompressionFormat.ZSTD)
    made: dict[str, Any] = {}
    with writer:
        for topic, at, each, kind in messages:
            if topic not in made:
                made[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(made[topic], at, STORE.serialize_cdr(each, kind))
    return path


def ros1(path: Path, topics: dict[str, str], count: int = 600, **how: Any) -> Path:
    return write_ros1(path, stream(STORE1, topics, count), **how)


def ros2(path: Path, topics: dict[str, str], count: int = 600, **how: Any) -> Path:
    return write_ros2(path, stream(STORE, topics, count), **how)
