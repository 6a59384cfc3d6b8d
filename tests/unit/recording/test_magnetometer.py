"""A magnetometer: which triad it is, never the accelerometer; what the doctor says of it; cut, saved and joined."""

import itertools
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError, UsageError
from tumble.recording import (
    MagneticField,
    Recording,
    inspect_recording,
    read_blocks,
    read_recording,
    write_recording,
)
from tumble.recording.samples import joined_fields
from tumble.recording.units import read_units_option
from tumble.units import find_unit, magnetic_field_factor

GRAVITY = 9.81
RATE = 100.0
FIELD = 49.0 * np.array([np.cos(1.13), 0.0, -np.sin(1.13)])  # µT, x north, z up: dip of 65 degrees
NAMED = "t,ax,ay,az,gx,gy,gz,mx,my,mz"


@cache
def tumbled(seed: int = 3, *, holds: int = 14, shaken: bool = True) -> tuple[np.ndarray, ...]:
    """Return stamps, specific force m/s², rate rad/s and field µT of a unit that is turned from hold to hold.

    Shares no code with tumble's simulator. While it turns, a hand also pushes it: 1 m/s² at some hertz.
    """
    rng = np.random.default_rng(seed)
    turning = np.concatenate([np.zeros(200), *(np.r_[np.ones(80), np.zeros(150)] for _ in range(holds - 1))])
    axes = rng.normal(size=(holds, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    number = np.concatenate([[0], np.cumsum(np.diff(turning) > 0)])
    phase = np.zeros(turning.size)
    for turn in range(1, holds):
        inside = np.flatnonzero((number == turn) & (turning > 0))
        phase[inside] = np.sin(np.pi * (np.arange(inside.size) + 0.5) / inside.size)
    rates = 2.4 * phase[:, None] * axes[number]
    attitude, force, seen = np.eye(3), np.empty((turning.size, 3)), np.empty((turning.size, 3))
    push = np.zeros((turning.size, 3))
    time = np.arange(turning.size) / RATE
    for hertz, size in ((1.7, 1.0), (4.3, 0.6), (9.1, 0.5)) if shaken else ():
        push += size * phase[:, None] * np.sin(2 * np.pi * hertz * time[:, None] + rng.uniform(0, 6, 3))
    for row, rate in enumerate(rates):
        force[row] = attitude.T @ (np.array([0.0, 0.0, GRAVITY]) + push[row])
        seen[row] = attitude.T @ FIELD
        angle = float(np.linalg.norm(rate)) / RATE
        if angle > 0.0:
            x, y, z = rate / (angle * RATE)
            cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            attitude = attitude @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
    force += rng.normal(scale=0.02, size=force.shape) + np.array([0.05, -0.08, 0.11])
    gyro = rates + rng.normal(scale=0.003, size=rates.shape) + [0.01, -0.02, 0.015]
    iron = np.array([[1.04, 0.02, -0.01], [-0.03, 0.97, 0.015], [0.02, -0.01, 1.01]])
    seen = seen @ iron.T + rng.normal(scale=0.3, size=seen.shape) + [2.5, -1.5, 3.0]
    return time, force, gyro, seen


def written(folder, header, *columns, digits="%.6f", name="a") -> Path:
    path = folder / f"{name}.csv"
    np.savetxt(path, np.column_stack(columns), fmt=digits, delimiter=",", header=header or "", comments="")
    path.write_text(path.read_text().lstrip("\n"))
    return path


def holds(recording, a=None, g=None, m=None) -> bool:
    """Whether a recording has these triads, as they were written, and no other."""
    field = recording.magnetic_field
    found = recording.specific_force, recording.angular_rate, None if field is None else field.values
    return all(
        (one is None) == (other is None) and (one is None or np.allclose(one, other, atol=1e-6))
        for one, other in zip(found, (a, g, m), strict=True)
    )


@pytest.mark.parametrize(
    "triads",
    [
        ("t", "m{}", "a{}", "g{}"),
        ("time", "Mag{}", "Acc{}", "Gyr{}"),
        ("t", "magnetic_field.{}", "linear_acceleration.{}", "angular_velocity.{}"),
        ("Time (s)", "Magnetometer {} (uT)", "Accelerometer {} (m/s^2)", "Gyroscope {} (rad/s)"),
    ],
)
def test_names_say_which_triad_is_the_magnetometer(tmp_path: Path, triads: tuple[str, ...]) -> None:
    time, force, gyro, field = tumbled()
    axes = "XYZ" if triads[0][0] == "T" or "Mag" in triads[1] else "xyz"
    header = ",".join([triads[0], *(name.format(axis) for name in triads[1:] for axis in axes)])
    recording = read_recording(written(tmp_path, header, time, field, force, gyro))
    assert holds(recording, force, gyro, field)
    assert recording.magnetic_field.unit == "uT"


ORDERS = ["mag", "agm", "gam", "amg", "mga", "gma"]


@pytest.mark.parametrize(
    ("order", "force_scale", "field_scale"),
    [
        (ORDERS[0], 1.0, 1.0),  # m/s², µT
        (ORDERS[1], 1.0 / GRAVITY, 0.01),  # g, gauss
        (ORDERS[2], 1000.0 / GRAVITY, 480.0 / 49.0),  # mg of norm 1000, mG of norm 480
        (ORDERS[3], 1000.0 / GRAVITY, 1000.0 / 49.0),  # both of norm 1000
        (ORDERS[4], 1000.0 / GRAVITY, 1000.0 / 49.0),
        (ORDERS[5], 1.0, GRAVITY / 49.0),  # both of norm 9.81
        (ORDERS[1], 1.0, GRAVITY / 49.0),
        (ORDERS[0], 16384.0 / GRAVITY, 6.6),  # counts, AK8963's steps of 0.15 µT
        (ORDERS[3], 4096.0 / GRAVITY, 1000.0 / 49.0),  # counts, and a field with the norm of gravity in mg
        ("ma", 1.0, 1.0),  # no gyro
        ("am", 1.0, 1.0),
        *((order, 1.0, scale) for order in ("m", "mg") for scale in (1.0, 0.01, 480.0 / 49.0)),
    ],
)
def test_numbers_say_which_triad_is_the_magnetometer(tmp_path, order, force_scale, field_scale) -> None:
    time, force, gyro, field = tumbled()
    parts = {"a": force_scale * force, "g": gyro, "m": field_scale * field}
    path = written(tmp_path, None, time, *(parts[kind] for kind in order))
    expected = {kind: parts[kind] for kind in order}
    assert holds(read_recording(path), **expected)
    blocks = [block.magnetic_field.values for block in read_blocks(path)]
    assert np.allclose(np.concatenate(blocks), parts["m"], atol=1e-6)


def test_on_a_table_the_norm_of_gravity_says_it_and_two_of_that_norm_are_asked_for(tmp_path: Path) -> None:
    time, force, gyro, field = tumbled(shaken=False)
    for order in ORDERS[::2]:
        parts = {"a": force, "g": gyro, "m": field}
        path = written(tmp_path, None, time, *(parts[kind] for kind in order))
        assert holds(read_recording(path), force, gyro, field)
    for scale in (GRAVITY / 49.0, 1.0 / 49.0):
        path = written(tmp_path, None, time, scale * field, force, gyro)
        with pytest.raises(RecordingError, match=r"columns 2-4 .* and 5-7 .*--columns"):
            read_recording(path)
        assert holds(read_recording(path, columns="t,mx,my,mz,ax,ay,az,gx,gy,gz"), force, gyro, scale * field)
    # 256 may be counts of an accelerometer on a smooth table, or a field in mG.
    path = written(tmp_path, None, time, np.round(256.0 / GRAVITY * force), digits="%.3f")
    with pytest.raises(RecordingError, match="--columns"):
        read_recording(path)
    assert read_recording(path, columns="t,ax,ay,az").specific_force_unit == "counts"


@pytest.mark.parametrize(("scale", "digits"), [(GRAVITY / 49, "%.6f"), (1 / 49, "%.6f"), (1000 / 49, "%.0f")])
def test_a_magnetometer_of_the_norm_of_gravity_is_doubted(tmp_path: Path, scale: float, digits: str) -> None:
    time, _, gyro, field = tumbled()
    seen = np.round(scale * field) if digits == "%.0f" else scale * field
    for parts in ((seen,), (seen, gyro)):
        recording = read_recording(written(tmp_path, None, time, *parts))
        (doubt,) = [remark.text for remark in recording.remarks if remark.kind == "doubtful"]
        assert "mx,my,mz" in doubt


def test_a_magnetometer_that_hardly_turns_is_asked_for(tmp_path: Path) -> None:
    time, _, _, field = tumbled(holds=2)
    with pytest.raises(RecordingError, match=r"Earth's field in uT.*--columns t,mx,my,mz"):
        read_recording(written(tmp_path, None, time[:190], field[:190]))


@pytest.mark.parametrize("scale", [1.0, 1.0 / GRAVITY, 1000.0 / GRAVITY, 16384.0 / GRAVITY])
def test_an_accelerometer_in_a_hand_is_not_doubted(tmp_path: Path, scale: float) -> None:
    time, force, gyro, _ = tumbled()
    recording = read_recording(written(tmp_path, None, time, scale * force, gyro))
    assert holds(recording, scale * force, gyro)
    assert not said(recording, "doubtful")


@pytest.mark.parametrize(
    ("header", "lacking", "named"),
    [
        ("t,ax,ay,gx,gy,gz,temperature", "no az", "accelerometer"),
        ("t,ax,ay,az,gx,gy,temperature", "no gz", "gyro"),
        ("t,ax,ay,az,gz,qx,qy", "no gx and gy", "gyro"),
    ],
)
def test_a_missing_axis_is_named(tmp_path: Path, header: str, lacking: str, named: str) -> None:
    time, force, gyro, field = tumbled()
    with pytest.raises(RecordingError, match=lacking) as caught:
        read_recording(written(tmp_path, header, time, force, gyro))
    assert named in str(caught.value)
    assert "--columns" in str(caught.value)
    recording = read_recording(written(tmp_path, NAMED[:-3], time, force, gyro, field[:, :2]))
    assert holds(recording, force, gyro)
    assert "no mz" in said(recording)


@pytest.mark.parametrize("pair", [False, True])
def test_a_magnetometer_in_a_file_of_its_own(tmp_path: Path, pair: bool) -> None:
    time, force, gyro, field = tumbled()
    slow = slice(3, None, 5)
    files = {"acc": (time, force), "gyro": (time, gyro)} if pair else {"imu": (time, force, gyro)}
    files["mag"] = (time[slow] + 0.004, field[slow])
    headers = {"imu": NAMED[:-9], "mag": "t,mx,my,mz"}
    paths = [
        written(tmp_path, None if pair else headers[name], *columns, name=name)
        for name, columns in files.items()
    ]
    for recording in (read_recording(paths), next(read_blocks(paths))):
        assert holds(recording, force, gyro, field[slow])
        assert np.allclose(recording.magnetic_field.time, time[slow] + 0.004, atol=1e-6)


def test_held_samples_are_counted_once_and_empty_cells_are_none(tmp_path: Path) -> None:
    """A logger at 100 Hz repeats the samples of a magnetometer at 20 to 25 Hz over four or five rows."""
    time, force, gyro, field = tumbled()
    begin = np.unique(np.cumsum(np.random.default_rng(8).integers(4, 6, size=len(time))))
    begin = np.concatenate([[0], begin[begin < len(time)]])
    held = field[begin[np.searchsorted(begin, np.arange(len(time)), side="right") - 1]]
    recording = read_recording(written(tmp_path, NAMED, time, force, gyro, held))
    assert holds(recording, force, gyro, field[begin])
    assert np.allclose(recording.magnetic_field.time, time[begin])
    sparse = np.full_like(field, np.nan)
    sparse[2::7] = field[2::7]
    path = written(tmp_path, NAMED, time, force, gyro, sparse)
    path.write_text(path.read_text().replace("nan", ""))
    assert holds(read_recording(path), force, gyro, field[2::7])


@pytest.mark.parametrize(("seed", "hard_iron"), [(k, 30.0 if k < 3 else 100.0) for k in range(6)])
def test_hard_iron_and_held_samples_make_no_accelerometer(tmp_path, seed, hard_iron) -> None:
    """Hard iron twice the Earth's field, samples that a logger holds over four rows, any order and unit."""
    rng = np.random.default_rng(seed)
    time, force, gyro, field = tumbled(seed, holds=9)
    field = rng.choice([1.0, 0.01, 6.6]) * (field + hard_iron * np.array([0.6, -0.5, 0.62]))
    parts = {"a": force, "g": gyro, "m": field[np.arange(len(field)) // 4 * 4]}
    order = rng.permutation(list("agm" if seed % 2 else "gm"))
    path = written(tmp_path, None, time, *(parts[kind] for kind in order))
    try:
        recording = read_recording(path)
    except RecordingError as error:
        assert "--columns" in str(error)  # noqa: PT017 - it may be read or asked for
        return
    right = recording.specific_force is None
    if "a" in order:
        right = not right and np.allclose(recording.specific_force, force, atol=1e-6)
    assert right or said(recording, "doubtful")


# -- what the doctor finds ---------------------------------------------------------------------------

DIP = 65.0
IRON = np.array([[1.03, 0.02, -0.01], [-0.03, 0.98, 0.015], [0.02, -0.01, 1.01]])
HARD = np.array([12.0, -7.0, 20.0])
AS_IN_MPU9250 = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


def turned(rng: np.random.Generator) -> np.ndarray:
    """A rotation by chance: Gram and Schmidt on three vectors."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else -q


def held(holds=20, *, axes=None, noise=0.3, scale=1.0) -> Recording:
    """A recording of rests of two seconds, 100 Hz, and a magnetometer that counts its axes as `axes` says (P' m)."""
    rng = np.random.default_rng(11)
    field = 48.0 * np.array([0.0, np.cos(np.radians(DIP)), -np.sin(np.radians(DIP))])
    to_body = [turned(rng) for _ in range(holds)]
    a = np.repeat([C @ [0.0, 0.0, 9.81] for C in to_body], 200, axis=0)
    m = np.repeat([IRON @ C @ field + HARD for C in to_body], 40, axis=0)
    a = a + rng.normal(scale=0.02, size=a.shape)
    m = m @ (np.eye(3) if axes is None else axes) + rng.normal(scale=noise, size=m.shape)
    gyro = rng.normal(scale=0.003, size=a.shape)
    seen = MagneticField(0.004 + np.arange(len(m)) / 20.0, scale * m, "uT")
    return Recording(np.arange(len(a)) / 100.0, a, gyro, "m/s^2", "rad/s", 100.0, magnetic_field=seen)


def findings(recording: Recording, values: np.ndarray | None = None) -> Any:
    """What is found of the magnetometer, with other numbers if some are given."""
    if values is not None:
        recording = replace(recording, magnetic_field=replace(recording.magnetic_field, values=values))
    return inspect_recording(recording).magnetic_field


def test_norm_rate_hard_iron_and_dip_are_found() -> None:
    field = findings(held())
    assert (field.rate, field.samples) == (pytest.approx(20.0), 800)
    assert field.norm == pytest.approx(48.0, rel=0.03)
    assert field.hard_iron == pytest.approx(float(np.linalg.norm(HARD)) / 48.0, rel=0.08)
    assert field.dip == pytest.approx(DIP, abs=1.5)
    assert field.axes is None
    assert field.warnings == inspect_recording(held()).warnings == ()
    alone = inspect_recording(replace(held(), specific_force=None, angular_rate=None))
    assert alone.magnetic_field.norm == pytest.approx(48.0, rel=0.03)
    assert alone.magnetic_field.dip is None
    assert any("No accelerometer" in sentence for sentence in alone.missing)


@pytest.mark.parametrize(
    ("permutation", "names"),
    [
        # p[i, j]: the accelerometer's axis i is the magnetometer's column j.
        (AS_IN_MPU9250, ("my", "mx", "-mz")),
        (np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), ("mz", "mx", "my")),
        (np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]), ("mx", "-my", "-mz")),
        (np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, 1]]), ("-mx", "my", "mz")),  # left-handed
        (-np.eye(3), None),  # looks like the southern hemisphere
    ],
)
def test_axes_that_are_not_the_accelerometers_are_named(permutation, names) -> None:
    recording = held(axes=permutation)
    field = findings(recording)
    assert field.axes == names
    if names is None:
        assert field.dip == pytest.approx(-DIP, abs=1.5)
        return
    assert field.dip is None
    assert any(", ".join(names) in warning and "--columns" in warning for warning in field.warnings)
    # Named so, the columns are right: what --columns does with the names is done here by hand.
    values = recording.magnetic_field.values
    mended = np.empty_like(values)
    for column, word in enumerate(names):
        mended[:, "xyz".index(word[-1])] = (-1.0 if word[0] == "-" else 1.0) * values[:, column]
    again = findings(recording, mended)
    assert again.axes is None
    assert again.dip == pytest.approx(DIP, abs=1.5)


