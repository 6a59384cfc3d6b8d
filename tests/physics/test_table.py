"""What physics promises of a table, with errors and without: it rests where it rests, and its motion is one motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep
from tumble.simulation import TableErrors, play_protocol, simulate_protocol

SITE = Site.from_latitude(np.radians(-33.0))
STILL = Site.from_gravity(9.79)
X, Y, Z = np.eye(3)
AXIS_B = np.array([3.0, 6.0, 2.0]) / 7.0
UP_B = np.array([2.0, -3.0, 6.0]) / 7.0  # across the axis: it lies level
ARM = np.array([0.05, -0.03, 0.02])
REST = HoldStep(3.0, Pose(UP_B, 0.4))
TURN = 4.0 * np.pi  # two revolutions
# Large, so that what is of the second order shows.
ERRORS = TableErrors(
    angle_sigma=2e-3, once=1e-3, twice=5e-4, axis_tilt=0.02, wobble=0.01, ripple=0.03, ramp_spread=0.2
)


def spin(way, angle=TURN):
    return SpinStep(angle / 0.8 - 2.0, way * 0.8, AXIS_B, ramp=2.0, angle=way * angle)


def play(*ways, table=None, seed=3, arm=None):
    """Spins one after another at rest before and after, each two revolutions."""
    steps = [REST]
    for way in ways:
        steps += [spin(way), REST]
    protocol = Protocol("t", "turntable", tuple(steps))
    return play_protocol(protocol, np.random.default_rng(seed), placement=False, table=table, lever_arm_b=arm)


def increments(motion, start, stop, count=4000):
    edges = np.linspace(start, stop, count + 1)
    return motion.mean_angular_rate_ib_b(edges, STILL) * np.diff(edges)[:, None]


def turned(played, number):
    """Sum of the gyro's increments from the rest before a spin to the rest after it."""
    holds = played.motion.hold_edges
    return increments(played.motion, holds[number].mean(), holds[number + 1].mean()).sum(axis=0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_gyros_turn_by_the_true_angle_which_is_the_display_s_and_an_error(way):
    table = TableErrors(angle_sigma=2e-3, axis_tilt=0.02, ripple=0.03, ramp_spread=0.2, once=1e-3)
    played = play(way, table=table)
    (truth,) = played.spins
    assert truth.shown == way * TURN
    assert 1e-4 < abs(truth.angle - truth.shown) < 1e-2
    # A fixed axis: increments add up. 4000 of them, each good to the last digit of 12 rad.
    np.testing.assert_allclose(turned(played, 0), truth.angle * truth.axis_b, atol=1e-11)
    assert 0.003 < np.linalg.norm(truth.axis_b - AXIS_B) < 0.1
    step = played.steps[1]
    assert isinstance(step, SpinStep)
    assert (step.angle, step.angle_sigma) == (truth.shown, 2e-3)


def test_both_ways_have_errors_of_their_own_and_one_tilt():
    played = play(1.0, -1.0, table=TableErrors(angle_sigma=2e-3, axis_tilt=0.02))
    one, other = played.spins
    assert abs(one.angle + other.angle) > 1e-4
    np.testing.assert_allclose(one.axis_b, other.axis_b, atol=1e-14)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_after_whole_revolutions_wobble_and_ripple_have_led_home_and_rest(way):
    played = play(way, table=TableErrors(wobble=0.01, ripple=0.03, once=1e-3, twice=1e-3))
    motion = played.motion
    before, after = motion.rotation_nb(np.array([1.0, motion.duration - 1.0]))
    np.testing.assert_allclose(after.as_matrix(), before.as_matrix(), atol=1e-13)
    at_rest = np.array([1.0, 2.9999, motion.duration - 2.9999, motion.duration - 1.0])
    np.testing.assert_array_equal(motion.angular_rate_ib_b(at_rest, STILL), 0.0)
    chained = Rotation.identity()
    for turn in Rotation.from_rotvec(increments(motion, 0.0, motion.duration, 1000)):
        chained = chained * turn
    # 1000 products, each good to one unit in the last place
    np.testing.assert_allclose(chained.as_matrix(), np.eye(3), atol=1e-12)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_wobbling_axis_leaves_its_mean_by_the_half_angle_of_its_cone(way):
    played = play(way, table=TableErrors(wobble=1e-5))
    time = np.linspace(6.0, 6.0 + 2.0 * np.pi / 0.8, 721)
    rate = played.motion.angular_rate_ib_b(time, STILL)
    np.testing.assert_allclose(rate @ AXIS_B, way * 0.8, rtol=1e-9)  # second order: 1e-10
    across = rate / (way * 0.8) - AXIS_B
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), 1e-5, rtol=1e-4)
    # Once a revolution in the room, against the turn: twice in the unit. Over a whole one nothing is left but
    # the second order, 5e-11.
    np.testing.assert_allclose(across[:-1].mean(axis=0), 0.0, atol=1e-10)
    in_room = played.motion.rotation_nb(time).apply(across)
    first, axis_n = in_room[0] / 1e-5, played.motion.rotation_nb(time[:1])[0].apply(AXIS_B)
    angle = np.unwrap(np.arctan2(in_room @ np.cross(axis_n, first), in_room @ first))
    assert angle[-1] == pytest.approx(-way * 2.0 * np.pi, rel=1e-4)


