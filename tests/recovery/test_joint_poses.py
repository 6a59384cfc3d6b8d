"""Protocols with believed poses through the joint estimator: what was put in comes out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.stats import chi2

from recovery.played import jointly
from tumble.calibration import Session, find_procedure
from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import Budget
from tumble.calibration.outcome.description import canonical_names
from tumble.calibration.outcome.estimate import SITS
from tumble.earth import Site
from tumble.protocol import named_protocol
from tumble.sensor import ImuModel, change_frame
from tumble.simulation import find_grade, simulate_protocol

SITE = Site.from_latitude(0.8, 0.0)


@cache
def _run(name: str, grade: str, *, noise: bool, frame: str) -> tuple[Estimate, ImuModel]:
    protocol = named_protocol(name)
    recording, truth = simulate_protocol(
        *(protocol, 100.0, np.random.default_rng(21)),
        site=SITE,
        grade=find_grade(grade),
        noise=noise,
        placement=noise,
    )
    believed = replace(find_procedure(name), frame=frame)
    estimate = jointly(Session(recording, protocol, SITE), believed, optional_terms=False)
    assert truth.model is not None
    return estimate, truth.model


def _canonical(model: ImuModel) -> dict[str, float]:
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    values = [model.accelerometer.matrix.ravel(), model.accelerometer.bias]
    values += [model.gyroscope.matrix.ravel(), model.gyroscope.bias]
    return dict(zip(canonical_names(frozenset(), "full"), np.concatenate(values).tolist(), strict=True))


def test_six_faces_without_noise_give_biases_and_scales_exactly_and_gyros_from_the_turns() -> None:
    estimate, model = _run("six-position", "tactical", noise=False, frame="fixture")
    found, true = _canonical(estimate.model), _canonical(model)
    assert estimate.frame == "fixture"
    for i in range(3):
        # An accelerometer's bias comes of differences of opposite faces; a microgal is 1e-8 m/s².
        assert abs(found[f"accelerometer.bias[{i}]"] - true[f"accelerometer.bias[{i}]"]) < 1e-9
        assert abs(found[f"accelerometer.matrix[{i},{i}]"] - true[f"accelerometer.matrix[{i},{i}]"]) < 1e-8
        assert abs(found[f"gyroscope.matrix[{i},{i}]"] - true[f"gyroscope.matrix[{i},{i}]"]) < 1e-8
    off = [abs(found[n] - true[n]) for n in found]
    # The mounting's prior of 0.2 rad pulls a rotation of a milliradian, known to 0.25°, by 5e-4 of itself.
    assert max(off) < 2e-6


def test_a_two_axis_fixture_tells_both_triads_in_its_own_axes_within_their_sigma() -> None:
    estimate, model = _run("strapdown-rotation", "tactical", noise=True, frame="fixture")
    found, true = _canonical(estimate.model), _canonical(model)
    error = np.array([found[n] - true[n] for n in estimate.names])
    # Eigenvalues below round-off of the largest, in sigmas, are gauges of the description.
    sigma = np.sqrt(np.diag(estimate.covariance))
    correlation = estimate.covariance / np.outer(sigma, sigma)
    square = float(
        (error / sigma) @ np.linalg.pinv(correlation, rcond=1e-8, hermitian=True) @ (error / sigma)
    )
    # One in a thousand on either side.
    assert chi2.ppf(1e-3, len(error)) < square < chi2.ppf(1.0 - 1e-3, len(error))
    assert estimate.not_determined == (SITS,)
    # Its axes are known as well as 34 poses of a milliradian make them.
    leaning = sigma[estimate.names.index("gyroscope.matrix[0,1]")]
    assert 1e-3 / np.sqrt(34.0) < leaning < 3e-3 / np.sqrt(34.0)


def test_parameters_in_the_fixtures_axes_have_a_budget_in_which_placement_stands() -> None:
    estimate, _ = _run("strapdown-rotation", "tactical", noise=True, frame="fixture")
    stated = np.array([p.standard_uncertainty for p in estimate.parameters])
    whole = np.sqrt(sum(part**2 for part in estimate.shown(Budget).shares.values()))
    # sources below 1e-4 of every variance are not in it
    np.testing.assert_allclose(whole, stated, rtol=1e-3)
    leaning = [p.name for p in estimate.parameters].index("gyro misalignment xy")
    # poses of a milliradian are what the axes of the fixture are known by
    assert estimate.shown(Budget).shares["placement"][leaning] > 0.9 * stated[leaning]


def test_six_noisy_faces_name_what_their_turns_leave_open() -> None:
    estimate, model = _run("six-position", "industrial-mems", noise=True, frame="accelerometer-x")
    true = {n: v for n, v in _canonical(model).items() if n in estimate.names}
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)).tolist(), strict=True))
    found = _canonical(estimate.model)
    for i in range(3):
        name = f"accelerometer.matrix[{i},{i}]"
        # Scale factors are told; 3.5 sigma for three of them.
        assert abs(found[name] - true[name]) < 3.5 * sigma[name] + 1e-4
        assert sigma[name] < 2e-4
    assert any("turn about" in sentence for sentence in estimate.not_determined)


def test_optional_terms_that_few_holds_cannot_tell_do_not_stop_the_adjustment() -> None:
    """Six faces and the five turns between them tell both triads, and nothing of eighteen more unknowns."""
    protocol, rng = named_protocol("six-position"), np.random.default_rng([1000, 1])
    recording, truth = simulate_protocol(protocol, 50.0, rng, site=SITE, grade=find_grade("tactical"))
    believed = replace(find_procedure("six-position"), frame="accelerometer-x")
    estimate = jointly(Session(recording, protocol, SITE), believed)
    assert not any(term.kept for term in estimate.terms)
    assert truth.model is not None
    found, true = _canonical(estimate.model), _canonical(change_frame(truth.model, "accelerometer-x"))
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)).tolist(), strict=True))
    told = [n for i in range(3) for n in (f"accelerometer.bias[{i}]", f"accelerometer.matrix[{i},{i}]")]
    # six normal errors are beyond five sigma once in 300,000 recordings
    assert all(abs(found[n] - true[n]) < 5.0 * sigma[n] for n in told)
