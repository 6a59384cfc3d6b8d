"""Every kind of observation keeps one contract: zero at the truth, derivatives of differences, causes that add up."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.unit.estimation.test_chain import random_chain

from tumble.attitude import matrices_from_rotation_vectors, matrix_from_rotation_vector
from tumble.calibration.equations.adjustment import JointAdjustment, RecordingStretch, SectionStretch
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.hold_equations import Force
from tumble.calibration.equations.imu_unknowns import (
    LAYOUT,
    force_matrix,
    imu_unknowns,
    name_plate,
    unknowns_of,
)
from tumble.calibration.equations.observed import BelievedPoses, mode_count, observe, table_rotation
from tumble.calibration.equations.rotation_equations import RotationStretch
from tumble.calibration.equations.state import HEAD, NODE, TAIL
from tumble.calibration.start import start_adjustment
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.estimation import Equations, Linear, Whitened, faster_variance, linearise, solve, wander_basis
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep
from tumble.segmentation import Hold, NoiseFloor, Timeline, Turn, observe_holds
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.simulation import TableErrors, simulate_protocol

SITE = Site.from_latitude(np.radians(48.0), 300.0)
EVERYTHING = np.arange(LAYOUT.size)
SCENES = {
    "by hand": {"force", "rate", "swing", "rest", "turn", "heading", "loose", "earth"},
    "tilts": {"tilt"},
    "poses": {"pose"},
    "table": {"windows", "links", "axis", "angle", "own"},
    "rate": {"table rate"},
}
# Of the largest derivative by the same unknown, what may be neglected: the trapezoid's step in a turn's integrals, and
# what accelerometers do through g-sensitivity.
NEGLECTED = {"gyro": 1e-2, "clock": 1e-2, "force": 2e-2}
# Of what any unit has, how much each has that is zero elsewhere.
ANYWHERE = {
    **dict.fromkeys(("force.quadratic", "force.asymmetry", "gyro.asymmetry", "gyro.quadratic"), 0.7),
    "lever_arms": 0.5,
    "fixture": 0.3,
    "lag": 0.2,
    "clock": 0.1,
    "table_rate": 0.1,
    "gyro.g_sensitivity": 1.0,
}
# Derivatives are of first order in what residuals are not: so much of the largest by the same unknown is the rest.
CURVED = 0.1
# What vanishes where nothing is missed: an axis that leans turns no angle, and a swing is a milliradian itself. And
# what the accelerometers' errors do to gyros through g-sensitivity: a mg is 5e-5 °/s.
NO_MATTER = {
    *(("angle", "axis"), ("table rate", "axis"), ("swing", "gyro.matrix")),
    *((kind, f"force.{of}") for kind in ("turn", "links") for of in ("bias", "scale", "angle")),
}
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


def _by_hand(play, model, site, poses=None) -> JointAdjustment:
    u = imu_unknowns(unknowns_of(model), EVERYTHING)
    data = observe(play(noise=(1e-9, 1e-11), holds=6).data(), u)
    task = start_adjustment(data, u, site)
    if poses is not None:
        data.poses = poses(task.sections[0].C_wb[:, 1])
        task = start_adjustment(data, u, site)
    return task


def _believed(with_heading: bool) -> Callable[[Any], BelievedPoses]:
    def poses(C_wb: Any) -> BelievedPoses:
        C_nf = C_wb @ matrix_from_rotation_vector(np.array([0.03, -0.08, 0.05]))
        sigma = np.linspace(1e-3, 2e-3, len(C_wb))
        return BelievedPoses(np.arange(len(C_wb)), -C_nf[:, 2], C_nf, np.full(len(C_wb), with_heading), sigma)

    return poses


def _on_table(*, rated: bool) -> JointAdjustment:
    """One rotation without noise about a leaning axis, the unit beside it; its own unknowns settled."""
    speed, rate, turn = np.radians(40.0), 50.0, 2.0 * np.pi
    up, axis = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8]), np.array([0.6, 0.64, 0.48])
    steps = (
        HoldStep(4.0, Pose(up, 0.4)),
        SpinStep(
            axis_b=axis, rate=speed, duration=turn / speed - 1.0, ramp=1.0, angle=turn, angle_sigma=1e-5
        ),
        HoldStep(4.0, None),
    )
    protocol = Protocol("one rotation", "turntable", steps, site=SITE)
    recording, truth = simulate_protocol(
        protocol, rate, np.random.default_rng(1), site=SITE, model=MODEL, placement=False,
        lever_arm_b=np.array([0.05, -0.03, 0.02]), table=TableErrors(angle_sigma=0.0),
    )  # fmt: skip
    first, last = (round(float(t) * rate) for t in (truth.hold_edges[0, 1], truth.hold_edges[1, 0]))
    noise = NoiseFloor(np.full(3, 1e-4), np.full(3, 1e-6), 1.0, "stated")
    holds = (Hold(0, first - 2), Hold(last + 3, len(recording.time)))
    timeline = Timeline(holds, (Turn(0, 1, first - 2, last + 3),), (), noise)
    base = gather(recording, timeline, observe_holds(recording, timeline))
    start, stop = (round(float(t) * rate) for t in truth.step_edges[1])
    spin = table_rotation(
        base, 0, start + 3, stop - 3, speed * axis, angle=None if rated else turn, angle_sigma=1e-5,
        largest_angle=0.5, turn_rate=speed if rated else None, rate_sigma=1e-5,
    )  # fmt: skip
    # modes as of a bias that wanders, whatever two rests tell of it
    number = np.arange(1, 5)
    spin.modes = np.cos(np.pi * number * (spin.time / spin.seconds)[:, None])
    spin.mode_share = 2.0 * np.log((number + 0.5) / (number - 0.5))
    # nothing shared is free but a gyro bias that is known: the rotation's own unknowns settle
    u = imu_unknowns(unknowns_of(MODEL), LAYOUT.indices("gyro.bias"))
    task = start_adjustment(observe(base, u, [spin]), u, SITE)
    task.noise.factors["axis"] = {0: 400.0}
    solve(task)
    task.unknowns = task.unknowns.with_free(EVERYTHING)
    return task


@pytest.fixture(scope="module")
def scenes(play: Any, model: Any, site: Site) -> dict[str, JointAdjustment]:
    made = {
        "by hand": _by_hand(play, model, site),
        "tilts": _by_hand(play, model, site, _believed(False)),
        "poses": _by_hand(play, model, site, _believed(True)),
        "table": _on_table(rated=False),
        "rate": _on_table(rated=True),
    }
    made["by hand"].taking_part["force"][2] = False
    return made


def _linear(task: JointAdjustment, *, of_table: bool) -> list[tuple[Equations, Linear]]:
    stretch: Any = RecordingStretch(task).within[0][1]
    if of_table:
        stretch = stretch.within[0][1]
    return [(e, linear) for e in stretch.equations for linear in e.linearise(task)]


def _terms(task: JointAdjustment, *, of_table: bool) -> list[Whitened]:
    return [Whitened.of(e, linear) for e, linear in _linear(task, of_table=of_table)]


def _design(terms: list[Whitened], nodes: int, size: int, border: int) -> np.ndarray:
    """Dense whitened derivatives: by all nodes, then by the border."""
    rows: list[np.ndarray] = []
    for term in terms:
        for t in range(len(term.residual)):
            row = np.zeros((term.residual.shape[1], nodes * size + border))
            row[:, nodes * size + term.linear.columns] = term.by_border[t]
            for by, after in ((term.by_node, 0), (term.by_next, 1)):
                if by is not None:
                    k = int(term.linear.node[t]) + after
                    row[:, size * k : size * (k + 1)] += by[t]
            rows.append(row)
    return np.vstack(rows)


def _moved(task: JointAdjustment, step: np.ndarray, *, of_table: bool) -> JointAdjustment:
    """Return a copy that is moved by a step of nodes and border, as the kernel moves it."""
    made = task.copy()
    section: Any = RecordingStretch(made).within[0][1]
    free = made.unknowns.free.size
    if of_table:
        inner = section.within[0][1]
        count = 3 * inner.nodes
        own, ends = step[count : count + inner.own], step[count + inner.own : count + inner.own + 6]
        inner.move(step[:count].reshape(-1, 3), own)
        nodes = np.zeros((section.nodes, NODE))
        nodes[0, TAIL], nodes[1, HEAD] = ends[:3], ends[3:]
    else:
        nodes = step[: NODE * section.nodes].reshape(-1, NODE)
    section.move(nodes, step[-free - 3 : -free])
    made.unknowns = made.unknowns.at(made.unknowns.values + step[-free:])
    return made


@pytest.mark.parametrize("name", SCENES)
def test_the_truth_without_noise_leaves_nothing(scenes: dict[str, JointAdjustment], name: str) -> None:
    """A hundred-thousandth of a unit: ramps leave kinks in the trapezoids; holds settle with the unit's unknowns."""
    task = scenes[name].copy()
    if name not in ("table", "rate"):
        blocks = ("gyro.bias",) if name == "by hand" else ("gyro.bias", "fixture")
        task.unknowns = task.unknowns.with_free(LAYOUT.indices(*blocks))
        solve(task)
    terms = _terms(task, of_table=name in ("table", "rate"))
    assert {term.equations.kind for term in terms} >= SCENES[name]
    for term in terms:
        if term.equations.kind not in ("own", "earth"):
            # headings of believed poses are those that the start carries, an Earth rate off for some seconds
            limit = 5e-4 if term.equations.kind == "pose" else 2e-5
            assert np.abs(term.raw).max() < limit, term.equations.kind


