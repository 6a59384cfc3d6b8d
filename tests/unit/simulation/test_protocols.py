"""Protocols played, on a table or by hand: where the unit is put, what it then does, and what is recorded of it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import ProtocolError, UsageError
from tumble.protocol import (
    PROTOCOLS,
    HoldStep,
    Pose,
    Protocol,
    RampStep,
    SpinStep,
    Step,
    TurnStep,
    named_protocol,
)
from tumble.sensor import ImuModel, Triad
from tumble.simulation import TableErrors, play_protocol, simulate_protocol
from tumble.simulation.fixtures import PlayedProtocol
from unit.given import given, signals

SITE = Site.from_latitude(np.radians(38.0))
UP_N = np.array([0.0, 0.0, -1.0])
X, Y, Z = np.eye(3)
TILTED = np.array([2.0, -3.0, 6.0]) / 7.0
STILL = Site.from_gravity(9.8)
LEVEL_REST = HoldStep(3.0, Pose(Z, 0.0))
FORCE = Triad(
    np.array([[1.02, 0.03, -0.01], [0.02, 0.97, 0.04], [-0.05, 0.01, 1.05]]), np.array([0.2, -0.1, 0.3])
)
GYRO = Triad(
    np.array([[0.96, -0.02, 0.03], [0.05, 1.01, -0.01], [0.02, 0.04, 1.03]]),
    np.array([1e-3, -2e-3, 5e-4]),
    asymmetry=(ASYMMETRY := np.array([1e-4, -2e-4, 3e-4])),
    quadratic=(QUADRATIC := np.array([2e-3, 1e-3, -3e-3])),
)
BY_FORCE = np.array([[1e-5, -3e-5, 2e-5], [4e-5, 2e-5, -1e-5], [-2e-5, 5e-5, 3e-5]])
MODEL = ImuModel(FORCE, GYRO, BY_FORCE)


def protocol(*steps: Step) -> Protocol:
    return Protocol("test", "multi-position", steps)


def play(*steps, seed=1, placement=True, table=None):
    return play_protocol(protocol(*steps), np.random.default_rng(seed), placement=placement, table=table)


def hold_rotations(played: PlayedProtocol) -> dict[int, Rotation]:
    """The attitude in the middle of each hold that is a step."""
    middle = played.motion.hold_edges.mean(axis=1)
    attitudes = played.motion.rotation_nb(middle)
    return {s: a for s, a in zip(played.hold_steps, attitudes, strict=True) if s is not None}


def up_in(rotation_nb: Rotation) -> np.ndarray:
    return rotation_nb.inv().apply(UP_N)


def raw_of(truth_rate: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The gyro model written out: input, asymmetry, quadratic term, g-sensitivity, bias."""
    u = np.array([sum(GYRO.matrix[i, j] * truth_rate[j] for j in range(3)) for i in range(3)])
    g = np.array([sum(BY_FORCE[i, j] * force[j] for j in range(3)) for i in range(3)])
    return u + ASYMMETRY * abs(u) + QUADRATIC * u**2 + g + GYRO.bias


@pytest.mark.parametrize("name", PROTOCOLS)
def test_every_named_protocol_is_played_in_its_nominal_poses(name: str) -> None:
    given = named_protocol(name)
    played = play_protocol(given, np.random.default_rng(1), placement=False)
    attitudes = hold_rotations(played)
    holds = [k for k, step in enumerate(given.steps) if isinstance(step, HoldStep)]
    assert sorted(attitudes) == holds
    for number in holds:
        step = given.steps[number]
        # round-off of some hundred products of rotations
        np.testing.assert_allclose(up_in(attitudes[number]), step.pose.up_b, atol=1e-12)
    assert np.all(np.isfinite(played.step_edges))
    between = sum(isinstance(a, TurnStep) and isinstance(b, TurnStep) for a, b in pairwise(given.steps))
    if not any(isinstance(step, RampStep) and step.tumbled for step in given.steps):
        assert played.hold_steps.count(None) == between
    lengths = np.diff(played.step_edges, axis=1)[:, 0]
    np.testing.assert_allclose(lengths, [step.duration for step in given.steps], rtol=1e-9)
    assert played.motion.duration == pytest.approx(given.duration + 1.0 * between, rel=1e-12)


