"""A wrong gravity is in the accelerometers' scale factors, and nowhere else: no residual shows it."""

from __future__ import annotations

import numpy as np

from tumble.calibration import Session, calibrate, find_procedure
from tumble.earth import Site
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording


def test_a_gravity_too_large_by_100_ppm_makes_scale_factors_too_small_by_that():
    right, wrong = Site.from_gravity(9.81), Site.from_gravity(9.81 * (1 + 100e-6))
    motion = Motion.between_poses(poses_26(), np.full(26, 3.0), np.full(25, 2.0))
    unit = find_grade("consumer-mems")
    recording, _ = simulate_recording(motion, 100.0, np.random.default_rng(26), site=right, grade=unit)
    both = [
        calibrate(Session(recording, given_site=site), find_procedure("multi-position")).parameters
        for site in (right, wrong)
    ]
    for old, new in zip(*both, strict=True):
        if new.name.startswith("accelerometer"):
            # Of a scale that is itself 1 within 3 %.
            share = 100e-6 if "scale" in new.name else 0.0
            within = 3e-6 if share else 0.01 * old.standard_uncertainty
            assert abs(new.value - old.value + share) < within
