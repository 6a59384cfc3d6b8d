"""What came of many units: an outcome each, and what only all of them tell."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

from tumble.fleet.unit_vector import UnitVector
from tumble.records import dataclass

ACCELEROMETER, GYRO = "accelerometer", "gyro"


@dataclass
class UnitOutcome:
    """What came of a unit.

    Attributes
    ----------
    verdict : "fit", "not fit" or "error".
    limits : "passed", "failed", "undecided", or empty without limits.
    reasons : sentences: why it is not accepted.
    parameters : name, value, standard uncertainty, unit, as the calibration has them.
    vector : to compare units by; None where it cannot be.
    noise : of a sample at rest, raw, by triad.
    hashes : SHA-256 of the recordings.
    unchanged : an earlier result still holds; the rest is then empty.
    calibration, report : texts of the files.
    """

    unit: str
    files: list[str]
    key: str
    verdict: str
    limits: str = ""
    reasons: list[str] = field(default_factory=list[str])
    more: dict[str, str] = field(default_factory=dict[str, str])
    temperature: float | None = None
    parameters: list[tuple[str, float, float, str]] = field(
        default_factory=list[tuple[str, float, float, str]]
    )
    vector: UnitVector | None = None
    noise: dict[str, list[float]] = field(default_factory=dict[str, list[float]])
    hashes: list[str] = field(default_factory=list[str])
    unchanged: bool = False
    calibration: str | None = None
    report: str | None = None

    @property
    def accepted(self) -> bool:
        """Whether the calibration is fit for use, and within limits if there are any."""
        return self.verdict == "fit" and self.limits in ("", "passed")


@dataclass
class Batch:
    """A batch that is done.

    Attributes
    ----------
    units : outcomes in the order of the source.
    stand_out : sentences on units that are not as the others, by the unit's name.
    shared : sentences on what units that are not accepted or stand out have in common.
    remarks : other sentences on the batch.
    worked, kept : units that were calibrated, and whose earlier results still held.
    """

    units: list[UnitOutcome]
    stand_out: dict[str, list[str]]
    shared: list[str]
    remarks: list[str]
    worked: int = 0
    kept: int = 0
    files: list[Path] = field(default_factory=list[Path])

    @property
    def accepted(self) -> int:
        """How many units are fit for use, and within limits if there are any."""
        return sum(unit.accepted for unit in self.units)

    def reasons(self, unit: UnitOutcome) -> list[str]:
        """Return everything that is said of a unit.

        Parameters
        ----------
        unit : of the batch.
        """
        return [*unit.reasons, *self.stand_out.get(unit.unit, [])]
