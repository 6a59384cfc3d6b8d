"""Chapter 4 of Hayal (2010): what the norm solutions find in a simulated HG1700.

Tables 4.2 to 4.5. Figures 4.2 and 4.3: the nine-parameter gyro solution against rate and against noise.

And what a user meets: how often the norm solutions converge, and how far the noise's square biases them.
Neither is a table of the thesis. The first says when its solutions can be had at all, the second what
its adjustment (and Shin's, and plain least squares) leaves in the scale factors.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tumble.counting import counted
from tumble.earth import EARTH_RATE
from tumble.reproduction import INSIDE, OUTSIDE, Curve, Marks, Plot, Row
from tumble_papers.hayal.norm_batch import (
    ESTIMATORS,
    FASTER,
    RATE_NOISE,
    RATE_NOISE_HG1900,
    Runs,
    run_setting,
    table_setting,
)
from tumble_papers.study import Found, Study, generator, hayal, judge

# Factors from SI to the thesis' units, a group of three parameters each.
FACTORS = np.repeat([1.0, 1e6, 1e6], 3)
CASES = {1: "1: no noise", 2: "2: noise", 3: "3: rate x 10⁴"}
# Below this share of the true value a number is what rounding leaves.
ROUND_OFF = 1e-9
# With one run alone there is no range: a stated sigma varies by this factor from run to run.
ONE_RUN = 3.0
# A difference from the truth beyond so many of its own stated sigmas is no chance.
FALSE_ALARM = 4.5


def _table(table: str, repetitions: int, seed: int) -> Found:
    """Make a table anew: one run shows it as the thesis has it, hundreds show its range."""
    rows: list[Row] = []
    notes: list[str] = []
    for case in (1, 2) if table == "4.5" else (1, 2, 3):
        runs = run_setting(table_setting(table, case), repetitions, generator(seed, case))
        rows += [
            _row(number, entry, case, runs) for number, entry in enumerate(hayal()["tables"][table]["rows"])
        ]
        notes.append(_note(case, runs))
    said = {"one_run": ONE_RUN, "false_alarm": FALSE_ALARM}
    return Found(rows, notes=notes, said=said, few=repetitions == 1)


def _row(number: int, entry: dict[str, Any], case: int, runs: Runs) -> Row:
    thesis = entry["cases"][case - 1]
    factor = float(FACTORS[number])
    usable = runs.usable
    kind = slice(3 * (number // 3), 3 * (number // 3) + 3)
    sigmas, differences = (factor * np.abs(of[usable]) for of in (runs.sigmas, runs.differences))
    sigma, of_kind = sigmas[:, number], (sigmas[:, kind], differences[:, kind])
    told = (
        sigma[0],
        differences[0, number],
        *(f(of_kind[0]) for f in (np.mean, np.min, np.max)),
        of_kind[1].max(),
    )
    cells = (CASES[case], thesis["sigma"], thesis["difference"], *(float(number) for number in told))
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
        return judge(1.0 / ONE_RUN <= ratio <= ONE_RUN, f"the thesis' sigma is {ratio:.2g} times ours")
    reasons: list[str] = []
    if not sigma.min() <= printed <= sigma.max():
        reasons.append(f"its sigma is {printed / sigma.mean():.2g} times the mean of ours")
    if printed_difference > difference.max():
        reasons.append(
            f"its difference is {printed_difference / difference.max():.2g} times the largest of ours"
        )
    return judge(not reasons, "; ".join(reasons))


def _note(case: int, runs: Runs) -> str:
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
    return words + "."


GROUPS = (
    ("bias", slice(0, 3), 1.0, "rad/s"),
    ("scale factor error", slice(3, 6), 1e6, "ppm"),
    ("non-orthogonality", slice(6, 9), 1e6, "µrad"),
)
RATES = 10.0 ** np.arange(0.0, 5.01, 0.5)
NOISES = np.array([0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0])
AGAINST = {"4.2": "reference rate over the Earth's rate", "4.3": "noise over the HG1700's noise"}
# Of the runs, that a band holds: lowest and highest would go on growing with the runs, a difference's to zero.
BAND = (0.05, 0.95)
# A law is kept if the exponent between two points is within this of it.
TOLERANCE = 0.05


def _figure(figure: str, repetitions: int, seed: int) -> Found:
    """Make figure 4.2 (reference rate) or 4.3 (noise) anew: pictures without numbers, of which the law is judged."""
    rate, base = figure == "4.2", table_setting("4.4", 2)
    factors, words = RATES if rate else NOISES, AGAINST[figure]
    runs = [
        run_setting(
            replace(base, rate_factor=factor) if rate else replace(base, noise=factor * RATE_NOISE),
            repetitions,
            generator(seed, number),
        )
        for number, factor in enumerate(factors.tolist())
    ]
    plots: list[Plot] = []
    rows: list[Row] = []
    for name, where, to_unit, unit in GROUPS:
        sigma = _curve("stated sigma", factors, [to_unit * r.sigmas[r.usable, where] for r in runs])
        off = [to_unit * np.abs(r.differences[r.usable, where]) for r in runs]
        curves, marks = (sigma, _curve("|difference|", factors, off)), _printed(figure, where)
        plots.append(Plot(name.split()[0], f"Gyro {name}", words, f"{name} / {unit}", curves, marks))
        rows.append(_law(figure, name, unit, sigma))
    lost = [
        f"{100 * np.mean(~r.usable):.1f} % at {f:g}"
        for f, r in zip(factors, runs, strict=True)
        if not np.all(r.usable)
    ]
    return Found(rows, plots, [f"Runs without a usable solution: {', '.join(lost)}."] if lost else [])


def _curve(name: str, x: np.ndarray, values: list[np.ndarray]) -> Curve:
    told = [[v.mean(), *np.quantile(v, BAND)] if v.size else [np.nan] * 3 for v in values]
    return Curve(name, x, *np.array(told, dtype=float).T.copy())


def _printed(figure: str, where: slice) -> Marks:
    """Return the sigmas of table 4.4, which are the only numbers that the thesis prints of these figures."""
    rows = hayal()["tables"]["4.4"]["rows"][where]
    at = ((1.0, 1), (FASTER, 2)) if figure == "4.2" else ((1.0, 1),)
    x = np.array([factor for factor, _ in at for _ in rows])
    return Marks(
        "thesis, table 4.4", x, np.array([row["cases"][case]["sigma"] for _, case in at for row in rows])
    )


def _law(figure: str, name: str, unit: str, sigma: Curve) -> Row:
    """Compare exponents: with the rate, scale and angles fall as 1/rate; with small noise all grow with it."""
    if figure == "4.2":
        first, last, law = 4, len(sigma.x) - 1, 0.0 if name == "bias" else -1.0
    else:
        first, last, law = 0, 3, 1.0
    slope = float(np.log(sigma.y[last] / sigma.y[first]) / np.log(sigma.x[last] / sigma.x[first]))
    cells = (float(sigma.y[first]), float(sigma.y[last]), law, slope)
    verdict = judge(abs(slope - law) <= TOLERANCE, "the sigma does not follow the law")
    return Row(f"{name} from {sigma.x[first]:g} to {sigma.x[last]:g}", unit, cells, *verdict)


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


def _convergence(repetitions: int, seed: int) -> Found:
    """Count how often the gyro solutions on the Earth's rate converge from zero start values."""
    rows: list[Row] = []
    for number, (words, attitudes, samples, noise) in enumerate(SETTINGS):
        for unknowns in (9, 3):
            setting = replace(
                table_setting("4.4", 2), unknowns=unknowns, attitudes=attitudes, samples=samples, noise=noise
            )
            runs = run_setting(setting, repetitions, generator(seed, number, unknowns), tolerance=1e-12)
            done = runs.iterations[runs.converged]
            span = f"{done.min()} to {done.max()}" if done.size else "none"
            lost, mirror = (100.0 * float(np.mean(of)) for of in (~runs.converged, runs.mirror))
            rows.append(Row(words, "", (unknowns, lost, mirror, span)))
    return Found(rows)


