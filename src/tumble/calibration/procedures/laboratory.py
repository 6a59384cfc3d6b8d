"""The traditional laboratory method: known attitudes, known axes (24 positions and a three-axis rotation).

The table is aligned to level and north, and believed. Accelerometers: least squares of gravity in the
poses that the table was set to. Gyros: their matrix from the rotations both ways about the table's axes,
the biases from the poses, where the Earth rate is known by heading and latitude. It is the method that
Zhang et al. (2010, section 5.2) compare with; there every error of the table goes into the result, and
nothing shows it if it is the same in all poses.

Both triads come out in the axes of the fixture, and with them the rotation between the triads.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Table, Vector, Vectors, inverted
from tumble.calibration.canonical import (
    FIXTURE_UNKNOWNS,
    DescribedTriad,
    describe_apart,
    describe_fixture_triad,
)
from tumble.calibration.checks.hold_wander import HoldWander, wander_of_rate
from tumble.calibration.checks.placement import beyond_statement, moved_while_held, poses_apart
from tumble.calibration.checks.rotations import about_ways, compare_ways, slipped
from tumble.calibration.checks.scores import holds_evidence
from tumble.calibration.closed_forms.rotation_pairs import (
    EarthParts,
    RotationPair,
    pair_rotations,
    refuse_unlike_angles,
)
from tumble.calibration.equations.placement import PlacedFit, PlacedReadings, is_excessive
from tumble.calibration.estimate import (
    Estimate,
    Figures,
    Said,
    coverage_factor,
    estimate_of,
    said_of,
)
from tumble.calibration.evidence import Budget, RotationFit, Rotations
from tumble.calibration.procedure import Procedure
from tumble.calibration.procedures.six_position import KnownPoses, force_of_poses, known_poses
from tumble.calibration.session import Session
from tumble.calibration.turntable.task import spins_evidence, turned_angles
from tumble.calibration.verdict import two_digits
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import Protocol
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.segmentation.matching import Matching
from tumble.segmentation.rotations import Rotation
from tumble.units import ARCSECOND, angular_rate_factor, specific_force_factor

AXES_NEEDED = 3
# A face is up if it is so within half a degree.
PASSES = 3
_ALL = np.ones((3, 3), dtype=bool)
_SITS = (
    "How the unit sits on the table is not separated from its misalignments, which are against the "
    "table's axes. An error of the table that is the same in all poses is in the result, and no "
    "residual shows it."
)
SOURCES = ("noise", "the table's attitudes and axes", "the table's angles")
"""What the uncertainties are made of."""


@dataclass(slots=True)
class _Gyros:
    """The gyros' solution.

    `covariance` is (12, 12) of matrix (by rows) and bias; `shares` the same for each of `SOURCES`.
    """

    matrix: Matrix
    bias: Vector
    shares: list[Square]
    pairs: list[RotationPair]
    rotation: Vectors
    parts: dict[int, Vector]
    square_sum: float
    degrees: int
    factor: float
    cautions: list[str] = field(default_factory=list[str])
    objections: list[str] = field(default_factory=list[str])

    @property
    def covariance(self) -> Square:
        """The sum of the shares."""
        return np.asarray(sum(self.shares), dtype=np.float64)


def calibrate_laboratory(
    recording: Recording,
    means: HoldMeans,
    rotations: list[Rotation],
    matching: Matching,
    protocol: Protocol,
    site: Site,
) -> Estimate:
    """Calibrate both triads on an aligned table, as laboratories do.

    Parameters
    ----------
    recording : for its units.
    means : of all holds.
    rotations : in the order of `matching.spins`.
    matching, protocol : which hold has which attitude, which rotation which axis and angle, and how exactly.
    site : gravity; latitude, if the Earth rate is to be taken out of the biases.

    Returns
    -------
    estimate : in the frame ``fixture``.

    Raises
    ------
    ObservabilityError
        If attitudes or axes are missing.
    ConvergenceError
        If the accelerometers' adjustment fails.
    """
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError("The recording has no accelerometer: the laboratory method needs one.")
    if means.angular_rate is None or means.angular_rate_covariance is None:
        raise ObservabilityError("The recording has no gyro: the laboratory method needs one.")
    poses = known_poses(matching, protocol)
    force, wander = force_of_poses(means, poses, site)
    pairs, lonely = pair_rotations(rotations, matching, protocol, needed=AXES_NEEDED)
    refuse_unlike_angles(recording, pairs, means)
    gyros = _fit_gyros(means, poses, pairs, site)
    return _estimate(recording, means, site, poses, force, gyros, lonely, wander)


def _fit_gyros(means: HoldMeans, poses: KnownPoses, pairs: list[RotationPair], site: Site) -> _Gyros:
    """Return the matrix by least squares on the rotations, then the bias from the poses, in turn."""
    assert means.angular_rate is not None
    assert means.angular_rate_covariance is not None
    turned = np.array([pair.angle * pair.axis_b for pair in pairs])
    if np.linalg.matrix_rank(turned / np.max(np.abs(turned)), tol=0.1) < AXES_NEEDED:
        raise ObservabilityError(
            "The axes of the rotations lie in one plane: turn the unit about three axes across one another."
        )
    solve = np.linalg.pinv(turned)
    earth_b = _earth_b(poses, site)
    observed = means.angular_rate[poses.hold]
    weight = 1.0 / np.trace(means.angular_rate_covariance[poses.hold], axis1=1, axis2=2)
    weight = weight / np.sum(weight)
    matrix: Matrix | None = None
    bias: Vector | None = None
    parts: dict[int, Vector] = {}
    rotation = np.zeros((len(pairs), 3))
    for _ in range(PASSES):
        parts = EarthParts(pairs, means, matrix, bias, parts or None).parts()
        rotation = np.array([pair.difference(parts) for pair in pairs])
        matrix = np.asarray((solve @ rotation).T, dtype=np.float64)
        bias = np.asarray(weight @ (observed - earth_b @ matrix.T), dtype=np.float64)
    assert matrix is not None
    assert bias is not None
    if np.linalg.det(matrix) <= 0:
        raise ObservabilityError(
            "The gyros' matrix comes out left-handed: a gyro axis is reversed or two are swapped (--columns), or the "
            "protocol has the axis or the way round of a rotation wrong."
        )
    shares = _shares(means, poses, pairs, matrix, np.asarray(solve, dtype=np.float64), weight, site)
    gyros = _Gyros(matrix, bias, shares, pairs, rotation, parts, 0.0, 0, 1.0)
    unseen = _unseen_earth(poses, site) * np.sum(matrix**2, axis=1)
    wander = wander_of_rate(means, poses.hold, poses.up_b, unseen, earth_b @ matrix.T)
    _with_wander(gyros, wander, means, poses, weight, np.asarray(solve, dtype=np.float64))
    _compare_ways(gyros, wander, means, np.asarray(solve, dtype=np.float64))
    _test_rests(
        gyros,
        observed - earth_b @ matrix.T - bias,
        wander.of_each(means.angular_rate_covariance[poses.hold], poses.hold),
    )
    return gyros


def _earth_b(poses: KnownPoses, site: Site) -> Vectors:
    """The Earth rate in each pose, as far as its heading is known: what is not known is left to the mean."""
    if site.latitude is None:
        return np.zeros((len(poses), 3))
    headed = np.isfinite(poses.rotations_bn[:, :, 0]).all(axis=1)
    full = np.nan_to_num(poses.rotations_bn) @ site.earth_rate_n
    vertical = EARTH_RATE * np.sin(site.latitude) * poses.up_b
    return np.where(np.repeat(headed, 3).reshape(-1, 3), full, vertical)


def _shares(
    means: HoldMeans,
    poses: KnownPoses,
    pairs: list[RotationPair],
    matrix: Matrix,
    solve: Table,
    weight: Series,
    site: Site,
) -> list[Square]:
    """Return (12, 12) of matrix and bias for each of `SOURCES`."""
    assert means.angular_rate_covariance is not None
    noise, axes, angles = (np.zeros((12, 12)) for _ in range(3))
    sigma = float(np.sqrt(np.mean(poses.sigma**2)))
    for k, pair in enumerate(pairs):
        # element (i, j) of the matrix takes solve[j, k] of the rotation's component i
        spread = np.asarray(np.kron(np.eye(3), solve[:, k : k + 1]), dtype=np.float64)
        across = np.eye(3) - np.outer(pair.axis_b, pair.axis_b)
        noise[:9, :9] += spread @ pair.covariance @ spread.T
        axes[:9, :9] += spread @ (sigma**2 * pair.angle**2 * matrix @ across @ matrix.T) @ spread.T
        along = matrix @ pair.axis_b
        angles[:9, :9] += spread @ (pair.angle_sigma**2 * np.outer(along, along)) @ spread.T
    noise[9:, 9:] = np.einsum("k,kij->ij", weight**2, means.angular_rate_covariance[poses.hold])
    unseen = (EARTH_RATE * sigma) ** 2 + _unseen_earth(poses, site)
    axes[9:, 9:] = unseen * float(weight @ weight) * (matrix @ matrix.T)
    return [noise, axes, angles]


def _unseen_earth(poses: KnownPoses, site: Site) -> float:
    """Variance of the Earth rate along an axis that latitude and headings leave open, (rad/s)²."""
    if site.latitude is None:
        return EARTH_RATE**2 / 3.0
    if not np.isfinite(poses.rotations_bn).all():
        return (EARTH_RATE * float(np.cos(site.latitude))) ** 2 / 2.0
    return 0.0


def _with_wander(
    gyros: _Gyros, wander: HoldWander, means: HoldMeans, poses: KnownPoses, weight: Series, solve: Table
) -> None:
    """Count in the noise's share what the biases of rests and rotations have in common."""
    assert means.angular_rate_covariance is not None
    rotations = [(k, share, r) for k, pair in enumerate(gyros.pairs) for share, r in pair.shares]
    middle, seconds = np.array([(r.middle, r.seconds) for _, _, r in rotations]).T
    response = np.zeros((len(rotations) + len(poses), 12, 3))
    for at, (k, share, r) in enumerate(rotations):
        response[at, :9] = share * r.seconds * np.kron(np.eye(3), solve[:, k : k + 1])
    response[len(rotations) :, 9:] = weight[:, None, None] * np.eye(3)
    spread = np.array([r.covariance / r.seconds**2 for _, _, r in rotations])
    rests = means.angular_rate_covariance[poses.hold]
    counted = np.concatenate(
        [wander.counted(spread, seconds), wander.counted(rests, means.duration[poses.hold])]
    )
    gyros.shares[0] = wander.widened(
        gyros.shares[0],
        response,
        counted,
        np.concatenate([middle - 0.5 * seconds, wander.start[poses.hold]]),
        np.concatenate([middle + 0.5 * seconds, wander.stop[poses.hold]]),
    )


