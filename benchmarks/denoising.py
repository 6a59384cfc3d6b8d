"""When does de-noising help? Calibrations and angles from recordings as they are and de-noised.

    python benchmarks/denoising.py                       # calibrations, angles, means, and two figures' data
    python benchmarks/denoising.py --part calibrations --runs 40 --workers 2

Part "calibrations": units of a grade are tumbled through 26 attitudes by hand (as in uncertainty.py), the
recording is calibrated as it is and after each way of de-noising, by the multi-position (holds alone) and
the hand-held procedure (holds and turns). Printed by group of parameters: the bias of the estimate (mean
error, over the stated sigma of the recording as it is), the ratio of its rms error to that without
de-noising, the ratio of the stated sigma, and the scatter of error over stated sigma, which is 1 where the
stated one holds; ± is a bootstrap over runs.
Part "angles": 60 s at rest, the gyro's bias taken off as the first 20 s show it, angles integrated over the
other 40 s.
Part "means": coloured noise; how a mean of 10 s scatters, and what is said of it.
"""

from __future__ import annotations

import argparse
import math
import os
import time
import warnings
from concurrent.futures import ProcessPoolExecutor

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.signal import lfilter
from uncertainty import GROUPS, simulate, true_values

from tumble.calibration import calibrate_hand_held, calibrate_multi_position
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.noise.denoising.autoregression import choose_order
from tumble.noise.denoising.level_filter import fit_level_filter
from tumble.noise.denoising.shrinkage import Shrinkage, choose_level, denoise_signal
from tumble.segmentation import find_timeline, observe_holds
from tumble.workflows.denoise import denoise_recording

RATE = 100.0
INSTANTS = np.array([1.0, 10.0, 40.0])  # s
WAYS = {
    "as recorded": None,
    "wavelets, at rest": {},
    "wavelets, motion too": {"filter_motion": True},
    "autoregression, at rest": {"method": "ar"},
    "low-pass, 5 levels, all": {"filter_motion": True, "level": 5, "shrinkage": Shrinkage("remove")},
}
PROCEDURES = {"multi-position": calibrate_multi_position, "hand-held": calibrate_hand_held}


def one_unit(job: tuple[int, str, float]) -> dict[tuple[str, str], dict[str, tuple[float, float]] | str]:
    """Return error and stated sigma of each parameter, by procedure and way; a sentence where it failed."""
    seed, grade, hold = job
    site = Site.from_latitude(math.radians(48.0), 300.0)
    exact = Site(site.gravity, 0.0, site.latitude, site.height, "simulated")
    recording, model = simulate(seed, grade, RATE, hold, exact, False)
    found: dict[tuple[str, str], dict[str, tuple[float, float]] | str] = {}
    for way, options in WAYS.items():
        for procedure, calibrate in PROCEDURES.items():
            try:
                mine = recording if options is None else denoise_recording(recording, **options).recording
                timeline = find_timeline(mine)
                means = observe_holds(mine, timeline)
                turns = (timeline,) if procedure == "hand-held" else ()
                estimate = calibrate(mine, *turns, means, exact)
            except TumbleError as error:
                found[procedure, way] = str(error)
                continue
            truth = true_values(model, estimate)
            found[procedure, way] = {
                p.name: (p.value - truth[p.name], p.standard_uncertainty)
                for p in estimate.parameters
                if p.name in truth and p.standard_uncertainty > 0.0
            }
    return found


def calibrations(runs: int, workers: int, grade: str, hold: float) -> None:
    began = time.perf_counter()
    with ProcessPoolExecutor(workers) as pool:
        outcomes = list(pool.map(one_unit, [(seed, grade, hold) for seed in range(runs)]))
    print(f"{runs} units of {grade}, 26 attitudes of {hold:g} s; {time.perf_counter() - began:.0f} s")
    for procedure in PROCEDURES:
        for way in WAYS:
            failed = [o[procedure, way] for o in outcomes if isinstance(o[procedure, way], str)]
            print(f"\n{procedure}, {way}: {len(failed)} failed" + (f" ({failed[0]})" if failed else ""))
            good = [
                (o[procedure, way], o[procedure, "as recorded"])
                for o in outcomes
                if not isinstance(o[procedure, way], str) and not isinstance(o[procedure, "as recorded"], str)
            ]
            for group in GROUPS if good else ():
                print_group(group, good)


def print_group(group, good) -> None:
    """One line: bias, rms error and stated sigma against those without de-noising, error over stated sigma."""
    rows = []
    for mine, plain in good:
        names = [n for n in mine if n.startswith(group) and n in plain]
        if names:
            rows.append([(*mine[n], *plain[n]) for n in names])
    if not rows:
        return
    table = np.array(rows)  # (runs, parameters, (error, sigma, plain error, plain sigma))

    def numbers(part):
        error, sigma, plain, plain_sigma = (part[..., k] for k in range(4))
        return np.array(
            [
                np.mean(error / plain_sigma),
                np.sqrt(np.mean((error / plain_sigma) ** 2) / np.mean((plain / plain_sigma) ** 2)),
                np.exp(np.mean(np.log(sigma / plain_sigma))),
                np.sqrt(np.mean((error / sigma) ** 2)),
            ]
        )

    rng = np.random.default_rng(1)
    draws = [numbers(table[rng.integers(0, len(table), len(table))]) for _ in range(500)]
    centre, spread = numbers(table), np.std(draws, axis=0)
    labels = ("bias/σ", "rms error ratio", "stated σ ratio", "error/stated σ")
    words = "  ".join(f"{n} {c:6.3f} ± {s:.3f}" for n, c, s in zip(labels, centre, spread, strict=True))
    print(f"  {group:34} {words}")


