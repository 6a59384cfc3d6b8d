"""How turns are scored: by everything that the model has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.calibration.checks.scores import angle_off, score_turns
from tumble.calibration.equations.gathering import gather
from tumble.earth import Site
from tumble.segmentation import find_timeline, observe_holds
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording


def test_turns_of_gyros_whose_two_ways_differ_are_scored_by_the_model_that_says_so() -> None:
    """One per cent of a turn of 90° is most of a degree; what the sensors' noise leaves is a tenth."""
    site, grade = Site.from_latitude(0.8), find_grade("consumer-mems")
    rng = np.random.default_rng(6)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, 12), [0.0, 0.0, 1.0]))
    motion = Motion.between_poses(headings * poses_26()[:12], np.full(12, 4.0), np.full(11, 2.0))
    model = grade.simulate_model(np.random.default_rng(9))
    plain = replace(model, gyroscope=replace(model.gyroscope, asymmetry=None))
    crooked = replace(model, gyroscope=replace(model.gyroscope, asymmetry=np.array([0.01, -0.012, 0.008])))
    recording, _ = simulate_recording(motion, 50.0, rng, site=site, grade=grade, distort=crooked.distort)
    timeline = find_timeline(recording)
    data = gather(recording, timeline, observe_holds(recording, timeline))

    def missed(of: object) -> float:
        return float(np.degrees(np.sqrt(np.nanmean(score_turns(of, data).angle ** 2))))  # type: ignore[arg-type]

    assert missed(crooked) < 0.2
    assert missed(plain) > 3.0 * missed(crooked)


def test_a_turn_without_a_score_is_stated_in_words() -> None:
    assert angle_off(np.radians(1.234)) == "1.23° off"
    assert angle_off(float("nan")) == "elsewhere after less than 5°"
