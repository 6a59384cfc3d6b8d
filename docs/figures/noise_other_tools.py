"""What imu_utils' and allan_variance_ros' numbers are, read off simulated gyros whose terms are known.

    python docs/figures/noise_other_tools.py

Simulates three axes twice, without and with a rate random walk, draws the Allan curve of x with what each
tool reads off it (noise-other-tools.svg), and puts the table of numbers between its marks in
docs/noise-other-tools.md. The tools' readings are their definitions, written here anew.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER))
from expected_uncertainty import opening  # noqa: E402

from tumble.noise import (  # noqa: E402
    Deviation,
    NoiseFit,
    NoiseModel,
    allan_deviation,
    fit_curve,
)

PAGE = FOLDER.parent / "noise-other-tools.md"
RATE, SECONDS = 200.0, 7200.0
WIDTH, HEIGHT = 380, 280
MILLI = 1e3
KINDS = {
    "no rate random walk": NoiseModel(random_walk=1e-4, bias_instability=3e-5),
    "a rate random walk": NoiseModel(random_walk=1e-4, bias_instability=3e-5, rate_random_walk=3e-6),
}
# N and K of x, y and z over those above
AXES = ((1.0, 1.0), (1.3, 0.8), (0.9, 1.2))
COLOURS = {"truth": "#111", "found": "#1f6fb2", "imu_utils": "#b3471b", "allan_variance_ros": "#7a4fa3"}


def of_axis(model: NoiseModel, axis: int) -> NoiseModel:
    """The noise of one of the three axes."""
    white, walk = AXES[axis]
    return NoiseModel(
        random_walk=white * model.random_walk,
        bias_instability=model.bias_instability,
        rate_random_walk=walk * model.rate_random_walk,
    )


def white_per_sample(tau: np.ndarray, sigma: np.ndarray) -> float:
    """imu_utils' gyr_n: the deviation at 1 s times the square root of the rate."""
    return float(np.sqrt(RATE) * np.exp(np.interp(0.0, np.log(tau), np.log(sigma))))


def walk_at_three(tau: np.ndarray, sigma: np.ndarray) -> float:
    """allan_variance_ros' random walk: a line of slope 1/2 through the whole curve, in the logarithm, at 3 s."""
    return float(np.exp(np.mean(np.log(sigma) - 0.5 * np.log(tau / 3.0))))


def rows(kind: str, model: NoiseModel, curve: Deviation, fits: list[NoiseFit]) -> list[str]:
    """Lines of the table for one kind of unit."""
    known = curve.edf[:, 0] > 10.0
    tau = curve.tau[known]
    sigma = curve.deviation[known]
    truth = [of_axis(model, k) for k in range(3)]
    walks = [walk_at_three(tau, sigma[:, k]) for k in range(3)]
    seen = fits[0].model
    limit = fits[0].limits.get("K")
    of_k = f"< {MILLI * limit:.2g}, not seen" if limit else f"{MILLI * seen.rate_random_walk:.3g}"
    numbers = [
        (
            "imu_utils `gyr_n`, x",
            white_per_sample(tau, sigma[:, 0]),
            "N √rate",
            np.sqrt(RATE) * truth[0].random_walk,
        ),
        ("imu_utils `gyr_w`, x", float(sigma[:, 0].min()), "K", truth[0].rate_random_walk),
        (
            "allan_variance_ros `gyroscope_random_walk`, worst axis",
            max(walks),
            "K of that axis",
            truth[int(np.argmax(walks))].rate_random_walk,
        ),
    ]
    lines = [
        f"| {kind} | {name} | {MILLI * value:.3g} | {what} | {MILLI * right:.3g} |"
        for name, value, what, right in numbers
    ]
    lines += [
        f"| {kind} | tumble N, x | {MILLI * seen.random_walk:.3g} | N | {MILLI * truth[0].random_walk:.3g} |",
        f"| {kind} | tumble B, x | {MILLI * seen.bias_instability:.3g} | B | {MILLI * truth[0].bias_instability:.3g} |",
        f"| {kind} | tumble K, x | {of_k} | K | {MILLI * truth[0].rate_random_walk:.3g} |",
    ]
    return lines


