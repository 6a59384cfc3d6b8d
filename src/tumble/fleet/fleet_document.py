"""A fleet as a document: the mean unit, with the spread between units as its covariance, for the next unit's prior.

x_i = μ + b_i + e_i with e_i of the known covariance C_i of unit i's calibration, and b_i of the covariance B between
units, found by restricted maximum likelihood (EM; Laird and Ware 1982, *Biometrics* 38, 963).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from tumble.arrays import Series, Square, Table, inverted
from tumble.document import (
    PLACES,
    Calibration,
    TriadBlock,
    VerdictBlock,
    entry_names,
    model_of_vector,
    named_parameters,
    row_of,
    rows_of,
    stacked,
    turned_to,
)
from tumble.errors import UsageError, __version__
from tumble.fleet.unit_vector import FRAME, HELD, UnitVector
from tumble.records import dataclass
from tumble.sensor import FRAMES, ImuModel, Triad

PROCEDURE = "fleet"
_TERMS = ("accelerometer.matrix", "accelerometer.bias", "gyroscope.matrix", "gyroscope.bias")


def fleet_document(calibrations: Sequence[Calibration]) -> tuple[Calibration, Between]:
    """Return the mean unit of calibrations, and how they differ.

    The document's covariance is that of a next unit about the mean: between units, and of the mean.

    Parameters
    ----------
    calibrations : one a unit, with both triads in the same raw units.

    Raises
    ------
    UsageError
        If there are too few that can be compared.
    """
    chosen = _comparable(calibrations)
    pairs = [stacked(one) for one in chosen]
    names = entry_names()
    places = [k for term in _TERMS for k in range(PLACES[term][0].start, PLACES[term][0].stop)]
    at = [k for k in places if all(spread[k, k] > HELD for _, spread in pairs)]
    between = between_units(
        np.array([values[at] for values, _ in pairs]),
        np.array([spread[np.ix_(at, at)] for _, spread in pairs]),
    )
    # With those that the frame holds, whose variance is zero.
    common = set[str].intersection(*(set(one.covariance_parameters) for one in chosen))
    told = [k for k in places if names[k] in common]
    like = chosen[0].model
    values = pairs[0][0].copy()
    for term in PLACES:
        if term not in _TERMS:
            values[PLACES[term][0]] = 0.0
    values[at] = between.mean
    spread = np.zeros((len(values), len(values)))
    spread[np.ix_(at, at)] = between.predictive
    plain = ImuModel(_plain(like.accelerometer), _plain(like.gyroscope), None)
    model = model_of_vector(values, plain)
    words = (
        f"This is the mean of {between.count} units with the spread between them, a prior for the next unit: it is no "
        "unit's calibration."
    )
    document = replace(
        chosen[0],
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software=f"tumble {__version__}",
        imu=replace(chosen[0].imu, serial_number=None, sensor_index=None),
        procedure=PROCEDURE,
        recordings=[],
        temperature_celsius=None,
        accelerometer=_block(model.accelerometer),
        gyroscope=_block(model.gyroscope),
        parameters=named_parameters(model, spread, chosen[0].raw_units),
        covariance_parameters=[names[k] for k in told],
        covariance=spread[np.ix_(told, told)].tolist(),
        verdict=VerdictBlock(fit=False, reasons=[words]),
        limits=None,
        remarks=[words],
        not_determined=[],
        test_vectors=[],
        thermal=None,
        lever_arms=None,
        magnetometer=None,
        turn_ons=None,
    )
    return document, between


def _comparable(calibrations: Sequence[Calibration]) -> list[Calibration]:
    """Those in one frame, in the raw units of most and with the triads of most."""
    chosen = [
        turned_to(one, FRAME) if one.frame.name != FRAME else one
        for one in calibrations
        if one.frame.name in FRAMES and one.covariance_parameters
    ]
    kinds = [(str(one.raw_units), bool(one.gyroscope and one.gyroscope.matrix)) for one in chosen]
    usual = max(Counter(kinds).items(), key=lambda item: item[1], default=(None, 0))[0]
    chosen = [one for one, kind in zip(chosen, kinds, strict=True) if kind == usual]
    if len(chosen) < FEWEST:
        raise UsageError(
            f"{len(chosen)} calibrations with a covariance, in the same raw units, can be compared: a fleet takes "
            f"{FEWEST} units or more."
        )
    return chosen


def _plain(triad: Triad | None) -> Triad | None:
    return None if triad is None else Triad(triad.matrix, triad.bias)


def _block(triad: Triad | None) -> TriadBlock | None:
    if triad is None:
        return None
    return TriadBlock(matrix=rows_of(triad.matrix), bias=row_of(triad.bias))


FEWEST = 5
"""Units that it takes to say how they differ."""
_ROUNDS = 400
_SETTLED = 1e-5


@dataclass(frozen=True)
class Between:
    """Mean and spread of units.

    Attributes
    ----------
    mean, mean_covariance : (p,), (p, p).
    covariance : (p, p) between units.
    spread_sigma : (p,) standard uncertainty of the standard deviations between units.
    count : of units.
    """

    mean: Series
    mean_covariance: Square
    covariance: Square
    spread_sigma: Series
    count: int

    @property
    def spread(self) -> Series:
        """(p,) standard deviations between units."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def predictive(self) -> Square:
        """(p, p) covariance of a next unit about `mean`, as wide as so few units know it.

        Correlations are drawn towards none as far as chance makes such ones (Schäfer and Strimmer 2005, *Stat. Appl.
        Genet. Mol. Biol.* 4, 32): those of few units would claim to know one parameter by the others. Variances are
        those of Student's t, which a next unit follows.
        """
        freedom = self.count - 1.0
        sigma = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        correlation = self.covariance / np.outer(sigma, sigma)
        apart = ~np.eye(sigma.size, dtype=bool)
        squares = float(np.sum(correlation[apart] ** 2))
        by_chance = float(np.sum((1.0 - correlation[apart] ** 2) ** 2)) / freedom
        kept = 1.0 - min(1.0, by_chance / squares) if squares > 0.0 else 1.0
        shrunk = np.where(apart, kept * self.covariance, self.covariance)
        return freedom / (freedom - 2.0) * shrunk + self.mean_covariance


