"""What every target has to do.

Its own formula, read from its source's documentation and written here by hand, gives the calibration's corrected
numbers from the file; what it reads back corrects alike; what is damaged is refused in a sentence.
"""

import json
import re
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from msgspec import structs
from tests.unit.export.a_unit import (
    B_A,
    B_G,
    GRAVITY_UNIT,
    M_A,
    M_G,
    RAW_A,
    RAW_G,
    TARGETS,
    WHOLE,
    G,
    ardupilot,
    compass,
    document,
    parameters,
    px4,
    thermal_document,
)

from tumble.document import Calibration, read_calibration
from tumble.errors import CalibrationFileError, UsageError
from tumble.export import (
    SensorNoise,
    Subject,
    Target,
    TriadNoise,
    Wishes,
    prepare,
)
from tumble.parameters import amount, si_of
from tumble.sensor import ImuModel, TemperatureBasis, ThermalModel, Triad
from tumble.workflows import convert_from, convert_to

RATE = 200.0
NOISE_NUMBERS = SensorNoise(
    TriadNoise(2e-3, 3e-5, np.array([1.8e-3, 1.9e-3, 2e-3])),
    TriadNoise(1.7e-4, 2e-6, np.array([1.7e-4, 1.5e-4, 1.6e-4])),
    RATE,
    "noise.json",
)


def model_for(target: Target) -> ImuModel:
    """All that the target can hold, so that nothing is lost: a diagonal matrix for those without off-diagonals."""
    if "full matrix" in target.holds and target.name != "dlio":
        return ImuModel(Triad(M_A, B_A), Triad(M_G, B_G), G if "g-sensitivity" in target.holds else None)
    gyro = np.diag(np.diag(M_G)) if target.name == "kf-gins" else np.eye(3)
    return ImuModel(Triad(np.diag(np.diag(M_A)), B_A), Triad(gyro, B_G))


def truth(model: ImuModel, target: Target) -> tuple[np.ndarray, np.ndarray]:
    """Corrected by hand with the inverse formula, then turned to the frame that the target's zeros ask for (QR)."""
    force = np.linalg.solve(model.accelerometer.matrix, (RAW_A - B_A).T).T
    sensitivity = np.zeros((3, 3)) if model.g_sensitivity is None else model.g_sensitivity
    rate = np.linalg.solve(model.gyroscope.matrix, (RAW_G - B_G - force @ sensitivity.T).T).T
    C = frame_of(model.accelerometer.matrix, target.frame)
    return force @ C.T, rate @ C.T


def frame_of(matrix: np.ndarray, frame: str | None) -> np.ndarray:
    """C with ``matrix @ C.T`` triangular of positive diagonal, by numpy's QR."""
    if frame is None:
        return np.eye(3)
    if frame == "accelerometer-x":  # matrix.T = Q R, matrix = R^T Q^T, R^T is lower triangular
        q, r = np.linalg.qr(matrix.T)
        return np.diag(np.sign(np.diag(r))) @ q.T
    assert frame == "accelerometer-z"
    flip = np.eye(3)[::-1]
    return flip @ frame_of(flip @ matrix @ flip, "accelerometer-x") @ flip


# The targets' own formulas, each from its tool's source or manual. They take the files' texts and raw m/s², rad/s.

Texts = dict[str, str]
Evaluated = tuple[np.ndarray, np.ndarray]


def keys(texts: Texts) -> Any:
    return yaml.safe_load(re.sub(r"^%YAML.*\n", "", next(iter(texts.values()))))


def by_kalibr(texts: Texts) -> Evaluated:
    """a_m = M_a f + b; w_m = M_g (C w) + A (C f) + b, solved for f and w one after another."""
    imu = keys(texts)["imu0"]
    acc, gyr = imu["accelerometers"], imu["gyroscopes"]
    Ma, Mg, A, C = (np.array(x) for x in (acc["M"], gyr["M"], gyr["A"], gyr["C_gyro_i"]))
    assert np.array_equal(Ma, np.tril(Ma))
    assert np.allclose(Mg, np.tril(Mg), atol=0)
    f = np.array([np.linalg.solve(Ma, a - acc["bias"]) for a in RAW_A])
    w = np.array(
        [
            np.linalg.solve(Mg @ C, g - np.array(gyr["bias"]) - A @ (C @ x))
            for g, x in zip(RAW_G, f, strict=True)
        ]
    )
    return f, w


