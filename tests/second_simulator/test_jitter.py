"""Stamps that jitter while a unit turns: the angles are uncertain by it, and the calibration says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from second_simulator import GRADES, PROCEDURES
from second_simulator.calibrating import calibrated, sigmas_off


def test_angles_from_stamps_that_jitter_are_stated_as_uncertain() -> None:
    """Quiet gyros, five turns: too few to show by themselves what 4 ms of jitter do to them (7 sigmas before)."""
    z = list[float]()
    for seed in range(3):
        rng = np.random.default_rng(400 + seed)
        made = PROCEDURES["six-faces"](GRADES["tactical"], rng, None, rate=50.0)
        late = np.abs(rng.normal(0.0, 0.004, made.time.size))
        made = replace(made, time=np.maximum.accumulate(made.time + late) + 1e-7 * np.arange(made.time.size))
        z += sigmas_off(calibrated(made, rate="crystal"), made, "gyroscope.matrix").tolist()
    assert np.max(np.abs(z)) < 4.0
    assert np.sqrt(np.mean(np.square(z))) < 1.3
