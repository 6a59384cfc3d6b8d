"""`Calibration`: the result as one self-describing, versioned document (``calibration.json``)."""

from __future__ import annotations

import hashlib
import json
import os
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from tumble.arrays import Matrix, Series, Square, Vectors
from tumble.calibration import TurnOns
from tumble.document.corrector import Corrector
from tumble.document.magnetometer_block import MagnetometerBlock
from tumble.document.part import DocumentPart, Row, Rows, part_of, plain, row_of, rows_of, spelled
from tumble.document.thermal_block import ThermalBlock
from tumble.errors import CalibrationFileError
from tumble.files import notebook_html, write_text
from tumble.parameters import Measure, parameter_of, said
from tumble.sensor import CURVES, ImuModel, Outside, ThermalModel, Triad
from tumble.units import angular_rate_factor, specific_force_factor

if TYPE_CHECKING:
    from collections.abc import Sequence


Each = list[float | None]


class TurnOnBlock(DocumentPart, rename=spelled(rate="rate_hz")):
    """One recording; `variance_components` are standard deviations, SI."""

    name: str
    holds: int
    turns: int
    spins: int
    seconds: float
    rate: float
    sigma0: float | None
    variance_components: dict[str, float]


class BiasBlock(DocumentPart, rename=spelled(measurement="expected_scatter", turn_on="turn_on_scatter")):
    """A bias from turn-on to turn-on, raw units; lists have an entry for each recording, null where it has none.

    `scatter` is the standard deviation of the recordings' biases, `expected_scatter` what their own uncertainties
    make of it, `turn_on_scatter` what is left without these. `next_standard_uncertainty` is that of `mean` as the bias
    of the next turn-on, to be taken with `coverage_factor`. `probability` is that of such differences by chance, were
    the bias the same each time.
    """

    parameter: str
    unit: str
    values: Each
    sigmas: Each
    mean: float
    mean_sigma: float
    scatter: float
    scatter_sigma: float
    measurement: float
    turn_on: float
    next_sigma: float
    coverage_factor: float
    degrees: int
    chi_square: float
    probability: float


class StableBlock(DocumentPart, rename=spelled(enlarged="enlarged_by")):
    """A parameter that all recordings share, as each determines it by itself; null where one does not tell it.

    It agrees if the `probability` of such differences by chance is not below `limit`; if it does not, its standard
    uncertainty is `enlarged_by` this factor in the list of parameters.
    """

    parameter: str
    unit: str
    values: Each
    sigmas: Each
    value: float
    chi_square: float
    degrees: int
    probability: float
    limit: float
    agrees: bool
    enlarged: float


class TurnOnsBlock(DocumentPart, rename=spelled(agreements="stable")):
    """What several recordings of one unit tell: chi-square of all stable parameters together, and each by itself."""

    recordings: list[TurnOnBlock]
    biases: list[BiasBlock]
    agreements: list[StableBlock]
    chi_square: float
    degrees: int
    probability: float


def turn_ons_block(told: TurnOns) -> TurnOnsBlock:
    """Return the block of what several recordings told.

    Parameters
    ----------
    told : see there.
    """
    return part_of(TurnOnsBlock, told)


FORMAT = "tumble calibration"
VERSION = 1
FORWARD = (
    "raw = u + asymmetry * |u| + quadratic * u^2 + g_sensitivity * f + bias, u = matrix * true; "
    "true in m/s^2 and rad/s in frame b, f the true specific force in b (gyroscope only); "
    "asymmetry and quadratic act element by element; a term that is absent is zero"
)
BACKWARD = (
    "true = inverse(matrix) * u with u the solution of u + asymmetry * |u| + quadratic * u^2 = "
    "raw - bias - g_sensitivity * f; without optional terms: true = inverse(matrix) * (raw - bias). "
    "Correct the accelerometer first: the gyroscope's g_sensitivity acts on its corrected f. "
    "At rest the specific force points up: f = -gravity"
)
# What a thermal block corrects by, without words, covariance and test vectors.
_THERMAL_NUMBERS = (
    *("basis", "coefficients", "rate_coefficients", "hysteresis", "hysteresis_width", "lag", "smoothing"),
    *("dead_band", "start_hysteresis"),
)
_FIELD_NUMBERS = ("raw_unit", "unit", "frame", "matrix", "bias")


