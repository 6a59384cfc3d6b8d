"""`tumble noise` as a user meets it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

RATE = 100.0


@pytest.fixture(scope="module")
def still() -> np.ndarray:
    """Two minutes at rest: N is 3e-4 m/s²/√Hz and 1e-4 rad/s/√Hz."""
    rng = np.random.default_rng(8)
    count = 12_000
    force = 3e-4 * np.sqrt(RATE) * rng.standard_normal((count, 3)) + [0.05, -0.1, 9.81]
    turn = 1e-4 * np.sqrt(RATE) * rng.standard_normal((count, 3)) + [0.001, 0.002, -0.003]
    return np.column_stack([np.arange(count) / RATE, force, turn])


@pytest.fixture(scope="module")
def folder(tumble: Any, written: Any, still: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where `tumble noise still.csv -o out` was typed, with what it printed in `said.txt`."""
    folder = tmp_path_factory.mktemp("noise")
    answer = tumble("noise", written(folder / "still.csv", still), "-o", folder / "out")
    assert (answer.status, answer.err) == (0, "")
    (folder / "said.txt").write_text(answer.out, encoding="utf-8")
    return folder


def test_noise_prints_every_channel_and_writes_a_document_and_a_page(folder: Path) -> None:
    said = (folder / "said.txt").read_text(encoding="utf-8")
    for word in ("ax ", "gz ", "velocity random walk", "angle random walk", "°/√h", "µg/√Hz", "IEEE Std 952"):
        assert word in said
    assert sorted(p.name for p in (folder / "out").iterdir()) == ["noise.html", "noise.json"]
    document = json.loads((folder / "out" / "noise.json").read_text(encoding="utf-8"))
    assert (document["format"], document["version"]) == ("tumble noise", 1)
    for name, expected, unit in (("ay", 3e-4, "m/s²/√Hz"), ("gx", 1e-4, "rad/s/√Hz")):
        white = document["channels"][name]["terms"]["N"]
        # 12,000 samples know N to 0.7 %, four of these.
        assert white["value"] == pytest.approx(expected, rel=0.03)
        assert white["unit"] == unit
        assert document["channels"][name]["random_walk"]["value"] == white["value"]
    angle_walk = document["channels"]["gx"]["terms"]["N"]["practical"]
    assert angle_walk["unit"] == "°/√h"
    assert angle_walk["value"] == pytest.approx(np.degrees(1e-4) * 60.0, rel=0.03)
    curve = document["channels"]["gx"]["allan_deviation"]
    assert len(curve["tau_s"]) == len(curve["deviation"]) == len(curve["low"]) == len(curve["high"])
    page = (folder / "out" / "noise.html").read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert 'src="http' not in page
    for name in ("allan-g", "allan-a", "spectrum-g", "level-a"):
        assert f'id="{name}"' in page


def test_json_is_the_document(tumble: Any, written: Any, still: np.ndarray, tmp_path: Path) -> None:
    path = written(tmp_path / "still.csv", still[:500])
    answer = tumble("noise", path, "--json", "-o", tmp_path / "out")
    written_one = json.loads((tmp_path / "out" / "noise.json").read_text(encoding="utf-8"))
    assert json.loads(answer.out) == written_one


def test_quiet_prints_what_is_seen_and_no_more_and_without_a_folder_nothing_is_written(
    tumble: Any, written: Any, still: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "still.csv", still[:2000])
    monkeypatch.chdir(tmp_path)
    answer = tumble("noise", path, "-q")
    assert answer.status == 0
    assert [p.name for p in tmp_path.iterdir()] == ["still.csv"]
    assert "not seen" not in answer.out
    assert "•" not in answer.out
    assert len(re.findall("random walk", answer.out)) == 6


