"""A recording at rest characterised: deviations and spectrum of every channel, and the terms in them.

A recording in memory is taken as it is; one that is larger is read twice, block by block: once to see where
it is at rest, once to average, in memory that hardly grows with its length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from math import log, pi, sqrt

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.errors import RecordingError, UsageError
from tumble.noise.advice import advise
from tumble.noise.bridging import BridgedBlocks, bridge, say_bridged
from tumble.noise.deviation import Deviation, Kind, Taus, allan_deviation
from tumble.noise.evidence import Survey, WholeEvidence
from tumble.noise.fit import NoiseFit, fit_curve
from tumble.noise.held import Held, blocks_without_repeats, find_held, say_held, without_repeats
from tumble.noise.lines import FoundLine, find_lines
from tumble.noise.spectrum import PowerSpectrum, StreamedSpectrum, power_spectrum, segment_of
from tumble.noise.streaming import StreamedDeviation
from tumble.noise.suitability import Suitability, judge_rest
from tumble.noise.white_part import WhitePart, white_beyond
from tumble.recording import Recording, Source
from tumble.recording.doctor import channels_of
from tumble.units import angular_rate_factor, specific_force_factor

FLOOR = sqrt(2.0 * log(2.0) / pi)
"""Allan deviation of flicker of B = 1: 0.664, whatever the averaging time (IEEE Std 952, annex C)."""

_LEAST_SAMPLES = 16
_OTHER_TAU = 0.01  # from which on another averaging time than was asked for is told
_BINS = 20  # of the spectrum, a decade
_LEVEL_POINTS = 600  # of the drawing of levels over time
# Ten degrees of freedom for each averaging time in the record: 1 over the square root of twice that is 22 %.
_WELL_KNOWN = 10.0
_MISFIT = 0.01  # probability below which a second and a third Gauss-Markov process are tried
_LINE_SAMPLES = 1 << 19  # of the longest rest, in which vibration lines are looked for
_TOLD = ("assumed", "mended")  # remarks of the reader that noise depends on
_COLUMNS = ": time "  # in the reader's remark on what the columns are


@dataclass(frozen=True, slots=True)
class Term:
    """One coefficient that a curve shows, in SI or counts.

    Attributes
    ----------
    letter : Q, N, B, K or R of IEEE Std 952; "sigma" and "correlation time" of a Gauss-Markov process.
    value, sigma : coefficient and its standard uncertainty.
    low, high : limits at the fit's confidence.
    """

    letter: str
    value: float
    sigma: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Channel:
    """One sensor of the recording.

    Attributes
    ----------
    name : ax to gz.
    unit : "m/s²" or "rad/s"; "counts" where the recording is in counts.
    curve : deviation of the kind and at the averaging times that were asked for, in that unit.
    allan : overlapping Allan deviation, averaging times an octave apart, which the model is fitted to.
    fit : the model of its noise, or None where there is none.
    terms : what the curve shows.
    floor, floor_tau : lowest point of the Allan deviation where it is known to a fifth, and its averaging time in s.
    without_fit : why there is no model, a sentence; empty where there is one.
    white : N over times longer than those of short Gauss-Markov processes; None where there are none.
    """

    name: str
    unit: str
    curve: Deviation
    allan: Deviation
    fit: NoiseFit | None
    terms: tuple[Term, ...]
    floor: float
    floor_tau: float
    without_fit: str = ""
    white: WhitePart | None = None

    @property
    def is_gyro(self) -> bool:
        """Whether it senses angular rate."""
        return self.name.startswith("g")

    @property
    def unseen(self) -> dict[str, float]:
        """Upper limits of the coefficients that the curve does not show, by letter."""
        return {} if self.fit is None else self.fit.limits

    @property
    def lines(self) -> tuple[FoundLine, ...]:
        """Vibration lines in its spectrum, strongest first."""
        return () if self.fit is None else self.fit.lines

    def term(self, letter: str) -> Term | None:
        """Return a term by its letter, or None if the curve does not show it."""
        return next((term for term in self.terms if term.letter == letter), None)

    @property
    def random_walk(self) -> Term | None:
        """N as a filter wants it: with what short Gauss-Markov processes are over longer times, or as fitted."""
        part = self.white
        return self.term("N") if part is None else Term("N", part.value, part.sigma, part.low, part.high)

    def fitted(self, tau: Series) -> Series:
        """Return the deviation of the fitted model at averaging times in s; nan without one.

        Of the kind of `curve`; of modified Allan and Hadamard deviations the model has none, and it is nan.
        """
        if self.fit is None or self.curve.kind not in ("overlapping", "haar"):
            return np.full(tau.shape, np.nan)
        part = 0.5 if self.curve.kind == "haar" else 1.0
        return np.sqrt(part * self.fit.model.allan_variance(tau, self.fit.rate))


@dataclass(frozen=True, slots=True)
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

    @property
    def kind(self) -> Kind:
        """Which deviation the channels' curves are."""
        return self.channels[0].curve.kind


