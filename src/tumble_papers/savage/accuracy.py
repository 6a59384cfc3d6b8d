"""How accurate the strapdown rotation test is: grades, ways to evaluate it, play-backs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.counting import counted
from tumble.reproduction.outcome import UNJUDGED, Row
from tumble_papers.savage.strapdown_simulation import (
    GRADES,
    UNITS_SI,
    VARIANTS,
    Setting,
    Variant,
    group_rms,
    run_study,
)
from tumble_papers.study import Found, Study, generator, judge, savage

LABELS = {
    "kappa_lin": ("κ lin", "ppm"), "kappa_asym": ("κ asym", "ppm"), "upsilon": ("υ", "µrad"),
    "lambda_bias": ("λ bias", "µg"), "mu": ("μ", "µrad"), "lambda_lin": ("λ lin", "ppm"),
    "lambda_asym": ("λ asym", "ppm"),
}  # fmt: skip
ITERATIONS = 3
# A 99 % quantile of 200 runs moves by so much by sampling alone: that of the other implementation.
THEIR_SAMPLING = 0.12
RESAMPLED = 400
ENOUGH = 50
# What a second play-back may still change of the first's.
SETTLED = 0.01
# Fewer ways for the other grades: the formulas' slips are the same for all.
LESS_WAYS = ("as printed, signs corrected", "start bias and norm", "start bias and norm, all components")

# The others' third pass is their second.
THREE_PASSES = ("as printed, signs corrected", "as printed, its signs too", "start bias and norm")


def _ways(grade: str) -> tuple[Variant, ...]:
    if grade == "nav":
        return VARIANTS
    return tuple(v for v in VARIANTS if v.name in LESS_WAYS or v.name.startswith("common bias and norm, all"))


def resampled(
    values: Series, statistic: Callable[[AnyArray], AnyArray], rng: np.random.Generator
) -> tuple[float, float]:
    """Return between which values a statistic of the runs lies in 95 % of bootstrap samples.

    Parameters
    ----------
    values : (runs,).
    statistic : of (samples, runs) along the last axis.
    rng : source of the samples.
    """
    drawn = statistic(values[rng.integers(0, len(values), (RESAMPLED, len(values)))])
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def _quantile(share: float) -> Callable[[AnyArray], AnyArray]:
    return lambda values: np.asarray(np.quantile(values, share, axis=-1), dtype=np.float64)


def _rms(values: AnyArray) -> AnyArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)), dtype=np.float64)


def _accuracy(repetitions: int, seed: int) -> Found:
    """Simulate the test for three grades in many ways: rms and quantiles of each group of errors, each play-back."""
    sampling = generator(seed, 99)
    rows: list[Row] = []
    notes: list[str] = []
    for number, grade in counted(enumerate(GRADES), len(GRADES)):
        ways, rng = _ways(grade), generator(seed, 98, number)
        errors = run_study(Setting(GRADES[grade]), ways, repetitions, rng, iterations=ITERATIONS)
        groups = group_rms(errors)
        for which, way in enumerate(ways):
            for iteration in range(ITERATIONS if way.name in THREE_PASSES else 2):
                values = {name: groups[name][which, :, iteration] for name in LABELS}
                rows += _rows(grade, way, iteration, values, sampling)
        notes += _notes(grade, ways, groups, errors)
    return Found(rows, notes=notes, said={"theirs": 100 * THEIR_SAMPLING})


def _rows(
    grade: str, way: Variant, iteration: int, values: Mapping[str, Series], rng: np.random.Generator
) -> list[Row]:
    rows: list[Row] = []
    for name, (label, unit) in LABELS.items():
        each = values[name]
        if not np.any(each):
            continue
        said = _said(grade, way, iteration, name)
        # Each statistic with its interval, in the order of the columns.
        statistics = (_quantile(0.99), _rms, _quantile(0.95))
        told = [(float(of(each)), *resampled(each, of, rng)) for of in statistics]
        verdict = UNJUDGED, ""
        if said is not None and len(each) >= ENOUGH:
            ours, low, high = told[0]
            fits = low * (1.0 - THEIR_SAMPLING) <= said <= high * (1.0 + THEIR_SAMPLING)
            verdict = judge(fits, f"ours is {ours / said:.2f} of it")
        cells = (iteration, said, *(value for of in told for value in of))
        rows.append(Row(f"{grade}, {way.name}: {label}", unit, cells, *verdict))
    return rows


def _said(grade: str, way: Variant, iteration: int, group: str) -> float | None:
    for row in savage()["another_implementation"]["rows"]:
        if row["grade"] == grade and row["variant"] == way.name and iteration in row["iterations"]:
            return row["values"][group]
    return None


def _notes(
    grade: str, ways: tuple[Variant, ...], groups: Mapping[str, AnyArray], errors: AnyArray
) -> list[str]:
    """What the play-backs change, what all components gain, what the printed signs do."""
    names = [way.name for way in ways]
    plain = names.index("start bias and norm")
    rms = {name: np.sqrt(np.mean(values**2, axis=1)) for name, values in groups.items()}
    change = max(float(abs(values[plain, 2] / values[plain, 1] - 1.0)) for values in rms.values())
    notes = [f"{grade}: a second iteration changes the rms of no group by more than {100 * change:.1g} %."]
    if change > SETTLED:
        notes[-1] += " That is more than 1 %."
    gains = [float(values[names.index(LESS_WAYS[2]), 1] / values[plain, 1]) for values in rms.values()]
    best = names[-1]
    ours = [float(values[-1, 1] / values[plain, 1]) for values in rms.values()]
    notes.append(
        f"{grade}: all components have {min(gains):.2f} to {max(gains):.2f} of (13)'s rms, {best} "
        f"{min(ours):.2f} to {max(ours):.2f}."
    )
    if "as printed, its signs too" in names:
        at = names.index("as printed, its signs too")
        wrong, right = (float(rms["lambda_asym"][k, 0]) for k in (at, names.index(LESS_WAYS[0])))
        later = float(rms["lambda_asym"][at, 2])
        notes.append(
            f"{grade}: with the printed sign of (13) λ asym is wrong by {wrong:.0f} ppm (rms) in the "
            f"first pass, {right:.0f} with the right one. Iterating hides it: {later:.2g} ppm after "
            "the third pass."
        )
    bias = np.mean(errors[plain, :, 1] / UNITS_SI, axis=0)
    sigma = np.std(errors[plain, :, 1] / UNITS_SI, axis=0) / np.sqrt(errors.shape[1])
    if errors.shape[1] >= ENOUGH:
        off = float(np.max(np.abs(bias) / sigma))
        notes.append(
            f"{grade}: the mean of no error is more than {off:.1f} of its standard deviations off zero."
        )
    return notes


STUDIES = (Study("savage-accuracy", _accuracy),)
"""What the paper says of it in words."""
