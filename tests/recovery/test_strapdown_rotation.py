"""The strapdown rotation test against the truth, and against what users do wrong.

Simulated on a two-axis fixture at 50 Hz with all sequences of table 1. In the mean-gyro frame the fixture's
errors do not stand in the result; so they are there throughout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tumble.calibration import Estimate
from tumble.calibration.evidence import Sequences
from tumble.calibration.procedures.strapdown_rotation import calibrate_strapdown_rotation
from tumble.earth import Site
from tumble.errors import ObservabilityError, SegmentationError, TumbleError
from tumble.protocol import HoldStep, Pose, Protocol, Step, TurnStep, named_protocol
from tumble.protocol.strapdown_rotation import SequenceSteps, sequence_steps
from tumble.recording.recording import Recording
from tumble.segmentation import find_timeline, observe_holds
from tumble.segmentation.matching import match_protocol
from tumble.sensor import ImuModel, change_frame
from tumble.sensor.conventions.savage import SavageErrors, savage_from_model
from tumble.simulation import find_grade, simulate_protocol
from tumble.simulation.recordings import Truth
from tumble.simulation.two_axis import FixtureErrors

SITE = Site.from_latitude(np.radians(40.0), 300.0)
SITE = replace(SITE, gravity_sigma=0.0)
PROTOCOL = replace(named_protocol("strapdown-rotation"), site=SITE)
RATE = 50.0
# 1 mrad in everything that a fixture may be off by; the heading is left as it is told, for without noise even 1 mrad
# of it is seen.
FIXTURE = FixtureErrors(
    tilt=(1e-3, -7e-4),
    orthogonality=8e-4,
    inner_zero=-1e-3,
    outer_zero=6e-4,
    mounting=(5e-4, -9e-4, 1e-3),
    execution=3e-4,
)
ERRORS = 1e-3 * np.array(
    [1.1, -0.7, 0.4, 0.2, -0.3, 0.15, 1.3, -0.9, 0.6, 20.0, -30.0, 50.0,
     0.8, -1.2, 1.7, -0.1, 0.25, 0.35, 2.1, -1.6, 0.3, 1.9, -2.4, 0.75]
)  # fmt: skip
GYRO_BIAS = np.array([2e-5, -3e-5, 1e-5])
# What an error is measured in: biases against gravity.
SCALE = np.where(np.isin(np.arange(24), [9, 10, 11]), SITE.gravity, 1.0)
COUNTS = {"SI": (1.0, 1.0), "counts": (1e4, 1e6)}


def calibrated(recording: Recording, protocol: Protocol = PROTOCOL, site: Site = SITE) -> Estimate:
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(protocol, recording, timeline, means)
    return calibrate_strapdown_rotation(recording, timeline, means, matching, protocol, site)


def recorded(
    model: ImuModel | None = None, protocol: Protocol = PROTOCOL, seed: int = 5, **options
) -> tuple[Recording, Truth]:
    options.setdefault("fixture", FIXTURE)
    return simulate_protocol(protocol, RATE, np.random.default_rng(seed), site=SITE, model=model, **options)


def found_errors(estimate: Estimate, units: str = "SI") -> np.ndarray:
    force, rate = COUNTS[units]
    found = estimate.model
    model = ImuModel(found.accelerometer.in_raw_unit(1.0 / force), found.gyroscope.in_raw_unit(1.0 / rate))
    errors, U = savage_from_model(model)
    np.testing.assert_allclose(U, np.eye(3), rtol=0, atol=1e-12)  # it is in the mean-gyro frame already
    return errors.vector


def named_like(model: ImuModel, name: str) -> float:
    """The entry of a model that an estimate's canonical name stands for."""
    triad, _, rest = name.partition(".")
    key, _, index = rest.rstrip("]").partition("[")
    value = model.g_sensitivity if key == "g_sensitivity" else getattr(getattr(model, triad), key)
    return 0.0 if value is None else float(value[tuple(int(i) for i in index.split(","))])


