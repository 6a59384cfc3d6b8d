"""How accurate a test will be, before it is done: the error budget of a procedure."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.earth import Site
from tumble.errors import OutputError, UsageError
from tumble.workflows.pose_plan import PROCEDURES as POSE_PROCEDURES

if TYPE_CHECKING:
    from tumble.design.error_budget import ErrorBudget
    from tumble.design.strapdown_setup import SensorQuality

PROCEDURES = ("strapdown-rotation",)
"""Procedures that have an error budget."""

# Units of data sheets in SI.
_DEGREE = math.pi / 180.0
_PER_ROOT_HOUR = _DEGREE / 60.0
_ARCSECOND = _DEGREE / 3600.0
# A density in µg/√Hz is one-sided: the random walk is it over √2.
_MICRO_G = 9.80665e-6
MOST_RUNS = 100_000
_DEFAULT_LATITUDE_DEG = 45.0


@dataclass(frozen=True, slots=True)
class Plan:
    """A planned test.

    Attributes
    ----------
    budget : its error budget.
    suffices : whether the fixture does.
    verdict, advice : sentences.
    remarks : what was assumed, in sentences.
    file : where it was written, or None.
    """

    budget: ErrorBudget
    suffices: bool
    verdict: tuple[str, ...]
    advice: tuple[str, ...]
    remarks: tuple[str, ...]
    file: Path | None


def plan(
    procedure: str,
    *,
    imu: str = "consumer-mems",
    gyro_walk_deg_per_root_hour: float | None = None,
    gyro_pulse_arcsec: float | None = None,
    accelerometer_noise_ug: float | None = None,
    fixture: float = 1e-3,
    heading: float | None = None,
    execution: float | None = None,
    site: Site | None = None,
    hold: float = 10.0,
    turn_rate: float = 1.0,
    pause: float = 1.0,
    azimuth: float = 0.5 * math.pi,
    play_backs: int = 2,
    method: str = "least-squares",
    start_bias: bool = True,
    norm: bool = True,
    asymmetry: bool = True,
    monte_carlo: int = 0,
    seed: int = 0,
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Reckon what a test will be worth with a unit, a fixture, a place and a timing.

    Parameters
    ----------
    procedure : one of `PROCEDURES`.
    imu : grade of the unit; the three numbers after it stand for those of another data sheet.
    gyro_walk_deg_per_root_hour, gyro_pulse_arcsec, accelerometer_noise_ug : °/√h, arc-seconds, µg/√Hz.
    fixture : rad, one sigma of mounting and installation.
    heading, execution : rad, of the outer axis against north, and of each stop; as `fixture` by default.
    site : with a latitude; 45° by default.
    hold, turn_rate, pause : s of each average, rad/s of rotations, s between them.
    azimuth : rad, where the outer axis points.
    play_backs, method, start_bias, norm, asymmetry : see `StrapdownSetup`.
    monte_carlo : tests to draw beside the analysis; zero for none.
    seed : of the draws.
    output : file for everything as JSON.
    progress : is told what is being done.

    Raises
    ------
    UsageError
        If a number is none that a test has, or there is no such procedure or grade.
    OutputError
        If the file cannot be written; an earlier one is intact.
    """
    say = progress or _silent
    if procedure not in PROCEDURES:
        raise UsageError(
            f"There is no plan of {procedure!r} yet; choose one of {', '.join((*POSE_PROCEDURES, *PROCEDURES))}."
        )
    if not 0 <= monte_carlo <= MOST_RUNS or monte_carlo == 1:
        raise UsageError(f"--monte-carlo {monte_carlo}: give 0 for none, or 2 to {MOST_RUNS} tests to draw.")
    if not math.isfinite(azimuth):
        raise UsageError("--azimuth-deg: give degrees from north by east.")
    target = None if output is None else _target(output)
    from tumble.design.strapdown_accuracy import analyse_strapdown_rotation, simulate_test_errors
    from tumble.design.strapdown_advice import advise, judge_fixture
    from tumble.design.strapdown_setup import FixtureQuality, StrapdownSetup, Timing

    place, remarks = _place(site)
    quality, more = _quality(imu, gyro_walk_deg_per_root_hour, gyro_pulse_arcsec, accelerometer_noise_ug)
    setup = StrapdownSetup(
        quality,
        FixtureQuality(
            mounting=fixture,
            installation=fixture,
            heading=fixture if heading is None else heading,
            execution=fixture if execution is None else execution,
        ),
        Timing(hold, turn_rate, pause),
        place,
        azimuth,
        method,
        play_backs,
        start_bias,
        norm,
        asymmetry,
    )
    say("analysing")
    budget = analyse_strapdown_rotation(setup)
    if monte_carlo:
        import numpy as np

        say(f"drawing {monte_carlo} tests")
        errors = simulate_test_errors(setup, monte_carlo, np.random.default_rng(seed))
        how = (
            "units, fixtures and sessions drawn; sensor errors and fixture played exactly, noise, biases and the Earth "
            "rate added by their first-order effect"
        )
        budget = budget.with_drawn(errors, how)
        remarks += [
            f"Analysis and drawn tests differ in {name} by more than chance: believe the drawn ones."
            for name in budget.disagreements()
        ]
    say("looking for what would help")
    verdict, advice = judge_fixture(setup, budget), advise(setup, budget)
    remarks = [*remarks, *more, *budget.remarks]
    done = Plan(budget, verdict.suffices, verdict.words, tuple(advice), tuple(remarks), target)
    if target is not None:
        from tumble.files import write_text

        text = json.dumps(document_of_budget(done), indent=1, ensure_ascii=False, allow_nan=False)
        write_text(target, f"{text}\n")
    return done