def panel(kind: str, model: NoiseModel, curve: Deviation, left: float) -> list[str]:
    """The curve of x with what the tools read off it."""
    top = 92.0
    x_ticks, y_ticks = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0), (0.01, 0.1, 1.0)
    low, high = np.log10([x_ticks[0], x_ticks[-1]]), np.log10([y_ticks[0], y_ticks[-1]])

    def x(tau: float) -> float:
        return left + WIDTH * float((np.log10(tau) - low[0]) / (low[1] - low[0]))

    def y(sigma: float) -> float:
        return top + HEIGHT * float(1.0 - (np.log10(MILLI * sigma) - high[0]) / (high[1] - high[0]))

    parts = [f'<text x="{left}" y="{top - 12}" font-weight="600">{kind[0].upper() + kind[1:]}</text>']
    for tick in x_ticks:
        parts.append(f'<path d="M{x(tick):.1f} {top}v{HEIGHT}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{x(tick):.1f}" y="{top + HEIGHT + 16}" text-anchor="middle">{tick:g}</text>')
    for tick in y_ticks:
        parts.append(f'<path d="M{left} {y(tick / MILLI):.1f}h{WIDTH}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{left - 6}" y="{y(tick / MILLI) + 4:.1f}" text-anchor="end">{tick:g}</text>')
    parts.append(
        f'<text x="{left + WIDTH / 2}" y="{top + HEIGHT + 34}" text-anchor="middle">averaging time, s</text>'
    )
    known = curve.edf[:, 0] > 10.0
    tau, sigma = curve.tau[known], curve.deviation[known, 0]

    def stroke(along: np.ndarray, up: np.ndarray, colour: str, extra: str = "") -> str:
        path = "L".join(f"{x(a):.1f} {y(b):.1f}" for a, b in zip(along, up, strict=True))
        return f'<path clip-path="url(#c{left:g})" d="M{path}" fill="none" stroke="{colour}" stroke-width="2"{extra}/>'

    parts.append(
        f'<clipPath id="c{left:g}"><rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}"/></clipPath>'
    )
    parts.append(
        stroke(
            tau,
            np.sqrt(of_axis(model, 0).allan_variance(tau, RATE)),
            COLOURS["truth"],
            ' stroke-dasharray="6 4"',
        )
    )
    parts.append(stroke(tau, sigma, COLOURS["found"]))
    walk = walk_at_three(tau, sigma)
    ends = np.array([tau[0], tau[-1]])
    parts.append(stroke(ends, walk * np.sqrt(ends / 3.0), COLOURS["allan_variance_ros"]))
    for at, value, colour, text in (
        (1.0, white_per_sample(tau, sigma) / np.sqrt(RATE), COLOURS["imu_utils"], "gyr_n/√rate"),
        (float(tau[np.argmin(sigma)]), float(sigma.min()), COLOURS["imu_utils"], "gyr_w"),
        (3.0, walk, COLOURS["allan_variance_ros"], "random_walk"),
    ):
        parts.append(f'<circle cx="{x(at):.1f}" cy="{y(value):.1f}" r="5" fill="{colour}"/>')
        side, anchor = (-8, "end") if colour == COLOURS["imu_utils"] else (10, "start")
        place = f'x="{x(at) + side:.1f}" y="{y(value) + 18:.1f}" text-anchor="{anchor}"'
        parts.append(f'<text {place} fill="{colour}">{text}</text>')
    return parts


def main() -> None:
    """Simulate, draw and write."""
    table = ["| simulated unit | number | value | taken for | which truly is |", "|---|---|---|---|---|"]
    parts: list[str] = []
    for place, (kind, model) in enumerate(KINDS.items()):
        rng = np.random.default_rng(7)
        count = int(SECONDS * RATE)
        signals = np.column_stack([of_axis(model, k).simulate(count, RATE, rng) for k in range(3)])
        curve = allan_deviation(signals, RATE, taus="log")
        octaves = allan_deviation(signals, RATE)
        fits = [fit_curve(octaves, k) for k in range(3)]
        table += rows(kind, model, curve, fits)
        parts += panel(kind, model, curve, 70.0 + place * (WIDTH + 70.0))
    title = "What the tools read off the Allan curve of a gyro whose terms are known"
    legend: list[str] = []
    along = 16
    for name, text in (
        ("truth", "true model"),
        ("found", "Allan deviation, mrad/s"),
        ("imu_utils", "imu_utils"),
        ("allan_variance_ros", "allan_variance_ros: line of slope ½"),
    ):
        dash = ' stroke-dasharray="6 4"' if name == "truth" else ""
        legend.append(f'<path d="M{along} 44h26" stroke="{COLOURS[name]}" stroke-width="2.5"{dash}/>')
        legend.append(f'<text x="{along + 32}" y="48">{text}</text>')
        along += 60 + 7 * len(text)
    head = [
        *opening(2 * WIDTH + 170, HEIGHT + 136, title),
        f'<text x="16" y="24" font-size="16" font-weight="600">{title}</text>',
    ]
    figure = "\n".join([*head, *legend, *parts, "</svg>"]) + "\n"
    (FOLDER / "noise-other-tools.svg").write_text(figure, encoding="utf-8")
    start, stop = "<!-- table: begin -->\n", "<!-- table: end -->"
    before, rest = PAGE.read_text(encoding="utf-8").split(start)
    PAGE.write_text(before + start + "\n".join(table) + "\n" + stop + rest.split(stop)[1], encoding="utf-8")


if __name__ == "__main__":
    main()
