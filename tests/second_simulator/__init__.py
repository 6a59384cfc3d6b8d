"""A second simulator, by another hand: physics and the papers' formulas, numpy alone.

It shares no code with `tumble.simulation`, nor with anything else of the package, so that an estimator and the
project's own simulator cannot agree on the same mistake. What it knows of the project are the documented
conventions (`docs/conventions.md`) and the protocol file (`docs/protocols.md`).
"""

from .procedures import OWN_FAULTS, PROCEDURES
from .recording import RECORD_FAULTS, STATED_FAULTS, Simulation
from .sensors import GRADES, Grade, Unit
from .truth import Truth, named

__all__ = [
    "GRADES",
    "OWN_FAULTS",
    "PROCEDURES",
    "RECORD_FAULTS",
    "STATED_FAULTS",
    "Grade",
    "Simulation",
    "Truth",
    "Unit",
    "named",
]
