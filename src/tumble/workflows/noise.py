"""The noise of a sensor at rest: from the recording to a document and a page, and that read for a calibration."""

from __future__ import annotations

import os
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.errors import RecordingError, UsageError
from tumble.files import number_of, opened, read_json, reading, results_folder
from tumble.noise import LETTERS, GaussMarkov, Line, NoiseModel
from tumble.recording import Frame, Recording, read_blocks, read_recording, recording_inputs
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor
from tumble.workflows.request import NoiseRequest, asked, silent

if TYPE_CHECKING:
    from tumble.calibration import Session
    from tumble.noise import Characterisation, Method
    from tumble.report import Page
    from tumble.segmentation import HoldMeans


DOCUMENT, PAGE = "noise.json", "noise.html"

STREAMED_ABOVE = 512 * 2**20
"""Bytes of a recording, as numbers, above which it is read block by block."""

# What a byte of such a file becomes, roughly.
_COMPRESSED = 4
_COMPRESSED_STARTS = (b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"PAR1")


@dataclass(frozen=True)
class NoiseAnalysis:
    """The noise of a recording, the document that says so, and the files that were written."""

    noise: Characterisation
    document: dict[str, Any]
    files: tuple[Path, ...] = ()
    command: str = ""

    def page(self) -> Page:
        """Return what noise.html says."""
        from tumble.report import noise_page

        return noise_page(self.noise, self.command)


@asked(NoiseRequest)
def analyse_noise(request: NoiseRequest) -> NoiseAnalysis:
    """Read a recording, characterise its noise, and write noise.json and noise.html if `output` is a folder.

    A file of more than half a gigabyte of numbers is read block by block, twice, in little memory.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or holds no rest.
    UsageError
        If an option is malformed.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.noise import characterise, characterise_blocks

    if not (np.isfinite(request.skip) and request.skip >= 0.0):
        raise UsageError(f"--skip {request.skip}: give seconds, 0 or more.")
    folder, method, paths = results_folder(request.output), _method(request.fit), request.paths
    asked_for: dict[str, Any] = {
        "skip": request.skip,
        "remove_temperature": request.remove_temperature,
        "method": method,
    }
    how: dict[str, Any] = {**request.how(), "parted": True}
    say = request.progress or silent
    listed = [] if isinstance(paths, Recording) else recording_inputs(paths)
    say("reading")
    if sum(map(_numbers_in, listed)) > STREAMED_ABOVE:
        noise = characterise_blocks(lambda: read_blocks(listed, **how), **asked_for, progress=say)
    else:
        recording = paths if isinstance(paths, Recording) else read_recording(listed, **how)
        if request.skip > recording.duration:
            lasts = f"which lasts {recording.duration:.4g} s"
            raise RecordingError(f"--skip {request.skip:g} leaves nothing of the recording, {lasts}.")
        say("averaging")
        noise = characterise(recording, **asked_for)
    from tumble.report import noise_document

    command = _command(noise, request)
    found = NoiseAnalysis(noise, noise_document(noise), command=command)
    if folder is None:
        return found
    say("writing")
    return replace(found, files=_write(folder, found))


def _method(name: str) -> Method:
    for method in ("curve", "moments"):
        if method == name.strip().lower():
            return method
    raise UsageError(f"--fit {name} is no way to fit: give curve or moments.")


def _numbers_in(path: Path | Frame) -> int:
    """Bytes that a file's numbers take in memory, roughly; 0 where it cannot be read, which the reader will say."""
    if not isinstance(path, Path):
        return 0
    try:
        with opened(path) as file:
            packed = file.read(8).startswith(_COMPRESSED_STARTS)
        return path.stat().st_size * (_COMPRESSED if packed else 1)
    except OSError:
        return 0


def _command(noise: Characterisation, request: NoiseRequest) -> str:
    words = ["tumble", "noise", *(source.name for source in noise.sources)]
    words += [f"--skip {request.skip:g}"] if request.skip else []
    words += ["--remove-temperature"] if request.remove_temperature else []
    fit = request.fit.strip().lower()
    return " ".join([*words, *([f"--fit {fit}"] if fit != "curve" else [])])


def _write(folder: Path, found: NoiseAnalysis) -> tuple[Path, ...]:
    from tumble.files import write_texts
    from tumble.report import document_text, render_page

    texts = {folder / DOCUMENT: document_text(found.document), folder / PAGE: render_page(found.page())}
    return tuple(write_texts(texts))


# Sampling rates that differ by more are not the same setting of a sensor.
_SAME_RATE = 0.02


@dataclass(frozen=True)
class NoiseModels:
    """Models of a unit's channels.

    Attributes
    ----------
    source : the file's name.
    rate : Hz that the noise was recorded at, rows that repeat a value counted.
    channels : by name, ax to gz: the unit ("m/s²", "rad/s" or "counts") and the model in it.
    """

    source: str
    rate: float
    channels: dict[str, tuple[str, NoiseModel]]


