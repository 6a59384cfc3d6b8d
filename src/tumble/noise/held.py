"""Values that a logger wrote several times over: told from chance, and taken once, at the rate of new values.

A logger that runs faster than its sensor holds the last value. Its rows are no more samples than the sensor
gave; their neighbours' differences are zero, and the scatter that short blocks show is none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Table
from tumble.recording import Recording
from tumble.records import dataclass

REPEATS = 0.02
"""Share of rows like the one before, beyond chance, that is no accident."""

_LOOKED_AT = 1_000_000  # rows at the beginning by which it is judged
_OFTEN = 1.0 / 3.0  # share beyond which values are held whatever the order of the repeats
_REGULAR = 0.95  # of the distances between repeats lie within two rows of each other
_STUCK = 5.0  # times the usual run: a sensor that stood still
_LEAST_STUCK = 8

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Held:
    """How often a recording's values were written.

    Attributes
    ----------
    rows : that a value stands in, on the average; fewest, most : of nine values in ten.
    share : of the rows that repeat the row before.
    recorded : Hz of the rows.
    """

    rows: float
    fewest: int
    most: int
    share: float
    recorded: float

    @property
    def rate(self) -> float:
        """Hz at which values are new."""
        return self.recorded / self.rows

    @property
    def stuck(self) -> int:
        """Rows of one value beyond which the sensor stood still."""
        return max(_LEAST_STUCK, round(_STUCK * self.rows))


def equal_rows(signals: Table) -> tuple[int, Series]:
    """Return how many rows repeat the row before in every channel, and how many do in each channel.

    Parameters
    ----------
    signals : (samples, channels).
    """
    equal = signals[1:] == signals[:-1]
    return int(np.count_nonzero(np.all(equal, axis=1))), np.asarray(equal.sum(axis=0), dtype=np.float64)


def beyond_chance(rows: float, each: Series, pairs: int) -> float:
    """Return the share of rows that repeat the row before, less what a coarse converter makes of independent values.

    Parameters
    ----------
    rows, each : as `equal_rows` counts them.
    pairs : of neighbouring rows.
    """
    if pairs < 1 or not len(each):
        return 0.0
    chance = float(np.prod(each / pairs))
    return max(0.0, (rows / pairs - chance) / (1.0 - chance)) if chance < 1.0 else 0.0


def find_held(recording: Recording) -> Held | None:
    """Return how often values stand in a recording's rows, or None where rows are samples.

    Repeats here and there, as where a lost row was replaced by the row before, are not meant.

    Parameters
    ----------
    recording : as read; the first million of its rows are looked at.
    """
    head = recording.between(0, min(len(recording), _LOOKED_AT)) if len(recording) else recording
    signals = np.column_stack(list(head.channels.values()))
    signals = signals[:, np.any(signals[1:] != signals[:-1], axis=0)]
    pairs = len(signals) - 1
    if pairs < 2 * _LEAST_STUCK or not signals.shape[1]:
        return None
    rows, each = equal_rows(signals)
    if beyond_chance(rows, each, pairs) < REPEATS and signals.shape[1] > 1:
        return None
    runs = np.diff(_starts(signals, head.gaps), append=len(signals))[1:-1]
    held = _held(runs, rows / pairs, recording.rate)
    if held is None or (signals.shape[1] > 1 and _is_chance(rows / pairs, each / pairs)):
        return None
    if signals.shape[1] == 1 and (held.fewest < 2 or held.most > held.fewest + 1):
        return None
    return held


def say_held(held: Held) -> str:
    """Return the sentence about values that were written several times."""
    usual = f"{held.fewest} to {held.most}" if held.most > held.fewest else f"{held.fewest}"
    return (
        f"Rows are repeated: each value stands {usual} times ({100.0 * held.share:.0f} % of the rows "
        "repeat the row before in every channel). A logger that writes faster than the sensor gives "
        f"new values does that. Each value is taken once, at {held.rate:.4g} Hz instead of "
        f"{held.recorded:.4g} Hz."
    )


def without_repeats(recording: Recording, held: Held, before: Recording | None = None) -> Recording | None:
    """Return a recording with each value once, evenly in time between gaps; None if nothing is left.

    A value that stands far longer than usual is a sensor that stood still: behind it there is a gap.

    Parameters
    ----------
    recording, held : as read, and how its values are held.
    before : the row before its first one, where there is one.
    """
    signals = np.column_stack(list(recording.channels.values()))
    starts = _starts(signals, recording.gaps)
    lengths = np.diff(starts, append=len(signals))
    if before is not None and not _is_new(recording, before):
        starts, lengths = starts[1:], lengths[1:]
    if not len(starts):
        return None
    stuck = starts[1:][lengths[:-1] > held.stuck]
    cuts = np.union1d(stuck, np.array(recording.gaps, dtype=np.int64)).astype(np.int64)
    gaps = tuple(int(place) for place in np.searchsorted(starts, cuts) if 0 < place < len(starts))

    time = _even(recording.time[starts], gaps)
    return of_each(recording, lambda values: values[starts], time=time, rate=held.rate, gaps=gaps)


def of_each(recording: Recording, function: Callable[[AnyArray], AnyArray], **others: Any) -> Recording:
    """Return a recording whose triads and temperature are made of its own by a function.

    Parameters
    ----------
    recording, function : as read; of an array whose rows are samples.
    others : fields of the recording that are not as they were.
    """
    kept = {name: getattr(recording, name) for name in ("specific_force", "angular_rate", "temperature")}
    made = {name: None if values is None else function(values) for name, values in kept.items()}
    return replace(recording, **made, **others)


def blocks_without_repeats(
    read: Callable[[], Iterable[Recording]], held: Held
) -> Callable[[], Iterable[Recording]]:
    """Return a reading whose blocks have each value once.

    Parameters
    ----------
    read, held : the reading, and how its values are held.
    """

    def blocks() -> Iterator[Recording]:
        before: Recording | None = None
        for block in read():
            found = without_repeats(block, held, before)
            before = block.between(len(block) - 1, len(block))
            if found is not None:
                yield found

    return blocks


def _held(runs: Integers, share: float, rate: float) -> Held | None:
    """The usual run of rows, where runs are long or come in good order."""
    if len(runs) < _LEAST_STUCK:
        return None
    usual = runs[runs <= max(_LEAST_STUCK, _STUCK * float(np.median(runs)))]
    low, high = (round(float(q)) for q in np.quantile(usual, [0.05, 0.95]))
    if share < _OFTEN:
        places = np.flatnonzero(usual > 1)
        if len(places) < _LEAST_STUCK:
            return None
        near, far = np.quantile(np.diff(places), [0.5 * (1.0 - _REGULAR), 0.5 * (1.0 + _REGULAR)])
        if far - near > 2.0:
            return None
        high = max(high, 2)
    return Held(float(np.mean(usual)), low, high, share, rate)


def _is_chance(share: float, each: Series) -> bool:
    """Whether channels repeat one by one, as those of a coarse converter do, and not all together."""
    chance, most = float(np.prod(each)), float(np.min(each))
    return share - chance < 0.5 * (most - chance)


def _starts(signals: Table, gaps: tuple[int, ...]) -> Integers:
    """Rows at which a new value stands; after a gap every value is new."""
    new = np.append(True, np.any(signals[1:] != signals[:-1], axis=1))
    new[list(gaps)] = True
    return np.flatnonzero(new).astype(np.int64)


def _is_new(recording: Recording, before: Recording) -> bool:
    """Whether the first row is not the one before it over again."""
    now, then = (
        np.array([values[k] for values in each.channels.values()])
        for each, k in ((recording, 0), (before, -1))
    )
    near = float(recording.time[0] - before.time[-1]) < 1.5 / recording.rate
    return not (near and bool(np.all(now == then)))


def _even(time: Series, gaps: tuple[int, ...]) -> Series:
    """Stamps spread evenly between gaps: which of its rows a value came in is the logger's chance."""
    even = np.empty(len(time))
    for a, b in pairwise([0, *gaps, len(time)]):
        even[a:b] = np.linspace(time[a], time[b - 1], b - a)
    return even
