"""A capture from its source to its files and its page: what is written, kept, refused and shown."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.capture import recordings
from tests.unit.given import signals

from tumble.capture.coach import Progress
from tumble.capture.guide import Guide, read_targets
from tumble.capture.machine import Capture
from tumble.capture.run import CaptureFolder, run_capture
from tumble.capture.source import Channels, Piece
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.recording import Recording, Samples, read_recording, write_recording
from tumble.sample_rates import sample_rate
from tumble.simulation import find_grade

RUN = "import sys; from tumble.cli import program; program()"


def rows_in(folder: Path) -> int:
    """Whole rows of samples that are on the disk."""
    file = folder / "recording.csv"
    return file.read_bytes().count(b"\n") - 1 if file.is_file() else 0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording by hand of 14 poses as a file."""
    file = tmp_path_factory.mktemp("recorded") / "hand.csv"
    write_recording(recordings.by_hand(14, seed=11), file)
    return file


def test_a_replay_leaves_all_four_files_and_the_same_samples(recorded, tmp_path):
    run = run_capture(recordings.replay_of(recorded, tmp_path / "out"))
    folder = tmp_path / "out"
    names = {"recording.csv", "session.jsonl", "calibration.json", "report.html"}
    assert {file.name for file in folder.iterdir()} == names
    before, after = read_recording(recorded), read_recording(folder / "recording.csv")
    assert np.array_equal(before.time, after.time)
    assert np.array_equal(signals(before), signals(after))
    assert recordings.kinds(folder).count("hold_accepted") == 14
    assert recordings.kinds(folder)[-1] == "calibrated"
    assert run.calibration.calibration.quality.holds == 14


@pytest.mark.slow
def test_sigma_falls_and_ends_near_what_calibrate_states(recorded, tmp_path):
    run_capture(recordings.replay_of(recorded, tmp_path / "out", imu="consumer-mems"))
    events = recordings.events_of(tmp_path / "out")
    told = [event["sigma"] for event in events if event["event"] == "sigma"]
    biases = [one["accelerometer bias x"] for one in told if one["accelerometer bias x"] is not None]
    assert len(biases) > 3
    assert biases[-1] < biases[0]
    assert all(one.get("pose", "turn") in one["do"] for one in events if one["event"] == "next_pose")
    end = events[-1]
    for axis in "xyz":
        # Stamps that are regular are of a nominal rate, 1 % over the root of three: no pose mends it.
        name = f"gyro scale factor error {axis}"
        assert end["units"][name] == "%"
        assert end["predicted"][name] > 0.57
        assert end["predicted"][name] == pytest.approx(end["stated"][name], rel=0.1)
        name = f"accelerometer scale factor error {axis}"
        assert 0.4 < end["predicted"][name] / end["stated"][name] < 2.5


def test_a_rate_that_is_stated_with_its_uncertainty_is_believed():
    time = np.arange(4000) / 100.0
    for rate, sigma in ((None, 0.01 / np.sqrt(3.0)), (sample_rate("100±0.02"), 2e-4)):
        guide = Guide(find_grade("tactical"), Site.unknown(), 3.0, {}, rate=rate, patient=True)
        guide.look_at_clock(time[:1000])
        guide.look_at_clock(time[1000:])
        assert guide.clock_sigma == pytest.approx(sigma, rel=1e-3)


