"""How fast each format is read, beside the format's own library, in one run; and what saving as Parquet gains.

    python benchmarks/reading_formats.py --rows 100000
    python benchmarks/reading_formats.py --rows 1000000 --only "CSV,DataFlash,ULog"
    python benchmarks/reading_formats.py --mcap-gigabytes 2 --folder FOLDER

Writes the same recording in every format, reads it with `read_recording` and with the library of the format
(rosbags, pyulog, pymavlink, polars), decoding what a recording needs, and prints seconds and the ratio.
Then the second reading: the file that `tumble inspect --save` writes, in seconds and in seconds of processor, which
other programs on the machine do not lengthen. With --mcap-gigabytes an MCAP file with
pictures between the IMU's messages is read whole and block by block, each in a process of its own, and the
peak of its memory is printed. Timings move with the machine: compare ratios.
"""

from __future__ import annotations

import argparse
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tumble.recording import read_recording, write_recording

UNITS = "m/s^2,rad/s"


def rows_of(count: int) -> np.ndarray:
    """Rest in one pose with noise: time, specific force, angular rate."""
    rng = np.random.default_rng(1)
    force = np.array([0.5, -0.7, 9.8]) + 0.05 * rng.normal(size=(count, 3))
    return np.column_stack([1.7e9 + np.arange(count) / 400.0, force, 0.01 * rng.normal(size=(count, 3))])


# -- writing -----------------------------------------------------------------------------------------


def imu_message(row: np.ndarray) -> bytes:
    """sensor_msgs/Imu as CDR, which both bags of ROS 2 hold."""
    seconds, rest = divmod(round(row[0] * 1e9), 10**9)
    head = struct.pack("<4xiI", seconds, rest) + struct.pack("<I", 4) + b"imu\0"
    numbers = np.zeros(37)
    numbers[13:16], numbers[25:28] = row[4:], row[1:4]
    # The numbers begin at a multiple of eight bytes after the encapsulation.
    return b"\0\1" + head[2:] + numbers.tobytes()


def write_mcap(path: Path, rows: np.ndarray) -> None:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", IMU_DEFINITION.encode())
        channel = writer.register_channel("/imu", "cdr", schema)
        for row in rows:
            stamp = round(row[0] * 1e9)
            writer.add_message(channel, stamp, imu_message(row), stamp)
        writer.finish()


def rosbags_store(name: str) -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(getattr(Stores, name))


IMU_DEFINITION = """std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def write_rosbag1(path: Path, rows: np.ndarray) -> None:
    from rosbags.rosbag1 import Writer

    store = rosbags_store("ROS1_NOETIC")
    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    with writer:
        connection = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        for number, row in enumerate(rows):
            seconds, rest = divmod(round(row[0] * 1e9), 10**9)
            body = imu_message(row)
            head = struct.pack("<III", number, seconds, rest) + struct.pack("<I", 3) + b"imu"
            writer.write(connection, round(row[0] * 1e9), head + body[20:])


def write_rosbag2(path: Path, rows: np.ndarray) -> None:
    from rosbags.rosbag2 import Writer

    with Writer(path, version=8) as writer:
        store = rosbags_store("ROS2_HUMBLE")
        connection = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        for row in rows:
            writer.write(connection, round(row[0] * 1e9), imu_message(row))


def write_ulog(path: Path, rows: np.ndarray) -> None:
    def part(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + kind + body

    fields = "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
    fields += "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    parts = [b"ULog\x01\x12\x35\x01" + bytes(8), part(b"B", bytes(40))]
    parts.append(part(b"F", f"sensor_combined:{fields}".encode()))
    parts.append(part(b"A", struct.pack("<BH", 0, 7) + b"sensor_combined"))
    parts += [
        part(b"D", struct.pack("<HQ3fIi3f", 7, round((r[0] - 1.7e9) * 1e6) + 1, *r[4:], 2500, 0, *r[1:4]))
        for r in rows
    ]
    path.write_bytes(b"".join(parts))


def write_dataflash(path: Path, rows: np.ndarray) -> None:
    def described(kind: int, length: int, name: bytes, form: bytes, labels: bytes) -> bytes:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, form, labels)

    parts = [described(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")]
    parts.append(described(9, 36, b"IMU", b"QBffffff", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"))
    parts += [
        b"\xa3\x95\x09" + struct.pack("<QB6f", round((r[0] - 1.7e9) * 1e6) + 1, 0, *r[4:], *r[1:4])
        for r in rows
    ]
    path.write_bytes(b"".join(parts))


# -- reading by the formats' own libraries -----------------------------------------------------------


def by_rosbags(path: Path, version: int) -> np.ndarray:
    from rosbags import rosbag1, rosbag2

    store = rosbags_store("ROS1_NOETIC" if version == 1 else "ROS2_HUMBLE")
    decode = store.deserialize_ros1 if version == 1 else store.deserialize_cdr
    values = []
    with (rosbag1 if version == 1 else rosbag2).Reader(path) as reader:
        for connection, _, data in reader.messages():
            message: Any = decode(data, connection.msgtype)
            stamp, a, w = message.header.stamp, message.linear_acceleration, message.angular_velocity
            values.append((stamp.sec + 1e-9 * stamp.nanosec, a.x, a.y, a.z, w.x, w.y, w.z))
    return np.array(values)


def by_pyulog(path: Path) -> np.ndarray:
    from pyulog import ULog

    data = ULog(str(path), ["sensor_combined"]).data_list[0].data
    names = [f"{n}[{i}]" for n in ("accelerometer_m_s2", "gyro_rad") for i in range(3)]
    return np.column_stack([data["timestamp"] * 1e-6, *(data[n] for n in names)])


def by_dfreader(path: Path) -> np.ndarray:
    from pymavlink.DFReader import DFReader_binary

    log = DFReader_binary(str(path))
    values = []
    while (m := log.recv_match(type="IMU")) is not None:
        values.append((m.TimeUS, m.AccX, m.AccY, m.AccZ, m.GyrX, m.GyrY, m.GyrZ))
    log.close()
    return np.array(values)


def write_csv(path: Path, rows: np.ndarray) -> None:
    import polars as pl

    names = ("t", "ax", "ay", "az", "gx", "gy", "gz")
    pl.DataFrame({name: rows[:, i] for i, name in enumerate(names)}).write_csv(path)


def by_polars(path: Path) -> np.ndarray:
    import polars as pl

    return pl.read_csv(path).to_numpy()


FORMATS: dict[str, tuple[str, Callable[[Path, np.ndarray], None], str, Callable[[Path], np.ndarray]]] = {
    "CSV": ("a.csv", write_csv, "polars", by_polars),
    "ROS 1 bag, lz4": ("a.bag", write_rosbag1, "rosbags", lambda p: by_rosbags(p, 1)),
    "ROS 2 bag, sqlite3": ("bag", write_rosbag2, "rosbags", lambda p: by_rosbags(p, 2)),
    "MCAP, zstd": ("a.mcap", write_mcap, "rosbags", lambda p: by_rosbags(p, 2)),
    "ULog": ("a.ulg", write_ulog, "pyulog", by_pyulog),
    "DataFlash": ("a.bin", write_dataflash, "pymavlink", by_dfreader),
}


def best(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Least seconds, and least seconds of processor on all cores."""
    times: list[tuple[float, float]] = []
    for _ in range(repeats):
        start, used = time.perf_counter(), time.process_time()
        work()
        times.append((time.perf_counter() - start, time.process_time() - used))
    return min(t for t, _ in times), min(t for _, t in times)


