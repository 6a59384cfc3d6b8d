"""Parquet, data frames, and what tumble writes: the same numbers read back, and units as they were judged."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest
from tests.unit.recording.by_hand import said

import tumble
from tumble.errors import OutputError, RecordingError, UsageError
from tumble.recording import Recording, read_blocks, read_recording, reading, write_recording
from tumble.recording.formats import header_names, read_table
from tumble.recording.formats.arrays import read_npy
from tumble.recording.formats.frames import UNITS_KEY, read_tables

COUNT = 6000
RNG = np.random.default_rng(3)
TIME = np.arange(COUNT) / 50.0
SIGNALS = [0.1, -0.3, 9.8, 0.01, 0.0, -0.02] + np.array([0.02] * 3 + [0.01] * 3) * RNG.normal(size=(COUNT, 6))
NAMES = ("ax", "ay", "az", "gx", "gy", "gz")
UNITS = {"t": "s"} | {name: "m/s^2" if name[0] == "a" else "rad/s" for name in NAMES}
DATA = {"t": TIME} | dict(zip(NAMES, SIGNALS.T, strict=True))
STATED = {f"{name} ({UNITS[name]})": values for name, values in DATA.items() if name != "t"}
FRAME = {"time (s)": TIME, **STATED}


def saved(path: Path, **changed: Any) -> Path:
    """A file with tumble's note of units, written by polars with other options or columns."""
    options = {"compression": "uncompressed", "row_group_size": 3000} | changed
    frame = pl.DataFrame(DATA | options.pop("data", {}))
    frame.write_parquet(path, metadata={UNITS_KEY: json.dumps(UNITS)}, **options)
    return path


@pytest.mark.parametrize(
    "changed",
    [
        {"data_page_size": 10_000},
        {"compression": "lz4"},
        {"compression": "zstd"},
        {"data": {"ax": DATA["ax"].astype(np.float32)}},
        {"data": {"corrected_by_0123456789ab": np.ones(COUNT, np.int8)}},
        {"statistics": False},
    ],
    ids=range(6),
)
def test_any_pages_and_types_hold_the_same_numbers(tmp_path: Path, changed: Any) -> None:
    path = saved(tmp_path / "a.parquet", **changed)
    assert np.array_equal(read_recording(path).angular_rate, SIGNALS[:, 3:])
    assert header_names(path)[: len(DATA)] == list(DATA)
    *_, last = tables = list(read_tables(path, rows=2500))
    assert ([len(t) for t in tables], last.place(0)) == ([2500, 2500, 1000], "row 5001")


