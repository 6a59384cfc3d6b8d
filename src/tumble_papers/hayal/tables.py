"""Tables 4.2 to 4.5 of Hayal (2010): what the norm solutions find in a simulated HG1700."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.reproduction.outcome import INSIDE, OUTSIDE, Outcome, Row
from tumble_papers.hayal.thesis_simulation import Runs, run_setting, table_setting
from tumble_papers.published import hayal

COLUMNS = (
    "case",
    "thesis: sigma",
    "thesis: |difference|",
    "one run: sigma",
    "one run: |difference|",
    "sigma: mean",
    "sigma: lowest",
    "sigma: highest",
    "|difference|: highest",
)
# Factors from SI to the thesis' units, a group of three parameters each.
FACTORS = np.repeat([1.0, 1e6, 1e6], 3)
CASES = {
    1: "1: no noise",
    2: "2: noise",
    3: "3: rate x 10⁴",
}
# Below this share of the true value a number is what rounding leaves.
ROUND_OFF = 1e-9
# With one run alone there is no range: a stated sigma varies by this factor from run to run.
ONE_RUN = 3.0
# A difference from the truth beyond so many of its own stated sigmas is no chance.
FALSE_ALARM = 4.5


def reproduce_table(table: str, repetitions: int, seed: int) -> Outcome:
    """Make one of the tables 4.2 to 4.5 anew.

    Parameters
    ----------
    table : "4.2", "4.3", "4.4" or "4.5".
    repetitions : how many runs; one shows the table as the thesis has it, hundreds show its range.
    seed : of all random numbers.

    Raises
    ------
    UsageError
        If there is no such table.
    """
    printed = hayal()["tables"][table]
    rows: list[Row] = []
    notes: list[str] = []
    for case in (1, 2) if table == "4.5" else (1, 2, 3):
        rng = np.random.Generator(np.random.SFC64([seed, case]))
        runs = run_setting(table_setting(table, case), repetitions, rng)
        rows += [_row(number, entry, case, runs) for number, entry in enumerate(printed["rows"])]
        notes += _notes(case, runs)
    criterion = (
        f"inside: the thesis' sigma lies in the range of our {repetitions} runs' sigmas of that kind "
        "(all three axes). Its difference from the truth is no larger than the largest of ours"
        if repetitions > 1
        else f"inside: the thesis' sigma is within a factor of {ONE_RUN:g} of our one run's mean. Its "
        f"difference from the truth is within {FALSE_ALARM:g} of its own sigmas (--repetitions 500 "
        "gives the range itself)"
    )
    return Outcome(
        f"hayal-{table}",
        f"Table {table}: {printed['title']}",
        "Hayal 2010, chapter 4",
        COLUMNS,
        rows,
        criterion,
        notes=notes,
        repetitions=repetitions,
        seed=seed,
    )


def _row(number: int, entry: dict[str, Any], case: int, runs: Runs) -> Row:
    thesis = entry["cases"][case - 1]
    factor = float(FACTORS[number])
    usable = runs.usable
    sigma = factor * runs.sigmas[usable, number]
    difference = factor * np.abs(runs.differences[usable, number])
    kind = slice(3 * (number // 3), 3 * (number // 3) + 3)
    of_kind = factor * runs.sigmas[usable, kind], factor * np.abs(runs.differences[usable, kind])
    cells = (
        CASES[case],
        thesis["sigma"],
        thesis["difference"],
        float(sigma[0]),
        float(difference[0]),
        float(of_kind[0].mean()),
        float(of_kind[0].min()),
        float(of_kind[0].max()),
        float(of_kind[1].max()),
    )
    true = factor * float(runs.setting.errors[number])
    verdict, reason = _judged(thesis["sigma"], thesis["difference"], *of_kind, true)
    alone = sigma.min() <= thesis["sigma"] <= sigma.max()
    if verdict == INSIDE and not reason and sigma.size > 1 and not alone:
        reason = f"beyond the range of this axis alone ({sigma.min():.3g} to {sigma.max():.3g})"
    return Row(entry["parameter"], entry["unit"].replace("^2", "²"), cells, verdict, reason)


def _judged(
    printed: float, printed_difference: float, sigma: np.ndarray, difference: np.ndarray, true: float
) -> tuple[str, str]:
    if printed < ROUND_OFF * true and sigma.max() < ROUND_OFF * true:
        return INSIDE, "round-off: nothing is left on either side"
    if sigma.shape[0] == 1:
        ratio = printed / float(sigma.mean())
        if printed_difference > FALSE_ALARM * printed:
            return OUTSIDE, f"its difference is {printed_difference / printed:.2g} times its own sigma"
        if 1.0 / ONE_RUN <= ratio <= ONE_RUN:
            return INSIDE, ""
        return OUTSIDE, f"the thesis' sigma is {ratio:.2g} times ours"
    reasons: list[str] = []
    if not sigma.min() <= printed <= sigma.max():
        reasons.append(f"its sigma is {printed / sigma.mean():.2g} times the mean of ours")
    if printed_difference > difference.max():
        reasons.append(
            f"its difference is {printed_difference / difference.max():.2g} times the largest of ours"
        )
    return (OUTSIDE, "; ".join(reasons)) if reasons else (INSIDE, "")


def _notes(case: int, runs: Runs) -> list[str]:
    total, usable = runs.sigma0.size, runs.usable
    few, most = np.min(runs.iterations[usable]), np.max(runs.iterations[usable])
    span = f"{few}" if few == most else f"{few} to {most}"
    words = f"Case {CASES[case]}: sigma0 {np.mean(runs.sigma0[usable]):.3g}, {span} iterations"
    lost = total - int(np.count_nonzero(usable))
    if lost:
        words += f"; {lost} of {total} runs did not converge or ended in the mirror root"
    if runs.setting.noise == 0.0:
        words += " (of a nominal sigma: there is no noise)"
    elif total > 1:
        ratio = np.std(runs.differences[usable], axis=0) / np.mean(runs.sigmas[usable], axis=0)
        words += f"; scatter of the estimates over mean stated sigma {ratio.min():.2f} to {ratio.max():.2f}"
    return [words + "."]
