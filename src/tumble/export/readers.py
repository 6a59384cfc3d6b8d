"""Files of Kalibr, imu_tk, PX4 and ArduPilot read: matrices, offsets, biases over temperature; faults are sentences."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.arrays import AnyArray, Matrix
from tumble.document import is_invertible
from tumble.errors import CalibrationFileError
from tumble.export.polynomials import Curve, thermal_of
from tumble.files import number_of, read_text, read_yaml, reading, shown
from tumble.records import dataclass
from tumble.sensor import FRAMES, ImuModel, ThermalModel, Triad, inverse
from tumble.units import angular_rate_factor, specific_force_factor


def read_file(name: str, path: Path) -> Imported:
    """Read a file of a target.

    Parameters
    ----------
    name : of `tumble.export.target.READ`.
    path : the file, or a folder of several.

    Raises
    ------
    CalibrationFileError
        If it is no file of that tool, or damaged.
    """
    by_name = {"kalibr": read_kalibr, "imu-tk": read_imu_tk, "px4": read_px4, "ardupilot": read_ardupilot}
    return by_name[name](path)


def read_kalibr(path: Path) -> Imported:
    """Read a result file of Kalibr, or one of this module.

    Raises
    ------
    CalibrationFileError
        If it is none, or of the model ``calibrated`` or ``scale-misalignment-size-effect`` without matrices.
    """
    document = yaml_of(path)
    if "imu0" not in document:
        if "accelerometer_noise_density" in document:
            raise CalibrationFileError(f"{path} holds Kalibr's noise parameters and no calibration.")
        raise CalibrationFileError(f"{path} has no imu0: it is no result file of Kalibr.")
    imu = document["imu0"]
    if isinstance(imu, dict) and "Tw" in imu:
        raise CalibrationFileError(f"{path} has OpenVINS' keys (Tw, Ta), not Kalibr's.")
    model = entry(document, "imu0.model", path)
    if model == "calibrated":
        raise CalibrationFileError(
            f"{path} is of Kalibr's model 'calibrated', which has no matrices to read."
        )
    M_a = invertible(entry(document, "imu0.accelerometers.M", path), "accelerometers.M", path)
    M_g = invertible(entry(document, "imu0.gyroscopes.M", path), "gyroscopes.M", path)
    A = _numbers(entry(document, "imu0.gyroscopes.A", path), "gyroscopes.A", path, 3, 3)
    C = _numbers(entry(document, "imu0.gyroscopes.C_gyro_i", path), "gyroscopes.C_gyro_i", path, 3, 3)
    check_rotation(C, path)
    remarks: list[str] = []
    biases: list[np.ndarray] = []
    for name in ("accelerometers", "gyroscopes"):
        given: Any = document["imu0"][name].get("bias")
        if given is None:
            remarks.append(f"Kalibr's file has no bias of the {name}: it is taken as zero")
        biases.append(np.zeros(3) if given is None else _numbers(given, f"{name}.bias", path, 3))
    if model == "scale-misalignment-size-effect":
        remarks.append("Kalibr's lever arms of the accelerometers are left out")
    sensitivity = np.asarray(A @ C)
    return Imported(
        ImuModel(
            Triad(M_a, biases[0]),
            Triad(np.asarray(M_g @ C), biases[1]),
            sensitivity if np.any(sensitivity) else None,
        ),
        ("m/s^2", "rad/s"),
        "accelerometer-x",
        FRAMES["accelerometer-x"],
        (path,),
        tuple(remarks),
    )


def read_imu_tk(path: Path) -> Imported:
    """Read both triads' files of a folder, or one file, of the triad that its name says.

    Raises
    ------
    CalibrationFileError
        If a file is not 21 numbers, or which triad it is of cannot be told.
    """
    files = sorted(path.glob("*.calib")) if path.is_dir() else [path]
    if not files:
        raise CalibrationFileError(f"The folder {path} has no .calib file of imu_tk.")
    found: dict[str, Triad] = {}
    for file in files:
        kind = _kind(file)
        if kind in found:
            raise CalibrationFileError(
                f"{path} has several files of the {kind}: give one of them, or clear the folder."
            )
        words = text_of(file).split()
        try:
            numbers = np.array([float(word) for word in words])
        except ValueError:
            raise CalibrationFileError(f"{file} holds words: imu_tk's file is 21 numbers.") from None
        if numbers.size != 21:
            raise CalibrationFileError(f"{file} has {numbers.size} numbers: imu_tk's file is 21, T, K and B.")
        found[kind] = _triad_of(numbers[:9], numbers[9:18], numbers[18:], file)
    accelerometer, frame = found.get("accelerometer"), "accelerometer-z"
    if accelerometer is not None and _is_full(accelerometer.matrix):
        frame = "output of imu_tk"
    return Imported(
        ImuModel(accelerometer, found.get("gyroscope")),
        ("counts", "counts"),
        frame,
        FRAMES.get(frame, "the axes of the corrected output"),
        tuple(files),
        ("imu_tk's file does not say its raw unit: counts is taken, or what --units says",),
    )


def _is_full(matrix: Matrix) -> bool:
    """Whether more than round-off is below the diagonal, where imu_tk itself has zeros."""
    return bool(np.abs(np.tril(matrix, -1)).max() > 1e-9 * np.abs(matrix).max())


def _kind(file: Path) -> str:
    name = file.stem.lower()
    kinds = [kind for kind, mark in (("accelerometer", "acc"), ("gyroscope", "gyr")) if mark in name]
    if len(kinds) != 1:
        raise CalibrationFileError(
            f"Which triad {file} is of cannot be seen: its name must hold acc or gyr, as accelerometer.calib."
        )
    return kinds[0]


def _triad_of(T: Any, K: Any, B: Any, file: Path) -> Triad:
    """Return the triad of imu_tk's numbers.

    Parameters
    ----------
    T, K, B : misalignment (3, 3), scale (3, 3), diagonal, and bias (3,), as read.
    file : that they are from.

    Raises
    ------
    CalibrationFileError
        If they are no such numbers.
    """
    misalignment = invertible(T, "the misalignment matrix", file)
    scale = invertible(K, "the scale matrix", file)
    if np.any(scale - np.diag(np.diag(scale))):
        raise CalibrationFileError(f"The scale matrix in {file} is not diagonal: it is no file of imu_tk.")
    return Triad(inverse(misalignment @ scale), _numbers(B, "the bias", file, 3))


_REFERENCE = 35.0  # °C that ArduPilot's polynomials are about
_ABSOLUTE_ZERO = 273.15  # below it CALTEMP is not set


def read_px4(path: Path) -> Imported:
    """Read the first calibrated accelerometer and gyro of a parameter file, with their temperature compensation.

    Raises
    ------
    CalibrationFileError
        If it is no parameter file, or has no calibration in it.
    """
    values = _values(path, "PX4", ("vehicle", "component", "name", "value", "type"))
    names = r"CAL_(?P<kind>ACC|GYRO)(?P<number>\d)_(?P<axis>[XYZ])(?P<what>OFF|SCALE)"
    return _from_parameters(values, names, path, "PX4", _px4_curve)


def _px4_curve(
    values: dict[str, float], path: Path, kind: str, number: str, triad: Triad, remarks: list[str]
) -> Curve | None:
    """Return a sensor's bias over temperature: what TC holds about TREF, and the offset beside it."""
    letter, short = ("A", "ACC") if kind == "accelerometer" else ("G", "GYRO")
    if not values.get(f"TC_{letter}_ENABLE"):
        return None
    own = values.get(f"CAL_{short}{number}_ID")
    known = [n for n in "0123" if own and values.get(f"TC_{letter}{n}_ID") == own]
    n = known[0] if known else number
    if not known and own and values.get(f"TC_{letter}{n}_ID"):
        remarks.append(
            f"the temperature compensation of TC_{letter} is for other sensors than the {kind} that was read"
        )
        return None
    what = f"TC_{letter}_ENABLE"
    begin = f"TC_{letter}{n}_"
    reference, low, high = _entries_of(
        values, [begin + name for name in ("TREF", "TMIN", "TMAX")], what, path
    )
    names = [f"{begin}X{power}_{axis}" for power in range(4) for axis in range(3)]
    coefficients = _entries_of(values, names, what, path).reshape(4, 3)
    coefficients[0] += triad.bias
    return Curve(coefficients, float(reference), (float(low), float(high)))


