"""Real recordings, from the file to the verdict, with nothing said but the site's gravity (and the rate).

The yardstick is imu_tk's own result for the Xsens recording, scored by the same code: at each hold the
norm of the mean specific force against gravity, over each turn the angle between gravity carried by the
corrected gyro and gravity seen.
"""

import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.given import given as known

from tumble.calibration import (
    LAYOUT,
    Estimate,
    Options,
    Session,
    calibrate as joint,
    find_procedure,
    gather,
    hold_norm_errors,
    named_function,
    score_turns,
    unknowns_from_triad,
)
from tumble.document import read_calibration
from tumble.earth import Site
from tumble.export import read_imu_tk
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.workflows import CalibrationRun, calibrate, verify

XSENS_GRAVITY, MPU_GRAVITY = 9.81744, 9.81
MPU: dict[str, Any] = {"columns": "ax,ay,az,gx,gy,gz", "units": "m/s^2,rad/s", "rate": 100.0}


def on_the_page(root: Path) -> dict[tuple[str, str], tuple[float, float]]:
    """(recording, set of parameters) -> mm/s² and degrees, from the first table of the page of real recordings."""
    page = (root / "docs" / "real-recordings.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\|([^|]*)\| \**([^|*]*)\** \| \**([\d.]+)\** \| \**([\d.]+)\** \|$", page, re.M)
    found: dict[tuple[str, str], tuple[float, float]] = {}
    recording = ""
    for first, what, norm, angle in rows:
        recording = first.split(",")[0].strip() or recording
        found[recording, what] = float(norm), float(angle)
    return found


def score(model: ImuModel, run: CalibrationRun, gravity: float) -> tuple[float, float]:
    """Root mean squares: m/s² over holds, degrees over turns."""
    data = gather(run.recording, run.timeline, run.means)
    norms = hold_norm_errors(model, data.force_mean, gravity)
    angles = np.degrees(score_turns(model, data).angle)
    return float(np.sqrt(np.mean(norms**2))), float(np.sqrt(np.nanmean(angles**2)))


