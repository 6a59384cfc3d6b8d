"""Targets of a capture: how well each parameter is wanted, and how a parameter's uncertainty is written."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.parameters import si_of
from tumble.records import dataclass

# Name of a target, the group of parameters of `tumble.design.joint_information` that it means, and its family.
_TARGETS = {
    "accelerometer.bias": ("accelerometer bias", "accelerometer bias"),
    "accelerometer.scale": ("accelerometer scale", "scale"),
    "accelerometer.misalignment": ("accelerometer misalignment", "angle"),
    "gyro.bias": ("gyro bias", "gyro bias"),
    "gyro.scale": ("gyro scale", "scale"),
    "gyro.misalignment": ("gyro misalignment", "angle"),
    "gyro.rotation": ("rotation between the triads", "angle"),
    "gyro.g-sensitivity": ("g-sensitivity", "g-sensitivity"),
}
# What a family's unit is of, and what people give a target in.
_GIVEN = {
    "accelerometer bias": ("specific force", "mg, ug, m/s^2"),
    "gyro bias": ("angular rate", "deg/h, deg/s, mdeg/s, rad/s"),
    "scale": ("ratio", "ppm, %, no unit"),
    "angle": ("angle increment", "mrad, deg, arcsec, rad"),
    "g-sensitivity": ("rate per force", "deg/h/g, deg/s/g, mdeg/s/g"),
}
_FAMILIES = dict(_TARGETS.values())


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
        group, family = _TARGETS[name]
        kind, units = _GIVEN[family]
        number = re.fullmatch(r"\s*((?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(.*?)\s*", wish.lower())
        value, unit = number.groups() if number else ("nan", "")
        of, size = si_of(unit)
        if of != kind or not 0.0 < float(value) < math.inf:
            raise UsageError(f"--target {part}: give a positive number with its unit, one of {units}.")
        found[group] = float(value) * size
    return found


def limits_of(targets: dict[str, float]) -> Series | None:
    """Return (30,) wished-for sigmas of `joint_information.NAMES`, infinite where nothing is wished; None for none.

    Parameters
    ----------
    targets : SI, by group.
    """
    from tumble.design import PARAMETER_GROUPS, PARAMETERS

    if not targets:
        return None
    limits = np.full(PARAMETERS, np.inf)
    for group, value in targets.items():
        limits[PARAMETER_GROUPS[group]] = value
    return limits


@dataclass(frozen=True)
class GroupProgress:
    """The worst standard uncertainty of a group of parameters beside its target, in the unit that people say.

    Attributes
    ----------
    group : its name.
    sigma : how many are determined, while not all are.
    target : empty where none is wished for.
    reached : whether the worst is below it.
    """

    group: str
    sigma: str
    target: str
    reached: bool


def groups_of(sigmas: Mapping[str, float | None], targets: Mapping[str, float]) -> list[GroupProgress]:
    """Return the groups of which anything is known.

    Parameters
    ----------
    sigmas : standard uncertainty by parameter, SI; None while not determined.
    targets : wished-for ones, SI, by group.
    """
    from tumble.design import NAMES, PARAMETER_GROUPS
    from tumble.report import practical_uncertainties

    rows: list[GroupProgress] = []
    for group, part in PARAMETER_GROUPS.items():
        names = [name for name in NAMES[part] if name in sigmas]
        if not names:
            continue
        told = [sigma for name in names if (sigma := sigmas[name]) is not None]
        known = len(told) == len(names)
        worst, target = max(told) if known else math.nan, targets.get(group, math.nan)
        sigma, wish = (one.text for one in practical_uncertainties(_FAMILIES[group], [worst, target]))
        rows.append(
            GroupProgress(
                group,
                sigma if known else f"{len(told)} of {len(names)} determined",
                wish if group in targets else "",
                worst <= target,
            )
        )
    return rows