def read_ardupilot(path: Path) -> Imported:
    """Read the first accelerometer and gyro of a parameter file, with their temperature compensation.

    Raises
    ------
    CalibrationFileError
        If it is no parameter file, or has no calibration in it.
    """
    values = _values(path, "ArduPilot", ("name", "value"))
    names = r"INS_(?P<kind>ACC|GYR)(?P<number>\d?)(?P<what>OFF|SCAL)S?_(?P<axis>[XYZ])"
    return _from_parameters(values, names, path, "ArduPilot", _ardupilot_curve)


def _values(path: Path, tool: str, form: tuple[str, ...]) -> dict[str, float]:
    """Return the parameters of a file, whose lines are of a form."""
    values: dict[str, float] = {}
    for number, line in enumerate(text_of(path).splitlines(), 1):
        words = line.partition("#")[0].replace(",", " ").split()
        try:
            if words:
                # ArduPilot marks some of its own with @READONLY.
                named = dict(zip(form, words, strict=len(form) > 2))
                values[named["name"]] = number_of(named["value"])
        except (KeyError, ValueError):
            raise CalibrationFileError(
                f"{path}, line {number}: a line of {tool}'s is {', '.join(form)}, not {shown(line[:40])!r}."
            ) from None
    return values


def _ardupilot_curve(
    values: dict[str, float], path: Path, kind: str, number: str, triad: Triad, remarks: list[str]
) -> Curve | None:
    """Return a sensor's bias over temperature: the offset at CALTEMP, and how P differs from what it is there."""
    what = f"INS_TCAL{number}_ENABLE"
    if values.get(what) != 1.0:  # 2 learns, and corrects nothing
        return None
    short = "ACC" if kind == "accelerometer" else "GYR"
    begin = f"INS_TCAL{number}_"
    low, high = _entries_of(values, [begin + "TMIN", begin + "TMAX"], what, path)
    names = [f"{begin}{short}{power}_{axis}" for power in (1, 2, 3) for axis in "XYZ"]
    coefficients = np.zeros((4, 3))
    coefficients[1:] = 1e-6 * _entries_of(values, names, what, path).reshape(3, 3)
    calibrated = values.get(f"INS_{short}{number}_CALTEMP")
    if calibrated is None or calibrated < -_ABSOLUTE_ZERO:
        remarks.append(f"INS_{short}{number}_CALTEMP is not there: the offsets were taken as those at 35 °C")
        calibrated = _REFERENCE
    curve = Curve(coefficients, _REFERENCE, (float(low), float(high)))
    moved = curve.about(float(np.clip(calibrated, low, high)))
    moved[0] = triad.bias
    return Curve(moved, float(np.clip(calibrated, low, high)), curve.span)


