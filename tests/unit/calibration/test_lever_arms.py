"""Lever arms at work: what accelerometers feel where they sit is taken out, block by block as all at once."""

import numpy as np
import numpy.typing as npt
import pytest
from msgspec import structs

from tumble.calibration.terms import LeverArms
from tumble.document import calibration_from_model, read_calibration
from tumble.errors import UsageError
from tumble.sensor import ImuModel, Triad

Array = npt.NDArray[np.float64]
ARMS = 1e-3 * np.array([[0.0, 12.0, -7.0], [5.0, 0.0, 9.0], [-14.0, 3.0, 0.0]])
MODEL = ImuModel(
    Triad(np.array([[1.02, 0.01, 0.0], [-0.011, 0.97, 0.02], [0.013, -0.009, 1.05]]), np.zeros(3)), None
)
STEP = 0.005  # s


def _shaken() -> tuple[Array, Array, Array, Array]:
    """Time, the unit's specific force, its rate, and what its accelerometers make of it (matrix taken out)."""
    time: Array = np.asarray(STEP * np.arange(400), dtype=np.float64)
    rate: Array = np.column_stack([np.sin(7.0 * time), 2.0 * np.cos(5.0 * time), np.sin(3.0 * time + 1.0)])
    # Halfway between samples, where the change from one to the next belongs.
    half = time - 0.5 * STEP
    change = np.column_stack(
        [7.0 * np.cos(7.0 * half), -10.0 * np.sin(5.0 * half), 3.0 * np.cos(3.0 * half + 1.0)]
    )
    force = np.column_stack([np.sin(time), np.cos(time), np.full(400, 9.8)])
    felt = np.zeros((400, 3))
    matrix = MODEL.accelerometer.matrix
    for n in range(400):
        for i in range(3):
            there = force[n] + np.cross(rate[n], np.cross(rate[n], ARMS[i])) + np.cross(change[n], ARMS[i])
            felt[n, i] = matrix[i] @ there
    seen: Array = np.asarray(np.linalg.solve(matrix, felt.T).T, dtype=np.float64)
    return time, force, rate, seen


def _arms() -> LeverArms:
    return LeverArms.of(ARMS.tolist(), MODEL)


def test_the_force_at_the_point_they_are_counted_from_comes_back():
    time, force, rate, felt = _shaken()
    found = _arms().taken_out(felt, rate, time)
    # The first sample has none before it; a difference over a step misses step²/24 of the third derivative:
    # 1e-6 s² of 343 rad/s⁴, times 14 mm.
    np.testing.assert_allclose(found[1:], force[1:], atol=1e-5)
    assert np.max(np.abs(felt - force)) > 0.05


@pytest.mark.parametrize("sizes", [(1, 399), (200, 200), (7, 0, 393)])
def test_blocks_give_the_same_numbers_as_the_whole(sizes):
    time, _, rate, felt = _shaken()
    whole, arms, at = _arms().taken_out(felt, rate, time), _arms(), 0
    made: list[Array] = []
    for size in sizes:
        part = slice(at, at + size)
        made.append(arms.taken_out(felt[part], rate[part], time[part]))
        at += size
    np.testing.assert_array_equal(np.concatenate(made), whole)


def test_a_gap_or_a_step_back_has_no_acceleration():
    time, _, rate, felt = _shaken()
    after = time.copy()
    after[200:] += 5.0
    gap, even = _arms().taken_out(felt, rate, after), _arms().taken_out(felt, rate, time)
    assert np.any(gap[200] != even[200])
    keep = np.arange(400) != 200
    np.testing.assert_allclose(gap[keep], even[keep], atol=1e-12)


def test_without_time_it_is_refused_and_without_lever_arms_there_is_nothing():
    _, _, rate, felt = _shaken()
    with pytest.raises(UsageError, match="give the time"):
        _arms().taken_out(felt, rate, None)
    assert LeverArms.of(None, MODEL) is None


@pytest.fixture(scope="module")
def document():
    """A document of the model with lever arms; its gyros are perfect."""
    model = ImuModel(MODEL.accelerometer, Triad(np.eye(3), np.zeros(3)))
    made = calibration_from_model(
        model, ("m/s^2", "rad/s"), ("sensor axes", "as simulated"), [], procedure="a test", remarks=[]
    )
    arms = tuple(tuple(row) for row in ARMS.tolist())
    return structs.replace(made, lever_arms=arms)


def test_a_document_carries_them_and_corrects_by_them(document, tmp_path):
    time, force, rate, felt = _shaken()
    document.write(tmp_path / "calibration.json")
    read = read_calibration(tmp_path / "calibration.json")
    assert read.identity == document.identity != structs.replace(document, lever_arms=None).identity
    raw = MODEL.accelerometer.distort(felt)
    corrected, _ = read.correct(raw, rate, time)
    np.testing.assert_allclose(corrected[1:], force[1:], atol=1e-5)
    # Without gyros nobody knows how it turned.
    alone, _ = read.correct(raw, None, time)
    np.testing.assert_allclose(alone, felt, atol=1e-12)
