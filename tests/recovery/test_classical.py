"""The six-position test finds what made the hold means, standard and improved, in SI and in counts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.calibration import Calibration, Estimate, calibration_from_estimate
from tumble.calibration.six_position import calibrate_six_position
from tumble.calibration.verdict import judge
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol
from tumble.recording import Recording
from tumble.segmentation import HoldMeans
from tumble.segmentation.matching import MatchedHold, Matching
from tumble.sensor import ImuModel, Triad

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
    assert any("misalignments are not determined" in s for s in estimate.not_determined)
    assert estimate.names[:4] == [
        "accelerometer.matrix[0,0]",
        "accelerometer.matrix[1,1]",
        "accelerometer.matrix[2,2]",
        "accelerometer.bias[0]",
    ]


def test_raw_counts_work_as_well() -> None:
    assert MODEL.accelerometer is not None
    assert MODEL.gyroscope is not None
    counts = ImuModel(
        Triad(400.0 * MODEL.accelerometer.matrix, np.array([32768.0, 33000.0, 32500.0])),
        Triad(1e9 * MODEL.gyroscope.matrix, np.array([100.0, -200.0, 300.0])),
    )
    bench = Bench(model=counts, noise=(0.01, 0.1), units=("counts", "counts"))
    estimate = bench.calibrate(improved=True)
    assert estimate.model.accelerometer is not None
    assert counts.accelerometer is not None
    np.testing.assert_allclose(
        estimate.model.accelerometer.matrix, counts.accelerometer.matrix, rtol=0, atol=1e-8
    )
    length = float(np.linalg.norm(counts.accelerometer.matrix[0]))
    assert value(estimate, "accelerometer scale factor x") == pytest.approx(length, rel=1e-12)
    assert value(estimate, "gyro scale factor x") == pytest.approx(
        1e9 * math.sqrt(0.99**2 + 0.002**2 + 0.003**2), rel=1e-9
    )


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
    assert any("Of the gyro the six poses tell the bias alone" in s for s in estimate.remarks)


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
