"""What is found live is what the search finds in the file afterwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.unit.capture.recordings import by_hand, channels_of, pieces_of

from tumble.attitude.rotations import twenty_six_directions
from tumble.capture.live_holds import LiveBlocks, LiveHolds
from tumble.capture.machine import Capture
from tumble.capture.source import Channels
from tumble.capture.sources.simulated import Flaws, SimulatedPerson
from tumble.recording import Recording, read_recording
from tumble.recording.samples import Samples
from tumble.segmentation import find_timeline
from tumble.segmentation.blocks import cut_blocks
from tumble.simulation.grades import find_grade

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


def test_each_hold_is_accepted_and_closed_once() -> None:
    _, told = watched(by_hand(6, seed=3))
    assert [kind for _, kind, _, _ in told].count("accepted") == 6
    assert [kind for _, kind, _, _ in told].count("closed") == 6


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


def test_blocks_that_grow_are_those_of_the_file() -> None:
    recording = by_hand(3, seed=6)
    live = LiveBlocks(channels_of(recording))
    for piece in pieces_of(recording, 0.033):
        live.add(piece)
    grown, whole = live.blocks(0), cut_blocks(recording)
    assert grown.angular_rate is not None
    assert whole.angular_rate is not None
    assert np.allclose(grown.angular_rate.smooth, whole.angular_rate.smooth, rtol=0.0, atol=1e-12)
    assert np.allclose(grown.angular_rate.roughness[1:], whole.angular_rate.roughness[1:], rtol=1e-5)


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
    for start in range(0, len(recording), 20):
        part = slice(start, start + 20)
        assert recording.specific_force is not None
        assert recording.angular_rate is not None
        if blocks.add(Samples(moved[part], recording.specific_force[part], recording.angular_rate[part])):
            search.look()
    search.finish()
    assert not [h for h in search.holds if h.hold.start < cut < h.hold.stop]
    assert len(search.holds) == 5


@pytest.mark.slow
def test_a_rest_that_creeps_is_refused_and_not_taken_for_a_hold_again_and_again() -> None:
    order = np.random.default_rng([5, 5]).permutation(26)
    flaws = Flaws(creeping=0.4, too_short=0.1)
    person = SimulatedPerson(
        find_grade("consumer-mems"), 5, poses=twenty_six_directions()[order], flaws=flaws
    )
    capture: Capture | None = None
    times: list[float] = []
    for piece in person:
        if isinstance(piece, Channels):
            capture = Capture(piece, None, 3.0)
        elif isinstance(piece, Samples) and capture is not None:
            times += [float(e.facts["start"]) for e in capture.feed(piece) if e.kind == "hold_accepted"]
    # A rest may be told twice, because what follows shows more of it; it was told a hundred times.
    assert len(times) < 1.5 * 26
    assert max(np.count_nonzero(np.abs(np.array(times) - one) < 0.5) for one in times) <= 3
