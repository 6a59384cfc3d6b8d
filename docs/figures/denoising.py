"""What de-noising does to the start of a turn, to an Allan deviation and to an angle: simulated and drawn.

    python docs/figures/denoising.py

Writes denoising-signal.svg (a turn; the Allan deviation at rest) and denoising-angle.svg (how far the angle
of a gyro is off, at rest and turned too slowly to be seen). The numbers on the page are those of
benchmarks/denoising.py.
"""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER))
from expected_uncertainty import opening  # noqa: E402

from tumble.noise.denoising.level_filter import fit_level_filter  # noqa: E402
from tumble.noise.denoising.shrinkage import Shrinkage, choose_level, denoise_signal  # noqa: E402
from tumble.noise.deviation import allan_deviation  # noqa: E402

RATE = 100.0
COLOURS = {
    "as recorded": "#9aa3ab",
    "truth": "#111",
    "wavelets": "#1f6fb2",
    "autoregression": "#2d7d46",
    "low-pass": "#b3471b",
}
WIDTH, HEIGHT = 380, 250
RUNS = 100


def panel(lines, x0, y0, title, x, y, *, log=False, points=()):
    """One panel: lines of (name, x, y, dash), axes (label, ticks), limits taken from the ticks."""
    (x_label, x_ticks), (y_label, y_ticks) = x, y
    scale = np.log10 if log else np.asarray
    x_low, x_high = float(scale(x_ticks[0])), float(scale(x_ticks[-1]))
    y_low, y_high = float(scale(y_ticks[0])), float(scale(y_ticks[-1]))

    def place(a, b):
        return (
            x0 + WIDTH * (scale(a) - x_low) / (x_high - x_low),
            y0 + HEIGHT * (1.0 - (scale(b) - y_low) / (y_high - y_low)),
        )

    parts = [f'<text x="{x0}" y="{y0 - 12}" font-weight="600">{title}</text>']
    for tick in x_ticks:
        at = float(place(tick, y_ticks[0])[0])
        parts.append(f'<path d="M{at:.1f} {y0}v{HEIGHT}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{at:.1f}" y="{y0 + HEIGHT + 16}" text-anchor="middle">{tick:g}</text>')
    for tick in y_ticks:
        at = float(place(x_ticks[0], tick)[1])
        parts.append(f'<path d="M{x0} {at:.1f}h{WIDTH}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{x0 - 6}" y="{at + 4:.1f}" text-anchor="end">{tick:g}</text>')
    parts.append(f'<text x="{x0 + WIDTH / 2}" y="{y0 + HEIGHT + 34}" text-anchor="middle">{x_label}</text>')
    turned = f'transform="translate({x0 - 44} {y0 + HEIGHT / 2}) rotate(-90)"'
    parts.append(f'<text {turned} text-anchor="middle">{y_label}</text>')
    parts.append(
        f'<clipPath id="c{x0}"><rect x="{x0}" y="{y0}" width="{WIDTH}" height="{HEIGHT}"/></clipPath>'
    )
    for name, along, up, dash in lines:
        places = np.column_stack(place(along, up))
        path = "L".join(f"{a:.1f} {b:.1f}" for a, b in places)
        parts.append(
            f'<path clip-path="url(#c{x0})" d="M{path}" fill="none" stroke="{COLOURS[name]}" '
            f'stroke-width="{1.2 if name == "as recorded" and not log else 2}"{dash}/>'
        )
    return parts


def legend(names, y):
    """Names beside strokes of their colours."""
    parts, x = [], 16
    for name, text in names:
        parts.append(f'<path d="M{x} {y - 4}h26" stroke="{COLOURS[name]}" stroke-width="2.5"/>')
        parts.append(f'<text x="{x + 32}" y="{y}">{text}</text>')
        x += 52 + 7 * len(text)
    return parts


def write(name, title, parts, names):
    """One figure of two panels with a title and a legend."""
    head = [
        *opening(2 * WIDTH + 190, HEIGHT + 136, title),
        f'<text x="16" y="24" font-size="16" font-weight="600">{title}</text>',
        *legend(names, 48),
    ]
    (FOLDER / name).write_text("\n".join([*head, *parts, "</svg>"]) + "\n", encoding="utf-8")


