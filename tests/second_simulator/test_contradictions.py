"""What was recorded contradicts what is believed: then the verdict is against it, and without a fault it is not.

Recordings of the second simulator, so that no formula of the package is in them. The sample rate is stated to a
millionth, as a user does who trusts a counter of samples.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES
from tumble.document import Calibration
from tumble.errors import ConvergenceError

QUICK = {
    "strapdown-rotation": {"rate": 50.0},
    "rate-table": {},
    "turntable": {"seconds": 10.0, "rate": 25.0},
}


@cache
def calibrated(procedure: str, fault: str | None, grade: str = "industrial", seed: int = 3) -> Calibration:
    import tempfile

    made = PROCEDURES[procedure](GRADES[grade], np.random.default_rng(seed), fault, **QUICK[procedure])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "protocol.yaml"
        file.write_text(made.protocol, encoding="utf-8")
        rate = made.path.rate
        return tumble.calibrate(
            pl.DataFrame(made.columns()), protocol=file, rate=f"{rate}±{rate * 1e-6}"
        ).calibration


def against(calibration: Calibration) -> str:
    """All that is said where the verdict is against it."""
    assert not calibration.verdict.fit
    return " ".join(calibration.verdict.reasons)


@pytest.mark.parametrize(
    "procedure",
    [
        "strapdown-rotation",
        pytest.param("rate-table", marks=pytest.mark.slow),
        pytest.param("turntable", marks=pytest.mark.slow),
    ],
)
def test_without_a_fault_the_verdict_is_for_it(procedure: str) -> None:
    assert calibrated(procedure, None).verdict.fit


def test_samples_missing_from_a_fixtures_turns_are_said() -> None:
    said = against(calibrated("strapdown-rotation", "dropped"))
    assert "Samples are missing that left no trace in the stamps" in said


@pytest.mark.slow
def test_samples_missing_from_a_tables_rotations_are_said() -> None:
    said = against(calibrated("turntable", "dropped"))
    assert "Samples are missing" in said


@pytest.mark.slow
def test_a_table_whose_rates_are_all_off_is_contradicted_by_the_turns_between() -> None:
    said = against(calibrated("rate-table", "all-rates", "consumer", 1005))
    assert "the table turned" in said
    assert "faster than the protocol says. It promises 30 ppm." in said


def test_an_adjustment_that_does_not_settle_with_what_is_believed_is_an_objection(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from tumble.calibration.procedures import joint

    def never(*_: object, **__: object) -> None:
        raise ConvergenceError("It does not settle.")

    monkeypatch.setattr(joint, "run_joint", never)
    calibrated.cache_clear()
    said = against(calibrated("strapdown-rotation", None))
    calibrated.cache_clear()
    assert "No one adjustment fits" in said
    assert "--procedure strapdown-rotation takes its estimate as it is" in said