def _compare_ways(gyros: _Gyros, wander: HoldWander, means: HoldMeans, solve: Table) -> None:
    """Compare both ways about each axis; what they differ by may be in either angle."""
    axes = [pair.axis_b for pair in gyros.pairs]
    found = compare_ways(gyros.pairs, axes, inverted(gyros.matrix), gyros.parts, wander, means)
    for one in found:
        if one.is_certain:
            moved = one.off * np.outer(gyros.matrix @ axes[one.pair], solve[:, one.pair]).ravel()
            gyros.shares[2][:9, :9] += np.outer(moved, moved)
    gyros.cautions, gyros.objections = about_ways(gyros.pairs, found)


def _test_rests(gyros: _Gyros, residual: Vectors, covariance: AnyArray) -> None:
    """Raise the biases' uncertainty where the poses contradict one another by more than their noise."""
    inverse = np.linalg.inv(covariance)
    gyros.square_sum = float(np.einsum("ki,kij,kj->", residual, inverse, residual))
    gyros.degrees = residual.size - 3
    if is_excessive(gyros.square_sum, gyros.degrees):
        gyros.factor = gyros.square_sum / gyros.degrees
        gyros.shares[0][9:, 9:] *= gyros.factor


def _described(
    recording: Recording, site: Site, force: PlacedFit, gyros: _Gyros
) -> tuple[DescribedTriad, DescribedTriad]:
    unknowns, covariance = np.zeros(FIXTURE_UNKNOWNS), np.zeros((FIXTURE_UNKNOWNS, FIXTURE_UNKNOWNS))
    unknowns[:9], unknowns[9:12] = force.matrix.ravel(), force.bias
    covariance[:12, :12] = force.covariance
    # A gravity that is too large makes the whole matrix too small by the same share.
    slope = np.zeros(FIXTURE_UNKNOWNS)
    slope[:9] = -unknowns[:9] / site.gravity
    told = describe_fixture_triad(
        "accelerometer",
        unknowns,
        covariance + np.outer(slope, slope) * site.gravity_sigma**2,
        known=_ALL,
        unit=recording.specific_force_unit,
        factor=specific_force_factor(recording.specific_force_unit),
    )
    return told, _described_gyros(recording, gyros, gyros.covariance)


