"""What nobody says of clock, height and gravity is in the intervals: a plain table from the hills misleads nobody."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tumble
from second_simulator.calibrating import calibrated, played, sigmas_off
from second_simulator.earth import normal_gravity
from second_simulator.recording import Place, Simulation
from tumble.document import Calibration

LATITUDE, HEIGHT = 0.65, 1600.0
HERE = tumble.Site.from_latitude(LATITUDE)


@pytest.fixture(scope="module")
def high() -> Simulation:
    """A tactical unit by hand at 1,600 m, gravity 80 mGal off; stamps jitter, and their resonator is 0.4 % slow."""

    def drawn(*_: object) -> Place:
        return Place(LATITUDE, HEIGHT, normal_gravity(LATITUDE, HEIGHT) + 8e-4, LATITUDE, None, 2e-5)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Place, "draw", drawn)
        made = played("by-hand", "tactical", 21, poses=16, rate=50.0)
    late = np.abs(np.random.default_rng(3).normal(0.0, 3e-4, made.time.size))
    return replace(made, time=(made.time + late) * (1.0 - 0.004))


def _worst(found: Calibration, made: Simulation) -> tuple[float, float]:
    """Return by how many of their sigmas scale factors of accelerometers and gyros are off the truth."""
    with np.errstate(invalid="ignore", divide="ignore"):
        off = [np.abs(sigmas_off(found, made, f"{t}.matrix"))[::4] for t in ("accelerometer", "gyroscope")]
    return float(np.max(off[0])), float(np.max(off[1]))


def test_with_a_latitude_alone_neither_height_nor_clock_misleads(high: Simulation) -> None:
    found = calibrated(high, by_protocol=False, site=HERE)
    assert max(_worst(found, high)) < 3.0
    assert found.verdict.fit
    assert found.site.height_m is None
    said = " ".join(found.verdict.reasons)
    assert "say --rate crystal where a crystal times the board" in said
    assert "give the height too, as --site LATITUDE,HEIGHT" in said


def test_what_is_said_is_believed(high: Simulation) -> None:
    """So the test above has power: with a crystal and the height of the sea the same numbers are off."""
    site = tumble.Site.from_latitude(LATITUDE, 0.0)
    force, rate = _worst(calibrated(high, by_protocol=False, site=site, rate="crystal"), high)
    assert force > 8.0
    assert rate > 8.0


@pytest.mark.parametrize("digits", [2, 3])
def test_gravity_with_few_digits_is_good_to_them(high: Simulation, digits: int) -> None:
    given = tumble.Site.from_gravity(round(high.place.gravity, digits))
    assert _worst(calibrated(high, by_protocol=False, site=given), high)[0] < 3.0
