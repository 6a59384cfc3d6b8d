"""What a notebook shows of a calibration."""

from __future__ import annotations

import pytest
from msgspec import structs
from tests.laws.test_calibration_document import EXAMPLE, document_of

from tumble.document.display import value_with_uncertainty


def test_a_notebook_shows_verdict_parameters_and_no_markup_of_names() -> None:
    calibration = document_of(EXAMPLE)
    named = structs.replace(
        calibration, imu=structs.replace(calibration.imu, model="<script>", serial_number="7")
    )
    shown = named._repr_html_()
    assert "of &lt;script&gt; 7" in shown
    assert "<script>" not in shown
    assert "accelerometer bias x" in shown
    assert "0.1000 ± 0.0010" in shown
    assert ("NOT fit" in shown) is not calibration.verdict.fit


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (9.80665, 0.0123, "9.807 ± 0.012"),
        (-0.000123456, 7.8e-7, "(-1.2346 ± 0.0078) × 10⁻⁴"),
        (1.5, 0.0, "1.5"),
        (2.0, float("nan"), "2"),
        (0.0, 0.25, "0.00 ± 0.25"),
        (1.23e9, 4.5e6, "(1.2300 ± 0.0045) × 10⁹"),
    ],
)
def test_value_and_uncertainty_have_two_digits_and_one_power(
    value: float, uncertainty: float, text: str
) -> None:
    assert value_with_uncertainty(value, uncertainty) == text
