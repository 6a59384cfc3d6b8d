"""What a table's rotations tell beside the triads, as parameters: the lag between them, and lever arms.

Lever arms are named one by one where the motion tells each; where it tells only the sum or the difference of
two (one edge of a pair of axes), that is named.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Series
from tumble.calibration.equations.imu_unknowns import LAYOUT, LEVER_ARM
from tumble.calibration.equations.size_effect import PAIRS

Complex = npt.NDArray[Any]
# What is less certain than this share of what a unit may have is no result.
WORTH_NAMING = 0.45
# Two lever arms whose sum or difference is so much better known than they are by themselves are named by these.
TOGETHER = 0.5
Label = tuple[str, str]
LAG_NAME = "lag of the accelerometer behind the gyro"
ARM, ARMS = "accelerometer lever arm", "accelerometer lever arms"


def table_parameters(
    terms: frozenset[str], rotation: Callable[[Complex], Complex], frame: str
) -> tuple[list[Label], Callable[[Complex], list[Complex]]]:
    """Return names and units of the terms that were kept, and the function of all unknowns that gives them.

    Parameters
    ----------
    terms : that were kept, of whatever kind.
    rotation : C_bf by all unknowns.
    frame : "accelerometer-x", or another one, whose axes the lever arms are then along.
    """
    labels: list[Label] = [(LAG_NAME, "s")] if "time_lag" in terms else []
    turned = frame != "accelerometer-x"
    if "lever_arms" in terms:
        pairs = [(i, j) for i in range(3) for j in range(3)] if turned else list(PAIRS)
        labels += [(f"{ARM} {'xyz'[i]}{'xyz'[j]}", "m") for i, j in pairs]
        if not turned:
            labels += [(f"{ARMS} {_both(i, j, sign)}", "m") for i, j in PAIRS if i < j for sign in "+-"]

    def evaluate(x: Complex) -> list[Complex]:
        made = [x[LAYOUT["lag"]]] if "time_lag" in terms else []
        if "lever_arms" not in terms:
            return made
        arms = x[LAYOUT["lever_arms"]].reshape(3, 3)
        if turned:
            return [*made, (arms @ rotation(x)).ravel()]
        single = [arms[i, j] for i, j in PAIRS]
        both = [arms[i, j] + sign * arms[j, i] for i, j in PAIRS if i < j for sign in (1.0, -1.0)]
        return [*made, np.array([*single, *both])]

    return labels, evaluate


def _both(i: int, j: int, sign: str) -> str:
    return f"{'xyz'[i]}{'xyz'[j]}{sign}{'xyz'[j]}{'xyz'[i]}"


def lever_arms_of(unknowns: Series, terms: frozenset[str], C_bf: Matrix) -> Matrix | None:
    """Return (3, 3) m where each accelerometer sits in the frame of the result; None where it is not known.

    Parameters
    ----------
    unknowns, terms : all, and the terms that were kept.
    C_bf : from the frame of the result to the sensors' own.
    """
    if "lever_arms" not in terms:
        return None
    return np.asarray(unknowns[LAYOUT["lever_arms"]].reshape(3, 3) @ C_bf, dtype=np.float64)


def told_table_parameters(labels: list[Label], sigmas: Series) -> np.ndarray:
    """Return which parameters are to be named, of bool: each pair of lever arms, or else its sum or difference.

    Parameters
    ----------
    labels, sigmas : of all parameters, whatever they are.
    """
    keep = np.ones(len(labels), dtype=bool)
    at = {name: k for k, (name, _) in enumerate(labels) if name.startswith(ARM)}
    for name, k in at.items():
        keep[k] = sigmas[k] < WORTH_NAMING * LEVER_ARM
        if name.startswith(ARMS):
            pair = name.removeprefix(f"{ARMS} ")
            single = [at[f"{ARM} {pair[:2]}"], at[f"{ARM} {pair[3:]}"]]
            both = [at[f"{ARMS} {pair[:2]}{sign}{pair[3:]}"] for sign in "+-"]
            as_sum = np.min(sigmas[both]) < TOGETHER * np.max(sigmas[single])
            keep[k] &= as_sum
            keep[single] &= not as_sum
    return keep


def table_remarks(terms: frozenset[str], named: dict[str, tuple[float, float]]) -> list[str]:
    """Return what the user has to know of the terms that were kept, in sentences.

    Parameters
    ----------
    terms : that were kept.
    named : parameters by name, value and standard uncertainty in SI.
    """
    told: list[str] = []
    if "time_lag" in terms and LAG_NAME in named:
        lag, sigma = named[LAG_NAME]
        earlier = "earlier" if lag > 0 else "later"
        told.append(
            f"A sample of the accelerometer is of an instant {abs(1e3 * lag):.2g} ms (± "
            f"{1e3 * sigma:.1g} ms) {earlier} than the gyro's with the same stamp. The estimate takes "
            "it into account. `tumble apply --shift-lag` takes it out, or give it to your filter."
        )
    if "lever_arms" in terms:
        arms = [value for name, value in named.items() if name.startswith(ARM)]
        largest = max((abs(value) for value, _ in arms), default=0.0)
        told.append(
            f"The accelerometers sit at different places of the unit, up to {1e3 * largest:.2g} mm "
            "apart by the rotations. Lever arm ij is the place of accelerometer i along j, counted "
            "from accelerometer j. The estimate takes them into account, and `tumble apply` takes "
            "out what they feel while the unit turns."
        )
    return told
