"""Where Hayal (2010) contradicts itself, recomputed from the numbers that it prints."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.studies.outcome import INSIDE, OUTSIDE, Outcome, Row
from tumble.studies.published import hayal


def reproduce_contradictions(repetitions: int, seed: int) -> Outcome:
    """Check the thesis' claims against its own tables.

    Parameters
    ----------
    repetitions, seed : not used: nothing is simulated.
    """
    document = hayal()
    rows = [
        *_abstract(document),
        *_scenario_3(document),
        *_increase(document),
        *_which_is_better(document),
        *_impossible_angle(document),
        *_mirror(document),
        *_sixty_seconds(document),
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
            "The field test is dated 06 June 2010 in the abstract and June 06, 2009 in chapter 5.",
            "Section 4.3 takes table 4.1's numbers from a figure 2.8, which the thesis does not have: table 2.1.",
        ],
        repetitions=1,
        seed=seed,
    )


def _row(label: str, unit: str, said: float | str, found: float | str, agrees: bool, reason: str) -> Row:
    return Row(label, unit, (said, found), INSIDE if agrees else OUTSIDE, reason)


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
            _row(
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
        _row(
            "HG1700, scenario 3.3, 3 minutes, 2 s: table 5.5 against 5.7",
            "m",
            f"{said:.5f}",
            f"{other:.4f}",
            abs(said - other) < 1e-4,
            "a digit fell out of the second",
        )
    ]


def _increase(document: dict[str, Any]) -> list[Row]:
    page = document["position_tables"]["5.6"]
    before = page["original"]["sigma"]
    after = next(r for r in page["rows"] if (r["scenario"], r["gyro_parameters"]) == (4, 9))["minutes"]["3"][
        "sigma"
    ]
    change = -_improvement(before, after)
    return [
        _row(
            'HG1900, scenario 4, "standard deviation increased by"',
            "%",
            4.5,
            round(change, 1),
            change > 0.0,
            "it decreased; and the sentence says t = 2 minutes, which was not evaluated",
        )
    ]


def _which_is_better(document: dict[str, Any]) -> list[Row]:
    outages = document["position_tables"]["5.7"]["outages"]
    rows: list[Row] = []
    for gap in ("10", "30"):
        ours = [min(cell["sigma"] for cell in outages[imu][gap]) for imu in ("HG1700", "HG1900")]
        words = f"HG1700 {ours[0]:.4g}, HG1900 {ours[1]:.4g}"
        rows.append(
            _row(
                f'"HG1900 provided more accurate estimates for" {gap} s',
                "m",
                "HG1900 better",
                words,
                ours[1] < ours[0],
                "the HG1700's is the smaller one",
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
        _row(
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
        _row(
            "HG1900, scenario 4, 5 minutes: 1 + s y of table A.6",
            "1",
            "a unit's scale factor",
            round(1.0 + 1e-6 * found["estimate"], 3),
            1.0 + 1e-6 * found["estimate"] > 0.0,
            "negative: the adjustment ended in the mirror root, which fits as well",
        )
    ]


def _sixty_seconds(document: dict[str, Any]) -> list[Row]:
    """An error of 0.27 m after 2 s free of GNSS would take an acceleration of this size."""
    sigma = document["position_tables"]["5.5"]["original"]["sigma"]
    acceleration = 2.0 * sigma / 2.0**2
    return [
        _row(
            "HG1700, 0.27 m after 2 s: the constant acceleration error that it takes",
            "m/s²",
            0.0098,
            round(acceleration, 3),
            acceleration < 0.0098 * 3.0,
            "some ten times the sheet's 1 mg: the filter or its GNSS, not the sensors, made most of it",
        )
    ]
