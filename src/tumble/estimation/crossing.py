"""Where a function changes its sign."""

from __future__ import annotations

from collections.abc import Callable


def crossing(
    function: Callable[[float], float], low: float, high: float, ends: tuple[float, float], tolerance: float
) -> float:
    """Return where a function is zero between two places.

    Parameters
    ----------
    function : continuous.
    low, high : where its signs differ.
    ends : its values there.
    tolerance : by which the place may be off.

    Notes
    -----
    T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm, Adv. Eng. Softw. 28 (1997) 145: the parabola through
    three values where it rises throughout, half the stretch elsewhere.
    """
    a, b, (of_a, of_b) = low, high, ends
    share, best = 0.5, low
    # A tenth of the steps is enough; a function that is no number somewhere would have no end.
    for _ in range(100):
        x = a + share * (b - a)
        of_x = function(x)
        if (of_x > 0.0) == (of_a > 0.0):
            c, of_c = a, of_a
        else:
            c, of_c, b, of_b = b, of_b, a, of_a
        a, of_a = x, of_x
        best = a if abs(of_a) < abs(of_b) else b
        least = tolerance / abs(b - a)
        if of_x == 0.0 or least > 0.5:
            return best
        along, rise = (a - b) / (c - b), (of_a - of_b) / (of_c - of_b)
        share = 0.5
        if rise**2 < along and (1.0 - rise) ** 2 < 1.0 - along:
            share = of_a / (of_b - of_a) * of_c / (of_b - of_c)
            share += (c - a) / (b - a) * of_a / (of_c - of_a) * of_b / (of_c - of_b)
        share = min(max(share, least), 1.0 - least)
    return best
