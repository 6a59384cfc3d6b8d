"""Every named protocol, simulated and calibrated from its files alone, gives back what was simulated.

Without noise and placement errors to rounding; with both within 4.5 standard uncertainties of the truth.
A threshold of 4.5 is passed by chance once in 150,000 parameters; about 200 are looked at here.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.document.part import plain
from tumble.document.result import Calibration
from tumble.earth import Site
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.protocol import named_protocol, write_protocol
from tumble.sensor import change_frame
from tumble.simulation import GRADES, SessionErrors, TriadNoise, find_grade
from tumble.workflows.calibrate import calibrate
from tumble.workflows.simulate import simulate

SITE = Site.from_latitude(float(np.radians(48.0)), 500.0)
# procedure -> the protocol that it evaluates, and which triads it tells in full.
FULL: dict[str, tuple[str, tuple[str, ...]]] = {
    "six-position": ("six-position", ()),
    "improved-six-position": ("six-position", ("accelerometer",)),
    "multi-position": ("multi-position-26", ("accelerometer",)),
    "rate-table": ("rate-table", ("gyroscope",)),
    "modified-multi-position": ("modified-multi-position", ("accelerometer", "gyroscope")),
    "turntable": ("turntable-9", ("accelerometer", "gyroscope")),
    "laboratory": ("laboratory", ("accelerometer", "gyroscope")),
    "strapdown-rotation": ("strapdown-rotation", ("accelerometer", "gyroscope")),
}
# A table's rotations are integrated in windows while the Earth turns: second order is left, some 1e-8, of which the
# turntable states 1.3e-8 itself. Six poses tell the fixture's axes against the unit's by the prior of its mounting
# alone, 0.2 rad, which pulls a rotation of some mrad, known to 1°.
ROUNDING = {
    "rate-table": 1e-5,
    "improved-six-position": 1e-5,
    "laboratory": 2e-8,
    "modified-multi-position": 1e-8,
    "strapdown-rotation": 5e-8,
    "turntable": 4e-8,
}


@pytest.fixture(autouse=True)
def white(monkeypatch: pytest.MonkeyPatch) -> None:
    """A unit with white noise alone: the bias of a session then is the unit's bias."""
    grade = find_grade("consumer-mems")

    def without_flicker(noise: TriadNoise) -> TriadNoise:
        return replace(noise, bias_instability=0.0)

    quiet = replace(
        grade,
        name="white",
        accelerometer=replace(grade.accelerometer, noise=without_flicker(grade.accelerometer.noise)),
        gyroscope=replace(grade.gyroscope, noise=without_flicker(grade.gyroscope.noise)),
        g_sensitivity=0.0,
    )
    monkeypatch.setitem(GRADES, "white", quiet)


def played(
    folder: Path, name: str, procedure: str, *, noise: bool, units: str, seed: int
) -> tuple[Any, Calibration]:
    """Simulate a protocol, calibrate from what was written, and return truth and calibration."""
    protocol = replace(named_protocol(name), site=SITE, procedure=procedure)
    write_protocol(protocol, folder / "todo.yaml")
    done = simulate(
        folder / "todo.yaml",
        output=folder / "sim",
        grade="white",
        seed=seed,
        units=units,
        errors=SessionErrors(noise=noise, placement=noise),
    )
    return done.truth, calibrate(protocol=folder / "sim" / "protocol.yaml").calibration


def blocks_of(truth: Any, calibration: Calibration) -> Any:
    """The truth in the calibration's frame."""
    if calibration.frame.name == "fixture":
        return truth
    return truth[f"in_frame_{calibration.frame.name.replace('-', '_')}"]


