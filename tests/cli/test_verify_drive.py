"""`tumble verify --gnss` and `tumble predict --trajectory` as a user meets them, with good files and bad ones."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.earth import curvature_radii
from tumble.simulation import find_grade, simulate_drive

GNSS = "gpstime,latitude,longitude,height,sdn,sde,sdu,vn,ve,vd,q"
CLOCK = 3.2
RATE = 50.0
DURATION = 150.0


@cache
def simulated(unit: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a drive's recording and of its positions, by a unit of that number."""
    rng = np.random.default_rng(1)
    grade = find_grade("consumer-mems")
    # unit 100 is what the fixture `calibrated` calibrates
    model = grade.simulate_model(np.random.default_rng(unit))
    time = np.arange(int(DURATION * RATE) + 1) / RATE
    states = simulate_drive(rng, DURATION + 1.0).states(time)
    force, rate = model.distort(states.specific_force_b, states.angular_rate_ib_b)
    force = force + grade.accelerometer.noise.random_walk * np.sqrt(RATE) * rng.standard_normal(force.shape)
    rate = rate + grade.gyroscope.noise.random_walk * np.sqrt(RATE) * rng.standard_normal(rate.shape)
    rows = np.arange(0, len(time), int(RATE / 2))
    noise = rng.normal(0.0, 0.02, (len(rows), 3))
    meridian, across = curvature_radii(states.latitude[rows])
    cosine = np.cos(states.latitude[rows])
    gnss = np.column_stack(
        [
            time[rows] + CLOCK,
            np.degrees(states.latitude[rows] + noise[:, 0] / meridian),
            np.degrees(states.longitude[rows] + noise[:, 1] / across / cosine),
            states.height[rows] - noise[:, 2],
            np.full((len(rows), 3), 0.02),
            states.velocity_n[rows] + rng.normal(0.0, 0.03, (len(rows), 3)),
            np.ones(len(rows)),
        ]
    )
    return np.column_stack([time, force, rate]), gnss


class Files:
    """A drive's recording and positions as rows, and what a test makes of them."""

    def __init__(self, folder: Path, written: Callable[..., Path], *, unit: int = 100) -> None:
        self.folder, self.written = folder, written
        self.imu, self.gnss = simulated(unit)

    def write(self, imu: np.ndarray | None = None, gnss: np.ndarray | None = None) -> tuple[Path, Path]:
        recording = self.written(self.folder / "drive.csv", self.imu if imu is None else imu)
        track = self.folder / "track.csv"
        rows = self.gnss if gnss is None else gnss
        track.write_text(GNSS + "\n" + "\n".join(",".join(f"{x:.10f}" for x in row) for row in rows) + "\n")
        return recording, track


@pytest.fixture
def files(tmp_path: Path, written: Callable[..., Path]) -> Files:
    return Files(tmp_path, written)


@pytest.fixture
def verify(tumble: Callable[..., Any], calibrated: Path) -> Callable[..., Any]:
    def run(recording: Path, track: Path, *options: object) -> Any:
        return tumble("verify", calibrated, recording, "--gnss", track, *options)

    return run


def test_a_drive_tells_what_a_calibration_is_worth(files: Files, verify: Callable[..., Any]) -> None:
    """With an outlier among the positions and a second of missing samples, which are told and do no harm."""
    gnss = files.gnss.copy()
    gnss[100:102, 1] += 5e-4
    keep = (files.imu[:, 0] < 70.0) | (files.imu[:, 0] > 71.0)
    recording, track = files.write(files.imu[keep], gnss)
    answer = verify(recording, track, "-o", files.folder / "verified", "--json")
    assert answer.status == 0, answer
    found = json.loads(answer.out)
    assert found == json.loads((files.folder / "verified" / "verify.json").read_text(encoding="utf-8"))
    offset = found["time_offset"]
    # the offset is found to a few of its standard uncertainties
    assert abs(offset["value"] + CLOCK) < 5.0 * offset["standard_uncertainty"]
    parts = {part["name"]: part for part in found["variants"]}
    drift = {name: part["drift"][-1]["horizontal_rms"] for name, part in parts.items()}
    assert drift["all"]["value"] < 0.1 * drift["uncalibrated"]["value"]
    assert drift["all"]["value"] < drift["gyro biases only"]["value"] < drift["uncalibrated"]["value"]
    assert found["positions_left_out"] == 2
    assert parts["all"]["positions_refused"] == 0
    # squared innovations over their degrees of freedom: the outliers are refused, and not in the noise
    assert parts["uncalibrated"]["accuracy_class"].startswith("low")
    assert any("samples are missing in 1 stretch" in text for text in found["remarks"])
    page = (files.folder / "verified" / "verify.html").read_text(encoding="utf-8")
    assert page.index('id="drift"') < page.index("Which error costs how many metres")


