"""Try many cases: ``python -m tests.fuzz --cases 20000 [--from N] [--kind KIND]``."""

import argparse
import resource
import time
from collections import Counter

from tests.fuzz.cases import case_of, outcome


def main() -> int:
    """Run the cases, print counts and findings; returns the number of different findings."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000, help="how many are tried")
    parser.add_argument("--from", type=int, default=0, dest="first", help="number of the first one")
    parser.add_argument("--seed", type=int, default=1, help="of the mutations")
    parser.add_argument("--kind", help="try this kind alone")
    wanted = parser.parse_args()
    tried: Counter[str] = Counter()
    findings: set[str] = set()
    slowest, slow, began = 0.0, -1, time.perf_counter()
    for number in range(wanted.first, wanted.first + wanted.cases):
        case = case_of(number, wanted.seed)
        if wanted.kind not in (None, case.kind):
            continue
        tried[case.kind] += 1
        start = time.perf_counter()
        what = outcome(case)
        taken = time.perf_counter() - start
        slowest, slow = max((slowest, slow), (taken, number))
        if sum(tried.values()) % 2000 == 0:
            print(f"{sum(tried.values())} cases, {len(findings)} different findings so far", flush=True)
        if what is not None and (place := ":".join(what.split(":")[:2])) not in findings:
            findings.add(place)
            print(f"case {number} ({case.kind}, {case.name}): {what}", flush=True)
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    print(", ".join(f"{count} {kind}" for kind, count in sorted(tried.items())))
    print(
        f"{sum(tried.values())} cases in {time.perf_counter() - began:.0f} s, {len(findings)} different findings; the "
        f"slowest, number {slow}, took {slowest:.2f} s; the largest size of the process was {megabytes} MB"
    )
    return len(findings)


if __name__ == "__main__":
    raise SystemExit(min(main(), 1))
