"""The magnetometer's samples of a recording: cut, moved and joined with it."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.recording import MagneticField, Recording, read_recording, write_recording
from tumble.recording.samples import joined_fields
from tumble.recording.units import read_units_option
from tumble.units import find_unit, magnetic_field_factor
from tumble.workflows.several import join_recordings


def slow_field(seconds: float = 10.0, rate: float = 20.0, begin: float = 0.013) -> MagneticField:
    time = begin + np.arange(int(seconds * rate)) / rate
    return MagneticField(time, np.column_stack([time, 2.0 * time, -3.0 * time]), "uT")


def recording(seconds: float = 10.0, rate: float = 100.0) -> Recording:
    time = np.arange(int(seconds * rate)) / rate
    rows = np.column_stack([time, time + 1.0, time + 2.0])
    return Recording(time, rows, 0.1 * rows, "m/s^2", "rad/s", rate, magnetic_field=slow_field(seconds))


def test_pieces_of_a_recording_share_out_the_samples_of_the_field() -> None:
    whole = recording()
    cuts = [0, 137, 500, 501, 1000]
    pieces = [whole.between(a, b) for a, b in itertools.pairwise(cuts)]
    fields = [piece.magnetic_field for piece in pieces if piece.magnetic_field is not None]
    together = joined_fields(list(fields))
    assert whole.magnetic_field is not None
    assert together is not None
    assert np.array_equal(together.time, whole.magnetic_field.time)
    assert np.array_equal(together.values, whole.magnetic_field.values)
    for piece in pieces:
        if piece.magnetic_field is not None:
            assert piece.time[0] <= piece.magnetic_field.time[0]
    assert pieces[2].magnetic_field is None  # one row of 10 ms lies between two samples of the field


def test_joined_recordings_move_the_stamps_of_the_field_with_their_own() -> None:
    first, second = recording(), recording(4.0)
    whole, spans = join_recordings(
        [first, replace(second, time=second.time + 50.0, magnetic_field=slow_field(4.0, begin=50.02))]
    )
    assert whole.magnetic_field is not None
    assert len(whole.magnetic_field) == 200 + 80
    assert whole.magnetic_field.time[200] == pytest.approx(spans[1][0] + 0.02)
    assert join_recordings([first, replace(second, magnetic_field=None)])[0].magnetic_field is None


@pytest.mark.parametrize(
    ("spelling", "unit", "factor"),
    [
        ("T", "T", 1.0),
        ("mT", "mT", 1e-3),
        ("µT", "uT", 1e-6),
        ("μT", "uT", 1e-6),
        ("uT", "uT", 1e-6),
        ("nT", "nT", 1e-9),
        ("Gauss", "gauss", 1e-4),
        ("G", "gauss", 1e-4),
        ("mG", "mgauss", 1e-7),
        ("mGauss", "mgauss", 1e-7),
        ("LSB", "counts", None),
    ],
)
def test_units_of_magnetic_field(spelling: str, unit: str, factor: float | None) -> None:
    assert find_unit("magnetic field", spelling) == unit
    assert magnetic_field_factor(spelling) == factor


def test_units_option_declares_the_magnetometer_too() -> None:
    assert read_units_option("g,deg/s,uT").magnetic_field == "uT"
    assert read_units_option("uT,deg/s,g").specific_force == "g"
    assert read_units_option("m/s^2,mG").magnetic_field == "mgauss"
    assert read_units_option("g,dps,G").magnetic_field == "gauss"
    assert read_units_option("mg").specific_force == "mg"
    assert read_units_option("mg").magnetic_field is None
    raw = read_units_option("counts")
    assert (raw.specific_force, raw.angular_rate, raw.magnetic_field) == ("counts",) * 3
    third = read_units_option("g,deg/s,counts")
    assert (third.specific_force, third.angular_rate, third.magnetic_field) == ("g", "deg/s", "counts")
    with pytest.raises(UsageError, match="two units of magnetic field"):
        read_units_option("uT,gauss")


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("begin", [0.0, 0.013])
def test_a_saved_recording_has_the_field_at_its_own_stamps(tmp_path: Path, ending: str, begin: float) -> None:
    rng = np.random.default_rng(4)
    time = np.arange(1000) / 100.0
    force = np.array([0.1, -0.2, 9.8]) + 0.02 * rng.normal(size=(1000, 3))
    field = slow_field(begin=begin)
    field = replace(field, values=np.array([15.0, -3.0, -45.0]) + rng.normal(size=field.values.shape))
    whole = Recording(time, force, 0.01 * force, "m/s^2", "rad/s", 100.0, magnetic_field=field)
    again = read_recording(write_recording(whole, tmp_path / f"saved{ending}", all_units=True)).magnetic_field
    assert again is not None
    assert again.unit == "uT"
    assert np.array_equal(again.values, field.values)
    assert np.array_equal(again.time, field.time)


def test_a_magnetometer_alone_is_saved_and_read_again(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    field = replace(slow_field(), values=np.array([15.0, -3.0, -45.0]) + rng.normal(size=(200, 3)))
    alone = Recording(field.time, None, None, "counts", "counts", 20.0, magnetic_field=field)
    again = read_recording(write_recording(alone, tmp_path / "saved.csv", all_units=True))
    assert again.specific_force is None
    assert again.magnetic_field is not None
    assert np.array_equal(again.magnetic_field.values, field.values)
