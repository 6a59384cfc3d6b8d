"""What physics promises of a unit on a turning table: on the Earth, about axes that are plumb and that are not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep
from tumble.simulation import Motion, Truth, simulate_protocol
from tumble.simulation.fixtures import play_protocol

SITE = Site.from_latitude(np.radians(-33.0))
STILL = Site.from_gravity(9.79)
UP_B = np.array([2.0, -3.0, 6.0]) / 7.0
ACROSS_B = np.array([3.0, 6.0, 2.0]) / 7.0  # perpendicular to UP_B


def table(rate: float, seconds: float, axis_b: np.ndarray | None = None) -> Protocol:
    """Five seconds of rest, a spin, five seconds of rest."""
    rest = HoldStep(5.0, Pose(UP_B, 0.4))
    return Protocol("table", "rate-table", (rest, SpinStep(seconds, rate, axis_b), HoldStep(5.0)))


def played(rate: float, seconds: float, axis_b: np.ndarray | None = None) -> Motion:
    return play_protocol(table(rate, seconds, axis_b), np.random.default_rng(1)).motion


def chained(rates: np.ndarray, step: float) -> Rotation:
    """The rotation by which increments lead from the first b to the last."""
    turned = Rotation.identity()
    for increment in Rotation.from_rotvec(rates * step):
        turned = turned * increment
    return turned


def spin_rates(rate: float, site: Site) -> tuple[np.ndarray, Truth]:
    """Gyro samples of three revolutions, each a whole number of samples."""
    period = 2.0 * np.pi / abs(rate)
    hertz = 400.0 / period
    recording, truth = simulate_protocol(
        table(rate, 4.0 * period), hertz, np.random.default_rng(1), site=site, placement=False
    )
    assert recording.angular_rate is not None
    first = int(np.searchsorted(recording.time, truth.step_edges[1, 0]))
    return recording.angular_rate[first : first + 3 * 400], truth


def test_before_and_after_a_spin_the_specific_force_is_minus_gravity() -> None:
    recording, truth = simulate_protocol(
        table(0.5, 20.0), 50.0, np.random.default_rng(1), site=SITE, placement=False
    )
    assert recording.specific_force is not None
    for start, stop in truth.hold_edges:
        inside = (recording.time > start + 0.02) & (recording.time < stop - 0.02)
        force = recording.specific_force[inside]
        # about a plumb axis gravity stays where it is in b: round-off only
        np.testing.assert_allclose(force, np.tile(SITE.gravity * UP_B, (len(force), 1)), atol=1e-13)


@pytest.mark.parametrize("axis_b", [None, ACROSS_B, np.array([0.6, 0.0, -0.8])])
def test_a_spin_of_whole_revolutions_leads_home_on_an_earth_that_stands_still(
    axis_b: np.ndarray | None,
) -> None:
    # 12 s and two ramps of 2 s at 2π/7 rad/s: two revolutions
    motion = played(2.0 * np.pi / 7.0, 12.0, axis_b)
    edges = np.linspace(0.0, motion.duration, 1301)
    rates = motion.mean_angular_rate_ib_b(edges, STILL)
    # 1300 products, each good to one unit in the last place
    np.testing.assert_allclose(chained(rates, edges[1]).as_matrix(), np.eye(3), atol=1e-12)
    # and it did go round: the way is two whole turns
    assert np.sum(np.linalg.norm(rates, axis=1)) * edges[1] == pytest.approx(4.0 * np.pi, rel=1e-9)


def test_on_the_turning_earth_it_leads_home_after_the_earth_s_own_turn_is_removed() -> None:
    motion = played(-2.0 * np.pi / 7.0, 12.0, ACROSS_B)
    edges = np.linspace(0.0, motion.duration, 1301)
    turned = chained(motion.mean_angular_rate_ib_b(edges, SITE), edges[1])
    C_nb = motion.rotation_nb(edges[:1])[0]
    earth = Rotation.from_rotvec(motion.duration * C_nb.inv().apply(SITE.earth_rate_n))
    np.testing.assert_allclose((earth.inv() * turned).as_matrix(), np.eye(3), atol=1e-12)
    # 26 s of Earth rate, 1.9 mrad, were there to be removed
    assert turned.magnitude() == pytest.approx(26.0 * 7.292115e-5, rel=1e-9)


@pytest.mark.parametrize("rate", [0.7, -0.7])
def test_the_mean_over_whole_revolutions_is_the_rate_and_the_earth_s_vertical_part(rate: float) -> None:
    rates, truth = spin_rates(rate, SITE)
    up_earth_rate = -SITE.earth_rate_n[2]
    assert up_earth_rate < -3.9e-5  # south of the equator the Earth turns about what is down there
    # second order in the Earth rate: its square over the rate, 7e-9 of it
    np.testing.assert_allclose(rates.mean(axis=0), (rate + up_earth_rate) * UP_B, atol=1e-13)
    # while a single sample sees the horizontal part go round
    assert np.ptp(rates @ ACROSS_B) == pytest.approx(2.0 * SITE.earth_rate_n[0], rel=1e-3)
    assert truth.spins[0].rate == pytest.approx(rate, rel=1e-14)


def test_about_a_level_axis_gravity_goes_round_once_a_revolution_and_the_other_way() -> None:
    motion = played(0.5, 30.0, ACROSS_B)
    start = 5.0 + 2.0
    time = start + np.linspace(0.0, 4.0 * np.pi, 241)  # one revolution at 0.5 rad/s
    force = motion.specific_force_b(time, STILL)
    np.testing.assert_allclose(force @ ACROSS_B, 0.0, atol=1e-13)
    third = np.cross(ACROSS_B, UP_B)
    angle = np.unwrap(np.arctan2(force @ third, force @ UP_B))
    # what stands still in n turns against the unit in b
    np.testing.assert_allclose(np.diff(angle), -2.0 * np.pi / 240.0, rtol=1e-10)
    assert angle[-1] - angle[0] == pytest.approx(-2.0 * np.pi, rel=1e-12)


def test_about_a_leaning_axis_the_mean_force_is_gravity_s_part_along_it() -> None:
    axis_b = np.array([0.0, 0.6, 0.8])
    motion = played(0.5, 30.0, axis_b)
    time = 7.0 + np.arange(240) / 240.0 * 4.0 * np.pi
    force = motion.specific_force_b(time, STILL)
    np.testing.assert_allclose(force.mean(axis=0), 9.79 * (UP_B @ axis_b) * axis_b, atol=1e-12)


def test_a_unit_off_the_table_s_centre_feels_rate_squared_times_its_distance() -> None:
    lever_arm_b = np.array([0.3, -0.2, 0.1])
    motion = play_protocol(table(2.0, 20.0), np.random.default_rng(1), lever_arm_b=lever_arm_b).motion
    force = motion.specific_force_b(np.array([15.0]), STILL)[0]
    out = lever_arm_b - (lever_arm_b @ UP_B) * UP_B
    np.testing.assert_allclose(force, 9.79 * UP_B - 4.0 * out, atol=1e-12)
