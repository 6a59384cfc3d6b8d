"""A rotation sequence in which samples are missing counts as whole only where that is no matter."""

from __future__ import annotations

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
