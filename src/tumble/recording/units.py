"""Which unit each triad is in: declared by the user or the header and checked, or found from the numbers.

The accelerometer's unit shows by gravity, the gyro's by how gravity turns, the magnetometer's by the Earth's field.
Every guess comes with a sentence; a declaration that the numbers contradict is refused, and so are units that change on
the way, as where two loggers' files were put together. ``chips.yaml`` has the sensitivities of common chips by their
measuring range.

A magnetometer is slower than the triads beside it. Loggers then leave its cells empty in most rows, or repeat the last
sample; a repeated sample is none, and to average it as one would make it seem better known than it is.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Table, Vectors, block_means, extremes
from tumble.errors import RecordingError, UsageError
from tumble.files import read_yaml
from tumble.recording.columns import (
    ColumnPlan,
    DeclaredUnits,
    field_unit_of,
    find_accelerometer,
    is_earth_field,
    renamed,
    says_free_of_gravity,
    vector_signs,
    whole_numbers,
)
from tumble.recording.formats.table import RawTable
from tumble.recording.gravity_check import gyro_scale_from_gravity, gyro_step_words, unit_of_scale
from tumble.recording.recording import Recording
from tumble.recording.rest import QuietStretches, block_statistics, find_quiet_stretches, sample_pieces
from tumble.recording.samples import MagneticField, Remark
from tumble.recording.stamps import Clock
from tumble.records import dataclass
from tumble.units import (
    COUNTS,
    LSB,
    STANDARD_GRAVITY,
    angle_increment_factor,
    angular_rate_factor,
    find_unit,
    known_units,
    magnetic_field_factor,
    specific_force_factor,
    velocity_increment_factor,
)

_Ranges = dict[float, float]


@dataclass(frozen=True)
class Chip:
    """A chip's counts by range.

    Attributes
    ----------
    title : as its maker writes it.
    force : LSB/g by range in g; empty without an accelerometer.
    rate : LSB/(°/s) by range in °/s; empty without a gyro.
    """

    title: str
    force: _Ranges
    rate: _Ranges


def _counts(sheet: dict[str, Any], triad: str) -> _Ranges:
    """Counts by unit; ST states thousandths of it by count."""
    milli: _Ranges = sheet.get(f"{triad}_milli", {})
    return sheet.get(triad) or {full: 1000.0 / one for full, one in milli.items()}


@cache
def chips() -> dict[str, Chip]:
    """Return the known chips by name, in small letters without separators."""
    sheets = read_yaml(Path(__file__).with_name("chips.yaml"))
    return {name: Chip(s["title"], _counts(s, "force"), _counts(s, "rate")) for name, s in sheets.items()}


_RANGE = re.compile(r"[±+]?/?-?([0-9.]+)(g|dps|deg/s|°/s)")


_KINDS = tuple(one.name.replace("_", " ") for one in fields(DeclaredUnits))


def with_chip(words: list[str]) -> list[str]:
    """Return words of ``--units`` with a chip and its ranges, where they begin with one, as units.

    Parameters
    ----------
    words : as ``mpu6050``, ``2g``, ``250dps``, ``ms``.

    Raises
    ------
    UsageError
        If the chip has no such range, or a range is missing that it has several of.

    Examples
    --------
    >>> with_chip(["mpu6050", "4g", "500dps", "ms"])
    ['8192 LSB/g', '65.5 LSB/(deg/s)', 'ms']
    """
    if not words or any(find_unit(kind, words[0]) for kind in _KINDS):
        return words  # without a look at the chips
    chip = chips().get(re.sub(r"[^a-z0-9]", "", words[0].lower()))
    if chip is None:
        return words
    given: dict[str, float] = {}
    others: list[str] = []
    for word in words[1:]:
        match = _RANGE.fullmatch(word.lower())
        if match is not None:
            given["g" if match[2] == "g" else "deg/s"] = float(match[1])
        elif word[:1] in "0123456789±+-":
            raise UsageError(f"--units {words[0]}: {word!r} is no range; give it as 2g or 250dps.")
        else:
            others.append(word)
    parts = [
        _sensitivity(chip, ranges, given.pop(unit, None), unit)
        for ranges, unit in ((chip.force, "g"), (chip.rate, "deg/s"))
        if ranges
    ]
    if given:
        lacking = "accelerometer" if "g" in given else "gyro"
        raise UsageError(f"--units {words[0]}: the {chip.title} has no {lacking}.")
    return [*parts, *others]


def _sensitivity(chip: Chip, ranges: _Ranges, full: float | None, unit: str) -> str:
    word = "g" if unit == "g" else "dps"
    listed = ", ".join(f"{each:g}{word}" for each in ranges)
    if full is None and len(ranges) > 1:
        raise UsageError(
            f"--units {chip.title}: the range that it was set to is missing; give one of {listed}. The driver's "
            "initialisation states it."
        )
    full = next(iter(ranges)) if full is None else full
    if full not in ranges:
        raise UsageError(f"--units {chip.title}: it has no range of {full:g}{word}; it has {listed}.")
    return f"{ranges[full]:.8g} LSB/{unit if unit == 'g' else f'({unit})'}"


def read_units_option(option: str | Sequence[str] | None) -> DeclaredUnits:
    """Return the units that an option such as ``g,deg/s,ms``, ``counts``, ``m/s,rad`` or ``degF`` declares.

    A chip and its ranges, as ``mpu6050,2g,250dps``, are the units of its counts.

    The words may stand in any order, for each says what it is a unit of; ``counts`` (or ``si``) alone stands for every
    triad, as the first word for the accelerometer, as the second for the gyro and as the third for the magnetometer.
    ``G`` and ``mG`` are the accelerometer's g too, and the magnetometer's gauss only after a unit of the accelerometer.

    Raises
    ------
    UsageError
        If a word is not a known unit, two words are units of the same quantity, or a chip has no such range.
    """
    if option is None:
        return DeclaredUnits()
    words = with_chip([w.strip() for w in (option.split(",") if isinstance(option, str) else option)])
    declared = DeclaredUnits()
    for position, word in enumerate(words):
        if not word:
            continue
        kinds = [k for k in _KINDS if find_unit(k, word)]
        if not kinds:
            known = "; ".join(f"{k}: {', '.join(known_units(k))}" for k in _KINDS)
            raise UsageError(
                f"--units: {word!r} is neither a known unit nor a known chip. The known units are {known}."
            )
        if len(kinds) > 1:
            kinds = _meant(word, kinds, position, declared, alone=len([w for w in words if w]) == 1)
        for kind in kinds:
            name = kind.replace(" ", "_")
            if getattr(declared, name) is not None:
                raise UsageError(f"--units gives two units of {kind}.")
            declared = replace(declared, **{name: find_unit(kind, word)})
    if declared.specific_force and declared.velocity_increment:
        raise UsageError(
            "--units declares the accelerometer both as specific force and as velocity increments."
        )
    if declared.angular_rate and declared.angle_increment:
        raise UsageError("--units declares the gyro both as angular rate and as angle increments.")
    return declared


def _meant(word: str, kinds: list[str], position: int, declared: DeclaredUnits, *, alone: bool) -> list[str]:
    """Return which of several quantities a word is the unit of: counts and si are of every triad, G is gauss too."""
    if find_unit("angular rate", word):
        return kinds if alone else [kinds[min(position, len(kinds) - 1)]]
    has_force = declared.specific_force is not None or declared.velocity_increment is not None
    return [kinds[-1] if has_force and word.endswith("G") else kinds[0]]


_GUESS_TOLERANCE = 0.15  # of the norm at rest when guessing; an uncalibrated MEMS is off by a few per cent
_REFUSE_FACTOR = 1.3  # a declared unit is refused when gravity comes out wrong by more than this
_RESTLESS = 0.05  # scatter within a quarter second over the norm: half a m/s² is motion, not noise
_MOST_MOTION = 4.0  # times gravity that shaking makes of the norm; beyond it is the unit
_MOST_SHAKEN = 10.0  # times gravity that the norm of an accelerometer is in any motion
_DROWNED = 3.0  # times the noise: gravity is some hundred times it
_EXCHANGED = {a + axis: b + axis for a, b in ("ag", "ga") for axis in "xyz"}


@dataclass(frozen=True)
class Level:
    """Norm of the accelerometer at rest: its median and relative spread, motion in it, noise, where rest was seen."""

    norm: float
    spread: float
    quiet: QuietStretches
    moves: bool
    two: tuple[float, float] | None
    noise: float

    @property
    def at_rest(self) -> bool:
        """Whether rest was seen."""
        return len(self.quiet) > 0


def rest_level(recording: Recording) -> Level:
    """Return the accelerometer's norm over the quiet stretches, or over everything if there are none."""
    assert recording.specific_force is not None
    cuts = sample_pieces(len(recording))
    force = np.concatenate([recording.specific_force[c] for c in cuts])
    signals: Table = force
    if recording.angular_rate is not None:
        signals = np.hstack([force, np.concatenate([recording.angular_rate[c] for c in cuts])])
    quiet: QuietStretches = find_quiet_stretches(signals, recording.rate)
    norms = np.linalg.norm(quiet.means[:, :3] if len(quiet) else force, axis=1)
    middle = float(np.median(norms))
    low, high = np.quantile(norms, [0.05, 0.95])
    # What is quietest in a recording that never rests is no rest.
    moves = bool(np.max(quiet.floor[:3]) > _RESTLESS * middle)
    spread = float(high - low) / middle if middle > 0.0 else np.inf
    return Level(
        middle,
        spread,
        quiet,
        moves,
        two_force_levels(force, recording.rate),
        float(np.max(quiet.floor[:3])),
    )


