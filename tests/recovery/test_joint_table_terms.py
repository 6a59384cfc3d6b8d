"""A lag between the triads and lever arms of the accelerometers, from a table that turns.

Six axes, one revolution about each at 60°/s, this way and that way in turn. What each accelerometer feels where it
sits is taken from a recording of a unit that sits there; a lag is that the accelerometers are read at other instants
than the gyros.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from recovery.played import jointly
from tumble.attitude.rotations import matrices_from_rotation_vectors, skews
from tumble.calibration import Session
from tumble.calibration.equations.imu_unknowns import LAYOUT, imu_unknowns, raw_force
from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import Budget
from tumble.calibration.terms import LAG_NAME, by_lag, lever_arms
from tumble.calibration.terms.lever_arms import PAIRS
from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep
from tumble.recording.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, Turn
from tumble.segmentation.matching import MatchedSpin, Matching
from tumble.segmentation.rotations import Rotation
from tumble.sensor import ImuModel, Triad
from tumble.simulation import Motion, play_protocol, simulate_recording
from tumble.simulation.fixtures import PlayedProtocol

Array = npt.NDArray[np.float64]
Axes = tuple[tuple[int, int, int], ...]
SITE = Site(9.81, 0.0, float(np.radians(48.0)), 300.0, "as simulated")
NO_EARTH = Site(9.81, 0.0, None, 300.0, "as simulated")
RATE, SPEED, TURN, SIGMA = 50.0, np.radians(60.0), 2.0 * np.pi, 1e-5
START = 0.1  # s, for what is read earlier
FACES = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
EDGES = ((1, 1, 0), (1, 0, 1), (0, 1, 1))
ALL = (*EDGES, (1, -1, 0), (1, 0, -1), (0, 1, -1))
# In the frame accelerometer-x, so that nothing has to be turned.
ACCELEROMETER = Triad(
    np.array([[1.02, 0.0, 0.0], [-0.011, 0.97, 0.0], [0.013, -0.009, 1.05]]), np.array([0.02, -0.03, 0.05])
)
GYROSCOPE = Triad(
    np.array([[0.99, 0.0021, -0.0033], [-0.0014, 1.03, 0.0026], [0.0037, -0.0018, 0.97]]),
    np.array([1e-3, -2e-3, 3e-3]),
)
MODEL = ImuModel(ACCELEROMETER, GYROSCOPE)
UNIT = np.array([0.05, -0.03, 0.02])
# Counted from the point with each accelerometer's own coordinate; none like another.
ARMS = 1e-3 * np.array([[0.0, 12.0, -7.0], [5.0, 0.0, 9.0], [-14.0, 3.0, 0.0]])
LAG = 0.0073
SPEEDS = (np.radians(60.0), -np.radians(60.0), np.radians(180.0), -np.radians(180.0))
FAST = 200.0  # Hz
CURVED = np.array([4e-4, -3e-4, 2e-4])
NOISE = (0.003, 1e-4)
# Forty |z| beyond this are by chance one in 3,700.
LARGEST_Z = 4.5


def _protocol(axes: Axes, speeds: tuple[float, ...] = ()) -> Protocol:
    """One revolution about each axis; with `speeds` one about each axis at each."""
    steps: list[Step] = []
    for sign, axis in zip((1.0, -1.0) * len(axes), axes, strict=False):
        axis_b: Array = np.array(axis, dtype=float) / np.linalg.norm(axis)
        across: Array = np.asarray(np.cross(axis_b, np.eye(3)[int(np.argmin(np.abs(axis_b)))]), dtype=float)
        pose = Pose(across / np.linalg.norm(across), None, 0.09)
        steps += [TurnStep(2.0), HoldStep(3.0, pose)] if steps else [HoldStep(3.0, pose)]
        for rate in speeds or (sign * SPEED,):
            angle, duration = float(np.sign(rate)) * TURN, TURN / abs(rate) - 1.0
            steps.append(SpinStep(duration, rate, axis_b, ramp=1.0, angle=angle, angle_sigma=SIGMA))
            steps.append(HoldStep(3.0, pose))
    return Protocol("mine", "turntable", tuple(steps), site=SITE)


@cache
def _played(axes: Axes, speeds: tuple[float, ...] = ()) -> PlayedProtocol:
    return play_protocol(_protocol(axes, speeds), np.random.default_rng(3), placement=False)


def _begun(motion: Motion, start: float) -> Motion:
    """The motion without the first seconds of its first hold."""
    first, *others = motion.hold_duration
    return replace(motion, hold_duration=np.array([first - start, *others]))


def _recording(axes: Axes, *, lag: float, arms: Array, noise: bool, site: Site) -> Recording:
    played = _played(axes)

    def read(place: Array, start: float) -> Recording:
        motion = replace(_begun(played.motion, start), lever_arm_b=place)
        rng = np.random.default_rng(1)
        return simulate_recording(motion, RATE, rng, site=site, distort=MODEL.distort)[0]

    made = read(UNIT, START)
    samples = len(made.time)
    there = [read(UNIT + arm, START - lag).specific_force for arm in arms]
    columns: list[Array] = [np.asarray(seen, dtype=float)[:samples, i] for i, seen in enumerate(there)]
    force: Array = np.stack(columns, axis=1)
    rate: Array = np.asarray(made.angular_rate, dtype=float)
    if noise:
        rng = np.random.default_rng(4)
        force = force + NOISE[0] * rng.standard_normal(force.shape)
        rate = rate + NOISE[1] * rng.standard_normal(rate.shape)
    return replace(made, specific_force=force, angular_rate=rate)


def _timeline(
    played: PlayedProtocol, recording: Recording, *, noise: bool, rate: float = RATE
) -> tuple[Timeline, list[Rotation]]:
    """Holds, turns and rotations where they were."""

    def sample(seconds: float) -> int:
        return max(round((seconds - START) * rate), 0)

    holds: list[Hold] = []
    rotations: list[Rotation] = []
    for at, step in enumerate(played.steps):
        start, stop = (float(edge) for edge in played.step_edges[at])
        if isinstance(step, HoldStep):
            holds.append(Hold(sample(start) + 4, min(sample(stop), len(recording.time)) - 4))
        elif isinstance(step, SpinStep):
            assert step.angle is not None
            first, last = sample(start) + 4, sample(stop) - 4
            mean = np.asarray(recording.angular_rate)[first:last].mean(axis=0)
            rotations.append(
                Rotation(
                    len(rotations), at, mean * (stop - start), np.eye(3), stop - start,
                    step.angle, SIGMA, len(holds) - 1, len(holds), first, last,
                )
            )  # fmt: skip
    turns = tuple(Turn(k, k + 1, holds[k].stop, holds[k + 1].start) for k in range(len(holds) - 1))
    sigma = NOISE if noise else (1e-5, 1e-7)
    floor = NoiseFloor(np.full(3, sigma[0]), np.full(3, sigma[1]), 1.0, "as simulated")
    return Timeline(tuple(holds), turns, (), floor), rotations


def _calibrated(recording: Recording, timeline: Timeline, rotations: list[Rotation], site: Site) -> Estimate:
    session = Session(recording, None, site)
    session.rotations = rotations
    session.matching = Matching((), tuple(MatchedSpin(r.step, r.start, r.stop) for r in rotations), (), ())
    return jointly(session, timeline=timeline)


@cache
def _estimate(axes: Axes, *, lag: float = 0.0, apart: bool = False, noise: bool = True) -> Estimate:
    site = SITE if noise else NO_EARTH
    recording = _recording(axes, lag=lag, arms=ARMS if apart else np.zeros((3, 3)), noise=noise, site=site)
    timeline, rotations = _timeline(_played(axes), recording, noise=noise)
    return _calibrated(recording, timeline, rotations, site)


@cache
def _curved(*, noise: bool) -> Estimate:
    """Of gyros with quadratic terms, turned about x, y and z at two rates both ways.

    Often sampled: turns by hand are fast.
    """
    site = SITE if noise else NO_EARTH
    played = _played(FACES, SPEEDS)
    model = ImuModel(ACCELEROMETER, replace(GYROSCOPE, quadratic=CURVED))
    rng = np.random.default_rng(1)
    recording, _ = simulate_recording(
        _begun(played.motion, START), FAST, rng, site=site, distort=model.distort
    )
    force: Array = np.asarray(recording.specific_force, dtype=float)
    rate: Array = np.asarray(recording.angular_rate, dtype=float)
    if noise:
        force = force + NOISE[0] * rng.standard_normal(force.shape)
        rate = rate + NOISE[1] * rng.standard_normal(rate.shape)
    recording = replace(recording, specific_force=force, angular_rate=rate)
    timeline, rotations = _timeline(played, recording, noise=noise, rate=FAST)
    return _calibrated(recording, timeline, rotations, site)


def _kept(estimate: Estimate) -> set[str]:
    return {test.name for test in estimate.terms if test.kept}


def _tried(estimate: Estimate) -> set[str]:
    return {test.name for test in estimate.terms}


def _value(estimate: Estimate, name: str) -> tuple[float, float]:
    (found,) = [p for p in estimate.parameters if p.name == name]
    return found.value, found.standard_uncertainty


def _arms(estimate: Estimate) -> tuple[Array, Array]:
    """Values and sigmas of all lever arms, zero along each accelerometer's own axis."""
    made = np.zeros((2, 3, 3))
    for i, j in PAIRS:
        made[:, i, j] = _value(estimate, f"accelerometer lever arm {'xyz'[i]}{'xyz'[j]}")
    return made[0], made[1]


