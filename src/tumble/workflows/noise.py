"""The noise of a sensor at rest, from the recording to the numbers, a document and a page."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import tumble
from tumble.errors import UsageError
from tumble.recording import Recording, read_recording

if TYPE_CHECKING:
    from tumble.noise.characterisation import Channel, Characterisation

FORMAT = "tumble noise"
VERSION = 1
DOCUMENT, PAGE = "noise.json", "noise.html"


@dataclass(frozen=True, slots=True)
class NoiseAnalysis:
    """A recording, its noise, the document that says so, and the files that were written."""

    recording: Recording
    noise: Characterisation
    document: dict[str, Any]
    files: tuple[Path, ...] = ()


def analyse_noise(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    output: str | os.PathLike[str] | None = None,
    columns: str | None = None,
    units: str | Sequence[str] | None = None,
    rate: float | None = None,
    skip: float = 0.0,
    remove_temperature: bool = False,
    progress: Callable[[str], None] | None = None,
) -> NoiseAnalysis:
    """Read a recording, characterise its noise, and write noise.json and noise.html if `output` is a folder.

    Parameters
    ----------
    paths, columns, units, rate : as for `tumble.recording.read_recording`.
    output : folder for the two files; None writes nothing.
    skip : s at the start to leave out.
    remove_temperature : take a straight line in the temperature off first.
    progress : is told in words what is being done.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or holds no rest.
    UsageError
        If an option is malformed.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.noise.characterisation import characterise

    if not (np.isfinite(skip) and skip >= 0.0):
        raise UsageError(f"--skip {skip}: give seconds, 0 or more.")
    folder = None if output is None else Path(output)
    if folder is not None and folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder.")
    say = progress or _silent
    say("reading")
    recording = read_recording(paths, columns=columns, units=units, rate=rate)
    say("averaging")
    noise = characterise(recording, skip=skip, remove_temperature=remove_temperature)
    document = noise_document(recording, noise)
    files: tuple[Path, ...] = ()
    if folder is not None:
        say("writing")
        files = _write(folder, recording, noise, document, _command(recording, skip, remove_temperature))
    return NoiseAnalysis(recording, noise, document, files)


def _silent(stage: str) -> None:
    """Tell nobody."""


def _command(recording: Recording, skip: float, remove_temperature: bool) -> str:
    words = ["tumble", "noise", *(source.name for source in recording.sources)]
    words += [f"--skip {skip:g}"] if skip else []
    return " ".join([*words, *(["--remove-temperature"] if remove_temperature else [])])


def noise_document(recording: Recording, noise: Characterisation) -> dict[str, Any]:
    """Return everything that was found as plain values, ready for JSON, each with unit and definition.

    Parameters
    ----------
    recording : as read.
    noise : of it.
    """
    from tumble.report.noise_words import DEFINITIONS, FORMULA

    return {
        "format": FORMAT,
        "version": VERSION,
        "software": f"tumble {tumble.__version__}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "recordings": [{"name": s.name, "sha256": s.sha256} for s in recording.sources],
        "rate_hz": recording.rate,
        "samples_at_rest": noise.suitability.samples,
        "pieces": [list(piece) for piece in noise.suitability.pieces],
        "remarks": list(noise.sentences),
        "formula": FORMULA,
        "definitions": {"standard": "IEEE Std 952-2020, two-sided spectral densities", **DEFINITIONS},
        "channels": {channel.name: _channel(channel) for channel in noise.channels},
        "spectra": {
            letter: {
                "what": "one-sided power spectral density, Welch, Hann window, half overlap, in logarithmic bins",
                "channels": [c.name for c in noise.channels if c.name.startswith(letter)],
                "frequency_hz": _numbers(spectrum.frequency),
                "density": [_numbers(row) for row in spectrum.density.T],
            }
            for letter, spectrum in noise.spectra.items()
        },
    }


def _channel(channel: Channel) -> dict[str, Any]:
    from tumble.report.noise_words import practical_unit, si_unit

    terms: dict[str, Any] = {}
    for term in channel.terms:
        factor, unit = practical_unit(channel, term.letter)
        terms[term.letter] = {
            "value": term.value,
            "standard_uncertainty": term.sigma,
            "low": term.low,
            "high": term.high,
            "unit": si_unit(channel, term.letter),
            "practical": {"value": factor * term.value, "unit": unit},
        }
    curve, fit = channel.curve, channel.fit
    return {
        "unit": channel.unit,
        "terms": terms,
        "fit": None
        if fit is None
        else {
            "what": "weighted fit of the logarithm of the whole Allan curve, averaging times an octave apart",
            "confidence": fit.confidence,
            "chi_square": fit.chi_square,
            "degrees_of_freedom": fit.freedom,
            "probability": fit.probability,
        },
        "upper_limits_of_unseen": {
            letter: {"value": limit, "unit": si_unit(channel, letter)}
            for letter, limit in channel.unseen.items()
        },
        "lowest_allan_deviation": {"value": channel.floor, "tau_s": channel.floor_tau},
        "allan_deviation": {
            "what": "overlapping Allan deviation",
            "confidence": curve.confidence,
            "tau_s": _numbers(curve.tau),
            "deviation": _numbers(curve.deviation[:, 0]),
            "low": _numbers(curve.low[:, 0]),
            "high": _numbers(curve.high[:, 0]),
            "equivalent_degrees_of_freedom": _numbers(curve.edf[:, 0]),
        },
    }


def _numbers(values: Any) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in np.asarray(values, dtype=float)]


def _write(
    folder: Path, recording: Recording, noise: Characterisation, document: dict[str, Any], command: str
) -> tuple[Path, ...]:
    from tumble.calibration.result import write_text
    from tumble.recording.writing import uninterrupted
    from tumble.report.noise_page import render_noise

    page = render_noise(noise, recording, command)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with uninterrupted():
        write_text(folder / DOCUMENT, text)
        write_text(folder / PAGE, page)
    return folder / DOCUMENT, folder / PAGE
