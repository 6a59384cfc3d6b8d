"""Stated uncertainties hold: errors of simulated calibrations over their stated sigma.

Every run draws a consumer MEMS unit, tumbles it by hand through 26 attitudes and calibrates it. The
parameters of one run are correlated, runs are not: every test works on one number a run. Bounds come
from the number of runs at a false-alarm rate of 1e-3 a test (the seeds are fixed: a red test is red
until it is mended).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from recovery.played import jointly
from tumble.calibration import Estimate, Session
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.outcome.description import canonical_function
from tumble.earth import Site
from tumble.recording import Recording
from tumble.segmentation import HoldMeans, Timeline
from tumble.sensor import ImuModel, change_frame
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording

RUNS = 40
FALSE_ALARM = 1e-3
RATE = 50.0
SITE = Site(9.81, 0.0, math.radians(48.0), 300.0, "as simulated")


@dataclass(frozen=True)
class Run:
    """One simulated calibration and its truth, in the estimate's frame."""

    recording: Recording
    timeline: Timeline
    means: HoldMeans
    estimate: Estimate
    truth: ImuModel

    def errors(self) -> np.ndarray:
        """Estimate minus truth of the canonical parameters, in the order of `estimate.names`."""
        return canonical(self.estimate.model, self.estimate) - canonical(self.truth, self.estimate)


def canonical(model: ImuModel, like: Estimate) -> np.ndarray:
    """The numbers of a model that an estimate has names for."""
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    quadratic = model.accelerometer.quadratic
    blocks = {
        "accelerometer.matrix": model.accelerometer.matrix,
        "accelerometer.bias": model.accelerometer.bias,
        "gyroscope.matrix": model.gyroscope.matrix,
        "gyroscope.bias": model.gyroscope.bias,
        "gyroscope.g_sensitivity": model.g_sensitivity,
        "accelerometer.quadratic": np.zeros(3) if quadratic is None else quadratic,
    }
    values = []
    for name in like.names:
        block, index = name[:-1].split("[")
        values.append(np.asarray(blocks[block])[tuple(int(i) for i in index.split(","))])
    return np.array(values)


def simulate(seed: int, *, g_sensitive: bool = True) -> tuple[Recording, ImuModel]:
    """A recording of a unit with white noise and quantisation, and the truth in the frame accelerometer-x."""
    rng = np.random.default_rng(seed)
    off = Rotation.from_euler("xyz", rng.normal(0.0, 2.0, (26, 3)), degrees=True)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, 26), [0.0, 0.0, 1.0]))
    attitudes = (headings * poses_26() * off)[rng.permutation(26)]
    motion = Motion.between_poses(attitudes, rng.uniform(2.5, 4.5, 26), rng.uniform(1.5, 3.0, 25))
    grade = find_grade("consumer-mems")
    force, gyro = grade.accelerometer, grade.gyroscope
    grade = replace(
        grade,
        accelerometer=replace(force, noise=replace(force.noise, bias_instability=0.0, rate_random_walk=0.0)),
        gyroscope=replace(gyro, noise=replace(gyro.noise, bias_instability=0.0, rate_random_walk=0.0)),
        g_sensitivity=grade.g_sensitivity if g_sensitive else 0.0,
    )
    recording, truth = simulate_recording(motion, RATE, rng, site=SITE, grade=grade)
    assert truth.model is not None
    return recording, change_frame(truth.model, "accelerometer-x")


def calibrate(recording: Recording) -> tuple[Timeline, HoldMeans, Estimate]:
    session = Session(recording, None, SITE)
    return session.timeline, session.means, jointly(session)


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    done = []
    for seed in range(RUNS):
        recording, truth = simulate(9000 + seed)
        timeline, means, estimate = calibrate(recording)
        done.append(Run(recording, timeline, means, estimate, truth))
    return done


def normalised(runs: list[Run]) -> np.ndarray:
    """(runs, 30) errors over sigma: 9 of the accelerometers, 12 of the gyros, 9 of g-sensitivity."""
    rows = []
    for run in runs:
        sigma = np.sqrt(np.diag(run.estimate.covariance))
        # Above the diagonal the accelerometer's matrix is zero by the frame: neither error nor sigma.
        wanted = [not name.startswith("accelerometer.quadratic") for name in run.estimate.names]
        keep = (sigma > 0) & np.array(wanted)
        rows.append(run.errors()[keep] / sigma[keep])
    return np.array(rows)


