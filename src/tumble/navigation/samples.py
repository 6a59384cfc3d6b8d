"""What an IMU gives navigation: angular rate and specific force in SI, and when."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.units import angular_rate_factor, specific_force_factor

# Samples further apart than this many usual intervals have others missing between them.
_MISSING = 3.5


@dataclass(frozen=True)
class InertialSamples:
    """Samples of an IMU in SI, along the body frame b.

    Attributes
    ----------
    time : (samples,) s, increasing.
    specific_force_b : (samples, 3) m/s².
    angular_rate_ib_b : (samples, 3) rad/s, against inertial space.
    means : False where a row holds the values at the instant `time`, and the signals run straight from one to
        the next; True where it holds the means over the interval that ends at `time`, that is an increment
        over its interval. The first row of means is not read: its time is where the first interval begins.
    """

    time: Series
    specific_force_b: Vectors
    angular_rate_ib_b: Vectors
    means: bool = False

    def __post_init__(self) -> None:
        """Refuse what no navigation can be made of.

        Raises
        ------
        RecordingError
            If lengths differ, there are fewer than two samples, times do not increase, or a value is not
            finite.
        """
        rows = len(self.time)
        if len(self.specific_force_b) != rows or len(self.angular_rate_ib_b) != rows:
            raise RecordingError(
                f"{rows} times, {len(self.specific_force_b)} specific forces and {len(self.angular_rate_ib_b)} "
                "angular rates are not one recording: give as many of each."
            )
        if rows < 2:
            raise RecordingError(f"Navigation takes two samples or more, and here are {rows}.")
        if not np.all(np.diff(self.time) > 0.0):
            worst = int(np.argmin(np.diff(self.time)))
            raise RecordingError(
                f"The time does not increase from sample {worst + 1} to {worst + 2} "
                f"({self.time[worst]:.6f} s to {self.time[worst + 1]:.6f} s): sort the samples and leave out "
                "repeated ones."
            )
        first = 1 if self.means else 0
        good = np.isfinite(self.specific_force_b[first:]) & np.isfinite(self.angular_rate_ib_b[first:])
        if not good.all():
            row = int(np.flatnonzero(~good.all(axis=1))[0]) + first
            raise RecordingError(
                f"Sample {row + 1} at {self.time[row]:.6f} s is not a number: leave such samples out."
            )

    @staticmethod
    def from_recording(recording: Recording, model: ImuModel | None = None) -> InertialSamples:
        """Return a recording in SI, corrected by a model where there is one.

        Parameters
        ----------
        recording : of both triads. Its stamps are taken as the instants of the samples.
        model : of which `correct` takes the recording's raw numbers; None scales by the units alone.

        Raises
        ------
        RecordingError
            If a triad is missing, or the raw numbers are counts and there is no model.
        """
        force, rate = recording.specific_force, recording.angular_rate
        if force is None or rate is None:
            missing = "specific force" if force is None else "angular rate"
            raise RecordingError(f"The recording has no {missing}, and navigation takes both triads.")
        if model is not None:
            force, rate = model.correct(force, rate)
        else:
            force_factor = specific_force_factor(recording.specific_force_unit)
            rate_factor = angular_rate_factor(recording.angular_rate_unit)
            if force_factor is None or rate_factor is None:
                raise RecordingError(
                    "The recording is in counts, of which navigation needs the scale: give a calibration."
                )
            force, rate = force * force_factor, rate * rate_factor
        return InertialSamples(recording.time, force, rate)

    @staticmethod
    def from_increments(edges: Series, angle: Vectors, velocity: Vectors) -> InertialSamples:
        """Return samples of increments, as navigation-grade units give them.

        Parameters
        ----------
        edges : (intervals + 1,) s, where the intervals begin and end.
        angle, velocity : (intervals, 3) rad and m/s, over each interval in b.

        Raises
        ------
        RecordingError
            If there is not one edge more than there are increments.
        """
        if len(edges) != len(angle) + 1 or len(edges) != len(velocity) + 1:
            raise RecordingError(
                f"{len(angle)} and {len(velocity)} increments lie between {len(angle) + 1} times, not {len(edges)}."
            )
        interval = np.diff(edges)[:, None]
        zero = np.zeros((1, 3))
        return InertialSamples(
            edges, np.vstack([zero, velocity / interval]), np.vstack([zero, angle / interval]), means=True
        )

    def __len__(self) -> int:
        return int(self.time.shape[0])

    @property
    def interval(self) -> float:
        """The usual time between samples (median), s."""
        return float(np.median(np.diff(self.time)))

    def missing(self, longest: float = 0.0) -> list[tuple[float, float]]:
        """Return (from, to) s of the stretches without samples: more than 3.5 usual intervals, and than `longest` s."""
        steps = np.diff(self.time)
        at = np.flatnonzero(steps > max(_MISSING * self.interval, longest))
        return [(float(self.time[i]), float(self.time[i + 1])) for i in at]

    def between(self, start: float, stop: float) -> InertialSamples:
        """Return the samples from `start` to `stop` (s), cut exactly there.

        Raises
        ------
        RecordingError
            If that is not inside the samples.
        """
        if not self.time[0] <= start < stop <= self.time[-1]:
            raise RecordingError(
                f"From {start:.3f} to {stop:.3f} s is not inside the IMU's samples, which run from "
                f"{self.time[0]:.3f} to {self.time[-1]:.3f} s."
            )
        first = int(np.searchsorted(self.time, start, side="right"))
        last = int(np.searchsorted(self.time, stop, side="left"))
        time = np.concatenate([[start], self.time[first:last], [stop]])
        if self.means:
            rows = np.concatenate([[first], np.arange(first, last), [min(last, len(self) - 1)]])
            return InertialSamples(time, self.specific_force_b[rows], self.angular_rate_ib_b[rows], True)

        def cut(signal: Vectors) -> Vectors:
            begin, end = (_between_rows(self.time, signal, instant) for instant in (start, stop))
            return np.vstack([begin, signal[first:last], end])

        return InertialSamples(time, cut(self.specific_force_b), cut(self.angular_rate_ib_b))

    def shifted(self, offset: float) -> InertialSamples:
        """Return the samples with `offset` s added to their times."""
        return InertialSamples(self.time + offset, self.specific_force_b, self.angular_rate_ib_b, self.means)


def _between_rows(time: Series, signal: Vectors, instant: float) -> Vectors:
    """The signal at an instant, straight between the rows next to it, (1, 3)."""
    row = min(max(int(np.searchsorted(time, instant)), 1), len(time) - 1)
    share = (instant - time[row - 1]) / (time[row] - time[row - 1])
    return (1.0 - share) * signal[row - 1 : row] + share * signal[row : row + 1]
