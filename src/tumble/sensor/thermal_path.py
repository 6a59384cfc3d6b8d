"""`TemperaturePath`: how the sensor's temperature follows from the one that is recorded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tumble.arrays import Series
from tumble.records import dataclass


class ThermalState(NamedTuple):
    """What is carried from one block of a recording to the next.

    Attributes
    ----------
    time : s, of the last sample.
    recorded : °C, its recorded temperature.
    smooth, rate : °C and K/s, what the thermometer shows without noise and steps.
    sensor : °C, the sensor's own temperature.
    play : °C, where the hysteresis last followed the temperature to.
    hysteresis : -1 (after long cooling) to 1 (after long heating).
    """

    time: float
    recorded: float
    smooth: float
    rate: float
    sensor: float
    play: float
    hysteresis: float


@dataclass(frozen=True, slots=True)
class TemperaturePath:
    """The sensor's own temperature over a recording.

    Attributes
    ----------
    temperature : (samples,) °C.
    rate : (samples,) K/s.
    hysteresis : (samples,) -1 to 1.
    end : the state after the last sample, for the next block.
    """

    temperature: Series
    rate: Series
    hysteresis: Series
    end: ThermalState


def follow_temperature(
    time: Series,
    recorded: Series,
    *,
    smoothing: float,
    lag: float,
    hysteresis_width: float,
    dead_band: float = 0.0,
    start: ThermalState | None = None,
    start_hysteresis: float = 0.0,
) -> TemperaturePath:
    """Return the sensor's temperature, its rate and the hysteresis state from a recorded temperature.

    Three filters one after another, each exact for straight lines between samples, whatever their spacing:

    1. a critically damped observer of temperature and rate takes off noise and steps of the thermometer,
       x' = v + 2 (T - x) / smoothing, v' = (T - x) / smoothing²; it is not late on a ramp;
    2. the lag, y' = (x - y) / lag;
    3. the hysteresis, ds = (sign(dy) - s) |dy| / hysteresis_width, for what y moves beyond `dead_band`.

    Samples that are not numbers are filled with straight lines. Without `start` the observer begins with
    the line through the first `smoothing` seconds, and the sensor at the recorded temperature.

    Parameters
    ----------
    time : (samples,) s, not decreasing.
    recorded : (samples,) °C.
    smoothing, lag : s; zero for none.
    hysteresis_width, dead_band : K.
    start : the state that the block before ended with.
    start_hysteresis : without `start`, the state before the first sample.

    Raises
    ------
    ValueError
        If there is no sample, or no temperature among them that is a number.
    """
    from tumble.sensor import kernels

    if time.size == 0:
        raise ValueError("a temperature path has at least one sample")
    given = filled(time, recorded, start)
    if start is None:
        value, rate = _first_line(time, given, smoothing)
        start = ThermalState(float(time[0]), float(given[0]), value, rate, value, value, start_hysteresis)
    carried = np.array(start)
    path = np.empty((time.size, 3))
    kernels.follow_temperature(
        np.ascontiguousarray(time), given, smoothing, lag, hysteresis_width, dead_band, carried, path
    )
    temperature, rates, hysteresis = (np.ascontiguousarray(path[:, k]) for k in range(3))
    return TemperaturePath(temperature, rates, hysteresis, ThermalState(*carried.tolist()))


def filled(time: Series, recorded: Series, start: ThermalState | None = None) -> Series:
    """Return the temperature with samples that are not numbers filled by straight lines, ends held.

    Raises
    ------
    ValueError
        If no sample is a number.
    """
    known = np.isfinite(recorded)
    if known.all():
        return np.ascontiguousarray(recorded)
    times, values = np.asarray(time[known]), np.asarray(recorded[known])
    if start is not None:
        times = np.concatenate([np.array([start.time]), times])
        values = np.concatenate([np.array([start.recorded]), values])
    if not times.size:
        raise ValueError("no temperature is a number")
    return np.asarray(np.interp(time, times, values), dtype=np.float64)


def _first_line(time: Series, recorded: Series, smoothing: float) -> tuple[float, float]:
    """Return value and slope at the first sample of the line through the first `smoothing` seconds."""
    count = int(np.searchsorted(time, time.item(0) + smoothing, side="right"))
    if smoothing <= 0.0 or count < 3 or time[count - 1] <= time[0]:
        return recorded.item(0), 0.0
    since = time[:count] - time[0]
    middle = float(since.mean())
    centred = since - middle
    slope = float(np.sum(centred * recorded[:count])) / float(np.sum(centred**2))
    return float(recorded[:count].mean()) - slope * middle, slope
