"""Where Hayal (2010) contradicts itself, recomputed from the numbers that it prints."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.reproduction.outcome import Outcome, Row, claim_row
from tumble.units import STANDARD_GRAVITY
from tumble_papers.hayal.claims import IMUS, claims_of_calibrations
from tumble_papers.published import hayal


def reproduce_contradictions(repetitions: int, seed: int) -> Outcome:
    """Check the thesis' claims against its own tables.

    Parameters
    ----------
    repetitions, seed : not used: nothing is simulated.
    """
    document = hayal()
    rows = [
        *_abstract(document),
        *_best_and_worst(document),
        *_scenario_3(document),
        *_increase(document),
        *_larger_by(document),
        *_which_is_better(document),
        *_nine_parameters_worst(document),
        *_gain_of_gyro_biases(document),
        *_two_seconds(document),
        *claims_of_calibrations(document),
        *_impossible_angle(document),
        *_mirror(document),
        _date(document),
    ]
    return Outcome(
        "hayal-contradictions",
        "What the thesis says, and what its own tables say",
        "Hayal 2010",
        ("said", "its own tables"),
        rows,
        "inside: the tables bear the sentence out",
        notes=[
            "Figures have no printed numbers and are not checked. Slips in formulas have tests of their own.",
            "Section 4.3 takes table 4.1's numbers from a figure 2.8, which the thesis does not have: table 2.1.",
            "Section 5.2 shows the trajectory in a figure 5.2, which is 5.3. Two equations have the number 4.12.",
        ],
        repetitions=1,
        seed=seed,
        simulated=False,
    )


def _improvement(before: float, after: float) -> float:
    return 100.0 * (before - after) / before


def _abstract(document: dict[str, Any]) -> list[Row]:
    """The abstract names the best improvement; the chapter is about outages of 2 s."""
    rows: list[Row] = []
    for imu, table in (("HG1700", "5.5"), ("HG1900", "5.6")):
        said = document["abstract_improvement_percent"][imu]
        page = document["position_tables"][table]
        sigmas = [cell["sigma"] for row in page["rows"] for cell in row["minutes"].values()]
        best = _improvement(page["original"]["sigma"], min(sigmas))
        outages = document["position_tables"]["5.7"]["outages"][imu]
        long = max(
            _improvement(gap[0]["sigma"], cell["sigma"]) for gap in [outages["60"]] for cell in gap[1:]
        )
        reason = (
            f"the best of table {table} (2 s) is {best:.1f} %; {long:.1f} % is the best of 60 s in table 5.7"
        )
        rows.append(
            claim_row(
                f"{imu}: accuracy improved by up to",
                "%",
                said,
                round(best, 1),
                abs(said - best) < 0.1,
                reason,
            )
        )
    return rows


def _scenario_3(document: dict[str, Any]) -> list[Row]:
    tables = document["position_tables"]
    first = next(r for r in tables["5.5"]["rows"] if (r["scenario"], r["gyro_parameters"]) == (3, 3))
    said, other = first["minutes"]["3"]["sigma"], tables["5.7"]["outages"]["HG1700"]["2"][2]["sigma"]
    return [
        claim_row(
            "HG1700, scenario 3.3, 3 min, 2 s: table 5.5 against 5.7",
            "m",
            f"{said:.5f}",
            f"{other:.4f}",
            abs(said - other) < 1e-4,
            "a digit fell out of the second",
        )
    ]


def _cell(
    document: dict[str, Any], table: str, scenario: int, unknowns: int, minutes: int
) -> dict[str, float]:
    rows = document["position_tables"][table]["rows"]
    (found,) = [r for r in rows if (r["scenario"], r["gyro_parameters"]) == (scenario, unknowns)]
    return found["minutes"][str(minutes)]


def _best_and_worst(document: dict[str, Any]) -> list[Row]:
    """Scenario 4 at 1 minute is said to be the best and the worst, with 9 and with 3 parameters."""
    claims, page = document["claims"], document["position_tables"]["5.5"]
    before = page["original"]["sigma"]
    rows: list[Row] = []
    for unknowns, key, sign in ((9, "hg1700_best_percent", 1.0), (3, "hg1700_worst_percent", -1.0)):
        change = sign * _improvement(before, _cell(document, "5.5", 4, unknowns, 1)["sigma"])
        words = f"HG1700, scenario 4, 1 min, {unknowns} parameters: {'better' if sign > 0 else 'worse'} by"
        rows.append(
            claim_row(words, "%", float(claims[key]), round(change, 1), abs(change - claims[key]) < 0.5, "")
        )
    return rows


def _increase(document: dict[str, Any]) -> list[Row]:
    said = document["claims"]["hg1900_scenario_4_increase_percent"]
    before = document["position_tables"]["5.6"]["original"]["sigma"]
    change = -_improvement(before, _cell(document, "5.6", 4, 9, 3)["sigma"])
    return [
        claim_row(
            'HG1900, scenario 4, "standard deviation increased by"',
            "%",
            said,
            round(change, 1),
            abs(change - said) < 0.1,
            "it decreased; and the sentence says t = 2 minutes, which was not evaluated",
        )
    ]


def _larger_by(document: dict[str, Any]) -> list[Row]:
    """Position error and its standard deviation are said to be larger by 31.2 m, for large scale factors."""
    said = document["claims"]["hg1900_scenario_4_larger_by_m"]
    one, five = (_cell(document, "5.6", 4, 9, minutes) for minutes in (1, 5))
    sigma, mean = one["sigma"] - five["sigma"], one["mean"] - five["mean"]
    what = "HG1900, scenario 4, 1 min:"
    scale, stated = (
        [
            max(abs(_entry(document, "A.6", "HG1900", f"s {axis}")["minutes"][m][key]) for axis in "xyz")
            for m in ("1", "5")
        ]
        for key in ("estimate", "sigma")
    )
    return [
        claim_row(
            f"{what} standard deviation larger by", "m", said, round(sigma, 1), abs(sigma - said) < 0.1, ""
        ),
        claim_row(
            f"{what} mean error larger by",
            "m",
            said,
            round(mean, 1),
            abs(mean - said) < 0.1,
            "31.2 m is that of the standard deviation alone",
        ),
        claim_row(
            f"{what} because of very large scale factors; position after those of 5 min",
            "m",
            "as large",
            f"{five['sigma']:.2f}",
            five["sigma"] > 0.1 * one["sigma"],
            f"at 5 min a scale factor error of {scale[1]:.3g} ppm, against {scale[0]:.3g}, did no "
            "harm. That alone is not the cause. The largest stated sigma is "
            f"{stated[0] / stated[1]:.0f} times larger at 1 min",
        ),
    ]


def _which_is_better(document: dict[str, Any]) -> list[Row]:
    outages = document["position_tables"]["5.7"]["outages"]
    rows: list[Row] = []
    for gap in ("10", "30"):
        ours = [min(cell["sigma"] for cell in outages[imu][gap]) for imu in IMUS]
        words = f"HG1700 {ours[0]:.4g}, HG1900 {ours[1]:.4g}"
        rows.append(
            claim_row(
                f'"HG1900 provided more accurate estimates for" {gap} s',
                "m",
                "HG1900 better",
                words,
                ours[1] < ours[0],
                "the HG1700's is the smaller one",
            )
        )
    return rows


def _nine_parameters_worst(document: dict[str, Any]) -> list[Row]:
    """Section 5.5: for longer outages the 9-parameter solution gave the worst positions."""
    rows: list[Row] = []
    for imu in IMUS:
        outages = document["position_tables"]["5.7"]["outages"][imu]
        worst = {gap: int(np.argmax([cell["sigma"] for cell in outages[gap]])) for gap in ("10", "30", "60")}
        others = [f"{gap} s" for gap, which in worst.items() if which != 3]
        rows.append(
            claim_row(
                f"{imu}: nine gyro parameters give the worst positions for 10, 30 and 60 s",
                "",
                "always",
                f"{len(worst) - len(others)} of {len(worst)}",
                not others,
                f"no calibration is worse for {' and '.join(others)}" if others else "",
            )
        )
    return rows


def _gain_of_gyro_biases(document: dict[str, Any]) -> list[Row]:
    """Scenario 3.3 against 3.0, as shares of the original's standard deviation."""
    outages = document["position_tables"]["5.7"]["outages"]["HG1700"]
    rows: list[Row] = []
    for gap, said in document["claims"]["hg1700_better_by_percent_of_original"].items():
        original, without, with_biases, _ = (cell["sigma"] for cell in outages[gap])
        gain = 100.0 * (without - with_biases) / original
        rows.append(
            claim_row(
                f"HG1700: gyro biases, too, make the position after {gap} s better by",
                "%",
                said,
                round(gain, 2),
                abs(gain - said) < 0.01,
                "",
            )
        )
    return rows


