"""The stored numbers are those that the papers print, typed over a second time; and how they are judged."""

import numpy as np
import pytest

from tumble.reproduction import INSIDE, OUTSIDE, UNJUDGED
from tumble_papers.hayal.chapter_4 import _judged
from tumble_papers.hayal.norm_batch import FORCE_ERRORS, FORCE_NOISE, GYRO_ERRORS, RATE_NOISE
from tumble_papers.hayal.scenarios import (
    FAR,
    ONE_RUN,
    TABLES,
    criterion,
    judge_estimate,
    judge_sigma,
    one_run_factor,
)
from tumble_papers.study import hayal, zhang
from tumble_papers.zhang.tables import (
    error_factor,
    judge_error,
    judge_scatter,
    scatter_factors,
    standard_deviation,
)

FIELD = dict.fromkeys(("5.2", "A.1", "A.3", "A.5"), 3)
FIELD |= dict.fromkeys(("5.3", "5.4", "A.2", "A.4", "A.6", "B.1", "B.2", "B.3"), 9)


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
    names = ["b x", "b y", "b z", "s x", "s y", "s z", "θ yz", "θ zx", "θ zy"][:parameters]
    assert [(row["imu"], row["parameter"]) for row in rows] == [
        (imu, name) for imu in ("HG1700", "HG1900") for name in names
    ]
    for row in rows:
        assert set(row["minutes"]) == {"1", "3", "5"}
        for entry in row["minutes"].values():
            assert np.isfinite(entry["estimate"])
            assert entry["sigma"] > 0.0


def test_every_field_table_is_simulated() -> None:
    assert set(FIELD) == set(TABLES) == {t for t in hayal()["tables"] if not t.startswith("4.")}


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
def test_cells_are_as_printed(table, imu, parameter, minutes, estimate, sigma):
    rows = hayal()["tables"][table]["rows"]
    (row,) = [r for r in rows if (r["imu"], r["parameter"]) == (imu, parameter)]
    assert row["minutes"][minutes] == {"estimate": estimate, "sigma": sigma}


@pytest.mark.parametrize(
    ("table", "row", "case", "printed"),
    [
        ("4.2", 1, 2, {"estimate": 4.06e-5, "sigma": 4.27e-5, "difference": 3.57e-5}),
        ("4.3", 4, 1, {"estimate": 25467.152}),
        ("4.4", 7, 1, {"sigma": 70860.251}),
        ("4.5", 6, 1, {"estimate": 127.802, "sigma": 32.018, "difference": 27.802}),
    ],
)
def test_cells_of_the_simulated_tables_are_as_printed(table, row, case, printed):
    assert printed.items() <= hayal()["tables"][table]["rows"][row]["cases"][case].items()


def test_positions_are_as_printed() -> None:
    tables = hayal()["position_tables"]
    assert tables["5.6"]["original"] == {"mean": 0.00071, "sigma": 0.26772}
    assert len(tables["5.5"]["rows"]) == len(tables["5.6"]["rows"]) == 8
    last = tables["5.6"]["rows"][-1]["minutes"]
    assert last["1"] == {"mean": 21.72845, "sigma": 31.48215}
    assert last["3"] == {"mean": 0.01861, "sigma": 0.25578}
    outages = tables["5.7"]["outages"]
    counts = {imu: {gap: len(cells) for gap, cells in gaps.items()} for imu, gaps in outages.items()}
    assert counts == dict.fromkeys(("HG1700", "HG1900"), dict.fromkeys(("2", "10", "30", "60"), 4))
    assert outages["HG1700"]["60"][2] == {"mean": 23.9707, "sigma": 147.8637}
    assert outages["HG1900"]["30"][3] == {"mean": 2.8572, "sigma": 24.6951}


def test_what_is_simulated_is_what_the_thesis_prints() -> None:
    """Table 4.1 in the simulation; table 2.1 in table 3.1, for samples of one second."""
    tables = hayal()["sheet_tables"]
    printed = {row["parameter"]: row for row in tables["4.1"]["rows"]}
    names = ("bias", "scale factor error", "non-orthogonality")
    for triad, errors, noise in (
        ("gyro", GYRO_ERRORS, RATE_NOISE),
        ("accelerometer", FORCE_ERRORS, FORCE_NOISE),
    ):
        values = [printed[name][triad] * (1.0 if name == "bias" else 1e-6) for name in names]
        np.testing.assert_allclose(errors, np.repeat(values, 3), rtol=1e-12)
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
def test_zhang_s_last_column_is_the_difference_of_the_others(table, columns):
    """A slip in typing would show: the digits of the columns are 0.03 ppm and 0.01″, µg, 1e-4 °/h at worst."""
    for row in zhang()["tables"][table]["rows"]:
        before, after, said = (np.array(row[key], dtype=float) for key in columns)
        scale = 1e6 / before if "scale" in row["group"] else 1.0
        digits = 1.1e-4 if row["group"] == "gyro bias" else 0.016
        np.testing.assert_allclose((after - before) * scale, said, atol=digits)


