"""Where a function changes its sign, found to what was asked for and in few steps."""

import math
from collections.abc import Callable

import pytest

from tumble.estimation.crossing import crossing


def _cube(x: float) -> float:
    return x**3 - 2.0


def _falling(x: float) -> float:
    return math.exp(-x) - 0.1


def _step(x: float) -> float:
    return 1.0 if x > 0.3 else -1.0


def _flat_first(x: float) -> float:
    return math.log(1e12 / (1.0 + math.exp(2.0 * x)))


@pytest.mark.parametrize(
    ("function", "low", "high", "answer"),
    [
        (_cube, 0.0, 5.0, 2.0 ** (1.0 / 3.0)),
        (_falling, 50.0, -2.0, math.log(10.0)),
        (_step, -4.0, 4.0, 0.3),
        (_flat_first, -20.0, 40.0, 0.5 * math.log(1e12)),
    ],
)
def test_it_is_where_the_sign_changes(
    function: Callable[[float], float], low: float, high: float, answer: float
) -> None:
    calls: list[float] = []

    def counted(x: float) -> float:
        calls.append(x)
        return function(x)

    found = crossing(counted, low, high, (function(low), function(high)), 1e-6)
    assert abs(found - answer) < 1e-6
    assert len(calls) <= math.log2(abs(high - low) / 1e-6) + 2


def test_the_search_ends_where_a_function_is_no_number() -> None:
    calls: list[float] = []

    def nowhere(x: float) -> float:
        calls.append(x)
        return math.nan

    crossing(nowhere, 0.0, 1.0, (-1.0, 1.0), 1e-9)
    assert len(calls) <= 100
