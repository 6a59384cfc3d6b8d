"""Numbers of another tool's file that no calibration has are refused in a sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from tumble.errors import CalibrationFileError
from tumble.export.targets import fusion


def test_numbers_whose_product_is_none_are_refused(tmp_path: Path) -> None:
    lines = [
        f"const {name}{what} = {{{', '.join(['1e200'] * size)}}};"
        for name in ("gyroscope", "accelerometer")
        for what, size in (("Misalignment", 9), ("Sensitivity", 3), ("Offset", 3))
    ]
    file = tmp_path / "fusion_calibration.h"
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(CalibrationFileError, match=r"1e\+200: it is no calibration's number"):
        fusion.read(file)
