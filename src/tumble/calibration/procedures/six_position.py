"""The six-position test, standard and improved (Aggarwal et al. 2008; Hayal 2010, 2.3 to 2.12).

Each axis of the unit points up once and down once on a level table. The standard test takes bias and
scale factor of each sensor from its own two readings,

    b = (Y_up + Y_down) / 2,   1 + S = (Y_up - Y_down) / (2 K)                            (2.5, 2.6)

with K gravity for the accelerometers and the vertical Earth rate for the gyros. The improved test uses
what the sensors across show too and estimates the whole matrix (2.7 to 2.12), with weights (`placement`).

Both trust the poses. The result is in the frame ``fixture``, whose axes the protocol's poses are given
in; how well the unit was placed is in the uncertainties, as the protocol states it and, where the six
poses contradict one another by more, as they show it.

Gyros see the Earth rate or they do not. If a scale factor from it is no better than `WORST_SCALE`,
the nominal one stays and the bias alone is estimated.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Square, Vector, Vectors
from tumble.calibration.canonical import (
    FIXTURE_UNKNOWNS,
    DescribedTriad,
    describe_apart,
    describe_bias,
    describe_fixture_triad,
)
from tumble.calibration.checks.hold_wander import (
    HoldWander,
    wander_of_force,
    wander_of_placed,
    wander_of_rate,
)
from tumble.calibration.checks.placement import beyond_statement, moved_while_held, poses_apart
from tumble.calibration.checks.scores import holds_evidence
from tumble.calibration.equations.placement import PlacedFit, PlacedReadings, fit_placed, up_down_pair
from tumble.calibration.estimate import (
    Estimate,
    Figures,
    Said,
    estimate_of,
    said_of,
)
from tumble.calibration.poses import match_faces
from tumble.calibration.procedure import Procedure
from tumble.calibration.session import Session
from tumble.calibration.verdict import two_digits
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.segmentation.matching import Matching
from tumble.units import angular_rate_factor, specific_force_factor

# A gyro's scale factor or angle from the Earth rate that is worse than this is left at its nominal value:
# a data sheet's is better.
WORST_SCALE = 0.02
# No gyro's scale factor is off by more: then it is not the Earth's rotation that the poses show.
LARGEST_SCALE_ERROR = 0.2
FACES = tuple(f"{axis} {way}" for axis in "xyz" for way in ("up", "down"))
# A pose within half a degree of a face is one by intention.
_FACE_COSINE = np.cos(np.radians(0.5))
# Chance of finding more scatter than the noise explains where there is none (decision 6).
_CHANCE = 0.025


@dataclass(frozen=True, slots=True)
class KnownPoses:
    """The holds of which the protocol knows the pose.

    Attributes
    ----------
    hold : (poses,) index of the hold.
    up_b : (poses, 3) unit vectors up, in the fixture's axes.
    rotations_bn : (poses, 3, 3) from north-east-down to b, nan where the heading is not known.
    sigma : (poses,) rad, of the placement.
    face : (poses,) index into `FACES`, -1 for a pose that is no face.
    """

    hold: np.ndarray
    up_b: Vectors
    rotations_bn: Matrices
    sigma: Series
    face: np.ndarray

    def __len__(self) -> int:
        return int(self.hold.size)


def known_poses(matching: Matching, protocol: Protocol) -> KnownPoses:
    """Return the matched holds whose nominal pose the protocol gives.

    Raises
    ------
    ObservabilityError
        If there is none.
    """
    poses: list[tuple[int, Pose]] = []
    for matched in matching.holds:
        step = protocol.steps[matched.step]
        if isinstance(step, HoldStep) and step.pose is not None:
            poses.append((matched.hold, step.pose))
    if not poses:
        raise ObservabilityError(
            f"The protocol {protocol.name} gives no pose for any of the holds found: the six-position test needs "
            "holds with a known axis up. Write the poses into the protocol, or use the multi-position procedure."
        )
    up_b = np.array([pose.up_b / np.linalg.norm(pose.up_b) for _, pose in poses])
    rotations = [pose.C_nb().T if pose.heading is not None else np.full((3, 3), np.nan) for _, pose in poses]
    axis = np.argmax(np.abs(up_b), axis=1)
    along = np.take_along_axis(up_b, axis[:, None], axis=1)[:, 0]
    face = np.where(np.abs(along) > _FACE_COSINE, 2 * axis + (along < 0), -1)
    return KnownPoses(
        hold=np.array([hold for hold, _ in poses]),
        up_b=up_b,
        rotations_bn=np.array(rotations),
        sigma=np.array([pose.sigma for _, pose in poses], dtype=float),
        face=face,
    )


def force_of_poses(means: HoldMeans, poses: KnownPoses, site: Site) -> tuple[PlacedFit, HoldWander]:
    """Return the accelerometers by gravity in the poses that a protocol names, and how their biases wander.

    Parameters
    ----------
    means : of all holds, with specific force.
    poses : which holds are in which pose.
    site : for gravity.

    Raises
    ------
    ObservabilityError
        If the axes read gravity as no placement lets them.
    ConvergenceError
        If the adjustment fails.
    """
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    wander = wander_of_force(means, poses.hold, poses.up_b, poses.sigma)
    force = fit_placed(
        PlacedReadings(
            means.specific_force[poses.hold],
            wander.of_each(means.specific_force_covariance[poses.hold], poses.hold),
            site.gravity * poses.up_b,
            poses.sigma,
        )
    )
    force = replace(force, covariance=wander_of_placed(wander, force, poses.hold, poses.rotations_bn))
    if np.linalg.det(force.matrix) <= 0:
        raise ObservabilityError(
            "In the poses that the protocol names the accelerometers read gravity with an odd number "
            "of axes reversed. No placement does that: check the order and the signs of the columns "
            "(--columns)."
        )
    return force, wander


def calibrate_six_position(
    recording: Recording,
    means: HoldMeans,
    matching: Matching,
    protocol: Protocol,
    site: Site,
    *,
    improved: bool = False,
) -> Estimate:
    """Calibrate the accelerometers on gravity and the gyros, as far as they see it, on the Earth rate.

    Parameters
    ----------
    recording : for its units.
    means : the holds' means and covariances.
    matching, protocol : which hold has which nominal pose, and how exactly the unit was placed in it.
        All holds with a known pose are used: of the standard test those with an axis up or down.
    site : gravity; with a latitude, the gyros are calibrated on the Earth rate if they see it.
    improved : estimate the whole matrices instead of their diagonals.

    Returns
    -------
    estimate : in the frame ``fixture``. Variances are second moments about the truth: those of the noise
        and of the placement, of second order along gravity, its mean (a cosine is never above one) included.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer, or a face is missing; the message names it.
    ConvergenceError
        If the adjustment fails.
    """
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError("The recording has no accelerometer: the six-position test needs one.")
    poses = known_poses(matching, protocol)
    _require_faces(poses)
    force, wander = force_of_poses(means, poses, site)
    sigma = force.readings.sigma
    told = _accelerometer(recording, means, poses, site, force, wander, improved=improved)
    gyro = _fit_gyro(recording, means, poses, sigma, site, improved=improved)
    return _estimate(recording, means, site, poses, force, told, gyro, improved=improved)


def _require_faces(poses: KnownPoses) -> None:
    missing = [name for index, name in enumerate(FACES) if index not in poses.face]
    if missing:
        names = " or with ".join(missing) if len(missing) < 3 else ", ".join(missing)
        them = "it" if len(missing) == 1 else "them"
        raise ObservabilityError(f"No hold with {names} was found: record {them}.")


@dataclass(frozen=True, slots=True)
class Pairs:
    """Bias and scale factor (raw per SI) of three sensors from their up and down readings.

    `covariance` is (6, 6): biases, then scale factors; second moments, mean shifts included. `response`
    (poses, 6, 3): what an error of each reading moves them by.
    """

    bias: Vector
    scale: Vector
    covariance: Square
    response: AnyArray


def _combine_pairs(
    observed: Vectors,
    variance: Vectors,
    poses: KnownPoses,
    sigma: Series,
    reference: float,
    across: float = 0.0,
    lean: Vector | None = None,
) -> Pairs:
    """Return the standard six-position solution, all holds of a face averaged by weight (2.5, 2.6).

    Notes
    -----
    A tilt theta shows K cos(theta): less than K by K sigma² on average, with a standard deviation of
    K sigma² too (two axes of tilt). A scale factor is thus off by -sigma² and sigma²/√2, a bias by
    K sigma²/√2, for one hold a face. The mean is not corrected for, since sigma is seldom known so
    well; it is part of the covariance, the same for all axes.
    """
    lean = np.zeros(3) if lean is None else lean
    bias, scale, covariance = np.zeros(3), np.zeros(3), np.zeros((6, 6))
    shift, response = np.zeros(6), np.zeros((len(poses), 6, 3))
    for axis in range(3):
        ways = [np.flatnonzero(poses.face == 2 * axis + down) for down in (0, 1)]
        high, low = (float(observed[at, axis].mean()) for at in ways)
        rough = up_down_pair(high, low, reference)[1]
        mean, spread, below = np.zeros(2), np.zeros(2), np.zeros(2)
        for way, at in enumerate(ways):
            tilted = (reference * sigma[at] ** 2) ** 2 + (
                np.hypot(across, reference * lean[axis]) * sigma[at]
            ) ** 2
            weight = 1.0 / (variance[at, axis] + rough**2 * tilted)
            mean[way] = np.average(observed[at, axis], weights=weight)
            spread[way] = 1.0 / np.sum(weight)
            below[way] = np.average(sigma[at] ** 2, weights=weight)
            response[at, axis, axis] = 0.5 * weight * spread[way]
            response[at, 3 + axis, axis] = (0.5, -0.5)[way] * weight * spread[way] / reference
        bias[axis], scale[axis] = up_down_pair(float(mean[0]), float(mean[1]), reference)
        covariance[axis, axis] = spread.sum() / 4.0
        covariance[3 + axis, 3 + axis] = spread.sum() / (4.0 * reference**2)
        covariance[axis, 3 + axis] = (spread[0] - spread[1]) / (4.0 * reference)
        covariance[3 + axis, axis] = covariance[axis, 3 + axis]
        shift[axis] = -0.5 * scale[axis] * reference * (below[0] - below[1])
        shift[3 + axis] = -0.5 * scale[axis] * (below[0] + below[1])
    return Pairs(bias, scale, covariance + np.outer(shift, shift), response)


def _diagonal_unknowns(pairs: Pairs) -> tuple[Series, Square]:
    """Return the pairs as the 18 unknowns of a triad in the fixture, with their covariance."""
    at = [9, 10, 11, 0, 4, 8]
    unknowns, covariance = np.zeros(FIXTURE_UNKNOWNS), np.zeros((FIXTURE_UNKNOWNS, FIXTURE_UNKNOWNS))
    unknowns[at] = np.concatenate([pairs.bias, pairs.scale])
    covariance[np.ix_(at, at)] = pairs.covariance
    return unknowns, covariance


def _full_unknowns(fit: PlacedFit) -> tuple[Series, Square]:
    unknowns, covariance = np.zeros(FIXTURE_UNKNOWNS), np.zeros((FIXTURE_UNKNOWNS, FIXTURE_UNKNOWNS))
    unknowns[:9], unknowns[9:12] = fit.matrix.ravel(), fit.bias
    covariance[:12, :12] = fit.covariance
    return unknowns, covariance


def _accelerometer(
    recording: Recording,
    means: HoldMeans,
    poses: KnownPoses,
    site: Site,
    force: PlacedFit,
    wander: HoldWander,
    *,
    improved: bool,
) -> DescribedTriad:
    if improved:
        unknowns, covariance = _full_unknowns(force)
    else:
        assert means.specific_force is not None
        noise = force.readings.covariance
        variance = np.diagonal(noise, axis1=1, axis2=2)
        pairs = _combine_pairs(
            means.specific_force[poses.hold],
            variance,
            poses,
            force.readings.sigma,
            site.gravity,
            lean=_lean(force),
        )
        pairs = replace(pairs, covariance=wander.over(pairs.covariance, pairs.response, noise, poses.hold))
        unknowns, covariance = _diagonal_unknowns(pairs)
    # A gravity that is too large makes the whole matrix too small by the same share.
    slope = np.zeros(FIXTURE_UNKNOWNS)
    slope[:9] = -unknowns[:9] / site.gravity
    return describe_fixture_triad(
        "accelerometer",
        unknowns,
        covariance + np.outer(slope, slope) * site.gravity_sigma**2,
        known=_known_elements(improved),
        unit=recording.specific_force_unit,
        factor=specific_force_factor(recording.specific_force_unit),
    )


def _lean(force: PlacedFit) -> Vector:
    """Return how far each sensing axis leans from the fixture's, without what the placement makes of it."""
    variance = np.diag(force.covariance)[:9].reshape(3, 3)
    off = ~np.eye(3, dtype=bool)
    squared = np.sum(force.matrix**2 * off, axis=1) - np.sum(variance * off, axis=1)
    return np.sqrt(np.maximum(squared, 0.0)) / np.linalg.norm(force.matrix, axis=1)


