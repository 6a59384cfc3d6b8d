"""Files that tumble reads for its targets, Kalibr's and noise.json; targets that hold less than a matrix; topics."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from msgspec import structs
from tests.unit.export.a_unit import B_A, B_G, GRAVITY_UNIT, M_A, M_G, RAW_A, RAW_G, TARGETS, document

from tumble.document import RecordingName, read_calibration
from tumble.errors import CalibrationFileError, UsageError
from tumble.export.preparing import prepare
from tumble.export.subject import Wishes, read_noise
from tumble.sensor import ImuModel, Triad
from tumble.workflows import convert_from

# -- results of Kalibr itself: without biases --------------------------------------------------------

M = {"M": [[1.012, 0.0, 0.0], [-0.009, 0.991, 0.0], [0.003, -0.012, 1.021]]}
M_GYRO = [[0.985, 0.0, 0.0], [0.006, 1.017, 0.0], [-0.013, 0.005, 1.008]]
# 30° about x
TURN = [[1.0, 0.0, 0.0], [0.0, 0.8660254037844387, -0.5], [0.0, 0.5, 0.8660254037844387]]
A = [[1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]]


def imu(**update: Any) -> dict[str, Any]:
    gyro = {"M": M_GYRO, "A": A, "C_gyro_i": TURN} | update.pop("gyro", {})
    content = {
        "T_i_b": np.eye(4).tolist(),
        "accelerometers": M,
        "gyroscopes": gyro,
        "model": "scale-misalignment",
    }
    return content | update


def test_a_result_of_kalibr_itself_has_no_biases_and_says_so(tmp_path: Path) -> None:
    """Forward formula of Kalibr by hand: the raw numbers that it predicts are corrected to the true ones."""
    (tmp_path / "imu.yaml").write_text(yaml.safe_dump({"imu0": imu(model="scale-misalignment-size-effect")}))
    found = convert_from(tmp_path / "imu.yaml", "kalibr", output=tmp_path / "a.json")
    remarks = " ".join(found.remarks)
    for triad in ("accelerometers", "gyroscopes"):
        assert f"no bias of the {triad}: it is taken as zero" in remarks
    assert "lever arms of the accelerometers are left out" in remarks
    f, w = np.array([1.0, -2.0, 9.5]), np.array([0.3, -0.1, 0.7])
    C = np.array(TURN)
    raw = np.array(M["M"]) @ f, np.array(M_GYRO) @ C @ w + np.array(A) @ (C @ f)
    force, rate = read_calibration(tmp_path / "a.json").correct(raw[0][None], raw[1][None])
    assert np.allclose(force[0], f, rtol=0, atol=1e-12)
    assert np.allclose(rate[0], w, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ({"accelerometer_noise_density": 0.01}, "noise parameters and no calibration"),
        ({"cam0": {}}, "has no imu0: it is no result file of Kalibr"),
        ({"imu0": {"Tw": M_GYRO, "Ta": M["M"]}}, "has OpenVINS' keys"),
        ({"imu0": imu(model="calibrated")}, "'calibrated', which has no matrices"),
        ({"imu0": {"model": "scale-misalignment"}}, "has no imu0.accelerometers.M"),
        ({"imu0": 5}, "has no imu0.model"),
        ({"imu0": imu(accelerometers={"M": [[1, 2, 3], [2, 4, 6], [0, 0, 1]]})}, "cannot be inverted"),
        ({"imu0": imu(gyro={"C_gyro_i": M_GYRO})}, "C_gyro_i in .* is no rotation"),
        ({"imu0": imu(gyro={"A": [1, 2]})}, "gyroscopes.A"),
        (
            {"imu0": imu(accelerometers={**M, "bias": [1e200, 0, 0]})},
            r"1e\+200: it is no calibration's number",
        ),
        ({"imu0": imu(accelerometers={**M, "bias": "none"})}, "accelerometers.bias"),
        (["imu0"], "holds no keys"),
    ],
)
def test_what_is_no_calibration_of_kalibr_is_refused(tmp_path: Path, found: Any, words: str) -> None:
    (tmp_path / "imu.yaml").write_text(yaml.safe_dump(found))
    with pytest.raises(CalibrationFileError, match=words):
        convert_from(tmp_path / "imu.yaml", "kalibr", output=tmp_path / "a.json")
    assert not (tmp_path / "a.json").exists()


# -- noise.json --------------------------------------------------------------------------------------


def channel(white: float, walk: float | None, limit: float | None, unit: str = "m/s^2") -> dict[str, Any]:
    """One with a random walk K, or a limit for what is not seen of it."""
    seen, unseen = ({} if k is None else {"K": {"value": k}} for k in (walk, limit))
    return {"unit": unit, "terms": {"N": {"value": white}} | seen, "upper_limits_of_unseen": unseen}


CHANNELS = {
    "ax": channel(1e-3, 2e-5, None),
    "ay": channel(3e-3, 4e-5, None),
    "az": channel(2e-3, None, 9e-5),
    "gx": channel(1e-4, None, 2e-6, "rad/s"),
    "gy": channel(2e-4, None, 5e-6, "rad/s"),
    "gz": channel(1e-4, None, 3e-6, "rad/s"),
}


def noise_in(folder: Path, **update: Any) -> Path:
    whole = {"format": "tumble noise", "version": 1, "rate_hz": 100.0, "channels": CHANNELS} | update
    (folder / "noise.json").write_text(json.dumps(whole))
    return folder


def test_the_worst_axis_counts_and_a_limit_only_where_no_axis_shows_it(tmp_path: Path) -> None:
    noise = read_noise(noise_in(tmp_path))
    a, g = noise.accelerometer, noise.gyroscope
    assert (a.density, a.walk, a.walk_is_limit) == (3e-3, 4e-5, False)
    assert (g.density, g.walk, g.walk_is_limit) == (2e-4, 5e-6, True)
    assert any("upper limit" in remark for remark in noise.remarks)


def test_a_letter_whose_curve_misses_the_measured_one_is_not_passed_on_silently(tmp_path: Path) -> None:
    channels = json.loads(json.dumps(CHANNELS))
    for name, factor in (("ay", 4.2), ("ax", 1.2)):
        channels[name]["terms"]["K"]["curve_missed_by"] = factor
    (said,) = [r for r in read_noise(noise_in(tmp_path, channels=channels)).remarks if "misses" in r]
    assert said.startswith("K of ay is known no better than to a factor of 4.2")


@pytest.mark.parametrize(
    ("recorded", "rate", "shown"),
    [(200.0000000127157, None, 200.0), (199.98764, None, 199.988), (0.5, None, 0.5), (100.0, 200.0, 200.0)],
)
def test_the_rate_has_the_digits_that_a_clock_is_good_for(tmp_path, recorded, rate, shown) -> None:
    assert read_noise(noise_in(tmp_path, rate_hz=recorded), rate=rate).rate == shown


@pytest.mark.parametrize(
    ("update", "said"),
    [
        ({"format": "other"}, "no noise.json"),
        ({"channels": {"ax": channel(1e-3, 2e-5, None)}}, "1 channels"),
        ({"channels": {f"a{i}": channel(1.0, 1.0, None, "counts") for i in "xyz"}}, "counts"),
        ({"channels": {f"a{i}": channel(1.0, None, None) for i in "xyz"}}, "no random walk"),
        ({"channels": {f"a{i}": {"unit": "m/s^2"} for i in "xyz"}}, "damaged"),
        ({"channels": 3}, "damaged"),
    ],
)
def test_noise_that_cannot_be_used_is_refused_in_a_sentence(tmp_path, update, said) -> None:
    with pytest.raises(UsageError, match=said) as told:
        read_noise(noise_in(tmp_path, **update))
    assert "\n" not in str(told.value)


# -- targets of their own form -----------------------------------------------------------------------


def text_of(name: str, model: ImuModel, units: tuple[str, str] = ("m/s^2", "rad/s"), **wishes: float) -> str:
    target = TARGETS[name]
    return next(iter(target.write(prepare(document(model, units), target, Wishes(**wishes))).values()))


def test_dlio_s_matrix_is_by_rows_and_its_biases_come_after_it() -> None:
    """callbackImu: lin_accel_corrected = imu_accel_sm * lin_accel - bias; ang_vel - bias."""
    imu = yaml.safe_load(text_of("dlio", ImuModel(Triad(M_A, B_A), Triad(np.eye(3), B_G))))["dlio"]["imu"]
    assert imu["calibration"] is False
    accel, gyro = (imu["intrinsics"][name] for name in ("accel", "gyro"))
    force = RAW_A @ np.array(accel["sm"]).reshape(3, 3).T - accel["bias"]
    np.testing.assert_allclose(force, np.linalg.solve(M_A, (RAW_A - B_A).T).T, atol=1e-12)
    np.testing.assert_allclose(RAW_G - gyro["bias"], RAW_G - B_G, atol=1e-15)


def test_the_topic_is_the_recording_s_unless_another_is_asked_for() -> None:
    """Of recordings of two topics neither is."""

    def topic_of(*recorded: str | None, asked: str | None = None) -> str:
        names = [RecordingName(name="a.bag", sha256="0" * 64, topic=topic) for topic in recorded]
        made = structs.replace(document(), recordings=names)
        return prepare(made, TARGETS["python"], Wishes(topic=asked)).topic

    assert topic_of("/left/imu") == topic_of("/left/imu", "/left/imu") == "/left/imu"
    assert topic_of() == topic_of(None) == topic_of("/left/imu", "/right/imu") == "/imu0"
    assert topic_of("/left/imu", asked="/mine") == "/mine"


@pytest.mark.parametrize("units", [("m/s^2", "rad/s"), ("g", "deg/s")])
def test_a_triad_that_is_not_calibrated_is_one_unit_for_one(units: tuple[str, str]) -> None:
    """The numbers that come out are those of the raw units turned to SI, and nothing else."""
    factors = {"m/s^2": 1.0, "g": GRAVITY_UNIT, "rad/s": 1.0, "deg/s": np.pi / 180.0}
    for at, model, words in (
        (0, ImuModel(None, Triad(M_G, B_G)), "the accelerometers are not calibrated"),
        (1, ImuModel(Triad(M_A, B_A), None), "the gyros are not calibrated"),
    ):
        made = prepare(document(model, units), TARGETS["matlab"])
        triad = (made.model.accelerometer, made.model.gyroscope)[at]
        taken = factors[units[at]] if made.units[at] in ("m/s^2", "rad/s") else 1.0
        assert np.allclose(triad.correct(RAW_A * taken), RAW_A * factors[units[at]], rtol=1e-12)
        assert any(words in loss.text for loss in made.losses)


def registers(text: str, name: str) -> np.ndarray:
    return np.array([int(part) for part in re.findall(rf"{name}\[3\] = \{{(.*?)\}};", text)[0].split(",")])


def register_after(there: int, add: int) -> int:
    """By the application note: the sum, with bit 0 of what stood there."""
    return (there + add) // 2 * 2 + there % 2


@pytest.mark.parametrize(
    ("counts", "per_dps"), [(16384, 131.0), (8192, 65.5), (4096, 32.8), (2048, 16.4)], ids=str
)
def test_mpu6050_s_registers_take_the_bias_out_in_any_range(counts: int, per_dps: float) -> None:
    """The chip by the note: output = input + register - factory's, in the scale of ±8 g and ±1000 °/s."""
    bias_g, bias_dps = np.array([0.031, -0.052, 0.083]), np.array([1.7, -2.9, 0.6])
    force = Triad(counts / GRAVITY_UNIT * np.eye(3), counts * bias_g)
    model = ImuModel(force, Triad(per_dps * 180 / np.pi * np.eye(3), per_dps * bias_dps))
    text = text_of("mpu6050", model, (f"{counts} LSB/g", f"{per_dps} LSB/(deg/s)"))
    add, gyro = registers(text, "MPU6050_ACCEL_ADD"), registers(text, "MPU6050_GYRO_ADD")
    factory = np.array([-2735, 1184, 987])
    made = np.array([register_after(int(f), int(a)) for f, a in zip(factory, add, strict=True)])
    assert np.array_equal(made % 2, factory % 2)
    np.testing.assert_allclose(bias_g + (made - factory) / 4096.0, 0.0, atol=2.5 / 4096.0)
    np.testing.assert_allclose(bias_dps + gyro / 32.8, 0.0, atol=0.51 / 32.8)
    assert np.all(add * bias_g < 0.0)


def test_mpu6050_refuses_what_no_register_holds() -> None:
    text = text_of("mpu6050", ImuModel(Triad(M_A, B_A), Triad(M_G, B_G)), largest_loss=0.05)
    assert "loss: biases are rounded to the registers" in text
    with pytest.raises(UsageError, match="does not fit into the MPU-6050's registers"):
        text_of("mpu6050", ImuModel(Triad(np.eye(3), 1000 * B_A), Triad(np.eye(3), B_G)), largest_loss=0.05)
