"""Lines that come over a port, a socket, a pipe or a growing file: what is understood, and what garbage does."""

from __future__ import annotations

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
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.capture.recordings import by_hand

from tumble.capture.apart import SensorLines
from tumble.capture.link import Decoder
from tumble.capture.source import Channels, Notice, Piece, SourceOptions, find_source, sources
from tumble.capture.text_lines import TextLines
from tumble.errors import RecordingError, UsageError
from tumble.recording.samples import Samples, joined

RECORDING = by_hand(1, seed=21)


def rows(count: int = 300) -> Iterator[tuple[float, ...]]:
    assert RECORDING.specific_force is not None
    assert RECORDING.angular_rate is not None
    for k in range(count):
        yield (RECORDING.time[k], *RECORDING.specific_force[k], *RECORDING.angular_rate[k])


def as_csv() -> str:
    return "t,ax,ay,az,gx [rad/s],gy [rad/s],gz [rad/s]\n" + "".join(
        ",".join(f"{v:.6f}" for v in row) + "\n" for row in rows()
    )


def as_pairs(sign: str) -> str:
    names = ("t_ms", "ax", "ay", "az", "gx", "gy", "gz")
    return "".join(
        " ".join(f"{n}{sign}{v * (1000 if n == 't_ms' else 1):.6f}" for n, v in zip(names, row, strict=True))
        + "\r\n"
        for row in rows()
    )


def as_json() -> str:
    return "".join(
        f'{{"t":{r[0]:.6f},"accel":{{"x":{r[1]:.6f},"y":{r[2]:.6f},"z":{r[3]:.6f}}},'
        f'"gyro":[{r[4]:.6f},{r[5]:.6f},{r[6]:.6f}]}}\n'
        for r in rows()
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


@pytest.mark.parametrize(
    "text", [as_csv(), as_pairs(":"), as_pairs("="), as_json()], ids=["csv", "a:1", "a=1", "json"]
)
def test_lines_of_every_kind_give_the_same_samples(text: str) -> None:
    channels, samples, decoder = decoded(text.encode())
    assert channels.specific_force_unit == "m/s^2"
    assert channels.rate == pytest.approx(100.0, rel=0.02)
    assert RECORDING.specific_force is not None
    assert RECORDING.angular_rate is not None
    assert samples.specific_force is not None
    assert samples.angular_rate is not None
    assert np.allclose(samples.specific_force, RECORDING.specific_force[:300], atol=1e-6)
    assert np.allclose(samples.angular_rate, RECORDING.angular_rate[:300], atol=1e-6)
    assert np.allclose(np.diff(samples.time), 0.01, atol=1e-5)
    assert decoder.damaged == 0


def test_a_gyro_whose_unit_nobody_says_is_counts_and_not_a_guess() -> None:
    assert decoded(as_pairs(":").encode())[0].angular_rate_unit == "counts"
    said = decoded(as_pairs(":").encode(), SourceOptions(units="m/s^2,rad/s"))
    assert said[0].angular_rate_unit == "rad/s"


def test_motioncal_lines_are_read_with_their_scales() -> None:
    assert RECORDING.specific_force is not None
    lines = "".join(
        "Raw:"
        + ",".join(
            str(round(v)) for v in [*(np.array(r[1:4]) / 9.80665 * 8192), *(np.degrees(r[4:7]) * 16), 1, 2, 3]
        )
        + "\r\n"
        for r in rows()
    )
    channels, samples, _ = decoded(lines.encode(), SourceOptions(rate=100.0))
    assert (channels.specific_force_unit, channels.angular_rate_unit) == ("g", "deg/s")
    assert samples.specific_force is not None
    assert np.allclose(9.80665 * samples.specific_force, RECORDING.specific_force[:300], atol=1.5e-3)


def test_lines_without_stamps_out_of_a_pipe_have_the_stated_rate() -> None:
    lines = "".join(",".join(f"{v:.6f}" for v in row[1:]) + "\n" for row in rows())
    options = SourceOptions(rate=100.0, units="m/s^2,rad/s")
    _, samples, _ = decoded(lines.encode(), options, cut=6000)
    assert samples.time[-1] - samples.time[0] == pytest.approx(2.99, abs=0.02)


def test_motioncal_s_two_lines_a_sample_are_one_sample_and_no_damage() -> None:
    lines = []
    for k in range(200):
        lines.append(f"Raw:{k},{-k},8192,{k},0,0,1,2,3")
        lines.append(
            f"17:50:0{k // 40}.{k % 40:03d} -> Uni:0.1,{k / 1000},9.80665,0.01,-0.02,0.03,20.1,-3.2,41.7"
        )
    _, samples, decoder = decoded("\n".join(lines).encode())
    assert decoder.damaged == 0
    assert decoder.good >= 200
    assert len(samples) == 200
    assert samples.specific_force is not None
    np.testing.assert_allclose(samples.specific_force[:, 1], np.arange(200) / 1000)


def test_sentences_of_a_navigation_unit_with_a_wrong_checksum_are_passed_over() -> None:
    def sentence(values: str, check: str | None = None) -> str:
        body = f"VNIMU,0.1,0.2,0.3,0.1,-0.2,9.8,{values},25.5,101.3"
        return f"${body}*{check or format(reduce(xor, body.encode()), '02X')}\r\n"

    lines = [sentence(f"{k / 1000},0.02,-0.03") for k in range(200)]
    lines[50:50] = [sentence("7,7,7", "00"), "$GPGGA,1,2,3*55\r\n", sentence("7,7,x"), lines[9][:30] + "\r\n"]
    channels, samples, decoder = decoded("".join(lines).encode(), SourceOptions(rate=100.0))
    assert (channels.specific_force_unit, channels.angular_rate_unit) == ("m/s^2", "rad/s")
    assert samples.angular_rate is not None
    np.testing.assert_allclose(samples.angular_rate[:, 0], np.arange(200) / 1000)
    assert samples.temperature is not None
    assert set(samples.temperature) == {25.5}
    assert decoder.damaged == 4


def test_names_of_columns_that_come_between_the_rows_are_theirs() -> None:
    lines = as_csv().splitlines(keepends=True)
    mixed = "".join([*lines[1:30], lines[0], *lines[30:200], lines[0], *lines[200:]])
    channels, samples, decoder = decoded(mixed.encode(), cut=3000)
    assert channels.angular_rate_unit == "rad/s"
    assert len(samples) == 300
    assert decoder.damaged == 0


def test_garbage_and_half_lines_are_counted_and_passed_over() -> None:
    lines = as_csv().encode().split(b"\n")
    lines[50] = b"\xff\xfe\x00garbage"
    lines[51] = lines[51][:20]
    lines[90:90] = [b"12,13", b"a,b", b"nan,nan,nan,nan,nan,nan,nan"]
    _, samples, decoder = decoded(b"\n".join(lines))
    assert len(samples) == 298
    assert decoder.damaged >= 4


@settings(max_examples=60, deadline=None)
@given(st.lists(st.binary(max_size=300), max_size=8), st.sampled_from([TextLines, SensorLines]))
def test_no_bytes_raise_anything_but_a_sentence(
    parts: list[bytes], kind: Callable[[SourceOptions, str], Decoder]
) -> None:
    decoder = kind(SourceOptions(), "a test")
    try:
        for k, part in enumerate(parts):
            decoder.feed(part, 0.1 * k)
        decoder.end()
    except (RecordingError, UsageError):
        pass


def collected(pieces: Iterator[Piece], wanted: int, seconds: float = 20.0) -> list[Piece]:
    """Take pieces until there are so many samples."""
    found: list[Piece] = []
    end = time.monotonic() + seconds
    for piece in pieces:
        found += [piece] if piece is not None else []
        if sum(len(p) for p in found if isinstance(p, Samples)) >= wanted or time.monotonic() > end:
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


def count_of(pieces: list[Piece]) -> int:
    return sum(len(p) for p in pieces if isinstance(p, Samples))


def test_a_serial_port() -> None:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    source, address = find_source(os.ttyname(theirs))
    thread = sent(lambda b: os.write(ours, b), as_csv())
    found = collected(source.open(address, SourceOptions()), 280)
    thread.join()
    assert count_of(found) >= 280
    os.close(ours)
    os.close(theirs)


def test_a_tcp_server_that_goes_and_comes_back() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    lines = as_csv().splitlines(keepends=True)

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
    assert count_of(found) >= 295
    assert [p.kind for p in found if isinstance(p, Notice)][:2] == ["silence", "remark"]


def test_udp_packets() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    source, address = find_source(f"udp:127.0.0.1:{port}")
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    pieces = source.open(address, SourceOptions())
    next(pieces)
    thread = sent(lambda b: out.sendto(b.rstrip(), ("127.0.0.1", port)), as_csv())
    found = collected(pieces, 250)
    thread.join()
    out.close()
    assert count_of(found) >= 250


def test_two_captures_on_one_port_are_refused_in_a_sentence() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=rf"UDP port {port} cannot be opened: Address already in use\.$"):
            next(sources()["udp"].open(f"127.0.0.1:{port}", SourceOptions()))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=rf"Port {port} cannot be opened: Address already in use\.$"):
            next(sources()["http"].open(f"127.0.0.1:{port}", SourceOptions()))
    ours, theirs = pty.openpty()
    first = sources()["serial"].open(os.ttyname(theirs), SourceOptions())
    next(first)
    with pytest.raises(UsageError, match="another program has it"):
        next(sources()["serial"].open(os.ttyname(theirs), SourceOptions()))
    first.close()  # type: ignore[attr-defined]  # a generator
    os.close(ours)
    os.close(theirs)


