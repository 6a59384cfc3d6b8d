"""What changed from one calibration to another and whether it matters, or from the truth of a simulated unit."""

from __future__ import annotations

import os
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from tumble.calibration import named_parameters
from tumble.document import Calibration, Difference, ParameterChange, compare_calibrations, read_calibration
from tumble.errors import CalibrationFileError, UsageError
from tumble.files import read_json, reading
from tumble.parameters import Measure, amount, said
from tumble.records import dataclass
from tumble.units import STANDARD_GRAVITY

PathLike = str | os.PathLike[str]


def difference(first: PathLike, second: PathLike) -> Difference:
    """Return what changed from one calibration to another.

    Raises
    ------
    UsageError
        If they cannot be compared.
    CalibrationFileError
        If a file cannot be read.
    """
    return compare_calibrations(read_calibration(first), read_calibration(second))


_FORCE_ROUNDING = 1e-9 * STANDARD_GRAVITY  # m/s²
_RATE_ROUNDING = 1e-12  # rad/s


def verdict(found: Difference, allowed: tuple[float, float] | None) -> tuple[bool, list[str]]:
    """Return whether the change matters, and why, in sentences.

    Parameters
    ----------
    found : the change.
    allowed : m/s² at 1 g and rad/s at rest that do no harm; None: whatever is more than its uncertainty matters.
    """
    sentences: list[str] = []
    matters = False
    for effect, limit, rounding, text in (
        (found.force, None if allowed is None else allowed[0], _FORCE_ROUNDING, _force_text),
        (found.rest_rate, None if allowed is None else allowed[1], _RATE_ROUNDING, _rate_text),
    ):
        if effect is None:
            continue
        certain = effect.standard_uncertainty <= 0.0
        above = effect.value > max(2.0 * effect.standard_uncertainty, rounding)
        # The worst of many directions is beyond two sigmas more often than one: the parameters have to agree.
        seen = above and (certain or found.significant or not found.groups)
        large = seen if limit is None else effect.value > limit
        matters = matters or (large and seen)
        if certain:
            said = "no uncertainty of it is known" if above else "no more than rounding"
        else:
            said = "more than its uncertainty" if seen else "not more than its uncertainty explains"
        allowance = "" if limit is None else f", {'above' if large else 'within'} what is allowed"
        size = effect.value if effect.value > rounding else 0.0
        sentences.append(f"{text(size, effect.standard_uncertainty)}: {said}{allowance}.")
    if found.groups:
        chance = "more" if found.significant else "no more"
        sentences.insert(0, f"The parameters differ by {chance} than chance (5 %, all groups together).")
    return matters, sentences


def _force_text(value: float, sigma: float) -> str:
    metres = float(f"{0.5 * value * 60.0**2:.2g}")
    return (
        f"Corrected specific forces of 1 g differ by up to {_said(value, sigma, 'm/s^2')}, a tilt of "
        f"{amount(value / STANDARD_GRAVITY, 'rad')} or {metres:.10g} m after a minute of dead reckoning"
    )


def _rate_text(value: float, sigma: float) -> str:
    return (
        f"Corrected rates at rest differ by up to {_said(value, sigma, 'rad/s')}, "
        f"{float(f'{np.degrees(value) * 60.0:.2g}'):.10g}° a minute"
    )


def _said(value: float, sigma: float, unit: str) -> str:
    """A size with its uncertainty; what is certain is said to be so elsewhere."""
    return said([Measure(value, sigma, unit)])[0].text if sigma > 0.0 else amount(value, unit)


_LISTS = {
    "accelerometer-x": "parameters",
    "fixture": "parameters_in_fixture",
    "mean-gyro": "parameters_in_mean_gyro",
}
FALSE_ALARM = 0.01
"""Chance of calling right uncertainties too small."""


