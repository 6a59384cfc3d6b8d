"""A unit that changes on the way or is not known, a triad without gravity or one that nothing was made of: all said."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import polars as pl
import pytest

from tumble.errors import RecordingError
from tumble.recording import read_recording
from tumble.units import STANDARD_GRAVITY

COUNT, RATE = 6000, 100.0


def tumbled(rng: np.random.Generator) -> np.ndarray:
    """Specific force in m/s² of a unit in twelve poses, its biases those of a consumer unit."""
    poses = rng.normal(size=(12, 3))
    poses *= STANDARD_GRAVITY / np.linalg.norm(poses, axis=1, keepdims=True)
    force = np.repeat(poses, COUNT // 12, axis=0) + np.array([0.3, -0.4, 0.2])
    return force + 0.02 * rng.normal(size=force.shape)


def frame(force: np.ndarray, **more: np.ndarray) -> pl.DataFrame:
    columns = {f"a{axis}": force[:, i] for i, axis in enumerate("xyz")}
    return pl.DataFrame({"t": np.arange(COUNT) / RATE, **columns, **more})


@pytest.mark.parametrize(("share", "factor"), [(0.15, 1.0), (0.5, 1000.0), (0.9, 1.0)])
def test_a_change_of_unit_on_the_way_is_refused_with_both_levels(share: float, factor: float) -> None:
    force = tumbled(np.random.default_rng(3))
    force[int(share * COUNT) :] *= factor / STANDARD_GRAVITY
    with pytest.raises(RecordingError, match="the unit changes within the file"):
        read_recording(frame(force))


@pytest.mark.parametrize("seed", range(6))
def test_a_recording_in_one_unit_is_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    force = tumbled(rng)
    # shaken by hand for a third of the time
    force[2000:4000] *= 1.0 + 0.5 * rng.normal(size=(2000, 1))
    assert read_recording(frame(force)).specific_force_unit == "m/s^2"


def test_columns_of_which_nothing_was_made_are_named_where_a_triad_is_missing() -> None:
    force = tumbled(np.random.default_rng(3))
    got = read_recording(frame(force, gx_rps=force[:, 0], gy_rps=force[:, 1], gz_rps=force[:, 2]))
    assert any("no gyro was recognised" in r.text and "'gx_rps'" in r.text for r in got.remarks)


@pytest.fixture(scope="module")
def motion(tumble: Callable[..., Any]) -> tuple[np.ndarray, np.ndarray]:
    """Specific force and rate of a unit that is tumbled by hand with rests between."""
    made = tumble(holds=18, seed=8)
    return made.specific_force[:COUNT], made.angular_rate[:COUNT]


@pytest.mark.parametrize(
    ("share", "factor"), [(0.2, 180.0 / np.pi), (0.5, np.pi / 180.0), (0.5, 1000.0), (0.8, 180.0 / np.pi)]
)
def test_a_gyro_whose_unit_changes_while_it_is_turned_is_refused(
    motion: tuple[np.ndarray, np.ndarray], share: float, factor: float
) -> None:
    force, rate = motion[0], motion[1].copy()
    rate[int(share * COUNT) :] *= factor
    with pytest.raises(RecordingError, match=r"the gyro's numbers are some .* the unit changes within"):
        read_recording(frame(force, **{f"g{a}": rate[:, i] for i, a in enumerate("xyz")}))


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_gyro_at_rest_whose_unit_changes_is_refused(share: float) -> None:
    rng = np.random.default_rng(11)
    force = np.array([0.1, -0.2, 9.8]) + 0.02 * rng.normal(size=(COUNT, 3))
    rate = np.radians([0.8, -0.4, 0.5]) + 0.002 * rng.normal(size=(COUNT, 3))
    rate[int(share * COUNT) :] *= 180.0 / np.pi
    with pytest.raises(RecordingError, match="the unit changes within"):
        read_recording(frame(force, **{f"g{a}": rate[:, i] for i, a in enumerate("xyz")}))


def test_a_gyro_in_one_unit_is_not_refused(motion: tuple[np.ndarray, np.ndarray]) -> None:
    """Nor where the unit lies still first and is turned later, or where an engine starts: both triads shake."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        force, rate = motion[0].copy(), motion[1].copy()
        still = int(rng.integers(500, 4000))
        force[:still], rate[:still] = force[:1], np.radians([0.8, -0.4, 0.5])
        force[:still] += 0.002 * rng.normal(size=(still, 3))
        rate[:still] += 0.00004 * rng.normal(size=(still, 3))
        got = read_recording(frame(force, **{f"g{a}": rate[:, i] for i, a in enumerate("xyz")}))
        assert got.angular_rate_unit == "rad/s"


