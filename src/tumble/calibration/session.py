"""A recording that is to be calibrated, and what is found in it when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING

from tumble.counting import part
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.recording.recording import Recording
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.equations.believed_poses import BelievedPoses
    from tumble.calibration.outcome.estimate import JointOutcome
    from tumble.calibration.prior import FleetSheet, StableKnowledge
    from tumble.calibration.procedure import Procedure
    from tumble.protocol import Protocol
    from tumble.segmentation import HoldMeans, SpinMeans, Timeline
    from tumble.segmentation.matching import Matching
    from tumble.segmentation.rotations import Rotation
    from tumble.simulation import Grade


@dataclass(frozen=True, slots=True)
class Options:
    """What a user says of the estimate.

    Attributes
    ----------
    optional_terms : try g-sensitivity, quadratic terms and the like.
    data_sheet : grade or fleet whose spreads are a prior; None for none.
    confirm_scale : the user knows that the scale factors are beyond what units have.
    """

    optional_terms: bool = True
    data_sheet: Grade | FleetSheet | None = None
    confirm_scale: bool = False


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
        from tumble.segmentation.matching import match_protocol

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
        from tumble.segmentation.matching import observe_matched_spins

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
        from tumble.segmentation.rotations import observe_rotations

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
        from tumble.calibration.equations.believed_poses import believed_poses

        if not procedure.believes_poses or self.protocol is None or self.matching is None:
            return None
        return believed_poses(self.protocol, self.matching)
