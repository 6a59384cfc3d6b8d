"""What a norm tells of each kind of parameter, and what sets of poses leave unknown: maps of the sphere.

    python docs/figures/norm_sensitivity.py

writes norm-sensitivity.svg and norm-after-calibration.svg: every direction that can point up, on two
hemispheres in Lambert's azimuthal equal-area projection. A shade is a class of the scale below it. And it
puts the table of sets between its marks in docs/poses.md.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.poses import describe_direction
from tumble.design.optimal_sets import find_best_on_sphere, find_best_subset
from tumble.design.pose_sets import chatfield_orientations, information, paper_nine, predict_sigma
from tumble.design.sensitivity import norm_sensitivity
from tumble.units import STANDARD_GRAVITY

FOLDER = Path(__file__).resolve().parent
# Light to dark in even steps of lightness: a grey copy reads the same.
SHADES = ("#f4f8fb", "#d8e6f1", "#b9d2e6", "#93b9d8", "#6a9cc6", "#437db0", "#275e93", "#123f6e")
RINGS, TURNS = 36, 180
RADIUS = 88.0
# From this side all faces are off the rim, and all edges: nothing is drawn twice.
FRONT = np.array([0.80, 0.50, 0.33])
SECOND = math.pi / 648000.0
Shown = Callable[[np.ndarray], np.ndarray]


class Hemisphere:
    """Half of the sphere as seen from outside, around `towards`, drawn about (x, y)."""

    def __init__(self, towards: np.ndarray, x: float, y: float) -> None:
        self.towards = towards / np.linalg.norm(towards)
        self.right = np.cross([0.0, 0.0, 1.0], self.towards)
        self.right /= np.linalg.norm(self.right)
        self.above = np.cross(self.towards, self.right)
        self.x, self.y = x, y

    def directions(self, radius: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Return unit vectors at these distances (of 1) and angles on the map."""
        off = 2.0 * np.arcsin(radius / math.sqrt(2.0))
        flat = np.cos(turn)[..., None] * self.right + np.sin(turn)[..., None] * self.above
        return np.cos(off)[..., None] * self.towards + np.sin(off)[..., None] * flat

    def at(self, up: np.ndarray) -> tuple[float, float] | None:
        """Return where a unit vector is drawn; None if it is on the other half."""
        if up @ self.towards < -1e-9:
            return None
        # Equal areas: √2 sin(half the angle) from the middle.
        reach = RADIUS / math.sqrt(1.0 + float(up @ self.towards))
        return self.x + reach * float(up @ self.right), self.y - reach * float(up @ self.above)

    def cells(self, shown: Shown, top: float) -> list[str]:
        """Return the shades: in each ring one piece for each stretch of one class."""
        by_shade: dict[int, list[str]] = {}
        edges = np.linspace(0.0, 1.0, RINGS + 1)
        turns = (np.arange(TURNS) + 0.5) * 2.0 * np.pi / TURNS
        for inner, outer in itertools.pairwise(edges):
            values = shown(self.directions(np.full(TURNS, 0.5 * (inner + outer)), turns))
            shades = np.minimum((values / top * len(SHADES)).astype(int), len(SHADES) - 1)
            starts = [0, *(np.flatnonzero(np.diff(shades)) + 1).tolist(), TURNS]
            for start, end in itertools.pairwise(starts):
                by_shade.setdefault(int(shades[start]), []).append(self._piece(inner, outer, start, end))
        return [
            f'<path d="{"".join(by_shade[shade])}" fill="{SHADES[shade]}" stroke="{SHADES[shade]}" '
            'stroke-width="0.5"/>'
            for shade in sorted(by_shade)
        ]

    def _piece(self, inner: float, outer: float, start: int, end: int) -> str:
        if end - start > TURNS // 4:  # the middle of a longer arc is not well told by rounded ends
            half = (start + end) // 2
            return self._piece(inner, outer, start, half) + self._piece(inner, outer, half, end)
        first, last = (2.0 * math.pi * turn / TURNS for turn in (start, end))

        def point(radius: float, turn: float) -> str:
            x, y = radius * RADIUS * math.cos(turn), radius * RADIUS * math.sin(turn)
            return f"{self.x + x:.1f} {self.y - y:.1f}"

        out, back = f"{outer * RADIUS:.2f}", f"{inner * RADIUS:.2f}"
        return (
            f"M{point(outer, first)}A{out} {out} 0 0 0 {point(outer, last)}"
            f"L{point(inner, last)}A{back} {back} 0 0 1 {point(inner, first)}Z"
        )

    def lines(self) -> list[str]:
        """Return the rim and the planes of two axes."""
        turn = np.linspace(0.0, 2.0 * np.pi, 181)
        parts = [f'<circle cx="{self.x}" cy="{self.y}" r="{RADIUS}" fill="none" stroke="#444"/>']
        for axis in range(3):
            circle = np.insert(np.column_stack([np.cos(turn), np.sin(turn)]), axis, 0.0, axis=1)
            inside = circle @ self.towards >= 0.0
            # Begin behind the map, so that the part before it is one line.
            first = int(np.argmin(inside))
            points = [self.at(up) for up in np.roll(circle[:-1], -first, axis=0)]
            path = " ".join(f"{p[0]:.1f},{p[1]:.1f}" for p in points if p)
            parts.append(f'<polyline points="{path}" fill="none" stroke="#444" stroke-width="0.6"/>')
        return parts

    def marks(self, directions: np.ndarray, names: list[str]) -> list[str]:
        """Return a ring for each pose of this half, with its name."""
        parts: list[str] = []
        for up, name in zip(directions, names, strict=True):
            place = self.at(up)
            if place is None:
                continue
            x, y = place
            parts.append(
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="7.5" fill="#fff" stroke="#000" stroke-width="1.3"/>'
                f'<text x="{x:.1f}" y="{y + 3.4:.1f}" text-anchor="middle" font-size="9.5">{name}</text>'
            )
        return parts

    def axis_names(self) -> list[str]:
        """Return the names of the faces of this half beside them, with a light rim to stand off from any shade."""
        parts: list[str] = []
        for up in twenty_six_directions()[:6]:
            place = self.at(up)
            if place is None:
                continue
            side = -1 if place[0] > self.x + 0.6 * RADIUS else 1
            name = describe_direction(up).removesuffix(" up").replace("-", "−")
            parts.append(
                f'<text x="{place[0] + 10 * side:.1f}" y="{place[1] - 9:.1f}" font-weight="600" stroke="#fff" '
                f'stroke-width="3" paint-order="stroke" text-anchor="{"start" if side > 0 else "end"}">{name}</text>'
            )
        return parts


