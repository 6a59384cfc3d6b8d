"""A document from a bare sensor model: another program's calibration, or one that was computed from others."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from tumble.arrays import Vectors
from tumble.document import result
from tumble.document.corrector import corrected
from tumble.document.thermal_block import thermal_block
from tumble.earth import EARTH_RATE
from tumble.errors import __version__
from tumble.sensor import ImuModel, ThermalModel, Triad
from tumble.units import STANDARD_GRAVITY, angular_rate_factor, specific_force_factor

NO_QUALITY = result.QualityBlock(
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
    sources: list[result.RecordingName],
    *,
    procedure: str,
    remarks: list[str],
    thermal: ThermalModel | None = None,
) -> result.Calibration:
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
    return result.Calibration(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software=f"tumble {__version__}",
        procedure=procedure,
        recordings=sources,
        site=result.SiteBlock(
            gravity=STANDARD_GRAVITY,
            gravity_standard_uncertainty=0.015,
            gravity_source="not known: the standard value, with a spread for anywhere on Earth",
            earth_rate=EARTH_RATE,
        ),
        frame=result.FrameBlock(name=frame[0], description=frame[1]),
        not_determined=["uncertainties: the source holds none, so that this document has none either"],
        raw_units=result.RawUnits(specific_force=units[0], angular_rate=units[1]),
        accelerometer=accelerometer,
        gyroscope=gyroscope,
        parameters=[],
        covariance_parameters=[],
        covariance=[],
        quality=NO_QUALITY,
        verdict=result.VerdictBlock(
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


def triad_blocks(model: ImuModel) -> tuple[result.TriadBlock | None, result.TriadBlock | None]:
    """Return the blocks of both triads; one that the model lacks is None."""
    force, rate = model.accelerometer, model.gyroscope
    return (
        None if force is None else result.TriadBlock.of(force),
        None if rate is None else result.TriadBlock.of(rate, model.g_sensitivity),
    )


def test_vectors(model: ImuModel, units: tuple[str, str]) -> list[result.TestVector]:
    """Return round raw numbers for about three true samples, and what they become.

    Parameters
    ----------
    model, units : the sensors and their raw units.
    """
    true_force = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [3.0, -4.0, 5.0]])
    true_rate = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, -0.1], [0.3, -0.4, 0.5]])
    raw_force = _raw_numbers(model.accelerometer, true_force, specific_force_factor(units[0]))
    raw_rate = _raw_numbers(model.gyroscope, true_rate, angular_rate_factor(units[1]))
    return result.TestVector.of(raw_force, raw_rate, *corrected(model, raw_force, raw_rate))


def _raw_numbers(triad: Triad | None, true: Vectors, factor: float | None) -> Vectors | None:
    """Return raw numbers for about these true ones; of counts whole ones about the bias."""
    if triad is None:
        return None
    if factor is not None:
        return true * (1.0 / factor)
    return np.round(triad.bias + true * np.abs(np.diag(triad.matrix)))
