"""`tumble verify --gnss` as a user meets it, with good files and bad ones."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from tests.cli.program import HEADER, Answer, Bench

from tumble.earth import curvature_radii
from tumble.simulation import find_grade, simulate_drive

GNSS = "gpstime,latitude,longitude,height,sdn,sde,sdu,vn,ve,vd,q"
CLOCK, RATE, DURATION = 3.2, 50.0, 150.0


@cache
def simulated(unit: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a drive's recording and of its positions, by a unit of that number."""
    rng = np.random.default_rng(1)
    grade = find_grade("consumer-mems")
    # unit 100 is what `calibrated` is of
    model = grade.simulate_model(np.random.default_rng(unit))
    time = np.arange(int(DURATION * RATE) + 1) / RATE
    states = simulate_drive(rng, DURATION + 1.0).states(time)
    force, rate = model.distort(states.specific_force_b, states.angular_rate_ib_b)
    force = force + grade.accelerometer.noise.random_walk * np.sqrt(RATE) * rng.standard_normal(force.shape)
    rate = rate + grade.gyroscope.noise.random_walk * np.sqrt(RATE) * rng.standard_normal(rate.shape)
    rows = np.arange(0, len(time), int(RATE / 2))
    noise = rng.normal(0.0, 0.02, (len(rows), 3))
    meridian, across = curvature_radii(states.latitude[rows])
    gnss = np.column_stack(
        [
            time[rows] + CLOCK,
            np.degrees(states.latitude[rows] + noise[:, 0] / meridian),
            np.degrees(states.longitude[rows] + noise[:, 1] / across / np.cos(states.latitude[rows])),
            states.height[rows] - noise[:, 2],
            np.full((len(rows), 3), 0.02),
            states.velocity_n[rows] + rng.normal(0.0, 0.03, (len(rows), 3)),
            np.ones(len(rows)),
        ]
    )
    return np.column_stack([time, force, rate]), gnss


def text(header: str, rows: np.ndarray, form: str) -> str:
    return header + "\n" + "\n".join(",".join(format(x, form) for x in row) for row in rows) + "\n"


class Drive:
    """A drive's recording and positions as rows, which a test may change, and the judgement on them."""

    def __init__(self, bench: Bench, unit: int = 100) -> None:
        self.bench = bench
        self.imu, self.gnss = (part.copy() for part in simulated(unit))

    def verify(self, *options: str, status: int = 0) -> Answer:
        self.write()
        return self.bench("verify calibrated drive.csv --gnss track.csv", *options, status=status)

    def refuses(self, words: str, options: str = "") -> None:
        self.write()
        self.bench.refuses(f"verify calibrated drive.csv --gnss track.csv {options}", words)

    def write(self) -> None:
        self.bench.put("drive.csv", text(HEADER, self.imu, ".12g"))
        self.bench.put("track.csv", text(GNSS, self.gnss, ".10f"))


@pytest.fixture
def drive(tumble: Bench) -> Drive:
    return Drive(tumble)


def test_a_drive_tells_what_a_calibration_is_worth(drive: Drive) -> None:
    """With an outlier among the positions and a second of missing samples, which are told and do no harm."""
    drive.gnss[100:102, 1] += 5e-4
    drive.imu = drive.imu[(drive.imu[:, 0] < 70.0) | (drive.imu[:, 0] > 71.0)]
    found = drive.verify("-o verified --json").json
    assert found == drive.bench.json("verified/verify.json")
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
    page = drive.bench.text("verified/verify.html")
    assert page.index('id="drift"') < page.index("Which error costs how many metres")


def test_a_verdict_that_hangs_on_how_far_biases_may_have_moved_says_so(drive: Drive) -> None:
    """By 5 mg and 600 °/h, ten times what the calibration's own uncertainty allows."""
    drive.imu += [0.0, 0.05, -0.05, 0.0, 0.003, 0.0, 0.003]
    assert "It serves if this unit's biases may move" in drive.verify("-q").said
    said = drive.verify("-q --turn-on-bias 0.1,10", status=1).said
    assert "The drive finds the gyro bias" in said or "The drive finds the accelerometer bias" in said
    assert "no proof" not in said


