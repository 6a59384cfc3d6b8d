"""What was simulated, as a document: ``truth.json`` has the keys of ``calibration.json``."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

import tumble
from tumble.earth import EARTH_RATE, Site
from tumble.errors import TumbleError
from tumble.records import dataclass
from tumble.sensor.gauge import change_frame

if TYPE_CHECKING:
    from tumble.arrays import AnyArray, Matrix, Vector
    from tumble.protocol import Protocol, Step
    from tumble.recording import Recording
    from tumble.sensor import ImuModel, Triad
    from tumble.simulation import Grade, TriadNoise, Truth
    from tumble.simulation.errors import SessionErrors
    from tumble.simulation.magnetometer import SimulatedMagnetometer

FORMAT = "tumble truth"
VERSION = 1
FRAME = (
    "axes of the fixture: the body frame b in which the protocol states its poses; a calibration in another "
    "frame differs by one common rotation, which in_frame_accelerometer_x has taken out"
)
_NOISE = {
    "random_walk": ("{u}/sqrt(Hz)", "N of IEEE Std 952 (two-sided density)"),
    "bias_instability": ("{u}", "B of IEEE Std 952: flicker whose Allan floor is 0.664 B"),
    "rate_random_walk": ("{u}*sqrt(Hz)", "K of IEEE Std 952"),
    "resolution": ("{u}", "step of the converter; 0 for none"),
    "full_scale": ("{u}", "limit of the converter; null for none"),
}


@dataclass(frozen=True, slots=True)
class Settings:
    """How it was simulated, beside the protocol.

    Attributes
    ----------
    grade : what the unit was drawn from, as it was played.
    seed, unit : of the session, and of the unit.
    errors : what was wrong with the session.
    """

    grade: Grade
    seed: int
    unit: int
    errors: SessionErrors


def truth_document(
    protocol: Protocol, recording: Recording, truth: Truth, settings: Settings
) -> dict[str, Any]:
    """Return everything that was true of a simulated recording, as plain data.

    Parameters
    ----------
    protocol, recording, truth : what was played, what came of it, and what was true.
    settings : how.
    """
    from tumble.document.result import BACKWARD, FORWARD

    assert truth.model is not None
    errors = settings.errors
    in_gauge, mean_gyro = _in_gauge(truth.model, "accelerometer-x"), _in_gauge(truth.model, "mean-gyro")
    return {
        "format": FORMAT,
        "version": VERSION,
        "software": f"tumble {tumble.__version__}",
        "protocol": protocol.name,
        "procedure": protocol.procedure,
        "seed": settings.seed,
        "unit_seed": settings.unit,
        "imu": _imu(settings),
        "site": _site(truth.site),
        "frame": {"name": "fixture", "description": FRAME},
        "raw_units": {
            "specific_force": recording.specific_force_unit,
            "angular_rate": recording.angular_rate_unit,
        },
        "counts_per_si": _numbers(truth.counts_per_si),
        "rate_hz": recording.rate,
        "samples": len(recording),
        "formula": FORWARD,
        "inverse_formula": BACKWARD,
        **_blocks(truth.model, truth),
        "in_frame_accelerometer_x": None if in_gauge is None else _blocks(in_gauge, truth),
        "parameters": [] if in_gauge is None else _true_parameters(in_gauge, recording, truth),
        "in_frame_mean_gyro": None if mean_gyro is None else _blocks(mean_gyro, truth),
        "parameters_in_mean_gyro": []
        if mean_gyro is None
        else _true_mean_gyro_parameters(mean_gyro, recording, truth),
        "parameters_in_fixture": _true_fixture_parameters(truth.model, recording, truth),
        "noise": _noise(settings.grade) if errors.noise else None,
        "placement": errors.placement,
        "imperfections": asdict(errors.imperfections),
        "table": None if errors.table is None else asdict(errors.table),
        "fixture": None if truth.fixture is None else asdict(truth.fixture),
        "lever_arm_b": _numbers(errors.lever_arm_b),
        "steps": [_step(number, step, truth) for number, step in enumerate(protocol.steps)],
    }


def magnetometer_truth(magnetometer: SimulatedMagnetometer, truth: Truth) -> dict[str, Any]:
    """Return what was true of a simulated magnetometer and of the field.

    Parameters
    ----------
    magnetometer, truth : on the unit, and what was true of that.
    """
    assert truth.model is not None
    of_unit = change_frame(
        replace(truth.model, magnetometer=magnetometer.triad), "accelerometer-x"
    ).magnetometer
    assert of_unit is not None
    change = magnetometer.current
    return {
        "grade": magnetometer.grade.name,
        "raw_unit": "uT",
        "unit": "T",
        "matrix": _numbers(magnetometer.triad.matrix),
        "bias": _numbers(magnetometer.triad.bias),
        "in_frame_accelerometer_x": {"matrix": _numbers(of_unit.matrix), "bias": _numbers(of_unit.bias)},
        "field": {
            "norm": magnetometer.norm,
            "dip_deg": math.degrees(magnetometer.dip),
            "declination_deg": math.degrees(magnetometer.declination),
            "change_n": None if not np.any(change) else _numbers(change),
            "change_at": None if not np.any(change) else magnetometer.since,
        },
    }


def case_columns(C_instrument_case: Matrix) -> str:
    """Return the columns of a recording in the unit's own axes, named for the axes of its case.

    Parameters
    ----------
    C_instrument_case : (3, 3) whose rows are axes of the case, with sign.

    Examples
    --------
    The unit's x axis is up, its y axis forward, its z axis left:

    >>> case_columns(np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
    't,-az,ax,-ay,-gz,gx,-gy'
    """
    names = ["t"]
    for letter in "ag":
        for row in C_instrument_case:
            axis = int(np.argmax(np.abs(row)))
            names.append(f"{'-' if row[axis] < 0.0 else ''}{letter}{'xyz'[axis]}")
    return ",".join(names)


def read_in_other_axes(truth: Truth, C_new_raw: Matrix) -> Truth:
    """Return what was true of the columns as they are read, taken in another order and with other signs.

    Parameters
    ----------
    truth : of the columns as they are.
    C_new_raw : (3, 3) each row one column, with sign.
    """
    assert truth.model is not None
    sensitivity = truth.model.g_sensitivity
    return replace(
        truth,
        model=replace(
            truth.model,
            accelerometer=_reordered(truth.model.accelerometer, C_new_raw),
            gyroscope=_reordered(truth.model.gyroscope, C_new_raw),
            g_sensitivity=None if sensitivity is None else C_new_raw @ sensitivity,
        ),
        force_wander=truth.force_wander @ C_new_raw.T,
        rate_wander=truth.rate_wander @ C_new_raw.T,
    )


def _reordered(triad: Triad | None, C_new_raw: Matrix) -> Triad | None:
    """Terms even in u change their sign with the sensor's: raw = u + q u² is -raw = (-u) - q (-u)²."""
    if triad is None:
        return None
    return replace(
        triad,
        matrix=C_new_raw @ triad.matrix,
        bias=C_new_raw @ triad.bias,
        **{name: C_new_raw @ size for name, _, size in triad.curves()},
    )


def _imu(settings: Settings) -> dict[str, Any]:
    grade = settings.grade
    return {
        "grade": grade.name,
        "source": grade.source,
        "assumed": list(grade.assumed),
        "axes": grade.axes or None,
        "C_instrument_case": _numbers(grade.C_instrument_case),
        "b": "the unit's own axes, which are the recording's columns"
        if settings.errors.axes == "unit"
        else "the case's axes: forward, right, down; raw is the columns as protocol.yaml reads them",
    }


def _site(site: Site) -> dict[str, Any]:
    return {
        "latitude_deg": None if site.latitude is None else math.degrees(site.latitude),
        "height_m": site.height,
        "gravity": site.gravity,
        "gravity_source": site.source,
        "earth_rate": 0.0 if site.latitude is None else EARTH_RATE,
    }


def _in_gauge(model: ImuModel, frame: str) -> ImuModel | None:
    from tumble.sensor import change_frame

    try:
        return change_frame(model, frame)
    except TumbleError:  # a left-handed unit has no such frame
        return None


def _mean_wander(truth: Truth) -> tuple[Vector, Vector]:
    """How far the biases of the accelerometers and the gyros had wandered, (3,) raw, on average over the holds."""
    seen = np.all(np.isfinite(truth.force_wander), axis=1)
    weight = (truth.hold_edges[:, 1] - truth.hold_edges[:, 0]) * seen
    if not weight.sum() > 0.0:
        return np.zeros(3), np.zeros(3)
    force, rate = (
        np.average(wander[seen], axis=0, weights=weight[seen])
        for wander in (truth.force_wander, truth.rate_wander)
    )
    return force, rate


def _blocks(model: ImuModel, truth: Truth) -> dict[str, Any]:
    force_wander, rate_wander = _mean_wander(truth)

    def block(triad: Triad | None, wander: Vector, g_sensitivity: AnyArray | None) -> dict[str, Any] | None:
        if triad is None:
            return None
        return {
            "matrix": _numbers(triad.matrix),
            "bias": _numbers(triad.bias),
            "session_bias": _numbers(triad.bias + wander),
            "asymmetry": _numbers(triad.asymmetry),
            "quadratic": _numbers(triad.quadratic),
            "g_sensitivity": _numbers(g_sensitivity),
        }

    return {
        "accelerometer": block(model.accelerometer, force_wander, None),
        "gyroscope": block(model.gyroscope, rate_wander, model.g_sensitivity),
    }


def _true_parameters(model: ImuModel, recording: Recording, truth: Truth) -> list[dict[str, Any]]:
    """Return name, value and unit of each parameter, named as ``calibration.json`` names them.

    A bias has a ``session_value``, too: the one that this recording's holds had on average.
    """
    from tumble.sensor.conventions.shin import shin_from_matrix
    from tumble.sensor.gauge import inverse, lower_factor
    from tumble.units import angular_rate_factor, specific_force_factor

    rows: list[dict[str, Any]] = []

    def add(names: list[str], values: AnyArray, unit: str) -> None:
        rows.extend(
            {"name": name, "value": float(np.real(value)), "unit": unit}
            for name, value in zip(names, np.ravel(values), strict=True)
        )

    def triad(
        prefix: str, own: AnyArray, biases: tuple[Vector, Vector], unit: str, factor: float | None, si: str
    ) -> None:
        scale, angles = shin_from_matrix(own)
        bias, wander = biases
        add([f"{prefix} bias {axis}" for axis in "xyz"], bias, unit)
        for row, session in zip(rows[-3:], bias + wander, strict=True):
            row["session_value"] = float(session)
        if factor is None:
            add([f"{prefix} scale factor {axis}" for axis in "xyz"], scale, f"{unit}/({si})")
        else:
            add([f"{prefix} scale factor error {axis}" for axis in "xyz"], scale * factor - 1.0, "1")
        add([f"{prefix} non-orthogonality {angle}" for angle in ("yz", "zx", "zy")], angles, "rad")

    force, gyro = model.accelerometer, model.gyroscope
    force_wander, rate_wander = _mean_wander(truth)
    assert force is not None
    assert gyro is not None
    unit = recording.specific_force_unit
    triad(
        "accelerometer", force.matrix, (force.bias, force_wander), unit, specific_force_factor(unit), "m/s²"
    )
    if force.asymmetry is not None:
        add([f"accelerometer asymmetry {axis}" for axis in "xyz"], force.asymmetry, "1")
    if force.quadratic is not None:
        add([f"accelerometer quadratic {axis}" for axis in "xyz"], force.quadratic, f"1/({unit})")
    own = np.real(lower_factor(gyro.matrix))
    unit = recording.angular_rate_unit
    triad("gyro", own, (gyro.bias, rate_wander), unit, angular_rate_factor(unit), "rad/s")
    from tumble.attitude.rotations import rotation_vector_from_matrix

    between = rotation_vector_from_matrix(np.real(inverse(own) @ gyro.matrix))
    if gyro.asymmetry is not None:
        add([f"gyro asymmetry {axis}" for axis in "xyz"], gyro.asymmetry, "1")
    add([f"rotation between the triads {axis}" for axis in "xyz"], between, "rad")
    return rows + _g_sensitivity_rows(model, unit)


def _g_sensitivity_rows(model: ImuModel, unit: str) -> list[dict[str, Any]]:
    if model.g_sensitivity is None:
        return []
    names = [f"g-sensitivity of gyro {a} to force {b}" for a in "xyz" for b in "xyz"]
    return [
        {"name": name, "value": float(value), "unit": f"{unit}/(m/s²)"}
        for name, value in zip(names, np.ravel(model.g_sensitivity), strict=True)
    ]


def _true_fixture_parameters(model: ImuModel, recording: Recording, truth: Truth) -> list[dict[str, Any]]:
    """Return the same as procedures name it that answer in the frame ``fixture``."""
    from tumble.calibration.canonical import FIXTURE_UNKNOWNS, describe_fixture_triad
    from tumble.units import angular_rate_factor, specific_force_factor

    force_unit, rate_unit = recording.specific_force_unit, recording.angular_rate_unit
    of_triads = (
        ("accelerometer", model.accelerometer, force_unit, specific_force_factor(force_unit)),
        ("gyroscope", model.gyroscope, rate_unit, angular_rate_factor(rate_unit)),
    )
    rows: list[dict[str, Any]] = []
    for (kind, triad, unit, factor), wander in zip(of_triads, _mean_wander(truth), strict=True):
        assert triad is not None
        nothing = np.zeros(3)
        terms = {"asymmetry": triad.asymmetry, "quadratic": triad.quadratic}
        told = describe_fixture_triad(
            kind,
            np.concatenate(
                [triad.matrix.ravel(), triad.bias, *(nothing if t is None else t for t in terms.values())]
            ),
            np.zeros((FIXTURE_UNKNOWNS, FIXTURE_UNKNOWNS)),
            known=np.ones((3, 3), dtype=bool),
            unit=unit,
            factor=factor,
            terms=frozenset(name for name, term in terms.items() if term is not None),
        )
        of_triad = [{"name": p.name, "value": p.value, "unit": p.unit} for p in told.parameters]
        for row, session in zip(of_triad[:3], triad.bias + wander, strict=True):
            row["session_value"] = float(session)
        rows += of_triad
    return rows + _g_sensitivity_rows(model, rate_unit)


def _true_mean_gyro_parameters(model: ImuModel, recording: Recording, truth: Truth) -> list[dict[str, Any]]:
    """Return the same as the strapdown rotation test names it, in the frame ``mean-gyro``."""
    from tumble.sensor.conventions.savage import OFF_DIAGONAL, PAIRS
    from tumble.units import angular_rate_factor, specific_force_factor

    force_unit, rate_unit = recording.specific_force_unit, recording.angular_rate_unit
    rows: list[dict[str, Any]] = []

    def add(name: str, axes: list[str], values: list[float], unit: str) -> None:
        rows.extend(
            {"name": f"{name} {axis}", "value": float(value), "unit": unit}
            for axis, value in zip(axes, values, strict=True)
        )

    for short, triad, unit, factor, si, wander in (
        (
            "accelerometer",
            model.accelerometer,
            force_unit,
            specific_force_factor(force_unit),
            "m/s²",
            _mean_wander(truth)[0],
        ),
        ("gyro", model.gyroscope, rate_unit, angular_rate_factor(rate_unit), "rad/s", _mean_wander(truth)[1]),
    ):
        assert triad is not None
        add(f"{short} bias", [*"xyz"], [*triad.bias], unit)
        for row, session in zip(rows[-3:], triad.bias + wander, strict=True):
            row["session_value"] = float(session)
        scale = np.diag(triad.matrix)
        if factor is None:
            add(f"{short} scale factor", [*"xyz"], [*scale], f"{unit}/({si})")
        else:
            add(f"{short} scale factor error", [*"xyz"], [*(scale * factor - 1.0)], "1")
        # Of counts each sensor's angle is against its own scale factor.
        angles = (triad.matrix.T / (scale if factor is None else 1.0 / factor)).T
        if short == "gyro":
            values = [angles[i, j] + angles[j, i] for i, j in PAIRS]
            add("gyro non-orthogonality", ["xyz"[i] + "xyz"[j] for i, j in PAIRS], values, "rad")
        else:
            values = [angles[i, j] for i, j in OFF_DIAGONAL]
            add("accelerometer misalignment", ["xyz"[i] + "xyz"[j] for i, j in OFF_DIAGONAL], values, "rad")
        asymmetry = np.zeros(3) if triad.asymmetry is None else triad.asymmetry
        add(f"{short} asymmetry", [*"xyz"], [*asymmetry], "1")
    return rows + _g_sensitivity_rows(model, rate_unit)


def _noise(grade: Grade) -> dict[str, Any]:
    """Return the noise coefficients, in SI whatever the recording's unit is."""

    def block(noise: TriadNoise, unit: str) -> dict[str, Any]:
        values = asdict(noise)
        return {
            name: {"value": _finite(values[name]), "unit": form.format(u=unit), "definition": words}
            for name, (form, words) in _NOISE.items()
        }

    return {
        "accelerometer": block(grade.accelerometer.noise, "m/s^2"),
        "gyroscope": block(grade.gyroscope.noise, "rad/s"),
    }


def _step(number: int, step: Step, truth: Truth) -> dict[str, Any]:
    """Return when a step was, and what was true in it: the pose of a hold, rate and axis of what turned."""
    start, stop = truth.step_edges[number]
    result: dict[str, Any] = {
        "step": number + 1,
        "kind": type(step).__name__.removesuffix("Step").lower(),
        "name": step.name,
        "start_s": _finite(start),
        "stop_s": _finite(stop),
    }
    if number in truth.hold_steps:
        hold = truth.hold_steps.index(number)
        rotation_nb = truth.rotations_nb[hold]
        result |= {
            "quaternion_nb": _numbers(rotation_nb.as_quat()),
            "up_b": _numbers(rotation_nb.inv().apply([0.0, 0.0, -1.0])),
            "specific_force": _numbers(truth.specific_force_b[hold]),
            "angular_rate": _numbers(truth.angular_rate_ib_b[hold]),
            "accelerometer_wander": _numbers(truth.force_wander[hold]),
            "gyroscope_wander": _numbers(truth.rate_wander[hold]),
        }
    rotations = [rotation for rotation in truth.rotations if rotation.step == number]
    if rotations:
        result["rotations"] = [
            {
                "fixture_axis": rotation.axis,
                "start_s": _finite(rotation.start),
                "stop_s": _finite(rotation.stop),
                "angle": rotation.angle,
                "axis_b": _numbers(rotation.axis_b),
            }
            for rotation in rotations
        ]
    for spin in truth.spins:
        if spin.step == number:
            result |= {
                "rate": spin.rate,
                "axis_b": _numbers(spin.axis_b),
                "axis_n": _numbers(spin.axis_n),
                "angle": spin.angle,
                "shown_angle": spin.shown,
                "ramps_s": _numbers(spin.ramps),
            }
    return result


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _numbers(values: Any) -> Any:
    """Return an array as lists of plain numbers; what is not finite is null."""
    if values is None:
        return None
    if np.ndim(values) == 0:
        return _finite(float(values))
    return [_numbers(value) for value in values]
