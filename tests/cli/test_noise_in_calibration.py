"""`tumble calibrate --noise`: what is no noise document of the unit is refused in a sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

RATE = 50.0


@pytest.fixture(scope="module")
def noise(tumble: Any, written: Any, rows: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `tumble noise` writes for two minutes of the noise that the first hold of the good recording has."""
    folder = tmp_path_factory.mktemp("noise")
    rng = np.random.default_rng(5)
    count = 6000
    still = rows[5:100, 1:]
    signal = still.mean(axis=0) + still.std(axis=0, ddof=1) * rng.standard_normal((count, 6))
    path = written(folder / "still.csv", np.column_stack([np.arange(count) / RATE, signal]))
    assert tumble("noise", path, "-o", folder / "noise").status == 0
    return folder / "noise" / "noise.json"


def sigma_of_biases(folder: Path) -> float:
    """Root mean square of the stated standard uncertainties of the accelerometers' biases."""
    document = json.loads((folder / "calibration.json").read_text(encoding="utf-8"))
    named = [p for p in document["parameters"] if p["name"].startswith("accelerometer bias")]
    assert len(named) == 3
    return float(np.sqrt(np.mean([p["standard_uncertainty"] ** 2 for p in named])))


def test_a_calibration_counts_the_models(tumble: Any, recording: Path, noise: Path, tmp_path: Path) -> None:
    content = json.loads(noise.read_text(encoding="utf-8"))
    # m/s²/√s: 7 mm/s² over a hold of a dozen seconds, many times the noise
    walk = {"letter": "K", "value": 2e-3}
    for name in ("ax", "ay", "az"):
        content["channels"][name]["terms"]["K"] = walk
    (wandering := tmp_path / "wandering.json").write_text(json.dumps(content), encoding="utf-8")
    sigmas: list[float] = []
    for path in (noise, wandering):
        answer = tumble("calibrate", recording, "--noise", path, "-o", tmp_path / path.stem)
        assert answer.status == 0, answer.err
        text = (tmp_path / path.stem / "calibration.json").read_text(encoding="utf-8")
        assert f"the noise models in {path}; that neighbouring holds are off together is counted" in text
        sigmas.append(sigma_of_biases(tmp_path / path.stem))
    assert sigmas[1] > 2.0 * sigmas[0]
