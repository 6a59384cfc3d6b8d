"""Data frames at the border: what is taken from pandas and polars, and what is refused."""

from __future__ import annotations

import numpy as np
import pandas as pd
import polars as pl
import pytest

import tumble
from tumble.errors import RecordingError, UsageError
from tumble.workflows.corrected import corrections_of

COUNT = 500


def columns() -> dict[str, np.ndarray]:
    """Six channels that gravity and rest tell apart."""
    rng = np.random.default_rng(5)
    level = {"ax": 0.1, "ay": -0.2, "az": 9.8, "gx": 0.01, "gy": 0.0, "gz": -0.02}
    return {
        f"{name} ({'m/s^2' if name[0] == 'a' else 'rad/s'})": value + 1e-3 * rng.normal(size=COUNT)
        for name, value in level.items()
    }


STAMPS = np.arange(COUNT) / 50.0


def test_a_frame_of_either_library_is_what_the_file_of_it_is(tmp_path: object) -> None:
    data = {"time (s)": STAMPS, **columns()}
    path = f"{tmp_path}/same.csv"
    pl.DataFrame(data).write_csv(path)
    of_file = tumble.read_recording(path)
    for frame in (pl.DataFrame(data), pd.DataFrame(data)):
        got = tumble.read_recording(frame)
        np.testing.assert_array_equal(got.specific_force, of_file.specific_force)
        np.testing.assert_array_equal(got.angular_rate, of_file.angular_rate)
        np.testing.assert_array_equal(got.time, of_file.time)
        assert got.rate == of_file.rate
        assert got.sources[0].name.endswith(".DataFrame")
        assert len(got.sources[0].sha256) == 64


@pytest.mark.parametrize("zone", [None, "Asia/Tokyo"])
@pytest.mark.parametrize("unit", ["ns", "us"])
def test_an_index_of_dates_is_the_time(zone: str | None, unit: str) -> None:
    index = pd.DatetimeIndex(
        pd.Timestamp("2026-01-02") + pd.to_timedelta(STAMPS, unit="s"), tz=zone, name="stamp"
    ).as_unit(unit)
    got = tumble.read_recording(pd.DataFrame(columns(), index=index))
    # an epoch in float64 seconds is good to 2e-7 s
    np.testing.assert_allclose(np.diff(got.time), 0.02, atol=1e-6)


def test_words_are_left_out_and_missing_numbers_are_missing() -> None:
    data = pd.DataFrame({"time (s)": STAMPS, "note": ["x"] * COUNT, **columns()})
    data["ax (m/s^2)"] = data["ax (m/s^2)"].astype("Float64")
    data.loc[7, "ax (m/s^2)"] = pd.NA
    got = tumble.read_recording(data)
    assert len(got) == COUNT - 1
    assert any("NaN" in remark.text or "number" in remark.text for remark in got.remarks)


def test_columns_and_units_are_told_as_for_a_file() -> None:
    data = pl.DataFrame({str(i): column for i, column in enumerate(columns().values())})
    got = tumble.read_recording(data, columns="ax,ay,az,gx,gy,gz", units="m/s^2,rad/s", rate=50.0)
    assert got.specific_force is not None
    np.testing.assert_array_equal(got.specific_force[:, 2], data["2"].to_numpy())


def test_a_corrected_frame_says_by_what() -> None:
    data = pd.DataFrame({"time (s)": STAMPS, **columns(), "corrected_by_0123456789ab": 1})
    assert corrections_of([data]) == ("0123456789ab",)


def test_what_is_no_recording_is_refused_in_a_sentence() -> None:
    with pytest.raises(RecordingError, match="data frame of pandas has no column of numbers"):
        tumble.read_recording(pd.DataFrame({"note": ["a", "b"]}))
    with pytest.raises(UsageError, match="has no topics"):
        tumble.read_recording(pd.DataFrame(columns()), topics=["/imu"])
    with pytest.raises(RecordingError, match="is no recording"):
        tumble.read_recording(_Alien())


class _Alien:
    columns = ("a",)
    shape = (1, 1)


def test_a_recording_that_was_read_takes_no_options() -> None:
    recording = tumble.read_recording(pl.DataFrame({"time (s)": STAMPS, **columns()}))
    with pytest.raises(UsageError, match="was read already"):
        tumble.calibrate(recording, units="g")
    assert "50 Hz" in recording._repr_html_()


def test_a_duration_of_polars_is_time_also_where_the_rate_is_slow() -> None:
    slow = pl.Series("time", (STAMPS * 50 * 0.5e6).astype(np.int64)).cast(pl.Duration("us"))
    got = tumble.read_recording(pl.DataFrame({"time": slow, **columns()}))
    assert got.rate == pytest.approx(2.0)
    of_day = pl.Series("time", (STAMPS * 1e9).astype(np.int64)).cast(pl.Time)
    assert tumble.read_recording(pl.DataFrame({"time": of_day, **columns()})).rate == pytest.approx(50.0)


def test_noise_takes_frames_and_what_was_read_already() -> None:
    frame = pl.DataFrame({"time (s)": STAMPS, **columns()})
    recording = tumble.read_recording(frame)
    of_frame, of_recording = tumble.analyse_noise(frame), tumble.analyse_noise(recording)
    assert of_frame.document == of_recording.document | {"created": of_frame.document.get("created")}
    with pytest.raises(UsageError, match="A Recording was read already"):
        tumble.analyse_noise(recording, rate=100.0)
