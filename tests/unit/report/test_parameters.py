"""Numbers in the units that people use, rounded by their uncertainty; conversions are worked by hand."""

import math
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from msgspec import structs
from tests.unit.written import parameters, written

from tumble.calibration import NamedValue
from tumble.document import ThermalBlock, thermal_block
from tumble.parameters import TEMPERATURE, Measure, decimals_of, fixed, parameter_of, with_uncertainty
from tumble.report.evidence.budget import beside, parameters_beside
from tumble.report.html import render_page
from tumble.report.page import Page
from tumble.report.parameters import ParameterRow, parameter_rows
from tumble.report.summary import thermal_changes, thermal_lines
from tumble.sensor import ImuModel, TemperatureBasis, ThermalModel, Triad


@pytest.fixture
def rows(calibration):
    return {row.name: row for row in parameter_rows(calibration)}


@pytest.mark.parametrize(
    ("name", "shown", "other"),
    [
        # 0.0980665 m/s² = 10 mg.
        ("accelerometer bias x", "0.09807 ± 0.00098 m/s²", "10.00 ± 0.10 mg"),
        ("accelerometer scale factor error x", "0.310 ± 0.015 %", None),
        # 0.00354 rad · 180/π = 0.20283 deg.
        ("accelerometer non-orthogonality yz", "3.54 ± 0.13 mrad", "0.2028 ± 0.0074°"),
        # The converter's zero is no bias: 0.25 / 1000 rad/s = 0.0143 °/s, below 0.1 even tenfold.
        # Its family's largest is 0.5 counts over |(-7, 31, 990)|: ten times 0.029 °/s is above 0.1 °/s.
        ("gyro bias x", "33000.00 ± 0.25 counts", "± 0.014 °/s"),
        ("gyro scale factor y", "1010.00 ± 0.50 counts/(rad/s)", "± 0.050 %"),
        ("rotation between the triads x", "31.50 ± 0.50 mrad", "1.805 ± 0.029°"),
        # k u² at 1 g: 2e-4 · 9.80665² m/s² = 0.019234 m/s² = 1.9613 mg, over g².
        ("accelerometer quadratic z", "0.000200 ± 0.000010 1/(m/s²)", "1.961 ± 0.098 mg/g²"),
        # 0.5 counts/(m/s²) / 1000 · 9.80665 · 180/π = 0.28094 (°/s)/g.
        ("g-sensitivity of gyro x to force y", "0.500 ± 0.050 counts/(m/s²)", "0.281 ± 0.028 (°/s)/g"),
        ("lag of the accelerometer behind the gyro", "-14.4 ± 2.5 ms", None),
    ],
)
def test_each_quantity_is_told_in_its_own_and_in_practical_units(rows, name, shown, other):
    row = rows[name]
    assert row.shown.text == shown
    assert (None if row.other is None else row.other.text) == other
    # The largest of a family decides: -1.2345e-2 m/s² is given in mg because 0.5 m/s² is.
    biases = [rows[f"accelerometer bias {axis}"].other for axis in "xyz"]
    assert [bias.unit for bias in biases if bias is not None] == ["mg"] * 3


def test_small_values_take_the_small_unit(write_calibration):
    """2e-4 m/s² = 20.39 µg; 5e-5 = 50 ppm; 2e-5 rad = 20 µrad = 4.125 ″."""
    given = parameters(
        ("accelerometer bias x", 2e-4, 2e-5, "m/s^2"),
        ("accelerometer scale factor error x", 5e-5, 5e-6, "1"),
        ("accelerometer non-orthogonality yz", 2e-5, 2e-6, "rad"),
    )
    bias, scale, angle = parameter_rows(write_calibration(parameters=given))
    assert bias.other.text == "20.4 ± 2.0 µg"
    assert scale.shown.text == "50.0 ± 5.0 ppm"
    assert angle.shown.text == "20.0 ± 2.0 µrad"
    assert angle.other.text == "4.13 ± 0.41″"


