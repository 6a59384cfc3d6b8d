"""Vendors' text exports and increments: their names, units, clocks and checksums; what is no such thing is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError
from tumble.recording import find_format, read_recording

RNG = np.random.default_rng(12)
COUNT = 600
K = np.arange(COUNT)
FORCE = np.round(np.array([0.3, -0.5, 9.7]) + 0.02 * RNG.normal(size=(COUNT, 3)), 6)
RATE = np.round(np.array([0.01, -0.02, 0.005]) + 0.002 * RNG.normal(size=(COUNT, 3)), 6)
DEGREES = np.degrees(RATE)
FIELD = np.round(np.array([0.21, -0.04, 0.44]) + 0.003 * RNG.normal(size=(COUNT, 3)), 4)  # gauss
TIME = K / 100


def written(folder: Path, head: str, *columns: Any, delimiter: str = "\t", name: str = "a.txt") -> Path:
    """A head, then rows of columns: arrays, or texts that stand in every row."""
    cells = ([c] * COUNT if isinstance(c, str) else np.asarray(c).tolist() for c in columns)
    rows = (delimiter.join(map(str, row)) for row in zip(*cells, strict=True))
    (folder / name).write_text(head + "\n".join(rows) + "\n")
    return folder / name


# -- Xsens and Movella -------------------------------------------------------------------------------

TRIADS = "Acc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"


def test_mt_manager_s_clock_ticks_every_tenth_of_a_millisecond(tmp_path: Path) -> None:
    """Columns that are empty throughout are between tabs and no alignment; the magnetometer is in local fields."""
    head = f"// Update Rate: 100.0Hz\nPacketCounter\tSampleTimeFine\tYear\tMonth\t{TRIADS}\tMag_X\tMag_Y\tMag_Z\n"
    path = written(tmp_path, head, K + 51_400, 100 * K + 7000, "", "", *FORCE.T, *RATE.T, *FIELD.T)
    recording = read_recording(path)
    assert find_format(path).name == "Xsens text"
    np.testing.assert_allclose(recording.time, TIME + 0.7, atol=1e-12)
    assert np.array_equal(recording.specific_force, FORCE)
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")
    assert recording.magnetic_field.unit == "counts"
    assert np.array_equal(recording.magnetic_field.values, FIELD)


def test_without_a_clock_the_rate_is_that_of_the_header_or_is_asked_for(tmp_path: Path) -> None:
    """An MTw has none."""
    head = f"// Coordinate system: ENU\nPacketCounter\tSampleTimeFine\tYear\t{TRIADS}\n"
    path = written(tmp_path, head, K, "NaN", "NaN", *FORCE.T, *RATE.T)
    with pytest.raises(
        RecordingError, match=r"no column of time stamps; give the sampling rate with --rate HZ"
    ):
        read_recording(path)
    assert np.array_equal(read_recording(path, rate=100.0).angular_rate, RATE)
    head = f"// Update Rate: 100.0Hz\nPacketCounter\t{TRIADS}\n"
    recording = read_recording(written(tmp_path, head, K, *FORCE.T, *RATE.T))
    assert recording.rate == 100.0
    assert "its header says 100 Hz" in said(recording)


def test_a_dot_counts_microseconds_and_degrees(tmp_path: Path) -> None:
    """Its clock wraps after 71 minutes."""
    head = "sep=,\nDeviceTag:,Movella DOT\nOutputRate:,60Hz\n\nPacketCounter,SampleTimeFine,"
    head += TRIADS.replace("\t", ",") + "\n"
    stamps = (4_294_000_000 + 16_667 * K) % 2**32
    path = written(tmp_path, head, K, stamps, *FORCE.T, *DEGREES.T, delimiter=",", name="a.csv")
    recording = read_recording(path)
    assert recording.angular_rate_unit == "deg/s"
    np.testing.assert_allclose(np.diff(recording.time), 0.016667, rtol=1e-6)
    assert "wraps 1 time(s)" in said(recording)


def test_increments_of_orientation_are_quaternions(tmp_path: Path) -> None:
    """The quaternion of a turn by v has the vector part sin(v/2) v/|v|; turned in sign it is the same turn."""
    turn = 0.01 * RATE
    half = np.linalg.norm(turn, axis=1) / 2.0
    quaternion = np.column_stack([np.cos(half), turn * (np.sin(half) / (2.0 * half))[:, None]])
    quaternion[::2] *= -1.0
    names = [*(f"VelInc_{axis}" for axis in "XYZ"), *(f"OriInc_q{i}" for i in range(4))]
    head = "\t".join(["PacketCounter", "SampleTimeFine", *names]) + "\n"
    recording = read_recording(written(tmp_path, head, K, 100 * K, *(0.01 * FORCE).T, *quaternion.T))
    # Rounding of a quaternion near one, 1e-16, over an interval of 0.01 s.
    np.testing.assert_allclose(recording.angular_rate, RATE, rtol=0, atol=1e-13)
    np.testing.assert_allclose(recording.specific_force, FORCE, rtol=1e-14)


def test_sbg_s_row_of_units_is_understood(tmp_path: Path) -> None:
    head = "timestamp\tstatus\taccelX\taccelY\taccelZ\tgyroX\tgyroY\tgyroZ\ttemperature\n"
    head += "(us)\t(na)" + 3 * "\t(m.s^-2)" + 3 * "\t(deg.s^-1)" + "\t(degC)\n"
    columns = 10_000 * K, "0x000003ff", *FORCE.T, *DEGREES.T, np.full(COUNT, 31.25)
    recording = read_recording(written(tmp_path, head, *columns))
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "deg/s")
    assert np.array_equal(recording.specific_force, FORCE)
    np.testing.assert_allclose(recording.time, TIME, atol=1e-12)
    assert np.all(recording.temperature == 31.25)


# -- increments --------------------------------------------------------------------------------------

KF_GINS = np.column_stack([456_300 + TIME, 0.01 * RATE, 0.01 * FORCE])  # time, angles, velocities
PSINS = np.column_stack([0.01 * RATE, 0.01 * FORCE, TIME + 0.01])  # angles, velocities, time


@pytest.mark.parametrize("rows", [KF_GINS, PSINS], ids=["KF-GINS", "PSINS"])
def test_increments_become_rates_when_they_are_declared(tmp_path: Path, rows: np.ndarray) -> None:
    path = tmp_path / "imu.data"
    np.savetxt(path, rows, fmt="%.17g")
    with pytest.raises(RecordingError, match=r"look like velocity increments .* give --units m/s,rad"):
        read_recording(path)
    recording = read_recording(path, units="m/s,rad")
    # The rate is that of the stamps: 456,300 s leave eleven digits of an interval of 0.01 s.
    np.testing.assert_allclose(recording.specific_force, FORCE, rtol=1e-10)
    np.testing.assert_allclose(recording.angular_rate, RATE, rtol=1e-10)


def test_navego_s_struct_has_its_names(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "imu.mat", {"imu": {"t": TIME[:, None], "fb": FORCE, "wb": RATE, "freq": 100.0}})
    recording = read_recording(tmp_path / "imu.mat")
    assert np.array_equal(recording.specific_force, FORCE)
    assert np.array_equal(recording.angular_rate, RATE)


def summed(line: str) -> str:
    """A sentence with its checksum: the exclusive or of what stands between $ and *."""
    total = 0
    for letter in line[1:].encode():
        total ^= letter
    return f"{line}*{total:02X}"


@pytest.mark.parametrize(
    ("kind", "before", "after", "stamped"),
    [
        ("VNIMU", [], [25.1, 101.3], True),
        ("VNYMR", [1.0, 2.0, 3.0], [], False),
        ("VNQMR", [0.0, 0, 0, 1], [], True),
        ("VNMAR", [], [], False),
    ],
)
def test_vectornav_s_sentences_have_the_magnetometer_first(tmp_path, kind, before, after, stamped) -> None:
    rows = np.hstack([FIELD, FORCE, RATE]).tolist()
    cells = (",".join(f"{number:+.6f}" for number in (*before, *row, *after)) for row in rows)
    lines = [
        (f"{t:.3f}," if stamped else "") + summed(f"${kind},{c}") for t, c in zip(TIME, cells, strict=True)
    ]
    (tmp_path / "a.txt").write_text("\r\n".join(lines) + "\r\n")
    recording = read_recording(tmp_path / "a.txt", rate=None if stamped else 100)
    assert np.array_equal(recording.specific_force, FORCE)
    assert np.array_equal(recording.angular_rate, RATE)
    assert recording.magnetic_field.unit == "gauss"
    assert np.array_equal(recording.magnetic_field.values, FIELD)
