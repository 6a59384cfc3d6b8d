"""Recordings of the second simulator with white noise alone, and how far an estimate is off its own statement."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from scipy.special import chdtri

import tumble
from second_simulator import GRADES, Grade, Simulation
from second_simulator.sensors import TriadSheet
from tumble.calibration import Estimate, Session
from tumble.protocol import read_protocol

FALSE_ALARM = 1e-4


def white(*, asymmetry: bool) -> Grade:
    """Tactical, with neither flicker nor walk, warm-up, temperature or steps of the output."""

    def alone(sheet: TriadSheet) -> TriadSheet:
        own = sheet.asymmetry if asymmetry else 0.0
        return replace(
            sheet,
            flicker=0.0,
            walk=0.0,
            warm_up=0.0,
            per_kelvin=0.0,
            scale_per_kelvin=0.0,
            step=1e-9,
            asymmetry=own,
        )

    grade = GRADES["tactical"]
    return replace(grade, accelerometer=alone(grade.accelerometer), gyroscope=alone(grade.gyroscope))


def session_of(made: Simulation) -> Session:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "protocol.yaml"
        file.write_text(made.protocol, encoding="utf-8")
        return Session(tumble.read_recording(pl.DataFrame(made.columns())), read_protocol(file))


def square_sum(estimate: Estimate, made: Simulation) -> tuple[float, int]:
    """The error by its own covariance, and the rank of this: what the frame fixes has none."""
    true, error = made.truth.terms(estimate.frame), []
    for name in estimate.names:
        term, _, index = name.rstrip("]").partition("[")
        triad, _, block = term.partition(".")
        at = tuple(int(i) for i in index.split(","))
        error.append(getattr(getattr(estimate.model, triad), block)[at] - true[term][at])
    sigma = np.sqrt(np.diag(estimate.covariance))
    free = sigma > 1e-9 * np.max(sigma)
    values, vectors = np.linalg.eigh(
        estimate.covariance[np.ix_(free, free)] / np.outer(sigma[free], sigma[free])
    )
    kept = values > 1e-7
    turned = vectors.T @ (np.array(error)[free] / sigma[free])
    return float(np.sum(turned[kept] ** 2 / values[kept])), int(np.count_nonzero(kept))


def assert_within_statement(found: list[tuple[float, int]]) -> None:
    """The sum over all runs is that of chi-square; a right method fails once in ten thousand."""
    total, degrees = (float(sum(column)) for column in zip(*found, strict=True))
    assert chdtri(degrees, 1.0 - FALSE_ALARM / 2) < total < chdtri(degrees, FALSE_ALARM / 2)
