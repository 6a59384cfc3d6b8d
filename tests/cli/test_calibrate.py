"""`tumble calibrate`: one recording, several, what is known before, limits, and verdicts that are against it."""

import json
from typing import Any

import numpy as np
import pytest
from tests.cli.program import Bench, spoiled, tumbled_rows

from tumble.document import read_calibration

CALIBRATE = "calibrate tumbled.csv --gravity 9.81"


def sigmas(document: Any, beginning: str) -> dict[str, float]:
    """The standard uncertainties of the parameters whose names begin so."""
    return {
        p["name"]: p["standard_uncertainty"]
        for p in document["parameters"]
        if p["name"].startswith(beginning)
    }


def test_calibrate_prints_parameters_and_verdict_and_writes_the_document_and_a_page(tumble: Bench) -> None:
    """--json is the document that is written: the same each time but for the date. -q is the verdict alone."""
    answer = tumble(CALIBRATE, "-o results")
    for word in ("hand-held", "bias", "FIT FOR USE", "calibration.json", "report.html"):
        assert word in answer.out
    assert set(tumble.contents("results")) == {"calibration.json", "report.html"}
    page = tumble.text("results/report.html")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert 'src="http' not in page  # one file that works offline
    again = tumble(CALIBRATE, "-o again --json").json
    assert again == tumble.json("again/calibration.json")
    assert again | {"created": ""} == tumble.json("results/calibration.json") | {"created": ""}
    # All accelerometers reversed together look the same.
    assert any("cannot be seen" in remark and "sign of gravity" in remark for remark in again["remarks"])
    quiet = tumble(CALIBRATE, "-q")
    assert quiet.out.startswith("FIT FOR USE")
    assert "bias x" not in quiet.out
    assert len(quiet.out.splitlines()) <= 4
    assert "report.html" in tumble.contents("tumbled-calibration")  # named after the recording


@pytest.mark.parametrize(
    ("columns", "factor", "options", "fit", "word"),
    [
        (slice(3, 4), 1.0 / 9.80665, "--units counts", False, "g beside m/s²"),
        (slice(1, 4), 1.13, "--units m/s^2,rad/s", False, "beyond belief"),
        (slice(1, 4), 1.13, "--units m/s^2,rad/s --confirm-scale", True, "confirmed"),
        (slice(1, 4), 1.08, "--units m/s^2,rad/s", True, "unusual"),
    ],
)
def test_scale_factors_that_few_or_no_units_have_are_in_the_verdict(
    tumble, rows, columns, factor, options, fit, word
):
    """A wrong scale fits gravity as well as the right one: residuals cannot show it."""
    other = rows.copy()
    other[:, columns] *= factor
    tumble.write("other.csv", other)
    answer = tumble("calibrate other.csv --gravity 9.81 -o results", options, status=0 if fit else 1)
    assert ("NOT FIT" in answer.out) == (not fit)
    verdict = tumble.json("results/calibration.json")["verdict"]
    assert verdict["fit"] is fit
    assert word in " ".join(verdict["reasons"])


def test_without_a_site_gravity_is_assumed_and_its_uncertainty_is_in_the_scale_factors(tumble: Bench) -> None:
    """0.015 m/s² of 9.80665 m/s² is 0.15 % for all three alike; -v prints it, and what each stage took."""
    answer = tumble("calibrate tumbled.csv -o r -v --imu-model MPU-9150 --imu-serial", "7")
    for word in ("assumed: ", "reading", "solving", "reporting"):
        assert word in answer.out
    document = tumble.json("r/calibration.json")
    assert (document["imu"]["model"], document["imu"]["serial_number"]) == ("MPU-9150", "7")
    assert "assumed" in document["site"]["gravity_source"]
    scale = sigmas(document, "accelerometer scale")
    assert len(scale) == 3
    assert all(0.0015 < sigma < 0.0017 for sigma in scale.values())


def test_intervals_that_are_given_are_used_instead_of_a_search(tumble: Bench) -> None:
    tumble.put("holds.txt", "".join(f"{4.1 * k + 0.3} {4.1 * k + 2.3}\n" for k in range(20)))
    assert tumble(CALIBRATE, "-o r --intervals holds.txt --json").json["quality"]["holds"] == 20


def test_demo_calibrates_the_recording_that_ships_with_the_package(tumble: Bench) -> None:
    answer = tumble("demo -o demo")
    assert "FIT FOR USE" in answer.out
    assert "[bold]" not in answer.out
    assert "\\[" not in answer.out
    assert tumble.json("demo/calibration.json")["imu"]["model"] == "MPU-9150"
    assert "report.html" in tumble.contents("demo")


