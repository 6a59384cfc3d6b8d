"""Predictions of whole protocols: their information, steps, and what to add, against first principles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.calibration.equations.causes import RATE_WANDER
from tumble.calibration.equations.imu_unknowns import PLAIN, imu_unknowns
from tumble.design.joint_information import (
    GROUPS,
    NAMES,
    JointInformation,
    information_in_names,
    parameter_sizes,
    parameters_of,
    planned_problem,
)
from tumble.design.joint_plan import JointPlan, PlanTask, clock_variances, plan_protocol, true_covariance
from tumble.design.next_step import (
    Aim,
    StepCandidate,
    find_next_steps,
    judge_stop,
    step_candidates,
    usual_pose,
    what_would_tell,
)
from tumble.design.planned_motion import PlannedNoise, planned_data, play_plan
from tumble.design.step_worth import find_step_worths, with_longer_step
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.estimation.solve import linearise
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep, named_protocol
from tumble.simulation import TriadNoise, find_grade
from tumble.simulation.noise import simulate_wander

SITE = replace(Site.from_latitude(0.8), gravity_sigma=0.0)
TACTICAL = find_grade("tactical")


def faces(*ups: tuple[int, int, int], seconds: float = 10.0) -> Protocol:
    steps: list[HoldStep | TurnStep] = []
    for up in ups:
        steps += [TurnStep(2.0)] if steps else []
        vector = np.array(up, dtype=float)
        steps.append(HoldStep(seconds, Pose(vector / np.linalg.norm(vector), None, 0.05), str(up)))
    return Protocol("faces", "hand-held", tuple(steps))


@pytest.fixture(scope="module")
def hand_held() -> JointPlan:
    return plan_protocol(PlanTask.of_grade(named_protocol("hand-held"), TACTICAL, SITE, draws=2))


@pytest.fixture(scope="module")
def table() -> JointPlan:
    """Two holds, and one turn of a table both ways about x."""
    up = Pose(np.array([0.0, 0.0, 1.0]), None, 0.05)
    rate, ramp = np.radians(10.0), 1.0
    spins = [
        SpinStep(
            35.0,
            sign * rate,
            np.array([1.0, 0.0, 0.0]),
            ramp=ramp,
            angle=sign * 36.0 * rate,
            angle_sigma=1e-5,
        )
        for sign in (1.0, -1.0)
    ]
    steps = (HoldStep(8.0, up), spins[0], HoldStep(8.0, up), spins[1], HoldStep(8.0, up))
    return plan_protocol(PlanTask.of_grade(Protocol("both ways", "joint", steps), TACTICAL, SITE, draws=1))


@pytest.mark.parametrize("name", ["hand_held", "table"])
def test_the_information_is_that_of_the_estimator_itself(name: str, request: pytest.FixtureRequest) -> None:
    """The plan assembles the estimator's equations its own way, to eliminate a rotation only once."""
    problem = request.getfixturevalue(name).problem
    _, normal, _ = linearise(problem.task)
    wanted = information_in_names(normal)
    size = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    # the same sums in the same order
    assert np.max(np.abs(problem.information().matrix - wanted) / np.maximum(size, 1e-30)) < 1e-9


def test_four_times_the_time_of_white_noise_halves_what_holds_tell() -> None:
    noise = PlannedNoise(TriadNoise(random_walk=1e-3), TriadNoise(random_walk=1e-5), 100.0)
    task = replace(PlanTask.of_grade(named_protocol("hand-held"), TACTICAL, SITE, draws=1), noise=noise)
    played = play_plan(task.protocol, SITE, np.random.default_rng([0, 0]))
    sigmas: list[np.ndarray] = []
    for factor in (1.0, 4.0):
        stretch = np.full(len(played.holds), factor)
        data = planned_data(played, noise, stretch=stretch)
        covariance = task.covariance(planned_problem(data, SITE, task.sizes).information())
        sigmas.append(np.sqrt(np.diag(covariance)))
    ratio = sigmas[1][GROUPS["accelerometer bias"]] / sigmas[0][GROUPS["accelerometer bias"]]
    # the turns tell a little, too, and last as long as before
    assert np.all((ratio > 0.49) & (ratio < 0.56))
    # gyro biases are what holds of 4 s are told by: N / sqrt(26 * 4 s), and the edges that are cut off
    expected = 1e-5 / np.sqrt(np.sum((played.holds[:, 1] - played.holds[:, 0]) / played.recording.rate))
    assert sigmas[0][GROUPS["gyro bias"]] == pytest.approx(np.full(3, expected), rel=0.1)