def refuse_without_gravity(level: Level, free_name: str | None, name: str) -> None:
    """Refuse accelerations that gravity was taken out of, where nobody states a unit that would show it.

    Parameters
    ----------
    level : of the accelerometer.
    free_name : of a column that says so by its name, or None.
    name : of the file.

    Raises
    ------
    RecordingError
        If the norm at rest drowns in the noise, or the name says so and the norm is gravity neither in m/s² nor in g.
    """
    small = (
        level.norm < (1.0 - _GUESS_TOLERANCE) * STANDARD_GRAVITY and abs(level.norm - 1.0) > _GUESS_TOLERANCE
    )
    drowned = level.at_rest and level.norm < _DROWNED * level.noise
    if not (drowned or (free_name is not None and small)):
        return
    where = f" ({free_name})" if free_name is not None else ""
    raise RecordingError(
        f"{name}: the accelerometer's columns{where} have a norm of {level.norm:.4g} at rest, with noise of "
        f"{level.noise:.2g}: gravity was taken out of them, and a calibration needs it. Record the acceleration with "
        "gravity, or name its columns with --columns."
    )


def guess_specific_force_unit(level: Level, whole_numbers: bool, rate: float) -> tuple[str, str]:
    """Return the unit of an accelerometer from its norm at rest, and why, as a phrase.

    "increments" is returned where the numbers look like changes of velocity over a sample.
    """
    steady = level.spread < 0.3
    said = f"its norm at rest is {level.norm:.4g}"
    if whole_numbers and level.norm > 1500.0:
        return COUNTS, f"{said}, in whole numbers"
    if steady:
        for unit in ("m/s^2", "g", "mg"):
            factor = specific_force_factor(unit) or 1.0
            if abs(level.norm * factor / STANDARD_GRAVITY - 1.0) < _GUESS_TOLERANCE:
                return unit, said + ("" if whole_numbers else _increments_too(level.norm, rate))
        if not whole_numbers and is_increment(level.norm, rate):
            return "increments", f"{said}, which times the rate of {rate:.4g} Hz is {level.norm * rate:.4g}"
    return COUNTS, said if steady else f"{said} and differs from pose to pose by {100 * level.spread:.0f} %"


