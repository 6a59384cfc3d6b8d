"""Real recordings, from the file to the verdict, with nothing said but the site's gravity (and the rate).

The yardstick is imu_tk's own result for the Xsens recording, scored by the same code: at each hold the
norm of the mean specific force against gravity, over each turn the angle between gravity carried by the
corrected gyro and gravity seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.calibration import Estimate, Options, Session, find_procedure
from tumble.calibration import calibrate as joint
from tumble.calibration.checks.scores import hold_norm_errors, score_turns
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.equations.triad_unknowns import unknowns_from_triad
from tumble.calibration.outcome.description import named_function
from tumble.document import read_calibration
from tumble.earth import Site
from tumble.export.readers import read_imu_tk
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.workflows.calibrate import CalibrationRun, calibrate
from tumble.workflows.verify import verify

XSENS_GRAVITY, MPU_GRAVITY = 9.81744, 9.81


@dataclass(frozen=True)
class Scores:
    """Root mean squares: m/s² over holds, degrees over turns."""

    norm: float
    angle_deg: float


def score(model: ImuModel, run: CalibrationRun, gravity: float) -> Scores:
    data = gather(run.recording, run.timeline, run.means)
    norms = hold_norm_errors(model, data.force_mean, gravity)
    angles = score_turns(model, data).angle
    angles = angles[np.isfinite(angles)]
    return Scores(float(np.sqrt(np.mean(norms**2))), float(np.degrees(np.sqrt(np.mean(angles**2)))))


def xsens_files(reference_data: Path) -> list[Path]:
    folder = reference_data / "xsens_mti_hand"
    return [folder / "xsens_acc.txt.gz", folder / "xsens_gyro.txt.gz"]


@pytest.fixture(scope="module")
def xsens(reference_data: Path, tmp_path_factory: pytest.TempPathFactory) -> CalibrationRun:
    return calibrate(
        xsens_files(reference_data),
        output=tmp_path_factory.mktemp("xsens"),
        site=Site.from_gravity(XSENS_GRAVITY),
        rate="crystal",
    )


@pytest.fixture(scope="module")
def imu0(root: Path, tmp_path_factory: pytest.TempPathFactory) -> CalibrationRun:
    path = root / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz"
    return calibrate(
        path, output=tmp_path_factory.mktemp("imu0"), site=Site.from_gravity(MPU_GRAVITY), rate=100.0
    )


@pytest.fixture(scope="module")
def imu1(reference_data: Path, tmp_path_factory: pytest.TempPathFactory) -> CalibrationRun:
    path = reference_data / "mpu9150" / "imu1.log.gz"
    return calibrate(
        path, output=tmp_path_factory.mktemp("imu1"), site=Site.from_gravity(MPU_GRAVITY), rate=100.0
    )


@pytest.fixture(scope="module")
def without_g_sensitivity(xsens: CalibrationRun) -> Estimate:
    """imu_tk's own model: no optional terms."""
    session = Session(xsens.recording, None, Site.from_gravity(XSENS_GRAVITY))
    session.means, session.options = xsens.means, Options(optional_terms=False)
    session.timeline = xsens.timeline
    return joint(session, find_procedure("joint"))


@pytest.fixture(scope="module")
def imu_tk(reference_data: Path) -> ImuModel:
    """What imu_tk finds for the recording, in its own frame."""
    return read_imu_tk(reference_data / "xsens_mti_hand").model


@pytest.mark.parametrize("name", ["xsens", "imu0", "imu1"])
def test_it_is_calibrated_and_fit_without_any_further_word(name: str, request: pytest.FixtureRequest) -> None:
    run: CalibrationRun = request.getfixturevalue(name)
    assert run.calibration.procedure == "joint"
    assert run.calibration.verdict.fit, run.calibration.verdict.reasons
    assert [file.name for file in run.files] == ["calibration.json", "report.html"]
    assert read_calibration(run.files[0]) == run.calibration


