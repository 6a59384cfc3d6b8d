"""What the numbers themselves tell of units: of the accelerometer by gravity, of the gyro by how gravity turns.

Every guess comes with a sentence; a declaration that the numbers contradict is refused.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Table, Vectors, extremes
from tumble.errors import RecordingError
from tumble.recording.columns import renamed
from tumble.recording.gravity_check import gyro_scale_from_gravity, gyro_step_words, unit_of_scale
from tumble.recording.recording import Recording, Remark
from tumble.recording.rest import QuietStretches, find_quiet_stretches, sample_pieces
from tumble.recording.unit_change import two_force_levels
from tumble.recording.unnamed_columns import find_accelerometer
from tumble.records import dataclass
from tumble.units import COUNTS, LSB, STANDARD_GRAVITY, angular_rate_factor, specific_force_factor

_GUESS_TOLERANCE = 0.15  # of the norm at rest when guessing; an uncalibrated MEMS is off by a few per cent
_REFUSE_FACTOR = 1.3  # a declared unit is refused when gravity comes out wrong by more than this
_RESTLESS = 0.05  # scatter within a quarter second over the norm: half a m/s² is motion, not noise
_MOST_MOTION = 4.0  # times gravity that shaking makes of the norm; beyond it is the unit
_MOST_SHAKEN = 10.0  # times gravity that the norm of an accelerometer is in any motion
_DROWNED = 3.0  # times the noise: gravity is some hundred times it
_EXCHANGED = {a + axis: b + axis for a, b in ("ag", "ga") for axis in "xyz"}


@dataclass(frozen=True, slots=True)
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
        return "deg/s", f"it reaches {extreme:.3g}, which in rad/s would be {np.degrees(extreme):.0f} deg/s"
    if floor > 0.02:
        return "deg/s", f"its noise of {floor:.2g} would be {np.degrees(floor):.1f} deg/s if it were in rad/s"
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
        text = (
            f"The gyro's unit ({unit}) could not be checked against gravity; it reaches {fastest:.4g} deg/s."
        )
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
            f"{np.radians(1.0) / scale.scale:.3g} LSB/(deg/s): another measuring range was set, so give that one."
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


def whole_numbers(values: Vectors) -> bool:
    """Say whether all values are whole numbers (of a long recording, those at its beginning)."""
    head = values[:50_000]
    return bool(np.all(head == np.round(head)))
