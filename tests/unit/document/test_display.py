"""What a notebook shows of a calibration."""

from __future__ import annotations

from msgspec import structs
from tests.laws.test_calibration_document import EXAMPLE, document_of


def test_a_notebook_shows_verdict_parameters_and_no_markup_of_names() -> None:
    calibration = document_of(EXAMPLE)
    named = structs.replace(
        calibration, imu=structs.replace(calibration.imu, model="<script>", serial_number="7")
    )
    shown = named._repr_html_()
    assert "of &lt;script&gt; 7" in shown
    assert "<script>" not in shown
    assert "accelerometer bias x" in shown
    assert "10.20 ± 0.10" in shown
    assert ("NOT fit" in shown) is not calibration.verdict.fit
