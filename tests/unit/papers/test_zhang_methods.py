"""Zhang's closed forms on recordings of a turntable: the truth, the stated uncertainty, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recovery.played import MODEL, short
from second_simulator.calibrating import played
from tumble.calibration.session import Session
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, SpinStep, Step
from tumble.sensor import change_frame
from tumble.sensor.gauge import lower_factor
from tumble.simulation import TableErrors, find_grade, simulate_protocol
from tumble_papers.zhang.methods import ESTIMATORS
from unit.papers.recovered import assert_within_statement, session_of, square_sum, white

SITE = replace(Site.from_latitude(np.radians(48.0), 300.0), gravity_sigma=0.0)
NINE = short("turntable-9", SITE)
RUNS = 24


def recorded(steps: tuple[Step, ...] = NINE.steps, **options) -> Session:
    """The nine and six without noise and without errors of the table, if nothing else is said."""
    protocol = replace(NINE, steps=steps)
    told = {"model": MODEL, "placement": False, "table": TableErrors(angle_sigma=0.0), **options}
    recording, _ = simulate_protocol(protocol, 50.0, np.random.default_rng(3), site=SITE, **told)
    return Session(recording, protocol)


@pytest.mark.parametrize("name", ["zhang-inter-triad", "zhang-optimal"])
@pytest.mark.parametrize("ramp_spread", [0.0, 0.3])
def test_without_noise_the_truth_comes_back_however_the_unit_is_placed(name: str, ramp_spread: float) -> None:
    """Matrices of condition one; uneven ramps leave of the biases what a mean over the rests is good to."""
    table = TableErrors(angle_sigma=0.0, ramp_spread=ramp_spread)
    found = ESTIMATORS[name].estimate(recorded(placement=True, table=table, units="counts")).model
    true, sizes = change_frame(MODEL, "accelerometer-x"), (1e4, 1e6)
    for one, other, size in zip(
        (found.accelerometer, found.gyroscope), (true.accelerometer, true.gyroscope), sizes, strict=True
    ):
        assert one is not None
        assert other is not None
        np.testing.assert_allclose(one.matrix / size, other.matrix, rtol=0, atol=1e-9 + 3e-6 * ramp_spread)
        np.testing.assert_allclose(one.bias / size, other.bias, rtol=0, atol=1e-9)


def test_the_rotation_between_the_triads_is_all_that_the_inter_triad_equations_add() -> None:
    session = recorded(model=None, grade=find_grade("tactical"))
    plain, full = (ESTIMATORS[name].estimate(session) for name in ("zhang-closed-form", "zhang-inter-triad"))
    assert plain.model.gyroscope is not None
    assert full.model.gyroscope is not None
    np.testing.assert_allclose(
        plain.model.gyroscope.matrix, lower_factor(full.model.gyroscope.matrix), rtol=0, atol=1e-12
    )
    np.testing.assert_array_equal(plain.model.gyroscope.bias, full.model.gyroscope.bias)
    np.testing.assert_array_equal(plain.model.accelerometer.matrix, full.model.accelerometer.matrix)
    named = {value.name: value for value in plain.parameters}
    for axis in "xyz":
        turned = named[f"rotation between the triads {axis}"]
        assert abs(turned.value) < 1e-15
        assert turned.standard_uncertainty == pytest.approx(0.01, rel=1e-3)
    assert "rotation between the triads is not determined" in plain.not_determined[0]
    assert not full.not_determined


def test_nine_poses_state_what_the_paper_s_theory_of_them_says() -> None:
    """With σ of a dwell's mean: scale σ/√2, misalignment √7 σ, bias σ/√2; right to 2 %, and to the axes' noise."""
    session = recorded(grade=find_grade("tactical"))
    stated = {
        p.name: p.standard_uncertainty for p in ESTIMATORS["zhang-optimal"].estimate(session).parameters
    }
    long = session.means.duration > 8.0
    covariance = session.means.specific_force_covariance
    assert covariance is not None
    assert np.count_nonzero(long) == 9
    sigma = float(np.sqrt(np.mean(np.trace(covariance[long], axis1=1, axis2=2)) / 3.0))
    for name, expected in (
        ("scale factor error", sigma / SITE.gravity / np.sqrt(2.0)),
        ("non-orthogonality", sigma / SITE.gravity * np.sqrt(7.0)),
        ("bias", sigma / np.sqrt(2.0)),
    ):
        found = [value for key, value in stated.items() if key.startswith(f"accelerometer {name}")]
        assert np.mean(found) == pytest.approx(expected, rel=0.15)


def test_the_truth_is_within_the_stated_uncertainty_over_many_units() -> None:
    made = [
        played("turntable", white(asymmetry=False), seed, seconds=20.0, rate=25.0, speed=30.0)
        for seed in range(RUNS)
    ]
    sessions = [session_of(one) for one in made]
    for name in ("zhang-inter-triad", "zhang-optimal"):
        estimate = ESTIMATORS[name].estimate
        found = [square_sum(estimate(s), one) for s, one in zip(sessions, made, strict=True)]
        assert {degrees for _, degrees in found} == {21}
        assert_within_statement(found)


# What is refused -----------------------------------------------------------------------------------


def test_five_axes_are_one_too_few() -> None:
    dropped = next(s.name.split(",")[0] for s in NINE.steps if isinstance(s, SpinStep))
    steps = tuple(s for s in NINE.steps if not s.name.startswith(f"{dropped},"))
    with pytest.raises(ObservabilityError, match=r"both ways about 5 axes.*need six"):
        ESTIMATORS["zhang-closed-form"].estimate(recorded(steps))


def test_the_optimal_set_names_the_pose_that_is_missing() -> None:
    edge = [s.name for s in NINE.steps if isinstance(s, HoldStep) and not s.name.startswith("about")][-1]
    steps = tuple(s for s in NINE.steps if s.name != edge)
    pose = next(s for s in NINE.steps if s.name == edge)
    assert isinstance(pose, HoldStep)
    corner = replace(pose, pose=replace(pose.pose, up_b=np.array([0.6, 0.48, 0.64])))
    session = recorded((corner, *steps))
    with pytest.raises(ObservabilityError, match=r"optimal set .* has a pose near one of"):
        ESTIMATORS["zhang-optimal"].estimate(session)
    ESTIMATORS["zhang-inter-triad"].estimate(session)


def test_gyros_that_do_not_see_the_earth_have_no_biases_by_its_norm() -> None:
    with pytest.raises(ObservabilityError, match="too noisy to see it at rest"):
        ESTIMATORS["zhang-closed-form"].estimate(recorded(grade=find_grade("consumer-mems")))


def test_axes_that_stand_upright_leave_the_rotation_between_the_triads_open() -> None:
    axes = {s.name.split(",")[0]: s.axis_b for s in NINE.steps if isinstance(s, SpinStep)}

    def upright(step: Step) -> Step:
        axis = axes.get(step.name.split(",")[0])
        if axis is None or not isinstance(step, HoldStep):
            return step
        return replace(step, pose=replace(step.pose, up_b=axis))

    steps = tuple(upright(step) for step in NINE.steps)
    session = recorded(steps)
    with pytest.raises(ObservabilityError, match="two rotation axes that are not vertical"):
        ESTIMATORS["zhang-inter-triad"].estimate(session)
    ESTIMATORS["zhang-closed-form"].estimate(session)


def test_a_recording_without_gyros_is_refused() -> None:
    session = recorded()
    session.recording = replace(session.recording, angular_rate=None)
    with pytest.raises(ObservabilityError, match="needs accelerometers and gyros"):
        ESTIMATORS["zhang-closed-form"].estimate(session)