@dataclass(frozen=True, slots=True)
class _Averages:
    """What is averaged of a recording, in memory or from its blocks."""

    curve: Deviation
    octaves: Deviation
    lines: list[tuple[FoundLine, ...]]
    spectra: dict[str, PowerSpectrum]
    level_time: Series
    levels: Table


def characterise(
    recording: Recording,
    *,
    skip: float = 0.0,
    remove_temperature: bool = False,
    kind: Kind = "overlapping",
    taus: Taus = "log",
) -> Characterisation:
    """Return deviations, spectra and terms of all channels of a recording at rest.

    Parameters
    ----------
    recording : as read, in any unit.
    skip : s at the start to leave out, such as warm-up.
    remove_temperature : take a straight line in the temperature off each channel first.
    kind, taus : of the curves, as for `tumble.noise.deviation.allan_deviation`. The model is fitted to the
        overlapping Allan deviation whatever they are.

    Raises
    ------
    RecordingError
        If nothing of it is at rest, or it is too short.
    UsageError
        If no averaging time fits, or the kind is not known.
    """
    said = _told(recording)
    recording = _after(recording, skip)
    held = find_held(recording)
    if held is not None:
        said.append(say_held(held))
        recording = without_repeats(recording, held) or recording
    recording, filled, places = bridge(recording)
    said += [say_bridged(filled, places, len(recording))] if filled else []
    if remove_temperature:
        recording = _without_temperature(recording, said)
    suitability = _usable(judge_rest(WholeEvidence(recording)))
    factors, units = _factors(recording, suitability.channels)
    signals = _signals(recording, suitability, factors)
    gaps = tuple(start for start, _ in suitability.pieces)
    averages = _Averages(
        allan_deviation(signals, recording.rate, kind=kind, taus=taus, gaps=gaps),
        allan_deviation(signals, recording.rate, taus="octave", gaps=gaps),
        _lines(signals[slice(*_for_lines(suitability))], recording.rate),
        _spectra(signals, recording.rate, gaps, suitability.channels),
        *_levels(recording.time, signals),
    )
    said += _say_taus(taus, averages.curve)
    return _gathered(
        suitability, units, averages, said, recording.sources, recording.rate, recording.duration, held=held
    )