def _from_parameters(
    values: dict[str, float],
    names: str,
    path: Path,
    tool: str,
    curve_of: Callable[[dict[str, float], Path, str, str, Triad, list[str]], Curve | None],
) -> Imported:
    """Return the first unit of an autopilot's parameters.

    Parameters
    ----------
    values : by name.
    names : pattern of the names of offsets and scale factors.
    path, tool : for the sentences.
    curve_of : returns the bias over temperature of a triad, given its kind, its number and what it is without; it
        adds to the remarks.

    Raises
    ------
    CalibrationFileError
        If nothing of a calibration is in it, an axis is missing, or a number is none that a calibration has.
    """
    found: dict[str, dict[tuple[str, str, str], float]] = {"accelerometer": {}, "gyroscope": {}}
    for name, value in values.items():
        if match := re.fullmatch(names, name):
            kind = "accelerometer" if match["kind"] == "ACC" else "gyroscope"
            what = "offset" if match["what"] == "OFF" else "scale"
            found[kind][match["number"] or "1", match["axis"], what] = value
    if not any(found.values()):
        raise CalibrationFileError(f"{path} has no calibration parameters of {tool}.")
    remarks: list[str] = []
    triads: dict[str, Triad | None] = {}
    curves: dict[str, Curve] = {}
    for kind, entries in found.items():
        triad = triads[kind] = _first(kind, entries, path) if entries else None
        if len({number for number, _, _ in entries}) > 1:
            remarks.append(f"the file has several {kind}s: the first one was read")
        if triad is not None:
            curve = curve_of(values, path, kind, min(key[0] for key in entries), triad, remarks)
            if curve is not None:
                curves[kind] = curve
    model = ImuModel(triads["accelerometer"], triads["gyroscope"])
    thermal, said = thermal_of(model, curves, path)
    return Imported(
        model if thermal is None else thermal.reference,
        ("m/s^2", "rad/s"),
        "sensor axes",
        f"the sensing axes as {tool} has them before the board's rotation, taken as orthogonal",
        (path,),
        (*remarks, *said),
        thermal,
    )


