"""The doctor: what a recording holds, what is wrong with it or with single channels, and what it is good for.

Rest and poses come from the reader's own rough rule (`tumble.recording.rest`), not from the
segmentation that a calibration uses.

The dip of a magnetometer is the angle of the field below the horizontal. Over rests in many poses it is one angle, for
gravity and the field are both fixed, but only if accelerometer and magnetometer count their axes alike: with f the
specific force and m the magnetometer's numbers at rest, h its hard iron and P the signed permutation from its axes to
the accelerometer's, ``f' P (m - h) = c`` at every rest, which is linear in ``P h`` and c. P and -P fit alike, with c
and -c: of the two, the one in which the field points down is named, as it does north of the magnetic equator.

References
----------
Constant angle between field and gravity: M. Kok and T. B. Schoen, *Magnetometer calibration using inertial sensors*,
IEEE Sensors Journal 16 (2016), 5679-5689 (arXiv 1601.05257), section IV-C.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import Matrix, Series, Table, Vectors
from tumble.recording.columns import is_earth_field, renamed, vector_signs
from tumble.recording.gravity_check import (
    axis_agreement,
    axis_words,
    find_axis_contradiction,
    signed_permutations,
)
from tumble.recording.recording import Recording
from tumble.recording.rest import (
    QuietStretches,
    Saturation,
    block_statistics,
    find_quiet_stretches,
    find_saturation,
    fit_sphere,
    one_a_direction,
    smallest_step,
)
from tumble.recording.samples import MagneticField
from tumble.recording.units import not_the_earths
from tumble.records import dataclass
from tumble.units import COUNTS, STANDARD_GRAVITY, magnetic_field_factor, specific_force_factor

_FEWEST_POSES = 8  # for four unknowns and a choice among 24
_AXES_WRONG = (
    0.1,
    3.0,
)  # scatter of the dip, rad, and times that of the best axes, at which the axes are wrong
_COLUMNS = ("mx", "my", "mz")
_AXES_RIGHT = 0.1  # rad, that the best axes leave at most: soft iron leaves some hundredths
_SECOND = 2.0  # times the best: the axes next to them
_DIP_SCATTER = 0.1  # rad
_SHORT = 0.5  # of the recording, that the magnetometer covers


@dataclass(frozen=True)
class FieldFindings:
    """What the doctor found of the magnetometer.

    Attributes
    ----------
    unit, samples, rate : of the numbers; samples a second.
    norm : middle norm, raw, hard iron taken out where enough directions determine it.
    norm_range : least and greatest norm as it was measured, raw.
    hard_iron : offset that the sphere through all samples shows, in norms; 0 where it shows none.
    noise_floor, quantisation : by channel (mx, my, mz), raw: one standard deviation at rest, the smallest step.
    stuck, saturations : channels that never change; that stick at their extreme.
    dip, dip_scatter : angle of the field below the horizontal and its scatter over the rests, deg; None if not told.
    axes : names of the magnetometer's columns in the accelerometer's axes if these contradict, as ("my", "mx", "-mz").
    warnings : sentences.
    """

    unit: str
    samples: int
    rate: float
    norm: float
    norm_range: tuple[float, float]
    hard_iron: float
    noise_floor: dict[str, float]
    quantisation: dict[str, float]
    stuck: tuple[str, ...]
    saturations: tuple[Saturation, ...]
    dip: float | None
    dip_scatter: float | None
    axes: tuple[str, str, str] | None
    warnings: tuple[str, ...]


def inspect_field(recording: Recording, rests: QuietStretches) -> FieldFindings | None:
    """Examine the magnetometer of a recording, None if it has none.

    Parameters
    ----------
    recording : as read.
    rests : stretches of its rows at rest, whose first three means are the specific force (where there is one).
    """
    field = recording.magnetic_field
    if field is None:
        return None
    channels: dict[str, Series] = dict(zip(_COLUMNS, field.values.T, strict=True))
    rate = field.rate or recording.rate
    floor = find_quiet_stretches(field.values, rate).floor
    facts = _channel_facts(channels, floor)
    stuck = facts["stuck"]
    signs = vector_signs(field.values, rate)
    norms = np.linalg.norm(field.values, axis=1)
    angle = None if stuck or recording.specific_force is None else _angle_to_gravity(recording, field, rests)
    axes = None if angle is None else angle.names()
    warnings = [
        *_faults(recording, field, stuck, facts["saturations"]),
        *_about_norm(signs.norm, field.unit),
        *_about_axes(angle, axes, recording.columns),
    ]
    return FieldFindings(
        unit=field.unit,
        samples=len(field),
        rate=rate,
        norm=signs.norm,
        norm_range=(float(norms.min()), float(norms.max())),
        hard_iron=signs.offset,
        **facts,
        dip=None if angle is None or axes is not None else angle.dip,
        dip_scatter=None if angle is None or axes is not None else angle.scatter,
        axes=axes,
        warnings=tuple(warnings),
    )


def _channel_facts(channels: dict[str, Series], floor: Series) -> dict[str, Any]:
    """Return what findings hold of channels: noise at rest, smallest step, what never changes, what is at its limit."""
    floors = {name: float(value) for name, value in zip(channels, floor, strict=True)}
    return {
        "noise_floor": floors,
        "quantisation": {name: smallest_step(values) for name, values in channels.items()},
        "stuck": tuple(name for name, values in channels.items() if float(np.ptp(values)) == 0.0),
        "saturations": tuple(
            s for n, values in channels.items() for s in find_saturation(values, n, floors[n])
        ),
    }


def _faults(
    recording: Recording, field: MagneticField, stuck: tuple[str, ...], saturations: tuple[Saturation, ...]
) -> list[str]:
    said: list[str] = []
    if stuck:
        said.append(
            f"Channel(s) {', '.join(stuck)} of the magnetometer never change: a dead sensor or a wrong column."
        )
    said += [
        f"{s.channel} sticks at {s.value:.6g} for {s.samples} samples (longest run {s.longest_run}): the magnetometer "
        "is saturated. Take it away from iron and magnets, or choose a larger range."
        for s in saturations
    ]
    begin, end = max(field.time[0], recording.time[0]), min(field.time[-1], recording.time[-1])
    if end - begin < _SHORT * recording.duration:
        said.append(
            f"The magnetometer covers {max(float(end - begin), 0.0):.4g} of {recording.duration:.4g} s of the "
            "recording: its log was cut, or its stamps are from another clock."
        )
    return said


def _about_norm(norm: float, unit: str) -> list[str]:
    factor = magnetic_field_factor(unit)
    if factor is None or is_earth_field(norm * factor):
        return []
    sentence = not_the_earths(norm, unit)
    return [sentence[0].upper() + sentence[1:]]


@dataclass(frozen=True)
class _Angle:
    """The angle between field and gravity over rests, with the magnetometer's axes as they are and as fits best."""

    dip: float
    scatter: float  # deg
    best: Matrix
    own: float  # scatter of the sine of the dip with the axes as they are
    least: float  # with the best
    second: float  # with the next ones

    def names(self) -> tuple[str, str, str] | None:
        """Return what to call the columns so that the axes agree, None if they do or nothing shows it."""
        wrong = self.own > max(_AXES_WRONG[0], _AXES_WRONG[1] * self.least)
        if not wrong or self.least > _AXES_RIGHT or self.second < _SECOND * self.least:
            return None
        first, second, third = axis_words(self.best, "m")
        return first, second, third


