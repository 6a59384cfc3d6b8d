"""A protocol played on a simulated unit: the recording, the protocol that it follows, and the truth."""

from __future__ import annotations

import json
import math
import shutil
import time
from dataclasses import asdict, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.earth import EARTH_RATE, Site
from tumble.errors import OutputError, TumbleError, UsageError, __version__
from tumble.files import filled_folder, put_text, read_json, results_folder
from tumble.protocol import SpinStep
from tumble.recording import hash_file
from tumble.records import dataclass
from tumble.sample_rates import SampleRate
from tumble.sensor import change_frame
from tumble.simulation import EARTHS_FIELD, SessionErrors, read_errors
from tumble.workflows.given import given_site, read_played
from tumble.workflows.request import SimulateRequest, asked, check_turn_on, silent

if TYPE_CHECKING:
    from tumble.arrays import AnyArray, Matrix, Vector
    from tumble.protocol import Protocol, Step
    from tumble.recording import Recording
    from tumble.sensor import ImuModel, ThermalModel, Triad
    from tumble.simulation import (
        ChamberTruth,
        FixtureErrors,
        Grade,
        SessionErrors,
        SimulatedMagnetometer,
        ThermalGrade,
        TriadNoise,
        Truth,
    )


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


@dataclass(frozen=True)
class Played:
    """What is played on which unit, and how.

    Attributes
    ----------
    protocol, rate, site, units : what, at how many Hz, where, and what the recording is in.
    drawn_from, grade : what the unit is drawn from, and that as it is played.
    seed, unit : of the session, and of the unit.
    errors : what is wrong with the session.
    fixture, magnetometer : if there is one.
    """

    protocol: Protocol
    rate: float
    site: Site
    units: str
    drawn_from: Grade
    grade: Grade
    seed: int
    unit: int
    errors: SessionErrors
    fixture: FixtureErrors | None = None
    magnetometer: SimulatedMagnetometer | None = None


