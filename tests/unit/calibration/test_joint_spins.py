"""A table's rotation: its residuals vanish where nothing is wrong, and their derivatives are those of differences."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pytest
from tumble.calibration.joint.data import (
    JointData,
    JointSpin,
    joint_data,
    mean_backward_rotation,
    window_spin,
)
from tumble.calibration.joint.spins import Layout, SpinState, add_spin_terms, spin_equations, start_spin
from tumble.calibration.joint.system import JointProblem, JointState, Masks, solve_joint, start_state
from tumble.calibration.joint.terms import BORDER, Extra
from tumble.estimation.bordered import BorderedChain

from tumble.arrays import AnyArray, Table
from tumble.attitude.rotations import matrices_from_rotation_vectors
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.imu_unknowns import unknowns_of
from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep
from tumble.segmentation import Hold, NoiseFloor, Timeline, Turn, observe_holds
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.simulation import TableErrors, simulate_protocol

Array = npt.NDArray[np.float64]
SITE = Site.from_latitude(np.radians(48.0), 300.0)
RATE, SPEED, TURN = 50.0, np.radians(40.0), 2.0 * np.pi
LEVER = np.array([0.05, -0.03, 0.02])
MODEL = change_frame(
    ImuModel(
        Triad(
            np.array([[1.02, 0.003, -0.004], [0.0031, 0.97, 0.002], [-0.0012, 0.0045, 1.05]]),
            np.array([0.02, -0.03, 0.05]),
        ),
        Triad(
            np.array([[0.99, 0.0021, -0.0033], [-0.0014, 1.03, 0.0026], [0.0037, -0.0018, 0.97]]),
            np.array([1e-3, -2e-3, 3e-3]),
        ),
        1e-5 * np.array([[2.0, -3.0, 1.0], [4.0, -1.0, 5.0], [-6.0, 7.0, -2.0]]),
    ),
    "accelerometer-x",
)


class KeptChain(BorderedChain):
    """A chain that keeps the whitened terms as they come, residuals too."""

    @staticmethod
    def of(size: int, border: int) -> KeptChain:
        empty = BorderedChain.zero(1, size, border)
        made = KeptChain(
            empty.diagonal, empty.lower, empty.border, empty.gradient, empty.corner, empty.corner_gradient
        )
        made.kept = []
        return made

    __slots__ = ("kept",)
    kept: list[tuple[np.ndarray, Array, Array | None, Array | None, Array]]

    def add_unary(self, node: np.ndarray, residual: Table, by_node: AnyArray, by_border: AnyArray) -> None:
        self.kept.append((np.asarray(node), residual, by_node, None, by_border))

    def add_links(
        self, node: np.ndarray, residual: Table, by_node: AnyArray, by_next: AnyArray, by_border: AnyArray
    ) -> None:
        self.kept.append((np.asarray(node), residual, by_node, by_next, by_border))

    def add_border(self, residual: Table, by_border: AnyArray) -> None:
        self.kept.append((np.zeros(0, dtype=int), residual, None, None, by_border))


@dataclass
class Turned:
    """One rotation between two rests, where all its unknowns are."""

    data: JointData
    spin: JointSpin
    state: SpinState
    edges: tuple[Array, Array]
    earth_w: Array
    unknowns: Array
    problem: JointProblem
    joint: JointState = field(repr=False)

    def kept(self) -> KeptChain:
        chain = KeptChain.of(3, Layout.of(self.spin).size)
        add_spin_terms(
            chain,
            self.data,
            self.spin,
            self.state,
            self.edges,
            self.earth_w,
            self.unknowns,
            SITE.gravity,
            Extra(),
            wobble=1e-4,
        )
        return chain

    def residuals(self) -> Array:
        return np.concatenate([kept[1].ravel() for kept in self.kept().kept])

    def design(self) -> Array:
        """Dense derivatives: windows' attitudes, then the border."""
        windows, size = len(self.spin.windows), Layout.of(self.spin).size
        rows: list[Array] = []
        for node, residual, by_node, by_next, by_border in self.kept().kept:
            for t in range(len(residual)):
                row = np.zeros((residual.shape[1], 3 * windows + size))
                row[:, 3 * windows :] = by_border[t]
                for by, at in ((by_node, 0), (by_next, 1)):
                    if by is not None:
                        k = int(node[t]) + at
                        row[:, 3 * k : 3 * k + 3] += by[t]
                rows.append(row)
        return np.vstack(rows)

    def moved(self, step: Array) -> Turned:
        """Moved by (3 windows + border)."""
        windows, layout = len(self.spin.windows), Layout.of(self.spin)
        border = step[3 * windows :]
        state = SpinState(
            self.state.C_wb.copy(),
            self.state.axis_b.copy(),
            self.state.axis_w.copy(),
            self.state.own.copy(),
        )
        state.move(step[: 3 * windows].reshape(-1, 3), border[6 : layout.shared])
        turned = matrices_from_rotation_vectors(border[:6].reshape(2, 3))
        return replace(
            self,
            state=state,
            edges=(turned[0] @ self.edges[0], turned[1] @ self.edges[1]),
            earth_w=self.earth_w + border[layout.shared : layout.shared + 3],
            unknowns=self.unknowns + border[layout.shared + 3 :],
        )


