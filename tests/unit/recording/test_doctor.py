"""`tumble inspect`: findings on recordings whose faults were put there on purpose; what it prints, saves, returns."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.recording.by_hand import said

from tumble.recording import Recording, find_saturated_channels, inspect_recording, read_recording
from tumble.recording.rest import find_quiet_stretches, one_a_direction
from tumble.recording.temperature import TemperatureColumn, mean_celsius, without_slips


def recording_of(tumbled, **changes) -> Recording:
    signals = tumbled.specific_force.copy(), tumbled.angular_rate.copy()
    return replace(Recording(tumbled.time, *signals, "m/s^2", "rad/s", 100.0), **changes)


def at_rest(rows: int, step: float = 0.0) -> Recording:
    rng = np.random.default_rng(4)
    force = np.array([0.3, 0.1, 9.8]) + 0.01 * rng.normal(size=(rows, 3))
    rate = 0.002 * rng.normal(size=(rows, 3))
    if step:
        force, rate = np.round(force / step) * step, np.round(10.0 * rate / step) * step / 10.0
    return Recording(np.arange(rows) / 100, force, rate, "m/s^2", "rad/s", 100.0)


def test_rests_poses_and_noise_are_those_put_in(tumbled) -> None:
    """Twelve holds of 2 s and eleven turns of 1.5 s: 24 of 40.5 s at rest."""
    found = inspect_recording(recording_of(tumbled))
    assert found.quiet_stretches == 12
    assert 9 <= found.poses <= 12  # turns of 40 degrees and more may lead back near an earlier pose
    assert found.rest_share == pytest.approx(24 / 40.5, abs=0.15)  # blocks of 0.25 s at 23 ends
    assert found.motion_share == pytest.approx(16.5 / 40.5, abs=0.15)
    assert found.rest_share + found.motion_share <= 1.0
    assert all(abs(n - 9.80665) < 0.02 for n in found.rest_norms)
    # The 5th percentile of the scatter of 25 samples lies at 0.76 sigma.
    assert found.noise_floor["ax"] == pytest.approx(0.02, rel=0.4)
    assert found.noise_floor["gz"] == pytest.approx(0.001, rel=0.4)
    assert (found.axis_contradiction, found.warnings) == (None, ())


@pytest.mark.parametrize("limit", [1.0, 0.5])
def test_a_saturated_gyro_is_found(tumbled, limit) -> None:
    rate = tumbled.angular_rate.clip(-limit, limit)
    found = inspect_recording(recording_of(tumbled, angular_rate=rate))
    assert {s.value for s in found.saturations} <= {limit, -limit}
    assert {s.channel for s in found.saturations} == {"gx", "gy", "gz"}
    assert any("saturated" in w for w in found.warnings)


def test_a_saturated_accelerometer_is_said_to_show_too_little_gravity(tumbled) -> None:
    clipped = recording_of(tumbled, specific_force=tumbled.specific_force.clip(-7.0, 7.0))
    told = find_saturated_channels(clipped)
    assert told
    assert all(one.startswith("a") and "shows too little gravity" in one for one in told)
    assert inspect_recording(at_rest(5000, step=0.01)).saturations == ()  # quantised


def test_stuck_channels_gaps_and_swapped_axes_are_named(tumbled) -> None:
    rate = tumbled.angular_rate.copy()
    rate[:, 1] = 0.25
    found = inspect_recording(recording_of(tumbled, angular_rate=rate))
    assert found.stuck == ("gy",)
    assert any("gy never change" in w for w in found.warnings)
    found = inspect_recording(recording_of(tumbled, angular_rate=tumbled.angular_rate[:, [1, 0, 2]]))
    assert found.axis_contradiction in found.warnings
    signals = (np.delete(part.T, np.s_[300:350], axis=-1).T for part in vars(tumbled).values())
    (gap,) = inspect_recording(Recording(*signals, "m/s^2", "rad/s", 100.0, gaps=(300,))).gaps
    assert (gap.index, gap.samples) == (300, 50)
    assert (gap.time, gap.duration) == (pytest.approx(2.99), pytest.approx(0.51))


def test_what_a_recording_is_good_for_is_told(tumbled) -> None:
    found = inspect_recording(at_rest(70_000))
    assert found.poses == 1
    assert found.rest_share > 0.9
    assert [s.partition(":")[0] for s in found.good_for] == ["Noise analysis"]
    warm = recording_of(tumbled, temperature=np.linspace(20.0, 45.0, len(tumbled.time)))
    assert inspect_recording(warm).temperature_range == (20.0, 45.0)
    assert any("Temperature dependence: 20 to 45" in s for s in inspect_recording(warm).good_for)


def test_a_slow_steady_turn_is_no_rest() -> None:
    """Five degrees a second: the gyro scatters as at rest, but gravity moves 0.2 m/s² a block."""
    rng = np.random.default_rng(4)
    angle = np.radians(5.0) * np.arange(3000) / 100
    force = 9.8 * np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
    signals = np.column_stack([force, np.tile([0.0, np.radians(5.0), 0.0], (3000, 1))])
    signals += np.array([0.02] * 3 + [0.001] * 3) * rng.normal(size=signals.shape)
    assert len(find_quiet_stretches(signals, 100.0).at_least(100)) == 0


def test_directions_closer_than_fifteen_degrees_are_one_pose() -> None:
    angles = np.radians([0.0, 10.0, 20.0, 90.0, 95.0])
    directions = 9.8 * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    assert len(one_a_direction(directions)) == 3  # 0, 20 and 90 degrees


# -- the thermometer ---------------------------------------------------------------------------------

TIME = np.arange(1000.0)


@pytest.mark.parametrize("block", [1000, 7, 1])
def test_gaps_of_a_thermometer_are_found_across_blocks(block: int) -> None:
    celsius = 20.0 + 0.01 * TIME
    celsius[100:150] = np.nan
    celsius[700:705] = np.nan
    found, silent = TemperatureColumn(), TemperatureColumn()
    for part in (slice(begin, begin + block) for begin in range(0, 1000, block)):
        found.add(TIME[part], celsius[part])
        silent.add(TIME[part], np.where(TIME[part] < 400.0, 20.0, np.nan))
    assert (found.samples, found.missing) == (1000, 55)
    # From the last number before it to the first after it.
    assert found.longest_gap == (51.0, 99.0)
    assert (found.lowest, found.highest) == (celsius[0], celsius[-1])
    assert (found.is_constant, silent.is_constant) == (False, True)
    assert silent.longest_gap == (600.0, 399.0)  # to the end


def test_samples_that_are_not_there_are_no_missing_temperatures() -> None:
    found = TemperatureColumn()
    found.add(np.concatenate([TIME[:100], TIME[900:]]), np.full(200, 21.5))
    assert (found.longest_gap[0], found.missing_words()) == (0.0, "")


def test_slips_are_no_temperatures_and_a_column_in_another_scale_is_left_as_it_is(tumbled, csv) -> None:
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
    assert mean_celsius(counts) is mean_celsius(None) is None
    rows = np.column_stack([tumbled.rows(), np.full(len(tumbled.time), 25.0)])
    rows[100, 7] = 1700.0
    recording = read_recording(csv(rows, header="t,ax,ay,az,gx,gy,gz,temperature"))
    assert np.isnan(recording.temperature[100])
    assert np.nanmax(recording.temperature) == 25.0
    assert "1 number(s) of the temperature are beyond -100 to 200" in said(recording)


# -- the command -------------------------------------------------------------------------------------


def test_it_says_what_it_found_and_assumed(bench, tumbled, csv) -> None:
    degree = np.pi / 180
    out = bench("inspect", csv(tumbled.rows() / np.array([0.001, 1, 1, 1, degree, degree, degree]))).out
    good = "Good for\n  • Calibration of the accelerometers and gyros. Procedure hand-held: 12 holds and 11 turns"
    for part in (
        "4050 samples in 40.49 s, 100 Hz",
        "m/s^2",
        "deg/s",
        "assumed",
        "unchecked",
        good,
        "Missing",
    ):
        assert part in out


def test_json_is_one_object_with_everything_and_quiet_prints_warnings_only(bench, tumbled, csv) -> None:
    path, rows = csv(tumbled.rows()), tumbled.rows()
    told = bench("inspect", path, "--json").json
    assert (told["format"], told["version"]) == ("tumble inspection", 1)
    assert told["recordings"][0]["name"] == path.name
    assert told["streams"]["angular_rate"] == {"unit": "rad/s"}
    assert {r["kind"] for r in told["remarks"]} <= {"found", "assumed", "mended", "unchecked"}
    assert (told["samples"], told["quiet_stretches"], told["gaps"]) == (4050, 12, [])
    assert bench("inspect", path, "-q").out == ""
    rows[:, [4, 5]] = rows[:, [5, 4]]
    assert "the rate about x seems to stand in gy" in bench("inspect", csv(rows), "-q").out
    words = "For a calibration without a protocol: both triads, nine or more poses"
    assert words in bench("inspect", csv(rows)).out


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_save_converts(bench, tumbled, csv, tmp_path, ending) -> None:
    rows = tumbled.rows() / np.array([0.001, 9.80665, 9.80665, 9.80665, 1, 1, 1])
    target = tmp_path / f"saved{ending}"
    assert f"Saved as {target}" in bench("inspect", csv(rows, decimals=9), "--save", target).out
    back = read_recording(target)
    assert (back.specific_force_unit, back.angular_rate_unit) == ("g", "rad/s")
    assert np.abs(back.specific_force - rows[:, 1:4]).max() < 1e-9  # nine decimals were written


def test_a_saved_csv_keeps_units_that_would_be_judged_otherwise(bench, tumbled, csv, tmp_path) -> None:
    """A gyro in rad/s that turns faster than 40 rad/s would be taken as deg/s without its unit."""
    rows = tumbled.rows()
    rows[:, 4:] *= 50.0 / np.abs(rows[:, 4:]).max()
    rows[:, 1:4] = at_rest(len(rows)).specific_force
    path = csv(rows, header="t,ax,ay,az,gx [rad/s],gy [rad/s],gz [rad/s]")
    bench("inspect", path, "--save", tmp_path / "saved.csv")
    begin = "t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],"
    assert (tmp_path / "saved.csv").read_text().startswith(begin)
    back = read_recording(tmp_path / "saved.csv")
    assert back.angular_rate_unit == "rad/s"
    assert "taken as" not in said(back)
