"""A rotation sequence in which samples are missing counts as whole only where that is no matter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

import tumble
from second_simulator import GRADES, PROCEDURES


def test_samples_that_are_missing_while_the_unit_turned_are_no_error_of_a_scale_factor(
    tmp_path: Path,
) -> None:
    """One sample in five hundred and four bursts are lost; bridged as if whole, a gyro was 8 sigmas off and fit."""
    made = PROCEDURES["strapdown-rotation"](GRADES["tactical"], np.random.default_rng(1000), "gaps")
    file = tmp_path / "protocol.yaml"
    file.write_text(made.protocol, encoding="utf-8")
    rate = made.path.rate
    done = tumble.calibrate(
        pl.DataFrame(made.columns()), protocol=file, rate=f"{rate}±{1e-6 * rate}"
    ).calibration
    assert done.gyroscope is not None
    truth = made.truth.terms(done.frame.name)["gyroscope.matrix"]
    off = np.diag(np.array(done.gyroscope.matrix)) - np.diag(truth)
    sigma = [p.standard_uncertainty for p in done.parameters if p.name.startswith("gyro scale factor error")]
    assert len(sigma) == 3
    assert np.max(np.abs(off) / sigma) < 4.5


def test_an_asymmetry_that_single_turns_show_is_tried_although_these_look_like_faults(tmp_path: Path) -> None:
    """A file for each sequence: two turns showed it alone, were left out, and a gyro was 29 sigmas off and fit."""
    tactical = GRADES["tactical"]
    grade = replace(tactical, gyroscope=replace(tactical.gyroscope, asymmetry=3e-4))
    made = PROCEDURES["strapdown-rotation"](grade, np.random.default_rng(4))
    file = tmp_path / "protocol.yaml"
    file.write_text(made.protocol, encoding="utf-8")
    rate = made.path.rate
    frame = pl.DataFrame(made.columns())
    holds = tumble.find_timeline(tumble.read_recording(frame)).holds
    assert len(holds) == 34
    kept = np.ones(len(frame), dtype=bool)
    for end, start in zip(holds[1:-1:2], holds[2::2], strict=True):
        kept[end.stop : start.start] = False
    done = tumble.calibrate(
        frame.filter(pl.Series(kept)), protocol=file, rate=f"{rate}±{1e-6 * rate}"
    ).calibration
    assert done.gyroscope is not None
    assert not done.quality.left_out
    truth = made.truth.terms(done.frame.name)
    assert done.gyroscope.asymmetry is not None
    sigma = [p.standard_uncertainty for p in done.parameters if p.name.startswith("gyro asymmetry")]
    off = np.array(done.gyroscope.asymmetry) - truth["gyroscope.asymmetry"]
    assert np.max(np.abs(off) / sigma) < 4.5
    sigma = [p.standard_uncertainty for p in done.parameters if p.name.startswith("gyro scale factor error")]
    off = np.diag(np.array(done.gyroscope.matrix)) / np.diag(truth["gyroscope.matrix"]) - 1.0
    assert np.max(np.abs(off) / sigma) < 4.5