def test_a_heading_of_a_quarter_turns_b_s_forward_axis_to_the_east() -> None:
    """With z down and x to the east y is to the south: the Earth's horizontal rate shows there, reversed.

    At 20 kHz an increment is 3.6e-9 rad: a difference of attitudes would leave 3e-8 of it.
    """
    steps = protocol(HoldStep(0.2, Pose(-Z, np.pi / 2)))
    recording, truth = simulate_protocol(steps, 20_000.0, np.random.default_rng(1), site=SITE)
    north, _, down = SITE.earth_rate_n
    rate = signals(recording)[1]
    np.testing.assert_allclose(rate, np.tile([0.0, -north, down], (4000, 1)), rtol=1e-12, atol=1e-19)
    C_nb = truth.rotations_nb.as_matrix()[0]
    np.testing.assert_allclose(C_nb @ X, [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(C_nb, Pose(-Z, np.pi / 2).rotation_nb().as_matrix(), atol=1e-15)


def test_unknown_headings_are_drawn_given_or_zero() -> None:
    steps = (HoldStep(3.0, Pose(-Z)), TurnStep(2.0), HoldStep(3.0, Pose(-X)))

    def headings(**options: object) -> list[float]:
        played = play_protocol(protocol(*steps), np.random.default_rng(3), **options)
        fixed = (
            attitude * Pose(up_b).rotation_nb().inv()
            for attitude, up_b in zip(hold_rotations(played).values(), (-Z, -X), strict=True)
        )
        return [float(turn.as_rotvec()[2]) for turn in fixed]

    np.testing.assert_allclose(headings(placement=False), 0.0, atol=1e-14)
    np.testing.assert_allclose(headings(heading=0.7), 0.7, atol=1e-14)
    np.testing.assert_allclose(headings(heading=np.array([0.1, 9.0, 0.5])), [0.1, 0.5], atol=1e-14)
    drawn = headings()
    assert abs(drawn[0] - drawn[1]) > 0.1


@pytest.mark.parametrize("units", ["SI", "counts"])
def test_without_noise_each_sample_is_the_model_of_the_true_signals(units: str) -> None:
    steps = protocol(
        HoldStep(5.0, Pose(TILTED, 0.4)), SpinStep(10.0, 1.3), HoldStep(5.0), TurnStep(2.0), HoldStep(5.0)
    )
    raw, truth = simulate_protocol(
        steps, 100.0, np.random.default_rng(1), site=SITE, model=MODEL, units=units
    )
    factors = truth.counts_per_si or (1.0, 1.0)
    assert raw.specific_force_unit == ("m/s^2" if units == "SI" else "counts")
    assert (factors[0] != factors[1]) == (units == "counts")
    for number, (start, stop) in enumerate(truth.hold_edges):
        inside = (raw.time > start + 0.01) & (raw.time < stop - 0.01)
        force, rate = truth.specific_force_b[number], truth.angular_rate_ib_b[number]
        # the truth itself is the closed formula: at rest minus gravity, and Earth rate
        attitude = truth.rotations_nb[number].inv()
        np.testing.assert_allclose(force, attitude.apply(SITE.gravity * UP_N), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(rate, attitude.apply(SITE.earth_rate_n), rtol=1e-12, atol=1e-17)
        means = [
            part[inside].mean(axis=0) / factor for part, factor in zip(signals(raw), factors, strict=True)
        ]
        np.testing.assert_allclose(means[0], FORCE.matrix @ force + FORCE.bias, rtol=1e-12)
        np.testing.assert_allclose(means[1], raw_of(rate, force), rtol=1e-12)
    corrected, _ = given(truth.model).correct(*signals(raw))
    np.testing.assert_allclose(corrected[0], truth.specific_force_b[0], rtol=1e-12)


def test_a_spin_s_nonlinear_terms_act_on_the_mean_rate_of_each_sample() -> None:
    steps = protocol(HoldStep(5.0, Pose(TILTED, 0.4)), SpinStep(10.0, -1.3), HoldStep(5.0))
    raw, truth = simulate_protocol(steps, 100.0, np.random.default_rng(1), site=STILL, model=MODEL)
    start, stop = truth.step_edges[1]
    rate = signals(raw)[1][(raw.time > start) & (raw.time < stop)]
    # angles of 15 rad know 2e-15 rad, over samples of 10 ms
    np.testing.assert_allclose(rate, np.tile(raw_of(-1.3 * TILTED, 9.8 * TILTED), (1000, 1)), atol=1e-12)


def test_placement_errors_have_the_pose_s_sigma_about_each_axis() -> None:
    sigma = 0.02
    steps = [HoldStep(1.0, Pose(TILTED, 0.4, sigma)) for _ in range(400)]
    nominal = Pose(TILTED, 0.4).rotation_nb()
    errors = np.array([(nominal.inv() * a).as_rotvec() for a in hold_rotations(play(*steps)).values()])
    # 400 numbers an axis: 3.5 %, four of them; correlations 5 %
    np.testing.assert_allclose(errors.std(axis=0), sigma, rtol=0.15)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=4.0 * sigma / 20.0)
    assert np.abs(np.corrcoef(errors.T) - np.eye(3)).max() < 0.2


def test_a_placement_stays_through_its_spins_and_turns_the_axis_in_b() -> None:
    pose, same = Pose(Z, 0.3, 0.05), HoldStep(3.0, Pose(Z, None, 0.05))
    there, back, anew = SpinStep(10.0, 1.0, Z), SpinStep(10.0, -1.0, Z), HoldStep(3.0, pose)
    played = play(anew, there, same, back, same, TurnStep(2.0), anew, there, HoldStep(3.0))
    attitudes = hold_rotations(played)
    first, second, third = (spin.axis_b for spin in played.spins)
    np.testing.assert_allclose(first, second, atol=1e-14)
    assert 0.005 < np.linalg.norm(first - Z) < 0.25
    assert np.linalg.norm(first - third) > 0.005  # placed anew
    for spin in played.spins:
        # the table did not move: its axis is plumb, and what is up in the unit is its axis there
        np.testing.assert_allclose(spin.axis_n, UP_N, atol=1e-14)
    for number in (0, 2, 4):
        np.testing.assert_allclose(up_in(attitudes[number]), first, atol=1e-13)


def test_a_vertical_spin_goes_about_what_is_up_wherever_that_is() -> None:
    played = play(HoldStep(3.0, Pose(TILTED, None, 0.03)), SpinStep(8.0, -0.9), HoldStep(3.0))
    (spin,) = played.spins
    np.testing.assert_allclose(spin.axis_n, UP_N, atol=1e-14)
    assert spin.rate == pytest.approx(-0.9, rel=1e-14)
    rate = played.motion.angular_rate_ib_b(np.array([spin.start + 1e-9, spin.stop - 1e-9]), STILL)
    np.testing.assert_allclose(rate, [spin.rate * spin.axis_b] * 2, rtol=1e-9)
    assert (spin.start, spin.stop) == tuple(played.step_edges[1])
    assert spin.stop - spin.start == pytest.approx(8.0, rel=1e-14)
    # without a ramp it jumps to its rate
    played = play(HoldStep(3.0, Pose(Z)), SpinStep(8.0, 0.9, ramp=0.0), HoldStep(3.0), placement=False)
    rate = played.motion.angular_rate_ib_b(np.array([2.999, 3.001, 10.999, 11.001]), STILL)
    np.testing.assert_allclose(rate[:, 2], [0.0, 0.9, 0.9, 0.0], atol=1e-14)


def test_rates_and_angles_are_off_by_their_sigma() -> None:
    """200 numbers each: 5 %, four of them; the turns are more than a whole one, and have their sign."""
    spin, turn = SpinStep(5.0, 2.0, sigma=0.01), TurnStep(3.0, X, -8.0, 0.03)
    spun = play(HoldStep(1.0, Pose(Z)), *[spin, HoldStep(1.0)] * 200)
    rates = np.array([one.rate for one in spun.spins])
    assert np.std(rates) == pytest.approx(0.02, rel=0.2)
    assert np.mean(rates) == pytest.approx(2.0, abs=4.0 * 0.02 / np.sqrt(200.0))
    turned = play(HoldStep(1.0, Pose(Z)), *[turn, HoldStep(1.0)] * 200).motion.turn_vector_b
    assert np.std(turned[:, 0]) == pytest.approx(0.03, rel=0.2)
    np.testing.assert_allclose(turned[:, 1:], 0.0, atol=1e-13)
    assert np.mean(turned[:, 0]) == pytest.approx(-8.0, abs=0.01)


def test_a_turn_that_is_known_exactly_decides_the_next_pose() -> None:
    quarter = TurnStep(3.0, X, np.pi / 2)
    played = play(HoldStep(3.0, Pose(Z, 0.2, 0.05)), quarter, HoldStep(3.0, Pose(Y, None, 0.05)))
    before, after = hold_rotations(played).values()
    turn = (before.inv() * after).as_rotvec()
    assert np.linalg.norm(turn) == pytest.approx(np.pi / 2, abs=1e-13)
    # about the box's own axis, which lies a little askew in the misplaced unit
    assert 0.001 < np.linalg.norm(turn / np.linalg.norm(turn) - X) < 0.25


def test_a_pose_that_is_known_better_than_the_turn_decides_where_it_ends() -> None:
    pose = Pose(Y, None, 1e-6)
    rough = TurnStep(3.0, X, np.pi / 2 + 2.0 * np.pi, 0.1)
    played = play(HoldStep(3.0, Pose(Z, 0.2, 1e-6)), rough, HoldStep(3.0, pose))
    after = hold_rotations(played)[2]
    np.testing.assert_allclose(up_in(after), Y, atol=1e-5)
    # the whole turn that was named is made
    assert np.linalg.norm(played.motion.turn_vector_b[0]) == pytest.approx(2.5 * np.pi, abs=1e-4)
    whole = TurnStep(3.0, X, -4.0 * np.pi, 0.1)
    played = play(HoldStep(3.0, Pose(Z, 0.2, 1e-6)), whole, HoldStep(3.0, Pose(Z, None, 1e-6)))
    np.testing.assert_allclose(played.motion.turn_vector_b[0], [-4.0 * np.pi, 0.0, 0.0], atol=1e-4)


def test_what_a_later_hold_knows_is_known_before_the_named_turns_that_lead_to_it() -> None:
    quarter = TurnStep(3.0, X, np.pi / 2)
    unknown, headless, full = HoldStep(3.0), HoldStep(3.0, Pose(Y)), HoldStep(3.0, Pose(-Z, 1.1))
    played = play(unknown, quarter, headless, quarter, full)
    attitudes = hold_rotations(played)
    assert (attitudes[4].inv() * Pose(-Z, 1.1).rotation_nb()).magnitude() < 1e-12
    np.testing.assert_allclose(up_in(attitudes[2]), Y, atol=1e-12)
    np.testing.assert_allclose(up_in(attitudes[0]), Z, atol=1e-12)
    played = play(unknown, quarter, headless)
    np.testing.assert_allclose(up_in(hold_rotations(played)[0]), Z, atol=1e-12)


def test_holds_without_a_pose_are_anyhow_but_differ() -> None:
    steps: list[Step] = [HoldStep(1.0)]
    for _ in range(30):
        steps += [TurnStep(1.0), HoldStep(1.0)]
    ups = np.array([up_in(a) for a in hold_rotations(play(*steps)).values()])
    assert np.arccos(np.clip(np.sum(ups[1:] * ups[:-1], axis=1), -1, 1)).min() > 0.5


def test_a_hand_leaves_the_shortest_way_and_comes_back_to_it() -> None:
    steps = (HoldStep(3.0, Pose(Z, 0.0)), TurnStep(2.0), HoldStep(3.0, Pose(X, 0.0)))
    by_hand, nominal = play(*steps), play(*steps, placement=False)
    np.testing.assert_allclose(by_hand.motion.turn_vector_b, nominal.motion.turn_vector_b, atol=1e-14)

    def off_the_way(played: PlayedProtocol) -> float:
        start, stop = played.step_edges[1]
        away = played.motion.rotation_nb(np.linspace(start, stop, 50))
        axis = nominal.motion.turn_vector_b[0] / np.linalg.norm(nominal.motion.turn_vector_b[0])
        along = (away[0].inv() * away).apply(axis)
        return float(np.linalg.norm(along - axis, axis=1).max())

    assert off_the_way(nominal) < 1e-12
    assert 0.005 < off_the_way(by_hand) < 0.3
    (hold, after) = hold_rotations(by_hand).values()
    assert (hold.inv() * Pose(Z, 0.0).rotation_nb()).magnitude() < 1e-14
    assert (after.inv() * Pose(X, 0.0).rotation_nb()).magnitude() < 1e-14
    assert 1.2 < np.diff(by_hand.step_edges[1])[0] < 2.8
    rest = by_hand.motion.angular_rate_ib_b(np.array([1.0, 6.5]), STILL)
    np.testing.assert_array_equal(rest, 0.0)


def test_a_table_with_a_level_axis_goes_back_to_the_pose_that_the_next_hold_names() -> None:
    pose = Pose(Z, None, 0.01)
    played = play(HoldStep(3.0, pose), SpinStep(10.0, 1.0, X), HoldStep(3.0, pose), seed=4)
    before, after = hold_rotations(played).values()
    # the same placement: the error is the one it was
    np.testing.assert_allclose(up_in(after), up_in(before), atol=1e-12)
    assert played.hold_steps == (0, None, 2)
    turned = np.linalg.norm(played.motion.turn_vector_b[1])
    assert turned == pytest.approx(4.0 * np.pi - 12.0, abs=1e-9)  # 12 rad were turned


def test_a_hold_in_another_pose_after_a_spin_is_a_new_placement() -> None:
    played = play(HoldStep(3.0, Pose(Z)), SpinStep(5.0, 1.0), HoldStep(3.0, Pose(X)), placement=False)
    assert played.hold_steps == (0, None, 2)
    np.testing.assert_allclose(up_in(hold_rotations(played)[2]), X, atol=1e-12)
    table = play(HoldStep(3.0, Pose(Z, 0.0)), SpinStep(5.0, 1.0), HoldStep(3.0, Pose(Z, 0.0)))
    assert (hold_rotations(table)[2].inv() * Pose(Z, 0.0).rotation_nb()).magnitude() < 1e-12


def test_a_protocol_may_begin_and_end_with_anything() -> None:
    played = play(SpinStep(5.0, 1.0, X), TurnStep(2.0), TurnStep(2.0, Y, 1.0), TurnStep(3.0))
    assert np.all(np.isfinite(played.step_edges))
    assert np.all(np.diff(played.step_edges.reshape(-1)) > 0.0)
    assert played.hold_steps == (None,) * 5
    np.testing.assert_allclose(played.spins[0].axis_n, UP_N, atol=1e-14)


def test_an_angle_s_own_uncertainty_is_made_with_the_placement_and_without_it_not() -> None:
    spin = SpinStep(10.0, 1.0, angle=12.0, angle_sigma=1e-3)
    steps = (LEVEL_REST, *[spin, HoldStep(3.0)] * 200)
    played = play(*steps)
    # 200 numbers: 5 %, four of them
    assert np.std([one.angle - 12.0 for one in played.spins]) == pytest.approx(1e-3, rel=0.2)
    assert play(*steps, placement=False).spins[0].angle == 12.0
    read = played.steps[1]
    assert (read.angle, read.angle_sigma) == (12.0, 1e-3)


def test_without_a_table_nothing_else_is_drawn_and_nothing_is_read_off() -> None:
    given = named_protocol("modified-multi-position")
    plain = play_protocol(given, np.random.default_rng(4))
    perfect = play_protocol(given, np.random.default_rng(4), table=TableErrors())
    assert plain.steps == given.steps
    np.testing.assert_array_equal(plain.motion.turn_vector_b, perfect.motion.turn_vector_b)
    shown = [s.angle for s in perfect.steps if isinstance(s, SpinStep)]
    assert shown == [spin.angle for spin in perfect.spins]


def test_a_shaking_table_adds_noise_to_the_accelerometers_while_it_turns_and_only_then() -> None:
    steps = protocol(LEVEL_REST, SpinStep(40.0, 1.0, Z, angle=42.0), HoldStep(3.0))
    (plain, _), (shaken, truth) = (
        simulate_protocol(steps, 100.0, np.random.default_rng(1), site=STILL, table=TableErrors(shake=shake))
        for shake in (0.0, 0.01)
    )
    added = signals(shaken)[0] - signals(plain)[0]
    (was,) = truth.spins
    turning = (shaken.time > was.start - 2.0) & (shaken.time < was.stop + 2.0)
    assert np.array_equal(added[~turning], np.zeros((600, 3)))
    # 4400 numbers an axis: 1.1 %, four of them
    np.testing.assert_allclose(added[turning].std(axis=0), 0.01, rtol=0.045)
    np.testing.assert_allclose(added[turning].mean(axis=0), 0.0, atol=4.5 * 0.01 / np.sqrt(4400.0))


EARLY, Y_UP = TableErrors(stops_early=((2, 0.5),)), HoldStep(3.0, Pose(Y, None, 0.01), "y up")


@pytest.mark.parametrize(
    ("steps", "table", "words"),
    [
        (
            [HoldStep(-1.0, Pose(Z), "z up")],
            None,
            r"Step 1 \(z up\) lasts -1 s: give it a duration above zero",
        ),
        ([TurnStep(2.0, np.zeros(3), 1.0)], None, "Step 1 has an axis of no direction"),
        ([SpinStep(2.0, 0.0)], None, "spins at 0 rad/s: give it a rate that is not zero"),
        ([SpinStep(2.0, 1.0, ramp=-1.0)], None, "a ramp of -1 s: give zero or more"),
        ([LEVEL_REST, TurnStep(3.0, X, -0.5 * np.pi, 0.02), Y_UP], None, r"\(y up\) .* 180\.0 degrees away"),
        (
            [LEVEL_REST, SpinStep(1.0, 1.0, ramp=4.0, angle=3.0)],
            None,
            r"Step 2 turns by 171\.9 .* ramps alone",
        ),
        (
            [LEVEL_REST, SpinStep(9.0, 1.0, angle=-3.0, name="cw")],
            None,
            r"Step 2 \(cw\) .* -171\.887 degrees",
        ),
        ([LEVEL_REST, SpinStep(9.0, 1.0)], EARLY, "stop spin 3 early, .* last one is number 1"),
        ([LEVEL_REST], EARLY, "the protocol has no spin"),
    ],
)
def test_what_cannot_be_played_is_refused(steps: list[Step], table: TableErrors | None, words: str) -> None:
    with pytest.raises(ProtocolError if table is None else UsageError, match=words):
        play(*steps, table=table)


@pytest.mark.parametrize(
    ("rate", "options", "words"),
    [
        (1.0, {}, r"turns by 229 degrees\. A gyro sample of half a turn or more"),
        (100.0, {"units": "mg"}, "SI or counts, not in 'mg'"),
        (100.0, {"model": replace(MODEL, gyroscope=None)}, "one triad only"),
        (-3.0, {}, "at -3 Hz has no sample"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_words(rate, options, words):
    spin = protocol(HoldStep(3.0, Pose(Z)), SpinStep(10.0, 4.0), HoldStep(3.0))
    with pytest.raises(UsageError, match=words):
        simulate_protocol(spin, rate, np.random.default_rng(1), site=SITE, **options)
