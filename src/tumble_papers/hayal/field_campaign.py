"""Many simulated field campaigns: each unit calibrated in every way of chapter 5, its cart navigated with each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.counting import counted
from tumble_papers.hayal.field_calibration import (
    FieldUnit,
    TriadResult,
    average_poses,
    calibrate_triad,
    draw_unit,
    record_poses,
)
from tumble_papers.hayal.field_navigation import (
    CartDrive,
    calibrated,
    mean_error,
    outage_errors,
    position_sigma,
    record_cart,
)
from tumble_papers.hayal.scenarios import IMUS, MINUTES, SCENARIOS

GAPS, SLIDING = "gaps", "sliding"
OUTAGES = (2.0, 10.0, 30.0, 60.0)


@dataclass(frozen=True, slots=True)
class Case:
    """A way to start the filter.

    Attributes
    ----------
    scenario : of the poses; 0 for none, that is no calibration.
    minutes : of each pose.
    gyro : parameters of the gyros that are told: 0, 3 or 9. The accelerometers' are nine, but in scenario 0.
    scaled : whether the sigmas are scaled by sigma0, as the thesis does.
    """

    scenario: int = 0
    minutes: int = 3
    gyro: int = 0
    scaled: bool = True


ORIGINAL = Case()
EVERY_SCENARIO = (
    ORIGINAL,
    *(Case(scenario, minutes, gyro) for scenario in SCENARIOS for gyro in (3, 9) for minutes in MINUTES),
)
"""Of tables 5.5 and 5.6."""
SUB_SCENARIOS = {
    "original": ORIGINAL,
    "3.0": Case(3, 3, 0),
    "3.3": Case(3, 3, 3),
    "3.9": Case(3, 3, 9),
}
"""Of table 5.7, by their names there."""
UNSCALED = Case(3, 3, 9, scaled=False)


@dataclass(slots=True)
class Positions:
    """Position errors of many campaigns with one case.

    Attributes
    ----------
    sigmas, means : protocol -> (campaigns, lengths) m: (5.3), and the length of the mean error; NaN where there is
        none.
    unsolved : campaigns in which the adjustment did not settle.
    lost : campaigns in which the filter was lost for good.
    """

    sigmas: dict[str, AnyArray] = field(default_factory=dict[str, AnyArray])
    means: dict[str, AnyArray] = field(default_factory=dict[str, AnyArray])
    unsolved: int = 0
    lost: int = 0


Found = Mapping[Case, Positions]


@lru_cache(maxsize=8)
def run_campaigns(
    imu: str,
    cases: tuple[Case, ...],
    durations: tuple[float, ...],
    protocols: tuple[str, ...],
    campaigns: int,
    seed: int,
    *,
    wandering: bool = False,
) -> Found:
    """Return the position errors of many units; those of the last calls are kept.

    Parameters
    ----------
    imu : of `IMUS`.
    cases : ways to start the filter.
    durations : s, of the outages.
    protocols : `GAPS` for repeated outages with one fix between, `SLIDING` for each by itself.
    campaigns : how many units; the first of many are those of few.
    seed : of all random numbers.
    wandering : whether biases walk.
    """
    found = {case: Positions() for case in cases}
    shape = (campaigns, len(durations))
    for positions in found.values():
        for protocol in protocols:
            positions.sigmas[protocol] = np.full(shape, np.nan)
            positions.means[protocol] = np.full(shape, np.nan)
    for campaign in counted(range(campaigns), campaigns):
        rng = np.random.default_rng([seed, IMUS.index(imu), campaign])
        unit = draw_unit(imu, rng, wandering=wandering)
        results, wander = _calibrations(unit, cases, rng)
        drive = record_cart(unit, wander, rng)
        for case, positions in found.items():
            _add(positions, campaign, drive, case, results, durations)
    return found


Results = dict[tuple[int, int, str, int], TriadResult | None]


def _calibrations(
    unit: FieldUnit, cases: Sequence[Case], rng: np.random.Generator
) -> tuple[Results, AnyArray]:
    """Record the poses and adjust what the cases ask for."""
    recording, wander = record_poses(unit, rng)
    wanted = {
        (case.scenario, case.minutes, triad, unknowns)
        for case in cases
        if case.scenario
        for triad, unknowns in (("accelerometer", 9), ("gyro", case.gyro))
        if unknowns
    }
    means = average_poses(recording, tuple(sorted({minutes for _, minutes, *_ in wanted})))
    return {key: calibrate_triad(means[key[1]], SCENARIOS[key[0]], key[2], key[3]) for key in wanted}, wander


def _add(
    positions: Positions,
    campaign: int,
    drive: CartDrive,
    case: Case,
    results: Results,
    durations: tuple[float, ...],
) -> None:
    force, rate = (
        results[case.scenario, case.minutes, triad, unknowns] if case.scenario and unknowns else None
        for triad, unknowns in (("accelerometer", 9), ("gyro", case.gyro))
    )
    if case.scenario and (force is None or (case.gyro and rate is None)):
        positions.unsolved += 1
        return
    told = calibrated(drive.grade, force, rate, scaled=case.scaled)
    for protocol, sigmas in positions.sigmas.items():
        errors = outage_errors(drive, told, durations, gaps=protocol == GAPS)
        if errors is None:
            positions.lost += 1
            return
        sigmas[campaign] = [position_sigma(e) for e in errors]
        positions.means[protocol][campaign] = [mean_error(e) for e in errors]


def pooled(values: AnyArray) -> Series:
    """Return (lengths,) the root of the mean square over the campaigns that have one, NaN where none has.

    Parameters
    ----------
    values : (campaigns, lengths).
    """
    there = np.isfinite(values)
    count = np.maximum(there.sum(axis=0), 1)
    mean: AnyArray = np.sum(np.where(there, values, 0.0) ** 2, axis=0) / count
    return np.asarray(np.where(there.any(axis=0), np.sqrt(mean), np.nan))


def improvements(before: AnyArray, after: AnyArray) -> tuple[Series, AnyArray]:
    """Return (lengths,) how much better in percent, pooled over the campaigns that have both, and (campaigns, lengths).

    Parameters
    ----------
    before, after : (campaigns, lengths) m.
    """
    both = np.isfinite(before) & np.isfinite(after)
    ratio = pooled(np.where(both, after, np.nan)) / pooled(np.where(both, before, np.nan))
    return np.asarray(100.0 * (1.0 - ratio)), np.asarray(100.0 * (1.0 - after / before))


__all__ = [
    "EVERY_SCENARIO",
    "GAPS",
    "ORIGINAL",
    "OUTAGES",
    "SLIDING",
    "SUB_SCENARIOS",
    "UNSCALED",
    "Case",
    "Positions",
    "improvements",
    "pooled",
    "run_campaigns",
]
