"""An autopilot's own parameters in its log are undone: one motion logged with and without them is one recording."""

import re
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from scipy.spatial.transform import Rotation
from tests.unit.export import a_unit
from tests.unit.export.a_unit import TURNS, Parameters, parameters, symmetric
from tests.unit.recording.by_hand import said

from contract.test_flight_logs import FMT, described, ulog_part
from tumble.document import Calibration
from tumble.earth import Site
from tumble.errors import RecordingError, UsageError
from tumble.recording import Recording, inspect_recording, read_recording
from tumble.sensor import ImuModel, Triad
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording
from tumble.workflows import calibrate, convert_to

RNG = np.random.default_rng(2)
STAMPS = 1_000_000 + 4000 * np.arange(300)  # µs
FORCE = np.array([0.3, -0.4, 9.75]) + 3.0 * RNG.normal(size=(300, 3))
RATE = 0.2 * RNG.normal(size=(300, 3))
FIELD = np.array([210.0, -30.0, 430.0]) + 40.0 * RNG.normal(size=(300, 3))  # mgauss
CELSIUS = 24.0 + 0.05 * np.arange(300)
SITE = Site.from_gravity(9.81)
Signals = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

PX4: Parameters = {
    "CAL_ACC0_ID": 77, "CAL_ACC0_XOFF": 9.0, "CAL_ACC0_YOFF": 9.0, "CAL_ACC0_ZOFF": 9.0,
    "CAL_ACC1_ID": 1310988, "CAL_ACC1_XOFF": 0.12, "CAL_ACC1_YOFF": -0.3, "CAL_ACC1_ZOFF": 0.05,
    "CAL_ACC1_XSCALE": 1.02, "CAL_ACC1_YSCALE": 0.97, "CAL_ACC1_ZSCALE": 1.004,
    "CAL_GYRO0_ID": 2310988, "CAL_GYRO0_XOFF": 0.01, "CAL_GYRO0_YOFF": -0.02, "CAL_GYRO0_ZOFF": 0.003,
    "CAL_MAG0_ID": 97539, "CAL_MAG0_ROT": 6, "CAL_MAG0_XOFF": 0.05, "CAL_MAG0_YOFF": -0.02, "CAL_MAG0_ZOFF": 0.2,
    "CAL_MAG0_XSCALE": 1.1, "CAL_MAG0_YSCALE": 0.95, "CAL_MAG0_ZSCALE": 1.02,
    "CAL_MAG0_XODIAG": 0.02, "CAL_MAG0_YODIAG": -0.03, "CAL_MAG0_ZODIAG": 0.01,
    "SENS_BOARD_ROT": 2, "SENS_BOARD_X_OFF": 1.5, "SENS_BOARD_Y_OFF": -0.5, "SENS_BOARD_Z_OFF": 0.0, "MAV_TYPE": 2,
}  # fmt: skip
ARDUPILOT: Parameters = {
    "INS_ACC2OFFS_X": 0.21, "INS_ACC2OFFS_Y": -0.1, "INS_ACC2OFFS_Z": 0.4,
    "INS_ACC2SCAL_X": 1.01, "INS_ACC2SCAL_Y": 0.97, "INS_ACC2SCAL_Z": 1.03,
    "INS_GYR2OFFS_X": 0.01, "INS_GYR2OFFS_Y": -0.02, "INS_GYR2OFFS_Z": 0.03, "INS_ACCOFFS_X": 7.0,
    "COMPASS_OFS2_X": -41.0, "COMPASS_OFS2_Y": 12.0, "COMPASS_OFS2_Z": 88.0,
    "COMPASS_DIA2_X": 1.05, "COMPASS_DIA2_Y": 0.96, "COMPASS_DIA2_Z": 1.02,
    "COMPASS_ODI2_X": 0.02, "COMPASS_ODI2_Y": -0.03, "COMPASS_ODI2_Z": 0.01, "COMPASS_SCALE2": 1.1,
    "AHRS_ORIENTATION": 16, "LOG_DISARMED": 1,
}  # fmt: skip
HEATED: Parameters = {
    "INS_TCAL2_ENABLE": 1, "INS_TCAL2_TMIN": 20.0, "INS_TCAL2_TMAX": 33.0, "INS_ACC2_CALTEMP": 45.0,
    "INS_GYR2_CALTEMP": 22.0,
    **{f"INS_TCAL2_{k}{p}_{a}": s * (3.0 * p + i) * (9e3, 300.0, 12.0)[p - 1]
       for k, s in (("ACC", 1.0), ("GYR", -0.02)) for p in (1, 2, 3) for i, a in enumerate("XYZ")},
}  # fmt: skip


