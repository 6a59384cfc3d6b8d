"""A recording of the second simulator through the whole of tumble, as a user has it: a table and a protocol file."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

import tumble
from tumble.document import Calibration

from .procedures import PROCEDURES
from .recording import Simulation
from .sensors import GRADES, Grade


def played(
    procedure: str, grade: str | Grade, seed: int, fault: str | None = None, **options: Any
) -> Simulation:
    """Play a test on a unit of a grade.

    Parameters
    ----------
    procedure, grade, seed, fault : which test, unit and chance, and what is wrong.
    options : of the test.
    """
    kind = GRADES[grade] if isinstance(grade, str) else grade
    return PROCEDURES[procedure](kind, np.random.default_rng(seed), fault, **options)


def calibrated(made: Simulation, *, by_protocol: bool = True, **options: Any) -> Calibration:
    """Calibrate a recording by its protocol file, or by where it was alone.

    Parameters
    ----------
    made, by_protocol : the recording; whether what was done is told.
    options : of `tumble.calibrate`.
    """
    frame = pl.DataFrame(made.columns())
    if not by_protocol:
        site = tumble.Site.from_latitude(made.place.stated_latitude, made.place.height)
        return tumble.calibrate(frame, **{"site": site, **options}).calibration
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "protocol.yaml"
        file.write_text(made.protocol, encoding="utf-8")
        return tumble.calibrate(frame, protocol=file, **options).calibration


def sigmas_off(found: Calibration, made: Simulation, term: str) -> np.ndarray:
    """Return by how many of its standard uncertainties each entry of a term is off the truth.

    Parameters
    ----------
    found, made : the calibration and the recording that it is of.
    term : such as ``gyroscope.bias``.
    """
    triad, _, block = term.partition(".")
    true = made.truth.terms(found.frame.name)[term]
    value = np.array(getattr(getattr(found, triad), block))
    names = [f"{term}[{','.join(map(str, index))}]" for index in np.ndindex(value.shape)]
    at = [found.covariance_parameters.index(name) for name in names]
    return (value - true).ravel() / np.sqrt(np.diag(np.array(found.covariance))[at])