def test_few_poses_and_a_disturbed_field_name_no_axes() -> None:
    few = findings(held(holds=6, axes=AS_IN_MPU9250))
    assert (few.axes, few.dip) == (None, None)
    # a desk of steel: another field in each pose
    steel = np.repeat(np.random.default_rng(2).normal(scale=15.0, size=(20, 3)), 40, axis=0)
    field = findings(held(), held().magnetic_field.values + steel)
    assert field.axes is None
    assert any("disturbed" in warning for warning in field.warnings)


def test_a_dead_axis_and_a_saturated_one_are_said() -> None:
    values = held().magnetic_field.values.copy()
    values[:, 1] = 3.0
    values[:, 2] = np.minimum(values[:, 2], 40.0)
    field = findings(held(), values)
    assert (field.stuck, field.dip) == (("my",), None)
    assert {s.channel for s in field.saturations} == {"mz"}
    assert any("my" in warning and "never change" in warning for warning in field.warnings)
    assert any("mz sticks at 40" in warning for warning in field.warnings)


@pytest.mark.parametrize(
    ("scale", "words"), [(5.0, "hard iron"), (0.1, "hard iron"), (0.01, "in gauss it would be")]
)
def test_a_norm_that_is_not_the_earths_is_said(scale: float, words: str) -> None:
    warnings = findings(held(scale=scale, noise=0.1)).warnings
    assert any("22 to 67 µT" in warning and words in warning for warning in warnings)