def at_defaults(parameters: Parameters) -> Parameters:
    """The same names as a drone has them that was never calibrated, its identities kept."""
    idle = {name: 1.0 if re.search("SCAL|DIA", name) and "ODIA" not in name else 0.0 for name in parameters}
    kept = {name: value for name, value in parameters.items() if name.endswith("_ID")}
    return idle | kept | {name: -1 for name in parameters if name.endswith("_ROT") and "CAL" in name}


def px4(kind: str, u: np.ndarray, p: Parameters, thermal: np.ndarray | float = 0.0) -> np.ndarray:
    """What PX4 makes of the numbers of its second accelerometer, and of its first gyro and compass."""
    return a_unit.px4(kind, u, p, thermal, number=1 if kind == "ACC" else 0)


ardupilot = partial(a_unit.ardupilot, number=2)


def parameter(name: str, value: float) -> bytes:
    whole = isinstance(value, int)
    key = f"{'int32_t' if whole else 'float'} {name}".encode()
    return ulog_part(b"P", bytes([len(key)]) + key + struct.pack("<i" if whole else "<f", value))


TEMPERED = [
    f"uint32_t[4] {k}_device_ids;" + "".join(f"float[3] {k}_offset_{n};" for n in range(4))
    for k in ("accel", "gyro")
]
LAYOUTS = {
    "sensor_combined": "float[3] gyro_rad;int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;",
    "vehicle_imu": "uint32_t accel_device_id;uint32_t gyro_device_id;float[3] delta_angle;float[3] delta_velocity;"
    "uint16_t delta_angle_dt;uint16_t delta_velocity_dt;",
    "sensor_accel": "uint64_t timestamp_sample;float x;float y;float z;float temperature;",
    "sensor_gyro": "uint64_t timestamp_sample;float x;float y;float z;float temperature;",
    "sensor_mag": "uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;",
    "vehicle_magnetometer": "uint64_t timestamp_sample;uint32_t device_id;float[3] magnetometer_ga;",
    "sensor_selection": "uint32_t accel_device_id;uint32_t gyro_device_id;",
    "sensor_correction": "".join(TEMPERED),
}


