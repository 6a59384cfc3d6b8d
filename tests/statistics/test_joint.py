"""The joint adjustment's covariance is that of its errors, optional terms and attitudes included.

One motion by hand, a hundred draws of white noise of known size: whether the noise is found is another test's
matter. Bounds come from chi-square at a false-alarm rate of 1e-3 a test; the seeds are fixed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.imu_unknowns import PLAIN, imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import observe
from tumble.calibration.equations.triad_unknowns import QUADRATIC
from tumble.calibration.start import start_adjustment
from tumble.earth import Site
from tumble.estimation.solve import Settled, solve
from tumble.recording.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, Turn, observe_holds
from tumble.sensor import ImuModel, Triad
from tumble.simulation import Motion, simulate_recording

Array = npt.NDArray[np.float64]
RUNS, FALSE_ALARM = 100, 1e-3
HOLDS, STILL, TURNING, RATE = 18, 400, 200, 50.0
NOISE = np.array([0.02, 2e-3])
SITE = Site(9.81, 0.0, float(np.radians(48.0)), 300.0, "as simulated")
MODEL = ImuModel(
    Triad(np.array([[1.02, 0.0, 0.0], [-0.011, 0.98, 0.0], [0.031, -0.019, 1.05]]), np.array([0.11, -0.23, 0.31])),
    Triad(
        np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]]),
        np.array([0.021, -0.013, 0.034]),
    ),
    1e-4 * np.array([[2.0, -3.0, 1.0], [4.0, -1.0, 5.0], [-6.0, 7.0, -2.0]]),
)  # fmt: skip
OPTIONAL = np.concatenate([np.arange(QUADRATIC.start, QUADRATIC.stop), np.arange(24, 33)])


@cache
def played() -> Recording:
    rng = np.random.default_rng(3)
    motion = Motion.between_poses(
        Rotation.random(HOLDS, rng), np.full(HOLDS, STILL / RATE), np.full(HOLDS - 1, TURNING / RATE)
    )
    return simulate_recording(motion, RATE, rng, site=SITE, distort=MODEL.distort)[0]


def solved(run: int) -> Settled:
    """One draw, settled from the truth."""
    quiet, rng = played(), np.random.default_rng([4, run])
    assert quiet.specific_force is not None
    assert quiet.angular_rate is not None
    noisy = replace(
        quiet,
        specific_force=quiet.specific_force + NOISE[0] * rng.standard_normal(quiet.specific_force.shape),
        angular_rate=quiet.angular_rate + NOISE[1] * rng.standard_normal(quiet.angular_rate.shape),
    )
    both = STILL + TURNING
    holds = tuple(Hold(both * k, both * k + STILL) for k in range(HOLDS))
    turns = tuple(Turn(k, k + 1, both * k + STILL, both * (k + 1)) for k in range(HOLDS - 1))
    floor = NoiseFloor(np.full(3, NOISE[0]), np.full(3, NOISE[1]), 1.0, "as simulated")
    timeline = Timeline(holds, turns, (), floor)
    base = gather(noisy, timeline, observe_holds(noisy, timeline))
    white = np.broadcast_to(np.eye(3) / STILL, (HOLDS, 3, 3))
    base = replace(
        base,
        force_covariance=NOISE[0] ** 2 * white,
        rate_covariance=NOISE[1] ** 2 * white,
        force_floor=np.zeros(3),
        rate_floor=np.zeros(3),
    )
    u = imu_unknowns(unknowns_of(MODEL), np.sort(np.concatenate([PLAIN, OPTIONAL])))
    task = start_adjustment(observe(base, u), u, SITE)
    task.noise.set("sway", 1e-12)
    return solve(task)


@cache
def study() -> tuple[Array, Array]:
    """Errors (runs, 33) and covariances (runs, 33, 33)."""
    truth = unknowns_of(MODEL)
    made = [solved(run) for run in range(RUNS)]
    free = made[0].unknowns.free
    errors = np.array([s.unknowns.values[free] - truth[free] for s in made])
    return errors, np.array([s.cofactor for s in made])


def inside(value: float, degrees: float) -> bool:
    """Whether a chi-square is what chance gives."""
    return bool(
        stats.chi2.ppf(0.5 * FALSE_ALARM, degrees) < value < stats.chi2.isf(0.5 * FALSE_ALARM, degrees)
    )


@pytest.mark.parametrize("which", ["all", "plain", "optional"])
def test_normalised_errors_squared_are_chi_square(which: str) -> None:
    """Optional terms alone: what a test for them would be thrown off by, were their covariance wrong."""
    errors, covariances = study()
    optional = np.isin(np.sort(np.concatenate([PLAIN, OPTIONAL])), OPTIONAL)
    at = {"all": np.arange(33), "plain": np.flatnonzero(~optional), "optional": np.flatnonzero(optional)}[
        which
    ]
    nees = [
        e[at] @ np.linalg.solve(c[np.ix_(at, at)], e[at]) for e, c in zip(errors, covariances, strict=True)
    ]
    assert inside(float(np.sum(nees)), RUNS * at.size)


def test_each_stated_sigma_is_that_of_its_errors() -> None:
    """33 of them: the bound is divided by their number."""
    errors, covariances = study()
    z = errors / np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    squares = np.sum(z**2, axis=0)
    share = 0.5 * FALSE_ALARM / 33
    assert np.all(squares > stats.chi2.ppf(share, RUNS))
    assert np.all(squares < stats.chi2.isf(share, RUNS))
