"""Tables 2 to 5 of Zhang et al. (2010): what the method finds in simulated units on a table."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.counting import part
from tumble.errors import ObservabilityError
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Outcome, Row
from tumble.units import ARCSECOND
from tumble_papers.published import zhang
from tumble_papers.zhang.separate_norms import ellipsoid_from_norms
from tumble_papers.zhang.turntable_evaluation import (
    CHOICES,
    GROUPS,
    UNITS_SI,
    Estimates,
    evaluate,
    in_paper_units,
    triad_parameters,
    unit_parameters,
)
from tumble_papers.zhang.turntable_simulation import (
    GRAVITY,
    LEFT_OUT,
    MICRO_G,
    NINE,
    ORIENTATIONS,
    Setting,
    simulate,
    table_setting,
)
from tumble_papers.zhang.verdicts import (
    CHANCE,
    ENOUGH,
    PRINTED_RUNS,
    TOO_FEW,
    error_factor,
    half_digit,
    heading_factors,
    judge_error,
    judge_scatter,
    scatter_factors,
    standard_deviation,
)

SOURCE = "Zhang et al. 2010, section 5.1"
LABELS = tuple(symbol for _, _, symbols in GROUPS for symbol in symbols)
UNITS = tuple(unit for _, unit, _ in GROUPS for _ in range(3))
# Printed behind the point, a group each.
DIGITS = {"3": (2, 2, 2, 2, 2, 4, 2), "4": (2, 2, 2, 2, 2, 4, 2), "5": (2, 2, 2)}
# The same of the parameters themselves.
COLUMN_DIGITS = {"2": (6, 2, 2, 2, 2, 4, 2), "6": (6, 2, 2, 3, 2, 6, 2)}
GYRO_BIAS = slice(15, 18)
SETS = {"1-7, 9, 11": NINE, "8, 10, 12-18": LEFT_OUT, "1-18": tuple(range(1, 19))}


_READINGS = (
    "Scale factors in counts per m/s² and rad/s, their errors in ppm. T is read exactly (axes of unit length), the "
    "inter-triad angles as a rotation vector."
)


_GAINS = (
    "All 18 against nine: misalignment {:.2f} times better, scale factor {:.2f}, bias {:.2f}; the paper says 2.7, 1.35 "
    "and 1.75."
)


def _generator(seed: int, table: str, part: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64([seed, int(table), part]))


def reproduce_table_2(repetitions: int, seed: int) -> Outcome:
    """Make table 2 anew: one run beside the printed one, and the scatter that both are draws of.

    Parameters
    ----------
    repetitions, seed : as for `reproduce_table`.
    """
    printed = zhang()["tables"]["2"]
    setting = table_setting("2")
    truth = unit_parameters(setting.unit)
    estimates = evaluate(simulate(setting, repetitions, _generator(seed, "2")))
    found = estimates.parameters()
    differences = in_paper_units(found, truth)
    sigma = standard_deviation(differences)
    shown = _in_counts(found[0])
    rows: list[Row] = []
    for k, label in enumerate(LABELS):
        entry, axis = printed["rows"][k // 3], k % 3
        error = entry["error"][axis]
        values = entry["set"][axis], entry["calibrated"][axis], float(shown[k])
        true, calibrated, ours = (as_printed("2", k, value) for value in values)
        cells = (
            true,
            calibrated,
            error,
            ours,
            float(differences[0, k]),
            float(sigma[k]),
        )
        rows.append(Row(label, UNITS[k], cells, *judge_error(error, float(sigma[k]), repetitions)))
    return Outcome(
        "zhang-2",
        f"Table 2: {printed['title']}",
        SOURCE,
        (
            "paper: set",
            "paper: calibrated",
            "paper: error",
            "one run: calibrated",
            "one run: error",
            "standard deviation",
        ),
        rows,
        f"inside: the paper's error is within {error_factor(repetitions):.3g} of our standard deviations, as "
        f"{100 * (1 - CHANCE):g} % of all draws are (Student's t, {max(repetitions - 1, 1)} degrees of freedom)",
        notes=[_READINGS, _leak_note(printed, differences) if repetitions >= ENOUGH else TOO_FEW],
        repetitions=repetitions,
        seed=seed,
    )


def as_printed(table: str, number: int, value: float) -> str:
    """Return a parameter with as many digits as the paper gives it.

    Parameters
    ----------
    table : "2" or "6".
    number : of the parameter, 0 to 20.
    value : in the paper's unit, scale factors in counts.
    """
    return f"{value:.{COLUMN_DIGITS[table][number // 3]}f}"


def _in_counts(parameters: Series) -> Series:
    """Return parameters in the paper's units, scale factors in counts."""
    scales = (UNITS_SI == 1e-6) & np.isin(np.arange(21) // 3, (0, 3))
    return np.where(scales, parameters, parameters / UNITS_SI)


def leaked(misalignment: AnyArray) -> AnyArray:
    """Return (..., 3) errors of θ that errors of the misalignments yz, zy and zx make, with axes z and then y.

    Parameters
    ----------
    misalignment : (..., 3) errors of yz, zy, zx.
    """
    yz, zy, zx = np.moveaxis(np.asarray(misalignment, dtype=np.float64), -1, 0)
    return np.stack([zx, zy, yz], axis=-1)


def _leak_note(printed: dict[str, Any], differences: AnyArray) -> str:
    """Say how far the printed inter-triad errors are from what the printed misalignments make of them."""
    rows = {row["group"]: np.array(row["error"]) for row in printed["rows"]}
    off = rows["inter-triad"] - leaked(rows["accelerometer misalignment"])
    own = standard_deviation(differences[:, 18:] - leaked(differences[:, 3:6]))
    words = ", ".join(
        f"{name} {value:.1f}″ ({abs(value) / s:.1f} of {s:.2g}″)"
        for name, value, s in zip("xyz", off, own, strict=True)
    )
    return (
        "With the axes z and then y the inter-triad errors θx, θy, θz are those of the accelerometers' zx, zy, yz but "
        f"for the rotations' own noise. The paper's are off from that by {words}."
    )


def reproduce_scatter_table(table: str, repetitions: int, seed: int) -> Outcome:
    """Make table 3 or 4 anew: the scatter of many calibrations, from raw samples and by their statistics.

    Parameters
    ----------
    table : "3" or "4".
    repetitions : how many runs.
    seed : of all random numbers.
    """
    printed = zhang()["tables"][table]
    setting = table_setting(table)
    truth = unit_parameters(setting.unit)
    runs = evaluate(simulate(setting, repetitions, _generator(seed, table)))
    others = evaluate(simulate(setting, repetitions, _generator(seed, table, 1), sampled=False))
    sigma = standard_deviation(in_paper_units(runs.parameters(), truth))
    by_statistics = standard_deviation(in_paper_units(others.parameters(), truth))
    low, high = (factor * sigma for factor in scatter_factors(repetitions))
    headings = heading_factors(setting.up, _generator(seed, table, 2))
    low[GYRO_BIAS] *= headings[0]
    high[GYRO_BIAS] *= headings[1]
    rows: list[Row] = []
    for k, label in enumerate(LABELS):
        value = printed["rows"][k // 3]["sigma"][k % 3]
        half = half_digit(value, DIGITS[table][k // 3])
        verdict, reason = judge_scatter(value, low[k] - half, high[k] + half, float(sigma[k]), repetitions)
        cells = (value, float(sigma[k]), float(by_statistics[k]), float(low[k]), float(high[k]))
        rows.append(Row(label, UNITS[k], cells, verdict, reason))
    rows += _better_choices(runs, others, truth)
    return Outcome(
        f"zhang-{table}",
        f"Table {table}: {printed['title']}",
        SOURCE,
        ("paper", "ours, from samples", "ours, by statistics", "lowest", "highest"),
        rows,
        f"inside: the printed standard deviation of {PRINTED_RUNS} runs, whose last digit is rounded, "
        f"lies where {100 * (1 - CHANCE):g} % of all such do if ours of {repetitions} is of the same "
        "scatter (F-distribution). Of the gyro biases, whose headings are not printed: with 99 % of "
        "choices of them",
        notes=[
            _theory_note(setting, sigma) if repetitions >= ENOUGH else TOO_FEW,
            *_angle_error_note(printed, setting, truth, repetitions, _generator(seed, table, 3)),
        ],
        repetitions=repetitions,
        seed=seed,
    )


def _better_choices(runs: Estimates, others: Estimates, truth: Series) -> list[Row]:
    rows: list[Row] = []
    for choice in CHOICES[1:]:
        sampled, drawn = (
            standard_deviation(in_paper_units(e.parameters(choice), truth))[18:] for e in (runs, others)
        )
        rows += [
            Row(
                f"{label}: {choice}",
                "″",
                (None, float(sampled[k]), float(drawn[k]), None, None),
                UNJUDGED,
                ""
                if choice != CHOICES[3] or k
                else "half the difference across the diagonal sees half of it",
            )
            for k, label in enumerate(LABELS[18:])
        ]
    return rows


def theory_of_nine(sigma: float) -> Series:
    """Return (9,) standard deviations of the accelerometers' parameters with the nine attitudes, in the paper's units.

    Scale and bias: sigma over the root of two; misalignment: the root of seven times sigma.

    Parameters
    ----------
    sigma : of a dwell's mean, m/s².
    """
    share = sigma / GRAVITY
    return np.repeat(
        [1e6 * share / np.sqrt(2.0), np.sqrt(7.0) * share / ARCSECOND, sigma / np.sqrt(2.0) / MICRO_G], 3
    )


def _theory_note(setting: Setting, sigma: Series) -> str:
    ratio = sigma[:9] / theory_of_nine(setting.force_noise / np.sqrt(setting.dwell))
    return (
        "Accelerometers by theory: scale and bias σ/√2, misalignment √7 σ, with σ the noise of a dwell's mean; ours "
        f"are {ratio.min():.2f} to {ratio.max():.2f} of that."
    )


def _angle_error_note(
    printed: dict[str, Any], setting: Setting, truth: Series, repetitions: int, rng: np.random.Generator
) -> list[str]:
    """Say which error of the table's angle would give the printed scatter of the gyros' scale factors."""
    exact = replace(setting, angle_error=0.0)
    noise, all_of_it = (
        standard_deviation(
            in_paper_units(
                evaluate(simulate(s, max(repetitions, 500), rng, sampled=False)).parameters(), truth
            )
        )[9:12]
        for s in (exact, setting)
    )
    by_angle = np.mean(all_of_it**2) - np.mean(noise**2)
    wanted = float(np.mean(np.square(np.array(printed["rows"][3]["sigma"]))) - np.mean(noise**2))
    if wanted <= 0.0:
        return []
    error = setting.angle_error / ARCSECOND * float(np.sqrt(wanted / by_angle))
    words = (
        f"The gyros' scale factors: {np.sqrt(np.mean(noise**2)):.2g} ppm by noise, {np.sqrt(by_angle):.2g} ppm by "
        f"{setting.angle_error / ARCSECOND:g}″ of the table's angle in each direction. The paper's scatter would take "
        f"{error:.2f}″."
    )
    return [words]


def reproduce_table_5(repetitions: int, seed: int) -> Outcome:
    """Make table 5 anew: the accelerometers by three choices of orientations.

    Parameters
    ----------
    repetitions, seed : as for `reproduce_scatter_table`.
    """
    printed = zhang()["tables"]["5"]
    rows: list[Row] = []
    scatters: dict[str, Series] = {}
    for number, (name, orientations) in enumerate(SETS.items()):
        setting = table_setting("5", orientations)
        refused = refusal(setting)
        if refused:
            rows.append(_refused_row(name, printed, refused))
            continue
        with part(number / len(SETS), (number + 1) / len(SETS)):
            statistics = simulate(setting, repetitions, _generator(seed, "5", number))
        found = triad_parameters(*ellipsoid_from_norms(statistics.force, GRAVITY))
        sigma = standard_deviation(in_paper_units(found, unit_parameters(setting.unit)[:9]))
        scatters[name] = sigma
        low, high = (factor * sigma for factor in scatter_factors(repetitions))
        for k, label in enumerate(LABELS[:9]):
            value = printed["rows"][k // 3]["sigma"][name][k % 3]
            half = half_digit(value, 2)
            verdict, reason = judge_scatter(
                value, low[k] - half, high[k] + half, float(sigma[k]), repetitions
            )
            cells = (name, value, float(sigma[k]), float(low[k]), float(high[k]))
            rows.append(Row(label, UNITS[k], cells, verdict, reason))
    few, all_of_them = scatters["1-7, 9, 11"], scatters["1-18"]
    gains = [float(np.mean(few[s]) / np.mean(all_of_them[s])) for s in (slice(3, 6), slice(3), slice(6, 9))]
    return Outcome(
        "zhang-5",
        f"Table 5: {printed['title']}",
        SOURCE,
        ("orientations", "paper", "ours, from samples", "lowest", "highest"),
        rows,
        f"inside: the printed standard deviation of {PRINTED_RUNS} runs lies where "
        f"{100 * (1 - CHANCE):g} % of all such do if ours of {repetitions} is of the same scatter "
        "(F-distribution). Of the singular set: the closed form refuses it, and the paper's numbers "
        "are no scatter of a unit's parameters",
        notes=[_GAINS.format(*gains) if repetitions >= ENOUGH else TOO_FEW],
        repetitions=repetitions,
        seed=seed,
    )


def refusal(setting: Setting) -> str:
    """Return the sentence in which the closed form refuses the nominal attitudes, or nothing.

    Parameters
    ----------
    setting : whose attitudes are tried, without noise.
    """
    exact = replace(setting, force_noise=0.0, rate_noise=0.0, placement=0.0)
    rng = np.random.Generator(np.random.SFC64(0))
    try:
        ellipsoid_from_norms(simulate(exact, 1, rng, sampled=False).force, GRAVITY)
    except ObservabilityError as error:
        return str(error)
    return ""


def _refused_row(name: str, printed: dict[str, Any], sentence: str) -> Row:
    smallest = min(min(row["sigma"][name]) for row in printed["rows"])
    meaningless = smallest > 1e5
    words = (
        f"refused: {sentence} The signs of the three edges that it leaves out multiply to {_product():+d}."
    )
    return Row(
        "all nine parameters",
        "",
        (name, f"from {smallest:.2e}", "refused", None, None),
        INSIDE if meaningless else OUTSIDE,
        words,
    )


def _product() -> int:
    """Return the product of the signs of the three edges that only the nine have."""
    edges = [ORIENTATIONS[number - 1] for number in NINE if np.max(np.abs(ORIENTATIONS[number - 1])) < 0.9]
    return int(np.prod([np.sign(edge[np.nonzero(edge)]).prod() for edge in edges]))
