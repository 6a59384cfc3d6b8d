"""The workflow: recordings put one after the other, the procedure chosen, the reason said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.recording import Recording, write_recording
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording
from tumble.workflows.calibrate import calibrate
from tumble.workflows.several import PAUSE

SITE = Site.from_gravity(9.81)


def tumbled(poses: list[int], *, seed: int = 1, turn: float = 2.0) -> Recording:
    rng = np.random.default_rng(seed)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, len(poses)), [0.0, 0.0, 1.0]))
    attitudes = headings * poses_26()[poses]
    motion = Motion.between_poses(attitudes, np.full(len(poses), 3.0), np.full(len(poses) - 1, turn))
    model = find_grade("consumer-mems").simulate_model(np.random.default_rng(9))
    recording, _ = simulate_recording(
        motion, 50.0, rng, site=SITE, grade=find_grade("consumer-mems"), distort=model.distort
    )
    return recording


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    return write_recording(
        tumbled(np.random.default_rng(2).permutation(26)[:18].tolist()), folder / "whole.csv"
    )


def without_gyro(recording: Recording, path: Path) -> Path:
    rows = np.column_stack([recording.time, recording.specific_force])
    np.savetxt(path, rows, delimiter=",", header="t,ax,ay,az", comments="")
    return path


def test_holds_and_turns_of_both_triads_are_calibrated_by_hand(whole: Path) -> None:
    run = calibrate(whole, site=SITE)
    assert run.calibration.procedure == "joint"
    assert "Procedure hand-held: 18 holds and 17 turns" in run.reason
    assert run.reason in run.calibration.remarks
    assert run.files == []  # nothing is written without an output
    assert {"reading", "segmenting", "solving"} <= set(run.seconds)


def test_without_a_gyro_the_multi_position_procedure_is_chosen_and_it_is_said(tmp_path: Path) -> None:
    recording = tumbled(np.random.default_rng(2).permutation(26)[:16].tolist())
    run = calibrate(without_gyro(recording, tmp_path / "force.csv"), site=SITE)
    assert "Procedure multi-position" in run.reason
    assert "one triad only" in run.reason
    assert run.calibration.gyroscope is None
    assert "The gyros: the recording has none." in run.calibration.not_determined


def test_separate_poses_in_separate_files_are_multi_position(tmp_path: Path) -> None:
    """Fourteen files of one pose each: no turn is recorded, and none goes across the pauses."""
    files = []
    for number, pose in enumerate(np.random.default_rng(2).permutation(26)[:14].tolist()):
        rng = np.random.default_rng(number)
        motion = Motion.between_poses(poses_26()[[pose]], np.array([4.0]), np.zeros(0))
        model = find_grade("consumer-mems").simulate_model(np.random.default_rng(9))
        recording, _ = simulate_recording(
            motion, 50.0, rng, site=SITE, grade=find_grade("consumer-mems"), distort=model.distort
        )
        files.append(write_recording(recording, tmp_path / f"pose-{number:02d}.csv"))
    run = calibrate(files, site=SITE, units="m/s^2,rad/s")
    assert "Procedure multi-position" in run.reason
    assert run.calibration.quality.holds == 14
    assert "0 turns" in run.reason
    assert len(run.calibration.recordings) == 14
    gaps = np.diff(run.recording.time)[np.array(run.recording.gaps) - 1]
    np.testing.assert_allclose(gaps, PAUSE, atol=1e-9)


def test_turns_about_one_axis_leave_the_gyro_to_the_multi_position_procedure(tmp_path: Path) -> None:
    """Poses that differ, but turns too few: what the turns lack is said, not hidden."""
    poses = np.random.default_rng(2).permutation(26)[:10].tolist()
    recording = tumbled(poses)
    # Every turn but three is cut out of the recording.
    keep = np.ones(len(recording), dtype=bool)
    for k in range(9):
        if k > 2:
            keep &= (recording.time < 5.0 * k + 3.0) | (recording.time > 5.0 * k + 5.0)
    force, rate = (np.asarray(part)[keep] for part in (recording.specific_force, recording.angular_rate))
    cut = replace(recording, time=recording.time[keep], specific_force=force, angular_rate=rate)
    path = write_recording(cut, tmp_path / "cut.csv")
    run = calibrate(path, site=SITE)
    assert "Procedure multi-position" in run.reason
    assert "turns between holds can be used" in run.reason


@pytest.mark.parametrize("procedure", ["hand-held", "multi-position", "six-position"])
def test_a_procedure_that_is_asked_for_is_taken(whole: Path, procedure: str) -> None:
    run = calibrate(whole, site=SITE, procedure=procedure)
    assert f"Procedure {procedure}, as asked for" in run.reason
    poses = run.page().blocks if procedure == "six-position" else []
    assert "Missing" not in str(poses)


def test_the_hand_held_procedure_is_not_replaced_when_it_is_asked_for(tmp_path: Path) -> None:
    recording = tumbled(np.random.default_rng(2).permutation(26)[:16].tolist())
    path = without_gyro(recording, tmp_path / "force.csv")
    verdict = calibrate(path, site=SITE, procedure="hand-held").calibration.verdict
    assert not verdict.fit
    assert "no gyros" in verdict.reasons[0]


def test_the_thermal_procedure_asks_for_a_temperature(whole: Path) -> None:
    with pytest.raises(ObservabilityError, match="no temperature"):
        calibrate(whole, procedure="thermal")


def test_progress_is_told_stage_by_stage(whole: Path, tmp_path: Path) -> None:
    told: list[str] = []
    calibrate(whole, site=SITE, output=tmp_path / "r", progress=told.append)
    assert told[:2] == ["reading", "finding holds and turns"]
    assert "report" in told[-1]


def test_optional_terms_can_be_forgone(whole: Path) -> None:
    run = calibrate(whole, site=SITE, optional_terms=False)
    assert run.estimate.terms == []
    assert run.calibration.gyroscope is not None
    assert run.calibration.gyroscope.g_sensitivity is None
