"""Kill many runs: ``python -m tests.faults --kills 200``."""

from __future__ import annotations

import argparse

from tests.faults.kills import findings


def main() -> int:
    """Run, print counts and what was wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    ended, wrong = findings(wanted.kills, wanted.seed)
    for how, count in sorted(ended.items()):
        print(f"{how}: {count}")
    print("\n".join(wrong) or f"{wanted.kills} runs ended early, nothing lost")
    return min(len(wrong), 1)


if __name__ == "__main__":
    raise SystemExit(main())
