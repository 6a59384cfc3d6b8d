"""A field calibration as a recording of raw samples: found holds give what the study's means give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.arrays import Vectors
from tumble.calibration.closed_forms.norm_batch import NormBatch, adjust_norms
from tumble.earth import Site
from tumble.earth.site import EARTH_RATE
from tumble.protocol import HoldStep, named_protocol
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans, find_timeline, observe_holds
from tumble.simulation import Truth, find_grade
from tumble.simulation.protocols import simulate_protocol
from tumble_papers.hayal.scenarios import SCENARIOS
from tumble_papers.hayal.thesis_simulation import FORCE_NOISE, RATE_NOISE

RATE, SECONDS = 20.0, 60.0
SITE = Site.from_latitude(np.radians(40.0))


@pytest.fixture(scope="module")
def field() -> tuple[Recording, Truth, HoldMeans]:
    """An HG1700, a minute in each of 26 attitudes, 20 samples a second."""
    protocol = named_protocol("multi-position-26")
    steps = tuple(
        replace(step, duration=SECONDS) if isinstance(step, HoldStep) else step for step in protocol.steps
    )
    recording, truth = simulate_protocol(
        replace(protocol, steps=steps),
        RATE,
        np.random.default_rng(11),
        site=SITE,
        grade=find_grade("hg1700"),
    )
    return recording, truth, observe_holds(recording, find_timeline(recording))


def exact_means(recording: Recording, truth: Truth, triad: str) -> Vectors:
    """Means over the samples from half a second after each true beginning to half a second before the end."""
    values, time = getattr(recording, triad), recording.time
    edges = truth.hold_edges[[step is not None for step in truth.hold_steps]]
    return np.array([values[(time > a + 0.5) & (time < b - 0.5)].mean(axis=0) for a, b in edges])


def adjusted(means: Vectors, noise: float, norm: float, unknowns: int) -> NormBatch:
    start = np.concatenate([means.mean(axis=0), [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]])
    return adjust_norms(means[None], noise / np.sqrt(SECONDS), norm, unknowns=unknowns, start=start)


@pytest.mark.parametrize(
    ("triad", "noise", "norm", "unknowns", "scenario"),
    [
        ("specific_force", FORCE_NOISE, SITE.gravity, 9, 1),
        ("specific_force", FORCE_NOISE, SITE.gravity, 9, 2),
        ("angular_rate", RATE_NOISE, EARTH_RATE, 3, 1),
        ("angular_rate", RATE_NOISE, EARTH_RATE, 3, 3),
        ("angular_rate", RATE_NOISE, EARTH_RATE, 9, 1),
    ],
)
def test_found_holds_give_the_solution_of_the_true_ones(
    field: tuple[Recording, Truth, HoldMeans],
    triad: str,
    noise: float,
    norm: float,
    unknowns: int,
    scenario: int,
) -> None:
    recording, truth, means = field
    assert len(means) == 26
    found = adjusted(getattr(means, triad)[SCENARIOS[scenario]], noise, norm, unknowns)
    exact = adjusted(exact_means(recording, truth, triad)[SCENARIOS[scenario]], noise, norm, unknowns)
    assert found.usable.all()
    assert exact.usable.all()
    apart = (found.parameters - exact.parameters)[0, :unknowns] / exact.sigmas[0]
    # A second of sixty more or less in the means: an eighth of a sigma, four times that
    assert np.abs(apart).max() < 0.5
    np.testing.assert_allclose(found.sigmas, exact.sigmas, rtol=0.1)
    # white noise alone, of the random walk of the sheet: sigma0 is one within 4.5 of its deviations
    freedom = len(range(26)[SCENARIOS[scenario]]) - unknowns
    assert abs(float(found.sigma0[0]) - 1.0) < 4.5 / np.sqrt(2.0 * freedom)


def test_the_samples_scatter_as_the_study_takes_them(field: tuple[Recording, Truth, HoldMeans]) -> None:
    """Table 3.1 is for one sample a second: at 20 a second each scatters √20 times as much, and the mean the same."""
    _, _, means = field
    for covariance, noise in (
        (means.specific_force_covariance, FORCE_NOISE),
        (means.angular_rate_covariance, RATE_NOISE),
    ):
        assert covariance is not None
        sigma = np.sqrt(np.mean(np.diagonal(covariance, axis1=1, axis2=2), axis=0))
        # 26 covariances from some 60 independent stretches each: 2 %, five times that
        assert sigma == pytest.approx(np.full(3, noise / np.sqrt(SECONDS)), rel=0.1)
