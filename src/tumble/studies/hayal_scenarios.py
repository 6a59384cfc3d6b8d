"""Chapter 5 of Hayal (2010), the calibrations: 26, 18, first 10 and last 10 attitudes of 1, 3 and 5 minutes.

The thesis' recordings are not public. Simulated units of the same data sheet stand for them: errors
drawn from the sheet's spreads, white noise of table 3.1 at one sample a second, and biases that wander
by flicker. How much they wander decides every stated sigma (by sigma0), and the sheet says only what
they do not exceed over temperature and life: each simulated unit draws a share of it.

The unit is held in each attitude for five minutes with half a minute between, as in section 5.2; the
first 1, 3 and 5 minutes of each hold are averaged. Hold means are the means of these samples: a search
for the holds would find the same stretches.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.calibration.norm_batch import NormBatch, adjust_norms
from tumble.simulation import TriadNoise, find_grade
from tumble.simulation.noise import simulate_noise
from tumble.studies.outcome import INSIDE, OUTSIDE, Outcome, Row
from tumble.studies.published import hayal
from tumble.studies.thesis_simulation import (
    ATTITUDES,
    FORCE_NOISE,
    RATE_NOISE,
    RATE_NOISE_HG1900,
    Setting,
    simulate_true,
)

MINUTES = (1, 3, 5)
HOLD, PAUSE = 300, 30  # s, samples of one second
# The thesis' order of attitudes: faces, edges, corners; scenario -> which of the 26.
SCENARIOS = {
    1: slice(0, 26),
    2: slice(0, 18),
    3: slice(0, 10),
    4: slice(16, 26),
}
# Table -> (scenario, triad, unknowns).
TABLES = {
    "5.2": (3, "gyro", 3),
    "5.3": (3, "gyro", 9),
    "5.4": (3, "accelerometer", 9),
    "A.1": (1, "gyro", 3),
    "A.2": (1, "gyro", 9),
    "A.3": (2, "gyro", 3),
    "A.4": (2, "gyro", 9),
    "A.5": (4, "gyro", 3),
    "A.6": (4, "gyro", 9),
    "B.1": (1, "accelerometer", 9),
    "B.2": (2, "accelerometer", 9),
    "B.3": (4, "accelerometer", 9),
}
IMUS = ("HG1700", "HG1900")
RATE_NOISES = {"HG1700": RATE_NOISE, "HG1900": RATE_NOISE_HG1900}
FACTORS = np.repeat([1.0, 1e6, 1e6], 3)
COLUMNS = (
    "IMU",
    "minutes",
    "thesis",
    "thesis: sigma",
    "one run: error",
    "one run: sigma",
    "sigma: lowest",
    "sigma: highest",
)
# Of the sheet's in-run stability, a unit's flicker in one afternoon: from a fiftieth to a half (assumed).
WANDER = (0.02, 0.5)
# With one run alone there is no range: stated sigmas vary by this factor from unit to unit.
ONE_RUN = 4.0
# Angles beyond this cannot be a unit's whose sheet says 100 µrad.
ABSURD = 0.5


@dataclass(frozen=True, slots=True)
class Means:
    """Hold means of many simulated units, for each averaging time.

    `means` is (minutes, runs, 26, 3) raw, `bias`, `scale` and `angles` (runs, 3) the truth (the bias is
    that of the first sample), `noise` a sample's standard deviation, `reference` the norm.
    """

    means: AnyArray
    errors: AnyArray
    noise: float
    reference: float


def simulate_field_means(imu: str, triad: str, runs: int, rng: np.random.Generator) -> Means:
    """Simulate the hold means of a field calibration of many units.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    triad : "gyro" or "accelerometer".
    runs : how many units.
    rng : source of all numbers.
    """
    from tumble.sensor.conventions.shin import matrix_from_shin

    grade = find_grade(imu.lower())
    spread = grade.accelerometer if triad == "accelerometer" else grade.gyroscope
    noise = FORCE_NOISE if triad == "accelerometer" else RATE_NOISES[imu]
    setting = Setting(triad, 9, noise=noise)
    true = simulate_true(setting, runs, rng)
    errors = np.column_stack(
        [
            rng.normal(0.0, spread.bias, (runs, 3)),
            rng.normal(0.0, spread.scale_factor, (runs, 3)),
            # The angle between two axes: each misalignment is about one direction.
            np.sqrt(2.0) * rng.normal(0.0, spread.misalignment, (runs, 3)),
        ]
    )
    share = np.exp(rng.uniform(np.log(WANDER[0]), np.log(WANDER[1]), runs))
    means = np.empty((len(MINUTES), runs, ATTITUDES, 3))
    length = HOLD + PAUSE
    for run in range(runs):
        matrix = np.real(matrix_from_shin(1.0 + errors[run, 3:6], errors[run, 6:9]))
        steady = true[run] @ matrix.T + errors[run, :3]
        wander = TriadNoise(random_walk=noise, bias_instability=float(share[run]) * spread.bias_stability)
        samples = simulate_noise(wander, ATTITUDES * length, 1.0, rng).reshape(ATTITUDES, length, 3)
        for k, minutes in enumerate(MINUTES):
            means[k, run] = steady + samples[:, : 60 * minutes].mean(axis=1)
    return Means(means, errors, noise, setting.reference)


def reproduce_scenario_table(table: str, repetitions: int, seed: int) -> Outcome:
    """Make one of the tables 5.2 to 5.4, A.1 to A.6 and B.1 to B.3 anew on simulated units.

    Parameters
    ----------
    table : its number.
    repetitions, seed : as for `reproduce_table`.
    """
    scenario, triad, unknowns = TABLES[table]
    printed = hayal()["tables"][table]
    rows: list[Row] = []
    notes: list[str] = []
    for number, imu in enumerate(IMUS):
        means = simulate_field_means(imu, triad, repetitions, np.random.default_rng([seed, number]))
        adjusted = [_adjusted(means, k, scenario, unknowns) for k in range(len(MINUTES))]
        entries = [entry for entry in printed["rows"] if entry["imu"] == imu]
        for parameter, entry in enumerate(entries):
            rows += [
                _row(imu, minutes, entry, parameter, adjusted[k], means.errors)
                for k, minutes in enumerate(MINUTES)
            ]
        notes += _notes(imu, adjusted)
    notes.append(_weakest(scenario, unknowns))
    if len(range(ATTITUDES)[SCENARIOS[scenario]]) - unknowns == 1:
        notes.append(
            "Only one attitude more than unknowns: sigma0, and with it every sigma, scatters over decades from unit to "
            "unit. That the thesis' lie among them says little."
        )
    criterion = (
        f"inside: the thesis' sigma lies in the range of the sigmas that {repetitions} simulated units state"
        if repetitions > 1
        else f"inside: the thesis' sigma is within a factor of {ONE_RUN:g} of what one simulated unit states "
        "(--repetitions 200 gives the range itself)"
    )
    return Outcome(
        f"hayal-{table}",
        f"Table {table}: {printed['title']}",
        "Hayal 2010, chapter 5 and appendices; the thesis' recordings are not public, ours are simulated",
        COLUMNS,
        rows,
        criterion,
        notes=notes,
        repetitions=repetitions,
        seed=seed,
    )


def _adjusted(means: Means, k: int, scenario: int, unknowns: int) -> NormBatch:
    sigma = means.noise / np.sqrt(60.0 * MINUTES[k])
    observed = np.ascontiguousarray(means.means[k][:, SCENARIOS[scenario]])
    # A bias of the sheet's size exceeds the Earth's rate: from zero the solution would seldom be found.
    start = np.zeros((observed.shape[0], 9))
    start[:, :3], start[:, 3:6] = observed.mean(axis=1), 1.0
    return adjust_norms(observed, sigma, means.reference, unknowns=unknowns, start=start)


def _row(
    imu: str, minutes: int, entry: dict[str, Any], parameter: int, batch: NormBatch, errors: AnyArray
) -> Row:
    thesis = entry["minutes"][str(minutes)]
    factor = float(FACTORS[parameter])
    usable = batch.usable
    sigma = factor * (batch.sigmas * batch.sigma0[:, None])[usable, parameter]
    unit = entry["unit"].replace("^2", "²")
    if not sigma.size:
        cells = (imu, float(minutes), thesis["estimate"], thesis["sigma"], None, None, None, None)
        return Row(entry["parameter"], unit, cells, OUTSIDE, "none of our runs converged")
    estimate = batch.parameters[usable, parameter] - (1.0 if 3 <= parameter < 6 else 0.0)
    error = factor * (estimate - errors[usable, parameter])
    cells = (
        imu,
        float(minutes),
        thesis["estimate"],
        thesis["sigma"],
        float(error[0]),
        float(sigma[0]),
        float(sigma.min()),
        float(sigma.max()),
    )
    return Row(entry["parameter"], unit, cells, *_judged(thesis, sigma, factor, parameter))


def _judged(thesis: dict[str, float], sigma: Series, factor: float, parameter: int) -> tuple[str, str]:
    printed = thesis["sigma"]
    typical = float(np.median(sigma))
    if sigma.size == 1:
        inside = 1.0 / ONE_RUN <= printed / typical <= ONE_RUN
    else:
        inside = bool(sigma.min() <= printed <= sigma.max())
    reasons: list[str] = []
    if parameter >= 3 and abs(thesis["estimate"]) > ABSURD * factor:
        reasons.append("no unit has such an error: the solution ran away, or into the mirror root")
    if not inside:
        ratio = printed / typical
        reasons.append(f"its sigma is {ratio:.2g} times the median of ours: {_why(ratio)}")
    return (INSIDE if inside else OUTSIDE), "; ".join(reasons)


def _why(ratio: float) -> str:
    if ratio > 1.0:
        return "its sigma0, not printed, must have been as many times larger: biases wandered more between attitudes"
    return (
        "its unit was quieter than the sheet, its sigma0 small by luck, or its attitudes differed from ours"
    )


def _notes(imu: str, adjusted: list[NormBatch]) -> list[str]:
    parts: list[str] = []
    for minutes, batch in zip(MINUTES, adjusted, strict=True):
        lost, mirror = float(np.mean(~batch.converged)), float(np.mean(batch.mirror))
        words = f"{minutes} min"
        if np.any(batch.usable):
            low, high = np.min(batch.sigma0[batch.usable]), np.max(batch.sigma0[batch.usable])
            words += f": sigma0 {low:.2g} to {high:.2g}" if batch.sigma0.size > 1 else f": sigma0 {low:.2g}"
        if lost:
            words += f", {100 * lost:.2g} % not converged"
        if mirror:
            words += f", {100 * mirror:.2g} % in the mirror root"
        parts.append(words)
    return [f"{imu}: {'; '.join(parts)}."]


def _weakest(scenario: int, unknowns: int) -> str:
    """Name what the attitudes of a scenario tell least, from the geometry alone."""
    from tumble.attitude.directions import twenty_six_directions

    up = twenty_six_directions()[SCENARIOS[scenario]]
    columns = [up, up**2, np.stack([up[:, 0] * up[:, 1], up[:, 1] * up[:, 2], up[:, 0] * up[:, 2]], axis=1)]
    design = np.concatenate(columns[: 1 + (unknowns > 3) + (unknowns > 6)], axis=1)
    names = ["b x", "b y", "b z", "s x", "s y", "s z", "θ yz", "θ zx", "θ zy"][:unknowns]
    values, vectors = np.linalg.svd(design)[1:]
    share = vectors[-1] ** 2
    told = values[-1] / values[0]
    order: list[int] = np.argsort(share)[::-1].tolist()
    involved = " and ".join(names[i] for i in order if share[i] > 0.15)
    which = f"Geometry: the {len(up)} attitudes of scenario {scenario}"
    if told < 1e-9:
        return (
            f"{which} do not tell {involved} at all in their nominal poses; what the solutions say of it comes from "
            "poses that were off by a few degrees."
        )
    return f"{which} tell {involved} least ({1 / told:.1f} times less than the best)."
