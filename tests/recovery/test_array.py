"""Units that are tumbled together: each comes back, and how it sits against the first; a unit that slips is said.

Fourteen poses by hand at 50 Hz; each unit has a skewed model of its own and lies askew by tens of degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from tumble.calibration import Estimate
from tumble.calibration.arrays.adjustment import ArraySolution, solve_array
from tumble.calibration.arrays.estimate import ArrayEstimate, array_estimate
from tumble.calibration.equations.imu_unknowns import unknowns_of
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.segmentation import find_timeline, observe_holds
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording

SITE = replace(Site.from_latitude(np.radians(48.0), 300.0), gravity_sigma=0.0)
POSES = 14
MODELS = (
    ImuModel(
        Triad(
            np.array([[1.02, 0.003, -0.004], [0.0031, 0.97, 0.002], [-0.0012, 0.0045, 1.05]]),
            np.array([0.02, -0.03, 0.05]),
        ),
        Triad(
            np.array([[0.99, 0.0021, -0.0033], [-0.0014, 1.03, 0.0026], [0.0037, -0.0018, 0.97]]),
            np.array([1e-3, -2e-3, 3e-3]),
        ),
    ),
    ImuModel(
        Triad(
            np.array([[0.98, -0.002, 0.005], [0.004, 1.01, -0.003], [0.002, 0.001, 0.99]]),
            np.array([-0.04, 0.01, 0.02]),
        ),
        Triad(
            np.array([[1.01, 0.004, 0.002], [-0.003, 0.98, 0.001], [0.005, -0.002, 1.02]]),
            np.array([-3e-3, 1e-3, 2e-3]),
        ),
    ),
    ImuModel(
        Triad(
            np.array([[1.01, 0.001, 0.002], [-0.004, 1.03, 0.003], [0.003, -0.005, 0.96]]),
            np.array([0.01, 0.03, -0.05]),
        ),
        Triad(
            np.array([[1.02, -0.001, 0.004], [0.002, 0.99, -0.003], [-0.001, 0.006, 1.01]]),
            np.array([2e-3, -1e-3, 1e-3]),
        ),
    ),
)
MOUNTINGS = (np.zeros(3), np.array([0.4, -0.2, 0.9]), np.array([-0.1, 1.2, 0.3]))  # rad
LARGEST_Z = 5.0
Settled = tuple[Estimate, JointOutcome]
Vectors = npt.NDArray[np.float64]
# Twists of the three units, rad per g: what common poses add is then as on a real board of eight (626 where 406 are
# expected).
TWISTS = (8e-4, -1e-3, 6e-4)


@dataclass(frozen=True)
class Array:
    solution: ArraySolution
    estimate: ArrayEstimate


@cache
def unit(
    number: int, *, noise: bool = True, slip: float = 0.0, poses: int = POSES, twist: float = 0.0
) -> Settled:
    """One unit by itself; a slip turns it by so many rad from the eighth pose on.

    A mount that gives twists its accelerometers about z by so many rad per g along z, which no norm shows.
    """
    rng = np.random.default_rng(5)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, poses), [0.0, 0.0, 1.0]))
    attitudes = headings * poses_26()[rng.permutation(26)[:poses]]
    before = Rotation.from_rotvec(MOUNTINGS[number])
    after = Rotation.from_rotvec([slip, 0.0, 0.0]) * before
    own = Rotation.concatenate([before] * 7 + [after] * (poses - 7))

    def distort(force: Vectors, rate: Vectors) -> tuple[Vectors, Vectors]:
        about_z = np.cross([0.0, 0.0, 1.0], force) * (twist * force[:, 2:] / SITE.gravity)
        return MODELS[number].distort(force + about_z, rate)

    motion = Motion.between_poses(attitudes * own, np.full(poses, 3.0), np.full(poses - 1, 2.0))
    recording, _ = simulate_recording(
        motion,
        50.0,
        np.random.default_rng(30 + number),
        site=SITE,
        grade=find_grade("consumer-mems") if noise else None,
        distort=distort,
    )
    # The holds as they were played, a little inside their edges: the same for all units.
    edges = [(5.0 * k + 0.2, 5.0 * k + 2.8) for k in range(poses)]
    timeline = find_timeline(recording, intervals=edges)
    kept: list[JointOutcome] = []
    means = observe_holds(recording, timeline)
    estimate = calibrate_joint(recording, timeline, means, SITE, optional_terms=False, keep=kept.append)
    return estimate, kept[0]


def together(*settled: Settled) -> Array:
    names = [f"unit {k}.csv" for k in range(1, len(settled) + 1)]
    solution = solve_array(names, [outcome for _, outcome in settled])
    return Array(solution, array_estimate(solution, [estimate for estimate, _ in settled], SITE))


@cache
def array() -> Array:
    return together(*(unit(number) for number in range(3)))


def own_frame(number: int) -> npt.NDArray[np.float64]:
    return unknowns_of(change_frame(MODELS[number], "accelerometer-x"))


def true_mounting(number: int) -> npt.NDArray[np.float64]:
    """From the unit's own axes to the first one's: each lies in its case by its own accelerometers."""
    C = []
    for model in (MODELS[0], MODELS[number]):
        turned = change_frame(model, "accelerometer-x")
        assert model.accelerometer is not None
        assert turned.accelerometer is not None
        C.append(np.linalg.inv(model.accelerometer.matrix) @ turned.accelerometer.matrix)
    return C[0].T @ Rotation.from_rotvec(MOUNTINGS[number]).as_matrix() @ C[1]


def test_without_noise_units_and_mountings_come_back() -> None:
    """To the coning that 50 Hz leave of a turn, which is another about each unit's axes."""
    solution = together(unit(0, noise=False), unit(1, noise=False)).solution
    for number, one in enumerate(solution.units):
        free = one.free
        np.testing.assert_allclose(one.task.unknowns.values[free], own_frame(number)[free], rtol=0, atol=3e-6)
    np.testing.assert_allclose(solution.units[1].C_1b, true_mounting(1), atol=3e-6)


