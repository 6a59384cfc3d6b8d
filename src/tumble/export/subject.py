"""`Subject`: what a target writes: a calibration, noise, the magnetometer's correction, and what is lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, cast

import msgspec
import numpy as np

from tumble.arrays import Matrix, Vector, Vectors
from tumble.document import Calibration, DocumentPart, read_part, refusal
from tumble.errors import UsageError
from tumble.export.losses import Loss
from tumble.export.polynomials import NO_CURVES, Polynomials
from tumble.files import read_json, reading
from tumble.noise import MISSED
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad
from tumble.units import magnetic_field_factor

_FORMAT = "tumble noise"
_TRIADS = {"accelerometer": "a", "gyroscope": "g"}


@dataclass(frozen=True)
class TriadNoise:
    """White noise and random walk of a triad, SI: N two-sided per √Hz, K per second and √Hz.

    Attributes
    ----------
    density, walk : worst axis.
    densities : (3,) axis by axis.
    walk_is_limit : the walk is not seen in the recording; `walk` is the upper limit.
    missed : of the letters that are passed on, by channel and letter, the factor by which the fitted curve misses the
        measured one where the letter makes most of it.
    """

    density: float
    walk: float
    densities: Vector
    walk_is_limit: bool = False
    missed: dict[tuple[str, str], float] = field(default_factory=dict[tuple[str, str], float])


@dataclass(frozen=True)
class SensorNoise:
    """Noise of a unit.

    Attributes
    ----------
    rate : Hz, of the recording; per-sample numbers are for it.
    source : file name.
    """

    accelerometer: TriadNoise
    gyroscope: TriadNoise
    rate: float
    source: str

    @property
    def remarks(self) -> list[str]:
        """Return sentences on what the numbers are."""
        what = f"noise from {self.source}: of three axes the worst one, two-sided densities (IEEE Std 952)"
        said = [f"{what}, at {self.rate:g} Hz"]
        for name, triad in (("accelerometers'", self.accelerometer), ("gyros'", self.gyroscope)):
            if triad.walk_is_limit:
                said.append(
                    f"the {name} random walk is not seen in the recording: its upper limit stands in its place"
                )
            said += [
                f"{letter} of {channel} is known no better than to a factor of {factor:.2g}: the fitted model misses "
                "the measured curve by as much (see noise.html). Inflate it, or record again at rest and undisturbed"
                for (channel, letter), factor in triad.missed.items()
            ]
        return said


def read_noise(path: str | Path, *, rate: float | None = None) -> SensorNoise:
    """Read the coefficients of a ``noise.json`` of both triads.

    Parameters
    ----------
    path : the file, or the folder that holds it.
    rate : Hz that the consumer runs at, where it is not the recording's.

    Raises
    ------
    UsageError
        If it is no noise.json, lacks a triad or its white noise, or is in counts.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "noise.json"
    with reading(file, "a noise file", hint="give the noise.json that `tumble noise -o` wrote"):
        read: Any = read_json(file)
    if not isinstance(read, dict) or cast("dict[str, Any]", read).get("format") != _FORMAT:
        raise UsageError(f'{file} is no noise.json of tumble: it does not say "format": "{_FORMAT}".')
    try:
        document = read_part(_Document, read)
    except msgspec.ValidationError as error:
        raise UsageError(f"{file} is damaged: {refusal(error)}.") from error
    # A mean of stamps has more digits than a clock is good for: a millionth is kept.
    own = float(f"{document.rate_hz:.6g}")
    triads = [_triad(document, name, letter, file) for name, letter in _TRIADS.items()]
    return SensorNoise(triads[0], triads[1], own if rate is None else rate, file.name)


class _Value(DocumentPart):
    value: Annotated[float, msgspec.Meta(ge=0.0)]
    curve_missed_by: float | None = None


class _Channel(DocumentPart):
    unit: str
    terms: dict[str, _Value]
    upper_limits_of_unseen: dict[str, _Value]
    random_walk: _Value | None = None


class _Document(DocumentPart):
    """Of a noise.json what is taken from it."""

    rate_hz: Annotated[float, msgspec.Meta(gt=0.0)]
    channels: dict[str, _Channel]


def _triad(document: _Document, name: str, letter: str, file: Path) -> TriadNoise:
    channels = {key: one for key, one in sorted(document.channels.items()) if key.startswith(letter)}
    if len(channels) < 3:
        raise UsageError(f"{file} has {len(channels)} channels of the {name}: three are needed.")
    own = list(channels.values())
    if any(channel.unit == "counts" for channel in own):
        raise UsageError(
            f"{file} is in counts: say the units of its recording (`tumble noise --units`), for these "
            "numbers are SI."
        )
    white = [found for one in own if (found := one.random_walk or one.terms.get("N"))]
    if len(white) < len(own):
        raise UsageError(f"{file} shows no white noise (N) on every axis of the {name}: record for longer.")
    walks = [one.terms["K"].value for one in own if "K" in one.terms]
    limits = [one.upper_limits_of_unseen["K"].value for one in own if "K" in one.upper_limits_of_unseen]
    if not walks and not limits:
        raise UsageError(
            f"{file} shows no random walk (K) of the {name} and no limit for it: record for longer, or name "
            "another file."
        )
    densities = np.array([one.value for one in white])
    return TriadNoise(
        density=float(densities.max()),
        walk=max(walks or limits),
        densities=densities,
        walk_is_limit=not walks,
        missed={
            (key, letter): term.curve_missed_by
            for key, channel in channels.items()
            for letter, term in channel.terms.items()
            if letter in "NBK" and term.curve_missed_by and term.curve_missed_by > MISSED
        },
    )


LARGEST_LOSS = 0.02
"""Of the true vector's length: a target that would lose more is not written without being told to."""