def test_a_ripple_moves_the_rate_by_its_share_so_often_a_revolution():
    played = play(1.0, table=TableErrors(ripple=0.01, ripple_cycles=5))
    time = np.linspace(6.0, 6.0 + 2.0 * np.pi / 0.8, 2001)[:-1]
    rate = played.motion.angular_rate_ib_b(time, STILL) @ AXIS_B
    assert np.ptp(rate) == pytest.approx(2.0 * 0.01 * 0.8, rel=1e-3)
    assert np.argmax(np.abs(np.fft.rfft(rate - rate.mean()))) == 5


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_rates_attitudes_and_forces_are_of_one_motion(way):
    """Differences of the attitude over 1 ms give the rate, second ones of the arm's end the force."""
    motion = play(way, table=ERRORS, arm=ARM).motion
    time = np.linspace(2.9, motion.duration - 2.9, 400)
    step = 1e-3
    before, at, after = (motion.rotation_nb(time + shift) for shift in (-step, 0.0, step))
    slope = (before.inv() * after).as_rotvec() / (2.0 * step)
    # The jerk of a ramp times the square of the step.
    np.testing.assert_allclose(slope, motion.angular_rate_ib_b(time, STILL), atol=2e-6)
    acceleration_n = (before.apply(ARM) - 2.0 * at.apply(ARM) + after.apply(ARM)) / step**2
    force = at.inv().apply(acceleration_n - [0.0, 0.0, 9.79])
    # 0.06 m to 16 digits over the square of the step: 1e-11; the jerk's rate of change: 1e-6.
    np.testing.assert_allclose(force, motion.specific_force_b(time, STILL), atol=2e-6)
    assert np.ptp(np.linalg.norm(force, axis=1)) > 0.02


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_about_a_level_axis_the_force_along_it_stays_whatever_ramps_and_arm_do(way):
    table = TableErrors(ripple=0.03, ramp_spread=0.3, axis_tilt=0.05)
    played = play(way, table=table, arm=ARM)
    time = np.linspace(0.0, played.motion.duration, 3000)
    force = played.motion.specific_force_b(time, STILL)
    axis_b = played.spins[0].axis_b
    np.testing.assert_allclose(force @ axis_b, force[0] @ axis_b, atol=1e-12)
    assert abs(force[0] @ axis_b) > 0.05  # it leans: gravity has a part along it
    assert np.ptp(force @ UP_B) > 19.0


def test_an_arm_for_each_accelerometer_gives_each_its_own_component():
    arms = np.array([[0.05, -0.03, 0.02], [0.01, 0.04, -0.02], [-0.03, 0.02, 0.06]])
    time = np.linspace(2.0, 20.0, 500)
    each = play(1.0, table=ERRORS, arm=arms).motion.specific_force_b(time, STILL)
    for axis in range(3):
        alone = play(1.0, table=ERRORS, arm=arms[axis]).motion.specific_force_b(time, STILL)
        np.testing.assert_array_equal(each[:, axis], alone[:, axis])