class Imu(DocumentPart):
    """Which unit was calibrated."""

    model: str | None = None
    serial_number: str | None = None
    sensor_index: int | None = None


class RecordingName(DocumentPart):
    """A recording that the calibration was made from; of a bag with the topic that has both triads."""

    name: str
    sha256: str
    topic: str | None = None


class SiteBlock(DocumentPart):
    """Where the recording was made; gravity in m/s², Earth rate in rad/s."""

    latitude_deg: float | None = None
    height_m: float | None = None
    gravity: float
    gravity_standard_uncertainty: float
    gravity_source: str
    earth_rate: float


class FrameBlock(DocumentPart):
    """The gauge of body frame b, by name and in words."""

    name: str
    description: str


class RawUnits(DocumentPart):
    """Units of the raw numbers that the calibration takes."""

    specific_force: str
    angular_rate: str

    @property
    def factors(self) -> tuple[float | None, float | None]:
        """SI per raw unit of both; None of counts."""
        return specific_force_factor(self.specific_force), angular_rate_factor(self.angular_rate)


class TriadBlock(DocumentPart):
    """One triad: `matrix` raw units per SI unit (rows), `bias` raw units. A missing matrix is unknown."""

    matrix: Rows | None
    bias: Row
    asymmetry: Row | None = None
    quadratic: Row | None = None
    g_sensitivity: Rows | None = None

    @staticmethod
    def of(triad: Triad, g_sensitivity: Matrix | None = None, *, has_matrix: bool = True) -> TriadBlock:
        """Return the block of a triad.

        Parameters
        ----------
        triad, g_sensitivity : what corrects it; the latter of gyros alone.
        has_matrix : its matrix is known.
        """
        return TriadBlock(
            matrix=rows_of(triad.matrix) if has_matrix else None,
            bias=row_of(triad.bias),
            g_sensitivity=None if g_sensitivity is None else rows_of(g_sensitivity),
            **{name: row_of(size) for name, _, size in triad.curves()},
        )

    @property
    def triad(self) -> Triad | None:
        """The triad; None without a matrix."""
        if self.matrix is None:
            return None
        given = {name: getattr(self, name) for name in CURVES}
        curves = {name: np.array(size, dtype=float) for name, size in given.items() if size is not None}
        return Triad(np.array(self.matrix, dtype=float), np.array(self.bias, dtype=float), **curves)


