"""Each of the nine tests is played once, and the estimators' documented input is what comes out."""

import numpy as np
import pytest

import second_simulator
from second_simulator import GRADES, OWN_FAULTS, PROCEDURES, RECORD_FAULTS, STATED_FAULTS
from tumble.protocol import HoldStep, SpinStep, read_protocol

QUICK = {
    "by-hand": {"poses": 9, "rate": 50.0},
    "multi-position": {"seconds": 4.0, "rate": 50.0},
    "six-faces": {"seconds": 5.0},
    "rate-table": {"rates": (60.0,), "rate": 20.0},
    "modified-multi-position": {"rate": 20.0},
    "turntable": {"seconds": 4.0, "rate": 20.0},
    "laboratory": {"seconds": 4.0, "rate": 20.0},
    "strapdown-rotation": {"rate": 50.0},
    "thermal-soak": {"minutes": 2.0, "soaks": (20.0, 40.0)},
}


def made_by(name: str, fault: str | None = None) -> second_simulator.Simulation:
    return PROCEDURES[name](GRADES["industrial"], np.random.default_rng(4), fault, **QUICK.get(name, {}))


@pytest.mark.parametrize("name", list(PROCEDURES))
def test_a_protocol_is_read_and_its_steps_are_those_that_were_played(name, tmp_path):
    made = made_by(name)
    file = tmp_path / "protocol.yaml"
    file.write_text(made.protocol, encoding="utf-8")
    protocol = read_protocol(file)
    stated = sum(isinstance(step, HoldStep) for step in protocol.steps)
    spins = sum(isinstance(step, SpinStep) for step in protocol.steps)
    # A soak is a rest of the motion, and a strapdown sequence pauses between its turns.
    rests = [s for s in made.path.steps if s.kind == "hold" and s.name != "pause"]
    soaks = sum(type(step).__name__ == "SoakStep" for step in protocol.steps)
    assert len(rests) == stated + soaks
    assert sum(s.kind == "spin" for s in made.path.steps) == spins
    assert abs(protocol.site.gravity - made.place.gravity) < 2e-3


def test_every_fault_changes_what_is_handed_over():
    plain = made_by("by-hand")
    for fault in (*RECORD_FAULTS, *STATED_FAULTS, *OWN_FAULTS["by-hand"]):
        other = made_by("by-hand", fault)
        same = (
            other.other is None
            and other.protocol == plain.protocol
            and other.time.shape == plain.time.shape
            and np.array_equal(other.time, plain.time)
            and np.array_equal(other.force, plain.force)
            and np.array_equal(other.rate, plain.rate)
        )
        assert not same, fault


def test_a_fault_that_a_test_does_not_have_is_refused():
    with pytest.raises(ValueError, match="no fault of this test"):
        made_by("by-hand", "misread")
