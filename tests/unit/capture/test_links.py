"""Lines that come over a port, a socket, a pipe or a growing file: what is understood, and what garbage does."""

import os
import pty
import re
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from tests.unit.capture.recordings import by_hand, replay_of
from tests.unit.given import signals

from tumble.capture.apart import SensorLines
from tumble.capture.link import TextLines
from tumble.capture.run import run_capture
from tumble.capture.source import Channels, Notice, Piece, SourceOptions, find_source, known_sources
from tumble.errors import RecordingError, UsageError
from tumble.recording import Samples, joined, read_recording

RECORDING = by_hand(1, seed=21)
FORCE, RATE = signals(RECORDING)
ROWS = np.column_stack([RECORDING.time, FORCE, RATE])[:300]


def joined_lines(rows: np.ndarray, end: str = "\n") -> str:
    return "".join(",".join(f"{v:.6f}" for v in row) + end for row in rows)


CSV = "t,ax,ay,az,gx [rad/s],gy [rad/s],gz [rad/s]\n" + joined_lines(ROWS)
JSON = "".join(
    f'{{"t":{r[0]:.6f},"accel":{{"x":{r[1]:.6f},"y":{r[2]:.6f},"z":{r[3]:.6f}}},'
    f'"gyro":[{r[4]:.6f},{r[5]:.6f},{r[6]:.6f}]}}\n'
    for r in ROWS
)


def as_pairs(sign: str) -> str:
    names = ("t_ms", "ax", "ay", "az", "gx", "gy", "gz")
    rows = ROWS * [1000.0, 1, 1, 1, 1, 1, 1]
    return "".join(
        " ".join(f"{n}{sign}{v:.6f}" for n, v in zip(names, row, strict=True)) + "\r\n" for row in rows
    )


def decoded(
    text: bytes, options: SourceOptions | None = None, cut: int = 333
) -> tuple[Channels, Samples, TextLines]:
    decoder = TextLines(options or SourceOptions(), "a test")
    pieces: list[Piece] = []
    for k, start in enumerate(range(0, len(text), cut)):
        pieces += decoder.feed(text[start : start + cut], 0.02 * k)
    pieces += decoder.end()
    channels = next(p for p in pieces if isinstance(p, Channels))
    return channels, joined([p for p in pieces if isinstance(p, Samples)]), decoder


@pytest.mark.parametrize("text", [CSV, as_pairs(":"), as_pairs("="), JSON], ids=["csv", "a:1", "a=1", "json"])
def test_lines_of_every_kind_give_the_same_samples(text):
    channels, samples, decoder = decoded(text.encode())
    assert channels.specific_force_unit == "m/s^2"
    assert channels.rate == pytest.approx(100.0, rel=0.02)
    # A gyro whose unit nobody says is counts, and not a guess.
    assert channels.angular_rate_unit == ("rad/s" if text == CSV else "counts")
    assert np.allclose(samples.specific_force, FORCE[:300], atol=1e-6)
    assert np.allclose(samples.angular_rate, RATE[:300], atol=1e-6)
    assert np.allclose(np.diff(samples.time), 0.01, atol=1e-5)
    assert decoder.damaged == 0


def test_motioncal_lines_are_read_with_their_scales():
    counts = np.column_stack(
        [FORCE / 9.80665 * 8192, np.degrees(RATE) * 16, np.tile([1, 2, 3], (len(RATE), 1))]
    )
    lines = "".join("Raw:" + ",".join(str(round(v)) for v in row) + "\r\n" for row in counts[:300])
    channels, samples, _ = decoded(lines.encode(), SourceOptions(rate=100.0))
    assert (channels.specific_force_unit, channels.angular_rate_unit) == ("g", "deg/s")
    assert np.allclose(9.80665 * samples.specific_force, FORCE[:300], atol=1.5e-3)
    # A sample's two lines are one sample and no damage.
    both = "\n".join(
        f"Raw:{k},{-k},8192,{k},0,0,1,2,3\n"
        f"17:50:0{k // 40}.{k % 40:03d} -> Uni:0.1,{k / 1000},9.80665,0.01,-0.02,0.03,20.1,-3.2,41.7"
        for k in range(200)
    )
    _, samples, decoder = decoded(both.encode())
    assert (decoder.damaged, len(samples)) == (0, 200)
    assert decoder.good >= 200
    np.testing.assert_allclose(samples.specific_force[:, 1], np.arange(200) / 1000)