def test_uneven_ramps_take_what_they_take_and_the_angle_is_the_same():
    played = play(1.0, -1.0, table=TableErrors(ramp_spread=0.2))
    ramps = [s.ramps for s in played.spins]
    assert len({*ramps[0], *ramps[1]}) == 4
    for truth, (up, down) in zip(played.spins, ramps, strict=True):
        rate = played.motion.angular_rate_ib_b(
            np.array(
                [truth.start + 1e-6, truth.stop - 1e-6, truth.start - 0.5 * up, truth.stop + 0.5 * down]
            ),
            STILL,
        )
        # Half a ramp is half the rate.
        np.testing.assert_allclose(rate @ AXIS_B, truth.rate * np.array([1.0, 1.0, 0.5, 0.5]), rtol=1e-9)
        assert truth.angle == pytest.approx(truth.shown, rel=1e-14)
        assert (truth.stop - truth.start + 0.5 * (up + down)) * abs(truth.rate) == pytest.approx(TURN)


def test_systematic_errors_of_the_angle_come_back_when_the_table_does():
    table = TableErrors(once=2e-3, twice=1e-3, stops_early=((0, 0.3), (1, 0.3)))
    there, back = play(1.0, -1.0, table=table).spins
    assert there.shown == pytest.approx(0.3 * TURN)
    assert back.shown == pytest.approx(-0.3 * TURN)
    assert abs(there.angle - there.shown) > 1e-4
    assert there.angle + back.angle == pytest.approx(0.0, abs=1e-14)


def test_a_table_that_stops_early_stays_there_and_the_display_says_so():
    """From z up, 630° clockwise about x is 90° counter-clockwise, and brings y up; not -y."""
    rest = HoldStep(3.0, Pose(Z, None, 1e-5))
    cw = SpinStep(178.0, np.radians(-10.0), X, angle=np.radians(-1800.0))
    ccw = SpinStep(178.0, np.radians(10.0), X, angle=np.radians(1800.0))
    protocol = Protocol("t", "turntable", (rest, cw, rest, ccw, rest))
    table = TableErrors(stops_early=((0, 0.35),))
    played = play_protocol(protocol, np.random.default_rng(2), placement=False, table=table)
    _, spun, after, back, last = played.steps
    assert isinstance(spun, SpinStep)
    assert isinstance(back, SpinStep)
    assert spun.angle == pytest.approx(np.radians(-630.0))
    assert back.angle == pytest.approx(np.radians(1800.0))
    force = played.motion.specific_force_b(played.motion.hold_edges.mean(axis=1), STILL)
    np.testing.assert_allclose(force, 9.79 * np.array([Z, Y, Y]), atol=1e-12)
    for hold in (after, last):
        assert isinstance(hold, HoldStep)
        assert hold.pose is not None
        np.testing.assert_allclose(hold.pose.up_b, Y, atol=1e-12)
        assert hold.pose.heading is None
        assert hold.pose.sigma == 1e-5


# Without errors, on the Earth and on one that stands still ------------------------------------------


def table(rate, seconds, axis_b=None):
    """Five seconds of rest, a spin, five seconds of rest."""
    rest = HoldStep(5.0, Pose(UP_B, 0.4))
    return Protocol("table", "rate-table", (rest, SpinStep(seconds, rate, axis_b), HoldStep(5.0)))


def played(rate, seconds, axis_b=None):
    return play_protocol(table(rate, seconds, axis_b), np.random.default_rng(1)).motion


def chained(rates, step):
    """The rotation by which increments lead from the first b to the last."""
    turned = Rotation.identity()
    for increment in Rotation.from_rotvec(rates * step):
        turned = turned * increment
    return turned


def spin_rates(rate, site):
    """Gyro samples of three revolutions, each a whole number of samples."""
    period = 2.0 * np.pi / abs(rate)
    hertz = 400.0 / period
    recording, truth = simulate_protocol(
        table(rate, 4.0 * period), hertz, np.random.default_rng(1), site=site, placement=False
    )
    assert recording.angular_rate is not None
    first = int(np.searchsorted(recording.time, truth.step_edges[1, 0]))
    return recording.angular_rate[first : first + 3 * 400], truth


def test_before_and_after_a_spin_the_specific_force_is_minus_gravity():
    recording, truth = simulate_protocol(
        table(0.5, 20.0), 50.0, np.random.default_rng(1), site=SITE, placement=False
    )
    assert recording.specific_force is not None
    for start, stop in truth.hold_edges:
        inside = (recording.time > start + 0.02) & (recording.time < stop - 0.02)
        force = recording.specific_force[inside]
        # about a plumb axis gravity stays where it is in b: round-off only
        np.testing.assert_allclose(force, np.tile(SITE.gravity * UP_B, (len(force), 1)), atol=1e-13)


