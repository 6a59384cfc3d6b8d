"""Whether a calibration recovers a simulated unit's truth, within its stated uncertainties."""

from __future__ import annotations

import os
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from tumble.calibration.magnetometer.estimate import named_parameters
from tumble.document import Calibration, read_calibration
from tumble.document.difference import ParameterChange
from tumble.errors import CalibrationFileError, UsageError
from tumble.files import read_json, reading
from tumble.records import dataclass

PathLike = str | os.PathLike[str]

_LISTS = {
    "accelerometer-x": "parameters",
    "fixture": "parameters_in_fixture",
    "mean-gyro": "parameters_in_mean_gyro",
}
FALSE_ALARM = 0.01
"""Chance of calling right uncertainties too small."""


@dataclass(frozen=True, slots=True)
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
