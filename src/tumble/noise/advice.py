"""What the fitted models of a recording say in words: what does not fit, and how long to record until it is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.noise.deviation import Deviation
from tumble.noise.fitting.allan_covariance import allan_covariance
from tumble.noise.fitting.fit import MISFIT, MISSED, NoiseFit
from tumble.noise.fitting.weighted_fit import root_of_weights
from tumble.noise.terms import NoiseModel
from tumble.noise.units import ACCELEROMETER, GYRO, practical_noise_unit
from tumble.noise.variances import allan_variance_of, markov_allan_variance
from tumble.noise.white_part import slower_part

if TYPE_CHECKING:
    from tumble.noise.channel import Channel


def _relative_uncertainty(model: NoiseModel, letter: str, seconds: float, rate: float) -> float:
    """Return the relative standard uncertainty of a coefficient that a recording of some length will have.

    All terms of the model are estimated at once, with the best weights, from averaging times a factor of
    four apart; a fit at octaves does slightly better.
    """
    samples = round(seconds * rate)
    averaging = 4 ** np.arange(max(int(np.log(samples / 4.0) / np.log(4.0)) + 1, 1))
    tau = averaging / rate
    present = [name for name, value in model.coefficients.items() if value > 0.0]
    columns = [model.coefficients[name] ** 2 * allan_variance_of(name, tau, rate) for name in present]
    for g in model.gauss_markov:
        power = g.sigma**2
        columns.append(power * markov_allan_variance(tau, g.correlation_time, rate))
        near, far = (markov_allan_variance(tau, g.correlation_time * f, rate) for f in (0.999, 1.001))
        columns.append(power * (far - near) / 0.002)
    if len(tau) < len(columns) or letter not in present:
        return float("inf")
    spread = allan_covariance(tuple(int(m) for m in averaging), rate, (samples,))
    root = root_of_weights(spread.of(model))
    inverse = np.linalg.pinv(root @ np.column_stack(columns), rcond=1e-12)
    # of a coefficient, half that of its square
    return 0.5 * float(np.linalg.norm(inverse[present.index(letter)]))


def seconds_for(model: NoiseModel, letter: str, rate: float, accuracy: float = 0.1) -> float:
    """Return how long to record, s, until a coefficient's relative standard uncertainty is `accuracy`.

    Infinite if thirty years do not suffice.

    Parameters
    ----------
    model, letter, rate : as for `_relative_uncertainty`.
    accuracy : one sigma, relative: 0.1 for ± 10 %.
    """
    seconds = 256.0 / rate
    before = _relative_uncertainty(model, letter, seconds, rate)
    while before > accuracy:
        if seconds > 1e9:
            return float("inf")
        after = _relative_uncertainty(model, letter, 4.0 * seconds, rate)
        if after <= accuracy:
            if not np.isfinite(before):
                return 4.0 * seconds
            # a power law between the two
            slope = np.log(before / after) / np.log(4.0)
            return float(seconds * (before / accuracy) ** (1.0 / slope))
        seconds, before = 4.0 * seconds, after
    return seconds


_SHORT = 5000  # samples, of which N is known to 2 %
_MOST_LINES = 3  # of a channel that are told
_MORE = 1.2  # times N, from which what a slower process adds is told
_SHARP = 50.0  # degrees of freedom of a deviation known to 10 %


def advise(channels: tuple[Channel, ...], curve: Deviation) -> tuple[str, ...]:
    """Return sentences on the fits, on what is known, and on how long to record.

    Parameters
    ----------
    channels : with their fits.
    curve : overlapping Allan deviation of all of them.
    """
    return (
        *_on_fits(channels),
        *_on_lines(channels),
        *_on_processes(channels),
        *_on_length(curve),
        *_advice(channels, curve),
        *(f"{c.name}: {text}" for c in channels if c.fit is not None for text in c.fit.remarks),
    )


def _on_fits(channels: tuple[Channel, ...]) -> list[str]:
    """Say which curves have no model, or one that does not fit."""
    reasons: dict[str, list[str]] = {}
    for channel in channels:
        if channel.fit is None:
            reasons.setdefault(channel.without_fit, []).append(channel.name)
    bad = [c.name for c in channels if c.fit is not None and c.fit.probability < MISFIT]
    said = [f"{', '.join(names)}: no model, the curve stands alone. {why}" for why, names in reasons.items()]
    if bad:
        words = f"{', '.join(bad)}: the curve has a shape that the model does not make (by chance in less than one of "
        said.append(
            f"{words}{1.0 / MISFIT:.0f} cases): vibration lines, motion or drift; look at the spectrum."
        )
    for channel in channels:
        known = {} if channel.fit is None else channel.fit.missed
        if missed := {name: factor for name, factor in known.items() if factor > MISSED}:
            said.append(
                f"{channel.name}: the model misses the measured curve by a factor of {max(missed.values()):.2g} over a "
                f"decade of averaging times that is mostly {' and '.join(missed)}: known no better than to this factor."
            )
    return said


def _on_lines(channels: tuple[Channel, ...]) -> list[str]:
    """Say at which frequencies the channels' spectra have lines."""
    where: dict[str, list[str]] = {}
    for channel in channels:
        for line in channel.lines[:_MOST_LINES]:
            where.setdefault(f"{line.frequency:.4g} Hz", []).append(channel.name)
    if not where:
        return []
    each = "; ".join(f"{frequency} in {', '.join(names)}" for frequency, names in where.items())
    return [f"Lines in the spectrum, as of a motor or the mains: {each}. They are part of the model."]


