"""Which triad is the magnetometer: by names, by numbers, or by a sentence that asks; never the accelerometer."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tumble.arrays import Series, Table, Vectors
from tumble.errors import RecordingError
from tumble.recording import Recording, read_blocks, read_recording

GRAVITY = 9.81
RATE = 100.0
FIELD = 49.0 * np.array([np.cos(1.13), 0.0, -np.sin(1.13)])  # µT, x north, z up: dip of 65 degrees


@cache
def tumbled(
    seed: int = 3, *, holds: int = 14, shaken: bool = True
) -> tuple[Series, Vectors, Vectors, Vectors]:
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
    if shaken:
        for hertz, size in ((1.7, 1.0), (4.3, 0.6), (9.1, 0.5)):
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


def written(folder: Path, header: str | None, *columns: Series | Vectors, digits: str = "%.6f") -> Path:
    path = folder / "recording.csv"
    table: Table = np.column_stack(columns)
    np.savetxt(path, table, fmt=digits, delimiter=",", header=header or "", comments="")
    if header is None:
        path.write_text(path.read_text().lstrip("\n"))
    return path


def field_of(recording: Recording) -> Vectors:
    assert recording.magnetic_field is not None
    return recording.magnetic_field.values


@pytest.mark.parametrize(
    "header",
    [
        "t,mx,my,mz,ax,ay,az,gx,gy,gz",
        "time,MagX,MagY,MagZ,AccX,AccY,AccZ,GyrX,GyrY,GyrZ",
        (
            "t,magnetic_field.x,magnetic_field.y,magnetic_field.z,linear_acceleration.x,linear_acceleration.y,"
            "linear_acceleration.z,angular_velocity.x,angular_velocity.y,angular_velocity.z"
        ),
        (
            "Time (s),Magnetometer X (uT),Magnetometer Y (uT),Magnetometer Z (uT),Accelerometer X (m/s^2),"
            "Accelerometer Y (m/s^2),Accelerometer Z (m/s^2),Gyroscope X (rad/s),Gyroscope Y (rad/s),"
            "Gyroscope Z (rad/s)"
        ),
    ],
)
def test_names_say_which_triad_is_the_magnetometer(tmp_path: Path, header: str) -> None:
    time, force, gyro, field = tumbled()
    recording = read_recording(written(tmp_path, header, time, field, force, gyro))
    assert recording.specific_force is not None
    assert np.allclose(recording.specific_force, force, atol=1e-6)
    assert np.allclose(field_of(recording), field, atol=1e-6)
    assert recording.magnetic_field is not None
    assert recording.magnetic_field.unit == "uT"


ORDERS = ["mag acc gyr", "acc gyr mag", "gyr acc mag", "acc mag gyr", "mag gyr acc", "gyr mag acc"]


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
    ],
)
def test_numbers_say_which_triad_is_the_magnetometer(
    tmp_path: Path, order: str, force_scale: float, field_scale: float
) -> None:
    time, force, gyro, field = tumbled()
    parts = {"acc": force_scale * force, "gyr": gyro, "mag": field_scale * field}
    path = written(tmp_path, None, time, *(parts[kind] for kind in order.split()))
    recording = read_recording(path)
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    assert np.allclose(recording.specific_force, parts["acc"], atol=1e-6)
    assert np.allclose(recording.angular_rate, parts["gyr"], atol=1e-6)
    assert np.allclose(field_of(recording), parts["mag"], atol=1e-6)


@pytest.mark.parametrize("order", ORDERS[::2])
def test_on_a_table_the_norm_of_gravity_says_it(tmp_path: Path, order: str) -> None:
    time, force, gyro, field = tumbled(shaken=False)
    parts = {"acc": force, "gyr": gyro, "mag": field}
    recording = read_recording(written(tmp_path, None, time, *(parts[kind] for kind in order.split())))
    assert recording.specific_force is not None
    assert np.allclose(recording.specific_force, force, atol=1e-6)


@pytest.mark.parametrize("field_scale", [GRAVITY / 49.0, 1.0 / 49.0])
def test_on_a_table_two_vectors_of_the_norm_of_gravity_are_asked_for(
    tmp_path: Path, field_scale: float
) -> None:
    time, force, gyro, field = tumbled(shaken=False)
    path = written(tmp_path, None, time, field_scale * field, force, gyro)
    with pytest.raises(RecordingError, match=r"columns 2-4 .* and 5-7 .*--columns"):
        read_recording(path)
    recording = read_recording(path, columns="t,mx,my,mz,ax,ay,az,gx,gy,gz")
    assert recording.specific_force is not None
    assert np.allclose(recording.specific_force, force, atol=1e-6)


def test_columns_of_accelerometer_and_magnetometer_without_a_gyro(tmp_path: Path) -> None:
    time, force, _, field = tumbled()
    for parts in ((field, force), (force, field)):
        recording = read_recording(written(tmp_path, None, time, *parts))
        assert recording.specific_force is not None
        assert recording.angular_rate is None
        assert np.allclose(recording.specific_force, force, atol=1e-6)
        assert np.allclose(field_of(recording), field, atol=1e-6)


@pytest.mark.parametrize("with_gyro", [False, True])
@pytest.mark.parametrize("scale", [1.0, 0.01, 480.0 / 49.0])
def test_a_magnetometer_without_a_name_is_no_accelerometer(
    tmp_path: Path, with_gyro: bool, scale: float
) -> None:
    time, _, gyro, field = tumbled()
    parts = (scale * field, gyro) if with_gyro else (scale * field,)
    recording = read_recording(written(tmp_path, None, time, *parts))
    assert recording.specific_force is None
    assert (recording.angular_rate is not None) == with_gyro
    assert np.allclose(field_of(recording), scale * field, atol=1e-6)


@pytest.mark.parametrize(("scale", "digits"), [(GRAVITY / 49, "%.6f"), (1 / 49, "%.6f"), (1000 / 49, "%.0f")])
def test_a_magnetometer_of_the_norm_of_gravity_is_doubted(tmp_path: Path, scale: float, digits: str) -> None:
    time, _, gyro, field = tumbled()
    for parts in ((field,), (field, gyro)):
        table = np.column_stack([scale * parts[0], *parts[1:]])
        rows = np.column_stack([np.round(table[:, :3]) if digits == "%.0f" else table[:, :3], table[:, 3:]])
        recording = read_recording(written(tmp_path, None, time, rows))
        doubts = [remark.text for remark in recording.remarks if remark.kind == "doubtful"]
        assert len(doubts) == 1
        assert "mx,my,mz" in doubts[0]


def test_a_magnetometer_that_hardly_turns_is_asked_for(tmp_path: Path) -> None:
    time, _, _, field = tumbled(holds=2)
    rest = slice(0, 190)
    with pytest.raises(RecordingError, match=r"Earth's field in uT.*--columns t,mx,my,mz"):
        read_recording(written(tmp_path, None, time[rest], field[rest]))


def test_an_accelerometer_in_a_hand_is_not_doubted(tmp_path: Path) -> None:
    time, force, gyro, _ = tumbled()
    for scale in (1.0, 1.0 / GRAVITY, 1000.0 / GRAVITY, 16384.0 / GRAVITY):
        recording = read_recording(written(tmp_path, None, time, scale * force, gyro))
        assert recording.specific_force is not None
        assert recording.magnetic_field is None
        assert not [remark for remark in recording.remarks if remark.kind == "doubtful"]


def test_blocks_decide_as_the_whole_does(tmp_path: Path) -> None:
    time, force, gyro, field = tumbled()
    path = written(tmp_path, None, time, field, force, gyro)
    blocks = list(read_blocks(path))
    assert np.allclose(np.concatenate([field_of(block) for block in blocks]), field, atol=1e-6)


@pytest.mark.parametrize(
    ("header", "lacking", "named"),
    [
        ("t,ax,ay,gx,gy,gz,temperature", "no az", "accelerometer"),
        ("t,ax,ay,az,gx,gy,temperature", "no gz", "gyro"),
        ("t,ax,ay,az,gz,qx,qy", "no gx and gy", "gyro"),
    ],
)
def test_a_missing_axis_is_named(tmp_path: Path, header: str, lacking: str, named: str) -> None:
    time, force, gyro, _ = tumbled()
    path = written(tmp_path, header, time, force, gyro)
    with pytest.raises(RecordingError, match=lacking) as caught:
        read_recording(path)
    assert named in str(caught.value)
    assert "--columns" in str(caught.value)


def test_a_missing_axis_of_the_magnetometer_is_said_and_the_rest_is_read(tmp_path: Path) -> None:
    time, force, gyro, field = tumbled()
    path = written(tmp_path, "t,ax,ay,az,gx,gy,gz,mx,my", time, force, gyro, field[:, :2])
    recording = read_recording(path)
    assert recording.magnetic_field is None
    assert any("no mz" in remark.text for remark in recording.remarks)


@pytest.mark.parametrize(("header", "pair"), [(True, False), (False, True)])
def test_a_magnetometer_in_a_file_of_its_own(tmp_path: Path, header: bool, pair: bool) -> None:
    time, force, gyro, field = tumbled()
    slow = slice(3, None, 5)
    files = {"acc.csv": (time, force), "gyro.csv": (time, gyro)} if pair else {"imu.csv": (time, force, gyro)}
    files["mag.csv"] = (time[slow] + 0.004, field[slow])
    names = {
        "acc.csv": "t,ax,ay,az",
        "gyro.csv": "t,gx,gy,gz",
        "imu.csv": "t,ax,ay,az,gx,gy,gz",
        "mag.csv": "t,mx,my,mz",
    }
    paths = []
    for name, columns in files.items():
        folder = tmp_path / name.partition(".")[0]
        folder.mkdir()
        path = written(folder, names[name] if header else None, *columns)
        paths.append(path.rename(tmp_path / name))
    for recording in (read_recording(paths), next(read_blocks(paths))):
        assert recording.specific_force is not None
        assert recording.angular_rate is not None
        assert np.allclose(recording.specific_force, force, atol=1e-6)
        assert np.allclose(recording.angular_rate, gyro, atol=1e-6)
        assert np.allclose(field_of(recording), field[slow], atol=1e-6)
        assert recording.magnetic_field is not None
        assert np.allclose(recording.magnetic_field.time, time[slow] + 0.004, atol=1e-6)


def test_held_samples_are_counted_once(tmp_path: Path) -> None:
    """A logger at 100 Hz repeats the samples of a magnetometer at 20 to 25 Hz over four or five rows."""
    time, force, gyro, field = tumbled()
    rng = np.random.default_rng(8)
    begin = np.unique(np.cumsum(rng.integers(4, 6, size=len(time))))
    begin = np.concatenate([[0], begin[begin < len(time)]])
    held = field[begin[np.searchsorted(begin, np.arange(len(time)), side="right") - 1]]
    recording = read_recording(written(tmp_path, "t,ax,ay,az,gx,gy,gz,mx,my,mz", time, force, gyro, held))
    assert np.allclose(field_of(recording), field[begin], atol=1e-6)
    assert recording.magnetic_field is not None
    assert np.allclose(recording.magnetic_field.time, time[begin])


def test_empty_cells_are_no_samples(tmp_path: Path) -> None:
    time, force, gyro, field = tumbled()
    sparse = np.full_like(field, np.nan)
    sparse[2::7] = field[2::7]
    path = written(tmp_path, "t,ax,ay,az,gx,gy,gz,mx,my,mz", time, force, gyro, sparse)
    path.write_text(path.read_text().replace("nan", ""))
    recording = read_recording(path)
    assert len(recording) == len(time)
    assert np.allclose(field_of(recording), field[2::7], atol=1e-6)


@pytest.mark.parametrize(
    ("seed", "hard_iron"), [(0, 30.0), (1, 30.0), (2, 30.0), (3, 100.0), (4, 100.0), (5, 100.0)]
)
def test_hard_iron_and_held_samples_make_no_accelerometer(
    tmp_path: Path, seed: int, hard_iron: float
) -> None:
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
    doubted = any(remark.kind == "doubtful" for remark in recording.remarks)
    if "a" in order:
        assert recording.specific_force is not None
        assert np.allclose(recording.specific_force, force, atol=1e-6) or doubted
    else:
        assert recording.specific_force is None or doubted


def test_whole_numbers_that_no_motion_changes_are_asked_for(tmp_path: Path) -> None:
    """256 may be counts of an accelerometer on a smooth table, or a field in mG."""
    time, force, _, _ = tumbled(shaken=False)
    path = written(tmp_path, None, time, np.round(256.0 / GRAVITY * force), digits="%.3f")
    with pytest.raises(RecordingError, match="--columns"):
        read_recording(path)
    assert read_recording(path, columns="t,ax,ay,az").specific_force_unit == "counts"
