"""A session finds what it is asked for; what is said twice must agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.calibration.session import Session
from tumble.earth import Site
from tumble.errors import SiteError
from tumble.protocol import named_protocol
from tumble.recording import Recording


def session(gravity: float) -> Session:
    """Of a protocol at 48°, with a gravity that the user gives."""
    rows = np.zeros((4, 3))
    recording = Recording(
        time=np.arange(4.0),
        specific_force=rows,
        angular_rate=None,
        specific_force_unit="m/s²",
        angular_rate_unit="rad/s",
        rate=1.0,
    )
    protocol = replace(named_protocol("six-position"), site=Site.from_latitude(np.radians(48.0), 520.0))
    return Session(recording, protocol, given_site=Site.from_gravity(gravity))


def test_a_gravity_beside_the_protocol_s_latitude_keeps_the_latitude() -> None:
    site = session(9.8073).site
    assert (site.gravity, site.height) == (9.8073, 520.0)
    assert site.gravity_sigma == pytest.approx(0.00005 / 3**0.5)
    assert site.latitude == np.radians(48.0)


def test_a_gravity_that_contradicts_the_protocol_s_latitude_is_refused() -> None:
    with pytest.raises(SiteError, match="contradicts the latitude 48°"):
        _ = session(9.85).site
