"""Calibrations that change with temperature, applied and verified: spans, scales, blocks, nothing twice."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from msgspec import structs

from tumble.calibration import Estimate
from tumble.calibration.estimate import OverTemperature
from tumble.calibration.evidence import Holds
from tumble.calibration.outcome.description import canonical_names
from tumble.document import Calibration, calibration_from_estimate, read_calibration
from tumble.document.corrector import Corrector
from tumble.document.result import RecordingName
from tumble.earth import Site
from tumble.errors import CalibrationFileError, RecordingError, ThermalSpanError, TumbleError, UsageError
from tumble.protocol import named_protocol
from tumble.recording import Recording, read_recording
from tumble.recording.formats import arrays
from tumble.recording.formats.output import write_recording
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import SHAPES, TemperatureBasis, ThermalModel
from tumble.simulation.protocols import simulate_protocol
from tumble.workflows.apply import apply
from tumble.workflows.corrected import corrections_of
from tumble.workflows.verify import HoldConditions, norm_covariance, verify

SITE = Site(gravity=9.8, gravity_sigma=1e-5)
OPTIONS = {"columns": "t,ax,ay,az,gx,gy,gz,temperature", "units": "m/s^2,rad/s,s"}


def thermal_unit(seed: int = 1, size: float = 1.0) -> ThermalModel:
    rng = np.random.default_rng(seed)
    reference = ImuModel(
        Triad(np.eye(3) + 0.02 * rng.standard_normal((3, 3)), 0.1 * rng.standard_normal(3)),
        Triad(np.eye(3) + 0.02 * rng.standard_normal((3, 3)), 0.01 * rng.standard_normal(3)),
        1e-4 * rng.standard_normal((3, 3)),
    )
    basis = TemperatureBasis("spline", 25.0, np.array([-10.0, 5.0, 25.0, 40.0, 60.0]))
    coefficients = {
        "accelerometer.bias": 0.1 * size * rng.standard_normal((4, 3)),
        "accelerometer.matrix": 5e-3 * size * rng.standard_normal((4, 3, 3)),
        "gyroscope.bias": 0.01 * size * rng.standard_normal((4, 3)),
        "g_sensitivity": 1e-5 * size * rng.standard_normal((4, 3, 3)),
    }
    return ThermalModel(
        reference,
        basis,
        coefficients,
        rate_coefficients={"gyroscope.bias": 0.05 * rng.standard_normal(3)},
        hysteresis={"accelerometer.bias": 2e-3 * rng.standard_normal(3)},
        hysteresis_width=4.0,
        lag=25.0,
        span_celsius=(-10.0, 60.0),
        largest_rate=0.1,
    )


def document_of(model: ThermalModel | ImuModel, recording: Recording) -> Calibration:
    """The document of an estimate that knows the unit, each parameter to 1e-4."""
    reference = model.reference if isinstance(model, ThermalModel) else model
    names = canonical_names(frozenset({"g_sensitivity"}), "full")
    estimate = Estimate(
        procedure="thermal",
        model=reference,
        names=names,
        covariance=1e-8 * np.eye(len(names)),
        parameters=[],
        correlations=np.eye(1),
        sigma0=1.0,
        sigma0_final=1.0,
        degrees_of_freedom=100,
        coverage_factor=1.98,
        largest_normalised=2.0,
        evidence=[Holds(np.zeros(3), np.ones(3))],
    )
    if isinstance(model, ThermalModel):
        estimate.thermal = OverTemperature(model, 1e-8 * np.eye(len(model.names)))
    document = calibration_from_estimate(estimate, recording, SITE)
    return structs.replace(document, recordings=[RecordingName(name="another", sha256="0" * 64)])


def warm_recording(samples: int = 12000) -> tuple[Recording, Recording]:
    """A true and a raw recording of a unit that warms from -5 °C to 55 °C and cools again."""
    rng = np.random.default_rng(4)
    time = 0.1 * np.arange(samples)
    force = 3.0 * rng.standard_normal((samples, 3)) + [0.0, 0.0, 9.8]
    rate = rng.standard_normal((samples, 3))
    celsius = 25.0 - 30.0 * np.cos(time / 150.0)
    raw = thermal_unit().distort(time, force, rate, celsius)
    true = Recording(time, force, rate, "m/s^2", "rad/s", 10.0, celsius)
    return true, replace(true, specific_force=raw[0], angular_rate=raw[1])


TRUE, RAW = warm_recording()
DOCUMENT = document_of(thermal_unit(), RAW)


def with_temperature(recording: Recording, celsius: np.ndarray | None) -> Recording:
    return replace(recording, temperature=celsius)


def saved(recording: Recording, folder: Path, name: str = "raw.csv") -> Path:
    return write_recording(recording, folder / name)


def test_the_document_is_read_back_as_written(tmp_path: Path) -> None:
    DOCUMENT.write(tmp_path / "calibration.json")
    again = read_calibration(tmp_path)
    assert again == DOCUMENT
    assert again.identity == DOCUMENT.identity
    assert again.temperature_celsius == 25.0
    model = again.thermal_model
    assert model is not None
    np.testing.assert_array_equal(model.vector(), thermal_unit().vector())
    assert again.thermal is not None
    assert again.thermal.covariance_parameters == thermal_unit().names


def test_a_program_with_the_document_alone_gets_the_test_vectors() -> None:
    """Natural splines by scipy, the parameters by the formula in the file, numbers rounded to 1e-14."""
    from scipy.interpolate import CubicSpline

    text = json.loads(DOCUMENT.to_json())
    block, nodes = text["thermal"], np.array(text["thermal"]["basis"]["nodes_celsius"])
    reference = block["basis"]["reference_celsius"]
    kept = [k for k in range(nodes.size) if k != int(np.argmin(np.abs(nodes - reference)))]
    cardinal = CubicSpline(nodes, np.eye(nodes.size), bc_type="natural")

    def changed(base: list[object], name: str, f: np.ndarray) -> np.ndarray:
        terms = block["coefficients"][name]
        return np.array(base) + (0.0 if terms is None else np.tensordot(f, np.array(terms), axes=1))

    for vector in block["test_vectors"]:
        f = (cardinal(vector["temperature_celsius"]) - cardinal(reference))[kept]
        acc, gyro = text["accelerometer"], text["gyroscope"]
        bias = changed(acc["bias"], "accelerometer_bias", f)
        bias = bias + vector["hysteresis_state"] * np.array(block["hysteresis"]["accelerometer_bias"])
        matrix = changed(acc["matrix"], "accelerometer_matrix", f)
        force = np.linalg.inv(matrix) @ (np.array(vector["raw_specific_force"]) - bias)
        np.testing.assert_allclose(force, vector["specific_force"], atol=1e-13)
        bias = changed(gyro["bias"], "gyroscope_bias", f)
        bias = bias + vector["rate"] * np.array(block["rate_coefficients"]["gyroscope_bias"])
        bias = bias + changed(gyro["g_sensitivity"], "g_sensitivity", f) @ force
        rate = np.linalg.inv(np.array(gyro["matrix"])) @ (np.array(vector["raw_angular_rate"]) - bias)
        np.testing.assert_allclose(rate, vector["angular_rate"], atol=1e-13)
    temperatures = [v["temperature_celsius"] for v in block["test_vectors"]]
    assert min(temperatures) == -10.0
    assert max(temperatures) == 60.0
    states = block["path_test"]["hysteresis_state"]
    assert max(states) > 0.9
    assert min(np.diff(states)) < 0.0  # both branches


def test_apply_follows_the_temperature(tmp_path: Path) -> None:
    done = apply(DOCUMENT, saved(RAW, tmp_path), output=tmp_path / "out.parquet", **OPTIONS)
    assert done.samples == len(RAW)
    corrected = pl.read_parquet(tmp_path / "out.parquet")
    np.testing.assert_allclose(corrected[:, 1:4].to_numpy(), TRUE.specific_force, atol=1e-12)
    np.testing.assert_allclose(corrected[:, 4:7].to_numpy(), TRUE.angular_rate, atol=1e-12)


def test_apply_by_blocks_is_apply_of_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lag, rate and hysteresis go on where a block of 1700 samples ends; the first is longer than 10 s."""
    assert RAW.specific_force is not None
    assert RAW.angular_rate is not None
    assert RAW.temperature is not None
    table = np.column_stack([RAW.time, RAW.specific_force, RAW.angular_rate, RAW.temperature])
    np.save(tmp_path / "raw.npy", table)
    real = arrays.read_npy
    monkeypatch.setattr(arrays, "read_npy", lambda path: real(path, 1700))
    apply(DOCUMENT, tmp_path / "raw.npy", output=tmp_path / "out.parquet", **OPTIONS)
    corrected = pl.read_parquet(tmp_path / "out.parquet")
    np.testing.assert_allclose(corrected[:, 1:4].to_numpy(), TRUE.specific_force, atol=1e-12)
    np.testing.assert_allclose(corrected[:, 4:7].to_numpy(), TRUE.angular_rate, atol=1e-12)


