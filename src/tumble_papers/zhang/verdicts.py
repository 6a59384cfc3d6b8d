"""Could a printed error or scatter be one of ours? The distributions that answer."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Vectors
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED
from tumble_papers.zhang.turntable_simulation import norths

PRINTED_RUNS = 500
# One true row in a thousand is outside by chance; all of the paper's rows are some two hundred.
CHANCE = 0.001
# Fewer runs have no scatter to speak of: nothing is judged.
ENOUGH = 20
TOO_FEW = f"Fewer than {ENOUGH} runs have no scatter to judge by: say --repetitions 500."
# Choices of headings that the range of the gyro biases is taken over.
HEADINGS = 4000


def scatter_factors(runs: int) -> tuple[float, float]:
    """Return between which multiples of ours a printed standard deviation of 500 runs lies (F-distribution).

    Parameters
    ----------
    runs : how many ours comes from.
    """
    from scipy.special import fdtri

    freedom = max(runs - 1, 1)
    low = fdtri(PRINTED_RUNS - 1, freedom, 0.5 * CHANCE)
    high = fdtri(PRINTED_RUNS - 1, freedom, 1.0 - 0.5 * CHANCE)
    return float(np.sqrt(low)), float(np.sqrt(high))


def error_factor(runs: int) -> float:
    """Return how many of our standard deviations one printed error may be off (Student's t).

    Parameters
    ----------
    runs : how many ours comes from.
    """
    from scipy.special import stdtrit

    return float(stdtrit(max(runs - 1, 1), 1.0 - 0.5 * CHANCE))


def standard_deviation(differences: AnyArray) -> AnyArray:
    """Return the standard deviation over the runs; of one run, how far it is off.

    Parameters
    ----------
    differences : (runs, ...) from the truth.
    """
    if len(differences) == 1:
        return np.abs(differences[0])
    return np.asarray(np.std(differences, axis=0, ddof=1), dtype=np.float64)


def half_digit(printed: float, digits: int) -> float:
    """Return half a unit of the last digit that is printed, so many behind the point."""
    return 0.5 * 10.0**-digits


def judge_scatter(printed: float, low: float, high: float, ours: float, runs: int) -> tuple[str, str]:
    """Return verdict and reason of a printed standard deviation.

    Parameters
    ----------
    printed, low, high, ours : the printed one, the range that it may lie in, and ours.
    runs : how many ours comes from.
    """
    if runs < ENOUGH:
        return UNJUDGED, ""
    if low <= printed <= high:
        return INSIDE, ""
    return OUTSIDE, f"{printed / ours:.2f} times ours"


def judge_error(printed: float, sigma: float, runs: int, rounding: float = 0.0) -> tuple[str, str]:
    """Return verdict and reason of one printed error.

    Parameters
    ----------
    printed, sigma : the error, and the standard deviation of ours.
    runs : how many ours comes from.
    rounding : that the printed digits leave open.
    """
    if runs < ENOUGH:
        return UNJUDGED, ""
    if abs(printed) <= error_factor(runs) * sigma + rounding:
        return INSIDE, ""
    return OUTSIDE, f"{abs(printed) / sigma:.1f} standard deviations"


def heading_factors(up: Vectors, rng: np.random.Generator) -> AnyArray:
    """Return (2, 3) low and high scatter of the gyro biases over 99 % of choices of headings, relative to ours.

    The paper prints no headings. Each choice turns every attitude about the vertical by an angle at random;
    the scatter is that of (25)'s least squares over the dwell's noise, to the first order.

    Parameters
    ----------
    up : (n, 3) as in `Setting`.
    rng : source of the headings.
    """
    from tumble_papers.zhang.turntable_simulation import LATITUDE

    north = norths(up)
    east = np.cross(north, up)
    heading = rng.uniform(0.0, 2.0 * np.pi, (HEADINGS, len(up), 1))
    heading[0] = 0.0
    earth = np.cos(LATITUDE) * (np.cos(heading) * north + np.sin(heading) * east) + np.sin(LATITUDE) * up
    design = earth - earth.mean(axis=1, keepdims=True)
    cofactor: AnyArray = np.asarray(np.linalg.inv(np.swapaxes(design, 1, 2) @ design), dtype=np.float64)
    sigma = np.sqrt(np.diagonal(cofactor, axis1=1, axis2=2))
    return np.stack([np.quantile(sigma, 0.005, axis=0), np.quantile(sigma, 0.995, axis=0)]) / sigma[0]
