"""A protocol played on a simulated unit: the recording, the protocol that it follows, and the truth."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import tumble
from tumble.earth import EARTH_RATE, Site
from tumble.errors import OutputError, UsageError
from tumble.workflows.protocols import read_given_protocol

if TYPE_CHECKING:
    from tumble.protocol import Protocol, Step
    from tumble.recording import Recording
    from tumble.sensor import ImuModel
    from tumble.simulation import Grade, Imperfections, Truth

DEFAULT_GRADE = "consumer-mems"
# Where a protocol is played that names no place: nobody's, and said.
DEFAULT_LATITUDE = np.radians(45.0)
LARGEST_SAMPLES = 50_000_000
UNITS = ("SI", "counts")


@dataclass(frozen=True, slots=True)
class Simulated:
    """What `simulate` wrote: the folder, its files, the truth, and sentences for the user."""

    folder: Path
    files: list[Path]
    truth: dict[str, Any]
    remarks: list[str]


def simulate(
    protocol: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    grade: str = DEFAULT_GRADE,
    seed: int = 0,
    site: Site | None = None,
    rate: float | None = None,
    units: str = "SI",
    per_step: bool = False,
    placement: bool = True,
    noise: bool = True,
    imperfections: Imperfections | None = None,
    progress: Callable[[str], None] | None = None,
) -> Simulated:
    """Play a protocol on a simulated unit, and write recording, protocol and truth into one folder.

    ``tumble calibrate --protocol FOLDER/protocol.yaml`` then needs nothing else, and never reads the
    truth.

    Parameters
    ----------
    protocol : a protocol file, or the name of one.
    output : the folder; by default the protocol's name with ``-simulated``.
    grade : name of one of `tumble.simulation.GRADES`.
    seed : of all random numbers; the same seed gives the same files bit for bit.
    site : where it is played; None takes the protocol's, or latitude 45°, height 0.
    rate : Hz; None takes the grade's usual one.
    units : "SI" or "counts" of the recording.
    per_step : one file for each hold and each spin instead of one for all.
    placement : make the placement errors that the protocol's uncertainties allow.
    noise : add noise and converter.
    imperfections : what the recording chain does.
    progress : is told in words what is being done.

    Raises
    ------
    UsageError, ProtocolError, SiteError
        If an option or the protocol is wrong.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.simulation import find_grade, simulate_protocol

    say = progress or _silent
    given = read_given_protocol(protocol).protocol
    chosen = find_grade(grade)
    remarks: list[str] = []
    place = site or given.site
    if place is None:
        place = Site.from_latitude(DEFAULT_LATITUDE)
        remarks.append("No site was given: it is played at latitude 45°, height 0 m (--site says another).")
    hertz = rate or given.rate or chosen.rate
    _check(units, seed, hertz, given)
    folder = Path(output) if output is not None else Path(f"{given.name}-simulated")
    say("playing the protocol")
    recording, truth = simulate_protocol(
        given,
        hertz,
        np.random.default_rng(seed),
        site=place,
        grade=chosen,
        noise=noise,
        imperfections=imperfections,
        placement=placement,
        units=units,
    )
    document = truth_document(given, recording, truth, chosen if noise else None, chosen, seed)
    played = replace(given, site=place, recordings=(), rate=None, columns=None, units=None)
    say("writing")
    files = _write(folder, played, recording, truth, document, per_step)
    return Simulated(folder, files, document, remarks)


def _check(units: str, seed: int, rate: float, protocol: Protocol) -> None:
    if units not in UNITS:
        raise UsageError(f"--units {units}: a simulated recording is in {' or '.join(UNITS)}.")
    if seed < 0:
        raise UsageError(f"--seed {seed}: a seed is a whole number from 0 on.")
    if not 1.0 <= rate <= 20_000.0:
        raise UsageError(f"--rate {rate:g}: the sampling rate is in Hz, from 1 to 20000.")
    samples = protocol.duration * rate
    if samples > LARGEST_SAMPLES:
        raise UsageError(
            f"The protocol lasts {protocol.duration:.0f} s, which is {samples:.3g} samples at {rate:g} Hz: "
            f"at most {LARGEST_SAMPLES:.0e} are simulated; give a lower --rate."
        )


def truth_document(
    protocol: Protocol,
    recording: Recording,
    truth: Truth,
    noisy: Grade | None,
    grade: Grade,
    seed: int,
) -> dict[str, Any]:
    """Return what was simulated as a document, with the keys of ``calibration.json`` for both triads.

    Parameters
    ----------
    protocol, recording, truth : what was played, what came of it, and what was true.
    noisy : the grade whose noise was added, or None.
    grade, seed : what the unit was drawn from.
    """
    from tumble.calibration.result import BACKWARD, FORWARD

    assert truth.model is not None
    model = truth.model
    in_gauge = _in_gauge(model)
    return {
        "format": "tumble truth",
        "version": 1,
        "software": f"tumble {tumble.__version__}",
        "protocol": protocol.name,
        "seed": seed,
        "imu": {
            "grade": grade.name,
            "source": grade.source,
            "axes": grade.axes or None,
            "C_instrument_case": None
            if grade.C_instrument_case is None
            else grade.C_instrument_case.tolist(),
        },
        "site": {
            "latitude_deg": None if truth.site.latitude is None else float(np.degrees(truth.site.latitude)),
            "height_m": truth.site.height,
            "gravity": truth.site.gravity,
            "earth_rate": EARTH_RATE,
        },
        "frame": {
            "name": "protocol",
            "description": "the body frame b of the protocol's poses; a calibration in another gauge differs from it "
            "by a common rotation, which in_frame_accelerometer_x has taken out",
        },
        "raw_units": {
            "specific_force": recording.specific_force_unit,
            "angular_rate": recording.angular_rate_unit,
        },
        "formula": FORWARD,
        "inverse_formula": BACKWARD,
        **_blocks(model),
        "in_frame_accelerometer_x": None if in_gauge is None else _blocks(in_gauge),
        "noise": None if noisy is None else _noise(noisy, recording),
        "steps": [_step(number, step, truth) for number, step in enumerate(protocol.steps)],
    }


