"""What tumble survives: ``python -m tests.faults [--kills 200] [--pairs 20]``.

Runs that are killed or stopped at random moments, disks that refuse to write, two programs that write the same results
at once.
"""

import argparse

from tests.faults.kills import cut_short, kills, writers


def main() -> int:
    """Run, print counts and what was wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=200, help="how many runs are killed or stopped")
    parser.add_argument("--pairs", type=int, default=20, help="how many pairs write at once")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    wanted = parser.parse_args()
    wrong = _faults(wanted)
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


if __name__ == "__main__":
    raise SystemExit(main())
