"""What physics promises of a table, with errors and without: it rests where it rests, and its motion is one motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep
from tumble.simulation import TableErrors, play_protocol, simulate_protocol

SITE = Site.from_latitude(np.radians(-33.0))
STILL = Site.from_gravity(9.79)
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
    first = int(np.searchsorted(recording.time, truth.step_edges[1, 0]))
    return recording.angular_rate[first : first + 3 * 400], truth


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
