"""The folder of a simulation: recording, protocol and truth, thermal truth too, replaced as a whole."""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.errors import OutputError, UsageError
from tumble.files import filled_folder, put_text, read_json
from tumble.workflows.simulated.truth import FORMAT

if TYPE_CHECKING:
    from tumble.protocol import Protocol
    from tumble.recording import Recording
    from tumble.sensor.thermal import ThermalModel
    from tumble.simulation import ChamberTruth, ThermalGrade, Truth


def thermal_truth(truth: ChamberTruth, grade: ThermalGrade) -> dict[str, Any]:
    """Return the thermal block of a truth, with the names of a calibration's.

    Parameters
    ----------
    truth : the unit and its temperatures.
    grade : what it was drawn from.
    """
    from tumble.sensor.gauge import frame_rotation

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
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder for the simulated files.")
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        raise OutputError(f"The folder {folder} cannot be made: {existing} is a file. Give another with -o.")
    if not os.access(existing, os.W_OK):
        raise OutputError(f"{existing} cannot be written to: give another folder with -o.")
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


def _earlier_recordings(folder: Path) -> list[str]:
    """The recordings of an earlier simulation, by the names that a simulation gives: no other file is removed."""
    names: Any = _earlier(folder).get("recordings", [])
    listed = cast("list[Any]", names) if isinstance(names, list) else []
    return [n for n in listed if isinstance(n, str) and re.fullmatch(r"recording\.csv|step-\d+\.csv", n)]


def write_simulation(
    folder: Path,
    protocol: Protocol,
    recording: Recording,
    truth: Truth,
    document: dict[str, Any],
    per_step: bool,
) -> list[Path]:
    """Write everything into a folder inside the folder, then rename it all into place; return the files.

    Parameters
    ----------
    folder, protocol, recording, truth, document : what is written, and where.
    per_step : a file for each hold and spin.

    Raises
    ------
    OutputError
        If they cannot be written; earlier ones are intact.
    """
    from tumble.recording.formats.output import write_recording

    try:
        with filled_folder(folder, instead_of=_earlier_recordings(folder)) as beside:
            if per_step:
                protocol, names = _write_steps(protocol, recording, truth, beside)
            else:
                names = [write_recording(recording, beside / "recording.csv").name]
                protocol = replace(protocol, recordings=tuple(names))
            document["recordings"] = list(names)
            names += _write_texts(protocol, document, beside)
    except (OSError, OutputError) as error:
        # A writer below has turned the system's error into a sentence about a name that nobody knows.
        cause = error.__cause__ if isinstance(error, OutputError) else error
        words = cause.strerror if isinstance(cause, OSError) and cause.strerror else str(cause or error)
        raise OutputError(f"The simulated recording could not be written to {folder}: {words}.") from error
    return [folder / name for name in names]


def _write_texts(protocol: Protocol, document: dict[str, Any], beside: Path) -> list[str]:
    from tumble.protocol import protocol_to_yaml

    texts = {
        "protocol.yaml": protocol_to_yaml(protocol),
        "truth.json": json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        put_text(beside / name, text)
    return list(texts)


def _write_steps(
    protocol: Protocol, recording: Recording, truth: Truth, beside: Path
) -> tuple[Protocol, list[str]]:
    """Write each hold and spin to a file of its own; return the protocol whose steps name them, and the names.

    A rotation whose angle is known is one with the rests beside it: so far as these reach it is one file. So
    is a sequence of the strapdown rotation test.
    """
    from tumble.recording.formats.output import write_recording

    names: list[str] = []
    steps = [replace(step, file=None, interval=None) for step in protocol.steps]
    width = len(str(len(steps)))
    # Whole samples inside the steps: half an interval from each of their ends.
    inside = 0.5 / recording.rate * (1.0 - 1e-6)
    firsts: list[int] = np.searchsorted(recording.time, truth.step_edges[:, 0] + inside).tolist()
    lasts: list[int] = np.searchsorted(recording.time, truth.step_edges[:, 1] - inside, side="right").tolist()
    for run in _runs(protocol):
        first, last = firsts[run[0]], lasts[run[-1]]
        if not last - first > 1:
            continue
        names.append(f"step-{run[0] + 1:0{width}d}.csv")
        write_recording(recording.between(first, last), beside / names[-1])
        for number in run:
            steps[number] = replace(steps[number], file=names[-1])
    return replace(protocol, steps=tuple(steps)), names


def _runs(protocol: Protocol) -> list[list[int]]:
    """Return which steps, turns apart, share a file: each alone, but rotations of known angle with their rests."""
    from tumble.protocol import SpinStep, TurnStep, sequence_steps

    steps = protocol.steps
    sequences = sequence_steps(protocol) if protocol.procedure == "strapdown-rotation" else []
    inside = {number for s in sequences for number in range(s.start + 1, s.end + 1)}
    runs: list[list[int]] = []
    known = [isinstance(step, SpinStep) and step.angle is not None for step in steps]
    for number, step in enumerate(steps):
        if number in inside:
            runs[-1].append(number)
            continue
        if isinstance(step, TurnStep):
            continue
        joined = runs and runs[-1][-1] == number - 1 and (known[number] or known[number - 1])
        if joined:
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs
