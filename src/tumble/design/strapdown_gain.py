"""From the measurements of the strapdown rotation test to its parameters, as linear maps."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square, Table, inverted
from tumble.calibration.closed_forms.rotation_sequences import across_down
from tumble.calibration.closed_forms.sequence_inversion import invert_measurements
from tumble.design.strapdown_effects import Effect
from tumble.design.strapdown_sequences import TimedSequence
from tumble.design.strapdown_setup import StrapdownSetup
from tumble.sensor.conventions.savage import GROUPS, NAMES

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