def _differences(task: JointAdjustment, *, of_table: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return derivatives (rows, unknowns) as the equations have them and by differences, and the rows' kinds."""
    section: Any = RecordingStretch(task).within[0][1]
    stretch = section.within[0][1] if of_table else section
    border = (stretch.layout.earth.stop if of_table else 3) + task.unknowns.free.size
    terms = _terms(task, of_table=of_table)
    exact = _design(terms, stretch.nodes, stretch.size, border)
    roots = [term.root for term in terms]

    def residuals(step: np.ndarray) -> np.ndarray:
        there = _linear(_moved(task, step, of_table=of_table), of_table=of_table)
        white = [
            np.linalg.solve(root, linear.residual[..., None])
            for root, (_, linear) in zip(roots, there, strict=True)
        ]
        return np.concatenate([w.ravel() for w in white])

    expected = np.zeros_like(exact)
    for j in range(exact.shape[1]):
        by = np.zeros(exact.shape[1])
        by[j] = 1e-6
        expected[:, j] = (residuals(by) - residuals(-by)) / 2e-6
    kinds = np.concatenate([np.full(t.residual.size, t.equations.kind) for t in terms])
    # what is zero wherever it is has no difference
    some = ~np.isin(kinds, ["heading", "loose"])
    return exact[some], expected[some], kinds[some]


@pytest.mark.parametrize("name", SCENES)
def test_derivatives_are_those_of_differences(scenes: dict[str, JointAdjustment], name: str) -> None:
    exact, expected, _ = _differences(scenes[name], of_table=name in ("table", "rate"))
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-9 * np.abs(expected).max())
    off = np.abs(exact - expected).max(axis=0) / scale
    first = exact.shape[1] - LAYOUT.size
    assert off[:first].max() < 2e-3
    for block in LAYOUT.blocks:
        place = LAYOUT[block.name]
        limit = NEGLECTED.get(block.name.split(".")[0], 1e-3)
        assert off[first + place.start : first + place.stop].max() < limit, block.name