def test_a_verdict_that_hangs_on_how_far_biases_may_have_moved_says_so(
    files: Files, verify: Callable[..., Any]
) -> None:
    """By 5 mg and 600 °/h, ten times what the calibration's own uncertainty allows."""
    imu = files.imu + np.array([0.0, 0.05, -0.05, 0.0, 0.003, 0.0, 0.003])
    recording, track = files.write(imu)
    answer = verify(recording, track, "-q")
    assert answer.status == 0, answer
    assert re.search(r"It serves if this unit's\s+biases\s+may\s+move", answer.out)
    answer = verify(recording, track, "-q", "--turn-on-bias", "0.1,10")
    assert answer.status == 1, answer
    assert re.search(r"The drive finds the (gyro|accelerometer) bias", answer.out)
    assert "no proof" not in answer.out


def test_another_unit_s_calibration_does_not_serve(
    tmp_path: Path, written: Callable[..., Path], verify: Callable[..., Any]
) -> None:
    recording, track = Files(tmp_path, written, unit=7).write()
    answer = verify(recording, track, "-q")
    assert answer.status == 1, answer
    assert "DOES NOT SERVE" in answer.out
    assert re.search(r"of\s+another\s+unit", answer.out)


def test_clocks_that_are_leap_seconds_apart_are_noticed(files: Files, verify: Callable[..., Any]) -> None:
    imu, gnss = files.imu.copy(), files.gnss.copy()
    imu[:, 0] += 1.4e9 - 18.0
    gnss[:, 0] += 1.4e9 - CLOCK
    imu = np.round(imu, 9)
    path = files.folder / "drive.csv"
    path.write_text(
        "t,ax,ay,az,gx,gy,gz\n" + "\n".join(",".join(f"{x:.12g}" for x in row) for row in imu) + "\n"
    )
    _, track = files.folder, files.folder / "track.csv"
    track.write_text(GNSS + "\n" + "\n".join(",".join(f"{x:.10f}" for x in row) for row in gnss) + "\n")
    answer = verify(path, track)
    assert answer.status == 0, answer
    assert re.search(r"the\s+clocks\s+are\s+18\.\d\d\s+s\s+apart", answer.out)


def test_positions_of_another_drive_are_refused(files: Files, verify: Callable[..., Any]) -> None:
    gnss = files.gnss.copy()
    gnss[:, 1:4], gnss[:, 7:10] = gnss[::-1, 1:4], -gnss[::-1, 7:10]
    recording, track = files.write(gnss=gnss)
    verify(recording, track).is_told(2, "same motion|go with the course|against the course")


def swapped(columns: list[int], order: list[int]) -> Callable[[np.ndarray], np.ndarray]:
    def change(rows: np.ndarray) -> np.ndarray:
        other = rows.copy()
        other[:, columns] = rows[:, order]
        return other

    return change