def _described_gyros(recording: Recording, gyros: _Gyros, covariance: Square) -> DescribedTriad:
    unknowns, full = np.zeros(FIXTURE_UNKNOWNS), np.zeros((FIXTURE_UNKNOWNS, FIXTURE_UNKNOWNS))
    unknowns[:9], unknowns[9:12] = gyros.matrix.ravel(), gyros.bias
    full[:12, :12] = covariance
    return describe_fixture_triad(
        "gyroscope",
        unknowns,
        full,
        known=_ALL,
        unit=recording.angular_rate_unit,
        factor=angular_rate_factor(recording.angular_rate_unit),
    )


def _budget(recording: Recording, site: Site, force: PlacedFit, gyros: _Gyros) -> dict[str, Series]:
    """Return what each of `SOURCES` adds to the named parameters' standard uncertainties."""
    exact = replace(force.readings, sigma=np.zeros_like(force.readings.sigma))
    only_noise = np.asarray(_fit_placed_covariance(exact, force), dtype=np.float64)
    rest = force.covariance - only_noise
    shares = [only_noise, 0.5 * (rest + rest.T), np.zeros((12, 12))]
    budget: dict[str, Series] = {}
    for name, held, turned in zip(SOURCES, shares, gyros.shares, strict=True):
        part = replace(force, covariance=held)
        triads = _described(
            recording, replace(site, gravity_sigma=0.0), part, replace(gyros, shares=[turned])
        )
        budget[name] = np.array(
            [value.standard_uncertainty for triad in triads for value in triad.parameters]
        )
    return budget


