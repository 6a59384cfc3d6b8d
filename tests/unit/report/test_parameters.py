"""Parameters in the units that people use; conversions are worked by hand."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from tests.unit.written import parameters

from tumble.document.result import Calibration
from tumble.report.parameters import ParameterRow, parameter_rows


@pytest.fixture
def rows(calibration: Calibration) -> dict[str, ParameterRow]:
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
def test_each_quantity_is_told_in_its_own_and_in_practical_units(
    rows: dict[str, ParameterRow], name: str, shown: str, other: str | None
) -> None:
    row = rows[name]
    assert row.shown.text == shown
    assert (None if row.other is None else row.other.text) == other


def test_axes_of_one_family_share_their_unit(rows: dict[str, ParameterRow]) -> None:
    """The largest decides: -1.2345e-2 m/s² is given in mg because 0.5 m/s² is."""
    biases = [rows[f"accelerometer bias {axis}"].other for axis in "xyz"]
    assert [bias.unit for bias in biases if bias is not None] == ["mg"] * 3


def test_small_values_take_the_small_unit(write_calibration: Callable[..., Calibration]) -> None:
    """2e-4 m/s² = 20.39 µg; 5e-5 = 50 ppm; 2e-5 rad = 20 µrad = 4.125 ″."""
    given = parameters(
        ("accelerometer bias x", 2e-4, 2e-5, "m/s^2"),
        ("accelerometer scale factor error x", 5e-5, 5e-6, "1"),
        ("accelerometer non-orthogonality yz", 2e-5, 2e-6, "rad"),
    )
    bias, scale, angle = parameter_rows(write_calibration(parameters=given))
    assert bias.other is not None
    assert bias.other.text == "20.4 ± 2.0 µg"
    assert scale.shown.text == "50.0 ± 5.0 ppm"
    assert angle.shown.text == "20.0 ± 2.0 µrad"
    assert angle.other is not None
    assert angle.other.text == "4.13 ± 0.41″"


def test_rows_keep_the_calibrations_order_for_the_correlations(calibration: Calibration) -> None:
    assert [row.name for row in parameter_rows(calibration)] == [p.name for p in calibration.parameters]


def test_scale_factors_in_counts_are_drawn_off_their_mean(rows: dict[str, ParameterRow]) -> None:
    """(1000 + 1010 + 990) / 3 = 1000, so that y is 1 % off."""
    drawn = rows["gyro scale factor y"].drawn
    assert drawn.value == pytest.approx(1.0, abs=1e-12)  # arithmetic
    assert drawn.sigma == pytest.approx(0.05, abs=1e-12)
    assert not math.isnan(rows["gyro bias x"].drawn.value)


def test_counts_without_a_scale_factor_are_not_converted(
    write_calibration: Callable[..., Calibration],
) -> None:
    """A gyro of which only bias and g-sensitivity are known: drawn off the mean of 32590 counts."""
    calibration = write_calibration(gyroscope={"matrix": None, "bias": [33000.0, 32000.0, 32770.0]})
    rows = {row.name: row for row in parameter_rows(calibration)}
    assert rows["gyro bias x"].other is None
    assert rows["gyro bias x"].drawn.value == pytest.approx(410.0, abs=1e-9)  # arithmetic
    assert rows["g-sensitivity of gyro x to force y"].other is None