def test_without_wander_the_covariance_is_the_estimators_own(hand_held: JointPlan) -> None:
    """Independent holds and turns, the wander of each its own: both ways to the covariance meet."""
    task, problem = hand_held.task, hand_held.problem
    influences = problem.influences(task.known_before(), g_sensitivity=task.g_sensitivity)
    alone = np.sqrt(np.diag(problem.in_names(influences.independent))[task.parameters()])
    # the same matrix, inverted once with and once without attitudes in it
    assert alone == pytest.approx(
        np.sqrt(np.diag(task.covariance(hand_held.information))[task.parameters()]), rel=1e-9
    )


def test_what_is_foretold_is_what_drawn_wanders_do_to_the_estimate() -> None:
    """Flicker drawn over the whole session, seen by the holds and turns as means, moves the gyro biases as foretold.

    The gains are the estimator's own; the wander is a random walk of many Gauss-Markov processes, not the closed form.
    """
    flicker = TriadNoise(random_walk=1e-6, bias_instability=1e-4)
    noise = PlannedNoise(TriadNoise(random_walk=1e-4), flicker, 100.0)
    task = replace(PlanTask.of_grade(named_protocol("hand-held"), TACTICAL, SITE, draws=1), noise=noise)
    played = play_plan(task.protocol, SITE, np.random.default_rng([0, 0]))
    problem = planned_problem(planned_data(played, noise), SITE, task.sizes)
    influences = problem.influences(task.known_before(), g_sensitivity=False)
    rng, rate = np.random.default_rng(5), 5.0
    samples = int(played.recording.time[-1] * rate)
    errors = np.zeros((200, PLAIN.size))
    for error in errors:
        wander = simulate_wander(flicker, samples, rate, rng)
        wander -= wander.mean(axis=0)
        for one in influences.each:
            drift = one.drifts.get(RATE_WANDER)
            if drift is not None:
                for start, stop, by_bias, gain in zip(
                    drift.start, drift.stop, drift.by_bias, one.gain, strict=True
                ):
                    error += gain @ by_bias @ wander[int(start * rate) : int(stop * rate) + 1].mean(axis=0)
    part = GROUPS["gyro bias"]
    drawn = float(np.sqrt(np.mean(errors[:, imu_unknowns(None, PLAIN).places(["gyro.bias"])] ** 2)))
    told = float(np.sqrt(np.mean(np.diag(true_covariance(task, played, problem))[part])))
    # 600 numbers: 3 % (one sigma); white noise and the span's edges are some per cent of it
    assert drawn == pytest.approx(told, rel=0.12)


def test_the_sensors_errors_stand_under_their_names() -> None:
    force = np.array([[1.01, 0.0, 0.0], [0.002, 0.99, 0.0], [-0.003, 0.004, 1.02]])
    gyro = np.diag([1.0, 1.1, 0.9])
    values = np.real(parameters_of(force, np.array([1.0, 2.0, 3.0]), gyro, np.zeros(3), np.eye(3)))
    found = dict(zip(NAMES, values, strict=True))
    assert found["accelerometer bias y"] == 2.0
    assert found["gyro scale factor error y"] == pytest.approx(0.1)
    assert found["g-sensitivity of gyro x to force x"] == 1.0
    # a row of the matrix is its scale along a tilted axis: to the second order in the tilt
    assert found["accelerometer scale factor error x"] == pytest.approx(0.01, abs=1e-9)


