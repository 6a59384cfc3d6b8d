"""The thermal model: what is distorted is corrected again; lag, rate and hysteresis are those of physics."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from tumble.errors import ThermalSpanError
from tumble.sensor import SHAPES, ImuModel, TemperatureBasis, ThermalModel, Triad, follow_temperature

NODES = np.array([-20.0, -3.0, 11.0, 24.0, 38.0, 60.0])
BASES = {
    "polynomial": TemperatureBasis("polynomial", 25.0, order=3),
    "linear": TemperatureBasis("linear", 22.0, NODES),
    "spline": TemperatureBasis("spline", 22.0, NODES),
    "spline-at-node": TemperatureBasis("spline", 11.0, NODES),
}
each_basis = pytest.mark.parametrize("basis", BASES.values(), ids=BASES)


def unit(seed: int = 5) -> ImuModel:
    """A unit with every term, its matrices far from symmetric."""
    n = np.random.default_rng(seed).standard_normal
    matrix, bias, curves = (
        np.diag([1.1, 0.9, 1.05]) + np.triu(0.05 * n((3, 3))),
        0.1 * n(3),
        (2e-3 * n(3), 1e-4 * n(3)),
    )
    gyroscope = Triad(np.eye(3) + 0.04 * n((3, 3)), 0.02 * n(3))
    return ImuModel(Triad(matrix, bias, *curves), gyroscope, 1e-4 * np.outer(n(3), [1.0, -2.0, 3.0]))


def thermal_unit(basis: TemperatureBasis, seed: int = 5) -> ThermalModel:
    rng = np.random.default_rng(seed + 1)
    size = np.power(40.0 if basis.kind == "polynomial" else 1.0, -np.arange(basis.size))
    coefficients = {
        name: 2e-3 * size.reshape(-1, *[1] * len(shape)) * rng.standard_normal((basis.size, *shape))
        for name, shape in SHAPES.items()
    }
    return ThermalModel(
        unit(seed),
        basis,
        coefficients,
        rate_coefficients={"gyroscope.bias": 0.3 * rng.standard_normal(3)},
        hysteresis={name: 2e-3 * rng.standard_normal(3) for name in ("accelerometer.bias", "gyroscope.bias")},
        hysteresis_width=3.0,
        lag=40.0,
        span_celsius=(-20.0, 60.0),
        largest_rate=0.05,
    )


def sweep(samples: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time with an uneven step, temperature up and down, force and rate."""
    rng = np.random.default_rng(11)
    time = np.cumsum(rng.uniform(0.5, 1.5, samples))
    temperature = 20.0 + 38.0 * np.sin(time / 700.0)
    return time, temperature, 8.0 * rng.standard_normal((samples, 3)), rng.standard_normal((samples, 3))


@each_basis
def test_correcting_undoes_distorting(basis: TemperatureBasis) -> None:
    """Both are the same formula solved two ways; rounding of numbers up to 30 leaves 1e-14 of them."""
    model = thermal_unit(basis)
    time, temperature, force, rate = sweep()
    raw = model.distort(time, force, rate, temperature)
    assert np.abs(raw[0] - force).max() > 0.1
    back = model.correct_along(model.path(time, temperature), time, *raw)
    np.testing.assert_allclose(np.array(back), [force, rate], atol=1e-12)


@each_basis
def test_each_sample_is_distorted_by_the_unit_at_its_own_temperature(basis: TemperatureBasis) -> None:
    """`at` and the isothermal model know nothing of the sums over samples."""
    model = thermal_unit(basis)
    time, temperature, force, rate = sweep(300)
    raw_force, raw_rate = model.distort(time, force, rate, temperature)
    path = model.path(time, temperature)
    inside, speed, state = path.temperature, path.rate, path.hysteresis
    for k in range(0, 300, 37):
        there = model.at(inside[k], speed[k], state[k])
        expected = there.distort(force[k : k + 1], rate[k : k + 1])
        np.testing.assert_allclose(raw_force[k], expected[0][0], atol=1e-13)
        np.testing.assert_allclose(raw_rate[k], expected[1][0], atol=1e-13)


