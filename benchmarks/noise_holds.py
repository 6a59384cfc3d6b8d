"""Is a calibration as good as it says, when biases wander and a noise model knows it?

    python benchmarks/noise_holds.py --runs 400

Simulates a triad at rest in 26 poses with white noise, flicker and a rate random walk, and adjusts the norms
three ways: with the scatter inside the holds alone to say how well their means are known (white noise), with
batch means and a flicker floor (without --noise), and with the noise model (--noise), which also knows that
neighbouring holds are off together. Printed is how often the intervals of 95 % of the nine unknowns held the
truth, and the mean square of error over stated standard uncertainty, which ought to be 1. The true bias is
its mean over the session.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from dataclasses import replace

import numpy as np

from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.procedures.multi_position import fit_norms
from tumble.noise.terms import NoiseModel
from tumble.recording import Recording
from tumble.segmentation import Hold, NoiseFloor, Timeline, observe_holds
from tumble.segmentation.modelled_means import model_means

GRAVITY, RATE, SECONDS = 9.81, 50.0, 20.0
MODEL = NoiseModel(random_walk=1e-3, bias_instability=4e-4, rate_random_walk=1e-4)


def session(rng: np.random.Generator, model: NoiseModel) -> tuple[Recording, Timeline, np.ndarray]:
    """A recording of 26 poses in random order, its holds, and the true unknowns."""
    count, directions = int(SECONDS * RATE), twenty_six_directions()
    force = GRAVITY * rng.permutation(directions / np.linalg.norm(directions, axis=1)[:, None])
    still = replace(model, bias_instability=0.0, rate_random_walk=0.0)
    moving = replace(model, random_walk=0.0)
    total = count * len(force)
    wander = np.column_stack([moving.simulate(total, RATE, rng) for _ in range(3)])
    white = np.column_stack([still.simulate(total, RATE, rng) for _ in range(3)])
    truth = np.zeros(12)
    truth[:3] = rng.normal(0.0, 0.1, 3) + wander.mean(axis=0)
    truth[3:6] = 1.0
    samples = np.repeat(force, count, axis=0) + truth[:3] + wander - wander.mean(axis=0) + white
    recording = Recording(np.arange(total) / RATE, samples, None, "m/s^2", "rad/s", RATE)
    holds = tuple(Hold(k * count, (k + 1) * count) for k in range(len(force)))
    floor = NoiseFloor(np.full(3, model.random_walk * np.sqrt(RATE)), np.zeros(3), 0.0, "none")
    return recording, Timeline(holds, (), (), floor), truth


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    ways = ("scatter in the hold, white", "without --noise", "--noise, diagonal alone", "--noise")
    off: dict[str, list[np.ndarray]] = {way: [] for way in ways}
    errors: list[np.ndarray] = []
    for _ in range(given.runs):
        recording, timeline, truth = session(rng, MODEL)
        means = observe_holds(recording, timeline)
        modelled = model_means(recording, timeline, means, [MODEL] * 3, None).means
        assert means.specific_force is not None
        assert means.specific_force_covariance is not None
        white = np.broadcast_to(MODEL.random_walk**2 / SECONDS * np.eye(3), (len(means), 3, 3))
        covariances = (white, means.specific_force_covariance, *2 * (modelled.specific_force_covariance,))
        betweens = (None, None, None, modelled.specific_force_between)
        for way, covariance, between in zip(ways, covariances, betweens, strict=True):
            fit = fit_norms(
                means.specific_force, covariance, GRAVITY, truth.copy(), np.arange(9), between=between
            )
            error = (fit.unknowns - truth)[:9]
            off[way].append(error / np.sqrt(np.diag(fit.covariance)[:9]))
        errors.append(error)
    print(f"{given.runs} sessions of 26 holds of {SECONDS:g} s, seed {given.seed}; {MODEL}\n")
    print(
        "| covariance of the holds' means from | biases held | scale factors | angles | mean square of error/stated |"
    )
    print("|---|---|---|---|---|")
    for way in ways:
        z = np.array(off[way])
        held = [float(np.mean(np.abs(z[:, part]) < 1.96)) for part in (slice(0, 3), slice(3, 6), slice(6, 9))]
        squares = [float(np.mean(z[:, part] ** 2)) for part in (slice(0, 3), slice(3, 6), slice(6, 9))]
        print(
            f"| {way} | {' | '.join(f'{h:.1%}' for h in held)} | {', '.join(f'{s:.2f}' for s in squares)} |"
        )


if __name__ == "__main__":
    main()