def panel(
    shown: Shown, top: float, title: str, unit: str, poses: np.ndarray, names: list[str], x: float, y: float
) -> list[str]:
    """Return two hemispheres with their poses, below them the scale."""
    parts = [f'<text x="{x}" y="{y}" font-size="13" font-weight="600">{title}</text>']
    for side, (towards, words) in enumerate(((FRONT, "seen from the front"), (-FRONT, "from behind"))):
        half = Hemisphere(towards, x + RADIUS + side * (2 * RADIUS + 14), y + 16 + RADIUS)
        parts += [*half.cells(shown, top), *half.lines(), *half.marks(poses, names), *half.axis_names()]
        below = half.y + RADIUS + 15
        parts.append(f'<text x="{half.x}" y="{below}" text-anchor="middle" fill="#555">{words}</text>')
    left, width, bar = x + 20, 4 * RADIUS - 26, y + 16 + 2 * RADIUS + 26
    for i, shade in enumerate(SHADES):
        step = width / len(SHADES)
        parts.append(
            f'<rect x="{left + i * step:.1f}" y="{bar}" width="{step:.1f}" height="12" fill="{shade}" '
            'stroke="#444" stroke-width="0.5"/>'
        )
    for i in range(0, len(SHADES) + 1, 2):
        value = top * i / len(SHADES)
        at = left + width * i / len(SHADES)
        parts.append(f'<text x="{at:.1f}" y="{bar + 26}" text-anchor="middle">{value:.3g}</text>')
    parts.append(f'<text x="{left + width / 2:.1f}" y="{bar + 42}" text-anchor="middle">{unit}</text>')
    return parts


def write(name: str, title: str, note: str, panels: list[list[str]], width: float, height: float) -> None:
    """Write one figure."""
    style = 'font-family="system-ui, sans-serif" font-size="12" fill="#222"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" {style}>',
        f"<title>{title}</title>",
        '<rect width="100%" height="100%" fill="#fff"/>',
        f'<text x="16" y="26" font-size="16" font-weight="600">{title}</text>',
        f'<text x="16" y="46" fill="#555">{note}</text>',
        *(part for one in panels for part in one),
        "</svg>",
        "",
    ]
    (FOLDER / name).write_text("\n".join(parts), encoding="utf-8")


