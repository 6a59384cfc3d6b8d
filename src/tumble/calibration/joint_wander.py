"""Biases that wander (1/f noise) as cosines over a stretch of time, each with the variance of its frequencies."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series

# Cosines over a rotation in which a bias wanders, at least, a revolution, and at most; what is faster is as good
# as white. Gravity goes round once a revolution, which is two of them for its cosine; its sine takes many, and what
# they left out of it would seem free of wander.
FEWEST_MODES, MODES_A_REVOLUTION, MOST_MODES = 8, 6, 32


def mode_count(windows: int, revolutions: float) -> int:
    """Return how many cosines stand for a wander over so many windows in which a table goes round so often."""
    return min(max(FEWEST_MODES, int(np.ceil(MODES_A_REVOLUTION * revolutions))), MOST_MODES, windows - 1)


def wander_basis(places: Series, count: int) -> tuple[AnyArray, Series]:
    """Return cosines (places, count) over a rotation, and the variance of each one's amplitude by 1/f noise.

    Parameters
    ----------
    places : (places,) of the rotation, 0 to 1.
    count : how many.

    Notes
    -----
    In units of the wander's density per ``ln f``; cosine n has the frequencies from n - 1/2 to n + 1/2 half
    periods in the rotation.
    """
    number = np.arange(1, count + 1)
    return np.cos(np.pi * number * places[:, None]), 2.0 * np.log((number + 0.5) / (number - 0.5))


def faster_variance(windows: int, count: int) -> float:
    """Return the variance of a window's mean by what wanders faster than `count` cosines, down to the window."""
    return max(float(np.log(windows / (count + 0.5))), 0.0)