def _angle_to_gravity(recording: Recording, field: MagneticField, rests: QuietStretches) -> _Angle | None:
    """Return how constant the angle between field and gravity is over the rests, None with too few poses."""
    force, seen = _means_at_rest(recording, field, rests)
    if len(force) < _FEWEST_POSES:
        return None
    sphere = fit_sphere(force)
    force = force - sphere[0] if sphere is not None else force
    if len(one_a_direction(force)) < _FEWEST_POSES:
        return None
    up = force / np.linalg.norm(force, axis=1)[:, None]
    # One of each pair P, -P: those that keep the handedness.
    proper = [p for p in signed_permutations() if np.linalg.det(p) > 0.0]
    fits = [(p, *_constant_angle(up, seen, p)) for p in proper]
    # One length for all, so that axes with a great hard iron do not seem better.
    size = _size(seen)
    own = _constant_angle(up, seen, np.eye(3) if field.turn is None else field.turn)
    ranked = sorted(fits, key=lambda f: f[2])
    best = ranked[0][0] if ranked[0][1] <= 0.0 else -ranked[0][0]
    sine = np.clip(-own[0] / size, -1.0, 1.0)
    spread = own[1] / size / max(np.sqrt(1.0 - sine**2), 0.1)
    return _Angle(
        float(np.degrees(np.arcsin(sine))),
        float(np.degrees(spread)),
        best,
        own[1] / size,
        ranked[0][2] / size,
        ranked[1][2] / size,
    )


