"""Tables 2 to 6 and figures 3 and 4 of Zhang et al. (2010): what the methods find in simulated units on a table.

Could a printed error or scatter be one of ours? The distributions answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.counting import part
from tumble.errors import ObservabilityError
from tumble.reproduction import INSIDE, OUTSIDE, UNJUDGED, Curve, Plot, Row
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.study import (
    CHANCE,
    PRINTED_RUNS,
    Found,
    Study,
    generator,
    judge,
    scatter_range,
    standard_deviation,
    zhang,
)
from tumble_papers.zhang.closed_forms import ellipsoid_from_norms
from tumble_papers.zhang.pose_sets import LEFT_OUT, NINE
from tumble_papers.zhang.turntable import (
    AXIS_ERROR,
    CHOICES,
    GRAVITY,
    GROUPS,
    LATITUDE,
    MICRO_G,
    ORIENTATIONS,
    POSITIONS,
    UNITS_SI,
    Estimates,
    Setting,
    Unit,
    compare,
    evaluate,
    in_paper_units,
    norths,
    simulate,
    spread_directions,
    table_setting,
    triad_parameters,
    unit_from,
    unit_of,
)

# Fewer runs have no scatter to speak of: nothing is judged.
ENOUGH = 20
TOO_FEW = f"Fewer than {ENOUGH} runs have no scatter to judge by: say --repetitions 500."
# Choices of headings that the range of the gyro biases is taken over.
HEADINGS = 4000


def scatter_factors(runs: int) -> tuple[float, float]:
    """Return between which multiples of ours a printed standard deviation of 500 runs lies (F-distribution).

    Parameters
    ----------
    runs : how many ours comes from.
    """
    from scipy.special import fdtri

    freedom = max(runs - 1, 1)
    low = fdtri(PRINTED_RUNS - 1, freedom, 0.5 * CHANCE)
    high = fdtri(PRINTED_RUNS - 1, freedom, 1.0 - 0.5 * CHANCE)
    return float(np.sqrt(low)), float(np.sqrt(high))


def error_factor(runs: int) -> float:
    """Return how many of our standard deviations one printed error may be off (Student's t).

    Parameters
    ----------
    runs : how many ours comes from.
    """
    from scipy.special import stdtrit

    return float(stdtrit(max(runs - 1, 1), 1.0 - 0.5 * CHANCE))


def judge_scatter(printed: float, low: float, high: float, ours: float, runs: int) -> tuple[str, str]:
    """Return verdict and reason of a printed standard deviation.

    Parameters
    ----------
    printed, low, high, ours : the printed one, the range that it may lie in, and ours.
    runs : how many ours comes from.
    """
    few = "" if runs < ENOUGH else None
    return judge(low <= printed <= high, f"{printed / ours:.2f} times ours", few)


def judge_error(printed: float, sigma: float, runs: int, rounding: float = 0.0) -> tuple[str, str]:
    """Return verdict and reason of one printed error.

    Parameters
    ----------
    printed, sigma : the error, and the standard deviation of ours.
    runs : how many ours comes from.
    rounding : that the printed digits leave open.
    """
    few = "" if runs < ENOUGH else None
    fits = abs(printed) <= error_factor(runs) * sigma + rounding
    return judge(fits, f"{abs(printed) / sigma:.1f} standard deviations", few)


def heading_factors(up: Vectors, rng: np.random.Generator) -> AnyArray:
    """Return (2, 3) low and high scatter of the gyro biases over 99 % of choices of headings, relative to ours.

    The paper prints no headings. Each choice turns every attitude about the vertical by an angle at random;
    the scatter is that of (25)'s least squares over the dwell's noise, to the first order.

    Parameters
    ----------
    up : (n, 3) as in `Setting`.
    rng : source of the headings.
    """
    north = norths(up)
    east = np.cross(north, up)
    heading = rng.uniform(0.0, 2.0 * np.pi, (HEADINGS, len(up), 1))
    heading[0] = 0.0
    earth = np.cos(LATITUDE) * (np.cos(heading) * north + np.sin(heading) * east) + np.sin(LATITUDE) * up
    design = earth - earth.mean(axis=1, keepdims=True)
    cofactor: AnyArray = np.asarray(np.linalg.inv(np.swapaxes(design, 1, 2) @ design), dtype=np.float64)
    sigma = np.sqrt(np.diagonal(cofactor, axis1=1, axis2=2))
    return np.stack([np.quantile(sigma, 0.005, axis=0), np.quantile(sigma, 0.995, axis=0)]) / sigma[0]


LABELS = tuple(symbol for _, _, symbols in GROUPS for symbol in symbols)
UNITS = tuple(unit for _, unit, _ in GROUPS for _ in range(3))
# Printed behind the point, a group each.
DIGITS = {"3": (2, 2, 2, 2, 2, 4, 2), "4": (2, 2, 2, 2, 2, 4, 2), "5": (2, 2, 2)}
# The same of the parameters themselves.
COLUMN_DIGITS = {"2": (6, 2, 2, 2, 2, 4, 2), "6": (6, 2, 2, 3, 2, 6, 2)}
GYRO_BIAS = slice(15, 18)
SETS = {"1-7, 9, 11": NINE, "8, 10, 12-18": LEFT_OUT, "1-18": tuple(range(1, 19))}


_GAINS = (
    "All 18 against nine: misalignment {:.2f} times better, scale factor {:.2f}, bias {:.2f}; the paper says 2.7, 1.35 "
    "and 1.75."
)


def _table_2(repetitions: int, seed: int) -> Found:
    """Make table 2 anew: one run beside the printed one, and the scatter that both are draws of."""
    printed, setting = zhang()["tables"]["2"], table_setting("2")
    truth = setting.unit.parameters()
    found = evaluate(simulate(setting, repetitions, generator(seed, 2, 0))).parameters()
    differences = in_paper_units(found, truth)
    sigma, shown = standard_deviation(differences), _in_counts(found[0])
    rows: list[Row] = []
    for k, label in enumerate(LABELS):
        entry, axis = printed["rows"][k // 3], k % 3
        error = entry["error"][axis]
        values = entry["set"][axis], entry["calibrated"][axis], float(shown[k])
        true, calibrated, ours = (as_printed("2", k, value) for value in values)
        cells = (true, calibrated, error, ours, float(differences[0, k]), float(sigma[k]))
        rows.append(Row(label, UNITS[k], cells, *judge_error(error, float(sigma[k]), repetitions)))
    note = _leak_note(printed, differences) if repetitions >= ENOUGH else TOO_FEW
    said = {"factor": error_factor(repetitions), "freedom": max(repetitions - 1, 1)}
    return Found(rows, notes=[note], said=said)


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


def _scatter_rows(
    printed: list[float], digits: tuple[int, ...], sigma: Series, ranges: AnyArray, runs: int
) -> Iterator[tuple[str, str, float, tuple[float, float, float], tuple[str, str]]]:
    """Yield of each parameter label, unit, the printed scatter, ours with its range, and the verdict."""
    for k, value in enumerate(printed):
        half = 0.5 * 10.0 ** -digits[k // 3]
        ours, low, high = float(sigma[k]), float(ranges[0, k]), float(ranges[1, k])
        verdict = judge_scatter(value, low - half, high + half, ours, runs)
        yield LABELS[k], UNITS[k], value, (ours, low, high), verdict


def _scatter_table(table: str, repetitions: int, seed: int) -> Found:
    """Make table 3 or 4 anew: the scatter of many calibrations, from raw samples and by their statistics."""
    printed, setting = zhang()["tables"][table], table_setting(table)
    truth, number = setting.unit.parameters(), int(table)
    runs = evaluate(simulate(setting, repetitions, generator(seed, number, 0)))
    others = evaluate(simulate(setting, repetitions, generator(seed, number, 1), sampled=False))
    sigma, by_statistics = (
        standard_deviation(in_paper_units(found.parameters(), truth)) for found in (runs, others)
    )
    ranges = np.outer(scatter_factors(repetitions), sigma)
    ranges[:, GYRO_BIAS] *= heading_factors(setting.up, generator(seed, number, 2))
    said = [value for row in printed["rows"] for value in row["sigma"]]
    rows = [
        Row(label, unit, (value, ours, float(other), low, high), *verdict)
        for (label, unit, value, (ours, low, high), verdict), other in zip(
            _scatter_rows(said, DIGITS[table], sigma, ranges, repetitions), by_statistics, strict=True
        )
    ]
    notes = [
        _theory_note(setting, sigma) if repetitions >= ENOUGH else TOO_FEW,
        *_angle_error_note(printed, setting, truth, repetitions, generator(seed, number, 3)),
    ]
    return Found(rows + _better_choices(runs, others, truth), notes=notes)


def _better_choices(runs: Estimates, others: Estimates, truth: Series) -> list[Row]:
    rows: list[Row] = []
    for choice in CHOICES[1:]:
        sampled, drawn = (
            standard_deviation(in_paper_units(e.parameters(choice), truth))[18:] for e in (runs, others)
        )
        for k, label in enumerate(LABELS[18:]):
            half = choice == CHOICES[3] and not k
            reason = "half the difference across the diagonal sees half of it" if half else ""
            cells = (None, float(sampled[k]), float(drawn[k]), None, None)
            rows.append(Row(f"{label}: {choice}", "″", cells, UNJUDGED, reason))
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


def _table_5(repetitions: int, seed: int) -> Found:
    """Make table 5 anew: the accelerometers by three choices of orientations."""
    printed = zhang()["tables"]["5"]["rows"]
    rows: list[Row] = []
    scatters: dict[str, Series] = {}
    for number, (name, orientations) in enumerate(SETS.items()):
        setting = table_setting("5", orientations)
        said = [value for row in printed for value in row["sigma"][name]]
        refused = refusal(setting)
        if refused:
            # No set that determines all has a scale factor worse than a tenth.
            words = f"refused: {refused} The signs of the three edges that it leaves out multiply to {_product():+d}."
            verdict = INSIDE if min(said) > 1e5 else OUTSIDE
            cells = (name, f"from {min(said):.2e}", "refused", None, None)
            rows.append(Row("all nine parameters", "", cells, verdict, words))
            continue
        with part(number / len(SETS), (number + 1) / len(SETS)):
            statistics = simulate(setting, repetitions, generator(seed, 5, number))
        found = triad_parameters(*ellipsoid_from_norms(statistics.force, GRAVITY))
        sigma = standard_deviation(in_paper_units(found, setting.unit.parameters()[:9]))
        scatters[name] = sigma
        ranges = np.outer(scatter_factors(repetitions), sigma)
        rows += [
            Row(label, unit, (name, value, *ours), *verdict)
            for label, unit, value, ours, verdict in _scatter_rows(
                said, DIGITS["5"], sigma, ranges, repetitions
            )
        ]
    few, all_of_them = scatters["1-7, 9, 11"], scatters["1-18"]
    gains = [float(np.mean(few[s]) / np.mean(all_of_them[s])) for s in (slice(3, 6), slice(3), slice(6, 9))]
    return Found(rows, notes=[_GAINS.format(*gains) if repetitions >= ENOUGH else TOO_FEW])


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


def _product() -> int:
    """Return the product of the signs of the three edges that only the nine have."""
    edges = [ORIENTATIONS[number - 1] for number in NINE if np.max(np.abs(ORIENTATIONS[number - 1])) < 0.9]
    return int(np.prod([np.sign(edge[np.nonzero(edge)]).prod() for edge in edges]))


# Printed behind the point in the column of discrepancies, a group each; the gyro bias as 0.43e-3.
DISCREPANCY_DIGITS = (2, 2, 2, 2, 2, 5, 2)
# Fewer units than this are no range.
RANGE = 100
METHODS = ("traditional", "proposed")


def _table_6(repetitions: int, seed: int) -> Found:
    """Make table 6 anew: what the two methods find in a simulated unit, and how far they are apart."""
    printed = zhang()["tables"]["6"]
    both = compare(repetitions, generator(seed, 6))
    truth = both.unit.parameters()
    traditional, proposed = both.traditional.parameters(), both.proposed.parameters()
    apart = in_paper_units(proposed, traditional)
    sigma = standard_deviation(apart)
    own = [standard_deviation(in_paper_units(found, truth)) for found in (traditional, proposed)]
    rows: list[Row] = []
    for k, label in enumerate(LABELS):
        entry, axis = printed["rows"][k // 3], k % 3
        said, half = entry["discrepancy"][axis], 0.5 * 10.0 ** -DISCREPANCY_DIGITS[k // 3]
        numbers = (float(of) for of in (apart[0, k], sigma[k], own[0][k], own[1][k]))
        cells = (*(as_printed("6", k, entry[method][axis]) for method in METHODS), said, *numbers)
        rows.append(Row(label, UNITS[k], cells, *judge_error(said, float(sigma[k]), repetitions, half)))
    more = [_one_gyro_note(sigma), _which_is_better_note(own)] if repetitions >= ENOUGH else [TOO_FEW]
    said = {"factor": error_factor(repetitions), "axis": AXIS_ERROR / ARCSECOND}
    return Found(rows, notes=more, said=said)


def _gyro_directions(unit: Unit) -> AnyArray:
    """Return (3, 3) unit vectors in p along which the gyros feel, a row each."""
    return unit.gyros / np.linalg.norm(unit.gyros, axis=1, keepdims=True)


def gyros_apart(sign_zy: float = 1.0) -> Series:
    """Return (3,) angles between the directions that table 6's two columns give each gyro in p, ″.

    Parameters
    ----------
    sign_zy : -1 reads γ zy with the opposite of the sign that (5) gives it.
    """
    rows = {row["group"]: row for row in zhang()["tables"]["6"]["rows"]}
    directions: list[AnyArray] = []
    for method in METHODS:
        unit = {group: np.array(row[method], dtype=float) for group, row in rows.items()}
        unit["gyro misalignment"][1] *= sign_zy
        directions.append(_gyro_directions(unit_of(unit)))
    across = np.cross(directions[0], directions[1])
    return np.asarray(np.linalg.norm(across, axis=1) / ARCSECOND, dtype=np.float64)


def _one_gyro_note(sigma: Series) -> str:
    x, y, z = gyros_apart()
    other = gyros_apart(-1.0)[2]
    return (
        f"By table 6 the x gyro points {x:.1f}″ elsewhere by one method than by the other, the y gyro "
        f"{y:.1f}″, the z gyro {z:.1f}″. With the opposite sign of γ zy the z gyro points "
        f"{other:.1f}″ elsewhere: then nearly all discrepancies of γ and θ would be one, of the x "
        f"gyro. Axes that are off by {AXIS_ERROR / ARCSECOND:g}″ scatter γ by "
        f"{np.mean(sigma[12:15]):.1f}″."
    )


def _which_is_better_note(own: list[Series]) -> str:
    ratio = own[1] / own[0]
    better = [f"{LABELS[k]} ({ratio[k]:.2g})" for k in range(21) if ratio[k] < 1.0]
    return (
        "Standard deviation of the paper's method over that of the traditional one, with such a table, below one: "
        f"{', '.join(better) if better else 'none'}; of the rest {ratio[ratio >= 1.0].min():.2g} to {ratio.max():.2g}."
    )


@dataclass(frozen=True)
class _Picture:
    """What figures 3 and 4 differ in: what is printed, SI of the unit, noise density, SI, and ours in the unit."""

    printed: dict[str, Any]
    factor: float
    density: float
    errors: dict[str, AnyArray]


def _norm_figure(figure: str, repetitions: int, seed: int) -> Found:
    """Make figure 3 (specific force) or 4 (angular rate) anew: norm errors of both methods in 48 positions at rest."""
    both, setting, force = compare(repetitions, generator(seed, 6)), table_setting("6"), figure == "3"
    factor = MICRO_G if force else DEGREE_PER_HOUR
    errors = {name: of / factor for name, of in (both.force_errors if force else both.rate_errors).items()}
    density = setting.force_noise if force else setting.rate_noise
    picture = _Picture(zhang()["figures"][figure], factor, density, errors)
    rows = [_figure_row(name, picture) for name in METHODS]
    rows.append(_noise_row(picture, density / np.sqrt(setting.dwell) / factor))
    rows += _difference_rows(picture.printed) if force else []
    words = "specific force" if force else "angular rate"
    return Found(rows, [_plot(words, picture)])


def _figure_row(name: str, picture: _Picture) -> Row:
    sigma: AnyArray = np.asarray(np.std(picture.errors[name], axis=1, ddof=1), dtype=np.float64)
    said = float(picture.printed[name])
    mean, low, high = (float(of(sigma)) for of in (np.mean, np.min, np.max))
    few = f"fewer than {RANGE} units have no range" if len(sigma) < RANGE else None
    verdict = judge(low <= said <= high, f"{said / mean:.2g} times the mean of ours", few)
    return Row(f"{name} method", picture.printed["unit"], (said, float(sigma[0]), mean, low, high), *verdict)


def _noise_row(picture: _Picture, noise: float) -> Row:
    """Hold the smaller printed number against the noise of the dwells, which no calibration can take away."""
    said = min(picture.printed[name] for name in METHODS)
    low, high = (noise * factor for factor in scatter_range(POSITIONS - 1))
    seconds = (picture.density / (picture.factor * said)) ** 2
    verdict = INSIDE if low <= said <= high else OUTSIDE
    cells, reason = (said, None, noise, low, high), f"as noise alone it takes dwells of {seconds:.3g} s"
    return Row("noise alone, no error of a calibration", picture.printed["unit"], cells, verdict, reason)


def _difference_rows(printed: dict[str, Any]) -> list[Row]:
    """Say what the difference of table 6's two columns does to the norms: it explains one sd by the other."""
    shift = float(np.std(norm_shift(), ddof=1))
    wanted = float(np.hypot(printed["proposed"], shift))
    bias = np.array(zhang()["tables"]["6"]["rows"][2]["discrepancy"])
    of_bias = float(np.std(spread_directions(POSITIONS) @ bias, ddof=1))
    verdict = INSIDE if abs(wanted / printed["traditional"] - 1.0) < 0.1 else OUTSIDE
    words = f"root of {printed['proposed']}² and the {shift:.1f} µg that table 6's columns differ by"
    whole, alone = (printed["traditional"], None, wanted, None, None), (None, None, of_bias, None, None)
    label = "of that the discrepancies of the biases alone"
    return [
        Row("traditional, from the proposed one's and table 6", "µg", whole, verdict, words),
        Row(label, "µg", alone, UNJUDGED, f"y: {bias[1]} µg"),
    ]


def norm_shift() -> Series:
    """Return (48,) how the norms by table 6's two columns differ, µg, at rest without noise."""
    true = GRAVITY * spread_directions(POSITIONS)
    one, other = (unit_from("6", method) for method in METHODS)
    raw = true @ other.force_matrix.T + other.force_bias
    corrected = np.linalg.solve(one.force_matrix, (raw - one.force_bias).T)
    return np.asarray((np.linalg.norm(corrected, axis=0) - GRAVITY) / MICRO_G, dtype=np.float64)


def _plot(words: str, picture: _Picture) -> Plot:
    number = np.arange(1.0, POSITIONS + 1.0)
    curves = tuple(
        Curve(f"{name} method", number, of[0], np.quantile(of, 0.05, axis=0), np.quantile(of, 0.95, axis=0))
        for name, of in picture.errors.items()
    )
    label = f"norm minus reference / {picture.printed['unit']}"
    return Plot("norms", f"Norm errors, {words}", "position", label, curves, linear=True, line="one run")


TABLES_AND_FIGURES = (
    Study("zhang-2", _table_2),
    Study("zhang-3", partial(_scatter_table, "3")),
    Study("zhang-4", partial(_scatter_table, "4")),
    Study("zhang-5", _table_5),
    Study("zhang-6", _table_6),
    Study("zhang-figure-3", partial(_norm_figure, "3")),
    Study("zhang-figure-4", partial(_norm_figure, "4")),
)
"""Tables 2 to 6, figures 3 and 4."""
