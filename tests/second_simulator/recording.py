"""From a motion and a unit to the numbers of a file, with the faults that files and units have."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .earth import earth_rate, normal_gravity
from .motion import Path
from .sensors import DEGREE, STANDARD_GRAVITY, Grade, Unit, draw_unit, round_and_cut, wander
from .truth import Thermal, Truth

RECORD_FAULTS = (
    "clipped", "reversed-gyro", "reversed-accelerometer", "swapped-gyro", "swapped-both", "dead-gyro",
    "dead-accelerometer", "dropped", "gaps", "doubled", "lag", "clock-0.5", "clock-1", "other-units", "two-units",
    "warm-up", "gyro-ramp",
)  # fmt: skip
"""Faults of a file or a unit, whatever was done to it."""

STATED_FAULTS = ("wrong-latitude", "wrong-gravity")
"""Faults of what is said of the place."""


@dataclass
class Place:
    """Where it was: the truth, and what is believed of it."""

    latitude: float
    height: float
    gravity: float
    stated_latitude: float
    stated_gravity: float | None
    stated_sigma: float

    @classmethod
    def draw(cls, grade: Grade, rng: np.random.Generator, fault: str | None) -> Place:
        """Draw a place; its gravity departs from the normal one by 30 mGal, as the Earth's does."""
        latitude, height = rng.uniform(-65, 65) * DEGREE, rng.uniform(0, 900)
        gravity = normal_gravity(latitude, height) + 3e-4 * rng.standard_normal()
        stated = gravity + 2e-5 * rng.standard_normal() if grade.surveyed else None
        if fault == "wrong-gravity":
            stated = gravity * 1.005
        said = latitude + (10 * DEGREE if fault == "wrong-latitude" else 0.0)
        if fault == "wrong-latitude" and stated is None:
            stated = gravity
        return cls(latitude, height, gravity, said, stated, 2e-5)

    def text(self) -> str:
        """Return the protocol's lines of the site."""
        lines = [f"  latitude_deg: {self.stated_latitude / DEGREE:.9f}", f"  height_m: {self.height:.3f}"]
        if self.stated_gravity is not None:
            lines += [f"  gravity: {self.stated_gravity:.9f}", f"  gravity_uncertainty: {self.stated_sigma}"]
        return "\n".join(["site:", *lines])


@dataclass
class Simulation:
    """A recording with its protocol and its truth.

    Attributes
    ----------
    time, force, rate, temperature : of the samples; s, raw units twice, °C.
    units : of force and rate, as ``--units`` takes them.
    protocol : the text of a protocol file.
    truth : what is true.
    place : where it was, and what was said of it.
    other : a second recording, where two units' files are taken for one.
    path : the motion, with its steps as they happened.
    """

    time: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    temperature: np.ndarray
    units: str
    protocol: str
    truth: Truth
    place: Place
    path: Path
    other: Simulation | None = None

    def columns(self) -> dict[str, np.ndarray]:
        """Return the recording as named columns with their units, as a file would have them."""
        force_unit, rate_unit = self.units.split(",")
        columns = {"time (s)": self.time}
        for k, axis in enumerate("xyz"):
            columns[f"a{axis} ({force_unit})"] = self.force[:, k]
        for k, axis in enumerate("xyz"):
            columns[f"g{axis} ({rate_unit})"] = self.rate[:, k]
        columns["temperature (degC)"] = self.temperature
        return columns


