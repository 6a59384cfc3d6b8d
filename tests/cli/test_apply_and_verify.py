"""`tumble apply`, `verify`, `predict` and `mount`: what a calibration is good for afterwards."""

import math

import numpy as np
import polars as pl
import pytest
from tests.cli.program import GRAVITY, RATE, Bench, tumbled_rows

from tumble.attitude import matrix_from_rotation_vector, rotation_vector_from_matrix
from tumble.document import read_calibration, read_part
from tumble.report import FilterDocument
from tumble.simulation import find_grade, simulate_noise


@pytest.mark.parametrize("name", ["corrected.csv", "corrected.parquet"])
def test_apply_corrects_as_the_formula_in_the_file_says(tumble: Bench, name: str) -> None:
    """Arithmetic: the recording has 7 digits, and both solve the same equations in double precision."""
    answer = tumble("apply calibrated tumbled.csv -o", name)
    corrected = (pl.read_csv if name.endswith("csv") else pl.read_parquet)(tumble.folder / name)
    assert corrected.columns[:-1] == ["t", "ax", "ay", "az", "gx", "gy", "gz"]  # plain names: m/s² and rad/s
    assert corrected.columns[-1] == f"corrected_by_{read_calibration(tumble.folder / 'calibrated').identity}"
    assert corrected[:, -1].unique().to_list() == [1]
    raw = np.loadtxt(tumble.folder / "tumbled.csv", delimiter=",", skiprows=1)
    assert f"{len(raw)} samples corrected" in answer.out
    document = tumble.json("calibrated/calibration.json")
    a, g = document["accelerometer"], document["gyroscope"]
    assert a["quadratic"] is None
    force = np.linalg.solve(np.array(a["matrix"]), (raw[:, 1:4] - a["bias"]).T).T
    rate = raw[:, 4:] - g["bias"]
    if g["g_sensitivity"] is not None:
        rate = rate - force @ np.array(g["g_sensitivity"]).T
    by_hand = np.column_stack([raw[:, 0], force, np.linalg.solve(np.array(g["matrix"]), rate.T).T])
    np.testing.assert_allclose(corrected[:, :-1].to_numpy(), by_hand, rtol=1e-10, atol=1e-12)


def test_apply_scales_another_unit_of_the_same_kind(tumble: Bench, rows: np.ndarray) -> None:
    """g and deg/s, said in the columns' names, are brought to m/s² and rad/s first; counts are not taken for either."""
    other = rows / [1.0, *[9.80665] * 3, *[np.pi / 180.0] * 3]
    tumble.write("other.csv", other, "t,ax [g],ay [g],az [g],gx [deg/s],gy [deg/s],gz [deg/s]")
    told = tumble("apply calibrated tumbled.csv --json").json
    assert told["file"] == str(tumble.folder.resolve() / "tumbled-corrected.csv")  # named after the recording
    assert told["samples"] == len(rows)
    tumble("apply calibrated other.csv -q")
    first, second = (
        pl.read_csv(tumble.folder / f"{n}-corrected.csv").to_numpy() for n in ("tumbled", "other")
    )
    # The file has seven digits.
    np.testing.assert_allclose(second, first, atol=2e-5)


# --- verify


def test_verify_says_of_each_recording_whether_the_calibration_serves_it(tumble: Bench) -> None:
    tumble.write("again.csv", tumbled_rows(12))
    answer = tumble("verify calibrated again.csv")
    assert "SERVES" in answer.out
    assert "DOES NOT" not in answer.out
    tumble.write("other.csv", tumbled_rows(12, unit_seed=101))
    answer = tumble("verify calibrated other.csv", status=1)
    assert "DOES NOT SERVE" in answer.out
    assert "this is another unit" in answer.said
    first, second = tumble("verify calibrated tumbled.csv other.csv --json", status=1).json
    assert (first["recording"], first["fit"]) == ("tumbled.csv", True)
    assert (second["recording"], second["fit"]) == ("other.csv", False)
    norms = np.array(first["hold_norm_error"])
    assert len(norms) == 20
    # 1.7 mm/s² of noise a hold, at five sigma.
    assert np.max(np.abs(norms)) < 9e-3
    angles = [angle for angle in first["turn_angle"] if angle is not None]
    assert 15 <= len(angles) <= 19
    assert np.degrees(np.sqrt(np.mean(np.square(angles)))) < 0.2
    quiet = tumble("verify calibrated tumbled.csv -q").out
    assert quiet.startswith("SERVES")
    assert "expected" not in quiet


def test_verify_sees_a_changed_gyro_and_another_gravity(tumble: Bench, rows: np.ndarray) -> None:
    tumble.write("faster.csv", rows * [1.0, 1.0, 1.0, 1.0, 1.05, 1.05, 1.05])
    assert "Over turns the gyro is off" in tumble("verify calibrated faster.csv", status=1).said
    # 0.04 m/s² are too much for the noise.
    tumble("verify calibrated tumbled.csv --gravity 9.77", status=1)
    tumble("verify calibrated tumbled.csv --gravity 9.81")


# --- predict