def test_after_a_kill_only_the_last_second_is_lost_and_it_can_be_resumed(recorded, tmp_path):
    folder = tmp_path / "out"
    command = [sys.executable, "-c", RUN, "capture", f"replay:{recorded}@4", "-o", str(folder), "-q"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + 120.0
        while rows_in(folder) < 600 and time.monotonic() < end:
            time.sleep(0.05)
    finally:
        os.kill(running.pid, signal.SIGKILL)
        running.wait()
    assert rows_in(folder) >= 600
    with (folder / "recording.csv").open("ab") as file:
        file.write(b"3.14,0.1,")  # as a kill in the middle of a line leaves it
    run = run_capture(recordings.replay_of(recorded, folder, resume=True))
    assert "resumed" in recordings.kinds(folder)
    before, after = read_recording(recorded), read_recording(folder / "recording.csv")
    assert np.array_equal(before.time, after.time)
    assert run.calibration.calibration.quality.holds == 14


def test_samples_are_handed_to_the_disk_each_second(tmp_path, monkeypatch):
    from tumble.capture import run

    now, recording, folder = [0.0], recordings.by_hand(3, seed=2), tmp_path / "out"
    monkeypatch.setattr(run.time, "monotonic", lambda: now[0])

    def pieces() -> Iterator[Piece]:
        yield recordings.channels_of(recording)
        for piece in recordings.pieces_of(recording, 0.1):
            now[0] += 0.1
            yield piece
            assert rows_in(folder) >= 100.0 * (float(piece.time[-1]) - 1.2)

    recordings.captured(pieces(), folder)
    assert rows_in(folder) == len(recording)
    # What the stamps of a live unit are good to, it is told by this computer's clock.
    assert any("say --rate ±50ppm" in str(event["words"]) for event in recordings.events_of(folder))


def test_a_full_disk_ends_a_capture_with_a_sentence_and_whole_lines(recorded, tmp_path):
    """The system lets no file grow beyond 50 kB."""
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000)); {RUN}"
    command = ["capture", f"replay:{recorded}@0", "-o", str(tmp_path / "out")]
    ended = subprocess.run(
        [sys.executable, "-c", limited, *command], capture_output=True, text=True, check=False
    )
    assert ended.returncode not in (0, 1)
    assert "recording.csv could not be written on: File too large; all before that is kept." in ended.stderr
    assert "Traceback" not in ended.stderr
    content = (tmp_path / "out" / "recording.csv").read_bytes()
    assert 30_000 < len(content) <= 50_000
    assert content.endswith(b"\n")
    assert len({line.count(b",") for line in content.splitlines()}) == 1


def test_ten_seconds_of_silence_are_told_and_the_capture_goes_on(tmp_path, monkeypatch):
    from tumble.capture import run

    now, recording = [0.0], recordings.by_hand(6, seed=12)
    monkeypatch.setattr(run.time, "monotonic", lambda: now[0])

    def pieces() -> Iterator[Piece]:
        yield recordings.channels_of(recording)
        for number, piece in enumerate(recordings.pieces_of(recording, 0.1)):
            for _ in range(100 if number == 200 else 1):
                now[0] += 0.1
                yield None
            # The unit measured on while its line was silent, and nobody heard it.
            yield piece if number < 200 else piece.at(piece.time + 10.0)

    recordings.captured(pieces(), tmp_path / "out")
    said = recordings.kinds(tmp_path / "out")
    assert said.count("silence") == said.count("back") == 1
    assert "clock_jumped" not in said
    assert rows_in(tmp_path / "out") == len(recording)
    assert said.count("hold_accepted") >= 5


def test_where_a_capture_must_not_write_it_writes_nothing(recorded, tmp_path):
    results, locked = tmp_path / "results", tmp_path / "locked"
    results.mkdir()
    (results / "calibration.json").write_text("mine")
    with pytest.raises(UsageError, match=r"--resume"):
        run_capture(recordings.replay_of(recorded, results))
    assert [file.name for file in results.iterdir()] == ["calibration.json"]
    assert (results / "calibration.json").read_text() == "mine"
    copy = Path(shutil.copy(recorded, tmp_path / "recording.csv"))
    with pytest.raises(UsageError, match="written to"):
        run_capture(recordings.replay_of(copy, tmp_path, resume=True))
    channels = recordings.channels_of(recordings.by_hand(2, seed=1))
    first = CaptureFolder(locked, channels)
    with pytest.raises(UsageError, match="another tumble"):
        CaptureFolder(locked, channels, resume=True)
    first.close_recording()
    first.close()
    with pytest.raises(UsageError, match="columns"):
        CaptureFolder(locked, replace(channels, angular_rate_unit=None), resume=True)


