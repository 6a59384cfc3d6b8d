"""Noise coefficients in the units that people use, and what each of them is, in words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tumble.report.rounding import decimals_of, fixed
from tumble.units import (
    angle_increment_factor,
    angular_rate_factor,
    specific_force_factor,
    time_factor,
    velocity_increment_factor,
)

if TYPE_CHECKING:
    from tumble.noise.characterisation import Channel

NAMES = {
    "Q": "quantisation",
    "N": "random walk",
    "B": "bias instability",
    "K": "rate random walk",
    "R": "ramp",
    "sigma": "Gauss-Markov, standard deviation",
    "correlation time": "Gauss-Markov, correlation time",
}
DEFINITIONS = {
    "Q": "quantisation: Allan variance 3 Q²/τ²; white noise of the integrated signal.",
    "N": (
        "angle or velocity random walk: Allan variance N²/τ, two-sided density N². A sample scatters by N √rate; a "
        "noise density that a data sheet states one-sided is √2 N."
    ),
    "B": (
        "bias instability: Allan variance (2 ln 2/π) B², two-sided density B²/(2πf). The curve's floor is 0.664 B; "
        "some programs give the floor itself."
    ),
    "K": "rate random walk: Allan variance K² τ/3; the bias is the integral of white noise of two-sided density K².",
    "R": "ramp: Allan variance R² τ²/2; a steady drift of the bias.",
    "sigma": "first-order Gauss-Markov process: autocovariance σ² exp(-|t|/T); tried where the letters do not fit.",
    "correlation time": "T of the same process.",
}
FORMULA = "σ²(τ) = 3 Q²/τ² + N²/τ + (2 ln 2/π) B² + K² τ/3 + R² τ²/2"
_SI = {
    "g": {
        "Q": "rad",
        "N": "rad/s/√Hz",
        "B": "rad/s",
        "K": "rad/s/√s",
        "R": "rad/s²",
        "sigma": "rad/s",
        "correlation time": "s",
    },
    "a": {
        "Q": "m/s",
        "N": "m/s²/√Hz",
        "B": "m/s²",
        "K": "m/s²/√s",
        "R": "m/s³",
        "sigma": "m/s²",
        "correlation time": "s",
    },
}
_COUNTS = {
    "Q": "counts·s",
    "N": "counts/√Hz",
    "B": "counts",
    "K": "counts/√s",
    "R": "counts/s",
    "sigma": "counts",
    "correlation time": "s",
}


# Where they are not seen, it is said how large they may be.
_ASKED_FOR = "NBK"


@dataclass(frozen=True, slots=True)
class NoiseRow:
    """One coefficient of one channel for people.

    Attributes
    ----------
    channel, letter, name : such as gx, N, random walk.
    practical : value with its uncertainty and unit, as people use it; "< ..." where it is not seen.
    si : the value in SI, or in counts.
    seen : whether the curve shows it.
    """

    channel: str
    letter: str
    name: str
    practical: str
    si: str
    seen: bool


def si_unit(channel: Channel, letter: str) -> str:
    """Return the name of the unit that a coefficient's value has."""
    return _COUNTS[letter] if channel.unit == "counts" else _SI[channel.name[0]][letter]


def practical_unit(channel: Channel, letter: str) -> tuple[float, str]:
    """Return the factor to the unit that people use for a coefficient, and its name.

    Parameters
    ----------
    channel : tells the kind of sensor, and whether it is in counts.
    letter : of IEEE Std 952.
    """
    if letter == "correlation time":
        return 1.0, "s"
    if channel.unit == "counts":
        return 1.0, _COUNTS[letter]
    root_hour = math.sqrt(time_factor("h"))
    if channel.is_gyro:
        # Per hour and per second both are known units of rate; a walk's root of time goes with them.
        degree, slow = angular_rate_factor("deg/s") or 1.0, angular_rate_factor("deg/h") or 1.0
        return {
            "Q": (1.0 / angle_increment_factor("arcsec"), "″"),
            "N": (root_hour / degree, "°/√h"),
            "B": (1.0 / slow, "°/h"),
            "sigma": (1.0 / slow, "°/h"),
            "K": (root_hour / slow, "°/h/√h"),
            "R": (root_hour**2 / slow, "°/h/h"),
        }[letter]
    small = specific_force_factor("ug") or 1.0
    return {
        "Q": (1.0 / velocity_increment_factor("mm/s"), "mm/s"),
        "N": (1.0 / small, "µg/√Hz"),
        "B": (1.0 / small, "µg"),
        "sigma": (1.0 / small, "µg"),
        "K": (root_hour / small, "µg/√h"),
        "R": (root_hour**2 / small, "µg/h"),
    }[letter]


