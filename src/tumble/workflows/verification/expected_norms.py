"""What a hold's corrected norm is expected to be off by: the calibration's uncertainty, noise and gravity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tumble.arrays import Matrices, Series, Square, Table, Vectors
from tumble.document import Calibration
from tumble.document.corrector import Corrector
from tumble.earth import Site
from tumble.recording import Recording
from tumble.recording.formats.frames import Frame
from tumble.recording.temperature import TemperatureColumn
from tumble.records import dataclass
from tumble.segmentation import Timeline
from tumble.sensor import Triad
from tumble.workflows.apply import corrected_block
from tumble.workflows.corrected.corrections import (
    about_temperature,
    check_column,
    check_temperature,
    needs_temperature,
    recorded_span,
)


@dataclass(frozen=True, slots=True)
class HoldConditions:
    """What each hold was at: the sensor's temperature (°C), its rate (K/s) and hysteresis state, (holds,)."""

    temperature: Series
    rate: Series
    hysteresis: Series


def corrected_whole(
    document: Calibration,
    scaled: Recording,
    files: Sequence[Path | Frame],
    temperature: float | None,
) -> tuple[Recording, list[str]]:
    """Return the recording corrected sample by sample, and remarks.

    Parameters
    ----------
    scaled : in the calibration's raw units.
    temperature : °C of all of it, instead of a column.

    Raises
    ------
    UsageError, RecordingError
        If there is no temperature, or it is not in degrees Celsius.
    ThermalSpanError
        If it leaves the calibrated span.
    """
    told: list[str] = []
    if needs_temperature(document):
        check_temperature(document, scaled, files, temperature, "refuse")
        if temperature is None and scaled.temperature is not None:
            column = TemperatureColumn()
            column.add(scaled.time, scaled.temperature)
            told = check_column(column)
    corrector = Corrector(document, "refuse")
    corrected = corrected_block(corrector, scaled, temperature)
    return corrected, [*told, *about_temperature(document, corrector, recorded_span(scaled, temperature))]


def conditions(
    document: Calibration, recording: Recording, timeline: Timeline, temperature: float | None
) -> HoldConditions | None:
    """Return the mean conditions of each hold, None for a calibration without a thermal model."""
    thermal = document.thermal_model
    if thermal is None:
        return None
    celsius = recording.temperature if temperature is None else np.full(len(recording), temperature)
    assert celsius is not None
    path = thermal.path(recording.time, celsius)
    holds = [slice(hold.start, hold.stop) for hold in timeline.holds]

    def means(series: Series) -> Series:
        return np.array([float(series[hold].mean()) for hold in holds])

    return HoldConditions(means(path.temperature), means(path.rate), means(path.hysteresis))


def hold_noise(triad: Triad, means: Vectors, covariances: Matrices) -> Series:
    """Return (holds,) the variance of each corrected norm from the noise of the hold's mean, (m/s²)²."""
    force = triad.correct(means)
    weight = force / np.linalg.norm(force, axis=1, keepdims=True) @ np.linalg.inv(triad.matrix)
    return np.asarray(np.einsum("ka,kab,kb->k", weight, covariances, weight), dtype=np.float64)


def norm_covariance(
    document: Calibration, force: Vectors, noise: Series, place: Site, at: HoldConditions | None
) -> Square:
    """Return (holds, holds) the norms' covariance: calibration and gravity are common, hold noise and wander not.

    Gravity's uncertainty is in the calibration's. It cancels where the same gravity is taken for both.

    The norm's derivative by matrix entry (i, j) is -w_i f_j and by bias -w_i, with w = inv(M)' f / norm(f); a
    coefficient of temperature multiplies it by its function there.

    Parameters
    ----------
    force : (holds, 3) corrected means, m/s².
    noise : (holds,) from `hold_noise`.
    at : conditions of the holds, for a thermal calibration.
    """
    joint = document.thermal is not None and any(
        "[" in n and n.count(".") < 2 for n in _thermal_names(document)
    )
    covariance = np.diag(noise)
    weight = _weights(document, force, at)
    own = document.site.gravity_standard_uncertainty
    same_gravity = abs(place.gravity - document.site.gravity) <= 1e-9
    if not joint:
        names = document.covariance_parameters
        by_parameter = _by_parameter(names, weight, force, None, at)
        covariance += by_parameter @ document.covariance_matrix @ by_parameter.T
        if same_gravity:
            # the scale factors went with this gravity, and so do the norms
            covariance -= min(own**2, float(np.min(np.diag(covariance) - noise)))
    if document.thermal is not None:
        thermal = document.thermal_model
        assert thermal is not None
        assert at is not None
        functions = thermal.basis.values(at.temperature)
        by_parameter = _by_parameter(_thermal_names(document), weight, force, functions, at)
        thermal_covariance = np.array(document.thermal.covariance, dtype=float)
        if thermal_covariance.size:
            covariance += by_parameter @ thermal_covariance @ by_parameter.T
    for name, value in document.quality.variance_components.items():
        if name.startswith("accelerometer"):
            covariance += value**2 * np.eye(len(noise))
    if not same_gravity:
        covariance += place.gravity_sigma**2
    return covariance


def _thermal_names(document: Calibration) -> list[str]:
    return [] if document.thermal is None else document.thermal.covariance_parameters


def _weights(document: Calibration, force: Vectors, at: HoldConditions | None) -> Vectors:
    """Return (holds, 3) the derivative of each norm by the raw output, at the hold's own temperature."""
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    thermal = document.thermal_model
    weights = np.empty_like(unit)
    for k in range(unit.shape[0]):
        model = document.model if thermal is None or at is None else thermal.at(float(at.temperature[k]))
        assert model.accelerometer is not None
        weights[k] = unit[k] @ np.linalg.inv(model.accelerometer.matrix)
    return weights


def _by_parameter(
    names: Sequence[str], weight: Vectors, force: Vectors, functions: Table | None, at: HoldConditions | None
) -> Table:
    """Return (holds, parameters) derivatives of the norm; of what is not the accelerometer's they are zero."""
    table = np.zeros((force.shape[0], len(names)))
    for column, name in enumerate(names):
        if not name.startswith(("accelerometer.matrix", "accelerometer.bias")) or "[" not in name:
            continue
        place = [int(digit) for digit in name[name.index("[") + 1 : -1].split(",")]
        factor = np.ones(force.shape[0])
        if ".temperature[" in name and functions is not None:
            factor = functions[:, place.pop(0)]
        elif ".rate[" in name and at is not None:
            factor = at.rate
        elif ".hysteresis[" in name and at is not None:
            factor = at.hysteresis
        slope = -weight[:, place[0]] * factor
        table[:, column] = slope * force[:, place[1]] if name.startswith("accelerometer.matrix") else slope
    return table
