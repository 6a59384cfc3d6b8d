"""How accurate a strapdown rotation test will be, source by source (Savage 2018, section 9), before it is done.

Each source is carried through the sequences' measurements to the 24 parameters: noise by its covariance, what
is constant through the test by its linear effect, products of errors by playing pairs of them exactly. The
Monte Carlo beside it draws all of them at once.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.design.error_budget import ErrorBudget, ParameterGroup
from tumble.design.strapdown_effects import (
    attitude_axes,
    constant_effects,
    earth_by_attitude,
    earth_by_gyro,
    fixture_effects,
    gyro_earth_effects,
    noise_effects,
    used_constant_effects,
)
from tumble.design.strapdown_gain import carried, covariance_root, measurement_gain
from tumble.design.strapdown_play import MOUNTING, SENSORS, SHARED, TILT, error_count, play_exactly
from tumble.design.strapdown_products import product_effects
from tumble.design.strapdown_sequences import timed_sequences
from tumble.design.strapdown_setup import StrapdownSetup
from tumble.sensor.conventions.savage import GROUPS, NAMES
from tumble.units import STANDARD_GRAVITY

PROCEDURE = "strapdown-rotation"
_PER_MICRO_G = 1e6 / STANDARD_GRAVITY
_WORDS = {
    "kappa_lin": ("κ linear", "gyro scale", "gyro scale factors", "1", "ppm", 1e6),
    "kappa_asym": (
        "κ asymmetry",
        "gyro asymm.",
        "gyro scale factors, one way against the other",
        "1",
        "ppm",
        1e6,
    ),
    "upsilon": ("υ", "gyro angles", "angles between the gyros", "rad", "µrad", 1e6),
    "lambda_bias": ("λ bias", "acc. bias", "accelerometer biases", "m/s²", "µg", _PER_MICRO_G),
    "lambda_lin": ("λ linear", "acc. scale", "accelerometer scale factors", "1", "ppm", 1e6),
    "lambda_asym": (
        "λ asymmetry",
        "acc. asymm.",
        "accelerometer scale factors, up against down",
        "1",
        "ppm",
        1e6,
    ),
    "mu": ("µ", "acc. angles", "accelerometers against the gyros' frame", "rad", "µrad", 1e6),
}
PARAMETER_GROUPS = tuple(
    ParameterGroup(*words[:3], GROUPS[key].start, GROUPS[key].stop, *words[3:])
    for key, words in _WORDS.items()
)
"""The seven sorts of parameters, as tables show them."""


def analyse_strapdown_rotation(setup: StrapdownSetup) -> ErrorBudget:
    """Return the error budget of a planned strapdown rotation test.

    Parameters
    ----------
    setup : unit, fixture, timing, site and variant.

    Notes
    -----
    Savage 2018, (16) to (22) with the slips corrected. Beyond it: all parameters from all sequences with their
    correlations, the averages' own windows (a walk of the angle counts two thirds of each, a constant rate one
    half), what the bias of the start window costs in noise, g-sensitivity, and gravity.
    """
    sequences = timed_sequences(setup)
    spreads = _spreads(setup)
    effects = noise_effects(setup, sequences) + fixture_effects(setup, sequences)
    gain = measurement_gain(setup, sequences, effects)
    linear = [*effects, *constant_effects(setup, sequences)]
    # What the sensors still have when the last pass is made: at first all of it, later what a pass leaves.
    left = spreads
    contributions, sources = np.zeros((SENSORS, 0)), []
    for iteration in range(setup.iterations + 1):
        per_pass = [*linear, *gyro_earth_effects(setup, sequences, left)]
        table = np.column_stack([carried(gain, effect) for effect in per_pass])
        products, product_sources = product_effects(setup, sequences, gain, left)
        contributions = np.column_stack([table, products])
        sources = [effect.source for effect in per_pass] + product_sources
        if iteration < setup.iterations:
            left = np.minimum(np.sqrt(np.sum(contributions**2, axis=1)), spreads)
    used = [k for k, source in enumerate(sources) if source.magnitude > 0.0]
    return ErrorBudget(
        procedure=PROCEDURE,
        parameters=NAMES,
        groups=PARAMETER_GROUPS,
        sources=tuple(sources[k] for k in used),
        contributions=contributions[:, used],
        drawn=None,
        settings=setup.settings(),
        remarks=tuple(_remarks(setup)),
    )


def simulate_test_errors(setup: StrapdownSetup, runs: int, rng: np.random.Generator) -> Table:
    """Return (runs, 24) errors of the test's result, with all sources drawn at once and played back as planned.

    Sensor errors and the fixture are played exactly, products of any order included; noise, biases and the
    Earth rate are added to the measurements by their first-order effect.

    Parameters
    ----------
    setup : as for `analyse_strapdown_rotation`.
    runs : units, fixtures and sessions.
    rng : draws everything.
    """
    sequences = timed_sequences(setup)
    effects = noise_effects(setup, sequences) + fixture_effects(setup, sequences)
    gain = measurement_gain(setup, sequences, effects)
    shared = np.empty((runs, SHARED))
    shared[:, :SENSORS] = _spreads(setup) * rng.standard_normal((runs, SENSORS))
    shared[:, MOUNTING] = setup.fixture.mounting * rng.standard_normal((runs, 3))
    shared[:, TILT] = setup.fixture.installation * rng.standard_normal((runs, 2))
    heading = setup.fixture.heading * rng.standard_normal((runs, 1))
    constant = [e.columns for e in used_constant_effects(setup, sequences) if e.columns is not None]
    others = [rng.standard_normal((runs, columns[0].shape[1])) for columns in constant]
    random = noise_effects(setup, sequences)
    errors: list[AnyArray] = []
    fixed: list[AnyArray] = []
    for k, sequence in enumerate(sequences):
        count = error_count(sequence.row) - SHARED
        own = setup.fixture.execution * rng.standard_normal((runs, count))
        errors.append(np.column_stack([shared, own]))
        noise = sum((e.covariances[k] for e in random if e.covariances is not None), np.zeros((5, 5)))
        added = rng.standard_normal((runs, 5)) @ covariance_root(noise).T
        for columns, drawn in zip(constant, others, strict=True):
            added += drawn @ columns[k].T
        axes = attitude_axes(sequence)
        off = np.column_stack([heading, shared[:, TILT], shared[:, MOUNTING], own[:, :2]])
        fixed.append(added + off @ (earth_by_attitude(sequence, setup) @ axes).T)
    known = np.zeros((runs, SENSORS))
    for _ in range(setup.iterations + 1):
        total = np.zeros((runs, SENSORS))
        for k, sequence in enumerate(sequences):
            played = play_exactly(sequence.row, errors[k], setup.site.gravity, norm=setup.norm, known=known)
            residual = (shared[:, :SENSORS] - known)[:, :9]
            coupled = residual @ earth_by_gyro(sequence, setup).T
            total += (played + fixed[k] + coupled) @ gain[k].T
        known = known + total
    return np.asarray(known - shared[:, :SENSORS])


def _spreads(setup: StrapdownSetup) -> Series:
    """(24,): without sequences 1a to 3a gyros without asymmetry are meant."""
    spreads = setup.sensors.spreads()
    if not setup.asymmetry:
        spreads[GROUPS["kappa_asym"]] = 0.0
    return spreads


def _remarks(setup: StrapdownSetup) -> Iterator[str]:
    yield (
        "One sigma throughout. Sources count as independent of each other; what stays the same through the test "
        "(heading, mounting, gravity) is the same in all sequences."
    )
    if setup.sensors.gyro_pulse > 0.0 or setup.sensors.force_pulse > 0.0:
        yield "Pulses count in full at the ends of each average; averaging over many of them makes them smaller."
    if max(setup.sensors.gyro_instability, setup.sensors.force_instability) > 0.0:
        yield (
            "A wandering bias is taken as another value in each average, with the floor of the Allan "
            "deviation as its spread. Over a test that takes hours it may be twice that."
        )
    if setup.start_bias:
        yield "The gyros' bias is taken from the rest before each sequence; how large it is does not count."
    if setup.sensors.g_sensitivity > 0.0:
        yield (
            "By least squares g-sensitivity counts with what the rests leave unknown of it; with the formulas, in full."
        )
