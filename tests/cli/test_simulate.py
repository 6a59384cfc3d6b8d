"""`tumble simulate` as a user meets it, and what follows: a calibration, noise, a fixture's file for each sequence."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.cli.program import Bench

from tumble.protocol import read_protocol, sequence_steps, write_protocol

FILES = {"recording.csv", "protocol.yaml", "truth.json"}


@pytest.mark.parametrize("protocol", ["six-position", "multi-position-26"])
def test_what_it_says_to_type_next_works(bench: Bench, protocol: str) -> None:
    """Simulate, then type the line that is printed: a calibration that is fit for use."""
    answer = bench(f"simulate {protocol} --sample-rate 50 --site 48.1,520 -o trial")
    following = re.search(r"^Next: tumble (.*)$", answer.out, re.M)
    bench(following[1])
    document = bench.json("trial/calibration/calibration.json")
    assert document["procedure"] == "joint"
    assert document["site"]["latitude_deg"] == pytest.approx(48.1)


def test_a_unit_at_rest_is_simulated_and_its_noise_found_by_the_command_printed(bench: Bench) -> None:
    answer = bench("simulate rest --duration 120 --sample-rate 50 -o trial")
    assert "gyroscope: N 0.2121 °/√h, B 20 °/h, K 0 °/h/√h" in answer.out
    following = re.search(r"^Next: tumble (noise .*)$", answer.out, re.M)
    bench(following[1])
    found, truth = bench.json("trial/noise/noise.json"), bench.json("trial/truth.json")["noise"]
    assert found["samples_at_rest"] == 6000
    for triad in ("accelerometer", "gyroscope"):
        white, step = (truth[triad][key]["value"] for key in ("random_walk", "resolution"))
        both = (white**2 + step**2 / 12.0 / 50.0) ** 0.5  # the converter's rounding is white, too
        assert found["triads"][triad]["terms"]["N"]["mean_of_variances"] == pytest.approx(both, rel=0.04)


def test_it_prints_the_truth_with_units_and_every_file(bench: Bench) -> None:
    answer = bench("simulate six-position --imu hg1700 --sample-rate 5")
    for words in (
        "No site was given", "grade hg1700 (seed 0)", "accelerometer bias x y z", " mg\n", "ppm",
        "gyro scale factor error x y z", "(six-position, in the frame fixture):", "its mean in this session",
        "accelerometer misalignment xy xz yx", "mrad",
    ):  # fmt: skip
        assert words in answer.out
    folder = "six-position-simulated"  # named after the protocol
    assert set(bench.contents(folder)) == FILES
    truth = bench.json(f"{folder}/truth.json")
    named = {row["name"]: row["value"] for row in truth["parameters_in_fixture"]}
    line = re.search(r"^ *gyro scale factor error x y z +(\S+) +(\S+) +(\S+) ppm$", answer.out, re.M)
    for text, axis in zip(line.groups(), "xyz", strict=True):
        # six digits are printed
        assert float(text) == pytest.approx(1e6 * named[f"gyro scale factor error {axis}"], rel=1e-5)
    (written,) = re.findall(r"^written: (.*)$", answer.out, re.M)
    assert written.startswith(str((bench.folder / folder).resolve()))
    assert all(name in written for name in FILES)
    said = bench("simulate six-position --sample-rate 5 -o new --json").json
    assert said["truth"] == bench.json("new/truth.json")
    assert {Path(file).name for file in said["files"]} == FILES
    assert said["next"].startswith("tumble calibrate --protocol ")
    assert bench("simulate six-position --sample-rate 5 -o new -q").out == f"Next: {said['next']}\n"


def test_another_simulation_in_the_folder_is_kept(bench: Bench) -> None:
    bench("simulate multi-position-9 --sample-rate 5 -o made --seed 5 -q")
    before = bench.contents("made")
    bench.put("made/notes.txt", "mine")
    said = bench("simulate multi-position-9 --sample-rate 5 -o made").out
    # In the frame in which the protocol's procedure answers.
    assert "(multi-position, in the frame accelerometer-x):" in said
    assert "rotation between the triads x y z" in said
    (kept,) = (path for path in (bench.folder / "made").iterdir() if path.is_dir())
    assert f"kept in made/{kept.name}" in said
    assert bench.contents(f"made/{kept.name}") == before
    assert {path.name for path in (bench.folder / "made").iterdir()} == FILES | {kept.name, "notes.txt"}


def test_a_simulated_unit_that_is_switched_on_anew_has_other_biases_and_else_is_the_same(bench):
    """By 2 mg and 60 °/h, one sigma: six draws of each kind are not all beyond four, nor all zero."""
    options = "--unit-seed 5 --sample-rate 10 --turn-on-bias 2,60 -q"
    for seed in "12":
        bench(f"simulate six-position {options} --seed {seed} -o day{seed}")
    first, second = (bench.json(f"day{seed}/truth.json") for seed in "12")
    for triad, sigma in (("accelerometer", 2e-3 * 9.80665), ("gyroscope", np.radians(60.0) / 3600.0)):
        assert first[triad]["matrix"] == second[triad]["matrix"]
        moved = np.subtract(first[triad]["bias"], second[triad]["bias"])
        assert np.all(moved != 0.0)
        assert np.max(np.abs(moved)) < 4.0 * np.sqrt(2.0) * sigma


# --- the strapdown rotation test: a file for each sequence


@pytest.fixture(scope="module")
def fixture(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """A recording cut into a file a sequence, as of a fixture that is moved anyhow in between."""
    bench = Bench(tmp_path_factory.mktemp("strapdown"))
    bench.put("errors.yaml", "fixture_zero_mrad: 1\nfixture_mounting_mrad: 1\n")
    call = "simulate strapdown-rotation --imu tactical --sample-rate 50 --site 48.1,520 --seed 2 -q -o ."
    bench(f"{call} --errors errors.yaml")
    protocol, truth = read_protocol(bench.folder / "protocol.yaml"), bench.json("truth.json")
    rows, steps = pl.read_csv(bench.folder / "recording.csv"), list(protocol.steps)
    for number, sequence in enumerate(sequence_steps(protocol), 1):
        span = [truth["steps"][sequence.start]["start_s"], truth["steps"][sequence.end]["stop_s"]]
        rows.filter(pl.col("t").is_between(*span)).write_csv(bench.folder / f"step-{number:02d}.csv")
        for step in range(sequence.start, sequence.end + 1):
            steps[step] = replace(steps[step], file=f"step-{number:02d}.csv")
    (bench.folder / "recording.csv").unlink()
    write_protocol(replace(protocol, recordings=(), steps=tuple(steps)), bench.folder / "protocol.yaml")
    return bench


def test_a_file_a_sequence_is_calibrated_to_the_truth_of_its_own_frame(fixture: Bench) -> None:
    assert len(list(fixture.folder.glob("step-*.csv"))) == 17
    fixture("calibrate --protocol protocol.yaml -o made")
    document, truth = fixture.json("made/calibration.json"), fixture.json("truth.json")
    assert (document["procedure"], document["frame"]["name"]) == ("joint", "mean-gyro")
    wanted = {row["name"]: row["value"] for row in truth["parameters_in_mean_gyro"]}
    # A bias wanders from what was drawn.
    told = [p for p in document["parameters"] if "bias" not in p["name"] and "sensitivity" not in p["name"]]
    assert len(told) >= 21
    for row in told:
        error = (row["value"] - wanted.get(row["name"], 0.0)) / row["standard_uncertainty"]
        assert abs(error) < 4.5, row["name"]  # by chance once in 150,000


def test_gyros_in_degrees_that_are_called_radians_and_a_file_that_is_gone_are_said(fixture, bench):
    for path in fixture.folder.glob("step-*.csv"):
        values = np.loadtxt(path, delimiter=",", skiprows=1) * [1, 1, 1, 1, *[np.degrees(1.0)] * 3]
        bench.write(path.name, values, path.read_text("utf-8").splitlines()[0])
    bench.put("protocol.yaml", fixture.text("protocol.yaml"))
    answer = bench.run("calibrate --protocol protocol.yaml -o out")
    assert answer.status != 0, answer
    assert "Traceback" not in answer.err
    assert "deg/s" in answer.err + answer.out
    (bench.folder / "step-01.csv").unlink()
    bench.refuses("calibrate --protocol protocol.yaml -o out", "step-01.csv")
