"""Recordings whose holds and turns are given, by the joint adjustment."""

from tumble.calibration import Options, Session, calibrate, find_procedure
from tumble.segmentation import observe_holds


def adjusted(recording, timeline, site, means=None, *, procedure="hand-held", prior=None, **options):
    """Return the estimate of a procedure, with options of `Options`."""
    session = Session(recording, given_site=site, prior=prior, options=Options(**options))
    session.timeline, session.means = timeline, means or observe_holds(recording, timeline)
    return calibrate(session, find_procedure(procedure))