def test_every_run_succeeds_and_finds_its_holds(runs: list[Run]) -> None:
    assert [len(run.timeline.holds) for run in runs] == [26] * RUNS


def test_errors_have_mean_zero(runs: list[Run]) -> None:
    """Per parameter: the mean of 40 normal numbers; the largest of 30 at 1e-3 together."""
    z = normalised(runs)
    limit = stats.norm.isf(FALSE_ALARM / 2 / z.shape[1]) / math.sqrt(RUNS)
    assert np.max(np.abs(z.mean(axis=0))) < 1.15 * limit  # 1.15: the spread may be that of the next test


def test_errors_have_the_standard_deviation_that_is_stated(runs: list[Run]) -> None:
    """Mean square of a run's errors over sigma: 1, but for Student's degrees of freedom (100: 1.02).

    Of white noise it is less: rests cannot exclude that biases wander, and what data sheets give is counted.
    """
    squares = np.mean(normalised(runs) ** 2, axis=1)
    error = squares.std(ddof=1) / math.sqrt(RUNS)
    limit = stats.t.isf(FALSE_ALARM / 2, RUNS - 1) * error
    assert 0.75 < squares.mean() < 1.02 + limit
    assert limit < 0.35  # the test would see sigmas that are a sixth too small


def test_95_percent_intervals_cover_95_percent(runs: list[Run]) -> None:
    shares = []
    for run in runs:
        sigma = np.sqrt(np.diag(run.estimate.covariance))
        keep = sigma > 0
        shares.append(np.mean(np.abs(run.errors()[keep]) <= run.estimate.coverage_factor * sigma[keep]))
    error = np.std(shares, ddof=1) / math.sqrt(RUNS)
    limit = stats.t.isf(FALSE_ALARM / 2, RUNS - 1) * error
    assert 0.95 - limit < np.mean(shares) < 0.99
    assert limit < 0.06


def test_the_whole_covariance_explains_the_errors(runs: list[Run]) -> None:
    """Normalised estimation error squared: chi-square with as many degrees as parameters, summed over runs.

    Up to 1.2 times the chi-square bound: the noise level is estimated with some 100 degrees of freedom.
    """
    total, degrees = 0.0, 0
    for run in runs:
        covariance = run.estimate.covariance
        keep = np.diag(covariance) > 0
        scale = np.sqrt(np.diag(covariance)[keep])
        correlation = covariance[np.ix_(keep, keep)] / np.outer(scale, scale)
        z = run.errors()[keep] / scale
        total += float(z @ np.linalg.solve(correlation, z))
        degrees += int(np.count_nonzero(keep))
    low, high = stats.chi2.ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2], degrees)
    assert 0.8 * low < total < 1.2 * high


def test_g_sensitivity_is_found_where_it_is_and_other_terms_seldom_where_they_are_not(
    runs: list[Run],
) -> None:
    """All terms together are kept wrongly in 2 % of recordings: of 40, more than 5 has a chance of 1e-3."""
    kept = [[term.name for term in run.estimate.terms if term.kept] for run in runs]
    assert all("g_sensitivity" in names for names in kept)
    wrong = sum(len(names) > 1 for names in kept)
    assert wrong <= stats.binom.isf(FALSE_ALARM, RUNS, 0.02)


def test_without_g_sensitivity_no_term_is_kept_but_for_false_alarms() -> None:
    """2 % of recordings; of 25, more than 4 has a chance of 1e-3."""
    wrong = 0
    for seed in range(25):
        recording, _ = simulate(9500 + seed, g_sensitive=False)
        _, _, estimate = calibrate(recording)
        wrong += any(term.kept for term in estimate.terms)
    assert wrong <= stats.binom.isf(FALSE_ALARM, 25, 0.02)


def test_good_holds_and_turns_are_seldom_left_out(runs: list[Run]) -> None:
    """1 % of recordings a kind, three kinds: of 40, more than 6 has a chance of 1e-3."""
    wrong = sum(bool(run.estimate.left_out) for run in runs)
    assert wrong <= stats.binom.isf(FALSE_ALARM, RUNS, 0.03)


def with_force(recording: Recording, change: np.ndarray) -> Recording:
    assert recording.specific_force is not None
    return replace(recording, specific_force=recording.specific_force + change)