def document_of_budget(done: Plan) -> dict[str, Any]:
    """Return everything about a planned test, as JSON has it.

    Parameters
    ----------
    done : what was planned.
    """
    return {
        **done.budget.to_dict(),
        "fixture_suffices": done.suffices,
        "verdict": list(done.verdict),
        "advice": list(done.advice),
        "remarks": list(done.remarks),
    }


def _place(site: Site | None) -> tuple[Site, list[str]]:
    if site is not None:
        return site, []
    remark = f"No site was given: latitude {_DEFAULT_LATITUDE_DEG:g}° at height 0 (--site)."
    return Site.from_latitude(math.radians(_DEFAULT_LATITUDE_DEG)), [remark]


def _quality(
    imu: str, walk: float | None, pulse: float | None, noise: float | None
) -> tuple[SensorQuality, list[str]]:
    """The unit's quality, and what of it no data sheet states."""
    from tumble.design.strapdown_setup import SensorQuality
    from tumble.simulation.grades import find_grade

    for name, value in (
        ("gyro-walk-deg-per-root-hour", walk),
        ("gyro-pulse-arcsec", pulse),
        ("accelerometer-noise-ug", noise),
    ):
        if value is not None and not 0.0 <= value < 1e6:
            raise UsageError(f"--{name} {value:g}: give zero or a positive number.")
    grade = find_grade(imu)
    quality = SensorQuality.from_grade(grade, gyro_pulse=_ARCSECOND * (pulse or 0.0))
    if walk is not None:
        quality = replace(quality, gyro_walk=_PER_ROOT_HOUR * walk)
    if noise is not None:
        quality = replace(quality, force_walk=_MICRO_G / math.sqrt(2.0) * noise)
    assumed = [f"Of {grade.name} no source states: {'; '.join(grade.assumed)}."] if grade.assumed else []
    return quality, assumed


def _target(output: str | os.PathLike[str]) -> Path:
    target = Path(output)
    if target.is_dir():
        raise OutputError(f"{target} is a folder: give a file for -o, for example {target / 'budget.json'}.")
    return target


def _silent(_: str) -> None:
    """Tell nobody."""
