"""`tumble calibrate` of several recordings, turn-ons of one unit or units of an array: what does not go with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.earth import Site


class Several(TypedDict):
    """Options that both ways share, as typed."""

    recordings: Sequence[Path]
    site: Site | None
    columns: str | None
    units: str | None
    rate: float | None
    topics: Sequence[str] | None
    optional_terms: bool


def refuse_what_is_of_one(way: str, procedure: str | None, of_one: Mapping[str, object]) -> None:
    """Refuse options that belong to a single recording of a single unit.

    Parameters
    ----------
    way : ``--turn-ons`` or ``--array``.
    procedure : that was asked for; None or joint.
    of_one : name of each such option -> what was given, None for nothing.

    Raises
    ------
    UsageError
        If one was given.
    """
    if procedure not in (None, "joint"):
        raise UsageError(
            f"{way} is the joint estimator's, and --procedure {procedure} was asked for: leave one of them out."
        )
    for name, given in of_one.items():
        if given is not None:
            raise UsageError(f"{name} does not go with {way}: leave one of them out.")


def one_prior(given: Sequence[Path] | None) -> Path | None:
    """Return the one earlier calibration that a single unit may have.

    Parameters
    ----------
    given : as typed.

    Raises
    ------
    UsageError
        If there are more.
    """
    if given and len(given) > 1:
        raise UsageError(
            f"--prior was given {len(given)} times, and a unit has one earlier calibration: give the best one, or "
            "--array if each recording is another unit's."
        )
    return given[0] if given else None


__all__ = ["Several", "one_prior", "refuse_what_is_of_one"]