def ulog(
    path: Path,
    p: Parameters,
    *,
    message: str = "sensor_combined",
    later: Parameters | None = None,
    thermal: bool = False,
    selected: tuple[int, ...] = (1310988,),
    signals: Signals = (STAMPS, FORCE, RATE, FIELD),
) -> Path:
    """Write what PX4 logs of a motion; `later` are parameters that are set half way."""
    stamps, force, rate, field = signals
    half = len(stamps) // 2
    steps = np.where(
        np.arange(len(stamps))[:, None] < half, [[0.0] * 6], [[0.3, 0.2, -0.1, 0.02, 0.01, -0.03]]
    )
    steps = steps if thermal else 0.0 * steps
    now = [p, {**p, **(later or {})}]
    halves = slice(half), slice(half, None)
    f, w = (
        np.vstack([px4(kind, u[s], q, o[s]) for q, s in zip(now, halves, strict=True)])
        for kind, u, o in (("ACC", force, steps[:, :3]), ("GYRO", rate, steps[:, 3:]))
    )
    m = px4("MAG", 1e-3 * field, p)
    rows: dict[str, Callable[[int, int], bytes]] = {
        "sensor_combined": lambda i, t: struct.pack("<Q3fi3f", t, *w[i], 0, *f[i]),
        "vehicle_imu": lambda i, t: struct.pack(
            "<QII6fHH", t, 1310988, 2310988, *(w[i] * 0.004), *(f[i] * 0.004), 4000, 4000
        ),
        "vehicle_magnetometer": lambda i, t: struct.pack("<QQI3f", t, t, 97539, *m[i]),
        "sensor_mag": lambda i, t: struct.pack("<QQI3f", t, t, 97539, *(1e-3 * field[i])),
        "sensor_accel": lambda i, t: struct.pack("<QQ4f", t, t, *force[i], 30.0),
        "sensor_gyro": lambda i, t: struct.pack("<QQ4f", t, t, *rate[i], 30.0),
    }  # fmt: skip
    names = [n for n in LAYOUTS if n.startswith((message, "sensor_selection", "sensor_correction"))]
    names += ["vehicle_magnetometer"]
    parts = [b"ULog\x01\x12\x35\x01" + bytes(8), ulog_part(b"B", bytes(40))]
    parts += [ulog_part(b"F", f"{name}:uint64_t timestamp;{LAYOUTS[name]}".encode()) for name in names]
    parts += [parameter(*pair) for pair in p.items()]
    parts += [ulog_part(b"A", struct.pack("<BH", 0, n) + name.encode()) for n, name in enumerate(names)]

    def data(name: str, row: bytes) -> bytes:
        return ulog_part(b"D", struct.pack("<H", names.index(name)) + row)

    for device in selected:
        parts.append(data("sensor_selection", struct.pack("<QII", int(stamps[0]), device, 2310988)))
    for i in (0, half) if thermal else ():
        ids = struct.pack("<4I12f", 5, 1310988, 0, 0, *([0.0] * 3), *steps[i, :3], *([0.0] * 6))
        ids += struct.pack("<4I12f", 2310988, 0, 0, 0, *steps[i, 3:], *([0.0] * 9))
        parts.append(data("sensor_correction", struct.pack("<Q", int(stamps[i])) + ids))
    for i, t in enumerate(stamps.tolist()):
        # A parameter's change is stamped by the message before it.
        parts += [parameter(*pair) for pair in (later or {}).items()] if i == half else []
        parts += [data(name, rows[name](i, t)) for name in names if name in rows]
    path.write_bytes(b"".join(parts))
    return path


