"""Two sensor models one after another as one, where that is exact."""

from __future__ import annotations

import numpy as np

from tumble.errors import UsageError
from tumble.sensor import ImuModel, Triad


def merge_models(first: ImuModel, second: ImuModel) -> ImuModel:
    """Return the one model that corrects as `first` and then `second` do.

    ``raw = M1 x + b1`` and ``x = M2 true + b2`` (m/s², rad/s) give ``raw = M1 M2 true + (M1 b2 + b1)``; the
    gyros' g-sensitivities give ``Mg1 G2 + G1 Ma2`` and add ``G1 ba2`` to the bias, for the first one acts on what
    the first calibration takes for the specific force.

    Parameters
    ----------
    first : of the raw numbers.
    second : of what the first one gives, SI.

    Raises
    ------
    UsageError
        If a triad has asymmetry or quadratic terms, or is in one of the two only.
    """
    for model in (first, second):
        for triad in (model.accelerometer, model.gyroscope):
            if triad is not None and not triad.is_straight:
                raise UsageError(
                    "Calibrations with asymmetry or quadratic terms are no single matrix and bias one after another."
                )
    accelerometer = _merged(first.accelerometer, second.accelerometer)
    gyroscope = _merged(first.gyroscope, second.gyroscope)
    if gyroscope is None or (first.g_sensitivity is None and second.g_sensitivity is None):
        return ImuModel(accelerometer, gyroscope)
    assert first.gyroscope is not None
    sensitivity, bias = np.zeros((3, 3)), gyroscope.bias
    if second.g_sensitivity is not None:
        sensitivity = sensitivity + first.gyroscope.matrix @ second.g_sensitivity
    if first.g_sensitivity is not None:
        if second.accelerometer is None:
            raise UsageError("The first calibration's g-sensitivity needs an accelerometer in both.")
        sensitivity = sensitivity + first.g_sensitivity @ second.accelerometer.matrix
        bias = bias + first.g_sensitivity @ second.accelerometer.bias
    return ImuModel(accelerometer, Triad(gyroscope.matrix, bias), sensitivity)


def _merged(first: Triad | None, second: Triad | None) -> Triad | None:
    if (first is None) != (second is None):
        raise UsageError("The two calibrations are not of the same triads.")
    if first is None or second is None:
        return None
    return Triad(
        np.asarray(first.matrix @ second.matrix), np.asarray(first.matrix @ second.bias + first.bias)
    )
