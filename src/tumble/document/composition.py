"""From an estimate to the document that is written: judged, with provenance and test vectors."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from tumble.calibration import (
    Budget,
    Estimate,
    FieldVerdict,
    Judgement,
    Magnetometer,
    judge,
    judge_magnetometer,
)
from tumble.document import magnetometer_block as field_parts, result
from tumble.document.entries import entry_names, vector_of_model
from tumble.document.imported import test_vectors
from tumble.document.part import finite, part_of, row_of, rows_of
from tumble.document.soundness import covariance_fault, not_finite
from tumble.document.thermal_block import thermal_block
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, __version__
from tumble.files import shown
from tumble.recording import MagneticField, Recording, mean_celsius
from tumble.sensor import FRAMES, Triad
from tumble.units import COUNTS, angular_rate_factor

FRAME_WORDS = {
    **FRAMES,
    "fixture": (
        "the axes of the fixture (or table) that the unit was placed with. The nominal poses of the "
        "protocol are exact in it on average. Each sensor's misalignment is against these axes"
    ),
    field_parts.FIELD_ALONE: (
        "the magnetometer's own axes, made orthogonal: nothing determines how they lie against the other sensors'"
    ),
}


def calibration_from_estimate(
    estimate: Estimate,
    recording: Recording,
    site: Site,
    *,
    created: datetime | None = None,
    remarks: tuple[str, ...] = (),
    imu: tuple[str | None, str | None] = (None, None),
    confirm_scale: bool = False,
    why_alone: str = "",
) -> result.Calibration:
    """Return the document of an estimate, judged and with test vectors.

    Parameters
    ----------
    estimate, recording, site : what was found, in what, and where.
    created, imu : when, and (model, serial number) of the unit.
    remarks : beside the estimate's.
    confirm_scale : the user knows that the scale factors are beyond what units have.
    why_alone : of a magnetometer by itself, why nothing else is calibrated.

    Raises
    ------
    ConvergenceError
        If a number of the estimate is not finite, or its covariance can be none.
    """
    _refuse_unsound(estimate)
    if why_alone:
        judgement = _judged_alone(estimate, site, why_alone)
    else:
        judgement = judge(estimate, recording, confirm_scale=confirm_scale)
    units = recording.specific_force_unit or COUNTS, recording.angular_rate_unit or COUNTS
    changes, field = estimate.thermal, estimate.shown(Magnetometer)
    thermal = changes and thermal_block(changes.model, changes.model.names, changes.covariance)
    temperature = mean_celsius(recording.temperature) if thermal is None else thermal.basis.reference_celsius
    model = estimate.model
    known = any(name.startswith("gyroscope.matrix") for name in estimate.names)
    nominal = angular_rate_factor(units[1]) is not None
    gyroscope = None
    if model.gyroscope is not None:
        gyroscope = result.TriadBlock.of(model.gyroscope, model.g_sensitivity, has_matrix=known or nominal)
    return result.Calibration(
        created=(created or datetime.now(UTC)).isoformat(timespec="seconds"),
        software=f"tumble {__version__}",
        imu=result.Imu(model=name_of(imu[0]), serial_number=name_of(imu[1])),
        procedure=estimate.procedure,
        recordings=[part_of(result.RecordingName, source) for source in recording.sources],
        site=site_block(site),
        temperature_celsius=temperature,
        frame=result.FrameBlock(name=estimate.frame, description=FRAME_WORDS[estimate.frame]),
        not_determined=list(estimate.not_determined),
        raw_units=result.RawUnits(specific_force=units[0], angular_rate=units[1]),
        accelerometer=None if model.accelerometer is None else result.TriadBlock.of(model.accelerometer),
        gyroscope=gyroscope,
        parameters=[
            part_of(result.ParameterBlock, p, coverage_factor=factor)
            for p, factor in zip(estimate.parameters, _factors(estimate), strict=True)
        ],
        covariance_parameters=list(estimate.names),
        covariance=(0.5 * (estimate.covariance + estimate.covariance.T)).tolist(),
        quality=_quality(estimate),
        verdict=result.VerdictBlock(fit=judgement.fit, reasons=judgement.reasons),
        remarks=[*estimate.remarks, *remarks],
        test_vectors=test_vectors(model if known or nominal else replace(model, gyroscope=None), units),
        thermal=thermal,
        lever_arms=None if estimate.lever_arms is None else rows_of(estimate.lever_arms),
        magnetometer=field
        and block_of_magnetometer(field, judge_magnetometer(field, site.latitude), recording.magnetic_field),
    )


def _judged_alone(estimate: Estimate, site: Site, why: str) -> Judgement:
    """Judge a magnetometer by itself, and say that the rest is not determined."""
    field = estimate.shown(Magnetometer)
    assert field is not None
    own = judge_magnetometer(field, site.latitude)
    lacking = "Accelerometers and gyros: the recording has no holds that would determine them."
    estimate.say("not determined", lacking)
    alone = f"Only the magnetometer is calibrated. {why} The gyros' biases are not determined either."
    return Judgement(own.fit, [alone, *own.reasons])


def _refuse_unsound(estimate: Estimate) -> None:
    """Refuse an estimate that no document may hold, before a word of it is judged."""
    fault = not_finite("the model", vector_of_model(estimate.model), entry_names())
    fault = fault or covariance_fault(estimate.covariance, estimate.names)
    if estimate.lever_arms is not None:
        fault = fault or not_finite("the lever arms", estimate.lever_arms)
    for named in estimate.parameters:
        fault = fault or not_finite(named.name, np.array([named.value, named.standard_uncertainty]))
    if estimate.thermal is not None:
        fault = fault or covariance_fault(estimate.thermal.covariance, estimate.thermal.model.names)
    if fault:
        raise ConvergenceError(
            f"The adjustment came to no usable numbers: {fault}. What was recorded determines too "
            "little of some parameters, or contradicts itself: record more poses and longer holds."
        )


def _factors(estimate: Estimate) -> list[float | None]:
    """Return each parameter's own coverage factor, None where the procedure tells no degrees of freedom of its own."""
    budget = estimate.shown(Budget)
    told = None if budget is None else budget.statement
    if told is None or len(told.coverage_factors) != len(estimate.parameters):
        return [None for _ in estimate.parameters]
    return [float(factor) for factor in told.coverage_factors]


