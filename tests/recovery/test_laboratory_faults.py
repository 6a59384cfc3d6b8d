"""The laboratory method on recordings of another simulator: what wanders is counted, and what goes wrong is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES, named


def calibrated(seed: int, grade: str, fault: str | None, folder: Path) -> tuple[dict[str, Any], Any]:
    made = PROCEDURES["laboratory"](GRADES[grade], np.random.default_rng(seed), fault)
    protocol = folder / "protocol.yaml"
    protocol.write_text(made.protocol, encoding="utf-8")
    # The simulated clock is exact; stamps that are regular would be taken for a nominal rate, known to 0.6 %.
    table = pl.DataFrame(made.columns())
    rate = f"{1.0 / float(np.median(np.diff(table[table.columns[0]].to_numpy()))):.6f}±0.00001"
    found = tumble.calibrate(table, protocol=protocol, procedure="laboratory", rate=rate)
    return found.calibration.model_dump(), made.truth.terms("fixture")


def scale_errors(document: dict[str, Any], truth: Any) -> np.ndarray:
    """The gyros' scale factors' errors in their standard uncertainties."""
    terms = {"gyroscope.matrix": np.array(document["gyroscope"]["matrix"])}
    off = (
        named(terms)["gyroscope scale"]
        - named({"gyroscope.matrix": truth["gyroscope.matrix"]})["gyroscope scale"]
    )
    sigma = [
        p["standard_uncertainty"]
        for p in document["parameters"]
        if p["name"].startswith("gyro scale factor error")
    ]
    return off / np.array(sigma)


def test_a_gyro_that_wanders_while_the_table_turns_is_in_the_scale_factors(tmp_path: Path) -> None:
    """Without it their errors are 2.2 times the stated ones, of ten recordings."""
    every = [scale_errors(*calibrated(5000 + k, "industrial", None, tmp_path)) for k in range(6)]
    assert 0.6 < float(np.sqrt(np.mean(np.square(every)))) < 1.5


@pytest.mark.parametrize("seed", [1000, 1001])
def test_an_angle_misread_by_half_a_degree_is_named_and_counted(seed: int, tmp_path: Path) -> None:
    document, truth = calibrated(seed, "tactical", "misread", tmp_path)
    assert any("turns both ways about" in reason for reason in document["verdict"]["reasons"])
    assert np.max(np.abs(scale_errors(document, truth))) < 3.0


def test_a_unit_that_slips_on_the_table_is_not_fit(tmp_path: Path) -> None:
    document, _ = calibrated(1002, "industrial", "loose", tmp_path)
    assert not document["verdict"]["fit"]
    assert "slipped" in document["verdict"]["reasons"][0]


def test_a_turn_cut_by_a_gap_leaves_no_g_sensitivity_in_the_difference(tmp_path: Path) -> None:
    """Of a turn in two pieces the mean took half as long as its counterpart: 0.05 °/s of it were left, 31 sigmas."""
    document, truth = calibrated(1004, "consumer", "gaps", tmp_path)
    found = named({"gyroscope.matrix": np.array(document["gyroscope"]["matrix"])})
    true = named({"gyroscope.matrix": truth["gyroscope.matrix"]})
    off = found["gyroscope non-orthogonality"] - true["gyroscope non-orthogonality"]
    assert np.max(np.abs(off)) < 1.5e-3
