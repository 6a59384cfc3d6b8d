"""Tracks of satellite positions: times on GPS time, positions, velocities with covariances, and their outliers."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrices, Series, Vectors
from tumble.errors import RecordingError
from tumble.navigation.trajectory import position_differences
from tumble.recording import Remark
from tumble.records import dataclass

# By RTKLIB's numbers; files of other kinds are brought to them.
QUALITIES = {1: "fixed", 2: "float", 3: "SBAS", 4: "differential", 5: "single", 6: "precise point", 0: "none"}


@dataclass(frozen=True)
class GnssTrack:
    """Fixes of a receiver in time order.

    Attributes
    ----------
    time : (fixes,) s, increasing: GPS time since 6 January 1980 as it is read; any clock once it is shifted.
    latitude, longitude : (fixes,) geodetic, rad.
    height : (fixes,) m above the ellipsoid.
    position_covariance_n : (fixes, 3, 3) m², in north, east, down.
    velocity_n : (fixes, 3) m/s, rows of NaN where there is none.
    velocity_covariance_n : (fixes, 3, 3) (m/s)².
    quality : (fixes,) kind of each fix, by the numbers of `QUALITIES`.
    remarks : what was found, assumed or mended on reading.
    name : of the file.
    """

    time: Series
    latitude: Series
    longitude: Series
    height: Series
    position_covariance_n: Matrices
    velocity_n: Vectors
    velocity_covariance_n: Matrices
    quality: np.ndarray
    remarks: tuple[Remark, ...] = ()
    name: str = ""

    def __len__(self) -> int:
        return int(self.time.shape[0])

    @property
    def has_velocity(self) -> np.ndarray:
        """(fixes,) whether a fix has all of its velocity."""
        return np.asarray(np.isfinite(self.velocity_n).all(axis=1))

    @property
    def interval(self) -> float:
        """The usual time between fixes (median), s; zero of fewer than two."""
        return float(np.median(np.diff(self.time))) if len(self) > 1 else 0.0

    @property
    def position(self) -> tuple[Series, Series, Series]:
        """Latitude and longitude (rad), height (m)."""
        return self.latitude, self.longitude, self.height

    def rows(self, index: np.ndarray | slice) -> GnssTrack:
        """Return the fixes of an index or of a boolean array."""
        cut = {
            f.name: getattr(self, f.name)[index] for f in fields(self) if f.name not in ("remarks", "name")
        }
        return replace(self, **cut)

    def shifted(self, offset: float) -> GnssTrack:
        """Return the track with `offset` s added to its times, such as onto the IMU's clock."""
        return replace(self, time=self.time + offset)

    def weakened(self, factors: dict[int, float]) -> GnssTrack:
        """Return the track with standard deviations multiplied by a factor for each quality.

        Receivers and RTKLIB state a float solution's uncertainty too small: a false ambiguity is not in it.

        Parameters
        ----------
        factors : by the numbers of `QUALITIES`; qualities that are not named keep theirs.
        """
        factor = np.ones(len(self))
        for quality, value in factors.items():
            factor[self.quality == quality] = value
        square = (factor**2)[:, None, None]
        return replace(
            self,
            position_covariance_n=self.position_covariance_n * square,
            velocity_covariance_n=self.velocity_covariance_n * square,
        )

    def thinned(self, interval: float) -> tuple[GnssTrack, GnssTrack]:
        """Return the fixes at about `interval` s, to aid with, and all others, to judge by.

        Parameters
        ----------
        interval : s between the fixes that are taken: the first of each stretch of that length.

        Raises
        ------
        RecordingError
            If there is no fix.
        """
        if not len(self):
            raise RecordingError(f"The track {self.name} has no fix to thin.")
        # half the usual interval of slack, so that stamps that scatter fall on the right side
        stretch = np.floor((self.time - self.time[0] + 0.5 * self.interval) / interval)
        first = np.concatenate([[True], np.diff(stretch) > 0.0])
        return self.rows(first), self.rows(~first)