def _fit_placed_covariance(exact: PlacedReadings, force: PlacedFit) -> Square:
    """Return what noise alone adds to the covariance of a placed fit: by the weights that it was made with."""
    adjustment = force.adjustment
    n = exact.nominal.shape[0]
    design = np.zeros((n, 3, 12))
    for i in range(3):
        design[:, i, 3 * i : 3 * i + 3] = exact.nominal
        design[:, i, 9 + i] = 1.0
    weighted = adjustment.chain.solve(design)
    middle = np.einsum("gsp,gst,gtq->pq", weighted, exact.covariance, weighted)
    return adjustment.cofactor @ middle @ adjustment.cofactor


def _estimate(
    recording: Recording,
    means: HoldMeans,
    site: Site,
    poses: KnownPoses,
    force: PlacedFit,
    gyros: _Gyros,
    lonely: list[str],
    wander: HoldWander,
) -> Estimate:
    told, turned = _described(recording, site, force, gyros)
    adjustment = force.adjustment
    degrees = adjustment.redundancy + gyros.degrees
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    figures = Figures.of(
        adjustment,
        force.alone,
        {
            "accelerometer bias from hold to hold, m/s²": _wander_si(
                force.matrix, wander.typical(poses.hold)
            ),
            "placement of the unit beyond what the protocol states, rad": force.added,
        },
        tested=[slice(0, 3)],
    )
    axes = [pair.axis_b for pair in gyros.pairs]
    return estimate_of(
        "laboratory",
        describe_apart(told, turned),
        replace(
            figures,
            sigma0_final=float(np.sqrt((adjustment.square_sum + gyros.square_sum / gyros.factor) / degrees)),
            degrees_of_freedom=degrees,
            coverage_factor=coverage_factor(degrees),
        ),
        said=[
            *said_of(
                remarks=_remarks(poses, site, force, gyros, lonely),
                cautions=[*poses_apart(force, [f"hold {k + 1}" for k in poses.hold]), *gyros.cautions],
                not_determined=[_SITS, "Nonlinear terms and g-sensitivity of the gyros are not estimated."],
            ),
            *(
                Said("objection", text, of_recording=True)
                for text in (
                    *beyond_statement(force),
                    *moved_while_held(means, poses.hold, ["its pose"] * len(poses)),
                    *gyros.objections,
                    *_slipped(means, poses, force, gyros, wander),
                )
            ),
        ],
        evidence=[
            holds_evidence(told.triad, means.specific_force, means.specific_force_covariance, site.gravity),
            spins_evidence(gyros.pairs, axes, gyros.matrix, gyros.parts),
            Rotations(_rotation_fits(gyros, poses)),
            Budget(_budget(recording, site, force, gyros)),
        ],
        frame="fixture",
    )


