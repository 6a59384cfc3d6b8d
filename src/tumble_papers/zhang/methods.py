"""Zhang et al. (2010) on a recording of a turntable: means at rest, and rotations both ways about axes nobody aligned.

Observed are the mean of every rest, the difference of the integrals of every pair of rotations, the angle that the
table's display says of it, and the plane that the specific forces lay in meanwhile. Every parameter is an explicit
function of these, and so is its covariance.

Where the paper leaves a choice:

- Rests weigh by how long they lasted; the paper's last alike.
- R is fitted to all axes that are not vertical. The paper says so at the end of section 4; (40) takes two.
- Without the inter-triad rotation the frames o and p count as one, by what assembly leaves of it.

A unit is placed on the table, turned, stopped and turned again; then it is placed otherwise. Rotations both ways about
one axis of a placement make a pair: their difference knows neither bias nor Earth rate ((15) to (18)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import partial

import numpy as np
from scipy.linalg import block_diag

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Square, Vector, Vectors, inverted
from tumble.attitude import matrix_from_rotation_vector, twenty_six_directions
from tumble.calibration import Estimate, Estimator, Said, Session
from tumble.earth import EARTH_RATE
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans, Rotation
from tumble.sensor import ImuModel, Triad
from tumble_papers.estimates import carried_estimate, means_of_both
from tumble_papers.zhang.closed_forms import (
    axis_from_rotation,
    axis_from_scatter,
    bias_from_static_pairs,
    ellipsoid_from_norms,
    matrix_from_rotations,
    wahba_rotation,
)


@dataclass
class Placement:
    """The unit as it is placed on the table: its pose, from the first hold that says, and the spins found."""

    pose: Pose | None = None
    spins: list[tuple[SpinStep, Rotation]] = field(default_factory=list[tuple[SpinStep, Rotation]])


def find_placements(rotations: Sequence[Rotation], protocol: Protocol) -> list[Placement]:
    """Return the placements of a protocol with the rotations that were found.

    A new one begins with a turn, with a hold that follows a hold, and with a hold in a pose that the spin
    before it does not lead to.

    Parameters
    ----------
    rotations : that were found, a step that was done twice twice.
    protocol : what was to be done.
    """
    placements, before = [Placement()], None
    for index, step in enumerate(protocol.steps):
        if _begins(step, before, placements[-1].pose):
            placements.append(Placement())
        here = placements[-1]
        if isinstance(step, HoldStep):
            here.pose = here.pose or step.pose
        if isinstance(step, SpinStep):
            here.spins += [(step, rotation) for rotation in rotations if rotation.step == index]
        before = step
    return placements


def _begins(step: object, before: object, pose: Pose | None) -> bool:
    if isinstance(step, TurnStep):
        return True
    if not isinstance(step, HoldStep) or before is None:
        return False
    if isinstance(before, HoldStep):
        return True
    return _another_pose(pose, step.pose, before.axis_b if isinstance(before, SpinStep) else None)


def _another_pose(one: Pose | None, other: Pose | None, axis_b: Vector | None) -> bool:
    """Return whether a hold is in another pose than the spins about an axis before it make of the first one."""
    if one is None or other is None:
        return False
    apart = one.up_b - other.up_b
    # Written twice, or to two digits after the table stopped within a revolution: what is less than the poses are
    # uncertain by is no other pose. A milliradian: the same to the digit. Up stays where it was along the table's axis.
    same = max(1e-3, float(np.hypot(one.sigma, other.sigma)))
    return bool(np.max(np.abs(apart if axis_b is None else apart @ axis_b / np.linalg.norm(axis_b))) > same)


# Axes nearer than this to one another are one: 3 degrees, as `SMALLEST_SINE` of the inter-triad angles.
SAME_AXIS = np.cos(np.radians(3.0))


@dataclass
class RotationPair:
    """All rotations of one placement about one axis.

    Attributes
    ----------
    axis_b : (3,) unit vector, as the protocol has it, or as the pose before it has up.
    forward, backward : counter-clockwise and clockwise about it.
    """

    axis_b: Vector
    forward: list[Rotation] = field(default_factory=list[Rotation])
    backward: list[Rotation] = field(default_factory=list[Rotation])

    @property
    def shares(self) -> list[tuple[float, Rotation]]:
        """What each rotation's integral is multiplied with in (18): the mean forward less the mean backward."""
        sides = (1.0, self.forward), (-1.0, self.backward)
        return [(sign / len(side), rotation) for sign, side in sides for rotation in side]

    @property
    def angle(self) -> float:
        """Difference of the table's angles, rad, above zero."""
        return sum(abs(share * rotation.angle) for share, rotation in self.shares)

    @property
    def angle_sigma(self) -> float:
        """Its standard uncertainty, rad."""
        return float(np.sqrt(sum((share * rotation.angle_sigma) ** 2 for share, rotation in self.shares)))

    @property
    def covariance(self) -> Matrix:
        """(3, 3) of the difference of the integrals, raw²·s²."""
        return np.asarray(sum(share**2 * rotation.covariance for share, rotation in self.shares))

    def difference(self, means: HoldMeans) -> Vector:
        """Return (3,) raw·s, the mean integral forward less that backward (18).

        What the rests beside the rotations show is taken out of both. With ways that took the same time, as in the
        paper, that is nothing; with others it is the bias and the Earth rate along the axis.

        Parameters
        ----------
        means : of the holds.
        """
        assert means.angular_rate is not None
        holds = sorted({h for _, r in self.shares for h in (r.before, r.after) if h is not None})
        rest = np.mean(means.angular_rate[holds] if holds else means.angular_rate, axis=0)
        return np.asarray(sum(share * (r.integral - r.seconds * rest) for share, r in self.shares))


