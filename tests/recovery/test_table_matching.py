"""What is done on a turntable is found again in the recording, whatever the table does wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.earth import Site
from tumble.protocol import HoldStep, SpinStep, named_protocol
from tumble.segmentation import find_timeline
from tumble.segmentation.matching import match_protocol
from tumble.segmentation.observations import observe_holds
from tumble.simulation import TableErrors, find_grade, simulate_protocol

SITE = Site.from_latitude(np.radians(28.2), 80.0)
ARC_SECOND = np.pi / 648_000.0
# Ten times what a table of arc-seconds does, and a ripple that the ear hears.
BAD = TableErrors(
    angle_sigma=20.0 * ARC_SECOND,
    once=10.0 * ARC_SECOND,
    twice=5.0 * ARC_SECOND,
    axis_tilt=np.radians(0.5),
    wobble=20.0 * ARC_SECOND,
    ripple=5e-3,
    ramp_spread=0.2,
)
EARLY = replace(BAD, stops_early=((1, 0.35), (2, 0.6)))


# Each protocol with each table, and all pairs of grades and units.
@pytest.mark.parametrize(
    ("name", "grade", "units", "table"),
    [
        # Its g-sensitivity moves the slow rate about a level axis by some per cent.
        ("turntable-9", "consumer-mems", "counts", None),
        ("laboratory", "consumer-mems", "SI", EARLY),
        ("turntable-9", "industrial-mems", "SI", EARLY),
        ("laboratory", "industrial-mems", "counts", BAD),
        ("turntable-9", "tactical", "SI", BAD),
        ("laboratory", "tactical", "counts", None),
    ],
)
def test_every_hold_and_rotation_is_found_where_it_was(
    name: str, grade: str, units: str, table: TableErrors | None
) -> None:
    rng = np.random.Generator(np.random.SFC64(5))
    recording, truth = simulate_protocol(
        named_protocol(name),
        50.0,
        rng,
        site=SITE,
        grade=find_grade(grade),
        model=find_grade(grade).simulate_model(rng),
        units=units,
        table=table,
        lever_arm_b=np.array([0.05, -0.03, 0.02]),
    )
    protocol = replace(named_protocol(name), steps=truth.steps, site=SITE)
    timeline = find_timeline(recording)
    matching = match_protocol(protocol, recording, timeline, observe_holds(recording, timeline))
    steps = protocol.steps
    assert [m.step for m in matching.holds] == [k for k, s in enumerate(steps) if isinstance(s, HoldStep)]
    assert [m.step for m in matching.spins] == [k for k, s in enumerate(steps) if isinstance(s, SpinStep)]
    assert (matching.missing, matching.extra, matching.remarks) == ((), (), [])
    found = [(m.step, timeline.holds[m.hold].start, timeline.holds[m.hold].stop) for m in matching.holds]
    found += [(m.step, m.start, m.stop) for m in matching.spins]
    for step, start, stop in found:
        began, ended = truth.step_edges[step]
        # Edges are found to 0.2 s; the ends of a ramp, where the rate is all but constant, less well.
        assert recording.time[start] > began - 0.5
        assert recording.time[stop - 1] < ended + 0.5
        if isinstance(steps[step], HoldStep):
            assert recording.time[stop - 1] - recording.time[start] > 0.9 * (ended - began)
