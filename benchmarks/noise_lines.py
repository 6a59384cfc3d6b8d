"""How good found lines are: false alarms in noise without one, and whether stated uncertainties hold.

    python benchmarks/noise_lines.py --runs 300 --quiet-runs 3000

Prints in how many series without a line one is found, and for lines of known frequency and amplitude how far
off both are in units of their stated uncertainties, and in how many series the intervals of 95 % held them.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from tumble.noise.lines import FoundLine, find_lines
from tumble.noise.terms import GaussMarkov, Line, NoiseModel

RATE, SAMPLES = 10.0, 2**15
WHITE = NoiseModel(random_walk=0.05)
FOUR = NoiseModel(0.02, 0.05, 0.05, 0.01)
QUIET = {
    "white noise": WHITE,
    "Q, N, B and K": FOUR,
    "with a Gauss-Markov process": NoiseModel(0.02, 0.05, 0.05, 0.05, gauss_markov=(GaussMarkov(0.1, 2.0),)),
}
STEADY = {
    "strong": replace(FOUR, lines=(Line(5.0, 2.73),)),
    "0.3 of a sample's noise": replace(FOUR, lines=(Line(0.05, 0.411),)),
    "hardly seen": replace(WHITE, lines=(Line(0.014, 1.37),)),
}


def quiet(model: NoiseModel, runs: int, rng: np.random.Generator) -> str:
    """Share of series without a line in which one is found."""
    found = sum(bool(find_lines(model.simulate(SAMPLES, RATE, rng), RATE)) for _ in range(runs))
    return f"{100 * found / runs:.2f} ± {100 * np.sqrt(max(found, 1)) / runs:.2f} %"


def wandering(rng: np.random.Generator) -> np.ndarray:
    """A line of amplitude 0.3 at 12.3 Hz whose frequency wanders by 0.03 Hz within 5 s; 22 min at 100 Hz."""
    kept = np.exp(-1.0 / 500.0)
    off = lfilter([0.03 * np.sqrt(1.0 - kept**2)], [1.0, -kept], rng.standard_normal(2**17))
    return 0.3 * np.sin(2.0 * np.pi * np.cumsum(12.3 + off) / 100.0) + rng.standard_normal(2**17)


def row(name: str, found: list[FoundLine], line: Line, runs: int) -> str:
    """How far off amplitude and frequency are."""
    amplitude = np.array([(one.amplitude - line.amplitude) / one.amplitude_sigma for one in found])
    frequency = np.array([(one.frequency - line.frequency) / one.frequency_sigma for one in found])
    cells = [
        f"{z.mean():+.2f} | {z.std():.2f} | {100 * np.mean(abs(z) < 1.96):.1f} %"
        for z in (amplitude, frequency)
    ]
    return f"| {name} | {100 * len(found) / runs:.0f} % | {' | '.join(cells)} |"


def nearest(lines: tuple[FoundLine, ...], frequency: float) -> list[FoundLine]:
    """The strongest line within 1 % of a frequency, if there is one."""
    return [line for line in lines if abs(line.frequency / frequency - 1.0) < 0.01][:1]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--quiet-runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    for name, model in QUIET.items():
        print(
            f"{name}, {given.quiet_runs} series: a line found in {quiet(model, given.quiet_runs, rng)}",
            flush=True,
        )
    print("\n| line | found | amplitude off | scatter | held | frequency off | scatter | held |")
    print("|---|---|---|---|---|---|---|---|")
    for name, model in STEADY.items():
        line = model.lines[0]
        signals = (model.simulate(SAMPLES, RATE, rng) for _ in range(given.runs))
        found = [one for signal in signals for one in nearest(find_lines(signal, RATE), line.frequency)]
        print(row(name, found, line, given.runs), flush=True)
    signals = (wandering(rng) for _ in range(given.runs))
    found = [one for signal in signals for one in nearest(find_lines(signal, 100.0), 12.3)]
    print(row("wandering by 0.03 Hz", found, Line(0.3, 12.3), given.runs))


if __name__ == "__main__":
    main()
