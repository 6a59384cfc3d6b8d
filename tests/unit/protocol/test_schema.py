"""The schema of protocol files says what the reader says, as far as a schema can see."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator

from tumble.earth import Site
from tumble.errors import ProtocolError
from tumble.protocol import (
    PROTOCOLS,
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    TurnStep,
    named_protocol,
    protocol_schema,
    protocol_to_yaml,
    read_protocol,
)

FITS = Draft202012Validator(protocol_schema()).is_valid
SITE = Site(9.81, 2e-5, 0.8, 100.0, "a tie")


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_file_of_a_named_protocol_fits(name: str) -> None:
    assert FITS(yaml.safe_load(protocol_to_yaml(replace(named_protocol(name), site=SITE))))


def test_the_schema_is_one() -> None:
    Draft202012Validator.check_schema(protocol_schema())


def test_a_file_with_every_key_fits() -> None:
    oblique = np.array([0.36, 0.48, -0.8])
    protocol = Protocol(
        "all",
        "multi-position",
        (
            HoldStep(1e-5, Pose(oblique, 0.3, 0.1), "", "a.csv", (0.0, 4.0)),
            TurnStep(2.0, oblique, 9.0, 0.1),
            HoldStep(2.0),
            SpinStep(2.0, -0.3, oblique, 1e-6, 0.0, angle=-0.4, angle_sigma=1e-5),
        ),
        SITE,
        "for people",
        ("a.csv", "b.csv"),
        "g",
        "ax,ay,az",
        12.5,
    )
    document = yaml.safe_load(protocol_to_yaml(protocol))
    assert FITS(document)
    like = {"format": "tumble protocol", "like": "six-position", "gravity": 9.81}
    assert FITS(like)


GOOD: dict[str, Any] = {
    "format": "tumble protocol",
    "procedure": "multi-position",
    "site": {"latitude_deg": 48.1},
    "steps": [
        {"hold": None, "up": "x", "seconds": 30},
        {"turn": "over", "axis": [0, 1, -1], "angle_deg": 90, "seconds": 3},
        {"hold": "z up", "up": [0, 0, 1], "interval_s": [0, 9]},
        {"spin": None, "rate_deg_per_s": -41.78, "revolutions": 3},
    ],
}


def spoilt(*path: str | int, value: Any = ...) -> dict[str, Any]:
    """GOOD with another value, or without that key."""
    document = json.loads(json.dumps(GOOD))
    at = document
    for key in path[:-1]:
        at = at[key]
    if value is ...:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return document


MISTAKES = [
    spoilt("format"),
    spoilt("format", value="tumble calibration"),
    spoilt("version", value=2),
    spoilt("nmae", value="x"),
    spoilt("procedure"),
    spoilt("site"),
    spoilt("gravity", value=9.81),
    spoilt("like", value="six-position"),
    spoilt("site", value={"height_m": 3}),
    spoilt("site", "latitude_deg", value=91),
    spoilt("site", "latitude_deg", value="48"),
    spoilt("angles", value="clockwise"),
    spoilt("recordings", value=["a.csv", "a.csv"]),
    spoilt("rate_hz", value=0),
    spoilt("steps"),
    spoilt("steps", value=[]),
    spoilt("steps", value=[{"turn": None, "seconds": 1}]),
    spoilt("steps", 0, "seconds"),
    spoilt("steps", 0, "seconds", value=-30),
    spoilt("steps", 0, "up", value="nose"),
    spoilt("steps", 0, "up", value=[0, 1]),
    spoilt("steps", 0, "attitude_deg", value=[0, 0, 0]),
    spoilt("steps", 0, "uncertainty_deg", value=-5),
    spoilt("steps", 2, "interval_s", value=[1]),
    spoilt("steps", 1, "angle_deg", value=400),
    spoilt("steps", 1, "revolutions", value=2),
    spoilt("steps", 1, "hold", value="too"),
    spoilt("steps", 3, "rate_deg_per_s"),
    spoilt("steps", 3, "rate_deg_per_s", value=0),
    spoilt("steps", 3, "revolutions"),
    spoilt("steps", 3, "revolutions", value=-1),
    spoilt("steps", 3, "seconds", value=9),
    spoilt("steps", 3, "ramp_s", value=-1),
    spoilt("steps", 3, "angle_deg", value=0),
    spoilt("steps", 3, "angle_uncertainty_arcsec", value=2),
    spoilt("steps", value=[{"hold": "h", "heading_deg": 3, "seconds": 9}]),
    spoilt("steps", value=[GOOD["steps"][0], {"turn": None, "uncertainty_deg": 1, "seconds": 9}]),
]


def test_schema_and_reader_accept_the_document_that_is_spoilt_below(tmp_path: Path) -> None:
    assert FITS(GOOD)
    (tmp_path / "p.yaml").write_text(json.dumps(GOOD), encoding="utf-8")
    assert len(read_protocol(tmp_path / "p.yaml").steps) == 4


@pytest.mark.parametrize("document", MISTAKES)
def test_what_the_schema_refuses_the_reader_refuses_too(document: dict[str, Any], tmp_path: Path) -> None:
    assert not FITS(document)
    (tmp_path / "p.yaml").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ProtocolError):
        read_protocol(tmp_path / "p.yaml")