def test_a_magnetometer_that_covers_little_of_the_recording_is_said() -> None:
    short = replace(held(), magnetic_field=held().magnetic_field.within(0.0, 10.0))
    assert any("covers" in warning for warning in findings(short).warnings)


# -- cut, joined, saved; units -----------------------------------------------------------------------


def slow_field(seconds: float = 10.0, begin: float = 0.013) -> MagneticField:
    time = begin + np.arange(int(seconds * 20.0)) / 20.0
    return MagneticField(time, np.column_stack([time, 2.0 * time, -3.0 * time]), "uT")


def plain(seconds: float = 10.0) -> Recording:
    time = np.arange(int(seconds * RATE)) / RATE
    rows = np.column_stack([time, time + 1.0, time + 2.0])
    return Recording(time, rows, 0.1 * rows, "m/s^2", "rad/s", RATE, magnetic_field=slow_field(seconds))


def test_pieces_of_a_recording_share_out_the_samples_of_the_field() -> None:
    pieces = [plain().between(a, b) for a, b in itertools.pairwise([0, 137, 500, 501, 1000])]
    together = joined_fields([piece.magnetic_field for piece in pieces if piece.magnetic_field is not None])
    assert np.array_equal(together.time, plain().magnetic_field.time)
    assert np.array_equal(together.values, plain().magnetic_field.values)
    for piece in (pieces[0], pieces[1], pieces[3]):
        assert piece.time[0] <= piece.magnetic_field.time[0]
    assert pieces[2].magnetic_field is None  # one row of 10 ms lies between two samples of the field


