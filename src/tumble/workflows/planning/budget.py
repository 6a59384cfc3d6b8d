"""Planning a strapdown rotation test: which error contributes what, and whether the fixture suffices."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.earth import Site
from tumble.errors import OutputError, UsageError
from tumble.records import dataclass
from tumble.units import ARCSECOND, DEGREE_PER_ROOT_HOUR, MICRO_G
from tumble.workflows.planning.plan import document_text, planned_grade, planned_place
from tumble.workflows.progress import silent

if TYPE_CHECKING:
    from tumble.design.error_budget import ErrorBudget
    from tumble.design.strapdown_setup import SensorQuality, StrapdownSetup

# Units of data sheets in SI.
# A density in µg/√Hz is one-sided: the random walk is it over √2.
MOST_RUNS = 100_000


@dataclass(frozen=True, slots=True)
class BudgetOrder:
    """What a budget is asked of: a unit, a fixture, a place and a timing.

    Attributes
    ----------
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
    """

    imu: str = "consumer-mems"
    gyro_walk_deg_per_root_hour: float | None = None
    gyro_pulse_arcsec: float | None = None
    accelerometer_noise_ug: float | None = None
    fixture: float = 1e-3
    heading: float | None = None
    execution: float | None = None
    site: Site | None = None
    hold: float = 10.0
    turn_rate: float = 1.0
    pause: float = 1.0
    azimuth: float = 0.5 * math.pi
    play_backs: int = 2
    method: str = "least-squares"
    start_bias: bool = True
    norm: bool = True
    asymmetry: bool = True
    monte_carlo: int = 0
    seed: int = 0

    def setup(self, place: Site, quality: SensorQuality) -> StrapdownSetup:
        """Return it for the design.

        Parameters
        ----------
        place, quality : of the test and of the unit.

        Raises
        ------
        UsageError
            If a number is none that a test has.
        """
        from tumble.design.strapdown_setup import FixtureQuality, StrapdownSetup, Timing

        return StrapdownSetup(
            quality,
            FixtureQuality(
                mounting=self.fixture,
                installation=self.fixture,
                heading=self.fixture if self.heading is None else self.heading,
                execution=self.fixture if self.execution is None else self.execution,
            ),
            Timing(self.hold, self.turn_rate, self.pause),
            place,
            self.azimuth,
            self.method,
            self.play_backs,
            self.start_bias,
            self.norm,
            self.asymmetry,
        )


@dataclass(frozen=True, slots=True)
class BudgetPlanned:
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


def plan_budget(
    order: BudgetOrder,
    *,
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] = silent,
) -> BudgetPlanned:
    """Reckon what a strapdown rotation test will be worth with a unit, a fixture, a place and a timing.

    Parameters
    ----------
    order : what is asked.
    output : file for everything as JSON.
    progress : called with a sentence on what is being done.

    Raises
    ------
    UsageError
        If a number is none that a test has, or there is no such grade.
    OutputError
        If the file cannot be written; an earlier one is intact.
    """
    if not 0 <= order.monte_carlo <= MOST_RUNS or order.monte_carlo == 1:
        raise UsageError(
            f"--monte-carlo {order.monte_carlo}: give 0 for none, or 2 to {MOST_RUNS} tests to draw."
        )
    if not math.isfinite(order.azimuth):
        raise UsageError("--azimuth-deg: give degrees from north by east.")
    target = None if output is None else _target(output)
    from tumble.design.strapdown_accuracy import analyse_strapdown_rotation
    from tumble.design.strapdown_advice import advise, judge_fixture

    place, remarks = planned_place(order.site, "(--site).")
    quality, more = _quality(order)
    setup = order.setup(place, quality)
    progress("analysing")
    budget = analyse_strapdown_rotation(setup)
    if order.monte_carlo:
        progress(f"drawing {order.monte_carlo} tests")
        budget = _drawn(budget, setup, order)
        remarks += [
            f"Analysis and drawn tests differ in {name} by more than chance: believe the drawn ones."
            for name in budget.disagreements()
        ]
    progress("looking for what would help")
    verdict, advice = judge_fixture(setup, budget), advise(setup, budget)
    remarks = [*remarks, *more, *budget.remarks]
    done = BudgetPlanned(budget, verdict.suffices, verdict.words, tuple(advice), tuple(remarks), target)
    if target is not None:
        from tumble.files import write_text

        write_text(target, document_text(document_of_budget(done)))
    return done


def _drawn(budget: ErrorBudget, setup: StrapdownSetup, order: BudgetOrder) -> ErrorBudget:
    """The budget with tests that were drawn beside it."""
    import numpy as np

    from tumble.design.strapdown_accuracy import simulate_test_errors

    errors = simulate_test_errors(setup, order.monte_carlo, np.random.default_rng(order.seed))
    how = (
        "units, fixtures and sessions drawn; sensor errors and fixture played exactly, noise, biases and the Earth "
        "rate added by their first-order effect"
    )
    return budget.with_drawn(errors, how)


def document_of_budget(done: BudgetPlanned) -> dict[str, Any]:
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


def _quality(order: BudgetOrder) -> tuple[SensorQuality, list[str]]:
    """The unit's quality, and what of it no data sheet states."""
    from tumble.design.strapdown_setup import SensorQuality

    walk, pulse = order.gyro_walk_deg_per_root_hour, order.gyro_pulse_arcsec
    noise = order.accelerometer_noise_ug
    for name, value in (
        ("gyro-walk-deg-per-root-hour", walk),
        ("gyro-pulse-arcsec", pulse),
        ("accelerometer-noise-ug", noise),
    ):
        if value is not None and not 0.0 <= value < 1e6:
            raise UsageError(f"--{name} {value:g}: give zero or a positive number.")
    grade, assumed = planned_grade(order.imu)
    quality = SensorQuality.from_grade(grade, gyro_pulse=ARCSECOND * (pulse or 0.0))
    if walk is not None:
        quality = replace(quality, gyro_walk=DEGREE_PER_ROOT_HOUR * walk)
    if noise is not None:
        quality = replace(quality, force_walk=MICRO_G / math.sqrt(2.0) * noise)
    return quality, assumed


def _target(output: str | os.PathLike[str]) -> Path:
    target = Path(output)
    if target.is_dir():
        raise OutputError(f"{target} is a folder: give a file for -o, for example {target / 'budget.json'}.")
    return target
