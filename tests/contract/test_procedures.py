"""What every procedure owes to whoever calls it, run on each."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.adjusted import adjusted

from tumble.calibration import PROCEDURES, Estimate, Turns, find_procedure
from tumble.document import Calibration, calibration_from_estimate, read_part
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.protocol import named_protocol
from tumble.recording import Recording
from tumble.segmentation import HoldMeans, Timeline, find_timeline, observe_holds
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording
from tumble.workflows import calibrate

DOCS = Path(__file__).parents[2] / "docs" / "procedures"
SITE = Site(9.81, 0.0, None, 0.0, "as simulated")


@dataclass(frozen=True)
class Scene:
    recording: Recording
    timeline: Timeline
    means: HoldMeans


Calibrate = Callable[..., Estimate]


def tumbled(poses: np.ndarray, seed: int = 1) -> Scene:
    rng = np.random.default_rng(seed)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, len(poses)), [0.0, 0.0, 1.0]))
    motion = Motion.between_poses(
        headings * poses_26()[poses], np.full(len(poses), 3.0), np.full(len(poses) - 1, 2.0)
    )
    recording, _ = simulate_recording(motion, 50.0, rng, site=SITE, grade=find_grade("consumer-mems"))
    return seen(recording)


def seen(recording: Recording) -> Scene:
    timeline = find_timeline(recording)
    return Scene(recording, timeline, observe_holds(recording, timeline))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return tumbled(np.random.default_rng(2).permutation(26)[:20])


@pytest.fixture(scope="module", params=["hand-held", "multi-position"])
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def procedure(name: str) -> Calibrate:
    def calibrate(scene: Scene, site: Site = SITE, **options: Any) -> Estimate:
        if name == "multi-position":
            scene = seen(replace(scene.recording, angular_rate=None))
        return adjusted(scene.recording, scene.timeline, site, scene.means, procedure=name, **options)

    return calibrate


@pytest.fixture(scope="module")
def estimate(procedure: Calibrate, scene: Scene) -> Estimate:
    return procedure(scene)


@pytest.mark.parametrize("record", PROCEDURES.values(), ids=lambda record: record.name)
class TestRecord:
    """What a record owes."""

    def test_it_is_found_by_its_name_with_its_page_and_its_protocol(self, record) -> None:
        assert find_procedure(record.name) is record
        assert set(PROCEDURES) == set(KNOWN_PROCEDURES)
        assert (DOCS / record.page).is_file()
        if record.example:
            assert named_protocol(record.example).procedure == record.name
            with pytest.raises(UsageError, match=f"tumble simulate {record.example}"):
                calibrate("none.csv", procedure=record.name)

    def test_what_is_tried_next_is_another_procedure_and_the_last_needs_no_protocol(self, record) -> None:
        tried = [record]
        while tried[-1].otherwise:
            tried.append(find_procedure(tried[-1].otherwise))
            assert len({one.name for one in tried}) == len(tried)
        assert len(tried) == 1 or not tried[-1].example


class TestProcedure:
    """The contract."""

    def test_the_accelerometer_is_in_the_frame_accelerometer_x(self, estimate: Estimate) -> None:
        matrix = estimate.model.accelerometer.matrix
        np.testing.assert_array_equal(np.triu(matrix, 1), 0.0)
        assert np.all(np.diag(matrix) > 0)

    def test_the_covariance_of_its_names_is_one(self, estimate: Estimate) -> None:
        covariance = estimate.covariance
        assert len(set(estimate.names)) == len(estimate.names)
        assert covariance.shape == (len(estimate.names), len(estimate.names))
        scale = np.sqrt(np.diag(covariance))
        assert np.all(np.isfinite(scale))
        known = scale > 0
        correlation = covariance[np.ix_(known, known)] / np.outer(scale[known], scale[known])
        np.testing.assert_allclose(correlation, correlation.T, atol=1e-12)
        # More names than unknowns: eigenvalues of zero, never below rounding.
        assert np.linalg.eigvalsh(correlation)[0] > -1e-9

    def test_every_parameter_has_a_finite_value_a_positive_sigma_and_a_unit(self, estimate: Estimate) -> None:
        assert len({parameter.name for parameter in estimate.parameters}) == len(estimate.parameters)
        for parameter in estimate.parameters:
            assert np.isfinite(parameter.value)
            assert 0.0 < parameter.standard_uncertainty < np.inf
            assert parameter.unit
        correlations = estimate.correlations
        assert correlations.shape == (len(estimate.parameters),) * 2
        np.testing.assert_allclose(np.diag(correlations), 1.0, atol=1e-9)
        assert np.max(np.abs(correlations)) < 1.0 + 1e-9

    def test_there_is_one_score_a_hold(self, estimate: Estimate, scene: Scene) -> None:
        holds = len(scene.timeline.holds)
        turns = estimate.shown(Turns)
        scores = [estimate.holds.norms, estimate.holds.sigmas]
        scores += [] if turns is None else [turns.angles, turns.sigmas, turns.sizes]
        assert all(score.shape == (holds,) for score in scores)
        assert np.all(np.isfinite(estimate.holds.norms))

    def test_the_same_data_give_the_same_numbers_and_are_left_alone(self, procedure, estimate, scene) -> None:
        before = scene.recording.specific_force.copy(), scene.means.specific_force.copy()
        again = procedure(scene)
        np.testing.assert_array_equal(again.covariance, estimate.covariance)
        assert again.parameters == estimate.parameters
        np.testing.assert_array_equal(scene.recording.specific_force, before[0])
        np.testing.assert_array_equal(scene.means.specific_force, before[1])

    def test_the_clock_s_origin_does_not_matter(self, procedure, estimate, scene) -> None:
        """An hour later by its stamps: rounding of 5e-13 s in a step of 0.02 s."""
        later = seen(replace(scene.recording, time=scene.recording.time + 3600.0))
        moved = procedure(later)
        np.testing.assert_allclose(
            moved.model.accelerometer.matrix, estimate.model.accelerometer.matrix, atol=1e-7
        )
        # Variances are sought to a share of themselves, and covariances are as uncertain as their variances.
        sigma = np.sqrt(np.diag(estimate.covariance))
        off = np.abs(moved.covariance - estimate.covariance)
        assert np.all(off <= 1e-4 * np.outer(sigma, sigma))

    def test_other_raw_units_scale_the_matrix_and_nothing_else(self, procedure, estimate, scene) -> None:
        """250 counts a m/s² and 4000 a rad/s, with the converter's zero at 2048: dimensionless numbers stay.

        The adjustment stops below 1e-3 sigma, which is its share of the tolerance.
        """
        recording = scene.recording
        counts = replace(
            recording,
            specific_force=2048.0 + 250.0 * recording.specific_force,
            angular_rate=2048.0 + 4000.0 * recording.angular_rate,
            specific_force_unit="counts",
            angular_rate_unit="counts",
        )
        other = procedure(seen(counts))
        np.testing.assert_allclose(
            other.model.accelerometer.matrix / 250.0, estimate.model.accelerometer.matrix, atol=1e-6
        )
        ours = {p.name: p for p in estimate.parameters}
        for parameter in other.parameters:
            if "accelerometer non-orthogonality" in parameter.name:
                own = ours[parameter.name]
                assert parameter.value == pytest.approx(own.value, abs=0.01 * own.standard_uncertainty)
                assert parameter.standard_uncertainty == pytest.approx(own.standard_uncertainty, rel=1e-3)

    def test_an_uncertain_gravity_widens_the_scale_factors(self, procedure, estimate, scene) -> None:
        vague = procedure(scene, replace(SITE, gravity_sigma=0.015))
        for before, after in zip(estimate.parameters, vague.parameters, strict=True):
            assert after.value == pytest.approx(before.value, rel=1e-9)
            if before.name.startswith("accelerometer"):
                share = 0.015 / 9.81 if "scale" in before.name else 0.0
                expected = np.hypot(before.standard_uncertainty, (1.0 + before.value) * share)
                assert after.standard_uncertainty == pytest.approx(expected, rel=1e-3)

    def test_its_document_is_complete_and_reads_back(self, estimate: Estimate, scene: Scene) -> None:
        document = calibration_from_estimate(estimate, scene.recording, SITE)
        again = read_part(Calibration, json.loads(document.to_json()))
        assert again == document
        assert document.verdict.reasons
        assert document.covariance_parameters == estimate.names
