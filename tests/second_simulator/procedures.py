"""The nine tests as a person would do them: motion, protocol file and truth of each.

Every function takes a grade, a source of chance, and a fault by name, and returns a `Simulation`. A fault that has
no meaning for a test is refused.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from . import rotations as so3
from .motion import STILL, Hand, Path, trapezoid_angle
from .recording import RECORD_FAULTS, STATED_FAULTS, Place, Simulation, record
from .sensors import DEGREE, Grade, draw_unit
from .truth import Thermal

ARCSECOND = DEGREE / 3600
UP = np.array([0.0, 0.0, -1.0])
PPM = 1e-6

FACES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}


def directions(kinds: Sequence[int]) -> list[np.ndarray]:
    """Return directions of faces (1), edges (2) and corners (3) of a cube."""
    every = [np.array(v, float) for v in itertools.product((1, 0, -1), repeat=3)]
    return [v for kind in kinds for v in every if np.count_nonzero(v) == kind]


def posed(up: np.ndarray, heading: float) -> np.ndarray:
    """Return the attitude of a pose as protocols state it: what points up, and the turn about the vertical.

    The heading is clockwise from above, rad.
    """
    return so3.multiply(so3.exponential(-heading * UP), so3.between(up, UP))


def _off(attitude: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    return so3.multiply(attitude, so3.exponential(sigma * rng.standard_normal(3)))


def _tilted(attitude: np.ndarray, tilt: np.ndarray) -> np.ndarray:
    """Return an attitude on a plate that leans by a rotation vector in the room."""
    return so3.multiply(so3.exponential(tilt), attitude)


def _lean(size: float, rng: np.random.Generator) -> np.ndarray:
    return np.append(size * rng.standard_normal(2), 0.0)


def _lean_exactly(size: float, rng: np.random.Generator) -> np.ndarray:
    towards = rng.uniform(0, 2 * np.pi)
    return size * np.array([np.cos(towards), np.sin(towards), 0.0])


def _direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _check(fault: str | None, own: Sequence[str]) -> None:
    if fault is not None and fault not in (*RECORD_FAULTS, *STATED_FAULTS, *own):
        raise ValueError(f"{fault} is no fault of this test; it has {', '.join(own)} and those of all tests")


class Text:
    """A protocol file in the making."""

    def __init__(self, name: str, procedure: str, place: Place, units: str) -> None:
        self.lines = [
            "format: tumble protocol", "version: 1", f"name: {name}", f"procedure: {procedure}", place.text(), "steps:",
        ]  # fmt: skip

    def step(self, kind: str, name: str, **keys: object) -> None:
        """Append a step.

        Keys are in the file's own spelling; None is left out, vectors are written as lists.
        """
        self.lines.append(f'  - {kind}: "{name}"')
        for key, value in keys.items():
            if value is None:
                continue
            shown = value
            if isinstance(value, np.ndarray):
                shown = "[" + ", ".join(repr(float(v)) for v in value) + "]"
            elif isinstance(value, float | np.floating):
                shown = repr(float(value))
            self.lines.append(f"    {key}: {shown}")

    def __str__(self) -> str:
        return "\n".join(self.lines) + "\n"


def _hold(path, seconds, hand, rng, name, bump) -> None:
    """Hold, or be bumped in the middle: the pose jumps within a fifth of a second and stays."""
    if bump is None:
        path.hold(seconds, hand, rng, name)
    else:
        path.creep(seconds, bump, lambda s: np.clip((s - 0.5) * seconds / 0.2, 0, 1), name)


HAND_FAULTS = ("bumped", "loose")


def by_hand(grade, rng, fault=None, *, poses=26, rate=100.0) -> Simulation:
    """Rest, turn, rest, turn: faces, edges and corners in random order, turned by hand.

    ``loose``: a third of the holds creep.
    """
    _check(fault, HAND_FAULTS)
    place = Place.draw(grade, rng, fault)
    text = Text("by hand", "hand-held", place, grade.units)
    ups = directions((1, 2, 3))
    order = rng.permutation(26)[:poses] if poses <= 26 else rng.integers(0, 26, poses)
    hand = Hand()
    targets = [_off(posed(ups[k], rng.uniform(0, 2 * np.pi)), 3 * DEGREE, rng) for k in order]
    path = Path(rate, 4, targets[0])
    bumped = int(rng.integers(1, poses - 1)) if fault == "bumped" else -1
    for k, target in enumerate(targets):
        if k:
            way = np.linalg.norm(so3.logarithm(so3.multiply(so3.inverse(path.attitude), target)))
            path.turn_to(target, max(1.0, way / rng.uniform(1.2, 2.4)) + rng.uniform(0.0, 0.5), hand, rng)
        seconds = 10.0 if k in (0, poses - 1) else rng.uniform(3.5, 6.0)
        bump = 0.3 * DEGREE * _direction(rng) if k == bumped else None
        if fault == "loose" and k % 3 == 1:
            path.creep(seconds, 0.1 * DEGREE * _direction(rng))
        else:
            _hold(path, seconds, hand, rng, f"pose {k + 1}", bump)
        text.step("hold", f"pose {k + 1}", up=ups[order[k]], uncertainty_deg=5, seconds=seconds)
    made = record(path, grade, place, str(text), rng, lever=np.array([0.01, -0.005, 0.02]), fault=fault)
    if fault == "two-units":
        made.other = by_hand(grade, rng, None, poses=poses, rate=rate)
    return made


def multi_position(grade, rng, fault=None, *, poses=24, seconds=12.0, rate=100.0) -> Simulation:
    """Lay the unit down in many poses that nobody has to know."""
    _check(fault, HAND_FAULTS)
    place = Place.draw(grade, rng, fault)
    text = Text("many poses", "multi-position", place, grade.units)
    ups = directions((1, 2, 3))
    order = np.concatenate((np.arange(18), 18 + rng.permutation(8)))[:poses]
    rng.shuffle(order)
    path = Path(rate, 4)
    bumped = int(rng.integers(1, poses - 1)) if fault == "bumped" else -1
    for k, at in enumerate(order):
        target = _off(posed(ups[at], rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng)
        path.reach(target, rng.uniform(1.5, 4.0) if path.samples else 0.0, Hand(), rng)
        if fault == "loose" and k % 3 == 1:
            path.creep(seconds, 0.1 * DEGREE * _direction(rng))
        else:
            bump = 0.3 * DEGREE * _direction(rng) if k == bumped else None
            _hold(path, seconds, STILL, rng, f"pose {k + 1}", bump)
        text.step("hold", f"pose {k + 1}", up=ups[at], uncertainty_deg=5, seconds=seconds)
    made = record(path, grade, place, str(text), rng, fault=fault)
    if fault == "two-units":
        made.other = multi_position(grade, rng, None, poses=poses, seconds=seconds, rate=rate)
    return made


SIX_FAULTS = ("bumped", "pose-off", "four-poses-off", "plate-leans")


def six_faces(grade, rng, fault=None, *, placement=0.05 * DEGREE, seconds=25.0, rate=100.0) -> Simulation:
    """Put a cube on each of its faces on a levelled plate.

    `placement` is true and stated, a small part of it the plate's; ``pose-off`` and ``plate-leans`` are by 1°.
    """
    _check(fault, SIX_FAULTS)
    place = Place.draw(grade, rng, fault)
    text = Text("six faces", "six-position", place, grade.units)
    tilt = _lean(0.3 * placement, rng)
    if fault == "plate-leans":
        tilt = _lean_exactly(DEGREE, rng)
    wrong = {"pose-off": rng.permutation(6)[:1], "four-poses-off": rng.permutation(6)[:4]}.get(
        fault or "", []
    )
    path = Path(rate, 4)
    bumped = int(rng.integers(6)) if fault == "bumped" else -1
    heading = rng.uniform(0, 2 * np.pi)
    for k, (name, up) in enumerate(FACES.items()):
        target = _tilted(posed(np.array(up, float), heading), tilt)
        target = _off(target, 0.95 * placement, rng)
        if k in wrong:
            across = np.cross(up, _direction(rng))
            target = so3.multiply(target, so3.exponential(DEGREE * across / np.linalg.norm(across)))
        path.reach(target, rng.uniform(1.5, 4.0) if path.samples else 0.0, Hand(), rng)
        _hold(path, seconds, STILL, rng, name, 0.3 * DEGREE * _direction(rng) if k == bumped else None)
        text.step("hold", f"{name} up", up=name, uncertainty_deg=placement / DEGREE, seconds=seconds)
    return record(path, grade, place, str(text), rng, fault=fault)


TABLE_FAULTS = ("loose", "one-rate", "all-rates", "missing-turn", "plate-leans")


def _spin(path, axis, rate, steady, ramp, missing, *, slip=None, wobble=0.0, ripple=0.0, extra=0.0) -> None:
    """Turn on a table: ramp, steady, ramp; `ripple` rad comes and goes once a revolution, `extra` rad is its error."""
    if missing:
        path.hold(steady + 2 * ramp, name="no spin")
        return
    total = rate * (steady + ramp)
    # A whole number of samples, at that rate and by that angle: the ramps take up what is left.
    seconds = round((steady + 2 * ramp) * path.rate) / path.rate
    ramp, steady = seconds - steady - ramp, 2 * (steady + ramp) - seconds

    def profile(share: np.ndarray) -> np.ndarray:
        angle = trapezoid_angle(share * seconds, rate, steady, ramp)
        return (angle + extra * angle / total + ripple * (np.sin(angle))) / total

    path.revolve(axis, total, seconds, "spin", kind="spin", profile=profile, slip=slip, wobble=wobble)


def rate_table(grade, rng, fault=None, *, placement=0.2 * DEGREE, rates=(20.0, 60.0, 120.0), rate=50.0):
    """Stand the unit on each face on a table with a plumb axis and turn it both ways at known rates.

    `placement` is true and stated; ``one-rate``: the largest rate (°/s) is 1 % off, ``all-rates``: every one is.
    """
    _check(fault, TABLE_FAULTS)
    place = Place.draw(grade, rng, fault)
    text = Text("rates", "rate-table", place, grade.units)
    lean = _lean_exactly(DEGREE, rng) if fault == "plate-leans" else _lean(0.01 * DEGREE, rng)
    axis = so3.rotate(so3.exponential(lean), UP)
    off = 30 * PPM * rng.standard_normal()
    path = Path(rate, 4)
    count = 0
    troubled = set(rng.permutation(6 * 2 * len(rates))[:3].tolist())
    for name, up in FACES.items():
        target = _tilted(posed(np.array(up, float), rng.uniform(0, 2 * np.pi)), lean)
        target = _off(target, placement, rng)
        path.reach(target, 4.0, Hand(), rng)
        keys = {"up": name, "uncertainty_deg": placement / DEGREE}
        path.hold(10.0, name=f"{name} up")
        text.step("hold", f"{name} up", **keys, seconds=10)
        for speed, way in itertools.product(rates, (1, -1)):
            steady = max(1, round(18 * speed / 360)) * 360 / speed
            wrong = fault == "all-rates" or (fault == "one-rate" and speed == max(rates))
            real = way * speed * DEGREE * (1 + off + 0.01 * wrong)
            slip = 0.3 * DEGREE * _direction(rng) if fault == "loose" and count in troubled else None
            none = fault == "missing-turn" and count == min(troubled)
            _spin(path, axis, real, steady, 2.0, none, slip=slip, wobble=5 * ARCSECOND, ripple=10 * ARCSECOND)
            text.step(
                "spin", f"{way * speed}", axis="up", rate_deg_per_s=way * speed, seconds=steady, ramp_s=2,
                uncertainty_ppm=30,
            )  # fmt: skip
            path.hold(8.0, name=f"{name} up")
            text.step("hold", f"{name} up", **keys, seconds=8)
            count += 1
    return record(path, grade, place, str(text), rng, lever=np.array([0.0, 0.02, 0.01]), fault=fault)


def modified_multi_position(grade, rng, fault=None, *, rate=50.0) -> Simulation:
    """Prop the unit up on a table in twelve poses and turn it both ways in each."""
    _check(fault, TABLE_FAULTS)
    place = Place.draw(grade, rng, fault)
    text = Text("table and putty", "modified-multi-position", place, grade.units)
    lean = _lean_exactly(DEGREE, rng) if fault == "plate-leans" else _lean(0.003 * DEGREE, rng)
    axis = so3.rotate(so3.exponential(lean), UP)
    off = 20 * PPM * rng.standard_normal()
    ups = [*directions((1,)), *[directions((2,))[k] for k in (0, 3, 4, 7, 9, 10)]]
    path = Path(rate, 4)
    troubled = set(rng.permutation(2 * len(ups))[:3].tolist())
    for k, up in enumerate(ups):
        target = _off(posed(up, rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng)
        path.reach(target, 4.0, Hand(), rng)
        path.hold(12.0, name=f"pose {k + 1}")
        text.step("hold", f"pose {k + 1}", up=up, uncertainty_deg=5, seconds=12)
        for turn, way in enumerate((1, -1)):
            wrong = fault == "all-rates" or (fault == "one-rate" and 2 * k + turn in troubled)
            real = way * 40 * DEGREE * (1 + off + 0.01 * wrong)
            slip = 0.3 * DEGREE * _direction(rng) if fault == "loose" and 2 * k + turn in troubled else None
            none = fault == "missing-turn" and 2 * k + turn == min(troubled)
            _spin(path, axis, real, 27.0, 2.0, none, slip=slip, wobble=5 * ARCSECOND, ripple=10 * ARCSECOND)
            text.step(
                "spin", f"{way * 40}", axis="up", rate_deg_per_s=way * 40, seconds=27, ramp_s=2,
                uncertainty_ppm=20,
            )  # fmt: skip
            path.hold(8.0, name=f"pose {k + 1}")
            text.step("hold", f"pose {k + 1}", up=up, uncertainty_deg=5, seconds=8)
    return record(path, grade, place, str(text), rng, lever=np.array([0.0, 0.02, 0.01]), fault=fault)


AXES, EDGES = ((1, 0, 0), (0, 1, 0), (0, 0, 1)), ((1, 1, 0), (1, 0, 1), (0, 1, 1))
ANGLE_FAULTS = ("loose", "misread", "missing-turn", "plate-leans")


def turntable(
    grade: Grade,
    rng: np.random.Generator,
    fault: str | None = None,
    *,
    seconds: float = 25.0,
    rate: float = 50.0,
    speed: float = 10.0,
    steady: float = 70.0,
    axes: Sequence[tuple[int, int, int]] = (*AXES, *EDGES),
) -> Simulation:
    """Nine poses at rest, then six axes turned about both ways on a table that lies level and shows its angle.

    ``misread``: one angle by 0.5°; `speed` in °/s.
    """
    _check(fault, ANGLE_FAULTS)
    place = Place.draw(grade, rng, fault)
    text = Text("nine and six", "turntable", place, grade.units)
    ups = [*directions((1,)), *[np.array(v, float) for v in ((1, 1, 0), (1, 0, 1), (0, 1, 1))]]
    path = Path(rate, 4)
    for k, up in enumerate(ups):
        target = _off(posed(up, rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng)
        path.reach(target, 4.0, Hand(), rng)
        path.hold(seconds, name=f"pose {k + 1}")
        text.step("hold", f"pose {k + 1}", up=up, uncertainty_deg=5, seconds=seconds)
    azimuth = rng.uniform(0, 2 * np.pi)
    dip = DEGREE if fault == "plate-leans" else 0.5 * DEGREE * rng.standard_normal()
    axis_n = np.array([np.cos(azimuth) * np.cos(dip), np.sin(azimuth) * np.cos(dip), np.sin(dip)])
    about = [np.array(v, float) for v in axes]
    # An axis that lies across: of a face the one before, of an edge the one that it does not touch.
    upright = [np.roll(v, -1) if np.count_nonzero(v) == 1 else 1.0 * (v == 0) for v in about]
    _level_axis_spins(
        path,
        text,
        rng,
        fault,
        list(zip(about, upright, strict=True)),
        axis_n,
        2 * DEGREE,
        2,
        speed,
        5,
        steady,
    )
    lever = 0.03 * rng.standard_normal(3)
    return record(path, grade, place, str(text), rng, lever=lever, fault=fault)


def _level_axis_spins(path, text, rng, fault, mountings, axis_n, mount, display, speed, pose_deg, steady):
    """Turn about each axis both ways, at rest before, between and after; the display errs by `display` arcseconds."""
    troubled = int(rng.integers(2 * len(mountings)))
    ramp = 2.0
    for k, (axis, up) in enumerate(mountings):
        # The unit's axis lies along the table's, and what should be up is up as far as the table allows.
        body = np.stack((axis / np.linalg.norm(axis), up, np.cross(axis / np.linalg.norm(axis), up)), axis=1)
        up_n = UP - (UP @ axis_n) * axis_n
        if np.linalg.norm(up_n) < 1e-6:
            up_n = np.array([1.0, 0.0, 0.0])
        up_n /= np.linalg.norm(up_n)
        room = np.stack((axis_n, up_n, np.cross(axis_n, up_n)), axis=1)
        target = _off(so3.from_matrix(room @ body.T), mount, rng)
        path.turn_to(target, 4.0, Hand(), rng)
        keys = {"up": up, "uncertainty_deg": pose_deg}
        path.hold(12.0, name="before")
        text.step("hold", f"axis {k + 1}, at rest", **keys, seconds=12)
        for turn, way in enumerate((1, -1)):
            error = display * ARCSECOND * rng.standard_normal()
            nominal = way * speed * DEGREE
            slip = 0.3 * DEGREE * _direction(rng) if fault == "loose" and troubled == 2 * k + turn else None
            _spin(
                path, axis_n, nominal, steady, ramp, fault == "missing-turn" and troubled == 2 * k + turn, extra=error,
                slip=slip, wobble=2 * ARCSECOND, ripple=5 * ARCSECOND,
            )  # fmt: skip
            shown = way * speed * (steady + ramp)
            if fault == "misread" and troubled == 2 * k + turn:
                shown += 0.5
            text.step(
                "spin", f"axis {k + 1}", axis=axis, rate_deg_per_s=way * speed, seconds=steady, ramp_s=ramp,
                angle_deg=shown, angle_uncertainty_arcsec=display,
            )  # fmt: skip
            path.hold(12.0, name="after")
            text.step("hold", f"axis {k + 1}, at rest", **keys, seconds=12)


def laboratory(grade, rng, fault=None, *, seconds=20.0, rate=50.0, table=10.0) -> Simulation:
    """An aligned table: 24 attitudes that are known, and turns both ways about the vertical along x, y and z.

    Attitudes and axes are uncertain by `table`, true and stated, arcseconds.
    """
    _check(fault, (*ANGLE_FAULTS, "pose-off"))
    place = Place.draw(grade, rng, fault)
    text = Text("aligned table", "laboratory", place, grade.units)
    lean = _lean_exactly(DEGREE, rng) if fault == "plate-leans" else np.zeros(3)
    path = Path(rate, 4)
    poses = [(name, up, heading) for name, up in FACES.items() for heading in (0, 90, 180, 270)]
    wrong = int(rng.integers(len(poses))) if fault == "pose-off" else -1
    for k, (name, up, heading) in enumerate(poses):
        target = _tilted(posed(np.array(up, float), heading * DEGREE), lean)
        target = _off(target, table * ARCSECOND, rng)
        if k == wrong:
            target = so3.multiply(target, so3.exponential(DEGREE * _direction(rng)))
        path.reach(target, 4.0)
        path.hold(seconds, name=name)
        text.step(
            "hold", f"{name} up, {heading}", up=name, heading_deg=(heading + 180) % 360 - 180,
            uncertainty_deg=table / 3600, seconds=seconds,
        )  # fmt: skip
    axis_n = so3.rotate(so3.exponential(lean), UP)
    troubled = int(rng.integers(6))
    for k, name in enumerate("xyz"):
        up = np.array(FACES[name], float)
        target = _off(_tilted(posed(up, 0.0), lean), table * ARCSECOND, rng)
        path.turn_to(target, 4.0)
        keys = {"up": name, "heading_deg": 0, "uncertainty_deg": table / 3600}
        path.hold(12.0, name="before")
        text.step("hold", f"{name}, at rest", **keys, seconds=12)
        for turn, way in enumerate((1, -1)):
            error = 2 * ARCSECOND * rng.standard_normal()
            slip = 0.3 * DEGREE * _direction(rng) if fault == "loose" and troubled == 2 * k + turn else None
            none = fault == "missing-turn" and troubled == 2 * k + turn
            _spin(
                path, axis_n, way * 10 * DEGREE, 70.0, 2.0, none, extra=error, slip=slip, ripple=5 * ARCSECOND
            )
            shown = way * 720.0 + (0.5 if fault == "misread" and troubled == 2 * k + turn else 0.0)
            text.step(
                "spin", name, axis=name, rate_deg_per_s=way * 10, seconds=70.0, ramp_s=2.0, angle_deg=shown,
                angle_uncertainty_arcsec=2,
            )  # fmt: skip
            path.hold(12.0, name="after")
            text.step("hold", f"{name}, at rest", **keys, seconds=12)
    return record(path, grade, place, str(text), rng, lever=0.02 * rng.standard_normal(3), fault=fault)


SEQUENCES = {
    "1": ((0, 0), "+360 y"), "2": ((90, 0), "+360 x"), "3": ((0, -90), "+360 z"),
    "1a": ((0, 0), "-360 y"), "2a": ((90, 0), "-360 x"), "3a": ((0, -90), "-360 z"),
    "4": ((0, 0), "+180 y +180 z +180 y +180 z"), "5": ((90, 0), "+180 x +180 z +180 x +180 z"),
    "6": ((0, -90), "+180 y +90 z +180 x +90 z +180 y +90 z +180 x +90 z"),
    "7": ((90, 90), "+180 x"), "8": ((90, 0), "+180 x"), "9": ((0, -90), "+180 z"),
    "10": ((90, 90), "+180 z"), "11": ((0, 0), "+180 y"), "12": ((0, -90), "+180 y"),
    "13": ((0, 0), "+180 z +180 y"), "14": ((90, 0), "+180 z +180 x"),
}  # fmt: skip
"""Table 1 of Savage (2018): inner and outer angle at the start (°), and the rotations about the unit's axes."""


