"""A procedure as a record, and the procedures that there are: one file of `calibration.procedures` each.

A file of that room is named after its procedure and has its record as `PROCEDURE`. Everything that depends on which
procedures there are is asked of the records: the choice, options, remedies, help, the table in the documentation and
the contract that every procedure is held to.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Literal, NamedTuple

from tumble.errors import UsageError
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.session import Session
    from tumble.earth import Site
    from tumble.protocol import Protocol
    from tumble.segmentation import HoldMeans
    from tumble.segmentation.matching import Matching


FIRST_TRIED = "hand-held"
"""The procedure that is tried first where nobody says what was done."""


class Suits(NamedTuple):
    """Whether a procedure suits a recording that comes without a protocol, and why, in words."""

    fits: bool
    why: str


def _unasked(_: Session) -> Suits:
    return Suits(True, "nothing else suits the recording")


@dataclass(frozen=True, slots=True)
class Procedure:
    """What is known of a recording that was made for it: the estimate of all of them is the joint adjustment.

    Attributes
    ----------
    name : as ``--procedure`` and protocol files have it.
    frame : of the result: ``accelerometer-x``, ``fixture`` or ``mean-gyro``.
    circumstances, needs, gives : a row of the table in the documentation.
    page : of the documentation, beside the table.
    promises : the triads that it is made to determine: of these everything has to be.
    believes_poses : poses of its protocols are believed as well as the protocol says.
    assumes : what was done, of a recording without a protocol: a protocol, and which hold is which step.
    seeks : optional terms that its protocol is made to find, which are then kept.
    example : the named protocol that shows what its protocol file has to say; empty if it needs no file.
    remedy : what makes its uncertainties smaller.
    placement : what to do about the placement that limits it; empty if none does.
    free_turns : turns between its holds are made by hand, and tell the gyros.
    suits : whether it suits a recording of which nobody says what was done.
    otherwise : the procedure that is taken where it does not; empty for those that are never tried.
    run : calibrates by temperatures, which tell the steps of its protocols; None for the joint adjustment.
    """

    name: str
    frame: str
    circumstances: str
    needs: str
    gives: str
    page: str
    promises: tuple[Literal["accelerometers", "gyros"], ...] = ()
    believes_poses: bool = False
    assumes: Callable[[HoldMeans, Site], tuple[Protocol, Matching]] | None = None
    seeks: frozenset[str] = frozenset()
    example: str = ""
    remedy: str = "more holds and turns in more different poses are needed"
    placement: str = ""
    free_turns: bool = True
    suits: Callable[[Session], Suits] = _unasked
    otherwise: str = ""
    run: Callable[[Session], Estimate] | None = None

    @property
    def row(self) -> str:
        """Its row of the table in the documentation."""
        return f"| {self.circumstances} | [{self.name}]({self.page}) | {self.needs} | {self.gives} |"


@cache
def find_procedure(name: str) -> Procedure:
    """Return the procedure of a name.

    Parameters
    ----------
    name : as ``--procedure`` takes it.

    Raises
    ------
    UsageError
        If there is none.
    """
    if name not in KNOWN_PROCEDURES:
        raise UsageError(f"There is no procedure {name!r}: choose one of {', '.join(KNOWN_PROCEDURES)}.")
    module = import_module(f"tumble.calibration.procedures.{name.replace('-', '_')}")
    procedure: Procedure = module.PROCEDURE
    return procedure


def procedure_or_none(name: str) -> Procedure | None:
    """Return the procedure of a name; None of a calibration that another program or a hand has made.

    Parameters
    ----------
    name : as a document has it.
    """
    return find_procedure(name) if name in KNOWN_PROCEDURES else None


def all_procedures() -> list[Procedure]:
    """Return all procedures by name."""
    return [find_procedure(name) for name in KNOWN_PROCEDURES]
