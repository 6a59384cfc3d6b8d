"""Jumps and drifts of biases: found where they are, seldom where they are not, and counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tumble.calibration.checks.bias_course import (
    CONTRADICTION,
    FALSE_ALARM,
    BiasCourse,
    Rests,
    find_force_course,
    find_rate_courses,
    hidden_jumps,
)
from tumble.document import Calibration, read_calibration
from tumble.segmentation.rounding import rounding_variance
from tumble.workflows.calibrate import calibrate
from tumble.workflows.simulate import simulate

HOLDS = 24


def residuals(seed: int, holds: int = HOLDS) -> tuple[np.ndarray, Rests]:
    """Holds of unequal length: standard deviations of 1e-4 to 2e-4 rad/s."""
    rng = np.random.default_rng(seed)
    sigma = rng.uniform(1e-4, 2e-4, (holds, 1)) * np.ones(3)
    return sigma * rng.standard_normal((holds, 3)), rests_of(sigma**2)


def rests_of(variance: np.ndarray) -> Rests:
    """Holds of five seconds, one each seven."""
    start = np.arange(0.0, 7.0 * len(variance), 7.0, dtype=np.float64)
    return Rests(start, start + 5.0, variance)


@pytest.mark.parametrize(("axis", "before", "size"), [(0, 9, 1.2e-3), (1, 4, -1.5e-3), (2, 17, 2e-3)])
def test_a_jump_of_a_gyro_is_found_on_its_axis_between_its_holds_with_its_size(
    axis: int, before: int, size: float
) -> None:
    residual, rests = residuals(4)
    residual[before + 1 :, axis] += size
    (found,) = find_rate_courses(residual, rests)
    assert found.is_contradiction
    assert found.after == before
    assert np.flatnonzero(found.size).tolist() == [axis]
    # 4 sigma of the difference of the two sides' means.
    sides = np.sqrt(1.5e-4**2 / (before + 1) + 1.5e-4**2 / (HOLDS - before - 1))
    assert found.size[axis] == pytest.approx(size, abs=4.0 * sides)


def test_a_jump_scatters_by_its_uncertainty() -> None:
    """Of 150 draws the mean square is known to an eighth: 0.7 to 1.3 are 2.6 of its standard deviations."""
    found: list[float] = []
    for seed in range(150):
        residual, rests = residuals(seed)
        residual[15:, 1] += 2e-3
        (course,) = find_rate_courses(residual, rests)
        if course.after == 14 and np.flatnonzero(course.size).tolist() == [1]:
            found.append((course.size[1] - 2e-3) / course.sigma[1])
    assert len(found) > 130
    assert 0.7 < np.mean(np.square(found)) < 1.3


def test_one_odd_hold_is_no_jump() -> None:
    residual, rests = residuals(6)
    residual[11, 2] += 3e-3
    assert not find_rate_courses(residual, rests)
    assert not find_rate_courses(residual, rests, left_out=[11])


def test_few_holds_hide_a_jump_rather_than_invent_one() -> None:
    residual, rests = residuals(1, holds=7)
    residual[4:] += 1e-2
    assert not find_rate_courses(residual, rests)


def test_steps_of_the_output_are_no_jump() -> None:
    """A bias that moves over the edge of a step: from there on all holds show the next number, none in between.

    Their scatter is zero, of which the jump would be certain.
    """
    step, length = 1e-3, 100
    signal = step * np.random.default_rng(3).integers(-500, 500, (HOLDS * 2 * length, 3)).astype(np.float64)
    holds = [[(length * (2 * k + 1), length * (2 * k + 2))] for k in range(HOLDS)]
    for k, ((start, stop),) in enumerate(holds):
        signal[start:stop] = [step if k >= 13 else 0.0, 0.0, 0.0]
    means = np.array([signal[start:stop].mean(axis=0) for ((start, stop),) in holds])
    rounding = rounding_variance(signal, holds, means)
    residual = means - means.mean(axis=0)
    assert not find_rate_courses(residual, rests_of(rounding))
    assert find_rate_courses(residual, rests_of(1e-3 * rounding))


def test_all_axes_that_jump_at_once_are_named_and_what_a_g_sensitivity_took_of_them_is_given_back() -> None:
    """A g-sensitivity was adjusted to holds that jump: it takes what goes with the force of the later ones."""
    residual, rests = residuals(5, holds=26)
    force = np.random.default_rng(8).standard_normal((26, 3))
    jump = np.array([4e-3, 0.0, -2.5e-3])
    residual[11:] += jump
    known = np.hstack([np.ones((26, 1)), force])
    residual -= known @ np.linalg.lstsq(known, residual, rcond=None)[0]
    found = find_rate_courses(residual, rests, force)
    assert [course.after for course in found] == [10]
    assert found[0].is_contradiction
    # of the difference of two sides' means
    assert found[0].size == pytest.approx(jump, abs=4.0 * 1.5e-4 / np.sqrt(26 / 4))


@pytest.mark.parametrize(("constant", "size"), [(40.0, 3e-3), (90.0, 4e-3), (1e4, 8e-3)])
def test_a_drift_is_found_with_its_size_also_where_the_specific_force_has_taken_a_part(
    constant: float, size: float
) -> None:
    """A straight line is much like a random walk, and has to be larger."""
    residual, rests = residuals(3)
    time = 0.5 * (rests.start + rests.stop)
    drift = np.exp(-time / constant)
    drift *= size / (drift[0] - drift[-1])
    # the first poses are faces, the last ones edges: a g-sensitivity explains some of the drift
    force = np.asarray(9.8 * np.column_stack([time < 40.0, np.cos(time), np.sin(time)]), dtype=np.float64)
    residual[:, 1] += drift
    design = np.column_stack([np.ones(HOLDS), force])
    weight = 1.0 / np.sqrt(rests.variance)
    for axis in range(3):
        w = weight[:, axis : axis + 1]
        residual[:, axis] -= design @ np.linalg.lstsq(w * design, w[:, 0] * residual[:, axis], rcond=None)[0]
    (found,) = find_rate_courses(residual, rests, force)
    assert found.after is None
    assert np.argmax(np.abs(found.size)) == 1
    # what of it the force has taken is determined within half of it
    departure = found.departure(time)[:, 1]
    true = drift - drift[-1]
    assert 0.5 < departure[0] / true[0] < 1.6
    assert 0.4 < departure.mean() / true.mean() < 2.0


def norms_of(biases: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, Rests]:
    """What nine unknowns leave of (holds, 3) biases in the norms of as many poses, which are measured to 0.4 mm/s²."""
    rng = np.random.default_rng(seed)
    up = rng.standard_normal(biases.shape)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    norms = np.sum(biases * up, axis=1) + 4e-4 * rng.standard_normal(len(up))
    square = np.einsum("ni,nj->nij", up, up).reshape(-1, 9)
    adjusted = np.hstack([up, square])
    left = np.asarray(norms - adjusted @ np.linalg.lstsq(adjusted, norms, rcond=1e-9)[0], dtype=np.float64)
    return left, up, rests_of(np.full(len(up), 4e-4**2))


@pytest.mark.parametrize(
    ("before", "jump"), [(12, [8e-3, 2e-3, -5e-3]), (19, [0.0, 0.0, 2e-2]), (15, [0.0, 3e-3, 0.0])]
)
def test_accelerometers_that_jump_are_found_between_their_holds(before: int, jump: list[float]) -> None:
    """The last is one axis by 0.3 mg, eight times what a hold is measured to."""
    later = np.arange(30)[:, None] > before
    course = find_force_course(*norms_of(later * np.array(jump), 3))
    assert course.is_contradiction
    assert course.after == before
    assert course.size == pytest.approx(jump, abs=1.2e-3)
    assert course.departure(np.array([0.0, 209.0])) == pytest.approx(np.stack([-course.size, np.zeros(3)]))


def wandering(kind: str, rng: np.random.Generator, holds: int) -> np.ndarray:
    """(holds, 3) means by 1/f noise or a random walk, of 1 mm/s² about their mean, from eight parts a hold."""
    frequency = np.fft.rfftfreq(16 * holds)[1:, None]
    lines = rng.standard_normal((len(frequency), 3)) + 1j * rng.standard_normal((len(frequency), 3))
    lines /= frequency ** {"1/f": 0.5, "walk": 1.0}[kind]
    course = np.fft.irfft(np.vstack([np.zeros((1, 3)), lines]), axis=0)[: 7 * holds]
    means = course.reshape(holds, 7, 3)[:, :5].mean(axis=1)
    means -= means.mean(axis=0)
    return np.asarray(1e-3 * means / means.std())


def test_accelerometers_that_warm_up_do_not_jump() -> None:
    """Of 100 units that warm up by 3 mg none is said to jump."""
    rng = np.random.default_rng(4)
    order, found = np.arange(30)[:, None], 0
    for seed in range(100):
        warming = 0.03 * rng.standard_normal(3) * np.exp(-order / (30 * rng.uniform(0.05, 0.6)))
        course = find_force_course(*norms_of(warming, seed))
        found += course is not None and course.after is not None
    assert found == 0


def test_of_many_holds_neighbours_are_taken_together_and_show_a_course_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """240 holds: of a gyro as 60 groups of 4, of accelerometers as 20 groups of 12 of three numbers each."""
    later = np.arange(240)[:, None] > 131
    decayed = np.exp(-np.arange(240)[:, None] / 60.0)
    jump, drift = np.array([0.0, 4e-4, -2e-4]), np.array([3e-3, 0.0, -2e-3])
    residual, rests = residuals(4, 240)
    accelerometers = {True: norms_of(later * 5.0 * jump, 7), False: norms_of(decayed * drift, 8)}
    gyros = {True: residual + later * jump, False: residual + decayed * drift}

    def found(jumps: bool) -> tuple[BiasCourse, BiasCourse]:
        (rate,), force = find_rate_courses(gyros[jumps], rests), find_force_course(*accelerometers[jumps])
        return rate, force

    whole = {jumps: found(jumps) for jumps in (True, False)}
    monkeypatch.setattr("tumble.calibration.checks.bias_course.MOST_NUMBERS", 60)
    for jumps, courses in whole.items():
        for one, other, noise in zip(found(jumps), courses, (1.5e-4, 7e-4), strict=True):
            if jumps:
                assert abs(one.after - 131) <= 12
                assert one.is_contradiction
            else:
                assert one.after is None
                assert one.until == other.until
            # what one hold is measured to, of 108 after the jump
            times = np.array([0.0, 400.0])
            assert one.departure(times) == pytest.approx(
                other.departure(times), abs=2.0 * noise / np.sqrt(108)
            )


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "holds"), [("white", 30), ("walk", 30), ("1/f", 120)])
def test_what_only_wanders_is_said_to_jump_no_more_often_than_stated(
    kind: str, holds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 2.5 % each for jumps and drifts, of 300 units: 15 expected, and more than 26 has a chance of 1e-3.

    Of 120 holds neighbours are taken together: two of gyros, six of accelerometers.
    """
    monkeypatch.setattr("tumble.calibration.checks.bias_course.MOST_NUMBERS", 60)
    assert (CONTRADICTION, FALSE_ALARM) == (0.002, 0.01)
    alarms = {"force": 0, "rate": 0}
    for seed in range(300):
        rng = np.random.default_rng(1000 + seed)
        wander = np.zeros((holds, 3)) if kind == "white" else wandering(kind, rng, holds)
        alarms["force"] += find_force_course(*norms_of(wander, seed), chance=0.025) is not None
        shown = wander + 4e-4 * rng.standard_normal((holds, 3))
        alarms["rate"] += bool(find_rate_courses(shown, rests_of(np.full((holds, 3), 4e-4**2)), chance=0.025))
    assert max(alarms.values()) <= 26


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


@pytest.mark.parametrize("procedure", ["hand-held", "joint"])
def test_a_unit_that_warms_up_has_a_bias_that_is_as_uncertain_as_it_is_off(
    procedure: str, tmp_path: Path
) -> None:
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
        calibrate(file, units="m/s^2,rad/s,s", procedure=procedure, output=tmp_path / name)
        return read_calibration(tmp_path / name)

    cold, warmed = calibrated("cold", 0.0), calibrated("warm", warm)
    assert not any("drifts" in reason for reason in cold.verdict.reasons)
    truth = {p.name: p.value for p in cold.parameters}
    for parameter in warmed.parameters:
        if parameter.name.startswith("gyro bias"):
            off = abs(parameter.value - truth[parameter.name]) / parameter.standard_uncertainty
            assert off < 3.0, parameter.name
            told = [r for r in warmed.verdict.reasons if parameter.name[-1] in r and "drifts by" in r]
            assert told, parameter.name
