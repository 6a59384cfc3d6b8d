"""The Earth's magnetic field at a place and date, by the World Magnetic Model."""

from __future__ import annotations

import calendar
import math
from datetime import date
from importlib import import_module
from typing import Any

from tumble.errors import SiteError, UsageError, install
from tumble.records import dataclass

# Years for which the model's reports state its errors: WMM2015 (Chulliat and others 2015) to WMM2025.
FIRST, LAST = 2015, 2030


@dataclass(frozen=True)
class EarthField:
    """The field of a model, with the standard uncertainties that its report states: of the model and of the crust.

    Attributes
    ----------
    norm, norm_sigma : T.
    dip, dip_sigma : rad, down positive.
    model : its name and year, such as "WMM-2025".
    """

    norm: float
    norm_sigma: float
    dip: float
    dip_sigma: float
    model: str


def earth_field(latitude: float, longitude: float, height: float, day: date) -> EarthField:
    """Return the Earth's magnetic field by the World Magnetic Model.

    Parameters
    ----------
    latitude, longitude : geodetic, rad.
    height : m above the ellipsoid.
    day : of the recording.

    Raises
    ------
    SiteError
        If no model states its errors for that day.
    UsageError
        If the library of the model is missing.
    """
    if not FIRST <= day.year < LAST:
        raise SiteError(
            f"The World Magnetic Model states its errors from {FIRST} to {LAST - 1}, not for {day.isoformat()}: "
            "give the field itself, --field NORM,DIP."
        )
    try:
        library: Any = import_module("pygeomag")
    except ImportError:
        raise UsageError(
            f"The World Magnetic Model needs pygeomag: {install('magnetic')}, or give the field itself, "
            "--field NORM,DIP."
        ) from None
    days = 366 if calendar.isleap(day.year) else 365
    model = library.GeoMag(base_year=day.year)
    found = model.calculate(
        glat=math.degrees(latitude),
        glon=math.degrees(longitude),
        alt=1e-3 * height,
        time=day.year + (day.timetuple().tm_yday - 1) / days,
    )
    errors = found.calculate_uncertainty()
    return EarthField(
        1e-9 * found.f, 1e-9 * errors.f, math.radians(found.i), math.radians(errors.i), str(model.model)
    )