def pair_rotations(rotations: Sequence[Rotation], protocol: Protocol) -> list[RotationPair]:
    """Return the axes that were turned about both ways.

    Parameters
    ----------
    rotations, protocol : as for `find_placements`.
    """
    pairs: list[RotationPair] = []
    for placement in find_placements(rotations, protocol):
        mine: list[RotationPair] = []
        for step, rotation in placement.spins:
            axis = step.axis_b if step.axis_b is not None or placement.pose is None else placement.pose.up_b
            if axis is None:
                continue
            axis = np.asarray(axis / np.linalg.norm(axis), dtype=np.float64)
            # An axis may be named by its other end.
            pair = next((p for p in mine if abs(float(p.axis_b @ axis)) > SAME_AXIS), None)
            if pair is None:
                pair = RotationPair(axis)
                mine.append(pair)
            way = float(pair.axis_b @ axis) * step.rate
            (pair.forward if way > 0.0 else pair.backward).append(rotation)
        pairs += mine
    return [pair for pair in pairs if pair.forward and pair.backward]


ROTATION_SIGMA = 0.01  # rad: by which assembly turns the triads against one another
NO_ROTATION = Said(
    "not determined",
    "The rotation between the triads is not determined: it is taken for none, with a standard uncertainty of "
    f"{1e3 * ROTATION_SIGMA:g} mrad about each axis.",
)
# The least sine of an axis' angle to the vertical: below 6 degrees gravity shows less than a tenth of itself.
SMALLEST_SINE = 0.1
# A mean at rest shows the Earth rate if it is known to so much of it: the bias by (25) is then off by its square.
SEEN = 0.2
# A pose or an axis is one of the optimal set if it is so near; the next one is 45 degrees away.
NEAR = np.radians(20.0)