def by_openvins(texts: Texts) -> Evaluated:
    imu = keys(texts)["imu0"]
    assert imu["model"] == "kalibr"
    Tw, Ta, Tg, Rg, Ra = (np.array(imu[k]) for k in ("Tw", "Ta", "Tg", "R_IMUtoGYRO", "R_IMUtoACC"))
    assert np.allclose(Rg @ Rg.T, np.eye(3), atol=1e-12)
    f = np.array([Ra.T @ np.linalg.inv(Ta) @ (a - imu["bias_acc"]) for a in RAW_A])
    pairs = zip(RAW_G, f, strict=True)
    return f, np.array(
        [Rg.T @ np.linalg.inv(Tw) @ (g - np.array(imu["bias_gyro"]) - Tg @ x) for g, x in pairs]
    )


def by_imu_tk(texts: Texts) -> Evaluated:
    out: list[np.ndarray] = []
    for name, raw in (("accelerometer.calib", RAW_A), ("gyroscope.calib", RAW_G)):
        n = np.array(texts[name].split(), dtype=float)
        T, K, B = n[:9].reshape(3, 3), n[9:18].reshape(3, 3), n[18:]
        assert np.array_equal(np.diag(T), np.ones(3))
        if name.startswith("acc"):
            assert T[1, 0] == T[2, 0] == T[2, 1] == 0.0
        out.append(np.array([T @ K @ (r - B) for r in raw]))
    return out[0], out[1]


def by_openicc(texts: Texts) -> Evaluated:
    d = json.loads(texts["static_calib_result.json"])
    out: list[np.ndarray] = []
    for name, raw in (("accelerometer", RAW_A), ("gyroscope", RAW_G)):
        T, K, B = (np.array(d[name][k]) for k in ("misalignment_matrix", "scale_matrix", "bias"))
        out.append(np.array([T @ (K @ (r - B)) for r in raw]))
    return out[0], out[1]


def by_px4(texts: Texts) -> Evaluated:
    p = parameters(texts["px4.params"])
    return px4("ACC", RAW_A, p), px4("GYRO", RAW_G, p)


def by_ardupilot(texts: Texts) -> Evaluated:
    p = parameters(texts["ardupilot.parm"])
    return ardupilot("ACC", RAW_A, p), ardupilot("GYR", RAW_G, p)


def by_basalt(texts: Texts) -> Evaluated:
    """(I + S) raw - bias; accelerometer S is [p3 0 0; p4 p6 0; p5 p7 p8], gyro S by columns from p3."""
    v = json.loads(texts["basalt_imu.json"])["value0"]
    a, g = v["calib_accel_bias"], v["calib_gyro_bias"]
    Sa = np.array([[a[3], 0, 0], [a[4], a[6], 0], [a[5], a[7], a[8]]])
    Sg = np.array([[g[3], g[6], g[9]], [g[4], g[7], g[10]], [g[5], g[8], g[11]]])
    force = np.array([r + Sa @ r - a[:3] for r in RAW_A])
    return force, np.array([r + Sg @ r - g[:3] for r in RAW_G])


def by_kf_gins(texts: Texts) -> Evaluated:
    d = keys(texts)
    gyr = np.array(d["initgyrbias"]) * np.pi / 180 / 3600
    acc = np.array(d["initaccbias"]) * 1e-5
    force = (RAW_A - acc) / (1 + 1e-6 * np.array(d["initaccscale"]))
    return force, (RAW_G - gyr) / (1 + 1e-6 * np.array(d["initgyrscale"]))


def by_fusion(texts: Texts) -> Evaluated:
    """misalignment (sensitivity * (uncalibrated - offset)), single precision, g and deg/s."""
    text = texts["fusion_calibration.h"]

    def values(name: str) -> np.ndarray:
        found = re.search(name + r" = \{\.array = \{(.*?)\}\};", text)
        assert found
        parts = found[1].split(", ")
        assert all(re.fullmatch(r"-?\d+(\.\d+)?(e[-+]\d+)?f", part) for part in parts)
        return np.array([float(part[:-1]) for part in parts])

    out: list[np.ndarray] = []
    for name, raw, unit in (("accelerometer", RAW_A, GRAVITY_UNIT), ("gyroscope", RAW_G, np.pi / 180)):
        M = values(name + "Misalignment").reshape(3, 3)
        s, b = values(name + "Sensitivity"), values(name + "Offset")
        out.append(unit * np.array([M @ (s * (r / unit - b)) for r in raw]))
    return out[0], out[1]


