"""Jumps and drifts of biases: found where they are, with their size, and counted; what jumps unseen is said."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from second_simulator.calibrating import calibrated, played
from tumble.calibration import Session
from tumble.calibration.checks.suspicions import TriadBiases, find_courses, hidden_jumps
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.causes import FORCE_WANDER, RATE_WANDER
from tumble.calibration.outcome import estimate
from tumble.document import Calibration, read_calibration
from tumble.earth import Site
from tumble.estimation.alternatives import Found
from tumble.protocol import named_protocol
from tumble.simulation import find_grade, simulate_protocol
from tumble.workflows.calibrate import calibrate
from tumble.workflows.procedures import run_procedure
from tumble.workflows.simulate import simulate

BOTH = [FORCE_WANDER, RATE_WANDER]
TABLE = {"seconds": 10.0, "rate": 25.0}


@cache
def settled(procedure: str, grade: str, force: float = 0.0, rate: float = 0.0) -> JointAdjustment:
    """From the middle on accelerometer y (m/s²) and gyro z (°/s) have other biases; the adjustment as it settles."""
    made = played(procedure, grade, 3, **(TABLE if procedure == "turntable" else {}))
    after = np.arange(len(made.time)) >= 0.5 * len(made.time)
    made.force[:, 1] += force * made.truth.force_unit * after
    made.rate[:, 2] += np.radians(rate) * made.truth.rate_unit * after
    kept: list[JointAdjustment] = []

    def keep(task: JointAdjustment, _: list[str]) -> list[tuple[TriadBiases, Found]]:
        kept.append(task)
        return []

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(estimate, "find_courses", keep)
        calibrated(
            made, by_protocol=procedure == "turntable", rate=f"{made.path.rate}±{1e-5 * made.path.rate}"
        )
    return kept[-1]


@pytest.mark.parametrize(("procedure", "grade"), [("by-hand", "consumer"), ("turntable", "industrial")])
def test_biases_that_only_wander_do_neither(procedure: str, grade: str) -> None:
    assert not find_courses(settled(procedure, grade), BOTH)


@pytest.mark.parametrize(
    ("procedure", "grade", "force", "rate"),
    [("by-hand", "consumer", 0.01, 0.1), ("turntable", "industrial", 0.005, -0.05)],
)
def test_jumps_of_both_triads_are_found_with_place_axis_and_size(
    procedure: str, grade: str, force: float, rate: float
) -> None:
    task = settled(procedure, grade, force, rate)
    found = {triad.name: (triad, one) for triad, one in find_courses(task, BOTH)}
    assert sorted(found) == ["accelerometers", "gyros"]
    middle = 0.5 * float(task.data.base.time[0] + task.data.base.time[-1])
    matrices = {"accelerometers": task.unknowns["force.scale"][1], "gyros": task.unknowns["gyro.matrix"][8]}
    for (name, axis), size in {("accelerometers", 1): force, ("gyros", 2): np.radians(rate)}.items():
        triad, one = found[name]
        assert one.alternative is triad.jumps
        course = triad.course(one)
        # Between the two holds beside the middle, or one further.
        assert abs(course.since - middle) < 0.1 * middle
        scale = float(matrices[name])
        assert course.size[axis] / scale == pytest.approx(size, abs=5.0 * one.sigma[axis] / abs(scale))


@pytest.mark.parametrize(("procedure", "grade"), [("by-hand", "consumer"), ("turntable", "industrial")])
def test_one_bias_all_along_is_the_bias_itself_and_no_suspicion(procedure: str, grade: str) -> None:
    """Of a constant nothing is left; on tables, where the gyros also turn the windows' force, a thousandth."""
    from tumble.estimation.alternatives import _scores

    task = settled(procedure, grade)
    for source in BOTH:
        scores = _scores(task, TriadBiases(task, source).jumps.suspect)
        places, axes = scores.score.shape
        constant = np.kron(np.ones((places, 1)), np.eye(axes))
        left = constant.T @ scores.covariance @ constant
        assert np.all(np.abs(left) < 2e-3 * np.trace(scores.covariance))