def test_missing_values_are_left_out_and_a_note_that_is_none_is_passed_over(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.parquet", data={"ax": pl.Series("ax", DATA["ax"]).scatter(5, None)})
    assert len(read_recording(path)) == COUNT - 1
    for note in ("[1]", "{", "[" * 100_000):
        pl.DataFrame(DATA).write_parquet(path, metadata={UNITS_KEY: note})
        assert len(read_recording(path)) == COUNT


def test_a_file_that_is_cut_anywhere_is_refused(tmp_path: Path) -> None:
    raw = saved(tmp_path / "a.parquet").read_bytes()
    path = tmp_path / "b.parquet"
    for stop in (5, 100, len(raw) // 2, len(raw) - 1):
        path.write_bytes(raw[:stop])
        for read in (read_recording, lambda path: list(read_blocks(path))):
            with pytest.raises(RecordingError, match="is a damaged Parquet file"):
                read(path)
        assert header_names(path) == []


# -- data frames -------------------------------------------------------------------------------------


def test_a_frame_of_either_library_is_what_the_file_of_it_is(tmp_path: Path) -> None:
    pl.DataFrame(FRAME).write_csv(tmp_path / "same.csv")
    of_file = read_recording(tmp_path / "same.csv")
    for frame in (pl.DataFrame(FRAME), pd.DataFrame(FRAME)):
        got = read_recording(frame)
        for name in ("specific_force", "angular_rate", "time"):
            np.testing.assert_array_equal(getattr(got, name), getattr(of_file, name))
        assert got.rate == of_file.rate
        assert got.sources[0].name.endswith(".DataFrame")
        assert len(got.sources[0].sha256) == 64


@pytest.mark.parametrize("zone", [None, "Asia/Tokyo"])
@pytest.mark.parametrize("unit", ["ns", "us"])
def test_an_index_of_dates_is_the_time(zone: str | None, unit: str) -> None:
    stamps = pd.Timestamp("2026-01-02") + pd.to_timedelta(TIME, unit="s")
    index = pd.DatetimeIndex(stamps, tz=zone, name="stamp").as_unit(unit)
    # an epoch in float64 seconds is good to 2e-7 s
    np.testing.assert_allclose(
        np.diff(read_recording(pd.DataFrame(STATED, index=index)).time), 0.02, atol=1e-6
    )


def test_a_duration_of_polars_is_time_also_where_the_rate_is_slow() -> None:
    slow = pl.Series("time", (TIME * 50 * 0.5e6).astype(np.int64)).cast(pl.Duration("us"))
    of_day = pl.Series("time", (TIME * 1e9).astype(np.int64)).cast(pl.Time)
    for time, rate in ((slow, 2.0), (of_day, 50.0)):
        assert read_recording(pl.DataFrame({"time": time, **STATED})).rate == pytest.approx(rate)


def test_words_are_left_out_and_missing_numbers_are_missing() -> None:
    data = pd.DataFrame({"note": ["x"] * COUNT, **FRAME})
    data["ax (m/s^2)"] = data["ax (m/s^2)"].astype("Float64")
    data.loc[7, "ax (m/s^2)"] = pd.NA
    got = read_recording(data)
    assert len(got) == COUNT - 1
    assert "1 row(s) without a finite number" in said(got)


def test_columns_and_units_are_told_as_for_a_file() -> None:
    data = pl.DataFrame({str(i): column for i, column in enumerate(SIGNALS.T)})
    got = read_recording(data, columns="ax,ay,az,gx,gy,gz", units="m/s^2,rad/s", rate=50.0)
    np.testing.assert_array_equal(got.specific_force, SIGNALS[:, :3])


class Alien:
    columns = ("a",)
    shape = (1, 1)


def test_what_is_no_recording_is_refused_and_one_that_was_read_takes_no_options() -> None:
    recording = read_recording(pl.DataFrame(FRAME))
    for call, error, words in (
        (
            lambda: read_recording(pd.DataFrame({"note": ["a", "b"]})),
            RecordingError,
            "pandas has no column of",
        ),
        (lambda: read_recording(pd.DataFrame(STATED), topics=["/imu"]), UsageError, "has no topics"),
        (lambda: read_recording(Alien()), RecordingError, "is no recording"),
        (lambda: tumble.calibrate(recording, units="g"), UsageError, "was read already"),
        (lambda: tumble.analyse_noise(recording, rate=100.0), UsageError, "A Recording was read already"),
    ):
        with pytest.raises(error, match=words):
            call()
    assert "50 Hz" in recording._repr_html_()


def test_noise_takes_frames_and_what_was_read_already() -> None:
    frame = pl.DataFrame(FRAME)
    of_frame, of_recording = tumble.analyse_noise(frame), tumble.analyse_noise(read_recording(frame))
    assert of_frame.document == of_recording.document | {"created": of_frame.document.get("created")}


@pytest.mark.parametrize(("ending", "read"), [("npy", read_npy), ("parquet", read_tables)])
def test_pieces_of_a_file_are_the_file(tmp_path: Path, ending: str, read: Any) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([TIME, SIGNALS]))
    saved(tmp_path / "a.parquet")
    tables = list(read(tmp_path / f"a.{ending}", 701))
    assert [len(table) for table in tables] == [*[701] * 8, 392]
    assert tables[1].place(0) == read_table(tmp_path / f"a.{ending}").place(701)
    columns = [np.concatenate(parts) for parts in zip(*(table.columns for table in tables), strict=True)]
    assert np.array_equal(np.column_stack(columns), np.column_stack([TIME, SIGNALS]))


# -- what is written ---------------------------------------------------------------------------------


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
    signals = tumbled.specific_force / force, tumbled.angular_rate / rate
    recording = Recording(tumbled.time, *signals, *units, 100.0, celsius)
    path = write_recording(recording, tmp_path / f"out{ending}")
    back = read_recording(path)
    assert (back.specific_force_unit, back.angular_rate_unit) == units
    for name in ("time", "specific_force", "angular_rate", "temperature"):
        assert np.array_equal(getattr(back, name), getattr(recording, name))
    assert header_names(path)[:7] == ["t", *NAMES] or units[0] != "m/s^2"


def test_an_unknown_ending_or_a_missing_folder_writes_nothing(tumbled, tmp_path) -> None:
    recording = Recording(tumbled.time, tumbled.specific_force, None, "m/s^2", "counts", 100.0)
    for error, words, place in (
        (UsageError, r"\.csv or \.parquet", tmp_path / "out.xlsx"),
        (OutputError, "does not exist", tmp_path / "nowhere" / "out.csv"),
    ):
        with pytest.raises(error, match=words):
            write_recording(recording, place)
    assert list(tmp_path.iterdir()) == []


def test_a_saved_parquet_file_is_not_judged_again_but_what_a_user_declares_is(tmp_path, monkeypatch) -> None:
    """Its units were judged when it was written; the numbers, the gaps and the units are the same."""
    counts = np.random.default_rng(3).integers(-40, 40, (900, 3))
    rows = np.column_stack([TIME[:900], SIGNALS[:900, :3] / 9.80665, counts])
    np.savetxt(tmp_path / "a.txt", np.delete(rows, range(300, 310), axis=0))
    first = read_recording(tmp_path / "a.txt")
    path = write_recording(first, tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=r"look like g"):
        read_recording(path, units="m/s^2")

    def judge(*_: object) -> None:
        raise AssertionError("judged again")

    monkeypatch.setattr(reading, "rest_level", judge)
    again = read_recording(path)
    (block,) = read_blocks(path)
    for recording in (first, again, block):
        assert (recording.specific_force_unit, recording.angular_rate_unit) == ("g", "counts")
        for name in ("specific_force", "angular_rate", "time"):
            assert np.array_equal(getattr(recording, name), getattr(first, name))
    assert again.gaps == first.gaps
    assert not said(again, "assumed")