def by_vectornav(texts: Texts) -> Evaluated:
    out: list[np.ndarray] = []
    for register, raw in ((25, RAW_A), (84, RAW_G)):
        found = re.search(rf"^\$(VNWRG,{register},(.*))\*([0-9A-F]{{2}})$", texts["vectornav.txt"], re.M)
        assert found
        check = 0
        for byte in found[1].encode():
            check ^= byte
        assert f"{check:02X}" == found[3]
        n = np.array([float(x) for x in found[2].split(",")])
        out.append(np.array([n[:9].reshape(3, 3) @ (r - n[9:]) for r in raw]))
    return out[0], out[1]


def by_matlab(texts: Texts) -> Evaluated:
    """C = U*A + b with samples in rows; MATLAB's rows are parted by semicolons."""
    text = texts["imu_calibration.m"]
    out: list[np.ndarray] = []
    for name, raw in (("accel", RAW_A), ("gyro", RAW_G)):
        parts = {}
        for what in "Ab":
            found = re.search(rf"^{name}_{what} = \[(.*)\];$", text, re.M)
            assert found
            parts[what] = np.array([[float(x) for x in line.split()] for line in found[1].split(";")])
        out.append(raw @ parts["A"] + parts["b"])
    return out[0], out[1]


def by_imucal(texts: Texts) -> Evaluated:
    d = json.loads(texts["imucal.json"])
    assert (d["acc_unit"], d["gyr_unit"], d["_format_version"]) == ("m/s^2", "deg/s", "2.0")
    m = {k: np.array(d[k]) for k in ("K_a", "R_a", "b_a", "K_g", "R_g", "K_ga", "b_g")}
    assert np.allclose(np.linalg.norm(m["R_a"], axis=1), 1.0, atol=1e-12)
    a = np.array([np.linalg.inv(m["R_a"]) @ np.linalg.inv(m["K_a"]) @ (r - m["b_a"]) for r in RAW_A])
    w = [
        np.linalg.inv(m["R_g"]) @ np.linalg.inv(m["K_g"]) @ (r - m["K_ga"] @ x - m["b_g"])
        for r, x in zip(RAW_G, a, strict=True)
    ]
    return a, np.radians(w)


def by_realsense(texts: Texts) -> Evaluated:
    """Rows: [raw, -1] X with X[:3] the nine numbers by rows and X[3] the bias."""
    imu = json.loads(texts["calibration.json"])["imus"][0]
    out: list[np.ndarray] = []
    for name, raw in (("accelerometer", RAW_A), ("gyroscope", RAW_G)):
        X = np.vstack([np.array(imu[name]["scale_and_alignment"]).reshape(3, 3), imu[name]["bias"]])
        out.append(np.hstack([raw, -np.ones((len(raw), 1))]) @ X)
    return out[0], out[1]


def by_ikalibr(texts: Texts) -> Evaluated:
    d = keys(texts)["Intrinsics"]

    def matrix(v: list[float]) -> np.ndarray:
        return np.array([[v[0], v[3], v[4]], [0, v[1], v[5]], [0, 0, v[2]]])

    x, y, z, w = (d["SO3_AtoG"][k] for k in ("qx", "qy", "qz", "qw"))
    C = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    force = np.array([np.linalg.solve(matrix(d["ACCE"]["MAP_COEFF"]), r - d["ACCE"]["BIAS"]) for r in RAW_A])
    gyro = matrix(d["GYRO"]["MAP_COEFF"]) @ C
    return force, np.array([np.linalg.solve(gyro, r - d["GYRO"]["BIAS"]) for r in RAW_G])


def by_python(texts: Texts) -> Evaluated:
    text = texts["tumble_calibration.py"]
    assert "numpy" not in text.partition("\nimport math")[2]
    names: dict[str, Any] = {"__name__": "tumble_calibration"}
    exec(compile(text, "tumble_calibration.py", "exec"), names)
    assert names["self_test"]() < 1e-14
    pairs = [names["correct"](list(a), list(g)) for a, g in zip(RAW_A, RAW_G, strict=True)]
    return np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])


