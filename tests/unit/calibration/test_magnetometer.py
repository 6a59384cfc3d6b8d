"""A magnetometer beside the other triads: recovered from a simulator that shares no code, and wrong fields told."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from second_simulator import GRADES, Simulation
from second_simulator.magnetometer import Disturbance, Seen, draw_magnetometer, see
from second_simulator.procedures import by_hand
from tumble.attitude.rotations import matrices_from_rotation_vectors
from tumble.calibration import calibrate, find_procedure
from tumble.calibration.equations.adjustment import NODE
from tumble.calibration.magnetometer.estimate import (
    LOCAL,
    GivenField,
    Magnetometer,
    magnetometer_from_holds,
    magnetometer_of,
    nearest_axes,
)
from tumble.calibration.magnetometer.field_equations import (
    IN_ROOM,
    ON_UNIT,
    FieldAdjustment,
    FieldSeen,
    field_means,
    start_field,
)
from tumble.calibration.magnetometer.verdict import judge_magnetometer
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.calibration.session import Options, Session
from tumble.errors import ObservabilityError
from tumble.recording import Recording
from tumble.recording.rest import limits_reached
from tumble.recording.samples import MagneticField

GIVEN = GivenField(49.2e-6, 0.2e-6, np.radians(66.0))


@cache
def simulated(seed: int = 5) -> tuple[Simulation, JointOutcome]:
    """Return a recording by hand and its joint estimate without the magnetometer."""
    made = by_hand(GRADES["consumer"], np.random.default_rng(seed))
    return made, settled(made)


def settled(made: Simulation, *, gyro: bool = True) -> JointOutcome:
    force_unit, rate_unit = made.units.split(",")
    recording = Recording(
        time=made.time,
        specific_force=made.force,
        angular_rate=made.rate if gyro else None,
        specific_force_unit=force_unit,
        angular_rate_unit=rate_unit,
        rate=100.0,
    )
    session = Session(recording, options=Options(optional_terms=gyro))
    calibrate(session, find_procedure("hand-held" if gyro else "multi-position"))
    return session.joint


def seen(seed: int = 7, wrong: Disturbance | None = None, **sensor: float) -> Seen:
    rng = np.random.default_rng(seed)
    return see(simulated()[0], draw_magnetometer(rng, **sensor), rng, disturbance=wrong)


def magnetic(one: Seen, unit: str = "counts") -> MagneticField:
    return MagneticField(one.time, one.values, unit)


def estimated(one: Seen, given: GivenField | None = None, unit: str = "counts") -> Magnetometer:
    return magnetometer_from_holds(simulated()[1], magnetic(one, unit), given)


@cache
def plain() -> tuple[Seen, Magnetometer]:
    """Return what an undisturbed magnetometer shows, and its calibration in a field of unknown norm."""
    one = seen()
    return one, estimated(one)


def adjusted(one: Seen) -> FieldAdjustment:
    outcome = simulated()[1]
    task = FieldAdjustment.of(outcome.task, field_means(one.time, one.values, outcome.data.base))
    start_field(task)
    return task


def off(made: Magnetometer, one: Seen) -> np.ndarray:
    true = one.matrix("accelerometer-x") * (one.norm if made.field_unit == LOCAL else 1e6)
    return np.concatenate([(made.triad.matrix - true).ravel(), made.triad.bias - one.magnetometer.hard_iron])


@pytest.mark.parametrize("given", [None, GIVEN])
def test_matrix_bias_and_dip_are_the_simulators(given: GivenField | None) -> None:
    one, free = plain()
    made = estimated(one, given) if given else free
    error = off(made, one)
    # A scale that was given is exact in the simulation: what is left is the recording's own part.
    chi_square = float(error @ np.linalg.solve(made.covariance, error))
    assert chi_square < 32.9  # 0.1 % of chi-square with 12 degrees
    assert abs(made.dip - one.dip) < 3.3 * made.dip_sigma
    assert np.linalg.eigvalsh(made.covariance / np.outer(*2 * [np.sqrt(np.diag(made.covariance))]))[0] > 1e-4
    assert judge_magnetometer(made, 0.8).use == "fit"
    assert made.moving is None
    assert made.after < 0.02 < made.before


def test_a_bent_field_is_said_and_its_norm_is_less_certain() -> None:
    """The model's dip is 0.2° uncertain and 4° from the one here: what bends the field changes its norm as well."""
    straight = GivenField(49.2e-6, 0.14e-6, np.radians(66.0), "a model", np.radians(0.2))
    bent = GivenField(49.2e-6, 0.14e-6, np.radians(62.0), "a model", np.radians(0.2))
    one = seen()
    made = estimated(one, straight)
    assert made.norm_sigma == pytest.approx(0.14e-6)
    assert not any("bent" in remark for remark in judge_magnetometer(made, 0.8).remarks)
    wider = estimated(one, bent)
    assert wider.norm_sigma == pytest.approx(49.2e-6 * np.radians(4.0), rel=0.05)
    assert any("bent" in remark for remark in judge_magnetometer(wider, 0.8).remarks)
    assert judge_magnetometer(wider, 0.8).use == "fit"
    assert wider.triad is not None
    # A scale factor's uncertainty has it, an angle's has not.
    spread = np.sqrt(np.diag(wider.covariance))
    assert float(spread[0]) == pytest.approx(float(made.triad.matrix[0, 0]) * np.radians(4.0), rel=0.1)


