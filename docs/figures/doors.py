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
import test_tutorials  # noqa: E402  (found where the lines above say)

from tumble.report import batch_page, write_figures  # noqa: E402  (as above)
from tumble.workflows import run_batch  # noqa: E402  (as above)

# Page -> the folder that its commands leave, and the figure that shows what came out.
PICTURES = {
    "arduino": ("board/calibration", "holds"),
    "ros": ("robot", "turns"),
    "drone": ("drone", "poses"),
    "table": ("plate/calibration", "holds"),
    "fleet": ("out", "group-0"),
    "paper": ("trial/calibration", "interval-1"),
}
commands_of = test_tutorials.commands_of


def with_figures(page: str) -> list[tuple[str, list[str]]]:
    """Return a page's commands, calibrations with their figures."""
    return [
        (f"{command} --figures svg" if " calibrate " in command else command, shown)
        for command, shown in commands_of(page)
    ]


def draw(door: str) -> Path:
    """Run the commands of a page and draw its picture; return where it is."""
    made, figure = PICTURES[door]
    with tempfile.TemporaryDirectory() as folder:
        test_tutorials.commands_of = with_figures
        test_tutorials.run_page(f"start/{door}.md", Path(folder))
        drawn = Path(folder) / made / "figures"
        if door == "fleet":
            # What is done already is read, not made again.
            batch = run_batch(str(Path(folder) / "lot"), drawn.parent)
            write_figures(batch_page(batch).figures, drawn, "svg")
        target = DOCS / "figures" / f"door-{door}.svg"
        target.write_bytes((drawn / f"{figure}.svg").read_bytes())
    return target


if __name__ == "__main__":
    for name in sys.argv[1:] or PICTURES:
        sys.stdout.write(f"{draw(name)}\n")
