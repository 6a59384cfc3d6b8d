"""What the columns of a table are: from the user's list, from their names, or from their content.

Every guess comes with a sentence; what the numbers leave open is asked.

Accelerometers at rest and magnetometers both see one vector from all sides, so both keep their norm while they turn.
Three things tell them apart. Gravity is 1 g in some unit, the Earth's field 22 to 67 µT in some unit. And a hand, or a
vehicle, that turns a unit also pushes it about: that changes the norm of the specific force, within a second, by some
per cent and many times its noise; the norm of the field does not feel it. On a table that turns smoothly neither norm
does, and then the numbers leave it open.

References
----------
Range of the Earth's field: NOAA, *World Magnetic Model 2025*, 22 to 67 µT at the surface.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors, block_means
from tumble.errors import RecordingError, UsageError
from tumble.recording.formats.table import RawTable
from tumble.recording.rest import (
    QuietStretches,
    find_quiet_stretches,
    fit_sphere,
    one_a_direction,
    sample_pieces,
    smallest_step,
)
from tumble.recording.samples import Remark
from tumble.recording.stamps import guess_time_unit
from tumble.records import dataclass
from tumble.units import (
    STANDARD_GRAVITY,
    find_unit,
    known_units,
    magnetic_field_factor,
    specific_force_factor,
    time_factor,
)

AXES = "xyz"
_SLOTS = ("t", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz", "temperature")

NAMES: dict[str, dict[str, str]] = json.loads(
    Path(__file__).with_name("names.json").read_text(encoding="utf-8")
)
"""Names of columns, files, sensors and messages, as their makers write them: without separators and capitals."""
_WORDS = {kind: frozenset(words.split()) for kind, words in NAMES["columns"].items()}
_KNOWN = tuple((kind[0], _WORDS[kind]) for kind in ("accelerometer", "gyro", "magnetometer"))
_UNIT_SUFFIX = re.compile(
    r"[_ ](m[_/]?s\^?2|mps2|mg|g|rads|rad_s|radps|mdps|dps|deg_s|degps|s|sec|ms|us|ns|usec|nsec|msec"
    r"|[uµμnm]t|tesla|m?gauss)$",
    re.IGNORECASE,
)
_FIELD_STAMPS = "mag_time [s]"  # as tumble writes it; see `tumble.recording.formats.output`
_BRACKETS = re.compile(r"[\[(]([^\])]*)[\])]")


@dataclass(frozen=True)
class DeclaredUnits:
    """Units by quantity, None where nothing was declared."""

    specific_force: str | None = None
    angular_rate: str | None = None
    magnetic_field: str | None = None
    time: str | None = None
    velocity_increment: str | None = None
    angle_increment: str | None = None
    temperature: str | None = None

    @property
    def of_accelerometer(self) -> bool:
        """Whether one is declared that only an accelerometer has."""
        return self.specific_force is not None or self.velocity_increment is not None


Axes: TypeAlias = tuple[tuple[int, float], ...]
"""Index of the column and sign of the three axes of a triad."""


@dataclass(frozen=True)
class ColumnPlan:
    """Which column is what.

    Attributes
    ----------
    time, temperature : indices of the columns, or None.
    triads : those that there are, by letter: "a" of the accelerometer, "g" of the gyro, "m" of the magnetometer.
    units : as declared in the names, by letter, "t" of the time, or "temperature".
    magnetic_field_time : index of the column of the magnetometer's own stamps, s, or None.
    of_pair : whether the columns are those of two files side by side.
    said_by : "option", "header" or "content": who says so.
    unknown_units : quantity, name of a column, and the unit in it that nobody knows.
    """

    time: int | None
    triads: dict[str, Axes]
    temperature: int | None = None
    units: dict[str, str] = field(default_factory=dict[str, str])
    said_by: str = "header"
    unknown_units: tuple[tuple[str, str, str], ...] = ()
    magnetic_field_time: int | None = None
    of_pair: bool = False

    def renamed(self, **letters: str) -> ColumnPlan:
        """Return the plan with some triads as others: ``a="m"`` takes the accelerometer as the magnetometer."""
        return replace(self, triads={letters.get(k, k): axes for k, axes in self.triads.items()})

    def swapped(self) -> ColumnPlan:
        """Return the plan with the two inertial triads exchanged."""
        return self.renamed(a="g", g="a")


def plan_from_option(option: str, count: int, name: str) -> ColumnPlan:
    """Return the plan that the option ``--columns`` spells out.

    Parameters
    ----------
    option : names from ``t, ax, ay, az, gx, gy, gz, mx, my, mz, temperature`` in the order of the file's columns,
        separated by commas; ``-`` or ``_`` skips a column, ``-ay`` takes it with the sign reversed.
    count : number of columns of the file.
    name : the file's name, for messages.

    Raises
    ------
    UsageError
        If a word is not known or stands twice, a triad is incomplete, or the file has fewer columns.
    """
    slots: dict[str, tuple[int, float]] = {}
    words = [w.strip().lower() for w in option.split(",")]
    for i, word in enumerate(words):
        if word in ("-", "_", ""):
            continue
        sign = -1.0 if word.startswith("-") else 1.0
        slot = {"temp": "temperature", "time": "t"}.get(word.lstrip("+-"), word.lstrip("+-"))
        if slot not in _SLOTS:
            raise UsageError(
                f"--columns: {word!r} is not one of {', '.join(_SLOTS)}, - (skip) or a name with - before it."
            )
        if slot in slots:
            raise UsageError(f"--columns: {slot!r} stands twice.")
        slots[slot] = (i, sign)
    if len(words) > count:
        raise UsageError(f"--columns names {len(words)} columns, but {name} has {count}.")
    triads = {kind: [slots.get(kind + axis) for axis in AXES] for kind in "agm"}
    for kind, found in triads.items():
        if any(found) and not all(found):
            lacking = [kind + axis for axis, f in zip(AXES, found, strict=True) if f is None]
            raise UsageError(f"--columns: {', '.join(lacking)} missing; a triad needs all three axes.")
    if not any(any(found) for found in triads.values()):
        raise UsageError("--columns names no triad; give at least ax,ay,az or gx,gy,gz.")
    whole = {kind: tuple(f for f in found if f) for kind, found in triads.items() if all(found)}
    time, temperature = (slots[name][0] if name in slots else None for name in ("t", "temperature"))
    return ColumnPlan(time, whole, temperature, said_by="option")


def option_of(plan: ColumnPlan, count: int) -> str | None:
    """Return what ``--columns`` would have to be for a plan; None of two files, whose columns are two lists.

    Parameters
    ----------
    plan : which column is what.
    count : number of columns of the file.
    """
    words = ["-"] * count
    for kind, triad in plan.triads.items():
        for axis, (index, sign) in zip(AXES, triad, strict=True):
            words[index] = f"{'-' if sign < 0.0 else ''}{kind}{axis}"
    for name, index in (("t", plan.time), ("temperature", plan.temperature)):
        if index is not None:
            words[index] = name
    return None if plan.of_pair else ",".join(words)


def renamed(option: str | None, names: Mapping[str, str]) -> str:
    """Return what follows ``--columns`` to name columns otherwise, for pasting; empty where there are no columns.

    Parameters
    ----------
    option : as `option_of` gives it for the columns as they were read, None of what has none.
    names : what a column is to be called, by what it is called now: ``{"gx": "-gy"}``.

    Examples
    --------
    >>> renamed("t,ax,-gx,gy", {"gx": "-gy", "gy": "gx"})
    ' t,ax,gy,gx'
    >>> renamed(None, {"gx": "-gy"})
    ''
    """
    if option is None:
        return ""
    words: list[str] = []
    for word in option.split(","):
        slot = word.removeprefix("-")
        name = names.get(slot, slot)
        negative = (word.startswith("-") and bool(slot)) != name.startswith("-")
        words.append(f"{'-' if negative or not slot else ''}{name.removeprefix('-')}")
    return f" {','.join(words)}"


def _unit_in(name: str) -> tuple[str, str | None]:
    """Return a name without its unit, and the unit."""
    for match in _BRACKETS.finditer(name):
        inside = match.group(1).strip()
        if inside and not inside.isdigit():
            return name.replace(match.group(0), " ").strip(), inside
    if match := _UNIT_SUFFIX.search(name):
        unit = match.group(1).lower()
        unit = {"ms2": "m/s2", "m_s2": "m/s2", "rads": "rad/s"}.get(unit, unit)
        if len(name[: match.start()].strip("_ ")) > 1 or name[:1].lower() == "t":
            return name[: match.start()], unit
    return name, None


def _words(name: str) -> list[str]:
    """Split a name at separators and where a capital follows a small letter."""
    parts = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    return [w.lower() for w in re.split(r"[^A-Za-z0-9]+", parts) if w]


def _is_time(words: list[str]) -> bool:
    words = words[1:] if len(words) > 1 and words[0] in {"imu", "sensor", "data"} else words
    joined = "".join(words)
    return joined in _WORDS["time"] or (
        words[0] in {"time", "timestamp", "stamp", "t"} and len(words) <= 3 and "zone" not in joined
    )


def role_of(name: str) -> tuple[str, str | None] | None:
    """Return what a column of that name is: ("t" | "ax" … "gz" | "mx" … "mz" | "temperature", unit) or None.

    Examples
    --------
    >>> role_of("linear_acceleration.x")
    ('ax', None)
    >>> role_of("w_RS_S_z [rad s^-1]")
    ('gz', 'rad s^-1')
    >>> role_of("magX (µT)"), role_of("x_m")
    (('mx', 'µT'), None)
    """
    bare, unit = _unit_in(name)
    words = _words(re.sub(r"[\[(](\d)[\])]", r"_\1", bare))
    if not words:
        return None
    if "".join(words) in _WORDS["temperature"] or words[0] in {"temp", "temperature"}:
        return "temperature", unit
    if _is_time(words):
        return "t", unit
    joined = "".join(words)
    for axis, letters in zip(AXES, ("x0", "y1", "z2"), strict=True):
        for letter in letters:
            if len(joined) > 1 and words[-1].endswith(letter):
                before = [*words[:-1], words[-1][:-1]]
                kind = "m" if "".join(before) == "m" else _kind(before)  # x_m is a length in metres
            elif len(joined) > 1 and words[0].startswith(letter) and not letter.isdigit():
                kind = _kind([words[0][1:], *words[1:]])
            else:
                continue
            if kind:
                return kind + axis, unit
    return None


def temperature_unit_in(name: str) -> str | None:
    """Return the unit of temperature that a column's name ends with or has in brackets, None for none.

    Examples
    --------
    >>> temperature_unit_in("temperature [°F]"), temperature_unit_in("temp_K"), temperature_unit_in("degC")
    ('degF', 'K', 'degC')
    """
    bare, unit = _unit_in(name)
    last = {"tempc": "c"}.get(name.lower(), _words(bare)[-1] if _words(bare) else "")
    return find_unit("temperature", unit or last)


def _kind(words: list[str]) -> str | None:
    """Return "a", "g", "m" or None for the words of a name without its axis."""
    kept = [w for w in words if w and w not in _WORDS["filler"]]
    joined = "".join(kept)
    for kind, known in _KNOWN:
        if joined in known:
            return kind
    # "imu_data.angular_velocity" and the like: the last known word or pair of words decides.
    for i in range(len(kept) - 1, -1, -1):
        for text in ("".join(kept[i : i + 2]), kept[i]):
            for kind, known in _KNOWN:
                if len(text) > 2 and text in known:
                    return kind
    return None


def kind_of_file(name: str) -> str | None:
    """Return "a", "g" or "m" if a file's name says that it holds the accelerometer, the gyro or the magnetometer.

    Examples
    --------
    >>> kind_of_file("xsens_gyro.mat"), kind_of_file("mag.csv")
    ('g', 'm')
    """
    named = NAMES["files"].items()
    found = [kind for kind, words in named if re.search(f"(?<![a-z])({words})(?![a-z])", name.lower())]
    return found[0] if len(found) == 1 else None


def plan_from_names(names: tuple[str, ...]) -> ColumnPlan | None:
    """Return the plan that the names of the columns tell, or None if they tell of no whole triad.

    Of a role that several columns claim, the first column has it; an acceleration whose name says that gravity was
    taken out comes last.

    Raises
    ------
    RecordingError
        If the names declare different units for the axes of one triad.
    """
    slots = _slots(names)
    triads = {
        kind: tuple((slots[kind + axis][0], 1.0) for axis in AXES)
        for kind in "agm"
        if all(kind + axis in slots for axis in AXES)
    }
    if not triads:
        return None
    time, temperature = (slots[name][0] if name in slots else None for name in ("t", "temperature"))
    said = {kind: _declared_unit(slots, kind) for kind in "agm"}
    if time is not None:
        plain = "s" if names[time].lower() in ("sec", "secs", "seconds") else None
        said["t"] = find_unit("time", slots["t"][1] or "") or plain
    if temperature is not None:
        said["temperature"] = temperature_unit_in(names[temperature])
    return ColumnPlan(
        time,
        triads,
        temperature,
        {kind: unit for kind, unit in said.items() if unit is not None},
        unknown_units=_unknown_units(slots, names),
        magnetic_field_time=next((i for i, name in enumerate(names) if name == _FIELD_STAMPS), None),
    )


def parts_of_triads(names: tuple[str, ...]) -> dict[str, dict[str, str]]:
    """Return the axes that names have of a triad and the names, where one or two of its three are missing.

    Examples
    --------
    >>> parts_of_triads(("t", "ax", "ay", "gx", "gy", "gz"))
    {'a': {'x': 'ax', 'y': 'ay'}}
    """
    slots = _slots(names)
    found = {
        kind: {axis: names[slots[kind + axis][0]] for axis in AXES if kind + axis in slots} for kind in "agm"
    }
    return {kind: axes for kind, axes in found.items() if 0 < len(axes) < len(AXES)}


def says_free_of_gravity(name: str) -> bool:
    """Say whether a column's name is one of accelerations that gravity may have been taken out of.

    ROS calls the specific force itself a linear acceleration, Android what is left without gravity.

    Examples
    --------
    >>> says_free_of_gravity("userAcceleration.x"), says_free_of_gravity("acc_x")
    (True, False)
    """
    return not _WORDS["free of gravity"].isdisjoint(_words(_unit_in(name)[0]))


def _slots(names: tuple[str, ...]) -> dict[str, tuple[int, str | None]]:
    """Return which column has which role, and the unit in its name."""
    slots: dict[str, tuple[int, str | None]] = {}
    spare: dict[str, tuple[int, str | None]] = {}
    for i, name in enumerate(names):
        found = role_of(name)
        if found is not None:
            free = found[0][0] == "a" and says_free_of_gravity(name)
            (spare if free else slots).setdefault(found[0], (i, found[1]))
    if spare and not all("a" + axis in slots for axis in AXES):
        slots = {role: slot for role, slot in slots.items() if role[0] != "a"} | spare
    return slots


def _unknown_units(
    slots: dict[str, tuple[int, str | None]], names: tuple[str, ...]
) -> tuple[tuple[str, str, str], ...]:
    """Return the units in the names that are none of their quantity."""
    unknown: list[tuple[str, str, str]] = []
    for slot, (index, unit) in slots.items():
        quantity = QUANTITY.get(slot[0] if slot != "temperature" else slot)
        if unit is None or quantity is None:
            continue
        if not any(find_unit(q, unit) for q in (quantity, _INCREMENT.get(quantity, quantity))):
            unknown.append((quantity, names[index], unit))
    return tuple(unknown)


def _declared_unit(slots: dict[str, tuple[int, str | None]], kind: str) -> str | None:
    quantity = QUANTITY[kind]
    units = {slots[kind + axis][1] for axis in AXES if kind + axis in slots} - {None}
    known = {
        find_unit(quantity, u) or find_unit(_INCREMENT.get(quantity, quantity), u) for u in units if u
    } - {None}
    if len(known) > 1:
        raise RecordingError(
            f"The header gives different units of {quantity} to one triad "
            f"({', '.join(sorted(str(u) for u in known))}); state one with --units."
        )
    return known.pop() if known else None


SENSOR = {"a": "accelerometer", "g": "gyro", "m": "magnetometer"}
"""What a triad is of, by its letter."""
QUANTITY = {
    "a": "specific force",
    "g": "angular rate",
    "m": "magnetic field",
    "t": "time",
    "temperature": "temperature",
}
_INCREMENT = {"specific force": "velocity increment", "angular rate": "angle increment"}


EARTH_FIELD = (22e-6, 67e-6)
"""The least and the greatest field at the Earth's surface, T."""