def test_lag_and_lever_arms_without_noise_come_back() -> None:
    """The Earth stands still, for a rate that goes round between samples leaves 3e-7 m of the trapezoids."""
    estimate = _estimate(ALL, lag=LAG, apart=True, noise=False)
    assert _kept(estimate) >= {"time_lag", "lever_arms"}
    # The prior of 30 mm pulls by the share of variances, (1e-6 m / 0.03 m)² of each.
    assert _value(estimate, LAG_NAME)[0] == pytest.approx(LAG, rel=1e-9)
    np.testing.assert_allclose(_arms(estimate)[0], ARMS, rtol=0, atol=1e-9)
    assert estimate.model.accelerometer is not None
    assert estimate.model.gyroscope is not None
    np.testing.assert_allclose(estimate.model.accelerometer.matrix, ACCELEROMETER.matrix, atol=1e-10)
    np.testing.assert_allclose(estimate.model.gyroscope.matrix, GYROSCOPE.matrix, atol=1e-10)


def test_lag_and_lever_arms_are_found_in_noise_and_nothing_else() -> None:
    estimate = _estimate(ALL, lag=LAG, apart=True)
    assert _kept(estimate) == {"time_lag", "lever_arms"}
    lag, sigma = _value(estimate, LAG_NAME)
    assert abs(lag - LAG) < LARGEST_Z * sigma < 1e-4
    arms, sigmas = _arms(estimate)
    for i, j in PAIRS:
        assert abs(arms[i, j] - ARMS[i, j]) < LARGEST_Z * sigmas[i, j]
        assert sigmas[i, j] < 1e-3
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)).tolist(), strict=True))
    for triad in ("accelerometer", "gyroscope"):
        error = getattr(estimate.model, triad).matrix - getattr(MODEL, triad).matrix
        for i in range(3):
            for j in range(3):
                assert abs(error[i, j]) <= LARGEST_Z * sigma[f"{triad}.matrix[{i},{j}]"] + 1e-12
    assert not estimate.left_out
    said = " ".join(estimate.remarks)
    assert "7.3 ms" in said
    assert "14 mm" in said


