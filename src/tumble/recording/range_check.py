"""A factor of two between a recording and what is believed of its scale: another range, or another sample rate.

Ranges of sensors are steps of two (±250, ±500, ±1000 °/s; ±2, ±4, ±8 g), and so are most sample rates. A calibration of
counts made at one range is wrong by two or four at the next, and gravity shows both: by its size at rest, and by how
fast it turns in the unit against what the gyros say.
"""

from __future__ import annotations

import numpy as np

from tumble.recording.gravity_check import gyro_scale_from_gravity
from tumble.recording.recording import Recording
from tumble.recording.rest import find_quiet_stretches
from tumble.units import STANDARD_GRAVITY

STEPS = (0.25, 0.5, 2.0, 4.0)
_NEAR = 0.15  # of a logarithm: how well a few turns show a scale, and how far a unit's own may be off
_WORDS = {0.25: "a quarter of", 0.5: "half", 2.0: "twice", 4.0: "four times"}


def step_of_two(ratio: float) -> float | None:
    """Return the step of two (1/4, 1/2, 2, 4) that a ratio is near, None if it is near none.

    Parameters
    ----------
    ratio : positive.

    Examples
    --------
    >>> step_of_two(2.1), step_of_two(1.1)
    (2.0, None)
    """
    near = (step for step in STEPS if ratio > 0.0 and abs(np.log(ratio / step)) < _NEAR)
    return next(near, None)


def gyro_step_words(ratio: float, rate: float) -> str | None:
    """Return which range or sample rate would explain that gravity turns so many times as fast as the gyros say.

    Parameters
    ----------
    ratio : of the turning that gravity shows to that which the gyros show.
    rate : Hz, that the gyros were added up at.
    """
    step = step_of_two(ratio)
    if step is None:
        return None
    factor = "two" if max(step, 1.0 / step) == 2.0 else "four"
    return (
        f"a factor of {factor} is another range of the gyro (as ±500 instead of ±250 °/s) or another sample rate "
        f"({rate / step:.4g} Hz instead of {rate:.4g} Hz: --rate)"
    )


def find_steps_of_two(corrected: Recording) -> list[str]:
    """Return sentences on triads of a corrected recording that are off by a step of two; none if neither is.

    Parameters
    ----------
    corrected : in m/s² and rad/s, as a calibration makes it.
    """
    if corrected.specific_force is None:
        return []
    said: list[str] = []
    quiet = find_quiet_stretches(corrected.specific_force, corrected.rate).at_least(0.5 * corrected.rate)
    norm = float(np.median(np.linalg.norm(quiet.means, axis=1))) if len(quiet) else np.nan
    step = step_of_two(norm / STANDARD_GRAVITY) if np.isfinite(norm) else None
    if step is not None:
        said.append(
            f"The corrected specific force at rest is {_WORDS[step]} gravity: such a factor is another range of the "
            "accelerometer (as ±4 instead of ±2 g) than the calibration's."
        )
    if corrected.angular_rate is None:
        return said
    scale = gyro_scale_from_gravity(corrected)
    words = gyro_step_words(scale.scale, corrected.rate) if scale is not None and scale.determined else None
    if scale is not None and words is not None:
        step = step_of_two(scale.scale)
        said.append(
            f"Gravity turns {_WORDS[step or 1.0]} as fast as the corrected gyro says: {words} than the "
            "calibration's."
        )
    return said
