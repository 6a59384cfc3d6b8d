"""The nine tests as a person would do them: motion, protocol file and truth of each.

Every function takes a grade, a source of chance, and a fault by name, and returns a `Simulation`. A fault that has
no meaning for a test is refused.
"""

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


def _lean_exactly(size: float, rng: np.random.Generator) -> np.ndarray:
    towards = rng.uniform(0, 2 * np.pi)
    return size * np.array([np.cos(towards), np.sin(towards), 0.0])


def _direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


class Test:
    """A test in the making: its place, its motion, and its protocol file, whose steps are those of the motion."""

    def __init__(self, kind, name, procedure, grade, rng, fault, rate) -> None:
        if fault is not None and fault not in (*RECORD_FAULTS, *STATED_FAULTS, *OWN_FAULTS[kind]):
            raise ValueError(
                f"{fault} is no fault of this test; it has {', '.join(OWN_FAULTS[kind])} and those of all"
            )
        self.grade, self.rng, self.fault = grade, rng, fault
        self.place = Place.draw(grade, rng, fault)
        self.path = Path(rate, 4)
        self.lines = [
            "format: tumble protocol", "version: 1", f"name: {name}", f"procedure: {procedure}", self.place.text(),
            "steps:",
        ]  # fmt: skip

    def step(self, kind: str, name: str, **keys: object) -> None:
        """State a step.

        Keys are in the file's own spelling; vectors are written as lists.
        """
        self.lines.append(f'  - {kind}: "{name}"')
        for key, value in keys.items():
            shown = value
            if isinstance(value, np.ndarray):
                shown = "[" + ", ".join(repr(float(v)) for v in value) + "]"
            elif isinstance(value, float | np.floating):
                shown = repr(float(value))
            self.lines.append(f"    {key}: {shown}")

    def rest(self, name: str, seconds: float, said: str | None = None, **keys: object) -> None:
        """Hold still, and state it."""
        self.path.hold(seconds, name=name)
        self.step("hold", said or name, **keys, seconds=seconds)

    def hold(self, seconds, name, hand, bumped) -> None:
        """Hold, or be bumped in the middle: the pose jumps within a fifth of a second and stays."""
        if bumped:
            bump = 0.3 * DEGREE * _direction(self.rng)
            self.path.creep(seconds, bump, lambda s: np.clip((s - 0.5) * seconds / 0.2, 0, 1), name)
        else:
            self.path.hold(seconds, hand, self.rng, name)

    def pose(self, k, up, seconds, hand, bumped) -> None:
        """Hold a pose of which what is up is stated; ``loose``: a third of them creep."""
        if self.fault == "loose" and k % 3 == 1:
            self.path.creep(seconds, 0.1 * DEGREE * _direction(self.rng))
        else:
            self.hold(seconds, f"pose {k + 1}", hand, bumped == k)
        self.step("hold", f"pose {k + 1}", up=up, uncertainty_deg=5, seconds=seconds)

    def number(self, fault: str, *among: int) -> int:
        """One number of chance if the test has this fault, else -1."""
        return int(self.rng.integers(*among)) if self.fault == fault else -1

    def slip(self, here: bool) -> np.ndarray | None:
        """By what the unit slips in its mount here, if it is loose."""
        return 0.3 * DEGREE * _direction(self.rng) if self.fault == "loose" and here else None

    def lean(self, size: float) -> np.ndarray:
        """By what a plate leans, as a rotation vector in the room: by chance, or by 1° where that is the fault."""
        if self.fault == "plate-leans":
            return _lean_exactly(DEGREE, self.rng)
        return np.append(size * self.rng.standard_normal(2), 0.0) if size else np.zeros(3)

    def recorded(self, **more: object) -> Simulation:
        """Let a unit of the grade go through the motion."""
        text = "\n".join(self.lines) + "\n"
        return record(self.path, self.grade, self.place, text, self.rng, fault=self.fault, **more)


