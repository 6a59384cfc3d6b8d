"""How long to record until a coefficient is known well enough, and what a recording is too short for."""

from __future__ import annotations

import numpy as np

from tumble.noise.fitting.allan_covariance import allan_covariance
from tumble.noise.fitting.fit import NoiseFit
from tumble.noise.fitting.weighted_fit import root_of_weights
from tumble.noise.terms import NoiseModel
from tumble.noise.variances import allan_variance_of, markov_allan_variance

_NAMES = {
    "Q": "quantisation",
    "N": "random walk",
    "B": "bias instability",
    "K": "rate random walk",
    "R": "ramp",
}


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


def too_short_to_see(fit: NoiseFit, unit: str, accuracy: float = 0.1) -> tuple[str, ...]:
    """Return a sentence for each of B and K that a recording is too short to see, or to know well.

    Parameters
    ----------
    fit : of one channel.
    unit : of the signal, for the words.
    accuracy : relative, one sigma, that the advice is for.
    """
    span = max(fit.lengths) / fit.rate
    words: list[str] = []
    for letter in ("B", "K"):
        name = f"{letter} ({_NAMES[letter]})"
        of_unit = unit if letter == "B" else f"{unit}/√s"
        if letter in fit.limits:
            limit = fit.limits[letter]
            model = NoiseModel.from_coefficients(
                {**fit.model.coefficients, letter: limit}, fit.model.gauss_markov
            )
            need = seconds_for(model, letter, fit.rate, accuracy)
            words.append(
                f"{name} is not seen in {_length(span)}: it is below {limit:.3g} {of_unit} "
                f"({100 * fit.confidence:.0f} %). If it is as large as that, record {_length(need)} to know it "
                f"to ± {100 * accuracy:.0f} %."
            )
        elif letter in fit.chosen:
            known = _relative_uncertainty(fit.model, letter, span, fit.rate)
            if known > accuracy:
                need = seconds_for(fit.model, letter, fit.rate, accuracy)
                words.append(
                    f"{name} is known to ± {100 * known:.0f} %: for ± {100 * accuracy:.0f} % record {_length(need)}."
                )
    return tuple(words)


def _length(seconds: float) -> str:
    if not np.isfinite(seconds):
        return "longer than anyone will"
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.2g} h"
