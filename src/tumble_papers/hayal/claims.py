"""What Hayal (2010) says about its calibrations, against the uncertainties in its own tables."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.reproduction.outcome import Row, claim_row

# Unknowns -> the tables of gyros with so many, by scenario; and those of the accelerometers.
GYRO_TABLES = {3: {1: "A.1", 2: "A.3", 3: "5.2", 4: "A.5"}, 9: {1: "A.2", 2: "A.4", 3: "5.3", 4: "A.6"}}
FORCE_TABLES = {1: "B.1", 2: "B.2", 3: "5.4", 4: "B.3"}
MINUTES = (1, 3, 5)
IMUS = ("HG1700", "HG1900")


def claims_of_calibrations(document: dict[str, Any]) -> list[Row]:
    """Check what sections 3.2, 5.3 and chapter 6 say of calibrations.

    Parameters
    ----------
    document : as `tumble_papers.published.hayal` returns it.
    """
    return [
        *_best_bias(document),
        _best_scenario(document),
        _smaller_bias_sigmas(document),
        *_nine_against_three(document),
        *_smallest_force_sigmas(document),
        _better_accelerometers(document),
        _non_orthogonality(document),
        _enough_attitudes(document),
    ]


def _sigmas(document: dict[str, Any], table: str, imu: str, minutes: int, kinds: str = "bsθ") -> np.ndarray:
    return np.array(
        [
            row["minutes"][str(minutes)]["sigma"]
            for row in document["tables"][table]["rows"]
            if row["imu"] == imu and row["parameter"][0] in kinds
        ]
    )


def _most_accurate(document: dict[str, Any], unknowns: int, imu: str) -> tuple[int, int]:
    """Return scenario and minutes of the smallest bias sigmas, in the mean of squares."""
    squares = {
        (scenario, minutes): float(np.mean(_sigmas(document, table, imu, minutes, "b") ** 2))
        for scenario, table in GYRO_TABLES[unknowns].items()
        for minutes in MINUTES
    }
    return min(squares, key=lambda which: squares[which])


def _words(scenario: int, minutes: int) -> str:
    return f"scenario {scenario}, {minutes} min"


def _best_bias(document: dict[str, Any]) -> list[Row]:
    rows: list[Row] = []
    for claim in document["claims"]["best_gyro_bias"]:
        found = _most_accurate(document, claim["unknowns"], claim["imu"])
        said = (claim["scenario"], claim["minutes"])
        label = f"{claim['imu']}: the most accurate gyro bias of the {claim['unknowns']}-parameter solution"
        rows.append(claim_row(label, "", _words(*said), _words(*found), said == found))
    return rows


def _best_scenario(document: dict[str, Any]) -> Row:
    said = document["claims"]["best_scenario_of_all"]
    best = [(u, imu, _most_accurate(document, u, imu)) for u in GYRO_TABLES for imu in IMUS]
    others = [
        f"the {u}-parameter biases of the {imu} are best in scenario {s}"
        for u, imu, (s, _) in best
        if s != said
    ]
    found = f"{len(best) - len(others)} of {len(best)} times"
    return claim_row(
        f'"Scenario {said} provided the best gyroscope bias estimates"',
        "",
        "always",
        found,
        not others,
        "; ".join(others),
    )


def _smaller_bias_sigmas(document: dict[str, Any]) -> Row:
    """The claim is made for both solutions, all scenarios and times."""
    smaller, total, against = 0, 0, list[str]()
    for tables in GYRO_TABLES.values():
        for table in tables.values():
            for minutes in MINUTES:
                ours, theirs = (_sigmas(document, table, imu, minutes, "b") for imu in IMUS)
                smaller, total = smaller + int(np.sum(ours < theirs)), total + ours.size
                if np.all(ours > theirs):
                    against.append(f"{table} at {minutes} min")
    return claim_row(
        "HG1700's gyro biases have smaller sigmas than the HG1900's",
        "",
        f"{total} of {total}",
        f"{smaller} of {total}",
        smaller == total,
        f"all three are larger in tables {', '.join(against)}" if against else "",
    )


def _nine_against_three(document: dict[str, Any]) -> list[Row]:
    """Section 5.3.1 lists where nine parameters give the smaller sigmas of the biases."""
    rows: list[Row] = []
    for imu, said in document["claims"]["nine_better_than_three"].items():
        found = [
            [scenario, minutes]
            for scenario, three in GYRO_TABLES[3].items()
            for minutes in MINUTES
            if np.all(
                _sigmas(document, GYRO_TABLES[9][scenario], imu, minutes, "b")
                < _sigmas(document, three, imu, minutes, "b")
            )
        ]
        missing = [_words(*which) for which in found if which not in said]
        wrong = [_words(*which) for which in said if which not in found]
        reasons = [f"not named: {'; '.join(missing)}"] if missing else []
        reasons += [f"not all three axes: {'; '.join(wrong)}"] if wrong else []
        rows.append(
            claim_row(
                f"{imu}: nine parameters give smaller sigmas of the gyro biases than three",
                "",
                f"{len(said)} cases",
                f"{len(found)} cases",
                found == said,
                "; ".join(reasons),
            )
        )
    return rows


def _smallest_force_sigmas(document: dict[str, Any]) -> list[Row]:
    claim = document["claims"]["smallest_accelerometer_sigmas"]
    said = (claim["scenario"], claim["minutes"])
    rows: list[Row] = []
    for imu in IMUS:
        cases = [(scenario, minutes) for scenario in FORCE_TABLES for minutes in MINUTES]
        sigmas = np.array([_sigmas(document, FORCE_TABLES[s], imu, m) for s, m in cases])
        names = [r["parameter"] for r in document["tables"]["5.4"]["rows"] if r["imu"] == imu]
        there = sigmas[cases.index(said)]
        others: list[str] = []
        for name, at_said, column in zip(names, there, sigmas.T, strict=True):
            scenario, minutes = cases[int(column.argmin())]
            if (scenario, minutes) != said:
                smaller = f"{at_said / column.min():.3g} times smaller"
                others.append(f"{name} is {smaller} in {_words(scenario, minutes)}")
        rows.append(
            claim_row(
                f"{imu}'s accelerometers: {_words(*said)}, has the smallest sigmas",
                "",
                f"{len(names)} of {len(names)}",
                f"{len(names) - len(others)} of {len(names)}",
                not others,
                "; ".join(others),
            )
        )
    return rows


def _better_accelerometers(document: dict[str, Any]) -> Row:
    smaller = [
        _sigmas(document, "5.4", IMUS[0], minutes) < _sigmas(document, "5.4", IMUS[1], minutes)
        for minutes in MINUTES
    ]
    count, total = int(np.sum(smaller)), int(np.size(smaller))
    per_minute = ", ".join(
        f"{int(np.sum(s))} of {s.size} at {m} min" for m, s in zip(MINUTES, smaller, strict=True)
    )
    return claim_row(
        "accelerometers of table 5.4: the HG1700's more accurate in most parameters",
        "",
        "most",
        f"{count} of {total}",
        2 * count > total,
        per_minute,
    )


def _non_orthogonality(document: dict[str, Any]) -> Row:
    said = document["claims"]["non_orthogonality_of_both_units_microradian"]
    rows = document["sheet_tables"]["2.1"]["rows"]
    (found,) = [row["HG1900"] for row in rows if row["parameter"] == "gyro non-orthogonality"]
    return claim_row(
        "non-orthogonality of both units (section 3.2), HG1900's gyros in table 2.1",
        "µrad",
        float(said),
        float(found),
        said == found,
        "the sentence's number is right for the others",
    )


def _enough_attitudes(document: dict[str, Any]) -> Row:
    said = document["claims"]["enough_attitudes_for_9_unknowns"]
    freedom = said - 9
    return claim_row(
        "attitudes that are enough for 9 unknowns: degrees of freedom that they leave",
        "",
        f"{said} attitudes",
        f"{freedom} left",
        freedom > 0,
        "with none, equation 3.37 is zero over zero: no sigma can be stated",
    )