def test_where_there_is_none_none_is_kept_and_all_terms_share_two_per_cent() -> None:
    estimate = _estimate(ALL)
    assert not _kept(estimate)
    assert {"time_lag", "lever_arms"} < _tried(estimate)
    assert sum(test.limit for test in estimate.terms) <= 0.02 + 1e-12
    assert not any("lag" in p.name or "lever" in p.name for p in estimate.parameters)


def test_an_edge_of_each_pair_tells_sums_of_lever_arms() -> None:
    estimate = _estimate((*FACES[:2], *EDGES), apart=True)
    assert _kept(estimate) == {"lever_arms"}
    assert [test.degrees for test in estimate.terms if test.name == "lever_arms"] == [3]
    named = {p.name for p in estimate.parameters if "lever" in p.name}
    assert named == {f"accelerometer lever arms {pair}" for pair in ("xy+yx", "xz+zx", "yz+zy")}
    for i, j in ((0, 1), (0, 2), (1, 2)):
        name = f"accelerometer lever arms {'xyz'[i]}{'xyz'[j]}+{'xyz'[j]}{'xyz'[i]}"
        value, sigma = _value(estimate, name)
        assert abs(value - ARMS[i, j] - ARMS[j, i]) < LARGEST_Z * sigma < 5e-3