@pytest.mark.usefixtures("how")
def test_a_clock_whose_two_sides_do_not_agree_is_refused_with_the_place(
    tumble: Any, written: Any, still: np.ndarray, tmp_path: Path
) -> None:
    reset = still[:6000].copy()
    reset[4000:, 0] = 3.0 * (reset[4000:, 0] - 40.0)
    answer = tumble("noise", written(tmp_path / "reset.csv", reset))
    answer.is_told(2, "time steps back")
    # above it, on a slow machine, stands how far the reading had come
    assert "Traceback" not in answer.err
    assert "time steps back" in answer.err.splitlines()[-1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--skip", "-3"], "--skip"),
        (["--fit", "best"], "curve or moments"),
        (["-o", "still.csv"], "is one of the inputs"),
    ],
)
def test_wrong_options_end_in_a_sentence(
    tumble: Any,
    written: Any,
    still: np.ndarray,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    words: str,
) -> None:
    written(tmp_path / "still.csv", still[:500])
    monkeypatch.chdir(tmp_path)
    tumble("noise", "still.csv", *options).is_told(2, words)


def test_a_gyro_that_was_not_found_is_missed_aloud(tumble: Any, still: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "odd.csv"
    header = "time_s,ax_m/s2,ay_m/s2,az_m/s2,one,two,three"
    np.savetxt(path, still[:1000], delimiter=",", header=header, comments="")
    answer = tumble("noise", path)
    assert answer.status == 0
    assert "There is no gyro: what was found is" in answer.out


def test_terms_by_wavelet_moments_are_near_those_by_the_curve(
    tumble: Any, written: Any, still: np.ndarray, tmp_path: Path
) -> None:
    path = written(tmp_path / "rest.csv", still)
    by = {}
    for method in ("curve", "moments"):
        answer = tumble("noise", path, "--fit", method, "--json")
        assert answer.status == 0, answer.err
        by[method] = json.loads(answer.out)["channels"]["gx"]
    assert "wavelet moments" in by["moments"]["fit"]["what"]
    one, other = (found["terms"]["N"] for found in by.values())
    assert one["value"] != other["value"]
    # both from one recording: their difference is below the uncertainty of either
    assert abs(one["value"] - other["value"]) < one["standard_uncertainty"]


@pytest.fixture(scope="module")
def noise(tumble: Any, written: Any, rows: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `tumble noise` writes for two minutes of the noise that the first hold of the good recording has."""
    folder = tmp_path_factory.mktemp("noise")
    rng = np.random.default_rng(5)
    count = 6000
    still = rows[5:100, 1:]
    signal = still.mean(axis=0) + still.std(axis=0, ddof=1) * rng.standard_normal((count, 6))
    path = written(folder / "still.csv", np.column_stack([np.arange(count) / 50.0, signal]))
    assert tumble("noise", path, "-o", folder / "noise").status == 0
    return folder / "noise" / "noise.json"


def sigma_of_biases(folder: Path) -> float:
    """Root mean square of the stated standard uncertainties of the accelerometers' biases."""
    document = json.loads((folder / "calibration.json").read_text(encoding="utf-8"))
    named = [p for p in document["parameters"] if p["name"].startswith("accelerometer bias")]
    assert len(named) == 3
    return float(np.sqrt(np.mean([p["standard_uncertainty"] ** 2 for p in named])))


def test_a_calibration_counts_the_models(tumble: Any, recording: Path, noise: Path, tmp_path: Path) -> None:
    content = json.loads(noise.read_text(encoding="utf-8"))
    # m/s²/√s: 7 mm/s² over a hold of a dozen seconds, many times the noise
    walk = {"letter": "K", "value": 2e-3}
    for name in ("ax", "ay", "az"):
        content["channels"][name]["terms"]["K"] = walk
    (wandering := tmp_path / "wandering.json").write_text(json.dumps(content), encoding="utf-8")
    sigmas: list[float] = []
    for path in (noise, wandering):
        answer = tumble("calibrate", recording, "--noise", path, "-o", tmp_path / path.stem)
        assert answer.status == 0, answer.err
        text = (tmp_path / path.stem / "calibration.json").read_text(encoding="utf-8")
        assert f"the noise models in {path}; that neighbouring holds are off together is counted" in text
        sigmas.append(sigma_of_biases(tmp_path / path.stem))
    assert sigmas[1] > 2.0 * sigmas[0]
