"""`tumble plan` of any protocol and of a test of poses, as a user meets it."""

import re

import numpy as np
import pytest
from tests.cli.program import Bench

HEAD = "format: tumble protocol\nversion: 1\nprocedure: {}\nsite: {{latitude_deg: 48}}\nsteps:\n"
SHORT = """\
  - hold: first
    up: z
    uncertainty_deg: 3
    seconds: 8
  - spin: there
    axis: x
    rate_deg_per_s: 10
    seconds: 34
    angle_deg: 360
  - hold: second
    seconds: 8
  - turn: by hand
    seconds: 3
  - hold: third
    up: x
    uncertainty_deg: 3
    seconds: 8
"""
POSES = "plan multi-position --imu tactical --site 48.1"
PLAN = {"protocol.yaml", "plan.json", "sheet.html"}


def holds(*ups: str, more: str = "") -> str:
    """Steps with these axes up."""
    return "".join(
        f"  - hold: stop {k}\n    up: {up}\n    seconds: 10\n{more}" for k, up in enumerate(ups, 1)
    )


def test_a_protocol_file_is_judged_as_it_is(bench: Bench) -> None:
    bench.put("short.yaml", HEAD.format("turntable") + SHORT)
    said = bench("plan short.yaml --imu tactical -o plan").said
    for words in (
        "3 holds, 1 rotations",
        "accelerometer bias",
        "not determined",
        "Not determined better",
        "Next:",
    ):
        assert words in said, words
    assert set(bench.contents("plan")) == PLAN
    document = bench.json("plan/plan.json")
    assert len(document["parameters"]) == 21
    assert any(not one["told"] and one["standard_uncertainty"] is None for one in document["parameters"])
    assert document["not_told"]
    sheet = bench.text("plan/sheet.html")
    assert sheet.count('class="box"') == 4
    for words in ("counter-clockwise", "1 turns (360°)", "display before", "+x", "angle_deg"):
        assert words in sheet
    assert "<script" not in sheet


def test_what_holds_and_turns_tell_of_a_hand_held_test_is_foretold(bench: Bench) -> None:
    told = bench("plan hand-held --imu tactical --site 48 --poses 9 --json").json
    found = {one["name"]: one for one in told["parameters"]}
    assert len(found) == 21
    # a nominal sample rate, 1 % over the root of three, which a tactical gyro's own part is far below
    scale = found["gyro scale factor error x"]["standard_uncertainty"]
    assert scale == pytest.approx(0.0057735, rel=1e-2)


def test_a_stated_sample_rate_is_in_the_gyro_scale_factors_and_in_their_target(bench: Bench) -> None:
    """With a clock of 3000 and one of 0.1 ppm: squares differ by the clocks', which the Earth hardly tells."""
    call = "plan multi-position-26 --imu tactical --targets gyro-scale=2000 --json --rate"
    coarse, fine = (bench(call, rate) for rate in ("100±0.3", "100±0.00001"))
    wide, narrow = (
        {one["name"]: one["standard_uncertainty"] for one in answer.json["parameters"]}
        for answer in (coarse, fine)
    )
    for axis in "xyz":
        name = f"gyro scale factor error {axis}"
        assert wide[name] ** 2 - narrow[name] ** 2 == pytest.approx(9e-6, rel=2e-2)
    assert wide["accelerometer bias x"] == pytest.approx(narrow["accelerometer bias x"], rel=1e-6)
    assert "The target is not reached by gyro scale factor error x" in coarse.out
    assert "All targets are reached" in fine.out


def test_the_next_step_after_a_recording_is_said(bench: Bench) -> None:
    """Four holds are too few for a calibration; five faces want the sixth."""
    steps = holds("x", "y", "z", "-x", more="    uncertainty_deg: 3\n")
    bench.put("few.yaml", HEAD.format("hand-held") + steps)
    bench.put("five.yaml", HEAD.format("multi-position") + holds("x", "y", "z", "-y", "-z"))
    for name in ("few", "five"):
        bench(f"simulate {name}.yaml --imu tactical -o {name} -q")
    said = bench("plan few.yaml --imu tactical --given few/recording.csv -q").said
    for words in ("4 holds", "Not determined yet", "Next: "):
        assert words in said
    said = bench(POSES, "--given five/recording.csv -q").said
    for words in ("5 different poses", "Not determined yet", "Next: hold -x up for 30 s"):
        assert words in said


def test_a_calibration_shows_what_the_plan_beside_its_protocol_predicted(bench: Bench) -> None:
    unit = "--imu tactical --site 48.14,520"
    bench(f"simulate turntable-9 {unit} --seed 3 -o table -q")
    bench(f"plan turntable-9 {unit} --rate 100±0.0001 -o plan -q")
    (bench.folder / "plan" / "plan.json").rename(bench.folder / "table" / "plan.json")
    said = bench.run("calibrate --protocol table/protocol.yaml -o made").said
    found = re.search(r"median uncertainty is ([\d.]+) times the predicted one", said)
    assert found is not None, said
    assert 0.7 < float(found[1]) < 1.5
    assert "achieved over predicted" in bench.text("made/report.html")


def test_a_plan_of_poses_is_written_simulated_and_calibrated(bench: Bench) -> None:
    """The calibration's own uncertainties are those that the plan foretells."""
    answer = bench("plan multi-position --imu ring-laser --site 48.1 --poses 12 --hold 8 -o plan --json")
    assert set(bench.contents("plan")) == PLAN
    assert answer.json == bench.json("plan/plan.json")
    sheet = bench.text("plan/sheet.html")
    assert sheet.count('class="box"') == 12
    assert "8 s</b> at rest" in sheet
    assert "<script" not in sheet
    bench("simulate plan/protocol.yaml --imu ring-laser -o played")
    assert bench.run("calibrate --protocol played/protocol.yaml -o made").status in (0, 1)
    stated, foretold = (
        {one["name"]: one["standard_uncertainty"] for one in document["parameters"]}
        for document in (bench.json("made/calibration.json"), answer.json)
    )
    ratios = [stated[f"accelerometer bias {axis}"] / foretold[f"accelerometer bias {axis}"] for axis in "xyz"]
    assert 0.7 < np.exp(np.mean(np.log(ratios))) < 1.4
