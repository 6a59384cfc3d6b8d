"""The stored numbers are those that the thesis prints: shapes, and cells typed over a second time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tumble_papers.hayal.norm_batch import FORCE_ERRORS, FORCE_NOISE, GYRO_ERRORS, RATE_NOISE
from tumble_papers.study import hayal, zhang

FIELD = {"5.2": 3, "5.3": 9, "5.4": 9, "A.1": 3, "A.2": 9, "A.3": 3, "A.4": 9, "A.5": 3, "A.6": 9} | {
    "B.1": 9,
    "B.2": 9,
    "B.3": 9,
}


def cell(table: str, imu: str, parameter: str, minutes: str) -> dict[str, Any]:
    rows = hayal()["tables"][table]["rows"]
    (row,) = [r for r in rows if (r["imu"], r["parameter"]) == (imu, parameter)]
    return row["minutes"][minutes]


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


def test_what_is_simulated_is_what_the_thesis_prints() -> None:
    """Table 4.1 in the simulation; table 2.1 in table 3.1, for samples of one second."""
    tables = hayal()["sheet_tables"]
    printed = {row["parameter"]: row for row in tables["4.1"]["rows"]}
    for triad, errors, noise in (
        ("gyro", GYRO_ERRORS, RATE_NOISE),
        ("accelerometer", FORCE_ERRORS, FORCE_NOISE),
    ):
        bias, scale, angle = (printed[p][triad] for p in ("bias", "scale factor error", "non-orthogonality"))
        np.testing.assert_allclose(errors, np.repeat([bias, 1e-6 * scale, 1e-6 * angle], 3), rtol=1e-12)
        assert noise == printed["noise"][triad]
    sheet = {row["parameter"]: row for row in tables["2.1"]["rows"]}
    force, rate = tables["3.1"]["rows"]
    for imu in ("HG1700", "HG1900"):
        # random walk over one second; four printed digits
        assert sheet["angular random walk"][imu] * np.pi / 180 / 60 == pytest.approx(rate[imu], rel=1e-4)
        assert sheet["velocity random walk"][imu] / 60 == pytest.approx(force[imu], rel=1e-4)


# Typed from the paper's pages, apart from the stored file.
ZHANG_SPOTS = [
    ("2", 0, "calibrated", 0, 100.001336),
    ("2", 1, "error", 1, -28.09),
    ("2", 2, "set", 1, -2040.82),
    ("2", 5, "error", 1, -0.0170),
    ("2", 6, "calibrated", 2, -415.01),
    ("3", 0, "sigma", 2, 36.90),
    ("3", 2, "sigma", 0, 32.84),
    ("3", 5, "sigma", 1, 0.0103),
    ("3", 6, "sigma", 2, 29.45),
    ("4", 1, "sigma", 1, 5.54),
    ("4", 5, "sigma", 1, 0.0033),
    ("6", 0, "proposed", 2, 31.476642),
    ("6", 2, "discrepancy", 1, -20.38),
    ("6", 3, "traditional", 1, 442258.758),
    ("6", 4, "discrepancy", 0, -15.18),
    ("6", 5, "proposed", 2, -0.022647),
    ("6", 6, "discrepancy", 2, 15.09),
]


@pytest.mark.parametrize(("table", "row", "key", "axis", "number"), ZHANG_SPOTS)
def test_cells_of_zhang_are_as_printed(table: str, row: int, key: str, axis: int, number: float) -> None:
    assert zhang()["tables"][table]["rows"][row][key][axis] == number


def test_zhang_s_choices_of_orientations_are_as_printed() -> None:
    scale, misalignment, bias = (row["sigma"] for row in zhang()["tables"]["5"]["rows"])
    assert scale["1-7, 9, 11"] == [34.11, 34.67, 35.82]
    assert misalignment["1-18"] == [9.91, 9.99, 10.24]
    assert bias["8, 10, 12-18"] == [2.66e5, 3.09e5, 4.68e5]
    figures = zhang()["figures"]
    assert (figures["3"]["traditional"], figures["3"]["proposed"]) == (13.28, 4.94)
    assert (figures["4"]["traditional"], figures["4"]["proposed"]) == (0.0434, 0.0434)


@pytest.mark.parametrize(
    ("table", "columns"),
    [("2", ("set", "calibrated", "error")), ("6", ("traditional", "proposed", "discrepancy"))],
)
def test_zhang_s_last_column_is_the_difference_of_the_others(
    table: str, columns: tuple[str, str, str]
) -> None:
    """A slip in typing would show: the digits of the columns are 0.03 ppm and 0.01″, µg, 1e-4 °/h at worst."""
    for row in zhang()["tables"][table]["rows"]:
        before, after, said = (np.array(row[key], dtype=float) for key in columns)
        scale = 1e6 / before if "scale" in row["group"] else 1.0
        digits = 1.1e-4 if row["group"] == "gyro bias" else 0.016
        np.testing.assert_allclose((after - before) * scale, said, atol=digits)
