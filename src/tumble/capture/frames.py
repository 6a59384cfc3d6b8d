"""Frames of bytes that come in: found among garbage, and collected until the channels and the rate are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tumble.capture.samples import Channels
from tumble.capture.source import Notice, Piece, SourceOptions
from tumble.capture.stamps import ArrivalClock
from tumble.recording.samples import Samples
from tumble.records import dataclass

# Frames, and s of stamps, after which the channels are known; bytes that wait for a frame's end.
FEWEST, LONG_ENOUGH, LONGEST = 20, 0.5, 1 << 16


@dataclass(slots=True)
class Measured:
    """What one frame says.

    Attributes
    ----------
    force, rate : three numbers each, or None.
    time : s on the unit's clock, or None.
    temperature : °C, or None.
    """

    force: tuple[float, ...] | None = None
    rate: tuple[float, ...] | None = None
    time: float | None = None
    temperature: float | None = None
    field: tuple[float, ...] | None = None


_NO_FIELD = (np.nan, np.nan, np.nan)
Frame = tuple[int, Measured | None, bool]
"""Bytes that were used up (0: wait for more), what the frame says (None: nothing of use), whether it was good."""


class Frames:
    """Bytes in, samples out.

    Parameters
    ----------
    options : with the rate, where the frames have no stamps and it is known.
    take : looks at the start of some bytes for a frame.
    units : of force, rate and field.
    """

    def __init__(
        self,
        options: SourceOptions,
        take: Callable[[bytes], Frame],
        units: tuple[str, str, str] = ("m/s^2", "rad/s", "gauss"),
    ) -> None:
        self.good = self.damaged = 0
        self.cautions: list[str] = []
        self._options, self._take, self._units = options, take, units
        self._rest = b""
        self._waiting: list[tuple[Measured, float]] = []
        self._channels: Channels | None = None
        self._clock = ArrivalClock(options.rate)

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return what is complete."""
        rest = self._rest + data
        lost = False
        while rest:
            used, measured, good = self._take(rest)
            if not used:
                break
            rest = rest[used:]
            self.good += good
            # A run of garbage is one damage, however long it is.
            self.damaged += not good and not lost
            lost = not good
            if measured is not None:
                self._waiting.append((measured, arrived))
        self._rest = rest[-LONGEST:]
        return self._pieces()

    def measured(self, found: list[Measured], arrived: float) -> list[Piece]:
        """Return what comes of frames that another parser has found.

        Parameters
        ----------
        found, arrived : in order, and when they came (s on the host's clock).
        """
        self._waiting += [(one, arrived) for one in found]
        return self._pieces()

    def end(self) -> list[Piece]:
        """Return what is left."""
        return self._pieces(last=True)

    def _pieces(self, *, last: bool = False) -> list[Piece]:
        pieces: list[Piece] = [Notice("caution", words) for words in self.cautions] if self._channels else []
        if self._channels is None:
            times = [m.time if m.time is not None else at for m, at in self._waiting]
            enough = len(times) >= FEWEST and times[-1] - times[0] >= LONG_ENOUGH
            if not (enough or (last and len(times) >= 2)):
                return []
            self._channels = self._found(times)
            pieces.append(self._channels)
            pieces += [Notice("caution", words) for words in self.cautions]
        self.cautions.clear()
        kept = [(m, at) for m, at in self._waiting if self._fits(m)]
        self._waiting.clear()
        return [*pieces, self._made(kept)] if kept else pieces

    def _found(self, times: list[float]) -> Channels:
        steps = np.diff(times)
        steps = steps[steps > 0.0]
        stamped = self._waiting[0][0].time is not None
        usual = (
            float(np.median(steps))
            if stamped and steps.size
            else (times[-1] - times[0]) / max(len(times) - 1, 1)
        )
        force = sum(m.force is not None for m, _ in self._waiting) > len(times) // 2
        rate = sum(m.rate is not None for m, _ in self._waiting) > len(times) // 2
        temperature = sum(m.temperature is not None for m, _ in self._waiting) > len(times) // 2
        field = any(m.field is not None for m, _ in self._waiting)
        return Channels(
            self._units[0] if force else None,
            self._units[1] if rate else None,
            self._options.rate or 1.0 / max(usual, 1e-5),
            temperature,
            magnetic_field_unit=self._units[2] if field else None,
        )

    def _fits(self, measured: Measured) -> bool:
        channels = self._channels
        assert channels is not None
        return (channels.specific_force_unit is None or measured.force is not None) and (
            channels.angular_rate_unit is None or measured.rate is not None
        )

    def _made(self, kept: list[tuple[Measured, float]]) -> Samples:
        channels = self._channels
        assert channels is not None
        times = [m.time for m, _ in kept]
        stamps = (
            np.concatenate([self._clock.stamp(1, at) for _, at in kept])
            if any(time is None for time in times)
            else np.array(times, dtype=float)
        )
        return Samples(
            stamps,
            None
            if channels.specific_force_unit is None
            else np.array([m.force for m, _ in kept], dtype=float),
            None if channels.angular_rate_unit is None else np.array([m.rate for m, _ in kept], dtype=float),
            np.array([np.nan if m.temperature is None else m.temperature for m, _ in kept])
            if channels.temperature
            else None,
            None
            if channels.magnetic_field_unit is None
            else np.array([m.field or _NO_FIELD for m, _ in kept], dtype=float),
        )
