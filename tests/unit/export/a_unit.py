"""The unit that is exported, its matrices asymmetric, so that a transposed or an inverted one fails; two firmwares."""

import re
from collections.abc import Mapping

import numpy as np
from msgspec import structs
from scipy.spatial.transform import Rotation

from tumble.document import Calibration, MagnetometerBlock, calibration_from_model, read_part, thermal_block
from tumble.export.target import targets
from tumble.sensor import ImuModel, ThermalModel, Triad

GRAVITY_UNIT = 9.80665
TARGETS = targets()
M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
M_G = np.array([[0.985, -0.011, 0.008], [0.006, 1.017, -0.004], [-0.013, 0.005, 1.008]])
B_A, B_G = np.array([0.11, -0.23, 0.34]), np.array([0.012, -0.034, 0.021])
G = np.array([[1.1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]])
WHOLE = ImuModel(Triad(M_A, B_A), Triad(M_G, B_G), G)
RAW_A = np.array([[1.0, 2.0, 9.5], [-8.0, 3.0, -4.0], [0.3, -9.9, 1.2], [5.0, 5.0, 5.0]])
RAW_G = np.array([[0.1, -0.2, 0.3], [-1.5, 0.7, 0.2], [0.0, 2.0, -1.0], [0.4, 0.4, 0.4]])
# Raw µT per tesla, right-handed, turned by some degrees, no two entries alike.
M_M = 1e6 * np.array([[1.07, 0.031, -0.052], [-0.083, 0.94, 0.047], [0.021, -0.066, 1.12]])
B_M = np.array([12.5, -31.0, 47.25])


def document(model: ImuModel = WHOLE, units: tuple[str, str] = ("m/s^2", "rad/s")) -> Calibration:
    return calibration_from_model(model, units, ("fixture", "its axes"), [], procedure="by hand", remarks=[])


def thermal_document(model: ThermalModel) -> Calibration:
    block = thermal_block(model, model.names, 1e-12 * np.eye(len(model.names)))
    update = {"thermal": block, "temperature_celsius": model.basis.reference_celsius}
    return structs.replace(document(model.reference), **update)


def compass(matrix: np.ndarray = M_M, bias: np.ndarray = B_M, **update: object) -> MagnetometerBlock:
    """A magnetometer of a norm of 49 µT."""
    numbers = {"matrix": np.asarray(matrix).tolist(), "bias": np.asarray(bias).tolist()}
    field = {"norm": 49e-6, "norm_standard_uncertainty": 1e-7, "norm_given": True, "source": "by hand"}
    told = {"raw_unit": "uT", "unit": "T", "frame": "b", "method": "by hand", "field": field}
    return read_part(MagnetometerBlock, {**told, **numbers, **update})


# -- what two firmwares make of raw numbers by their parameters, as their sources write it ----------

Parameters = Mapping[str, float]


def parameters(text: str) -> dict[str, float]:
    """The parameters of a file of PX4 (tabs) or ArduPilot (commas)."""
    rows = [re.split(r"[\t,]", line) for line in text.splitlines() if line and line[0] != "#"]
    return {w[-3]: float(w[-2]) for w in rows} if "\t" in text else {w[0]: float(w[1]) for w in rows}


def three(p: Parameters, name: str, default: float) -> np.ndarray:
    return np.array([p.get(name.format(axis), default) for axis in "XYZ"])


def symmetric(diagonal: np.ndarray, beside: np.ndarray) -> np.ndarray:
    (a, b, c), (d, e, f) = diagonal, beside
    return np.array([[a, d, e], [d, b, f], [e, f, c]])


# By the firmwares' own assignments to x, y and z: none, yaw by 90° and by 270°, roll by 90°.
TURNS = {
    0: np.eye(3),
    2: np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    6: np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    16: np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
}


def px4(kind, u, p, thermal=0.0, number=0) -> np.ndarray:
    """What PX4 makes of (samples, 3) raw numbers: ``Correct`` of its classes."""
    name = f"CAL_{kind}{number}"
    own = p.get(f"{name}_ROT", -1)
    level = Rotation.from_euler("ZYX", three(p, "SENS_BOARD_{}_OFF", 0.0)[::-1], degrees=True).as_matrix()
    turn = level @ TURNS[int(own if own >= 0 else p.get("SENS_BOARD_ROT", 0))]
    S = symmetric(three(p, name + "_{}SCALE", 1.0), three(p, name + "_{}ODIAG", 0.0))
    return (u - thermal - three(p, name + "_{}OFF", 0.0)) @ S.T @ turn.T


def px4_thermal(letter: str, p: Parameters, celsius: float) -> np.ndarray:
    """TemperatureCompensation.h: an offset by Horner in the clipped difference."""
    assert p[f"TC_{letter}_ENABLE"] == 1
    t = float(np.clip(celsius, p[f"TC_{letter}0_TMIN"], p[f"TC_{letter}0_TMAX"])) - p[f"TC_{letter}0_TREF"]
    x = [np.array([p[f"TC_{letter}0_X{k}_{axis}"] for axis in range(3)]) for k in range(4)]
    return ((x[3] * t + x[2]) * t + x[1]) * t + x[0]


def ardupilot(kind, u, p, celsius=0.0, number=1) -> np.ndarray:
    """What ArduPilot makes of (samples, 3) raw numbers of one unit, before a compass's motors.

    AP_InertialSensor_tempcal.cpp: v -= P(T - 35), v += P(T_cal - 35), P(d) = (c1 + (c2 + c3 d) d) d 1e-6.
    """
    n = "" if number == 1 else str(number)
    if kind == "MAG":
        S = symmetric(three(p, f"COMPASS_DIA{n}_{{}}", 1.0), three(p, f"COMPASS_ODI{n}_{{}}", 0.0))
        return (p.get(f"COMPASS_SCALE{n}") or 1.0) * (u + three(p, f"COMPASS_OFS{n}_{{}}", 0.0)) @ S.T

    def polynomial(temperature: np.ndarray | float) -> np.ndarray:
        d = np.clip(temperature, p[f"INS_TCAL{number}_TMIN"], p[f"INS_TCAL{number}_TMAX"]) - 35.0
        d = np.asarray(d)[..., None]
        c = [three(p, f"INS_TCAL{number}_{kind}{k}_{{}}", 0.0) for k in (1, 2, 3)]
        return (c[0] + (c[1] + c[2] * d) * d) * d * 1e-6

    if p.get(f"INS_TCAL{number}_ENABLE"):
        u = u - polynomial(celsius) + polynomial(p[f"INS_{kind}{number}_CALTEMP"])
    scale = three(p, f"INS_ACC{n}SCAL_{{}}", 1.0) if kind == "ACC" else np.ones(3)
    made = (u - three(p, f"INS_{kind}{n}OFFS_{{}}", 0.0)) * scale
    return made @ TURNS[int(p.get("AHRS_ORIENTATION", 0))].T
