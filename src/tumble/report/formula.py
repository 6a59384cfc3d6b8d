"""The calibration as formulas with its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.parameters import plain_unit

if TYPE_CHECKING:
    from tumble.document.result import Calibration, TriadBlock


def formula_text(calibration: Calibration) -> str:
    """Return both formulas, forward and backward, with matrices and biases, as plain text."""
    units = calibration.raw_units
    force, gyro = calibration.accelerometer, calibration.gyroscope
    parts: list[list[str]] = []
    if force is not None:
        parts.append(
            _triad_lines("a", "specific force f in m/s²", "f", units.specific_force, force, sensitivity=False)
        )
    if gyro is not None:
        coupled = gyro.g_sensitivity is not None
        parts.append(
            _triad_lines("g", "angular rate w in rad/s", "w", units.angular_rate, gyro, sensitivity=coupled)
        )
    return "\n\n".join("\n".join(lines) for lines in parts)


def _triad_lines(
    index: str, what: str, true: str, unit: str, block: TriadBlock, *, sensitivity: bool
) -> list[str]:
    raw, M, b = f"raw_{index}", f"M_{index}", f"b_{index}"
    lines = [f"{what}, {raw} in {plain_unit(unit)}", ""]
    added = " + G f" if sensitivity else ""
    removed = " - G f" if sensitivity else ""
    if block.matrix is None:
        known = "bias and g-sensitivity" if sensitivity else "bias"
        lines += [f"only the {known} can be removed: {raw} - {b}{removed}", *_array_lines(b, [block.bias])]
        return lines if block.g_sensitivity is None else [*lines, *_array_lines("G", block.g_sensitivity)]
    own = "u" + (" + a |u|" if block.asymmetry is not None else "")
    own += " + q u²" if block.quadratic is not None else ""
    if own != "u":
        lines += [
            f"{raw} = {own} + {b}{added},   u = {M} {true}",
            f"{true} = inverse({M}) u,   {own} = {raw} - {b}{removed}",
        ]
    else:
        lines += [f"{raw} = {M} {true} + {b}{added}", f"{true} = inverse({M}) ({raw} - {b}{removed})"]
    lines += ["", *_array_lines(M, block.matrix), *_array_lines(b, [block.bias])]
    for name, values in (("a", block.asymmetry), ("q", block.quadratic)):
        if values is not None:
            lines += _array_lines(name, [values])
    if block.g_sensitivity is not None:
        lines += _array_lines("G", block.g_sensitivity)
    return [*lines, *_array_lines(f"inverse({M})", np.linalg.inv(np.array(block.matrix, dtype=float)))]


def _array_lines(name: str, rows: Any) -> list[str]:
    """Return an array with its name before the first row, nine significant digits."""
    width = max(len(name), 13)
    return [
        f"{name if i == 0 else '':{width}} {'=' if i == 0 else ' '} [ "
        + "  ".join(f"{float(v) + 0.0:16.9g}" for v in row)
        + " ]"
        for i, row in enumerate(rows)
    ]
