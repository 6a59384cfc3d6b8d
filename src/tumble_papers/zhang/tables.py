"""Tables 2 to 6 and figures 3 and 4 of Zhang et al. (2010): what the methods find in simulated units on a table.

Could a printed error or scatter be one of ours? The distributions answer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.counting import part
from tumble.errors import ObservabilityError
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Curve, Outcome, Plot, Row
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.published import zhang
from tumble_papers.zhang.closed_forms import ellipsoid_from_norms
from tumble_papers.zhang.turntable import (
    AXIS_ERROR,
    CHOICES,
    GRAVITY,
    GROUPS,
    LEFT_OUT,
    MICRO_G,
    NINE,
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
    paper_setting,
    paper_unit,
    simulate,
    spread_directions,
    table_setting,
    triad_parameters,
    unit_from,
    unit_parameters,
)

PRINTED_RUNS = 500
# One true row in a thousand is outside by chance; all of the paper's rows are some two hundred.
CHANCE = 0.001
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


def standard_deviation(differences: AnyArray) -> AnyArray:
    """Return the standard deviation over the runs; of one run, how far it is off.

    Parameters
    ----------
    differences : (runs, ...) from the truth.
    """
    if len(differences) == 1:
        return np.abs(differences[0])
    return np.asarray(np.std(differences, axis=0, ddof=1), dtype=np.float64)


def half_digit(printed: float, digits: int) -> float:
    """Return half a unit of the last digit that is printed, so many behind the point."""
    return 0.5 * 10.0**-digits


def judge_scatter(printed: float, low: float, high: float, ours: float, runs: int) -> tuple[str, str]:
    """Return verdict and reason of a printed standard deviation.

    Parameters
    ----------
    printed, low, high, ours : the printed one, the range that it may lie in, and ours.
    runs : how many ours comes from.
    """
    if runs < ENOUGH:
        return UNJUDGED, ""
    if low <= printed <= high:
        return INSIDE, ""
    return OUTSIDE, f"{printed / ours:.2f} times ours"


def judge_error(printed: float, sigma: float, runs: int, rounding: float = 0.0) -> tuple[str, str]:
    """Return verdict and reason of one printed error.

    Parameters
    ----------
    printed, sigma : the error, and the standard deviation of ours.
    runs : how many ours comes from.
    rounding : that the printed digits leave open.
    """
    if runs < ENOUGH:
        return UNJUDGED, ""
    if abs(printed) <= error_factor(runs) * sigma + rounding:
        return INSIDE, ""
    return OUTSIDE, f"{abs(printed) / sigma:.1f} standard deviations"


def heading_factors(up: Vectors, rng: np.random.Generator) -> AnyArray:
    """Return (2, 3) low and high scatter of the gyro biases over 99 % of choices of headings, relative to ours.

    The paper prints no headings. Each choice turns every attitude about the vertical by an angle at random;
    the scatter is that of (25)'s least squares over the dwell's noise, to the first order.

    Parameters
    ----------
    up : (n, 3) as in `Setting`.
    rng : source of the headings.
    """
    from tumble_papers.zhang.turntable import LATITUDE

    north = norths(up)
    east = np.cross(north, up)
    heading = rng.uniform(0.0, 2.0 * np.pi, (HEADINGS, len(up), 1))
    heading[0] = 0.0
    earth = np.cos(LATITUDE) * (np.cos(heading) * north + np.sin(heading) * east) + np.sin(LATITUDE) * up
    design = earth - earth.mean(axis=1, keepdims=True)
    cofactor: AnyArray = np.asarray(np.linalg.inv(np.swapaxes(design, 1, 2) @ design), dtype=np.float64)
    sigma = np.sqrt(np.diagonal(cofactor, axis1=1, axis2=2))
    return np.stack([np.quantile(sigma, 0.005, axis=0), np.quantile(sigma, 0.995, axis=0)]) / sigma[0]


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


SECTION_5_2 = "Zhang et al. 2010, section 5.2; the paper's recordings are not public, ours are simulated"
# Printed behind the point in the column of discrepancies, a group each; the gyro bias as 0.43e-3.
DISCREPANCY_DIGITS = (2, 2, 2, 2, 2, 5, 2)
# Fewer units than this are no range.
RANGE = 100
METHODS = ("traditional", "proposed")


def _unit_generator(seed: int) -> np.random.Generator:
    # The same units in table and figures.
    return np.random.Generator(np.random.SFC64([seed, 6]))


def reproduce_table_6(repetitions: int, seed: int) -> Outcome:
    """Make table 6 anew: what the two methods find in a simulated unit, and how far they are apart.

    Parameters
    ----------
    repetitions : how many units of the same parameters.
    seed : of all random numbers.
    """
    printed = zhang()["tables"]["6"]
    both = compare(repetitions, _unit_generator(seed))
    truth = unit_parameters(both.unit)
    traditional, proposed = both.traditional.parameters(), both.proposed.parameters()
    apart = in_paper_units(proposed, traditional)
    sigma = standard_deviation(apart)
    own = [standard_deviation(in_paper_units(found, truth)) for found in (traditional, proposed)]
    factor = error_factor(repetitions)
    rows: list[Row] = []
    for k, label in enumerate(LABELS):
        entry, axis = printed["rows"][k // 3], k % 3
        said, half = entry["discrepancy"][axis], 0.5 * 10.0 ** -DISCREPANCY_DIGITS[k // 3]
        cells = (
            as_printed("6", k, entry["traditional"][axis]),
            as_printed("6", k, entry["proposed"][axis]),
            said,
            float(apart[0, k]),
            float(sigma[k]),
            float(own[0][k]),
            float(own[1][k]),
        )
        rows.append(Row(label, UNITS[k], cells, *judge_error(said, float(sigma[k]), repetitions, half)))
    return Outcome(
        "zhang-6",
        f"Table 6: {printed['title']}",
        SECTION_5_2,
        (
            "paper: traditional",
            "paper: proposed",
            "paper: discrepancy",
            "one run: discrepancy",
            "discrepancy: sd",
            "traditional: sd",
            "proposed: sd",
        ),
        rows,
        f"inside: the paper's discrepancy (proposed minus traditional) is within {factor:.3g} standard deviations of "
        f"ours, as {100 * (1 - CHANCE):g} % of all draws are",
        notes=[
            _ASSUMED,
            *([_one_gyro_note(sigma), _which_is_better_note(own)] if repetitions >= ENOUGH else [TOO_FEW]),
        ],
        repetitions=repetitions,
        seed=seed,
    )


_ASSUMED = (
    f"Assumed: {AXIS_ERROR / ARCSECOND:g}″ at random in each attitude and angle, and as much systematically in each "
    "vertical axis and, apart from that, in each axis of rotation. Units of the scale factors are not printed."
)


def _gyro_directions(unit: Unit) -> AnyArray:
    """Return (3, 3) unit vectors in p along which the gyros feel, a row each."""
    matrix = unit.rate_matrix @ unit.rotation
    return matrix / np.linalg.norm(matrix, axis=1, keepdims=True)


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
        directions.append(_gyro_directions(unit_from(unit)))
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


@dataclass(frozen=True, slots=True)
class _Picture:
    """What figures 3 and 4 differ in: the sensors' words, the unit, the noise of a dwell's norm, SI."""

    title: str
    factor: float
    noise: float
    errors: dict[str, AnyArray]


def reproduce_figure(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 3 (specific force) or 4 (angular rate) anew: norm errors of both methods in 48 positions at rest.

    Parameters
    ----------
    figure : "3" or "4".
    repetitions, seed : as for `reproduce_table_6`.
    """
    printed = zhang()["figures"][figure]
    both = compare(repetitions, _unit_generator(seed))
    setting = paper_setting()
    density = setting.force_noise if figure == "3" else setting.rate_noise
    picture = _Picture(
        printed["title"],
        MICRO_G if figure == "3" else DEGREE_PER_HOUR,
        density / np.sqrt(setting.dwell),
        both.force_errors if figure == "3" else both.rate_errors,
    )
    rows = [_figure_row(name, printed, picture) for name in METHODS]
    rows.append(_noise_row(picture, printed, density))
    rows += _difference_rows(printed) if figure == "3" else []
    return Outcome(
        f"zhang-figure-{figure}",
        f"Figure {figure}: {printed['title']}, {POSITIONS} positions",
        SECTION_5_2,
        ("paper", "ours: one run", "mean", "lowest", "highest"),
        rows,
        "inside: the paper's standard deviation lies between the lowest and the highest of "
        f"{repetitions} units, where the noise alone puts 99.9 % of all. Or it is within a tenth of "
        "what table 6 makes of it",
        [_plot(figure, printed["unit"], picture)],
        [_NOT_PRINTED],
        repetitions,
        seed,
    )


