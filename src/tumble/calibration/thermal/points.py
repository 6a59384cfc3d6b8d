"""Points of a thermal test: short rests, each with its temperature, its way there and the means of both triads."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Table, Vectors
from tumble.errors import ObservabilityError
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import Timeline, mean_covariance, rounding_variance
from tumble.sensor import TemperatureBasis, ThermalModel, follow_temperature

# A rest is cut where its temperature changes by more than this, or where it lasts longer.
CUT_KELVINS, CUT_SECONDS = 1.0, 600.0
# A rest of fewer seconds is no point.
LEAST_SECONDS = 2.0
# The path is followed on means of the thermometer over this long: finer is nothing to a unit with a mass.
GRID = 1.0  # s
# A rest whose means scatter by so many times the usual variance was disturbed.
UNQUIET = 10.0
# Two rests beside a knock are two placements where their means differ by so many of their standard deviations.
TURNED = 5.0


@dataclass(frozen=True)
class ThermalPath:
    """The temperature of the sensor on a grid, and which part of it each point is.

    Attributes
    ----------
    time, recorded : (grid,) s, °C.
    edges : (points, 2) indices into the grid.
    """

    time: Series
    recorded: Series
    edges: np.ndarray

    def followed(self, lag: float, width: float) -> tuple[Series, Series, Series]:
        """Return (grid,) of temperature, its rate and hysteresis, as `ThermalModel.path` follows them."""
        usual = {name: ThermalModel.__dataclass_fields__[name].default for name in ("smoothing", "dead_band")}
        lag = max(lag, 0.0)
        path = follow_temperature(self.time, self.recorded, lag=lag, hysteresis_width=width, **usual)
        return path.temperature, path.rate, path.hysteresis

    def means(self, values: Table) -> Table:
        """Return (points, columns) of the means of (grid, columns) over each point."""
        sums = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        first, last = self.edges[:, 0], self.edges[:, 1]
        return (sums[last] - sums[first]) / (last - first)[:, None]


@dataclass(frozen=True)
class ThermalPoints:
    """Means over short rests.

    Attributes
    ----------
    start, stop : (points,) s.
    hold : (points,) index of the timeline's hold.
    placement : (points,) which rest it belongs to, with neither a turn nor a knock that moved it in between.
    force, force_covariance : (points, 3), (points, 3, 3) raw; None without an accelerometer.
    rate, rate_covariance : of the gyros; None without.
    path : of the temperature.
    celsius, celsius_rate, hysteresis : (points,) °C, K/s, -1 to 1, with the lag that is assumed at first.
    """

    start: Series
    stop: Series
    hold: np.ndarray
    placement: np.ndarray
    force: Vectors | None
    force_covariance: Matrices | None
    rate: Vectors | None
    rate_covariance: Matrices | None
    path: ThermalPath
    celsius: Series
    celsius_rate: Series
    hysteresis: Series

    def __len__(self) -> int:
        return int(self.start.size)

    def only(self, keep: np.ndarray) -> ThermalPoints:
        """Return the points where `keep` is true, or those of an index array."""
        kinds = (field.name for field in fields(self) if field.name != "path")
        own = {name: each[keep] for name in kinds if (each := getattr(self, name)) is not None}
        return replace(self, path=replace(self.path, edges=self.path.edges[keep]), **own)

    def functions(self, basis: TemperatureBasis, lag: float, width: float) -> Table:
        """Return (points, functions + 3): one, and means of the basis' functions, of the rate and of the hysteresis."""
        celsius, rate, hysteresis = self.path.followed(lag, width)
        means = self.path.means(np.column_stack([basis.values(celsius), rate, hysteresis]))
        return np.column_stack([np.ones(len(self)), means])