def _means_at_rest(
    recording: Recording, field: MagneticField, rests: QuietStretches
) -> tuple[Vectors, Vectors]:
    """Return the means of specific force and field over the rests in which the magnetometer has samples."""
    first = np.searchsorted(field.time, recording.time[rests.starts])
    last = np.searchsorted(field.time, recording.time[rests.stops - 1], side="right")
    there = last > first
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(field.values, axis=0)])
    count = (last - first)[there][:, None]
    return rests.means[there, :3], (sums[last[there]] - sums[first[there]]) / count


def _size(seen: Vectors) -> float:
    """Return the field's length from its means at rest: the sphere's radius, or the middle norm."""
    sphere = fit_sphere(seen)
    return sphere[1] if sphere is not None else float(np.median(np.linalg.norm(seen, axis=1)))


def _constant_angle(up: Vectors, seen: Vectors, permutation: Matrix) -> tuple[float, float]:
    """Return c of ``up' P (m - h) = c``, and the scatter about it (raw units, four unknowns)."""
    design = np.column_stack([up, np.ones(len(up))])
    values = np.einsum("ri,ij,rj->r", up, permutation, seen)
    solution: Series = np.linalg.pinv(design) @ values
    rest: Series = values - design @ solution
    return float(solution[3]), float(np.sqrt(rest @ rest / (len(up) - 4)))


def _about_axes(angle: _Angle | None, axes: tuple[str, str, str] | None, columns: str | None) -> list[str]:
    if angle is None:
        return []
    scatter = f"differs by {np.degrees(angle.own):.0f}° from rest to rest"
    if axes is not None:
        names: dict[str, str] = dict(zip(_COLUMNS, axes, strict=True))
        south = {
            name: word.removeprefix("-") if word.startswith("-") else f"-{word}"
            for name, word in names.items()
        }
        wrong = ", ".join(f"what is read as {n} seems to be {w}" for n, w in names.items() if n != w)
        said = (
            f"The magnetometer's axes are not the accelerometer's: {wrong}. The angle between field and gravity "
            f"{scatter}, and by {np.degrees(angle.least):.1f}° so. Name the columns mx, my, mz {', '.join(axes)} with "
            f"--columns{renamed(columns, names)}. South of the magnetic equator reverse all three signs "
            f"besides, with --columns{renamed(columns, south)}."
        )
        return [said]
    if angle.own > _DIP_SCATTER:
        said = (
            f"The angle between field and gravity {scatter}, and no other order or sign of the axes makes it "
            "constant. The field is disturbed by iron near the place, or strong soft iron sits on the unit."
        )
        return [said]
    return []


def say_field(found: FieldFindings) -> str:
    """Return the facts of a magnetometer as one line."""
    factor = magnetic_field_factor(found.unit)
    length = f"{found.norm:.4g} {found.unit}"
    if factor is not None and found.unit != "uT":
        length += f" ({found.norm * factor * 1e6:.4g} µT)"
    low, high = found.norm_range
    words = f"Magnetometer: {found.samples} samples at {found.rate:.4g} Hz, norm {length}, as measured {low:.4g} to "
    words += f"{high:.4g}"
    if found.hard_iron > 0.0:
        words += f", hard iron {100.0 * found.hard_iron:.0f} % of it"
    if found.dip is not None:
        words += f", dip {found.dip:.1f}° ± {found.dip_scatter:.1f}° over the rests"
    return words + ("; the unit is not known" if found.unit == COUNTS else "")


def find_dead_channels(recording: Recording) -> list[str]:
    """Return a sentence for each channel that never changes."""
    return [
        f"{name} never changes ({float(channel[0]):g} throughout): a dead sensor or a wrong column."
        for name, channel in recording.channels.items()
        # Most change soon.
        if channel.size and all(float(np.ptp(part)) == 0.0 for part in (channel[:1000], channel))
    ]


def find_saturated_channels(recording: Recording) -> list[str]:
    """Return a sentence for each limit at which a channel sticks."""
    sentences: list[str] = []
    for name, channel in recording.channels.items():
        matters = (
            "turns with a saturated gyro are left out."
            if name.startswith("g")
            else "a hold in which an accelerometer is at its limit shows too little gravity. Choose a larger range."
        )
        for found in find_saturation(channel, name):
            when = float(recording.time[found.index])
            sentences.append(
                f"{name} is saturated at {found.value:g} in {found.samples} samples (first for long at {when:.1f} s): "
                f"{matters}"
            )
    return sentences


_NOISE_SECONDS = 600.0  # a rest that shows bias instability of common gyros, some 10 minutes
_DISTANT = 1e6  # s: stamps beyond count from a day of the calendar
_TEMPERATURE_SPAN = 10.0  # degrees Celsius that make a temperature dependence visible


