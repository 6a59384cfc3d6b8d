"""Could the printed numbers of a field calibration be one of ours? The rules, and the words for them."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series

# With one unit alone there is no range: two sigma0 of so many degrees of freedom differ by less than their
# F-distribution allows in 99 % of cases, and a unit's wander lies within a factor of five of the middle one.
ONE_RUN, ONE_RUN_SHARE = 5.0, 0.995
# An estimate so many times farther from zero than sheet and sigma together allow wants a word.
FAR = 3.0
# It is implausible if fewer of our units than this share are as far off.
RARE = 0.005


def one_run_factor(freedom: int) -> float:
    """Return the factor within which the sigmas of two runs are alike.

    Parameters
    ----------
    freedom : degrees of freedom of each.
    """
    from scipy.special import fdtri

    return ONE_RUN * float(np.sqrt(fdtri(freedom, freedom, ONE_RUN_SHARE)))


def criterion(units: int, freedom: int) -> str:
    """Return what a verdict means, in a sentence.

    Parameters
    ----------
    units : how many were simulated.
    freedom : degrees of freedom of each adjustment.
    """
    if units > 1:
        return (
            f"inside: the thesis' sigma lies between the lowest and the highest that {units} "
            f"simulated units state. Its estimate is within {FAR:g} times sheet and sigma together of "
            f"zero, or at least {100 * RARE:g} % of ours are as far off"
        )
    degrees = "degree" if freedom == 1 else "degrees"
    factor = float(f"{one_run_factor(freedom):.2g}")
    return (
        f"inside: the thesis' sigma is within a factor of {factor:g} of what one simulated unit "
        f"states. Two runs with {freedom} {degrees} of freedom may differ as much (--repetitions 500 "
        "gives the range itself)"
    )


def judge_sigma(printed: float, sigma: Series, cofactor: float, freedom: int) -> tuple[bool, str]:
    """Judge a printed sigma; return whether it could be one of ours, and why not.

    Parameters
    ----------
    printed : what the thesis states.
    sigma : what our units state, in the same unit.
    cofactor : the same at a sigma0 of one, typically.
    freedom : degrees of freedom.
    """
    ratio = printed / float(np.median(sigma))
    factor = one_run_factor(freedom) if sigma.size == 1 else 0.0
    if 1.0 / factor <= ratio <= factor if factor else sigma.min() <= printed <= sigma.max():
        return True, ""
    return False, (
        f"its sigma is {ratio:.2g} times the median of ours, of a sigma0, not printed, of about "
        f"{printed / cofactor:.2g}: {_why(ratio, printed / cofactor)}"
    )


def _why(ratio: float, sigma0: float) -> str:
    if ratio > 1.0:
        return "biases wandered more between its attitudes than in ours, or its attitudes differed from ours"
    if sigma0 > 1.0:
        return "biases wandered less between its attitudes than in ours, or its attitudes differed from ours"
    return "its unit was quieter than the sheet's maximum, sigma0 small by luck, or its attitudes differed from ours"


def judge_estimate(far: float, as_far: float, units: int) -> tuple[bool, str]:
    """Judge a printed estimate; return whether it is plausible, and a word where it is far from zero.

    Parameters
    ----------
    far : how many times the sheet's and its own sigma together it is from zero.
    as_far : the share of our units that are as far off.
    units : how many there are.
    """
    if far <= FAR:
        return True, ""
    words = f"its estimate is {far:.2g} times sheet and sigma together from zero"
    if units > 1:
        words += f"; so far off are {100 * as_far:.2g} % of ours"
    # Fewer units than twice its reciprocal cannot tell that something is so rare.
    return units * RARE < 2.0 or as_far >= RARE, words
