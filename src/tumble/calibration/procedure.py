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
    """A way to estimate from a recorded protocol.

    Attributes
    ----------
    name : as ``--procedure`` and protocol files have it.
    run : calibrates a recording.
    frame : of its model: ``accelerometer-x``, ``fixture`` or ``mean-gyro``.
    circumstances, needs, gives : a row of the table in the documentation.
    page : of the documentation, beside the table.
    takes : of the options ``prior``, ``data_sheet`` and ``unknowns`` those that it uses.
    example : the named protocol that shows what its protocol file has to say; empty if it needs no file.
    remedy : what makes its uncertainties smaller.
    norms_from : what the norms of its holds are expected from, where it is more than the noise.
    placement : what to do about the placement that limits it; empty if none does.
    suits : whether it suits a recording of which nobody says what was done.
    otherwise : the procedure to try next where it does not; empty for the last one, and those that are never tried.
    failed : what is said where it was tried and the recording does not determine enough.
    starts_joint : the joint estimator takes over from its estimate, unless the procedure is asked for by name.
    believes : it takes poses or rates from the protocol, which a plan does not.
    joint_believes : the joint estimator, too, takes the poses of its protocols from them.
    free_turns : turns between its holds are made by hand, and tell the gyros.
    counts_between_holds : its covariance counts what the means of different holds have in common.
    seeks : optional terms of the joint estimator that its protocol is made to find, which are then kept.
    by_temperature : temperatures tell the steps of its protocols, and not poses.
    gyros_from : what the gyros' scale factors are from: ``turns`` whose angles gravity tells, a ``table`` that shows
        angles or keeps rates, known ``rates`` alone; empty where it determines none, or the Earth's rotation does.
    """

    name: str
    run: Callable[[Session], Estimate]
    frame: str
    circumstances: str
    needs: str
    gives: str
    page: str
    takes: frozenset[str] = frozenset()
    example: str = ""
    remedy: str = "more holds and turns in more different poses are needed"
    norms_from: str = ""
    placement: str = ""
    suits: Callable[[Session], Suits] = _unasked
    otherwise: str = ""
    failed: str = ""
    starts_joint: bool = True
    believes: bool = False
    joint_believes: bool = True
    free_turns: bool = True
    counts_between_holds: bool = False
    seeks: frozenset[str] = frozenset()
    by_temperature: bool = False
    gyros_from: Literal["turns", "table", "rates", ""] = ""

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