@dataclass(frozen=True)
class Recovery:
    """What is stated against what is true.

    Attributes
    ----------
    calibration : that was judged.
    parameters : first the truth, then what is stated, with the stated standard uncertainty.
    limit : the largest of so many standard normal numbers, exceeded by chance in one of a hundred cases.
    """

    calibration: Calibration
    parameters: list[ParameterChange]
    limit: float

    @property
    def worst(self) -> ParameterChange:
        """The parameter that is the most standard uncertainties from its truth."""
        return max(self.parameters, key=lambda change: abs(change.sigmas))

    @property
    def recovered(self) -> bool:
        """Whether all are within the limit."""
        return abs(self.worst.sigmas) <= self.limit

    @property
    def remarks(self) -> list[str]:
        """What is to be known of the comparison."""
        if self.calibration.magnetometer is None or any("magnetometer" in p.name for p in self.parameters):
            return []
        return ["The magnetometer is not compared: the truth has none, or in another unit."]

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        worst, count = self.worst, len(self.parameters)
        said = f"{worst.name} is {abs(worst.sigmas):.1f} standard uncertainties from the truth"
        if self.recovered:
            return f"Recovered: all {count} parameters within {abs(worst.sigmas):.1f} standard uncertainties ({said})."
        return f"Not recovered: {said}, where chance allows {self.limit:.1f} for the worst of {count} parameters."


def is_truth(path: PathLike) -> bool:
    """Return whether a file is the truth.json of a simulation.

    Parameters
    ----------
    path : of any file.
    """
    try:
        document: Any = read_json(Path(path))
    except (OSError, ValueError):
        return False
    return isinstance(document, dict) and ("format", "tumble truth") in document.items()


def recovery(truth: PathLike, calibration: PathLike) -> Recovery:
    """Compare a calibration with the truth of the unit that was simulated.

    A bias is compared with its mean while it was recorded, from which it wanders.

    Parameters
    ----------
    truth : truth.json, as `tumble simulate` writes it.
    calibration : of that recording.

    Raises
    ------
    UsageError
        If the two have other units, or no parameters in common.
    CalibrationFileError
        If a file cannot be read.
    """
    stated = read_calibration(calibration)
    true = _true_parameters(Path(truth), stated)
    changes = [
        ParameterChange(
            one.name,
            true[one.name],
            one.value,
            one.standard_uncertainty,
            (one.value - true[one.name]) / one.standard_uncertainty,
            one.unit,
        )
        for one in (*stated.parameters, *(stated.magnetometer.parameters if stated.magnetometer else ()))
        if one.name in true and one.standard_uncertainty > 0.0
    ]
    if not changes:
        raise UsageError(f"{truth} and {calibration} have no parameters in common.")
    each = 1.0 - (1.0 - FALSE_ALARM) ** (1.0 / len(changes))
    return Recovery(stated, changes, NormalDist().inv_cdf(1.0 - 0.5 * each))


def _true_parameters(path: Path, stated: Calibration) -> dict[str, float]:
    with reading(path, "a truth.json", CalibrationFileError):
        document: Any = read_json(path)
    try:
        units = document["raw_units"]
        if (units["specific_force"], units["angular_rate"]) != (
            stated.raw_units.specific_force,
            stated.raw_units.angular_rate,
        ):
            raise UsageError(
                f"{path} is of another recording: its raw units are not those of the calibration."
            )
        listed: list[dict[str, Any]] = document[_LISTS.get(stated.frame.name, "parameters")]
        true = {one["name"]: float(one.get("session_value", one["value"])) for one in listed}
        return true | _true_magnetometer(document.get("magnetometer"), stated)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise CalibrationFileError(f"{path} is no truth.json of `tumble simulate`.") from None


def _true_magnetometer(told: dict[str, Any] | None, stated: Calibration) -> dict[str, float]:
    """The true parameters of the magnetometer by name, in the unit that is stated; none where the units differ."""
    block = stated.magnetometer
    if told is None or block is None or block.raw_unit != told["raw_unit"]:
        return {}
    own = told["in_frame_accelerometer_x"]
    size = 1.0 if block.unit == told["unit"] else float(told["field"]["norm"])
    numbers = np.concatenate([size * np.ravel(own["matrix"]), own["bias"]]).astype(float)
    turned = stated.frame.name == "accelerometer-x"
    named = named_parameters(numbers, np.zeros((12, 12)), block.raw_unit, block.unit, turned=turned)
    return {one.name: one.value for one in named}
