"""The workflow of calibration: files put one after the other, the procedure chosen and the reason said, objections."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.given import given as known

import tumble
from tumble.calibration import Beside, Estimate, Estimator, Session, calibrate, find_procedure
from tumble.document import read_calibration
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError, RecordingError, UsageError
from tumble.noise import NoiseModel
from tumble.recording import Recording, write_recording
from tumble.segmentation import Hold, HoldMeans, NoiseFloor, Timeline, model_means, observe_holds
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording
from tumble.workflows.calibrate import RECORDING
from tumble.workflows.noise import NoiseOfHolds, read_noise_models
from tumble.workflows.procedures import find_estimator, run_procedure
from tumble.workflows.several import PAUSE
from tumble.workflows.simulate import simulate
from tumble.workflows.verify import verify

SITE = Site.from_latitude(0.8)


def tumbled(poses: list[int], *, seed: int = 4, seconds: float = 3.0) -> Recording:
    """A consumer MEMS unit through some of the 26 poses, with its gyros."""
    rng = np.random.default_rng(seed)
    count = len(poses)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, count), [0.0, 0.0, 1.0]))
    attitudes = headings * poses_26()[poses]
    motion = Motion.between_poses(attitudes, np.full(count, seconds), np.full(count - 1, 2.0))
    grade = find_grade("consumer-mems")
    model = grade.simulate_model(np.random.default_rng(9))
    return simulate_recording(motion, 50.0, rng, site=SITE, grade=grade, distort=model.distort)[0]


def told(recording: Recording, procedure: str | None = None) -> tuple[Estimate, str]:
    return run_procedure(Session(recording, given_site=SITE), procedure)


SIXTEEN = np.random.default_rng(2).permutation(26)[:16].tolist()


@pytest.fixture(scope="module")
def good() -> Recording:
    return tumbled(SIXTEEN)


@pytest.fixture(scope="module")
def whole(good: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(good, tmp_path_factory.mktemp("whole") / "whole.csv")


@pytest.fixture(scope="module")
def forces(good: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Without gyros."""
    path = tmp_path_factory.mktemp("forces") / "force.csv"
    rows = np.column_stack([good.time, known(good.specific_force)])
    np.savetxt(path, rows, delimiter=",", header="t,ax,ay,az", comments="")
    return path


# --- which procedure, and why


def test_holds_and_turns_of_both_triads_are_calibrated_jointly_by_hand(whole: Path, tmp_path: Path) -> None:
    said: list[str] = []
    run = tumble.calibrate(whole, site=SITE, output=tmp_path / "r", progress=said.append)
    assert said[:2] == ["reading", "finding holds and turns"]
    assert "report" in said[-1]
    assert run.calibration.procedure == "joint"
    assert "Procedure hand-held: 16 holds and 15 turns" in run.reason
    assert run.reason in run.calibration.remarks
    assert {"reading", "segmenting", "solving"} <= set(run.seconds)
    plain = tumble.calibrate(whole, site=SITE, optional_terms=False)
    assert plain.files == []  # nothing is written without an output
    assert plain.estimate.terms == []
    assert known(plain.calibration.gyroscope).g_sensitivity is None


def test_without_a_gyro_the_multi_position_procedure_is_chosen_and_it_is_said(forces: Path) -> None:
    run = tumble.calibrate(forces, site=SITE)
    assert "Procedure multi-position" in run.reason
    assert "one triad only" in run.reason
    assert run.calibration.gyroscope is None
    assert "The gyros: the recording has none." in run.calibration.not_determined
    verdict = tumble.calibrate(forces, site=SITE, procedure="hand-held").calibration.verdict
    assert not verdict.fit  # what was asked for is not replaced
    assert "no gyros" in verdict.reasons[0]


def test_separate_poses_in_separate_files_are_multi_position(tmp_path: Path) -> None:
    """Fourteen files of one pose each: no turn is recorded, and none goes across the pauses."""
    files = [
        write_recording(tumbled([pose], seed=number, seconds=4.0), tmp_path / f"pose-{number:02d}.csv")
        for number, pose in enumerate(SIXTEEN[:14])
    ]
    run = tumble.calibrate(files, site=SITE, units="m/s^2,rad/s")
    assert "Procedure multi-position" in run.reason
    assert "0 turns" in run.reason
    assert run.calibration.quality.holds == len(run.calibration.recordings) == 14
    gaps = np.diff(run.recording.time)[np.array(run.recording.gaps) - 1]
    np.testing.assert_allclose(gaps, PAUSE, atol=1e-9)