def _nowhere_zero(task: JointAdjustment, *, of_table: bool) -> JointAdjustment:
    """Return a copy with all unknowns as large as units have them, and all attitudes off by a milliradian."""
    rng, made = np.random.default_rng(5), task.copy()
    u, plate = made.unknowns, name_plate(made.unknowns)
    for name, share in ANYWHERE.items():
        size = share * plate[LAYOUT[name]] * rng.uniform(0.5, 1.5, u[name].size)
        u[name][:] = size * rng.choice([-1.0, 1.0], u[name].size)
    section: Any = RecordingStretch(made).within[0][1]
    section.move(1e-3 * rng.normal(size=(section.nodes, NODE)), 1e-6 * rng.normal(size=3))
    if of_table:
        inner = section.within[0][1]
        own = 1e-3 * rng.normal(size=inner.own)
        own[inner.layout.lever] *= 100.0
        own[inner.layout.rate] *= 0.1
        inner.move(1e-3 * rng.normal(size=(inner.nodes, 3)), own)
    return made


@pytest.mark.parametrize("name", SCENES)
def test_no_kind_misses_a_derivative_by_any_unknown(scenes: dict[str, JointAdjustment], name: str) -> None:
    """Of each kind by itself, where nothing is zero: beside what turns show, nobody sees what windows lack."""
    of_table = name in ("table", "rate")
    task = _nowhere_zero(scenes[name], of_table=of_table)
    exact, expected, kinds = _differences(task, of_table=of_table)
    first = exact.shape[1] - LAYOUT.size
    columns = {block.name: np.arange(first, exact.shape[1])[LAYOUT[block.name]] for block in LAYOUT.blocks}
    columns |= {"earth": np.arange(first - 3, first), "attitudes": np.arange(first - 3)}
    if of_table:
        section: Any = RecordingStretch(task).within[0][1]
        inner = section.within[0][1]
        start, stop = 3 * inner.nodes, 3 * inner.nodes + inner.own
        columns |= {
            n: start + np.r_[getattr(inner.layout, n)] for n in ("lever", "axis", "force", "rate", "anchor")
        }
        columns["attitudes"] = np.r_[:start, stop : first - 3]
    missed: dict[tuple[str, str], float] = {}
    for kind in np.unique(kinds).tolist():
        rows = kinds == kind
        for of, at in ((of, at) for of, at in columns.items() if at.size):
            seen = np.abs(expected[np.ix_(rows, at)]).max()
            off = np.abs(exact[np.ix_(rows, at)] - expected[np.ix_(rows, at)]).max()
            if off > CURVED * seen and off > 1e-9 * np.abs(expected[rows]).max():
                missed[kind, of] = off / seen
    assert set(missed) <= NO_MATTER, missed


