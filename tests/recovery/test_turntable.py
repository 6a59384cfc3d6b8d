"""Both triads from a turntable, from holds and rotations alone; and what is said of a table used wrongly.

The named protocols' steps with shorter holds and one revolution of 60°/s: five minutes at 50 Hz.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recovery.played import MODEL, TURN, Found, in_frame, normalised, short, vector
from tumble.calibration import Estimate
from tumble.calibration.evidence import Budget, Rotations
from tumble.calibration.procedures.laboratory import calibrate_laboratory
from tumble.calibration.procedures.turntable import calibrate_turntable
from tumble.earth import Site
from tumble.errors import ObservabilityError, SegmentationError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, Step
from tumble.recording.recording import Recording
from tumble.sensor import ImuModel
from tumble.simulation import TableErrors, find_grade, simulate_protocol
from tumble.simulation.recordings import Truth

SITE = Site.from_latitude(np.radians(48.0), 300.0)


def calibrated(recording: Recording, protocol: Protocol, site: Site = SITE) -> Estimate:
    found = Found.of(recording, protocol)
    if protocol.procedure == "laboratory":
        return calibrate_laboratory(recording, found.means, found.rotations, found.matching, protocol, site)
    return calibrate_turntable(
        recording, found.timeline, found.means, found.rotations, found.matching, protocol, site
    )


def blocks(model: ImuModel) -> list[np.ndarray]:
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    return [
        model.accelerometer.matrix,
        model.accelerometer.bias,
        model.gyroscope.matrix,
        model.gyroscope.bias,
    ]


def assert_found(estimate: Estimate, truth: Truth, limit: float) -> None:
    """Matrices within `limit` of the scale factor; biases within that share of 10 m/s² and 1 rad/s."""
    true = in_frame(truth.model, estimate.frame)
    whole = blocks(true)
    for k, (found, expected) in enumerate(zip(blocks(estimate.model), whole, strict=True)):
        scale = float(np.mean(np.diag(whole[k - k % 2])))
        np.testing.assert_allclose(found, expected, rtol=0, atol=limit * scale * (10.0 if k == 1 else 1.0))


# Nothing but the model -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "units"), [("turntable-9", "SI"), ("turntable-18", "counts"), ("laboratory", "counts")]
)
def test_without_noise_the_truth_comes_back(name: str, units: str) -> None:
    """To 1e-10: matrices are of condition one, angles of some 10 rad."""
    protocol = short(name, SITE)
    recording, truth = simulate_protocol(
        protocol, 50.0, np.random.default_rng(1), site=SITE, model=MODEL, placement=False, units=units
    )
    estimate = calibrated(recording, protocol)
    assert_found(estimate, truth, 1e-10)
    assert estimate.procedure == protocol.procedure
    assert estimate.frame == ("fixture" if name == "laboratory" else "accelerometer-x")
    assert estimate.model.g_sensitivity is None


def test_placed_anyhow_on_a_table_with_uneven_ramps_the_truth_comes_back_all_the_same() -> None:
    """Degrees off in every pose and axis, the unit beside the axis: none of that is believed."""
    protocol = short("turntable-9", SITE)
    recording, truth = simulate_protocol(
        protocol,
        50.0,
        np.random.default_rng(3),
        site=SITE,
        model=MODEL,
        table=TableErrors(angle_sigma=0.0, ramp_spread=0.3),
        units="counts",
        lever_arm_b=np.array([0.05, -0.03, 0.02]),
    )
    nominal = [step.axis_b for step in protocol.steps if isinstance(step, SpinStep)]
    apart = [spin.axis_b @ axis for spin, axis in zip(truth.spins, nominal, strict=True) if axis is not None]
    assert min(apart) < np.cos(np.radians(2.0))
    assert len({spin.ramps for spin in truth.spins}) == 12
    # round-off of the eigenvector of a plane
    assert_found(calibrated(recording, protocol), truth, 1e-9)


def test_the_laboratory_believes_the_poses_and_is_wrong_by_them() -> None:
    """Half a degree stated exact: the result is off by a good part of it, and says that the poses disagree."""
    exact = short("laboratory", SITE)
    loose = replace(exact, steps=tuple(_posed(step, np.radians(0.5)) for step in exact.steps))
    recording, truth = simulate_protocol(
        loose, 50.0, np.random.default_rng(3), site=SITE, grade=find_grade("tactical"), model=MODEL
    )
    estimate = calibrated(recording, exact)
    off = blocks(estimate.model)[2] - blocks(in_frame(truth.model, "fixture"))[2]
    assert 1e-3 < np.max(np.abs(off)) < 0.03
    assert any("contradict one another by more than" in remark for remark in estimate.remarks)


def _posed(step: Step, sigma: float) -> Step:
    if isinstance(step, HoldStep) and step.pose is not None:
        return replace(step, pose=replace(step.pose, sigma=sigma))
    return step


def test_a_g_sensitivity_that_outdoes_the_earth_is_found_and_moves_nothing_else() -> None:
    """1e-4 rad/s per m/s²; the horizontal Earth rate with its unknown heading is 5e-6 of that unit."""
    G = 1e-4 * np.array([[1.0, -2.0, 0.5], [3.0, -0.7, 1.5], [-2.5, 0.4, 2.0]])
    protocol = short("turntable-18", SITE)
    recording, truth = simulate_protocol(
        protocol, 50.0, np.random.default_rng(4), site=SITE, model=replace(MODEL, g_sensitivity=G)
    )
    estimate = calibrated(recording, protocol)
    found = estimate.model.g_sensitivity
    assert found is not None
    true = in_frame(truth.model, estimate.frame)
    assert true.g_sensitivity is not None
    np.testing.assert_allclose(found, true.g_sensitivity, rtol=0, atol=5e-6)
    assert true.gyroscope is not None
    assert estimate.model.gyroscope is not None
    # the table's 2″ in a whole revolution either way, and a thousandth of what G makes of gravity
    np.testing.assert_allclose(estimate.model.gyroscope.matrix, true.gyroscope.matrix, rtol=0, atol=2e-5)


# Noise ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "grade"),
    [("turntable-9", "tactical"), ("turntable-18", "industrial-mems"), ("laboratory", "industrial-mems")],
)
def test_with_noise_and_placement_errors_the_truth_is_within_the_uncertainty(name: str, grade: str) -> None:
    """A threshold of 4.5 is passed by chance once in 150,000; 72 are looked at. The bias is that of the session."""
    protocol = short(name, SITE)
    recording, truth = simulate_protocol(
        protocol, 50.0, np.random.default_rng(11), site=SITE, grade=find_grade(grade)
    )
    assert np.max(np.abs(normalised(calibrated(recording, protocol), truth))) < 4.5


def test_the_budget_s_squares_add_up_to_the_uncertainty() -> None:
    """Gravity is stated exact here, so that the sources named are all there are."""
    site = replace(SITE, gravity_sigma=0.0)
    for name in ("turntable-9", "laboratory"):
        told = short(name, SITE)
        recording, _ = simulate_protocol(
            told, 50.0, np.random.default_rng(5), site=site, grade=find_grade("tactical")
        )
        estimate = calibrated(recording, told, site)
        whole = np.array([parameter.standard_uncertainty for parameter in estimate.parameters])
        parts = np.array(list(estimate.shown(Budget).shares.values()))
        # a variance component of the placement is in the whole, not among the laboratory's sources
        np.testing.assert_allclose(np.sqrt(np.sum(parts**2, axis=0)), whole, rtol=1e-6)


# Wrong input ---------------------------------------------------------------------------------------


@cache
def session() -> tuple[Recording, Truth]:
    return simulate_protocol(
        short("turntable-9", SITE),
        50.0,
        np.random.default_rng(7),
        site=SITE,
        grade=find_grade("tactical"),
    )


def spins_of(protocol: Protocol) -> list[int]:
    return [k for k, step in enumerate(protocol.steps) if isinstance(step, SpinStep)]


def without(protocol: Protocol, *spins: int) -> Protocol:
    lost = {spins_of(protocol)[k] for k in spins}
    return replace(protocol, steps=tuple(s for k, s in enumerate(protocol.steps) if k not in lost))


def changed(protocol: Protocol, change: Callable[[SpinStep], SpinStep], *spins: int) -> Protocol:
    chosen = {spins_of(protocol)[k] for k in spins} if spins else set(spins_of(protocol))
    return replace(
        protocol,
        steps=tuple(
            change(s) if k in chosen and isinstance(s, SpinStep) else s for k, s in enumerate(protocol.steps)
        ),
    )


def reversed_spin(step: SpinStep) -> SpinStep:
    assert step.angle is not None
    return replace(step, rate=-step.rate, angle=-step.angle)


@pytest.mark.parametrize("named", [True, False], ids=["that the protocol has", "that it has not either"])
def test_a_turn_that_is_missing_is_named_with_what_it_was_for(named: bool) -> None:
    whole = short("turntable-9", SITE)
    lacking = without(whole, 3)
    recording, _ = simulate_protocol(
        lacking, 50.0, np.random.default_rng(7), site=SITE, grade=find_grade("tactical")
    )
    with pytest.raises(
        ObservabilityError,
        match=r"about 5 axes \(x, z, .*and 6 are needed.*the axis y was turned about counter-clockwise only: "
        r"its clockwise turn is missing",
    ):
        calibrated(recording, whole if named else lacking)


def test_a_seventh_axis_one_way_only_takes_no_part_and_it_is_said() -> None:
    recording, truth = session()
    protocol = short("turntable-9", SITE)
    extra = without(replace(protocol, steps=(*protocol.steps, *_again(protocol))), 13)
    recording, truth = simulate_protocol(
        extra, 50.0, np.random.default_rng(7), site=SITE, grade=find_grade("tactical")
    )
    estimate = calibrated(recording, extra)
    assert any(
        remark.startswith("A rotation took no part: the axis x was turned about counter-clockwise only")
        for remark in estimate.remarks
    )
    assert len(estimate.shown(Rotations).fits) == 6
    assert truth.model is not None


def _again(protocol: Protocol) -> tuple[Step, ...]:
    """The steps of the first axis."""
    first = spins_of(protocol)[0]
    return protocol.steps[first - 2 : first + 4]


def test_a_table_that_stopped_early_is_named_by_its_step_and_serves_once_its_angle_is_in_the_protocol() -> (
    None
):
    protocol = short("turntable-9", SITE)
    recording, truth = simulate_protocol(
        protocol,
        50.0,
        np.random.default_rng(7),
        site=SITE,
        grade=find_grade("tactical"),
        table=TableErrors(stops_early=((2, 0.8),)),
    )
    with pytest.raises(
        ObservabilityError,
        match=r"Step 26, about y: the protocol says that the table turned 360°, and the gyros turned about 288°.*"
        r"put the angle that it did turn into the protocol",
    ):
        calibrated(recording, protocol)
    read = replace(protocol, steps=truth.steps)
    estimate = calibrated(recording, read)
    error = vector(estimate.model)[12:21] - vector(in_frame(truth.model, estimate.frame))[12:21]
    sigma = np.sqrt(np.diag(estimate.covariance))[12:21]
    assert np.max(np.abs(error / sigma)) < 4.5


def test_an_angle_a_turn_too_large_is_named_by_its_step() -> None:
    recording, _ = session()
    wrong = changed(short("turntable-9", SITE), lambda s: replace(s, angle=2.0 * TURN * np.sign(s.rate)), 4)
    with pytest.raises(
        ObservabilityError,
        match=r"about z: the protocol says that the table turned 720°, and the gyros turned about 360°",
    ):
        calibrated(recording, wrong)


def test_an_axis_that_stays_vertical_is_objected_to_with_the_way_out() -> None:
    """The gyros' norms are told all the same; how they stand against the accelerometers is not."""
    protocol = short("turntable-9", SITE)
    steps = list(protocol.steps)
    for spin in spins_of(protocol)[::2]:
        turned = steps[spin]
        assert isinstance(turned, SpinStep)
        axis = turned.axis_b
        assert axis is not None
        for rest in (spin - 1, spin + 1, spin + 3):
            step = steps[rest]
            assert isinstance(step, HoldStep)
            assert step.pose is not None
            steps[rest] = replace(step, pose=Pose(axis, None, step.pose.sigma))
    upright = replace(protocol, steps=tuple(steps))
    recording, _ = simulate_protocol(
        upright, 50.0, np.random.default_rng(7), site=SITE, grade=find_grade("tactical"), placement=False
    )
    estimate = calibrated(recording, upright)
    objection = " ".join(estimate.objections)
    assert "do not determine how the gyros stand against the accelerometers" in objection
    assert "stood within 0.0° of the vertical" in objection
    assert "Tilt the table's axis by 30° or more" in objection
    assert any("rotation between the triads is not determined" in words for words in estimate.not_determined)


