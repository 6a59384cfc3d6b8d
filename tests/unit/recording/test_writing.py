"""What is written is read back as the same recording, and a failed writing loses nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import OutputError, UsageError
from tumble.recording import Recording, read_recording, write_recording


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize(
    ("force", "rate", "units"),
    [
        (1.0, 1.0, ("m/s^2", "rad/s")),
        (9.80665, np.pi / 180, ("g", "deg/s")),
        (1 / 400, 1 / 4700, ("counts", "counts")),
    ],
)
def test_a_written_recording_is_read_back_bit_by_bit(tumbled, tmp_path, ending, force, rate, units) -> None:
    celsius = np.linspace(20.0, 21.0, len(tumbled.time))
    recording = Recording(
        tumbled.time, tumbled.specific_force / force, tumbled.angular_rate / rate, *units, 100.0, celsius
    )
    back = read_recording(write_recording(recording, tmp_path / f"out{ending}"))
    assert (back.specific_force_unit, back.angular_rate_unit) == units
    for name in ("time", "specific_force", "angular_rate", "temperature"):
        assert np.array_equal(getattr(back, name), getattr(recording, name))


def test_plain_csv_has_the_promised_header(tumbled, tmp_path) -> None:
    recording = Recording(tumbled.time, tumbled.specific_force, tumbled.angular_rate, "m/s^2", "rad/s", 100.0)
    path = write_recording(recording, tmp_path / "out.csv")
    assert path.read_text().splitlines()[0] == "t,ax,ay,az,gx,gy,gz"


def test_an_unknown_ending_or_a_missing_folder_writes_nothing(tumbled, tmp_path) -> None:
    recording = Recording(tumbled.time, tumbled.specific_force, None, "m/s^2", "counts", 100.0)
    with pytest.raises(UsageError, match=r"\.csv or \.parquet"):
        write_recording(recording, tmp_path / "out.xlsx")
    with pytest.raises(OutputError, match="does not exist"):
        write_recording(recording, tmp_path / "nowhere" / "out.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fails_leaves_the_earlier_file(tumbled, tmp_path, monkeypatch) -> None:
    import os

    recording = Recording(tumbled.time, tumbled.specific_force, None, "m/s^2", "counts", 100.0)
    path = tmp_path / "out.csv"
    path.write_text("earlier")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left on device"):
        write_recording(recording, path)
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]
