"""Estimators that a paper has and this package does not: asked for by name, they stand beside the joint adjustment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from tumble.errors import UsageError
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.session import Session

GROUP = "tumble.estimators"
"""The group of entry points: each names a mapping from an estimator's name to its record."""


@dataclass(frozen=True, slots=True)
class Estimator:
    """A paper's own way from a recording to an estimate.

    Attributes
    ----------
    name : as ``--estimator`` takes it.
    title : what it does, in words.
    source : paper and equations.
    estimate : of a recording with what was done, as the paper has it and with the covariance that it gives.
    """

    name: str
    title: str
    source: str
    estimate: Callable[[Session], Estimate]


@cache
def all_estimators() -> Mapping[str, Estimator]:
    """Return every estimator that an installed package offers, by name."""
    return {name: one for point in entry_points(group=GROUP) for name, one in sorted(point.load().items())}


def find_estimator(name: str) -> Estimator:
    """Return the estimator of a name.

    Parameters
    ----------
    name : as ``--estimator`` takes it.

    Raises
    ------
    UsageError
        If there is none.
    """
    offered = all_estimators()
    if name not in offered:
        names = ", ".join(offered) or "none; the package tumble_papers has those of the papers"
        raise UsageError(f"There is no estimator {name!r}. There are: {names}.")
    return offered[name]