def _increments_too(norm: float, rate: float) -> str:
    """Say where velocity increments would be of the same size, as those of 10 Hz are to numbers in g."""
    if not is_increment(norm, rate, tolerance=_GUESS_TOLERANCE):
        return ""
    return (
        f" (velocity increments in m/s at {rate:.4g} Hz are as large: if it holds those, say --units m/s,rad)"
    )


def is_increment(norm: float, rate: float, factor: float = 1.0, tolerance: float = 0.1) -> bool:
    """Say whether a norm at rest is gravity times one sampling interval, within a relative tolerance."""
    return abs(norm * factor * rate / STANDARD_GRAVITY - 1.0) < tolerance


def check_specific_force_unit(level: Level, unit: str, rate: float, name: str) -> None:
    """Refuse a declared unit that gravity contradicts.

    Raises
    ------
    RecordingError
        If the norm at rest in the declared unit is far from gravity.
    """
    factor = specific_force_factor(unit)
    if factor is None or (level.spread > 0.5 and not level.at_rest):
        return
    ratio = level.norm * factor / STANDARD_GRAVITY
    if level.moves and 1.0 < ratio < _MOST_MOTION:
        return  # motion adds to gravity
    allowed = _REFUSE_FACTOR if level.at_rest else 2.0
    if 1.0 / allowed < ratio < allowed:
        return
    guess, _ = guess_specific_force_unit(level, False, rate)
    advice = {"increments": "they look like velocity increments: give --units m/s,rad to convert them"}.get(
        guess, f"they look like {guess}: give --units {guess}"
    )
    if ratio < 0.1 and guess == COUNTS:
        advice = "gravity seems to have been removed; record raw specific force, which contains it"
    elif LSB in unit and guess == COUNTS:
        advice = f"the unit counts about {level.norm:.0f} to a g, so another measuring range was set: give that one"
    raise RecordingError(
        f"{name}: the accelerometer's norm {'at rest ' if level.at_rest else ''}is {level.norm:.4g}, which "
        f"in the declared {unit} is {ratio:.3g} times gravity; {advice}."
    )


def guess_angular_rate_unit(recording: Recording, header_is_plain: bool) -> tuple[str, list[Remark]]:
    """Return the unit of the gyro and how it was found: by gravity's turning, else by size.

    Parameters
    ----------
    recording : with its specific force, raw.
    header_is_plain : whether the columns are named as in tumble's own plain CSV, which is in rad/s.
    """
    assert recording.angular_rate is not None
    scale = gyro_scale_from_gravity(recording) if recording.specific_force is not None else None
    if scale is not None and scale.determined:
        unit = unit_of_scale(scale.scale)
        said = f"turned gravity gives {scale.scale:.4g} rad/s per unit"
        if unit is not None:
            return unit, [Remark("assumed", f"Angular rate is taken as {unit}: {said}.")]
        doubt = _rate_doubt(recording, scale.scale)
        kind = "doubtful" if doubt else "assumed"
        advice = " Say which it is, with --units and --rate." if doubt else ""
        return COUNTS, [Remark(kind, f"Angular rate is taken as counts: {said}{doubt}.{advice}")]
    unit, reason = _unit_by_size(recording.angular_rate, recording.rate, header_is_plain)
    return unit, [
        Remark("assumed", f"Angular rate is taken as {unit}: {reason}."),
        Remark(
            "unchecked",
            "The gyro's unit could not be checked: the unit does not turn enough against gravity.",
        ),
    ]


def _rate_doubt(recording: Recording, scale: float) -> str:
    """Numbers that are not whole, with a scale near one of rad/s or deg/s, make the sampling rate suspect."""
    assert recording.angular_rate is not None
    if whole_numbers(recording.angular_rate):
        return ""
    for unit in ("rad/s", "deg/s"):
        ratio = scale / (angular_rate_factor(unit) or 1.0)
        if 0.05 < ratio < 20.0:
            return (
                f"; but if it is in {unit}, the sampling rate is not {recording.rate:.4g} but "
                f"{recording.rate / ratio:.3g} Hz"
            )
    return ""