class ParameterBlock(DocumentPart):
    """One parameter in the procedure's own convention; without a coverage factor the quality's holds."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str
    coverage_factor: float | None = None


class LeftOutBlock(DocumentPart):
    """A hold, turn or spin (numbered from 1) without part in the estimate."""

    kind: Literal["hold", "turn", "spin"]
    number: int
    reason: str


class TermBlock(DocumentPart):
    """The test of an optional term against chance."""

    name: str
    kept: bool
    f_statistic: float
    degrees_of_freedom: int
    probability: float
    limit: float


class UnseenBlock(DocumentPart):
    """What all gyro scale factors follow alike and no residual shows; it is in the covariance."""

    source: str
    relative_standard_uncertainty: float
    because: str
    nominal_rate_hz: float | None = None


class QualityBlock(DocumentPart):
    """How well the data fit, and what was left out."""

    sigma0: float | None
    sigma0_with_variance_components: float | None
    degrees_of_freedom: int
    largest_normalised_residual: float
    coverage_factor: float
    rms_hold_norm: float | None
    rms_turn_angle: float | None
    holds: int
    turns: int
    spins: int = 0
    variance_components: dict[str, float]
    left_out: list[LeftOutBlock]
    optional_terms: list[TermBlock]
    unseen: list[UnseenBlock] = msgspec.field(default_factory=list[UnseenBlock])


Decision = Literal["passed", "failed", "undecided"]
Rule = Literal["simple", "guarded", "risk"]


class LimitBlock(DocumentPart):
    """One parameter against its limits, all in the parameter's own unit.

    `lower`, `upper` : null where that side is free. `largest_uncertainty` : of the expanded uncertainty (k = 2), or
    null. `probability` : that the true value is within the limits, null without an uncertainty.
    """

    name: str
    value: float | None
    standard_uncertainty: float | None
    unit: str
    lower: float | None
    upper: float | None
    largest_uncertainty: float | None = None
    probability: float | None
    decision: Decision
    reason: str


class LimitsBlock(DocumentPart):
    """All limits of one file together: passed only where each of them is.

    `risk` : largest probability of a wrong acceptance or rejection, of the rule "risk" only.
    """

    name: str
    sha256: str
    rule: Rule
    risk: float | None = None
    decision: Decision
    reasons: list[str]
    parameters: list[LimitBlock]


class VerdictBlock(DocumentPart):
    """Whether the calibration is fit for use, and why, in sentences."""

    fit: bool
    reasons: list[str]


class TestVector(DocumentPart):
    """Raw in, corrected out: m/s² and rad/s in frame b; null for a triad that is not calibrated."""

    raw_specific_force: Row | None = None
    raw_angular_rate: Row | None = None
    specific_force: Row | None = None
    angular_rate: Row | None = None

    @staticmethod
    def of(
        raw_force: Vectors | None, raw_rate: Vectors | None, force: Vectors | None, rate: Vectors | None
    ) -> list[TestVector]:
        """Return one for each of some samples (samples, 3); a triad that is not calibrated is None."""
        given = {
            "raw_specific_force": raw_force,
            "raw_angular_rate": raw_rate,
            "specific_force": force,
            "angular_rate": rate,
        }
        known = {name: values for name, values in given.items() if values is not None}
        count = max(map(len, known.values()), default=0)
        return [
            TestVector(**{name: row_of(values[i]) for name, values in known.items()}) for i in range(count)
        ]


class Calibration(DocumentPart):
    """A calibration of one IMU, with everything needed to apply and to judge it.

    Attributes
    ----------
    accelerometer, gyroscope : what `model` is made of; a triad that was not calibrated is None.
    parameters : in the procedure's own convention, with standard uncertainties.
    covariance, covariance_parameters : over the entries of matrices and biases, in their units.
    limits : how it stands to acceptance limits, if it was held against any; the verdict says whether to trust it.
    temperature_celsius : that the triads hold at; with a `thermal` block its reference temperature.
    notes : what people noted by name: operator, place, instrument, remarks, and whatever else.
    thermal : how the triads change with temperature, or None.
    lever_arms : m, where each accelerometer sits in frame b, a row each, from one point of the unit; None where they
        are taken to be at one place. `correct` takes out what they feel while the unit turns.
    magnetometer : the magnetometer with its own verdict, or None; `correct_field` corrects with it.
    turn_ons : what several recordings of the unit tell, if it was made from several turn-ons, or None.
    input_corrected_by : identities of the calibrations that its raw numbers were corrected by already, first
        one first: it is right for such recordings only.
    """

    format: Literal["tumble calibration"] = FORMAT
    version: int = VERSION
    created: str
    software: str
    imu: Imu = Imu()
    notes: dict[str, str] = msgspec.field(default_factory=dict[str, str])
    procedure: str
    recordings: list[RecordingName]
    site: SiteBlock
    temperature_celsius: float | None = None
    frame: FrameBlock
    not_determined: list[str]
    raw_units: RawUnits
    formula: str = FORWARD
    inverse_formula: str = BACKWARD
    accelerometer: TriadBlock | None
    gyroscope: TriadBlock | None = None
    parameters: list[ParameterBlock]
    covariance_parameters: list[str]
    covariance: list[list[float]]
    quality: QualityBlock
    verdict: VerdictBlock
    limits: LimitsBlock | None = None
    remarks: list[str] = msgspec.field(default_factory=list[str])
    test_vectors: list[TestVector]
    thermal: ThermalBlock | None = None
    lever_arms: Rows | None = None
    magnetometer: MagnetometerBlock | None = None
    turn_ons: TurnOnsBlock | None = None
    input_corrected_by: list[str] = msgspec.field(default_factory=list[str])

    @property
    def identity(self) -> str:
        """Twelve hexadecimal digits of what it corrects by: equal numbers, equal identity.

        The numbers of the triads, their temperature dependence, the raw units and the frame count; date,
        covariance and words do not.
        """
        whole = plain(self)
        told = {key: whole[key] for key in ("accelerometer", "gyroscope", "raw_units", "thermal")}
        told["frame"] = self.frame.name
        if self.lever_arms is not None:
            told["lever_arms"] = self.lever_arms
        if self.magnetometer is not None:
            told["magnetometer"] = {key: whole["magnetometer"][key] for key in _FIELD_NUMBERS}
        if told["thermal"] is not None:
            told["thermal"] = {key: told["thermal"][key] for key in _THERMAL_NUMBERS}
            told["thermal"]["basis"].pop("formula")
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:12]

    @property
    def every_parameter(self) -> list[ParameterBlock]:
        """Its parameters, and those of its magnetometer where that is fit for use."""
        field = self.magnetometer
        named = [] if field is None or field.triad is None else field.parameters
        return [*self.parameters, *(ParameterBlock(**plain(one)) for one in named)]

    @property
    def thermal_model(self) -> ThermalModel | None:
        """The sensor model with what changes with temperature, None without a `thermal` block.

        Raises
        ------
        CalibrationFileError
            If the document has no matrix of either triad.
        """
        return None if self.thermal is None else self.thermal.model(self.model)

    @property
    def model(self) -> ImuModel:
        """The sensor model; a triad whose matrix is not known is None in it.

        With a `thermal` block it is the unit at the reference temperature.

        Raises
        ------
        CalibrationFileError
            If the document has no matrix of either triad.
        """
        accelerometer = None if self.accelerometer is None else self.accelerometer.triad
        gyroscope = None if self.gyroscope is None else self.gyroscope.triad
        magnetometer = None if self.magnetometer is None else self.magnetometer.triad
        if accelerometer is None and gyroscope is None and magnetometer is None:
            raise CalibrationFileError("The calibration has no matrix of any triad: it cannot be applied.")
        sensitivity = None if self.gyroscope is None else self.gyroscope.g_sensitivity
        return ImuModel(
            accelerometer,
            gyroscope,
            None if sensitivity is None else np.array(sensitivity),
            magnetometer,
        )

    @property
    def covariance_matrix(self) -> Square:
        """(n, n) covariance over `covariance_parameters`; (0, 0) where the document states no uncertainties."""
        size = len(self.covariance_parameters)
        return np.array(self.covariance, dtype=float).reshape(size, size)

    def corrector(self, outside: Outside = "refuse") -> Corrector:
        """Return what corrects consecutive blocks of a recording, at the recording's start.

        Raises
        ------
        CalibrationFileError
            If the document has no matrix of either triad.
        """
        return Corrector(self.model, self.thermal_model, self.lever_arms, outside)

    def correct(
        self,
        raw_specific_force: Vectors | None,
        raw_angular_rate: Vectors | None = None,
        time: Series | None = None,
        temperature_celsius: Series | float | None = None,
        *,
        outside: Outside = "refuse",
    ) -> tuple[Vectors | None, Vectors | None]:
        """Return corrected specific force (m/s²) and angular rate (rad/s), (samples, 3) in frame b.

        The part of a triad that is not calibrated, or has no raw numbers, is None.

        Parameters
        ----------
        raw_specific_force, raw_angular_rate : (samples, 3) in `raw_units`.
        time : (samples,) s; a calibration with a thermal block needs it wherever the temperature changes, and one with
            lever arms for the angular acceleration.
        temperature_celsius : (samples,) as recorded, or one for all; needed by a thermal block.
        outside : what to do beyond the calibrated temperatures: ``refuse``, ``hold`` or ``extrapolate``.

        Raises
        ------
        CalibrationFileError
            If the document has no matrix of either triad, or the gyro's g-sensitivity is to be taken
            out and there is no corrected specific force.
        UsageError
            If it has a thermal block and there is no temperature, or lever arms and there is no time.
        ThermalSpanError
            If the temperature leaves the calibrated span and `outside` is ``refuse``.
        ValueError
            If a matrix is singular.
        """
        return self.corrector(outside).correct(
            raw_specific_force, raw_angular_rate, time, temperature_celsius
        )

    def correct_field(self, raw_magnetic_field: Vectors) -> Vectors | None:
        """Return the corrected magnetic field (samples, 3) in the magnetometer's `unit`; None without a magnetometer.

        Parameters
        ----------
        raw_magnetic_field : (samples, 3) in the magnetometer's raw unit.
        """
        block = self.magnetometer
        if block is None or block.triad is None:
            return None
        return block.triad.correct(np.asarray(raw_magnetic_field, dtype=float))

    def __repr__(self) -> str:
        verdict = "fit for use" if self.verdict.fit else "NOT fit for use"
        unit = " ".join(part for part in (self.imu.model, self.imu.serial_number) if part)
        of = f" of {unit}" if unit else ""
        return f"<Calibration{of}: {verdict}; {self.procedure}, {len(self.parameters)} parameters>"

    __str__ = __repr__

    def to_frame(self) -> Any:
        """Return the parameters as a data frame of polars: name, value, standard uncertainty, unit.

        `to_frame().to_pandas()` is pandas'.
        """
        from tumble.recording import data_frame

        return data_frame(
            {
                "parameter": [p.name for p in self.parameters],
                "value": [p.value for p in self.parameters],
                "standard_uncertainty": [p.standard_uncertainty for p in self.parameters],
                "unit": [p.unit for p in self.parameters],
            }
        )

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return calibration_html(self)

    def to_json(self) -> str:
        """Return the document as JSON text, numbers with all their digits."""
        return json.dumps(plain(self), indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the document beside `path`, then rename it there: never half a file.

        Raises
        ------
        OutputError
            If the folder cannot be written to.
        """
        write_text(Path(path), self.to_json())