def find_points(recording: Recording, timeline: Timeline) -> ThermalPoints:
    """Cut the rests of a recording into points.

    A rest that lasts longer than ten minutes, or over which the temperature changes by more than 1 K, is cut into
    parts that do not. Means are those of all samples; their covariance is found after a straight line
    in time is taken off each point, so that what temperature does within it is not taken for noise.

    Raises
    ------
    ObservabilityError
        If there is no rest of two seconds.
    """
    time, celsius = _grid(recording)
    stretches, holds = _cut(recording, timeline, time, celsius)
    if not stretches:
        raise ObservabilityError(
            "No rest of two seconds was found: let the unit lie still at each temperature, or in a slow sweep."
        )
    start = np.array([recording.time[a] for a, _ in stretches])
    stop = np.array([recording.time[b - 1] for _, b in stretches])
    edges = np.column_stack([np.searchsorted(time, start), np.searchsorted(time, stop, side="right")])
    edges[:, 0] = np.clip(edges[:, 0], 0, time.size - 1)
    edges[:, 1] = np.maximum(edges[:, 1], edges[:, 0] + 1)
    path = ThermalPath(time, celsius, edges)
    means = path.means(np.column_stack(path.followed(0.0, 5.0)))
    return ThermalPoints(
        start,
        stop,
        np.array(holds),
        _placements(recording, stretches, holds),
        *_means(recording.specific_force, stretches),
        *_means(recording.angular_rate, stretches),
        path,
        *np.ascontiguousarray(means.T),
    )


def _grid(recording: Recording) -> tuple[Series, Series]:
    """Return time and temperature, averaged over a second where samples are denser."""
    assert recording.temperature is not None
    known = np.isfinite(recording.temperature)
    time, celsius = recording.time[known], recording.temperature[known]
    count = max(int(GRID * recording.rate), 1)
    whole = time.size // count * count
    return time[:whole].reshape(-1, count).mean(axis=1), celsius[:whole].reshape(-1, count).mean(axis=1)


