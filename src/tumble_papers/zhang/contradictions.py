"""Where Zhang et al. (2010) contradicts itself: its formulas tried, its tables against one another and its text."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.attitude.directions import twenty_six_directions
from tumble.reproduction.outcome import Outcome, Row, claim_row
from tumble.units import ARCSECOND
from tumble_papers.published import zhang
from tumble_papers.zhang.comparison import gyros_apart, norm_shift
from tumble_papers.zhang.formulas import formula_rows
from tumble_papers.zhang.laboratory import POSITIONS, compare, paper_setting
from tumble_papers.zhang.tables import COLUMN_DIGITS, leaked, theory_of_nine
from tumble_papers.zhang.turntable_evaluation import evaluate, in_paper_units, unit_parameters
from tumble_papers.zhang.turntable_simulation import NINE, simulate, table_setting
from tumble_papers.zhang.verdicts import CHANCE

# Runs by sufficient statistics for a covariance: good to a few percent.
RUNS = 2000


def _mean(numbers: list[float]) -> float:
    return sum(numbers) / len(numbers)


def reproduce_contradictions(repetitions: int, seed: int) -> Outcome:
    """Try the paper's formulas, and hold its tables against one another and its sentences.

    Parameters
    ----------
    repetitions : not used: what needs runs makes its own number of them.
    seed : of all random numbers.
    """
    rng = np.random.Generator(np.random.SFC64([seed, 10]))
    formulas, runs, both, scene = rng.spawn(4)
    document = zhang()
    differences, without = _table_3_runs(runs)
    rows = [
        *formula_rows(formulas),
        *_noise_of_a_sample(document),
        _gravity(document),
        *_columns_against_columns(document),
        *_table_2_against_3(document, differences),
        *_leaks(differences, without),
        _angle_error(document),
        *_claims(document),
        *_figures(document),
        _directions(),
        *_which_is_better(both),
        _turntable_errors(scene),
    ]
    return Outcome(
        "zhang-contradictions",
        "What the paper says, and what its formulas and tables say",
        "Zhang et al. 2010",
        ("said", "found"),
        rows,
        "inside: the check bears the paper out",
        notes=list(_NOTES),
        repetitions=1,
        seed=seed,
    )


_UNCHECKED = (
    "Without a check: in (10) the gyros' sum runs to J_r; in (11) the gyros' vector lacks γ zy. The "
    "second line of (23) has ω_io for ω_ig. Before (39) the axes are known in p and in p, and (39) "
    "has R_n^o for R_p^o."
)
_NOTES = (
    "Table 1, the nine attitudes, is missing from the text at hand: section 3.2 describes them.",
    _UNCHECKED,
)


def _table_3_runs(rng: np.random.Generator) -> tuple[AnyArray, AnyArray]:
    """Return (runs, 21) differences from the truth with table 3's setting, and without perturbed acceleration."""
    one, other = rng.spawn(2)
    setting = table_setting("3")
    truth = unit_parameters(setting.unit)
    calm = replace(setting, perturbation=0.0)
    found = [evaluate(simulate(s, RUNS, g, sampled=False)) for s, g in ((setting, one), (calm, other))]
    with_it, without = (in_paper_units(e.parameters(), truth) for e in found)
    return with_it, without


def _noise_of_a_sample(document: dict[str, Any]) -> list[Row]:
    """Table 3's accelerometers, if a sample's noise is the density times the root of fs, or of half of it."""
    said = _mean(document["tables"]["3"]["rows"][0]["sigma"])
    setting = table_setting("3")
    right = float(theory_of_nine(setting.force_noise / np.sqrt(setting.dwell))[0])
    rows: list[Row] = []
    for words, share in (("√fs", 1.0), ("√(fs/2)", np.sqrt(0.5))):
        found = right * share
        label = f"table 3: accelerometer scale factors if the noise of a sample is the density times {words}"
        rows.append(
            claim_row(
                label,
                "ppm",
                round(said, 1),
                round(found, 1),
                abs(found / said - 1.0) < 0.1,
                f"{said / found:.2f} of what theory has" if share < 1.0 else "",
            )
        )
    return rows


