"""Units whose output has coarser steps than its noise: a mean is off by up to half a step, and must say so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES, Grade


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


@pytest.mark.parametrize("procedure", ["by-hand", "multi-position", "six-faces"])
def test_what_rounding_hides_is_stated(procedure: str, tmp_path: Path) -> None:
    """Biases were off by 8 to 500 of what was stated where rounding counted as noise."""
    z = list[float]()
    for seed in range(4):
        made = PROCEDURES[procedure](coarse(), np.random.default_rng(900 + seed), None, rate=100.0)
        options: dict[str, object] = {"rate": "100±0.002"}
        if procedure == "six-faces":
            file = tmp_path / "protocol.yaml"
            file.write_text(made.protocol, encoding="utf-8")
            options["protocol"] = file
        else:
            options["site"] = tumble.Site.from_latitude(made.place.stated_latitude, made.place.height)
        found = tumble.calibrate(pl.DataFrame(made.columns()), **options).calibration  # type: ignore[arg-type]
        assert found.verdict.fit, found.verdict.reasons
        # The tremor of a hand dithers.
        assert procedure == "by-hand" or any(
            "The gyro's output goes in steps of 0.1 deg/s" in remark for remark in found.remarks
        )
        assert found.gyroscope is not None
        true = made.truth.terms(found.frame.name)["gyroscope.bias"]
        for axis, name in enumerate("xyz"):
            stated = next(p for p in found.parameters if p.name == f"gyro bias {name}")
            z.append((found.gyroscope.bias[axis] - true[axis]) / stated.standard_uncertainty)
    assert np.max(np.abs(z)) < 4.5
    assert np.sqrt(np.mean(np.square(z))) < 1.3