def by_hand(grade, rng, fault=None, *, poses=26, rate=100.0) -> Simulation:
    """Rest, turn, rest, turn: faces, edges and corners in random order, turned by hand."""
    test = Test("by-hand", "by hand", "hand-held", grade, rng, fault, rate)
    path, hand, ups = test.path, Hand(), directions((1, 2, 3))
    order = rng.permutation(26)[:poses] if poses <= 26 else rng.integers(0, 26, poses)
    targets = [_off(posed(ups[k], rng.uniform(0, 2 * np.pi)), 3 * DEGREE, rng) for k in order]
    path.attitude = targets[0]
    bumped = test.number("bumped", 1, poses - 1)
    for k, target in enumerate(targets):
        if k:
            way = np.linalg.norm(so3.logarithm(so3.multiply(so3.inverse(path.attitude), target)))
            path.turn_to(target, max(1.0, way / rng.uniform(1.2, 2.4)) + rng.uniform(0.0, 0.5), hand, rng)
        seconds = 10.0 if k in (0, poses - 1) else rng.uniform(3.5, 6.0)
        test.pose(k, ups[order[k]], seconds, hand, bumped)
    made = test.recorded(lever=np.array([0.01, -0.005, 0.02]))
    if fault == "two-units":
        made.other = by_hand(grade, rng, None, poses=poses, rate=rate)
    return made


