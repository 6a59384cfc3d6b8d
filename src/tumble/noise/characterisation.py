"""A recording at rest characterised: deviations and spectrum of every channel, and the terms in them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log, pi, sqrt

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.errors import RecordingError, UsageError
from tumble.noise.deviation import Deviation, allan_deviation
from tumble.noise.fit import NoiseFit, fit_curve
from tumble.noise.recording_length import seconds_for
from tumble.noise.spectrum import PowerSpectrum, power_spectrum
from tumble.noise.suitability import Suitability, judge_rest
from tumble.noise.terms import NoiseModel
from tumble.recording import Recording
from tumble.recording.doctor import channels_of
from tumble.units import angular_rate_factor, specific_force_factor

FLOOR = sqrt(2.0 * log(2.0) / pi)
"""Allan deviation of flicker of B = 1: 0.664, whatever the averaging time (IEEE Std 952, annex C)."""

_LEAST_SAMPLES = 16
_BINS = 20  # of the spectrum, a decade
_LEVEL_POINTS = 600  # of the drawing of levels over time
# Ten degrees of freedom for each averaging time in the record: 1 over the square root of twice that is 22 %.
_WELL_KNOWN = 10.0
_MISFIT = 0.01
_SHORT = 5000  # samples, of which N is known to 2 %
_SHARP = 50.0  # degrees of freedom of a deviation known to 10 %


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
    curve : overlapping Allan deviation, ten averaging times a decade, in that unit.
    fit : the model of its noise, or None where there is too little for one.
    terms : what the curve shows.
    floor, floor_tau : lowest point of the curve where it is known to a fifth, and its averaging time in s.
    """

    name: str
    unit: str
    curve: Deviation
    fit: NoiseFit | None
    terms: tuple[Term, ...]
    floor: float
    floor_tau: float

    @property
    def is_gyro(self) -> bool:
        """Whether it senses angular rate."""
        return self.name.startswith("g")

    @property
    def unseen(self) -> dict[str, float]:
        """Upper limits of the coefficients that the curve does not show, by letter."""
        return {} if self.fit is None else self.fit.limits

    def term(self, letter: str) -> Term | None:
        """Return a term by its letter, or None if the curve does not show it."""
        return next((term for term in self.terms if term.letter == letter), None)

    def fitted(self, tau: Series) -> Series:
        """Return the Allan deviation of the fitted model at averaging times in s; nan without one."""
        if self.fit is None:
            return np.full(tau.shape, np.nan)
        return np.sqrt(self.fit.model.allan_variance(tau, self.fit.rate))


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
    """

    suitability: Suitability
    channels: tuple[Channel, ...]
    spectra: dict[str, PowerSpectrum]
    level_time: Series
    levels: Table
    remarks: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """Everything that was found, in words."""
        return (*self.suitability.remarks, *self.remarks)


def characterise(
    recording: Recording, *, skip: float = 0.0, remove_temperature: bool = False
) -> Characterisation:
    """Return deviations, spectra and terms of all channels of a recording at rest.

    Parameters
    ----------
    recording : as read, in any unit.
    skip : s at the start to leave out, such as warm-up.
    remove_temperature : take a straight line in the temperature off each channel first.

    Raises
    ------
    RecordingError
        If nothing of it is at rest, or it is too short.
    """
    said: list[str] = []
    recording = _after(recording, skip)
    if remove_temperature:
        recording = _without_temperature(recording, said)
    suitability = judge_rest(recording)
    recording = suitability.recording
    if suitability.longest < _LEAST_SAMPLES:
        why = " ".join(suitability.remarks) or "There is nothing in it."
        raise RecordingError(
            f"No stretch at rest of {_LEAST_SAMPLES} samples or more, so there is no noise to analyse. {why}"
        )
    named = channels_of(recording)
    signals, gaps, units = _signals(recording, named, suitability)
    curves = allan_deviation(signals, recording.rate, taus="log", gaps=gaps)
    octaves = allan_deviation(signals, recording.rate, taus="octave", gaps=gaps)
    channels = tuple(
        _channel(name, unit, curves.channel(k), octaves.channel(k), suitability.shortest)
        for k, (name, unit) in enumerate(zip(suitability.channels, units, strict=True))
    )
    said += _on_fits(channels) + _on_length(curves) + _advice(channels, curves.samples / curves.rate)
    time, levels = _levels(recording.time, signals)
    return Characterisation(
        suitability,
        channels,
        _spectra(signals, recording.rate, gaps, suitability.channels),
        time,
        levels,
        tuple(said),
    )


def _after(recording: Recording, skip: float) -> Recording:
    if skip <= 0.0:
        return recording
    first = int(np.searchsorted(recording.time, float(recording.time[0]) + skip))
    if first >= len(recording):
        raise RecordingError(f"--skip {skip:g} leaves nothing of {recording.duration:.4g} s.")
    return recording.between(first, len(recording))


def _without_temperature(recording: Recording, said: list[str]) -> Recording:
    """Take a straight line in temperature off, and say by how much."""
    celsius = recording.temperature
    if celsius is None or not np.all(np.isfinite(celsius)) or float(np.ptp(celsius)) == 0.0:
        said.append("There is no temperature that changes in the recording: nothing was taken off.")
        return recording
    warmth = celsius - celsius.mean()

    def flat(triad: AnyArray | None) -> AnyArray | None:
        if triad is None:
            return None
        slope = warmth @ (triad - triad.mean(axis=0)) / (warmth @ warmth)
        return triad - np.outer(warmth, slope)

    said.append(
        f"A straight line in the temperature ({np.ptp(celsius):.2g} °C) is taken off each channel: what the bias does "
        "with temperature is not in the numbers below."
    )
    return replace(
        recording,
        specific_force=flat(recording.specific_force),
        angular_rate=flat(recording.angular_rate),
    )


def _signals(
    recording: Recording, named: dict[str, Series], suitability: Suitability
) -> tuple[Table, tuple[int, ...], list[str]]:
    """Signals in SI where there is a factor, nan outside the pieces, and the edges between pieces as gaps."""
    signals = np.column_stack([named[name] for name in suitability.channels])
    units: list[str] = []
    for k, name in enumerate(suitability.channels):
        gyro = name.startswith("g")
        factor = (
            angular_rate_factor(recording.angular_rate_unit)
            if gyro
            else specific_force_factor(recording.specific_force_unit)
        )
        units.append("counts" if factor is None else "rad/s" if gyro else "m/s²")
        signals[:, k] *= 1.0 if factor is None else factor
    used = np.zeros(len(signals), dtype=bool)
    for start, stop in suitability.pieces:
        used[start:stop] = True
    signals[~used] = np.nan
    return signals, tuple(start for start, _ in suitability.pieces), units


def _channel(name: str, unit: str, curve: Deviation, octaves: Deviation, shortest: float) -> Channel:
    try:
        fit = fit_curve(octaves.from_tau(shortest))
    except UsageError:
        fit = None
    known = (curve.edf[:, 0] >= _WELL_KNOWN) & (curve.tau >= shortest)
    known = known if np.any(known) else np.ones(len(curve), dtype=bool)
    lowest = int(np.argmin(np.where(known, curve.deviation[:, 0], np.inf)))
    return Channel(
        name,
        unit,
        curve,
        fit,
        () if fit is None else _terms(fit),
        float(curve.deviation[lowest, 0]),
        float(curve.tau[lowest]),
    )


def _terms(fit: NoiseFit) -> tuple[Term, ...]:
    sigmas = np.sqrt(np.diag(fit.covariance))
    return tuple(
        Term(term.name, term.value, float(sigma), term.low, term.high)
        for term, sigma in zip(fit.terms, sigmas, strict=True)
    )


def _on_fits(channels: tuple[Channel, ...]) -> list[str]:
    """Say which curves have no model, or one that does not fit."""
    none = [channel.name for channel in channels if channel.fit is None]
    bad = [c.name for c in channels if c.fit is not None and c.fit.probability < _MISFIT]
    said = (
        [f"{', '.join(none)}: too few averaging times for a model; the curve stands alone."] if none else []
    )
    if bad:
        words = f"{', '.join(bad)}: the curve has a shape that the model does not make (by chance in less than one of "
        said.append(
            f"{words}{1.0 / _MISFIT:.0f} cases): vibration lines, motion or drift; look at the spectrum."
        )
    return said


def _on_length(curves: Deviation) -> list[str]:
    """Say how long an averaging time is known, and what a longer one takes."""
    sharp = curves.tau[np.min(curves.edf, axis=1) >= _SHARP]
    total = _words(curves.samples / curves.rate)
    if not sharp.size or curves.samples < _SHORT:
        said = f"The recording is very short ({total} at rest): "
        said += f"for N to 2 % record {_words(_SHORT / curves.rate)}; bias instability takes hours."
    else:
        said = f"{total} at rest: the curve is known to 10 % up to averaging times of {_words(float(sharp[-1]))}, "
        said += "and up to longer ones in proportion to the length of a recording."
    return [said]


def _advice(channels: tuple[Channel, ...], seconds: float) -> list[str]:
    """Say how long to record for 10 % on B and K, by the channel of each triad that needs longest."""
    said: list[str] = []
    for letter, title in (("a", "Accelerometers"), ("g", "Gyros")):
        fits = [c.fit for c in channels if c.name.startswith(letter) and c.fit is not None]
        parts: list[str] = []
        for term in "BK":
            needs = [_need(fit, term) for fit in fits]
            longest = max(needs, default=0.0)
            if longest > 1.1 * seconds and np.isfinite(longest):
                seen = all(term in fit.chosen for fit in fits)
                where = "" if seen else " (where it is not seen: if it is at its limit)"
                parts.append(f"{_words(longest)} for {term}{where}")
        if parts:
            said.append(f"{title}: ± 10 % takes a recording of {' and '.join(parts)}.")
    return said


def _need(fit: NoiseFit, letter: str) -> float:
    """Length of recording that knows a coefficient, or its upper limit, to 10 %."""
    if letter in fit.limits:
        coefficients = {**fit.model.coefficients, letter: fit.limits[letter]}
        model = NoiseModel.from_coefficients(coefficients, fit.model.gauss_markov)
        return seconds_for(model, letter, fit.rate)
    return seconds_for(fit.model, letter, fit.rate) if letter in fit.chosen else 0.0


def _words(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"


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


__all__ = ["FLOOR", "Channel", "Characterisation", "Term", "characterise"]
