"""Chapter 5 of Hayal (2010), the calibrations: 26, 18, first 10 and last 10 attitudes of 1, 3 and 5 minutes.

The thesis' recordings are not public. Simulated units of the same data sheet stand for them: errors
drawn from the sheet's spreads, white noise of table 3.1 at one sample a second, and biases that wander
by flicker. How much they wander decides every stated sigma (by sigma0), and the sheet says only what
they do not exceed over temperature and life: each simulated unit draws a share of it.

The unit is held in each attitude for five minutes with half a minute between, as in section 5.2; the
first 1, 3 and 5 minutes of each hold are averaged. Hold means are the means of these samples: a search
for the holds would find the same stretches.

Could the printed numbers of a field calibration be one of ours? The rules, and the words for them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series, Table, Vectors
from tumble.attitude import twenty_six_directions
from tumble.counting import counted
from tumble.estimation import find_weak_directions
from tumble.reproduction import INSIDE, OUTSIDE, UNJUDGED, Row, Value
from tumble.sensor import matrix_from_shin
from tumble.simulation import TriadGrade, TriadNoise, find_grade, simulate_noise
from tumble_papers.hayal.norm_batch import (
    ATTITUDES,
    FORCE_NOISE,
    RATE_NOISE,
    RATE_NOISE_HG1900,
    NormBatch,
    Setting,
    adjust_norms,
    simulate_true,
)
from tumble_papers.study import Found, Study, hayal

# With one unit alone there is no range: two sigma0 of so many degrees of freedom differ by less than their
# F-distribution allows in 99 % of cases, and a unit's wander lies within a factor of five of the middle one.
ONE_RUN, ONE_RUN_SHARE = 5.0, 0.995
# An estimate so many times farther from zero than sheet and sigma together allow wants a word.
FAR = 3.0
# It is implausible if fewer of our units than this share are as far off.
RARE = 0.005


def one_run_factor(freedom: int) -> float:
    """Return the factor within which the sigmas of two runs are alike.

    Parameters
    ----------
    freedom : degrees of freedom of each.
    """
    from scipy.special import fdtri

    return ONE_RUN * float(np.sqrt(fdtri(freedom, freedom, ONE_RUN_SHARE)))


def criterion(units: int, freedom: int) -> str:
    """Return what a verdict means, in a sentence.

    Parameters
    ----------
    units : how many were simulated.
    freedom : degrees of freedom of each adjustment.
    """
    if units > 1:
        return (
            f"inside: the thesis' sigma lies between the lowest and the highest that {units} "
            f"simulated units state. Its estimate is within {FAR:g} times sheet and sigma together of "
            f"zero, or at least {100 * RARE:g} % of ours are as far off"
        )
    degrees = "degree" if freedom == 1 else "degrees"
    factor = float(f"{one_run_factor(freedom):.2g}")
    return (
        f"inside: the thesis' sigma is within a factor of {factor:g} of what one simulated unit "
        f"states. Two runs with {freedom} {degrees} of freedom may differ as much (--repetitions 500 "
        "gives the range itself)"
    )


def judge_sigma(printed: float, sigma: Series, cofactor: float, freedom: int) -> tuple[bool, str]:
    """Judge a printed sigma; return whether it could be one of ours, and why not.

    Parameters
    ----------
    printed : what the thesis states.
    sigma : what our units state, in the same unit.
    cofactor : the same at a sigma0 of one, typically.
    freedom : degrees of freedom.
    """
    ratio = printed / float(np.median(sigma))
    factor = one_run_factor(freedom) if sigma.size == 1 else 0.0
    if 1.0 / factor <= ratio <= factor if factor else sigma.min() <= printed <= sigma.max():
        return True, ""
    return False, (
        f"its sigma is {ratio:.2g} times the median of ours, of a sigma0, not printed, of about "
        f"{printed / cofactor:.2g}: {_why(ratio, printed / cofactor)}"
    )


def _why(ratio: float, sigma0: float) -> str:
    if ratio > 1.0:
        return "biases wandered more between its attitudes than in ours, or its attitudes differed from ours"
    if sigma0 > 1.0:
        return "biases wandered less between its attitudes than in ours, or its attitudes differed from ours"
    return "its unit was quieter than the sheet's maximum, sigma0 small by luck, or its attitudes differed from ours"


def judge_estimate(far: float, as_far: float, units: int) -> tuple[bool, str]:
    """Judge a printed estimate; return whether it is plausible, and a word where it is far from zero.

    Parameters
    ----------
    far : how many times the sheet's and its own sigma together it is from zero.
    as_far : the share of our units that are as far off.
    units : how many there are.
    """
    if far <= FAR:
        return True, ""
    words = f"its estimate is {far:.2g} times sheet and sigma together from zero"
    if units > 1:
        words += f"; so far off are {100 * as_far:.2g} % of ours"
    # Fewer units than twice its reciprocal cannot tell that something is so rare.
    return units * RARE < 2.0 or as_far >= RARE, words


MINUTES = (1, 3, 5)
HOLD, PAUSE = 300, 30  # s, samples of one second
# The thesis' order of attitudes: faces, edges, corners; scenario -> which of the 26.
SCENARIOS = {1: slice(0, 26), 2: slice(0, 18), 3: slice(0, 10), 4: slice(16, 26)}
# Table -> (scenario, triad, unknowns).
TABLES: dict[str, tuple[int, str, int]] = {
    "5.2": (3, "gyro", 3), "5.3": (3, "gyro", 9), "5.4": (3, "accelerometer", 9),
    "A.1": (1, "gyro", 3), "A.2": (1, "gyro", 9), "A.3": (2, "gyro", 3),
    "A.4": (2, "gyro", 9), "A.5": (4, "gyro", 3), "A.6": (4, "gyro", 9),
    "B.1": (1, "accelerometer", 9), "B.2": (2, "accelerometer", 9), "B.3": (4, "accelerometer", 9),
}  # fmt: skip
IMUS = ("HG1700", "HG1900")
RATE_NOISES = {"HG1700": RATE_NOISE, "HG1900": RATE_NOISE_HG1900}
FACTORS = np.repeat([1.0, 1e6, 1e6], 3)
NAMES = ("b x", "b y", "b z", "s x", "s y", "s z", "θ yz", "θ zx", "θ zy")
# Of the sheet's in-run stability, a unit's flicker in one afternoon: from a fiftieth to a half (assumed).
WANDER = (0.02, 0.5)
# Angles beyond this cannot be a unit's whose sheet says 100 µrad.
ABSURD = 0.5


@dataclass(frozen=True)
class Means:
    """Hold means of many simulated units, for each averaging time.

    `means` is (minutes, runs, 26, 3) raw, `errors` (runs, 9) the truth: bias (of the first sample), scale
    factor errors, angles; `sheet` (9,) their standard deviations by the data sheet, `noise` a sample's
    standard deviation, `reference` the norm.
    """

    means: AnyArray
    errors: AnyArray
    sheet: Series
    noise: float
    reference: float


def sheet_sigmas(spread: TriadGrade) -> Series:
    """Return (9,) sigmas of bias, scale factors and non-orthogonalities by a data sheet.

    Parameters
    ----------
    spread : of a triad.
    """
    # The angle between two axes: each misalignment is about one direction.
    return np.repeat([spread.bias, spread.scale_factor, np.sqrt(2.0) * spread.misalignment], 3)


def simulate_field_means(imu: str, triad: str, runs: int, rng: np.random.Generator) -> Means:
    """Simulate the hold means of a field calibration of many units.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    triad : "gyro" or "accelerometer".
    runs : how many units.
    rng : source of all numbers.
    """
    grade = find_grade(imu.lower())
    spread = grade.accelerometer if triad == "accelerometer" else grade.gyroscope
    noise = FORCE_NOISE if triad == "accelerometer" else RATE_NOISES[imu]
    setting = Setting(triad, 9, noise=noise)
    true = simulate_true(setting, runs, rng)
    sheet = sheet_sigmas(spread)
    errors = np.concatenate([rng.normal(0.0, size, (runs, 3)) for size in sheet[::3]], axis=1)
    share = np.exp(rng.uniform(np.log(WANDER[0]), np.log(WANDER[1]), runs))
    means = np.empty((len(MINUTES), runs, ATTITUDES, 3))
    length = HOLD + PAUSE
    for run in counted(range(runs), runs):
        matrix = np.real(matrix_from_shin(1.0 + errors[run, 3:6], errors[run, 6:9]))
        steady = true[run] @ matrix.T + errors[run, :3]
        wander = TriadNoise(random_walk=noise, bias_instability=float(share[run]) * spread.bias_stability)
        samples = simulate_noise(wander, ATTITUDES * length, 1.0, rng).reshape(ATTITUDES, length, 3)
        for k, minutes in enumerate(MINUTES):
            means[k, run] = steady + samples[:, : 60 * minutes].mean(axis=1)
    return Means(means, errors, sheet, noise, setting.reference)


def _table(table: str, repetitions: int, seed: int) -> Found:
    """Make one of the tables anew on simulated units."""
    scenario, triad, unknowns = TABLES[table]
    freedom = len(range(ATTITUDES)[SCENARIOS[scenario]]) - unknowns
    rows: list[Row] = []
    notes: list[str] = []
    for number, imu in enumerate(IMUS):
        means = simulate_field_means(imu, triad, repetitions, np.random.default_rng([seed, number]))
        adjusted = [_adjusted(means, k, scenario, unknowns) for k in range(len(MINUTES))]
        entries = [entry for entry in hayal()["tables"][table]["rows"] if entry["imu"] == imu]
        for parameter, entry in enumerate(entries):
            for minutes, batch in zip(MINUTES, adjusted, strict=True):
                cells, verdict = _told(minutes, entry, parameter, batch, means, freedom)
                unit = entry["unit"].replace("^2", "²")
                rows.append(Row(entry["parameter"], unit, (imu, float(minutes), *cells), *verdict))
        notes += [_settled(imu, adjusted), _against_sheet(imu, means, scenario, unknowns)]
    unseen = _unseen(scenario, unknowns) if triad == "accelerometer" else ""
    notes += [unseen] if unseen else []
    if freedom == 1:
        notes.append(
            "Only one attitude more than unknowns: sigma0, and with it every sigma, scatters over decades from unit to "
            "unit. That the thesis' lie among them says little."
        )
    return Found(rows, notes=notes, criterion=criterion(repetitions, freedom))


def _adjusted(means: Means, k: int, scenario: int, unknowns: int) -> NormBatch:
    sigma = means.noise / np.sqrt(60.0 * MINUTES[k])
    observed = np.ascontiguousarray(means.means[k][:, SCENARIOS[scenario]])
    # A bias of the sheet's size exceeds the Earth's rate: from zero the solution would seldom be found.
    start = np.zeros((observed.shape[0], 9))
    start[:, :3], start[:, 3:6] = observed.mean(axis=1), 1.0
    return adjust_norms(observed, sigma, means.reference, unknowns=unknowns, start=start)


def _told(
    minutes: int, entry: dict[str, Any], parameter: int, batch: NormBatch, means: Means, freedom: int
) -> tuple[tuple[Value, ...], tuple[str, str]]:
    """Return a row's cells from the thesis' estimate on, and its verdict with the reason."""
    thesis, factor, usable = entry["minutes"][str(minutes)], float(FACTORS[parameter]), batch.usable
    sigma = factor * (batch.sigmas * batch.sigma0[:, None])[usable, parameter]
    sheet = factor * float(means.sheet[parameter])
    head = (thesis["estimate"], thesis["sigma"], sheet)
    if not sigma.size:
        return (*head, *(None,) * 5), (UNJUDGED, "none of our runs converged")
    estimate = batch.parameters[usable, parameter] - (1.0 if 3 <= parameter < 6 else 0.0)
    error = factor * (estimate - means.errors[usable, parameter])
    far = abs(thesis["estimate"]) / float(np.hypot(sheet, thesis["sigma"]))
    ours = factor * np.abs(estimate) / np.hypot(sheet, sigma)
    as_far = np.count_nonzero(ours >= far) / sigma.size
    numbers = (float(of) for of in (error[0], sigma[0], sigma.min(), sigma.max()))
    cofactor = float(np.median(factor * batch.sigmas[usable, parameter]))
    sigma_fits, of_sigma = judge_sigma(thesis["sigma"], sigma, cofactor, freedom)
    estimate_fits, of_estimate = judge_estimate(far, as_far, sigma.size)
    absurd = parameter >= 3 and abs(thesis["estimate"]) > ABSURD * factor
    reasons = ["no unit has such an error: the solution ran away, or into the mirror root"] if absurd else []
    reasons += [words for words in (of_estimate, of_sigma) if words]
    verdict = INSIDE if sigma_fits and estimate_fits else OUTSIDE
    return (*head, *numbers, 100.0 * as_far if sigma.size > 1 else None), (verdict, "; ".join(reasons))


def _settled(imu: str, adjusted: list[NormBatch]) -> str:
    """Say how well the solutions settled."""
    parts: list[str] = []
    for minutes, batch in zip(MINUTES, adjusted, strict=True):
        lost, mirror, one = (
            float(np.mean(~batch.converged)),
            float(np.mean(batch.mirror)),
            batch.sigma0.size == 1,
        )
        words = f"{minutes} min"
        if np.any(batch.usable):
            sigma0 = batch.sigma0[batch.usable]
            words += f": sigma0 {np.min(sigma0):.2g}" + ("" if one else f" to {np.max(sigma0):.2g}")
        if lost:
            words += ": not converged" if one else f", {100 * lost:.2g} % not converged"
        if mirror:
            words += f", {100 * mirror:.2g} % in the mirror root"
        parts.append(words)
    return f"{imu}: {'; '.join(parts)}."


def _against_sheet(imu: str, means: Means, scenario: int, unknowns: int) -> str:
    """Say what the attitudes of the first unit tell worse than its data sheet does, with three minutes each."""
    sigma = means.noise / np.sqrt(60.0 * MINUTES[1]) / means.reference
    design = _design(means.means[1, 0, SCENARIOS[scenario]] / means.reference, unknowns)
    sizes = means.sheet[:unknowns] / np.repeat([means.reference, 1.0, 1.0], 3)[:unknowns]
    weak = find_weak_directions(design.T @ design / sigma**2, sizes, 1.0)
    if not weak:
        return f"{imu}: every combination of the parameters is determined better than by the data sheet."
    involved = " and ".join(NAMES[i] for i in weak[0].leading(0.5))
    return (
        f"{imu}: {len(weak)} of {unknowns} combinations of the parameters are determined worse than "
        f"by the data sheet, by white noise alone. The worst, of {involved}, with "
        f"{float(f'{weak[0].sigma:.2g}'):g} times the sheet's sigma."
    )


def _design(true: Vectors, unknowns: int) -> Table:
    """Return the slopes of the norm by bias, scale factors and angles, at unit vectors."""
    x, y, z = true.T
    columns = [true, true**2, np.column_stack([x * y, y * z, x * z])]
    return np.concatenate(columns[: unknowns // 3], axis=1)


def _unseen(scenario: int, unknowns: int) -> str:
    """Say what the attitudes of a scenario do not tell of accelerometers in their nominal poses."""
    up = twenty_six_directions()[SCENARIOS[scenario]]
    design = _design(up, unknowns)
    weak = find_weak_directions(design.T @ design, np.ones(unknowns), 1e6)
    if not weak:
        return ""
    involved = " and ".join(NAMES[i] for i in weak[0].leading())
    return (
        f"Geometry: the {len(up)} attitudes of scenario {scenario} do not determine {involved} at all "
        "in their nominal poses. What the solutions say of it comes from poses that were off by a "
        "few degrees."
    )


SCENARIO_TABLES = tuple(Study(f"hayal-{t}", partial(_table, t)) for t in TABLES)
"""Tables 5.2 to 5.4, A.1 to A.6 and B.1 to B.3."""