def dataflash(path, p, *, message="IMU", later=None, signals=(STAMPS, FORCE, RATE, FIELD)) -> Path:
    """Write what ArduPilot logs of a motion; `later` are parameters that are set half way."""
    stamps, force, rate, field = signals
    half = len(stamps) // 2
    celsius = np.resize(CELSIUS, len(stamps))
    halves = slice(half), slice(half, None)
    now = [p, {**p, **(later or {})}]
    f, w = (
        np.vstack([ardupilot(kind, u[s], q, celsius[s]) for q, s in zip(now, halves, strict=True)])
        for kind, u in (("ACC", force), ("GYR", rate))
    )
    m = ardupilot("MAG", field, p, celsius) + np.array([3.0, -2.0, 5.0])
    kinds = {
        "IMU": (9, b"QBfffffff", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T"),
        "ACC": (20, b"QBQfff", b"TimeUS,I,SampleUS,AccX,AccY,AccZ"),
        "GYR": (21, b"QBQfff", b"TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"),
        "IMT": (22, b"QBfffffffff", b"TimeUS,I,DelT,DelvT,DelaT,DelAX,DelAY,DelAZ,DelVX,DelVY,DelVZ"),
        "MAG": (30, b"QBffffff", b"TimeUS,I,MagX,MagY,MagZ,MOX,MOY,MOZ"),
        "PARM": (64, b"QNff", b"TimeUS,Name,Value,Default"),
    }
    rows: dict[str, Callable[[int, int], bytes]] = {
        "IMU": lambda i, t: struct.pack("<QB7f", t, 1, *w[i], *f[i], celsius[i]),
        "ACC": lambda i, t: struct.pack("<QBQ3f", t, 1, t, *f[i]),
        "GYR": lambda i, t: struct.pack("<QBQ3f", t, 1, t, *w[i]),
        "IMT": lambda i, t: struct.pack("<QB9f", t, 1, 0.25, 0.25, 0.5, *(w[i] / 2), *(f[i] / 4)),
        "MAG": lambda i, t: struct.pack("<QB6f", t, 1, *m[i], 3.0, -2.0, 5.0),
    }
    logged = ("MAG", *{"ACC": ("IMU", "ACC", "GYR"), "IMT": ("IMU", "IMT")}.get(message, ("IMU",)))

    def stated(t: int, some: Parameters) -> list[bytes]:
        return [b"\xa3\x95\x40" + struct.pack("<Q16sff", t, n.encode(), v, 7.0) for n, v in some.items()]

    parts = [FMT]
    for name, (number, form, labels) in kinds.items():
        length = 3 + struct.calcsize("<" + form.decode().replace("N", "16s"))
        parts.append(described(number, length, name.encode(), form, labels))
    parts += stated(900, p)
    for i, t in enumerate(stamps.tolist()):
        parts += stated(t - 1, later or {}) if i == half else []
        parts += [b"\xa3\x95" + bytes([kinds[name][0]]) + rows[name](i, t) for name in logged]
    path.write_bytes(b"".join(parts))
    return path


def assert_raw(recording: Recording, tolerance: float = 2e-6) -> None:
    """Both triads are what the sensors gave; logs are of single precision."""
    np.testing.assert_allclose(recording.specific_force, FORCE, atol=10.0 * tolerance)
    np.testing.assert_allclose(recording.angular_rate, RATE, atol=tolerance)


@pytest.fixture(autouse=True)
def _needs_pyulog(request: pytest.FixtureRequest) -> None:
    if "px4" in request.node.name:
        pytest.importorskip("pyulog", reason="the extra px4 is not installed")


LOGS = [(PX4, ("sensor_combined",)), (PX4, ("vehicle_imu",))]
for made in (ARDUPILOT, {**ARDUPILOT, **HEATED}):
    LOGS += [(made, ("IMU:1",)), (made, ("ACC:1", "GYR:1")), (made, ("IMT:1",))]


@pytest.mark.parametrize(("p", "topics"), LOGS, ids=["px4", "px4 increments", *"IAT", *"iat"])
def test_a_log_with_parameters_is_the_recording_without_them(tmp_path, p, topics) -> None:
    write, unit, off = (ulog, 1e-3, 2e-7) if p is PX4 else (dataflash, 1.0, 2e-4)
    for name, q in (("active", p), ("idle", at_defaults(p))):
        recording = read_recording(
            write(tmp_path / name, q, message=topics[0].partition(":")[0]), topics=topics
        )
        assert_raw(recording)
        np.testing.assert_allclose(recording.magnetic_field.values, unit * FIELD, atol=off)
        assert ("parameters are undone" in said(recording)) == (name == "active")
        assert p is not PX4 or not said(recording, "corrected")


def test_px4_thermal_offsets_are_those_that_the_log_says_were_applied(tmp_path: Path) -> None:
    p = {**PX4, "TC_A_ENABLE": 1, "TC_G_ENABLE": 1}
    assert_raw(read_recording(ulog(tmp_path / "a.ulg", p, thermal=True)))
    path = ulog(tmp_path / "b.ulg", p)
    with pytest.raises(RecordingError, match=r"by temperature \(TC_A_ENABLE\), and it lacks sensor_corr"):
        read_recording(path)


def test_parameters_that_change_in_a_log_hold_from_then_on_px4_and_ardupilot(tmp_path: Path) -> None:
    """Both find gyro offsets anew at rest, and store them."""
    later = {"CAL_GYRO0_XOFF": 0.05, "CAL_GYRO0_ZOFF": -0.04}
    recording = read_recording(ulog(tmp_path / "a.ulg", PX4, later=later))
    assert_raw(recording)
    assert "CAL_GYRO0_XOFF = 0.01, then 0.05" in said(recording)
    path = dataflash(tmp_path / "a.bin", ARDUPILOT, later={"INS_GYR2OFFS_Z": -0.07})
    first, last = (
        b"\xa3\x95\x40" + struct.pack("<Q16sff", STAMPS[150] - 1, b"INS_GYR2OFFS_Z", value, 7.0)
        for value in (5.0, -0.07)
    )
    recording = read_recording(changed(path, (last, first + last)))  # of two at one time the last holds
    assert_raw(recording)
    assert re.search("INS_GYR2OFFS_Z = 0.03, .*then -0.07", said(recording))


def test_parameters_are_said_with_their_values_px4_and_ardupilot(tmp_path: Path) -> None:
    logs = ulog(tmp_path / "a.ulg", PX4), dataflash(tmp_path / "a.bin", ARDUPILOT)
    told = "CAL_ACC1_XOFF = 0.12", "CAL_ACC1_YSCALE = 0.97", "CAL_GYRO0_YOFF = -0.02", "SENS_BOARD_ROT = 2"
    told += "INS_ACC2OFFS_X = 0.21", "INS_ACC2SCAL_Y = 0.97", "INS_GYR2OFFS_Z = 0.03", "AHRS_ORIENTATION = 16"
    for path, names, compass, another in (
        (logs[0], told[:4], "CAL_MAG0_ROT = 6", "CAL_ACC0"),
        (logs[1], told[4:], "COMPASS_OFS2_X = -41", "INS_ACCOFFS_X"),
    ):
        imu, field = (r.text for r in read_recording(path).remarks if r.kind == "mended")
        assert all(name in imu for name in names)
        assert compass in field
        assert another not in imu + field  # of another sensor


def test_px4_raw_sensors_are_not_touched(tmp_path: Path) -> None:
    recording = read_recording(
        ulog(tmp_path / "a.ulg", PX4, message="sensor_"), topics=["sensor_accel", "sensor_gyro"]
    )
    assert_raw(recording)
    assert "CAL_ACC" not in said(recording)


def test_what_cannot_be_undone_is_refused_px4_and_ardupilot(tmp_path: Path) -> None:
    board = (struct.pack("<16sf", b"AHRS_ORIENTATION", number) for number in (0.0, 101.0))
    scale = (b"CAL_ACC1_XSCALE" + struct.pack("<f", number) for number in (1.02, 0.0))
    two = ulog(tmp_path / "a", PX4, selected=(1310988, 77))
    turned = changed(dataflash(tmp_path / "b", at_defaults(ARDUPILOT)), tuple(board))
    for path, words in (
        (two, "does not state which of the sensors with CAL_ACCn_ID 77, 1310988"),
        (turned, "AHRS_ORIENTATION is 101, a rotation of its own"),
        (changed(ulog(tmp_path / "c", PX4), tuple(scale)), "scale factor of ACC in the log is 0"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_recording(path)


def test_what_a_log_does_not_state_is_said_by_its_names_px4_and_ardupilot(tmp_path: Path) -> None:
    lacking = ulog(tmp_path / "a.ulg", {}), dataflash(tmp_path / "a.bin", {})
    told = "CAL_ACC*, SENS_BOARD_*_OFF, SENS_BOARD_ROT", "AHRS_ORIENTATION, INS_ACC2SCAL_*, INS_ACC2OFFS_*"
    for path, names, gyro in zip(lacking, told, ("CAL_GYRO*", "INS_GYR2OFFS_*"), strict=True):
        recording = read_recording(path)
        remark = next(r.text for r in recording.remarks if r.kind == "corrected")
        assert f"does not state {names}, {gyro}," in remark
        assert "own axes" not in said(recording)  # vehicle_magnetometer's are those of the autopilot
        made = structs.replace(document(), remarks=[remark])
        done = convert_to(made, "ardupilot", output=tmp_path / "out", largest_loss=0.1)
        assert sum("had their defaults while it was recorded" in text for text in done.remarks) == 1


def changed(path: Path, *changes: tuple[bytes, bytes]) -> Path:
    """The log with some bytes of its parameters replaced."""
    for before, after in changes:
        assert before in path.read_bytes()
        path.write_bytes(path.read_bytes().replace(before, after))
    return path


def test_what_a_temperature_s_compensation_lacks_is_said(tmp_path: Path) -> None:
    on, off = (struct.pack("<16sf", b"INS_TCAL2_ENABLE", value) for value in (1.0, 0.0))
    path = changed(dataflash(tmp_path / "a.bin", {"INS_TCAL2_ENABLE": 0.0}), (off, on))
    told = said(read_recording(path))
    lacking = [f"INS_TCAL2_GYR{power}_*" for power in (1, 2, 3)]
    lacking += ["INS_TCAL2_TMIN", "INS_TCAL2_TMAX", "INS_GYR2_CALTEMP"]
    assert not [name for name in lacking if name not in told]


def test_a_sensor_without_a_curve_has_no_thermal_offset_in_px4(tmp_path: Path) -> None:
    path = ulog(tmp_path / "a.ulg", {**PX4, "TC_A_ENABLE": 1}, thermal=True)
    other = struct.pack("<4I", 5, 1310988, 0, 0), struct.pack("<4I", 5, 6, 0, 0)
    recording = read_recording(changed(path, other))
    applied = np.where(np.arange(300)[:, None] < 150, 0.0, [0.3, 0.2, -0.1])
    np.testing.assert_allclose(recording.specific_force, FORCE - applied, atol=2e-5)
    with pytest.raises(RecordingError, match="lacks sensor_correction with device_ids"):
        read_recording(changed(path, (b"accel_device_ids", b"accel_device_idz")))


def test_a_magnetometer_of_px4_that_cannot_be_undone_is_left_out_unless_it_is_asked_for(tmp_path) -> None:
    turned = (b"CAL_MAG0_ROT" + struct.pack("<i", number) for number in (6, 100))
    path = changed(ulog(tmp_path / "a.ulg", PX4), tuple(turned))
    recording = read_recording(path)
    assert_raw(recording)
    assert recording.magnetic_field is None
    assert "the magnetometer is left out. The log's CAL_MAG0_ROT is 100" in said(recording)
    with pytest.raises(RecordingError, match="CAL_MAG0_ROT is 100, a rotation of its own"):
        read_recording(path, topics=["sensor_combined", "vehicle_magnetometer"])


def held_in_many_poses(holds: int = 12) -> Signals:
    """Stamps, raw force and raw rate of a unit whose errors an autopilot's parameters can hold; the true field."""
    accelerometer = Triad(np.diag([1.02, 0.985, 1.01]), np.array([0.2, -0.15, 0.1]))
    model = ImuModel(accelerometer, Triad(np.eye(3), np.array([0.02, -0.01, 0.015])))
    rng = np.random.default_rng(4)
    order = rng.permutation(26)[:holds]
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, holds), [0.0, 0.0, 1.0]))
    motion = Motion.between_poses(headings * poses_26()[order], np.full(holds, 3.0), np.full(holds - 1, 2.0))
    grade = find_grade("consumer-mems")
    recording, _ = simulate_recording(motion, 50.0, rng, site=SITE, grade=grade, distort=model.distort)
    force, rate = (np.asarray(part) for part in (recording.specific_force, recording.angular_rate))
    field = motion.rotation_nb(recording.time).inv().apply([210.0, 30.0, 430.0])
    return np.round(recording.time * 1e6).astype(int), force, rate, field


