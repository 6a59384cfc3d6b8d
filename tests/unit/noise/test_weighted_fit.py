"""Weights and their settling: what rounding spoilt is mended, and terms that cannot make a curve give no zero."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.noise import channel as module
from tumble.noise.advice import advise
from tumble.noise.characterisation import characterise
from tumble.noise.fitting.allan_covariance import AllanCovariance
from tumble.noise.fitting.weighted_fit import AllanTask
from tumble.noise.terms import NoiseModel
from tumble.recording import Recording

RATE, SAMPLES = 10.0, 2**14
AVERAGING = tuple(2**k for k in range(12))


def task_of(model: NoiseModel, off: np.ndarray) -> AllanTask:
    """A curve of the model, its points off by factors e^off, in units of the first."""
    tau = np.array(AVERAGING) / RATE
    variance = model.allan_variance(tau) * np.exp(off)
    size = len(tau)
    return AllanTask(
        "curve",
        tau,
        variance / variance[0],
        RATE,
        AllanCovariance(AVERAGING, RATE, (SAMPLES,)),
        np.zeros(size),
        np.zeros((size, size)),
    )


def test_a_curve_that_a_model_makes_is_fitted_to_the_digits() -> None:
    """Without noise the only difference is that a logarithm's bias is taken off: 2 % at two degrees of freedom."""
    model = NoiseModel(random_walk=0.05, rate_random_walk=0.02)
    task = task_of(model, np.zeros(12))
    found = task.settle(("N", "K"), ()).model
    scale = 0.05 / np.sqrt(model.allan_variance(np.array([0.1]))[0])
    assert found.random_walk == pytest.approx(scale, rel=1e-3)
    assert found.rate_random_walk / found.random_walk == pytest.approx(0.4, rel=0.05)


def test_the_root_is_that_of_the_inverse_covariance() -> None:
    task = task_of(NoiseModel(random_walk=0.05), np.zeros(12))
    solution = task.settle(("N",), ())
    covariance = task.covariance(solution.model)
    root = task.root(solution.model, task.variance, "moments")
    assert root @ covariance @ root.T == pytest.approx(np.eye(12), abs=1e-9)


def test_a_covariance_that_rounding_made_indefinite_still_has_a_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """Correlations a few units in the last digits above those of a singular matrix."""
    task = task_of(NoiseModel(random_walk=0.05), np.zeros(12))
    singular = np.outer(np.arange(1.0, 13.0), np.arange(1.0, 13.0)) - 1e-12 * np.eye(12)
    monkeypatch.setattr(AllanTask, "covariance", lambda self, model: singular)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(singular)
    root = task.root(NoiseModel(random_walk=1.0), task.variance, "moments")
    assert np.all(np.isfinite(root))
    # what the matrix does know keeps its weight: along its one direction, whose variance is 650
    along = np.arange(1.0, 13.0) / np.sqrt(650.0)
    assert 1.0 / np.sum((root @ along) ** 2) == pytest.approx(650.0, rel=0.05)


def test_terms_that_cannot_make_the_curve_leave_what_was_found_first() -> None:
    """A walk alone on a curve that falls over a thousand times: finite, and not zero."""
    rng = np.random.default_rng(3)
    task = task_of(NoiseModel(quantisation=1.0), 0.3 * rng.standard_normal(12))
    solution = task.settle(("K",), ())
    assert np.isfinite(solution.misfit)
    assert solution.squares[0] > 0.0


def at_rest() -> Recording:
    rng = np.random.default_rng(1)
    return Recording(
        np.arange(2000) / 50.0,
        0.01 * rng.standard_normal((2000, 3)) + [0.1, 0.2, 9.8],
        None,
        "m/s^2",
        "rad/s",
        50.0,
    )


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (UsageError("The signal is too short for a noise model."), "too short"),
        (
            np.linalg.LinAlgError("Matrix is singular"),
            "averaging times enough, but the curve could not be weighed",
        ),
    ],
)
def test_why_there_is_no_model_is_told_apart(
    monkeypatch: pytest.MonkeyPatch, error: Exception, words: str
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(module, "fit_curve", refuse)
    found = characterise(at_rest())
    assert all(channel.fit is None and words in channel.without_fit for channel in found.channels)
    [said] = [text for text in advise(found.channels, found.channels[0].allan) if "no model" in text]
    assert said.startswith("ax, ay, az: no model, the curve stands alone. ")
    assert words in said
