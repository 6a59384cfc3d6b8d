"""`tumble calibrate --turn-ons`: several recordings of one unit, each made after it was switched on anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.earth import Site
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.workflows.calibrate import CalibrationRun


def calibrate_each_turn_on(
    recordings: Sequence[Path],
    *,
    output: Path | None,
    procedure: str | None,
    alien: dict[str, object],
    protocol: str | None,
    site: Site | None,
    columns: str | None,
    units: str | None,
    rate: float | None,
    topics: Sequence[str] | None,
    optional_terms: bool,
    imu: tuple[str | None, str | None],
    progress: Callable[[str], None],
) -> CalibrationRun:
    """Calibrate one unit from several recordings.

    Parameters
    ----------
    recordings, output, protocol, site, columns, units, rate, topics, optional_terms, imu, progress : as typed.
    procedure : that was asked for; None or joint.
    alien : name of each option that does not go with it -> what was given, None for nothing.

    Raises
    ------
    UsageError
        If an option does not go with several turn-ons.
    """
    from tumble.workflows.turn_ons import calibrate_turn_ons

    if procedure not in (None, "joint"):
        raise UsageError(
            f"--turn-ons is the joint estimator's, and --procedure {procedure} was asked for: leave one of them out."
        )
    for name, given in alien.items():
        if given is not None:
            raise UsageError(f"{name} does not go with --turn-ons: leave one of them out.")
    return calibrate_turn_ons(
        recordings,
        output=output,
        protocol=protocol,
        site=site,
        columns=columns,
        units=units,
        rate=rate,
        topics=topics,
        optional_terms=optional_terms,
        imu=imu,
        progress=progress,
    )


__all__ = ["calibrate_each_turn_on"]