def test_a_clock_that_begins_anew_is_told_and_carried_on(tmp_path):
    recording = recordings.by_hand(6, seed=12)
    channels, *pieces = recordings.live(recording)
    moved = [piece.at(piece.time - 10.0) for piece in pieces[121:] if isinstance(piece, Samples)]
    recordings.captured([channels, *pieces[:121], *moved], tmp_path)
    assert recordings.kinds(tmp_path).count("clock_jumped") == 1
    time_read = read_recording(tmp_path / "recording.csv").time
    assert np.all(np.diff(time_read) > 0.0)
    assert time_read.shape[0] == len(recording)


def test_numbers_that_are_none_are_left_out_and_what_tells_too_little_is_kept_and_says_so(tmp_path):
    recording = recordings.by_hand(2, seed=14)
    force, _ = signals(recording)
    force[500:503, 1] = np.nan
    force[700, 2] = np.inf
    run = recordings.captured(recordings.live(recording), tmp_path)
    assert run.calibration is None
    assert run.refusal
    assert recordings.kinds(tmp_path)[-1] == "not_calibrated"
    assert len(read_recording(tmp_path / "recording.csv")) == len(recording) - 4


def test_a_unit_whose_numbers_never_change_does_not_end_the_capture(tmp_path):
    whole = Samples(
        np.arange(1000) / 100.0, *(np.tile(one, (1000, 1)) for one in ([0.1, -0.2, 9.8], [1e-3, 2e-3, 3e-3]))
    )
    pieces: list[Piece] = [Channels("m/s^2", "rad/s", 100.0), *whole.parts(0.1)]
    run = recordings.captured(pieces, tmp_path, imu="consumer-mems", hold=2.0)
    assert rows_in(tmp_path) == 1000
    assert run.calibration is None
    assert run.refusal
    assert {"hold_complete", "not_calibrated"} <= set(recordings.kinds(tmp_path))


WRONG: dict[str, Callable[[Recording], Recording]] = {
    "No gyro": lambda one: replace(one, angular_rate=None),
    "exactly zero": lambda one: replace(one, angular_rate=0.0 * signals(one)[1]),
    "takes gravity out": lambda one: replace(
        one, specific_force=0.01 * (signals(one)[0] - signals(one)[0].mean(axis=0))
    ),
    "cannot be in": lambda one: replace(one, specific_force=10.0 * signals(one)[0]),
    "Hz": lambda one: replace(one, rate=250.0),
}


@pytest.mark.parametrize("word", WRONG)
def test_what_is_wrong_is_said_within_two_seconds(word):
    recording = WRONG[word](recordings.by_hand(1, seed=15))
    capture = Capture(recordings.channels_of(recording), None, 3.0)
    pieces = recordings.pieces_of(replace(recording, rate=100.0), 0.1)
    said = [event for piece in pieces for event in capture.feed(piece) if event.kind == "caution"]
    assert any(word in event.words for event in said)
    assert all(event.time < 2.05 for event in said)


def test_targets_are_read_in_their_units_and_what_is_none_is_refused():
    found = read_targets(["accelerometer.bias=2mg", "gyro.scale=500PPM,gyro.bias=3.6DEG/H"])
    assert found["accelerometer bias"] == pytest.approx(2e-3 * 9.80665)
    assert found["gyro scale"] == pytest.approx(5e-4)
    assert found["gyro bias"] == pytest.approx(np.radians(1e-3))
    for text in ("bias=2mg", "accelerometer.bias=2ppm", "accelerometer.bias=-2mg", "gyro.bias="):
        with pytest.raises(UsageError, match="--target"):
            read_targets([text])


def test_a_capture_ends_by_saying_whether_the_guide_had_enough():
    capture: Any = Capture.__new__(Capture)
    capture.progress = Progress(words=("Gyro x is open.",))
    for guide, enough, said in (
        (object(), False, "The guide had not enough yet. Gyro x is open."),
        (object(), True, "The guide had enough."),
        (None, False, ""),
    ):
        capture.guide, capture._enough_said = guide, enough
        assert capture.outlook() == said
