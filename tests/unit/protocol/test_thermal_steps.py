"""Soaks and ramps in protocol files."""

from __future__ import annotations

from pathlib import Path

import pytest

from tumble.earth import Site
from tumble.errors import ProtocolError
from tumble.protocol import HoldStep, Protocol, RampStep, SoakStep, protocol_to_yaml, read_protocol

HEAD = (
    "format: tumble protocol\nprocedure: thermal\ngravity: 9.81\n"
    "steps:\n  - hold: z up\n    up: z\n    seconds: 30\n"
)


def read(tmp_path: Path, steps: str) -> Protocol:
    path = tmp_path / "p.yaml"
    path.write_text(HEAD + steps, encoding="utf-8")
    return read_protocol(path)


def test_soaks_and_ramps_are_read_in_their_units(tmp_path: Path) -> None:
    protocol = read(
        tmp_path,
        "  - soak: cold\n    temperature_celsius: -20\n    seconds: 1800\n"
        "  - ramp: down\n    from_celsius: 60\n    to_celsius: 20\n    rate_k_per_min: 0.5\n    tumble_every_s: 60\n",
    )
    _, soak, ramp = protocol.steps
    assert isinstance(soak, SoakStep)
    assert isinstance(ramp, RampStep)
    assert (soak.temperature_celsius, soak.tolerance, soak.duration) == (-20.0, 1.0, 1800.0)
    # 40 K at half a kelvin a minute are 80 minutes, downwards.
    assert ramp.duration == 4800.0
    assert ramp.rate == pytest.approx(-0.5 / 60.0)
    assert ramp.tumbled == 60.0


def test_what_is_written_reads_back(tmp_path: Path) -> None:
    steps = (
        HoldStep(30.0, None, "anyhow"),
        SoakStep(1801.3, -19.7, 0.35, "cold"),
        RampStep(9600.1, -19.7, 61.3, 0.0, "up"),
        RampStep(960.1, 61.3, 20.0, 45.5, "down", interval=(4.0, 964.1)),
    )
    protocol = Protocol("mine", "thermal", steps, Site.from_gravity(9.81))
    path = tmp_path / "p.yaml"
    path.write_text(protocol_to_yaml(protocol), encoding="utf-8")
    assert read_protocol(path).steps == steps


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ("  - soak: cold\n    seconds: 5\n", "`temperature_celsius` is missing"),
        ("  - soak:\n    temperature_celsius: 293.15\n", "`seconds` is missing"),
        ("  - soak:\n    temperature_celsius: 353\n    seconds: 5\n", "It is in °C, not in K."),
        ("  - ramp:\n    from_celsius: 4\n    to_celsius: 4\n    seconds: 9\n", "write a `soak:` instead"),
        (
            "  - ramp:\n    from_celsius: 4\n    to_celsius: 9\n    seconds: 9\n    rate_k_per_min: 1\n",
            "`seconds` and `rate_k_per_min` say the same",
        ),
    ],
)
def test_a_mistaken_soak_or_ramp_is_told(tmp_path: Path, steps: str, said: str) -> None:
    with pytest.raises(ProtocolError, match="line") as raised:
        read(tmp_path, steps)
    assert said in str(raised.value)