def test_a_corrected_recording_is_not_corrected_again(tmp_path: Path) -> None:
    for name in ("once.csv", "once.parquet"):
        apply(DOCUMENT, saved(RAW, tmp_path), output=tmp_path / name, **OPTIONS)
        assert corrections_of([tmp_path / name]) == (DOCUMENT.identity,)
        with pytest.raises(UsageError, match="corrected by this calibration already"):
            apply(DOCUMENT, tmp_path / name, output=tmp_path / "twice.csv")
        with pytest.raises(UsageError, match="corrected by this calibration already"):
            verify(DOCUMENT, tmp_path / name)
        other = document_of(thermal_unit(9), RAW)
        with pytest.raises(UsageError, match="corrected by another calibration"):
            apply(other, tmp_path / name, output=tmp_path / "twice.csv")
    assert not (tmp_path / "twice.csv").exists()
    again = read_recording(tmp_path / "once.csv", units="m/s^2,rad/s,s")
    assert again.temperature is not None
    np.testing.assert_array_equal(again.temperature, RAW.temperature)


@pytest.mark.parametrize(
    ("celsius", "error", "words"),
    [
        (None, UsageError, "no temperature was given: name the column"),
        (lambda t: t + 273.15, RecordingError, r"is in kelvin, as it looks"),
        (lambda t: 1.8 * t + 60.0, RecordingError, "degrees Fahrenheit, as it looks"),
        (lambda t: 100.0 * t + 5000.0, RecordingError, "counts, or a fraction of a degree"),
        (lambda t: np.full_like(t, np.nan), UsageError, "holds no number"),
        (lambda t: t + 12.0, ThermalSpanError, r"outside the -10\.0 to 60\.0 °C that the calibration covers"),
    ],
)
def test_a_temperature_that_cannot_serve_is_one_sentence_and_no_file(
    tmp_path: Path, celsius: object, error: type[TumbleError], words: str
) -> None:
    given = None if celsius is None else celsius(RAW.temperature)  # type: ignore[operator]
    file = saved(with_temperature(RAW, given), tmp_path)
    with pytest.raises(error, match=words):
        apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"])
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(
    ("header", "option"), [("temperature [degF]", ""), ("temp_F", ""), ("temperature", ",degF")]
)
def test_degrees_fahrenheit_that_the_header_or_the_user_says_are_converted(
    tmp_path: Path, header: str, option: str
) -> None:
    assert RAW.temperature is not None
    file = saved(with_temperature(RAW, 1.8 * RAW.temperature + 32.0), tmp_path)
    text = file.read_text(encoding="utf-8").replace("temperature", header, 1)
    file.write_text(text, encoding="utf-8")
    apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"] + option)
    again = read_recording(tmp_path / "out.csv", **OPTIONS)
    assert again.temperature is not None
    # Seventeen digits in the file, and one multiplication.
    np.testing.assert_allclose(again.temperature, RAW.temperature, atol=1e-9)
    np.testing.assert_allclose(again.specific_force, TRUE.specific_force, atol=1e-6)