def _on_processes(channels: tuple[Channel, ...]) -> list[str]:
    """Say where N holds a process' white part, and where a slower one is left to the reader."""
    said: list[str] = []
    short = {c.name: c.white for c in channels if c.white is not None}
    if short:
        longest = max(time for part in short.values() for time in part.times)
        said.append(
            f"{', '.join(short)}: the noise is filtered before it is sampled, as by a low-pass filter in the sensor "
            f"(Gauss-Markov processes of up to {longest:.2g} s). N is what it is over longer times, the processes "
            "counted in; a single sample scatters less than N √rate."
        )
    for channel in channels:
        slower = None if channel.fit is None else slower_part(channel.fit)
        alone = channel.random_walk
        if slower is not None and (alone is None or slower.value > _MORE * alone.value):
            unit = practical_noise_unit(GYRO if channel.is_gyro else ACCELEROMETER, "N")
            factor, sign = (1.0, "counts/√Hz") if channel.unit == "counts" else (1.0 / unit.factor, unit.sign)
            said.append(
                f"{channel.name}: over times longer than {max(slower.times):.2g} s, the correlation "
                "time of its Gauss-Markov process, it is as noisy as white noise of N = "
                f"{factor * slower.value:.3g} {sign}. Give this N to a filter that has no state for "
                "the process."
            )
    return said


def _on_length(curves: Deviation) -> list[str]:
    """Say how long an averaging time is known, and what a longer one takes."""
    sharp = _known_to(curves)
    total = _words(curves.samples / curves.rate)
    if _is_short(curves):
        said = f"The recording is very short ({total} at rest): "
        said += f"for N to 2 % record {_words(_SHORT / curves.rate)}; bias instability takes hours."
    else:
        said = f"{total} at rest: the curve is known to 10 % up to averaging times of {_words(sharp)}, "
        said += "and up to longer ones in proportion to the length of a recording."
    return [said]


def _is_short(curves: Deviation) -> bool:
    return _known_to(curves) == 0.0 or curves.samples < _SHORT


def _known_to(curves: Deviation) -> float:
    """Averaging time up to which every channel's deviation is known to 10 %; 0 if none."""
    edf = np.min(curves.edf, axis=1)
    known = np.flatnonzero(edf >= _SHARP)
    if not known.size:
        return 0.0
    last = int(known[-1])
    if last + 1 == len(edf) or edf[last + 1] >= edf[last]:
        return float(curves.tau[last])
    # degrees of freedom fall as a power of the averaging time
    share = np.log(edf[last] / _SHARP) / np.log(edf[last] / edf[last + 1])
    return float(curves.tau[last] * (curves.tau[last + 1] / curves.tau[last]) ** share)


def _advice(channels: tuple[Channel, ...], curves: Deviation) -> list[str]:
    """Say how long to record for 10 % on B and K, by the channel of each triad that needs longest."""
    if _is_short(curves):
        # limits are then so high that to reach them would take no time
        return []
    said: list[str] = []
    seconds = curves.samples / curves.rate
    for letter, title in (("a", "Accelerometers"), ("g", "Gyros")):
        of_triad = [c.fit for c in channels if c.name.startswith(letter)]
        fits = [fit for fit in of_triad if fit is not None and fit.probability >= MISFIT]
        parts: list[str] = []
        hidden: list[str] = []
        for term in "BK":
            longest = max((seconds_needed(fit, term) for fit in fits), default=0.0)
            if longest > 1.1 * seconds and np.isfinite(longest):
                seen = all(term in fit.chosen for fit in fits)
                parts.append(f"{'' if seen else 'at least '}{_words(longest)} for {term}")
                hidden += [] if seen else [term]
        if parts:
            tail = (
                f" Not every axis shows {' and '.join(hidden)} yet: below the limit it takes longer."
                if hidden
                else ""
            )
            said.append(f"{title}: for ± 10 % record {' and '.join(parts)}.{tail}")
    return said


def seconds_needed(fit: NoiseFit, letter: str) -> float:
    """Return the length of recording, s, that knows a coefficient, or its upper limit, to 10 %; 0 of a term without.

    Parameters
    ----------
    fit : of one channel.
    letter : "N", "B" or "K".
    """
    if letter in fit.limits:
        coefficients = {**fit.model.coefficients, letter: fit.limits[letter]}
        model = NoiseModel.from_coefficients(coefficients, fit.model.gauss_markov)
        return seconds_for(model, letter, fit.rate)
    return seconds_for(fit.model, letter, fit.rate) if letter in fit.chosen else 0.0


def _words(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"