def _entries_of(values: dict[str, float], names: list[str], what: str, path: Path) -> AnyArray:
    """Return the values of parameters that belong together.

    Raises
    ------
    CalibrationFileError
        If one is missing.
    """
    missing = [name for name in names if name not in values]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise CalibrationFileError(f"{path} switches {what} on but lacks {', '.join(missing[:3])}{more}.")
    return np.array([values[name] for name in names])


def _first(kind: str, entries: dict[tuple[str, str, str], float], path: Path) -> Triad:
    number = min(key[0] for key in entries)
    rows: dict[str, np.ndarray] = {"offset": np.zeros(3), "scale": np.ones(3)}
    for what in {key[2] for key in entries if key[0] == number}:
        missing = [axis for axis in "XYZ" if (number, axis, what) not in entries]
        if missing:
            raise CalibrationFileError(f"{path} lacks the {kind}'s {what} of axis {', '.join(missing)}.")
        rows[what] = np.array([entries[number, axis, what] for axis in "XYZ"])
    if not np.all(rows["scale"] > 0.0):
        raise CalibrationFileError(f"{path} has a scale of the {kind} that is not positive.")
    return Triad(np.diag(1.0 / rows["scale"]), rows["offset"])


LARGEST = 4 << 20
"""Bytes of another tool's file of parameters."""
# Of an SI unit: a scale factor that no sensor has, and a bias that is more than any range.
_SCALES = (0.1, 10.0)
_LARGEST_BIAS = 1e3

# Readers multiply up to three numbers of a file.
_LARGEST_NUMBER = 1e60


@dataclass(frozen=True)
class Imported:
    """What a target's file says of a unit.

    Attributes
    ----------
    model : raw numbers in `units`.
    units : of specific force and angular rate that the file's numbers take.
    frame, frame_words : name of the frame of its corrected vectors, and what it is.
    files : that were read.
    remarks : sentences: what the file does not hold, what was assumed.
    thermal : how `model`'s biases change with temperature, or None.
    """

    model: ImuModel
    units: tuple[str, str]
    frame: str
    frame_words: str
    files: tuple[Path, ...]
    remarks: tuple[str, ...] = ()
    thermal: ThermalModel | None = None


def text_of(path: Path) -> str:
    """Return a file's text.

    Raises
    ------
    CalibrationFileError
        If it is not there, no text, or far too long for parameters.
    """
    with reading(path, "a file of parameters", CalibrationFileError):
        return read_text(path, LARGEST)


def yaml_of(path: Path) -> dict[str, Any]:
    """Return the YAML mapping of a Kalibr file; OpenCV's first line ``%YAML:1.0`` is let pass.

    Raises
    ------
    CalibrationFileError
        If the file is none.
    """
    with reading(path, "a Kalibr file", CalibrationFileError):
        document: Any = read_yaml(path)
    if not isinstance(document, dict):
        raise CalibrationFileError(f"{path} holds no keys, as Kalibr's file does.")
    return cast("dict[str, Any]", document)


