"""What the columns of a table are: from the user's list, from their names, or from their content."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from tumble.errors import RecordingError, UsageError
from tumble.records import dataclass
from tumble.units import find_unit

AXES = "xyz"
_SLOTS = ("t", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz", "temperature")

# Spellings without axis, separators and capitals, one kind a text.
_SPELLINGS = {
    "accelerometer": """
        a ac acc acce accel accelero accelerometer accelerometers acceleration accelerations
        linearacceleration linearacc linacc specificforce f fb fib sf force imuacc accdata""",
    "gyro": """
        g gy gyr gyro gyros gyroscope gyroscopes w om omega omg angularvelocity angularrate angvel angrate
        rotationrate rotrate rate wib wb avel angular omegaib""",
    "magnetometer": """
        m mf mag magn magnet magneto magnetometer magnetometers magnetic magnetics magneticfield magfield magnetfield
        magneticfluxdensity magneticinduction bfield compass imumag magdata""",
    "time": """
        t time times timestamp timestamps stamp stamps tick ticks sec secs seconds timesec timestampsec
        timesample headerstamp tow gpstime elapsed elapsedtime systemtime timestampsample secondselapsed
        hosttime devicetime utc datetime""",
    "temperature": "temp temperature tmp temps temperatures imutemp imutemperature tempc degc",
    "filler": """
        imu sensor data raw value values cal uncal uncalibrated calibrated b body rs s meas msg axis lin 0 ib
        m rad deg""",
}
_ACCELEROMETER, _GYRO, _MAGNETOMETER, _TIME, _TEMPERATURE, _FILLERS = (
    frozenset(t.split()) for t in _SPELLINGS.values()
)
_KNOWN = (("a", _ACCELEROMETER), ("g", _GYRO), ("m", _MAGNETOMETER))
_UNIT_SUFFIX = re.compile(
    r"[_ ](m[_/]?s\^?2|mps2|mg|g|rads|rad_s|radps|mdps|dps|deg_s|degps|s|sec|ms|us|ns|usec|nsec|msec"
    r"|[uµμnm]t|tesla|m?gauss)$",
    re.IGNORECASE,
)
_ACCELEROMETER_FILE = re.compile(r"(?<![a-z])(acc|accel|acce|accelerometer|acceleration|force|acel)(?![a-z])")
_MAGNETOMETER_FILE = re.compile(r"(?<![a-z])(mag|magn|magneto|magnetometer|magnetic|compass)(?![a-z])")
_GYRO_FILE = re.compile(r"(?<![a-z])(gyr|gyro|gyros|gyroscope|omega|angular|angrate|rate|ars)(?![a-z])")
_FREE = frozenset(("user", "linear", "lin", "free", "dynamic", "linearacc", "linacc", "freeacc"))
_FIELD_STAMPS = "mag_time [s]"  # as tumble writes it; see `tumble.recording.formats.output`
_BRACKETS = re.compile(r"[\[(]([^\])]*)[\])]")


@dataclass(frozen=True, slots=True)
class ColumnPlan:
    """Which column is what.

    Attributes
    ----------
    time, temperature : indices of the columns, or None.
    specific_force, angular_rate, magnetic_field : three (index, sign) each, or None.
    time_unit, specific_force_unit, angular_rate_unit, magnetic_field_unit, temperature_unit : as declared in the
        names, or None.
    magnetic_field_time : index of the column of the magnetometer's own stamps, s, or None.
    said_by : "option", "header" or "content": who says so.
    unknown_units : quantity, name of a column, and the unit in it that nobody knows.
    """

    time: int | None = None
    specific_force: tuple[tuple[int, float], ...] | None = None
    angular_rate: tuple[tuple[int, float], ...] | None = None
    temperature: int | None = None
    time_unit: str | None = None
    specific_force_unit: str | None = None
    angular_rate_unit: str | None = None
    temperature_unit: str | None = None
    said_by: str = "header"
    unknown_units: tuple[tuple[str, str, str], ...] = ()
    magnetic_field: tuple[tuple[int, float], ...] | None = None
    magnetic_field_unit: str | None = None
    magnetic_field_time: int | None = None

    def swapped(self) -> ColumnPlan:
        """Return the plan with the two triads exchanged."""
        return replace(self, specific_force=self.angular_rate, angular_rate=self.specific_force)


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
    return ColumnPlan(
        time=slots["t"][0] if "t" in slots else None,
        specific_force=_complete(triads["a"]),
        angular_rate=_complete(triads["g"]),
        temperature=slots["temperature"][0] if "temperature" in slots else None,
        said_by="option",
        magnetic_field=_complete(triads["m"]),
    )


def option_of(plan: ColumnPlan, count: int) -> str:
    """Return what ``--columns`` would have to be for a plan.

    Parameters
    ----------
    plan : which column is what.
    count : number of columns of the file.
    """
    words = ["-"] * count
    for kind, triad in zip("agm", (plan.specific_force, plan.angular_rate, plan.magnetic_field), strict=True):
        for axis, (index, sign) in zip(AXES, triad or (), strict=False):
            words[index] = f"{'-' if sign < 0.0 else ''}{kind}{axis}"
    for name, index in (("t", plan.time), ("temperature", plan.temperature)):
        if index is not None:
            words[index] = name
    return ",".join(words)


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


def _complete(found: list[tuple[int, float] | None]) -> tuple[tuple[int, float], ...] | None:
    filled = [f for f in found if f is not None]
    return tuple(filled) if len(filled) == 3 else None


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
    return joined in _TIME or (
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
    if "".join(words) in _TEMPERATURE or words[0] in {"temp", "temperature"}:
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
    kept = [w for w in words if w and w not in _FILLERS]
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
    named = (("a", _ACCELEROMETER_FILE), ("g", _GYRO_FILE), ("m", _MAGNETOMETER_FILE))
    found = [kind for kind, pattern in named if pattern.search(name.lower())]
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
    force, rate, field = (_triad(slots, kind) for kind in "agm")
    if force is None and rate is None and field is None:
        return None
    time = slots.get("t")
    unit = None if time is None or time[1] is None else find_unit("time", time[1])
    if unit is None and time is not None:
        name = names[time[0]].lower()
        unit = "s" if name in ("sec", "secs", "seconds") else None
    temperature = slots.get("temperature")
    return ColumnPlan(
        time=None if time is None else time[0],
        specific_force=force,
        angular_rate=rate,
        temperature=None if temperature is None else temperature[0],
        time_unit=unit,
        specific_force_unit=_declared_unit(slots, "a", "specific force"),
        angular_rate_unit=_declared_unit(slots, "g", "angular rate"),
        temperature_unit=None if temperature is None else temperature_unit_in(names[temperature[0]]),
        unknown_units=_unknown_units(slots, names),
        magnetic_field=field,
        magnetic_field_unit=_declared_unit(slots, "m", "magnetic field"),
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
    return not _FREE.isdisjoint(_words(_unit_in(name)[0]))


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
        quantity = _QUANTITY.get(slot[0] if slot != "temperature" else slot)
        if unit is None or quantity is None:
            continue
        if not any(find_unit(q, unit) for q in (quantity, _INCREMENT.get(quantity, quantity))):
            unknown.append((quantity, names[index], unit))
    return tuple(unknown)


def _triad(slots: dict[str, tuple[int, str | None]], kind: str) -> tuple[tuple[int, float], ...] | None:
    if not all(kind + axis in slots for axis in AXES):
        return None
    return tuple((slots[kind + axis][0], 1.0) for axis in AXES)


def _declared_unit(slots: dict[str, tuple[int, str | None]], kind: str, quantity: str) -> str | None:
    units = {slots[kind + axis][1] for axis in AXES if kind + axis in slots} - {None}
    known = {
        find_unit(quantity, u) or find_unit(_INCREMENT.get(quantity, quantity), u) for u in units if u
    } - {None}
    if len(known) > 1:
        raise RecordingError(
            f"The header gives different units of {quantity} to one triad "
            f"({', '.join(sorted(str(u) for u in known))}); "
            "state one with --units."
        )
    return known.pop() if known else None


_QUANTITY = {
    "a": "specific force",
    "g": "angular rate",
    "m": "magnetic field",
    "t": "time",
    "temperature": "temperature",
}
_INCREMENT = {"specific force": "velocity increment", "angular rate": "angle increment"}