def test_the_units_of_the_files_are_found(
    xsens: CalibrationRun, imu0: CalibrationRun, imu1: CalibrationRun
) -> None:
    """Raw ADC counts of the Xsens; m/s² and rad/s of the MPU-9150, as their authors say."""
    assert (xsens.recording.specific_force_unit, xsens.recording.angular_rate_unit) == ("counts", "counts")
    for run in (imu0, imu1):
        assert (run.recording.specific_force_unit, run.recording.angular_rate_unit) == ("m/s^2", "rad/s")


def test_holds_and_turns_are_those_that_an_eye_counts(
    xsens: CalibrationRun, imu0: CalibrationRun, imu1: CalibrationRun
) -> None:
    """The authors of the Xsens recording speak of 37 to 40 poses; both MPU units were tumbled together."""
    assert 37 <= len(xsens.timeline.holds) <= 40
    assert len(imu0.timeline.holds) == len(imu1.timeline.holds) == 22


@pytest.mark.parametrize(
    ("name", "gravity", "norm", "angle_deg"),
    [
        # Yardstick of the Xsens recording: imu_tk's 1.1 mm/s²; an independent estimate reached 1.05 mm/s²
        # and 0.15°.
        pytest.param("xsens", XSENS_GRAVITY, 1.05e-3, 0.15, id="xsens"),
        # imu_tk's 2.0 mm/s² and 0.26° on imu0, an independent estimate 0.07°. The norm is noise of 22
        # holds: 2.1 where ours weighs each hold by its own noise.
        pytest.param("imu0", MPU_GRAVITY, 2.2e-3, 0.07, id="imu0"),
        # No published figure: no worse than half as much again as its sister.
        pytest.param("imu1", MPU_GRAVITY, 3.3e-3, 0.105, id="imu1"),
    ],
)  # fmt: skip
def test_residuals_are_no_worse_than_what_others_reached(
    name: str, gravity: float, norm: float, angle_deg: float, request: pytest.FixtureRequest
) -> None:
    run: CalibrationRun = request.getfixturevalue(name)
    scores = score(run.estimate.model, run, gravity)
    assert scores.norm <= norm
    assert scores.angle_deg <= angle_deg
    # The document says the same, in SI: its residuals are the adjustment's own, of adjusted means.
    assert run.calibration.quality.rms_hold_norm == pytest.approx(scores.norm, rel=0.1)
    assert np.degrees(run.calibration.quality.rms_turn_angle or 0.0) == pytest.approx(
        scores.angle_deg, rel=0.2
    )


def test_imu_tk_s_values_score_as_they_are_said_to(xsens: CalibrationRun, imu_tk: ImuModel) -> None:
    """Said to be 1.1 mm/s² and 0.65 to 0.70°, depending on how the edges of turns are cut."""
    theirs = score(imu_tk, xsens, XSENS_GRAVITY)
    assert 1.0e-3 < theirs.norm < 1.2e-3
    assert 0.6 < theirs.angle_deg < 0.75


def test_ours_beat_imu_tk_s_values_on_its_own_recording(
    xsens: CalibrationRun, without_g_sensitivity: Estimate, imu_tk: ImuModel
) -> None:
    """With the same model a little, with the g-sensitivity that the recording shows four times on turns."""
    theirs = score(imu_tk, xsens, XSENS_GRAVITY)
    same_model = score(without_g_sensitivity.model, xsens, XSENS_GRAVITY)
    ours = score(xsens.estimate.model, xsens, XSENS_GRAVITY)
    assert same_model.norm < theirs.norm
    assert same_model.angle_deg < theirs.angle_deg
    assert ours.angle_deg < 0.25 * theirs.angle_deg


