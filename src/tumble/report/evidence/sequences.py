"""What the rotation sequences left, and what each play-back changed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.report.page import Block, Sentences, Table, section
from tumble.report.rounding import with_uncertainty

if TYPE_CHECKING:
    from tumble.calibration.evidence import Sequences
    from tumble.report.subject import Subject

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
_LEFT = (
    "What the last play-back left of each sequence's measurements: the change of the horizontal acceleration from its "
    "start to its end, and what gravity was short of. ± is one standard deviation by the noise."
)
_CHANGED = (
    "What each play-back changed, rms over a group. The first is from rough values, which the nominal attitudes and "
    "angles give; the last changes nothing any more."
)


def sequences(told: Sequences, subject: Subject) -> list[Block]:
    """Return sequences and play-backs as tables; nothing without sequences.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    if not told.fits:
        return []
    left = [
        [
            fit.name,
            ", ".join(
                f"{round(float(np.degrees(angle))):+d}° {'xyz'[axis]}" for axis, angle in fit.rotations
            ),
            f"{fit.seconds:.1f} s",
            *(
                with_uncertainty(1e6 * value, 1e6 * sigma)
                for value, sigma in zip(fit.residuals, fit.sigmas, strict=True)
            ),
        ]
        for fit in told.fits
    ]
    changed = [
        [words, *(f"{two_digits(factor * change[name])} {unit}" for change in told.passes)]
        for name, (words, factor, unit) in _GROUPS.items()
    ]
    heads = ("sequence", "rotations", "took", *(f"{c} / (µm/s²)" for c in _COMPONENTS))
    return section(
        "Rotation sequences",
        Sentences([_LEFT], "paragraphs"),
        Table(heads, left),
        Sentences([_CHANGED], "paragraphs"),
        Table(("play-back", *(str(k + 1) for k in range(len(told.passes)))), changed),
    )
