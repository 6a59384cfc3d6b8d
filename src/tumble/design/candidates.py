"""What a test may be made of: candidates, each with what it tells and what it costs, and where poses can be.

A candidate is anything that can be visited: a pose at rest, a turn, a sequence on a table. The searches of
`selection` see its information alone, so that a joint adjustment's information of any planned motion serves
as well as the norm of a pose.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, Vector, Vectors
from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.poses import describe_direction, norm_rows
from tumble.errors import UsageError
from tumble.protocol.steps import Step
from tumble.records import dataclass

# Unknowns of `norm_rows` in the order scale, misalignment yz, zy, zx, bias; its angles have the other sign.
_ORDER = (3, 4, 5, 6, 8, 7, 0, 1, 2)
PARAMETERS = (
    "scale factor x",
    "scale factor y",
    "scale factor z",
    "misalignment yz",
    "misalignment zy",
    "misalignment zx",
    "bias x",
    "bias y",
    "bias z",
)
"""What norms of poses tell: relative scale factors, angles in rad, biases over gravity."""
GROUPS = {"scale": (0, 1, 2), "misalignment": (3, 4, 5), "bias": (6, 7, 8)}
# A direction that another is within this of is the same; rad.
ALIKE = 1e-6
# Angles of a two-axis fixture: more than this and the steps are finer than they need to be.
MOST_CANDIDATES = 20_000


@dataclass(frozen=True, slots=True)
class Candidate:
    """One thing that a test may be made of.

    Attributes
    ----------
    name : as an operator is told.
    rows : (k, parameters) what one visit observes, each row over its standard uncertainty: ``rows' rows`` is the
        information of a visit (or of a unit of dwell time, where times are free).
    cost_seconds : of a visit beside the dwell: turning there.
    up_b : (3,) what points up, for a pose.
    step : of a protocol, for anything else.
    """

    name: str
    rows: Table
    cost_seconds: float = 0.0
    up_b: Vector | None = None
    step: Step | None = None

    @staticmethod
    def from_information(
        name: str,
        information: Square,
        cost_seconds: float = 0.0,
        *,
        up_b: Vector | None = None,
        step: Step | None = None,
    ) -> Candidate:
        """Return the candidate whose information (parameters, parameters) is known, from any adjustment.

        Parameters
        ----------
        name, cost_seconds, up_b, step : as of the class.
        information : symmetric, positive semi-definite.
        """
        values, vectors = np.linalg.eigh(information)
        told = values > 1e-14 * max(float(values[-1]), 0.0)
        rows = (vectors[:, told] * np.sqrt(values[told])).T
        return Candidate(name, np.ascontiguousarray(rows), cost_seconds, up_b, step)

    @property
    def information(self) -> Square:
        """(parameters, parameters) of a visit."""
        return np.asarray(self.rows.T @ self.rows, dtype=np.float64)


def stacked_rows(candidates: Sequence[Candidate]) -> AnyArray:
    """Return (candidates, k, parameters): all rows, short ones filled up with zeros.

    Parameters
    ----------
    candidates : with the same parameters.
    """
    longest = max(candidate.rows.shape[0] for candidate in candidates)
    rows = np.zeros((len(candidates), longest, candidates[0].rows.shape[1]))
    for place, candidate in zip(rows, candidates, strict=True):
        place[: candidate.rows.shape[0]] = candidate.rows
    return rows


def pose_rows(directions: Vectors) -> Table:
    """Return (poses, 9): what a pose's norm, in gravity, says of each of `PARAMETERS`.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    """
    rows = norm_rows(directions)[:, _ORDER]
    rows[:, 3:6] *= -1.0
    return rows


def pose_candidates(
    directions: Vectors, sigma: float = 1.0, cost_seconds: float = 0.0, names: Sequence[str] | None = None
) -> list[Candidate]:
    """Return a candidate for each pose at rest, of which the norm of the specific force is told.

    Parameters
    ----------
    directions : (n, 3) unit vectors up.
    sigma : of a visit's norm, over gravity.
    cost_seconds : of turning there.
    names : of the poses; None takes the nearest face, edge or corner.
    """
    rows = pose_rows(directions) / sigma
    words = [describe_direction(up) for up in directions] if names is None else names
    return [
        Candidate(name, row[None], cost_seconds, up)
        for name, row, up in zip(words, rows, directions, strict=True)
    ]