def _known_elements(whole: bool) -> np.ndarray:
    return np.ones((3, 3), dtype=bool) if whole else np.eye(3, dtype=bool)


@dataclass(frozen=True, slots=True)
class _Gyro:
    """What the poses tell of the gyros, with words."""

    told: DescribedTriad
    remark: str
    not_determined: str


def _fit_gyro(
    recording: Recording, means: HoldMeans, poses: KnownPoses, sigma: Series, site: Site, *, improved: bool
) -> _Gyro | None:
    """Take the largest solution on the Earth rate that noise, latitude and headings allow."""
    if means.angular_rate is None or means.angular_rate_covariance is None:
        return None
    observed, covariance = means.angular_rate[poses.hold], means.angular_rate_covariance[poses.hold]
    wander = _rate_wander(recording, means, poses, site)
    covariance = wander.of_each(covariance, poses.hold)
    unit, factor = recording.angular_rate_unit, angular_rate_factor(recording.angular_rate_unit)
    headings = bool(np.all(np.isfinite(poses.rotations_bn)))
    seen = ""
    if site.latitude is not None and improved and headings:
        earth_b = poses.rotations_bn @ site.earth_rate_n
        fit = fit_placed(PlacedReadings(observed, covariance, earth_b, sigma))
        fit = replace(fit, covariance=wander_of_placed(wander, fit, poses.hold, poses.rotations_bn))
        length = np.linalg.norm(fit.matrix, axis=1)
        worst = float(np.max(np.sqrt(np.diag(fit.covariance)[:9]) / np.repeat(length, 3)))
        if worst < WORST_SCALE and _is_earth(length, factor):
            unknowns, spread = _full_unknowns(fit)
            told = describe_fixture_triad(
                "gyroscope", unknowns, spread, known=_known_elements(True), unit=unit, factor=factor
            )
            remark = (
                "The gyro sees the Earth's rotation well enough for its whole matrix, headings being known."
            )
            return _Gyro(told, remark, "")
    if site.latitude is not None and abs(np.sin(site.latitude)) > 0.02:
        vertical, horizontal = EARTH_RATE * np.sin(site.latitude), EARTH_RATE * np.cos(site.latitude)
        noise = np.diagonal(covariance, axis1=1, axis2=2)
        pairs = _combine_pairs(observed, noise, poses, sigma, float(vertical), float(horizontal))
        pairs = replace(
            pairs, covariance=wander.over(pairs.covariance, pairs.response, covariance, poses.hold)
        )
        share = np.sqrt(np.diag(pairs.covariance)[3:]) / np.maximum(np.abs(pairs.scale), 1e-300)
        if float(np.max(share)) < WORST_SCALE and _is_earth(pairs.scale, factor):
            return _gyro_from_pairs(pairs, unit, factor, improved=improved)
        if float(np.max(share)) < WORST_SCALE:
            seen = (
                " What differs between up and down is not the Earth's rotation, but a g-sensitivity of the gyros: as "
                "scale factors it would be beyond belief."
            )
        elif float(np.max(share)) < 0.5:
            shown = ", ".join(
                f"{s * (factor or 1.0):.4g} ± {100 * p:.2g} %"
                for s, p in zip(pairs.scale, share, strict=True)
            )
            seen = (
                f" From the Earth's rotation the gyros' scale factors would come out as {shown} (x, y, z): too "
                "uncertain to be used."
            )
    return _gyro_bias(recording, observed, covariance, poses, site, wander, seen)