def compare(folder: Path, count: int, repeats: int, only: list[str]) -> None:
    rows = rows_of(count)
    print(f"{count} samples")
    print(f"{'format':20s} {'tumble':>9s} {'library':>9s} {'':10s} {'ratio':>6s}   saved, read again")
    for name, (file, write, library, own) in FORMATS.items():
        if only and name not in only:
            continue
        path = folder / file
        write(path, rows)
        seconds, used = best(lambda path=path: read_recording(path, units=UNITS), repeats)
        alone, _ = best(lambda path=path, own=own: own(path), 1)
        write_recording(read_recording(path, units=UNITS), folder / "saved.parquet")
        again, used_again = best(lambda: read_recording(folder / "saved.parquet"), repeats)
        print(
            f"{name:20s} {seconds:8.3f}s {alone:8.3f}s {library:10s} {seconds / alone:6.2f}   "
            f"{again:6.3f}s, {seconds / again:.1f} times faster (processor {used:.3f} and {used_again:.3f}, "
            f"{used / used_again:.1f} times)"
        )


# -- memory ------------------------------------------------------------------------------------------

MEASURED = """
import resource, sys, time
from tumble.recording import read_blocks, read_recording
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.perf_counter()
if sys.argv[2] == "blocks":
    count = sum(len(b) for b in read_blocks(sys.argv[1], units="m/s^2,rad/s"))
else:
    count = len(read_recording(sys.argv[1], units="m/s^2,rad/s"))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
seconds, used = time.perf_counter() - start, time.process_time()
print(f"{count} samples in {seconds:.1f} s ({used:.1f} s of processor)")
print(f"    peak {peak / 1024:.0f} MB, {before / 1024:.0f} MB before")
"""


def write_large(path: Path, gigabytes: float) -> None:
    """An IMU at 400 Hz and a camera at 30 Hz with pictures of 300 kB, in chunks of zstd."""
    from mcap.writer import CompressionType, Writer

    picture = np.random.default_rng(2).bytes(300_000)
    rows = rows_of(200_000)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        writer.start(profile="ros2")
        schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", IMU_DEFINITION.encode())
        camera = writer.register_schema("sensor_msgs/msg/CompressedImage", "ros2msg", b"uint8[] data")
        imu, pictures = (
            writer.register_channel("/imu", "cdr", schema),
            writer.register_channel("/camera", "cdr", camera),
        )
        number = 0
        while file.tell() < gigabytes * 1e9:
            row = rows[number % len(rows)].copy()
            row[0] = 1.7e9 + number / 400.0
            stamp = round(row[0] * 1e9)
            writer.add_message(imu, stamp, imu_message(row), stamp)
            if number % 13 == 0:
                writer.add_message(pictures, stamp, picture, stamp)
            number += 1
        writer.finish()


def measure_memory(folder: Path, gigabytes: float) -> None:
    path = folder / f"{gigabytes:g}.mcap"
    if not path.exists():
        write_large(path, gigabytes)
    print(f"{path.name}: {path.stat().st_size / 1e9:.2f} GB")
    for how in ("whole", "blocks"):
        answer = subprocess.run(
            [sys.executable, "-c", MEASURED, str(path), how], capture_output=True, text=True, check=False
        )
        print(f"  {how}: {answer.stdout.strip() or answer.stderr.strip()}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="", help="names of formats with commas between")
    parser.add_argument("--mcap-gigabytes", type=float, default=None)
    parser.add_argument("--folder", type=Path, default=None)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        if options.mcap_gigabytes is not None:
            measure_memory(folder, options.mcap_gigabytes)
        else:
            compare(folder, options.rows, options.repeats, [n for n in options.only.split(",") if n])


if __name__ == "__main__":
    main()
