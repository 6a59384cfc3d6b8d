"""What a data sheet knows of a triad before any recording: the stochastic constraint P of Shin and El-Sheimy.

The sheet's one-sigma spreads are a prior of the nine unknowns (Hayal 2010, after 3.38: N = A' C^-1 A + P).
It lets few poses, or a gyro that hardly sees the Earth's rate, tell what they can; the rest stays what the
sheet says, and that is said.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, SCALE
from tumble.calibration.prior import StableKnowledge
from tumble.estimation import Prior
from tumble.simulation import TriadGrade

# Of a prior's sigma: more than this left, and the recording has told next to nothing of the parameter.
TOLD = 0.9
# The estimate is off the sheet by more than this: one in 150,000 of its units.
LARGEST_NORMALISED = 4.5
NAMES = [
    *(f"bias {axis}" for axis in "xyz"),
    *(f"scale factor {axis}" for axis in "xyz"),
    *(f"non-orthogonality {angle}" for angle in ("yz", "zx", "zy")),
]


def sheet_prior(spread: TriadGrade, factor: float, *, knowledge: StableKnowledge | None = None) -> Prior:
    """Return the prior of a triad's nine unknowns from its data sheet.

    Parameters
    ----------
    spread : one-sigma spreads, SI.
    factor : SI per raw unit.
    knowledge : angles of an earlier calibration, which are known better and take the sheet's place.

    Notes
    -----
    An angle between two sensing axes has twice the variance of each axis' misalignment about one
    direction.
    """
    mean, sigma = np.zeros(9), np.empty(9)
    mean[SCALE] = 1.0 / factor
    sigma[BIAS] = spread.bias / factor
    sigma[SCALE] = spread.scale_factor / factor
    sigma[ANGLE] = np.sqrt(2.0) * spread.misalignment
    precision = np.diag(sigma**-2)
    if knowledge is not None:
        mean[ANGLE] = knowledge.angles
        precision[ANGLE, ANGLE] = np.linalg.inv(knowledge.angle_covariance)
    return Prior(mean, precision)


def about_sheet(name: str, values: Series, sigmas: Series, prior: Prior) -> tuple[list[str], list[str]]:
    """Return what the recording left to the sheet, and what contradicts it, as sentences.

    Parameters
    ----------
    name : "accelerometer" or "gyro".
    values, sigmas : (9,) estimates with the prior in them, and their standard uncertainties.
    prior : as `sheet_prior` has it.
    """
    before = np.sqrt(np.diag(np.linalg.inv(prior.precision)))
    untold = [NAMES[i] for i in np.flatnonzero(sigmas > TOLD * before)]
    remarks: list[str] = []
    if untold:
        remarks.append(
            f"Of the {name}s the recording determines next to nothing of {', '.join(untold)}: the "
            "values and their uncertainties are the data sheet's."
        )
    # What the data add makes the estimate differ from the prior with the variance that they took away.
    spread = np.sqrt(np.maximum(before**2 - sigmas**2, (1e-6 * before) ** 2))
    off = np.abs(values - prior.mean) / spread
    worst = int(np.argmax(np.where(sigmas > TOLD * before, 0.0, off)))
    objections: list[str] = []
    if off[worst] > LARGEST_NORMALISED and sigmas[worst] <= TOLD * before[worst]:
        objections.append(
            f"The recording contradicts the data sheet: the {name}'s {NAMES[worst]} is {off[worst]:.0f} of the sheet's "
            "standard deviations off. It is another kind of unit, or a unit or column is wrong: calibrate without "
            "--data-sheet."
        )
    return remarks, objections