def characterise_blocks(
    read: Callable[[], Iterable[Recording]],
    *,
    skip: float = 0.0,
    remove_temperature: bool = False,
    kind: Kind = "overlapping",
    taus: Taus = "log",
    progress: Callable[[str], None] | None = None,
) -> Characterisation:
    """Return the same of a recording of any length that is read twice, block by block.

    Memory grows by some hundred bytes for each second of the recording. Above 128 samples differences begin
    at every 65th to 128th part of an averaging time.

    Parameters
    ----------
    read : begins a reading; gives consecutive blocks.
    skip, remove_temperature, kind, taus : as for `characterise`, without the modified deviation and without
        all averaging times.
    progress : is told in words how far it is.

    Raises
    ------
    RecordingError
        If nothing of it is at rest, or it is too short.
    UsageError
        If the deviation cannot be had from blocks, or no averaging time fits.
    """
    say = progress or _silent
    # What cannot be had is told before anything is read.
    StreamedDeviation(1.0, 1, kind, taus if isinstance(taus, str) else "octave")
    held = next((find_held(block) for block in read()), None)
    blocks = BridgedBlocks(read if held is None else blocks_without_repeats(read, held), skip)
    survey, said, first = _surveyed(blocks, say)
    said += [] if held is None else [say_held(held)]
    said += [say_bridged(blocks.filled, blocks.places, survey.samples)] if blocks.filled else []
    slopes = _slopes(survey, said) if remove_temperature else None
    suitability = _usable(judge_rest(survey))
    factors, units = _factors(first, suitability.channels)
    averages = _averaged(blocks, survey, suitability, factors, slopes, kind, taus, say)
    said += _say_taus(taus, averages.curve)
    duration = survey.stop_time - survey.start_time
    return _gathered(
        suitability, units, averages, said, first.sources, survey.rate, duration, held=held, streamed=True
    )


def _say_taus(wanted: Taus, curve: Deviation) -> list[str]:
    """Say which of the averaging times that were asked for are others, or none."""
    said: list[str] = []
    for tau in () if isinstance(wanted, str) else wanted:
        nearest = float(curve.tau[int(np.argmin(np.abs(curve.tau - tau)))])
        # whole samples, and of blocks every 65th to 128th part
        if tau > 1.01 * float(curve.tau[-1]) or tau < 0.5 / curve.rate:
            span = f"{1.0 / curve.rate:.3g} s (one sample) to half of the longest rest"
            said.append(f"The averaging time {tau:g} s cannot be had of this recording: from {span}.")
        elif abs(nearest / tau - 1.0) > _OTHER_TAU:
            said.append(f"The averaging time {tau:g} s is taken as {nearest:g} s, whole samples.")
    return said


def _silent(stage: str) -> None:
    """Tell nobody."""


def _told(recording: Recording) -> list[str]:
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


def _usable(suitability: Suitability) -> Suitability:
    if suitability.longest < _LEAST_SAMPLES:
        why = " ".join(suitability.remarks) or f"The longest has {suitability.longest}."
        raise RecordingError(
            f"No stretch at rest of {_LEAST_SAMPLES} samples or more, so there is no noise to analyse. {why}"
        )
    return suitability