@pytest.mark.parametrize(
    ("spins", "words"),
    [
        ((), r"Wrong way round.*or the protocol counts angles clockwise"),
        ((0, 1), r"Wrong way round, steps 20, 22: .*Mend the signs"),
    ],
    ids=["all", "of one axis"],
)  # fmt: skip
def test_angles_with_the_wrong_sign_are_told(spins: tuple[int, ...], words: str) -> None:
    recording, _ = session()
    with pytest.raises(SegmentationError, match=words):
        calibrated(recording, changed(short("turntable-9", SITE), reversed_spin, *spins))


def test_without_a_latitude_the_biases_are_from_norms_or_the_earth_is_noise() -> None:
    recording, truth = session()
    nowhere = Site.from_gravity(SITE.gravity)
    estimate = calibrated(recording, short("turntable-9", SITE), nowhere)
    assert any("No latitude was given" in remark for remark in estimate.remarks)
    error = vector(estimate.model)[21:24] - vector(in_frame(truth.model, estimate.frame))[21:24]
    # the wander of a tactical unit's bias in the session is below its own uncertainty without a latitude
    sigma = np.sqrt(np.diag(estimate.covariance))[21:24]
    assert np.max(np.abs(error / sigma)) < 4.5
    # matrices do not know of it
    with_latitude = calibrated(recording, short("turntable-9", SITE))
    np.testing.assert_allclose(
        vector(estimate.model)[:21], vector(with_latitude.model)[:21], rtol=0, atol=1e-6
    )


