"""What the rotation sequences left, and what each play-back changed."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.report.rounding import with_uncertainty

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate

_COMPONENTS = ("across, first", "across, second", "down at the start", "down at the end")
_GROUPS = {
    "kappa_lin": ("gyro scale factors", 1e6, "ppm"),
    "kappa_asym": ("gyro asymmetry", 1e6, "ppm"),
    "upsilon": ("gyro non-orthogonality", 1e6, "µrad"),
    "lambda_bias": ("accelerometer biases", 1e6, "µm/s²"),
    "lambda_lin": ("accelerometer scale factors", 1e6, "ppm"),
    "lambda_asym": ("accelerometer asymmetry", 1e6, "ppm"),
    "mu": ("accelerometer misalignments", 1e6, "µrad"),
}


def sequence_tables(estimate: Estimate) -> str:
    """Return sequences and play-backs as HTML tables; nothing without sequences.

    Parameters
    ----------
    estimate : with what the sequences showed.
    """
    if not estimate.sequences:
        return ""
    head = "".join(
        f"<th>{name}</th>"
        for name in ("sequence", "rotations", "took", *(f"{c} / (µm/s²)" for c in _COMPONENTS))
    )
    rows = "".join(
        f"<tr><td>{html.escape(fit.name)}</td><td>{_rotations(fit.rotations)}</td><td>{fit.seconds:.1f} s</td>"
        + "".join(
            f"<td>{with_uncertainty(1e6 * value, 1e6 * sigma)}</td>"
            for value, sigma in zip(fit.residuals, fit.sigmas, strict=True)
        )
        + "</tr>"
        for fit in estimate.sequences
    )
    return (
        "<h2>Rotation sequences</h2>\n<p>What the last play-back left of each sequence's measurements: the change of "
        "the horizontal acceleration from its start to its end, and what gravity was short of. ± is one standard "
        "deviation by the noise.</p>"
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
        + _passes(estimate)
    )


def _rotations(rotations: tuple[tuple[int, float], ...]) -> str:
    words = [f"{round(float(np.degrees(angle))):+d}° {'xyz'[axis]}" for axis, angle in rotations]
    return ", ".join(words).replace("-", "−")


def _passes(estimate: Estimate) -> str:
    head = "".join(f"<th>{k}</th>" for k in range(1, len(estimate.passes) + 1))
    rows = "".join(
        f"<tr><td>{words}</td>"
        + "".join(f"<td>{two_digits(factor * change[name])} {unit}</td>" for change in estimate.passes)
        + "</tr>"
        for name, (words, factor, unit) in _GROUPS.items()
    )
    return (
        "<p>What each play-back changed, rms over a group. The first is from rough values, which the nominal attitudes "
        "and angles give; the last changes nothing any more.</p>"
        f'<div class="scroll"><table><thead><tr><th>play-back</th>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )
