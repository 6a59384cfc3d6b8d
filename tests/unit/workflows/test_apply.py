"""Corrected recordings: thermal models applied and verified, forms of files, spans, scales, blocks, nothing twice."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from msgspec import structs
from tests.contract.test_own_parameters import ARDUPILOT, dataflash
from tests.unit.export import a_unit
from tests.unit.export.a_unit import B_A, B_G, M_A, M_G
from tests.unit.given import given as known
from tests.unit.workflows.blocks import cut

from tumble.calibration import Estimate, Holds, OverTemperature, canonical_names
from tumble.document import Calibration, RecordingName, calibration_from_estimate, read_calibration
from tumble.earth import Site
from tumble.errors import CalibrationFileError, RecordingError, ThermalSpanError, UsageError
from tumble.protocol import named_protocol
from tumble.recording import Recording, read_recording, write_recording
from tumble.sensor import SHAPES, ImuModel, TemperatureBasis, ThermalModel, Triad
from tumble.simulation import simulate_protocol
from tumble.workflows.apply import apply
from tumble.workflows.corrected import ForceShift, corrections_of
from tumble.workflows.verify import HoldConditions, norm_covariance, verify

# --- calibrations that change with temperature

SITE = Site(gravity=9.8, gravity_sigma=1e-5)
SI = "m/s^2,rad/s,s"
OPTIONS: dict[str, Any] = {"columns": "t,ax,ay,az,gx,gy,gz,temperature", "units": SI}


def thermal_unit(seed: int = 1, size: float = 1.0) -> ThermalModel:
    rng = np.random.default_rng(seed)
    reference = ImuModel(
        Triad(np.eye(3) + 0.02 * rng.standard_normal((3, 3)), 0.1 * rng.standard_normal(3)),
        Triad(np.eye(3) + 0.02 * rng.standard_normal((3, 3)), 0.01 * rng.standard_normal(3)),
        1e-4 * rng.standard_normal((3, 3)),
    )
    return ThermalModel(
        reference,
        TemperatureBasis("spline", 25.0, np.array([-10.0, 5.0, 25.0, 40.0, 60.0])),
        {
            "accelerometer.bias": 0.1 * size * rng.standard_normal((4, 3)),
            "accelerometer.matrix": 5e-3 * size * rng.standard_normal((4, 3, 3)),
            "gyroscope.bias": 0.01 * size * rng.standard_normal((4, 3)),
            "g_sensitivity": 1e-5 * size * rng.standard_normal((4, 3, 3)),
        },
        rate_coefficients={"gyroscope.bias": 0.05 * rng.standard_normal(3)},
        hysteresis={"accelerometer.bias": 2e-3 * rng.standard_normal(3)},
        hysteresis_width=4.0,
        lag=25.0,
        span_celsius=(-10.0, 60.0),
        largest_rate=0.1,
    )


def document_of(model: ThermalModel | ImuModel, recording: Recording) -> Calibration:
    """The document of an estimate that knows the unit, each parameter to 1e-4."""
    names = canonical_names(frozenset({"g_sensitivity"}), "full")
    estimate = Estimate(
        procedure="thermal",
        model=model.reference if isinstance(model, ThermalModel) else model,
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
    time: Any = 0.1 * np.arange(samples)
    force = 3.0 * rng.standard_normal((samples, 3)) + [0.0, 0.0, 9.8]
    rate = rng.standard_normal((samples, 3))
    celsius = 25.0 - 30.0 * np.cos(time / 150.0)
    raw = thermal_unit().distort(time, force, rate, celsius)
    true = Recording(time, force, rate, "m/s^2", "rad/s", 10.0, celsius)
    return true, replace(true, specific_force=raw[0], angular_rate=raw[1])


TRUE, RAW = warm_recording()
TRUTH = np.column_stack([known(TRUE.specific_force), known(TRUE.angular_rate)])
CELSIUS = known(RAW.temperature)
DOCUMENT = document_of(thermal_unit(), RAW)
PLAIN = document_of(thermal_unit().reference, replace(RAW, temperature=np.full(len(RAW), 21.0)))


def saved(folder: Path, celsius: np.ndarray | None = CELSIUS, header: str = "temperature") -> Path:
    """Write the raw recording with this temperature, in a column of this name."""
    file = write_recording(replace(RAW, temperature=celsius), folder / "raw.csv")
    file.write_text(file.read_text(encoding="utf-8").replace("temperature", header, 1), encoding="utf-8")
    return file


def corrected(file: Path) -> np.ndarray:
    return (pl.read_csv if file.suffix == ".csv" else pl.read_parquet)(file)[:, 1:7].to_numpy()


def test_the_document_is_read_back_as_written_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    DOCUMENT.write(tmp_path / "calibration.json")
    again = read_calibration(tmp_path)
    assert again == DOCUMENT
    assert again.identity == DOCUMENT.identity
    assert again.temperature_celsius == 25.0
    np.testing.assert_array_equal(known(again.thermal_model).vector(), thermal_unit().vector())
    assert known(again.thermal).covariance_parameters == thermal_unit().names
    steep = {"accelerometer_matrix": [[[-9.0, 0, 0], [0, 1, 0], [0, 0, 1]]] * 4}
    for key, value, words in (
        ("covariance", [[1.0]], "thermal.covariance"),
        ("span_celsius", [60.0, -10.0], "thermal.span_celsius"),
        ("lag", -1.0, "thermal: "),
        ("coefficients", steep, "inverted at"),
        ("basis", {"kind": "cubic"}, "thermal.basis"),
    ):
        text = json.loads(DOCUMENT.to_json())
        text["thermal"][key] = {**text["thermal"][key], **value} if isinstance(value, dict) else value
        (tmp_path / "calibration.json").write_text(json.dumps(text), encoding="utf-8")
        with pytest.raises(CalibrationFileError, match=words):
            read_calibration(tmp_path)


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
    assert (min(temperatures), max(temperatures)) == (-10.0, 60.0)
    states = block["path_test"]["hysteresis_state"]
    assert max(states) > 0.9
    assert min(np.diff(states)) < 0.0  # both branches


def test_apply_follows_the_temperature_in_blocks_as_in_one(tmp_path, monkeypatch):
    """Lag, rate and hysteresis go on where a block of 1700 samples ends; the first is longer than 10 s."""
    done = apply(DOCUMENT, saved(tmp_path), output=tmp_path / "out.parquet", **OPTIONS)
    assert done.samples == len(RAW)
    np.testing.assert_allclose(corrected(tmp_path / "out.parquet"), TRUTH, atol=1e-12)
    cut(monkeypatch, "apply", 1700)
    apply(DOCUMENT, tmp_path / "raw.csv", output=tmp_path / "blocks.parquet", **OPTIONS)
    np.testing.assert_allclose(corrected(tmp_path / "blocks.parquet"), TRUTH, atol=1e-12)


def test_a_corrected_recording_is_not_corrected_again(tmp_path: Path) -> None:
    other = document_of(thermal_unit(9), RAW)
    for once in (tmp_path / "once.csv", tmp_path / "once.parquet"):
        apply(DOCUMENT, saved(tmp_path), output=once, **OPTIONS)
        assert corrections_of([once]) == (DOCUMENT.identity,)
        with pytest.raises(UsageError, match="corrected by this calibration already"):
            apply(DOCUMENT, once, output=tmp_path / "twice.csv")
        with pytest.raises(UsageError, match="corrected by this calibration already"):
            verify(DOCUMENT, once)
        with pytest.raises(UsageError, match="corrected by another calibration"):
            apply(other, once, output=tmp_path / "twice.csv")
    assert not (tmp_path / "twice.csv").exists()
    assert corrections_of([pl.read_csv(tmp_path / "once.csv")]) == (DOCUMENT.identity,)
    assert corrections_of([dataflash(tmp_path / "a.bin", ARDUPILOT)]) == ()  # it is raw
    again = read_recording(tmp_path / "once.csv", units=SI)
    np.testing.assert_array_equal(known(again.temperature), CELSIUS)


def holes(first: float, last: float) -> np.ndarray:
    """The temperature without numbers from `first` to `last` seconds."""
    return np.where((first <= RAW.time) & (last > RAW.time), np.nan, CELSIUS)


@pytest.mark.parametrize(
    ("celsius", "header", "error", "words"),
    [
        (None, "", UsageError, "no temperature was given: name the column"),
        (CELSIUS + 273.15, "temperature", RecordingError, r"is in kelvin, as it looks"),
        (1.8 * CELSIUS + 60.0, "temperature", RecordingError, "degrees Fahrenheit, as it looks"),
        (100.0 * CELSIUS + 5000.0, "temperature", RecordingError, "counts, or a fraction of a degree"),
        (CELSIUS, "temperature [counts]", RecordingError, "is in counts"),
        (holes(0.0, np.inf), "temperature", UsageError, "holds no number"),
        (holes(300.0, 950.0), "temperature", RecordingError, "nobody knows the sensor's temperature"),
        (holes(590.0, 1300.0), "temperature", RecordingError, "nobody knows the sensor's temperature"),
        (0.0 * CELSIUS, "temperature", RecordingError, "0 °C in all 12000 samples: the thermometer was not"),
        (
            CELSIUS + 12.0,
            "temperature",
            ThermalSpanError,
            r"outside the -10\.0 to 60\.0 °C that the calibration",
        ),
    ],
)
def test_a_temperature_that_cannot_serve_is_one_sentence_and_no_file(tmp_path, celsius, header, error, words):
    file = saved(tmp_path, celsius, header)
    with pytest.raises(error, match=words):
        apply(DOCUMENT, file, output=tmp_path / "out.csv", units=SI)
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(
    ("header", "option"), [("temperature [degF]", ""), ("temp_F", ""), ("temperature", ",degF")]
)
def test_degrees_fahrenheit_that_the_header_or_the_user_says_are_converted(tmp_path, header, option):
    file = saved(tmp_path, 1.8 * CELSIUS + 32.0, header)
    apply(DOCUMENT, file, output=tmp_path / "out.csv", units=SI + option)
    again = read_recording(tmp_path / "out.csv", **OPTIONS)
    # Seventeen digits in the file, and one multiplication.
    np.testing.assert_allclose(known(again.temperature), CELSIUS, atol=1e-9)
    np.testing.assert_allclose(known(again.specific_force), TRUTH[:, :3], atol=1e-6)


def test_temperatures_that_are_missing_or_constant_are_said(tmp_path: Path) -> None:
    (holds := tmp_path / "holds.csv").write_text("0,100\n200,300\n400,500\n", encoding="utf-8")
    file = saved(tmp_path, holes(300.0, 380.0))
    remarks = apply(DOCUMENT, file, output=tmp_path / "out.csv", units=SI).remarks
    said = next(remark for remark in remarks if "missing" in remark)
    assert "in 800 of 12000 samples, at the longest for 80.1 s from 299.9 s on" in said
    assert "straight line between its neighbours: what it did in between is not known" in said
    reasons = verify(DOCUMENT, file, units=SI, intervals=holds)[0].reasons
    assert any("in 800 of 12000 samples" in reason for reason in reasons)
    file = saved(tmp_path, np.full(len(RAW), 25.0))
    remarks = apply(DOCUMENT, file, output=tmp_path / "out.csv", units=SI).remarks
    assert any("25 °C in all 12000 samples (20 min), as if" in remark for remark in remarks)


def test_beyond_the_span_the_user_may_hold_or_extrapolate_and_is_told(tmp_path: Path) -> None:
    file = saved(tmp_path, CELSIUS + 12.0)
    outcomes: list[np.ndarray] = []
    for outside, said in (("hold", "held at the span's ends"), ("extrapolate", "extrapolated")):
        done = apply(DOCUMENT, file, output=tmp_path / "out.csv", units=SI, outside=outside)
        assert any(said in remark and "unknown uncertainty" in remark for remark in done.remarks)
        outcomes.append(corrected(tmp_path / "out.csv")[:, 0])
    assert np.abs(outcomes[0] - outcomes[1]).max() > 1e-4
    with pytest.raises(UsageError, match="--outside guess"):
        apply(DOCUMENT, file, output=tmp_path / "out.csv", outside="guess")


def test_a_stated_temperature_serves_a_recording_without_one(tmp_path: Path) -> None:
    apply(DOCUMENT, saved(tmp_path, None), output=tmp_path / "out.csv", units=SI, temperature=40.0)
    expected = thermal_unit().at(40.0).correct(known(RAW.specific_force), known(RAW.angular_rate))
    both = np.hstack([known(part) for part in expected])
    np.testing.assert_allclose(corrected(tmp_path / "out.csv"), both, atol=1e-12)
    force, rate = known(RAW.specific_force), RAW.angular_rate
    with pytest.raises(UsageError, match="there is no time"):
        DOCUMENT.correct(force, rate, temperature_celsius=CELSIUS)
    with pytest.raises(UsageError, match="no temperature was given"):
        DOCUMENT.correct(force, rate)
    assert np.isnan(DOCUMENT.corrector().warmest)


def test_a_calibration_of_one_temperature_used_at_another_is_told(tmp_path: Path) -> None:
    done = apply(PLAIN, saved(tmp_path), output=tmp_path / "out.csv", **OPTIONS)
    assert any("made at 21.0 °C and has no thermal model" in remark for remark in done.remarks)
    near = saved(tmp_path, np.full(len(RAW), 24.0))
    done = apply(PLAIN, near, output=tmp_path / "out.csv", **OPTIONS)
    assert not any("thermal" in remark for remark in done.remarks)
    with pytest.raises(UsageError, match="does not know its temperature: leave --temperature out"):
        apply(structs.replace(PLAIN, temperature_celsius=None), near, temperature=20.0, **OPTIONS)


def test_apply_after_apply_takes_out_both_calibrations(tmp_path: Path) -> None:
    """The second's truth is distorted by the first: both taken out, whatever their lags and functions."""
    second_model = replace(
        thermal_unit(7, size=0.2),
        basis=TemperatureBasis("polynomial", 20.0, order=2),
        coefficients={"accelerometer.bias": np.array([[1e-3, -2e-3, 5e-4], [1e-5, 2e-5, -3e-5]])},
        lag=5.0,
        span_celsius=(-8.0, 58.0),
    )
    second = structs.replace(document_of(second_model, RAW), input_corrected_by=[DOCUMENT.identity])
    between = second_model.distort(TRUE.time, TRUTH[:, :3], TRUTH[:, 3:], CELSIUS)
    raw = thermal_unit().distort(TRUE.time, *between, CELSIUS)
    both = replace(RAW, specific_force=raw[0], angular_rate=raw[1])
    file, one, two = (
        write_recording(both, tmp_path / "raw.csv"),
        tmp_path / "1.parquet",
        tmp_path / "2.parquet",
    )
    apply(DOCUMENT, file, output=one, **OPTIONS)
    apply(second, one, output=two, units=SI)
    assert corrections_of([two]) == (DOCUMENT.identity, second.identity)
    np.testing.assert_allclose(corrected(two), TRUTH, atol=1e-12)
    with pytest.raises(UsageError, match="corrected by this calibration already"):
        apply(DOCUMENT, one, output=tmp_path / "x.csv")
    with pytest.raises(UsageError, match="this recording is not: correct it"):
        apply(second, file, output=tmp_path / "x.csv", **OPTIONS)


