"""Binary formats: whole frames give the samples that were put in, and damaged ones cost only themselves."""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable

import numpy as np
import pytest

from tumble.capture.link import formats
from tumble.capture.samples import Channels
from tumble.capture.source import Notice, Piece, SourceOptions
from tumble.recording.samples import Samples, joined

COUNT, RATE = 200, 100.0
rng = np.random.default_rng(7)
FORCE = (rng.standard_normal((COUNT, 3)) + np.array([1.0, -2.0, 9.5])).astype(np.float32)
TURN = (0.3 * rng.standard_normal((COUNT, 3)) + np.array([0.1, 0.0, -0.2])).astype(np.float32)


def xbus(k: int) -> bytes:
    def item(identifier: int, content: bytes) -> bytes:
        return struct.pack(">HB", identifier, len(content)) + content

    body = item(0x1020, struct.pack(">H", k)) + item(
        0x1060, struct.pack(">I", (2**32 - 50 * 100 + k * 100) % 2**32)
    )
    body += item(0x4020, struct.pack(">3f", *FORCE[k])) + item(0x8020, struct.pack(">3f", *TURN[k]))
    body += item(0x0810, struct.pack(">f", 31.5))
    message = b"\xff\x36" + bytes([len(body)]) + body
    return b"\xfa" + message + bytes([-sum(message) & 0xFF])


def vn_line(k: int) -> bytes:
    cells = [0.1, 0.2, 0.3, *FORCE[k], *TURN[k], 25.5, 101.3]
    body = "VNIMU," + ",".join(f"{v:+.7f}" for v in cells)
    check = 0
    for one in body.encode():
        check ^= one
    return f"${body}*{check:02X}\r\n".encode()


def vn_binary(k: int) -> bytes:
    # Groups 1 (TimeStartup) and 3 (uncompensated forces and rates, temperature).
    body = struct.pack("<BHH", 0b101, 1, 0b11100) + struct.pack("<Q", round(1e9 * k / RATE))
    body += struct.pack("<3f", *FORCE[k]) + struct.pack("<3f", *TURN[k]) + struct.pack("<f", 25.5)
    return b"\xfa" + body + struct.pack(">H", crc_hqx(body, 0))


def mavlink(k: int) -> bytes:
    from pymavlink.dialects.v20 import common

    link = common.MAVLink(None, srcSystem=1, srcComponent=1)
    link.seq = k % 256
    message = common.MAVLink_highres_imu_message(
        k * 10_000, *map(float, FORCE[k]), *map(float, TURN[k]), 0, 0, 0, 0, 0, 0, 25.5, 0xFFFF
    )
    return bytes(message.pack(link))


MAKERS: list[tuple[str, Callable[[int], bytes]]] = [
    ("xbus", xbus), ("vectornav", vn_line), ("vectornav", vn_binary), ("mavlink", mavlink)
]  # fmt: skip


def decoded(name: str, data: bytes, cut: int = 37) -> tuple[Channels, Samples, list[Piece]]:
    decoder = formats()[name].decoder(SourceOptions(), "a test")
    pieces: list[Piece] = []
    for start in range(0, len(data), cut):
        pieces += decoder.feed(data[start : start + cut], start / len(data) * COUNT / RATE)
    pieces += decoder.end()
    return (
        next(p for p in pieces if isinstance(p, Channels)),
        joined([p for p in pieces if isinstance(p, Samples)]),
        pieces,
    )


@pytest.mark.parametrize(("name", "make"), MAKERS)
def test_frames_give_what_was_put_in(name: str, make: Callable[[int], bytes]) -> None:
    data = b"".join(make(k) for k in range(COUNT))
    channels, samples, _ = decoded(name, data)
    assert (channels.specific_force_unit, channels.angular_rate_unit) == ("m/s^2", "rad/s")
    assert channels.rate == pytest.approx(RATE, rel=0.05)
    assert len(samples) == COUNT
    assert samples.specific_force is not None
    assert samples.angular_rate is not None
    assert np.allclose(samples.specific_force, FORCE, atol=1e-6)
    assert np.allclose(samples.angular_rate, TURN, atol=1e-6)
    assert np.all(np.diff(samples.time) > 0.0)
    if make is not vn_line:
        assert np.allclose(np.diff(samples.time), 1.0 / RATE, atol=1e-6)


@pytest.mark.parametrize(("name", "make"), MAKERS)
def test_garbage_and_half_frames_cost_only_themselves(name: str, make: Callable[[int], bytes]) -> None:
    frames = [make(k) for k in range(COUNT)]
    frames[40] = frames[40][:-7]
    frames[80] = frames[80][:9] + bytes([frames[80][9] ^ 0x55]) + frames[80][10:]
    frames.insert(120, bytes(range(256)) * 2)
    _, samples, _ = decoded(name, b"".join(frames))
    # A false start in the garbage may swallow what follows it, a frame or two.
    assert COUNT - 8 <= len(samples) <= COUNT - 2


@pytest.mark.parametrize(("name", "make"), MAKERS)
def test_each_format_is_recognised_and_no_other_claims_it(name: str, make: Callable[[int], bytes]) -> None:
    head = b"\x00\x41" + b"".join(make(k) for k in range(10))
    assert [one.name for one in formats().values() if one.recognises(head)] == [name]


def test_text_is_claimed_by_no_binary_format() -> None:
    head = b"t,ax,ay,az\n0.01,0.1,0.2,9.8\n" * 30
    assert not [one.name for one in formats().values() if one.recognises(head)]


def test_the_length_of_a_message_that_a_public_logger_states() -> None:
    # LoggerWavesInIce, its README: fa 14 3e 00 3a 00 is a message of 123 bytes after the sync.
    body = bytes.fromhex("143e003a00") + bytes(116)
    message = b"\xfa" + body + struct.pack(">H", crc_hqx(body, 0))
    assert len(message) == 1 + 123
    from tumble.capture.decoders.vectornav import VectorNav

    used, measured, good = VectorNav().take(message)
    assert (used, good) == (124, True)
    assert measured is not None


def test_a_device_that_corrects_already_is_told() -> None:
    body = b"VNYMR,1,2,3,0.1,0.2,0.3,0.1,0.2,9.8,0.01,0.02,0.03"
    line = b"$" + body + f"*{crc_hqx(body, 0):04X}\r\n".encode()
    _, samples, pieces = decoded("vectornav", line * 60)
    assert len(samples) == 60
    assert any("corrected" in p.words for p in pieces if isinstance(p, Notice))
