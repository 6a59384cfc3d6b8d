"""What the numbers of a triad show of its kind: a constant vector seen from a turning unit, gravity's or the Earth's.

Accelerometers at rest and magnetometers both see one vector from all sides, so both keep their norm while they turn.
Three things tell them apart. Gravity is 1 g in some unit, the Earth's field 22 to 67 µT in some unit. And a hand, or a
vehicle, that turns a unit also pushes it about: that changes the norm of the specific force, within a second, by some
per cent and many times its noise; the norm of the field does not feel it. On a table that turns smoothly neither norm
does, and then the numbers leave it open.

References
----------
Range of the Earth's field: NOAA, *World Magnetic Model 2025*, 22 to 67 µT at the surface.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors, block_means
from tumble.recording.rest import count_poses, fit_sphere, one_a_direction, sample_pieces, smallest_step
from tumble.records import dataclass
from tumble.units import STANDARD_GRAVITY, known_units, magnetic_field_factor, specific_force_factor

EARTH_FIELD = (22e-6, 67e-6)
"""The least and the greatest field at the Earth's surface, T."""

_FIELD_MARGIN = 1.05  # a local anomaly, and an uncalibrated scale
_GRAVITY_TOLERANCE = 0.15  # of the norm: an uncalibrated MEMS is off by a few per cent
_MOST_OFFSET = 0.25  # of gravity, that the bias of an accelerometer has
_BLOCK_SECONDS = 0.4
_LEAST_BLOCK = 12
_TURNS = (0.25, 2.5)  # rad in a block: it turns, and its norm can still be followed
_FEWEST = 5  # blocks that turn, and that rest
_SHAKEN = (0.012, 4.0)  # scatter of the norm while turning: of the norm, and of that at rest
_STEADY = (0.03, 2.0)
_FEWEST_DIRECTIONS = 4
_SPHERE_DIRECTIONS = 9
_CONSTANT = 0.12  # of the norm: its scatter over directions
_PARTS = 4  # of a block, whose means are points of the sphere
_ALWAYS = (0.05, 0.95)
_AROUND = (0.5, 2.0)  # of the norm, in which a vector stays all these times
_THINNED = 6000  # points whose directions are compared


@dataclass(frozen=True, slots=True)
class VectorSigns:
    """What shows whether a triad sees gravity, the Earth's field or neither.

    Attributes
    ----------
    norm : of the vector, raw: the radius of the sphere on which the directions lie, or the middle norm.
    offset : of the sphere's centre from zero, in radii; 0 where no sphere is determined.
    is_vector : whether the norm is the same in every direction; None where too few directions were taken.
    motion : "shaken" if motion changes the norm, "steady" if it does not, None where nothing shows it.
    whole : whether the numbers are whole.
    """

    norm: float
    offset: float
    is_vector: bool | None
    motion: Literal["steady", "shaken"] | None
    whole: bool

    def gravity_unit(self, declared: str | None = None) -> str | None:
        """Return the unit in which the norm is that of gravity: the declared one, or m/s², g or mg; else None."""
        if self.offset > _MOST_OFFSET:
            return None
        for unit in ("m/s^2", "g", "mg") if declared is None else (declared,):
            factor = specific_force_factor(unit)
            if factor is not None and abs(self.norm * factor / STANDARD_GRAVITY - 1.0) < _GRAVITY_TOLERANCE:
                return unit
        return None

    @property
    def field_unit(self) -> str | None:
        """The unit in which the norm is the Earth's field, or None."""
        return field_unit_of(self.norm)


def field_unit_of(norm: float) -> str | None:
    """Return the unit in which a norm is that of the Earth's field, or None; counts are none.

    Examples
    --------
    >>> field_unit_of(49.2), field_unit_of(0.48), field_unit_of(480.0), field_unit_of(9.81)
    ('uT', 'gauss', 'mgauss', None)
    """
    for unit in known_units("magnetic field"):
        factor = magnetic_field_factor(unit)
        if factor is not None and is_earth_field(norm * factor):
            return unit
    return None


def is_earth_field(norm: float) -> bool:
    """Say whether a norm in T can be that of the Earth's field."""
    return EARTH_FIELD[0] / _FIELD_MARGIN < norm < EARTH_FIELD[1] * _FIELD_MARGIN