def test_several_recordings_of_one_unit_are_taken_together(tumble: Bench) -> None:
    """Two sessions know more than one: the uncertainties fall. Of other kinds, units or without holds they do not."""
    rows = tumbled_rows(11)
    tumble.write("other.csv", rows)
    tumble(CALIBRATE, "other.csv -o r -q")
    document = tumble.json("r/calibration.json")
    assert [r["name"] for r in document["recordings"]] == ["tumbled.csv", "other.csv"]
    assert document["quality"]["holds"] == 40
    assert document["quality"]["turns"] == 38  # none goes from one recording to the next
    alone, both = sigmas(tumble.json("calibrated/calibration.json"), ""), sigmas(document, "")
    assert np.median([both[name] / alone[name] for name in alone if name in both]) < 0.9
    tumble.write("in-g.csv", rows / [1.0, *[9.80665] * 3, 1.0, 1.0, 1.0])
    tumble.refuses("calibrate tumbled.csv in-g.csv -o new", "in-g.csv has other units")
    # Other biases in one file: calibrated as one unit, both would be wrong by half of the difference.
    for columns, step, word in (
        (slice(4, 7), 0.02, "at rest gyro"),
        (slice(1, 4), 0.1, "by themselves they have accelerometer"),
    ):
        moved = rows.copy()
        moved[:, columns] += step * np.array([1.0, -0.5, 0.2])
        tumble.write("other.csv", moved)
        tumble.refuses(f"{CALIBRATE} other.csv -o new", word, "--turn-ons")
    # A gyro bias of 0.1 rad/s looks like motion beside a unit that has none.
    rows[:, 4:7] += [0.1, -0.05, 0.02]
    (tmp := tumble.folder / "apart").mkdir()
    tumble.write("apart/tumbled.csv", rows)
    tumble(CALIBRATE, tmp / "tumbled.csv", "-o none", status=1)
    verdict = tumble.json("none/calibration.json")["verdict"]
    assert "tumbled.csv (2) gives no hold" in " ".join(verdict["reasons"])


def test_earlier_calibrations_are_kept_of_another_recording_a_papers_or_unreadable(tumble, rows):
    unreadable = b'{"format": "tumble calibration", "version": 99}\r\n\xff'
    made = tumble.folder / "made"
    made.mkdir()
    (made / "calibration-mine.json").write_text("{}")
    (made / "calibration.json").write_bytes(unreadable)
    tumble(CALIBRATE, "-o made --estimator multi-position-9")
    tumble(CALIBRATE, "-o made")
    (kept,) = made.glob("calibration-before-*.json")
    assert kept.read_bytes() == unreadable
    paper = made / "calibration-multi-position-9.json"
    before = {unreadable, (made / "calibration.json").read_bytes(), paper.read_bytes()}
    tumble.write("other.csv", rows[:-1])
    answer = tumble("calibrate other.csv --gravity 9.81 -o made")
    found = [*made.glob("calibration-before-*.json")]
    assert {one.read_bytes() for one in found} == before
    assert all(one.name in answer.out for one in found if one != kept)
    names = {"calibration.json", "calibration-mine.json", "report.html", *(one.name for one in found)}
    assert set(tumble.contents("made")) == names


def test_limits_are_kept_or_not_whatever_the_verdict(tumble: Bench) -> None:
    tumble.put("tight.yaml", "limits: {accelerometer bias: 0.001 mg}\n")
    tumble.put(
        "wide.yaml", "rule: guarded\nlimits: {accelerometer bias: 1 g, gyro scale factor error: 20 %}\n"
    )
    answer = tumble(CALIBRATE, "-o made --limits tight.yaml", status=1)
    assert "FIT FOR USE\n" in answer.out
    assert "NOT FIT FOR USE" not in answer.out
    assert "OUT OF LIMITS" in answer.out
    document = tumble.json("made/calibration.json")
    assert (document["verdict"]["fit"], document["limits"]["decision"]) == (True, "failed")
    assert "Out of limits" in tumble.text("made/report.html")
    assert "WITHIN LIMITS" in tumble(CALIBRATE, "-o wide --limits wide.yaml").out
    (result,) = tumble("verify calibrated tumbled.csv --json --limits tight.yaml", status=1).json
    assert (result["fit"], result["limits"]["decision"]) == (True, "failed")


