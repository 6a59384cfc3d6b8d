"""From a paper's method to an estimate: the noise of what was observed, carried through the method, and no more."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from tumble.arrays import Matrices, Series, Square, Vectors
from tumble.calibration import (
    LAYOUT,
    TERMS,
    Estimate,
    Figures,
    Holds,
    Said,
    Session,
    describe,
    hold_norm_variances,
    unknowns_of,
)
from tumble.errors import ObservabilityError
from tumble.sensor import ImuModel

# Of a central difference, in standard deviations: a method is smooth over far more than that.
STEP = 0.1


def means_of_both(session: Session) -> tuple[Vectors, Matrices, Vectors, Matrices]:
    """Return the holds' means of specific force and angular rate, each with its covariances.

    Parameters
    ----------
    session : the recording.

    Raises
    ------
    ObservabilityError
        If a triad is missing.
    """
    means = session.means
    force, rate = means.specific_force, means.angular_rate
    of_force, of_rate = means.specific_force_covariance, means.angular_rate_covariance
    if force is None or rate is None or of_force is None or of_rate is None:
        raise ObservabilityError(
            "This estimator needs accelerometers and gyros, and the recording lacks one of them."
        )
    return force, of_force, rate, of_rate


def carried_estimate(
    name: str,
    session: Session,
    method: Callable[[Series], ImuModel],
    noise: Square,
    *,
    frame: str = "accelerometer-x",
    terms: Iterable[str] = (),
    said: Iterable[Said] = (),
) -> Estimate:
    """Return what a method makes of its observations, with their covariance carried through it.

    Parameters
    ----------
    name : of the estimator.
    session : what was recorded.
    method : the model of both triads, as a function of changes of the observations.
    noise : (n, n), covariance of these.
    frame, terms : of the result, as in `Estimate` and in `tumble.calibration.terms`.
    said : sentences.
    """
    sigma, unchanged = np.sqrt(np.diag(noise)), np.zeros(len(noise))
    slope = np.zeros((LAYOUT.size, len(noise)))
    for k in np.flatnonzero(sigma).tolist():
        change = unchanged.copy()
        change[k] = STEP * sigma[k]
        slope[:, k] = (_unknowns(method(change)) - _unknowns(method(-change))) / (2.0 * change[k])
    model = method(unchanged)
    described = describe(
        _unknowns(model), slope @ noise @ slope.T, session.site, session.recording,
        terms=frozenset(terms), gyro="full", frame=frame, all_told=True,
    )  # fmt: skip
    force, covariance, _, _ = means_of_both(session)
    assert model.accelerometer is not None
    length = np.linalg.norm(model.accelerometer.correct(force), axis=1)
    variances = hold_norm_variances(model.accelerometer, force, covariance)
    holds = Holds(length - session.site.gravity, np.sqrt(variances))
    # How well the norms of all holds fit; nine parameters could be fitted to them.
    left, degrees = holds.norms / holds.sigmas, max(len(force) - 9, 1)
    sigma0 = float(np.sqrt(left @ left / degrees))
    figures = Figures(sigma0, sigma0, degrees, 1.96, float(np.max(np.abs(left))), {})
    return Estimate(name, *described, *figures, said=[*said], evidence=[holds], frame=frame)


def _unknowns(model: ImuModel) -> Series:
    """All of `LAYOUT`, asymmetries too."""
    values = unknowns_of(model)
    for term in TERMS.values():
        triad = model.accelerometer if term.of == "accelerometer" else model.gyroscope
        if term.curve == "asymmetry" and triad is not None and triad.asymmetry is not None:
            values[LAYOUT[term.block.name]] = triad.asymmetry
    return values
