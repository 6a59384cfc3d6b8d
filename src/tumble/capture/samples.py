"""What is known of a source's samples before the first one comes."""

from __future__ import annotations

from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
class Channels:
    """What a source sends.

    Attributes
    ----------
    specific_force_unit, angular_rate_unit : names that `tumble.units` knows, or "counts"; None where a triad is
        missing.
    rate : nominal, Hz.
    temperature : whether there is one, in °C.
    remarks : what was found or assumed, as sentences.
    magnetic_field_unit : of the magnetometer, empty where nobody says it; None without one.
    """

    specific_force_unit: str | None
    angular_rate_unit: str | None
    rate: float
    temperature: bool = False
    remarks: tuple[str, ...] = ()
    magnetic_field_unit: str | None = None