def _gravity(document: dict[str, Any]) -> Row:
    """The biases set are whole thousandths of m/s² with one gravity only."""
    biases: list[float] = document["tables"]["2"]["rows"][2]["set"]
    found = _mean([1e6 * whole / bias for whole, bias in zip((6e-3, -20e-3, -10e-3), biases, strict=True)])
    return claim_row(
        "table 2: biases set are 6, -20 and -10 mm/s² with g =",
        "m/s²",
        9.8,
        round(found, 4),
        abs(found - 9.8) < 1e-3,
        "",
    )


# Printed behind the point in the last column, a group each.
_LAST_DIGITS = {"2": (2, 2, 2, 2, 2, 4, 2), "6": (2, 2, 2, 2, 2, 5, 2)}


def _columns_against_columns(document: dict[str, Any]) -> list[Row]:
    """Hold the printed errors and discrepancies against the columns before them, within rounding."""
    rows: list[Row] = []
    for table, first, second, last in (
        ("2", "set", "calibrated", "error"),
        ("6", "traditional", "proposed", "discrepancy"),
    ):
        agree = 0
        for number, entry in enumerate(document["tables"][table]["rows"]):
            before, after, said = (np.array(entry[key], dtype=float) for key in (first, second, last))
            scale = 1e6 / before if "scale" in entry["group"] else np.ones(3)
            rounding = (
                10.0 ** -COLUMN_DIGITS[table][number] * scale + 0.5 * 10.0 ** -_LAST_DIGITS[table][number]
            )
            off = np.abs((after - before) * scale - said)
            agree += int(np.count_nonzero(off <= 1.001 * rounding))
        label = f"table {table}: numbers of the last column that are the difference of the others"
        rows.append(claim_row(label, "", 21, agree, agree == 21))
    return rows


def _table_2_against_3(document: dict[str, Any], differences: AnyArray) -> list[Row]:
    """Could table 2 be one of the runs whose scatter table 3 has? The chance of errors at least as large."""
    from scipy.special import chdtrc

    errors = np.concatenate([row["error"] for row in document["tables"]["2"]["rows"]])
    sigma = np.concatenate([row["sigma"] for row in document["tables"]["3"]["rows"]])
    correlation: AnyArray = np.asarray(np.corrcoef(differences.T), dtype=np.float64)
    rows: list[Row] = []
    for words, where in (
        ("accelerometers", slice(0, 9)),
        ("gyro scale factors and misalignments", slice(9, 15)),
        ("gyro biases", slice(15, 18)),
    ):
        scaled = errors[where] / sigma[where]
        square = float(scaled @ np.linalg.solve(correlation[where, where], scaled))
        chance = float(chdtrc(len(scaled), square))
        rows.append(
            _chance_row(
                f"table 2 as one run of table 3's scatter: {words}",
                chance,
                f"χ² {square:.3g} of {len(scaled)}",
            )
        )
    own = differences[:, 18:] - leaked(differences[:, 3:6])
    off = errors[18:] - leaked(errors[3:6])
    square = float(off @ np.linalg.solve(np.cov(own.T), off))
    rows.append(
        _chance_row(
            "table 2: inter-triad errors that belong to its misalignment errors (axes z and y)",
            float(chdtrc(3, square)),
            f"χ² {square:.3g} of 3; θ x, y, z are {off[0]:.1f}, {off[1]:.1f} and {off[2]:.1f}″ off from zx, zy, yz",
        )
    )
    return rows


def _chance_row(label: str, chance: float, reason: str) -> Row:
    return claim_row(
        label, "%", f"over {100 * CHANCE:g}", float(f"{100 * chance:.2g}"), chance > CHANCE, reason
    )


