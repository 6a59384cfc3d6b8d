"""Recordings by hand whose truth is known, made with numpy alone, their pieces, and captures of them."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.capture.run import CaptureOrder, CaptureRun, run_capture
from tumble.capture.source import Channels, Piece, Source, SourceOptions, known_sources
from tumble.recording import Recording, Samples

GRAVITY = 9.80665


def by_hand(holds: int, *, seed: int, rate: float = 100.0, creeping: int | None = None) -> Recording:
    """Rest for 3 s, turn, rest: a consumer unit with biases; hold number `creeping` turns at 1.5°/s all the while."""
    rng = np.random.default_rng(seed)
    still, turning = round(3.0 * rate), round(1.5 * rate)
    share = np.sin(np.pi * (np.arange(turning) + 0.5) / turning) ** 2
    rates: list[np.ndarray] = []
    for number in range(holds):
        creep = np.radians(1.5) * np.array([0.36, -0.48, 0.8])
        rates.append(np.tile(creep if number == creeping else np.zeros(3), (still, 1)))
        if number < holds - 1:
            axis = rng.standard_normal(3)
            axis *= rng.uniform(1.4, 2.4) / np.linalg.norm(axis)
            rates.append(np.outer(share, axis) * rate / share.sum())
    true_rate = np.concatenate(rates)
    steps = Rotation.from_rotvec(true_rate / rate).as_matrix()
    attitude, up = Rotation.from_rotvec([0.3, -0.4, 0.2]).as_matrix(), np.empty_like(true_rate)
    for k, step in enumerate(steps):
        up[k] = attitude[2]
        attitude = attitude @ step
    force = GRAVITY * up * [1.01, 0.99, 1.005] + [0.2, -0.1, 0.3] + 0.02 * rng.standard_normal(up.shape)
    gyro = true_rate * [0.99, 1.02, 1.0] + [0.01, -0.02, 0.005] + 0.002 * rng.standard_normal(up.shape)
    return Recording(np.arange(len(up)) / rate, force, gyro, "m/s^2", "rad/s", rate)


def channels_of(recording: Recording) -> Channels:
    """What a source says of it."""
    return Channels(
        None if recording.specific_force is None else recording.specific_force_unit,
        None if recording.angular_rate is None else recording.angular_rate_unit,
        recording.rate,
    )


def pieces_of(recording: Recording, seconds: float) -> Iterator[Samples]:
    """The recording in pieces, as a source hands them over."""
    step = max(1, round(seconds * recording.rate))
    for start in range(0, len(recording), step):
        part = recording.between(start, min(start + step, len(recording)))
        yield Samples(part.time, part.specific_force, part.angular_rate)


def captured(pieces: Iterable[Piece], folder: Path, **order: Any) -> CaptureRun:
    """A capture of these pieces, as of a live source."""
    source = Source("test", "a test", "test:", lambda address, options: iter(pieces))
    asked: dict[str, Any] = {"imu": None, **order}
    return run_capture(CaptureOrder(source, "", SourceOptions(), folder, **asked))


def replay_of(file: Path, folder: Path, **order: Any) -> CaptureOrder:
    """An order to replay a file without waiting."""
    asked: dict[str, Any] = {"imu": None, **order}
    return CaptureOrder(known_sources()["replay"], f"{file}@0", SourceOptions(), folder, **asked)


def live(recording: Recording, seconds: float = 0.1) -> list[Piece]:
    """All that a source says of a recording."""
    return [channels_of(recording), *pieces_of(recording, seconds)]


def events_of(folder: Path) -> list[dict[str, Any]]:
    """What the session's log holds."""
    return [json.loads(line) for line in (folder / "session.jsonl").read_text().splitlines()]


def kinds(folder: Path) -> list[str]:
    """The kinds of the log's events, in order."""
    return [event["event"] for event in events_of(folder)]
