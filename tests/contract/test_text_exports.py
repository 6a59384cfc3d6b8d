"""Vendors' text exports and increments: their names, units, clocks and checksums; what is no such thing is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.errors import RecordingError
from tumble.recording import read_recording
from tumble.recording.formats import find_format

RNG = np.random.default_rng(12)
COUNT = 600
FORCE = np.round(np.array([0.3, -0.5, 9.7]) + 0.02 * RNG.normal(size=(COUNT, 3)), 6)
RATE = np.round(np.array([0.01, -0.02, 0.005]) + 0.002 * RNG.normal(size=(COUNT, 3)), 6)
TIME = np.arange(COUNT) / 100


def texts(recording: Any) -> str:
    return " ".join(r.text for r in recording.remarks)


def table(*columns: Any, delimiter: str = "\t") -> str:
    """Rows of columns: arrays, or texts that stand in every row."""
    rows = zip(*([c] * COUNT if isinstance(c, str) else np.asarray(c).tolist() for c in columns), strict=True)
    return "\n".join(delimiter.join(c if isinstance(c, str) else repr(c) for c in row) for row in rows) + "\n"


# -- Xsens and Movella -------------------------------------------------------------------------------

TRIADS = "Acc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"


def test_mt_manager_s_clock_ticks_every_tenth_of_a_millisecond(tmp_path: Path) -> None:
    """Columns that are empty throughout are between tabs and no alignment."""
    head = f"// Update Rate: 100.0Hz\nPacketCounter\tSampleTimeFine\tYear\tMonth\t{TRIADS}\n"
    counter = np.arange(COUNT)
    body = table(counter + 51_400, 100 * counter + 7000, "", "", *FORCE.T, *RATE.T)
    (tmp_path / "a.txt").write_text(head + body)
    recording = read_recording(tmp_path / "a.txt")
    assert find_format(tmp_path / "a.txt").name == "Xsens text"
    np.testing.assert_allclose(recording.time, TIME + 0.7, atol=1e-12)
    assert np.array_equal(recording.specific_force, FORCE)
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")


def test_an_mtw_has_no_clock_and_the_rate_is_asked_for(tmp_path: Path) -> None:
    head = f"// Coordinate system: ENU\nPacketCounter\tSampleTimeFine\tYear\t{TRIADS}\n"
    (tmp_path / "a.txt").write_text(head + table(np.arange(COUNT), "NaN", "NaN", *FORCE.T, *RATE.T))
    with pytest.raises(
        RecordingError, match=r"no column of time stamps; give the sampling rate with --rate HZ"
    ):
        read_recording(tmp_path / "a.txt")
    assert np.array_equal(read_recording(tmp_path / "a.txt", rate=100.0).angular_rate, RATE)


def test_the_rate_of_the_header_stands_in_for_a_clock(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(
        f"// Update Rate: 100.0Hz\nPacketCounter\t{TRIADS}\n" + table(np.arange(COUNT), *FORCE.T, *RATE.T)
    )
    recording = read_recording(tmp_path / "a.txt")
    assert recording.rate == 100.0
    assert "its header says 100 Hz" in texts(recording)


def test_a_dot_counts_microseconds_and_degrees(tmp_path: Path) -> None:
    """Its clock wraps after 71 minutes."""
    head = "sep=,\nDeviceTag:,Movella DOT\nOutputRate:,60Hz\n\nPacketCounter,SampleTimeFine,"
    head += TRIADS.replace("\t", ",") + "\n"
    stamps = (4_294_000_000 + 16_667 * np.arange(COUNT)) % 2**32
    body = table(np.arange(COUNT), stamps, *FORCE.T, *np.degrees(RATE).T, delimiter=",")
    (tmp_path / "a.csv").write_text(head + body)
    recording = read_recording(tmp_path / "a.csv")
    assert recording.angular_rate_unit == "deg/s"
    np.testing.assert_allclose(np.diff(recording.time), 0.016667, rtol=1e-6)
    assert "wraps 1 time(s)" in texts(recording)


def test_increments_of_orientation_are_quaternions(tmp_path: Path) -> None:
    """The quaternion of a turn by v has the vector part sin(v/2) v/|v|; turned in sign it is the same turn."""
    turn = 0.01 * RATE
    half = np.linalg.norm(turn, axis=1) / 2.0
    quaternion = np.column_stack([np.cos(half), turn * (np.sin(half) / (2.0 * half))[:, None]])
    quaternion[::2] *= -1.0
    head = "PacketCounter\tSampleTimeFine\tVelInc_X\tVelInc_Y\tVelInc_Z\t"
    head += "\t".join(f"OriInc_q{i}" for i in range(4)) + "\n"
    body = table(np.arange(COUNT), 100 * np.arange(COUNT), *(0.01 * FORCE).T, *quaternion.T)
    (tmp_path / "a.txt").write_text(head + body)
    recording = read_recording(tmp_path / "a.txt")
    # Rounding of a quaternion near one, 1e-16, over an interval of 0.01 s.
    np.testing.assert_allclose(recording.angular_rate, RATE, rtol=0, atol=1e-13)
    np.testing.assert_allclose(recording.specific_force, FORCE, rtol=1e-14)


# -- SBG ---------------------------------------------------------------------------------------------


def test_sbg_s_row_of_units_is_understood(tmp_path: Path) -> None:
    head = "timestamp\tstatus\taccelX\taccelY\taccelZ\tgyroX\tgyroY\tgyroZ\ttemperature\n"
    head += "(us)\t(na)\t(m.s^-2)\t(m.s^-2)\t(m.s^-2)\t(deg.s^-1)\t(deg.s^-1)\t(deg.s^-1)\t(degC)\n"
    body = table(
        10_000 * np.arange(COUNT), "0x000003ff", *FORCE.T, *np.degrees(RATE).T, np.full(COUNT, 31.25)
    )
    (tmp_path / "imuData.txt").write_text(head + body)
    recording = read_recording(tmp_path / "imuData.txt")
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

    with (tmp_path / "imu.mat").open("wb") as file:
        savemat(file, {"imu": {"t": TIME[:, None], "fb": FORCE, "wb": RATE, "freq": 100.0}})
    recording = read_recording(tmp_path / "imu.mat")
    assert np.array_equal(recording.specific_force, FORCE)
    assert np.array_equal(recording.angular_rate, RATE)


# -- magnetometers -----------------------------------------------------------------------------------

FIELD = np.round(np.array([0.21, -0.04, 0.44]) + 0.003 * RNG.normal(size=(COUNT, 3)), 4)  # gauss


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
def test_vectornav_s_sentences_have_the_magnetometer_first(
    tmp_path: Path, kind: str, before: list[float], after: list[float], stamped: bool
) -> None:
    lines = []
    for t, m, f, w in zip(TIME.tolist(), FIELD.tolist(), FORCE.tolist(), RATE.tolist(), strict=True):
        cells = ",".join(f"{number:+.6f}" for number in (*before, *m, *f, *w, *after))
        lines.append((f"{t:.3f}," if stamped else "") + summed(f"${kind},{cells}"))
    path = tmp_path / "a.txt"
    path.write_text("\r\n".join(lines) + "\r\n")
    recording = read_recording(path, rate=None if stamped else 100)
    assert np.array_equal(recording.specific_force, FORCE)
    assert np.array_equal(recording.angular_rate, RATE)
    assert recording.magnetic_field is not None
    assert recording.magnetic_field.unit == "gauss"
    assert np.array_equal(recording.magnetic_field.values, FIELD)
    assert len(recording) == COUNT


def test_an_xsens_magnetometer_is_in_units_of_the_local_field(tmp_path: Path) -> None:
    header = f"PacketCounter\tSampleTimeFine\t{TRIADS}\tMag_X\tMag_Y\tMag_Z\n"
    body = table(np.arange(COUNT), (TIME * 1e4).astype(int), *FORCE.T, *RATE.T, *FIELD.T)
    (tmp_path / "a.txt").write_text(header + body)
    recording = read_recording(tmp_path / "a.txt")
    assert recording.magnetic_field is not None
    assert recording.magnetic_field.unit == "counts"
    assert np.array_equal(recording.magnetic_field.values, FIELD)