@pytest.mark.parametrize(
    ("spellings", "unit", "factor"),
    [
        ("T", "T", 1.0),
        ("mT", "mT", 1e-3),
        ("µT μT uT", "uT", 1e-6),
        ("nT", "nT", 1e-9),
        ("Gauss G", "gauss", 1e-4),
        ("mG mGauss", "mgauss", 1e-7),
        ("LSB", "counts", None),
    ],
)
def test_units_of_magnetic_field(spellings: str, unit: str, factor: float | None) -> None:
    for spelling in spellings.split():
        assert find_unit("magnetic field", spelling) == unit
        assert magnetic_field_factor(spelling) == factor


@pytest.mark.parametrize(
    ("option", "declared"),
    [
        ("g,deg/s,uT", ("g", "deg/s", "uT")),
        ("uT,deg/s,g", ("g", "deg/s", "uT")),
        ("m/s^2,mG", ("m/s^2", None, "mgauss")),
        ("g,dps,G", ("g", "deg/s", "gauss")),
        ("mg", ("mg", None, None)),
        ("counts", ("counts",) * 3),
        ("g,deg/s,counts", ("g", "deg/s", "counts")),
    ],
)
def test_units_option_declares_the_magnetometer_too(option: str, declared: tuple[str | None, ...]) -> None:
    units = read_units_option(option)
    assert (units.specific_force, units.angular_rate, units.magnetic_field) == declared
    with pytest.raises(UsageError, match="two units of magnetic field"):
        read_units_option("uT,gauss")


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("begin", [0.0, 0.013, None])
def test_a_saved_recording_has_the_field_at_its_own_stamps(tmp_path, ending, begin) -> None:
    """Without a beginning the magnetometer is alone."""
    rng = np.random.default_rng(4)
    field = slow_field(begin=begin or 0.0)
    field = replace(field, values=np.array([15.0, -3.0, -45.0]) + rng.normal(size=field.values.shape))
    if begin is None:
        whole = Recording(field.time, None, None, "counts", "counts", 20.0, magnetic_field=field)
    else:
        force = np.array([0.1, -0.2, 9.8]) + 0.02 * rng.normal(size=(1000, 3))
        whole = replace(plain(), specific_force=force, angular_rate=0.01 * force, magnetic_field=field)
    again = read_recording(write_recording(whole, tmp_path / f"saved{ending}", all_units=True))
    assert holds(again, whole.specific_force, whole.angular_rate, field.values)
    assert again.magnetic_field.unit == "uT"
    assert np.array_equal(again.magnetic_field.values, field.values)
    assert np.array_equal(again.magnetic_field.time, field.time)