def _in_gauge(model: ImuModel) -> ImuModel | None:
    from tumble.sensor import change_frame

    return change_frame(model, "accelerometer-x")


def _blocks(model: ImuModel) -> dict[str, Any]:
    def block(triad: Any, g_sensitivity: Any) -> dict[str, Any]:
        values = {
            "matrix": triad.matrix,
            "bias": triad.bias,
            "asymmetry": triad.asymmetry,
            "quadratic": triad.quadratic,
            "g_sensitivity": g_sensitivity,
        }
        return {name: None if value is None else np.asarray(value).tolist() for name, value in values.items()}

    return {
        "accelerometer": block(model.accelerometer, None),
        "gyroscope": block(model.gyroscope, model.g_sensitivity),
    }


def _noise(grade: Grade, recording: Recording) -> dict[str, Any]:
    """Return the noise coefficients, in SI whatever the recording's unit is."""
    named = {
        "random_walk": ("{u}/sqrt(Hz)", "N of IEEE Std 952, two-sided density"),
        "bias_instability": ("{u}", "B: flicker whose Allan floor is 0.664 B"),
        "rate_random_walk": ("{u}*sqrt(Hz)", "K of IEEE Std 952"),
        "resolution": ("{u}", "step of the converter; 0 for none"),
        "full_scale": ("{u}", "limit of the converter; null for none"),
    }
    result: dict[str, Any] = {}
    for triad, noise, unit in (
        ("accelerometer", grade.accelerometer.noise, "m/s^2"),
        ("gyroscope", grade.gyroscope.noise, "rad/s"),
    ):
        values = asdict(noise)
        result[triad] = {
            name: {
                "value": values[name] if np.isfinite(values[name]) else None,
                "unit": form.format(u=unit),
                "definition": words,
            }
            for name, (form, words) in named.items()
        }
    return result


def _step(number: int, step: Step, truth: Truth) -> dict[str, Any]:
    start, stop = truth.step_edges[number]
    kind = type(step).__name__.removesuffix("Step").lower()
    return {
        "step": number + 1,
        "kind": kind,
        "name": step.name,
        "start_s": float(start) if np.isfinite(start) else None,
        "stop_s": float(stop) if np.isfinite(stop) else None,
    }


def _write(
    folder: Path,
    protocol: Protocol,
    recording: Recording,
    truth: Truth,
    document: dict[str, Any],
    per_step: bool,
) -> list[Path]:
    """Write everything into a folder inside the folder, then rename it all into place."""
    from tumble.protocol import protocol_to_yaml
    from tumble.recording.formats.output import write_recording
    from tumble.recording.writing import uninterrupted

    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".tumble-simulate-") as temporary:
            beside = Path(temporary)
            names = [write_recording(recording, beside / "recording.csv").name] if not per_step else []
            played = replace(protocol, recordings=("recording.csv",))
            if per_step:
                played = replace(protocol, steps=_own_files(protocol, recording, truth, beside, names))
            for name, text in (
                ("protocol.yaml", protocol_to_yaml(played)),
                ("truth.json", json.dumps(document, indent=1, ensure_ascii=False) + "\n"),
            ):
                with (beside / name).open("w", encoding="utf-8") as file:
                    file.write(text)
                    file.flush()
                    os.fsync(file.fileno())
                names.append(name)
            with uninterrupted():
                for name in names:
                    (beside / name).replace(folder / name)
    except OSError as error:
        raise OutputError(
            f"The simulated recording could not be written to {folder}: {error.strerror or error}."
        ) from error
    finally:
        if made:
            with suppress(OSError):
                folder.rmdir()  # only where nothing came to be in it
    return [folder / name for name in names]


def _own_files(
    protocol: Protocol, recording: Recording, truth: Truth, beside: Path, names: list[str]
) -> tuple[Step, ...]:
    """Write each hold and spin to a file of its own, and return the steps that name them."""
    from tumble.protocol import TurnStep
    from tumble.recording.formats.output import write_recording

    steps: list[Step] = []
    width = len(str(len(protocol.steps)))
    for number, (step, (start, stop)) in enumerate(zip(protocol.steps, truth.step_edges, strict=True), 1):
        if isinstance(step, TurnStep) or not np.isfinite(start):
            steps.append(step)
            continue
        first, last = (int(i) for i in np.searchsorted(recording.time, [start, stop]))
        name = f"step-{number:0{width}d}.csv"
        write_recording(recording.between(first, last), beside / name)
        names.append(name)
        steps.append(replace(step, file=name, interval=None))
    return tuple(steps)


def _silent(_: str) -> None:
    """Tell nobody."""