def test_verify_follows_the_temperature(tmp_path: Path) -> None:
    """Six poses while it warms by 20 K: with the thermal model it serves, with the reference alone it does not."""
    rng, ideal = np.random.default_rng(3), ImuModel.ideal()
    six = named_protocol("six-position")
    recording, _ = simulate_protocol(six, 50.0, rng, site=SITE, model=ideal, placement=False)
    force, rate = known(recording.specific_force), known(recording.angular_rate)
    celsius = 20.0 + 20.0 * recording.time / recording.time[-1]
    shaken = force + 1e-3 * np.random.default_rng(6).standard_normal(force.shape)
    raw = thermal_unit().distort(recording.time, shaken, rate, celsius)
    made = replace(recording, specific_force=raw[0], angular_rate=raw[1], temperature=celsius)
    file = write_recording(made, tmp_path / "six.csv")
    serves = verify(DOCUMENT, file, site=SITE, units=SI)[0]
    assert serves.fit, serves.reasons
    assert serves.rms_norm < 1e-3
    off = verify(PLAIN, file, site=SITE, units=SI)[0]
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

    def triads(unit: ThermalModel) -> list[Triad]:
        rows = zip(at.temperature, at.rate, at.hysteresis, strict=True)
        return [known(unit.at(*row).accelerometer) for row in rows]

    raw = [t.distort(f[None, :]) for t, f in zip(triads(model), force, strict=True)]

    def norms(unit: ThermalModel) -> np.ndarray:
        return np.array([np.linalg.norm(t.correct(r)) for t, r in zip(triads(unit), raw, strict=True)])

    variance = np.full(2, 1e-6)
    for k in range(len(model.names)):
        variance += (100.0 * (norms(moved(model, k, 1e-6)) - norms(model))) ** 2
    exact = structs.replace(DOCUMENT, covariance=np.zeros_like(DOCUMENT.covariance_matrix).tolist())
    sigmas = np.sqrt(np.diag(norm_covariance(exact, force, np.full(2, 1e-6), SITE, at)))
    assert SITE.gravity_sigma > 0.0  # the same gravity as the document's: it cancels
    np.testing.assert_allclose(sigmas, np.sqrt(variance), rtol=1e-5)