def normalised(estimate: Estimate, truth: Truth) -> dict[str, float]:
    """Error over standard uncertainty of each parameter; a bias against its mean over the rests."""
    assert truth.model is not None
    true = change_frame(truth.model, "mean-gyro")
    weight = np.diff(truth.hold_edges, axis=1)[:, 0]
    weight /= np.sum(weight)
    found: dict[str, float] = {}
    for k, name in enumerate(estimate.names):
        error = named_like(estimate.model, name) - named_like(true, name)
        if ".bias" in name:
            wander = truth.force_wander if name.startswith("acc") else truth.rate_wander
            error -= float(weight @ wander[:, int(name[-2])])
        found[name] = error / float(np.sqrt(estimate.covariance[k, k]))
    return found


# Nothing but the model -----------------------------------------------------------------------------


@pytest.mark.parametrize("units", ["SI", "counts"])
def test_without_noise_all_errors_come_back_on_a_fixture_as_the_protocol_has_it(units: str) -> None:
    """To 5e-8: the Earth's turn of 2 mrad over a sequence meets errors of 1e-3 and angles of samples.

    No error is like another, so that one that shows as another is seen; in counts they have the other signs.
    """
    errors = ERRORS if units == "SI" else -ERRORS
    model = SavageErrors.from_vector(errors, GYRO_BIAS).model()
    recording, _ = recorded(model, units=units, fixture=FixtureErrors())
    estimate = calibrated(recording)
    np.testing.assert_allclose((found_errors(estimate, units) - errors) / SCALE, 0.0, rtol=0, atol=5e-8)
    assert estimate.procedure == "strapdown-rotation"
    assert estimate.frame == "mean-gyro"
    assert len(estimate.shown(Sequences).fits) == 17
    assert not estimate.objections
    # The bias is raw; an asymmetry of 3e-4 makes 2e-8 of an Earth rate of 7e-5 rad/s.
    assert estimate.model.gyroscope is not None
    np.testing.assert_allclose(estimate.model.gyroscope.bias / COUNTS[units][1], GYRO_BIAS, rtol=0, atol=2e-8)


def test_a_fixture_off_by_a_milliradian_everywhere_moves_no_error_by_a_millionth() -> None:
    """What is left is the Earth rate taken out 1 mrad beside: 7e-5 rad/s for 27 s times 1 mrad is 2 µrad at most."""
    recording, _ = recorded(SavageErrors.from_vector(ERRORS, GYRO_BIAS).model())
    left = (found_errors(calibrated(recording)) - ERRORS) / SCALE
    assert 1e-8 < np.max(np.abs(left)) < 1e-6


def test_a_fixture_off_by_a_degree_moves_them_by_some_millionths() -> None:
    """The Earth rate is taken out a degree beside, and what is off by a degree on both sides meets to second order."""
    degree = np.radians(1.0)
    fixture = FixtureErrors(tilt=(degree, -degree), mounting=(degree, degree, -degree))
    recording, _ = recorded(SavageErrors.from_vector(ERRORS, GYRO_BIAS).model(), fixture=fixture)
    left = (found_errors(calibrated(recording)) - ERRORS) / SCALE
    assert np.max(np.abs(left)) < 1e-5


# With noise ----------------------------------------------------------------------------------------


@cache
def noisy(grade: str) -> tuple[Recording, Truth, Estimate]:
    recording, truth = recorded(grade=find_grade(grade))
    return recording, truth, calibrated(recording)


@pytest.mark.parametrize("grade", ["ring-laser", "industrial-mems"])
def test_with_noise_the_truth_is_within_the_uncertainty(grade: str) -> None:
    """4.5 standard uncertainties are passed by chance once in 150,000 parameters."""
    _, truth, estimate = noisy(grade)
    off = normalised(estimate, truth)
    # with the g-sensitivity that a MEMS gyro of this grade has
    assert len(off) == (30 if grade == "ring-laser" else 39)
    assert max(map(abs, off.values())) < 4.5, off
    # and the uncertainties are not so large that nothing could be beyond them
    assert np.sqrt(np.mean(np.square(list(off.values())))) > 0.3
    assert 0.5 < estimate.sigma0 < 1.6  # 44 degrees of freedom, and flicker on top
    assert not estimate.objections


