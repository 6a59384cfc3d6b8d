"""One number for three axes, also where an axis does not show the term."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from tumble.noise.triads import triad_terms


def axis(name: str, value: float | None, sigma: float = 0.0, limit: float = 0.0) -> SimpleNamespace:
    term = None if value is None else SimpleNamespace(value=value, sigma=sigma)
    return SimpleNamespace(
        name=name,
        random_walk=None,
        unseen={"B": limit} if value is None else {},
        term=lambda letter: term if letter == "B" else None,
    )


def test_an_axis_that_does_not_show_the_term_makes_the_mean_uncertain_by_its_limit() -> None:
    (found,) = triad_terms([axis("gx", 3.0, 0.1), axis("gy", 4.0, 0.2), axis("gz", None, limit=6.0)])
    assert found.mean == pytest.approx((25.0 / 3.0) ** 0.5)
    # squares: ± 0.6, ± 1.6 and, up to 36 at 95 %, ± 18; the mean's derivative by their sum is 1 / (6 mean)
    assert found.mean_sigma == pytest.approx((0.6**2 + 1.6**2 + 18.0**2) ** 0.5 / (6.0 * found.mean))
    assert found.seen == ("gx", "gy")
    assert (found.worst_axis, found.worst_sigma) == ("gy", 0.2)


def test_of_axes_that_all_show_it_the_mean_s_uncertainty_is_theirs() -> None:
    (found,) = triad_terms([axis("gx", 3.0, 0.1), axis("gy", 4.0, 0.2), axis("gz", 12.0, 0.3)])
    assert found.mean == pytest.approx(13.0 / 3.0**0.5)
    assert found.mean_sigma == pytest.approx((0.3**2 + 0.8**2 + 3.6**2) ** 0.5 / (3.0 * found.mean))
