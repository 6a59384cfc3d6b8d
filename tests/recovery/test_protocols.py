"""Named protocols, simulated without noise and calibrated from their files alone, give back what was simulated."""

from dataclasses import replace

import numpy as np
import pytest

from tumble.earth import Site
from tumble.protocol import named_protocol, write_protocol
from tumble.simulation import GRADES, SessionErrors, find_grade
from tumble.workflows import calibrate, simulate

SITE = Site.from_latitude(float(np.radians(48.0)), 500.0)
FORCE, RATE = "accelerometer", "gyroscope"


# A table's rotations are integrated in windows while the Earth turns: second order is left, some 1e-8. Six poses tell
# the fixture's axes against the unit's by the prior of its mounting alone, 0.2 rad, which pulls a rotation of some
# mrad, known to 1°; each sensor's own sensitivity and bias are of second order in how the unit sits.
@pytest.mark.parametrize(
    ("procedure", "name", "triads", "rounding"),
    [
        ("six-position", "six-position", (), 1e-9),
        ("improved-six-position", "six-position", (FORCE,), 1e-5),
        *(("multi-position", f"multi-position-{poses}", (FORCE,), 1e-9) for poses in (9, 10, 18, 26)),
        ("rate-table", "rate-table", (RATE,), 1e-5),
        ("laboratory", "laboratory", (FORCE, RATE), 2e-8),
        ("strapdown-rotation", "strapdown-rotation", (FORCE, RATE), 5e-8),
    ],
)
def test_without_noise_the_truth_comes_back(*, tmp_path, monkeypatch, procedure, name, triads, rounding):
    """In counts; of the scale factor for a matrix, of 10 m/s² or 1 rad/s for a bias."""
    plain_unit = replace(find_grade("consumer-mems"), name="plain", g_sensitivity=0.0)
    monkeypatch.setitem(GRADES, "plain", plain_unit)
    protocol = replace(named_protocol(name), site=SITE, procedure=procedure)
    write_protocol(protocol, tmp_path / "todo.yaml")
    quiet = SessionErrors(noise=False, placement=False)
    done = simulate(
        tmp_path / "todo.yaml",
        output=tmp_path / "sim",
        grade="plain",
        seed=11,
        units="counts",
        errors=quiet,
    )
    calibration = calibrate(protocol=tmp_path / "sim" / "protocol.yaml").calibration
    frame = calibration.frame.name
    true = done.truth
    true = true if frame == "fixture" else true[f"in_frame_{frame.replace('-', '_')}"]
    for triad in triads or (FORCE,):
        found = getattr(calibration, triad)
        matrix, bias = np.array(true[triad]["matrix"]), np.array(true[triad]["bias"])
        scale = float(np.mean(np.abs(np.diag(matrix))))
        own, limit = (np.ones((3, 3), dtype=bool), rounding) if triads else (np.eye(3, dtype=bool), 1e-7)
        np.testing.assert_allclose(np.array(found.matrix)[own], matrix[own], rtol=0, atol=limit * scale)
        largest = 10.0 if triad == FORCE else 1.0
        np.testing.assert_allclose(found.bias, bias, rtol=0, atol=rounding * scale * largest)