@each_basis
def test_functions_are_zero_at_the_reference_nowhere_jump_and_have_their_derivatives(basis) -> None:
    assert np.all(basis.values(np.array([basis.reference_celsius])) == 0.0)
    assert len(basis.labels) == len(basis.units) == basis.size
    # Central differences over 2e-3 K of cubics are off by 1e-6 K² of their third derivative; they meet no node.
    temperature = np.linspace(-31.3, 77.7, 203)
    change = (basis.values(temperature + 1e-3) - basis.values(temperature - 1e-3)) / 2e-3
    np.testing.assert_allclose(change, basis.derivatives(temperature), atol=1e-5, rtol=1e-7)
    edges = NODES[:, None] + np.array([-1e-9, 1e-9])
    below, above = basis.values(edges[:, 0]), basis.values(edges[:, 1])
    slope = np.abs(basis.derivatives(NODES)).max()
    np.testing.assert_allclose(below, above, atol=4e-9 * slope)  # 2e-9 K at twice the steepest
    if basis.kind != "linear":
        left, right = basis.derivatives(edges[:, 0]), basis.derivatives(edges[:, 1])
        np.testing.assert_allclose(left, right, atol=1e-9 * max(slope, 1.0))


def test_the_spline_is_the_natural_cubic_spline() -> None:
    """Against scipy's, for values at the nodes less the one at the reference; beyond it scipy's is not straight."""
    values = np.array([0.3, -1.0, 2.0, 0.5, 0.1, 4.0])
    basis = TemperatureBasis("spline", 11.0, NODES)
    coefficients = np.delete(values - values[2], 2)
    temperature = np.linspace(-20.0, 60.0, 400)
    reference = CubicSpline(NODES, values, bc_type="natural")
    np.testing.assert_allclose(
        basis.values(temperature) @ coefficients + values[2], reference(temperature), atol=1e-12
    )
    beyond = basis.values(np.array([60.0, 70.0])) @ coefficients
    assert beyond[1] - beyond[0] == pytest.approx(10.0 * float(reference(60.0, 1)), rel=1e-12)


def test_the_linear_basis_interpolates_between_soaks() -> None:
    """The thesis' model: with the reference at a soak a coefficient is the difference from there."""
    values = np.array([0.3, -1.0, 2.0, 0.5, 0.1, 4.0])
    basis = TemperatureBasis("linear", 24.0, NODES)
    temperature = np.linspace(-20.0, 60.0, 333)
    modelled = basis.values(temperature) @ np.delete(values - values[3], 3) + values[3]
    np.testing.assert_allclose(modelled, np.interp(temperature, NODES, values), atol=1e-13)


def test_the_path_solves_the_equations_in_the_file() -> None:
    """Against scipy's integration of x, v and T; the recorded temperature is a polygon."""
    time = np.array([0.0, 10.0, 12.0, 20.0, 31.0, 60.0, 61.0, 90.0])  # rest while the line is laid through
    recorded = np.array([20.0, 20.0, 24.0, 23.0, 30.0, 31.0, 31.5, 22.0])
    smoothing, lag = 9.0, 17.0
    state = np.array([20.0, 0.0, 20.0])
    inside, speed = [20.0], [0.0]

    def change(t: float, y: np.ndarray) -> list[float]:
        off = float(np.interp(t, time, recorded)) - y[0]
        return [y[1] + 2.0 * off / smoothing, off / smoothing**2, (y[0] - y[2]) / lag]

    for begin, end in pairwise(time.tolist()):
        state = solve_ivp(change, (begin, end), state, rtol=1e-11, atol=1e-11).y[:, -1]
        inside.append(state[2])
        speed.append((state[0] - state[2]) / lag)
    fine = np.linspace(0.0, 90.0, 90001)
    dense = follow_temperature(
        fine, np.interp(fine, time, recorded), smoothing=smoothing, lag=lag, hysteresis_width=2.0
    )
    places = np.searchsorted(fine, time - 1e-9)
    # steps of 1 ms: (h / tau)² of 10 K
    np.testing.assert_allclose(dense.temperature[places], inside, atol=1e-6)
    np.testing.assert_allclose(dense.rate[places], speed, atol=1e-6)


