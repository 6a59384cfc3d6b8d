"""Corrected recordings as EuRoC's folder: what the others read, and what is read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tumble.document.imported import calibration_from_model
from tumble.errors import UsageError
from tumble.recording import read_recording
from tumble.sensor import ImuModel, Triad
from tumble.workflows.apply import apply
from tumble.workflows.corrected import ForceShift

M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
M_G = np.array([[0.985, -0.011, 0.008], [0.006, 1.017, -0.004], [-0.013, 0.005, 1.008]])
UNIT = calibration_from_model(
    ImuModel(Triad(M_A, np.array([0.1, -0.2, 0.3])), Triad(M_G, np.array([0.01, -0.03, 0.02]))),
    ("m/s^2", "rad/s"),
    ("fixture", "its axes"),
    [],
    procedure="by hand",
    remarks=[],
)
RNG = np.random.default_rng(3)
FORCE = np.array([0.3, -0.5, 9.7]) + 0.02 * RNG.normal(size=(400, 3))
RATE = 0.01 * RNG.normal(size=(400, 3))
# No multiples of 256 ns, which is what a float64 of seconds since 1970 resolves.
STAMPS = 1_403_636_579_758_555_393 + 5_000_001 * np.arange(400)
SENSOR = """#Default imu sensor yaml file
sensor_type: imu
T_BS:
  cols: 4
  rows: 4
  data: [0.0, 1.0, 0.0, 0.0,
         1.0, 0.0, 0.0, 0.0,
         0.0, 0.0, -1.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 200
gyroscope_noise_density: 1.6968e-04     # [ rad / s / sqrt(Hz) ]
"""


def euroc(folder: Path) -> Path:
    place = folder / "mav0" / "imu0"
    place.mkdir(parents=True)
    names = (("w_RS_S", "[rad s^-1]"), ("a_RS_S", "[m s^-2]"))
    head = ["#timestamp [ns]", *(f"{name}_{axis} {unit}" for name, unit in names for axis in "xyz")]
    rows = [
        ",".join(map(str, [t, *w, *f]))
        for t, w, f in zip(STAMPS.tolist(), RATE.tolist(), FORCE.tolist(), strict=True)
    ]
    (place / "data.csv").write_text("\n".join([",".join(head), *rows]) + "\n")
    (place / "sensor.yaml").write_text(SENSOR)
    (folder / "mav0" / "cam0").mkdir()
    (folder / "mav0" / "cam0" / "data.csv").write_text("#timestamp [ns],filename\n1,1.png\n")
    return folder


def expected() -> tuple[np.ndarray, np.ndarray]:
    assert UNIT.model.accelerometer is not None
    assert UNIT.model.gyroscope is not None
    force = np.linalg.solve(M_A, (FORCE - UNIT.model.accelerometer.bias).T).T
    return force, np.linalg.solve(M_G, (RATE - UNIT.model.gyroscope.bias).T).T


def test_euroc_s_folder_keeps_stamps_to_the_nanosecond_and_the_sensor_s_pose(tmp_path: Path) -> None:
    source = euroc(tmp_path / "MH_01")
    done = apply(UNIT, source, output=tmp_path / "out")
    lines = (tmp_path / "out/mav0/imu0/data.csv").read_text().splitlines()
    assert lines[0] == (source / "mav0/imu0/data.csv").read_text().splitlines()[0]
    cells = [line.split(",") for line in lines[1:]]
    assert [int(c[0]) for c in cells] == STAMPS.tolist()
    numbers = np.array([[float(x) for x in c[1:]] for c in cells])
    np.testing.assert_allclose(numbers, np.hstack(expected()[::-1]), atol=1e-13)
    said = (tmp_path / "out/mav0/imu0/sensor.yaml").read_text()
    assert said == SENSOR + f"corrected_by: [{UNIT.identity}]\n"
    assert done.samples == 400
    with pytest.raises(UsageError, match="corrected by this calibration already"):
        apply(UNIT, tmp_path / "out", output=tmp_path / "twice")
    with pytest.raises(UsageError, match="the recording itself"):
        apply(UNIT, source, output=source)
    with pytest.raises(UsageError, match="the recording itself"):
        apply(UNIT, source / "mav0/imu0/data.csv", output=source)


def test_euroc_s_other_sensors_stay_where_the_folder_has_them(tmp_path: Path) -> None:
    source, copy = euroc(tmp_path / "a"), euroc(tmp_path / "b")
    apply(UNIT, source, output=copy)
    assert (copy / "mav0/cam0/data.csv").read_text() == (source / "mav0/cam0/data.csv").read_text()
    assert read_recording(copy).specific_force == pytest.approx(expected()[0])


def test_a_csv_becomes_a_folder_like_euroc_s(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = {"t": 12.5 + 0.005 * np.arange(400)}
    frame |= {f"a{a}": FORCE[:, i] for i, a in enumerate("xyz")}
    frame |= {f"g{a}": RATE[:, i] for i, a in enumerate("xyz")}
    pl.DataFrame(frame).write_csv(tmp_path / "raw.csv")
    (tmp_path / "raw.csv").write_text((tmp_path / "raw.csv").read_text() + "14.5,1")
    monkeypatch.setattr("tumble.recording.formats.text._CHUNK", 20_000)  # several pieces
    done = apply(UNIT, tmp_path / "raw.csv", output=tmp_path / "folder")
    assert any("the last line is cut short" in remark for remark in done.remarks)
    again = read_recording(tmp_path / "folder")
    np.testing.assert_allclose(again.time, frame["t"], atol=1e-9)
    assert again.angular_rate == pytest.approx(expected()[1])
    assert "rate_hz: 200" in (tmp_path / "folder/mav0/imu0/sensor.yaml").read_text()
    pl.DataFrame({k: frame[k] for k in ("t", "ax", "ay", "az")}).write_csv(tmp_path / "half.csv")
    with pytest.raises(UsageError, match="has both triads in each row"):
        apply(UNIT, tmp_path / "half.csv", output=tmp_path / "other")
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("lag", [0.013, -0.027])
def test_blocks_of_any_size_are_shifted_alike(lag: float) -> None:
    time = np.cumsum(0.005 + 0.001 * RNG.random(300))
    time[150:] += 0.2  # a gap, over which nothing is interpolated
    force = FORCE[:300]

    def shifted(size: int) -> tuple[np.ndarray, int]:
        shift = ForceShift(lag)
        made = [shift.add(time[k : k + size], force[k : k + size]) for k in range(0, 300, size)]
        made.append(shift.rest())
        return np.concatenate(made), shift.kept

    whole, kept = shifted(300)
    inside = np.column_stack([np.interp(time + lag, time, force[:, i]) for i in range(3)])
    far = (time + lag > time[149]) & (time + lag < time[150])
    outside = (time + lag < time[0]) | (time + lag > time[-1])
    assert kept == np.count_nonzero(far | outside)
    np.testing.assert_allclose(whole[~far], inside[~far], atol=1e-12)
    for size in (7, 60, 299):
        np.testing.assert_allclose(shifted(size)[0], whole, atol=1e-12)