@pytest.mark.parametrize("firmware", ["px4", "ardupilot"])
def test_a_calibrated_drone_gets_the_parameters_that_a_new_one_gets(tmp_path: Path, firmware: str) -> None:
    signals = held_in_many_poses()
    write, active = (ulog, PX4) if firmware == "px4" else (dataflash, ARDUPILOT)
    found: list[dict[str, float]] = []
    for name, p in (("active", active), ("idle", at_defaults(active))):
        run = calibrate(write(tmp_path / f"{name}.log", p, signals=signals), site=SITE)
        assert run.calibration.input_corrected_by == []
        target = tmp_path / f"{name}-{firmware}.txt"
        convert_to(run.calibration, firmware, output=target, largest_loss=0.1)
        found.append(parameters(target.read_text()))
    assert found[0] == pytest.approx(found[1], abs=2e-5)  # logs of single precision
    # Set into the firmware they correct the raw numbers: |f| is g at rest, and the gyros' offsets are gone.
    new, (stamps, force, rate, _) = found[0], signals
    if firmware == "px4":
        new = {name.replace("CAL_ACC0", "CAL_ACC1"): value for name, value in new.items()}
        f, w = px4("ACC", force, new), px4("GYRO", rate, new)
    else:
        new = {re.sub("(ACC|GYR)", r"\g<1>2", name): value for name, value in new.items()}
        f, w = (ardupilot(k, u, new) for k, u in (("ACC", force), ("GYR", rate)))
    for k in range(12):
        rest = (stamps > 1e6 * (5.0 * k + 0.5)) & (stamps < 1e6 * (5.0 * k + 2.5))
        assert np.linalg.norm(f[rest].mean(0)) == pytest.approx(9.81, abs=0.01)  # of 0.3 m/s² before
        assert np.abs(w[rest].mean(0)).max() < 1e-3  # of 0.02 rad/s before


