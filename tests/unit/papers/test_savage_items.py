"""What the items of Savage (2018) say, by their rows: computed, and as worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Outcome, Row
from tumble_papers.catalogue import ITEMS
from tumble_papers.savage.formulas import (
    evaluated,
)
from tumble_papers.savage.section_9 import (
    resampled,
    to_digits,
)


def row(outcome: Outcome, beginning: str) -> Row:
    (found,) = [r for r in outcome.rows if r.label.startswith(beginning)]
    return found


def test_table_1_starts_where_its_angles_lead_and_its_outer_axis_goes_the_other_way_where_y_is_against_it() -> (
    None
):
    outcome = ITEMS["savage-1"].run(1, 0)
    assert outcome.counts == (16, 16)
    outer = {r.label: r.cells[5] for r in outcome.rows}
    assert outer["sequence 4"] == "0, 180, 180, 0, 0"
    assert outer["sequence 6"] == "-90, 90, 90, 270, 270, 90, 90, -90, -90"
    assert str(outer["sequence 13"]).endswith("-180")
    assert str(outer["sequence 14"]).endswith("-180")
    six = row(outcome, "sequence 6")
    assert six.cells[1] == "x, y"
    assert six.verdict == UNJUDGED


def test_table_2_s_forty_is_four_g() -> None:
    outcome = ITEMS["savage-2"].run(1, 0)
    assert outcome.counts == (1, 2)
    assert row(outcome, "gyro scale").cells == (
        None,
        "2 π g",
        pytest.approx(2 * np.pi),
        pytest.approx(2 * np.pi),
    )


def test_of_12_the_signs_of_the_bias_in_sequence_9_are_wrong_and_no_others() -> None:
    outcome = ITEMS["savage-12"].run(1, 0)
    assert [r.label for r in outcome.rows if r.verdict == OUTSIDE] == [
        "down, start, 9: λ x",
        "down, end, 9: λ x",
    ]
    assert evaluated("-2 π g", 10.0) == pytest.approx(-20 * np.pi)
    assert evaluated("-1 g", 10.0) == -10.0


def test_section_9_1_is_what_its_formulas_give() -> None:
    outcome = ITEMS["savage-9.1"].run(30, 0)
    # 0.002 / (57.3 · 60) · √40 = 3.68e-6; 3.7 / 2π, / 4, / 2; 0.41 of 0.5″ over the same
    for beginning, said in (("random walk: tilt", 3.7), ("gyro scale", 0.59), ("pulses: tilt", 0.99)):
        assert row(outcome, beginning).cells[0] == said
    assert outcome.counts[0] == outcome.counts[1] == 13
    # N √(turning + 2/3 of 10 s) of 360°: 0.5818 µrad/√s · √12.95 = 2.094 µrad
    assert row(outcome, "gyro scale").cells[2] == pytest.approx(2.094 / (2 * np.pi), rel=0.01)


def test_an_average_of_averages_is_noisier_and_minds_pulses_less() -> None:
    outcome = ITEMS["savage-9.2"].run(40, 0)
    # a triangle of weights: √(4/3) = 1.155
    assert float(str(row(outcome, "random noise").cells[1])) == pytest.approx(1.155, abs=0.06)
    assert row(outcome, "random noise").verdict == OUTSIDE
    assert row(outcome, "pulses: average").verdict == INSIDE


def test_section_9_3_bounds_what_the_earth_rate_does() -> None:
    outcome = ITEMS["savage-9.3"].run(24, 0)
    assert outcome.counts[0] == outcome.counts[1] == 8


def test_of_22_the_signs_that_are_wrong_are_these() -> None:
    outcome = ITEMS["savage-9.4"].run(8, 0)
    wrong = {r.label.partition(", ")[0] for r in outcome.rows if r.verdict == OUTSIDE}
    assert wrong == {
        *("κ yy + κ yyy by κ y", "κ xx + κ xxx by κ x", "κ zz + κ zzz by κ z", "υ yz by κ x"),
        "λ z/g + (π/2)(κ xx + κ xxx) by κ x",
        *("λ y/g + υ yz by κ x", "λ y/g + υ yz by κ y", "λ y/g + υ yz by κ z"),
        *("λ x/g + υ zx by κ x", "λ x/g + υ zx by κ z"),
        "example: λ y/g + υ yz",
    }
    # 4.85e-7 · (1 + 5) = 2.91e-6, the other way
    assert row(outcome, "example: λ y").cells[1:] == (pytest.approx(-2.91), pytest.approx(-2.91, abs=0.01))


@pytest.mark.parametrize(
    ("printed", "value", "same"),
    [(3.7, 3.679, True), (1.8, 1.84, True), (0.93, 0.925, True), (0.93, 0.95, False), (2.9, 3.1, False)],
)
def test_digits_are_rounded_or_cut_off(printed: float, value: float, same: bool) -> None:
    assert to_digits(printed, value) is same


def test_a_bootstrap_interval_has_the_width_of_the_statistic_s_scatter() -> None:
    rng = np.random.default_rng(0)
    values = rng.standard_normal(400)
    low, high = resampled(values, lambda drawn: np.mean(drawn, axis=-1), rng)
    # 2 · 1.96 / √400
    assert high - low == pytest.approx(0.196, rel=0.15)
    assert low < np.mean(values) < high
