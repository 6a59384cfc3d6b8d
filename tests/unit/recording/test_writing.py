"""What is written is read back as the same recording, and a failed writing loses nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tumble.errors import OutputError, RecordingError, UsageError
from tumble.recording import Recording, read_blocks, read_recording, write_recording


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


def test_a_saved_parquet_file_is_not_judged_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its units were judged when it was written; the numbers, the gaps and the units are the same."""
    from tumble.recording import reading

    rng = np.random.default_rng(3)
    rows = np.column_stack([np.arange(900) / 100, [0.1, 0.2, 1.0] + 0.001 * rng.normal(size=(900, 3))])
    rows = np.column_stack([np.delete(rows, range(300, 310), axis=0), rng.integers(-40, 40, (890, 3))])
    np.savetxt(tmp_path / "a.txt", rows)
    first = read_recording(tmp_path / "a.txt")
    write_recording(first, tmp_path / "a.parquet")
    assert (first.specific_force_unit, first.angular_rate_unit) == ("g", "counts")

    def judge(*_: object) -> None:
        raise AssertionError("judged again")

    monkeypatch.setattr(reading, "rest_level", judge)
    again = read_recording(tmp_path / "a.parquet")
    assert (again.specific_force_unit, again.angular_rate_unit) == ("g", "counts")
    assert np.array_equal(again.specific_force, first.specific_force)
    assert np.array_equal(again.angular_rate, first.angular_rate)
    assert np.array_equal(again.time, first.time)
    assert again.gaps == first.gaps
    (block,) = read_blocks(tmp_path / "a.parquet")
    assert block.specific_force_unit == "g"
    assert not [r for r in again.remarks if r.kind == "assumed"]


def test_what_a_user_declares_of_a_saved_file_is_judged(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    rows = np.column_stack([np.arange(900) / 100, [0.1, 0.2, 9.7] + 0.01 * rng.normal(size=(900, 3))])
    np.savetxt(tmp_path / "a.txt", rows)
    write_recording(read_recording(tmp_path / "a.txt"), tmp_path / "a.parquet")
    with pytest.raises(RecordingError):
        read_recording(tmp_path / "a.parquet", units="g")
