"""Logs of autopilots: instances, increments and raw sensors by their own intervals; what is not there is said."""

import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_recording

RNG = np.random.default_rng(8)
FORCE, RATE, MAG = (  # MAG in gauss; all in numbers that single precision has
    (np.array(level) + noise * RNG.normal(size=(200, 3))).astype(np.float32).astype(float)
    for level, noise in (
        ([0.3, -0.4, -9.8], 0.01),
        ([0.01, 0.02, -0.03], 0.001),
        ([0.21, -0.03, 0.43], 0.004),
    )
)
STAMPS = 5_000_000 + 4000 * np.arange(200)  # µs


# -- PX4 ---------------------------------------------------------------------------------------------

Message = tuple[str, int, str, str, list[tuple[Any, ...]]]


def ulog_part(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<H", len(body)) + kind + body


def write_ulog(path: Path, *messages: Message) -> None:
    """Each message: name, instance, fields, format of struct, rows."""

    parts = [b"ULog\x01\x12\x35\x01" + bytes(8), ulog_part(b"B", bytes(40))]
    for name in dict.fromkeys(m[0] for m in messages):
        fields = next(m[2] for m in messages if m[0] == name)
        parts.append(ulog_part(b"F", f"{name}:uint64_t timestamp;{fields}".encode()))
    for number, (name, instance, _, form, rows) in enumerate(messages):
        parts.append(ulog_part(b"A", struct.pack("<BH", instance, number) + name.encode()))
        parts += [ulog_part(b"D", struct.pack("<H", number) + struct.pack("<Q" + form, *row)) for row in rows]
    path.write_bytes(b"".join(parts))


def raw_sensor(kind: str, instance: int, values: np.ndarray, step: int = 1) -> Message:
    fields = "uint64_t timestamp_sample;float x;float y;float z;float temperature;"
    rows = [(int(t) + 300, int(t), *v, 31.5) for t, v in zip(STAMPS[::step], values[::step], strict=True)]
    return f"sensor_{kind}", instance, fields, "Q4f", rows


def combined(relative: int = 0) -> Message:
    fields = "float[3] gyro_rad;int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    rows = [(int(t), *w, relative, *f) for t, w, f in zip(STAMPS, RATE, FORCE, strict=True)]
    return "sensor_combined", 0, fields, "3fi3f", rows


@pytest.fixture(autouse=True)
def _needs_pyulog(request: pytest.FixtureRequest) -> None:
    if "ulog" in request.node.name:
        pytest.importorskip("pyulog", reason="the extra px4 is not installed")


def test_ulog_raw_sensors_are_read_where_they_are_fast(tmp_path: Path) -> None:
    write_ulog(tmp_path / "a.ulg", raw_sensor("accel", 0, FORCE), raw_sensor("gyro", 0, RATE), combined())
    recording = read_recording(tmp_path / "a.ulg")
    assert np.array_equal(recording.specific_force, FORCE)
    assert np.array_equal(recording.angular_rate, RATE)
    assert np.array_equal(recording.time, STAMPS / 1e6)  # of the sample, not of its publication
    assert np.all(recording.temperature == 31.5)
    assert "does not state" not in said(recording)


def test_ulog_slow_raw_sensors_are_passed_over(tmp_path: Path) -> None:
    """Most logs have them once a second."""
    slow = raw_sensor("accel", 0, FORCE, 100), raw_sensor("gyro", 0, RATE, 100)
    write_ulog(tmp_path / "a.ulg", *slow, combined())
    recording = read_recording(tmp_path / "a.ulg")
    assert len(recording) == 200
    assert "sensor_combined:0 is read" in said(recording)
    assert "does not state CAL_ACC*, SENS_BOARD_*_OFF" in said(recording)


def test_ulog_an_instance_is_named_after_a_colon(tmp_path: Path) -> None:
    messages = [raw_sensor(k, i, v + i) for k, v in (("accel", FORCE), ("gyro", RATE)) for i in (0, 1)]
    write_ulog(tmp_path / "a.ulg", *messages)
    recording = read_recording(tmp_path / "a.ulg", topics=["sensor_accel:1", "sensor_gyro[1]"])
    # Added to in float64 and written in float32.
    np.testing.assert_allclose(recording.specific_force, FORCE + 1, rtol=1e-6)
    with pytest.raises(UsageError, match=r"--topic sensor_accel:7: a\.ulg has no such message"):
        read_recording(tmp_path / "a.ulg", topics=["sensor_accel:7"])
    with pytest.raises(RecordingError, match="not an accelerometer and a gyro apart"):
        read_recording(tmp_path / "a.ulg", topics=["sensor_accel:0", "sensor_accel:1"])


def test_ulog_increments_become_rates_by_their_own_intervals(tmp_path: Path) -> None:
    """Intervals alternate: their mean would be wrong by a quarter."""
    spans = np.where(np.arange(200) % 2, 5000, 3000)
    fields = "uint64_t timestamp_sample;float[3] delta_angle;float[3] delta_velocity;"
    fields += "uint16_t delta_angle_dt;uint16_t delta_velocity_dt;"
    rows = [
        (int(t), int(t), *(w * s / 1e6), *(f * s / 1e6), int(s), int(s))
        for t, w, f, s in zip(np.cumsum(spans), RATE, FORCE, spans, strict=True)
    ]
    write_ulog(tmp_path / "a.ulg", ("vehicle_imu", 0, fields, "Q6fHH", rows))
    recording = read_recording(tmp_path / "a.ulg")
    # Increments are written in float32, whose half unit in the last place is 6e-8 of a number.
    np.testing.assert_allclose(recording.angular_rate, RATE, rtol=1e-7)
    np.testing.assert_allclose(recording.specific_force, FORCE, rtol=1e-7)


def test_ulog_the_accelerometer_s_stamp_is_relative(tmp_path: Path) -> None:
    write_ulog(tmp_path / "a.ulg", combined(-2000))
    recording = read_recording(tmp_path / "a.ulg")
    between = 0.5 * (FORCE[:-1] + FORCE[1:])  # half a step later than its samples
    np.testing.assert_allclose(recording.specific_force, between, rtol=1e-12)
    assert np.array_equal(recording.angular_rate, RATE[:-1])


def test_ulog_fifo_messages_hold_many_samples(tmp_path: Path) -> None:
    axes = "int16_t[4] x;int16_t[4] y;int16_t[4] z;"
    fields = f"uint64_t timestamp_sample;float dt;float scale;uint8_t samples;{axes}"
    counts = np.round(np.array([FORCE, RATE]) / 0.0005).astype(int)

    def rows(values: np.ndarray) -> Iterator[tuple[Any, ...]]:
        for start in range(0, 198, 3):  # three of four places are filled
            triples = np.vstack([values[start : start + 3], np.zeros((1, 3), int)]).T.ravel().tolist()
            stamp = 5_000_000 + 1000 * (start + 2)
            yield stamp + 50, stamp, 1000.0, 0.0005, 3, *triples

    names = zip(("sensor_accel_fifo", "sensor_gyro_fifo"), counts, strict=True)
    write_ulog(tmp_path / "a.ulg", *((name, 0, fields, "QffB12h", list(rows(v))) for name, v in names))
    recording = read_recording(tmp_path / "a.ulg")
    assert len(recording) == 198
    np.testing.assert_allclose(np.diff(recording.time), 0.001, rtol=1e-6)
    np.testing.assert_allclose(recording.specific_force, 0.0005 * counts[0, :198], rtol=1e-7)


def test_logs_without_inertial_messages_or_without_their_library_are_refused(tmp_path, monkeypatch) -> None:
    write_ulog(tmp_path / "a.ulg", ("battery_status", 0, "float voltage;", "f", [(1, 12.0), (2, 12.0)]))
    (tmp_path / "a.bin").write_bytes(FMT + described(10, 11, b"MODE", b"Q", b"TimeUS") + bytes(20))
    for name, words in (
        ("a.ulg", r"holds none of the messages .* It knows battery_status"),
        ("a.bin", r"holds no message IMU, ACC, GYR or IMT; .* It describes FMT, MODE"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_recording(tmp_path / name)
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(UsageError, match=r"pip install pyulog"):
        read_recording(tmp_path / "a.ulg")


def test_ulog_the_raw_magnetometer_has_its_own_rate_and_axes(tmp_path: Path) -> None:
    sensors = raw_sensor("accel", 0, FORCE), raw_sensor("gyro", 0, RATE), raw_sensor("mag", 0, MAG, 10)
    write_ulog(tmp_path / "a.ulg", *sensors)
    recording = read_recording(tmp_path / "a.ulg")
    assert recording.magnetic_field.unit == "gauss"
    assert np.array_equal(recording.magnetic_field.values, MAG[::10])
    assert np.array_equal(recording.magnetic_field.time, STAMPS[::10] / 1e6)
    assert np.array_equal(recording.specific_force, FORCE)
    assert "own axes" in said(recording)


# -- ArduPilot ---------------------------------------------------------------------------------------


def described(kind: int, length: int, name: bytes, form: bytes, labels: bytes) -> bytes:
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, form, labels)


FMT = described(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")


def write_dataflash(path: Path, *, middle: bytes = b"") -> None:
    """Two units, the second with ten times the noise; `middle` stands between two messages."""
    labels = b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"
    parts = [FMT, described(9, 36, b"IMU", b"QBffffff", labels), described(10, 11, b"MODE", b"Q", b"TimeUS")]
    for number, (t, w, f) in enumerate(zip(STAMPS, RATE, FORCE, strict=True)):
        for unit in (0, 1):
            parts.append(b"\xa3\x95\x09" + struct.pack("<QB6f", int(t), unit, *(w + unit), *f))
        parts.append(b"\xa3\x95\x0a" + struct.pack("<Q", int(t)))
        parts.append(middle if number == 100 else b"")
    path.write_bytes(b"".join(parts))


def test_dataflash_the_first_unit_is_read_and_the_others_are_listed(tmp_path: Path) -> None:
    write_dataflash(tmp_path / "a.bin")
    recording = read_recording(tmp_path / "a.bin")
    assert np.array_equal(recording.angular_rate, RATE)
    assert "IMU:0 (200 samples, 250 Hz), IMU:1 (200 samples, 250 Hz)" in said(recording)
    second = read_recording(tmp_path / "a.bin", topics=["IMU[1]"])
    np.testing.assert_allclose(second.angular_rate, RATE + 1, rtol=1e-6)  # float32


def test_dataflash_is_read_as_pymavlink_reads_it(tmp_path: Path) -> None:
    reader = pytest.importorskip("pymavlink.DFReader", reason="pymavlink is not installed")
    write_dataflash(tmp_path / "a.bin")
    log = reader.DFReader_binary(str(tmp_path / "a.bin"))
    read = iter(lambda: log.recv_match(type="IMU"), None)
    rows = [[message.AccX, message.AccY, message.AccZ] for message in read if message.I == 0]
    log.close()
    assert np.array_equal(read_recording(tmp_path / "a.bin").specific_force, rows)


def test_dataflash_bytes_between_messages_are_left_out(tmp_path: Path) -> None:
    write_dataflash(tmp_path / "a.bin", middle=b"\x00\xa3\x95\xee\x00")
    recording = read_recording(tmp_path / "a.bin")
    assert np.array_equal(recording.specific_force, FORCE)
    assert "5 bytes that are no message" in said(recording)


def test_dataflash_raw_sensors_and_increments(tmp_path: Path) -> None:
    parts = [
        FMT,
        described(20, 32, b"ACC", b"QBQfff", b"TimeUS,I,SampleUS,AccX,AccY,AccZ"),
        described(21, 32, b"GYR", b"QBQfff", b"TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"),
        described(
            22, 48, b"IMT", b"QBfffffffff", b"TimeUS,I,DelT,DelvT,DelaT,DelAX,DelAY,DelAZ,DelVX,DelVY,DelVZ"
        ),
    ]
    for t, w, f in zip(STAMPS, RATE, FORCE, strict=True):
        parts.append(b"\xa3\x95\x14" + struct.pack("<QBQ3f", int(t) + 90, 0, int(t), *f))
        parts.append(b"\xa3\x95\x15" + struct.pack("<QBQ3f", int(t) + 90, 0, int(t), *w))
        parts.append(b"\xa3\x95\x16" + struct.pack("<QB9f", int(t), 0, 0.1, 0.25, 0.5, *(w / 2), *(f / 4)))
    (tmp_path / "a.bin").write_bytes(b"".join(parts))
    raw = read_recording(tmp_path / "a.bin")
    assert np.array_equal(raw.specific_force, FORCE)
    assert np.array_equal(raw.time, STAMPS / 1e6)
    increments = read_recording(tmp_path / "a.bin", topics=["IMT"])
    assert np.array_equal(increments.specific_force, FORCE)  # halves and quarters are exact
    assert np.array_equal(increments.angular_rate, RATE)


def test_dataflash_the_magnetometer(tmp_path: Path) -> None:
    write_dataflash(tmp_path / "a.bin")
    whole = np.round(1000.0 * MAG[::25]).astype(int)
    labels = b"TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOX,MOY,MOZ,Health,S"
    parts = [described(30, 3 + 8 + 1 + 18 + 1 + 4, b"MAG", b"QBhhhhhhhhhBI", labels)]
    for unit in (0, 1):
        parts += [
            b"\xa3\x95\x1e" + struct.pack("<QB9hBI", int(t), unit, *(m + unit), 12, -34, 56, 0, 0, 0, 1, 0)
            for t, m in zip(STAMPS[::25], whole, strict=True)
        ]
    with (tmp_path / "a.bin").open("ab") as file:
        file.write(b"".join(parts))
    recording = read_recording(tmp_path / "a.bin")
    assert np.array_equal(recording.specific_force, FORCE)
    assert recording.magnetic_field.unit == "mgauss"
    assert np.array_equal(recording.magnetic_field.values, whole)
    assert np.array_equal(recording.magnetic_field.time, STAMPS[::25] / 1e6)
    assert "COMPASS_OFS" in said(recording)
    second = read_recording(tmp_path / "a.bin", topics=["IMU:0", "MAG:1"])
    assert np.array_equal(second.magnetic_field.values, whole + 1)
