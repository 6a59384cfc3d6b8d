"""Figures 4.2 and 4.3 of Hayal (2010): the nine-parameter gyro solution against rate and against noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tumble.reproduction.outcome import INSIDE, OUTSIDE, Curve, Marks, Outcome, Plot, Row
from tumble_papers.hayal.thesis_simulation import FASTER, RATE_NOISE, Setting, run_setting, table_setting
from tumble_papers.published import hayal

GROUPS = (
    ("bias", slice(0, 3), 1.0, "rad/s"),
    ("scale factor error", slice(3, 6), 1e6, "ppm"),
    ("non-orthogonality", slice(6, 9), 1e6, "µrad"),
)
RATES = 10.0 ** np.arange(0.0, 5.01, 0.5)
NOISES = np.array([0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0])
# Of the runs, that a band holds: lowest and highest would go on growing with the runs, a difference's to zero.
BAND = (0.05, 0.95)
# A law is kept if the exponent between two points is within this of it.
TOLERANCE = 0.05


def reproduce_figure(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 4.2 (reference rate) or 4.3 (noise) anew.

    The thesis prints pictures without numbers; what is judged is the law that they show.

    Parameters
    ----------
    figure : "4.2" or "4.3".
    repetitions, seed : as for `reproduce_table`.
    """
    if figure == "4.2":
        return _study(figure, RATES, _with_rate, "reference rate over the Earth's rate", repetitions, seed)
    return _study(figure, NOISES, _with_noise, "noise over the HG1700's noise", repetitions, seed)


def _with_rate(setting: Setting, factor: float) -> Setting:
    return replace(setting, rate_factor=factor)


def _with_noise(setting: Setting, factor: float) -> Setting:
    return replace(setting, noise=factor * RATE_NOISE)


def _study(
    figure: str,
    factors: np.ndarray,
    changed: Callable[[Setting, float], Setting],
    words: str,
    repetitions: int,
    seed: int,
) -> Outcome:
    base = table_setting("4.4", 2)
    runs = [
        run_setting(
            changed(base, float(factor)), repetitions, np.random.Generator(np.random.SFC64([seed, number]))
        )
        for number, factor in enumerate(factors)
    ]
    plots: list[Plot] = []
    rows: list[Row] = []
    for name, where, unit_factor, unit in GROUPS:
        sigma = _curve("stated sigma", factors, [unit_factor * r.sigmas[r.usable, where] for r in runs])
        error = _curve(
            "|difference|", factors, [unit_factor * np.abs(r.differences[r.usable, where]) for r in runs]
        )
        marks = _printed(figure, where)
        plots.append(
            Plot(f"{name.split()[0]}", f"Gyro {name}", words, f"{name} / {unit}", (sigma, error), marks)
        )
        rows += _laws(figure, name, unit, sigma)
    lost = [
        f"{100 * np.mean(~r.usable):.1f} % at {f:g}"
        for f, r in zip(factors, runs, strict=True)
        if not np.all(r.usable)
    ]
    notes = [f"Runs without a usable solution: {', '.join(lost)}."] if lost else []
    return Outcome(
        f"hayal-figure-{figure}",
        f"Figure {figure}: the gyros' nine parameters against the {words}",
        "Hayal 2010, chapter 4",
        ("stated sigma at the first", "at the last", "exponent expected", "exponent found"),
        rows,
        "inside: the stated sigma follows the power law that the thesis' picture shows, within 0.05 in the exponent",
        plots,
        notes,
        repetitions,
        seed,
    )


def _curve(name: str, x: np.ndarray, values: list[np.ndarray]) -> Curve:
    def each(function: Callable[[np.ndarray], float]) -> np.ndarray:
        return np.array([function(v) if v.size else np.nan for v in values])

    return Curve(
        name,
        x,
        each(lambda v: float(v.mean())),
        each(lambda v: float(np.quantile(v, BAND[0]))),
        each(lambda v: float(np.quantile(v, BAND[1]))),
    )


def _printed(figure: str, where: slice) -> Marks:
    """Return the sigmas of table 4.4, which are the only numbers that the thesis prints of these figures."""
    rows = hayal()["tables"]["4.4"]["rows"][where]
    at = ((1.0, 1), (FASTER, 2)) if figure == "4.2" else ((1.0, 1),)
    x = np.array([factor for factor, _ in at for _ in rows])
    return Marks(
        "thesis, table 4.4", x, np.array([row["cases"][case]["sigma"] for _, case in at for row in rows])
    )


def _laws(figure: str, name: str, unit: str, sigma: Curve) -> list[Row]:
    """Compare exponents: with the rate, scale and angles fall as 1/rate; with small noise all grow with it."""
    if figure == "4.2":
        first, last, law = 4, len(sigma.x) - 1, 0.0 if name == "bias" else -1.0
    else:
        first, last, law = 0, 3, 1.0
    slope = float(np.log(sigma.y[last] / sigma.y[first]) / np.log(sigma.x[last] / sigma.x[first]))
    fits = abs(slope - law) <= TOLERANCE
    span = f"{name} from {sigma.x[first]:g} to {sigma.x[last]:g}"
    return [
        Row(
            span,
            unit,
            (float(sigma.y[first]), float(sigma.y[last]), law, slope),
            INSIDE if fits else OUTSIDE,
            "" if fits else "the sigma does not follow the law",
        )
    ]