def _diagonal_covariances(sigmas: Vectors) -> Matrices:
    """Return (fixes, 3, 3) covariances of independent components, from (fixes, 3) sigmas."""
    return np.einsum("ij,jk->ijk", sigmas**2, np.eye(3))


def make_track(
    time: Series,
    position: tuple[Series, Series, Series],
    position_sigmas: Vectors,
    *,
    velocity_n: Vectors | None = None,
    velocity_sigmas: Vectors | None = None,
    quality: np.ndarray | None = None,
    remarks: tuple[Remark, ...] = (),
    name: str = "",
) -> GnssTrack:
    """Return a track of fixes whose components are independent; checked and in time order.

    Parameters
    ----------
    time : (fixes,) s.
    position : latitude and longitude (rad), height (m), (fixes,) each.
    position_sigmas : (fixes, 3) m, north, east, down.
    velocity_n, velocity_sigmas : (fixes, 3) m/s, or None without velocities.
    quality : (fixes,) by the numbers of `QUALITIES`; None for single fixes.
    remarks, name : of the file.

    Raises
    ------
    RecordingError
        If a latitude or height cannot be on the Earth, or a sigma is not positive.
    """
    fixes = len(time)
    none = np.full((fixes, 3), np.nan)
    track = GnssTrack(
        time,
        *position,
        _diagonal_covariances(position_sigmas),
        none if velocity_n is None else velocity_n,
        _diagonal_covariances(none if velocity_sigmas is None else velocity_sigmas),
        np.full(fixes, 5) if quality is None else quality,
        remarks,
        name,
    )
    return in_order(track)


def in_order(track: GnssTrack) -> GnssTrack:
    """Return a track checked, in time order, each instant once; what was left out is remarked.

    Parameters
    ----------
    track : as it was read.

    Raises
    ------
    RecordingError
        If a latitude or height cannot be on the Earth, or a sigma is not positive.
    """
    _refuse_impossible(track)
    order = np.argsort(track.time, kind="stable")
    again = np.concatenate([[False], np.diff(track.time[order]) <= 0.0]) if len(order) else order.astype(bool)
    remarks = track.remarks
    if np.any(np.diff(track.time) < 0.0):
        text = f"The fixes of {track.name} were not in time order and have been sorted."
        remarks += (Remark("mended", text),)
    if again.any():
        text = f"{int(again.sum())} fixes of {track.name} repeat an instant and were left out."
        remarks += (Remark("mended", text),)
    return replace(track.rows(order[~again]), remarks=remarks)


def _refuse_impossible(track: GnssTrack) -> None:
    def refuse(wrong: np.bool | np.ndarray, words: str, values: Series | None = None) -> None:
        if wrong.any():
            row = int(np.argmax(wrong))
            seen = "" if values is None else f"{values[row]:g}"
            raise RecordingError(f"Fix {row + 1} of {track.name} has {words.format(seen)}")

    numbers = np.column_stack([track.time, *track.position])
    refuse(
        ~np.isfinite(numbers).all(axis=1),
        "a time or a position that is no number: leave such fixes out.",
    )
    refuse(
        ~(np.abs(track.latitude) <= 0.5 * np.pi),
        "a latitude of {} degrees, beyond the poles: check the unit (degrees) and which column is the latitude.",
        np.degrees(track.latitude),
    )
    refuse(
        ~((track.height > -12_000.0) & (track.height < 1e6)),
        "a height of {} m, which is not near the Earth's surface: check the unit (metres) and which column is the "
        "height.",
        track.height,
    )
    wrong = np.asarray(np.abs(track.longitude) > 2.0 * np.pi)
    for part in (track.position_covariance_n, track.velocity_n, track.velocity_covariance_n):
        wrong |= np.isinf(part).reshape(len(track), -1).any(axis=1)
    refuse(
        wrong,
        "a longitude, a velocity or an uncertainty that cannot be: check the units and which column is which.",
    )
    variances = np.einsum("ijj->ij", track.position_covariance_n)
    refuse(~(variances > 0.0).all(axis=1), "no positive standard uncertainty of its position: give one.")


