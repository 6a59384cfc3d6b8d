"""Gravity and what is known of a site: WGS 84 as published, another program, geometry, and what is refused."""

import csv
import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site, normal_gravity
from tumble.errors import SiteError
from tumble.units import STANDARD_GRAVITY


def test_a_latitude_gives_normal_gravity_with_what_the_real_field_differs_by():
    site = Site.from_latitude(math.radians(48.0), 520.0)
    assert site.gravity == normal_gravity(math.radians(48.0), 520.0)
    # 30 mGal, and half of 520 m of rock: 0.1119 mGal a metre
    assert site.gravity_sigma == pytest.approx(math.hypot(30e-5, 260 * 0.1119e-5))
    assert Site.from_latitude(0.7, 1800.0).gravity_sigma == pytest.approx(100e-5, rel=0.1)
    assert (site.latitude, site.height) == (math.radians(48.0), 520.0)


@pytest.mark.parametrize("height", [0.0, 1600.0, 2500.0])
def test_without_a_height_gravity_holds_from_the_sea_to_the_high_towns(height):
    site = Site.from_latitude(0.7)
    assert abs(normal_gravity(0.7, height) - site.gravity) < 3.0 * site.gravity_sigma
    assert site.gravity_sigma < 2.3e-3
    assert site.height is None
    assert "no height was given" in site.source
    assert "--site LATITUDE,HEIGHT" in site.mend


def test_gravity_alone_is_good_to_half_its_last_digit_and_says_nothing_of_the_latitude():
    site = Site.from_gravity(9.81)
    assert (site.gravity, site.latitude) == (9.81, None)
    assert site.gravity_sigma == pytest.approx(0.005 / math.sqrt(3.0))
    assert Site.from_gravity("9.8100").gravity_sigma == pytest.approx(0.00005 / math.sqrt(3.0))
    assert Site.from_gravity("9.80788 +- 0.00002").gravity_sigma == 2e-5
    assert Site.from_gravity(9.80788, 0.0).gravity_sigma == 0.0
    assert Site(9.81, 0.0, 0.8, 300.0).with_gravity(Site(9.81, 0.0)).gravity == 9.81
    # neither one digit nor ± 5 is known worse than no place at all, and all places are within two sigma
    assert Site.from_gravity("9.80665±5").gravity_sigma == pytest.approx(Site.unknown().gravity_sigma)
    for wide in map(Site.from_gravity, ("9.8", "9.81±5", "9.83±0.05", "9.77±0.05")):
        assert max(abs(wide.gravity - place) for place in (9.78, 9.832)) < 2.0 * wide.gravity_sigma < 0.1
    # standard gravity is copied from a book: that of Singapore is 0.3 % less
    assert abs(Site.from_gravity(9.80665).gravity - 9.781) < 2.0 * Site.from_gravity("9.8067").gravity_sigma
    # rounded digits count where they tell of the height, and not where the place is known better
    assert Site.from_latitude(math.radians(-16.5)).with_gravity(Site.from_gravity(9.77)).gravity == 9.77
    assert Site.from_latitude(0.84, 520.0).with_gravity(Site.from_gravity(9.8)).gravity_sigma < 5e-4


def test_an_unknown_site_covers_the_earth_evenly():
    site = Site.unknown()
    assert site.gravity == STANDARD_GRAVITY == 9.80665
    # GUM 4.3.7: half-width over root three
    assert site.gravity_sigma == pytest.approx(0.026 / math.sqrt(3.0), rel=1e-12)
    assert abs(normal_gravity(0.0) - site.gravity) < 2 * site.gravity_sigma
    assert abs(normal_gravity(math.pi / 2) - site.gravity) < 2 * site.gravity_sigma


@pytest.mark.parametrize("latitude_in_degrees", [90.0, 45.0, 0.0, -30.0, -90.0])
def test_the_earth_rate_is_the_polar_axis_seen_in_north_east_down(latitude_in_degrees):
    latitude = math.radians(latitude_in_degrees)
    # Columns of C_ne: the Earth's axes in n at longitude zero, by geometry. z is the polar axis:
    # from the equator one turns by minus (90 degrees + latitude) about east (Groves 2.150).
    C_ne = Rotation.from_euler("y", math.pi / 2 + latitude).as_matrix()
    expected = C_ne @ [0.0, 0.0, 7.292115e-5]
    np.testing.assert_allclose(Site.from_latitude(latitude).earth_rate_n, expected, atol=1e-19)


def test_it_agrees_with_boule_on_the_ellipsoid_and_at_heights(reference_data):
    with (reference_data / "boule" / "normal_gravity.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["height_m"]) for row in rows].count(0.0) == 5
    assert len(rows) == 30
    for row in rows:
        latitude, height = math.radians(float(row["latitude_deg"])), float(row["height_m"])
        # the last digit of the published constants; at heights what the docstring says of a series, of which the
        # first term alone would miss by 3 (height / a)² g, 7e-5 at 10 km
        expected = pytest.approx(float(row["gravity"]), abs=1e-6 if height else 1e-10)
        assert normal_gravity(latitude, height) == expected


NO_SITE: list[tuple[Callable[[float], object], tuple[float, ...], str]] = [
    (
        lambda degrees: Site.from_latitude(math.radians(degrees)),
        (90.01, -120.0, math.nan, math.inf),
        "beyond the poles",
    ),
    (
        lambda height: Site.from_latitude(0.5, height),
        (-501.0, 10_001.0, math.nan),
        "not on the Earth's surface",
    ),
    (Site.from_gravity, (9.74, 9.86, 1.0, 981.0, -9.81, 0.0, math.nan), "nowhere on the Earth's surface"),
    (lambda gravity: Site.from_gravity(f"{gravity}±x"), (9.81, -1.0), r"is no number.*9\.80788±0\.00002"),
    (
        lambda gravity: Site.from_gravity(gravity).earth_rate_n,
        (9.81,),
        "needs a latitude: give --site LATITUDE",
    ),
]


@pytest.mark.parametrize(("make", "values", "said"), NO_SITE)
def test_what_is_no_site_is_refused(make, values, said):
    for value in values:
        with pytest.raises(SiteError, match=said):
            make(value)
