"""What is averaged of a recording at rest: deviations, spectra and levels, in memory or from two readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Table, block_means
from tumble.counting import counted
from tumble.errors import RecordingError
from tumble.noise.bridging import BridgedBlocks
from tumble.noise.deviation import Deviation, Taus, allan_deviation
from tumble.noise.evidence import Survey
from tumble.noise.lines import FoundLine, find_lines
from tumble.noise.spectrum import PowerSpectrum, StreamedSpectrum, power_spectrum, segment_of
from tumble.noise.streaming import StreamedDeviation
from tumble.noise.suitability import Suitability
from tumble.recording import Recording
from tumble.recording.doctor import channels_of
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor

_BINS = 20  # of the spectrum, a decade
_LEVEL_POINTS = 600  # of the drawing of levels over time
_LINE_SAMPLES = 1 << 19  # of the longest rest, in which vibration lines are looked for
_TOLD = ("assumed", "doubtful", "mended")  # remarks of the reader that noise depends on
_COLUMNS = ": time "  # in the reader's remark on what the columns are


@dataclass(frozen=True, slots=True)
class Averages:
    """What is averaged of a recording, in memory or from its blocks."""

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


# -- in memory -------------------------------------------------------------------------------------


def average_whole(recording: Recording, suitability: Suitability, factors: Series, taus: Taus) -> Averages:
    """Return what is averaged of a recording in memory.

    Parameters
    ----------
    recording, suitability : as read, and which stretches of it are at rest.
    factors : of its channels, to SI.
    taus : of the curves.
    """
    signals = _signals(recording, suitability, factors)
    gaps = tuple(start for start, _ in suitability.pieces)
    return Averages(
        allan_deviation(signals, recording.rate, taus=taus, gaps=gaps),
        allan_deviation(signals, recording.rate, taus="octave", gaps=gaps),
        _lines(signals[slice(*_for_lines(suitability))], recording.rate),
        _spectra(signals, recording.rate, gaps, suitability.channels),
        *_levels(recording.time, signals),
    )


def without_temperature(recording: Recording, said: list[str]) -> Recording:
    """Return a recording less a straight line in the temperature, and say by how much.

    Parameters
    ----------
    recording, said : as read; the sentences so far, to which one is added.
    """
    celsius = recording.temperature
    if celsius is None or not np.all(np.isfinite(celsius)) or float(np.ptp(celsius)) == 0.0:
        said.append(_NO_TEMPERATURE)
        return recording
    warmth = celsius - celsius.mean()

    def flat(triad: AnyArray | None) -> AnyArray | None:
        if triad is None:
            return None
        slope = warmth @ (triad - triad.mean(axis=0)) / (warmth @ warmth)
        return triad - np.outer(warmth, slope)

    said.append(_taken_off(float(np.ptp(celsius))))
    return replace(
        recording,
        specific_force=flat(recording.specific_force),
        angular_rate=flat(recording.angular_rate),
    )


_NO_TEMPERATURE = "There is no temperature that changes in the recording: nothing was taken off."


def _taken_off(span: float) -> str:
    return (
        f"A straight line in the temperature ({span:.2g} °C) is taken off each channel: what the bias does "
        "with temperature is not in the numbers below."
    )


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


def _signals(recording: Recording, suitability: Suitability, factors: Series) -> Table:
    """Signals in SI where there is a factor, nan outside the pieces."""
    named = channels_of(recording)
    signals = np.column_stack([named[name] for name in suitability.channels])
    signals *= factors
    used = np.zeros(len(signals), dtype=bool)
    for start, stop in suitability.pieces:
        used[start:stop] = True
    signals[~used] = np.nan
    return signals


def _for_lines(suitability: Suitability) -> tuple[int, int]:
    """The stretch in which lines are looked for: the longest rest, or the beginning of it."""
    start, stop = max(suitability.pieces, key=lambda piece: piece[1] - piece[0])
    return start, min(stop, start + _LINE_SAMPLES)


def _lines(signals: Table, rate: float) -> list[tuple[FoundLine, ...]]:
    return [find_lines(signals[:, k], rate) for k in range(signals.shape[1])]


def _levels(time: Series, signals: Table) -> tuple[Series, Table]:
    size = max(1, len(signals) // _LEVEL_POINTS)
    return block_means(time, size), block_means(signals, size)


def _spectra(
    signals: Table, rate: float, gaps: tuple[int, ...], names: tuple[str, ...]
) -> dict[str, PowerSpectrum]:
    return {
        letter: power_spectrum(
            signals[:, [k for k, name in enumerate(names) if name.startswith(letter)]],
            rate,
            bins_per_decade=_BINS,
            gaps=gaps,
        )
        for letter in "ag"
        if any(name.startswith(letter) for name in names)
    }


# -- from blocks -----------------------------------------------------------------------------------


def survey_blocks(blocks: BridgedBlocks, say: Callable[[str], None]) -> tuple[Survey, list[str], Recording]:
    """Return of the first reading what rest is judged by, what the reader told, and the first sample.

    Parameters
    ----------
    blocks, say : of the recording; the latter is called with a sentence on how far it is.

    Raises
    ------
    RecordingError
        If there is no sample.
    """
    survey, words, first = Survey(), dict[str, None](), None
    say("reading, 1 of 2")
    for block, after_gap in blocks:
        first = block.between(0, 1) if first is None else first
        words |= dict.fromkeys(told(block))
        survey.add(block, after_gap=after_gap)
    if first is None:
        raise RecordingError("--skip leaves nothing of the recording.")
    survey.close()
    return survey, list(words), first


def slopes_over_temperature(survey: Survey, said: list[str]) -> tuple[Series, float] | None:
    """Return slopes of all channels over temperature and the mean temperature, or None where it does not change.

    Parameters
    ----------
    survey, said : of the first reading, from which the line is taken off; the sentences so far.
    """
    means, others = survey.seconds()
    celsius = others[:, 0]
    if not len(celsius) or not np.all(np.isfinite(celsius)) or float(np.ptp(celsius)) == 0.0:
        said.append(_NO_TEMPERATURE)
        return None
    warmth = celsius - celsius.mean()
    said.append(_taken_off(float(np.ptp(celsius))))
    slopes = warmth @ (means - means.mean(axis=0)) / (warmth @ warmth)
    survey.straighten(slopes, float(celsius.mean()))
    return slopes, float(celsius.mean())


def average_blocks(
    blocks: BridgedBlocks,
    survey: Survey,
    suitability: Suitability,
    factors: Series,
    slopes: tuple[Series, float] | None,
    say: Callable[[str], None],
) -> Averages:
    """Return of the second reading the deviations and spectra of what is at rest.

    Parameters
    ----------
    blocks, survey, suitability : of the recording, the first reading, and which stretches are at rest.
    factors : of its channels, to SI.
    slopes : over temperature, to be taken off, or None.
    say : called with a sentence on how far it is.
    """
    names = suitability.channels
    columns = [survey.names.index(name) for name in names]
    octaves = StreamedDeviation(survey.rate, len(names))
    wanted = StreamedDeviation(survey.rate, len(names), "log")
    letters = [letter for letter in "ag" if any(name.startswith(letter) for name in names)]
    of_triad = {letter: [k for k, name in enumerate(names) if name.startswith(letter)] for letter in letters}
    segment = segment_of(suitability.longest)
    spectra = {letter: StreamedSpectrum(survey.rate, len(of_triad[letter]), segment) for letter in letters}
    at, (first, last) = 0, _for_lines(suitability)
    kept: list[Table] = []
    say("reading, 2 of 2")
    for block, _ in counted(blocks, survey.samples, lambda one: len(one[0])):
        signals = np.column_stack(list(channels_of(block).values()))
        if slopes is not None and block.temperature is not None:
            signals -= np.outer(block.temperature - slopes[1], slopes[0])
        signals = signals[:, columns] * factors
        for start, stop in suitability.pieces:
            a, b = max(start - at, 0), min(stop - at, len(block))
            if a >= b:
                continue
            part, begins = signals[a:b], a + at == start
            octaves.add(part, after_gap=begins)
            wanted.add(part, after_gap=begins)
            for letter, spectrum in spectra.items():
                spectrum.add(part[:, of_triad[letter]], after_gap=begins)
        kept.append(signals[max(first - at, 0) : max(last - at, 0)].copy())
        at += len(block)
    return Averages(
        wanted.deviation(),
        octaves.deviation(),
        _lines(np.concatenate(kept), survey.rate),
        {letter: each.spectrum(bins_per_decade=_BINS) for letter, each in spectra.items()},
        *_levels_of(survey, suitability, columns, factors),
    )


def _levels_of(
    survey: Survey, suitability: Suitability, columns: list[int], factors: Series
) -> tuple[Series, Table]:
    means, others = survey.seconds()
    starts = survey.starts()
    at_rest = np.zeros(len(starts), dtype=bool)
    for start, stop in suitability.pieces:
        at_rest |= (starts >= start) & (starts + survey.block <= stop)
    levels = means[:, columns] * factors
    levels[~at_rest] = np.nan
    return _levels(others[:, 1], levels)
