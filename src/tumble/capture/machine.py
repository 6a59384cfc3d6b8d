"""The state machine of a capture: samples in, events out. It knows no file, no terminal and no page.

What the first two seconds of a stream show to be wrong: said then, and not when the unit is back in its box.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Vector
from tumble.attitude import angle_between
from tumble.calibration import SAME_POSE, describe_direction
from tumble.capture.coach import Coach, Event, Progress
from tumble.capture.live_holds import MOST_BLOCKS, Change, LiveBlocks, LiveHold, LiveHolds
from tumble.capture.source import Channels
from tumble.protocol import HoldStep, Step, TurnStep
from tumble.recording import Samples
from tumble.records import dataclass
from tumble.units import COUNTS, STANDARD_GRAVITY, angular_rate_factor, specific_force_factor

# Of the stated rate, by how much the stamps may differ from it.
RATE_SLACK = 0.15
# g: no unit at rest or in the hand shows less on the average, unless gravity was taken out.
LEAST_FORCE, MOST_FORCE = 0.5, 2.0
# rad/s on the average of two seconds: no hand turns so fast.
MOST_RATE = 35.0
# Hz: slower streams lose the turns between poses.
SLOW = 20.0


def early_doubts(live: LiveBlocks, seconds: float) -> list[str]:
    """Return what is wrong with a stream, as sentences with what to do.

    Parameters
    ----------
    live : the blocks so far.
    seconds : from the first stamp to the last.
    """
    channels = live.channels
    doubts: list[str] = []
    rate = (live.samples - 1) / seconds if seconds > 0.0 else channels.rate
    if abs(rate / channels.rate - 1.0) > RATE_SLACK:
        doubts.append(
            f"Samples come at {rate:.4g} Hz, and {channels.rate:.4g} Hz was said: mend the setting of the unit, or "
            f"say --rate {rate:.4g}."
        )
    elif rate < SLOW:
        doubts.append(
            f"Samples come at {rate:.3g} Hz only: turns need 50 Hz or more. Set a higher output rate."
        )
    if channels.angular_rate_unit is None:
        doubts.append("No gyro comes in: only the accelerometers can be calibrated. Switch its output on.")
    if channels.specific_force_unit is None:
        doubts.append(
            "No accelerometer comes in: nothing can be calibrated from poses. Switch its output on."
        )
    return doubts + [words for words in (_of_force(live), _of_rate(live)) if words]


def _of_force(live: LiveBlocks) -> str:
    unit = live.channels.specific_force_unit or COUNTS
    factor, force = specific_force_factor(unit), live.newest("force", 60)
    if force is None or not len(force):
        return ""
    if np.all(force == force[0]):
        return "The accelerometer always says the same number: it does not measure."
    size = float(np.median(np.linalg.norm(force, axis=1))) * (factor or np.nan) / STANDARD_GRAVITY
    if size < 0.2:
        return f"The accelerometer shows {size:.2f} g, so the device takes gravity out: send the raw acceleration."
    if size <= LEAST_FORCE or size >= MOST_FORCE:
        return (
            f"The accelerometer shows {size:.3g} g, which cannot be in {unit}: say what unit it is (--units)."
        )
    return ""


def _of_rate(live: LiveBlocks) -> str:
    unit = live.channels.angular_rate_unit or COUNTS
    factor, rate = angular_rate_factor(unit), live.newest("rate", 60)
    if rate is None or not len(rate):
        return ""
    if np.all(rate == 0.0):
        return "The gyro shows exactly zero: it is off, or corrected at rest. Switch that off and send raw rates."
    if np.mean(np.all(rate == 0.0, axis=1)) > 0.5:
        return "The gyro shows exactly zero for much of the time: the device corrects it. Switch its dead band off."
    if float(np.median(np.linalg.norm(rate, axis=1))) * (factor or np.nan) > MOST_RATE:
        return f"The gyro shows rates that cannot be in {unit}: say the unit (--units)."
    return ""


# s of data after which it is said what is wrong with the stream.
EARLY = 2.0


@dataclass(frozen=True)
class HoldTold:
    """A hold as people are told of it.

    Attributes
    ----------
    hold : number, samples, start and stop.
    up_b : (3,) unit vector up, roughly; None without an accelerometer.
    note : what there is to say of it, such as which earlier one it is like; empty for nothing.
    """

    hold: LiveHold
    up_b: Vector | None
    note: str = ""

    @property
    def pose(self) -> str:
        """What points up, in words."""
        return "" if self.up_b is None else describe_direction(self.up_b)


class Capture:
    """A capture that is going on.

    Parameters
    ----------
    channels : what comes in.
    guide : says what is next, and what there is by now; None for holds alone.
    hold : s that each pose is to be held, where no guide says it.
    """

    def __init__(self, channels: Channels, guide: Coach | None, hold: float) -> None:
        self.channels, self._hold = channels, hold
        self.blocks = LiveBlocks(channels, MOST_BLOCKS if guide is None else guide.blocks)
        self.search = LiveHolds(self.blocks)
        self.guide = guide
        self.progress = Progress()
        self.told: dict[int, HoldTold] = {}
        self.dropped: set[int] = set()
        self._drops: list[int] = []
        self._complete: set[int] = set()
        self._begin: float | None = None
        self._early_said = self._enough_said = False

    @property
    def hold_seconds(self) -> float:
        """How long the present pose is to be held, s."""
        return self._hold if self.guide is None else self.guide.hold

    @property
    def time(self) -> float:
        """Stamp of the newest sample, s; zero before the first."""
        return self.blocks.last_time or 0.0

    @property
    def direction(self) -> Vector | None:
        """(3,) unit vector up at present, roughly; None without an accelerometer or before the first block."""
        newest = self.blocks.newest("force", 4)
        if newest is None or not len(newest):
            return None
        return self._unit(newest.mean(axis=0))

    def _unit(self, raw: Vector) -> Vector | None:
        """A raw specific force as a direction; of counts without what they read at no force."""
        activity = self.search.activity
        if specific_force_factor(self.channels.specific_force_unit or COUNTS) is None:
            if activity is None or activity.force_bias is None:
                return None
            raw = raw - activity.force_bias
        size = float(np.linalg.norm(raw))
        return raw / size if size > 0.0 else None

    def feed(self, samples: Samples) -> list[Event]:
        """Take samples in time order, and return what happened.

        Parameters
        ----------
        samples : of the channels' triads, finite, with stamps that increase.
        """
        if not len(samples):
            return []
        if self._begin is None:
            self._begin = float(samples.time[0])
        if self.guide is not None:
            self.guide.look_at_clock(samples.time)
        if not self.blocks.add(samples):
            return []
        events = [event for change in self.search.look() for event in self._of_change(change)]
        events += self._early() + self._completed() + self._dropped()
        # The next pose is wanted when a hold is long enough; a shorter one counts when it has ended.
        due = self.guide is not None and self.guide.due(self.time)
        if due or any(self._changes_what_is_known(event) for event in events):
            events += self._reckon()
        return events

    def _changes_what_is_known(self, event: Event) -> bool:
        hold = event.facts.get("hold")
        if event.kind == "hold_closed":
            return hold not in self._complete
        return event.kind in ("hold_complete", "hold_dropped") or (
            event.kind == "hold_refused" and hold is not None
        )

    @property
    def holds(self) -> list[HoldTold]:
        """The holds that count, in order, as they are told."""
        holds = [h for h in self.search.holds if h.number in self.told and h.number not in self.dropped]
        return [replace(self.told[hold.number], hold=hold) for hold in holds]

    def drop(self, number: int) -> None:
        """Let a hold not count, because a person says so; it is told with the next samples.

        Parameters
        ----------
        number : of the hold; one that is none is passed over.
        """
        if number in self.told and number not in self.dropped:
            self.dropped.add(number)
            self._drops.append(number)

    def finish(self) -> list[Event]:
        """Return what is left to say when nothing follows."""
        events = [event for change in self.search.finish() for event in self._of_change(change)]
        return events + (self._reckon() if self.search.holds else [])

    def outlook(self) -> str:
        """Return whether what came was enough, and else what is wanting; empty where nobody judges it."""
        progress = self.progress
        if self._enough_said:
            return "The guide had enough."
        if self.guide is None or not (progress.words or progress.advice):
            return ""
        more = () if progress.advice is None else (progress.advice.words,)
        return " ".join(["The guide had not enough yet.", *progress.words, *more])

    def _of_change(self, change: Change) -> list[Event]:
        facts = {"start": change.start, "stop": change.stop}
        if change.hold is not None:
            facts["hold"] = change.hold.number
        if change.kind == "refused":
            name = f"Hold {change.hold.number}" if change.hold is not None else "A rest"
            if change.hold is not None:
                self.told.pop(change.hold.number, None)
            words = f"{name} from {change.start:.1f} to {change.stop:.1f} s does not count: {change.reason}. "
            return [
                self._event("hold_refused", words + "Only this one is lost.", reason=change.reason, **facts)
            ]
        assert change.hold is not None
        told = self._tell(change.hold)
        if change.kind == "accepted":
            words = f"Hold {change.hold.number} accepted{': ' + told.pose if told.pose else ''}."
            words += f" {told.note}" if told.note else ""
            delay = self.time - change.start
            return [
                self._event(
                    "hold_accepted", words, pose=told.pose, up=told.up_b, note=told.note, delay=delay, **facts
                )
            ]
        seconds = change.hold.duration
        words = f"Hold {change.hold.number} lasted {seconds:.1f} s."
        return [self._event("hold_closed", words, seconds=seconds, pose=told.pose, up=told.up_b, **facts)]

    def _tell(self, hold: LiveHold) -> HoldTold:
        """Find the pose of a hold, and which earlier one it is like."""
        size, first = self.blocks.cut.size, self.blocks.first
        force = self.blocks.newest("force", self.blocks.count - first)
        up_b, note = None, ""
        if force is not None:
            start = -(-hold.hold.start // size) - first
            part = force[start : max(hold.hold.stop // size - first, start + 1)]
            up_b = self._unit(part.mean(axis=0)) if len(part) else None
        if up_b is not None:
            others = [t for t in self.told.values() if t.hold.number < hold.number and t.up_b is not None]
            angles = [angle_between(up_b, t.up_b) for t in others if t.up_b is not None]
            if angles and min(angles) < SAME_POSE:
                like = others[int(np.argmin(angles))].hold.number
                note = (
                    f"It is like hold {like} ({np.degrees(min(angles)):.0f}° from it): another pose "
                    "determines more."
                )
        self.told[hold.number] = HoldTold(hold, up_b, note)
        return self.told[hold.number]

    def _completed(self) -> list[Event]:
        """Say once that a pose was held as long as was asked."""
        resting = self.search.resting
        if resting is None or resting.number in self._complete or resting.duration < self.hold_seconds:
            return []
        self._complete.add(resting.number)
        words = f"Hold {resting.number} is long enough: turn the unit to the next pose."
        return [self._event("hold_complete", words, hold=resting.number, seconds=resting.duration)]

    def _dropped(self) -> list[Event]:
        """Say which holds a person has dropped."""
        numbers, self._drops = self._drops, []
        return [
            self._event("hold_dropped", f"Hold {n} was dropped and does not count.", hold=n) for n in numbers
        ]

    def _early(self) -> list[Event]:
        """Say after two seconds of data what is wrong with the stream."""
        if self._early_said or self._begin is None or self.time - self._begin < 0.9 * EARLY:
            return []
        self._early_said = True
        doubts = early_doubts(self.blocks, self.time - self._begin)
        return [self._event("caution", words) for words in doubts]

    def _reckon(self) -> list[Event]:
        """Find what is known, what is next, and whether it is enough."""
        activity = self.search.activity
        if self.guide is None or activity is None:
            return []
        counted = [told.hold for told in self.holds]
        self.progress = progress = self.guide.judge(self.blocks, counted, activity)
        events = [self._event("sigma", _known_words(progress), sigma=progress.sigmas, holds=len(counted))]
        if (advice := progress.advice) is not None:
            facts = {**advice.facts, **_next_facts(advice.steps)}
            events.append(self._event("next_pose", advice.words, do=advice.do, **facts))
        if progress.enough and not self._enough_said:
            self._enough_said = True
            events.append(self._event("enough", " ".join(progress.words)))
        return events

    def _event(self, kind: str, words: str, /, **facts: object) -> Event:
        return Event(kind, self.time, words, facts)


def _known_words(progress: Progress) -> str:
    told = sum(sigma is not None for sigma in progress.sigmas.values())
    if not progress.sigmas:
        return " ".join(progress.words)
    return f"{told} of {len(progress.sigmas)} parameters are determined. {' '.join(progress.words)}".strip()


def _next_facts(steps: tuple[Step, ...]) -> dict[str, object]:
    """Return the pose and the turn of a step that is proposed, for programs that draw it."""
    facts: dict[str, object] = {}
    for step in steps:
        if isinstance(step, HoldStep) and step.pose is not None and "up" not in facts:
            facts["up"] = step.pose.up_b
            facts["pose"] = describe_direction(step.pose.up_b)
        if isinstance(step, TurnStep) and step.axis_b is not None:
            facts["turn_axis"], facts["turn_angle"] = step.axis_b, step.angle
    return facts
