"""The magnetic field of a recording that is corrected, block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.document import Calibration
from tumble.errors import UsageError
from tumble.recording import Recording
from tumble.recording.magnetic_field import MagneticField
from tumble.units import COUNTS, magnetic_field_factor

_MICROTESLA = 1e-6


def corrects_field(document: Calibration, recording: Recording) -> bool:
    """Return whether a calibration corrects the magnetometer of a recording.

    Parameters
    ----------
    document, recording : as read.
    """
    block = document.stages[0].magnetometer
    return recording.magnetic_field is not None and block is not None and block.triad is not None


@dataclass(frozen=True, slots=True)
class CorrectedField:
    """How the magnetometer's samples are corrected: in µT, or in units of the local field.

    Attributes
    ----------
    document : what corrects; None where nothing is written of a magnetometer.
    raw : factor of the recording's unit to the calibration's.
    unit : of what is written.
    factor : from the calibration's unit to that.
    remarks : what is to be known of it.
    """

    document: Calibration | None
    raw: float = 1.0
    unit: str = COUNTS
    factor: float = 1.0
    remarks: tuple[str, ...] = ()

    @staticmethod
    def of(document: Calibration, recording: Recording, form: str) -> CorrectedField:
        """Return how a recording's magnetometer is corrected.

        Parameters
        ----------
        document, recording : what corrects, and the first block.
        form : of the file that is written; only a table has columns for it.

        Raises
        ------
        UsageError
            If one is in counts and the other is not.
        """
        field = recording.magnetic_field
        if field is None or form == "bag":
            return CorrectedField(None)
        if not corrects_field(document, recording):
            block = document.stages[0].magnetometer
            why = (
                "The calibration's magnetometer is not fit for use"
                if block is not None
                else "The calibration has no magnetometer"
            )
            return CorrectedField(None, remarks=(f"{why}: the corrected file has no magnetic field.",))
        if form != "table":
            return CorrectedField(
                None, remarks=("The magnetic field is written to tables (.csv, .parquet) only.",)
            )
        first, last = document.stages[0].magnetometer, document.stages[-1].magnetometer
        assert first is not None
        ours, theirs = magnetic_field_factor(field.unit), magnetic_field_factor(first.raw_unit)
        if (ours is None) != (theirs is None):
            raise UsageError(
                f"The recording's magnetic field is in {field.unit}, and the calibration is for {first.raw_unit}: "
                "declare the recording's units with --units, or use the calibration of this unit and format."
            )
        raw = 1.0 if ours is None or theirs is None else ours / theirs
        if last is not None and last.unit == "T":
            return CorrectedField(document, raw, "uT", 1.0 / _MICROTESLA)
        said = (
            "The corrected magnetic field is in units of the local field: its norm was not given (--field)."
        )
        return CorrectedField(document, raw, remarks=(said,))

    def of_block(self, block: Recording) -> MagneticField | None:
        """Return the corrected samples of a block; none at all are an empty array, so that blocks have one form.

        Parameters
        ----------
        block : as read.
        """
        if self.document is None:
            return None
        field = block.magnetic_field
        if field is None:
            return MagneticField(np.zeros(0), np.zeros((0, 3)), self.unit)
        corrected = self.document.correct_field(self.raw * field.values)
        assert corrected is not None
        return MagneticField(field.time, np.ascontiguousarray(self.factor * corrected), self.unit)
