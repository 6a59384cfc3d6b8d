"""What each spin of a table shows beyond the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.report.figures.record import AXIS_COLOURS, Axis, Figure, Points, plain
from tumble.report.page import Block, Figures, section

if TYPE_CHECKING:
    from tumble.calibration.evidence import Spins
    from tumble.report.subject import Subject


def spins(told: Spins, subject: Subject) -> list[Block]:
    """Return the figure of each spin's residual against its rate; nothing without spins.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    if told.rates.size == 0:
        return []
    rates = plain(np.degrees(told.rates), 7)
    residuals, sigmas = (1e3 * np.degrees(a) for a in (told.residuals, told.sigmas))
    marks = [
        Points(
            rates,
            residuals[:, axis],
            f"gyro {name}",
            AXIS_COLOURS[name],
            sigma=sigmas[:, axis],
            words=told.names,
            size=8,
            hover="%{text}: %{y:.3g} m°/s<extra></extra>",
        )
        for axis, name in enumerate("xyz")
        if np.any(np.isfinite(residuals[:, axis]))
    ]
    finite = told.residuals[np.isfinite(told.residuals)]
    rms = float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0
    largest = float(np.max(np.abs(told.rates)))
    across, upright = Axis("reference rate of the spin / (°/s)"), Axis("residual / (m°/s)")
    caption = (
        f"After calibration the spins leave {two_digits(1e3 * np.degrees(rms))} m°/s rms over all "
        f"three gyros, {two_digits(1e6 * rms / largest)} ppm of the fastest spin. The gyros that are "
        "not spun show a placement that is off. Points that follow a curve would be a nonlinear "
        "scale factor, a kink at zero an asymmetry. Bars are one standard deviation."
    )
    label = "Residual of each gyro in each spin against the reference rate"
    figure = Figure("spins", label, marks, across, upright, 360)
    return section("Spins: residual against the rate", Figures([figure], caption))
