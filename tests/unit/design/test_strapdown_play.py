"""Sequences played with finite errors against the linear model, and against another way to turn a fixture."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.closed_forms.rotation_sequences import sequence_model
from tumble.design.strapdown_play import MOUNTING, SENSORS, SHARED, TILT, error_count, play_exactly
from tumble.protocol.strapdown_rotation import SEQUENCES, RotationSequence, start_down
from tumble.simulation.two_axis import FixtureErrors

GRAVITY = 9.81
ROWS = pytest.mark.parametrize("row", SEQUENCES, ids=[row.name for row in SEQUENCES])


@ROWS
def test_small_errors_give_the_coefficients_of_the_model(row: RotationSequence) -> None:
    """One error of ±1e-6 at a time; central differences leave 1e-12 of third order, over 2e-6."""
    steps = 1e-6 * np.eye(error_count(row))
    played = play_exactly(row, np.concatenate([steps, -steps]), GRAVITY)
    slopes = (played[: len(steps)] - played[len(steps) :]) / 2e-6
    model = sequence_model(row.rotations, start_down(row), GRAVITY)
    np.testing.assert_allclose(slopes[:SENSORS].T, model.coefficients, atol=1e-5)
    np.testing.assert_allclose(slopes[SENSORS:], 0.0, atol=1e-5, err_msg="a fixture has no first order")


@ROWS
def test_ideal_sensors_measure_nothing_on_any_fixture(row: RotationSequence) -> None:
    """With the norm exactly; projected on the nominal vertical half the angle's square is lost."""
    errors = np.zeros((3, error_count(row)))
    errors[:, SENSORS:] = 0.05 * np.random.default_rng(7).standard_normal((3, error_count(row) - SENSORS))
    measured = play_exactly(row, errors, GRAVITY)
    # the horizontal part of the nominal frame still sees a start that is askew: equal before and after
    np.testing.assert_allclose(measured, 0.0, atol=1e-12)
    projected = play_exactly(row, errors, GRAVITY, norm=False)
    assert np.all(projected[:, 3:] > 0.0)


def test_the_fixture_turns_as_that_of_the_simulation() -> None:
    """What the accelerometers see at the end, against the attitude that the simulated fixture gives the unit."""
    row = next(row for row in SEQUENCES if row.name == "6")
    rng = np.random.default_rng(3)
    errors = np.zeros((1, error_count(row)))
    errors[0, MOUNTING] = rng.normal(0.0, 0.05, 3)
    errors[0, TILT] = rng.normal(0.0, 0.05, 2)
    bias = np.array([0.3, -0.2, 0.5])
    errors[0, 9:12] = bias
    fixture = FixtureErrors(
        tilt=tuple(errors[0, TILT].tolist()), mounting=tuple(errors[0, MOUNTING].tolist())
    )
    angles = row.fixture_angles()
    # azimuth 90°: the fixture's x is north
    attitudes = [fixture.C_nb(*angles[k]) for k in (0, -1)]
    forces = [GRAVITY * C_nb.T @ np.array([0.0, 0.0, -1.0]) + bias for C_nb in attitudes]
    down = GRAVITY - np.linalg.norm(forces, axis=1)
    change = attitudes[0].T @ attitudes[1] @ forces[1] - forces[0]
    nominal = start_down(row)
    measured = play_exactly(row, errors, GRAVITY)[0]
    np.testing.assert_allclose(measured[3:], down, atol=1e-12)
    np.testing.assert_allclose(measured[:3], change - nominal * (nominal @ change), atol=1e-12)


@ROWS
def test_known_errors_are_taken_out_exactly(row: RotationSequence) -> None:
    """Compensation is the exact inverse, asymmetry included, on a fixture that is off."""
    errors = 0.01 * np.random.default_rng(11).standard_normal((4, error_count(row)))
    measured = play_exactly(row, errors, GRAVITY, known=errors[:, :SENSORS])
    np.testing.assert_allclose(measured, 0.0, atol=1e-12)


def test_a_sequence_has_two_stops_at_its_start_and_one_a_rotation() -> None:
    assert error_count(next(row for row in SEQUENCES if row.name == "6")) == SHARED + 2 + 8