def angles(runs: int) -> None:
    """Angles integrated from a gyro with N = 1e-4 rad/s/√Hz, at rest, and turned too slowly to be seen."""
    density, seconds, calm = 1e-4, 60.0, 20.0
    count, first = round(seconds * RATE), round(calm * RATE)
    ends = first + np.rint(INSTANTS * RATE).astype(int) - 1
    clock = np.arange(count) / RATE - calm
    # A millirad in two seconds: half the scatter of a sample, which the search for holds takes for rest.
    turn = np.where((clock >= 5.0) & (clock < 7.0), 5e-4, 0.0)
    true_angle = np.cumsum(turn[first:])[ends - first] / RATE
    names = ("as recorded", "wavelets", "wavelets, level 5", "autoregression")
    still: dict[str, np.ndarray] = {}
    for moved in (False, True):
        found = {name: np.zeros((runs, len(ends))) for name in names}
        scatter = dict.fromkeys(names, 0.0)
        for run in range(runs):
            rng = np.random.default_rng([run, 5])
            signal = density * np.sqrt(RATE) * rng.standard_normal(count) + 0.001 + (turn if moved else 0.0)
            rest = [(0, count)]
            chosen = choose_level(signal, RATE, rest).level
            followed = fit_level_filter(signal, rest, 1 << chosen).follow(signal, rest)
            shrunk = [denoise_signal(signal, rest, rest, level).signal for level in (chosen, 5)]
            for name, each in zip(names, (signal, *shrunk, followed), strict=True):
                # What a navigator does: the bias from the rest before, then the angle.
                angle = np.cumsum(each[first:] - each[:first].mean()) / RATE
                found[name][run] = angle[ends - first] - (true_angle if moved else 0.0)
                scatter[name] += float(each[first:].std()) / runs
        case = "turned by 1 mrad from 5 s to 7 s" if moved else "at rest"
        print(
            f"\nErrors of the angle of a gyro {case}: N = 1e-4 rad/s/√Hz = 0.344 °/√h, {runs} runs, bias from the"
        )
        what = "mean of what the turn adds to the error" if moved else "standard deviation"
        print(f"20 s before; {what} ± its standard uncertainty, µrad")
        if not moved:
            walk = 1e6 * density * np.sqrt(INSTANTS + INSTANTS**2 / calm)
            print(f"  {'N √(t + t²/20 s)':20}" + columns(walk, None))
            still = found
        for name, values in found.items():
            if moved:
                added = 1e6 * (values - still[name])
                words = columns(added.mean(axis=0), added.std(axis=0, ddof=1) / math.sqrt(runs))
            else:
                spread = 1e6 * values.std(axis=0, ddof=1)
                words = columns(spread, spread / math.sqrt(2.0 * (runs - 1)))
            print(f"  {name:20}{words}  a sample scatters by {1e6 * scatter[name]:.1f} µrad/s")


def columns(values, sigmas) -> str:
    """Numbers at the instants, with their standard uncertainties if they have any."""
    tails = [""] * len(values) if sigmas is None else [f" ± {s:.1f}" for s in sigmas]
    return "".join(f"{t:5g} s: {v:7.1f}{tail:8}" for t, v, tail in zip(INSTANTS, values, tails, strict=True))


def means(runs: int) -> None:
    """Means of 10 s in noise of a filtered sensor: what is said by the sample's scatter and by the model."""
    count, pole = round(10.0 * RATE), 0.9
    values, plain, said, left = [], [], [], []
    for run in range(runs):
        rng = np.random.default_rng([run, 6])
        signal = lfilter([1.0], [1.0, -pole], rng.standard_normal(count + 300))[300:]
        values.append(signal.mean())
        plain.append(signal.std() / math.sqrt(count))
        said.append(choose_order(signal, 12).model.random_walk / math.sqrt(count))
        rest = [(0, count)]
        quiet = denoise_signal(signal, rest, rest, choose_level(signal, RATE, rest).level).signal
        left.append((quiet.mean(), quiet.std() / math.sqrt(count)))
    true = np.std(values, ddof=1)
    off = np.array(left)
    print(f"\nMeans of 10 s, noise with a pole at {pole}, {runs} runs (unit: the innovation)")
    print(f"  scatter of the means                     {true:.4f} ± {true / math.sqrt(2.0 * (runs - 1)):.4f}")
    for name, each in (
        ("said by sd/√n", plain),
        ("said by the autoregression", said),
        ("said by sd/√n after wavelets", off[:, 1]),
    ):
        each = np.array(each)
        print(f"  {name:40} {each.mean():.4f} ± {each.std(ddof=1):.4f} (of one recording)")
    after = np.std(off[:, 0], ddof=1)
    print(
        f"  scatter of the means after wavelets      {after:.4f} ± {after / math.sqrt(2.0 * (runs - 1)):.4f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=["calibrations", "angles", "means", "all"], default="all")
    parser.add_argument("--runs", type=int, default=40, help="calibrated units")
    parser.add_argument("--grade", default="consumer-mems")
    parser.add_argument("--hold", type=float, default=4.0, help="s")
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    if asked.part in ("angles", "all"):
        angles(400)
    if asked.part in ("means", "all"):
        means(400)
    if asked.part in ("calibrations", "all"):
        calibrations(asked.runs, asked.workers, asked.grade, asked.hold)


if __name__ == "__main__":
    warnings.simplefilter("error", RuntimeWarning)
    main()