def test_another_unit_s_calibration_does_not_serve(tumble: Bench) -> None:
    said = Drive(tumble, unit=7).verify("-q", status=1).said
    assert "DOES NOT SERVE" in said
    assert "of another unit" in said


def test_clocks_that_are_leap_seconds_apart_are_noticed(drive: Drive) -> None:
    drive.imu[:, 0] = np.round(drive.imu[:, 0] + 1.4e9 - 18.0, 9)
    drive.gnss[:, 0] += 1.4e9 - CLOCK
    assert "the clocks are 18." in drive.verify().said


Rows = Callable[[np.ndarray], np.ndarray]


@pytest.mark.parametrize(
    ("change", "status", "words"),
    [
        pytest.param(lambda r: r[:, [0, 1, 2, 3, 6, 5, 4]], 2, "motion|gravity", id="gyro x and z swapped"),
        pytest.param(lambda r: r * [1, 1, 1, 1, 1, 1, -1], 2, "motion|gravity", id="gyro z reversed"),
        pytest.param(lambda r: r * [1, 1, 1, 1, *[57.29578] * 3], 2, "motion|gravity", id="deg/s as rad/s"),
        pytest.param(lambda r: r * [1, 2, 2, 2, 1, 1, 1], 2, "motion|gravity", id="twice g"),
        pytest.param(lambda r: r[:, [0, 2, 1, 3, 4, 5, 6]], 1, "is no proof", id="force x and y swapped"),
        pytest.param(lambda r: r[:, [0, 1, 2, 3, 5, 4, 6]], 1, "is no proof", id="gyro x and y swapped"),
    ],
)
def test_axes_and_units_that_do_not_go_with_the_course_are_refused_or_no_proof(drive, change, status, words):
    drive.imu = change(drive.imu)
    if status == 2:
        drive.refuses(words, "--units m/s^2,rad/s,s")
    else:
        assert f"The drive {words}" in drive.verify("-q --units m/s^2,rad/s,s", status=1).said


def without_fix(gnss: np.ndarray) -> np.ndarray:
    gnss[:, 1] = np.nan
    return gnss


def turned_round(gnss: np.ndarray) -> np.ndarray:
    gnss[:, 1:4], gnss[:, 7:10] = gnss[::-1, 1:4].copy(), -gnss[::-1, 7:10]
    return gnss


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda gnss: gnss[:1], "has 1 position: a drive takes some minutes"),
        (lambda gnss: gnss * [1, np.pi / 180, np.pi / 180, *[1] * 8], "look like radians.*latitude_rad"),
        (without_fix, "None of the 30[01] rows.*no fix"),
        (turned_round, "same motion|go with the course|against the course"),
    ],
)
def test_positions_that_are_none_in_radians_or_of_another_drive_are_refused(drive, change, words):
    drive.gnss = change(drive.gnss)
    drive.refuses(words)


def test_outliers_among_the_positions_are_left_out_and_counted(drive: Drive) -> None:
    """A fifth of them, off by metres to hundreds, and five rows without a position."""
    rng = np.random.default_rng(3)
    bad = rng.uniform(size=len(drive.gnss)) < 0.2
    off = rng.choice([-1.0, 1.0], (bad.sum(), 2)) * rng.uniform(2e-5, 2e-3, (bad.sum(), 2))
    drive.gnss[bad, 1:3] += off
    drive.gnss[40:45, 1] = np.nan
    bad[40:45] = False
    found = drive.verify("--json").json
    assert found["positions_left_out"] == bad.sum()
    assert any(f"{bad.sum()} of {len(bad) - 5} positions do not fit" in text for text in found["remarks"])
    assert any("5 of 301 rows" in text for text in found["remarks"])
    assert found["variants"][-1]["innovations"] == pytest.approx(1.0, abs=0.3)


def test_options_that_cannot_be_are_refused(drive: Drive) -> None:
    for options, words in (
        ("--lever-arm 1,2", "--lever-arm takes 3 numbers"),
        ("--data-sheet gold", "gold"),
        ("--gravity 9.8", "--gravity says nothing"),
        ("--limits limits.yaml", "--limits says nothing"),
    ):
        drive.refuses(words, options)
