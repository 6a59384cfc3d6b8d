"""The noise models of `tumble noise`, read for a calibration: what is refused, in words, and what they do."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.noise.terms import NoiseModel
from tumble.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, observe_holds
from tumble.segmentation.modelled_means import model_means
from tumble.workflows.noise import NoiseOfHolds, read_noise_models

RATE = 50.0


def document(**changes: Any) -> dict[str, Any]:
    terms = {"N": {"value": 1e-3}, "sigma": {"value": 2e-3}, "correlation time": {"value": 30.0}}
    channels = {f"a{x}": {"unit": "m/s²", "terms": terms, "lines": []} for x in "xyz"}
    channels["az"]["lines"] = [{"amplitude": 0.1, "frequency_hz": 12.5}]
    return {"format": "tumble noise", "rate_hz": RATE, "channels": channels, **changes}


def written(folder: Path, content: Any) -> Path:
    path = folder / "noise.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def recording(unit: str = "m/s^2", rate: float = RATE) -> Recording:
    rng = np.random.default_rng(2)
    count = 3000
    samples = 1e-3 * np.sqrt(rate) * rng.standard_normal((count, 3)) + [0.1, -0.2, 9.8]
    return Recording(np.arange(count) / rate, samples, None, unit, "rad/s", rate)


def test_a_models_terms_are_read_in_raw_units(tmp_path: Path) -> None:
    found = NoiseOfHolds.read(written(tmp_path, document()), recording("g"))
    force = found.force
    assert found.rate is None
    assert force is not None
    assert force[0].random_walk == pytest.approx(1e-3 / 9.80665)
    assert force[2].gauss_markov[0].correlation_time == 30.0
    assert force[2].lines[0].frequency == 12.5


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (document(channels={"ax": {"unit": "m/s²", "terms": {"N": {"value": -1.0}}}}), "is negative"),
        ({"format": "tumble calibration"}, "no noise document"),
        ({"format": "tumble noise"}, "lacks"),
        (document(rate_hz=200.0), "200 Hz"),
        (document(channels={"ax": {"unit": "m/s²", "terms": {}}}), "too short"),
        (document(channels={"ax": {"unit": "m/s²", "terms": {"N": {"value": 1.0}}}}), "no channel ay"),
        (
            document(channels={f"a{x}": {"unit": "counts", "terms": {"N": {"value": 1.0}}} for x in "xyz"}),
            "--units as here",
        ),
    ],
)
def test_another_file_rate_or_unit_is_refused_in_a_sentence(tmp_path: Path, content: Any, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        NoiseOfHolds.read(written(tmp_path, content), recording())


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="There is no noise file"):
        read_noise_models(tmp_path / "none.json")


FLOOR = NoiseFloor(np.full(3, 7e-3), np.zeros(3), 0.0, "none")
TIMELINE = Timeline(tuple(Hold(1000 * k, 1000 * (k + 1)) for k in range(3)), (), (), FLOOR)


@pytest.mark.parametrize("shaken", [False, True])
def test_holds_have_the_models_covariance_and_a_shaken_one_its_own(shaken: bool) -> None:
    given = recording()
    assert given.specific_force is not None
    if shaken:
        # the third hold shakes a hundred times the noise
        given.specific_force[2000:] += 0.7 * np.sin(np.arange(1000) * 0.05)[:, None]
    means, model = observe_holds(given, TIMELINE), NoiseModel(random_walk=1e-3, rate_random_walk=1e-5)
    modelled = model_means(given, TIMELINE, means, [model] * 3, None)
    covariance = modelled[0].specific_force_covariance
    assert covariance is not None
    assert means.specific_force_covariance is not None
    if shaken:
        assert covariance[2, 0, 0] == pytest.approx(means.specific_force_covariance[2, 0, 0])
        assert modelled[1]
    else:
        # N² / t, to which the walk adds little
        assert covariance[0, 0, 0] == pytest.approx(1e-6 / 20.0, rel=0.05)
        assert not modelled[1]


def test_what_rounding_leaves_is_no_noise_of_a_model_and_stays() -> None:
    """Twice the noise's own variance: too little for a shaken hold, too much for the model alone."""
    given = recording()
    means, model = observe_holds(given, TIMELINE), NoiseModel(random_walk=1e-3)
    assert means.specific_force_covariance is not None
    rounding = np.array([1e-7, 0.0, 3e-8]) * np.array([[1.0], [2.0], [0.5]])
    coarse = replace(
        means,
        specific_force_rounding=rounding,
        specific_force_covariance=means.specific_force_covariance + rounding[:, :, None] * np.eye(3),
    )
    fine, modelled = (model_means(given, TIMELINE, one, [model] * 3, None) for one in (means, coarse))
    assert fine[0].specific_force_covariance is not None
    assert modelled[0].specific_force_covariance is not None
    more = modelled[0].specific_force_covariance - fine[0].specific_force_covariance
    np.testing.assert_allclose(np.diagonal(more, axis1=1, axis2=2), rounding, atol=1e-12)
    assert not modelled[1]
