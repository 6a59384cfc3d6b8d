"""Plans of poses and of whole protocols: against first principles, brute force and the estimator itself."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tumble.attitude import twenty_six_directions
from tumble.calibration import recording_influences
from tumble.design.hold_noise import hold_covariance, predict_covariance
from tumble.design.joint_information import (
    NAMES,
    PARAMETER_GROUPS,
    PARAMETERS,
    JointInformation,
    parameter_sizes,
    parameters_of,
)
from tumble.design.joint_plan import (
    Foretold,
    JointPlan,
    PlanTask,
    find_step_worths,
    plan_protocol,
    with_longer_step,
)
from tumble.design.next_step import (
    Aim,
    StepCandidate,
    find_next_steps,
    judge_stop,
    step_candidates,
    usual_pose,
)
from tumble.design.planned_motion import PlannedNoise
from tumble.design.pose_plan import (
    PoseTask,
    find_visits,
    plan_of,
    plan_poses,
    plan_schemes,
    plan_time,
    pose_rows,
    require_seen,
    shortest_order,
)
from tumble.earth import Site
from tumble.errors import ObservabilityError, UsageError
from tumble.estimation import linearise
from tumble.protocol import NINE, HoldStep, Pose, Protocol, SpinStep, TurnStep, named_protocol
from tumble.simulation import TriadNoise, find_grade, simulate_noise, simulate_wander

CUBE, ALL = twenty_six_directions(), np.arange(9)
WHITE = TriadNoise(random_walk=2e-3)
WANDERING = TriadNoise(random_walk=3e-4, bias_instability=5e-4)


@pytest.mark.parametrize(
    "noise", [TriadNoise(bias_instability=1.0), TriadNoise(rate_random_walk=1.0), TriadNoise(random_walk=1.0)]
)
def test_the_noise_that_holds_share_is_what_the_simulator_plays(noise):
    """1,200 draws of three axes: a variance is good to 2.4 %, four of these are allowed."""
    times, rng = np.array([[0.0, 30.0], [33.0, 63.0], [66.0, 96.0], [99.0, 140.0]]), np.random.default_rng(3)
    drawn: list[np.ndarray] = []
    for _ in range(1200):
        played = simulate_noise(noise, 1400, 10.0, rng)
        means = np.array([played[int(10 * a) : int(10 * b)].mean(axis=0) for a, b in times])
        drawn.append(means - (played.mean(axis=0) if noise.wanders else 0.0))
    seen = np.concatenate([one.T for one in drawn])
    expected = hold_covariance(times, noise, 10.0)
    limit = 0.1 * np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.all(np.abs(seen.T @ seen / len(seen) - expected) < limit)


def test_with_white_noise_the_prediction_is_the_bound_of_norms_at_rest():
    dwell = 40.0
    plan = plan_of("nine", PoseTask(WHITE), CUBE[list(NINE)], np.full(9, dwell))
    sigma = WHITE.random_walk / np.sqrt(dwell) / PoseTask(WHITE).gravity
    # A face up and down: mean and half the difference. An edge: its own twice, and four others (docs/poses.md).
    expected = sigma * np.sqrt(np.repeat([0.5, 7.0, 0.5], 3))
    np.testing.assert_allclose(plan.sigmas, expected, rtol=1e-6)


def test_a_common_wander_of_all_holds_is_in_the_biases_alone():
    """Where one constant is added to all holds' means, it is the bias of that session and no error of the others."""
    directions = twenty_six_directions()
    covariance = predict_covariance(
        pose_rows(directions), directions, np.full((26, 26), 4.0) + 1e-9 * np.eye(26)
    )
    np.testing.assert_allclose(np.diag(covariance)[:6], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.diag(covariance)[6:], 4.0, rtol=1e-6)


def test_a_good_order_lessens_what_a_wandering_bias_does():
    found = plan_poses(PoseTask(WANDERING), 18, 30.0, np.random.default_rng(1))
    order = shortest_order(found.directions)
    shortest = plan_of("shortest", PoseTask(WANDERING), found.directions[order], found.dwells)
    assert found.value < 0.7 * shortest.value
    # Two holds in one pose, one after the other, would be one hold.
    assert np.all(np.sum(found.directions[1:] * found.directions[:-1], axis=1) < np.cos(np.radians(10.0)))


