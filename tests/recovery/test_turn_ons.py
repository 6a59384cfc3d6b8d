"""Several recordings of one unit: what is stable comes back better, biases are each one's own, strangers are named.

Fourteen poses by hand at 50 Hz, a minute and a quarter each; the unit's biases are other ones every time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from recovery.played import MODEL as UNIT
from recovery.played import jointly
from tumble.calibration import Estimate, Session
from tumble.calibration.equations.imu_unknowns import term_unknowns, unknowns_of
from tumble.calibration.outcome.estimate import JointOutcome, joint_estimate
from tumble.calibration.turn_ons import adjustment as several
from tumble.calibration.turn_ons.estimate import SeveralEstimate, cofactor_of_courses, several_estimate
from tumble.earth import Site
from tumble.errors import ConvergenceError, UsageError
from tumble.recording import Recording
from tumble.sensor import ImuModel, change_frame
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording

SITE = replace(Site.from_latitude(np.radians(48.0), 300.0), gravity_sigma=0.0)
MOVES = (np.array([0.03, -0.02, 0.01]), np.array([-2e-3, 1e-3, 3e-3]))
# Of a hundred parameters or so, one in ten thousand tests beyond it.
LARGEST_Z = 5.0


@dataclass(frozen=True)
class Played:
    """One turn-on: what its own adjustment made, and what was true."""

    estimate: Estimate
    outcome: JointOutcome
    model: ImuModel


def switched_on(unit: ImuModel, times: float) -> ImuModel:
    force, rate = unit.accelerometer, unit.gyroscope
    assert force is not None
    assert rate is not None
    return replace(
        unit,
        accelerometer=replace(force, bias=force.bias + times * MOVES[0]),
        gyroscope=replace(rate, bias=rate.bias + times * MOVES[1]),
    )


def settled(
    model: ImuModel, seed: int, *, noise: bool = True, rate: float = 50.0, faces: bool = False
) -> Played:
    rng = np.random.default_rng(seed)
    # The first six of the 26 are the faces.
    poses = rng.permutation(6) if faces else rng.permutation(26)[:14]
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, poses.size), [0.0, 0.0, 1.0]))
    attitudes = headings * poses_26()[poses]
    motion = Motion.between_poses(attitudes, np.full(poses.size, 3.0), np.full(poses.size - 1, 2.0))
    grade = find_grade("consumer-mems") if noise else None
    recording, _ = simulate_recording(motion, rate, rng, site=SITE, grade=grade, distort=model.distort)
    return adjusted(recording, model)


def adjusted(recording: Recording, model: ImuModel) -> Played:
    session = Session(recording, None, SITE)
    estimate = jointly(session, optional_terms=False)
    assert session.joint is not None
    return Played(estimate, session.joint, model)


@cache
def turn_on(number: int) -> Played:
    """The unit for the first, second and third time; the second at another rate."""
    return settled(switched_on(UNIT, number - 1.0), 20 + number, rate=80.0 if number == 1 else 50.0)


def together(*played: Played) -> tuple[several.SeveralOutcome, SeveralEstimate]:
    names = [f"recording {k}.csv" for k in range(1, len(played) + 1)]
    outcome = several.adjust_several(names, [p.outcome for p in played], optional_terms=False)
    return outcome, several_estimate(outcome, [p.estimate for p in played], SITE)


@cache
def of_three() -> tuple[several.SeveralOutcome, SeveralEstimate]:
    return together(*(turn_on(number) for number in range(3)))


def own_frame(model: ImuModel) -> npt.NDArray[np.float64]:
    return unknowns_of(change_frame(model, "accelerometer-x"))


def test_without_noise_the_unit_and_each_turn_ons_biases_come_back() -> None:
    """To the coning that 50 Hz leave of a turn, as of one recording."""
    played = [settled(switched_on(UNIT, times), 3, noise=False) for times in (0.0, 1.0)]
    parts = [several.with_free(several.TurnOn.of("", p.outcome), np.r_[0:9, 12:24]) for p in played]
    solution = several.solve_several(parts)
    true = own_frame(UNIT)
    np.testing.assert_allclose(solution.values, true[solution.stable], rtol=0, atol=2e-6)
    for part, one in zip(solution.parts, played, strict=True):
        np.testing.assert_allclose(part.values[part.own], own_frame(one.model)[part.own], atol=2e-6)


def test_what_is_stable_is_within_its_uncertainty_and_better_known_than_from_one() -> None:
    """Three recordings alike: the root of three, within what their different poses make of it."""
    solution = of_three()[0].solution
    sigma = np.sqrt(np.diag(solution.settled.cofactor))[: solution.stable.size]
    z = (solution.values - own_frame(UNIT)[solution.stable]) / sigma
    assert np.max(np.abs(z)) < LARGEST_Z
    alone = turn_on(0).outcome.balanced.solution
    single = np.sqrt(np.diag(alone.cofactor))[np.isin(alone.unknowns.free, solution.stable)]
    gain = single / sigma
    assert 1.4 < np.median(gain) < 2.2


def test_each_recording_has_its_own_biases_and_they_are_seen_to_change() -> None:
    _, several = of_three()
    assert [b.parameter for b in several.turn_ons.biases] == [
        f"{kind} bias {axis}" for kind in ("accelerometer", "gyro") for axis in "xyz"
    ]
    for scatter, move in zip(several.turn_ons.biases, np.concatenate(MOVES), strict=True):
        # -1, 0 and 1 times the move: its standard deviation is the move itself, but for the wander of a recording.
        assert scatter.degrees == 2
        assert scatter.scatter == pytest.approx(abs(move), rel=0.15)
        assert scatter.changes
        assert scatter.scatter_sigma == pytest.approx(scatter.scatter / 2.0)
        assert scatter.next_sigma == pytest.approx(scatter.scatter * np.sqrt(4.0 / 3.0))
        assert scatter.coverage_factor == pytest.approx(4.303, abs=1e-3)  # Student's, two degrees of freedom


def test_the_estimate_has_the_mean_bias_with_the_uncertainty_of_the_next_turn_on() -> None:
    _, several = of_three()
    for scatter in several.turn_ons.biases:
        named = next(p for p in several.estimate.parameters if p.name == scatter.parameter)
        assert named.value == pytest.approx(float(np.mean(scatter.values)))
        assert named.standard_uncertainty == pytest.approx(scatter.next_sigma)
    at = several.estimate.names.index("gyroscope.bias[2]")
    assert several.estimate.covariance[at, at] == pytest.approx(several.turn_ons.biases[5].next_sigma ** 2)
    assert np.all(np.linalg.eigvalsh(several.estimate.covariance) > -1e-15)


def test_recordings_of_one_unit_agree() -> None:
    _, several = of_three()
    assert not several.turn_ons.changing
    assert several.turn_ons.probability > 1e-3
    assert several.turn_ons.degrees == 2 * len(several.turn_ons.agreements)
    assert any("agree between the recordings" in said for said in several.estimate.remarks)


def test_a_scale_factor_that_changed_is_named_and_its_uncertainty_enlarged() -> None:
    """By 0.15 %, some fifteen standard uncertainties of one recording, and below what says another unit."""
    assert UNIT.gyroscope is not None
    matrix = np.diag([1.0, 1.0015, 1.0]) @ UNIT.gyroscope.matrix
    moved = replace(UNIT, gyroscope=replace(UNIT.gyroscope, matrix=matrix))
    _, several = together(turn_on(0), turn_on(1), settled(moved, 23))
    worst = several.turn_ons.changing[0]
    assert worst.parameter == "gyro scale factor error y"
    assert worst.largest == pytest.approx(0.0015 * 1.03, rel=0.3)
    assert worst.enlarged > 3.0
    named = next(p for p in several.estimate.parameters if p.name == worst.parameter)
    assert named.standard_uncertainty == pytest.approx(worst.enlarged * worst.sigma, rel=1e-6)
    assert "is not stable" in several.estimate.cautions[0]
    assert "recording 3.csv" in several.estimate.cautions[0]


def test_gyros_that_fade_in_one_recording_are_said_with_its_name() -> None:
    recording = turn_on(2).outcome.recording
    fading = 3e-3 * np.exp(-np.linspace(0.0, 5.0, len(recording)))[:, None]
    warm = adjusted(replace(recording, angular_rate=recording.angular_rate + fading), UNIT)
    cautions = together(turn_on(0), turn_on(1), warm)[1].estimate.cautions
    assert ["recording 3.csv: The biases of the gyros drift" in said for said in cautions].count(True) == 1


def test_a_drift_of_one_recording_is_in_what_all_have_in_common() -> None:
    """By as far as a tenth of it, put into that recording besides, moves all of the unit's unknowns, times ten."""
    recording = turn_on(2).outcome.recording
    drift = 0.03 * np.exp(-np.linspace(0.0, 2.0, len(recording)))[:, None] * np.array([1.0, -1.0, 1.0])

    def drifting(added: np.ndarray) -> Played:
        return adjusted(replace(recording, specific_force=recording.specific_force + added), UNIT)

    outcome, found = together(turn_on(0), turn_on(1), drifting(drift))
    unit, settled = outcome.solution, several.settled_outcome(outcome, 2)
    joint_estimate(settled)
    added = np.diag(cofactor_of_courses(unit, [*(turn_on(k).outcome for k in range(2)), settled]))
    before = unit.unknowns.values.copy()
    variance = unit.settled.unit_weight * (unit.settled.cofactor[0, 0] + added[0])
    named = next(p for p in found.estimate.parameters if p.name == "accelerometer scale factor error x")
    assert named.standard_uncertainty == pytest.approx(np.sqrt(variance), rel=1e-3)
    (course,) = settled.courses["accelerometer biases wander"]
    unit.parts[2].task.data = drifting(drift + 0.1 * course.departure(recording.time)).outcome.task.data
    moved = 10.0 * (several.solve_several(unit.parts).unknowns.values - before)
    # the holds' own noise, found anew, is what is left
    np.testing.assert_allclose(np.abs(moved), np.sqrt(added), rtol=0.02, atol=0.01 * np.sqrt(added.max()))
    assert added[0] > 0.1 * unit.settled.cofactor[0, 0]