def test_counts_that_the_header_names_are_refused(tmp_path: Path) -> None:
    file = saved(RAW, tmp_path)
    text = file.read_text(encoding="utf-8").replace("temperature", "temperature [counts]", 1)
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match="is in counts"):
        apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"])


def holes(first: float, last: float) -> np.ndarray:
    """RAW's temperature without numbers from `first` to `last` seconds."""
    assert RAW.temperature is not None
    return np.where((first <= RAW.time) & (last > RAW.time), np.nan, RAW.temperature)


def test_missing_temperatures_are_counted_and_said(tmp_path: Path) -> None:
    file = saved(with_temperature(RAW, holes(300.0, 380.0)), tmp_path)
    applied = apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"])
    told = next(remark for remark in applied.remarks if "missing" in remark)
    assert "in 800 of 12000 samples, at the longest for 80.1 s from 299.9 s on" in told
    assert "straight line between its neighbours: what it did in between is not known" in told
    reasons = verify(DOCUMENT, file, units=OPTIONS["units"], intervals=_holds(tmp_path))[0].reasons
    assert any("in 800 of 12000 samples" in reason for reason in reasons)


@pytest.mark.parametrize(
    ("celsius", "words"),
    [
        (holes(300.0, 950.0), "nobody knows the sensor's temperature"),
        (holes(590.0, 1300.0), "nobody knows the sensor's temperature"),
        (np.zeros(len(RAW)), "0 °C in all 12000 samples: the thermometer was not read"),
    ],
)
def test_a_temperature_that_is_none_is_refused_and_no_file_is_left(
    tmp_path: Path, celsius: np.ndarray, words: str
) -> None:
    file = saved(with_temperature(RAW, celsius), tmp_path)
    with pytest.raises(RecordingError, match=words):
        apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"])
    assert not (tmp_path / "out.csv").exists()


