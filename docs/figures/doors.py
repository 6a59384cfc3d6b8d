"""The pictures of the six first pages, from the very commands that stand on them.

    python docs/figures/doors.py            # all, a minute
    python docs/figures/doors.py paper      # one

Each page's commands run in a folder of their own; what they leave has figures, of which one is drawn as for a paper.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(DOCS.parent / "tests"))
sys.path.insert(0, str(DOCS.parent / "tests" / "docs"))
from test_tutorials import run_page  # noqa: E402  (found where the lines above say)

from tumble.report.figures.paper import draw_page  # noqa: E402  (as above)

# Page -> the page that its commands leave, and the figure that shows what came out.
PICTURES = {
    "arduino": ("board/calibration/report.html", "holds"),
    "ros": ("robot/report.html", "turns"),
    "drone": ("drone/report.html", "poses"),
    "table": ("plate/calibration/report.html", "holds"),
    "fleet": ("out/table.html", "group-0"),
    "paper": ("trial/calibration/report.html", "interval-1"),
}


def draw(door: str) -> Path:
    """Run the commands of a page and draw its picture; return where it is."""
    made, figure = PICTURES[door]
    with tempfile.TemporaryDirectory() as folder:
        run_page(f"start/{door}.md", Path(folder))
        drawn = {path.stem: path for path in draw_page(Path(folder) / made, "svg")}
        target = DOCS / "figures" / f"door-{door}.svg"
        target.write_bytes(drawn[figure].read_bytes())
    return target


if __name__ == "__main__":
    for name in sys.argv[1:] or PICTURES:
        sys.stdout.write(f"{draw(name)}\n")
