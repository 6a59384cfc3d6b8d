"""Names of columns in the spellings of many programs, and the option that overrules them."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.recording import read_recording
from tumble.recording.columns import plan_from_names, role_of


def header(time: str, force: str, rate: str, axes: str = "xyz") -> tuple[str, ...]:
    """Names of seven columns: those of the triads with an axis in place of the braces."""
    return (time, *(name.format(axis) for name in (force, rate) for axis in axes))


HEADERS = {
    "plain": header("t", "a{}", "g{}"),
    "underscores": header("time", "acc_{}", "gyro_{}"),
    "capitals": header("Timestamp", "Acc{}", "Gyro{}", "XYZ"),
    "spelled out": header("stamp", "accel_{}", "omega_{}"),
    "ROS": header("header.stamp", "linear_acceleration.{}", "angular_velocity.{}"),
    "EuRoC, gyro later": header("#timestamp [ns]", "a_RS_S_{} [m s^-2]", "w_RS_S_{} [rad s^-1]"),
    "PX4": header("timestamp", "accelerometer_m_s2[{}]", "gyro_rad[{}]", "012"),
    "MAVLink": header("time_usec", "{}acc", "{}gyro"),
    "field's words": header("t", "specific_force_{}", "angular_rate_{}"),
    "w": header("t", "a{}", "w{}"),
    "units in brackets": header("t [s]", "a{} (g)", "g{} (deg/s)"),
    "phone": (
        "seconds_elapsed",
        *(f"Accelerometer {axis} (m/s²)" for axis in "XYZ"),
        *(f"Gyroscope {axis} (rad/s)" for axis in "xyz"),
    ),
}


@pytest.mark.parametrize("names", HEADERS.values(), ids=HEADERS.keys())
def test_the_columns_of_many_programs_are_known(names) -> None:
    plan = plan_from_names(names)
    assert plan is not None
    assert plan.time == 0
    assert plan.triads["a"] == ((1, 1.0), (2, 1.0), (3, 1.0))
    assert plan.triads["g"] == ((4, 1.0), (5, 1.0), (6, 1.0))


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("temperature", ("temperature", None)),
        ("Temp [degC]", ("temperature", "degC")),
        ("imu_temperature", ("temperature", None)),
        ("mag_x", ("mx", None)),
        ("magnetometer_y", ("my", None)),
        ("quaternion_z", None),
        ("latitude", None),
        ("velocity_x", None),
        ("x", None),
        ("index", None),
        ("timezone", None),
        ("acc_y [mg]", ("ay", "mg")),
    ],
)
def test_a_single_name_has_its_role(name, role) -> None:
    assert role_of(name) == role


def test_units_in_the_header_are_taken_over() -> None:
    plan = plan_from_names(HEADERS["units in brackets"])
    assert plan is not None
    assert tuple(plan.units[kind] for kind in "tag") == ("s", "g", "deg/s")


def test_the_option_permutes_skips_and_reverses(tumbled, csv) -> None:
    rows = np.column_stack([tumbled.rows(), np.full(len(tumbled.time), 25.0)])
    rows = rows[:, [7, 3, 1, 2, 0, 6, 4, 5]]  # temperature, az, ax, ay, t, gz, gx, gy
    rows[:, 3] *= -1.0
    path = csv(rows, header=None)
    recording = read_recording(path, columns="temp,az,ax,-ay,t,gz,gx,gy")
    assert np.abs(recording.specific_force - tumbled.specific_force).max() < 5.1e-7  # written to 6 decimals
    assert np.abs(recording.angular_rate - tumbled.angular_rate).max() < 5.1e-7
    assert recording.temperature is not None
    lone = read_recording(path, columns="-,az,ax,-ay,_,_", rate=100.0)
    assert lone.angular_rate is None
    assert lone.temperature is None


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5, 6), (0, 4, 5, 6, 1, 2, 3), (1, 2, 3, 4, 5, 6, 0)])
def test_columns_without_names_are_told_by_their_content(tumbled, csv, order) -> None:
    recording = read_recording(csv(tumbled.rows()[:, order], header=None))
    assert np.abs(recording.specific_force - tumbled.specific_force).max() < 5.1e-7
    assert np.abs(recording.angular_rate - tumbled.angular_rate).max() < 5.1e-7
    assert any(r.kind == "assumed" and "names no columns" in r.text for r in recording.remarks)


def test_the_real_recording_is_told_by_its_content(reference_data) -> None:
    """Order and units are what the recording's authors say, see its SOURCE.md."""
    recording = read_recording(reference_data / "mpu9150" / "imu0-first-16-s.log", rate=100.0)
    assert len(recording) == 1600
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")
    assert recording.specific_force[0].tolist() == [-8.42090, 0.06710, 5.24511]
    assert recording.angular_rate[0].tolist() == [0.03515, 0.00213, 0.04155]