def test_a_constant_temperature_is_said(tmp_path: Path) -> None:
    file = saved(with_temperature(RAW, np.full(len(RAW), 25.0)), tmp_path)
    applied = apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"])
    assert any("25 °C in all 12000 samples (20 min), as if" in remark for remark in applied.remarks)


def _holds(folder: Path) -> Path:
    file = folder / "holds.csv"
    file.write_text("0,100\n200,300\n400,500\n", encoding="utf-8")
    return file


def test_beyond_the_span_the_user_may_hold_or_extrapolate_and_is_told(tmp_path: Path) -> None:
    assert RAW.temperature is not None
    file = saved(with_temperature(RAW, RAW.temperature + 12.0), tmp_path)
    outcomes = []
    for outside, said in (("hold", "held at the span's ends"), ("extrapolate", "extrapolated")):
        done = apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"], outside=outside)
        assert any(said in remark and "unknown uncertainty" in remark for remark in done.remarks)
        outcomes.append(pl.read_csv(tmp_path / "out.csv")[:, 1].to_numpy())
    assert np.abs(outcomes[0] - outcomes[1]).max() > 1e-4
    with pytest.raises(UsageError, match="--outside guess"):
        apply(DOCUMENT, file, output=tmp_path / "out.csv", outside="guess")


def test_a_stated_temperature_serves_a_recording_without_one(tmp_path: Path) -> None:
    file = saved(with_temperature(RAW, None), tmp_path)
    apply(DOCUMENT, file, output=tmp_path / "out.csv", units=OPTIONS["units"], temperature=40.0)
    model = thermal_unit().at(40.0)
    force, rate = model.correct(RAW.specific_force, RAW.angular_rate)
    corrected = pl.read_csv(tmp_path / "out.csv")
    np.testing.assert_allclose(corrected[:, 1:4].to_numpy(), force, atol=1e-12)
    np.testing.assert_allclose(corrected[:, 4:7].to_numpy(), rate, atol=1e-12)