def test_a_norm_that_the_unit_contradicts_is_said() -> None:
    one = seen(counts=1.15, step=0.0)
    remarks = judge_magnetometer(estimated(one, GIVEN, "uT"), 0.8).remarks
    assert any("is another one" in remark for remark in remarks)
    fitting = judge_magnetometer(estimated(seen(counts=1.0, step=0.0), GIVEN, "uT"), 0.8)
    assert not any("is another one" in remark for remark in fitting.remarks)


def test_a_saturated_magnetometer_is_named_and_a_coarse_one_is_not() -> None:
    one = seen()
    limit = 0.8 * float(np.abs(one.values).max())
    clipped = MagneticField(one.time, np.clip(one.values, -limit, limit), "counts")
    verdict = judge_magnetometer(magnetometer_from_holds(simulated()[1], clipped), 0.8)
    assert verdict.use != "fit"
    assert verdict.reasons[0].startswith("The magnetometer sticks at its limits")
    # Numbers so coarse that a hold repeats them: its largest is one attitude's, and no limit.
    coarse = np.round(one.values / 40.0)
    assert limits_reached(coarse) == []
    assert limits_reached(clipped.values)


def test_an_axis_that_never_changes_is_named() -> None:
    one = seen()
    dead = one.values.copy()
    dead[:, 2] = 17.0
    for outcome in (simulated()[1], None):
        for values, named in ((dead, "z"), (np.ones_like(dead), "x, y, z")):
            with pytest.raises(ObservabilityError, match=f"Its {named} never changes"):
                magnetometer_of(outcome, MagneticField(one.time, values, "counts"))


def test_gravity_is_no_magnetic_field() -> None:
    """Columns of an accelerometer, as a magnetometer's: their field is along gravity, and shows no heading."""
    rng = np.random.default_rng(4)
    one = see(simulated()[0], draw_magnetometer(rng), rng, dip=0.5 * np.pi)
    verdict = judge_magnetometer(estimated(one))
    assert verdict.use == "not fit"
    assert "along gravity" in verdict.reasons[0]


