"""What is averaged of a recording at rest in two readings of its blocks: deviations, spectra and levels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Table, block_means
from tumble.counting import counted
from tumble.errors import RecordingError
from tumble.noise.deviation import Deviation, StreamedDeviation, Taus
from tumble.noise.evidence import RestEvidence
from tumble.noise.held import of_each
from tumble.noise.lines import FoundLine, find_lines
from tumble.noise.spectrum import PowerSpectrum, StreamedSpectrum, segment_of
from tumble.noise.suitability import Suitability
from tumble.recording import Recording, find_gaps
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor

_BINS = 20  # of the spectrum, a decade
_LEVEL_POINTS = 600  # of the drawing of levels over time
_LINE_SAMPLES = 1 << 19  # of the longest rest, in which vibration lines are looked for
_TOLD = ("assumed", "doubtful", "mended")  # remarks of the reader that noise depends on
_COLUMNS = ": time "  # in the reader's remark on what the columns are


@dataclass(frozen=True)
class Averages:
    """What is averaged of a recording."""

    curve: Deviation
    octaves: Deviation
    lines: list[tuple[FoundLine, ...]]
    spectra: dict[str, PowerSpectrum]
    level_time: Series
    levels: Table


def told(recording: Recording) -> list[str]:
    """Return what the reader assumed or mended, and which triad is missing, in words.

    Parameters
    ----------
    recording : as read.
    """
    said = [remark.text for remark in recording.remarks if remark.kind in _TOLD]
    missing = [
        name
        for name, triad in (("accelerometer", recording.specific_force), ("gyro", recording.angular_rate))
        if triad is None
    ]
    found = [
        remark.text for remark in recording.remarks if remark.kind == "found" and _COLUMNS in remark.text
    ]
    if missing and found:
        said.append(
            f"There is no {missing[0]}: what was found is {found[0].rstrip('.')}. Name others by `--columns`."
        )
    return said


def factors_of(recording: Recording, names: tuple[str, ...]) -> tuple[Series, tuple[str, ...]]:
    """Return the factors of channels to SI, 1 where there is none, and the units that they then have.

    Parameters
    ----------
    recording, names : with its units; of the channels.
    """
    factors: list[float] = []
    units: list[str] = []
    for name in names:
        gyro = name.startswith("g")
        factor = (
            angular_rate_factor(recording.angular_rate_unit)
            if gyro
            else specific_force_factor(recording.specific_force_unit)
        )
        units.append("counts" if factor is None else "rad/s" if gyro else "m/s²")
        factors.append(1.0 if factor is None else factor)
    return np.array(factors), tuple(units)


def _for_lines(suitability: Suitability) -> tuple[int, int]:
    """The stretch in which lines are looked for: the longest rest, or the beginning of it."""
    start, stop = max(suitability.pieces, key=lambda piece: piece[1] - piece[0])
    return start, min(stop, start + _LINE_SAMPLES)


def survey_blocks(
    blocks: Iterable[tuple[Recording, bool]], *, whole: bool
) -> tuple[RestEvidence, list[str], Recording]:
    """Return of the first reading what rest is judged by, what the reader told, and the first sample.

    Parameters
    ----------
    blocks : of the recording.
    whole : whether it is one block.

    Raises
    ------
    RecordingError
        If there is no sample.
    """
    evidence, words, first = RestEvidence(whole=whole), dict[str, None](), None
    for block, after_gap in blocks:
        first = block.between(0, 1) if first is None else first
        words |= dict.fromkeys(told(block))
        evidence.add(block, after_gap=after_gap)
    if first is None:
        raise RecordingError("--skip leaves nothing of the recording.")
    evidence.close()
    return evidence, list(words), first


def slopes_over_temperature(evidence: RestEvidence, said: list[str]) -> tuple[Series, float] | None:
    """Return slopes of all channels over temperature and the mean temperature, or None where it does not change.

    Parameters
    ----------
    evidence, said : of the first reading, from which the line is taken off; the sentences so far.
    """
    means, others = evidence.grains()
    celsius = others[:, 0]
    if not len(celsius) or not np.all(np.isfinite(celsius)) or float(np.ptp(celsius)) == 0.0:
        said.append("There is no temperature that changes in the recording: nothing was taken off.")
        return None
    warmth = celsius - celsius.mean()
    said.append(
        f"A straight line in the temperature ({float(np.ptp(celsius)):.2g} °C) is taken off each channel: what the "
        "bias does with temperature is not in the numbers below."
    )
    slopes = warmth @ (means - means.mean(axis=0)) / (warmth @ warmth)
    evidence.straighten(slopes, float(celsius.mean()))
    return slopes, float(celsius.mean())


def average_blocks(
    blocks: Iterable[tuple[Recording, bool]],
    evidence: RestEvidence,
    suitability: Suitability,
    factors: Series,
    slopes: tuple[Series, float] | None,
    taus: Taus,
    places: int | None,
) -> Averages:
    """Return of the second reading the deviations and spectra of what is at rest.

    Parameters
    ----------
    blocks, evidence, suitability : of the recording, the first reading, and which stretches are at rest.
    factors : of its channels, to SI.
    slopes : over temperature, to be taken off, or None.
    taus, places : of the curves, as for `StreamedDeviation`.
    """
    names = suitability.channels
    columns = [evidence.names.index(name) for name in names]
    curves = (taus,) if isinstance(taus, str) and taus == "octave" else (taus, "octave")
    deviations = [StreamedDeviation(evidence.rate, len(names), each, places) for each in curves]
    of_triad = {
        letter: [k for k, name in enumerate(names) if name.startswith(letter)]
        for letter in "ag"
        if any(name.startswith(letter) for name in names)
    }
    segment = segment_of(suitability.longest)
    spectra = {letter: StreamedSpectrum(evidence.rate, len(own), segment) for letter, own in of_triad.items()}
    at, (first, last) = 0, _for_lines(suitability)
    kept: list[Table] = []
    for block, _ in counted(blocks, evidence.samples, lambda one: len(one[0])):
        named = block.channels
        signals = np.column_stack([named[name] for name in names])
        if slopes is not None and block.temperature is not None:
            signals -= np.outer(block.temperature - slopes[1], slopes[0][columns])
        signals *= factors
        for start, stop in suitability.pieces:
            a, b = max(start - at, 0), min(stop - at, len(block))
            if a >= b:
                continue
            part, begins = signals[a:b], a + at == start
            for deviation in deviations:
                deviation.add(part, after_gap=begins)
            for letter, spectrum in spectra.items():
                spectrum.add(part[:, of_triad[letter]], after_gap=begins)
        if last > at and first < at + len(block):
            kept.append(signals[max(first - at, 0) : last - at])
        at += len(block)
    lined = np.concatenate(kept)
    return Averages(
        deviations[0].deviation(),
        deviations[-1].deviation(),
        [find_lines(lined[:, k], evidence.rate) for k in range(len(names))],
        {letter: each.spectrum(bins_per_decade=_BINS) for letter, each in spectra.items()},
        *_levels_of(evidence, suitability, columns, factors),
    )


def _levels_of(
    evidence: RestEvidence, suitability: Suitability, columns: list[int], factors: Series
) -> tuple[Series, Table]:
    means, others = evidence.grains()
    starts = evidence.starts()
    size = max(1, len(means) // _LEVEL_POINTS)
    at_rest = np.zeros(len(starts))
    for start, stop in suitability.pieces:
        at_rest[(starts >= start) & (starts + evidence.grain <= stop)] = 1.0
    levels = block_means(means, size)[:, columns] * factors
    levels[block_means(at_rest, size) < 1.0] = np.nan
    return block_means(others[:, 1], size), levels


BRIDGED = 1e-3
"""Share of samples that may be filled in: less than any interval is wide."""

_LONGEST = 1.0  # s, of a gap that is filled in
_HEAD_START = 100_000  # samples that count as read before the first, so that an early gap may be filled in
_STAMPS = 2000  # on either side of the border of two blocks, by which a gap between them is judged

Integers = npt.NDArray[np.int64]


def _lost_samples(recording: Recording) -> Integers:
    """Return how many samples are missing at each gap of a recording."""
    index = np.array(recording.gaps, dtype=np.int64)
    return np.rint(np.diff(recording.time)[index - 1] * recording.rate).astype(np.int64) - 1


def bridge(recording: Recording, budget: float) -> tuple[Recording, int, int]:
    """Fill short gaps in on a straight line; return the recording, the samples filled in and in how many places.

    Parameters
    ----------
    recording : as read.
    budget : samples that may be filled in. Where it does not suffice, nothing is filled in.
    """
    if not recording.gaps:
        return recording, 0, 0
    lost = _lost_samples(recording)
    short = (lost >= 1) & (lost <= _LONGEST * recording.rate)
    total = int(lost[short].sum())
    if total == 0 or total > budget:
        return recording, 0, 0
    index = np.array(recording.gaps, dtype=np.int64)
    added = np.bincount(index[short], lost[short], minlength=len(recording))[: len(recording)].cumsum()
    grid = np.arange(len(recording), dtype=np.float64) + added
    full = np.arange(float(grid[-1]) + 1.0)

    def filled(values: AnyArray) -> AnyArray:
        result = np.empty((len(full), *values.shape[1:]))
        for place in np.ndindex(values.shape[1:]):
            result[:, *place] = np.interp(full, grid, values[:, *place])
        return result

    gaps = tuple(int(grid[i]) for i in index[~short])
    bridged = of_each(recording, filled, time=np.interp(full, grid, recording.time), gaps=gaps)
    return bridged, total, int(np.count_nonzero(short))


def say_bridged(total: int, places: int, samples: int) -> str:
    """Return the sentence about samples that were filled in.

    Parameters
    ----------
    total, places : samples filled in, and in how many places.
    samples : of the recording.
    """
    return (
        f"{total} lost sample(s) in {places} place(s) are filled in on a straight line, which takes that share "
        f"({100.0 * total / samples:.2g} %) off the variance at short averaging times."
    )


class BridgedBlocks:
    """Blocks of a recording one after another, short gaps filled in, what is to be skipped left out.

    Every reading gives the same blocks.

    Parameters
    ----------
    read : begins a reading anew.
    skip : s at the start to leave out.
    whole : the recording is one block.
    """

    def __init__(
        self, read: Callable[[], Iterable[Recording]], skip: float = 0.0, *, whole: bool = False
    ) -> None:
        self._read, self._skip = read, skip
        self._head_start = 0 if whole else _HEAD_START
        self.filled, self.places, self.samples = 0, 0, 0

    def __iter__(self) -> Iterator[tuple[Recording, bool]]:
        """Yield each block, and whether samples are missing before it."""
        self.filled, self.places, self.samples = 0, 0, 0
        before: Recording | None = None
        begin: float | None = None
        for block in self._read():
            begin = float(block.time[0]) + self._skip if begin is None else begin
            first = int(np.searchsorted(block.time, begin)) if self._skip > 0.0 else 0
            if first >= len(block):
                continue
            taken = block.between(first, len(block))
            after_gap, joined = _joined(before, taken)
            budget = BRIDGED * (self.samples + len(taken) + self._head_start) - self.filled
            whole, total, places = bridge(joined, budget)
            self.filled, self.places = self.filled + total, self.places + places
            self.samples += len(taken)
            before = taken.between(max(0, len(taken) - _STAMPS), len(taken))
            if joined is taken:
                yield whole, after_gap
            else:
                # The row before the gap was lent for the line across it, and has been handed over.
                still = 1 in whole.gaps
                rest = whole.between(1, len(whole))
                yield rest, still


def _joined(before: Recording | None, block: Recording) -> tuple[bool, Recording]:
    """Whether samples are missing before a block; and the block, with the row before it if they are."""
    if before is None:
        return False, block
    stamps = np.concatenate([before.time, block.time[:_STAMPS]])
    if len(before) not in find_gaps(stamps, block.rate):
        return False, block
    last = before.between(len(before) - 1, len(before))

    def put_together(a: AnyArray | None, b: AnyArray | None) -> AnyArray | None:
        return None if a is None or b is None else np.concatenate([a, b])

    joined = replace(
        block,
        time=np.concatenate([last.time, block.time]),
        specific_force=put_together(last.specific_force, block.specific_force),
        angular_rate=put_together(last.angular_rate, block.angular_rate),
        temperature=put_together(last.temperature, block.temperature),
        gaps=(1, *(i + 1 for i in block.gaps)),
    )
    return True, joined