# Single precision of parameters, and nine digits of text: 6e-8 of 10 m/s² and of offsets.
SINGLE = 3e-6
EVALUATORS: dict[str, tuple[Callable[[Texts], Evaluated], float]] = {
    "kalibr": (by_kalibr, 1e-12),
    "openvins": (by_openvins, 1e-12),
    "imu-tk": (by_imu_tk, 1e-12),
    "openicc": (by_openicc, 1e-12),
    "px4": (by_px4, SINGLE),
    "ardupilot": (by_ardupilot, SINGLE),
    "python": (by_python, 1e-12),
    "basalt": (by_basalt, 1e-12),
    "kf-gins": (by_kf_gins, 1e-12),
    "fusion": (by_fusion, 1e-7),
    "vectornav": (by_vectornav, 1e-7),
    "matlab": (by_matlab, 1e-12),
    "imucal": (by_imucal, 1e-12),
    "realsense": (by_realsense, 1e-12),
    "ikalibr": (by_ikalibr, 1e-12),
}
COMPILED = ("c", "cpp", "arduino")  # tests/unit/export/test_code.py compiles them
FIELD_ONLY = ("motioncal",)  # tests/unit/export/test_magnetometer.py
APART = ("dlio", "mpu6050")  # tests/unit/export/test_files.py
NOISE_ONLY = ("kalibr-noise", "ros", "vins", "gvins", "lio-sam", "fast-lio", "okvis", "svo")


def written(name: str, model: ImuModel | None = None) -> Texts:
    target = TARGETS[name]
    noise = NOISE_NUMBERS if target.noise else None
    return target.write(prepare(document(model or model_for(target)), target, None, noise))


def test_every_target_is_tested() -> None:
    assert {*EVALUATORS, *COMPILED, *NOISE_ONLY, *FIELD_ONLY, *APART} == set(TARGETS)
    page = (Path(__file__).parents[2] / "docs" / "convert.md").read_text(encoding="utf-8")
    assert not [name for name in TARGETS if f"| `{name}` |" not in page]


@pytest.mark.parametrize("name", sorted(EVALUATORS))
class TestCalibrationTarget:
    """Every target that holds a calibration."""

    def test_its_own_formula_gives_the_corrected_numbers(self, name: str) -> None:
        evaluate, tolerance = EVALUATORS[name]
        expected = truth(model_for(TARGETS[name]), TARGETS[name])
        assert np.allclose(evaluate(written(name)), expected, rtol=0, atol=tolerance)

    def test_nothing_is_written_over_the_calibration(self, name: str, tmp_path: Path) -> None:
        file = tmp_path / "calibration.json"
        document(model_for(TARGETS[name])).write(file)
        before = file.read_bytes()
        with pytest.raises(UsageError, match=r"one of the inputs|must be a folder"):
            convert_to(file, name, output=file)
        assert file.read_bytes() == before


