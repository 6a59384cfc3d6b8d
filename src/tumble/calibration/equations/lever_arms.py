"""What accelerometers feel because they sit at different places of a unit that turns (size effect), taken out.

An accelerometer at ``r`` feels ``w x (w x r) + dw/dt x r`` more than the point that places are counted from.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vector, Vectors, inverted
from tumble.attitude.rotations import skews
from tumble.errors import UsageError
from tumble.sensor import ImuModel

# Across a longer gap between samples an angular acceleration says nothing.
LONGEST_STEP = 0.1  # s


class LeverArms:
    """Lever arms at work on consecutive blocks of a recording: the last sample of a block is kept for the next."""

    def __init__(self, arms: Matrix, matrix: Matrix) -> None:
        """Begin at the start of a recording.

        Parameters
        ----------
        arms : (3, 3) m in b, a row each accelerometer.
        matrix : (3, 3) of the accelerometers, true to raw.
        """
        self.arms, self.matrix = arms, matrix
        self._back = inverted(matrix)
        self._last: tuple[float, Vector] | None = None

    @staticmethod
    def of(arms: Sequence[Sequence[float]] | None, model: ImuModel) -> LeverArms | None:
        """Return them as a document has them; None where there are none."""
        if arms is None or model.accelerometer is None:
            return None
        return LeverArms(np.array(arms, dtype=np.float64), model.accelerometer.matrix)

    def taken_out(self, force: Vectors, rate: Vectors, time: Series | None) -> Vectors:
        """Return the specific force (m/s²) at the point that lever arms are counted from.

        The angular acceleration is what the rate changed by since the sample before, over the time between: it
        comes half a sample late, and adds up to the change of the rate exactly.

        Parameters
        ----------
        force, rate : (samples, 3) corrected otherwise, in b, m/s² and rad/s.
        time : (samples,) s.

        Raises
        ------
        UsageError
            If there is no time.
        """
        if not len(force):
            return force
        if time is None:
            raise UsageError(
                "The calibration has lever arms of the accelerometers, which need the angular acceleration: give the "
                "time of the samples."
            )
        turned = skews(rate)
        by_place = turned @ turned + skews(self._accelerations(rate, np.asarray(time, dtype=np.float64)))
        felt: AnyArray = np.einsum("nij,aj->nai", by_place, self.arms)
        # Each accelerometer along its own sensing axis, which leans a little.
        raw = np.einsum("ab,nab->na", self.matrix, felt)
        return np.asarray(force - raw @ self._back.T, dtype=np.float64)

    def _accelerations(self, rate: Vectors, time: Series) -> Vectors:
        before = (time[0], rate[0]) if self._last is None else self._last
        self._last = (float(time[-1]), rate[-1].copy())
        step = np.diff(time, prepend=before[0])
        change = np.diff(rate, axis=0, prepend=before[1][None])
        usable = (step > 0.0) & (step <= LONGEST_STEP)
        return np.where(usable[:, None], change / np.where(usable, step, 1.0)[:, None], 0.0)