# s for which all fixes may be outliers, and how many fixes that is at most and at least.
_LONGEST, _MOST, _FEWEST = 30.0, 300, 10
# By how much velocities may be off beside their noise, m/s: one in the middle of a turn stands for a whole interval.
_SLACK = 0.3
# Receivers' velocities may be late by this, s.
_LATE = 0.5
_SIGMAS = 5.0
# Of fewer fixes in one chain than this share nothing is said.
_LEAST = 0.5


def fit_velocities(track: GnssTrack) -> np.ndarray:
    """Return (fixes,) which positions fit one another by the velocities between them: the longest chain that does.

    Parameters
    ----------
    track : in time order. Without velocities, or where no chain holds half of the fixes, all are said to fit.
    """
    fixes = len(track)
    if fixes < 3 or not track.has_velocity.all():
        return np.ones(fixes, dtype=bool)
    step = np.diff(track.time)
    middle = 0.5 * (track.velocity_n[1:] + track.velocity_n[:-1]) * step[:, None]
    way = np.vstack([np.zeros((1, 3)), np.cumsum(middle, axis=0)])
    first = tuple(np.full(fixes, column[0]) for column in track.position)
    # what is left is one constant for all fixes that fit, but for the drift of the integral
    left = position_differences(track.position, (first[0], first[1], first[2])) - way
    sigma = np.sqrt(np.einsum("ijj->i", track.position_covariance_n))
    kept = np.zeros(fixes, dtype=bool)
    kept[_longest_chain(left, track, sigma)] = True
    return kept if kept.sum() >= _LEAST * fixes else np.ones(fixes, dtype=bool)


def _longest_chain(left: Vectors, track: GnssTrack, sigma: Series) -> list[int]:
    """Indices of the longest chain of which each fits the one before it."""
    fixes = len(track)
    window = min(max(_FEWEST, round(_LONGEST / max(track.interval, 1e-3))), _MOST)
    length, previous = np.ones(fixes, dtype=np.int64), np.full(fixes, -1)
    follows = _fit(left, track, sigma, slice(None, -1), slice(1, None))
    longest = 1
    for j in range(1, fixes):
        if follows[j - 1] and length[j - 1] == longest:
            # no chain is longer, and none that is as long is nearer: what most fixes of a sound track are
            longest = length[j] = longest + 1
            previous[j] = j - 1
            continue
        i = np.arange(max(0, j - window), j)
        ways = np.where(_fit(left, track, sigma, i, j), length[i], 0)
        # of chains as long the nearest: the last of the greatest
        best = len(ways) - 1 - int(np.argmax(ways[::-1]))
        if ways[best] > 0:
            length[j], previous[j] = ways[best] + 1, i[best]
            longest = max(longest, int(length[j]))
    at = int(np.argmax(length))
    chain = [at]
    while previous[at] >= 0:
        at = int(previous[at])
        chain.append(at)
    return chain


def _fit(
    left: Vectors, track: GnssTrack, sigma: Series, i: npt.NDArray[np.intp] | slice, j: int | slice
) -> npt.NDArray[np.bool_]:
    """Which fixes i fit the later fix j, or each its own."""
    time, velocity = track.time, track.velocity_n
    apart = np.sqrt(np.sum((left[i] - left[j]) ** 2, axis=1))
    change = np.sqrt(np.sum((velocity[i] - velocity[j]) ** 2, axis=1))
    return np.asarray(
        apart <= _SLACK * (time[j] - time[i]) + _LATE * change + _SIGMAS * np.hypot(sigma[i], sigma[j])
    )
