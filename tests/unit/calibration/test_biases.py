"""Jumps and drifts of biases: found where they are, and counted; what jumps unseen is said."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.adjusted import adjusted

from tumble.calibration import Estimate, Session
from tumble.calibration.checks.suspicions import hidden_jumps
from tumble.earth import EARTH_RATE, Site
from tumble.protocol import named_protocol
from tumble.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, Turn
from tumble.sensor import ImuModel
from tumble.simulation import Motion, find_grade, simulate_protocol, simulate_recording
from tumble.workflows import run_procedure


def test_jumps_are_hidden_where_all_faces_up_come_before_all_faces_down() -> None:
    """With the faces up first, M' = M - j (1, 1, 1)/2g and b' = b + j/2 give all six readings, and are no unit's."""
    rng = np.random.default_rng(2)
    ordered = np.vstack([np.eye(3), -np.eye(3)])
    matrix, bias, jump = (
        np.eye(3) + 0.02 * rng.standard_normal((3, 3)),
        rng.standard_normal(3),
        np.array([0.3, -0.1, 0.2]),
    )
    shown = 9.8 * ordered @ matrix.T + bias + np.where(np.arange(6)[:, None] > 2, jump, 0.0)
    other = matrix - np.outer(jump, np.ones(3)) / (2 * 9.8)
    assert 9.8 * ordered @ other.T + bias + jump / 2 == pytest.approx(shown, abs=1e-12)
    assert hidden_jumps(ordered) == [2]
    # placed to a degree, and each face held three times
    leaning = np.repeat(ordered, 3, axis=0) + 0.01 * rng.standard_normal((18, 3))
    assert hidden_jumps(leaning / np.linalg.norm(leaning, axis=1, keepdims=True)) == [8]
    assert hidden_jumps(ordered[[0, 3, 1, 4, 2, 5]]) == []
    assert hidden_jumps(np.vstack([ordered, ordered[:1]])) == []
    assert hidden_jumps(ordered[:4]) == []


def test_gyros_that_fade_by_much_keep_their_g_sensitivity() -> None:
    """0.18 °/s: with g-sensitivity it did not settle; it was not tried, and what was left of it hid the drift."""
    rng, site = np.random.default_rng([0, 3_200_000]), Site.from_latitude(np.radians(48.0), 300.0)
    protocol = named_protocol("multi-position-26")
    made, truth = simulate_protocol(protocol, 100.0, rng, site=site, grade=find_grade("consumer-mems"))
    fading = np.radians(0.18) * np.exp(-np.linspace(0.0, 5.0, len(made.time)))
    rate = np.asarray(made.angular_rate) + fading[:, None] * np.eye(3)[int(rng.integers(3))]
    session = Session(replace(made, angular_rate=rate), protocol, site)
    found, _ = run_procedure(session, "hand-held")
    assert any("biases of the gyros drift by x -0.17 ± " in said for said in found.cautions)
    told = np.array([(p.value, p.standard_uncertainty) for p in found.parameters if "gyro bias" in p.name])
    assert np.all(np.abs(told[:, 0] - truth.model.gyroscope.bias) < 3.0 * told[:, 1])
    assert found.model.g_sensitivity == pytest.approx(truth.model.g_sensitivity, abs=1e-4)


HOLDS, SIDE = 20, 10
NORTH = Site(9.83, 0.0, float(np.radians(75.0)), 0.0, "as simulated")
NOISE = (1e-3, 1e-5)
JUMP = np.radians(0.03)


@pytest.fixture(scope="module")
def turned_over(model: ImuModel) -> Recording:
    """Ten holds with z within 60° of up, then ten with z down; a good gyro sees the Earth in each of them."""
    rng = np.random.default_rng(3)
    lean = Rotation.from_rotvec(np.radians(60.0) * rng.uniform(-0.6, 0.6, (HOLDS, 3)) * [1, 1, 3])
    over = Rotation.from_rotvec(np.outer(np.arange(HOLDS) < SIDE, [np.pi, 0.0, 0.0]))
    motion = Motion.between_poses(over * lean, np.full(HOLDS, 3.0), np.full(HOLDS - 1, 2.0))
    recording, _ = simulate_recording(
        motion, 100.0, rng, site=NORTH, distort=replace(model, g_sensitivity=None).distort
    )
    return replace(
        recording,
        specific_force=recording.specific_force
        + NOISE[0] * rng.standard_normal(recording.specific_force.shape),
        angular_rate=recording.angular_rate + NOISE[1] * rng.standard_normal(recording.angular_rate.shape),
    )


def calibrated(recording: Recording) -> Estimate:
    found = tuple(Hold(500 * k, 500 * k + 300) for k in range(HOLDS))
    turns = tuple(Turn(k, k + 1, 500 * k + 300, 500 * (k + 1)) for k in range(HOLDS - 1))
    floor = NoiseFloor(np.full(3, NOISE[0]), np.full(3, NOISE[1]), 1.0, "as simulated")
    timeline = Timeline(found, turns, (), floor)
    return adjusted(recording, timeline, NORTH, optional_terms=False)


def test_the_earth_is_no_jump(turned_over: Recording) -> None:
    """It steps by twice its part along z, 0.008 °/s of a mean of 1e-5 / sqrt(300) rad/s = 3e-5 °/s."""
    seen = np.asarray(turned_over.angular_rate)[:, 2]
    means = np.array([seen[500 * k : 500 * k + 300].mean() for k in range(HOLDS)])
    assert abs(means[:SIDE].mean() - means[SIDE:].mean()) > EARTH_RATE
    estimate = calibrated(turned_over)
    assert not [said for said in (*estimate.objections, *estimate.cautions) if "biases of the" in said]


def test_a_jump_beyond_the_earth_is_told_with_its_place_and_size(turned_over, model) -> None:
    rate = np.array(turned_over.angular_rate)
    rate[500 * 12 :] += model.gyroscope.matrix @ [0.0, JUMP, 0.0]
    estimate = calibrated(replace(turned_over, angular_rate=rate))
    said = next(objection for objection in estimate.objections if "jump" in objection)
    assert "The biases of the gyros jump between hold 12 and hold 13" in said
    size, sigma = re.search(r"y ([-+.\d]+) ± ([.\d]+)", said).groups()
    assert float(size) == pytest.approx(np.degrees(JUMP), abs=4.0 * float(sigma))