_FIELD_MARGIN = 1.05  # a local anomaly, and an uncalibrated scale
_GRAVITY_TOLERANCE = 0.15  # of the norm: an uncalibrated MEMS is off by a few per cent
_MOST_OFFSET = 0.25  # of gravity, that the bias of an accelerometer has
_BLOCK_SECONDS = 0.4
_LEAST_BLOCK = 12
_TURNS = (0.25, 2.5)  # rad in a block: it turns, and its norm can still be followed
_FEWEST = 5  # blocks that turn, and that rest
_SHAKEN = (0.012, 4.0)  # scatter of the norm while turning: of the norm, and of that at rest
_STEADY_NORM = (0.03, 2.0)
_FEWEST_DIRECTIONS = 4
_SPHERE_DIRECTIONS = 9
_CONSTANT = 0.12  # of the norm: its scatter over directions
_PARTS = 4  # of a block, whose means are points of the sphere
_ALWAYS = (0.05, 0.95)
_AROUND = (0.5, 2.0)  # of the norm, in which a vector stays all these times
_THINNED = 6000  # points whose directions are compared


@dataclass(frozen=True)
class VectorSigns:
    """What shows whether a triad sees gravity, the Earth's field or neither.

    Attributes
    ----------
    norm : of the vector, raw: the radius of the sphere on which the directions lie, or the middle norm.
    offset : of the sphere's centre from zero, in radii; 0 where no sphere is determined.
    is_vector : whether the norm is the same in every direction; None where too few directions were taken.
    motion : "shaken" if motion changes the norm, "steady" if it does not, None where nothing shows it.
    whole : whether the numbers are whole.
    """

    norm: float
    offset: float
    is_vector: bool | None
    motion: Literal["steady", "shaken"] | None
    whole: bool

    def gravity_unit(self, declared: str | None = None) -> str | None:
        """Return the unit in which the norm is that of gravity: the declared one, or m/s², g or mg; else None."""
        if self.offset > _MOST_OFFSET:
            return None
        for unit in ("m/s^2", "g", "mg") if declared is None else (declared,):
            factor = specific_force_factor(unit)
            if factor is not None and abs(self.norm * factor / STANDARD_GRAVITY - 1.0) < _GRAVITY_TOLERANCE:
                return unit
        return None

    @property
    def field_unit(self) -> str | None:
        """The unit in which the norm is the Earth's field, or None."""
        return field_unit_of(self.norm)


