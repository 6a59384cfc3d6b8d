"""`tumble calibrate --array`: units that were tumbled together, from the command line, and what is no array."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.document import read_calibration

GRAVITY = 9.81
TERMS = "--no-optional-terms"


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory,
    sessions: Callable[..., np.ndarray],
    written: Callable[..., Path],
) -> Path:
    """Two units in one motion, and one in another."""
    made = tmp_path_factory.mktemp("array")
    written(made / "left.csv", sessions(3, unit_seed=100, holds=12))
    written(made / "right.csv", sessions(3, unit_seed=101, holds=12))
    written(made / "elsewhere.csv", sessions(4, unit_seed=102, holds=12))
    return made


@pytest.fixture(scope="module")
def done(tumble: Any, folder: Path) -> Any:
    return tumble(
        *("calibrate", folder / "left.csv", folder / "right.csv", "--array", TERMS),
        *("--gravity", GRAVITY, "-o", folder / "results"),
    )


def test_each_unit_gets_a_calibration_and_the_array_a_table(done: Any, folder: Path) -> None:
    assert done.status == 0, done
    assert "mounting / deg" in done.out
    assert "fixed to one another" in done.out
    document = json.loads((folder / "results" / "array.json").read_text(encoding="utf-8"))
    assert [unit["folder"] for unit in document["units"]] == ["left", "right"]
    for unit in document["units"]:
        own = read_calibration(folder / "results" / unit["folder"])
        assert own.identity == unit["identity"]
        assert (folder / "results" / unit["folder"] / "report.html").exists()
    matrix = np.array(document["units"][1]["mounting"]["matrix_to_first"])
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    # Both are drawn with the same axes, up to the misalignments of a consumer unit's sensors.
    np.testing.assert_allclose(matrix, np.eye(3), atol=0.05)


@pytest.mark.parametrize("swapped", [False, True])
def test_each_unit_has_an_earlier_calibration_of_its_own(
    tumble: Any, done: Any, folder: Path, tmp_path: Path, *, swapped: bool
) -> None:
    """Its non-orthogonalities count as observed once more; those of another unit contradict the poses."""
    assert done.status == 0
    priors = [folder / "results" / name for name in (("right", "left") if swapped else ("left", "right"))]
    again = tumble(
        *("calibrate", folder / "left.csv", folder / "right.csv", "--array", TERMS, "--gravity", GRAVITY),
        *("--prior", priors[0], "--prior", priors[1] / "calibration.json", "-o", tmp_path / "again"),
    )
    assert again.status == int(swapped)
    for name in ("left", "right"):
        before, after = (read_calibration(place / name) for place in (folder / "results", tmp_path / "again"))
        reasons = " ".join(after.verdict.reasons)
        assert ("The prior contradicts the recording" in reasons) == swapped
        if swapped:
            continue
        sigmas = [
            {p.name: p.standard_uncertainty for p in one.parameters if "accelerometer non-orth" in p.name}
            for one in (before, after)
        ]
        for angle, sigma in sigmas[0].items():
            # as much again as was observed, and by common poses some of what the other unit's prior tells
            assert 0.55 * sigma < sigmas[1][angle] < 1.01 * sigma / np.sqrt(2.0)


def test_too_many_earlier_calibrations_are_refused(
    tumble: Any, done: Any, folder: Path, tmp_path: Path
) -> None:
    assert done.status == 0
    prior = folder / "results" / "left"
    answer = tumble(
        *("calibrate", folder / "left.csv", folder / "right.csv", "--array", "-o", tmp_path / "none"),
        *("--prior", prior, "--prior", prior, "--prior", prior),
    )
    assert answer.status == 2
    assert "--prior was given 3 times for 2 units" in " ".join(answer.err.split())
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        (["left.csv"], [], "--array takes the recordings of two units or more"),
        (["left.csv", "left.csv"], [], "are the same recording"),
        (
            ["left.csv", "elsewhere.csv"],
            [],
            "Units of an array are tumbled together and recorded on one clock",
        ),
        (["left.csv", "right.csv"], ["--turn-ons"], "--turn-ons does not go with --array"),
        (["left.csv", "right.csv"], ["--procedure", "turntable"], "--procedure turntable was asked for"),
        (["left.csv", "force.csv"], [], "force.csv lacks a triad"),
    ],
)
def test_what_is_no_array_is_said_in_a_sentence(
    tumble: Any,
    folder: Path,
    sessions: Callable[..., np.ndarray],
    written: Callable[..., Path],
    tmp_path: Path,
    names: list[str],
    options: list[str],
    words: str,
) -> None:
    if "force.csv" in names:
        written(folder / "force.csv", sessions(3, unit_seed=101, holds=12)[:, :4], header="t,ax,ay,az")
    paths = [folder / name for name in names]
    done = tumble(
        "calibrate", *paths, "--array", TERMS, "--gravity", GRAVITY, "-o", tmp_path / "none", *options
    )
    assert done.status == 2, done
    assert words in done.err, done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not (tmp_path / "none").exists()
