"""Columns without names: which one is time, and which triad is which, by the numbers themselves.

Every guess comes with a sentence; what the numbers leave open is asked.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError
from tumble.recording.columns import ColumnPlan, kind_of_file
from tumble.recording.recording import Remark
from tumble.recording.rest import QuietStretches, find_quiet_stretches, sample_pieces
from tumble.recording.stamps import guess_time_unit
from tumble.recording.vector_signs import VectorSigns, vector_signs
from tumble.records import dataclass
from tumble.units import time_factor

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
    return ColumnPlan(time, values, said_by="content") if len(values) == 3 else None


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Said:
    """What the user says that the numbers need not tell: the rate in Hz, units of triads; None where nothing."""

    rate: float | None = None
    specific_force: str | None = None
    increments: bool = False
    magnetic_field: str | None = None

    @property
    def has_accelerometer(self) -> bool:
        """Whether a unit is declared that only an accelerometer has."""
        return self.specific_force is not None or self.increments


def plan_from_content(
    columns: list[Series], name: str, said: Said | None = None
) -> tuple[ColumnPlan, list[Remark]]:
    """Find the columns of a table without names: time by its steady growth, the triads by what they see.

    The triads are three columns side by side, the first two or three such groups after time is set aside; a single
    column that follows them is temperature if it could be. Which triad is the accelerometer, which the gyro and which
    the magnetometer, `tumble.recording.vector_signs` shows.

    Parameters
    ----------
    columns, name : of the table.
    said : what the user declares.

    Raises
    ------
    RecordingError
        If there are not three or at least six columns of values, or the numbers leave open which is which.
    """
    said = said or Said()
    time, values = _time_and_values(columns, name)
    groups = [tuple((i, 1.0) for i in values[s : s + 3]) for s in (0, 3, 6) if len(values) >= s + 3]
    cuts = sample_pieces(columns[0].size)
    triads = [_finite([np.concatenate([columns[i][c] for c in cuts]) for i, _ in g]) for g in groups]
    signs = [vector_signs(triad, _rough_rate(columns, time, said)) for triad in triads]
    if len(groups) == 1:
        return _plan_of_one(ColumnPlan(time, groups[0], said_by="content"), signs[0], name, said)
    roles = _roles(columns, groups, signs, name, said)
    plan = ColumnPlan(
        time,
        groups[roles.accelerometer],
        None if roles.gyro is None else groups[roles.gyro],
        said_by="content",
        magnetic_field=None if roles.magnetometer is None else groups[roles.magnetometer],
    )
    used = max(i for i in (roles.accelerometer, roles.gyro, roles.magnetometer) if i is not None)
    after = values[3 * used + 3 :]
    if len(after) == 1 and _could_be_temperature(columns[after[0]]):
        plan, after = replace(plan, temperature=after[0]), []
    remarks = [Remark("assumed", _column_words(plan, roles.reason, name, len(columns)))]
    if roles.magnetometer is None:
        plan, more = _not_a_magnetometer(plan, signs[roles.accelerometer], name, said)
        remarks = [*([] if plan.specific_force is None else remarks), *more]
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
            f"{'one of them time' if time is not None else 'none of them time'}; "
            "a recording needs three (one triad) or six (both) beside the time. Say which is which with "
            "--columns."
        )
    return time, values


def _finite(columns: list[Series]) -> Vectors:
    triad = np.column_stack(columns)
    finite = np.isfinite(triad).all(axis=1)
    return triad if finite.all() else triad[finite]


def _rough_rate(columns: list[Series], time: int | None, said: Said) -> float:
    """The rate to a few per cent where the stamps or the user say it, else a usual one."""
    if time is None or columns[time].size < 3:
        return said.rate or _GUESS_RATE
    steps = np.diff(columns[time][:200_000])
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    return 1.0 / (step * time_factor(guess_time_unit(step))) if step > 0.0 else said.rate or _GUESS_RATE


# -- which triad is which ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Roles:
    """Which group of columns is what, and why."""

    accelerometer: int
    gyro: int | None
    magnetometer: int | None
    reason: str


def _roles(
    columns: list[Series],
    groups: list[tuple[tuple[int, float], ...]],
    signs: list[VectorSigns],
    name: str,
    said: Said,
) -> _Roles:
    """Tell the triads apart: two that keep their norm are accelerometer and magnetometer, the other is the gyro."""
    cuts = sample_pieces(columns[0].size)
    rows = np.column_stack([np.concatenate([columns[i][c] for c in cuts]) for g in groups[:2] for i, _ in g])
    rows = rows[np.isfinite(rows).all(axis=1)]
    order = find_accelerometer(rows[:, :3], rows[:, 3:])
    vectors = [i for i, one in enumerate(signs) if one.is_vector]
    if len(vectors) == 2:
        first, second = vectors
        force, reason = _accelerometer_of(first, second, signs, groups, name, said)
        field = second if force == first else first
        gyro = next((i for i in range(len(groups)) if i not in vectors), None)
        return _Roles(force, gyro, field, reason)
    if len(groups) == 3 and not vectors and (static := _static_roles(signs, said)) is not None:
        return static
    return _Roles(int(order.swapped), 1 - int(order.swapped), None, order.reason)


def _accelerometer_of(
    first: int,
    second: int,
    signs: list[VectorSigns],
    groups: list[tuple[tuple[int, float], ...]],
    name: str,
    said: Said,
) -> tuple[int, str]:
    """Return which of two triads that keep their norm is the accelerometer, and why."""
    pair = (first, second)
    shaken = [i for i in pair if signs[i].motion == "shaken"]
    if len(shaken) == 1 and signs[first + second - shaken[0]].motion == "steady":
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


def _static_roles(signs: list[VectorSigns], said: Said) -> _Roles | None:
    """Of three triads that do not turn, the accelerometer is the only one with the norm of gravity; None if none is."""
    heavy = [i for i, one in enumerate(signs) if one.gravity_unit(said.specific_force) is not None]
    field = [i for i, one in enumerate(signs) if i not in heavy and one.field_unit is not None]
    if len(heavy) != 1 or len(field) != 1:
        return None
    gyro = next(i for i in range(3) if i not in (heavy[0], field[0]))
    unit = signs[heavy[0]].gravity_unit(said.specific_force)
    return _Roles(heavy[0], gyro, field[0], f"it alone has the norm of gravity, in {unit}")


def _plan_of_one(
    plan: ColumnPlan, signs: VectorSigns, name: str, said: Said
) -> tuple[ColumnPlan, list[Remark]]:
    """Return the plan of a table with one triad: what the file's name says, else what the numbers show."""
    kind = kind_of_file(name)
    if kind == "g":
        return plan.swapped(), [Remark("found", f"{name}: its one triad is the gyro, its name says.")]
    if kind == "m" or (said.magnetic_field is not None and not said.has_accelerometer):
        who = "its name says" if kind == "m" else "--units says"
        return _magnetic(plan), [Remark("found", f"{name}: its one triad is the magnetometer, {who}.")]
    found, more = _not_a_magnetometer(plan, signs, name, said)
    if found.specific_force is None:
        return found, more
    return found, [Remark("assumed", f"{name}: its one triad is taken as the accelerometer."), *more]