def test_each_play_back_changes_a_thousandth_of_the_one_before() -> None:
    _, _, estimate = noisy("ring-laser")
    assert len(estimate.shown(Sequences).passes) == 3
    first, second, third = (p["kappa_lin"] for p in estimate.shown(Sequences).passes)
    assert second < 0.01 * first
    assert third < 0.01 * second


def test_savage_s_parameters_and_their_uncertainties_are_sums_of_the_matrices_elements() -> None:
    """κ and λ of the diagonals, υ the sum of two elements, which are alike and have one variance between them."""
    _, _, estimate = noisy("ring-laser")
    told = {p.name: p for p in estimate.parameters}

    def combined(*names: str) -> tuple[float, float]:
        at = [estimate.names.index(name) for name in names]
        value = sum(named_like(estimate.model, name) for name in names)
        return value, float(np.sqrt(np.sum(estimate.covariance[np.ix_(at, at)])))

    gyro, force = "gyroscope.matrix[{},{}]".format, "accelerometer.matrix[{},{}]".format
    for k, axis in enumerate("xyz"):
        for name, element in (("gyro", gyro), ("accelerometer", force)):
            value, sigma = combined(element(k, k))
            parameter = told[f"{name} scale factor error {axis}"]
            assert parameter.value == pytest.approx(value - 1.0, abs=1e-15)
            assert parameter.standard_uncertainty == pytest.approx(sigma, rel=1e-6)
        i, j = (k + 1) % 3, (k + 2) % 3
        value, sigma = combined(gyro(i, j), gyro(j, i))
        parameter = told[f"gyro non-orthogonality {'xyz'[i]}{'xyz'[j]}"]
        assert parameter.value == pytest.approx(value, abs=1e-15)
        assert parameter.standard_uncertainty == pytest.approx(sigma, rel=1e-6)
        assert sigma == pytest.approx(2.0 * combined(gyro(i, j))[1], rel=1e-6)
        value, sigma = combined(force(i, j))
        parameter = told[f"accelerometer misalignment {'xyz'[i]}{'xyz'[j]}"]
        assert parameter.value == pytest.approx(value, abs=1e-15)
        assert parameter.standard_uncertainty == pytest.approx(sigma, rel=1e-6)


@cache
def many_without_bias_wander() -> np.ndarray:
    """Six units of white noise alone: error over uncertainty."""
    grade = find_grade("tactical")
    quiet = replace(
        grade,
        accelerometer=replace(
            grade.accelerometer, noise=replace(grade.accelerometer.noise, bias_instability=0.0)
        ),
        gyroscope=replace(grade.gyroscope, noise=replace(grade.gyroscope.noise, bias_instability=0.0)),
    )
    found: list[list[float]] = []
    for seed in range(6):
        recording, truth = recorded(grade=quiet, seed=seed)
        found.append(list(normalised(calibrated(recording), truth).values()))
    return np.array(found)


def test_with_white_noise_alone_the_uncertainties_are_as_large_as_the_errors() -> None:
    """180 numbers, some 24 independent a run: their rms is 1 within some 10 %, twice that is allowed."""
    off = many_without_bias_wander()
    assert 0.75 < np.sqrt(np.mean(off**2)) < 1.25


# Used wrongly ----------------------------------------------------------------------------------------


def changed(protocol: Protocol, name: str, change: Callable[[list[Step], SequenceSteps], None]) -> Protocol:
    """The protocol with one of its sequences made otherwise."""
    steps = list(protocol.steps)
    change(steps, next(s for s in sequence_steps(protocol) if s.name == name))
    return replace(protocol, steps=tuple(steps))


def reverse(steps: list[Step], sequence: SequenceSteps) -> None:
    for number in sequence.turns:
        turn = steps[number]
        assert isinstance(turn, TurnStep)
        assert turn.angle is not None
        steps[number] = replace(turn, angle=-turn.angle)


def exchange(steps: list[Step], sequence: SequenceSteps) -> None:
    first, second = sequence.turns
    steps[first], steps[second] = steps[second], steps[first]


