"""What an error budget of the strapdown rotation test means: whether the fixture suffices, and what would help."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tumble.arrays import Series
from tumble.design.error_budget import ErrorBudget
from tumble.design.strapdown_accuracy import analyse_strapdown_rotation
from tumble.design.strapdown_setup import StrapdownSetup
from tumble.records import dataclass

# A fixture suffices that makes no uncertainty more than a tenth larger, and counts for little up to a half.
SUFFICIENT = 1.1
BEARABLE = 1.5
# A change is worth telling that makes the uncertainty of a group at least so many times smaller.
WORTHWHILE = 1.15
# Known from a survey: a gravimeter's network is good to a few hundredths of a milligal, a map to one.
SURVEYED = 1e-5  # m/s²
# No user sets up a fixture worse than that, rad.
_FARTHEST = 0.035
_FIXTURE_KINDS = ("fixture",)
_OWN_KINDS = ("sensors", "method")


@dataclass(frozen=True, slots=True)
class FixtureVerdict:
    """Whether a fixture suffices.

    Attributes
    ----------
    suffices : it makes no group's uncertainty larger by more than a tenth.
    growth : (groups,) uncertainty with this fixture against that with a perfect one; gravity is left out.
    largest_factor : a fixture so many times worse would just suffice; below 1 if this one does not.
    words : the verdict in sentences.
    """

    suffices: bool
    growth: Series
    largest_factor: float
    words: tuple[str, ...]


def judge_fixture(setup: StrapdownSetup, budget: ErrorBudget) -> FixtureVerdict:
    """Return whether the fixture of a planned test suffices, against a perfect one with the same unit.

    Parameters
    ----------
    setup : the test.
    budget : of `analyse_strapdown_rotation`.
    """
    own = budget.group_rms(_OWN_KINDS)
    fixture = budget.group_rms(_FIXTURE_KINDS)
    growth = np.ones(own.shape)
    growth[own > 0.0] = np.hypot(own, fixture)[own > 0.0] / own[own > 0.0]
    growth[(own == 0.0) & (fixture > 0.0)] = np.inf
    worst = int(np.argmax(growth))
    # Contributions of the first order grow with the angle; the squared one faster, which makes this an upper bound.
    share = max(float(fixture[worst]), 1e-300) / max(float(own[worst]), 1e-300)
    factor = math.sqrt(SUFFICIENT**2 - 1.0) / share
    suffices = bool(growth[worst] <= SUFFICIENT)
    return FixtureVerdict(
        suffices, growth, factor, tuple(_fixture_words(setup, budget, float(growth[worst]), worst, factor))
    )


def _fixture_words(
    setup: StrapdownSetup, budget: ErrorBudget, growth: float, worst: int, factor: float
) -> Iterator[str]:
    angle = max(setup.fixture.mounting, setup.fixture.installation)
    called = f"A fixture good to {_angle(angle)}, with north known to {_angle(setup.fixture.heading)},"
    group = budget.groups[worst]
    if growth <= SUFFICIENT:
        percent = 100.0 * (1.0 - 1.0 / growth)
        smaller = f"at most {percent:.0f} % smaller ({group.words} gain most)"
        same = "the same within 1 %"
        yield (
            f"{called} suffices: with a perfect one the uncertainties would be "
            f"{same if percent < 1.0 else smaller}."
        )
    elif growth <= BEARABLE:
        yield (
            f"{called} serves, but is felt: with a perfect one the {group.words} would be known "
            f"{_times(growth)} better."
        )
    else:
        yield (
            f"{called} does not suffice for this unit: with a perfect one the {group.words} would be known "
            f"{_times(growth)} better."
        )
    if growth <= SUFFICIENT and factor > 1.2 and angle > 0.0:
        within = min(factor * angle, _FARTHEST)
        more = " and more" if within == _FARTHEST else ""
        yield f"It may be off by about {_angle(float(f'{within:.2g}'))}{more} in everything before it is felt."
    elif growth > SUFFICIENT:
        sources = [(s, share) for s, share in budget.main_sources(worst) if s.kind == "fixture"]
        what = f" (what counts is {sources[0][0].name}: {sources[0][0].words})" if sources else ""
        yield f"It would have to be {_times(1.0 / factor)} better not to be felt{what}."


def advise(setup: StrapdownSetup, budget: ErrorBudget) -> list[str]:
    """Return what dominates each group of parameters, and what would help most, in sentences.

    Parameters
    ----------
    setup : the test.
    budget : of `analyse_strapdown_rotation`.
    """
    return [*_dominating(budget), *_helping(setup, budget)]


def _dominating(budget: ErrorBudget) -> Iterator[str]:
    """One sentence for all groups with the same main source."""
    by_source: dict[str, list[str]] = {}
    for number, group in enumerate(budget.groups):
        main = budget.main_sources(number)
        if main:
            by_source.setdefault(main[0][0].name, []).append(f"{group.short} {100.0 * main[0][1]:.0f} %")
    words = {source.name: source.words for source in budget.sources}
    for name, groups in by_source.items():
        yield f"Of the variance most comes from {name} ({words[name]}): {', '.join(groups)}."


def _helping(setup: StrapdownSetup, budget: ErrorBudget) -> Iterator[str]:
    before = budget.group_rms()
    found: list[tuple[float, str]] = []
    for words, changed in _changes(setup):
        after = analyse_strapdown_rotation(changed).group_rms()
        gain = np.divide(before, np.where(after > 0.0, after, 1.0))
        best = int(np.argmax(gain))
        if gain[best] < WORTHWHILE:
            continue
        group = budget.groups[best]
        numbers = (
            f"{_two(before[best] * group.factor)} to {_two(after[best] * group.factor)} {group.practical}"
        )
        # Not if it makes another group worse.
        if np.all(gain > 1.0 / WORTHWHILE):
            found.append((float(gain[best]), f"{words}: {group.words} from {numbers}."))
    found.sort(key=lambda one: -one[0])
    if not found:
        yield "Nothing simple would make it much better: the unit's own noise is what is left."
        return
    for _, words in found[:3]:
        yield f"What would help: {words}"


def _changes(setup: StrapdownSetup) -> Iterator[tuple[str, StrapdownSetup]]:
    timing, fixture = setup.timing, setup.fixture
    if setup.site.gravity_sigma > SURVEYED:
        yield (
            "gravity from a survey (--gravity), instead of the latitude",
            replace(setup, site=replace(setup.site, gravity_sigma=SURVEYED)),
        )
    if timing.seconds <= 900.0:
        longer = replace(timing, seconds=4.0 * timing.seconds)
        yield (
            f"averages of {longer.seconds:g} s instead of {timing.seconds:g} s",
            replace(setup, timing=longer),
        )
        shorter = replace(timing, seconds=max(0.5 * timing.seconds, 0.1))
        yield (
            f"averages of {shorter.seconds:g} s instead of {timing.seconds:g} s",
            replace(setup, timing=shorter),
        )
    if timing.rate < 3.0:
        yield (
            f"rotations at {math.degrees(3.0 * timing.rate):.0f} °/s instead of {math.degrees(timing.rate):.0f}",
            replace(setup, timing=replace(timing, rate=3.0 * timing.rate)),
        )
    if fixture.heading > 0.0:
        yield (
            f"north known to {_angle(0.1 * fixture.heading)}",
            replace(setup, fixture=replace(fixture, heading=0.1 * fixture.heading)),
        )
    if setup.iterations == 0:
        yield "playing the recording back once", replace(setup, iterations=1)
    if not setup.norm:
        yield "the vertical from the length of the acceleration (--norm)", replace(setup, norm=True)
    if setup.method == "formulas":
        yield (
            "all components by least squares instead of the formulas",
            replace(setup, method="least-squares"),
        )
    if not setup.start_bias:
        yield (
            "the gyros' bias from the rest before each sequence (--start-bias)",
            replace(setup, start_bias=True),
        )


def _angle(angle: float) -> str:
    return f"{_two(math.degrees(angle))}° ({1e3 * angle:.3g} mrad)"


def _two(value: float) -> str:
    """Two digits, without an exponent."""
    if value == 0.0:
        return "0"
    digits = max(0, 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 6)}f}"


def _times(ratio: float) -> str:
    return f"{ratio:.1f} times" if math.isfinite(ratio) else "any number of times"
