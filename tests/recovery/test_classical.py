"""The classical tests find what made the means: six-position, rate table, modified multi-position."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude.directions import twenty_six_directions
from tumble.calibration import Estimate
from tumble.calibration.procedures.modified_multi_position import calibrate_modified_multi_position
from tumble.calibration.procedures.rate_table import calibrate_rate_table
from tumble.calibration.procedures.six_position import calibrate_six_position
from tumble.calibration.session import Session
from tumble.calibration.verdict import judge
from tumble.document import Calibration, calibration_from_estimate
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep, named_protocol
from tumble.recording import Recording
from tumble.segmentation import HoldMeans, SpinMeans
from tumble.segmentation.matching import MatchedHold, MatchedSpin, Matching
from tumble.sensor import ImuModel, Triad
from tumble.simulation import find_grade, simulate_protocol
from tumble.workflows.procedures import run_procedure

SITE = Site(9.81, 0.0, math.radians(40.0), 0.0, "as simulated")
NO_LATITUDE = Site(9.81, 0.0, None, 0.0, "as simulated")
FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
# Small angles, so that what the standard test leaves out is of second order.
MODEL = ImuModel(
    Triad(np.array([[1.02, 0.003, -0.002], [-0.004, 0.98, 0.001], [0.002, -0.005, 1.05]]), np.array([0.1, -0.2, 0.3])),
    Triad(
        np.array([[0.99, 0.002, -0.003], [-0.001, 1.03, 0.004], [0.005, -0.002, 0.97]]),
        np.array([0.01, -0.02, 0.03]),
    ),
)  # fmt: skip


class Bench:
    """Holds in nominal poses: their true vectors, what a unit shows, and the protocol that says so."""

    def __init__(
        self,
        up: np.ndarray = FACES,
        *,
        heading: float | None = 0.3,
        sigma: float = 0.0,
        site: Site = SITE,
        model: ImuModel = MODEL,
        noise: tuple[float, float] = (1e-6, 1e-11),
        off: Rotation | None = None,
        units: tuple[str, str] = ("m/s^2", "rad/s"),
    ) -> None:
        assert model.accelerometer is not None
        assert model.gyroscope is not None
        self.site, self.units = site, units
        poses = [Pose(u, heading, sigma) for u in up]
        truly = [pose.rotation_nb(heading=0.1 * k) for k, pose in enumerate(poses)]
        if off is not None:
            truly = [t * o for t, o in zip(truly, off, strict=True)]
        earth_n = EARTH_RATE * np.array([math.cos(math.radians(40.0)), 0.0, -math.sin(math.radians(40.0))])
        force = np.array([t.inv().apply([0.0, 0.0, -site.gravity]) for t in truly])
        rate = np.array([t.inv().apply(earth_n) for t in truly])
        holds = len(up)
        dof = np.full(holds, 99.0)
        self.means = HoldMeans(
            model.accelerometer.distort(force),
            noise[0] ** 2 * np.tile(np.eye(3), (holds, 1, 1)),
            dof,
            model.gyroscope.distort(rate),
            noise[1] ** 2 * np.tile(np.eye(3), (holds, 1, 1)),
            dof,
            duration=np.full(holds, 10.0),
            time=20.0 * np.arange(holds, dtype=float),
            count=np.full(holds, 1000.0),
            temperature=None,
        )
        steps = tuple(HoldStep(10.0, pose, f"pose {k}") for k, pose in enumerate(poses))
        self.protocol = Protocol("bench", "six-position", steps)
        self.matching = Matching(
            holds=tuple(MatchedHold(k, k) for k in range(holds)), spins=(), missing=(), extra=(), remarks=[]
        )

    @property
    def recording(self) -> Recording:
        means = self.means
        return Recording(means.time, means.specific_force, means.angular_rate, *self.units, 100.0)

    def calibrate(self, *, improved: bool) -> Estimate:
        return calibrate_six_position(
            self.recording, self.means, self.matching, self.protocol, self.site, improved=improved
        )

    def document(self, estimate: Estimate) -> Calibration:
        return calibration_from_estimate(estimate, self.recording, self.site)


def value(estimate: Estimate, name: str) -> float:
    return next(p.value for p in estimate.parameters if p.name == name)


def test_the_improved_test_finds_both_whole_matrices_in_the_fixture_s_axes() -> None:
    bench = Bench()
    estimate = bench.calibrate(improved=True)
    assert estimate.frame == "fixture"
    for found, true in (
        (estimate.model.accelerometer, MODEL.accelerometer),
        (estimate.model.gyroscope, MODEL.gyroscope),
    ):
        assert found is not None
        assert true is not None
        np.testing.assert_allclose(found.matrix, true.matrix, rtol=0, atol=1e-11)  # round-off over 7e-5 rad/s
        np.testing.assert_allclose(found.bias, true.bias, rtol=0, atol=1e-13)
    assert estimate.sigma0 < 1e-6
    # Row length and direction of sensor z, from the matrix by hand.
    length = math.sqrt(0.002**2 + 0.005**2 + 1.05**2)
    assert value(estimate, "accelerometer scale factor error z") == pytest.approx(length - 1.0, abs=1e-12)
    assert value(estimate, "accelerometer misalignment zy") == pytest.approx(
        math.asin(-0.005 / length), abs=1e-12
    )


def test_the_standard_test_finds_biases_and_diagonals() -> None:
    estimate = Bench().calibrate(improved=False)
    force, gyro = estimate.model.accelerometer, estimate.model.gyroscope
    assert force is not None
    assert gyro is not None
    np.testing.assert_allclose(force.bias, [0.1, -0.2, 0.3], rtol=0, atol=1e-13)
    np.testing.assert_allclose(force.matrix, np.diag([1.02, 0.98, 1.05]), rtol=0, atol=1e-13)
    # The horizontal Earth rate has the same heading in both of a pair, up or down: it looks like bias.
    np.testing.assert_allclose(gyro.bias, [0.01, -0.02, 0.03], rtol=0, atol=0.01 * EARTH_RATE)
    assert not any("misalignment" in p.name for p in estimate.parameters)
    assert any("accelerometers' misalignments" in s for s in estimate.not_determined)
    assert estimate.names[:4] == [
        "accelerometer.matrix[0,0]",
        "accelerometer.matrix[1,1]",
        "accelerometer.matrix[2,2]",
        "accelerometer.bias[0]",
    ]


def test_a_gyro_that_does_not_see_the_earth_gets_its_bias_alone() -> None:
    bench = Bench(heading=None, site=NO_LATITUDE, noise=(1e-4, 1e-3))
    estimate = bench.calibrate(improved=True)
    assert estimate.model.gyroscope is not None
    np.testing.assert_allclose(estimate.model.gyroscope.bias, [0.01, -0.02, 0.03], rtol=0, atol=EARTH_RATE)
    assert [n for n in estimate.names if n.startswith("gyroscope")] == [
        f"gyroscope.bias[{i}]" for i in range(3)
    ]
    sigma = next(p.standard_uncertainty for p in estimate.parameters if p.name == "gyro bias y")
    assert sigma == pytest.approx(1e-3 / math.sqrt(6.0), rel=0.02)  # the Earth rate adds a little
    assert any("The six poses determine only the bias of the gyro" in s for s in estimate.remarks)


def test_without_headings_the_improved_test_takes_of_the_gyro_what_the_vertical_tells() -> None:
    estimate = Bench(heading=None).calibrate(improved=True)
    names = [n for n in estimate.names if n.startswith("gyroscope.matrix")]
    assert names == [f"gyroscope.matrix[{i},{i}]" for i in range(3)]
    assert any("headings of the poses are not known" in s for s in estimate.not_determined)


@pytest.mark.parametrize("improved", [False, True])
def test_a_missing_face_is_refused_by_name(improved: bool) -> None:
    with pytest.raises(ObservabilityError, match=r"^No hold with y down was found: record it\.$"):
        Bench(np.delete(FACES, 3, axis=0)).calibrate(improved=improved)


def test_columns_that_are_exchanged_are_refused() -> None:
    bench = Bench()
    assert bench.means.specific_force is not None
    bench.means.specific_force[:] = bench.means.specific_force[:, [1, 0, 2]]
    with pytest.raises(ObservabilityError, match="odd number of axes"):
        bench.calibrate(improved=True)


def test_repeated_poses_and_poses_that_are_no_face_are_all_used() -> None:
    edges = np.array([[1, 1, 0], [0, 1, -1], [-1, 0, 1]]) / math.sqrt(2.0)
    bench = Bench(np.vstack([FACES, FACES[::-1], edges]))
    estimate = bench.calibrate(improved=True)
    assert estimate.degrees_of_freedom == 3 * 15 - 12
    assert any("took no part" in s for s in bench.calibrate(improved=False).remarks)
    # Twice the holds: the noise of a bias falls by the root of two.
    once = Bench().calibrate(improved=False).parameters[0].standard_uncertainty
    twice = Bench(np.vstack([FACES, FACES])).calibrate(improved=False).parameters[0].standard_uncertainty
    assert once / twice == pytest.approx(math.sqrt(2.0), rel=1e-9)


def test_poses_that_contradict_one_another_show_how_badly_the_unit_was_placed() -> None:
    off = Rotation.from_rotvec(np.random.default_rng(3).normal(0.0, math.radians(2.0), (24, 3)))
    up = np.tile(FACES, (4, 1))
    estimate = Bench(up, off=off, noise=(1e-4, 1e-6)).calibrate(improved=True)
    found = next(iter(estimate.variance_components.values()))
    # 60 checks: 9 % of a sigma; three times that.
    assert math.degrees(found) == pytest.approx(2.0, rel=0.27)
    assert any("contradict one another" in s for s in estimate.remarks)
    assert estimate.sigma0 > 50.0
    assert estimate.sigma0_final == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("improved", [False, True])
def test_the_document_says_the_frame_and_the_verdict_and_comes_back_the_same(improved: bool) -> None:
    bench = Bench(noise=(1e-4, 1e-7), sigma=math.radians(0.05))
    estimate = bench.calibrate(improved=improved)
    judgement = judge(estimate, bench.recording)
    assert judgement.fit, judgement.reasons
    document = bench.document(estimate)
    assert document.frame.name == "fixture"
    assert Calibration.model_validate_json(document.to_json()) == document
    assert any("0.05°, as here" in s for s in document.remarks)
    assert any("is 1°" in s for s in document.remarks)
    size = len(document.covariance_parameters)
    assert np.linalg.matrix_rank(document.covariance_matrix, hermitian=True) <= size


def test_a_placement_of_two_degrees_is_not_fit_for_misalignments() -> None:
    bench = Bench(noise=(1e-4, 1e-5), sigma=math.radians(2.0))
    judgement = judge(bench.calibrate(improved=True), bench.recording)
    assert not judgement.fit
    assert any("place the unit more exactly" in reason for reason in judgement.reasons)


# Spins ------------------------------------------------------------------------------------------

G_SENSITIVITY = 1e-4 * np.array([[2.0, -3.0, 1.0], [4.0, -1.0, 5.0], [-6.0, 7.0, -2.0]])
VERTICAL, HORIZONTAL = (
    EARTH_RATE * math.sin(SITE.latitude or 0.0),
    EARTH_RATE * math.cos(SITE.latitude or 0.0),
)
TABLE_RATE = 1e4 * EARTH_RATE
BOTH_WAYS = (1.0, -1.0)
# In the frame accelerometer-x; angles of degrees.
TILTED = ImuModel(
    Triad(np.array([[1.02, 0, 0], [-0.011, 0.98, 0], [0.031, -0.019, 1.05]]), np.array([0.11, -0.23, 0.31])),
    Triad(
        np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]]),
        np.array([0.021, -0.013, 0.034]),
    ),
)


# Rotation vectors, of which a placement's axis leans by the part across it.
LEANS = np.array(
    [
        [0.7, -1.1, 0.4],
        [-0.5, 0.9, 1.3],
        [1.2, 0.3, -0.8],
        [-0.9, -0.6, 0.5],
        [0.2, 1.4, -1.0],
        [-1.3, 0.8, 0.6],
    ]
)


class Table:
    """Placements on a table: a hold in each, then spins at the rates given; exact means of all."""

    def __init__(
        self,
        up: np.ndarray,
        rates: tuple[float, ...],
        *,
        model: ImuModel = TILTED,
        poses: bool = True,
        noise: tuple[float, float] = (1e-8, 1e-10),
        site: Site = SITE,
        units: tuple[str, str] = ("m/s^2", "rad/s"),
        share: float = 0.0,
        lean: float = 0.0,
    ) -> None:
        assert model.accelerometer is not None
        assert model.gyroscope is not None
        self.site, self.units = site, units
        steps: list[Step] = []
        force: list[np.ndarray] = []
        at_rest: list[np.ndarray] = []
        spun: list[np.ndarray] = []
        along: list[np.ndarray] = []
        held: list[MatchedHold] = []
        turned: list[MatchedSpin] = []
        for k, direction in enumerate(up):
            steps.append(TurnStep(2.0))
            held.append(MatchedHold(len(steps), len(force)))
            steps.append(HoldStep(10.0, Pose(direction, None, lean) if poses else None, f"pose {k}"))
            force.append(site.gravity * direction)
            sideways = np.cross(direction, [0.3, -0.5, 0.8])
            at_rest.append(VERTICAL * direction + HORIZONTAL * sideways / np.linalg.norm(sideways))
            for rate in rates:
                turned.append(MatchedSpin(len(steps), 0, 1))
                steps.append(SpinStep(20.0, rate, sigma=share))
                spun.append(
                    (rate + VERTICAL) * (direction + lean * np.cross(direction, LEANS[k % len(LEANS)]))
                )
                along.append(site.gravity * direction)
        sensitivity = np.zeros((3, 3)) if model.g_sensitivity is None else model.g_sensitivity
        gyro = model.gyroscope
        holds, spins = len(force), len(spun)
        self.means = HoldMeans(
            model.accelerometer.distort(np.array(force)),
            noise[0] ** 2 * np.tile(np.eye(3), (holds, 1, 1)),
            np.full(holds, 99.0),
            gyro.distort(np.array(at_rest)) + np.array(force) @ sensitivity.T,
            noise[1] ** 2 * np.tile(np.eye(3), (holds, 1, 1)),
            np.full(holds, 99.0),
            duration=np.full(holds, 10.0),
            time=40.0 * np.arange(holds, dtype=float),
            count=np.full(holds, 1000.0),
            temperature=None,
        )
        self.spins = SpinMeans(
            None,
            None,
            None,
            gyro.distort(np.array(spun)) + np.array(along) @ sensitivity.T,
            noise[1] ** 2 * np.tile(np.eye(3), (spins, 1, 1)),
            np.full(spins, 99.0),
            duration=np.full(spins, 20.0),
            count=np.full(spins, 2000.0),
            time=np.arange(spins, dtype=float),
            period=np.full(spins, 10.0),
        )
        self.protocol = Protocol("table", "rate-table", tuple(steps))
        self.matching = Matching(tuple(held), tuple(turned), (), ())

    @property
    def recording(self) -> Recording:
        means = self.means
        return Recording(means.time, means.specific_force, means.angular_rate, *self.units, 100.0)

    def rate_table(self) -> Estimate:
        return calibrate_rate_table(
            self.recording, self.means, self.spins, self.matching, self.protocol, self.site
        )

    def modified(self) -> Estimate:
        return calibrate_modified_multi_position(
            self.recording, self.means, self.spins, self.matching, self.protocol, self.site
        )


RATES = tuple(math.radians(rate) * way for rate in (10.0, 50.0, 200.0) for way in BOTH_WAYS)


def gyro_of(estimate: Estimate) -> Triad:
    assert estimate.model.gyroscope is not None
    return estimate.model.gyroscope


def test_the_rate_table_finds_the_whole_matrix_and_the_bias_without_the_earth_s_rotation() -> None:
    table = Table(FACES, RATES)
    estimate = table.rate_table()
    assert TILTED.gyroscope is not None
    np.testing.assert_allclose(gyro_of(estimate).matrix, TILTED.gyroscope.matrix, rtol=0, atol=1e-10)
    np.testing.assert_allclose(gyro_of(estimate).bias, TILTED.gyroscope.bias, rtol=0, atol=1e-12)
    assert estimate.frame == "fixture"
    assert estimate.model.accelerometer is None
    assert not any(test.kept for test in estimate.terms)
    np.testing.assert_allclose(estimate.spins.residuals, 0.0, atol=1e-9)
    assert judge(estimate, table.recording).fit


def test_asymmetry_and_quadratic_terms_are_found_where_they_are() -> None:
    assert TILTED.gyroscope is not None
    asymmetry, quadratic = np.array([1e-3, -2e-3, 3e-3]), np.array([2e-4, -1e-4, 3e-4])
    gyro = Triad(TILTED.gyroscope.matrix, TILTED.gyroscope.bias, asymmetry, quadratic)
    table = Table(FACES, RATES, model=ImuModel(TILTED.accelerometer, gyro))
    estimate = table.rate_table()
    found = gyro_of(estimate)
    assert found.asymmetry is not None
    assert found.quadratic is not None
    # The Earth rate that is added to a rate moves |u| by 5e-5 rad/s of up to 3.5: 1e-5 of the terms.
    np.testing.assert_allclose(found.asymmetry, asymmetry, rtol=1e-3)
    np.testing.assert_allclose(found.quadratic, quadratic, rtol=2e-3)
    np.testing.assert_allclose(found.matrix, gyro.matrix, rtol=0, atol=1e-6)
    assert {p.name for p in estimate.parameters} >= {"gyro asymmetry x", "gyro quadratic z"}


def test_asymmetries_see_the_lean_of_a_placement_and_are_no_contradiction() -> None:
    """Of the nominal axis alone, what a leaning sensor is shown of the rate contradicted all: 5.7 % stated for ppm."""
    assert TILTED.gyroscope is not None
    asymmetry = np.array([1e-3, -2e-3, 3e-3])
    gyro = Triad(TILTED.gyroscope.matrix, TILTED.gyroscope.bias, asymmetry)
    model = ImuModel(TILTED.accelerometer, gyro)
    estimate = Table(FACES, RATES, model=model, noise=(1e-8, 1e-6), lean=5e-3).rate_table()
    assert estimate.variance_components["placement of the unit beyond what the protocol states, rad"] == 0.0
    found = gyro_of(estimate)
    assert found.asymmetry is not None
    np.testing.assert_allclose(found.asymmetry, asymmetry, rtol=2e-2)


def test_a_g_sensitivity_is_told_by_placements_up_and_down_and_is_in_the_bias_without() -> None:
    model = ImuModel(TILTED.accelerometer, TILTED.gyroscope, G_SENSITIVITY)
    assert TILTED.gyroscope is not None
    both = Table(FACES, RATES, model=model).rate_table()
    np.testing.assert_allclose(gyro_of(both).bias, TILTED.gyroscope.bias, rtol=0, atol=1e-10)
    np.testing.assert_allclose(gyro_of(both).matrix, TILTED.gyroscope.matrix, rtol=0, atol=1e-9)
    assert value(both, "g-sensitivity of gyro x to force y") == pytest.approx(-3e-4, abs=1e-10)
    assert any("needs the accelerometers' calibration" in s for s in both.remarks)
    up_only = Table(FACES[::2], RATES, model=model).rate_table()
    assert any("g-sensitivity is in the bias" in s for s in up_only.not_determined)
    np.testing.assert_allclose(gyro_of(up_only).matrix, TILTED.gyroscope.matrix, rtol=0, atol=1e-9)
    # One third of what a g does to each gyro, summed over the three directions up.
    off = gyro_of(up_only).bias - TILTED.gyroscope.bias
    np.testing.assert_allclose(off, 9.81 * G_SENSITIVITY.sum(axis=1) / 3.0, rtol=0, atol=1e-5)
    sigma = np.array([p.standard_uncertainty for p in up_only.parameters[:3]])
    assert np.all(np.abs(off) < 5.0 * sigma)


def test_an_axis_that_was_not_spun_keeps_its_nominal_column() -> None:
    estimate = Table(FACES[[0, 1, 4, 5]], RATES).rate_table()
    assert TILTED.gyroscope is not None
    np.testing.assert_allclose(
        gyro_of(estimate).matrix[:, [0, 2]], TILTED.gyroscope.matrix[:, [0, 2]], rtol=0, atol=1e-8
    )
    np.testing.assert_array_equal(gyro_of(estimate).matrix[:, 1], [0.0, 1.0, 0.0])
    assert not any(name.endswith(",1]") for name in estimate.names)
    assert any("not spun about y" in s for s in estimate.not_determined)


def test_counts_whose_matrix_is_not_told_whole_are_not_fit() -> None:
    table = Table(FACES[:2], RATES, units=("counts", "counts"))
    judgement = judge(table.rate_table(), table.recording)
    assert not judgement.fit
    assert any("raw counts are not known about y and z" in reason for reason in judgement.reasons)


def test_one_way_only_is_objected_to_and_one_rate_without_rest_is_refused() -> None:
    one_way = Table(FACES[::2], (0.5, 1.0, 2.0)).rate_table()
    assert sum("one way only" in s for s in one_way.objections) == 3
    table = Table(FACES, (1.0,))
    table.matching = Matching((), table.matching.spins, (), ())
    with pytest.raises(ObservabilityError, match="bias and scale factor cannot be separated"):
        table.rate_table()


def test_without_a_latitude_the_earth_s_rotation_is_an_uncertainty_of_the_bias() -> None:
    assert TILTED.gyroscope is not None
    noise = (1e-6, 1e-7)
    estimate = Table(FACES[:1], RATES, site=NO_LATITUDE, noise=noise).rate_table()
    off = gyro_of(estimate).bias - TILTED.gyroscope.bias
    # The horizontal Earth rate, seen at rest, weighs little beside the spins, not nothing.
    np.testing.assert_allclose(off, VERTICAL * TILTED.gyroscope.matrix[:, 0], rtol=0, atol=1e-7)
    assert abs(off[0]) < 2.0 * estimate.parameters[0].standard_uncertainty < 1e-4
    assert any("No latitude was given" in s for s in estimate.not_determined)
    # Three axes up show it beside the bias; up and down it cancels.
    for up in (FACES[::2], FACES):
        told = gyro_of(Table(up, RATES, site=NO_LATITUDE, noise=noise).rate_table()).bias
        np.testing.assert_allclose(told, TILTED.gyroscope.bias, rtol=0, atol=2e-9)


@pytest.mark.parametrize("procedure", ["rate_table", "modified"])
def test_rates_of_the_wrong_sign_are_refused(procedure: str) -> None:
    table = Table(twenty_six_directions(), RATES)
    assert table.spins.angular_rate is not None
    table.spins.angular_rate[:] *= -1.0
    with pytest.raises(ObservabilityError, match="turn the other way"):
        getattr(table, procedure)()


@pytest.mark.parametrize("procedure", ["rate_table", "modified"])
def test_a_table_known_to_100_ppm_gives_scale_factors_to_no_better(procedure: str) -> None:
    estimate = getattr(Table(twenty_six_directions(), RATES, share=100e-6), procedure)()
    sigma = next(p.standard_uncertainty for p in estimate.parameters if p.name == "gyro scale factor error y")
    assert sigma >= 100e-6


def test_a_gyro_s_calibration_is_a_document_that_corrects_rates_alone() -> None:
    table = Table(FACES, RATES, noise=(1e-4, 1e-6))
    estimate = table.rate_table()
    document = calibration_from_estimate(estimate, table.recording, SITE)
    assert document.accelerometer is None
    assert document.quality.rms_hold_norm is None
    assert document.quality.spins == 36
    assert Calibration.model_validate_json(document.to_json()) == document
    assert table.spins.angular_rate is not None
    force, rate = document.correct(None, table.spins.angular_rate[:1])
    assert force is None
    assert rate is not None
    np.testing.assert_allclose(rate[0], [RATES[0] + VERTICAL, 0.0, 0.0], rtol=0, atol=1e-9)
    assert document.test_vectors[0].raw_specific_force is None
    assert document.test_vectors[0].angular_rate is not None


UNKNOWN_POSES = Rotation.from_rotvec(np.random.default_rng(5).normal(0.0, 0.05, (26, 3))).apply(
    twenty_six_directions()
)


def test_holds_and_spins_in_unknown_poses_tell_both_triads_and_the_rotation_between_them() -> None:
    assert TILTED.accelerometer is not None
    assert TILTED.gyroscope is not None
    model = ImuModel(
        Triad(400.0 * TILTED.accelerometer.matrix, np.array([32768.0, 33000.0, 32500.0])),
        Triad(2e4 * TILTED.gyroscope.matrix, np.array([32768.0, 32000.0, 33500.0])),
    )
    units, noise = ("counts", "counts"), (4e-6, 2e-7)
    rates = (TABLE_RATE, -TABLE_RATE)
    table = Table(UNKNOWN_POSES, rates, model=model, poses=False, units=units, noise=noise)
    estimate = table.modified()
    assert estimate.frame == "accelerometer-x"
    for found, true in (
        (estimate.model.accelerometer, model.accelerometer),
        (estimate.model.gyroscope, model.gyroscope),
    ):
        assert found is not None
        assert true is not None
        np.testing.assert_allclose(found.matrix, true.matrix, rtol=0, atol=1e-9 * np.max(true.matrix))
        np.testing.assert_allclose(found.bias, true.bias, rtol=1e-11)
    assert estimate.sigma0 < 1e-3
    assert judge(estimate, table.recording).fit
    assert any(s.startswith("By norms alone (Syed et al. 2007)") for s in estimate.remarks)


def test_spins_both_ways_tell_the_g_sensitivity_and_without_a_latitude_the_earth_rate() -> None:
    model = ImuModel(TILTED.accelerometer, TILTED.gyroscope, G_SENSITIVITY)
    estimate = Table(UNKNOWN_POSES, (TABLE_RATE, -TABLE_RATE), model=model, poses=False).modified()
    assert estimate.model.g_sensitivity is not None
    np.testing.assert_allclose(estimate.model.g_sensitivity, G_SENSITIVITY, rtol=0, atol=1e-9)
    # Beside the rough tilt of the axis (0.01 rad of 0.7 rad/s) a noise of 1e-10 rad/s is round-off.
    table = Table(UNKNOWN_POSES, (TABLE_RATE, -TABLE_RATE), poses=False, site=NO_LATITUDE, noise=(1e-6, 1e-8))
    nowhere = table.modified()
    assert any(f"came out of the spins as {VERTICAL:.3g}" in s for s in nowhere.remarks)
    assert TILTED.gyroscope is not None
    np.testing.assert_allclose(gyro_of(nowhere).matrix, TILTED.gyroscope.matrix, rtol=0, atol=1e-8)


def test_an_axis_that_points_down_turns_the_rate_round() -> None:
    table = Table(UNKNOWN_POSES, (TABLE_RATE, -TABLE_RATE), poses=False)
    steps = [
        SpinStep(s.duration, -s.rate, axis_b=-UNKNOWN_POSES[k // 4]) if isinstance(s, SpinStep) else s
        for k, s in enumerate(table.protocol.steps)
    ]
    table.protocol = Protocol("table", "modified-multi-position", tuple(steps))
    assert TILTED.gyroscope is not None
    np.testing.assert_allclose(gyro_of(table.modified()).matrix, TILTED.gyroscope.matrix, rtol=0, atol=1e-9)


def test_spins_one_way_only_are_refused_with_what_they_would_hide() -> None:
    table = Table(UNKNOWN_POSES, (TABLE_RATE,), poses=False)
    with pytest.raises(
        ObservabilityError, match=r"(?s)0 clockwise.*The Earth rate alone, at 40°, makes 64 ppm"
    ):
        table.modified()


def test_a_hold_and_a_spin_that_are_no_noise_are_left_out_by_name() -> None:
    table = Table(UNKNOWN_POSES, (TABLE_RATE, -TABLE_RATE), poses=False, noise=(1e-4, 1e-6))
    rng = np.random.default_rng(8)
    assert table.means.specific_force is not None
    assert table.spins.angular_rate is not None
    table.means.specific_force[:] += rng.normal(0.0, 1e-4, (26, 3))
    table.spins.angular_rate[:] += rng.normal(0.0, 1e-6, (52, 3))
    table.means.specific_force[3] *= 1.0 + 5e-4
    table.spins.angular_rate[17] *= 1.0 + 1e-4
    estimate = table.modified()
    assert [(left.kind, left.index) for left in estimate.left_out] == [("hold", 3), ("spin", 17)]
    document = calibration_from_estimate(estimate, table.recording, SITE)
    assert [(left.kind, left.number) for left in document.quality.left_out] == [("hold", 4), ("spin", 18)]
    assert np.all(np.isnan(estimate.spins.residuals[[6, 7, 17]]))


def test_right_tables_are_not_misplaced() -> None:
    """Each sensor by itself saw what all three share: 55 of 100 right tests were refused, with placements 11° off."""
    site = Site.from_latitude(math.radians(48.0), 500.0)
    protocol = replace(named_protocol("rate-table"), site=site)
    for seed in range(70_001, 70_004):
        rng = np.random.default_rng(seed)
        recording, _ = simulate_protocol(protocol, 50.0, rng, site=site, grade=find_grade("tactical"))
        estimate, _ = run_procedure(Session(recording, protocol, site), "rate-table")
        found = estimate.variance_components["placement of the unit beyond what the protocol states, rad"]
        assert found == 0.0
