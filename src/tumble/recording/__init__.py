"""Recordings of an IMU: reading them from any layout, and judging what they are good for.

`read_recording` reads one file or a pair of files, `read_blocks` a recording of any length in bounded
memory. Signals stay raw; what was found, assumed, mended or left unchecked stands in the recording's
remarks. `inspect_recording` is the doctor. `axis_agreement` compares the gyro with the way gravity
turns in body axes.
"""

from __future__ import annotations

from tumble.recording.doctor import Findings, find_dead_channels, find_saturated_channels, inspect_recording
from tumble.recording.formats.output import write_recording
from tumble.recording.gravity_check import (
    axis_agreement,
    describe_axis_contradiction,
    find_axis_contradiction,
    gyro_scale_from_gravity,
    unit_of_scale,
)
from tumble.recording.reading import read_blocks, read_recording, read_recordings
from tumble.recording.recording import Recording
from tumble.recording.samples import MagneticField, Remark, Source

__all__ = [
    "Findings",
    "MagneticField",
    "Recording",
    "Remark",
    "Source",
    "axis_agreement",
    "describe_axis_contradiction",
    "find_axis_contradiction",
    "find_dead_channels",
    "find_saturated_channels",
    "gyro_scale_from_gravity",
    "inspect_recording",
    "read_blocks",
    "read_recording",
    "read_recordings",
    "unit_of_scale",
    "write_recording",
]