def test_biases_from_static_pairs_are_exact_where_the_gyros_see_the_earth() -> None:
    protocol = short("turntable-9", SITE)
    recording, truth = simulate_protocol(
        protocol, 50.0, np.random.default_rng(1), site=SITE, model=MODEL, placement=False
    )
    estimate = calibrated(recording, protocol, Site.from_gravity(SITE.gravity))
    assert any("from the norms of their readings at rest" in remark for remark in estimate.remarks)
    np.testing.assert_allclose(
        vector(estimate.model)[21:24],
        vector(in_frame(truth.model, estimate.frame))[21:24],
        rtol=0,
        atol=1e-10,
    )


def test_without_angles_the_protocol_s_rate_is_believed_and_it_is_said() -> None:
    recording, truth = session()
    estimate = calibrated(recording, changed(short("turntable-9", SITE), lambda s: replace(s, angle=None)))
    assert any(
        "12 of 12 rotations were taken at their constant rate" in remark and "`angle_deg`" in remark
        for remark in estimate.remarks
    )
    error = vector(estimate.model)[12:21] - vector(in_frame(truth.model, estimate.frame))[12:21]
    sigma = np.sqrt(np.diag(estimate.covariance))[12:21]
    assert np.max(np.abs(error / sigma)) < 4.5