def _slipped(
    means: HoldMeans, poses: KnownPoses, force: PlacedFit, gyros: _Gyros, wander: HoldWander
) -> list[str]:
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    covariance = wander.of_each(means.specific_force_covariance, np.arange(len(means)))
    sigma = float(np.sqrt(np.mean(poses.sigma**2)))
    return slipped(gyros.pairs, means.specific_force, covariance, inverted(force.matrix), sigma)


def _wander_si(matrix: Matrix, wander: Vector) -> float:
    """The wander of a typical sensor, m/s²."""
    row: Series = np.sqrt(np.sum(matrix**2, axis=1))
    return float(np.sqrt(np.mean((wander / row) ** 2)))


def _rotation_fits(gyros: _Gyros, poses: KnownPoses) -> tuple[RotationFit, ...]:
    """Each axis as the gyros saw it, against where the protocol has it."""
    inverse = inverted(gyros.matrix)
    sigma = float(np.sqrt(np.mean(poses.sigma**2)))
    fits: list[RotationFit] = []
    for pair, rotation in zip(gyros.pairs, gyros.rotation, strict=True):
        seen = inverse @ rotation
        seen = seen / np.linalg.norm(seen)
        angles = turned_angles(pair, pair.axis_b, gyros.matrix, gyros.parts)
        away = float(np.linalg.norm(np.cross(seen, pair.axis_b)))
        fits.append(RotationFit(pair.name, seen, float("nan"), away, sigma, float("nan"), angles))
    return tuple(fits)


def _remarks(poses: KnownPoses, site: Site, force: PlacedFit, gyros: _Gyros, lonely: list[str]) -> list[str]:
    remarks = [f"A rotation took no part: {words}." for words in lonely]
    stated = float(np.sqrt(np.mean(poses.sigma**2)))
    used = float(np.sqrt(np.mean(force.readings.sigma**2)))
    if force.added > 0.0:
        remarks.append(
            f"The poses contradict one another by more than the {two_digits(stated / ARCSECOND)}″ that "
            f"the protocol states. The unit was in them to about {two_digits(used / ARCSECOND)}″ about "
            "each axis, and the accelerometers' uncertainties are made with that."
        )
    tilt = used if used > 0.0 else ARCSECOND
    remarks.append(
        f"An attitude that is off by {two_digits(tilt / ARCSECOND)}″ in one pose moves an accelerometer "
        f"misalignment by up to {two_digits(0.25 * tilt / ARCSECOND)}″ and a bias by up to "
        f"{two_digits(1e6 * tilt * site.gravity / 24.0)} µm/s². A table whose axes are not square by "
        "that angle moves the gyros' misalignments by all of it, and nothing shows it. The turntable "
        "procedure needs no attitudes."
    )
    if site.latitude is None:
        remarks.append(
            "No latitude was given: the Earth rate was left to average out over the headings of the poses. Give "
            "--site LATITUDE."
        )
    elif not np.isfinite(poses.rotations_bn).all():
        remarks.append(
            "Not all headings are in the protocol: there the horizontal Earth rate counts as noise of the gyros' "
            "biases."
        )
    if gyros.factor > 1.0:
        remarks.append(
            f"The gyros' readings at rest disagree by {two_digits(float(np.sqrt(gyros.factor)))} times what their "
            "noise explains: wrong headings, or biases that wander. The biases' uncertainties are raised by that."
        )
    return remarks


def _run(session: Session) -> Estimate:
    protocol, matching = session.matched
    return calibrate_laboratory(
        session.recording, session.means, session.rotations, matching, protocol, session.site
    )


PROCEDURE = Procedure(
    "laboratory",
    _run,
    "fixture",
    "a table levelled and aligned to north",
    "each axis up and down with four headings, three axes turned about both ways",
    "both triads against the table's axes, as exactly as the table is aligned",
    "laboratory.md",
    example="laboratory",
    remedy="align the table better, or hold longer and turn further; the turntable procedure needs no alignment",
    counts_between_holds=True,
    placement="The table's alignment limits the misalignments one to one, and nothing in the residuals shows it. "
    "The turntable procedure calibrates both triads on the same table without any alignment.",
    believes=True,
    gyros_from="table",
)
