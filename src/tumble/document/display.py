"""A calibration as a notebook shows it: the verdict, and the parameters with their uncertainties."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tumble.files.markup import notebook_html

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tumble.document.result import Calibration

# Numbers from here on are written plainly, smaller ones with a power of ten.
PLAIN = 1e-3


def calibration_html(calibration: Calibration, reason: str = "", files: Sequence[Path] = ()) -> str:
    """Return a heading with the verdict, and a table of the parameters.

    Parameters
    ----------
    calibration : any; parameters in its own procedure's convention, SI units.
    reason : why its procedure was chosen.
    files : that were written of it.
    """
    verdict = "fit for use" if calibration.verdict.fit else "NOT fit for use"
    unit = " ".join(part for part in (calibration.imu.model, calibration.imu.serial_number) if part)
    sources = ", ".join(recording.name for recording in calibration.recordings)
    return notebook_html(
        ("parameter", "value ± standard uncertainty", "unit"),
        [
            (p.name, value_with_uncertainty(p.value, p.standard_uncertainty), p.unit)
            for p in calibration.parameters
        ],
        title=f"Calibration{f' of {unit}' if unit else ''}: {verdict}",
        words=f"({calibration.procedure}; {sources})",
        notes=[*([reason] if reason else []), *calibration.verdict.reasons],
        foot=f"Frame: {calibration.frame.description}"
        + (f" Written: {', '.join(map(str, files))}." if files else ""),
    )


def value_with_uncertainty(value: float, uncertainty: float) -> str:
    """Return both to two digits of the uncertainty, with one power of ten for both.

    Examples
    --------
    >>> value_with_uncertainty(9.80665, 0.0123), value_with_uncertainty(-0.000123456, 7.8e-7)
    ('9.807 ± 0.012', '(-1.2346 ± 0.0078) × 10⁻⁴')
    >>> value_with_uncertainty(1.5, 0.0), value_with_uncertainty(0.0, 0.0)
    ('1.5', '0')
    """
    if not (math.isfinite(uncertainty) and uncertainty > 0.0):
        return f"{value:.9g}"
    size = max(abs(value), uncertainty)
    power = 0 if PLAIN <= size < 1.0 / PLAIN**2 else math.floor(math.log10(size))
    scale = 10.0**-power
    decimals = max(0, 1 - math.floor(math.log10(uncertainty * scale)))
    both = f"{value * scale:.{decimals}f} ± {uncertainty * scale:.{decimals}f}"
    return both if power == 0 else f"({both}) × 10{str(power).translate(_RAISED)}"


_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