def test_a_calibration_of_one_temperature_used_at_another_is_told(tmp_path: Path) -> None:
    plain = document_of(thermal_unit().reference, with_temperature(RAW, np.full(len(RAW), 21.0)))
    done = apply(plain, saved(RAW, tmp_path), output=tmp_path / "out.csv", **OPTIONS)
    assert any("made at 21.0 °C and has no thermal model" in remark for remark in done.remarks)
    near = saved(with_temperature(RAW, np.full(len(RAW), 24.0)), tmp_path, "near.csv")
    done = apply(plain, near, output=tmp_path / "out.csv", **OPTIONS)
    assert not any("thermal" in remark for remark in done.remarks)
    with pytest.raises(UsageError, match="does not know its temperature: leave --temperature out"):
        apply(structs.replace(plain, temperature_celsius=None), near, temperature=20.0, **OPTIONS)


def test_apply_after_apply_takes_out_both_calibrations(tmp_path: Path) -> None:
    """The second's truth is distorted by the first: both taken out, whatever their lags and functions."""
    first = DOCUMENT
    second_model = replace(
        thermal_unit(7, size=0.2),
        basis=TemperatureBasis("polynomial", 20.0, order=2),
        coefficients={"accelerometer.bias": np.array([[1e-3, -2e-3, 5e-4], [1e-5, 2e-5, -3e-5]])},
        lag=5.0,
        span_celsius=(-8.0, 58.0),
    )
    second = structs.replace(document_of(second_model, RAW), input_corrected_by=[first.identity])
    assert TRUE.specific_force is not None
    assert TRUE.angular_rate is not None
    assert TRUE.temperature is not None
    truth = TRUE.specific_force, TRUE.angular_rate
    between = second_model.distort(TRUE.time, *truth, TRUE.temperature)
    raw = thermal_unit().distort(TRUE.time, *between, TRUE.temperature)
    file = saved(replace(RAW, specific_force=raw[0], angular_rate=raw[1]), tmp_path)
    apply(first, file, output=tmp_path / "one.parquet", **OPTIONS)
    apply(second, tmp_path / "one.parquet", output=tmp_path / "two.parquet", units="m/s^2,rad/s,s")
    assert corrections_of([tmp_path / "two.parquet"]) == (first.identity, second.identity)
    corrected = pl.read_parquet(tmp_path / "two.parquet")[:, 1:7].to_numpy()
    np.testing.assert_allclose(corrected, np.hstack(truth), atol=1e-12)
    with pytest.raises(UsageError, match="corrected by this calibration already"):
        apply(first, tmp_path / "one.parquet", output=tmp_path / "x.csv")
    with pytest.raises(UsageError, match="this recording is not: correct it"):
        apply(second, file, output=tmp_path / "x.csv", **OPTIONS)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"covariance": [[1.0]]}, "thermal.covariance"),
        ({"span_celsius": [60.0, -10.0]}, "thermal.span_celsius"),
        ({"lag": -1.0}, "thermal: "),
        (
            {"coefficients": {"accelerometer_matrix": [[[-9.0, 0, 0], [0, 1, 0], [0, 0, 1]]] * 4}},
            "inverted at",
        ),
        ({"basis": {"kind": "cubic"}}, "thermal.basis"),
    ],
)
def test_a_damaged_thermal_block_is_refused(tmp_path: Path, change: dict[str, object], words: str) -> None:
    text = json.loads(DOCUMENT.to_json())
    for key, value in change.items():
        text["thermal"][key] = {**text["thermal"][key], **value} if isinstance(value, dict) else value
    (tmp_path / "calibration.json").write_text(json.dumps(text), encoding="utf-8")
    with pytest.raises(CalibrationFileError, match=words):
        read_calibration(tmp_path)


