"""The cart of the field campaign navigated with any calibration: the filter of 27 states, and its outages.

Satellite positions come ten times a second, differential and with the ambiguities of the phases fixed, and the
unit's samples are increments over a 25th of a second, which lose nothing on a cart. The filter starts at rest from
an attitude that is known to a milliradian and half a degree of heading, the same for all calibrations, and fixes it
in the minute before the cart is pulled. Outages begin when it is: an outage's error is against the position that
the receiver had at its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import Matrix, Series, Vector, Vectors
from tumble.earth import curvature_radii
from tumble.errors import ConvergenceError
from tumble.navigation import (
    Alignment,
    Drive,
    FilterSetup,
    InertialSamples,
    NavigationState,
    TimeAlignment,
    TriadSpread,
    outages,
    plan_filter,
)
from tumble.navigation.gnss.track import GnssTrack, make_track
from tumble.noise.terms import NoiseModel
from tumble.sensor import ImuModel, Triad
from tumble.simulation.field_campaign import CART, REST, cart_trajectory
from tumble.simulation.grades import Grade, TriadGrade
from tumble.simulation.noise import simulate_noise
from tumble.simulation.trajectories import SplineTrajectory, TravelledStates
from tumble_papers.hayal.field_calibration import FieldUnit, TriadResult, sheet_sigmas

RATE, FIXES = 25.0, 10.0  # Hz
FIX_SIGMAS = np.array([0.01, 0.01, 0.02])  # m, north, east, down
START_SIGMAS = np.array([1e-3, 1e-3, np.radians(0.5)])  # rad
CARRIED = 900.0  # s from the last pose to the cart
EVERY = 10.0  # s between outages of which each is by itself
# Bias, scale factors, then yx, zx, zy of a lower triangle: the angles yz, zy and zx of the thesis.
_ORDER = (0, 1, 2, 3, 4, 5, 6, 8, 7)


@dataclass(frozen=True, slots=True)
class CartDrive:
    """A recorded drive of the cart.

    Attributes
    ----------
    samples : raw.
    track : of the receiver.
    start : what the filter is told of it.
    grade : the unit's data sheet.
    """

    samples: InertialSamples
    track: GnssTrack
    start: NavigationState
    grade: Grade


@dataclass(frozen=True, slots=True)
class Calibrated:
    """What a filter is told of the sensors: the thesis' initial states and their standard deviations.

    Attributes
    ----------
    model : with which the samples are corrected; what is left has zero for its initial states.
    sigmas : (18,) of the accelerometers' nine and the gyros' nine.
    """

    model: ImuModel
    sigmas: Series


def calibrated(
    grade: Grade, force: TriadResult | None, rate: TriadResult | None, *, scaled: bool = True
) -> Calibrated:
    """Return what the filter is told: of a calibration where there is one, of the data sheet else.

    Parameters
    ----------
    grade : the data sheet.
    force, rate : of either triad; what they did not estimate is nominal with the sheet's sigma.
    scaled : take the sigmas that are scaled by sigma0, as the thesis does.
    """
    triads: list[Triad] = []
    sigmas: list[Series] = []
    for found, spread in ((force, grade.accelerometer), (rate, grade.gyroscope)):
        own = sheet_sigmas(spread)
        if found is None:
            triads.append(Triad(np.eye(3), np.zeros(3)))
            sigmas.append(own)
            continue
        told = found.sigmas if scaled else found.plain_sigmas
        triads.append(found.triad)
        sigmas.append(np.where(told > 0.0, told, own))
    return Calibrated(ImuModel(triads[0], triads[1]), np.concatenate(sigmas))


def record_cart(unit: FieldUnit, wander: Vectors, rng: np.random.Generator) -> CartDrive:
    """Record the cart.

    Parameters
    ----------
    unit : on the cart.
    wander : (2, 3) how far its biases had wandered in the last pose.
    rng : source of the path's unevenness and of all noise.
    """
    trajectory = cart_trajectory(rng)
    edges = np.arange(round((REST + CART) * RATE) + 1) / RATE
    angle, velocity = trajectory.increments(edges, 2)
    force, rate = unit.model.distort(RATE * velocity, RATE * angle)
    spreads = (unit.grade.accelerometer, unit.grade.gyroscope)
    raw: list[Vectors] = []
    for k, (signal, spread) in enumerate(zip((force, rate), spreads, strict=True)):
        carried = spread.noise.rate_random_walk * np.sqrt(CARRIED) * rng.standard_normal(3)
        noise = simulate_noise(spread.noise, len(signal), RATE, rng)
        raw.append(np.vstack([np.zeros((1, 3)), signal + noise + wander[k] + carried]))
    samples = InertialSamples(edges, raw[0], raw[1], means=True)
    track = _fixes(trajectory, rng)
    return CartDrive(samples, track, _start(trajectory, rng), unit.grade)


def _fixes(trajectory: SplineTrajectory, rng: np.random.Generator) -> GnssTrack:
    time = np.arange(1, round((REST + CART) * FIXES)) / FIXES
    true = trajectory.states(time)
    north, east, down = (FIX_SIGMAS * rng.standard_normal((len(time), 3))).T
    meridian, across = curvature_radii(true.latitude)
    longitude = true.longitude + east / ((across + true.height) * np.cos(true.latitude))
    position = (true.latitude + north / (meridian + true.height), longitude, true.height - down)
    return make_track(time, position, np.tile(FIX_SIGMAS, (len(time), 1)), name="cart")


def _start(trajectory: SplineTrajectory, rng: np.random.Generator) -> NavigationState:
    true: TravelledStates = trajectory.states(np.zeros(1))
    off = Rotation.from_rotvec(-START_SIGMAS * rng.standard_normal(3))
    C_nb: Matrix = (off * Rotation.from_quat(true.quaternion_nb[0])).as_matrix()
    at = (float(true.latitude[0]), float(true.longitude[0]), float(true.height[0]))
    return NavigationState(0.0, *at, np.zeros(3), C_nb)


def filter_setup(grade: Grade, sigmas: Series) -> FilterSetup:
    """Return the filter of 27 states: nine of navigation, bias, scale factor and non-orthogonality of each axis.

    Parameters
    ----------
    grade : whose random walks it is told; that of the biases is zero unless they wander.
    sigmas : (18,) of the sensor states at the start.
    """
    triads = (grade.accelerometer, grade.gyroscope)
    setup = plan_filter(
        *(
            NoiseModel(random_walk=t.noise.random_walk, rate_random_walk=t.noise.rate_random_walk)
            for t in triads
        ),
        accelerometer=_states(grade.accelerometer),
        gyroscope=_states(grade.gyroscope),
    )
    ordered = np.concatenate([sigmas[:9][list(_ORDER)], sigmas[9:][list(_ORDER)]])
    # There are no outliers among the fixes, and a filter that is off shall show it.
    return replace(setup.with_sensor_covariance(np.diag(ordered**2)), gate=0.0)


def _states(spread: TriadGrade) -> TriadSpread:
    bias, scale, angle = sheet_sigmas(spread)[::3]
    return TriadSpread(bias=bias, scale_factor=scale, non_orthogonality=angle)


def outage_errors(
    drive: CartDrive, told: Calibrated, durations: Sequence[float], *, gaps: bool
) -> list[Vectors] | None:
    """Return (outages, 3) m, north, east, down, of each length; None where the filter is lost for good.

    Parameters
    ----------
    drive : of the cart.
    told : what the filter is told of the sensors.
    durations : s without a fix.
    gaps : again and again with one fix between; else each by itself, every ten seconds.
    """
    raw = drive.samples
    force, rate = told.model.correct(raw.specific_force_b, raw.angular_rate_ib_b)
    samples = replace(raw, specific_force_b=force, angular_rate_ib_b=rate)
    alignment = Alignment(drive.start.C_nb, np.diag(START_SIGMAS**2), "a start that was given")
    ready = Drive(samples, drive.track, drive.start, alignment, _SAME_CLOCK)
    setup = filter_setup(drive.grade, told.sigmas)
    try:
        found = outages(
            ready, setup, durations, interval=1.0 / FIXES, every=EVERY, settle=REST, repeated=gaps
        )
    except ConvergenceError:
        return None
    return [errors.errors_n for errors in found]


_SAME_CLOCK = TimeAlignment(0.0, 0.0, 1.0, 0.0, REST + CART, "; one clock")


def position_sigma(errors_n: Vectors) -> float:
    """Return the thesis' standard deviation of a position error (5.3), m.

    Parameters
    ----------
    errors_n : (outages, 3) m.
    """
    return float(np.sqrt(np.sum(np.var(errors_n, axis=0))))


def mean_error(errors_n: Vectors) -> float:
    """Return the length of the mean position error, m.

    Parameters
    ----------
    errors_n : (outages, 3) m.
    """
    mean: Vector = np.mean(errors_n, axis=0)
    return float(np.linalg.norm(mean))
