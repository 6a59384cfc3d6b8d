"""noise.json: everything that `tumble noise` finds, each number with its letter, unit and definition."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np

from tumble.document import DocumentPart, finite, part_of, plain, spelled
from tumble.errors import __version__
from tumble.noise import COLLAPSE, Channel, Characterisation, Deviation, NoiseFit, Term, triad_terms
from tumble.report.noise import (
    CURVE,
    DEFINITIONS,
    FORMULA,
    NAMES,
    definition_of,
    practical_unit,
    si_unit,
)

FORMAT: Literal["tumble noise"] = "tumble noise"
VERSION: Literal[1] = 1
STANDARD = "IEEE Std 952-2020, two-sided spectral densities"

Numbers = list[float | None]


class _Strict(DocumentPart, forbid_unknown_fields=True):
    """A part that has no other keys."""


class RecordingName(_Strict):
    """A file that was read."""

    name: str
    sha256: str


class Practical(_Strict):
    """A value in the unit that people use."""

    value: float
    standard_uncertainty: float | None
    unit: str


class _Stated(_Strict, rename=spelled()):
    """A value with its uncertainty and interval.

    Attributes
    ----------
    unit : of value, standard_uncertainty, low and high: SI, or counts.
    """

    definition: str
    value: float
    sigma: float | None
    low: float
    high: float
    unit: str
    practical: Practical


class TermBlock(_Stated):
    """A coefficient that the curve shows.

    Attributes
    ----------
    letter : of IEEE Std 952; sigma and correlation time of a Gauss-Markov process.
    curve_missed_by : factor by which the fitted curve misses the measured one over a decade of averaging
        times. The part that is this term's is counted in the uncertainty. null where the model fits.
    """

    letter: str
    name: str
    curve_missed_by: float | None = None


class LimitBlock(_Strict):
    """How large a coefficient that is not seen may be, at the fit's confidence."""

    value: float
    unit: str
    definition: str


class CovarianceBlock(_Strict):
    """Covariance of a channel's coefficients, which the fit correlates.

    Attributes
    ----------
    terms : order of rows and columns.
    units : of each; an entry has the product of two.
    """

    what: str
    terms: list[str]
    units: list[str]
    matrix: list[list[float]]


FITS = {
    "curve": "weighted fit of the logarithm of the whole Allan curve, averaging times an octave apart",
    "moments": "generalized method of wavelet moments: Haar wavelet variances (half the Allan variances), averaging "
    "times an octave apart",
}


class FitBlock(_Strict, rename=spelled(freedom="degrees_of_freedom")):
    """How the model was fitted, and whether it fits.

    Attributes
    ----------
    confidence : of low, high and of the upper limits.
    probability : of as much misfit or more if the model is right.
    """

    what: str
    confidence: float
    chi_square: float
    freedom: int
    probability: float
    covariance: CovarianceBlock


class LineBlock(_Strict, rename=spelled(frequency="frequency_hz")):
    """A sine that stands out of the spectrum: a vibration, the mains.

    Attributes
    ----------
    unit : of the amplitude, which is the peak's.
    """

    definition: str
    frequency: float
    frequency_sigma: float
    amplitude: float
    amplitude_sigma: float
    unit: str


class RandomWalkBlock(_Stated):
    """N with the white part of short Gauss-Markov processes, which a filter that has no state for them takes.

    Attributes
    ----------
    correlation_times_s : of the processes in it; it holds for times a good deal longer. Empty where it is N
        alone.
    """

    letter: Literal["N"]
    correlation_times_s: list[float]


class FloorBlock(_Strict):
    """Lowest point of the Allan deviation where it is known to a fifth; some call it bias instability."""

    value: float
    unit: str
    tau_s: float


class CurveBlock(_Strict):
    """A deviation over averaging times, in the channel's unit.

    Attributes
    ----------
    confidence : probability of each interval from low to high.
    high : null where nothing bounds it.
    """

    kind: Literal["overlapping"]
    what: str
    unit: str
    confidence: float
    tau_s: Numbers
    deviation: Numbers
    low: Numbers
    high: Numbers
    equivalent_degrees_of_freedom: Numbers


