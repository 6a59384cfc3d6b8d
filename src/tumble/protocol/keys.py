"""The keys of a protocol file: what each means, its unit, what holds without it, as ``keys.yaml`` has them.

The reader takes from here which keys there are and what they may be, the writer which it writes, the schema and the
documentation what they are.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cache
from math import pi
from pathlib import Path
from typing import Any

from tumble.files.documents import read_yaml
from tumble.protocol.steps import ASSUMED_RATE, HoldStep, RampStep, SoakStep, SpinStep, TurnStep
from tumble.records import dataclass
from tumble.units import DEGREE

FORMAT, VERSION = "tumble protocol", 1
REVOLUTION = 2.0 * pi
PPM = 1e-6
_FACTORS = {"°": DEGREE, "°/s": DEGREE, "turns": REVOLUTION, "″": DEGREE / 3600.0, "ppm of it": PPM}

STEPS: dict[str, type[Any]] = {
    "hold": HoldStep,
    "turn": TurnStep,
    "spin": SpinStep,
    "soak": SoakStep,
    "ramp": RampStep,
}
"""The kinds of steps, by the key that has a step's name."""


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a protocol file.

    Attributes
    ----------
    words : what it says, for people.
    unit : of its number; empty where it has none.
    default : what holds without it, in words; empty where it has to be there.
    schema : JSON schema of its value, which has the limits of a number.
    attribute : of the step, where the key's number alone says it.
    instead : what to write instead of a number beyond the limits.
    """

    words: str
    unit: str = ""
    default: str = ""
    schema: dict[str, Any] = field(default_factory=lambda: {"type": "string"})
    attribute: str = ""
    instead: str = ""

    @property
    def factor(self) -> float:
        """SI value of its unit."""
        return _FACTORS.get(self.unit, 1.0)


@cache
def _tables() -> dict[str, dict[str, Any]]:
    return read_yaml(Path(__file__).with_name("keys.yaml"))


@cache
def known_keys(of: str) -> dict[str, Key]:
    """Return the keys of the `protocol`, of its `site`, or of a kind of step."""
    keys = {name: Key(**said) for name, said in _tables()[of]["keys"].items()}
    assumed = ASSUMED_RATE / PPM
    return {name: replace(key, default=key.default.format(assumed=assumed)) for name, key in keys.items()}


def schema_of(of: str) -> dict[str, Any]:
    """Return the JSON schema of a mapping with those keys; what each says is its description."""
    properties: dict[str, Any] = {}
    for name, key in known_keys(of).items():
        unit = f" [{key.unit}]" if key.unit else ""
        default = f"; without it: {key.default}" if key.default else ""
        properties[name] = {**key.schema, "description": f"{key.words}{unit}{default}"}
    return {
        "type": "object",
        "properties": properties,
        "required": [],
        "additionalProperties": False,
        **_tables()[of]["rules"],
    }
