"""`tumble calibrate --turn-ons`: several recordings of one unit from the command line, and every wrong mixture."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from tumble.document import read_calibration
from tumble.earth import Site
from tumble.workflows.calibrate import calibrate
from tumble.workflows.verify import force_wander

GRAVITY = 9.81


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory,
    sessions: Callable[..., np.ndarray],
    written: Callable[..., Path],
) -> Path:
    """Two turn-ons of a unit, the second with other biases, and one of another unit."""
    made = tmp_path_factory.mktemp("turn-ons")
    written(made / "monday.csv", sessions(3, holds=12))
    rows = sessions(4, holds=12)
    rows[:, 1:4] += [0.05, -0.03, 0.02]
    rows[:, 4:7] += [2e-3, 1e-3, -3e-3]
    written(made / "tuesday.csv", rows)
    written(made / "stranger.csv", sessions(5, unit_seed=101, holds=12))
    return made


@pytest.fixture(scope="module")
def answer(tumble: Any, folder: Path) -> Any:
    return tumble(
        *("calibrate", folder / "monday.csv", folder / "tuesday.csv", "--turn-ons"),
        *("--gravity", GRAVITY, "-o", folder / "results"),
    )


def test_two_turn_ons_give_one_calibration_and_the_biases_of_each(answer: Any, folder: Path) -> None:
    assert answer.status == 0, answer
    assert "2 recordings of one unit, each a turn-on of its own" in " ".join(answer.out.split())
    document = read_calibration(folder / "results")
    told = document.turn_ons
    assert told is not None
    assert [r.name for r in told.recordings] == ["monday.csv", "tuesday.csv"]
    moved = [
        b.values[1] - b.values[0] for b in told.biases if b.values[0] is not None and b.values[1] is not None
    ]
    # By what was added, within the wander of both and what the g-sensitivity, left out here, makes of other poses.
    np.testing.assert_allclose(moved[:3], [0.05, -0.03, 0.02], atol=0.008)
    np.testing.assert_allclose(moved[3:], [2e-3, 1e-3, -3e-3], atol=8e-4)
    bias = next(p for p in document.parameters if p.name == "gyro bias z")
    # Student's factor of a scatter that two turn-ons tell.
    assert bias.coverage_factor == pytest.approx(12.706, abs=1e-3)
    assert bias.standard_uncertainty == pytest.approx(told.biases[5].next_sigma)
    # Each states how far biases move from hold to hold: another recording's move as in the mean of them, no sum.
    moved_by = {f"accelerometer bias from hold to hold, m/s² ({r.name})": 3e-3 for r in document.recordings}
    wandering = structs.replace(document.quality, variance_components=moved_by)
    assert force_wander(structs.replace(document, quality=wandering)) == pytest.approx(3e-3)


def test_the_report_shows_each_turn_on(answer: Any, folder: Path) -> None:
    assert answer.status == 0
    page = (folder / "results" / "report.html").read_text(encoding="utf-8")
    for words in ("From turn-on to turn-on", "tuesday.csv", "for the next turn-on", "turn-ons-gyro"):
        assert words in page


def test_recordings_of_two_units_are_said_to_be(tumble: Any, folder: Path, tmp_path: Path) -> None:
    done = tumble(
        *("calibrate", folder / "monday.csv", folder / "stranger.csv", "--turn-ons"),
        *("--gravity", GRAVITY, "-o", tmp_path / "none"),
    )
    done.is_told(2, "are not of one unit", "Calibrate each unit by itself.")
    assert not (tmp_path / "none").exists()


def test_what_cannot_take_part_is_left_out_by_name_and_not_the_others_with_it(
    tumble: Any, answer: Any, folder: Path, tmp_path: Path
) -> None:
    assert answer.status == 0
    lines = (folder / "tuesday.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "short.csv").write_text("".join(lines[:200]), encoding="utf-8")
    names = [folder / "monday.csv", tmp_path / "short.csv", folder / "stranger.csv", folder / "tuesday.csv"]
    done = tumble("calibrate", *names, "--turn-ons", "--gravity", GRAVITY, "-o", tmp_path / "made")
    assert done.status == 0, done
    for said in ("short.csv cannot take part: ", "stranger.csv takes no part: "):
        assert said in " ".join(done.out.split())
    made, before = (read_calibration(place) for place in (tmp_path / "made", folder / "results"))
    assert made.turn_ons is not None
    assert [r.name for r in made.turn_ons.recordings] == ["monday.csv", "tuesday.csv"]
    assert [p.value for p in made.parameters] == pytest.approx([p.value for p in before.parameters])


def in_g(rows: np.ndarray) -> np.ndarray:
    changed = rows.copy()
    changed[:, 1:4] /= 9.80665
    return changed


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        (["monday.csv"], [], "--turn-ons takes two recordings of the unit or more"),
        (["monday.csv", "monday.csv"], [], "are the same recording"),
        (["monday.csv", "copy.csv"], [], "hold the same samples"),
        (["monday.csv", "in-g.csv"], [], "has other units or sensors than monday.csv"),
        (["monday.csv", "short.csv"], [], "short.csv cannot take part: "),
        (["monday.csv", "tuesday.csv"], ["--procedure", "hand-held"], "--procedure hand-held was asked for"),
        (
            ["monday.csv", "tuesday.csv"],
            ["--monte-carlo", "1000"],
            "--monte-carlo does not go with --turn-ons",
        ),
        (["monday.csv", "nobody.csv"], [], "nobody.csv"),
    ],
)
def test_what_does_not_go_together_is_said_in_a_sentence(
    tumble: Any,
    folder: Path,
    sessions: Callable[..., np.ndarray],
    written: Callable[..., Path],
    tmp_path: Path,
    names: list[str],
    options: list[str],
    words: str,
) -> None:
    rows = sessions(3, holds=12)
    makers: dict[str, Callable[[], np.ndarray]] = {
        "copy.csv": lambda: np.column_stack([rows[:, 0] + 100.0, rows[:, 1:]]),
        "in-g.csv": lambda: in_g(sessions(4, holds=12)),
        "short.csv": lambda: sessions(4, holds=12)[:200],
    }
    for name in names:
        if name in makers:
            written(tmp_path / name, makers[name]())
    paths = [folder / name if (folder / name).exists() else tmp_path / name for name in names]
    done = tumble("calibrate", *paths, "--turn-ons", "--gravity", GRAVITY, "-o", tmp_path / "none", *options)
    done.is_told(2, words)
    assert not (tmp_path / "none").exists()


def test_a_simulated_unit_that_is_switched_on_anew_has_other_biases_and_else_is_the_same(
    tumble: Any, tmp_path: Path
) -> None:
    """By 2 mg and 60 °/h, one sigma: six draws of each kind are not all beyond four, nor all zero."""
    truths: list[dict[str, Any]] = []
    for seed in (1, 2):
        folder = tmp_path / f"day{seed}"
        options = f"--unit-seed 5 --seed {seed} --sample-rate 10 --turn-on-bias 2,60 -q".split()
        assert tumble("simulate", "six-position", *options, "-o", folder).status == 0
        truths.append(json.loads((folder / "truth.json").read_text(encoding="utf-8")))
    first, second = truths
    for triad, sigma in (("accelerometer", 2e-3 * 9.80665), ("gyroscope", np.radians(60.0) / 3600.0)):
        assert first[triad]["matrix"] == second[triad]["matrix"]
        moved = np.subtract(first[triad]["bias"], second[triad]["bias"])
        assert np.all(moved != 0.0)
        assert np.max(np.abs(moved)) < 4.0 * np.sqrt(2.0) * sigma


def test_a_turn_on_that_moves_biases_by_less_than_nothing_is_refused(tumble: Any, tmp_path: Path) -> None:
    done = tumble("simulate", "six-position", "--turn-on-bias=-1,60", "-o", tmp_path / "none")
    done.is_told(2, "--turn-on-bias takes two numbers that are not negative")


def test_an_earlier_calibration_counts_once_and_a_strangers_is_objected_to(
    tumble: Any, answer: Any, folder: Path, tmp_path: Path
) -> None:
    assert answer.status == 0
    both = (folder / "monday.csv", folder / "tuesday.csv", "--turn-ons", "--gravity", GRAVITY)
    again = tumble("calibrate", *both, "--prior", folder / "results", "-o", tmp_path / "again")
    assert again.status == 0, again
    sigmas = [
        {
            p.name: p.standard_uncertainty
            for p in read_calibration(place).parameters
            if "accelerometer non" in p.name
        }
        for place in (folder / "results", tmp_path / "again")
    ]
    for angle, sigma in sigmas[0].items():
        # as much again as both recordings told; what they disagree by is in both
        assert sigmas[1][angle] == pytest.approx(sigma / np.sqrt(2.0), rel=0.15)
    alone = tumble("calibrate", folder / "stranger.csv", "--gravity", GRAVITY, "-o", tmp_path / "stranger")
    assert alone.status == 0, alone
    other = calibrate(
        [folder / "monday.csv", folder / "tuesday.csv"],
        site=Site.from_gravity(GRAVITY),
        prior=tmp_path / "stranger",
        turn_ons=True,
    )
    assert not other.accepted
    assert "The prior contradicts the recording" in " ".join(other.calibration.verdict.reasons)
