"""Evidence by hand, an example of each kind, with words in it that would break a page."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tumble.calibration import evidence
from tumble.calibration.estimate import Beside, LeftOut
from tumble.calibration.magnetometer.estimate import FieldHold, GivenField, Magnetometer, magnetometer_alone
from tumble.recording import MagneticField
from tumble.report import Subject

HOSTILE = "</script><b>&\"'`[red]"


def holds(demo: Subject) -> evidence.Evidence:
    return replace(demo.estimate.holds, restless=(evidence.RestlessHold(3, 12.5, 17.3, 4.1e-3, 2.3e-4),))


def turns(demo: Subject) -> evidence.Evidence:
    return demo.estimate.turns


def spins(demo: Subject) -> evidence.Evidence:
    rates = np.array([0.7, -1.4])
    residuals = np.array([[1e-4, -2e-4, 3e-5], [4e-5, 5e-4, np.nan]])
    return evidence.Spins(rates, residuals, np.full((2, 3), 1.5e-5), (f"up {HOSTILE}", "down"))


def thermal_curves(demo: Subject) -> evidence.Evidence:
    celsius = np.linspace(-10.0, 50.0, 7)
    state = np.array([1.0, 1.0, 0.0, 0.0, -1.0, -1.0, -1.0])
    seen = 1e-3 * np.sin(celsius)[:, None] * [1.0, -2.0, 0.5]
    curve = evidence.BiasCurve(celsius, seen, np.full((7, 3), 2e-4), seen + 1e-4, seen - 1e-4)
    time = demo.recording.time[0] + 60.0 * np.arange(7)
    return evidence.ThermalCurves(
        kind="soak",
        basis="lines",
        start=time,
        stop=time + 30.0,
        celsius=celsius,
        celsius_rate=np.zeros(7),
        hysteresis=state,
        force=seen,
        rate=seen,
        rate_sigma=np.full((7, 3), 1e-4),
        residuals=np.full((7, 6), 0.5),
        curves={"accelerometer": curve, "gyroscope": curve},
        path_time=time,
        path_celsius=celsius,
        candidates=[evidence.Candidate(HOSTILE, 12, 1.07, 0.11, chosen=True)],
        rejected=[(float(time[0]), float(time[1]), f"not settled {HOSTILE}")],
    )


def turn_ons(demo: Subject) -> evidence.Evidence:
    values, sigmas = np.array([0.12, 0.17, np.nan]), np.array([0.011, 0.013, np.nan])
    names = [HOSTILE, "second", "third"]
    recordings = [evidence.RecordingOfUnit(name, 26, 25, 0, 1.04, {}, 180.0, 100.0) for name in names]
    first, scale = (demo.estimate.parameters[k] for k in (0, 3))
    bias = evidence.BiasScatter(
        first.name, first.unit, values, sigmas, 0.145, 0.008, 0.035, 0.012, 1, 8.6, 0.0034, 12.7
    )
    agreement = evidence.Agreement(scale.name, scale.unit, values, sigmas, 0.14, 0.008, 8.6, 1, 0.0034, 0.01)
    return evidence.TurnOns(recordings, [bias], [agreement], 8.6, 1, 0.0034)


def beside(demo: Subject) -> evidence.Evidence:
    ours = demo.estimate.parameters
    other = [replace(p, value=1.01 * p.value, standard_uncertainty=2 * p.standard_uncertainty) for p in ours]
    return Beside(replace(demo.estimate, procedure=HOSTILE, parameters=other, evidence=[]), HOSTILE)


def budget(demo: Subject) -> evidence.Evidence:
    sigmas = np.array([p.standard_uncertainty for p in demo.estimate.parameters])
    statement = evidence.UncertaintyStatement(
        effective_degrees=np.full(len(sigmas), 41.0),
        coverage_factors=np.full(len(sigmas), 2.02),
        source_degrees={HOSTILE: 40.0},
        test=evidence.GlobalTest(123.0, 110, 0.19, 0.003, 1),
        detectable=[
            evidence.Detectable("force", 4, 3, 0.7, 0.013, 2, 5.5),
            evidence.Detectable("turn", 5, 3, 0.0, np.inf, 1, np.inf),
        ],
        model_choice=[evidence.ModelChoice("g_sensitivity", True, 0.008, 0.01, 0.4 * sigmas)],
        not_included=[f"What {HOSTILE} does."],
    )
    return evidence.Budget({HOSTILE: 0.8 * sigmas, "wander": 0.6 * sigmas}, statement)


def magnetometer(demo: Subject) -> evidence.Evidence:
    rng = np.random.default_rng(5)
    directions = rng.standard_normal((600, 3))
    field = 49e-6 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    matrix = 1e6 * np.array([[1.1, 0.02, 0.03], [-0.04, 0.9, 0.05], [0.01, -0.06, 1.2]])
    values = field @ matrix.T + [3, -8, 20]
    noisy = MagneticField(np.arange(600.0), values + 0.3 * rng.standard_normal((600, 3)), "uT")
    made = magnetometer_alone(noisy, GivenField(49e-6, 2e-7, 1.1, f"from {HOSTILE}"))
    holds = tuple(FieldHold(k, 10.0 * k, 49e-6 + 1e-8 * k, 1.1 + 1e-3 * k, k == 2) for k in range(4))
    out = LeftOut("hold", 2, f"its field {HOSTILE}")
    return replace(made, holds=holds, left_out=(out,), dip=1.1, dip_sigma=2e-3, not_determined=(HOSTILE,))


EXAMPLES: dict[type[evidence.Evidence], Callable[[Subject], evidence.Evidence]] = {
    evidence.Holds: holds,
    evidence.Turns: turns,
    evidence.Spins: spins,
    evidence.ThermalCurves: thermal_curves,
    evidence.TurnOns: turn_ons,
    Beside: beside,
    evidence.Budget: budget,
    Magnetometer: magnetometer,
}
