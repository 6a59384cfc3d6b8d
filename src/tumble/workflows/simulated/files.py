"""The folder of a simulation: recording, protocol and truth, thermal truth too, replaced as a whole."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.errors import OutputError, UsageError
from tumble.files import filled_folder, put_text, read_json, results_folder
from tumble.recording.formats.table import hash_file
from tumble.workflows.simulated.truth import FORMAT

if TYPE_CHECKING:
    from tumble.protocol import Protocol
    from tumble.recording import Recording
    from tumble.sensor.thermal import ThermalModel
    from tumble.simulation import ChamberTruth, ThermalGrade


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
    from tumble.recording.formats.output import write_recording

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
