"""Inspect a recording: read it, let the doctor look at it, and convert it where that is asked for.

What it is good for is judged as `calibrate` judges it: by what holds and turns would determine without a protocol.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from tumble.errors import TumbleError, UsageError
from tumble.recording import (
    Findings,
    Recording,
    inspect_recording,
    read_recording,
    recording_inputs,
    write_recording,
)
from tumble.records import dataclass
from tumble.workflows.request import InspectRequest, asked


@dataclass(frozen=True)
class Inspection:
    """A recording, what the doctor found in it, and where it was saved, if it was."""

    recording: Recording
    findings: Findings
    saved: Path | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the samples as plain values, ready for JSON."""
        return {
            "format": "tumble inspection",
            "version": 1,
            "recordings": [{"name": s.name, "sha256": s.sha256} for s in self.recording.sources],
            "streams": self.recording.streams,
            "remarks": [{"kind": r.kind, "text": r.text} for r in self.recording.remarks],
            **asdict(self.findings),
            "saved": None if self.saved is None else str(self.saved),
        }


@asked(InspectRequest)
def inspect(request: InspectRequest) -> Inspection:
    """Read a recording, examine it, and save it as CSV or Parquet if `save` names a file.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or contradicts its header or the options.
    UsageError
        If an option is malformed, or `save` names one of the recording's own files.
    OutputError
        If the recording could not be saved.
    """
    paths, save = request.paths, request.save
    inputs = [one.resolve() for one in recording_inputs(paths) if isinstance(one, Path)]
    if save is not None and Path(save).resolve() in inputs:
        raise UsageError(f"--save {save} is the recording itself; choose another name.")
    recording = read_recording(paths, **request.how())
    findings = _judged(recording, inspect_recording(recording))
    saved = None if save is None else write_recording(recording, save, all_units=True)
    return Inspection(recording, findings, saved)


def _judged(recording: Recording, found: Findings) -> Findings:
    """Add what a calibration without a protocol would determine, and what would determine the rest."""
    from tumble.calibration import FIRST_TRIED, Options, Session, find_missing, find_procedure
    from tumble.workflows.procedures import CONTRADICTS, run_procedure

    session = Session(recording, options=Options(optional_terms=False))
    try:
        _, reason = run_procedure(session, None)
    except TumbleError as error:
        text = f"{find_procedure(FIRST_TRIED).needs}. {str(error).removesuffix(CONTRADICTS)}"
        return replace(found, missing=(f"For a calibration without a protocol: {text}", *found.missing))
    assert session.joint is not None
    there = {"accelerometers": session.joint.has_force, "gyros": session.joint.has_gyro}
    missing = {triad: find_missing(session.joint, triad) for triad in there if there[triad]}
    told = " and ".join(triad for triad in missing if not missing[triad])
    good = (f"Calibration of the {told}. {reason}",) if told else ()
    lacking = (*filter(None, missing.values()), *found.missing)
    return replace(found, good_for=good + found.good_for, missing=lacking)
