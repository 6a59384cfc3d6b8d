"""How good fitted noise models are, on simulated series whose terms are known.

    python benchmarks/noise_fit.py --runs 500 --case four-terms --case weak-walk

Prints, for each case, a table of the terms by both methods: how often a term was seen, its bias and its
root-mean-square error relative to the truth, in how many runs the interval of 95 % (or the upper limit,
where the term was not seen) held the truth, and the error of the moments over that of the curve. Below it: how
often a term was seen that is not there, how often a line, and how often the goodness of fit came out below
5 % and 1 %.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from dataclasses import dataclass, replace

import numpy as np

from tumble.noise.advice import seconds_for
from tumble.noise.deviation import allan_deviation
from tumble.noise.fitting.fit import NoiseFit, fit_curve, fit_moments_of
from tumble.noise.lines import find_lines
from tumble.noise.terms import GaussMarkov, Line, NoiseModel

METHODS = ("curve", "moments")
FOUR = NoiseModel(0.02, 0.05, 0.05, 0.01)


@dataclass(frozen=True)
class Case:
    """A model in units u and s, and how it is recorded."""

    what: str
    model: NoiseModel
    rate: float = 10.0
    samples: int = 2**15
    processes: int = 1
    lines: bool = False


CASES = {
    "four-terms": Case("Q, N, B and K, all of them showing", FOUR),
    "five-terms": Case("Q, N, B, K and R, all of them showing", replace(FOUR, ramp=5e-4), samples=2**17),
    "weak-walk": Case(
        "a K that is seen in about half of the recordings", replace(FOUR, rate_random_walk=0.003)
    ),
    "white": Case("N alone", NoiseModel(random_walk=0.05), lines=True),
    "process": Case(
        "N and a Gauss-Markov process",
        NoiseModel(random_walk=0.05, gauss_markov=(GaussMarkov(0.08, 5.0),)),
    ),
    "two-processes": Case(
        "N and two Gauss-Markov processes",
        NoiseModel(random_walk=0.05, gauss_markov=(GaussMarkov(0.08, 2.0), GaussMarkov(0.08, 60.0))),
        samples=2**17,
        processes=3,
    ),
    "vibration": Case(
        "N, B and K under two lines, one 30 times the white noise of a sample",
        NoiseModel(0.0, 0.05, 0.05, 0.01, lines=(Line(5.0, 2.73), Line(0.05, 0.411))),
        lines=True,
    ),
    "length": Case("N, B and K, as long as is advised for 10 % on K", NoiseModel(0.0, 0.05, 0.02, 0.003)),
}


def draw(case: Case, samples: int, rng: np.random.Generator) -> np.ndarray:
    """A series; its ramp of exactly the size stated, because a random one has no true value."""
    still = replace(case.model, ramp=0.0)
    return still.simulate(samples, case.rate, rng) + case.model.ramp * np.arange(samples) / case.rate


def study(name: str, runs: int, seed: int) -> None:
    """Simulate, fit and print."""
    case, samples = CASES[name], CASES[name].samples
    if name == "length":
        samples = int(seconds_for(case.model, "K", case.rate, 0.1) * case.rate)
    rng = np.random.default_rng(seed)
    fits: dict[str, list[NoiseFit]] = {method: [] for method in METHODS}
    spurious = 0
    for begin in range(0, runs, 20):
        count = min(20, runs - begin)
        signals = np.column_stack([draw(case, samples, rng) for _ in range(count)])
        curve = allan_deviation(signals, case.rate)
        for k in range(count):
            lines = find_lines(signals[:, k], case.rate) if case.lines else ()
            spurious += len(lines) > len(case.model.lines)
            fits["curve"].append(fit_curve(curve, k, gauss_markov=case.processes, lines=lines))
            fits["moments"].append(fit_moments_of(curve, k, gauss_markov=case.processes, lines=lines))
    minutes = samples / case.rate / 60.0
    print(
        f"\n### {name}: {case.what}\n\n{runs} series of {minutes:.0f} min at {case.rate:g} Hz, seed {seed}.\n"
    )
    print("| term | truth | method | seen | bias | error | stated | held by 95 % | moments/curve |")
    print("|---|---|---|---|---|---|---|---|---|")
    for term, true in truths(case.model).items():
        errors = {}
        for method in METHODS:
            errors[method], row = judged(fits[method], term, true)
            ratio = f"{errors['moments'] / errors['curve']:.3f}" if method == "moments" else ""
            print(f"| {term} | {true:g} | {method} | {row} | {ratio} |")
    for method in METHODS:
        print(f"\n{method}: " + aside(fits[method], case.model))
    if case.lines:
        print(f"\nA line too many in {spurious / runs:.1%} of the series.")
        for number, line in enumerate(case.model.lines):
            print("\n" + on_line(fits["curve"], line, number))


def truths(model: NoiseModel) -> dict[str, float]:
    """True values by the fit's names."""
    found = {letter: value for letter, value in model.coefficients.items() if value > 0.0}
    for k, g in enumerate(model.gauss_markov):
        mark = "" if k == 0 else f" {k + 1}"
        found |= {f"sigma{mark}": g.sigma, f"correlation time{mark}": g.correlation_time}
    return found