def truth_document(played: Played, recording: Recording, truth: Truth) -> dict[str, Any]:
    """Return everything that was true of a simulated recording, as plain data.

    Parameters
    ----------
    played, recording, truth : what was played, what came of it, and what was true.
    """
    from tumble.document import BACKWARD, FORWARD

    assert truth.model is not None
    errors, protocol = played.errors, played.protocol
    in_gauge, mean_gyro = _in_gauge(truth.model, "accelerometer-x"), _in_gauge(truth.model, "mean-gyro")
    return {
        "format": FORMAT,
        "version": VERSION,
        "software": f"tumble {__version__}",
        "protocol": protocol.name,
        "procedure": protocol.procedure,
        "seed": played.seed,
        "unit_seed": played.unit,
        "imu": _imu(played),
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
        "parameters": _true_parameters(truth, recording, "accelerometer-x"),
        "in_frame_mean_gyro": None if mean_gyro is None else _blocks(mean_gyro, truth),
        "parameters_in_mean_gyro": _true_parameters(truth, recording, "mean-gyro"),
        "parameters_in_fixture": _true_parameters(truth, recording, "fixture"),
        "noise": _noise(played.grade) if errors.noise else None,
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
        mean_wander=truth.mean_wander @ C_new_raw.T,
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


def _imu(played: Played) -> dict[str, Any]:
    grade = played.grade
    return {
        "grade": grade.name,
        "source": grade.source,
        "assumed": list(grade.assumed),
        "axes": grade.axes or None,
        "C_instrument_case": _numbers(grade.C_instrument_case),
        "b": "the unit's own axes, which are the recording's columns"
        if played.errors.axes == "unit"
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

    try:
        return change_frame(model, frame)
    except TumbleError:  # a left-handed unit has no such frame
        return None


def _blocks(model: ImuModel, truth: Truth) -> dict[str, Any]:
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
        "accelerometer": block(model.accelerometer, truth.mean_wander[0], None),
        "gyroscope": block(model.gyroscope, truth.mean_wander[1], model.g_sensitivity),
    }


def _true_parameters(truth: Truth, recording: Recording, frame: str) -> list[dict[str, Any]]:
    """Return name, value and unit of each parameter as the joint estimator names them in that frame.

    A bias has a ``session_value``, too: the one that it had on average over the recording.
    """
    from tumble.attitude import rotation_vector_from_matrix
    from tumble.calibration import LAYOUT, TERMS, named_function, unknowns_of
    from tumble.parameters import parameter_of

    assert truth.model is not None
    own = _in_gauge(truth.model, "accelerometer-x")
    if own is None:
        return []
    assert own.accelerometer is not None
    assert truth.model.accelerometer is not None
    unknowns = unknowns_of(own)
    C_bf = np.linalg.solve(own.accelerometer.matrix, truth.model.accelerometer.matrix)
    unknowns[LAYOUT["fixture"]] = rotation_vector_from_matrix(C_bf.astype(np.float64))
    terms = {"g_sensitivity"} if own.g_sensitivity is not None else set[str]()
    for term in TERMS.values():
        curve = getattr(getattr(own, term.of), term.curve) if term.curve else None
        # Savage's parameters have asymmetries, be they zero.
        if curve is not None or (frame == "mean-gyro" and term.curve == "asymmetry"):
            terms.add(term.name)
            unknowns[LAYOUT[term.block.name]] = 0.0 if curve is None else curve
    units = recording.specific_force_unit, recording.angular_rate_unit
    labels, named = named_function(frozenset(terms), "full", frame, units)
    session = unknowns.copy()
    session[LAYOUT["force.bias"]] += truth.mean_wander[0]
    session[LAYOUT["gyro.bias"]] += truth.mean_wander[1]
    return [
        {"name": name, "value": float(value), "unit": unit}
        | ({"session_value": float(moved)} if parameter_of(name).family.kind == "bias" else {})
        for (name, unit), value, moved in zip(labels, named(unknowns), named(session), strict=True)
    ]


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


def thermal_truth(truth: ChamberTruth, grade: ThermalGrade) -> dict[str, Any]:
    """Return the thermal block of a truth, with the names of a calibration's.

    Parameters
    ----------
    truth : the unit and its temperatures.
    grade : what it was drawn from.
    """
    from tumble.sensor import frame_rotation

    accelerometer = truth.thermal.reference.accelerometer
    in_frame = None
    if accelerometer is not None and np.linalg.det(accelerometer.matrix) > 0.0:
        C_new_b = np.real(frame_rotation(accelerometer.matrix, "accelerometer-x"))
        in_frame = _block(truth.thermal.turned(C_new_b))
    chamber = truth.chamber
    return {
        **_block(truth.thermal),
        "in_frame_accelerometer_x": in_frame,
        "unit_celsius": [float(truth.unit.min()), float(truth.unit.max())],
        "chamber": {
            "rate_k_per_s": chamber.rate,
            "time_constant_s": chamber.time_constant,
            "thermometer_noise_k": chamber.thermometer_noise,
            "thermometer_resolution_k": chamber.thermometer_resolution,
        },
        "source": grade.source,
        "assumed": list(grade.assumed),
    }


def _block(model: ThermalModel) -> dict[str, Any]:
    return {
        "basis": {
            "kind": model.basis.kind,
            "reference_celsius": model.basis.reference_celsius,
            "nodes_celsius": model.basis.nodes.tolist(),
            "order": model.basis.order,
        },
        "parameters": dict(zip(model.names, model.vector().tolist(), strict=True)),
        "lag_s": model.lag,
        "hysteresis_width_k": model.hysteresis_width,
    }


def require_place(folder: Path) -> None:
    """Refuse before the work what would fail after it, and never write over what was not simulated.

    Parameters
    ----------
    folder : where the files are to be.

    Raises
    ------
    UsageError
        If it holds something that was not simulated.
    OutputError
        If it cannot be made or written to.
    """
    results_folder(folder)
    precious = [name for name in ("recording.csv", "protocol.yaml") if (folder / name).exists()]
    if precious and not (folder / "truth.json").exists():
        raise UsageError(
            f"{folder} holds a {precious[0]} that was not simulated, for there is no truth.json beside it: "
            "give another folder with -o."
        )
    if (folder / "truth.json").exists() and not _earlier(folder):
        raise UsageError(f"{folder / 'truth.json'} is not of `tumble simulate`: give another folder with -o.")


def _earlier(folder: Path) -> dict[str, Any]:
    """The truth of an earlier simulation in the folder; empty where there is none."""
    try:
        found: Any = read_json(folder / "truth.json")
    except (OSError, ValueError):
        return {}
    if not isinstance(found, dict):
        return {}
    document = cast("dict[str, Any]", found)
    return document if document.get("format") == FORMAT else {}


def write_simulation(
    folder: Path,
    protocol: Protocol,
    recording: Recording,
    document: dict[str, Any],
) -> tuple[list[Path], Path | None]:
    """Write all into a folder inside the folder, then rename it into place; return the files, and what is kept.

    What was simulated there before, if it is another simulation, is kept as the folder ``before-IDENTITY``.

    Parameters
    ----------
    folder, protocol, recording, document : what is written, and where.

    Raises
    ------
    OutputError
        If they cannot be written; earlier ones are intact.
    """
    from tumble.recording import write_recording

    try:
        with filled_folder(folder) as beside:
            name = write_recording(recording, beside / "recording.csv").name
            document["recordings"] = [name]
            names = [name, *_write_texts(replace(protocol, recordings=(name,)), document, beside)]
            kept = _keep_another(folder, beside)
    except (OSError, OutputError) as error:
        # A writer below has turned the system's error into a sentence about a name that nobody knows.
        cause = error.__cause__ if isinstance(error, OutputError) else error
        words = cause.strerror if isinstance(cause, OSError) and cause.strerror else str(cause or error)
        raise OutputError(f"The simulated recording could not be written to {folder}: {words}.") from error
    return [folder / name for name in names], kept


def _keep_another(folder: Path, beside: Path) -> Path | None:
    """Keep what was simulated in the folder before, if it is another simulation; return where it will stand."""
    truth = folder / "truth.json"
    if not truth.exists() or truth.read_bytes() == (beside / truth.name).read_bytes():
        return None
    kept = folder / f"before-{hash_file(truth).sha256[:12]}"
    if not kept.exists():
        (beside / kept.name).mkdir()
        for name in ("recording.csv", "protocol.yaml", truth.name):
            if (folder / name).exists():
                _put_again(folder / name, beside / kept.name / name)
    return kept


def _put_again(file: Path, place: Path) -> None:
    try:
        place.hardlink_to(file)
    except OSError:  # a disk that knows no second name of a file
        shutil.copyfile(file, place)


def _write_texts(protocol: Protocol, document: dict[str, Any], beside: Path) -> list[str]:
    from tumble.protocol import protocol_to_yaml

    texts = {
        "protocol.yaml": protocol_to_yaml(protocol),
        "truth.json": json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        put_text(beside / name, text)
    return list(texts)


# Where a protocol is played that names no place: nobody's, and said.
DEFAULT_LATITUDE = math.radians(45.0)
# Two hours and three quarters at 2 kHz, or 2.5 GB of memory.
LARGEST_SAMPLES = 20_000_000
# A unit in a chamber changes within minutes, and a test takes hours. Hz; stamps 0.1 s apart could be milliseconds.
CHAMBER_RATE = 12.5
UNITS = ("SI", "counts")
# A stream of random numbers for each, by its place.
_STREAMS = ("unit", "session", "fixture", "thermal", "turn-on", "magnetometer", "field", "current")


@dataclass
class Simulated:
    """What `simulate` wrote: the folder, its files, the truth, sentences for the user, seconds by stage."""

    folder: Path
    files: list[Path]
    truth: dict[str, Any]
    remarks: list[str]
    seconds: dict[str, float] = field(default_factory=dict[str, float])


@asked(SimulateRequest)
def simulate(request: SimulateRequest) -> Simulated:
    """Play a protocol on a simulated unit, and write recording, protocol and truth into one folder.

    ``tumble calibrate --protocol FOLDER/protocol.yaml`` then needs nothing else, and never reads the
    truth. Another simulation that was in the folder is kept in it as ``before-IDENTITY``; anything else there is left
    alone.

    Raises
    ------
    UsageError, ProtocolError, SiteError
        If an option or the protocol is wrong.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.simulation import find_grade, has_chamber

    say, began = request.progress or silent, time.perf_counter()
    given, chosen = read_played(request.protocol, request.duration), find_grade(request.grade)
    errors, seed, units = request.errors, request.seed, request.units
    wrong = (
        errors if isinstance(errors, SessionErrors) else read_errors(errors) if errors else SessionErrors()
    )
    remarks = _check_terms(chosen, wrong)
    place = _place(given, request.site, wrong, remarks)
    usual = given.rate or (CHAMBER_RATE if has_chamber(given) else chosen.rate)
    hertz = usual if request.rate is None else request.rate
    if has_chamber(given):
        _check_chamber(units, wrong)
    _check(request, hertz, given)
    folder = Path(f"{given.name}-simulated" if request.output is None else request.output)
    require_place(folder)
    say("playing the protocol")
    drawn = chosen.with_wandering_biases() if wrong.wander else chosen
    unit = seed if request.unit is None else request.unit
    played = Played(given, hertz, place, units, chosen, drawn, seed, unit, wrong)
    model = _drawn_unit(played, request.turn_on)
    played = replace(played, magnetometer=_magnetometer(request.magnetometer, played))
    if wrong.fixture is not None:
        aimed, fixture = (
            _aimed(given, wrong.fixture_azimuth),
            wrong.fixture.drawn(_generator(seed, "fixture")),
        )
        played = replace(played, protocol=aimed, fixture=fixture)
    recording, truth, document = _play(played, model)
    simulated = time.perf_counter()
    say("writing")
    shown = _as_played(played, truth, given.site if request.site is None else None)
    files, kept = write_simulation(folder, shown, recording, document)
    if kept is not None:
        remarks.append(f"What was simulated there before is another simulation, and kept in {kept}.")
    seconds = {"simulating": simulated - began, "writing": time.perf_counter() - simulated}
    return Simulated(folder, files, document, remarks, seconds)


def _place(given: Protocol, site: Site | None, errors: SessionErrors, remarks: list[str]) -> Site:
    """Where it is played; what is assumed, or changes nothing, is remarked on."""
    place = given_site(site) or given.site
    if place is None:
        place = Site.from_latitude(DEFAULT_LATITUDE, 0.0)
        remarks.append("No site was given: it is played at latitude 45°, height 0 m; --site says another.")
    elif place.latitude is not None and place.height is None and place.source.startswith("normal"):
        # Where it is played is known.
        place = Site.from_latitude(place.latitude, 0.0)
    if errors.table is not None and not any(isinstance(step, SpinStep) for step in given.steps):
        remarks.append(
            f"The protocol {given.name} has no spins: what is wrong with the table changes nothing."
        )
    return place


def _play(played: Played, model: ImuModel) -> tuple[Recording, Truth, dict[str, Any]]:
    """The recording, what was true, and the document that says so."""
    from tumble.simulation import find_thermal_grade, has_chamber, simulate_protocol

    inside, errors = None, played.errors
    if has_chamber(played.protocol):
        recording, truth, inside = _in_chamber(played, model)
    else:
        recording, truth = simulate_protocol(
            played.protocol,
            played.rate,
            _generator(played.seed, "session"),
            site=played.site,
            grade=played.grade,
            model=model,
            noise=errors.noise,
            imperfections=errors.imperfections,
            placement=errors.placement,
            heading=errors.fixture_azimuth,
            lever_arm_b=errors.lever_arm_b,
            table=errors.table,
            fixture=played.fixture,
            units=played.units,
            magnetometer=None
            if played.magnetometer is None
            else (played.magnetometer, _generator(played.seed, "field")),
        )
    case = played.drawn_from.C_instrument_case
    if errors.axes == "case" and case is not None:
        truth = read_in_other_axes(truth, case.T)
    document = truth_document(played, recording, truth)
    if played.magnetometer is not None:
        document["magnetometer"] = magnetometer_truth(played.magnetometer, truth)
    if inside is not None:
        document["thermal"] = thermal_truth(inside, find_thermal_grade(played.drawn_from.name))
    return recording, truth, document


def _as_played(played: Played, truth: Truth, stated: Site | None) -> Protocol:
    """The protocol to calibrate with: as it was played, and how the recording is read.

    What it states of its place and of its clock stays, for whoever has it believes no more than that.
    """
    columns, given, case = None, played.protocol, played.drawn_from.C_instrument_case
    share = (given.rate.relative or 0.0) if isinstance(given.rate, SampleRate) else 0.0
    if played.errors.axes == "case" and case is not None:
        # Read by these columns, the recording is in the axes that the poses are of.
        columns = case_columns(case)
    return replace(
        played.protocol,
        steps=tuple(_exact(step) for step in truth.steps),
        site=stated or played.site,
        recordings=(),
        # The stamps of a simulation are true.
        rate=SampleRate(played.rate, played.rate * share),
        columns=columns,
        units="counts" if played.units == "counts" else "m/s^2,rad/s,s",
    )


def _exact(step: Step) -> Step:
    """A table of which nobody says how well it keeps its rate was simulated as an exact one."""
    return replace(step, sigma=0.0) if isinstance(step, SpinStep) and step.sigma is None else step


def _check_chamber(units: str, errors: SessionErrors) -> None:
    """Refuse what is not simulated in a chamber."""
    if units != "SI":
        raise UsageError(
            "--output-units counts: a unit in a chamber is simulated in SI; leave the option out."
        )
    if any(one is not None for one in (errors.table, errors.fixture, errors.lever_arm_b)):
        raise UsageError(
            "The protocol has soaks or ramps, and there is no table in this chamber: take its errors out of the file."
        )


def _in_chamber(played: Played, model: ImuModel) -> tuple[Recording, Truth, ChamberTruth]:
    """Record a unit that changes with temperature; without noise its thermometer has none either."""
    from tumble.simulation import Chamber, find_thermal_grade, simulate_chamber

    grade, noise = find_thermal_grade(played.drawn_from.name), played.errors.noise
    return simulate_chamber(
        played.protocol,
        played.rate,
        _generator(played.seed, "session"),
        site=played.site,
        thermal=grade.simulate_model(model, _generator(played.unit, "thermal")),
        chamber=Chamber(
            thermometer_noise=grade.thermometer_noise if noise else 0.0,
            thermometer_resolution=grade.thermometer_resolution if noise else 0.0,
        ),
        grade=played.grade if noise else None,
        imperfections=played.errors.imperfections,
        placement=played.errors.placement,
    )


def _magnetometer(name: str | None, played: Played) -> SimulatedMagnetometer | None:
    """The magnetometer of the unit, if it has one; a current changes the field in a direction of the session's own."""
    errors = played.errors
    if name is None:
        if errors.magnetic_field or errors.field_change:
            raise UsageError("The file of errors has a magnetic field: give --magnetometer, too.")
        return None
    if errors.axes == "case":
        raise UsageError(
            "axes: case: a magnetometer is simulated along the axes of the unit; leave one of them out."
        )
    from tumble.simulation import SimulatedMagnetometer, find_magnetometer

    grade = find_magnetometer(name)
    triad = grade.simulate_triad(_generator(played.unit, "magnetometer"))
    direction = _generator(played.seed, "current").standard_normal(3)
    size, since = errors.field_change or (0.0, math.inf)
    current = size * direction / np.linalg.norm(direction)
    field = errors.magnetic_field or EARTHS_FIELD
    return SimulatedMagnetometer(grade, triad, *field, errors.noise, current, since)


def _generator(seed: int, what: str) -> np.random.Generator:
    """A stream of its own for unit, session and fixture; SFC64 is the fastest that numpy has."""
    number = _STREAMS.index(what)
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(number,))))


