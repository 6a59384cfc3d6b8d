"""How accurate a strapdown rotation test will be, source by source (Savage 2018, section 9), before it is done.

Each source is carried through the sequences' measurements to the 24 parameters: noise by its covariance, what
is constant through the test by its linear effect, products of errors by playing pairs of them exactly. The
Monte Carlo beside it draws all of them at once.

From the measurements of the strapdown rotation test to its parameters, as linear maps.

Products of two errors, which the first-order formulas of the strapdown rotation test leave out.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, inverted
from tumble.calibration.closed_forms.rotation_sequences import across_down
from tumble.calibration.closed_forms.sequence_inversion import invert_measurements
from tumble.design.error_budget import ErrorBudget, ErrorSource, ParameterGroup
from tumble.design.strapdown_effects import (
    Effect,
    after_play_back,
    attitude_axes,
    constant_effects,
    earth_by_attitude,
    earth_by_gyro,
    fixture_effects,
    gyro_earth_effects,
    noise_effects,
    used_constant_effects,
)
from tumble.design.strapdown_play import MOUNTING, SENSORS, SHARED, TILT, error_count, play_exactly
from tumble.design.strapdown_sequences import TimedSequence, timed_sequences
from tumble.design.strapdown_setup import StrapdownSetup
from tumble.protocol.strapdown_rotation import RotationSequence
from tumble.sensor.conventions.savage import GROUPS, NAMES
from tumble.units import STANDARD_GRAVITY


def product_effects(
    setup: StrapdownSetup, sequences: list[TimedSequence], gain: list[Table], left: Series
) -> tuple[Table, list[ErrorSource]]:
    """Return (24, 3) one sigma of the parameters by products of errors that (3) to (5) leave out, and their sources.

    Two errors are played together and each alone, in all four combinations of signs: what the two together do
    beyond each alone is their product, also where an asymmetry makes it depend on signs.

    Parameters
    ----------
    setup, sequences : the test.
    gain : of `measurement_gain`.
    left : (24,) one sigma of the sensor errors in the pass.
    """
    fixture = setup.fixture
    angles = np.array([fixture.mounting] * 3 + [fixture.installation] * 2)
    spreads = setup.sensors.spreads()
    before = np.concatenate([spreads, angles])
    shrunk = np.concatenate([left / np.where(spreads > 0.0, spreads, 1.0), np.ones(len(angles))])
    variance = np.zeros((SENSORS, 3))
    common_pairs, common_squares = np.zeros((4, SENSORS, SHARED, SHARED)), np.zeros((SENSORS, SHARED))
    means = np.zeros((SENSORS, 3))
    for sequence, one_gain in zip(sequences, gain, strict=True):
        stops = np.full(error_count(sequence.row) - SHARED, fixture.execution)
        sizes = np.concatenate([before, stops])
        pairs, squares = _interactions(sequence.row, tuple(sizes.tolist()), setup.site.gravity, setup.norm)
        # Products scale with their factors: one playing serves all passes.
        scale = np.concatenate([shrunk, np.ones(len(stops))])
        carried = np.einsum("pm,sjkm,j,k->spjk", one_gain, pairs, scale, scale, optimize=True)
        own = one_gain @ (squares * scale[:, None] ** 2).T
        common_pairs += carried[:, :, :SHARED, :SHARED]
        common_squares += own[:, :SHARED]
        # A sequence's own errors, which no other has: the fixture's stops.
        for k in range(SHARED, len(scale)):
            _add_pairs(variance, carried[:, :, :k, k])
        variance[:, 2] += 2.0 * np.sum(own[:, SHARED:] ** 2, axis=1)
        means[:, 2] += np.sum(own[:, SHARED:], axis=1)
    for k in range(SHARED):
        _add_pairs(variance, common_pairs[:, :, :k, k], sensor=k < SENSORS)
    # A square d z² has the mean d and the variance 2 d²; the means of all add up.
    for kind, at in ((1, slice(0, SENSORS)), (2, slice(SENSORS, SHARED))):
        variance[:, kind] += 2.0 * np.sum(common_squares[:, at] ** 2, axis=1)
        means[:, kind] += np.sum(common_squares[:, at], axis=1)
    variance += means**2
    return np.sqrt(variance), _product_sources(setup, angles, left)


def _product_sources(setup: StrapdownSetup, angles: Series, left: Series) -> list[ErrorSource]:
    """The sources in words, with sizes."""
    angle = max(float(np.sqrt(np.mean(angles**2))), setup.fixture.execution)
    after = after_play_back(setup)
    left_rms = float(np.sqrt(np.mean(left[:9] ** 2)))
    vertical = "the vertical is projected on the nominal one: half the angle's square is lost"
    return [
        ErrorSource(
            "fixture × sensor errors",
            "sensors with errors on a fixture that is off" + after,
            angle,
            "rad",
            "fixture",
        ),
        ErrorSource(
            "sensor errors, squared",
            "products of sensor errors that the formulas leave out" + after,
            left_rms,
            "1",
            "method",
        ),
        ErrorSource("fixture, squared", vertical, 0.0 if setup.norm else angle, "rad", "fixture"),
    ]


@lru_cache(maxsize=64)
def _interactions(
    row: RotationSequence, sizes: tuple[float, ...], gravity: float, norm: bool
) -> tuple[AnyArray, Table]:
    """(4, n, n, 5) of pairs by combination of signs, upper triangle, and (n, 5) of each error with itself."""
    size, count = np.array(sizes), len(sizes)
    first, second = np.triu_indices(count, 1)
    signs = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    alone = np.concatenate([np.diag(size), -np.diag(size)])
    both: list[Table] = []
    for one, other in signs:
        errors = np.zeros((len(first), count))
        at = np.arange(len(first))
        errors[at, first], errors[at, second] = one * size[first], other * size[second]
        both.append(errors)
    played = play_exactly(row, np.concatenate([alone, *both]), gravity, norm=norm)
    by_sign = {1.0: played[:count], -1.0: played[count : 2 * count]}
    pairs = np.zeros((4, count, count, 5))
    for k, (one, other) in enumerate(signs):
        part = played[2 * count + k * len(first) : 2 * count + (k + 1) * len(first)]
        pairs[k, first, second] = part - by_sign[one][first] - by_sign[other][second]
    return pairs, 0.5 * (by_sign[1.0] + by_sign[-1.0])


def _add_pairs(variance: Table, products: AnyArray, *, sensor: bool = False) -> None:
    """Add products (4, 24, n) of one error with n before it, each to its source; `sensor` says what the one is."""
    squares = np.mean(products**2, axis=0)
    variance[:, 1 if sensor else 0] += np.sum(squares[:, :SENSORS], axis=1)
    variance[:, 2] += np.sum(squares[:, SENSORS:], axis=1)


# Beside the noise of a test without any, (m/s²)²: its components then weigh alike.
_FLOOR = 1e-18


def measurement_gain(
    setup: StrapdownSetup, sequences: list[TimedSequence], effects: list[Effect]
) -> list[Table]:
    """Return by sequence (24, 5): what its measurements add to the parameters.

    Parameters
    ----------
    setup, sequences : the test.
    effects : that weigh as noise in the least squares.
    """
    if setup.method == "formulas":
        return _formula_gain(setup, sequences)
    roots: list[Table] = []
    rows: list[Table] = []
    for k, sequence in enumerate(sequences):
        take = np.zeros((4, 5))
        take[:2, :3] = across_down(sequence.model.down_start)
        take[2, 3] = take[3, 4] = 1.0
        # Pulses, wandering and the fixture's part of it weigh as noise.
        spread = sum((_covariance(effect, k) for effect in effects), np.zeros((5, 5)))
        noise = take @ spread @ take.T + _FLOOR * np.eye(4)
        root = inverted(np.asarray(np.linalg.cholesky(noise), dtype=np.float64)) @ take
        roots.append(root)
        rows.append(root @ sequence.model.coefficients)
    design = np.concatenate(rows)
    free = np.ones(len(NAMES), dtype=bool)
    free[GROUPS["kappa_asym"]] = setup.asymmetry
    size = np.where(free, np.linalg.norm(design, axis=0), 1.0)
    solution = np.zeros((len(NAMES), len(design)))
    solution[free] = np.linalg.pinv((design / size)[:, free]) / size[free, None]
    return [solution[:, 4 * k : 4 * k + 4] @ root for k, root in enumerate(roots)]


def _formula_gain(setup: StrapdownSetup, sequences: list[TimedSequence]) -> list[Table]:
    gains: list[Table] = []
    for chosen in sequences:
        columns: list[Series] = []
        for component in range(5):
            measured = {s.row.name: np.zeros(5) for s in sequences}
            measured[chosen.row.name][component] = 1.0
            columns.append(invert_measurements(measured, setup.site.gravity, asymmetry=setup.asymmetry))
        gains.append(np.column_stack(columns))
    return gains


def _covariance(effect: Effect, k: int) -> Square:
    if effect.covariances is not None:
        return effect.covariances[k]
    assert effect.columns is not None
    return effect.columns[k] @ effect.columns[k].T


def carried(gain: list[Table], effect: Effect) -> Series:
    """Return (24,) one sigma of the parameters by one source.

    Parameters
    ----------
    gain : of `measurement_gain`.
    effect : of the source.
    """
    if effect.covariances is not None:
        variance = sum(
            np.einsum("pi,ij,pj->p", g, c, g) for g, c in zip(gain, effect.covariances, strict=True)
        )
        return np.sqrt(np.maximum(variance, 0.0))
    assert effect.columns is not None
    columns = sum(g @ c for g, c in zip(gain, effect.columns, strict=True))
    return np.linalg.norm(np.asarray(columns), axis=1)


def covariance_root(covariance: Square) -> Square:
    """Return any root of a covariance, singular or not.

    Parameters
    ----------
    covariance : symmetric, not negative.
    """
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)), dtype=np.float64)


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
