"""What tumble survives: ``python -m tests.faults [--kills 200] [--pairs 20] [--hostile PATTERN]``.

Runs that are killed or stopped at random moments, disks that refuse to write, two programs that write the same results
at once, and files that once hung or filled the memory (``--hostile '*'`` tries all, ``--hostile`` with a pattern some).
"""

from __future__ import annotations

import argparse
from fnmatch import fnmatch

from tests.faults import hostile
from tests.faults.kills import cut_short, kills, writers


def main() -> int:
    """Run, print counts and what was wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=200, help="how many runs are killed or stopped")
    parser.add_argument("--pairs", type=int, default=20, help="how many pairs write at once")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--hostile", metavar="PATTERN", help="try the hostile files of such names instead")
    wanted = parser.parse_args()
    wrong = _hostile(wanted.hostile) if wanted.hostile else _faults(wanted)
    print("\n".join(wrong) or "nothing is wrong")
    return min(len(wrong), 1)


def _faults(wanted: argparse.Namespace) -> list[str]:
    ended, wrong = kills(wanted.kills, wanted.seed)
    print(f"{wanted.kills} runs killed or stopped over earlier results, {len(wrong)} wrong")
    print("".join(f"  {how}: {count}\n" for how, count in sorted(ended.items())), end="")
    runs, more = cut_short()
    print(f"{runs} runs on a disk that takes no more, {len(more)} wrong")
    pairs, most = writers(wanted.pairs)
    print(f"{pairs} pairs that wrote the same results at once, {len(most)} wrong")
    return wrong + more + most


def _hostile(pattern: str) -> list[str]:
    names = [name for name in hostile.CASES if fnmatch(name, pattern)]
    slowest, largest, wrong = (0.0, ""), (0, ""), list[str]()
    for name in names:
        end = hostile.ended(name)
        faults = end.faults()
        print(
            f"{end.status} {end.seconds:5.1f} s {end.megabytes:5d} MB  {name}: {end.said.strip()[:200]}",
            flush=True,
        )
        wrong += [f"{name}: {fault}" for fault in faults]
        slowest, largest = max(slowest, (end.seconds, name)), max(largest, (end.megabytes, name))
    print(
        f"{len(names)} hostile files and calls, {len(wrong)} wrong; the slowest took {slowest[0]:.1f} s of processor "
        f"time ({slowest[1]}), the largest {largest[0]} MB ({largest[1]})"
    )
    return wrong


if __name__ == "__main__":
    raise SystemExit(main())