@dataclass(frozen=True)
class TableObservations:
    """What the closed forms are made from, in raw units, with its noise.

    Attributes
    ----------
    force, rate : (rests, 3) means.
    seconds : (rests,) how long they lasted.
    rotation : (pairs, 3) raw·s, the left of (18) before the gyros' matrix.
    angle : (pairs,) rad, the right of (19).
    normal, tangents : (pairs, 3), (pairs, 2, 3) unit vectors of the plane of the raw specific forces.
    sine : (pairs,) the radius of their circle, over that of gravity: of the axis' angle to the vertical.
    noise : covariance of force, rate, rotation, angle and of the normal's two components, in this order.
    """

    force: Vectors
    rate: Vectors
    seconds: Series
    rotation: Vectors
    angle: Series
    normal: Vectors
    tangents: AnyArray
    sine: Series
    noise: Square

    def model(self, gravity: float, change: Series, *, inter_triad: bool) -> ImuModel:
        """Return both triads in p.

        Parameters
        ----------
        gravity : m/s².
        change : of all observations, in the order of `noise`; without `inter_triad` also (3,) rad of R.
        inter_triad : find the rotation between the triads, or take it for none.
        """
        rests, pairs = len(self.force), len(self.rotation)
        parts = np.split(change, np.cumsum([3 * rests, 3 * rests, 3 * pairs, pairs, 2 * pairs]))
        force, rate, rotation = (
            of + part.reshape(-1, 3)
            for of, part in zip((self.force, self.rate, self.rotation), parts[:3], strict=True)
        )
        # (12) to (14)
        force_matrix, force_bias = ellipsoid_from_norms(force, gravity, self.seconds)
        # (18) to (22)
        own = matrix_from_rotations(rotation, self.angle + parts[3])
        # (24), (25)
        rate_bias = bias_from_static_pairs(own, rate, self.seconds)
        if inter_triad:
            normal = self.normal + np.einsum("kj,kji->ki", parts[4].reshape(-1, 2), self.tangents)
            C_op = self._rotation(force_matrix, own, rotation, normal)
        else:
            C_op = matrix_from_rotation_vector(parts[5])
        return ImuModel(Triad(force_matrix, force_bias), Triad(own @ C_op, rate_bias))

    def _rotation(self, force_matrix: Matrix, own: Matrix, rotation: Vectors, normal: Vectors) -> Matrix:
        """R_p^o of the axes that both triads saw."""
        seen = self.sine > SMALLEST_SINE
        axes_o = axis_from_rotation(own, rotation[seen])  # (41)
        # (42) in raw readings: their normal is inv(K T).T l, so that l is (K T).T of it.
        axes_p = normal[seen] @ force_matrix
        axes_p /= np.linalg.norm(axes_p, axis=1, keepdims=True)  # (47)
        # The null vector of (46) has two ends.
        axes_p *= np.sign(np.sum(axes_o * axes_p, axis=1, keepdims=True))
        return wahba_rotation(axes_o, axes_p)  # (39)


def _observe(session: Session, *, optimal: bool) -> TableObservations:
    """Gather rests and pairs of rotations: all, or the paper's optimal set."""
    force, of_force, rate, of_rate = means_of_both(session)
    means, pairs = session.means, pair_rotations(session.rotations, session.matched[0])
    if len(pairs) < 6:
        raise ObservabilityError(
            f"The table turned both ways about {len(pairs)} axes, and the gyros' six scale factors and misalignments "
            "need six: x, y, z, and one between each two of them (21)."
        )
    _require_earth(means, of_rate, pairs)
    matrix, bias = ellipsoid_from_norms(force, session.site.gravity, means.duration)
    kept = np.arange(len(means))
    if optimal:
        faces, edges = twenty_six_directions()[:6], twenty_six_directions()[6:18]
        between = [edges[edges[:, axis] == 0.0] for axis in range(3)]
        along = [np.array([face for face in faces if face[axis] != 0.0]) for axis in range(3)]
        up = (force - bias) @ inverted(matrix).T
        kept = _chosen("pose", up, [*faces[:, None], *between], means.duration)
        turned = np.array([pair.difference(means) for pair in pairs])
        pairs = [
            pairs[k] for k in _chosen("rotation axis", turned, [*along, *between], [p.angle for p in pairs])
        ]
    planes = [_plane(session.recording, pair) for pair in pairs]
    return TableObservations(
        force=force[kept],
        rate=rate[kept],
        seconds=means.duration[kept],
        rotation=np.array([pair.difference(means) for pair in pairs]),
        angle=np.array([pair.angle for pair in pairs]),
        normal=np.array([axes[0] for axes, _, _ in planes]),
        tangents=np.array([axes[1:] for axes, _, _ in planes]),
        sine=np.array([radius for _, radius, _ in planes])
        / (session.site.gravity * float(np.mean(np.diag(matrix)))),
        noise=np.asarray(
            block_diag(
                *of_force[kept],
                *of_rate[kept],
                *(pair.covariance for pair in pairs),
                np.diag([pair.angle_sigma**2 for pair in pairs]),
                *(np.diag(variance) for _, _, variance in planes),
            ),
            dtype=np.float64,
        ),
    )


