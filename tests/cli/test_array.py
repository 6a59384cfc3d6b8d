"""`tumble calibrate --array`: units that were tumbled together, from the command line, and what is no array."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.calibration import read_calibration

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


def test_each_unit_gets_a_calibration_and_the_array_a_table(tumble: Any, folder: Path) -> None:
    done = tumble(
        *("calibrate", folder / "left.csv", folder / "right.csv", "--array", TERMS),
        *("--gravity", GRAVITY, "-o", folder / "results"),
    )
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