@pytest.fixture(scope="module")
def runs(root, reference_data, tmp_path_factory):
    xsens, folder = reference_data / "xsens_mti_hand", tmp_path_factory.mktemp("runs")
    mpu = Site.from_gravity(MPU_GRAVITY)
    given: dict[str, Any] = {
        "xsens": (
            [xsens / "xsens_acc.txt.gz", xsens / "xsens_gyro.txt.gz"],
            {"site": Site.from_gravity(XSENS_GRAVITY), "rate": "crystal"},
        ),
        "imu0": (root / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz", {"site": mpu, "rate": 100.0}),
        "imu1": (reference_data / "mpu9150" / "imu1.log.gz", {"site": mpu, "rate": 100.0}),
    }
    return {name: calibrate(files, output=folder / name, **more) for name, (files, more) in given.items()}


@pytest.fixture(scope="module")
def xsens(runs: dict[str, CalibrationRun]) -> CalibrationRun:
    return runs["xsens"]


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


@pytest.mark.parametrize(
    ("name", "gravity", "units", "norm", "angle_deg"),
    [
        # Yardstick of the Xsens recording, of raw ADC counts: imu_tk's 1.1 mm/s²; an independent estimate reached
        # 1.05 mm/s² and 0.15°.
        ("xsens", XSENS_GRAVITY, ("counts", "counts"), 1.05e-3, 0.15),
        # imu_tk's 2.0 mm/s² and 0.26° on imu0, an independent estimate 0.07°. The norm is noise of 22
        # holds: 2.1 where ours weighs each hold by its own noise.
        ("imu0", MPU_GRAVITY, ("m/s^2", "rad/s"), 2.2e-3, 0.07),
        # No published figure: no worse than half as much again as its sister.
        ("imu1", MPU_GRAVITY, ("m/s^2", "rad/s"), 3.3e-3, 0.105),
    ],
)
def test_it_is_calibrated_and_fit_and_residuals_are_no_worse_than_what_others_reached(
    runs, root, name, gravity, units, norm, angle_deg
):
    run = runs[name]
    assert run.calibration.procedure == "joint"
    assert run.calibration.verdict.fit, run.calibration.verdict.reasons
    assert [file.name for file in run.files] == ["calibration.json", "report.html"]
    assert read_calibration(run.files[0]) == run.calibration
    assert (run.recording.specific_force_unit, run.recording.angular_rate_unit) == units
    # Those that an eye counts: the authors of the Xsens recording speak of 37 to 40, both MPU were tumbled together.
    assert len(run.timeline.holds) in (range(37, 41) if name == "xsens" else (22,))
    found = score(run.estimate.model, run, gravity)
    assert found[0] <= norm
    assert found[1] <= angle_deg
    # 5 %: another machine's arithmetic moves the third figure; a change of the method moves the first.
    page = on_the_page(root)["Xsens MTi" if name == "xsens" else f"MPU-9150 {name}", "tumble"]
    assert (1e3 * found[0], found[1]) == pytest.approx(page, rel=0.05)
    # The document says the same, in SI: its residuals are the adjustment's own, of adjusted means.
    quality = run.calibration.quality
    assert quality.rms_hold_norm == pytest.approx(found[0], rel=0.1)
    assert np.degrees(quality.rms_turn_angle or 0.0) == pytest.approx(found[1], rel=0.2)


def test_ours_beat_imu_tk_s_values_on_its_own_recording(xsens, without_g_sensitivity, imu_tk, root):
    """With the same model a little, with the g-sensitivity that the recording shows four times on turns.

    Theirs are said to be 1.1 mm/s² and 0.65 to 0.70°, depending on how the edges of turns are cut.
    """
    models = (imu_tk, without_g_sensitivity.model, xsens.estimate.model)
    theirs, same_model, ours = (score(model, xsens, XSENS_GRAVITY) for model in models)
    assert 1.0e-3 < theirs[0] < 1.2e-3
    assert 0.6 < theirs[1] < 0.75
    assert same_model[0] < theirs[0]
    assert same_model[1] < theirs[1]
    assert ours[1] < 0.25 * theirs[1]
    page = on_the_page(root)["Xsens MTi", "tumble, without optional terms"]
    assert (1e3 * same_model[0], same_model[1]) == pytest.approx(page, rel=0.05)


def test_with_imu_tk_s_own_model_our_parameters_are_its_parameters(without_g_sensitivity, imu_tk):
    """In one convention, all but the gyro's bias within 3 of our sigma.

    imu_tk takes the bias as the mean of the first 50 s at rest; ours is that of the whole recording,
    and with the g-sensitivity that it shows (left out here) the first pose's output is 9 counts off:
    10 to 11 sigma.
    """
    turned = change_frame(imu_tk, "accelerometer-x")
    force, gyro = known(turned.accelerometer), known(turned.gyroscope)
    x = np.zeros(LAYOUT.size)
    # Round-off above the diagonal is cut off.
    x[:12] = unknowns_from_triad(Triad(np.tril(force.matrix), force.bias))
    x[12:21], x[21:24] = gyro.matrix.ravel(), gyro.bias
    labels, values = named_function(frozenset(), "full", "accelerometer-x", ("counts", "counts"))
    theirs = {name: float(value) for (name, _), value in zip(labels, values(x), strict=True)}
    ours = {parameter.name: parameter for parameter in without_g_sensitivity.parameters}
    assert len(theirs) == 21
    for name, value in theirs.items():
        limit = 11.0 if name.startswith("gyro bias") else 3.0
        assert abs(value - ours[name].value) < limit * ours[name].standard_uncertainty, name


def test_the_xsens_gyro_is_g_sensitive_and_quadratic_terms_are_not_wanted(xsens: CalibrationRun) -> None:
    """Hold means alone show it: counts at rest change by some 20 with the pose, noise of a mean by 0.2."""
    assert np.all(np.ptp(known(xsens.means.angular_rate), axis=0) > 10.0)
    kept = {term.name for term in xsens.estimate.terms if term.kept}
    assert "g_sensitivity" in kept
    assert "quadratic" not in kept


def test_both_units_of_the_mpu_recordings_saw_the_same_turns_and_are_told_apart(runs, reference_data):
    """Two units on one board: how far each turn went is a number that neither calibration knows of the other.

    Their clocks differ and the last degree of a turn may be cut otherwise: 0.5° at the median.
    """
    first, second = (np.degrees(known(runs[n].estimate.turns).sizes[:-1]) for n in ("imu0", "imu1"))
    assert np.median(np.abs(first - second)) < 0.5
    (result,) = verify(runs["imu0"].calibration, reference_data / "mpu9150" / "imu1.log.gz", **MPU)
    assert not result.fit
    assert "another unit" in result.reasons[0]


def test_the_first_half_s_calibration_serves_the_second_half(root: Path, tmp_path: Path) -> None:
    """The MPU-9150 recording is cut in two after 100 s; 13 poses are enough for the first."""
    with gzip.open(root / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz", "rt") as file:
        lines = [line for line in file.read().splitlines() if line[0].isdigit() or line[0] == "-"]
    for name, part in (("first.csv", lines[:10000]), ("second.csv", lines[10000:])):
        (tmp_path / name).write_text("\n".join(part) + "\n")
    site = Site.from_gravity(MPU_GRAVITY)
    run = calibrate(tmp_path / "first.csv", site=site, optional_terms=False, **MPU)
    (result,) = verify(run.calibration, tmp_path / "second.csv", site=site, **MPU)
    assert result.fit, result.reasons
    # 9 unknowns from 14 holds, judged on others: some 5 mm/s² where the fit itself shows 2.
    assert result.rms_norm < 8e-3
    assert np.degrees(result.rms_angle) < 0.3
