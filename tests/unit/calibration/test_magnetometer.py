"""A magnetometer beside the other triads: recovered from a simulator that shares no code, and wrong fields told."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from second_simulator import GRADES, Simulation
from second_simulator.magnetometer import Disturbance, Seen, draw_magnetometer, see
from second_simulator.procedures import by_hand
from tumble.attitude import matrices_from_rotation_vectors
from tumble.calibration import calibrate, find_procedure
from tumble.calibration.equations.state import NODE
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
from tumble.calibration.magnetometer.verdict import FieldVerdict, judge_magnetometer
from tumble.calibration.outcome.settled import JointOutcome
from tumble.calibration.session import Options, Session
from tumble.errors import ObservabilityError
from tumble.recording import MagneticField, Recording, limits_reached

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


def test_an_axis_that_never_changes_is_named() -> None:
    one = seen()
    dead = one.values.copy()
    dead[:, 2] = 17.0
    for outcome in (simulated()[1], None):
        for values, named in ((dead, "z"), (np.ones_like(dead), "x, y, z")):
            with pytest.raises(ObservabilityError, match=f"Its {named} never changes"):
                magnetometer_of(outcome, MagneticField(one.time, values, "counts"))


def test_a_hold_beside_iron_is_named() -> None:
    made = estimated(seen(wrong=Disturbance(iron={11: np.array([4.0, -2.0, 1.0])})))
    assert [left.index for left in made.left_out] == [11]
    assert "iron" in made.left_out[0].reason
    assert judge_magnetometer(made, 0.8).use == "fit"


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


def verdict_of(values: np.ndarray, given: GivenField | None = None, unit: str = "counts") -> FieldVerdict:
    one = seen()
    return judge_magnetometer(estimated(replace(one, values=values), given, unit), 0.8)


def test_a_saturated_magnetometer_is_named_and_a_coarse_one_is_not() -> None:
    values = seen().values
    limit = 0.8 * float(np.abs(values).max())
    verdict = verdict_of(np.clip(values, -limit, limit))
    assert verdict.use != "fit"
    assert verdict.reasons[0].startswith("The magnetometer sticks at its limits")
    # Numbers so coarse that a hold repeats them: its largest is one attitude's, and no limit.
    assert limits_reached(np.round(values / 40.0)) == []


def test_gravity_is_no_magnetic_field() -> None:
    """Columns of an accelerometer, as a magnetometer's: their field is along gravity, and shows no heading."""
    rng = np.random.default_rng(4)
    verdict = judge_magnetometer(estimated(see(simulated()[0], draw_magnetometer(rng), rng, dip=0.5 * np.pi)))
    assert verdict.use == "not fit"
    assert "along gravity" in verdict.reasons[0]


@pytest.mark.parametrize(
    ("given", "unit", "factor", "use", "said"),
    [
        # The simulator's magnetometer has one count per µT; the norm that is given is 49.2 µT.
        (None, "gauss", 1.0, "not fit", "µT in the recording"),
        (GIVEN, "gauss", 1.0, "not fit", "The mean scale factor is"),
        (GIVEN, "uT", 2.2, "not fit", "The mean scale factor is"),
        (GIVEN, "uT", 1.6, "fit with reservations", "The mean scale factor is"),
        (GIVEN, "uT", 1.15, "fit", "is another one"),
        (GIVEN, "uT", 1.0, "fit", None),
    ],
)
def test_norms_and_scales_that_no_field_or_unit_has_are_not_fit(given, unit, factor, use, said) -> None:
    verdict = verdict_of(factor * seen(counts=1.0, step=0.1).values, given, unit)
    assert verdict.use == use
    every = " ".join([*verdict.reasons, *verdict.remarks])
    assert (said or "") in every
    assert ("The mean scale factor is" in every) == (use != "fit" and given is not None)
    assert ("is another one" in every) == (factor == 1.15) or use != "fit"


def test_a_current_is_told_with_its_time_and_size_and_one_on_the_unit_from_one_in_the_room() -> None:
    holds = [step for step in simulated()[0].path.steps if step.kind == "hold"]
    current = np.array([1.0, 0.6, -0.8])
    told = estimated(seen(wrong=Disturbance(current=current, since=holds[12].stop + 0.1)))
    assert (told.moving.where, told.moving.before) == ("room", 12)
    assert told.moving.share == pytest.approx(np.linalg.norm(current) / 49.2, rel=0.1)
    verdict = judge_magnetometer(told)
    assert verdict.use == "fit with reservations"
    assert any("after hold 13" in reason for reason in verdict.reasons)
    one = seen()
    values = one.values.copy()
    values[len(values) // 2 + 1 :] += [6.0, -9.0, 12.0]
    told = estimated(replace(one, values=values))
    assert told.moving.where == "unit"
    assert "hard iron" in judge_magnetometer(told).reasons[0]


def test_derivatives_are_those_of_differences() -> None:
    outcome, one = simulated()[1], seen()
    task = FieldAdjustment.of(outcome.task, field_means(one.time, one.values, outcome.data.base))
    start_field(task)
    layout = task.unknowns.layout
    chosen = layout.indices(IN_ROOM, ON_UNIT)
    task.unknowns = task.unknowns.with_free(np.union1d(task.unknowns.free, chosen))
    task.unknowns.values[chosen] = [0.02, -0.03, 0.01, 1.0, -2.0, 3.0]
    task.course = np.linspace(0.0, 1.0, task.data.holds)
    (linear,) = FieldSeen(task.sections[0], 0).linearise(task)

    def difference(move: Callable[[FieldAdjustment, float], None], step: float) -> np.ndarray:
        apart: list[np.ndarray] = []
        for sign in (1.0, -1.0):
            moved = task.copy()
            move(moved, sign * step)
            apart.append(FieldSeen(moved.sections[0], 0).linearise(moved)[0].residual)
        return (apart[0] - apart[1]) / (2.0 * step)

    own = layout.indices("magnetometer.matrix", "magnetometer.bias", "field.dip", "field.azimuth")
    for index in [*own.tolist(), *chosen.tolist()]:

        def add(moved: FieldAdjustment, step: float, index: int = index) -> None:
            moved.unknowns.values[index] += step

        expected = difference(add, 1e-5 * max(abs(task.unknowns.values[index]), 1.0))
        place = 3 + int(np.searchsorted(task.unknowns.free, index))
        np.testing.assert_allclose(linear.by_border[:, :, place], expected, rtol=1e-6, atol=1e-6)
    for part in range(NODE):

        def turn(moved: FieldAdjustment, step: float, part: int = part) -> None:
            C = moved.sections[0].C_wb
            C[:, part // 3] = matrices_from_rotation_vectors(step * np.eye(3)[[part % 3]]) @ C[:, part // 3]

        np.testing.assert_allclose(linear.by_node[:, :, part], difference(turn, 1e-5), rtol=1e-4, atol=1e-3)