@pytest.mark.parametrize("axis_b", [None, AXIS_B, np.array([0.6, 0.0, -0.8])])
def test_a_spin_of_whole_revolutions_leads_home_on_an_earth_that_stands_still(axis_b):
    # 12 s and two ramps of 2 s at 2π/7 rad/s: two revolutions
    motion = played(2.0 * np.pi / 7.0, 12.0, axis_b)
    edges = np.linspace(0.0, motion.duration, 1301)
    rates = motion.mean_angular_rate_ib_b(edges, STILL)
    # 1300 products, each good to one unit in the last place
    np.testing.assert_allclose(chained(rates, edges[1]).as_matrix(), np.eye(3), atol=1e-12)
    # and it did go round: the way is two whole turns
    assert np.sum(np.linalg.norm(rates, axis=1)) * edges[1] == pytest.approx(4.0 * np.pi, rel=1e-9)


def test_on_the_turning_earth_it_leads_home_after_the_earth_s_own_turn_is_removed():
    motion = played(-2.0 * np.pi / 7.0, 12.0, AXIS_B)
    edges = np.linspace(0.0, motion.duration, 1301)
    turned = chained(motion.mean_angular_rate_ib_b(edges, SITE), edges[1])
    C_nb = motion.rotation_nb(edges[:1])[0]
    earth = Rotation.from_rotvec(motion.duration * C_nb.inv().apply(SITE.earth_rate_n))
    np.testing.assert_allclose((earth.inv() * turned).as_matrix(), np.eye(3), atol=1e-12)
    # 26 s of Earth rate, 1.9 mrad, were there to be removed
    assert turned.magnitude() == pytest.approx(26.0 * 7.292115e-5, rel=1e-9)


@pytest.mark.parametrize("rate", [0.7, -0.7])
def test_the_mean_over_whole_revolutions_is_the_rate_and_the_earth_s_vertical_part(rate):
    rates, truth = spin_rates(rate, SITE)
    up_earth_rate = -SITE.earth_rate_n[2]
    assert up_earth_rate < -3.9e-5  # south of the equator the Earth turns about what is down there
    # second order in the Earth rate: its square over the rate, 7e-9 of it
    np.testing.assert_allclose(rates.mean(axis=0), (rate + up_earth_rate) * UP_B, atol=1e-13)
    # while a single sample sees the horizontal part go round
    assert np.ptp(rates @ AXIS_B) == pytest.approx(2.0 * SITE.earth_rate_n[0], rel=1e-3)
    assert truth.spins[0].rate == pytest.approx(rate, rel=1e-14)


def test_about_a_level_axis_gravity_goes_round_once_a_revolution_and_the_other_way():
    motion = played(0.5, 30.0, AXIS_B)
    start = 5.0 + 2.0
    time = start + np.linspace(0.0, 4.0 * np.pi, 241)  # one revolution at 0.5 rad/s
    force = motion.specific_force_b(time, STILL)
    np.testing.assert_allclose(force @ AXIS_B, 0.0, atol=1e-13)
    third = np.cross(AXIS_B, UP_B)
    angle = np.unwrap(np.arctan2(force @ third, force @ UP_B))
    # what stands still in n turns against the unit in b
    np.testing.assert_allclose(np.diff(angle), -2.0 * np.pi / 240.0, rtol=1e-10)
    assert angle[-1] - angle[0] == pytest.approx(-2.0 * np.pi, rel=1e-12)


def test_about_a_leaning_axis_the_mean_force_is_gravity_s_part_along_it():
    axis_b = np.array([0.0, 0.6, 0.8])
    motion = played(0.5, 30.0, axis_b)
    time = 7.0 + np.arange(240) / 240.0 * 4.0 * np.pi
    force = motion.specific_force_b(time, STILL)
    np.testing.assert_allclose(force.mean(axis=0), 9.79 * (UP_B @ axis_b) * axis_b, atol=1e-12)


def test_a_unit_off_the_table_s_centre_feels_rate_squared_times_its_distance():
    lever_arm_b = np.array([0.3, -0.2, 0.1])
    motion = play_protocol(table(2.0, 20.0), np.random.default_rng(1), lever_arm_b=lever_arm_b).motion
    force = motion.specific_force_b(np.array([15.0]), STILL)[0]
    out = lever_arm_b - (lever_arm_b @ UP_B) * UP_B
    np.testing.assert_allclose(force, 9.79 * UP_B - 4.0 * out, atol=1e-12)
