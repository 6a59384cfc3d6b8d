"""The joint estimator without being asked for: beside the own estimate, in its frame, and where it fails."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tumble.calibration.procedures.joint as joint_procedure
from tumble.calibration.estimate import Beside, Estimate, Said
from tumble.calibration.procedure import find_procedure
from tumble.calibration.procedures import hand_held
from tumble.calibration.session import Session
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording
from tumble.workflows.procedures import run_procedure

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


def failing(kind: type[Exception]) -> Callable[..., Estimate]:
    def fail(*_: Any, **__: Any) -> Estimate:
        raise kind("nothing settles here.")

    return fail


def test_by_hand_the_joint_estimate_is_given_and_the_procedure_s_own_stands_beside_it(
    default: tuple[Estimate, str],
) -> None:
    estimate, reason = default
    assert estimate.procedure == "joint"
    beside = estimate.shown(Beside)
    assert beside is not None
    assert beside.estimate.procedure == "hand-held"
    assert reason.endswith("; estimated jointly.")
    assert any("--procedure hand-held gives" in text for text in estimate.remarks)


def test_by_name_the_procedure_gives_its_own_estimate_alone(session: Session) -> None:
    estimate, _ = run_procedure(session, "hand-held")
    assert estimate.procedure == "hand-held"
    assert estimate.shown(Beside) is None


@pytest.mark.parametrize("kind", [ConvergenceError, ObservabilityError])
def test_where_the_joint_one_does_not_serve_the_procedure_s_own_stands_and_it_is_said(
    session: Session, monkeypatch: pytest.MonkeyPatch, kind: type[Exception]
) -> None:
    monkeypatch.setattr(joint_procedure, "run_joint", failing(kind))
    estimate, reason = run_procedure(session, None)
    assert estimate.procedure == "hand-held"
    assert "jointly" not in reason
    assert any("hand-held by itself: nothing settles here." in remark for remark in estimate.remarks)


def test_where_the_procedure_s_own_does_not_settle_the_joint_one_starts_from_rough_values(
    session: Session, default: tuple[Estimate, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hand_held, "calibrate_hand_held", failing(ConvergenceError))
    estimate, _ = run_procedure(session, None)
    assert estimate.procedure == "joint"
    assert any("hand-held by itself does not settle" in remark for remark in estimate.remarks)
    for found, usual in zip(estimate.parameters, default[0].parameters, strict=True):
        assert abs(found.value - usual.value) < 0.05 * usual.standard_uncertainty, found.name


def test_what_the_procedure_objects_to_in_its_own_estimate_is_not_the_joint_one_s(session: Session) -> None:
    start = find_procedure("hand-held").run(session)
    start.say("objection", "These residuals are mine.")
    start.say("caution", "So is this.")
    start.said.append(Said("objection", "The table was bent.", of_recording=True))
    estimate = joint_procedure.run_joint(session, start)
    assert estimate.objections == ("The table was bent.",)
    assert not estimate.cautions


def test_in_the_mean_gyro_frame_the_gyros_matrix_is_symmetric_and_nothing_else_changes(
    session: Session, default: tuple[Estimate, str]
) -> None:
    usual = default[0]
    turned = joint_procedure.run_joint(session, usual.shown(Beside).estimate, frame="mean-gyro")  # type: ignore[union-attr]
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


def test_six_faces_by_hand_are_refused_with_the_options_that_serve() -> None:
    session = tumbled([0, 1, 2, 3, 4, 5])
    with pytest.raises(ObservabilityError) as refused:
        run_procedure(session, None)
    assert "unknowns=6, from Python," in str(refused.value)
    assert "--procedure six-position" in str(refused.value)
    for name in ("six-position",):
        assert run_procedure(session, name)[0].procedure == name


def test_poses_that_leave_a_face_out_are_not_sent_to_the_six_positions(tmp_path: Path) -> None:
    session = tumbled([0, 1, 2, 3, 4, 6, 10])
    with pytest.raises(ObservabilityError) as refused:
        run_procedure(session, None)
    assert "six-position" not in str(refused.value)
