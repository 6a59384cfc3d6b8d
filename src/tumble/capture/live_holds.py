"""Holds found while the recording goes on, by the same search as in the file afterwards: blocks in bounded memory."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from tumble.arrays import Vectors
from tumble.capture.source import Channels
from tumble.recording import Recording, Samples, joined
from tumble.records import dataclass
from tumble.segmentation import (
    LONGEST_HARMLESS_GAP,
    MINIMUM_HOLD,
    Activity,
    BlockCut,
    Blocks,
    Hold,
    Rejection,
    TriadBlocks,
    find_activity,
    follow_activity,
    search_blocks,
)
from tumble.units import COUNTS, angular_rate_factor, specific_force_factor

# Fewer tell neither noise nor bias; `find_timeline` asks for as many.
FEWEST_BLOCKS = 20
# A rest that reaches the present has to be so much longer than the shortest hold: its beginning may yet move.
SETTLING = 0.15
# So long after its end a hold's end does not move any more: smoothing and the differences over it blur by 0.3 s.
CLOSED = 0.9
# While so little is there all of it is searched each time; later only what is new, and all where a hold ends.
SEARCHED_WHOLE = 90.0
# Noise, bias and scale are found anew when the recording has grown by this share.
GROWTH = 0.02


@dataclass(frozen=True)
class LiveHold:
    """A hold of a recording that goes on.

    Attributes
    ----------
    number : from 1, in the order in which they were accepted.
    hold : its samples, counted from the first of the recording.
    start, stop : s, by the stamps.
    closed : whether it has ended.
    """

    number: int
    hold: Hold
    start: float
    stop: float
    closed: bool = False

    @property
    def duration(self) -> float:
        """Seconds from start to stop."""
        return self.stop - self.start


@dataclass(frozen=True)
class Change:
    """Something that the search sees now and did not see before.

    Attributes
    ----------
    kind : "accepted", "closed", or "refused", which may also be a hold that was accepted before.
    start, stop : s, by the stamps.
    hold : of "accepted" and "closed", and of "refused" where it had a number.
    reason : of "refused", as a phrase.
    """

    kind: Literal["accepted", "closed", "refused"]
    start: float
    stop: float
    hold: LiveHold | None = None
    reason: str = ""


class LiveHolds:
    """The holds so far, found anew as blocks come in.

    Parameters
    ----------
    blocks : that grow.
    """

    def __init__(self, blocks: LiveBlocks) -> None:
        self.holds: list[LiveHold] = []
        self.activity: Activity | None = None
        self.stillness = np.inf
        self._blocks = blocks
        self._numbers = 0
        self._said: list[tuple[int, int]] = []
        self._judged: list[Rejection] = []
        self._closed: set[int] = set()
        self._next_activity = FEWEST_BLOCKS

    @property
    def resting(self) -> LiveHold | None:
        """The hold that is still going on, if one is."""
        return self.holds[-1] if self.holds and not self.holds[-1].closed else None

    def look(self) -> list[Change]:
        """Search what is there by now, and return what changed, in time order.

        Call it after blocks were added.
        """
        blocks = self._blocks
        if blocks.count - blocks.first < FEWEST_BLOCKS:
            return []
        self._measure()
        changes = self._reconcile(self._start())
        open_holds = [hold for hold in self.holds if not hold.closed]
        ended = [h for h in open_holds if blocks.samples - h.hold.stop > CLOSED * blocks.channels.rate]
        if ended:
            # All rests together say which of them turn, and how quiet a rest is: as for the file.
            changes += self._reconcile(blocks.first)
        return changes + self._close(last=False)

    def _close(self, *, last: bool) -> list[Change]:
        """Close the holds that have ended; each is told once, even if a later look moves its end a little."""
        changes: list[Change] = []
        for place, hold in enumerate(self.holds):
            over = self._blocks.samples - hold.hold.stop > CLOSED * self._blocks.channels.rate
            if hold.closed or not (over or last):
                continue
            self.holds[place] = closed = replace(hold, closed=True)
            if hold.number not in self._closed:
                self._closed.add(hold.number)
                changes.append(Change("closed", closed.start, closed.stop, closed))
        return changes

    def finish(self) -> list[Change]:
        """Search all of it once more when nothing follows."""
        if self._blocks.count - self._blocks.first < FEWEST_BLOCKS:
            return []
        self._next_activity = 0
        self._measure()
        return self._reconcile(self._blocks.first, last=True) + self._close(last=True)

    def _measure(self) -> None:
        """Find noise, bias and scale anew where the recording has grown enough."""
        if self.activity is None or self._blocks.count >= self._next_activity:
            self.activity = find_activity(self._blocks.blocks(self._blocks.first))
            kept = self._blocks.count - self._blocks.first
            self._next_activity = self._blocks.count + max(4, int(GROWTH * kept))

    def _start(self) -> int:
        """The block from which on the holds may still change."""
        blocks = self._blocks
        if (blocks.count - blocks.first) * blocks.cut.seconds <= SEARCHED_WHOLE:
            return blocks.first
        past = [hold for hold in self.holds if hold.closed][-2:]
        first = past[0].hold.start // blocks.cut.size - 20 if past else blocks.first
        return max(first, blocks.first, blocks.count - round(10 * SEARCHED_WHOLE / blocks.cut.seconds))

    def _reconcile(self, start: int, *, last: bool = False) -> list[Change]:
        """Search from block `start` on, and say how that differs from what was known."""
        assert self.activity is not None
        live = self._blocks
        blocks = live.blocks(start)
        activity = follow_activity(blocks, self.activity)
        self.stillness = float(np.max(activity.rate[-4:])) / activity.threshold
        offset = start * live.cut.size
        found, rejections = search_blocks(
            blocks, activity, live.walls(start), samples=len(blocks) * live.cut.size
        )
        holds = [_moved(hold, offset) for hold in found]
        refused = [Rejection(r.start + offset, r.stop + offset, r.reason) for r in rejections]
        whole = start == live.first
        if whole:
            self._judged = refused
        # What begins where the search begins may have begun before.
        lost = {h.number: h for h in self.holds if h.hold.start >= offset or whole}
        kept = [h for h in self.holds if h.number not in lost]
        changes: list[Change] = []
        known: list[LiveHold] = []
        for hold in holds:
            match = next((h for h in self.holds if _same(h.hold, hold)), None)
            if match is not None:
                if match.number in lost:
                    del lost[match.number]
                    known.append(self._timed(match, hold))
            elif last or (self._is_sure(hold) and (whole or not self._was_refused(hold))):
                self._numbers += 1
                made = self._timed(LiveHold(self._numbers, hold, 0.0, 0.0), hold)
                known.append(made)
                changes.append(Change("accepted", made.start, made.stop, made))
        undecided = [] if last else [h for h in lost.values() if self._goes_on(h, refused)]
        self.holds = sorted([*kept, *known, *undecided], key=lambda h: h.hold.start)
        changes += self._gone([h for h in lost.values() if h not in undecided], refused)
        changes += self._refused(refused, last=last)
        return sorted(changes, key=lambda change: change.stop)

    def _goes_on(self, hold: LiveHold, refused: list[Rejection]) -> bool:
        """Whether a rest that was a hold, and looks too short now, still goes on: then it may be one again."""
        late = self._blocks.samples - CLOSED * self._blocks.channels.rate
        return any(_overlap(r, hold.hold) > 0 and r.stop > late for r in refused)

    def _was_refused(self, hold: Hold) -> bool:
        """Whether the search of all of it has refused a rest that a search of its end takes for a hold again."""
        late = CLOSED * self._blocks.channels.rate
        return any(
            2 * _overlap(one, hold) > min(one.stop - one.start, hold.stop - hold.start)
            and hold.stop <= one.stop + late
            for one in self._judged
        )

    def _is_sure(self, hold: Hold) -> bool:
        """Whether a new rest is long enough to be told; one that has ended is, if the search says so."""
        live = self._blocks
        if live.count * live.cut.size - hold.stop > live.cut.size:
            return True
        return hold.stop - hold.start >= (MINIMUM_HOLD + SETTLING) * live.channels.rate

    def _timed(self, known: LiveHold, hold: Hold) -> LiveHold:
        start, stop = self._blocks.time_of(hold.start), self._blocks.time_of(hold.stop)
        ended = known.closed and self._blocks.samples - hold.stop > CLOSED * self._blocks.channels.rate
        return replace(known, hold=hold, start=start, stop=stop, closed=ended)

    def _gone(self, lost: list[LiveHold], refused: list[Rejection]) -> list[Change]:
        """Holds that were accepted and are none any more, each with what is said against it."""
        changes: list[Change] = []
        for hold in lost:
            other = next((h for h in self.holds if _overlap(h.hold, hold.hold) > 0), None)
            reason = next((r.reason for r in refused if _overlap(r, hold.hold) > 0), "it moved on")
            if other is not None:
                reason = f"it is one hold with hold {other.number}, with a knock between"
            self._said.append((hold.hold.start, hold.hold.stop))
            changes.append(Change("refused", hold.start, hold.stop, hold, reason))
        return changes

    def _refused(self, refused: list[Rejection], *, last: bool) -> list[Change]:
        """Rests that are no holds and were not told yet."""
        live = self._blocks
        changes: list[Change] = []
        for rest in refused:
            over = last or live.samples - rest.stop > CLOSED * live.channels.rate
            told = any(min(rest.stop, b) > max(rest.start, a) for a, b in self._said)
            if over and not told:
                self._said.append((rest.start, rest.stop))
                start, stop = live.time_of(rest.start), live.time_of(rest.stop)
                changes.append(Change("refused", start, stop, None, rest.reason))
        del self._said[:-50]
        return changes


def _moved(hold: Hold, offset: int) -> Hold:
    excluded = tuple((a + offset, b + offset) for a, b in hold.excluded)
    return Hold(hold.start + offset, hold.stop + offset, excluded)


def _overlap(one: Hold | Rejection, other: Hold | Rejection) -> int:
    return min(one.stop, other.stop) - max(one.start, other.start)


def _same(one: Hold, other: Hold) -> bool:
    """Whether two findings are of one rest: they share more than half of the shorter."""
    return 2 * _overlap(one, other) > min(one.stop - one.start, other.stop - other.start)


# An hour of blocks of 0.05 s: some 6 MB. Then the oldest quarter is let go.
MOST_BLOCKS = 72_000
_FEWEST = 1_024


class LiveBlocks:
    """Means and roughness of consecutive blocks, the newest `MOST_BLOCKS` of them.

    Blocks are numbered from the first sample on; `first` is the oldest that is kept, `count` the one that comes
    next. What is cut is what `tumble.segmentation` cuts from the file.

    Parameters
    ----------
    channels : units and rate.
    most : blocks that are kept.
    """

    def __init__(self, channels: Channels, most: int = MOST_BLOCKS) -> None:
        self.channels = channels
        self.cut = BlockCut.at_rate(channels.rate)
        self.first = self.count = 0
        self.samples = 0
        self._most = most
        self._walls: list[int] = []
        self._rest: list[Samples] = []
        self._last: Samples | None = None
        # The last sample of each triad that is in a block.
        self._before: dict[str, Vectors] = {}
        room = min(_FEWEST, most)
        self._time = np.empty(room)
        self._triads = {
            name: (np.empty((room, 3)), np.empty((room, 3), dtype=np.float32))
            for name, unit in self._units()
            if unit is not None
        }

    def _units(self) -> tuple[tuple[str, str | None], ...]:
        return ("force", self.channels.specific_force_unit), ("rate", self.channels.angular_rate_unit)

    @property
    def last_time(self) -> float | None:
        """Stamp of the newest sample, s."""
        return None if self._last is None else float(self._last.time[-1])

    def add(self, samples: Samples) -> int:
        """Take samples and return how many blocks they completed.

        Parameters
        ----------
        samples : in time order, after those before.
        """
        if not len(samples):
            return 0
        size = self.cut.size
        before = samples.time[0] if self._last is None else self._last.time[-1]
        long = np.flatnonzero(np.diff(samples.time, prepend=before) > LONGEST_HARMLESS_GAP)
        self._walls += [(self.samples + int(i)) // size for i in long]
        self._rest.append(samples)
        self.samples += len(samples)
        self._last = samples.cut(np.array([-1]))
        blocks = self.samples // size - self.count
        if blocks:
            waiting = joined(self._rest)
            self._put(waiting, blocks)
            self._rest = [waiting.cut(np.arange(blocks * size, len(waiting)))]
        return blocks

    def _put(self, samples: Samples, blocks: int) -> None:
        self._make_room(blocks)
        size, at = self.cut.size, slice(self.count - self.first, self.count - self.first + blocks)
        self._time[at] = samples.time[: blocks * size : size]
        for name, signal in (("force", samples.specific_force), ("rate", samples.angular_rate)):
            if name not in self._triads or signal is None:
                continue
            mean, roughness = self._triads[name]
            values = signal[: blocks * size]
            mean[at] = values.reshape(blocks, size, 3).mean(axis=1)
            before = self._before.get(name, values[:1])
            steps = np.diff(np.concatenate([before, values]), axis=0).reshape(blocks, size, 3)
            roughness[at] = 0.5 * np.mean(steps**2, axis=1)
            self._before[name] = values[-1:].copy()
        self.count += blocks

    def _make_room(self, blocks: int) -> None:
        kept, capacity = self.count - self.first, self._time.shape[0]
        if kept + blocks <= capacity:
            return
        drop = min(self._most // 4, kept) if kept + blocks > self._most else 0
        room = max(min(2 * capacity, self._most), kept - drop + blocks)
        self._time = _kept_rows(self._time, drop, kept, room)
        for name, (mean, roughness) in self._triads.items():
            self._triads[name] = (_kept_rows(mean, drop, kept, room), _kept_rows(roughness, drop, kept, room))
        self.first += drop
        self._walls = [wall for wall in self._walls if wall >= self.first]

    def blocks(self, start: int) -> Blocks:
        """Return the blocks from number `start` on, as the search takes them.

        Parameters
        ----------
        start : not before `first`.
        """
        span = slice(start - self.first, self.count - self.first)
        found: dict[str, TriadBlocks] = {
            name: self.cut.smoothed(mean[span], roughness[span])
            for name, (mean, roughness) in self._triads.items()
        }
        return Blocks(
            self.cut.size,
            self.cut.seconds,
            self.cut.half_width,
            found.get("force"),
            found.get("rate"),
            specific_force_factor(self.channels.specific_force_unit or COUNTS),
            angular_rate_factor(self.channels.angular_rate_unit or COUNTS),
        )

    def walls(self, start: int) -> np.ndarray:
        """Return the blocks, counted from `start`, that a hold may not go across: samples are missing there.

        Parameters
        ----------
        start : not before `first`.
        """
        walls = np.array([w for w in self._walls if w >= start], dtype=int) - start
        return np.minimum(walls, self.count - start - 1)

    def time_of(self, sample: int) -> float:
        """Return the stamp of a sample, by its block, s.

        Parameters
        ----------
        sample : number from the first sample on.
        """
        block, beyond = divmod(sample, self.cut.size)
        block = min(max(block, self.first), self.count - 1)
        return float(self._time[block - self.first]) + min(beyond, self.cut.size) / self.channels.rate

    def newest(self, name: str, blocks: int) -> Vectors | None:
        """Return the means of the newest blocks of a triad, raw; None where there is no such triad.

        Parameters
        ----------
        name : "force" or "rate".
        blocks : how many at most.
        """
        if name not in self._triads:
            return None
        stop = self.count - self.first
        return self._triads[name][0][max(stop - blocks, 0) : stop]

    def averaged(self) -> Recording:
        """Return the means of all blocks that are kept as a recording of its own, raw, of 1 / 0.05 s."""
        span = slice(0, self.count - self.first)
        means = {name: triad[0][span] for name, triad in self._triads.items()}
        return Recording(
            time=self._time[span],
            specific_force=means.get("force"),
            angular_rate=means.get("rate"),
            specific_force_unit=self.channels.specific_force_unit or COUNTS,
            angular_rate_unit=self.channels.angular_rate_unit or COUNTS,
            rate=1.0 / self.cut.seconds,
            gaps=tuple(int(w) for w in np.unique(self.walls(self.first)) if w > 0),
        )


def _kept_rows(values: np.ndarray, drop: int, kept: int, room: int) -> np.ndarray:
    """The rows from `drop` on, at the start of an array of `room` rows."""
    made = np.empty((room, *values.shape[1:]), dtype=values.dtype)
    made[: kept - drop] = values[drop:kept]
    return made


def in_si(live: LiveBlocks, activity: Activity) -> Recording:
    """Return the block means in SI; of counts by the scales and biases that the motion shows, roughly.

    Parameters
    ----------
    live : the blocks.
    activity : that tells bias and scale where the unit sends counts.
    """
    raw = live.averaged()
    force, rate = raw.specific_force, raw.angular_rate
    factor = specific_force_factor(raw.specific_force_unit)
    gravity, bias = activity.gravity, activity.force_bias
    if force is not None and factor is None and gravity is not None and bias is not None:
        force, factor = force - bias, 9.80665 / gravity
    rate_factor = angular_rate_factor(raw.angular_rate_unit)
    if rate is not None and rate_factor is None and activity.rate_scale is not None:
        offset = 0.0 if activity.rate_bias is None else activity.rate_bias
        rate, rate_factor = rate - offset, activity.rate_scale
    return replace(
        raw,
        specific_force=None if force is None else force * (factor or 1.0),
        angular_rate=None if rate is None else rate * (rate_factor or 1.0),
        specific_force_unit="m/s^2" if force is not None else COUNTS,
        angular_rate_unit="rad/s" if rate is not None else COUNTS,
    )
