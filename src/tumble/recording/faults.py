"""Faults of single channels that a calibration must not pass over: dead ones, saturated ones."""

from __future__ import annotations

import numpy as np

from tumble.recording.doctor import channels_of
from tumble.recording.recording import Recording
from tumble.recording.saturation import find_saturation


def find_dead_channels(recording: Recording) -> list[str]:
    """Return a sentence for each channel that never changes."""
    return [
        f"{name} never changes ({float(channel[0]):g} throughout): a dead sensor or a wrong column."
        for name, channel in channels_of(recording).items()
        if channel.size and float(np.ptp(channel)) == 0.0
    ]


def find_saturated_channels(recording: Recording) -> list[str]:
    """Return a sentence for each limit at which a channel sticks."""
    sentences: list[str] = []
    for name, channel in channels_of(recording).items():
        for found in find_saturation(channel, name):
            when = float(recording.time[found.index])
            sentences.append(
                f"{name} is saturated at {found.value:g} in {found.samples} samples (first for long at {when:.1f} s): "
                "turns with a saturated gyro are left out."
            )
    return sentences
