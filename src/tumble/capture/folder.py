"""The folder of a capture: the raw samples and the events, appended as they come."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tumble.capture.coach import Event
from tumble.capture.source import Channels
from tumble.errors import UsageError
from tumble.files import GrowingFile, make_folder
from tumble.recording import Recording, Samples, column_names
from tumble.units import COUNTS

RECORDING, JOURNAL = "recording.csv", "session.jsonl"
# Holds that count, as `tumble calibrate --intervals` takes them, where a person dropped some.
HOLDS = "holds.csv"
RESULTS = ("calibration.json", "report.html", "noise.json", "noise.html")


class CaptureFolder:
    """Where a capture is written.

    Parameters
    ----------
    folder : made if it is not there.
    channels : what the columns of ``recording.csv`` are.
    resume : go on with what is there.

    Raises
    ------
    UsageError
        If a capture or its results are there already, and `resume` was not asked for, or the columns differ.
    OutputError
        If it cannot be written to.
    """

    def __init__(self, folder: Path, channels: Channels, *, resume: bool = False) -> None:
        check_folder(folder, resume=resume)
        make_folder(folder)
        self.folder = folder
        header = header_of(channels)
        self._recording = GrowingFile(folder / RECORDING, resume=resume)
        if self._recording.size == 0:
            self._recording.append(header)
        else:
            _check_header(folder / RECORDING, header)
        self._journal = GrowingFile(folder / JOURNAL, resume=resume)
        self.flush()

    @property
    def recording(self) -> Path:
        """The file of raw samples."""
        return self.folder / RECORDING

    def add(self, samples: Samples) -> None:
        """Keep samples for the next `flush`.

        Parameters
        ----------
        samples : of the channels.
        """
        self._recording.append(lines_of(samples))

    def say(self, events: Sequence[Event]) -> None:
        """Keep events for the next `flush`.

        Parameters
        ----------
        events : in order.
        """
        for event in events:
            self._journal.append(event.to_json().encode() + b"\n")

    def flush(self) -> None:
        """Hand everything to the system, samples first.

        Raises
        ------
        OutputError
            If it cannot be written; whole lines before are kept.
        """
        self._recording.flush()
        self._journal.flush()

    def close_recording(self) -> None:
        """Write the last samples down to the disk.

        Raises
        ------
        OutputError
            If they cannot be written.
        """
        self._recording.close()

    def close(self) -> None:
        """Write the last events down to the disk.

        Raises
        ------
        OutputError
            If they cannot be written.
        """
        self._journal.close()


def _digits(value: float) -> str:
    """All digits of a number; nothing for what is no number, as of a temperature that was not sent."""
    return "" if value != value else repr(value)


def check_folder(folder: Path, *, resume: bool) -> None:
    """Refuse a folder in which something would be lost.

    Parameters
    ----------
    folder : for a capture.
    resume : whether it is to go on with what is there.

    Raises
    ------
    UsageError
        If a capture or results are there and `resume` is false, or the folder is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder.")
    there = [name for name in (RECORDING, JOURNAL, *RESULTS) if (folder / name).exists()]
    if there and not resume:
        raise UsageError(
            f"{folder} holds {', '.join(there)} already, and nothing is written over: go on with it (--resume), or "
            "give another folder with -o."
        )


def lines_of(samples: Samples) -> bytes:
    """Return samples as lines of ``recording.csv``.

    Parameters
    ----------
    samples : of the channels of its header.
    """
    parts = [samples.time[:, None], samples.specific_force, samples.angular_rate]
    if samples.temperature is not None:
        parts.append(samples.temperature[:, None])
    parts.append(samples.magnetic_field)
    rows = np.hstack([part for part in parts if part is not None]).tolist()
    return "".join([",".join(map(_digits, row)) + "\n" for row in rows]).encode()


def header_of(channels: Channels) -> bytes:
    """Return the first line of ``recording.csv``.

    Parameters
    ----------
    channels : which triads there are, and in which units.
    """
    nothing, empty = np.zeros(0), np.zeros((0, 3))
    shape = Recording(
        nothing,
        None if channels.specific_force_unit is None else empty,
        None if channels.angular_rate_unit is None else empty,
        channels.specific_force_unit or COUNTS,
        channels.angular_rate_unit or COUNTS,
        channels.rate,
        nothing if channels.temperature else None,
    )
    names = column_names(shape, all_units=True)
    if (unit := channels.magnetic_field_unit) is not None:
        names += [f"m{axis} [{unit}]" if unit else f"m{axis}" for axis in "xyz"]
    return (",".join(names) + "\n").encode()


def _check_header(path: Path, header: bytes) -> None:
    with path.open("rb") as file:
        found = file.readline()
    if found != header:
        raise UsageError(
            f"{path} has the columns {found.decode(errors='replace').strip()}, and now come "
            f"{header.decode().strip()}: give another folder with -o."
        )
