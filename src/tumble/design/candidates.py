"""Poses as candidates of a test: the nine parameters that norms at rest tell, and what each pose says of them."""

from __future__ import annotations

from tumble.arrays import Table, Vectors
from tumble.calibration.poses import norm_rows

# Unknowns of `norm_rows` in the order scale, misalignment yz, zy, zx, bias; its angles have the other sign.
_ORDER = (3, 4, 5, 6, 8, 7, 0, 1, 2)
PARAMETERS = (
    *(f"scale factor {axis}" for axis in "xyz"),
    *(f"misalignment {angle}" for angle in ("yz", "zy", "zx")),
    *(f"bias {axis}" for axis in "xyz"),
)
"""What norms of poses tell: relative scale factors, angles in rad, biases over gravity."""
GROUPS = {"scale": (0, 1, 2), "misalignment": (3, 4, 5), "bias": (6, 7, 8)}


def pose_rows(directions: Vectors) -> Table:
    """Return (poses, 9): what a pose's norm, in gravity, says of each of `PARAMETERS`.

    Parameters
    ----------
    directions : (poses, 3) unit vectors up.
    """
    rows = norm_rows(directions)[:, _ORDER]
    rows[:, 3:6] *= -1.0
    return rows
