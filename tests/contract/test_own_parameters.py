"""An autopilot's own parameters in its log: found as its libraries find them, said, and never replaced silently."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.document.imported import calibration_from_model
from tumble.document.magnetometer_block import MagnetometerBlock
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.recording import read_recording
from tumble.recording.formats.logs.own_parameters import (
    active,
    active_on_field,
    field_identity_of,
    parameters_of,
)
from tumble.sensor import ImuModel, Triad
from tumble.workflows.apply import apply
from tumble.workflows.calibrate import corrected_by_before
from tumble.workflows.convert import convert_to
from tumble.workflows.corrected.corrections import corrections_of
from tumble.workflows.magnetometer import with_own_parameters

RNG = np.random.default_rng(2)
STAMPS = 1_000_000 + 4000 * np.arange(300)
FORCE = (np.array([0.3, -0.4, 9.75]) + 0.02 * RNG.normal(size=(300, 3))).astype(np.float32)
RATE = (0.002 * RNG.normal(size=(300, 3))).astype(np.float32)
PX4 = {
    "CAL_ACC0_ID": 1310988,
    "CAL_ACC0_XOFF": 0.12,
    "CAL_ACC0_ZSCALE": 1.004,
    "CAL_GYRO0_YOFF": -0.02,
    "MAV_TYPE": 2,
}
DEFAULTS = {
    "CAL_ACC0_ID": 1310988,
    "CAL_ACC0_XOFF": 0.0,
    "CAL_ACC0_ZSCALE": 1.0,
    "CAL_GYRO0_YOFF": 0.0,
    "MAV_TYPE": 2,
}
ARDUPILOT = {
    "INS_ACCOFFS_X": 0.21,
    "INS_ACCSCAL_Y": 0.997,
    "INS_GYROFFS_Z": 0.01,
    "INS_ACC_ID": 2753028.0,
    "LOG_DISARMED": 1.0,
}
NOTHING = {"INS_ACCOFFS_X": 0.0, "INS_ACCSCAL_Y": 1.0, "INS_GYROFFS_Z": 0.0, "INS_ACC2SCAL_X": 0.0}


def part(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<H", len(body)) + kind + body


def parameter(name: str, value: float) -> bytes:
    whole = isinstance(value, int)
    key = f"{'int32_t' if whole else 'float'} {name}".encode()
    return part(b"P", bytes([len(key)]) + key + struct.pack("<i" if whole else "<f", value))


def ulog(
    path: Path, parameters: dict[str, float], *, raw: bool = False, later: dict[str, float] | None = None
) -> Path:
    names = ("sensor_accel", "sensor_gyro") if raw else ("sensor_combined",)
    fields = (
        "uint64_t timestamp_sample;float x;float y;float z;float temperature;"
        if raw
        else "float[3] gyro_rad;int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    )
    parts = [b"ULog\x01\x12\x35\x01" + bytes(8), part(b"B", bytes(40))]
    parts += [part(b"F", f"{name}:uint64_t timestamp;{fields}".encode()) for name in names]
    parts += [parameter(*pair) for pair in parameters.items()]
    for number, name in enumerate(names):
        parts.append(part(b"A", struct.pack("<BH", 0, number) + name.encode()))
        parts += [parameter(*pair) for pair in (later or {}).items()]
        for t, f, w in zip(STAMPS.tolist(), FORCE, RATE, strict=True):
            values = (f, w)[number]
            row = struct.pack("<QQ4f", t, t, *values, 30.0) if raw else struct.pack("<Q3fi3f", t, *w, 0, *f)
            parts.append(part(b"D", struct.pack("<H", number) + row))
    path.write_bytes(b"".join(parts))
    return path


def described(kind: int, length: int, name: bytes, form: bytes, labels: bytes) -> bytes:
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, form, labels)


def dataflash(path: Path, parameters: dict[str, float], *, default: bool = True) -> Path:
    labels = b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"
    form, more = (b"QNff", b",Default") if default else (b"QNf", b"")
    length = 3 + 8 + 16 + 4 * (2 if default else 1)
    parts = [described(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")]
    parts += [
        described(9, 36, b"IMU", b"QBffffff", labels),
        described(64, length, b"PARM", form, b"TimeUS,Name,Value" + more),
    ]
    for name, value in parameters.items():
        row = struct.pack("<Q16sf", 900, name.encode(), value) + (struct.pack("<f", 7.0) if default else b"")
        parts.append(b"\xa3\x95\x40" + row)
    for t, f, w in zip(STAMPS.tolist(), FORCE, RATE, strict=True):
        parts.append(b"\xa3\x95\x09" + struct.pack("<QB6f", t, 0, *w, *f))
    path.write_bytes(b"".join(parts))
    return path


def texts(recording: Any) -> str:
    return " ".join(r.text for r in recording.remarks)


def document(before: tuple[str, ...] = ()) -> Calibration:
    model = ImuModel(
        Triad(np.diag([1.01, 0.99, 1.005]), np.array([0.1, 0.2, -0.3])), Triad(np.eye(3), np.full(3, 0.01))
    )
    made = calibration_from_model(
        model, ("m/s^2", "rad/s"), ("fixture", "axes"), [], procedure="by hand", remarks=[]
    )
    return made.model_copy(update={"input_corrected_by": list(before)})


def test_parameters_of_a_ulog_are_those_that_pyulog_finds(tmp_path: Path) -> None:
    pyulog = pytest.importorskip("pyulog", reason="the extra px4 is not installed")
    path = ulog(tmp_path / "a.ulg", PX4, later={"CAL_ACC0_XOFF": 9.0})
    theirs = pyulog.ULog(str(path)).initial_parameters
    assert parameters_of(path) == {n: float(v) for n, v in theirs.items() if n.startswith("CAL_")}
    assert set(active(parameters_of(path))) == {"CAL_ACC0_XOFF", "CAL_ACC0_ZSCALE", "CAL_GYRO0_YOFF"}


@pytest.mark.parametrize("default", [True, False])
def test_parameters_of_a_dataflash_log_are_those_that_pymavlink_finds(tmp_path: Path, default: bool) -> None:
    reader = pytest.importorskip("pymavlink.DFReader", reason="pymavlink is not installed")
    path = dataflash(tmp_path / "a.bin", ARDUPILOT, default=default)
    log = reader.DFReader_binary(str(path))
    while log.recv_match(type="PARM"):
        pass
    assert parameters_of(path) == {n: v for n, v in log.params.items() if n.startswith("INS_")}
    log.close()


def logs(folder: Path) -> list[tuple[Path, Path, str]]:
    """A log with active parameters, one without, and what the first one says."""
    pytest.importorskip("pyulog", reason="the extra px4 is not installed")
    return [
        (ulog(folder / "a.ulg", PX4), ulog(folder / "b.ulg", DEFAULTS), "CAL_ACC0_XOFF = 0.12"),
        (
            dataflash(folder / "a.bin", ARDUPILOT),
            dataflash(folder / "b.bin", NOTHING),
            "INS_ACCOFFS_X = 0.21",
        ),
    ]


def test_active_parameters_are_said_with_their_device_and_noted(tmp_path: Path) -> None:
    for path, plain, words in logs(tmp_path):
        said = texts(read_recording(path))
        assert words in said
        assert "holds on top of them" in said
        assert "devices CAL_ACC0_ID = 1310988" in said or "devices INS_ACC_ID = 2753028" in said
        (remark,) = [r for r in read_recording(path).remarks if words in r.text]
        assert remark.kind == "corrected"
        assert "parameters were active" not in texts(read_recording(plain))
        (mark,) = corrections_of([path])
        assert corrected_by_before([path], None) == [mark]
        assert corrections_of([plain]) == ()


def test_a_log_that_lacks_its_parameters_is_said_to_unasked_and_by_the_conversion(tmp_path: Path) -> None:
    recording = read_recording(dataflash(tmp_path / "a.bin", {}))
    (remark,) = [r for r in recording.remarks if r.kind == "corrected"]
    assert "does not state the autopilot's own parameters" in remark.text
    plain = read_recording(dataflash(tmp_path / "b.bin", NOTHING))
    assert not [r for r in plain.remarks if r.kind == "corrected"]
    for remarks, words in (([remark.text], 1), ([r.text for r in plain.remarks], 0)):
        made = document().model_copy(update={"remarks": remarks})
        done = convert_to(made, "ardupilot", output=tmp_path / "out", largest_loss=0.1)
        assert sum("had their defaults while it was recorded" in text for text in done.remarks) == words


def test_raw_sensors_of_px4_are_not_touched_by_its_parameters(tmp_path: Path) -> None:
    pytest.importorskip("pyulog", reason="the extra px4 is not installed")
    path = ulog(tmp_path / "a.ulg", PX4, raw=True)
    assert "parameters were active" not in texts(read_recording(path))
    assert corrections_of([path]) == ()


def test_other_parameters_are_another_mark(tmp_path: Path) -> None:
    one = corrections_of([dataflash(tmp_path / "a.bin", ARDUPILOT)])
    again = corrections_of([dataflash(tmp_path / "b.bin", {**ARDUPILOT, "LOG_DISARMED": 0.0})])
    other = corrections_of([dataflash(tmp_path / "c.bin", {**ARDUPILOT, "INS_ACCOFFS_X": 0.22})])
    assert one == again
    assert one != other


def test_a_calibration_on_top_of_parameters_takes_only_recordings_with_them(tmp_path: Path) -> None:
    path, plain = dataflash(tmp_path / "a.bin", ARDUPILOT), dataflash(tmp_path / "b.bin", NOTHING)
    on_top = document(corrections_of([path]))
    assert apply(on_top, path, output=tmp_path / "a.csv").samples == 300
    assert apply(document(), plain, output=tmp_path / "b.csv").samples == 300
    with pytest.raises(UsageError, match="and this recording is not"):
        apply(on_top, plain, output=tmp_path / "c.csv")
    with pytest.raises(UsageError, match="was corrected by another calibration"):
        apply(document(), path, output=tmp_path / "c.csv")


@pytest.mark.parametrize("target", ["px4", "ardupilot"])
def test_the_autopilot_s_own_numbers_are_not_replaced(tmp_path: Path, target: str) -> None:
    on_top = document(("0123456789ab",))
    with pytest.raises(UsageError, match=r"corrected before \(0123456789ab\).*put it in their place"):
        convert_to(on_top, target, output=tmp_path / "out", largest_loss=0.1)
    assert not (tmp_path / "out").exists()
    assert convert_to(document(), target, output=tmp_path / "out", largest_loss=0.1).files


COMPASS = {"COMPASS_OFS_X": -41.0, "COMPASS_DIA2_Y": 1.02, "COMPASS_ODI_Z": 0.01, "COMPASS_DEV_ID": 97539.0}


def test_an_autopilots_own_compass_parameters_are_not_replaced(tmp_path: Path) -> None:
    path = dataflash(tmp_path / "a.bin", COMPASS)
    assert active_on_field(parameters_of(path)) == pytest.approx(
        {"COMPASS_OFS_X": -41.0, "COMPASS_DIA2_Y": 1.02, "COMPASS_ODI_Z": 0.01}
    )
    said = texts(read_recording(path))
    assert "COMPASS_OFS_X = -41" in said
    assert "COMPASS_DEV_ID = 97539" in said
    # The other triads are as the sensors gave them.
    assert corrections_of([path]) == ()
    (mark,) = field_identity_of(path)
    assert field_identity_of(dataflash(tmp_path / "b.bin", {**COMPASS, "COMPASS_ODI_Z": 0.02})) != (mark,)
    defaults = {"COMPASS_OFS_X": 0.0, "COMPASS_DIA2_Y": 1.0, "COMPASS_DEV_ID": 97539.0}
    plain = dataflash(tmp_path / "c.bin", defaults)
    assert field_identity_of(plain) == ()
    block = MagnetometerBlock(
        raw_unit="mgauss",
        unit="T",
        frame="b",
        method="holds and turns",
        matrix=((1.01e7, 1e5, -2e5), (1e5, 0.99e7, 3e5), (-2e5, 3e5, 1.02e7)),
        bias=(12.0, -30.0, 7.0),
    )
    made = document().model_copy(update={"magnetometer": block})
    on_top = with_own_parameters(made, [path])
    assert on_top.magnetometer is not None
    assert on_top.magnetometer.input_corrected_by == [mark]
    assert with_own_parameters(made, [plain]) is made
    for one, written in ((made, True), (on_top, False)):
        found = convert_to(one, "ardupilot", output=tmp_path / "out", largest_loss=0.1)
        text = "".join(file.read_text("utf-8") for file in found.files)
        assert ("COMPASS_OFS_X" in text) == written
        assert any("on top of the autopilot's own parameters" in r for r in found.remarks) != written


def test_a_log_that_is_cut_anywhere_has_the_parameters_that_are_whole(tmp_path: Path) -> None:
    for path in (ulog(tmp_path / "a.ulg", PX4), dataflash(tmp_path / "a.bin", ARDUPILOT)):
        whole, data = parameters_of(path), path.read_bytes()
        for size in range(8, 700, 13):
            path.write_bytes(data[:size])
            assert parameters_of(path).items() <= whole.items()