def noise_rows(channel: Channel) -> list[NoiseRow]:
    """Return the coefficients of a channel: what is seen, and upper limits of N, B and K that are not.

    Parameters
    ----------
    channel : with its terms.
    """
    rows: list[NoiseRow] = []
    for letter, name in NAMES.items():
        factor, unit = practical_unit(channel, letter)
        term, label = channel.term(letter), _label(channel, letter, name)
        if term is not None:
            text = f"{_rounded(factor * term.value, factor * term.sigma)} {unit}"
            si = f"{_rounded(term.value, term.sigma)} {si_unit(channel, letter)}"
            rows.append(NoiseRow(channel.name, letter, label, text, si, True))
        elif letter in channel.unseen and letter in _ASKED_FOR:
            limit = channel.unseen[letter]
            text = f"not seen, < {_upwards(factor * limit)} {unit}"
            si = f"< {_upwards(limit)} {si_unit(channel, letter)}"
            rows.append(NoiseRow(channel.name, letter, label, text, si, False))
    return rows


def noise_lines(channels: tuple[Channel, ...], *, seen_only: bool = False) -> list[str]:
    """Return the coefficients of all channels as lines of plain text with aligned columns.

    Parameters
    ----------
    channels : in order.
    seen_only : whether to leave out upper limits.
    """
    cells = [["", "term", "", "± standard uncertainty", "in SI"]]
    for channel in channels:
        rows = [row for row in noise_rows(channel) if row.seen or not seen_only]
        for k, row in enumerate(rows):
            letter = row.letter if len(row.letter) == 1 else ""
            cells.append([row.channel if k == 0 else "", row.name, letter, row.practical, row.si])
    width = [max(len(line[i]) for line in cells) for i in range(len(cells[0]))]
    return ["  ".join(part.ljust(w) for part, w in zip(line, width, strict=True)).rstrip() for line in cells]


def _label(channel: Channel, letter: str, name: str) -> str:
    if letter != "N":
        return name
    return "angle random walk" if channel.is_gyro else "velocity random walk"


def _upwards(limit: float) -> str:
    """A limit with two digits, rounded up, without a power of ten where that reads better."""
    if not (math.isfinite(limit) and limit > 0.0):
        return f"{limit:g}"
    unit = 10.0 ** (math.floor(math.log10(limit)) - 1)
    # A last digit that is only rounding is none.
    up = unit * math.ceil(limit / unit * (1.0 - 1e-9))
    return f"{float(f'{up:.2g}'):g}"


def _rounded(value: float, spread: float) -> str:
    """Value and uncertainty to two digits of the uncertainty, with a power of ten where that reads better."""
    if not (math.isfinite(spread) and spread > 0.0 and value != 0.0):
        return f"{value:.3g}"
    if 1e-2 <= abs(value) < 1e5:
        decimals = decimals_of(spread)
        return f"{fixed(value, decimals)} ± {fixed(spread, decimals)}"
    power = math.floor(math.log10(abs(value)))
    decimals = decimals_of(spread * 10.0**-power)
    return f"({fixed(value * 10.0**-power, decimals)} ± {fixed(spread * 10.0**-power, decimals)})e{power}"


__all__ = [
    "DEFINITIONS",
    "FORMULA",
    "NAMES",
    "NoiseRow",
    "noise_lines",
    "noise_rows",
    "practical_unit",
    "si_unit",
]