def test_with_noise_scale_factors_angles_and_mountings_are_within_their_uncertainty() -> None:
    """Biases wander, and are left to the benchmark that knows by how much."""
    solution = array().solution
    stable = [*range(3, 9), *range(9, 18)]
    for number, one in enumerate(solution.units):
        free = one.free
        sigma = np.sqrt(np.diag(solution.covariance))[solution.place(number)]
        z = (one.task.unknowns.values[free] - own_frame(number)[free]) / sigma
        assert np.max(np.abs(z[stable])) < LARGEST_Z
    for number in (1, 2):
        turned = Rotation.from_matrix(solution.units[number].C_1b @ true_mounting(number).T).as_rotvec()
        assert np.max(np.abs(turned / array().estimate.units[number].sigma)) < LARGEST_Z


def test_common_poses_make_every_parameter_better_known_and_it_is_said_by_how_much() -> None:
    """More observations never tell less; three units share two numbers of attitude a hold, and three a turn."""
    for number, (alone, _) in enumerate(unit(k) for k in range(3)):
        estimate, mounted = array().estimate.estimates[number], array().estimate.units[number]
        for before, after in zip(alone.parameters, estimate.parameters, strict=True):
            assert after.name == before.name
            assert after.standard_uncertainty < 1.02 * before.standard_uncertainty
        assert mounted.gain["accelerometer non-orthogonality"] < 0.97
        assert any("of the unit alone" in remark for remark in estimate.remarks)


def test_units_that_are_fixed_are_said_to_be_and_one_that_slips_is_not() -> None:
    """By half a degree from the eighth pose on; holds show directions to a hundredth of a degree."""
    assert array().estimate.is_rigid
    assert not array().estimate.estimates[0].objections
    slipped = together(unit(0), unit(1, slip=np.radians(0.5))).estimate
    assert not slipped.is_rigid
    assert "did not keep their places" in slipped.estimates[0].objections[-1]


def test_units_that_stay_but_whose_models_leave_something_are_fixed_and_it_is_said() -> None:
    """Their attitudes disagree by more than their own residuals explain, pose by pose, and nobody turned."""
    crooked = together(*(unit(number, twist=TWISTS[number]) for number in range(3))).estimate
    assert crooked.is_unlike
    assert 1.2 * crooked.degrees < crooked.chi_square < 4.0 * crooked.degrees
    assert crooked.is_rigid
    assert not crooked.slips
    estimate = crooked.estimates[0]
    assert not estimate.objections
    assert any("what the units' models leave in each pose" in text for text in estimate.cautions)
    plain = array().estimate
    for before, after in zip(plain.estimates[1].parameters, estimate.parameters, strict=True):
        assert after.standard_uncertainty > 0.9 * before.standard_uncertainty


@pytest.mark.parametrize("slip", [0.1, 0.5])
def test_a_unit_that_slips_among_crooked_ones_is_named_with_its_hold(slip: float) -> None:
    moved = together(
        *(unit(number, twist=TWISTS[number]) for number in range(2)),
        unit(2, twist=TWISTS[2], slip=np.radians(slip)),
    ).estimate
    assert not moved.is_rigid
    assert [one.name for one in moved.slips] == ["unit 3.csv"]
    assert moved.slips[0].hold == 7
    assert np.degrees(moved.slips[0].angle) == pytest.approx(slip, rel=0.4)
    assert "unit 3.csv turned by 0." in moved.estimates[1].objections[-1]


def test_units_with_other_holds_are_refused() -> None:
    with pytest.raises(
        UsageError, match=r"unit 2\.csv does not have the same holds and usable turns as unit 1\.csv"
    ):
        together(unit(0), unit(1, poses=13))
