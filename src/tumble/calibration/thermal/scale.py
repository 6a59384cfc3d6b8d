"""Whether a thermometer's numbers are degrees Celsius: its unit, the protocol's temperatures, and what is usual."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.errors import ObservabilityError
from tumble.protocol.steps import Protocol, RampStep, SoakStep
from tumble.recording.temperature import COLDEST, HOTTEST

USUAL_HOTTEST = 85.0  # °C
# Tests begin or end in a room, or pass it.
ROOM = 10.0, 32.0  # °C
# From a freezer to a warm room is a usual test in °F, too.
COLDEST_FREEZER, WARM_ROOM = -25.0, 15.0  # °C
# Numbers of a soak or ramp are this near the protocol's, in the right unit: a tenth of its span, at least so much.
NEAR, NEAR_SHARE = 5.0, 0.1  # K
_SAY = "Say the unit: add degF (or degC, K) to the --units, or give --units degF alone"


def check_unit(values: Series, unit: str | None, protocol: Protocol | None = None) -> list[str]:
    """Refuse a temperature that is not in °C, as it looks, and ask where nothing shows it.

    Parameters
    ----------
    values : finite numbers of the column, in °C if the unit was said.
    unit : as the file or the user says; None if nobody does.
    protocol : what temperatures were to be, if somebody said.

    Returns
    -------
    cautions : a sentence where the numbers would do as well in °F.

    Raises
    ------
    ObservabilityError
        If they are kelvins, counts, or as it looks °F.
    """
    low, high = (float(value) for value in np.quantile(values, [0.002, 0.998]))
    said = f"The temperature goes from {low:.4g} to {high:.4g}"
    if low < COLDEST or high > HOTTEST:
        in_kelvin = low > 200.0 and high < 400.0
        if unit is not None:
            raise ObservabilityError(
                f"{said} °C, read as {unit}: that is no temperature of a sensor. {_SAY}."
            )
        if in_kelvin:
            raise ObservabilityError(
                f"{said}, which are no °C, but kelvins, as it looks: add K to the --units."
            )
        raise ObservabilityError(
            f"{said}, which is no temperature in °C (raw counts?): convert the column to °C by the sensor's data "
            "sheet (of an MPU-6000: number / 340 + 36.53)."
        )
    planned = _planned(protocol)
    if unit is not None and planned is None:
        return []
    if planned is not None:
        _refuse_other_plan(low, high, planned, unit)
        return []
    return _ask(low, high, said)


def _planned(protocol: Protocol | None) -> tuple[float, float] | None:
    """Return the lowest and highest temperature of a protocol; None where it has none."""
    at: list[float] = []
    for step in () if protocol is None else protocol.steps:
        if isinstance(step, SoakStep):
            at.append(step.temperature_celsius)
        elif isinstance(step, RampStep):
            at += [step.start_celsius, step.stop_celsius]
    return (min(at), max(at)) if at else None


def _refuse_other_plan(low: float, high: float, planned: tuple[float, float], unit: str | None) -> None:
    """Refuse numbers that fit the protocol's temperatures in °F and not in °C."""
    allowed = max(NEAR, NEAR_SHARE * (planned[1] - planned[0]))

    def off(first: float, last: float) -> float:
        return max(abs(first - planned[0]), abs(last - planned[1]))

    fahrenheit = off((low - 32.0) / 1.8, (high - 32.0) / 1.8)
    if unit is None and fahrenheit <= allowed < off(low, high):
        raise ObservabilityError(
            f"The temperature goes from {low:.4g} to {high:.4g}, and the protocol from {planned[0]:g} to "
            f"{planned[1]:g} °C: that fits if the column is in °F. {_SAY}."
        )


def _ask(low: float, high: float, said: str) -> list[str]:
    """Refuse what is unusual in °C and usual in °F; caution where both are usual."""
    cold, hot = (low - 32.0) / 1.8, (high - 32.0) / 1.8
    meets_room = low <= ROOM[1] and high >= ROOM[0]
    would_meet_room = cold <= ROOM[1] and hot >= ROOM[0]
    if high > USUAL_HOTTEST or (not meets_room and would_meet_room):
        why = (
            f"hotter than most sensors may get ({USUAL_HOTTEST:g} °C)"
            if high > USUAL_HOTTEST
            else "which never comes near that of a room"
        )
        raise ObservabilityError(
            f"{said}, {why}, and nobody says in which unit: as °F it would be {cold:.1f} to {hot:.1f} °C. {_SAY}."
        )
    if cold > COLDEST_FREEZER and hot > WARM_ROOM:
        as_well = f"in °F it would be {cold:.1f} to {hot:.1f} °C, a usual test, too"
        return [f"{said} and is taken as °C, because nothing says otherwise; {as_well}. {_SAY}."]
    return []