def scaled(columns: list[int], factor: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(rows: np.ndarray) -> np.ndarray:
        other = rows.copy()
        other[:, columns] *= factor
        return other

    return change


@pytest.mark.parametrize(
    "change",
    [
        swapped([4, 6], [6, 4]),
        scaled([6], -1.0),
        scaled([4, 5, 6], float(np.degrees(1.0))),
        scaled([1, 2, 3], 2.0),
    ],
    ids=["gyro x and z swapped", "gyro z reversed", "deg/s as rad/s", "twice g"],
)
def test_gyros_that_do_not_turn_with_the_course_and_another_gravity_are_refused(
    files: Files, verify: Callable[..., Any], change: Callable[[np.ndarray], np.ndarray]
) -> None:
    recording, track = files.write(change(files.imu))
    verify(recording, track, "--units", "m/s^2,rad/s,s").is_told(2, "motion|gravity")


@pytest.mark.parametrize(
    "change",
    [swapped([1, 2], [2, 1]), swapped([4, 5], [5, 4])],
    ids=["accelerometer x and y swapped", "gyro x and y swapped"],
)
def test_with_level_axes_swapped_a_drive_is_no_proof(
    files: Files, verify: Callable[..., Any], change: Callable[[np.ndarray], np.ndarray]
) -> None:
    recording, track = files.write(change(files.imu))
    answer = verify(recording, track, "-q", "--units", "m/s^2,rad/s,s")
    assert answer.status == 1, answer
    assert re.search(r"The\s+drive\s+is\s+no\s+proof", answer.out)


def test_positions_that_are_none_or_in_radians_are_told(files: Files, verify: Callable[..., Any]) -> None:
    gnss = files.gnss.copy()
    recording, track = files.write(gnss=gnss[:1])
    verify(recording, track).is_told(2, "has 1 position: a drive takes some minutes")
    gnss[:, 1:3] = np.radians(gnss[:, 1:3])
    verify(*files.write(gnss=gnss)).is_told(2, "look like radians", "latitude_rad")
    gnss = files.gnss.copy()
    gnss[:, 1] = np.nan
    verify(*files.write(gnss=gnss)).is_told(2, "None of the 300 rows|None of the 301 rows", "no fix")


def test_outliers_among_the_positions_are_left_out_and_counted(
    files: Files, verify: Callable[..., Any]
) -> None:
    """A fifth of them, off by metres to hundreds, and five rows without a position."""
    rng = np.random.default_rng(3)
    gnss = files.gnss.copy()
    bad = rng.uniform(size=len(gnss)) < 0.2
    gnss[bad, 1:3] += rng.choice([-1.0, 1.0], (bad.sum(), 2)) * rng.uniform(2e-5, 2e-3, (bad.sum(), 2))
    gnss[40:45, 1] = np.nan
    bad[40:45] = False
    recording, track = files.write(gnss=gnss)
    answer = verify(recording, track, "--json")
    assert answer.status == 0, answer
    found = json.loads(answer.out)
    assert found["positions_left_out"] == bad.sum()
    assert any(f"{bad.sum()} of {len(bad) - 5} positions do not fit" in text for text in found["remarks"])
    assert any("5 of 301 rows" in text for text in found["remarks"])
    assert found["variants"][-1]["innovations"] == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--lever-arm", "1,2"), "--lever-arm takes 3 numbers"),
        (("--turn-on-bias", "1"), "--turn-on-bias takes 2 numbers"),
        (("--turn-on-bias", "1,-2"), "not negative"),
        (("--data-sheet", "gold"), "gold"),
        (("--gravity", "9.8"), "--gravity says nothing"),
        (("--limits", "limits.yaml"), "--limits says nothing"),
    ],
)
def test_options_that_cannot_be_are_refused(
    files: Files, verify: Callable[..., Any], options: tuple[str, ...], words: str
) -> None:
    recording, track = files.write()
    verify(recording, track, *options).is_told(2, words)


def test_options_of_a_drive_take_a_drive(
    tumble: Callable[..., Any], calibrated: Path, recording: Path
) -> None:
    tumble("verify", calibrated, recording, "--lever-arm", "1,2,3").is_told(2, "--lever-arm is for a drive")
    tumble("verify", calibrated, recording, "--gnss", "none.pos").is_told(2, "none.pos")