ROWS = {sequence.name: sequence for sequence in sequence_steps(PROTOCOL)}


def of_sequences(names: list[str]) -> Protocol:
    """The protocol with these sequences only, in this order, and a turn anyhow between them."""
    steps: list[Step] = []
    for name in names:
        if steps:
            steps.append(TurnStep(8.0))
        steps += PROTOCOL.steps[ROWS[name].start : ROWS[name].end + 1]
    return replace(PROTOCOL, steps=tuple(steps))


def outer_axis_north() -> Protocol:
    """The protocol with the outer axis of the fixture a quarter turn from where it was."""
    steps = [
        replace(step, pose=replace(step.pose, heading=step.pose.heading - 0.5 * np.pi))
        if isinstance(step, HoldStep) and step.pose is not None and step.pose.heading is not None
        else step
        for step in PROTOCOL.steps
    ]
    return replace(PROTOCOL, steps=tuple(steps))


@pytest.mark.parametrize(
    ("grade", "bound"), [("ring-laser", 1.0), ("tactical", 25.0), ("industrial-mems", 60.0)]
)
def test_a_heading_off_by_a_quarter_turn_is_told_where_the_gyros_see_the_earth(
    grade: str, bound: float
) -> None:
    recording, _, right = noisy(grade)
    wrong = calibrated(recording, outer_axis_north())
    assert not right.objections
    (sentence,) = wrong.objections
    assert "from where the protocol has it. Put right the heading of the fixture" in sentence
    off = float(sentence.split("puts north ")[1].split("°")[0])
    assert abs(off + 90.0) < bound


def test_gyros_that_do_not_see_the_earth_cannot_tell_the_heading_and_it_matters_little_to_them() -> None:
    recording, truth, _ = noisy("consumer-mems")
    wrong = calibrated(recording, outer_axis_north())
    assert not wrong.objections
    assert max(map(abs, normalised(wrong, truth).values())) < 4.5


@pytest.mark.parametrize("latitude", [-40.0, 50.0])
def test_a_latitude_that_the_gyros_contradict_is_told(latitude: float) -> None:
    """Gravity as it is, so that the Earth rate alone is wrong."""
    recording, _, _ = noisy("ring-laser")
    site = replace(SITE, latitude=np.radians(latitude))
    (said,) = calibrated(recording, site=site).objections
    assert "Check the latitude (--site)" in said
    shown = float(said.split("as at ")[1].split("°")[0])
    assert abs(shown - np.degrees(SITE.latitude)) < 1.0


def test_gravity_of_another_site_is_a_scale_factor_and_nothing_shows_it() -> None:
    recording, _, right = noisy("ring-laser")
    wrong = calibrated(recording, site=replace(SITE, gravity=SITE.gravity * (1.0 + 1e-4)))
    assert not wrong.objections
    change = savage_from_model(wrong.model)[0].vector - savage_from_model(right.model)[0].vector
    expected = np.where(np.isin(np.arange(24), [12, 13, 14]), -1e-4, 0.0)
    # misalignments of 1e-3 times 1e-4, and biases of 5e-3 of gravity
    np.testing.assert_allclose(change / SCALE, expected, rtol=0, atol=2e-6)
    assert wrong.sigma0 == pytest.approx(right.sigma0, rel=1e-3)
    assert any(
        "Gravity of another site shows as equal scale factor errors" in t for t in wrong.not_determined
    )


def test_without_a_latitude_the_earth_stands_in_the_uncertainties() -> None:
    recording, truth, right = noisy("ring-laser")
    estimate = calibrated(recording, site=replace(SITE, latitude=None))
    assert any("Without the latitude the Earth rate cannot be taken out" in text for text in estimate.remarks)
    assert max(map(abs, normalised(estimate, truth).values())) < 4.5
    k = estimate.names.index("gyroscope.matrix[0,0]")
    assert estimate.covariance[k, k] > 100.0 * right.covariance[k, k]