def sequence_rotations(name: str) -> list[tuple[float, str]]:
    """Return the rotations of a sequence: angle in degrees and axis."""
    words = SEQUENCES[name][1].split()
    return [(float(a), b) for a, b in zip(words[::2], words[1::2], strict=True)]


class Fixture:
    """Two axes: an outer one, level and to the east, that turns an inner one, which carries the unit along its z."""

    def __init__(self, error: float, azimuth: float, rng: np.random.Generator) -> None:
        self.base = so3.exponential(
            np.array([*error * rng.standard_normal(2), azimuth * rng.standard_normal()])
        )
        self.crossing = so3.exponential(error * rng.standard_normal(3))
        self.mounting = so3.exponential(error * rng.standard_normal(3))
        self.error, self.rng = error, rng

    @property
    def outer_axis(self) -> np.ndarray:
        """The outer axis in the room."""
        return so3.rotate(self.base, np.array([0.0, 1.0, 0.0]))

    def attitude(self, inner: float, outer: float) -> np.ndarray:
        """Return the unit's attitude."""
        y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
        turned = so3.multiply(so3.multiply(self.base, so3.exponential(outer * y)), self.crossing)
        return so3.multiply(so3.multiply(turned, so3.exponential(inner * z)), self.mounting)

    def inner_axis(self, outer: float) -> np.ndarray:
        """Return the inner axis in the room."""
        turned = so3.multiply(
            so3.multiply(self.base, so3.exponential(outer * np.array([0.0, 1.0, 0.0]))), self.crossing
        )
        return so3.rotate(turned, np.array([0.0, 0.0, 1.0]))


