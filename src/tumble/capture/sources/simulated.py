"""A simulated unit in the hand of a simulated person who follows the guide: to try it without hardware."""

from __future__ import annotations

import re
from collections.abc import Iterator

from tumble.capture.simulated_person import Flaws, SimulatedPerson
from tumble.capture.source import Piece, Source, SourceOptions
from tumble.errors import UsageError
from tumble.simulation.grades import find_grade

# A person as persons are.
USUAL = Flaws(too_short=0.05, creeping=0.05, unplugged=0.02)


def simulate(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what a simulated unit sends; the iterator hears the guide, as a listener.

    Parameters
    ----------
    address : name of the grade, with ``@SEED`` behind it for another unit, and ``@SPEED`` behind that.
    options : nothing of them.

    Raises
    ------
    UsageError
        If there is no such grade, or what is behind it is no number.
    """
    found = re.fullmatch(r"([^@]*)(?:@(\d+))?(?:@(\d+\.?\d*))?", address)
    if found is None:
        raise UsageError(f"simulated:{address}: write simulated:GRADE@SEED@SPEED, the seed a whole number.")
    grade = find_grade(found[1] or "consumer-mems")
    return SimulatedPerson(grade, int(found[2] or 0), flaws=USUAL, speed=float(found[3] or 1.0))


SOURCE = Source(
    "simulated",
    "a simulated unit and person, @SEED@SPEED behind it",
    "simulated:consumer-mems",
    simulate,
)