def judged(fits: list[NoiseFit], term: str, true: float) -> tuple[float, str]:
    """Error, and the columns of a term by one method."""
    values, stated, covered = [], [], 0
    for fit in fits:
        names = [one.name for one in fit.terms]
        if term in names:
            at = names.index(term)
            one = fit.terms[at]
            values.append(one.value / true)
            stated.append(np.sqrt(fit.covariance[at, at]) / true)
            covered += one.low <= true <= one.high
        else:
            covered += true <= fit.limits.get(term, 0.0)
    seen = np.array(values)
    # a term that is not seen is estimated as zero
    everywhere = np.concatenate([seen, np.zeros(len(fits) - len(seen))])
    share = covered / len(fits)
    bias, error = everywhere.mean() - 1.0, float(np.sqrt(np.mean((everywhere - 1.0) ** 2)))
    known = everywhere.std() / np.sqrt(len(fits))
    sigma = np.sqrt(share * (1.0 - share) / len(fits))
    median = np.median(stated) if stated else np.nan
    return error, (
        f"{len(seen) / len(fits):.0%} | {bias:+.1%} ± {known:.1%} | {error:.1%} | {median:.1%} | "
        f"{share:.1%} ± {sigma:.1%}"
    )


def aside(fits: list[NoiseFit], model: NoiseModel) -> str:
    """Terms too many, and the goodness of fit."""
    absent = [letter for letter, value in model.coefficients.items() if value == 0.0]
    parts = [f"{letter} in {np.mean([letter in fit.chosen for fit in fits]):.1%}" for letter in absent]
    many = np.mean([len(fit.model.gauss_markov) > len(model.gauss_markov) for fit in fits])
    chance = np.array([fit.probability for fit in fits])
    return (
        f"seen without being there: {', '.join([*parts, f'a process in {many:.1%}'])}. Goodness of fit "
        f"below 5 % in {np.mean(chance < 0.05):.1%}, below 1 % in {np.mean(chance < 0.01):.1%}."
    )


def on_line(fits: list[NoiseFit], line: Line, number: int) -> str:
    """How well a line was found."""
    found = [
        one
        for fit in fits
        for one in fit.lines
        if abs(one.frequency - line.frequency) < 0.01 * line.frequency
    ]
    off = np.array([one.amplitude / line.amplitude - 1.0 for one in found])
    held = [one.limits(0.95) for one in found]
    a = np.mean([low <= line.amplitude <= high for (low, high), _ in held])
    f = np.mean([low <= line.frequency <= high for _, (low, high) in held])
    return (
        f"Line {number + 1} at {line.frequency:g} Hz found in {len(found) / len(fits):.1%}, amplitude "
        f"{off.mean():+.2%} off with a scatter of {off.std():.2%}; intervals of 95 % held the amplitude in {a:.1%} "
        f"and the frequency in {f:.1%}."
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--case", action="append", choices=list(CASES), help="one or more; without it all")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for name in given.case or CASES:
        study(name, given.runs, given.seed)


if __name__ == "__main__":
    main()