def _gathered(
    suitability: Suitability,
    units: tuple[str, ...],
    averages: _Averages,
    said: list[str],
    sources: tuple[Source, ...],
    rate: float,
    duration: float,
    *,
    held: Held | None,
    streamed: bool = False,
) -> Characterisation:
    """Fit the channels' models, and put everything together."""
    channels = tuple(
        _channel(
            name,
            unit,
            averages.curve.channel(k),
            averages.octaves.channel(k),
            averages.lines[k],
            suitability.shortest,
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
        sources,
        rate,
        duration,
        streamed,
        held,
    )


def _after(recording: Recording, skip: float) -> Recording:
    if skip <= 0.0:
        return recording
    first = int(np.searchsorted(recording.time, float(recording.time[0]) + skip))
    if first >= len(recording):
        raise RecordingError(f"--skip {skip:g} leaves nothing of {recording.duration:.4g} s.")
    return recording.between(first, len(recording))


# -- in memory -------------------------------------------------------------------------------------


def _without_temperature(recording: Recording, said: list[str]) -> Recording:
    """Take a straight line in temperature off, and say by how much."""
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


def _factors(recording: Recording, names: tuple[str, ...]) -> tuple[Series, tuple[str, ...]]:
    """Factors of the channels to SI, 1 where there is none, and the units that they then have."""
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
    count = len(signals) // size
    blocks = signals[: count * size].reshape(count, size, -1)
    return time[: count * size].reshape(count, size).mean(axis=1), blocks.mean(axis=1)


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


def _surveyed(blocks: BridgedBlocks, say: Callable[[str], None]) -> tuple[Survey, list[str], Recording]:
    """The first reading: what rest is judged by, what the reader told, and the first sample."""
    survey, told, first = Survey(), dict[str, None](), None
    for block, after_gap in blocks:
        first = block.between(0, 1) if first is None else first
        told |= dict.fromkeys(_told(block))
        survey.add(block, after_gap=after_gap)
        say(f"reading, 1 of 2: {survey.samples / 1e6:.1f} million samples")
    if first is None:
        raise RecordingError("--skip leaves nothing of the recording.")
    survey.close()
    return survey, list(told), first


def _slopes(survey: Survey, said: list[str]) -> tuple[Series, float] | None:
    """Slopes of all channels over temperature and the mean temperature, or None where it does not change."""
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


def _averaged(
    blocks: BridgedBlocks,
    survey: Survey,
    suitability: Suitability,
    factors: Series,
    slopes: tuple[Series, float] | None,
    kind: Kind,
    taus: Taus,
    say: Callable[[str], None],
) -> _Averages:
    """The second reading: deviations and spectra of what is at rest."""
    names = suitability.channels
    columns = [survey.names.index(name) for name in names]
    octaves = StreamedDeviation(survey.rate, len(names))
    wanted = StreamedDeviation(survey.rate, len(names), kind, taus)
    letters = [letter for letter in "ag" if any(name.startswith(letter) for name in names)]
    of_triad = {letter: [k for k, name in enumerate(names) if name.startswith(letter)] for letter in letters}
    segment = segment_of(suitability.longest)
    spectra = {letter: StreamedSpectrum(survey.rate, len(of_triad[letter]), segment) for letter in letters}
    at, (first, last) = 0, _for_lines(suitability)
    kept: list[Table] = []
    for block, _ in blocks:
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
        say(f"reading, 2 of 2: {100.0 * at / survey.samples:.0f} %")
    return _Averages(
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


# -- of one channel --------------------------------------------------------------------------------


def _channel(
    name: str,
    unit: str,
    curve: Deviation,
    octaves: Deviation,
    lines: tuple[FoundLine, ...],
    shortest: float,
) -> Channel:
    fit, why = _fit(octaves.from_tau(shortest), lines)
    # The finer curve, where it is an Allan deviation too.
    allan = curve if curve.kind == "overlapping" and len(curve) > len(octaves) else octaves
    known = (allan.edf[:, 0] >= _WELL_KNOWN) & (allan.tau >= shortest)
    known = known if np.any(known) else np.ones(len(allan), dtype=bool)
    lowest = int(np.argmin(np.where(known, allan.deviation[:, 0], np.inf)))
    return Channel(
        name,
        unit,
        curve,
        octaves,
        fit,
        () if fit is None else _terms(fit),
        float(allan.deviation[lowest, 0]),
        float(allan.tau[lowest]),
        why,
        None if fit is None else white_beyond(fit, octaves, _MISFIT),
    )


def _fit(octaves: Deviation, lines: tuple[FoundLine, ...]) -> tuple[NoiseFit | None, str]:
    """The model, with more than one Gauss-Markov process only where one does not fit; or why there is none."""
    try:
        fit = fit_curve(octaves, lines=lines)
    except UsageError as error:
        return None, str(error)
    except np.linalg.LinAlgError as error:
        return None, f"{_NO_WEIGHTS} ({error})."
    if fit.probability >= _MISFIT:
        return fit, ""
    try:
        richer = fit_curve(octaves, lines=lines, gauss_markov=3)
    except np.linalg.LinAlgError:
        return fit, ""
    return (richer if richer.probability > fit.probability else fit), ""


_NO_WEIGHTS = (
    "There are averaging times enough, but the curve could not be weighed: the covariance between them, of a model "
    "as near to this curve as any, has no inverse in double precision"
)


def _terms(fit: NoiseFit) -> tuple[Term, ...]:
    sigmas = np.sqrt(np.diag(fit.covariance))
    return tuple(
        Term(term.name, term.value, float(sigma), term.low, term.high)
        for term, sigma in zip(fit.terms, sigmas, strict=True)
    )


__all__ = ["FLOOR", "Channel", "Characterisation", "Term", "characterise", "characterise_blocks"]