def test_predict_says_what_errors_grow_to_and_which_states_a_filter_needs(tumble: Bench) -> None:
    answer = tumble("predict calibrated --seconds 30 --data-sheet tactical")
    assert "30 s at rest" in answer.said
    assert "come on top" in answer.out
    told = tumble("predict calibrated --seconds 30 --seconds 60 --json").json["answers"]
    after = {row["question"]: row["standard_uncertainty"] for row in told}
    assert len(told) == 7
    # Between t² and t³: twice the time is four to eight times the error.
    assert 4.0 < after["60 s at rest, rms of 26 poses"] / after["30 s at rest, rms of 26 poses"] < 8.0
    told = tumble("predict calibrated --seconds 60 -o . --json").json
    error = told["straight_course"][0]
    parts = error["horizontal_of_calibration"], error["horizontal_of_noise"]
    # independent of one another; the digits are of round-off
    assert error["horizontal"] == pytest.approx(math.hypot(*parts), rel=1e-9)
    written = tumble.json("filter.json")
    assert written == told["filter"]
    assert read_part(FilterDocument, written).seconds == [60.0]
    assert {state["column"] for state in written["states"]} == {None, 0, 1, 2}
    carried = {state["name"]: state for state in written["states"] if state["carry"]}
    assert {"gyroscope bias x", "gyroscope bias y"} <= set(carried)
    assert all(state["sigma"] > 0.0 for state in carried.values())


def test_biases_that_moved_count_and_states_are_in_the_words_of_the_report(tumble: Bench) -> None:
    options = "predict calibrated --seconds 60 --turn-on-bias 5,100"
    sigma = {state["name"]: state["sigma"] for state in tumble(options, "--json").json["filter"]["states"]}
    assert sigma["accelerometer bias y"] > 5.0 * 9.80665e-3
    assert sigma["gyroscope bias y"] > math.radians(100.0 / 3600.0)
    answer = tumble(options)
    assert "States for a filter" in answer.out
    assert "gyro bias x" in answer.out
    assert "gyroscope." not in answer.out


# --- mount

C_MB = matrix_from_rotation_vector(np.array([4e-3, -7e-3, 11e-3]))


def rest(*up_m: float, seed: int, shaken: bool = False) -> np.ndarray:
    """Rows of the unit that `calibrated` is of, at rest on a mount for 20 s."""
    rng = np.random.default_rng(seed)
    grade = find_grade("consumer-mems")
    count = int(20.0 * RATE)
    force, rate = np.tile(GRAVITY * C_MB.T @ up_m, (count, 1)), np.zeros((count, 3))
    if shaken:
        force, rate = force + rng.normal(0.0, 3.0, (count, 3)), rate + rng.normal(0.0, 1.0, (count, 3))
    force, rate = grade.simulate_model(np.random.default_rng(100)).distort(force, rate)
    force = force + simulate_noise(grade.accelerometer.noise, count, RATE, rng)
    rate = rate + simulate_noise(grade.gyroscope.noise, count, RATE, rng)
    return np.column_stack([np.arange(count) / RATE, force, rate])


@pytest.fixture
def mounted(tumble: Bench) -> Bench:
    tumble.write("level.csv", rest(0.0, 0.0, 1.0, seed=1))
    tumble.write("pitched.csv", rest(1.0, 0.0, 0.0, seed=2))
    return tumble


def test_the_rotation_of_a_mount_is_found_within_its_uncertainty_and_the_file_explains_itself(mounted):
    """Against the truth carried into the calibration's frame, whose x is the x accelerometer's axis."""
    assert "mrad" in mounted("mount level.csv pitched.csv --calibration calibrated").out
    document = mounted.json("mount.json")
    # C_cb, from the axes that the unit was drawn in to the calibration's: L Q of the accelerometers' matrix
    truth = find_grade("consumer-mems").simulate_model(np.random.default_rng(100))
    q, r = np.linalg.qr(truth.accelerometer.matrix.T)
    true = rotation_vector_from_matrix(C_MB @ q * np.sign(np.diag(r)))
    sigma = np.array(document["standard_uncertainty"])
    # three angles within four sigma, and sigmas that say something
    assert np.all(np.abs(np.array(document["gamma"]) - true) < 4.0 * sigma)
    assert np.all(sigma < 2e-3)
    told = mounted("mount level.csv pitched.csv -c calibrated -o out/mount.json --json").json
    assert told == mounted.json("out/mount.json")
    vector = told["test_vector"]
    np.testing.assert_allclose(np.array(told["C_MB"]) @ vector["v_B"], vector["v_M"], rtol=1e-12)
    assert "v_M = C_MB * v_B" in told["formula"]
    assert [recording["name"] for recording in told["recordings"]] == ["level.csv", "pitched.csv"]
    frame = read_calibration(mounted.folder / "calibrated").frame.name
    assert told["calibration"]["frame"]["name"] == frame
    # A mount known to 3 mrad adds them to each angle.
    felt = mounted("mount level.csv pitched.csv -c calibrated --mount-mrad 3 --json").json
    np.testing.assert_allclose(np.array(felt["standard_uncertainty"]) ** 2 - sigma**2, 9e-6, rtol=1e-9)


def test_wrong_recordings_of_a_mount_are_refused_in_one_sentence(mounted: Bench) -> None:
    mounted.write("moving.csv", rest(0.0, 0.0, 1.0, seed=3, shaken=True))
    mounted.write("side.csv", rest(0.0, 1.0, 0.0, seed=6))
    for call, words in (
        ("pitched.csv level.csv -c calibrated", ("swapped", "pitched.csv has x up")),
        ("level.csv level.csv -c calibrated", ("given twice",)),
        ("moving.csv pitched.csv -c calibrated", ("moving.csv",)),
        ("tumbled.csv pitched.csv -c calibrated", ("tumbled.csv", "rests in", "apart")),
        ("side.csv pitched.csv -c calibrated", ("side.csv has y up",)),
        ("level.csv pitched.csv -c none.json", ("none.json",)),
        ("level.csv pitched.csv -c calibrated -o level.csv", ("one of the inputs",)),
        ("level.csv pitched.csv -c calibrated --mount-mrad -1", ("--mount-mrad",)),
    ):
        mounted.refuses(f"mount {call}", *words)
