"""Folders, archives, compressed files and patterns: what is read of them, and what of a phone's sensors."""

import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_blocks, read_recording

RNG = np.random.default_rng(5)
SLOW, FAST = 0.0031 + np.arange(300) / 100, np.arange(600) / 200
LEVEL = np.array([0.3, -0.5, 9.78])
FORCE = np.round(LEVEL + 0.02 * RNG.normal(size=(300, 3)), 6)
RATE = np.round(0.002 * RNG.normal(size=(600, 3)), 6)
LOGGER = "time,seconds_elapsed,z,y,x"


def write_sensor(path: Path, header: str, time: np.ndarray, values: np.ndarray) -> None:
    """A file as Sensor Logger writes it if the header is its own, else time, x, y, z."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for t, (x, y, z) in zip(time.tolist(), values.tolist(), strict=True):
        cells = [1_700_000_000_000_000_000 + round(t * 1e9), t, z, y, x] if header == LOGGER else [t, x, y, z]
        rows.append(",".join(map(repr, cells)))
    path.write_text(header + "\n" + "\n".join(rows) + "\n")


def phone(folder: Path, **sensors: tuple[np.ndarray, np.ndarray]) -> Path:
    """The log of a phone: both triads unless others are given."""
    for name, (time, values) in (sensors or BOTH).items():
        write_sensor(folder / f"{name}.csv", LOGGER, time, values)
    return folder


BOTH = {"TotalAcceleration": (SLOW, FORCE), "Gyroscope": (FAST, RATE)}


def interpolated(values: np.ndarray, inside: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(inside, SLOW, values[:, axis]) for axis in range(3)])


def test_sensors_of_a_phone_are_put_on_the_gyro_s_clock(tmp_path: Path) -> None:
    folder = phone(tmp_path / "log")
    recording = read_recording(folder)
    inside = FAST[(SLOW[0] <= FAST) & (SLOW[-1] >= FAST)]
    assert np.array_equal(recording.time, inside)
    np.testing.assert_allclose(recording.specific_force, interpolated(FORCE, inside), rtol=1e-9)
    assert recording.sources[0].name == "log"
    assert "2 gyro sample(s) before, after" in said(recording)


@pytest.mark.parametrize("name", ["LinearAcceleration", "UserAcceleration", "Accelerometer"])
def test_gravity_that_a_phone_took_out_is_put_back(tmp_path: Path, name: str) -> None:
    gravity = np.tile(LEVEL, (300, 1))
    sensors = {name: (SLOW, FORCE - LEVEL), "Gravity": (SLOW, gravity), "Gyroscope": (FAST, RATE)}
    recording = read_recording(phone(tmp_path / "log", **sensors))
    np.testing.assert_allclose(recording.specific_force, interpolated(FORCE, recording.time), rtol=1e-9)
    assert "adding the gravity that it had taken out" in said(recording)
    (tmp_path / "log" / "Gravity.csv").unlink()
    with pytest.raises(RecordingError, match=rf"{name}\.csv has gravity taken out"):
        read_recording(tmp_path / "log")


def test_uncorrected_sensors_go_first_and_any_can_be_named(tmp_path: Path) -> None:
    """In g, as an iPhone gives them."""
    raw = {"AccelerometerUncalibrated": (SLOW, FORCE / 9.80665), "GyroscopeUncalibrated": (FAST, RATE + 0.1)}
    folder = phone(tmp_path / "log", **raw, **BOTH)
    recording = read_recording(folder)
    assert recording.specific_force_unit == "g"
    named = read_recording(folder, topics=["TotalAcceleration", "Gyroscope"])
    assert named.specific_force_unit == "m/s^2"
    assert np.abs(named.angular_rate).max() < 0.05
    with pytest.raises(UsageError, match="--topic Magnetometer: log has no such"):
        read_recording(folder, topics=["Magnetometer"])


def test_columns_that_name_the_sensor_and_the_unit_of_time_are_known(tmp_path: Path) -> None:
    """As other programs write them: no bare x, y, z, and stamps in ns that the header says to be so."""
    for name, unit, time, values in (("acc", "m/s^2", SLOW, FORCE), ("gyro", "rad/s", FAST, RATE)):
        header = "timestamp [ns]," + ",".join(f"{name} {a} [{unit}]" for a in "xyz")
        rows = np.column_stack([np.round(1e9 * time), values])
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header=header, comments="")
    recording = read_recording(tmp_path)
    assert recording.rate == pytest.approx(200.0, rel=1e-9)
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")


def test_a_phone_s_magnetometer_has_its_own_rate(tmp_path: Path) -> None:
    slower = SLOW[::4]
    field = np.array([12.0, -20.0, 41.0]) + 0.4 * RNG.normal(size=(slower.size, 3))
    recording = read_recording(phone(tmp_path / "log", **BOTH, Magnetometer=(slower, field)))
    assert recording.magnetic_field.unit == "uT"
    assert np.array_equal(recording.magnetic_field.values, field)
    np.testing.assert_allclose(recording.magnetic_field.time, slower, rtol=1e-12)
    assert "calibrates by itself" in said(recording)
    raw = read_recording(phone(tmp_path / "log", MagnetometerUncalibrated=(slower, field + 30.0)))
    assert np.array_equal(raw.magnetic_field.values, field + 30.0)


def test_phyphox_exports_a_zip(tmp_path: Path) -> None:
    header = '"Time (s)","X (m/s^2)","Y (m/s^2)","Z (m/s^2)"'
    write_sensor(tmp_path / "Accelerometer.csv", header, SLOW, FORCE)
    write_sensor(tmp_path / "Gyroscope.csv", header.replace("m/s^2", "rad/s"), FAST, RATE)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name in ("Accelerometer.csv", "Gyroscope.csv"):
            archive.write(tmp_path / name, name)
        archive.writestr("meta/device.csv", "property,value\n")
    recording = read_recording(tmp_path / "a.zip")
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")
    np.testing.assert_allclose(recording.specific_force, interpolated(FORCE, recording.time), rtol=1e-9)


def test_a_euroc_folder_is_read_at_any_depth(tmp_path: Path) -> None:
    imu = tmp_path / "V1_01_easy" / "mav0" / "imu0"
    imu.mkdir(parents=True)
    names = [f"{w} [{u}]" for w, u in (("w_RS_S_{}", "rad s^-1"), ("a_RS_S_{}", "m s^-2"))]
    header = ",".join(["#timestamp [ns]", *(n.format(a) for n in names for a in "xyz")])
    rows = [
        ",".join(map(repr, [1_403_636_579_758_555_392 + 10_000_000 * k, *row]))
        for k, row in enumerate(np.hstack([RATE[:300], FORCE]).tolist())
    ]
    (imu / "data.csv").write_text("\r\n".join([header, *rows]) + "\r\n")
    (imu / "sensor.yaml").write_text("sensor_type: imu\n")
    for path in (imu.parents[1], imu.parent, imu):
        recording = read_recording(path)
        assert np.array_equal(recording.specific_force, FORCE)
        assert recording.angular_rate_unit == "rad/s"
    (block,) = read_blocks(imu.parents[1])
    assert block.sources == recording.sources


def test_folders_without_one_recording_are_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    log = phone(tmp_path / "log")
    (log / "Gyroscope.csv").write_text("time,roll,pitch\n1,2,3\n2,3,4\n")
    (tmp_path / "two").mkdir()
    for name in ("a.csv", "b.csv"):
        (tmp_path / "two" / name).write_text("t,ax,ay,az\n0,0,0,9.8\n0.01,0,0.1,9.8\n0.02,0,0,9.8\n")
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as archive:
        for name in ("a.csv", "b.csv"):
            archive.write(tmp_path / "two" / name, name)
    for place, words in (
        ("empty", "folder without a recording in it"),
        ("log", r"Gyroscope\.csv has no columns of time, x, y and z \(it has 'time'"),
        ("two", r"several files \(a\.csv, b\.csv\)"),
        ("c.zip", r"\Ac\.zip is an archive with several files"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_recording(tmp_path / place)
    (tmp_path / "two" / "b.csv").rename(tmp_path / "two" / "README.md")
    assert len(read_recording(tmp_path / "two")) == 3  # a lone file of a folder


def test_compressed_binary_files_are_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([np.arange(300) / 100, FORCE, RATE[:300]]))
    raw = (tmp_path / "a.npy").read_bytes()
    packed = pytest.importorskip("zstandard", reason="the extra ros is not installed").compress(raw)
    path = tmp_path / "a.npy.zst"
    path.write_bytes(packed)
    recording = read_recording(path, columns="t,ax,ay,az,gx,gy,gz", units="m/s^2,rad/s")
    assert np.array_equal(recording.specific_force, FORCE)
    path.write_bytes(packed[:50])
    with pytest.raises(RecordingError, match=r"\A[^\n]+\Z"):
        read_recording(path)
    monkeypatch.setitem(sys.modules, "zstandard", None)
    with pytest.raises(UsageError, match=r"compressed with zstd; reading it needs pip install "):
        read_recording(path)
