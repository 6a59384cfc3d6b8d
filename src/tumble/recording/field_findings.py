"""What the doctor finds of a magnetometer: its norm, its dip, its axes, and what is wrong with it.

The dip is the angle of the field below the horizontal. Over rests in many poses it is one angle, for gravity and the
field are both fixed, but only if accelerometer and magnetometer count their axes alike: with f the specific force and
m the magnetometer's numbers at rest, h its hard iron and P the signed permutation from its axes to the accelerometer's,
``f' P (m - h) = c`` at every rest, which is linear in ``P h`` and c. P and -P fit alike, with c and -c: of the two, the
one in which the field points down is named, as it does north of the magnetic equator.

References
----------
Constant angle between field and gravity: M. Kok and T. B. Schoen, *Magnetometer calibration using inertial sensors*,
IEEE Sensors Journal 16 (2016), 5679-5689 (arXiv 1601.05257), section IV-C.
"""

from __future__ import annotations

import itertools

import numpy as np

from tumble.arrays import Matrix, Series, Vectors
from tumble.recording.columns import renamed
from tumble.recording.field_reading import not_the_earths
from tumble.recording.magnetic_field import MagneticField
from tumble.recording.recording import Recording
from tumble.recording.rest import QuietStretches, count_poses, find_quiet_stretches, fit_sphere, smallest_step
from tumble.recording.saturation import Saturation, find_saturation
from tumble.recording.vector_signs import is_earth_field, vector_signs
from tumble.records import dataclass
from tumble.units import COUNTS, magnetic_field_factor

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


@dataclass(frozen=True, slots=True)
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
    channels = dict(zip(_COLUMNS, field.values.T, strict=True))
    rate = field.rate or recording.rate
    floor = find_quiet_stretches(field.values, rate).floor
    floors = {name: float(value) for name, value in zip(channels, floor, strict=True)}
    stuck = tuple(name for name, values in channels.items() if float(np.ptp(values)) == 0.0)
    saturations = tuple(s for n, values in channels.items() for s in find_saturation(values, n, floors[n]))
    signs = vector_signs(field.values, rate)
    norms = np.linalg.norm(field.values, axis=1)
    angle = None if stuck or recording.specific_force is None else _angle_to_gravity(recording, field, rests)
    axes = None if angle is None else angle.names()
    warnings = [
        *_faults(recording, field, stuck, saturations),
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
        noise_floor=floors,
        quantisation={name: smallest_step(values) for name, values in channels.items()},
        stuck=stuck,
        saturations=saturations,
        dip=None if angle is None or axes is not None else angle.dip,
        dip_scatter=None if angle is None or axes is not None else angle.scatter,
        axes=axes,
        warnings=tuple(warnings),
    )


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


@dataclass(frozen=True, slots=True)
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
        words = ["", "", ""]
        for axis in range(3):
            column = int(np.argmax(np.abs(self.best[axis])))
            words[column] = ("-" if self.best[axis, column] < 0 else "") + "m" + "xyz"[axis]
        return words[0], words[1], words[2]


def _angle_to_gravity(recording: Recording, field: MagneticField, rests: QuietStretches) -> _Angle | None:
    """Return how constant the angle between field and gravity is over the rests, None with too few poses."""
    force, seen = _means_at_rest(recording, field, rests)
    if len(force) < _FEWEST_POSES:
        return None
    sphere = fit_sphere(force)
    force = force - sphere[0] if sphere is not None else force
    if count_poses(force) < _FEWEST_POSES:
        return None
    up = force / np.linalg.norm(force, axis=1)[:, None]
    fits = [(p, *_constant_angle(up, seen, p)) for p in _proper_permutations()]
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


def _proper_permutations() -> list[Matrix]:
    """Return the 24 signed permutations that keep the handedness: one of each pair P, -P."""
    found: list[Matrix] = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[np.arange(3), order] = signs
            if np.linalg.det(matrix) > 0.0:
                found.append(matrix)
    return found


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