@dataclass(frozen=True)
class Gap:
    """Missing samples: before sample `index`, from `time` on for `duration` seconds, about `samples`."""

    index: int
    time: float
    duration: float
    samples: int


@dataclass(frozen=True)
class Findings:
    """What the doctor found.

    Attributes
    ----------
    samples, duration, rate : number, seconds, Hz.
    jitter : standard deviation of the steps outside gaps over their mean (0 without stamps).
    longest_step : seconds.
    gaps, saturations : see there.
    stuck : channels that never change.
    noise_floor, quantisation : by channel, raw units, one standard deviation at rest and smallest step.
    rest_share, motion_share : shares of the time; what is neither is too short or unsteady to tell.
    quiet_stretches : number of stretches at rest of at least one second; `longest_rest` in seconds.
    poses : distinct poses among them (specific force more than 15 degrees apart).
    rest_norms : (stretches,) norms of the mean specific force, m/s², or raw if in counts.
    temperature_range : lowest and highest, degrees Celsius, or None.
    axis_contradiction : the sentence on swapped or reversed gyro axes, or None.
    gyro_scale : what gravity shows, rad/s per raw unit, or None if it does not.
    magnetic_field : what was found of the magnetometer, or None without one.
    warnings, good_for, missing : sentences.
    """

    samples: int
    duration: float
    rate: float
    jitter: float
    longest_step: float
    gaps: tuple[Gap, ...]
    saturations: tuple[Saturation, ...]
    stuck: tuple[str, ...]
    noise_floor: dict[str, float]
    quantisation: dict[str, float]
    rest_share: float
    motion_share: float
    quiet_stretches: int
    longest_rest: float
    poses: int
    rest_norms: tuple[float, ...]
    temperature_range: tuple[float, float] | None
    axis_contradiction: str | None
    gyro_scale: float | None
    warnings: tuple[str, ...] = ()
    good_for: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    magnetic_field: FieldFindings | None = None


def moment(recording: Recording, time: float) -> str:
    """Return a time in words: as it is, or from the beginning where the stamps count from a distant day.

    Examples
    --------
    The stamps of a bag count from 1970, and no six digits of them tell anything.
    """
    begin = float(recording.time[0])
    return f"t = {time:.6g} s" if abs(begin) < _DISTANT else f"{time - begin:.6g} s from the beginning"


def _gaps(recording: Recording) -> tuple[Gap, ...]:
    time, step = recording.time, 1.0 / recording.rate
    return tuple(
        Gap(
            i,
            float(time[i - 1]),
            float(time[i] - time[i - 1]),
            max(round((time[i] - time[i - 1]) / step) - 1, 1),
        )
        for i in recording.gaps
    )


def _jitter(recording: Recording) -> tuple[float, float]:
    """Return the relative scatter of the steps outside gaps, and the longest step."""
    steps = np.diff(recording.time)
    if not steps.size:
        return 0.0, 0.0
    longest = float(steps.max())
    whole = np.delete(steps, [i - 1 for i in recording.gaps])
    return (float(whole.std() / whole.mean()), longest) if whole.size else (0.0, longest)


def _moving_share(signals: Table, quiet: QuietStretches, rate: float) -> float:
    """Share of the samples in blocks that scatter well above the noise or whose level changes, rests left out."""
    size = max(10, round(0.25 * rate))
    if signals.shape[0] < 2 * size:
        return 0.0
    means, scatter = block_statistics(signals, size)
    steps = np.abs(np.diff(means, axis=0, prepend=means[:1]))
    moving = np.any((scatter > 8.0 * quiet.floor) | (steps > 8.0 * quiet.floor), axis=1)
    shown = np.repeat(moving, size)
    shown = np.concatenate([shown, np.full(max(signals.shape[0] - shown.size, 0), moving[-1])])
    for start, stop in zip(quiet.starts, quiet.stops, strict=True):
        shown[start:stop] = False
    return float(shown.mean())