@pytest.mark.parametrize(
    ("name", "triad"), [("turntable-9", "specific_force"), ("laboratory", "angular_rate")]
)
def test_a_recording_of_one_triad_is_refused(name: str, triad: str) -> None:
    recording, _ = (
        session()
        if name == "turntable-9"
        else simulate_protocol(
            short(name, SITE), 50.0, np.random.default_rng(7), site=SITE, grade=find_grade("tactical")
        )
    )
    protocol = short(name, SITE)
    found = Found.of(recording, protocol)
    bare = replace(found.means, **{triad: None, f"{triad}_covariance": None})
    what = "accelerometer" if triad == "specific_force" else "gyro"

    def calibrate() -> Estimate:
        if name == "laboratory":
            return calibrate_laboratory(recording, bare, found.rotations, found.matching, protocol, SITE)
        return calibrate_turntable(
            recording, found.timeline, bare, found.rotations, found.matching, protocol, SITE
        )

    with pytest.raises(ObservabilityError, match=f"The recording has no {what}"):
        calibrate()


def test_the_laboratory_refuses_axes_in_one_plane_and_an_axis_that_is_missing() -> None:
    protocol = short("laboratory", SITE)
    lacking = without(protocol, 4, 5)
    recording, _ = simulate_protocol(
        lacking, 50.0, np.random.default_rng(7), site=SITE, grade=find_grade("tactical")
    )
    with pytest.raises(
        ObservabilityError,
        match=r"about 2 axes \(x, y\), and 3 are needed for the gyros' whole matrix: about x, y and z",
    ):
        calibrated(recording, lacking)