@pytest.mark.parametrize("message", ["sensor_", "sensor_combined", "IMU"])
def test_a_turned_compass_of_px4_or_ardupilot_gets_numbers_that_are_right_in_its_firmware(tmp_path, message):
    """The compass stands in other axes than the IMU: PX4's by a rotation of its own, ArduPilot's by the board's."""
    stamps, force, rate, true = held_in_many_poses(18)
    soft, hard = symmetric(np.array([1.03, 0.98, 1.02]), np.array([0.02, -0.03, 0.01])), [40.0, -90.0, 25.0]
    level = Rotation.from_euler("ZYX", [0.0, -0.5, 1.5], degrees=True).as_matrix()
    board, own = (TURNS[16], np.eye(3)) if message == "IMU" else (level @ TURNS[2], level @ TURNS[6])
    raw = true @ board.T @ own @ soft + hard
    write, active, firmware = (dataflash, ARDUPILOT, "ardupilot") if message == "IMU" else (ulog, PX4, "px4")
    path = write(tmp_path / "a.log", active, message=message, signals=(stamps, force, rate, raw))
    run = calibrate(path, site=SITE, field=f"{1e-3 * np.linalg.norm(true[0]):.6f}gauss,63.7")
    told = convert_to(run.calibration, firmware, output=tmp_path / f"{firmware}.txt")
    new = parameters(told.files[0].read_text())
    if firmware == "px4":
        found = 1e3 * px4("MAG", 1e-3 * raw, {**active, **new})
    else:
        new = {re.sub("(OFS|DIA|ODI|SCALE)", r"\g<1>2", name): value for name, value in new.items()}
        found = ardupilot("MAG", raw, new)
    np.testing.assert_allclose(found, true @ board.T, atol=1.0)  # mgauss, of 479: the accelerometer's noise
    other = convert_to(run.calibration, {"px4": "ardupilot"}.get(firmware, "px4"), output=tmp_path / "other")
    assert any(
        "magnetometer is left out" in remark for remark in other.remarks
    )  # it turns a compass otherwise
    seen = inspect_recording(read_recording(path)).magnetic_field
    assert seen.axes is None
    assert not seen.warnings


