"""An error budget as plain data: totals, groups, and the drawn errors beside it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tumble.design.error_budget import ErrorBudget, ErrorSource, ParameterGroup

TABLE = np.array([[3.0, 4.0, 0.0], [0.0, 1.0, 0.0], [5.0, 0.0, 12.0]])


def budget() -> ErrorBudget:
    return ErrorBudget(
        procedure="any",
        parameters=("a", "b", "c"),
        groups=(
            ParameterGroup("one", "one", "the first two", 0, 2, "1", "ppm", 1e6),
            ParameterGroup("two", "two", "the last", 2, 3, "rad", "µrad", 1e6),
        ),
        sources=(
            ErrorSource("noise", "of the sensors", 0.1, "u", "sensors"),
            ErrorSource("lean", "of the fixture", 1e-3, "rad", "fixture"),
            ErrorSource("gravity", "of the site", 1e-4, "m/s²", "site"),
        ),
        contributions=TABLE,
        drawn=None,
        settings={"seconds": 10.0},
        remarks=("One sigma.",),
    )


def test_squares_of_the_sources_add_up_to_the_square_of_the_total() -> None:
    np.testing.assert_allclose(budget().totals, [5.0, 1.0, 13.0])


def test_a_group_is_the_rms_of_its_parameters_of_all_sources_or_some() -> None:
    np.testing.assert_allclose(budget().group_rms(), [np.sqrt(13.0), 13.0])
    np.testing.assert_allclose(budget().group_rms(["fixture", "site"]), [np.sqrt(8.5), 12.0])
    np.testing.assert_allclose(budget().group_contributions()[0], [np.sqrt(4.5), np.sqrt(8.5), 0.0])


def test_main_sources_are_the_largest_shares_of_the_variance() -> None:
    found = [(source.name, share) for source, share in budget().main_sources(1)]
    assert [name for name, _ in found] == ["gravity", "noise"]
    assert [share for _, share in found] == pytest.approx([144 / 169, 25 / 169])


def test_drawn_errors_stand_beside_and_contradict_where_they_are_others() -> None:
    """20,000 draws: an rms is known to 0.5 %; the second group is drawn twice as large."""
    errors = np.random.default_rng(1).standard_normal((20_000, 3)) * np.array([5.0, 1.0, 26.0])
    both = budget().with_drawn(errors, "normal numbers")
    assert both.drawn is not None
    assert both.drawn.rms == pytest.approx([5.0, 1.0, 26.0], rel=0.03)
    assert both.drawn.rms_sigma / both.drawn.rms == pytest.approx(np.full(3, 1 / 200), rel=0.05)
    assert both.disagreements() == ["two"]
    assert budget().disagreements() == []


@pytest.mark.parametrize("shape", [(1, 3), (5, 2)])
def test_errors_of_other_parameters_or_of_one_run_are_refused(shape: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="no errors of 3 parameters"):
        budget().with_drawn(np.zeros(shape), "")


def test_everything_is_in_the_document_and_the_document_is_json() -> None:
    document = json.loads(json.dumps(budget().to_dict(), allow_nan=False))
    assert [p["name"] for p in document["parameters"]] == ["a", "b", "c"]
    assert document["parameters"][2]["group"] == "two"
    assert document["parameters"][2]["by_source"] == {"noise": 5.0, "lean": 0.0, "gravity": 12.0}
    assert document["parameters"][2]["standard_uncertainty"] == 13.0
    assert document["settings"] == {"seconds": 10.0}
    assert document["monte_carlo"] is None
