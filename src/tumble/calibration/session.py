"""A recording that is to be calibrated, and what is found in it when it is first asked for.

A procedure as a record, and the procedures that there are: what is known about the motion.

Everything that depends on which procedures there are is asked of the records: the choice, options, remedies, help, the
table in the documentation and the contract that every procedure is held to.

Estimators that a paper has and this package does not are asked for by name, and stand beside the joint adjustment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple

from tumble.counting import part
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.recording import Recording
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.equations.observed import BelievedPoses
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.outcome.settled import JointOutcome
    from tumble.calibration.prior import FleetSheet, StableKnowledge
    from tumble.protocol import Protocol
    from tumble.segmentation import HoldMeans, Matching, Rotation, SpinMeans, Timeline
    from tumble.simulation import Grade


FIRST_TRIED = "hand-held"
"""The procedure that is tried first where nobody says what was done."""


class Suits(NamedTuple):
    """Whether a procedure suits a recording that comes without a protocol, and why, in words."""

    fits: bool
    why: str


@dataclass(frozen=True)
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
    by_temperature : temperatures tell the steps of its protocols, and its estimate is a function of them.
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
    suits: Callable[[Session], Suits] = lambda _: Suits(True, "nothing else suits the recording")
    otherwise: str = ""
    by_temperature: bool = False

    @property
    def row(self) -> str:
        """Its row of the table in the documentation."""
        return f"| {self.circumstances} | [{self.name}]({self.page}) | {self.needs} | {self.gives} |"


SMALLEST_TURNS = 5
"""Fewer turns between holds than this do not determine a gyro."""


def _by_hand(session: Session) -> Suits:
    recording, timeline = session.recording, session.timeline
    if recording.specific_force is None or recording.angular_rate is None:
        return Suits(False, "the recording has one triad only")
    turns = sum(turn.usable for turn in timeline.turns)
    if turns < SMALLEST_TURNS:
        return Suits(False, f"{turns} turns between holds can be used, {FIRST_TRIED} needs {SMALLEST_TURNS}")
    return Suits(True, f"{len(timeline.holds)} holds and {turns} turns suffice")


def _faces(means: HoldMeans, site: Site) -> tuple[Protocol, Matching]:
    from tumble.calibration.poses import match_faces

    return match_faces(means, site)


_RECORDS = (
    # Tumbled by hand: rests in many poses, and turns between them that the gyros follow.
    # Nothing is believed but gravity: the accelerometers see it in each hold, and the gyros carry it over each turn.
    Procedure(
        "hand-held",
        "accelerometer-x",
        "nothing but hands",
        "both triads, nine or more poses, five or more turns between them that can be integrated",
        "everything: both triads in full, the rotation between them, g-sensitivity of the gyros if the data want it",
        "hand-held.md",
        promises=("accelerometers", "gyros"),
        suits=_by_hand,
        otherwise="multi-position",
    ),
    # The improved six-position test: the same faces, placed with care and often, for the whole matrix.
    Procedure(
        "improved-six-position",
        "fixture",
        "the same, placed with care",
        "each axis up and down, levelled",
        "the accelerometers' whole matrix, as exactly as the faces are placed",
        "six-position.md",
        promises=("accelerometers",),
        placement="The placement limits the misalignments one to one: repeat the six positions with the "
        "unit placed anew, or use the multi-position procedure, whose non-orthogonalities need no level.",
        believes_poses=True,
        assumes=_faces,
    ),
    # What the protocol's own procedure believes, and the result in the frame of the accelerometers.
    Procedure(
        "joint",
        "accelerometer-x",
        "any of these",
        "what the procedure needs that the recording was made for",
        "the same from one adjustment of everything that was recorded, with a budget of uncertainty",
        "../joint.md",
    ),
    # The traditional laboratory method: known attitudes, known axes (24 positions and a three-axis rotation).
    Procedure(
        "laboratory",
        "fixture",
        "a table levelled and aligned to north",
        "each axis up and down with four headings, three axes turned about both ways",
        "both triads against the table's axes, as exactly as the table is aligned",
        "laboratory.md",
        promises=("accelerometers", "gyros"),
        placement="The table's alignment limits the misalignments one to one, and nothing in the residuals shows it. "
        "The turntable procedure calibrates both triads on the same table without any alignment.",
        example="laboratory",
        believes_poses=True,
        free_turns=False,
    ),
    # Modified multi-position calibration on a single-axis table (Syed et al. 2007; Hayal 2010, 2.4.2.2).
    # The unit leans on the table in poses that nobody has to know, and the table turns about the vertical at
    # known rates.
    Procedure(
        "modified-multi-position",
        "accelerometer-x",
        "a single-axis table and hands",
        "nine or more poses on the table, each spun both ways",
        "both triads in full, and the rotation between them",
        "modified-multi-position.md",
        promises=("accelerometers", "gyros"),
        example="modified-multi-position",
        believes_poses=True,
        free_turns=False,
    ),
    # Many poses that nobody has to know (Shin and El-Sheimy; Hayal 2010): gravity has the same norm in all of them.
    Procedure(
        "multi-position",
        "accelerometer-x",
        "nothing, and a gyro without turns",
        "nine or more poses (six with an earlier calibration); turns do not matter",
        "accelerometers in full; of the gyros what the Earth's rotation and the turns determine",
        "multi-position.md",
        promises=("accelerometers",),
    ),
    # The rotation-rate test (Hayal 2010, 2.4.1.2): a table turns the unit at known rates, both ways, about known axes.
    Procedure(
        "rate-table",
        "fixture",
        "a rate table",
        "each axis up on the table, spun both ways at several rates",
        "gyro biases, scale factors, misalignments against the fixture, linearity and asymmetry; of the accelerometers "
        "what the faces show",
        "rate-table.md",
        promises=("gyros",),
        example="rate-table",
        placement="The placement on the table limits the misalignments one to one. The modified multi-position "
        "procedure finds them from the same table without believing the placement, and calibrates the accelerometers "
        "too.",
        believes_poses=True,
    ),
    # The six-position test (Aggarwal et al. 2008; Hayal 2010, 2.3 to 2.12): each axis up and down, as level as is said.
    Procedure(
        "six-position",
        "fixture",
        "a levelled plate and a cube's faces",
        "each axis up and down, levelled",
        "accelerometer biases and scale factors, and misalignments as exactly as the faces are placed",
        "six-position.md",
        promises=("accelerometers",),
        placement="The placement limits the scale factors and biases: level the plate, use the unit's own flat "
        "faces, and say in the protocol how well (`uncertainty_deg`). The hand-held and multi-position procedures need "
        "no level.",
        believes_poses=True,
        assumes=_faces,
    ),
    # The strapdown rotation test on a two-axis fixture (Savage 2018): rotations from rest to rest.
    # Optional terms are sought: sequences of rotations both ways are made to show asymmetry.
    Procedure(
        "strapdown-rotation",
        "mean-gyro",
        "a fixture with two axes, good to 0.1°",
        "17 sequences of rotations, at rest before and after each; roughly where north is",
        "both triads in full with the asymmetry of their scale factors, and what is between them",
        "strapdown-rotation.md",
        promises=("accelerometers", "gyros"),
        example="strapdown-rotation",
        believes_poses=True,
        seeks=frozenset({"accelerometer_asymmetry", "gyro_asymmetry"}),
    ),
    # Calibration over temperature: rests at several temperatures, in soaks or in a slow sweep (see the room `thermal`).
    Procedure(
        "thermal",
        "accelerometer-x",
        "a chamber, or a fridge",
        "rests at several temperatures, soaked or in a slow sweep, and the sensor's thermometer",
        "accelerometers in full and gyro biases as functions of temperature, its rate and its history",
        "thermal.md",
        remedy="hold nine poses or more at more temperatures",
        promises=("accelerometers",),
        by_temperature=True,
    ),
    # Calibration on a turntable that needs no alignment (Zhang et al. 2010): the angles that it shows are believed.
    Procedure(
        "turntable",
        "accelerometer-x",
        "a table whose angle is read, tilted",
        "nine or more poses at rest, six axes turned about both ways; nothing aligned",
        "both triads in full, the rotation between them; gyros as exactly as the angles",
        "turntable.md",
        promises=("accelerometers", "gyros"),
        example="turntable-9",
        free_turns=False,
    ),
)
PROCEDURES = {record.name: record for record in _RECORDS}
"""All procedures by name."""


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
    if name not in PROCEDURES:
        raise UsageError(f"There is no procedure {name!r}: choose one of {', '.join(PROCEDURES)}.")
    return PROCEDURES[name]


@dataclass(frozen=True)
class Estimator:
    """A paper's own way from a recording to an estimate.

    Attributes
    ----------
    name : as ``--estimator`` takes it.
    title : what it does, in words.
    source : paper and equations.
    estimate : of a recording with what was done, as the paper has it and with the covariance that it gives.
    needs_protocol : rates or angles of a table have to be known.
    """

    name: str
    title: str
    source: str
    estimate: Callable[[Session], Estimate]
    needs_protocol: bool = False


@dataclass(frozen=True)
class Options:
    """What a user says of the estimate.

    Attributes
    ----------
    optional_terms : try g-sensitivity, quadratic terms and the like.
    data_sheet : grade or fleet whose spreads are a prior; None for none.
    """

    optional_terms: bool = True
    data_sheet: Grade | FleetSheet | None = None


def _silent(_: str) -> None:
    """Tell nobody."""


@dataclass
class Session:
    """What a procedure is given.

    What is found in the recording is found when it is first asked for, and may be set instead.

    Attributes
    ----------
    recording : of one unit.
    protocol : what was to be done; None where nobody says.
    given_site : where it was recorded, if that is said; before the protocol's.
    intervals : (start, stop) s of the holds, where they are given instead of found.
    by_temperature : temperatures tell the steps of the protocol, and not poses.
    prior : what an earlier calibration knows.
    options : of the estimate.
    say : called with a sentence on what is being done.
    joint : the settled joint estimate with everything behind it, from where a magnetometer goes on; None before.
    """

    recording: Recording
    protocol: Protocol | None = None
    given_site: Site | None = None
    intervals: Sequence[tuple[float, float]] | None = None
    by_temperature: bool = False
    prior: StableKnowledge | None = None
    options: Options = field(default_factory=Options)
    say: Callable[[str], None] = field(default=_silent)
    joint: JointOutcome | None = None

    @cached_property
    def site(self) -> Site:
        """Where it was recorded: as given, as the protocol says, or anywhere.

        Raises
        ------
        SiteError
            If the gravity that is given contradicts the protocol's latitude.
        """
        given, said = self.given_site, None if self.protocol is None else self.protocol.site
        if given is not None and given.latitude is None and said is not None:
            return said.with_gravity(given)
        return given or said or Site.unknown()

    @cached_property
    def timeline(self) -> Timeline:
        """Holds and turns."""
        from tumble.segmentation import find_thermal_timeline, find_timeline

        find = find_thermal_timeline if self.by_temperature else find_timeline
        return find(self.recording, intervals=self.intervals)

    @cached_property
    def means(self) -> HoldMeans:
        """Means of the holds, with their covariances."""
        from tumble.segmentation import observe_holds

        with part(0.0, 0.3):
            timeline = self.timeline
        with part(0.3, 1.0):
            return observe_holds(self.recording, timeline)

    @cached_property
    def matching(self) -> Matching | None:
        """Which hold and spin is which step of the protocol; None without one, or where temperatures tell the steps."""
        from tumble.segmentation import match_protocol

        if self.protocol is None or self.by_temperature:
            return None
        self.say("matching them with the protocol")
        return match_protocol(self.protocol, self.recording, self.timeline, self.means)

    @property
    def matched(self) -> tuple[Protocol, Matching]:
        """Protocol and matching.

        Raises
        ------
        UsageError
            If there is no protocol.
        """
        if self.protocol is None or self.matching is None:
            raise UsageError("This procedure needs a protocol: give --protocol FILE.")
        return self.protocol, self.matching

    @cached_property
    def spins(self) -> SpinMeans:
        """Means over the whole revolutions of each spin.

        Raises
        ------
        UsageError
            If there is no protocol.
        """
        from tumble.segmentation import observe_matched_spins

        protocol, matching = self.matched
        return observe_matched_spins(protocol, self.recording, matching)

    @cached_property
    def rotations(self) -> list[Rotation]:
        """What the gyros show of each rotation of a table.

        Raises
        ------
        UsageError
            If there is no protocol.
        """
        from tumble.segmentation import observe_rotations

        protocol, matching = self.matched
        return observe_rotations(protocol, self.recording, self.timeline, matching, self.means, self.spins)

    @cached_property
    def alike(self) -> dict[str, float]:
        """Of what gyros are compared with and may be wrong alike, clock and table's rate: one sigma as a share."""
        from tumble.calibration.checks.unseen import unseen_table

        table = None if self.protocol is None else unseen_table(self.protocol)
        return {"clock": self.recording.clock.sigma, "table_rate": 0.0 if table is None else table.sigma}

    def poses_of(self, procedure: Procedure) -> BelievedPoses | None:
        """Return the poses of the protocol that a procedure believes; None where it believes none.

        Parameters
        ----------
        procedure : the record.
        """
        from tumble.calibration.poses import believed_poses

        if not procedure.believes_poses or self.protocol is None or self.matching is None:
            return None
        return believed_poses(self.protocol, self.matching)
