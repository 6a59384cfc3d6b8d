"""Which stretches of a recording are a sensor at rest, in words and ranges.

Everything that would be taken for noise and is none is looked for, said in a sentence, and, where that can
be done, left out: motion, steps of the level, channels that never change, rows that only repeat.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Table
from tumble.noise.deviation import find_pieces
from tumble.recording import Recording
from tumble.recording.doctor import channels_of
from tumble.recording.rest import block_statistics, smallest_step
from tumble.units import angular_rate_factor, specific_force_factor

_BLOCK = 1.0  # s, blocks whose scatter tells motion
_LEAST_BLOCK = 20  # samples
_LEAST_PIECE = 2.0  # s of rest that are worth keeping between two motions
_MOVING = 3.0  # times the scatter at rest; noise of 20 samples reaches 1.6 in a million blocks
_SMOOTH = 15.0  # times its roughness: noise of a sensor filtered to a hundredth of the rate has 5
# Beyond these, in SI, it is motion whatever the rest of the recording does: scatter in a second, and a gyro's level
# against its median, which no drift reaches.
_MOST_SCATTER = {"a": 0.5, "g": 0.1}  # m/s², rad/s
_MOST_RATE = 0.05  # rad/s
_LEVELS = 200  # means that a step or a trend is looked for in
_STEP = 10.0  # robust standard deviations of the change from one mean to the next
_TREND = 6.0
_REPEATS = 0.02  # share of rows like the one before that makes a resolution or a slow sensor
_TEMPERATURE_SPAN = 0.5  # degrees Celsius
_EXPLAINED = 0.5  # share of the slow variation that makes a temperature trend
_BRIDGED = 1e-3  # share of samples that may be filled in: less than any interval is wide

Ranges = tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Suitability:
    """What of a recording may be taken for noise.

    Attributes
    ----------
    recording : the recording; with a few lost samples filled in, where that was possible.
    pieces : half-open ranges of samples at rest, without gap or step.
    channels : names that are worth looking at, of ax to gz.
    remarks : sentences on what was found and what was done about it.
    shortest : s, averaging times below which the numbers are the converter's or the file's, not the sensor's.
    """

    recording: Recording
    pieces: Ranges
    channels: tuple[str, ...]
    remarks: tuple[str, ...]
    shortest: float

    @property
    def samples(self) -> int:
        """Samples in all pieces."""
        return sum(stop - start for start, stop in self.pieces)

    @property
    def longest(self) -> int:
        """Samples of the longest piece, 0 without one."""
        return max((stop - start for start, stop in self.pieces), default=0)


def judge_rest(recording: Recording) -> Suitability:
    """Find what of a recording is a sensor at rest.

    Parameters
    ----------
    recording : as read, in any unit.
    """
    remarks: list[str] = []
    recording = _bridged(recording, remarks)
    channels = channels_of(recording)
    alive = tuple(name for name, values in channels.items() if _changes(values))
    remarks += [
        f"{name} never changes ({float(channels[name][0]):g} throughout): a dead sensor or a wrong column; left out."
        for name in channels
        if name not in alive
    ]
    if not alive:
        return Suitability(recording, (), (), tuple(remarks), 0.0)
    signals = np.column_stack([channels[name] for name in alive])
    pieces = find_pieces(signals, recording.gaps)
    if len(pieces) > 1:
        remarks.append(
            f"Samples are missing in {len(pieces) - 1} place(s): the pieces between are taken apart and pooled; the "
            f"longest has {_longest(pieces) / recording.rate:.4g} s, which bounds the averaging times."
        )
    shortest = _repeated_rows(signals, recording.rate, remarks)
    pieces = _without_motion(signals, alive, pieces, recording, remarks)
    pieces = _without_steps(signals, alive, pieces, recording, remarks)
    if pieces:
        _say_trends(signals, alive, pieces, recording, remarks)
        _say_resolution(channels, alive, pieces, remarks)
    return Suitability(recording, tuple(pieces), alive, tuple(remarks), shortest)


def _unit(recording: Recording, name: str) -> str:
    return recording.angular_rate_unit if name.startswith("g") else recording.specific_force_unit


def _changes(values: Series) -> bool:
    good = values if np.isfinite(values.sum()) else values[np.isfinite(values)]
    return bool(good.size) and float(np.ptp(good)) > 0.0


def _longest(pieces: list[tuple[int, int]]) -> int:
    return max((stop - start for start, stop in pieces), default=0)


def _bridged(recording: Recording, remarks: list[str]) -> Recording:
    """Fill a few lost samples in, so that they do not bound the averaging times."""
    if not recording.gaps:
        return recording
    index = np.array(recording.gaps)
    lost = np.rint(np.diff(recording.time)[index - 1] * recording.rate).astype(int) - 1
    total, longest = int(lost.sum()), int(lost.max())
    if total > _BRIDGED * len(recording) or longest > recording.rate or lost.min() < 1:
        return recording
    remarks.append(
        f"{total} lost sample(s) in {len(index)} place(s) are filled in on a straight line, which takes that share "
        f"({100.0 * total / len(recording):.2g} %) off the variance at short averaging times."
    )
    grid = np.arange(len(recording), dtype=np.float64)
    grid += np.bincount(index, lost, minlength=len(recording))[: len(recording)].cumsum()
    full: Series = np.arange(float(grid[-1]) + 1.0)

    def filled(values: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64] | None:
        if values is None:
            return None
        result = np.empty((len(full), *values.shape[1:]))
        for place in np.ndindex(values.shape[1:]):
            result[:, *place] = np.interp(full, grid, values[:, *place])
        return result

    return replace(
        recording,
        time=np.interp(full, grid, recording.time),
        specific_force=filled(recording.specific_force),
        angular_rate=filled(recording.angular_rate),
        temperature=filled(recording.temperature),
        gaps=(),
    )


def _repeated_rows(signals: Table, rate: float, remarks: list[str]) -> float:
    """Say where rows only repeat the row before; return the averaging time from which that averages out."""
    same = np.all(signals[1:] == signals[:-1], axis=1)
    share = float(same.mean()) if same.size else 0.0
    if share < _REPEATS or signals.shape[1] < 2:
        return 0.0
    update = rate * (1.0 - share)
    shortest = 5.0 / update
    remarks.append(
        f"{100.0 * share:.0f} % of the rows repeat the row before in every channel: the sensor gave new values at "
        f"{update:.4g} Hz only, and averaging times below {shortest:.2g} s are not fitted. Record at the sensor's "
        "own rate."
    )
    return shortest


def _without_motion(
    signals: Table,
    names: tuple[str, ...],
    pieces: list[tuple[int, int]],
    recording: Recording,
    remarks: list[str],
) -> list[tuple[int, int]]:
    """Cut out blocks that scatter more than at rest, or turn, with a block to either side."""
    size = max(_LEAST_BLOCK, round(_BLOCK * recording.rate))
    statistics = [block_statistics(signals[start:stop], size) for start, stop in pieces]
    if sum(len(means) for means, _ in statistics) < 4:
        return pieces
    judged = _moving_blocks(statistics, signals, names, recording)
    if not any(np.any(moving) for moving in judged):
        return pieces
    kept: list[tuple[int, int]] = []
    least = max(2 * size, round(_LEAST_PIECE * recording.rate))
    for (start, stop), alone in zip(pieces, judged, strict=True):
        moving = alone.copy()
        moving |= np.append(alone[1:], False) | np.insert(alone[:-1], 0, False)
        edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]])))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            # What is left over after the last whole block belongs to it.
            end = stop if last == len(moving) else start + int(last) * size
            if end - start - int(first) * size >= least:
                kept.append((start + int(first) * size, end))
    before, after = (sum(b - a for a, b in some) for some in (pieces, kept))
    lost = (before - after) / recording.rate
    where = min(
        float(recording.time[start + int(np.argmax(moving)) * size])
        for (start, _), moving in zip(pieces, judged, strict=True)
        if np.any(moving)
    )
    remarks.append(
        f"The unit is not at rest all the time (first at t = {where:.4g} s): {lost:.4g} s of "
        f"{before / recording.rate:.4g} s are left out; the rests between, {len(kept)} of at least "
        f"{least / recording.rate:.2g} s, are taken apart and pooled."
        if kept
        else f"The unit never rests for {least / recording.rate:.2g} s or more: what it shows is motion, not noise."
    )
    return kept


def _moving_blocks(
    statistics: list[tuple[Table, Table]], signals: Table, names: tuple[str, ...], recording: Recording
) -> list[npt.NDArray[np.bool_]]:
    """Whether each block of each piece moves: against the quietest fifth of all, and in SI."""
    scatter = np.concatenate([each for _, each in statistics])
    level = np.median(np.concatenate([each for each, _ in statistics]), axis=0)
    step = np.array([smallest_step(signals[:, i]) for i in range(len(names))])
    # A hand that never rests is smooth: its scatter stands far above what second differences leave of it.
    rough = np.nanmedian(np.abs(np.diff(signals, 2, axis=0)), axis=0) / (0.6745 * np.sqrt(6.0))
    quiet = np.minimum(np.quantile(scatter, 0.2, axis=0), _SMOOTH * np.maximum(rough, step / np.sqrt(12.0)))
    limit = _MOVING * np.maximum(quiet, step / np.sqrt(12.0))
    reach = np.full(len(names), np.inf)
    for k, name in enumerate(names):
        gyro = name.startswith("g")
        unit = _unit(recording, name)
        factor = angular_rate_factor(unit) if gyro else specific_force_factor(unit)
        if factor is not None:
            limit[k] = min(float(limit[k]), _MOST_SCATTER[name[0]] / factor)
            reach[k] = _MOST_RATE / factor if gyro else np.inf
    return [np.any((each > limit) | (np.abs(means - level) > reach), axis=1) for means, each in statistics]


def _level_blocks(signals: Table, pieces: list[tuple[int, int]], rate: float) -> list[tuple[int, Table]]:
    """First sample and block means of each piece; about two hundred blocks in all, a quarter second at least."""
    total = sum(stop - start for start, stop in pieces)
    size = max(_LEAST_BLOCK, round(0.25 * rate), total // _LEVELS)
    return [(size, block_statistics(signals[start:stop], size)[0]) for start, stop in pieces]


def _without_steps(
    signals: Table,
    names: tuple[str, ...],
    pieces: list[tuple[int, int]],
    recording: Recording,
    remarks: list[str],
) -> list[tuple[int, int]]:
    """Part the pieces where the level of a channel jumps, as at a restart or a blow."""
    blocks = _level_blocks(signals, pieces, recording.rate)
    changes = [np.diff(means, axis=0) for _, means in blocks]
    every = np.concatenate(changes) if changes else np.zeros((0, len(names)))
    if len(every) < 10:
        return pieces
    spread = 1.4826 * np.median(np.abs(every - np.median(every, axis=0)), axis=0)
    result: list[tuple[int, int]] = []
    for (start, stop), (size, means), change in zip(pieces, blocks, changes, strict=True):
        cuts = [start]
        for k, channel in _jumps(means, change, spread):
            at = start + k * size + _jump_place(signals[start + k * size : start + (k + 2) * size, channel])
            # What a filter makes of a jump is left out with it.
            cuts += [at - _LEAST_BLOCK, at + _LEAST_BLOCK]
            remarks.append(
                f"{names[channel]} steps by {means[k + 2, channel] - means[k - 1, channel]:.3g} "
                f"{_unit(recording, names[channel])} at t = "
                f"{recording.time[at]:.5g} s, as at a restart or a blow: what is before and "
                "after is taken apart and pooled."
            )
        cuts.append(stop)
        result += [(a, b) for a, b in zip(cuts[::2], cuts[1::2], strict=True) if b - a >= 2 * size]
    return result


def _jumps(means: Table, change: Table, spread: Series) -> list[tuple[int, int]]:
    """Blocks before a jump that stays, and the channel of each; a trend's largest change is none."""
    found: list[tuple[int, int]] = []
    over = np.abs(change) / np.where(spread > 0.0, spread, np.inf)
    suspects = np.flatnonzero(np.any(over > _STEP, axis=1)).tolist()
    for k in suspects:
        channel = int(np.argmax(over[k]))
        if k < 4 or k + 6 > len(means) or (found and k <= found[-1][0] + 2):
            continue
        # The jump may be inside either of the two blocks whose means differ.
        before, after = means[k - 4 : k, channel], means[k + 2 : k + 6, channel]
        jump = abs(float(after.mean() - before.mean()))
        if jump > 5.0 * max(float(np.ptp(before)), float(np.ptp(after)), float(spread[channel])):
            found.append((k, channel))
    return found