GRAVITY_FREE = 0.02 * np.random.default_rng(4).normal(size=(COUNT, 3))


@pytest.mark.parametrize("free", ["userAcceleration.", "linear_acceleration_", "motionUserAcceleration"])
def test_the_acceleration_with_gravity_is_read_where_both_stand_side_by_side(free: str) -> None:
    force = tumbled(np.random.default_rng(3))
    both = {f"{free}{a}": GRAVITY_FREE[:, i] for i, a in enumerate("xyz")}
    both |= {f"totalAcceleration.{a}": force[:, i] for i, a in enumerate("xyz")}
    got = read_recording(pl.DataFrame({"t": np.arange(COUNT) / RATE, **both}))
    assert np.array_equal(got.specific_force, force)


@pytest.mark.parametrize("name", ["userAcceleration.", "linear_acceleration_", "a"])
def test_an_acceleration_without_gravity_is_refused(name: str) -> None:
    columns = {f"{name}{a}": GRAVITY_FREE[:, i] for i, a in enumerate("xyz")}
    with pytest.raises(RecordingError, match="gravity was taken out of them"):
        read_recording(pl.DataFrame({"t": np.arange(COUNT) / RATE, **columns}))


def test_a_linear_acceleration_with_gravity_is_read_as_ros_names_it() -> None:
    force = tumbled(np.random.default_rng(3))
    columns = {f"linear_acceleration.{a}": force[:, i] for i, a in enumerate("xyz")}
    for factor, unit in ((1.0, "m/s^2"), (1000.0, "counts")):
        scaled = {name: np.round(factor * column, 6) for name, column in columns.items()}
        got = read_recording(pl.DataFrame({"t": np.arange(COUNT) / RATE, **scaled}))
        assert got.specific_force_unit == unit


def test_a_unit_that_nobody_knows_is_said_unless_another_is_declared() -> None:
    force = tumbled(np.random.default_rng(3))
    rate = 0.01 * np.random.default_rng(5).normal(size=force.shape)
    named = frame(force, **{f"g{a} [foo/s]": rate[:, i] for i, a in enumerate("xyz")})
    said = [r.text for r in read_recording(named).remarks]
    assert any("the unit 'foo/s' of 'gx [foo/s]' is no known unit of angular rate" in text for text in said)
    assert not any("foo/s' of" in r.text for r in read_recording(named, units="deg/s").remarks)


def test_increments_of_ten_hertz_look_like_g_which_is_said() -> None:
    """0.98 m/s over a tenth of a second is also the norm of a unit in g: the other reading is named."""
    force = tumbled(np.random.default_rng(3)) / 10.0
    columns = {f"a{axis}": force[:, i] for i, axis in enumerate("xyz")}
    recording = read_recording(pl.DataFrame({"t": np.arange(COUNT) / 10.0, **columns}))
    assert recording.specific_force_unit == "g"
    assert any("if it holds those, say --units m/s,rad" in r.text for r in recording.remarks)


@pytest.mark.parametrize(("amplitude", "seeds"), [(2.5, (13, 33)), (4.0, (1, 33)), (40.0, (0, 2, 3))])
def test_a_unit_that_is_shaken_at_the_end_has_not_changed_its_units(
    motion: tuple[np.ndarray, np.ndarray], amplitude: float, seeds: tuple[int, ...]
) -> None:
    """The force swings without a turn, or has the norm of some other unit by chance: these were refused."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        time = np.arange(round(12 * RATE)) / RATE
        way = rng.normal(size=3)
        swing = np.outer(np.sin(2.0 * np.pi * rng.uniform(2.0, 7.0) * time), way / np.linalg.norm(way))
        noise = rng.normal(size=(2, len(time), 3))
        force = motion[0][-1] + amplitude * (swing + 0.2 * noise[0])
        rate = 0.02 * (swing + 0.2 * noise[1])
        joined = [np.vstack([a[: -len(time)], b]) for a, b in zip(motion, (force, rate), strict=True)]
        recording = read_recording(
            frame(joined[0], **{f"g{a}": joined[1][:, i] for i, a in enumerate("xyz")})
        )
        assert recording.specific_force_unit == "m/s^2"