def test_axes_that_tell_no_lever_arm_try_none() -> None:
    """About x, y and z all that a lever arm does is across the axis, where the rotation's own takes it up."""
    estimate = _estimate(FACES, lag=LAG, apart=True)
    assert "lever_arms" not in _tried(estimate)
    assert _kept(estimate) == {"time_lag"}
    lag, sigma = _value(estimate, LAG_NAME)
    assert abs(lag - LAG) < LARGEST_Z * sigma


def test_quadratic_terms_of_the_gyros_come_back_from_two_rates() -> None:
    exact = _curved(noise=False)
    assert "gyro_quadratic" in _kept(exact)
    assert exact.model.gyroscope is not None
    assert exact.model.gyroscope.quadratic is not None
    np.testing.assert_allclose(exact.model.gyroscope.quadratic, CURVED, rtol=1e-9)
    np.testing.assert_allclose(exact.model.gyroscope.matrix, GYROSCOPE.matrix, rtol=0, atol=1e-10)
    estimate = _curved(noise=True)
    assert _kept(estimate) == {"gyro_quadratic"}
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)).tolist(), strict=True))
    for i, axis in enumerate("xyz"):
        value, own = _value(estimate, f"gyro quadratic {axis}")
        assert own == pytest.approx(sigma[f"gyroscope.quadratic[{i}]"])
        assert abs(value - CURVED[i]) < LARGEST_Z * own < 1e-4


@pytest.mark.parametrize("index", [*LAYOUT.indices("lag", "lever_arms").tolist(), 3, 7])
def test_derivatives_by_lag_and_lever_arms_are_those_of_differences(index: int) -> None:
    """Also those of scale factors and angles, whose accelerometers feel more than the point they count from."""
    rng = np.random.default_rng(3)
    u = imu_unknowns(free=np.arange(LAYOUT.size))
    u.values[:12] = [0.1, -0.2, 0.3, 1.01, 0.98, 1.03, 0.01, -0.02, 0.03, 1e-4, -2e-4, 3e-4]
    u["lever_arms"][:], u["lag"][:] = rng.standard_normal(9), 0.2
    rates, level = rng.standard_normal((4, 3)), 9.0 * rng.standard_normal((4, 3))
    centripetal = skews(rates) @ skews(rates)

    def shown(values: Array) -> tuple[Array, Array]:
        at = u.at(values)
        turned = matrices_from_rotation_vectors(at["lag"] * rates)
        gravity = np.einsum("nij,nj->ni", turned, level)
        made = raw_force(at, gravity, lever_arms.apart(at, centripetal))
        made.by_blocks["lever_arms"] = lever_arms.by_lever_arms(made.by_true, centripetal)
        made.by_blocks["lag"] = by_lag(made.by_true, rates, gravity)[:, :, None]
        return made.value, at.columns(made.by_blocks)

    step = np.zeros(LAYOUT.size)
    step[index] = 1e-6
    difference = (shown(u.values + step)[0] - shown(u.values - step)[0]) / 2e-6
    # Second order in 1e-6 of forces of ten, over 1e-6 with 1e-15 of ten.
    np.testing.assert_allclose(difference, shown(u.values)[1][:, :, index], atol=2e-7)


def test_lag_and_lever_arms_have_a_budget_that_adds_up() -> None:
    """Of every parameter, the ones that only a table tells too; what these take is in the others' budget."""
    estimate = _estimate(ALL, lag=LAG, apart=True)
    stated = np.array([p.standard_uncertainty for p in estimate.parameters])
    whole = np.sqrt(sum(part**2 for part in estimate.shown(Budget).shares.values()))
    # sources below 1e-4 of every variance are not in it
    np.testing.assert_allclose(whole, stated, rtol=1e-3)
    names = [p.name for p in estimate.parameters]
    lag = {source: part[names.index(LAG_NAME)] for source, part in estimate.shown(Budget).shares.items()}
    # when gravity comes round in the accelerometers is what tells when they are read
    assert lag["accelerometers while turning"] > 0.5 * stated[names.index(LAG_NAME)]
    assert lag["reference gravity"] == 0.0 if "reference gravity" in lag else True
    assert len(estimate.shown(Budget).statement.effective_degrees) == len(names)