def test_a_file_that_grows(tmp_path: Path) -> None:
    file = tmp_path / "growing.csv"
    text = as_csv()
    file.write_text(text[:5000])
    source, address = find_source(f"follow:{file}")

    def append(line: bytes) -> None:
        with file.open("ab") as out:
            out.write(line)

    thread = sent(append, text[5000:])
    found = collected(source.open(address, SourceOptions()), 300)
    thread.join()
    assert count_of(found) == 300


def test_what_is_no_source_is_refused_with_what_there_is() -> None:
    with pytest.raises(UsageError, match="tcp:HOST:PORT"):
        find_source("bluetooth:1")
    with pytest.raises(UsageError, match="cannot be opened"):
        next(sources()["serial"].open("/dev/does-not-exist", SourceOptions()))
    with pytest.raises(UsageError, match="Nobody answers"):
        next(sources()["tcp"].open("127.0.0.1:1", SourceOptions()))


def test_every_source_is_on_the_page_of_sources() -> None:
    """And what the page writes behind `tumble capture` is a source."""
    page = (Path(__file__).parents[3] / "docs" / "capture-sources.md").read_text()
    written = {
        find_source(word)[0].name
        for word in re.findall(r"tumble capture ([^-\s]\S*|-(?= ))", page)
        if word != "SOURCE"
    }
    assert written | {"replay"} == set(sources())


def test_every_source_says_what_it_is() -> None:
    for name, source in sources().items():
        assert name == source.name
        assert source.title
        assert source.example