def test_the_loop_of_heating_and_cooling_opens_by_twice_the_coefficient() -> None:
    """30 K after the turn with a width of 3 K the state is within 2 exp(-10) = 1e-4 of its end."""
    model = replace(thermal_unit(BASES["polynomial"]), lag=0.0, rate_coefficients={}, dead_band=0.05)
    time = np.arange(0.0, 20000.0)
    temperature = np.interp(time, [0.0, 5000.0, 10000.0, 15000.0, 20000.0], [20.0, 55.0, -15.0, 55.0, 20.0])
    path = model.path(time, temperature)
    inside, speed, state = path.temperature, path.rate, path.hysteresis
    cooling = int(np.argmin(np.abs(inside[5000:10000] - 20.0))) + 5000
    heating = int(np.argmin(np.abs(inside[10000:15000] - 20.0))) + 10000
    for name in ("accelerometer", "gyroscope"):
        up = getattr(model.at(20.0, speed[heating], state[heating]), name).bias
        down = getattr(model.at(20.0, speed[cooling], state[cooling]), name).bias
        np.testing.assert_allclose(up - down, 2.0 * model.hysteresis[f"{name}.bias"], rtol=1e-4)
    assert np.abs(state).max() <= 1.0


def test_after_a_turn_the_state_goes_over_by_the_width() -> None:
    """ds/dT = (-1 - s) / -w: from s0 it is -1 + (s0 + 1) exp(-moved / w), whatever the speed."""
    time = np.array([0.0, 10.0, 11.0, 500.0, 501.0])
    temperature = np.array([0.0, 60.0, 59.0, 56.0, 50.0])
    path = follow_temperature(time, temperature, smoothing=0.0, lag=0.0, hysteresis_width=4.0)
    start = 1.0 - np.exp(-60.0 / 4.0)
    expected = [0.0, start, *(-1.0 + (start + 1.0) * np.exp(-np.array([1.0, 4.0, 10.0]) / 4.0))]
    np.testing.assert_allclose(path.hysteresis, expected, atol=1e-14)


def test_noise_and_steps_of_the_thermometer_neither_fake_a_rate_nor_wear_the_state_off() -> None:
    """Steps of 0.1 K with noise of 0.05 K at 10 Hz, smoothed over 60 s: the rate's noise is
    0.05 sqrt(0.1 / (4 * 60)) / 60 = 2e-5 K/s and that of the steps 0.1 / 60 / 6, times 4; over the hour of rest
    the dead band keeps the state."""
    rng = np.random.default_rng(8)
    time = np.arange(0.0, 6000.0, 0.1)
    true = np.interp(time, [0.0, 1200.0, 6000.0], [20.0, 40.0, 40.0])
    recorded = np.round((true + 0.05 * rng.standard_normal(time.size)) / 0.1) * 0.1
    path = follow_temperature(time, recorded, smoothing=60.0, lag=0.0, hysteresis_width=3.0, dead_band=0.05)
    ramp, rest = (time > 400.0) & (time < 1190.0), time > 1800.0
    np.testing.assert_allclose(path.rate[ramp], 20.0 / 1200.0, atol=4 * 3e-4)
    np.testing.assert_allclose(path.rate[rest], 0.0, atol=4 * 3e-4)
    assert path.hysteresis[-1] > 0.8


def test_blocks_with_the_carried_state_are_the_whole() -> None:
    model = thermal_unit(BASES["spline"])
    time, temperature, _, _ = sweep()
    whole = model.path(time, temperature)
    state = None
    for part in (slice(0, 700), slice(700, 701), slice(701, 2900), slice(2900, None)):
        path = model.path(time[part], temperature[part], state)
        state = path.end
        np.testing.assert_array_equal(path.temperature, whole.temperature[part])
        np.testing.assert_array_equal(path.rate, whole.rate[part])
        np.testing.assert_array_equal(path.hysteresis, whole.hysteresis[part])
    assert state == whole.end


