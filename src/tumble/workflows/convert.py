"""A calibration to another tool's form, and from it."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

from msgspec import structs

from tumble.document import Calibration, RecordingName, calibration_from_model, read_calibration, turned_to
from tumble.errors import UsageError
from tumble.export import (
    Subject,
    Target,
    Wishes,
    check_plausible,
    find_target,
    prepare,
    read_file,
    read_noise,
    targets,
)
from tumble.files import inputs_kept, write_texts
from tumble.recording import UNSTATED, hash_file
from tumble.records import dataclass
from tumble.units import angular_rate_factor, find_unit, specific_force_factor
from tumble.workflows.request import ConvertRequest, asked


@dataclass(frozen=True)
class Converted:
    """What was written, and sentences on what it does not hold."""

    files: list[Path]
    remarks: list[str]


def list_targets() -> list[dict[str, str]]:
    """Return all targets: name, what it is, which way, and what each can hold."""
    return [
        {
            "name": target.name,
            "title": target.title,
            "directions": target.directions,
            "holds": ", ".join(target.holds),
        }
        for target in targets().values()
    ]


@asked(ConvertRequest)
def convert_to(request: ConvertRequest) -> Converted:
    """Write a calibration in another tool's form.

    Raises
    ------
    UsageError
        If the target is unknown, lacks something that it needs, or would lose more than allowed.
    CalibrationFileError
        If the calibration cannot be read.
    OutputError
        If the file cannot be written; an earlier one is intact.
    """
    rate, noise, document = request.rate, request.noise, request.calibration
    if request.target is None:
        raise UsageError("Say which tool's form it is to be: give a target.")
    chosen = find_target(request.target)
    wishes = Wishes(request.frame, request.temperature, request.largest_loss, request.topic)
    if rate is not None and not 0.0 < rate < math.inf:
        raise UsageError(f"--consumer-rate {rate:g}: give Hz, more than 0.")
    if noise is not None and not chosen.noise:
        raise UsageError(f"{chosen.title} holds no noise: leave --noise out.")
    if noise is None and rate is not None:
        raise UsageError("--consumer-rate is about noise: give --noise too.")
    if document is not None and not isinstance(document, Calibration):
        document = read_calibration(document)
    left_out: list[str] = []
    if document is not None and chosen.replaces:
        document, left_out = _without_corrected_before(document, chosen)
    coefficients = None if noise is None else read_noise(Path(noise), rate=rate)
    subject = prepare(document, chosen, wishes, coefficients)
    texts = chosen.write(subject)
    files = _places(texts, chosen, request.output)
    with inputs_kept(Path(one) for one in (request.calibration, noise) if isinstance(one, str | os.PathLike)):
        write_texts(dict(zip(files, texts.values(), strict=True)))
    return Converted(files, [*left_out, *_remarks(subject)])


def _without_corrected_before(document: Calibration, target: Target) -> tuple[Calibration, list[str]]:
    """Refuse what holds on top of other corrections, for a tool that would put it in their place.

    Where that is the magnetometer alone it is left out, and said.
    """
    before = document.input_corrected_by
    if before:
        raise UsageError(
            f"The calibration was made on numbers that were corrected before ({', '.join(before)}), by a calibration "
            f"or by an autopilot's own parameters. {target.title} would put it in their place, and lose them. "
            "Calibrate the raw recording, or the autopilot's log anew: its parameters are undone when it is read."
        )
    said: list[str] = []
    if any(UNSTATED in remark for remark in document.remarks):
        said.append(
            "The log of the recording does not state all of the autopilot's own parameters. Load the numbers only "
            "where these had their defaults while it was recorded."
        )
    field = document.magnetometer
    if field is None or not field.input_corrected_by or not target.magnetometer:
        return document, said
    said.append(
        f"The magnetometer is left out: it was calibrated on top of the autopilot's own parameters, and {target.title} "
        "would put it in their place. Calibrate the log anew: they are undone when it is read."
    )
    return structs.replace(document, magnetometer=None), said


def _places(texts: dict[str, str], target: Target, output: str | os.PathLike[str] | None) -> list[Path]:
    if len(texts) > 1:
        folder = Path(output) if output is not None else Path(target.file)
        if folder.exists() and not folder.is_dir():
            raise UsageError(f"{target.title} is {len(texts)} files: {folder} must be a folder.")
        return [folder / name for name in texts]
    file = Path(output) if output is not None else Path(target.file)
    return [file / next(iter(texts))] if file.is_dir() else [file]


def _remarks(subject: Subject) -> list[str]:
    """What the file says in its comments too, where it has some."""
    said = [loss.text for loss in subject.losses] + list(subject.remarks)
    if subject.noise is not None:
        said += subject.noise.remarks
    return [_sentence(text) for text in said]


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:] + ("" if text.endswith(".") else ".")


def convert_from(
    path: str | os.PathLike[str],
    source: str,
    *,
    output: str | os.PathLike[str] = "calibration.json",
    units: str | None = None,
) -> Converted:
    """Read another tool's calibration and write it as ``calibration.json``, without uncertainties.

    Parameters
    ----------
    path : the file, or a folder of several.
    source : name of the target that it is of.
    output : the file.
    units : raw units of specific force and angular rate, for forms that do not say them.

    Raises
    ------
    UsageError
        If the target is unknown or written only, or the units are wrong.
    CalibrationFileError
        If the file is not of that tool, or damaged.
    OutputError
        If the file cannot be written; an earlier one is intact.
    """
    chosen = find_target(source, reading=True)
    found = read_file(source, Path(path))
    raw_units = found.units
    if units is not None:
        if chosen.units is not None:
            raise UsageError(
                f"{chosen.title} works on {chosen.units[0]} and {chosen.units[1]}: leave --units out."
            )
        raw_units = _two_units(units)
        found = replace(found, remarks=tuple(r for r in found.remarks if "--units" not in r))
    for unit, factor in zip(raw_units, (specific_force_factor, angular_rate_factor), strict=True):
        factor(unit)
    target_file = Path(output) / "calibration.json" if Path(output).is_dir() else Path(output)
    model = found.model
    check_plausible(model, raw_units, Path(path))
    document = calibration_from_model(
        model,
        raw_units,
        (found.frame, found.frame_words),
        [RecordingName(name=file.name, sha256=hash_file(file).sha256) for file in found.files],
        procedure=f"imported from {chosen.title}",
        remarks=[_sentence(remark) for remark in found.remarks],
        thermal=found.thermal,
    )
    with inputs_kept(found.files):
        document.write(target_file)
    return Converted(
        [target_file], [*document.remarks, "The file holds no uncertainties, so the document has none."]
    )


def _two_units(text: str) -> tuple[str, str]:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) == 1:
        parts *= 2
    if len(parts) != 2:
        raise UsageError(
            f"--units {text} is no pair: give those of specific force and angular rate, as g,deg/s."
        )
    force, rate = find_unit("specific force", parts[0]), find_unit("angular rate", parts[1])
    if force is None or rate is None:
        wrong = parts[0] if force is None else parts[1]
        raise UsageError(
            f"{wrong!r} in --units is not known: give specific force and angular rate, as g,deg/s or counts."
        )
    return force, rate


def turn(
    calibration: str | os.PathLike[str], frame: str, output: str | os.PathLike[str]
) -> tuple[Path, Calibration]:
    """Write the calibration in another frame.

    Raises
    ------
    UsageError
        If the frame is unknown or cannot be had, or the output is the input.
    CalibrationFileError, OutputError
        If the file cannot be read, or the result not be written.
    """
    document = turned_to(read_calibration(calibration), frame)
    file = Path(output) / "calibration.json" if Path(output).is_dir() else Path(output)
    with inputs_kept([Path(calibration)]):
        document.write(file)
    return file, document