def _leaks(differences: AnyArray, without: AnyArray) -> list[Row]:
    """What makes the scatter of the inter-triad angles."""
    own, angles, calm = (
        differences[:, 18:] - leaked(differences[:, 3:6]),
        differences[:, 18:],
        without[:, 18:],
    )
    share = 1.0 - float(np.sum(np.var(own, axis=0)) / np.sum(np.var(angles, axis=0)))
    still = float(np.sum(np.std(calm, axis=0)) / np.sum(np.std(angles, axis=0)))
    return [
        claim_row(
            "table 3: inter-triad variance that the accelerometers' misalignments make, not the axis' disturbance",
            "%",
            "less than half",
            round(100.0 * share, 1),
            share < 0.5,
            f"without the 50 µg its scatter is {still:.2f} times what it is; the axes x, then y, see none of it",
        )
    ]


def _angle_error(document: dict[str, Any]) -> Row:
    setting = table_setting("4")
    floor = 1e6 * np.sqrt(2.0) * setting.angle_error / (2.0 * setting.angle)
    said = _mean(document["tables"]["4"]["rows"][3]["sigma"])
    return claim_row(
        "table 4: gyro scale factors, of which the table's 2″ in each direction alone make",
        "ppm",
        round(said, 3),
        round(float(floor), 3),
        said >= floor * 0.95,
        f"better than the table allows: it takes less than {setting.angle_error / ARCSECOND * said / floor:.2f}″",
    )


def _claims(document: dict[str, Any]) -> list[Row]:
    tables, claims = document["tables"], document["claims"]
    scatter = tables["5"]["rows"]
    rows: list[Row] = []
    for words, entry in (("scale", scatter[0]), ("misalignment", scatter[1]), ("bias", scatter[2])):
        gain = _mean(entry["sigma"]["1-7, 9, 11"]) / _mean(entry["sigma"]["1-18"])
        said = claims["improvement_of_18"][words]
        rows.append(
            claim_row(
                f"table 5: {words} with 18 orientations better than with nine",
                "times",
                said,
                round(gain, 2),
                abs(gain / said - 1.0) < 0.03,
            )
        )
    ratios = [
        _mean(a["sigma"]) / _mean(b["sigma"])
        for a, b in zip(tables["3"]["rows"], tables["4"]["rows"], strict=True)
    ]
    fifth = [ratios[k] for k in (0, 1, 2, 6)]
    rows.append(
        claim_row(
            "tables 3 and 4: accelerometer and inter-triad errors with a fifth of the noise",
            "times",
            claims["fifth_of_table_3"],
            round(float(np.mean(fifth)), 2),
            all(abs(f / 5.0 - 1.0) < 0.1 for f in fifth),
        )
    )
    edges = {2, 4, 6, 8, 10, *range(12, 19)}
    of_a_cube = int(np.count_nonzero(np.count_nonzero(twenty_six_directions(), axis=1) == 2))
    rows.append(
        claim_row(
            "orientations that show the misalignments best, of 18, and edges of a cube",
            "",
            len(edges),
            of_a_cube,
            len(edges) == of_a_cube,
            f"so no. {', '.join(str(n) for n in NINE if n not in edges)} are the faces, and the nine have the edges "
            f"{', '.join(str(n) for n in NINE if n in edges)}",
        )
    )
    return rows