def read_noise_models(path: str | os.PathLike[str]) -> NoiseModels:
    """Read the models of every channel from a document that `tumble noise` wrote.

    Parameters
    ----------
    path : noise.json.

    Raises
    ------
    UsageError
        If it cannot be read, is another kind of file, or has a channel without a model.
    """
    place = Path(path)
    how = "give the noise.json that `tumble noise RECORDING -o DIR` wrote for this unit"
    with reading(place, "a noise file", hint=how):
        document: Any = read_json(place)
    if not isinstance(document, dict) or cast("dict[str, Any]", document).get("format") != "tumble noise":
        raise UsageError(f"--noise {place} is no noise document: {how}.")
    try:
        content = cast("dict[str, Any]", document)
        rate = number_of(content.get("recorded_rate_hz") or content["rate_hz"])
        channels = {
            str(name): (str(channel["unit"]), _model(channel))
            for name, channel in content["channels"].items()
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(
            f"--noise {place} is a noise document that lacks what one has ({error}): {how}."
        ) from error
    empty = [name for name, (_, model) in channels.items() if model == NoiseModel()]
    if empty:
        raise UsageError(
            f"--noise {place} has no model of {', '.join(empty)}: the noise was recorded for too short a time. "
            "Record longer at rest, or leave the option out."
        )
    return NoiseModels(str(place), rate, channels)


def _model(channel: dict[str, Any]) -> NoiseModel:
    """The model of one channel in its unit."""
    values = {str(name): number_of(term["value"]) for name, term in channel["terms"].items()}
    if min(values.values(), default=0.0) < 0.0:
        raise ValueError("a coefficient is negative")
    # Short processes are in the N that a filter takes; as states they would be of no use.
    whole: dict[str, Any] = channel.get("random_walk") or {}
    white = [number_of(time) for time in whole.get("correlation_times_s", ())]
    if white:
        values["N"] = number_of(whole["value"])
    processes = [
        GaussMarkov(values[f"sigma{mark}"], values[f"correlation time{mark}"])
        for mark in ("", " 2", " 3")
        if f"sigma{mark}" in values and values[f"correlation time{mark}"] not in white
    ]
    entries = cast("list[dict[str, Any]]", channel.get("lines") or [])
    lines = [Line(number_of(one["amplitude"]), number_of(one["frequency_hz"])) for one in entries]
    coefficients = {letter: values[letter] for letter in LETTERS if letter in values}
    return NoiseModel.from_coefficients(coefficients, tuple(processes), tuple(lines))


def triad_models(
    models: NoiseModels, letter: str, si: str, factor: float | None, unit: str
) -> list[NoiseModel]:
    """Return models of x, y and z in raw units.

    Parameters
    ----------
    models, letter : as read, and that of the channels: a or g.
    si : unit of the triad's models that are not in counts.
    factor, unit : of the raw unit to SI, None for counts; and its name.

    Raises
    ------
    UsageError
        If a channel is missing, or in another kind of unit.
    """
    found: list[NoiseModel] = []
    for name in (f"{letter}{axis}" for axis in "xyz"):
        if name not in models.channels:
            raise UsageError(
                f"--noise {models.source} has no channel {name}: record the noise of the whole unit."
            )
        given, model = models.channels[name]
        expected = "counts" if factor is None else si
        if given != expected:
            raise UsageError(
                f"--noise {models.source} has {name} in {given}, not {unit}: run `tumble noise` with --units as here."
            )
        found.append(model if factor is None else model.scaled(1.0 / factor))
    return found


@dataclass
class NoiseOfHolds:
    """Models in a recording's raw units, and what was said when they were used."""

    source: str
    force: list[NoiseModel] | None
    rate: list[NoiseModel] | None
    remarks: list[str] = field(default_factory=list[str])

    @classmethod
    def read(cls, path: str | os.PathLike[str], recording: Recording) -> NoiseOfHolds:
        """Read the models of a recording's channels, three for each triad that it has.

        Parameters
        ----------
        path, recording : of `noise.json`, and to be calibrated.

        Raises
        ------
        UsageError
            If it is no such file, or rate, units or channels are not the recording's.
        """
        models = read_noise_models(path)
        if abs(recording.rate / models.rate - 1.0) > _SAME_RATE:
            raise UsageError(
                f"--noise {models.source} was recorded at {models.rate:g} Hz and this one at {recording.rate:.4g} Hz: "
                "a sensor filters otherwise at another rate. Record the noise at the rate of the calibration."
            )
        si = {"a": ("m/s²", specific_force_factor), "g": ("rad/s", angular_rate_factor)}
        found = {
            triad.letter: triad_models(
                models, triad.letter, si[triad.letter][0], si[triad.letter][1](triad.unit), triad.unit
            )
            for triad in recording.triads
        }
        return cls(os.fspath(path), found.get("a"), found.get("g"))

    def means_of(self, session: Session) -> HoldMeans:
        """Return a session's means with the models' covariances.

        Parameters
        ----------
        session : with its holds.
        """
        from tumble.segmentation import model_means

        given = session.recording, session.timeline, session.means
        means, remarks = model_means(*given, self.force, self.rate)
        self.remarks += remarks
        return means

    def said(self) -> list[str]:
        """Return what a user is told."""
        said = (
            f"How well the means of holds are known comes from the noise models in {self.source}; that neighbouring "
            "holds are off together is counted in the uncertainties."
        )
        return [said, *self.remarks]
