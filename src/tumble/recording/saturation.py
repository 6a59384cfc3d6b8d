"""Channels that stick at their extreme, as a sensor at its limit does."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.records import dataclass

_LEAST_RUN = 3
# Of the way from the middle to the extreme: what goes back so far comes to the limit anew.
_LEFT = 0.05


@dataclass(frozen=True, slots=True)
class Saturation:
    """A channel that sticks at its extreme: `samples` at `value`, the longest run and where it begins."""

    channel: str
    value: float
    samples: int
    longest_run: int
    index: int


def find_saturation(channel: Series, name: str, floor: float | None = None) -> list[Saturation]:
    """Return where a channel sticks at its largest or smallest value.

    A sensor at its limit repeats one value, run after run, and has more samples there than in the
    whole twentieth of its range next to it; noise around a level does not.

    Parameters
    ----------
    channel, name : (samples,) raw, and what it is called.
    floor : noise per sample, raw units; None where it is to be found if it matters.
    """
    found: list[Saturation] = []
    for value in (float(channel.max()), float(channel.min())):
        at = np.flatnonzero(channel == value)
        # Where a run begins, and one past the last: most channels have none, and nothing more is to be looked at.
        edges = np.concatenate([[0], np.flatnonzero(np.diff(at) > 1) + 1, [at.size]])
        longest = int(np.argmax(np.diff(edges)))
        run = int(edges[longest + 1] - edges[longest])
        if at.size <= _LEAST_RUN or run < _LEAST_RUN:
            continue
        floor = _noise_of(channel) if floor is None else floor
        reach = abs(value - float(np.median(channel)))
        if reach <= 20.0 * floor or reach == 0.0:
            continue
        near = np.abs(channel - value) < _LEFT * reach
        if at.size > np.count_nonzero(near) - at.size:
            found.append(Saturation(name, value, at.size, run, int(at[edges[longest]])))
    return found


def _noise_of(channel: Series) -> float:
    """Return the noise per sample, robustly, from successive differences."""
    if channel.size < 2:
        return 0.0
    steps = np.diff(channel)
    return float(np.median(np.abs(steps, out=steps), overwrite_input=True)) / 0.954


def limits_reached(values: Vectors) -> list[Saturation]:
    """Return at which limits a triad sticks, each reached anew after others: a coarse one at rest repeats, too.

    Parameters
    ----------
    values : (samples, 3) raw.
    """
    found: list[Saturation] = []
    for name, channel in zip("xyz", values.T, strict=True):
        for one in find_saturation(channel, name):
            reach = _LEFT * abs(one.value - float(np.median(channel)))
            off = np.abs(channel - one.value)
            # Where a step of the converter is as large, the next number is no other one.
            fine = bool(np.any((off > 0.0) & (off <= reach)))
            if fine and np.unique(np.cumsum(off > reach)[off == 0.0]).size > 1:
                found.append(one)
    return found