def test_turns_too_few_leave_the_gyro_to_the_multi_position_procedure(tmp_path: Path) -> None:
    """Every turn but three is cut out of the recording: what the turns lack is said, not hidden."""
    recording = tumbled(SIXTEEN[:10])
    time, phase = recording.time, recording.time % 5.0
    keep = (time < 15.0) | (phase < 3.0)
    force, rate = known(recording.specific_force)[keep], known(recording.angular_rate)[keep]
    cut = replace(recording, time=time[keep], specific_force=force, angular_rate=rate)
    run = tumble.calibrate(write_recording(cut, tmp_path / "cut.csv"), site=SITE)
    assert "Procedure multi-position" in run.reason
    assert "turns between holds can be used" in run.reason


@pytest.mark.parametrize("procedure", ["hand-held", "multi-position", "six-position"])
def test_a_procedure_that_is_asked_for_is_taken(whole: Path, procedure: str) -> None:
    run = tumble.calibrate(whole, site=SITE, procedure=procedure)
    assert f"Procedure {procedure}, as asked for" in run.reason
    assert procedure != "six-position" or "Missing" not in str(run.page().blocks)


def test_by_name_the_estimate_is_the_same_and_in_the_mean_gyro_frame_symmetric(good: Recording) -> None:
    (usual, reason), (named, said) = told(good), told(good, "hand-held")
    assert named.parameters == usual.parameters
    assert "hand-held" in reason
    assert "as asked for" in said
    session = Session(good, given_site=SITE)
    turned = calibrate(session, replace(find_procedure("hand-held"), frame="mean-gyro"))
    assert turned.frame == "mean-gyro"
    gyro, other = known(turned.model.gyroscope), known(usual.model.gyroscope)
    np.testing.assert_allclose(gyro.matrix, gyro.matrix.T, atol=1e-12)
    C = np.linalg.solve(other.matrix, gyro.matrix)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-9)
    force = known(usual.model.accelerometer).matrix @ C
    np.testing.assert_allclose(force, known(turned.model.accelerometer).matrix, rtol=1e-9, atol=1e-9)
    # Norms know no frame: the length of each row of the accelerometers' matrix is as uncertain in either.
    for k in range(3):
        assert _norm_sigma(usual, k) == pytest.approx(_norm_sigma(turned, k), rel=1e-6)
    assert {"gyro non-orthogonality xy", "accelerometer misalignment yx"} <= {
        p.name for p in turned.parameters
    }


def _norm_sigma(estimate: Estimate, k: int) -> float:
    at = [estimate.names.index(f"accelerometer.matrix[{k},{j}]") for j in range(3)]
    row = known(estimate.model.accelerometer).matrix[k]
    slope = row / np.linalg.norm(row)
    return float(np.sqrt(slope @ estimate.covariance[np.ix_(at, at)] @ slope))


def test_six_faces_by_hand_are_not_fit_and_the_procedure_that_serves_is_named() -> None:
    """Seven poses are two too few for the accelerometers: what turns tell of gravity serves besides."""
    six = tumbled([0, 1, 2, 3, 4, 5])
    (said,) = [text for text in told(six)[0].objections if "all of the accelerometers" in text]
    assert "--procedure six-position" in said
    assert not [text for text in told(six, "six-position")[0].objections if "does not determine" in text]
    seven, _ = told(tumbled([0, 1, 2, 3, 4, 6, 10]))
    assert not seven.objections
    assert len([name for name in seven.names if name.startswith("accelerometer.matrix")]) == 9


def test_nine_poses_check_nothing_and_more_do(good: Recording) -> None:
    nine = tumbled([0, 1, 2, 3, 4, 5, 6, 8, 10])
    said = [" ".join(told(replace(one, angular_rate=None))[0].cautions) for one in (nine, good)]
    assert ["Nothing checks the accelerometers" in words for words in said] == [True, False]


# --- a paper's estimator, or somebody else's


@pytest.fixture(scope="module")
def six(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("six")
    simulate("six-position", output=folder, seed=5)
    return folder


def test_a_papers_estimator_stands_beside_with_a_document_of_its_own(six: Path, tmp_path: Path) -> None:
    run = tumble.calibrate(protocol=six, estimator="six-position", output=tmp_path)
    own = read_calibration(tmp_path / "calibration-six-position.json")
    assert own.accelerometer is not None
    assert own.procedure == known(run.estimate.shown(Beside)).estimate.procedure == "six-position"
    assert own.identity != run.calibration.identity
    assert "six-position by Hayal 2010, (2.5) and (2.6)" in (tmp_path / "report.html").read_text("utf-8")
    with pytest.raises(UsageError, match=r"^The estimator rate-test has to know .* give --protocol FILE"):
        tumble.calibrate(tmp_path / "none.csv", estimator="rate-test")


def _refused(session: object) -> NoReturn:
    raise UsageError("It wants more.")


PICKY = {name: Estimator(name, "it wants", "none", _refused) for name in ("picky", "six-position")}


def test_what_a_package_of_estimators_does_wrong_is_its_own_fault(six, tmp_path, monkeypatch):
    """A package that cannot be imported, one with a name that another one has, and an estimator that refuses."""
    for package, place in (("broken", "no_such_module:ALL"), ("picky", f"{__name__}:PICKY")):
        info = tmp_path / f"{package}-1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1\n")
        (info / "entry_points.txt").write_text(f"[tumble.estimators]\nits = {place}\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    for name, said in (
        (
            "six",
            r"no estimator 'six'\. .*picky \(it wants; none\).*zhang-optimal.* broken .*ModuleNotFoundError",
        ),
        ("six-position", r"^The packages picky and \w+ both have six-position"),
        ("picky", r"^The estimator picky does not serve here: It wants more\. Leave it out"),
    ):
        with pytest.raises(UsageError, match=said):
            tumble.calibrate(protocol=six, estimator=name)
    assert find_estimator("improved-six-position", has_protocol=False).name == "improved-six-position"


