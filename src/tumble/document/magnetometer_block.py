"""The magnetometer of a calibration file: its triad with covariance, the field it was found in, and its own verdict."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from tumble.arrays import Matrix
from tumble.document.part import DocumentPart, Row, Rows, row_of, rows_of
from tumble.parameters import parameter_of
from tumble.sensor import Triad

FORMULA = (
    "raw = matrix * true + bias; true = inverse(matrix) * (raw - bias), in `unit` and along the axes of `frame`; the "
    "bias is the hard iron, the matrix holds soft iron, scale factors, non-orthogonality and the rotation to frame b"
)
OWN_FRAME = "magnetometer"
"""Frame of a magnetometer of which nothing tells how it lies against the other triads."""
FIELD_ALONE = OWN_FRAME
"""Procedure and frame of a document that has a magnetometer and no other triad."""


class FieldParameter(DocumentPart):
    """One parameter with its standard uncertainty."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str


class FieldBlock(DocumentPart):
    """The magnetic field of the place: norm in the block's unit, dip in degrees, down positive."""

    norm: float
    norm_standard_uncertainty: float
    norm_given: bool
    source: str
    dip_deg: float | None = None
    dip_standard_uncertainty_deg: float | None = None


class FieldHoldBlock(DocumentPart):
    """The corrected field of a hold (numbered from 1)."""

    number: int
    norm: float
    dip_deg: float
    left_out: bool = False


class FieldQuality(DocumentPart):
    """How well the field fits; shares of its norm, one sigma.

    `scatter` is by what it differs from hold to hold beyond noise, `uncertainty` what a corrected field is off by for
    the calibration's sake, `norm_scatter_before` and `norm_scatter_after` are of all samples.
    """

    scatter: float
    uncertainty: float
    norm_scatter_before: float | None = None
    norm_scatter_after: float | None = None
    degrees_of_freedom: int
    coverage_factor: float
    holds: list[FieldHoldBlock] = msgspec.field(default_factory=list[FieldHoldBlock])
    left_out: list[str] = msgspec.field(default_factory=list[str])


class FieldVerdictBlock(DocumentPart):
    """How the magnetometer may be used, and why, in sentences."""

    use: Literal["fit", "fit with reservations", "not fit"]
    reasons: list[str]


class FieldVector(DocumentPart):
    """Raw in, corrected out."""

    raw_magnetic_field: Row
    magnetic_field: Row


class MagnetometerBlock(DocumentPart):
    """The magnetometer: `matrix` raw units per `unit` (rows), `bias` raw units; None where it is not fit for use.

    Without a matrix, `parameters` and `field` still say what was found: nothing is corrected by them.

    Attributes
    ----------
    unit : of the corrected field: "T", or "local field" where nobody knows the norm: then the norm is one.
    frame : "b" for the frame of the calibration, or "magnetometer" where nothing tells how the axes lie against it.
    method : "holds and turns", "holds", "ellipsoid" (the magnetometer alone), or "imported".
    turn : rotation from the raw axes to the accelerometers' that the autopilot makes by parameters of its own.
    input_corrected_by : identities of an autopilot's own parameters that its numbers were corrected by already, in a
        file from when these were not undone on reading.
    """

    raw_unit: str
    unit: Literal["T", "local field"]
    frame: Literal["b", "magnetometer"]
    method: str
    formula: str = FORMULA
    matrix: Rows | None
    bias: Row | None
    parameters: list[FieldParameter] = msgspec.field(default_factory=list[FieldParameter])
    covariance_parameters: list[str] = msgspec.field(default_factory=list[str])
    covariance: list[list[float]] = msgspec.field(default_factory=list[list[float]])
    field: FieldBlock | None = None
    quality: FieldQuality | None = None
    verdict: FieldVerdictBlock | None = None
    not_determined: list[str] = msgspec.field(default_factory=list[str])
    remarks: list[str] = msgspec.field(default_factory=list[str])
    turn: Rows | None = None
    input_corrected_by: list[str] = msgspec.field(default_factory=list[str])
    test_vectors: list[FieldVector] = msgspec.field(default_factory=list[FieldVector])

    @property
    def unfit(self) -> bool:
        """Whether its own verdict is against the use of it."""
        return self.verdict is not None and self.verdict.use == "not fit"

    @property
    def reasons_against(self) -> list[str]:
        """Why it is not fit for use; none where it is."""
        if self.verdict is None or not self.unfit:
            return []
        return [f"The magnetometer is not fit for use. {self.verdict.reasons[0]}"]

    @property
    def triad(self) -> Triad | None:
        """What corrects; None where it is not determined, or not fit for use."""
        if self.matrix is None or self.bias is None or self.unfit:
            return None
        return Triad(np.array(self.matrix, dtype=float), np.array(self.bias, dtype=float))

    def turned(self, C_new_b: Matrix) -> MagnetometerBlock:
        """Return the same magnetometer along the axes of another frame: ``true_new = C_new_b @ true_b``.

        Parameters
        ----------
        C_new_b : (3, 3) rotation.
        """
        if self.frame == OWN_FRAME:
            return self
        # The rotation against b is another one; bias and soft iron are the sensor's own.
        own = [p for p in self.parameters if parameter_of(p.name).family.kind != "rotation"]
        if self.matrix is None:
            return replace(self, parameters=own)
        matrix = np.array(self.matrix) @ C_new_b.T
        covariance = self.covariance
        if covariance:
            by = np.zeros((12, 12))
            by[:9, :9] = np.kron(np.eye(3), C_new_b)
            by[9:, 9:] = np.eye(3)
            covariance = (by @ np.array(covariance) @ by.T).tolist()
        triad = Triad(matrix, np.array(self.bias, dtype=float))
        vectors = [
            FieldVector(
                raw_magnetic_field=one.raw_magnetic_field,
                magnetic_field=row_of(triad.correct(np.array([one.raw_magnetic_field]))[0]),
            )
            for one in self.test_vectors
        ]
        return replace(
            self, matrix=rows_of(matrix), covariance=covariance, parameters=own, test_vectors=vectors
        )