def test_a_changing_temperature_takes_a_time() -> None:
    assert RAW.specific_force is not None
    with pytest.raises(UsageError, match="there is no time"):
        DOCUMENT.correct(RAW.specific_force, RAW.angular_rate, temperature_celsius=RAW.temperature)
    with pytest.raises(UsageError, match="no temperature was given"):
        DOCUMENT.correct(RAW.specific_force, RAW.angular_rate)
    assert np.isnan(Corrector(DOCUMENT).warmest)


def test_verify_follows_the_temperature(tmp_path: Path) -> None:
    """Six poses while it warms by 20 K: with the thermal model it serves, with the reference alone it does not."""
    recording, _ = simulate_protocol(
        named_protocol("six-position"),
        50.0,
        np.random.default_rng(3),
        site=SITE,
        model=ImuModel.ideal(),
        placement=False,
    )
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    rng = np.random.default_rng(6)
    celsius = 20.0 + 20.0 * recording.time / recording.time[-1]
    still = 1e-3 * rng.standard_normal(recording.specific_force.shape)
    raw = thermal_unit().distort(
        recording.time, recording.specific_force + still, recording.angular_rate, celsius
    )
    file = saved(
        replace(recording, specific_force=raw[0], angular_rate=raw[1], temperature=celsius), tmp_path
    )
    serves = verify(DOCUMENT, file, site=SITE, units="m/s^2,rad/s,s")[0]
    assert serves.fit, serves.reasons
    assert serves.rms_norm < 1e-3
    plain = document_of(thermal_unit().reference, with_temperature(RAW, np.full(len(RAW), 21.0)))
    off = verify(plain, file, site=SITE, units="m/s^2,rad/s,s")[0]
    assert not off.fit
    assert any("made at 21.0 °C and has no thermal model" in reason for reason in off.reasons)


def moved(model: ThermalModel, k: int, step: float) -> ThermalModel:
    groups = [
        {name: group[name].copy() for name in SHAPES if name in group}
        for group in (model.coefficients, model.rate_coefficients, model.hysteresis)
    ]
    for part in (part for group in groups for part in group.values()):
        if 0 <= k < part.size:
            part.flat[k] += step
        k -= part.size
    return replace(model, coefficients=groups[0], rate_coefficients=groups[1], hysteresis=groups[2])


def test_the_expected_norm_counts_every_thermal_parameter() -> None:
    """Against differences: each parameter is known to 1e-4 by itself, and moved by a hundredth of that."""
    model = thermal_unit()
    force = np.array([[3.0, -4.0, 8.0], [-9.0, 2.0, 1.0]])
    at = HoldConditions(np.array([-4.0, 47.0]), np.array([0.02, -0.03]), np.array([0.7, -0.4]))

    def norms(changed: ThermalModel, raw: list[np.ndarray]) -> np.ndarray:
        units = [changed.at(*row) for row in zip(at.temperature, at.rate, at.hysteresis, strict=True)]
        triads = [unit.accelerometer for unit in units]
        return np.array(
            [np.linalg.norm(t.correct(r)) for t, r in zip(triads, raw, strict=True) if t is not None]
        )

    triads = [
        model.at(*row).accelerometer for row in zip(at.temperature, at.rate, at.hysteresis, strict=True)
    ]
    raw = [t.distort(f[None, :]) for t, f in zip(triads, force, strict=True) if t is not None]
    variance = np.full(2, 1e-6)
    for k in range(len(model.names)):
        variance += (100.0 * (norms(moved(model, k, 1e-6), raw) - norms(model, raw))) ** 2
    known = structs.replace(DOCUMENT, covariance=np.zeros_like(DOCUMENT.covariance_matrix).tolist())
    sigmas = np.sqrt(np.diag(norm_covariance(known, force, np.full(2, 1e-6), SITE, at)))
    own = SITE.gravity_sigma  # the same gravity as the document's: it cancels
    assert own > 0.0
    np.testing.assert_allclose(sigmas, np.sqrt(variance), rtol=1e-5)
