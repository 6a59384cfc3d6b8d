"""What the doctor says of a magnetometer: norm, dip, axes, faults."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.arrays import Matrix, Vectors
from tumble.recording import Findings, MagneticField, Recording, inspect_recording
from tumble.recording.doctor import FieldFindings

DIP = 65.0
IRON = np.array([[1.03, 0.02, -0.01], [-0.03, 0.98, 0.015], [0.02, -0.01, 1.01]])
HARD = np.array([12.0, -7.0, 20.0])


def turned(rng: np.random.Generator) -> Matrix:
    """A rotation by chance: Gram and Schmidt on three vectors."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else -q


def held(
    holds: int = 20,
    *,
    axes: Matrix | None = None,
    field_rate: float = 20.0,
    noise: float = 0.3,
    scale: float = 1.0,
) -> Recording:
    """A recording of rests of two seconds, 100 Hz, and a magnetometer that counts its axes as `axes` says (P' m)."""
    rng = np.random.default_rng(11)
    field = 48.0 * np.array([0.0, np.cos(np.radians(DIP)), -np.sin(np.radians(DIP))])
    force, seen = [], []
    for _ in range(holds):
        to_body = turned(rng)
        force.append(np.repeat((to_body @ [0.0, 0.0, 9.81])[None], 200, axis=0))
        seen.append(np.repeat((IRON @ to_body @ field + HARD)[None], round(2.0 * field_rate), axis=0))
    a = np.concatenate(force) + rng.normal(scale=0.02, size=(200 * holds, 3))
    m = np.concatenate(seen)
    m = m @ (np.eye(3) if axes is None else axes) + rng.normal(scale=noise, size=m.shape)
    time = np.arange(len(a)) / 100.0
    stamps = 0.004 + np.arange(len(m)) / field_rate
    gyro = rng.normal(scale=0.003, size=a.shape)
    return Recording(
        time, a, gyro, "m/s^2", "rad/s", 100.0, magnetic_field=MagneticField(stamps, scale * m, "uT")
    )


def findings(recording: Recording) -> tuple[Findings, FieldFindings]:
    found = inspect_recording(recording)
    assert found.magnetic_field is not None
    return found, found.magnetic_field


def with_values(recording: Recording, values: Vectors) -> Recording:
    field = recording.magnetic_field
    assert field is not None
    return replace(recording, magnetic_field=replace(field, values=values))


def values_of(recording: Recording) -> Vectors:
    assert recording.magnetic_field is not None
    return recording.magnetic_field.values.copy()


def test_norm_rate_hard_iron_and_dip_are_found() -> None:
    found, field = findings(held())
    assert field.rate == pytest.approx(20.0)
    assert field.samples == 800
    assert field.norm == pytest.approx(48.0, rel=0.03)
    assert field.hard_iron == pytest.approx(float(np.linalg.norm(HARD)) / 48.0, rel=0.08)
    assert field.dip == pytest.approx(DIP, abs=1.5)
    assert field.axes is None
    assert field.warnings == ()
    assert found.warnings == ()


@pytest.mark.parametrize(
    ("permutation", "names"),
    [
        # p[i, j]: the accelerometer's axis i is the magnetometer's column j.
        (np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]), ("my", "mx", "-mz")),  # as in an MPU-9250
        (np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), ("mz", "mx", "my")),
        (np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]), ("mx", "-my", "-mz")),
        (np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, 1]]), ("-mx", "my", "mz")),  # left-handed
        (-np.eye(3), None),  # looks like the southern hemisphere
    ],
)
def test_axes_that_are_not_the_accelerometers_are_named(
    permutation: Matrix, names: tuple[str, ...] | None
) -> None:
    recording = held(axes=permutation)
    _, field = findings(recording)
    assert field.axes == names
    if names is None:
        assert field.dip == pytest.approx(-DIP, abs=1.5)
        return
    assert field.dip is None
    assert any(", ".join(names) in warning and "--columns" in warning for warning in field.warnings)
    # Named so, the columns are right: what --columns does with the names is done here by hand.
    mended = np.empty_like(values_of(recording))
    for column, word in enumerate(names):
        mended[:, "xyz".index(word[-1])] = (-1.0 if word[0] == "-" else 1.0) * values_of(recording)[:, column]
    _, again = findings(with_values(recording, mended))
    assert again.axes is None
    assert again.dip == pytest.approx(DIP, abs=1.5)


def test_few_poses_name_no_axes() -> None:
    _, field = findings(held(holds=6, axes=np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])))
    assert field.axes is None
    assert field.dip is None


def test_a_disturbed_field_is_said_and_no_axes_are_named() -> None:
    recording = held()
    values = values_of(recording)
    rng = np.random.default_rng(2)
    for hold in range(20):  # a desk of steel: another field in each pose
        values[40 * hold : 40 * (hold + 1)] += rng.normal(scale=15.0, size=3)
    _, field = findings(with_values(recording, values))
    assert field.axes is None
    assert any("disturbed" in warning for warning in field.warnings)


def test_a_dead_axis_and_a_saturated_one_are_said() -> None:
    recording = held()
    values = values_of(recording)
    values[:, 1] = 3.0
    values[:, 2] = np.minimum(values[:, 2], 40.0)
    _, field = findings(with_values(recording, values))
    assert field.stuck == ("my",)
    assert {s.channel for s in field.saturations} == {"mz"}
    assert any("my" in warning and "never change" in warning for warning in field.warnings)
    assert any("mz sticks at 40" in warning for warning in field.warnings)
    assert field.dip is None


@pytest.mark.parametrize(
    ("scale", "words"), [(5.0, "hard iron"), (0.1, "hard iron"), (0.01, "in gauss it would be")]
)
def test_a_norm_that_is_not_the_earths_is_said(scale: float, words: str) -> None:
    _, field = findings(held(scale=scale, noise=0.1))
    assert any("22 to 67 µT" in warning and words in warning for warning in field.warnings)


def test_a_magnetometer_that_covers_little_of_the_recording_is_said() -> None:
    recording = held()
    assert recording.magnetic_field is not None
    short = replace(recording, magnetic_field=recording.magnetic_field.within(0.0, 10.0))
    assert any("covers" in warning for warning in findings(short)[1].warnings)


def test_a_magnetometer_alone_is_inspected() -> None:
    recording = held()
    alone = replace(recording, specific_force=None, angular_rate=None)
    found, field = findings(alone)
    assert field.norm == pytest.approx(48.0, rel=0.03)
    assert field.dip is None
    assert any("No accelerometer" in sentence for sentence in found.missing)
