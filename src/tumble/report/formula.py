"""The calibration as formulas with its numbers, and as lines of Python that apply it, at any temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.parameters import plain_unit

if TYPE_CHECKING:
    from tumble.document.result import Calibration, TriadBlock
    from tumble.sensor import Triad
    from tumble.sensor.thermal import TemperatureBasis, ThermalModel


def thermal_snippet(calibration: Calibration) -> str:
    """Return lines that correct raw samples (rows of three) at the sensor's temperature (°C), one a sample.

    They take the temperature, its rate and the state of the hysteresis of the sensor itself; how these follow
    from a thermometer is in the file (`path_formula`).
    """
    model = calibration.thermal_model
    assert model is not None
    lines = ["import numpy as np", *_basis_lines(model.basis)]
    low, high = model.span_celsius
    lines += [
        f"# T: °C of the sensor itself, between {low:.1f} and {high:.1f}, a value a sample; rate: K/s;",
        "# s: -1 after cooling, 1 after heating. From a thermometer: averaged over",
        f"# {model.smoothing:g} s, {model.lag:.0f} s late (path_formula in the file).",
    ]
    names: list[str] = []
    body = ["    T = np.asarray(T, float)", "    x = functions(T)"]
    if model.reference.accelerometer is not None:
        lines += _constants("a", "accelerometer", model.reference.accelerometer, model)
        body += _body("a", "f", "raw_force", "accelerometer", model, coupled=False)
        names.append("force")
    if model.reference.gyroscope is not None:
        coupled = model.reference.g_sensitivity is not None and "force" in names
        lines += _constants("g", "gyroscope", model.reference.gyroscope, model)
        if coupled:
            lines.append(f"G = {_array(model.reference.g_sensitivity)}")
            if "g_sensitivity" in model.coefficients:
                lines.append(f"G_T = {_array(model.coefficients['g_sensitivity'])}")
        body += _body("g", "w", "raw_rate", "gyroscope", model, coupled=coupled)
        names.append("rate")
    if any(t and not t.is_straight for t in (model.reference.accelerometer, model.reference.gyroscope)):
        lines.insert(
            1, "# Asymmetry and quadratic terms are left out here; tumble apply takes them into account."
        )
    lines.append(f"def correct({', '.join(f'raw_{name}' for name in names)}, T, rate=0.0, s=0.0):")
    lines.append("    rate, s = np.broadcast_to(rate, np.shape(T)), np.broadcast_to(s, np.shape(T))")
    results = ", ".join({"force": "f", "rate": "w"}[name] for name in names)
    return "\n".join([*lines, *body, f"    return {results}"]) + "\n"


def _basis_lines(basis: TemperatureBasis) -> list[str]:
    """Return the functions of temperature, (samples, functions)."""
    R = basis.reference_celsius
    if basis.kind == "polynomial":
        return [
            "def functions(T):",
            f"    return (T[:, None] - {R!r}) ** np.arange(1, {basis.order + 1})",
        ]
    nodes = basis.nodes.tolist()
    nearest = int(np.argmin(np.abs(basis.nodes - R)))
    lines = [f"nodes = np.array({nodes!r})"]
    if basis.kind == "linear":
        lines += [
            "def hats(T):",
            "    return np.column_stack([np.interp(T, nodes, row) for row in np.eye(nodes.size)])",
        ]
    else:
        lines += [
            "from scipy.interpolate import CubicSpline",
            'hats = CubicSpline(nodes, np.eye(nodes.size), bc_type="natural")  # between the nodes',
        ]
    return [
        *lines,
        "def functions(T):",
        f"    return np.delete(hats(T) - hats(np.array([{R!r}])), {nearest}, axis=1)",
    ]


def _constants(index: str, name: str, triad: Triad, model: ThermalModel) -> list[str]:
    lines = [f"M_{index}, b_{index} = {_array(triad.matrix)}, {_array(triad.bias)}"]
    for mark, values in (
        ("M", model.coefficients.get(f"{name}.matrix")),
        ("b", model.coefficients.get(f"{name}.bias")),
    ):
        if values is not None:
            lines.append(f"{mark}_{index}_T = {_array(values)}")
    for mark, values in (
        ("rate", model.rate_coefficients.get(f"{name}.bias")),
        ("s", model.hysteresis.get(f"{name}.bias")),
    ):
        if values is not None:
            lines.append(f"b_{index}_{mark} = {_array(values)}")
    return lines


def _body(index: str, true: str, raw: str, name: str, model: ThermalModel, *, coupled: bool) -> list[str]:
    bias = f"b_{index}"
    if f"{name}.bias" in model.coefficients:
        bias += f" + x @ b_{index}_T"
    if f"{name}.bias" in model.rate_coefficients:
        bias += f" + rate[:, None] * b_{index}_rate"
    if f"{name}.bias" in model.hysteresis:
        bias += f" + s[:, None] * b_{index}_s"
    lines = [f"    u = {raw} - ({bias})"]
    if coupled:
        changing = "g_sensitivity" in model.coefficients
        sensitivity = 'G + np.einsum("nk,kij->nij", x, G_T)' if changing else "G"
        lines.append(f"    u = u - (({sensitivity}) @ f[:, :, None])[:, :, 0]")
    matrix = f"M_{index}"
    if f"{name}.matrix" in model.coefficients:
        matrix += f' + np.einsum("nk,kij->nij", x, M_{index}_T)'
    return [*lines, f"    {true} = np.linalg.solve({matrix}, u[:, :, None])[:, :, 0]"]


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
    if calibration.thermal is not None:
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
    return f"np.array({_literal(np.asarray(values, dtype=float).tolist())})"


def _inverse(matrix: Any) -> str:
    return f"np.linalg.inv({_literal(matrix)})"


def _literal(values: Any) -> str:
    if isinstance(values, float):
        return repr(values + 0.0)
    return "[" + ", ".join(_literal(value) for value in values) + "]"
