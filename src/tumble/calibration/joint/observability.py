"""What a recording does not tell the joint estimator, from its information matrix, in words.

The normal matrix of all unknowns is made where the estimate starts; nothing is adjusted for it. What it leaves less
certain than half of what a unit's name plate promises is not told by the motion: such unknowns keep the name
plate's value and uncertainty, so that what is told does not take their error on, and are named, with the pose
or the turn that would tell them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import Series, Square, inverted
from tumble.calibration.equations.triad_unknowns import ANGLE, BIAS, QUADRATIC, SCALE
from tumble.calibration.joint.unknowns import G_SENSITIVITY, GYRO_BIAS, GYRO_MATRIX, SHARED, gyro_matrix
from tumble.calibration.joint.wide import (
    FIXTURE,
    FORCE_ASYMMETRY,
    LEVER_ARMS,
    RATE_ASYMMETRY,
    RATE_QUADRATIC,
    TIME_LAG,
)
from tumble.calibration.prior import StableKnowledge
from tumble.errors import ObservabilityError
from tumble.estimation import Prior, find_weak_directions
from tumble.estimation.weak_directions import WeakDirection

# What a unit's name plate promises, one sigma: 30 mg and 1 °/s of bias, 3 % of scale, 3 % of an angle in rad.
NAME_PLATE_FORCE, NAME_PLATE_RATE, NAME_PLATE_SHARE = 0.3, 0.02, 0.03
MOUNTING = 0.2  # rad
# Accelerometers of a unit sit so far apart, and triads lag each other by so much, one sigma.
LEVER_ARM, LAG = 0.03, 0.01  # m, s
# An unknown is told if its sigma is below this share of the name plate's.
TOLD = 0.5
# More combinations than this are not read by anybody.
MOST_COMBINATIONS = 6


@dataclass(frozen=True, slots=True)
class Untold:
    """What the motion does not tell.

    Attributes
    ----------
    unknowns : indices that are not told.
    directions : combinations that are not told, in sizes of the name plate, worst first.
    sentences : the same in words, with what would tell each.
    """

    unknowns: np.ndarray
    directions: list[WeakDirection]
    sentences: list[str]


def name_plate(unknowns: Series) -> Series:
    """Return one sigma of each unknown as any unit's name plate promises it, in its own unit.

    Parameters
    ----------
    unknowns : (33,) or more, start values: raw units are the sensors' own.
    """
    sizes = np.ones(unknowns.size)
    scale = np.abs(unknowns[SCALE])
    rows = np.linalg.norm(gyro_matrix(unknowns), axis=1)
    sizes[BIAS] = NAME_PLATE_FORCE * scale
    sizes[SCALE] = NAME_PLATE_SHARE * scale
    sizes[ANGLE] = NAME_PLATE_SHARE
    sizes[QUADRATIC] = 1e-3 / scale
    sizes[GYRO_MATRIX] = np.repeat(NAME_PLATE_SHARE * rows, 3)
    sizes[GYRO_BIAS] = NAME_PLATE_RATE * rows
    sizes[G_SENSITIVITY] = np.repeat(1e-3 * rows, 3)
    if unknowns.size > SHARED:
        sizes[FIXTURE] = MOUNTING
        sizes[FORCE_ASYMMETRY] = sizes[RATE_ASYMMETRY] = 0.01
        sizes[LEVER_ARMS] = LEVER_ARM
        sizes[TIME_LAG] = LAG
        sizes[RATE_QUADRATIC] = 1e-3 / rows
    return sizes


def find_untold(normal: Square, free: np.ndarray, unknowns: Series) -> Untold | None:
    """Return what an information matrix leaves untold; None if everything is told.

    Parameters
    ----------
    normal : (free, free) information of the free unknowns, whatever is believed beforehand included.
    free : their indices among all.
    unknowns : start values.
    """
    sizes = name_plate(unknowns)[free]
    scaled = normal * np.outer(sizes, sizes)
    posterior = np.diag(np.linalg.inv(scaled + np.eye(free.size)))
    # sigma² / (sigma² + size²) of what the motion alone tells
    without = posterior > TOLD**2 / (1.0 + TOLD**2)
    directions = find_weak_directions(normal, sizes, TOLD)
    if not np.any(without) and not directions:
        return None
    sentences = [_in_words(direction, free) for direction in directions[:MOST_COMBINATIONS]]
    if len(directions) > MOST_COMBINATIONS:
        sentences.append(f"Not told: {len(directions) - MOST_COMBINATIONS} more combinations like these.")
    return Untold(free[without], directions, list(dict.fromkeys(sentences)))


def name_plate_prior(unknowns: Series, free: np.ndarray) -> Prior:
    """Return what the name plate knows of the free unknowns, about their start values.

    Parameters
    ----------
    unknowns : start values.
    free : indices.
    """
    precision = np.zeros((unknowns.size, unknowns.size))
    precision[free, free] = 1.0 / name_plate(unknowns)[free] ** 2
    return Prior(unknowns.copy(), precision)


def angle_prior(values: Series, knowledge: StableKnowledge | None) -> Prior | None:
    """Return what an earlier calibration knows of the accelerometers' angles as a prior; None without one.

    Parameters
    ----------
    values : (33,) unknowns or more, whose number the prior has.
    knowledge : of the angles.
    """
    if knowledge is None:
        return None
    mean, precision = values.copy(), np.zeros((values.size, values.size))
    mean[ANGLE] = knowledge.angles
    precision[ANGLE, ANGLE] = inverted(knowledge.angle_covariance)
    return Prior(mean, precision)


def together(first: Prior | None, second: Prior | None) -> Prior | None:
    """Return two priors as one.

    Parameters
    ----------
    first, second : of the same unknowns, or None.

    Raises
    ------
    ObservabilityError
        If one knows of other unknowns than the other.
    """
    if first is None or second is None:
        return second if first is None else first
    if first.mean.size != second.mean.size:
        raise ObservabilityError("Two kinds of prior knowledge are of different unknowns.")
    precision = first.precision + second.precision
    right = first.precision @ first.mean + second.precision @ second.mean
    known = np.flatnonzero(np.diag(precision) > 0.0)
    mean = first.mean.copy()
    scale = 1.0 / np.sqrt(np.diag(precision)[known])
    own = precision[np.ix_(known, known)] * np.outer(scale, scale)
    mean[known] = scale * (np.linalg.pinv(own, hermitian=True) @ (scale * right[known]))
    return Prior(mean, precision)


def name_of(index: int) -> str:
    """Return an unknown in words.

    Parameters
    ----------
    index : among all unknowns.
    """
    axis = "xyz"[index % 3]
    for place, words in (
        (BIAS, "bias of accelerometer {}"),
        (SCALE, "scale factor of accelerometer {}"),
        (QUADRATIC, "quadratic term of accelerometer {}"),
        (GYRO_BIAS, "bias of gyro {}"),
        (FIXTURE, "rotation of the unit in its fixture about {}"),
        (FORCE_ASYMMETRY, "asymmetry of accelerometer {}"),
        (RATE_ASYMMETRY, "asymmetry of gyro {}"),
        (RATE_QUADRATIC, "quadratic term of gyro {}"),
    ):
        if place.start <= index < place.stop:
            return words.format(axis)
    if ANGLE.start <= index < ANGLE.stop:
        return f"non-orthogonality {('yz', 'zx', 'zy')[index - ANGLE.start]} of the accelerometers"
    if GYRO_MATRIX.start <= index < GYRO_MATRIX.stop:
        row, column = divmod(index - GYRO_MATRIX.start, 3)
        if row == column:
            return f"scale factor of gyro {'xyz'[row]}"
        return f"what gyro {'xyz'[row]} senses of a rate about {'xyz'[column]}"
    if G_SENSITIVITY.start <= index < G_SENSITIVITY.stop:
        row, column = divmod(index - G_SENSITIVITY.start, 3)
        return f"g-sensitivity of gyro {'xyz'[row]} to force {'xyz'[column]}"
    if index == TIME_LAG.start:
        return "lag of the accelerometers behind the gyros"
    row, column = divmod(index - LEVER_ARMS.start, 3)
    return f"lever arm of accelerometer {'xyz'[row]} along {'xyz'[column]}"


def mending_of(index: int) -> str:
    """Return which pose or turn would tell an unknown.

    Parameters
    ----------
    index : among all unknowns.
    """
    axis = "xyz"[index % 3]
    if index < SCALE.stop or QUADRATIC.start <= index < QUADRATIC.stop:
        return f"a hold with {axis} up and one with {axis} down"
    if ANGLE.start <= index < ANGLE.stop:
        pair = (("x", "y"), ("y", "z"), ("x", "z"))[index - ANGLE.start]
        return f"a hold with an edge between {pair[0]} and {pair[1]} up"
    if GYRO_MATRIX.start <= index < GYRO_MATRIX.stop:
        column = "xyz"[(index - GYRO_MATRIX.start) % 3]
        return f"a turn about {column} while {column} lies level"
    if GYRO_BIAS.start <= index < GYRO_BIAS.stop:
        return "a longer rest"
    if G_SENSITIVITY.start <= index < G_SENSITIVITY.stop:
        column = "xyz"[(index - G_SENSITIVITY.start) % 3]
        return f"long holds with {column} up and with {column} down"
    if FIXTURE.start <= index < FIXTURE.stop:
        return "believed poses with two different faces up in the same fixture"
    if FORCE_ASYMMETRY.start <= index < FORCE_ASYMMETRY.stop:
        return f"holds with {axis} up, down and level"
    if RATE_ASYMMETRY.start <= index < RATE_ASYMMETRY.stop:
        return f"turns both ways about {axis}"
    if RATE_QUADRATIC.start <= index < RATE_QUADRATIC.stop:
        return f"turns about {axis} at several rates, both ways"
    if index == TIME_LAG.start:
        return "a turn of the table about a level axis"
    row, column = divmod(index - LEVER_ARMS.start, 3)
    pair = f"{'xyz'[row]} and {'xyz'[column]}"
    return f"fast turns of the table about both edges between {pair}"


def _in_words(direction: WeakDirection, free: np.ndarray) -> str:
    leading = direction.leading()
    indices = [int(free[i]) for i in leading]
    named = [name_of(i) for i in indices[:4]]
    what = named[0] if len(named) == 1 else "a combination of " + ", ".join(named[:-1]) + " and " + named[-1]
    if len(indices) > 4:
        what += f" with {len(indices) - 4} more"
    mended = list(dict.fromkeys(mending_of(i) for i in indices))[:2]
    return f"Not told by the motion: {what}. What would tell it: {'; or '.join(mended)}."