def nominal_attitude(inner: float, outer: float) -> np.ndarray:
    """Return the attitude on an exact fixture."""
    return so3.multiply(
        so3.exponential(np.array([0.0, outer, 0.0])), so3.exponential(np.array([0.0, 0.0, inner]))
    )


STRAPDOWN_FAULTS = ("bumped", "loose", "missing-turn", "pose-off", "plate-leans")


def strapdown_rotation(grade, rng, fault=None, *, error=5e-4, azimuth=1e-3, rate=100.0, asymmetric=True):
    """Savage's 17 sequences of rotations on a two-axis fixture.

    `error` is the fixture's in each of its parts, rad; of a pose twice that is stated. Scale factors differ by sign, as
    the test is made to find. ``pose-off`` and ``plate-leans`` are by 1°.
    """
    _check(fault, STRAPDOWN_FAULTS)
    place = Place.draw(grade, rng, fault)
    text = Text("seventeen", "strapdown-rotation", place, grade.units)
    fixture = Fixture(error, azimuth, rng)
    if fault == "plate-leans":
        fixture.base = so3.multiply(so3.exponential(_lean_exactly(DEGREE, rng)), fixture.base)
    troubled = str(rng.permutation(list(SEQUENCES))[0])
    path = Path(rate, 4)
    for name, (start, _) in SEQUENCES.items():
        inner, outer = np.array(start) * DEGREE
        at = np.array([inner, outer])
        missed = error * rng.standard_normal(2)
        target = fixture.attitude(*(at + missed))
        if fault == "pose-off" and name == troubled:
            target = so3.multiply(target, so3.exponential(DEGREE * _direction(rng)))
        path.reach(target, 8.0)
        bump = 0.3 * DEGREE * _direction(rng) if fault == "bumped" and name == troubled else None
        _hold(path, 10.0, STILL, rng, f"{name} start", bump)
        nominal = nominal_attitude(inner, outer)
        _stated_hold(text, f"{name} start", nominal, 2 * error)
        for angle, axis in sequence_rotations(name):
            unit_axis = np.array(FACES[axis], float)
            turned = angle * DEGREE
            seconds = abs(turned) / 1.0 + 0.5
            slip = 0.3 * DEGREE * _direction(rng) if fault == "loose" and name == troubled else None
            # A fixture goes to a mark: what it misses it by at one does not add to what it misses the next by.
            missing = error * rng.standard_normal()
            room = fixture.inner_axis(at[1]) if axis == "z" else fixture.outer_axis
            along = room @ so3.rotate(path.attitude, unit_axis)
            sign = 1.0 if along > 0 else -1.0
            which = 0 if axis == "z" else 1
            real = turned + sign * (missing - missed[which])
            missed[which] = missing
            if fault == "missing-turn" and name == troubled:
                path.hold(seconds, name="no turn")
            else:
                path.revolve(
                    room, sign * real, seconds, f"{name}: {angle:+g} {axis}", slip=slip,
                    profile=lambda s, n=seconds: trapezoid_angle(s * n, 1 / (n - 0.5), n - 1.0, 0.5),
                )  # fmt: skip
            path.hold(0.5, name="pause")
            at = at + sign * turned * np.array([axis == "z", axis != "z"])
            nominal = so3.multiply(nominal, so3.exponential(turned * unit_axis))
            text.step(
                "turn", f"{name}: {angle:+g} {axis}", axis=axis, angle_deg=angle, uncertainty_deg=2 * error / DEGREE,
                seconds=seconds,
            )  # fmt: skip
        path.hold(10.0, name=f"{name} end")
        _stated_hold(text, f"{name} end", nominal, 2 * error)
        if name != "14":
            text.step("turn", "", seconds=8)
    unit = draw_unit(grade, rng, asymmetric=asymmetric)
    return record(
        path, grade, place, str(text), rng, unit=unit, lever=0.01 * rng.standard_normal(3), fault=fault
    )