# --- what makes a calibration unfit although its numbers look good

DATA = Path(tumble.__file__).parent / "data" / RECORDING
OPTIONS: dict[str, Any] = {"site": Site.from_gravity(9.81), "rate": 100.0, "units": "m/s^2,rad/s"}


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    return np.loadtxt(DATA, delimiter=",", skiprows=1)


def saved(folder: Path, values: np.ndarray) -> Path:
    path = folder / "recording.csv"
    np.savetxt(path, values, delimiter=",", header="ax,ay,az,gx,gy,gz", comments="", fmt="%.6f")
    return path


def test_gyros_that_are_dead_or_saturated_and_one_recording_twice_are_seen(rows, tmp_path):
    dead, clipped = rows.copy(), rows.copy()
    dead[:, 4] = 0.01
    with pytest.raises(ConvergenceError, match="gy never changes"):
        tumble.calibrate(saved(tmp_path, dead), **OPTIONS)
    clipped[:, 3:] = np.clip(clipped[:, 3:], -0.9, 0.9)
    verdict = tumble.calibrate(saved(tmp_path, clipped), **OPTIONS).calibration.verdict
    assert not verdict.fit
    assert "satur" in verdict.reasons[0]
    with pytest.raises(UsageError, match=r"^(\S+) \(2\) and \1 \(1\) are the same recording"):
        tumble.calibrate([DATA, DATA], **OPTIONS)
    with pytest.raises(ObservabilityError, match="no temperature"):
        tumble.calibrate(DATA, procedure="thermal", **OPTIONS)


def test_a_single_pose_cannot_show_that_a_calibration_serves(rows: np.ndarray, tmp_path: Path) -> None:
    calibration = tumble.calibrate(DATA, **OPTIONS).calibration
    (result,) = verify(calibration, saved(tmp_path, rows[:500]), rate=100.0, units="m/s^2,rad/s")
    assert not result.fit
    assert "1 different pose" in result.reasons[0]
    (own,) = verify(calibration, DATA, rate=100.0, units="m/s^2,rad/s")
    assert own.fit
    assert "made from" in own.reasons[0]


def test_a_unit_that_is_plainly_none_of_its_sheet_is_said_to_be_none(tmp_path: Path) -> None:
    """With the sheet of a tactical one nothing settles, or holds seem to have moved: without it numbers show it."""
    for grade, said in (("consumer-mems", True), ("tactical", False)):
        simulate("hand-held", grade=grade, output=tmp_path, seed=0)
        found = tumble.calibrate(tmp_path / "recording.csv", prior="tactical").calibration.verdict
        assert found.fit is not said
        assert any("the kind tactical: the gyro's bias" in reason for reason in found.reasons) is said


@pytest.mark.parametrize(
    ("protocol", "procedure"), [("six-position", "multi-position"), ("multi-position-10", None)]
)
def test_a_gyro_that_counts_the_other_way_round_is_refused_even_where_only_holds_are_meant(
    protocol, procedure, tmp_path
):
    simulate(protocol, output=tmp_path, seed=3)
    given: dict[str, Any] = {"procedure": procedure, "protocol": tmp_path}
    assert "contradict" not in " ".join(tumble.calibrate(**given).calibration.verdict.reasons)
    with pytest.raises(RecordingError, match=r"turns the other way round.*-gx, -gy, -gz"):
        tumble.calibrate(**given, columns="t,ax,ay,az,-gx,-gy,-gz")


