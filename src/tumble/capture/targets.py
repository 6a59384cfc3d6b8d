"""Targets of a capture: how well each parameter is wanted, and how a parameter's uncertainty is written."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.units import DEGREE, STANDARD_GRAVITY

_PER_G = DEGREE / STANDARD_GRAVITY
_FORCE = {
    "mg": STANDARD_GRAVITY * 1e-3,
    "ug": STANDARD_GRAVITY * 1e-6,
    "g": STANDARD_GRAVITY,
    "m/s^2": 1.0,
    "m/s2": 1.0,
}
_RATE = {"deg/h": DEGREE / 3600.0, "deg/s": DEGREE, "mdeg/s": DEGREE * 1e-3, "rad/s": 1.0, "dps": DEGREE}
_SHARE = {"ppm": 1e-6, "%": 1e-2, "": 1.0}
_ANGLE = {
    "mrad": 1e-3,
    "urad": 1e-6,
    "rad": 1.0,
    "deg": DEGREE,
    "arcsec": DEGREE / 3600.0,
    "arcmin": DEGREE / 60.0,
}
_PER_FORCE = {"deg/h/g": _PER_G / 3600.0, "deg/s/g": _PER_G, "mdeg/s/g": 1e-3 * _PER_G}

# Name of a target, the group of parameters of `tumble.design.joint_information` that it means, its units to SI.
_TARGETS: dict[str, tuple[str, dict[str, float]]] = {
    "accelerometer.bias": ("accelerometer bias", _FORCE),
    "accelerometer.scale": ("accelerometer scale", _SHARE),
    "accelerometer.misalignment": ("accelerometer misalignment", _ANGLE),
    "gyro.bias": ("gyro bias", _RATE),
    "gyro.scale": ("gyro scale", _SHARE),
    "gyro.misalignment": ("gyro misalignment", _ANGLE),
    "gyro.rotation": ("rotation between the triads", _ANGLE),
    "gyro.g-sensitivity": ("g-sensitivity", _PER_FORCE),
}
# The unit that a group is shown in, and how many SI units it is.
SHOWN: dict[str, tuple[str, float]] = {
    "accelerometer bias": ("mg", _FORCE["mg"]),
    "accelerometer scale": ("ppm", 1e-6),
    "accelerometer misalignment": ("mrad", 1e-3),
    "gyro bias": ("°/h", _RATE["deg/h"]),
    "gyro scale": ("ppm", 1e-6),
    "gyro misalignment": ("mrad", 1e-3),
    "rotation between the triads": ("mrad", 1e-3),
    "g-sensitivity": ("(°/h)/g", _PER_G / 3600.0),
}


def read_targets(texts: Sequence[str]) -> dict[str, float]:
    """Return wished-for standard uncertainties, SI, by group of parameters.

    Parameters
    ----------
    texts : such as "accelerometer.bias=2mg"; several in one text with commas between.

    Raises
    ------
    UsageError
        If one is none.
    """
    found: dict[str, float] = {}
    for part in (piece.strip() for text in texts for piece in text.split(",")):
        if not part:
            continue
        name, _, wish = part.partition("=")
        name = name.strip().lower().replace("gyroscope", "gyro").replace("accel.", "accelerometer.")
        if name not in _TARGETS:
            raise UsageError(f"--target {part}: {name!r} is no parameter; known are {', '.join(_TARGETS)}.")
        group, units = _TARGETS[name]
        number = re.fullmatch(r"\s*([0-9.]+(?:e[-+]?[0-9]+)?)\s*(.*?)\s*", wish, re.IGNORECASE)
        unit = (
            ""
            if number is None
            else number[2].lower().replace("µ", "u").replace("°", "deg").replace("²", "^2")
        )
        try:
            value = float(number[1]) if number is not None else math.nan
        except ValueError:
            value = math.nan
        if unit not in units or not (math.isfinite(value) and value > 0.0):
            known = ", ".join(one or "no unit" for one in units)
            raise UsageError(f"--target {part}: give a positive number with its unit, one of {known}.")
        found[group] = value * units[unit]
    return found


def limits_of(targets: dict[str, float]) -> Series | None:
    """Return (30,) wished-for sigmas of `joint_information.NAMES`, infinite where nothing is wished; None for none.

    Parameters
    ----------
    targets : SI, by group.
    """
    from tumble.design.joint_information import GROUPS, PARAMETERS

    if not targets:
        return None
    limits = np.full(PARAMETERS, np.inf)
    for group, value in targets.items():
        limits[GROUPS[group]] = value
    return limits


@dataclass(frozen=True)
class GroupProgress:
    """The worst standard uncertainty of a group of parameters, in the unit that it is shown in, beside its target.

    Attributes
    ----------
    group, unit : their names.
    sigma : None while not all of the group are determined.
    told, of : how many are determined, of how many.
    target : None where none is wished for.
    reached : whether the worst is below it.
    """

    group: str
    unit: str
    sigma: float | None
    told: int
    of: int
    target: float | None
    reached: bool


def groups_of(sigmas: Mapping[str, float | None], targets: Mapping[str, float]) -> list[GroupProgress]:
    """Return the groups of which anything is known.

    Parameters
    ----------
    sigmas : standard uncertainty by parameter, SI; None while not determined.
    targets : wished-for ones, SI, by group.
    """
    from tumble.design.joint_information import GROUPS, NAMES

    rows: list[GroupProgress] = []
    for group, part in GROUPS.items():
        names = [name for name in NAMES[part] if name in sigmas]
        if not names:
            continue
        unit, size = SHOWN[group]
        told = [sigma for name in names if (sigma := sigmas[name]) is not None]
        worst, target = max(told) if len(told) == len(names) else None, targets.get(group)
        rows.append(
            GroupProgress(
                group,
                unit,
                None if worst is None else float(f"{worst / size:.3g}"),
                len(told),
                len(names),
                None if target is None else float(f"{target / size:.3g}"),
                target is not None and worst is not None and worst <= target,
            )
        )
    return rows