def prediction_weights() -> Square:
    """Return (9, 9): the mean over all directions of a corrected specific force's squared error, over gravity.

    An error e of `PARAMETERS` makes the corrected vector in direction u wrong by ``B(u) e``; this is the mean of
    ``B' B``, exact by the moments of the sphere: u_i u_j have the mean 1/3, u_i alone 0.
    """
    weights = np.zeros((9, 9))
    # x sees scale and bias; y is turned by yz about z and sees x of it; z sees x by zy and y by zx.
    for index in range(9):
        weights[index, index] = 1.0 / 3.0 if index < 6 else 1.0
    return weights


def sphere_grid(count: int = 400) -> Vectors:
    """Return the 26 directions of a cube and so many others spread evenly (a spiral by the golden angle).

    Parameters
    ----------
    count : beside the 26.
    """
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    flat = np.sqrt(1.0 - height**2)
    return np.vstack(
        [twenty_six_directions(), np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])]
    )


@dataclass(frozen=True, slots=True)
class AxisRange:
    """The angles that an axis of a fixture reaches, rad; a step of zero is for every angle between the limits."""

    low: float
    high: float
    step: float

    def angles(self) -> Series:
        """Return every angle that it stops at.

        Raises
        ------
        UsageError
            If the limits are the wrong way round, or the step is not positive or leaves too many stops.
        """
        if not (
            np.isfinite([self.low, self.high, self.step]).all() and self.low <= self.high and self.step > 0.0
        ):
            raise UsageError(
                "An axis is given as MIN,MAX,STEP in degrees, with MIN at most MAX and a positive STEP: "
                f"not {np.degrees(self.low):g},{np.degrees(self.high):g},{np.degrees(self.step):g}."
            )
        count = int(np.floor((self.high - self.low) / self.step + 1e-9)) + 1
        if count > MOST_CANDIDATES:
            raise UsageError(
                f"An axis with {count} stops is finer than any search needs: give a larger step."
            )
        return np.asarray(self.low + self.step * np.arange(count), dtype=np.float64)


def two_axis_poses(outer: AxisRange, inner: AxisRange) -> tuple[Vectors, list[tuple[float, float]]]:
    """Return the directions that a two-axis fixture brings up, each once, and the angles that do it.

    The outer axis lies level and is the unit's y at inner angle zero; the inner axis is carried by it, at right
    angles, and is the unit's z, which points down at outer angle zero (as `tumble.simulation`'s fixture).

    Parameters
    ----------
    outer, inner : the axes' limits and steps.

    Returns
    -------
    directions : (n, 3) unit vectors up in b.
    angles : outer and inner, rad, for each; the first that reaches it.

    Raises
    ------
    UsageError
        If there are too many stops.
    """
    first, second = outer.angles(), inner.angles()
    if first.size * second.size > MOST_CANDIDATES:
        raise UsageError(
            f"{first.size} stops of the outer axis by {second.size} of the inner are {first.size * second.size} poses, "
            f"and at most {MOST_CANDIDATES:,} are searched: give larger steps."
        )
    found: dict[tuple[float, ...], tuple[float, float]] = {}
    for alpha, beta in itertools.product(first.tolist(), second.tolist()):
        up = up_of_angles(alpha, beta)
        found.setdefault(tuple((np.round(up, 9) + 0.0).tolist()), (alpha, beta))
    directions = np.array([up_of_angles(*angles) for angles in found.values()])
    return directions, list(found.values())


def up_of_angles(outer: float, inner: float) -> Vector:
    """Return what points up in b when a two-axis fixture stands at these angles, rad (see `two_axis_poses`).

    Parameters
    ----------
    outer, inner : rad, right-handed about y and z of the fixture, whose z points down.
    """
    # b is turned by R_y(outer) R_z(inner) against north-east-down, where up is -z.
    sine, cosine = float(np.sin(outer)), float(np.cos(outer))
    return np.array([sine * float(np.cos(inner)), -sine * float(np.sin(inner)), -cosine])
