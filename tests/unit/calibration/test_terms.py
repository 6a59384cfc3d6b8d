"""Every optional term: its record says what the estimator, the result and the documentation need."""

from typing import Any

import numpy as np
import pytest

from tumble.calibration.equations.imu_unknowns import (
    LAYOUT,
    imu_unknowns,
    name_plate,
    raw_force,
    raw_rate,
    term_unknowns,
    terms_prior,
)
from tumble.calibration.terms import TERMS
from tumble.calibration.terms.term import Term
from tumble.sensor import CURVES, Triad

SCALE = np.array([0.9, 1.1, 1.05])
MATRIX = np.array([[2.0, 0.02, -0.05], [0.07, 1.8, 0.03], [-0.04, 0.06, 2.2]])
TRUE = np.array([[3.0, -7.0, 5.0], [-9.0, 2.0, 4.0], [1.0, 6.0, -8.0]])


@pytest.mark.parametrize("term", TERMS.values(), ids=TERMS)
class TestTerm:
    """The contract."""

    def test_its_unknowns_are_among_all_and_have_words_and_no_other_gives_way_as_soon(self, term) -> None:
        at = term_unknowns(term.name)
        assert set(at) <= set(LAYOUT.indices(term.block.name))
        assert len(set(term.block.labels)) == len(term.block.labels) == len(term.block.remedies)
        assert term.words
        assert term.row.count("|") == 5
        assert [one.name for one in TERMS.values() if one.gives_way == term.gives_way] == [term.name]

    def test_a_name_plate_bounds_it_and_is_its_prior(self, term: Term) -> None:
        u = imu_unknowns(free=term_unknowns(term.name))
        u["force.scale"][:], u["gyro.matrix"][:] = SCALE, MATRIX.ravel()
        sigma = name_plate(u)[u.free]
        assert np.all(sigma > 0.0)
        prior = terms_prior(u)
        np.testing.assert_allclose(np.diag(prior.precision)[u.free], sigma**-2, rtol=1e-12)

    def test_a_sensor_s_curve_has_its_derivatives(self, term: Term) -> None:
        if not term.curve:
            pytest.skip("no curve of a sensor's own")
        u = imu_unknowns(free=term_unknowns(term.name))
        u["force.scale"][:], u["gyro.matrix"][:] = SCALE, MATRIX.ravel()
        u[term.block.name][:] = (0.003, -0.002, 0.001)

        def shown_of(at: Any) -> Any:
            return raw_force(at, TRUE) if term.of == "accelerometer" else raw_rate(at, TRUE, TRUE)

        made = shown_of(u).by_blocks[term.block.name]
        for k, index in enumerate(LAYOUT.indices(term.block.name)):
            step = 1e-6 * (np.arange(u.values.size) == index)
            ends = [shown_of(u.at(u.values + moved)).value for moved in (step, -step)]
            np.testing.assert_allclose(made[:, :, k], (ends[0] - ends[1]) / 2e-6, atol=1e-6)


@pytest.mark.parametrize("name", CURVES)
def test_a_curve_s_slope_is_its_derivative_and_correcting_takes_it_out(name: str) -> None:
    curve, u = CURVES[name], np.array([[3.0, -2.0, 0.7]])
    np.testing.assert_allclose(curve.slope(u), (curve.of(u + 1e-6) - curve.of(u - 1e-6)) / 2e-6, rtol=1e-6)
    triad = Triad(MATRIX, np.array([0.1, -0.2, 0.3]), **{name: np.array([0.003, -0.002, 0.001])})
    np.testing.assert_allclose(triad.correct(triad.distort(TRUE)), TRUE, rtol=1e-12)
    # What counts twice as much has the same curve: of a raw unit half as large.
    other = triad.in_raw_unit(2.0)
    np.testing.assert_allclose(other.distort(TRUE), 2.0 * triad.distort(TRUE), rtol=1e-12)
