"""Whole rotation sequences of another simulator: missing samples, turns that look like faults, a bad fixture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

import tumble
from second_simulator import GRADES, PROCEDURES, Simulation
from tumble.document import Calibration

TACTICAL = GRADES["tactical"]


def calibrated(made: Simulation, folder: Path, rows: np.ndarray | None = None) -> Calibration:
    """The calibration by the simulation's own protocol, of all rows or some."""
    file = folder / "protocol.yaml"
    file.write_text(made.protocol, encoding="utf-8")
    frame, rate = pl.DataFrame(made.columns()), made.path.rate
    frame = frame if rows is None else frame.filter(pl.Series(rows))
    return tumble.calibrate(frame, protocol=file, rate=f"{rate}±{1e-6 * rate}").calibration


def sigmas_off(done: Calibration, name: str, off: np.ndarray) -> float:
    """The largest of three errors, in standard uncertainties of the parameters of that name."""
    sigma = [p.standard_uncertainty for p in done.parameters if p.name.startswith(name)]
    assert len(sigma) == 3
    return float(np.max(np.abs(off) / sigma))


def scale_off(done: Calibration, made: Simulation) -> float:
    truth = np.diag(made.truth.terms(done.frame.name)["gyroscope.matrix"])
    return sigmas_off(done, "gyro scale factor error", np.diag(np.array(done.gyroscope.matrix)) / truth - 1.0)


def test_samples_that_are_missing_while_the_unit_turned_are_no_error_of_a_scale_factor(
    tmp_path: Path,
) -> None:
    """One sample in five hundred and four bursts are lost; bridged as if whole, a gyro was 8 sigmas off and fit."""
    made = PROCEDURES["strapdown-rotation"](TACTICAL, np.random.default_rng(1000), "gaps")
    assert scale_off(calibrated(made, tmp_path), made) < 4.5


def test_an_asymmetry_that_single_turns_show_is_tried_although_these_look_like_faults(tmp_path: Path) -> None:
    """A file for each sequence: two turns showed it alone, were left out, and a gyro was 29 sigmas off and fit."""
    grade = replace(TACTICAL, gyroscope=replace(TACTICAL.gyroscope, asymmetry=3e-4))
    made = PROCEDURES["strapdown-rotation"](grade, np.random.default_rng(4))
    frame = pl.DataFrame(made.columns())
    holds = tumble.find_timeline(tumble.read_recording(frame)).holds
    assert len(holds) == 34
    kept = np.ones(len(frame), dtype=bool)
    for end, start in zip(holds[1:-1:2], holds[2::2], strict=True):
        kept[end.stop : start.start] = False
    done = calibrated(made, tmp_path, kept)
    assert not done.quality.left_out
    truth = made.truth.terms(done.frame.name)["gyroscope.asymmetry"]
    assert sigmas_off(done, "gyro asymmetry", np.array(done.gyroscope.asymmetry) - truth) < 4.5
    assert scale_off(done, made) < 4.5


def test_a_fixture_twice_as_bad_as_stated_is_no_objection_where_no_number_stands_on_it(
    tmp_path: Path,
) -> None:
    made = PROCEDURES["strapdown-rotation"](TACTICAL, np.random.default_rng(31), None, error=1e-3, rate=50.0)
    stated = f"uncertainty_deg: {np.degrees(2e-3)}"
    assert stated in made.protocol
    less = made.protocol.replace(stated, f"uncertainty_deg: {np.degrees(4e-4)}")
    done = calibrated(replace(made, protocol=less), tmp_path)
    assert done.quality.variance_components["placement beyond what the protocol says, rad"] > 8e-4
    assert done.verdict.fit
    truth = made.truth.terms(done.frame.name)["accelerometer.bias"]
    assert sigmas_off(done, "accelerometer bias", np.array(done.accelerometer.bias) - truth) < 4.5
