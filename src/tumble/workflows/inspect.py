"""Inspect a recording: read it, let the doctor look at it, and convert it where that is asked for."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tumble.errors import UsageError
from tumble.recording import Findings, Recording, inspect_recording, read_recording, write_recording
from tumble.records import dataclass

FORMAT = "tumble inspection"
VERSION = 1


@dataclass(frozen=True, slots=True)
class Inspection:
    """A recording, what the doctor found in it, and where it was saved, if it was."""

    recording: Recording
    findings: Findings
    saved: Path | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the samples as plain values, ready for JSON."""
        recording = self.recording
        found = asdict(self.findings)
        return {
            "format": FORMAT,
            "version": VERSION,
            "recordings": [{"name": s.name, "sha256": s.sha256} for s in recording.sources],
            "streams": {
                "specific_force": _stream(
                    recording.specific_force is not None, recording.specific_force_unit
                ),
                "angular_rate": _stream(recording.angular_rate is not None, recording.angular_rate_unit),
                "magnetic_field": None
                if recording.magnetic_field is None
                else {"unit": recording.magnetic_field.unit},
                "temperature": None if recording.temperature is None else {"unit": "degC"},
            },
            "remarks": [{"kind": r.kind, "text": r.text} for r in recording.remarks],
            **found,
            "saved": None if self.saved is None else str(self.saved),
        }


def _stream(present: bool, unit: str) -> dict[str, str] | None:
    return {"unit": unit} if present else None


def inspect(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    columns: str | None = None,
    units: str | Sequence[str] | None = None,
    rate: float | str | None = None,
    topics: Sequence[str] | None = None,
    save: str | os.PathLike[str] | None = None,
) -> Inspection:
    """Read a recording, examine it, and save it as CSV or Parquet if `save` names a file.

    Parameters
    ----------
    paths, columns, units, rate, topics : as for `tumble.recording.read_recording`.
    save : file to convert to; its ending says whether CSV or Parquet.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or contradicts its header or the options.
    UsageError
        If an option is malformed, or `save` names one of the recording's own files.
    OutputError
        If the recording could not be saved.
    """
    if save is not None:
        _refuse_own_file(paths, Path(save))
    recording = read_recording(paths, columns=columns, units=units, rate=rate, topics=topics)
    findings = inspect_recording(recording)
    saved = None if save is None else write_recording(recording, save, all_units=True)
    return Inspection(recording, findings, saved)


def _refuse_own_file(paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], save: Path) -> None:
    named = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if any(Path(os.fspath(p)).resolve() == save.resolve() for p in named):
        raise UsageError(f"--save {save} is the recording itself; choose another name.")