def calibration_of(text: str) -> Calibration:
    """Return the calibration of a document's text that tumble wrote.

    Raises
    ------
    msgspec.DecodeError
        If it is damaged.
    """
    return msgspec.json.decode(text, type=Calibration)


def calibration_html(calibration: Calibration, reason: str = "", files: Sequence[Path] = ()) -> str:
    """Return a heading with the verdict, and a table of the parameters.

    Parameters
    ----------
    calibration : any; parameters in its own procedure's convention.
    reason : why its procedure was chosen.
    files : that were written of it.
    """
    verdict = "fit for use" if calibration.verdict.fit else "NOT fit for use"
    unit = " ".join(part for part in (calibration.imu.model, calibration.imu.serial_number) if part)
    parameters, measures = calibration.parameters, list[Measure]()
    for _, members in groupby(parameters, key=lambda p: parameter_of(p.name).family):
        measures += said([Measure(p.value, p.standard_uncertainty, p.unit) for p in members])
    sources = ", ".join(recording.name for recording in calibration.recordings)
    return notebook_html(
        ("parameter", "value ± standard uncertainty", "unit"),
        [(p.name, one.number, one.unit) for p, one in zip(parameters, measures, strict=True)],
        title=f"Calibration{f' of {unit}' if unit else ''}: {verdict}",
        words=f"({calibration.procedure}; {sources})",
        notes=[*([reason] if reason else []), *calibration.verdict.reasons],
        foot=f"Frame: {calibration.frame.description}"
        + (f" Written: {', '.join(map(str, files))}." if files else ""),
    )