def draw_signal() -> None:
    """A turn of 90° in 2 s beside rests of a minute, and the Allan deviation of half an hour at rest."""
    rng = np.random.default_rng(4)
    time = np.arange(12_000) / RATE - 60.0
    share = np.clip(time / 2.0, 0.0, 1.0)
    truth = math.pi / 4.0 * 0.5 * np.pi * np.sin(math.pi * share)
    seen = truth + 0.02 * rng.standard_normal(time.size)
    rest = [(0, 5990), (6210, 12_000)]
    whole = [(0, time.size)]
    level = choose_level(seen, RATE, rest).level
    quiet = denoise_signal(seen, whole, rest, level).signal
    low = denoise_signal(seen, whole, rest, 6, Shrinkage("remove")).signal
    near = (time > -0.6) & (time < 0.8)
    lines = [
        (name, time[near], each[near], "")
        for name, each in (("as recorded", seen), ("low-pass", low), ("truth", truth), ("wavelets", quiet))
    ]
    ticks = (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8)
    parts = panel(
        lines, 66, 92, "The start of a turn", ("s from its start", ticks),
        ("rad/s", (-0.2, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2)),
    )  # fmt: skip
    count = 180_000
    still = 0.02 * rng.standard_normal(count) + 2e-6 * 5.0 * np.cumsum(rng.standard_normal(count))
    rest = [(0, count)]
    level = choose_level(still, RATE, rest).level
    ways = {
        "as recorded": still,
        "wavelets": denoise_signal(still, rest, rest, level).signal,
        "autoregression": fit_level_filter(still, rest, 1 << level).follow(still, rest),
    }
    lines = []
    for name, each in ways.items():
        curve = allan_deviation(each, RATE)
        keep = (curve.tau < 300.0) & (1e3 * curve.deviation[:, 0] > 1e-3)
        lines.append((name, curve.tau[keep], 1e3 * curve.deviation[keep, 0], ""))
    parts += panel(
        lines, 2 * 66 + WIDTH + 20, 92, "Allan deviation at rest", ("averaging time, s", (0.01, 0.1, 1, 10, 100)),
        ("mrad/s", (0.001, 0.01, 0.1, 1, 10, 100)), log=True,
    )  # fmt: skip
    names = [(n, n) for n in ("as recorded", "wavelets", "autoregression")]
    names += [("low-pass", "6 levels removed"), ("truth", "truth")]
    write(
        "denoising-signal.svg",
        "Motion above the noise stays; what is slower than the filter stays too",
        parts,
        names,
    )


def draw_angle() -> None:
    """Errors of the angle as in benchmarks/denoising.py, at more instants."""
    density, calm, count = 1e-4, 2000, 8000
    instants = np.unique(np.concatenate([np.geomspace(20, 6000, 30), np.linspace(100, 1500, 57)]).astype(int))
    clock = (np.arange(count) - calm) / RATE
    turn = np.where((clock >= 5.0) & (clock < 7.0), 5e-4, 0.0)
    truth = np.cumsum(turn[calm:])[instants - 1] / RATE
    spread: dict[str, list[np.ndarray]] = {}
    shift: dict[str, list[np.ndarray]] = {}
    for run in range(RUNS):
        noise = density * np.sqrt(RATE) * np.random.default_rng([run, 9]).standard_normal(count)
        for moved in (False, True):
            signal = noise + (turn if moved else 0.0)
            rest = [(0, count)]
            level = choose_level(signal, RATE, rest).level
            ways = {
                "as recorded": signal,
                "wavelets": denoise_signal(signal, rest, rest, level).signal,
                "autoregression": fit_level_filter(signal, rest, 1 << level).follow(signal, rest),
            }
            for name, each in ways.items():
                angle = np.cumsum(each[calm:] - each[:calm].mean())[instants - 1] / RATE
                store = shift if moved else spread
                store.setdefault(name, []).append(1e6 * (angle - (truth if moved else 0.0)))
    seconds = instants / RATE
    lines = [(name, seconds, np.std(rows, axis=0, ddof=1), "") for name, rows in spread.items()]
    theory = 1e6 * density * np.sqrt(seconds + seconds**2 / 20.0)
    lines.append(("truth", seconds, theory, ' stroke-dasharray="4 4"'))
    parts = panel(
        lines, 66, 92, "At rest: standard deviation of the angle",
        ("s after the 20 s that tell the bias", (0.1, 1, 10, 100)),
        ("µrad", (0.1, 1, 10, 100, 1000, 10_000)), log=True,
    )  # fmt: skip
    # The same noise in both: what is left is what the filter does to the turn.
    lines = [
        (name, seconds, np.mean(rows, axis=0) - np.mean(spread[name], axis=0), "")
        for name, rows in shift.items()
    ]
    parts += panel(
        lines, 2 * 66 + WIDTH + 20, 92, "Turned by 1000 µrad from 5 s to 7 s: mean error it causes",
        ("s after the 20 s that tell the bias", (0, 10, 20, 30, 40, 50, 60)),
        ("µrad", (-1000, -750, -500, -250, 0, 250, 500)),
    )  # fmt: skip
    names = [(n, n) for n in ways] + [("truth", "N √(t + t²/20 s)")]
    write(
        "denoising-angle.svg",
        "A filter takes no random walk off an angle, and may take a motion",
        parts,
        names,
    )


if __name__ == "__main__":
    draw_signal()
    draw_angle()
