"""The joint estimator's residuals of holds and hand turns: zero at the truth, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tumble.calibration.joint.data import JointData, joint_data
from tumble.calibration.joint.system import start_state
from tumble.calibration.joint.terms import (
    BORDER,
    NODE,
    Extra,
    Section,
    Terms,
    carry,
    hold_terms,
    selected,
    turn_terms,
)
from tumble.calibration.joint.unknowns import SHARED, raw_force, raw_rate

from tumble.attitude.rotations import matrices_from_rotation_vectors
from tumble.calibration.equations.imu_unknowns import unknowns_of
from tumble.earth import Site

Array = npt.NDArray[np.float64]
# Quadratic terms, so that the derivative by the true force is not the matrix alone.
QUADRATIC = np.array([2e-4, -3e-4, 1e-4])


@dataclass
class Scene:
    """Data, a section with attitudes somewhat off, and unknowns."""

    data: JointData
    section: Section
    unknowns: Array
    gravity: float

    def terms(self, section: Section, unknowns: Array) -> dict[str, Terms]:
        found = hold_terms(self.data, section, unknowns, self.gravity, Extra())
        turns = turn_terms(self.data, section, carry(self.data, unknowns), unknowns, Extra())
        assert turns is not None
        return {terms.kind: terms for terms in [*found, turns]}


@pytest.fixture(scope="module")
def scene(play: Any, site: Site, model: Any) -> Scene:
    """Without noise; attitudes off by milliradians, so that head, middle and tail differ; an Earth rate that shows."""
    unknowns = unknowns_of(model)
    unknowns[9:12] = QUADRATIC
    tumbled = play(noise=(1e-9, 1e-11), holds=6)
    data = joint_data(tumbled.data(), unknowns)
    section = start_state(data, unknowns, site).sections[0]
    rng = np.random.default_rng(4)
    turned = matrices_from_rotation_vectors(2e-3 * rng.standard_normal((18, 3)))
    section.C_wb = (turned @ section.C_wb.reshape(-1, 3, 3)).reshape(6, 3, 3, 3)
    section.earth_w = np.array([3e-2, -2e-2, 5e-2])  # a thousand Earths: its own derivatives show
    return Scene(data, section, unknowns, site.gravity)


def moved(section: Section, node: int, axis: int, step: float) -> Section:
    """One attitude of all holds, turned about an axis of w."""
    part, about = divmod(axis, 3)
    by = np.zeros((1, 3))
    by[0, about] = step
    C = section.C_wb.copy()
    C[node, part] = matrices_from_rotation_vectors(by)[0] @ C[node, part]
    return replace(section, C_wb=C)


KINDS = ("force", "rate", "swing", "rest", "turn")
# "rest" takes the derivative of a logarithm at an angle of 3e-3 for that at zero, "turn" too, where Earth and
# attitudes leave 6 mrad x 2 s: half the angle of what it is.
NEGLECTED = {"force": 1e-7, "rate": 5e-3, "swing": 5e-3, "rest": 5e-3, "turn": 0.15}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("following", [False, True], ids=["its own hold", "the next hold"])
def test_derivatives_by_the_attitudes(scene: Scene, kind: str, following: bool) -> None:
    step = 1e-6
    exact = scene.terms(scene.section, scene.unknowns)[kind]
    for t, node in enumerate(exact.node.tolist()):
        at = node + int(following)
        if at >= len(scene.section.C_wb):
            continue
        expected = np.zeros((exact.residual.shape[1], NODE))
        for axis in range(NODE):
            ends = [
                scene.terms(moved(scene.section, at, axis, sign * step), scene.unknowns)[kind].residual[t]
                for sign in (1.0, -1.0)
            ]
            expected[:, axis] = (ends[0] - ends[1]) / (2.0 * step)
        found = exact.by_next[t] if following and exact.by_next is not None else exact.by_node[t]
        if following and exact.by_next is None:
            assert not expected.any()
            continue
        np.testing.assert_allclose(found, expected, atol=NEGLECTED[kind] * max(np.abs(expected).max(), 1e-9))


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_by_the_earth_rate_and_the_shared_unknowns(scene: Scene, kind: str) -> None:
    """Turns: integrals of the design are trapezoids, off by (2.9 rad/s x 0.01 s)² / 12 = 7e-5 of themselves."""
    exact = scene.terms(scene.section, scene.unknowns)[kind]
    expected = np.zeros((*exact.residual.shape, BORDER))
    for j in range(BORDER):
        step = 1e-7 if 3 + 9 <= j < 3 + 12 or j >= 3 + 24 else 1e-6
        ends = []
        for sign in (1.0, -1.0):
            section, unknowns = scene.section, scene.unknowns.copy()
            if j < 3:
                earth = section.earth_w.copy()
                earth[j] += sign * step
                section = replace(section, earth_w=earth)
            else:
                unknowns[j - 3] += sign * step
            ends.append(scene.terms(section, unknowns)[kind].residual)
        expected[:, :, j] = (ends[0] - ends[1]) / (2.0 * step)
    for columns in (slice(0, 3), slice(3, 15), slice(15, 24), slice(24, 27), slice(27, 36)):
        found, true = exact.by_border[:, :, columns], expected[:, :, columns]
        if kind == "turn" and columns.stop == 15:
            # the corrected force acts through g-sensitivity alone: 5e-4 of a turn's, and is left out
            assert np.abs(true).max() < 0.02
            assert not found.any()
            continue
        if kind == "swing":
            # what a gyro's scale does to a swing of milliradians is left out
            assert np.abs(true).max() < 0.01
            assert not found.any()
            continue
        limit = {"turn": NEGLECTED["turn"]}.get(kind, 1e-6)
        np.testing.assert_allclose(found, true, atol=limit * max(float(np.abs(true).max()), 1e-3))


def test_of_a_turn_that_closes_the_derivatives_are_exact_to_the_integral_s_step(
    scene: Scene, site: Site
) -> None:
    """With nothing left over, no logarithm is bent: what remains is the trapezoid's 7e-5, and 2 % of what
    passes from the accelerometer through g-sensitivity of 7e-4."""
    truth = scene.unknowns.copy()
    truth[9:12] = 0.0
    data = joint_data(scene.data.base, truth)
    quiet = Scene(data, start_state(data, truth, site).sections[0], truth, site.gravity)
    exact = quiet.terms(quiet.section, truth)["turn"]
    # headings of the start state are carried, so that nothing but the Earth's 1e-4 rad is left
    assert np.abs(exact.residual).max() < 3e-4
    for j in range(12, SHARED):
        step = 1e-7 if j >= 24 else 1e-6
        ends = []
        for sign in (1.0, -1.0):
            unknowns = truth.copy()
            unknowns[j] += sign * step
            ends.append(quiet.terms(quiet.section, unknowns)["turn"].residual)
        expected = (ends[0] - ends[1]) / (2.0 * step)
        scale = 20.0 if j >= 24 else 2.0  # g-sensitivity: 2 s of 9.8 m/s²
        np.testing.assert_allclose(exact.by_border[:, :, 3 + j], expected, atol=4e-4 * scale)


def test_raw_outputs_and_their_derivatives(model: Any) -> None:
    unknowns = unknowns_of(model)
    unknowns[9:12] = QUADRATIC
    rng = np.random.default_rng(1)
    force, rate = 9.8 * rng.standard_normal((4, 3)), rng.standard_normal((4, 3))
    shown, turned = raw_force(unknowns, force), raw_rate(unknowns, rate, force)
    for j in range(SHARED):
        step = 1e-6
        ends = []
        for sign in (1.0, -1.0):
            x = unknowns.copy()
            x[j] += sign * step
            ends.append((raw_force(x, force).value, raw_rate(x, rate, force).value))
        for found, k in ((shown.by_unknowns, 0), (turned.by_unknowns, 1)):
            np.testing.assert_allclose(found[:, :, j], (ends[0][k] - ends[1][k]) / (2.0 * step), atol=1e-6)
    for j in range(3):
        by = np.zeros(3)
        by[j] = 1e-5
        ends = [raw_force(unknowns, force + sign * by).value for sign in (1.0, -1.0)]
        np.testing.assert_allclose(shown.by_true[:, :, j], (ends[0] - ends[1]) / 2e-5, atol=1e-8)


def test_raw_outputs_are_those_of_the_one_sensor_model(model: Any) -> None:
    rng = np.random.default_rng(2)
    force, rate = 9.8 * rng.standard_normal((5, 3)), rng.standard_normal((5, 3))
    raw = model.distort(force, rate)
    unknowns = unknowns_of(model)
    np.testing.assert_allclose(raw_force(unknowns, force).value, raw[0], atol=1e-13)
    np.testing.assert_allclose(raw_rate(unknowns, rate, force).value, raw[1], atol=1e-13)


def test_terms_left_out_are_the_others_unchanged(scene: Scene) -> None:
    terms = scene.terms(scene.section, scene.unknowns)["turn"]
    some = selected(terms, np.array([True, False, True, False, True]))
    assert some.place.tolist() == [0, 2, 4]
    np.testing.assert_array_equal(some.by_border, terms.by_border[[0, 2, 4]])
    assert some.by_next is not None
