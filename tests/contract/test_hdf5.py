"""HDF5: data sets are listed, found by name and shape, or named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_recording

h5py = pytest.importorskip("h5py", reason="the extra hdf5 is not installed")

RNG = np.random.default_rng(6)
TIME = np.arange(300) / 128
FORCE = np.array([0.5, -1.0, 9.7]) + 0.02 * RNG.normal(size=(300, 3))
RATE = 0.01 * RNG.normal(size=(300, 3))


def write(path: Path, **arrays: Any) -> Path:
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[name.replace("__", "/")] = array
    return path


def test_data_sets_are_listed_with_their_shapes(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h5", imu__t=TIME, imu__acc=FORCE, imu__gyr=RATE, camera__stamps=np.arange(5.0))
    recording = read_recording(path, units="m/s^2,rad/s")
    assert np.array_equal(recording.specific_force, FORCE)
    listed = next(r.text for r in recording.remarks if "holds" in r.text)
    assert "/imu/acc (300, 3)" in listed
    assert "/camera/stamps (5,)" in listed


def test_two_sensors_are_not_mixed_unless_one_is_named(tmp_path: Path) -> None:
    arrays = {f"imu{i}__{n}": a + i for i in (0, 1) for n, a in (("t", TIME), ("acc", FORCE), ("gyr", RATE))}
    path = write(tmp_path / "a.h5", **arrays)
    with pytest.raises(
        RecordingError, match=r"several sensors, in the groups /imu0, /imu1; name one with --topic"
    ):
        read_recording(path)
    second = read_recording(path, topics=["/imu1"], units="m/s^2,rad/s")
    assert np.array_equal(second.angular_rate, RATE + 1)
    with pytest.raises(
        UsageError, match=r"--topic imu2: a\.h5 has no such group or data set; it holds /imu0/"
    ):
        read_recording(path, topics=["imu2"])


def test_groups_of_one_triad_each_are_merged(tmp_path: Path) -> None:
    """The names x, y, z say nothing without that of the group."""
    groups = {
        f"{name}__{axis}": values[:, k]
        for name, values in (("accelerometer", FORCE), ("gyroscope", RATE))
        for k, axis in enumerate("xyz")
    }
    path = write(tmp_path / "a.h5", **groups, accelerometer__t=TIME, gyroscope__t=TIME)
    recording = read_recording(path, units="m/s^2,rad/s")
    assert np.array_equal(recording.specific_force, FORCE)
    assert np.array_equal(recording.angular_rate, RATE)
    lone = read_recording(path, topics=["gyroscope"], units="rad/s")
    assert lone.specific_force is None


def test_a_table_with_named_columns_is_a_group(tmp_path: Path) -> None:
    names = ("t", "ax", "ay", "az", "gx", "gy", "gz")
    rows = np.array(
        [tuple(r) for r in np.column_stack([TIME, FORCE, RATE])], dtype=[(n, "f8") for n in names]
    )
    path = write(tmp_path / "a.h5", log__imu=rows, log__other=np.arange(9.0))
    assert np.array_equal(read_recording(path, units="m/s^2,rad/s").specific_force, FORCE)


def test_a_data_set_is_named_with_the_clock_beside_it(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h5", s__t=TIME, s__acc_left=FORCE, s__acc_right=FORCE + 1.0)
    recording = read_recording(path, topics=["s/acc_right"], units="m/s^2")
    assert np.array_equal(recording.specific_force, FORCE + 1.0)
    assert np.array_equal(recording.time, TIME)


def test_files_without_a_table_and_damaged_ones_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="holds no table of samples"):
        read_recording(write(tmp_path / "a.h5", x=1.0))
    path = write(tmp_path / "b.h5", imu__t=TIME, imu__acc=FORCE)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(RecordingError, match="damaged HDF5"):
        read_recording(path)


def test_units_and_rate_among_the_attributes_are_taken(tmp_path: Path) -> None:
    """Numbers in g and deg/s that say so are read so, though at rest the gyro's would pass for rad/s."""
    path = write(tmp_path / "a.h5", imu__acc=FORCE / 9.80665, imu__gyr=np.degrees(RATE))
    with h5py.File(path, "r+") as file:
        file.attrs["sampling_rate"] = 128.0
        file["imu/acc"].attrs["units"] = "g"
        file["imu/gyr"].attrs["Units"] = [b"deg/s", b"deg/s", b"deg/s"]
    recording = read_recording(path)
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("g", "deg/s")
    assert recording.rate == 128.0
    with h5py.File(path, "r+") as file:
        file["imu/acc"].attrs["units"] = "m/s^2"
    with pytest.raises(RecordingError, match=r"in the declared m/s\^2 is 0\.1\d* times gravity"):
        read_recording(path)


def test_an_attribute_with_an_unknown_unit_is_said(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h5", imu__t=TIME, imu__acc=FORCE, imu__gyr=RATE)
    with h5py.File(path, "r+") as file:
        file["imu/gyr"].attrs["unit"] = "furlong"
    said = " ".join(r.text for r in read_recording(path).remarks)
    assert "the unit 'furlong' of 'gyr_x [furlong]' is no known unit of angular rate" in said


FIELD = np.array([18.0, -4.0, -43.0]) + 0.3 * RNG.normal(size=(75, 3))
SLOW = TIME[::4] + 0.001


@pytest.mark.parametrize("merged", [True, False])
def test_a_magnetometer_in_a_group_of_its_own_keeps_its_stamps(tmp_path: Path, merged: bool) -> None:
    groups = (
        {"acc__t": TIME, "acc__acc": FORCE, "gyr__t": TIME, "gyr__gyr": RATE}
        if merged
        else {"imu__t": TIME, "imu__acc": FORCE, "imu__gyr": RATE}
    )
    path = write(tmp_path / "a.h5", mag__t=SLOW, mag__mag=FIELD, **groups)
    recording = read_recording(path, units="m/s^2,rad/s,uT")
    assert np.array_equal(recording.specific_force, FORCE)
    assert recording.magnetic_field is not None
    assert np.array_equal(recording.magnetic_field.values, FIELD)
    np.testing.assert_allclose(recording.magnetic_field.time, SLOW, rtol=1e-12)
    named = read_recording(
        path, units="m/s^2,rad/s,uT", topics=["gyr", "mag", "acc"] if merged else ["imu", "mag"]
    )
    assert named.magnetic_field is not None
    assert np.array_equal(named.magnetic_field.values, FIELD)


@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_arrays_of_another_length_are_the_magnetometer_s_if_named_so(tmp_path: Path, unit: float) -> None:
    arrays = {"t": unit * TIME, "acc": FORCE, "gyr": RATE, "t_mag": unit * SLOW, "mag": FIELD}
    np.savez(tmp_path / "a.npz", **arrays)
    recording = read_recording(tmp_path / "a.npz", units="m/s^2,rad/s")
    assert recording.magnetic_field is not None
    assert recording.magnetic_field.unit == "uT"
    assert np.array_equal(recording.magnetic_field.values, FIELD)
    np.testing.assert_allclose(recording.magnetic_field.time, SLOW, rtol=1e-9)
