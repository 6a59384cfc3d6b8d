"""Zhang's navigation tests on simulated units: exact without errors, and each method's share of the metres."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.reproduction.outcome import OUTSIDE, UNJUDGED
from tumble_papers.catalogue import ITEMS
from tumble_papers.zhang.navigation import (
    ALIGNED,
    DURATION,
    JOINT,
    PRINTED,
    PROPOSED,
    TRADITIONAL,
    TRUE,
    calibrate_units,
    measured,
    navigate_test,
    run_test,
    true_test,
)
from tumble_papers.zhang.turntable import table_setting

UNITS = 1


@pytest.mark.parametrize("name", ["I", "II"])
def test_without_noise_and_with_the_true_parameters_it_stays_where_it_is(name: str) -> None:
    """A metre in 8,000 s, against hundreds of any unit: what samples of a tenth of a second leave of the turns."""
    setting = table_setting("6")
    raw = measured(true_test(name), setting.unit, setting, None)
    time, errors = navigate_test(raw, setting.unit.model)
    assert time[-1] == pytest.approx(DURATION[name] - ALIGNED)
    assert np.abs(errors[:, :2]).max() < 1.0


def test_each_method_is_calibrated_on_its_own_and_is_off_by_its_own() -> None:
    found = calibrate_units(UNITS, 3)
    truth = found[TRUE][0].parameters()
    assert set(found) == {TRADITIONAL, PROPOSED, JOINT, TRUE, PRINTED}
    for method in (TRADITIONAL, PROPOSED, JOINT):
        # scale factors of the accelerometers: some ppm of each
        off = found[method][0].parameters()[:3] / truth[:3] - 1.0
        assert 0.0 < np.abs(off).max() < 5e-5
    one, other = (found[method][0].parameters() for method in (PROPOSED, TRADITIONAL))
    assert np.all(one != other)


def test_positions_of_all_methods_stand_beside_what_noise_alone_does() -> None:
    runs = run_test("II", UNITS, 3)
    assert set(runs.errors) == {TRADITIONAL, PROPOSED, JOINT, TRUE, PRINTED}
    for errors in runs.errors.values():
        assert errors.shape == (UNITS, len(runs.time))
        # from a few metres to some kilometres in 2.2 hours: a navigation-grade unit
        assert np.all(errors[:, -1] < 2e4)
    # 100 µg/√Hz and 0.03 °/h/√Hz: σ N √(t/2)/ω and R N √t are 50 and 90 m after 7,800 s
    assert 10.0 < runs.rms(TRUE).max() < 500.0
    outcome = ITEMS["zhang-figure-10"].run(UNITS, 3)
    assert all(row.verdict in ("", UNJUDGED) for row in outcome.rows)
    assert outcome.rows[0].cells[1] == pytest.approx(np.median(runs.rms(TRADITIONAL)))
    assert len(outcome.plots[0].curves) == 5
    assert OUTSIDE not in {row.verdict for row in outcome.rows}


def test_the_pictures_of_measurements_show_gravity_and_every_turn() -> None:
    force = ITEMS["zhang-figure-5"].run(1, 0).plots[0]
    for curve in force.curves:
        assert curve.low.min() == pytest.approx(-1.0, abs=0.01)
    rate = ITEMS["zhang-figure-9"].run(1, 0).plots[0].curves[2]
    # three quarter turns of 12 s: 14 °/s at most
    assert np.count_nonzero(rate.high > 5.0) in range(3, 7)