# --- EuRoC's folder: what the others read, and what is read back

UNIT = a_unit.document(ImuModel(Triad(M_A, B_A), Triad(M_G, B_G)))
RNG = np.random.default_rng(3)
FORCE = np.array([0.3, -0.5, 9.7]) + 0.02 * RNG.normal(size=(400, 3))
RATE = 0.01 * RNG.normal(size=(400, 3))
TRUE_FORCE, TRUE_RATE = np.linalg.solve(M_A, (FORCE - B_A).T).T, np.linalg.solve(M_G, (RATE - B_G).T).T
# No multiples of 256 ns, which is what a float64 of seconds since 1970 resolves.
STAMPS = 1_403_636_579_758_555_393 + 5_000_001 * np.arange(400)
SENSOR = """#Default imu sensor yaml file
sensor_type: imu
T_BS:
  cols: 4
  rows: 4
  data: [0.0, 1.0, 0.0, 0.0,
         1.0, 0.0, 0.0, 0.0,
         0.0, 0.0, -1.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 200
gyroscope_noise_density: 1.6968e-04     # [ rad / s / sqrt(Hz) ]
"""
IMU = "mav0/imu0/data.csv"


def euroc(folder: Path) -> Path:
    for name in ("imu0", "cam0"):
        (folder / "mav0" / name).mkdir(parents=True)
    names = (("w_RS_S", "[rad s^-1]"), ("a_RS_S", "[m s^-2]"))
    head = ["#timestamp [ns]", *(f"{name}_{axis} {unit}" for name, unit in names for axis in "xyz")]
    rows = zip(STAMPS.tolist(), RATE.tolist(), FORCE.tolist(), strict=True)
    lines = [",".join(head), *(",".join(map(str, [t, *w, *f])) for t, w, f in rows)]
    (folder / IMU).write_text("\n".join(lines) + "\n")
    (folder / "mav0/imu0/sensor.yaml").write_text(SENSOR)
    (folder / "mav0/cam0/data.csv").write_text("#timestamp [ns],filename\n1,1.png\n")
    return folder


