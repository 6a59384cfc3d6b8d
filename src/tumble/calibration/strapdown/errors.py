"""A sensor model mended by Savage's errors: what a pass of the strapdown rotation test changes."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vector
from tumble.sensor import ImuModel, Triad
from tumble.sensor.conventions.savage import SavageErrors


def apply_errors(model: ImuModel, errors: Series) -> ImuModel:
    """Return the model with the errors that the corrected output still has.

    What the model corrects is, by the errors, ``E true``: so the raw output is the model's of ``E true``. Matrices
    multiply; asymmetries, which act on each sensor's own input, add up to the first order, as the test finds
    them.

    Parameters
    ----------
    model : both triads.
    errors : (24,) as `savage.NAMES`, of the model's corrected output.
    """
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    found = SavageErrors.from_vector(errors)
    extra = found.model()
    assert extra.accelerometer is not None
    assert extra.gyroscope is not None
    force, rate = model.accelerometer, model.gyroscope
    return ImuModel(
        Triad(
            np.asarray(force.matrix @ extra.accelerometer.matrix, dtype=np.float64),
            np.asarray(force.bias + force.matrix @ found.bias, dtype=np.float64),
            _sum(force.asymmetry, found.scale_asymmetry),
        ),
        Triad(
            np.asarray(rate.matrix @ extra.gyroscope.matrix, dtype=np.float64),
            rate.bias,
            _sum(rate.asymmetry, found.kappa_asymmetry),
        ),
        model.g_sensitivity,
    )


def _sum(one: Vector | None, other: Vector) -> Vector:
    return other if one is None else one + other