def test_a_plan_of_a_given_time_lasts_so_long_and_is_no_worse_than_any_scheme():
    """5 %: among plans so close to each other the one with the fewest poses is taken."""
    for noise in (WHITE, WANDERING):
        found = plan_time(PoseTask(noise), 150.0, np.random.default_rng(1))
        assert found.duration == pytest.approx(150.0, abs=3.0)  # dwells are rounded to tenths of a second
        schemes = plan_schemes(PoseTask(noise), 150.0)
        assert isinstance(schemes["six faces"], str)
        assert all(isinstance(one, str) or found.value <= 1.05 * one.value for one in schemes.values())


def test_poses_that_do_not_tell_are_refused_in_words():
    with pytest.raises(
        ObservabilityError, match=r"8 poses do not determine the non-orthogonality of y to z\. Add edge"
    ):
        require_seen(CUBE[[0, 1, 2, 3, 4, 5, 6, 8]], ALL)
    # Six faces do tell the biases and scale factors.
    require_seen(CUBE[:6], np.array([0, 1, 2, 6, 7, 8]))
    with pytest.raises(ObservabilityError, match="8 poses determine 8 numbers"):
        plan_poses(PoseTask(WHITE), 8, 30.0, np.random.default_rng(0))
    with pytest.raises(UsageError, match="too short for the 9 poses"):
        plan_time(PoseTask(WHITE), 30.0, np.random.default_rng(0))


def mean_variance(chosen, known=0.0):
    rows = pose_rows(CUBE[chosen])
    return float(np.mean(np.diag(np.linalg.inv(rows.T @ rows + known))))


def test_the_exchange_finds_the_best_of_all_sets_and_is_as_good_as_the_one_known():
    """Eleven of the 26 directions, by brute force over their 55 sets of nine."""
    chosen = [0, 1, 2, 3, 4, 5, 6, 8, 11, 13, 20]
    rows = pose_rows(CUBE[chosen])
    found = find_visits(rows, 9, np.random.default_rng(1), starts=12)
    values = [
        mean_variance([chosen[k] for k in subset])
        for subset in itertools.combinations(range(11), 9)
        if np.linalg.cond(rows[list(subset)]) < 1e6
    ]
    # Nine unknowns want nine different poses.
    assert len(set(found)) == 9
    assert mean_variance([chosen[k] for k in found]) == pytest.approx(min(values), rel=1e-6)
    # The set known: ppm, arc-seconds and µg at 50 µg a dwell, printed to three digits: half a percent. Which end a
    # start leads to, round-off decides where exchanges tie: of three hundred some end at the best.
    found = find_visits(pose_rows(CUBE), 9, np.random.default_rng(0), starts=300)
    parts = np.array([53.7e-6, 13.2 * np.pi / 648000.0, 31.9e-6]) / 50e-6
    assert mean_variance(found) <= 1.005 * float(np.mean(parts**2))
    # One to start from is never made worse.
    edges = list(range(6, 18))
    found = find_visits(pose_rows(CUBE), 12, np.random.default_rng(1), starts=1, also=[edges])
    assert mean_variance(found) <= mean_variance(edges) * (1.0 + 1e-9)


def test_what_is_known_already_steers_the_choice():
    """After six faces and three edges, whose misalignments are worst, six more poses are edges and corners."""
    rows = pose_rows(CUBE[list(NINE)])
    known = rows.T @ rows
    found = find_visits(pose_rows(CUBE), 6, np.random.default_rng(1), known=known)
    assert min(found) >= 6
    assert mean_variance(found, known) < mean_variance(list(NINE))


SITE = replace(Site.from_latitude(0.8), gravity_sigma=0.0)
TACTICAL = find_grade("tactical")


def faces(*ups, seconds=10.0):
    steps: list[HoldStep | TurnStep] = []
    for up in ups:
        steps += [TurnStep(2.0)] if steps else []
        vector = np.array(up, dtype=float)
        steps.append(HoldStep(seconds, Pose(vector / np.linalg.norm(vector), None, 0.05), str(up)))
    return Protocol("faces", "hand-held", tuple(steps))


@pytest.fixture(scope="module")
def hand_held():
    return plan_protocol(PlanTask.of_grade(named_protocol("hand-held"), TACTICAL, SITE, draws=2))


@pytest.fixture(scope="module")
def table():
    """Two holds, and one turn of a table both ways about x."""
    hold, about = HoldStep(8.0, Pose(np.array([0.0, 0.0, 1.0]), None, 0.05)), np.array([1.0, 0.0, 0.0])
    there, back = (
        SpinStep(35.0, rate, about, ramp=1.0, angle=36.0 * rate, angle_sigma=1e-5)
        for rate in np.radians([10.0, -10.0])
    )
    steps = (hold, there, hold, back, hold)
    return plan_protocol(PlanTask.of_grade(Protocol("both ways", "joint", steps), TACTICAL, SITE, draws=1))


