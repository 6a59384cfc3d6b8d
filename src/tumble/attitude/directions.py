"""The 26 directions of a cube: its faces, edges and corners, each of which can point up."""

from __future__ import annotations

import itertools

import numpy as np

from tumble.arrays import Vectors


def twenty_six_directions() -> Vectors:
    """Return (26, 3) unit vectors: six faces, then twelve edges, then eight corners (Shin and El-Sheimy)."""
    signs = [np.array(s, dtype=float) for s in itertools.product((1, 0, -1), repeat=3) if any(s)]
    signs.sort(key=lambda s: (np.count_nonzero(s), tuple(-s)))
    return np.array([s / np.linalg.norm(s) for s in signs])
