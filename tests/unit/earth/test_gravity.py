"""Normal gravity, against the published constants of WGS 84 and another program."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest

from tumble.earth import normal_gravity


def test_gravity_at_the_equator_and_at_the_poles_is_what_wgs_84_publishes() -> None:
    # NGA.STND.0036, table 3.6, ten decimals; at the pole through Somigliana's k, given to 13 digits
    assert normal_gravity(0.0) == pytest.approx(9.7803253359, abs=5e-11)
    assert normal_gravity(math.pi / 2) == pytest.approx(9.8321849379, abs=2e-10)
    assert normal_gravity(-math.pi / 2) == normal_gravity(math.pi / 2)


def rows(reference_data: Path) -> list[tuple[float, float, float]]:
    with (reference_data / "boule" / "normal_gravity.csv").open() as file:
        return [
            (math.radians(float(row["latitude_deg"])), float(row["height_m"]), float(row["gravity"]))
            for row in csv.DictReader(file)
        ]


def test_it_agrees_with_boule_on_the_ellipsoid(reference_data: Path) -> None:
    on_ellipsoid = [row for row in rows(reference_data) if row[1] == 0.0]
    assert len(on_ellipsoid) == 5
    for latitude, height, gravity in on_ellipsoid:
        # the last digit of the published constants
        assert normal_gravity(latitude, height) == pytest.approx(gravity, abs=1e-10)


def test_it_agrees_with_boule_at_heights_to_what_the_docstring_says(reference_data: Path) -> None:
    at_heights = [row for row in rows(reference_data) if row[1] != 0.0]
    assert len(at_heights) == 25
    for latitude, height, gravity in at_heights:
        assert normal_gravity(latitude, height) == pytest.approx(gravity, abs=1e-6)
        # the series' first term alone would miss by 3 (height / a)² g, 7e-5 at 10 km
        assert abs(normal_gravity(latitude, 0.0) - gravity) > 1e-3
