"""A document from a bare sensor model: another program's calibration, or one that was computed from others."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

import tumble
from tumble.document.result import (
    Calibration,
    FrameBlock,
    QualityBlock,
    RawUnits,
    RecordingName,
    SiteBlock,
    TestVector,
    TriadBlock,
    VerdictBlock,
)
from tumble.document.thermal_block import thermal_block
from tumble.earth import EARTH_RATE
from tumble.sensor import ImuModel
from tumble.sensor.thermal import ThermalModel
from tumble.units import STANDARD_GRAVITY, angular_rate_factor, specific_force_factor

NO_QUALITY = QualityBlock(
    sigma0=None,
    sigma0_with_variance_components=None,
    degrees_of_freedom=0,
    largest_normalised_residual=0.0,
    coverage_factor=1.96,
    rms_hold_norm=None,
    rms_turn_angle=None,
    holds=0,
    turns=0,
    variance_components={},
    left_out=[],
    optional_terms=[],
)


def calibration_from_model(
    model: ImuModel,
    units: tuple[str, str],
    frame: tuple[str, str],
    sources: list[RecordingName],
    *,
    procedure: str,
    remarks: list[str],
    thermal: ThermalModel | None = None,
) -> Calibration:
    """Return a document without uncertainties, which says so.

    Parameters
    ----------
    model, units : the sensors and their raw units.
    frame : name and words.
    sources : the files it is from.
    procedure : who made it, as ``imported from Kalibr``.
    remarks : sentences.
    thermal : how the model changes with temperature, over a finite span, or None.
    """
    accelerometer, gyroscope = triad_blocks(model)
    return Calibration(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software=f"tumble {tumble.__version__}",
        procedure=procedure,
        recordings=sources,
        site=SiteBlock(
            gravity=STANDARD_GRAVITY,
            gravity_standard_uncertainty=0.015,
            gravity_source="not known: the standard value, with a spread for anywhere on Earth",
            earth_rate=EARTH_RATE,
        ),
        frame=FrameBlock(name=frame[0], description=frame[1]),
        not_determined=["uncertainties: the source holds none, so that this document has none either"],
        raw_units=RawUnits(specific_force=units[0], angular_rate=units[1]),
        accelerometer=accelerometer,
        gyroscope=gyroscope,
        parameters=[],
        covariance_parameters=[],
        covariance=[],
        quality=NO_QUALITY,
        verdict=VerdictBlock(
            fit=False,
            reasons=[
                "It was not made by tumble, which has not seen its recordings: judge it with `tumble verify`."
            ],
        ),
        remarks=remarks,
        test_vectors=test_vectors(model, units),
        temperature_celsius=None if thermal is None else thermal.basis.reference_celsius,
        thermal=None if thermal is None else thermal_block(thermal, [], np.zeros((0, 0))),
    )


def triad_blocks(model: ImuModel) -> tuple[TriadBlock | None, TriadBlock | None]:
    """Return the blocks of both triads; one that the model lacks is None."""
    force, rate = model.accelerometer, model.gyroscope
    return (
        None if force is None else TriadBlock.of(force),
        None if rate is None else TriadBlock.of(rate, model.g_sensitivity),
    )


def test_vectors(model: ImuModel, units: tuple[str, str]) -> list[TestVector]:
    """Return three raw samples, round numbers, and what they become."""
    true_force = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [3.0, -4.0, 5.0]])
    true_rate = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, -0.1], [0.3, -0.4, 0.5]])
    raw_force = raw_rate = force = rate = None
    if model.accelerometer is not None:
        raw_force = _round(model.accelerometer.distort(true_force), specific_force_factor(units[0]) is None)
        force = model.accelerometer.correct(raw_force)
    if model.gyroscope is not None and (model.g_sensitivity is None or force is not None):
        raw_rate = _round(model.gyroscope.distort(true_rate), angular_rate_factor(units[1]) is None)
        seen = raw_rate
        if model.g_sensitivity is not None and force is not None:
            seen = raw_rate - force @ model.g_sensitivity.T
        rate = model.gyroscope.correct(seen)
    return TestVector.of(raw_force, raw_rate, force, rate)


def _round(values: np.ndarray, whole: bool) -> np.ndarray:
    """Return whole counts, or numbers of four digits."""
    return np.round(values) if whole else np.array([[float(f"{v:.4g}") for v in line] for line in values])