def test_without_a_latitude_the_earth_is_taken_for_no_g_sensitivity() -> None:
    """The upward Earth rate goes with the specific force: 4.7e-5 rad/s over g, the same for all three gyros."""
    recording, _, _ = noisy("ring-laser")
    estimate = calibrated(recording, site=replace(SITE, latitude=None))
    assert estimate.model.g_sensitivity is None
    recording, truth, right = noisy("industrial-mems")
    estimate = calibrated(recording, site=replace(SITE, latitude=None))
    assert estimate.model.g_sensitivity is not None
    assert max(map(abs, normalised(estimate, truth).values())) < 4.5
    k = estimate.names.index("gyroscope.g_sensitivity[1,1]")
    assert estimate.covariance[k, k] > right.covariance[k, k] + (4e-5 / SITE.gravity) ** 2


def test_without_headings_the_horizontal_earth_rate_stands_in_the_uncertainties() -> None:
    recording, truth, right = noisy("ring-laser")

    def without_heading(step: Step) -> Step:
        if isinstance(step, HoldStep) and step.pose is not None:
            return replace(step, pose=Pose(step.pose.up_b, None, step.pose.sigma))
        return step

    protocol = replace(PROTOCOL, steps=tuple(without_heading(step) for step in PROTOCOL.steps))
    estimate = calibrated(recording, protocol)
    assert any(
        "Without the headings of the starts the Earth rate cannot be taken out" in text
        and "heading_deg" in text
        for text in estimate.remarks
    )
    assert max(map(abs, normalised(estimate, truth).values())) < 4.5
    k = estimate.names.index("gyroscope.matrix[0,0]")
    assert estimate.covariance[k, k] > 100.0 * right.covariance[k, k]


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("4", reverse, "Sequence 4 was left out: the protocol has +180° y, +180° z, +180° y, +180° z, and"),
        ("13", exchange, "Sequence 13 was left out: the protocol has +180° z, +180° y, and"),
    ],
)
def test_a_sequence_turned_another_way_or_in_another_order_is_left_out_with_what_the_gyros_saw(
    name: str, change: Callable[[list[Step], SequenceSteps], None], words: str
) -> None:
    recording, truth = recorded(protocol=changed(PROTOCOL, name, change), grade=find_grade("ring-laser"))
    estimate = calibrated(recording)
    assert any(text.startswith(words) for text in estimate.remarks)
    assert len(estimate.shown(Sequences).fits) == 16
    # all errors are still told, by others
    assert max(map(abs, normalised(estimate, truth).values())) < 4.5


def test_missing_sequences_are_named_with_the_errors_that_no_other_tells() -> None:
    """Without 3a nobody measured the z gyro's asymmetry, and its scale factor is as uncertain; without 9 not μzx."""
    recording, _ = recorded(
        protocol=of_sequences([name for name in ROWS if name not in ("3a", "9")]),
        grade=find_grade("ring-laser"),
    )
    estimate = calibrated(recording)
    said = " ".join(estimate.remarks)
    for name, steps in (("3a", "steps 21 to 23"), ("9", "steps 58 to 60")):
        assert f"Sequence {name} was not found: its start and its end ({steps}) are missing." in said
    words = " ".join(estimate.not_determined)
    assert "do not determine mu zx (Savage's names)" in words
    assert "asymmetry of gyro z was not measured (it needs the sequences 3 and 3a)" in words
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)), strict=True))
    # 1000 ppm are believed; those of x and y are told by 1 to 2a as ever
    assert sigma["gyroscope.matrix[2,2]"] == pytest.approx(1e-3, rel=0.3)
    assert max(sigma["gyroscope.matrix[0,0]"], sigma["gyroscope.matrix[1,1]"]) < 5e-6
    k = estimate.names.index("accelerometer.matrix[2,0]")
    assert np.sqrt(estimate.covariance[k, k]) == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("told", [True, False])
def test_a_sequence_done_twice_counts_twice_if_the_protocol_says_so_and_does_no_harm_else(told: bool) -> None:
    twice = of_sequences([*ROWS, "7"])
    recording, truth = recorded(protocol=twice, grade=find_grade("ring-laser"))
    estimate = calibrated(recording, twice if told else PROTOCOL)
    assert [fit.name for fit in estimate.shown(Sequences).fits].count("7") == (2 if told else 1)
    assert max(map(abs, normalised(estimate, truth).values())) < 4.5