def site_block(site: Site) -> result.SiteBlock:
    """Return where a recording was made, as a document has it.

    Parameters
    ----------
    site : as it was given, or assumed.
    """
    return result.SiteBlock(
        latitude_deg=None if site.latitude is None else float(np.degrees(site.latitude)),
        height_m=site.height,
        gravity=site.gravity,
        gravity_standard_uncertainty=site.gravity_sigma,
        gravity_source=site.source,
        earth_rate=EARTH_RATE,
    )


def _quality(estimate: Estimate) -> result.QualityBlock:
    # a turn that was left out is no measure of the others
    out = [left.index for left in estimate.left_out if left.kind == "turn"]
    angles = estimate.turns.angles
    turns = angles[np.isfinite(angles) & ~np.isin(np.arange(angles.size), out)]
    return part_of(
        result.QualityBlock,
        estimate,
        sigma0_with_variance_components=finite(estimate.sigma0_final),
        largest_normalised_residual=estimate.largest_normalised,
        rms_hold_norm=float(np.sqrt(np.mean(estimate.holds.norms**2))) if estimate.holds.norms.size else None,
        rms_turn_angle=float(np.sqrt(np.mean(turns**2))) if turns.size else None,
        holds=int(estimate.holds.norms.size),
        turns=estimate.turns.found.size,
        spins=int(estimate.spins.rates.size),
        left_out=[part_of(result.LeftOutBlock, left, number=left.index + 1) for left in estimate.left_out],
        optional_terms=[
            part_of(result.TermBlock, t, f_statistic=t.statistic, degrees_of_freedom=t.degrees)
            for t in estimate.terms
        ],
        unseen=[
            part_of(
                result.UnseenBlock,
                one,
                relative_standard_uncertainty=one.sigma,
                nominal_rate_hz=one.nominal_rate,
            )
            for one in estimate.unseen
        ],
    )


def name_of(text: str | None) -> str | None:
    """Return a name as a document may hold it."""
    return None if text is None else shown(text)


def block_of_magnetometer(
    made: Magnetometer, verdict: FieldVerdict, recorded: MagneticField | None = None
) -> field_parts.MagnetometerBlock:
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
    return field_parts.MagnetometerBlock(
        raw_unit=made.raw_unit,
        unit="T" if made.field_unit == "T" else "local field",
        frame=field_parts.OWN_FRAME if made.frame == field_parts.OWN_FRAME else "b",
        method=made.method,
        matrix=None if triad is None else rows_of(triad.matrix),
        bias=None if triad is None else row_of(triad.bias),
        parameters=[part_of(field_parts.FieldParameter, p) for p in (made.parameters if found else ())],
        covariance_parameters=list(made.names) if written else [],
        covariance=(0.5 * (made.covariance + made.covariance.T)).tolist() if written else [],
        field=field_parts.FieldBlock(
            norm=made.norm,
            norm_standard_uncertainty=made.norm_sigma,
            norm_given=made.norm_known,
            source=source,
            dip_deg=finite(np.degrees(made.dip)),
            dip_standard_uncertainty_deg=finite(np.degrees(made.dip_sigma)),
        )
        if found
        else None,
        quality=_field_quality(made),
        verdict=field_parts.FieldVerdictBlock(use=verdict.use, reasons=list(verdict.reasons)),
        not_determined=list(made.not_determined),
        remarks=list(verdict.remarks),
        turn=None if recorded is None or recorded.turn is None else rows_of(recorded.turn),
        test_vectors=[] if triad is None else _field_vectors(triad, made.norm),
    )


def _field_quality(made: Magnetometer) -> field_parts.FieldQuality:
    return part_of(
        field_parts.FieldQuality,
        made,
        norm_scatter_before=finite(made.before),
        norm_scatter_after=finite(made.after),
        holds=[
            part_of(field_parts.FieldHoldBlock, h, number=h.hold + 1, dip_deg=float(np.degrees(h.dip)))
            for h in made.holds
        ],
        left_out=[f"Hold {o.index + 1}: {o.reason}." for o in made.left_out],
    )


def _field_vectors(triad: Triad, norm: float) -> list[field_parts.FieldVector]:
    """Round raw numbers and what they become."""
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [-0.36, 0.48, 0.8]])
    raw = triad.distort(norm * directions)
    raw = np.round(raw, 3 - int(np.floor(np.log10(np.max(np.abs(raw))))))
    return [
        field_parts.FieldVector(raw_magnetic_field=row_of(one), magnetic_field=row_of(true))
        for one, true in zip(raw, triad.correct(raw), strict=True)
    ]
