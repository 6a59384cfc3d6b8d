"""A recording of the second simulator through the whole of tumble, as a user has it: a table and a protocol file."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import tumble
from tumble.document import Calibration

from .procedures import PROCEDURES
from .recording import Place, Simulation
from .sensors import GRADES

TRIADS = ("accelerometer", "gyroscope")


def played(procedure, grade, seed, fault=None, *, place=None, **options) -> Simulation:
    """Play a test on a unit of a grade, at a place or at one of chance."""
    kind = GRADES[grade] if isinstance(grade, str) else grade
    with pytest.MonkeyPatch.context() as patch:
        if place is not None:
            patch.setattr(Place, "draw", lambda *_: place)
        return PROCEDURES[procedure](kind, np.random.default_rng(seed), fault, **options)


def calibrated(made: Simulation, *, by_protocol: bool = True, **options: Any) -> Calibration:
    """Calibrate a recording by its protocol file, or by where it was alone."""
    frame = pl.DataFrame(made.columns())
    if not by_protocol:
        site = tumble.Site.from_latitude(made.place.stated_latitude, made.place.height)
        return tumble.calibrate(frame, **{"site": site, **options}).calibration
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "protocol.yaml"
        file.write_text(made.protocol, encoding="utf-8")
        return tumble.calibrate(frame, protocol=file, **options).calibration


def sigmas_off(found: Calibration, made: Simulation, term: str) -> np.ndarray:
    """Return by how many of its standard uncertainties each entry of a term is off the truth."""
    triad, _, block = term.partition(".")
    true = made.truth.terms(found.frame.name)[term]
    value = np.array(getattr(getattr(found, triad), block))
    names = [f"{term}[{','.join(map(str, index))}]" for index in np.ndindex(value.shape)]
    at = [found.covariance_parameters.index(name) for name in names]
    return (value - true).ravel() / np.sqrt(np.diag(np.array(found.covariance))[at])


@dataclass(frozen=True)
class Missed:
    """By how much a calibration misses the truth, by its own statement.

    `z` are errors over their standard uncertainties; `square` is their sum by the whole covariance, of `degrees`; what
    the frame fixes has none. `inside` is the share of parameters whose stated interval holds the truth.
    """

    z: np.ndarray
    square: float
    degrees: int
    inside: float


def missed(found: Calibration, made: Simulation) -> Missed:
    """Return by how much all unknowns are off the truth, at the temperature that they are stated for."""
    terms, thermal = made.truth.terms(found.frame.name), made.truth.thermal
    if thermal is not None:
        celsius = found.temperature_celsius
        growth = np.split(1 + (celsius - thermal.reference) * thermal.scale, 2)
        for triad, change, grown in zip(
            TRIADS, np.split(thermal.bias_change(celsius), 2), growth, strict=True
        ):
            terms[f"{triad}.bias"] = terms[f"{triad}.bias"] + change
            terms[f"{triad}.matrix"] = terms[f"{triad}.matrix"] * grown[:, None]
        terms["gyroscope.g_sensitivity"] = terms["gyroscope.g_sensitivity"] * growth[1][:, None]
    off, sigma = list[float](), np.sqrt(np.diag(np.array(found.covariance)))
    for name in found.covariance_parameters:
        term, _, index = name.rstrip("]").partition("[")
        triad, _, block = term.partition(".")
        at = tuple(int(i) for i in index.split(","))
        off.append(float(np.array(getattr(getattr(found, triad), block))[at] - terms[term][at]))
    free = sigma > 1e-9 * np.max(sigma)
    z = np.array(off)[free] / sigma[free]
    correlation = np.array(found.covariance)[np.ix_(free, free)] / np.outer(sigma[free], sigma[free])
    values, vectors = np.linalg.eigh(correlation)
    kept = values > 1e-7
    turned = vectors.T @ z
    factors = np.array([p.coverage_factor or 1.96 for p in found.parameters])
    inside = float(np.mean(np.abs(z) < np.median(factors)))
    return Missed(z, float(np.sum(turned[kept] ** 2 / values[kept])), int(np.count_nonzero(kept)), inside)
