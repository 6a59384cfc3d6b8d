"""The magnetometer of a calibration file: its triad with covariance, the field it was found in, and its own verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from tumble.arrays import Matrix
from tumble.document.part import DocumentPart, Row, Rows, finite, part_of, row_of, rows_of
from tumble.parameters.family import parameter_of
from tumble.sensor import Triad
from tumble.units import magnetic_field_factor

if TYPE_CHECKING:
    from tumble.calibration.magnetometer.estimate import Magnetometer
    from tumble.calibration.magnetometer.verdict import FieldVerdict
    from tumble.recording.samples import MagneticField

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

    def contradiction(self) -> str | None:
        """Return what in the block contradicts itself, in words that begin with the key, or None."""
        from tumble.document.soundness import is_invertible, stated_covariance_fault
        from tumble.errors import TumbleError

        try:
            magnetic_field_factor(self.raw_unit)
        except TumbleError as error:
            return f"magnetometer.raw_unit: {str(error).rstrip('.')}"
        if fault := stated_covariance_fault(self.covariance, self.covariance_parameters):
            return f"magnetometer.covariance: {fault}"
        triad = self.triad
        if triad is None:
            return None
        if not is_invertible(triad.matrix):
            return "magnetometer.matrix: it cannot be inverted"
        for number, one in enumerate(self.test_vectors, 1):
            found = triad.correct(np.array([one.raw_magnetic_field]))[0]
            told = np.array(one.magnetic_field)
            if not np.all(np.abs(found - told) <= 1e-6 * float(np.linalg.norm(told)) + 1e-300):
                return f"magnetometer.test_vectors: number {number} contradicts its matrix and bias"
        return None


def magnetometer_block(
    made: Magnetometer, verdict: FieldVerdict, recorded: MagneticField | None = None
) -> MagnetometerBlock:
    """Return the block of a magnetometer's calibration, without matrix and bias where it is not fit for use.

    Parameters
    ----------
    made, verdict : what was found, and how it is judged.
    recorded : with the turn that an autopilot makes of its own.
    """
    triad = made.triad if verdict.fit else None
    found, written = made.triad is not None, triad is not None
    given = made.given
    source = (
        given.source
        if given is not None
        else "the magnetometer's own mean scale"
        if made.field_unit == "T"
        else "none"
    )
    return MagnetometerBlock(
        raw_unit=made.raw_unit,
        unit="T" if made.field_unit == "T" else "local field",
        frame=OWN_FRAME if made.frame == OWN_FRAME else "b",
        method=made.method,
        matrix=None if triad is None else rows_of(triad.matrix),
        bias=None if triad is None else row_of(triad.bias),
        parameters=[part_of(FieldParameter, p) for p in (made.parameters if found else ())],
        covariance_parameters=list(made.names) if written else [],
        covariance=(0.5 * (made.covariance + made.covariance.T)).tolist() if written else [],
        field=FieldBlock(
            norm=made.norm,
            norm_standard_uncertainty=made.norm_sigma,
            norm_given=made.norm_known,
            source=source,
            dip_deg=finite(np.degrees(made.dip)),
            dip_standard_uncertainty_deg=finite(np.degrees(made.dip_sigma)),
        )
        if found
        else None,
        quality=_quality(made),
        verdict=FieldVerdictBlock(use=verdict.use, reasons=list(verdict.reasons)),
        not_determined=list(made.not_determined),
        remarks=list(verdict.remarks),
        turn=None if recorded is None or recorded.turn is None else rows_of(recorded.turn),
        test_vectors=[] if triad is None else _vectors(triad, made.norm),
    )


def _quality(made: Magnetometer) -> FieldQuality:
    return part_of(
        FieldQuality,
        made,
        norm_scatter_before=finite(made.before),
        norm_scatter_after=finite(made.after),
        holds=[
            part_of(FieldHoldBlock, h, number=h.hold + 1, dip_deg=float(np.degrees(h.dip)))
            for h in made.holds
        ],
        left_out=[f"Hold {o.index + 1}: {o.reason}." for o in made.left_out],
    )


def _vectors(triad: Triad, norm: float) -> list[FieldVector]:
    """Round raw numbers and what they become."""
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [-0.36, 0.48, 0.8]])
    raw = triad.distort(norm * directions)
    raw = np.round(raw, 3 - int(np.floor(np.log10(np.max(np.abs(raw))))))
    return [
        FieldVector(raw_magnetic_field=row_of(one), magnetic_field=row_of(true))
        for one, true in zip(raw, triad.correct(raw), strict=True)
    ]
