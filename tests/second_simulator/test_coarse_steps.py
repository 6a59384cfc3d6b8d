"""Units whose output has coarser steps than its noise: a mean is off by up to half a step, and must say so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES, Grade
from tumble.document import Calibration


def coarse() -> Grade:
    """A board with a low-pass filter: steps of 0.1 °/s, nine times the gyros' noise, and of 4 mg."""
    grade = GRADES["consumer"]
    return replace(
        grade,
        accelerometer=replace(
            grade.accelerometer, noise=0.1 * grade.accelerometer.noise, step=0.004 * 9.80665
        ),
        gyroscope=replace(grade.gyroscope, noise=0.2 * grade.gyroscope.noise, step=np.radians(0.1)),
    )


WITHOUT_PROTOCOL = ("by-hand", "multi-position")


def found_and_true(
    procedure: str, seed: int, rate: float, folder: Path
) -> tuple[Calibration, dict[str, np.ndarray]]:
    grade = coarse()
    if procedure == "rate-table":
        grade = replace(grade, gyroscope=GRADES["consumer"].gyroscope)
    made = PROCEDURES[procedure](grade, np.random.default_rng(seed), None, rate=rate)
    options: dict[str, Any] = {"rate": f"{rate}±{2e-5 * rate}"}
    if procedure in WITHOUT_PROTOCOL:
        options["site"] = tumble.Site.from_latitude(made.place.stated_latitude, made.place.height)
    else:
        file = folder / "protocol.yaml"
        file.write_text(made.protocol, encoding="utf-8")
        options["protocol"] = file
    found = tumble.calibrate(pl.DataFrame(made.columns()), **options).calibration
    # On a table, steps of 4 mg bend the gravity that the windows show: that may be an objection.
    assert found.verdict.fit or procedure == "rate-table", found.verdict.reasons
    return found, made.truth.terms(found.frame.name)


def sigmas_off(found: Calibration, truth: dict[str, np.ndarray], triad: str) -> list[float]:
    """By how many stated uncertainties the biases are off."""
    block = found.accelerometer if triad == "accelerometer" else found.gyroscope
    assert block is not None
    short = "gyro" if triad == "gyroscope" else triad
    stated = {p.name: p.standard_uncertainty for p in found.parameters}
    off = np.array(block.bias) - truth[f"{triad}.bias"]
    return [off[k] / stated[f"{short} bias {axis}"] for k, axis in enumerate("xyz")]


@pytest.mark.parametrize("procedure", ["by-hand", "multi-position", "six-faces"])
def test_what_rounding_hides_is_stated(procedure: str, tmp_path: Path) -> None:
    """Biases were off by 8 to 500 of what was stated where rounding counted as noise."""
    z = list[float]()
    for seed in range(900, 904):
        found, truth = found_and_true(procedure, seed, 100.0, tmp_path)
        # The tremor of a hand dithers.
        said = any("The gyro's output goes in steps of 0.1 deg/s" in remark for remark in found.remarks)
        assert said or procedure == "by-hand"
        z += sigmas_off(found, truth, "gyroscope")
    assert np.max(np.abs(z)) < 4.5
    assert np.sqrt(np.mean(np.square(z))) < 1.3


@pytest.mark.slow
def test_a_face_that_a_table_turns_shows_the_same_rounding_all_the_time(tmp_path: Path) -> None:
    """Windows of six rotations and the rests between them know no more than one: 6 sigmas before."""
    z = list[float]()
    for seed in range(910, 913):
        z += sigmas_off(*found_and_true("rate-table", seed, 25.0, tmp_path), "accelerometer")
    assert np.max(np.abs(z)) < 4.0
    assert np.sqrt(np.mean(np.square(z))) < 1.6