def multi_position(grade, rng, fault=None, *, poses=24, seconds=12.0, rate=100.0) -> Simulation:
    """Lay the unit down in many poses that nobody has to know."""
    test = Test("multi-position", "many poses", "multi-position", grade, rng, fault, rate)
    ups = directions((1, 2, 3))
    order = np.concatenate((np.arange(18), 18 + rng.permutation(8)))[:poses]
    rng.shuffle(order)
    bumped = test.number("bumped", 1, poses - 1)
    for k, at in enumerate(order):
        target = _off(posed(ups[at], rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng)
        test.path.reach(target, rng.uniform(1.5, 4.0) if k else 0.0, Hand(), rng)
        test.pose(k, ups[at], seconds, STILL, bumped)
    made = test.recorded()
    if fault == "two-units":
        made.other = multi_position(grade, rng, None, poses=poses, seconds=seconds, rate=rate)
    return made


def six_faces(grade, rng, fault=None, *, placement=0.05 * DEGREE, seconds=25.0, rate=100.0) -> Simulation:
    """Put a cube on each of its faces on a levelled plate.

    `placement` is true and stated, a small part of it the plate's; ``pose-off`` and ``plate-leans`` are by 1°.
    """
    test = Test("six-faces", "six faces", "six-position", grade, rng, fault, rate)
    tilt = 0.3 * placement * np.append(rng.standard_normal(2), 0.0)
    if fault == "plate-leans":
        tilt = _lean_exactly(DEGREE, rng)
    one, four = rng.permutation(6)[:1], rng.permutation(6)[:4]
    wrong = {"pose-off": one, "four-poses-off": four}.get(fault or "", [])
    bumped = test.number("bumped", 6)
    heading = rng.uniform(0, 2 * np.pi)
    for k, (name, up) in enumerate(FACES.items()):
        target = _off(_tilted(posed(np.array(up, float), heading), tilt), 0.95 * placement, rng)
        if k in wrong:
            across = np.cross(up, _direction(rng))
            target = so3.multiply(target, so3.exponential(DEGREE * across / np.linalg.norm(across)))
        test.path.reach(target, rng.uniform(1.5, 4.0) if k else 0.0, Hand(), rng)
        test.hold(seconds, name, STILL, bumped == k)
        test.step("hold", f"{name} up", up=name, uncertainty_deg=placement / DEGREE, seconds=seconds)
    return test.recorded()


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


def _plumb_spins(test, name, keys, axis, first, spins, troubled, off, ppm) -> None:
    """Rest in a pose and turn about a plumb axis; each of `spins` is °/s, seconds, and whether its rate is 1 % off."""
    test.rest(name, first, **keys)
    for count, speed, steady, wrong in spins:
        real = speed * DEGREE * (1 + off + 0.01 * wrong)
        slip = test.slip(count in troubled)
        none = test.fault == "missing-turn" and count == min(troubled)
        _spin(
            test.path, axis, real, steady, 2.0, none, slip=slip, wobble=5 * ARCSECOND, ripple=10 * ARCSECOND
        )
        test.step(
            "spin", f"{speed}", axis="up", rate_deg_per_s=speed, seconds=steady, ramp_s=2, uncertainty_ppm=ppm
        )
        test.rest(name, 8, **keys)


def rate_table(grade, rng, fault=None, *, placement=0.2 * DEGREE, rates=(20.0, 60.0, 120.0), rate=50.0):
    """Stand the unit on each face on a table with a plumb axis and turn it both ways at known rates.

    `placement` is true and stated; ``one-rate``: the largest rate (°/s) is 1 % off, ``all-rates``: every one is.
    """
    test = Test("rate-table", "rates", "rate-table", grade, rng, fault, rate)
    lean = test.lean(0.01 * DEGREE)
    axis = so3.rotate(so3.exponential(lean), UP)
    off = 30 * PPM * rng.standard_normal()
    count, wrong = itertools.count(), {"one-rate": [max(rates)], "all-rates": rates}.get(fault or "", ())
    troubled = set(rng.permutation(6 * 2 * len(rates))[:3].tolist())
    for name, up in FACES.items():
        target = _tilted(posed(np.array(up, float), rng.uniform(0, 2 * np.pi)), lean)
        test.path.reach(_off(target, placement, rng), 4.0, Hand(), rng)
        spins = [
            (next(count), way * speed, max(1, round(18 * speed / 360)) * 360 / speed, speed in wrong)
            for speed, way in itertools.product(rates, (1, -1))
        ]
        keys = {"up": name, "uncertainty_deg": placement / DEGREE}
        _plumb_spins(test, f"{name} up", keys, axis, 10, spins, troubled, off, 30)
    return test.recorded(lever=np.array([0.0, 0.02, 0.01]))


def modified_multi_position(grade, rng, fault=None, *, rate=50.0) -> Simulation:
    """Prop the unit up on a table in twelve poses and turn it both ways in each."""
    name = "modified-multi-position"
    test = Test(name, "table and putty", name, grade, rng, fault, rate)
    axis = so3.rotate(so3.exponential(test.lean(0.003 * DEGREE)), UP)
    off = 20 * PPM * rng.standard_normal()
    ups = [*directions((1,)), *[directions((2,))[k] for k in (0, 3, 4, 7, 9, 10)]]
    troubled = set(rng.permutation(2 * len(ups))[:3].tolist())
    for k, up in enumerate(ups):
        test.path.reach(_off(posed(up, rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng), 4.0, Hand(), rng)
        spins = [
            (count, speed, 27, fault == "all-rates" or (fault == "one-rate" and count in troubled))
            for count, speed in ((2 * k, 40), (2 * k + 1, -40))
        ]
        keys = {"up": up, "uncertainty_deg": 5}
        _plumb_spins(test, f"pose {k + 1}", keys, axis, 12, spins, troubled, off, 20)
    return test.recorded(lever=np.array([0.0, 0.02, 0.01]))


AXES, EDGES = ((1, 0, 0), (0, 1, 0), (0, 0, 1)), ((1, 1, 0), (1, 0, 1), (0, 1, 1))


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
    test = Test("turntable", "nine and six", "turntable", grade, rng, fault, rate)
    for k, up in enumerate([*directions((1,)), *[np.array(v, float) for v in EDGES]]):
        test.path.reach(_off(posed(up, rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng), 4.0, Hand(), rng)
        test.rest(f"pose {k + 1}", seconds, up=up, uncertainty_deg=5)
    azimuth = rng.uniform(0, 2 * np.pi)
    dip = DEGREE if fault == "plate-leans" else 0.5 * DEGREE * rng.standard_normal()
    axis_n = np.array([np.cos(azimuth) * np.cos(dip), np.sin(azimuth) * np.cos(dip), np.sin(dip)])
    up_n = UP - (UP @ axis_n) * axis_n
    up_n /= np.linalg.norm(up_n)
    room = np.stack((axis_n, up_n, np.cross(axis_n, up_n)), axis=1)
    troubled = int(rng.integers(2 * len(axes)))
    for k, axis in enumerate(np.array(axes, float)):
        # An axis that lies across is up: of a face the one before, of an edge the one that it does not touch.
        up = np.roll(axis, -1) if np.count_nonzero(axis) == 1 else 1.0 * (axis == 0)
        along = axis / np.linalg.norm(axis)
        body = np.stack((along, up, np.cross(along, up)), axis=1)
        test.path.turn_to(_off(so3.from_matrix(room @ body.T), 2 * DEGREE, rng), 4.0, Hand(), rng)
        keys = {"up": up, "uncertainty_deg": 5}
        _both_ways(test, k, troubled, f"axis {k + 1}", keys, axis, axis_n, speed, steady, 2 * ARCSECOND)
    return test.recorded(lever=0.03 * rng.standard_normal(3))


def _both_ways(test, k, troubled, name, keys, axis, axis_n, speed, steady, wobble) -> None:
    """Turn about an axis both ways, at rest before, between and after; the display errs by 2″."""
    test.rest("before", 12, f"{name}, at rest", **keys)
    for count, way in ((2 * k, 1), (2 * k + 1, -1)):
        error = 2 * ARCSECOND * test.rng.standard_normal()
        here = troubled == count
        slip, none = test.slip(here), test.fault == "missing-turn" and here
        told = {"extra": error, "slip": slip, "wobble": wobble, "ripple": 5 * ARCSECOND}
        _spin(test.path, axis_n, way * speed * DEGREE, steady, 2.0, none, **told)
        test.step(
            "spin", name, axis=axis, rate_deg_per_s=way * speed, seconds=steady, ramp_s=2.0,
            angle_deg=way * speed * (steady + 2.0) + 0.5 * (test.fault == "misread" and here),
            angle_uncertainty_arcsec=2,
        )  # fmt: skip
        test.rest("after", 12, f"{name}, at rest", **keys)


def laboratory(grade, rng, fault=None, *, seconds=20.0, rate=50.0, table=10.0) -> Simulation:
    """An aligned table: 24 attitudes that are known, and turns both ways about the vertical along x, y and z.

    Attitudes and axes are uncertain by `table`, true and stated, arcseconds.
    """
    test = Test("laboratory", "aligned table", "laboratory", grade, rng, fault, rate)
    lean = test.lean(0.0)
    poses = [(name, up, heading) for name, up in FACES.items() for heading in (0, 90, 180, 270)]
    wrong = test.number("pose-off", len(poses))
    for k, (name, up, heading) in enumerate(poses):
        target = _off(_tilted(posed(np.array(up, float), heading * DEGREE), lean), table * ARCSECOND, rng)
        if k == wrong:
            target = so3.multiply(target, so3.exponential(DEGREE * _direction(rng)))
        test.path.reach(target, 4.0)
        keys = {"up": name, "heading_deg": (heading + 180) % 360 - 180, "uncertainty_deg": table / 3600}
        test.rest(name, seconds, f"{name} up, {heading}", **keys)
    axis_n = so3.rotate(so3.exponential(lean), UP)
    troubled = int(rng.integers(6))
    for k, name in enumerate("xyz"):
        target = _tilted(posed(np.array(FACES[name], float), 0.0), lean)
        test.path.turn_to(_off(target, table * ARCSECOND, rng), 4.0)
        keys = {"up": name, "heading_deg": 0, "uncertainty_deg": table / 3600}
        _both_ways(test, k, troubled, name, keys, name, axis_n, 10, 70.0, 0.0)
    return test.recorded(lever=0.02 * rng.standard_normal(3))


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

    def _turned(self, outer: float) -> np.ndarray:
        return so3.multiply(
            so3.multiply(self.base, so3.exponential(np.array([0.0, outer, 0.0]))), self.crossing
        )

    def attitude(self, inner: float, outer: float) -> np.ndarray:
        """Return the unit's attitude."""
        turned = so3.multiply(self._turned(outer), so3.exponential(np.array([0.0, 0.0, inner])))
        return so3.multiply(turned, self.mounting)

    def inner_axis(self, outer: float) -> np.ndarray:
        """Return the inner axis in the room."""
        return so3.rotate(self._turned(outer), np.array([0.0, 0.0, 1.0]))


def nominal_attitude(inner: float, outer: float) -> np.ndarray:
    """Return the attitude on an exact fixture."""
    return so3.multiply(
        so3.exponential(np.array([0.0, outer, 0.0])), so3.exponential(np.array([0.0, 0.0, inner]))
    )


def strapdown_rotation(grade, rng, fault=None, *, error=5e-4, azimuth=1e-3, rate=100.0, asymmetric=True):
    """Savage's 17 sequences of rotations on a two-axis fixture.

    `error` is the fixture's in each of its parts, rad; of a pose twice that is stated. Scale factors differ by sign, as
    the test is made to find. ``pose-off`` and ``plate-leans`` are by 1°.
    """
    test = Test("strapdown-rotation", "seventeen", "strapdown-rotation", grade, rng, fault, rate)
    fixture = Fixture(error, azimuth, rng)
    if fault == "plate-leans":
        fixture.base = so3.multiply(so3.exponential(_lean_exactly(DEGREE, rng)), fixture.base)
    troubled = str(rng.permutation(list(SEQUENCES))[0])
    path = test.path
    for name, (start, _) in SEQUENCES.items():
        at = np.array(start) * DEGREE
        missed = error * rng.standard_normal(2)
        target = fixture.attitude(*(at + missed))
        if fault == "pose-off" and name == troubled:
            target = so3.multiply(target, so3.exponential(DEGREE * _direction(rng)))
        path.reach(target, 8.0)
        test.hold(10.0, f"{name} start", STILL, fault == "bumped" and name == troubled)
        nominal = nominal_attitude(*at)
        _state_hold(test, f"{name} start", nominal, 2 * error)
        for angle, axis in sequence_rotations(name):
            turned = angle * DEGREE
            seconds = abs(turned) / 1.0 + 0.5
            slip = test.slip(name == troubled)
            # A fixture goes to a mark: what it misses it by at one does not add to what it misses the next by.
            missing = error * rng.standard_normal()
            which = 0 if axis == "z" else 1
            room = fixture.outer_axis if which else fixture.inner_axis(at[1])
            unit_axis = np.array(FACES[axis], float)
            sign = 1.0 if room @ so3.rotate(path.attitude, unit_axis) > 0 else -1.0
            real = turned + sign * (missing - missed[which])
            missed[which] = missing
            said = f"{name}: {angle:+g} {axis}"
            if fault == "missing-turn" and name == troubled:
                path.hold(seconds, name="no turn")
            else:
                path.revolve(
                    room, sign * real, seconds, said, slip=slip,
                    profile=lambda s, n=seconds: trapezoid_angle(s * n, 1 / (n - 0.5), n - 1.0, 0.5),
                )  # fmt: skip
            path.hold(0.5, name="pause")
            at[which] += sign * turned
            nominal = so3.multiply(nominal, so3.exponential(turned * unit_axis))
            keys = {"angle_deg": angle, "uncertainty_deg": 2 * error / DEGREE}
            test.step("turn", said, axis=axis, **keys, seconds=seconds)
        path.hold(10.0, name=f"{name} end")
        _state_hold(test, f"{name} end", nominal, 2 * error)
        if name != "14":
            test.step("turn", "", seconds=8)
    unit = draw_unit(grade, rng, asymmetric=asymmetric)
    return test.recorded(unit=unit, lever=0.01 * rng.standard_normal(3))


def _state_hold(test: Test, name: str, attitude: np.ndarray, error: float) -> None:
    """State a whole attitude as up and heading, as protocols have it."""
    up = so3.rotate(so3.inverse(attitude), UP)
    up = np.where(np.abs(up) < 1e-9, 0.0, up)
    turned = so3.logarithm(so3.multiply(attitude, so3.inverse(so3.between(up, UP))))
    heading = float(-turned @ UP) / DEGREE
    test.step("hold", name, up=up, heading_deg=round(heading, 9), uncertainty_deg=error / DEGREE, seconds=10)


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
    test = Test("thermal-soak", "chamber", "thermal", grade, rng, fault, rate)
    ups = [*directions((1,)), *[np.array(v, float) for v in EDGES]]
    path = test.path
    path.attitude = posed(ups[0], 0.0)
    wanted: list[tuple[float, float]] = []
    bumped = test.number("bumped", len(soaks) * 9)
    for number, celsius in enumerate(soaks):
        wanted.append((path.seconds, celsius))
        path.hold(60 * minutes, name=f"{celsius}")
        test.step("soak", f"{celsius}", temperature_celsius=celsius, tolerance_k=1, seconds=60 * minutes)
        for k, up in enumerate(ups):
            if k:
                test.step("turn", "", seconds=3)
            path.turn_to(_off(posed(up, rng.uniform(0, 2 * np.pi)), 4 * DEGREE, rng), 3.0, Hand(), rng)
            test.hold(30, f"pose {k + 1}", STILL, bumped == 9 * number + k)
            test.step("hold", f"pose {k + 1}", up=up, uncertainty_deg=5, seconds=30)
    time = (np.arange(path.samples) + 0.5) / rate
    temperature = np.empty(path.samples)
    now = soaks[0]
    for (start, celsius), (stop, _) in zip(wanted, [*wanted[1:], (path.seconds + 1, 0.0)], strict=True):
        part = (time >= start) & (time < stop)
        temperature[part] = celsius + (now - celsius) * np.exp(-(time[part] - start) / 120)
        now = celsius + (now - celsius) * np.exp(-(stop - start) / 120)
    a, g = grade.accelerometer, grade.gyroscope
    slopes = np.repeat([a.per_kelvin, g.per_kelvin], 3)
    bends = np.array([1.0, 0.008, 0.00012])[:, None] * slopes * rng.standard_normal((3, 6))
    scales = np.repeat([a.scale_per_kelvin, g.scale_per_kelvin], 3) * rng.standard_normal(6)
    return test.recorded(temperature=temperature, thermal=Thermal(20.0, bends, scales))


_SPUN = ("loose", "missing-turn", "plate-leans")
TESTS: dict[str, tuple[Callable[..., Simulation], tuple[str, ...]]] = {
    "by-hand": (by_hand, ("bumped", "loose", "two-units")),
    "multi-position": (multi_position, ("bumped", "loose", "two-units")),
    "six-faces": (six_faces, ("bumped", "pose-off", "four-poses-off", "plate-leans")),
    "rate-table": (rate_table, (*_SPUN, "one-rate", "all-rates")),
    "modified-multi-position": (modified_multi_position, (*_SPUN, "one-rate", "all-rates")),
    "turntable": (turntable, (*_SPUN, "misread")),
    "laboratory": (laboratory, (*_SPUN, "misread", "pose-off")),
    "strapdown-rotation": (strapdown_rotation, (*_SPUN, "bumped", "pose-off")),
    "thermal-soak": (thermal_soak, ("bumped",)),
}
"""Each test by its name, and the faults that it has beside those of files and places."""
PROCEDURES = {name: test for name, (test, _) in TESTS.items()}
OWN_FAULTS = {name: faults for name, (_, faults) in TESTS.items()}