def test_scale_factors_in_counts_are_drawn_off_their_mean(rows):
    """(1000 + 1010 + 990) / 3 = 1000, so that y is 1 % off."""
    drawn = rows["gyro scale factor y"].drawn
    assert drawn.value == pytest.approx(1.0, abs=1e-12)  # arithmetic
    assert drawn.sigma == pytest.approx(0.05, abs=1e-12)
    assert not math.isnan(rows["gyro bias x"].drawn.value)


def test_counts_without_a_scale_factor_are_not_converted(write_calibration):
    """A gyro of which only bias and g-sensitivity are known: drawn off the mean of 32590 counts."""
    calibration = write_calibration(gyroscope={"matrix": None, "bias": [33000.0, 32000.0, 32770.0]})
    rows = {row.name: row for row in parameter_rows(calibration)}
    assert rows["gyro bias x"].other is None
    assert rows["gyro bias x"].drawn.value == pytest.approx(410.0, abs=1e-9)  # arithmetic
    assert rows["g-sensitivity of gyro x to force y"].other is None


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        # GUM H.1.6: l = 50.000 838 mm, u = 32 nm.
        (50.000838, 0.000032, "50.000838 ± 0.000032"),
        (0.1025212, 0.00097, "0.10252 ± 0.00097"),
        # 0.0996 rounds to 0.10, not to 0.100.
        (1.23456, 0.0996, "1.23 ± 0.10"),
        (-3.5, 0.25, "-3.50 ± 0.25"),
        (12345.6, 678.0, "12350 ± 680"),
        # The value vanishes in its uncertainty without a sign.
        (-0.0001, 0.5, "0.00 ± 0.50"),
        (-1.2345e-7, 3.2e-9, "(-12.35 ± 0.32) × 10⁻⁸"),
        (2.5e8, 1.3e7, "(2.50 ± 0.13) × 10⁸"),
        (math.nan, 0.0312, "± 0.031"),
        (2.0, 0.0, "2 (no uncertainty)"),
        (2.0, math.nan, "2 (no uncertainty)"),
        (math.nan, math.nan, "not known"),
    ],
)
def test_two_digits_of_the_uncertainty_round_the_value(value, sigma, text):
    assert with_uncertainty(value, sigma) == text


def test_an_interval_has_the_decimals_of_the_uncertainty():
    assert Measure(1.0, 0.1, "").interval(2.0) == "[0.80, 1.20]"
    assert Measure(-0.5, 0.26, "").interval(1.96) == "[-1.01, 0.01]"
    # The power of ten is that in which sigma reads 0.10 to 0.99.
    assert Measure(-1.0e-7, 1.0e-8, "").interval(2.0) == "[-1.20, -0.80] × 10⁻⁷"
    assert Measure(1.0, 0.0, "").interval(2.0) == ""


@given(st.floats(1e-12, 1e12), st.floats(-1e3, 1e3))
def test_rounding_moves_a_value_by_less_than_a_tenth_of_its_uncertainty(sigma, ratio):
    """Two digits are at least 10, so that half a unit of the last is at most a twentieth of sigma."""
    value = ratio * sigma
    shown = float(fixed(value, decimals_of(sigma)))
    # The last digit of sigma is worth at most sigma / 9.95, and arithmetic adds nothing near it.
    assert abs(shown - value) <= 0.5 * sigma / 9.9
    with pytest.raises(ValueError, match="has no digits"):
        decimals_of(0.0)


A, B, C, D = (f"gyro non-orthogonality {axes}" for axes in ("yz", "zx", "zy", "xy"))


def row(name, value, sigma):
    """Shown in thousandths of the parameter's unit."""
    shown = Measure(1e3 * value, 1e3 * sigma, "mrad")
    return ParameterRow(parameter_of(name), shown, None, shown)