_NOT_PRINTED = (
    "Chosen: positions evenly over the sphere, 100 s each. The paper prints neither; how long it takes to make its "
    "numbers of the noise alone is in the row of the noise."
)


def _figure_row(name: str, printed: dict[str, Any], picture: _Picture) -> Row:
    sigma: AnyArray = np.asarray(
        np.std(picture.errors[name], axis=1, ddof=1) / picture.factor, dtype=np.float64
    )
    said, mean = float(printed[name]), float(np.mean(sigma))
    cells = (said, float(sigma[0]), mean, float(np.min(sigma)), float(np.max(sigma)))
    if len(sigma) < RANGE:
        return Row(
            f"{name} method", printed["unit"], cells, UNJUDGED, f"fewer than {RANGE} units have no range"
        )
    fits = np.min(sigma) <= said <= np.max(sigma)
    reason = "" if fits else f"{said / mean:.2g} times the mean of ours"
    return Row(f"{name} method", printed["unit"], cells, INSIDE if fits else OUTSIDE, reason)


def _noise_row(picture: _Picture, printed: dict[str, Any], density: float) -> Row:
    """Hold the smaller printed number against the noise of the dwells, which no calibration can take away."""
    from scipy.special import chdtri

    noise, said = picture.noise / picture.factor, min(printed["traditional"], printed["proposed"])
    freedom = POSITIONS - 1
    low, high = (
        noise * float(np.sqrt(chdtri(freedom, q) / freedom)) for q in (1.0 - 0.5 * CHANCE, 0.5 * CHANCE)
    )
    seconds = (density / (picture.factor * said)) ** 2
    fits = low <= said <= high
    reason = f"as noise alone it takes dwells of {seconds:.3g} s"
    return Row(
        "noise alone, no error of a calibration",
        printed["unit"],
        (said, None, noise, low, high),
        INSIDE if fits else OUTSIDE,
        reason,
    )