def field_unit_of(norm: float) -> str | None:
    """Return the unit in which a norm is that of the Earth's field, or None; counts are none.

    Examples
    --------
    >>> field_unit_of(49.2), field_unit_of(0.48), field_unit_of(480.0), field_unit_of(9.81)
    ('uT', 'gauss', 'mgauss', None)
    """
    for unit in known_units("magnetic field"):
        factor = magnetic_field_factor(unit)
        if factor is not None and is_earth_field(norm * factor):
            return unit
    return None


def is_earth_field(norm: float) -> bool:
    """Say whether a norm in T can be that of the Earth's field."""
    return EARTH_FIELD[0] / _FIELD_MARGIN < norm < EARTH_FIELD[1] * _FIELD_MARGIN


def whole_numbers(values: Vectors) -> bool:
    """Say whether all values are whole numbers (of a long recording, those at its beginning)."""
    head = values[:50_000]
    return bool(np.all(head == np.round(head)))


def vector_signs(values: Vectors, rate: float) -> VectorSigns:
    """Return what a triad's numbers show of its kind, of a long recording a dozen pieces of it.

    Parameters
    ----------
    values : (samples, 3) raw, finite.
    rate : Hz, roughly.
    """
    size = max(_LEAST_BLOCK, round(_BLOCK_SECONDS * rate))
    pieces = [values[cut] for cut in sample_pieces(values.shape[0])]
    blocks = np.concatenate([p[: len(p) // size * size].reshape(-1, size, 3) for p in pieces])
    whole = whole_numbers(values)
    if len(blocks) < _FEWEST:
        norm = float(np.median(np.linalg.norm(values, axis=1))) if len(values) else 0.0
        return VectorSigns(norm, 0.0, None, None, whole)
    # Parts of a block, so that a turn of a second passes through several directions.
    parts = blocks[:, : size // _PARTS * _PARTS].reshape(-1, 3)
    parts = block_means(parts, size // _PARTS)
    centre, norms = _sphere(parts)
    norm = float(np.median(norms))
    offset = float(np.linalg.norm(centre)) / norm if norm > 0.0 else 0.0
    constant = None
    if norms.size >= _FEWEST_DIRECTIONS:
        scatter = 1.4826 * float(np.median(np.abs(norms - norm)))
        # A gyro may reach one rate in every direction, but it is at its bias while the unit rests.
        low, high = np.quantile(np.linalg.norm(parts - centre, axis=1), _ALWAYS)
        always = low > _AROUND[0] * norm and high < _AROUND[1] * norm
        constant = bool(norm > 0.0 and scatter < _CONSTANT * norm and always)
    return VectorSigns(norm, offset, constant, _motion(blocks - centre, norm) if constant else None, whole)


def _sphere(means: Vectors) -> tuple[Vector, Series]:
    """Return the centre of the sphere that means lie on, and the norms about it, one a direction.

    Zero is the centre where too few directions determine it, or the means lie on no sphere.
    """
    thinned = means[:: max(1, len(means) // _THINNED)]
    around_zero = np.linalg.norm(one_a_direction(thinned), axis=1)
    fitted = fit_sphere(thinned)
    if fitted is None:
        return np.zeros(3), around_zero
    kept = one_a_direction(thinned - fitted[0])
    again = fit_sphere(kept + fitted[0])
    if again is None or len(one_a_direction(kept)) < _SPHERE_DIRECTIONS:
        return np.zeros(3), around_zero
    norms = np.linalg.norm(one_a_direction(thinned - again[0]), axis=1)
    best = _relative_scatter(around_zero) if around_zero.size >= _FEWEST_DIRECTIONS else np.inf
    if _relative_scatter(norms) > min(_CONSTANT, best):
        return np.zeros(3), around_zero
    return again[0], norms


def _relative_scatter(norms: Series) -> float:
    middle = float(np.median(norms))
    return 1.4826 * float(np.median(np.abs(norms - middle))) / middle if middle > 0.0 else np.inf


def _motion(blocks: AnyArray, norm: float) -> Literal["steady", "shaken"] | None:
    """Compare the scatter of the norm within blocks that turn with that of blocks that do not."""
    norms = np.linalg.norm(blocks, axis=2)
    size = norms.shape[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.einsum("bi,bi->b", blocks[:, 0], blocks[:, -1]) / (norms[:, 0] * norms[:, -1])
    turned = np.nan_to_num(np.arccos(np.clip(cosine, -1.0, 1.0)), nan=np.pi)
    # What turning about a wrong centre does to the norm is smooth: a parabola takes it out.
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, size), 3))
    rest = norms - (norms @ basis) @ basis.T
    scatter = np.sqrt((rest**2).sum(axis=1) / (size - 3))
    moving = (turned > _TURNS[0]) & (turned < _TURNS[1])
    still = turned <= np.quantile(turned, 0.2)
    if int(moving.sum()) < _FEWEST or int(still.sum()) < _FEWEST or bool(np.any(moving & still)):
        return None
    while_turning = float(np.median(scatter[moving]))
    steps = min(smallest_step(blocks[:, 0, i]) for i in range(3)) / np.sqrt(12.0)
    at_rest = max(float(np.median(scatter[still])), steps, 1e-12 * norm)
    if while_turning > _SHAKEN[0] * norm and while_turning > _SHAKEN[1] * at_rest:
        return "shaken"
    if while_turning < _STEADY_NORM[0] * norm and while_turning < _STEADY_NORM[1] * at_rest:
        return "steady"
    return None


_STEADY = 0.99  # share of steps that go up in a column of time
_GUESS_RATE = 100.0  # Hz, only to choose the length of blocks when the rate is not known yet


def is_time_like(column: Series) -> bool:
    """Say whether a column goes up steadily, as stamps do."""
    if column.size < 3 or not np.all(np.isfinite(column[[0, -1]])):
        return False
    steps: Series = np.diff(column[:200_000])
    up = np.count_nonzero(steps > 0.0)
    if up < _STEADY * np.count_nonzero(steps) or 2 * up <= steps.size:
        return False
    middle = float(np.median(steps))
    return middle > 0.0 and bool(np.mean(steps < 10.0 * middle) > 0.9)


def triad_alone(columns: list[Series]) -> ColumnPlan | None:
    """Return the plan of three columns, or of four of which the first or the last is time; None of others."""
    time = next((i for i in (0, 3) if len(columns) == 4 and is_time_like(columns[i])), None)
    values = tuple((i, 1.0) for i in range(len(columns)) if i != time)
    return ColumnPlan(time, {"a": values}, said_by="content") if len(values) == 3 else None


@dataclass(frozen=True)
class TriadOrder:
    """Which of two triads is the accelerometer: `swapped` if the second; `sure` if the content shows it."""

    swapped: bool
    sure: bool
    reason: str


def find_accelerometer(
    first: Vectors, second: Vectors, rate: float = _GUESS_RATE, quiet: QuietStretches | None = None
) -> TriadOrder:
    """Find out which of two triads is the accelerometer, whatever units and offsets they have.

    Over several poses the rest levels of an accelerometer spread over much of its range, those of a gyro
    are all its bias. With one pose only, the level at rest of an accelerometer is large against its
    scatter, that of a gyro small; offset counts then leave it undecided and the first is taken.

    Parameters
    ----------
    first, second : (samples, 3) raw.
    rate : samples a second.
    quiet : the stretches at rest of both, where they are known already.
    """
    cuts = sample_pieces(first.shape[0])
    signals = np.concatenate([np.hstack([first[c], second[c]]) for c in cuts])
    quiet = find_quiet_stretches(signals, rate) if quiet is None else quiet
    ordered = np.sort(signals[:: max(1, len(signals) // 20_000)], axis=0)
    low, high = (ordered[int(share * len(ordered))] for share in (0.005, 0.995))
    ranges = [float(np.linalg.norm(half)) / 2.0 + 1e-300 for half in np.split(high - low, 2)]
    if len(quiet) >= 3:
        spread = [float(np.linalg.norm(np.ptp(m, axis=0))) / 2.0 for m in np.split(quiet.means, 2, axis=1)]
        share = [s / r for s, r in zip(spread, ranges, strict=True)]
        big, small = max(share), min(share)
        if big > 0.2 and big > 4.0 * small:
            if _is_on_a_table(np.split(quiet.means, 2, axis=1), ranges, int(np.argmax(share))):
                return TriadOrder(share[1] < share[0], False, "the other triad's levels differ in their norm")
            return TriadOrder(
                share[1] > share[0], True, "its levels at rest differ, those of the other triad do not"
            )
    level = quiet.means.mean(axis=0) if len(quiet) else signals.mean(axis=0)
    sizes = [float(np.linalg.norm(v)) for v in np.split(level, 2)]
    ratio = [s / r for s, r in zip(sizes, ranges, strict=True)]
    big, small = max(ratio), min(ratio)
    if big > 0.7 and big > 4.0 * small:
        # On a turning table both are steady and far from zero: then it is a guess, and no proof.
        sure = small < 3.0
        return TriadOrder(ratio[1] > ratio[0], sure, "its norm at rest is steady and far from zero")
    return TriadOrder(False, False, "nothing in the numbers distinguishes the triads, so the first is taken")


def _is_on_a_table(means: list[Vectors], ranges: list[float], spread: int) -> bool:
    """Whether the triad whose levels differ is a gyro's: now at rest, now turning, while the other stays.

    An accelerometer's levels have one norm; a gyro's on a table that turns about the vertical have not, and
    the accelerometer beside it is steady and far from zero.
    """
    norms = np.linalg.norm(means[spread], axis=1)
    other = float(np.linalg.norm(means[1 - spread].mean(axis=0))) / ranges[1 - spread]
    return bool(norms.min() < 0.5 * norms.max()) and other > 3.0


def plan_from_content(
    columns: list[Series], name: str, said: DeclaredUnits | None = None, rate: float | None = None
) -> tuple[ColumnPlan, list[Remark]]:
    """Find the columns of a table without names: time by its steady growth, the triads by what they see.

    The triads are three columns side by side, the first two or three such groups after time is set aside; a single
    column that follows them is temperature if it could be. Which triad is the accelerometer, which the gyro and which
    the magnetometer, `tumble.recording.columns` shows.

    Parameters
    ----------
    columns, name : of the table.
    said, rate : units that the user declares, and Hz that the user or the table does.

    Raises
    ------
    RecordingError
        If there are not three or at least six columns of values, or the numbers leave open which is which.
    """
    said = said or DeclaredUnits()
    time, values = _time_and_values(columns, name)
    groups = [tuple((i, 1.0) for i in values[s : s + 3]) for s in (0, 3, 6) if len(values) >= s + 3]
    cuts = sample_pieces(columns[0].size)
    triads = [_finite([np.concatenate([columns[i][c] for c in cuts]) for i, _ in g]) for g in groups]
    signs = [vector_signs(triad, _rough_rate(columns, time, rate or _GUESS_RATE)) for triad in triads]
    if len(groups) == 1:
        return _plan_of_one(ColumnPlan(time, {"a": groups[0]}, said_by="content"), signs[0], name, said)
    places, reason = _roles(columns, groups, signs, name, said)
    plan = ColumnPlan(time, {kind: groups[place] for kind, place in places.items()}, said_by="content")
    used = max(places.values())
    after = values[3 * used + 3 :]
    if len(after) == 1 and _could_be_temperature(columns[after[0]]):
        plan, after = replace(plan, temperature=after[0]), []
    remarks = [Remark("assumed", _column_words(plan, reason, name, len(columns)))]
    if "m" not in places:
        plan, more = _not_a_magnetometer(plan, signs[places["a"]], name, said)
        remarks = [*(remarks if "a" in plan.triads else []), *more]
    if after:
        which = "two triads" if used == 1 else "triads"
        remarks.append(Remark("found", f"{name}: the columns after the {which} are not used."))
    return plan, remarks


def _time_and_values(columns: list[Series], name: str) -> tuple[int | None, list[int]]:
    """Return which column is time, and which hold values."""
    times = [i for i, c in enumerate(columns) if is_time_like(c)]
    outer = [i for i in times if i in (0, len(columns) - 1)]
    time = outer[0] if outer else (times[0] if times else None)
    if time is None and len(columns) == 7 and float(np.ptp(columns[0])) == 0.0:
        time = 0  # a clock that stands still: said so when the stamps are put in order
    values = [
        i
        for i in range(len(columns))
        if i != time and not (i in times and len(columns) - len(times) in (3, 6, 9))
    ]
    if len(values) < 3 or 3 < len(values) < 6:
        raise RecordingError(
            f"{name} has {len(columns)} column(s), "
            f"{'one of them time' if time is not None else 'none of them time'}; a recording needs three (one triad) "
            "or six (both) beside the time. Say which is which with --columns."
        )
    return time, values


def _finite(columns: list[Series]) -> Vectors:
    triad = np.column_stack(columns)
    finite = np.isfinite(triad).all(axis=1)
    return triad if finite.all() else triad[finite]


def _rough_rate(columns: list[Series], time: int | None, stated: float) -> float:
    """The rate to a few per cent by the stamps, else as it is stated."""
    if time is None or columns[time].size < 3:
        return stated
    steps = np.diff(columns[time][:200_000])
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    return 1.0 / (step * time_factor(guess_time_unit(step))) if step > 0.0 else stated


# -- which triad is which ----------------------------------------------------------------------------


def _roles(
    columns: list[Series], groups: list[Axes], signs: list[VectorSigns], name: str, said: DeclaredUnits
) -> tuple[dict[str, int], str]:
    """Tell the triads apart: two that keep their norm are accelerometer and magnetometer, the other is the gyro.

    Returned is which of the groups each triad is, by its letter, and why.
    """
    cuts = sample_pieces(columns[0].size)
    rows = np.column_stack([np.concatenate([columns[i][c] for c in cuts]) for g in groups[:2] for i, _ in g])
    rows = rows[np.isfinite(rows).all(axis=1)]
    order = find_accelerometer(rows[:, :3], rows[:, 3:])
    vectors = [i for i, one in enumerate(signs) if one.is_vector]
    if len(vectors) == 2:
        force, reason = _accelerometer_of(vectors, signs, groups, name, said)
        places = {"a": force, "m": sum(vectors) - force}
        if len(groups) == 3:
            places["g"] = 3 - sum(vectors)
        return places, reason
    if len(groups) == 3 and not vectors and (static := _static_roles(signs, said)) is not None:
        return static
    return {"a": int(order.swapped), "g": 1 - int(order.swapped)}, order.reason


def _accelerometer_of(
    pair: list[int], signs: list[VectorSigns], groups: list[Axes], name: str, said: DeclaredUnits
) -> tuple[int, str]:
    """Return which of two triads that keep their norm is the accelerometer, and why."""
    shaken = [i for i in pair if signs[i].motion == "shaken"]
    if len(shaken) == 1 and signs[sum(pair) - shaken[0]].motion == "steady":
        return shaken[0], "motion changes its norm, and does not change that of the magnetometer"
    heavy = [i for i in pair if signs[i].gravity_unit(said.specific_force) is not None]
    if len(heavy) == 1:
        unit = signs[heavy[0]].gravity_unit(said.specific_force)
        return heavy[0], f"its norm is gravity in {unit}, that of the magnetometer is not"
    levels = " and ".join(f"{_numbers(groups[i])} (norm {signs[i].norm:.4g})" for i in pair)
    raise RecordingError(
        f"{name} names no columns, and both columns {levels} hold a vector that keeps its norm while the unit turns. "
        "One is the accelerometer and the other the magnetometer; nothing in the numbers shows which. Say so with "
        "--columns, for example t,mx,my,mz,ax,ay,az,gx,gy,gz."
    )


def _static_roles(signs: list[VectorSigns], said: DeclaredUnits) -> tuple[dict[str, int], str] | None:
    """Of three triads that do not turn, the accelerometer is the only one with the norm of gravity; None if none is."""
    heavy = [i for i, one in enumerate(signs) if one.gravity_unit(said.specific_force) is not None]
    magnetic = [i for i, one in enumerate(signs) if i not in heavy and one.field_unit is not None]
    if len(heavy) != 1 or len(magnetic) != 1:
        return None
    places = {"a": heavy[0], "g": 3 - heavy[0] - magnetic[0], "m": magnetic[0]}
    unit = signs[heavy[0]].gravity_unit(said.specific_force)
    return places, f"it alone has the norm of gravity, in {unit}"


def _plan_of_one(
    plan: ColumnPlan, signs: VectorSigns, name: str, said: DeclaredUnits
) -> tuple[ColumnPlan, list[Remark]]:
    """Return the plan of a table with one triad: what the file's name says, else what the numbers show."""
    kind = kind_of_file(name)
    if kind == "g":
        return plan.swapped(), [Remark("found", f"{name}: its one triad is the gyro, its name says.")]
    if kind == "m" or (said.magnetic_field is not None and not said.of_accelerometer):
        who = "its name says" if kind == "m" else "--units says"
        return plan.renamed(a="m"), [Remark("found", f"{name}: its one triad is the magnetometer, {who}.")]
    found, more = _not_a_magnetometer(plan, signs, name, said)
    if "a" not in found.triads:
        return found, more
    return found, [Remark("assumed", f"{name}: its one triad is taken as the accelerometer."), *more]


def _not_a_magnetometer(
    plan: ColumnPlan, signs: VectorSigns, name: str, said: DeclaredUnits
) -> tuple[ColumnPlan, list[Remark]]:
    """Take the only triad that keeps its norm as the magnetometer where its numbers show one, doubt it in between."""
    if said.of_accelerometer or "a" not in plan.triads or signs.motion == "shaken":
        return plan, []
    which = f"{name}: columns {_numbers(plan.triads['a'])}"
    gravity, field = signs.gravity_unit(), signs.field_unit
    steady = signs.motion == "steady"
    if steady and gravity is None and field is not None and not signs.whole:
        text = (
            f"{which} are taken as the magnetometer: their norm of {signs.norm:.4g} is the Earth's field in {field} "
            "and gravity in no unit, and motion does not change it. If they are the accelerometer, say so with "
            "--columns (t,ax,ay,az,gx,gy,gz)."
        )
        return plan.renamed(a="m"), [Remark("assumed", text)]
    if gravity is None and field is not None and (steady or not signs.whole) and signs.is_vector is not False:
        raise RecordingError(
            f"{which} have a norm of {signs.norm:.4g}, which is gravity in none of m/s², g and mg, but the Earth's "
            f"field in {field}. If they are a magnetometer, say so with --columns t,mx,my,mz; if they are the "
            "accelerometer, with --columns t,ax,ay,az and --units."
        )
    if steady:
        text = (
            f"{which} are taken as the accelerometer, but no motion changes their norm of {signs.norm:.4g}, as none "
            "changes a magnetometer's. An accelerometer is so on a table that turns smoothly, hardly in a hand. Say "
            "which it is with --columns (ax,ay,az or mx,my,mz)."
        )
        return plan, [Remark("doubtful", text)]
    return plan, []


def _numbers(triad: Axes) -> str:
    return f"{triad[0][0] + 1}-{triad[-1][0] + 1}"


def _column_words(plan: ColumnPlan, reason: str, name: str, count: int) -> str:
    time = (
        "no column is time"
        if plan.time is None
        else f"column {plan.time + 1} of {count} is time (it grows steadily)"
    )
    parts = [f"columns {_numbers(plan.triads['a'])} are taken as the accelerometer ({reason})"]
    parts += [f"columns {_numbers(plan.triads[k])} as the {SENSOR[k]}" for k in "gm" if k in plan.triads]
    return f"{name} names no columns: {time}, {', '.join(parts)}."


def _could_be_temperature(column: Series) -> bool:
    low, high = float(np.nanmin(column)), float(np.nanmax(column))
    return low > -60.0 and high < 130.0 and high - low < 80.0 and high != 0.0


_STAMP_TOLERANCE = 0.02  # of a step: stamps written with different rounding still agree


def _own_plan(table: RawTable) -> ColumnPlan | None:
    """Return the plan of a table with one triad, which is called the accelerometer's where no name says; else None."""
    plan = None if table.names is None else plan_from_names(table.names)
    if plan is None:
        return triad_alone(table.columns)
    return plan if len({*plan.triads} - {"m"}) == 1 else None


def _lone_triad(plan: ColumnPlan) -> Axes:
    return next(plan.triads[kind] for kind in "ag" if kind in plan.triads)


def is_pair(tables: list[RawTable]) -> bool:
    """Say whether two tables have one triad each."""
    return len(tables) == 2 and all(_own_plan(t) is not None for t in tables)


@dataclass(frozen=True)
class Pairing:
    """How two tables become one: what each has, and what the merged columns are.

    The merged table has time first (if either file has it), then the first file's three values, then
    the second's.
    """

    plans: tuple[ColumnPlan, ColumnPlan]
    plan: ColumnPlan
    remarks: tuple[Remark, ...] = ()


def find_pairing(first: RawTable, second: RawTable, columns: str | None = None) -> Pairing:
    """Find out which columns and which file is what.

    The names of columns or files decide which is the accelerometer, otherwise the content.

    Parameters
    ----------
    first, second : tables of one triad each.
    columns : the option ``--columns``, the two files' lists separated by ``;``, or None.

    Raises
    ------
    RecordingError
        If the files differ in length or in their stamps.
    UsageError
        If `columns` does not give one triad to each file.
    """
    own, other = (
        _plans_by_option(first, second, columns) if columns is not None else map(_own_plan, (first, second))
    )
    assert own is not None  # as `is_pair` says
    assert other is not None
    start = 0 if own.time is None and other.time is None else 1
    triads = {
        kind: tuple((start + 3 * n + i, sign) for i, (_, sign) in enumerate(_lone_triad(one)))
        for n, (kind, one) in enumerate((("a", own), ("g", other)))
    }
    by = "header" if other.said_by == "header" else own.said_by
    units = {kind: unit for kind, unit in (other.units | own.units).items() if kind in "tag"}
    plan = ColumnPlan(0 if start else None, triads, units=units, said_by=by, of_pair=True)
    pairing = Pairing((own, other), plan)
    if columns is not None:
        return pairing if "a" in own.triads else replace(pairing, plan=plan.swapped())
    swapped, remark = _which(first, second, pairing)
    return replace(pairing, plan=plan.swapped() if swapped else plan, remarks=(remark,))


def _plans_by_option(first: RawTable, second: RawTable, columns: str) -> list[ColumnPlan]:
    halves = columns.split(";")
    if len(halves) != 2:
        raise UsageError(
            "--columns for a pair of files is two lists with ; between, as t,ax,ay,az;t,gx,gy,gz."
        )
    plans = [
        plan_from_option(h, len(t.columns), t.path.name) for h, t in zip(halves, (first, second), strict=True)
    ]
    if sorted("".join(kind for kind in "ag" if kind in plan.triads) for plan in plans) != ["a", "g"]:
        raise UsageError("--columns for a pair of files gives ax,ay,az to one and gx,gy,gz to the other.")
    return plans


def merge_pair(first: RawTable, second: RawTable, pairing: Pairing) -> RawTable:
    """Put two tables side by side as `pairing` says.

    Raises
    ------
    RecordingError
        If the files differ in length or in their stamps.
    """
    if len(first) != len(second):
        raise RecordingError(
            f"{first.path.name} has {len(first)} rows and {second.path.name} has {len(second)}: the two triads need "
            "the same stamps. Cut or interpolate one of them onto the stamps of the other; of a phone's log name "
            "the folder, whose sensors are put on one clock."
        )
    own, other = pairing.plans
    if own.time is not None and other.time is not None:
        _check_stamps(first, own.time, second, other.time)
    both = ((first, own), (second, other))
    stamps = [table.columns[plan.time] for table, plan in both if plan.time is not None]
    return replace(
        first,
        names=None,
        columns=[*stamps[:1], *(table.columns[i] for table, plan in both for i, _ in _lone_triad(plan))],
        remarks=[*first.remarks, *second.remarks],
        rate=first.rate or second.rate,
        judged=False,
        field=None,
    )


def _check_stamps(first: RawTable, time: int, second: RawTable, other_time: int) -> None:
    a, b = first.columns[time], second.columns[other_time]
    step = abs(float(np.nanmedian(np.diff(a)))) if a.size > 1 else 0.0
    apart = np.flatnonzero(np.abs(a - b) > _STAMP_TOLERANCE * step)
    if apart.size:
        row = int(apart[0])
        raise RecordingError(
            f"{first.path.name} and {second.path.name} have different stamps from {first.place(row)} on "
            f"({a[row]:.9g} and {b[row]:.9g}). Interpolate one onto the stamps of the other, or give one file with "
            "both. Of a phone's log give the folder, whose sensors are put on one clock."
        )


def _named_kind(table: RawTable, plan: ColumnPlan) -> str | None:
    """Return "a" or "g" from the names of the columns or of the file."""
    if plan.said_by == "header":
        return "a" if "a" in plan.triads else "g"
    return kind_of_file(table.path.name)


def _which(first: RawTable, second: RawTable, pairing: Pairing) -> tuple[bool, Remark]:
    """Return whether the first file is the gyro, and the sentence that says so."""
    merged = merge_pair(first, second, pairing)
    kinds = [_named_kind(table, plan) for table, plan in zip((first, second), pairing.plans, strict=True)]
    names = (first.path.name, second.path.name)
    named = kinds[0] != kinds[1] and set(kinds) <= {"a", "g", None}
    if named:
        swapped, reason = kinds[0] == "g" or kinds[1] == "a", "their names say so"
    else:
        rows = np.column_stack(merged.columns[-6:])
        rows = rows[np.isfinite(rows).all(axis=1)]
        order = find_accelerometer(rows[:, :3], rows[:, 3:])
        swapped, reason = order.swapped, order.reason
    force, rates = (names[1], names[0]) if swapped else names
    text = f"{force} is taken as the accelerometer and {rates} as the gyro: {reason}."
    return swapped, Remark("found" if named else "assumed", text)