# Verdicts --------------------------------------------------------------------------------------------

OURS, ONE, ROW = np.array([1.0, 2.0, 3.0, 8.0]), np.array([1.0]), np.ones((1, 3))
ZERO_AWAY = "its estimate is 15 times sheet and sigma together from zero"


@pytest.mark.parametrize(
    ("judge", "told", "fits", "words"),
    [
        # a sigma between the lowest and the highest is one of ours; beyond it is not, and it is said why
        *((judge_sigma, (printed, OURS, 2.0, 17), True, []) for printed in (1.0, 2.5, 8.0)),
        # 10 / median 2.5; sigma0 10 / 2
        (judge_sigma, (10.0, OURS, 2.0, 17), False, ["4 times the median", "about 5:", "wandered more"]),
        # sigma0 0.5 / 2: less than white noise of the sheet's size leaves
        (
            judge_sigma,
            (0.5, OURS, 2.0, 17),
            False,
            ["0.2 times the median", "about 0.25:", "quieter than the sheet"],
        ),
        (judge_sigma, (0.5, OURS, 0.25, 17), False, ["wandered less"]),
        # one unit is compared by the F distribution
        (judge_sigma, (9.0, ONE, 1.0, 17), True, [""]),
        (judge_sigma, (1 / 9.0, ONE, 1.0, 17), True, [""]),
        (judge_sigma, (11.0, ONE, 1.0, 17), False, [""]),
        (judge_sigma, (1 / 11.0, ONE, 1.0, 17), False, [""]),
        (judge_sigma, (600.0, ONE, 1.0, 1), True, [""]),
        # an estimate far from zero is plausible if ours are as far off; few units cannot tell that it is rare
        (judge_estimate, (15.0, 0.03, 500), True, [f"{ZERO_AWAY}; so far off are 3 % of ours"]),
        (judge_estimate, (3.5, 0.002, 500), False, ["0.2 % of ours"]),
        (judge_estimate, (15.0, 0.0, 200), True, [""]),
        (judge_estimate, (15.0, 0.0, 400), False, [""]),
        (judge_estimate, (15.0, 0.0, 1), True, [ZERO_AWAY]),
        # of one run sigma and difference are judged roughly; five of its own sigmas are no chance
        (_judged, (2.9, 2.0, ROW, ROW, 100.0), INSIDE, []),
        (_judged, (3.1, 2.0, ROW, ROW, 100.0), OUTSIDE, [""]),
        (_judged, (0.32, 0.1, ROW, ROW, 100.0), OUTSIDE, [""]),
        (_judged, (1.0, 5.0, ROW, ROW, 100.0), OUTSIDE, ["5 times its own sigma"]),
        (judge_scatter, (1.0, 0.9, 1.1, 1.05, 500), INSIDE, []),
        (judge_scatter, (2.0, 0.9, 1.1, 1.0, 500), OUTSIDE, ["2.00 times ours"]),
        (judge_scatter, (1.0, 0.0, 2.0, 1.0, 19), UNJUDGED, [""]),
        # with 499 degrees of freedom 99.9 % lie within 3.31
        (judge_error, (-3.3, 1.0, 500), INSIDE, []),
        (judge_error, (-3.4, 1.0, 500), OUTSIDE, ["3.4 standard deviations"]),
        (judge_error, (-3.4, 1.0, 500, 0.1), INSIDE, []),
    ],
)
def test_printed_numbers_are_judged(judge, told, fits, words):
    verdict, reason = judge(*told)
    assert verdict == fits
    assert [word for word in words if word not in reason] == []
    # no words at all where nothing needs to be said
    assert (reason == "") or words


def test_factors_of_chance_are_those_of_tables() -> None:
    """F of (1, 1) at 99.5 % is 16211, of (17, 17) 3.71; Student's t of 99.9 % is 637 and 3.31."""
    assert judge_estimate(FAR, 0.0, 500) == (True, "")
    assert one_run_factor(1) == pytest.approx(ONE_RUN * np.sqrt(16211.0), rel=1e-4)
    assert one_run_factor(17) == pytest.approx(ONE_RUN * np.sqrt(3.707), rel=1e-3)
    assert error_factor(1) == pytest.approx(636.6, rel=1e-3)
    assert error_factor(500) == pytest.approx(3.31, abs=0.01)
    low, high = scatter_factors(500)
    assert low == pytest.approx(1.0 / high, rel=1e-9)
    # two standard deviations of 500 runs differ by 4.5 %: 3.29 of it
    assert high == pytest.approx(1.0 + 3.29 * 0.045, abs=0.02)
    assert scatter_factors(20)[1] > 1.5
    assert standard_deviation(np.array([[1.0, -2.0]])) == pytest.approx([1.0, 2.0])
    assert standard_deviation(np.array([[1.0], [3.0]])) == pytest.approx([np.sqrt(2.0)])
    assert "500 simulated units" in criterion(500, 17)
    assert "factor of 9.6" in criterion(1, 17)
    assert "1 degree of freedom" in criterion(1, 1)