def _drawn_unit(played: Played, turn_on: tuple[float, float]) -> ImuModel:
    """The unit with the biases of this session."""
    errors = played.errors
    model = played.drawn_from.simulate_model(
        _generator(played.unit, "unit"),
        nonlinear=errors.nonlinear,
        case_axes=errors.axes == "case",
        asymmetry=errors.asymmetry,
    )
    check_turn_on(turn_on)
    if turn_on == (0.0, 0.0):
        return model
    rng, force, rate = _generator(played.seed, "turn-on"), model.accelerometer, model.gyroscope
    assert force is not None
    assert rate is not None
    return replace(
        model,
        accelerometer=replace(force, bias=force.bias + rng.normal(0.0, turn_on[0], 3)),
        gyroscope=replace(rate, bias=rate.bias + rng.normal(0.0, turn_on[1], 3)),
    )


def _aimed(protocol: Protocol, azimuth: float | None) -> Protocol:
    """Return the protocol with all its headings turned so that the fixture's outer axis points there."""
    from tumble.protocol import HoldStep
    from tumble.simulation import fixture_angles

    now = fixture_angles(protocol).azimuth
    if azimuth is None or now is None:
        return protocol
    steps: list[Step] = []
    for step in protocol.steps:
        if isinstance(step, HoldStep) and step.pose is not None and step.pose.heading is not None:
            turned = math.remainder(step.pose.heading + azimuth - now, 2.0 * math.pi)
            step = replace(step, pose=replace(step.pose, heading=turned))
        steps.append(step)
    return replace(protocol, steps=tuple(steps))


