"""Many calibrations in one process: each as if it were alone, one after another or at the same time."""

import gc
import json
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tumble

ROOT = Path(__file__).resolve().parents[2]
SITE = tumble.Site.from_latitude(math.radians(48.1), 520.0)


@pytest.fixture(scope="module")
def recordings() -> list[Any]:
    """What ships with the package, and the same from sensors that show a hundredth more, along other axes."""
    first = tumble.read_recording(ROOT / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz", rate=100.0)
    turned = np.array([[0.0, 1.01, 0.0], [0.0, 0.0, 1.01], [1.01, 0.0, 0.0]])
    signals = {name: getattr(first, name) @ turned.T for name in ("angular_rate", "specific_force")}
    return [first, replace(first, **signals)]


@pytest.fixture(scope="module")
def alone(recordings: list[Any]) -> list[dict[str, Any]]:
    return [document(recording) for recording in recordings]


def document(recording: Any) -> dict[str, Any]:
    """Return what is stored of a calibration, but for when it was made."""
    made = json.loads(tumble.calibrate(recording, site=SITE).calibration.to_json())
    made.pop("created")
    return made


def test_threads_change_nothing(recordings: list[Any], alone: list[dict[str, Any]]) -> None:
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(document, recordings))
    assert found == alone
    assert found[0] != found[1]


def test_what_came_before_changes_nothing(recordings: list[Any], alone: list[dict[str, Any]]) -> None:
    before = dict(os.environ), os.getcwd(), np.geterr()
    assert document(recordings[0]) == alone[0]
    assert (dict(os.environ), os.getcwd(), np.geterr()) == before


@pytest.mark.usefixtures("alone")
def test_nothing_is_kept_of_a_call(recordings: list[Any]) -> None:
    before = ours()
    made = tumble.calibrate(recordings[0], site=SITE)
    assert ours() > before + 100
    del made
    assert ours() == before


def ours() -> int:
    """Return how many objects of the package's own classes there are."""
    gc.collect()
    return sum(str(type(one).__module__).startswith("tumble.") for one in gc.get_objects())