@pytest.mark.parametrize("number", [5, 17])
def test_a_planted_outlier_hold_is_named_and_does_no_harm(runs: list[Run], number: int) -> None:
    """One hold reads 0.15 m/s² too much along gravity (a hand that trembles upward, a wrong range).

    The same samples calibrated with the planted error move by less than a sigma.
    """
    run = runs[number]
    hold = run.timeline.holds[number]
    change = np.zeros((len(run.recording), 3))
    assert run.recording.specific_force is not None
    mean = run.recording.specific_force[hold.start : hold.stop].mean(axis=0)
    change[hold.start : hold.stop] = 0.15 * mean / np.linalg.norm(mean)
    spoiled = with_force(run.recording, change)
    estimate = jointly(Session(spoiled, None, SITE), timeline=run.timeline)
    named = {(left.kind, left.index) for left in estimate.left_out}
    assert ("hold", number) in named
    assert len(named) <= 2
    moved = canonical(estimate.model, run.estimate) - canonical(run.estimate.model, run.estimate)
    sigma = np.sqrt(np.diag(run.estimate.covariance))
    assert np.max(np.abs(moved[sigma > 0] / sigma[sigma > 0])) < 1.0


@pytest.mark.parametrize("number", [3, 20])
def test_a_planted_outlier_turn_is_named_and_does_no_harm(runs: list[Run], number: int) -> None:
    """Ten samples of one turn are lost to a knock: the gyro misses some 2 degrees there."""
    run = runs[number]
    turn = run.timeline.turns[number]
    middle = (turn.start + turn.stop) // 2
    assert run.recording.angular_rate is not None
    rate = run.recording.angular_rate.copy()
    # Perpendicular to gravity in the body, where the turn conditions see it.
    assert run.recording.specific_force is not None
    up = run.recording.specific_force[middle]
    axis = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    rate[middle : middle + 10] += np.radians(2.0) / (10.0 / RATE) * axis / np.linalg.norm(axis)
    spoiled = replace(run.recording, angular_rate=rate)
    estimate = jointly(Session(spoiled, None, SITE), timeline=run.timeline)
    reasons = {(left.kind, left.index): left.reason for left in estimate.left_out}
    assert "off" in reasons["turn", turn.before]
    # A hold beside it may be blamed, too.
    assert len(reasons) <= 2
    moved = canonical(estimate.model, run.estimate) - canonical(run.estimate.model, run.estimate)
    sigma = np.sqrt(np.diag(run.estimate.covariance))
    assert np.max(np.abs(moved[sigma > 0] / sigma[sigma > 0])) < 1.0


def test_a_jump_of_the_gyro_s_bias_is_told(runs: list[Run]) -> None:
    """0.3 °/s on y from the middle of the 14th turn on."""
    run = runs[0]
    turn = run.timeline.turns[13]
    middle = (turn.start + turn.stop) // 2
    assert run.recording.angular_rate is not None
    rate = run.recording.angular_rate.copy()
    rate[middle:, 1] += np.radians(0.3)
    spoiled = replace(run.recording, angular_rate=rate)
    estimate = jointly(Session(spoiled, None, SITE), timeline=run.timeline)
    told = [said for said in estimate.objections if "The biases of the gyros jump" in said]
    assert len(told) == 1, estimate.said
    # Of the corrected rate, and g-sensitivity may place it one hold off.
    assert run.truth.gyroscope is not None
    jump = 0.3 / run.truth.gyroscope.matrix[1, 1]
    found = re.search(r"between hold (\d+) and hold .* by y ([+-][\d.]+) ± ([\d.]+)", told[0])
    assert found is not None, told
    assert abs(int(found.group(1)) - 14) <= 1
    assert float(found.group(2)) == pytest.approx(jump, abs=max(4.0 * float(found.group(3)), 0.05))
    assert not any("jump" in said for said in run.estimate.objections)


def test_canonical_names_and_numbers_belong_together(runs: list[Run]) -> None:
    """The order of names is that of the covariance's own function."""
    run = runs[0]
    unknowns = np.arange(float(LAYOUT.size)) + 0.5
    unknowns[6:9] = [0.01, -0.02, 0.03]
    terms = frozenset(term.name for term in run.estimate.terms if term.kept)
    numbers = canonical_function(terms, "full", "accelerometer-x")(unknowns)
    by_name = dict(zip(run.estimate.names, numbers, strict=True))
    assert by_name["accelerometer.bias[1]"] == 1.5
    assert by_name["gyroscope.matrix[0,0]"] == 12.5
    assert by_name["gyroscope.matrix[1,0]"] == 15.5
    assert by_name["gyroscope.bias[2]"] == 23.5
    assert by_name["gyroscope.g_sensitivity[0,2]"] == 26.5