@pytest.fixture(scope="module")
def turned() -> Turned:
    """Without noise, about a leaning axis, the unit beside it; solved with the true unknowns held."""
    up = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
    axis = np.array([0.6, 0.64, 0.48])
    pose = Pose(up, 0.4)
    steps = (
        HoldStep(4.0, pose),
        SpinStep(
            axis_b=axis, rate=SPEED, duration=TURN / SPEED - 1.0, ramp=1.0, angle=TURN, angle_sigma=1e-5
        ),
        HoldStep(4.0, None),
    )
    protocol = Protocol("one rotation", "turntable", steps, site=SITE)
    recording, truth = simulate_protocol(
        protocol, RATE, np.random.default_rng(1), site=SITE, model=MODEL, placement=False,
        lever_arm_b=LEVER, table=TableErrors(angle_sigma=0.0),
    )  # fmt: skip
    edges = truth.step_edges
    first, last = (round(float(t) * RATE) for t in (truth.hold_edges[0, 1], truth.hold_edges[1, 0]))
    samples = len(recording.time)
    noise = NoiseFloor(np.full(3, 1e-4), np.full(3, 1e-6), 1.0, "stated")
    holds = (Hold(0, first - 2), Hold(last + 3, samples))
    timeline = Timeline(holds, (Turn(0, 1, first - 2, last + 3),), (), noise)
    base = gather(recording, timeline, observe_holds(recording, timeline))
    unknowns = unknowns_of(MODEL)
    start, stop = (round(float(t) * RATE) for t in edges[1])
    spin = window_spin(
        base, 0, start + 3, stop - 3, SPEED * axis, angle=TURN, angle_sigma=1e-5, largest_angle=0.5
    )
    # modes as of a bias that wanders, whatever two rests tell of it
    number = np.arange(1, 5)
    spin.modes = np.cos(np.pi * number * (spin.time / spin.seconds)[:, None])
    spin.mode_share = 2.0 * np.log((number + 0.5) / (number - 0.5))
    data = joint_data(base, unknowns, [spin])
    # nothing shared is free but a gyro bias that is known: the rotation's own unknowns settle
    problem = JointProblem(data, SITE, np.array([21]), Extra(), Masks.everything(2), wobble={0: 1e-4})
    state = start_state(data, unknowns, SITE)
    solve_joint(problem, state)
    section = state.sections[0]
    ends = (section.C_wb[0, 2], section.C_wb[1, 0])
    return Turned(data, spin, state.spins[0], ends, section.earth_w, state.unknowns, problem, state)


def test_the_truth_of_a_rotation_without_noise_leaves_nothing(turned: Turned) -> None:
    """Every window's specific force to a tenth of its sample's noise: half a rotation of 1e-6 rad that the ramps'
    kinks leave in the trapezoids; the lever arm, at 0.49 rad²/s², to as much."""
    made = spin_equations(
        turned.data, turned.spin, turned.state, turned.edges, turned.earth_w, turned.unknowns, SITE.gravity, Extra(),
        wobble=1e-4,
    )  # fmt: skip
    # along the axis a lever arm does nothing
    axis = turned.state.axis_b
    across = np.eye(3) - np.outer(axis, axis)
    np.testing.assert_allclose(across @ turned.state.own[:3], across @ LEVER, atol=1e-5)
    assert np.abs(made.force_residual).max() < 1e-5
    assert abs(made.angle_residual) < 1e-5
    np.testing.assert_allclose(turned.unknowns, unknowns_of(MODEL), atol=1e-8)


