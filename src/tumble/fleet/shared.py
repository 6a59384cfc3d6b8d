"""What units that failed or stand out have in common: a lot, a table, an operator, a day."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

FALSE_ALARM = 0.01
"""Chance that anything is said where nothing is shared."""
# Of a column with more values than this, none is a lot.
_MOST_VALUES = 50


def find_shared(bad: Sequence[bool], columns: Mapping[str, Sequence[str]]) -> list[str]:
    """Return sentences about values of columns that bad units have more often than by chance.

    Fisher's exact test, one side, over all values that two bad units share (Bonferroni).

    Parameters
    ----------
    bad : (n,) whether each unit failed or stands out.
    columns : what the manifest says of each unit, by the column's name.
    """
    from scipy.stats import hypergeom

    flags = np.asarray(bad, dtype=bool)
    total, count = len(flags), int(np.sum(flags))
    cases: list[tuple[str, str, int, int]] = []
    for column, values in columns.items():
        known = {value for value in values if value}
        if 1 < len(known) <= _MOST_VALUES or (len(known) == 1 and "" in values):
            for value in sorted(known):
                has = np.array([one == value for one in values])
                both = int(np.sum(has & flags))
                if both >= 2:
                    cases.append((column, value, both, int(np.sum(has))))
    said: list[tuple[float, str]] = []
    for column, value, both, has in cases:
        chance = float(hypergeom.sf(both - 1, total, has, count))
        if chance < FALSE_ALARM / len(cases):
            words = (
                f"Of the {count} units that are not accepted or stand out {both} have {column} {value!r}, as "
                f"{has} of all {total} have (probability by chance {chance:.1g})."
            )
            said.append((chance, words))
    return [words for _, words in sorted(said)]
