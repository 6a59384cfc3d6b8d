"""Guides, with a simulated person: by hand, by the steps of a protocol, at rest; and the holds that are found live."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.capture.recordings import (
    by_hand,
    captured,
    channels_of,
    events_of,
    kinds,
    pieces_of,
    replay_of,
)

from tumble.attitude import twenty_six_directions
from tumble.capture.coach import Event, RestCoach, StepsCoach, step_phrase
from tumble.capture.live_holds import LiveBlocks, LiveHolds
from tumble.capture.machine import Capture
from tumble.capture.run import CaptureOrder, run_capture
from tumble.capture.source import Channels, Source, SourceOptions
from tumble.capture.sources.simulated import Flaws, SimulatedPerson
from tumble.design import NAMES
from tumble.earth import Site
from tumble.protocol import (
    PROTOCOLS,
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    TurnStep,
    named_protocol,
    write_protocol,
)
from tumble.recording import Recording, Samples, read_recording, write_recording
from tumble.segmentation import find_timeline
from tumble.simulation import find_grade
from tumble.workflows import simulate

DEMO = Path(__file__).resolve().parents[3] / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz"


def watched(
    recording: Recording, chunk: float = 0.1
) -> tuple[LiveHolds, list[tuple[float, str, float, str]]]:
    """Feed a recording, and list what changed: when, what, since when, why."""
    blocks = LiveBlocks(channels_of(recording))
    search = LiveHolds(blocks)
    told: list[tuple[float, str, float, str]] = []
    for piece in pieces_of(recording, chunk):
        if blocks.add(piece):
            told += [(blocks.last_time or 0.0, c.kind, c.start, c.reason) for c in search.look()]
    told += [(blocks.last_time or 0.0, c.kind, c.start, c.reason) for c in search.finish()]
    return search, told


def test_a_real_recording_gives_live_the_holds_of_the_file() -> None:
    recording = read_recording(DEMO, columns="ax,ay,az,gx,gy,gz", units="m/s^2,rad/s", rate=100.0)
    search, told = watched(recording, 0.25)
    in_file = [(h.start, h.stop) for h in find_timeline(recording).holds]
    live = [(h.hold.start, h.hold.stop) for h in search.holds]
    assert len(live) == len(in_file)
    assert np.max(np.abs(np.array(live) - np.array(in_file))) < 0.2 * recording.rate
    delays = [now - start for now, kind, start, _ in told if kind == "accepted"]
    assert np.median(delays) < 1.0
    assert len(delays) == [kind for _, kind, _, _ in told].count("closed") == len(in_file)


def test_a_pose_that_creeps_is_refused_with_its_reason_and_costs_nothing_else() -> None:
    recording = by_hand(6, seed=4, creeping=3)
    search, told = watched(recording)
    refused = [reason for _, kind, _, reason in told if kind == "refused"]
    assert len(search.holds) == 5 == len(find_timeline(recording).holds)
    assert any("creep" in reason or "turns" in reason for reason in refused)


@pytest.mark.parametrize("chunk", [0.005, 0.37, 20.0])
def test_how_samples_are_cut_into_pieces_does_not_matter(chunk: float) -> None:
    recording = by_hand(5, seed=5)
    search, _ = watched(recording, chunk)
    assert [(h.hold.start, h.hold.stop) for h in search.holds] == [
        (h.start, h.stop) for h in find_timeline(recording).holds
    ]


def test_memory_is_bounded_and_the_newest_blocks_stay() -> None:
    recording = by_hand(6, seed=7)
    live, whole = LiveBlocks(channels_of(recording), most=200), LiveBlocks(channels_of(recording))
    for piece in pieces_of(recording, 0.1):
        live.add(piece)
        whole.add(piece)
    assert live.count == whole.count > 400
    assert live.count - live.first <= 200 + 4
    newest, same = live.newest("force", 100), whole.newest("force", 100)
    assert newest is not None
    assert same is not None
    assert np.array_equal(newest, same)
    assert live.time_of(live.samples - 1) == pytest.approx(whole.time_of(whole.samples - 1), abs=1e-9)


def test_no_hold_goes_across_missing_samples() -> None:
    recording = by_hand(4, seed=8)
    middle = find_timeline(recording).holds[1]
    cut = (middle.start + middle.stop) // 2
    moved = recording.time.copy()
    moved[cut:] += 5.0
    blocks = LiveBlocks(channels_of(recording))
    search = LiveHolds(blocks)
    for piece in pieces_of(replace(recording, time=moved), 0.2):
        if blocks.add(piece):
            search.look()
    search.finish()
    assert not [h for h in search.holds if h.hold.start < cut < h.hold.stop]
    assert len(search.holds) == 5


UPS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
STEPS = (
    HoldStep(3.0, Pose(UPS[0]), "on its feet"),
    TurnStep(3.0, np.array([0.0, 1.0, 0.0]), -np.pi / 2.0),
    HoldStep(4.0, Pose(UPS[1])),
    SpinStep(36.0, np.radians(10.0)),
    HoldStep(3.0, Pose(UPS[2])),
)


def told_to(person: SimulatedPerson, coach: StepsCoach, *, follows: bool) -> list[Event]:
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
    said = told_to(SimulatedPerson(find_grade("consumer-mems"), 3), coach, follows=True)
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
    said = told_to(person, coach, follows=False)
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
    run = run_capture(replay_of(tmp_path / "rest.csv", tmp_path / "out", protocol="rest"))
    assert run.calibration is None
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {"recording.csv", "session.jsonl", "noise.json", "noise.html"}
    assert kinds(tmp_path / "out")[-1] == "characterised"
    density = {channel.name: channel.fit for channel in run.noise.noise.channels}["az"]
    assert density.model.coefficients["N"] == pytest.approx(0.02 / 50.0**0.5, rel=0.03)


def test_a_protocol_is_evaluated_as_that_protocol(tmp_path: Path) -> None:
    six = named_protocol("six-position")
    steps = tuple(replace(step, duration=4.0) if isinstance(step, HoldStep) else step for step in six.steps)
    site = Site.from_gravity(9.80665)
    write_protocol(replace(six, steps=steps, site=site), tmp_path / "six.yaml")
    done = simulate(tmp_path / "six.yaml", output=tmp_path / "made")
    recording = next(file for file in done.files if file.suffix == ".csv")
    run = run_capture(replay_of(recording, tmp_path / "out", protocol=str(tmp_path / "six.yaml")))
    assert "Procedure six-position" in run.calibration.reason
    assert kinds(tmp_path / "out").count("enough") == 1


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
    # So fast that what would tell most is not reckoned in time: the person then turns as he likes. The targets are
    # so coarse that too few poses reach them, and it must not be enough before a calibration can be made of them.
    targets = {"accelerometer bias": 0.05, "gyro scale": 8e-3}
    run = captured(SimulatedPerson(grade, 5, flaws=flaws), tmp_path, imu="consumer-mems", targets=targets)
    assert run.calibration is not None
    assert "enough" in kinds(tmp_path)
    end = events_of(tmp_path)[-1]
    assert end["event"] == "calibrated"
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
    end = events_of(tmp_path)[-1]
    ratios = [end["predicted"][name] / end["stated"][name] for name in NAMES[:21]]
    assert min(ratios) > 0.6
    assert max(ratios) < 1.6