def _unit_by_size(rates: Vectors, rate: float, header_is_plain: bool) -> tuple[str, str]:
    """Guess from range and noise; a rest noise of 0.02 rad/s (1.1 deg/s) is beyond any usable gyro."""
    sample = rates[:: max(1, rates.shape[0] // 200_000)]
    extreme = float(np.quantile(np.abs(sample - np.median(sample, axis=0)), 0.9999))
    floor = float(np.median(find_quiet_stretches(rates[:200_000], rate).floor))
    if np.all(sample == np.round(sample)) and float(np.ptp(sample)) > 20.0:
        return COUNTS, "it is in whole numbers"
    if extreme > 40.0:
        return "deg/s", f"it reaches {extreme:.3g}, which in rad/s would be {np.degrees(extreme):.0f} °/s"
    if floor > 0.02:
        return "deg/s", f"its noise of {floor:.2g} would be {np.degrees(floor):.1f} °/s if it were in rad/s"
    if header_is_plain:
        return "rad/s", "plain CSV is in rad/s unless --units says otherwise"
    return "rad/s", "nothing in the numbers contradicts it; declare it with --units if it is another"


def check_angular_rate_unit(recording: Recording, unit: str, name: str) -> list[Remark]:
    """Refuse a declared unit of angular rate that the turning of gravity contradicts.

    Raises
    ------
    RecordingError
        If the scale that gravity shows differs from the unit's by more than a factor of 1.3.
    """
    factor = angular_rate_factor(unit)
    if factor is None or recording.specific_force is None or recording.angular_rate is None:
        return []
    scale = gyro_scale_from_gravity(recording)
    if scale is None or not scale.determined:
        fastest = np.degrees(factor * float(np.max(np.abs(extremes(recording.angular_rate)))))
        text = f"The gyro's unit ({unit}) could not be checked against gravity; it reaches {fastest:.4g} °/s."
        return [Remark("unchecked", text)]
    ratio = scale.scale / factor
    if 1.0 / _REFUSE_FACTOR < ratio < _REFUSE_FACTOR:
        return [
            Remark("found", f"The gyro's unit ({unit}) agrees with how gravity turns (ratio {ratio:.2f}).")
        ]
    other = unit_of_scale(scale.scale)
    doubled = gyro_step_words(ratio, recording.rate)
    advice = f"{doubled[0].upper()}{doubled[1:]}. Else it" if doubled is not None else "It"
    if LSB in unit and other is None and doubled is None:
        raise RecordingError(
            f"{name}: the gyro is declared to be in {unit}, but gravity turning in body axes shows about "
            f"{np.radians(1.0) / scale.scale:.3g} LSB/(°/s): another measuring range was set, so give that one."
        )
    raise RecordingError(
        f"{name}: the gyro is declared to be in {unit}, but gravity turning in body axes shows "
        f"{scale.scale:.3g} rad/s per unit ({ratio:.3g} times the declared). {advice} looks like "
        f"{other or 'counts'}: say so with --units."
    )


def check_triads(recording: Recording, level: Level | None, name: str, unit: str | None = None) -> None:
    """Refuse declared triads whose numbers show that they are exchanged, or that hold nothing.

    Parameters
    ----------
    recording, name : with raw numbers, and what its file is called.
    level : of the accelerometer, where there is one.
    unit : of the accelerometer, as header or user say; None if nobody does.

    Raises
    ------
    RecordingError
        If the accelerometer's columns hold the gyro and the other way round, or a triad is all zeros.
    """
    force, rates = recording.specific_force, recording.angular_rate
    for triad, what in ((force, "accelerometer"), (rates, "gyro")):
        if triad is not None and not np.any(triad):
            raise RecordingError(f"{name}: the {what}'s columns are all zeros; was the sensor switched on?")
    if force is None or rates is None or level is None:
        return
    order = find_accelerometer(force, rates, recording.rate, level.quiet)
    if not (order.swapped and order.sure):
        return
    # A gyro's bias, large and steady over hours, says nothing against an accelerometer that shows gravity.
    gravity_is_seen = _shows_gravity(force, unit) and not _shows_gravity(rates, unit)
    # Nor is anything proved where nothing rests: shaking adds to gravity.
    if not (gravity_is_seen or _is_shaken(level, unit)):
        raise RecordingError(
            f"{name}: the triads seem exchanged: the columns given as the gyro hold the accelerometer "
            f"({order.reason}). Name them the other way round with --columns{renamed(recording.columns, _EXCHANGED)}."
        )


def _shows_gravity(force: Vectors, unit: str | None) -> bool:
    """Whether a triad's norm is gravity most of the time, in the unit that is declared or else in m/s² or g."""
    norm = float(np.median(np.linalg.norm(force[:: max(1, len(force) // 20_000)], axis=1)))
    return any(abs(size - 1.0) < _GUESS_TOLERANCE for size in _in_gravities(norm, unit))


def _is_shaken(level: Level, unit: str | None) -> bool:
    """Whether an accelerometer moves all the time about gravity, in the unit declared or else in m/s² or g."""
    sizes = _in_gravities(level.norm, unit)
    return level.moves and any(1.0 - _GUESS_TOLERANCE < size < _MOST_SHAKEN for size in sizes)


def _in_gravities(norm: float, unit: str | None) -> list[float]:
    """Return a norm in times gravity, in the unit that is declared or else in m/s² and in g; counts are none."""
    factors = [specific_force_factor(name) for name in (("m/s^2", "g") if unit is None else (unit,))]
    return [factor * norm / STANDARD_GRAVITY for factor in factors if factor is not None]


_TOLERANCE = 0.15  # of a ratio of units, as a logarithm; an uncalibrated MEMS is off by a few per cent
# Between the units of specific force that recordings come in, m/s², g, mg and ft/s², and those of counts, lie these.
_FORCE_RATIOS = (9.80665, 1000.0 / 9.80665, 1000.0, 32.174, 3.28084)
_LEAST_SECONDS = 20
_LEAST_SHARE = 0.04  # of the seconds, in either unit
# Of deg/s, mrad/s and mdeg/s against rad/s and deg/s.
_RATE_RATIOS = (180.0 / np.pi, 1000.0, 1000.0 * np.pi / 180.0)
_WINDOW = 0.3  # s
_LEAST_TURN = 0.1  # rad that gravity turns over a window that determines
_LEAST_WINDOWS = 6  # on either side
_SAME_AXIS = 0.8  # cosine between the axes that gyro and gravity turn about, in either unit
_TURN_SPREAD = 0.6  # of logarithms: turns about inclined axes turn gravity less than themselves


def two_force_levels(force: Vectors, rate: float) -> tuple[float, float] | None:
    """Return two levels of the norm, second by second, as far apart as two units are and each steady, or None.

    Rest is not asked for: in the finer unit of two all noise is smaller, and nothing else would seem at rest.

    Parameters
    ----------
    force : (samples, 3) raw.
    rate : samples a second.
    """
    size = max(round(rate), 1)
    whole = force[: len(force) // size * size]
    seconds = np.sort(np.linalg.norm(whole, axis=1).reshape(-1, size), axis=1)
    low, middle, high = (seconds[:, int(share * size)] for share in (0.25, 0.5, 0.75))
    # a second in which it is shaken has no level
    norms = middle[high - low < _TOLERANCE * middle]
    if norms.size < _LEAST_SECONDS:
        return None
    ordered = np.sort(np.log(np.maximum(norms, 1e-300)))
    least = max(2, int(_LEAST_SHARE * ordered.size))
    cut = int(np.argmax(np.diff(ordered)[least - 1 : -least + 1])) + least
    low, high = ordered[:cut], ordered[cut:]
    spreads = [float(np.subtract(*np.quantile(part, [0.75, 0.25]))) for part in (low, high)]
    apart = float(np.median(high) - np.median(low))
    gap = float(high[0] - low[-1])
    if max(spreads) > _TOLERANCE or gap < 0.5 * apart or not _is_ratio(apart, _FORCE_RATIOS, _TOLERANCE):
        return None
    return float(np.exp(np.median(low))), float(np.exp(np.median(high)))


def _is_ratio(apart: float, ratios: tuple[float, ...], tolerance: float) -> bool:
    return min(abs(apart - float(np.log(ratio))) for ratio in ratios) < tolerance


def refuse_changed_force_unit(two: tuple[float, float] | None, name: str) -> None:
    """Refuse a recording whose accelerometer's unit changes on the way.

    Parameters
    ----------
    two : what `two_force_levels` found.
    name : of the file.

    Raises
    ------
    RecordingError
        If the norm jumps between two levels as far apart as two units are.
    """
    if two is not None:
        low, high = two
        raise RecordingError(
            f"{name}: the accelerometer's norm is near {low:.4g} for some of the time and near {high:.4g} for the "
            f"rest, {high / low:.4g} times as much: the unit changes within the file. Convert one part, or give the "
            "parts one by one."
        )


def refuse_changed_rate_unit(recording: Recording, name: str) -> None:
    """Refuse a recording whose gyro's unit changes on the way.

    Told by the turns, against how far gravity turns in them, or else by noise and bias at rest together.

    Raises
    ------
    RecordingError
        If from some moment on the gyro's numbers are as many times larger or smaller as two units are apart.
    """
    if recording.specific_force is None or recording.angular_rate is None:
        return
    cuts = sample_pieces(len(recording))
    time = np.concatenate([recording.time[c] for c in cuts])
    force = np.concatenate([recording.specific_force[c] for c in cuts])
    rates = np.concatenate([recording.angular_rate[c] for c in cuts])
    size = max(3, round(_WINDOW * recording.rate))
    found = _by_turns(force, rates, size, recording.rate) or _by_rest(force, rates, size)
    if found is None:
        return
    window, apart = found
    after = float(time[min(window * size, time.size - 1)] - time[0])
    ratio, how = float(np.exp(abs(apart))), "larger" if apart > 0.0 else "smaller"
    raise RecordingError(
        f"{name}: from about {after:.4g} s after the beginning on the gyro's numbers are some "
        f"{ratio:.3g} times {how} than before, as far apart as two units are. The accelerometer's are "
        "not: the unit changes within the file. Convert one part, or give the parts one by one."
    )


def _by_turns(force: Vectors, rates: Vectors, size: int, rate: float) -> tuple[int, float] | None:
    """Compare how far the gyro turns in each window with how far gravity does; returns window and jump."""
    count = len(force) // size
    if count < 2 * _LEAST_WINDOWS:
        return None
    ends = force[: count * size].reshape(count, size, 3)
    edge = max(1, size // 6)
    first, last = ends[:, :edge].mean(axis=1), ends[:, -edge:].mean(axis=1)
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(last, axis=1)
    cosine = np.einsum("wi,wi->w", first, last) / np.maximum(lengths, 1e-300)
    gravity = np.arccos(np.clip(cosine, -1.0, 1.0))
    turned = block_means(rates, size) * (size / rate)
    gyro = np.linalg.norm(turned, axis=1)
    told = np.flatnonzero((gravity > _LEAST_TURN) & (gyro > 0.0))
    jump = _jump(np.log(gyro[told] / gravity[told]), _TURN_SPREAD)
    if jump is None:
        return None
    # where it is shaken, the force swings about another axis than the gyros
    axes = np.cross(last[told], first[told])
    along = np.einsum("wi,wi->w", axes, turned[told])
    level = turned[told] - first[told] * _shares(turned[told], first[told])[:, None]
    cosine = along / np.maximum(np.linalg.norm(axes, axis=1) * np.linalg.norm(level, axis=1), 1e-300)
    agree = min(abs(float(np.median(part))) for part in (cosine[: jump[0]], cosine[jump[0] :]))
    return (int(told[jump[0]]), jump[1]) if agree > _SAME_AXIS else None


def _shares(vectors: Vectors, others: Vectors) -> Series:
    """How many times the other each vector has along it."""
    return np.einsum("wi,wi->w", vectors, others) / np.maximum(np.einsum("wi,wi->w", others, others), 1e-300)


def _by_rest(force: Vectors, rates: Vectors, size: int) -> tuple[int, float] | None:
    """Compare scatter and mean of the gyro at rest before and after; returns window and jump."""
    if len(rates) < 2 * _LEAST_WINDOWS * size:
        return None
    means, scatter = block_statistics(rates, size)
    _, shaking = block_statistics(force, size)
    noise = np.median(scatter, axis=1)
    still = np.flatnonzero((noise > 0.0) & np.all(shaking < 4.0 * np.median(shaking, axis=0), axis=1))
    jump = _jump(np.log(noise[still]), _TOLERANCE)
    if jump is None:
        return None
    parts = still[: jump[0]], still[jump[0] :]
    biases = [float(np.linalg.norm(np.median(means[part], axis=0))) for part in parts]
    quakes = [float(np.median(shaking[part])) for part in parts]
    if min(*biases, *quakes) <= 0.0 or abs(np.log(quakes[1] / quakes[0])) > np.log(3.0):
        return None
    same = abs(np.log(biases[1] / biases[0]) - jump[1]) < 3.0 * _TOLERANCE
    return (int(still[jump[0]]), jump[1]) if same else None


def _jump(values: Series, tolerance: float) -> tuple[int, float] | None:
    """Return where a series changes its level once, by as much as two units differ, and by how much."""
    if values.size < 2 * _LEAST_WINDOWS:
        return None
    middle = 0.5 * (float(np.quantile(values, 0.02)) + float(np.quantile(values, 0.98)))
    high = values > middle
    # Where to cut so that as few as possible stand on the wrong side, either way round.
    low_after = np.concatenate([[0], np.cumsum(high)]) + np.concatenate([np.cumsum(~high[::-1])[::-1], [0]])
    wrong = np.minimum(low_after, values.size - low_after)[_LEAST_WINDOWS:-_LEAST_WINDOWS]
    cut = int(np.argmin(wrong)) + _LEAST_WINDOWS
    before, after = values[:cut], values[cut:]
    apart = float(np.median(after) - np.median(before))
    spreads = [float(np.subtract(*np.quantile(part, [0.75, 0.25]))) for part in (before, after)]
    clean = wrong[cut - _LEAST_WINDOWS] <= 0.05 * min(before.size, after.size)
    return (
        (cut, apart)
        if clean and max(spreads) < tolerance and _is_ratio(abs(apart), _RATE_RATIOS, tolerance)
        else None
    )


_PLAIN_NAMES = ("ax", "ay", "az", "gx", "gy", "gz")


@dataclass(frozen=True)
class Interpretation:
    """What the columns of a table mean.

    Attributes
    ----------
    plan : which column is what.
    units : of the stamps ("t", not without stamps) and of the triads, by letter.
    rate : nominal sampling rate in Hz.
    clock : that the stamps are from.
    factors : what the columns of a triad are multiplied with where it is not 1: for increments the factor that turns
        them into SI rates.
    remarks : how all this was found.
    field_hold : over how many rows the logger repeats each of the magnetometer's samples.
    """

    plan: ColumnPlan
    units: dict[str, str]
    rate: float
    clock: Clock
    factors: dict[str, float] = field(default_factory=dict[str, float])
    remarks: tuple[Remark, ...] = ()
    field_hold: int = 1

    def told(self, kind: str, unit: str, factor: float = 1.0) -> Interpretation:
        """Return the same with the unit of a triad, and what its columns are multiplied with."""
        return replace(self, units=self.units | {kind: unit}, factors=self.factors | {kind: factor})

    def scaled(self, kind: str, triad: Vectors | None) -> Vectors | None:
        """Return a triad's columns as the recording has them."""
        factor = self.factors.get(kind, 1.0)
        return triad if triad is None or factor == 1.0 else triad * factor


def about_units(table: RawTable, plan: ColumnPlan, units: DeclaredUnits) -> list[Remark]:
    """Name the units of the header that are not known, where nobody declares the quantity.

    Parameters
    ----------
    table, plan, units : as read, which column is what, and what the user declares.
    """
    said: list[Remark] = []
    for quantity in dict.fromkeys(q for q, _, _ in plan.unknown_units):
        if getattr(units, quantity.replace(" ", "_")) is not None:
            continue
        name, unit = next((n, u) for q, n, u in plan.unknown_units if q == quantity)
        known = ", ".join(known_units(quantity))
        said.append(
            Remark(
                "assumed",
                f"{table.path.name}: the unit {unit!r} of {name!r} is no known unit of {quantity} ({known}), so it is "
                "passed over; say the right one with --units.",
            )
        )
    return said


def decide_force(
    recording: Recording,
    level: Level | None,
    decided: Interpretation,
    units: DeclaredUnits,
    table: RawTable,
) -> tuple[Interpretation, list[Remark]]:
    """Decide the accelerometer's unit: declared and checked, or guessed from its norm at rest.

    Parameters
    ----------
    recording, decided : raw, and what is decided so far.
    level : of the accelerometer at rest, where there is one.
    units, table : as declared; as read.

    Raises
    ------
    RecordingError
        If the triads are exchanged or empty, gravity contradicts the declared unit, the unit changes on the way, or the
        numbers look like increments.
    """
    name, rate = table.path.name, recording.rate
    unit = units.specific_force or decided.plan.units.get("a")
    increment = units.velocity_increment or (unit and find_unit("velocity increment", unit))
    check_triads(recording, level, name, None if increment else unit)
    if recording.specific_force is None or level is None:
        return decided, []
    refuse_changed_force_unit(level.two, name)
    if increment is not None:
        factor = velocity_increment_factor(increment) * rate
        if level.at_rest and not is_increment(level.norm, rate, factor / rate, tolerance=0.3):
            raise RecordingError(
                f"{name}: {level.norm:.4g} {increment} at rest over {1 / rate:.4g} s would be "
                f"{level.norm * factor:.4g} m/s²: these are no velocity increments; leave {increment} out of "
                "--units, or check the rate."
            )
        text = f"Velocity increments in {increment} are divided by the sampling interval of {1 / rate:.6g} s."
        return decided.told("a", "m/s^2", factor), [Remark("mended", text)]
    if unit is not None:
        check_specific_force_unit(level, unit, rate, name)
        return decided.told("a", unit), []
    refuse_without_gravity(level, _free_name(table, decided.plan), name)
    unit, reason = guess_specific_force_unit(level, whole_numbers(recording.specific_force), rate)
    if unit == "increments":
        raise RecordingError(
            f"{name}: the accelerometer's columns look like velocity increments ({reason}); give --units m/s,rad (or "
            "m/s,deg) to convert them to rates, or --units counts if they are raw."
        )
    if unit == COUNTS and not level.norm > 0.0:
        reason = "its norm at rest is zero"
    return decided.told("a", unit), [Remark("assumed", f"Specific force is taken as {unit}: {reason}.")]


def _free_name(table: RawTable, plan: ColumnPlan) -> str | None:
    """Return the name of the accelerometer's first column if it says that gravity was taken out, else None."""
    if table.names is None or "a" not in plan.triads or plan.said_by != "header":
        return None
    name = table.names[plan.triads["a"][0][0]]
    return name if says_free_of_gravity(name) else None


def decide_rate(
    recording: Recording, decided: Interpretation, units: DeclaredUnits, table: RawTable
) -> tuple[Interpretation, list[Remark]]:
    """Decide the gyro's unit: declared and checked against gravity, or guessed.

    Parameters
    ----------
    recording, decided : the gyro raw, and what is decided so far.
    units, table : as declared; as read.

    Raises
    ------
    RecordingError
        If the turning of gravity contradicts the declared unit, or the unit changes on the way.
    """
    if recording.angular_rate is None:
        return decided, []
    name, rate = table.path.name, recording.rate
    refuse_changed_rate_unit(recording, name)
    unit = units.angular_rate or decided.plan.units.get("g")
    increment = units.angle_increment or (unit and find_unit("angle increment", unit))
    if increment is not None:
        factor = angle_increment_factor(increment) * rate
        text = f"Angle increments in {increment} are divided by the sampling interval of {1 / rate:.6g} s."
        converted = replace(recording, angular_rate=recording.angular_rate * factor)
        more = check_angular_rate_unit(converted, "rad/s", name)
        return decided.told("g", "rad/s", factor), [Remark("mended", text), *more]
    if unit is None and units.specific_force == COUNTS:
        unit = COUNTS
    if unit is not None:
        return decided.told("g", unit), check_angular_rate_unit(recording, unit, name)
    plain = table.names is not None and {n.lower() for n in table.names} >= set(_PLAIN_NAMES)
    unit, remarks = guess_angular_rate_unit(recording, plain)
    return decided.told("g", unit), remarks


_HELD = 1.5  # rows a sample on average: a quantised magnetometer at rest repeats fewer
_NORMALISED = 0.35  # of one, that a field in units of the local field is off by


def hold_length(values: Vectors) -> int:
    """Return over how many rows a logger holds each sample: 1 where every row is a new one.

    Parameters
    ----------
    values : (rows, 3) raw, rows without a number allowed.
    """
    there = values[np.isfinite(values).all(axis=1)][:200_000]
    if len(there) < 10:
        return 1
    new = np.flatnonzero(np.any(np.diff(there, axis=0) != 0.0, axis=1))
    runs = np.diff(new)
    if runs.size < 5 or float(np.mean(runs)) < _HELD:
        return 1
    return max(1, round(float(np.median(runs))))


def _new_rows(values: Vectors, hold: int) -> npt.NDArray[np.intp]:
    """Return the rows that hold a sample of their own: finite, and no repetition of a held one."""
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if hold == 1 or rows.size == 0:
        return rows
    there = values[rows]
    changed = np.concatenate([[True], np.any(np.diff(there, axis=0) != 0.0, axis=1)])
    number = np.arange(rows.size)
    first = np.flatnonzero(changed)
    run = np.cumsum(changed) - 1
    since, left = number - first[run], np.append(first[1:], rows.size)[run] - number
    # Two samples that are alike fill a run of about twice the length; one row more is the clocks' beat.
    return rows[changed | ((since % hold == 0) & (2 * left > hold))]


def field_of_rows(time: Series, values: Vectors, hold: int, unit: str) -> MagneticField | None:
    """Return the magnetometer's samples among a recording's rows, None if there are none.

    Parameters
    ----------
    time : (rows,) seconds.
    values : (rows, 3) raw, rows without a number allowed.
    hold : rows that each sample is repeated over.
    unit : of the numbers.
    """
    rows = _new_rows(values, hold)
    if rows.size == 0 or not np.any(values[rows]):
        return None
    if rows.size == len(values):
        return MagneticField(time, values, unit)
    return MagneticField(time[rows], values[rows], unit)


def field_beside(table: RawTable, raw: Series | None, time: Series, unit: str) -> MagneticField | None:
    """Return the samples that stand beside a table with stamps of their own, on the recording's time axis.

    Parameters
    ----------
    table : with `field`, or without.
    raw, time : stamps of the table's rows that are kept, in s, and what became of them on the recording's axis.
    unit : of the numbers.
    """
    stream = table.field
    if stream is None or not len(stream.time) or not np.any(stream.values):
        return None
    stamps = stream.time
    if raw is not None and raw.size:
        moved = time - raw
        stamps = stamps + np.interp(stamps, raw, moved) if np.any(moved) else stamps
    keep = np.concatenate([[True], np.diff(np.maximum.accumulate(stamps)) > 0.0])
    return MagneticField(stamps[keep], stream.values[keep], unit, stream.turn)


def decide_field_unit(
    field: MagneticField, units: DeclaredUnits, header: str | None, name: str
) -> tuple[str, list[Remark]]:
    """Return the magnetometer's unit: declared, from the header, or guessed from its norm; and what is said of it.

    Parameters
    ----------
    field : raw.
    units, header : as the user declares, and as the file's header says; None where nobody does.
    name : of the file.
    """
    signs = vector_signs(field.values, field.rate or 100.0)
    norm, whole, guess = signs.norm, signs.whole, signs.field_unit
    unit = units.magnetic_field or header
    if unit is not None:
        factor = magnetic_field_factor(unit)
        if factor is None or is_earth_field(norm * factor):
            return unit, []
        return unit, [Remark("found", f"{name}: {not_the_earths(norm, unit)}")]
    said = f"its norm is {norm:.4g}"
    if guess is not None and not whole:
        text = f"Magnetic field is taken as {guess}: {said}, the Earth's in that unit; say another one with --units."
        return guess, [Remark("assumed", text)]
    reason = f"{said}, in whole numbers" if whole else f"{said}, the Earth's field in no known unit"
    if not whole and abs(norm - 1.0) < _NORMALISED:
        reason = f"{said}, as of numbers in units of the local field"
    return COUNTS, [
        Remark(
            "assumed",
            f"Magnetic field is taken as {COUNTS}: {reason}; say its unit with --units (uT, gauss ...).",
        )
    ]


def not_the_earths(norm: float, unit: str) -> str:
    """Return the sentence on a norm that the Earth's field cannot have in its unit, and the unit in which it could."""
    factor = magnetic_field_factor(unit) or 1.0
    other = field_unit_of(norm)
    advice = (
        f"in {other} it would be the Earth's: check the unit (--units)"
        if other is not None and other != unit
        else "calibrate it away from iron and magnets, or check the unit (--units)"
    )
    return (
        f"the magnetometer's norm of {norm:.4g} {unit} is {norm * factor * 1e6:.4g} µT, and the Earth's field is 22 to "
        f"67 µT: hard iron, a magnet or a wrong unit; {advice}."
    )
