"""How fast a thermal model corrects: samples a second of both triads, by its functions of temperature.

    python benchmarks/thermal.py [SAMPLES]

Beside it what the isothermal model takes for the same samples, and a loop that inverts a matrix a sample.
"""

from __future__ import annotations

import sys
import time as clock

import numpy as np

from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import SHAPES, TemperatureBasis, ThermalModel


def model_of(basis: TemperatureBasis) -> ThermalModel:
    """Return a unit of which everything changes with temperature."""
    rng = np.random.default_rng(1)
    reference = ImuModel(
        Triad(np.eye(3) + 0.02 * rng.standard_normal((3, 3)), 0.1 * rng.standard_normal(3)),
        Triad(np.eye(3) + 0.02 * rng.standard_normal((3, 3)), 0.1 * rng.standard_normal(3)),
        1e-4 * rng.standard_normal((3, 3)),
    )
    size = (
        np.array([40.0**-k for k in range(basis.size)]) if basis.kind == "polynomial" else np.ones(basis.size)
    )
    coefficients = {
        name: 1e-3 * size.reshape(-1, *[1] * len(shape)) * rng.standard_normal((basis.size, *shape))
        for name, shape in SHAPES.items()
    }
    biases = {name: 1e-3 * rng.standard_normal(3) for name in ("accelerometer.bias", "gyroscope.bias")}
    return ThermalModel(reference, basis, coefficients, biases, biases, lag=30.0)


def best(call: object, times: int = 3) -> float:
    """Return the shortest of some runs, s."""
    assert callable(call)
    taken: list[float] = []
    for _ in range(times):
        begin = clock.perf_counter()
        call()
        taken.append(clock.perf_counter() - begin)
    return min(taken)


def main() -> None:
    """Print a line for each basis."""
    samples = int(float(sys.argv[1])) if len(sys.argv) > 1 else 2_000_000
    rng = np.random.default_rng(2)
    time = 0.01 * np.arange(samples)
    celsius = 20.0 + 30.0 * np.sin(time / 900.0)
    force, rate = rng.standard_normal((samples, 3)), rng.standard_normal((samples, 3))
    nodes = np.array([-20.0, 0.0, 20.0, 40.0, 60.0])
    bases = {
        "polynomial, order 3": TemperatureBasis("polynomial", 25.0, order=3),
        "linear, 5 nodes": TemperatureBasis("linear", 20.0, nodes),
        "spline, 5 nodes": TemperatureBasis("spline", 20.0, nodes),
    }
    print(f"{samples:,} samples of both triads, Msamples/s")
    for name, basis in bases.items():
        model = model_of(basis)
        raw = model.distort(time, force, rate, celsius)
        model.correct(time[:9], raw[0][:9], raw[1][:9], celsius[:9])  # compiles
        path = best(lambda m=model: m.path(time, celsius))
        whole = best(lambda m=model, r=raw: m.correct(time, *r, celsius))
        back = model.correct(time, *raw, celsius)
        off = max(float(np.abs(back[0] - force).max()), float(np.abs(back[1] - rate).max()))
        print(f"{name:22s} {samples / whole / 1e6:6.2f}   (temperature path alone {samples / path / 1e6:5.1f};"
              f" largest difference to the truth {off:.0e})")  # fmt: skip
    reference = model_of(bases["linear, 5 nodes"])
    raw = reference.reference.distort(force, rate)
    print(f"{'isothermal':22s} {samples / best(lambda: reference.reference.correct(*raw)) / 1e6:6.2f}")
    few = 3000
    path = reference.path(time[:few], celsius[:few])

    def one_by_one() -> None:
        for k in range(few):
            there = reference.at(path.temperature[k], path.rate[k], path.hysteresis[k])
            there.correct(force[k : k + 1], rate[k : k + 1])

    print(f"{'one matrix a sample':22s} {few / best(one_by_one, 1) / 1e6:6.4f}")


if __name__ == "__main__":
    main()
