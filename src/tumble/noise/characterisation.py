"""A recording at rest characterised: deviations and spectrum of every channel, and the terms in them.

A recording is read twice, block by block: once to see where it is at rest, once to average, in memory that hardly grows
with its length. One that is in memory is one block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series, Table
from tumble.errors import RecordingError
from tumble.noise.advice import advise
from tumble.noise.averages import (
    BridgedBlocks,
    average_blocks,
    factors_of,
    say_bridged,
    slopes_over_temperature,
    survey_blocks,
)
from tumble.noise.channel import FLOOR, Channel, characterise_channel
from tumble.noise.deviation import PLACES, Taus
from tumble.noise.fitting.weighted_fit import Method
from tumble.noise.held import Held, blocks_without_repeats, find_held, say_held
from tumble.noise.spectrum import PowerSpectrum
from tumble.noise.suitability import Suitability, judge_rest
from tumble.recording import Recording, Source
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.noise.channel import Channel
    from tumble.noise.fitting.fit import Term


_LEAST_SAMPLES = 16


@dataclass(frozen=True)
class Characterisation:
    """Noise of all channels of a recording.

    Attributes
    ----------
    suitability : which stretches were used, and what was found on the way.
    channels : in the order of the recording.
    spectra : by triad letter ("a", "g"): one-sided densities of its channels in their unit, in bins.
    level_time, levels : (points,) s and (points, channels): means over time, what is drawn to look for drift.
    remarks : sentences beyond those of the suitability.
    sources : files that the recording was read from.
    rate, duration : Hz, and s from the first to the last sample.
    streamed : whether it was read block by block.
    held : how its values were written several times over, or None; the rate is then that of new values.
    """

    suitability: Suitability
    channels: tuple[Channel, ...]
    spectra: dict[str, PowerSpectrum]
    level_time: Series
    levels: Table
    remarks: tuple[str, ...]
    sources: tuple[Source, ...]
    rate: float
    duration: float
    streamed: bool = False
    held: Held | None = None

    @property
    def sentences(self) -> tuple[str, ...]:
        """Everything that was found, in words."""
        return (*self.suitability.remarks, *self.remarks)


def characterise(
    recording: Recording,
    *,
    skip: float = 0.0,
    remove_temperature: bool = False,
    taus: Taus = "log",
    method: Method = "curve",
) -> Characterisation:
    """Return deviations, spectra and terms of all channels of a recording at rest.

    Parameters
    ----------
    recording : as read, in any unit.
    skip : s at the start to leave out, such as warm-up.
    remove_temperature : take a straight line in the temperature off each channel first.
    taus : of the curves, as for `tumble.noise.deviation.allan_deviation`. The model is fitted at octaves.
    method : of the fit: "curve", of the logarithm of the whole curve, or "moments", of its wavelet variances.

    Raises
    ------
    RecordingError
        If nothing of it is at rest, it is too short, or it has neither triad.
    UsageError
        If no averaging time fits.
    """
    if recording.specific_force is None and recording.angular_rate is None:
        raise RecordingError(
            "The recording has neither accelerometer nor gyro: there is no noise to characterise."
        )
    return _characterise(lambda: [recording], skip, remove_temperature, method, taus, whole=True)


def characterise_blocks(
    read: Callable[[], Iterable[Recording]],
    *,
    skip: float = 0.0,
    remove_temperature: bool = False,
    method: Method = "curve",
    progress: Callable[[str], None] | None = None,
) -> Characterisation:
    """Return the same of a recording of any length that is read twice, block by block.

    Memory grows by some hundred bytes for each second of the recording. Above 128 samples differences begin
    at every 65th to 128th part of an averaging time.

    Parameters
    ----------
    read : begins a reading; gives consecutive blocks.
    skip, remove_temperature, method : as for `characterise`.
    progress : called with a sentence on how far it is.

    Raises
    ------
    RecordingError
        If nothing of it is at rest, or it is too short.
    UsageError
        If no averaging time fits.
    """
    return _characterise(read, skip, remove_temperature, method, progress=progress)


def _characterise(
    read: Callable[[], Iterable[Recording]],
    skip: float,
    remove_temperature: bool,
    method: Method,
    taus: Taus = "log",
    *,
    whole: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Characterisation:
    """Characterise a recording of blocks; one that is one block, at every overlapping place."""

    def say(stage: str) -> None:
        if progress is not None:
            progress(stage)

    held = next((find_held(block) for block in read()), None)
    bridged = BridgedBlocks(read if held is None else blocks_without_repeats(read, held), skip, whole=whole)
    say("reading, 1 of 2")
    blocks = list(bridged) if whole else bridged
    evidence, said, first = survey_blocks(blocks, whole=whole)
    said += [] if held is None else [say_held(held)]
    said += [say_bridged(bridged.filled, bridged.places, evidence.samples)] if bridged.filled else []
    slopes = slopes_over_temperature(evidence, said) if remove_temperature else None
    suitability = _usable(judge_rest(evidence))
    factors, units = factors_of(first, suitability.channels)
    say("reading, 2 of 2")
    averages = average_blocks(blocks, evidence, suitability, factors, slopes, taus, None if whole else PLACES)
    say("finding the terms")
    channels = tuple(
        characterise_channel(
            name,
            unit,
            averages.curve.channel(k),
            averages.octaves.channel(k),
            averages.lines[k],
            suitability.shortest,
            method,
        )
        for k, (name, unit) in enumerate(zip(suitability.channels, units, strict=True))
    )
    return Characterisation(
        suitability,
        channels,
        averages.spectra,
        averages.level_time,
        averages.levels,
        (*said, *advise(channels, averages.octaves)),
        first.sources,
        evidence.rate,
        evidence.stop_time - evidence.start_time,
        not whole,
        held,
    )


def _usable(suitability: Suitability) -> Suitability:
    if suitability.longest < _LEAST_SAMPLES:
        why = " ".join(suitability.remarks) or f"The longest has {suitability.longest}."
        raise RecordingError(
            f"No stretch at rest of {_LEAST_SAMPLES} samples or more, so there is no noise to analyse. {why}"
        )
    return suitability


__all__ = ["FLOOR", "Channel", "Characterisation", "characterise", "characterise_blocks"]


COLLAPSE = (
    "mean of variances: the root of the mean of the axes' squared coefficients. An axis that does "
    "not show the term counts as zero, known to half its upper limit squared. Worst axis: the "
    "largest coefficient, and whose it is. N is that of `random_walk`, with the white part of short "
    "Gauss-Markov processes"
)
"""How three axes become one, in words."""

_LETTERS = "QNBKR"


@dataclass(frozen=True)
class TriadTerm:
    """A coefficient of a triad, in the unit of its axes.

    Attributes
    ----------
    letter : of IEEE Std 952.
    mean, mean_sigma : root of the mean of the squares over the axes, and its standard uncertainty.
    worst, worst_sigma, worst_axis : the largest of the axes, its standard uncertainty, and its name.
    seen : names of the axes that show it.
    axes : how many there are.
    """

    letter: str
    mean: float
    mean_sigma: float
    worst: float
    worst_sigma: float
    worst_axis: str
    seen: tuple[str, ...]
    axes: int


def triad_terms(channels: Sequence[Channel]) -> tuple[TriadTerm, ...]:
    """Return the coefficients of a triad that at least one of its axes shows.

    The axes' errors are taken as independent.

    Parameters
    ----------
    channels : of one triad, those that live.
    """
    found: list[TriadTerm] = []
    for letter in _LETTERS:
        shown = {channel.name: term for channel in channels if (term := _term(channel, letter)) is not None}
        if not shown:
            continue
        values = np.array([term.value for term in shown.values()])
        sigmas = np.array([term.sigma for term in shown.values()])
        mean = float(np.sqrt(np.sum(values**2) / len(channels)))
        spread = float(np.sqrt(np.sum(sigmas**2) / len(channels)))
        if mean > 0.0:
            # Half the uncertainty of each square; a square that is not seen is zero to half its upper limit.
            halves = [
                *(values * sigmas),
                *(0.25 * _limit(c, letter) ** 2 for c in channels if c.name not in shown),
            ]
            spread = float(np.sqrt(np.sum(np.square(halves))) / (len(channels) * mean))
        worst = max(shown, key=lambda name: shown[name].value)
        found.append(
            TriadTerm(
                letter,
                mean,
                spread,
                shown[worst].value,
                shown[worst].sigma,
                worst,
                tuple(shown),
                len(channels),
            )
        )
    return tuple(found)


def _limit(channel: Channel, letter: str) -> float:
    """The upper limit of a coefficient that an axis does not show; 0 where none is known."""
    limit = channel.unseen.get(letter, 0.0)
    return limit if np.isfinite(limit) else 0.0


def _term(channel: Channel, letter: str) -> Term | None:
    return channel.random_walk if letter == "N" else channel.term(letter)