@pytest.fixture
def joint():
    """Angle A is better known by half, B worse; the procedure has no C, and D is exact."""
    other = SimpleNamespace(
        procedure="hand-<held>",
        parameters=[
            NamedValue(A, 0.010, 0.002, "rad"),
            NamedValue(B, 0.020, 0.001, "rad"),
            NamedValue(D, 0.0, 0.0, "rad"),
        ],
    )
    own = [
        NamedValue(A, 0.013, 0.001, "rad"),
        NamedValue(B, 0.016, 0.002, "rad"),
        NamedValue(C, 0.5, 0.1, "rad"),
        NamedValue(D, 0.0, 0.0, "rad"),
    ]
    return SimpleNamespace(parameters=own, beside=SimpleNamespace(estimate=other, source="a paper"))


def rows_of(joint):
    return [row(p.name, p.value, p.standard_uncertainty) for p in joint.parameters]


def subject(joint):
    return SimpleNamespace(estimate=joint, rows_of=rows_of(joint))


def test_the_table_names_what_is_far_apart_and_escapes_names(joint):
    a, b = parameters_beside(joint.beside, joint, rows_of(joint))
    assert (a.value, a.sigma) == (pytest.approx(10.0), pytest.approx(2.0))
    # in the procedure's uncertainties
    assert (a.difference, a.ratio) == (pytest.approx(1.5), pytest.approx(0.5))
    assert (b.difference, b.ratio) == (pytest.approx(-4.0), pytest.approx(2.0))
    subject: Any = SimpleNamespace(estimate=joint, rows=rows_of(joint))
    page = render_page(Page("Beside", beside(joint.beside, subject)))
    table = re.sub(r">\s+<", "><", page.split("<h2>")[-1])
    assert "hand-&lt;held&gt;" in table
    assert "hand-<held>" not in table
    assert "Farther apart are gyro non-orthogonality zx:" in table
    assert "<td>+1.5</td><td>0.50</td>" in table
    assert "<td>−4.0</td><td>2.00</td>" in table
    assert "1.00 times" in table  # the root of 0.5 times 2
    joint.beside.estimate.parameters = []
    assert beside(joint.beside, subject) == []


def thermal_calibration():
    model = ThermalModel(
        ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3))),
        TemperatureBasis("polynomial", 20.0, order=2),
        {"accelerometer.bias": np.array([[2e-3, -1e-3, 3e-3], [1e-5, 0.0, 0.0]])},
        span_celsius=(0.0, 60.0),
    )
    covariance = np.zeros((6, 6))
    covariance[0, 0], covariance[3, 3], covariance[0, 3], covariance[3, 0] = 1e-8, 1e-12, -5e-11, -5e-11
    block: ThermalBlock = thermal_block(model, model.names, covariance)

    given = parameters(
        ("thermal accelerometer bias by ΔT x", 2e-3, 0.1, "m/s^2/K"),
        ("thermal lag of the sensors behind the thermometer", 34.0, 0.1, "s"),
    )
    return structs.replace(written(parameters=given), thermal=block)


def test_changes_carry_the_correlations_of_their_coefficients():
    table = thermal_changes(thermal_calibration(), width=80)
    columns = list(zip(*table.rows, strict=True))
    assert list(table.heads) == ["change from 20 °C", "0 °C", "30 °C", "60 °C"]
    # 40 K: 80 + 16 mm/s², variance (1600 e-8 + 2 * 64000 * -5e-11 + 2.56e6 e-12) = 0.0000122. In mg over 9.80665.
    assert columns[3][0] == "9.79 ± 0.36"
    assert columns[0] == ("acc. x / mg", "acc. y / mg", "acc. z / mg")
    lines = thermal_lines(thermal_calibration())
    assert lines[0] == "Lag of the sensors behind the thermometer: 34.00 ± 0.10 s."
    assert lines[1].startswith("1 coefficient of temperature with")
    assert {row.group for row in parameter_rows(thermal_calibration())} == {TEMPERATURE}
