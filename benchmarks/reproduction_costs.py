"""What each item of `tumble reproduce` takes, measured and written where the list of items reads it.

    python benchmarks/reproduction_costs.py [ITEM ...]

Each item is made with one run, then with so many that it takes some seconds (its own number at most for what takes
hours); the line through both is what it takes whatever the runs, and what a run takes. Seconds are of the processor.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tumble.reproduction import Item, find_items

COSTS = Path(__file__).resolve().parents[1] / "src" / "tumble_papers" / "costs.json"
ENOUGH = 3.0  # s


def taken(item: Item, runs: int) -> float:
    """Return what it takes to make an item with so many runs."""
    began = time.process_time()
    item.run(runs, 0)
    return time.process_time() - began


def cost(item: Item) -> tuple[float, float]:
    """Return what an item takes whatever the runs, and a run."""
    item.run(1, 0)  # what is imported and made once is nobody's
    one = taken(item, 1)
    if item.repetitions is None:
        return float(f"{one:.3g}"), 0.0
    runs, more = 1, one
    while more < ENOUGH and runs < 500:
        runs = min(500, 4 * runs)
        more = taken(item, runs)
    each = one if runs == 1 else max(more - one, 0.0) / (runs - 1)
    return float(f"{max(one - each, 0.0):.3g}"), float(f"{each:.3g}")


def main() -> None:
    known = json.loads(COSTS.read_text(encoding="utf-8"))
    for name in sys.argv[1:] or ("hayal", "zhang", "savage"):
        for item in find_items(name):
            known[item.name] = cost(item)
            print(
                f"{item.name:24s} {known[item.name][0]:8.3g} s + {known[item.name][1]:8.3g} s a run",
                flush=True,
            )
            lines = ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(known.items()))
            COSTS.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