def _require_earth(means: HoldMeans, of_rate: Matrices, pairs: Sequence[RotationPair]) -> None:
    """Refuse gyros to whose means (24) says nothing."""
    # raw per rad/s
    size = np.median([np.linalg.norm(pair.difference(means)) / pair.angle for pair in pairs])
    variance = np.trace(of_rate, axis1=1, axis2=2) / 3.0
    if np.sqrt(np.average(variance, weights=means.duration)) > SEEN * EARTH_RATE * size:
        raise ObservabilityError(
            "The gyros' biases come from the norm of the Earth rate (24), and these gyros are too noisy to see it at "
            "rest: hold longer."
        )


def _chosen(
    what: str, vectors: Vectors, wanted: Sequence[Vectors], size: Sequence[float] | Series
) -> list[int]:
    """Return for each group of unit vectors the row near to one of them, the one of the largest size of several."""
    units = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    found: list[int] = []
    for group in wanted:
        near = np.max(units @ group.T, axis=1) > np.cos(NEAR)
        if not np.any(near):
            raise ObservabilityError(
                f"The optimal set of Zhang et al. has a {what} near one of "
                f"{', '.join(str(unit.round(2).tolist()) for unit in group)}, and the recording has none."
            )
        found.append(int(np.argmax(np.where(near, size, -np.inf))))
    return found


def _plane(recording: Recording, pair: RotationPair) -> tuple[AnyArray, float, Series]:
    """Return normal and tangents (3, 3) by rows, the circle's radius, raw, and the variances (2,) of the normal."""
    assert recording.specific_force is not None
    pieces = [
        np.asarray(recording.specific_force[r.start : r.stop], dtype=np.float64) for _, r in pair.shares
    ]
    about = np.concatenate([piece - piece.mean(axis=0) for piece in pieces])
    scatter = about.T @ about / len(about)
    values, vectors = np.linalg.eigh(scatter)
    axes = np.vstack([axis_from_scatter(scatter), vectors[:, 1:].T])  # (44) to (46)
    # What is left across the plane is the noise of a sample.
    return axes, float(np.sqrt(values[1] + values[2])), max(values[0], 0.0) / (len(about) * values[1:])


def calibrate_zhang(
    session: Session, name: str, *, inter_triad: bool = True, optimal: bool = False
) -> Estimate:
    """Calibrate both triads in closed form.

    Parameters
    ----------
    session : a turntable's recording with its protocol.
    name : of the estimator.
    inter_triad : find the rotation between the triads (39) to (47); otherwise it is taken for none.
    optimal : from the paper's nine poses and six rotations alone, those that were held and turned longest.

    Raises
    ------
    ObservabilityError
        If rests or rotations are too few or too alike, the gyros do not see the Earth rate, or all axes are vertical.
    """
    seen, gravity = _observe(session, optimal=optimal), session.site.gravity
    method = partial(seen.model, gravity, inter_triad=inter_triad)
    if inter_triad and np.count_nonzero(seen.sine > SMALLEST_SINE) < 2:
        raise ObservabilityError(
            "The rotation between the triads needs two rotation axes that are not vertical (42): tilt the table's "
            "axis, or take the estimator zhang-closed-form."
        )
    noise = seen.noise if inter_triad else block_diag(seen.noise, ROTATION_SIGMA**2 * np.eye(3))
    return carried_estimate(name, session, method, noise, said=() if inter_triad else (NO_ROTATION,))


_METHODS = (
    ("zhang-closed-form", "each triad by itself in closed form, from the norms at rest and the angles of a table",
     "(12) to (25)", False, False),
    ("zhang-inter-triad", "the same, and the rotation between the triads from the axes that both saw",
     "(12) to (25), (39) to (47)", True, False),
    ("zhang-optimal", "the same from nine poses and six rotations alone, the paper's optimal set",
     "(12) to (47)", True, True),
)  # fmt: skip
ESTIMATORS: dict[str, Estimator] = {
    name: Estimator(
        name,
        title,
        f"Zhang et al. 2010, {equations}",
        partial(calibrate_zhang, name=name, inter_triad=inter_triad, optimal=optimal),
        needs_protocol=True,
    )
    for name, title, equations, inter_triad, optimal in _METHODS
}
"""What the entry point offers."""