@dataclass(frozen=True)
class Wishes:
    """What the user wants of a conversion.

    Attributes
    ----------
    frame : name of the frame of corrected vectors, or None for the calibration's or the target's own.
    temperature : °C to take a thermal calibration at, or None for its reference temperature.
    largest_loss : of the true vector's length, beyond which nothing is written.
    topic : name of the ROS topic, or None for the one that the recording was made from, or else /imu0.
    """

    frame: str | None = None
    temperature: float | None = None
    largest_loss: float = LARGEST_LOSS
    topic: str | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises
        ------
        UsageError
            If one is none that a conversion can work with.
        """
        if not 0.0 <= self.largest_loss < np.inf:
            raise UsageError(f"--largest-loss {1e6 * self.largest_loss:g}: give ppm, 0 or more.")


@dataclass(frozen=True)
class Subject:
    """What a target writes.

    Attributes
    ----------
    model : raw numbers in `units`; both triads are there, with what the target holds and nominal numbers for the rest.
    units : of raw specific force and angular rate.
    frame, frame_words : of corrected vectors.
    calibration : where it is from, or None for noise alone.
    curves : biases over temperature, for targets that hold them.
    noise : or None.
    losses : what the target does not hold, with its size.
    magnetometer : its correction, for targets that hold one, or None.
    """

    model: ImuModel
    units: tuple[str, str]
    frame: str
    frame_words: str
    calibration: Calibration | None
    wishes: Wishes
    curves: Polynomials = NO_CURVES
    noise: SensorNoise | None = None
    losses: tuple[Loss, ...] = ()
    remarks: tuple[str, ...] = field(default=())
    magnetometer: FieldCorrection | None = None

    @property
    def topic(self) -> str:
        """The ROS topic: the user's, or that of the recordings if they have one, or /imu0."""
        recordings = self.calibration.recordings if self.calibration is not None else ()
        recorded = {one.topic for one in recordings}
        alone = recorded.pop() if len(recorded) == 1 else None
        return self.wishes.topic or alone or "/imu0"

    @property
    def accelerometer(self) -> Triad:
        """The accelerometers."""
        assert self.model.accelerometer is not None
        return self.model.accelerometer

    @property
    def gyroscope(self) -> Triad:
        """The gyros."""
        assert self.model.gyroscope is not None
        return self.model.gyroscope

    def vectors(self) -> tuple[Vectors, Vectors, Vectors, Vectors]:
        """Return three raw specific forces and angular rates in `units`, round numbers, and both corrected (SI)."""
        force = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [3.0, -4.0, 9.0]])
        rate = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, -0.1], [0.3, -0.4, 0.5]])
        raw_force, raw_rate = (_rounded(raw) for raw in self.model.distort(force, rate))
        force, rate = self.model.correct(raw_force, raw_rate)
        return raw_force, raw_rate, force, rate


def _rounded(values: Vectors) -> Vectors:
    """Return numbers of four digits, which a person can type."""
    return np.array([[float(f"{v:.4g}") for v in row] for row in values])


LOCAL = "local field"


@dataclass(frozen=True)
class FieldCorrection:
    """What corrects a magnetometer: ``x = soft_iron @ (u - hard_iron)``.

    Attributes
    ----------
    soft_iron : (3, 3) units of x per raw unit.
    hard_iron : (3,) raw.
    raw_unit, unit : of u ("counts" among them) and of x: "uT", "gauss", "mgauss" or "local field".
    axes : along which x is, in words.
    norm : of the field in which it was found, in units of x.
    """

    soft_iron: Matrix
    hard_iron: Vector
    raw_unit: str
    unit: str
    axes: str
    norm: float

    def correct(self, raw: Vectors) -> Vectors:
        """Return the corrected field of (samples, 3) raw numbers."""
        return (raw - self.hard_iron) @ self.soft_iron.T

    def vectors(self) -> tuple[Vectors, Vectors]:
        """Return three raw fields, round numbers, and the corrected ones."""
        directions = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [-0.36, 0.48, 0.8]])
        raw = self.hard_iron + np.linalg.solve(self.soft_iron, self.norm * directions.T).T
        raw = np.array([[float(f"{v:.4g}") for v in row] for row in raw])
        return raw, self.correct(raw)

    def in_units(self, raw_unit: str, unit: str) -> FieldCorrection | None:
        """Return the same for other units of magnetic field; None where counts or an unknown norm do not allow it.

        Parameters
        ----------
        raw_unit, unit : that `tumble.units` knows.
        """
        own, out = magnetic_field_factor(self.raw_unit), magnetic_field_factor(unit)
        wanted = magnetic_field_factor(raw_unit)
        if own is None or wanted is None or out is None or self.unit == LOCAL:
            return None
        before = magnetic_field_factor(self.unit)
        assert before is not None
        return FieldCorrection(
            self.soft_iron * (wanted / own) * (before / out),
            self.hard_iron * (own / wanted),
            raw_unit,
            unit,
            self.axes,
            self.norm * before / out,
        )


def field_lines(made: FieldCorrection, formula: str) -> list[str]:
    """Return what a comment says of a magnetometer: formula, units, test vector.

    Parameters
    ----------
    made : what is written.
    formula : in the tool's own names.
    """
    raw, true = made.vectors()
    unit = "units of the local field" if made.unit == LOCAL else made.unit
    return [
        f"magnetometer: {formula}; raw in {made.raw_unit}, corrected in {unit} along the axes {made.axes}",
        f"test vector: raw magnetic field {_row(raw[2])} corrected to {_row(true[2])}",
    ]


def _row(values: Sequence[float] | Vector) -> str:
    return "[" + ", ".join(f"{v:.9g}" for v in values) + "]"
