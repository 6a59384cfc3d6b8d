"""What a rate table showed a unit whose axes on it are known, gathered for the adjustment.

The axis of a spin is the protocol's own, or the one that the pose before it has up, or, where the
protocol says nothing, the coordinate axis along which the accelerometers show gravity.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrices, Matrix, Series, Vector
from tumble.calibration.equations.spin import SpinReadings, padded, spin_covariance
from tumble.calibration.equations.spin_groups import SpinGroup, group_spins
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import Protocol
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans, SpinMeans
from tumble.segmentation.matching import Matching
from tumble.units import specific_force_factor

# An axis within this of a coordinate axis is meant to be it.
_FACE_COSINE = np.cos(np.radians(10.0))
# Rates on a table's display are further apart than this share; the Earth's rotation adds less to one of them.
SAME_RATE = 0.02
# Spins at one rate whose scatter is a yardstick, and by how much their mean is off: in its standard deviations, and
# as a share that no gyro's nonlinearity reaches.
FEWEST_OF_RATE = 4
LARGEST_CONTRADICTION, LEAST_CONTRADICTION = 6.0, 0.002


@dataclass(frozen=True, slots=True)
class SpunPlacement:
    """A placement on the table whose axis is known.

    Attributes
    ----------
    group : its holds and spins.
    axis : (3,) unit vector in the fixture's axes that the rates are about, right-handed.
    upward : how much of the axis points up, -1 to 1; nan if that is not known.
    guessed : the axis is the one that the accelerometers show up, for lack of a pose.
    """

    group: SpinGroup
    axis: Vector
    upward: float
    guessed: bool = False


def find_placements(
    recording: Recording, means: HoldMeans, matching: Matching, protocol: Protocol
) -> list[SpunPlacement]:
    """Return the placements with spins, each with its axis.

    Raises
    ------
    ObservabilityError
        If an axis is not known.
    """
    return [
        _placement(recording, means, group) for group in group_spins(matching, protocol) if len(group.rows)
    ]


def _placement(recording: Recording, means: HoldMeans, group: SpinGroup) -> SpunPlacement:
    """Return the axis that a group was spun about: the protocol's, the pose's, or the one seen up."""
    if group.pose is not None:
        up_b = group.pose.up_b / np.linalg.norm(group.pose.up_b)
        axis = up_b if group.spins[0].axis_b is None else group.spins[0].axis_b
        axis = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
        return SpunPlacement(group, axis, float(axis @ up_b))
    if group.spins[0].axis_b is not None:
        axis = np.asarray(group.spins[0].axis_b, dtype=float)
        return SpunPlacement(group, axis / np.linalg.norm(axis), float("nan"))
    factor = specific_force_factor(recording.specific_force_unit)
    if factor is not None and means.specific_force is not None and group.holds:
        seen = means.specific_force[group.holds].mean(axis=0)
        face = int(np.argmax(np.abs(seen)))
        if abs(seen[face]) > _FACE_COSINE * np.linalg.norm(seen):
            axis = np.sign(seen[face]) * np.eye(3)[face]
            return SpunPlacement(group, axis, 1.0, guessed=True)
    raise ObservabilityError(
        f"The axis that the unit was spun about ({group.name or 'a spin without a name'}) is not known: give the spin "
        "an axis in the protocol, or the hold before it a pose."
    )


def gather_spins(
    recording: Recording, means: HoldMeans, spins: SpinMeans, placements: list[SpunPlacement], site: Site
) -> SpinReadings:
    """Return the readings of all placements: a row for each spin and each hold, in order of time.

    Parameters
    ----------
    recording, means, spins : units; means at rest; means of the spins.
    site : its latitude says how large the horizontal Earth rate is, which is seen at rest only.
    """
    noise = spin_covariance(spins)
    cosine = np.cos(site.latitude) if site.latitude is not None else np.sqrt(2.0 / 3.0)
    rows = [_rows(placement, means, spins, noise) for placement in placements]
    longest = max(len(mine) for mine in rows)
    marks = np.full((len(rows), longest), -2)
    for c, mine in enumerate(rows):
        marks[c, : len(mine)] = [row.spin for row in mine]
    across = [np.eye(3) - np.outer(p.axis, p.axis) for p in placements]
    return SpinReadings(
        observed=padded([[row.shown for row in mine] for mine in rows], longest),
        covariance=padded([[row.covariance for row in mine] for mine in rows], longest),
        rate=padded([[row.rate for row in mine] for mine in rows], longest),
        share=padded([[np.array(row.share) for row in mine] for mine in rows], longest),
        unseen=0.5 * (EARTH_RATE * cosine) ** 2 * np.array(across),
        time=padded([[np.array(row.time) for row in mine] for mine in rows], longest),
        spin=marks,
        sigma=np.array([0.0 if p.group.pose is None else p.group.pose.sigma for p in placements]),
    )


@dataclass(frozen=True, slots=True)
class _Row:
    """A spin, or a rest (`spin` is -1)."""

    time: float
    shown: Vector
    covariance: Matrix
    rate: Vector
    share: float
    spin: int


def _rows(placement: SpunPlacement, means: HoldMeans, spins: SpinMeans, noise: Matrices) -> list[_Row]:
    """Return a placement's spins and rests in order of time."""
    assert spins.angular_rate is not None
    group = placement.group
    rows = [
        _Row(
            float(spins.time[at]),
            spins.angular_rate[at],
            noise[at],
            step.rate * placement.axis * _sense(placement, step.axis_b),
            step.rate_sigma,
            at,
        )
        for at, step in zip(group.rows, group.spins, strict=True)
    ]
    if means.angular_rate is not None and means.angular_rate_covariance is not None:
        rows += [
            _Row(
                float(means.time[at]),
                means.angular_rate[at],
                means.angular_rate_covariance[at],
                np.zeros(3),
                0.0,
                -1,
            )
            for at in group.holds
        ]
    return sorted(rows, key=lambda row: row.time)