def test_turns_about_the_vertical_tell_no_gyro_and_a_level_turn_does() -> None:
    """Gravity stays where it is: the z gyro is not told, and a turn by hand about level z tells it."""
    level = tuple(
        replace(step, pose=Pose(np.array([0.0, 0.0, 1.0]))) for step in faces(*[(0, 0, 1)] * 4).steps[::2]
    )
    turn = TurnStep(3.0, np.array([0.0, 0.0, 1.0]), np.pi / 2.0)
    steps = (level[0], turn, replace(level[1], pose=None), turn, replace(level[2], pose=None))
    task = PlanTask.of_grade(Protocol("vertical", "hand-held", steps), TACTICAL, SITE, draws=1)
    plan = plan_protocol(task)
    scale = GROUPS["gyro scale"]
    assert not plan.told[scale][2]
    assert plan.weak
    candidates = step_candidates(task, table=False, span=plan.duration)
    following = find_next_steps(task, plan.information, candidates, count=8)
    left = [one.open_left for one in following]
    assert left == sorted(left, reverse=True)
    assert left[-1] < 21 - int(plan.told[:21].sum())
    stop, words = judge_stop(task, plan.information, following, None)
    assert not stop
    assert "Not determined yet" in words[0]


def test_an_aim_is_as_many_usual_poses_away_as_it_takes() -> None:
    """Limits are what 20 poses determine: after 5 of them 15 are left, and after 20 none."""
    task = PlanTask.of_grade(faces((0, 0, 1), (1, 0, 0), seconds=3.0), TACTICAL, SITE)
    usual = usual_pose(task, 300.0)
    limits = np.full(30, np.inf)
    turned = GROUPS["rotation between the triads"]
    limits[turned] = np.sqrt(np.diag(task.covariance(JointInformation(20.0 * usual.matrix))))[turned]
    aim = Aim(limits, usual)
    assert aim.poses_left(task, JointInformation(5.0 * usual.matrix)) == pytest.approx(15.0, abs=0.5)
    assert aim.poses_left(task, JointInformation(20.1 * usual.matrix)) == 0.0


def test_with_an_aim_the_worst_of_what_is_wanted_decides() -> None:
    """One parameter is nearly where it is wanted, another is three times off: the step for the latter is next."""
    task = PlanTask.of_grade(faces((0, 0, 1), (1, 0, 0)), TACTICAL, SITE)
    sigma = 0.01 * task.sizes
    known = JointInformation(np.diag(1.0 / sigma**2))

    def step(name: str, place: int, more: float) -> StepCandidate:
        matrix = np.zeros((30, 30))
        matrix[place, place] = more / sigma[place] ** 2
        return StepCandidate(name, 5.0, JointInformation(matrix), ())

    limits = np.full(30, np.inf)
    limits[1], limits[14] = sigma[1] / 1.05, sigma[14] / 3.0
    candidates = [step("near", 1, 1.0), step("far", 14, 0.6), step("not wanted", 7, 100.0)]
    usual = JointInformation(0.1 * known.matrix)
    assert find_next_steps(task, known, candidates, 1)[0].candidate.name == "not wanted"
    (following,) = find_next_steps(task, known, candidates, 1, Aim(limits, usual))
    assert following.candidate.name == "far"
    assert following.most == NAMES[14]
    assert following.most_gain == pytest.approx(1.0 - 1.6**-0.5, rel=1e-3)


def test_what_would_tell_a_weak_direction_makes_it_told(hand_held: JointPlan) -> None:
    """Take all knowledge of the z gyro's scale away: a turn about z brings it back."""
    task = hand_held.task
    at = NAMES.index("gyro scale factor error z")
    covariance = task.covariance(hand_held.information)
    keep = [i for i in task.parameters().tolist() if i != at]
    matrix = np.zeros((30, 30))
    matrix[np.ix_(keep, keep)] = np.linalg.inv(covariance[np.ix_(keep, keep)])
    from tumble.design.joint_plan import find_weaknesses

    known = JointInformation(matrix)
    weak = find_weaknesses(task, known)
    assert [one.parameters for one in weak] == [("gyro scale factor error z",)]
    found = what_would_tell(task, known, weak[0], step_candidates(task, table=False, span=200.0))
    assert found is not None
    assert "about z" in found[0].name
    assert found[1] < 0.9


