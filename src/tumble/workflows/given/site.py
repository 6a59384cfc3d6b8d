"""From what the user says of the place to a `Site`."""

from __future__ import annotations

import math

from tumble.earth import Site
from tumble.errors import SiteError, UsageError


def choose_site(site: str | None, gravity: str | None) -> Site | None:
    """Return the site for ``--site LATITUDE[,HEIGHT]`` (degrees, metres) or ``--gravity G[±U]`` (m/s²).

    None if neither is given.

    With both, gravity is the one given, unless latitude and height tell it better than its digits do; see
    `Site.with_gravity`. The latitude determines the Earth rate's direction.

    Raises
    ------
    UsageError
        If `site` is not one or two numbers.
    SiteError
        If the place or the gravity is none of the Earth's.
    """
    if site is None:
        return None if gravity is None else Site.from_gravity(gravity)
    try:
        numbers = [float(part) for part in site.split(",")]
    except ValueError:
        numbers = []
    if not 1 <= len(numbers) <= 2 or not all(math.isfinite(number) for number in numbers):
        raise UsageError(
            f"--site {site} is not LATITUDE[,HEIGHT] in degrees and metres, for example --site 48.1,520."
        )
    if abs(numbers[0]) > 90.0:
        raise SiteError(f"The latitude {numbers[0]:g} is beyond the poles: give degrees from -90 to 90.")
    place = Site.from_latitude(math.radians(numbers[0]), *numbers[1:])
    return place if gravity is None else place.with_gravity(Site.from_gravity(gravity))


def given_site(site: object) -> Site | None:
    """Return a site that a program gave, or None.

    Raises
    ------
    UsageError
        If it is something else, of which nobody knows whether it is in degrees or radians.
    SiteError
        If its gravity is not that of its latitude and height.
    """
    if site is None:
        return None
    if isinstance(site, Site):
        if site.latitude is not None:
            site.with_gravity(site)
        return site
    raise UsageError(
        f"site is a {type(site).__name__}: give a tumble.Site, as tumble.Site.from_latitude(math.radians(48.1), 520.0) "
        "with the latitude in rad and the height in m, or tumble.Site.from_gravity(9.81)."
    )
