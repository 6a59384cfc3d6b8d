"""The joint estimator without being asked for, in another frame, and of too few poses."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tumble
from tumble.calibration import Estimate, Session, calibrate, find_procedure
from tumble.calibration.equations.believed_poses import believed_poses
from tumble.calibration.estimate import Beside
from tumble.calibration.session import Estimator
from tumble.document import read_calibration
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.protocol import HoldStep, named_protocol
from tumble.segmentation.matching import MatchedHold, Matching
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording
from tumble.workflows.procedures import find_estimator, run_procedure
from tumble.workflows.simulate import simulate

SITE = Site.from_latitude(0.8)


def tumbled(poses: list[int]) -> Session:
    rng = np.random.default_rng(4)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, len(poses)), [0.0, 0.0, 1.0]))
    motion = Motion.between_poses(
        headings * poses_26()[poses], np.full(len(poses), 3.0), np.full(len(poses) - 1, 2.0)
    )
    grade = find_grade("consumer-mems")
    model = grade.simulate_model(np.random.default_rng(9))
    recording, _ = simulate_recording(motion, 50.0, rng, site=SITE, grade=grade, distort=model.distort)
    return Session(recording, given_site=SITE)


@pytest.fixture(scope="module")
def session() -> Session:
    return tumbled(np.random.default_rng(2).permutation(26)[:16].tolist())


@pytest.fixture(scope="module")
def default(session: Session) -> tuple[Estimate, str]:
    return run_procedure(session, None)


def test_by_hand_and_by_name_the_estimate_is_the_joint_one(
    session: Session, default: tuple[Estimate, str]
) -> None:
    estimate, reason = default
    assert estimate.procedure == "joint"
    assert "hand-held" in reason
    named, said = run_procedure(session, "hand-held")
    assert named.parameters == estimate.parameters
    assert "as asked for" in said


def test_in_the_mean_gyro_frame_the_gyros_matrix_is_symmetric_and_nothing_else_changes(
    session: Session, default: tuple[Estimate, str]
) -> None:
    usual = default[0]
    turned = calibrate(session, replace(find_procedure("hand-held"), frame="mean-gyro"))
    assert turned.frame == "mean-gyro"
    gyro, other = turned.model.gyroscope, usual.model.gyroscope
    assert gyro is not None
    assert other is not None
    assert turned.model.accelerometer is not None
    assert usual.model.accelerometer is not None
    np.testing.assert_allclose(gyro.matrix, gyro.matrix.T, atol=1e-12)
    C = np.linalg.solve(other.matrix, gyro.matrix)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(
        usual.model.accelerometer.matrix @ C, turned.model.accelerometer.matrix, rtol=1e-9, atol=1e-9
    )
    # Norms know no frame: the accelerometers' Gram matrix is as uncertain in either.
    for k in range(3):
        sigmas = [_norm_sigma(estimate, k) for estimate in (usual, turned)]
        assert sigmas[0] == pytest.approx(sigmas[1], rel=1e-6)
    named = {p.name for p in turned.parameters}
    assert {"gyro non-orthogonality xy", "accelerometer misalignment yx"} <= named


def _norm_sigma(estimate: Estimate, k: int) -> float:
    """Standard uncertainty of the length of a row of the accelerometers' matrix."""
    assert estimate.model.accelerometer is not None
    at = [estimate.names.index(f"accelerometer.matrix[{k},{j}]") for j in range(3)]
    row = estimate.model.accelerometer.matrix[k]
    slope = row / np.linalg.norm(row)
    return float(np.sqrt(slope @ estimate.covariance[np.ix_(at, at)] @ slope))


def test_six_faces_by_hand_are_not_fit_and_the_procedure_that_serves_is_named() -> None:
    told = run_procedure(tumbled([0, 1, 2, 3, 4, 5]), None)[0].objections
    (said,) = [text for text in told if "all of the accelerometers" in text]
    assert "--procedure six-position" in said
    again, _ = run_procedure(tumbled([0, 1, 2, 3, 4, 5]), "six-position")
    assert not [text for text in again.objections if "does not determine" in text]


