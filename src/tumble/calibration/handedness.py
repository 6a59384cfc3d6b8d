"""Do accelerometer and gyro columns agree on axes and units? The turns show it.

Gravity carried by the gyro must be what the accelerometers see. A gyro whose axes are swapped,
reversed or left-handed against the accelerometers', or in another unit than declared, cannot do it.
What turns cannot show: the overall sign of gravity, and both triads permuted in the same way.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix
from tumble.errors import RecordingError
from tumble.recording.recording import Recording
from tumble.units import angular_rate_factor

# Consumer units have misalignments of degrees and scale errors of a few per cent; a start value adds
# some 10 %. Beyond this the columns are not what they are said to be.
LARGEST_COSINE_LOSS = 0.35
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
    # Row of `gyro_inverse`: axis of b; column: gyro column. Scale per column, direction per column.
    size = np.linalg.norm(gyro_inverse, axis=0)
    direction = gyro_inverse / size
    if np.any(np.diag(direction) < 1.0 - LARGEST_COSINE_LOSS):
        found: list[str] = []
        for column, name in enumerate("xyz"):
            axis = int(np.argmax(np.abs(direction[:, column])))
            sign = "+" if direction[axis, column] > 0 else "-"
            found.append(f"g{name} turns about {sign}{'xyz'[axis]}")
        handed = " (a left-handed triad)" if np.linalg.det(direction) < 0 else ""
        raise RecordingError(
            f"The turns show other gyro axes than the accelerometer's: {', '.join(found)}{handed}. "
            "Reorder or negate the columns with --columns, for example --columns t,ax,ay,az,gy,-gx,gz."
        )
    factor = angular_rate_factor(recording.angular_rate_unit)
    if factor is None:
        return
    ratio = float(np.median(size)) / factor
    if not 1.0 / LARGEST_SCALE_RATIO < ratio < LARGEST_SCALE_RATIO:
        raise RecordingError(
            f"The angular rate is said to be in {recording.angular_rate_unit}, but the turns show "
            f"{ratio:.3g} times that{_unit_hint(ratio * factor)}. Declare the unit with --units."
        )


def _unit_hint(size: float) -> str:
    for unit in ("rad/s", "deg/s", "mdeg/s"):
        factor = angular_rate_factor(unit)
        if factor is not None and abs(size / factor - 1.0) < 0.3:
            return f" (it looks like {unit})"
    return ""
