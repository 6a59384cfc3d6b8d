"""Table 6 and figures 3 and 4 of Zhang et al. (2010): both methods on one unit, beside the printed numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Curve, Outcome, Plot, Row
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.published import zhang
from tumble_papers.zhang.laboratory import (
    AXIS_ERROR,
    POSITIONS,
    compare,
    paper_setting,
    paper_unit,
    spread_directions,
)
from tumble_papers.zhang.tables import LABELS, UNITS, as_printed
from tumble_papers.zhang.turntable_evaluation import in_paper_units, unit_parameters
from tumble_papers.zhang.turntable_simulation import GRAVITY, MICRO_G, Unit, unit_from
from tumble_papers.zhang.verdicts import (
    CHANCE,
    ENOUGH,
    TOO_FEW,
    error_factor,
    judge_error,
    standard_deviation,
)

SOURCE = "Zhang et al. 2010, section 5.2; the paper's recordings are not public, ours are simulated"
# Printed behind the point in the column of discrepancies, a group each; the gyro bias as 0.43e-3.
DIGITS = (2, 2, 2, 2, 2, 5, 2)
# Fewer units than this are no range.
RANGE = 100
METHODS = ("traditional", "proposed")


def _generator(seed: int) -> np.random.Generator:
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
    both = compare(repetitions, _generator(seed))
    truth = unit_parameters(both.unit)
    traditional, proposed = both.traditional.parameters(), both.proposed.parameters()
    apart = in_paper_units(proposed, traditional)
    sigma = standard_deviation(apart)
    own = [standard_deviation(in_paper_units(found, truth)) for found in (traditional, proposed)]
    factor = error_factor(repetitions)
    rows: list[Row] = []
    for k, label in enumerate(LABELS):
        entry, axis = printed["rows"][k // 3], k % 3
        said, half = entry["discrepancy"][axis], 0.5 * 10.0 ** -DIGITS[k // 3]
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
        SOURCE,
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
    both = compare(repetitions, _generator(seed))
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
        SOURCE,
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