def entry(document: Any, keys: str, path: Path) -> Any:
    """Return what stands at dotted keys.

    Raises
    ------
    CalibrationFileError
        If a key is not there.
    """
    value: Any = document
    for key in keys.split("."):
        if not isinstance(value, dict) or key not in value:
            raise CalibrationFileError(f"{path} has no {keys}: it is of another kind, or cut short.")
        value = cast("dict[str, Any]", value)[key]
    return value


def invertible(value: Any, name: str, path: Path) -> Matrix:
    """Return nine numbers as a matrix that can be inverted.

    Raises
    ------
    CalibrationFileError
        If they are not.
    """
    matrix = _numbers(value, name, path, 3, 3)
    if not is_invertible(matrix):
        raise CalibrationFileError(f"{name} in {path} cannot be inverted: it is no calibration's matrix.")
    return matrix


def _numbers(value: Any, name: str, path: Path, *shape: int) -> AnyArray:
    """Return finite numbers, in rows or one after another by rows, as an array of a shape."""
    entries, size = _flat(value.tolist() if isinstance(value, np.ndarray) else value), math.prod(shape)
    if len(entries) != size:
        raise CalibrationFileError(f"{name} in {path} is {len(entries)} numbers, not {size}.")
    try:
        numbers = np.array([number_of(entry) for entry in entries])
    except ValueError as error:
        raise CalibrationFileError(f"{name} in {path} cannot be used: {error}.") from None
    if np.abs(numbers).max() > _LARGEST_NUMBER:
        raise CalibrationFileError(
            f"{name} in {path} is {np.abs(numbers).max():g}: it is no calibration's number."
        )
    return numbers.reshape(shape)


def _flat(value: Any) -> list[Any]:
    """Return a value, a list, or a list of lists as one list."""
    if not isinstance(value, list | tuple):
        return [value]
    return [entry for part in cast("list[Any]", value) for entry in _flat(part)]


def check_plausible(model: ImuModel, units: tuple[str, str], path: Path) -> None:
    """Refuse numbers that no calibration of a sensor has, which a damaged file or another unit leaves.

    Parameters
    ----------
    model : as read.
    units : raw units of specific force and angular rate; in counts any scale may be.

    Raises
    ------
    CalibrationFileError
        If a matrix cannot be inverted, a scale factor is below 0.1 or above 10, or a bias above 1000 m/s² or rad/s.
    """
    factors = (specific_force_factor(units[0]), angular_rate_factor(units[1]))
    for name, triad, factor in zip(
        ("accelerometer", "gyroscope"), (model.accelerometer, model.gyroscope), factors, strict=True
    ):
        if triad is None:
            continue
        if not is_invertible(triad.matrix):
            raise CalibrationFileError(f"The {name}'s matrix in {path} cannot be inverted.")
        low, high = (float(np.linalg.norm(triad.matrix, -2)), float(np.linalg.norm(triad.matrix, 2)))
        scale = 1.0 if factor is None else factor
        if not (low > 0.0 and high < np.inf) or (
            factor is not None and not (_SCALES[0] <= scale * low and scale * high <= _SCALES[1])
        ):
            raise CalibrationFileError(
                f"The {name}'s scale factors in {path} are {scale * low:.3g} to {scale * high:.3g}: no sensor has "
                "such, so the file is damaged or in another unit."
            )
        if factor is not None and not np.all(np.abs(scale * triad.bias) <= _LARGEST_BIAS):
            raise CalibrationFileError(
                f"The {name}'s bias in {path} is {scale * float(np.abs(triad.bias).max()):.3g} SI units: no sensor has "
                "such, so the file is damaged or in another unit."
            )


def check_rotation(matrix: Matrix, path: Path) -> Matrix:
    """Return the gyros' matrix C_gyro_i that is a rotation.

    Raises
    ------
    CalibrationFileError
        If it is not, to 1e-3.
    """
    # No entry of a rotation is beyond one; the squares of others may be beyond any number.
    possible = bool(np.all(np.abs(matrix) < 2.0))
    if (
        not possible
        or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3)
        or np.linalg.det(matrix) < 0.0
    ):
        raise CalibrationFileError(f"gyroscopes.C_gyro_i in {path} is no rotation.")
    return matrix