@pytest.mark.parametrize("name", ["hand_held", "table"])
def test_the_information_is_that_of_the_estimator_itself(name, request):
    """The plan assembles the estimator's equations its own way, to eliminate a rotation only once."""
    plan: JointPlan = request.getfixturevalue(name)
    task = plan.problem.task
    _, normal, _ = linearise(task)
    if task.prior is not None:
        normal = normal - task.prior.precision[np.ix_(task.unknowns.free, task.unknowns.free)]
    places = task.unknowns.places(["force.bias", "gyro.bias"])
    wanted = normal[np.ix_(places, places)]
    found = plan.problem.slope.T @ plan.information.matrix @ plan.problem.slope
    at = [0, 1, 2, *range(18, 21)]
    size = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    # the same sums in the same order, through the parameters and back
    assert np.max(np.abs(found[np.ix_(at, at)] - wanted) / size) < 1e-7


def test_four_times_the_time_of_white_noise_halves_what_holds_tell():
    noise = PlannedNoise(TriadNoise(random_walk=1e-3), TriadNoise(random_walk=1e-5), 100.0)
    task = replace(PlanTask.of_grade(named_protocol("hand-held"), TACTICAL, SITE, draws=1), noise=noise)
    sigmas: list[np.ndarray] = []
    for factor in (1.0, 4.0):
        steps = [
            replace(step, duration=factor * step.duration) if isinstance(step, HoldStep) else step
            for step in task.protocol.steps
        ]
        session, problem = task.problem(0, replace(task.protocol, steps=tuple(steps)))
        sigmas.append(np.sqrt(np.diag(task.covariance(problem.information()))))
        if factor == 1.0:
            # gyro biases are what holds of 4 s are told by: N / sqrt(26 * 4 s), and the edges that are cut off
            expected = 1e-5 / np.sqrt(np.sum(session.means.duration))
            assert sigmas[0][PARAMETER_GROUPS["gyro bias"]] == pytest.approx(np.full(3, expected), rel=0.1)
    ratio = (
        sigmas[1][PARAMETER_GROUPS["accelerometer bias"]] / sigmas[0][PARAMETER_GROUPS["accelerometer bias"]]
    )
    # the turns tell a little, too, and last as long as before
    assert np.all((ratio > 0.47) & (ratio < 0.56))


def test_what_is_foretold_is_what_drawn_wanders_do_to_the_estimate():
    """Flicker drawn over the whole session, seen by the holds and turns as means, moves the gyro biases as foretold.

    The gains are the estimator's own; the wander is a random walk of many Gauss-Markov processes, not the closed form.
    """
    flicker = TriadNoise(random_walk=1e-6, bias_instability=1e-4)
    noise = PlannedNoise(TriadNoise(random_walk=1e-4), flicker, 100.0)
    task = replace(PlanTask.of_grade(named_protocol("hand-held"), TACTICAL, SITE, draws=1), noise=noise)
    session, problem = task.problem()
    influences = recording_influences(problem.task)
    rng, rate = np.random.default_rng(5), 5.0
    samples = int(session.recording.time[-1] * rate)
    errors = np.zeros((200, problem.task.unknowns.free.size))
    for error in errors:
        wander = simulate_wander(flicker, samples, rate, rng)
        wander -= wander.mean(axis=0)
        for one in influences.each:
            drift = one.drifts.get("gyro biases wander")
            if drift is not None:
                for start, stop, by_bias, gain in zip(
                    drift.start, drift.stop, drift.by_bias, one.gain, strict=True
                ):
                    error += gain @ by_bias @ wander[int(start * rate) : int(stop * rate) + 1].mean(axis=0)
    drawn = float(np.sqrt(np.mean(errors[:, problem.task.unknowns.places(["gyro.bias"])] ** 2)))
    told = float(np.sqrt(np.mean(plan_protocol(task).sigmas[PARAMETER_GROUPS["gyro bias"]] ** 2)))
    # 600 numbers: 3 % (one sigma); white noise and the span's edges are some per cent of it
    assert drawn == pytest.approx(told, rel=0.12)