def test_lines_without_stamps_out_of_a_pipe_have_the_stated_rate_and_units():
    options = SourceOptions(rate=100.0, units="m/s^2,rad/s")
    channels, samples, _ = decoded(joined_lines(ROWS[:, 1:]).encode(), options, cut=6000)
    assert channels.angular_rate_unit == "rad/s"
    assert samples.time[-1] - samples.time[0] == pytest.approx(2.99, abs=0.02)


def test_names_between_the_rows_are_theirs_and_garbage_and_half_lines_are_counted_and_passed_over():
    lines = CSV.encode().splitlines(keepends=True)
    mixed = [*lines[1:30], lines[0], *lines[30:200], lines[0], *lines[200:]]
    channels, samples, decoder = decoded(b"".join(mixed), cut=3000)
    assert channels.angular_rate_unit == "rad/s"
    assert (len(samples), decoder.damaged) == (300, 0)
    lines[50] = b"\xff\xfe\x00garbage\n"
    lines[51] = lines[51][:20] + b"\n"
    lines[90:90] = [b"12,13\n", b"a,b\n", b"nan,nan,nan,nan,nan,nan,nan\n"]
    _, samples, decoder = decoded(b"".join(lines))
    assert len(samples) == 298
    assert decoder.damaged >= 4


def test_sentences_of_a_navigation_unit_with_a_wrong_checksum_are_passed_over():
    def sentence(values: str, check: str | None = None) -> str:
        body = f"VNIMU,0.1,0.2,0.3,0.1,-0.2,9.8,{values},25.5,101.3"
        return f"${body}*{check or format(reduce(xor, body.encode()), '02X')}\r\n"

    lines = [sentence(f"{k / 1000},0.02,-0.03") for k in range(200)]
    lines[50:50] = [sentence("7,7,7", "00"), "$GPGGA,1,2,3*55\r\n", sentence("7,7,x"), lines[9][:30] + "\r\n"]
    channels, samples, decoder = decoded("".join(lines).encode(), SourceOptions(rate=100.0))
    assert (channels.specific_force_unit, channels.angular_rate_unit) == ("m/s^2", "rad/s")
    np.testing.assert_allclose(samples.angular_rate[:, 0], np.arange(200) / 1000)
    assert set(samples.temperature) == {25.5}
    assert channels.magnetic_field_unit == "gauss"
    np.testing.assert_allclose(samples.magnetic_field, np.tile([0.1, 0.2, 0.3], (200, 1)), rtol=1e-9)
    assert decoder.damaged == 4


@settings(max_examples=60, deadline=None)
@given(st.lists(st.binary(max_size=300), max_size=8), st.sampled_from([TextLines, SensorLines]))
def test_no_bytes_raise_anything_but_a_sentence(parts, kind):
    decoder = kind(SourceOptions(), "a test")
    try:
        for k, part in enumerate(parts):
            decoder.feed(part, 0.1 * k)
        decoder.end()
    except (RecordingError, UsageError):
        pass


def samples_of(pieces: list[Piece]) -> list[Samples]:
    return [piece for piece in pieces if isinstance(piece, Samples)]


def collected(pieces: Iterator[Piece], wanted: int, seconds: float = 20.0) -> list[Piece]:
    """Take pieces until there are so many samples."""
    found: list[Piece] = []
    end = time.monotonic() + seconds
    for piece in pieces:
        found += [piece] if piece is not None else []
        if sum(map(len, samples_of(found))) >= wanted or time.monotonic() > end:
            break
    pieces.close()  # type: ignore[attr-defined]  # a generator
    return found


def sent(write: Callable[[bytes], object], text: str, pause: float = 0.004) -> threading.Thread:
    def run() -> None:
        for line in text.splitlines(keepends=True):
            write(line.encode())
            time.sleep(pause)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def test_a_serial_port():
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    source, address = find_source(os.ttyname(theirs))
    thread = sent(lambda b: os.write(ours, b), CSV)
    assert len(joined(samples_of(collected(source.open(address, SourceOptions()), 280)))) >= 280
    thread.join()
    os.close(ours)
    os.close(theirs)


def test_a_tcp_server_that_goes_and_comes_back():
    server = socket.create_server(("127.0.0.1", 0))
    lines = CSV.splitlines(keepends=True)

    def serve() -> None:
        for part in (lines[:200], lines[200:]):
            own, _ = server.accept()
            with own, suppress(OSError):
                for line in part:
                    own.sendall(line.encode())
                    time.sleep(0.006)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    source, address = find_source(f"tcp:127.0.0.1:{server.getsockname()[1]}")
    found = collected(source.open(address, SourceOptions()), 295)
    thread.join()
    server.close()
    assert len(joined(samples_of(found))) >= 295
    assert [p.kind for p in found if isinstance(p, Notice)][:2] == ["silence", "remark"]


