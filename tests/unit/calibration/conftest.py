"""A unit with known errors, tumbled by the simulator, for the tests of this folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns
from tumble.calibration.equations.imu_unknowns import PLAIN, imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import observe
from tumble.calibration.start import start_adjustment
from tumble.earth import Site
from tumble.recording import Recording
from tumble.segmentation import Hold, HoldMeans, NoiseFloor, Timeline, Turn, observe_holds
from tumble.sensor import ImuModel, Triad
from tumble.simulation import Motion, simulate_recording

SITE = Site(9.81, 0.0, float(np.radians(48.0)), 300.0, "as simulated")
MODEL = ImuModel(
    Triad(np.array([[1.02, 0.0, 0.0], [-0.011, 0.98, 0.0], [0.031, -0.019, 1.05]]), np.array([0.11, -0.23, 0.31])),
    Triad(
        np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]]),
        np.array([0.021, -0.013, 0.034]),
    ),
    1e-4 * np.array([[2.0, -3.0, 1.0], [4.0, -1.0, 5.0], [-6.0, 7.0, -2.0]]),
)  # fmt: skip


@dataclass(frozen=True)
class Tumbled:
    """A recording with its holds and turns as they were commanded."""

    recording: Recording
    timeline: Timeline
    means: HoldMeans

    def data(self) -> HoldsAndTurns:
        return gather(self.recording, self.timeline, self.means)

    def without_turns(self, *numbers: int) -> Tumbled:
        """The same with turns that cannot be integrated."""
        turns = tuple(
            replace(turn, usable=False, reason="a gap") if turn.before in numbers else turn
            for turn in self.timeline.turns
        )
        return Tumbled(self.recording, replace(self.timeline, turns=turns), self.means)


@cache
def _played(holds: int, earth: bool) -> Recording:
    """The motion without noise."""
    rng = np.random.default_rng(1)
    motion = Motion.between_poses(Rotation.random(holds, rng), np.full(holds, 3.0), np.full(holds - 1, 2.0))
    place = SITE if earth else Site.from_gravity(SITE.gravity)
    return simulate_recording(motion, 100.0, rng, site=place, distort=MODEL.distort)[0]


def tumble_by_hand(*, holds=12, noise=(0.02, 2e-3), noise_seed=1, earth=True) -> Tumbled:
    """Holds of 3 s in poses of chance, turns of 2 s between them, 100 Hz, white noise per sample.

    `noise` is that of the accelerometers, one for all or one each, and that of the gyros.
    """
    played, rng = _played(holds, earth), np.random.default_rng(noise_seed)
    recording = replace(
        played,
        specific_force=played.specific_force + noise[0] * rng.standard_normal(played.specific_force.shape),
        angular_rate=played.angular_rate + noise[1] * rng.standard_normal(played.angular_rate.shape),
    )
    found = [Hold(500 * k, 500 * k + 300) for k in range(holds)]
    turns = [Turn(k, k + 1, 500 * k + 300, 500 * (k + 1)) for k in range(holds - 1)]
    seen = [np.maximum(noise[i], 1e-8) * np.ones(3) for i in range(2)]
    floor = NoiseFloor(seen[0], seen[1], 1.0, "as simulated")
    timeline = Timeline(tuple(found), tuple(turns), (), floor)
    return Tumbled(recording, timeline, observe_holds(recording, timeline))


@pytest.fixture(scope="session")
def tumbled() -> Tumbled:
    return tumble_by_hand()


@pytest.fixture(scope="session")
def play() -> Callable[..., Tumbled]:
    return tumble_by_hand


@pytest.fixture(scope="session")
def started() -> Callable[..., JointAdjustment]:
    """A joint adjustment that begins at the truth, of holds and turns and of rotations of a table."""

    def start(base, free=PLAIN, rotations=None) -> JointAdjustment:
        u = imu_unknowns(unknowns_of(MODEL), free)
        return start_adjustment(observe(base, u, rotations), u, SITE)

    return start


@pytest.fixture(scope="session")
def site() -> Site:
    return SITE


@pytest.fixture(scope="session")
def model() -> ImuModel:
    return MODEL
