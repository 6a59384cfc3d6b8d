"""A recording without holds, or of a magnetometer alone, is calibrated as far as it goes; what is missing is said."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import tumble
from tumble.document import read_calibration
from tumble.errors import TumbleError, UsageError
from tumble.workflows.calibrate import calibrate

M = np.array([[1.10, 0.05, -0.02], [0.05, 0.92, 0.04], [-0.02, 0.04, 1.19]])
H = np.array([12.0, -30.0, 44.0])


def turned(path: Path, *, cap: float = -1.0, rows: int = 800, others: bool = False) -> Path:
    """Write a file of a unit that is turned about; `cap` is the least z of a field's direction."""
    rng = np.random.default_rng(8)
    # Down a spiral of twenty turns: the unit never rests.
    z = np.linspace(0.99, max(cap, -0.99), rows)
    around = np.linspace(0.0, 40.0 * np.pi, rows)
    across = np.sqrt(1.0 - z**2)
    field = 49.0 * np.column_stack([across * np.cos(around), across * np.sin(around), z])
    values = field @ M.T + H + rng.normal(0.0, 0.3, (len(field), 3))
    names, columns = ["t"], [0.02 * np.arange(len(values))]
    if others:
        names += ["ax [m/s^2]", "ay [m/s^2]", "az [m/s^2]", "gx [rad/s]", "gy [rad/s]", "gz [rad/s]"]
        up = field / 49.0
        rate = -np.cross(up, np.gradient(up, 0.02, axis=0))
        columns += [*(9.81 * up + rng.normal(0.0, 0.05, up.shape)).T]
        columns += [*(rate + rng.normal(0.0, 0.01, up.shape)).T]
    names += ["mx [uT]", "my [uT]", "mz [uT]"]
    table = np.column_stack([*columns, values])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    return path


@pytest.mark.parametrize("others", [False, True])
def test_without_holds_the_magnetometer_alone_is_calibrated(tmp_path: Path, others: bool) -> None:
    run = calibrate(turned(tmp_path / "turned.csv", others=others), output=tmp_path / "out", field="49±0.1uT")
    document = read_calibration(tmp_path / "out")
    block = document.magnetometer
    assert document.verdict.fit
    assert run.accepted
    assert document.verdict.reasons[0].startswith("Only the magnetometer is calibrated.")
    assert "gyros' biases are not determined" in document.verdict.reasons[0]
    assert document.accelerometer is None
    assert document.gyroscope is None
    assert block is not None
    assert block.frame == "magnetometer"
    assert block.verdict is not None
    assert block.verdict.use == "fit with reservations"
    sigma = np.sqrt(np.diag(block.covariance))
    assert block.matrix is not None
    found = np.array(block.matrix)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    true = 1e6 * M[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    assert np.all(np.abs(found - true) < 4.0 * sigma[:6])
    assert block.bias is not None
    assert np.all(np.abs(np.array(block.bias) - H) < 4.0 * sigma[6:])
    corrected = document.correct_field(np.array([49.0 * M[:, 0] + H]))
    assert corrected is not None
    np.testing.assert_allclose(corrected, [[49e-6, 0.0, 0.0]], atol=2e-7)
    assert "magnetometer-sphere" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_directions_on_one_side_do_not_determine_it(tmp_path: Path) -> None:
    run = calibrate(turned(tmp_path / "half.csv", cap=0.45), output=None)
    block = run.calibration.magnetometer
    assert block is not None
    assert block.matrix is None
    assert not run.accepted
    assert any("Turn the unit" in text for text in run.calibration.verdict.reasons)
    assert run.calibration.correct_field(np.zeros((1, 3))) is None


def test_a_recording_of_seconds_is_too_short_for_any_triad(tmp_path: Path) -> None:
    with pytest.raises(TumbleError, match=r"too short: it lasts 3\.0 s, .* The magnetometer"):
        calibrate(turned(tmp_path / "short.csv", cap=0.45, rows=150, others=True))
    with pytest.raises(TumbleError):
        calibrate(turned(tmp_path / "few.csv", rows=20))


def test_a_magnetometer_that_is_constant_is_refused_in_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "still.csv"
    rows = np.column_stack([0.02 * np.arange(500), np.tile([20.0, -3.0, 44.0], (500, 1))])
    np.savetxt(file, rows, delimiter=",", header="t,mx [uT],my [uT],mz [uT]", comments="", fmt="%.3f")
    with pytest.raises(TumbleError) as caught:
        calibrate(file)
    assert "\n" not in str(caught.value)


def test_what_was_asked_for_is_done_for_a_magnetometer_alone_or_refused(tmp_path: Path) -> None:
    file, limits = turned(tmp_path / "turned.csv"), tmp_path / "limits.yaml"
    limits.write_text("rule: simple\nlimits:\n  gyro bias: {within: 0.001 deg/s}\n", encoding="utf-8")
    run = calibrate(file, limits=limits, notes=["operator=Eve <7>"], field="49uT", output=tmp_path / "out")
    document = read_calibration(tmp_path / "out")
    assert document.limits is not None
    assert (document.verdict.fit, document.limits.decision, run.accepted) == (True, "undecided", False)
    assert document.notes == {"operator": "Eve <7>"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "nothing was compared with its limits" in page
    assert "Eve &lt;7&gt;" in page
    for option, value in {"prior": "tactical", "monte_carlo": 1000, "estimator": "six-position"}.items():
        with pytest.raises(UsageError, match=rf"^--{option[:5]}.* only the magnetometer .* leave it out\. "):
            calibrate(file, **{option: value})  # type: ignore[arg-type]
    with pytest.raises(TumbleError):
        calibrate(file, procedure="hand-held")


def test_what_field_means_is_read_or_refused(tmp_path: Path) -> None:
    from tumble.workflows.magnetometer import given_field

    field = given_field("0.492±0.003 gauss, dip 66")
    assert field is not None
    assert field.norm == pytest.approx(49.2e-6)
    assert field.norm_sigma == pytest.approx(0.3e-6)
    assert field.dip == pytest.approx(np.radians(66.0))
    plain = given_field("49.2uT")
    assert plain is not None
    assert plain.norm_sigma == pytest.approx(0.492e-6)
    assert plain.dip is None
    for wrong in ("49.2", "49.2 furlongs", "4900uT", "49uT,120", "uT", "49.2uT,66,3", "-49uT"):
        with pytest.raises(TumbleError, match="--field"):
            given_field(wrong)
    for beyond in ("15uT", "21.9uT", "67.1uT", "70uT", "0.7gauss"):
        with pytest.raises(TumbleError, match="22 to 67 µT"):
            given_field(beyond)
    for limit in ("22uT", "67uT", "0.22gauss", "670mgauss", "22000nT"):
        assert given_field(limit) is not None
    file = tmp_path / "six.csv"
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (3000, 6))
    made = np.column_stack([0.01 * np.arange(3000), noise + np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0])])
    np.savetxt(file, made, delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="", fmt="%.6f")
    with pytest.raises(TumbleError, match="no magnetometer"):
        tumble.calibrate(file, field="49uT")