def test_temperatures_that_are_no_numbers_are_bridged() -> None:
    """A slow thermometer on a straight ramp: nothing is lost."""
    model = thermal_unit(BASES["linear"])
    time = np.arange(0.0, 400.0)
    temperature = 20.0 + 0.02 * time
    sparse = np.where(np.arange(400) % 50 == 0, temperature, np.nan)
    sparse[-1] = temperature[-1]
    np.testing.assert_allclose(
        model.path(time, sparse).temperature, model.path(time, temperature).temperature, atol=1e-2
    )
    with pytest.raises(ValueError, match="no temperature is a number"):
        model.path(time, np.full(400, np.nan))


def test_beyond_the_span_it_refuses_or_holds_or_extrapolates_as_told() -> None:
    model = replace(
        thermal_unit(BASES["polynomial"]),
        span_celsius=(0.0, 50.0),
        lag=0.0,
        hysteresis={},
        rate_coefficients={},
    )
    time, force = np.arange(50.0), np.tile([1.0, -2.0, 9.0], (50, 1))
    rate = np.tile([0.1, -0.2, 0.3], (50, 1))
    within, hot = (model.path(time, np.full(50, celsius)) for celsius in (51.9, 57.0))
    model.correct_along(within, time, force, rate)  # within the margin
    with pytest.raises(ThermalSpanError, match=r"57\.0 °C at 0\.0 s .* outside the 0\.0 to 50\.0 °C"):
        model.correct_along(hot, time, force, rate)
    held = model.correct_along(hot, time, force, rate, outside="hold")
    extrapolated = model.correct_along(hot, time, force, rate, outside="extrapolate")
    for celsius, outcome in ((50.0, held), (57.0, extrapolated)):
        expected = model.at(celsius).correct(force, rate)
        np.testing.assert_allclose(np.array(outcome), np.array(expected), atol=1e-13)


def test_a_turned_unit_sees_the_turned_world() -> None:
    model = thermal_unit(BASES["spline-at-node"])
    time, temperature, force, rate = sweep(200)
    a = 0.4
    C_nb = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    raw = model.distort(time, force, rate, temperature)
    turned = model.turned(C_nb).distort(time, force @ C_nb.T, rate @ C_nb.T, temperature)
    np.testing.assert_allclose(turned, raw, atol=1e-13)


def test_names_and_numbers_of_the_parameters_go_together() -> None:
    model = thermal_unit(BASES["linear"])
    values = model.vector()
    place = model.names.index("gyroscope.matrix.temperature[2,0,1]")
    assert len(model.names) == values.size == len(set(model.names))
    assert values[place] == model.coefficients["gyroscope.matrix"][2, 0, 1]


@pytest.mark.parametrize(
    "wrong",
    [
        {"coefficients": {"accelerometer.scale": np.zeros((3, 3))}},
        {"coefficients": {"accelerometer.bias": np.zeros((2, 3))}},
        {"rate_coefficients": {"g_sensitivity": np.zeros(3)}},
        {"hysteresis_width": 0.0},
        {"lag": -1.0},
        {"reference": ImuModel(unit().accelerometer, None)},
    ],
)
def test_what_does_not_fit_together_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"coefficients|act on|hysteresis_width|reference"):
        replace(thermal_unit(BASES["polynomial"]), **wrong)


def test_a_basis_of_an_unknown_kind_or_without_its_nodes_is_refused() -> None:
    for given in (("cubic", NODES), ("polynomial", NODES, 2), ("polynomial",), ("spline", NODES[:2])):
        with pytest.raises(ValueError, match=r"basis|polynomial"):
            TemperatureBasis(given[0], 20.0, *given[1:])
