"""Noise coefficients of both triads from noise.json, as the consumers of this room want them."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, cast

import msgspec
import numpy as np

from tumble.arrays import Vector
from tumble.document import DocumentPart, read_part, refusal
from tumble.errors import UsageError
from tumble.files import read_json, reading
from tumble.noise import MISSED
from tumble.records import dataclass

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
