"""What a test of the readers is given: a motion, and what writes it as text."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cli.program import Bench
from tests.unit.recording.by_hand import Tumbled, tumble_by_hand, write_csv


@pytest.fixture(scope="session")
def tumbled() -> Tumbled:
    return tumble_by_hand()


@pytest.fixture
def csv(tmp_path: Path) -> Callable[..., Path]:
    """A function that writes rows as text to a file in the test's folder and returns its path."""

    def write(rows: np.ndarray, name: str = "recording.csv", **layout: Any) -> Path:
        return write_csv(tmp_path / name, rows, **layout)

    return write


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)
