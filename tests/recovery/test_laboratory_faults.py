"""The laboratory method on recordings of another simulator: what wanders is counted, and what goes wrong is said."""

from __future__ import annotations

import numpy as np
import pytest

from second_simulator import named
from second_simulator.calibrating import calibrated, played
from tumble.document import Calibration


def turned(seed: int, grade: str, fault: str | None) -> tuple[Calibration, dict[str, np.ndarray]]:
    """A calibration, and by how much what people name of its gyros' matrix is off."""
    made = played("laboratory", grade, seed, fault)
    # The simulated clock is exact; stamps that are regular would be taken for a nominal rate, known to 0.6 %.
    rate = f"{1.0 / float(np.median(np.diff(made.time))):.6f}±0.00001"
    found = calibrated(made, procedure="laboratory", rate=rate)
    assert found.gyroscope is not None
    ours, true = (
        named({"gyroscope.matrix": np.array(matrix)})
        for matrix in (found.gyroscope.matrix, made.truth.terms("fixture")["gyroscope.matrix"])
    )
    return found, {name: ours[name] - true[name] for name in ours}


def scale_errors(found: Calibration, off: dict[str, np.ndarray]) -> np.ndarray:
    """The gyros' scale factors' errors in their standard uncertainties."""
    stated = [
        p.standard_uncertainty for p in found.parameters if p.name.startswith("gyro scale factor error")
    ]
    return off["gyroscope scale"] / np.array(stated)


def test_a_gyro_that_wanders_while_the_table_turns_is_in_the_scale_factors() -> None:
    """Without it their errors are 2.2 times the stated ones, of ten recordings."""
    every = [scale_errors(*turned(5000 + k, "industrial", None)) for k in range(6)]
    assert 0.6 < float(np.sqrt(np.mean(np.square(every)))) < 1.5


@pytest.mark.parametrize("seed", [1000, 1001])
def test_what_an_angle_misread_by_half_a_degree_contradicts_is_left_out(seed: int) -> None:
    found, off = turned(seed, "tactical", "misread")
    assert found.quality.left_out or not found.verdict.fit
    assert np.max(np.abs(scale_errors(found, off))) < 3.0


def test_a_unit_that_slips_on_the_table_is_counted() -> None:
    assert np.max(np.abs(scale_errors(*turned(1002, "industrial", "loose")))) < 3.0


def test_a_turn_cut_by_a_gap_leaves_no_g_sensitivity_in_the_difference() -> None:
    """Of a turn in two pieces the mean took half as long as its counterpart: 0.05 °/s of it were left, 31 sigmas."""
    found, off = turned(1004, "consumer", "gaps")
    stated = [p.standard_uncertainty for p in found.parameters if p.name.startswith("gyro misalignment")]
    assert np.max(np.abs(off["gyroscope non-orthogonality"])) < 3.0 * np.max(stated)