def _cut(
    recording: Recording, timeline: Timeline, time: Series, celsius: Series
) -> tuple[list[tuple[int, int]], list[int]]:
    """Return the sample ranges of the points, and the hold of each."""
    path = ThermalPath(time, celsius, np.zeros((0, 2), dtype=np.int64))
    smooth = path.followed(0.0, 5.0)[0]
    stretches: list[tuple[int, int]] = []
    holds: list[int] = []
    least = max(2, round(LEAST_SECONDS * recording.rate))
    for number, hold in enumerate(timeline.holds):
        for first, last in hold.stretches():
            if last - first < least:
                continue
            at = np.linspace(first, last - 1, 64)
            inside = np.interp(recording.time[at.astype(int)], time, smooth)
            # Up and down within one rest both count; where temperature goes fast, points are short.
            seconds = float(recording.time[last - 1] - recording.time[first])
            passed = np.abs(np.diff(inside)) / CUT_KELVINS + seconds / CUT_SECONDS / 63.0
            measure = np.concatenate([np.zeros(1), np.cumsum(passed)])
            parts = max(1, min(int(np.ceil(measure[-1])), (last - first) // least))
            whole: Series = np.linspace(0.0, float(measure[-1]), parts + 1)
            cuts: np.ndarray = np.asarray(np.interp(whole, measure, at), dtype=np.int64)
            cuts[-1] = last
            cuts = cuts[np.concatenate([np.diff(cuts) >= least, [True]])] if parts > 1 else cuts
            cuts[0] = first
            stretches += list(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True))
            holds += [number] * (len(cuts) - 1)
    return stretches, holds


def _placements(recording: Recording, stretches: list[tuple[int, int]], holds: list[int]) -> np.ndarray:
    """Return (points,) which of them are one placement: those with nothing between them that turned gravity."""
    placement = [0]
    for (before, after), (hold, following) in zip(pairwise(stretches), pairwise(holds), strict=True):
        together = after[0] - before[1] <= 0.5 * recording.rate or hold == following
        placement.append(placement[-1] + (not together or _turned(recording, before, after)))
    return np.array(placement, dtype=int)


def _turned(recording: Recording, before: tuple[int, int], after: tuple[int, int]) -> bool:
    """Return whether gravity lies otherwise beyond noise after a knock: in so short a time temperature does nothing."""
    if recording.specific_force is None or before[1] == after[0]:
        return False
    size = min(round(LEAST_SECONDS * recording.rate), before[1] - before[0], after[1] - after[0])
    ends = recording.specific_force[before[1] - size : before[1]], recording.specific_force[after[0] :][:size]
    noise = np.sqrt(sum(np.var(part, axis=0, ddof=1) for part in ends) / size)
    return bool(np.any(np.abs(ends[1].mean(axis=0) - ends[0].mean(axis=0)) > TURNED * noise))


def _means(
    signal: Vectors | None, stretches: list[tuple[int, int]]
) -> tuple[Vectors, Matrices] | tuple[None, None]:
    """Return means, and their covariance without what a straight line in time explains."""
    if signal is None:
        return None, None
    parts: list[AnyArray] = []
    means, count = np.empty((len(stretches), 3)), np.array([last - first for first, last in stretches])
    for k, (first, last) in enumerate(stretches):
        values = np.asarray(signal[first:last], dtype=float)
        means[k] = values.mean(axis=0)
        since = np.arange(last - first) - 0.5 * (last - first - 1)
        slope = since @ values / max(float(since @ since), 1.0)
        parts.append(values - since[:, None] * slope)
    ends = [0, *np.cumsum(count).tolist()]
    # White noise alone: what neighbouring rests have in common is found from their residuals, and what of it is inside
    # a rest, where batch means see it, would be taken for noise that they have not in common.
    beside = mean_covariance(
        np.concatenate(parts), [[rest] for rest in pairwise(ends)], span=1, rounding=np.zeros_like(means)
    )
    batches = np.diagonal(beside.covariance, axis1=1, axis2=2)
    # A rest that is far less quiet than the others keeps its own.
    unquiet = batches * count[:, None] > UNQUIET * np.median(batches * count[:, None], axis=0)
    white = np.where(unquiet, batches, np.minimum(white_variance(parts) / count[:, None], batches))
    rounding = rounding_variance(signal, [[rest] for rest in stretches], means)
    return means, (white + rounding)[:, :, None] * np.eye(3)


def white_variance(parts: list[AnyArray]) -> Series:
    """Return (3,) the variance of white noise of one sample, beside flicker, from the Allan variance up to ten seconds.

    Allan variances of m samples times m are the line ``white + flicker m``; m from 4 on, because filters in the sensor
    make neighbouring samples alike.

    Parameters
    ----------
    parts : (samples, 3) of each rest.
    """
    counts = {m: sum(len(p) // m - 1 for p in parts if len(p) >= 2 * m) for m in (4, 8, 16, 32, 64, 128)}
    sizes = [m for m, count in counts.items() if count > 30]
    if len(sizes) < 2:
        squares = np.sum([np.sum(np.diff(p, axis=0) ** 2, axis=0) for p in parts], axis=0)
        return squares / (2.0 * sum(len(p) - 1 for p in parts))
    level, weight = np.empty((len(sizes), 3)), np.empty((len(sizes), 3))
    for row, m in enumerate(sizes):
        whole = [p[: len(p) // m * m].reshape(-1, m, 3).mean(axis=1) for p in parts if len(p) >= 2 * m]
        changes = np.concatenate([np.diff(means, axis=0) for means in whole])
        level[row] = 0.5 * m * np.mean(changes**2, axis=0)
        weight[row] = np.sqrt(len(changes)) / np.maximum(level[row], 1e-300)
    white = np.empty(3)
    design = np.column_stack([np.ones(len(sizes)), np.array(sizes, dtype=float)])
    for axis in range(3):
        scaled = weight[:, axis]
        line = np.linalg.lstsq(design * scaled[:, None], level[:, axis] * scaled, rcond=None)[0]
        # Without flicker the line may come out falling: then all of it is white.
        white[axis] = line[0] if line[1] > 0.0 else np.sum(scaled**2 * level[:, axis]) / np.sum(scaled**2)
    least = 0.1 * level.min(axis=0)
    return np.maximum(white, least)
