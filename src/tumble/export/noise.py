"""Noise coefficients of both triads from noise.json, as the consumers of this room want them."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.arrays import Vector
from tumble.errors import UsageError
from tumble.files import number_of, read_json, reading
from tumble.noise.fitting.fit import MISSED
from tumble.records import dataclass

_FORMAT = "tumble noise"
_TRIADS = {"accelerometer": "a", "gyroscope": "g"}


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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
    document = _document(file)
    found: dict[str, TriadNoise] = {}
    for name, letter in _TRIADS.items():
        found[name] = _triad(document, name, letter, file)
    return SensorNoise(
        found["accelerometer"],
        found["gyroscope"],
        _rate(document, file) if rate is None else rate,
        file.name,
    )


def _document(file: Path) -> dict[str, Any]:
    with reading(file, "a noise file", hint="give the noise.json that `tumble noise -o` wrote"):
        document: Any = read_json(file)
    if not isinstance(document, dict) or cast("dict[str, Any]", document).get("format") != _FORMAT:
        raise UsageError(f'{file} is no noise.json of tumble: it does not say "format": "{_FORMAT}".')
    return cast("dict[str, Any]", document)


def _rate(document: dict[str, Any], file: Path) -> float:
    try:
        # A mean of stamps has more digits than a clock is good for: a millionth is kept.
        return float(f"{number_of(document['rate_hz']):.6g}")
    except (KeyError, ValueError) as error:
        raise UsageError(f"{file} is damaged: its rate_hz is no number ({error}).") from error


def _triad(document: dict[str, Any], name: str, letter: str, file: Path) -> TriadNoise:
    try:
        channels = {key: value for key, value in document["channels"].items() if key.startswith(letter)}
        if len(channels) < 3:
            raise UsageError(f"{file} has {len(channels)} channels of the {name}: three are needed.")
        channel_list = [channels[key] for key in sorted(channels)]
        if any(channel["unit"] == "counts" for channel in channel_list):
            raise UsageError(
                f"{file} is in counts: say the units of its recording (`tumble noise --units`), for these "
                "numbers are SI."
            )
        white = [channel.get("random_walk") or channel["terms"].get("N") for channel in channel_list]
        if any(each is None for each in white):
            raise UsageError(
                f"{file} shows no white noise (N) on every axis of the {name}: record for longer."
            )
        densities = np.array([number_of(each["value"]) for each in white])
        walks = [number_of(c["terms"]["K"]["value"]) for c in channel_list if "K" in c["terms"]]
        limits = [
            number_of(c["upper_limits_of_unseen"]["K"]["value"])
            for c in channel_list
            if "K" in c["upper_limits_of_unseen"]
        ]
        missed = {
            (key, letter): number_of(term["curve_missed_by"])
            for key, channel in channels.items()
            for letter, term in channel["terms"].items()
            if letter in "NBK" and (term.get("curve_missed_by") or 1.0) > MISSED
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"{file} is damaged: {type(error).__name__} at {error}.") from error
    if not walks and not limits:
        raise UsageError(
            f"{file} shows no random walk (K) of the {name} and no limit for it: record for longer, or name "
            "another file."
        )
    walk = max(walks) if walks else max(limits)
    return TriadNoise(
        density=float(densities.max()),
        walk=walk,
        densities=densities,
        walk_is_limit=not walks,
        missed=missed,
    )
