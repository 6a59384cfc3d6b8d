"""The calibration as formulas with its numbers, and as a few lines of Python that apply it."""

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


def python_snippet(calibration: Calibration) -> str:
    """Return a few lines of Python that correct raw samples (rows of three); with a temperature where it matters."""
    if calibration.thermal is not None and calibration.composed_with is None:
        from tumble.report.thermal_snippet import thermal_snippet

        return thermal_snippet(calibration)
    force, gyro = calibration.accelerometer, calibration.gyroscope
    lines = ["import numpy as np"]
    blocks = [block for block in (force, gyro) if block is not None and block.matrix is not None]
    if any(block.asymmetry is not None or block.quadratic is not None for block in blocks):
        # u + a |u| + q u² = output, solved without cancellation; the sign of u is that of the output.
        lines += [
            "def own_input(output, a, q):",
            "    slope = 1 + np.array(a) * np.sign(output)",
            "    return 2 * output / (slope + np.sqrt(slope**2 + 4 * np.array(q) * output))",
        ]
    names: list[str] = []
    body: list[str] = []
    if force is not None and force.matrix is not None:
        lines.append(f"A_a, b_a = {_inverse(force.matrix)}, {_array(force.bias)}")
        body.append(f"    f = {_own_input(force, 'raw_force - b_a')} @ A_a.T")
        names.append("force")
    if gyro is not None and gyro.matrix is not None:
        lines.append(f"A_g, b_g = {_inverse(gyro.matrix)}, {_array(gyro.bias)}")
        rate = "raw_rate - b_g"
        if gyro.g_sensitivity is not None:
            lines.append(f"G = {_array(gyro.g_sensitivity)}")
            rate += " - f @ G.T"
        body.append(f"    w = {_own_input(gyro, rate)} @ A_g.T")
        names.append("rate")
    lines.append(f"def correct({', '.join(f'raw_{name}' for name in names)}):")
    results = ", ".join({"force": "f", "rate": "w"}[name] for name in names)
    return "\n".join([*lines, *body, f"    return {results}"]) + "\n"


def _own_input(block: TriadBlock, output: str) -> str:
    """Return the expression of each sensor's own input."""
    if block.asymmetry is None and block.quadratic is None:
        return f"({output})"
    nothing = (0.0, 0.0, 0.0)
    return (
        f"own_input({output}, {_literal(block.asymmetry or nothing)}, {_literal(block.quadratic or nothing)})"
    )


def _array(values: Any) -> str:
    return f"np.array({_literal(values)})"


def _inverse(matrix: Any) -> str:
    return f"np.linalg.inv({_literal(matrix)})"


def _literal(values: Any) -> str:
    if isinstance(values, float):
        return repr(values + 0.0)
    return "[" + ", ".join(_literal(value) for value in values) + "]"