def test_turns_about_the_vertical_tell_no_gyro_and_a_level_turn_does():
    """Gravity stays where it is: the z gyro is not told, and a turn by hand about level z tells it."""
    level = tuple(
        replace(step, pose=Pose(np.array([0.0, 0.0, 1.0]))) for step in faces(*[(0, 0, 1)] * 4).steps[::2]
    )
    turn = TurnStep(3.0, np.array([0.0, 0.0, 1.0]), np.pi / 2.0)
    steps = (level[0], turn, replace(level[1], pose=None), turn, replace(level[2], pose=None))
    task = PlanTask.of_grade(Protocol("vertical", "hand-held", steps), TACTICAL, SITE, draws=1)
    plan = plan_protocol(task)
    scale = PARAMETER_GROUPS["gyro scale"]
    assert not plan.foretold[scale][2].told
    assert plan.weak
    candidates = step_candidates(task, table=False, span=plan.duration)
    following = find_next_steps(task, plan.information, candidates, count=8)
    left = [one.open_left for one in following]
    assert left == sorted(left, reverse=True)
    assert left[-1] < 21 - sum(one.told for one in plan.foretold[:21])
    stop, words = judge_stop(task, plan.information, following, None)
    assert not stop
    assert "Not determined yet" in words[0]


def test_an_aim_is_as_many_usual_poses_away_as_it_takes():
    """Limits are what 20 poses determine: after 5 of them 15 are left, and after 20 none."""
    task = PlanTask.of_grade(faces((0, 0, 1), (1, 0, 0), seconds=3.0), TACTICAL, SITE)
    usual = usual_pose(task, 300.0)
    limits = np.full(30, np.inf)
    turned = PARAMETER_GROUPS["rotation between the triads"]
    limits[turned] = np.sqrt(np.diag(task.covariance(JointInformation(20.0 * usual.matrix))))[turned]
    aim = Aim(limits, usual)
    assert aim.poses_left(task, JointInformation(5.0 * usual.matrix)) == pytest.approx(15.0, abs=0.5)
    assert aim.poses_left(task, JointInformation(20.1 * usual.matrix)) == 0.0


def test_with_an_aim_the_worst_of_what_is_wanted_decides():
    """One parameter is nearly where it is wanted, another is three times off: the step for the latter is next."""
    task = PlanTask.of_grade(faces((0, 0, 1), (1, 0, 0)), TACTICAL, SITE)
    sigma = 0.01 * task.sizes
    known = JointInformation(np.diag(1.0 / sigma**2))

    def step(name, place, more):
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


def test_leaving_a_step_out_loses_and_lengthening_it_gains(table):
    worths = find_step_worths(replace(table, weak=[]))
    assert [one.kind for one in worths] == ["hold", "rotation", "hold", "rotation", "hold"]
    assert sum(one.share_of_time for one in worths) == pytest.approx(1.0)
    assert sum(one.share_of_information for one in worths) == pytest.approx(1.0)
    assert all(one.loss > 0.0 and one.most_growth > 1.0 for one in worths)
    assert all(one.longer > 0.0 for one in worths)
    # A longer rotation turns further at its rate.
    longer = with_longer_step(table.task.protocol, 1, 2.0).steps[1]
    assert isinstance(longer, SpinStep)
    assert longer.angle == pytest.approx(2.0 * 36.0 * np.radians(10.0))
    assert longer.angle == pytest.approx(longer.rate * (longer.duration + longer.ramp))


def test_what_cannot_be_planned_is_said():
    for protocol, words in (
        (named_protocol("thermal-fridge"), "temperature"),
        (faces((1, 0, 0)), "fewer than two holds"),
        (faces((1, 0, 0), (0, 1, 0), seconds=1e5), "lasts"),
    ):
        with pytest.raises(UsageError, match=words):
            plan_protocol(PlanTask.of_grade(protocol, TACTICAL, SITE))


def test_the_sensors_errors_stand_under_their_names_and_sizes_are_the_data_sheets_spreads():
    force = np.array([[1.01, 0.0, 0.0], [0.002, 0.99, 0.0], [-0.003, 0.004, 1.02]])
    gyro = np.diag([1.0, 1.1, 0.9])
    values = np.real(parameters_of(force, np.array([1.0, 2.0, 3.0]), gyro, np.zeros(3), np.eye(3)))
    found = dict(zip(NAMES, values, strict=True))
    assert found["accelerometer bias y"] == 2.0
    assert found["gyro scale factor error y"] == pytest.approx(0.1)
    assert found["g-sensitivity of gyro x to force x"] == 1.0
    # a row of the matrix is its scale along a tilted axis: to the second order in the tilt
    assert found["accelerometer scale factor error x"] == pytest.approx(0.01, abs=1e-9)
    sizes = parameter_sizes(TACTICAL)
    assert sizes[PARAMETER_GROUPS["gyro bias"]] == pytest.approx(np.full(3, TACTICAL.gyroscope.bias))
    leans = np.full(3, np.sqrt(2.0) * TACTICAL.accelerometer.misalignment)
    assert sizes[PARAMETER_GROUPS["accelerometer misalignment"]] == pytest.approx(leans)
    assert np.all(sizes > 0.0)