def _sense(placement: SpunPlacement, axis_b: Vector | None) -> float:
    """Return -1 for a spin about the axis opposite to the placement's."""
    return 1.0 if axis_b is None or float(np.dot(axis_b, placement.axis)) >= 0.0 else -1.0


def require_rates(readings: SpinReadings, placements: list[SpunPlacement]) -> None:
    """Refuse a placement that does not tell bias and scale factor apart.

    Raises
    ------
    ObservabilityError
        If it was spun at one rate in one direction, and not seen at rest.
    """
    for c, placement in enumerate(placements):
        along = readings.rate[c][readings.active[c]] @ placement.axis
        if np.ptp(along) <= 1e-6 * np.max(np.abs(along)):
            raise ObservabilityError(
                f"{placement.group.name or axis_words(placement.axis)}: spun at one rate and in one "
                "direction only, and nowhere at rest: bias and scale factor cannot be separated. "
                "Spin both ways, at several rates, and record the table at rest in between."
            )


def axis_words(axis: Vector) -> str:
    """Return an axis in words.

    Examples
    --------
    >>> axis_words(np.array([0.0, -1.0, 0.0]))
    'axis -y'
    """
    face = int(np.argmax(np.abs(axis)))
    if abs(axis[face]) > 1.0 - 1e-6:
        return f"axis {'-' if axis[face] < 0 else ''}{'xyz'[face]}"
    return "axis (" + ", ".join(f"{v:.3g}" for v in axis) + ")"


def contradicting_rates(rates: Series, errors: Series) -> list[str]:
    """Name the rate of a table whose spins show another rate than those at the other rates.

    The scatter of the spins at one rate is the yardstick: a model of the noise that explains all residuals explains
    a wrong rate, too.

    Parameters
    ----------
    rates : (spins,) rad/s, about each spin's axis.
    errors : (spins,) rad/s, by how much more the corrected gyros show about it.
    """
    order = np.argsort(np.abs(rates))
    steps = np.flatnonzero(np.diff(np.log(np.abs(rates[order]))) > SAME_RATE) + 1
    members = np.split(order, steps)
    sizes = [float(np.mean(np.abs(rates[own]))) for own in members]
    groups = [errors[own] / rates[own] for own in members]
    if len(groups) < 2 or min(group.size for group in groups) < FEWEST_OF_RATE:
        return []
    shown = np.array([np.mean(group) for group in groups])
    sigma = np.array([np.std(group, ddof=1) / np.sqrt(group.size) for group in groups])
    worst = int(np.argmax(np.abs(shown - np.median(shown))))
    nearest = int(np.argsort(np.abs(shown - np.median(shown)))[0])
    off = float(shown[worst] - shown[nearest])
    limit = max(LARGEST_CONTRADICTION * float(np.hypot(sigma[worst], sigma[nearest])), LEAST_CONTRADICTION)
    if abs(off) < limit:
        return []
    which = "" if len(groups) > 2 else ", or these by as much the other way"
    sentence = (
        f"The {groups[worst].size} spins at {np.degrees(sizes[worst]):.4g}°/s show {100 * off:+.2g} % more than those "
        f"at the other rates{which}: the table did not turn as the protocol says, or the gyros saturate or bend there."
    )
    return [sentence]


def known_columns(placements: list[SpunPlacement]) -> np.ndarray:
    """Return (3,) of bool: which columns of the matrix the spun axes tell.

    Raises
    ------
    ObservabilityError
        If the axes are neither the fixture's own nor span it.
    """
    axes = np.array([p.axis for p in placements])
    if np.linalg.matrix_rank(axes, tol=0.1) == 3:
        return np.ones(3, dtype=bool)
    faces = np.argmax(np.abs(axes), axis=1)
    if np.any(np.abs(axes[np.arange(faces.size), faces]) < 1.0 - 1e-6):
        raise ObservabilityError(
            "The unit was spun about fewer than three independent axes, and these are not its own x, y or z: spin it "
            "about x, y and z."
        )
    return np.isin(np.arange(3), faces)
