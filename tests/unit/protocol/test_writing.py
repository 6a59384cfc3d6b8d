"""A protocol's file: readable, explained, whole or not at all."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tumble.earth import Site
from tumble.errors import OutputError, ProtocolError
from tumble.protocol import (
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    TurnStep,
    named_protocol,
    protocol_to_yaml,
    read_protocol,
    write_protocol,
)

SITE = Site.from_latitude(np.radians(48.1), 520.0)
X = np.array([1.0, 0.0, 0.0])
DEGREE = np.pi / 180.0


def text_of(*steps: HoldStep | TurnStep | SpinStep) -> str:
    return protocol_to_yaml(Protocol("p", "multi-position", steps, SITE)).partition("steps:\n")[2]


def test_a_file_reads_like_the_hand_of_a_person() -> None:
    edge = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
    assert (
        text_of(
            HoldStep(30.0, Pose(-X, 45.0 * DEGREE, 0.5 * DEGREE), "x down"),
            TurnStep(3.0, edge, -1.5 * np.pi, 0.1 * DEGREE),
            HoldStep(30.0, None, "#2: on its side", file="b.csv", interval=(1.0, 31.0)),
            SpinStep(4.0 * np.pi / (50.0 * DEGREE), 50.0 * DEGREE),
            TurnStep(9.0, X, 5.0 * np.pi),
        )
        == """\
  - hold: x down
    up: -x
    heading_deg: 45
    uncertainty_deg: 0.5
    seconds: 30
  - turn:
    axis: [1, 0, -1]
    angle_deg: -270
    uncertainty_deg: 0.1
    seconds: 3
  - hold: '#2: on its side'
    seconds: 30
    file: b.csv
    interval_s: [1, 31]
  - spin:
    axis: up
    rate_deg_per_s: 50
    revolutions: 2
    ramp_s: 2
  - turn:
    axis: x
    revolutions: 2.5
    uncertainty_deg: 0
    seconds: 9
"""
    )


def test_the_file_explains_itself_and_says_its_conventions() -> None:
    text = protocol_to_yaml(replace(named_protocol("six-position"), site=SITE))
    head, _, body = text.partition("format: tumble protocol\n")
    assert all(line.startswith("#") for line in head.splitlines())
    assert "docs/protocols.md" in head
    assert "site:\n  latitude_deg: 48.1\n  height_m: 520\n" in body
    assert "counter-clockwise for someone whom the axis points at" in body
    assert "north, east, down" in body


def test_the_named_protocols_have_whole_revolutions_and_short_numbers() -> None:
    text = protocol_to_yaml(replace(named_protocol("rate-table"), site=SITE))
    assert "rate_deg_per_s: -200\n    revolutions: 10\n" in text
    assert max(map(len, text.partition("steps:")[2].splitlines())) < 50


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (
            HoldStep(0.0),
            "The protocol 'p' cannot be a file, step 1: `seconds` is 0: it has to be more than 0.",
        ),
        (HoldStep(float("nan"), None, "h"), r"step 1 \(h\): `seconds` is nan: a finite number is needed."),
        (
            HoldStep(1.0, Pose(2.0 * X)),
            r"The direction \[2.0, 0.0, 0.0\] has the length 2: divide it by that.",
        ),
        (HoldStep(1.0, Pose(X, None, -1.0)), "`uncertainty_deg` is -57.29"),
        (SpinStep(1.0, 1.0), "a spin without a hold before it"),
    ],
)
def test_what_cannot_be_read_is_not_written(step: HoldStep | SpinStep, said: str, tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match=said):
        write_protocol(Protocol("p", "multi-position", (step,), SITE), tmp_path / "p.yaml")
    assert not list(tmp_path.iterdir())


def test_a_protocol_without_a_site_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match="The protocol 'six-position' cannot be a file: it has no site"):
        write_protocol(named_protocol("six-position"), tmp_path / "p.yaml")
    assert not list(tmp_path.iterdir())


def test_an_earlier_file_is_replaced_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    write_protocol(replace(named_protocol("rate-table"), site=SITE), path)
    write_protocol(replace(named_protocol("six-position"), site=SITE), path)
    assert read_protocol(path).name == "six-position"
    assert os.listdir(tmp_path) == ["p.yaml"]


def test_a_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No such file or directory"):
        write_protocol(replace(named_protocol("six-position"), site=SITE), tmp_path / "none" / "p.yaml")
