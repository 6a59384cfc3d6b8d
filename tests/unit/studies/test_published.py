"""The stored numbers are those that the thesis prints: shapes, and cells typed over a second time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tumble.studies.published import hayal

SIMULATED = {"4.2": (3, 3), "4.3": (6, 3), "4.4": (9, 3), "4.5": (9, 2)}  # parameters, cases
FIELD = {"5.2": 3, "5.3": 9, "5.4": 9, "A.1": 3, "A.2": 9, "A.3": 3, "A.4": 9, "A.5": 3, "A.6": 9} | {
    "B.1": 9,
    "B.2": 9,
    "B.3": 9,
}


def cell(table: str, imu: str, parameter: str, minutes: str) -> dict[str, Any]:
    rows = hayal()["tables"][table]["rows"]
    (row,) = [r for r in rows if (r["imu"], r["parameter"]) == (imu, parameter)]
    return row["minutes"][minutes]


@pytest.mark.parametrize(("table", "shape"), SIMULATED.items())
def test_a_simulated_table_has_all_its_rows_and_cases(table: str, shape: tuple[int, int]) -> None:
    rows = hayal()["tables"][table]["rows"]
    assert (len(rows), {len(row["cases"]) for row in rows}) == (shape[0], {shape[1]})
    for row in rows:
        for entry in row["cases"]:
            assert set(entry) == {"estimate", "sigma", "difference"}


@pytest.mark.parametrize(
    ("table", "true"), [("4.2", 4.848e-6), ("4.3", 4.848e-6), ("4.4", 4.848e-6), ("4.5", 0.01)]
)
def test_differences_are_estimates_minus_truth(table: str, true: float) -> None:
    """A slip in typing would show, but for the printed digits: three of an estimate of the bias."""
    values = {"b": true, "s": 300.0 if table == "4.5" else 150.0, "θ": 100.0}
    for row in hayal()["tables"][table]["rows"]:
        for entry in row["cases"]:
            expected = abs(entry["estimate"] - values[row["parameter"][0]])
            digits = 0.006 * abs(entry["estimate"]) if row["parameter"][0] == "b" else 0.0011
            assert entry["difference"] == pytest.approx(expected, abs=digits)


@pytest.mark.parametrize(("table", "parameters"), FIELD.items())
def test_a_field_table_has_both_units_and_three_times(table: str, parameters: int) -> None:
    rows = hayal()["tables"][table]["rows"]
    assert len(rows) == 2 * parameters
    assert [row["imu"] for row in rows] == parameters * ["HG1700"] + parameters * ["HG1900"]
    names = ["b x", "b y", "b z", "s x", "s y", "s z", "θ yz", "θ zx", "θ zy"][:parameters]
    assert [row["parameter"] for row in rows] == 2 * names
    for row in rows:
        assert set(row["minutes"]) == {"1", "3", "5"}
        for entry in row["minutes"].values():
            assert np.isfinite(entry["estimate"])
            assert entry["sigma"] > 0.0


# Typed from the thesis' pages, apart from the stored file.
SPOTS = [
    ("5.2", "HG1700", "b y", "3", -1.82e-6, 8.28e-7),
    ("5.2", "HG1900", "b z", "5", 7.58e-6, 2.63e-6),
    ("5.3", "HG1700", "s y", "3", 35019.72, 58329.83),
    ("5.3", "HG1900", "θ yz", "1", 70402.10, 40113.45),
    ("5.4", "HG1700", "θ zx", "5", 5542.92, 1628.29),
    ("5.4", "HG1900", "b x", "3", -4.67e-3, 5.41e-5),
    ("A.6", "HG1700", "θ zy", "1", -402928.76, 58031.96),
    ("A.6", "HG1900", "s y", "5", -2641188.00, 1172345.78),
    ("A.6", "HG1900", "b x", "1", -1.57e-4, 8.02e-4),
    ("B.1", "HG1700", "θ yz", "3", 11.75, 44.24),
    ("B.1", "HG1900", "s z", "5", 150.39, 48.36),
    ("B.2", "HG1700", "b x", "1", 4.18e-3, 9.42e-4),
    ("B.2", "HG1700", "s y", "5", 172.51, 24.97),
]


@pytest.mark.parametrize(("table", "imu", "parameter", "minutes", "estimate", "sigma"), SPOTS)
def test_cells_are_as_printed(
    table: str, imu: str, parameter: str, minutes: str, estimate: float, sigma: float
) -> None:
    assert cell(table, imu, parameter, minutes) == {"estimate": estimate, "sigma": sigma}


def test_cells_of_the_simulated_tables_are_as_printed() -> None:
    tables = hayal()["tables"]
    assert tables["4.2"]["rows"][1]["cases"][2] == {
        "estimate": 4.06e-5,
        "sigma": 4.27e-5,
        "difference": 3.57e-5,
    }
    assert tables["4.3"]["rows"][4]["cases"][1]["estimate"] == 25467.152
    assert tables["4.4"]["rows"][7]["cases"][1]["sigma"] == 70860.251
    assert tables["4.5"]["rows"][6]["cases"][1] == {
        "estimate": 127.802,
        "sigma": 32.018,
        "difference": 27.802,
    }


def test_positions_are_as_printed() -> None:
    tables = hayal()["position_tables"]
    assert tables["5.6"]["original"] == {"mean": 0.00071, "sigma": 0.26772}
    assert len(tables["5.5"]["rows"]) == len(tables["5.6"]["rows"]) == 8
    last = tables["5.6"]["rows"][-1]["minutes"]
    assert last["1"] == {"mean": 21.72845, "sigma": 31.48215}
    assert last["3"] == {"mean": 0.01861, "sigma": 0.25578}
    outages = tables["5.7"]["outages"]
    assert set(outages) == {"HG1700", "HG1900"}
    for imu in outages.values():
        assert {gap: len(cells) for gap, cells in imu.items()} == {"2": 4, "10": 4, "30": 4, "60": 4}
    assert outages["HG1700"]["60"][2] == {"mean": 23.9707, "sigma": 147.8637}
    assert outages["HG1900"]["30"][3] == {"mean": 2.8572, "sigma": 24.6951}
