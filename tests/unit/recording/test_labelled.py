"""Lines with labels, clocks of serial monitors, MotionCal and JSON: each number where it belongs, each loss said."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_recording
from tumble.recording.formats.lines import row_of, without_clock
from tumble.recording.units import chips
from tumble.units import angular_rate_factor, specific_force_factor

COUNT, RATE = 300, 100.0
RNG = np.random.default_rng(11)
TIME = np.arange(COUNT) / RATE
FORCE = np.round(np.array([0.4, -1.1, 9.7]) + 0.02 * RNG.normal(size=(COUNT, 3)), 5)
TURN = np.round(np.array([0.01, -0.02, 0.03]) + 0.002 * RNG.normal(size=(COUNT, 3)), 6)
ROWS = [f + w for f, w in zip(FORCE.tolist(), TURN.tolist(), strict=True)]
NAMES = ("ax", "ay", "az", "gx", "gy", "gz")
SI = {"units": "m/s^2,rad/s"}


def written(folder: Path, lines: Iterable[str], name: str = "log.txt") -> Path:
    (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / name


def labelled(sign: str, gap: str, *, time: bool = True) -> list[str]:
    head = [f"t{sign}{t:.2f}{gap}" if time else "" for t in TIME]
    cells = [gap.join(f"{n}{sign}{v}" for n, v in zip(NAMES, row, strict=True)) for row in ROWS]
    return [h + row for h, row in zip(head, cells, strict=True)]


def exact(recording: Any, keep: np.ndarray | slice = slice(None)) -> bool:
    """Whether a recording has all the numbers of both triads, or those of some rows."""
    found = np.hstack([recording.specific_force, recording.angular_rate])
    return np.array_equal(found, np.array(ROWS)[keep])


@pytest.mark.parametrize(("sign", "gap"), [(":", " "), ("=", ", "), (": ", "\t"), (" = ", "; "), (":", ",")])
def test_labels_say_which_number_is_which(tmp_path: Path, sign: str, gap: str) -> None:
    recording = read_recording(written(tmp_path, labelled(sign, gap)), **SI)
    assert exact(recording)
    np.testing.assert_allclose(recording.time, TIME, atol=1e-12)
    assert not said(recording, "mended")


def test_labels_may_change_their_order_and_have_units_behind(tmp_path: Path) -> None:
    lines, units = [], []
    for k, row in enumerate(ROWS):
        cells = [f"t:{TIME[k]:.2f}", *(f"{n}:{v}" for n, v in zip(NAMES, row, strict=True))]
        lines.append(" ".join(cells if k % 3 else cells[::-1]))
        scaled = [*(FORCE[k] / 9.80665).tolist(), *np.degrees(TURN[k]).tolist()]
        words = [f"{n}: {v!r} {'g' if n[0] == 'a' else 'dps'}" for n, v in zip(NAMES, scaled, strict=True)]
        units.append(f"t:{TIME[k]:.2f} " + " ".join(words))
    assert exact(read_recording(written(tmp_path, lines), **SI))
    recording = read_recording(written(tmp_path, units))
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("g", "deg/s")


def test_a_greeting_and_damaged_lines_are_counted_and_said(tmp_path: Path) -> None:
    lines = labelled(":", " ")
    boot = ["ets Jul 29 2019 12:21:46", "rst:0x1 (POWERON_RESET),boot:0x13", "MPU6050 is ready now"]
    lines[100] = lines[100][: len(lines[100]) // 3]
    lines[150:150] = ["*** brownout ***", "ax:nan ay:nan az:nan gx:1 gy:2 gz:3", "\x00\x00"]
    recording = read_recording(written(tmp_path, boot + lines), **SI)
    assert len(recording) == COUNT - 1
    assert "3 line(s) before the first sample hold none" in said(recording)
    mended = [r.text for r in recording.remarks if r.kind == "mended" and "line(s)" in r.text]
    assert sum(int(text.split(": ")[1].split()[0]) for text in mended) == 4


CLOCKS = {
    "arduino": lambda s: f"17:{50 + int(s) // 60}:{s % 60:06.3f} -> ",
    "platformio": lambda s: f"23:59:{57 + s:06.3f} > " if s < 3 else f"00:00:{s - 3:06.3f} > ",
    "brackets": lambda s: f"[2024-05-01 08:00:{s:06.3f}] ",
}


@pytest.mark.parametrize(("clock", "labels"), [("arduino", True), ("platformio", False), ("brackets", True)])
def test_the_clock_of_a_serial_monitor_is_taken_off_and_serves_as_stamps(tmp_path, clock, labels) -> None:
    rows = labelled(":", " ", time=False) if labels else [",".join(map(str, row)) for row in ROWS]
    # Ten samples at once come over USB, with one stamp.
    late = 0.3 * (clock == "platformio")
    lines = [CLOCKS[clock](k // 10 * 0.1 + late) + row for k, row in enumerate(rows)]
    recording = read_recording(written(tmp_path, lines), **SI)
    assert exact(recording)
    np.testing.assert_allclose(np.diff(recording.time), 0.01, atol=1e-9)
    assert "stamps are the serial monitor's" in said(recording)


def test_a_header_behind_a_clock_names_the_columns(tmp_path: Path) -> None:
    """The gyro first, and a temperature in between."""
    head = ["17:49:59.000 -> starting", "17:49:59.001 -> gx,gy,gz,temp,ax,ay,az"]
    rows = [
        f"17:50:{k / 100:06.3f} -> " + ",".join(map(str, [*row[3:], 25.0 + k / 1000, *row[:3]]))
        for k, row in enumerate(ROWS)
    ]
    recording = read_recording(written(tmp_path, head + rows), **SI)
    assert exact(recording)
    assert recording.temperature is not None
    assert "1 line(s) before the first sample" in said(recording)


def test_what_only_looks_like_a_clock_stays() -> None:
    assert without_clock("17:50:07.211,1,2,3") == ("17:50:07.211,1,2,3", None)
    assert without_clock("17:50:07.211 -> 1,2,3") == ("1,2,3", pytest.approx(64207.211))


def motioncal(*kinds: str) -> Iterable[str]:
    field = np.array([20.1, -3.2, 41.7])
    for f, w in zip(FORCE, TURN, strict=True):
        counts = [*(f / 9.80665 * 8192), *(np.degrees(w) * 16), *(field * 10)]
        line = {
            "Raw": ",".join(str(round(c)) for c in counts),
            "Uni": ",".join(f"{v:.4f}" for v in [*f, *w, *field]),
        }
        yield from (f"{kind}:{line[kind]}" for kind in kinds)


def test_motioncal_s_lines_are_read_once_and_none_is_lost(tmp_path: Path) -> None:
    recording = read_recording(written(tmp_path, motioncal("Raw", "Uni")), rate=RATE)
    assert len(recording) == COUNT
    np.testing.assert_allclose(recording.specific_force, FORCE, atol=1e-4)
    np.testing.assert_allclose(recording.angular_rate, TURN, atol=1e-4)
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")
    assert f"{COUNT} line(s) with ax [g]" in said(recording, "found")
    assert not said(recording, "mended")
    raw = read_recording(written(tmp_path, motioncal("Raw")), rate=RATE)
    np.testing.assert_allclose(raw.specific_force * 9.80665, FORCE, atol=1e-3)
    assert raw.specific_force_unit == "g"


def test_lines_of_one_sensor_each_are_put_together(tmp_path: Path) -> None:
    lines: list[str] = []
    for a, b, c, *w in ROWS:
        lines += [f"Accel: {a}, {b}, {c}", f"Gyro: {w[0]}, {w[1]}, {w[2]}"]
    del lines[2 * 77 + 1]
    recording = read_recording(written(tmp_path, lines), rate=RATE, **SI)
    assert exact(recording, np.arange(COUNT) != 77)
    assert "1 line(s) without a partner are left out" in said(recording, "mended")


@pytest.mark.parametrize("nested", [True, False])
def test_json_lines_are_read(tmp_path: Path, nested: bool) -> None:
    lines = []
    for t, row in zip(TIME, ROWS, strict=True):
        deep = {"accel": dict(zip("xyz", row[:3], strict=True)), "gyro": row[3:]}
        lines.append(
            json.dumps({"t": round(t, 2), **(deep if nested else dict(zip(NAMES, row, strict=True)))})
        )
    lines.insert(40, '{"t": 0.4, "accel":')
    recording = read_recording(written(tmp_path, lines, "log.jsonl"), **SI)
    assert exact(recording)
    assert "1 line(s) hold no sample and are left out (the first is line 41" in said(recording, "mended")


def sensor_logger(*, pushed: bool = False) -> Iterable[dict[str, Any]]:
    yield {"sensor": "Metadata", "version": "3", "device name": "phone"}
    for k in range(COUNT):
        for sensor, row, late in (("Accelerometer", FORCE[k], 0), ("Gyroscope", TURN[k], 3_000_000)):
            stamp = 1_698_501_144_401_773_000 + 10_000_000 * k + late
            axes = dict(zip("zyx", map(str, row[::-1]), strict=True))
            name = f"{sensor}Uncalibrated"
            if pushed:
                values = {axis: float(v) for axis, v in axes.items()}
                yield {"time": str(stamp), "name": name.lower(), "values": values}
            else:
                seconds = str(round(stamp / 1e9 - 1_698_501_144, 4))
                yield {"time": str(stamp), "sensor": name, "seconds_elapsed": seconds, **axes}


@pytest.mark.parametrize("form", ["array", "pretty", "lines", "pushed"])
def test_sensor_logger_s_json_is_read(tmp_path: Path, form: str) -> None:
    """An object a sample, numbers as texts, axes from z to x, the gyro 3 ms later."""
    objects = list(sensor_logger(pushed=form == "pushed"))
    whole = [{"messageId": 0, "payload": objects}] if form == "pushed" else objects
    text = json.dumps(whole, indent=1 if form == "pretty" else None)
    path = written(tmp_path, map(json.dumps, objects) if form == "lines" else [text], "phone.json")
    recording = read_recording(path, **SI)
    assert np.array_equal(recording.angular_rate, TURN[: len(recording)])
    between = FORCE[:-1] + 0.3 * np.diff(FORCE, axis=0)
    np.testing.assert_allclose(recording.specific_force, between[: len(recording)], atol=2e-4)


LEVEL = {"x": 0, "y": 0, "z": 9.8}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('[{"sensor":"Accelerometer","time":"16', "is no whole JSON"),
        ('[{"name":"one"},{"name":"two"}]', "holds no line with a sample"),
        ("[1, 2, 3]", "text without rows of numbers"),
        ('{"format": "tumble calibration"}', "holds no line with a sample"),
        (json.dumps([{"sensor": "Accelerometer", "time": k, **LEVEL} for k in range(9)]), "and a gyro"),
    ],
)
def test_json_without_samples_is_refused(tmp_path: Path, content: str, words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        read_recording(written(tmp_path, [content], "a.json"))


@pytest.mark.parametrize(
    ("line", "values"),
    [
        ("ax:1 ay:-2.5e-1 az:+.5", (1.0, -0.25, 0.5)),
        ("a_x = 1; a_y = 2; a_z = 3", (1.0, 2.0, 3.0)),
        ("acc[0]=1,acc[1]=2,acc[2]=3", (1.0, 2.0, 3.0)),
        ("ax:1 ax:2 ax:3", None),
        ("rst:0x1 boot:0x13 load:0x3fff", None),
        ("ax:1.2.3 ay:1 az:2", None),
        ("x" * 5000, None),
        ('{"a": 1e999, "b": 2, "c": 3}', None),
        ('{"a": ' * 2000, None),
        ("Raw:1,2,3", None),
    ],
)
def test_a_line_is_a_row_or_none(line: str, values: tuple[float, ...] | None) -> None:
    row = row_of(line)
    assert (None if row is None else row.values) == values


def test_counts_with_a_chip_are_checked_against_gravity(tmp_path: Path) -> None:
    counts = np.round(np.hstack([FORCE / 9.80665 * 8192, np.degrees(TURN) * 65.5]))
    rows = (",".join(map(str, r)) for r in np.column_stack([TIME, counts]).tolist())
    path = written(tmp_path, ["t,ax,ay,az,gx,gy,gz", *rows])
    recording = read_recording(path, units="MPU-6050,4g,500dps")
    assert recording.specific_force_unit == "8192 LSB/g"
    factor = specific_force_factor(recording.specific_force_unit)
    np.testing.assert_allclose(factor * recording.specific_force, FORCE, atol=1e-3)
    assert angular_rate_factor(recording.angular_rate_unit) == pytest.approx(np.radians(1 / 65.5))
    for units, error, words in (
        ("mpu6050,16g,500dps", RecordingError, "another measuring range was set"),
        ("lsm6dso,2g,500dps", RecordingError, "another measuring range was set"),
        ("mpu6050,250dps", UsageError, "the range that it was set to is missing; give one of 2g, 4g"),
        ("mpu6050,3g,250dps", UsageError, "it has no range of 3g; it has 2g, 4g, 8g, 16g"),
        ("mpu6050,2g,250x", UsageError, "'250x' is no range"),
        ("l3gd20,2g,250dps", UsageError, "has no accelerometer"),
    ):
        with pytest.raises(error, match=words):
            read_recording(path, units=units)


def test_the_table_s_counts_fill_sixteen_bits() -> None:
    """Range times sensitivity is 2^15 counts but for rounding in the data sheets (ST's full scales are nominal)."""
    assert len(chips()) >= 20
    small = {"bmi055", "lsm9ds1", "lsm9ds0", "l3gd20", "adis16448", "adis16470", "itg3200"}
    for name, chip in chips().items():
        for full, counts in (*chip.force.items(), *chip.rate.items()):
            assert 0.85 < full * counts / 2**15 < 1.01 or name in small, (name, full)