def test_noise_models_are_counted(tumble: Bench, rows: np.ndarray) -> None:
    """Two minutes of the noise that the first hold of the good recording has, and with a random walk beside it."""
    rng = np.random.default_rng(5)
    hold = rows[5:100, 1:]
    signal = hold.mean(axis=0) + hold.std(axis=0, ddof=1) * rng.standard_normal((6000, 6))
    tumble.write("still.csv", np.column_stack([np.arange(6000) / 50.0, signal]))
    tumble("noise still.csv -o .")
    content = tumble.json("noise.json")
    for name in ("ax", "ay", "az"):
        # m/s²/√s: 7 mm/s² over a hold of a dozen seconds, many times the noise
        content["channels"][name]["terms"]["K"] = {"letter": "K", "value": 2e-3}
    tumble.put("wandering.json", json.dumps(content))
    sigmas: list[float] = []
    for name in ("noise", "wandering"):
        tumble(f"calibrate tumbled.csv --noise {name}.json -o {name}")
        said = f"the noise models in {name}.json; that neighbouring holds are off together is counted"
        assert said in tumble.text(f"{name}/calibration.json")
        parameters = tumble.json(f"{name}/calibration.json")["parameters"]
        named = [p["standard_uncertainty"] for p in parameters if p["name"].startswith("accelerometer bias")]
        assert len(named) == 3
        sigmas.append(float(np.sqrt(np.mean(np.square(named)))))
    assert sigmas[1] > 2.0 * sigmas[0]


# --- what is against it


def left_handed(rows: np.ndarray) -> None:
    rows[:, 6] *= -1.0


def test_what_a_refusal_says_of_columns_and_rates_is_enough(tumble: Bench, rows: np.ndarray) -> None:
    tumble.write("mirrored.csv", spoiled(rows, left_handed))
    refused = tumble.run("calibrate mirrored.csv --gravity 9.81 -o results").err
    columns = "t,ax,ay,az," + refused.partition("gyro's columns ")[2].partition(" with")[0].replace(" ", "")
    tumble("calibrate mirrored.csv --gravity 9.81 -o results -q --columns", columns)
    # Half of the true rate makes the gyro's numbers twice as large as rad/s: no unit is so.
    tumble.write("bare.csv", rows[:, 1:], "ax,ay,az,gx,gy,gz")
    answer = tumble("calibrate bare.csv --gravity 9.81 --rate 25 -o out", status=1)
    assert answer.out.startswith("NOT FIT FOR USE")
    assert "the sampling rate is not" in answer.said


def test_six_poses_for_nine_unknowns_are_not_fit_and_serve_with_a_prior(tumble: Bench) -> None:
    """The verdict names --prior; with the earlier calibration of the same unit the six poses serve."""
    tumble.write("six.csv", tumbled_rows(5, faces_only=True))
    alone = tumble("calibrate six.csv --gravity 9.81 -o alone", status=1)
    assert "6 different poses were found and 9 are needed" in alone.said
    assert "--prior" in alone.said
    answer = tumble("calibrate six.csv --gravity 9.81 -o results --prior calibrated --json")
    now = {p["name"]: p for p in answer.json["parameters"]}
    for before in tumble.json("calibrated/calibration.json")["parameters"]:
        name, sigma = before["name"], before["standard_uncertainty"]
        if name.startswith("accelerometer non-orthogonality"):
            # Six norms say nothing of the angles, turns between them little: they stay what the prior says.
            assert now[name]["value"] == pytest.approx(before["value"], abs=0.5 * sigma)
            assert 0.5 * sigma < now[name]["standard_uncertainty"] < 1.001 * sigma
        if name.startswith("accelerometer"):
            both = np.hypot(sigma, now[name]["standard_uncertainty"])
            assert abs(now[name]["value"] - before["value"]) < 4.0 * both, name


def test_a_prior_that_states_no_uncertainty_is_refused(tumble: Bench) -> None:
    """Neither none nor one of nothing."""
    document = tumble.json("calibrated/calibration.json")
    zero = (0.0 * np.array(document["covariance"])).tolist()
    tumble.put("zero.json", json.dumps(document | {"covariance": zero}))
    tumble.put("none.json", json.dumps(document | {"covariance": [], "covariance_parameters": []}))
    tumble.refuses("calibrate tumbled.csv -o new --prior zero.json", "no uncertainty")
    tumble.refuses("calibrate tumbled.csv -o new --prior none.json", "covariance", "--prior")