def test_the_world_magnetic_model_gives_the_field_of_a_place_and_day() -> None:
    """Norm and dip are those that MATLAB's wrldmagm prints for 1000 m over Natick, by WMM2025 and WMM2020."""
    from tumble.workflows.magnetometer import given_field

    pytest.importorskip("pygeomag")
    natick = tumble.Site.from_latitude(math.radians(42.283), 1000.0)
    for day, norm, dip, sigma, dip_sigma in (
        ("2028-07-04", 50.940e-6, 65.9899, 138e-9, 0.20),
        ("2020-07-04", 51.733e-6, 66.8184, 148e-9, 0.21),
    ):
        found = given_field(f"wmm,-71.35,{day}", natick)
        assert found is not None
        assert found.norm == pytest.approx(norm, abs=1e-9)
        assert found.dip == pytest.approx(math.radians(dip), abs=2e-5)
        assert (found.norm_sigma, found.dip_sigma) == pytest.approx((sigma, math.radians(dip_sigma)))
    for wrong, said in (
        ("wmm", "longitude"),
        ("wmm,east,2026-05-03", "longitude"),
        ("wmm,11.6,yesterday", "longitude"),
        ("wmm,11.6,2012-05-03", "2015 to 2029"),
        ("wmm,500,2026-05-03", "-180 to 360"),
    ):
        with pytest.raises(TumbleError, match=said):
            given_field(wrong, natick)
    for nowhere in (None, tumble.Site.from_gravity(9.81)):
        with pytest.raises(TumbleError, match="needs the place"):
            given_field("wmm,11.6,2026-05-03", nowhere)


def test_without_the_models_library_one_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    from tumble.workflows.magnetometer import given_field

    monkeypatch.setitem(sys.modules, "pygeomag", None)
    with pytest.raises(TumbleError, match=r"pip install pygeomag"):
        given_field("wmm,11.6,2026-05-03", tumble.Site.from_latitude(0.8))


def test_a_field_for_a_magnetometer_that_lacks_a_column_names_the_column(tmp_path: Path) -> None:
    file = tmp_path / "eight.csv"
    rows = np.column_stack(
        [0.01 * np.arange(500), np.tile([0.1, 0.2, 9.8, 0.0, 0.0, 0.01, 20.0, -3.0], (500, 1))]
    )
    names = "t,ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s],mx [uT],my [uT]"
    np.savetxt(file, rows, delimiter=",", header=names, comments="", fmt="%.3f")
    with pytest.raises(TumbleError, match="and no mz; a triad needs all three") as caught:
        tumble.calibrate(file, field="49uT")
    assert "leave it out" not in str(caught.value)


def test_a_magnetometer_that_is_not_fit_has_no_matrix_in_the_file(tmp_path: Path) -> None:
    file = turned(tmp_path / "turned.csv")
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("[uT]", "[gauss]"), encoding="utf-8")
    document = calibrate(file, output=tmp_path / "out", field="49±0.1uT").calibration
    block = document.magnetometer
    assert block is not None
    assert block.verdict is not None
    assert block.verdict.use == "not fit"
    assert "of what the unit gauss says" in block.verdict.reasons[0]
    assert "--units" in block.verdict.reasons[0]
    assert (block.matrix, block.bias, block.covariance, block.test_vectors) == (None, None, [], [])
    assert len(block.parameters) == 9
    assert read_calibration(tmp_path / "out").correct_field(np.zeros((1, 3))) is None
