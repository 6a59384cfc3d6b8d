"""Guides other than that of a calibration by hand: the steps of a protocol, and a rest for the noise."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tumble.capture.coach import Event
from tumble.capture.machine import Capture
from tumble.capture.rest_coach import RestCoach
from tumble.capture.run import CaptureOrder, run_capture
from tumble.capture.source import Channels, SourceOptions, sources
from tumble.capture.sources.simulated import SimulatedPerson
from tumble.capture.steps_coach import StepsCoach, step_phrase
from tumble.earth import Site
from tumble.protocol.library import PROTOCOLS, named_protocol
from tumble.protocol.steps import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.recording import Recording
from tumble.recording.formats.output import write_recording
from tumble.recording.samples import Samples
from tumble.simulation.grades import find_grade

UPS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
STEPS = (
    HoldStep(3.0, Pose(UPS[0]), "on its feet"),
    TurnStep(3.0, np.array([0.0, 1.0, 0.0]), -np.pi / 2.0),
    HoldStep(4.0, Pose(UPS[1])),
    SpinStep(36.0, np.radians(10.0)),
    HoldStep(3.0, Pose(UPS[2])),
)


def captured(person: SimulatedPerson, coach: StepsCoach, *, follows: bool) -> list[Event]:
    capture: Capture | None = None
    said: list[Event] = []
    for piece in person:
        if isinstance(piece, Channels):
            capture = Capture(piece, coach, 3.0)
        elif isinstance(piece, Samples) and capture is not None:
            events = capture.feed(piece)
            said += events
            if follows:
                person.hear(events)
            if capture.time > 120.0 or any(event.kind == "enough" for event in events):
                break
    return said


def test_a_person_who_does_what_is_said_goes_through_the_steps() -> None:
    steps = tuple(step for step in STEPS if isinstance(step, HoldStep))
    coach = StepsCoach(Protocol("mine", "six-position", steps))
    said = captured(SimulatedPerson(find_grade("consumer-mems"), 3), coach, follows=True)
    told = [event for event in said if event.kind == "next_pose"]
    assert told[0].words == "Step 1 of 3: hold +z up (on its feet) for 3 s."
    assert [event.facts["step"] for event in told] == sorted(event.facts["step"] for event in told)
    assert said[-1].kind == "enough"
    # The second step asks for four seconds: three are not said to be long enough.
    complete = [event.facts["seconds"] for event in said if event.kind == "hold_complete"]
    assert complete[-2] >= 4.0


def test_a_wrong_pose_is_said_and_its_step_stays() -> None:
    coach = StepsCoach(Protocol("mine", "turntable", STEPS))
    poses = np.array([UPS[0], UPS[2], UPS[1], UPS[1], UPS[2]])
    person = SimulatedPerson(find_grade("consumer-mems"), 4, poses=poses, hold=5.0)
    said = captured(person, coach, follows=False)
    told = [event.words for event in said if event.kind == "next_pose"]
    assert told[0].startswith("Step 1 of 3: hold +z up")
    assert any(
        words == "Step 2 of 3: turn by -90° about +y, then hold +x up for 4 s. Hold 3 had -y up."
        for words in told
    )
    third = "let the table turn at 10°/s about the axis that points up for 36 s, then hold -y up for 3 s."
    assert any(third in words for words in told)
    assert said[-1].kind == "enough"


@pytest.mark.parametrize("name", PROTOCOLS)
def test_every_named_protocol_can_be_said(name: str) -> None:
    protocol = named_protocol(name)
    phrases = [step_phrase(step) for step in protocol.steps if not isinstance(step, TurnStep)]
    assert all(phrases)
    coach = StepsCoach(protocol)
    assert coach.hold > 0.0


def at_rest(seconds: float, rate: float = 50.0, walk: float = 0.0) -> Recording:
    rng = np.random.default_rng(2)
    count = round(seconds * rate)
    force = 0.02 * rng.standard_normal((count, 3)) + [0.1, -0.2, 9.8]
    turn = 0.001 * rng.standard_normal((count, 3)) + walk / rate**0.5 * np.cumsum(
        rng.standard_normal((count, 3)), axis=0
    )
    return Recording(np.arange(count) / rate, force, turn, "m/s^2", "rad/s", rate)


def said_at_rest(recording: Recording) -> list[Event]:
    capture = Capture(Channels("m/s^2", "rad/s", recording.rate), RestCoach(patient=True), 3.0)
    said: list[Event] = []
    for start in range(0, len(recording), 500):
        part = recording.between(start, min(start + 500, len(recording)))
        said += capture.feed(Samples(part.time, part.specific_force, part.angular_rate))
    return said


@pytest.mark.slow
def test_a_rest_says_what_the_noise_still_needs() -> None:
    white = [event for event in said_at_rest(at_rest(900.0)) if event.kind == "next_pose"]
    assert len(white) >= 8
    assert "N known to 10 %" in white[-1].words
    assert "K needs at least" in white[-1].words
    assert not any(event.kind == "hold_complete" for event in said_at_rest(at_rest(30.0)))
    # A walk so large that 900 s show it: K of the gyros is known then, and of the accelerometers it is not.
    walking = [event.words for event in said_at_rest(at_rest(900.0, walk=3e-4)) if event.kind == "next_pose"]
    accelerometers, gyros = walking[-1].split("Gyros:")
    assert "K needs" in accelerometers
    assert "K known" in gyros or "and K known" in gyros


@pytest.mark.slow
def test_a_rest_ends_with_the_noise_of_its_file(tmp_path: Path) -> None:
    recording = at_rest(300.0)
    write_recording(recording, tmp_path / "rest.csv")
    order = CaptureOrder(
        sources()["replay"],
        f"{tmp_path / 'rest.csv'}@0",
        SourceOptions(),
        tmp_path / "out",
        protocol="rest",
    )
    run = run_capture(order)
    assert run.calibration is None
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {"recording.csv", "session.jsonl", "noise.json", "noise.html"}
    last = json.loads((tmp_path / "out" / "session.jsonl").read_text().splitlines()[-1])
    assert last["event"] == "characterised"
    density = {channel.name: channel.fit for channel in run.noise.noise.channels}["az"]
    assert density.model.coefficients["N"] == pytest.approx(0.02 / 50.0**0.5, rel=0.03)


def test_a_protocol_is_evaluated_as_that_protocol(tmp_path: Path) -> None:
    from tumble.workflows.simulate import simulate

    six = named_protocol("six-position")
    steps = tuple(replace(step, duration=4.0) if isinstance(step, HoldStep) else step for step in six.steps)
    from tumble.protocol.file import write_protocol

    site = Site.from_gravity(9.80665)
    write_protocol(replace(six, steps=steps, site=site), tmp_path / "six.yaml")
    done = simulate(tmp_path / "six.yaml", output=tmp_path / "made")
    recording = next(file for file in done.files if file.suffix == ".csv")
    order = CaptureOrder(
        sources()["replay"],
        f"{recording}@0",
        SourceOptions(),
        tmp_path / "out",
        protocol=str(tmp_path / "six.yaml"),
    )
    run = run_capture(order)
    assert run.calibration is not None
    assert "Procedure six-position" in run.calibration.reason
    events = [json.loads(line) for line in (tmp_path / "out" / "session.jsonl").read_text().splitlines()]
    assert [event["event"] for event in events].count("enough") == 1