def _difference_rows(printed: dict[str, Any]) -> list[Row]:
    """Say what the difference of table 6's two columns does to the norms: it explains one sd by the other."""
    shift = norm_shift()
    wanted = float(np.hypot(printed["proposed"], np.std(shift, ddof=1)))
    bias = np.array(zhang()["tables"]["6"]["rows"][2]["discrepancy"])
    of_bias = float(np.std(spread_directions(POSITIONS) @ bias, ddof=1))
    fits = abs(wanted / printed["traditional"] - 1.0) < 0.1
    words = f"root of {printed['proposed']}² and the {np.std(shift, ddof=1):.1f} µg that table 6's columns differ by"
    return [
        Row(
            "traditional, from the proposed one's and table 6",
            "µg",
            (printed["traditional"], None, wanted, None, None),
            INSIDE if fits else OUTSIDE,
            words,
        ),
        Row(
            "of that the discrepancies of the biases alone",
            "µg",
            (None, None, of_bias, None, None),
            UNJUDGED,
            f"y: {bias[1]} µg",
        ),
    ]


def norm_shift() -> Series:
    """Return (48,) how the norms by table 6's two columns differ, µg, at rest without noise."""
    true = GRAVITY * spread_directions(POSITIONS)
    one, other = (paper_unit(method) for method in METHODS)
    raw = true @ other.force_matrix.T + other.force_bias
    corrected = np.linalg.solve(one.force_matrix, (raw - one.force_bias).T)
    return np.asarray((np.linalg.norm(corrected, axis=0) - GRAVITY) / MICRO_G, dtype=np.float64)


def _plot(figure: str, unit: str, picture: _Picture) -> Plot:
    number = np.arange(1.0, POSITIONS + 1.0)
    curves = tuple(
        Curve(
            f"{name} method",
            number,
            picture.errors[name][0] / picture.factor,
            np.quantile(picture.errors[name], 0.05, axis=0) / picture.factor,
            np.quantile(picture.errors[name], 0.95, axis=0) / picture.factor,
        )
        for name in METHODS
    )
    return Plot(
        "norms",
        f"Norm errors, {'specific force' if figure == '3' else 'angular rate'}",
        "position",
        f"norm minus reference / {unit}",
        curves,
        linear=True,
        line="one run",
    )