@pytest.mark.parametrize("name", [name for name, target in TARGETS.items() if "from" in target.directions])
class TestReadableTarget:
    """Every target that is read."""

    @staticmethod
    def files(name: str, folder: Path) -> Path:
        folder.mkdir()
        texts = written(name)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8")
        return folder if len(texts) > 1 else folder / next(iter(texts))

    def test_what_is_read_back_corrects_alike(self, name: str, tmp_path: Path) -> None:
        target = TARGETS[name]
        units = "m/s^2,rad/s" if target.units is None else None
        done = convert_from(
            self.files(name, tmp_path / "in"), name, output=tmp_path / "back.json", units=units
        )
        back = read_calibration(done.files[0])
        tolerance = 10 * max(EVALUATORS[name][1], 1e-12)
        expected = truth(model_for(target), target)
        assert np.allclose(back.correct(RAW_A, RAW_G), expected, rtol=0, atol=tolerance)
        assert not back.verdict.fit
        assert back.covariance_parameters == []
        for v in back.test_vectors:
            one = back.correct(np.array([v.raw_specific_force]), np.array([v.raw_angular_rate]))
            assert np.allclose(np.vstack(one), [v.specific_force, v.angular_rate], rtol=0, atol=1e-12)

    @pytest.mark.parametrize("damage", ["empty", "cut", "binary", "words", "nan", "missing", "another's"])
    def test_a_damaged_file_is_refused_in_one_sentence(self, name: str, damage: str, tmp_path: Path) -> None:
        place = self.files(name, tmp_path / "in")
        for file in sorted(place.iterdir()) if place.is_dir() else [place]:
            text = file.read_text(encoding="utf-8")
            lines = r"^(?!\s*(?:#|//|%)).*?(-?\d+\.\d{4,}(?:[eE][-+]?\d+)?)"
            body = list(re.finditer(lines, text, re.M))
            at = body[len(body) // 2]
            wrong = {
                "empty": b"",
                "cut": text[: body[len(body) // 3].start(1)].rpartition("\n")[0].encode(),
                "binary": bytes(range(256)) * 4,
                "words": b"this is a diary, not a calibration\n",
                "nan": (text[: at.start(1)] + "nan" + text[at.end(1) :]).encode(),
                "another's": b'{"format": "tumble calibration"}',
            }
            file.unlink()
            if damage != "missing":
                file.write_bytes(wrong[damage])
        with pytest.raises((CalibrationFileError, UsageError)) as told:
            convert_from(place, name, output=tmp_path / "out.json")
        assert "\n" not in str(told.value)
        assert str(told.value).endswith(".")
        assert not (tmp_path / "out.json").exists()


# Names of N and K of accelerometers, N and K of gyros; the power of them, and that of the rate.
DENSITY, WALK = "{0}_noise_density", "{0}_random_walk"
MEANINGS = {
    "kalibr-noise": (
        " ".join((DENSITY + " " + WALK).format(t) for t in ("accelerometer", "gyroscope")),
        1,
        0.0,
    ),
    "vins": ("acc_n acc_w gyr_n gyr_w", 1, 0.5),
    "gvins": ("acc_n acc_w gyr_n gyr_w", 1, 0.5),
    "lio-sam": ("imuAccNoise imuAccBiasN imuGyrNoise imuGyrBiasN", 1, 0.0),
    "fast-lio": ("acc_cov b_acc_cov gyr_cov b_gyr_cov", 2, 1.0),
    "okvis": ("sigma_a_c sigma_aw_c sigma_g_c sigma_gw_c", 1, 0.0),
    "svo": ("sigma_acc_c sigma_acc_bias_c sigma_omega_c sigma_omega_bias_c", 1, 0.0),
    "ros": ("", 2, 1.0),
}


@pytest.mark.parametrize("name", NOISE_ONLY)
def test_the_numbers_of_noise_have_the_consumer_s_meaning(name: str) -> None:
    target = TARGETS[name]
    with pytest.raises(UsageError, match="--noise"):
        prepare(None, target)
    d = keys(target.write(prepare(None, target, None, NOISE_NUMBERS)))
    keys_of, power, rate = MEANINGS[name]
    for part in ("imu_params", "lio_sam", "mapping"):
        d = d.get(part, d)
    for key, value in zip(keys_of.split(), (2e-3, 3e-5, 1.7e-4, 2e-6), strict=bool(keys_of)):
        assert d[key] == pytest.approx(value**power * RATE**rate, rel=1e-12)
    if name == "ros":
        cov = np.array(d["linear_acceleration_covariance"]).reshape(3, 3)
        assert np.allclose(cov, np.diag([1.8e-3**2, 1.9e-3**2, 2e-3**2]) * RATE, rtol=1e-12)
        assert d["orientation_covariance"][0] == -1.0


BENT_A, BENT_G = np.array([2e-3, -3e-3, 1e-3]), np.array([0.0, 5e-3, -1e-3])  # asymmetry
SQUARE_A, SQUARE_G = np.array([1e-4, 0.0, -2e-4]), np.array([3e-3, -2e-3, 0.0])
# of biases, per K about 22 °C
SLOPE_A, SLOPE_G = np.array([2e-3, -1e-3, 5e-4]), np.array([3e-4, 1e-4, -2e-4])
MEMORY = np.array([5e-3, 0.0, -2e-3])  # hysteresis of the accelerometers
SIDES = np.array([side for side in product((-1.0, 0.0, 1.0), repeat=3) if any(side)])
SIDES /= np.linalg.norm(SIDES, axis=1, keepdims=True)


@cache
def with_all_terms() -> Calibration:
    model = ImuModel(Triad(M_A, B_A, BENT_A, SQUARE_A), Triad(M_G, B_G, BENT_G, SQUARE_G), G)
    thermal = ThermalModel(
        model,
        TemperatureBasis("polynomial", 22.0, order=1),
        {"accelerometer.bias": SLOPE_A[None], "gyroscope.bias": SLOPE_G[None]},
        hysteresis={"accelerometer.bias": MEMORY},
        span_celsius=(-20.0, 60.0),
    )
    arms = ((0.003, 0.0, 0.0), (0.0, 0.004, 0.0), (0.0, 0.0, 0.012))
    return structs.replace(thermal_document(thermal), lever_arms=arms, magnetometer=compass())


def seen(true: np.ndarray, matrix: np.ndarray, bent: np.ndarray, square: np.ndarray) -> np.ndarray:
    own = true @ matrix.T
    return own + bent * np.abs(own) + square * own**2


def alone(raw, holds, matrix, bias, *curve) -> np.ndarray:
    """What a file corrects of one triad with what it holds, and with nominal numbers for the rest."""
    out = raw - (bias if "biases" in holds else 0.0)
    if "asymmetry and quadratic terms" in holds:
        slope = 1.0 + curve[0] * np.sign(out)
        out = 2.0 * out / (slope + np.sqrt(slope**2 + 4.0 * curve[1] * out))
    kept = np.diag(np.diag(matrix)) if "scale factors" in holds else np.eye(3)
    return np.linalg.solve(matrix if "full matrix" in holds else kept, out.T).T


def by_the_file(target, raw_force, raw_rate, warmer=0.0) -> tuple[np.ndarray, np.ndarray]:
    """Both triads corrected with what a target's record holds, so many K above 22 °C."""
    warmer *= target.temperature
    force = alone(raw_force, target.accelerometer, M_A, B_A + warmer * SLOPE_A, BENT_A, SQUARE_A)
    pull = force @ G.T if "g-sensitivity" in target.gyroscope else 0.0
    return force, alone(raw_rate - pull, target.gyroscope, M_G, B_G + warmer * SLOPE_G, BENT_G, SQUARE_G)


@cache
def prepared(name: str) -> Subject:
    target = TARGETS[name]
    noise = NOISE_NUMBERS if target.noise else None
    return prepare(with_all_terms(), target, Wishes(largest_loss=0.5), noise)


@pytest.mark.parametrize("name", TARGETS)
class TestLoss:
    """What a file does not hold of a calibration with all terms is stated."""

    def test_the_whole_error_of_the_file_alone_is_stated_to_within_a_tenth(self, name: str) -> None:
        """1 g and 1 rad/s along 26 directions each, from -20 to 60 °C, warming and cooling."""
        force = np.repeat(GRAVITY_UNIT * SIDES, len(SIDES), axis=0)
        rate = np.tile(SIDES, (len(SIDES), 1))
        worst = np.zeros(2)
        for warmer, memory in product((-42.0, -22.0, 0.0, 20.0, 38.0), (-1.0, 1.0)):
            raw_force = seen(force, M_A, BENT_A, SQUARE_A) + B_A + warmer * SLOPE_A + memory * MEMORY
            raw_rate = seen(rate, M_G, BENT_G, SQUARE_G) + B_G + warmer * SLOPE_G + force @ G.T
            off = by_the_file(TARGETS[name], raw_force, raw_rate, warmer)
            size = [np.linalg.norm(a - b, axis=1).max() for a, b in zip(off, (force, rate), strict=True)]
            worst = np.maximum(worst, size)
        subject = prepared(name)
        ((*stated, span),) = re.findall(
            r"off by up to (.+) and (.+), over 26 directions(.*)", subject.losses[0].text
        )
        sizes = [float(size) * si_of(unit)[1] for size, unit in map(str.split, stated)]
        assert sizes == pytest.approx(worst, rel=0.1)
        assert span.endswith("from -20 to 60 °C")
        if TARGETS[name].comment:
            assert f"loss: {subject.losses[0].text}" in "".join(TARGETS[name].write(subject).values())

    def test_each_part_has_its_sentence(self, name: str) -> None:
        target, told = TARGETS[name], " ".join(loss.text for loss in prepared(name).losses)
        if not target.corrects:
            assert "this file corrects nothing" in told
            return
        for who, holds, M, b, bent, square in (
            ("accelerometers'", target.accelerometer, M_A, B_A, BENT_A, GRAVITY_UNIT * SQUARE_A),
            ("gyros'", target.gyroscope, M_G, B_G, BENT_G, SQUARE_G),
        ):
            size = np.abs(bent).max() + np.abs(square * np.linalg.norm(M, axis=1)).max()
            bends = f"the {who} asymmetry and quadratic terms are left out: up to {1e6 * size:.0f} ppm"
            assert (bends in told) == ("asymmetry and quadratic terms" not in holds)
            unit, size = ("rad/s" if M is M_G else "m/s^2"), np.linalg.norm(np.linalg.solve(M, b))
            bias = f"the {who} biases are left out: {amount(size, unit)}"
            assert (bias in told) == ("biases" not in holds)
            matrix = "scale factors" in holds, not {"scale factors", "full matrix"} & {*holds}
            for what, kept, lost in (
                (" misalignments (off-diagonals)", np.diag(np.diag(M)), matrix[0]),
                (" scale factors and misalignments", np.eye(3), matrix[1]),
            ):
                size = np.linalg.norm(np.linalg.solve(kept, M) - np.eye(3), 2)
                assert (f"the {who}{what} are left out: up to {1e6 * size:.0f} ppm" in told) == lost
        pull = amount(GRAVITY_UNIT * float(np.linalg.norm(np.linalg.solve(M_G, G), 2)), "rad/s")
        assert (f"g-sensitivity is left out: up to {pull} in 1 g" in told) == (
            "g-sensitivity" not in target.gyroscope
        )
        assert ("lever arms are left out: they are up to 13 mm apart" in told) == bool(target.accelerometer)
        assert ("the magnetometer is" in told) == (target.magnetometer != "any")
        assert "hysteresis" in told if target.temperature else "changes with temperature is left out" in told

    def test_the_test_vector_is_what_the_file_alone_corrects(self, name: str) -> None:
        target, text = TARGETS[name], "".join(TARGETS[name].write(prepared(name)).values())
        found = re.search(
            r"raw specific force (\[.*?\]), raw angular rate (\[.*?\])[^\[]*(\[.*?\]), (\[.*?\])", text
        )
        if not target.corrects or not (target.comment or name == "imucal"):
            assert found is None
            return
        assert found
        raw_force, raw_rate, force, rate = (np.array([json.loads(numbers)]) for numbers in found.groups())
        if target.units == ("g", "deg/s"):
            raw_force, force = GRAVITY_UNIT * raw_force, GRAVITY_UNIT * force
            raw_rate, rate = np.radians(raw_rate), np.radians(rate)
        # The frame may be another: lengths have none.
        for made, expected in zip((force, rate), by_the_file(target, raw_force, raw_rate), strict=True):
            assert np.linalg.norm(made) == pytest.approx(np.linalg.norm(expected), rel=1e-12)


def test_kf_gins_walk_is_a_gauss_markov_process_of_the_same_driving_density() -> None:
    """KF-GINS: q = 2 sigma² / corrtime; of a random walk q = K²."""
    d = keys(written("kf-gins"))["imunoise"]
    seconds = 3600.0 * d["corrtime"]
    gyro = np.array(d["gbstd"]) * np.pi / 180 / 3600
    assert np.allclose(2 * gyro**2 / seconds, (2e-6) ** 2, rtol=1e-12)
    assert np.allclose(2 * (1e-5 * np.array(d["abstd"])) ** 2 / seconds, (3e-5) ** 2, rtol=1e-12)
    assert np.allclose(np.radians(d["arw"]) / 60, 1.7e-4, rtol=1e-12)
    assert np.allclose(np.array(d["vrw"]) / 60, 2e-3, rtol=1e-12)


@pytest.mark.parametrize("name", ["px4", "ardupilot", "kf-gins"])
def test_a_diagonal_target_says_what_it_loses_and_refuses_too_much(name: str) -> None:
    """The size is the spectral norm of what correction by the diagonal leaves, here worked out by hand."""
    target, calibration = TARGETS[name], document(ImuModel(Triad(M_A, B_A), Triad(M_G, B_G)))
    size = np.linalg.svd(np.linalg.inv(np.diag(np.diag(M_A))) @ M_A - np.eye(3))[1][0]
    with pytest.raises(UsageError, match="--largest-loss"):
        target.write(prepare(calibration, target, Wishes(largest_loss=0.9 * size)))
    text = "".join(target.write(prepare(calibration, target, Wishes(largest_loss=0.1))).values())
    assert f"up to {1e6 * size:.0f} ppm, {1e6 * size:.0f} µg in 1 g" in text


@pytest.mark.parametrize("units", [("g", "deg/s"), ("mg", "mdeg/s"), ("counts", "counts")])
def test_other_raw_units_come_out_in_the_target_s_and_counts_need_a_factor(units: tuple[str, str]) -> None:
    """A calibration of raw g and deg/s is the same unit for Kalibr, which takes m/s² and rad/s."""
    scale = {"g": 1 / GRAVITY_UNIT, "mg": 1e3 / GRAVITY_UNIT, "deg/s": 180 / np.pi, "mdeg/s": 180e3 / np.pi}
    s, r = (scale.get(unit, 1000.0) for unit in units)
    other = document(ImuModel(Triad(s * M_A, s * B_A), Triad(r * M_G, r * B_G), r * G), units)
    if units[0] == "counts":
        with pytest.raises(UsageError, match=r"--units '16384 LSB/g"):
            prepare(other, TARGETS["kalibr"])
        return
    found = by_kalibr(TARGETS["kalibr"].write(prepare(other, TARGETS["kalibr"])))
    assert np.allclose(found, truth(WHOLE, TARGETS["kalibr"]), rtol=0, atol=1e-11)


HOSTILE = (
    "x\nimport os\n#",
    "x\r\n#error\r\n",
    "*/ int broken; /*",
    "ends in a backslash \\",
    "ends in a trigraph ??/",
    "coding: utf_7 +AAo-import os",
    "a\u2028b\u2029c\x0bd\x0ce\x85f\x1cg\x00h",
    "%} \n%{",
    "\u202egnihton",
    '"\n}; system("true"); {"',
)


@cache
def hostile(name: str, text: str) -> dict[str, str]:
    """What is written of a calibration all of whose texts are one."""
    target = TARGETS[name]
    calibration = document(model_for(target))
    calibration = structs.replace(
        calibration,
        imu=structs.replace(calibration.imu, model=text, serial_number=text),
        created=text,
        remarks=[text],
        frame=structs.replace(calibration.frame, description=text),
        raw_units=structs.replace(calibration.raw_units, specific_force="m/s^2\n"),
        magnetometer=compass(raw_unit="uT\n", method=text, remarks=[text]),
    )
    wishes = Wishes(topic=text, largest_loss=0.1)
    return target.write(prepare(calibration, target, wishes, NOISE_NUMBERS))


def code_of(target: Target, text: str) -> str:
    """A file without its comments, as its own language leaves them out."""
    if target.comment in (" *", "//"):
        # Phases of translation 1 to 3: trigraphs, joined lines, comments.
        text = re.sub(r"/\*.*?\*/", " ", text.replace("??/", "\\").replace("\\\n", ""), flags=re.S)
        return re.sub(r"//[^\n]*", "", text) if target.comment == "//" else text
    lines = re.split(r"\r\n|\r|\n", text)
    return "\n".join(line for line in lines if not line.startswith(target.comment or "\0"))


@pytest.mark.parametrize("text", HOSTILE)
@pytest.mark.parametrize("name", TARGETS)
def test_no_text_of_a_calibration_becomes_code(name: str, text: str) -> None:
    target = TARGETS[name]
    for file, content in hostile(name, text).items():
        plain = hostile(name, "plain")[file]
        if file.endswith(".json"):
            assert json.loads(content).keys() == json.loads(plain).keys()
        elif file.endswith((".yaml", ".yml")):
            found, expected = (yaml.safe_load(t.removeprefix("%YAML:1.0\n")) for t in (content, plain))
            for one in (found, expected):
                for part in (one, *(one.get(k, {}) for k in ("imu0", "lio_sam", "common"))):
                    for key in ("rostopic", "imu_topic", "imuTopic"):
                        part.pop(key, None)
            assert found == expected
        else:
            assert code_of(target, content) == code_of(target, plain)
        assert not re.search(r"[\x00-\x09\x0b-\x1f\x85\u2028\u2029\u202e]", content.replace("\t", ""))


def test_a_python_file_takes_no_encoding_from_a_name() -> None:
    for content in hostile("python", "coding: utf_7 +AAo-import os").values():
        tree = compile(content.encode(), "generated", "exec")
        assert "os" not in tree.co_names


@pytest.mark.parametrize("scale", ["1e-300", "1e300", "1e9", "0.01", "nan", "1_0"])
@pytest.mark.parametrize("name", ["ardupilot", "px4"])
def test_a_scale_that_no_sensor_has_is_refused(tmp_path: Path, name: str, scale: str) -> None:
    target = TARGETS[name]
    (file, content), *_ = target.write(prepare(document(model_for(target)), target)).items()
    what = r"(INS_ACCSCAL_X,)\S+" if name == "ardupilot" else r"(CAL_ACC0_XSCALE\t)\S+"
    (tmp_path / file).write_text(re.sub(what, rf"\g<1>{scale}", content))
    with pytest.raises(CalibrationFileError, match=r"scale|number|finite|NAME"):
        convert_from(tmp_path / file, name, output=tmp_path / "calibration.json")
    assert not (tmp_path / "calibration.json").exists()
