"""Recordings whose holds and turns are given, by the joint adjustment."""

from __future__ import annotations

from typing import Any

from tumble.calibration import Estimate, Options, Session, StableKnowledge, calibrate, find_procedure
from tumble.earth import Site
from tumble.recording import Recording
from tumble.segmentation import HoldMeans, Timeline, observe_holds


def adjusted(
    recording: Recording,
    timeline: Timeline,
    site: Site,
    means: HoldMeans | None = None,
    *,
    procedure: str = "hand-held",
    prior: StableKnowledge | None = None,
    **options: Any,
) -> Estimate:
    """Return the estimate of a procedure, with options of `Options`."""
    session = Session(recording, given_site=site, prior=prior, options=Options(**options))
    session.timeline, session.means = timeline, means or observe_holds(recording, timeline)
    return calibrate(session, find_procedure(procedure))
