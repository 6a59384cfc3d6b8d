"""What is known of a site, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import STANDARD_GRAVITY, Site, normal_gravity
from tumble.errors import SiteError


def test_a_latitude_gives_normal_gravity_with_what_the_real_field_differs_by() -> None:
    site = Site.from_latitude(math.radians(48.0), 520.0)
    assert site.gravity == normal_gravity(math.radians(48.0), 520.0)
    assert site.gravity_sigma == 3e-4
    assert (site.latitude, site.height) == (math.radians(48.0), 520.0)


def test_gravity_alone_is_exact_and_says_nothing_of_the_latitude() -> None:
    site = Site.from_gravity(9.81744)
    assert (site.gravity, site.gravity_sigma, site.latitude) == (9.81744, 0.0, None)
    with pytest.raises(SiteError, match="needs a latitude: give --site LATITUDE"):
        _ = site.earth_rate_n


def test_an_unknown_site_covers_the_earth_evenly() -> None:
    site = Site.unknown()
    assert site.gravity == STANDARD_GRAVITY == 9.80665
    # GUM 4.3.7: half-width over root three
    assert site.gravity_sigma == pytest.approx(0.026 / math.sqrt(3.0), rel=1e-12)
    assert abs(normal_gravity(0.0) - site.gravity) < 2 * site.gravity_sigma
    assert abs(normal_gravity(math.pi / 2) - site.gravity) < 2 * site.gravity_sigma


@pytest.mark.parametrize("latitude_in_degrees", [90.0, 45.0, 0.0, -30.0, -90.0])
def test_the_earth_rate_is_the_polar_axis_seen_in_north_east_down(latitude_in_degrees: float) -> None:
    latitude = math.radians(latitude_in_degrees)
    # Columns of C_ne: the Earth's axes in n at longitude zero, by geometry. z is the polar axis:
    # from the equator one turns by minus (90 degrees + latitude) about east (Groves 2.150).
    C_ne = Rotation.from_euler("y", math.pi / 2 + latitude).as_matrix()
    expected = C_ne @ [0.0, 0.0, 7.292115e-5]
    np.testing.assert_allclose(Site.from_latitude(latitude).earth_rate_n, expected, atol=1e-19)


@pytest.mark.parametrize("latitude_in_degrees", [90.01, -120.0, math.nan, math.inf])
def test_a_latitude_beyond_the_poles_is_refused(latitude_in_degrees: float) -> None:
    with pytest.raises(SiteError, match="beyond the poles: give --site LATITUDE"):
        Site.from_latitude(math.radians(latitude_in_degrees))


@pytest.mark.parametrize("height", [-501.0, 10_001.0, math.nan])
def test_a_height_off_the_earth_s_surface_is_refused(height: float) -> None:
    with pytest.raises(SiteError, match="not on the Earth's surface"):
        Site.from_latitude(0.5, height)


@pytest.mark.parametrize("gravity", [9.74, 9.86, 1.0, 981.0, -9.81, 0.0, math.nan])
def test_a_gravity_that_no_place_has_is_refused(gravity: float) -> None:
    with pytest.raises(SiteError, match="nowhere on the Earth's surface"):
        Site.from_gravity(gravity)
