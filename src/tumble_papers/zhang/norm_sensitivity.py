"""How much a squared norm moves with each parameter (Zhang et al. 2010, (26) to (38)).

Model: ``raw = K T true + bias`` with T as printed, small angles yz, zy, zx (see
`tumble.sensor.conventions.zhang`). Corrected, the norm of a reading at rest should be gravity, and that
of a rotation's integral the table's angle, in any pose: a parameter shows to the extent to which it moves
that norm. With s the true vector and s^a = T s the vector as the sensing axes see it,

    ∂|s|²/∂k_x  = -2/k_x s_x^a [s_x - yz s_y + (zy + yz zx) s_z]      (29)
    ∂|s|²/∂k_y  = -2/k_y s_y^a (s_y - zx s_z)                         (30), printed with s_x^a: a slip
    ∂|s|²/∂k_z  = -2/k_z s_z^a s_z                                    (30)
    ∂|s|²/∂yz   = -2 s_x^a (s_y - zx s_z)                             (31)
    ∂|s|²/∂zy   =  2 s_x^a s_z                                        (31)
    ∂|s|²/∂zx   = -2 s_z (s_y^a - yz s_x^a)                           (31)
    ∂|s|²/∂b_i  =  as ∂/∂k_i without s_i^a                            (32)

The bias itself is in none of them: it shifts the raw reading and the correction alike.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Table, Vector, Vectors
from tumble.records import dataclass
from tumble.sensor.conventions.zhang import matrix_from_zhang

GROUPS = ("scale", "misalignment", "bias")


@dataclass(frozen=True, slots=True)
class NormSensitivity:
    """Derivatives of the squared norm of the corrected vector, one row a direction.

    Attributes
    ----------
    scale : (n, 3) by the scale factors of x, y, z; (SI unit)² per (raw per SI unit).
    misalignment : (n, 3) by the angles yz, zy, zx; (SI unit)² per rad.
    bias : (n, 3) by the biases of x, y, z; (SI unit)² per raw unit. None for rotations, of which the
        difference of both ways contains no bias.
    """

    scale: Vectors
    misalignment: Vectors
    bias: Vectors | None = None

    def columns(self) -> Table:
        """Return (n, 9): scale, misalignment, bias beside each other; (n, 6) without biases."""
        parts = [self.scale, self.misalignment]
        return np.hstack(parts if self.bias is None else [*parts, self.bias])


def norm_sensitivity(
    directions: Vectors, scale: Vector, angles: Vector, norm: float = 1.0
) -> NormSensitivity:
    """Return what the squared norm of specific force determines in each pose, exactly: (29) to (32).

    Parameters
    ----------
    directions : (n, 3) unit vectors up in the frame accelerometer-x (the paper's p).
    scale : (3,) raw per m/s².
    angles : (3,) yz, zy, zx, rad, as printed in (3).
    norm : gravity, m/s².
    """
    true = norm * directions
    seen = _seen(true, angles)
    yz, zy, zx = angles
    x, y, z = true.T
    towards = np.column_stack([x - yz * y + (zy + yz * zx) * z, y - zx * z, z])
    bias = -2.0 / scale * towards
    misalignment = np.column_stack(
        [-2.0 * seen[:, 0] * towards[:, 1], 2.0 * seen[:, 0] * z, -2.0 * z * (seen[:, 1] - yz * seen[:, 0])]
    )
    return NormSensitivity(bias * seen, misalignment, bias)


def approximate_norm_sensitivity(
    directions: Vectors, scale: Vector, angles: Vector, norm: float = 1.0
) -> NormSensitivity:
    """Return the same with the misalignments neglected beside one: (33) to (35).

    Parameters
    ----------
    directions, scale, angles, norm : as of `norm_sensitivity`. The angles are still in s^a.
    """
    true = norm * directions
    seen = _seen(true, angles)
    misalignment = 2.0 * seen[:, [0, 0, 1]] * true[:, [1, 2, 2]] * np.array([-1.0, 1.0, -1.0])
    bias = -2.0 / scale * true
    return NormSensitivity(bias * seen, misalignment, bias)


def most_sensitive_directions(scale: Vector, angles: Vector, group: str, index: int) -> Vectors:
    """Return the directions in which the squared norm determines most of one parameter, found by search.

    Parameters
    ----------
    scale : (3,) raw per SI unit.
    angles : (3,) yz, zy, zx, rad, as printed.
    group : one of `GROUPS`.
    index : x, y, z of scale and bias; yz, zy, zx of misalignment.

    Returns
    -------
    directions : (n, 3) unit vectors: every place of the sphere that is as good as the best to 1 in 100.

    Raises
    ------
    ValueError
        If there is no such group.
    """
    from scipy.optimize import minimize

    from tumble.attitude.directions import twenty_six_directions

    if group not in GROUPS:
        raise ValueError(f"{group!r} is none of {', '.join(GROUPS)}")

    def lost(vector: Series) -> float:
        up = vector / np.linalg.norm(vector)
        found: Vectors = getattr(norm_sensitivity(up[None], scale, angles), group)
        return -abs(float(found[0, index])) / size

    size = 1.0
    size = max(-lost(up) for up in twenty_six_directions())
    ends = [minimize(lost, up, method="BFGS", options={"gtol": 1e-9}) for up in twenty_six_directions()]
    best = min(float(end.fun) for end in ends)
    kept: list[Series] = []
    for end in sorted(ends, key=lambda end: float(end.fun)):
        up = end.x / np.linalg.norm(end.x)
        # Two maxima are 90° apart at least; the search stops some 1e-5 rad short.
        if float(end.fun) < 0.99 * best and all(float(up @ other) < 0.9 for other in kept):
            kept.append(up)
    return np.array(kept)


def _seen(true: Vectors, angles: Vector) -> Vectors:
    """The vectors as the sensing axes see them: T s, (28)."""
    return true @ matrix_from_zhang(np.ones(3), angles, "small-angle").T
