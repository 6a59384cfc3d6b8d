"""A recording that is played again, at any speed: the test of everything else."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.capture.source import Channels, Piece, Source, SourceOptions
from tumble.errors import RecordingError
from tumble.recording import Paths, Recording, Samples, read_blocks, recording_inputs

# s of samples that are handed over together, and how long is slept at most.
CHUNK, NAP = 0.1, 0.2


def split_speed(address: str) -> tuple[str, float]:
    """Return the file of ``FILE@SPEED``, and how many times as fast as real time it is played; 0 is as fast as it goes.

    Parameters
    ----------
    address : without a number behind an ``@``, or of a file whose name ends so, it is real time.
    """
    found = None if Path(address).exists() else re.fullmatch(r"(.+)@(\d+\.?\d*)", address)
    return (address, 1.0) if found is None else (found[1], float(found[2]))


def replay(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield the samples of a recording as if they came now.

    Parameters
    ----------
    address : of the file, as for `split_speed`; two files of one triad each with ``+`` between.
    options : what the file does not say itself.

    Raises
    ------
    RecordingError, UsageError
        If it cannot be read as a recording.
    """
    address, speed = split_speed(address)
    paths: Paths = (
        [Path(part) for part in address.split("+")] if not Path(address).exists() else Path(address)
    )
    channels: Channels | None = None
    begun, first = time.monotonic(), 0.0
    for block in read_blocks(
        recording_inputs(paths),
        columns=options.columns,
        units=options.units,
        rate=options.rate,
    ):
        if block.specific_force is None and block.angular_rate is None:
            raise RecordingError(
                "The recording has neither accelerometer nor gyro: there is nothing to guide."
            )
        if channels is None:
            channels, first = _channels_of(block), float(block.time[0])
            yield channels
        step = max(1, round(CHUNK * block.rate))
        for start in range(0, len(block), step):
            part = block.between(start, min(start + step, len(block)))
            if speed > 0.0:
                due = begun + (float(part.time[-1]) - first) / speed
                while (late := due - time.monotonic()) > 0.0:
                    if late > NAP:
                        yield None
                    time.sleep(min(late, NAP))
            samples = samples_of(part)
            if channels.magnetic_field_unit is not None and samples.magnetic_field is None:
                samples = replace(samples, magnetic_field=np.full((len(samples), 3), np.nan))
            yield samples


def _channels_of(block: Recording) -> Channels:
    has_temperature = block.temperature is not None and bool(np.isfinite(block.temperature).any())
    return Channels(
        None if block.specific_force is None else block.specific_force_unit,
        None if block.angular_rate is None else block.angular_rate_unit,
        block.rate,
        has_temperature,
        tuple(remark.text for remark in block.remarks),
        None if block.magnetic_field is None else block.magnetic_field.unit,
    )


def samples_of(block: Recording) -> Samples:
    """Return a piece of a recording as samples.

    Parameters
    ----------
    block : of a recording.
    """
    field, placed = block.magnetic_field, None
    if field is not None:
        # A magnetometer's stamps are the rows' where it stood among them; else each sample goes to the next row.
        placed = np.full((len(block), 3), np.nan)
        placed[np.minimum(np.searchsorted(block.time, field.time), len(block) - 1)] = field.values
    return Samples(block.time, block.specific_force, block.angular_rate, block.temperature, placed)


SOURCE = Source(
    "replay",
    "a recording that is played again, @SPEED behind it (0: as fast as it goes)",
    "replay:FILE",
    replay,
    live=False,
)
