"""A magnetometer that a device sends stands in the recording: at the rate at which it comes, in its own numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tumble.capture.folder import RECORDING, CaptureFolder
from tumble.capture.source import Channels, Piece, SourceOptions, find_source
from tumble.capture.text_lines import TextLines
from tumble.recording import read_recording
from tumble.recording.samples import Samples, joined

COUNT, RATE = 200, 100.0
RNG = np.random.default_rng(7)
FORCE = (0.02 * RNG.standard_normal((COUNT, 3)) + [1.0, -2.0, 9.5]).astype(np.float32).astype(float)
TURN = (0.003 * RNG.standard_normal((COUNT, 3)) + [0.1, 0.0, -0.2]).astype(np.float32).astype(float)
FIELD = (
    (0.003 * RNG.standard_normal((COUNT, 3)) + [0.2, -0.05, 0.42]).astype(np.float32).astype(float)
)  # gauss


def vn_line(k: int) -> bytes:
    body = "VNIMU," + ",".join(f"{v:+.9f}" for v in [*FIELD[k], *FORCE[k], *TURN[k], 25.5, 101.3])
    check = 0
    for one in body.encode():
        check ^= one
    return f"${body}*{check:02X}\r\n".encode()


def text(k: int) -> bytes:
    return ",".join(f"{v:.9f}" for v in (k / RATE, *FORCE[k], *TURN[k], *FIELD[k])).encode() + b"\n"


@pytest.mark.parametrize("make", [vn_line, text])
def test_the_recording_has_the_magnetometer(tmp_path: Path, make: Callable[[int], bytes]) -> None:
    header = (
        b"t,ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s],mx,my,mz\n"
        if make is text
        else b""
    )
    data = header + b"".join(make(k) for k in range(COUNT))
    decoder = TextLines(SourceOptions(rate=RATE if make is vn_line else None), "a test")
    pieces: list[Piece] = []
    for start in range(0, len(data), 97):
        pieces += decoder.feed(data[start : start + 97], start / len(data) * COUNT / RATE)
    pieces += decoder.end()
    channels = next(p for p in pieces if isinstance(p, Channels))
    folder = CaptureFolder(tmp_path / "out", channels)
    folder.add(joined([p for p in pieces if isinstance(p, Samples)]))
    folder.flush()
    folder.close_recording()
    folder.close()
    recording = read_recording(tmp_path / "out" / RECORDING)
    assert recording.magnetic_field is not None
    assert recording.magnetic_field.unit == "gauss"
    np.testing.assert_allclose(recording.magnetic_field.values, FIELD, rtol=1e-6, atol=1e-8)
    assert recording.specific_force is not None
    np.testing.assert_allclose(recording.specific_force, FORCE, rtol=1e-6, atol=1e-8)


def test_a_replay_has_the_magnetometer_of_its_file_slower_than_the_rows(tmp_path: Path) -> None:
    rows = np.column_stack([np.arange(COUNT) / RATE, FORCE, TURN])
    header = "t,ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s],mx [gauss],my [gauss],mz [gauss]\n"
    lines = [
        ",".join(map(repr, row)) + ("," + ",".join(map(repr, FIELD[k])) if k % 4 == 1 else ",,,")
        for k, row in enumerate(rows.tolist())
    ]
    (tmp_path / "in.csv").write_text(
        header + "\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n"
    )
    source, address = find_source(f"replay:{tmp_path / 'in.csv'}@0")
    pieces = list(source.open(address, SourceOptions()))
    channels = next(p for p in pieces if isinstance(p, Channels))
    folder = CaptureFolder(tmp_path / "out", channels)
    for piece in pieces:
        if isinstance(piece, Samples):
            folder.add(piece)
    folder.close_recording()
    folder.close()
    before, after = read_recording(tmp_path / "in.csv"), read_recording(tmp_path / "out" / RECORDING)
    assert before.magnetic_field is not None
    assert after.magnetic_field is not None
    assert len(after.magnetic_field) == COUNT // 4
    assert after.magnetic_field.unit == "gauss"
    np.testing.assert_array_equal(after.magnetic_field.time, before.magnetic_field.time)
    np.testing.assert_array_equal(after.magnetic_field.values, FIELD[1::4])
