"""The calibration as formulas with its numbers, and as a few lines of Python that apply it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.parameters import plain_unit

if TYPE_CHECKING:
    from tumble.calibration.result import Calibration, TriadBlock


def formula_text(calibration: Calibration) -> str:
    """Return both formulas, forward and backward, with matrices and biases, as plain text."""
    units = calibration.raw_units
    lines = _triad_lines(
        "a",
        "specific force f in m/s²",
        "f",
        units.specific_force,
        calibration.accelerometer,
        sensitivity=False,
    )
    gyro = calibration.gyroscope
    if gyro is not None:
        coupled = gyro.g_sensitivity is not None
        lines += [
            "",
            *_triad_lines("g", "angular rate w in rad/s", "w", units.angular_rate, gyro, sensitivity=coupled),
        ]
    return "\n".join(lines)


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
    if block.quadratic is not None:
        lines += [
            f"{raw} = u + q u² + {b}{added},   u = {M} {true}",
            f"{true} = inverse({M}) u,   u + q u² = {raw} - {b}{removed}",
        ]
    else:
        lines += [f"{raw} = {M} {true} + {b}{added}", f"{true} = inverse({M}) ({raw} - {b}{removed})"]
    lines += ["", *_array_lines(M, block.matrix), *_array_lines(b, [block.bias])]
    if block.quadratic is not None:
        lines += _array_lines("q", [block.quadratic])
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


def python_snippet(calibration: Calibration) -> str:
    """Return a few lines of Python that correct raw samples (rows of three) with numpy alone."""
    force, gyro = calibration.accelerometer, calibration.gyroscope
    lines = ["import numpy as np", f"A_a, b_a = {_inverse(force.matrix)}, {_array(force.bias)}"]
    own = "raw_force - b_a"
    if force.quadratic is not None:
        lines.append(f"q = {_array(force.quadratic)}")
        own = f"2 * ({own}) / (1 + np.sqrt(1 + 4 * q * ({own})))"
    if gyro is None or gyro.matrix is None:
        return "\n".join([*lines, "def correct(raw_force):", f"    return ({own}) @ A_a.T"]) + "\n"
    lines.append(f"A_g, b_g = {_inverse(gyro.matrix)}, {_array(gyro.bias)}")
    rate = "raw_rate - b_g"
    if gyro.g_sensitivity is not None:
        lines.append(f"G = {_array(gyro.g_sensitivity)}")
        rate += " - f @ G.T"
    lines += [
        "def correct(raw_force, raw_rate):",
        f"    f = ({own}) @ A_a.T",
        f"    return f, ({rate}) @ A_g.T",
    ]
    return "\n".join(lines) + "\n"


def _array(values: Any) -> str:
    return f"np.array({_literal(values)})"


def _inverse(matrix: Any) -> str:
    return f"np.linalg.inv({_literal(matrix)})"


def _literal(values: Any) -> str:
    if isinstance(values, float):
        return repr(values + 0.0)
    return "[" + ", ".join(_literal(value) for value in values) + "]"