class ChannelBlock(_Strict):
    """One sensor.

    Attributes
    ----------
    lines : strongest first; they are part of the fitted model.
    random_walk : N as a filter without states for short processes takes it; null where none is seen.
    allan_deviation : overlapping, octaves: what the model is fitted to.
    curve : overlapping, ten averaging times a decade.
    """

    unit: str
    terms: dict[str, TermBlock]
    lines: list[LineBlock]
    fit: FitBlock | None
    upper_limits_of_unseen: dict[str, LimitBlock]
    random_walk: RandomWalkBlock | None = None
    lowest_allan_deviation: FloorBlock
    allan_deviation: CurveBlock
    curve: CurveBlock


class TriadTermBlock(
    _Strict,
    rename=spelled(
        mean="mean_of_variances",
        worst="worst_axis",
        worst_axis="worst_axis_name",
        seen="axes_that_show_it",
    ),
):
    """A coefficient of a triad."""

    definition: str
    unit: str
    mean: float
    mean_sigma: float
    worst: float
    worst_sigma: float
    worst_axis: str
    seen: list[str]
    axes: int


class TriadBlock(_Strict):
    """Three axes as one."""

    what: str
    terms: dict[str, TriadTermBlock]


class SpectrumBlock(_Strict):
    """Spectral density of a triad's channels, in the square of their unit per Hz.

    Attributes
    ----------
    density : one list a channel.
    """

    what: str
    unit: str
    channels: list[str]
    frequency_hz: Numbers
    density: list[Numbers]


class NoiseDocument(_Strict):
    """The noise of a sensor at rest.

    Attributes
    ----------
    recorded_rate_hz : of the rows, where each value stands in several of them; rate_hz is that of values.
    pieces : first sample and the one after the last of each rest.
    formula : of the Allan variance that is fitted.
    triads : accelerometer, gyroscope.
    spectra : a: accelerometer, g: gyroscope.
    """

    format: Literal["tumble noise"]
    version: Literal[1]
    software: str
    created: str
    recordings: list[RecordingName]
    rate_hz: float
    recorded_rate_hz: float | None = None
    samples_at_rest: int
    pieces: list[list[int]]
    read: Literal["whole", "block by block"]
    remarks: list[str]
    formula: str
    definitions: dict[str, str]
    channels: dict[str, ChannelBlock]
    triads: dict[str, TriadBlock]
    spectra: dict[str, SpectrumBlock]


def document_text(document: dict[str, Any]) -> str:
    """Return a document as it is written.

    Parameters
    ----------
    document : of `noise_document`.
    """
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def noise_document(noise: Characterisation) -> dict[str, Any]:
    """Return everything that was found as plain values, ready for JSON.

    Parameters
    ----------
    noise : of a recording.
    """
    document = NoiseDocument(
        format=FORMAT,
        version=VERSION,
        software=f"tumble {__version__}",
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        recordings=[RecordingName(name=s.name, sha256=s.sha256) for s in noise.sources],
        rate_hz=noise.rate,
        recorded_rate_hz=None if noise.held is None else noise.held.recorded,
        samples_at_rest=noise.suitability.samples,
        pieces=[list(piece) for piece in noise.suitability.pieces],
        read="block by block" if noise.streamed else "whole",
        remarks=list(noise.sentences),
        formula=FORMULA,
        definitions={"standard": STANDARD, **DEFINITIONS},
        channels={channel.name: _channel(channel) for channel in noise.channels},
        triads=_triads(noise.channels),
        spectra={letter: _spectrum(noise, letter) for letter in noise.spectra},
    )
    return plain(document)