def test_derivatives_of_all_a_rotation_s_residuals(turned: Turned) -> None:
    """Against central differences, near the solution: columns are scaled by their largest element.

    Neglected: of the windows' force, what the gyros' unknowns do to the mean over a window (0.5 rad squared
    over 24); of the links, the trapezoid's step (40°/s over 20 ms, squared over 12) and g-sensitivity by the
    accelerometer's unknowns.
    """
    exact = turned.design()
    columns = exact.shape[1]
    windows, layout = len(turned.spin.windows), Layout.of(turned.spin)
    expected = np.zeros_like(exact)
    for j in range(columns):
        by = np.zeros(columns)
        by[j] = 1e-6
        expected[:, j] = (turned.moved(by).residuals() - turned.moved(-by).residuals()) / 2e-6
    scale = np.abs(expected).max(axis=0)
    off = np.abs(exact - expected).max(axis=0) / np.maximum(scale, 1e-12)
    names = np.array(
        ["window"] * (3 * windows)
        + ["start"] * 3
        + ["end"] * 3
        + ["lever"] * 3
        + ["axis"] * 4
        + ["force wander"] * layout.wander
        + ["rate wander"] * layout.wander
        + ["earth"] * 3
        + ["force"] * 12
        + ["gyro matrix"] * 9
        + ["gyro bias"] * 3
        + ["g-sensitivity"] * 9
    )
    assert names.size == columns == 3 * windows + 6 + layout.own + BORDER
    for name, limit in (
        ("window", 1e-4),
        ("start", 1e-4),
        ("end", 1e-4),
        ("lever", 1e-6),
        ("axis", 1e-5),
        ("force wander", 1e-6),
        ("rate wander", 1e-4),
        ("earth", 1e-4),
        ("force", 2e-2),
        ("gyro matrix", 5e-3),
        ("gyro bias", 5e-3),
        ("g-sensitivity", 5e-3),
    ):
        assert off[names == name].max() < limit, name


def test_eliminating_the_rotation_s_own_unknowns_leaves_the_least_squares_of_the_rest(turned: Turned) -> None:
    """Corner and gradient against the Schur complement of the dense normal equations."""
    windows, layout = len(turned.spin.windows), Layout.of(turned.spin)
    made = spin_equations(
        turned.data, turned.spin, turned.state, turned.edges, turned.earth_w, turned.unknowns, SITE.gravity, Extra(),
        wobble=1e-4,
    )  # fmt: skip
    # residuals that are not zero: a sigma each
    J, r = turned.design(), turned.residuals()
    first = 3 * windows
    outer = np.concatenate([np.arange(first, first + 6), np.arange(first + layout.shared, J.shape[1])])
    inner = np.concatenate([np.arange(first), np.arange(first + 6, first + layout.shared)])
    # by orthogonal projection, which does not square the condition
    Q, _ = np.linalg.qr(J[:, inner])
    rest = J[:, outer] - Q @ (Q.T @ J[:, outer])
    scale = np.abs(J[:, outer]).max() ** 2
    np.testing.assert_allclose(made.corner, rest.T @ rest, atol=1e-7 * scale)
    np.testing.assert_allclose(
        made.gradient, rest.T @ r, atol=1e-7 * np.sqrt(scale) * max(1.0, np.abs(r).max())
    )


def test_the_mean_over_a_window_is_that_of_its_samples(turned: Turned) -> None:
    rate = np.tile(np.array([0.3, -0.5, 0.4]), (len(turned.spin.windows), 1))
    made = mean_backward_rotation(turned.spin, rate)
    at = 0
    for k, (start, stop) in enumerate(turned.spin.windows):
        offsets = turned.spin.offsets[at : at + stop - start]
        each = matrices_from_rotation_vectors(-offsets[:, None] * rate[k])
        np.testing.assert_allclose(made[k], each.mean(axis=0), atol=1e-14)
        at += stop - start


def test_start_values_follow_the_gyros_from_the_hold_before(turned: Turned) -> None:
    again = start_spin(turned.data, turned.spin, turned.edges[0], turned.unknowns, turned.earth_w)
    np.testing.assert_allclose(again.C_wb, turned.state.C_wb, atol=1e-5)
    assert again.axis_w @ turned.state.axis_w == pytest.approx(1.0, abs=1e-9)