def test_udp_packets():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    source, address = find_source(f"udp:127.0.0.1:{port}")
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    pieces = source.open(address, SourceOptions())
    next(pieces)
    thread = sent(lambda b: out.sendto(b.rstrip(), ("127.0.0.1", port)), CSV)
    assert len(joined(samples_of(collected(pieces, 250)))) >= 250
    thread.join()
    out.close()


def test_two_captures_on_one_port_are_refused_in_a_sentence():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=rf"UDP port {port} cannot be opened: Address already in use\.$"):
            next(known_sources()["udp"].open(f"127.0.0.1:{port}", SourceOptions()))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=rf"Port {port} cannot be opened: Address already in use\.$"):
            next(known_sources()["http"].open(f"127.0.0.1:{port}", SourceOptions()))
    ours, theirs = pty.openpty()
    first = known_sources()["serial"].open(os.ttyname(theirs), SourceOptions())
    next(first)
    with pytest.raises(UsageError, match="another program has it"):
        next(known_sources()["serial"].open(os.ttyname(theirs), SourceOptions()))
    first.close()  # type: ignore[attr-defined]  # a generator
    os.close(ours)
    os.close(theirs)


def test_a_file_that_grows(tmp_path):
    file = tmp_path / "growing.csv"
    file.write_text(CSV[:5000])
    source, address = find_source(f"follow:{file}")

    def append(line: bytes) -> None:
        with file.open("ab") as out:
            out.write(line)

    thread = sent(append, CSV[5000:])
    assert len(joined(samples_of(collected(source.open(address, SourceOptions()), 300)))) == 300
    thread.join()


def test_every_source_is_on_the_page_of_sources():
    """And what the page writes behind `tumble capture` is a source."""
    page = (Path(__file__).parents[3] / "docs" / "capture-sources.md").read_text()
    written = {
        find_source(word)[0].name
        for word in re.findall(r"tumble capture ([^-\s]\S*|-(?= ))", page)
        if word != "SOURCE"
    }
    assert (
        written | {"replay"} == {source.name for source in known_sources().values()} == set(known_sources())
    )
    simulated, address = find_source("simulated:consumer-mems@4@0")
    assert isinstance(next(iter(simulated.open(address, SourceOptions()))), Channels)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("bluetooth:1", "tcp:HOST:PORT"),
        ("serial:/dev/does-not-exist", "cannot be opened"),
        ("tcp:127.0.0.1:1", "Nobody answers"),
        ("ws://127.0.0.1:1/", "Nobody answers"),
        ("phyphox:127.0.0.1:1", "Allow remote access"),
        ("simulated:consumer-mems@x", "simulated"),
        ("simulated:consumer-mems@4@fast", "simulated"),
        ("simulated:consumer-mems@-1", "simulated"),
    ],
)
def test_what_is_no_source_or_does_not_answer_is_refused(source, said):
    def opened() -> None:
        found, address = find_source(source)
        next(iter(found.open(address, SourceOptions())))

    with pytest.raises(UsageError, match=said):
        opened()


def test_a_replay_has_the_magnetometer_of_its_file_slower_than_the_rows(tmp_path):
    field = np.round(0.003 * np.random.default_rng(7).standard_normal((300, 3)) + [0.2, -0.05, 0.42], 6)
    ends = [",".join(map(str, row)) if k % 4 == 1 else ",," for k, row in enumerate(field.tolist())]
    head, *lines = CSV.splitlines()
    rows = [",".join(pair) for pair in zip(lines, ends, strict=True)]
    (tmp_path / "in.csv").write_text("\n".join([head + ",mx [gauss],my [gauss],mz [gauss]", *rows]) + "\n")
    run_capture(replay_of(tmp_path / "in.csv", tmp_path / "out"))
    before, after = read_recording(tmp_path / "in.csv"), read_recording(tmp_path / "out" / "recording.csv")
    assert after.magnetic_field.unit == "gauss"
    np.testing.assert_array_equal(after.magnetic_field.time, before.magnetic_field.time)
    np.testing.assert_array_equal(after.magnetic_field.values, field[1::4])
    np.testing.assert_array_equal(signals(after)[0], signals(before)[0])
