"""Protocol files: what is written is read back to the last bit, whatever a protocol holds."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import given, strategies as st

from contract.test_protocols import same
from tumble.earth import Site, normal_gravity
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.protocol import (
    HoldStep,
    Pose,
    Protocol,
    SpinStep,
    Step,
    TurnStep,
    protocol_to_yaml,
    read_protocol,
    write_protocol,
)


def unit(vector: tuple[float, float, float]) -> np.ndarray:
    return np.array(vector) / np.linalg.norm(vector)


TIME = st.floats(1e-6, 1e6) | st.integers(1, 600).map(float)
ANGLE = st.floats(-6.28, 6.28) | st.integers(-360, 360).map(np.radians).map(float)
SIGMA = st.just(0.0) | st.floats(0.0, 3.1) | st.integers(0, 179).map(np.radians).map(float)
COMPONENT = st.floats(-1.0, 1.0) | st.sampled_from([-1.0, 0.0, 1.0])
AXIS = st.tuples(COMPONENT, COMPONENT, COMPONENT).filter(lambda v: np.linalg.norm(v) > 1e-3).map(unit)
NASTY = ["null", "~", "yes", "1e3", "- a", "a: b", "#", "'\"\\", "é°\n\t "]
WORDS = st.text(max_size=12) | st.sampled_from(NASTY)
NAMED = WORDS.filter(bool)
POSE = st.builds(Pose, AXIS, st.none() | ANGLE, SIGMA)


def surveyed(latitude: float, height: float, disturbance: float, sigma: float, source: str) -> Site:
    """A place whose gravity was measured: that of the latitude, but for a disturbance."""
    gravity = normal_gravity(latitude, height) + 0.999 * disturbance
    return Site(gravity, sigma, latitude, height, source)


SITE = st.one_of(
    st.builds(Site.from_latitude, st.floats(-1.57, 1.57), st.floats(-500.0, 10_000.0)),
    st.builds(Site.from_gravity, st.floats(9.75, 9.85)),
    st.builds(
        Site, st.floats(9.75, 9.85), st.floats(0.0, 0.1), st.none(), st.floats(-500.0, 10_000.0), WORDS
    ),
    st.builds(
        surveyed,
        st.floats(-1.57, 1.57),
        st.floats(-500.0, 4000.0),  # above, gravity may be below 9.75 m/s², which is refused as a given one
        st.floats(-5e-3, 5e-3),
        st.floats(0.0, 0.1),
        WORDS,
    ),
)


@st.composite
def steps(draw: Callable[..., Any]) -> tuple[Step, ...]:
    """Steps that can be: a hold first, spins after a hold, intervals in order, each file in one stretch."""
    kinds = ["hold", *draw(st.lists(st.sampled_from(["hold", "turn", "spin"]), max_size=6))]
    drawn: list[Step] = []
    clock, file = 0.0, draw(st.none() | NAMED)
    for number, kind in enumerate(kinds):
        if file is not None and draw(st.booleans()):
            file, clock = f"{file}{number}", 0.0
        interval = None
        if draw(st.booleans()):
            start = clock + draw(st.floats(0.0, 1e4))
            clock = start + draw(st.floats(1e-3, 1e4))
            interval = (start, clock)
        place = {"name": draw(WORDS), "file": file, "interval": interval}
        if kind == "hold":
            drawn.append(HoldStep(draw(TIME), draw(st.none() | POSE), **place))
        elif kind == "turn":
            angle = draw(st.none() | ANGLE | st.floats(-100.0, 100.0))
            sigma = 0.0 if angle is None else draw(SIGMA)
            drawn.append(TurnStep(draw(TIME), draw(st.none() | AXIS), angle, sigma, **place))
        elif not isinstance(drawn[-1], TurnStep):
            rate = draw(st.floats(-50.0, 50.0).filter(lambda r: abs(r) > 1e-6))
            turns = draw(st.none() | st.integers(1, 500))
            duration = draw(TIME) if turns is None else turns * (2.0 * np.pi / abs(rate))
            spread, ramp = draw(st.none() | st.floats(0.0, 1.0)), draw(st.floats(0.0, 60.0))
            turned = draw(st.none() | st.floats(1e-6, 1e3) | st.integers(1, 9000).map(np.radians).map(float))
            shown = (
                {} if turned is None else {"angle": math.copysign(turned, rate), "angle_sigma": draw(SIGMA)}
            )
            drawn.append(SpinStep(duration, rate, draw(st.none() | AXIS), spread, ramp, **place, **shown))
    return tuple(drawn)


PROTOCOL = st.builds(
    Protocol,
    WORDS,
    st.sampled_from(KNOWN_PROCEDURES),
    steps(),
    SITE,
    WORDS,
    st.lists(NAMED, max_size=3, unique=True).map(tuple),
    st.none() | WORDS,
    st.none() | WORDS,
    st.none() | TIME,
)


@given(PROTOCOL)
def test_a_protocol_is_read_back_as_it_was_written(tmp_path_factory: Any, protocol: Protocol) -> None:
    path = tmp_path_factory.getbasetemp() / "law.yaml"
    write_protocol(protocol, path)
    assert path.read_text(encoding="utf-8") == protocol_to_yaml(protocol)
    assert same(read_protocol(path), protocol)


def test_the_comparison_above_sees_the_last_bit() -> None:
    one = Protocol("p", "joint", (HoldStep(1.0, Pose(np.array([0.0, 0.0, 1.0]))),))
    other = Protocol("p", "joint", (HoldStep(1.0, Pose(np.array([0.0, 5e-324, 1.0]))),))
    assert same(one, one)
    assert not same(one, other)
