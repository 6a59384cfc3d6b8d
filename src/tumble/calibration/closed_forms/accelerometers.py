"""The accelerometers alone, on the norm of gravity in all holds: the first step of procedures with a table."""

from __future__ import annotations

import numpy as np

from tumble.arrays import inverted
from tumble.calibration.closed_forms.start_values import rough_triad
from tumble.calibration.equations.triad_unknowns import ANGLE
from tumble.calibration.poses import require_poses
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.procedures.multi_position import TriadFit, fit_norms
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.estimation import Prior
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans
from tumble.units import specific_force_factor


def fit_accelerometers(
    recording: Recording, means: HoldMeans, site: Site, prior: StableKnowledge | None = None
) -> TriadFit:
    """Adjust the accelerometers to the norm of gravity over all holds, gross errors left out.

    Parameters
    ----------
    recording : for its units.
    means : of the holds.
    site : gravity.
    prior : non-orthogonalities from an earlier calibration; six poses then suffice.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer, or the poses are too few or too alike; the message names the one missing.
    ConvergenceError
        If the adjustment fails.
    """
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError("The recording has no accelerometer: the norm of gravity needs one.")
    start = rough_triad(means.specific_force, site.gravity)
    if prior is not None:
        start[ANGLE] = prior.angles
    factor = specific_force_factor(recording.specific_force_unit)
    require_poses(means.specific_force, start, has_prior=prior is not None, factor=factor)
    return fit_norms(
        means.specific_force,
        means.specific_force_covariance,
        site.gravity,
        start,
        np.arange(9),
        prior=None if prior is None else _angle_prior(prior),
    )


def _angle_prior(prior: StableKnowledge) -> Prior:
    mean, precision = np.zeros(9), np.zeros((9, 9))
    mean[ANGLE], precision[ANGLE, ANGLE] = prior.angles, inverted(prior.angle_covariance)
    return Prior(mean, precision)
