"""Says how long a unit has still to lie until its noise is known: what `tumble noise` makes of the recording so far.

The terms are those of the means of 0.05 s, which have the same N, B and K as the samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from tumble.arrays import Series
from tumble.capture.coach import Advice, Progress
from tumble.capture.live_holds import MOST_BLOCKS, LiveBlocks, LiveHold
from tumble.counting import time_words
from tumble.errors import RecordingError, UsageError
from tumble.noise import Channel, characterise, seconds_needed
from tumble.recording import Recording
from tumble.segmentation import Activity

# s of rest before the first judgement, and the growth of the recording until the next.
FIRST, GROWTH = 120.0, 0.15
# Hours of blocks that are kept: 5 MB each.
HOURS = 12


class RestCoach:
    """What the noise so far shows, found anew as the recording grows, beside the samples that come in.

    Parameters
    ----------
    patient : wait for what is computed; for recordings that are replayed.
    """

    def __init__(self, *, patient: bool = False) -> None:
        self.blocks = HOURS * MOST_BLOCKS
        self._patient = patient
        self._begun: float | None = None
        self._next = FIRST
        self._found: Future[tuple[bool, str]] | None = None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="noise")

    @property
    def hold(self) -> float:
        """No hold is long enough: the unit is not to be touched."""
        return float("inf")

    def look_at_clock(self, time: Series) -> None:
        """Take the next stamps."""
        if self._begun is None:
            self._begun = float(time[0])

    def due(self, time: float) -> bool:
        """Say whether the recording has grown enough, or what was computed of it is there."""
        if self._found is not None:
            return self._patient or self._found.done()
        return self._begun is not None and time - self._begun >= self._next

    def judge(self, live: LiveBlocks, holds: Sequence[LiveHold], activity: Activity) -> Progress:
        """Return what is known of the noise.

        Parameters
        ----------
        live : the blocks.
        holds, activity : not needed: what rests is found by the characterisation.
        """
        if self._found is None:
            recording = live.averaged()
            if recording.duration < FIRST:
                return Progress(words=("Leave the unit alone: nothing is known of its noise yet.",))
            self._next = recording.duration * (1.0 + GROWTH)
            self._found = self._pool.submit(_judged, recording)
            if not self._patient:
                return Progress(words=("Computing what the noise still needs.",))
        enough, words = self._found.result()
        self._found = None
        advice = None if enough else Advice("leave the unit alone", words)
        return Progress(advice=advice, enough=enough, words=(words,))


def _judged(recording: Recording) -> tuple[bool, str]:
    """Whether N, B and K of all channels are known to 10 %, and what each triad still needs."""
    try:
        channels = characterise(recording, taus="octave").channels
    except (RecordingError, UsageError) as error:
        return False, str(error)
    forces, gyros = ([c for c in channels if c.is_gyro == gyro] for gyro in (False, True))
    triads = (("Accelerometers", forces), ("Gyros", gyros))
    said = [_needs(name, of, recording.duration) for name, of in triads if of]
    return all(enough for enough, _ in said), " ".join(words for _, words in said)


def _needs(name: str, channels: list[Channel], seconds: float) -> tuple[bool, str]:
    fits = [channel.fit for channel in channels if channel.fit is not None]
    if not fits:
        return False, f"{name}: no model of the noise yet."
    known, parts = list[str](), list[str]()
    for letter in "NBK":
        needed = max(seconds_needed(fit, letter) for fit in fits)
        left = needed - seconds
        if left <= 0.0:
            known.append(letter)
        elif np.isfinite(needed):
            least = "" if all(letter in fit.chosen for fit in fits) else "at least "
            parts.append(f"{letter} needs {least}{time_words(left)} more")
        else:
            parts.append(f"{letter} is not seen")
    head = [f"{' and '.join(known)} known to 10 %"] if known else []
    return not parts, f"{name}: {', '.join(head + parts)}."
