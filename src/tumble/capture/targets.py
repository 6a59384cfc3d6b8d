"""Targets of a capture: how well each parameter is wanted, and how a parameter's uncertainty is written."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.parameters.measures import si_of
from tumble.records import dataclass

# Name of a target, the group of parameters of `tumble.design.joint_information` that it means, what its unit is of.
_TARGETS = {
    "accelerometer.bias": ("accelerometer bias", "specific force"),
    "accelerometer.scale": ("accelerometer scale", "ratio"),
    "accelerometer.misalignment": ("accelerometer misalignment", "angle increment"),
    "gyro.bias": ("gyro bias", "angular rate"),
    "gyro.scale": ("gyro scale", "ratio"),
    "gyro.misalignment": ("gyro misalignment", "angle increment"),
    "gyro.rotation": ("rotation between the triads", "angle increment"),
    "gyro.g-sensitivity": ("g-sensitivity", "rate per force"),
}
# The unit that a group is shown in while it shrinks, and what people give a target in.
_SHOWN = {
    "specific force": ("mg", "mg, ug, m/s^2"),
    "angular rate": ("°/h", "deg/h, deg/s, mdeg/s, rad/s"),
    "ratio": ("ppm", "ppm, %, no unit"),
    "angle increment": ("mrad", "mrad, deg, arcsec, rad"),
    "rate per force": ("(°/h)/g", "deg/h/g, deg/s/g, mdeg/s/g"),
}
_KINDS = dict(_TARGETS.values())


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
        group, kind = _TARGETS[name]
        number = re.fullmatch(r"\s*((?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(.*?)\s*", wish.lower())
        value, unit = number.groups() if number else ("nan", "")
        of, size = si_of(unit)
        if of != kind or not 0.0 < float(value) < math.inf:
            raise UsageError(
                f"--target {part}: give a positive number with its unit, one of {_SHOWN[kind][1]}."
            )
        found[group] = float(value) * size
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
        unit = _SHOWN[_KINDS[group]][0]
        size = si_of(unit)[1]
        told = [sigma for name in names if (sigma := sigmas[name]) is not None]
        worst, target = max(told) if len(told) == len(names) else None, targets.get(group)
        rows.append(
            GroupProgress(
                group,
                unit,
                None if worst is None else float(f"{worst / size:.2g}"),
                len(told),
                len(names),
                None if target is None else float(f"{target / size:.3g}"),
                target is not None and worst is not None and worst <= target,
            )
        )
    return rows
