"""What a thermal test cannot show, as a part of its uncertainties: hysteresis, what the rate does, g-sensitivity.

Where temperatures were come to from one side only, a loop of the biases looks like a function of temperature, and so
does what the rate of temperature does while the unit settles. Neither can be estimated; both are believed to be within
what such units show, in kelvins (or seconds) of the change with temperature that this unit shows itself. The estimate
stays what it is, and its covariance grows by what it would be wrong by (consider covariance, Schmidt 1966). In too few
poses a g-sensitivity of the gyros looks like a bias; it goes the same way.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.calibration.thermal.conditions import ThermalConditions
from tumble.calibration.thermal.fit import ThermalFit
from tumble.calibration.thermal.wander import WanderingConditions
from tumble.records import dataclass

# One sigma of half a loop: as much as this many kelvins change the bias. The simulator's grades assume half of it.
LOOP_KELVINS = 2.0
# The state before the first sample is anywhere from -1 to 1.
START_STATE = 1.0 / np.sqrt(3.0)
# One sigma of what the rate does, in seconds of the change with temperature: lag beside 30 s, and the rate itself.
RATE_SECONDS = 85.0
# One sigma of a g-sensitivity in 1 g, in what the bias is unsteady by; the simulator's grades have 3 to 20.
PULL_FACTOR = 25.0


@dataclass(frozen=True, slots=True)
class Doubts:
    """What is in the uncertainties because the recording cannot show it.

    Attributes
    ----------
    loops : (m/s², rad/s), one sigma of half a loop; None where both branches were seen.
    rate : whether lag and dependence on the rate are, too.
    pull : rad/s, one sigma of what a g-sensitivity does in 1 g; zero where poses tell it.
    earth : rad/s, one sigma of the Earth rate's part across the vertical in one pose; zero where unknown.
    """

    loops: tuple[float, float] | None = None
    rate: bool = False
    pull: float = 0.0
    earth: float = 0.0


def changes_per_kelvin(fit: ThermalFit) -> tuple[float, float]:
    """Return the root mean square over axes and rests of the biases' slopes, (m/s²)/K and (rad/s)/K."""
    slopes = fit.terms.basis.derivatives(fit.conditions.points.celsius)
    found = [0.0, 0.0]
    for k, name in enumerate(("b", "gb")):
        if fit.layout.has(name):
            found[k] = float(np.sqrt(np.mean((slopes @ fit.values[fit.layout[name]].reshape(-1, 3)) ** 2)))
    return found[0], found[1]


def with_hysteresis_doubt(fit: ThermalFit) -> tuple[ThermalFit, tuple[float, float]]:
    """Return a fit without hysteresis whose covariance has in it what one could have done.

    Parameters
    ----------
    fit : of temperatures that were come to from one side.

    Returns
    -------
    fit : with a larger covariance.
    loops : m/s² and rad/s, one sigma of half a loop as it was believed.
    """
    first, second = changes_per_kelvin(fit)
    loops, old = (LOOP_KELVINS * first, LOOP_KELVINS * second), fit.conditions
    lag, width = old.lag_and_width(fit.values)
    more = ThermalConditions(replace(old.test, lag=lag, width=width), replace(fit.terms, hysteresis=True))
    values, more.active = np.zeros(more.layout.size), old.active
    for name in (block.name for block in fit.layout.blocks.blocks if block.labels):
        values[more.layout[name]] = fit.values[fit.layout[name]]
    gain = fit.adjustment.cofactor @ fit.adjustment.linearisation.design.reshape(-1, fit.layout.size).T
    covariance, state = fit.covariance.copy(), np.abs(old.functions(fit.values)[:, -1])
    for column, share in ((state, 1.0), (1.0 - state, START_STATE)):
        more.middle[:, -1] = column
        rows = WanderingConditions(more, fit.levels).linearise(values).design.reshape(-1, more.layout.size)
        for name, loop in zip(("h", "gh"), loops, strict=True):
            moved = share * loop * gain @ rows[:, more.layout[name]]
            covariance += moved @ moved.T
    return replace(fit, covariance=covariance), loops


def with_pull(fit: ThermalFit) -> tuple[ThermalFit, float]:
    """Return a fit with what a g-sensitivity that the poses do not tell is in the gyros' biases, and its sigma, rad/s.

    Parameters
    ----------
    fit : of any poses; of nine nothing is added.
    """
    points = fit.conditions.points
    if fit.terms.poses == 9 or points.rate_covariance is None or points.force is None:
        return fit, 0.0
    noise = float(np.mean(np.diagonal(points.rate_covariance, axis1=1, axis2=2)))
    sigma = PULL_FACTOR * float(np.sqrt(fit.levels.flicker["rate"] + fit.levels.single["rate"] + noise))
    covariance, at = fit.covariance.copy(), fit.layout["gb0"]
    covariance[at, at] += sigma**2 * np.eye(3)
    return replace(fit, covariance=covariance), sigma