def _check_terms(grade: Grade, errors: SessionErrors) -> list[str]:
    """Refuse or remark on what the grade's sheet does not state."""
    if errors.axes == "case" and grade.C_instrument_case is None:
        raise UsageError(
            f"axes: case: no source says how the axes of the grade {grade.name} lie in its case; hg1700 and hg1900 do."
        )
    triads = (grade.accelerometer, grade.gyroscope)
    remarks: list[str] = []
    if errors.nonlinear and not any(triad.linearity for triad in triads):
        remarks.append(f"The sheet of {grade.name} states no linearity: nonlinear changes nothing.")
    if errors.wander and not any(triad.bias_stability for triad in triads):
        remarks.append(f"The sheet of {grade.name} states no in-run stability: wander changes nothing.")
    return remarks


def _check(request: SimulateRequest, rate: float, protocol: Protocol) -> None:
    if request.units not in UNITS:
        raise UsageError(f"--output-units {request.units}: a simulated recording is in {' or '.join(UNITS)}.")
    for name, value in (("seed", request.seed), ("unit-seed", request.unit)):
        if value is not None and value < 0:
            raise UsageError(f"--{name} {value}: a seed is a whole number from 0 on.")
    if not 1.0 <= rate <= 20_000.0:
        raise UsageError(f"--sample-rate {rate:g}: the sampling rate is in Hz, from 1 to 20000.")
    samples = protocol.duration * rate
    if samples > LARGEST_SAMPLES:
        raise UsageError(
            f"The protocol lasts {protocol.duration:.10g} s, which is {samples:.3g} samples at {rate:g} Hz: "
            f"at most {LARGEST_SAMPLES:,} are simulated; give a lower --sample-rate."
        )
