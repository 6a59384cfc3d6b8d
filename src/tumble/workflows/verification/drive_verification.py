"""What a drive says of a calibration: the numbers with their uncertainties, and the verdict."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import Series
from tumble.calibration.verdict import two_digits
from tumble.navigation import FilterRun, OutageErrors
from tumble.navigation.block_bootstrap import Statistic, ratio_of, rms_of
from tumble.navigation.free_drift import FreeDrift
from tumble.records import dataclass
from tumble.workflows.verification.calibration_parts import AT_REST, UNCALIBRATED, WHOLE

# Normalised errors beyond this contradict the calibration: one in 15,000 by chance.
LARGEST_NORMALISED = 4.0
# Beyond this the IMU and the positions do not describe one drive, whoever is to blame.
LARGEST_SHARE_REFUSED = 0.1
# And the positions that are taken fit worse than this, in squared normalised innovations.
LARGEST_LEFT = 2.0
_FEWEST = 4
# A drive of less, s, speaks against a calibration by its drift only where that is beyond doubt.
_SHORT = 120.0
_TRIADS = ("accelerometer", "gyroscope")
_UNKNOWN = Statistic(float("nan"), float("nan"))
_GRAVITY, _EARTH_RADIUS = 9.81, 6.371e6


@dataclass(frozen=True, slots=True)
class PartResult:
    """What navigation was with a part of the calibration.

    Attributes
    ----------
    part : its name.
    drift : free inertial drift from known starts.
    sliding, gaps : outages of each length, one by one and again and again.
    innovations : mean squared normalised innovation of the positions taken, over its degrees of freedom; 1 when the
        filter is consistent.
    refused, fixes : positions that the filter took for outliers, and all.
    no_proof : whether it finds no motion that samples and positions both describe.
    """

    part: str
    drift: FreeDrift
    sliding: list[OutageErrors]
    gaps: list[OutageErrors]
    innovations: float
    refused: int
    fixes: int
    no_proof: bool = False


@dataclass(slots=True)
class DriveVerification:
    """A calibration's worth on a drive.

    Attributes
    ----------
    recording, track : names of the files.
    offset, offset_sigma : s to add to the track's times, and its standard uncertainty (0 where given).
    clock, alignment, setting : in words.
    parts : by part of the calibration, uncalibrated first, all of it last.
    contradictions : state of a sensor -> estimate (SI) and how many of its standard uncertainties that is.
    moved : bias -> estimate (SI) and how many standard uncertainties of the calibration and the drive that is, if
        biases could not have moved since.
    turn_on : m/s² and rad/s, by how much they may have moved.
    refused_free : positions refused by a filter of the calibrated samples that is free to find the biases.
    no_proof : whether even that filter finds no motion that both describe, nor one of the uncalibrated samples.
    left_out : positions that do not fit the receiver's own velocities.
    why_innovations : why they are not of the size that the filter expects, with all of the calibration.
    seconds : s, lengths of the free drift.
    fit, reasons, remarks : the verdict, and sentences.
    """

    offset: float
    offset_sigma: float
    clock: str
    alignment: str
    parts: list[PartResult]
    contradictions: dict[str, tuple[float, float]]
    seconds: Series
    duration: float
    recording: str = ""
    track: str = ""
    setting: list[str] = field(default_factory=list[str])
    moved: dict[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])
    turn_on: tuple[float, float] = (0.0, 0.0)
    refused_free: int = 0
    no_proof: bool = False
    left_out: int = 0
    why_innovations: str = ""
    fit: bool = True
    reasons: list[str] = field(default_factory=list[str])
    remarks: list[str] = field(default_factory=list[str])

    def part(self, name: str) -> PartResult:
        """Return the result of a part by its name."""
        return next(result for result in self.parts if result.part == name)

    def drift_rms(self, name: str, length: int) -> Statistic:
        """Return the rms horizontal drift of a part, m, after one of the lengths."""
        drift = self.part(name).drift
        squares = drift.horizontal_squares(length)
        return rms_of(squares[np.isfinite(squares)], drift.block(length), _dice(length))

    def drift_ratio(self, name: str, length: int) -> Statistic:
        """Return the drift of a part over that without calibration, from the same starts."""
        ours, theirs = (self.part(one).drift for one in (name, UNCALIBRATED))
        squares, others = ours.horizontal_squares(length), theirs.horizontal_squares(length)
        good = np.isfinite(squares) & np.isfinite(others)
        return ratio_of(squares[good], others[good], ours.block(length), _dice(length))

    def outage_statistics(self, name: str, duration: float, kind: str) -> tuple[Statistic, Statistic]:
        """Return the rms horizontal error of a part at the ends of outages, m, and its ratio to that uncalibrated.

        Parameters
        ----------
        name : of the part.
        duration : s.
        kind : "sliding" or "gaps".
        """
        ours, theirs = (
            next(one for one in getattr(self.part(part), kind) if one.duration == duration)
            for part in (name, UNCALIBRATED)
        )
        if not len(ours.starts):
            return _UNKNOWN, _UNKNOWN
        apart = float(np.median(np.diff(ours.starts))) if len(ours.starts) > 1 else duration
        block = max(1, round(2.0 * duration / apart))
        squares = ours.horizontal**2
        theirs_at = {round(start, 3): row for row, start in enumerate(theirs.starts.tolist())}
        pairs = [
            (row, theirs_at[round(start, 3)])
            for row, start in enumerate(ours.starts.tolist())
            if round(start, 3) in theirs_at
        ]
        at, other = [row for row, _ in pairs], [row for _, row in pairs]
        ratio = ratio_of(squares[at], theirs.horizontal[other] ** 2, block, _dice(1)) if pairs else _UNKNOWN
        return rms_of(squares, block, _dice(2)), ratio

    def accuracy(self, name: str) -> tuple[Statistic, Statistic, str]:
        """Return least and most drift over an hour, km/h, that the free runs let expect, and the class of the least.

        Least if the accelerometers cause all of it (with Schuler's period), most if the gyros do.
        """
        rms, seconds = self.drift_rms(name, self.longest), float(self.seconds[self.longest])
        least, most = _hourly_drift(seconds)
        return (
            Statistic(rms.value * least, rms.sigma * least),
            Statistic(rms.value * most, rms.sigma * most),
            _class_between(rms.value * least, rms.value * most),
        )

    @property
    def longest(self) -> int:
        """Index of the longest length that enough starts reach."""
        drift = self.parts[0].drift
        reached = [
            i for i in range(len(self.seconds)) if np.isfinite(drift.horizontal_squares(i)).sum() >= _FEWEST
        ]
        return reached[-1] if reached else 0


def _dice(seed: int) -> np.random.Generator:
    return np.random.default_rng(1000 + seed)


def _hourly_drift(seconds: float) -> tuple[float, float]:
    """Return km/h over an hour for each metre of drift after some time, if accelerometers or gyros cause it.

    A constant error b of specific force moves b t²/2, and over an hour 2 b/s² at most, with Schuler's frequency s; a
    constant error w of angular rate g w t³/6, and over an hour w R t.
    """
    force, rate = 2.0 / seconds**2, 6.0 / (_GRAVITY * seconds**3)
    return force * 2.0 * _EARTH_RADIUS / _GRAVITY * 1e-3, rate * _EARTH_RADIUS * 3.6


def _class_between(least: float, most: float) -> str:
    best, worst = accuracy_class(least), accuracy_class(most)
    return best if best == worst else f"{best} at best"


def accuracy_class(kilometres_per_hour: float) -> str:
    """Return the class of an inertial system by its drift (Hayal 2010, 2.2, after Jekeli 2000).

    Parameters
    ----------
    kilometres_per_hour : of position.
    """
    if not np.isfinite(kilometres_per_hour):
        return "unknown"
    if kilometres_per_hour > 4.0:
        return "low (tactical grade)"
    return "medium (navigation grade)" if kilometres_per_hour > 1.0 else "high"


def judge_drive(found: DriveVerification, own_recording: bool) -> None:
    """Fill `fit` and `reasons`.

    Parameters
    ----------
    found : without them.
    own_recording : whether the calibration was made from this drive.
    """
    against: list[str] = []
    last = found.longest
    ratio = found.drift_ratio(WHOLE, last)
    seconds = found.seconds[last]
    # few blocks of starts understate how their ratio scatters
    surely = 2.0 if found.duration >= _SHORT else 4.0
    if np.isfinite(ratio.sigma) and ratio.value - surely * ratio.sigma > 1.0:
        against.append(
            f"After {seconds:g} s of free navigation the drift with the calibration is {ratio.value:.2f} ± "
            f"{ratio.sigma:.2f} times that without: it is of another unit, or the unit has changed; calibrate again."
        )
    worst = sorted(found.contradictions.items(), key=lambda item: -abs(item[1][1]))
    if worst and abs(worst[0][1][1]) > LARGEST_NORMALISED:
        name, (estimate, times) = worst[0]
        against.append(
            f"The drive finds the {_plain(name)} off by {_practical(name, estimate)}, {abs(times):.1f} times what the "
            f"calibration's uncertainty allows{_beside(found, name)}."
        )
    result = found.part(WHOLE)
    refused = result.refused > LARGEST_SHARE_REFUSED * result.fixes
    if found.no_proof:
        # what a filter finds that has lost its way says nothing about the sensors
        against = [
            (
                f"The drive is no proof: {found.refused_free} of {result.fixes} positions were refused by a filter "
                "that may find the biases itself, and the others do not fit. Positions and IMU do not describe one "
                "motion: an axis reversed, a wrong offset between the clocks, too many outliers, or another unit."
            )
        ]
    elif refused and (raw := found.part(AT_REST)).refused < 0.5 * result.refused:
        against.insert(
            0,
            f"With the calibration the filter refuses {result.refused} of {result.fixes} positions, and uncalibrated, "
            f"less the gyros' mean at rest, {raw.refused}: it is of another unit, or the unit has changed.",
        )
    found.fit = not against
    own = (
        ["This is a recording that the calibration was made from: it shows nothing new."]
        if own_recording
        else []
    )
    if found.fit:
        own += _on_turn_on(found)
    found.reasons = [*against, *own, *_words(found, ratio)]


def no_proof(run: FilterRun) -> bool:
    """Return whether a filter that may find the biases finds no motion that IMU and positions both describe.

    Outliers are refused and the other positions fit: a share of them alone proves nothing.

    Parameters
    ----------
    run : of the calibrated samples.
    """
    distances: Series = run.distances[:, 0]
    seen = np.isfinite(distances)
    taken = seen & run.taken[:, 0]
    refused = 1.0 - float(taken.sum()) / max(int(seen.sum()), 1)
    left = float(np.mean(distances[taken])) / 3.0 if taken.any() else float("inf")
    return refused > LARGEST_SHARE_REFUSED and (refused > 0.5 or left > LARGEST_LEFT)


def _beside(found: DriveVerification, name: str) -> str:
    """What a bias was allowed beside the calibration's uncertainty."""
    if "bias" not in name:
        return ": it has changed since, or the filter's noise is stated too small"
    return (
        f" with {_allowed(found)} from one turn-on to the next: it has changed since, or this unit's biases move by "
        "more than was said with --turn-on-bias"
    )


def _allowed(found: DriveVerification) -> str:
    force, rate = (_practical(f"{triad} bias", x) for triad, x in zip(_TRIADS, found.turn_on, strict=True))
    return f"{force} and {rate}"


def _on_turn_on(found: DriveVerification) -> list[str]:
    """A sentence where it serves only because biases may have moved since the calibration."""
    worst = max(found.moved.items(), key=lambda item: abs(item[1][1]), default=None)
    if worst is None or abs(worst[1][1]) <= LARGEST_NORMALISED:
        return []
    name, (estimate, times) = worst
    return [
        (
            f"It serves if this unit's biases may move by {_allowed(found)} from one turn-on to the "
            f"next (--turn-on-bias). The drive finds the {_plain(name)} moved by "
            f"{_practical(name, estimate)}, {abs(times):.1f} times what the calibration's own "
            "uncertainty allows."
        )
    ]


def _words(found: DriveVerification, ratio: Statistic) -> list[str]:
    last = found.longest
    with_it, without = (found.drift_rms(name, last) for name in (WHOLE, UNCALIBRATED))
    words = [
        (
            f"Free drift after {found.seconds[last]:g} s, horizontal rms: {said(with_it, 'm')} with the calibration, "
            f"{said(without, 'm')} without; ratio {said(ratio)}."
        )
    ]
    for name, verb in ((UNCALIBRATED, "without"), (WHOLE, "with")):
        least, most, grade = found.accuracy(name)
        words.append(
            f"Class of accuracy {verb} the calibration: {grade}. Over an hour it becomes {said(least, 'km')} if "
            f"the accelerometers cause it, {far(most)} if the gyros do."
        )
    result = found.part(WHOLE)
    left_out = f", and {found.left_out} left out before" if found.left_out else ""
    words.append(
        f"Innovations: {result.innovations:.2f} times what the filter expects (1 when consistent); {result.refused} of "
        f"{result.fixes} positions refused as outliers{left_out}."
        f"{' ' if found.why_innovations else ''}{found.why_innovations}"
    )
    return words


def said(number: Statistic, unit: str = "") -> str:
    """Return a number with its standard uncertainty to two digits.

    Parameters
    ----------
    number, unit : what is said.
    """
    tail = f" {unit}" if unit else ""
    if not np.isfinite(number.value):
        return "unknown"
    if not (np.isfinite(number.sigma) and number.sigma > 0.0):
        return f"{number.value:.2g}{tail} (too few for an uncertainty)"
    digits = max(0, 1 - int(np.floor(np.log10(number.sigma))))
    return f"{number.value:,.{digits}f} ± {number.sigma:,.{digits}f}{tail}"


def far(number: Statistic) -> str:
    """Return kilometres in words, of which there are no more than half around the Earth.

    Parameters
    ----------
    number : km.
    """
    return "thousands of km" if not number.value < 5000.0 else said(number, "km")


def _practical(name: str, value: float) -> str:
    if "bias" in name:
        if name.startswith("accelerometer"):
            return f"{_signed(value / 9.80665e-3)} mg"
        return f"{_signed(float(np.degrees(value)) * 3600.0)} °/h"
    return f"{_signed(100.0 * value)} %" if "scale" in name else f"{_signed(1e3 * value)} mrad"


def _plain(name: str) -> str:
    """A state's name in the glossary's words."""
    return name.replace("gyroscope", "gyro")


def _signed(value: float) -> str:
    return f"{'−' if value < 0.0 else ''}{two_digits(abs(value))}"