def _stated_hold(text: Text, name: str, attitude: np.ndarray, error: float) -> None:
    """State a whole attitude as up and heading, as protocols have it."""
    up = so3.rotate(so3.inverse(attitude), UP)
    up = np.where(np.abs(up) < 1e-9, 0.0, up)
    base = so3.between(up, UP)
    turned = so3.logarithm(so3.multiply(attitude, so3.inverse(base)))
    heading = float(-turned @ UP) / DEGREE
    text.step("hold", name, up=up, heading_deg=round(heading, 9), uncertainty_deg=error / DEGREE, seconds=10)


def thermal_soak(
    grade: Grade,
    rng: np.random.Generator,
    fault: str | None = None,
    *,
    soaks: Sequence[float] = (20.0, 0.0, -20.0, 0.0, 20.0, 45.0, 65.0, 45.0, 20.0),
    rate: float = 10.0,
    minutes: float = 15.0,
) -> Simulation:
    """A chamber at several temperatures, nine poses by hand at each.

    The unit comes to the chamber's temperature with a time constant of two minutes.
    """
    _check(fault, ("bumped",))
    place = Place.draw(grade, rng, fault)
    text = Text("chamber", "thermal", place, grade.units)
    ups = [*directions((1,)), *[np.array(v, float) for v in ((1, 1, 0), (1, 0, 1), (0, 1, 1))]]
    path = Path(rate, 4, posed(ups[0], 0.0))
    wanted: list[tuple[float, float]] = []
    bumped = int(rng.integers(len(soaks) * 9)) if fault == "bumped" else -1
    count = 0
    for celsius in soaks:
        wanted.append((path.seconds, celsius))
        path.hold(60 * minutes, name=f"{celsius}")
        text.step("soak", f"{celsius}", temperature_celsius=celsius, tolerance_k=1, seconds=60 * minutes)
        for k, up in enumerate(ups):
            if k:
                text.step("turn", "", seconds=3)
            path.turn_to(_off(posed(up, rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng), 3.0, Hand(), rng)
            bump = 0.3 * DEGREE * _direction(rng) if count == bumped else None
            _hold(path, 30.0, STILL, rng, f"pose {k + 1}", bump)
            text.step("hold", f"pose {k + 1}", up=up, uncertainty_deg=5, seconds=30)
            count += 1
    time = (np.arange(path.samples) + 0.5) / rate
    temperature = np.empty(path.samples)
    now = soaks[0]
    for (start, celsius), (stop, _) in zip(wanted, [*wanted[1:], (path.seconds + 1, 0.0)], strict=True):
        part = (time >= start) & (time < stop)
        temperature[part] = celsius + (now - celsius) * np.exp(-(time[part] - start) / 120)
        now = celsius + (now - celsius) * np.exp(-(stop - start) / 120)
    a, g = grade.accelerometer, grade.gyroscope
    slopes = np.repeat([a.per_kelvin, g.per_kelvin], 3)
    bends = np.array([1.0, 0.008, 0.00012])[:, None]
    thermal = Thermal(
        20.0,
        bends * slopes * rng.standard_normal((3, 6)),
        np.repeat([a.scale_per_kelvin, g.scale_per_kelvin], 3) * rng.standard_normal(6),
    )
    return record(path, grade, place, str(text), rng, fault=fault, temperature=temperature, thermal=thermal)


PROCEDURES: dict[str, Callable[..., Simulation]] = {
    "by-hand": by_hand,
    "multi-position": multi_position,
    "six-faces": six_faces,
    "rate-table": rate_table,
    "modified-multi-position": modified_multi_position,
    "turntable": turntable,
    "laboratory": laboratory,
    "strapdown-rotation": strapdown_rotation,
    "thermal-soak": thermal_soak,
}
"""The tests by name."""

OWN_FAULTS: dict[str, tuple[str, ...]] = {
    "by-hand": (*HAND_FAULTS, "two-units"),
    "multi-position": (*HAND_FAULTS, "two-units"),
    "six-faces": SIX_FAULTS,
    "rate-table": TABLE_FAULTS,
    "modified-multi-position": TABLE_FAULTS,
    "turntable": ANGLE_FAULTS,
    "laboratory": (*ANGLE_FAULTS, "pose-off"),
    "strapdown-rotation": STRAPDOWN_FAULTS,
    "thermal-soak": ("bumped",),
}
"""Faults that each test has beside those of files and places."""
