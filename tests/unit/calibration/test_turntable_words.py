"""What a user is told of a table's angles that do not fit."""

from __future__ import annotations

import numpy as np

from tumble.calibration.evidence import RotationFit, TurnedAngle
from tumble.calibration.turntable.estimate import misread_words

ARCSEC = np.pi / 648000.0


def fit(name: str, odd: float) -> RotationFit:
    """An axis whose two ways round are off by plus and minus `odd` arcseconds, known to 2."""
    angles = tuple(
        TurnedAngle(k, sign * 10.0 * np.pi, sign * odd * ARCSEC, 2.0 * ARCSEC, 182.0, True)
        for k, sign in enumerate((1.0, -1.0))
    )
    return RotationFit(name, np.array([1.0, 0.0, 0.0]), 0.5 * np.pi, 0.0, 1e-6, 1e-3, angles)


def test_one_axis_that_stands_out_is_an_angle_that_was_misread() -> None:
    words = misread_words([fit("x", 1.0), fit("y", 900.0), fit("z", -2.0), fit("(0.6, 0.8, 0)", 3.0)])
    assert len(words) == 1
    assert words[0].startswith("About y the gyros turned 900″ more one way and less the other")


def test_a_bias_of_that_hour_that_all_axes_show_is_none() -> None:
    assert misread_words([fit("x", 40.0), fit("y", -90.0), fit("z", 60.0), fit("(0.6, 0.8, 0)", 35.0)]) == []
    assert misread_words([]) == []