def test_with_imu_tk_s_own_model_our_parameters_are_its_parameters(
    without_g_sensitivity: Estimate, imu_tk: ImuModel
) -> None:
    """In one convention, all but the gyro's bias within 3 of our sigma.

    imu_tk takes the bias as the mean of the first 50 s at rest; ours is that of the whole recording,
    and with the g-sensitivity that it shows (left out here) the first pose's output is 9 counts off:
    10 to 11 sigma.
    """
    turned = change_frame(imu_tk, "accelerometer-x")
    assert turned.accelerometer is not None
    assert turned.gyroscope is not None
    x = np.zeros(LAYOUT.size)
    # Round-off above the diagonal is cut off.
    x[:12] = unknowns_from_triad(Triad(np.tril(turned.accelerometer.matrix), turned.accelerometer.bias))
    x[12:21], x[21:24] = turned.gyroscope.matrix.ravel(), turned.gyroscope.bias
    labels, values = named_function(frozenset(), "full", "accelerometer-x", ("counts", "counts"))
    theirs = {name: float(value) for (name, _), value in zip(labels, values(x), strict=True)}
    ours = {parameter.name: parameter for parameter in without_g_sensitivity.parameters}
    assert len(theirs) == 21
    for name, value in theirs.items():
        own = ours[name]
        limit = 11.0 if name.startswith("gyro bias") else 3.0
        assert abs(value - own.value) < limit * own.standard_uncertainty, name


def test_the_xsens_gyro_is_g_sensitive_and_quadratic_terms_are_not_wanted(xsens: CalibrationRun) -> None:
    """Hold means alone show it: counts at rest change by some 20 with the pose, noise of a mean by 0.2."""
    assert xsens.means.angular_rate is not None
    spread = np.ptp(xsens.means.angular_rate, axis=0)
    assert np.all(spread > 10.0)
    kept = {term.name for term in xsens.estimate.terms if term.kept}
    assert "g_sensitivity" in kept
    assert "quadratic" not in kept


def test_both_units_of_the_mpu_recordings_saw_the_same_turns(
    imu0: CalibrationRun, imu1: CalibrationRun
) -> None:
    """Two units on one board: how far each turn went is a number that neither calibration knows of the other.

    Their clocks differ and the last degree of a turn may be cut otherwise: 0.5° at the median.
    """
    first, second = (np.degrees(run.estimate.turns.sizes[:-1]) for run in (imu0, imu1))
    assert np.median(np.abs(first - second)) < 0.5


def test_the_first_half_s_calibration_serves_the_second_half(
    root: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """The MPU-9150 recording is cut in two after 100 s; 13 poses are enough for the first."""
    import gzip

    folder = tmp_path_factory.mktemp("halves")
    with gzip.open(root / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz", "rt") as file:
        lines = file.read().splitlines()
    if not lines[0][0].isdigit() and lines[0][0] != "-":
        lines = lines[1:]
    for name, part in (("first.csv", lines[:10000]), ("second.csv", lines[10000:])):
        (folder / name).write_text("\n".join(part) + "\n")
    options: dict[str, Any] = {"columns": "ax,ay,az,gx,gy,gz", "units": "m/s^2,rad/s", "rate": 100.0}
    site = Site.from_gravity(MPU_GRAVITY)
    run = calibrate(folder / "first.csv", site=site, optional_terms=False, **options)
    (result,) = verify(run.calibration, folder / "second.csv", site=site, **options)
    assert result.fit, result.reasons
    # 9 unknowns from 14 holds, judged on others: some 5 mm/s² where the fit itself shows 2.
    assert result.rms_norm < 8e-3
    assert np.degrees(result.rms_angle) < 0.3


def test_another_unit_s_calibration_is_refused_by_verify(imu0: CalibrationRun, reference_data: Path) -> None:
    """The sister unit on the same board."""
    (result,) = verify(
        imu0.calibration, reference_data / "mpu9150" / "imu1.log.gz", columns="ax,ay,az,gx,gy,gz",
        units="m/s^2,rad/s", rate=100.0,
    )  # fmt: skip
    assert not result.fit
    assert "another unit" in result.reasons[0]
