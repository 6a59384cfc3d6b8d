"""A few lines of Python that apply a calibration whose parameters change with temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from tumble.document.result import Calibration
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
    if any(_is_bent(t) for t in (model.reference.accelerometer, model.reference.gyroscope)):
        lines.insert(
            1, "# Asymmetry and quadratic terms are left out here; tumble apply takes them into account."
        )
    lines.append(f"def correct({', '.join(f'raw_{name}' for name in names)}, T, rate=0.0, s=0.0):")
    lines.append("    rate, s = np.broadcast_to(rate, np.shape(T)), np.broadcast_to(s, np.shape(T))")
    results = ", ".join({"force": "f", "rate": "w"}[name] for name in names)
    return "\n".join([*lines, *body, f"    return {results}"]) + "\n"


def _is_bent(triad: Triad | None) -> bool:
    return triad is not None and (triad.asymmetry is not None or triad.quadratic is not None)


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


def _array(values: Any) -> str:
    return f"np.array({np.asarray(values, dtype=float).tolist()!r})"
