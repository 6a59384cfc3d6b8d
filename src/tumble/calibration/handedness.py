"""Whether accelerometer and gyro columns agree on axes and units: the turns show it.

Gravity carried by the gyro must be what the accelerometers see. A gyro whose axes are swapped,
reversed or left-handed against the accelerometers', or in another unit than declared, cannot do it.
What turns cannot show: the overall sign of gravity, and both triads permuted in the same way.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix
from tumble.errors import RecordingError
from tumble.recording import describe_axis_contradiction, unit_of_scale
from tumble.recording.recording import Recording
from tumble.units import angular_rate_factor

# Consumer units have scale errors of a few per cent; a start value adds some 10 %. Beyond this the
# columns are not in the unit that they are said to be in.
LARGEST_SCALE_RATIO = 1.5


def refuse_contradicting_axes(recording: Recording, gyro_inverse: Matrix) -> None:
    """Refuse a recording whose turns show other gyro axes or units than its columns say.

    Parameters
    ----------
    gyro_inverse : (3, 3) rough rad/s per raw unit, from the turns.

    Raises
    ------
    RecordingError
        Naming the axes or the unit that the turns show.
    """
    contradiction = describe_axis_contradiction(gyro_inverse, recording.columns)
    if contradiction is not None:
        raise RecordingError(contradiction)
    factor = angular_rate_factor(recording.angular_rate_unit)
    if factor is None:
        return
    scale = float(np.median(np.linalg.norm(gyro_inverse, axis=0)))
    if not 1.0 / LARGEST_SCALE_RATIO < scale / factor < LARGEST_SCALE_RATIO:
        unit = unit_of_scale(scale)
        raise RecordingError(
            f"The angular rate is said to be in {recording.angular_rate_unit}, but the turns show "
            f"{scale / factor:.3g} times that{f' (it looks like {unit})' if unit else ''}. "
            "Declare the unit with --units."
        )