def test_jumps_are_hidden_where_all_faces_up_come_before_all_faces_down() -> None:
    """With the faces up first, M' = M - j (1, 1, 1)/2g and b' = b + j/2 give all six readings, and are no unit's."""
    rng = np.random.default_rng(2)
    ordered = np.vstack([np.eye(3), -np.eye(3)])
    matrix, bias, jump = (
        np.eye(3) + 0.02 * rng.standard_normal((3, 3)),
        rng.standard_normal(3),
        np.array([0.3, -0.1, 0.2]),
    )
    shown = 9.8 * ordered @ matrix.T + bias + np.where(np.arange(6)[:, None] > 2, jump, 0.0)
    other = matrix - np.outer(jump, np.ones(3)) / (2 * 9.8)
    assert 9.8 * ordered @ other.T + bias + jump / 2 == pytest.approx(shown, abs=1e-12)
    assert hidden_jumps(ordered) == [2]
    # placed to a degree, and each face held three times
    leaning = np.repeat(ordered, 3, axis=0) + 0.01 * rng.standard_normal((18, 3))
    assert hidden_jumps(leaning / np.linalg.norm(leaning, axis=1, keepdims=True)) == [8]
    assert hidden_jumps(ordered[[0, 3, 1, 4, 2, 5]]) == []
    assert hidden_jumps(np.vstack([ordered, ordered[:1]])) == []
    assert hidden_jumps(ordered[:4]) == []


def test_a_unit_that_warms_up_has_a_bias_that_is_as_uncertain_as_it_is_off(tmp_path: Path) -> None:
    """0.15, -0.1 and 0.05 °/s at the start, with 90 s: the bias that it comes to was 18 sigmas off."""
    simulate("hand-held", output=tmp_path / "made", unit=1, seed=1)
    path = tmp_path / "made" / "recording.csv"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    header = path.read_text().splitlines()[0]
    warm = np.radians([0.15, -0.1, 0.05]) * np.exp(-(rows[:, :1] - rows[0, 0]) / 90.0)

    def calibrated(name: str, extra: np.ndarray | float) -> Calibration:
        file = tmp_path / f"{name}.csv"
        moved = rows.copy()
        moved[:, 4:7] += extra
        np.savetxt(file, moved, delimiter=",", header=header, comments="")
        calibrate(file, units="m/s^2,rad/s,s", output=tmp_path / name)
        return read_calibration(tmp_path / name)

    cold, warmed = calibrated("cold", 0.0), calibrated("warm", warm)
    assert not any("drift" in reason for reason in cold.verdict.reasons)
    (said,) = [reason for reason in warmed.verdict.reasons if "biases of the gyros drift by" in reason]
    assert re.search(r"x -0.\d+ ± .*y \+0.\d+ ± .*z -0.\d+ ± ", said)
    truth = {p.name: p.value for p in cold.parameters}
    for parameter in warmed.parameters:
        if parameter.name.startswith("gyro bias"):
            off = abs(parameter.value - truth[parameter.name]) / parameter.standard_uncertainty
            assert off < 3.0, parameter.name


def test_gyros_that_fade_by_much_keep_their_g_sensitivity() -> None:
    """0.18 °/s: with g-sensitivity it did not settle; it was not tried, and what was left of it hid the drift."""
    rng, site = np.random.default_rng([0, 3_200_000]), Site.from_latitude(np.radians(48.0), 300.0)
    protocol = named_protocol("multi-position-26")
    made, truth = simulate_protocol(protocol, 100.0, rng, site=site, grade=find_grade("consumer-mems"))
    fading = np.radians(0.18) * np.exp(-np.linspace(0.0, 5.0, len(made.time)))
    rate = np.asarray(made.angular_rate) + fading[:, None] * np.eye(3)[int(rng.integers(3))]
    session = Session(replace(made, angular_rate=rate), protocol, site)
    found, _ = run_procedure(session, "hand-held")
    assert any("biases of the gyros drift" in said for said in found.cautions)
    assert found.model.g_sensitivity == pytest.approx(truth.model.g_sensitivity, abs=1e-4)
