"""Where the joint estimator starts when no other procedure has made an estimate, and triads that are missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix, Series, inverted
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.triad_unknowns import COUNT, triad_from_unknowns
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.calibration.joint.terms import Extra
from tumble.calibration.joint.unknowns import GYRO_BIAS, GYRO_MATRIX, SHARED, gyro_matrix
from tumble.calibration.start_values import rough_gyro_matrix, rough_triad
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans, Timeline
from tumble.units import angular_rate_factor, specific_force_factor

# A rough matrix whose entries are less certain than this share is no better than the unit's own name plate.
ROUGH_ENOUGH = 0.03
# Of a nominal scale, how far rough accelerometer values may be off before they are not believed.
PLAUSIBLE = 0.3
# By which a bias may wander, a turn err and a pose sway, as long as nobody knows better.
START_FORCE, START_TURN, START_SWAY = 5e-3, 1e-3, 1e-4  # m/s², rad, rad


def rough_variances(base: HoldsAndTurns, unknowns: Series, *, has_gyro: bool) -> Extra:
    """Return variances to start from where little is told: what residuals do not ask for goes away again.

    Without them a bias that wanders from hold to hold would first be taken for an error of what nothing else tells.

    Parameters
    ----------
    base, unknowns, has_gyro : what was observed, and where the adjustment starts.
    """
    rate = 0.0
    if has_gyro:
        seen = base.rate_mean @ inverted(gyro_matrix(unknowns)).T
        rate = float(np.mean(np.median(np.abs(seen - np.median(seen, axis=0)), axis=0) / 0.6745)) ** 2
    return Extra(force=START_FORCE**2, rate=rate, turn=START_TURN**2, sway=START_SWAY**2)


def rough_start(recording: Recording, timeline: Timeline, means: HoldMeans, site: Site) -> Series:
    """Return (33,) rough values of both triads, of counts or SI alike.

    Accelerometers from the norms of the holds, the gyros' matrix from how turns turn gravity, or nominal where
    they tell too little.

    Parameters
    ----------
    recording, timeline, means, site : as for `calibrate_joint`.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer, or a gyro in counts that no turn tells the scale of.
    """
    if recording.specific_force is None or means.specific_force is None:
        raise ObservabilityError(
            "The recording has no accelerometer, and the joint estimator knows poses and turns from gravity: "
            "record the accelerometers too, or spin the unit on a table and take --procedure rate-table."
        )
    values = np.zeros(SHARED)
    values[:COUNT] = rough_triad(means.specific_force, site.gravity)
    factor = specific_force_factor(recording.specific_force_unit)
    scale = values[3:6]
    if factor is not None and np.any(np.abs(scale * factor - 1.0) > PLAUSIBLE):
        values[:COUNT] = 0.0
        values[3:6] = 1.0 / factor
    values[GYRO_MATRIX] = np.eye(3).ravel()
    if recording.angular_rate is not None and means.angular_rate is not None:
        values[GYRO_BIAS] = np.median(means.angular_rate, axis=0)
        values[GYRO_MATRIX] = _gyro_matrix(recording, timeline, values).ravel()
    return values


def _gyro_matrix(recording: Recording, timeline: Timeline, values: Series) -> Matrix:
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    factor = angular_rate_factor(recording.angular_rate_unit)
    force = triad_from_unknowns(values[:COUNT]).correct(recording.specific_force)
    stretches = [
        (timeline.holds[t.before].stop - 1, timeline.holds[t.after].start + 1)
        for t in timeline.turns
        if t.usable
    ]
    try:
        forward, covariance = rough_gyro_matrix(
            recording.time, recording.angular_rate, force, values[GYRO_BIAS], stretches
        )
    except ValueError as error:
        if factor is None:
            raise ObservabilityError(
                f"The gyros count in unknown units, and the turns do not tell their scale: {error}. Turn the unit "
                "about each of its axes while that axis lies level, or say the unit with --units."
            ) from error
        return np.eye(3) / factor
    size = float(np.linalg.norm(forward)) / np.sqrt(3.0)
    certain = float(np.sqrt(np.max(np.diag(covariance)))) < ROUGH_ENOUGH * size
    if factor is not None and not certain:
        return np.eye(3) / factor
    return inverted(forward)


def gather_what_there_is(
    recording: Recording, timeline: Timeline, means: HoldMeans
) -> tuple[HoldsAndTurns, bool]:
    """Return holds and turns, and whether there is a gyro; without one the rates are zeros that nobody asks.

    Parameters
    ----------
    recording, timeline, means : as for `calibrate_joint`.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer.
    """
    if recording.angular_rate is not None and means.angular_rate is not None:
        return gather(recording, timeline, means), True
    if recording.specific_force is None:
        raise ObservabilityError("The recording has no accelerometer: nothing tells its poses.")
    still = np.zeros_like(recording.specific_force)
    holds = means.count.size
    floor = replace(timeline.noise_floor, angular_rate=np.full(3, 1e-9))
    base = gather(
        replace(recording, angular_rate=still),
        replace(timeline, noise_floor=floor),
        replace(
            means,
            angular_rate=np.zeros((holds, 3)),
            angular_rate_covariance=np.broadcast_to(1e-12 * np.eye(3), (holds, 3, 3)).copy(),
        ),
    )
    base.turn_start[:] = -1
    base.turn_stop[:] = -1
    return base, False
