"""Units are found from gravity, said, and a declaration that gravity contradicts is refused."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import RecordingError
from tumble.recording import Recording, gyro_scale_from_gravity, read_recording

G = 9.80665
DEGREE = np.pi / 180.0


def scaled(tumbled, force: float = 1.0, rate: float = 1.0, time: float = 1.0) -> np.ndarray:
    return np.column_stack([tumbled.time / time, tumbled.specific_force / force, tumbled.angular_rate / rate])


@pytest.mark.parametrize(
    ("unit", "factor", "rate_unit", "rate_factor"),
    [
        ("m/s^2", 1.0, "rad/s", 1.0),
        ("g", G, "deg/s", DEGREE),
        ("mg", G / 1000, "mdeg/s", DEGREE / 1000),
        ("m/s^2", 1.0, "deg/s", DEGREE),
    ],
)
def test_units_of_both_triads_are_found(tumbled, csv, unit, factor, rate_unit, rate_factor) -> None:
    for header in ("t,ax,ay,az,gx,gy,gz", None):
        recording = read_recording(csv(scaled(tumbled, factor, rate_factor), header=header))
        assert (recording.specific_force_unit, recording.angular_rate_unit) == (unit, rate_unit)
        assert sum(r.kind == "assumed" for r in recording.remarks) >= 3


def test_offset_counts_are_found_as_counts(tumbled, csv) -> None:
    """As the classic Xsens recording: 415 counts per m/s² and 4770 per rad/s around 32768."""
    rows = scaled(tumbled, 1 / 415, 1 / 4770)
    rows[:, 1:] = np.round(rows[:, 1:] + [33100, 33300, 32360, 32768, 32466, 32485])
    recording = read_recording(csv(rows, header=None))
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("counts", "counts")
    scale = gyro_scale_from_gravity(recording)
    assert scale is not None
    assert scale.determined
    assert scale.scale == pytest.approx(1 / 4770, rel=0.05)  # the check is good to a few per cent


@pytest.mark.parametrize("factor", [1.0, 1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("rate", [25.0, 2000.0])
def test_the_unit_of_time_is_found_from_25_hz_to_2_khz(tumbled, csv, factor, rate) -> None:
    rows = tumbled.rows().copy()
    rows[:, 0] = np.arange(len(rows)) / rate / factor
    recording = read_recording(csv(rows), units="m/s^2,counts")
    assert recording.rate == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("rate", [25.0, 2000.0])
def test_the_gyro_s_scale_is_found_at_low_and_high_rates(tumble, rate) -> None:
    ideal = tumble(rate=rate, holds=14)
    recording = Recording(
        ideal.time, ideal.specific_force, ideal.angular_rate / DEGREE, "m/s^2", "counts", rate
    )
    scale = gyro_scale_from_gravity(recording)
    assert scale is not None
    assert scale.determined
    assert scale.scale == pytest.approx(DEGREE, rel=0.05)


def at_rest() -> np.ndarray:
    noise = np.random.default_rng(3).normal(size=(3000, 6))
    return np.column_stack([np.arange(3000) / 100, [0.1, 0.2, G] + 0.02 * noise[:, :3], 0.002 * noise[:, 3:]])


def test_a_recording_at_rest_leaves_the_gyro_s_unit_unchecked(csv) -> None:
    recording = read_recording(csv(at_rest()))
    assert recording.angular_rate_unit == "rad/s"
    assert any(r.kind == "unchecked" and "gyro's unit" in r.text for r in recording.remarks)


@pytest.mark.parametrize(
    ("units", "factor", "match"),
    [
        ("m/s^2", G, "look like g: give --units g"),
        ("g", 1.0, "look like m/s^2"),
        ("mg", 1.0, "look like m/s^2"),
    ],
)
def test_a_wrong_unit_of_specific_force_is_refused(tumbled, csv, units, factor, match) -> None:
    with pytest.raises(RecordingError, match=match.replace("^", r"\^")):
        read_recording(csv(scaled(tumbled, factor)), units=units)


def test_a_wrong_unit_in_the_header_is_refused(tumbled, csv) -> None:
    path = csv(scaled(tumbled, G), header="t,ax [m/s^2],ay [m/s^2],az [m/s^2],gx,gy,gz")
    with pytest.raises(RecordingError, match="look like g"):
        read_recording(path)


@pytest.mark.parametrize(
    ("units", "factor", "match"), [("rad/s", DEGREE, "looks like deg/s"), ("deg/s", 1.0, "looks like rad/s")]
)
def test_degrees_for_radians_are_refused(tumbled, csv, units, factor, match) -> None:
    with pytest.raises(RecordingError, match=match):
        read_recording(csv(scaled(tumbled, 1.0, factor)), units=f"m/s^2,{units}")


def test_removed_gravity_is_refused_where_a_unit_is_declared(tumbled, csv) -> None:
    rows = tumbled.rows().copy()
    rows[:, 1:4] = 0.02 * np.random.default_rng(1).normal(size=(len(rows), 3)) + 0.01
    with pytest.raises(RecordingError, match="gravity seems to have been removed"):
        read_recording(csv(rows), units="m/s^2,rad/s")


def test_rates_declared_as_increments_are_refused(tumbled, csv) -> None:
    with pytest.raises(RecordingError, match="are no velocity increments"):
        read_recording(csv(tumbled.rows()), units="m/s,rad")


def test_a_wrong_sampling_rate_is_suspected(tumbled, csv) -> None:
    """At half the true rate every turn seems to take twice as long: half a radian a unit."""
    recording = read_recording(csv(tumbled.rows()[:, 1:], header=None), rate=50.0)
    said = [r.text for r in recording.remarks if "Angular rate" in r.text]
    assert "if it is in rad/s, the sampling rate is not 50 but 1" in said[0]


def test_an_implausible_rate_of_a_declared_unit_of_time_is_said(tumbled, csv) -> None:
    recording = read_recording(csv(tumbled.rows()), units="m/s^2,counts,us")
    (doubt,) = [r.text for r in recording.remarks if r.kind == "doubtful"]
    assert "unusual for an IMU" in doubt
    assert "in s it would be 100 Hz" in doubt


def test_swapped_triads_are_refused_when_the_header_declares_them(tumbled, csv) -> None:
    with pytest.raises(RecordingError, match="the triads seem exchanged"):
        read_recording(csv(tumbled.rows(), header="t,gx,gy,gz,ax,ay,az"))


def test_swapped_triads_at_rest_are_refused_too(csv) -> None:
    with pytest.raises(RecordingError, match="the triads seem exchanged"):
        read_recording(csv(at_rest()[:, [0, 4, 5, 6, 1, 2, 3]]))


@pytest.mark.parametrize(("shaken", "bias"), [(30.0, 0.0), (30.0, 3.0), (15.0, 3.0)])
def test_a_unit_that_is_shaken_all_the_time_is_neither_exchanged_nor_in_counts(csv, shaken, bias) -> None:
    rng = np.random.default_rng(8)
    noise = rng.normal(size=(3000, 6))
    force = [0.0, 0.0, G] + shaken * noise[:, :3]
    rate = [bias, 0.0, 0.0] + 0.3 * noise[:, 3:]
    recording = read_recording(
        csv(np.column_stack([np.arange(3000) / 100, force, rate])), units="m/s^2,rad/s"
    )
    assert recording.specific_force is not None
    assert recording.specific_force == pytest.approx(force, rel=1e-4)


@pytest.mark.parametrize("columns", [slice(1, 4), slice(4, 7), slice(1, 7)])
def test_all_zeros_are_refused(tumbled, csv, columns) -> None:
    rows = tumbled.rows().copy()
    rows[:, columns] = 0.0
    with pytest.raises(RecordingError, match="all zeros"):
        read_recording(csv(rows))


def test_what_gravity_cannot_show_is_said(tumbled, csv) -> None:
    remarks = read_recording(csv(tumbled.rows())).remarks
    assert any(r.kind == "unchecked" and "sign of gravity" in r.text for r in remarks)