def record(
    path: Path,
    grade: Grade,
    place: Place,
    protocol: str,
    rng: np.random.Generator,
    *,
    unit: Unit | None = None,
    lever: np.ndarray | None = None,
    fault: str | None = None,
    temperature: np.ndarray | None = None,
    thermal: Thermal | None = None,
    white: bool = False,
) -> Simulation:
    """Let a unit go through a motion.

    `lever` is where it sits from the point that the motion is about, m; `temperature` in °C; `white`: no wander.
    """
    unit = unit or grade.unit or draw_unit(grade, rng)
    lever = np.zeros(3) if lever is None else lever
    seen = path.sampled(earth_rate(place.latitude), place.gravity, lever)
    samples = len(seen.time)
    celsius = 24.0 + np.zeros(samples) if temperature is None else temperature
    a, g = grade.accelerometer, grade.gyroscope
    force = unit.force_output(seen.force).mean(axis=1)
    for axis, arm in enumerate(unit.arms):
        if arm.any():
            there = path.sampled(earth_rate(place.latitude), place.gravity, lever + arm)
            force[:, axis] = unit.force_output(there.force).mean(axis=1)[:, axis]
    # A path begins at rest: what is read late shows that.
    force = np.concatenate((np.repeat(force[:1], unit.late, axis=0), force))[:samples]
    rate = unit.rate_output(seen.rate, seen.force).mean(axis=1)
    moved = np.zeros((samples, 6))
    if not white:
        moved = np.hstack((wander(a, samples, path.rate, rng), wander(g, samples, path.rate, rng)))
    if fault == "warm-up":
        fading = np.exp(-seen.time / rng.uniform(40, 90))
        size = rng.choice([-1.0, 1.0], 6) * np.repeat([a.warm_up, g.warm_up], 3)
        moved = moved + fading[:, None] * size
    if fault == "gyro-ramp":
        # What a gyro does in the first seconds after switching on.
        fading = np.exp(-seen.time / np.exp(rng.uniform(np.log(4.0), np.log(60.0))))
        moved[:, 3:] += fading[:, None] * rng.choice([-1.0, 1.0], 3) * 0.3 * DEGREE
    if thermal is not None:
        # In SI here; the truth's numbers are turned into raw units with all others below.
        offset = celsius - thermal.reference
        force = unit.accelerometer_bias + (force - unit.accelerometer_bias) * (
            1 + offset[:, None] * thermal.scale[:3]
        )
        rate = unit.gyro_bias + (rate - unit.gyro_bias) * (1 + offset[:, None] * thermal.scale[3:])
        changed = np.stack([offset ** (k + 1) for k in range(len(thermal.bias))], axis=1) @ thermal.bias
        force, rate = force + changed[:, :3], rate + changed[:, 3:]
    force = force + moved[:, :3] + a.noise * np.sqrt(path.rate) * rng.standard_normal((samples, 3))
    rate = rate + moved[:, 3:] + g.noise * np.sqrt(path.rate) * rng.standard_normal((samples, 3))
    limit = g.limit
    if fault == "clipped":
        limit = 0.75 * np.abs(rate).max()
    force, rate = round_and_cut(force, a.step, a.limit), round_and_cut(rate, g.step, limit)
    consumer = grade.units.startswith("g,")
    force_unit, rate_unit = (1 / STANDARD_GRAVITY, 1 / DEGREE) if consumer else (1.0, 1.0)
    mean = moved.mean(axis=0)
    true = replace(
        unit, accelerometer_bias=unit.accelerometer_bias + mean[:3], gyro_bias=unit.gyro_bias + mean[3:]
    )
    both = np.repeat([force_unit, rate_unit], 3)
    spread = np.concatenate((unit.accelerometer_bias, unit.gyro_bias)) + np.stack(
        (moved.min(axis=0), moved.max(axis=0))
    )
    shown = None if thermal is None else replace(thermal, bias=thermal.bias * both)
    truth = Truth(true, force_unit, rate_unit, spread * both, shown)
    thermometer = round_and_cut(celsius + 0.02 * rng.standard_normal(samples), 0.01, 1000.0)
    made = Simulation(
        seen.time + 12.0,
        force * force_unit,
        rate * rate_unit,
        thermometer,
        grade.units,
        protocol,
        truth,
        place,
        path,
    )
    return spoiled(made, fault, rng)


def _kept(made: Simulation, keep: np.ndarray) -> Simulation:
    return replace(
        made,
        time=made.time[keep],
        force=made.force[keep],
        rate=made.rate[keep],
        temperature=made.temperature[keep],
    )


def spoiled(made: Simulation, fault: str | None, rng: np.random.Generator) -> Simulation:
    """Return a recording with a fault of its file."""
    force, rate, count = made.force.copy(), made.rate.copy(), len(made.time)
    axis = int(rng.integers(3))
    step = 1 / made.path.rate
    if fault == "reversed-gyro":
        rate[:, axis] *= -1
    elif fault == "reversed-accelerometer":
        force[:, axis] *= -1
    elif fault == "swapped-gyro":
        rate[:, [axis, (axis + 1) % 3]] = rate[:, [(axis + 1) % 3, axis]]
    elif fault == "swapped-both":
        pair = [axis, (axis + 1) % 3]
        rate[:, pair], force[:, pair] = rate[:, pair[::-1]], force[:, pair[::-1]]
    elif fault == "dead-gyro":
        rate[:, axis] = rate[0, axis]
    elif fault == "dead-accelerometer":
        force[:, axis] = force[0, axis]
    elif fault == "lag":
        late = np.arange(count) * step - 0.05
        force = np.stack([np.interp(late, np.arange(count) * step, one) for one in force.T], axis=1)
    elif fault == "other-units":
        one = 1 / STANDARD_GRAVITY if made.units.startswith("m/s^2") else STANDARD_GRAVITY
        force[:, axis] *= one
    made = replace(made, force=force, rate=rate)
    if fault in ("clock-0.5", "clock-1"):
        return replace(made, time=made.time * (1 + float(fault[6:]) / 100))
    if fault in ("dropped", "gaps"):
        keep = rng.uniform(size=count) > 0.002
        for at in rng.integers(0, count - 40, 4):
            keep[at : at + rng.integers(8, 30)] = False
        lost = _kept(made, keep)
        if fault == "dropped":
            # A logger that counts what it wrote: stamps run on evenly over what is missing.
            lost = replace(lost, time=made.time[0] + step * np.arange(len(lost.time)))
        return lost
    if fault == "doubled":
        index = np.sort(np.concatenate((np.arange(count), rng.integers(0, count, count // 300))))
        return _kept(made, index)
    return made