def _rate_wander(recording: Recording, means: HoldMeans, poses: KnownPoses, site: Site) -> HoldWander:
    """How the gyros' biases wander; an Earth rate of unknown heading counts as noise of each hold."""
    factor = angular_rate_factor(recording.angular_rate_unit)
    level = np.cos(site.latitude) if site.latitude is not None else np.sqrt(2.0 / 3.0)
    unseen = (EARTH_RATE * level / (factor or 1.0)) ** 2 / 2.0
    return wander_of_rate(means, poses.hold, poses.up_b, np.full(3, unseen))


def _is_earth(scale: Series, factor: float | None) -> bool:
    """Whether scale factors from the Earth's rate are a gyro's: near the nominal one, or of counts near one another.

    A g-sensitivity goes up and down with the vertical Earth rate, and can be a hundred times as large.
    """
    nominal = 1.0 / factor if factor else float(np.median(scale))
    return bool(np.all(np.abs(scale / nominal - 1.0) < LARGEST_SCALE_ERROR))


def _gyro_from_pairs(pairs: Pairs, unit: str, factor: float | None, *, improved: bool) -> _Gyro:
    unknowns, spread = _diagonal_unknowns(pairs)
    told = describe_fixture_triad(
        "gyroscope", unknowns, spread, known=_known_elements(False), unit=unit, factor=factor
    )
    why = ": the headings of the poses are not known" if improved else " by the standard test"
    return _Gyro(
        told,
        "The gyro sees the vertical Earth rate well enough for bias and scale factors.",
        f"The gyro's misalignments are not determined{why}; they are taken as zero, without a stated uncertainty.",
    )