@pytest.mark.parametrize("name", SCENES)
def test_causes_add_up_and_covariances_are_positive(scenes: dict[str, JointAdjustment], name: str) -> None:
    task = scenes[name]
    for term in _terms(task, of_table=name in ("table", "rate")):
        covariance = term.linear.covariance
        assert np.linalg.eigvalsh(covariance).min() > 0.0, term.equations.kind
        causes = term.equations.causes(task, term.linear)
        if not causes:
            assert term.equations.kind == "loose"
            continue
        total = sum(causes.values(), np.zeros(covariance.shape))
        np.testing.assert_allclose(total, covariance, atol=1e-9 * np.abs(covariance).max())


@pytest.mark.parametrize("name", ["by hand", "poses", "table"])
def test_what_is_eliminated_leaves_the_least_squares_of_the_rest(scenes, name) -> None:
    """The normal matrix of the free unknowns does not depend on which others are free: held ones are no columns."""
    task = scenes[name].copy()
    plain = LAYOUT.indices("force.bias", "gyro.bias", "gyro.matrix")
    whole = linearise(task)[1]
    task.unknowns = task.unknowns.with_free(plain)
    alone = linearise(task)[1]
    scale = np.sqrt(np.outer(np.diag(alone), np.diag(alone)))
    np.testing.assert_allclose(alone / scale, whole[np.ix_(plain, plain)] / scale, atol=1e-6)


def test_what_tilts_take_off_gravity_is_that_of_drawn_attitudes(scenes: dict[str, JointAdjustment]) -> None:
    """Half a degree, 40,000 draws of three parts that lean together; a sigma's mean to 1 %, its square to 2 %."""
    task = scenes["tilts"].copy()
    force = Force(task.sections[0])
    sigma = np.radians(0.5) * np.array([1.0, 0.5, 2.0])
    nodes = np.broadcast_to(np.tile(np.diag(sigma**2), (3, 3)), (len(force.place), NODE, NODE))
    mean, covariance = force.bent(task, nodes)
    # in the unit's axes, where a tilt does nothing along gravity to first order
    rng, inverse = np.random.default_rng(2), np.linalg.inv(force_matrix(task.unknowns))
    up = np.array([0.0, 0.0, -task.site.gravity])
    turned = matrices_from_rotation_vectors(sigma * rng.standard_normal((40_000, 3)))
    for hold in range(3):
        C = task.sections[0].C_wb[hold, 1]
        along = inverse.T @ (C.T @ up) / (up @ up)
        off = np.swapaxes(turned @ C, 1, 2) @ up @ (C.T @ up) / (up @ up) - 1.0
        assert np.mean(off) == pytest.approx(mean[hold, 3:6] @ along, rel=0.03)
        assert np.var(off) == pytest.approx(along @ covariance[hold, 3:6, 3:6] @ along, rel=0.06)