def test_euroc_s_folder_keeps_stamps_to_the_nanosecond_and_the_sensor_s_pose(tmp_path: Path) -> None:
    source, out = euroc(tmp_path / "MH_01"), tmp_path / "out"
    assert apply(UNIT, source, output=out).samples == 400
    lines = (out / IMU).read_text().splitlines()
    assert lines[0] == (source / IMU).read_text().splitlines()[0]
    cells = [line.split(",") for line in lines[1:]]
    assert [int(c[0]) for c in cells] == STAMPS.tolist()
    numbers = np.array([[float(x) for x in c[1:]] for c in cells])
    np.testing.assert_allclose(numbers, np.hstack([TRUE_RATE, TRUE_FORCE]), atol=1e-13)
    said = (out / "mav0/imu0/sensor.yaml").read_text()
    assert said == SENSOR + f"corrected_by: [{UNIT.identity}]\n"
    with pytest.raises(UsageError, match="corrected by this calibration already"):
        apply(UNIT, out, output=tmp_path / "twice")
    for one in (source, source / IMU):
        with pytest.raises(UsageError, match="the recording itself"):
            apply(UNIT, one, output=source)
    # Other sensors stay where the folder has them.
    apply(UNIT, source, output=euroc(tmp_path / "b"))
    assert (tmp_path / "b/mav0/cam0/data.csv").read_text() == (source / "mav0/cam0/data.csv").read_text()
    assert read_recording(tmp_path / "b").specific_force == pytest.approx(TRUE_FORCE)