def test_what_six_faces_leave_is_taken_on_trust_or_not_determined(six: Path, tmp_path: Path) -> None:
    """They tell the gyros' scale factors to some parts in a thousand, and a crystal keeps 50 in a million."""
    simulate("multi-position-26", output=tmp_path / "another", seed=77)
    prior = known(tumble.calibrate(protocol=tmp_path / "another", output=tmp_path / "prior").files)[0]
    run = tumble.calibrate(protocol=six, procedure="multi-position", prior=prior)
    assert "prior is taken on trust" in " ".join(run.calibration.verdict.reasons)
    found = tumble.calibrate(protocol=six, rate="crystal").estimate
    assert found.not_determined
    assert "sample rate" not in {one.source for one in found.unseen}


# --- the noise models of `tumble noise`, read for a calibration

RATE = 50.0
TERMS = {"N": {"value": 1e-3}, "sigma": {"value": 2e-3}, "correlation time": {"value": 30.0}}


def noise(terms: dict[str, Any] = TERMS, unit: str = "m/s²", **changes: Any) -> dict[str, Any]:
    channels: dict[str, Any] = {f"a{x}": {"unit": unit, "terms": terms, "lines": []} for x in "xyz"}
    channels["az"]["lines"] = [{"amplitude": 0.1, "frequency_hz": 12.5}]
    return {"format": "tumble noise", "rate_hz": RATE, "channels": channels, **changes}


def still(unit: str = "m/s^2") -> Recording:
    samples = 1e-3 * np.sqrt(RATE) * np.random.default_rng(2).standard_normal((3000, 3)) + [0.1, -0.2, 9.8]
    return Recording(np.arange(3000) / RATE, samples, None, unit, "rad/s", RATE)


def test_a_models_terms_are_read_in_raw_units(tmp_path: Path) -> None:
    (tmp_path / "noise.json").write_text(json.dumps(noise()), encoding="utf-8")
    found = NoiseOfHolds.read(tmp_path / "noise.json", still("g"))
    force = known(found.force)
    assert found.rate is None
    assert force[0].random_walk == pytest.approx(1e-3 / 9.80665)
    assert force[2].gauss_markov[0].correlation_time == 30.0
    assert force[2].lines[0].frequency == 12.5
    with pytest.raises(UsageError, match="There is no noise file"):
        read_noise_models(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (noise({"N": {"value": -1.0}}), "is negative"),
        ({"format": "tumble calibration"}, "no noise document"),
        ({"format": "tumble noise"}, "lacks"),
        (noise(rate_hz=200.0), "200 Hz"),
        (noise({}), "too short"),
        (noise(channels={"ax": {"unit": "m/s²", "terms": {"N": {"value": 1.0}}}}), "no channel ay"),
        (noise(unit="counts"), "--units as here"),
    ],
)
def test_another_file_rate_or_unit_is_refused_in_a_sentence(tmp_path: Path, content: Any, words: str) -> None:
    (tmp_path / "noise.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(UsageError, match=words):
        NoiseOfHolds.read(tmp_path / "noise.json", still())


def test_holds_have_the_models_covariance_and_what_is_shaken_or_rounded_its_own() -> None:
    calm, shaken = still(), still()
    floor = NoiseFloor(np.full(3, 7e-3), np.zeros(3), 0.0, "none")
    timeline = Timeline(tuple(Hold(1000 * k, 1000 * (k + 1)) for k in range(3)), (), (), floor)
    # the third hold shakes a hundred times the noise
    known(shaken.specific_force)[2000:] += 0.7 * np.sin(np.arange(1000) * 0.05)[:, None]

    def modelled(given: Recording, means: HoldMeans, walk: float = 0.0) -> tuple[np.ndarray, list[str]]:
        model = NoiseModel(random_walk=1e-3, rate_random_walk=walk)
        made, said = model_means(given, timeline, means, [model] * 3, None)
        return known(made.specific_force_covariance), said

    means = observe_holds(calm, timeline)
    covariance, said = modelled(calm, means, 1e-5)
    # N² / t, to which the walk adds little
    assert covariance[0, 0, 0] == pytest.approx(1e-6 / 20.0, rel=0.05)
    assert not said
    own = observe_holds(shaken, timeline)
    covariance, said = modelled(shaken, own, 1e-5)
    assert covariance[2, 0, 0] == pytest.approx(known(own.specific_force_covariance)[2, 0, 0])
    assert said
    # Twice the noise's own variance: too little for a shaken hold, too much for the model alone.
    rounding = np.array([1e-7, 0.0, 3e-8]) * np.array([[1.0], [2.0], [0.5]])
    coarse = replace(
        means,
        specific_force_rounding=rounding,
        specific_force_covariance=known(means.specific_force_covariance) + rounding[:, :, None] * np.eye(3),
    )
    fine, (covariance, said) = modelled(calm, means)[0], modelled(calm, coarse)
    assert not said
    np.testing.assert_allclose(np.diagonal(covariance - fine, axis1=1, axis2=2), rounding, atol=1e-12)
