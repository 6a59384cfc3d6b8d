"""Rests that turn about the vertical, and gyros whose g-sensitivity only looks like it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.earth import Site
from tumble.protocol import named_protocol
from tumble.segmentation import find_timeline
from tumble.sensor import ImuModel, Triad
from tumble.simulation.protocols import simulate_protocol

SITE = Site.from_latitude(np.radians(45.0))


def test_a_g_sensitivity_of_half_a_degree_per_second_is_no_turning() -> None:
    """A consumer gyro shows another rate with another face up: every hold is found all the same."""
    sensitivity = np.radians(0.05) * np.array([[1.0, -0.4, 0.2], [0.3, -0.8, 0.5], [-0.6, 0.2, 0.9]])
    model = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.full(3, 0.01)), sensitivity)
    protocol = replace(named_protocol("turntable-9"), site=SITE)
    rng = np.random.default_rng(11)
    recording, truth = simulate_protocol(protocol, 50.0, rng, site=SITE, model=model)
    noise = rng.normal(0.0, 2e-3, (len(recording), 3)), rng.normal(0.0, 5e-4, (len(recording), 3))
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    noisy = replace(
        recording,
        specific_force=recording.specific_force + noise[0],
        angular_rate=recording.angular_rate + noise[1],
    )
    assert len(find_timeline(noisy).holds) == len(truth.hold_edges)
