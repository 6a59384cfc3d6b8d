"""What `tumble inspect` prints of rest and motion adds up."""

from __future__ import annotations

import pytest

from tumble.cli.inspect import shares


@pytest.mark.parametrize(
    ("resting", "moving", "shown"),
    [
        (0.46, 0.47, (46, 47, 7)),
        (0.505, 0.495, (50, 50, 0)),
        (0.005, 0.995, (0, 100, 0)),
        (0.0, 0.0, (0, 0, 100)),
        (0.995, 0.005, (100, 0, 0)),
    ],
)
def test_shares_are_whole_and_add_up_to_100(
    resting: float, moving: float, shown: tuple[int, int, int]
) -> None:
    assert shares(resting, moving) == shown
    assert sum(shown) == 100
