"""The guide with a simulated person: bad holds cost only themselves, and it ends when it is enough."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.capture.run import CaptureOrder, run_capture
from tumble.capture.source import Source, SourceOptions, find_source
from tumble.capture.sources.simulated import Flaws, SimulatedPerson
from tumble.design.joint_information import NAMES
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.recording.samples import Samples
from tumble.simulation.grades import find_grade


def test_the_unit_at_rest_shows_gravity_and_in_a_turn_its_rate() -> None:
    person = SimulatedPerson(find_grade("consumer-mems"), 3, poses=np.eye(3))
    pieces = [piece for piece in person if isinstance(piece, Samples)]
    force = np.concatenate([p.specific_force for p in pieces if p.specific_force is not None])
    rate = np.concatenate([p.angular_rate for p in pieces if p.angular_rate is not None])
    true_force, true_rate = person.model.correct(force, rate)
    rest = np.linalg.norm(true_rate, axis=1) < 0.05
    assert np.mean(np.linalg.norm(true_force[rest], axis=1)) == pytest.approx(9.80665, rel=2e-3)
    assert np.max(np.linalg.norm(true_rate, axis=1)) > 0.5


@pytest.mark.slow
def test_a_person_with_flaws_reaches_a_target_by_the_guide(tmp_path: Path) -> None:
    flaws = Flaws(too_short=0.1, creeping=0.1, unplugged=0.05)
    grade = find_grade("consumer-mems")
    source = Source("test", "", "", lambda address, options: SimulatedPerson(grade, 5, flaws=flaws))
    # So fast that what would tell most is not reckoned in time: the person then turns as he likes. The targets are
    # so coarse that too few poses reach them, and it must not be enough before a calibration can be made of them.
    order = CaptureOrder(
        source,
        "",
        SourceOptions(),
        tmp_path / "out",
        targets={"accelerometer bias": 0.05, "gyro scale": 8e-3},
    )
    run = run_capture(order)
    assert run.calibration is not None
    events = [json.loads(line) for line in (tmp_path / "out" / "session.jsonl").read_text().splitlines()]
    kinds = [event["event"] for event in events]
    assert "enough" in kinds
    assert kinds[-1] == "calibrated"
    end = next(event for event in events if event["event"] == "calibrated")
    assert end["holds"] == end["holds_live"]


@pytest.mark.slow
def test_what_is_predicted_is_what_the_calibration_states(tmp_path: Path) -> None:
    """The gyro biases wander: the turns of the whole recording show it, the holds alone do not."""
    grade = find_grade("consumer-mems")
    person = SimulatedPerson(
        grade, 1, poses=twenty_six_directions()[np.random.default_rng(1).permutation(26)]
    )
    source = Source("test", "", "", lambda address, options: person, live=False)
    run_capture(CaptureOrder(source, "", SourceOptions(), tmp_path, site=Site.from_gravity(9.80665)))
    end = json.loads((tmp_path / "session.jsonl").read_text().splitlines()[-1])
    ratios = [end["predicted"][name] / end["stated"][name] for name in NAMES[:21]]
    assert min(ratios) > 0.6
    assert max(ratios) < 1.6


def test_a_simulated_source_is_found_and_its_address_checked() -> None:
    source, address = find_source("simulated:consumer-mems@4@0")
    assert isinstance(next(iter(source.open(address, SourceOptions()))), object)
    for wrong in ("consumer-mems@x", "consumer-mems@4@fast", "consumer-mems@-1"):
        with pytest.raises(UsageError):
            source.open(wrong, SourceOptions())
