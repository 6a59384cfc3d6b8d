"""What a column of temperature lacks is counted block by block as in the whole."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.recording import read_recording
from tumble.recording.temperature import TemperatureColumn, mean_celsius, without_slips

TIME = np.arange(1000.0)


def column(celsius: np.ndarray, block: int) -> TemperatureColumn:
    found = TemperatureColumn()
    for begin in range(0, celsius.size, block):
        found.add(TIME[begin : begin + block], celsius[begin : begin + block])
    return found


@pytest.mark.parametrize("block", [1000, 7, 1])
def test_gaps_are_found_across_blocks(block: int) -> None:
    celsius = 20.0 + 0.01 * TIME
    celsius[100:150] = np.nan
    celsius[700:705] = np.nan
    found = column(celsius, block)
    assert (found.samples, found.missing) == (1000, 55)
    # From the last number before it to the first after it.
    assert found.longest_gap == (51.0, 99.0)
    assert (found.lowest, found.highest) == (celsius[0], celsius[-1])
    assert not found.is_constant


@pytest.mark.parametrize("block", [1000, 7])
def test_a_thermometer_that_falls_silent_is_silent_to_the_end(block: int) -> None:
    celsius = np.where(TIME < 400.0, 20.0, np.nan)
    found = column(celsius, block)
    assert found.longest_gap == (600.0, 399.0)
    assert found.is_constant


def test_samples_that_are_not_there_are_no_missing_temperatures() -> None:
    found = TemperatureColumn()
    found.add(np.concatenate([TIME[:100], TIME[900:]]), np.full(200, 21.5))
    assert found.longest_gap[0] == 0.0
    assert found.missing_words() == ""


def test_slips_are_no_temperatures_and_a_column_in_another_scale_is_left_as_it_is() -> None:
    celsius = 20.0 + 0.01 * TIME
    slipped = celsius.copy()
    slipped[[10, 500, 501]] = [1700.0, -273.1, 1700.0]
    mended, count = without_slips(slipped)
    assert count == 3
    assert np.flatnonzero(np.isnan(mended)).tolist() == [10, 500, 501]
    assert without_slips(celsius) == (celsius, 0)
    counts = 340.0 * (celsius - 36.53)
    assert without_slips(counts)[1] == 0
    assert mean_celsius(mended) == pytest.approx(25.0, abs=0.1)
    assert mean_celsius(counts) is None
    assert mean_celsius(None) is None


def test_a_recording_says_how_many_temperatures_were_slips(tumbled, csv) -> None:
    celsius = np.full(len(tumbled.time), 25.0)
    celsius[100] = 1700.0
    rows = np.column_stack([tumbled.rows(), celsius])
    recording = read_recording(csv(rows, header="t,ax,ay,az,gx,gy,gz,temperature"))
    assert np.isnan(recording.temperature[100])
    assert np.nanmax(recording.temperature) == 25.0
    assert any("1 number(s) of the temperature are beyond -100 to 200" in r.text for r in recording.remarks)