def vector_signs(values: Vectors, rate: float) -> VectorSigns:
    """Return what a triad's numbers show of its kind, of a long recording a dozen pieces of it.

    Parameters
    ----------
    values : (samples, 3) raw, finite.
    rate : Hz, roughly.
    """
    size = max(_LEAST_BLOCK, round(_BLOCK_SECONDS * rate))
    pieces = [values[cut] for cut in sample_pieces(values.shape[0])]
    blocks = np.concatenate([p[: len(p) // size * size].reshape(-1, size, 3) for p in pieces])
    whole = bool(np.all(values[:50_000] == np.round(values[:50_000])))
    if len(blocks) < _FEWEST:
        norm = float(np.median(np.linalg.norm(values, axis=1))) if len(values) else 0.0
        return VectorSigns(norm, 0.0, None, None, whole)
    # Parts of a block, so that a turn of a second passes through several directions.
    parts = blocks[:, : size // _PARTS * _PARTS].reshape(-1, 3)
    parts = block_means(parts, size // _PARTS)
    centre, norms = _sphere(parts)
    norm = float(np.median(norms))
    offset = float(np.linalg.norm(centre)) / norm if norm > 0.0 else 0.0
    constant = None
    if norms.size >= _FEWEST_DIRECTIONS:
        scatter = 1.4826 * float(np.median(np.abs(norms - norm)))
        # A gyro may reach one rate in every direction, but it is at its bias while the unit rests.
        low, high = np.quantile(np.linalg.norm(parts - centre, axis=1), _ALWAYS)
        always = low > _AROUND[0] * norm and high < _AROUND[1] * norm
        constant = bool(norm > 0.0 and scatter < _CONSTANT * norm and always)
    return VectorSigns(norm, offset, constant, _motion(blocks - centre, norm) if constant else None, whole)


def _sphere(means: Vectors) -> tuple[Vector, Series]:
    """Return the centre of the sphere that means lie on, and the norms about it, one a direction.

    Zero is the centre where too few directions determine it, or the means lie on no sphere.
    """
    thinned = means[:: max(1, len(means) // _THINNED)]
    around_zero = np.linalg.norm(one_a_direction(thinned), axis=1)
    fitted = fit_sphere(thinned)
    if fitted is None:
        return np.zeros(3), around_zero
    kept = one_a_direction(thinned - fitted[0])
    again = fit_sphere(kept + fitted[0])
    if again is None or count_poses(kept) < _SPHERE_DIRECTIONS:
        return np.zeros(3), around_zero
    norms = np.linalg.norm(one_a_direction(thinned - again[0]), axis=1)
    best = _relative_scatter(around_zero) if around_zero.size >= _FEWEST_DIRECTIONS else np.inf
    if _relative_scatter(norms) > min(_CONSTANT, best):
        return np.zeros(3), around_zero
    return again[0], norms


def _relative_scatter(norms: Series) -> float:
    middle = float(np.median(norms))
    return 1.4826 * float(np.median(np.abs(norms - middle))) / middle if middle > 0.0 else np.inf


def _motion(blocks: AnyArray, norm: float) -> Literal["steady", "shaken"] | None:
    """Compare the scatter of the norm within blocks that turn with that of blocks that do not."""
    norms = np.linalg.norm(blocks, axis=2)
    size = norms.shape[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.einsum("bi,bi->b", blocks[:, 0], blocks[:, -1]) / (norms[:, 0] * norms[:, -1])
    turned = np.nan_to_num(np.arccos(np.clip(cosine, -1.0, 1.0)), nan=np.pi)
    # What turning about a wrong centre does to the norm is smooth: a parabola takes it out.
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, size), 3))
    rest = norms - (norms @ basis) @ basis.T
    scatter = np.sqrt((rest**2).sum(axis=1) / (size - 3))
    moving = (turned > _TURNS[0]) & (turned < _TURNS[1])
    still = turned <= np.quantile(turned, 0.2)
    if int(moving.sum()) < _FEWEST or int(still.sum()) < _FEWEST or bool(np.any(moving & still)):
        return None
    while_turning = float(np.median(scatter[moving]))
    steps = min(smallest_step(blocks[:, 0, i]) for i in range(3)) / np.sqrt(12.0)
    at_rest = max(float(np.median(scatter[still])), steps, 1e-12 * norm)
    if while_turning > _SHAKEN[0] * norm and while_turning > _SHAKEN[1] * at_rest:
        return "shaken"
    if while_turning < _STEADY[0] * norm and while_turning < _STEADY[1] * at_rest:
        return "steady"
    return None
