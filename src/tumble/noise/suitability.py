"""Which stretches of a recording are a sensor at rest, in words and ranges.

Everything that would be taken for noise and is none is looked for, said in a sentence, and, where that can
be done, left out: motion, steps of the level, channels that never change, rows that only repeat.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Table
from tumble.noise.evidence import Blocks, Piece, RestEvidence
from tumble.noise.held import REPEATS
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor

_BLOCK = 1.0  # s, blocks whose scatter shows motion
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
_TEMPERATURE_SPAN = 0.5  # degrees Celsius
_EXPLAINED = 0.5  # share of the slow variation that makes a temperature trend
# A unit at rest shows gravity where it is: half a degree is 9 mg, nine times what the bias of a consumer unit drifts by
# over 5 K (see FAR_FROM_CALIBRATION in workflows/temperature).
_LEANS = np.radians(0.5)
_MOST_SAID = 3  # steps that are told one by one

Ranges = tuple[Piece, ...]


@dataclass(frozen=True)
class Suitability:
    """What of a recording may be taken for noise.

    Attributes
    ----------
    pieces : half-open ranges of samples at rest, without gap or step.
    channels : names that are worth looking at, of ax to gz.
    remarks : sentences on what was found and what was done about it.
    shortest : s, averaging times below which the numbers are the converter's or the file's, not the sensor's.
    """

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


def judge_rest(evidence: RestEvidence) -> Suitability:
    """Find what of a recording is a sensor at rest.

    Parameters
    ----------
    evidence : of the recording, whole or gathered from its blocks.
    """
    remarks = [
        f"{name} never changes ({level:g} throughout): a dead sensor or a wrong column; left out."
        for name, level, alive in zip(evidence.names, evidence.level, evidence.alive, strict=True)
        if not alive
    ]
    lively = np.flatnonzero(evidence.alive)
    if not lively.size:
        levels = zip(evidence.names, evidence.level, strict=True)
        each = ", ".join(f"{name} {level:g}" for name, level in levels)
        said = f"No channel ever changes ({each}): dead sensors, or columns that are no signals."
        return Suitability((), (), (said,), 0.0)
    task = _Judgement(evidence, lively, remarks)
    pieces = list(evidence.pieces)
    if len(pieces) > 1:
        remarks.append(
            f"Samples are missing in {len(pieces) - 1} place(s): the pieces between are taken apart and pooled; the "
            f"longest has {_longest(pieces) / evidence.rate:.4g} s, which bounds the averaging times."
        )
    shortest = _repeated_rows(task)
    pieces = _without_motion(task, pieces)
    pieces = _without_steps(task, pieces)
    if pieces:
        _say_leaning(task, pieces)
        _say_trends(task, pieces)
        _say_resolution(task)
    return Suitability(tuple(pieces), task.names, tuple(remarks), shortest)


@dataclass(frozen=True)
class _Judgement:
    """The evidence on the channels that live, and what was said of it so far."""

    evidence: RestEvidence
    lively: npt.NDArray[np.intp]
    remarks: list[str]

    @property
    def rate(self) -> float:
        return self.evidence.rate

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.evidence.names[int(k)] for k in self.lively)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(self.evidence.units[int(k)] for k in self.lively)

    def blocks(self, piece: Piece, size: int) -> Blocks:
        found = self.evidence.blocks(piece, size)
        return Blocks(found.first, found.size, found.means[:, self.lively], found.scatter[:, self.lively])


def _longest(pieces: list[Piece]) -> int:
    return max((stop - start for start, stop in pieces), default=0)


def _repeated_rows(task: _Judgement) -> float:
    """Say where rows only repeat the row before; return the averaging time from which that averages out."""
    share = task.evidence.repeats
    if share < REPEATS or len(task.names) < 2:
        return 0.0
    update = task.rate * (1.0 - share)
    shortest = 5.0 / update
    task.remarks.append(
        f"{100.0 * share:.0f} % of the rows repeat the row before in every channel, in no order. Lost "
        "rows that were replaced by the row before look like that. Averaging times below "
        f"{shortest:.2g} s are not fitted."
    )
    return shortest


def _without_motion(task: _Judgement, pieces: list[Piece]) -> list[Piece]:
    """Cut out blocks that scatter more than at rest, or turn, with a block to either side."""
    rate, evidence = task.rate, task.evidence
    wanted = max(_LEAST_BLOCK, round(_BLOCK * rate))
    statistics = [task.blocks(piece, wanted) for piece in pieces]
    if sum(len(each.means) for each in statistics) < 4:
        return pieces
    judged = _moving_blocks(task, statistics)
    if not any(np.any(moving) for moving in judged):
        return pieces
    kept: list[Piece] = []
    least = max(2 * wanted, round(_LEAST_PIECE * rate))
    for (_, stop), each, alone in zip(pieces, statistics, judged, strict=True):
        moving = alone.copy()
        moving |= np.append(alone[1:], False) | np.insert(alone[:-1], 0, False)
        edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]])))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            # What is left over after the last whole block belongs to it.
            begin = each.first + int(first) * each.size
            end = stop if last == len(moving) else each.first + int(last) * each.size
            if end - begin >= least:
                kept.append((begin, end))
    before, after = (sum(b - a for a, b in some) for some in (pieces, kept))
    where = min(
        evidence.time_at(each.first + int(np.argmax(moving)) * each.size)
        for each, moving in zip(statistics, judged, strict=True)
        if np.any(moving)
    )
    task.remarks.append(
        f"The unit is not at rest all the time (first at t = {where:.4g} s): "
        f"{(before - after) / rate:.4g} s of {before / rate:.4g} s are left out. The rests between, "
        f"{len(kept)} of at least {least / rate:.2g} s, are taken apart and pooled."
        if kept
        else f"The unit never rests for {least / rate:.2g} s or more: what it shows is motion, not noise."
    )
    return kept


def _moving_blocks(task: _Judgement, statistics: list[Blocks]) -> list[npt.NDArray[np.bool_]]:
    """Whether each block of each piece moves: against the quietest fifth of all, and in SI."""
    scatter = np.concatenate([each.scatter for each in statistics])
    level = np.median(np.concatenate([each.means for each in statistics]), axis=0)
    step, rough = task.evidence.step[task.lively], task.evidence.rough[task.lively]
    # A hand that never rests is smooth: its scatter stands far above what second differences leave of it.
    quiet = np.minimum(np.quantile(scatter, 0.2, axis=0), _SMOOTH * np.maximum(rough, step / np.sqrt(12.0)))
    limit = _MOVING * np.maximum(quiet, step / np.sqrt(12.0))
    reach = np.full(len(task.names), np.inf)
    for k, (name, unit) in enumerate(zip(task.names, task.units, strict=True)):
        gyro = name.startswith("g")
        factor = angular_rate_factor(unit) if gyro else specific_force_factor(unit)
        if factor is not None:
            limit[k] = min(float(limit[k]), _MOST_SCATTER[name[0]] / factor)
            reach[k] = _MOST_RATE / factor if gyro else np.inf
    return [
        np.any((each.scatter > limit) | (np.abs(each.means - level) > reach), axis=1) for each in statistics
    ]


def _level_blocks(task: _Judgement, pieces: list[Piece]) -> list[Blocks]:
    """Block means of each piece; about two hundred blocks in all, a quarter second at least."""
    total = sum(stop - start for start, stop in pieces)
    size = max(_LEAST_BLOCK, round(0.25 * task.rate), total // _LEVELS)
    return [task.blocks(piece, size) for piece in pieces]


def _without_steps(task: _Judgement, pieces: list[Piece]) -> list[Piece]:
    """Part the pieces where the level of a channel jumps, as at a restart or a blow."""
    blocks = _level_blocks(task, pieces)
    changes = [np.diff(each.means, axis=0) for each in blocks]
    every = np.concatenate(changes) if changes else np.zeros((0, len(task.names)))
    if len(every) < 10:
        return pieces
    spread = 1.4826 * np.median(np.abs(every - np.median(every, axis=0)), axis=0)
    result: list[Piece] = []
    said: list[str] = []
    for (start, stop), each, change in zip(pieces, blocks, changes, strict=True):
        cuts = [start]
        for k, channel in _jumps(each.means, change, spread):
            begin = each.first + k * each.size
            place = int(task.lively[channel])
            at = task.evidence.jump_place(begin, begin + 2 * each.size, place)
            # What a filter makes of a jump is left out with it.
            cuts += [at - _LEAST_BLOCK, at + _LEAST_BLOCK]
            size = each.means[k + 2, channel] - each.means[k - 1, channel]
            said.append(
                f"{task.names[channel]} steps by {size:.3g} {task.units[channel]} at t = "
                f"{task.evidence.time_at(at):.5g} s, as at a restart or a blow: what is before and "
                "after is taken apart and pooled."
            )
        cuts.append(stop)
        result += [(a, b) for a, b in zip(cuts[::2], cuts[1::2], strict=True) if b - a >= 2 * each.size]
    if len(said) > _MOST_SAID:
        said = [*said[:_MOST_SAID], f"So it is in {len(said) - _MOST_SAID} more place(s)."]
    task.remarks.extend(said)
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


def _say_leaning(task: _Judgement, pieces: list[Piece]) -> None:
    """Say that gravity goes to and fro in the unit's axes, more slowly than scatter shows."""
    at = [k for k, name in enumerate(task.names) if name.startswith("a")]
    if len(at) < 3:
        return
    size = max(_LEAST_BLOCK, round(_BLOCK * task.rate))
    means = np.concatenate([task.blocks(piece, size).means[:, at] for piece in pieces])
    if len(means) < 4:
        return
    middle = np.median(means, axis=0)
    away = np.linalg.norm(np.cross(means, middle), axis=1)
    angles = np.arctan2(away, means @ middle)
    leans = float(np.quantile(angles, 0.9))
    if leans > _LEANS:
        task.remarks.append(
            f"Gravity goes to and fro in the unit's axes by {float(f'{np.degrees(leans):.2g}'):g}° (a tenth of the "
            "time by more): the unit turns slowly, it is not at rest. What is slower than a second below is that "
            "motion, not the sensors' noise; record again on something firm."
        )


