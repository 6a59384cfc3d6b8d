"""What a settled joint estimate finds in its own residuals that speaks against what it was told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.equations.rotation_equations import Links, RotationEquations
from tumble.calibration.equations.spin_readings import contradicting_rates

if TYPE_CHECKING:
    from tumble.calibration.outcome.estimate import JointOutcome

# Poses that scatter by less beyond their sigma are nobody's fault.
LEAST_OBJECTED = 1e-4  # rad
# An Earth rate that the gyros contradict by more standard uncertainties than this, and by more than this.
CONTRADICTION, SMALLEST_VERTICAL = 5.0, 5e-7  # rad/s


def contradictions(outcome: JointOutcome) -> list[str]:
    """Return sentences on what was recorded that contradicts the protocol or the site.

    Parameters
    ----------
    outcome : the settled solution.
    """
    return [*_of_poses(outcome), *_of_earth(outcome), *_of_rates(outcome)]


def _of_poses(outcome: JointOutcome) -> list[str]:
    poses, added = outcome.data.poses, float(np.sqrt(outcome.task.noise["placement"]))
    if poses is None or added <= max(float(np.median(poses.sigma)), LEAST_OBJECTED):
        return []
    stated = float(np.median(poses.sigma))
    said = (
        f"The poses scatter by {np.degrees(added):.2g}° beyond the {np.degrees(stated):.2g}° that the protocol "
        "promises: give the sigma that the fixture keeps, or place the unit better."
    )
    return [said]


def _of_earth(outcome: JointOutcome) -> list[str]:
    """The vertical Earth rate that the gyros show at rest by themselves, against the latitude's."""
    tests = outcome.balanced.tests.get("earth")
    if tests is None or not np.any(tests.degrees > 0):
        return []
    worst = int(np.argmax(tests.statistic))
    certain = float(np.sqrt(tests.statistic[worst]))
    # By how much the gyros alone say otherwise; down is the third axis.
    upward = -float(np.sign(tests.residual[worst, 0]) * np.sqrt(tests.predicted[worst]))
    if certain < CONTRADICTION or abs(upward) < SMALLEST_VERTICAL:
        return []
    said = (
        f"The gyros show at rest {upward:+.2g} ± {abs(upward) / certain:.1g} rad/s more of the Earth "
        "rate upwards than the latitude gives. Either the site is another one (--site), and with it "
        "gravity, or biases follow the poses."
    )
    return [said]


def _of_rates(outcome: JointOutcome) -> list[str]:
    """Believed rates of a table, against what the corrected gyros show while it turns."""
    rates: list[float] = []
    errors: list[float] = []
    for found in outcome.balanced.solution.chains():
        kinds = {term.equations.kind: term.equations for term in found.chain.terms}
        links = kinds.get("links")
        if not isinstance(links, Links) or links.spin.turn_rate is None:
            continue
        shown = _mean_rate(links, outcome)
        rates.append(abs(links.spin.turn_rate))
        errors.append(shown - abs(links.spin.turn_rate))
    return contradicting_rates(np.array(rates), np.array(errors)) if rates else []


def _mean_rate(rotation: RotationEquations, outcome: JointOutcome) -> float:
    """What the corrected gyros show about a rotation's axis, rad/s, the Earth rate taken out."""
    moving = rotation.moving
    shown = rotation.rates(outcome.task.unknowns).mean(axis=0) @ moving.axis_b
    return float(shown - rotation.stretch.section.earth_w @ moving.axis_w)