def inspect_recording(recording: Recording) -> Findings:
    """Examine a recording and say what it is good for and what is missing.

    Parameters
    ----------
    recording : as read; nothing of it is changed.
    """
    channels = recording.channels
    signals = np.column_stack(list(channels.values())) if channels else np.zeros((0, 3))
    quiet = find_quiet_stretches(signals, recording.rate)
    long = quiet.at_least(1.0 * recording.rate)
    poses, norms = _poses(recording, long.means[:, :3])
    lengths = quiet.stops - quiet.starts
    facts = _channel_facts(channels, quiet.floor[: len(channels)])
    jitter, longest_step = _jitter(recording)
    both = recording.specific_force is not None and recording.angular_rate is not None and not facts["stuck"]
    agreement = axis_agreement(recording) if both else None
    contradiction = find_axis_contradiction(recording) if both else None
    celsius = recording.temperature
    known = None if celsius is None or not np.isfinite(celsius).any() else celsius
    found = Findings(
        samples=len(recording),
        duration=recording.duration,
        rate=recording.rate,
        jitter=jitter,
        longest_step=longest_step,
        gaps=_gaps(recording),
        **facts,
        rest_share=int(lengths.sum()) / len(recording),
        motion_share=_moving_share(signals, quiet, recording.rate),
        quiet_stretches=len(long),
        longest_rest=float(lengths.max(initial=0)) / recording.rate,
        poses=poses,
        rest_norms=tuple(float(n) for n in norms),
        temperature_range=None if known is None else (float(np.nanmin(known)), float(np.nanmax(known))),
        axis_contradiction=contradiction,
        gyro_scale=agreement.scale if agreement is not None and agreement.determined else None,
        magnetic_field=inspect_field(recording, long),
    )
    good, missing = _usefulness(recording, found)
    return replace(
        found, warnings=tuple(_warnings(recording, found)), good_for=tuple(good), missing=tuple(missing)
    )


def _poses(recording: Recording, means: Vectors) -> tuple[int, Series]:
    """Return the number of distinct poses and the norms at rest, m/s² (raw and centred for counts)."""
    if recording.specific_force is None or not len(means):
        return 0, np.zeros(0)
    factor = specific_force_factor(recording.specific_force_unit)
    if factor is None:
        sphere = fit_sphere(means)
        means = means - sphere[0] if sphere is not None else means
        factor = 1.0
    return len(one_a_direction(means)), factor * np.linalg.norm(means, axis=1)


def _warnings(recording: Recording, found: Findings) -> list[str]:
    said: list[str] = []
    if found.gaps:
        worst = max(found.gaps, key=lambda g: g.duration)
        said.append(
            f"Samples are missing in {len(found.gaps)} place(s), {sum(g.samples for g in found.gaps)} in all; the "
            "longest gap is "
            f"{worst.duration:.3g} s after {moment(recording, worst.time)}. A turn across a gap cannot be integrated."
        )
    if found.jitter > 0.2:
        said.append(
            f"The stamps jitter by {100 * found.jitter:.0f} % of a step (the gyro is integrated with them as they "
            "are)."
        )
    if found.stuck:
        said.append(f"Channel(s) {', '.join(found.stuck)} never change: a dead sensor or a wrong column.")
    said += [
        f"{s.channel} sticks at {s.value:.6g} for {s.samples} samples (longest run {s.longest_run} from "
        f"{moment(recording, float(recording.time[s.index]))}): saturated; turn more slowly or choose a larger range."
        for s in found.saturations
    ]
    if found.axis_contradiction:
        said.append(found.axis_contradiction)
    if len(found.rest_norms) >= 2 and recording.specific_force_unit != COUNTS:
        low, high = min(found.rest_norms), max(found.rest_norms)
        if low < 0.8 * STANDARD_GRAVITY or high > 1.2 * STANDARD_GRAVITY:
            said.append(
                f"The norm of specific force at rest runs from {low:.4g} to {high:.4g} m/s²; biases of a usable "
                "accelerometer are smaller. Check the unit, or a channel of it."
            )
    return [*said, *(() if found.magnetic_field is None else found.magnetic_field.warnings)]


def _usefulness(recording: Recording, found: Findings) -> tuple[list[str], list[str]]:
    """Say what the recording is good for and what it lacks."""
    good: list[str] = []
    missing: list[str] = []
    if recording.specific_force is None:
        missing.append("No accelerometer: nothing can be calibrated against gravity.")
    if recording.angular_rate is None:
        missing.append(
            "No gyro: only the accelerometers can be calibrated."
            if recording.specific_force is not None
            else "No gyro."
        )
    if found.longest_rest >= _NOISE_SECONDS:
        good.append(f"Noise analysis: a rest of {found.longest_rest:.0f} s.")
    else:
        missing.append(
            f"For noise analysis: a long rest (the longest is {found.longest_rest:.0f} s; "
            f"{_NOISE_SECONDS / 60:.0f} minutes at least, hours for bias instability)."
        )
    if found.temperature_range is None:
        missing.append("No temperature: the calibration holds for the unknown temperature of the recording.")
    elif found.temperature_range[1] - found.temperature_range[0] >= _TEMPERATURE_SPAN:
        low, high = found.temperature_range
        good.append(f"Temperature dependence: {low:.0f} to {high:.0f} °C.")
    return good, missing