def test_seven_poses_and_the_turns_between_them_suffice() -> None:
    """Alone they are two too few for the accelerometers: what turns tell of gravity serves besides."""
    estimate, _ = run_procedure(tumbled([0, 1, 2, 3, 4, 6, 10]), None)
    assert not estimate.objections
    assert len([name for name in estimate.names if name.startswith("accelerometer.matrix")]) == 9


def test_nine_poses_check_nothing_and_more_do(session: Session) -> None:
    both = (tumbled([0, 1, 2, 3, 4, 5, 6, 8, 10]).recording, session.recording)
    without = [Session(replace(one, angular_rate=None), given_site=SITE) for one in both]
    said = [" ".join(run_procedure(one, None)[0].cautions) for one in without]
    assert ["Nothing checks the accelerometers" in words for words in said] == [True, False]


def test_a_papers_estimator_stands_beside_with_a_document_of_its_own(tmp_path: Path) -> None:
    simulate("six-position", output=tmp_path / "six", seed=5, site=SITE)
    run = tumble.calibrate(protocol=tmp_path / "six", estimator="six-position", output=tmp_path / "out")
    own = read_calibration(tmp_path / "out" / "calibration-six-position.json")
    beside = run.estimate.shown(Beside)
    assert beside is not None
    assert own.accelerometer is not None
    assert own.procedure == beside.estimate.procedure == "six-position"
    assert own.identity != run.calibration.identity
    assert "six-position by Hayal 2010, (2.5) and (2.6)" in (tmp_path / "out" / "report.html").read_text(
        "utf-8"
    )
    with pytest.raises(UsageError, match=r"^The estimator rate-test has to know .* give --protocol FILE"):
        tumble.calibrate(tmp_path / "none.csv", estimator="rate-test")


def _refused(session: object) -> NoReturn:
    raise UsageError("It wants more.")


PICKY = {name: Estimator(name, "it wants", "none", _refused) for name in ("picky", "six-position")}


def test_what_a_package_of_estimators_does_wrong_is_its_own_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A package that cannot be imported, one with a name that another one has, and an estimator that refuses."""
    for package, place in (("broken", "no_such_module:ALL"), ("picky", f"{__name__}:PICKY")):
        info = tmp_path / f"{package}-1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1\n")
        (info / "entry_points.txt").write_text(f"[tumble.estimators]\nits = {place}\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    simulate("six-position", output=tmp_path / "six", seed=5, site=SITE)
    for name, said in (
        (
            "six",
            r"no estimator 'six'\. .*picky \(it wants; none\).*zhang-optimal.* broken .*ModuleNotFoundError",
        ),
        ("six-position", r"^The packages picky and \w+ both have six-position"),
        ("picky", r"^The estimator picky does not serve here: It wants more\. Leave it out"),
    ):
        with pytest.raises(UsageError, match=said):
            tumble.calibrate(protocol=tmp_path / "six", estimator=name)
    assert find_estimator("improved-six-position", has_protocol=False).name == "improved-six-position"


def test_holds_of_a_placement_that_is_hardly_known_are_in_no_pose_that_is_believed() -> None:
    protocol = named_protocol("rate-table")
    holds = [at for at, step in enumerate(protocol.steps) if isinstance(step, HoldStep)]
    matching = Matching(tuple(MatchedHold(step, k) for k, step in enumerate(holds)), (), (), ())
    believed = believed_poses(protocol, matching)
    assert believed is not None
    assert sorted(believed.placed) == list(range(len(holds)))
    first = protocol.steps[holds[0]]
    assert isinstance(first, HoldStep)
    assert first.pose is not None
    loose = replace(first, pose=replace(first.pose, sigma=1.0))
    steps = tuple(loose if step is first else step for step in protocol.steps)
    less = believed_poses(replace(protocol, steps=steps), matching)
    assert less is not None
    gone = {k for k, first_hold in believed.placed.items() if first_hold == 0}
    assert set(less.placed) == set(believed.placed) - gone