def test_targets_are_held_against_what_is_foretold(hand_held):
    """By the information alone each hold's wander is its own, and gyro biases would miss a target that they reach."""
    task, foretold = hand_held.task, hand_held.sigmas
    for factor, reached in ((1.01, True), (0.99, False)):
        limits = np.where(np.isfinite(foretold), factor * foretold, np.inf)
        stop, words = judge_stop(task, hand_held.information, [], limits, (foretold, hand_held.without_clock))
        assert stop == reached
        assert ("All targets are reached" in words[0]) == reached
    for name, group, rows in (
        ("six-position", "accelerometer misalignment", "accelerometer mis"),
        ("strapdown-rotation", "gyro misalignment", "gyro non"),
        ("strapdown-rotation", "rotation between the triads", "accelerometer mis"),
    ):
        plan = plan_protocol(PlanTask.of_grade(named_protocol(name), TACTICAL, SITE, draws=1))
        near = np.full(PARAMETERS, np.inf)
        near[PARAMETER_GROUPS[group]] = near[PARAMETER_GROUPS["g-sensitivity"]] = 1e-6
        untold = "g-sensitivity, which this plan does not determine"
        assert plan.beyond(near) == [*(one.name for one in plan.foretold if rows in one.name), untold]


def test_one_clock_is_in_all_gyro_scale_factors_and_a_table_before_determines_it(hand_held):
    """Against one normal equation of thirty parameters and the clock, whose share every gyro scale factor has."""
    task = replace(hand_held.task, g_sensitivity=True, clock=30.0 * float(hand_held.task.sizes[12]))
    rng, part = np.random.default_rng(5), PARAMETER_GROUPS["gyro scale"]
    one, other = (rng.normal(size=(30, 30)) / task.sizes for _ in range(2))
    by_clock = np.zeros((30, 32))
    by_clock[:, :30] = np.eye(30)
    by_clock[part, 30] = 1.0
    planned = JointInformation(1e4 * by_clock.T @ one.T @ one @ by_clock)
    known = JointInformation(1e4 * other.T @ other)
    whole = planned.matrix[:31, :31] + known.matrix[:31, :31]
    whole += np.diag([*(100.0 * task.sizes) ** -2.0, task.clock**-2])
    found = np.diag(replace(task, known=known).covariance(planned))
    np.testing.assert_allclose(found, np.diag(np.linalg.inv(whole))[:30], rtol=1e-6)
    assert np.all(found[part] < task.clock**2 / 4.0)
    # Nothing there that knows more of them: all have the clock.
    more = np.diag(task.covariance(planned)) - np.diag(task.with_perfect_clock.covariance(planned))
    np.testing.assert_allclose(more[part], task.clock**2, rtol=1e-3)


def test_poses_and_rates_are_believed_as_calibrate_believes_them():
    """Gyro scale factors follow the table's rates where the clock is known, and axes the placement on it."""
    table = named_protocol("rate-table")
    foretold: dict[float, dict[str, Foretold]] = {}
    for ppm in (0.0, 1000.0):
        steps = [replace(s, sigma=1e-6 * ppm) if isinstance(s, SpinStep) else s for s in table.steps]
        plan = plan_protocol(PlanTask.of_grade(replace(table, steps=tuple(steps)), TACTICAL, SITE, draws=1))
        foretold[ppm] = {one.name: one for one in plan.foretold}
    name = "gyro scale factor error x"
    assert foretold[0.0][name].sigma < 3e-6
    assert foretold[1000.0][name].sigma > 5.0 * foretold[0.0][name].sigma
    assert foretold[0.0]["gyro misalignment xy"].sigma > 1e-3
    task = PlanTask.of_grade(table, TACTICAL, SITE)
    candidates = step_candidates(task, table=task.has_table, span=table.duration)
    assert not any("by hand" in one.name for one in candidates)
