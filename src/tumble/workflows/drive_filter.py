"""The filter that judges drives and predicts: its states, and its noise from a data sheet, a document, the drive."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.navigation import FilterSetup, TriadSpread, plan_filter
from tumble.noise.terms import NoiseModel
from tumble.simulation.grades import Grade, TriadGrade
from tumble.workflows.calibration_parts import CorrectedBy, scatter

# A minute shows a bias by its walk: K is the bias instability over the root of this, s.
_WANDER = 100.0


def drive_filter(
    part: CorrectedBy,
    grade: Grade,
    noise: str | os.PathLike[str] | None,
    lever_arm_b: Series,
) -> tuple[FilterSetup, list[str]]:
    """Return the filter that all variants share, and words on it.

    Parameters
    ----------
    part : the samples by the whole calibration.
    grade : the data sheet.
    noise : what `tumble noise` wrote, or None for the data sheet's.
    lever_arm_b : (3,) m.

    Raises
    ------
    UsageError
        If the noise document is none, or of counts.
    """
    forces, rates = ([sheet_noise(triad)] * 3 for triad in (grade.accelerometer, grade.gyroscope))
    source = f"the data sheet's ({grade.name})"
    if noise is not None:
        forces, rates = noise_of_document(noise)
        source = f"those in {Path(noise).name}"
    interval = part.samples.interval
    shaken = [scatter(x, interval) for x in (part.samples.specific_force_b, part.samples.angular_rate_ib_b)]
    forces, rates = (
        (_louder(m[0], float(f[0])), _louder(m[1], float(f[1])), _louder(m[2], float(f[2])))
        for m, f in ((forces, shaken[0]), (rates, shaken[1]))
    )
    sheet = [
        TriadSpread(t.bias, t.scale_factor, misalignment=float(np.hypot(t.misalignment, t.alignment)))
        for t in (grade.accelerometer, grade.gyroscope)
    ]
    setup = plan_filter(forces, rates, accelerometer=sheet[0], gyroscope=sheet[1], lever_arm_b=lever_arm_b)
    words = [
        (
            f"One filter of {9 + len(setup.states)} states for all variants: the same clock, fixes at 1 Hz, lever "
            f"arm and noise. White noise and bias walks are {source}, white noise no less than the drive's own scatter "
            "from sample to sample."
        ),
        (
            "Sensor states start with the calibration's covariance where a variant uses it, and with the data sheet's "
            f"spread ({grade.name}) where not."
        ),
    ]
    return setup, words


def noise_of_document(noise: str | os.PathLike[str]) -> tuple[list[NoiseModel], list[NoiseModel]]:
    """Return the models of `noise.json` for each triad in SI.

    Parameters
    ----------
    noise : what `tumble noise` wrote.

    Raises
    ------
    UsageError
        If it is no such document, or of counts.
    """
    from tumble.workflows.noise_models import read_noise_models

    models = read_noise_models(noise)
    triads: list[list[NoiseModel]] = []
    for letter in "ag":
        found = [models.channels.get(f"{letter}{axis}") for axis in "xyz"]
        if any(one is None or one[0] == "counts" for one in found):
            raise UsageError(
                f"--noise {models.source} has not all six channels in SI, which a filter takes: run `tumble noise` "
                "with --units."
            )
        triads.append([one[1] for one in found if one is not None])
    return triads[0], triads[1]


def sheet_noise(triad: TriadGrade) -> NoiseModel:
    """Return the noise of a data sheet as a model.

    Parameters
    ----------
    triad : of the sheet.
    """
    own = triad.noise
    return NoiseModel(
        random_walk=own.random_walk,
        bias_instability=own.bias_instability,
        rate_random_walk=own.rate_random_walk,
    )


def _louder(model: NoiseModel, floor: float) -> NoiseModel:
    """White noise no less than the drive's own, and a bias walk for an instability."""
    walk = max(model.rate_random_walk, model.bias_instability / np.sqrt(_WANDER))
    return NoiseModel(random_walk=max(model.random_walk, floor), rate_random_walk=float(walk))
