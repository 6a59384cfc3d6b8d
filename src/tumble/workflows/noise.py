"""The noise of a sensor at rest, from the recording to the numbers, a document and a page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.errors import UsageError
from tumble.files import opened, results_folder
from tumble.recording import Recording, read_blocks, read_recording
from tumble.recording.formats.frames import Frame
from tumble.recording.reading import recording_inputs
from tumble.records import dataclass
from tumble.workflows.request import NoiseRequest, asked, silent

if TYPE_CHECKING:
    from tumble.noise.characterisation import Characterisation
    from tumble.noise.fitting.weighted_fit import Method
    from tumble.report.page import Page

DOCUMENT, PAGE = "noise.json", "noise.html"

STREAMED_ABOVE = 512 * 2**20
"""Bytes of a recording, as numbers, above which it is read block by block."""

# What a byte of such a file becomes, roughly.
_COMPRESSED = 4
_COMPRESSED_STARTS = (b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"PAR1")


@dataclass(frozen=True, slots=True)
class NoiseAnalysis:
    """The noise of a recording, the document that says so, and the files that were written."""

    noise: Characterisation
    document: dict[str, Any]
    files: tuple[Path, ...] = ()
    command: str = ""

    def page(self) -> Page:
        """Return what noise.html says."""
        from tumble.report.noise import noise_page

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
    from tumble.noise.characterisation import characterise, characterise_blocks

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
        say("averaging")
        noise = characterise(recording, **asked_for)
    from tumble.report.noise_document import noise_document

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
    from tumble.report.html import render_page
    from tumble.report.noise_document import document_text

    texts = {folder / DOCUMENT: document_text(found.document), folder / PAGE: render_page(found.page())}
    return tuple(write_texts(texts))