def _jump_place(values: Series) -> int:
    """Index at which two means fit best: the sum of what is left over is then farthest from zero."""
    return int(np.argmax(np.abs(np.cumsum(values - values.mean())))) + 1


def _say_trends(
    signals: Table,
    names: tuple[str, ...],
    pieces: list[tuple[int, int]],
    recording: Recording,
    remarks: list[str],
) -> None:
    """Say which channels warm up, and which follow the temperature."""
    start, stop = max(pieces, key=lambda piece: piece[1] - piece[0])
    [(size, means)] = _level_blocks(signals, [(start, stop)], recording.rate)
    if len(means) < 40:
        return
    settled = _settling(means)
    warm = [name for name, blocks in zip(names, settled, strict=True) if blocks > 0]
    if warm:
        seconds = max(settled) * size / recording.rate
        remarks.append(
            f"{', '.join(warm)} drift at the start as a unit does that warms up; they are steady after some "
            f"{_duration(seconds)}. The curve's long end holds this drift: leave it out with `--skip {seconds:.0f}`."
        )
    celsius = recording.temperature
    if celsius is None:
        return
    part = celsius[start : start + size * len(means)].reshape(len(means), size).mean(axis=1)
    if not np.all(np.isfinite(part)) or float(np.ptp(part)) < _TEMPERATURE_SPAN:
        return
    warmth = part - part.mean()
    for k, name in enumerate(names):
        level = means[:, k] - means[:, k].mean()
        slope = float(warmth @ level / (warmth @ warmth))
        explained = 1.0 - float(np.sum((level - slope * warmth) ** 2) / np.sum(level**2))
        if explained > _EXPLAINED:
            remarks.append(
                f"{name} follows the temperature ({slope:.3g} {_unit(recording, name)} per °C over {np.ptp(part):.2g} "
                f"°C explain {100.0 * explained:.0f} % of its slow changes): `--remove-temperature` takes a straight "
                "line in it off."
            )