@pytest.mark.parametrize("name", ["turntable-9", "laboratory"])
def test_readings_that_never_change_at_rest_are_no_trouble(name: str) -> None:
    """Not a digit of noise: covariances of zero, which weigh without an inverse."""
    protocol = short(name, SITE)
    recording, truth = simulate_protocol(
        protocol, 20.0, np.random.default_rng(6), site=SITE, model=MODEL, placement=name != "laboratory"
    )
    recording = replace(
        recording,
        specific_force=np.round(np.asarray(recording.specific_force), 9),
        angular_rate=np.round(np.asarray(recording.angular_rate), 12),
    )
    estimate = calibrated(recording, protocol)
    # 2″ of the table over a revolution both ways, and 1e-9 m/s²
    assert_found(estimate, truth, 5e-6)


@pytest.mark.parametrize(
    ("table", "least", "most"),
    [
        (TableErrors(angle_sigma=0.0, axis_tilt=np.radians(1.0)), 0.0, 1e-9),
        (TableErrors(angle_sigma=0.0, wobble=20.0 / 206265.0), 2e-5, 2e-4),
    ],
    ids=["leans", "wobbles"],
)
def test_an_axis_that_leans_moves_nothing_and_one_that_wobbles_the_rotation_between_the_triads(
    table: TableErrors, least: float, most: float
) -> None:
    """Both triads see the axis lean; a wobble tilts the accelerometers' plane by as much as it wobbles, 1e-4 rad."""
    protocol = short("turntable-9", SITE)
    recording, truth = simulate_protocol(
        protocol, 50.0, np.random.default_rng(3), site=SITE, model=MODEL, table=table
    )
    found, true = (
        blocks(model)[2]
        for model in (calibrated(recording, protocol).model, in_frame(truth.model, "accelerometer-x"))
    )
    off = np.linalg.solve(true, found) - np.eye(3)
    turned = 0.5 * np.linalg.norm(off - off.T, 2)
    assert least <= turned <= most
    # scale factors and non-orthogonalities do not move
    np.testing.assert_allclose(off + off.T, 0.0, atol=2e-7)
