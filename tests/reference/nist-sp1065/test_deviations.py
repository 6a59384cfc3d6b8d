"""The deviations that NIST SP 1065 prints for its 1000-point test set."""

import csv
from pathlib import Path

import numpy as np
import pytest

from tumble.noise import allan_deviation

with (Path(__file__).parent / "deviations.csv").open(encoding="utf-8") as _file:
    ROWS = list(csv.DictReader(_file))


def test_set():
    """The thousand values by their formula."""
    numbers = [1234567890]
    for _ in range(999):
        numbers.append(16807 * numbers[-1] % 2147483647)
    return np.array(numbers) / 2147483647.0


test_set.__test__ = False  # type: ignore[attr-defined]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["averaging"])
def test_our_deviation_is_the_printed_one(row):
    found = allan_deviation(test_set(), 1.0, taus=[float(row["averaging"])])
    # Seven digits are printed: half a unit of the last is at most 5e-7 of the value.
    assert found.deviation[0, 0] == pytest.approx(float(row["deviation"]), rel=5e-7)
