"""What a calibration's report is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

from tumble.arrays import Vector, Vectors
from tumble.calibration import Estimate, describe_direction
from tumble.document import Calibration
from tumble.protocol import Protocol
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.report.parameters import ParameterRow, parameter_rows
from tumble.segmentation import HoldMeans, Matching, Timeline


def pose_words(up: Vector) -> str:
    """Return what points up in words, with minus signs at which no line breaks."""
    return describe_direction(up).replace("-", "−")


@dataclass(frozen=True)
class Subject:
    """A calibration with what the procedure made, what it was made from, and what of that a reader sees.

    Attributes
    ----------
    calibration, estimate : the result, and what the procedure made.
    recording, timeline, means : what it was made from.
    protocol, matching : what was to be done, and which hold and spin is which step, if it was given.
    predicted : standard uncertainties that a plan predicted, by name, SI.
    """

    calibration: Calibration
    estimate: Estimate
    recording: Recording
    timeline: Timeline
    means: HoldMeans
    protocol: Protocol | None = None
    matching: Matching | None = None
    predicted: Mapping[str, float] = field(default_factory=dict[str, float])

    @cached_property
    def rows(self) -> list[ParameterRow]:
        """The parameters for people, in the calibration's order."""
        return parameter_rows(self.calibration)

    @cached_property
    def up_b(self) -> Vectors | None:
        """(holds, 3) m/s², the corrected specific force of each hold, which points up."""
        if self.means.specific_force is None or self.estimate.model.accelerometer is None:
            return None
        return self.estimate.model.accelerometer.correct(self.means.specific_force)

    @cached_property
    def poses(self) -> list[str]:
        """What points up in each hold, in words; empty where it is not known."""
        return [] if self.up_b is None else [pose_words(up) for up in self.up_b]

    @cached_property
    def holds_left_out(self) -> set[int]:
        """Indices of the holds without part in the estimate."""
        return {left.index for left in self.estimate.left_out if left.kind == "hold"}