def _figures(document: dict[str, Any]) -> list[Row]:
    """Figures 3 and 4 against the noise that the paper says its sensors have, over dwells of 100 s."""
    from scipy.special import chdtri

    figures = document["figures"]
    table = document["tables"]["6"]
    root = np.sqrt(paper_setting().dwell)
    rows: list[Row] = []
    for figure, density in (
        ("3", table["accelerometer_noise_ug_rtHz"]),
        ("4", table["gyro_noise_deg_h_rtHz"]),
    ):
        printed, noise = figures[figure], density / root
        low, high = (
            noise * float(np.sqrt(chdtri(POSITIONS - 1, q) / (POSITIONS - 1)))
            for q in (1.0 - 0.5 * CHANCE, 0.5 * CHANCE)
        )
        said = printed["proposed"]
        rows.append(
            claim_row(
                f"figure {figure}: scatter of 48 norms, of which the noise of 100 s makes",
                printed["unit"],
                said,
                float(f"{noise:.3g}"),
                bool(low <= said) if figure == "3" else bool(said <= 3.0 * high),
                f"noise alone scatters by {low:.3g} to {high:.3g}; for {said:g} it takes {(density / said) ** 2:.3g} s",
            )
        )
    shift = float(np.std(norm_shift(), ddof=1))
    printed = figures["3"]
    found = float(np.hypot(printed["proposed"], shift))
    bias = np.array(table["rows"][2]["discrepancy"])
    rows.append(
        claim_row(
            "figure 3: the traditional method's scatter, from the other's and table 6",
            "µg",
            printed["traditional"],
            round(found, 2),
            abs(found / printed["traditional"] - 1.0) < 0.1,
            f"{shift:.1f} µg, of which the y bias' {bias[1]:g} µg make {abs(bias[1]) / np.sqrt(3.0):.1f}",
        )
    )
    return rows


def _directions() -> Row:
    x, y, z = gyros_apart()
    flipped = gyros_apart(-1.0)[2]
    limit = 3.0 * 2.0 * np.sqrt(2.0)
    return claim_row(
        "table 6: no gyro's direction differs by more than three times what axes off by 2″ make",
        "″",
        round(limit, 1),
        round(float(max(x, y, z)), 1),
        max(x, y, z) < limit,
        f"x {x:.1f}, y {y:.1f}, z {z:.1f}″; with the opposite sign of γ zy z {flipped:.1f}″",
    )


def _which_is_better(rng: np.random.Generator) -> list[Row]:
    """Section 5.2 on simulated units: which method has the smaller scatter with a table of 2″."""
    both = compare(RUNS, rng)
    truth = unit_parameters(both.unit)
    sigma: list[Series] = [
        np.asarray(np.std(in_paper_units(found, truth), axis=0), dtype=np.float64)
        for found in (both.traditional.parameters(), both.proposed.parameters())
    ]
    rows: list[Row] = []
    for words, where in (
        ("accelerometer scale factors", slice(0, 3)),
        ("accelerometer misalignments", slice(3, 6)),
        ("gyro misalignments", slice(12, 15)),
    ):
        ratio = float(np.mean(sigma[1][where]) / np.mean(sigma[0][where]))
        rows.append(
            claim_row(
                f"both methods simulated, table of 2″: scatter of the {words}, the paper's over the traditional's",
                "1",
                "below 1",
                float(f"{ratio:.2g}"),
                ratio < 1.0,
                ""
                if ratio < 1.0
                else "24 positions against nine; tilts of 2″ are 10 µg, as much as the noise of a dwell",
            )
        )
    return rows


def _turntable_errors(rng: np.random.Generator) -> Row:
    """Try whether the accelerometers' parameters are independent of how well the table stands."""
    exact = replace(table_setting("3"), force_noise=0.0, rate_noise=0.0, perturbation=0.0)
    truth = unit_parameters(exact.unit)
    worst = [
        np.max(
            np.abs(
                in_paper_units(
                    evaluate(
                        simulate(replace(exact, placement=placement), 20, rng, sampled=False)
                    ).parameters(),
                    truth,
                )[:, :9]
            )
        )
        for placement in (2.0 * ARCSECOND, np.radians(1.0))
    ]
    return claim_row(
        "accelerometers without noise: error that attitudes off by 1° make",
        "ppm, ″, µg",
        "almost none",
        "less than 1e-6" if max(worst) < 1e-6 else f"{max(worst):.2g}",
        bool(max(worst) < 1e-3),
    )