def test_derivatives_are_those_of_differences() -> None:
    task = adjusted(seen())
    layout = task.unknowns.layout
    chosen = layout.indices(IN_ROOM, ON_UNIT)
    task.unknowns = task.unknowns.with_free(np.union1d(task.unknowns.free, chosen))
    task.unknowns.values[chosen] = [0.02, -0.03, 0.01, 1.0, -2.0, 3.0]
    task.course = np.linspace(0.0, 1.0, task.data.holds)
    equations = FieldSeen(task.sections[0], 0)
    (linear,) = equations.linearise(task)
    own = layout.indices("magnetometer.matrix", "magnetometer.bias", "field.dip", "field.azimuth")
    for index in [*own.tolist(), *chosen.tolist()]:
        step = 1e-5 * max(abs(task.unknowns.values[index]), 1.0)
        apart: list[np.ndarray] = []
        for sign in (1.0, -1.0):
            moved = task.copy()
            moved.unknowns.values[index] += sign * step
            apart.append(FieldSeen(moved.sections[0], 0).linearise(moved)[0].residual)
        place = 3 + int(np.searchsorted(task.unknowns.free, index))
        expected: np.ndarray = (apart[0] - apart[1]) / (2.0 * step)
        np.testing.assert_allclose(linear.by_border[:, :, place], expected, rtol=1e-6, atol=1e-6)
    for part in range(NODE):
        apart: list[np.ndarray] = []
        for sign in (1.0, -1.0):
            moved = task.copy()
            vector = np.zeros(3)
            vector[part % 3] = sign * 1e-5
            C = moved.sections[0].C_wb
            C[:, part // 3] = matrices_from_rotation_vectors(vector[None]) @ C[:, part // 3]
            apart.append(FieldSeen(moved.sections[0], 0).linearise(moved)[0].residual)
        np.testing.assert_allclose(
            linear.by_node[:, :, part], (apart[0] - apart[1]) / 2e-5, rtol=1e-4, atol=1e-3
        )


def test_a_hold_beside_iron_is_named() -> None:
    made = estimated(seen(wrong=Disturbance(iron={11: np.array([4.0, -2.0, 1.0])})))
    assert [left.index for left in made.left_out] == [11]
    assert "iron" in made.left_out[0].reason
    assert judge_magnetometer(made, 0.8).use == "fit"


def test_a_current_that_is_switched_on_is_told_with_its_time_and_size() -> None:
    made = simulated()[0]
    holds = [step for step in made.path.steps if step.kind == "hold"]
    current = np.array([1.0, 0.6, -0.8])
    told = estimated(seen(wrong=Disturbance(current=current, since=holds[12].stop + 0.1)))
    assert told.moving.where == "room"
    assert told.moving.before == 12
    assert told.moving.share == pytest.approx(np.linalg.norm(current) / 49.2, rel=0.1)
    verdict = judge_magnetometer(told)
    assert verdict.use == "fit with reservations"
    assert any("after hold 13" in reason for reason in verdict.reasons)


def test_a_current_on_the_unit_is_told_from_one_in_the_room() -> None:
    one = seen()
    values = one.values.copy()
    values[one.time > one.time[len(values) // 2]] += [6.0, -9.0, 12.0]
    told = estimated(replace(one, values=values))
    assert told.moving.where == "unit"
    assert "hard iron" in judge_magnetometer(told).reasons[0]


def test_a_field_that_differs_from_place_to_place_is_in_the_uncertainty() -> None:
    wrong = Disturbance(
        gradient=np.array([[30.0, 8.0, 0.0], [8.0, -10.0, 5.0], [0.0, 5.0, -20.0]]), reach=0.1
    )
    one = seen(wrong=wrong)
    made = estimated(one)
    # Of a gradient G and places of 0.1 m, the field scatters by 0.1 |G| / sqrt(3) each way.
    expected = 0.1 * np.linalg.norm(wrong.gradient) / np.sqrt(3.0) / 49.2
    assert made.scatter == pytest.approx(expected, rel=0.3)
    assert made.uncertainty > 3.0 * plain()[1].uncertainty
    error = off(made, one)
    assert float(error @ np.linalg.solve(made.covariance, error)) < 32.9
    assert judge_magnetometer(made).use != "fit"
    assert "not uniform" in judge_magnetometer(made).reasons[0]


def test_accelerometers_alone_tell_norm_and_dip_and_with_them_the_rotation() -> None:
    one, with_gyros = plain()
    told = magnetometer_from_holds(settled(simulated()[0], gyro=False), magnetic(one))
    assert told.method == "holds"
    error = off(told, one)
    assert float(error @ np.linalg.solve(told.covariance, error)) < 32.9
    # What the gyros add is not little.
    assert np.all(np.diag(told.covariance) > np.diag(with_gyros.covariance))


def test_axes_that_are_swapped_are_said_and_mirrored_ones_are_not_fit() -> None:
    one = seen()
    swapped = replace(one, values=one.values[:, [2, 0, 1]])
    made = estimated(swapped)
    np.testing.assert_array_equal(nearest_axes(made.triad.matrix), np.eye(3)[[2, 0, 1]])
    assert any("x along z" in remark for remark in judge_magnetometer(made).remarks)
    mirrored = estimated(replace(one, values=one.values * [1.0, -1.0, 1.0]))
    assert judge_magnetometer(mirrored, 0.8).use == "not fit"
    assert "mirrored" in judge_magnetometer(mirrored, 0.8).reasons[0]
    assert judge_magnetometer(estimated(replace(one, values=one.values * [1, -1, 1]), GIVEN)).use == "not fit"
    # Without a latitude or a dip nothing can show it, and that is said.
    for nowhere in (None, 0.1):
        unchecked = judge_magnetometer(made, nowhere)
        assert unchecked.use == "fit with reservations"
        assert "is not checked" in unchecked.reasons[0]
    assert judge_magnetometer(made, 0.8).use == "fit"
    # Mirrored axes in the field of the north are proper ones in that of the south: nothing else differs.
    assert mirrored.dip < 0.0
    assert judge_magnetometer(mirrored, np.radians(-35.0)).use == "fit"
    anywhere = judge_magnetometer(mirrored)
    assert anywhere.use == "fit with reservations"
    assert any("southern hemisphere" in reason and "--site" in reason for reason in anywhere.reasons)


def test_a_norm_that_is_no_fields_of_the_earth_is_not_fit() -> None:
    made = estimated(seen(counts=1.0, step=0.1), unit="gauss")
    verdict = judge_magnetometer(made)
    assert verdict.use == "not fit"
    assert "µT in the recording" in verdict.reasons[0]
    assert "--units" in verdict.reasons[0]


def test_a_scale_that_no_unit_has_is_not_fit_and_one_that_a_place_may_have_is_reserved() -> None:
    # The simulator's magnetometer has one count per µT; the norm that is given is 49.2 µT.
    one = seen(counts=1.0, step=0.1)
    for unit, factor, use in (
        ("gauss", 1.0, "not fit"),
        ("uT", 2.2, "not fit"),
        ("uT", 1.6, "fit with reservations"),
        ("uT", 1.0, "fit"),
    ):
        verdict = judge_magnetometer(estimated(replace(one, values=factor * one.values), GIVEN, unit), 0.8)
        assert verdict.use == use, (unit, factor)
        assert (use == "fit") != any("The mean scale factor is" in reason for reason in verdict.reasons)


def test_the_norm_is_given_or_the_units_own() -> None:
    one = seen(counts=1.0, step=0.1)
    free, given = estimated(one, unit="uT"), estimated(one, GIVEN, "uT")
    assert given.norm == 49.2e-6
    assert given.norm_sigma == 0.2e-6
    assert free.norm_sigma == pytest.approx(0.05 * free.norm)
    assert np.cbrt(np.linalg.det(free.triad.matrix)) == pytest.approx(1e6)
    assert any("5 %" in remark for remark in judge_magnetometer(free).remarks)
    assert (plain()[1].field_unit, plain()[1].norm) == (LOCAL, 1.0)


def test_a_hold_without_samples_takes_no_part() -> None:
    one = seen()
    outcome = simulated()[1]
    base = outcome.data.base
    first, last = base.time[base.head[4, 0]], base.time[base.tail[4, 1] - 1]
    keep = (one.time < first) | (one.time > last)
    made = magnetometer_from_holds(outcome, MagneticField(one.time[keep], one.values[keep], "counts"))
    assert 4 not in [hold.hold for hold in made.holds]
