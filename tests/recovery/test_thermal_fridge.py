"""Out of the fridge onto the table: the fastest minutes of warming are part of the calibration."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import ThermalCurves
from tumble.calibration.thermal.procedure import calibrate_thermal
from tumble.earth import Site
from tumble.protocol import named_protocol
from tumble.segmentation import Timeline, find_thermal_timeline
from tumble.sensor.gauge import frame_rotation
from tumble.sensor.thermal import ThermalModel
from tumble.simulation import Chamber, find_grade, find_thermal_grade, simulate_chamber

UP = np.array([0.0, 0.0, 9.80665])


@pytest.fixture(scope="module")
def scene() -> tuple[Timeline, Estimate, ThermalModel]:
    rng = np.random.default_rng(3)
    kind, drift = find_grade("consumer-mems"), find_thermal_grade("consumer-mems")
    unit = drift.simulate_model(kind.simulate_model(rng), rng)
    chamber = Chamber(
        thermometer_noise=drift.thermometer_noise, thermometer_resolution=drift.thermometer_resolution
    )
    site, protocol = Site.from_latitude(np.radians(48.0)), named_protocol("thermal-fridge")
    recording, _, _ = simulate_chamber(
        protocol, 5.0, rng, site=site, thermal=unit, chamber=chamber, grade=kind
    )
    timeline = find_thermal_timeline(recording)
    assert unit.reference.accelerometer is not None
    turned = unit.turned(np.real(frame_rotation(unit.reference.accelerometer.matrix, "accelerometer-x")))
    return timeline, calibrate_thermal(recording, timeline, site, protocol=protocol), turned


def test_warming_is_no_motion(scene: tuple[Timeline, Estimate, ThermalModel]) -> None:
    timeline, estimate, _ = scene
    assert len(timeline.holds) == 2
    assert not any("nothing was measured" in caution for caution in estimate.cautions)


def test_the_change_of_the_biases_is_recovered(scene: tuple[Timeline, Estimate, ThermalModel]) -> None:
    _, estimate, true = scene
    assert estimate.thermal is not None
    found, evidence = estimate.thermal.model, estimate.shown(ThermalCurves)
    assert evidence is not None
    reference = found.basis.reference_celsius
    for celsius in (5.0, 20.0):
        for name, at_rest in (("accelerometer", UP), ("gyroscope", np.zeros(3))):
            curve = evidence.curves[name]
            here, base = getattr(found.at(celsius), name), getattr(found.at(reference), name)
            there, beneath = getattr(true.at(celsius), name), getattr(true.at(reference), name)
            change = there.bias - beneath.bias + (there.matrix - beneath.matrix) @ at_rest
            sigma = np.array([np.interp(celsius, curve.celsius, curve.sigma[:, k]) for k in range(3)])
            # 12 numbers of one seed: what one branch cannot show (hysteresis, lag, rate) is in the uncertainties.
            assert np.all(np.abs(here.bias - base.bias - change) < 3.5 * sigma)
            # It is a calibration: most of the change is told.
            assert np.linalg.norm(here.bias - base.bias - change) < 0.5 * np.linalg.norm(change)


def test_the_gyros_biases_are_those_of_the_unit_within_their_uncertainties(
    scene: tuple[Timeline, Estimate, ThermalModel],
) -> None:
    """The pose adds a g-sensitivity of 0.05 °/s, some 20 times what the mean of an hour is known to."""
    _, estimate, true = scene
    assert estimate.thermal is not None
    found = estimate.thermal.model
    here, there = found.reference.gyroscope, true.at(found.basis.reference_celsius).gyroscope
    assert here is not None
    assert there is not None
    at = [estimate.names.index(f"gyroscope.bias[{k}]") for k in range(3)]
    sigma = np.sqrt(np.diag(estimate.covariance)[at])
    assert np.all(np.abs(here.bias - there.bias) < 3.5 * sigma)


def test_what_one_branch_cannot_show_is_named_with_what_was_added(
    scene: tuple[Timeline, Estimate, ThermalModel],
) -> None:
    _, estimate, _ = scene
    told = " ".join(estimate.not_determined)
    assert "a single branch cannot show it" in told
    assert "of half the loop, and is in the standard uncertainties" in told
    assert "Lag between the sensors and the thermometer" in told
    assert "a g-sensitivity, believed to be 25 times" in told
    assert not any("lag" in parameter.name for parameter in estimate.parameters)