@pytest.mark.parametrize("procedure", sorted(FULL))
def test_without_noise_and_placement_errors_the_truth_comes_back(tmp_path: Path, procedure: str) -> None:
    """Rounding: 1e-9 of the scale factor for a matrix, of 10 m/s² or 1 rad/s for a bias. SI is but another scale."""
    name, triads = FULL[procedure]
    truth, calibration = played(tmp_path, name, procedure, noise=False, units="counts", seed=11)
    blocks = blocks_of(truth, calibration)
    limit = ROUNDING.get(procedure, 1e-9)
    for triad in triads:
        found = getattr(calibration, triad)
        matrix, bias = np.array(blocks[triad]["matrix"]), np.array(blocks[triad]["bias"])
        scale = float(np.mean(np.abs(np.diag(matrix))))
        np.testing.assert_allclose(found.matrix, matrix, rtol=0, atol=limit * scale)
        largest = 10.0 if triad == "accelerometer" else 1.0
        np.testing.assert_allclose(found.bias, bias, rtol=0, atol=limit * scale * largest)
    if procedure == "six-position":
        # Each sensor's own sensitivity and bias are of second order in how the unit sits.
        found = calibration.accelerometer
        assert found is not None
        assert found.matrix is not None
        true = np.array(blocks["accelerometer"]["matrix"])
        np.testing.assert_allclose(np.diag(found.matrix), np.diag(true), rtol=1e-7)
        bias = np.array(blocks["accelerometer"]["bias"])
        np.testing.assert_allclose(found.bias, bias, rtol=0, atol=1e-8 * float(true[0, 0]))


@pytest.mark.parametrize("name", ["multi-position-9", "multi-position-10", "multi-position-18"])
def test_fewer_poses_give_the_truth_back_too(tmp_path: Path, name: str) -> None:
    """In counts; the turns between ten nominal poses tell an angle that the poses do not."""
    truth, calibration = played(tmp_path, name, "multi-position", noise=False, units="counts", seed=3)
    assert calibration.accelerometer is not None
    assert calibration.accelerometer.matrix is not None
    true = np.array(blocks_of(truth, calibration)["accelerometer"]["matrix"])
    np.testing.assert_allclose(calibration.accelerometer.matrix, true, rtol=0, atol=1e-9 * true[0, 0])


@pytest.mark.parametrize(("units", "seed"), [("SI", 1), ("counts", 2)])
@pytest.mark.parametrize("procedure", sorted(FULL))
def test_with_noise_and_placement_errors_the_truth_is_within_the_uncertainty(
    tmp_path: Path, procedure: str, units: str, seed: int
) -> None:
    name, _ = FULL[procedure]
    truth, calibration = played(tmp_path, name, procedure, noise=True, units=units, seed=seed)
    blocks = blocks_of(truth, calibration)
    sigma = np.sqrt(np.diag(calibration.covariance_matrix))
    looked_at = 0
    for index, parameter in enumerate(calibration.covariance_parameters):
        if sigma[index] == 0.0:
            continue  # fixed by the frame or by the test
        error = entry(plain(calibration), parameter) - entry(blocks, parameter)
        assert abs(error) <= 4.5 * sigma[index], parameter
        looked_at += 1
    assert looked_at >= 6


def entry(blocks: Any, parameter: str) -> float:
    """The number that a name such as ``accelerometer.matrix[1,0]`` stands for; an absent term is zero."""
    triad, rest = parameter.split(".")
    key, index = rest.rstrip("]").split("[")
    value = blocks[triad][key]
    if value is None:
        return 0.0
    for i in index.split(","):
        value = value[int(i)]
    return float(value)


def test_every_procedure_with_a_protocol_is_tested_here() -> None:
    """The joint one has tests of its own (test_joint*.py), and so has the thermal one."""
    assert set(FULL) | {"hand-held", "joint", "thermal"} == set(KNOWN_PROCEDURES)


def test_the_frames_of_truth_and_calibration_are_one_rotation_apart(tmp_path: Path) -> None:
    """The truth is given in both frames, and one is the other's `change_frame`."""
    from tumble.sensor import ImuModel, Triad

    truth, _ = played(tmp_path, "six-position", "six-position", noise=False, units="SI", seed=5)

    def triad(blocks: Any, name: str) -> Triad:
        return Triad(np.array(blocks[name]["matrix"]), np.array(blocks[name]["bias"]))

    own = ImuModel(triad(truth, "accelerometer"), triad(truth, "gyroscope"))
    turned = change_frame(own, "accelerometer-x")
    assert turned.gyroscope is not None
    other = triad(truth["in_frame_accelerometer_x"], "gyroscope")
    np.testing.assert_allclose(turned.gyroscope.matrix, other.matrix, rtol=0, atol=1e-12)
