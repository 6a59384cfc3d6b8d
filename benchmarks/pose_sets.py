"""Is any nine of the 26 directions better than the paper's nine in every unknown? All 3,124,550 are tried.

    python benchmarks/pose_sets.py

Prints how many sets are better, how many are as good, and the least largest ratio of a sigma to that of
the nine poses of Zhang et al. (2010). Takes some ten seconds.
"""

from __future__ import annotations

import itertools
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from tumble.attitude.directions import twenty_six_directions
from tumble.design.pose_sets import information, paper_nine

AT_ONCE = 40000
# Logarithm of the determinant of the information: below, a sigma is hundreds of times a dwell's.
SINGULAR = -18.0


def main() -> None:
    began = time.perf_counter()
    of_one = np.array([information(up[None], 1.0, 1.0) for up in twenty_six_directions()])
    paper = np.diag(np.linalg.inv(information(paper_nine(), 1.0, 1.0)))
    sets = itertools.combinations(range(26), 9)
    tried = better = alike = 0
    least = np.inf
    while (chosen := np.array(list(itertools.islice(sets, AT_ONCE)), dtype=int)).size:
        total = of_one[chosen].sum(axis=1)
        sign, size = np.linalg.slogdet(total)
        told = total[(sign > 0) & (size > SINGULAR)]
        ratios = np.sqrt(np.diagonal(np.linalg.inv(told), axis1=1, axis2=2) / paper)
        worst = ratios.max(axis=1)
        tried += len(chosen)
        better += int(np.sum(worst < 1.0 - 1e-9))
        alike += int(np.sum(np.abs(worst - 1.0) < 1e-9))
        least = min(least, float(worst.min()))
    seconds = time.perf_counter() - began
    print(f"{tried} sets, {better} better in every unknown, {alike} as good in the worst; least {least:.6f}")
    print(f"{seconds:.0f} s")


if __name__ == "__main__":
    main()