def _say_trends(task: _Judgement, pieces: list[Piece]) -> None:
    """Say which channels warm up, and which follow the temperature."""
    longest = max(pieces, key=lambda piece: piece[1] - piece[0])
    [each] = _level_blocks(task, [longest])
    means = each.means
    if len(means) < 40:
        return
    settled = _settling(means)
    warm = [name for name, blocks in zip(task.names, settled, strict=True) if blocks > 0]
    if warm:
        seconds = max(settled) * each.size / task.rate
        task.remarks.append(
            f"{', '.join(warm)}: the level drifts at the start as a unit's does that warms up; it is steady after some "
            f"{_duration(seconds)}. The curve's long end holds this drift: leave it out with `--skip {seconds:.0f}`."
        )
    part = task.evidence.temperature(longest, each.size)
    if part is None or not np.all(np.isfinite(part)) or float(np.ptp(part)) < _TEMPERATURE_SPAN:
        return
    warmth = part - part.mean()
    for k, (name, unit) in enumerate(zip(task.names, task.units, strict=True)):
        level = means[:, k] - means[:, k].mean()
        slope = float(warmth @ level / (warmth @ warmth))
        explained = 1.0 - float(np.sum((level - slope * warmth) ** 2) / np.sum(level**2))
        if explained > _EXPLAINED:
            task.remarks.append(
                f"{name} follows the temperature ({slope:.3g} {unit} per °C over {np.ptp(part):.2g} "
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


def _say_resolution(task: _Judgement) -> None:
    """Say which channels scatter over less than a converter's step, where rounding is no noise."""
    jitter, step = task.evidence.jitter[task.lively], task.evidence.step[task.lively]
    coarse = [
        name for name, each, size in zip(task.names, jitter, step, strict=True) if 0.0 < each < 0.5 * size
    ]
    if coarse:
        task.remarks.append(
            f"{', '.join(coarse)} scatter over less than one step of the converter: rounding is then "
            "no white noise, and short averaging times show the step, not the sensor."
        )