def test_leaving_a_step_out_loses_and_lengthening_it_gains(table: JointPlan) -> None:
    worths = find_step_worths(replace(table, weak=[]))
    assert [one.kind for one in worths] == ["hold", "rotation", "hold", "rotation", "hold"]
    assert sum(one.share_of_time for one in worths) == pytest.approx(1.0)
    assert sum(one.share_of_information for one in worths) == pytest.approx(1.0)
    assert all(one.loss > 0.0 and one.most_growth > 1.0 for one in worths)
    assert all(one.longer > 0.0 for one in worths)


def test_a_longer_rotation_turns_further_at_its_rate(table: JointPlan) -> None:
    longer = with_longer_step(table.task.protocol, 1, 2.0).steps[1]
    assert isinstance(longer, SpinStep)
    assert longer.angle == pytest.approx(2.0 * 36.0 * np.radians(10.0))
    assert longer.angle == pytest.approx(longer.rate * (longer.duration + longer.ramp))


def test_what_cannot_be_planned_is_said() -> None:
    for protocol, words in (
        (named_protocol("thermal-fridge"), "temperature"),
        (faces((1, 0, 0)), "fewer than two holds"),
        (faces((1, 0, 0), (0, 1, 0), seconds=1e5), "lasts"),
    ):
        with pytest.raises(UsageError, match=words):
            plan_protocol(PlanTask.of_grade(protocol, TACTICAL, SITE))


def test_sizes_are_the_data_sheets_spreads() -> None:
    sizes = parameter_sizes(TACTICAL)
    assert sizes[GROUPS["gyro bias"]] == pytest.approx(np.full(3, TACTICAL.gyroscope.bias))
    assert sizes[GROUPS["accelerometer misalignment"]] == pytest.approx(
        np.full(3, np.sqrt(2.0) * TACTICAL.accelerometer.misalignment)
    )
    assert np.all(sizes > 0.0)


def test_targets_are_held_against_what_is_foretold(hand_held: JointPlan) -> None:
    """By the information alone each hold's wander is its own, and gyro biases would miss a target that they reach."""
    task, foretold = hand_held.task, hand_held.noise_sigmas
    for factor, reached in ((1.01, True), (0.99, False)):
        limits = np.where(np.isfinite(foretold), factor * foretold, np.inf)
        stop, words = judge_stop(task, hand_held.information, [], limits, foretold)
        assert stop == reached
        assert ("All targets are reached" in words[0]) == reached


def test_a_table_that_was_there_before_determines_the_clock(hand_held: JointPlan) -> None:
    """Against one normal equation of thirty parameters and the clock, whose share every gyro scale factor has."""
    task = replace(hand_held.task, g_sensitivity=True)
    rng = np.random.default_rng(5)
    one, other = (rng.normal(size=(30, 30)) / task.sizes for _ in range(2))
    sizes = task.sizes[GROUPS["gyro scale"]]
    planned, known = (JointInformation(1e4 * root.T @ root) for root in (one, other))
    by_clock = np.zeros((30, 31))
    by_clock[:, :30] = np.eye(30)
    by_clock[GROUPS["gyro scale"], 30] = 1.0
    clock = 30.0 * float(sizes[0])
    whole = by_clock.T @ planned.matrix @ by_clock
    whole[:30, :30] += known.matrix + np.diag((100.0 * task.sizes) ** -2.0)
    whole[30, 30] += clock**-2
    expected = np.diag(np.linalg.inv(whole))[:30]
    beside = replace(task, known=known, clock=clock)
    found = np.diag(beside.covariance(planned)) + clock_variances(beside, planned)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert np.all(found[GROUPS["gyro scale"]] < clock**2 / 4.0)
    # Nothing there, or nothing that knows more of them: all have the clock.
    for none in (None, JointInformation(1e-12 * known.matrix)):
        alone = clock_variances(replace(task, known=none, clock=clock), planned)
        np.testing.assert_allclose(alone, np.where(by_clock[:, 30] > 0.0, clock**2, 0.0))