# --- several turn-ons


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Two turn-ons of a unit, the second with other biases, calibrated, and recordings that do not go with them."""
    made = Bench(tmp_path_factory.mktemp("turn-ons"))
    monday, tuesday = tumbled_rows(3, holds=12), tumbled_rows(4, holds=12)
    in_g = tuesday / [1.0, *[9.80665] * 3, 1.0, 1.0, 1.0]
    tuesday[:, 1:] += [0.05, -0.03, 0.02, 2e-3, 1e-3, -3e-3]
    for name, rows in {
        "monday": monday,
        "tuesday": tuesday,
        "stranger": tumbled_rows(5, unit_seed=101, holds=12),
        "copy": monday + np.array([100.0, *[0.0] * 6]),
        "in-g": in_g,
        "short": tuesday[:200],
    }.items():
        made.write(f"{name}.csv", rows)
    said = made(BOTH, "-o results").said
    assert "2 recordings of one unit, each a turn-on of its own" in said
    return made


BOTH = "calibrate monday.csv tuesday.csv --turn-ons --gravity 9.81"


def test_two_turn_ons_give_one_calibration_and_the_biases_of_each(days: Bench) -> None:
    document = read_calibration(days.folder / "results")
    told = document.turn_ons
    assert [r.name for r in told.recordings] == ["monday.csv", "tuesday.csv"]
    moved = [float(b.values[1] or 0.0) - float(b.values[0] or 0.0) for b in told.biases]
    # By what was added, within the wander of both and what the g-sensitivity, left out here, makes of other poses.
    np.testing.assert_allclose(moved[:3], [0.05, -0.03, 0.02], atol=0.008)
    np.testing.assert_allclose(moved[3:], [2e-3, 1e-3, -3e-3], atol=8e-4)
    bias = next(p for p in document.parameters if p.name == "gyro bias z")
    # Student's factor of a scatter that two turn-ons tell.
    assert bias.coverage_factor == pytest.approx(12.706, abs=1e-3)
    assert bias.standard_uncertainty == pytest.approx(told.biases[5].next_sigma)
    page = days.text("results/report.html")
    for words in ("From turn-on to turn-on", "tuesday.csv", "for the next turn-on", "turn-ons-gyro"):
        assert words in page


def test_what_cannot_take_part_is_left_out_by_name_and_not_the_others_with_it(days: Bench) -> None:
    answer = days("calibrate monday.csv short.csv stranger.csv tuesday.csv --turn-ons --gravity 9.81 -o made")
    for said in ("short.csv cannot take part: ", "stranger.csv takes no part: "):
        assert said in answer.said
    made, before = (read_calibration(days.folder / name) for name in ("made", "results"))
    assert [r.name for r in made.turn_ons.recordings] == ["monday.csv", "tuesday.csv"]
    assert [p.value for p in made.parameters] == pytest.approx([p.value for p in before.parameters])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ("monday.csv stranger.csv", "are not of one unit: .*Calibrate each unit by itself"),
        ("monday.csv", "--turn-ons takes two recordings of the unit or more"),
        ("monday.csv monday.csv", "are the same recording"),
        ("monday.csv copy.csv", "hold the same samples"),
        ("monday.csv in-g.csv", "has other units or sensors than monday.csv"),
        ("monday.csv short.csv", "short.csv cannot take part: "),
        ("monday.csv tuesday.csv --procedure hand-held", "--procedure hand-held was asked for"),
        ("monday.csv tuesday.csv --monte-carlo 1000", "--monte-carlo does not go with --turn-ons"),
        ("monday.csv nobody.csv", "nobody.csv"),
    ],
)
def test_what_does_not_go_together_is_said_in_a_sentence(days: Bench, call: str, words: str) -> None:
    days.refuses(f"calibrate {call} --turn-ons --gravity 9.81 -o none", words)


def test_an_earlier_calibration_counts_once_and_a_strangers_is_objected_to(days: Bench) -> None:
    days(BOTH, "--prior results -o again")
    before, after = (
        sigmas(days.json(f"{n}/calibration.json"), "accelerometer non") for n in ("results", "again")
    )
    for angle, sigma in before.items():
        # as much again as both recordings told; what they disagree by is in both
        assert after[angle] == pytest.approx(sigma / np.sqrt(2.0), rel=0.15)
    days("calibrate stranger.csv --gravity 9.81 -o strangers")
    answer = days(BOTH, "--prior strangers -o objected", status=1)
    assert "The prior contradicts the recording" in answer.said
