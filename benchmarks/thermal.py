"""Coverage of the thermal procedure's intervals: units drawn, put in a chamber, calibrated, and held against the truth.

    python benchmarks/thermal.py --runs 24

For each protocol: the share of true values within the 95 % intervals, between what bounds it is to be for so many
independent values (binomial, 95 %), and the spread of the errors in sigmas (1 where the stated uncertainties are
right). Biases are compared at nine temperatures over the span, settled and half way through the hysteresis, and count
once for each axis of each unit; from one pose the accelerometers' changes from the reference alone, and the gyros'
biases in that pose.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.stats import binom

from tumble.calibration.estimate import Estimate
from tumble.calibration.thermal.evidence import ThermalCurves
from tumble.calibration.thermal.procedure import calibrate_thermal
from tumble.earth import Site
from tumble.protocol import named_protocol
from tumble.segmentation import find_thermal_timeline
from tumble.sensor.gauge import frame_rotation
from tumble.sensor.thermal import ThermalModel
from tumble.simulation import Chamber, find_grade, find_thermal_grade, simulate_chamber

RATE = 12.5  # Hz: noise is a density, and means are the same; turns have 20 samples and more
UP = np.array([0.0, 0.0, 9.80665])


def one(name: str, grade: str, seed: int) -> tuple[dict[str, np.ndarray], float]:
    """Return the errors in sigmas by kind, and the joint over the separate sigma of the soaks."""
    rng = np.random.default_rng(seed)
    kind, drift = find_grade(grade), find_thermal_grade(grade)
    thermal = drift.simulate_model(kind.simulate_model(rng), rng)
    site, protocol = Site.from_latitude(np.radians(48.0)), named_protocol(name)
    chamber = Chamber(
        thermometer_noise=drift.thermometer_noise, thermometer_resolution=drift.thermometer_resolution
    )
    recording, _, _ = simulate_chamber(
        protocol, RATE, rng, site=site, thermal=thermal, chamber=chamber, grade=kind
    )
    estimate = calibrate_thermal(recording, find_thermal_timeline(recording), site, protocol=protocol)
    assert estimate.thermal is not None
    evidence = estimate.shown(ThermalCurves)
    assert evidence is not None
    accelerometer = thermal.reference.accelerometer
    assert accelerometer is not None
    truth = thermal.turned(np.real(frame_rotation(accelerometer.matrix, "accelerometer-x")))
    full = any(n.startswith("accelerometer.bias") for n in estimate.names)
    errors = _curve_errors(estimate.thermal.model, truth, evidence, full=full)
    found = dict(zip(estimate.thermal.names, estimate.thermal.model.vector(), strict=True))
    sigma = dict(zip(estimate.thermal.names, np.sqrt(np.diag(estimate.thermal.covariance)), strict=True))
    true = dict(zip(truth.names, truth.vector(), strict=True))
    for what in ("hysteresis", "rate"):
        names = [n for n in found if f".{what}[" in n]
        if names:
            errors[what] = np.array([(found[n] - true[n]) / sigma[n] for n in names])
    if full:
        errors |= _matrix_errors(estimate, truth)
    if np.isfinite(evidence.lag_sigma):
        errors["lag"] = np.array([(evidence.lag - truth.lag) / evidence.lag_sigma])
    if np.isfinite(evidence.width_sigma):
        errors["width"] = np.array([(evidence.width - truth.hysteresis_width) / evidence.width_sigma])
    # In standard uncertainties whose 95 % interval is 1.96 of them.
    errors = {kind: values * 1.96 / estimate.coverage_factor for kind, values in errors.items()}
    ratios = [float(np.mean(s.joint_sigma / s.sigma)) for s in evidence.separate]
    return errors, float(np.mean(ratios)) if ratios else float("nan")


def _curve_errors(
    found: ThermalModel, truth: ThermalModel, evidence: ThermalCurves, *, full: bool
) -> dict[str, np.ndarray]:
    errors: dict[str, list[np.ndarray]] = {}
    reference = found.basis.reference_celsius
    for celsius in np.linspace(*found.span_celsius, 9):
        here, there = found.at(celsius), truth.at(celsius)
        base, beneath = found.at(reference), truth.at(reference)
        for triad in ("accelerometer", "gyroscope"):
            curve = evidence.curves[triad]
            sigma = np.array([np.interp(celsius, curve.celsius, curve.sigma[:, k]) for k in range(3)])
            a, b = getattr(here, triad), getattr(there, triad)
            if triad == "accelerometer" and not full:
                if abs(celsius - reference) < 5.0:
                    continue
                # From one pose: what the axis shows there, gravity included.
                a0, b0 = getattr(base, triad), getattr(beneath, triad)
                error = (a.bias - a0.bias) - (b.bias - b0.bias) - (b.matrix - b0.matrix) @ UP
            else:
                error = a.bias - b.bias
                if triad == "gyroscope" and not full and truth.reference.g_sensitivity is not None:
                    error = error - truth.reference.g_sensitivity @ UP
            errors.setdefault(f"{triad} bias", []).append(error / sigma)
    return {name: np.concatenate(values) for name, values in errors.items()}


def _matrix_errors(estimate: Estimate, truth: ThermalModel) -> dict[str, np.ndarray]:
    """Return the errors of both matrices at the reference, in sigmas, where they were estimated."""
    assert estimate.thermal is not None
    reference = estimate.thermal.model.basis.reference_celsius
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)), strict=True))
    errors: dict[str, np.ndarray] = {}
    for triad in ("accelerometer", "gyroscope"):
        off = getattr(estimate.model, triad).matrix - getattr(truth.at(reference), triad).matrix
        names = [(i, j, f"{triad}.matrix[{i},{j}]") for i in range(3) for j in range(3)]
        found = [off[i, j] / sigma[n] for i, j, n in names if sigma.get(n, 0.0) > 0.0]
        if found:
            errors[f"{triad} matrix"] = np.array(found)
    return errors


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--imu", default="consumer-mems")
    parser.add_argument("--protocols", nargs="*", default=["thermal-soak", "thermal-ramp"])
    chosen = parser.parse_args()
    for name in chosen.protocols:
        gathered: dict[str, list[np.ndarray]] = {}
        ratios: list[float] = []
        failed = 0
        for seed in range(chosen.runs):
            try:
                errors, ratio = one(name, chosen.imu, 1000 + seed)
            except Exception as error:  # noqa: BLE001
                failed += 1
                print(f"{name} {seed}: {error}")
                continue
            ratios.append(ratio)
            for kind, values in errors.items():
                gathered.setdefault(kind, []).append(values)
        print(f"{name}, {chosen.imu}, {chosen.runs} units, {failed} failed")
        for kind, values in gathered.items():
            z = np.concatenate(values)
            inside = 100.0 * float(np.mean(np.abs(z) < 1.96))
            count = 3 * len(values) if kind.endswith("bias") else z.size
            low, high = (100.0 * bound / count for bound in binom.interval(0.95, count, 0.95))
            print(
                f"  {kind:<20} {count:4d} independent, {inside:5.1f} % inside (to be {low:.0f} to {high:.0f} %), "
                f"rms {np.sqrt(np.mean(z**2)):.2f} sigma, largest {np.max(np.abs(z)):.1f}"
            )
        if np.any(np.isfinite(ratios)):
            print(
                f"  sigma of accelerometer biases, one adjustment over separate ones: {np.nanmean(ratios):.2f}"
            )


if __name__ == "__main__":
    main()