def test_a_term_with_which_nothing_settles_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    solve, bad = several.solve_several, term_unknowns("quadratic")

    def fails_with_it(parts: Sequence[several.TurnOn]) -> several.UnitAdjustment:
        if np.any(np.isin(parts[0].free, bad)):
            raise ConvergenceError("It did not settle.")
        return solve(parts)

    monkeypatch.setattr(several, "solve_several", fails_with_it)
    played = [turn_on(number) for number in range(2)]
    outcome = several.adjust_several(["a", "b"], [p.outcome for p in played])
    assert outcome.untried == ["quadratic"]
    found = several_estimate(outcome, [p.estimate for p in played], SITE).estimate
    assert any("they were not tried" in said for said in found.not_determined)
    assert {test.name for test in outcome.terms} == {
        "accelerometer_asymmetry",
        "gyro_asymmetry",
        "g_sensitivity",
    }


def test_another_unit_among_three_is_named_and_left_out_and_of_two_refused() -> None:
    assert UNIT.accelerometer is not None
    skewed = UNIT.accelerometer.matrix + np.array([[0.0, 0.0, 0.0], [0.008, 0.0, 0.0], [0.0, 0.0, 0.0]])
    other = settled(replace(UNIT, accelerometer=replace(UNIT.accelerometer, matrix=skewed)), 24)
    names, outcomes = ["a", "b", "c"], [turn_on(0).outcome, turn_on(1).outcome, other.outcome]
    strangers = several.find_strangers(names, outcomes, optional_terms=False)
    assert list(strangers) == [2]
    assert "no unit's does from one day to the next" in strangers[2]
    with pytest.raises(UsageError, match=r"(a and c|c and a) are not of one unit"):
        several.find_strangers(["a", "c"], [outcomes[0], outcomes[2]], optional_terms=False)


def test_a_recording_that_does_not_tell_the_unit_by_itself_takes_part_with_its_biases() -> None:
    """Six faces and five turns: of what is stable it tells a part, of its own biases with the other's help all."""
    short = settled(switched_on(UNIT, 1.0), 25, faces=True)
    assert short.outcome.untold is not None
    outcome, several = together(turn_on(0), short)
    part = outcome.solution.parts[1]
    sigma = np.sqrt(np.diag(part.solution.cofactor))[np.isin(part.free, part.own)]
    z = (part.values[part.own] - own_frame(short.model)[part.own]) / sigma
    # The wander of a bias over half a minute comes on top of what one recording's mean is uncertain by.
    assert np.max(np.abs(z)) < 2.0 * LARGEST_Z
    assert any(agreement.degrees == 0 for agreement in several.turn_ons.agreements)
    assert not several.turn_ons.changing
