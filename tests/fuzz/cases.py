"""One case: a changed file is read as its kind is, and what came of it."""

from __future__ import annotations

import base64
import json
import os
import sys
import tempfile
import traceback
import warnings
import zlib
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from tests.fuzz import mutations
from tests.fuzz.seeds import HEADER, repacked, rows, seeds, text

from tumble.cli import main
from tumble.document import read_calibration
from tumble.errors import TumbleError
from tumble.export import read_noise
from tumble.navigation import read_track
from tumble.protocol import protocol_to_yaml, read_protocol
from tumble.recording import header_names, read_blocks, read_recording
from tumble.segmentation import read_intervals
from tumble.simulation import read_errors
from tumble.workflows import convert_from, read_noise_models

FOUND = Path(__file__).with_name("found.json")
_SHARE = {
    "text": 12, "recording": 20, "calibration": 12, "foreign": 12, "noise": 4, "protocol": 12, "gnss": 8,
    "intervals": 3, "call": 9, "work": 1,
}  # fmt: skip
_CHANGES = {"recording": mutations.BINARY, "call": mutations.CALL, "work": mutations.COLUMNS}
_LONGEST = 1500  # characters of a sentence: it lists twelve topics, columns or files at most


@dataclass(frozen=True, slots=True)
class Case:
    """A file of a kind, by name, with its content."""

    kind: str
    name: str
    content: bytes

    @classmethod
    def of_json(cls, kept: dict[str, str]) -> Case:
        """Return a case of ``found.json``."""
        packed = "zlib" in kept
        content = zlib.decompress(base64.b64decode(kept["zlib"])) if packed else kept["text"].encode()
        return cls(kept["kind"], kept["name"], content)


def case_of(number: int, seed: int = 1) -> Case:
    """Return the case of a number: the same on every machine."""
    rng = np.random.default_rng([seed, number])
    kinds = [kind for kind in seeds() for _ in range(_SHARE.get(kind, 1))]
    kind = mutations.pick(kinds, rng)
    # scipy's reader of MATLAB ends the program at some wrong bits.
    files = [file for file in seeds()[kind] if not file[0].endswith(".mat")]
    name, content = mutations.pick(files, rng)
    json_ = name.endswith(".json")
    changes = _CHANGES.get(kind, mutations.JSON if json_ else mutations.TEXT)
    if rng.random() < 0.7:
        return Case(
            kind, name, repacked(name, content, lambda inside: mutations.changed(inside, changes, rng))
        )
    return Case(kind, name, mutations.changed(content, changes, rng))


def found() -> list[Case]:
    """Return the cases that once were findings."""
    return [Case.of_json(kept) for kept in json.loads(FOUND.read_text(encoding="utf-8"))]


def outcome(case: Case) -> str | None:
    """Read a case; returns None for a result or a sentence, else what is wrong: the fault and its place."""
    with tempfile.TemporaryDirectory(prefix="tumble-fuzz-") as folder:
        file = Path(folder) / Path(case.name).name
        file.write_bytes(case.content)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                READERS[case.kind](file, case)
        except TumbleError as error:
            said = str(error).replace(folder, "")
            return None if len(said) < _LONGEST else f"a sentence of {len(said)} characters"
        except Exception as error:
            return fault(error)
    return None


def fault(error: BaseException) -> str:
    """Return type, place in tumble and words of a fault."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/src/tumble/" in f.filename]
    place = f"{Path(frames[-1].filename).name}:{frames[-1].name}" if frames else "outside"
    return f"{type(error).__name__} in {place}: {str(error)[:120]}"


def _read_recording(file: Path, _: Case) -> None:
    header_names(file)
    recording = read_recording(file)
    for triad in (recording.specific_force, recording.angular_rate):
        assert triad is None or np.isfinite(triad).all(), "a number that is none was read"
    assert np.isfinite(recording.time).all()
    assert (np.diff(recording.time) > 0.0).all(), "time does not grow"
    assert sum(len(block) for block in read_blocks(file)) == len(recording), "blocks and whole differ in rows"


def _read_calibration(file: Path, _: Case) -> None:
    calibration = read_calibration(file)
    json.loads(calibration.to_json())
    raw, time = np.array([[1.0, 2.0, 9.0]] * 5), np.arange(5.0)
    force, rate = calibration.correct(raw, 0.1 * raw, time, np.full(5, 20.0), outside="hold")
    for triad in (force, rate):
        assert triad is None or np.isfinite(triad).all(), "a number that is none was corrected"


def _read_foreign(file: Path, case: Case) -> None:
    output = file.with_name("read.json")
    convert_from(file, case.name.split("/")[0], output=output)
    read_calibration(output)


def _read_noise(file: Path, _: Case) -> None:
    for read in (read_noise, read_noise_models):
        with suppress(TumbleError):
            read(file)


def _read_gnss(file: Path, _: Case) -> None:
    assert np.isfinite(read_track(file).time).all()


def _call(file: Path, case: Case) -> None:
    words: Any = json.loads(case.content)
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        return
    (file.parent / "hand.csv").write_text(f"{HEADER}\n{text(rows())}")
    for kind in ("calibration", "noise", "intervals", "gnss", "errors"):
        name, content = seeds()[kind][0]
        (file.parent / name).write_bytes(content)
    _run_program(words, file.parent)


def _work(file: Path, case: Case) -> None:
    command = case.name.split("/")[0]
    (file.parent / "calibration.json").write_bytes(seeds()["calibration"][0][1])
    before = ["calibration.json"] if command in ("verify", "apply") else []
    after = {"calibrate": ["-o", "out"], "noise": ["-o", "out"], "apply": ["-o", "out.csv"]}.get(command, [])
    _run_program([command, *before, file.name, *after], file.parent)


def _run_program(words: list[str], folder: Path) -> None:
    """Run the command line in this process: a status and at most one line on standard error."""
    out, err, argv = StringIO(), StringIO(), sys.argv
    sys.argv, os.environ["TUMBLE_DEBUG"] = ["tumble", *words], "1"
    try:
        with chdir(folder), redirect_stdout(out), redirect_stderr(err):
            main()
    except SystemExit as end:
        said = err.getvalue()
        if end.code not in (0, 1, 2, 3, None):
            raise AssertionError(f"status {end.code}: {said}") from end
        one_line = said.startswith("tumble: ") and said.count("\n") == 1 and len(said) < _LONGEST + 1000
        if end.code in (2, 3) and not one_line:
            raise AssertionError(f"not one sentence: {said}") from end
    finally:
        sys.argv = argv
        del os.environ["TUMBLE_DEBUG"]


READERS: dict[str, Callable[[Path, Case], object]] = {
    "text": _read_recording,
    "recording": _read_recording,
    "calibration": _read_calibration,
    "foreign": _read_foreign,
    "noise": _read_noise,
    "protocol": lambda file, _: protocol_to_yaml(read_protocol(file)),
    "gnss": _read_gnss,
    "intervals": lambda file, _: read_intervals(file),
    "errors": lambda file, _: read_errors(file),
    "call": _call,
    "work": _work,
}
