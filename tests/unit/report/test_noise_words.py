"""Coefficients in the units that people use, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.noise.characterisation import Channel, Characterisation, characterise
from tumble.recording import Recording, Source
from tumble.report.html import render_page
from tumble.report.noise import noise_lines, noise_page, noise_rows, practical_unit, si_unit

RATE = 100.0


@pytest.fixture(scope="module")
def noise() -> Characterisation:
    rng = np.random.default_rng(4)
    force, turn = rng.standard_normal((2, 20_000, 3))
    time = np.arange(20_000) / RATE
    return characterise(Recording(time, 0.02 * force + 9.8, 0.001 * turn, "m/s^2", "rad/s", RATE))


@pytest.fixture(scope="module")
def channels(noise: Characterisation) -> tuple[Channel, ...]:
    return noise.channels


@pytest.mark.parametrize(
    ("index", "letter", "value", "expected", "unit"),
    [
        # 1 rad/s/√Hz is 57.2958 °/√s, sixty times that by the root of an hour.
        (3, "N", 1.0, 57.29577951 * 60.0, "°/√h"),
        (3, "B", 1.0, 57.29577951 * 3600.0, "°/h"),
        (3, "K", 1.0, 57.29577951 * 3600.0 * 60.0, "°/h/√h"),
        (3, "R", 1.0, 57.29577951 * 3600.0 * 3600.0, "°/h/h"),
        (3, "Q", 1.0, 57.29577951 * 3600.0, "″"),
        (0, "N", 9.80665e-6, 1.0, "µg/√Hz"),
        (0, "B", 9.80665e-6, 1.0, "µg"),
        (0, "K", 9.80665e-6, 60.0, "µg/√h"),
        (0, "R", 9.80665e-6, 3600.0, "µg/h"),
        (0, "Q", 0.002, 2.0, "mm/s"),
    ],
)
def test_units_that_people_use(
    channels: tuple[Channel, ...], index: int, letter: str, value: float, expected: float, unit: str
) -> None:
    factor, name = practical_unit(channels[index], letter)
    assert name == unit
    assert factor * value == pytest.approx(expected, rel=1e-9)


def test_counts_are_not_converted(channels: tuple[Channel, ...]) -> None:
    counts = replace(channels[3], unit="counts")
    assert practical_unit(counts, "N") == (1.0, "counts/√Hz")
    assert si_unit(counts, "B") == "counts"


def test_rows_say_what_is_seen_and_how_large_the_rest_may_be(channels: tuple[Channel, ...]) -> None:
    rows = {row.letter: row for row in noise_rows(channels[3])}
    assert rows["N"].seen
    # 0.001 rad/s a sample at 100 Hz is 1e-4 rad/s/√Hz, 0.344 °/√h.
    assert float(rows["N"].practical.split(" ±")[0]) == pytest.approx(0.3438, rel=0.03)
    assert not rows["B"].seen
    assert rows["B"].practical.startswith("not seen, < ")
    assert "e+" not in rows["K"].practical


def test_lines_of_what_is_seen_have_no_limits(channels: tuple[Channel, ...]) -> None:
    assert any("not seen" in line for line in noise_lines(channels))
    assert not any("not seen" in line for line in noise_lines(channels, seen_only=True))


def test_a_files_name_cannot_write_into_the_page(noise: Characterisation) -> None:
    named = replace(noise, sources=(Source("<script>alert(1)</script>.csv", "0" * 64),))
    page = render_page(noise_page(named, "tumble noise <b>"))
    assert "<script>alert" not in page
    assert "tumble noise &lt;b&gt;" in page


def test_stamps_since_1970_leave_the_seconds_their_digits(noise: Characterisation) -> None:
    """Time is drawn from the first instant on: each second of the levels has a place of its own."""
    late = replace(noise, level_time=noise.level_time + 1.7e9)
    drawn = [
        {figure.name: figure for figure in noise_page(one, "tumble noise").figures} for one in (noise, late)
    ]
    early, epoch = (figures["level-g"].marks[0].x for figures in drawn)
    assert epoch[0] == 0.0
    assert len(set(epoch)) == len(epoch)
    np.testing.assert_allclose(epoch, early, atol=1e-5)  # stamps of 1.7e9 s have 2e-7 s of round-off