def _entry(document: dict[str, Any], table: str, imu: str, parameter: str) -> dict[str, Any]:
    rows = document["tables"][table]["rows"]
    return next(r for r in rows if r["imu"] == imu and r["parameter"] == parameter)


def _impossible_angle(document: dict[str, Any]) -> list[Row]:
    """The same angle of the same unit in two tables, against the sigma that they state."""
    few = _entry(document, "5.4", "HG1700", "θ zx")["minutes"]["1"]
    all_of_them = _entry(document, "B.1", "HG1700", "θ zx")["minutes"]["1"]
    apart = abs(few["estimate"] - all_of_them["estimate"]) / np.hypot(few["sigma"], all_of_them["sigma"])
    return [
        claim_row(
            "HG1700, θ zx: table 5.4 (10 attitudes) against B.1 (26), 1 minute",
            "µrad",
            f"{few['estimate']:.0f} ± {few['sigma']:.0f}",
            f"{all_of_them['estimate']:.0f} ± {all_of_them['sigma']:.0f}",
            bool(apart < 4.5),
            f"{apart:.0f} standard deviations apart: the first ten attitudes have no edge between y and z, and cannot "
            "see that angle",
        )
    ]


def _mirror(document: dict[str, Any]) -> list[Row]:
    """A scale factor below zero belongs to no unit."""
    found = _entry(document, "A.6", "HG1900", "s y")["minutes"]["5"]
    return [
        claim_row(
            "HG1900, scenario 4, 5 minutes: 1 + s y of table A.6",
            "1",
            "a unit's scale factor",
            round(1.0 + 1e-6 * found["estimate"], 3),
            1.0 + 1e-6 * found["estimate"] > 0.0,
            "negative: the adjustment ended in the mirror root, which fits as well",
        )
    ]


def _date(document: dict[str, Any]) -> Row:
    first, second = document["claims"]["test_date"].values()
    return claim_row(
        "date of the field test: abstract against chapter 5",
        "",
        first,
        second,
        first.split()[-1] == second.split()[-1],
        "a year apart",
    )


def _two_seconds(document: dict[str, Any]) -> list[Row]:
    """An error of 0.27 m after 2 s free of GNSS would take an acceleration of this size."""
    sigma = document["position_tables"]["5.5"]["original"]["sigma"]
    acceleration = 2.0 * sigma / 2.0**2
    (milli,) = [
        row["HG1700"]
        for row in document["sheet_tables"]["2.1"]["rows"]
        if row["parameter"] == "accelerometer bias repeatability"
    ]
    sheet = 1e-3 * STANDARD_GRAVITY * milli
    return [
        claim_row(
            f"HG1700, {sigma:.2f} m after 2 s: the constant acceleration error that it takes, beside the sheet's bias",
            "m/s²",
            round(sheet, 4),
            round(acceleration, 3),
            acceleration < 3.0 * sheet,
            f"{acceleration / sheet:.0f} times the sheet's {milli} mg: the filter or its GNSS, not the sensors, made "
            "most of it",
        )
    ]