def _gyro_bias(
    recording: Recording,
    observed: Vectors,
    covariance: Matrices,
    poses: KnownPoses,
    site: Site,
    wander: HoldWander,
    seen: str,
) -> _Gyro:
    """Return the bias: the mean of each axis' three pairs of opposite poses, by weight.

    In a pair's mean the vertical Earth rate and g-sensitivities cancel. The horizontal Earth rate is in
    the pairs across a sensor's axis; where headings and latitude are known it is taken out.
    """
    factor = angular_rate_factor(recording.angular_rate_unit)
    nominal = 1.0 / factor if factor else 1.0
    across = 0.0
    if factor and site.latitude is not None and np.all(np.isfinite(poses.rotations_bn)):
        observed = observed - nominal * (poses.rotations_bn @ site.earth_rate_n)
    elif factor:
        horizontal = EARTH_RATE * (np.cos(site.latitude) if site.latitude is not None else np.sqrt(2.0 / 3.0))
        across = (nominal * horizontal) ** 2 / 2.0
    means, variances = np.zeros((3, 3)), np.zeros((3, 3))
    for axis in range(3):
        for way in (0, 1):
            at = np.flatnonzero(poses.face == 2 * axis + way)
            means[axis] += observed[at].mean(axis=0) / 2.0
            # The heading may be the same each time: its Earth rate does not average out.
            noise = np.diagonal(covariance[at], axis1=1, axis2=2).mean(axis=0) / at.size
            variances[axis] += (noise + across * (np.arange(3) != axis)) / 4.0
    weight = 1.0 / variances
    bias = np.sum(weight * means, axis=0) / np.sum(weight, axis=0)
    variance = 1.0 / np.sum(weight, axis=0)
    variance *= _excess(float(np.sum(weight * (means - bias) ** 2)), 6)
    response = np.zeros((len(poses), 3, 3))
    for face in range(6):
        at = np.flatnonzero(poses.face == face)
        response[at] = np.diag(0.5 * weight[face // 2] / np.sum(weight, axis=0) / at.size)
    spread = wander.over(np.diag(variance), response, covariance, poses.hold)
    why = "without a latitude the Earth's rotation is no reference"
    if site.latitude is not None:
        why = "the Earth's rotation is not seen well enough"
    told = describe_bias(bias, spread, unit=recording.angular_rate_unit, nominal=nominal)
    return _Gyro(
        told,
        "The six poses determine only the bias of the gyro." + seen,
        f"The gyro's scale factors and misalignments: {why}. Where its unit is known its matrix is the nominal one "
        "(identity). Spin the unit on a rate table.",
    )


def _excess(square_sum: float, degrees: int) -> float:
    """Return by what a variance has to grow where chance does not explain the square sum."""
    from scipy.special import chdtrc

    return square_sum / degrees if float(chdtrc(degrees, square_sum)) < _CHANCE else 1.0


def _estimate(
    recording: Recording,
    means: HoldMeans,
    site: Site,
    poses: KnownPoses,
    force: PlacedFit,
    told: DescribedTriad,
    gyro: _Gyro | None,
    *,
    improved: bool,
) -> Estimate:
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    holds = holds_evidence(told.triad, means.specific_force, means.specific_force_covariance, site.gravity)
    sigmas = holds.sigmas.copy()
    sigmas[poses.hold] = _expected_norms(poses, force, sigmas[poses.hold], site, improved=improved)
    # The improved test's misalignments are the placement's one to one: few checks do not say which pose is right.
    apart = poses_apart(force, _pose_names(poses))
    doubted = improved and force.has_few_checks
    placement = {"placement of the unit beyond what the protocol states, rad": force.added}
    return estimate_of(
        "improved-six-position" if improved else "six-position",
        describe_apart(told, None if gyro is None else gyro.told),
        Figures.of(
            force.adjustment, force.alone, placement, tested=[slice(0, 3)], estimated=force.added > 0.0
        ),
        said=[
            *said_of(
                remarks=_remarks(poses, site, force, gyro, improved=improved),
                cautions=[] if doubted else apart,
                objections=apart if doubted else (),
                not_determined=_not_determined(gyro, improved=improved),
            ),
            *(
                Said("objection", text, of_recording=True)
                for text in (
                    *beyond_statement(force),
                    *moved_while_held(means, poses.hold, _pose_names(poses)),
                )
            ),
        ],
        evidence=[replace(holds, sigmas=sigmas)],
        frame="fixture",
    )


def _expected_norms(
    poses: KnownPoses, force: PlacedFit, noise: Series, site: Site, *, improved: bool
) -> Series:
    """Return the root mean square that each pose's norm minus gravity should have, m/s²: noise, tilts, misalignments.

    The noise along gravity of a face's only hold is fitted away. The sensor that points up is fitted to show
    gravity whatever the tilt, so that what the other two show of it, K a, makes the norm longer by K (a² + b²) / 2.
    A misalignment a of the standard test stays whole; the improved one estimates it from the two holds of a face,
    and the half of the tilts' variance that they share is left.
    """
    lean = force.matrix / np.linalg.norm(force.matrix, axis=1, keepdims=True)
    variance = np.diag(force.covariance)[:9].reshape(3, 3) / np.sum(force.matrix**2, axis=1)[:, None]
    off = ~np.eye(3, dtype=bool)
    # One mean of all six: of a single one the placement hides whether it is there.
    leans: Series = (lean**2 - variance)[off]
    squared = 0.0 if improved else max(float(leans.mean()), 0.0)
    tilt = (force.readings.sigma**2 + (noise / site.gravity) ** 2) * (0.5 if improved else 1.0)
    expected = noise.copy()
    for k, face in enumerate(poses.face):
        if face < 0:
            continue  # seen at a slant by all three, whose noise stands for it
        mean, variance_of = 2.0 * (tilt[k] + squared), 4.0 * tilt[k] * (tilt[k] + 2.0 * squared)
        along = noise[k] * np.sqrt(1.0 - 1.0 / np.count_nonzero(poses.face == face))
        expected[k] = np.hypot(along, 0.5 * site.gravity * np.sqrt(mean**2 + variance_of))
    return expected


def _pose_names(poses: KnownPoses) -> list[str]:
    """Each pose as a user knows it."""
    return [
        FACES[face] if face >= 0 else f"hold {hold + 1}"
        for face, hold in zip(poses.face.tolist(), poses.hold.tolist(), strict=True)
    ]


def _not_determined(gyro: _Gyro | None, *, improved: bool) -> list[str]:
    sentences = [
        "How the unit sits in its fixture is not separated from its misalignments, which are against "
        "the fixture's axes. A pose that is off in the same way each time goes into them."
        if improved
        else "The accelerometers' misalignments: the sensing axes are taken as the fixture's, without an uncertainty. "
        "The improved six-position procedure estimates them.",
        "Nonlinear terms: each sensor is shown plus and minus the full vector only.",
    ]
    if gyro is None:
        sentences.append("The recording has no gyro.")
    elif gyro.not_determined:
        sentences.append(gyro.not_determined)
    return sentences


def _remarks(
    poses: KnownPoses, site: Site, force: PlacedFit, gyro: _Gyro | None, *, improved: bool
) -> list[str]:
    used = float(np.sqrt(np.mean(force.readings.sigma**2)))
    stated = float(np.sqrt(np.mean(poses.sigma**2)))
    remarks: list[str] = []
    if force.added > 0.0:
        said = (
            f"the {np.degrees(stated):.2g}° that the protocol states" if stated > 0 else "an exact placement"
        )
        remarks.append(
            f"The poses contradict one another by more than {said}: the unit was placed to about "
            f"{np.degrees(used):.2g}° about each axis (from {force.adjustment.redundancy} checks), and the stated "
            "uncertainties are made with that."
        )
    tilts = [(np.radians(1.0), "1°")]
    if used > 0.0:
        tilts.insert(0, (used, f"{np.degrees(used):.2g}°, as here"))
    say = _improved_tilt if improved else _standard_tilt
    remarks.append(
        "What misplacement does that is not known, for one hold a face: "
        + "; ".join(
            f"{say(angle, site.gravity)} if the standard uncertainty about each axis is {words}"
            for angle, words in tilts
        )
        + "."
    )
    if not improved and np.any(poses.face < 0):
        remarks.append(
            f"{np.count_nonzero(poses.face < 0)} holds in poses with no axis up or down took no part: the improved "
            "six-position procedure uses them."
        )
    return remarks if gyro is None else [*remarks, gyro.remark]


def _standard_tilt(sigma: float, gravity: float) -> str:
    return (
        f"a bias is off by {two_digits(1e3 * gravity * sigma**2 / np.sqrt(2.0))} mm/s² (one sigma) and a scale factor "
        f"by -{two_digits(1e6 * sigma**2)} ± {two_digits(1e6 * sigma**2 / np.sqrt(2.0))} ppm"
    )


def _improved_tilt(sigma: float, gravity: float) -> str:
    return (
        f"a misalignment is off by {two_digits(1e3 * sigma / np.sqrt(2.0))} mrad (one sigma), a sum "
        f"of two by {two_digits(1e3 * sigma)} mrad, a scale factor by -{two_digits(1e6 * sigma**2)} "
        f"ppm. A bias is off by {two_digits(1e3 * gravity * sigma / 3.0)} mm/s² in least squares "
        f"without weights, and by about {two_digits(1e3 * gravity * sigma**2)} mm/s² with the weights "
        "used here"
    )


def run_faces(session: Session, *, improved: bool) -> Estimate:
    """Calibrate on the faces that the protocol names, or without one on those that are nearest to up.

    Parameters
    ----------
    session : what was recorded.
    improved : estimate the whole matrices instead of their diagonals.
    """
    protocol, matching = session.protocol, session.matching
    if protocol is None or matching is None:
        protocol, matching = match_faces(session.means, session.site)
    estimate = calibrate_six_position(
        session.recording, session.means, matching, protocol, session.site, improved=improved
    )
    estimate.say("remark", *(r for r in matching.remarks if r not in estimate.remarks))
    return estimate


PROCEDURE = Procedure(
    "six-position",
    lambda session: run_faces(session, improved=False),
    "fixture",
    "a levelled plate and a cube's faces",
    "each axis up and down, levelled",
    "accelerometer biases and scale factors",
    "six-position.md",
    remedy="place the unit more exactly, or record longer holds",
    counts_between_holds=True,
    norms_from="the noise, tilts of the placement, and misalignments, which this test leaves in",
    placement="The placement limits the scale factors and biases: level the plate, use the unit's own flat "
    "faces, and say in the protocol how well (`uncertainty_deg`). The hand-held and multi-position procedures need "
    "no level.",
    believes=True,
)
