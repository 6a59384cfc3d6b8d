"""Holds that sway more than the others, by name: which, when, by how much, and what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.calibration.equations.observed import Observed
from tumble.calibration.evidence import RestlessHold
from tumble.estimation.balance import Noise

# Up to so many times what the others sway by is not worth a word.
WORTH_A_WORD = 1.5
# Beyond so many times, or where they sway by less than a microradian, the others rest.
OTHERS_REST, NO_SWAY = 100.0, 1e-6  # -, rad
# More are counted, and the worst of them named.
MOST_NAMED = 5


def find_restless(data: Observed, noise: Noise, start: float) -> list[RestlessHold]:
    """Return the holds to which the adjustment gives a sway of their own, in their order.

    Parameters
    ----------
    data, noise : observations and variances of the settled estimate.
    start : s, the recording's first stamp, from which times are counted.
    """
    base, others = data.base, float(np.sqrt(noise["sway"]))
    return [
        RestlessHold(
            k,
            float(base.time[base.head[k, 0]]) - start,
            float(base.time[base.tail[k, 1] - 1]) - start,
            others * float(np.sqrt(times)),
            others,
        )
        for k, times in sorted(noise.factors.get("sway", {}).items())
        if times > WORTH_A_WORD**2
    ]


def restless_remarks(holds: Sequence[RestlessHold]) -> list[str]:
    """Return sentences about holds that sway, the worst named; none without them.

    Parameters
    ----------
    holds : of `find_restless`.
    """
    if not holds:
        return []
    worst = sorted(holds, key=lambda one: -one.sway)[:MOST_NAMED]
    named = "; ".join(_restless_words(one) for one in sorted(worst, key=lambda one: one.hold))
    more = f" (the worst of {len(holds)})" if len(holds) > len(worst) else ""
    subject, again = ("It counts", "it") if len(holds) == 1 else ("They count", "each of them")
    said = (
        f"Not all holds rest alike{more}: {named}. {subject} for less, the others no less for that: support the unit "
        f"firmly, let go of it, and record {again} again."
    )
    return [said]


def _restless_words(one: RestlessHold) -> str:
    """Return which hold it is, when, and by how much it sways."""
    times = one.sway / max(one.others, 1e-300)
    rest = times > OTHERS_REST or one.others < NO_SWAY
    beside = "where the others rest" if rest else f"{times:.2g} times as much as the others"
    return (
        f"hold {one.hold + 1} ({one.start:.1f} to {one.stop:.1f} s) sways by {1e3 * one.sway:.2g} mrad (one sigma), "
        f"{beside}"
    )