def _norm_bias(repetitions: int, seed: int) -> Found:
    """Show how far the noise's own square biases the scale factors, estimator by estimator."""
    rows: list[Row] = []
    square = 1e6 * (RATE_NOISE / np.sqrt(180.0) / EARTH_RATE) ** 2
    tried = [(attitudes, *one) for attitudes in (26, 208) for one in ESTIMATORS.items()]
    for attitudes, estimator, words in counted(tried, sum(a for a, *_ in tried), lambda one: one[0]):
        setting = replace(table_setting("4.4", 2), attitudes=attitudes, estimator=estimator)
        # The same noise for every estimator: their differences are then far better known.
        runs = run_setting(setting, repetitions, generator(seed, attitudes))
        scale = 1e6 * runs.differences[runs.usable, 3:6]
        mean = float(scale.mean())
        sigma = float(scale.mean(axis=1).std() / np.sqrt(max(scale.shape[0] - 1, 1)))
        known = estimator in THEORY and attitudes >= 100
        theory = THEORY[estimator] * square if known else None
        verdict: tuple[str, ...] = ()
        if theory is not None and sigma > 0.0:
            # Of second order in the noise there is more: some tenths of the leading term at 208 attitudes.
            verdict = judge(abs(mean - theory) <= FALSE_ALARM * sigma + 0.1 * square, "off the theory")
        rows.append(
            Row(f"{estimator}: {words}", "", (attitudes, mean, sigma, float(scale.std()), theory), *verdict)
        )
    return Found(rows)


CHAPTER_4 = (
    *(Study(f"hayal-{t}", partial(_table, t)) for t in ("4.2", "4.3", "4.4", "4.5")),
    *(Study(f"hayal-figure-{f}", partial(_figure, f)) for f in AGAINST),
    Study("hayal-convergence", _convergence),
    Study("hayal-norm-bias", _norm_bias),
)
"""What `tumble reproduce` makes of the chapter, and of its estimators."""
