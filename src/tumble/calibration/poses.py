"""Poses in words: how many differ, what the 26 attitudes are called, which one would tell more."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square, Table, Vector, Vectors, inverted
from tumble.attitude.directions import twenty_six_directions

# Poses closer than this are one pose: placement by hand repeats to a few degrees.
SAME_POSE = np.radians(10.0)


def distinct_poses(directions: Vectors, angle: float = SAME_POSE) -> list[int]:
    """Return the indices of poses that differ from all earlier ones by more than `angle` (rad)."""
    units = directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-300)
    kept: list[int] = []
    for index, unit in enumerate(units):
        if all(float(unit @ units[other]) < np.cos(angle) for other in kept):
            kept.append(index)
    return kept


def describe_direction(up: Vector) -> str:
    """Return what points up in words, after the nearest of the 26 directions.

    Examples
    --------
    >>> import numpy as np
    >>> describe_direction(np.array([0.0, 0.0, -1.0]))
    '-z up'
    >>> describe_direction(np.array([1.0, 1.0, 0.0]))
    'edge between +x and +y up'
    """
    directions = twenty_six_directions()
    nearest = directions[int(np.argmax(directions @ (up / np.linalg.norm(up))))]
    axes = [f"{'+' if value > 0 else '-'}{name}" for name, value in zip("xyz", nearest, strict=True) if value]
    if len(axes) == 1:
        return f"{axes[0]} up"
    if len(axes) == 2:
        return f"edge between {axes[0]} and {axes[1]} up"
    return f"corner of {axes[0]}, {axes[1]} and {axes[2]} up"


def norm_rows(directions: Vectors) -> Table:
    """Return (poses, 9): what a pose's norm says of each unknown, all in units of gravity.

    Unknowns: bias over g (3), relative scale (3), angles yz, zx, zy. At small errors the norm moves
    by u . (bias + diag(u) scale + ...) with u the unit vector up (Hayal 3.88, 3.82, 3.69 linearised).
    """
    x, y, z = directions.T
    return np.column_stack([x, y, z, x * x, y * y, z * z, -x * y, -y * z, x * z])


def most_telling_poses(information: Square, count: int = 2, held: Vectors | None = None) -> list[Vector]:
    """Return the directions up, of the 26, that add most to what is known least.

    Parameters
    ----------
    information : (9, 9) normal matrix over the unknowns of `norm_rows`; may be singular.
    count : how many, chosen one after the other.
    held : (poses, 3) unit vectors of poses that were held already and are not named again.
    """
    directions = twenty_six_directions()
    if held is not None and held.size:
        fresh = np.max(directions @ held.T, axis=1) < np.cos(SAME_POSE)
        directions = directions[fresh] if np.any(fresh) else directions
    rows = norm_rows(directions)
    total = information / max(float(np.trace(information)), 1e-300) * 9.0
    chosen: list[Vector] = []
    for _ in range(count):
        cofactor = inverted(total + 1e-6 * np.eye(9))
        gain: Series = np.einsum("ij,jk,ik->i", rows, cofactor, rows)
        best = int(np.argmax(gain))
        chosen.append(directions[best])
        total = total + np.outer(rows[best], rows[best])
    return chosen