def _magnetic(plan: ColumnPlan) -> ColumnPlan:
    return replace(plan, specific_force=None, magnetic_field=plan.specific_force)


def _not_a_magnetometer(
    plan: ColumnPlan, signs: VectorSigns, name: str, said: Said
) -> tuple[ColumnPlan, list[Remark]]:
    """Take the only triad that keeps its norm as the magnetometer where its numbers show one, doubt it in between."""
    if said.has_accelerometer or plan.specific_force is None or signs.motion == "shaken":
        return plan, []
    which = f"{name}: columns {_numbers(plan.specific_force)}"
    gravity, field = signs.gravity_unit(), signs.field_unit
    steady = signs.motion == "steady"
    if steady and gravity is None and field is not None and not signs.whole:
        text = (
            f"{which} are taken as the magnetometer: their norm of {signs.norm:.4g} is the Earth's field in {field} "
            "and gravity in no unit, and motion does not change it. If they are the accelerometer, say so with "
            "--columns (t,ax,ay,az,gx,gy,gz)."
        )
        return _magnetic(plan), [Remark("assumed", text)]
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


def _numbers(triad: tuple[tuple[int, float], ...]) -> str:
    return f"{triad[0][0] + 1}-{triad[-1][0] + 1}"


def _column_words(plan: ColumnPlan, reason: str, name: str, count: int) -> str:
    time = (
        "no column is time"
        if plan.time is None
        else f"column {plan.time + 1} of {count} is time (it grows steadily)"
    )
    parts = [f"columns {_numbers(plan.specific_force or ())} are taken as the accelerometer ({reason})"]
    for triad, what in ((plan.angular_rate, "gyro"), (plan.magnetic_field, "magnetometer")):
        parts += [] if triad is None else [f"columns {_numbers(triad)} as the {what}"]
    return f"{name} names no columns: {time}, {', '.join(parts)}."


def _could_be_temperature(column: Series) -> bool:
    low, high = float(np.nanmin(column)), float(np.nanmax(column))
    return low > -60.0 and high < 130.0 and high - low < 80.0 and high != 0.0