def document(before: tuple[str, ...] = ()) -> Calibration:
    force = Triad(np.diag([1.01, 0.99, 1.005]), np.array([0.1, 0.2, -0.3]))
    made = a_unit.document(ImuModel(force, Triad(np.eye(3), np.full(3, 0.01))))
    return structs.replace(made, input_corrected_by=list(before))


@pytest.mark.parametrize("target", ["px4", "ardupilot"])
def test_a_calibration_of_corrected_numbers_does_not_replace_the_autopilots(tmp_path, target) -> None:
    on_top = document(("0123456789ab",))
    with pytest.raises(UsageError, match=r"corrected before \(0123456789ab\)(.|\n)*put it in their place"):
        convert_to(on_top, target, output=tmp_path / "out", largest_loss=0.1)
    assert not (tmp_path / "out").exists()
    assert convert_to(document(), target, output=tmp_path / "out", largest_loss=0.1).files


def test_a_magnetometer_that_an_earlier_version_calibrated_on_top_is_left_out(tmp_path: Path) -> None:
    matrix = 1e7 * symmetric(np.array([1.01, 0.99, 1.02]), np.array([0.01, -0.02, 0.03]))
    block = a_unit.compass(matrix, np.array([12.0, -30.0, 7.0]), raw_unit="mgauss")
    for before, written in (([], True), (["0123456789ab"], False)):
        on_top = structs.replace(block, input_corrected_by=before)
        made = structs.replace(document(), magnetometer=on_top)
        found = convert_to(made, "ardupilot", output=tmp_path / "out", largest_loss=0.1)
        text = "".join(file.read_text("utf-8") for file in found.files)
        assert ("COMPASS_OFS_X" in text) == written
        assert any("on top of the autopilot's own parameters" in r for r in found.remarks) != written