def test_what_the_gyros_steps_hide_on_a_tables_ramps_is_in_the_first_and_the_last_link_alone() -> None:
    task = _on_table(rated=False)

    def spread() -> Any:
        (rotation,) = [inner for _, inner in RecordingStretch(task).within[0][1].within]
        (links,) = [one for one in rotation.equations if one.kind == "links"]
        return links.linearise(task)[0].covariance

    before = spread()
    ramps = np.array([[1e-4, 3e-4, 2e-4], [5e-4, 1e-4, 4e-4]])
    task.data.rotations[0].ramp_sampling = ramps
    more = np.trace(spread() - before, axis1=1, axis2=2)
    inverse = np.linalg.inv(MODEL.gyroscope.matrix)
    np.testing.assert_allclose(more[[0, -1]], ramps @ np.sum(inverse**2, axis=0), rtol=1e-6)
    np.testing.assert_allclose(more[1:-1], 0.0, atol=1e-15)


def information(signal, count: int, white: float) -> float:
    """What windows with white and 1/f noise, and a constant that is not known, tell of a signal's amplitude."""
    windows = signal.size
    places = (np.arange(windows) + 0.5) / windows
    modes, share = wander_basis(places, count)
    own = white + faster_variance(windows, count)
    covariance = modes @ np.diag(share) @ modes.T + own * np.eye(windows) + 1e3
    return float(signal @ np.linalg.solve(covariance, signal))


@pytest.mark.parametrize("white", [0.5, 0.01])
@pytest.mark.parametrize("phase", [0.0, 0.25, 0.1])
@pytest.mark.parametrize(("windows", "revolutions"), [(83, 4.0), (105, 5.0), (40, 1.5)])
def test_the_cosines_tell_no_more_of_what_goes_round_than_all_of_them_would(
    windows: int, revolutions: float, phase: float, white: float
) -> None:
    """A g-sensitivity shows as a sine in step with the table; as many cosines as windows are the wander itself."""
    places = (np.arange(windows) + 0.5) / windows
    signal = np.cos(2.0 * np.pi * (revolutions * places - phase))
    all_of_them = information(signal, windows - 1, white)
    told = information(signal, mode_count(windows, revolutions), white) / all_of_them
    # Three cosines a revolution without what is faster would claim ten times as much of a sine.
    assert 0.8 < told < 1.02


def test_people_are_told_the_hold_and_its_seconds():
    base = SimpleNamespace(
        time=100.0 + 0.5 * np.arange(60),
        head=np.array([[0, 4], [20, 24]]),
        tail=np.array([[6, 10], [40, 44]]),
    )
    task: Any = SimpleNamespace(data=SimpleNamespace(base=base))
    holds: Any = SimpleNamespace(holds=np.array([1]))
    section, rotation = SectionStretch.__new__(SectionStretch), RotationStretch.__new__(RotationStretch)
    section.task, section.section, rotation.task, rotation.k = task, holds, task, 0
    assert "in hold 2 (10.0 to 21.5 s)" in section.undetermined(0)
    assert "in the rotation after hold 1 (5.0 to 9.5 s)" in rotation.undetermined(3)
    chain, _, _ = random_chain(6, 4, 3, 2)
    chain.stretch = section
    chain.diagonal[0, 1, :] = chain.diagonal[0, :, 1] = 0.0
    with pytest.raises(ObservabilityError, match=r"attitude in hold 2 \(10\.0 to 21\.5 s\)"):
        chain.eliminated()