def draw_sensitivity() -> None:
    """Draw what one norm tells of a scale factor, a misalignment and a bias, with the paper's nine poses."""

    def told(group: str) -> Shown:
        # Of a norm, not of its square: over twice the norm, which is one here.
        return lambda up: 0.5 * np.abs(getattr(norm_sensitivity(up, np.ones(3), np.zeros(3)), group)[:, 0])

    per_second = 1e6 * SECOND
    maps = (
        (told("scale"), 1.0, "scale factor of x", "µg of the norm per ppm"),
        (
            lambda up: per_second * told("misalignment")(up),
            2.4,
            "misalignment of x to y (yz)",
            "µg of the norm per arc second",
        ),
        (told("bias"), 1.0, "bias of x", "µg of the norm per µg"),
    )
    names = ["1", "2", "3", "4", "5", "6", "7", "9", "11"]
    step = 4 * RADIUS + 14 + 34
    panels = [
        panel(shown, top, title, unit, paper_nine(), names, 16 + i * step, 76)
        for i, (shown, top, title, unit) in enumerate(maps)
    ]
    note = "Of each direction up; of other axes the same, turned. Circles: the nine poses, by Chatfield's numbers."
    write("norm-sensitivity.svg", "What the norm in one pose tells", note, panels, 3 * step + 4, 350)


def draw_after_calibration() -> None:
    """Draw how uncertain the norm of the calibrated triad is in any pose, for four sets of poses."""
    eighteen = chatfield_orientations()
    best = find_best_on_sphere(9, np.random.default_rng(0), criterion="minimax")
    sets = (
        ("the paper's nine", paper_nine()),
        ("nine of the sphere, minimax", best),
        ("twelve edges", twenty_six_directions()[6:18]),
        ("faces and edges, 18", eighteen),
    )
    step, panels = 4 * RADIUS + 14 + 34, []
    for i, (title, poses) in enumerate(sets):
        cofactor = np.linalg.inv(information(poses, 1.0, 1.0))

        def shown(up: np.ndarray, cofactor: np.ndarray = cofactor) -> np.ndarray:
            rows = norm_sensitivity(up, np.ones(3), np.zeros(3)).columns() / 2.0
            return np.sqrt(np.einsum("ni,ij,nj->n", rows, cofactor, rows))

        x, y = 16 + (i % 2) * step, 76 + (i // 2) * 300
        panels.append(
            panel(
                shown, 2.4, title, "sigma of the norm, in that of one dwell", poses, [""] * len(poses), x, y
            )
        )
    note = "By the uncertainty of its nine parameters alone. Circles: the poses that it was calibrated in."
    title = "How uncertain the calibrated norm is in any pose"
    write("norm-after-calibration.svg", title, note, panels, 2 * step + 4, 655)


def tabled_sets() -> dict[str, np.ndarray]:
    """Return the sets of the page's table, by name."""
    directions = twenty_six_directions()
    faces, edges, corners = directions[:6], directions[6:18], directions[18:]
    # A corner and its three neighbours.
    four = corners[np.sum(corners > 0.0, axis=1) >= 2]

    def found(search: Callable[..., np.ndarray], count: int, criterion: str) -> np.ndarray:
        return search(count, np.random.default_rng(0), criterion=criterion)

    return {
        "the paper's nine: faces, an edge in each plane": paper_nine(),
        "nine on the sphere, minimax": found(find_best_on_sphere, 9, "minimax"),
        "nine of the 26, average": found(find_best_subset, 9, "average"),
        "nine on the sphere, average": found(find_best_on_sphere, 9, "average"),
        "ten: faces, a corner and its three neighbours": np.vstack([faces, four]),
        "twelve edges": edges,
        "fourteen: faces and corners": np.vstack([faces, corners]),
        "eighteen: faces and edges": chatfield_orientations(),
        "18 on the sphere, average": found(find_best_on_sphere, 18, "average"),
        "all 26": directions,
    }


def table_lines() -> list[str]:
    """Return the table: sigmas in that of a dwell, and at the paper's 50 µg."""
    lines = [
        "| set | poses | scale, σ | misalignment, σ | bias, σ | ppm | ″ | µg |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, directions in tabled_sets().items():
        relative = predict_sigma(directions, STANDARD_GRAVITY).mean_squares()
        of_gravity = (relative[0], relative[1], relative[2] / STANDARD_GRAVITY)
        shown = [f"{value:.2f}" for value in of_gravity]
        in_units = (50.0, 50e-6 / SECOND, 50.0)
        shown += [f"{value * unit:.1f}" for value, unit in zip(of_gravity, in_units, strict=True)]
        lines.append(f"| {name} | {len(directions)} | " + " | ".join(shown) + " |")
    return lines


def write_table() -> None:
    """Put the table between its marks on the page."""
    page = FOLDER.parent / "poses.md"
    start, end = "<!-- sets -->", "<!-- /sets -->"
    before, _, rest = page.read_text(encoding="utf-8").partition(start)
    table = "\n".join([start, "", *table_lines(), "", end])
    page.write_text(before + table + rest.partition(end)[2], encoding="utf-8")


if __name__ == "__main__":
    draw_sensitivity()
    draw_after_calibration()
    write_table()