def test_a_clock_that_is_off_is_a_scale_factor_of_the_gyros_and_nothing_shows_it() -> None:
    recording, _, right = noisy("ring-laser")
    share = 1e-3
    slow = replace(recording, time=recording.time * (1.0 + share), rate=recording.rate / (1.0 + share))
    wrong = calibrated(slow)
    change = savage_from_model(wrong.model)[0].vector - savage_from_model(right.model)[0].vector
    # Turns are longer by the share for the same angle: rates seem to be too large by it.
    expected = np.where(np.arange(24) < 3, share, 0.0)
    np.testing.assert_allclose(change / SCALE, expected, rtol=0, atol=3e-6)
    assert not wrong.objections
    assert wrong.sigma0 == pytest.approx(right.sigma0, rel=0.02)


def test_two_sequences_are_too_few_for_rough_values() -> None:
    protocol = of_sequences(["1", "2"])
    recording, _ = recorded(protocol=protocol, grade=find_grade("ring-laser"))
    with pytest.raises(ObservabilityError, match="do not show each axis of the unit up and down: too few"):
        calibrated(recording, protocol)


def test_rests_alone_are_no_sequences() -> None:
    protocol = named_protocol("multi-position-26")
    recording, _ = simulate_protocol(
        protocol, RATE, np.random.default_rng(1), site=SITE, grade=find_grade("tactical")
    )
    with pytest.raises(
        ObservabilityError, match="No rotation sequence of the protocol multi-position-26 was found"
    ):
        calibrated(recording, protocol)


def swapped(recording: Recording, triad: str, columns: list[int], signs: list[float]) -> Recording:
    if triad == "force":
        assert recording.specific_force is not None
        return replace(recording, specific_force=recording.specific_force[:, columns] * signs)
    assert recording.angular_rate is not None
    return replace(recording, angular_rate=recording.angular_rate[:, columns] * signs)


@pytest.mark.parametrize(
    ("triad", "columns", "signs", "error", "words"),
    [
        ("force", [1, 0, 2], [1, 1, 1], SegmentationError, r"axes are swapped: x is y, y is x\. .*t,ay,ax,az,gx,gy,gz"),
        ("gyro", [0, 1, 2], [-1, -1, -1], ObservabilityError, "gyro x senses -x, gyro y senses -y, gyro z senses -z"),
        ("gyro", [1, 0, 2], [1, 1, 1], ObservabilityError, r"gyro x senses y, .* two are swapped.*gy, gx, gz with"),
        ("gyro", [1, 2, 0], [1, 1, 1], ObservabilityError, "gyro x senses y, gyro y senses z, gyro z senses x"),
        ("gyro", [0, 1, 2], [-1, -1, 1], ObservabilityError, r"gyro x senses -x, gyro y senses -y\. An.*-gx, -gy, gz"),
        ("gyro", [0, 1, 2], [1, 0, 1], ObservabilityError, r"The gyro y shows nothing of what the fixture did\."),
    ],
)  # fmt: skip
def test_swapped_and_reversed_columns_are_named(
    triad: str, columns: list[int], signs: list[float], error: type[TumbleError], words: str
) -> None:
    recording, _, _ = noisy("ring-laser")
    with pytest.raises(error, match=words):
        calibrated(swapped(recording, triad, columns, signs))


@pytest.mark.parametrize("triad", ["specific_force", "angular_rate"])
def test_both_triads_are_needed(triad: str) -> None:
    recording, _, _ = noisy("ring-laser")
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(PROTOCOL, recording, timeline, means)
    lacking = replace(means, **{triad: None, f"{triad}_covariance": None})
    word = "accelerometer" if triad == "specific_force" else "gyro"
    with pytest.raises(ObservabilityError, match=f"has no {word}: the strapdown rotation test needs one"):
        calibrate_strapdown_rotation(recording, timeline, lacking, matching, PROTOCOL, SITE)