def _settling(means: Table) -> list[int]:
    """For each channel the block from which it is steady, 0 if it is from the first."""
    half = len(means) // 2
    result: list[int] = []
    for level in means.T:
        late = level[half:]
        # The late part's own trend is no warm-up.
        line = np.polynomial.Polynomial.fit(np.arange(half, len(level)), late, 1)
        left = level - line(np.arange(len(level)))
        spread = 1.4826 * float(np.median(np.abs(left[half:])))
        far = np.abs(left) > _TREND * spread
        tenth = max(3, len(level) // 20)
        starts_off = spread > 0.0 and bool(np.all(far[:tenth])) and bool(np.ptp(np.sign(left[:tenth])) == 0)
        inside = np.flatnonzero(~far)
        result.append(int(inside[0]) if starts_off and inside.size else 0)
    return result


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


def _say_resolution(
    channels: dict[str, Series], names: tuple[str, ...], pieces: list[tuple[int, int]], remarks: list[str]
) -> None:
    """Say which channels scatter over less than a converter's step, where rounding is no noise."""
    start, stop = max(pieces, key=lambda piece: piece[1] - piece[0])
    stop = min(stop, start + 100_000)
    coarse = [
        name
        for name in names
        if 0.0
        < float(np.std(np.diff(channels[name][start:stop]))) / np.sqrt(2.0)
        < 0.5 * smallest_step(channels[name][start:stop])
    ]
    if coarse:
        remarks.append(
            f"{', '.join(coarse)} scatter over less than one step of the converter: rounding is then no white noise, "
            "and short averaging times tell of the step, not of the sensor."
        )


__all__ = ["Suitability", "judge_rest"]