def test_a_csv_becomes_a_folder_like_euroc_s(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"{kind}{axis}" for kind in "ag" for axis in "xyz"]
    frame = pl.DataFrame(np.column_stack([12.5 + 0.005 * np.arange(400), FORCE, RATE]), schema=["t", *names])
    (tmp_path / "raw.csv").write_text(frame.write_csv() + "14.5,1")
    cut(monkeypatch, "apply", 150)
    done = apply(UNIT, tmp_path / "raw.csv", output=tmp_path / "folder")
    assert any("the last line is cut short" in remark for remark in done.remarks)
    again = read_recording(tmp_path / "folder")
    np.testing.assert_allclose(again.time, frame["t"], atol=1e-9)
    assert again.angular_rate == pytest.approx(TRUE_RATE)
    assert "rate_hz: 200" in (tmp_path / "folder/mav0/imu0/sensor.yaml").read_text()
    frame[:, :4].write_csv(tmp_path / "half.csv")
    with pytest.raises(UsageError, match="has both triads in each row"):
        apply(UNIT, tmp_path / "half.csv", output=tmp_path / "other")
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("lag", [0.013, -0.027])
def test_blocks_of_any_size_are_shifted_alike(lag: float) -> None:
    time = np.cumsum(0.005 + 0.001 * RNG.random(300))
    time[150:] += 0.2  # a gap, over which nothing is interpolated
    force = FORCE[:300]

    def shifted(size: int) -> tuple[np.ndarray, int]:
        shift = ForceShift(lag)
        made = [shift.add(time[k : k + size], force[k : k + size]) for k in range(0, 300, size)]
        return np.concatenate([*made, shift.rest()]), shift.kept

    whole, kept = shifted(300)
    inside = np.column_stack([np.interp(time + lag, time, force[:, i]) for i in range(3)])
    far = (time + lag > time[149]) & (time + lag < time[150])
    outside = (time + lag < time[0]) | (time + lag > time[-1])
    assert kept == np.count_nonzero(far | outside)
    np.testing.assert_allclose(whole[~far], inside[~far], atol=1e-12)
    for size in (7, 60, 299):
        np.testing.assert_allclose(shifted(size)[0], whole, atol=1e-12)
