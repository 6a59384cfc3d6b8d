"""What every test stands on: shapes are checked, examples are the same every time, data are found."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# Before tumble.arrays is first imported. The slow tests set it empty: they run the same code at length, unchecked.
os.environ.setdefault("TUMBLE_CHECK_SHAPES", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line sets it; before numpy is imported

import hypothesis
import pytest
from jaxtyping import install_import_hook

# The rooms that numbers pass through. The outer rooms import lazily, so that names in their
# annotations may not exist while they run, and have no shapes to check.
CHECKED_ROOMS = (
    "attitude",
    "earth",
    "sensor",
    "recording",
    "estimation",
    "noise",
    "segmentation",
    "simulation",
    "navigation",
    "calibration",
    "document",
    "design",
)


# An int is a float, as type checkers have it (PEP 484).
CHECKER = "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"


def check_shapes() -> None:
    """Check every annotated shape of the core rooms at run time, compiled kernels excepted."""
    already = [name for name in sys.modules if name.startswith("tumble.")]
    if already:
        raise RuntimeError(f"{already[0]} was imported before its shapes could be checked.")
    hook = install_import_hook([f"tumble.{room}" for room in CHECKED_ROOMS], CHECKER).hook
    instruments = hook.should_instrument
    # numba compiles the function that it is given: a checking wrapper around it would not compile.
    hook.should_instrument = lambda name: instruments(name) and not name.endswith(("kernels", "_kernel"))


if os.environ["TUMBLE_CHECK_SHAPES"]:
    check_shapes()

hypothesis.settings.register_profile(
    "tumble",
    derandomize=True,  # the same examples every time: a red test stays red until it is mended
    deadline=None,  # numba compiles at the first example
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("tumble")

ROOT = Path(__file__).resolve().parent.parent
# Whole calibrations of simulated tests, many times over: `make test` leaves them to `make test-all`.
SLOW_FOLDERS = ("recovery", "statistics", "unit/papers")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test of a slow folder as slow."""
    slow = tuple(ROOT / "tests" / folder for folder in SLOW_FOLDERS)
    for item in items:
        if any(folder in item.path.parents for folder in slow):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's top folder."""
    return ROOT


@pytest.fixture(scope="session")
def reference_data() -> Path:
    """The folder of reference sets; each has its data and a SOURCE.md."""
    return ROOT / "tests" / "reference"
