"""Chapter 4 of Hayal (2010): what the norm solutions find in a simulated HG1700.

Tables 4.2 to 4.5. Figures 4.2 and 4.3: the nine-parameter gyro solution against rate and against noise.

And what a user meets: how often the norm solutions converge, and how far the noise's square biases them.
Neither is a table of the thesis. The first says when its solutions can be had at all, the second what
its adjustment (and Shin's, and plain least squares) leaves in the scale factors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tumble.counting import counted
from tumble.earth.site import EARTH_RATE
from tumble.reproduction.outcome import INSIDE, OUTSIDE, Curve, Marks, Outcome, Plot, Row
from tumble_papers.hayal.norm_batch import (
    ESTIMATORS,
    FASTER,
    RATE_NOISE,
    RATE_NOISE_HG1900,
    Runs,
    Setting,
    run_setting,
    table_setting,
)
from tumble_papers.published import hayal

COLUMNS = (
    "case",
    "thesis: sigma",
    "thesis: |difference|",
    "one run: sigma",
    "one run: |difference|",
    "sigma: mean",
    "sigma: lowest",
    "sigma: highest",
    "|difference|: highest",
)
# Factors from SI to the thesis' units, a group of three parameters each.
FACTORS = np.repeat([1.0, 1e6, 1e6], 3)
CASES = {
    1: "1: no noise",
    2: "2: noise",
    3: "3: rate x 10⁴",
}
# Below this share of the true value a number is what rounding leaves.
ROUND_OFF = 1e-9
# With one run alone there is no range: a stated sigma varies by this factor from run to run.
ONE_RUN = 3.0
# A difference from the truth beyond so many of its own stated sigmas is no chance.
FALSE_ALARM = 4.5


def reproduce_table(table: str, repetitions: int, seed: int) -> Outcome:
    """Make one of the tables 4.2 to 4.5 anew.

    Parameters
    ----------
    table : "4.2", "4.3", "4.4" or "4.5".
    repetitions : how many runs; one shows the table as the thesis has it, hundreds show its range.
    seed : of all random numbers.

    Raises
    ------
    UsageError
        If there is no such table.
    """
    printed = hayal()["tables"][table]
    rows: list[Row] = []
    notes: list[str] = []
    for case in (1, 2) if table == "4.5" else (1, 2, 3):
        rng = np.random.Generator(np.random.SFC64([seed, case]))
        runs = run_setting(table_setting(table, case), repetitions, rng)
        rows += [_row(number, entry, case, runs) for number, entry in enumerate(printed["rows"])]
        notes += _notes(case, runs)
    criterion = (
        f"inside: the thesis' sigma lies in the range of our {repetitions} runs' sigmas of that kind "
        "(all three axes). Its difference from the truth is no larger than the largest of ours"
        if repetitions > 1
        else f"inside: the thesis' sigma is within a factor of {ONE_RUN:g} of our one run's mean. Its "
        f"difference from the truth is within {FALSE_ALARM:g} of its own sigmas (--repetitions 500 "
        "gives the range itself)"
    )
    return Outcome(
        f"hayal-{table}",
        f"Table {table}: {printed['title']}",
        "Hayal 2010, chapter 4",
        COLUMNS,
        rows,
        criterion,
        notes=notes,
        repetitions=repetitions,
        seed=seed,
    )


def _row(number: int, entry: dict[str, Any], case: int, runs: Runs) -> Row:
    thesis = entry["cases"][case - 1]
    factor = float(FACTORS[number])
    usable = runs.usable
    sigma = factor * runs.sigmas[usable, number]
    difference = factor * np.abs(runs.differences[usable, number])
    kind = slice(3 * (number // 3), 3 * (number // 3) + 3)
    of_kind = factor * runs.sigmas[usable, kind], factor * np.abs(runs.differences[usable, kind])
    cells = (
        CASES[case],
        thesis["sigma"],
        thesis["difference"],
        float(sigma[0]),
        float(difference[0]),
        float(of_kind[0].mean()),
        float(of_kind[0].min()),
        float(of_kind[0].max()),
        float(of_kind[1].max()),
    )
    true = factor * float(runs.setting.errors[number])
    verdict, reason = _judged(thesis["sigma"], thesis["difference"], *of_kind, true)
    alone = sigma.min() <= thesis["sigma"] <= sigma.max()
    if verdict == INSIDE and not reason and sigma.size > 1 and not alone:
        reason = f"beyond the range of this axis alone ({sigma.min():.3g} to {sigma.max():.3g})"
    return Row(entry["parameter"], entry["unit"].replace("^2", "²"), cells, verdict, reason)


def _judged(
    printed: float, printed_difference: float, sigma: np.ndarray, difference: np.ndarray, true: float
) -> tuple[str, str]:
    if printed < ROUND_OFF * true and sigma.max() < ROUND_OFF * true:
        return INSIDE, "round-off: nothing is left on either side"
    if sigma.shape[0] == 1:
        ratio = printed / float(sigma.mean())
        if printed_difference > FALSE_ALARM * printed:
            return OUTSIDE, f"its difference is {printed_difference / printed:.2g} times its own sigma"
        if 1.0 / ONE_RUN <= ratio <= ONE_RUN:
            return INSIDE, ""
        return OUTSIDE, f"the thesis' sigma is {ratio:.2g} times ours"
    reasons: list[str] = []
    if not sigma.min() <= printed <= sigma.max():
        reasons.append(f"its sigma is {printed / sigma.mean():.2g} times the mean of ours")
    if printed_difference > difference.max():
        reasons.append(
            f"its difference is {printed_difference / difference.max():.2g} times the largest of ours"
        )
    return (OUTSIDE, "; ".join(reasons)) if reasons else (INSIDE, "")


def _notes(case: int, runs: Runs) -> list[str]:
    total, usable = runs.sigma0.size, runs.usable
    few, most = np.min(runs.iterations[usable]), np.max(runs.iterations[usable])
    span = f"{few}" if few == most else f"{few} to {most}"
    words = f"Case {CASES[case]}: sigma0 {np.mean(runs.sigma0[usable]):.3g}, {span} iterations"
    lost = total - int(np.count_nonzero(usable))
    if lost:
        words += f"; {lost} of {total} runs did not converge or ended in the mirror root"
    if runs.setting.noise == 0.0:
        words += " (of a nominal sigma: there is no noise)"
    elif total > 1:
        ratio = np.std(runs.differences[usable], axis=0) / np.mean(runs.sigmas[usable], axis=0)
        words += f"; scatter of the estimates over mean stated sigma {ratio.min():.2f} to {ratio.max():.2f}"
    return [words + "."]


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


# (words, attitudes, seconds, noise of a sample)
SETTINGS = (
    ("HG1700, 26 attitudes, 180 s", 26, 180, RATE_NOISE),
    ("HG1700, 18 attitudes, 180 s", 18, 180, RATE_NOISE),
    ("HG1700, 10 attitudes, 180 s", 10, 180, RATE_NOISE),
    ("HG1900, 10 attitudes, 60 s", 10, 60, RATE_NOISE_HG1900),
    ("26 attitudes, 180 s, noise x 3", 26, 180, 3.0 * RATE_NOISE),
    ("26 attitudes, 180 s, noise x 5", 26, 180, 5.0 * RATE_NOISE),
    ("26 attitudes, 180 s, noise x 7", 26, 180, 7.0 * RATE_NOISE),
)
# Multiples of (sigma of a mean over K)² by which each estimator's scale factors come out too large, for
# many holds: E|y|² = K² + 3 sigma², of which the adjustment takes one sigma² (the part along y) out.
THEORY = {"gauss-helmert": 1.0, "corrected": 0.0, "norm": 2.0, "square": 3.5}


def reproduce_convergence(repetitions: int, seed: int) -> Outcome:
    """Count how often the gyro solutions on the Earth's rate converge from zero start values.

    Parameters
    ----------
    repetitions, seed : as for `reproduce_table`.
    """
    rows: list[Row] = []
    for number, (words, attitudes, samples, noise) in enumerate(SETTINGS):
        for unknowns in (9, 3):
            setting = replace(
                table_setting("4.4", 2), unknowns=unknowns, attitudes=attitudes, samples=samples, noise=noise
            )
            rng = np.random.Generator(np.random.SFC64([seed, number, unknowns]))
            runs = run_setting(setting, repetitions, rng, tolerance=1e-12)
            done = runs.iterations[runs.converged]
            span = f"{done.min()} to {done.max()}" if done.size else "none"
            cells = (
                unknowns,
                100.0 * float(np.mean(~runs.converged)),
                100.0 * float(np.mean(runs.mirror)),
                span,
            )
            rows.append(Row(words, "", cells))
    return Outcome(
        "hayal-convergence",
        "How often the gyro solutions on the Earth's rate converge, from zero start values in 100 iterations",
        "Hayal 2010, chapter 4; not printed there",
        ("unknowns", "not converged, %", "mirror root, %", "iterations"),
        rows,
        notes=[
            "Converged: no parameter moves by more than 1e-12 of its sigma; with 1e-6 fewer runs fail.",
            "The thesis takes 100 iterations and does not say whether they had settled.",
        ],
        repetitions=repetitions,
        seed=seed,
    )


def reproduce_norm_bias(repetitions: int, seed: int) -> Outcome:
    """Show how far the noise's own square biases the scale factors, estimator by estimator.

    Parameters
    ----------
    repetitions, seed : as for `reproduce_table`.
    """
    rows: list[Row] = []
    square = (RATE_NOISE / np.sqrt(180.0) / EARTH_RATE) ** 2
    tried = [(attitudes, *one) for attitudes in (26, 208) for one in ESTIMATORS.items()]
    for attitudes, estimator, words in counted(tried, sum(a for a, *_ in tried), lambda one: one[0]):
        setting = replace(table_setting("4.4", 2), attitudes=attitudes, estimator=estimator)
        # The same noise for every estimator: their differences are then far better known.
        rng = np.random.Generator(np.random.SFC64([seed, attitudes]))
        runs = run_setting(setting, repetitions, rng)
        scale = 1e6 * runs.differences[runs.usable, 3:6]
        mean = float(scale.mean())
        sigma = float(scale.mean(axis=1).std() / np.sqrt(max(scale.shape[0] - 1, 1)))
        rows.append(_bias_row(attitudes, estimator, words, mean, sigma, float(scale.std()), square))
    return Outcome(
        "hayal-norm-bias",
        "Mean error of the gyros' scale factors on the Earth's rate, nine parameters",
        "Hayal 2010, case 2 of table 4.4; not printed there",
        ("attitudes", "mean / ppm", "its uncertainty / ppm", "scatter / ppm", "theory, many attitudes / ppm"),
        rows,
        "inside: with 208 attitudes the mean lies within 4.5 of its own standard uncertainties and a tenth of "
        "(sigma/K)² of the theory",
        notes=["Beside a scatter of 2 % none of it matters; for accelerometers (sigma/K)² is 8e-10."],
        repetitions=repetitions,
        seed=seed,
    )


def _bias_row(
    attitudes: int, estimator: str, words: str, mean: float, sigma: float, scatter: float, square: float
) -> Row:
    expected = THEORY.get(estimator)
    theory = None if expected is None or attitudes < 100 else 1e6 * expected * square
    cells = (attitudes, mean, sigma, scatter, theory)
    if theory is None or sigma == 0.0:
        return Row(f"{estimator}: {words}", "", cells)
    # Of second order in the noise there is more: some tenths of the leading term at 208 attitudes.
    allowed = FALSE_ALARM * sigma + 0.1 * 1e6 * square
    fits = abs(mean - theory) <= allowed
    return Row(
        f"{estimator}: {words}", "", cells, INSIDE if fits else OUTSIDE, "" if fits else "off the theory"
    )