def between_units(values: Table, covariances: np.ndarray) -> Between:
    """Return mean and covariance between units.

    Parameters
    ----------
    values : (n, p).
    covariances : (n, p, p) of each unit's own errors.
    """
    count = len(values)
    scale = np.std(values, axis=0, ddof=1)
    scale[scale == 0.0] = 1.0
    x, own = values / scale, covariances / np.outer(scale, scale)
    spread = np.cov(x.T).reshape(x.shape[1], x.shape[1])
    # A start inside the cone of covariances: EM keeps it there.
    eigen, vectors = np.linalg.eigh(spread - np.mean(own, axis=0))
    inside = (vectors * np.maximum(eigen, 1e-3 * np.max(np.diag(spread)))) @ vectors.T
    for _ in range(_ROUNDS):
        mean, mean_covariance, updated = _round(x, own, inside)
        moved = np.max(np.abs(updated - inside)) / np.max(np.diag(updated))
        inside = updated
        if moved < _SETTLED:
            break
    mean, mean_covariance, _ = _round(x, own, inside)
    variance, noise = np.diag(inside), np.mean(np.einsum("ijj->ij", own), axis=0)
    sd = np.sqrt(variance)
    spread_sigma = (variance + noise) / np.maximum(sd, 1e-12) / np.sqrt(2.0 * (count - 1))
    outer = np.outer(scale, scale)
    # To round-off an inverse is not symmetric, and a document's covariance has to be.
    mean_covariance = 0.5 * (mean_covariance + mean_covariance.T)
    return Between(mean * scale, mean_covariance * outer, inside * outer, spread_sigma * scale, count)


def _round(x: Table, own: np.ndarray, inside: Square) -> tuple[Series, Square, Square]:
    weights: np.ndarray = np.linalg.inv(inside + own)
    mean_covariance = inverted(np.sum(weights, axis=0))
    mean: Series = mean_covariance @ np.sum(weights @ x[:, :, None], axis=0)[:, 0]
    pulled = (weights @ (x - mean)[:, :, None])[:, :, 0]
    known = np.sum(weights @ mean_covariance @ weights, axis=0)
    middle = (pulled.T @ pulled + known - np.sum(weights, axis=0)) / len(x)
    updated = inside + inside @ middle @ inside
    symmetric: Square = 0.5 * (updated + updated.T)
    return mean, mean_covariance, symmetric


ACCELEROMETER, GYRO = "accelerometer", "gyro"


@dataclass
class UnitOutcome:
    """What came of a unit.

    Attributes
    ----------
    verdict : "fit", "not fit" or "error".
    limits : "passed", "failed", "undecided", or empty without limits.
    reasons : sentences: why it is not accepted.
    parameters : name, value, standard uncertainty, unit, as the calibration has them.
    vector : to compare units by; None where it cannot be.
    noise : of a sample at rest, raw, by triad.
    hashes : SHA-256 of the recordings.
    unchanged : an earlier result still holds; the rest is then empty.
    calibration, report : texts of the files.
    """

    unit: str
    files: list[str]
    key: str
    verdict: str
    limits: str = ""
    reasons: list[str] = field(default_factory=list[str])
    more: dict[str, str] = field(default_factory=dict[str, str])
    temperature: float | None = None
    parameters: list[tuple[str, float, float, str]] = field(
        default_factory=list[tuple[str, float, float, str]]
    )
    vector: UnitVector | None = None
    noise: dict[str, list[float]] = field(default_factory=dict[str, list[float]])
    hashes: list[str] = field(default_factory=list[str])
    unchanged: bool = False
    calibration: str | None = None
    report: str | None = None

    @property
    def accepted(self) -> bool:
        """Whether the calibration is fit for use, and within limits if there are any."""
        return self.verdict == "fit" and self.limits in ("", "passed")


@dataclass
class Batch:
    """A batch that is done.

    Attributes
    ----------
    units : outcomes in the order of the source.
    stand_out : sentences on units that are not as the others, by the unit's name.
    shared : sentences on what units that are not accepted or stand out have in common.
    remarks : other sentences on the batch.
    worked, kept : units that were calibrated, and whose earlier results still held.
    """

    units: list[UnitOutcome]
    stand_out: dict[str, list[str]]
    shared: list[str]
    remarks: list[str]
    worked: int = 0
    kept: int = 0
    files: list[Path] = field(default_factory=list[Path])

    @property
    def accepted(self) -> int:
        """How many units are fit for use, and within limits if there are any."""
        return sum(unit.accepted for unit in self.units)

    def reasons(self, unit: UnitOutcome) -> list[str]:
        """Return everything that is said of a unit.

        Parameters
        ----------
        unit : of the batch.
        """
        return [*unit.reasons, *self.stand_out.get(unit.unit, [])]
