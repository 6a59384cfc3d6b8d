"""A simulated unit in the hand of a simulated person who follows the guide: to try it without hardware."""

from __future__ import annotations

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
    address : name of the grade, with ``@SEED`` behind it for another unit.
    options : with the speed.

    Raises
    ------
    UsageError
        If there is no such grade, or the seed is no number.
    """
    name, _, seed = address.partition("@")
    if seed and not seed.isdigit():
        raise UsageError(f"simulated:{address}: the seed behind @ is a whole number.")
    return SimulatedPerson(
        find_grade(name or "consumer-mems"), int(seed or 0), flaws=USUAL, speed=options.speed
    )


SOURCE = Source("simulated", "a simulated unit and person, at --speed", "simulated:consumer-mems", simulate)