def _channel(channel: Channel) -> ChannelBlock:
    fit, unit = channel.fit, channel.unit
    return ChannelBlock(
        unit=unit,
        terms={
            term.letter: part_of(
                TermBlock,
                term,
                name=NAMES.get(term.letter, term.letter),
                **_stated(channel, term, term.letter, definition_of(term.letter)),
                curve_missed_by=None if fit is None else fit.missed.get(term.letter),
            )
            for term in channel.terms
        },
        lines=[part_of(LineBlock, one, definition=DEFINITIONS["line"], unit=unit) for one in channel.lines],
        fit=None if fit is None else _fit(channel, fit),
        upper_limits_of_unseen={
            letter: LimitBlock(value=limit, unit=si_unit(channel, letter), definition=definition_of(letter))
            for letter, limit in channel.unseen.items()
            if np.isfinite(limit)
        },
        random_walk=_random_walk(channel),
        lowest_allan_deviation=FloorBlock(value=channel.floor, unit=unit, tau_s=channel.floor_tau),
        allan_deviation=_curve(channel.allan, unit),
        curve=_curve(channel.curve, unit),
    )


def _random_walk(channel: Channel) -> RandomWalkBlock | None:
    term = channel.random_walk
    return term and part_of(
        RandomWalkBlock,
        term,
        letter="N",
        **_stated(channel, term, "N", DEFINITIONS["random walk"]),
        correlation_times_s=[] if channel.white is None else list(channel.white.times),
    )


def _stated(channel: Channel, term: Term, letter: str, definition: str) -> dict[str, Any]:
    """What a coefficient is, its unit, and itself as people use it."""
    factor, unit = practical_unit(channel, letter)
    sigma = finite(factor * term.sigma)
    return {
        "definition": definition,
        "unit": si_unit(channel, letter),
        "practical": Practical(value=factor * term.value, standard_uncertainty=sigma, unit=unit),
    }


def _fit(channel: Channel, fit: NoiseFit) -> FitBlock:
    names = [term.letter for term in fit.terms]
    covariance = CovarianceBlock(
        what="covariance of the values of the terms",
        terms=names,
        units=[si_unit(channel, name) for name in names],
        matrix=np.nan_to_num(fit.covariance).tolist(),
    )
    return part_of(FitBlock, fit, what=FITS[fit.method], covariance=covariance)


def _curve(curve: Deviation, unit: str) -> CurveBlock:
    return CurveBlock(
        kind="overlapping",
        what=CURVE,
        unit=unit,
        confidence=curve.confidence,
        tau_s=_numbers(curve.tau),
        deviation=_numbers(curve.deviation[:, 0]),
        low=_numbers(curve.low[:, 0]),
        high=_numbers(curve.high[:, 0]),
        equivalent_degrees_of_freedom=_numbers(curve.edf[:, 0]),
    )


def _triads(channels: tuple[Channel, ...]) -> dict[str, TriadBlock]:
    found: dict[str, TriadBlock] = {}
    for letter, name in (("a", "accelerometer"), ("g", "gyroscope")):
        axes = [channel for channel in channels if channel.name.startswith(letter)]
        if axes:
            terms = {
                one.letter: part_of(
                    TriadTermBlock,
                    one,
                    definition=definition_of(one.letter),
                    unit=si_unit(axes[0], one.letter),
                )
                for one in triad_terms(axes)
            }
            found[name] = TriadBlock(what=COLLAPSE, terms=terms)
    return found


def _spectrum(noise: Characterisation, letter: str) -> SpectrumBlock:
    spectrum = noise.spectra[letter]
    channels = [channel for channel in noise.channels if channel.name.startswith(letter)]
    return SpectrumBlock(
        what="one-sided power spectral density, Welch, Hann window, half overlap, in logarithmic bins",
        unit=f"({channels[0].unit})²/Hz",
        channels=[channel.name for channel in channels],
        frequency_hz=_numbers(spectrum.frequency),
        density=[_numbers(row) for row in spectrum.density.T],
    )


def _numbers(values: Any) -> Numbers:
    return [finite(v) for v in np.asarray(values, dtype=float)]
