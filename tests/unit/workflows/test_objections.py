"""What makes a calibration unfit although its numbers look good: the workflow objects in words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tumble.calibration.prior import StableKnowledge, find_contradiction
from tumble.earth import Site
from tumble.errors import ConvergenceError, RecordingError, UsageError
from tumble.workflows.calibrate import RECORDING, calibrate
from tumble.workflows.simulate import simulate
from tumble.workflows.verify import verify

DATA = Path(__file__).resolve().parents[3] / "src" / "tumble" / "data" / RECORDING
OPTIONS = {"site": Site.from_gravity(9.81), "rate": 100.0, "units": "m/s^2,rad/s"}


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    return np.loadtxt(DATA, delimiter=",", skiprows=1)


@pytest.fixture
def written(tmp_path: Path) -> Callable[[np.ndarray], Path]:
    def write(values: np.ndarray) -> Path:
        path = tmp_path / "recording.csv"
        np.savetxt(path, values, delimiter=",", header="ax,ay,az,gx,gy,gz", comments="", fmt="%.6f")
        return path

    return write


def test_a_dead_gyro_axis_is_not_fit(rows: np.ndarray, written: Callable[[np.ndarray], Path]) -> None:
    dead = rows.copy()
    dead[:, 4] = 0.01
    with pytest.raises(ConvergenceError, match="gy never changes"):
        calibrate(written(dead), **OPTIONS)  # type: ignore[arg-type]


def test_turns_that_are_lost_to_saturation_are_said_to_be_lost(
    rows: np.ndarray, written: Callable[[np.ndarray], Path]
) -> None:
    clipped = rows.copy()
    clipped[:, 3:] = np.clip(clipped[:, 3:], -0.9, 0.9)
    verdict = calibrate(written(clipped), **OPTIONS).calibration.verdict  # type: ignore[arg-type]
    assert not verdict.fit
    assert "satur" in verdict.reasons[0]


def test_one_recording_twice_is_refused() -> None:
    with pytest.raises(UsageError, match=r"^(\S+) \(2\) and \1 \(1\) are the same recording"):
        calibrate([DATA, DATA], **OPTIONS)  # type: ignore[arg-type]


def test_a_prior_three_sigma_off_passes_and_one_ten_sigma_off_is_contradicted() -> None:
    # Chi-square of 3 degrees exceeds 16.3 in one case of a thousand: 9 is below, 100 above.
    sigma = 1e-4
    own = StableKnowledge(np.array([1e-3, -2e-3, 3e-3]), 0.5 * sigma**2 * np.eye(3))
    near = StableKnowledge(own.angles + np.array([3.0 * sigma, 0.0, 0.0]), own.angle_covariance)
    far = StableKnowledge(own.angles + np.array([0.0, 0.0, 10.0 * sigma]), own.angle_covariance)
    assert find_contradiction(near, [own]) is None
    assert "10 standard uncertainties" in (find_contradiction(far, [own]) or "")


def test_a_unit_that_is_plainly_none_of_its_sheet_is_said_to_be_none(tmp_path: Path) -> None:
    """With the sheet of a tactical one nothing settles, or holds seem to have moved: without it numbers show it."""
    for grade, said in (("consumer-mems", True), ("tactical", False)):
        simulate("hand-held", grade=grade, output=tmp_path, seed=0)
        found = calibrate(tmp_path / "recording.csv", prior="tactical").calibration.verdict
        assert found.fit is not said
        assert any("the kind tactical: the gyro's bias" in reason for reason in found.reasons) is said


def test_a_single_pose_cannot_show_that_a_calibration_serves(
    rows: np.ndarray, written: Callable[[np.ndarray], Path]
) -> None:
    calibration = calibrate(DATA, **OPTIONS).calibration  # type: ignore[arg-type]
    (result,) = verify(calibration, written(rows[:500]), rate=100.0, units="m/s^2,rad/s")
    assert not result.fit
    assert "1 different pose" in result.reasons[0]
    (own,) = verify(calibration, DATA, rate=100.0, units="m/s^2,rad/s")
    assert own.fit
    assert "made from" in own.reasons[0]


@pytest.mark.parametrize(
    ("protocol", "procedure"), [("six-position", "multi-position"), ("multi-position-10", None)]
)
def test_a_gyro_that_counts_the_other_way_round_is_refused_even_where_only_holds_are_meant(
    protocol: str, procedure: str | None, tmp_path: Path
) -> None:
    simulate(protocol, output=tmp_path, seed=3)
    given = {"procedure": procedure, "protocol": tmp_path}
    straight = calibrate(**given).calibration.verdict  # type: ignore[arg-type]
    assert "contradict" not in " ".join(straight.reasons)
    with pytest.raises(RecordingError, match=r"turns the other way round.*-gx, -gy, -gz"):
        calibrate(**given, columns="t,ax,ay,az,-gx,-gy,-gz")  # type: ignore[arg-type]


def test_a_prior_that_nothing_checks_is_said_to_be_on_trust_in_the_verdict(tmp_path: Path) -> None:
    simulate("multi-position-26", output=tmp_path / "another", seed=77)
    calibrate(protocol=tmp_path / "another", output=tmp_path / "prior")
    simulate("six-position", output=tmp_path / "six", seed=5)
    run = calibrate(
        protocol=tmp_path / "six",
        procedure="multi-position",
        prior=tmp_path / "prior" / "calibration.json",
        output=tmp_path / "result",
    )
    assert "prior is taken on trust" in " ".join(run.calibration.verdict.reasons)


def test_a_crystal_decides_nothing_of_gyros_that_are_determined_in_part(tmp_path: Path) -> None:
    """Six faces tell their scale factors to some parts in a thousand, and a crystal keeps 50 in a million."""
    simulate("six-position", output=tmp_path / "six", seed=5)
    found = calibrate(protocol=tmp_path / "six", rate="crystal").estimate
    assert found.not_determined
    assert "sample rate" not in {one.source for one in found.unseen}
